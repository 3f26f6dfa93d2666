"""Meshes that tests are made of, and what exact arithmetic says of the rays that meet them.

What is exact here is written anew from the definition in docs and shares no code with kernel, reference or benchmark.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from glowing import RED, WHITE
from hostile.sphere_regimes import rays
from hostile.sphere_scenes import directions, looking
from stress_cases import OUTPUTS, channel

from cltrace import Camera, Image, Material, Mesh, Renderer, Scene, ambient_light
from cltrace.run.devices import Device

Row = Sequence[float]
ALL = tuple(dict.fromkeys((*OUTPUTS, "primitive", "uv")))


class Solid(NamedTuple):
    """vertices: (v, 3); faces: (f, 3), seen from the front counter-clockwise."""

    vertices: np.ndarray
    faces: np.ndarray

    def moved(self, by: Row = (0, 0, 0), factor: float = 1) -> Solid:
        """Scaled about the origin, then moved."""
        return Solid(self.vertices * factor + np.asarray(by, float), self.faces)

    def flipped(self) -> Solid:
        """The same, wound the other way."""
        return Solid(self.vertices, np.ascontiguousarray(self.faces[:, ::-1]))

    def unshared(self) -> Solid:
        """The same, with three vertices of its own for every face."""
        return Solid(self.vertices[self.faces].reshape(-1, 3), np.arange(3 * len(self.faces)).reshape(-1, 3))

    def reordered(self, order: np.ndarray) -> Solid:
        """The same, with its faces in another order."""
        return Solid(self.vertices, self.faces[order])


def joined(*solids: Solid) -> Solid:
    """Several as one."""
    starts = np.cumsum([0, *(len(s.vertices) for s in solids)])
    faces = [s.faces + start for s, start in zip(solids, starts, strict=False)]
    return Solid(np.concatenate([s.vertices for s in solids]), np.concatenate(faces))


def box(low: Row = (-1, -1, -1), high: Row = (1, 1, 1)) -> Solid:
    """Twelve faces, two a side, their fronts outside."""
    sides = np.array([low, high], float)
    vertices = np.array([[sides[k][i] for i, k in enumerate(which)] for which in itertools.product((0, 1), repeat=3)])
    # Vertex 4 x + 2 y + z. Each side as a quad, counter-clockwise from outside.
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Solid(vertices, np.array([(q[0], q[k], q[k + 1]) for q in quads for k in (1, 2)]))


def octahedron() -> Solid:
    vertices = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], float)
    return outwards(Solid(vertices, np.array(list(itertools.product((0, 1), (2, 3), (4, 5))))))


def tetrahedron() -> Solid:
    vertices = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float)
    return outwards(Solid(vertices, np.array([(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)])))


def outwards(solid: Solid) -> Solid:
    """Each face of a convex solid about the origin wound so that its front is outside."""
    a, b, c = (solid.vertices[solid.faces[:, k]] for k in range(3))
    inwards = (np.cross(b - a, c - a) * a).sum(axis=1) < 0
    return Solid(solid.vertices, np.where(inwards[:, None], solid.faces[:, ::-1], solid.faces))


def ball(level: int = 2) -> Solid:
    """An octahedron whose faces are split into four so often, with its vertices put on the unit sphere."""
    vertices, faces = octahedron()
    for _ in range(level):
        points, index = list(map(tuple, vertices)), {}

        def middle(i: int, j: int, points: list = points, index: dict = index) -> int:
            if (min(i, j), max(i, j)) not in index:
                m = np.add(points[i], points[j])
                index[min(i, j), max(i, j)] = len(points)
                points.append(tuple(m / np.linalg.norm(m)))
            return index[min(i, j), max(i, j)]

        split = []
        for a, b, c in faces.tolist():
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            split += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        vertices, faces = np.array(points), np.array(split)
    return Solid(vertices, faces)


def sheet(columns: np.ndarray, rows: np.ndarray, height: np.ndarray) -> Solid:
    """A surface over a grid: the vertices (columns[i], rows[j], height[j, i]), two faces a cell."""
    x, y = np.meshgrid(columns, rows)
    n = len(columns)
    k = (np.arange(len(rows) - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([np.stack([k, k + 1, k + n + 1], 1), np.stack([k, k + n + 1, k + n], 1)])
    return Solid(np.stack([x, y, height], -1).reshape(-1, 3).astype(float), faces)


def is_closed(solid: Solid) -> bool:
    """Whether every edge, as a pair of positions, is there once in each direction."""
    ends = solid.vertices[solid.faces[:, [0, 1, 1, 2, 2, 0]]].reshape(-1, 2, 3).tolist()
    edges = [(tuple(a), tuple(b)) for a, b in ends]
    return len(set(edges)) == len(edges) and {(b, a) for a, b in edges} == set(edges)


# --- exact arithmetic


def _whole(points: np.ndarray) -> list[list[Fraction]]:
    return [[Fraction(float(x)) for x in p] for p in points]


def _cross(a: Sequence, b: Sequence) -> tuple:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _dot(a: Sequence, b: Sequence) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def sign(x: Fraction | float) -> int:
    return (x > 0) - (x < 0)


class Triangles:
    """Triangles as a point sees them: the signs that decide, in doubles where these are sure, else exactly.

    corners: (f, 3, 3), world; origin: (3,), of doubles or Fractions.
    """

    def __init__(self, corners: np.ndarray, origin: Sequence) -> None:
        self.corners, self.origin = corners, [Fraction(x) for x in origin]
        self.near = corners - np.array([float(x) for x in self.origin])
        low, high = self.near, np.roll(self.near, -1, axis=1)
        self.n = np.cross(low, high)  # (f, 3 edges, 3)
        # A coordinate of a corner is right to 2^-53 of itself, and a product of two to less than 2^-51.
        a, b = np.abs(low), np.abs(high)
        self.n_error = 2.0**-50 * (np.roll(a, -1, 2) * np.roll(b, 1, 2) + np.roll(a, 1, 2) * np.roll(b, -1, 2))
        self.exact_n: dict[tuple[int, int], tuple] = {}
        D = [_dot(self.exact(f, 0)[0], self.normal(f)) for f in range(len(corners))]
        self.D = np.array([float(x) for x in D])
        self.side = np.array([sign(x) for x in D])
        self.exact_D = D

    def exact(self, f: int, k: int) -> tuple[list, list]:
        """The two ends of an edge from the origin."""
        ends = (self.corners[f, k], self.corners[f, (k + 1) % 3])
        return tuple([Fraction(float(x)) - o for x, o in zip(p, self.origin, strict=True)] for p in ends)  # type: ignore[return-value]

    def normal(self, f: int) -> tuple:
        """N = (B - A) x (C - A)."""
        a, b, c = _whole(self.corners[f])
        return _cross([y - x for x, y in zip(a, b, strict=True)], [y - x for x, y in zip(a, c, strict=True)])

    def edge(self, f: int, k: int) -> tuple:
        if (f, k) not in self.exact_n:
            self.exact_n[f, k] = _cross(*self.exact(f, k))
        return self.exact_n[f, k]

    def edge_sign(self, f: int, k: int, w: Sequence) -> int:
        """Of E; 0 is the sign of the first coordinate of A' x B' that is not 0."""
        n = self.edge(f, k)
        return next((sign(x) for x in (_dot(n, w), *n) if x), 0)

    def met(self, w: np.ndarray, exact: Sequence[Sequence[Fraction]]) -> np.ndarray:
        """(n, f) bool: whether rays from the origin meet the triangles.

        exact: the n directions; w: (n, 3), the same as doubles, each coordinate right to 2^-50 of the largest.
        """
        rounded = np.abs(w) + 2.0**-50 * np.abs(w).max(axis=1, initial=0)[:, None]
        E = np.einsum("ni,fki->nfk", w, self.n)
        error = np.einsum("ni,fki->nfk", rounded, self.n_error + 2.0**-50 * np.abs(self.n))
        error += np.einsum("ni,fki->nfk", rounded - np.abs(w), np.abs(self.n))
        signs = np.sign(E).astype(int)
        doubt = ~(np.abs(E) > error) & (self.side != 0)[:, None]
        # Where one edge surely says no, the others do not matter.
        no = ((signs * self.side[:, None] < 0) & ~doubt).any(axis=2)
        for i, f, k in np.argwhere(doubt & ~no[:, :, None]):
            signs[i, f, k] = self.edge_sign(f, k, exact[i])
        return (self.side != 0) & (signs * self.side[:, None] > 0).all(axis=2)

    def t(self, f: int, w: Sequence[Fraction]) -> Fraction:
        return self.exact_D[f] / _dot(self.normal(f), w)

    def order(self, f: int, w: Sequence[Fraction]) -> tuple:
        """Increases with t, and for the same t with that of w + (e, e^2, e^3): 1 / t = n.w with n = N / D."""
        return self.t(f, w), *(-x / self.exact_D[f] for x in self.normal(f))


def exact_directions(camera: Camera) -> list[list[Fraction]]:
    """Of all pixels' rays in the world: the camera's axes are doubles, and so is what each pixel says of them."""
    rows = [[Fraction(x) for x in axis] for axis in camera.basis()]
    seen_rays = [[Fraction(x) for x in d] for d in rays(camera).tolist()]
    return [[d[0] * rows[0][i] + d[1] * rows[1][i] + d[2] * rows[2][i] for i in range(3)] for d in seen_rays]


class Seen(NamedTuple):
    """What every pixel shows: surface and triangle (n,), -1 for nothing; distance (n,) double, inf for nothing; met
    (n, f): all triangles that the pixel's ray meets, in the order of surfaces.
    """

    surface: np.ndarray
    triangle: np.ndarray
    distance: np.ndarray
    met: np.ndarray


def corners_of(scene: Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(f, 3, 3) world, and (f,) the surface and (f,) the number in its file of each triangle of a scene."""
    meshes = sorted(scene.meshes, key=lambda mesh: mesh.number)
    corners = [np.asarray(mesh.vertices)[np.asarray(mesh.geometry.faces)] for mesh in meshes]
    surfaces = [np.full(len(c), mesh.number) for c, mesh in zip(corners, meshes, strict=True)]
    numbers = [np.arange(len(c)) for c in corners]
    return np.concatenate(corners), np.concatenate(surfaces), np.concatenate(numbers)


@functools.lru_cache(256)
def seen(scene: Scene) -> Seen:
    """By exact arithmetic."""
    corners, surfaces, numbers = corners_of(scene)
    exact = exact_directions(scene.camera)
    triangles = Triangles(corners, scene.camera.position)
    w = np.array([[float(x) for x in row] for row in exact])
    met = triangles.met(w, exact)
    n = len(exact)
    best, t = np.full(n, -1), np.full(n, np.inf)
    for i in range(n):
        hits = [(*triangles.order(f, exact[i]), f) for f in np.flatnonzero(met[i]).tolist()]
        if hits:
            nearest, *_, best[i] = min(hits)  # in one plane: the lower surface, then the lower triangle
            t[i] = float(nearest)
    surface, triangle = (np.where(best < 0, -1, which[best]) for which in (surfaces, numbers))
    return Seen(surface, triangle, t * np.linalg.norm(rays(scene.camera), axis=1), met)


def unstopped(lamp: Triangles, p: Sequence[Fraction], own: int) -> bool | None:
    """Whether the way from a lamp to p, near triangle `own`, is free; None where rounding p matters.

    lamp: the triangles as it sees them.
    """
    w = [x - y for x, y in zip(p, lamp.origin, strict=True)]
    small = max(map(abs, w)) * Fraction(1, 10**9)
    rough = np.array([float(x) for x in w])
    # Those that all edges surely leave aside do not matter.
    E = lamp.n @ rough * lamp.side[:, None]
    for f in np.flatnonzero((-1e-6 * np.abs(lamp.n).max() * np.abs(rough).max() < E).all(axis=1)).tolist():
        if f == own or lamp.side[f] == 0:
            continue
        s, N = int(lamp.side[f]), lamp.normal(f)
        beyond = s * _dot(N, [x - Fraction(float(a)) for x, a in zip(p, lamp.corners[f, 0], strict=True)])
        parts = [(beyond, max(map(abs, N)))]
        parts += [(s * _dot(n, w), max(map(abs, n))) for n in (lamp.edge(f, k) for k in range(3))]
        if all(value > size * small for value, size in parts):
            return False
        if all(value > -size * small for value, size in parts):
            return None
    return True


# --- scenes of them

# Tangents for which the directions of 32 x 24 pixels have 7 binary digits.
NARROW, WIDE = 0.25, 1.5
SIZE = (32, 24)
AT_FOUR = looking((0, 0, 4), NARROW, SIZE)


def drawn(
    scene: Scene,
    device: Device | None,
    precision: str = "accurate",
    width: int | None = None,
    keep: tuple[str, ...] = (),
    crop: tuple[int, int, int, int] | None = None,
) -> Image:
    """All outputs, by the kernel with all features."""
    return Renderer(scene, device, precision, ALL, crop, width=width, keep=("features", *keep)).render()  # type: ignore[arg-type]


def mesh(solid: Solid, **more: object) -> Mesh:
    return Mesh(solid.vertices, solid.faces, **more)  # type: ignore[arg-type]


def bare(camera: Camera, *solids: Solid) -> Scene:
    """Meshes without light."""
    return Scene.from_meshes(camera, [], [mesh(solid) for solid in solids])


def glow(color: Row = WHITE, **more: float) -> Material:
    """What looks as its colour says in white ambient light."""
    return Material(color=color, ka=1, kd=0, ks=0, **more)  # type: ignore[arg-type]


def glowing(camera: Camera, *solids: Solid, material: Material, background: Row = RED) -> Scene:
    meshes = [mesh(solid, material=material) for solid in solids]
    return Scene.from_meshes(camera, [ambient_light(WHITE)], meshes, background=background)


def check(scene: Scene, device: Device, precision: str = "accurate", width: int | None = None) -> Image:
    """Every surface, triangle and distance is that of exact arithmetic."""
    image, want = drawn(scene, device, precision, width), seen(scene)
    wrong = np.flatnonzero((channel(image, "id") != want.surface) | (channel(image, "primitive") != want.triangle))
    assert len(wrong) == 0, f"{len(wrong)} wrong hits, {want.triangle[wrong][:5]} at {wrong[:5]}"
    depth, hit = channel(image, "depth"), want.surface >= 0
    assert (depth[~hit] == np.inf).all()
    assert np.abs(depth[hit] / want.distance[hit] - 1).max(initial=0) <= 1e-8
    assert np.isfinite(image.color).all()
    length = np.linalg.norm(channel(image, "normal"), axis=1)
    assert np.abs(length - hit).max() <= 1e-6
    return image


def at_pixels(camera: Camera, solid: Solid) -> Solid:
    """A solid whose vertices are moved sideways into the rays of pixels, exactly; depths become multiples of 1/8."""
    w, eye = directions(camera), np.array(camera.position)
    depth = np.round((eye[2] - solid.vertices[:, 2]) * 8) / 8
    aim = (solid.vertices - eye)[:, :2] / depth[:, None]
    nearest = ((aim[:, None] - w[None, :, :2]) ** 2).sum(axis=2).argmin(axis=1)
    return Solid(w[nearest] * depth[:, None] + eye, solid.faces)


def needles(seed: int) -> Solid:
    """Triangles of length 1 and 1e-1 .. 1e-12 wide, seen from anywhere."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-1, 1, (2, 60, 3))
    c = a + (b - a) * rng.uniform(0, 1, (60, 1)) + rng.normal(size=(60, 3)) * 10.0 ** -np.linspace(1, 12, 60)[:, None]
    return Solid(np.stack([a, b, c], 1).reshape(-1, 3), np.arange(180).reshape(-1, 3))


def lattice(seed: int, side: int = 3, count: int = 120) -> Solid:
    """Triangles whose corners are small whole numbers: many have no area, lie in one plane, share edges, or twice."""
    rng = np.random.default_rng(seed)
    points = np.array(list(itertools.product(range(-side, side + 1), repeat=3)), float)
    return Solid(points, rng.integers(0, len(points), (count, 3)))


def places(camera: Camera, image: Image) -> np.ndarray:
    """(n, 3): what the pixels show, in the world; the eye for nothing."""
    w, depth = directions(camera), channel(image, "depth")
    t = np.where(np.isfinite(depth), depth, 0) / np.linalg.norm(w, axis=1)
    return np.asarray(camera.position + w * t[:, None])


def smooth(solid: Solid, **more: object) -> Mesh:
    """With the directions of its vertices from the origin as their normals."""
    return Mesh(solid.vertices, solid.faces, normals=solid.vertices, **more)  # type: ignore[arg-type]


SAME = ("rgb8", "color", "depth", "id", "primitive", "normal", "shadow_rays")


def same(one: Image, two: Image, what: object, outputs: Sequence[str] = SAME) -> None:
    for name in outputs:
        assert np.array_equal(getattr(one, name), getattr(two, name)), (name, what)
