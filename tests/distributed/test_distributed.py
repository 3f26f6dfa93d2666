"""Tiles and frames on a cluster of two worker processes: the bytes of one process, also when workers die."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture

import cltrace
from cltrace import Camera, Scene, cli

distributed = pytest.importorskip("distributed")
cloudpickle = pytest.importorskip("cloudpickle")
dask = pytest.importorskip("dask")

from cltrace import distributed as farm  # noqa: E402
from cltrace.distributed import FarmError, animate, draw, render  # noqa: E402
from cltrace.run import executor  # noqa: E402

# Processes are started, which takes seconds. Of what dask leaves open, nothing is ours.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]

FILE = Path(__file__).parents[2] / "scenes" / "step3-shadows.xml"
MESHES = Path(__file__).parents[2] / "scenes" / "step7-glass.xml"
LIGHTS = [cltrace.ambient_light((0.5, 0.5, 0.5)), cltrace.point_light((3, 9, 6))]
cloudpickle.register_pickle_by_value(sys.modules[__name__])


@contextmanager
def cluster(workers: int) -> Iterator[Any]:
    """A client of so many worker processes."""
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 2}),
        distributed.LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0") as local,
        distributed.Client(local) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with cluster(2) as client:
        yield client


def test_a_cluster_without_workers_is_waited_for_aloud(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(farm, "SILENCE", 0.2)
    monkeypatch.setattr(farm, "ALONE", 1.0)
    with cluster(0) as client, pytest.raises(FarmError, match="has no workers"):
        render(small(), client)
    assert [r.message for r in caplog.records if r.name == "cltrace"] == ["waiting for a worker of the cluster ..."]


def small(width: int = 96, height: int = 72, path: Path = FILE) -> Scene:
    scene = cltrace.load(path)
    return scene.seen_by(replace(scene.camera, resolution=(width, height)))


def pixels(path: Path | str) -> np.ndarray:
    with Picture.open(path) as picture:
        return np.asarray(picture)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def frames() -> list[Any]:
    """Cameras, moved spheres, and another scene."""
    rng = np.random.default_rng(0)
    camera = Camera((0, 0, 12), (0, 0, 0), horizontal_fov=14, resolution=(60, 45))
    scene = Scene.from_spheres(camera, LIGHTS, rng.uniform(-2, 2, (200, 3)), 0.2, rng.uniform(0, 1, (200, 3)))
    moved = [{"centers": rng.uniform(-2, 2, (200, 3))} for _ in range(3)]
    return [scene, *cltrace.orbit(scene, 5)[1:], *moved, small(), *cltrace.orbit(small(), 4)]


def test_frames_are_those_of_one_process(client: Any, tmp_path: Path) -> None:
    one, many = tmp_path / "one", tmp_path / "many"
    one.mkdir()
    many.mkdir()
    cltrace.animate(frames(), one)
    assert animate(frames(), client, many / "frame%04d.png") == [str(many / f"frame{k:04}.png") for k in range(13)]
    inode = (many / "frame0003.png").stat().st_ino
    (many / "frame0007.png").unlink()
    animate(frames(), client, many, skip_existing=True)
    assert (many / "frame0003.png").stat().st_ino == inode
    cltrace.animate(frames()[:8], one / "a.gif", crop=(3, 4, 50, 41))
    animate(frames()[:8], client, many / "a.gif", crop=(3, 4, 50, 41))
    assert contents(one) == contents(many)


@pytest.mark.parametrize(("path", "tiles"), [(FILE, None), (FILE, 1), (FILE, 500), (MESHES, 5)])
def test_tiles_are_one_picture(client: Any, path: Path, tiles: int | None) -> None:
    scene, outputs = small(path=path).in_front_of((0, 0, 0, 0.0)), ("rgb8", "color", "id")
    image = render(scene, client, tiles=tiles, outputs=outputs, crop=(7, 3, 90, 69))
    want = cltrace.render(scene, outputs=outputs, crop=(7, 3, 90, 69))
    assert image.outputs == want.outputs
    for name in want.outputs:
        assert np.array_equal(getattr(image, name), getattr(want, name)), name
    with pytest.raises(ValueError, match="tiles: must be a whole number >= 1, got 0"):
        render(scene, client, tiles=0)
    with pytest.raises(ValueError, match="crop: must be within 0,0,96,72"):
        render(scene, client, crop=(0, 0, 97, 1))


def test_workers_that_are_killed(client: Any, tmp_path: Path) -> None:
    """Each of the two, in the middle of the frames: their tasks are done by others."""
    pids = list(client.run(os.getpid).values())

    def items() -> Iterator[Any]:
        for k, camera in enumerate(cltrace.orbit(small(), 40)):
            if k in (12, 25):
                os.kill(pids[k // 20], signal.SIGKILL)
            yield camera

    names = animate(items(), client, tmp_path / "f%02d.png", scene=small())
    assert len(names) == 40
    for k, camera in enumerate(cltrace.orbit(small(), 40)):
        assert np.array_equal(cltrace.render(small().seen_by(camera)).rgb8, pixels(names[k])), k
    client.wait_for_workers(2, timeout=60)


def noted(*what: Any) -> Any:
    """As draw(), and a file grows with each try."""
    with Path(os.environ["TRIES"]).open("a") as file:
        file.write(".")
    return draw(*what)


def fail(*_: object) -> None:
    raise farm.WorkerError("no room (on host, process 5)")


def test_what_fails_again_and_again_is_named(client: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(farm, "draw", fail)
    with pytest.raises(FarmError, match=r"^frame 0: no room \(on host, process 5\)$"):
        animate(cltrace.orbit(small(), 3), client, tmp_path / "f%d.png", scene=small())
    with pytest.raises(FarmError, match=r"^rows 0 to 15: no room"):
        render(small(), client, tiles=3)
    monkeypatch.undo()
    assert not list(tmp_path.iterdir())
    assert np.array_equal(render(small(), client).rgb8, cltrace.render(small()).rgb8)


def limited(seconds: float, tries: str = "") -> None:
    """In a worker: its limit of seconds, and the file of noted()."""
    executor.MAX_SECONDS, os.environ["TRIES"] = seconds, tries


def test_what_is_too_slow_is_not_tried_again(client: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As it would be so on each worker; and it is the error of one process."""
    monkeypatch.setattr(farm, "draw", noted)
    client.run(limited, 0, str(tmp_path / "tries"))
    try:
        with pytest.raises(cltrace.TooSlowError, match=r"^drawing takes longer than 0 s; lower the resolution"):
            render(small(), client, tiles=1)
    finally:
        client.run(limited, 1000)
    assert (tmp_path / "tries").read_text() == "."
    assert len(list(tmp_path.iterdir())) == 1


def test_what_kills_its_workers_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a cluster of its own, which may have no worker in the end."""
    monkeypatch.setattr(farm, "draw", lambda *_: os._exit(7))
    monkeypatch.setattr(farm, "ALONE", 5.0)
    with cluster(1) as client, pytest.raises(FarmError, match=r"^rows 0 to 71: workers have died"):
        render(small(), client, tiles=1)


def test_workers_without_a_driver(tmp_path: Path) -> None:
    """One of two: the other one does it all. Both: an error, with their host."""
    nanny = {"cls": distributed.Nanny, "options": {"nthreads": 1}}
    lacking = {"cls": distributed.Nanny, "options": {"nthreads": 1, "env": {"PYOPENCL_CTX": "nosuchthing"}}}
    scheduler = {"cls": distributed.Scheduler, "options": {"dashboard": False, "port": 0}}
    for workers in ({"a": nanny, "b": lacking}, {"a": lacking}):
        with (
            distributed.SpecCluster(workers=workers, scheduler=scheduler) as cluster,
            distributed.Client(cluster) as client,
        ):
            client.wait_for_workers(len(workers), timeout=60)
            if "b" in workers:
                assert np.array_equal(render(small(), client, tiles=6).rgb8, cltrace.render(small()).rgb8)
            else:
                with pytest.raises(FarmError, match="no worker has an OpenCL device"):
                    render(small(), client)


def test_a_scheduler_that_goes_away(tmp_path: Path) -> None:
    """The error comes soon, and what is written is whole."""
    file, out = tmp_path / "scheduler.json", tmp_path / "out"
    out.mkdir()
    how: Any = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    line = [sys.executable, "-m", "distributed.cli.dask_{}", "--scheduler-file", str(file), "--no-dashboard"]
    scheduler, worker = (
        subprocess.Popen([*map(lambda part, who=who: part.format(who), line), *more], **how)
        for who, more in (("scheduler", ["--port", "0"]), ("worker", ["--nthreads", "1", "--death-timeout", "5"]))
    )
    while not file.exists():
        time.sleep(0.05)
    cameras = cltrace.orbit(small(), 100)

    def items() -> Iterator[Any]:
        yield from cameras[:20]
        scheduler.kill()
        yield from cameras[20:]

    try:
        client = distributed.Client(scheduler_file=str(file), timeout=30)
        with pytest.raises(FarmError, match="the cluster has gone"):
            animate(items(), client, out / "f%02d.png", scene=small())
        client.close(timeout=1)
    finally:
        for process in (scheduler, worker):
            process.kill()
            process.wait()
    there = sorted(out.iterdir())
    assert 5 <= len(there) <= 20
    for path, camera in zip(there, cameras, strict=False):
        assert np.array_equal(pixels(path), cltrace.render(small().seen_by(camera)).rgb8)


def test_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In processes of its own: workers import the program anew, and nothing from the user's folder. Dask's usual port
    may be taken, as by another cluster."""
    script = tmp_path / "cltrace"
    script.write_text("from cltrace.__main__ import main\n\nif __name__ == '__main__':\n    main()\n")
    work = tmp_path / "work"
    work.mkdir()
    (work / "re.py").write_text("raise SystemExit('a file of the user')\n")
    monkeypatch.chdir(work)
    with socket.socket() as taken:
        with suppress(OSError):  # then it is taken already
            taken.bind(("", 8787))
            taken.listen()
        for name, more in (("a.png", []), ("n.png", ["--show", "normal"]), ("f%d.png", ["--orbit", "3"])):
            line = [str(FILE), "--size", "96x72", "-o", name, *more]
            cluster = ["--cluster", "local:2", *([] if more else ["--tiles", "5"])]
            command = [sys.executable, str(script), *line, *cluster]
            done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
            assert done.stderr.startswith("cltrace: wrote ")
            assert len(done.stderr.splitlines()) == 1
            found = contents(work)
            assert cli.main([*line, "-q"]) == 0
            assert contents(work) == found


@pytest.mark.parametrize(
    ("more", "status", "message"),
    [
        (["--cluster", "tcp://127.0.0.1:1"], 3, "--cluster tcp://127.0.0.1:1: there is no scheduler: "),
        (["--cluster", "nonsense"], 3, "--cluster nonsense: there is no scheduler: "),
        (["--cluster", "local", "--check"], 2, "--check does not go with --cluster"),
        (["--cluster", "local", "--show", "depth"], 2, "--show depth does not go with --cluster"),
        (["--cluster", "local", "-o", "-"], 2, "--cluster takes one -o, of a file"),
        (["--tiles", "3"], 2, "--tiles goes with --cluster"),
        (["nothing.xml", "--cluster", "nonsense", "-o", "{}.png"], 2, "nothing.xml: "),  # before the scheduler is asked
    ],
)
def test_faults_of_the_command(
    more: list[str], status: int, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main([*more] if "nothing.xml" in more else [str(FILE), *more]) == status
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_worker_that_dies_while_it_starts(tmp_path: Path) -> None:
    """It is not waited for, which took a minute."""
    (tmp_path / "dies.py").write_text("import os\nos._exit(9)\n")
    environment = os.environ | {"DASK_DISTRIBUTED__WORKER__PRELOAD": str(tmp_path / "dies.py")}
    line = [sys.executable, "-m", "cltrace", str(FILE), "--cluster", "local:2", "-o", "x.png"]
    done = subprocess.run(line, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=50, check=False)
    assert done.returncode == 3
    assert done.stderr.splitlines()[-1] == "cltrace: --cluster local:2: a worker has died while it started"
    assert not list(tmp_path.glob("*.png"))


@pytest.mark.parametrize(("number", "said"), [(signal.SIGINT, "cltrace: interrupted\n"), (signal.SIGHUP, "")])
def test_ctrl_c(tmp_path: Path, number: signal.Signals, said: str) -> None:
    """Which a terminal sends to the workers, too: what is written is whole, and no process is left.

    A terminal that is closed sends SIGHUP, which ended multiprocessing's own processes, and these printed tracebacks.
    """
    line = [sys.executable, "-m", "cltrace", str(FILE), "--cluster", "local:2", "--orbit", "999", "-o", "f%03d.png"]
    with subprocess.Popen(line, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        while process.poll() is None and len(list(tmp_path.glob("f*.png"))) < 5:
            time.sleep(0.02)
        os.killpg(process.pid, number)
        _, words = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert re.sub("^cltrace: wrote .*\n", "", words) == said
    assert not list(tmp_path.glob(".*.part"))
    assert all(pixels(path).shape == (361, 481, 3) for path in tmp_path.iterdir())
    patience = time.monotonic() + 30
    while time.monotonic() < patience:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.1)
    pytest.fail("processes are left")
