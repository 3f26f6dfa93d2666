"""Comparing a picture with the right one names the mistake that a ray tracer made, and none where there is none.

The pictures are those of `compare_grid`. The slow run asks for a fixed part of it.
"""

from __future__ import annotations

import json
import shlex
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compare_grid import Case, Grid, Remembering, asked, cases, chosen
from PIL import Image as Picture
from wrong_tracers import MAKERS, PAIRS, TUTORIAL, VECTOR, Bytes, tracer

import cltrace
from cltrace import cli
from cltrace.students import search
from cltrace.students.comparison import look_at
from cltrace.students.mistakes import BY_NAME
from cltrace.students.rules import RIGHT
from cltrace.students.tracer import Tracer, to_bytes
from cltrace.students.whole import is_smooth

SIZE = 48, 36


@pytest.fixture(scope="session")
def grid(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Grid]:
    with np.errstate(all="ignore"):
        yield Grid(tmp_path_factory.mktemp("grid"))


def names(result: cltrace.Comparison) -> list[str]:
    return [cause.either for cause in result.causes]


def test_the_table_has_all_names() -> None:
    assert {name.split("/")[0] for texts in (TUTORIAL, VECTOR) for name in texts} <= set(BY_NAME)
    assert {name for pair in PAIRS for name in pair} <= set(BY_NAME)


# Pictures that were once called by another mistake's name, or by none, and what is said of them; where that is None,
# each mistake has to be among what is named.
SAID: list[tuple[str, str, tuple[int, int], str, str | None]] = [
    ("vector", "spot", (52, 36), "spot-angle", None),
    ("vector", "spot", (52, 36), "aspect-inverted", None),
    ("vector", "step3-shadows", (52, 36), "camera-transposed", None),
    ("vector", "step2-parallel", (52, 36), "degrees-for-radians", None),
    ("vector", "step2-parallel", (52, 36), "no-highlights", None),
    ("vector", "step2-parallel", (52, 36), "highlight-reversed", None),
    ("vector", "step2-parallel", (52, 36), "shifted", None),
    ("vector", "transforms", (52, 36), "colour-profile", None),
    ("tutorial", "step2-parallel", (20, 15), "truncated", "truncated"),
    # Of equals, each is named: all spot lights of a scene with one are gone whether it is left out, or its kind is.
    ("vector", "spot", SIZE, "no-spot-lights",
     "far-root|no-spot-lights|light-missing|light-reversed"),
    ("vector", "step3-shadows", SIZE, "gamma no-shadows", "gamma + no-shadows"),
    ("vector", "step3-shadows", (64, 48), "colour-profile no-shadows", None),
    ("vector", "step3-shadows", (64, 48), "colour-profile upside-down", None),
    ("vector", "transforms", (64, 48), "colour-profile full-field-of-view", None),
    # In few pixels, bright highlights have as many levels between their sides as smooth edges have.
    ("vector", "step2-parallel", (33, 44), "upside-down blinn", "upside-down + blinn"),
    # Without its light the globe is dark, and so it is from inside: each of these may be beside a shift.
    ("vector", "globe", (48, 30), "light-reversed pixel-corner",
     "far-root|no-parallel-lights|light-missing|light-reversed + pixel-corner"),
]  # fmt: skip
SLOWLY_SAID: list[tuple[str, str, tuple[int, int], str, str | None]] = [
    ("vector", "step7-glass", (52, 36), "normal-not-flipped", None),
    ("vector", "bounces", (52, 36), "glass-without-shadow", None),
    ("vector", "cave", (52, 36), "near-root-only", None),
    ("vector", "bright", (52, 36), "wrapped", None),
    ("vector", "row", (52, 36), "fresnel", None),
    ("vector", "step6-textures", (52, 36), "nearest-texel", None),
    # A shift that explains a part is not named where one mistake explains all.
    ("vector", "bounces", (33, 44), "degrees-for-radians", "degrees-for-radians"),
    ("tutorial", "step1-ambient", SIZE, "pixel-corner", "pixel-corner"),
    # A light that is reversed in both its uses hardly differs here from one that is only shaded so.
    ("tutorial", "row", SIZE, "light-reversed pixel-corner",
     "pixel-corner + no-parallel-lights|light-missing|light-reversed"),
    # Two beside a change of the whole picture fitted here by chance.
    ("tutorial", "random-2", (64, 40), "mirrored no-refraction", "mirrored"),
    # Without their light, balls look as from inside, and more: two others did so, too.
    ("tutorial", "tall", (40, 30), "no-parallel-lights", ""),
    # A second mistake explains hardly a hundredth of what is wrong, but all that the first one leaves.
    ("vector", "step4-meshes", (48, 30), "transform-order no-highlights", None),
    ("vector", "globe", (48, 30), "upside-down blinn", None),
    ("tutorial", "random-2", (48, 30), "refraction-inverted gamma", None),
]  # fmt: skip


@pytest.mark.filterwarnings("ignore::cltrace.SceneWarning")
@pytest.mark.parametrize("case", [*SAID, *(pytest.param(case, marks=pytest.mark.slow) for case in SLOWLY_SAID)])
def test_what_is_said(grid: Grid, case: tuple[str, str, tuple[int, int], str, str | None]) -> None:
    maker, scene, size, wrong, said = case
    answer = asked(grid, Case(maker, scene, size, tuple(wrong.split())))
    assert answer.kind in ("right", "either") if said is None else answer.said == said, answer


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::cltrace.SceneWarning")
def test_false_names_are_rare_in_a_thirtieth_of_the_grid(grid: Grid, monkeypatch: pytest.MonkeyPatch) -> None:
    """False names are at most 1 %, and right ones 85 %, of pairs, too; right pictures have none."""
    monkeypatch.setattr(search, "Tracer", Remembering)
    some = chosen(30)
    assert {case.wrong for case in some} == {case.wrong for case in cases()}
    shown = [answer for answer in (asked(grid, case) for case in some) if answer.kind != "hidden"]
    false = [answer for answer in shown if answer.kind == "false"]
    assert [answer for answer in false if not answer.case.wrong] == []
    assert len(false) <= 0.01 * len(shown), false
    for count in (1, 2):
        alike = [answer for answer in shown if len(answer.case.wrong) == count]
        missed = [answer for answer in alike if answer.kind not in ("right", "either")]
        assert len(missed) <= 0.15 * len(alike), missed


def noisy(picture: Bytes) -> Bytes:
    """With a level more or less, or neither, in each channel."""
    noise = np.random.default_rng(1).integers(-1, 2, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["bright", "room", "tower", "cave", "row"])
def test_noise_hides_no_mistake_and_is_none(grid: Grid, scene: str) -> None:
    right = grid.right(scene, SIZE)
    for picture in (right, noisy(right)):
        result = cltrace.compare(grid.scene(scene, SIZE), picture)
        assert (result.same, result.differing, result.causes) == (True, 0, ())
    wrong = noisy(grid.draw(Case("vector", scene, SIZE, ("no-shadows",))))
    assert names(cltrace.compare(grid.scene(scene, SIZE), wrong, tolerance=2)) == ["no-shadows"]


# What is wrong, but none of the list.


def part_missing(picture: Bytes) -> Bytes:
    height, width = picture.shape[:2]
    picture[height // 2 : height // 2 + 8, width // 2 : width // 2 + 8] = picture[0, 0]
    return picture


def noise(picture: Bytes) -> Bytes:
    return np.random.default_rng(2).integers(0, 256, picture.shape, dtype=np.uint8)


def mostly_noise(picture: Bytes) -> Bytes:
    """Of a mirror image there is more to see than of the picture, but not enough to name it by."""
    few = np.random.default_rng(4).random(picture.shape[:2])[..., None] < 0.6
    return np.where(few, noise(picture), picture[:, ::-1])


def two_halves(picture: Bytes) -> Bytes:
    """Of one colour each, which are no frame."""
    left = np.arange(picture.shape[1])[None, :, None] < picture.shape[1] // 2
    return np.where(left, (10, 20, 30), (200, 100, 0)).repeat(len(picture), axis=0).astype(np.uint8)


def one_pixel(picture: Bytes) -> Bytes:
    """Rounding moves an outline by as much; it still counts as different."""
    picture[3, 4] = 255 - picture[3, 4]
    return picture


UNKNOWN: list[Callable[[Bytes], Bytes]] = [
    part_missing, noise, mostly_noise, two_halves, one_pixel,
    lambda p: np.roll(p[::-1, ::-1], 2, axis=0), lambda p: (p * 0.8).astype(np.uint8), lambda p: p // 2 + 20,
]  # fmt: skip


@pytest.mark.parametrize("scene", ["step2-parallel", pytest.param("bright", marks=pytest.mark.slow)])
@pytest.mark.parametrize("change", UNKNOWN)
def test_what_is_not_known_is_not_named(grid: Grid, change: Callable[[Bytes], Bytes], scene: str) -> None:
    picture = np.ascontiguousarray(change(grid.right(scene, SIZE).copy()))
    result = cltrace.compare(grid.scene(scene, SIZE), picture)
    assert not result.same
    assert names(result) == []
    if change is one_pixel:
        assert result.worst == (4, 3)
        assert "too few" in str(result)


def test_an_empty_picture_names_nothing_that_leaves_it_emptier(grid: Grid) -> None:
    """Spheres of half their radius are not "no spheres", though nearly all pixels are the background's in both."""
    scene = grid.scene("spot", (88, 66))
    half = (("dot(p, p) - self.radius**2", "dot(p, p) - (self.radius / 2) ** 2"),)
    assert cltrace.compare(scene, tracer(MAKERS["vector"][0], half).render(scene)).causes == ()


@pytest.mark.parametrize("level", [0, 128])
def test_pictures_of_one_colour_say_no_more(grid: Grid, level: int) -> None:
    scene = grid.scene("step2-parallel", SIZE)
    result = cltrace.compare(scene, np.full((SIZE[1], SIZE[0], 3), level, np.uint8))
    assert [(cause.name, cause.explains) for cause in result.causes] == [("one-colour" if level else "black", 1.0)]


@pytest.mark.slow
def test_cylinders_that_are_missing_are_not_called_meshes() -> None:
    camera = cltrace.Camera((0, 1, 5), (0, 0, 0), horizontal_fov=30, resolution=SIZE)
    lights = [cltrace.ambient_light(), cltrace.point_light((3, 4, 4))]
    balls = camera, lights, [(0, 0, 0), (0.8, 0.6, 0), (-0.8, 0.6, 0)], [0.35, 0.3, 0.3]
    molecule = cltrace.Scene.from_spheres(*balls, bonds=[(0, 1), (0, 2)], bond_radius=0.12)
    without = cltrace.render(cltrace.Scene.from_spheres(*balls)).rgb8
    assert names(cltrace.compare(molecule, without)) == ["no-cylinders"]


GEM = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], float)
FACES = np.array([(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shown", "drawn", "name"),
    [
        ({"colors": "corners"}, {}, "no-mesh-colors"),
        ({"colors": "faces"}, {}, "no-mesh-colors"),
        ({"colors": "corners"}, {"colors": "first"}, "flat-mesh-colors"),
        ({"values": "corners"}, {"values": "mean"}, "flat-mesh-colors"),
        ({"colors": "corners"}, {"colors": "wrong"}, None),
    ],
)
def test_colours_of_meshes_are_no_textures(shown: dict[str, str], drawn: dict[str, str], name: str | None) -> None:
    table = {"colors": np.random.default_rng(0).uniform(0.1, 1, (6, 3)), "values": np.arange(6.0)}

    def scene(how: dict[str, str]) -> cltrace.Scene:
        camera = cltrace.Camera((0, 1, 5), (0, 0, 0), horizontal_fov=25, resolution=SIZE)
        given: dict[str, Any] = {"clim": (0, 5)} if "values" in how else {}
        for key, way in how.items():
            of_face = table[key][FACES]
            given[key] = {
                "corners": table[key], "faces": of_face[:, 1], "first": of_face[:, 0], "mean": of_face.mean(axis=1),
                "wrong": table[key][::-1],
            }[way]  # fmt: skip
        lights = [cltrace.ambient_light(), cltrace.point_light((3, 4, 4))]
        return cltrace.Scene.from_meshes(camera, lights, [cltrace.Mesh(GEM, FACES, **given)])

    result = cltrace.compare(scene(shown), cltrace.render(scene(drawn)).rgb8)
    assert not result.same
    assert names(result) == ([name] if name else [])


def test_a_texture_of_one_row_on_a_sphere_is_no_colour_of_a_mesh(tmp_path: Path) -> None:
    """Meshes' colours come as such textures, but here a sphere has it, which has no corners."""
    scenes = Path(__file__).parents[2] / "scenes"
    for name in ("meshes", "textures"):
        shutil.copytree(scenes / name, tmp_path / name)
    row = np.arange(256, dtype=np.uint8)[None, :, None].repeat(3, 2)
    Picture.fromarray(row).save(tmp_path / "textures" / "planet.png")
    shutil.copy(scenes / "planet.xml", tmp_path)
    assert not any(Tracer(cltrace.load(tmp_path / "planet.xml")).colors_of_meshes)


# Smooth pictures.


def test_noise_is_not_called_smooth(grid: Grid) -> None:
    picture = noise(np.zeros((120, 160, 3), np.uint8))
    assert is_smooth(picture.astype(np.int64))
    assert cltrace.compare(grid.scene("step2-parallel", (160, 120)), picture).causes == ()


def smooth(scene: cltrace.Scene, **changes: object) -> Bytes:
    """The picture of nine rays a pixel, where cltrace's own has up to 32, with what a mistake changes."""
    textbook, (width, height) = Tracer(scene), scene.camera.resolution
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=2).reshape(-1, 2)
    places = [(x / 6, y / 6) for x in (1, 3, 5) for y in (1, 3, 5)]
    colors = [np.clip(textbook.colors(pixels, RIGHT.changed(sample=place, **changes)), 0, 1) for place in places]
    return to_bytes(np.mean(colors, axis=0)).reshape(height, width, 3).astype(np.uint8)


def test_penumbras_are_smooth_too() -> None:
    """Of a smooth picture in soft light: it was a third unknown, and a light that was added twice."""
    camera = cltrace.Camera((0, 3.4, 12), (0, 0.85, 0), horizontal_fov=24, resolution=(120, 68))
    lights = [cltrace.ambient_light(), cltrace.sky_light(directions=16), cltrace.sun_light((1, -2, -1), angle=5)]
    centers, color = [(0, -1000, 0), (0, 1, 0)], (0.8, 0.5, 0.4)
    balls = cltrace.Scene.from_spheres(camera, lights, centers, [1000, 0.9], color, ka=0.3, kd=0.7)
    mine = cltrace.render(balls, antialias=True).rgb8
    result = cltrace.compare(balls, mine)
    assert [(cause.name, cause.explains) for cause in result.causes] == [("antialiased", 1.0)]
    assert result.places == ()
    spoilt = mine.copy()
    spoilt[40:44, 20:26] //= 2
    result = cltrace.compare(balls, spoilt)
    assert names(result) == ["antialiased"]
    assert 0.9 < result.explained < 1
    assert all(40 <= place.y < 44 and 20 <= place.x < 26 for place in result.places)
    assert result.places


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{}, {"shadows": False}], ids=["right", "wrong"])
def test_smooth_pictures_are_compared(grid: Grid, changes: dict[str, object]) -> None:
    """A mistake is found as in sharp ones; that the picture is smooth is named where it should not be."""
    scene, wrong = grid.scene("bright", (114, 81)), ["no-shadows"] if changes else []
    mine = smooth(scene, **changes)
    result = cltrace.compare(scene, mine, antialias=True)
    assert names(result) == wrong
    assert result.differing < 0.01 or wrong
    assert set(names(cltrace.compare(scene, mine))) == {"antialiased", *wrong}


@pytest.mark.slow
@pytest.mark.parametrize("factor", [2, 5])
def test_pictures_that_are_means_are_named_antialiased(grid: Grid, factor: int) -> None:
    """Exact means of pictures that are larger by a factor."""
    width, height = 38, 27
    fine = grid.right("bright", (width * factor, height * factor))
    blocks = fine.reshape(height, factor, width, factor, 3).mean(axis=(1, 3))
    mine = np.floor(blocks + 0.5).astype(np.uint8)
    (cause,) = cltrace.compare(grid.scene("bright", (width, height)), mine).causes
    assert cause.name == "antialiased"
    assert cause.explains > 0.9


# What may be compared.


@pytest.mark.parametrize("factor", [2, 3])
def test_another_size_is_said_and_compared(grid: Grid, factor: int) -> None:
    larger = grid.right("step2-parallel", (factor * SIZE[0], factor * SIZE[1]))
    result = cltrace.compare(grid.scene("step2-parallel", SIZE), larger)
    assert not result.same
    assert (result.asked, result.differing, result.causes) == (SIZE, 0.0, ())
    sizes = f"{48 * factor}x{36 * factor} instead of 48x36"
    told = f"the picture has another size, {sizes} pixels: it is compared at its own\nthe pictures are equal"
    assert str(result) == told


@pytest.mark.slow
def test_what_may_be_compared(grid: Grid, tmp_path: Path) -> None:
    """An Image, an array of bytes with or without alpha, the path of a file."""
    scene = grid.scene("bright", SIZE)
    image = cltrace.render(scene)
    with_alpha = np.dstack([image.rgb8, np.full(image.rgb8.shape[:2], 255, np.uint8)])
    image.save(tmp_path / "mine.png")
    Picture.fromarray(with_alpha).save(tmp_path / "alpha.png")
    for mine in (image, image.rgb8, with_alpha, tmp_path / "mine.png", str(tmp_path / "alpha.png")):
        assert cltrace.compare(scene, mine).same


@pytest.mark.parametrize(
    "picture",
    [
        np.zeros((4, 4, 3), np.uint8), np.zeros((36, 48), np.float64), np.zeros((36, 48, 2), np.uint8),
        np.zeros((36, 48, 3), np.int64), np.zeros((48, 36, 3), np.uint8), np.zeros((90, 100, 3), np.uint8), None, 3,
        "no-such-file.png",
    ],
    ids=["small", "float", "two", "int", "on its side", "screenshot", "none", "number", "no file"],
)  # fmt: skip
def test_what_may_not_be_compared(grid: Grid, picture: Any) -> None:
    with pytest.raises((ValueError, TypeError, cltrace.UsageError), match=r"^(picture|no-such-file.png): "):
        cltrace.compare(grid.scene("bright", SIZE), picture)


@pytest.mark.parametrize("tolerance", [-1, 256, 0.5, None, "1", True])
def test_tolerances_that_are_none(grid: Grid, tolerance: Any) -> None:
    with pytest.raises(ValueError, match="tolerance"):
        cltrace.compare(grid.scene("bright", SIZE), np.zeros((36, 48, 3), np.uint8), tolerance=tolerance)


# The command.


BRIGHT = "bright.xml"


@pytest.fixture
def mine(grid: Grid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A picture of a scene that is upside down, as a file, in the current folder; the scene is there, too."""
    for path in grid.folder.iterdir():
        if path.is_file():
            shutil.copy(path, tmp_path)
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mine.png"
    Picture.fromarray(grid.right("bright", grid.scene("bright").camera.resolution)[::-1]).save(path)
    return path


def test_json(mine: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of another picture, and of the same one."""
    before = list(mine.parent.iterdir())
    assert cli.main([BRIGHT, "--compare", "mine.png", "--json"]) == 1
    assert list(mine.parent.iterdir()) == before
    told = json.loads(capsys.readouterr().out)
    assert (set(told), told["same"]) == ({"same", "differing", "causes"}, False)
    assert 0.9 < told["differing"] <= 1
    assert told["causes"] == [{"name": "upside-down", "explains": 1.0, "or": []}]
    with Picture.open(mine) as picture:
        Picture.fromarray(np.array(picture)[::-1]).save("same.png")
    assert cli.main([BRIGHT, "--compare", "same.png", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"same": True, "differing": 0, "causes": []}


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["RGBA", "L", "LA", "P", "1", "I;16", "CMYK"])
def test_other_pictures_are_read_or_refused(mine: Path, mode: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A grey picture is read, too; what is not read is a fault in one line."""
    with Picture.open(mine) as picture:
        grey = picture.convert("L")
        converted = grey.convert("I").convert("I;16") if mode == "I;16" else picture.convert(mode)
    name = mine.with_suffix(".tiff" if mode == "CMYK" else ".png")
    converted.save(name)
    status = cli.main([BRIGHT, "--compare", str(name)])
    told = capsys.readouterr()
    assert status in ((1,) if mode in ("RGBA", "L", "LA", "P") else (1, 2))
    assert "Traceback" not in told.err
    if status == 2:
        assert len(told.err.splitlines()) == 1


@pytest.mark.parametrize(
    "arguments",
    [
        "--compare none.png", "--compare text.png", "--compare .", "--compare small.png",
        "--compare mine.png -o mine.png", "--compare mine.png --tolerance 256", "--compare mine.png --tolerance x",
        "--compare mine.png -o side.jpg", "--compare mine.png --show normal", "--tolerance 2", "--json",
        "--compare mine.png --json -o -", "--compare mine.png --check", "--compare mine.png --size 20x20",
    ],
)  # fmt: skip
def test_faults(mine: Path, arguments: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit status 2, one line, and no file is written or changed."""
    Path("text.png").write_text("not a picture")
    Picture.new("RGB", (5, 5)).save("small.png")
    before = {path: path.read_bytes() for path in mine.parent.iterdir()}
    assert cli.main([BRIGHT, *arguments.split()]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert len(told.err.strip().splitlines()) == 1
    assert ("5x5" in told.err and "38x27" in told.err) or "small" not in arguments
    assert {path: path.read_bytes() for path in mine.parent.iterdir()} == before


def test_the_worst_pixel_is_explained(mine: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By its line, and by a command that can be typed: it says of the same pixel the bytes that are right."""
    options = ["--size", "20x15", "--square-pixels", "--truncate"]
    assert cli.main([BRIGHT, *options, "-o", "right.png"]) == 0
    with Picture.open("right.png") as picture:
        right = np.array(picture)
    Picture.fromarray(right[::-1]).save("mine.png")
    error = np.abs(right.astype(int) - right[::-1]).max(axis=2)
    capsys.readouterr()
    assert cli.main([BRIGHT, *options, "--compare", "mine.png", "-o", "side.png"]) == 1
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
    text = capsys.readouterr().out
    assert text.startswith(f"pixel ({x}, {y}) of 20x15")
    assert text.splitlines()[-1].split()[-3:] == [str(byte) for byte in right[y, x]]
    scene = cltrace.load(BRIGHT)
    scene = scene.seen_by(replace(scene.camera, resolution=(20, 15), square_pixels=True))
    assert line.strip() == cltrace.explain(scene, x, y, truncate=True).line


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


def test_the_call_of_scenes_that_are_not_as_in_a_file(grid: Grid) -> None:
    scene = grid.scene("bright", SIZE)
    moved = scene.seen_by(replace(scene.camera, horizontal_fov=30.0))
    result = cltrace.compare(moved, np.ascontiguousarray(cltrace.render(moved).rgb8[::-1]))
    assert result.worst is not None
    x, y = result.worst
    assert result.places[0].ask == f"cltrace.explain(scene, {x}, {y})"
