"""A walk of many rays at once through the tree: which surfaces each may meet, the near ones first.

Each ray has a stack of nodes, and in each turn goes to the nearest one of them. What has been met beyond doubt is how
far it looks. An entry of a stack is the node, below a number of 32 bits that is ordered as where the ray enters it.

Where a ray enters and leaves a box is computed in float32, from numbers o, w and sides of the box. o and the sides are
off by 2^-24 of themselves, a difference and its product with 1 / w by 2^-22 of it. With sides of magnitude 1 at most,
that is as if a side were off by 2^-24 |o| + 2^-24 + 5 * 2^-24 (|o| + 1), for which boxes are made larger by
2^-21 (|o| + 1), and by what o itself is off by.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats, cross, dot
from cltrace.rays.doubles import FLOOR, PER_OFF, Met, norm1
from cltrace.rays.lines import Bools, Ids, Lines
from cltrace.rays.surfaces import Surfaces

Floats32 = NDArray[np.float32]
# 1 / w is no more than this: within boxes all distances are less than its product with what they are enlarged by.
STEEPEST = 2.0**100
# Rays whose boxes are looked at in one go: their temporary arrays stay in a processor's cache.
CHUNK = 1 << 12
# When so many chunks have met something, what turned out to be behind something else is let go.
MANY = 64


class Walk:
    """The walk of some rays. far: (n,), how far each looks, which may be lowered while it goes on."""

    def __init__(self, lines: Lines, surfaces: Surfaces) -> None:
        self.lines, self.surfaces, self.nodes = lines, surfaces, surfaces.nodes
        n, self.unit = len(lines), 2.0**surfaces.nodes.exponent
        with np.errstate(all="ignore"):
            o = (lines.place - surfaces.middle) * self.unit
            wide = (np.abs(o).max(axis=1, initial=0) + 1) * 2.0**-21 + np.ldexp(lines.off, self.nodes.exponent)
            o[~np.isfinite(wide)], wide[~np.isfinite(wide)] = 0, np.inf
            self.plus, self.minus = ((o.T + sign * wide).astype(np.float32) for sign in (1, -1))
            self.inverse = np.clip(1 / lines.w.T, -STEEPEST, STEEPEST).astype(np.float32)
            self.far = lines.high + lines.loose
            self.near = -_rounded(-(lines.low - lines.loose) * self.unit)
        self.stack = np.empty((n, self.nodes.depth), np.int64)
        self.stack[:, 0] = -(1 << 63)  # the root, nearer than anything
        self.top = np.ones(n, np.int64)

    def run(self, found: Callable[[Ids, Ids], None]) -> None:
        """Calls found(ray, primitive), both (k,), for all that may meet. It may lower `far`."""
        active = np.arange(len(self.lines))
        while len(active):
            for i in range(0, len(active), CHUNK):
                self._step(active[i : i + CHUNK], found)
            active = active[self.top[active] > 0]

    def _step(self, rows: Ids, found: Callable[[Ids, Ids], None]) -> None:
        self.top[rows] -= 1
        entry = self.stack[rows, self.top[rows]]
        limit = _rounded(self.far[rows] * self.unit)
        open_ = (entry >> 32) <= _ordered(limit)
        rows, limit, node = rows[open_], limit[open_], entry[open_].astype(np.uint32).astype(np.int32)
        inner = node >= 0
        if inner.any():
            self._enter(rows[inner], node[inner], limit[inner])
        if not inner.all():
            rows, leaf = rows[~inner], ~node[~inner]
            balls = leaf < self.nodes.blocks
            for which, beside in ((balls, self._beside_balls), (~balls, self._beside_triangles)):
                if which.any():
                    slots = self.nodes.slots[leaf[which]]
                    ray, slot = np.nonzero((slots >= 0) & ~beside(rows[which], leaf[which]))
                    if len(ray):
                        found(rows[which][ray], slots[ray, slot].astype(np.int64))

    def _enter(self, rows: Ids, node: NDArray[np.int32], limit: Floats32) -> None:
        """Puts those children on the stacks that the rays may meet, the nearest one on top."""
        near = np.broadcast_to(self.near[rows][:, None], (len(rows), 8))
        far = limit[:, None]
        with np.errstate(all="ignore"):
            for i in range(3):
                inverse = self.inverse[i, rows][:, None]
                one = (self.nodes.sides[2 * i].take(node, axis=0) - self.plus[i, rows][:, None]) * inverse
                two = (self.nodes.sides[2 * i + 1].take(node, axis=0) - self.minus[i, rows][:, None]) * inverse
                near, far = np.maximum(near, np.minimum(one, two)), np.minimum(far, np.maximum(one, two))
        child = self.nodes.child.take(node, axis=0)
        key = (_ordered(near) << 32) | child.astype(np.uint32).astype(np.int64)
        entered = (near <= far) & (child != 0)
        key[~entered] = np.iinfo(np.int64).max
        key.sort(axis=1)
        count = entered.sum(axis=1)
        top = self.top[rows]
        for j in range(8):
            some = np.flatnonzero(count > j)
            if not len(some):
                break
            self.stack[rows[some], top[some] + count[some] - 1 - j] = key[some, j]
        self.top[rows] = top + count

    def _beside_triangles(self, rows: Ids, leaf: NDArray[np.int32]) -> Bools:
        """(k, 8): which triangles the rays surely pass by, see doubles.py."""
        lines, table = self.lines, self.nodes.patches.take(leaf - self.nodes.blocks, axis=1)
        w = lines.w[rows].T[:, :, None]
        with np.errstate(all="ignore"):
            a, e1, e2 = table[:3] - lines.place[rows].T[:, :, None], table[3:6], table[6:9]
            R = cross(a, w)
            EB, EC = dot(e2, R), -dot(e1, R)
            EA = (dot(cross(e1, e2), w) - EB) - EC
            s = norm1(a) + PER_OFF * lines.off[rows][:, None]
            error = norm1(w) * (2.0**-44 * s * table[9] + 2.0**-46 * table[10]) + FLOOR
            least, most = np.minimum(np.minimum(EA, EB), EC), np.maximum(np.maximum(EA, EB), EC)
            return np.asarray((least < -error) & (most > error))

    def _beside_balls(self, rows: Ids, leaf: NDArray[np.int32]) -> Bools:
        """(k, 8): which spheres the rays surely pass by; of ellipsoids, spheres around them."""
        lines, table = self.lines, self.nodes.balls.take(leaf, axis=1)
        w = lines.w[rows].T[:, :, None]
        with np.errstate(all="ignore"):
            f, r = table[:3] - lines.place[rows].T[:, :, None], table[3]
            X = cross(f, w)
            a, XX, arr = dot(w, w), dot(X, X), dot(w, w) * (r * r)
            e = 2.0**-47 * (norm1(f) + PER_OFF * lines.off[rows][:, None]) * norm1(w)
            error = (2 * norm1(X) + e) * e + 2.0**-46 * (arr + XX) + FLOOR
            return np.asarray((arr - XX < -error) & (a > 0))


def _rounded(x: Floats) -> Floats32:
    """float32 numbers >= x."""
    with np.errstate(over="ignore"):
        near = x.astype(np.float32)
    return np.where(near < x, np.nextafter(near, np.float32(np.inf)), near).astype(np.float32)


def _ordered(x: Floats32) -> Ids:
    """Integers of 32 bits that are ordered as these numbers are."""
    bits = np.ascontiguousarray(x).view(np.int32)
    return (bits ^ ((bits >> 31) & np.int32(0x7FFFFFFF))).astype(np.int64)


def candidates(lines: Lines, surfaces: Surfaces, meet: Callable[[Ids, Ids], Met]) -> Met:
    """All that rays meet, or may meet, before what they surely meet. meet(): which of these pairs do."""
    walk, parts = Walk(lines, surfaces), list[Met]()

    def kept(met: Met) -> Met:
        return met.at(met.low <= walk.far[met.ray])

    def found(ray: Ids, primitive: Ids) -> None:
        met = meet(ray, primitive)
        np.minimum.at(walk.far, met.ray[met.sure], met.high[met.sure])
        parts.append(kept(met))
        if len(parts) >= MANY:
            parts[:] = [kept(Met.all(parts))]

    walk.run(found)
    return kept(Met.all(parts))
