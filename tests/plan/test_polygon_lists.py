"""Triangles and cylinders in the lists of numpy and of a device: what a ray meets is offered to it, and little else.

The lists are walked as in test_lists. Each surface is made around a point, so that the ray through that point meets it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from test_lists import cell_of, dot_float, walk

from cltrace.plan.abi import Precision, dtype_of
from cltrace.plan.accel import grids
from cltrace.plan.accel.grids import CellGrid, PictureWindow, Shadows, build, parallel_grids, picture_tiles, point_grids
from cltrace.plan.accel.silhouettes import FINE_SLACK, SLACK, Capsules, Discs, Polygons, Silhouettes
from cltrace.run.devices import Device
from cltrace.run.pack import polygons
from cltrace.run.pack.lists import ListBuffers, ListWriter
from cltrace.run.pack.polygons import PolygonSight
from cltrace.run.pack.toolbox import Toolbox

pytestmark = pytest.mark.slow

Floats = NDArray[np.float64]
f32 = np.float32
NO_SPHERES = Discs(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
Make = Callable[[Floats, np.random.Generator], Silhouettes]


class Lists:
    """What makes the lists of grids: numpy, or a device."""

    def __init__(self, device: Device | None, slack: float = FINE_SLACK) -> None:
        self.precision: Precision = "single" if slack == SLACK else "accurate"
        self.tools = Toolbox(device, self.precision) if device else None

    def of(self, surfaces: Silhouettes, made: Callable[[list[Silhouettes]], Iterable[CellGrid]]) -> SimpleNamespace:
        """The buffers of the grids that are made of surfaces."""
        if not self.tools:
            return SimpleNamespace(arrays=build(made([NO_SPHERES, surfaces]), self.precision))
        if isinstance(surfaces, Polygons):
            rows = self.tools.upload(np.concatenate([surfaces.face, surfaces.face[:, :1]], axis=1))
            sight = PolygonSight(self.tools, surfaces.vertex, rows, len(surfaces), 0)
            surfaces = replace(surfaces, sight=sight)
        writer = ListWriter(self.tools, self.precision, ListBuffers.of(self.tools, 300, 1))
        for grid in made([NO_SPHERES, surfaces]):
            writer.add_members(grid)
        if not writer.records:
            return SimpleNamespace(arrays={"grid": np.zeros(0, dtype_of("Grid", self.precision))})
        buffers, records = writer.done()
        read = {name: self.tools.read(buffer, buffer.size // 4, np.int32) for name, buffer in buffers.items()}
        return SimpleNamespace(arrays={"grid": records, "start": read["start"], "entry": read["entry"].reshape(-1, 2)})


@pytest.fixture(params=["numpy", "device"])
def maker(request: pytest.FixtureRequest) -> Device | None:
    return None if request.param == "numpy" else request.getfixturevalue("any_device")


@pytest.fixture(params=[-300, grids.SPARE], ids=["levels", "level 0"])
def spare(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    for where in (grids, polygons):
        monkeypatch.setattr(where, "SPARE", request.param)


# ----------------------------------------------------------------------------------------------------------- surfaces


def unit(rng: np.random.Generator, n: int) -> Floats:
    v = rng.normal(size=(n, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1)[:, None])


def triangles_around(points: Floats, rng: np.random.Generator) -> Polygons:
    """Triangles with a point each: inside, on an edge or in a corner. Some are needles, some about in a plane with the
    origin, some of which reach behind it; their vertices are in another order."""
    n = len(points)
    e, f = (rng.normal(size=(n, 3)) * 2.0 ** rng.uniform(-30, 1, (n, 1)) for _ in range(2))
    e[: n // 8] = points[: n // 8] * rng.uniform(-2, 2, (n // 8, 1))
    f[n // 8 : n // 4] = e[n // 8 : n // 4] * (1 + 2.0 ** -rng.uniform(20, 54, (n // 8, 1)))
    weight = rng.dirichlet((0.5, 0.5, 0.5), n) * (rng.uniform(size=(n, 3)) < 0.8)
    weight /= np.maximum(weight.sum(axis=1), 2.0**-900)[:, None]
    a = points - weight[:, 1:2] * e - weight[:, 2:] * f
    place = rng.permutation(3 * n)
    vertex = np.empty((3 * n, 3))
    vertex[place] = np.stack([a, a + e, a + f], axis=1).reshape(-1, 3)
    return Polygons(vertex, place.reshape(-1, 3).astype(np.int32), 0, np.ones(n, np.int8))


def cylinders_around(points: Floats, rng: np.random.Generator) -> Capsules:
    """Cylinders, each of which has a point just within its round side: thick and thin, long and short."""
    n, radius = len(points), 2.0 ** rng.uniform(-14, -2, len(points))
    along = unit(rng, n)
    out = np.cross(along, unit(rng, n))
    out *= (radius * (1 - 2.0**-20) / np.linalg.norm(out, axis=1))[:, None]
    length = radius[:, None] * 4 + 2.0 ** rng.uniform(-10, 0, (n, 1))
    start = points + out - along * length * rng.uniform(0.3, 0.7, (n, 1))
    return Capsules(start, start + along * length, radius, 0)


AROUND = pytest.mark.parametrize("around", [triangles_around, cylinders_around], ids=["triangles", "cylinders"])


# ------------------------------------------------------------------------------------------------------- primary rays


def window_of(tan: float, size: tuple[int, int], region: tuple[int, int, int, int] | None = None) -> PictureWindow:
    width, height = size
    return PictureWindow((tan / width, tan / width), size, region or (0, 0, width, height))


@AROUND
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
@pytest.mark.usefixtures("spare")
def test_pixels_are_offered_what_they_meet(window: PictureWindow, around: Make, maker: Device | None) -> None:
    rng, (left, top, width, height) = np.random.default_rng(6), window.region
    column, row = rng.integers(left, left + width, 400), rng.integers(top, top + height, 400)
    x, y = (2 * column + 1 - window.size[0]) * window.step[0], (window.size[1] - 1 - 2 * row) * window.step[1]
    d = np.stack([x, y, np.full(400, -1.0)], axis=1)
    points = d * (rng.uniform(0.01, 1, 400) / np.linalg.norm(d, axis=1))[:, None]
    every = np.ones(400, bool)
    lists = Lists(maker).of(around(points, rng), lambda shapes: [picture_tiles(shapes, every, window, FINE_SLACK)])
    for i, tile in enumerate(zip((column >> 2).tolist(), (row >> 2).tolist(), strict=True)):
        found = np.concatenate([*walk(lists, 0, *tile)])  # type: ignore[arg-type]
        near = found[found[:, 0] == i, 1].view(f32)
        assert len(near) == 1, f"pixel {column[i]}, {row[i]} lacks {i}, or has it twice"
        assert near[0] <= (points[i] ** 2).sum() * (1 + 2.0**-20)


# -------------------------------------------------------------------------------------------------------- shadow rays


def axes_towards(direction: tuple[float, float, float]) -> Floats:
    towards = np.array(direction) / np.linalg.norm(direction)
    across = np.cross(np.eye(3)[np.argmin(np.abs(towards))], towards)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(towards, across), towards])


def offered_to(lists: SimpleNamespace, w: Floats, p: Floats, axes: Floats | None) -> set[int]:
    """What is in a light's lists for a shadow ray from p to the light; w: from p to a light at a point, which is the
    origin, or axes: (3, 3), of which the last one leads to it."""
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


@AROUND
@pytest.mark.parametrize("slack", [SLACK, FINE_SLACK], ids=["single", "accurate"])
@pytest.mark.parametrize("size", [1, 2.0**-5, 2.0**-12, 2.0**-20, 2.0**-35])
@pytest.mark.parametrize("towards", [None, (0.0, 1, 0), (-0.3, 1, 0.7)], ids=["lamp", "sun above", "sun aslant"])
@pytest.mark.usefixtures("spare")
def test_shadow_rays_are_offered_what_is_on_their_way(
    around: Make, slack: float, size: float, towards: tuple[float, float, float] | None, maker: Device | None
) -> None:
    """Surfaces around points of small ones on which alone shadow rays end, as the picture shows those.

    Some are a hair before the others, some at the light, which is at the origin.
    """
    rng, n = np.random.default_rng(4), 160
    middle = np.array([0.2, 0.3, -0.6]) if size < 1 else np.zeros(3)
    ends = middle + rng.uniform(-0.5, 0.5, (n, 3)) * size
    way = np.where(rng.uniform(size=n) < 0.3, 2.0**-12, rng.uniform(size=n))[:, None]
    axes = axes_towards(towards) if towards else None
    places = ends * (1 - way) if axes is None else ends + axes[2] * way
    edges = rng.normal(size=(2, n, 3)) * size / 8
    seen = np.stack([ends, ends + edges[0], ends + edges[1]], axis=1).reshape(-1, 3)
    made = around(places, rng)
    if isinstance(made, Polygons):
        face = np.concatenate([np.arange(3 * n, dtype=np.int32).reshape(-1, 3), made.face + np.int32(3 * n)])
        made = Polygons(np.concatenate([seen, made.vertex]), face, 0, np.ones(2 * n, np.int8))
    else:
        assert isinstance(made, Capsules)
        start, end = np.concatenate([ends, made.start]), np.concatenate([ends + edges[0], made.end])
        made = Capsules(start, end, np.concatenate([np.full(n, size / 64), made.radius]), 0)
    who = Shadows(np.ones(2 * n, bool), np.arange(2 * n) < n, slack)
    lists = Lists(maker, slack).of(
        made, lambda shapes: point_grids(shapes, who) if axes is None else parallel_grids(axes, shapes, who)
    )
    for i, p in enumerate(ends):
        assert n + i in offered_to(lists, -p if axes is None else axes[2], p, axes)


# -------------------------------------------------------------------------------------------------------- little else


def needle(kind: str) -> Silhouettes:
    """One surface from a corner of a picture to the other, and as seen from the origin one from -1 to 1."""
    ends = np.array([(-1.0, -1, -1), (1, 1, -1)]) * 0.5
    if kind == "cylinder":
        return Capsules(ends[:1], ends[1:], np.array([1e-4]), 0)
    return Polygons(np.array([*ends, ends[1] + (1e-4, 0, 0)]), np.array([[0, 1, 2]], np.int32), 0, np.ones(1, np.int8))


@pytest.mark.parametrize("kind", ["triangle", "cylinder"])
def test_what_is_long_and_thin_is_in_few_cells(kind: str, maker: Device | None) -> None:
    """Of 48x48 tiles, and of a light's cells, it is in those of the diagonal and some of their neighbours."""
    every, window, surface = np.ones(1, bool), window_of(1.0, (192, 192)), needle(kind)
    lists = Lists(maker).of(surface, lambda shapes: [picture_tiles(shapes, every, window, FINE_SLACK)])
    assert 48 <= lists.arrays["start"][48 * 48] <= 3 * 48
    who, axes = Shadows(every, every, FINE_SLACK), axes_towards((0, 0, 1))
    lamp = Lists(None).of(surface, lambda shapes: point_grids(shapes, who))
    sun = Lists(None).of(surface, lambda shapes: parallel_grids(axes, shapes, who))
    for made in (lamp, sun):
        sides = made.arrays["grid"]["cells"][:, :2]
        assert sides.max(axis=1).sum() / 2 <= made.arrays["start"][-1] <= 3 * sides.sum()
