"""Spheres and ellipsoids as the oracle has them, and public questions about them alone.

Spheres are given by centers (m, 3) and radii (m,) or one number for all, > 0; all numbers are finite. Every public
function raises ValueError, which names the argument, where one is not of its shape or a value is not allowed. Touching
counts, equal roots go to the lowest index, and a zero direction hits nothing.

In front of the exact engine is a filter: double-double arithmetic in numpy, which keeps count of its errors. With

    f = C - o,  a = d.d,  b = f.d,  c = f.f - r^2,  D = b^2 - a c

a ray o + t d meets a sphere at t = (b -/+ sqrt(D)) / a, and the first t > 0 is

    c > 0 (origin outside):  a hit iff b > 0 and D >= 0, at (b - sqrt(D)) / a = c / (b + sqrt(D))
    c < 0 (inside):          a hit,                      at (b + sqrt(D)) / a
    c = 0 (on the surface):  a hit iff b > 0,            at (b + sqrt(D)) / a = 2 b / a    (the root 0 is not a hit)

An ellipsoid |K (p - C)| = r is a sphere in its own axes, with K f and K d for f and d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import atan2, sqrt
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.base.arithmetic import Floats, dot, minus, product, two_sum
from cltrace.exact.fine import Fine, FineVector, fine_vector, select
from cltrace.exact.lines import ExactPoint, Frame, Line, Root
from cltrace.exact.shapes import ExactSphere
from cltrace.oracle.rays import Ids, Points, Rays, Rough, along, at_point, moderate, rounded, to_light, turned
from cltrace.oracle.search import Bools, Hits, Kind, Kinds, on_hits
from cltrace.scene import Scene
from cltrace.scene.rules import is_whole, numbers

Maps = Sequence[ArrayLike | None]

# Up to what the filter takes numbers, see moderate(). The largest and the smallest of its numbers, D of an ellipsoid,
# has 8 such factors, two of which may be differences, 2^-52 of that. So nothing leaves the range of double, nor does
# EPS times a number.
MOST = 2.0**100


# ------------------------------------------------------------------------------------------------- what is handed over


def array_of(name: str, value: ArrayLike, *shape: int) -> Floats:
    """`value` as finite doubles of this shape, where -1 is any length; [] is none of them."""
    array = numbers(name, value)
    if array.shape == (0,) and shape[:1] == (-1,):
        array = array.reshape(0, *shape[1:])
    if len(array.shape) != len(shape) or any(n not in (-1, got) for n, got in zip(shape, array.shape, strict=True)):
        wanted = str(tuple("n" if n < 0 else n for n in shape)).replace("'", "") if shape else "() (one number)"
        raise ValueError(f"{name}: must have shape {wanted}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: must be finite")
    return array


def _balls(centers: ArrayLike, radii: ArrayLike) -> tuple[Floats, Floats]:
    """(m, 3) and (m,)."""
    places = array_of("centers", centers, -1, 3)
    sizes = numbers("radii", radii)
    sizes = array_of("radii", np.full(len(places), sizes) if sizes.ndim == 0 else sizes, -1)
    if len(sizes) != len(places):
        raise ValueError(f"radii: must be one number or as many as centers, {len(places)}, got {len(sizes)}")
    if not (sizes > 0).all():
        raise ValueError(f"radii: must be > 0, got {sizes[~(sizes > 0)][0]:g}")
    return places, sizes


def _ball(center: ArrayLike, radius: float, names: tuple[str, str] = ("center", "radius")) -> tuple[Floats, float]:
    size = float(array_of(names[1], radius))
    if size <= 0:
        raise ValueError(f"{names[1]}: must be > 0, got {size:g}")
    return array_of(names[0], center, 3), size


def _exact(name: str, values: Sequence[float | Fraction]) -> list[float | Fraction]:
    """Three numbers, each finite; a Fraction must be one that has a double's kind of denominator, a power of two."""
    rows = list(values) if np.ndim(np.asarray(values, object)) == 1 else []
    if len(rows) != 3:
        raise ValueError(f"{name}: must be 3 numbers, got {values!r}")
    if not any(isinstance(v, Fraction) for v in rows):
        given: Any = rows
        return list(array_of(name, given, 3).tolist())
    out = [v if isinstance(v, Fraction) else float(array_of(name, v)) for v in rows]
    if any(isinstance(v, Fraction) and v.denominator & (v.denominator - 1) for v in out):
        raise ValueError(f"{name}: the denominator of a Fraction must be a power of two, got {values!r}")
    return out


def _light(light: ArrayLike, kind: str) -> Floats:
    if kind not in ("point", "parallel"):
        raise ValueError(f"kind: must be 'point' or 'parallel', got {kind!r}")
    array = array_of("light", light, 3)
    if kind == "parallel" and not array.any():
        raise ValueError("light: the direction of parallel light must not be 0")
    return array


# ---------------------------------------------------------------------------------------------------------- the kind


@dataclass(frozen=True, eq=False)
class Spheres(Kind):
    """Spheres, or ellipsoids |K (p - C)| = r where to_object, K (3, 3), is not None."""

    centers: Floats
    radii: Floats
    to_object: Maps
    surface: Ids

    @classmethod
    def of(cls, scene: Scene) -> Spheres:
        """All of a scene."""
        maps = [None if i < 0 else scene.to_object[i] for i in scene.spheres["to_object"]]
        return cls(scene.spheres["center"], scene.spheres["radius"], maps, scene.sphere_numbers.astype(np.int64))

    @cached_property
    def bent(self) -> Bools:
        return np.array([K is not None for K in self.to_object], bool)

    @cached_property
    def maps(self) -> Floats:
        """(m, 3, 3): K, 1 of spheres."""
        maps = np.tile(np.eye(3), (len(self.radii), 1, 1))
        for i in np.flatnonzero(self.bent).tolist():
            maps[i] = self.to_object[i]
        return maps

    def rounded_inverses(self, item: Ids) -> tuple[FineVector, FineVector, FineVector]:
        """The rows of K^-1 of ellipsoids."""
        used, place = np.unique(item, return_inverse=True)
        parts = []
        for inverse, divisor in (self.solid(i).inverse for i in used.tolist()):
            parts += [Fine.rounded(Fraction(x, divisor)) for row in inverse for x in row]
        table = np.array([(x.h, x.l, x.error) for x in parts], float).reshape(-1, 9, 3)[place]
        rows = [Fine(*(column.copy() for column in table[:, k].T)) for k in range(9)]
        return (rows[0], rows[1], rows[2]), (rows[3], rows[4], rows[5]), (rows[6], rows[7], rows[8])

    @cached_property
    def _same(self) -> Ids:
        """(m,): the first of all surfaces that are equal to each, which hides the others."""
        _, which, count = np.unique(self.centers[:, 0], return_inverse=True, return_counts=True)
        same, rows = np.arange(len(which)), np.flatnonzero(count[which] > 1)  # mostly few, as sorting rows takes long
        _, first, which = np.unique(self._numbers[rows], axis=0, return_index=True, return_inverse=True)
        same[rows] = rows[first[which.ravel()]]
        return same

    @cached_property
    def _numbers(self) -> Floats:
        """(m, 4), or (m, 13) where there are ellipsoids."""
        maps = [self.maps.reshape(-1, 9)] if self.bent.any() else []
        return np.concatenate([self.centers, self.radii[:, None], *maps], axis=1)

    @cached_property
    def _outer(self) -> Floats:
        """(m,): bounds of how far the surfaces are from their centres."""
        sizes = np.ones(len(self.radii))
        for i in np.flatnonzero(self.bent).tolist():
            rows, divisor = self.solid(i).inverse
            sizes[i] = float(sum(Fraction(abs(x), divisor) for row in rows for x in row))
        return np.asarray(self.radii * sizes * (1 + 2.0**-40))

    @property
    def extent(self) -> float:
        return float(np.abs(self.centers).max(initial=0) + self._outer.max(initial=0))

    @cached_property
    def moderate(self) -> Bools:
        """(m,): which ones' numbers are within the range of the filter."""
        return moderate(self._numbers, MOST)

    def near(self, rays: Rays) -> tuple[Ids, Ids]:
        """With f from the start to a centre, R its reach and u = 2^-53, a ray along w passes by where |f x w| > R |w|,
        and leads away where f.w < -R |w|. f = (C - anchor) - step is off by 2^-49 reach and 3 u (|f|_1 + reach), and w
        by 2^-50 of its length. So f x w and f.w are off by less than 2^-47 s length for s = |f|_1 + reach, and |w| by
        2^-50 length. Twice that covers the roundings beside these.
        """
        assert rays.rough is not None
        rough, first = rays.rough, np.flatnonzero(self._same == np.arange(len(self.radii)))
        w, length = rounded(rough.way).T[:, :, None], rough.length[:, None]
        x, y, z = ((self.centers[first, i] - rough.anchor[:, i, None]) - rough.step[i].h[:, None] for i in range(3))
        u, v, s = y * w[2] - z * w[1], z * w[0] - x * w[2], x * w[1] - y * w[0]
        size = (np.abs(x) + np.abs(y) + np.abs(z)) + rough.reach[:, None]
        room = self._outer[first] * (np.sqrt(dot(w, w)) + 2.0**-49 * length) + 2.0**-46 * size * length
        beside = (u * u + v * v + s * s > room * room) | (x * w[0] + y * w[1] + z * w[2] < -room)
        ray, item = np.nonzero(~(beside & rough.fits(MOST)[:, None] & self.moderate[first]))
        return ray, first[item]

    def hits(self, rays: Rays, ray: Ids, item: Ids) -> Hits:
        """By the equation, whose numbers count their errors."""
        assert rays.rough is not None
        # A ray to a light at a point starts at the light.
        left = (rays.left(Spheres) if np.all(rays.t_max == np.inf) else np.full(len(rays), -1))[ray]
        own = (left >= 0) & (np.append(self._same, -1)[left] == item)
        f, w = self._seen(rays.rough.at(ray), item)
        r, zero = Fine.of(self.radii[item]), Fine.of(np.zeros(len(ray)))
        a, b, c = dot(w, w), dot(f, w), select(own, zero, dot(f, f) - r * r)
        D = b * b - a * c
        outside, ahead, meets = np.where(own, -1, c.sign()), b.sign(), D.sign()
        sure = (meets > 0) & np.where(outside > 0, ahead > 0, (outside < 0) & (~own | (ahead > 0)))
        miss = np.where(own, ahead < 0, (meets < 0) | ((outside > 0) & (ahead < 0)))
        fit = rays.rough.fits(MOST)[ray] & self.moderate[item]
        direct, root = (outside < 0) & (b.h >= 0), Fine(np.maximum(D.h, 0), D.l, D.error).root()
        n = select(b.h < 0, -b, b) + root
        t = select(direct, n, select(outside < 0, -c, c)) / select(direct, a, n)
        sure, gone = sure & fit, miss & fit
        t = Fine(t.h, t.l, np.where(sure & (t.error < 2.0**-41 * t.h), t.error, np.inf))
        kept = np.flatnonzero(~gone)
        return Hits(ray[kept], item[kept], sure[kept], t[kept])

    def _seen(self, rough: Rough, item: Ids) -> tuple[FineVector, FineVector]:
        """From the start to the centre, and the way; both in an ellipsoid's own axes."""
        zero = np.zeros(len(item))
        x, y, z = (Fine(*two_sum(self.centers[item, i], -rough.anchor[:, i]), zero) for i in range(3))
        f, w, bent = minus((x, y, z), rough.step), rough.way, np.flatnonzero(self.bent[item])
        if not len(bent):
            return f, w
        rows = [fine_vector(self.maps[item[bent], i]) for i in range(3)]
        for v in (f, w):
            put(v, bent, product(rows, at_rows(v, bent)))
        return f, w

    def solid(self, item: int) -> ExactSphere:
        K = self.to_object[item]
        return ExactSphere(
            self.centers[item].tolist(), float(self.radii[item]), None if K is None else np.asarray(K, float).tolist()
        )


def at_rows(v: FineVector, rows: Ids) -> FineVector:
    return v[0][rows], v[1][rows], v[2][rows]


def put(v: FineVector, rows: Ids, values: FineVector) -> None:
    """Puts other numbers into these rows."""
    for x, y in zip(v, values, strict=True):
        x.h[rows], x.l[rows], x.error[rows] = y.h, y.l, y.error


def on_spheres(spheres: Spheres, own: Ids, normal: Floats, basis: ArrayLike) -> Points:
    """Points of the spheres `own`, (n,). normal: (n, 3), of any length but 0, of a sphere in camera space, and of an
    ellipsoid in its own axes; basis: (3, 3), the camera's axes in the world."""
    bent, frame = np.flatnonzero(spheres.bent[own]), Frame(tuple(map(tuple, np.asarray(basis, float).tolist())))

    def place(i: int) -> ExactPoint:
        q = normal[i].tolist()
        return spheres.solid(int(own[i])).point(q if spheres.bent[own[i]] else frame.to_world(q).fractions())

    n = turned(normal, basis)
    with np.errstate(all="ignore"):  # what is not finite is not sure
        q = fine_vector(normal)
        factor = Fine.of(spheres.radii[own]) / select(spheres.bent[own], dot(q, q), dot(n, n)).root()
        if len(bent):
            put(n, bent, product(spheres.rounded_inverses(own[bent]), at_rows(q, bent)))
        factor.error[~(moderate(normal, MOST) & spheres.moderate[own])] = np.inf
        x, y, z = (part * factor for part in n)
    return Points((spheres.centers[own], (x, y, z)), place, own, Spheres)


# ------------------------------------------------------------------------------------------------------ rays and lights


class OnSphere(NamedTuple):
    """The point center + radius normal / |normal|; the normal may have any length but 0.

    to_object: of an ellipsoid, see `closest_from`; then the point is center + radius K^-1 normal / |normal|.
    """

    center: ArrayLike
    radius: float
    normal: Sequence[float | Fraction]
    to_object: ArrayLike | None = None


def _map(name: str, to_object: ArrayLike | None) -> Floats | None:
    if to_object is None:
        return None
    made = array_of(name, to_object, 3, 3)
    if not ExactSphere((0, 0, 0), 1, made.tolist()).inverse[1]:
        raise ValueError(f"{name}: must not be singular")
    return made


def _spheres(centers: ArrayLike, radii: ArrayLike, to_object: Maps | None = None) -> Spheres:
    places, sizes = _balls(centers, radii)
    if to_object is None:
        to_object = [None] * len(places)
    if len(to_object) != len(places):
        raise ValueError(f"to_object: must be as many as centers, {len(places)}, got {len(to_object)}")
    maps = [_map(f"to_object[{i}]", K) for i, K in enumerate(to_object)]
    return Spheres(places, sizes, maps, np.arange(len(places)))


def _start(start: ArrayLike | Sequence[Fraction] | OnSphere, count: int) -> Points:
    """Where so many rays start, exactly."""
    if isinstance(start, OnSphere):
        center, radius = _ball(start.center, start.radius, ("start.center", "start.radius"))
        n = _exact("start.normal", start.normal)
        if not any(n):
            raise ValueError("start.normal: must not be 0")
        to_object = _map("start.to_object", start.to_object)
        rows = None if to_object is None else to_object.tolist()
        place = ExactSphere(center.tolist(), radius, rows).point(n)
    else:
        place = ExactPoint.of(_exact("start", np.asarray(start, object).tolist()))
    return Points(None, lambda i: place, np.full(count, -1))


def _from_eye(origin: ArrayLike, direction: ArrayLike, centers: ArrayLike, radii: ArrayLike) -> tuple[Rays, Spheres]:
    """Rays from one point."""
    place, d = array_of("origin", origin, 3), array_of("direction", direction, -1, 3)
    return along(at_point(place, len(d)), d, np.eye(3)), _spheres(centers, radii)


def closest(
    origin: ArrayLike, direction: ArrayLike, centers: ArrayLike, radii: ArrayLike
) -> tuple[NDArray[np.int32], Floats]:
    """The nearest hit of every ray: sphere (n,) int32, -1 if none; t (n,), correctly rounded, inf if none.

    origin (3,), direction (n, 3), centers (m, 3), radii (m,) or one number > 0 for all: finite float64, taken as exact
    numbers. t is in units of the ray's direction, which may have any length; a direction of 0 hits nothing. Raises
    ValueError, which names the argument, where one is not of its shape or a value is not allowed.
    """
    rays, spheres = _from_eye(origin, direction, centers, radii)
    found = Kinds([spheres]).closest(rays)
    return found.item.astype(np.int32), found.rounded()


def closest_from(
    start: ArrayLike | Sequence[Fraction] | OnSphere,
    direction: Sequence[Sequence[float | Fraction]],
    centers: ArrayLike,
    radii: ArrayLike,
    t_min: float = 0.0,
    t_max: float = np.inf,
    to_object: Maps | None = None,
) -> tuple[NDArray[np.int32], Floats]:
    """What `closest` returns, for rays that start anywhere, by integers alone: the first t strictly within the range.

    to_object: for each sphere a matrix K (3, 3), which makes it the ellipsoid |K (p - C)| = r, or None.

    start: (3,), of which each may be a Fraction, or OnSphere; direction: rows of 3 numbers; t_min, t_max: the range,
    inf and -inf are no bounds.
    """
    if not (t_min < np.inf and t_max > -np.inf):  # nor NaN
        raise ValueError(f"t_min, t_max: must be numbers, t_min < inf and t_max > -inf, got {t_min!r}, {t_max!r}")
    shape = np.asarray(direction, object).shape  # of objects: a Fraction stays what it is
    if shape[1:] != (3,) and shape != (0,):
        raise ValueError(f"direction: must have shape (n, 3), got {shape}")
    spheres, points = _spheres(centers, radii, to_object), _start(start, len(direction))
    ways = [ExactPoint.of(_exact("direction", row)) for row in direction]
    rays = Rays(None, lambda i: Line(points.place(i), ways[i]), points.own, t_min=t_min, t_max=t_max)
    found = Kinds([spheres]).closest(rays)
    return found.item.astype(np.int32), found.rounded()


def blocked(
    start: OnSphere,
    light: ArrayLike,
    kind: Literal["point", "parallel"],
    centers: ArrayLike,
    radii: ArrayLike,
    to_object: Maps | None = None,
) -> bool:
    """Whether a sphere or an ellipsoid is met strictly between a point of one and a light.

    light: a position ("point") or the direction in which the light travels ("parallel"). From inside, the sphere that
    the ray starts on blocks as any other: if and only if the light is strictly outside.
    """
    rays = to_light(_start(start, 1), _light(light, kind), kind == "parallel")
    return bool(Kinds([_spheres(centers, radii, to_object)]).blocked(rays)[0])


def lit(
    origin: ArrayLike,
    direction: ArrayLike,
    hit_index: ArrayLike,
    centers: ArrayLike,
    radii: ArrayLike,
    light: ArrayLike,
    kind: Literal["point", "parallel"],
) -> tuple[Bools, Bools]:
    """(lit, facing), (n,) each, of the points P where rays meet the spheres hit_index, (n,); ValueError if not.

    light, kind: as of blocked(). facing: n.l > 0, where n is the normal that faces the side from which the ray came,
    and l leads from P to the light. lit: facing, and nothing blocks.
    """
    where = _light(light, kind)
    rays, spheres = _from_eye(origin, direction, centers, radii)
    own, m = np.broadcast_to(hit_index, len(rays)), len(spheres.radii)
    if own.dtype.kind != "i" or not ((own >= 0) & (own < m)).all():
        raise ValueError(f"hit_index: must be the index of one of the {m} spheres, got {hit_index!r}")
    points = on_hits(rays, spheres, own)
    shadow, facing = to_light(points, where, kind == "parallel"), np.zeros(len(own), bool)
    for i in range(len(own)):
        side = _hit(rays.line(i), spheres.solid(int(own[i]))).side
        outward, line = points.place(i) - spheres.solid(int(own[i])).center, shadow.line(i)
        # A light at a point leads to P.
        facing[i] = side * dot(outward.numbers, line.way).sign() * (1 if kind == "parallel" else -1) < 0
    return facing & ~Kinds([spheres]).blocked(shadow), facing


def _hit(line: Line, sphere: ExactSphere) -> Root:
    """Where a ray meets a sphere; ValueError if it does not."""
    root = sphere.first(line, 0.0, np.inf)
    if root is None:
        raise ValueError("the ray does not hit the sphere")
    return root


def t_high(origin: ArrayLike, direction_row: ArrayLike, center: ArrayLike, radius: float, bits: int = 160) -> Fraction:
    """The hit's t with a relative error below 2^-bits, bits >= 1; ValueError if there is no hit."""
    if not is_whole(bits) or bits < 1:
        raise ValueError(f"bits: must be a whole number >= 1, got {bits!r}")
    return _one(origin, direction_row, center, radius)[1].value(bits)


def _one(origin: ArrayLike, direction_row: ArrayLike, center: ArrayLike, radius: float) -> tuple[ExactSphere, Root]:
    """A sphere, and where a ray hits it."""
    place, size = _ball(center, radius)
    row = array_of("direction_row", direction_row, 3)
    rays, spheres = _from_eye(origin, row[None], place[None], size)
    return spheres.solid(0), _hit(rays.line(0), spheres.solid(0))


def normal_high(
    origin: ArrayLike, direction_row: ArrayLike, center: ArrayLike, radius: float
) -> tuple[Fraction, Fraction, Fraction]:
    """The outward unit normal (p - C) / r at the hit, each component to within 1e-50; ValueError if there is no hit."""
    sphere, root = _one(origin, direction_row, center, radius)
    from_center = root.point() - sphere.center
    # Each component is p + q sqrt(D) over a number; twice as many bits as q and that have leave 180 behind the point.
    bits = 180 + max(x.q.bit_length() for x in from_center.numbers)
    r = Fraction(radius) * from_center.over
    x, y, z = (part.between(bits).low / r for part in from_center.numbers)
    return x, y, z


def normal_error(normal: ArrayLike, exact: Sequence[Fraction]) -> float:
    """The angle between a normal of any length but 0 and one of normal_high(), radians."""
    n = [Fraction(x) for x in array_of("normal", normal, 3).tolist()]
    if not any(n):
        raise ValueError("normal: must not be 0")
    if len(exact) != 3:
        raise ValueError(f"exact: must be 3 numbers, got {exact!r}")
    cross = [n[i - 2] * exact[i - 1] - n[i - 1] * exact[i - 2] for i in range(3)]
    dot = sum((x * y for x, y in zip(n, exact, strict=True)), Fraction(0))
    return atan2(sqrt(sum(x * x for x in cross)), dot)


def to_world(basis: Sequence[Sequence[float]], v: Sequence[float]) -> tuple[Fraction, Fraction, Fraction]:
    """The vector v of camera space along the world's axes, exactly: v.x right + v.y up + v.z back."""
    if len(basis) != 3:
        raise ValueError(f"basis: must be 3 vectors, got {basis!r}")
    axes, parts = [[Fraction(x) for x in _exact("basis", a)] for a in basis], [Fraction(x) for x in _exact("v", v)]
    x, y, z = (sum((e * a[i] for e, a in zip(parts, axes, strict=True)), Fraction(0)) for i in range(3))
    return x, y, z
