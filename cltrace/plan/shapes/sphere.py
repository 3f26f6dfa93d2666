"""Spheres and ellipsoids, in camera space, in more than double precision. The kernel's filters of them are here, too.

In camera space the eye is the origin, x is right, y up and -z ahead.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import inverses, two_sum, whole_inverse
from cltrace.plan.abi import CONSTANTS, dtype_of, real_dtype
from cltrace.plan.accel.silhouettes import FINE_SLACK, Discs, Silhouettes
from cltrace.plan.accel.tree import NO_PATHS, Paths
from cltrace.plan.lights import Lamp
from cltrace.plan.order import MANY, gathered, repeated, spatial_order, step
from cltrace.plan.request import Request
from cltrace.plan.rounding import (
    Array,
    Ints,
    Mask,
    U,
    along,
    differences,
    dot_products,
    rotated,
    rounded_down,
    rounded_up,
    square_excess,
    squared_length,
)
from cltrace.plan.shapes.shape import Arrays, InView, ShapePacking, Sights, share
from cltrace.scene import OTHER_FIELDS, AnyCamera, Scene


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
class CameraSpace:
    """n spheres in camera space, in scene units; of times_two_to(k), in units of 2^-k scene units.

    center (n, 3): along the camera's axes, each coordinate rounded once; power (n,): |C|^2 - r^2 for the exact offset C
    of the centre from the eye, rounded once, so that no rounding of centres enters it; power_rest (n,): what that
    rounding cut off; loose (n,): which surfaces only lie within their spheres, None for none; place (n, 3): centres in
    the world.
    """

    center: Array
    radius: Array
    power: Array
    power_rest: Array
    loose: Mask | None
    place: Array

    @classmethod
    def of(cls, camera: AnyCamera, center: Array, radius: Array, loose: Mask | None = None) -> CameraSpace:
        """center (n, 3), radius (n,) and loose (n,) are in the world, in scene units."""
        eye, basis = np.array(camera.position), np.array(camera.basis())
        hi, lo = differences(center, eye)
        turned, _ = dot_products(basis, hi, lo)
        power, rest = square_excess(hi, lo, radius)
        return cls(turned, radius, power=power, power_rest=rest, loose=loose, place=center)

    def times_two_to(self, k: int) -> CameraSpace:
        """All lengths times 2^k. Nothing is rounded: a scene's numbers are within float32's range, 2^-149 to 2^128."""
        lengths = [f.name for f in fields(self) if f.name != "loose"]
        factor = {name: 2.0 ** (2 * k if name.startswith("power") else k) for name in lengths}
        return replace(self, **{name: getattr(self, name) * by for name, by in factor.items()})

    def seen_from_eye(self) -> Discs:
        """The spheres as the eye sees them."""
        return Discs(self.center, self.radius, self._known(self.power))

    def seen_along_view(self) -> Discs:
        """The spheres as parallel rays see them that start on the plane through the eye and lead along the view.

        The power is 1 where that plane is clear of a sphere, and 0 where it may cut it. Lengths are about 1.
        """
        z, r = np.abs(self.center[:, 2]), self.radius
        return Discs(self.center, r, np.where(z - r > 2.0**-20 * (z + r) + 2.0**-44, 1.0, 0.0))

    def seen_from(self, point: Array) -> tuple[Discs, Array]:
        """The spheres as a point of the world sees them along the world's axes; and (n,) the exact sign of its power.

        The sign is 1 where the point is outside of a sphere, 0 where it is on it, -1 where it is inside. No camera
        changes any of it, but by the unit.
        """
        hi, lo = differences(self.place, point)
        power, _ = square_excess(hi, lo, self.radius)
        return Discs(hi, self.radius, self._known(power)), np.sign(power)

    def _known(self, power: Array) -> Array:
        """What is known of surfaces by the powers of their spheres: from inside of a loose one, nothing."""
        return power if self.loose is None else np.where(self.loose, np.maximum(power, 0), power)


# Singular values are right to far less than this.
LOOSE = 2.0**-40


@dataclass(frozen=True)
class Maps:
    """The maps that make ellipsoids of n spheres.

    of_sphere: (n,), index of a sphere's map, 0 for none; to_object: (k, 3, 3), K of the scene, the first one is 1;
    to_world: (k, 3, 3), the inverses, each number rounded once; rest: (k, 3, 3), what that cut off; longest: (k,), no
    less than the longest half axis of a sphere of radius 1; shortest: (k,), no more than the shortest one.
    """

    of_sphere: NDArray[np.int32]
    to_object: Array
    to_world: Array
    rest: Array
    longest: Array
    shortest: Array

    @classmethod
    def of(cls, of_sphere: NDArray[np.integer[Any]], to_object: Array) -> Maps:
        """of_sphere, to_object: of the scene, with -1 for no map."""
        K = np.concatenate([np.eye(3)[None], to_object])
        L = inverses(K)
        rest = np.array([_rest(k, hi) for k, hi in zip(K.tolist(), L.tolist(), strict=True)])
        longest = np.linalg.norm(L, 2, axis=(1, 2)) * (1 + LOOSE)
        shortest = 1 / (np.linalg.norm(K, 2, axis=(1, 2)) * (1 + LOOSE))
        longest[0] = shortest[0] = 1
        return cls(
            (of_sphere + 1).astype(np.int32), to_object=K, to_world=L, rest=rest, longest=longest, shortest=shortest
        )

    def packed(self, basis: Array, real: np.dtype[Any]) -> NDArray[np.void]:
        """(k,) records of abi's `Map`. basis: (3, 3), the camera's axes in the world."""
        out = np.zeros(len(self.to_object), dtype_of("Map", "single" if real.itemsize == 4 else "accurate"))
        views = {"to": self.to_object, "from": self.to_world, "rest": self.rest, "camera": self.to_object @ basis.T}
        for name, matrices in views.items():
            for i, axis in enumerate("xyz"):
                out[f"{name}_{axis}"][:, :3] = matrices[:, i]
        out["to_x"][:, 3], out["from_x"][:, 3] = _sizes(self.to_object), _sizes(self.to_world)
        return out

    def sides(self, center: Array, radius: Array, point: Array) -> NDArray[np.int8]:
        """(n,): whether a point is outside of each ellipsoid, 1, on it, 0, or inside, -1; exactly. Of spheres: 0.

        center (n, 3), radius (n,), point (3,): in the world, in scene units.
        """
        out = np.zeros(len(radius), np.int8)
        which = np.flatnonzero(self.of_sphere)
        K = self.to_object[self.of_sphere[which]]
        f, _ = two_sum(center[which], -point)
        F = (K * f[:, None]).sum(axis=2)
        # The difference rounds by 2^-53 of itself and a product with K by some more, so each coordinate is off by less
        # than 2^-50 of the size that it has in K's magnitudes.
        size = (np.abs(K) * np.abs(f)[:, None]).sum(axis=2)
        squares, rr = (F * F).sum(axis=1), radius[which] ** 2
        excess, error = squares - rr, 2.0**-47 * (size * size).sum(axis=1) + 2.0**-50 * rr
        out[which] = np.sign(excess)
        for i in np.flatnonzero(~(np.abs(excess) > error)).tolist():
            out[which[i]] = _exact_side(K[i], center[which[i]], radius[which[i]], point)
        return out


def _sizes(matrices: Array) -> Array:
    """The sums of the magnitudes, from the first number to the last, as the reference adds them up."""
    total = np.zeros(len(matrices))
    for column in np.abs(matrices).reshape(-1, 9).T:
        total = total + column
    return total


def _rest(rows: list[list[float]], rounded: list[list[float]]) -> list[list[float]]:
    """What is cut off of the inverse of a matrix where each of its numbers is rounded."""
    numerators, determinant = whole_inverse(rows)

    def cut(x: int, hi: float) -> float:
        p, q = hi.as_integer_ratio()
        return (x * q - p * determinant) / (determinant * q)

    return [[cut(x, hi) for x, hi in zip(*row, strict=True)] for row in zip(numerators, rounded, strict=True)]


def _exact_side(K: Array, center: Array, radius: float, point: Array) -> int:
    f = [Fraction(a) - Fraction(b) for a, b in zip(center.tolist(), point.tolist(), strict=True)]
    F = [sum((Fraction(k) * x for k, x in zip(row, f, strict=True)), Fraction(0)) for row in K.tolist()]
    excess = sum((x * x for x in F), Fraction(0)) - Fraction(float(radius)) ** 2
    return (excess > 0) - (excess < 0)


# Up to so many times as far as at first may neighbours in an order be from each other before it is made anew.
WORSE = 2.0


@dataclass(frozen=True, eq=False)
class SpherePacking(ShapePacking):
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
    def of(cls, scene: Scene, request: Request, before: tuple[Scene, SpherePacking] | None) -> SpherePacking:
        columns = scene.columns
        row, far, by_place, center, radius = _places(scene, request, before)
        if before and share(before[0], scene, "columns.to_object", "to_object", *OTHER_FIELDS):
            known = before[1]
            if known.center is center and known.radius is radius:
                return known
        number = scene.sphere_numbers.take(row) if any(map(len, scene.others)) else row
        shape = columns.to_object.take(row) if columns.to_object.ndim else columns.to_object
        again = np.zeros(len(row), bool)  # of equal ones each may count, as planes may clip them
        if not len(scene.planes) and "hidden" not in request.keep:
            again = repeated(center, radius, shape=shape, number=number, by_place=by_place)
        maps = Maps.of(shape, scene.to_object) if (shape >= 0).any() else None
        reach = radius * maps.longest[maps.of_sphere] if maps else radius
        flags = ("WITH_SPHERES",) * bool(len(row)) + ("WITH_ELLIPSOIDS", "WITH_SHAPES") * bool(maps)
        # Each is between two spheres.
        core = radius * maps.shortest[maps.of_sphere] if maps else radius
        tree = {"center": center, "outer": reach, "inner": core, "member": ~again}
        of: dict[str, Any] = {"step": far, "center": center, "radius": radius, "maps": maps, "reach": reach}
        return cls(row, number, flags, tree, leave=maps is not None, **of, again=again)

    @property
    def left_out(self) -> int:
        return int(self.again.sum())

    @property
    def visible(self) -> Mask:
        return ~self.again

    def material(self, scene: Scene) -> Ints:
        of = scene.columns.material
        return self.row if of is None else gathered(of, self.row, (len(self.row),), np.int32)

    def solid_of(self, scene: Scene) -> Ints:
        return np.zeros(len(self.row), np.int32)

    @property
    def sizes(self) -> Array:
        stretched = (self.maps.longest, 1 / self.maps.shortest) if self.maps else ()
        return np.concatenate([self.radius, *map(np.ravel, stretched)])

    def values(self, first: int) -> dict[str, Any]:
        return {"count": len(self.radius), "maps": len(self.maps.longest) if self.maps else 0}

    def packed(self, real: np.dtype[Any], exponent: int | None, basis: Array, paths: Paths) -> Arrays:
        arrays: Arrays = {"place": np.zeros((0, 4), real), "map_of": np.zeros(0, np.int32)}
        if paths is not NO_PATHS:
            radius = self.radius if exponent is None else np.ldexp(self.radius, exponent)
            center = paths.moved(self.center, exponent)
            arrays["place"] = np.concatenate([center, radius[:, None]], axis=1).astype(real)
        if self.maps:
            return arrays | {"map_of": self.maps.of_sphere, "map": self.maps.packed(basis, real)}
        return arrays | {"map": np.zeros(0, dtype_of("Map", "single" if real.itemsize == 4 else "accurate"))}

    def in_view(self, camera: AnyCamera, first: int) -> SpheresInView:
        return SpheresInView(self, camera, first)


def _places(
    scene: Scene, request: Request, before: tuple[Scene, SpherePacking] | None
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


class SpheresInView(InView):
    """Spheres as a camera sees them, the first of all surfaces."""

    shape: SpherePacking

    @cached_property
    def space(self) -> CameraSpace:
        """In scene units."""
        spheres = self.shape
        stretched = spheres.maps.of_sphere > 0 if spheres.maps else None
        return CameraSpace.of(self.camera, spheres.center, spheres.reach, stretched)

    def lengths(self) -> Sequence[Array]:
        return self.space.center, self.space.radius

    def see(self, k: int, lights: list[Lamp], request: Request) -> Sights:
        small, n, m = self.space.times_two_to(k), len(self.shape.radius), len(lights)
        eye = small.seen_along_view() if self.camera.parallel else small.seen_from_eye()
        filters, sides = np.zeros((m, n, 4), np.float32), np.ones((m, n), np.int8)
        seen: list[Silhouettes] = [
            self.from_light(light, small, 2.0**k, row, side)
            for light, row, side in zip(lights, filters, sides, strict=True)
        ]
        arrays = self._from_eye(small, k, real_dtype(request.precision))
        lit: Arrays = {"light_filter": filters.reshape(-1, 4), "light_side": sides.reshape(-1)}

        return Sights(arrays, eye=eye, lights=seen, lit=lit)

    def from_light(self, light: Lamp, small: CameraSpace, unit: float, filter_: Any, side: NDArray[np.int8]) -> Discs:
        """What a light sees. small: in 1 / unit scene units; filter_: (n, 4), abi's light_filter; side: (n,), as seen
        from infinitely far away, all surfaces are outside."""
        if not light.at_point:
            seen = small.seen_from_eye()
            u, v = along(light.axes[:2], seen.center)
            filter_[:, 0], filter_[:, 1], filter_[:, 2] = u, v, disc_filter(u, v, small.radius)
            return seen
        in_world, side[:] = small.seen_from(light.place * unit)
        seen = replace(in_world, center=rotated(np.array(self.camera.basis()), in_world.center))
        filter_[:, :3], filter_[:, 3] = -seen.center, filter_constant(in_world)
        if maps := self.shape.maps:
            exact = maps.sides(self.shape.center, self.shape.radius, light.place)
            side[:] = np.where(maps.of_sphere > 0, exact, side)
        return seen

    def _from_eye(self, small: CameraSpace, k: int, real: np.dtype[Any]) -> Arrays:
        """The buffers of spheres as the eye sees them. small: in 2^-k scene units."""
        eye_filter = np.empty((len(small.radius), 4), np.float32)
        if self.camera.parallel:
            u, v = small.center[:, 0], small.center[:, 1]
            eye_filter[:, 0], eye_filter[:, 1], eye_filter[:, 2] = u, v, disc_filter(u, v, small.radius, FINE_SLACK)
            eye_filter[:, 3] = 0
        else:
            eye_filter[:, :3], eye_filter[:, 3] = small.center, filter_constant(small.seen_from_eye())
        world, space = self.shape, self.space
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
    """(n,): the r'^2 of sphere_filter_leaves in kernels/shapes/sphere/surface.cl, where it is derived.

    u, v, radius: (n,), the coordinates of the centres across a parallel light, and the radii; loose: what is to be
    added to these.
    """
    reach = radius + CONSTANTS["DISC_ROUNDINGS"] * U * (np.abs(u) + np.abs(v) + radius) + loose
    return rounded_up(reach * reach)
