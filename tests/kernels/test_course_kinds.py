"""The kinds of scenes that the course has, from files made here: rooms of meshes, glass cones, textures, transforms.

A kind is a few lines of XML with OBJ and PNG files beside them, all of them small enough for the reference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture
from solids import Solid, ball, box, octahedron, outwards

import cltrace
from cltrace import Renderer, Scene
from cltrace.run.devices import Device
from cltrace.students.check import check

pytestmark = pytest.mark.slow

OUTPUTS = ("rgb8", "color", "normal", "depth", "id", "primitive", "uv", "shadow_rays")
HEAD = """<?xml version="1.0" standalone="no" ?>
<!DOCTYPE scene SYSTEM "scene.dtd">
<scene output_file="kind.png">
  <background_color r="0.1" g="0.1" b="0.3"/>
  <camera>
    <position {eye}/><lookat {at}/><up x="0" y="1" z="0"/>
    <horizontal_fov angle="{angle}"/><resolution horizontal="{size}" vertical="{size}"/><max_bounces n="{bounces}"/>
  </camera>
"""
AMBIENT = '<ambient_light><color r="1" g="1" b="1"/></ambient_light>'


def xyz(*v: float) -> str:
    return 'x="{}" y="{}" z="{}"'.format(*v)


def point(position: Sequence[float], color: Sequence[float] = (0.6, 0.6, 0.6)) -> str:
    return f"<point_light>{rgb(color)}<position {xyz(*position)}/></point_light>"


def parallel(direction: Sequence[float], color: Sequence[float] = (1, 1, 1)) -> str:
    return f"<parallel_light>{rgb(color)}<direction {xyz(*direction)}/></parallel_light>"


def rgb(color: Sequence[float]) -> str:
    return '<color r="{}" g="{}" b="{}"/>'.format(*color)


def material(
    paint: Sequence[float] | str = (0.7, 0.7, 0.7), ks: float = 0.5, r: float = 0, t: float = 0, iof: float = 0.0
) -> str:
    """paint: a colour, or the name of a texture."""
    inner, kind = (f'<texture name="{paint}"/>', "textured") if isinstance(paint, str) else (rgb(paint), "solid")
    finish = f'<phong ka="0.3" kd="0.9" ks="{ks}" exponent="50"/><reflectance r="{r}"/><transmittance t="{t}"/>'
    return f'<material_{kind}>{inner}{finish}<refraction iof="{iof}"/></material_{kind}>'


def mesh(name: str, look: str, *steps: str) -> str:
    return f'<mesh name="{name}">{look}{placed(*steps)}</mesh>'


def sphere(center: Sequence[float], radius: float, look: str, *steps: str) -> str:
    return f'<sphere radius="{radius}"><position {xyz(*center)}/>{look}{placed(*steps)}</sphere>'


def placed(*steps: str) -> str:
    return f"<transform>{''.join(steps)}</transform>" if steps else ""


def write_obj(name: str, solid: Solid, normals: np.ndarray | None = None, uv: np.ndarray | None = None) -> None:
    """A file as modellers write it: a normal and a texture coordinate for each corner, where they are given."""
    lines = ["# made here", "mtllib none.mtl", "o thing"]
    lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in solid.vertices]
    lines += [] if uv is None else [f"vt {u:.6f} {v:.6f}" for u, v in uv.reshape(-1, 2)]
    lines += [] if normals is None else [f"vn {x:.4f} {y:.4f} {z:.4f}" for x, y, z in normals.reshape(-1, 3)]
    for k, face in enumerate(solid.faces.tolist()):
        corners = []
        for c, vertex in enumerate(face):
            places = ["", ""]
            for i, rows in enumerate((uv, normals)):
                if rows is not None:
                    places[i] = str((vertex if rows.ndim == 2 else 3 * k + c) + 1)
            corners.append(f"{vertex + 1}/{places[0]}/{places[1]}".rstrip("/"))
        lines.append("f " + " ".join(corners))
    Path(name).write_text("\r\n".join(lines) + "\r\n", newline="")


def room() -> Solid:
    """A box seen from inside, of which every third face is wound the other way."""
    solid = box((-3, -2, -6), (3, 2, 2))
    return Solid(solid.vertices, np.where(np.arange(12)[:, None] % 3, solid.faces[:, ::-1], solid.faces))


def flat_normals(solid: Solid) -> np.ndarray:
    """(f, 3, 3): towards the middle, along each face's normal."""
    a, b, c = (solid.vertices[solid.faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    n *= np.sign(((solid.vertices.mean(axis=0) - a) * n).sum(axis=1) / np.linalg.norm(n, axis=1))[:, None]
    return np.repeat((n / np.linalg.norm(n, axis=1)[:, None])[:, None], 3, axis=1)


def box_uv(solid: Solid) -> np.ndarray:
    """(f, 3, 2): the two coordinates along a face, so that a texture repeats."""
    corners = solid.vertices[solid.faces]
    flat = np.ptp(corners, axis=1).argmin(axis=1)
    kept = np.array([[k for k in range(3) if k != f] for f in flat])
    return np.take_along_axis(corners, kept[:, None, :], axis=2) / 2


def cone(sides: int = 8) -> tuple[Solid, np.ndarray]:
    """About the y axis, with a floor, and the smooth normals of its corners."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([np.cos(angle), 0 * angle - 1, np.sin(angle)], 1)
    vertices = np.concatenate([rim, [(0, 1, 0), (0, -1, 0)]])
    k = np.arange(sides)
    up = np.stack([k, (k + 1) % sides, 0 * k + sides], 1)
    down = np.stack([k, (k + 1) % sides, 0 * k + sides + 1], 1)
    solid = outwards(Solid(vertices, np.concatenate([up, down])))
    normals = np.empty((2 * sides, 3, 3))
    normals[:sides] = vertices[solid.faces[:sides]] * (2, 0, 2) + (0, 1, 0)
    normals[sides:] = (0, -1, 0)
    return solid, normals


def write_textures() -> None:
    i, j = np.meshgrid(np.arange(8), np.arange(8))
    board = np.where(((i + j) % 2)[..., None], (230, 60, 40), (240, 240, 220)).astype(np.uint8)
    Picture.fromarray(board).save("board.png")
    ramp = np.stack([i * 30, j * 30, 0 * i + 90], -1).astype(np.uint8)
    Picture.fromarray(ramp).save("ramp.png")
    Picture.fromarray(ramp[..., 0]).save("grey.jpg")


def write(name: str, lights: Sequence[str], surfaces: Sequence[str], eye: Sequence[float] = (0, 0, 1.5),
          at: Sequence[float] = (0, 0, -3), angle: float = 40, size: int = 24, bounces: int = 4) -> Scene:  # fmt: skip
    head = HEAD.format(eye=xyz(*eye), at=xyz(*at), angle=angle, size=size, bounces=bounces)
    inner = "\n".join(["<lights>", *lights, "</lights>", "<surfaces>", *surfaces, "</surfaces>"])
    Path(name).write_text(f"{head}{inner}\n</scene>\n")
    return cltrace.load(name)


def kind4() -> Scene:
    """A room of a mesh and two lamps in it."""
    write_obj("room.obj", room(), flat_normals(room()))
    write_obj("table.obj", box((-1, -2, -4), (1, -1.25, -2.5)))
    lights = [AMBIENT, point((1.5, 1.5, -1)), point((-2, 0.5, 0.5), (0.5, 0.4, 0.3))]
    return write("4.xml", lights, [mesh("room.obj", material()), mesh("table.obj", material((0.8, 0.5, 0.2)))])


def kind5() -> Scene:
    """A mirror in the room."""
    write_obj("room.obj", room(), flat_normals(room()))
    lights = [AMBIENT, point((1.5, 1.5, -1)), point((-2, 0.5, 0.5), (0.5, 0.4, 0.3))]
    balls = [
        sphere((0.5, -1, -3), 1, material((0.2, 0.2, 0.2), r=0.8)),
        sphere((-1.5, -1.5, -2), 0.5, material((0, 1, 0))),
    ]
    return write("5.xml", lights, [mesh("room.obj", material((0.4, 0.6, 0.9))), *balls])


def kind6() -> Scene:
    """Textures on the room's walls, seen through a ball of glass, too."""
    write_textures()
    write_obj("room.obj", room(), flat_normals(room()), box_uv(room()))
    balls = [sphere((0.25, -0.5, -2), 1, material((0.9, 0.9, 1), r=0.1, t=0.8, iof=1.5))]
    return write("6.xml", [AMBIENT, point((1.5, 1.5, -1))], [mesh("room.obj", material("board.png", ks=0)), *balls])


def kind7() -> Scene:
    """Three balls, each of which mirrors and lets through, and a plate behind them."""
    write_obj("wall.obj", box((-4, -4, -8), (4, 4, -7.5)))
    balls = [
        sphere((k - 1, 0.25 * k, -2 - k), 0.9, material(color, r=0.2 + 0.2 * k, t=0.6 - 0.2 * k, iof=1.2 + 0.3 * k))
        for k, color in enumerate([(1, 0, 0), (0, 1, 0), (0, 0, 1)])
    ]
    return write("7.xml", [AMBIENT, parallel((0.5, -1, -1))], [*balls, mesh("wall.obj", material((0.9, 0.8, 0.4)))])


def kind8() -> Scene:
    """A cone of glass that mirrors, too, and a ball with a texture."""
    write_textures()
    solid, normals = cone()
    write_obj("cone.obj", solid, normals)
    surfaces = [
        mesh("cone.obj", material((0.6, 0.6, 0.9), r=0.5, t=0.4, iof=1.5), f"<translate {xyz(-0.75, 0, -2)}/>"),
        sphere((0.75, -0.25, -3), 1, material("ramp.png"), '<rotateY theta="30"/>', f"<scale {xyz(1, 1.25, 0.75)}/>"),
        sphere((0, -101.25, -3), 100, material("board.png", ks=0)),
    ]
    return write("8.xml", [AMBIENT, parallel((-1, -1, -1)), point((2, 3, 1))], surfaces)


def kind9() -> Scene:
    """Seven meshes and five balls, twelve transforms, three textures, in one room, seen aslant."""
    write_textures()
    solid, normals = cone()
    Path("parts").mkdir(exist_ok=True)
    write_obj("room.obj", room(), None, box_uv(room()))
    write_obj("parts/cone.obj", solid, normals)
    write_obj("parts/ball.obj", ball(1), ball(1).vertices, ball(1).vertices[:, :2] / 2 + 0.5)
    write_obj("gem.obj", octahedron())
    small = f"<scale {xyz(0.5, 0.5, 0.5)}/>"
    surfaces = [
        sphere((-2, -1.5, -4), 0.5, material("grey.jpg"), f"<translate {xyz(0.25, 0, 0.5)}/>"),
        mesh("room.obj", material("board.png")),
        mesh("parts/cone.obj", material((0.9, 0.4, 0.1)), f"<translate {xyz(-1, -1.5, -3)}/>", small),
        mesh(
            "parts/cone.obj", material(t=0.7, iof=1.3), f"<translate {xyz(1, -1, -2)}/>", '<rotateZ theta="40"/>', small
        ),
        sphere((1, 1, -5), 0.75, material(r=0.6), f"<scale {xyz(1, 0.5, 1)}/>"),
        sphere((0, 0, 0), 1, material("ramp.png"), f"<translate {xyz(0, 1, -4)}/>", '<rotateX theta="-90"/>', small),
        mesh(
            "parts/ball.obj",
            material("ramp.png"),
            f"<translate {xyz(-1.5, 0.5, -3)}/>",
            f"<scale {xyz(0.5, -0.75, 0.5)}/>",
        ),
        mesh("parts/ball.obj", material((1, 1, 0.8), r=0.2, t=0.6, iof=1.5), f"<translate {xyz(0.5, -1, -1)}/>", small),
        mesh("gem.obj", material((0.2, 0.9, 0.5), r=0.3), f"<translate {xyz(2, -1, -4)}/>", '<rotateY theta="15"/>'),
        sphere((-0.5, -1.75, -1.5), 0.25, material((0.9, 0.1, 0.9)), f"<translate {xyz(0, 0, -0.25)}/>"),
        sphere((2.25, 1.25, -3), 0.5, material(t=0.5, iof=1.1), f"<scale {xyz(1, 1, 1)}/>"),
        mesh(
            "gem.obj",
            material((0.9, 0.9, 0.2)),
            f"<translate {xyz(-2.5, 1.25, -5)}/>",
            f"<scale {xyz(0.3, 0.6, 0.3)}/>",
        ),
    ]
    lights = [AMBIENT, point((2.5, 1.75, -1)), point((-2.5, 1.5, 0), (0.3, 0.3, 0.5)), parallel((0, -1, 0))]
    return write("9.xml", lights, surfaces, eye=(0.5, 0.25, 1.75), at=(-0.25, -0.5, -3), angle=45, size=28)


KINDS: list[Callable[[], Scene]] = [kind4, kind5, kind6, kind7, kind8, kind9]


@pytest.fixture(autouse=True)
def _in_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: str(kind.__name__))
def test_the_reference_draws_the_same(device: Device, kind: Callable[[], Scene]) -> None:
    """By the kernel that such a scene gets by itself."""
    scene = kind()
    image = Renderer(scene, device, "accurate", ("rgb8", "id")).render()
    report = check(scene, image, "accurate", image.id.size)
    assert report.wrong_ids == 0
    assert report.ok, str(report)
    assert len(np.unique(image.rgb8.reshape(-1, 3), axis=0)) > 60
    assert len(np.unique(image.id)) >= (8 if kind is kind9 else 2)


def test_all_kernels_draw_the_same(device: Device) -> None:
    """With all features and outputs, and in packets of one pixel."""
    scene = kind9()
    lean = Renderer(scene, device, "accurate", ("rgb8", "id")).render()
    full = Renderer(scene, device, "accurate", OUTPUTS, keep=("features",)).render()  # type: ignore[arg-type]
    one = Renderer(scene, device, "accurate", OUTPUTS, keep=("features",), width=1).render()  # type: ignore[arg-type]
    for name in ("rgb8", "id"):
        assert np.array_equal(getattr(full, name), getattr(lean, name)), name
    for name in ("id", "depth", "primitive", "uv"):
        assert np.array_equal(getattr(full, name), getattr(one, name)), name


def test_the_files_say_what_is_meant() -> None:
    """Numbers of surfaces are those of the file, in which balls and meshes mix; transforms are from last to first."""
    scene = kind9()
    assert [mesh.number for mesh in scene.meshes] == [1, 2, 3, 6, 7, 8, 11]
    assert scene.sphere_numbers.tolist() == [0, 4, 5, 9, 10]
    assert len({id(mesh.geometry) for mesh in scene.meshes}) == 4
    assert len(scene.textures) == 3
    tip = scene.meshes[2].vertices[8]  # of the cone: (0, 1, 0), halved, turned by 40 degrees, moved
    assert np.allclose(
        tip, (1 - 0.5 * np.sin(np.radians(40)), -1 + 0.5 * np.cos(np.radians(40)), -2), rtol=0, atol=1e-12
    )
    mirrored = scene.meshes[3]
    assert (mirrored.front == -1).all() or (mirrored.front == 1).all()
    assert np.linalg.det(mirrored.to_world[:, :3]) < 0
    outside = mirrored.vertices[mirrored.geometry.faces].mean(axis=1) - mirrored.to_world[:, 3]
    corners = mirrored.vertices[mirrored.geometry.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (mirrored.front * (normal * outside).sum(axis=1) > 0).all()
