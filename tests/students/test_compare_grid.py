"""What a comparison says of wrong pictures is hardly ever false, and mostly right: a fixed part of `compare_grid`."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compare_grid import MAKERS, Answer, Case, Grid, Remembering, asked, cases, chosen, module
from PIL import Image
from wrong_texts import PAIRS, PICTURE, TUTORIAL, VECTOR

import cltrace
from cltrace.students import search
from cltrace.students.compare import _smoothed
from cltrace.students.mistakes import BY_NAME
from cltrace.students.rules import RIGHT
from cltrace.students.tracer import Tracer
from cltrace.students.whole import is_smooth

SIZE = 48, 36


@pytest.fixture(scope="session")
def grid(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Grid]:
    with np.errstate(all="ignore"):
        yield Grid(tmp_path_factory.mktemp("grid"))


def test_the_table_has_all_names() -> None:
    assert {name.split("/")[0] for texts in (TUTORIAL, VECTOR) for name in texts} <= set(BY_NAME)
    assert {name for pair in PAIRS for name in pair} <= set(BY_NAME)


# What was once called by another mistake's name, or by none: (scene, mistake).
CALLED_OTHERWISE = [
    ("spot", "spot-angle"), ("spot", "aspect-inverted"), ("step3-shadows", "camera-transposed"),
    ("step2-parallel", "degrees-for-radians"), ("step2-parallel", "no-highlights"),
    ("step2-parallel", "highlight-reversed"), ("step2-parallel", "shifted"), ("transforms", "colour-profile"),
    *(
        pytest.param(*case, marks=pytest.mark.slow)
        for case in (
            ("step7-glass", "normal-not-flipped"), ("bounces", "glass-without-shadow"), ("cave", "near-root-only"),
            ("bright", "wrapped"), ("row", "fresnel"), ("step6-textures", "nearest-texel"),
        )
    ),
]  # fmt: skip


@pytest.mark.filterwarnings("ignore::cltrace.SceneWarning")
@pytest.mark.parametrize(("scene", "name"), CALLED_OTHERWISE)
def test_names_that_were_false(grid: Grid, scene: str, name: str) -> None:
    answer = asked(grid, Case("vector", scene, (52, 36), (name,)))
    assert answer.kind in ("right", "either"), answer


@pytest.mark.slow
@pytest.mark.parametrize(
    "case",
    [
        Case("vector", "bounces", (33, 44), ("degrees-for-radians",)),
        Case("tutorial", "step1-ambient", (48, 36), ("pixel-corner",)),
    ],
    ids=lambda case: case.scene,
)
def test_a_shift_that_explains_a_part_is_not_named_where_one_mistake_explains_all(grid: Grid, case: Case) -> None:
    answer = asked(grid, case)
    assert (answer.kind, answer.said) == ("right", case.wrong[0])


@pytest.mark.slow
def test_each_of_two_rivals_is_made_as_fits_best(grid: Grid) -> None:
    """A light that is reversed in both its uses hardly differs here from one that is only shaded so."""
    answer = asked(grid, Case("tutorial", "row", (48, 36), ("light-reversed", "pixel-corner")))
    assert answer.said == "pixel-corner + no-parallel-lights|light-missing|light-reversed"


def test_what_is_wrong_beside_the_whole_picture_is_found_where_it_is_little(grid: Grid) -> None:
    answer = asked(grid, Case("vector", "step3-shadows", (48, 36), ("gamma", "no-shadows")))
    assert answer.said == "gamma + no-shadows"


def test_a_picture_that_seems_smooth_is_not_called_so_where_two_mistakes_explain_it(grid: Grid) -> None:
    """In few pixels, bright highlights have as many levels between their sides as smooth edges have."""
    answer = asked(grid, Case("vector", "step2-parallel", (33, 44), ("upside-down", "blinn")))
    assert answer.said == "upside-down + blinn"


@pytest.mark.slow
def test_of_three_mistakes_one_is_named_at_most(grid: Grid) -> None:
    """Two beside a change of the whole picture fitted here by chance."""
    answer = asked(grid, Case("tutorial", "random-2", (64, 40), ("mirrored", "no-refraction")))
    assert answer.said.split(" (")[0] == "mirrored"


@pytest.mark.slow
def test_cylinders_that_are_missing_are_not_called_meshes() -> None:
    camera = cltrace.Camera((0, 1, 5), (0, 0, 0), horizontal_fov=30, resolution=SIZE)
    lights = [cltrace.ambient_light(), cltrace.point_light((3, 4, 4))]
    balls = camera, lights, [(0, 0, 0), (0.8, 0.6, 0), (-0.8, 0.6, 0)], [0.35, 0.3, 0.3]
    molecule = cltrace.Scene.from_spheres(*balls, bonds=[(0, 1), (0, 2)], bond_radius=0.12)
    without = cltrace.render(cltrace.Scene.from_spheres(*balls)).rgb8
    assert [cause.either for cause in cltrace.compare(molecule, without).causes] == ["no-cylinders"]


def test_an_empty_picture_names_nothing_that_leaves_it_emptier(grid: Grid) -> None:
    """Spheres of half their radius are not "no spheres", though nearly all pixels are the background's in both."""
    scene = grid.scene("spot", (88, 66))
    small = module(MAKERS["vector"][0], (("dot(p, p) - self.radius**2", "dot(p, p) - (self.radius / 2) ** 2"),))
    assert cltrace.compare(scene, small.render(scene)).causes == ()


@pytest.mark.parametrize("level", [0, 128])
def test_pictures_of_one_colour_say_no_more(grid: Grid, level: int) -> None:
    scene = grid.scene("step2-parallel", SIZE)
    result = cltrace.compare(scene, np.full((SIZE[1], SIZE[0], 3), level, np.uint8))
    assert [(cause.name, cause.explains) for cause in result.causes] == [("one-colour" if level else "black", 1.0)]


def test_two_halves_of_one_colour_each_are_no_frame(grid: Grid) -> None:
    halves = np.repeat(np.repeat(np.array([[(10, 20, 30)], [(200, 100, 0)]], np.uint8), 18, axis=0), 48, axis=1)
    assert cltrace.compare(grid.scene("step2-parallel", SIZE), halves).causes == ()


def test_noise_is_not_called_smooth(grid: Grid) -> None:
    scene = grid.scene("step2-parallel", (160, 120))
    noise = np.random.default_rng(3).integers(0, 256, (120, 160, 3), dtype=np.uint8)
    assert is_smooth(noise.astype(np.int64))
    assert cltrace.compare(scene, noise).causes == ()


def test_no_cause_explains_nothing(grid: Grid) -> None:
    right = cltrace.render(grid.scene("step2-parallel", SIZE)).rgb8
    noise = np.random.default_rng(2).integers(0, 256, right.shape, dtype=np.uint8)
    for picture in (noise, (right * 0.8).astype(np.uint8), right // 2 + 20):
        result = cltrace.compare(grid.scene("step2-parallel", SIZE), picture)
        assert all(cause.explains > 0 for cause in result.causes)
        assert result.causes == ()


@pytest.mark.parametrize("factor", [2, 3])
def test_another_size_is_said_and_compared(grid: Grid, factor: int) -> None:
    scene = grid.scene("step2-parallel", SIZE)
    larger = cltrace.render(grid.scene("step2-parallel", (factor * SIZE[0], factor * SIZE[1]))).rgb8
    result = cltrace.compare(scene, larger)
    assert not result.same
    assert (result.asked, result.differing, result.causes) == (SIZE, 0.0, ())
    sizes = f"{48 * factor}x{36 * factor} instead of 48x36"
    told = f"the picture has another size, {sizes} pixels: it is compared at its own\nthe pictures are equal"
    assert str(result) == told


def test_of_equals_each_is_named(grid: Grid) -> None:
    """All spot lights of a scene with one are gone whether it is left out, or its kind is."""
    answer = asked(grid, Case("vector", "spot", SIZE, ("no-spot-lights",)))
    assert answer.kind == "either"
    assert {"no-spot-lights", "light-missing"} <= set(answer.said.split("|"))


def judged(answers: list[Answer]) -> None:
    """False names are at most 1 %, and right ones 85 %, of pairs, too; right pictures have none."""
    shown = [answer for answer in answers if answer.kind != "hidden"]
    alone = [answer for answer in shown if len(answer.case.wrong) == 1]
    false = [answer for answer in shown if answer.kind == "false"]
    right = [answer for answer in alone if answer.kind in ("right", "either")]
    assert [answer for answer in false if not answer.case.wrong] == []
    assert len(false) <= 0.01 * len(shown), false
    assert len(right) >= 0.85 * len(alone), [answer for answer in alone if answer not in right]
    pairs = [answer for answer in shown if len(answer.case.wrong) == 2]
    missed = [answer for answer in pairs if answer.kind not in ("right", "either")]
    assert len(missed) <= 0.15 * len(pairs), missed


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::cltrace.SceneWarning")
def test_false_names_are_rare_in_a_thirtieth_of_the_grid(grid: Grid, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "Tracer", Remembering)
    some = chosen(30)
    assert {case.wrong for case in some} == {case.wrong for case in cases()}
    judged([asked(grid, case) for case in some])


@pytest.mark.parametrize("size", [(24, 18), (40, 30)])
def test_what_remembers_pictures_traces_the_same(grid: Grid, size: tuple[int, int]) -> None:
    scene, rules = grid.scene("step3-shadows", size), RIGHT.changed(sample=(0.0, 0.5))
    pixels = np.random.default_rng(6).integers(0, size, (100, 2))
    tracer = Remembering(scene)
    for _ in range(4):
        np.testing.assert_allclose(tracer.colors(pixels, rules), Tracer(scene).colors(pixels, rules), atol=1e-12)


def test_rivals_are_so_beside_a_second_mistake(grid: Grid) -> None:
    """Without its light the globe is dark, and so it is from inside: each of these may be beside a shift."""
    answer = asked(grid, Case("vector", "globe", (48, 30), ("light-reversed", "pixel-corner")))
    assert answer.said == "far-root|no-parallel-lights|light-missing|light-reversed + pixel-corner"


@pytest.mark.slow
def test_where_too_many_single_mistakes_explain_all_no_two_are_named(grid: Grid) -> None:
    """Without their light, balls look as from inside, and more: two others did so, too."""
    answer = asked(grid, Case("tutorial", "tall", (40, 30), ("no-parallel-lights",)))
    assert answer.said == ""


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(
            Case("vector", "step4-meshes", (48, 30), ("transform-order", "no-highlights")), marks=pytest.mark.slow
        ),
        pytest.param(Case("vector", "globe", (48, 30), ("upside-down", "blinn")), marks=pytest.mark.slow),
        pytest.param(Case("tutorial", "random-2", (48, 30), ("refraction-inverted", "gamma")), marks=pytest.mark.slow),
    ],
    ids=lambda case: case.scene,
)
def test_a_second_mistake_of_few_pixels_is_found(grid: Grid, case: Case) -> None:
    """It explains hardly a hundredth of what is wrong, but all that the first one leaves."""
    assert asked(grid, case).kind in ("right", "either")


@pytest.mark.parametrize(
    ("scene", "wrong", "named"),
    [
        ("step3-shadows", "no-shadows", {"colour-profile", "no-shadows"}),
        ("step3-shadows", "upside-down", {"colour-profile", "upside-down"}),
        ("transforms", "full-field-of-view", {"colour-profile", "full-field-of-view"}),
    ],
)
def test_a_mistake_beside_a_colour_profile_is_named(grid: Grid, scene: str, wrong: str, named: set[str]) -> None:
    picture = PICTURE["colour-profile"](grid.draw(Case("vector", scene, (64, 48), (wrong,))))
    assert {cause.either for cause in cltrace.compare(grid.scene(scene, (64, 48)), picture).causes} == named


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
    rng = np.random.default_rng(0)
    table = {"colors": rng.uniform(0.1, 1, (6, 3)), "values": np.arange(6.0)}

    def scene(how: dict[str, str]) -> cltrace.Scene:
        camera = cltrace.Camera((0, 1, 5), (0, 0, 0), horizontal_fov=25, resolution=SIZE)
        given: dict[str, Any] = {}
        for key, way in how.items():
            of_face = table[key][FACES]
            given[key] = {
                "corners": table[key], "faces": of_face[:, 1], "first": of_face[:, 0], "mean": of_face.mean(axis=1),
                "wrong": table[key][::-1],
            }[way]  # fmt: skip
            given |= {"clim": (0, 5)} if key == "values" else {}
        return cltrace.Scene.from_meshes(
            camera, [cltrace.ambient_light(), cltrace.point_light((3, 4, 4))], [cltrace.Mesh(GEM, FACES, **given)]
        )

    result = cltrace.compare(scene(shown), cltrace.render(scene(drawn)).rgb8)
    assert not result.same
    assert [cause.either for cause in result.causes] == ([name] if name else [])


@pytest.mark.slow
def test_a_smooth_picture_of_which_much_is_wrong_needs_no_other_one(grid: Grid) -> None:
    """It takes far longer than a sharp one."""
    sharp = cltrace.render(grid.scene("step3-shadows", SIZE)).rgb8
    drawn: list[bool] = []

    def draw(antialias: bool) -> cltrace.Image:
        drawn.append(antialias)
        return cltrace.render(grid.scene("step3-shadows", SIZE), antialias=antialias)

    for wrong in (sharp[::-1], sharp):
        right = _smoothed(wrong, sharp, 1, draw)
        assert (np.abs(right.astype(int) - wrong) > 1).any() == (wrong is not sharp)
        assert drawn == ([] if wrong is not sharp else [True])


def test_a_larger_picture_of_something_else_is_refused(grid: Grid) -> None:
    screen = np.random.default_rng(5).integers(0, 256, (90, 100, 3), dtype=np.uint8)
    with pytest.raises(ValueError, match="picture: has 100x90 pixels, but the scene's picture has 60x45"):
        cltrace.compare(grid.scene("step3-shadows", (60, 45)), screen)


def test_a_texture_of_one_row_on_a_sphere_is_no_colour_of_a_mesh(tmp_path: Path) -> None:
    """Meshes' colours come as such textures, but here a sphere has it, which has no corners."""
    scenes = Path(__file__).parents[2] / "scenes"
    for name in ("meshes", "textures"):
        shutil.copytree(scenes / name, tmp_path / name)
    row = np.arange(256, dtype=np.uint8)[None, :, None].repeat(3, 2)
    Image.fromarray(row).save(tmp_path / "textures" / "planet.png")
    shutil.copy(scenes / "planet.xml", tmp_path)
    scene = cltrace.load(tmp_path / "planet.xml")
    assert 1 in map(len, scene.textures)
    assert not any(Tracer(scene).colors_of_meshes)
