"""The tree of boxes by itself, without a device: it holds every shape once, and a ray that meets one gets to it.

The boxes are tested here as the kernel tests them, in float32.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray

from cltrace.base.arithmetic import two_sum
from cltrace.plan.accel import tree as boxes
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


def shell(n: int) -> Balls:
    r = rng(2)
    d = r.normal(size=(n, 3))
    return balls(d / np.linalg.norm(d, axis=1, keepdims=True), r.uniform(0.5, 1.5, n) / np.sqrt(n))


def grid(side: int) -> Balls:
    axis = (np.arange(side) + 0.5) / side * 2 - 1
    return balls(np.stack(np.meshgrid(axis, axis, axis), axis=-1), 0.8 / side)


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
    "eight": cloud(8),
    "nine": cloud(9),
    "64": cloud(64),
    "65": cloud(65),
    "1000": cloud(1000),
    "5000": cloud(5000),
    "shell": shell(3000),
    "grid": grid(12),
    "mixed": mixed(3000),
    "ground": ground(2000),
    "sizes": sizes(4000),
    "thin": thin(700),
    "equal": balls(np.full((700, 3), 1 / 3)),
    "equal centres": balls(np.full((700, 3), 1 / 3), rng(6).uniform(1e-6, 0.5, 700)),
    "line": balls(np.linspace(-1, 1, 600)[:, None] * np.array([1, 0, 0])),
    "diagonal": balls(np.linspace(-1, 1, 600)[:, None] * np.array([1, -1, 1])),
    "close, and one far away": balls(np.concatenate([rng(7).uniform(0, 1e-30, (300, 3)), [[1, 1, -1]]]), 1e-32),
    "below float32": balls(rng(8).uniform(-1, 1, (300, 3)) * 1e-44, 1e-46),
    "tiny": balls(rng(8).uniform(-1, 1, (300, 3)), 1e-60),
    "no inside": balls(rng(9).uniform(-1, 1, (300, 3)), 1e-3, 0),
}


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest) -> Balls:
    return CASES[request.param]


def children(tree: BoxTree, node: int) -> Iterator[tuple[int, int]]:
    """The slots of a node that are filled, and what is there."""
    for slot in range(8):
        if tree.node["low_x"][node, slot] <= tree.node["high_x"][node, slot]:
            yield slot, int(tree.node["child"][node, slot])


def sides(tree: BoxTree, node: int, slot: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    record = tree.node[node]
    low = np.array([record[f"low_{axis}"][slot] for axis in "xyz"])
    return low, np.array([record[f"high_{axis}"][slot] for axis in "xyz"])


def spheres_below(tree: BoxTree) -> dict[tuple[int, int], Ints]:
    """For each child of each node, as (node, slot), the indices of all spheres in it."""
    found: dict[tuple[int, int], Ints] = {}

    def visit(node: int) -> Ints:
        parts = [np.zeros(0, np.int32)]
        for slot, child in children(tree, node):
            index = tree.block["index"][~child] if child < 0 else visit(child)
            found[node, slot] = index[index >= 0]
            parts.append(found[node, slot])
        return np.concatenate(parts)

    visit(0)
    return found


def stack_needed(tree: BoxTree, node: int = 0) -> int:
    """The most entries that a walk may have on its stack, whatever its order."""
    below = [stack_needed(tree, child) if child >= 0 else 0 for _, child in children(tree, node)]
    return len(below) - 1 + max(below) if below else 0


def test_a_tree_of_spheres(case: Balls) -> None:
    """Every sphere is in one slot, and below one child of the root; missing children are empty.

    One level more than the number of spheres asks for is for a root that joins trees of large and small ones.
    """
    tree, everything = build_tree(case), list(range(len(case.outer)))
    index = tree.block["index"]
    assert sorted(index[index >= 0].tolist()) == everything
    assert (tree.block["outer"][index < 0] == -1).all()
    below = spheres_below(tree)
    found = np.concatenate([np.zeros(0, np.int32), *(below[0, slot] for slot, _ in children(tree, 0))])
    assert sorted(found.tolist()) == everything
    missing = ~(tree.node["low_x"] <= tree.node["high_x"])
    for axis in "xyz":
        assert (tree.node[f"low_{axis}"][missing] == np.inf).all()
        assert (tree.node[f"high_{axis}"][missing] == -np.inf).all()
    assert (tree.node["child"][missing] == 0).all()
    assert stack_needed(tree) <= 7 * (levels(len(case.outer)) + 1)
    assert 7 * (levels(2**26) + 1) <= STACK


def test_members_alone_are_entered() -> None:
    scene, member = CASES["1000"], np.flatnonzero(rng(10).random(1000) < 0.3).astype(np.int32)
    index = build_tree(scene._replace(member=member)).block["index"]
    assert sorted(index[index >= 0].tolist()) == member.tolist()


def test_boxes_hold_what_is_below_them(case: Balls) -> None:
    """In exact arithmetic: the sum of two_sum()'s two numbers is not rounded."""
    tree = build_tree(case)
    for (node, slot), index in spheres_below(tree).items():
        low, high = sides(tree, node, slot)
        for j in range(3):
            c, r = case.center[index, j], case.outer[index]
            near, rest = two_sum(c, -r)
            assert ((near > low[j]) | (near == low[j]) & (rest >= 0)).all()
            far, rest = two_sum(c, r)
            assert ((far < high[j]) | (far == high[j]) & (rest <= 0)).all()


def test_boxes_are_tight() -> None:
    """To an ulp of float32, and so a tree is worth its walk."""
    scene = CASES["5000"]
    tree = build_tree(scene)
    for (node, slot), index in spheres_below(tree).items():
        low, high = sides(tree, node, slot)
        c, r = scene.center[index], scene.outer[index, None]
        assert (np.abs((c - r).min(axis=0) - low) <= 2.0**-22).all()
        assert (np.abs((c + r).max(axis=0) - high) <= 2.0**-22).all()


def test_blocks_hold_the_surfaces(case: Balls) -> None:
    """Between outer and inner, as float32 numbers and wider by what was asked for."""
    block = build_tree(case).block
    index = block["index"][block["index"] >= 0]
    row = {name: block[name][block["index"] >= 0] for name in ("x", "y", "z", "outer", "inner")}
    for j, axis in enumerate("xyz"):
        np.testing.assert_array_equal(row[axis], case.center[index, j].astype(f32))
    outer, inner = case.outer[index] + WIDEN, np.maximum(case.inner[index] - WIDEN, 0)
    assert (row["outer"] >= outer).all()
    assert (row["outer"] <= outer * (1 + 2.0**-22)).all()
    assert (row["inner"] <= inner).all()
    assert (row["inner"] >= inner * (1 - 2.0**-22)).all()


def levels(n: int) -> int:
    """Of the nodes over n spheres: ceil(log8(n / 8)), one at least."""
    return max(1, -(-max(-(-n // 8) - 1, 0).bit_length() // 3))


@pytest.mark.parametrize("n", [1, 8, 9, 64, 65, 511, 512, 513, 4096, 4097, 32768, 32769])
def test_levels(n: int) -> None:
    """Spheres of like size are in one tree."""

    def height(node: int) -> int:
        return 1 + max(height(child) if child >= 0 else 0 for _, child in children(tree, node))

    tree = build_tree(cloud(n))
    assert height(0) == levels(n)


def test_a_root_joins_eight_trees_at_most() -> None:
    scene = CASES["sizes"]
    keys = np.concatenate([scene.center.T, 2 * scene.outer[None]]).astype(f32)
    classes = boxes._size_classes(keys, 8)
    assert len(classes) == 8
    assert sorted(np.concatenate(classes).tolist()) == list(range(len(scene.outer)))


def test_boxes_are_small() -> None:
    """They have the surface of cubes, for spheres all over a cube, and 10 % more at most.

    The centres of m spheres in a cube of side s are in a box whose sides are s (m - 1) / (m + 1) on average.
    """
    n = 8**5
    scene = cloud(n)
    tree = build_tree(scene)
    per_node = 8
    for level in range(1, levels(n) + 1):
        nodes = tree.node[: sum(8**k for k in range(levels(n) - level + 1))][-(8 ** (levels(n) - level)) :]
        x, y, z = (nodes[f"high_{axis}"] - nodes[f"low_{axis}"] for axis in "xyz")
        cube = 2 * (per_node / n) ** (1 / 3) * (per_node - 1) / (per_node + 1) + 2 * scene.outer.mean()
        assert (x * y + y * z + z * x).mean() < 1.1 * 3 * cube**2
        per_node *= 8


@pytest.mark.parametrize("places", [2, 7, 5000, 10**6])
def test_halves_are_apart(places: int) -> None:
    """Also where many centres are in one plane."""
    keys = rng(14).integers(0, places, (3, 5000)).astype(f32)
    keys[1] *= 2
    before, order = keys.copy(), np.arange(5000, dtype=np.int32)
    (start, left), (middle, right) = boxes._halve(keys, order, 0, 5000)
    assert (start, left, middle, right) == (0, 4096, 4096, 904)
    assert keys[1, :left].max() <= keys[1, left:].min()
    np.testing.assert_array_equal(before[:, order], keys)


def test_large_spheres_are_apart_from_small_ones() -> None:
    """Else the boxes above a large one would all be as large, and a ray would look at many small ones near those."""
    scene = CASES["ground"]
    tree = build_tree(scene)
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


def aimed(scene: Balls, n: int, seed: int) -> Iterator[tuple[int, Floats, Floats, float]]:
    """Rays that meet a sphere, most of them near its limb: its index, origin, direction and the distance, in |d|."""
    r = rng(seed)
    for k in range(n):
        i = int(r.integers(len(scene.outer)))
        start = r.uniform(-1.5, 1.5, 3)
        if k % 3:  # on another sphere, as secondary rays do
            j = int(r.integers(len(scene.outer)))
            away = r.normal(size=3)
            start = scene.center[j] + scene.outer[j] * away / np.linalg.norm(away)
        w = scene.center[i] - start
        if k % 4 == 0:  # along an axis
            axis = int(r.integers(3))
            start = scene.center[i] - np.eye(3)[axis] * r.choice([-1, 1]) * r.uniform(0, 2)
            w = np.eye(3)[axis] * np.sign(scene.center[i] - start)[axis]
        aside = np.cross(w, r.normal(size=3))
        size = np.linalg.norm(aside)
        rim = scene.outer[i] * (1 - 10 ** -r.uniform(0.1, 9))
        if size > 0 and k % 4:
            w = w + rim * aside / size
        if k % 4 == 0:
            start = start + rim * np.roll(np.abs(w), 1)
        d = w * 10 ** r.uniform(-3, 3)
        f = scene.center[i] - start
        a, b, c = d @ d, f @ d, f @ f - scene.outer[i] ** 2
        cross = np.cross(f, d)
        root = a * scene.outer[i] ** 2 - cross @ cross
        if a > 0 and root > 0 and (b > 0 or c < 0):
            t = c / (b + np.sqrt(root)) if b > 0 else (b + np.sqrt(root)) / a
            yield i, start, d, max(t, (b + np.sqrt(root)) / a if c < 0 else t)


@pytest.mark.parametrize(
    "name", ["two", "nine", "65", "1000", "shell", "grid", "mixed", "ground", "sizes", "thin", "diagonal"]
)
def test_a_ray_gets_to_what_it_meets(name: str) -> None:
    scene, met = CASES[name], 0
    tree = build_tree(scene)
    for i, origin, d, t in aimed(scene, 400, 11):
        assert i in reached(tree, origin, d, np.nextafter(f32(t), f32(np.inf)) * f32(1 + 2.0**-20))
        met += 1
    assert met > 100


def test_a_ray_is_spared_most_of_the_tree() -> None:
    scene = CASES["5000"]
    tree = build_tree(scene)
    counts = [len(reached(tree, origin, d, t)) for _, origin, d, t in aimed(scene, 200, 12)]
    assert np.mean(counts) < 5000 / 20


# ------------------------------------------------------------------------------------------------------------ triangles


def mesh(corners: Floats, first: int = 0) -> Faces:
    """corners: (m, 3, 3), of which equal ones are one vertex."""
    vertex, face = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return Faces(vertex, face.reshape(-1, 3).astype(np.int32), first)


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


def with_huge(n: int) -> Floats:
    """Small ones among a few that are as large as everything."""
    return np.concatenate([soup(n, 0.005), soup(5, 0.4, 24)])


MESHES = {
    "one": soup(1, 0.2),
    "eight": soup(8, 0.1),
    "nine": soup(9, 0.1),
    "300": soup(300, 0.1),
    "3000": soup(3000, 0.02),
    "needles": needles(1000, 0.02),
    "slivers": needles(300, 1e-7),
    "lines": needles(300, 0) + np.array([[0], [0], [1]]) * (needles(300, 0)[:, 1:2] - needles(300, 0)[:, :1]),
    "sheet": sheet(20),
    "rough sheet": sheet(20, 0.01),
    "huge": with_huge(1000),
    "twice": np.repeat(soup(200, 0.05), 2, axis=0),
    "equal": np.repeat(soup(1, 0.2), 100, axis=0),
    "tiny": soup(300, 1e-9),
    "below float32": soup(300, 1e-3) * 1e-42,
}


@pytest.fixture(params=MESHES)
def triangles(request: pytest.FixtureRequest) -> Faces:
    return mesh(MESHES[request.param], first=7)


NO_BALLS = balls(np.zeros((0, 3)))


def leaf_index(tree: BoxTree, child: int) -> Ints:
    """The primitives of a leaf."""
    blocks = len(tree.block)
    index: Ints = tree.block["index"][~child] if ~child < blocks else tree.patch["index"][~child - blocks]
    return index[index >= 0]


def primitives_below(tree: BoxTree) -> dict[tuple[int, int], set[int]]:
    """For each child of each node, as (node, slot), all primitives in it."""
    found: dict[tuple[int, int], set[int]] = {}

    def visit(node: int) -> set[int]:
        every: set[int] = set()
        for slot, child in children(tree, node):
            found[node, slot] = set(leaf_index(tree, child).tolist()) if child < 0 else visit(child)
            every |= found[node, slot]
        return every

    visit(0)
    return found


def test_every_triangle_is_in_the_tree(triangles: Faces) -> None:
    tree, below = build_tree(NO_BALLS, triangles), set[int]()
    found = primitives_below(tree)
    below = below.union(*(found[0, slot] for slot, _ in children(tree, 0)))
    assert below == set(range(7, 7 + len(triangles.face)))
    assert set(tree.patch["index"][tree.patch["index"] >= 0].tolist()) == below
    assert (tree.patch["slack"][tree.patch["index"] < 0] == -1).all()
    assert stack_needed(tree) <= STACK


def test_both_kinds_are_in_one_tree() -> None:
    for scene, flat in (("one", "one"), ("1000", "300"), ("mixed", "huge"), ("sizes", "needles"), ("ground", "sheet")):
        n = len(CASES[scene].outer)
        tree = build_tree(CASES[scene], mesh(MESHES[flat], n))
        found = primitives_below(tree)
        every = set[int]().union(*(found[0, slot] for slot, _ in children(tree, 0)))
        assert every == set(range(n + len(MESHES[flat]))), (scene, flat)


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


def test_boxes_hold_triangles(triangles: Faces) -> None:
    tree = build_tree(NO_BALLS, triangles)
    low = triangles.vertex[triangles.face].min(axis=1)
    high = triangles.vertex[triangles.face].max(axis=1)
    for (node, slot), index in primitives_below(tree).items():
        which = np.array(sorted(index)) - 7
        box_low, box_high = sides(tree, node, slot)
        assert (low[which] >= box_low).all()
        assert (high[which] <= box_high).all()


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


def candidates(patch: NDArray[np.void], o: Floats, w: Floats, reach: float) -> dict[int, tuple[float, float]]:
    """Of a patch, the triangles that a ray may meet, with bounds of the distance: as triangle_add_leaf()."""
    ox, oy, oz = o.astype(f32)
    wx, wy, wz = w.astype(f32)
    (ax, ay, az), (ex, ey, ez), (fx, fy, fz) = ([patch[f"{name}{axis}"] for axis in "xyz"] for name in "aef")
    slack = patch["slack"]
    x, y, z = ax - ox, ay - oy, az - oz
    X, Y, Z = y * wz - z * wy, z * wx - x * wz, x * wy - y * wx
    nx, ny, nz = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
    den = nx * wx + (ny * wy + nz * wz)
    sign = np.where(np.signbit(den), f32(-1), f32(1))
    size = den * sign
    u, v = (fx * X + (fy * Y + fz * Z)) * sign, -(ex * X + (ey * Y + ez * Z)) * sign
    d = (nx * x + (ny * y + nz * z)) * sign
    least = np.minimum(np.minimum(u, v), size - u - v)
    steep = size > slack
    with np.errstate(divide="ignore", invalid="ignore"):
        near = np.where(steep, np.maximum(d - slack, f32(0)) * f32(1 - 2.0**-20) / (size + slack), f32(0))
        may = (least >= -slack) & (~steep | (d >= -slack)) & (near <= reach) & (slack > 0)
        sure = steep & (least > slack) & (d > slack)
        far = np.where(sure, (d + slack) * f32(1 + 2.0**-20) / (size - slack), f32(np.inf))
    return {int(patch["index"][k]): (float(near[k]), float(far[k])) for k in np.flatnonzero(may)}


def exactly_met(corners: Floats, o: Floats, w: Floats) -> Fraction | None:
    """The t > 0 of the ray o + t w where it meets the triangle, its edges included; None: nowhere or all along."""
    a, b, c = (
        [Fraction(x) - Fraction(y) for x, y in zip(corner.tolist(), o.tolist(), strict=True)] for corner in corners
    )
    d = [Fraction(x) for x in w.tolist()]

    def determinant(p: list[Fraction], q: list[Fraction], r: list[Fraction]) -> Fraction:
        return (
            p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2]) + p[2] * (q[0] * r[1] - q[1] * r[0])
        )

    full, edges = determinant(a, b, c), (determinant(d, a, b), determinant(d, b, c), determinant(d, c, a))
    sign = 1 if full > 0 else -1
    if not full or any(edge * sign < 0 for edge in edges) or not any(edges):
        return None
    return full / sum(edges)


def aimed_at(triangles: Faces, n: int, seed: int) -> Iterator[tuple[int, Floats, Floats]]:
    """Rays through triangles, their edges and corners, or nearly so, from anywhere, from others and along axes."""
    r = rng(seed)
    corners = triangles.vertex[triangles.face]
    for k in range(n):
        i, j = r.integers(len(corners), size=2)
        weight = r.dirichlet([1, 1, 1]) * r.choice([1, 1e-7], size=3, p=[0.8, 0.2])
        if k % 3 == 0:
            weight[r.integers(3)] = 0
        if k % 7 == 0:
            weight = np.eye(3)[r.integers(3)]
        aim = weight @ corners[i] / weight.sum()
        start = r.uniform(-0.5, 0.5, 3) if k % 2 else r.dirichlet([1, 1, 1]) @ corners[j]
        if k % 5 == 0:
            start = aim + np.eye(3)[r.integers(3)] * r.uniform(-0.3, 0.3)
        yield int(i), start, (aim - start) * 10 ** r.uniform(-3, 3)


@pytest.mark.parametrize("name", MESHES)
def test_what_a_ray_meets_is_a_candidate(name: str) -> None:
    """By exact arithmetic, of the ray as it is in double; and its distance is within the bounds."""
    triangles = mesh(MESHES[name])
    tree = build_tree(NO_BALLS, triangles)
    place = {int(i): k // 8 for k, i in enumerate(tree.patch["index"].ravel())}
    met = sure = 0
    for i, o, d in aimed_at(triangles, 300, 25):
        t, length = exactly_met(triangles.vertex[triangles.face[i]], o, d), float(np.linalg.norm(d))
        if t is None or t <= 0:
            continue
        met += 1
        d /= length
        found = candidates(tree.patch[place[i]], o, d, np.inf)
        assert i in found
        assert found[i][0] <= float(t) * length <= found[i][1]
        sure += found[i][1] < np.inf
        assert i in reached(tree, o, d, float(t) * length * (1 + 2.0**-20))
    assert met > (20 if name != "lines" else -1)
    assert sure > met / 4 or name in ("slivers", "lines", "tiny", "sheet", "below float32")


def test_few_are_candidates_in_vain() -> None:
    """Of 3000 triangles, a ray has hardly one that it does not meet."""
    triangles = mesh(MESHES["3000"])
    patch = build_tree(NO_BALLS, triangles).patch
    corners, vain = triangles.vertex[triangles.face], 0
    for _, o, d in aimed_at(triangles, 30, 26):
        if float(np.linalg.norm(d)) == 0:
            continue
        for leaf in patch:
            for i in candidates(leaf, o, d / np.linalg.norm(d), np.inf):
                t = exactly_met(corners[i], o, d)
                vain += t is None or t <= 0
    assert vain <= 30


def test_corners_that_rounding_makes_one() -> None:
    """A triangle that is tiny beside its distance from the others is in the tree, and a ray through it finds it."""
    place = np.array([1e8, 2e8, -3e8])
    vertex = np.array([(0, 0, 0), (1e-9, 0, 0), (0, 1e-9, 0), *(place + np.eye(3)), (5, 5, 5), (5, 5, 5), (6, 5, 5)])
    face = np.arange(9, dtype=np.int32).reshape(3, 3)
    paths = Paths.of(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, bool), vertex, face)
    assert paths.tree is not None
    # The last one has two corners in one place, and is in no patch.
    assert sorted(paths.tree.patch["index"][paths.tree.patch["index"] >= 0].tolist()) == [0, 1]
    slack = paths.tree.patch["slack"][paths.tree.patch["index"] == 0]
    assert (slack > 2.0**-50).all()
