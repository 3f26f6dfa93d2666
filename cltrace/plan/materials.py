"""Materials as the kernel reads them, and which parts of Phong's formula they need."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import BLOCK, blockwise, empty
from cltrace.plan.abi import real_dtype, shade_dtype
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Mask
from cltrace.scene import AMBIENT, Scene

# Of a material: how much of the light goes on, mirrored and refracted.
GO_ON = ("reflectance", "transmittance")


@dataclass(frozen=True)
class Materials:
    """m materials.

    packed: (m, 8) of shade_dtype(): ka La C (rgb), kd C (rgb), ks, exponent, with La the ambient light and C the
    material's colour, linear; bounce: (m, 4) of real_dtype(): reflectance, transmittance, index of refraction, 0; empty
    where nothing mirrors or is transparent; texture: (m,), the index of each one's texture in the scene, -1 for none;
    empty where there are none; shiny: whether any has highlights; black: (m,), which ones reflect nothing of any light
    that is not ambient, or None if all of them reflect; brightest: the largest ks.
    """

    packed: NDArray[Any]
    bounce: NDArray[Any]
    texture: NDArray[np.int32]
    shiny: bool
    black: Mask | None
    brightest: float

    @classmethod
    def of(cls, scene: Scene, request: Request, which: NDArray[np.int32] | None) -> Materials:
        """Materials of a scene in its ambient light. which: (m,), their indices in the scene, None for all of them."""
        columns, precision = scene.columns, request.precision
        shade, m = columns.every_shade(), columns.materials_count if which is None else len(which)
        ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)

        def some(name: str, rows: slice) -> Array:
            column = shade[name]
            if column.ndim == (name == "color"):
                return np.asarray(column, np.float64)
            return np.asarray(column[rows] if which is None else column.take(which[rows], axis=0), np.float64)

        packed = empty((m, 8), shade_dtype(precision))

        def pack(rows: slice) -> None:
            ka, kd, ks, exponent, color = (some(name, rows) for name in ("ka", "kd", "ks", "exponent", "color"))
            # Column by column: numpy's loops over the three parts of each colour would take twice as long.
            for k in range(3):
                packed[rows, k] = finite32(ka * ambient[k] * color[..., k])
                packed[rows, 3 + k] = finite32(kd * color[..., k])
            packed[rows, 6], packed[rows, 7] = finite32(ks), finite32(exponent)

        blockwise(m, pack)
        black = None
        if not shade["ks"].all():
            black = np.empty(m, bool)
            for rows in (slice(i, i + BLOCK) for i in range(0, m, BLOCK)):
                kd, ks, color = (some(name, rows) for name in ("kd", "ks", "color"))
                black[rows] = (ks == 0) & ((kd == 0) | ~color.any(axis=-1))
        bounce = empty((m if may_bounce(scene, request) else 0, 4), real_dtype(precision))
        for k, name in enumerate((*GO_ON, "index")):
            bounce[:, k] = some(name, slice(len(bounce)))
        bounce[:, 3] = 0
        texture = shade["texture"] if scene.textures else np.zeros(0, np.int32)
        return cls(
            packed,
            bounce,
            texture if which is None or not len(texture) else texture.take(which),
            shiny=bool(shade["ks"].any()),
            black=black,
            brightest=float(shade["ks"].max(initial=0)),
        )

    def reflect(self, material_of: NDArray[np.integer[Any]]) -> bool:
        """Whether some surface reflects light that is not ambient. material_of: (n,), indices of their materials."""
        if self.black is None:
            return len(material_of) > 0
        return not self.black[used(len(self.black), material_of)].all()


def may_bounce(scene: Scene, request: Request) -> bool:
    """Whether some material mirrors or is transparent, or is to be treated so."""
    shade = scene.columns.every_shade()
    return any(shade[name].any() for name in GO_ON) or "bounces" in request.keep


def used(count: int, material_of: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
    """(count,): which materials some sphere has. material_of: (n,), of the spheres."""
    mask = np.zeros(count, bool)
    mask[material_of] = True
    return mask


def finite32(value: Array) -> Array:
    """The values, with half of float32's largest number in place of larger ones: the sum of two is a number, too.

    Products of colours may be as large; they are white in any picture.
    """
    return np.minimum(value, float(np.finfo(np.float32).max) / 2)
