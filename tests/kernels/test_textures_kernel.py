"""Textures in the kernel: where a point is on one, and the colour there, against the reference and by hand."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from conftest import world
from stress_cases import picture

import cltrace
from cltrace import Camera, Material, Mesh, Orthographic, Renderer, Scene
from cltrace.plan.materials import packed_textures
from cltrace.plan.plan import Plan
from cltrace.plan.request import Request
from cltrace.plan.shapes.mesh import PackedTriangles, corner_attributes
from cltrace.reference.trace import primary_ray, trace
from cltrace.run.devices import Device
from cltrace.scene import MATERIAL, SPHERE, Geometry, PlacedMesh

pytestmark = pytest.mark.slow


BALL = Scene.from_spheres(Camera((1, 2, 5), (0, 0, 0), horizontal_fov=16, resolution=(40, 30)), [], [(0, 0, 0)], 1.0)


def coordinates(scene: Scene) -> np.ndarray:
    """What the reference's normals say of a scene of plain spheres, (h, w, 2); 0 where nothing is met."""
    width, height = scene.camera.resolution
    basis, uv = np.array(scene.camera.basis()), np.zeros((height, width, 2))
    for y in range(height):
        for x in range(width):
            at = trace(world(scene), primary_ray(scene.camera, x, y))[1]
            if at:
                n = tuple(at.normal) @ basis
                uv[y, x] = 0.5 + np.arctan2(n[0], n[2]) / (2 * np.pi), np.arctan2(np.hypot(n[0], n[2]), n[1]) / np.pi
    return uv


def painted(device: Device, precision: str, images: list[np.ndarray], which: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """What white is at (n, 2) coordinates of those images, which (n,), -1 for none. (n, 3).

    Each is a triangle that fills a pixel, and has these coordinates at all corners.
    """
    materials = [Material((1, 1, 1), ka=1, kd=0, ks=0, texture=image) for image in (*images, None)]
    camera = Orthographic((0, 0, 5), (0, 0, 0), height=1, resolution=(len(uv), 1))
    meshes = []
    for k in set(which.tolist()):
        x = np.flatnonzero(which == k)
        corners = [(-0.5, -0.6, 0), (0.5, -0.6, 0), (0, 3, 0)] + (x - (len(uv) - 1) / 2)[:, None, None] * (1, 0, 0)
        faces = np.arange(3 * len(x)).reshape(-1, 3)
        meshes.append(Mesh(corners.reshape(-1, 3), faces, uv=np.repeat(uv[x], 3, axis=0), material=materials[k]))
    scene = Scene.from_meshes(camera, [cltrace.ambient_light((1, 1, 1))], meshes)
    return picture(scene, device, precision).color[0]


def exact(image: np.ndarray, u: float, v: float) -> list[float]:
    """The colour there by the definition, without rounding."""
    x, y = Fraction(u) * image.shape[1], Fraction(v) * image.shape[0]
    i, j = math.floor(x), math.floor(y)
    parts = ((i, 1 - (x - i)), (i + 1, x - i)), ((j, 1 - (y - j)), (j + 1, y - j))
    full = np.iinfo(image.dtype).max
    texels = [
        [share * other * int(part) for part in image[row % image.shape[0], column % image.shape[1]]]
        for column, share in parts[0]
        for row, other in parts[1]
    ]
    return [float(sum(part) / full) for part in zip(*texels, strict=True)]


@pytest.mark.parametrize("precision", ["accurate", "double", "single"])
def test_coordinates_of_spheres(device: Device, precision: str) -> None:
    want = coordinates(BALL)
    first = cltrace.render(BALL, device, precision, ("uv", "id", "primitive"))
    assert first.uv.shape == (30, 40, 2)
    assert first.uv.dtype == np.float32
    # u's error grows towards the poles, where all longitudes are near each other.
    errors = np.abs(first.uv - want) * np.stack([np.sin(np.pi * want[..., 1]), np.ones_like(want[..., 1])], axis=-1)
    assert errors.max() <= (1e-6 if precision == "single" else 2.0**-24)
    assert (first.uv[first.id < 0] == 0).all()
    assert (first.uv[first.id >= 0] > 0).all()
    assert (first.primitive == -1).all()
    one = Renderer(BALL, device, precision, ("uv",), width=1).render()
    assert np.array_equal(one.uv, first.uv)


def test_poles_and_seam(device: Device) -> None:
    """Along the axes the coordinates are exact, from all six sides."""
    ways = {
        (0, 0, 1): (0.5, 0.5),
        (1, 0, 0): (0.75, 0.5),
        (0, 0, -1): (1, 0.5),
        (-1, 0, 0): (0.25, 0.5),
        (0, 1, 0): (0.5, 0),
        (0, -1, 0): (0.5, 1),
    }
    for way, want in ways.items():
        up = (0, 0, 1) if way[1] else (0, 1, 0)
        camera = Camera(tuple(5 * x for x in way), (0, 0, 0), up, 10, (1, 1))
        scene = Scene.from_spheres(camera, [], [(0, 0, 0)], 1.0)
        for precision in ("accurate", "single"):
            assert cltrace.render(scene, device, precision, ("uv",)).uv[0, 0].tolist() == list(want), way


FOUR = np.array([[(0, 0, 0), (200, 100, 51)], [(100, 100, 100), (40, 80, 255)]], np.uint8)


@pytest.mark.parametrize("precision", ["accurate", "double"])
def test_colours_by_hand(device: Device, precision: str) -> None:
    """Texels, halves between them, and how textures repeat."""
    one = np.array([[(255, 51, 0)]], np.uint8)
    deep = np.array([[(65535, 13107, 257), (0, 0, 0)]], np.uint16)
    cases = [
        (FOUR, (0, 0), (0, 0, 0)),
        (FOUR, (0.25, 0), (100, 50, 25.5)),
        (FOUR, (0.5, 0), (200, 100, 51)),
        (FOUR, (0.75, 0), (100, 50, 25.5)),  # between the last column and the first
        (FOUR, (1, 0), (0, 0, 0)),
        (FOUR, (2.5, 3), (200, 100, 51)),
        (FOUR, (-0.5, 0), (200, 100, 51)),
        (FOUR, (-0.25, -2), (100, 50, 25.5)),
        (FOUR, (0, 0.5), (100, 100, 100)),  # v goes down from the top row
        (FOUR, (0, 0.75), (50, 50, 50)),
        (FOUR, (0, 1), (0, 0, 0)),
        (FOUR, (0.5, 0.5), (40, 80, 255)),
        (FOUR, (0.25, 0.25), (85, 70, 101.5)),
        (FOUR, (-1e-30, -1e-30), (0, 0, 0)),
        (FOUR, (2.0**100, -(2.0**127)), (0, 0, 0)),
        (FOUR, (2.0**22 + 0.5, -(2.0**22) - 0.5), (40, 80, 255)),
        (one, (0.3, -7.7), (255, 51, 0)),
        (one, (1e30, 0.999), (255, 51, 0)),
        (deep, (0, 5), (255, 51, 1)),
        (deep, (1.25, 0.1), (127.5, 25.5, 0.5)),
        (None, (0.25, 0.25), (255, 255, 255)),
    ]
    images = [FOUR, one, deep]
    which = np.array([next((i for i, image in enumerate(images) if image is case[0]), -1) for case in cases])
    uv, want = np.array([case[1] for case in cases], float), np.array([case[2] for case in cases]) / 255
    assert np.abs(painted(device, precision, images, which, uv) - want).max() <= 2.0**-24


@pytest.mark.parametrize("precision", ["accurate", "double"])
def test_colours_are_right(device: Device, precision: str) -> None:
    """Any size, depth and place, in one packet, against the definition; at a texel, it is its own to the byte."""
    random = np.random.default_rng(2)
    images = [
        random.integers(0, np.iinfo(dtype).max + 1, (*size, 3)).astype(dtype)
        for dtype in (np.uint8, np.uint16)
        for size in ((1, 7), (300, 1), (49, 50), (129, 1000))
    ]
    n = 400
    which = random.integers(0, len(images), n)
    uv = random.uniform(-1.5, 1.5, (n, 2)) * random.choice((1, 1, 1, 30), (n, 1))
    # Multiples of eighths of texels, which are not doubles where the side is no power of two, and texels themselves.
    side = np.array([images[k].shape[1::-1] for k in which])
    uv[::3] = np.rint(uv[::3] * 8 * side[::3]) / (8 * side[::3])
    uv[1::3] = np.rint(uv[1::3] * side[1::3]) / side[1::3]
    want = np.array([exact(images[k], *place) for k, place in zip(which, uv.tolist(), strict=True)])
    got = painted(device, precision, images, which, uv)
    assert np.abs(got - want).max() <= 2.0**-22


def globe(texture: int = 0, images: tuple[np.ndarray, ...] = (FOUR,), to_object: np.ndarray | None = None) -> Scene:
    """A ball in ambient light that has an image."""
    spheres, materials = np.zeros(1, SPHERE), np.zeros(2, MATERIAL)
    spheres["radius"], spheres["to_object"] = 1, -1 if to_object is None else 0
    materials["color"] = materials["ka"] = materials["kd"] = materials["index"] = 1
    materials["texture"] = texture, 0
    maps = np.empty((0, 3, 3)) if to_object is None else to_object[None]
    return Scene(BALL.camera, [cltrace.ambient_light((1, 1, 1))], spheres, materials, to_object=maps, textures=images)


@pytest.mark.parametrize("precision", ["accurate", "double", "single"])
def test_a_globe(device: Device, precision: str) -> None:
    """The picture has the colours of its own coordinates; a turned one those of its own axes."""
    a, b = math.cos(0.7), math.sin(0.7)
    turned = np.array([(a, 0, b), (0, 1, 0), (-b, 0, a)]) @ np.array([(1, 0, 0), (0, a, -b), (0, b, a)])
    image = np.random.default_rng(4).integers(0, 256, (6, 9, 3), np.uint8)
    for to_object in (None, turned):
        scene = globe(0, (image,), to_object)
        drawn = cltrace.render(scene, device, precision, ("rgb8", "color", "uv", "id"))
        hit = drawn.id >= 0
        want = np.array([exact(image, *uv) for uv in drawn.uv[hit].tolist()])
        assert np.abs(drawn.color[hit] - want).max() <= 1e-5  # as uv is in float
        assert (drawn.color[~hit] == 0).all()
        other = Renderer(scene, device, precision, ("color",), width=1).render()
        assert np.abs(other.color - drawn.color).max() <= 2e-6
    plain = coordinates(BALL)[hit]
    longitude, colatitude = (2 * plain[:, 0] - 1) * np.pi, plain[:, 1] * np.pi
    across = np.sin(colatitude)
    normal = np.stack([across * np.sin(longitude), np.cos(colatitude), across * np.cos(longitude)], axis=1) @ turned.T
    assert np.abs(np.arccos(normal[:, 1]) / np.pi - drawn.uv[hit][:, 1]).max() <= 1e-6


def test_only_textures_that_show_are_packed() -> None:
    """A texture that several materials have is there once; one of materials that no surface has is not."""
    images = tuple(np.full((2, 3, 3), k, dtype) for k, dtype in enumerate((np.uint8, np.uint16, np.uint8)))
    textures = packed_textures(images, np.array([2, 0, -1, 2, 1]), np.array([0, 4, 3, 2, 2]))
    assert textures["texture"].tolist() == [[3, 2, 0, 65535], [3, 2, 36, 255]]
    assert textures["texture_of"].tolist() == [1, -1, -1, 1, 0]
    assert textures["texel"][:36].view(np.uint16).tolist() == [1] * 18
    assert textures["texel"][36:54].tolist() == [2] * 18
    assert len(textures["texel"]) == 54 + 8


def test_what_needs_textures() -> None:
    assert Plan.of_scene(globe(), Request()).values["textures"]
    for plan in (
        Plan.of_scene(globe(-1), Request()),  # only a material that nothing has
        Plan.of_scene(globe(), Request(outputs=("id", "normal", "depth"))),
    ):
        assert not plan.values["textures"]
        assert not plan.values["mapped"]
        assert len(plan.arrays["texel"]) == 1
    seen = Plan.of_scene(globe(), Request(outputs=("uv",)))
    assert seen.values["mapped"]
    assert not seen.values["textures"]


def test_another_camera_keeps_the_texels(device: Device) -> None:
    renderer = Renderer(globe(), device)
    moved = renderer.look(Camera((5, 0, 0), (0, 0, 0), horizontal_fov=16, resolution=(40, 30)))
    assert moved.plan.arrays["texel"] is renderer.plan.arrays["texel"]
    assert not np.array_equal(moved.render().rgb8, renderer.render().rgb8)


def test_what_corners_of_meshes_share_is_there_once() -> None:
    """Four meshes; the first and the third have one geometry, the last one has no normals and the second no uv."""
    random = np.random.default_rng(0)

    def geometry(faces: int, normals: int, uvs: int, holes: bool) -> Geometry:
        of = [random.integers(0, n, (faces, 3)) if n else np.full((faces, 3), -1) for n in (normals, uvs)]
        if holes:
            of[0][::3] = of[1][1::3] = -1
        rows = [random.normal(size=(n, width)) for n, width in ((9, 3), (normals, 3), (uvs, 2))]
        return Geometry(rows[0], random.integers(0, 9, (faces, 3)), 37 * rows[1], of[0], rows[2], of[1])

    one = geometry(7, 5, 4, False)
    shapes = one, geometry(11, 6, 0, True), one, geometry(5, 0, 6, True)
    meshes = tuple(PlacedMesh(shape, random.normal(size=(3, 4)), 0, i) for i, shape in enumerate(shapes))
    at = corner_attributes(meshes, PackedTriangles.of(meshes, False, once=False), "accurate", True)
    assert (at["corner_normal"].shape, at["corner_uv"].shape) == ((11, 4), (10, 2))
    assert np.array_equal(at["normal_face"][:7, :3], at["normal_face"][18:25, :3])
    assert at["normal_face"][:, 3].tolist() == [0] * 7 + [-1, 1, 1] * 3 + [-1, 1] + [2] * 7 + [-1] * 5
    assert at["uv_face"][:, 3].tolist() == [0] * 7 + [-1] * 11 + [2] * 7 + [3, -1, 3, 3, -1]
    assert np.array_equal(at["corner_normal"][:5, :3], one.normals)
