"""A tree of boxes over spheres, for rays that start anywhere: mirrored and refracted ones.

Each node has up to eight children, nodes or blocks of up to eight spheres (Wald, Benthin and Boulos 2008). Where a
child is comes from its place alone: the spheres are put into an order, each eight of them are a block, and each eight
neighbours of one level are a node of the next. So all nodes of a level are made at once, nodes and blocks are full but
for the last one of a level, and no tree is deeper than its number of spheres asks for.

The order halves a set of spheres again and again across the longest side of its centres' box.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.exact import Array, blockwise, rounded_down, rounded_up

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]

WIDTH = 8
NODE = np.dtype(
    [(name, "f4", (8,)) for name in ("low_x", "high_x", "low_y", "high_y", "low_z", "high_z")] + [("child", "i4", (8,))]
)
BLOCK = np.dtype([(name, "f4", (8,)) for name in ("x", "y", "z", "outer", "inner")] + [("index", "i4", (8,))])

# Spheres of the largest sets of equal size that are halved together.
ROW = 4096
# Rows of so many keys or fewer sort in a network of comparisons, which takes less time than a partition of them.
NETWORK = 256


@dataclass(frozen=True)
class Tree:
    """Boxes over n spheres, as records of NODE and BLOCK.

    node: the root is the first one. A node has the boxes of its children, (8,) each, rounded outwards, and `child`: the
    index of a node, or ~ that of a block. A box that is missing is empty: infinity is its low side, -infinity its high
    side. block: centres, rounded, outer and inner radii, rounded up and down and made wider by what the tree was built
    with, and the spheres' indices; a slot that is empty has the outer radius -1 and the index -1.
    """

    node: NDArray[np.void]
    block: NDArray[np.void]


def build_tree(center: Array, outer: Array, inner: Array, widen: float, member: Ints | None = None) -> Tree:
    """The tree over surfaces that lie between two spheres each.

    center: (n, 3), outer and inner: (n,), all of a size about 1 at most; for a sphere both are its radius. widen: what
    is added to the outer radii and taken off the inner ones, for the rounding of whoever reads the blocks. member: (m,)
    int32, indices of those to be entered; None for all.
    """
    member = np.arange(len(center), dtype=np.int32) if member is None else member.astype(np.int32)
    keys = np.concatenate([center.T, outer[None]]).astype(np.float32)
    order = member[_order(keys.take(member, axis=1))]
    blocks = max(1, -(-len(order) // WIDTH))
    block = np.zeros(blocks, BLOCK)
    sides = np.empty((6, -(-blocks // WIDTH) * WIDTH))
    sides[::2], sides[1::2] = np.inf, -np.inf

    def fill(rows: slice) -> None:
        index = order[rows.start * WIDTH : rows.stop * WIDTH]
        empty = -len(index) % WIDTH if len(order) else WIDTH
        part = block[rows]
        part["index"] = np.concatenate([index, np.full(empty, -1, np.int32)]).reshape(-1, WIDTH)
        # Empty slots repeat the last sphere, which changes no box.
        index = np.concatenate([index, np.full(empty, index[-1] if len(index) else 0, np.int32)]).reshape(-1, WIDTH).T
        if not len(order):
            part["outer"] = -1
            return
        r = outer.take(index)
        part["outer"] = rounded_up(r + widen).T
        part["inner"] = rounded_down(np.maximum(inner.take(index) - widen, 0)).T
        for j, name in enumerate("xyz"):
            x = center[:, j].take(index)
            part[name] = x.T
            # The difference is rounded, too, by less than this.
            slack = (np.abs(x) + r) * 2.0**-52
            sides[2 * j, rows] = (x - r - slack).min(axis=0)
            sides[2 * j + 1, rows] = (x + r + slack).max(axis=0)
        if empty:
            part["outer"][part["index"] < 0] = -1

    blockwise(blocks, fill, 2**12)
    return Tree(_nodes(sides, blocks), block)


def _nodes(sides: Array, blocks: int) -> NDArray[np.void]:
    """The nodes over so many blocks. sides: (6, 8 m), of the blocks' boxes, and of empty ones up to a multiple of 8."""
    boxes = np.empty_like(sides, np.float32)
    boxes[::2], boxes[1::2] = rounded_down(sides[::2]), rounded_up(sides[1::2])
    levels: list[NDArray[np.void]] = []
    count = blocks
    while not levels or count > 1:
        above = -(-count // WIDTH)
        level = np.zeros(above, NODE)
        for box, name in zip(boxes.reshape(6, above, WIDTH), NODE.names or (), strict=False):
            level[name] = box
        index = np.arange(above * WIDTH, dtype=np.int32).reshape(above, WIDTH)
        level["child"] = np.where(level["low_x"] <= level["high_x"], index if levels else ~index, 0)
        levels.append(level)
        wide = boxes.reshape(6, above, WIDTH)
        count = above
        boxes = np.empty((6, -(-above // WIDTH) * WIDTH), np.float32)
        boxes[::2], boxes[1::2] = np.inf, -np.inf
        boxes[::2, :above], boxes[1::2, :above] = wide[::2].min(axis=2), wide[1::2].max(axis=2)
    first = 0
    for below, level in zip(levels[-2::-1], levels[:0:-1], strict=True):
        first += len(level)
        filled = level["low_x"] <= level["high_x"]
        level["child"][filled] += first
        assert len(below)
    return np.concatenate(levels[::-1])


def _order(keys: Floats) -> Ints:
    """The order (n,) of spheres, by their keys (4, n): coordinates and radius."""
    n = keys.shape[1]
    order = np.arange(n, dtype=np.int32)
    keys = keys.copy()
    pieces: dict[int, list[int]] = {}
    todo = [(0, n)]
    while todo:
        start, count = todo.pop()
        if count <= WIDTH:
            continue
        unit = WIDTH
        while unit * WIDTH < count:
            unit *= WIDTH
        if unit * WIDTH == count <= ROW:
            pieces.setdefault(count, []).append(start)
            continue
        units = -(-count // unit)
        left = units // 2 * unit
        part = slice(start, start + count)
        axis = int(np.argmax(np.ptp(keys[:3, part], axis=1)))
        key = _sortable(keys[axis, part]) << 32 | np.arange(count)
        key.partition(left)
        which = key & 0xFFFFFFFF
        order[part] = order[part].take(which)
        keys[:, part] = keys[:, part].take(which, axis=1)
        todo += [(start, left), (start + left, count - left)]
    for size, starts in pieces.items():
        places = np.array(starts)[:, None] + np.arange(size)

        def halve(block: slice, places: NDArray[np.int64] = places) -> None:
            which = places[block]
            order[which] = _halved(keys[:3, which], order[which])

        blockwise(len(starts), halve, max(1, 2**15 // size))
    return order


def _halved(keys: Floats, order: Ints) -> Ints:
    """Each row of spheres in the order of blocks. keys: (3, rows, size), coordinates; order: (rows, size)."""
    _, rows, size = keys.shape
    order = order.ravel()
    width = size
    while width > WIDTH:
        shape = (-1, width)
        boxed = keys.reshape(3, -1, width)
        axis = np.argmax(boxed.max(axis=2) - boxed.min(axis=2), axis=0)
        chosen = boxed[axis, np.arange(len(axis))]
        key = _sortable(chosen) << 32
        key |= np.arange(rows * size).reshape(shape)
        if width > NETWORK:
            key.partition(width // 2, axis=1)
        else:
            key.sort(axis=1)
        which = key.ravel() & 0xFFFFFFFF
        order = order.take(which)
        keys = keys.reshape(3, -1).take(which, axis=1)
        width //= 2
    return order.reshape(rows, size)


def _sortable(x: Floats) -> NDArray[np.int64]:
    """The bits of float32 numbers, changed such that, read as whole numbers, they are in the numbers' order."""
    bits = np.ascontiguousarray(x).view(np.int32)
    return (bits ^ (bits >> 31 & np.int32(0x7FFFFFFF))).astype(np.int64)
