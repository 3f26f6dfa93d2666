"""The world in camera space, in more than double precision. The eye is the origin, x is right, y up and -z ahead."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace

import numpy as np

from cltrace.base.arithmetic import two_sum
from cltrace.plan.accel.silhouettes import Discs
from cltrace.plan.rounding import Array, Mask, differences, dot_products, square_excess
from cltrace.scene import AnyCamera


def in_camera_space(camera: AnyCamera, points: Array) -> Array:
    """Points (n, 3) of the world along the camera's axes, each coordinate rounded once."""
    hi, lo = two_sum(points, -np.array(camera.position))
    return dot_products(np.array(camera.basis()), hi, lo)[0]


def exponent(parts: Iterable[Array], least: float = 0.0) -> int:
    """The k for which 2^k times the largest coordinate or radius is in [1/2, 1).

    parts: all of these, in camera space; least: the largest one of those that are not among them.
    """
    ends = (float(end) for part in parts for end in (part.max(initial=0), -part.min(initial=0)))
    return -math.frexp(max(least, *ends))[1]


@dataclass(frozen=True)
class Space:
    """n spheres in camera space, in scene units; of times_two_to(k), in units of 2^-k scene units.

    center (n, 3): along the camera's axes, each coordinate rounded once; power (n,): |C|^2 - r^2 for the exact offset C
    of the centre from the eye, rounded once, so that no rounding of centres enters it; power_rest (n,): what that
    rounding cut off; loose (n,): which surfaces only lie within their spheres, None for none; place (n, 3): centres in
    the world; first: the index of the first sphere as a surface.
    """

    center: Array
    radius: Array
    power: Array
    power_rest: Array
    loose: Mask | None
    place: Array
    first: int = 0

    @classmethod
    def of(cls, camera: AnyCamera, center: Array, radius: Array, loose: Mask | None = None, first: int = 0) -> Space:
        """center (n, 3), radius (n,) and loose (n,) are in the world, in scene units."""
        eye, basis = np.array(camera.position), np.array(camera.basis())
        hi, lo = differences(center, eye)
        turned, _ = dot_products(basis, hi, lo)
        power, rest = square_excess(hi, lo, radius)
        return cls(turned, radius, power=power, power_rest=rest, loose=loose, place=center, first=first)

    def times_two_to(self, k: int) -> Space:
        """All lengths times 2^k. Nothing is rounded: a scene's numbers are within float32's range, 2^-149 to 2^128."""
        lengths = [f.name for f in fields(self) if f.name not in ("loose", "first")]
        factor = {name: 2.0 ** (2 * k if name.startswith("power") else k) for name in lengths}
        return replace(self, **{name: getattr(self, name) * by for name, by in factor.items()})

    def seen_from_eye(self) -> Discs:
        """The spheres as the eye sees them."""
        return self._discs(self.center, self._known(self.power))

    def seen_along_view(self) -> Discs:
        """The spheres as parallel rays see them that start on the plane through the eye and lead along the view.

        The power is 1 where that plane is clear of a sphere, and 0 where it may cut it. Lengths are about 1.
        """
        z, r = np.abs(self.center[:, 2]), self.radius
        return self._discs(self.center, np.where(z - r > 2.0**-20 * (z + r) + 2.0**-44, 1.0, 0.0))

    def seen_from(self, point: Array) -> tuple[Discs, Array]:
        """The spheres as a point of the world sees them along the world's axes; and (n,) the exact sign of its power.

        The sign is 1 where the point is outside of a sphere, 0 where it is on it, -1 where it is inside. No camera
        changes any of it, but by the unit.
        """
        hi, lo = differences(self.place, point)
        power, _ = square_excess(hi, lo, self.radius)
        return self._discs(hi, self._known(power)), np.sign(power)

    def _discs(self, center: Array, power: Array) -> Discs:
        return Discs(center, self.radius, power, self.first)

    def _known(self, power: Array) -> Array:
        """What is known of surfaces by the powers of their spheres: from inside of a loose one, nothing."""
        return power if self.loose is None else np.where(self.loose, np.maximum(power, 0), power)
