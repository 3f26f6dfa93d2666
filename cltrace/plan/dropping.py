"""When a branch of a pixel's tree of rays is too faint to be traced.

Let nothing in a scene be brighter than B, and let no surface send on more than it gets. Then all that is seen with the
weight w adds w B at most to a pixel, however it branches. So the kernel drops branches with a small w B, sums up what
they might have added, and is done if no output would be another with all of that. Else it traces the pixel again with a
lower limit: see follow() in kernels/shade/tree_of_rays.cl.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import real_dtype
from cltrace.plan.bounces import Bounces
from cltrace.plan.materials import Materials, used
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array
from cltrace.scene import Vector

# Sums count in such parts.
PARTS = 2.0**40
# The first limit of w B, for bytes and for floats of colours; 1 is full. Seconds of processor that a frame of 320x240
# takes, of those that it takes without dropping, where 12 balls have the reflectance r and the transmittance t and rays
# bounce up to n times (PoCL 3.1, bytes):
#
#                        2^-8  2^-12  2^-14  2^-16  2^-18  2^-20
#   r 0.4, t 0.5, n  8   1.5   1.0    0.9    0.9    1.0    0.9
#   r 0.4, t 0.5, n 16   0.9   0.8    0.8    0.7    0.7    0.9
#   r 0.3, t 0.3, n 12   0.6   0.6    0.5    0.5    0.6    0.6
#   r 0.2, t 0.8, n 16   2.0   1.9    1.9    1.7    1.9    1.7
#
# With r + t = 1 nothing is lost on the way, and the more is in what is dropped. Floats need so small limits that little
# is left to drop: 0.9, 0.9, 1.0, 1.4 with 2^-32.
FAINT, FAINT_FOR_FLOATS = 2.0**-16, 2.0**-32
# The same for samples of a pixel's mean, which may lack 2^-11 each: MOST_DROPPED of kernels/shade/tree_of_rays.cl.
FAINT_FOR_SAMPLES = 2.0**-13


def brightest(
    materials: Materials, material_of: NDArray[np.integer[Any]], lights: NDArray[np.void], background: Vector
) -> Array:
    """(3,): more than any surface or the background shows of red, green and blue.

    That is ka La C and, for each light, (kd C + ks) L, since no cosine, no lobe and no share of a spot light exceeds 1.
    What the kernel computes may exceed it by roundings, of a factor 1 + u each, u = 2^-24. A light's part takes fewer
    than 12 of them, and adding up those of 1,024 lights 1,024. A weight is a product of up to 101 factors; at each
    surface those of both branches and the share of its own colour add up to 1 but for 4 roundings, one of them that of
    the product. So all that is seen with a weight exceeds it by less than 1,500 u and its square: less than 2^-12.
    """
    packed = materials.packed[used(len(materials.packed), material_of)].astype(np.float64)
    light = lights["color"].astype(np.float64).sum(axis=0)
    shown = packed[:, 0:3] + (packed[:, 3:6] + packed[:, 6:7]) * light
    return np.asarray(np.maximum(shown.max(axis=0, initial=0), background) * (1 + 2.0**-12))


def limits(bounces: Bounces, peak: Array, request: Request) -> dict[str, Any]:
    """The kernel's arguments `brightest` and `faint`. peak: of brightest()."""
    largest = float(np.finfo(real_dtype(request.precision)).max)
    parts = [value if value <= largest else math.inf for value in (peak * PARTS).tolist()]
    faint = FAINT_FOR_FLOATS if "color" in request.outputs else FAINT
    if request.means:
        faint = FAINT_FOR_SAMPLES
    return {"brightest": (*parts, max(parts)), "faint": faint * PARTS if bounces.shrinks else -1.0}
