"""Movies: what each frame shows, where it goes, and what is left after a fault, a kill or a Ctrl-C."""

from __future__ import annotations

import gc
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import chdir
from dataclasses import replace
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image as Picture

import cltrace
from cltrace import Camera, Scene, cli
from cltrace.movie import animate
from cltrace.movie.frames import frames_of, pattern_of, range_of
from cltrace.movie.writers import Fingerprints
from cltrace.run import pack

FILE = Path(__file__).parents[2] / "scenes" / "step3-shadows.xml"
LIGHTS = [cltrace.ambient_light((0.5, 0.5, 0.5)), cltrace.point_light((3, 9, 6))]
CAMERA = Camera((0, 2, 12), (0, 0, 0), horizontal_fov=14, resolution=(41, 30))


def balls(n: int = 40, seed: int = 0) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    centers, colors = rng.uniform(-2, 2, (n, 3)), rng.uniform(0, 1, (n, 3))
    return {"centers": centers, "radii": rng.uniform(0.1, 0.4, n), "colors": colors}


def scene_of(n: int = 40, seed: int = 0, camera: Camera = CAMERA) -> Scene:
    return Scene.from_spheres(camera, LIGHTS, **balls(n, seed))


def pixels(path: Path | str) -> np.ndarray:
    with Picture.open(path) as picture:
        return np.asarray(picture.convert("RGB"))


def listed(folder: Path | str) -> list[str]:
    return sorted(path.name for path in Path(folder).iterdir())


def want(scene: Scene) -> np.ndarray:
    return cltrace.render(scene).rgb8


# What the frames show.


def test_orbit_goes_round_what_is_looked_at() -> None:
    scene = scene_of(camera=Camera((1, 2, 6), (1, 2, 1), resolution=(8, 6)))
    cameras = cltrace.orbit(scene, 4)
    assert cameras[0] is scene.camera
    places = [(1, 2, 6), (6, 2, 1), (1, 2, -4), (-4, 2, 1)]  # counter-clockwise from above
    for camera, place in zip(cameras, places, strict=True):
        assert camera.position == pytest.approx(place, abs=1e-12)
        assert (camera.lookat, camera.resolution) == ((1, 2, 1), (8, 6))
        assert camera.up == pytest.approx((0, 1, 0), abs=1e-12)
    half = cltrace.orbit(scene, 2, "x", degrees=-180)
    assert half[1].position == pytest.approx((1, 7, 1), abs=1e-12)
    assert half[1].up == pytest.approx((0, 0, -1), abs=1e-12)
    assert cltrace.orbit(scene, 2, (-3, 0, 0), degrees=180)[1].position == pytest.approx((1, 7, 1), abs=1e-12)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [("2:5", [2, 3, 4]), (":3", [0, 1, 2]), ("7:", [7, 8, 9]), ("1::4", [1, 5, 9]), ("3", [3]), (":", list(range(10)))]
    + [(text, None) for text in ("", "-1:3", "1:2:0", "5:5", "6:2", "a", "1:2:3:4", "1.5", "9" * 12)],
)
def test_ranges(text: str, numbers: list[int] | None) -> None:
    if numbers is None:
        with pytest.raises(ValueError, match="must"):
            range_of(text)
    else:
        frames = frames_of([CAMERA] * 10, scene_of(), range_of(text))
        assert [frame.number for frame in frames] == numbers


def test_frames_follow_from_each_other() -> None:
    first, other = scene_of(), replace(CAMERA, position=(3, 2, 11))
    moved = balls(seed=1)["centers"]
    values = {"values": np.linspace(0, 1, 40), "cmap": [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0)], "clim": (0, 1)}
    items = [other, {"centers": moved}, {"camera": CAMERA, "radii": 0.2}, values, first, {"colors": (1, 0, 0)}]
    shown = [frame.scene for frame in frames_of(items, first)]
    assert [scene.camera for scene in shown] == [other, other, CAMERA, CAMERA, CAMERA, CAMERA]
    assert np.array_equal(shown[0].spheres, first.spheres)
    assert np.array_equal(shown[2].spheres["center"], moved)
    assert (shown[2].spheres["radius"] == 0.2).all()
    assert shown[3].materials["color"][[0, -1]].tolist() == [[0, 0, 0], [1, 1, 1]]
    assert shown[4] is first
    assert (shown[5].materials["color"] == (1, 0, 0)).all()
    picked = [frame.scene for frame in frames_of(items, first, slice(2, 3))]
    assert np.array_equal(picked[0].spheres, shown[2].spheres)


@pytest.mark.parametrize("many", [pack.MANY, pytest.param(0, marks=pytest.mark.slow)])
def test_images_are_those_of_new_renderers(many: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of cameras, moved and coloured spheres, another number of them, and scenes that have nothing in common."""
    monkeypatch.setattr(pack, "MANY", many)
    first, rng = scene_of(300), np.random.default_rng(5)
    other = cltrace.load(FILE).seen_by(CAMERA)
    items: list[Any] = [first, *cltrace.orbit(first, 3)]
    items += [{"centers": rng.uniform(-2, 2, (300, 3))} for _ in range(3)]
    items += [{"colors": rng.uniform(0, 1, (300, 3))}, {**balls(200), "camera": replace(CAMERA, resolution=(30, 41))}]
    items += [other, scene_of(300, seed=3), scene_of(300, seed=4)]
    images = list(cltrace.animate(items))
    scenes = [frame.scene for frame in frames_of(items)]
    assert len(images) == len(scenes) == 12
    for image, scene in zip(images, scenes, strict=True):
        assert np.array_equal(image.rgb8, want(scene))


def test_an_array_that_its_owner_changes_in_place() -> None:
    """A frame is prepared before the next one is asked for."""
    centers = balls()["centers"]
    copies = []

    def steps() -> Iterator[Any]:
        yield scene_of()
        for _ in range(4):
            centers[:] += 0.1
            copies.append(centers.copy())
            yield {"centers": centers}

    images = list(cltrace.animate(steps()))[1:]
    for image, places in zip(images, copies, strict=True):
        assert np.array_equal(image.rgb8, want(Scene.from_spheres(CAMERA, LIGHTS, **(balls() | {"centers": places}))))


def test_an_iterator_takes_what_it_needs() -> None:
    taken = 0

    def endless() -> Iterator[Any]:
        nonlocal taken
        while True:
            taken += 1
            yield scene_of()

    images = cltrace.animate(endless(), crop=(1, 2, 9, 7))
    assert next(images).rgb8.shape == (5, 8, 3)
    assert taken == 2
    images.close()  # type: ignore[attr-defined]
    assert taken == 2


def orbit(*arguments: Any) -> list[Any]:
    return cltrace.orbit(scene_of(), *arguments)


def movie(items: Any, *output: str, **options: Any) -> list[Any]:
    return list(cltrace.animate(items, *output, **options))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: orbit(0), ValueError, "n: must be a whole number >= 1, got 0"),
        (lambda: orbit(2.5), ValueError, "n: must be a whole number >= 1, got 2.5"),
        (lambda: orbit(2, "w"), ValueError, "axis: must be x, y, z or three numbers, got 'w'"),
        (lambda: orbit(2, (0, 0, 0)), ValueError, "axis: must have a length"),
        (lambda: orbit(2, None, float("nan")), ValueError, "degrees: must be a finite number, got nan"),
        (lambda: movie([CAMERA]), TypeError, "frames[0]: must be a Scene, since there is no scene=..."),
        (lambda: movie([7], scene=scene_of()), TypeError, "frames[0]: must be a Scene, a Camera, or a dict of what"),
        (lambda: movie([scene_of(), {"a": 1}]), ValueError, "frames[1]: must be of camera, centers, radii"),
        (lambda: movie([scene_of(), {"radii": -1}]), ValueError, "frames[1]: radii: must be > 0, got -1"),
        (lambda: movie([scene_of(), {"camera": 3}]), TypeError, "frames[1]: camera: must be a cltrace.Camera or Ortho"),
        (lambda: movie(CAMERA), TypeError, "frames: must be a list, or another iterable, of Scenes, "),
        (lambda: movie({"a": 1}), TypeError, "frames: must be a list, or another iterable, of Scenes, "),
        (lambda: movie([], "%d.png"), ValueError, "frames: must be at least one, got none"),
        (lambda: movie(iter(()), "%d.png"), ValueError, "frames: must be at least one, got none"),
        (lambda: movie([scene_of()], "no/%d.png"), FileNotFoundError, "output: there is no folder"),
        (lambda: movie([scene_of()], "m.gif", skip_existing=True), ValueError, "skip_existing: is for frames of files"),
        (lambda: movie([scene_of()], skip_existing=True), ValueError, "skip_existing: there is nothing to skip"),
        (lambda: movie([scene_of()], "%d.png", skip_existing=True, each=print), ValueError, "skip_existing: does not"),
    ],
)
def test_what_is_refused(call: Callable[[], Any], error: type[Exception], message: str, tmp_path: Path) -> None:
    with chdir(tmp_path), pytest.raises(error, match=re.escape(message)):
        call()
    assert not list(tmp_path.iterdir())


# Where they go.


@pytest.mark.parametrize(
    ("output", "names"),
    [
        ("f%04d.png", ["f0000.png", "f0012.png"]),
        ("%d.png", ["0.png", "12.png"]),
        ("50%%_%03d.png", ["50%_000.png", "50%_012.png"]),
        ("{}-%02d.png", ["a%d-00.png", "a%d-12.png"]),
        ("m.MP4", ["m.MP4", "m.MP4"]),
        (".", ["a%d0000.png", "a%d0012.png"]),
        ("100%.png", ["100%.png"]),
        ("{}.png", ["a%d.png"]),
        (".", ["a%d.png"]),
        ("", "must not be empty"),
        ("f.png", "must have a %04d for the number of a frame, such as frame%04d.png, got 'f.png'"),
        ("f%04d%04d.png", "must have one %d or %04d"),
        ("f%4d.png", "must have one %d or %04d"),
        ("f%04d.gif", "a movie is one file, and its name has no number"),
        ("f%04d.jpg", "the name of frames must end in .png, of a movie in .mp4, .gif, .apng, got 'f%04d.jpg'"),
    ],
)
def test_names(output: str, names: list[str] | str, tmp_path: Path) -> None:
    """The names of frames 0 and 12, or of one picture, or what is wrong with the output."""
    with chdir(tmp_path):
        if isinstance(names, str):
            with pytest.raises(ValueError, match=re.escape(names)):
                cltrace.animate([scene_of()], output)
        else:
            pattern = pattern_of(output, "a%d", len(names) > 1)
            assert [pattern.of(number) for number in (0, 12)[: len(names)]] == names


def test_files(tmp_path: Path) -> None:
    scene = scene_of()
    cameras = cltrace.orbit(scene, 3)
    names = cltrace.animate(cameras, tmp_path / "f%02d.png", scene=scene, truncate=True)
    assert names == [str(tmp_path / f"f0{k}.png") for k in range(3)]
    for name, camera in zip(names, cameras, strict=True):
        assert np.array_equal(pixels(name), cltrace.render(scene.seen_by(camera), truncate=True).rgb8)
    assert listed(tmp_path) == ["f00.png", "f01.png", "f02.png"]


def test_each_draws_on_frames(tmp_path: Path) -> None:
    scene = scene_of()
    cameras, seen = cltrace.orbit(scene, 3), list[int]()
    wanted = [want(scene.seen_by(camera)) for camera in cameras]
    for k, array in enumerate(wanted):
        array[:5, : k + 1] = 255, 0, 0

    def stamp(number: int, image: cltrace.Image) -> None:
        seen.append(number)
        image.rgb8[:5, : number + 1] = 255, 0, 0

    def returned(number: int, image: cltrace.Image) -> Picture.Image:
        copy = cltrace.Image(rgb8=np.array(image))
        stamp(number, copy)
        return Picture.fromarray(copy.rgb8)

    for each in (stamp, returned):
        names = cltrace.animate(cameras, tmp_path / "f%d.png", scene=scene, each=each)
        images = cltrace.animate(cameras, scene=scene, each=each)
        for name, image, array in zip(names, images, wanted, strict=True):
            assert np.array_equal(pixels(name), array)
            assert np.array_equal(image.rgb8, array)
    assert seen == [0, 1, 2] * 4
    # A file that something was drawn on does not say that it shows the scene.
    cltrace.animate(cameras, tmp_path / "f%d.png", scene=scene, skip_existing=True)
    assert np.array_equal(pixels(names[0]), want(scene))
    for bad in (np.zeros((3, 3, 3), np.uint8), np.zeros((30, 41, 3))):
        with pytest.raises(ValueError, match=r"^each: must return None or uint8 of shape \(30, 41, 3\) or"):
            cltrace.animate(cameras, tmp_path / "bad%d.png", scene=scene, each=lambda number, image, bad=bad: bad)
    transparent = scene.in_front_of("#ffffff00")
    image = next(iter(cltrace.animate([transparent], each=lambda number, image: image.rgba8 // 2)))
    assert np.array_equal(np.asarray(image), cltrace.render(transparent).rgba8 // 2)


def test_a_movie_of_pictures_that_are_there(tmp_path: Path) -> None:
    scene = scene_of()
    names = cltrace.animate(cltrace.orbit(scene, 3), tmp_path / "f%d.png", scene=scene)
    movie = tmp_path / "a.apng"
    assert cltrace.animate(sorted(tmp_path.glob("*.png")), movie) == [str(movie)]
    with Picture.open(movie) as found:
        assert found.n_frames == 3
        for k, name in enumerate(names):
            found.seek(k)
            assert np.array_equal(np.asarray(found.convert("RGB")), pixels(name))

    def grey(number: int, image: cltrace.Image) -> None:
        image.rgb8[:] = number

    cltrace.animate(iter(names), movie, each=grey)
    with Picture.open(movie) as found:
        found.seek(2)
        assert set(np.asarray(found.convert("RGB")).ravel()) == {2}
    before = movie.read_bytes()
    Picture.new("RGB", (7, 7)).save(tmp_path / "small.png")
    Path(tmp_path / "text.png").write_text("no picture")
    for frames, output, kind, words in (
        ([*names, tmp_path / "small.png"], movie, ValueError, r"frames\[3\]: must have 41x30 pixels .* got 7x7"),
        ([*names, CAMERA], movie, TypeError, r"frames\[3\]: must be the name of a picture, as the first one"),
        ([CAMERA, *names], movie, TypeError, r"frames\[1\]: must be a Scene, a Camera, or a dict"),
        ([*names, tmp_path / "no.png"], movie, FileNotFoundError, "no.png"),
        ([tmp_path / "text.png"], movie, OSError, "text.png"),
        (names, tmp_path / "b%d.png", ValueError, "output: of files the frames make one, whose name ends in .mp4"),
        (names[0], movie, TypeError, "frames: must be a list"),
        ([movie], movie, cltrace.UsageError, "which the picture is made from and would replace"),
    ):
        with pytest.raises(kind, match=words):
            cltrace.animate(frames, output, scene=scene)
    assert movie.read_bytes() == before
    assert listed(tmp_path) == ["a.apng", "f0.png", "f1.png", "f2.png", "small.png", "text.png"]


@pytest.mark.parametrize("suffix", [".apng", ".gif", ".mp4"])
def test_movies(suffix: str, tmp_path: Path) -> None:
    """Of odd sizes; what is read again is the frames, for a GIF those of few colours, for an mp4 nearly."""
    path = tmp_path / f"movie{suffix}"
    flat = [Scene.from_spheres(CAMERA, [cltrace.ambient_light((1, 1, 1))], [(0, 0, 0)], 2, c, ka=1) for c in np.eye(3)]
    assert cltrace.animate(flat, path, fps=10) == [str(path)]
    raw = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(raw, capture_output=True, check=True)
    assert b" 10 fps" in done.stderr
    frames = np.frombuffer(done.stdout, np.uint8).reshape(3, 30, -1, 3)
    for frame, scene in zip(frames, flat, strict=True):
        difference = np.abs(frame[:30, :41].astype(int) - want(scene))
        if suffix == ".mp4":
            assert np.percentile(difference, 80) <= 8
            assert np.array_equal(frame[:, 40], frame[:, 41])
        else:
            assert not difference.any()
    assert listed(tmp_path) == [path.name]


@pytest.mark.parametrize(
    ("name", "fps", "times"),
    [("a.gif", 30, [30, 40, 30]), ("a.gif", 40, [20, 30, 30]), ("a.gif", 0.4, [2500] * 3), ("a.gif", 60, [20] * 3)]
    + [("a.apng", fps, [1000 / fps] * 3) for fps in (30, 0.5, 29.97)],
)
def test_times_of_frames_add_up(name: str, fps: float, times: list[float], tmp_path: Path) -> None:
    cltrace.animate([scene_of(seed=k) for k in range(3)], tmp_path / name, fps=fps)
    with Picture.open(tmp_path / name) as picture:
        found = [picture.seek(k) or picture.info["duration"] for k in range(3)]  # type: ignore[func-returns-value]
        assert picture.info["loop"] == 0
    assert found == pytest.approx(times, 1e-4)


def failing() -> Iterator[Any]:
    yield from cltrace.orbit(scene_of(), 3)
    raise RuntimeError("the simulation has blown up")


def test_frames_before_an_error_are_drawn(tmp_path: Path) -> None:
    """What a generator has yielded before it fails is not lost."""
    with pytest.raises(RuntimeError, match="blown up"):
        cltrace.animate(failing(), tmp_path / "%d.png", scene=scene_of())
    for k, camera in enumerate(cltrace.orbit(scene_of(), 3)):
        assert np.array_equal(pixels(tmp_path / f"{k}.png"), want(scene_of().seen_by(camera)))


@pytest.mark.parametrize("suffix", [".apng", ".gif", ".mp4"])
def test_a_movie_that_fails_leaves_the_old_one(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"movie{suffix}"
    path.write_bytes(b"old")
    with pytest.raises(RuntimeError, match="blown up"):
        cltrace.animate(failing(), path, scene=scene_of())
    sizes = [scene_of(), scene_of(camera=replace(CAMERA, resolution=(20, 20)))]
    with pytest.raises(
        ValueError, match=re.escape("frames[1]: must have 41x30 pixels of 3 channels, as the first one of the movie")
    ):
        cltrace.animate(sizes, path)
    assert path.read_bytes() == b"old"
    assert listed(tmp_path) == [path.name]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # imageio-ffmpeg leaves a pipe
def test_without_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A program that fails, and none at all: nothing is left, or nothing is drawn."""
    monkeypatch.setattr(imageio_ffmpeg._io, "get_ffmpeg_exe", lambda: "/bin/false")
    with pytest.raises(cltrace.UsageError, match=r"cannot write .*m.mp4: ffmpeg has failed"):
        cltrace.animate([scene_of()] * 3, tmp_path / "m.mp4")
    gc.collect()
    monkeypatch.setattr(animate, "on_device", lambda *_: pytest.fail("drawn"))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(cltrace.MissingPackageError, match=re.escape("pip install 'cltrace[movie]'")):
        cltrace.animate([scene_of()], tmp_path / "m.mp4")
    assert not list(tmp_path.iterdir())


# Files that are there.


def test_fingerprints() -> None:
    """Alike for equal contents, wherever they are from, and others for any change that a picture could show."""
    scene = cltrace.load(FILE)
    marks = Fingerprints({"crop": None})
    same = marks.of(scene)
    assert marks.of(replace(scene, output_file="other.png")) == same
    assert Fingerprints({"crop": None}).of(cltrace.load(FILE)) == same
    assert Fingerprints({"crop": (0, 0, 1, 1)}).of(scene) != same
    spheres, materials, lights = scene.spheres.copy(), scene.materials.copy(), scene.lights.copy()
    spheres["radius"][-1] *= 1 + 2e-16
    materials["ks"][0] += 1e-16
    lights["color"][-1, 2] += 1e-15
    textured = Scene.from_meshes(CAMERA, LIGHTS, [cltrace.Mesh(np.eye(3), [(0, 1, 2)])])
    others = [replace(scene, spheres=spheres), replace(scene, materials=materials), replace(scene, lights=lights)]
    others += [replace(scene, background=(0, 0, 1e-9)), scene.seen_by(replace(scene.camera, max_bounces=3)), textured]
    others += [textured.seen_by(scene.camera), scene_of()]
    found = [marks.of(other) for other in others]
    assert len({same, *found}) == 1 + len(others)
    assert marks.of(scene) == same


def test_what_is_there_and_right_is_kept(tmp_path: Path) -> None:
    scene, pattern = scene_of(), tmp_path / "f%d.png"
    cameras = cltrace.orbit(scene, 6)

    def run(**options: Any) -> list[int]:
        """Which frames are written."""
        before = {path: path.stat().st_ino for path in tmp_path.iterdir()}
        names = cltrace.animate(cameras, pattern, scene=scene, skip_existing=True, **options)
        assert len(names) == 6
        return [k for k, name in enumerate(names) if Path(name).stat().st_ino != before.get(Path(name))]

    assert run() == [0, 1, 2, 3, 4, 5]
    assert run() == []
    (tmp_path / "f1.png").unlink()
    (tmp_path / "f2.png").write_bytes((tmp_path / "f2.png").read_bytes()[:-20])  # not whole
    cltrace.render(scene.seen_by(cameras[3])).save(tmp_path / "f3.png")  # of unknown origin
    shutil.copy(tmp_path / "f5.png", tmp_path / "f4.png")  # another frame
    assert run() == [1, 2, 3, 4]
    assert run(truncate=True) == [0, 1, 2, 3, 4, 5]
    assert run(truncate=True) == []
    cameras[2] = replace(cameras[2], horizontal_fov=14.5)
    assert run(truncate=True) == [2]
    scene = scene_of(seed=9)
    assert run(truncate=True) == [0, 1, 2, 3, 4, 5]


LINE = (sys.executable, "-m", "cltrace", str(FILE), "--size", "240x180", "--orbit", "100", "-o", "f%03d.png")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What one run leaves."""
    folder = tmp_path_factory.mktemp("whole")
    subprocess.run(LINE, cwd=folder, check=True, capture_output=True)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_killed_and_continued(number: signal.Signals, tmp_path: Path, whole: dict[str, bytes]) -> None:
    """At frame 37 of 100: what is there then is whole, and at the end it is what one run leaves."""
    with subprocess.Popen(LINE, cwd=tmp_path, stderr=subprocess.PIPE) as process:
        while process.poll() is None and len(list(tmp_path.glob("f*.png"))) < 37:
            time.sleep(0.002)
        process.send_signal(number)
        status = process.wait(60)
    assert status == (-number if number == signal.SIGKILL else 128 + number)
    there = {path.name: path.stat().st_ino for path in tmp_path.glob("f*.png")}
    assert 37 <= len(there) < 100
    parts = list(tmp_path.glob(".*.part"))
    assert not parts or number == signal.SIGKILL  # which nobody can clean up after
    for part in parts:
        part.unlink()
    done = subprocess.run([*LINE, "--skip-existing"], cwd=tmp_path, check=True, capture_output=True)
    assert done.stderr.startswith(b"cltrace: wrote %d pictures" % (100 - len(there)))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == whole
    assert len(whole) == 100
    assert all((tmp_path / name).stat().st_ino == inode for name, inode in there.items())


# The command.


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, list[str]]:
    status = cli.main([*map(str, arguments)])
    streams = capsys.readouterr()
    assert streams.out == ""
    return status, streams.err.splitlines()


def test_orbit_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = cltrace.load(FILE)
    scene = scene.seen_by(replace(scene.camera, resolution=(40, 30)))
    with chdir(tmp_path):
        status, lines = call(capsys, FILE, "--orbit", 4, "--size", "40x30", "--axis", "0,0,1", "--degrees", -90)
        assert status == 0
        assert lines[0].startswith("cltrace: wrote 4 pictures, step3-shadows0000.png to step3-shadows0003.png, ")
        for k, camera in enumerate(cltrace.orbit(scene, 4, "z", -90)):
            assert np.array_equal(pixels(f"step3-shadows000{k}.png"), want(scene.seen_by(camera)))
        options = ("--size", "40x30", "--show", "normal", "--space", "camera")
        assert call(capsys, FILE, "--orbit", 4, "--frames", "1::2", *options, "-o", "n%d.png", "-q") == (0, [])
        assert sorted(Path().glob("n*")) == [Path("n1.png"), Path("n3.png")]
        camera = cltrace.orbit(scene, 4)[3]
        image = cltrace.render(scene.seen_by(camera), outputs=("normal",))
        assert np.array_equal(pixels("n3.png"), image.as_rgb8("normal", camera.basis()))
        for name in ("c.apng", "c.gif"):
            options = ("--orbit", 2, "--size", "40x30", "--transparent", "--fps", 5, "-q", "-o", name)
            assert call(capsys, FILE, *options) == (0, [])
        with Picture.open("c.apng") as picture:
            assert (picture.mode, picture.n_frames, picture.info["duration"]) == ("RGBA", 2, 200)
            clear = cltrace.render(scene.in_front_of((*scene.background, 0.0)), outputs=("rgba8",)).rgba8
            assert np.array_equal(np.asarray(picture), clear)


def test_several_scenes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each gets its picture; a fault of one is told, and the others are drawn."""
    text = FILE.read_text()
    (tmp_path / "a.xml").write_text(text)
    (tmp_path / "bad.xml").write_text(text.replace('radius="0.5"', 'radius="-1"'))
    (tmp_path / "c.xml").write_text(text.replace("step3-shadows.png", "c.png"))
    (tmp_path / "out").mkdir()
    scene = cltrace.load(FILE)
    scene = scene.seen_by(replace(scene.camera, resolution=(40, 30)))
    with chdir(tmp_path):
        for output in ("out", "out/", "out/{}.png"):
            status, lines = call(capsys, "a.xml", "--size", "40x30", "-o", output, "bad.xml", "c.xml")
            assert status == 2
            assert re.match(r"bad.xml:\d+: sphere: radius must be > 0, got -1", lines[0])
            assert lines[-1].startswith("cltrace: wrote 2 pictures, out/a.png to out/c.png, ")
            assert listed("out") == ["a.png", "c.png"]
            for name in ("a", "c"):
                assert np.array_equal(pixels(f"out/{name}.png"), want(scene))
                (tmp_path / "out" / f"{name}.png").unlink()
        assert call(capsys, "a.xml", "c.xml", "--size", "40x30", "-q") == (0, [])
        assert (Path("step3-shadows.png").exists(), Path("c.png").exists()) == (True, True)
        assert call(capsys, "a.xml", "c.xml", "--orbit", 2, "--size", "40x30", "-q", "-o", "out") == (0, [])
        assert listed("out") == ["a0000.png", "a0001.png", "c0000.png", "c0001.png"]
        assert call(capsys, "a.xml", "c.xml", "--frames", "1", "--size", "40x30", "-q", "-o", "{}_.png") == (0, [])
        assert (Path("a_.png").exists(), Path("c_.png").exists()) == (False, True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{a}", "{b}", "-o", "x.png"], "-o: a.xml and b.xml would both be x.png; have {} in it, which is the name"),
        (["{a}", "{b}", "--check"], "--check is for one picture, of one scene"),
        (["{a}", "--orbit", "2", "--show", "lit"], "--show lit is for one picture, of one scene"),
        (["{a}", "--orbit", "2", "-o", "-"], "-o - is for one picture, of one scene"),
        (["{a}", "--axis", "x"], "--axis goes with --orbit"),
        (["{a}", "--frames", "0:2"], "--frames goes with --orbit, or with several scenes"),
        (["{a}", "--fps", "9"], "--fps goes with --orbit and a movie, whose name ends in .mp4, .gif, .apng"),
        (["{a}", "--orbit", "2", "--fps", "0"], "--fps: must be frames a second, within 0.001..1000, got '0'"),
        (["{a}", "--orbit", "0"], "--orbit: must be a whole number within 1..999999, got '0'"),
        (["{a}", "--orbit", "2", "--axis", "0,0"], "--axis: must be x, y, z, or a direction X,Y,Z such as 0,1,0"),
        (["{a}", "--orbit", "2", "--degrees", "inf"], "--degrees: must be degrees, such as 360 or -90, got 'inf'"),
        (["{a}", "--orbit", "2", "--frames", "2:4"], "--frames: there are only 2 frames, from 0 on"),
        (["{a}", "--orbit", "2", "-o", "m.gif", "--skip-existing"], "--skip-existing goes with PNGs, as a movie"),
        (["{a}", "--orbit", "2", "-o", "no/f%d.png"], "-o: there is no folder 'no'"),
        (["{a}", "--orbit", "2", "--crop", "0,0,999,9"], "crop: must be within 0,0,481,361 and not empty"),
    ],
)  # fmt: skip
def test_usage(arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in "ab":
        (tmp_path / f"{name}.xml").write_text(FILE.read_text())
    with chdir(tmp_path):
        status, lines = call(capsys, *(a.replace("{a}", "a.xml").replace("{b}", "b.xml") for a in arguments))
    assert status == 2
    assert len(lines) == 1
    assert message in lines[0]
    assert listed(tmp_path) == ["a.xml", "b.xml"]


FLAT = """
import ctypes
import gc
import sys
import numpy as np
import cltrace
rng = np.random.default_rng(0)
centers, colors = rng.uniform(-1, 1, (4_000, 3)), rng.uniform(0, 1, (4_000, 3))
camera = cltrace.Camera((0, 0, 9), (0, 0, 0), horizontal_fov=14, resolution=(160, 120))
scene = cltrace.Scene.from_spheres(camera, [cltrace.point_light((5, 8, 9))], centers, 0.02, colors)
cameras = cltrace.orbit(scene, 1000)
def memory():
    gc.collect()
    getattr(ctypes.CDLL(None), "malloc_trim", lambda left: None)(0)  # what glibc keeps of freed memory is not ours
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmRSS"))
def frames():
    for k in range(1000):
        if k == 200:
            global before
            before = memory()
        yield {"centers": centers * (1 + k / 1000)} if k % 2 else cameras[k]
cltrace.animate(frames(), sys.argv[1], scene=scene)
print(memory() / before)
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks Linux how much memory there is")
@pytest.mark.parametrize("name", ["f%04d.png", "m.apng"])
def test_memory_stays_flat(name: str, tmp_path: Path) -> None:
    line = [sys.executable, "-c", FLAT, str(tmp_path / name)]
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    assert float(done.stdout) <= 1.01


def test_pictures_before_a_fault_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    """A frame that could not be written, and a scene whose picture has the name of another one's."""
    monkeypatch.chdir(tmp_path)
    Path("f02.png").symlink_to("/dev/full")
    for name in ("a", "b"):
        Path(f"{name}.xml").write_text(FILE.read_text())
    orbit = [str(FILE), "--orbit", "3", "-o", "f%02d.png"]
    for line, wrote, words in (
        (orbit, "2 pictures, f00.png to f01.png, ", "cannot write f02.png: No space left on device"),
        (["a.xml", "b.xml"], "step3-shadows.png, ", "b.xml: output_file: another scene has step3-shadows.png, too"),
    ):
        assert cli.main([*line, "--size", "8x6"]) == 2
        told, fault = capsys.readouterr().err.splitlines()
        assert told.startswith(f"cltrace: wrote {wrote}")
        assert fault.startswith(f"cltrace: {words}")
