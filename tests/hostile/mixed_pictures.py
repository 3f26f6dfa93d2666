"""Pictures of spheres, ellipsoids and meshes together against the exact oracle: what is seen in mirrors and glass.

As in bounced_pictures.py and mesh_pictures.py, every surface has a colour that names it, and each ray goes on once.
Here a ray that leaves a triangle may meet a sphere, and one that leaves a sphere may meet a triangle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from surface_rays import along

from cltrace.base.arithmetic import Floats
from cltrace.oracle.search import Ids, Kinds, Rays
from cltrace.oracle.shapes import Spheres, Triangles
from cltrace.scene import MATERIAL, Camera, Geometry, Mesh, PlacedMesh, Scene, ambient_light

from .bounced_pictures import DIGITS, names, second_rays
from .mesh_pictures import Seen, Verdict, left_from, onward_from, verdict
from .mesh_regimes import HALF_ANGLE, SIZE, Shape, Size, grid, icosphere, soup
from .mesh_regimes import scene_of as mesh_scene

# ------------------------------------------------------------------------------------------------------------- regimes


def _scene(shapes: Sequence[Shape], centers: ArrayLike, radii: ArrayLike, maps: Floats, camera: Camera) -> Scene:
    meshes = [Mesh(vertices, faces) for vertices, faces in shapes]
    return Scene.from_spheres(camera, (), centers, radii, transform=maps, meshes=meshes)


def _camera(rng: np.random.Generator, size: Size, way: Floats, distance: float) -> Camera:
    """From there, towards some place near 0, 0, 0; wide where it is near."""
    eye = np.round(way / np.linalg.norm(way) * distance * 16) / 16
    angle = HALF_ANGLE if distance > 4 else 60
    return Camera(tuple(eye), tuple(0.3 * rng.normal(size=3)), tuple(rng.normal(size=3)), angle, size, max_bounces=0)


def _bent(rng: np.random.Generator, count: int, share: float = 0.5) -> Floats:
    """Half of them are ellipsoids."""
    maps = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
    for i in np.flatnonzero(rng.random(count) < share):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        maps[i] = turn * 10.0 ** rng.uniform(-0.5, 0.3, 3)
    return maps


def balls_on_a_floor(rng: np.random.Generator, size: Size) -> Scene:
    """A floor and two walls of triangles, and balls that touch some of them exactly; all of whole numbers."""
    side = np.arange(-4, 5, 2.0)
    x, y = np.meshgrid(side, side)
    flat = np.stack([x, y, np.full(x.shape, -2.0)], axis=2)
    shapes = [grid(np.roll(flat, k, axis=2), rng) for k in range(3)]
    centers = rng.integers(-1, 3, (12, 3)).astype(float)
    radii = np.minimum(centers.min(axis=1) + 2, rng.choice([1, 2], 12))
    camera = _camera(rng, size, rng.uniform(0.3, 1, 3), 12)  # before the floor, not behind it
    return _scene(shapes, centers, radii, _bent(rng, 12, 0), camera)


def corners_on_spheres(rng: np.random.Generator, size: Size) -> Scene:
    """Triangles between points of two equal spheres, exactly, and balls with their corners as centres."""
    points = np.array([(a, b, c) for a in range(-9, 10) for b in range(-9, 10) for c in range(-9, 10)])
    points = points[(points**2).sum(axis=1) == 81] / 4  # 9/4 from the middle
    corners = points[rng.integers(len(points), size=(4, 3))]
    some = points[rng.integers(len(points), size=6)]
    centers, radii = np.vstack([np.zeros((2, 3)), some]), np.array([2.25, 2.25, *rng.choice([0.25, 0.5], 6)])
    return _scene([soup(corners)], centers, radii, _bent(rng, 8, 0), _camera(rng, size, rng.normal(size=3), 1))


def eggs_in_a_mesh(rng: np.random.Generator, size: Size) -> Scene:
    """Ellipsoids and spheres that stick through a closed mesh, whose corners are on one of them but for rounding."""
    vertices, faces = icosphere(2)
    centers, radii, maps = rng.normal(size=(9, 3)), rng.uniform(0.3, 1.2, 9), _bent(rng, 9)
    centers[0], radii[0], maps[0] = 0, 1.5, np.eye(3)
    # Of the first one the faces are partly within the sphere.
    shapes = [(vertices * 1.52, faces), (vertices @ maps[1].T * radii[1] + centers[1], faces)]
    return _scene(shapes, centers, radii, maps, _camera(rng, size, rng.normal(size=3), rng.choice([0.7, 12])))


def far_from_the_origin(rng: np.random.Generator, size: Size) -> Scene:
    """The same 1e7 away, where the centres' and the corners' last digits are 1e-9."""
    scene, offset = eggs_in_a_mesh(rng, size), 1e7 * rng.choice([-1, 1], 3)
    x, y, z = (np.array(scene.camera.position) + offset).tolist()
    camera = replace(scene.camera, position=(x, y, z), lookat=tuple((np.array(scene.camera.lookat) + offset).tolist()))
    spheres = scene.spheres.copy()
    spheres["center"] += offset
    meshes = tuple(
        PlacedMesh(Geometry(m.vertices + offset, m.geometry.faces), material=m.material, number=m.number)
        for m in scene.meshes
    )
    return replace(scene, camera=camera, spheres=spheres, meshes=meshes)


def among_spheres(rng: np.random.Generator, size: Size) -> Scene:
    """That of mesh_regimes.py."""
    return mesh_scene("among spheres", int(rng.integers(2**31)), size)


REGIMES: dict[str, Callable[[np.random.Generator, Size], Scene]] = {
    "balls on a floor": balls_on_a_floor,
    "corners on spheres": corners_on_spheres,
    "eggs in a mesh": eggs_in_a_mesh,
    "far from the origin": far_from_the_origin,
    "among spheres": among_spheres,
}


def scene_of(name: str, seed: int, size: Size = SIZE) -> Scene:
    """The regime's scene, each of whose surfaces, and triangles, is a mirror or glass and has a colour that names it.

    Surfaces count spheres first, then each triangle as a mesh of its own.
    """
    rng = np.random.default_rng([seed, *name.encode()])
    plain = REGIMES[name](rng, size)
    flat, n = Triangles.of(plain), len(plain.spheres)
    count = n + len(flat.faces)
    materials, glass = np.zeros(count, MATERIAL), rng.random(count) < 0.5
    materials["texture"], materials["ka"], materials["index"] = -1, 1, rng.choice([1.0, 1.5, 0.75])
    materials["color"] = np.arange(count)[:, None] // DIGITS ** np.arange(3) % DIGITS / (DIGITS + 1)
    materials["transmittance"], materials["reflectance"] = glass, ~glass
    spheres = plain.spheres.copy()
    spheres["material"] = np.arange(n)
    meshes = [
        PlacedMesh(Geometry(flat.vertices[face], [(0, 1, 2)]), material=n + i, number=n + i)
        for i, face in enumerate(flat.faces)
    ]
    light, white = ambient_light((1, 1, 1)), (1.0, 1.0, 1.0)
    return Scene(plain.camera, light, spheres, materials, white, to_object=plain.to_object, meshes=meshes)


# ------------------------------------------------------------------------------------------------------------ the judge


def judge(scene: Scene, got: Seen, color: ArrayLike) -> tuple[Verdict, Verdict]:
    """What is wrong with what rays meet that go on from pixels: those that leave triangles, and the others."""
    met = names(np.asarray(color).reshape(-1, 3))
    flat, spheres = Triangles.of(scene), Spheres.of(scene)
    left = left_from(scene, flat, got)
    rays = along(left.points(flat), onward_from(scene, left), scene.camera.basis())
    from_flat = verdict(left.pixels, met[left.pixels], _first(rays, flat, spheres))
    pixels, more = second_rays(scene, np.where(got.primitive < 0, got.id, -1).astype(np.int32))
    return from_flat, verdict(pixels, met[pixels], _first(more.path(spheres), flat, spheres))


def _first(rays: Rays, flat: Triangles, spheres: Spheres) -> Ids:
    """The number of the surface that rays meet, -1 for none."""
    found = Kinds([flat, spheres]).closest(rays)
    return np.concatenate([flat.surface, spheres.surface, [-1]])[found.item]
