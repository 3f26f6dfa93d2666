"""Comparing a picture with the right one names the mistake that a ray tracer made, and none where there is none.

The pictures are those of `wrong_tracers`, of the scenes of `wrong_scenes`. All mistakes on all scenes take a quarter of
an hour, and are marked stress. The slow run has each mistake on one scene, and some pairs; the ordinary run has a few.
"""

from __future__ import annotations

import json
import shlex
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture
from wrong_scenes import SCENES, scenes
from wrong_tracers import MISTAKES, RIGHT, Bytes, Tracer, both

import cltrace
from cltrace import cli
from cltrace.students.places import look_at
from cltrace.students.rules import RIGHT as RULES
from cltrace.students.tracer import Tracer as Textbook
from cltrace.students.tracer import to_bytes

NAMES = [make.__name__ for make in SCENES]
FEWEST = 5  # pixels that a mistake has to change in a picture for its name to be asked for
# Two mistakes at once, which one scene after the other has to show; the second number is which of the tracers.
PAIRS = [
    ("upside-down", "no-shadows"), ("specular-tinted", "full-field-of-view"), ("gamma", "pixel-corner"),
    ("mirrored", "light-reversed"), ("texture-flipped", "no-shadows"), ("half-texel", "upside-down"),
    ("mirror-depth", "full-field-of-view"), ("refraction-inverted", "gamma"), ("acne", "upside-down"),
    ("transform-order", "tangent-vertical-field"), ("normal-transform", "no-shadows"), ("early-clamp", "mirrored"),
    ("shadow-beyond-light", "ambient-per-light"), ("large-epsilon", "upside-down"), ("integer-division", "gamma"),
    ("normal-not-flipped", "pixel-corner"), ("blinn", "no-shadows"), ("no-facing-gate", "upside-down"),
    ("ambient-per-light", "full-field-of-view"), ("light-reversed", "gamma"), ("blinn", "half-texel"),
    ("specular-tinted", "tangent-vertical-field"), ("texture-flipped", "transform-order"), ("acne", "gamma"),
]  # fmt: skip


class Pictures:
    """The scenes as files, and what tracers make of them: each picture is drawn once."""

    def __init__(self, folder: Path) -> None:
        self.paths = scenes(folder)
        self.loaded = {name: cltrace.load(path) for name, path in self.paths.items()}
        self.drawn: dict[tuple[str, object], Bytes] = {}

    def by(self, scene: str, tracer: Tracer) -> Bytes:
        key = scene, tracer
        if key not in self.drawn:
            self.drawn[key] = tracer.draw(self.paths[scene])
        return self.drawn[key]

    def right(self, scene: str) -> Bytes:
        return self.by(scene, RIGHT["the reference"])

    def compared(self, scene: str, picture: Bytes, tolerance: int = 1) -> cltrace.Comparison:
        return cltrace.compare(self.loaded[scene], picture, tolerance=tolerance)

    def causes(self, scene: str, picture: Bytes, tolerance: int = 1) -> list[str]:
        """Each with its rivals."""
        return ["|".join((c.name, *c.rivals)) for c in self.compared(scene, picture, tolerance).causes]


@pytest.fixture(scope="session")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Pictures:
    return Pictures(tmp_path_factory.mktemp("wrong"))


def tolerance_for(name: str) -> int:
    """A picture with bytes cut off is the same but for one level."""
    return 0 if name == "truncated" else 1


def differing(a: Bytes, b: Bytes, tolerance: int) -> int:
    """How many pixels differ by more levels than that in any channel."""
    return int((np.abs(a.astype(int) - b).max(axis=-1) > tolerance).sum())


def noisy(picture: Bytes) -> Bytes:
    """With a level more or less, or neither, in each channel."""
    noise = np.random.default_rng(1).integers(-1, 2, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


def shows(scene: str, key: tuple[str, int], pictures: Pictures) -> bool:
    """Whether a mistake changes a scene's picture by more than a few pixels."""
    name, i = key
    picture = pictures.by(scene, MISTAKES[name][i])
    return differing(picture, pictures.right(scene), tolerance_for(name)) >= FEWEST


def is_first(found: list[str], scene: str, key: tuple[str, int], pictures: Pictures) -> bool:
    """Whether the first name is that of a mistake, or of one that makes the same picture."""
    name, i = key
    names = [one for names in found[:1] for one in names.split("|")]
    if name in names:
        return True
    picture = pictures.by(scene, MISTAKES[name][i])
    others = [tracer for other in names for tracer in MISTAKES.get(other, [])]
    return any(not differing(pictures.by(scene, other), picture, tolerance_for(name)) for other in others)


def test_there_are_wrong_tracers_for_all_mistakes_of_the_list() -> None:
    assert len(MISTAKES) == 25


@pytest.mark.slow
def test_the_right_tracers_are_right(pictures: Pictures) -> None:
    """What a wrong tracer has beside its mistake is right: the student's arithmetic, and Phong's formula once more."""
    for scene in NAMES:
        for tracer in RIGHT.values():
            assert differing(pictures.by(scene, tracer), pictures.right(scene), 0) <= 1


ALL = [(scene, (name, i)) for scene in NAMES for name, tracers in MISTAKES.items() for i in range(len(tracers))]
# Each tracer on one scene.
SOME = [case for k, case in enumerate(ALL) if k % (len(ALL) // 5) % 5 == k // (len(ALL) // 5)]


@pytest.mark.parametrize(
    "cases",
    [pytest.param(SOME, marks=pytest.mark.slow), pytest.param(ALL, marks=pytest.mark.stress)],
    ids=["some", "all"],
)
def test_mistakes_are_named_first(pictures: Pictures, cases: list[tuple[str, tuple[str, int]]]) -> None:
    """Nine of ten at least, of mistakes that show: the usual way to make each does in four of the five scenes."""
    missed, count, shown = [], 0, Counter[tuple[str, int]]()
    for scene, key in cases:
        if shows(scene, key, pictures):
            count, shown[key] = count + 1, shown[key] + 1
            picture = pictures.by(scene, MISTAKES[key[0]][key[1]])
            found = pictures.causes(scene, picture, tolerance_for(key[0]))
            if not is_first(found, scene, key, pictures):
                missed.append((scene, key, found[:3]))
    if cases is ALL:
        assert [name for name in MISTAKES if shown[name, 0] < 4] == []
    assert count >= 0.8 * len(cases)
    assert len(missed) <= 0.1 * count, f"{len(missed)} of {count}: {missed}"


@pytest.mark.stress
def test_mistakes_are_named_under_noise(pictures: Pictures) -> None:
    missed, count = [], 0
    for name in MISTAKES:
        if shows("bright", (name, 0), pictures) and name != "truncated":
            count += 1
            found = pictures.causes("bright", noisy(pictures.by("bright", MISTAKES[name][0])), tolerance=2)
            if not is_first(found, "bright", (name, 0), pictures):
                missed.append((name, found[:3]))
    assert len(missed) <= 0.1 * count, f"{len(missed)} of {count}: {missed}"


TWOS = [(NAMES[i % len(NAMES)], pair) for i, pair in enumerate(PAIRS)]


@pytest.mark.parametrize(
    "cases",
    [pytest.param(TWOS[::6], marks=pytest.mark.slow), pytest.param(TWOS, marks=pytest.mark.stress)],
    ids=["some", "all"],
)
def test_pairs_are_found(pictures: Pictures, cases: list[tuple[str, tuple[str, str]]]) -> None:
    """Both are named before all others, where each adds to the other."""
    missed, count = [], 0
    for scene, pair in cases:
        one, other = (MISTAKES[name][0] for name in pair)
        picture = pictures.by(scene, both(one, other))
        if min(differing(picture, pictures.by(scene, t), 1) for t in (one, other)) < FEWEST:
            continue
        count += 1
        found = pictures.causes(scene, picture)
        if not all(any(name in names.split("|") for names in found[:2]) for name in pair):
            missed.append((scene, pair, found[:3]))
    assert count >= 0.8 * len(cases)
    assert len(missed) <= 0.25 * count, f"{len(missed)} of {count}: {missed}"


@pytest.mark.slow
def test_where_there_is_no_mistake_none_is_named(pictures: Pictures) -> None:
    for scene in NAMES:
        for tracer in RIGHT.values():
            picture = pictures.by(scene, tracer)
            assert pictures.causes(scene, picture) == []
            result = pictures.compared(scene, noisy(pictures.right(scene)))
            assert result.same
            assert result.differing == 0
            assert list(result.causes) == []


@pytest.mark.slow
def test_a_mistake_is_named(pictures: Pictures) -> None:
    picture = pictures.by("bright", MISTAKES["no-shadows"][0])
    result = pictures.compared("bright", picture)
    assert not result.same
    wrong = differing(picture, result.right, 1)
    assert result.differing == pytest.approx(wrong / (picture.shape[0] * picture.shape[1]))
    assert result.causes[0].name == "no-shadows"
    assert 0.9 <= result.causes[0].explains <= 1
    shares = [cause.explains for cause in result.causes]
    assert shares == sorted(shares, reverse=True)


@pytest.mark.slow
def test_truncated_bytes_are_the_same_but_for_a_level(pictures: Pictures) -> None:
    picture = pictures.by("bright", MISTAKES["truncated"][0])
    assert pictures.compared("bright", picture).same
    assert pictures.causes("bright", picture, tolerance=0)[:1] == ["truncated"]


@pytest.mark.slow
@pytest.mark.parametrize("scene", NAMES)
def test_the_right_picture_is_the_same(pictures: Pictures, scene: str) -> None:
    right = cltrace.render(pictures.loaded[scene]).rgb8
    for picture in (right, noisy(right)):
        result = pictures.compared(scene, picture)
        assert result.same
        assert result.differing == 0
        assert list(result.causes) == []


def ball_missing(picture: Bytes) -> Bytes:
    height, width = picture.shape[:2]
    picture[height // 2 : height // 2 + 8, width // 2 : width // 2 + 8] = picture[0, 0]
    return picture


def mostly_noise(picture: Bytes) -> Bytes:
    """Of a mirror image there is more to see than of the picture, but not enough to name it by."""
    rng = np.random.default_rng(4)
    noise = rng.integers(0, 256, picture.shape, dtype=np.uint8)
    return np.where(rng.random(picture.shape[:2])[..., None] < 0.6, noise, picture[:, ::-1])


UNKNOWN: dict[str, Callable[[Bytes], Bytes]] = {
    "a part is missing": ball_missing,
    "noise": lambda p: np.random.default_rng(2).integers(0, 256, p.shape, dtype=np.uint8),
    "turned": lambda p: np.roll(p[::-1, ::-1], 2, axis=0),
    "mirrored, most of it noise": mostly_noise,
    "paler": lambda p: (p * 0.8).astype(np.uint8),
}


@pytest.mark.parametrize(
    "scene",
    [pytest.param("bright", marks=pytest.mark.slow), pytest.param("room", marks=pytest.mark.stress)],
)
@pytest.mark.parametrize("name", UNKNOWN)
def test_what_is_not_known_is_not_named(pictures: Pictures, name: str, scene: str) -> None:
    """No mistake of the list explains half of it."""
    right = cltrace.render(pictures.loaded[scene]).rgb8
    result = pictures.compared(scene, np.ascontiguousarray(UNKNOWN[name](right.copy())))
    assert not result.same
    assert [cause.name for cause in result.causes if cause.explains > 0.5] == []


def smooth(scene: cltrace.Scene, **changes: object) -> Bytes:
    """The picture of nine rays a pixel, where cltrace's own has up to 32, with what a mistake changes."""
    tracer, (width, height) = Textbook(scene), scene.camera.resolution
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=2).reshape(-1, 2)
    places = [(x / 6, y / 6) for x in (1, 3, 5) for y in (1, 3, 5)]
    colors = [np.clip(tracer.colors(pixels, RULES.changed(sample=place, **changes)), 0, 1) for place in places]
    return to_bytes(np.mean(colors, axis=0)).reshape(height, width, 3).astype(np.uint8)


def test_penumbras_are_smooth_too() -> None:
    """Of a smooth picture in soft light: it was a third unknown, and a light that was added twice."""
    camera = cltrace.Camera((0, 3.4, 12), (0, 0.85, 0), horizontal_fov=24, resolution=(120, 68))
    lights = [cltrace.ambient_light(), cltrace.sky_light(directions=16), cltrace.sun_light((1, -2, -1), angle=5)]
    centers, color = [(0, -1000, 0), (0, 1, 0)], (0.8, 0.5, 0.4)
    balls = cltrace.Scene.from_spheres(camera, lights, centers, [1000, 0.9], color, ka=0.3, kd=0.7)
    smooth = cltrace.render(balls, antialias=True).rgb8
    result = cltrace.compare(balls, smooth)
    assert [(cause.name, cause.explains) for cause in result.causes] == [("antialiased", 1.0)]
    assert result.places == ()
    spoilt = smooth.copy()
    spoilt[40:44, 20:26] //= 2
    result = cltrace.compare(balls, spoilt)
    assert [cause.name for cause in result.causes] == ["antialiased"]
    assert 0.9 < result.explained < 1
    assert all(40 <= place.y < 44 and 20 <= place.x < 26 for place in result.places)
    assert result.places


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "names"),
    [({}, []), ({"shadows": False}, ["no-shadows"])],
    ids=["right", "wrong"],
)
def test_smooth_pictures_are_compared(pictures: Pictures, changes: dict[str, object], names: list[str]) -> None:
    """A mistake is found as in sharp ones; that the picture is smooth is named where it should not be."""
    scene = pictures.loaded["bright"].seen_by(replace(pictures.loaded["bright"].camera, resolution=(114, 81)))
    mine = smooth(scene, **changes)
    result = cltrace.compare(scene, mine, antialias=True)
    assert [cause.name for cause in result.causes] == names
    assert result.differing < 0.01 or names
    assert {cause.name for cause in cltrace.compare(scene, mine).causes} == {"antialiased", *names}


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0, 2, 5])
def test_pictures_that_are_means_are_named_antialiased(pictures: Pictures, factor: int) -> None:
    """Those of --antialias, 0, and exact means of pictures that are larger by a factor."""
    scene = pictures.loaded["bright"]
    width, height = scene.camera.resolution
    if factor:
        fine = cltrace.render(scene.seen_by(replace(scene.camera, resolution=(width * factor, height * factor)))).rgb8
        blocks = fine.reshape(height, factor, width, factor, 3).mean(axis=(1, 3))
        mine = np.floor(blocks + 0.5).astype(np.uint8)
    else:
        mine = cltrace.render(scene, antialias=True).rgb8
    (cause,) = cltrace.compare(scene, mine).causes
    assert cause.name == "antialiased"
    assert cause.explains > 0.9


@pytest.mark.slow
def test_what_may_be_compared(pictures: Pictures, tmp_path: Path) -> None:
    """An Image, an array of bytes with or without alpha, the path of a file."""
    scene = pictures.loaded["bright"]
    image = cltrace.render(scene)
    with_alpha = np.dstack([image.rgb8, np.full(image.rgb8.shape[:2], 255, np.uint8)])
    image.save(tmp_path / "mine.png")
    Picture.fromarray(with_alpha).save(tmp_path / "alpha.png")
    for mine in (image, image.rgb8, with_alpha, tmp_path / "mine.png", str(tmp_path / "alpha.png")):
        assert cltrace.compare(scene, mine).same


@pytest.mark.parametrize(
    "picture",
    [
        np.zeros((4, 4, 3), np.uint8), np.zeros((27, 38), np.float64), np.zeros((27, 38, 2), np.uint8),
        np.zeros((27, 38, 3), np.int64), np.zeros((38, 27, 3), np.uint8), None, 3, "no-such-file.png",
    ],
    ids=["small", "float", "two", "int", "on its side", "none", "number", "no file"],
)  # fmt: skip
def test_what_may_not_be_compared(pictures: Pictures, picture: object) -> None:
    with pytest.raises((ValueError, TypeError, OSError, cltrace.CltraceError)) as caught:
        cltrace.compare(pictures.loaded["bright"], picture)  # type: ignore[arg-type]
    assert str(caught.value)


@pytest.mark.parametrize("tolerance", [-1, 256, 0.5, None, "1", True])
def test_tolerances_that_are_none(pictures: Pictures, tolerance: object) -> None:
    with pytest.raises((ValueError, TypeError), match="tolerance"):
        cltrace.compare(pictures.loaded["bright"], np.zeros((27, 38, 3), np.uint8), tolerance=tolerance)  # type: ignore[arg-type]


# The command.


@pytest.fixture
def mine(pictures: Pictures, tmp_path: Path) -> Path:
    """The picture with a mistake that is named gamma, as a file."""
    path = tmp_path / "mine.png"
    Picture.fromarray(pictures.by("bright", MISTAKES["gamma"][0])).save(path)
    return path


def test_json(pictures: Pictures, mine: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No file is written."""
    assert cli.main([str(pictures.paths["bright"]), "--compare", str(mine), "--json"]) == 1
    assert list(mine.parent.iterdir()) == [mine]
    told = json.loads(capsys.readouterr().out)
    assert {"same", "differing", "causes"} <= set(told)
    assert told["same"] is False
    assert 0.9 < told["differing"] <= 1
    assert told["causes"][0]["name"] == "gamma"
    assert all(set(cause) == {"name", "explains", "or"} and cause["name"] in MISTAKES for cause in told["causes"])


def test_the_same_picture(pictures: Pictures, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cltrace.render(pictures.loaded["bright"]).save(tmp_path / "same.png")
    assert cli.main([str(pictures.paths["bright"]), "--compare", str(tmp_path / "same.png"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["same"], told["differing"], told["causes"]) == (True, 0, [])


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["RGBA", "L", "LA", "P", "1", "I;16", "CMYK"])
def test_other_pictures_are_read_or_refused(
    pictures: Pictures, mine: Path, mode: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A grey picture is read, too; what is not read is a fault in one line."""
    with Picture.open(mine) as picture:
        grey = picture.convert("L")
        converted = grey.convert("I").convert("I;16") if mode == "I;16" else picture.convert(mode)
    name = mine.with_suffix(".tiff" if mode == "CMYK" else ".png")
    converted.save(name)
    status = cli.main([str(pictures.paths["bright"]), "--compare", str(name)])
    told = capsys.readouterr()
    assert status in ((1,) if mode in ("RGBA", "L", "LA", "P") else (1, 2))
    assert "Traceback" not in told.err
    if status == 2:
        assert len(told.err.splitlines()) == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ["--compare", "none.png"], ["--compare", "text.png"], ["--compare", "."], ["--compare", ""],
        ["--compare", "small.png"], ["--compare", "mine.png", "-o", "mine.png"],
        ["--compare", "mine.png", "--tolerance", "-1"], ["--compare", "mine.png", "--tolerance", "256"],
        ["--compare", "mine.png", "--tolerance", "x"], ["--compare", "mine.png", "-o", "side.jpg"],
        ["--compare", "mine.png", "--show", "primitive"], ["--tolerance", "2"], ["--json"],
        ["--compare", "mine.png", "--show", "normal", "--json"], ["--compare", "none.npy"], ["--compare", "text.npy"],
        ["--compare", "mine.png", "--json", "-o", "-"], ["--compare", "mine.png", "--check"],
        ["--compare", "mine.png", "--size", "20x20"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_faults(
    pictures: Pictures, mine: Path, arguments: list[str], monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """Exit status 2, one line, and no file is written or changed."""
    monkeypatch.chdir(mine.parent)
    for name in ("text.png", "text.npy"):
        Path(name).write_text("not a picture")
    Picture.new("RGB", (5, 5)).save("small.png")
    before = {path: path.read_bytes() for path in mine.parent.iterdir()}
    assert cli.main([str(pictures.paths["bright"]), *arguments]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert len(told.err.strip().splitlines()) <= 3
    assert "Traceback" not in told.err
    assert {path: path.read_bytes() for path in mine.parent.iterdir()} == before


def test_another_size_is_told_with_both_sizes(
    pictures: Pictures, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Picture.new("RGB", (50, 20)).save(tmp_path / "wide.png")
    assert cli.main([str(pictures.paths["bright"]), "--compare", str(tmp_path / "wide.png")]) == 2
    told = capsys.readouterr().err
    assert "50x20" in told
    assert "38x27" in told


def test_the_worst_pixel_is_explained(
    pictures: Pictures, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By its line, and by a command that can be typed: it says of the same pixel the bytes that are right."""
    monkeypatch.chdir(tmp_path)
    path, options = str(pictures.paths["bright"]), ["--size", "20x15", "--square-pixels", "--truncate"]
    assert cli.main([path, *options, "-o", "right.png"]) == 0
    with Picture.open("right.png") as picture:
        right = np.array(picture)
    Picture.fromarray(right[::-1]).save("mine.png")
    error = np.abs(right.astype(int) - right[::-1]).max(axis=2)
    capsys.readouterr()
    assert cli.main([path, *options, "--compare", "mine.png", "-o", "side.png"]) == 1
    with Picture.open("side.png") as side:  # own picture, right picture and difference
        assert side.width >= 3 * 20
        assert side.height == 15
    _, first, *rest = capsys.readouterr().out.splitlines()
    assert first.startswith("upside-down explains all of these: ")
    told = [i for i, line in enumerate(rest) if " is " in line and ", right is " in line]
    assert rest[told[0]].startswith("the worst pixel is ")
    assert 1 < len(told) <= 3
    x, y = map(int, rest[told[0]].removeprefix("the worst pixel is ").split(":")[0].split(","))
    # It is no outline: all around it is wrong, too.
    assert error[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].min() > 0
    line, look, why = rest[told[0] + 1 : told[0] + 4]
    assert look.startswith("  look at ")
    command = shlex.split(why.removeprefix("  why: "))
    assert command[0] == "cltrace"
    assert cli.main(command[1:]) == 0
    told = capsys.readouterr().out
    assert told.startswith(f"pixel ({x}, {y}) of 20x15")
    assert told.splitlines()[-1].split()[-3:] == [str(byte) for byte in right[y, x]]
    assert line.strip() == cltrace.explain(scene_of(path), x, y, truncate=True).line


def scene_of(path: str) -> cltrace.Scene:
    """As the command sees it in test_the_worst_pixel_is_explained()."""
    scene = cltrace.load(path)
    return scene.seen_by(replace(scene.camera, resolution=(20, 15), square_pixels=True))


def explained(name: str, x: int, y: int) -> cltrace.Explanation:
    scene = cltrace.load(Path(__file__).parents[2] / "scenes" / f"{name}.xml")
    return cltrace.explain(scene.seen_by(replace(scene.camera, resolution=(160, 120))), x, y)


def test_what_to_look_at_is_said() -> None:
    lit = explained("step2-parallel", 105, 21)
    for term in lit.rays[0].terms:
        for sign, told in ((-1, "missing"), (1, "added twice")):
            sums = np.clip(np.array(lit.color) + sign * np.array(term.color), 0, 1)
            mine = tuple((255 * sums + 0.5).astype(int).tolist())
            assert look_at(lit, mine).endswith(f"it is as if that were {told}")
    assert look_at(lit, (138 - 102, 247 - 102, 247 - 102)).startswith("parallel_light 1, specular")
    assert look_at(lit, (1, 2, 3)) == "P, n, and l of each light"
    hidden = explained("step3-shadows", 99, 59)
    assert look_at(hidden, (71, 87, 95)) == "the shadow ray of parallel_light 1: it is as if nothing were between"
    assert look_at(explained("step3-shadows", 0, 0), (1, 2, 3)).startswith("the ray: this one meets nothing")


def test_the_call_of_scenes_that_are_not_as_in_a_file(pictures: Pictures) -> None:
    scene = pictures.loaded["bright"]
    moved = scene.seen_by(replace(scene.camera, horizontal_fov=30.0))
    result = cltrace.compare(moved, np.ascontiguousarray(cltrace.render(moved).rgb8[::-1]))
    assert result.worst is not None
    x, y = result.worst
    assert result.places[0].ask == f"cltrace.explain(scene, {x}, {y})"


def test_one_pixel_is_too_little_to_tell(pictures: Pictures) -> None:
    """Rounding moves an outline by as much; it still counts as different."""
    picture = cltrace.render(pictures.loaded["bright"]).rgb8.copy()
    picture[3, 4] = 255 - picture[3, 4]
    result = pictures.compared("bright", picture)
    assert not result.same
    assert result.worst == (4, 3)
    assert list(result.causes) == []
    assert "too few" in str(result)
