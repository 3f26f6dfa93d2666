"""Cylinders with flat ends: a row of SHAPES."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import cross, dot, minus
from cltrace.plan.accel.silhouettes import Capsules
from cltrace.plan.accel.tree import Paths
from cltrace.plan.lights import Lamp
from cltrace.plan.order import MANY, spatial_order
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Ints, along, rotated
from cltrace.plan.shapes.shape import Arrays, InView, ShapePacking, Sights, share
from cltrace.scene import AnyCamera, Scene

FLAGS = ("WITH_CYLINDERS", "WITH_SHAPES", "WITH_PLACED")
# Bounds are wider by this share than double rounds.
ROOM = 2.0**-40


@dataclass(frozen=True, eq=False)
class CylinderPacking(ShapePacking):
    """n cylinders: a Shape. Many are sorted by place.

    start, end: (n, 3) float64, the middles of their ends, and radius: (n,) float64, in the world, in scene units;
    of_material: (n,).
    """

    start: Array
    end: Array
    radius: Array
    of_material: Ints

    words: ClassVar[str] = "cylinders"

    @classmethod
    def of(cls, scene: Scene, request: Request, before: tuple[Scene, CylinderPacking] | None) -> CylinderPacking:
        if before and share(before[0], scene, "cylinders"):
            return before[1]
        of = scene.cylinders
        row = np.arange(len(of), dtype=np.int32)
        if len(of) >= MANY and "order" not in request.keep:
            row = spatial_order(of["start"] / 2 + of["end"] / 2)
        of = of.take(row)
        parts = {name: np.ascontiguousarray(of[name]) for name in ("start", "end", "radius")}
        middle, half = of["start"] / 2 + of["end"] / 2, of["end"] / 2 - of["start"] / 2
        half = np.sqrt((half**2).sum(axis=1))
        rounding = ROOM * np.abs(middle).max(axis=1, initial=0)
        outer = np.hypot(half, of["radius"]) * (1 + ROOM) + rounding
        inner = np.maximum(np.minimum(half, of["radius"]) * (1 - ROOM) - rounding, 0)
        tree = {"center": middle, "outer": outer, "inner": inner, "member": np.ones(len(row), bool)}
        flags = FLAGS if len(row) else ()
        return cls(row, of["number"], flags, tree, leave=len(row) > 0, **parts, of_material=of["material"])

    def material(self, scene: Scene) -> Ints:
        return self.of_material

    def solid_of(self, scene: Scene) -> Ints:
        return -scene.cylinders["unclipped"].take(self.row)

    @property
    def sizes(self) -> Array:
        return np.concatenate([self.radius, np.abs(self.end - self.start).max(axis=1, initial=0)])

    def values(self, first: int) -> dict[str, Any]:
        return {"first_cylinder": first, "cylinders": len(self.radius)}

    def packed(self, real: np.dtype[Any], exponent: int | None, basis: Array, paths: Paths) -> Arrays:
        packed = np.zeros((len(self.radius), 2, 4), real)
        if exponent is None:
            packed[:, 0, :3], packed[:, 1, :3], packed[:, 0, 3] = self.start, self.end, self.radius
        else:
            axis = np.ldexp(self.end - self.start, exponent)
            length = np.sqrt((axis * axis).sum(axis=1))
            packed[:, 0, :3] = paths.moved(self.start, exponent)
            packed[:, 0, 3], packed[:, 1, 3] = np.ldexp(self.radius, exponent), length
            packed[:, 1, :3] = axis / np.where(length > 0, length, 1)[:, None]
        return {"cylinder": packed.reshape(-1, 4)}

    def in_view(self, camera: AnyCamera, first: int) -> CylindersInView:
        return CylindersInView(self, camera, first)

    def sides(self, point: Array) -> NDArray[np.int8]:
        """(n,): whether a point of the world is outside of each cylinder, 1, on it, 0, or inside, -1; exactly."""
        r = self.radius
        x, u = (np.ascontiguousarray(v.T) for v in (point - self.start, self.end - self.start))
        along, uu = (x * u).sum(axis=0), (u * u).sum(axis=0)
        across = np.stack(cross(x, u))
        square, rim = (across * across).sum(axis=0), r * r * uu
        # Coordinates of x and u are off by 2^-53 of themselves, products by more; 2^-48 of all sizes is beyond that.
        x1, u1 = np.abs(x).sum(axis=0), np.abs(u).sum(axis=0)
        error = 2.0**-48 * x1 * u1 + 2.0**-48 * uu
        beyond = np.maximum(-along, along - uu)
        excess, excess_error = square - rim, 2.0**-45 * (x1 * u1) ** 2 + 2.0**-48 * rim
        out = np.where((beyond > error) | (excess > excess_error), 1, -1).astype(np.int8)
        sure = (out > 0) | ((beyond < -error) & (excess < -excess_error))
        for i in np.flatnonzero(~sure).tolist():
            out[i] = _exact_side(self.start[i], self.end[i], radius=float(r[i]), point=point)
        return out


def _exact_side(start: Array, end: Array, radius: float, point: Array) -> int:
    S, E, P = ([Fraction(v) for v in p.tolist()] for p in (start, end, point))
    x, u = minus(P, S), minus(E, S)
    across, along, uu = cross(x, u), dot(x, u), dot(u, u)
    excess = dot(across, across) - Fraction(radius) ** 2 * uu
    beyond = max(-along, along - uu, excess)
    return (beyond > 0) - (beyond < 0)


class CylindersInView(InView):
    """Cylinders as a camera sees them."""

    shape: CylinderPacking

    @cached_property
    def near(self) -> tuple[Array, Array]:
        """(n, 3) each: from the eye to the ends' middles, along the camera's axes, in scene units."""
        return self.seen_from(np.array(self.camera.position))

    def lengths(self) -> Sequence[Array]:
        return (*self.near, self.shape.radius)

    def see(self, k: int, lights: list[Lamp], request: Request) -> Sights:
        sides = np.ones((len(lights), len(self.shape.radius)), np.int8)
        seen = [self.from_light(light, k, side) for light, side in zip(lights, sides, strict=True)]
        eye = self.capsules(self.near, k)
        lit: Arrays = {"cylinder_side": sides.reshape(-1)}
        arrays: Arrays = {"cylinder_seen": self._seen(k)}
        return Sights(arrays, eye=eye, lights=[*seen], lit=lit)

    def _seen(self, k: int) -> NDArray[np.float32]:
        """The kernel's buffer of that name."""
        basis = np.array(self.camera.basis())
        axis = np.stack(along(basis, self.shape.end - self.shape.start), axis=1)
        length = np.sqrt((axis * axis).sum(axis=1))
        middle, half = self.near[0] + axis / 2, length / 2
        seen = np.empty((len(length), 2, 4), np.float32)
        seen[:, 0, :3], seen[:, 0, 3] = np.ldexp(middle, k), np.ldexp(half, k)
        seen[:, 1, :3], seen[:, 1, 3] = axis / length[:, None], np.ldexp(self.shape.radius, k)
        return seen.reshape(-1, 4)

    def from_light(self, light: Lamp, k: int, side: NDArray[np.int8]) -> Capsules:
        """What a light sees. side: (n,), gets on which side of each one a light at a point is; others are outside."""
        if not light.at_point:
            return self.capsules(self.near, k)
        side[:] = self.shape.sides(light.place)
        return self.capsules(self.seen_from(light.place), k)

    def capsules(self, ends: tuple[Array, Array], k: int) -> Capsules:
        start, end = (np.ldexp(p, k) for p in ends)
        return Capsules(start, end, radius=np.ldexp(self.shape.radius, k), first=self.first)

    def seen_from(self, point: Array) -> tuple[Array, Array]:
        """(n, 3) each: from a point of the world to the ends' middles, along the camera's axes; see `near`."""
        basis, of = np.array(self.camera.basis()), self.shape
        return rotated(basis, of.start, point), rotated(basis, of.end, point)
