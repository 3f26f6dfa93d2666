"""Spheres and ellipsoids: a row of SHAPES. The kernel's filters of them are here, too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS, dtype_of, real_dtype
from cltrace.plan.accel.silhouettes import FINE_SLACK, Discs, Silhouettes
from cltrace.plan.culling import hidden, repeated
from cltrace.plan.lights import AtPoint, Lamp, Parallel
from cltrace.plan.order import MANY, gathered, spatial_order, step
from cltrace.plan.paths import Paths
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Ints, Mask, U, along, rotated, rounded_down, rounded_up, squared_length
from cltrace.plan.shapes.ellipsoid import Maps
from cltrace.plan.shapes.shape import Arrays, InView, Shape, Sights, share
from cltrace.plan.space import Space
from cltrace.scene import OTHER_FIELDS, AnyCamera, Scene

# Up to so many times as far as at first may neighbours in an order be from each other before it is made anew.
WORSE = 2.0


@dataclass(frozen=True, eq=False)
class Spheres(Shape):
    """n spheres and ellipsoids: a Shape. Many are sorted by place.

    step: of their order when it was made, see order.step(); center: (n, 3) float64, and radius: (n,) float64, in the
    world, in scene units; maps: what makes ellipsoids of some, None if there are none; reach: (n,) float64, no less
    than how far a surface is from its centre, which of a sphere is the radius; again: (n,), whether it is equal to one
    with a lower number.
    """

    step: float
    center: Array
    radius: Array
    maps: Maps | None
    reach: Array
    again: Mask
    words: ClassVar[str] = "spheres"

    @classmethod
    def of(cls, scene: Scene, request: Request, before: tuple[Scene, Spheres] | None) -> Spheres:
        columns = scene.columns
        row, far, by_place, center, radius = _places(scene, request, before)
        if before and share(before[0], scene, "columns.to_object", "to_object", *OTHER_FIELDS):
            known = before[1]
            if known.center is center and known.radius is radius:
                return known
        number = scene.sphere_numbers.take(row) if scene.mixed else row
        shape = columns.to_object.take(row) if columns.to_object.ndim else columns.to_object
        again = repeated(center, radius, shape=shape, number=number, by_place=by_place)
        maps = Maps.of(shape, scene.to_object) if (shape >= 0).any() else None
        reach = radius * maps.longest[maps.of_sphere] if maps else radius
        flags = {"WITH_ELLIPSOIDS": "shape", "WITH_SHAPES": "shape"} if maps else {}
        # Each is between two spheres.
        core = radius * maps.shortest[maps.of_sphere] if maps else radius
        tree = {"center": center, "outer": reach, "inner": core, "member": ~again}
        of: dict[str, Any] = {"step": far, "center": center, "radius": radius, "maps": maps, "reach": reach}
        return cls(row, number, flags, tree, leave=maps is not None, **of, again=again)

    def material(self, scene: Scene) -> Ints:
        of = scene.columns.material
        return self.row if of is None else gathered(of, self.row, (len(self.row),), np.int32)

    def values(self, first: int) -> dict[str, Any]:
        return {"count": len(self.radius)}

    def packed(self, real: np.dtype[Any], exponent: int | None, basis: Array, paths: Paths | None) -> Arrays:
        arrays: Arrays = {"place": np.zeros((0, 4), real), "map_of": np.zeros(0, np.int32)}
        if paths:
            arrays["place"] = paths.places(self.center, self.radius, exponent).astype(real)
        if self.maps:
            return arrays | {"map_of": self.maps.of_sphere, "map": self.maps.packed(basis, real)}
        return arrays | {"map": np.zeros(0, dtype_of("Map", "single" if real.itemsize == 4 else "accurate"))}

    def in_view(self, camera: AnyCamera, first: int) -> SpheresInView:
        return SpheresInView(self, camera, first)


def _places(
    scene: Scene, request: Request, before: tuple[Scene, Spheres] | None
) -> tuple[Ints, float, bool, Array, Array]:
    """row and step of Spheres, whether neighbours are near each other, center and radius. The rest is of Shape.of()."""
    columns = scene.columns
    n = len(columns)
    by_place = n >= MANY and "order" not in request.keep
    center, row, far = None, None, 0.0
    old, known = (before[0].columns, before[1]) if before and len(before[0].columns) == n else (None, None)
    if old and known:
        row, far = known.row, known.step
        center = known.center if old.center is columns.center else gathered(columns.center, row, (n, 3), np.float64)
        if by_place and center is not known.center and step(center) > WORSE * far:
            row = None
    if row is None or center is None:
        row = spatial_order(columns.center) if by_place else np.arange(n, dtype=np.int32)
        center = gathered(columns.center, row, (n, 3), np.float64)
        far = step(center) if by_place else 0.0
    if old and known and old.radius is columns.radius and row is known.row:
        return row, far, by_place, center, known.radius
    return row, far, by_place, center, gathered(columns.radius, row, (n,), np.float64)


@dataclass
class SpheresInView(InView):
    """Spheres as a camera sees them: InView. first: the index of the first one as a surface."""

    spheres: Spheres
    camera: AnyCamera
    first: int

    @cached_property
    def space(self) -> Space:
        """In scene units."""
        spheres = self.spheres
        stretched = spheres.maps.of_sphere > 0 if spheres.maps else None
        return Space.of(self.camera, spheres.center, spheres.reach, stretched, self.first)

    def lengths(self) -> Sequence[Array]:
        return self.space.center, self.space.radius

    def see(self, k: int, lights: list[Lamp], request: Request) -> Sights:
        small, n, m = self.space.times_two_to(k), len(self.spheres.radius), len(lights)
        eye = small.seen_along_view() if self.camera.parallel else small.seen_from_eye()
        filters, sides = np.zeros((m, n, 4), np.float32), np.ones((m, n), np.int8)
        seen: list[Silhouettes] = [
            light.look(self, small, 2.0**k, *out) for light, *out in zip(lights, filters, sides, strict=True)
        ]
        arrays = self._from_eye(small, k, real_dtype(request.precision))
        lit: Arrays = {"light_filter": filters.reshape(-1, 4), "light_side": sides.reshape(-1)}

        def visible(slack: float, opaque: Mask) -> Mask:
            outside = (eye.power > 0) & np.all(sides > 0, axis=0) & opaque
            if self.spheres.maps:
                outside &= self.spheres.maps.of_sphere == 0
            return np.asarray(~(self.spheres.again | hidden(small.place, small.radius, outside, slack)))

        return Sights(arrays, eye=eye, lights=seen, visible=visible, inside=eye.power <= 0, lit=lit)

    def from_point(self, light: AtPoint, small: Space, unit: float, filter_: Any, side: NDArray[np.int8]) -> Discs:
        """What a light sees. small: in 1 / unit scene units; filter_: (n, 4), abi's light_filter; side: (n,)."""
        in_world, side[:] = small.seen_from(light.place * unit)
        seen = replace(in_world, center=rotated(light.basis, in_world.center))
        filter_[:, :3], filter_[:, 3] = -seen.center, filter_constant(in_world)
        if maps := self.spheres.maps:
            exact = maps.sides(self.spheres.center, self.spheres.radius, light.place)
            side[:] = np.where(maps.of_sphere > 0, exact, side)
        return seen

    def along(self, light: Parallel, small: Space, unit: float, filter_: Any, side: NDArray[np.int8]) -> Discs:
        """The same of a parallel light. Seen from infinitely far away, all surfaces are outside."""
        seen = small.seen_from_eye()
        u, v = along(light.axes[:2], seen.center)
        filter_[:, 0], filter_[:, 1], filter_[:, 2] = u, v, disc_filter(u, v, small.radius)
        return seen

    def _from_eye(self, small: Space, k: int, real: np.dtype[Any]) -> Arrays:
        """The buffers of spheres as the eye sees them. small: in 2^-k scene units."""
        eye_filter = np.empty((len(small.radius), 4), np.float32)
        if self.camera.parallel:
            u, v = small.center[:, 0], small.center[:, 1]
            eye_filter[:, 0], eye_filter[:, 1], eye_filter[:, 2] = u, v, disc_filter(u, v, small.radius, FINE_SLACK)
            eye_filter[:, 3] = 0
        else:
            eye_filter[:, :3], eye_filter[:, 3] = small.center, filter_constant(small.seen_from_eye())
        world, space = self.spheres, self.space
        if real.itemsize == 4:
            # The reciprocal of a radius leaves float32's range only where the radius all but vanishes there: such a
            # sphere is never hit.
            exact, radius, largest = small, np.ldexp(world.radius, k), float(np.finfo(np.float32).max)
            in_world = np.zeros((0, 4), real)
        else:
            # By these a ray from the eye is decided exactly.
            exact, radius, largest = space, world.radius, np.inf
            in_world = np.concatenate([world.center, space.power_rest[:, None]], axis=1)
        return {
            "center_radius": np.concatenate([exact.center, radius[:, None]], axis=1).astype(real),
            "power": np.stack([exact.power, np.minimum(1 / radius, largest)], axis=1).astype(real),
            "world": in_world,
            "eye_filter": eye_filter,
        }


def filter_constant(discs: Discs) -> NDArray[np.float32]:
    """(n,): the c' of sphere_may_meet in kernels/shapes/sphere/sphere.cl, where it is derived."""
    c = discs.power
    wide = CONSTANTS["FILTER_ROUNDINGS"] * U * (squared_length(discs.center) + np.abs(c))
    bound = c - wide - 2.0**-100
    return rounded_down(np.where(bound > 0, bound, -np.inf))


def disc_filter(u: Array, v: Array, radius: Array, loose: float = 2.0**-60) -> NDArray[np.float32]:
    """(n,): the r'^2 of sphere_filter_leaves in kernels/shapes/sphere/stops.cl, where it is derived.

    u, v, radius: (n,), the coordinates of the centres across a parallel light, and the radii; loose: what is to be
    added to these.
    """
    reach = radius + CONSTANTS["DISC_ROUNDINGS"] * U * (np.abs(u) + np.abs(v) + radius) + loose
    return rounded_up(reach * reach)
