"""Lights as the kernel reads them, and the spheres as each light sees them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import Precision, dtype_of, shade_dtype
from cltrace.plan.exact import Array, along, rotated
from cltrace.plan.materials import finite32
from cltrace.plan.shapes.sphere import Seen, disc_filter, filter_constant
from cltrace.plan.space import Space
from cltrace.scene import AMBIENT, PARALLEL, POINT, SPOT


def useful_lights(lights: NDArray[np.void], reflected: bool, all_of_them: bool) -> NDArray[np.void]:
    """The lights of a scene that can add to a colour, (m,) in the order parallel, point, spot.

    reflected: whether some surface reflects any. Without all_of_them, black lights are left out, and all of them where
    no surface does.
    """
    lights = lights[lights["kind"] != AMBIENT]
    useful = lights[lights["color"].any(axis=1) & reflected | all_of_them]
    return np.asarray(useful[np.argsort(useful["kind"], kind="stable")])


def counts(lights: NDArray[np.void]) -> tuple[int, int, int]:
    """How many of the lights are parallel, point and spot lights."""
    parallel, point, spot = (int((lights["kind"] == kind).sum()) for kind in (PARALLEL, POINT, SPOT))
    return parallel, point, spot


def pack_lights(
    lights: NDArray[np.void], position: Array, basis: Array, precision: Precision, brightest: float
) -> NDArray[np.void]:
    """(m,) records of abi's `Light`.

    position: (m, 3), in camera space; basis: (3, 3), the camera's axes in the world; brightest: the largest ks of any
    material.
    """
    out = np.zeros(len(lights), dtype_of("Light", precision))
    out["color"][:, :3] = finite32(lights["color"])
    dim_highlights(out, lights, precision, brightest)
    for k, light in enumerate(lights):
        direction = _unit((light["direction"] / np.abs(light["direction"]).max(initial=1e-300))[None] @ basis.T)[0]
        if light["kind"] == PARALLEL:
            towards = -direction
            # Any two axes across do. The first one is made from the coordinate axis that is furthest from the light's
            # direction, where the cross product loses least.
            helper = np.eye(3)[np.argmin(np.abs(towards))]
            axis = _unit(np.cross(helper, towards)[None])[0]
            out["position"][k, :3] = towards
            out["axis"][k, :3] = axis
            out["across"][k, :3] = np.cross(towards, axis)
        else:
            out["position"][k, :3] = position[k]
        if light["kind"] == SPOT:
            alpha1, alpha2 = math.radians(light["alpha1"]), math.radians(light["alpha2"])
            out["axis"][k] = (*direction, math.cos(alpha2))
            out["cone"][k, :2] = alpha1, 1 / (alpha2 - alpha1) if alpha2 > alpha1 else 0
    return out


def dim_highlights(packed: NDArray[np.void], lights: NDArray[np.void], precision: Precision, brightest: float) -> None:
    """Sets which highlights of lights (m,) are too faint to be seen. packed, brightest: as of pack_lights()."""
    packed["cone"][:, 2] = -np.inf
    if shade_dtype(precision).itemsize == 4:
        # The logarithm of the lobe that makes a highlight of 2^-20 of a byte's level: fainter ones are left out. Not so
        # in double, which follows the reference's formula throughout.
        color = finite32(lights["color"])
        packed["cone"][:, 2] = -np.log(255 * 2.0**20 * np.maximum(color.max(axis=1, initial=0) * brightest, 1))


def _unit(v: Array) -> Array:
    """Vectors (n, 3) scaled to length 1. No square overflows, however long they are."""
    scaled = v / np.abs(v).max(axis=1, keepdims=True)
    return np.asarray(scaled / np.sqrt((scaled * scaled).sum(axis=1, keepdims=True)))


@dataclass(frozen=True)
class LightView:
    """The n spheres as one light sees them.

    axes: (3, 3), the two across a parallel light and the one towards it, None for a light at a point; basis: (3, 3),
    the camera's axes in the world; seen: from the light along the world's axes, or from the eye along the camera's for
    a parallel one, lengths in the float buffers' unit; side: (n,) int8, abi's light_side.
    """

    axes: Array | None
    basis: Array
    seen: Seen
    side: NDArray[np.int8]


@dataclass(frozen=True)
class LightViews:
    """The n spheres as each of m lights sees them. filter: (m, n, 4), abi's light_filter; side: (m, n)."""

    views: list[LightView]
    filter: NDArray[np.float32]
    side: NDArray[np.int8]

    @classmethod
    def of(cls, lights: NDArray[np.void], packed: NDArray[np.void], space: Space, basis: Array) -> LightViews:
        """The views of the lights of a Space that is in the float buffers' unit.

        lights: (m,), of useful_lights(); packed: the same lights, of pack_lights(); basis: (3, 3), the camera's axes in
        the world.
        """
        n, m = len(space.radius), len(lights)
        filters, sides, views = np.zeros((m, n, 4), np.float32), np.ones((m, n), np.int8), []
        for k, (filter_, side) in enumerate(zip(filters, sides, strict=True)):
            axes = None
            if lights["kind"][k] == PARALLEL:
                axes = np.array([packed[name][k, :3] for name in ("axis", "across", "position")], np.float64)
                seen = space.seen_from_eye()
                u, v = along(axes[:2], seen.center)
                filter_[:, 0], filter_[:, 1], filter_[:, 2] = u, v, disc_filter(u, v, space.radius)
            else:
                seen, side[:] = space.seen_from_light(k)
                filter_[:, :3], filter_[:, 3] = -rotated(basis, seen.center), filter_constant(seen)
            views.append(LightView(axes, basis, seen, side))
        return cls(views, filters, sides)
