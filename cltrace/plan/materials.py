"""Materials as the kernel reads them, and which parts of Phong's formula they need."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import Precision, real_dtype, shade_dtype
from cltrace.plan.exact import Array
from cltrace.scene import AMBIENT, Scene


@dataclass(frozen=True)
class Materials:
    """m materials.

    packed: (m, 8) of shade_dtype(): ka La C (rgb), kd C (rgb), ks, exponent, with La the ambient light and C the
    material's colour, linear; bounce: (m, 4) of real_dtype(): reflectance, transmittance, index of refraction, 0;
    texture: (m,), the index of each one's texture in the scene, -1 for none;
    shiny: whether any has highlights; black: (m,), which ones reflect nothing of any light that is not ambient;
    brightest: the largest ks.
    """

    packed: NDArray[Any]
    bounce: NDArray[Any]
    texture: NDArray[np.int32]
    shiny: bool
    black: NDArray[np.bool_]
    brightest: float

    @classmethod
    def of(cls, scene: Scene, precision: Precision) -> Materials:
        """The materials of a scene in its ambient light."""
        m = scene.materials
        ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)
        packed = np.empty((len(m), 8))
        packed[:, 0:3] = m["ka"][:, None] * ambient * m["color"]
        packed[:, 3:6] = m["kd"][:, None] * m["color"]
        packed[:, 6], packed[:, 7] = m["ks"], m["exponent"]
        black = np.asarray((m["ks"] == 0) & ((m["kd"] == 0) | ~m["color"].any(axis=1)))
        shade = finite32(packed).astype(shade_dtype(precision))
        bounce = np.stack([m["reflectance"], m["transmittance"], m["index"], np.zeros(len(m))], axis=1)
        return cls(
            shade,
            bounce.astype(real_dtype(precision)),
            m["texture"],
            bool(m["ks"].any()),
            black,
            float(m["ks"].max(initial=0)),
        )

    def in_order(self, order: NDArray[np.int32]) -> Materials:
        """These materials, one for each index of `order`."""
        return replace(
            self,
            packed=self.packed.take(order, axis=0),
            bounce=self.bounce.take(order, axis=0),
            texture=self.texture[order],
            black=self.black[order],
        )


def used(count: int, material_of: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
    """(count,): which materials some sphere has. material_of: (n,), of the spheres."""
    mask = np.zeros(count, bool)
    mask[material_of] = True
    return mask


def finite32(value: Array) -> Array:
    """The values, with float32's largest number in place of larger ones. Products of colours may be as large; they are
    white in any picture.
    """
    return np.minimum(value, float(np.finfo(np.float32).max))
