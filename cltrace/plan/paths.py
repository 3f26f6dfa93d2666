"""What rays need that leave surfaces, mirrored or refracted: all surfaces in the world, and a tree of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS, dtype_of
from cltrace.plan.accel.bvh import Balls, Faces, Tree, build_tree
from cltrace.plan.rounding import Array, Ints, Mask, U
from cltrace.scene import AnyCamera

# The kernel's arguments where no ray leaves a surface.
NO_PATHS: dict[str, Any] = {
    "middle": (0.0, 0.0, 0.0, 1.0),
    "widen": 0.0,
    "blocks": 0,
    "patches": 0,
    "eye": (0.0, 0.0, 0.0, 0.0),
}


@dataclass(frozen=True)
class Paths:
    """n spheres and m triangles for rays that may start anywhere among them. No camera changes it.

    middle: (3,), a point in the world, scene units; exponent: a length in scene units, times 2^exponent, is in the
    tree's unit; widen: what the tree's radii are larger or smaller by, in its unit; tree: of the surfaces that can be
    met, None where no ray leaves any.
    """

    middle: Array
    exponent: int
    widen: float
    tree: Tree | None

    @classmethod
    def of(
        cls,
        center: Array,
        outer: Array,
        inner: Array,
        member: Mask | None,
        vertex: Array,
        face: Ints,
        room: float = 1.0,
    ) -> Paths:
        """The paths among surfaces, each of which lies between two spheres, (n,) outer and inner ones, and triangles.

        Those of `member` (n,) are entered in the tree, and all triangles; None: there is no tree. vertex: (v, 3), in
        the world; face: (m, 3), the vertices of triangles, which are the primitives after the n others; room: rays may
        start within so many times the size of the scene.
        """
        # Halves, as the sum of two doubles may overflow.
        low, high = (
            np.array([f([f(x, initial=i), f(y, initial=i)]) / 2 for x, y in zip(center.T, vertex.T, strict=True)])
            for f, i in ((np.min, np.inf), (np.max, -np.inf))
        )
        middle, half = (low + high, high - low) if len(center) or len(vertex) else (np.zeros(3), np.zeros(3))
        # All of it is within this distance of the middle, but for roundings of which WIDEN has enough to spare.
        size = room * max(2.0**-149, float(np.hypot(np.hypot(half[0], half[1]), half[2]) + outer.max(initial=0)))
        exponent = -math.frexp(size)[1]
        unit = 2.0**exponent
        widen = CONSTANTS["WIDEN"] * U * size * unit
        tree = None
        if member is not None:
            index = None if member.all() else np.flatnonzero(member).astype(np.int32)
            large = outer * unit
            small = large if inner is outer else inner * unit
            balls = Balls((center - middle) * unit, outer=large, inner=small, widen=widen, member=index)
            tree = build_tree(balls, Faces((vertex - middle) * unit, face, len(center), vertex))
        return cls(middle, exponent, widen, tree)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The kernel's buffers by name."""
        if self.tree is None:
            return {name: np.zeros(0, dtype_of(name.title(), "accurate")) for name in ("node", "block", "patch")}
        return {"node": self.tree.node, "block": self.tree.block, "patch": self.tree.patch}

    def values(self, camera: AnyCamera, exponent: int | None) -> dict[str, Any]:
        """The kernel's arguments by name. exponent: of the float buffers, where `real` is float; else None."""
        middle, eye = (*self.middle.tolist(), math.ldexp(1.0, self.exponent)), np.array(camera.position)
        if exponent is not None:
            # What is too small for float32, seen from so far, is a point there in any unit.
            middle = (0.0, 0.0, 0.0, math.ldexp(1.0, min(self.exponent - exponent, 127)))
            eye = np.ldexp(eye - self.middle, exponent)
        blocks, patches = (len(self.tree.block), len(self.tree.patch)) if self.tree else (0, 0)
        values = {"middle": middle, "widen": self.widen, "blocks": blocks, "patches": patches}
        return {**values, "eye": (*eye.tolist(), 0.0)}

    def places(self, center: Array, radius: Array, exponent: int | None) -> Array:
        """(n, 4): abi's `place`. exponent: as in values()."""
        if exponent is not None:
            center, radius = np.ldexp(center - self.middle, exponent), np.ldexp(radius, exponent)
        return np.concatenate([center, radius[:, None]], axis=1)
