"""Lights: which of them count, as the kernel reads them, and what each one is to the shapes and the lists."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import LIGHT_KINDS, Precision, dtype_of, shade_dtype
from cltrace.plan.accel.grids import CellGrid
from cltrace.plan.materials import finite32
from cltrace.plan.rounding import Array, Mask
from cltrace.scene import AMBIENT, PARALLEL, AnyCamera

# The number of the only kind that is not at a point.
ALONG = LIGHT_KINDS.index("parallel")


@dataclass(frozen=True)
class Lamp:
    """A light as one camera has it.

    record: of the scene; packed: of pack_lights().
    """

    record: np.void
    packed: np.void

    @property
    def at_point(self) -> bool:
        """Whether it is at a point, and not infinitely far away."""
        return bool(kinds(self.record) != ALONG)

    @property
    def place(self) -> Array:
        """(3,): the point, in the world, in scene units."""
        return np.asarray(self.record["position"])

    @property
    def axes(self) -> Array:
        """(3, 3): the two across a parallel light and the one towards it, in camera space."""
        return np.array([self.packed[name][:3] for name in ("axis", "across", "position")], np.float64)

    @property
    def towards(self) -> Array:
        """(3,): the direction to a parallel light in the world, exactly."""
        return np.asarray(-self.record["direction"])


class Move(NamedTuple):
    """From the camera of which the lists of parallel lights were made to another one.

    turn: (3, 3), leads from its axes to the other one's; shift: (3,), the way to the other one, along its axes, in the
    float buffers' unit.
    """

    turn: Array
    shift: Array

    @classmethod
    def of(cls, before: AnyCamera, camera: AnyCamera, unit: float) -> Move:
        basis, way = np.array(before.basis()), np.array(camera.position) - np.array(before.position)
        return cls(np.array(camera.basis()) @ basis.T, basis @ way * unit)

    def lights(self, packed: NDArray[np.void], before: NDArray[np.void]) -> NDArray[np.void]:
        """Records of pack_lights(), of which parallel ones count from where those of `before` do, the first ones."""
        along, packed = np.flatnonzero(~are_at_points(before["color"][:, 3])), packed.copy()
        for name in ("axis", "across"):
            packed[name][along, :3] = before[name][along, :3] @ self.turn.T
        for name in ("axis", "across", "position"):
            packed[name][along, 3] = before[name][along, :3] @ self.shift
        return packed

    def grid(self, grid: CellGrid) -> CellGrid:
        """The same grid of a parallel light."""
        return replace(grid, axes=grid.axes @ self.turn.T, middle=grid.middle - grid.axes[:2] @ self.shift)


def useful_lights(lights: NDArray[np.void], reflected: bool, all_of_them: bool) -> NDArray[np.void]:
    """The lights of a scene that can add to a colour, (m,) in the order of LIGHT_KINDS.

    reflected: whether some surface reflects any. Without all_of_them, black lights are left out, and all of them where
    no surface does.
    """
    lights = lights[lights["kind"] != AMBIENT]
    useful = lights[lights["color"].any(axis=1) & reflected | all_of_them]
    return np.asarray(useful[np.argsort(useful["kind"], kind="stable")])


def kinds(lights: NDArray[np.void] | np.void) -> NDArray[np.integer[Any]]:
    """The numbers that abi's LIGHT_KINDS gives to the kinds of lights, none of which is ambient."""
    return np.asarray(lights["kind"] - PARALLEL)


def are_at_points(kinds: NDArray[Any]) -> Mask:
    """Which lights are at points, and not infinitely far away. kinds: their numbers in LIGHT_KINDS."""
    return np.asarray(kinds != ALONG)


def pack_lights(
    lights: NDArray[np.void], position: Array, basis: Array, precision: Precision, brightest: float
) -> NDArray[np.void]:
    """(m,) records of abi's `Light`.

    position: (m, 3), in camera space; basis: (3, 3), the camera's axes in the world; brightest: the largest ks of any
    material.
    """
    out = np.zeros(len(lights), dtype_of("Light", precision))
    out["color"][:, :3], out["color"][:, 3] = finite32(lights["color"]), kinds(lights)
    dim_highlights(out, lights, precision, brightest)
    for record, kind, light, place in zip(out, kinds(lights).tolist(), lights, position, strict=True):
        record["position"][:3] = place
        if LIGHT_KINDS[kind] == "parallel":
            towards = -_direction(light, basis)
            # Any two axes across do. The first one is made from the coordinate axis that is furthest from the light's
            # direction, where the cross product loses least.
            axis = _unit(np.cross(np.eye(3)[np.argmin(np.abs(towards))], towards)[None])[0]
            record["position"][:3], record["axis"][:3] = towards, axis
            record["across"][:3] = np.cross(towards, axis)
        elif LIGHT_KINDS[kind] != "point":
            record["axis"][:3] = _direction(light, basis)
        if LIGHT_KINDS[kind] == "spot":
            alpha1, alpha2 = math.radians(light["alpha1"]), math.radians(light["alpha2"])
            record["axis"][3] = math.cos(alpha2)
            record["cone"][:2] = alpha1, 1 / (alpha2 - alpha1) if alpha2 > alpha1 else 0
    return out


def dim_highlights(packed: NDArray[np.void], lights: NDArray[np.void], precision: Precision, brightest: float) -> None:
    """Sets which highlights of lights (m,) are too faint to be seen. packed, brightest: as of pack_lights()."""
    # The logarithm of the lobe that makes a highlight of this part of a byte's level: fainter ones are left out.
    level = 2.0**-20 if shade_dtype(precision).itemsize == 4 else 2.0**-40
    color = finite32(lights["color"])
    packed["cone"][:, 2] = np.log(level / (255 * np.maximum(color.max(axis=1, initial=0) * brightest, 1)))


def lamp_places(lights: NDArray[np.void], middle: Array, exponent: int | None) -> Array:
    """(m, 3): abi's `lamp`. middle, exponent: of the scene, and of the float buffers where corners are in that unit."""
    place, towards = lights["position"], -lights["direction"]
    if exponent is not None:
        place = np.ldexp(place - middle, exponent)
        towards = towards / np.maximum(np.abs(towards).max(axis=1, keepdims=True, initial=0), 2.0**-200)
    return np.where(are_at_points(kinds(lights))[:, None], place, towards)


def _direction(light: np.void, basis: Array) -> Array:
    """(3,): the unit vector along which it shines, in camera space."""
    return np.asarray(_unit((light["direction"] / np.abs(light["direction"]).max(initial=1e-300))[None] @ basis.T)[0])


def _unit(v: Array) -> Array:
    """Vectors (n, 3) scaled to length 1. No square overflows, however long they are."""
    scaled = v / np.abs(v).max(axis=1, keepdims=True)
    return np.asarray(scaled / np.sqrt((scaled * scaled).sum(axis=1, keepdims=True)))
