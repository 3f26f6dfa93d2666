"""A tree of boxes over spheres, for rays that start anywhere: mirrored and refracted ones.

Each node has up to eight children, nodes or blocks of up to eight spheres (Wald, Benthin and Boulos 2008). Where a
child is comes from its place alone: the spheres are put into an order, each eight of them are a block, and each eight
neighbours of one level are a node of the next. So all nodes of a level are made at once, nodes and blocks are full but
for the last one of a level, and no tree is deeper than its number of spheres asks for.

The order halves a set of spheres again and again, across the longest side of its centres' box.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.exact import Array, blockwise, concurrently

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]

WIDTH = 8
NODE = np.dtype(
    [(name, "f4", (8,)) for name in ("low_x", "high_x", "low_y", "high_y", "low_z", "high_z")] + [("child", "i4", (8,))]
)
BLOCK = np.dtype([(name, "f4", (8,)) for name in ("x", "y", "z", "outer", "inner")] + [("index", "i4", (8,))])

# Sets of up to so many spheres are halved together with others of their size.
ROW = 4096
# Rows of up to so many keys are sorted by a network of comparisons, in less time than a partition of them takes.
NETWORK = 256
# Spheres at a time, such that their keys stay in a processor's cache.
CHUNK = 2**15


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
    n = len(center) if member is None else len(member)
    keys = np.empty((4, n), np.float32)

    def round_keys(part: slice) -> None:
        which = part if member is None else member[part]
        keys[:3, part], keys[3, part] = center[which].T, outer[which]

    blockwise(n, round_keys)
    order = _order(keys)
    if member is not None:
        order = member.take(order).astype(np.int32)
    blocks = -(-n // WIDTH)
    block, boxes = np.empty(blocks, BLOCK), _empty_boxes(blocks)
    coordinate = np.ascontiguousarray(center).ravel()

    def fill(rows: slice) -> None:
        part, index = block[rows], order[rows.start * WIDTH : rows.stop * WIDTH]
        empty = len(part) * WIDTH - len(index)
        # The slots of a block are the first axis here: numpy is quick at minima along that one. Empty slots repeat the
        # last sphere, which changes no box.
        index = np.concatenate([index, np.repeat(index[-1:], empty)]).reshape(-1, WIDTH).T.copy()
        part["index"] = index.T
        r = outer.take(index)
        part["outer"] = _above(r + widen).T
        part["inner"] = np.maximum(-_above(widen - inner.take(index)), 0).T
        for j, name in enumerate("xyz"):
            x = coordinate.take(3 * index + j)
            part[name] = x.T
            boxes[j, 0, rows] = -_above((r - x).max(axis=0))
            boxes[j, 1, rows] = _above((x + r).max(axis=0))
        if empty:
            part["index"][-1, -empty:], part["outer"][-1, -empty:] = -1, -1

    blockwise(blocks, fill, CHUNK // WIDTH) if n else None
    return Tree(_nodes(boxes, blocks), block if n else np.zeros(1, BLOCK))


def _above(x: Array) -> Floats:
    """float32 numbers >= x, and >= what x was before it was rounded to double: an ulp more than needed at most.

    Rounding to float32 changes a number by 2^-24 of itself at most, or by 2^-150 where that is more.
    """
    return (x + (np.abs(x) * 2.0**-23 + 2.0**-149)).astype(np.float32)


def _empty_boxes(count: int) -> Floats:
    """(3, 2, count), or more: low and high sides of boxes, a multiple of 8 of them."""
    boxes = np.empty((3, 2, max(1, -(-count // WIDTH)) * WIDTH), np.float32)
    boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
    return boxes


def _nodes(boxes: Floats, count: int) -> NDArray[np.void]:
    """The nodes over so many blocks. boxes: theirs, and empty ones up to a multiple of 8."""
    counts = [max(1, -(-count // WIDTH))]
    while counts[-1] > 1:
        counts.append(-(-counts[-1] // WIDTH))
    node = np.zeros(sum(counts), NODE)
    end, below = len(node), None
    for level, nodes in enumerate(counts):
        part = node[end - nodes : end]
        for side, name in zip(boxes.reshape(6, nodes, WIDTH), NODE.names or (), strict=False):
            part[name] = side
        child = np.arange(nodes * WIDTH, dtype=np.int32)
        child[count:] = 0
        child[:count] = child[:count] + end if level else ~child[:count]
        part["child"] = child.reshape(-1, WIDTH)
        below, boxes = boxes.reshape(3, 2, nodes, WIDTH), _empty_boxes(nodes)
        boxes[:, 0, :nodes], boxes[:, 1, :nodes] = below[:, 0].min(axis=2), below[:, 1].max(axis=2)
        count, end = nodes, end - nodes
    return node


def _order(keys: Floats) -> Ints:
    """The order (n,) of spheres, by their keys (4, n): coordinates and radius. The keys are put into it, too."""
    n = keys.shape[1]
    order = np.arange(n, dtype=np.int32)
    rows: dict[int, list[int]] = {}
    sets = [(0, n)]
    while sets:
        halve = []
        for start, count in sets:
            if count in (64, 512, ROW):
                rows.setdefault(count, []).append(start)
            elif count > WIDTH:
                halve.append(partial(_halve, keys, order, start, count))
        sets = [half for halves in concurrently(halve) for half in halves]
    for size, starts in rows.items():
        places = np.array(starts)[:, None] + np.arange(size)

        def sort(part: slice, places: NDArray[np.int64] = places) -> None:
            which = places[part]
            order[which] = _sorted_rows(keys[:3, which], order[which])

        blockwise(len(starts), sort, CHUNK // size)
    return order


def _halve(keys: Floats, order: Ints, start: int, count: int) -> list[tuple[int, int]]:
    """Puts a set of spheres into an order of two halves, those of full nodes as far as they go, and returns these."""
    unit = WIDTH
    while unit * WIDTH < count:
        unit *= WIDTH
    left = -(-count // unit) // 2 * unit
    part = slice(start, start + count)
    low = keys[:3, part].min(axis=1)
    size = keys[:3, part].max(axis=1) - low
    axis = int(np.argmax(size))
    x = keys[axis, part]
    # By a histogram, as most of the set is in other bins than that of the median.
    bin_of = ((x - low[axis]) * np.float32(4095 / max(float(size[axis]), 1e-30))).astype(np.uint16)
    ends = np.cumsum(np.bincount(bin_of, minlength=4096))
    middle = int(np.searchsorted(ends, left))
    first = bin_of < middle
    among = np.flatnonzero(bin_of == middle)
    missing = left - int(ends[middle] - len(among))
    if missing < len(among):
        among = among[np.argpartition(x[among], missing)[:missing]]
    first[among] = True
    which = np.concatenate([np.flatnonzero(first), np.flatnonzero(~first)])
    order[part] = order[part].take(which)
    for key in keys:
        key[part] = key[part].take(which)
    return [(start, left), (start + left, count - left)]


def _sorted_rows(keys: Floats, order: Ints) -> Ints:
    """Each row of spheres in the order of blocks. keys: (3, rows, size), coordinates; order: (rows, size)."""
    shape = order.shape
    width = shape[1]
    keys, order = keys.reshape(3, -1), order.ravel()
    level = 0
    while width > WIDTH:
        if level % 3 == 0:
            starts, bits = np.arange(0, len(order), width), width.bit_length() - 1
            low = np.minimum.reduceat(keys, starts, axis=1)
            size = np.maximum.reduceat(keys, starts, axis=1) - low
            scale = np.float32(2 ** min(23, 30 - bits)) / np.maximum(size, np.float32(1e-30))
        else:
            # That halves are half as long is near enough.
            low, size, scale = (np.repeat(x, 2, axis=1) for x in (low, size, scale))
        axis, row = np.argmax(size, axis=0), np.arange(len(order) // width)
        # A key has a place along that axis, and below it the sphere's place in the row.
        along = keys.reshape(3, -1, width)[axis, row]
        along -= low[axis, row][:, None]
        along *= scale[axis, row][:, None]
        key = along.astype(np.int32)
        key <<= bits
        key |= np.arange(width, dtype=np.int32)
        if width > NETWORK:
            key.partition(width // 2, axis=1)
        else:
            key.sort(axis=1)
        key &= width - 1
        which = (key + np.arange(0, len(order), width)[:, None]).ravel()
        order, keys = order.take(which), keys.take(which, axis=1)
        size[axis, row] /= 2
        width //= 2
        level += 1
    return order.reshape(shape)
