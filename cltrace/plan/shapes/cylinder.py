"""Cylinders with flat ends, and balls that planes have cut: a row of SHAPES."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import cross
from cltrace.plan.accel.silhouettes import Capsules
from cltrace.plan.accel.tree import Paths
from cltrace.plan.lights import AtPoint, Lamp, Parallel
from cltrace.plan.order import MANY, spatial_order
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Ints, Mask, along, rotated
from cltrace.plan.shapes.shape import Arrays, InView, ShapePacking, Sights, share
from cltrace.scene import AnyCamera, Scene

FLAGS = {"WITH_SHAPES": "shape", "WITH_PLACED": "shape"}
# Bounds are wider by this share than double rounds.
ROOM = 2.0**-40


@dataclass(frozen=True, eq=False)
class CylinderPacking(ShapePacking):
    """n cylinders, the last of which are cut balls: a Shape. Many of either are sorted by place.

    start, end: (n, 3) float64, the middles of their ends, or what cuts the balls, and radius: (n,) float64, in the
    world, in scene units; center: (m, 3), and flat: (m,), of the m cut balls; capped: (m,), the solid ones of which a
    disc of a lower number covers the cut, and covering: (m,), the discs that cover one; of_material: (n,).
    """

    start: Array
    end: Array
    radius: Array
    center: Array
    flat: Mask
    capped: Mask
    covering: Mask
    of_material: Ints

    words: ClassVar[str] = "cylinders"

    @classmethod
    def of(cls, scene: Scene, request: Request, before: tuple[Scene, CylinderPacking] | None) -> CylinderPacking:
        if before and share(before[0], scene, "cylinders", "cuts"):
            return before[1]
        of, cuts = scene.cylinders, scene.cuts

        def order(places: Array) -> Ints:
            by_place = len(places) >= MANY and "order" not in request.keep
            return spatial_order(places) if by_place else np.arange(len(places), dtype=np.int32)

        row, row_of_cuts = order(of["start"] / 2 + of["end"] / 2), order(cuts["center"])
        of, cuts = of.take(row), cuts.take(row_of_cuts)
        n, row = len(of), np.concatenate([row, row_of_cuts + np.int32(len(of))])
        names = ("start", "end", "radius", "number", "material")
        parts = {name: np.concatenate([of[name], cuts[name]]) for name in names}
        middle, half = parts["start"] / 2 + parts["end"] / 2, parts["end"] / 2 - parts["start"] / 2
        half = np.sqrt((half**2).sum(axis=1))
        # Cut balls are within whole ones, and nothing is known to be within them.
        middle[n:], half[n:] = cuts["center"], 0
        rounding = ROOM * np.abs(middle).max(axis=1, initial=0)
        outer = np.hypot(half, parts["radius"]) * (1 + ROOM) + rounding
        inner = np.maximum(np.minimum(half, parts["radius"]) * (1 - ROOM) - rounding, 0)
        tree = {"center": middle, "outer": outer, "inner": inner, "member": np.ones(len(row), bool)}
        flags = (FLAGS if len(row) else {}) | ({"WITH_CUTS": "shape"} if len(cuts) else {})
        number, of_material = parts.pop("number"), parts.pop("material")
        capped, covering = _caps(cuts)
        balls = {"center": cuts["center"].copy(), "flat": cuts["flat"] == 1, "capped": capped, "covering": covering}
        return cls(row, number, flags, tree, leave=len(row) > 0, **parts, **balls, of_material=of_material)

    @property
    def uncut(self) -> int:
        """How many come before the cut balls."""
        return len(self.radius) - len(self.flat)

    def material(self, scene: Scene) -> Ints:
        return self.of_material

    def values(self, first: int) -> dict[str, Any]:
        return {"first_rod": first, "rods": len(self.radius), "first_cut": self.uncut}

    def packed(self, real: np.dtype[Any], exponent: int | None, basis: Array, paths: Paths | None) -> Arrays:
        rod, cut = np.zeros((len(self.radius), 2, 4), real), np.zeros((len(self.flat), 4), real)
        cut[:, 3] = np.where(self.flat, 0, np.where(self.capped, 2, 1))
        if exponent is None or not paths:
            rod[:, 0, :3], rod[:, 1, :3], rod[:, 0, 3] = self.start, self.end, self.radius
            cut[:, :3] = self.center
        else:
            axis = np.ldexp(self.end - self.start, exponent)
            length = np.sqrt((axis * axis).sum(axis=1))
            rod[:, 0, :3] = np.ldexp(self.start - paths.middle, exponent)
            rod[:, 0, 3], rod[:, 1, 3] = np.ldexp(self.radius, exponent), length
            rod[:, 1, :3] = axis / np.where(length > 0, length, 1)[:, None]
            cut[:, :3] = np.ldexp(self.center - paths.middle, exponent)
        return {"rod": rod.reshape(-1, 4), "cut": cut}

    def in_view(self, camera: AnyCamera, first: int) -> CylindersInView:
        return CylindersInView(self, camera, first)

    def sides(self, point: Array) -> NDArray[np.int8]:
        """(n,): whether a point of the world is outside of each cylinder, 1, on it, 0, or inside, -1; exactly."""
        n, r = self.uncut, self.radius
        x, u = (np.ascontiguousarray(v.T) for v in (point - self.start, self.end - self.start))
        along, uu = (x * u).sum(axis=0), (u * u).sum(axis=0)
        # What is compared with the radius: of cut balls, the way from the centre.
        across, y = np.stack(cross(x, u)), (point - self.center).T
        across[:, n:] = y
        square, rim = (across * across).sum(axis=0), r * r * np.where(np.arange(len(r)) < n, uu, 1)
        # Coordinates of x and u are off by 2^-53 of themselves, products by more; 2^-48 of all sizes is beyond that.
        x1, u1 = np.abs(x).sum(axis=0), np.abs(u).sum(axis=0)
        size = x1 * u1
        size[n:] = np.abs(y).sum(axis=0)
        error = 2.0**-48 * x1 * u1
        beyond = np.maximum(-along, along - uu)
        beyond[n:][self.flat] = np.abs(along[n:][self.flat])
        excess, excess_error = square - rim, 2.0**-45 * size**2 + 2.0**-48 * rim
        error = error + 2.0**-48 * uu
        out = np.where((beyond > error) | (excess > excess_error), 1, -1).astype(np.int8)
        sure = (out > 0) | ((beyond < -error) & (excess < -excess_error))
        for i in np.flatnonzero(~sure).tolist():
            center, flat = (self.center[i - n], bool(self.flat[i - n])) if i >= n else (None, False)
            out[i] = _exact_side(self.start[i], self.end[i], radius=float(r[i]), point=point, center=center, flat=flat)
        return out


def _caps(cuts: NDArray[np.void]) -> tuple[Mask, Mask]:
    """(m,) each: see Cylinders."""
    names = ("center", "radius", "start", "end")
    rows = np.ascontiguousarray(np.column_stack([cuts[name] for name in names]))
    _, which = np.unique(rows.view(f"V{rows.itemsize * rows.shape[1]}").ravel(), return_inverse=True)
    first, solid = np.full(len(cuts), np.iinfo(np.int64).max), np.zeros(len(cuts), bool)
    flat = cuts["flat"] == 1
    np.minimum.at(first, which[flat], cuts["number"][flat])
    solid[which[~flat]] = True
    return ~flat & (first[which] < cuts["number"]), flat & solid[which]


def _exact_side(start: Array, end: Array, radius: float, point: Array, center: Array | None, flat: bool) -> int:
    S, E, P = ([Fraction(v) for v in p.tolist()] for p in (start, end, point))
    x, u = [p - s for p, s in zip(P, S, strict=True)], [e - s for e, s in zip(E, S, strict=True)]
    along, uu = sum(a * b for a, b in zip(x, u, strict=True)), sum(a * a for a in u)
    across, rim = cross(x, u), Fraction(radius) ** 2 * uu
    if center is not None:
        dx, dy, dz = (p - Fraction(c) for p, c in zip(P, center.tolist(), strict=True))
        across, rim = (dx, dy, dz), Fraction(radius) ** 2
    excess = sum(a * a for a in across) - rim
    beyond = max(-along, along - (0 if flat else uu), excess)
    return (beyond > 0) - (beyond < 0)


@dataclass
class CylindersInView(InView):
    """Cylinders as a camera sees them: InView. first: the index of the first one as a surface."""

    cylinders: CylinderPacking
    camera: AnyCamera
    first: int

    @cached_property
    def near(self) -> tuple[Array, Array]:
        """(n, 3) each: from the eye to the ends' middles, along the camera's axes, in scene units.

        Of cut balls, both are the middle of the ball.
        """
        return self.seen_from(np.array(self.camera.position))

    def lengths(self) -> Sequence[Array]:
        return (*self.near, self.cylinders.radius)

    def see(self, k: int, lights: list[Lamp], request: Request) -> Sights:
        sides = np.ones((len(lights), len(self.cylinders.radius)), np.int8)
        seen = [light.look(self, k, side) for light, side in zip(lights, sides, strict=True)]
        eye = self.capsules(self.near, k)
        lit: Arrays = {"rod_side": sides.reshape(-1)}
        arrays: Arrays = {"rod_seen": self._seen(k)}
        return Sights(arrays, eye=eye, lights=[*seen], visible=None, inside=eye.inside, lit=lit)

    def _seen(self, k: int) -> NDArray[np.float32]:
        """The kernel's buffer of that name."""
        basis, n = np.array(self.camera.basis()), self.cylinders.uncut
        axis = np.stack(along(basis, self.cylinders.end - self.cylinders.start), axis=1)
        length = np.sqrt((axis * axis).sum(axis=1))
        middle, half = self.near[0] + axis / 2, length / 2
        # A cut ball is within a cylinder that is as long as wide.
        middle[n:], half[n:] = self.near[0][n:], self.cylinders.radius[n:]
        seen = np.empty((len(length), 2, 4), np.float32)
        seen[:, 0, :3], seen[:, 0, 3] = np.ldexp(middle, k), np.ldexp(half, k)
        seen[:, 1, :3], seen[:, 1, 3] = axis / length[:, None], np.ldexp(self.cylinders.radius, k)
        return seen.reshape(-1, 4)

    def from_point(self, light: AtPoint, k: int, side: NDArray[np.int8]) -> Capsules:
        """What a light sees. side: (n,), gets on which side of each one the light is."""
        side[:] = self.cylinders.sides(light.place)
        return replace(self.capsules(self.seen_from(light.place), k), idle=self.idle)

    def along(self, light: Parallel, k: int, side: NDArray[np.int8]) -> Capsules:
        """The same of a parallel light. Infinitely far away, it is outside of all."""
        return replace(self.capsules(self.near, k), idle=self.idle)

    @property
    def idle(self) -> Mask:
        """(n,): discs that stop no ray to a light that the solid ball does not stop, of which they are a part."""
        return np.concatenate([np.zeros(self.cylinders.uncut, bool), self.cylinders.covering])

    def capsules(self, ends: tuple[Array, Array], k: int) -> Capsules:
        start, end = (np.ldexp(p, k) for p in ends)
        return Capsules(start, end, radius=np.ldexp(self.cylinders.radius, k), first=self.first)

    def seen_from(self, point: Array) -> tuple[Array, Array]:
        """(n, 3) each: from a point of the world to the ends' middles, along the camera's axes; see `near`."""
        basis, of = np.array(self.camera.basis()), self.cylinders
        start, end = (np.concatenate([ends[: of.uncut], of.center]) for ends in (of.start, of.end))
        return rotated(basis, start, point), rotated(basis, end, point)
