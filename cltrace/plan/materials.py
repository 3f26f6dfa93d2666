"""Materials as the kernel reads them, and what of Phong's formula they need at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import Precision, shade_dtype
from cltrace.plan.exact import Array
from cltrace.scene import AMBIENT, Scene


@dataclass(frozen=True)
class Materials:
    """packed: (m, 8) of shade_dtype, ka La C (rgb), kd C (rgb), ks, exponent; shiny: whether any shines; black: (m,),
    which reflect nothing of any light; brightest: the largest ks.
    """

    packed: NDArray[Any]
    shiny: bool
    black: NDArray[np.bool_]
    brightest: float

    @classmethod
    def of(cls, scene: Scene, precision: Precision) -> Materials:
        """Those of a scene, with its ambient light."""
        m = scene.materials
        ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)
        packed = np.empty((len(m), 8))
        packed[:, 0:3] = m["ka"][:, None] * ambient * m["color"]
        packed[:, 3:6] = m["kd"][:, None] * m["color"]
        packed[:, 6], packed[:, 7] = m["ks"], m["exponent"]
        black = np.asarray((m["ks"] == 0) & ((m["kd"] == 0) | ~m["color"].any(axis=1)))
        shade = finite32(packed).astype(shade_dtype(precision))
        return cls(shade, bool(m["ks"].any()), black, float(m["ks"].max(initial=0)))


def finite32(value: Array) -> Array:
    """The values, but none beyond float32's range: products of colours may leave it, and are white at any rate."""
    return np.minimum(value, float(np.finfo(np.float32).max))
