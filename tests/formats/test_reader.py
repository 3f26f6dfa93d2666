"""The reader: what it makes of valid files, and every message by its exact text."""

from __future__ import annotations

import errno
import math
import os
import pickle
import re
import socket
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

import cltrace
from cltrace.base import limits
from cltrace.base.errors import SceneError
from cltrace.formats import checks, document, reader, surfaces
from cltrace.formats.faults import closest
from cltrace.formats.reader import read
from cltrace.formats.surfaces import cos_sin
from cltrace.scene import AMBIENT, LIGHT, MATERIAL, PARALLEL, POINT, SPHERE, SPOT, Camera, Scene
from cltrace.scene import camera as eye

MORE_LIGHTS = "; --limit lights=N or CLTRACE_LIMITS allows more"
SCENE = """\
<?xml version="1.0" standalone="no" ?>
<!DOCTYPE scene SYSTEM "scene.dtd">
<scene output_file="example.png">
  <background_color r="0.1" g="0.2" b="0.3"/>
  <camera>
    <position x="1" y="2" z="3"/>
    <lookat x="0.5" y="-2.0E-10" z="-2.5"/>
    <up x="0" y="1" z="0"/>
    <horizontal_fov angle="45"/>
    <resolution horizontal="640" vertical="480"/>
    <max_bounces n="8"/>
  </camera>
  <lights>
    <ambient_light><color r="0" g="0" b="0"/></ambient_light>
    <parallel_light><color r="1" g="0.5" b="2"/><direction x="0" y="-1" z="0"/></parallel_light>
    <point_light><color r="1" g="1" b="1"/><position x="5" y="8" z="2"/></point_light>
    <spot_light>
      <color r="1" g="1" b="0"/>
      <position x="1" y="2" z="3"/>
      <direction x="0" y="0" z="-3"/>
      <falloff alpha1="20" alpha2="25.5"/>
    </spot_light>
  </lights>
  <surfaces>
    <sphere radius="1.5">
      <position x="4" y="5" z="6"/>
      <material_solid>
        <color r="0.5" g="0.25" b="1"/>
        <phong ka="0.3" kd="0.9" ks="1.0" exponent="200"/>
        <reflectance r="0.0"/>
        <transmittance t="0.0"/>
        <refraction iof="0"/>
      </material_solid>
    </sphere>
  </surfaces>
</scene>
"""
BODY = SCENE.split("\n", 2)[2]
SPHERE_TEXT = SCENE[SCENE.index("    <sphere") : SCENE.index("  </surfaces>")]
MATERIAL_TEXT = SPHERE_TEXT[SPHERE_TEXT.index("      <material") : SPHERE_TEXT.index("    </sphere>")]


@pytest.fixture(autouse=True)
def _in_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def read_text(text: str | bytes) -> tuple[Scene, list[str]]:
    Path("scene.xml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read("scene.xml")


def scene_of(text: str | bytes) -> Scene:
    scene, warnings = read_text(text)
    assert warnings == []
    return scene


def warnings_of(text: str) -> list[str]:
    return [line.removeprefix("scene.xml:") for line in read_text(text)[1]]


def faults_of(text: str | bytes) -> list[str]:
    with pytest.raises(SceneError) as caught:
        read_text(text)
    return [line.removeprefix("scene.xml:") for line in str(caught.value).split("\n")]


def all_carefully(spheres: list[object]) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(len(spheres), np.bool_), np.empty((len(spheres), surfaces.ROW))


def changed(old: str, new: str, text: str = SCENE) -> str:
    assert old in text
    return text.replace(old, new, 1)


def with_transform(*steps: str, position: str = 'x="4" y="5" z="6"') -> str:
    text = changed("</material_solid>\n", f"</material_solid>\n      <transform>{''.join(steps)}</transform>\n")
    return changed('x="4" y="5" z="6"', position, text)


def same(a: Scene, b: Scene) -> bool:
    arrays = ("lights", "spheres", "materials", "to_object")
    return all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in arrays) and (
        (a.camera, a.background, a.output_file) == (b.camera, b.background, b.output_file)
    )


# --- Valid files


def test_everything_arrives() -> None:
    scene = scene_of(SCENE)
    camera = scene.camera
    assert (camera.position, camera.lookat, camera.up) == ((1, 2, 3), (0.5, -2.0e-10, -2.5), (0, 1, 0))
    assert (camera.horizontal_fov, camera.resolution, camera.max_bounces) == (45, (640, 480), 8)
    assert (scene.background, scene.output_file) == ((0.1, 0.2, 0.3), "example.png")
    lights = [
        (AMBIENT, (0, 0, 0), (0, 0, 0), (0, 0, -1), 0, 0),
        (PARALLEL, (1, 0.5, 2), (0, 0, 0), (0, -1, 0), 0, 0),
        (POINT, (1, 1, 1), (5, 8, 2), (0, 0, -1), 0, 0),
        (SPOT, (1, 1, 0), (1, 2, 3), (0, 0, -3), 20, 25.5),
    ]
    none = (0, (0, 0, 0), 0, ((0, 0, 0), (0, 0, 0)))  # of what soft lights have
    assert scene.lights.tobytes() == np.array([(*light, *none) for light in lights], LIGHT).tobytes()
    assert scene.spheres.tobytes() == np.array([((4, 5, 6), 1.5, 0, -1)], SPHERE).tobytes()
    materials = [((0.5, 0.25, 1), 0.3, 0.9, 1, 200, 0, 0, 1, -1)]
    assert scene.materials.tobytes() == np.array(materials, MATERIAL).tobytes()


def test_a_path_object_will_do() -> None:
    scene = scene_of(SCENE)
    assert same(read(Path("scene.xml"))[0], scene)


@pytest.mark.parametrize(
    "text",
    [
        SCENE.replace("\n", "\r\n"),
        SCENE.replace("  ", "\t"),
        SCENE.replace("/>", " />"),
        SCENE.replace('="', " = '").replace('"', "'").replace("''", "'").replace("= 'scene.dtd", "'scene.dtd"),
        SCENE.split("\n", 2)[2],
        SCENE.split("\n", 1)[1],
        "\ufeff" + SCENE,
        SCENE.replace('standalone="no"', 'encoding="UTF-8" standalone="yes"'),
        SCENE.replace("    <", "<!-- <sphere/> --><?php ?>\n    <"),
        SCENE.replace('<sphere radius="1.5">', '<sphere radius="1.5"><!-- > -->'),
        SCENE.replace('radius="1.5"', 'radius=" +1.50 "'),
        SCENE.replace('radius="1.5"', 'radius="&#49;.5"'),
        SCENE.replace('radius="1.5"', 'radius="15.E-1"'),
        SCENE.replace('alpha2="25.5"', 'alpha2="2.55e1"'),
        SCENE.replace('r="0.0"', 'r="-0e-999"'),
        SCENE.replace('x="4" y="5" z="6"', 'z="6" x="4" y="5"'),
        SCENE.replace('iof="0"', 'iof="2.3"'),
        SCENE.replace('<!DOCTYPE scene SYSTEM "scene.dtd">', "<!DOCTYPE scene [<!ELEMENT scene ANY>]>"),
    ],
)
def test_other_ways_to_write_the_same(text: str) -> None:
    assert same(scene_of(text), scene_of(SCENE))


def test_encodings() -> None:
    name = SCENE.replace("example", "Bäume")
    for encoding in ("UTF-8", "ISO-8859-1", "UTF-16"):
        declared = name.replace(' standalone="no"', f' encoding="{encoding}"')
        assert scene_of(declared.encode(encoding)).output_file == "Bäume.png"


def test_lights_and_surfaces_may_be_none() -> None:
    text = SCENE[: SCENE.index("  <lights>")] + "<lights/><surfaces></surfaces></scene>"
    scene = scene_of(text)
    assert (len(scene.lights), len(scene.spheres), len(scene.materials)) == (0, 0, 0)


def test_several_ambient_lights_are_kept() -> None:
    light = '<ambient_light><color r="0.1" g="0" b="0"/></ambient_light>'
    assert scene_of(changed("<lights>", "<lights>" + light)).lights["kind"].tolist() == [
        AMBIENT,
        AMBIENT,
        PARALLEL,
        POINT,
        SPOT,
    ]


def test_equal_materials_are_one_record_in_the_order_of_first_use() -> None:
    red = changed('r="0.5"', 'r="0.9"', SPHERE_TEXT)
    minus = changed('ks="1.0"', 'ks="-0.0"', SPHERE_TEXT)
    plus = changed('ks="1.0"', 'ks="0"', SPHERE_TEXT)
    scene = scene_of(changed(SPHERE_TEXT, red + SPHERE_TEXT + red + minus + SPHERE_TEXT + plus))
    assert scene.spheres["material"].tolist() == [0, 1, 0, 2, 1, 2]
    assert scene.materials["color"][:, 0].tolist() == [0.9, 0.5, 0.5]
    assert scene.materials["ks"].tolist() == [1, 1, 0]


FINISH = '<reflectance r="0.0"/>\n        <transmittance t="0.0"/>\n        <refraction iof="0"/>'


def finished(r: str, t: str, iof: str) -> str:
    return changed(FINISH, f'<reflectance r="{r}"/><transmittance t="{t}"/><refraction iof="{iof}"/>', SPHERE_TEXT)


@pytest.mark.parametrize("bulk", [surfaces.bulk, all_carefully])
def test_mirrors_and_glass(bulk: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also of more than all light. Where nothing is let through, the index says nothing, and is 1."""
    monkeypatch.setattr(surfaces, "bulk", bulk)
    written = [
        ("0.25", "0", "0"),
        ("5e-1", "2.5E-1", "+15e-1"),
        ("9", "1e3", "1e-30"),
        (".25", "0.0", "2.4"),
        ("0.250", "-0e7", "-3"),
        ("0.5", "0.25", "1.5"),
    ]
    scene, warnings = read_text(changed(SPHERE_TEXT, "".join(finished(*values) for values in written)))
    assert warnings == ["scene.xml:43: material_solid: r + t = 1009 is above 1: more light goes on than reaches it"]
    assert scene.spheres["material"].tolist() == [0, 1, 2, 0, 0, 1]
    names = ["reflectance", "transmittance", "index"]
    assert scene.materials[names].tolist() == [(0.25, 0, 1), (0.5, 0.25, 1.5), (9, 1000, 1e-30)]
    assert len(scene.to_object) == 0


# --- Faults


NUMBERS = [
    ("-1", "must be > 0, got -1"),
    ("0", "must be > 0, got 0"),
    ("-0.0", "must be > 0, got -0.0"),
    ("abc", "must be a number, got 'abc'"),
    ("", "must be a number, got ''"),
    ("1 2", "must be a number, got '1 2'"),
    ("1,5", "must be a number, got '1,5'"),
    ("1_000", "must be a number, got '1_000'"),
    ("0x10", "must be a number, got '0x10'"),
    ("1e", "must be a number, got '1e'"),
    (".", "must be a number, got '.'"),
    ("--1", "must be a number, got '--1'"),
    ("\u0663", "must be a number, got '\u0663'"),
    ("\uff11", "must be a number, got '\uff11'"),
    ("\u00a01", "must be a number, got '\\xa01'"),
    ("1" * 200 + "x", f"must be a number, got '{'1' * 37}...'"),
    ("nan", "must be a finite number, got nan"),
    ("NaN", "must be a finite number, got NaN"),
    ("inf", "must be a finite number, got inf"),
    ("-Infinity", "must be a finite number, got -Infinity"),
    ("1e400", "must be a finite number, got 1e400"),
    ("1e39", "must not exceed 3.4e38 in magnitude, got 1e39"),
    ("1e-46", "must be at least 1.4e-45 in magnitude, got 1e-46"),
    ("-1e-400", "must be at least 1.4e-45 in magnitude, got -1e-400"),
    ("0." + "0" * 400 + "1", f"must be at least 1.4e-45 in magnitude, got 0.{'0' * 35}..."),
]


@pytest.mark.parametrize(("written", "fault"), NUMBERS)
def test_numbers(written: str, fault: str) -> None:
    assert faults_of(changed('radius="1.5"', f'radius="{written}"')) == [f"25: sphere: radius {fault}"]


AT_LOOKAT = ('x="1" y="2" z="3"', 'x="0.5" y="-2e-10" z="-2.5"', "7: camera lookat: must differ from position")
# What is changed to what in SCENE, and the exact messages.
FAULTS: list[tuple[str, ...]] = [
    (
        "background_color",
        "background_colour",
        "3: scene: <background_color> is missing; did you mean <background_colour> on line 4?",
    ),
    AT_LOOKAT,
    ('<up x="0" y="1"', '<up x="0" y="0"', "8: camera up: must not be 0"),
    (
        '<up x="0" y="1" z="0"/>',
        '<up x="1" y="4.0000000004" z="11"/>',
        "8: camera up: must not be parallel to the view",
    ),
    ('angle="45"', 'angle="0"', "9: camera horizontal_fov: angle must be within (0, 90), got 0"),
    (
        'angle="45"',
        'angle="90"',
        "9: camera horizontal_fov: angle must be within (0, 90), got 90: it is half of the opening, is 45 meant?",
    ),
    (
        'horizontal="640"',
        'horizontal="0"',
        "10: camera resolution: must be within 1..65536 each and 1073741824 pixels, got 0x480",
    ),
    (
        'horizontal="640"',
        f'horizontal="{"9" * 5000}"',
        "10: camera resolution: must be within 1..65536 each and 1073741824 pixels, got 1000000000000000000x480",
    ),
    ('horizontal="640"', 'horizontal="640.0"', "10: camera resolution: horizontal must be an integer, got '640.0'"),
    ('n="8"', 'n="8.5"', "11: camera max_bounces: n must be an integer, got '8.5'"),
    ('n="8"', 'n="101"', "11: camera max_bounces: n must be within 0..100, got 101"),
    ('z="-3"', 'z="-0"', "20: spot_light direction: must not be 0"),
    ('alpha1="20"', 'alpha1="30"', "21: spot_light falloff: alpha1 must be <= alpha2 (25.5), got 30"),
    (
        'alpha2="25.5"',
        'alpha2="181"',
        "21: spot_light falloff: alpha2 must be within [0, 180], got 181: it is half of the opening, is 90.5 meant?",
    ),
    ('radius="1.5"', 'raduis="1.5"', "25: sphere: attribute radius is missing; did you mean 'raduis'?"),
    ('<position x="4"', '<postion x="4"', "25: sphere: <position> is missing; did you mean <postion> on line 26?"),
    (
        '<position x="4" y="5" z="6"/>',
        '<position x="4" y="5" z="6"/>\n<position x="4" y="5" z="6"/>',
        "27: sphere: <position> must occur only once",
    ),
    (MATERIAL_TEXT, "", "25: sphere: <material_solid> or <material_textured> is missing"),
    (MATERIAL_TEXT, MATERIAL_TEXT + "<material_textured/>", "34: sphere: <material_textured> must occur only once"),
    ('exponent="200"', 'exponent="-1"', "29: material_solid phong: exponent must be >= 0, got -1"),
    ('<reflectance r="0.0"', '<reflectance r="abc"', "30: material_solid reflectance: r must be a number, got 'abc'"),
    ('t="0.0"', 't="0.5"', "27: sphere material_solid: refraction iof must be > 0 where t > 0, got 0"),
    (
        't="0.0"/>\n        <refraction iof="0"',
        't="5e-1"/>\n        <refraction iof="-15e-1"',
        "27: sphere material_solid: refraction iof must be > 0 where t > 0, got -1.5",
    ),
    (
        't="0.0"/>\n        <refraction iof="0"',
        't="0.5"/>\n        <refraction',
        "32: material_solid refraction: attribute iof is missing",
    ),
    (
        MATERIAL_TEXT,
        changed("material_solid", "material_textured", MATERIAL_TEXT)
        .replace("/material_solid", "/material_textured")
        .replace('<color r="0.5" g="0.25" b="1"/>', '<texture name="sky.png"/>'),
        "28: material_textured texture: name 'sky.png' cannot be read: No such file or directory",
    ),
    (
        "<surfaces>\n",
        f'<surfaces>\n<mesh name="a/b.obj">{MATERIAL_TEXT}</mesh>\n',
        "25: mesh: name 'a/b.obj' cannot be read: No such file or directory",
    ),
    (
        "<surfaces>\n",
        f'<surfaces>\n<mesh name="../b.obj">{MATERIAL_TEXT}</mesh>\n',
        "25: mesh: name must stay within the scene's folder, got '../b.obj'",
    ),
    (MATERIAL_TEXT, MATERIAL_TEXT + "<transform/><transform/>", "34: sphere: <transform> must occur only once"),
    (
        MATERIAL_TEXT,
        MATERIAL_TEXT + '<transform><scale x="1" y="0" z="1"/></transform>',
        "34: transform scale: must not be singular, got a factor of 0",
    ),
    (
        MATERIAL_TEXT,
        MATERIAL_TEXT + '<transform><scale x="1e38" y="1e38" z="1e38"/></transform>',
        "25: sphere: after the transform x must not exceed 3.4e38 in magnitude, got 4e+38",
        "25: sphere: after the transform y must not exceed 3.4e38 in magnitude, got 5e+38",
        "25: sphere: after the transform z must not exceed 3.4e38 in magnitude, got 6e+38",
    ),
    (
        MATERIAL_TEXT,
        MATERIAL_TEXT + f'<transform>{20 * """<scale x="1e-40" y="1e-40" z="1e-40"/>"""}</transform>',
        "25: sphere: after the transform radius must be > 0, got 0",
    ),
    (
        MATERIAL_TEXT,
        MATERIAL_TEXT + '<transform><scale x="1" y="1" z="3e38"/></transform>',
        "25: sphere: after the transform half of the extent along z must not exceed 3.4e38 in magnitude, got 4.5e+38",
        "25: sphere: after the transform z must not exceed 3.4e38 in magnitude, got 1.8e+39",
    ),
    (
        MATERIAL_TEXT,
        MATERIAL_TEXT + '<transform><scale x="1" y="1e-35" z="1"/><scale x="1" y="1e-11" z="1"/></transform>',
        "25: sphere transform: its inverse must not exceed 3.4e38 in magnitude, got 1e+46",
        "25: sphere: after the transform y must be 0 or at least 1.4e-45 in magnitude, got 5e-46",
    ),
    (
        MATERIAL_TEXT,
        MATERIAL_TEXT + f'<transform>{20 * """<scale x="1e-38" y="1" z="1"/>"""}</transform>',
        "25: sphere transform: its inverse must be a finite number, got inf",
    ),
    (
        MATERIAL_TEXT,
        MATERIAL_TEXT
        + '<transform><rotateZ theta="45"/><scale x="1" y="1e-20" z="1"/><rotateZ theta="45"/></transform>',
        "25: sphere transform: must not distort so much that rounding spoils its inverse",
    ),
]


@pytest.mark.parametrize("fault", FAULTS)
def test_fault(fault: tuple[str, ...]) -> None:
    old, new, *expected = fault
    assert faults_of(changed(old, new)) == expected


def test_every_attribute_and_element_is_needed() -> None:
    """Each in turn is left out, or is no number: one fault, in its line, which names it and its element."""
    for found in re.finditer(r'<(\w+)((?: \w+="[^"]*")+)/?>', BODY):
        for name in re.findall(r'(\w+)="', found[2]):
            at, end = found.span()
            line = BODY.count("\n", 0, at) + 1
            for new, words in (("", f"attribute {name} is missing"), (f' {name}=""', f"{name} must")):
                element = re.sub(f' {name}="[^"]*"', new, found[0])
                (fault,) = faults_of(BODY[:at] + element + BODY[end:])
                assert fault.startswith(f"{line}: ")
                assert f"{found[1]}: {words}" in fault
        if found[0].endswith("/>"):
            faults = faults_of(BODY[:at] + BODY[end:])
            assert any(f"<{found[1]}> is missing" in fault for fault in faults)


def test_each_ellipsoid_has_its_own_line() -> None:
    transforms = [
        "",
        '<transform><scale x="1" y="2" z="1"/></transform>',
        '<transform><scale x="1e-38" y="1" z="1"/><scale x="1e-38" y="1" z="1"/></transform>',
        '<transform><scale x="2" y="2" z="2"/></transform>',
        '<transform><scale x="1" y="1" z="1e-3"/></transform>',
        '<transform><scale x="1" y="3e38" z="1"/></transform>',
        "",
    ]
    spheres = [changed("    </sphere>", transform + "</sphere>", SPHERE_TEXT) for transform in transforms]
    text = changed('y="5"', 'y="0"', "".join(spheres)).replace('y="5"', 'y="0"').replace('x="4"', 'x="0"')
    lines = [25 + i * SPHERE_TEXT.count("\n") for i in range(7)]
    assert faults_of(changed(SPHERE_TEXT, text)) == [
        f"{lines[2]}: sphere transform: its inverse must not exceed 3.4e38 in magnitude, got 1e+76",
        f"{lines[5]}: sphere: after the transform half of the extent along y must not exceed 3.4e38 in magnitude, "
        "got 4.5e+38",
    ]


OUTPUT_FILES = {
    "": "must not be empty",
    "a/b.png": "must be a file name without a folder, got 'a/b.png'",
    "/b.png": "must be a file name without a folder, got '/b.png'",
    "..": "must be a file name without a folder, got '..'",
    "../b.png": "must be a file name without a folder, got '../b.png'",
    ".": "must be a file name without a folder, got '.'",
    "..\\b.png": "must not contain a backslash or a colon, got '..\\\\b.png'",
    "C:b.png": "must not contain a backslash or a colon, got 'C:b.png'",
    "b&#10;c.png": "must not contain control characters, got 'b\\nc.png'",
    "b&#x9b;.png": "must not contain control characters, got 'b\\x9b.png'",
    "b&#x202e;.png": "must not contain control characters, got 'b\\u202e.png'",
    "b" * 251: f"must be at most 250 bytes long, got '{'b' * 37}...'",
}


@pytest.mark.parametrize(("name", "fault"), OUTPUT_FILES.items())
def test_output_file(name: str, fault: str) -> None:
    assert faults_of(SCENE.replace("example.png", name)) == [f"3: scene: output_file {fault}"]


def test_all_faults_come_at_once_in_line_order() -> None:
    text = SCENE
    for old, new in (
        ('<reflectance r="0.0"', '<reflectance r="abc"'),
        ('exponent="200"', 'exponent="-1"'),
        ('<position x="4"', '<postion x="4"'),
        ('alpha1="20"', 'alpha1="30"'),
        ('<up x="0" y="1"', '<up x="0" y="0"'),
        AT_LOOKAT[:2],
    ):
        text = changed(old, new, text)
    text = changed(' output_file="example.png"', "", text)
    assert faults_of(changed('radius="1.5"', 'radius="x"', text)) == [
        "3: scene: attribute output_file is missing",
        "7: camera lookat: must differ from position",
        "8: camera up: must not be 0",
        "21: spot_light falloff: alpha1 must be <= alpha2 (25.5), got 30",
        "25: sphere: <position> is missing; did you mean <postion> on line 26?",
        "25: sphere: radius must be a number, got 'x'",
        "29: material_solid phong: exponent must be >= 0, got -1",
        "30: material_solid reflectance: r must be a number, got 'abc'",
    ]


def test_an_empty_scene_lacks_everything() -> None:
    assert faults_of("<scene/>") == [
        "1: scene: <background_color> is missing",
        "1: scene: <camera> is missing",
        "1: scene: <lights> is missing",
        "1: scene: <surfaces> is missing",
        "1: scene: attribute output_file is missing",
    ]


def test_a_hundred_faults_are_enough() -> None:
    spheres = "".join(f'<sphere radius="-{i}"/>\n' for i in range(150))
    faults = faults_of(changed("<surfaces>\n", "<surfaces>\n" + spheres))
    assert faults[:3] == [
        "25: sphere: <material_solid> or <material_textured> is missing (150 times, also in lines 26, 27, 28, …)",
        "25: sphere: <position> is missing (150 times, also in lines 26, 27, 28, …)",
        "25: sphere: radius must be > 0, got -0",
    ]
    assert faults[99:] == ["122: sphere: radius must be > 0, got -97", "122: … and 52 more"]


@pytest.mark.parametrize(
    ("breaks", "ending"),
    [
        ((), ""),
        ((0,), " (2 times)"),
        ((1,), " (2 times, also in line 26)"),
        ((0, 1), " (3 times, also in line 26)"),
        ((1, 0, 2), " (4 times, also in lines 26, 28)"),
        ((1, 1, 1), " (4 times, also in lines 26, 27, 28)"),
        ((1, 1, 1, 1), " (5 times, also in lines 26, 27, 28, …)"),
        ((0, 0, 0, 0, 0, 3), " (7 times, also in line 28)"),
    ],
)
def test_equal_messages_are_one(breaks: tuple[int, ...], ending: str) -> None:
    """breaks: the line breaks before each element but the first."""
    written = "<coil/>" + "".join("\n" * n + "<coil/>" for n in breaks)
    warnings = warnings_of(changed("<surfaces>\n", f"<surfaces>\n{written}\n"))
    assert warnings == [f"25: surfaces: unknown element <coil> ignored{ending}"]


def test_one_of_equal_faults_has_a_hint() -> None:
    spheres = '<sphere radius="1"/>\n<sphere radius="1"><postion x="0" y="0" z="0"/></sphere>\n'
    faults = faults_of(changed("<surfaces>\n", "<surfaces>\n" + spheres))
    assert (
        faults[1] == "25: sphere: <position> is missing; did you mean <postion> on line 26? (2 times, also in line 26)"
    )


# --- Warnings


def test_what_is_unknown_is_ignored_with_a_warning() -> None:
    text = changed("<camera>", '<camera>\n<dof on="1"><position/></dof>')
    text = changed('<sphere radius="1.5">', '<sphere radius="1.5" foo="7" y="1">', text)
    text = changed("<lights>", "<lights>\n<lamp/>", text)
    text = changed("</scene>", "<supersampling/></scene>", text)
    text = changed("</surfaces>", '<coil/><sfere/>\n<e:x xmlns:e="http://e"/></surfaces>', text)
    assert warnings_of(text) == [
        "6: camera: unknown element <dof> ignored",
        "15: lights: unknown element <lamp> ignored",
        "27: sphere: unknown attribute 'foo' ignored",
        "27: sphere: unknown attribute 'y' ignored",
        "37: surfaces: unknown element <coil> ignored",
        "37: surfaces: unknown element <sfere> ignored; did you mean <sphere>?",
        "38: surfaces: unknown element <{http://e}x> ignored",
        "39: scene: unknown element <supersampling> ignored",
    ]
    assert same(read("scene.xml")[0], scene_of(SCENE))


def test_a_misspelt_transform_is_pointed_out() -> None:
    text = with_transform('<rotatex theta="1"/>').replace("transform>", "transfrom>")
    assert warnings_of(text) == ["34: sphere: unknown element <transfrom> ignored; did you mean <transform>?"]
    assert warnings_of(with_transform('<rotatex theta="1"/>')) == [
        "34: sphere transform: unknown element <rotatex> ignored; did you mean <rotateX>?"
    ]


@pytest.mark.parametrize(
    ("step", "meant"),
    [
        ('<rotate axis="y" theta="30"/>', "; did you mean <rotateY>?"),
        ('<rotate x="0" y="0.0" z="1" angle="30"/>', "; did you mean <rotateZ>?"),
        ('<Rotation axis="X"/>', "; did you mean <rotateX>?"),
        ('<rotate x="1" y="1" z="0"/>', ""),
        ('<rotate angle="30"/>', ""),
    ],
)
def test_rotations_name_the_axis_that_was_meant(step: str, meant: str) -> None:
    (told,) = warnings_of(with_transform(step))
    assert told == f"34: sphere transform: unknown element <{step[1:].split()[0]}> ignored{meant}"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            '<color r="0.5" g="0.25" b="1"/>', '<texture name="a.png"/>',
            "27: sphere material_solid: <color> is missing; did you mean <material_textured>, which has a texture in "
            "place of the color?",
        ),
        (
            "material_solid", "material_textured",
            "27: sphere material_textured: <texture> is missing; did you mean <material_solid>, which has a color in "
            "place of the texture?",
        ),
        (
            "material_solid", "material_spheremap",
            "25: sphere: <material_solid> or <material_textured> is missing; did you mean <material_textured> for "
            "<material_spheremap>?",
        ),
        (
            'alpha1="20" alpha2="25.5"', 'angle="120"',
            "21: spot_light falloff: attribute alpha1 is missing; alpha1 and alpha2 are measured from the axis: is "
            "half of the angle meant?",
        ),
        (
            'alpha2="25.5"', 'alpha2="240"',
            "21: spot_light falloff: alpha2 must be within [0, 180], got 240: it is half of the opening, is 120 meant?",
        ),
        (
            'angle="45"', 'angle="120"',
            "9: camera horizontal_fov: angle must be within (0, 90), got 120: it is half of the opening, is 60 meant?",
        ),
    ],
    ids=["texture", "colour", "spheremap", "angle", "alpha", "field of view"],
)  # fmt: skip
def test_what_is_meant_is_said(old: str, new: str, told: str) -> None:
    assert faults_of(SCENE.replace(old, new))[0] == told


def test_a_file_beside_the_missing_one_is_named() -> None:
    Path("textures").mkdir()
    Path("textures/wall.png").write_bytes(b"")
    text = SCENE.replace("material_solid", "material_textured")
    text = text.replace('<color r="0.5" g="0.25" b="1"/>', '<texture name="textures/walls.png"/>')
    missing = "material_textured texture: name 'textures/walls.png' cannot be read: No such file or directory"
    assert faults_of(text) == [f"28: {missing}; did you mean 'textures/wall.png'?"]


def test_a_name_that_is_too_long_for_a_file_is_a_fault() -> None:
    """Nothing is looked for beside it. Found by made-up command lines."""
    name = 400 * "x"
    with pytest.raises(SceneError) as caught:
        read(name)
    assert str(caught.value) == f"{name}: cannot be read: File name too long"


def test_more_light_than_there_is_is_pointed_out() -> None:
    """Of spheres that are read in bulk and one by one, and of meshes."""
    shares = SCENE.replace('reflectance r="0.0"', 'reflectance r="0.6"').replace(
        'refraction iof="0"', 'refraction iof="1"'
    )
    told = "27: material_solid: r + t = 1.1 is above 1: more light goes on than reaches it"
    assert warnings_of(shares.replace('t="0.0"', 't="0.4"')) == []
    for text in (shares, shares.replace('<position x="4" y="5" z="6"/>', '<position z="6" y="5" x="4"/>')):
        assert warnings_of(text.replace('t="0.0"', 't="0.5"')) == [told]
    Path("a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    mesh = re.sub(r"<sphere .*\n.*<position.*/>", '<mesh name="a.obj">\n', shares).replace("</sphere>", "</mesh>")
    assert warnings_of(mesh.replace('t="0.0"', 't="0.5"')) == [told]


@pytest.mark.parametrize(("name", "written"), [("a.jpg", "a.jpg.png"), (".png", ".png.png")])
def test_pictures_are_png(name: str, written: str) -> None:
    scene, warnings = read_text(SCENE.replace("example.png", name))
    assert scene.output_file == written
    assert scene_of(SCENE.replace("example.png", "A.PNG")).output_file == "A.PNG"
    assert warnings == [f"scene.xml:3: scene: output_file '{name}' does not end in .png, which is appended"]


def test_a_part_of_a_name_is_pointed_out() -> None:
    assert faults_of(SCENE.replace("horizontal_fov", "fov")) == [
        "5: camera: <horizontal_fov> is missing; did you mean <fov> on line 9?"
    ]
    assert faults_of(SCENE.replace("max_bounces", "bounces")) == [
        "5: camera: <max_bounces> is missing; did you mean <bounces> on line 11?"
    ]
    assert warnings_of(changed("<lights>", "<lights><spot/>")) == [
        "13: lights: unknown element <spot> ignored; did you mean <spot_light>?"
    ]
    # Of several that have it, none is more likely than the others.
    assert closest("axis", ("one_long_axis", "other_long_axis")) is None


BYTES = "looks like bytes of 0..255, but 1 is full: divide by 255"


@pytest.mark.parametrize(
    ("old", "new", "warned"),
    [
        ('r="0.1" g="0.2" b="0.3"', 'r="255" g="128" b="0"', [f"4: background_color: 255, 128, 0 {BYTES}"]),
        ('r="0" g="0" b="0"', 'r="51" g="51" b="51.0"', [f"14: ambient_light color: 51, 51, 51 {BYTES}"]),
        ('r="1" g="0.5" b="2"', 'r="255" g="127.5" b="0"', [f"15: parallel_light color: 255, 127.5, 0 {BYTES}"]),
        ('r="1" g="1" b="0"', 'r="0" g="0" b="16"', [f"18: spot_light color: 0, 0, 16 {BYTES}"]),
        ('r="0.5" g="0.25" b="1"', 'r="200" g="30" b="30"', [f"28: material_solid color: 200, 30, 30 {BYTES}"]),
        ('r="0.5" g="0.25" b="1"', 'r=" 200" g="30" b="30"', [f"28: material_solid color: 200, 30, 30 {BYTES}"]),
        # Bright lights, and what cannot be bytes.
        ('r="1" g="0.5" b="2"', 'r="15" g="10" b="2"', []),
        ('r="1" g="0.5" b="2"', 'r="16.5" g="0" b="0"', []),
        ('r="1" g="0.5" b="2"', 'r="1000" g="255" b="0"', []),
        ('r="0.5" g="0.25" b="1"', 'r="1.5" g="2" b="1"', []),
    ],
)
def test_colours_that_look_like_bytes(old: str, new: str, warned: list[str]) -> None:
    assert warnings_of(changed(old, new)) == warned
    scene = read("scene.xml")[0]
    colors = [list(scene.background), *scene.lights["color"].tolist(), *scene.materials["color"].tolist()]
    assert [float(part.split('"')[1]) for part in new.split("=")[1:]] in colors


@pytest.mark.parametrize("written", ["a\nb", "a&#10;b", "a&#13;&#10;b", "a&#x85;b", "a&#x2028;b", "a&#x9b;b"])
def test_every_message_is_one_line(written: str) -> None:
    """Whatever the file, its name and its namespaces hold."""
    text = changed("<lights>", f'<lights xmlns:e="http://{written}"><e:point_light/>')
    text = changed("<surfaces>", f'<surfaces xmlns="http://{written}">', text)
    text = changed("<up ", f'<up xmlns:e="http://{written}" e:xx="1" ', text)
    Path("a\nb.xml").write_text(text)
    with pytest.raises(SceneError) as caught:
        read("a\nb.xml")
    lines = str(caught.value).split("\n")
    assert all(line.startswith("a\\nb.xml:") and line.isprintable() for line in lines)
    assert len(lines) == len(caught.value.faults)


def test_a_namespace_with_a_line_break_is_named_on_one_line() -> None:
    assert faults_of('<scene xmlns="urn:a&#10;b"/>') == ["1: the root element must be <scene>, got <{urn:a\\nb}scene>"]
    hint = "5: camera: <horizontal_fov> is missing; did you mean <{\\n}horizontal_fov> on line 9?"
    assert hint in faults_of(changed("<horizontal_fov", '<horizontal_fov xmlns="&#10;"'))
    hint = "29: material_solid phong: attribute exponent is missing; did you mean '{\\n}exponent'?"
    assert hint in faults_of(changed("<phong", '<phong xmlns:e="&#10;"').replace("exponent", "e:exponent"))


# --- Transforms

FOLDED = {
    "nothing": ([], (1, 2, 3), 1.5),
    "translate": (['<translate x="10" y="20" z="30"/>'], (11, 22, 33), 1.5),
    "scale": (['<scale x="2" y="2" z="2"/>'], (2, 4, 6), 3),
    "mirror": (['<scale x="-2" y="2" z="2"/>'], (-2, 4, 6), 3),
    "z by 90": (['<rotateZ theta="90"/>'], (-2, 1, 3), 1.5),
    "z by many turns": (['<rotateZ theta="36000090"/>'], (-2, 1, 3), 1.5),
    "the last acts first": (['<translate x="1" y="0" z="0"/>', '<rotateZ theta="90"/>'], (-1, 1, 3), 1.5),
    "and the other way": (['<rotateZ theta="90"/>', '<translate x="1" y="0" z="0"/>'], (-2, 2, 3), 1.5),
    "repeats": (
        ['<translate x="1" y="0" z="0"/>', '<scale x="2" y="2" z="2"/>', '<translate x="1" y="0" z="0"/>'] * 2,
        # ((1 + 1) 2 + 1 + 1) 2 + 1
        (13, 8, 12),
        6,
    ),
}


@pytest.mark.parametrize("name", FOLDED)
def test_transforms_fold(name: str) -> None:
    steps, center, radius = FOLDED[name]
    sphere = scene_of(with_transform(*steps, position='x="1" y="2" z="3"')).spheres[0]
    assert (sphere["center"].tolist(), sphere["radius"]) == (list(center), radius)


def scale(x: float, y: float, z: float) -> str:
    return f'<scale x="{x!r}" y="{y!r}" z="{z!r}"/>'


def turn(axis: str, degrees: float) -> str:
    return f'<rotate{axis} theta="{degrees!r}"/>'


ROUND = {
    "one that cancels": ([scale(2, 1, 1), scale(1, 2, 2)], 3),
    "alike to almost nothing and back": ([scale(1e30, 1e30, 1e30), scale(1e-30, 1e-30, 1e-30)], 1.5 * 1e-30 * 1e30),
    "turned back by quarters": ([scale(1, 3, 1), turn("Z", 90), scale(1, 3, 1), turn("Z", -90), scale(1, 1, 3)], 4.5),
    "mirrored and turned": ([scale(2, -2, 2), turn("Z", 12), scale(-1, 1, -1)], 3),
    "an ulp off": ([scale(1, 1, 1.0000000000000002)], 1.5),
}


@pytest.mark.parametrize("name", ROUND)
def test_what_stays_a_sphere(name: str) -> None:
    steps, radius = ROUND[name]
    scene = scene_of(with_transform(*steps))
    assert len(scene.to_object) == 0
    assert scene.spheres["to_object"].tolist() == [-1]
    assert scene.spheres["radius"].tolist() == [pytest.approx(radius, rel=2.0**-52)]


ELLIPSOIDS = {
    "a scale of three": ([scale(1, 2, -4)], [[1, 0, 0], [0, 0.5, 0], [0, 0, -0.25]]),
    "4 ulps off": ([scale(1, 1, 1 + 2.0**-48)], [[1, 0, 0], [0, 1, 0], [0, 0, 1 / (1 + 2.0**-48)]]),
    "turned before": ([scale(1, 2, 4), turn("Z", 90)], [[0, 0.5, 0], [-1, 0, 0], [0, 0, 0.25]]),
    "turned after": ([turn("Z", 90), scale(1, 2, 4)], [[0, 1, 0], [-0.5, 0, 0], [0, 0, 0.25]]),
    "long and thin": ([scale(1e30, 1e-30, 1)], [[1 / 1e30, 0, 0], [0, 1 / 1e-30, 0], [0, 0, 1]]),
}


@pytest.mark.parametrize("name", ELLIPSOIDS)
def test_what_becomes_an_ellipsoid(name: str) -> None:
    steps, to_object = ELLIPSOIDS[name]
    scene, warnings = read_text(with_transform(*steps, position='x="0" y="0" z="0"'))
    assert len(warnings) == 2 * (name == "long and thin")  # its scales, and how far away it is
    assert scene.to_object.tolist() == [to_object]
    assert scene.spheres[["radius", "to_object"]].tolist() == [(1.5, 0)]


def test_equal_ellipsoids_have_one_map() -> None:
    spheres = [
        changed("    </sphere>", f"<transform>{''.join(steps)}</transform></sphere>", SPHERE_TEXT)
        for steps in (
            [scale(1, 2, 1)],
            [scale(2, 2, 2)],
            [scale(4, 1, 1)],
            ['<translate x="3" y="0" z="0"/>', scale(1, 2, 1)],
            [scale(1, 2, 1), turn("Y", 180), turn("Y", -180)],
        )
    ]
    scene = scene_of(changed(SPHERE_TEXT, SPHERE_TEXT + "".join(spheres)))
    assert scene.spheres["to_object"].tolist() == [-1, 0, -1, 1, 0, 0]
    assert scene.to_object.tolist() == [np.diag([1, 0.5, 1]).tolist(), np.diag([0.25, 1, 1]).tolist()]
    assert not scene.to_object.flags.writeable


def random_steps(rng: np.random.Generator, count: int) -> list[tuple[str, list[float]]]:
    """Scales and rotations whose product distorts by a few thousand at most."""
    steps = []
    for _ in range(count):
        if rng.random() < 0.5:
            steps.append(("scale", (2.0 ** rng.uniform(-8 / count, 8 / count, 3) * rng.choice([-1, 1], 3)).tolist()))
        else:
            steps.append((str(rng.choice(list("XYZ"))), [float(rng.uniform(-400, 400))]))
    return [*steps, ("scale", [1.0, 2.0, 3.0])]


def exactly(steps: list[tuple[str, list[float]]]) -> Any:
    """The product of the steps in many digits."""
    product = mpmath.eye(3)
    for kind, numbers in steps:
        if kind == "scale":
            product *= mpmath.diag(numbers)
            continue
        i, j = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[kind]
        turned, angle = mpmath.eye(3), mpmath.radians(mpmath.mpf(numbers[0]))
        turned[i, i] = turned[j, j] = mpmath.cos(angle)
        turned[j, i] = mpmath.sin(angle)
        turned[i, j] = -turned[j, i]
        product *= turned
    return product


@pytest.mark.parametrize("count", [2, 5, 30])
def test_ellipsoids_are_where_the_steps_put_the_sphere(count: int) -> None:
    rng = np.random.default_rng(count)
    mpmath.mp.dps = 40
    for _ in range(10):
        steps = random_steps(rng, count)
        text = [scale(*numbers) if kind == "scale" else turn(kind, *numbers) for kind, numbers in steps]
        scene = scene_of(with_transform(*text, position='x="1" y="2" z="3"'))
        to_world, to_object = exactly(steps), mpmath.matrix(scene.to_object[0].tolist())
        center = to_world * mpmath.matrix([1, 2, 3])
        reach = mpmath.mnorm(to_world, "inf")
        for got, want in zip(scene.spheres["center"][0].tolist(), center, strict=True):
            assert abs(got - want) < 100 * 2.0**-52 * reach
        for n in rng.normal(size=(5, 3)):
            point = mpmath.matrix((n / np.linalg.norm(n)).tolist())
            assert abs(mpmath.norm(to_object * (to_world * point)) - mpmath.norm(point)) < 1e-11


def test_a_long_chain_of_steps() -> None:
    """As many as one element may have parts, and more."""
    chain = [scale(1, 2, 1), turn("X", 90), scale(1, 1, 0.5), turn("X", -90)]  # which is nothing at all
    scene = scene_of(with_transform(*chain * 4000, scale(1, 1, 2)))
    assert scene.to_object.tolist() == [np.diag([1, 1, 0.5]).tolist()]
    text = with_transform(*chain * 25_000, scale(1, 1, 2))
    assert faults_of(text) == [
        "25: sphere: must not have more than 100000 parts; --limit parts=N or CLTRACE_LIMITS allows more"
    ]


def test_cos_and_sin_in_degrees() -> None:
    for quarter in range(-6, 7):
        assert cos_sin(90.0 * quarter) == [(1, 0), (0, 1), (-1, 0), (0, -1)][quarter % 4]
    for degrees in np.random.default_rng(1).uniform(-720, 720, 1000).tolist():
        want = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        np.testing.assert_allclose(cos_sin(degrees), want, rtol=0, atol=3e-15)


# --- The bulk path and the careful path


def odd_spheres(count: int) -> str:
    """Spheres of all the forms that are valid, most of them as usual."""
    rng = np.random.default_rng(2)
    spheres = []
    for i in range(count):
        values = [repr(v) for v in rng.uniform(0, 9, 8).tolist()] + ["1.5e-45", "0", "-0.0", "3.4e38"]
        a, b, c, d, e, f, g, h, *extremes = values
        h = extremes[i % 4]
        text = SPHERE_TEXT.replace('"1.5"', f'"{a}"').replace('"4"', f'"{b}"').replace('"5"', f'"-{c}"')
        text = text.replace('"0.5"', f'"{d}"').replace('"0.9"', f'"{e}"').replace('"200"', f'"{f}"')
        text = text.replace('"0.25"', f'"{g}"').replace('"0.3"', f'"{h}"' if h[0] != "-" else '"0e7"')
        if i % 7 == 0:
            text = text.replace(f'x="{b}"', f'x=" {b}"')
        if i % 5 == 0:
            text = text.replace('r="0.0"', f'r="{i % 3}e-1"').replace('t="0.0"', f't="{i % 4 / 4}"')
            text = text.replace('iof="0"', f'iof="{1 + i % 2 / 2}"')
        if i % 11 == 0:
            z = ("2", "1", "-7e-1")[i % 3]
            text = text.replace("    </sphere>", f'<transform><scale x="2" y="-2" z="{z}"/></transform></sphere>')
        spheres.append(text)
    return changed(SPHERE_TEXT, "".join(spheres))


def test_both_paths_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    text = odd_spheres(300)
    taken = []
    bulk = surfaces.bulk
    monkeypatch.setattr(surfaces, "bulk", lambda spheres: taken.append(bulk(spheres)) or taken[-1])
    in_bulk = scene_of(text)
    assert 150 < sum(good.sum() for good, _ in taken) < 300
    monkeypatch.setattr(surfaces, "bulk", all_carefully)
    assert same(in_bulk, scene_of(text))


@pytest.mark.parametrize(
    "fault",
    [
        *(fault[:2] for fault in FAULTS if SCENE.index(fault[0]) > SCENE.index("<surfaces>")),
        *(('radius="1.5"', f'radius="{written}"') for written, _ in NUMBERS),
    ],
)
def test_both_paths_say_the_same(fault: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    old, new = fault
    text = changed(old, new)
    in_bulk = faults_of(text)
    monkeypatch.setattr(surfaces, "bulk", all_carefully)
    assert faults_of(text) == in_bulk


@pytest.mark.parametrize(
    "text",
    [
        # Elements and attributes with the usual names in unusual places.
        SPHERE_TEXT.replace(' radius="1.5"', "").replace('<position x="4"', '<position radius="1.5" x="4"'),
        SPHERE_TEXT.replace('z="6"/>', 'z="6">').replace("    </sphere>", "</position></sphere>"),
        SPHERE_TEXT.replace("<phong", "<phong/><phong"),
    ],
)
def test_the_bulk_path_is_not_deceived(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    in_bulk = faults_of(changed(SPHERE_TEXT, text))
    monkeypatch.setattr(surfaces, "bulk", all_carefully)
    assert faults_of(changed(SPHERE_TEXT, text)) == in_bulk


@pytest.mark.parametrize("size", [64, 1000])
def test_chunks_make_no_difference(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    text = odd_spheres(30)
    whole = scene_of(text)
    broken = changed("<lights>", "<lights><sun/>", text).replace('ks="1.0"', 'ks="x"')
    faults = faults_of(broken)
    monkeypatch.setattr(document, "CHUNK", size)
    monkeypatch.setattr(document, "check_prologue", lambda first: None)
    assert same(scene_of(text), whole)
    assert faults_of(broken) == faults


# --- Lines


def test_lines_beyond_16_bits() -> None:
    text = changed("<surfaces>\n", "<surfaces>\n" + "\n" * 70_000 + '<sphere\nradius="1"\n/>\n' + "<!--\n-->" * 9)
    text = changed('radius="1.5"', 'radius="-1" a=">"', text)
    assert faults_of(text) == [
        "70027: sphere: <material_solid> or <material_textured> is missing",
        "70027: sphere: <position> is missing",
        "70037: sphere: radius must be > 0, got -1",
    ]
    text = changed("<surfaces>\n", "<surfaces>\n" + "<!-- \n -->" * 70_000 + "<coil/>")
    assert warnings_of(text) == ["70025: surfaces: unknown element <coil> ignored"]


def test_a_scene_knows_the_lines_of_its_file(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = '<mesh name="m.obj">\n' + MATERIAL_TEXT + "</mesh>\n"
    Path("m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n\nf 1 2 3\n# none\nf 1 2 3 4\n")
    stray = SPHERE_TEXT.replace('radius="1.5"', 'radius="1.5" hollow="yes"')  # read one by one, not in bulk
    text = changed(SPHERE_TEXT, SPHERE_TEXT + mesh + "<coil/>\n" + stray + mesh)
    lines = text.split("\n")
    expected = [i for i, line in enumerate(lines, 1) if "<sphere" in line or "<mesh" in line]
    lights = [i for i, line in enumerate(lines, 1) if re.search("<(ambient|parallel|point|spot)_light>", line)]
    for last in (document.LAST_LINE, 0):
        monkeypatch.setattr(document, "LAST_LINE", last)
        source = read_text(text)[0].source
        assert source is not None
        assert source.path == "scene.xml"
        assert lines[source.camera - 1].strip() == "<camera>"
        assert source.surfaces.tolist() == expected
        assert source.lights.tolist() == lights
        assert {k: (file.name, file.lines.tolist()) for k, file in source.meshes.items()} == {
            1: ("m.obj", [6, 8, 8]),
            3: ("m.obj", [6, 8, 8]),
        }


def test_lines_beyond_16_bits_are_known_if_asked_for() -> None:
    text = changed("<surfaces>\n", "<surfaces>\n" + "\n" * 70_000)
    text = changed(SPHERE_TEXT, 2 * SPHERE_TEXT, text)
    expected = [i for i, line in enumerate(text.split("\n"), 1) if "<sphere" in line]
    scene = scene_of(text)
    assert scene.source is not None
    assert (scene.source.surfaces.tolist(), scene.source.knows_all_lines) == ([0, 0], False)
    asked, _ = read("scene.xml", lines=True)
    assert asked.source is not None
    assert (asked.source.surfaces.tolist(), asked.source.knows_all_lines) == (expected, True)
    assert same(scene, asked)


def test_where_a_scene_is_from_goes_with_it() -> None:
    scene = scene_of(SCENE)
    assert scene.source is not None
    assert scene.seen_by(Camera((0, 0, 9))).source is scene.source
    sent = pickle.loads(pickle.dumps(scene)).source
    assert sent is not None
    assert sent.surfaces.tolist() == scene.source.surfaces.tolist()
    assert replace(scene).source is None


def test_lines_beyond_16_bits_without_line_breaks_between_elements() -> None:
    sphere = "".join(SPHERE_TEXT.split("\n")).replace(" ", "\n").strip("\n")
    text = changed(SPHERE_TEXT, sphere * 1500 + '<sphere radius="0"/>')
    line = text[: text.rindex('radius="0"')].count("\n") + 1
    assert line > 65_535
    assert faults_of(text)[-1] == f"{line}: sphere: radius must be > 0, got 0"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32-le", "utf-32-be", "utf-16-be"])
def test_lines_beyond_16_bits_of_wide_characters(encoding: str) -> None:
    """In which the bytes of a '>' and of a line break occur in other characters, too."""
    text = changed("<surfaces>\n", "<surfaces>\n" + "<!--\u0a3e\u3e0a-->\n" * 70_000 + '<sphere\nradius="0"\n/>')
    text = text[text.index("<scene") :]
    line = text[: text.index('"0"\n/>') + 3].count("\n") + 2
    assert faults_of(("\ufeff" + text if encoding == "utf-16-be" else text).encode(encoding)) == [
        f"{line}: sphere: <material_solid> or <material_textured> is missing",
        f"{line}: sphere: <position> is missing",
        f"{line}: sphere: radius must be > 0, got 0",
    ]


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be", "utf-32-le"])
@pytest.mark.parametrize("wrong", [b"\xff\xff\xff\xff", b"\xd8\xd8\xd8\xd8", b"\xff"])
def test_wide_characters_that_are_none(encoding: str, wrong: bytes) -> None:
    """Also where it takes the second pass to find out."""
    text = SCENE[SCENE.index("<scene") :].replace("<surfaces>", "<surfaces>" + "\n" * 70_000 + "<coil/>")
    text = "\ufeff" + text if encoding == "utf-16-be" else text
    encoded = text.encode(encoding)
    for at in (len(encoded), len(encoded) - 400):
        assert "not well-formed XML" in faults_of(encoded[:at] + wrong + encoded[at:])[-1]


def message(fault: str) -> str:
    return fault.partition(":")[2].partition(" on line ")[0]


@pytest.mark.parametrize("fault", FAULTS)
def test_lines_counted_are_the_parsers(fault: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """The way in which lines beyond 16 bits are found, on the others."""
    old, new, *expected = fault
    text = changed(old, new).replace("/>", "\n/>").replace('="', ' \n = "').replace(' \n = "1.0"', '="1.0"')
    faults = faults_of(text)
    monkeypatch.setattr(document, "LAST_LINE", 0)
    assert faults_of(text) == faults
    assert [message(fault) for fault in faults] == [message(fault) for fault in expected]


# --- Files that are no scene


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", [" is empty"]),
        (b" \n", ["2: not well-formed XML: Start tag expected, '<' not found"]),
        (b"\x89PNG\r\n\x1a\n\0\0\0", ["1: not well-formed XML: Start tag expected, '<' not found"]),
        (bytes(range(256)) * 1000, ["1: not well-formed XML: Start tag expected, '<' not found"]),
        (b"hello", ["1: not well-formed XML: Start tag expected, '<' not found"]),
        (b"<!-- \n -->\n<scenes/>", ["3: the root element must be <scene>, got <scenes>"]),
        (b'<scene xmlns="http://x"/>', ["1: the root element must be <scene>, got <{http://x}scene>"]),
        (b"<html><br></html>", ["1: the root element must be <scene>, got <html>"]),
        (b" " * 70_000 + b"<scene/>", [" the root element must begin within the first 65536 bytes"]),
    ],
)
def test_not_a_scene(content: bytes, expected: list[str]) -> None:
    assert faults_of(content) == expected


def test_not_well_formed_in_addition_to_the_faults_before() -> None:
    text = changed('r="0.1"', 'r="-1"')
    text = changed('radius="1.5"', 'radius="x"', text)
    cut = text[: text.index("    <refraction") + 14]
    assert faults_of(cut.replace("<refrac", "</phong>")) == [
        "4: background_color: r must be >= 0, got -1",
        "25: sphere: radius must be a number, got 'x'",
        "32: not well-formed XML: Opening and ending tag mismatch: material_solid line 27 and phong",
    ]
    # What ends too early lacks nothing else.
    assert faults_of(SCENE[: SCENE.index("<lookat")]) == [
        "7: not well-formed XML: Premature end of data in tag camera line 5"
    ]
    assert faults_of(SCENE + "<scene/>")[-1] == "37: not well-formed XML: Extra content at the end of the document"


def test_bytes_that_are_not_the_encoding() -> None:
    (fault,) = faults_of(SCENE.replace("example", "Bäume").encode("latin-1"))
    assert fault.startswith("3: not well-formed XML: ")  # libxml2's words vary


@pytest.mark.parametrize(
    "content", [b"<a/>", b"<b/>\n", b"<a>", b"<a", b"<", b"a", b"<a/><", b"<?a?>", b"<!-->", b"\0"]
)
def test_a_handful_of_bytes(content: bytes) -> None:
    faults = faults_of(content)
    assert len(faults) == 1
    if content[:2] in (b"<a", b"<b"):
        assert faults == [f"1: the root element must be <scene>, got <{content[1:2].decode()}>"]
    else:
        assert faults[0].startswith("1: not well-formed XML: ")


@pytest.mark.parametrize("tag", ["<q", "<camera", "<sphere radius='1'", "</scene", "<!--", "&", "<![CDATA["])
def test_cut_off_beyond_16_bits(tag: str) -> None:
    faults = faults_of('<scene output_file="s.png">' + "\n" * 70_000 + tag)
    assert len(faults) == 1
    assert faults[0].startswith("70001: not well-formed XML: ")


def test_a_name_that_no_file_can_have() -> None:
    with pytest.raises(SceneError) as caught:
        read("\ud800")
    assert str(caught.value) == "\\ud800: cannot be read: the name is not utf-8"


def test_files_that_cannot_be_read() -> None:
    with pytest.raises(SceneError, match=r"^none\.xml: cannot be read: No such file or directory$"):
        read("none.xml")
    for name in ("nine.png", "nine.xml"):
        Path(name).touch()
    with pytest.raises(SceneError, match=r"^nin\.xml: cannot be read: .*; did you mean 'nine\.xml'\?$"):
        read("nin.xml")
    with pytest.raises(SceneError, match=r"^\.: is a directory$"):
        read(".")
    with pytest.raises(SceneError, match="cannot be read: the name contains a NUL"):
        read("a\0b")
    os.mkfifo("pipe.xml")
    with pytest.raises(SceneError, match=r"^pipe\.xml: is not a regular file$"):
        read("pipe.xml")


def test_an_unreadable_file(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    Path("scene.xml").touch()
    with pytest.raises(SceneError, match=r"^scene\.xml: cannot be read: Permission denied$"):
        read("scene.xml")


# --- Hostile files

ENTITIES = "".join(f'<!ENTITY e{i + 1} "{f"&e{i};" * 20}">\n' for i in range(12))
BOMB = f'<!DOCTYPE scene [\n<!ENTITY e0 "{"x" * 50}">\n{ENTITIES}]>\n'


@pytest.mark.parametrize(
    "text",
    [
        BOMB + changed("<camera>", "<camera>&e12;", BODY),
        BOMB + changed('radius="1.5"', 'radius="&e12;"', BODY),
        BOMB + changed("example.png", "&e12;", BODY),
        '<!DOCTYPE scene [\n<!ENTITY x SYSTEM "file:///etc/passwd">]>\n' + changed("<camera>", "<camera>&x;", BODY),
        '<!DOCTYPE scene [\n<!ENTITY % x SYSTEM "http://127.0.0.1:9/x"> %x;]>\n' + BODY,
        '<!DOCTYPE scene [\n<!ENTITY unused "1">]>\n' + BODY,
    ],
)
def test_entities_are_refused(text: str) -> None:
    assert faults_of(text) == ["2: the document type must not declare entities"]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-be", "utf-16-le", "utf-32-le", "utf-32-be"])
def test_the_line_of_a_refused_entity(encoding: str) -> None:
    declared = '<!DOCTYPE scene [\n<!-- <!ENTITY -->\n<!--\n\u0a0a\u0a0d-->\n<!ENTITY x "1">]>\n' + BODY
    mark = "\ufeff" if encoding in ("utf-16-be", "utf-16-le") else ""
    assert faults_of((mark + declared).encode(encoding)) == ["5: the document type must not declare entities"]


@pytest.mark.parametrize(
    "mention", ["<!-- <!ENTITY -->", "<?a <!ENTITY ?>", '<!DOCTYPE scene SYSTEM "<!ENTITY">', '<!-- " <!ENTITY -->']
)
def test_to_mention_an_entity_is_not_to_declare_it(mention: str) -> None:
    assert same(scene_of(mention + "\n" + BODY), scene_of(SCENE))
    # Where no root follows, that is what is said.
    far = mention + " " * 70_000 + "<scene/>"
    assert faults_of(far) == [" the root element must begin within the first 65536 bytes"]


@pytest.mark.parametrize("document_type", ["", '<!DOCTYPE scene SYSTEM "scene.dtd">'])
@pytest.mark.parametrize(("old", "new"), [('"1.5"', '"1&x;5"'), ("</sphere>", "&x;</sphere>")])
def test_an_undeclared_entity_is_not_left_out(document_type: str, old: str, new: str) -> None:
    text = document_type + "\n" + changed(old, new, BODY)
    line = text[: text.index("&x;")].count("\n") + 1
    assert f"{line}: not well-formed XML: Entity 'x' not defined" in faults_of(text)


def test_a_document_type_is_never_fetched() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.05)
        url = f"http://127.0.0.1:{server.getsockname()[1]}/scene.dtd"
        scene_of(SCENE.replace("scene.dtd", url))
        with pytest.raises(TimeoutError):
            server.accept()
    Path("scene.dtd").write_text('<!ENTITY x "1">')
    assert faults_of(changed("1.5", "&x;.5")) == ["25: not well-formed XML: Entity 'x' not defined"]


def test_depth_is_limited() -> None:
    assert faults_of(changed("<camera>", "<camera>" + "<a>" * 100_000))[0].startswith(
        "5: not well-formed XML: Excessive depth in document: 256"
    )


def test_long_digit_strings_take_no_time_to_refuse() -> None:
    digits = "1" * 1_000_000
    assert faults_of(changed('"1.5"', f'"{digits}x"')) == [f"25: sphere: radius must be a number, got '{'1' * 37}...'"]


Hoard = Callable[[int], str]
HOARDS: list[tuple[Hoard, str | None]] = [
    (
        lambda n: changed("<up", "<a/>" * n + "<up"),
        "5: camera: must not have more than 1000 parts; --limit parts=N or CLTRACE_LIMITS allows more",
    ),
    (lambda n: changed("<up", "<a b='1' c='1'/>" * (n // 30) + "<up"), None),
    (
        lambda n: changed("<up", "<a b='1' c='1'/>" * (n // 3) + "<up"),
        "5: camera: must not have more than 1000 parts; --limit parts=N or CLTRACE_LIMITS allows more",
    ),
    (
        lambda n: changed("<phong", "<a/>" * n + "<phong"),
        "25: sphere: must not have more than 1000 parts; --limit parts=N or CLTRACE_LIMITS allows more",
    ),
    (lambda n: changed("<sphere", "<b>" + "<a/>" * n + "</b><sphere"), None),
    (lambda n: changed("<sphere", "<a/>" * n + "<sphere"), None),
    (lambda n: changed("<camera", "<a/>" * n + "<camera"), None),
]


@pytest.mark.parametrize(("text", "fault"), HOARDS)
def test_what_is_kept_is_limited(text: Hoard, fault: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "MAX_PARTS", 1000)
    monkeypatch.setattr(document, "CHUNK", 1000)
    if fault:
        assert fault in faults_of(text(10_000))
    else:
        assert same(read_text(text(10_000))[0], scene_of(SCENE))


@pytest.mark.parametrize(("old", "line"), [("<up ", 8), ("<sphere ", 25), ("<lights", 13), ("<phong ", 29)])
def test_hints_are_made_for_few_of_many_attributes(old: str, line: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """40,000 of them took 18 s."""
    compared: list[int] = []
    closest = checks.closest

    def counted(name: str, others: tuple[str, ...]) -> str | None:
        compared.append(len(others))
        return closest(name, others)

    monkeypatch.setattr(checks, "closest", counted)
    text = changed(old, old + " " + " ".join(f'a{i}="1"' for i in range(40_000)) + " ")
    warnings = warnings_of(text)
    assert warnings[-1] == f"{line}: … and 39900 more"
    text = text.replace('x="', 'q="').replace('radius="', 'q="').replace('kd="', 'q="')
    assert any("is missing" in fault for fault in faults_of(text))
    assert len(compared) <= 200
    assert sum(compared) <= 10_000


@pytest.mark.parametrize("name", ["up", "sphere", "lights", "coil", "phong"])
def test_namespaces_are_limited(name: str) -> None:
    text = changed("<lights>", "<lights><coil />")
    line = text[: text.index(f"<{name}")].count("\n") + 1

    def declaring(count: int, length: int) -> str:
        spaces = " ".join(f'xmlns:a{i}="{"u" * length}{i:03}" a{i}:b="1"' for i in range(count))
        return changed(f"<{name}", f"<{name} {spaces} ", text)

    assert same(read_text(declaring(100, 247))[0], scene_of(SCENE))
    assert f"{line}: must not declare more than 100 namespaces" in faults_of(declaring(101, 1))
    assert f"{line}: must not declare a namespace of more than 250 characters" in faults_of(declaring(1, 248))


COLOR = '<color r="1" g="0.5" b="2"/>'
SOFT_LIGHTS = f"""<sky_light>{COLOR}</sky_light>
<sky_light>{COLOR}<up x="0" y="2" z="0"/><below r="0" g="0" b="0.5"/><directions n="9"/></sky_light>
<sun_light angle="7">{COLOR}<direction x="1" y="-2" z="0"/><directions n="8"/></sun_light>
<ball_light radius="0.5">{COLOR}<position x="1" y="9" z="0"/></ball_light>
<panel_light>{COLOR}<position x="1" y="9" z="0"/><across x="2" y="0" z="0"/><along x="0" y="0" z="3"/></panel_light>
"""


def test_soft_lights_are_those_of_python() -> None:
    scene = scene_of(changed("<lights>", f"<lights>{SOFT_LIGHTS}"))
    color = (1, 0.5, 2.0)
    wanted = [
        cltrace.sky_light(color),
        cltrace.sky_light(color, (0, 2, 0), (0, 0, 0.5), 9),
        cltrace.sun_light((1, -2, 0), color, 7, 8),
        cltrace.ball_light((1, 9, 0), color, 0.5),
        cltrace.panel_light((1, 9, 0), color, (2, 0, 0), (0, 0, 3)),
    ]
    assert scene.lights[:5].tobytes() == np.concatenate(wanted).tobytes()
    assert len(scene.lights) == 9
    assert len(scene.lamps) == 64 + 9 + 8 + 16 + 16 + 4


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('<up x="0" y="2" z="0"/>', "", "14: sky_light: <below> goes with <up>, which is missing"),
        ('n="9"', 'n="0"', "14: sky_light directions: n must be within 1..1024, got 0"),
        (
            'n="9"',
            'n="1025"',
            "14: sky_light directions: n must be within 1..1024, got 1025" + MORE_LIGHTS,
        ),
        ('n="8"', 'n="8.5"', "15: sun_light directions: n must be an integer, got '8.5'"),
        ('angle="7"', 'angle="400"', "15: sun_light: angle must be within [0, 180], got 400"),
        ('radius="0.5"', "", "16: ball_light: attribute radius is missing"),
        ('radius="0.5"', 'radius="0"', "16: ball_light: radius must be > 0, got 0"),
        ('<along x="0" y="0" z="3"/>', "", "17: panel_light: <along> is missing"),
        ('z="3"', 'z="0"', "17: panel_light along: must not be 0"),
        ('x="0" y="0" z="3"', 'x="9" y="0" z="0"', "17: panel_light: across and along must not be along one line"),
        (
            'n="9"',
            'n="1000"',
            "14: lights: must be at most 1024 with all members of soft lights, got 1064" + MORE_LIGHTS,
        ),
    ],
)
def test_faults_of_soft_lights(old: str, new: str, fault: str) -> None:
    found = faults_of(changed("<lights>", f"<lights>{changed(old, new, SOFT_LIGHTS)}"))
    assert fault in found


ROD = f"""<cylinder radius="0.5">
<start x="1" y="2" z="3"/><end x="1" y="2" z="5"/>{MATERIAL_TEXT}</cylinder>
"""


def test_cylinders_count_among_the_surfaces() -> None:
    scene, bare = scene_of(changed("<surfaces>\n", f"<surfaces>\n{ROD}")), scene_of(SCENE)
    rod = scene.cylinders[0]
    assert (rod["start"].tolist(), rod["end"].tolist(), rod["radius"]) == ([1, 2, 3], [1, 2, 5], 0.5)
    assert rod["number"] == 0
    assert scene.sphere_numbers.tolist() == [number + 1 for number in bare.sphere_numbers]
    assert scene.source is not None
    assert scene.source.surfaces[0] == 25


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('radius="0.5"', "", "25: cylinder: attribute radius is missing"),
        ('radius="0.5"', 'radius="0"', "25: cylinder: radius must be > 0, got 0"),
        ('<start x="1" y="2" z="3"/>', "", "25: cylinder: <start> is missing"),
        ('z="5"', 'z="3"', "25: cylinder: end must not be the start"),
        ('z="5"', 'z="nan"', "26: cylinder end: z must be a finite number, got nan"),
        (MATERIAL_TEXT, "", "25: cylinder: <material_solid> or <material_textured> is missing"),
    ],
)
def test_faults_of_cylinders(old: str, new: str, fault: str) -> None:
    assert fault in faults_of(changed("<surfaces>\n", f"<surfaces>\n{changed(old, new, ROD)}"))


def test_a_prefix_may_be_declared_often() -> None:
    text = changed("<surfaces>", "<surfaces>" + "".join(f'<e:x xmlns:e="urn:{i}"/>' for i in range(1000)))
    assert same(read_text(text)[0], scene_of(SCENE))


def test_a_view_is_judged_with_any_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also with those that the defaults of cameras in Python pass, of which the file knows nothing."""
    monkeypatch.setattr(eye, "MAX_BOUNCES", 7)
    old, new, fault = AT_LOOKAT
    assert faults_of(changed(old, new)) == [fault]


def test_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "MAX_LIGHTS", 3)
    assert faults_of(SCENE) == ["17: lights: must be at most 3; --limit lights=N or CLTRACE_LIMITS allows more"]
    monkeypatch.setattr(reader, "MAX_LIGHTS", 4)
    monkeypatch.setattr(surfaces.SphereReader, "most", 2)
    assert faults_of(changed(SPHERE_TEXT, SPHERE_TEXT * 3)) == ["45: surfaces: must be at most 2 spheres"]
    monkeypatch.setattr(limits, "SCENE_BYTES", 1000)
    assert faults_of(SCENE) == [
        " must not be larger than 1000 bytes; --limit scene-bytes=N or CLTRACE_LIMITS allows more"
    ]
