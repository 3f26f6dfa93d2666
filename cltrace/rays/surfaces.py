"""The surfaces of a scene, as arrays in the world, and a tree of boxes around them."""

from __future__ import annotations

import threading
import weakref
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.numbers.inverses import inverses
from cltrace.numbers.pairs import Floats
from cltrace.plan.accel.bvh import SIDES, WIDTH, Tree
from cltrace.plan.paths import Paths
from cltrace.scene import Scene

Bools = NDArray[np.bool_]
Ids = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surfaces:
    """n spheres and ellipsoids, which are the primitives 0 to n - 1, p cylinders, which follow, and m triangles.

    center: (n, 3); radius: (n,); bent: (n,), the index in `maps` of an ellipsoid's, -1 for a sphere; maps: (k, 3, 3),
    from the world to an ellipsoid's own axes; stretch, reach: (n,), bounds of what that map, and its inverse, make of a
    length; vertex: (v, 3); face: (m, 3). start, end: (p, 3), and rod_radius: (p,), of
    cylinders. number: (n + p + m,), of the surface; primitive: (n + p + m,), of the triangle in its mesh, -1
    otherwise; rank: (n + p + m,), by which of two equally near ones the lower is met.

    middle: (3,), and size: all is within that distance of it; nodes: of the tree.
    """

    center: Floats
    radius: Floats
    bent: Ids
    maps: Floats
    stretch: Floats
    reach: Floats
    vertex: Floats
    face: NDArray[np.int32]
    start: Floats
    end: Floats
    rod_radius: Floats
    number: Ids
    primitive: Ids
    rank: Ids
    middle: Floats
    size: float
    nodes: Nodes

    @classmethod
    def of(cls, scene: Scene) -> Surfaces:
        spheres, counts = scene.spheres, [len(mesh.geometry.faces) for mesh in scene.meshes]
        bent, first = spheres["to_object"].astype(np.int64), np.cumsum([0, *(len(m.vertices) for m in scene.meshes)])
        faces = [mesh.geometry.faces + np.int32(k) for mesh, k in zip(scene.meshes, first, strict=False)]
        vertex = np.concatenate([np.empty((0, 3)), *(mesh.vertices for mesh in scene.meshes)])
        face = np.concatenate([np.empty((0, 3), np.int32), *faces]).astype(np.int32)
        sizes = (np.linalg.norm(m, 2, axis=(1, 2)) for m in (scene.to_object, inverses(scene.to_object)))
        stretch, reach = (np.append(size * (1 + 2.0**-40), 1)[bent] for size in sizes)
        rods, of_faces = scene.cylinders, np.repeat([mesh.number for mesh in scene.meshes], counts)
        number = np.concatenate([scene.sphere_numbers, rods["number"], of_faces])
        primitive = np.concatenate([np.full(len(spheres) + len(rods), -1), *map(np.arange, counts)])
        # Around each cylinder is a ball.
        half = rods["end"] / 2 - rods["start"] / 2
        around = (np.sqrt((half * half).sum(axis=1)) + rods["radius"]) * (1 + 2.0**-40)
        center = np.concatenate([spheres["center"], rods["start"] / 2 + rods["end"] / 2])
        outer = np.concatenate([spheres["radius"] * reach, around])
        paths = Paths.of(center, outer, outer, np.ones(len(center), bool), vertex=vertex, face=face)
        assert paths.tree is not None
        return cls(
            center=center[: len(spheres)],
            radius=np.ascontiguousarray(spheres["radius"]),
            bent=bent,
            maps=scene.to_object,
            stretch=stretch,
            reach=reach,
            vertex=vertex,
            face=face,
            start=np.ascontiguousarray(rods["start"]),
            end=np.ascontiguousarray(rods["end"]),
            rod_radius=np.ascontiguousarray(rods["radius"]),
            number=number.astype(np.int64),
            primitive=primitive.astype(np.int64),
            rank=(number.astype(np.int64) << 32) + primitive,
            middle=paths.middle,
            size=2.0**-paths.exponent,
            nodes=Nodes.of(paths.tree, paths.exponent, center=center, outer=outer, vertex=vertex, face=face),
        )

    @property
    def spheres(self) -> int:
        return len(self.radius)

    @property
    def solids(self) -> int:
        """How many primitives come before the triangles."""
        return len(self.radius) + len(self.rod_radius)

    def kinds(self, primitive: Ids) -> tuple[Bools, Bools, Bools]:
        """Which primitives are spheres, cylinders and triangles; none of -1."""
        flat = primitive >= self.solids
        rods = (primitive >= self.spheres) & ~flat
        return (primitive >= 0) & ~flat & ~rods, rods, flat


@dataclass(frozen=True, eq=False)
class Nodes:
    """The tree of plan/accel/bvh.py in arrays, of which numpy is quick to gather rows.

    sides: (6, nodes, 8) float32, of the children's boxes, from the surfaces' middle, times 2^exponent; child: (nodes,
    8), a node, or ~ a leaf, 0 for none; depth: how many nodes a walk may have to come back to. Leaves are `blocks` of
    spheres and cylinders, then those of triangles; slots: (leaves, 8), the primitives in them, -1 for none. balls: (4,
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
            _known[scene] = Surfaces.of(scene)
        return _known[scene]
