"""A tree of boxes over spheres and triangles, for rays that start anywhere: mirrored and refracted ones.

A node has up to eight children, which are nodes, blocks of up to eight spheres or patches of up to eight triangles
(Wald, Benthin and Boulos 2008). The shapes of a kind are put into an order; each eight of them are a leaf, and each
eight neighbours on one level are a node of the next one. So all nodes of a level are made at once, all but the last one
of a level are full, and no tree is deeper than its number of shapes asks for, wherever they are.

The order comes from halving a set of shapes again and again: across the longest side of the box of their middles, and
in small sets across the axis that gives the smallest boxes. Shapes that are large beside the distance of most others
are in trees of their own, and so are the two kinds. The root joins all trees.

The root is on level 1. With n shapes, the nodes just above the leaves are on level ceil(log8(n / 8)), 1 at least, or on
the next one if the root joins several trees. A walk that goes on with one child of a node, and keeps the others for
later, has up to 7 of them for each level: 63 for 2^26 shapes, and as many for 2^27.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise, concurrently
from cltrace.plan.abi import CONSTANTS, dtype_of
from cltrace.plan.rounding import Array, Ints, Mask, U
from cltrace.scene import AnyCamera

Floats = NDArray[np.float32]

# Children of a node, spheres of a block and triangles of a patch.
WIDTH = 8
SIDES = ("low_x", "high_x", "low_y", "high_y", "low_z", "high_z")
# They are the same in all precisions.
NODE_TYPE, BLOCK_TYPE, PATCH_TYPE = (dtype_of(name, "accurate") for name in ("Node", "Block", "Patch"))

# A set of one of these sizes is a row of an array, and all of them are halved together. The sizes are those of nodes
# with nothing missing below them.
ROWS = (WIDTH**2, WIDTH**3, WIDTH**4)
# Rows of up to so many keys are sorted by a network of comparisons, in less time than a partition of them takes.
NETWORK = 256
# Sets of up to so many spheres are halved across the best axis. A ray then looks at 1 to 3 % fewer nodes and blocks,
# and a tree takes 7 % longer to build. With sets of 64, it would be 1 % fewer again, and 20 % longer.
SMALL = 2 * WIDTH
# Shapes at a time, such that their keys stay in a processor's cache.
CHUNK = 2**15
# Bins of a histogram along an axis.
BINS = 4096
# What triangle_add_leaf() of the kernel is off by, for edges of lengths that add up to 1.
SLACK = CONSTANTS["EDGE_ROUNDINGS"] * 2.0**-24


class Balls(NamedTuple):
    """Surfaces that each lie between two spheres; for a sphere both are itself. All lengths are of a size about 1.

    center: (n, 3), outer and inner: (n,), float64; widen: what is added to the outer radii and taken off the inner
    ones, for the rounding of whoever reads the blocks; member: (k,), indices of those to be entered, in any order; None
    for all.
    """

    center: Array
    outer: Array
    inner: Array
    widen: float
    member: Ints | None = None


class Faces(NamedTuple):
    """vertex: (v, 3) float64, of a size about 1; face: (m, 3), indices of three vertices each.

    first: the index of the first triangle as a primitive; those of the others follow. exact: (v, 3), the vertices
    before they were moved and rounded, which may have made two of them one.
    """

    vertex: Array
    face: Ints
    first: int
    exact: Array


@dataclass(frozen=True)
class BoxTree:
    """Boxes over spheres and triangles, as records of abi's `Node`, `Block` and `Patch`.

    node: the root is the first one. A node has the boxes of its children, (8,) each, rounded outwards, and `child`: the
    index of a node, or ~ that of a leaf. Leaves are the blocks, then the patches. Where a child is missing, the low
    sides are infinity, the high ones -infinity and `child` is 0. block: centres, rounded, outer and inner radii,
    rounded up and down and made wider by what the tree was built with, and the spheres' indices; a slot that is empty
    has the outer radius -1 and the index -1. patch: corners and edges, rounded, what the kernel's test of them is off
    by, and the triangles' indices as primitives; a slot that is empty has the slack -1 and the index -1. No triangle of
    which two corners are the same is in any.
    """

    node: NDArray[np.void]
    block: NDArray[np.void]
    patch: NDArray[np.void]


class _Leaves(NamedTuple):
    """Blocks or patches, their boxes (3, 2, k), and how many are in each tree, the largest tree first."""

    record: NDArray[np.void]
    boxes: Floats
    counts: list[int]


def build_tree(balls: Balls, triangles: Faces) -> BoxTree:
    """The tree over surfaces and triangles."""
    both = len(triangles.face) > 0 and len(balls.center) > 0
    trees = WIDTH // 2 if both else WIDTH
    blocks, patches = _blocks_of(balls, trees), _patches_of(triangles, trees)
    nodes, first = [], 0
    for leaves in (blocks, patches):
        for start, count in zip(accumulate(leaves.counts, initial=0), leaves.counts, strict=False):
            nodes.append(_nodes(leaves.boxes[:, :, start : start + count], first + start))
        first += len(leaves.record)
    nodes.sort(key=len, reverse=True)
    return BoxTree(_joined(nodes or [_nodes(np.zeros((3, 2, 0), np.float32), 0)]), blocks.record, patches.record)


def _blocks_of(balls: Balls, trees: int) -> _Leaves:
    """The blocks of all members, in so many trees at most."""
    n = len(balls.center) if balls.member is None else len(balls.member)
    keys = np.empty((4, n), np.float32)

    def round_keys(rows: slice) -> None:
        which = rows if balls.member is None else balls.member[rows]
        keys[:3, rows], keys[3, rows] = balls.center[which].T, 2 * balls.outer[which]

    blockwise(n, round_keys)
    index, counts = _leaf_order(keys, trees)
    if balls.member is not None:
        index = np.where(index < 0, -1, np.append(balls.member, -1).take(index)).astype(np.int32)
    return _Leaves(*_blocks(balls, index), counts)


def _patches_of(triangles: Faces, trees: int) -> _Leaves:
    """The patches of all triangles with three corners, in so many trees at most."""
    columns = np.ascontiguousarray(triangles.vertex.T)
    n = len(triangles.face)
    boxes, keys, flat = np.empty((3, 2, n), np.float32), np.empty((4, n), np.float32), np.zeros(n, bool)

    def enclose(rows: slice) -> None:
        a, b, c = (np.ascontiguousarray(corner) for corner in triangles.face[rows].T)
        same = [np.ones(len(a), bool) for _ in range(3)]
        for j, column in enumerate(columns):
            x, y, z = column.take(a), column.take(b), column.take(c)
            boxes[j, 0, rows] = -_above(-np.minimum(np.minimum(x, y), z))
            boxes[j, 1, rows] = _above(np.maximum(np.maximum(x, y), z))
            for equal, (p, q) in zip(same, ((x, y), (y, z), (z, x)), strict=True):
                equal &= p == q
        flat[rows] = same[0] | same[1] | same[2]
        low, high = boxes[:, 0, rows], boxes[:, 1, rows]
        keys[:3, rows], keys[3, rows] = (low + high) / 2, (high - low).max(axis=0)

    blockwise(n, enclose, CHUNK)
    some = np.flatnonzero(flat)
    a, b, c = (triangles.exact[triangles.face[some, k]] for k in range(3))
    flat[some] = (a == b).all(axis=1) | (b == c).all(axis=1) | (c == a).all(axis=1)
    member = np.flatnonzero(~flat).astype(np.int32) if flat.any() else None
    if member is not None:
        boxes, keys = boxes.take(member, axis=2), keys.take(member, axis=1)
    index, counts = _leaf_order(keys, trees)
    return _Leaves(*_patches(columns, triangles, boxes, index, member), counts)


def _leaf_order(keys: Floats, trees: int) -> tuple[Ints, list[int]]:
    """Which shapes are in which leaf: (8 k,), -1 where a slot is empty; and how many leaves are in each tree.

    keys: (4, n), the coordinates of the middles, and the sizes.
    """
    orders = [part.take(_order(keys[:3].take(part, axis=1))) for part in _size_classes(keys, trees) if len(part)]
    filled = [np.pad(order, (0, -len(order) % WIDTH), constant_values=-1) for order in orders]
    index = np.concatenate(filled) if filled else np.zeros(0, np.int32)
    return index, [len(part) // WIDTH for part in filled]


def _size_classes(keys: Floats, most: int) -> list[Ints]:
    """Which shapes get trees of their own: sets of indices, `most` at most, the one with most of them first.

    Among many small ones, a large one would make all boxes above it large, too, from its leaf up. keys: (4, n),
    coordinates and sizes.
    """
    classes: list[Ints] = []
    sets = [np.arange(keys.shape[1], dtype=np.int32)]
    while sets:
        part = sets.pop()
        few = keys if len(part) == keys.shape[1] else keys.take(part, axis=1)
        if len(part) > WIDTH and len(classes) + len(sets) < most - 1:
            # About the side of the box of a leaf's middles, where those are all over a cube.
            side = max(float(np.ptp(key)) for key in few[:3]) * (WIDTH / len(part)) ** (1 / 3)
            large = few[3] > 2 * side
            if 0 < np.count_nonzero(large) <= len(part) // 2:
                sets += [part[large], part[~large]]
                continue
        classes.append(part)
    return sorted(classes, key=len, reverse=True)


def _order(keys: Floats) -> Ints:
    """The order (n,) of shapes, by their coordinates (3, n), which are put into it, too."""
    n = keys.shape[1]
    order = np.arange(n, dtype=np.int32)
    rows: dict[int, list[int]] = {}
    sets = [(0, n)]
    while sets:
        for start, count in sets:
            if count in ROWS:
                rows.setdefault(count, []).append(start)
        jobs = [partial(_halve, keys, order, *part) for part in sets if part[1] > WIDTH and part[1] not in ROWS]
        # Threads take a millisecond to start.
        done = concurrently(jobs) if n > CHUNK else [job() for job in jobs]
        sets = [half for halves in done for half in halves]
    for size, starts in rows.items():
        places = np.array(starts)[:, None] + np.arange(size)

        def sort(part: slice, places: NDArray[np.int64] = places) -> None:
            which = places[part]
            order[which] = _sorted_rows(keys[:, which], order[which])

        blockwise(len(starts), sort, CHUNK // size)
    return order


def _halve(keys: Floats, order: Ints, start: int, count: int) -> list[tuple[int, int]]:
    """Puts a set of shapes into an order of two halves, and returns where these are, as (start, count) each.

    The first one is as much as full nodes of the next level hold.
    """
    unit = WIDTH
    while unit * WIDTH < count:
        unit *= WIDTH
    left = -(-count // unit) // 2 * unit
    part = slice(start, start + count)
    low = keys[:, part].min(axis=1)
    size = keys[:, part].max(axis=1) - low
    axis = int(np.argmax(size))
    x = keys[axis, part]
    # Most of the set is in other bins of a histogram than the median. Both halves stay in the order that they had.
    bin_of = ((x - low[axis]) * _bins(size[axis], BINS)).astype(np.uint16)
    ends = np.cumsum(np.bincount(bin_of, minlength=BINS))
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


def _bins(size: Floats | np.float32, count: int) -> Floats:
    """What makes places from 0 to size numbers from 0 to less than count, but where all is one place."""
    return np.asarray(np.float32(count * (1 - 2.0**-20)) / np.maximum(size, np.float32(2.0**-100)), np.float32)


def _sorted_rows(keys: Floats, order: Ints) -> Ints:
    """Each row of shapes in the order of leaves. keys: (3, rows, size), coordinates; order: (rows, size)."""
    shape = order.shape
    width = shape[1]
    keys, order = keys.reshape(3, -1), order.ravel()
    while width > WIDTH:
        starts = np.arange(0, len(order), width)
        low = np.minimum.reduceat(keys, starts, axis=1)
        size = np.maximum.reduceat(keys, starts, axis=1) - low
        # With the place in the row, they have 31 bits. float32 has 24.
        scale = _bins(size, min(2**23, 2**31 // width))
        for _ in range(3):
            if width <= SMALL:
                which = _best_halves(keys, low, scale, width)
            else:
                # That halves are half as long is near enough.
                axis, row = np.argmax(size, axis=0), np.arange(len(order) // width)
                which = _halves(keys.reshape(3, -1, width)[axis, row], low[axis, row], scale[axis, row])
                size[axis, row] /= 2
            order, keys = order.take(which.ravel()), keys.take(which.ravel(), axis=1)
            low, size, scale = (np.repeat(x, 2, axis=1) for x in (low, size, scale))
            width //= 2
    return order.reshape(shape)


def _halves(along: Floats, low: Floats, scale: Floats) -> Ints:
    """The order of each row, (rows, width), such that its first half comes before the second one along an axis.

    along: (rows, width), the places on that axis; low, scale: (rows,), what is taken from those and by what the rest is
    multiplied, so that it fills the bits of a key that the place in the row leaves.
    """
    rows, width = along.shape
    key: Ints = ((along - low[:, None]) * scale[:, None]).astype(np.int32)
    key *= width
    key |= np.arange(width, dtype=np.int32)
    if width > NETWORK:
        key.partition(width // 2, axis=1)
    else:
        key.sort(axis=1)
    key &= width - 1
    return key + np.arange(0, rows * width, width, dtype=np.int32)[:, None]


def _best_halves(keys: Floats, low: Floats, scale: Floats, width: int) -> Ints:
    """The order of each row, as of _halves(), along the axis for which the boxes of both halves have least surface."""
    orders, surfaces = [], []
    for along, start, factor in zip(keys.reshape(3, -1, width), low, scale, strict=True):
        orders.append(_halves(along, start, factor))
        # The places in a row are the first axis here: numpy is quick at minima along that one.
        which = np.ascontiguousarray(orders[-1].T)
        halves = [key.take(which).reshape(2, width // 2, -1) for key in keys]
        x, y, z = (half.max(axis=1) - half.min(axis=1) for half in halves)
        surfaces.append((x * y + y * z + z * x).sum(axis=0))
    best = np.argmin(surfaces, axis=0)
    chosen: Ints = np.array(orders)[best, np.arange(len(best))]
    return chosen


def _blocks(balls: Balls, index: Ints) -> tuple[NDArray[np.void], Floats]:
    """The blocks, and their boxes: (3, 2, k), low and high sides. index: (8 k,), the spheres in them, -1 for none."""
    blocks = len(index) // WIDTH
    block, boxes = np.empty(blocks, BLOCK_TYPE), np.empty((3, 2, blocks), np.float32)
    coordinate = np.ascontiguousarray(balls.center).ravel()

    def fill(rows: slice) -> None:
        part, spheres = block[rows], index.reshape(-1, WIDTH)[rows]
        part["index"] = spheres
        # Empty slots repeat the first sphere, which changes no box. The slots are the first axis from here on: numpy is
        # quick at minima along that one.
        which = np.ascontiguousarray(np.where(spheres < 0, spheres[:, :1], spheres).T)
        r = balls.outer.take(which)
        part["outer"] = np.where(spheres.T < 0, np.float32(-1), _above(r + balls.widen)).T
        part["inner"] = np.maximum(-_above(balls.widen - balls.inner.take(which)), 0).T
        for j, name in enumerate("xyz"):
            x = coordinate.take(3 * which + j)
            part[name] = x.T
            boxes[j, 0, rows] = -_above((r - x).max(axis=0))
            boxes[j, 1, rows] = _above((x + r).max(axis=0))

    if blocks:
        blockwise(blocks, fill, CHUNK // WIDTH)
    return block, boxes


def _patches(
    columns: Array, triangles: Faces, boxes: Floats, index: Ints, member: Ints | None
) -> tuple[NDArray[np.void], Floats]:
    """The patches, and their boxes: (3, 2, k).

    columns: (3, v), the vertices; boxes: (3, 2, n), of those triangles that are entered; index: (8 k,), which of these
    are in the patches, -1 for none; member: (n,), which triangles they are, None: all.
    """
    patches = len(index) // WIDTH
    patch, around = np.empty(patches, PATCH_TYPE), np.empty((3, 2, patches), np.float32)
    corners = np.ascontiguousarray(triangles.face.T)

    def fill(rows: slice) -> None:
        part, slots = patch[rows], index.reshape(-1, WIDTH)[rows]
        which = np.where(slots < 0, slots[:, :1], slots)
        across = np.ascontiguousarray(which.T)  # as in _blocks()
        around[:, 0, rows] = boxes[:, 0].take(across, axis=1).min(axis=1)
        around[:, 1, rows] = boxes[:, 1].take(across, axis=1).max(axis=1)
        triangle = which if member is None else member.take(which)
        a, b, c = (corner.take(triangle) for corner in corners)
        ee, ff = np.zeros(which.shape), np.zeros(which.shape)
        for name, column in zip("xyz", columns, strict=True):
            start = column.take(a)
            e, f = column.take(b) - start, column.take(c) - start
            ee += e * e
            ff += f * f
            part[f"a{name}"], part[f"e{name}"], part[f"f{name}"] = start, e, f
        slack = _above(SLACK * (np.sqrt(ee) + np.sqrt(ff)) + 2.0**-48)
        empty = slots < 0
        part["slack"] = np.where(empty, np.float32(-1), slack)
        part["index"] = np.where(empty, -1, triangle + triangles.first)

    if patches:
        blockwise(patches, fill, CHUNK // WIDTH)
    return patch, around


def _above(x: Array) -> Floats:
    """float32 numbers >= x, and >= what x was before one operation rounded it to double. They are 2 ulp more at most.

    That rounding changed x by 2^-53 of itself, and the one to float32 by 2^-24 of itself or 2^-150.
    """
    return (x + (np.abs(x) * 2.0**-23 + 2.0**-149)).astype(np.float32)


def _nodes(boxes: Floats, first: int) -> NDArray[np.void]:
    """The nodes over leaves, from the root down. boxes: (3, 2, m), of the leaves; first: the index of the first leaf.

    Indices of nodes count from the root.
    """
    counts = [boxes.shape[2]]
    while len(counts) < 2 or counts[-1] > 1:
        counts.append(max(1, -(-counts[-1] // WIDTH)))
    node, end = np.zeros(sum(counts[1:]), NODE_TYPE), sum(counts[1:])
    for level, (below, count) in enumerate(pairwise(counts)):
        part, sides = node[end - count : end], np.empty((3, 2, count * WIDTH), np.float32)
        sides[:, 0], sides[:, 1] = np.inf, -np.inf
        sides[:, :, :below] = boxes
        sides = sides.reshape(3, 2, count, WIDTH)
        for name, side in zip(SIDES, sides.reshape(6, count, WIDTH), strict=True):
            part[name] = side
        child = np.zeros(count * WIDTH, np.int32)
        child[:below] = np.arange(end, end + below) if level else ~np.arange(first, first + below)
        part["child"] = child.reshape(-1, WIDTH)
        boxes = np.stack([sides[:, 0].min(axis=2), sides[:, 1].max(axis=2)], axis=1)
        end -= count
    return node


def _joined(trees: list[NDArray[np.void]]) -> NDArray[np.void]:
    """The nodes of several trees, eight at most, as those of one. The others go into the first one's root if it can."""
    root, others = trees[0][:1], trees[1:]
    free = np.flatnonzero(root["low_x"][0] > root["high_x"][0])
    if len(free) < len(others):
        root, others, free = _nodes(np.zeros((3, 2, 0), np.float32), 0), trees, np.arange(WIDTH)
        trees = [root]
    parts, first = [trees[0]], len(trees[0])
    for slot, tree in zip(free, others, strict=False):
        for low, high in zip(SIDES[::2], SIDES[1::2], strict=True):
            root[low][0, slot], root[high][0, slot] = tree[low][0].min(), tree[high][0].max()
        if np.count_nonzero(tree["low_x"][0] <= tree["high_x"][0]) == 1:
            root["child"][0, slot] = tree["child"][0, 0]
        else:
            root["child"][0, slot] = first
            tree["child"][tree["child"] > 0] += first
            parts.append(tree)
            first += len(tree)
    return np.concatenate(parts)


NO_TREE = BoxTree(*(np.zeros(0, kind) for kind in (NODE_TYPE, BLOCK_TYPE, PATCH_TYPE)))


@dataclass(frozen=True)
class Paths:
    """n spheres and m triangles for rays that may start anywhere among them. No camera changes it.

    middle: (3,), a point in the world, scene units; exponent: a length in scene units, times 2^exponent, is in the
    tree's unit; widen: what the tree's radii are larger or smaller by, in its unit; tree: of the surfaces that can be
    met, NO_TREE where no ray leaves any.
    """

    middle: Array
    exponent: int
    widen: float
    tree: BoxTree

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
        tree = NO_TREE
        if member is not None:
            index = None if member.all() else np.flatnonzero(member).astype(np.int32)
            large = outer * unit
            small = large if inner is outer else inner * unit
            balls = Balls((center - middle) * unit, outer=large, inner=small, widen=widen, member=index)
            tree = build_tree(balls, Faces((vertex - middle) * unit, face, len(center), vertex))
        return cls(middle, exponent, widen, tree)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The kernel's buffers by name."""
        return {"node": self.tree.node, "block": self.tree.block, "patch": self.tree.patch}

    def values(self, camera: AnyCamera, exponent: int | None) -> dict[str, Any]:
        """The kernel's arguments by name. exponent: of the float buffers, where `real` is float; else None."""
        middle, eye = (
            (*self.middle.tolist(), math.ldexp(1.0, self.exponent)),
            self.moved(np.array(camera.position), exponent),
        )
        if exponent is not None:
            # What is too small for float32, seen from so far, is a point there in any unit.
            middle = (0.0, 0.0, 0.0, math.ldexp(1.0, min(self.exponent - exponent, 127)))
        counts = {"blocks": len(self.tree.block), "patches": len(self.tree.patch)}
        return {"middle": middle, "widen": self.widen, **counts, "eye": (*eye.tolist(), 0.0)}

    def moved(self, points: Array, exponent: int | None) -> Array:
        """Points of the world as the kernel has them, in single from the scene's middle. exponent: as in values()."""
        return points if exponent is None else np.ldexp(points - self.middle, exponent)


# For scenes without rays that may start anywhere.
NO_PATHS = Paths(np.zeros(3), 0, 0.0, NO_TREE)
