"""What the surfaces of a scene do with the rays that meet them: absorb, mirror, let through."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS
from cltrace.plan.materials import used

# The numbers of waiting rays that programs have room for: one for each depth of 0 .. max_bounces.
ROOMS = (9, 17, 33, 65, 101)
# With reflectance + transmittance up to this, dropping branches saved time: 0.9 took 0.7 to 0.9 of it, 1 took 1.7.
FADING = 0.95


@dataclass(frozen=True)
class Bounces:
    """What some surface does.

    any: whether some surface mirrors or is transparent; glass: whether some is transparent; splits: whether some does
    both, which makes two rays of one; most: the largest reflectance + transmittance.
    """

    any: bool
    glass: bool
    splits: bool
    most: float

    @classmethod
    def of(cls, bounce: NDArray[Any], material_of: NDArray[np.integer[Any]], full: bool) -> Bounces:
        """bounce: of Materials; material_of: (n,), of the spheres; full: whether to expect everything of them."""
        r, t = (bounce[used(len(bounce), material_of)] if len(bounce) else bounce)[:, :2].T
        most = float((r + t).max(initial=0))
        return cls(full or most > 0, full or bool(t.any()), full or bool(((r > 0) & (t > 0)).any()), most)

    @property
    def shrinks(self) -> bool:
        """Whether what goes on from a surface never weighs more than what came."""
        return self.most <= 1

    def fades(self, max_bounces: int) -> bool:
        """Whether it pays to drop what is faint.

        Where all that comes goes on, so much is dropped that most pixels are traced again: see plan/dropping.py.
        Then it is worth a try only where a tree might be too large without.
        """
        return self.most <= FADING or self.overgrows(max_bounces)

    def growth(self, max_bounces: int) -> float:
        """How much all rays of a pixel together may weigh, 1 being one ray; 1e200 stands for all that is more."""
        return math.exp(min(math.log(1e200), math.log(max(1.0, self.most)) * (max_bounces + 1)))

    def overgrows(self, max_bounces: int) -> bool:
        """Whether a pixel may take more than MOST_RAYS rays.

        Where nothing splits, there are max_bounces + 2 at most. A tree that splits everywhere has 2^depth rays of each
        depth up to max_bounces + 1.
        """
        return self.splits and 2 ** (max_bounces + 2) - 1 > CONSTANTS["MOST_RAYS"]

    def branches(self, max_bounces: int) -> int:
        """How many rays of a pixel may wait for others: one for each depth at most."""
        return next(n for n in ROOMS if n > max_bounces) if self.splits else 1


NO_BOUNCES = Bounces(False, False, False, 0.0)
