"""Branches that no output shows are dropped; a pixel of too many rays is an error.

That no output changes is in tests/kernels/test_invariance.py.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from glowing import NIGHT as SKY
from glowing import A, glowing
from random_scenes import random_scene

import cltrace
from cltrace import Renderer, Scene, TooManyRaysError
from cltrace.plan.abi import COUNTERS
from cltrace.plan.lights import useful_lights
from cltrace.plan.materials import Materials, brightest
from cltrace.plan.request import Request
from cltrace.reference import world_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.run.devices import Device

BYTES = ("rgb8",)
HALF = {"reflectance": 0.5, "transmittance": 0.5, "index": 1.5}


def drawn(scene: Scene, device: Device, outputs: tuple[str, ...], *keep: str, **options: object) -> cltrace.Image:
    """By the kernel of all features, so that all scenes share one for the same outputs and `keep`."""
    keep = ("features", *keep)
    return Renderer(scene, device, outputs=outputs, keep=keep, **options).render()  # type: ignore[arg-type]


def counts(scene: Scene, device: Device, *keep: str, **options: object) -> dict[str, int]:
    work = Renderer(scene, device, keep=("features", *keep), **options).work()  # type: ignore[arg-type]
    return {name: work[COUNTERS[name]] for name in ("BOUNCES", "DROPPED", "RETRACED")}


def bubble(color: object, sky: tuple[float, float, float]) -> Scene:
    """From the centre of a ball with r = 1/2 and t = 1/4: each ray comes back, and each refracted one leaves."""
    camera = cltrace.Camera(resolution=(4, 4), max_bounces=100)
    return glowing(camera, [((0, 0, 0), 2)], color, sky, reflectance=0.5, transmittance=0.25, index=1.5)


@pytest.mark.stress
def test_what_is_dropped_at_first(device: Device) -> None:
    """What weighs 2^-16 or less, times the brightest that there is, which is 1 but a little more.

    At the wall that is met after k bounces, 2^-(k + 1) is mirrored and 2^-(k + 2) sent out. So 2^-17 is the first that
    is dropped: 16 mirrored and 15 refracted rays remain of each pixel, and 1 + 2 branches are dropped. The colour is
    (A + sky)/2 with 2^-16 to spare, which is far from where a byte changes: 255 of it is 159.4, 63.75 and 143.4.
    """
    scene = bubble(A, SKY)
    assert counts(scene, device) == {"BOUNCES": 16 * 31, "DROPPED": 16 * 3, "RETRACED": 0}
    assert counts(scene, device, "branches") == {"BOUNCES": 16 * (2 * 101), "DROPPED": 0, "RETRACED": 0}


@pytest.mark.slow
def test_what_might_show_is_traced_again(device: Device) -> None:
    """In a white bubble under a white sky, the sum tends to 1, where a byte that is cut off turns from 254 to 255.

    The limits are 2^-16, 2^-22 and 2^-28, and what is left out is more than a third of them. So the third leaves out
    less than float32 knows of below 1, and twice a pixel is traced again.
    """
    scene = bubble((1, 1, 1), (1, 1, 1))
    assert counts(scene, device, truncate=True)["RETRACED"] == 16 * 2
    assert counts(scene, device)["RETRACED"] == 0
    for truncate in (False, True):
        one, two = (drawn(scene, device, BYTES, *keep, truncate=truncate) for keep in ((), ("branches",)))
        assert np.array_equal(one.rgb8, two.rgb8)


@pytest.mark.stress
def test_nothing_is_dropped_where_more_goes_on_than_comes(device: Device) -> None:
    """One material of r + t > 1 is enough, even one that no ray meets."""
    camera, spheres = cltrace.Camera(resolution=(4, 4), max_bounces=100), [((0, 0, 0), 2), ((9, 0, 0), 1)]
    for t, dropped in ((0.5, True), (0.625, False)):
        scene = glowing(camera, spheres, A, SKY, reflectance=0.5, transmittance=[0.25, t], index=1.5)
        assert (counts(scene, device)["DROPPED"] > 0) is dropped


def test_nothing_is_brighter_than_the_brightest() -> None:
    """The reference's colours of random pixels, and the background."""
    close = 0.0
    for seed in range(40):
        scene = random_scene(seed)
        materials = Materials.of(scene, Request(), None)
        lights = useful_lights(scene.lights, materials.reflect(scene.spheres["material"]), all_of_them=False)
        peak = brightest(materials, scene.spheres["material"], lights, scene.background)
        world, rng = world_of(scene), np.random.default_rng(seed)
        for u, v in rng.integers(0, scene.camera.resolution, (100, 2)).tolist():
            color, _at = trace(world, primary_ray(scene.camera, u, v))
            assert (np.array(color) <= peak).all(), seed
        close = max(close, float((np.array(scene.background) / peak).max()))
    assert close > 0.99  # a background may be the brightest


# ------------------------------------------------------------------------------------------------------- too many rays


def shells(bounces: int, size: tuple[int, int] = (1, 1), small: bool = False) -> Scene:
    """24 concentric balls in which every ray splits: 2^k rays of each depth k, none of which gets out in 22 bounces.

    The eye is in the centre of all; or far before them, where they are in the middle of a dark picture, and so small
    that only the pixel (13, 6) sees them.
    """
    radii = 1 + np.arange(24) / 64
    camera = cltrace.Camera(resolution=size, max_bounces=bounces, horizontal_fov=45)
    at = (0.0, 0.0, 0.0)
    if small:
        x = (13 + 0.5) / size[0] * 2 - 1
        y = (1 - (6 + 0.5) / size[1] * 2) * size[1] / size[0]
        at, radii = (1e4 * x, 1e4 * y, -1e4), radii * 100
    return glowing(camera, [(at, float(radius)) for radius in radii], (0.5, 0.25, 1), (0, 0, 0), **HALF)


@pytest.mark.stress
def test_how_many_rays_are_too_many(device: Device) -> None:
    """With max_bounces n they are 2^(n + 2) - 1: the ceiling is 2^20."""
    assert drawn(shells(18), device, BYTES).rgb8.any()
    with pytest.raises(TooManyRaysError) as error:
        drawn(shells(19), device, BYTES)
    assert error.value.pixel == (0, 0)
    text = "camera.max_bounces: must be lower than 19, with which pixel (0, 0) takes more than 1,048,576 rays; "
    text += "--limit rays=N or CLTRACE_LIMITS allows more"
    assert str(error.value) == text


@pytest.mark.slow
def test_which_pixel_it_is(device: Device, width: int) -> None:
    """In a picture of 24x18 with one such pixel, in any part of it that has the pixel; other parts can be drawn."""
    scene = shells(22, (24, 18), small=True)
    for crop in (None, (10, 5, 14, 18)):
        with pytest.raises(TooManyRaysError) as error:
            drawn(scene, device, BYTES, width=width, crop=crop)
        assert error.value.pixel == (13, 6), crop
    # The pixel is in the packets of these parts, and not in the parts.
    for crop in ((14, 4, 20, 8), (12, 7, 16, 9), (8, 4, 13, 8), (12, 4, 16, 6)):
        assert not drawn(scene, device, BYTES, width=width, crop=crop).rgb8.any(), crop


@pytest.mark.slow
def test_a_renderer_draws_on_after_that(device: Device) -> None:
    """The frame before leaves no note: seen from elsewhere, the scene has no such pixel."""
    scene = shells(22, (24, 18), small=True)
    renderer = Renderer(scene, device, keep=("features",))
    with pytest.raises(TooManyRaysError):
        renderer.render()
    away = renderer.look(replace(scene.camera, lookat=(0, 0, 1)))
    assert not away.render().rgb8.any()
