"""`explain`: the numbers that it prints are those of the picture."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENES
from PIL import Image as Picture
from stress_cases import picture

import cltrace
from cltrace import cli
from cltrace.explanation import textbook
from cltrace.explanation.pixel import TIED, Explainer
from cltrace.explanation.record import Hit, TracedRay
from cltrace.explanation.textbook import SphereTest, Swarm, TriangleTest
from cltrace.reference import Pixel, byte_of
from cltrace.run.devices import Device
from cltrace.students.check import CONTRACT

FIRST = SCENES[0].parent / "first.xml"
# Pixels that are looked at, and in which part of the picture: few take 50 ms and more, or have a kernel to compile.
PIXELS = [
    pytest.param("first", 12, (32, 24)),
    *(pytest.param(path.stem, 40 if path.stem == "room" else 200, None, marks=pytest.mark.slow) for path in SCENES),
]


def printed_bytes(explanation: cltrace.Explanation) -> tuple[list[int], list[int]]:
    """The bytes of the terms of the pixel's own sum, added as they are printed, and the bytes that are printed."""
    lines = str(explanation).split("\n")
    begin = max(i for i, line in enumerate(lines) if line.startswith("Sum "))
    end = next(i for i in range(begin, len(lines)) if lines[i].startswith("  = color"))
    terms = lines[begin + 1 : end]
    for i, line in enumerate(terms):
        if line.startswith("  = local color"):
            terms = terms[i + 1 :]
            break
    rows = np.array([[float(word) for word in line.split()[-3:]] for line in terms]).reshape(-1, 3)
    bytes_ = [byte_of(channel, explanation.truncate) for channel in rows.sum(axis=0)]
    return bytes_, [int(word) for word in lines[-1].split()[-3:]]


@pytest.mark.parametrize(("name", "pixels", "part"), PIXELS)
def test_the_printed_terms_add_up_to_the_pictures_bytes(
    name: str, pixels: int, part: tuple[int, int] | None, device: Device
) -> None:
    """Pixels at random of a scene, or of a part of that size somewhere in it."""
    path = FIRST.with_name(f"{name}.xml")
    scene, place = cltrace.load(path), random.Random(path.name)
    width, height = scene.camera.resolution
    size = part or (width, height)
    left, top = place.randrange(width - size[0] + 1), place.randrange(height - size[1] + 1)
    # One program for all scenes, which takes longer to run and is compiled only once.
    image = picture(scene, device, crop=(left, top, left + size[0], top + size[1]))
    explainer, close = Explainer(scene), 0
    for _ in range(pixels):
        x, y = place.randrange(size[0]), place.randrange(size[1])
        found = explainer.pixel(left + x, top + y)
        hit = found.rays[0].hit
        if found.rgb8 != tuple(image.rgb8[y, x].tolist()):
            # The kernel's colours are float32, and the sums of several terms: 255 c is half-way between two bytes.
            assert np.abs(image.rgb8[y, x] - 255 * np.clip(found.color, 0, 1)).max() < 0.5 + 255 * 2.0**-20, (x, y)
            close += 1
        assert (hit.surface.id if hit else -1) == image.id[y, x], (x, y)
        assert np.allclose(found.rays[0].color, found.color, rtol=1e-12, atol=1e-14), (x, y)
        assert printed_bytes(found) == (list(found.rgb8), list(found.rgb8)), (x, y)
    assert close <= max(1, CONTRACT["accurate"][0] * pixels)


def test_the_command_prints_what_python_has(capsys: pytest.CaptureFixture[str]) -> None:
    found = cltrace.explain(cltrace.load(FIRST), 400, 250)
    assert cli.main([str(FIRST), "--explain", "400,250"]) == 0
    assert capsys.readouterr().out == f"{found}\n"
    assert cli.main([str(FIRST), "--explain", "400,250", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == found.to_dict()


def test_size_square_pixels_and_truncate_count(capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--size", "99x55", "--square-pixels", "--truncate", "--json"]
    assert cli.main([str(FIRST), "--explain", "70,30", *options]) == 0
    found = json.loads(capsys.readouterr().out)
    scene = cltrace.load(FIRST)
    scene = scene.seen_by(replace(scene.camera, resolution=(99, 55)))
    assert found == cltrace.explain(scene, 70, 30, truncate=True, square_pixels=True).to_dict()
    assert found["camera"]["square_pixels"]
    assert found["rgb8"] == [int(255 * c) for c in found["color"]]
    assert found != cltrace.explain(scene, 70, 30, truncate=True).to_dict()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["960,0"], "--explain: must be within 0,0 and 959,539, got 960,0"),
        (["9,9", "--size", "9x10"], "--explain: must be within 0,0 and 8,9, got 9,9"),
        (["1.5,2"], "argument --explain: must be X,Y from the top left, such as 320,200, got '1.5,2'"),
        (["1,2", "-o", "a.png"], "--explain takes no -o"),
        (["1,2", "--stats=json"], "--explain takes no --stats"),
        (["1,2", "--trace", "--json"], "--json and --trace both say how --explain prints"),
    ],
)
def test_what_makes_no_sense_is_said(options: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([str(FIRST), "--explain", *options]) == 2
    said = capsys.readouterr()
    assert not said.out
    assert said.err.startswith(f"cltrace: {message}")
    assert said.err.count("\n") == 1


@pytest.mark.parametrize("pixel", [(-1, 0), (0, 540), (960, 0), (1.5, 0), (True, 0), ("1", 0)])
def test_a_pixel_that_is_none_is_refused(pixel: tuple[Any, Any]) -> None:
    with pytest.raises(ValueError, match="must be a whole number within"):
        cltrace.explain(cltrace.load(FIRST), *pixel)


def test_what_is_no_scene_is_refused() -> None:
    with pytest.raises(TypeError, match="scene: must be a"):
        cltrace.explain(str(FIRST), 1, 2)  # type: ignore[arg-type]


TWO = """<scene output_file="two.png">
<background_color r="0.1" g="0.2" b="0.3"/>
<camera><position x="0" y="0" z="6"/><lookat x="0" y="0" z="0"/><up x="0" y="1" z="0"/>
<horizontal_fov angle="30"/><resolution horizontal="21" vertical="21"/><max_bounces n="{bounces}"/></camera>
<lights>
<ambient_light><color r="1" g="1" b="1"/></ambient_light>
<point_light><color r="1" g="1" b="1"/><position x="0" y="0" z="5"/></point_light>
<parallel_light><color r="0.5" g="0.5" b="0.5"/><direction x="0" y="0" z="-1"/></parallel_light>
</lights>
<surfaces>
{surfaces}
</surfaces></scene>
"""
BALL = """<sphere radius="{radius}"><position x="{x}" y="0" z="{z}"/>
<material_solid><color r="0.5" g="1" b="0"/><phong ka="0.2" kd="0.5" ks="0" exponent="1"/><reflectance r="{r}"/>
<transmittance t="{t}"/><refraction iof="1.5"/></material_solid>{transform}</sphere>"""


def ball(z: float, radius: float = 1, x: float = 0, r: float = 0, t: float = 0, transform: str = "") -> str:
    return BALL.format(z=z, radius=radius, x=x, r=r, t=t, transform=transform)


def explained(folder: Path, *surfaces: str, x: int = 10, y: int = 10, bounces: int = 8) -> cltrace.Explanation:
    """The pixel of a picture of 21x21 that these surfaces are in; the middle looks from (0, 0, 6) along -z."""
    path = folder / "two.xml"
    path.write_text(TWO.format(surfaces="\n".join(surfaces), bounces=bounces))
    return cltrace.explain(cltrace.load(path), x, y)


def hit_of(found: cltrace.Explanation) -> Hit:
    hit = found.rays[0].hit
    assert hit is not None
    return hit


def test_the_numbers_of_a_small_scene(tmp_path: Path) -> None:
    """Along -z from (0, 0, 6): a ball at the origin, and one behind it, from lines 11 and 14 on."""
    found = explained(tmp_path, ball(0), ball(-4))
    assert found.camera.line == 3
    assert (found.camera.u, found.camera.v, found.camera.x_i, found.camera.y_i) == (10, 10, 0, 0)
    ray = found.rays[0]
    assert (ray.origin, ray.direction, ray.meets) == ((0, 0, 6), (0, 0, -1), 2)
    near, far = ray.tests
    assert (near.surface.kind, near.surface.id, near.surface.line, near.distance) == ("sphere", 0, 11, 5)
    assert (far.surface.kind, far.surface.id, far.surface.line, far.distance) == ("sphere", 1, 14, 9)
    sphere = near.textbook
    assert isinstance(sphere, SphereTest)
    assert (sphere.a, sphere.b, sphere.c, sphere.discriminant, sphere.t) == (1, -12, 35, 1, (5, 7))
    hit = hit_of(found)
    assert (hit.point, hit.normal, hit.t, hit.inside) == ((0, 0, 1), (0, 0, 1), 5, False)
    assert [(a.light.kind, a.light.number, a.light.line, a.color) for a in ray.ambient] == [
        ("ambient_light", 0, 6, (0.1, 0.2, 0))
    ]
    point, parallel = ray.lights
    assert (point.light.kind, point.light.number, point.light.line) == ("point_light", 1, 7)
    assert (point.fate, point.l, point.distance, point.n_l, point.diffuse) == ("lit", (0, 0, 1), 4, 1, (0.25, 0.5, 0))
    assert (parallel.fate, parallel.diffuse) == ("lit", (0.125, 0.25, 0))
    assert found.rgb8 == (121, 242, 0)
    assert found.line == (
        "pixel (10, 10) meets sphere 0 (line 11) at t = 5; point_light 1 reaches the point; "
        "parallel_light 2 reaches the point; bytes (121, 242, 0)"
    )


def test_what_hides_a_light_and_what_is_behind_it(tmp_path: Path) -> None:
    """The point light at z = 5 is between the eye, at 6, and the ball; a second ball is above the eye, at 20 behind."""
    lit = explained(tmp_path, ball(0), ball(20))
    assert lit.rays[0].lights[0].fate == "lit"
    behind = lit.rays[0].lights[0].behind
    assert behind is not None
    assert (behind.surface.id, behind.distance, behind.point) == (1, 18, (0, 0, 19))
    parallel = lit.rays[0].lights[1]
    assert (parallel.fate, parallel.blockers, parallel.between[0].distance) == ("in shadow", 1, 18)
    assert "shadow ray: something is between\n    sphere 1 (line 14) at distance 18, (0, 0, 19)\n" in str(lit)
    # From the light to a point beside the axis, past a small ball that the eye's ray passes by.
    seen = explained(tmp_path, ball(-3, radius=3), ball(2.5, radius=0.05, x=0.48), x=13)
    point, parallel = seen.rays[0].lights
    assert (point.fate, point.between[0].surface.id, parallel.fate) == ("in shadow", 1, "lit")
    assert 2 < point.between[0].distance < 3 < 5 < point.distance
    assert f"between before the light at distance {point.distance:.6g}\n    sphere 1 (line 14) at" in str(seen)
    said = "point_light 1 does not reach the point: sphere 1 (line 14) is between; parallel_light 2 reaches the point;"
    assert said in seen.line


def test_a_mirror_and_its_end(tmp_path: Path) -> None:
    """Between two mirrors that face each other, until max_bounces."""
    mirrors = ball(0, r=0.5), ball(15, r=0.5)
    found = explained(tmp_path, *mirrors, bounces=2)
    assert [(ray.kind, ray.depth, ray.weight) for ray in found.rays] == [
        ("primary", 0, 1),
        ("mirrored", 1, 0.5),
        ("mirrored", 2, 0.25),
        ("mirrored", 3, 0.125),
    ]
    assert [ray.last for ray in found.rays] == [False, False, False, True]
    assert [ray.share for ray in found.rays] == [0.5, 0.5, 0.5, 1]
    assert "max_bounces = 2 is reached" in str(found)
    # The light at 5 shines on the first one and the second one; the parallel one on the second one from behind.
    near, far = np.array([0.35, 0.7, 0]), np.array([0.35, 0.7, 0])
    color = 0.5 * near + 0.25 * far + 0.125 * near + 0.125 * far
    assert np.allclose(found.color, color, rtol=1e-12)
    assert printed_bytes(found) == (list(found.rgb8), list(found.rgb8))


def test_glass_and_total_reflection(tmp_path: Path) -> None:
    found = explained(tmp_path, ball(0, t=1), x=10)
    assert [(ray.kind, ray.hit is None) for ray in found.rays] == [
        ("primary", False),
        ("refracted", False),
        ("refracted", True),
    ]
    inside = found.rays[1].tests[0]
    assert (inside.surface.id, inside.distance, inside.remark[:28]) == (0, 2, "the one that is all but 0 is")
    assert found.rgb8 == (26, 51, 77)
    # From within glass of 1.5, at an angle whose sine is 2.3 / 2.6 > 1 / 1.5: the eye is in the ball.
    total = explained(tmp_path, ball(6, radius=2.6, x=2.3, t=0.6, r=0.2))
    bounce = total.rays[0].bounces[0]
    assert (bounce.kind, bounce.total, bounce.share) == ("mirrored", True, 0.8)
    assert "r + t = 0.8, as total reflection leaves no refracted ray" in str(total)


def test_what_is_narrowly_missed(tmp_path: Path) -> None:
    """By less than a pixel, which is 2 tan(30)/21 wide at distance 1, and 6 times that at the origin: 0.33."""
    pixel = 6 * 2 * np.tan(np.pi / 6) / 21
    found = explained(tmp_path, ball(0, x=1 + pixel / 2))
    (missed,) = found.rays[0].missed
    assert (missed.surface.id, missed.distance) == (0, np.inf)
    assert isinstance(missed.textbook, SphereTest)
    assert missed.textbook.discriminant < 0
    assert "Surfaces that it misses, and that pixels beside this one show\n  sphere 0 (line 11)\n" in str(found)
    assert "Closest: nothing, so the ray sees background_color" in str(found)
    assert not explained(tmp_path, ball(0, x=1 + 1.1 * pixel)).rays[0].missed
    # One that is hidden.
    assert not explained(tmp_path, ball(0, x=1 + pixel / 2), ball(4, radius=0.5)).rays[0].missed


@pytest.mark.parametrize(
    ("center", "radius", "remark"),
    [
        (-0.1, lambda k: (k + 1) / 10, "exactly, it passes by: these numbers are rounded"),
        (-100, lambda k: k / 10 + 100, "exactly, it is met, at t = "),
    ],
)
def test_where_exact_arithmetic_differs_it_says_so(center: float, radius: Callable[[int], float], remark: str) -> None:
    """Rays along -z at x = k / 10 that all but touch a ball, by rounding of the numbers given to it; 0 is a hit."""
    said = 0
    for k in range(1, 40):
        x, r, z = k / 10, radius(k), 0.37 * k
        camera = cltrace.Camera((x, 0, z), (x, 0, -1), horizontal_fov=30, resolution=(3, 3))
        scene = cltrace.Scene.from_spheres(camera, [cltrace.ambient_light()], [(center, 0, 0)], r)
        found = cltrace.explain(scene, 1, 1).rays[0]
        hits = Fraction(x) - Fraction(center) <= Fraction(r)
        assert (found.hit is not None) == hits
        for test in found.tests + found.missed:
            assert isinstance(test.textbook, SphereTest)
            assert bool(test.remark) or hits == (test.textbook.discriminant >= 0)
            said += test.remark.startswith(remark)
    assert said > 5


@pytest.mark.parametrize("name", ["thousand", "wide", "eclipse", "random"])
def test_of_many_spheres_only_those_are_tried_that_matter(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same text comes out as where all are tried for every ray."""
    scene = mixed() if name == "random" else cltrace.load(FIRST.with_name(f"{name}.xml"))
    few = Explainer(scene)
    assert any(isinstance(surface, Swarm) for surface in few.world.surfaces)
    monkeypatch.setattr(textbook, "MANY", 10**9)
    every = Explainer(scene)
    assert not any(isinstance(surface, Swarm) for surface in every.world.surfaces)
    (width, height), place = scene.camera.resolution, random.Random(name)
    for _ in range(4 if name == "thousand" else 12):
        x, y = place.randrange(width), place.randrange(height)
        assert str(few.pixel(x, y)) == str(every.pixel(x, y))


def mixed() -> cltrace.Scene:
    """Mirrors, glass and ellipsoids, many of which touch or are inside others, with the eye and a light among them."""
    numbers = np.random.default_rng(1)
    n = 200
    centers, radii = numbers.integers(-4, 5, (n, 3)) / 2, numbers.choice([0.125, 0.25, 0.5], n)
    transform = np.eye(3) * np.where(numbers.random((n, 1, 1)) < 0.5, 1, [[[1], [0.5], [0.25]]])
    camera = cltrace.Camera((0.25, 0, 3), (0, 0, 0), horizontal_fov=30, resolution=(40, 30), max_bounces=3)
    lights = [cltrace.ambient_light(), cltrace.point_light((0.5, 1, 2.25)), cltrace.parallel_light((0, -1, -1))]
    mirror = numbers.choice([0, 0, 0.5], n)
    glass = numbers.choice([0, 0, 0.4], n)
    return cltrace.Scene.from_spheres(
        camera, lights, centers, radii, reflectance=mirror, transmittance=glass, index=1.5, transform=transform
    )


def test_what_is_exactly_as_near_is_said(tmp_path: Path) -> None:
    found = explained(tmp_path, ball(0), ball(0), ball(-1, radius=2))
    tests = found.rays[0].tests
    assert [test.surface.id for test in tests] == [0, 1, 2]
    assert [test.remark for test in tests] == ["", TIED, TIED]
    assert "because of its lower number" in str(found)


@pytest.mark.slow
def test_a_clipped_ball_and_its_cap() -> None:
    camera = cltrace.Camera((0, 0, 9), (0, 0, 0), horizontal_fov=20, resolution=(33, 33))
    scene = cltrace.Scene.from_spheres(camera, "studio", [(0, 0, -0.8)], 1, "lime").clipped((0,) * 3, (0, 0, 1), "red")
    image = cltrace.render(scene, outputs=("rgb8", "primitive"))
    for x, words in ((16, "cap of sphere 0"), (int(np.argmax(image.rgb8[16, :, 1] > 0)), "sphere 0")):
        found = cltrace.explain(scene, x, 16)
        assert bool(image.primitive[16, x] == -2) is (words != "sphere 0")
        assert f"\n  {words}\n" in str(found)
        assert printed_bytes(found) == (image.rgb8[16, x].tolist(),) * 2


def test_a_light_at_the_point() -> None:
    camera = cltrace.Camera((0, 0, 5), (0, 0, 0), horizontal_fov=30, resolution=(3, 3))
    scene = cltrace.Scene.from_spheres(camera, [cltrace.point_light((0, 0, 1))], [(0, 0, 0)], 1, kd=0.5, ks=0)
    (touching,) = cltrace.explain(scene, 1, 1).rays[0].lights
    assert (touching.fate, touching.diffuse) == ("at the point", (0, 0, 0))


def test_a_surface_without_a_file_has_no_line() -> None:
    camera = cltrace.Camera((0, 0, 5), (0, 0, 0), horizontal_fov=30, resolution=(3, 3))
    scene = cltrace.Scene.from_spheres(camera, [cltrace.point_light((9, 9, 9))], [(0, 0, 0)], 1)
    text = str(cltrace.explain(scene, 1, 1))
    assert text.startswith("pixel (1, 1) of 3x3\n\nCamera\n")
    assert "line" not in text
    assert "  sphere 0\n" in text


def test_rays_without_end_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Pixel, "RAYS", 100)
    camera = cltrace.Camera((0, 0, 0), (0, 0, -1), resolution=(3, 3), max_bounces=30)
    glass = cltrace.Scene.from_spheres(camera, [], [(0, 0, 0), (0, 0, 0)], [1, 2], reflectance=1, transmittance=1)
    with pytest.raises(cltrace.TooManyRaysError, match=r"camera\.max_bounces: must be lower than 30"):
        cltrace.explain(glass, 1, 1)


def textured(folder: Path, texels: np.ndarray) -> tuple[str, str]:
    """The material of a ball, and the same with a texture."""
    Picture.fromarray(texels).save(folder / "t.png")
    material = BALL[BALL.index("<material") : BALL.index("</sphere>")].format(r=0, t=0, transform="")
    rest = material[material.index("<phong") :].replace("solid", "textured")
    return material, f'<material_textured><texture name="t.png"/>{rest}'


def test_a_meshs_triangle_has_the_line_of_its_face(tmp_path: Path) -> None:
    """Two triangles of a square at z = 0, of one face, and one before it that is smooth."""
    material, image = textured(tmp_path, np.array([[[255, 0, 0], [0, 255, 0]]], np.uint8))
    square = "v -1 -2 0\nv 3 -2 0\nv 3 2 0\nv -1 2 0\nvt 0.25 0\nvt 0.75 0\n"
    (tmp_path / "square.obj").write_text(f"{square}f 1/1 3/2 4/1 # the other half\n\nf 1/1 2/2 3/2\n")
    (tmp_path / "smooth.obj").write_text("v -1 -1 1\nv 2 -1 1\nv 0 2 1\nvn 0 0 -2\nvn 1 0 -1\nf 1//1 2//2 3//1\n")
    meshes = [f'<mesh name="square.obj">{image}</mesh>', f'<mesh name="smooth.obj">{material}</mesh>']
    found = explained(tmp_path, ball(-9), *meshes, x=14)
    smooth, flat = found.rays[0].tests
    assert (smooth.surface.id, smooth.surface.line, smooth.surface.primitive, smooth.surface.face_line) == (2, 16, 0, 6)
    assert (flat.surface.id, flat.surface.primitive, flat.surface.face_line) == (1, 1, 9)
    assert f"  mesh 1 (line {flat.surface.line}), triangle 1 (line 9 of square.obj)\n" in str(found)
    assert (hit_of(found).shape, hit_of(found).turned, hit_of(found).inside) == ("smooth", True, True)
    alone = explained(tmp_path, meshes[0], x=14)
    hit = hit_of(alone)
    assert hit.texture is not None
    assert (hit.shape, hit.turned, hit.texture.name, hit.texture.size) == ("flat", False, "t.png", (2, 1))
    # u is a quarter at x = -1 and three quarters at x = 3, and pixels are 6 * 2 tan(30) / 21 wide there.
    u = 0.25 + (1 + 4 * 12 * np.tan(np.pi / 6) / 21) / 8
    assert hit.texture.uv == (pytest.approx(u), 0)
    assert f"(u mod 1) * width = {2 * u:.6g}: columns 1 and 0, {2 * u - 1:.6g} of the latter" in str(alone)


def test_the_texels_that_are_mixed(tmp_path: Path) -> None:
    texels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [51, 51, 51]]], np.uint8)
    found = explained(tmp_path, ball(0).replace(*textured(tmp_path, texels)), x=12, y=8)
    texture = hit_of(found).texture
    assert texture is not None
    assert sum(texel.weight for texel in texture.texels) == pytest.approx(1)
    for texel in texture.texels:
        assert texel.color == tuple(texels[texel.y, texel.x] / 255)
        color = ", ".join(f"{c:.6g}" for c in texel.color)
        assert f"texel ({texel.x}, {texel.y}) = ({color}), weight {texel.weight:.6g}" in str(found)
    mixed = np.array([texel.weight for texel in texture.texels]) @ [texel.color for texel in texture.texels]
    assert texture.color == pytest.approx(tuple(mixed))


def test_a_transform_and_the_ray_in_the_objects_space(tmp_path: Path) -> None:
    """A ball of radius 1, first scaled by 2 and then moved by (0, 0, -1), met from z = 6 at z = 1."""
    steps = '<transform><translate x="0" y="0" z="-1"/><scale x="2" y="2" z="2"/></transform>'
    found = explained(tmp_path, ball(0, transform=steps))
    hit, place = hit_of(found), hit_of(found).placement
    assert place is not None
    assert place.matrix == ((2, 0, 0, 0), (0, 2, 0, 0), (0, 0, 2, -1))
    assert place.inverse == ((0.5, 0, 0, 0), (0, 0.5, 0, 0), (0, 0, 0.5, 0.5))
    assert (place.origin, place.direction) == ((0, 0, 3.5), (0, 0, -0.5))
    # In the object's space, the ball of radius 1 is met at the same t.
    assert place.origin[2] + hit.t * place.direction[2] == 1
    assert "  in the object's space o' = M^-1 o = (0, 0, 3.5)\n" in str(found)
    assert hit_of(explained(tmp_path, ball(0))).placement is None


def test_a_spot_light_has_its_formula(tmp_path: Path) -> None:
    path = tmp_path / "two.xml"
    light = '<point_light><color r="1" g="1" b="1"/><position x="0" y="0" z="5"/></point_light>'
    spot = light.replace("point_light", "spot_light").replace(
        "</spot", '<direction x="0.1" y="0" z="-1"/><falloff alpha1="{}" alpha2="{}"/></spot'
    )
    angle = np.degrees(np.arctan(0.1))
    for alpha1, alpha2, told in (
        (2, 10, f"F = (alpha2 - angle) / (alpha2 - alpha1) = (10 - {angle:.6g}) / (10 - 2) = {(10 - angle) / 8:.6g}"),
        (6, 10, "F = 1, as angle <= alpha1"), (2, 5, "F = 0, as angle >= alpha2"),
    ):  # fmt: skip
        path.write_text(TWO.format(surfaces=ball(0), bounces=8).replace(light, spot.format(alpha1, alpha2)))
        found = cltrace.explain(cltrace.load(path), 10, 10)
        text, term = str(found), found.rays[0].lights[0]
        assert term.fate == ("lit" if alpha2 > angle else "beside the cone")
        assert f"angle = acos(-l.direction) = {angle:.6g} degrees, alpha1 = {alpha1}, alpha2 = {alpha2}\n" in text
        assert f"  {told}\n" in text


def test_the_table_has_the_numbers_of_the_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = explained(tmp_path, ball(0, r=0.5), ball(2, x=0.7), y=9)
    rows = [row.split("\t") for row in found.table.splitlines()]
    assert {row[0] for row in rows} == {str(i) for i in range(len(found.rays))}
    assert len({(place, name) for place, name, *_ in rows}) == len(rows)
    text = str(found)
    for _, name, *numbers in rows:
        if name not in ("depth", "surface", "inside", "color") and "reaches" not in name:
            assert all(number in text for number in numbers), name
    assert rows[-1] == ["0", "bytes", *map(str, found.rgb8)]
    assert cli.main([str(tmp_path / "two.xml"), "--explain", "10,9", "--trace"]) == 0
    assert capsys.readouterr().out == found.table + "\n"


def near(a: object, b: object) -> bool:
    return bool(np.allclose(np.array(a, float), np.array(b, float), rtol=1e-7, atol=1e-7))


def check_camera(found: cltrace.Explanation, scene: cltrace.Scene) -> None:
    """By the tutorial's formulas, in pictures that are wider than high, and higher than wide."""
    c, (width, height), angle = found.camera, scene.camera.resolution, scene.camera.horizontal_fov
    fov_x, fov_y = (angle, angle * height / width) if width >= height else (angle * width / height, angle)
    assert near((c.fov_x, c.fov_y, c.u, c.v), (fov_x, fov_y, found.x, height - 1 - found.y))
    assert near((c.x_n, c.y_n), ((found.x + 0.5) / width, (height - found.y - 0.5) / height))
    assert near((c.x_i, c.y_i), (2 * np.array((c.x_n, c.y_n)) - 1) * np.tan(np.radians((fov_x, fov_y))))
    assert near(c.direction, np.array((c.x_i, c.y_i, -1)) / np.linalg.norm((c.x_i, c.y_i, -1)))
    assert near(found.rays[0].direction, np.array(c.axes).T @ c.direction)


def check_tests(ray: TracedRay) -> None:
    """Of spheres and triangles that it meets."""
    o, d = np.array(ray.origin), np.array(ray.direction)
    for test in ray.tests:
        if isinstance(test.textbook, SphereTest):
            s = test.textbook
            solutions: tuple[float, ...] = s.t
            assert s.discriminant == (s.b / 2) ** 2 - s.a * s.c
            assert near([(s.a * t + s.b) * t / (1 + abs(s.c)) for t in s.t], [-s.c / (1 + abs(s.c))] * len(s.t))
            if not s.own_axes:
                assert near(np.linalg.norm(o + test.distance * d - s.center) / s.radius, 1)
        else:
            t = test.textbook
            assert isinstance(t, TriangleTest)
            solutions = (t.t,)
            assert near(t.weights @ np.array(t.corners), o + t.t * d)
            assert near(sum(t.weights), 1)
        assert test.remark or near(test.distance, min(t for t in solutions if t > 0))


def check_hit(ray: TracedRay, hit: Hit) -> None:
    """The point, the normal, each light, and what is in its way."""
    d, n, C = np.array(ray.direction), np.array(hit.normal), np.array(hit.color)
    assert near(hit.point, np.array(ray.origin) + hit.t * d)
    assert near(np.linalg.norm(n), 1)
    assert n @ d <= 0
    assert hit.surface == ray.tests[0].surface
    for term in ray.lights:
        towards, strength = np.array(term.l), term.strength if term.fate == "lit" else 0
        assert near(term.n_l, n @ towards)
        assert near(term.r_v, np.array(term.r) @ -d)
        assert near(term.diffuse, strength * hit.kd * np.array(term.L) * C * max(0, term.n_l))
        assert near(term.specular, strength * hit.ks * np.array(term.L) * max(0, term.r_v) ** hit.exponent)
        assert (term.fate == "in shadow") == (term.blockers > 0)
        assert all(met.distance < term.distance for met in term.between)
        assert all(near(met.point, hit.point + met.distance * towards) for met in term.between if met.point)
        assert term.behind is None or term.behind.distance > term.distance


def check_bounces(found: cltrace.Explanation, ray: TracedRay, hit: Hit) -> None:
    """The shares and angles of mirrors and glass, and the rays that they send on."""
    n = np.array(hit.normal)
    assert near(ray.share, max(0, 1 - hit.reflectance - hit.transmittance) if ray.bounces else 1)
    for bounce in ray.bounces:
        share = hit.transmittance if bounce.kind == "refracted" else hit.reflectance + bounce.total * hit.transmittance
        assert near(bounce.share, share)
        assert near(np.cos(np.radians(bounce.angle_in)), -n @ ray.direction)
        if bounce.ray is None:
            assert ray.weight * bounce.share < 1 / 512
            continue
        further = found.rays[bounce.ray]
        assert near((further.weight, further.depth), (ray.weight * bounce.share, ray.depth + 1))
        assert (further.kind, further.color, further.origin) == (bounce.kind, bounce.color, hit.point)
        assert near(np.cos(np.radians(bounce.angle_out)), abs(n @ further.direction))


CHECKED = (
    *("first", "tall", "wide", "three-lights", "spot-colours", "dusk"),
    *("step6-textures", "step7-glass", "step8-cone"),
)


@pytest.mark.parametrize("name", CHECKED)
def test_the_numbers_fit_each_other(name: str) -> None:
    """Textbook formulas make each number of those before it."""
    scene, place = cltrace.load(FIRST.with_name(f"{name}.xml")), random.Random(name)
    explainer, (width, height) = Explainer(scene), scene.camera.resolution
    for _ in range(8):
        found = explainer.pixel(place.randrange(width), place.randrange(height))
        check_camera(found, scene)
        assert near(found.rays[0].color, found.color)
        for ray in found.rays:
            check_tests(ray)
            if ray.hit:
                check_hit(ray, ray.hit)
                check_bounces(found, ray, ray.hit)
            assert near(ray.local, np.sum([(0, 0, 0), *(term.color for term in ray.local_terms)], axis=0))
            assert near(ray.color, np.sum([term.color for term in ray.terms], axis=0))
