"""Rays: where they start, where they lead, and how far they count; also as the exact engine has them."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from cltrace.exact.lines import ExactPoint, Frame, Line
from cltrace.reference.vectors import EYE, Direction, Matrix, Point, size_of
from cltrace.scene import AnyCamera

NOWHERE = Direction(0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class View(Frame):
    """The camera's place in the world, and its axes: B, whose rows lead from the world to camera space.

    The direction d of a ray in camera space stands for the direction B^T d in the world, exactly, see exact.Frame.
    Camera.basis() makes the rows unit to 3 u and orthogonal to 4 u, u = 2^-53 (a hypot() of 2 u, and quotients,
    products and differences of u each), so |B B^T - 1| is below 14 u.
    """

    eye: Point

    @cached_property
    def B(self) -> Matrix:
        return Matrix(*(Direction(*row) for row in self.rows))

    @cached_property
    def exact_eye(self) -> ExactPoint:
        return ExactPoint.of(self.eye)

    def seen(self, place: ExactPoint) -> Point:
        """A point of the world in camera space, each coordinate rounded once."""
        return Point(*self.to_camera(place - self.exact_eye).rounded())

    def turned(self, v: Sequence[float]) -> Direction:
        """A direction of the world in camera space, of length 1, right to a few ulp.

        The largest coordinate goes to 1 first, for the range.
        """
        largest = max(map(abs, v))
        return (self.B @ Direction(*(x / largest for x in v))).normalized()


@functools.lru_cache(maxsize=4)
def view_of(camera: AnyCamera) -> View:
    return View(camera.basis(), Point(*map(float, camera.position)))


@dataclass(frozen=True, eq=False)
class Start:
    """The point of a surface by which a ray leaves it: exactly, by numbers that put it on the surface.

    Or a point of the plane where the rays of an orthographic camera start.

    Rounded coordinates would put it off the surface, and every ray from there would need an epsilon. Doubles reach it
    in two steps, of which the first one is exact: to a point nearby, the anchor, and from there.

    surface: that the ray leaves, None if it comes from the camera; view: the camera's; place: the anchor in the world,
    exactly; anchor: in camera space, rounded; step: from the anchor to the point, along the world's axes, rounded;
    from_anchor: the same in camera space; reach: how far the point is from the anchor at most; point: in camera space,
    rounded; exact: makes the point in the world, exactly; on: the numbers that put it on the surface; support: of a
    sphere, how far the plane that touches it there is from the centre; fits: whether step is as good as the bounds of
    errors need it.
    """

    surface: Any
    view: View
    place: Point
    anchor: Point
    step: Direction
    from_anchor: Direction
    reach: float
    point: Point
    exact: Callable[[], ExactPoint]
    on: Any = None
    support: float | None = None
    fits: bool = True

    @cached_property
    def exact_point(self) -> ExactPoint:
        return self.exact()

    def height(self, point: Point, n: Direction) -> float:
        """n.(point - P), how far a point is above the plane through this one that has the outward unit normal n.

        On a sphere, P is the centre and radius n, so n.P needs no rounding.
        """
        if self.support is not None:
            return n.dot(point - self.anchor) - self.support
        return n.dot((point - self.anchor) - self.from_anchor)


def start_on_plane(view: View, x: float, y: float) -> Start:
    """A point of the plane where the rays of an orthographic camera start: exactly the eye plus x and y times its axes.

    The anchor is the eye. x, y: scene units.
    """
    v = Direction(x, y, 0.0)
    step, reach = view.B.T @ v, abs(x) + abs(y)
    return Start(
        None, view, view.eye, EYE, step, v, reach, EYE + v, lambda: view.exact_eye + view.to_world(tuple(v))
    )  # fmt: skip


@dataclass(frozen=True)
class Ray:
    """The points origin + t direction for t_min < t < t_max. The direction may have any length; t is in units of it.

    origin: a point in camera space whose coordinates are exactly these doubles, or a point of a surface. direction: in
    camera space, exactly these doubles.
    """

    origin: Point | Start
    direction: Direction
    t_min: float = 0.0
    t_max: float = math.inf

    def at(self, t: float) -> Point:
        start = self.origin.point if isinstance(self.origin, Start) else self.origin
        return start + self.direction * t

    @property
    def is_plain(self) -> bool:
        """Whether doubles may decide about it: it counts from 0 to infinity, starts at the eye or by a Start as good as
        that takes, and its d.d is far from the ends of double's range."""
        if (self.t_min, self.t_max) != (0, math.inf) or not 2.0**-200 < self.direction.dot(self.direction) < 2.0**200:
            return False
        return self.origin.fits if isinstance(self.origin, Start) else self.origin == EYE


@functools.lru_cache(maxsize=4)
def exact_line(ray: Ray, view: View) -> Line:
    """A ray in exact numbers, in the world."""
    if isinstance(ray.origin, Start):
        start = ray.origin.exact_point
    elif ray.origin == EYE:
        start = view.exact_eye
    else:
        start = view.exact_eye + view.to_world(tuple(ray.origin))
    return Line(start, view.to_world(tuple(ray.direction)))


@dataclass(frozen=True)
class Way:
    """A ray in doubles: from place + step along w, all of them along the world's axes.

    place: exactly; w1: |w|_1, or more where w is off by more than its own size; reach: a bound of |step|.

    Bounds, in which u = 2^-53, and s = |f|_1 + reach for f, the way from the start to a point, `to`:

    step. Of a sphere, step is r m with m = B^T q. Turning rounds three times, by u of at most |B^T| |q|: sqrt(27) u <
        5.2 u. What m stands for is B^T q / |B^T q|. |q|^2 is 1 -/+ 64 u as computed (see Start.fits), 67 u in truth,
        and the axes are orthonormal but for 14 u, so |B^T q| is 1 -/+ 40.5 u. Of an ellipsoid, step is r L q, which
        rounds by 5 u l r, l being the size of L (see vectors.Matrix), and reach is l r. Of a triangle, step leads from
        a corner by u and v times two edges, whose lengths add up to 2 reach at most; as u and v are 1/2 at most, it is
        off by 3 u reach. Of a cylinder, k u is off by 2 u |u|, e1 and e2 by 3 u of themselves, m by 6 u and m / |m| by
        12 u.
    f.  (point - place) rounds by u (|f| + reach), r m by u reach, and their difference by u |f|: f is off by
        2 u |f| + (40.5 + 5.2 + 2) u reach < 48 u s.
    w.  Turned from camera space: 5.2 u |w|. From a light to a point, it is f of that point: 48 u w1.
    """

    place: Point
    w: Direction
    w1: float
    step: Direction = NOWHERE
    reach: float = 0.0

    def to(self, point: Point) -> Direction:
        return (point - self.place) - self.step


def way_of(ray: Ray, view: View) -> Way | None:
    """None if doubles may not decide about the ray."""
    if not ray.is_plain:
        return None
    w, start = view.B.T @ ray.direction, ray.origin
    if isinstance(start, Start):
        return Way(start.place, w, size_of(w), step=start.step, reach=start.reach)
    return Way(view.eye, w, size_of(w))
