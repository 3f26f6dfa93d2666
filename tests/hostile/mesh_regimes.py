"""The hostile regimes of triangles: scenes in which many pixels' rays meet a decision exactly, or all but exactly.

REGIMES: a name and a function each; scene_of(name, seed, size) is a scene of one picture. Where the camera looks along
-z, the tangent of its angle is 1/4, and sides of the picture that are powers of two make all rays (x, y, -1) with x and
y odd multiples of one power of two. Then corners are put on the rays of pixels exactly, and edges along rows of them.

CLOSED names those whose meshes are all closed: there, every ray meets an even number of triangles if the eye is
outside, and an odd one within.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene import Camera, Material, Mesh, Scene, ambient_light, parallel_light, point_light

Floats = NDArray[np.float64]
Faces = NDArray[np.int64]
Shape = tuple[Floats, Faces]
Size = tuple[int, int]

TAN = 0.25
HALF_ANGLE = 14.036243467926479  # degrees; its tangent rounds to TAN
SIZE = (64, 64)


class Made(NamedTuple):
    """What a regime is made of. scale: of everything; camera: None for that at `eye` which looks along -z."""

    shapes: Sequence[Shape]
    eye: tuple[float, float, float] = (0.0, 0.0, 0.0)
    camera: Camera | None = None
    centers: ArrayLike = ()
    radii: ArrayLike = ()
    transforms: Sequence[Floats] = ()


class Pixels:
    """The rays of a picture's pixels, and places on them."""

    def __init__(self, rng: np.random.Generator, size: Size) -> None:
        self.rng, self.size = rng, size
        # As Camera.image_plane() has it with square pixels.
        self.tan = np.array([TAN * min(1, size[0] / size[1]), TAN * min(1, size[1] / size[0])])
        self.step = self.tan / size

    def at(self, row: NDArray[np.int64], column: NDArray[np.int64], depth: Floats) -> Floats:
        """(n, 3): on the rays of these pixels, which may be beside the picture; exact for depths of some 20 bits."""
        (width, height), depth = self.size, np.asarray(depth, float)
        x = (2 * np.asarray(column) + 1 - width) * self.step[0]
        y = (height - 1 - 2 * np.asarray(row)) * self.step[1]
        return np.stack([x * depth, y * depth, -depth], axis=-1)

    def snapped(self, points: Floats) -> Floats:
        """The same points, ahead of the eye, moved to the nearest pixels' rays and to depths of 12 bits."""
        depth = -points[:, 2]
        grid = 2.0 ** (np.floor(np.log2(depth)) - 11)
        depth = np.round(depth / grid) * grid
        (width, height), xy = self.size, points[:, :2] / -points[:, 2:] / self.step
        column, row = np.round((xy[:, 0] + width - 1) / 2), np.round((height - 1 - xy[:, 1]) / 2)
        return self.at(row.astype(int), column.astype(int), depth)

    def some(self, count: int, beyond: float = 0.0) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of pixels, some of them outside of the picture by that share of it."""
        low, high = -beyond, 1 + beyond
        row, column = (np.floor(self.rng.uniform(low, high, count) * side).astype(int) for side in self.size[::-1])
        return row, column

    def depths(self, count: int, near: float = 2.0, far: float = 8.0) -> Floats:
        """Of 8 bits."""
        depth = self.rng.uniform(near, far, count)
        grid = 2.0 ** (np.floor(np.log2(depth)) - 7)
        return np.asarray(np.round(depth / grid) * grid)


# --------------------------------------------------------------------------------------------------------------- shapes


def round_mesh(levels: int) -> Shape:
    """A closed mesh of 8 * 4^levels triangles between points of the unit sphere."""
    vertices: list[Floats] = [*np.eye(3), *-np.eye(3)]
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    for _ in range(levels):
        middle: dict[tuple[int, int], int] = {}
        finer = []
        for face in faces:
            between = []
            for a, b in zip(face, face[1:] + face[:1], strict=True):
                key = min(a, b), max(a, b)
                if key not in middle:
                    middle[key] = len(vertices)
                    point = vertices[a] + vertices[b]
                    vertices.append(point / np.linalg.norm(point))
                between.append(middle[key])
            (a, b, c), (x, y, z) = face, between
            finer += [(a, x, z), (b, y, x), (c, z, y), (x, y, z)]
        faces = finer
    return np.array(vertices), np.array(faces)


def box(low: Sequence[float], high: Sequence[float], rng: np.random.Generator) -> Shape:
    """Twelve triangles; each side is cut along one of its diagonals, and wound, at random."""
    vertices = np.array([[(low, high)[k >> i & 1][i] for i in range(3)] for k in range(8)], float)
    sides = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    return vertices, np.concatenate([_cut(side, rng) for side in sides])


def _cut(corners: Sequence[int], rng: np.random.Generator) -> Faces:
    """A quadrilateral, as two triangles."""
    a, b, c, d = np.roll(corners, rng.integers(4))[:: rng.choice([-1, 1])]
    return np.array([np.roll((a, b, c), rng.integers(3)), np.roll((a, c, d), rng.integers(3))])


def grid(points: Floats, rng: np.random.Generator) -> Shape:
    """Between (rows, columns, 3) points: two triangles for each four of them."""
    rows, columns, _ = points.shape
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    return points.reshape(-1, 3), np.concatenate([_cut((i, i + 1, i + columns + 1, i + columns), rng) for i in first])


def fan(center: Floats, rim: Floats) -> Shape:
    """Triangles from a centre to a closed line of points, (n, 3)."""
    n = len(rim)
    faces = np.array([(0, 1 + i, 1 + (i + 1) % n) for i in range(n)])
    return np.vstack([center, rim]), faces


def soup(triangles: Floats) -> Shape:
    """(n, 3, 3): triangles that share nothing."""
    return triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)


def shuffled(shape: Shape, rng: np.random.Generator) -> Shape:
    """The same with its triangles in another order, each beginning with another corner."""
    vertices, faces = shape
    faces = faces[rng.permutation(len(faces))]
    turned = [np.roll(face, rng.integers(3)) for face in faces]
    return vertices, np.array(turned).reshape(-1, 3)


# -------------------------------------------------------------------------------------------------------------- regimes


def _turned(points: Floats, rng: np.random.Generator) -> Floats:
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(points @ turn)


def _towards(pixels: Pixels, eye: Floats, at: Floats, angle: float) -> Camera:
    return Camera(tuple(eye), tuple(at), tuple(pixels.rng.normal(size=3)), angle, pixels.size, max_bounces=0)


def _ball(pixels: Pixels, levels: int = 2, depth: float = 6.0, radius: float = 1.2) -> Shape:
    vertices, faces = round_mesh(levels)
    return _turned(vertices, pixels.rng) * radius + (0, 0, -depth), faces


def random_soup(pixels: Pixels) -> Made:
    """Triangles of all sizes."""
    rng = pixels.rng
    middle = pixels.at(*pixels.some(120, 0.2), rng.uniform(2, 9, 120))
    size = 10.0 ** rng.uniform(-3, 0, (120, 1, 1))
    return Made([soup(middle[:, None] + size * rng.normal(size=(120, 3, 3)))])


def ball(pixels: Pixels) -> Made:
    """A closed mesh between any doubles, before any camera."""
    way = pixels.rng.normal(size=3)
    camera = _towards(pixels, way / np.linalg.norm(way) * 4, np.zeros(3), math.degrees(math.atan(0.4)))
    vertices, faces = round_mesh(2)
    return Made([shuffled((_turned(vertices, pixels.rng), faces), pixels.rng)], camera=camera)


def corners_on_rays(pixels: Pixels) -> Made:
    """A closed mesh whose corners are on the rays of pixels."""
    vertices, faces = _ball(pixels)
    return Made([shuffled((pixels.snapped(vertices), faces), pixels.rng)])


def corners_all_but_on_rays(pixels: Pixels) -> Made:
    """The same with some of their coordinates off by an ulp."""
    vertices, faces = _ball(pixels)
    vertices = pixels.snapped(vertices)
    towards = pixels.rng.choice([-np.inf, np.inf], vertices.shape)
    off = np.where(pixels.rng.random(vertices.shape) < 0.4, np.nextafter(vertices, towards), vertices)
    return Made([shuffled((off, faces), pixels.rng)])


def edge_points_on_rays(pixels: Pixels) -> Made:
    """A wall of triangles at one depth, whose edges cross the rays of pixels half way, and at thirds."""
    side = pixels.size[0] // 8
    column, row = np.meshgrid(np.arange(-2, 11) * side + 1, np.arange(-2, 11) * side + 2)
    return Made([grid(pixels.at(row, column, np.full(row.shape, 4.0)), pixels.rng)])


def edges_along_rows(pixels: Pixels) -> Made:
    """Roofs: each row of corners is at its own depths, but in the plane of a row of pixels."""
    count = 9
    column = np.broadcast_to(np.linspace(-4, pixels.size[0] + 3, count).astype(int), (count, count))
    row = np.broadcast_to(np.linspace(-4, pixels.size[1] + 3, count).astype(int)[:, None], (count, count))
    return Made([grid(pixels.at(row, column, pixels.depths(count * count).reshape(count, count)), pixels.rng)])


def slivers_between_rays(pixels: Pixels) -> Made:
    """Needles of 2^-3 to 2^-40 between two corners on rays of pixels, which they share with others."""
    rng = pixels.rng
    row, column = pixels.some(60)
    far = pixels.at(*pixels.some(60), pixels.depths(60))
    near = pixels.at(row, column, pixels.depths(60))
    third = near + (far - near) * 0.5 + rng.choice([-1, 1], (60, 3)) * 2.0 ** -rng.integers(3, 40, (60, 1))
    return Made([soup(np.stack([near, far, third], axis=1))])


def moved(regime: Callable[[Pixels], Made], by: float = 0, scale: float = 1) -> Callable[[Pixels], Made]:
    """The same at an offset, and the eye, too, or larger: where the sums are exact, all is as before."""

    def of(pixels: Pixels) -> Made:
        made, offset = regime(pixels), by * pixels.rng.choice([-1, 1], 3)
        camera = made.camera and replace(
            made.camera,
            position=tuple(offset + made.camera.position),
            lookat=tuple(offset + made.camera.lookat),
        )
        shapes = [(vertices * scale + offset, faces) for vertices, faces in made.shapes]
        centers = np.reshape(made.centers, (-1, 3)) * scale + offset
        return made._replace(shapes=shapes, eye=tuple(offset.tolist()), camera=camera, centers=centers)

    return of


def doubled(pixels: Pixels) -> Made:
    """Balls of which each face is there up to three times, wound either way, from any corner on, in up to four meshes,
    and a wall whose quadrilaterals are doubled with the other diagonal.
    """
    rng = pixels.rng
    vertices, faces = _ball(pixels, 1)
    reversed_faces = faces[:, ::-1]
    some = reversed_faces[rng.random(len(faces)) < 0.5]
    again = shuffled((vertices, np.concatenate([faces, reversed_faces, some])), rng)
    quads = np.array([(i, i + 1, i + 6, i + 5) for row in range(4) for i in range(5 * row, 5 * row + 4)])
    row, column = np.divmod(np.arange(25), 5)
    wall = pixels.at(row * 16, column * 16, np.full(25, 7.0))
    cut = [quads[:, corners] for corners in ((0, 1, 2), (0, 2, 3), (3, 2, 1), (3, 1, 0))]
    front, back = (wall, np.concatenate(cut[:2])), (wall, np.concatenate(cut[2:]))
    shapes = [again, (vertices, reversed_faces), (vertices[faces[:9]].reshape(-1, 3), np.arange(27).reshape(9, 3))]
    return Made([shapes[k] for k in rng.permutation(3)] + [front, back, shuffled(back, rng)])


def fans_in_planes(pixels: Pixels, turn: bool = False) -> Made:
    """Polygons with corners at random whole places, whose fans of triangles cover each other: in planes across an axis,
    along a diagonal, and aslant, so that planes have exactly the same corners' numbers or, turned, all but those.
    """
    rng, shapes = pixels.rng, []
    for k in range(4):
        x, y = rng.integers(-8, 9, (2, 24)) / 4
        z = (-4 + 0 * x, -4 + x, -4 + x - y / 2, -3.5 + (x + y) / 4)[k]
        corners = np.stack([x, y, z], axis=1)
        if turn:
            corners = _turned(corners - (0, 0, -4), rng) * 0.5 + (0, 0, -4)
        faces = np.array([(0, i, i + 1) for i in range(1, 23)])
        shapes.append(shuffled((corners, np.concatenate([faces, faces[::3, ::-1]])), rng))
    return Made(shapes)


def crossings(pixels: Pixels) -> Made:
    """Planes through common lines, on which rays meet all of them at equal distances."""
    rng = pixels.rng
    shapes = []
    for _ in range(10):
        (row,), _ = pixels.some(1)
        depth = np.full(2, 2.0 ** rng.integers(1, 4))
        ends = pixels.at(np.array([row, row]), np.array([-9, pixels.size[0] + 9]), depth)
        tips, middle = rng.normal(size=(4, 3)) * (1, 1, 2) + (0, 0, -4), ends.mean(axis=0)
        # Both triangles of a pair are in one plane, on both sides of the line.
        shapes.append(soup(np.array([[*ends, tip] for tip in (*tips, *(2 * middle - tips))])))
    return Made(shapes)


def eye_in_a_plane(pixels: Pixels) -> Made:
    """Faces whose planes go through the eye, among others."""
    rng = pixels.rng
    ends = pixels.at(*pixels.some(60, 0.3), pixels.depths(60)).reshape(30, 2, 3)
    flat = np.concatenate([ends, (ends[:, :1] * 2 + ends[:, 1:]) * rng.choice([0.25, 0.5, 2.0], (30, 1, 1))], axis=1)
    return Made([soup(flat), _ball(pixels, 1), soup(flat + rng.choice([0, 2.0**-40], flat.shape))])


def eye_on_an_edge(pixels: Pixels) -> Made:
    """A closed box, one of whose edges, and diagonals, goes through the eye."""
    rng = pixels.rng
    a, b, c = rng.choice([-1.0, 1.0], 3)
    x, y, z = ([-2.0, 2.0], [-2.0, 2.0], [-3.0, 1.0])
    places = [((0.0, 0.0), y, z), (x, (0.0, 0.0), z)]
    shapes = []
    for k in range(2):
        low = [v[0] for v in places[k]]
        high = [v[1] for v in places[k]]
        low[k], high[k] = sorted((0.0, 2.0 * (a, b)[k]))
        low[1 - k], high[1 - k] = sorted((0.0, 3.0 * c))
        shapes.append(box(low, high, rng))
    return Made([*shapes, box((-3, -3, -3), (3, 3, 3), rng)])


def eye_on_a_corner(pixels: Pixels) -> Made:
    """A closed mesh one of whose corners is the eye, and a fan around it, within a closed ball."""
    rng = pixels.rng
    vertices, faces = round_mesh(1)
    vertices = np.round(_turned(vertices, rng) * 64) / 64
    near = vertices - vertices[rng.integers(len(vertices))]
    rim = pixels.at(*pixels.some(9), pixels.depths(9))
    return Made([(near, faces), fan(np.zeros(3), rim), (vertices * 8, faces)])


def fans(pixels: Pixels) -> Made:
    """Around corners on the rays of pixels, with spokes to other such corners."""
    rng = pixels.rng
    shapes = []
    for _ in range(12):
        row, column = (int(x[0]) for x in pixels.some(1))
        n = int(rng.integers(3, 30))
        angle = np.sort(rng.uniform(0, 2 * math.pi, n))
        out = rng.integers(3, 40, n)
        rim_row, rim_column = (np.round(v + out * f(angle)).astype(int) for v, f in ((row, np.sin), (column, np.cos)))
        depth = pixels.depths(n + 1)
        center = pixels.at(np.array([row]), np.array([column]), depth[:1])
        shapes.append(shuffled(fan(center, pixels.at(rim_row, rim_column, depth[1:])), rng))
    return Made(shapes)


def terrain(pixels: Pixels) -> Made:
    """A grid without T-junctions, its corners on the rays of pixels, at any depths."""
    count = 14
    row, column = np.meshgrid(*[np.linspace(-6, side + 5, count).astype(int) for side in pixels.size], indexing="ij")
    return Made([grid(pixels.at(row, column, pixels.depths(count * count).reshape(count, count)), pixels.rng)])


def room(pixels: Pixels) -> Made:
    """The eye in closed rooms along the axes. Edges and diagonals of walls go through pixels' centres."""
    rng = pixels.rng
    shapes = []
    for depth in (4.0, 8.0, 16.0):
        odd = 2 * rng.integers(1, pixels.size[0] // 2, 4) + 1
        left, right, low, high = odd * pixels.step[0] * depth * (-1, 1, -1, 1)
        shapes.append(box((left, low, -depth), (right, high, depth), rng))
    return Made(shapes)


def pillars(pixels: Pixels) -> Made:
    """Boxes along the axes, seen from outside, with corners on rays, before a wall."""
    rng = pixels.rng
    shapes = []
    for _ in range(12):
        row, column = pixels.some(2)
        near, far = np.sort(pixels.depths(2))
        ends = pixels.at(row, column, np.full(2, near))
        low, high = ends.min(axis=0), ends.max(axis=0)
        shapes.append(box((low[0], low[1], -far - 1), (high[0] + 2.0**-6, high[1] + 2.0**-6, -near), rng))
    return Made(shapes)


def grazing(pixels: Pixels) -> Made:
    """Planes that the eye is above by 2^-1 to 2^-50, up to the horizon."""
    rng = pixels.rng
    shapes = []
    for k in range(8):
        height, across = 2.0 ** -rng.uniform(1, 50), rng.integers(2)
        x, z = np.meshgrid(np.linspace(-30, 30, 5), -np.linspace(1 + k, 40, 5))
        points = np.stack([x, np.full(x.shape, height * rng.choice([-1, 1])), z], axis=2)
        shapes.append(grid(points if across else points[:, :, [1, 0, 2]], rng))
    return Made(shapes)


def far_and_small(pixels: Pixels) -> Made:
    """Balls of some pixels, 10^2 to 10^9 away, and triangles much smaller than a pixel on pixels' rays."""
    rng = pixels.rng
    shapes = []
    for distance in 10.0 ** rng.uniform(2, 9, 5):
        vertices, faces = round_mesh(1)
        place = pixels.at(*pixels.some(1), np.array([distance]))[0]
        shapes.append((place + _turned(vertices, rng) * distance * 10.0 ** rng.uniform(-4, -1.5), faces))
    points = pixels.at(*pixels.some(80), 10.0 ** rng.uniform(2, 9, 80))
    small = points[:, None] * (1 + 10.0 ** rng.uniform(-12, -3, (80, 1, 1)) * rng.normal(size=(80, 3, 3)))
    return Made([*shapes, soup(small)])


def huge(pixels: Pixels) -> Made:
    """Triangles of 10^3 to 10^9 through the picture, and around the eye."""
    rng = pixels.rng
    points = pixels.at(*pixels.some(20), pixels.depths(20))
    # So that the point is within: the three corners' weights are 1/4, 1/4 and 1/2.
    out = 10.0 ** rng.uniform(3, 9, (20, 1, 1)) * rng.normal(size=(20, 2, 3))
    third = points - (out[:, 0] + out[:, 1]) / 2
    around = 10.0 ** rng.uniform(0, 6, (10, 1, 1)) * rng.normal(size=(10, 3, 3))
    return Made([soup(np.concatenate([points[:, None] + out, third[:, None]], axis=1)), soup(around)])


def nested(pixels: Pixels) -> Made:
    """Closed meshes one within the other: by an ulp, by 2^-40, 2^-20, and by halves."""
    vertices, faces = _ball(pixels, 1, radius=1.5)
    middle = np.array([0, 0, -6.0])
    off = [1, 1 + 2.0**-50, 1 - 2.0**-40, 1 - 2.0**-20, 0.75, 0.5]
    return Made([shuffled((middle + (vertices - middle) * k, faces), pixels.rng) for k in off])


def within(pixels: Pixels) -> Made:
    """The eye in closed meshes, all but at their walls."""
    rng = pixels.rng
    vertices, faces = round_mesh(2)
    shapes = []
    for _ in range(3):
        turned = _turned(vertices, rng)
        wall = turned[faces[rng.integers(len(faces))]].mean(axis=0)
        shapes.append((turned - wall * (1 - 10.0 ** -rng.uniform(0, 9)), faces))
    return Made(shapes)


def behind_the_eye(pixels: Pixels) -> Made:
    """Needles and plates that reach from ahead of the eye to behind it."""
    rng = pixels.rng
    ahead = pixels.at(*pixels.some(60), pixels.depths(60))
    back = rng.normal(size=(60, 2, 3)) * 10.0 ** rng.uniform(-2, 1, (60, 1, 1)) + (0, 0, 2)
    return Made([soup(np.concatenate([ahead[:, None], back], axis=1))])


def among_spheres(pixels: Pixels) -> Made:
    """Boxes with spheres that touch all their walls from within, ellipsoids, and walls through spheres' centres."""
    rng = pixels.rng
    shapes, centers, radii, transforms = [], [], [], []
    for _ in range(4):
        place, r = pixels.at(*pixels.some(1), pixels.depths(1, 4))[0], 2.0 ** -rng.integers(1, 4)
        place = np.round(place * 64) / 64
        shapes.append(box(place - r, place + r, rng))
        for radius in (r, r * 1.25):
            centers.append(place)
            radii.append(radius)
            transforms.append(np.eye(3))
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        centers.append(place + 0.1)
        radii.append(r)
        transforms.append(turn * [1, 0.5, 1.5])
    x, y = rng.integers(-8, 9, (2, 20, 3)) / 4
    shapes.append(soup(np.stack([x, y, np.broadcast_to(-rng.integers(3, 7, (20, 1)), (20, 3))], axis=2)))
    return Made(shapes, centers=centers, radii=radii, transforms=transforms)


def balls_on_a_floor(pixels: Pixels) -> Made:
    """A floor and two walls of triangles, and balls that touch some of them exactly; all of whole numbers."""
    rng, side = pixels.rng, np.arange(-4, 5, 2.0)
    x, y = np.meshgrid(side, side)
    flat = np.stack([x, y, np.full(x.shape, -2.0)], axis=2)
    centers = rng.integers(-1, 3, (12, 3)).astype(float)
    radii = np.minimum(centers.min(axis=1) + 2, rng.choice([1, 2], 12))
    camera = _towards(pixels, np.round(rng.uniform(4, 9, 3) * 16) / 16, 0.3 * rng.normal(size=3), HALF_ANGLE)
    return Made([grid(np.roll(flat, k, axis=2), rng) for k in range(3)], camera=camera, centers=centers, radii=radii)


def corners_on_spheres(pixels: Pixels) -> Made:
    """Triangles between points of two equal spheres, exactly, and balls with their corners as centres."""
    rng, side = pixels.rng, np.arange(-9, 10)
    points = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    points = points[(points**2).sum(axis=1) == 81] / 4  # 9/4 from the middle
    corners, centers = points[rng.integers(len(points), size=(4, 3))], points[rng.integers(len(points), size=6)]
    camera = _towards(pixels, np.round(rng.normal(size=3) * 8) / 16, 0.3 * rng.normal(size=3), 60)
    radii = [2.25, 2.25, *rng.choice([0.25, 0.5], 6)]
    return Made([soup(corners)], camera=camera, centers=np.vstack([np.zeros((2, 3)), centers]), radii=radii)


def eggs_in_a_mesh(pixels: Pixels) -> Made:
    """Ellipsoids and spheres that stick through a closed mesh, whose corners are on one of them but for rounding."""
    rng, (vertices, faces) = pixels.rng, round_mesh(2)
    centers, radii = rng.normal(size=(9, 3)), rng.uniform(0.3, 1.2, 9)
    maps = [np.eye(3) if k % 2 else _turned(np.diag(10.0 ** rng.uniform(-0.5, 0.3, 3)), rng) for k in range(9)]
    centers[1], radii[1] = 0, 1.5
    # Of the first one the faces are partly within the sphere.
    shapes = [(vertices * 1.52, faces), (vertices @ maps[0].T * radii[0] + centers[0], faces)]
    far = rng.choice([0.7, 12])
    camera = _towards(pixels, far * rng.normal(size=3), 0.3 * rng.normal(size=3), HALF_ANGLE if far > 4 else 60)
    return Made(shapes, camera=camera, centers=centers, radii=radii, transforms=maps)


REGIMES: dict[str, Callable[[Pixels], Made]] = {
    "soup": random_soup,
    "a closed ball": ball,
    "corners on rays": corners_on_rays,
    "corners an ulp beside rays": corners_all_but_on_rays,
    "edges across rays": edge_points_on_rays,
    "edges along rows": edges_along_rows,
    "slivers between rays": slivers_between_rays,
    "offset 1e7, corners on rays": moved(corners_on_rays, 1e7),
    "offset 1e7, soup": moved(random_soup, 1e7 + 0.3),
    "scale 2^60": moved(corners_on_rays, scale=2.0**60),
    "scale 2^-60": moved(corners_on_rays, scale=2.0**-60),
    "doubled": doubled,
    "fans in planes": fans_in_planes,
    "fans all but in planes": lambda pixels: fans_in_planes(pixels, turn=True),
    "crossings": crossings,
    "eye in a plane": eye_in_a_plane,
    "eye on an edge": eye_on_an_edge,
    "eye on a corner": eye_on_a_corner,
    "fans": fans,
    "terrain": terrain,
    "room": room,
    "pillars": pillars,
    "grazing": grazing,
    "far and small": far_and_small,
    "huge": huge,
    "nested": nested,
    "eye within": within,
    "behind the eye": behind_the_eye,
    "among spheres": among_spheres,
    "balls on a floor": balls_on_a_floor,
    "corners on spheres": corners_on_spheres,
    "eggs in a mesh": eggs_in_a_mesh,
    "eggs in a mesh, 1e7 away": moved(eggs_in_a_mesh, 1e7),
}
CLOSED = (
    "a closed ball",
    "corners on rays",
    "corners an ulp beside rays",
    "offset 1e7, corners on rays",
    "scale 2^60",
    "scale 2^-60",
    "nested",
    "pillars",
)
AROUND = ("room", "eye within")  # closed, and each around the eye


def scene_of(name: str, seed: int, size: Size = SIZE, full: bool = False) -> Scene:
    """The regime's scene; its picture is of that size, whose sides should be powers of two.

    full: in four lights, with mirrors and glass, normals at corners and textures, and rays that go on three times.
    """
    rng = np.random.default_rng([seed, *name.encode()])
    made = REGIMES[name](Pixels(rng, size))
    x, y, z = made.eye
    camera = made.camera or Camera((x, y, z), (x, y, z - max(1.0, abs(z))), (0, 1, 0), HALF_ANGLE, size, max_bounces=0)
    centers, transform = np.reshape(made.centers, (-1, 3)), np.array(made.transforms) if made.transforms else None
    if not full:
        shades = np.linspace(0.1, 1, len(made.shapes))
        meshes = [
            Mesh(vertices, faces, material=Material((shade, 0.5, 1 - shade), ka=1))
            for (vertices, faces), shade in zip(made.shapes, shades, strict=True)
        ]
        return Scene.from_spheres(camera, (), centers, made.radii, ka=1, transform=transform, meshes=meshes)
    place = made.shapes[0][0][0]
    reach = max(np.abs(vertices - camera.position).max() for vertices, _ in made.shapes)
    lights = [point_light(place + 0.3 * reach * rng.normal(size=3), (0.5, 0.4, 0.3)) for _ in range(2)]
    lights += [parallel_light((1, -2, -3), (0.4, 0.4, 0.4)), ambient_light((0.2, 0.2, 0.2))]
    meshes = []
    for vertices, faces in made.shapes:
        texture = rng.integers(0, 256, (3, 5, 3)).astype(np.uint8) if rng.random() < 0.5 else None
        reflectance, transmittance = rng.choice([0, 0, 0.4], 2)
        material = Material(
            tuple(rng.random(3)), reflectance=reflectance, transmittance=transmittance, index=1.5, texture=texture
        )
        normals = rng.normal(size=vertices.shape) if rng.random() < 0.5 else None
        meshes.append(Mesh(vertices, faces, normals, rng.normal(size=(len(vertices), 2)), material))
    return Scene.from_spheres(
        replace(camera, max_bounces=3), lights, centers, made.radii, rng.random((len(centers), 3)), reflectance=0.3,
        transmittance=0.3, index=1.5, transform=transform, meshes=meshes, background=(0.1, 0.2, 0.3),
    )  # fmt: skip
