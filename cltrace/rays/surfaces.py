"""The surfaces of a scene, and a tree of boxes around them."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats
from cltrace.plan.accel.bvh import SIDES, WIDTH, Tree
from cltrace.plan.paths import Paths
from cltrace.rays.doubles import Met
from cltrace.rays.fine import Ends
from cltrace.rays.lines import Ids, Lines
from cltrace.rays.shapes.shape import Shape
from cltrace.rays.shapes.table import SHAPES
from cltrace.rays.whole import Roots, WholeRays
from cltrace.scene import Scene

# What all shapes have, and how the tree has them.
NUMBERS, PLACES = ("number", "primitive"), ("center", "outer", "vertex")


class Surfaces:
    """The surfaces of a scene, each of which is a primitive: those of one shape after those of the other.

    number: (n,), of the surface; primitive: (n,), of the triangle in its mesh, -1 otherwise; rank: (n,), by which of
    two equally near ones the lower is met. middle: (3,), and size: all is within that distance of it; nodes: of the
    tree. meet(), ends() and roots() ask each pair's shape, see Shape.
    """

    def __init__(self, scene: Scene) -> None:
        self.shapes: list[Shape] = []
        for kind in SHAPES:
            self.shapes.append(kind(scene, sum(map(len, self.shapes))))
        self.number, self.primitive = (np.concatenate([getattr(s, name) for s in self.shapes]) for name in NUMBERS)
        self.rank = (self.number << 32) + self.primitive
        center, outer, vertex = (np.concatenate([getattr(s, name) for s in self.shapes]) for name in PLACES)
        face = self.shapes[-1].face  # no other shape has any
        paths = Paths.of(center, outer, outer, np.ones(len(center), bool), vertex=vertex, face=face)
        assert paths.tree is not None
        self.middle, self.size = paths.middle, 2.0**-paths.exponent
        self.nodes = Nodes.of(paths.tree, paths.exponent, center=center, outer=outer, vertex=vertex, face=face)

    def parts(self, primitive: Ids) -> Iterator[tuple[Shape, Ids]]:
        """The shapes that some of these primitives have, and the rows of these; -1 has none."""
        for shape in self.shapes:
            rows = np.flatnonzero((primitive >= shape.first) & (primitive < shape.first + len(shape)))
            if len(rows):
                yield shape, rows

    def meet(self, lines: Lines, ray: Ids, primitive: Ids) -> Met:
        with np.errstate(all="ignore"):  # what is not finite is not sure
            return Met.all([shape.meet(lines, ray[i], primitive[i]) for shape, i in self.parts(primitive)])

    def ends(self, lines: Lines, ray: Ids, primitive: Ids) -> Iterator[tuple[Ids, Ends]]:
        """For each shape, the rows of its pairs and their Ends."""
        for shape, rows in self.parts(primitive):
            with np.errstate(all="ignore"):  # what is not finite is not sure
                found = shape.ends(lines, ray[rows], primitive[rows])
            yield rows, found

    def roots(self, lines: Lines, ray: Ids, primitive: Ids) -> tuple[Roots, int]:
        """In the unit 2^shift, which is the second answer."""
        parts = list(self.parts(primitive))
        rays = WholeRays.of(lines, ray, [x for shape, rows in parts for x in shape.lengths(primitive[rows])])
        found = [shape.roots(rays.at(rows), primitive[rows]) for shape, rows in parts]
        back = np.argsort(np.concatenate([rows for _, rows in parts]))
        return Roots._make(np.concatenate(x, axis=-1) for x in zip(*found, strict=True)).at(back), rays.shift


@dataclass(frozen=True, eq=False)
class Nodes:
    """The tree of plan/accel/bvh.py in arrays, of which numpy is quick to gather rows.

    sides: (6, nodes, 8) float32, of the children's boxes, from the surfaces' middle, times 2^exponent; child: (nodes,
    8), a node, or ~ a leaf, 0 for none; depth: how many nodes a walk may have to come back to. Leaves are `blocks` of
    balls, then those of triangles; slots: (leaves, 8), the primitives in them, -1 for none. balls: (4,
    blocks, 8), centres and outer radii; patches: (11, leaves - blocks, 8), corners, both edges from there, and the sum
    and the product of the edges' sizes.
    """

    exponent: int
    sides: NDArray[np.float32]
    child: NDArray[np.int32]
    depth: int
    blocks: int
    slots: NDArray[np.int32]
    balls: Floats
    patches: Floats

    @classmethod
    def of(
        cls, tree: Tree, exponent: int, center: Floats, outer: Floats, vertex: Floats, face: NDArray[np.int32]
    ) -> Nodes:
        slots = np.concatenate([tree.block["index"], tree.patch["index"]])
        # Empty slots get any one, and are left out when they are found.
        balls, triangles = np.maximum(tree.block["index"], 0), np.maximum(tree.patch["index"] - len(center), 0)
        spheres = np.stack([*(center[balls, i] for i in range(3)), outer[balls]]) if len(balls) else np.empty((4, 0, 8))
        patches = np.empty((11, len(triangles), WIDTH))
        if len(triangles):
            for i in range(3):
                a, b, c = (vertex[:, i].take(face[:, k]).take(triangles) for k in range(3))
                patches[i], patches[3 + i], patches[6 + i] = a, b - a, c - a
            g, h = np.abs(patches[3:6]).sum(axis=0), np.abs(patches[6:9]).sum(axis=0)
            patches[9], patches[10] = g + h, g * h
        sides = np.stack([tree.node[name] for name in SIDES])
        levels = int(np.ceil(np.log2(max(2, len(slots))) / 3)) + 2
        return cls(
            exponent,
            sides,
            tree.node["child"].copy(),
            WIDTH * levels,
            blocks=len(tree.block),
            slots=slots,
            balls=spheres,
            patches=patches,
        )


_known: weakref.WeakKeyDictionary[Scene, Surfaces] = weakref.WeakKeyDictionary()
_lock = threading.Lock()


def surfaces_of(scene: Scene) -> Surfaces:
    """The same for the same scene, as long as it lives: a tree of a million surfaces takes a second."""
    with _lock:
        if scene not in _known:
            _known[scene] = Surfaces(scene)
        return _known[scene]
