"""Spheres, and ellipsoids, which are spheres in axes of their own."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property, partial
from typing import TYPE_CHECKING, NamedTuple

from cltrace.exact.lines import Equation, ExactPoint, Line, Root
from cltrace.exact.shapes import ExactSphere
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray, Start, exact_line
from cltrace.reference.surfaces import UV, Intersection, Setting, Surface
from cltrace.reference.vectors import EYE, Direction, Matrix, Point, size_of

if TYPE_CHECKING:
    from cltrace.reference.clipping import Entry

AHEAD = Direction(0.0, 0.0, -1.0)
FLOOR = 2.0**-900  # covers what underflows


class SphereHit(NamedTuple):
    """Where a ray meets a sphere. side: -1 for the near end of the way through it, 1 for the far one; q: the unit
    normal of a Start there; distance: along the ray, in scene units."""

    t: float
    side: int
    q: Direction
    distance: float


class Sphere(Surface):
    """The points P with |P - C| = r; of an ellipsoid, those with |K (P - C)| = r.

    A ray o + t d meets a sphere where |o + t d - C|^2 = r^2. Multiplied out, as in the tutorial but with b halved and
    turned,

        a t^2 - 2 b t + c = 0,    a = d.d,    b = d.(C - o),    c = (C - o).(C - o) - r^2
        t = (b -/+ sqrt(D)) / a,  D = b^2 - a c

    D < 0 is a miss, D = 0 touches, D > 0 gives the two ends of the way through the sphere. The functions below compute
    these numbers in such a form that they lose no digits, and ask the exact engine where doubles cannot decide.

    An ellipsoid is what a linear map L = K^-1 makes of a sphere. K leads from the world to the ellipsoid's own axes.
    There it is a sphere, and the ray K o + t K d is straight and has the same t, so all that has been said of spheres
    holds. Back in the world a normal is K^T q, not L q.

    center: in camera space, rounded; radius; place: the centre of the file, in the world; exact: the surface as the
    exact engine has it; reach: how far the surface is from its centre at most; K: of the scene, None of a sphere; L:
    rounded from the exact inverse; stretch, spread: k and k l, the sizes of K and L (see vectors.Matrix), which bound
    what K and L may make of an error.
    """

    kind = "sphere"
    stretch = 1.0

    def __init__(self, setting: Setting, i: int) -> None:
        scene, one = setting.scene, setting.scene.spheres[i]
        self.radius, self.place = float(one["radius"]), Point(*one["center"].tolist())
        self.view, self.number = setting.view, int(scene.sphere_numbers[i])
        self.material = setting.material(int(one["material"]))
        self.shape, self.reach = "sphere", self.radius
        self.K: Matrix | None = None
        rows = scene.to_object[one["to_object"]].tolist() if one["to_object"] >= 0 else None
        self.exact = ExactSphere(self.place, self.radius, rows)
        self.center = self.view.seen(self.exact.center)
        if rows:
            inverse, divisor = self.exact.inverse
            self.K = Matrix(*(Direction(*row) for row in rows))
            self.L = Matrix(*(Direction(*(x / divisor for x in row)) for row in inverse))
            self.shape, self.reach = "ellipsoid", self.radius * self.L.size
            self.stretch, self.spread = self.K.size, self.K.size * self.L.size

    def meet(self, ray: Ray) -> SphereHit | None:
        """Where the ray meets it first, by the equation in the form that keeps its digits."""
        if self.K is None:
            # Directions whose squares leave the range of double are for exact arithmetic.
            if ray.origin == EYE and 2.0**-900 < ray.direction.dot(ray.direction) < 2.0**900:
                return from_eye(self, ray)
            start = ray.origin
            if isinstance(start, Start) and start.surface is None and ray.is_plain and ray.direction == AHEAD:
                return from_plane(self, start, ray)
        return from_surface(self, ray) if ray.is_plain else from_anywhere(self, ray)

    def intersect(self, ray: Ray) -> float | None:
        met = self.meet(ray)
        return met.t if met else None

    def equation(self, ray: Ray) -> Equation:
        """The equation of the ray, exactly."""
        return self.exact.met_by(exact_line(ray, self.view))

    def exact_t(self, ray: Ray) -> Root:
        root = self.equation(ray).first(ray.t_min, ray.t_max)
        if root is None:
            raise ValueError("the ray does not hit the surface")
        return root

    def intersection_at(self, ray: Ray, t: float) -> Intersection:
        met = self.meet(ray)
        if met is None:
            raise ValueError("the ray does not hit the surface")
        outward, inside = self.outward(met.q), met.side > 0
        return Intersection(
            point=ray.at(t),
            t=t,
            distance=met.distance,
            normal=-outward if inside else outward,
            inside=inside,
            start=self.start(met.q),
            material=self.material,
            uv=_around(met.q if self.K else self.view.B.T @ met.q),
            index=self.number,
            turned=inside,
        )

    def start(self, q: Direction) -> Start:
        """The point of a ray's start: exactly center + radius q / |q|, or of an ellipsoid center + radius L q / |q|.

        The anchor is the centre. q: outward, of any length but 0, in camera space; of an ellipsoid, in its own axes.
        Rays are decided soonest where it is unit to rounding.
        """
        view, r, unit = self.view, self.radius, q.normalized()
        exact = partial(self.exact_point, q)
        if self.K is None:
            step, from_center, point, support = (view.B.T @ q) * r, q * r, unit * r, r
        else:
            n, step = self.K.T @ q, (self.L @ q) * r
            from_center, point = view.B @ step, view.B @ ((self.L @ unit) * r)
            support = r * (1 / math.sqrt(n.dot(n)))
        fits, C = abs(q.dot(q) - 1) <= 2.0**-47, self.center
        return Start(self, view, self.place, C, step, from_center, self.reach, C + point, exact, q, support, fits)

    def exact_point(self, q: Direction) -> ExactPoint:
        """The same, exactly."""
        return self.exact.point(tuple(q) if self.K else [x.p for x in self.view.to_world(tuple(q)).numbers])

    def outward(self, q: Direction) -> Direction:
        """The outward unit normal there, in camera space."""
        if self.K is None:
            return q
        n = self.K.T @ q
        return self.view.B @ (n * (1 / math.sqrt(n.dot(n))))

    def seen(self, v: Direction) -> Direction:
        """A direction of the world in the surface's own axes."""
        return self.K @ v if self.K else v

    def unit(self, from_center: Direction) -> Direction:
        """From the centre to the point is r long but for rounding, so after the division by r one Newton step
        n (3 - n.n)/2 makes it unit to the last digits."""
        n = from_center * (1 / self.radius)
        return n * (0.5 * (3 - n.dot(n)))

    def blocks(self, ray: ShadowRay) -> bool:
        if ray.start.surface is self:
            # It is convex: from outside it is never in its own way, and from inside if and only if the light is
            # strictly outside. The root 0 is not looked for.
            return ray.inside and (ray.light.parallel or self.exact.side_of(ray.light.exact) > 0)
        sure = surely_blocks(self, ray)
        return self.exact.first(ray.line, 0.0, ray.t_max) is not None if sure is None else sure

    def blocking_root(self, ray: ShadowRay) -> tuple[Line, Root]:
        root = self.exact.first(ray.line, 0.0, ray.t_max)
        assert root
        return ray.line, root

    def contains(self, entry: Entry) -> bool:
        return self.exact.contains_entry(entry.height)

    @cached_property
    def eye_power(self) -> float:
        """|C|^2 - r^2, the power of the eye: > 0 outside, 0 on the sphere, < 0 inside."""
        power, over = self.exact.power(self.view.exact_eye)
        return power.p / over

    @cached_property
    def eye_outside(self) -> bool:
        return self.exact.side_of(self.view.exact_eye) > 0


# The equation a t^2 - 2 b t + c = 0 in double precision: each number in the form that keeps its digits.
#
# A ray from the eye, and one from a surface to wherever it leads, is computed as the kernel does it, operation by
# operation, so that both get the same bits; doubles decide where they are sure to be right, and the exact engine where
# not. Any other ray is left to the exact engine altogether.


def from_eye(sphere: Sphere, ray: Ray) -> SphereHit | None:
    """The tutorial's equation for a ray that starts at the eye, where C - o is the centre itself.

    c = |C|^2 - r^2 comes from the exact scene, rounded once. The discriminant b^2 - a c is kept where it is accurate,
    for |b| < r |d| and from inside; elsewhere a (r^2 - |v|^2) is, where v leads from the ray's closest point to the
    centre. kernels/shapes/sphere/ derives both, and the bound below which the sign of the result is in doubt.
    """
    C, d, r, c = sphere.center - EYE, ray.direction, sphere.radius, sphere.eye_power
    a, b = d.dot(d), C.dot(d)
    k = b * (1 / a)
    v = Direction(C.x - k * d.x, C.y - k * d.y, C.z - k * d.z)
    bb, rr, arr = b * b, r * r, a * (r * r)
    by_b = bb < arr or not sphere.eye_outside
    D = bb - a * c if by_b else a * (rr - v.dot(v))
    # Of a sphere this far and small, v would have lost too many digits for the normal.
    tiny = arr < bb * 2.0**-42
    unsure = not abs(D) > (bb + arr) * 2.0**-48
    hits = D >= 0
    if unsure or tiny:
        equation = sphere.equation(ray)
        exact_b, _, D = equation.rounded()
        hits = equation.discriminant.sign() >= 0
        if tiny:
            v = _exact_v(sphere, ray, equation)
        # All but on the sphere, and all but along it, b cancels, too.
        if unsure and bb < arr * 2.0**-16:
            b = exact_b
    if not hits:
        return None
    root = math.sqrt(max(D, 0.0))
    for side in (-1, 1):
        # b - root or b + root might cancel: with q = b + root, or b - root if b < 0, the roots are q / a and c / q.
        if side < 0 and b >= 0 and not by_b and a * c > 2.0**-10 * (b * b):
            t = (b - root) * (1 / a)  # does not cancel much, and needs no division
        else:
            q = b - root if b < 0 else b + root
            numerator, denominator = (q, a) if (b < 0) == (side < 0) else (c, q)
            t = numerator / denominator if denominator else 0.0
        # Doubles are off by 2^-25 at most, unless the sign of the discriminant or this is in doubt.
        low, high = ray.t_min, ray.t_max
        if unsure or not abs(t - low) > abs(low) * 2.0**-22 or not abs(t - high) > t * 2.0**-22:
            exact = Root(sphere.equation(ray), side)
            if not exact.is_between(low, high):
                continue
            t = t if low < t < high else float(exact)
        elif not low < t < high:
            continue
        # By way of t d - C, or without its cancellation -v -/+ sqrt(D)/a d, where the discriminant comes from v.
        if by_b:
            n = sphere.unit(d * t - C)
        else:
            along = d * (root * (1 / a))
            n = sphere.unit(-(v + along) if side < 0 else along - v)
        return SphereHit(t, side, n, t * math.sqrt(a))
    return None


def _exact_v(sphere: Sphere, ray: Ray, equation: Equation) -> Direction:
    """From the closest point of a ray with rational numbers to the centre, in camera space."""
    line, k = equation.line, equation.middle()
    to_center = (sphere.exact.center - line.start).fractions()
    v = ExactPoint.of([c - k * w for c, w in zip(to_center, line.direction.fractions(), strict=True)])
    return Direction(*sphere.view.to_camera(v).rounded())


def from_plane(sphere: Sphere, o: Start, ray: Ray) -> SphereHit | None:
    """The equation of a ray from o = (x, y, 0) along -z, to which a sphere is a disc.

    With (x, y) from the ray to the centre C, D = r^2 - (x^2 + y^2), and the ends are at t = -C.z -/+ sqrt(D), from the
    centre by (-x, -y, +/- sqrt(D)). kernels/shapes/sphere/ derives the bounds beyond which doubles are sure of which
    end is met, if any, and t and the normal are right to 2^-24.
    """
    C, r = sphere.center, sphere.radius
    x, y, b = C.x - o.from_anchor.x, C.y - o.from_anchor.y, -C.z
    rr, XX = r * r, x * x + y * y
    D = rr - XX
    root = math.sqrt(max(D, 0.0))
    ends, hits = {-1: b - root, 1: b + root}, D >= 0
    e = 2.0**-48 * (((abs(C.x) + abs(C.y)) + abs(C.z)) + o.reach)
    D_error = 2 * e * ((abs(x) + abs(y)) + e) + 2.0**-48 * (rr + XX)
    small = min(abs(ends[-1]), abs(ends[1]), r) * 2.0**-26
    sure = D_error < -D or (D_error < D and D_error <= root * small and e <= small)
    equation = sphere.equation(ray) if not sure else None
    if equation:
        b, c, D = equation.rounded()
        root = math.sqrt(max(D, 0.0))
        q = abs(b) + root
        other = c / q if q else 0.0
        ends, hits = {-1: other, 1: q} if b >= 0 else {-1: -q, 1: -other}, equation.discriminant.sign() >= 0
        v = _exact_v(sphere, ray, equation)
        x, y = v.x, v.y
    for side in (-1, 1) if hits else ():
        ahead = Root(equation, side).is_between(0.0, math.inf) if equation else ends[side] > 0
        if ahead:
            return SphereHit(ends[side], side, sphere.unit(Direction(-x, -y, -side * root)), ends[side])
    return None


def from_surface(sphere: Sphere, ray: Ray) -> SphereHit | None:
    """The equation of a ray that starts on a surface A and leads from there to infinity, along the world's axes.

    If A is a sphere, it starts at its centre plus p = r_A m, with m = B^T q and the unit normal q of its start, and
    leads along w = B^T d. So f = (C - C_A) - p, from the start to the centre C of this sphere, is right wherever in the
    world both are. With b = f.w and X = |f x w|, the discriminant is D = a r^2 - X^2.

    Where doubles are sure, they are right in which end is met, if any, and t is right to 2^-24 of itself. u = 2^-53; f,
    w and X are those of doubles, f1, w1 and X1 the sums of their coordinates' magnitudes, and s = f1 + r_A.

    f. Off by f' < 48 u s, as rays.Way has it, and w by 5.2 u |w|.
    b, X. 5.2 u |f| |w| + f' |w|, and 3 u |f| |w| for products and sums (of X, in the length of the vector):
        < 57 u s w1 < e = 64 u s w1.
    D. X^2 is off by 2 X1 e + e^2, and by 3 u of itself; a r^2 by 15.4 u of itself, as w turns a by 10.4 u and its sums
        round by 3 u; D rounds by u. That is < D_error = 2 X1 e + e^2 + 64 u (a r^2 + X^2).
    c. 2 |f| f' < 4 u |f|^2 + 96 u |f| r_A; the sums round by 3 u |f|^2, r^2 and the difference by 2 u (r^2 + |f|^2):
        that is < c_error = 128 u s f1 + 8 u (|f|^2 + r^2), but for f'^2. It counts only where one of these holds:
        |b| > e, so |f| > 64 u s > f': then f'^2 < 48 u s |f| is below 2^26 c_error by far;
        e <= 2^-26 q, so 64 u s < 2^-26 (|f| + r): then f'^2 < 2.3 u (|f|^2 + r^2), and there is room for that.
    t. q = |b| + sqrt(D) is off by 2^-26 q for b and by D_error / sqrt(D) <= 2^-25 q for the root; a by 14 u, and c by
        2^-26 of itself. t is q / a or c / q: 2^-24. From outside |b| >= sqrt(D) in truth, so b's sign is sure.

    On A itself c = 0 by definition: outwards it is never met again, inwards at t = 2 b / a.

    Ellipsoids. If this surface is one, K f and K w take the places of f and w. With the size k of K, their products
    round by 3 u k f1 and 3 u k w1, so that they are off by 51 u k s and 9 u k w1. With k s for s and k w1 for w1 all
    bounds above hold: of b < 63 u, of c 102 u for its 96 u and 2.6 u for its 2.3 u. Only the error of a = |K w|^2 is
    not a share of it: as K w is off by less than e_w = 16 u k w1, it is below a_error = e_w (2 |K w|_1 + e_w), which D
    gets times r^2, and which t needs to be below 2^-27 a.

    An ellipsoid meets rays from the eye here as well: then f is the exact difference, rounded, and r_A = 0.
    """
    start, k, r, d = ray.origin, sphere.stretch, sphere.radius, ray.direction
    w = sphere.view.B.T @ d
    is_own, reach = False, 0.0
    if isinstance(start, Start):
        is_own, reach = start.surface is sphere, start.reach
        f = (sphere.place - start.place) - start.step
    else:
        f = Direction(*(sphere.exact.center - sphere.view.exact_eye).rounded())
    s, kf, kw = k * (size_of(f) + reach), k * size_of(f), k * size_of(w)
    f, w, rr = sphere.seen(f), sphere.seen(w), r * r
    X = f.cross(w)
    a, b, ff, XX = w.dot(w), f.dot(w), f.dot(f), X.dot(X)
    c, arr = ff - rr, a * rr
    D = arr - XX
    b_error = 2.0**-47 * s * kw
    D_error = (2 * size_of(X) * b_error + b_error * b_error) + 2.0**-47 * (arr + XX)
    c_error = 2.0**-46 * s * kf + 2.0**-50 * (ff + rr)
    a_error = 0.0
    if sphere.K:
        w_error = 2.0**-49 * kw
        a_error = w_error * (2 * size_of(w) + w_error)
        D_error += rr * a_error
    root = math.sqrt(max(D, 0.0))
    q = abs(b) + root
    side: int | None = None  # the end that is met, 0 if there is none; None if doubles are not sure
    if is_own:
        if b < -b_error:
            side = 0
        elif b_error <= 2.0**-26 * b and a_error <= 2.0**-27 * a:
            side = 1
    else:
        c_sure, outside = abs(c) > 2.0**26 * c_error, c > 0
        if -D_error > D or (c_sure and outside and b < -b_error):
            side = 0
        elif (
            c_sure
            and (D_error < D and D_error <= 2.0**-25 * root * q)
            and b_error <= 2.0**-26 * q
            and a_error <= 2.0**-27 * a
        ):
            side = 1 if not outside else -1 if b > 0 else 0
    if side is None:
        exact = sphere.equation(ray).first(0.0, math.inf)
        if exact is None:
            return None
        t, side = float(exact), exact.side
    elif side == 0:
        return None
    elif is_own:
        t = (b + b) / a
    elif side < 0:
        t = c / q
    else:
        t = q / a if b >= 0 else -c / q
    # From the centre to the point is t w - f; a sphere's normal is turned to camera space last.
    g = w * t - f
    if not g.dot(g) > 0:  # it is so small, for its distance, that doubles have both in one place
        g = -w
    n = g * (1 / math.sqrt(g.dot(g)))
    # The root in the distance is the one that the kernel takes, for equal bits.
    return SphereHit(t, side, n if sphere.K else sphere.view.B @ n, t * math.sqrt(d.dot(d)))


def from_anywhere(sphere: Sphere, ray: Ray) -> SphereHit | None:
    """Any ray: all of it is exact, and rounded in the end."""
    root = sphere.equation(ray).first(ray.t_min, ray.t_max)
    if root is None:
        return None
    # By way of start + t d - C with the t of exact arithmetic, not the rounded one.
    line, t, bits = root.of.line, root.value(), 256
    start = line.start - sphere.exact.center
    from_center = [
        p.between(bits + start.over.bit_length()).low / start.over + t * w
        for p, w in zip(start.numbers, line.direction.fractions(), strict=True)
    ]
    own = ExactPoint.of(from_center)
    if not sphere.K:
        own = sphere.view.to_camera(own)
    else:
        own = ExactPoint(sphere.exact.seen(own.numbers), own.over * sphere.exact.K_over)
    q = sphere.unit(Direction(*own.rounded()))
    return SphereHit(float(root), root.side, q, float(root) * ray.direction.length())


def surely_blocks(sphere: Sphere, ray: ShadowRay) -> bool | None:
    """Whether a sphere that the ray does not start on is met before its end; None if doubles cannot tell.

    A line that passes by the sphere does not meet it, nor does a ray that starts outside and leads away. From inside to
    inside nothing is crossed, and from inside to outside or back the sphere is. From outside to outside it is if the
    middle of the way through it, t = b / a, is before the end.

    Bounds, with u = 2^-53: f is off by 48 u s and w by 48 u w1, see rays.Way; K f and K w by 51 u k s and 51 u k w1. So
    b and X are off by 105 u k s k w1, a by 105 u (k w1)^2, and c by 105 u (k s)^2, with the rounding of products and
    sums, all less than 2^-46 of these. From the light at L to the centre, g = C - L is rounded once, K g by 3 u.
    """
    way = ray.way
    if way is None:
        return None
    f, k, rr = way.to(sphere.place), sphere.stretch, sphere.radius * sphere.radius
    s, w1, f, w = k * (size_of(f) + way.reach), k * way.w1, sphere.seen(f), sphere.seen(way.w)
    X, a, b, c = f.cross(w), w.dot(w), f.dot(w), f.dot(f) - rr
    e, XX = 2.0**-46 * s * w1, X.dot(X)
    arr = a * rr
    D_error = rr * (2.0**-46 * w1 * w1) + 2 * size_of(X) * e + e * e + 2.0**-48 * (arr + XX) + FLOOR
    meets = _sign(arr - XX, D_error)
    if meets == -1:
        return False
    start, ahead = _sign(c, 2.0**-46 * (s * s + rr) + FLOOR), _sign(b, e + FLOOR)
    if start == 1 and ahead == -1:
        return False
    end: int | None = 1
    short: int | None = 1
    if ray.light.site is not None:
        g = sphere.place - ray.light.site
        g1, g = k * size_of(g), sphere.seen(g)
        end = _sign(g.dot(g) - rr, 2.0**-46 * (g1 * g1 + rr) + FLOOR)
        short = _sign(a - b, 2.0**-46 * w1 * w1 + e + FLOOR)
    if start is None or end is None:
        return None
    if start < 0 or end < 0:
        return start != end
    if short == -1:
        return False
    return True if meets == ahead == short == 1 else None


def _sign(value: float, error: float) -> int | None:
    """None if it is in doubt."""
    return 1 if value > error else -1 if value < -error else None


def _around(q: Direction) -> UV:
    """Where a sphere's texture is at the unit normal q: u goes round the y axis, v from the top down."""
    # The angle from the y axis by its tangent: near the poles the cosine would lose digits. On all of the seam u is 1,
    # where an x of -0.0 would make it 0.
    return 0.5 + math.atan2(q.x + 0.0, q.z) / (2 * math.pi), math.atan2(math.hypot(q.x, q.z), q.y) / math.pi


def spheres(setting: Setting) -> Iterator[Sphere]:
    """Those of a scene, and its ellipsoids."""
    return (Sphere(setting, i) for i in range(len(setting.scene.spheres)))
