"""A picture that is stopped leaves its Renderer as it was, and one that is not wanted to stop is right."""

from __future__ import annotations

import os
import pickle
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

import cltrace
from cltrace.base import waiting
from cltrace.plan import lists as plan_lists
from cltrace.run import executor


def nested() -> cltrace.Scene:
    """Eight spheres of glass around each other: at 13 bounces a picture of a second, in one strip."""
    camera = cltrace.Camera((0, 0, 6), (0, 0, 0), horizontal_fov=25, resolution=(24, 12), max_bounces=13)
    light = cltrace.point_light((3, 4, 5), (1, 1, 1))
    centers, radii = np.zeros((8, 3)), 2 - 0.2 * np.arange(8)
    glass = {"reflectance": 0.4, "transmittance": 0.5, "index": 1.5}
    return cltrace.Scene.from_spheres(camera, [light], centers, radii, **glass)


@contextmanager
def handled(number: int, handler: Callable[..., object]) -> Iterator[None]:
    before = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.signal(number, before)


def send(number: int, after: float) -> None:
    threading.Timer(after, os.kill, [os.getpid(), number]).start()


def for_ever(draw: Callable[[], object]) -> None:
    while True:
        draw()


def test_ctrl_c_ends_a_frame_and_the_next_one_is_right() -> None:
    scene = nested()
    expected = cltrace.Renderer(scene, outputs=("color",)).render().color
    renderer = cltrace.Renderer(scene, outputs=("color",))
    with handled(signal.SIGINT, signal.default_int_handler):
        for _ in range(3):
            send(signal.SIGINT, 0.1)
            with pytest.raises(KeyboardInterrupt):
                for_ever(renderer.render)
    np.testing.assert_array_equal(renderer.render().color, expected)


def test_a_handler_that_returns_costs_no_pixel() -> None:
    """The kernel comes back for it, and draws the strip again."""
    scene, heard = nested(), []
    renderer = cltrace.Renderer(scene, outputs=("color",))
    expected = renderer.render().color
    with handled(signal.SIGTERM, lambda *_: heard.append(time.monotonic())):
        send(signal.SIGTERM, 0.1)
        while not heard:
            found = renderer.render().color
            np.testing.assert_array_equal(found, expected)


def test_another_thread_stops_a_frame() -> None:
    renderer, begun = cltrace.Renderer(nested(), outputs=("color",)), threading.Event()
    told: list[int] = []

    def drawn(rows: int) -> None:
        told.append(rows)
        if rows == 0:
            raise ZeroDivisionError

    def draw() -> None:
        begun.set()
        with pytest.raises(ZeroDivisionError):
            for_ever(lambda: renderer.draw(drawn))

    thread = threading.Thread(target=draw)
    thread.start()
    begun.wait()
    while thread.is_alive():
        renderer.stop()
        time.sleep(0.05)
    assert told[-1] == 0


def test_a_stop_before_a_frame_is_heard_in_it() -> None:
    """Also where it comes between the call and the launch; and it costs no pixel."""
    renderer, told = cltrace.Renderer(nested(), outputs=("color",)), list[int]()
    expected = renderer.render().color
    renderer.stop()
    np.testing.assert_array_equal(renderer.draw(told.append).color, expected)
    assert told[0] == 0
    told.clear()
    renderer.draw(told.append)
    assert 0 not in told


def test_a_picture_that_takes_too_long_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Within a launch, too; and the next one is right, and told nothing."""
    renderer, told = cltrace.Renderer(nested(), outputs=("color",)), list[int]()
    expected = renderer.render().color
    with monkeypatch.context() as patch:
        patch.setattr(executor, "MAX_SECONDS", 0.1)
        patch.setattr(waiting, "SLOW", 0.02)  # else a picture may be done before anybody looks at the clock
        for _ in range(2):
            start = time.monotonic()
            with pytest.raises(cltrace.TooSlowError) as error:
                for_ever(renderer.render)
            assert time.monotonic() - start < 30
            assert str(error.value) == (
                "drawing takes longer than 0 s; lower max_bounces, which is 13, or the resolution, which is 24x12"
            )
    np.testing.assert_array_equal(renderer.draw(told.append).color, expected)
    assert 0 not in told


def test_lists_that_take_too_long_are_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of the third light and later ones, as the first one has compilers."""
    monkeypatch.setattr(plan_lists, "MAX_SECONDS", 0)
    scene, lamp = nested(), cltrace.point_light((0, 0, 9))
    cltrace.Renderer(scene.lit_by([lamp] * 2))
    with pytest.raises(cltrace.TooSlowError) as error:
        cltrace.Renderer(scene.lit_by([lamp] * 3))
    assert str(pickle.loads(pickle.dumps(error.value))) == (
        "making lists of what stops light takes longer than 0 s; lower the number of lights, which is 3, or of "
        "surfaces, which is 8"
    )


def test_who_listened_before_hears_signals_too() -> None:
    ear, mouth = socket.socketpair()
    mouth.setblocking(False)
    ear.settimeout(5)
    stopped = threading.Event()
    before = signal.set_wakeup_fd(mouth.fileno())
    try:
        with (
            handled(signal.SIGTERM, lambda *_: None),
            waiting.interruptible(stopped.set, lambda: "slow") as begin,
        ):
            begin()
            os.kill(os.getpid(), signal.SIGTERM)
            assert stopped.wait(5)
            assert ear.recv(8) == bytes([signal.SIGTERM])
        assert signal.set_wakeup_fd(before) == mouth.fileno()
    finally:
        signal.set_wakeup_fd(before)
        ear.close()
        mouth.close()


def test_what_comes_again_and_again_stops_nothing() -> None:
    """As of a profiler: what begins again after each of them would never be done."""
    stopped: list[bool] = []
    with (
        handled(signal.SIGALRM, lambda *_: None),
        waiting.interruptible(lambda: stopped.append(True), lambda: "slow") as begin,
    ):
        begin()
        os.kill(os.getpid(), signal.SIGALRM)
        time.sleep(0.2)
    assert not stopped
