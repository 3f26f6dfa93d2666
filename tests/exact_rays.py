"""Rays among spheres that the exact engine alone decides, one by one: what filters in doubles are held against."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, Literal, NamedTuple

import numpy as np

from cltrace.base.arithmetic import dot
from cltrace.exact.lines import ExactPoint, Line, Root
from cltrace.exact.shapes import ExactSphere
from cltrace.exact.surds import Surd

Numbers = Sequence[float | Fraction]


class OnSphere(NamedTuple):
    """The point center + radius normal / |normal|, or of an ellipsoid center + radius K^-1 normal / |normal|."""

    center: Any
    radius: float
    normal: Numbers
    to_object: Any = None


def spheres_of(centers: Any, radii: Any, to_object: Iterable[Any] | None = None) -> list[ExactSphere]:
    places = np.asarray(centers, float).reshape(-1, 3).tolist()
    sizes = np.broadcast_to(np.asarray(radii, float), len(places)).tolist()
    maps = [None if K is None else np.asarray(K).tolist() for K in to_object or [None] * len(places)]
    return [ExactSphere(*one) for one in zip(places, sizes, maps, strict=True)]


def point_of(start: Any) -> ExactPoint:
    if isinstance(start, OnSphere):
        (sphere,) = spheres_of([start.center], start.radius, [start.to_object])
        return sphere.point(list(start.normal))
    return ExactPoint.of(list(start))


def first_of(line: Line, spheres: Sequence[ExactSphere], t_min: float, t_max: float) -> tuple[int, Root] | None:
    best: tuple[int, Root] | None = None
    for i, sphere in enumerate(spheres):
        root = sphere.first(line, t_min, t_max)
        if root is not None and (best is None or root < best[1]):
            best = i, root
    return best


def closest_from(
    start: Any,
    directions: Iterable[Any],
    centers: Any,
    radii: Any,
    t_min: float = 0.0,
    t_max: float = math.inf,
    to_object: Any = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The sphere that each ray meets first, -1 for none, and t, correctly rounded."""
    place, spheres = point_of(start), spheres_of(centers, radii, to_object)
    found = [first_of(Line(place, ExactPoint.of(list(d))), spheres, t_min, t_max) for d in directions]
    index = np.array([one[0] if one else -1 for one in found], np.int32)
    return index, np.array([float(one[1]) if one else np.inf for one in found], float)


def shadow_line(point: ExactPoint, light: Any, kind: Literal["point", "parallel"]) -> tuple[Line, float]:
    if kind == "parallel":
        return Line(point, ExactPoint.of([-float(x) for x in light])), math.inf
    return Line(point, ExactPoint.of([float(x) for x in light]) - point), 1.0


def lit(
    origin: Any, rows: Any, index: Any, centers: Any, radii: Any, light: Any, kind: Literal["point", "parallel"]
) -> tuple[np.ndarray, np.ndarray]:
    """(lit, facing), (n,) each, of the points where rays meet the spheres `index`, (n,). facing: n.l > 0, where n is
    the normal that faces the side from which the ray came; lit: facing, and nothing blocks."""
    spheres, out = spheres_of(centers, radii), np.zeros((2, len(rows)), bool)
    for k, (row, i) in enumerate(zip(rows, index, strict=True)):
        point, outward, side = met(origin, row, spheres[i])
        line, t_max = shadow_line(point, light, kind)
        out[1, k] = side * dot(outward.numbers, line.way).sign() < 0
        out[0, k] = out[1, k] and first_of(line, spheres, 0.0, t_max) is None
    return out[0], out[1]


def met(origin: Any, row: Any, sphere: ExactSphere) -> tuple[ExactPoint, ExactPoint, int]:
    """Where a ray meets a sphere first, that from its centre, and -1 from outside or 1 from inside."""
    root = root_of(origin, row, sphere)
    return point_at(root), point_at(root) - sphere.center, root.side


def point_at(root: Root) -> ExactPoint:
    """Where that is on a line with rational numbers: o + (b + side sqrt(D)) w / a."""
    e, o = root.of, root.of.line.start
    x, y, z = (
        Surd(p.p * e.a.p + o.over * e.b.p * w.p, root.side * o.over * w.p, e.discriminant.p)
        for p, w in zip(o.numbers, e.line.way, strict=True)
    )
    return ExactPoint((x, y, z), o.over * e.a.p)


def root_of(origin: Any, row: Any, sphere: ExactSphere) -> Root:
    root = sphere.first(Line(ExactPoint.of(list(origin)), ExactPoint.of(list(row))), 0.0, math.inf)
    assert root is not None
    return root


def normal_of(origin: Any, row: Any, center: Any, radius: float) -> tuple[Fraction, Fraction, Fraction]:
    """The outward unit normal where a ray meets a sphere, to 50 digits."""
    _, outward, _ = met(origin, row, *spheres_of([center], radius))
    bits = 180 + max(x.q.bit_length() for x in outward.numbers)
    x, y, z = (part.between(bits).low / (Fraction(float(radius)) * outward.over) for part in outward.numbers)
    return x, y, z


def angle(normal: Any, exact: Any) -> float:
    """Between two vectors of any length but 0, in radians."""
    n, m = ([Fraction(float(x)) for x in v] for v in (normal, exact))
    across = [n[i - 2] * m[i - 1] - n[i - 1] * m[i - 2] for i in range(3)]
    return math.atan2(math.sqrt(sum(x * x for x in across)), dot(n, m))
