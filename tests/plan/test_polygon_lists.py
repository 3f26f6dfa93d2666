"""Triangles in the lists of numpy and of a device: what a ray can meet is offered to it, and little else.

The lists are walked as in test_lists. Rational numbers say what is met wherever doubles are not sure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from test_lists import cell_of, dot_float, walk

from cltrace.plan.abi import Precision, dtype_of
from cltrace.plan.accel import grids
from cltrace.plan.accel.grids import CellGrid, PictureWindow, Shadows, build, parallel_grids, picture_tiles, point_grids
from cltrace.plan.accel.silhouettes import FINE_SLACK, SLACK, Capsules, Discs, Polygons
from cltrace.run.devices import Device
from cltrace.run.pack import polygons
from cltrace.run.pack.lists import ListBuffers, ListWriter
from cltrace.run.pack.polygons import PolygonSight
from cltrace.run.pack.toolbox import Toolbox

pytestmark = pytest.mark.slow

Floats = NDArray[np.float64]
f32 = np.float32
NO_SPHERES = Discs(np.zeros((0, 3)), np.zeros(0), np.zeros(0))


# --------------------------------------------------------------------------------------------------- what is required


def _exactly(corner: Floats, d: Floats) -> Fraction | None:
    """Where the ray along d from the origin meets a triangle (3, 3), in units of d; None if it does not."""
    a, b, c, w = ([Fraction(x) for x in row.tolist()] for row in (*corner, d))

    def cross(p: list[Fraction], q: list[Fraction]) -> list[Fraction]:
        return [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]

    def dot(p: list[Fraction], q: list[Fraction]) -> Fraction:
        return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]

    normals = [cross(a, b), cross(b, c), cross(c, a)]
    normal = [x + y + z for x, y, z in zip(*normals, strict=True)]
    plane = dot(a, normal)
    if not plane:
        return None
    for n in normals:
        side = next((x for x in (dot(w, n), *n) if x), Fraction(0))
        if not side * plane > 0:
            return None
    return plane / dot(w, normal)


def met(corners: Floats, d: Floats) -> Floats:
    """(rays, triangles): where rays (rays, 3) from the origin meet triangles (m, 3, 3), in units of d; inf if not."""
    a, b, c = corners.transpose(1, 0, 2)
    size, normal = np.abs(corners).sum(axis=2).max(axis=1), np.cross(b - a, c - a)
    plane, longest = (a * normal).sum(axis=1), np.abs(b - a).sum(axis=1) + np.abs(c - a).sum(axis=1)
    flat = np.abs(plane) <= 2.0**-48 * size * longest**2
    sides = np.stack([d @ np.cross(p, q - p).T for p, q in ((a, b), (b, c), (c, a))])
    doubt = np.abs(d).sum(axis=1)[:, None] * (2.0**-48 * size * longest)
    # Two sides of different signs are enough to know that a ray passes by, whatever the plane's sign is.
    passes = (sides > doubt).any(axis=0) & (sides < -doubt).any(axis=0)
    passes |= ~flat & (sides * np.sign(plane) < -doubt).any(axis=0)
    unsure = ~passes & (flat | (np.abs(sides) <= doubt).any(axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(passes | unsure, np.inf, plane / (d @ normal.T))
    for i, j in np.argwhere(unsure):
        at = _exactly(corners[j], d[i])
        t[i, j] = np.inf if at is None else float(at)
    return np.asarray(t)


class Lists:
    """What sees triangles and makes the lists of grids: numpy, or a device."""

    def __init__(self, device: Device | None = None) -> None:
        self._device = device

    def seen(self, triangles: Floats, slack: float = FINE_SLACK) -> Polygons:
        """Triangles (m, 3, 3) with their vertices in another order, times a power of two that makes them about 1."""
        order = np.random.default_rng(0).permutation(triangles.shape[0] * 3)
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        face, vertex = place.reshape(-1, 3).astype(np.int32), triangles.reshape(-1, 3)[order]
        seen = Polygons(vertex, face, 0, np.ones(len(face), np.int8))
        if not self._device:
            return seen
        self._tools = Toolbox(self._device, "single" if slack == SLACK else "accurate")
        rows = self._tools.upload(np.concatenate([face, face[:, :1]], axis=1))
        return replace(seen, sight=PolygonSight(self._tools, vertex, rows, len(face), 0))

    def of(self, some: Iterable[CellGrid], slack: float = FINE_SLACK) -> SimpleNamespace:
        precision: Precision = "single" if slack == SLACK else "accurate"
        if not self._device:
            return SimpleNamespace(arrays=build(some, precision))
        writer = ListWriter(self._tools, precision, ListBuffers.of(self._tools, 300, 1))
        for grid in some:
            writer.add_members(grid)
        if not writer.records:
            return SimpleNamespace(arrays={"grid": np.zeros(0, dtype_of("Grid", precision))})
        made, records = writer.done()
        read = {name: self._tools.read(buffer, buffer.size // 4, np.int32) for name, buffer in made.items()}
        return SimpleNamespace(arrays={"grid": records, "start": read["start"], "entry": read["entry"].reshape(-1, 2)})


NUMPY = Lists()


@pytest.fixture(params=["numpy", "device"])
def lists(request: pytest.FixtureRequest) -> Lists:
    return NUMPY if request.param == "numpy" else Lists(request.getfixturevalue("any_device"))


def window_of(tan: float, size: tuple[int, int], region: tuple[int, int, int, int] | None = None) -> PictureWindow:
    width, height = size
    return PictureWindow((tan / width, tan / width), size, region or (0, 0, width, height))  # type: ignore[arg-type]


def rays(window: PictureWindow) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """Column, row and direction of each pixel's ray."""
    left, top, width, height = window.region
    rows, columns = np.mgrid[top : top + height, left : left + width].reshape(2, -1)
    x = (2 * columns + 1 - window.size[0]) * window.step[0]
    y = (window.size[1] - 1 - 2 * rows) * window.step[1]
    return columns, rows, np.stack([x, y, np.full(len(x), -1.0)], axis=1)


def check_pixels(triangles: Floats, window: PictureWindow, by: Lists = NUMPY) -> float:
    """Whatever a pixel's ray meets is in its lists, not behind itself. Returns how many entries there are a hit."""
    shapes, every = [NO_SPHERES, by.seen(triangles)], np.ones(len(triangles), bool)
    lists = by.of([picture_tiles(shapes, every, window, FINE_SLACK)])
    columns, rows, d = rays(window)
    t = met(triangles, d)
    square = (t * t) * (d * d).sum(axis=1)[:, None]
    offers = 0
    tiles: dict[tuple[int, int], dict[int, float]] = {}
    for column, row, far in zip(columns.tolist(), rows.tolist(), square, strict=True):
        tile = column >> 2, row >> 2
        if tile not in tiles:
            tiles[tile] = {}
            for entries in walk(lists, 0, *tile):  # type: ignore[arg-type]
                near = entries[:, 1].view(f32)
                assert (np.diff(near) >= 0).all()
                assert len(set(entries[:, 0].tolist())) == len(entries)
                tiles[tile] |= dict(zip(entries[:, 0].tolist(), near.tolist(), strict=True))
        offered = tiles[tile]
        offers += len(offered)
        for index in np.flatnonzero(np.isfinite(far)).tolist():
            assert index in offered, f"pixel {column}, {row} lacks {index}"
            assert offered[index] <= far[index] * (1 + 2.0**-20), (column, row, index)
    return offers / max(1, int(np.isfinite(t).sum()))


def offered_to(lists: SimpleNamespace, w: Floats, p: Floats, axes: Floats | None) -> set[int]:
    """The triangles in a light's lists for a shadow ray from p to the light; w: from p to a light at a point."""
    w32, at_point = w.astype(f32), axes is None
    a = dot_float(w32, w32)
    at_light = bool(at_point and a < f32(2.0**-40))
    start = -w * (2.0**80 if at_light else 1) if axes is None else p
    depth = a if axes is None else -f32(start @ axes[2])
    found: set[int] = set()
    for g, grid in enumerate(lists.arrays["grid"]):
        cell = cell_of(grid, w32, start, at_point, at_light)
        for entries in walk(lists, g, *cell) if cell else ():  # type: ignore[arg-type]
            near = entries[:, 1].view(f32)
            assert (np.diff(near) >= 0).all()
            found |= set(entries[near < depth, 0].tolist())
    return found


def on_triangles(triangles: Floats, count: int) -> tuple[Floats, NDArray[np.intp]]:
    """Points of triangles, and which triangle each one is on."""
    rng = np.random.default_rng(1)
    which = rng.integers(0, len(triangles), count)
    weight = rng.dirichlet((0.7, 0.7, 0.7), count)
    return (triangles[which] * weight[:, :, None]).sum(axis=1), which


def check_light(
    triangles: Floats,
    light: Floats | None,
    axes: Floats | None,
    slack: float = FINE_SLACK,
    receivers: int | None = None,
    by: Lists = NUMPY,
) -> float:
    """Whatever is on the way from points of the triangles to a light is in its lists. light: (3,), or axes: (3, 3).

    receivers: how many triangles, from the first one on, are seen and have such points; None for all. Returns how many
    triangles are offered to a point, on average, for each one that is on its way.
    """
    every = np.ones(len(triangles), bool)
    who = Shadows(every, np.arange(len(triangles)) < (receivers or len(triangles)), slack)
    points, own = on_triangles(triangles[:receivers], 300)
    if axes is None:
        seen, p = triangles - light, points - light
        lists = by.of(point_grids([NO_SPHERES, by.seen(seen, slack)], who), slack)
        t = met(seen, p)
        blocks, ways = t < 1, -p
    else:
        lists = by.of(parallel_grids(axes, [NO_SPHERES, by.seen(triangles, slack)], who), slack)
        ways = np.broadcast_to(axes[2], points.shape)
        t = np.stack([met(triangles - point, axes[2:])[0] for point in points])
        blocks = np.isfinite(t)
    offers = hits = 0
    for p, w, row, mine in zip(points, ways, blocks, own.tolist(), strict=True):
        blocking = set(np.flatnonzero(row).tolist()) - {mine}
        offered = offered_to(lists, w, p, axes)
        offers, hits = offers + len(offered), hits + len(blocking)
        assert blocking <= offered, f"{p} lacks {blocking - offered}"
    return offers / max(1, hits)


# ------------------------------------------------------------------------------------------------------------- scenes


def unit(rng: np.random.Generator, n: int) -> Floats:
    v = rng.normal(size=(n, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1)[:, None])


def soup(rng: np.random.Generator, n: int = 120) -> Floats:
    middle = np.column_stack([rng.uniform(-0.4, 0.4, (n, 2)), rng.uniform(-1, -0.3, n)])
    return np.asarray(middle[:, None] + rng.normal(size=(n, 3, 3)) * 2.0 ** rng.uniform(-10, -2, (n, 1, 1)))


def small(rng: np.random.Generator, n: int = 300) -> Floats:
    middle = np.column_stack([rng.uniform(-0.4, 0.4, (n, 2)), rng.uniform(-1, -0.5, n)])
    return np.asarray(middle[:, None] + rng.normal(size=(n, 3, 3)) * 2.0 ** rng.uniform(-10, -5, (n, 1, 1)))


def around(rng: np.random.Generator, n: int = 120) -> Floats:
    return np.asarray(rng.normal(size=(n, 3, 3)) * 0.3)


def needles(rng: np.random.Generator, n: int = 120) -> Floats:
    start, end = (np.column_stack([rng.uniform(-1, 1, (n, 2)), rng.uniform(-1, -0.1, n)]) for _ in range(2))
    return np.stack([start, end, end + rng.normal(size=(n, 3)) * 2.0 ** rng.uniform(-30, -5, (n, 1))], axis=1)


def box(size: float = 0.5, middle: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Floats:
    found = []
    for axis in range(3):
        for sign in (-1, 1):
            quad = np.zeros((4, 3))
            quad[:, axis] = sign
            quad[:, (axis + 1) % 3] = (-1, 1, 1, -1)
            quad[:, (axis + 2) % 3] = (-1, -1, 1, 1)
            found += [quad[[0, 1, 2]], quad[[0, 2, 3]]]
    return np.asarray(np.array(found) * size + middle)


def room(rng: np.random.Generator) -> Floats:
    return np.concatenate(
        [box(0.9), *(box(s, tuple(m)) for s, m in zip(rng.uniform(0.01, 0.1, 9), unit(rng, 9) * 0.5, strict=True))]
    )  # type: ignore[arg-type]


def through_the_eye(rng: np.random.Generator, n: int = 12) -> Floats:
    """In a plane with the origin, exactly or all but."""
    first, second = (np.round(rng.uniform(-64, 64, (n, 3))) / 64 for _ in range(2))
    weight = np.round(rng.uniform(-4, 4, (n, 3, 2)))
    corner = (weight[:, :, :1] * first[:, None] + weight[:, :, 1:] * second[:, None]) / 16
    corner[: n // 2] += unit(rng, n // 2)[:, None] * 2.0 ** -rng.uniform(20, 52, (n // 2, 1, 1))
    return np.asarray(corner)


def tiny(rng: np.random.Generator, n: int = 200) -> Floats:
    middle = np.column_stack([rng.uniform(-0.6, 0.6, (n, 2)), np.full(n, -1.0)])
    return np.asarray(middle[:, None] + rng.normal(size=(n, 3, 3)) * 2.0 ** rng.uniform(-30, -5, (n, 1, 1)))


def huge(rng: np.random.Generator, n: int = 60) -> Floats:
    return np.asarray(unit(rng, n)[:, None] * 2.0 ** rng.uniform(-30, -1, (n, 1, 1)) + rng.normal(size=(n, 3, 3)) * 0.5)


def on_pixels(rng: np.random.Generator, n: int = 200) -> Floats:
    """Corners on the rays of pixels of a 47x33 picture, or a hair off."""
    *_, d = rays(window_of(0.6, (47, 33)))
    near = rng.integers(0, len(d), n)
    others = [np.clip(near + rng.integers(-3, 4, n) + 47 * rng.integers(-3, 4, n), 0, len(d) - 1) for _ in range(2)]
    corner = np.stack([d[near], *(d[other] for other in others)], axis=1) * rng.uniform(0.2, 1, (n, 3, 1))
    return np.asarray(corner * (1 + rng.choice([0, 1], (n, 3, 3)) * 2.0 ** -rng.integers(25, 53, (n, 3, 3))))


def flat(rng: np.random.Generator, n: int = 6) -> Floats:
    """Without area, or twice the same."""
    corner = soup(rng, n)
    corner[: n // 3, 2] = (corner[: n // 3, 0] + corner[: n // 3, 1]) / 2
    corner[n // 3 : 2 * n // 3] = corner[n // 3 : 2 * n // 3, :1]
    return corner


SCENES = (soup, around, needles, room, through_the_eye, tiny, huge, on_pixels, flat)
Make = Callable[[np.random.Generator], Floats]


@pytest.mark.parametrize("make", SCENES)
@pytest.mark.parametrize("spare", [-300, grids.SPARE], ids=["levels", "level 0"])
@pytest.mark.parametrize(
    "window",
    [
        window_of(0.6, (47, 33)),
        window_of(40.0, (47, 33)),
        window_of(1e-5, (47, 33)),
        window_of(0.6, (400, 300), (120, 200, 41, 30)),
        window_of(0.6, (3, 2)),
    ],
    ids=["usual", "wide angle", "narrow angle", "crop", "one tile"],
)
def test_pixels_are_offered_all_that_they_meet(
    make: Make, spare: int, window: PictureWindow, lists: Lists, monkeypatch: pytest.MonkeyPatch
) -> None:
    for where in (grids, polygons):
        monkeypatch.setattr(where, "SPARE", spare)
    check_pixels(make(np.random.default_rng(6)), window, lists)


def axes_towards(direction: Floats) -> Floats:
    towards = direction / np.linalg.norm(direction)
    across = np.cross(np.eye(3)[np.argmin(np.abs(towards))], towards)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(towards, across), towards])


@pytest.mark.parametrize("make", SCENES)
@pytest.mark.parametrize(
    ("slack", "spare"), [(SLACK, -300), (FINE_SLACK, grids.SPARE)], ids=["single, levels", "accurate, level 0"]
)
@pytest.mark.parametrize(
    "light",
    [(0.0, 0.0, 0.0), (0.1, 0.05, -0.6), (3.0, 5, 2)],
    ids=["lamp at the eye", "lamp among them", "lamp outside"],
)
def test_lamps_shadow_rays_are_offered_all_that_is_on_their_way(
    make: Make,
    slack: float,
    spare: int,
    light: tuple[float, float, float],
    lists: Lists,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for where in (grids, polygons):
        monkeypatch.setattr(where, "SPARE", spare)
    check_light(make(np.random.default_rng(4)), np.array(light), None, slack, by=lists)


@pytest.mark.parametrize("make", SCENES)
@pytest.mark.parametrize("slack", [SLACK, FINE_SLACK], ids=["single", "accurate"])
@pytest.mark.parametrize("direction", [(0.0, 1, 0), (-0.3, 1, 0.7)], ids=["sun above", "sun aslant"])
def test_suns_shadow_rays_are_offered_all_that_is_on_their_way(
    make: Make, slack: float, direction: tuple[float, float, float], lists: Lists
) -> None:
    check_light(make(np.random.default_rng(5)), None, axes_towards(np.array(direction)), slack, by=lists)


@pytest.mark.parametrize("towards", [(0.0, 0, 1), (0.1, -0.2, 1)], ids=["ahead", "aslant"])
@pytest.mark.parametrize("at_point", [True, False], ids=["lamp", "sun"])
def test_what_is_just_in_front_of_the_furthest_receiver(
    towards: tuple[float, float, float], at_point: bool, lists: Lists
) -> None:
    """A wall that leads away from the light, and shingles a hair nearer to the light than it, of which none is seen."""
    rng, axes = np.random.default_rng(7), axes_towards(np.array(towards))
    wall = np.array([[-0.1, -0.1, -0.25], [0.1, -0.1, -0.25], [0, 0.25, -1]]) @ axes
    middle = rng.dirichlet((1, 1, 1), 60) @ wall
    shingles = middle[:, None] * (1 - 2.0**-12) + (wall - wall.mean(axis=0)) * rng.uniform(0.02, 0.2, (60, 1, 1))
    triangles = np.concatenate([wall[None], shingles])
    light = (np.zeros(3), None) if at_point else (None, axes)
    assert check_light(triangles, *light, receivers=1, by=lists) > 0


@pytest.mark.parametrize("size", [2.0**-5, 2.0**-10, 2.0**-20, 2.0**-35])
@pytest.mark.parametrize("light", [(0.0, 0.0, 0.0), (0.5, 0.6, 0.1)])
@pytest.mark.parametrize("slack", [SLACK, FINE_SLACK], ids=["single", "accurate"])
def test_few_receivers_make_a_small_window(size: float, light: tuple[float, float, float], slack: float) -> None:
    """Small triangles that are seen, and large ones before and among them that are not."""
    rng, middle = np.random.default_rng(10), np.array([0.1, 0.05, -0.7])
    seen = middle + size * rng.normal(size=(60, 1, 3)) + size / 8 * rng.normal(size=(60, 3, 3))
    towards = rng.uniform(0, 1, (40, 1, 1)) ** 4 * (light - middle)
    large = middle + towards + size * rng.normal(size=(40, 1, 3)) + rng.normal(size=(40, 3, 3)) / 4
    offered = check_light(np.concatenate([seen, large]), np.array(light), None, slack, receivers=60)
    assert slack == SLACK or offered < 3.5


@pytest.mark.parametrize("size", [1, 2.0**-8, 2.0**-14, 2.0**-20])
def test_parallel_light_tells_small_triangles_apart(size: float) -> None:
    axes = axes_towards(np.array([0.3, -0.2, 1]))
    triangles = soup(np.random.default_rng(1)) * size * 0.3 + (0.2, 0.1, -0.9)
    assert check_light(triangles, None, axes) < 10


def cylinders_around(points: Floats, rng: np.random.Generator) -> Capsules:
    """Cylinders, each of which has a point just within its round side: thick and thin, long and short."""
    n, radius = len(points), 2.0 ** rng.uniform(-14, -2, len(points))
    along = unit(rng, n)
    out = np.cross(along, unit(rng, n))
    out *= (radius * (1 - 2.0**-20) / np.linalg.norm(out, axis=1))[:, None]
    length = radius[:, None] * 4 + 2.0 ** rng.uniform(-10, 0, (n, 1))
    start = points + out - along * length * rng.uniform(0.3, 0.7, (n, 1))
    return Capsules(start, start + along * length, radius, 0)


@pytest.mark.parametrize("spare", [-300, grids.SPARE], ids=["levels", "level 0"])
@pytest.mark.parametrize("window", [window_of(0.6, (47, 33)), window_of(40.0, (47, 33)), window_of(1e-5, (47, 33))])
def test_pixels_are_offered_the_cylinders_that_they_meet(
    window: PictureWindow, spare: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grids, "SPARE", spare)
    rng, (columns, rows, d) = np.random.default_rng(2), rays(window)
    some = rng.integers(0, len(d), 400)
    points = d[some] * (rng.uniform(0.01, 1, 400) / np.linalg.norm(d[some], axis=1))[:, None]
    shapes, every = [NO_SPHERES, cylinders_around(points, rng)], np.ones(400, bool)
    lists = NUMPY.of([picture_tiles(shapes, every, window, FINE_SLACK)])
    for i, (column, row) in enumerate(zip(columns[some].tolist(), rows[some].tolist(), strict=True)):
        entries = np.concatenate([*walk(lists, 0, column >> 2, row >> 2)])  # type: ignore[arg-type]
        near = entries[entries[:, 0] == i, 1].view(f32)
        assert len(near) == 1, f"pixel {column}, {row} lacks {i}"
        assert near[0] < (points[i] ** 2).sum()


@pytest.mark.parametrize("slack", [SLACK, FINE_SLACK], ids=["single", "accurate"])
@pytest.mark.parametrize("size", [1, 2.0**-12], ids=["all around", "far away"])
@pytest.mark.parametrize("towards", [None, (-0.3, 1, 0.7)], ids=["lamp", "sun"])
def test_shadow_rays_are_offered_the_cylinders_that_they_meet(
    slack: float, size: float, towards: tuple[float, float, float] | None
) -> None:
    """From points within cylinders, the ray to the light meets these."""
    rng, every = np.random.default_rng(3), np.ones(400, bool)
    points = rng.uniform(-1, 1, (400, 3)) * size
    made = cylinders_around(points, rng)
    move = (1 - size) * np.array([0.2, 0.3, -0.8])
    points, made = points + move, replace(made, start=made.start + move, end=made.end + move)
    shapes, who = [NO_SPHERES, made], Shadows(every, every, slack)
    axes = axes_towards(np.array(towards)) if towards else None
    lists = NUMPY.of(point_grids(shapes, who) if axes is None else parallel_grids(axes, shapes, who), slack)
    for i, p in enumerate(points):
        assert i in offered_to(lists, -p if axes is None else axes[2], p, axes)


# -------------------------------------------------------------------------------------------------------- little else


def pairs(triangles: Floats, window: PictureWindow, by: Lists) -> tuple[int, int]:
    """How many entries the tiles have, and how many pairs of a tile and a triangle that a ray of it meets."""
    shapes, every = [NO_SPHERES, by.seen(triangles)], np.ones(len(triangles), bool)
    made = by.of([picture_tiles(shapes, every, window, FINE_SLACK)]).arrays
    columns, rows, d = rays(window)
    ray, triangle = np.nonzero(np.isfinite(met(triangles, d)))
    tile = (rows[ray] >> 2) * window.size[0] + (columns[ray] >> 2)
    x, y = -(-window.size[0] // 4), -(-window.size[1] // 4)
    return int(made["start"][x * y]), len(set(zip(tile.tolist(), triangle.tolist(), strict=True)))


@pytest.mark.parametrize(("make", "most"), [(tiny, 1.5), (small, 1.53)])
def test_a_device_enters_few_triangles_in_vain(make: Make, most: float, device: Device) -> None:
    """The bounds are what was measured and 3 % more. Numpy enters all with a row of cells."""
    entries, met_in_tiles = pairs(make(np.random.default_rng(8)), window_of(0.6, (160, 120)), Lists(device))
    assert entries <= most * met_in_tiles


@pytest.mark.parametrize(("make", "lamp", "sun"), [(soup, 11.9, 5.14), (around, 4.48, 5.37), (room, 8.09, 4.51)])
def test_little_else_is_offered_to_shadow_rays(make: Make, lamp: float, sun: float) -> None:
    """For each triangle on a ray's way, so many are in its lists; the bounds are what was measured and 3 % more."""
    triangles = make(np.random.default_rng(9))
    assert check_light(triangles, np.array([0.1, 0.05, -0.6]), None) <= lamp
    assert check_light(triangles, None, axes_towards(np.array([-0.3, 1, 0.7]))) <= sun
