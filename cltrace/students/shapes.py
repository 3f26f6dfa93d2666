"""Every surface of a scene in arrays of doubles, and which of them rays meet: by the textbook's equations.

Surfaces are numbered here by part: each sphere is one, after all spheres each triangle is, and then each cylinder.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.scene import Scene
from cltrace.students.rules import SurfaceRules

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Bits = NDArray[np.bool_]

# Points are off their surfaces by rounding. A ray meets nothing nearer than this share of the scene's size.
ROUNDING = 2.0**-34
_FEW = 24  # parts that are all tried
_FAN = 4  # nodes below one, and parts in a leaf
_BLOCK = 2048  # rays at once
_KEPT = 256  # answers
SPHERE, TRIANGLE, CYLINDER = range(3)  # kinds of parts


def dot(a: Floats, b: Floats) -> Floats:
    """(..., n) of (..., n, 3) each."""
    return np.asarray((a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]) + a[..., 2] * b[..., 2])


def unit(a: Floats) -> Floats:
    """(..., 3) of length 1; 0 stays 0."""
    length = np.sqrt(dot(a, a))
    return np.asarray(a / np.where(length > 0, length, 1.0)[..., None])


def cross(a: Floats, b: Floats) -> Floats:
    """(n, 3) of (n, 3) each, far faster than numpy's own for few."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def turned(maps: Floats, a: Floats) -> Floats:
    """(n, 3): maps (n, 3, 3) times vectors (n, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", maps, a))


@dataclass(frozen=True, eq=False)
class Rays:
    """n rays. origins, directions: (n, 3), the latter unit vectors; parts: (n,) what each starts on, -1 for nothing;
    lengths: (n,) of the directions as they should not be, 1 otherwise. Rays are equal that meet the same.
    """

    origins: Floats
    directions: Floats
    parts: Ints
    lengths: Floats

    def __len__(self) -> int:
        return len(self.origins)

    def at(self, rows: NDArray[Any]) -> Rays:
        return Rays(self.origins[rows], self.directions[rows], self.parts[rows], self.lengths[rows])

    @cached_property
    def _hash(self) -> int:
        return hash((self.origins.tobytes(), self.directions.tobytes(), self.parts.tobytes()))

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Rays) and self._hash == other._hash


@dataclass(frozen=True)
class Points:
    """Where rays meet surfaces, n points.

    places: (n, 3); outward: (n, 3) unit normals to the outside; inside: (n,) whether the ray came from there; uv:
    (n, 2); materials: (n,) indices; parts: (n,).
    """

    places: Floats
    outward: Floats
    inside: Bits
    uv: Floats
    materials: Ints
    parts: Ints


class Shapes:
    """The surfaces of a scene, with what the rules say of transforms and normals."""

    def __init__(self, scene: Scene, rules: SurfaceRules) -> None:
        self.rules = rules
        self._spheres(scene)
        self._triangles(scene)
        self.cylinders, first_cylinder = scene.cylinders, len(self.radii) + len(self.mesh_of)
        self.first = 0, len(self.radii), first_cylinder  # part of each kind
        self.kinds = np.repeat(range(3), [len(self.radii), len(self.mesh_of), len(self.cylinders)])
        materials = self.mesh_materials[self.mesh_of], self.cylinders["material"].astype(np.intp)
        self.materials = np.concatenate([scene.spheres["material"].astype(np.intp), *materials])
        numbers = np.array([m.number for m in scene.meshes], np.intp)[self.mesh_of]
        self.numbers = np.concatenate([scene.sphere_numbers, numbers, self.cylinders["number"]])
        self.order = np.argsort(self.numbers, kind="stable")
        self.rank = np.argsort(self.order)
        low, high = self._bounds()
        self.size = max(float(np.abs([low, high]).max(initial=0)), *map(abs, scene.camera.position), 1e-300)
        self.tree = Tree(low, high) if len(low) > _FEW else None
        self.clear = scene.materials["transmittance"][self.materials] > 0
        # Most mistakes leave most rays as they are.
        self.crossings, self.seen = lru_cache(_KEPT)(self._crossings), lru_cache(_KEPT)(self._points_seen)

    def _spheres(self, scene: Scene) -> None:
        self.centers, self.radii = scene.spheres["center"].copy(), scene.spheres["radius"].copy()
        self.to_object = np.concatenate([scene.to_object, np.eye(3)[None]])
        self.map_of = scene.spheres["to_object"].astype(np.intp)  # -1 is the last one
        moved = self.rules.transforms not in ("file", "moved-first") or self.rules.normals == "none"
        if moved and scene.source:
            self._place(scene, self.rules.transforms)
        self.to_world, self.has_maps = np.linalg.inv(self.to_object), bool((self.map_of >= 0).any())

    def _place(self, scene: Scene, order: str) -> None:
        """Places the spheres that have a transform once more, by its steps in another order."""
        assert scene.source
        maps = list(self.to_object[:-1])
        for i, number in enumerate(scene.sphere_numbers.tolist()):
            steps = scene.source.transforms.get(number)
            if steps is None:
                continue
            right = product(steps)
            own = np.linalg.inv(right) @ np.append(self.centers[i], 1.0)
            if self.map_of[i] < 0:
                self.radii[i] /= np.cbrt(abs(np.linalg.det(right[:3, :3])))
            matrix = product(edited(steps, order))
            shift = matrix[:3, 3]
            self.centers[i] = own[:3] + shift if order == "placed-last" else (matrix @ own)[:3]
            self.map_of[i] = len(maps)
            maps.append(np.linalg.inv(matrix[:3, :3]))
        self.to_object = np.array([*maps, np.eye(3)])

    def _triangles(self, scene: Scene) -> None:
        meshes = scene.meshes
        self.mesh_of = np.repeat(np.arange(len(meshes)), [len(m.geometry.faces) for m in meshes])
        self.mesh_materials = np.array([m.material for m in meshes], np.intp)
        corners, own, normals, uv, front = ([np.zeros((0, *s))] for s in ((3, 3), (3, 3), (3, 3), (3, 2), ()))
        linear = []
        for mesh in meshes:
            shape, matrix = mesh.geometry, self._placed(scene, mesh.number, mesh.to_world)
            linear.append(matrix[:, :3])
            corners.append((shape.vertices @ matrix[:, :3].T + matrix[:, 3])[shape.faces])
            own.append(shape.vertices[shape.faces])
            given = shape.normal_of[:, :1, None] >= 0
            normals.append(np.where(given, np.concatenate([shape.normals, np.zeros((1, 3))])[shape.normal_of], 0.0))
            given = shape.uv_of[:, :1, None] >= 0
            uv.append(np.where(given, np.concatenate([shape.uv, np.zeros((1, 2))])[shape.uv_of], 0.0))
            front.append(mesh.front.astype(np.float64))
        self.corners, self.corner_normals, self.corner_uv = (np.concatenate(x) for x in (corners, normals, uv))
        self.front, ends = np.concatenate(front), np.concatenate(own)
        self.edges = self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0]
        self.flat = cross(*self.edges)
        self.own_flat = cross(ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 0])
        self.linear: Floats = np.array(linear, np.float64).reshape(-1, 3, 3)
        self.inverse: Floats = np.asarray(np.linalg.inv(self.linear), np.float64)

    def _placed(self, scene: Scene, number: int, matrix: Floats) -> Floats:
        """The map of a mesh to the world, (3, 4)."""
        order = self.rules.transforms
        steps = scene.source.transforms.get(number) if scene.source else None
        if order not in ("file", "moved-first") and steps is not None:
            return product(edited(steps, order))[:3]
        if order == "moved-first":
            return np.concatenate([matrix[:, :3], matrix[:, :3] @ matrix[:, 3:]], axis=1)
        return matrix

    def _bounds(self) -> tuple[Floats, Floats]:
        reach = self.radii[:, None] * np.sqrt(np.square(self.to_world).sum(axis=2))[self.map_of]
        (start, end), r = (self.cylinders[name] for name in ("start", "end")), self.cylinders["radius"][:, None]
        low = np.concatenate([self.centers - reach, self.corners.min(axis=1), np.minimum(start, end) - r])
        return low, np.concatenate([self.centers + reach, self.corners.max(axis=1), np.maximum(start, end) + r])

    def _points_seen(self, rays: Rays, near: float) -> tuple[Ints, Points | None]:
        """Which of the rays meet something further off than `near`, and the points there."""
        t, parts = self.nearest(rays, near)
        hit = np.flatnonzero(parts >= 0)
        return hit, self.points(rays.at(hit), t[hit], parts[hit]) if len(hit) else None

    # Which parts rays meet

    def nearest(self, rays: Rays, least: float = 0.0) -> tuple[Floats, Ints]:
        """How far each ray goes, (n,), inf where it meets nothing, and to which part, (n,), -1 for none.

        least: what is not further off than this is not met.
        """
        r, k, far = self.crossings(rays)
        beyond = far > least
        r, k, far = r[beyond], k[beyond], far[beyond]
        t, rank = np.full(len(rays), np.inf), np.full(len(rays), len(self.order), np.intp)
        if self.rules.hits != "nearest":
            return self._other(len(rays), r, k, far)
        np.minimum.at(t, r, far)
        # Of faces in one place, the lowest number is met.
        first = far <= t[r] + ROUNDING * self.size
        np.minimum.at(rank, r[first], self.rank[k[first]])
        return t, np.append(self.order, -1)[rank]

    def _other(self, count: int, r: Ints, k: Ints, far: Floats) -> tuple[Floats, Ints]:
        """As nearest() answers, by a mistake: the last or first surface of the file, or the furthest one."""
        number, rank = self.numbers[k], self.rank[k]
        # Of a surface that is met more than once it is the nearest point.
        by = {
            "last": (-far, number), "last part": (-far, rank), "first": (-far, -number), "farthest": (rank, far),
        }[self.rules.hits]  # fmt: skip
        order = np.lexsort(by)
        t, parts = np.full(count, np.inf), np.full(count, -1, np.intp)
        t[r[order]], parts[r[order]] = far[order], k[order]
        return t, parts

    def stopped(self, rays: Rays, least: Floats, most: Floats, own: bool = True) -> Bits:
        """(n,): whether anything is on a ray's way between two distances, (n,) each.

        own: whether that may be the surface that it starts on.
        """
        r, k, t = self.crossings(rays)
        found = np.zeros(len(rays), np.bool_)
        stops = True if self.rules.clear_shadows else ~self.clear[k]
        found[r[(t > least[r]) & (t < most[r]) & (own | (k != rays.parts[r])) & stops]] = True
        return found

    def _crossings(self, rays: Rays) -> tuple[Ints, Ints, Floats]:
        """Rays, parts that they cross, and how far off, all of which is more than rounding: of a sphere up to twice."""
        blocks = [block for start in range(0, max(len(rays), 1), _BLOCK) for block in self._crossed(rays, start)]
        r, k, t = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
        return r, k, t

    def _crossed(self, rays: Rays, start: int) -> Iterator[tuple[Ints, Ints, Floats]]:
        block = rays.at(np.arange(start, min(start + _BLOCK, len(rays))))
        if self.tree:
            r, k = self.tree.near(block)
        else:
            r = np.repeat(np.arange(len(block)), len(self.materials))
            k = np.tile(np.arange(len(self.materials)), len(block))
        missing = {"": None, "s": SPHERE, "m": TRIANGLE, "c": CYLINDER}[self.rules.missing]
        crossed = {SPHERE: self._spheres_crossed, TRIANGLE: self._triangles_crossed, CYLINDER: self._cylinders_crossed}
        for kind, ends_of in crossed.items():
            of_kind = self.kinds[k] == kind if kind != missing else np.zeros(len(k), np.bool_)
            i, j = r[of_kind], k[of_kind]
            for t in ends_of(block, i, j - self.first[kind], rays.parts[start + i] == j):
                met = t > ROUNDING * self.size  # not where t is NaN
                yield i[met] + start, j[met], t[met]

    def _looked_at(self, near: Floats, far: Floats) -> tuple[Floats, ...]:
        """Those of the two ends of the way through a solid that the rules have."""
        return {"both": (near, far), "near": (near,), "far": (far,)}[self.rules.roots]

    # The t of rays i in parts k of a kind; NaN for none. own: (n,) whether the ray starts on it.

    def _spheres_crossed(self, rays: Rays, i: Ints, k: Ints, own: Bits) -> tuple[Floats, ...]:
        """The roots t of |K (o + t d - C)| = r."""
        o, d = rays.origins[i] - self.centers[k], rays.directions[i]
        if self.has_maps:
            maps = self.to_object[self.map_of[k]]
            o, d = turned(maps, o), turned(maps, d)
        # A ray is at t = 0 on the surface where it starts, so there c is 0 but for rounding.
        a, b, c = dot(d, d), -dot(o, d), np.where(own, 0.0, dot(o, o) - self.radii[k] ** 2)
        with np.errstate(invalid="ignore"):
            root = np.sqrt(b * b - a * c)
        return self._looked_at((b - root) / a, (b + root) / a)

    def _cylinders_crossed(self, rays: Rays, i: Ints, k: Ints, own: Bits) -> tuple[Floats, ...]:
        """The ends of what is within the endless cylinder and between the ends' planes."""
        cylinders, d = self.cylinders[k], rays.directions[i]
        axis = cylinders["end"] - cylinders["start"]
        length = np.sqrt(dot(axis, axis))
        u, o = axis / length[:, None], rays.origins[i] - cylinders["start"]
        along, speed = dot(o, u), dot(d, u)
        across, way = o - along[:, None] * u, d - speed[:, None] * u
        a, b, c = dot(way, way), -dot(across, way), dot(across, across) - cylinders["radius"] ** 2
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(b * b - a * c)
            ends = np.sort([-along / speed, (length - along) / speed], axis=0)
            near, far = np.fmax((b - root) / a, ends[0]), np.fmin((b + root) / a, ends[1])
        met = (near <= far) & ((b * b >= a * c) | (a == 0))
        # A ray is at t = 0 on the surface where it starts.
        starts_near = np.abs(near) < np.abs(far)
        near = np.where(met & ~(own & starts_near), near, np.nan)
        return self._looked_at(near, np.where(met & ~(own & ~starts_near), far, np.nan))

    def _triangles_crossed(self, rays: Rays, i: Ints, k: Ints, own: Bits) -> tuple[Floats]:
        """A ray does not meet the one that it starts on."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            t, b, c = self._crossing(rays.origins[i], rays.directions[i], k)
            hit = (b >= 0) & (c >= 0) & (b + c <= 1) & ~own
            if self.rules.culled:
                hit &= self._is_seen(rays.directions[i], k)
        return (np.where(hit, t, np.nan),)

    def _is_seen(self, d: Floats, row: Ints) -> Bits:
        side = dot(d, self.flat[row]) * (self.front[row] if self.rules.culled in ("back", "front") else 1.0)
        return np.asarray(side < 0 if self.rules.culled in ("back", "clockwise") else side > 0)

    def _crossing(self, o: Floats, d: Floats, row: Ints) -> tuple[Floats, Floats, Floats]:
        """Where rays cross the planes of triangles: t, and the weights of their second and third corners."""
        e1, e2 = self.edges[0][row], self.edges[1][row]
        p, s = cross(d, e2), o - self.corners[row, 0]
        q = cross(s, e1)
        scale = 1.0 / dot(e1, p)
        return dot(e2, q) * scale, dot(s, p) * scale, dot(d, q) * scale

    # What is there

    def points(self, rays: Rays, t: Floats, parts: Ints) -> Points:
        """What rays meet at t, all of which meet something."""
        places, n = rays.origins + t[:, None] * rays.directions, len(rays)
        outward, inside, uv = np.zeros((n, 3)), np.zeros(n, np.bool_), np.zeros((n, 2))
        on = {SPHERE: self._on_spheres, TRIANGLE: self._on_triangles, CYLINDER: self._on_cylinders}
        for kind, points_on in on.items():
            rows = np.flatnonzero(self.kinds[parts] == kind)
            k = parts[rows] - self.first[kind]
            outward[rows], inside[rows], uv[rows] = points_on(rays.at(rows), places[rows], k)
        return Points(places, outward, inside=inside, uv=uv, materials=self.materials[parts], parts=parts)

    # The outward normals, whether the ray comes from inside, and u and v, of points on parts k of a kind.

    def _on_spheres(self, rays: Rays, places: Floats, k: Ints) -> tuple[Floats, Bits, Floats]:
        to_object, to_world = self.to_object[self.map_of[k]], self.to_world[self.map_of[k]]
        long = turned(to_object, places - self.centers[k])
        q = unit(long)
        true = unit(turned(to_object.transpose(0, 2, 1), q))
        wrong = {"right": true, "matrix": turned(to_world, q), "none": q, "inverse": turned(to_object, q)}
        outward = unit(wrong["right" if self.rules.normals_of == "m" else self.rules.normals])
        if self.rules.long_normals.endswith(("t", "r")):
            outward = turned(to_object.transpose(0, 2, 1), q if "t" in self.rules.long_normals else long)
        inside = dot(rays.directions, outward if self.rules.sided_by_normal else true) > 0
        u = 0.5 + np.arctan2(q[:, 0] + 0.0, q[:, 2]) / (2 * np.pi)
        v = np.arctan2(np.hypot(q[:, 0], q[:, 2]), q[:, 1]) / np.pi
        return outward, inside, np.stack([u, v], axis=1)

    def _on_cylinders(self, rays: Rays, places: Floats, k: Ints) -> tuple[Floats, Bits, Floats]:
        """A point is on a flat end if the plane of that is as near as the side."""
        cylinders = self.cylinders[k]
        axis = cylinders["end"] - cylinders["start"]
        length = np.sqrt(dot(axis, axis))
        u, p = axis / length[:, None], places - cylinders["start"]
        along = dot(p, u)
        m = p - along[:, None] * u
        gaps = np.abs([np.sqrt(dot(m, m)) - cylinders["radius"], along, length - along])
        part = gaps.argmin(axis=0)[:, None]
        outward = np.where(part == 0, unit(m), np.where(part == 1, -u, u))
        e1 = cross(np.eye(3)[np.abs(axis).argmin(axis=1)], axis)
        around = np.arctan2(dot(m, unit(cross(axis, e1))), dot(m, unit(e1))) / (2 * np.pi)
        down = 1 - np.clip(along / length, 0, 1)
        uv = np.stack([0.5 + around, np.where(part[:, 0] == 0, down, np.round(down))], axis=1)
        return outward, dot(rays.directions, outward) > 0, uv

    def _on_triangles(self, rays: Rays, _: Floats, k: Ints) -> tuple[Floats, Bits, Floats]:
        """Normals interpolated in the object's space; outward is the side where the triangle's front is."""
        o, d = rays.origins, rays.directions
        with np.errstate(divide="ignore", invalid="ignore"):
            _, b, c = self._crossing(o, d, k)
        weights = np.stack([1 - b - c, b, c], axis=1)[:, :, None]
        own = (weights * self.corner_normals[k]).sum(axis=1)
        without = ~own.any(axis=1)
        linear, inverse = self.linear[self.mesh_of[k]], self.inverse[self.mesh_of[k]]
        maps: dict[str, Floats] = {"right": inverse.transpose(0, 2, 1), "matrix": linear, "inverse": inverse}
        which, flat = "right" if self.rules.normals_of == "s" else self.rules.normals, self.rules.flat_normals
        front = self.flat[k] * self.front[k][:, None]
        m = np.where(without[:, None], self.own_flat[k] * self.front[k][:, None], own)
        m = turned(maps[which], m) if which in maps else m
        m = m if flat else np.where(without[:, None], front, m)
        inside = dot(d, front) > 0
        # The rule of the format: a shading normal is on the side that the ray came from.
        seen = m if "m" in self.rules.long_normals else unit(m)
        seen = np.where((dot(seen, d) > 0)[:, None], -seen, seen)
        return np.where(inside[:, None], -seen, seen), inside, (weights * self.corner_uv[k]).sum(axis=1)


def edited(steps: Floats, how: str) -> Floats:
    """The steps of a transform (k, 3, 4) as a mistake has them: in reverse, without those of a kind, or turned.

    how: "reversed"; "none", "no-scale", "no-rotation", "no-translation"; "turned back" with each rotation the other
    way, "transposed" with each matrix, "radians" with the degrees of rotations taken for such, and "radians, positive"
    with those between 0 and 360. All else leaves them.
    """
    if how == "reversed":
        return steps[::-1]
    if how == "none":
        return steps[:0]
    linear = steps[:, :, :3]
    moves = (linear == np.eye(3)).all(axis=(1, 2))
    scales = (linear * (1 - np.eye(3)) == 0).all(axis=(1, 2)) & ~moves
    turns = ~moves & ~scales
    kinds = {"no-scale": scales, "no-rotation": turns, "no-translation": moves}
    if how in kinds:
        return np.asarray(steps[~kinds[how]])
    steps = steps.copy()
    if how in ("turned back", "transposed"):
        steps[turns, :, :3] = linear[turns].transpose(0, 2, 1)
    if how == "transposed":
        return np.concatenate([steps[moves], steps[~moves][::-1]])
    if how.startswith("radians"):
        for i in np.flatnonzero(turns):
            x = int(np.diag(linear[i]).argmax())
            y, z = (x + 1) % 3, (x + 2) % 3
            angle = math.degrees(math.atan2(linear[i][z, y], linear[i][y, y]))
            angle = angle % 360 if "positive" in how else angle
            steps[i, [y, z], [y, z]] = math.cos(angle)
            steps[i, [y, z], [z, y]] = -math.sin(angle), math.sin(angle)
    return steps


def product(steps: Floats) -> Floats:
    """(4, 4): the product of affine maps (k, 3, 4), of which the last one acts first."""
    matrix = np.eye(4)
    for step in steps:
        matrix = matrix @ np.concatenate([step, [[0.0, 0.0, 0.0, 1.0]]])
    return matrix


class Tree:
    """Boxes around boxes around parts, in the order of a curve through space. low, high: (n, 3), the parts' bounds."""

    def __init__(self, low: Floats, high: Floats) -> None:
        middle = low + high
        extent = np.maximum(middle.max(axis=0) - middle.min(axis=0), 1e-300)
        cell = ((middle - middle.min(axis=0)) / extent * 1023).astype(np.uint64)
        code = np.zeros(len(low), np.uint64)
        for bit in range(10):
            for axis in range(3):
                code |= ((cell[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
        self.order = np.argsort(code, kind="stable")
        slack = 1e-9 * np.maximum(np.abs(low), np.abs(high)).max(initial=0)
        levels = [(low[self.order].T - slack, high[self.order].T + slack)]
        while len(levels[-1][0][0]) > _FAN:
            (below, above), starts = levels[-1], np.arange(0, len(levels[-1][0][0]), _FAN)
            levels.append((np.minimum.reduceat(below, starts, axis=1), np.maximum.reduceat(above, starts, axis=1)))
        self.levels = levels[::-1]

    def near(self, rays: Rays) -> tuple[Ints, Ints]:
        """Pairs of rays and parts whose boxes they meet."""
        origins, directions = (np.ascontiguousarray(a.T) for a in (rays.origins, rays.directions))  # an axis a row
        reciprocal = 1 / np.where(np.abs(directions) > 1e-200, directions, 1e-200)
        first = self.levels[0][0].shape[1]
        r, k = np.repeat(np.arange(len(rays)), first), np.tile(np.arange(first), len(rays))
        for level, (low, high) in enumerate(self.levels):
            if level:
                r, k = np.repeat(r, _FAN), (k[:, None] * _FAN + np.arange(_FAN)).ravel()
                r, k = r[k < low.shape[1]], k[k < low.shape[1]]
            enters, leaves = np.zeros(len(r)), np.full(len(r), np.inf)
            for below, above, o, inverse in zip(low, high, origins, reciprocal, strict=True):
                start, scale = o[r], inverse[r]
                one, two = (below[k] - start) * scale, (above[k] - start) * scale
                np.maximum(enters, np.minimum(one, two), out=enters)
                np.minimum(leaves, np.maximum(one, two), out=leaves)
            met = leaves >= enters
            r, k = r[met], k[met]
        return r, self.order[k]
