"""Scenes and the files that they name: meshes and textures, where they are looked for, and what is wrong with them."""

from __future__ import annotations

import os
import pickle
import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import cltrace
from cltrace.base import limits
from cltrace.base.errors import Fault, SceneError, SceneWarning
from cltrace.formats import files, obj, reader, surfaces, texture
from cltrace.formats.reader import read
from cltrace.scene import Scene

pytestmark = pytest.mark.usefixtures("own_folder")

HEAD = """\
<scene output_file="x.png">
  <background_color r="0" g="0" b="0"/>
  <camera><position x="0" y="0" z="5"/><lookat x="0" y="0" z="0"/><up x="0" y="1" z="0"/>
    <horizontal_fov angle="45"/><resolution horizontal="4" vertical="3"/><max_bounces n="1"/></camera>
  <lights/>
  <surfaces>
"""
FIRST = HEAD.count("\n") + 1  # the line of the first surface, each of which is one
FINISH = (
    '<phong ka="0.25" kd="1" ks="0" exponent="1"/><reflectance r="0.5"/><transmittance t="0"/><refraction iof="0"/>'
)
RED = f'<material_solid><color r="1" g="0.5" b="0"/>{FINISH}</material_solid>'
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n"
TWO = TRIANGLE + "f 1/1 3/1 2/1\n"
PIXELS = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)


@pytest.fixture(autouse=True)
def _files(own_folder: None) -> None:
    Path("sub").mkdir()
    for name, text in (("a.obj", TRIANGLE), ("sub/b.obj", TWO)):
        Path(name).write_text(text)
    for name in ("wall.png", "sub/sky.png"):
        Image.fromarray(PIXELS).save(name)


def textured(name: str) -> str:
    return f'<material_textured><texture name="{name}"/>{FINISH}</material_textured>'


def mesh(name: str, material: str = RED, *steps: str) -> str:
    transform = f"<transform>{''.join(steps)}</transform>" if steps else ""
    return f'<mesh name="{name}">{material}{transform}</mesh>\n'


def ball(material: str = RED, *steps: str) -> str:
    transform = f"<transform>{''.join(steps)}</transform>" if steps else ""
    return f'<sphere radius="2"><position x="1" y="2" z="3"/>{material}{transform}</sphere>\n'


def read_surfaces(*surfaces: str, path: str = "scene.xml", instances: int = 2**26) -> tuple[Scene, list[str]]:
    Path(path).write_text(HEAD + "".join(surfaces) + "</surfaces></scene>")
    return read(path, instances=instances)


def scene_of(*surfaces: str) -> Scene:
    scene, warnings = read_surfaces(*surfaces)
    assert warnings == []
    return scene


def faults_of(*surfaces: str) -> list[str]:
    with pytest.raises(SceneError) as caught:
        read_surfaces(*surfaces)
    return str(caught.value).split("\n")


def move(x: float, y: float, z: float) -> str:
    return f'<translate x="{x!r}" y="{y!r}" z="{z!r}"/>'


def scale(x: float, y: float, z: float) -> str:
    return f'<scale x="{x!r}" y="{y!r}" z="{z!r}"/>'


def turn(axis: str, degrees: float) -> str:
    return f'<rotate{axis} theta="{degrees!r}"/>'


# --- Valid scenes


def test_everything_arrives() -> None:
    scene = scene_of(
        mesh("a.obj"), ball(), mesh("sub/b.obj", textured("sub/sky.png")), ball(textured("wall.png")), ball()
    )
    assert [len(m.geometry.faces) for m in scene.meshes] == [1, 2]
    assert [m.number for m in scene.meshes] == [0, 2]
    assert scene.sphere_numbers.tolist() == [1, 3, 4]
    assert scene.spheres["material"].tolist() == [0, 2, 0]
    assert [m.material for m in scene.meshes] == [0, 1]
    assert scene.materials["texture"].tolist() == [-1, 0, 1]
    assert scene.materials["color"].tolist() == [[1, 0.5, 0], [1, 1, 1], [1, 1, 1]]
    assert scene.materials["reflectance"].tolist() == [0.5] * 3
    assert all(np.array_equal(texture, PIXELS) for texture in scene.textures)
    assert scene.meshes[0].geometry.uv.tolist() == [[0, 0]]


def test_a_file_that_is_named_twice_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """By whatever name."""
    Path("c.obj").symlink_to("a.obj")
    count = {"obj": 0, "texture": 0}

    def counted(kind: str, function: Any) -> Any:
        def call(*arguments: Any) -> Any:
            count[kind] += 1
            return function(*arguments)

        return call

    monkeypatch.setattr(obj, "read_obj", counted("obj", obj.read_obj))
    monkeypatch.setattr(texture, "read_texture", counted("texture", texture.read_texture))
    names = ["a.obj", "a.obj", "./a.obj", "sub/a.obj", "c.obj"]
    Path("sub/a.obj").write_text(TWO)
    images = ["wall.png", "./wall.png", "wall.png", "sub/sky.png", ".//wall.png"]
    scene = scene_of(*(mesh(name, textured(image)) for name, image in zip(names, images, strict=True)))
    assert count == {"obj": 2, "texture": 2}
    shapes = [m.geometry for m in scene.meshes]
    assert [shapes[0] is other for other in shapes] == [True, True, True, False, True]
    assert [len(scene.textures), len(scene.materials)] == [2, 2]
    assert [m.material for m in scene.meshes] == [0, 0, 0, 1, 0]
    again = pickle.loads(pickle.dumps(scene))
    assert again.meshes[0].geometry is again.meshes[4].geometry


def test_names_are_those_of_the_scenes_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir("sub")
    scene, _ = read_surfaces(mesh("a.obj", textured("wall.png")), path="../scene.xml")
    assert len(scene.meshes[0].geometry.faces) == 1
    assert len(read(Path("../scene.xml").resolve())[0].textures) == 1


def test_a_link_within_the_folder_is_followed() -> None:
    Path("link").symlink_to("sub")
    Path("sub/up.obj").symlink_to("../a.obj")
    Path("sub/above").symlink_to("..")
    names = "link/b.obj", "sub/up.obj", "link/up.obj", "sub/above/sub/b.obj"
    assert len(scene_of(*map(mesh, names)).meshes) == 4


PLACES = {
    "nothing": ([], np.eye(3, 4)),
    "scaled": ([scale(2, -3, 0.5)], np.diag([2, -3, 0.5, 0])[:3]),
    "x by 90": ([turn("X", 90)], [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0]]),
    "y by 90": ([turn("Y", 90)], [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0]]),
    "z by 90": ([turn("Z", 90)], [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]]),
    "all": (
        [move(1, 1, 1), scale(2, 2, 4), turn("X", 90), move(0, 1, 2)],
        [[2, 0, 0, 1], [0, 0, -2, -3], [0, 4, 0, 5]],
    ),
}


@pytest.mark.parametrize("name", PLACES)
def test_meshes_are_where_the_steps_put_them(name: str) -> None:
    steps, place = PLACES[name]
    found = scene_of(mesh("a.obj", RED, *steps)).meshes[0]
    assert found.to_world.tolist() == np.asarray(place, float).tolist()
    assert (found.vertices is found.geometry.vertices) == (not steps)


# --- Spheres with textures

WAYS = {
    "scaled": ([scale(3, 3, 3)], None),
    "a quarter": ([turn("Y", 90)], [[0, 0, -1], [0, 1, 0], [1, 0, 0]]),
    "turned and scaled": ([turn("Z", 90), scale(2, 2, 2)], [[0, 0.5, 0], [-0.5, 0, 0], [0, 0, 0.5]]),
    "mirrored": ([scale(-1, 1, 1)], [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    "turned inside out": ([scale(-2, -2, -2)], [[-0.5, 0, 0], [0, -0.5, 0], [0, 0, -0.5]]),
    "an ellipsoid": ([scale(1, 2, 1)], [[1, 0, 0], [0, 0.5, 0], [0, 0, 1]]),
}


@pytest.mark.parametrize("name", WAYS)
def test_spheres_with_textures_keep_how_they_are_turned(name: str) -> None:
    steps, to_object = WAYS[name]
    scene = scene_of(ball(textured("wall.png"), *steps), ball(RED, *steps))
    turned, plain = scene.spheres
    assert np.array_equal(turned["center"], plain["center"])
    if to_object is None:
        assert turned[["radius", "to_object"]].tolist() == plain[["radius", "to_object"]].tolist()
        assert turned["to_object"] == -1
        return
    assert scene.to_object[turned["to_object"]].tolist() == to_object
    assert turned["radius"] == 2


# --- Faults


NO_FILE, OUT = "cannot be read: No such file or directory", "must stay within the scene's folder"
NAMES = {
    "gone.obj": NO_FILE,
    "none/a.obj": NO_FILE,
    "sub": "is a directory",
    ".": "is a directory",
    "a.obj/b.obj": "cannot be read: Not a directory",
    "pipe": "is not a regular file",
    "link": "is not a regular file",
    "socket": "is not a regular file",
    "out": OUT,
    "root/etc/hostname": OUT,
    "loop": "cannot be read: Too many levels of symbolic links",
    "": "must not be empty",
    **dict.fromkeys(("..", "../", "../away", "sub/../../away", "./../away", "/etc/passwd", "//etc/passwd", "/"), OUT),
    **dict.fromkeys(
        ("file:///etc/passwd", "http://localhost/x", "C:/x", "a.obj:x", "..\\away", "C:\\x"), "a backslash or"
    ),
    **dict.fromkeys(
        ("a&#10;b.obj", "a&#9;b.obj", "\u202ejbo.obj", "a.obj&#x85;"), "must not contain control characters"
    ),
    **dict.fromkeys(
        ("~/away", "$HOME/x", "%2e%2e/away", "-", "a.obj ", "\u00e4.obj", "CON", "*.obj", "|ls", "A.OBJ"), NO_FILE
    ),
}


@pytest.mark.parametrize("kind", ["mesh", "texture"])
def test_names_of_what_cannot_be_read(kind: str) -> None:
    """Nothing is opened outside of the folder, nor what has no contents of its own."""
    Path("../away").write_text(TRIANGLE)
    os.mkfifo("pipe")
    for name, target in {"link": "pipe", "out": "../away", "root": "/", "loop": "loop"}.items():
        Path(name).symlink_to(target)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("socket")
        for name, words in NAMES.items():
            (fault,) = faults_of("\n", mesh(name) if kind == "mesh" else mesh("a.obj", textured(name)))
            label = "mesh" if kind == "mesh" else "material_textured texture"
            assert fault.startswith(f"scene.xml:{FIRST + 1}: {label}: name ")
            assert words in fault
            assert fault.isprintable()


def test_each_file_that_cannot_be_read_is_told() -> None:
    Path("text.png").write_text("no image")
    surfaces = mesh("gone.obj"), mesh("sub", textured("text.png")), ball(textured("gone.png")), mesh("gone.obj")
    assert faults_of(*surfaces) == [
        f"scene.xml:{FIRST}: mesh: name 'gone.obj' {NO_FILE} (2 times, also in line {FIRST + 3})",
        f"scene.xml:{FIRST + 1}: material_textured texture: name 'text.png' is no PNG or JPEG file",
        f"scene.xml:{FIRST + 1}: mesh: name 'sub' is a directory",
        f"scene.xml:{FIRST + 2}: material_textured texture: name 'gone.png' {NO_FILE}",
    ]


def test_faults_of_a_mesh_are_told_with_its_own_lines() -> None:
    Path("a.obj").write_text("v 0 0 0\nv 0 x 0\nf 1 2 3\n")
    Path("sub/b.obj").write_text("")
    surfaces = [mesh("a.obj"), mesh("sub/b.obj"), mesh("./a.obj"), '<sphere radius="0"/>\n']
    assert faults_of(*surfaces) == [
        f"scene.xml:{FIRST + 3}: sphere: <material_solid> or <material_textured> is missing",
        f"scene.xml:{FIRST + 3}: sphere: <position> is missing",
        f"scene.xml:{FIRST + 3}: sphere: radius must be > 0, got 0",
        "a.obj:2: vertex: y must be a number, got 'x'",
        "a.obj:3: face: vertex 3 of 2",
        "sub/b.obj: is empty",
    ]
    with pytest.raises(SceneError) as caught:
        read(Path("scene.xml").resolve())
    assert caught.value.faults[-1] == Fault(0, "is empty", str(Path("sub/b.obj").resolve()))


def test_files_are_read_even_where_the_scene_ends_early() -> None:
    Path("a.obj").write_text("v 0 0\nf 1 1 1\n")
    Path("scene.xml").write_text(HEAD + mesh("a.obj") + mesh("gone.obj") + "<sphere")
    with pytest.raises(SceneError) as caught:
        read("scene.xml")
    told = str(caught.value).split("\n")
    assert told[0] == f"scene.xml:{FIRST + 1}: mesh: name 'gone.obj' cannot be read: No such file or directory"
    assert told[-1] == "a.obj:1: vertex: must be 3, 4 or 6 numbers, got 2"


def test_of_thousands_of_missing_files_most_are_not_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """60,000 took 11 seconds."""
    looked = []

    def within(_: str, name: str) -> str:
        looked.append(name)
        return name

    monkeypatch.setattr(files, "within", within)
    Path("scene.xml").write_text(HEAD + "".join(mesh(f"{k}.obj") for k in range(1500)) + "</surfaces></scene>")
    with pytest.raises(SceneError, match="and 1400 more"):
        read("scene.xml")
    assert len(looked) == files.MAX_UNREADABLE + 1


RADIUS = "a radius or scale of {} may spoil colours, which hold within 1.1e-19..9.2e+18"
AWAY = "sphere: is {} times as far from the eye as its transform makes it thick, which may spoil colours, which"
FLAT, SIZE = ball(RED, scale(1, 0.5, 1)), 'radius="2"'
NEEDLES = "v -1.5 {} 0\nv 1.5 -1 0.4\nv 1.5 1 0\nv -1.5 1 -0.75\nf 1 2 3\nf 1 2 4\n"
REACH = "mesh: reaches {} from the eye, which may spoil colours, which hold within 5e+06: 1e+06 times as far as the"
# The eye's distance, a surface, and what is warned of: sizes of surfaces, ellipsoids far away, needles that reach far.
DOUBTS: list[tuple[str, str, str | None]] = [
    ("5", ball().replace(SIZE, 'radius="1e30"'), f"sphere: {RADIUS.format('1e+30')}"),
    ("5", ball().replace(SIZE, 'radius="1e-30"'), f"sphere: {RADIUS.format('1e-30')}"),
    ("5", ball().replace(SIZE, 'radius="9e18"'), None),
    ("5", ball(RED, scale(1e22, 1e22, 1e22)), f"sphere: {RADIUS.format('2e+22')}"),
    ("5", ball(RED, scale(1, 1e-22, 1)), f"sphere: {RADIUS.format('1e-22')}"),
    ("5", mesh("a.obj", RED, scale(1e-22, 1e-22, 1e-22)), f"mesh: {RADIUS.format('1e-22')}"),
    ("5", mesh("a.obj", RED, scale(1e-18, 1e-18, 1e-18)), None),
    ("1.1e14", FLAT, AWAY.format("1.1e+14")),
    ("1.1e14", ball(), None),
    ("9e13", FLAT, None),
    *(("5", f"{reach} needles", REACH.format(f"{float(reach):.2g}")) for reach in ("1e22", "2147483648", "6e6")),
    ("5", "4e6 needles", None),
]


@pytest.mark.parametrize(("away", "surface", "told"), DOUBTS)
def test_what_is_none_for_colours(away: str, surface: str, told: str | None) -> None:
    if surface.endswith("needles"):
        Path("n.obj").write_text(NEEDLES.format(surface.split()[0]))
        surface = mesh("n.obj")
    Path("scene.xml").write_text(HEAD.replace('z="5"', f'z="{away}"') + surface + "</surfaces></scene>")
    _, warnings = read("scene.xml")
    assert bool(warnings) == bool(told)
    assert not told or warnings[0].startswith(f"scene.xml:{FIRST}: {told}")


TRANSFORMS = {
    "singular": ([scale(1, 0, 1)], "transform scale: must not be singular, got a factor of 0"),
    "vanishing": ([scale(1e-30, 1, 1)] * 2, "mesh transform: a number of its matrix must be 0 or at least 1.4e-45"),
    "endless": ([scale(1e30, 1, 1)] * 2, "mesh transform: a number of its matrix must not exceed 3.4e38"),
    "too flat": (
        [turn("Z", 45), scale(1, 1e-20, 1), turn("Z", 45)],
        "mesh transform: must not distort so much that rounding spoils its inverse",
    ),
    "far away": (
        [move(3e38, 0, 0), scale(3e38, 1, 1)],
        "mesh: after the transform vertices[1][0]: must not exceed 3.4e38 in magnitude, got 6e+38",
    ),
}


@pytest.mark.parametrize("name", TRANSFORMS)
def test_transforms_that_are_faults(name: str) -> None:
    steps, message = TRANSFORMS[name]
    (fault,) = faults_of(mesh("a.obj", RED, *steps))
    assert fault.startswith(f"scene.xml:{FIRST}: {message}")


# --- Warnings


def test_warnings_of_the_files_come_behind_those_of_the_scene() -> None:
    Path("a.obj").write_text("what 1\n" + TRIANGLE + "f 1 2 3\nf 1 2 3\n")
    Image.fromarray(np.zeros((8, 8, 4), np.uint8), "CMYK").save("ink.jpg")
    unmapped = (
        "a.obj:7: face: has no texture coordinates, but its material has a texture, which is that of u = v = 0 all "
        "over (2 times, also in line 8)"
    )
    _, warnings = read_surfaces(mesh("a.obj"), mesh("a.obj", textured("ink.jpg")), ball(textured("ink.jpg"), "<x/>"))
    ink = "material_textured texture: name 'ink.jpg' is CMYK, which is taken for RGB without a colour profile"
    assert warnings == [
        f"scene.xml:{FIRST + 1}: {ink} (2 times, also in line {FIRST + 2})",
        f"scene.xml:{FIRST + 2}: sphere transform: unknown element <x> ignored",
        "a.obj:1: unknown keyword 'what' ignored",
        unmapped,
    ]
    assert read_surfaces(mesh("a.obj"))[1] == ["a.obj:1: unknown keyword 'what' ignored"]
    with pytest.warns(SceneWarning) as told:
        cltrace.load("scene.xml")
    assert [str(w.message) for w in told] == ["a.obj:1: unknown keyword 'what' ignored"]


# --- Limits


def test_a_mesh_named_again_adds_so_many_triangles_only() -> None:
    named = mesh("a.obj"), mesh("sub/b.obj"), mesh("a.obj")
    scene, _ = read_surfaces(*named, instances=1)
    assert len(scene.meshes) == 3
    with pytest.raises(SceneError) as caught:
        read_surfaces(*named, instances=0)
    assert str(caught.value) == (
        f"scene.xml:{FIRST + 2}: surfaces: must have at most 0 triangles of files that are named again; "
        "--limit instances=N or CLTRACE_LIMITS allows more"
    )


def test_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surfaces.MeshReader, "most", 2)
    assert faults_of(*[mesh("a.obj")] * 3) == [f"scene.xml:{FIRST + 2}: surfaces: must be at most 2 meshes"]
    monkeypatch.setattr(surfaces, "MAX_TRIANGLES", 3)
    assert len(scene_of(mesh("a.obj"), mesh("sub/b.obj")).meshes) == 2
    (fault,) = faults_of(mesh("sub/b.obj"), mesh("sub/b.obj"))
    assert fault == f"scene.xml:{FIRST + 1}: surfaces: must be at most 3 triangles and 67108864 vertices of meshes"
    monkeypatch.setattr(surfaces, "MAX_VERTICES", 5)
    (fault,) = faults_of(mesh("a.obj"), mesh("a.obj"))
    assert fault == f"scene.xml:{FIRST + 1}: surfaces: must be at most 3 triangles and 5 vertices of meshes"
    monkeypatch.setattr(files, "MAX_TEXELS", 15)
    assert faults_of(ball(textured("wall.png")), ball(textured("sub/sky.png"))) == [
        f"scene.xml:{FIRST + 1}: material_textured texture: name 'sub/sky.png' must not have more than 7 pixels with "
        "the textures before it"
    ]
    monkeypatch.setattr(limits, "MESH_BYTES", 10)
    words = "must not be larger than 10 bytes; --limit mesh-bytes=N or CLTRACE_LIMITS allows more"
    assert faults_of(mesh("a.obj")) == [f"scene.xml:{FIRST}: mesh: name 'a.obj' {words}"]


@pytest.mark.parametrize(("names", "few"), [(["sub/b.obj", "a.obj"], 64), (["a.obj", "./a.obj", ".//a.obj"], 1)])
def test_pairs_of_lights_and_surfaces(names: list[str], few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A few lights may have any number of surfaces, unless a mesh is placed again."""
    monkeypatch.setattr(reader, "MAX_PAIRS", 3 * few)
    scene = HEAD + "".join(map(mesh, names)) + "</surfaces></scene>"
    lamp = '<point_light><color r="1" g="1" b="1"/><position x="0" y="0" z="9"/></point_light>'
    Path("scene.xml").write_text(scene.replace("<lights/>", f"<lights>{lamp * few}</lights>"))
    assert len(read("scene.xml")[0].lights) == few
    Path("scene.xml").write_text(scene.replace("<lights/>", f"<lights>{lamp * (few + 1)}</lights>"))
    with pytest.raises(SceneError) as error:
        read("scene.xml")
    assert str(error.value) == (
        f"scene.xml:5: lights: must be at most {3 * few} pairs of a light and a surface, got {few + 1} lights, with "
        "all members of soft ones, and 3 surfaces; --limit pairs=N or CLTRACE_LIMITS allows more"
    )
    # Larger files may have more in proportion: each counts once, by whatever names.
    size = sum(path.stat().st_size for path in {Path(name).resolve() for name in ("scene.xml", *names)})
    monkeypatch.setattr(reader, "PAIRS_BYTES", size - 1)
    with pytest.raises(SceneError):
        read("scene.xml")
    monkeypatch.setattr(reader, "PAIRS_BYTES", size // 2)
    assert len(read("scene.xml")[0].lights) == few + 1
