"""The world in camera space, in more than double precision. The eye is the origin, x is right, y up and -z ahead."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.exact import Array, differences, dot_products, square_excess, two_sum
from cltrace.plan.shapes.sphere import Seen
from cltrace.scene import PARALLEL, AnyCamera

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Space:
    """n spheres and m lights in camera space, in scene units; of times_two_to(k), in units of 2^-k scene units.

    center (n, 3) and position (m, 3): along the camera's axes, each coordinate rounded once; power (n,): |C|^2 - r^2
    for the exact offset C of the centre from the eye, rounded once, so that no rounding of centres enters it;
    power_rest (n,): what that rounding cut off; loose (n,): which surfaces only lie within their spheres, None for
    none; place (n, 3) and lamp (m, 3): centres and lights in the world.
    """

    center: Array
    radius: Array
    power: Array
    power_rest: Array
    loose: Mask | None
    place: Array
    position: Array
    lamp: Array

    @classmethod
    def of(cls, camera: AnyCamera, center: Array, radius: Array, loose: Mask | None, lights: NDArray[np.void]) -> Space:
        """center (n, 3), radius (n,), loose (n,) and lights (m,) are in the world, in scene units."""
        eye, basis = np.array(camera.position), np.array(camera.basis())
        hi, lo = differences(center, eye)
        at_hi, at_lo = two_sum(lights["position"], -eye)
        position, _ = dot_products(basis, at_hi, at_lo)
        turned, _ = dot_products(basis, hi, lo)
        excess = square_excess(hi, lo, radius)
        return cls(turned, radius, *excess, loose, center, position, lights["position"])

    def times_two_to(self, k: int) -> Space:
        """All lengths times 2^k. Nothing is rounded: a scene's numbers are within float32's range, 2^-149 to 2^128."""
        lengths = [f.name for f in fields(self) if f.name != "loose"]
        factor = {name: 2.0 ** (2 * k if name.startswith("power") else k) for name in lengths}
        return replace(self, **{name: getattr(self, name) * by for name, by in factor.items()})

    def exponent(self, lights: NDArray[np.void], vertex: Array, least: float = 0.0) -> int:
        """The k for which 2^k times the largest coordinate or radius is in [1/2, 1).

        vertex: (v, 3), corners of triangles in camera space; least: the largest one of spheres that are not here.
        """
        parts = (self.center, self.radius, self.position[lights["kind"] != PARALLEL], vertex)
        ends = (float(end) for part in parts for end in (part.max(initial=0), -part.min(initial=0)))
        return -math.frexp(max(least, *ends))[1]

    def seen_from_eye(self) -> Seen:
        """The spheres as the eye sees them."""
        return Seen(self.center, self.radius, self._known(self.power))

    def seen_along_view(self) -> Seen:
        """The spheres as parallel rays see them that start on the plane through the eye and lead along the view.

        The power is 1 where that plane is clear of a sphere, and 0 where it may cut it. Lengths are about 1.
        """
        z, r = np.abs(self.center[:, 2]), self.radius
        return Seen(self.center, r, np.where(z - r > 2.0**-20 * (z + r) + 2.0**-44, 1.0, 0.0))

    def seen_from_light(self, k: int) -> tuple[Seen, Array]:
        """The spheres as light k, at a point, sees them along the world's axes; and (n,) the exact sign of its power.

        The sign is 1 where the light is outside of a sphere, 0 where it is on it, -1 where it is inside. No camera
        changes any of it, but by the unit.
        """
        hi, lo = differences(self.place, self.lamp[k])
        power, _ = square_excess(hi, lo, self.radius)
        return Seen(hi, self.radius, self._known(power)), np.sign(power)

    def _known(self, power: Array) -> Array:
        """What is known of surfaces by the powers of their spheres: from inside of a loose one, nothing."""
        return power if self.loose is None else np.where(self.loose, np.maximum(power, 0), power)
