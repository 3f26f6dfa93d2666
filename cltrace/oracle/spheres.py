"""The exact oracle: which sphere a ray hits, where, and whether that point sees a light. Nothing here is approximate.

Every float64 is an integer times a power of two, so a scene is a set of integers. The ray is p = o + t d; with

    f = C - o,  a = d.d,  b = f.d,  c = f.f - r^2,  D = b^2 - a c,

the sphere's roots are t = (b -/+ sqrt(D)) / a, and a hit is the smallest root t > 0. All questions are then signs of
integers, or of p + q sqrt(D) with integers p and q, which squaring decides:

    c > 0 (origin outside):  a hit iff b > 0 and D >= 0, at (b - sqrt(D)) / a = c / (b + sqrt(D))
    c < 0 (inside):          a hit,                      at (b + sqrt(D)) / a
    c = 0 (on the surface):  a hit iff b > 0,            at (b + sqrt(D)) / a = 2 b / a    (the root 0 is not a hit)

Touching counts (D = 0), equal roots go to the lowest index, and a zero direction hits nothing.

Spheres are given by centers (m, 3) and radii (m,) or one number for all, > 0; all numbers are finite. Every public
function raises ValueError, which names the argument, where one is not of its shape or a value is not allowed.

`closest` puts a filter in front of the integers: double-double arithmetic in numpy, with an error bound. Where the
bound leaves a doubt, and only there, integers decide.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from math import atan2, isqrt, sqrt
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.oracle import pairs
from cltrace.oracle.pairs import EPS, Pair
from cltrace.scene.rules import is_whole, numbers

Floats = NDArray[np.float64]
Ints = tuple[int, ...]


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


# ---------------------------------------------------------------------------------------------------------- integers


def _integers(values: Sequence[float | Fraction]) -> tuple[Ints, int]:
    """Integers n and one k >= 0 with value = n / 2^k, exactly. A Fraction must be one of that kind."""
    ratios = [(v if isinstance(v, Fraction) else float(v)).as_integer_ratio() for v in values]
    k = max((q.bit_length() - 1 for _, q in ratios), default=0)
    return tuple(p << (k - q.bit_length() + 1) for p, q in ratios), k


def _sign(n: int) -> int:
    return (n > 0) - (n < 0)


def _sign_surd(p: int, q: int, D: int) -> int:
    """The sign of p + q sqrt(D), D >= 0: if the terms differ in sign, the one with the larger square has it."""
    x, y = _sign(p), _sign(q) if D else 0
    return _sign(x + y) if x * y >= 0 else x * _sign(p * p - q * q * D)


def _dot(u: Ints, v: Ints) -> int:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


class _Root(NamedTuple):
    """The hit at t = (b + s sqrt(D)) / a, in units of the caller's choice; s = -1 from outside, +1 otherwise."""

    a: int
    b: int
    c: int
    s: int
    D: int


def _root(d: Ints, f: Ints, r: int) -> _Root | None:
    a, b, c = _dot(d, d), _dot(f, d), _dot(f, f) - r * r
    D = b * b - a * c
    if a == 0 or D < 0 or (c >= 0 and b <= 0):
        return None
    return _Root(a, b, c, -1 if c > 0 else 1, D)


def _nearer(x: _Root, y: _Root) -> bool:
    """Whether x < y, two roots of one ray (one a): the sign of p + v with p = bx - by, v = sx sqrt(Dx) - sy sqrt(Dy).

    v has the sign of sx Dx - sy Dy. Where p and v disagree, |p| - |v| decides: the sign of p^2 - v^2, which is
    (p^2 - Dx - Dy) + 2 sx sy sqrt(Dx Dy), a surd again.
    """
    p, v = x.b - y.b, _sign(x.s * x.D - y.s * y.D)
    if _sign(p) * v >= 0:
        return _sign(p) + v < 0
    return _sign(p) * _sign_surd(p * p - x.D - y.D, 2 * x.s * y.s, x.D * y.D) < 0


def _bracket(root: _Root, bits: int) -> Iterator[tuple[int, int]]:
    """Two quotients (numerator, denominator) that bracket t: less than 2^-bits t apart, equal if sqrt(D) is rational.

    With n = |b| + sqrt(D) >= 1 (b = D = 0 is never a hit), t = n / a if b has the sign s of the root, else |c| / n: no
    cancellation. N = floor(2^k n) is below 2^k n by less than 1, that is, by less than a share 2^-k.
    """
    a, b, c, s, D = root
    k = bits
    N, rest = abs(b) << k, isqrt(D << 2 * k)
    exact = rest * rest == D << 2 * k
    N += rest
    for n in (N, N if exact else N + 1):
        yield (n, a << k) if s > 0 and b >= 0 else (abs(c) << k, n)


def _scaled(quotient: tuple[int, int], shift: int) -> tuple[int, int]:
    """The quotient times 2^shift."""
    p, q = quotient
    return (p << shift, q) if shift >= 0 else (p, q << -shift)


def _divide(quotient: tuple[int, int]) -> float:
    """The quotient correctly rounded, as Python's / is for integers of any size."""
    try:
        return quotient[0] / quotient[1]
    except OverflowError:
        return np.inf


def _rounded(root: _Root, shift: int) -> float:
    """2^shift t correctly rounded: bracketed until both ends round to one double.

    This ends: if sqrt(D) is rational the ends are equal, and otherwise t is irrational, so no midpoint of two doubles.
    """
    bits = 128
    while True:
        low, high = (_divide(_scaled(end, shift)) for end in _bracket(root, bits))
        if low == high:
            return low
        bits *= 2


class _World:
    """Spheres relative to an origin: f and r as integers over 2^k."""

    def __init__(self, origin: ArrayLike, centers: ArrayLike, radii: ArrayLike, *more: ArrayLike) -> None:
        # Of objects: a Fraction stays what it is.
        parts = [np.asarray(x, object).ravel() for x in (origin, centers, radii, *more)]
        n, self.k = _integers(np.concatenate(parts).tolist())
        self.m = len(parts[2])
        points = [n[i : i + 3] for i in range(0, 3 + 3 * self.m, 3)]
        self.f = [self.minus(p, points[0]) for p in points[1:]]
        self.r = n[3 + 3 * self.m : 3 + 4 * self.m]
        self.more = [self.minus(n[i : i + 3], points[0]) for i in range(3 + 4 * self.m, len(n), 3)]  # also relative

    @staticmethod
    def minus(u: Ints, v: Ints) -> Ints:
        return u[0] - v[0], u[1] - v[1], u[2] - v[2]

    def closest(self, row: Floats) -> tuple[int, float]:
        d, k = _integers(row.tolist())
        index, best = -1, None
        for i, (f, r) in enumerate(zip(self.f, self.r, strict=True)):
            root = _root(d, f, r)
            if root and (best is None or _nearer(root, best)):
                index, best = i, root
        return (index, _rounded(best, k - self.k)) if best else (-1, np.inf)  # t = f / d: 2^-self.k over 2^-k


def closest_exact(
    origin: ArrayLike, direction: ArrayLike, centers: ArrayLike, radii: ArrayLike
) -> tuple[NDArray[np.int32], Floats]:
    """What `closest` returns, by integers alone: about 5 us per ray and sphere."""
    world = _World(array_of("origin", origin, 3), *_balls(centers, radii))
    hits = [world.closest(row) for row in array_of("direction", direction, -1, 3)]
    return np.array([i for i, _ in hits], np.int32), np.array([t for _, t in hits], np.float64)


def _hit(origin: ArrayLike, row: ArrayLike, center: ArrayLike, radius: float) -> tuple[_Root, Ints, Ints, int, int]:
    """The root, d, f and r as integers, and the shift of t; ValueError if there is no hit."""
    center, radius = _ball(center, radius)
    world = _World(array_of("origin", origin, 3), center, [radius])
    d, k = _integers(array_of("direction_row", row, 3).tolist())
    root = _root(d, world.f[0], world.r[0])
    if root is None:
        raise ValueError("the ray does not hit the sphere")
    return root, d, world.f[0], world.r[0], k - world.k


def t_high(origin: ArrayLike, direction_row: ArrayLike, center: ArrayLike, radius: float, bits: int = 160) -> Fraction:
    """The hit's t with a relative error below 2^-bits, bits >= 1; ValueError if there is no hit."""
    if not is_whole(bits) or bits < 1:
        raise ValueError(f"bits: must be a whole number >= 1, got {bits!r}")
    root, _, _, _, shift = _hit(origin, direction_row, center, radius)
    return Fraction(*_scaled(next(_bracket(root, bits)), shift))


def normal_high(
    origin: ArrayLike, direction_row: ArrayLike, center: ArrayLike, radius: float
) -> tuple[Fraction, Fraction, Fraction]:
    """The outward unit normal (p - C) / r at the hit, each component to within 1e-50; ValueError if there is no hit.

    a (p - C) = a (t d - f) = (b d - a f) + s d sqrt(D), to be divided by a r. sqrt(D) is cut k bits behind the point,
    an error of |d| 2^-k / (a r) <= 2^-k.
    """
    root, d, f, r, _ = _hit(origin, direction_row, center, radius)
    a, b, _, s, D = root
    k = 180
    rest = isqrt(D << 2 * k)
    x, y, z = (Fraction(((b * d[i] - a * f[i]) << k) + s * d[i] * rest, a * r << k) for i in range(3))
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


# ----------------------------------------------------------------------------------------------------------- shadows

Surds = tuple[Ints, Ints]  # a vector p + q sqrt(D): its p and its q


def _dot_surds(u: Surds, v: Surds, D: int) -> tuple[int, int]:
    return _dot(u[0], v[0]) + _dot(u[1], v[1]) * D, _dot(u[0], v[1]) + _dot(u[1], v[0])


def occluded(
    origin: ArrayLike,
    direction_row: ArrayLike,
    hit_index: int,
    centers: ArrayLike,
    radii: ArrayLike,
    light: ArrayLike,
    kind: Literal["point", "parallel"],
) -> tuple[bool, bool]:
    """(lit, facing) of the ray's hit point P on the sphere hit_index; ValueError if the ray does not hit that sphere.

    light: a position ("point") or the direction in which the light travels ("parallel"). facing: n.l > 0, where n is
    the normal that faces the side from which the ray came, and l leads from P to the light. lit: facing, and nothing
    blocks: neither another sphere, with a point P + x l on its surface, 0 < x < 1 (parallel: 0 < x), nor the own
    sphere, which blocks iff the ray came from inside (an exit root) and the light is strictly outside.

    Exact: P is o + (b + s sqrt(D)) d / a, so everything below is a vector or number p + q sqrt(D) of integers.
    """
    light = _light(light, kind)
    world = _World(array_of("origin", origin, 3), *_balls(centers, radii), *([light] if kind == "point" else []))
    if not is_whole(hit_index) or not 0 <= hit_index < world.m:
        raise ValueError(f"hit_index: must be the index of one of the {world.m} spheres, got {hit_index!r}")
    d, _ = _integers(array_of("direction_row", direction_row, 3).tolist())
    root = _root(d, world.f[hit_index], world.r[hit_index])
    if root is None:
        raise ValueError("the ray does not hit the sphere")
    a, b, _, s, D = root
    sd = s * d[0], s * d[1], s * d[2]

    def from_hit(g: Ints) -> Surds:
        """a (G - P) for the point G = o + g."""
        return (a * g[0] - b * d[0], a * g[1] - b * d[1], a * g[2] - b * d[2]), (-sd[0], -sd[1], -sd[2])

    if kind == "point":
        to_light = from_hit(world.more[0])
    else:
        w, _ = _integers(light.tolist())
        to_light = (-w[0], -w[1], -w[2]), (0, 0, 0)  # not times a: its length does not matter

    # C - P is the inward normal of the sphere, and faces a ray that came from inside.
    facing = s * _sign_surd(*_dot_surds(from_hit(world.f[hit_index]), to_light, D), D) > 0
    if not facing:
        return False, False

    # For every sphere, a^2 (|P + x l - C|^2 - r^2) = A x^2 - 2 B x + E (parallel: with x / a instead of x).
    A = _dot_surds(to_light, to_light, D)
    for j, (f, r) in enumerate(zip(world.f, world.r, strict=True)):
        end = 1  # the sign of phi at the light, which is outside of everything if it is parallel
        if kind == "point":
            g = world.minus(world.more[0], f)
            end = _sign(_dot(g, g) - r * r)
        if j == hit_index:
            if s > 0 and end > 0:
                return False, True
            continue
        m = from_hit(f)
        B = _dot_surds(m, to_light, D)
        E = _dot_surds(m, m, D)
        E = E[0] - a * a * r * r, E[1]
        if _blocks(_sign_surd(*E, D), end, A, B, E, D, segment=kind == "point"):
            return False, True
    return True, True


def _blocks(
    start: int, end: int, A: tuple[int, int], B: tuple[int, int], E: tuple[int, int], D: int, segment: bool
) -> bool:
    """Whether phi(x) = A x^2 - 2 B x + E, A > 0, has a root in 0 < x < 1 (segment) or in 0 < x.

    start, end: the signs of phi(0) and of phi at the other end.
    - Opposite: one root lies between.
    - One of them negative and the other not positive, or both 0: none, since phi is convex.
    - None negative, one positive: roots between are there iff the minimum is between, 0 < B < A, and not positive,
      B^2 >= A E. (If phi is 0 at one end, the minimum is negative, and the other root is beyond it, short of the
      positive end.)
    """
    if start * end < 0:
        return True
    if start < 0 or (start == 0 and end <= 0) or _sign_surd(*B, D) <= 0:
        return False
    if segment and _sign_surd(A[0] - B[0], A[1] - B[1], D) <= 0:
        return False
    square = B[0] * B[0] + B[1] * B[1] * D, 2 * B[0] * B[1]
    product = A[0] * E[0] + A[1] * E[1] * D, A[0] * E[1] + A[1] * E[0]
    return _sign_surd(square[0] - product[0], square[1] - product[1], D) >= 0


# ------------------------------------------------------------------------------------------------ rays from anywhere
#
# A ray that starts on a sphere starts at P = A + R n / |n|: A, R and n are given numbers, |n| = sqrt(s) with s = n.n.
# With all lengths times s, C - P is s (C - A) - R n sqrt(s): a vector p + q sqrt(s) of integers. So a, b, c and D are
# such numbers, too, which are closed under sums and products, and have a sign that squaring tells. The ends of the way
# through a sphere are (b -/+ sqrt(D)) / a, one root more. An ellipsoid |K (p - C)| = r is a sphere in its own axes: K f
# and K d are such numbers again, and so is P = A + R K^-1 n / |n|, times the determinant.


class OnSphere(NamedTuple):
    """The point center + radius normal / |normal|; the normal may have any length but 0.

    to_object: of an ellipsoid, see `closest_from`; then the point is center + radius K^-1 normal / |normal|.
    """

    center: ArrayLike
    radius: float
    normal: Sequence[float | Fraction]
    to_object: ArrayLike | None = None


Maps = Sequence[ArrayLike | None]


class _Map(NamedTuple):
    """An ellipsoid's K: the integers `rows` over 2^k."""

    rows: tuple[Ints, Ints, Ints]
    k: int

    def of(self, v: Ints) -> Ints:
        """K v, times 2^k."""
        return _dot(self.rows[0], v), _dot(self.rows[1], v), _dot(self.rows[2], v)

    def inverse(self, v: Ints) -> tuple[Ints, int]:
        """K^-1 v, times a number > 0; and that number. Indices that go round need no signs."""
        m = self.rows
        adjugate = [
            [m[j - 2][i - 2] * m[j - 1][i - 1] - m[j - 2][i - 1] * m[j - 1][i - 2] for j in range(3)] for i in range(3)
        ]
        determinant = sum(m[0][j] * adjugate[j][0] for j in range(3))
        x, y, z = ((_sign(determinant) * sum(a * e for a, e in zip(row, v, strict=True))) << self.k for row in adjugate)
        return (x, y, z), abs(determinant)


def _map(name: str, to_object: ArrayLike | None) -> _Map | None:
    if to_object is None:
        return None
    n, k = _integers(array_of(name, to_object, 3, 3).ravel().tolist())
    made = _Map((n[0:3], n[3:6], n[6:9]), k)
    if not made.inverse((1, 0, 0))[1]:
        raise ValueError(f"{name}: must not be singular")
    return made


def _maps(to_object: Maps | None, count: int) -> list[_Map | None]:
    if to_object is None:
        return [None] * count
    if len(to_object) != count:
        raise ValueError(f"to_object: must be as many as centers, {count}, got {len(to_object)}")
    return [_map(f"to_object[{i}]", m) for i, m in enumerate(to_object)]


Surd = tuple[int, int]  # p + q sqrt(s)


def to_world(basis: Sequence[Sequence[float]], v: Sequence[float]) -> tuple[Fraction, Fraction, Fraction]:
    """The vector v of camera space along the world's axes, exactly: v.x right + v.y up + v.z back."""
    if len(basis) != 3:
        raise ValueError(f"basis: must be 3 vectors, got {basis!r}")
    axes, parts = [[Fraction(x) for x in _exact("basis", a)] for a in basis], [Fraction(x) for x in _exact("v", v)]
    x, y, z = (sum((e * a[i] for e, a in zip(parts, axes, strict=True)), Fraction(0)) for i in range(3))
    return x, y, z


def _times(x: Surd, y: Surd, s: int) -> Surd:
    return x[0] * y[0] + x[1] * y[1] * s, x[0] * y[1] + x[1] * y[0]


def _plus(x: Surd, y: Surd, factor: int = 1) -> Surd:
    return x[0] + factor * y[0], x[1] + factor * y[1]


class _Start:
    """Where a ray starts, and everything else from there, as integers p + q sqrt(s) times 2^-k / scale."""

    def __init__(
        self,
        start: ArrayLike | Sequence[Fraction] | OnSphere,
        centers: ArrayLike,
        radii: ArrayLike,
        to_object: Maps | None,
        *more: ArrayLike,
    ) -> None:
        n: Ints = (0, 0, 0)
        determinant = 1
        if isinstance(start, OnSphere):
            anchor, radius = _ball(start.center, start.radius, ("start.center", "start.radius"))
            n, _ = _integers(_exact("start.normal", start.normal))
            if not any(n):
                raise ValueError("start.normal: must not be 0")
            own_map = _map("start.to_object", start.to_object)
        else:
            place: Any = _exact("start", np.asarray(start, object).tolist())
            anchor, radius, own_map = np.array(place, object), 0.0, None
        world = _World(anchor, *_balls(centers, radii), *more, [radius, 0.0, 0.0])
        self.s, self.k = _dot(n, n), world.k
        if own_map:
            n, determinant = own_map.inverse(n)
        self.scale = (self.s or 1) * determinant
        (R,), own = _integers([radius])
        R <<= world.k - own  # the radius was among the numbers for which k was chosen
        self.step = R * n[0], R * n[1], R * n[2]
        self.f = [self.surd(f) for f in world.f]
        self.r = [r * self.scale for r in world.r]
        self.more = [self.surd(p) for p in world.more[:-1]]
        self.maps = _maps(to_object, world.m)

    def ends(self, i: int, d: Surds) -> list[_End]:
        """Of the way through the sphere or ellipsoid i; of an ellipsoid, in its own axes, times 2^k."""
        f, r, own = self.f[i], self.r[i], self.maps[i]
        if own is None:
            return _ends(d, f, r, self.s)
        return _ends((own.of(d[0]), own.of(d[1])), (own.of(f[0]), own.of(f[1])), r << own.k, self.s)

    def surd(self, g: Ints) -> Surds:
        """To the point that is g from the anchor."""
        z = self.scale
        return (g[0] * z, g[1] * z, g[2] * z), (-self.step[0], -self.step[1], -self.step[2])


class _End(NamedTuple):
    """One end of the way through a sphere, t = (b + side sqrt(D)) / a; a > 0 and D >= 0."""

    a: Surd
    b: Surd
    side: int
    D: Surd

    def sign_less(self, p: int, q: int, s: int) -> int:
        """The sign of t - p / q, q > 0: that of (q b - p a) + side q sqrt(D)."""
        x = _plus((q * self.b[0], q * self.b[1]), self.a, -p)
        return _sign_end(x, self.side * q, self.D, s)


def _sign_end(x: Surd, y: int, D: Surd, s: int) -> int:
    """The sign of x + y sqrt(D): if the terms differ in sign, the one with the larger square has it."""
    first, second = _sign_surd(*x, s), _sign(y) * _sign_surd(*D, s)
    if first * second >= 0:
        return _sign(first + second)
    return first * _sign_surd(*_plus(_times(x, x, s), D, -y * y), s)


def _before(x: _End, y: _End, s: int) -> bool:
    """Whether x < y, two ends on one ray: the sign of (bx - by + sx sqrt(Dx)) - sy sqrt(Dy), as above.

    If the a are not the same, both ends are multiplied by both a.
    """
    if x.a != y.a:
        x, y = _times_a(x, y.a, s), _times_a(y, x.a, s)
    gap = _plus(x.b, y.b, -1)
    first, second = _sign_end(gap, x.side, x.D, s), -y.side * _sign_surd(*y.D, s)
    if first * second >= 0:
        return first + second < 0
    # The difference of the squares: gap^2 + Dx - Dy + 2 sx gap sqrt(Dx).
    rest, twice = _plus(_plus(_times(gap, gap, s), x.D), y.D, -1), _times((2 * x.side, 0), gap, s)
    outer, inner = _sign_surd(*rest, s), _sign_surd(*twice, s) * _sign_surd(*x.D, s)
    if outer * inner >= 0:
        return first * _sign(outer + inner) < 0
    square = _times(_times(twice, twice, s), x.D, s)
    return first * outer * _sign_surd(*_plus(_times(rest, rest, s), square, -1), s) < 0


def _times_a(end: _End, a: Surd, s: int) -> _End:
    """The same end of the equation times a > 0."""
    return _End(_times(end.a, a, s), _times(end.b, a, s), end.side, _times(end.D, _times(a, a, s), s))


def _ends(d: Surds, f: Surds, r: int, s: int) -> list[_End]:
    """Both ends of the way through a sphere, the nearer one first; none if the ray passes by or has no direction."""
    a, b, c = _dot_surds(d, d, s), _dot_surds(f, d, s), _plus(_dot_surds(f, f, s), (r * r, 0), -1)
    D = _plus(_times(b, b, s), _times(a, c, s), -1)
    if _sign_surd(*a, s) == 0 or _sign_surd(*D, s) < 0:
        return []
    return [_End(a, b, -1, D), _End(a, b, 1, D)]


def closest_from(
    start: ArrayLike | Sequence[Fraction] | OnSphere,
    direction: Sequence[Sequence[float | Fraction]],
    centers: ArrayLike,
    radii: ArrayLike,
    t_min: float = 0.0,
    t_max: float = np.inf,
    to_object: Maps | None = None,
) -> tuple[NDArray[np.int32], Floats]:
    """What `closest` returns, for rays that start anywhere: the first t strictly within the range, correctly rounded.

    to_object: for each sphere a matrix K (3, 3), which makes it the ellipsoid |K (p - C)| = r, or None.

    There is no rule for the sphere that the ray starts on: c is 0 there, so that the ends are exactly 0, which is not
    within t > 0, and 2 b / a: outwards it is never met again, inwards at the far side.

    start: (3,), of which each may be a Fraction, or OnSphere; direction: rows of 3 numbers; t_min, t_max: the range,
    inf and -inf are no bounds.
    """
    if not (t_min < np.inf and t_max > -np.inf):  # nor NaN
        raise ValueError(f"t_min, t_max: must be numbers, t_min < inf and t_max > -inf, got {t_min!r}, {t_max!r}")
    shape = np.asarray(direction, object).shape  # of objects: a Fraction stays what it is
    if shape[1:] != (3,) and shape != (0,):
        raise ValueError(f"direction: must have shape (n, 3), got {shape}")
    world = _Start(start, centers, radii, to_object)
    index, t = np.full(len(direction), -1, np.int32), np.full(len(direction), np.inf)
    for row, values in enumerate(direction):
        d, k = _integers(_exact("direction", values))
        # A number T for t is T unit in the integers' units.
        unit = Fraction(world.scale) * Fraction(2) ** (world.k - k)
        best: _End | None = None
        for i in range(len(world.f)):
            for end in world.ends(i, (d, (0, 0, 0))):
                if not _within(end, t_min, t_max, unit, world.s):
                    continue
                if best is None or _before(end, best, world.s):
                    index[row], best = i, end
                break
        if best is not None:
            t[row] = _nearest_double(best, unit, world.s)
    return index, t


def sign_beyond(
    start: ArrayLike | Sequence[Fraction] | OnSphere,
    direction_row: Sequence[float | Fraction],
    center: ArrayLike,
    radius: float,
    to_object: ArrayLike | None,
    t: Fraction,
) -> int:
    """The sign of how far a ray's hit of a sphere, or an ellipsoid, is beyond t; ValueError if there is no hit."""
    world = _Start(start, np.array([center], float), np.array([radius], float), [to_object])
    d, k = _integers(_exact("direction_row", direction_row))
    unit = Fraction(world.scale) * Fraction(2) ** (world.k - k)
    for end in world.ends(0, (d, (0, 0, 0))):
        if end.sign_less(0, 1, world.s) > 0:
            return end.sign_less(*(t * unit).as_integer_ratio(), world.s)
    raise ValueError("the ray does not hit the sphere")


def _within(end: _End, t_min: float, t_max: float, unit: Fraction, s: int) -> bool:
    above = t_min == -np.inf or end.sign_less(*(Fraction(t_min) * unit).as_integer_ratio(), s) > 0
    return above and (t_max == np.inf or end.sign_less(*(Fraction(t_max) * unit).as_integer_ratio(), s) < 0)


def _nearest_double(end: _End, unit: Fraction, s: int) -> float:
    """t correctly rounded, by comparisons alone: doubles of one sign are ordered as their bits are."""

    def sign_less(value: Fraction) -> int:
        return end.sign_less(*(value * unit).as_integer_ratio(), s)

    def double(bits: int) -> float:
        return float(np.int64(bits).view(np.float64))

    flip = sign_less(Fraction(0))
    if flip == 0:
        return 0.0
    low, high = 0, int(np.float64(np.inf).view(np.int64))  # |t| is at least low's double and below high's
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if flip * sign_less(flip * Fraction(double(middle))) >= 0 else (low, middle)
    # Half way to the next double, which is 2^1024 after the largest one.
    step = Fraction(double(low)) - Fraction(double(low - 1)) if low else Fraction(double(1))
    if double(high) < np.inf:
        step = Fraction(double(high)) - Fraction(double(low))
    beyond = flip * sign_less(flip * (Fraction(double(low)) + step / 2))
    return flip * double(high if beyond > 0 or (beyond == 0 and low % 2) else low)


def blocked(
    start: OnSphere,
    light: ArrayLike,
    kind: Literal["point", "parallel"],
    centers: ArrayLike,
    radii: ArrayLike,
    to_object: Maps | None = None,
) -> bool:
    """Whether a sphere or an ellipsoid is met strictly between a point of one and a light, as in `occluded`.

    From inside, the sphere that the ray starts on blocks as any other: if and only if the light is strictly outside.
    """
    light = _light(light, kind)
    if kind == "point":
        world = _Start(start, centers, radii, to_object, light)
        d = world.more[0]
    else:
        world = _Start(start, centers, radii, to_object)
        w, _ = _integers(light.tolist())
        d = (-w[0], -w[1], -w[2]), (0, 0, 0)
    return any(
        end.sign_less(0, 1, world.s) > 0 and (kind == "parallel" or end.sign_less(1, 1, world.s) < 0)
        for i in range(len(world.f))
        for end in world.ends(i, d)
    )


# ------------------------------------------------------------------------------------------------------------ filter
#
# Double-double arithmetic (pairs.py), with a bound of the error of each result; EPS bounds that of one operation.

# For inputs in this range, or 0 (float32's is within it): they are multiples of 2^-202, as are f and d; products of two
# are multiples of 2^-404, and b^2, a c and D of 2^-808. The pairs of b, a, c and D, and the terms on the way, lie on
# these grids too, so nothing underflows. D, once it exceeds its error bound, 4 EPS (g^2 + a |c|) with g^2 and a |c|
# either 0 or at least 2^-704, exceeds 2^-803, so the square of its 53-bit root is a multiple of 2^-908.
# t >= |c| / n >= 2^-404 / 2^306: an underflow, at 2^-1074, is far below EPS t. The largest number is D < 2^612.
# Rays and spheres out of this range are for the integers.
LOW, HIGH = 2.0**-150, 2.0**150


class _Sphere(NamedTuple):
    """What the filter knows of a sphere: f = C - o as pairs (exact), c rounded to a pair, and c's sign (exact)."""

    f: tuple[tuple[float, float], ...]
    r: float
    c: tuple[float, float]
    sign: int


def _spheres(origin: Floats, centers: Floats, radii: Floats, world: _World) -> list[_Sphere]:
    out = []
    for i in range(world.m):
        f = [pairs.two_sum(centers[i, j], -origin[j]) for j in range(3)]
        c = Fraction(_dot(world.f[i], world.f[i]) - world.r[i] ** 2, 1 << 2 * world.k)
        h = float(c)
        out.append(
            _Sphere(
                tuple((float(x), float(y)) for x, y in f),
                float(radii[i]),
                (h, float(c - Fraction(h))),
                _sign(c.numerator),
            )
        )
    return out


def _may_hit(direction: NDArray[np.float64], sphere: _Sphere) -> NDArray[np.bool_]:
    """False only where D < 0 for sure, in plain doubles: D = a r^2 - |f x d|^2.

    With F = |f| |d|: f is rounded (1 u), so are the products (1) and the difference (1), so that a component of the
    cross product is off by 3 u F at most, as |fy dz| + |fz dy| <= F. The errors of the squares add up to
    2 * 3 u * sqrt(3) F^2 (as |x| + |y| + |z| <= sqrt(3) F), squaring and adding to 3 u F^2: 14 u F^2. a r^2 is off by
    5 u of itself, the difference by 1 u. We take 32 u (F^2 + a r^2).
    """
    x, y, z = direction.T
    fx, fy, fz = (h for h, _ in sphere.f)
    a, r2 = x * x + y * y + z * z, sphere.r * sphere.r
    u, v, w = fy * z - fz * y, fz * x - fx * z, fx * y - fy * x
    ok: NDArray[np.bool_] = a * r2 - (u * u + v * v + w * w) >= -(2.0**-48) * a * (fx * fx + fy * fy + fz * fz + r2)
    return ok


def _estimate(direction: Floats, sphere: _Sphere) -> tuple[NDArray[np.intp], Pair, Floats, NDArray[np.intp]]:
    """The rows of `direction` that hit for sure, their t with a bound of its error, and the rows in doubt.

    With g = sum |f_i d_i| >= |b|, and every operation off by at most EPS of its operands:

      b:  three products (8 u^2 each) and two sums (3 u^2 of g each): 14 u^2 g                     < EPS g
      a:  exact products (two_product), two sums: 6 u^2 a                                          < EPS a
      c:  rounded to a pair: u^2 |c|                                                               < EPS |c|
      D:  b^2 is off by 2 |b| EPS g + EPS b^2 <= 3 EPS g^2, a c by 3 EPS a |c|, their difference
          by EPS (b^2 + a |c|)                                                                 < 4 EPS (g^2 + a |c|)
      n = |b| + sqrt(D):  b is off by EPS g, the root by |error of D| / root + EPS root, the sum by EPS n:
          as a share of n, `share`; trusted below 2^-20 only
      t = n / a or |c| / n:  n's share, and EPS each for a or c and for the division           < (2 share + 4 EPS) t
    """
    zero = np.zeros(len(direction))
    d = direction.T
    products = [pairs.mul((zero + h, zero + low), (d[i], zero)) for i, (h, low) in enumerate(sphere.f)]
    b = pairs.add(pairs.add(products[0], products[1]), products[2])
    g = sum(abs(h) * np.abs(d[i]) for i, (h, _) in enumerate(sphere.f))
    a = pairs.add(
        pairs.add(pairs.two_product(d[0], d[0]), pairs.two_product(d[1], d[1])), pairs.two_product(d[2], d[2])
    )
    c = zero + sphere.c[0], zero + sphere.c[1]
    D = pairs.add(pairs.mul(b, b), pairs.neg(pairs.mul(a, c)))

    b_error = EPS * g
    D_error = 4 * EPS * (g * g + a[0] * abs(sphere.c[0]))
    hit, miss = D[0] > D_error, D[0] < -D_error
    if sphere.sign >= 0:
        hit, miss = hit & (b[0] > b_error), miss | (b[0] < -b_error)
    doubt = np.flatnonzero(~(hit | miss))  # NaN, if there were one, would be in doubt

    rows = np.flatnonzero(hit)
    if not len(rows):
        return rows, (zero[:0], zero[:0]), zero[:0], doubt
    a, b, D = ((x[0][rows], x[1][rows]) for x in (a, b, D))
    root = pairs.sqrt(D)
    n = pairs.add(pairs.where(b[0] < 0, pairs.neg(b), b), root)
    share = (b_error[rows] + D_error[rows] / root[0] + EPS * root[0]) / n[0] + EPS
    direct = b[0] > 0 if sphere.sign <= 0 else np.zeros(len(rows), bool)  # t = n / a; otherwise |c| / n
    c = np.abs(sphere.c[0]) + 0 * n[0], np.copysign(1, sphere.c[0]) * sphere.c[1] + 0 * n[0]
    t = pairs.div(pairs.where(direct, n, c), pairs.where(direct, a, n))
    error = np.where(share < 2.0**-20, t[0] * (2 * share + 4 * EPS), np.inf)
    return rows, t, error, doubt


def _in_range(*arrays: Floats) -> NDArray[np.bool_]:
    """Per row of the arrays, side by side: whether every number is 0 or within LOW..HIGH in magnitude."""
    size = np.abs(np.column_stack(arrays))
    ok: NDArray[np.bool_] = ((size == 0) | ((size >= LOW) & (size <= HIGH))).all(axis=1)
    return ok


def closest(
    origin: ArrayLike, direction: ArrayLike, centers: ArrayLike, radii: ArrayLike
) -> tuple[NDArray[np.int32], Floats]:
    """The nearest hit of every ray: sphere (n,) int32, -1 if none; t (n,), correctly rounded, inf if none.

    origin (3,), direction (n, 3), centers (m, 3), radii (m,) or one number > 0 for all: finite float64, taken as exact
    numbers. t is in units of the ray's direction, which may have any length; a direction of 0 hits nothing. Raises
    ValueError, which names the argument, where one is not of its shape or a value is not allowed.
    """
    index, t, doubt = filtered(origin, direction, centers, radii)
    rows = array_of("direction", direction, -1, 3)[doubt]
    index[doubt], t[doubt] = closest_exact(origin, rows, centers, radii)
    return index, t


def filtered(
    origin: ArrayLike, direction: ArrayLike, centers: ArrayLike, radii: ArrayLike
) -> tuple[NDArray[np.int32], Floats, NDArray[np.bool_]]:
    """What `closest` returns, but for the rows in the third array, which the filter leaves to the integers."""
    origin, direction = array_of("origin", origin, 3), array_of("direction", direction, -1, 3)
    centers, radii = _balls(centers, radii)
    n, m = len(direction), len(radii)
    index, t = np.full(n, -1, np.int32), np.full(n, np.inf)
    if not (_in_range(origin[None]).all() and _in_range(centers, radii).all()):
        return index, t, np.ones(n, bool)
    doubt = ~_in_range(direction)
    spheres = _spheres(origin, centers, radii, _World(origin, centers, radii))
    first = {(*c, r): i for i, c, r in zip(range(m)[::-1], centers[::-1].tolist(), radii[::-1].tolist(), strict=True)}
    for start in range(0, n, 1 << 14):  # the temporary arrays stay in the cache
        part = slice(start, start + (1 << 14))
        d = np.where(doubt[part, None], 1.0, direction[part])
        best, best_t, best_l, best_error = index[part], t[part], np.zeros(len(d)), np.zeros(len(d))  # views: written to
        unsure = doubt[part]
        for i in sorted(first.values()):  # an equal sphere before it always wins
            maybe = np.flatnonzero(_may_hit(d, spheres[i]))
            if not len(maybe):
                continue
            rows, (h, low), error, lost = _estimate(d[maybe], spheres[i])
            unsure[maybe[lost]] = True
            rows = maybe[rows]
            # h + low against the best so far. Both errors include 4 EPS t, more than the difference of two pairs loses.
            found = best[rows] >= 0
            other = np.where(found, best_t[rows], 0), best_l[rows]
            gap, doubtful = pairs.add((h, low), pairs.neg(other))[0], 2 * (error + best_error[rows])
            unsure[rows[~(np.abs(gap) > doubtful) & found | ~np.isfinite(error)]] = True
            win = ~found | (gap < 0)
            rows = rows[win]
            best[rows], best_t[rows], best_l[rows], best_error[rows] = i, h[win], low[win], error[win]
        # t is in h + low -/+ error: is it rounded to h? (The second error pays for the rounding of low -/+ error.)
        unsure |= (best >= 0) & ~(
            (best_t + (best_l - 2 * best_error) == best_t) & (best_t + (best_l + 2 * best_error) == best_t)
        )
    return index, t, doubt
