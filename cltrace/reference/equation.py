"""a t^2 - 2 b t + c = 0 in double precision, for a ray and a sphere: each number in the form that keeps its digits.

A ray from the eye, and one from a sphere to wherever it leads, is computed as the kernel does it, operation by
operation, so that both get the same bits; doubles decide where they are sure to be right, and exact.py where not. Any
other ray is ruled out by doubles where those are sure, and otherwise left to exact.py altogether.
"""

from __future__ import annotations

import math

from cltrace.base.arithmetic import minus
from cltrace.reference.doubt import size_of
from cltrace.reference.exact import product, vector
from cltrace.reference.rays import EYE, OnPlane, Ray, Start
from cltrace.reference.round import Equation, Round, surely_misses
from cltrace.reference.vectors import Direction

AHEAD = Direction(0.0, 0.0, -1.0)


class FromEye(Equation):
    """The tutorial's equation for a ray that starts at the eye, where C - o is the centre itself.

    c = |C|^2 - r^2 comes from the exact scene, rounded once. The discriminant b^2 - a c is kept where it is accurate,
    for |b| < r |d| and from inside; elsewhere a (r^2 - |v|^2) is, where v leads from the ray's closest point to the
    centre. kernels/shapes/sphere/ derives both, and the bound below which the sign of the result is in doubt.
    """

    def __init__(self, sphere: Round, ray: Ray) -> None:
        super().__init__(sphere, ray)
        C, d, r, c = sphere.center - EYE, ray.direction, sphere.radius, sphere.eye_power
        self.a, self.b, self.outside = d.dot(d), C.dot(d), sphere.eye_outside
        k = self.b * (1 / self.a)
        self.v = Direction(C.x - k * d.x, C.y - k * d.y, C.z - k * d.z)
        bb, rr, arr = self.b * self.b, r * r, self.a * (r * r)
        self.by_b = bb < arr or not self.outside
        self.discriminant = bb - self.a * c if self.by_b else self.a * (rr - self.v.dot(self.v))
        # Of a sphere this far and small, v would have lost too many digits for the normal.
        tiny = arr < bb * 2.0**-42
        self.unsure = not abs(self.discriminant) > (bb + arr) * 2.0**-48
        if self.unsure or tiny:
            self.discriminant = float(self.exact.discriminant.p)
            self.hits = self.exact.discriminant.sign() >= 0
            if tiny:
                self.v = self._exact_v()
            # All but on the sphere, and all but along it, b cancels, too.
            if self.unsure and bb < arr * 2.0**-16:
                self.b = float(self.exact.b.p)
        else:
            self.hits = self.discriminant >= 0
        self.root = math.sqrt(max(self.discriminant, 0.0))

    def _exact_v(self) -> Direction:
        ball, frame, d = self.sphere.ball, self.sphere.frame, self.sphere.frame.to_world(self.ray.direction)
        k = self.exact.b.p / self.exact.a.p
        x, y, z = (c - k * e for c, e in zip(ball.center, d, strict=True))
        return Direction(*map(float, frame.to_camera((x, y, z))))

    def side(self) -> int | None:
        return next((side for side in (-1, 1) if self._is_in_range(side)), None) if self.hits else None

    def _is_in_range(self, side: int) -> bool:
        """By doubles, which are off by 2^-25 at most, unless the sign of the discriminant or this is in doubt."""
        low, high, t = self.ray.t_min, self.ray.t_max, self._t(side)
        if self.unsure or not abs(t - low) > abs(low) * 2.0**-22 or not abs(t - high) > t * 2.0**-22:
            return self._root(side).is_between(low, high)
        return low < t < high

    def t(self, side: int) -> float:
        t = self._t(side)
        if not self.ray.t_min < t < self.ray.t_max:  # only the exact one is
            t = self._exact_t(side)
        return t

    def _t(self, side: int) -> float:
        """b - root or b + root might cancel: with q = b + root, or b - root if b < 0, the roots are q / a and c / q."""
        a, b, c, root = self.a, self.b, self.sphere.eye_power, self.root
        if side < 0 and b >= 0 and not self.by_b and a * c > 2.0**-10 * (b * b):
            return (b - root) * (1 / a)  # does not cancel much, and needs no division
        q = b - root if b < 0 else b + root
        numerator, denominator = (q, a) if (b < 0) == (side < 0) else (c, q)
        return numerator / denominator if denominator else 0.0

    def normal(self, side: int, t: float) -> Direction:
        """By way of t d - C, or without its cancellation -v -/+ sqrt(D)/a d, where the discriminant comes from v."""
        if self.by_b:
            return self._unit(self.ray.direction * t - (self.sphere.center - EYE))
        along = self.ray.direction * (self.root * (1 / self.a))
        return self._unit(-(self.v + along) if side < 0 else along - self.v)

    def distance(self, t: float) -> float:
        return t * math.sqrt(self.a)


class FromPlane(Equation):
    """The equation of a ray from o = (x, y, 0) along -z, to which a sphere is a disc.

    With (x, y) from the ray to the centre C, D = r^2 - (x^2 + y^2), and the ends are at t = -C.z -/+ sqrt(D), from the
    centre by (-x, -y, +/- sqrt(D)). kernels/shapes/sphere/ derives the bounds beyond which doubles are sure of which
    end is met, if any, and t and the normal are right to 2^-24.
    """

    def __init__(self, sphere: Round, o: OnPlane, ray: Ray) -> None:
        super().__init__(sphere, ray)
        C, r = sphere.center, sphere.radius
        self.x, self.y, self.b = C.x - o.x, C.y - o.y, -C.z
        rr, XX = r * r, self.x * self.x + self.y * self.y
        self.discriminant = D = rr - XX
        self.root = math.sqrt(max(D, 0.0))
        first, last = self.b - self.root, self.b + self.root
        e = 2.0**-48 * (((abs(C.x) + abs(C.y)) + abs(C.z)) + o.reach)
        D_error = 2 * e * ((abs(self.x) + abs(self.y)) + e) + 2.0**-48 * (rr + XX)
        least = min(abs(first), abs(last), r)
        small = least * 2.0**-26
        self.sure = D_error < -D or (D_error < D and D_error <= self.root * small and e <= small)
        self.ends, self.hits = {-1: first, 1: last}, D >= 0
        if not self.sure:
            self._decide()

    def _decide(self) -> None:
        """The same from exact numbers: D, b and c rounded once."""
        ball, frame, exact = self.sphere.ball, self.sphere.frame, self.exact
        b, c = float(exact.b.p), float(exact.c.p)
        self.discriminant = float(exact.discriminant.p)
        self.root = math.sqrt(max(self.discriminant, 0.0))
        q = abs(b) + self.root
        other = c / q if q else 0.0
        self.ends, self.hits = {-1: other, 1: q} if b >= 0 else {-1: -q, 1: -other}, exact.discriminant.sign() >= 0
        start, w = self.ray.line(frame).start, frame.to_world(self.ray.direction)
        k = exact.b.p / exact.a.p
        x, y, z = (C - s.p - k * e for C, s, e in zip(ball.center, start, w, strict=True))
        v = frame.to_camera((x, y, z))
        self.x, self.y = float(v[0]), float(v[1])

    def side(self) -> int | None:
        return next((side for side in (-1, 1) if self._is_ahead(side)), None) if self.hits else None

    def _is_ahead(self, side: int) -> bool:
        return self.ends[side] > 0 if self.sure else self._root(side).is_between(0.0, math.inf)

    def t(self, side: int) -> float:
        return self.ends[side]

    def normal(self, side: int, t: float) -> Direction:
        return self._unit(Direction(-self.x, -self.y, -side * self.root))

    def distance(self, t: float) -> float:
        return t


class FromSurface(Equation):
    """The equation of a ray that starts on a surface A and leads from there to infinity, along the world's axes.

    If A is a sphere, it starts at its centre plus p = r_A m, with m = B^T q and the unit normal q of its start, and
    leads along w = B^T d. So f = (C - C_A) - p, from the start to the centre C of this sphere, is right wherever in the
    world both are. With b = f.w and X = |f x w|, the discriminant is D = a r^2 - X^2.

    Where doubles are sure, they are right in which end is met, if any, and t is right to 2^-24 of itself. u = 2^-53; f,
    w and X are those of doubles, f1, w1 and X1 the sums of their coordinates' magnitudes, and s = f1 + r_A.

    m, w. Turning rounds three times, by u of at most |B^T| |q|: m is off by sqrt(27) u < 5.2 u, w by 5.2 u |w|. What m
        stands for is B^T q / |B^T q|. As rays.py has it, |q|^2 is 1 -/+ 64 u as computed, 67 u in truth, and the axes
        are orthonormal but for 14 u (see exact.Frame), so |B^T q| is 1 -/+ 40.5 u.
    f. C - C_A rounds by u (|f| + r_A), p by u r_A, and their difference by u |f|: f is off by
        f' = 2 u |f| + (40.5 + 5.2 + 2) u r_A < 48 u s.
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

    Ellipsoids. If A is one, p = r_A L q, which rounds by 5 u l r_A, l being the size of L (see vectors.Matrix): with
    s = f1 + l r_A, f' is less than above. If this surface is one, K f and K w take the places of f and w. With the size
    k of K, their products round by 3 u k f1 and 3 u k w1, so that they are off by 51 u k s and 9 u k w1. With k s for s
    and k w1 for w1 all bounds above hold: of b < 63 u, of c 102 u for its 96 u and 2.6 u for its 2.3 u. Only the error
    of a = |K w|^2 is not a share of it: as K w is off by less than e_w = 16 u k w1, it is below
    a_error = e_w (2 |K w|_1 + e_w), which D gets times r^2, and which t needs to be below 2^-27 a.

    If A is a triangle, p leads from a corner C_A by u and v times two edges, whose lengths add up to 2 r_A at most. As
    u and v are 1/2 at most, p is off by 3 u r_A: f' is less than above.

    An ellipsoid meets rays from the eye here as well: then f is the exact difference, rounded, and r_A = 0.
    """

    def __init__(self, sphere: Round, ray: Ray) -> None:
        super().__init__(sphere, ray)
        start, k, r = ray.origin, sphere.stretch, sphere.radius
        w = sphere.frame.B.T @ ray.direction
        if isinstance(start, Start):
            self.is_own, reach = start.surface is sphere, start.reach
            f = (sphere.place - start.place) - start.step
        else:
            self.is_own, reach = False, 0.0
            f = Direction(*map(float, sphere.ball.center))
        s, kf, kw = k * (size_of(f) + reach), k * size_of(f), k * size_of(w)
        f, w, rr = sphere.seen(f), sphere.seen(w), r * r
        X = f.cross(w)
        self.f, self.w, self.a, self.b, ff, XX = f, w, w.dot(w), f.dot(w), f.dot(f), X.dot(X)
        self.c, arr = ff - rr, self.a * rr
        self.discriminant = arr - XX
        self.b_error = 2.0**-47 * s * kw
        self.D_error = (2 * size_of(X) * self.b_error + self.b_error * self.b_error) + 2.0**-47 * (arr + XX)
        self.c_error = 2.0**-46 * s * kf + 2.0**-50 * (ff + rr)
        self.a_error = 0.0
        if sphere.ball.to_object is not None:
            w_error = 2.0**-49 * kw
            self.a_error = w_error * (2 * size_of(w) + w_error)
            self.D_error += rr * self.a_error
        self.root = math.sqrt(max(self.discriminant, 0.0))
        self.q = abs(self.b) + self.root
        self.sure = self._own_side() if self.is_own else self._sure_side()

    def _own_side(self) -> int | None:
        if self.b < -self.b_error:
            return 0
        return 1 if self.b_error <= 2.0**-26 * self.b and self.a_error <= 2.0**-27 * self.a else None

    def _sure_side(self) -> int | None:
        """The end that is met, 0 if there is none; None if doubles are not sure."""
        c_sure, outside = abs(self.c) > 2.0**26 * self.c_error, self.c > 0
        if self.discriminant < -self.D_error or (c_sure and outside and self.b < -self.b_error):
            return 0
        D_sure = self.discriminant > self.D_error and self.D_error <= 2.0**-25 * self.root * self.q
        if not (c_sure and D_sure and self.b_error <= 2.0**-26 * self.q and self.a_error <= 2.0**-27 * self.a):
            return None
        return 1 if not outside else -1 if self.b > 0 else 0

    def side(self) -> int | None:
        if self.sure is not None:
            return self.sure or None
        root = self.exact.first(0.0, math.inf)
        return None if root is None else root.side

    def t(self, side: int) -> float:
        if self.sure is None:
            return self._exact_t(side)
        if self.is_own:
            return (self.b + self.b) / self.a
        if side < 0:
            return self.c / self.q
        return self.q / self.a if self.b >= 0 else -self.c / self.q

    def normal(self, side: int, t: float) -> Direction:
        """From the centre to the point is t w - f; a sphere's is turned to camera space last."""
        g = self.w * t - self.f
        if not g.dot(g) > 0:  # it is so small, for its distance, that doubles have both in one place
            g = -self.w
        n = g * (1 / math.sqrt(g.dot(g)))
        return self.sphere.frame.B @ n if self.sphere.ball.to_object is None else n

    def distance(self, t: float) -> float:
        """With the root that the kernel takes, for equal bits; self.a may be in an ellipsoid's own axes."""
        d = self.ray.direction
        return t * math.sqrt(d.dot(d))


class FromAnywhere(Equation):
    """The equation of any ray: where doubles do not rule it out, all of it is exact, and rounded in the end."""

    def side(self) -> int | None:
        if surely_misses(self.sphere, self.ray):
            return None
        root = self.exact.first(self.ray.t_min, self.ray.t_max)
        return None if root is None else root.side

    def t(self, side: int) -> float:
        return self._exact_t(side)

    def normal(self, side: int, t: float) -> Direction:
        """By way of start + t d - C with the t of exact arithmetic, not the rounded one."""
        ball, frame, bits = self.sphere.ball, self.sphere.frame, 256
        line, t_exact = self.ray.line(frame), self.exact_value(side)
        start = minus(line.start, vector(ball.center))
        x, y, z = (p.between(bits).low + t_exact * q.p for p, q in zip(start, line.direction, strict=True))
        own = product(ball.to_object, (x, y, z)) if ball.to_object else frame.to_camera((x, y, z))
        return self._unit(Direction(*map(float, own)))


def any_equation(surface: Round, ray: Ray) -> Equation:
    """For a ray from wherever it comes."""
    return (FromSurface if ray.is_plain else FromAnywhere)(surface, ray)
