"""What pairs of doubles know of rays and surfaces: the same questions as in doubles.py, to a hundred bits.

The start is the ray's own, not a place near the surfaces, and t is in units of w. The arithmetic keeps count of its
errors, see cltrace/base/arithmetic.py.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats
from cltrace.exact.fine import Fine, select

Signs = NDArray[np.int8]
# What is below may have lost digits that no error counts. Of the terms of an error, all factors are within 2^-200 or
# what a scene's number may be.
FLOOR = 2.0**-900


class Ends(NamedTuple):
    """k rays and surfaces. meets: (k,), 1 where the line surely meets the surface, -1 where not, 0 where it may or not;
    near, far: both ends of the way through, of what is flat twice the same."""

    meets: Signs
    near: Fine
    far: Fine


def sign_of(x: Fine) -> Signs:
    """1 or -1 where it is sure, 0 where it is not."""
    bound = 2 * x.error + FLOOR
    return (x.h > bound).astype(np.int8) - (x.h < -bound).astype(np.int8)


def way_through(a: Fine, b: Fine, c: Fine, D: Fine) -> tuple[Fine, Fine]:
    """The roots of a t^2 - 2 b t + c = 0, of which D is b b - a c; what is below 0 of it counts as 0."""
    root = Fine(np.maximum(D.h, 0), np.where(D.h > 0, D.l, 0), D.error).root()
    ahead = b.h > 0
    q = select(ahead, b, -b) + root
    outer, inner = select(ahead, q, -q) / a, select(ahead, c, -c) / q
    return select(ahead, inner, outer), select(ahead, outer, inner)


def compare(t: Fine, bound: Floats) -> Signs:
    """The sign of t - bound where it is sure; bound may be infinite."""
    finite = np.isfinite(bound)
    with np.errstate(all="ignore"):
        sign = sign_of(t - Fine.of(np.where(finite, bound, 0)))
    return np.where(finite, sign, np.where(bound > 0, -1, 1)).astype(np.int8)
