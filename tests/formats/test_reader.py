"""The reader: what it makes of valid files, and every message by its exact text."""

from __future__ import annotations

import errno
import os
import pickle
import re
import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

import cltrace
from cltrace.base import limits
from cltrace.base.errors import SceneError
from cltrace.formats import elements, reader, surfaces
from cltrace.formats.faults import closest
from cltrace.formats.reader import read
from cltrace.scene import CYLINDER, MATERIAL, SPHERE, Camera, Scene
from cltrace.scene import camera as eye

pytestmark = pytest.mark.usefixtures("own_folder")

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
BALL = SCENE[SCENE.index("    <sphere") : SCENE.index("  </surfaces>")]
MATERIAL_TEXT = BALL[BALL.index("      <material") : BALL.index("    </sphere>")]
COLOR = '<color r="0.5" g="0.25" b="1"/>'
LINES = "\n" * 65_000
ODD = BALL.replace("</material_solid>", "</material_solid >")  # which is not written as usual
SOFT_LIGHTS = f"""<sky_light>{COLOR}</sky_light>
<sky_light>{COLOR}<up x="0" y="2" z="0"/><below r="0" g="0" b="0.5"/><directions n="9"/></sky_light>
<sun_light angle="7">{COLOR}<direction x="1" y="-2" z="0"/><directions n="8"/></sun_light>
<ball_light radius="0.5">{COLOR}<position x="1" y="9" z="0"/></ball_light>
<panel_light>{COLOR}<position x="1" y="9" z="0"/><across x="2" y="0" z="0"/><along x="0" y="0" z="3"/></panel_light>
"""
ROD = f"""<cylinder radius="0.5">
<start x="1" y="2" z="3"/><end x="1" y="2" z="5"/>{MATERIAL_TEXT}</cylinder>
"""


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


def changed(old: str, new: str, text: str = SCENE) -> str:
    assert old in text
    return text.replace(old, new, 1)


def transformed(*steps: str, position: str = 'x="4" y="5" z="6"') -> str:
    text = changed("    </sphere>", f"<transform>{''.join(steps)}</transform></sphere>")
    return changed('x="4" y="5" z="6"', position, text)


def same(a: Scene, b: Scene) -> bool:
    arrays = ("lights", "spheres", "materials", "to_object")
    return all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in arrays) and (
        (a.camera, a.background, a.output_file) == (b.camera, b.background, b.output_file)
    )


# --- Valid files


def test_everything_arrives() -> None:
    scene = scene_of(changed("</lights>", f"{SOFT_LIGHTS}</lights>").replace("</surfaces>", f"{ROD}</surfaces>"))
    view = Camera((1, 2, 3), (0.5, -2.0e-10, -2.5), (0, 1, 0), 45, (640, 480), 8, square_pixels=False)
    assert (scene.camera, scene.background, scene.output_file) == (view, (0.1, 0.2, 0.3), "example.png")
    color = (0.5, 0.25, 1)
    lights = [
        cltrace.ambient_light((0, 0, 0)),
        cltrace.parallel_light((0, -1, 0), (1, 0.5, 2.0)),
        cltrace.point_light((5, 8, 2)),
        cltrace.spot_light((1, 2, 3), (0, 0, -3), 20, 25.5, (1, 1, 0)),
        cltrace.sky_light(color),
        cltrace.sky_light(color, (0, 2, 0), (0, 0, 0.5), 9),
        cltrace.sun_light((1, -2, 0), color, 7, 8),
        cltrace.ball_light((1, 9, 0), color, 0.5),
        cltrace.panel_light((1, 9, 0), color, (2, 0, 0), (0, 0, 3)),
    ]
    assert scene.lights.tobytes() == np.concatenate(lights).tobytes()
    assert scene.spheres.tobytes() == np.array([((4, 5, 6), 1.5, 0, -1)], SPHERE).tobytes()
    assert scene.cylinders.tobytes() == np.array([((1, 2, 3), (1, 2, 5), 0.5, 0, 1, 0)], CYLINDER).tobytes()
    materials = [((0.5, 0.25, 1), 0.3, 0.9, 1, 200, 0, 0, 1, -1)]
    assert scene.materials.tobytes() == np.array(materials, MATERIAL).tobytes()
    assert same(read(Path("scene.xml"))[0], scene)


@pytest.mark.parametrize(
    "text",
    [
        SCENE.replace("\n", "\r\n"),
        SCENE.replace("  ", "\t"),
        SCENE.replace("/>", " />"),
        SCENE.replace('="', " = '").replace('"', "'").replace("''", "'").replace("= 'scene.dtd", "'scene.dtd"),
        BODY,
        SCENE.split("\n", 1)[1],
        "\ufeff" + SCENE,
        SCENE.replace('standalone="no"', 'encoding="UTF-8" standalone="yes"'),
        SCENE.replace("    <", "<!-- <sphere/> --><?php ?>\n    <"),
        SCENE.replace('<sphere radius="1.5">', '<sphere radius="1.5"><!-- > -->'),
        SCENE.replace('radius="1.5"', 'radius=" +1.50 "'),
        SCENE.replace('radius="1.5"', 'radius="&#49;.5"'),
        SCENE.replace('radius="1.5"', 'radius="15.E-1"'),
        SCENE.replace('r="0.0"', 'r="-0e-999"'),
        SCENE.replace('x="4" y="5" z="6"', 'z="6" x="4" y="5"'),
        SCENE.replace('iof="0"', 'iof="2.3"'),
        SCENE.replace('SYSTEM "scene.dtd"', "[<!ELEMENT scene ANY>]"),
        SCENE.replace("SYSTEM", "PUBLIC '-//x'"),
        *(
            f"{mention}\n{BODY}"
            for mention in ("<!-- <!ENTITY -->", "<?a <!ENTITY ?>", '<!DOCTYPE scene SYSTEM "<!E">')
        ),
        *(SCENE.encode(encoding) for encoding in ("utf-16", "utf-16-le", "utf-32-be")),
    ],
)
def test_other_ways_to_write_the_same(text: str | bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    assert same(scene_of(text), scene_of(SCENE))
    monkeypatch.setattr(elements, "CHUNK", 600)  # which has the document type
    assert same(scene_of(text), scene_of(SCENE))


def test_encodings() -> None:
    name = SCENE.replace("example", "Bäume")
    for encoding in ("UTF-8", "ISO-8859-1", "UTF-16", "windows-1252"):
        declared = name.replace(' standalone="no"', f' encoding="{encoding}"')
        assert scene_of(declared.encode(encoding)).output_file == "Bäume.png"


def test_spheres_written_as_usual_are_read_as_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that need no parser, among others and in comments, over all the lines that libxml2 knows and beyond."""
    number = iter(range(1, 10**6))
    balls = [re.sub('radius="[^"]*"', lambda _: f'radius="{next(number)}e-3"', BALL * 300) for _ in range(2)]
    usual = f"{balls[0]}<!--{BALL}{LINES}-->{BALL.replace('</phong', '<!-- --></phong')}<!--\n{BALL}-->{BALL}{balls[1]}"
    usual += BALL.replace("radius=", "radius=\n") + BALL.replace('radius="1.5"', 'radius="1.5"\n') + ROD + BALL
    others = usual.replace("</material_solid>", "</material_solid >")
    monkeypatch.setattr(elements, "CHUNK", 10**5)
    one, other = (scene_of(changed(BALL, text)) for text in (usual, others))
    assert same(one, other)
    assert len(one.spheres) == 605
    assert one.source
    assert other.source
    assert one.source.surfaces.tolist() == other.source.surfaces.tolist()
    assert one.source.surfaces[-1] > 65_536


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('radius="1.5"', 'radius="-1"'),
        ('radius="1.5"', 'radius="1e-999"'),
        ('ka="0', 'ka="-0'),
        ('<refraction iof="0"/>', '<refraction iof="1e39"/>'),
        ('<transmittance t="0.0"/>', '<transmittance t="0.5"/>'),
        (COLOR, '<color r="255" g="0" b="0"/>'),
        ('<reflectance r="', '<reflectance r="1'),
        ('radius="1.5"', 'radius="1e30"'),
    ],
)
def test_faults_and_doubts_of_spheres_written_as_usual(old: str, new: str) -> None:
    assert old in BALL
    texts = (changed(BALL, BALL * 3 + wrong + BALL) for wrong in (BALL.replace(old, new), changed(old, new, ODD)))
    told = []
    for text in texts:
        try:
            told.append(warnings_of(text))
        except SceneError as error:
            told.append([str(error)])
    assert told[0] == told[1]
    assert told[0]


def test_lights_and_surfaces_may_be_none() -> None:
    scene = scene_of(SCENE[: SCENE.index("  <lights>")] + "<lights/><surfaces></surfaces></scene>")
    assert (len(scene.lights), len(scene.spheres), len(scene.materials)) == (0, 0, 0)


def test_equal_materials_are_one_record_in_the_order_of_first_use() -> None:
    """Where nothing is let through, the index says nothing, and is 1. There may be more than all light."""

    def finished(r: str, t: str, iof: str, ks: str = "1.0") -> str:
        text = BALL.replace('r="0.0"', f'r="{r}"').replace('t="0.0"', f't="{t}"').replace('iof="0"', f'iof="{iof}"')
        return text.replace('ks="1.0"', f'ks="{ks}"')

    written = [
        *(("0.25", "0", "0"), ("5e-1", "2.5E-1", "+15e-1"), ("9", "1e3", "1e-30"), (".25", "0.0", "2.4")),
        *(("0.250", "-0e7", "-3"), ("0.5", "0.25", "1.5"), ("0.25", "0", "0", "-0.0"), ("0.25", "0", "1", "0")),
    ]
    scene, warnings = read_text(changed(BALL, "".join(finished(*values) for values in written)))
    told = "47: sphere material_solid: r + t = 1009 is above 1: more light goes on than reaches it"
    assert warnings == [f"scene.xml:{told}"]
    assert scene.spheres["material"].tolist() == [0, 1, 2, 0, 0, 1, 3, 3]
    names = ["reflectance", "transmittance", "index", "ks"]
    wanted = [(0.25, 0, 1, 1), (0.5, 0.25, 1.5, 1), (9, 1000, 1e-30, 1), (0.25, 0, 1, 0)]
    assert scene.materials[names].tolist() == wanted


def test_a_scene_knows_the_lines_of_its_file() -> None:
    """However many there are."""
    mesh = '<mesh name="m.obj">\n' + MATERIAL_TEXT + "</mesh>\n"
    Path("m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n\nf 1 2 3\n# none\nf 1 2 3 4\n")
    text = changed(BALL, BALL + mesh + "<coil/>\n" * 70_000 + BALL + mesh)
    lines = text.split("\n")
    scene = read_text(text)[0]
    source = scene.source
    assert source is not None
    assert (source.path, lines[source.camera - 1].strip()) == ("scene.xml", "<camera>")
    for found, tags in ((source.surfaces, "<(sphere|mesh)"), (source.lights, "<(ambient|parallel|point|spot)_light>")):
        assert found.tolist() == [i for i, line in enumerate(lines, 1) if re.search(tags, line)]
    files = {k: (file.name, file.lines.tolist()) for k, file in source.meshes.items()}
    assert files == dict.fromkeys((1, 3), ("m.obj", [6, 8, 8]))
    assert scene.seen_by(Camera((0, 0, 9))).source is source
    sent = pickle.loads(pickle.dumps(scene)).source
    assert sent is not None
    assert sent.surfaces.tolist() == source.surfaces.tolist()
    assert replace(scene).source is None


# --- Faults

NUMBERS = {
    **{text: f"must be > 0, got {text}" for text in ("-1", "0", "-0.0")},
    **{
        text: f"must be a number, got {text!r}"
        for text in ("abc", "", "1 2", "1,5", "1_000", "0x10", "1e", ".", "--1", "\u0663", "\uff11", "\u00a01")
    },
    **{text: f"must be a finite number, got {text}" for text in ("nan", "NaN", "inf", "-Infinity", "1e400")},
    **{text: f"must be at least 1.4e-45 in magnitude, got {text}" for text in ("1e-46", "-1e-400")},
    "1e39": "must not exceed 3.4e38 in magnitude, got 1e39",
    "1" * 1_000_000 + "x": f"must be a number, got '{'1' * 37}...'",
    "0." + "0" * 400 + "1": f"must be at least 1.4e-45 in magnitude, got 0.{'0' * 35}...",
}
FOLDER, SLASH, CONTROL = "a file name without a folder", "a backslash or a colon", "control characters"
OUTPUT_FILES = {
    "": "must not be empty",
    **{name: f"must be {FOLDER}, got {name!r}" for name in ("a/b.png", "/b.png", "..", "../b.png", ".")},
    **{name: f"must not contain {SLASH}, got {name!r}" for name in ("..\\b.png", "C:b.png")},
    **{f"b&#{n};.png": f"must not contain {CONTROL}, got {f'b{chr(n)}.png'!r}" for n in (10, 0x9B, 0x202E)},
    "b" * 251: f"must be at most 250 bytes long, got '{'b' * 37}...'",
}
HALF, SIDES = (
    "it is half of the opening, is",
    "10: camera resolution: must be within 1..65536 each and 1073741824 pixels",
)
END, STEPS = "    </sphere>", "<transform>{}</transform></sphere>"
TEXTURED = MATERIAL_TEXT.replace("material_solid", "material_textured").replace(COLOR, '<texture name="{}"/>')
FOV, FALLOFF = "9: camera horizontal_fov: angle must be within (0, 90), got", "21: spot_light falloff: alpha"
NO_MATERIAL = "25: sphere: <material_solid> or <material_textured> is missing"
GLASS = "27: sphere material_solid: refraction iof must be > 0 where t > 0, got"
AT_LOOKAT = ('x="1" y="2" z="3"', 'x="0.5" y="-2e-10" z="-2.5"', "7: camera lookat: must differ from position")
# What is changed to what in SCENE, and the exact messages.
FAULTS: list[tuple[str, ...]] = [
    *(('radius="1.5"', f'radius="{text}"', f"25: sphere: radius {fault}") for text, fault in NUMBERS.items()),
    *(("example.png", name, f"3: scene: output_file {fault}") for name, fault in OUTPUT_FILES.items()),
    AT_LOOKAT,
    ('x="0" y="1" z="0"', 'x="1" y="4.0000000004" z="11"', "8: camera up: must not be parallel to the view"),
    ('angle="45"', 'angle="0"', f"{FOV} 0"),
    ('angle="45"', 'angle="90"', f"{FOV} 90: {HALF} 45 meant?"),
    ('horizontal="640"', 'horizontal="0"', f"{SIDES}, got 0x480"),
    ('horizontal="640"', f'horizontal="{"9" * 5000}"', f"{SIDES}, got 1000000000000000000x480"),
    ('horizontal="640"', 'horizontal="640.0"', "10: camera resolution: horizontal must be an integer, got '640.0'"),
    ('n="8"', 'n="8.5"', "11: camera max_bounces: n must be an integer, got '8.5'"),
    ('n="8"', 'n="101"', "11: camera max_bounces: n must be within 0..100, got 101"),
    ('z="-3"', 'z="-0"', "20: spot_light direction: must not be 0"),
    ('alpha2="25.5"', 'alpha2="240"', f"{FALLOFF}2 must be within [0, 180], got 240: {HALF} 120 meant?"),
    ('radius="1.5"', 'raduis="1.5"', "25: sphere: attribute radius is missing; did you mean 'raduis'?"),
    ('<position x="4"', '<postion x="4"', "25: sphere: <position> is missing; did you mean <postion> on line 26?"),
    ("      <material", '<position x="4"/>\n<material', "27: sphere: <position> must occur only once"),
    ("horizontal_fov", "fov", "5: camera: <horizontal_fov> is missing; did you mean <fov> on line 9?"),
    (MATERIAL_TEXT, "", NO_MATERIAL),
    (END, "<material_textured/></sphere>", "34: sphere: <material_textured> must occur only once"),
    ('t="0.0"', 't="0.5"', f"{GLASS} 0"),
    ('t="0.0"/>\n        <refraction iof="0"', 't="5e-1"/>\n<refraction iof="-15e-1"', f"{GLASS} -1.5"),
    (' iof="0"', "", "32: material_solid refraction: attribute iof is missing"),
    (END, STEPS.format("</transform><transform>"), "34: sphere: <transform> must occur only once"),
    (END, STEPS.format('<scale x="1" y="0" z="1"/>'), "34: transform scale: must not be singular, got a factor of 0"),
    (
        "<surfaces>\n", f'<surfaces>\n<mesh name="../b.obj">{MATERIAL_TEXT}</mesh>\n',
        "25: mesh: name must stay within the scene's folder, got '../b.obj'",
    ),
    (
        END, STEPS.format('<scale x="1e38" y="1e38" z="1e38"/>'),
        "25: sphere: after the transform x must not exceed 3.4e38 in magnitude, got 4e+38",
        "25: sphere: after the transform y must not exceed 3.4e38 in magnitude, got 5e+38",
        "25: sphere: after the transform z must not exceed 3.4e38 in magnitude, got 6e+38",
    ),
    (
        END, STEPS.format(20 * '<scale x="1e-40" y="1e-40" z="1e-40"/>'),
        "25: sphere: after the transform radius must be > 0, got 0",
    ),
    (
        END, STEPS.format('<scale x="1" y="1e-35" z="1"/><scale x="1" y="1e-11" z="1"/>'),
        "25: sphere transform: its inverse must not exceed 3.4e38 in magnitude, got 1e+46",
        "25: sphere: after the transform y must be 0 or at least 1.4e-45 in magnitude, got 5e-46",
    ),
    (
        END, STEPS.format('<rotateZ theta="45"/><scale x="1" y="1e-20" z="1"/><rotateZ theta="45"/>'),
        "25: sphere transform: must not distort so much that rounding spoils its inverse",
    ),
    # What is meant is said.
    (
        COLOR, '<texture name="a.png"/>',
        "27: sphere material_solid: <color> is missing; did you mean <material_textured>, which has a texture in place "
        "of the color?",
    ),
    (
        MATERIAL_TEXT, MATERIAL_TEXT.replace("material_solid", "material_textured"),
        "27: sphere material_textured: <texture> is missing; did you mean <material_solid>, which has a color in place "
        "of the texture?",
    ),
    (
        MATERIAL_TEXT, MATERIAL_TEXT.replace("material_solid", "material_spheremap"),
        f"{NO_MATERIAL}; did you mean <material_textured> for <material_spheremap>?",
    ),
    (
        'alpha1="20" alpha2="25.5"', 'angle="120"',
        *(f"{FALLOFF[:-5]}attribute alpha{k} is missing; alpha1 and alpha2 are measured from the axis: is half of the "
          "angle meant?" for k in (1, 2)),
    ),
]  # fmt: skip


@pytest.mark.parametrize("number", range(len(FAULTS)))
def test_fault(number: int) -> None:
    old, new, *expected = FAULTS[number]
    assert faults_of(changed(old, new)) == expected


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('<up x="0" y="2" z="0"/>', "", "14: sky_light: <below> goes with <up>, which is missing"),
        ('n="9"', 'n="1025"', "14: sky_light directions: n must be within 1..1024, got 1025; --limit lights=N or"),
        ('n="8"', 'n="8.5"', "15: sun_light directions: n must be an integer, got '8.5'"),
        ('angle="7"', 'angle="400"', "15: sun_light: angle must be within [0, 180], got 400"),
        ('radius="0.5"', 'radius="0"', "16: ball_light: radius must be > 0, got 0"),
        ('<along x="0" y="0" z="3"/>', "", "17: panel_light: <along> is missing"),
        ('z="3"', 'z="0"', "17: panel_light along: must not be 0"),
        ('x="0" y="0" z="3"', 'x="9" y="0" z="0"', "17: panel_light: across and along must not be along one line"),
        ('n="9"', 'n="1000"', "14: lights: must be at most 1024, with all members of soft ones, got 1064; --limit"),
        ('<start x="1" y="2" z="3"/>', "", "30: cylinder: <start> is missing"),
        ('z="5"', 'z="3"', "30: cylinder: end must not be the start"),
        ('z="5"', 'z="nan"', "31: cylinder end: z must be a finite number, got nan"),
    ],
)
def test_faults_of_extensions(old: str, new: str, fault: str) -> None:
    lights, rod = changed(old, new, f"{SOFT_LIGHTS}|{ROD}").split("|")
    text = changed("<lights>", f"<lights>{lights}").replace("<surfaces>\n", f"<surfaces>\n{rod}")
    assert any(found.startswith(fault) for found in faults_of(text))


def test_every_attribute_and_element_is_needed() -> None:
    """Each in turn is left out, or is no number: one fault, in its line, which names it and its element."""
    for found in re.finditer(r'<(\w+)((?: \w+="[^"]*")+)/?>', BODY):
        at, end = found.span()
        line = BODY.count("\n", 0, at) + 1
        for name in re.findall(r'(\w+)="', found[2]):
            for new, words in (("", f"attribute {name} is missing"), (f' {name}=""', f"{name} must")):
                (fault,) = faults_of(BODY[:at] + re.sub(f' {name}="[^"]*"', new, found[0]) + BODY[end:])
                assert fault.startswith(f"{line}: ")
                assert f"{found[1]}: {words}" in fault
        if found[0].endswith("/>"):
            assert any(f"<{found[1]}> is missing" in fault for fault in faults_of(BODY[:at] + BODY[end:]))


def test_each_ellipsoid_has_its_own_line() -> None:
    transforms = [
        "",
        '<transform><scale x="1" y="2" z="1"/></transform>',
        '<transform><scale x="1e-38" y="1" z="1"/><scale x="1e-38" y="1" z="1"/></transform>',
        '<transform><scale x="2" y="2" z="2"/></transform>',
        '<transform><scale x="1" y="3e38" z="1"/></transform>',
    ]
    balls = [changed(END, transform + "</sphere>", BALL) for transform in transforms]
    text = "".join(balls).replace('y="5"', 'y="0"').replace('x="4"', 'x="0"')
    lines = [25 + i * BALL.count("\n") for i in (2, 4)]
    assert faults_of(changed(BALL, text)) == [
        f"{lines[0]}: sphere transform: its inverse must not exceed 3.4e38 in magnitude, got 1e+76",
        f"{lines[1]}: sphere: after the transform half of the extent along y must not exceed 3.4e38 in magnitude, "
        "got 4.5e+38",
    ]


def test_all_faults_come_at_once_in_line_order() -> None:
    text = SCENE
    for old, new in (
        ('<reflectance r="0.0"', '<reflectance r="abc"'),
        ('exponent="200"', 'exponent="-1"'),
        ('<position x="4"', '<postion x="4"'),
        ('alpha1="20"', 'alpha1="30"'),
        ('<up x="0" y="1"', '<up x="0" y="0"'),
        AT_LOOKAT[:2],
        (' output_file="example.png"', ""),
        ('radius="1.5"', 'radius="x"'),
    ):
        text = changed(old, new, text)
    assert faults_of(text) == [
        "3: scene: attribute output_file is missing",
        "7: camera lookat: must differ from position",
        "8: camera up: must not be 0",
        "21: spot_light falloff: alpha1 must be <= alpha2 (25.5), got 30",
        "25: sphere: <position> is missing; did you mean <postion> on line 26?",
        "25: sphere: radius must be a number, got 'x'",
        "29: material_solid phong: exponent must be >= 0, got -1",
        "30: material_solid reflectance: r must be a number, got 'abc'",
    ]
    missing = ("<background_color>", "<camera>", "<lights>", "<surfaces>", "attribute output_file")
    assert faults_of("<scene/>") == [f"1: scene: {name} is missing" for name in missing]


def test_a_hundred_faults_are_enough() -> None:
    balls = "".join(f'<sphere radius="-{i}"/>\n' for i in range(150))
    faults = faults_of(changed("<surfaces>\n", "<surfaces>\n" + balls))
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
        ((1,), " (2 times, also in line 26)"),
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
    balls = '<sphere radius="1"/>\n<sphere radius="1"><postion x="0" y="0" z="0"/></sphere>\n'
    fault = faults_of(changed("<surfaces>\n", "<surfaces>\n" + balls))[1]
    assert fault == "25: sphere: <position> is missing; did you mean <postion> on line 26? (2 times, also in line 26)"


# --- Warnings

BYTES = "looks like bytes of 0..255, but 1 is full: divide by 255"
UNKNOWN, APPENDED = "unknown element <{}> ignored", "does not end in .png, which is appended"
ROTATED = f"34: sphere transform: {UNKNOWN}"
SHARES, MORE = (
    BALL[BALL.index("<refl") : BALL.index("\n      </mat")],
    "27: sphere material_solid: r + t = 1.1 is above 1: more light goes on",
)
WARNINGS: list[tuple[str, str, str | None]] = [
    ("<camera>", '<camera><dof on="1"><position/></dof>', f"5: camera: {UNKNOWN.format('dof')}"),
    ("</scene>", "<supersampling/></scene>", f"36: scene: {UNKNOWN.format('supersampling')}"),
    ("<lights>", "<lights><spot/>", f"13: lights: {UNKNOWN.format('spot')}; did you mean <spot_light>?"),
    ("</surfaces>", "<x xmlns='urn:e'/></surfaces>", f"35: surfaces: {UNKNOWN.format('{urn:e}x')}"),
    ("</surfaces>", "<sfere/></surfaces>", f"35: surfaces: {UNKNOWN.format('sfere')}; did you mean <sphere>?"),
    ("<sphere ", '<sphere foo="7" ', "25: sphere: unknown attribute 'foo' ignored"),
    (END, "<transfrom/></sphere>", f"34: sphere: {UNKNOWN.format('transfrom')}; did you mean <transform>?"),
    (END, STEPS.format("<rotatex/>"), f"{ROTATED.format('rotatex')}; did you mean <rotateX>?"),
    (END, STEPS.format('<rotate axis="y"/>'), f"{ROTATED.format('rotate')}; did you mean <rotateY>?"),
    (END, STEPS.format('<rotate x="0" y="0.0" z="1"/>'), f"{ROTATED.format('rotate')}; did you mean <rotateZ>?"),
    (END, STEPS.format('<rotate x="1" y="1" z="0"/>'), ROTATED.format("rotate")),
    ("example.png", "a.jpg", f"3: scene: output_file 'a.jpg' {APPENDED}"),
    ("example.png", "A.PNG", None),
    (SHARES, '<reflectance r="0.7"/><transmittance t="0.3"/><refraction iof="1"/>', None),
    (SHARES, '<reflectance r="0.6"/><transmittance t="0.5"/><refraction iof="1"/>', f"{MORE} than reaches it"),
    ('r="0.1" g="0.2" b="0.3"', 'r="255" g="128" b="0"', f"4: background_color: 255, 128, 0 {BYTES}"),
    ('r="0" g="0" b="0"', 'r="51" g="51" b="51.0"', f"14: ambient_light color: 51, 51, 51 {BYTES}"),
    ('r="1" g="1" b="0"', 'r="0" g="0" b="16"', f"18: spot_light color: 0, 0, 16 {BYTES}"),
    ('r="0.5" g="0.25" b="1"', 'r=" 200" g="30" b="30"', f"28: material_solid color: 200, 30, 30 {BYTES}"),
    # Bright lights, and what cannot be bytes.
    ('r="1" g="0.5" b="2"', 'r="15" g="10" b="2"', None),
    ('r="1" g="0.5" b="2"', 'r="16.5" g="0" b="0"', None),
]


@pytest.mark.parametrize(("old", "new", "told"), WARNINGS)
def test_warning(old: str, new: str, told: str | None) -> None:
    assert warnings_of(changed(old, new)) == ([told] if told else [])
    scene = read("scene.xml")[0]
    if "unknown" in (told or ""):
        assert same(scene, scene_of(SCENE))
    assert scene.output_file == {"a.jpg": "a.jpg.png", "A.PNG": "A.PNG"}.get(new, "example.png")


def test_of_several_names_none_is_more_likely() -> None:
    assert closest("axis", ("one_long_axis", "other_long_axis")) is None


def test_a_file_beside_the_missing_one_is_named() -> None:
    Path("textures").mkdir()
    Path("textures/wall.png").write_bytes(b"")
    missing = "material_textured texture: name 'textures/walls.png' cannot be read: No such file or directory"
    (fault,) = faults_of(changed(MATERIAL_TEXT, TEXTURED.format("textures/walls.png")))
    assert fault == f"28: {missing}; did you mean 'textures/wall.png'?"


def test_every_message_is_one_line() -> None:
    """Whatever the name of the file."""
    Path("a\nb.xml").write_text(changed("<up ", "<upp "))
    with pytest.raises(SceneError) as caught:
        read("a\nb.xml")
    assert str(caught.value) == "a\\nb.xml:5: camera: <up> is missing; did you mean <upp> on line 8?"


# --- Transforms


def scale(x: float, y: float, z: float) -> str:
    return f'<scale x="{x!r}" y="{y!r}" z="{z!r}"/>'


def turn(axis: str, degrees: float) -> str:
    return f'<rotate{axis} theta="{degrees!r}"/>'


MOVE, MOVED = '<translate x="1" y="0" z="0"/>', [scale(2, 2, 2), '<translate x="1" y="0" z="0"/>']
# Steps of a sphere at 1, 2, 3 with the radius 1.5, and what it is then.
FOLDED: list[tuple[list[str], tuple[float, ...], float]] = [
    ([], (1, 2, 3), 1.5),
    (['<translate x="10" y="20" z="30"/>'], (11, 22, 33), 1.5),
    ([scale(2, 2, 2)], (2, 4, 6), 3),
    ([scale(-2, 2, 2)], (-2, 4, 6), 3),
    ([turn("Z", 90)], (-2, 1, 3), 1.5),
    ([turn("Z", 36000090)], (-2, 1, 3), 1.5),
    ([MOVE, turn("Z", 90)], (-1, 1, 3), 1.5),  # the last acts first
    ([turn("Z", 90), MOVE], (-2, 2, 3), 1.5),
    ([MOVE, *MOVED, MOVE, *MOVED], (13, 8, 12), 6),  # ((1 + 1) 2 + 1 + 1) 2 + 1
    # What stays a sphere: one that cancels, by quarters, mirrored and turned, an ulp off.
    ([scale(2, 1, 1), scale(1, 2, 2)], (2, 4, 6), 3),
    ([scale(1, 3, 1), turn("Z", 90), scale(1, 3, 1), turn("Z", -90), scale(1, 1, 3)], (3, 6, 9), 4.5),
    ([turn("Z", 180), scale(-1, 1, -1)], (1, -2, -3), 1.5),
    ([scale(1, 1, 1.0000000000000002)], (1, 2, 3 * 1.0000000000000002), 1.5),
]


@pytest.mark.parametrize(("steps", "center", "radius"), FOLDED)
def test_transforms_fold(steps: list[str], center: tuple[float, ...], radius: float) -> None:
    scene = scene_of(transformed(*steps, position='x="1" y="2" z="3"'))
    ball = scene.spheres[0]
    assert (tuple(ball["center"]), ball["to_object"]) == (center, -1)
    assert ball["radius"] == pytest.approx(radius, rel=2.0**-52)
    assert len(scene.to_object) == 0


ELLIPSOIDS = [
    ([scale(1, 2, -4)], [[1, 0, 0], [0, 0.5, 0], [0, 0, -0.25]]),
    ([scale(1, 1, 1 + 2.0**-48)], [[1, 0, 0], [0, 1, 0], [0, 0, 1 / (1 + 2.0**-48)]]),
    ([scale(1, 2, 4), turn("Z", 90)], [[0, 0.5, 0], [-1, 0, 0], [0, 0, 0.25]]),
    ([turn("Z", 90), scale(1, 2, 4)], [[0, 1, 0], [-0.5, 0, 0], [0, 0, 0.25]]),
    ([scale(1e30, 1e-30, 1)], [[1 / 1e30, 0, 0], [0, 1 / 1e-30, 0], [0, 0, 1]]),
]


@pytest.mark.parametrize(("steps", "to_object"), ELLIPSOIDS)
def test_what_becomes_an_ellipsoid(steps: list[str], to_object: list[list[float]]) -> None:
    scene, warnings = read_text(transformed(*steps, position='x="0" y="0" z="0"'))
    assert len(warnings) == 2 * ("1e-30" in steps[0])  # its scales, and how far away it is
    assert scene.to_object.tolist() == [to_object]
    assert scene.spheres[["radius", "to_object"]].tolist() == [(1.5, 0)]


def test_equal_ellipsoids_have_one_map() -> None:
    balls = [
        changed(END, STEPS.format("".join(steps)), BALL)
        for steps in (
            [scale(1, 2, 1)],
            [scale(2, 2, 2)],
            [scale(4, 1, 1)],
            [MOVE, scale(1, 2, 1)],
            [scale(1, 2, 1), turn("Y", 180), turn("Y", -180)],
        )
    ]
    scene = scene_of(changed(BALL, BALL + "".join(balls)))
    assert scene.spheres["to_object"].tolist() == [-1, 0, -1, 1, 0, 0]
    assert scene.to_object.tolist() == [np.diag([1, 0.5, 1]).tolist(), np.diag([0.25, 1, 1]).tolist()]
    assert not scene.to_object.flags.writeable


def exactly(steps: list[tuple[str, list[float]]]) -> Any:
    """The product of scales and rotations in many digits."""
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
    """Of scales and rotations whose product distorts by a few thousand at most."""
    rng = np.random.default_rng(count)
    mpmath.mp.dps = 40
    for _ in range(10):
        steps: list[tuple[str, list[float]]] = [("scale", [1.0, 2.0, 3.0])]
        for _ in range(count):
            sizes = (2.0 ** rng.uniform(-8 / count, 8 / count, 3) * rng.choice([-1, 1], 3)).tolist()
            turned = str(rng.choice(list("XYZ"))), [float(rng.uniform(-400, 400))]
            steps.insert(0, ("scale", sizes) if rng.random() < 0.5 else turned)
        text = [scale(*numbers) if kind == "scale" else turn(kind, *numbers) for kind, numbers in steps]
        scene = scene_of(transformed(*text, position='x="1" y="2" z="3"'))
        to_world, to_object = exactly(steps), mpmath.matrix(scene.to_object[0].tolist())
        reach = mpmath.mnorm(to_world, "inf")
        for got, want in zip(scene.spheres["center"][0].tolist(), to_world * mpmath.matrix([1, 2, 3]), strict=True):
            assert abs(got - want) < 100 * 2.0**-52 * reach
        for n in rng.normal(size=(5, 3)):
            point = mpmath.matrix((n / np.linalg.norm(n)).tolist())
            assert abs(mpmath.norm(to_object * (to_world * point)) - mpmath.norm(point)) < 1e-11


def test_a_long_chain_of_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    chain = [scale(1, 2, 1), turn("X", 90), scale(1, 1, 0.5), turn("X", -90)]  # which is nothing at all
    text = transformed(*chain * 4000, scale(1, 1, 2))
    assert scene_of(text).to_object.tolist() == [np.diag([1, 1, 0.5]).tolist()]
    monkeypatch.setattr(elements, "MAX_STEPS", 16_000)
    told = "34: transform: must not have more than 16000 steps; --limit steps=N or CLTRACE_LIMITS allows more"
    assert told in faults_of(text)


# --- Files that are no scene, and hostile ones

ENTITIES = "".join(f'<!ENTITY e{i + 1} "{f"&e{i};" * 20}">\n' for i in range(12))
BOMB = f'<!DOCTYPE scene [\n<!ENTITY e0 "{"x" * 50}">\n{ENTITIES}]>\n'
DECLARED = " the document type must not declare entities, got "
XML, CUT = "not well-formed XML: ", '<scene output_file="s.png">' + "\n" * 70_000
NO_SCENES: list[tuple[str | bytes, str]] = [
    ("", " is empty"),
    (" \n", f"2: {XML}Start tag expected"),
    *((text, f"1: {XML}Start tag expected") for text in (b"\x89PNG\r\n\x1a\n\0", bytes(range(256)) * 1000, "hello")),
    *((text, f"1: {XML}") for text in ("<", "a", "<?a?>", "<!-->", "\0")),
    ("<a/><", "1: the root element must be <scene>, got <a>"),
    ("<!-- \n -->\n<scenes/>", "3: the root element must be <scene>, got <scenes>"),
    (SCENE.replace("example", "Bäume").encode("latin-1"), f"3: {XML}Invalid bytes"),
    (SCENE + "<scene/>", f"37: {XML}Extra content at the end"),
    (SCENE[: SCENE.index("<lookat")], f"7: {XML}Premature end of data in tag camera line 5"),
    (changed("    <lookat", "</a>\n"), f"7: {XML}Opening and ending tag mismatch: camera line 5 and a"),
    (SCENE.replace('standalone="no"', 'encoding="no-such"'), f"1: {XML}"),
    *((CUT + text, f"70001: {XML}") for text in ("<q", "<camera", "<sphere radius='1'", "<!--", "&", "<![CDATA[")),
    *((BOMB + changed(old, f"{old}&e12;", BODY), f"{DECLARED}'e0'") for old in ("<camera>", 'radius="')),
    (BOMB + changed("example", "&e12;", BODY), f"16: {XML}Maximum entity amplification"),
    ('<!DOCTYPE scene [\n<!ENTITY x SYSTEM "file:///etc/passwd">]>\n' + BODY, DECLARED),
    ('<!DOCTYPE scene [\n<!ENTITY % x SYSTEM "http://127.0.0.1:9/x"> %x;]>\n' + BODY, DECLARED),
    ('<!DOCTYPE scene [\n<!ENTITY unused "1">]>\n' + BODY, DECLARED),
    (('<!DOCTYPE scene [\n<!ENTITY x "1">]>\n' + BODY).encode("utf-16"), DECLARED),
    *((text.replace('"1.5"', '"1&x;5"'), f"25: {XML}Entity 'x' not defined") for text in (SCENE, f"\n\n{BODY}")),
    *((text.replace(END, f"&x;{END}"), f"34: {XML}Entity 'x' not defined") for text in (SCENE, f"\n\n{BODY}")),
    (changed("<camera>", "<camera>" + "<a>" * 300), f"5: {XML}Excessive depth in document: 256"),
    (changed("<up", "".join(f"<a{i}/>" for i in range(10_001)) + "<up"), "8: must not have more than 10000 unknown"),
    (changed("<up", "<up " + " ".join(f"a{i}='1'" for i in range(10_001))), "8: must not have more than 10000 unknown"),
]  # fmt: skip


@pytest.mark.parametrize("number", range(len(NO_SCENES)))
def test_not_a_scene(number: int) -> None:
    text, told = NO_SCENES[number]
    faults = faults_of(text)
    assert faults[-1].startswith(told)
    assert len(faults) == 1


def test_not_well_formed_in_addition_to_the_faults_before() -> None:
    text = changed('r="0.1"', 'r="-1"').replace('radius="1.5"', 'radius="x"').replace("<refraction", "</phong>")
    assert faults_of(text) == [
        "4: background_color: r must be >= 0, got -1",
        "25: sphere: radius must be a number, got 'x'",
        "32: not well-formed XML: Opening and ending tag mismatch: material_solid line 27 and phong",
    ]


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
@pytest.mark.parametrize("wrong", [b"\xd8\xd8\xd8\xd8", b"\xff"])
def test_wide_characters_that_are_none(encoding: str, wrong: bytes) -> None:
    encoded = BODY.encode(encoding)
    for at in (len(encoded), len(encoded) - 400):
        assert "not well-formed XML" in faults_of(encoded[:at] + wrong + encoded[at:])[-1]


def test_a_document_type_is_never_fetched() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.05)
        scene_of(SCENE.replace("scene.dtd", f"http://127.0.0.1:{server.getsockname()[1]}/scene.dtd"))
        with pytest.raises(TimeoutError):
            server.accept()
    Path("scene.dtd").write_text('<!ENTITY x "1">')
    assert faults_of(changed("1.5", "&x;.5"))[0].startswith("25: not well-formed XML: Entity 'x' not defined")


def test_files_that_cannot_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("nine.png", "nine.xml"):
        Path(name).touch()
    os.mkfifo("pipe.xml")
    for name, told in (
        ("gone.txt", "gone.txt: cannot be read: No such file or directory"),
        ("nin.xml", "nin.xml: cannot be read: No such file or directory; did you mean 'nine.xml'?"),
        (".", ".: is a directory"),
        ("a\0b", "a\\x00b: cannot be read: the name contains a NUL"),
        ("\ud800", "\\ud800: cannot be read: the name is not utf-8"),
        (400 * "x", f"{400 * 'x'}: cannot be read: File name too long"),
        ("pipe.xml", "pipe.xml: is not a regular file"),
    ):
        with pytest.raises(SceneError) as caught:
            read(name)
        assert str(caught.value) == told

    def refuse(*_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(SceneError, match=r"^nine\.xml: cannot be read: Permission denied$"):
        read("nine.xml")


def test_hints_are_made_for_few_of_many_attributes(monkeypatch: pytest.MonkeyPatch) -> None:
    """40,000 of them took 18 s."""
    compared: list[int] = []

    def counted(name: str, others: tuple[str, ...]) -> str | None:
        compared.append(len(others))
        return closest(name, others)

    monkeypatch.setattr(elements, "closest", counted)
    text = changed("<phong ", "<phong " + " ".join(f'a{i}="1"' for i in range(9000)) + " ")
    assert warnings_of(text)[-1] == "29: … and 8900 more"
    assert any("is missing" in fault for fault in faults_of(text.replace('kd="', 'q="')))
    assert len(compared) <= 300
    assert sum(compared) <= 10_000


def test_a_view_is_checked_with_any_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also with those that the defaults of cameras in Python pass, of which the file knows nothing."""
    monkeypatch.setattr(eye, "MAX_BOUNCES", 7)
    old, new, fault = AT_LOOKAT
    assert faults_of(changed(old, new)) == [fault]


def test_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "MAX_LIGHTS", 3)
    (fault,) = faults_of(SCENE)
    assert fault.startswith("17: lights: must be at most 3, with all members of soft ones, got 4; --limit lights=N or")
    monkeypatch.setattr(reader, "MAX_LIGHTS", 4)
    monkeypatch.setattr(surfaces.SphereReader, "most", 2)
    assert faults_of(changed(BALL, BALL * 3)) == ["45: surfaces: must be at most 2 spheres"]
    monkeypatch.setattr(limits, "SCENE_BYTES", 1000)
    (fault,) = faults_of(SCENE)
    assert fault == " must not be larger than 1000 bytes; --limit scene-bytes=N or CLTRACE_LIMITS allows more"
