"""The tree of boxes by itself, without a device: it holds every shape once, and a ray that meets one gets to it.

The boxes are tested here as the kernel tests them, in float32.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from cltrace.base.arithmetic import two_sum
from cltrace.plan.accel.tree import Balls, BoxTree, Faces, Paths, build_tree

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
f32 = np.float32

# Entries of the kernel's stack. A node leaves all of its children but one there, and goes on with that one.
STACK = 64


WIDEN = 24 * 2.0**-24


def balls(center: object, radius: object = 0.01, inner: object = None) -> Balls:
    c = np.asarray(center, float).reshape(-1, 3)
    r = np.broadcast_to(np.asarray(radius, float), len(c)).copy()
    return Balls(c, r, r if inner is None else np.broadcast_to(np.asarray(inner, float), len(c)).copy(), WIDEN)


def rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def cloud(n: int, seed: int = 1) -> Balls:
    r = rng(seed)
    return balls(r.uniform(-1, 1, (n, 3)), r.uniform(0.1, 0.6, n) * n ** (-1 / 3))


def mixed(n: int) -> Balls:
    """Radii from a thousandth of the typical distance to a hundred times as much."""
    r = rng(3)
    return balls(r.uniform(-1, 1, (n, 3)), n ** (-1 / 3) * 10 ** r.uniform(-3, 2, n))


def ground(n: int) -> Balls:
    """Small spheres that lie on a huge one."""
    r = rng(4)
    center = np.stack([r.uniform(-1e-3, 1e-3, n), np.full(n, 5e-6), r.uniform(-1e-3, 1e-3, n)], axis=1)
    return balls(np.concatenate([center, [[0, -1, 0]]]), [5e-6] * n + [1])


def sizes(n: int) -> Balls:
    """Among the largest m of them, half are larger than twice the distance of neighbours, for every m."""
    return balls(rng(13).uniform(-1, 1, (n, 3)), 1.95 * (4 / np.arange(1, n + 1)) ** (1 / 3))


def thin(n: int) -> Balls:
    """The surfaces of ellipsoids, between spheres of different radii, in no box of their own centres."""
    r = rng(5)
    outer = r.uniform(0.1, 0.6, n) * n ** (-1 / 3)
    return balls(r.uniform(-1, 1, (n, 3)), outer, outer * r.uniform(0, 1, n))


CASES = {
    "none": balls([]),
    "one": balls([0.5, -0.25, 0.1]),
    "two": balls([[0.5, -0.25, 0.1], [-0.5, 0, 0]], [0.3, 0.1]),
    "nine": cloud(9),
    "65": cloud(65),
    "1000": cloud(1000),
    "5000": cloud(5000),
    "mixed": mixed(3000),
    "ground": ground(2000),
    "sizes": sizes(4000),
    "thin": thin(700),
    "equal": balls(np.full((700, 3), 1 / 3)),
    "equal centres": balls(np.full((700, 3), 1 / 3), rng(6).uniform(1e-6, 0.5, 700)),
    "diagonal": balls(np.linspace(-1, 1, 600)[:, None] * np.array([1, -1, 1])),
    "close, and one far away": balls(np.concatenate([rng(7).uniform(0, 1e-30, (300, 3)), [[1, 1, -1]]]), 1e-32),
    "below float32": balls(rng(8).uniform(-1, 1, (300, 3)) * 1e-44, 1e-46),
    "tiny": balls(rng(8).uniform(-1, 1, (300, 3)), 1e-60),
    "no inside": balls(rng(9).uniform(-1, 1, (300, 3)), 1e-3, 0),
}


def mesh(corners: Floats, first: int = 0) -> Faces:
    """corners: (m, 3, 3), of which equal ones are one vertex."""
    vertex, face = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return Faces(vertex, face.reshape(-1, 3).astype(np.int32), first, vertex)


def soup(n: int, size: float, seed: int = 21) -> Floats:
    r = rng(seed)
    return np.clip(r.uniform(-0.5, 0.5, (n, 1, 3)) + r.normal(size=(n, 3, 3)) * size, -0.57, 0.57)


def needles(n: int, thin: float) -> Floats:
    """Slivers of a length of about 0.2, with a side of `thin` of that."""
    r = rng(22)
    start = r.uniform(-0.45, 0.45, (n, 3))
    along = r.normal(size=(n, 3)) * 0.1
    aside = np.cross(along, r.normal(size=(n, 3))) * thin
    return np.stack([start, start + along, start + along + aside], axis=1)


def sheet(side: int, height: float = 0.0) -> Floats:
    """2 side^2 triangles in a plane, or nearly so."""
    axis = np.linspace(-0.5, 0.5, side + 1)
    x, z = np.meshgrid(axis, axis, indexing="ij")
    p = np.stack([x, height * rng(23).normal(size=x.shape), z], axis=-1)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    return np.concatenate(
        [np.stack([a, b, c], axis=2).reshape(-1, 3, 3), np.stack([a, c, d], axis=2).reshape(-1, 3, 3)]
    )


MESHES = {
    "one": soup(1, 0.2),
    "nine": soup(9, 0.1),
    "300": soup(300, 0.1),
    "3000": soup(3000, 0.02),
    "needles": needles(1000, 0.02),
    "slivers": needles(300, 1e-7),
    "lines": needles(300, 0) + np.array([[0], [0], [1]]) * (needles(300, 0)[:, 1:2] - needles(300, 0)[:, :1]),
    "sheet": sheet(20),
    "rough sheet": sheet(20, 0.01),
    # Small ones among a few that are as large as everything.
    "huge": np.concatenate([soup(1000, 0.005), soup(5, 0.4, 24)]),
    "twice": np.repeat(soup(200, 0.05), 2, axis=0),
    "equal": np.repeat(soup(1, 0.2), 100, axis=0),
    "tiny": soup(300, 1e-9),
    "below float32": soup(300, 1e-3) * 1e-42,
}


NO_BALLS, NO_FACES = balls(np.zeros((0, 3))), mesh(np.zeros((0, 3, 3)))
SCENES = {name: (scene, NO_FACES) for name, scene in CASES.items()}
SCENES |= {name: (NO_BALLS, mesh(corners, 7)) for name, corners in MESHES.items()}
SCENES |= {
    f"{scene} and {flat}": (CASES[scene], mesh(MESHES[flat], len(CASES[scene].outer)))
    for scene, flat in (("one", "one"), ("1000", "300"), ("mixed", "huge"), ("sizes", "needles"), ("ground", "sheet"))
}
each = pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)


def corners_of(faces: Faces) -> Floats:
    return np.asarray(faces.vertex[faces.face])


def children(tree: BoxTree, node: int) -> Iterator[tuple[int, int]]:
    """The slots of a node that are filled, and what is there."""
    for slot in range(8):
        if tree.node["low_x"][node, slot] <= tree.node["high_x"][node, slot]:
            yield slot, int(tree.node["child"][node, slot])


def leaf_index(tree: BoxTree, child: int) -> Ints:
    """The primitives of a leaf."""
    blocks = len(tree.block)
    index: Ints = tree.block["index"][~child] if ~child < blocks else tree.patch["index"][~child - blocks]
    return index[index >= 0]


def primitives_below(tree: BoxTree) -> dict[tuple[int, int], list[int]]:
    """For each child of each node, as (node, slot), the indices of all primitives in it."""
    found: dict[tuple[int, int], list[int]] = {}

    def visit(node: int) -> list[int]:
        for slot, child in children(tree, node):
            found[node, slot] = leaf_index(tree, child).tolist() if child < 0 else visit(child)
        return [i for slot, _ in children(tree, node) for i in found[node, slot]]

    visit(0)
    return found


def stack_needed(tree: BoxTree, node: int = 0) -> int:
    """The most entries that a walk may have on its stack, whatever its order."""
    below = [stack_needed(tree, child) if child >= 0 else 0 for _, child in children(tree, node)]
    return len(below) - 1 + max(below) if below else 0


@each
def test_everything_is_in_the_tree_once(scene: tuple[Balls, Faces]) -> None:
    """Below one child of the root; missing children are empty, and a walk has room for what it keeps.

    One level more than the number of spheres asks for is for a root that joins trees of large and small ones.
    """
    spheres, faces = scene
    tree, n, m = build_tree(spheres, faces), len(spheres.outer), len(faces.face)
    below = primitives_below(tree)
    found = [i for slot, _ in children(tree, 0) for i in below[0, slot]]
    assert sorted(found) == [*range(n), *range(faces.first, faces.first + m)]
    assert (tree.block["outer"][tree.block["index"] < 0] == -1).all()
    assert (tree.patch["slack"][tree.patch["index"] < 0] == -1).all()
    missing = ~(tree.node["low_x"] <= tree.node["high_x"])
    for axis in "xyz":
        assert (tree.node[f"low_{axis}"][missing] == np.inf).all()
        assert (tree.node[f"high_{axis}"][missing] == -np.inf).all()
    assert (tree.node["child"][missing] == 0).all()
    assert stack_needed(tree) <= STACK
    assert m or stack_needed(tree) <= 7 * (levels(n) + 1)
    assert 7 * (levels(2**26) + 1) <= STACK


def test_members_alone_are_entered() -> None:
    scene, member = CASES["1000"], np.flatnonzero(rng(10).random(1000) < 0.3).astype(np.int32)
    index = build_tree(scene._replace(member=member), NO_FACES).block["index"]
    assert sorted(index[index >= 0].tolist()) == member.tolist()


@each
def test_boxes_hold_what_is_below_them(scene: tuple[Balls, Faces]) -> None:
    """In exact arithmetic: the sum of two_sum()'s two numbers is not rounded."""
    spheres, faces = scene
    tree, n, corner = build_tree(spheres, faces), len(spheres.outer), corners_of(faces)
    least, rest = two_sum(spheres.center, -spheres.outer[:, None])
    most, more = two_sum(spheres.center, spheres.outer[:, None])
    for (node, slot), index in primitives_below(tree).items():
        which, record = np.array(index), tree.node[node]
        ball, flat = which[which < n], which[which >= n] - faces.first
        for j, axis in enumerate("xyz"):
            low, high = record[f"low_{axis}"][slot], record[f"high_{axis}"][slot]
            assert ((least[ball, j] > low) | (least[ball, j] == low) & (rest[ball, j] >= 0)).all()
            assert ((most[ball, j] < high) | (most[ball, j] == high) & (more[ball, j] <= 0)).all()
            assert (corner[flat, :, j] >= low).all()
            assert (corner[flat, :, j] <= high).all()


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_blocks_hold_the_surfaces(case: Balls) -> None:
    """Between outer and inner, as float32 numbers and wider by what was asked for."""
    block = build_tree(case, NO_FACES).block
    index = block["index"][block["index"] >= 0]
    row = {name: block[name][block["index"] >= 0] for name in ("x", "y", "z", "outer", "inner")}
    for j, axis in enumerate("xyz"):
        np.testing.assert_array_equal(row[axis], case.center[index, j].astype(f32))
    outer, inner = case.outer[index] + WIDEN, np.maximum(case.inner[index] - WIDEN, 0)
    assert (row["outer"] >= outer).all()
    assert (row["outer"] <= outer * (1 + 2.0**-22)).all()
    assert (row["inner"] <= inner).all()
    assert (row["inner"] >= inner * (1 - 2.0**-22)).all()


def test_triangles_of_two_corners_are_left_out() -> None:
    corners = soup(100, 0.1)
    corners[::3, 2] = corners[::3, 0]
    corners[1::9, 1] = corners[1::9, 2]
    kept = [i for i in range(100) if i % 3 and i % 9 != 1]
    index = build_tree(NO_BALLS, mesh(corners)).patch["index"]
    assert sorted(index[index >= 0].tolist()) == kept
    nothing = build_tree(NO_BALLS, mesh(corners[::3]))
    assert len(nothing.node) == 1
    assert not list(children(nothing, 0))
    assert not len(nothing.patch)


@pytest.mark.parametrize("triangles", [mesh(corners, 7) for corners in MESHES.values()], ids=MESHES)
def test_patches_hold_triangles(triangles: Faces) -> None:
    patch = build_tree(NO_BALLS, triangles).patch
    filled = patch["index"] >= 0
    a, b, c = triangles.vertex[triangles.face[patch["index"][filled] - 7]].transpose(1, 2, 0)
    for j, axis in enumerate("xyz"):
        np.testing.assert_array_equal(patch[f"a{axis}"][filled], a[j].astype(f32))
        np.testing.assert_array_equal(patch[f"e{axis}"][filled], (b[j] - a[j]).astype(f32))
        np.testing.assert_array_equal(patch[f"f{axis}"][filled], (c[j] - a[j]).astype(f32))
    assert (
        patch["slack"][filled] >= 40 * 2.0**-24 * (np.linalg.norm(b - a, axis=0) + np.linalg.norm(c - a, axis=0))
    ).all()


def levels(n: int) -> int:
    """Of the nodes over n spheres: ceil(log8(n / 8)), one at least."""
    return max(1, -(-max(-(-n // 8) - 1, 0).bit_length() // 3))


def test_large_spheres_are_apart_from_small_ones() -> None:
    """Else the boxes above a large one would all be as large, and a ray would look at many small ones near those."""
    scene = CASES["ground"]
    tree = build_tree(scene, NO_FACES)
    huge = len(scene.outer) - 1
    index = tree.block["index"][(tree.block["index"] == huge).any(axis=1)]
    assert index[index >= 0].tolist() == [huge]
    sizes = tree.node["high_x"] - tree.node["low_x"]
    assert (sizes > 0.01).sum() == 1


def reached(tree: BoxTree, origin: Floats, d: Floats, reach: float) -> set[int]:
    """The spheres in the blocks that a ray gets to: a walk without an order, as the kernel tests boxes."""
    least = 1e-18 * np.abs(d).max()
    rd = (1 / np.where(np.abs(d) < least, np.copysign(least, d), d)).astype(f32)
    o = origin.astype(f32)
    pad = np.copysign(f32(2.0**-22) * np.abs(o) + f32(2.0**-50), rd)
    found: set[int] = set()
    todo = [0]
    while todo:
        record = tree.node[todo.pop()]
        low = np.stack([record[f"low_{axis}"] for axis in "xyz"])
        high = np.stack([record[f"high_{axis}"] for axis in "xyz"])
        positive = (rd > 0)[:, None]
        near = ((np.where(positive, low, high) - (o + pad)[:, None]) * rd[:, None]).max(axis=0)
        far = ((np.where(positive, high, low) - (o - pad)[:, None]) * rd[:, None]).min(axis=0)
        near = np.maximum(near, f32(0))
        for slot in np.flatnonzero((near <= far * f32(1 + 2.0**-20)) & (near <= reach)):
            child = int(record["child"][slot])
            if child < 0:
                found.update(leaf_index(tree, child).tolist())
            else:
                todo.append(child)
    return found


def aimed(spheres: Balls, faces: Faces, count: int) -> Iterator[tuple[int, Floats, Floats, float]]:
    """Rays to points of spheres, of triangles, their edges and corners: which one, origin, direction and the distance
    in units of that. They come from anywhere, from other surfaces, or along an axis, and many graze."""
    r, n, corner = rng(11), len(spheres.outer), corners_of(faces)

    def point(i: int) -> Floats:
        if i < n:
            away = r.normal(size=3)
            return np.asarray(spheres.center[i] + spheres.outer[i] * (1 - 2.0**-40) * away / np.linalg.norm(away))
        weight = r.dirichlet((1, 1, 1)) * r.choice([1, 1e-7, 0], 3, p=[0.7, 0.2, 0.1]) + 1e-300
        return np.asarray(weight @ corner[i - n] / weight.sum())

    for k in range(count):
        i, j = r.integers(n + len(corner), size=2).tolist()
        start = point(j) if k % 3 else r.uniform(-1.5, 1.5, 3)
        aim = point(i)
        if i < n and k % 2 and (aside := np.linalg.norm(out := np.cross(aim, spheres.center[i] - start))) > 0:
            aim = spheres.center[i] + out * (spheres.outer[i] * (1 - 10 ** -r.uniform(0.1, 9)) / aside)
        if k % 4 == 0:
            start = aim + np.eye(3)[r.integers(3)] * r.uniform(-1, 1)
        scale, length = 10 ** r.uniform(-3, 3), float(np.linalg.norm(aim - start))
        if length:
            yield i if i < n else i - n + faces.first, start, (aim - start) * (scale / length), length / scale


@each
def test_a_ray_gets_to_what_it_meets(scene: tuple[Balls, Faces]) -> None:
    tree = build_tree(*scene)
    if len(scene[0].outer) + len(scene[1].face):
        for i, origin, d, t in aimed(*scene, 300):
            assert i in reached(tree, origin, d, t * (1 + 2.0**-20))


def test_a_ray_is_spared_most_of_the_tree() -> None:
    tree = build_tree(CASES["5000"], NO_FACES)
    counts = [len(reached(tree, origin, d, t)) for _, origin, d, t in aimed(CASES["5000"], NO_FACES, 200)]
    assert np.mean(counts) < 66  # what was measured and 3 % more


def test_corners_that_rounding_makes_one() -> None:
    """A triangle that is tiny beside its distance from the others is in the tree, and a ray through it finds it."""
    place = np.array([1e8, 2e8, -3e8])
    vertex = np.array([(0, 0, 0), (1e-9, 0, 0), (0, 1e-9, 0), *(place + np.eye(3)), (5, 5, 5), (5, 5, 5), (6, 5, 5)])
    face = np.arange(9, dtype=np.int32).reshape(3, 3)
    paths = Paths.of(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, bool), vertex, face)
    # The last one has two corners in one place, and is in no patch.
    assert sorted(paths.tree.patch["index"][paths.tree.patch["index"] >= 0].tolist()) == [0, 1]
    slack = paths.tree.patch["slack"][paths.tree.patch["index"] == 0]
    assert (slack > 2.0**-50).all()
