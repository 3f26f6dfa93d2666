"""The lists and the filters by themselves: what a ray can meet is offered to it, and little else.

Lists are made by numpy, and on a device as those of large scenes are.

The lists are walked here as kernels/find walks them, in float32 where the kernel is. The oracle says what is met. Most
spheres here touch a ray by a hair, at the edge of a cell: a list that is too narrow by the last digit lacks them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hostile.sphere_scenes import aimed, balls, directions, limbs, looking, unit
from numpy.typing import NDArray
from surface_rays import spheres_at

from cltrace import Scene, parallel_light, point_light
from cltrace.bench.scenes import cloud, field
from cltrace.oracle.search import Kinds, Rays
from cltrace.plan import abi, lists, rounding
from cltrace.plan.accel import grids
from cltrace.plan.accel.silhouettes import Discs
from cltrace.plan.lights import are_at_points
from cltrace.plan.plan import Plan
from cltrace.plan.request import Request
from cltrace.plan.world import ScenePacking
from cltrace.run import pack
from cltrace.run.devices import Device
from cltrace.run.pack import lists as device_lists

Floats = NDArray[np.float64]
f32 = np.float32

# Everything is entered, and everything is in the light of a lamp.
ALL = ("hidden", "receivers")
REACH_SLACK = f32(1 + 2.0**-20)


def parallel_lights(plan: Plan) -> int:
    """How many of a plan's lights are parallel: the first ones."""
    return int((~are_at_points(plan.arrays["light"][: plan.values["lights"]]["color"][:, 3])).sum())


PlanOf = Callable[[Scene, Request], Plan]


def device_plan(device: Device) -> PlanOf:
    """What makes plans of which a device makes the lists, whatever the number of surfaces is."""

    def plan_of(scene: Scene, request: Request) -> Plan:
        request = replace(request, keep=())
        world = ScenePacking.of(scene, request)
        packer = pack.packer_of(world, request, device)
        view, made = packer.view(world, scene.camera)
        assert packer.tools
        types = {a.name: abi.dtype_of(a.type, request.precision) for a in abi.ARGUMENTS if a.kind == "buffer"}
        arrays = dict(view.arrays)
        for name, buffer in made.items():
            dtype = np.dtype(np.int32) if name == "entry" else types[name].base
            width = types[name].shape[0] if types[name].shape else 1
            arrays[name] = packer.tools.read(buffer, buffer.size // dtype.itemsize // width * width, dtype)
            arrays[name] = arrays[name].reshape(-1, width) if width > 1 else arrays[name]
        return replace(Plan.of(world, view, request), arrays=arrays)

    return plan_of


@pytest.fixture(params=["numpy", "device"])
def plan_of(request: pytest.FixtureRequest) -> PlanOf:
    """How a plan is made. A device leaves out equal spheres, and lights never know where shadows are seen."""
    if request.param == "numpy":
        return Plan.of_scene
    request.getfixturevalue("even_few_are_packed")
    return device_plan(request.getfixturevalue("any_device"))


@pytest.fixture(autouse=True)
def lists_for_few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lights have lists however few spheres there are."""
    monkeypatch.setattr(lists, "ONE_LIST", 0)


# ---------------------------------------------------------------------------------------------- as the kernel does it


def fma(a: f32, b: f32, c: f32) -> f32:
    return f32(np.float64(a) * np.float64(b) + np.float64(c))


def dot_float(w: NDArray[np.float32], s: NDArray[np.float32]) -> f32:
    return fma(w[0], s[0], fma(w[1], s[1], w[2] * s[2]))


def walk(plan: Plan, g: int, column: int, row: int) -> Iterator[NDArray[np.int32]]:
    """The entries of the cells of each level, from coarse to fine, that hold this cell of the finest one."""
    grid, start, entry = (plan.arrays[name] for name in ("grid", "start", "entry"))
    columns, rows, first, mask = grid["cells"][g].tolist()
    for level in (k for k in range(31, -1, -1) if mask >> k & 1):
        pitch = ((columns - 1) >> level) + 1
        cell = first + (row >> level) * pitch + (column >> level)
        yield entry[start[cell] : start[cell + 1]]
        first += pitch * (((rows - 1) >> level) + 1)


def offered_to_pixel(plan: Plan, column: int, row: int) -> dict[int, np.float32]:
    """The spheres in a pixel's lists, and the depth of each one's nearest point."""
    found = {}
    for entries in walk(plan, 0, column >> 2, row >> 2):
        near = entries[:, 1].view(f32)
        assert (np.diff(near) >= 0).all()
        found |= dict(zip(entries[:, 0].tolist(), near, strict=True))
    return found


def offered_to_shadow_ray(plan: Plan, light: int, w: Floats, p: Floats) -> set[int]:
    """The spheres in a light's lists for a shadow ray from p (3,), in camera space. w: (3,), from p to the light."""
    unit, lamp = plan.values["unit"], plan.arrays["light"][light]
    at_point = light >= parallel_lights(plan)
    w32 = (w * unit).astype(f32)
    a = dot_float(w32, w32)
    at_light = bool(at_point and a < f32(2.0**-40))
    start = -w * unit * (2.0**80 if at_light else 1) if at_point else p * unit
    depth = a if at_point else -f32(start @ lamp["position"][:3])
    first, count, *_ = plan.arrays["light_buffer"][light].tolist()
    found: set[int] = set()
    for g in range(first, first + count):
        cell = cell_of(plan.arrays["grid"][g], w32, start, at_point, at_light)
        for entries in walk(plan, g, *cell) if cell else ():
            for index, bits in entries:
                if not depth > bits.view(f32):
                    break
                found.add(int(index))
    return found


def cell_of(
    grid: np.void, w32: NDArray[np.float32], start: Floats, at_point: bool, at_light: bool
) -> tuple[int, int] | None:
    """Column and row of the cell of level 0 that a shadow ray goes through; None if it does not meet the window."""
    columns, rows, *_ = grid["cells"].tolist()
    if columns == rows == 1:
        return 0, 0
    ahead = f32(1)
    if grid["flags"][0] and not at_light:
        x, y, ahead = (-dot_float(w32, grid[f"near_{name}"]) for name in ("right", "up", "ahead"))
    else:
        x, y = (f32(start @ grid[name][:3] + grid[name][3]) for name in ("right", "up"))
        ahead = f32(start @ grid["ahead"][:3]) if at_point else ahead
    if at_point:
        if not ahead > 0:
            return None
        over = f32(1) / ahead
        x, y = x * over, y * over
    if abs(x) > grid["window"][0] or abs(y) > grid["window"][1]:
        return None
    column, row = (int((v + grid["window"][k]) * grid["window"][2 + k]) for k, v in enumerate((x, y)))
    return min(column, columns - 1), min(row, rows - 1)


def filter_of_primary_ray(plan: Plan, d: Floats, index: int) -> bool:
    """Whether the float32 filter leaves it open that the ray along d from the eye meets the sphere."""
    (dx, dy, _), s = d.astype(f32), plan.arrays["eye_filter"][index]
    a, b = fma(dx, dx, fma(dy, dy, f32(1))), fma(dx, s[0], fma(dy, s[1], -s[2]))
    return bool(b * abs(b) >= a * s[3])


def filter_of_shadow_ray(plan: Plan, light: int, w: Floats, p: Floats, index: int) -> bool:
    """The same for the shadow ray from p to a light, for which w and p are as above."""
    unit, lamp = plan.values["unit"], plan.arrays["light"][light]
    s = plan.arrays["light_filter"].reshape(-1, 4)[light * plan.values["count"] + index]
    if light < parallel_lights(plan):
        u, v = (f32((p * unit) @ lamp[name][:3]) for name in ("axis", "across"))
        return bool(fma(s[0] - u, s[0] - u, (s[1] - v) * (s[1] - v)) <= s[2])
    w32 = (w * unit).astype(f32)
    a, b = dot_float(w32, w32), dot_float(w32, s)
    return bool(a < f32(2.0**-40) or b * abs(b) >= a * s[3])


# --------------------------------------------------------------------------------------------------- what is required


def met(origin: Floats, d: Floats, scene: Scene) -> Floats:
    """(rays, spheres): where each ray first meets each sphere, in units of d; inf if it does not.

    origin, d: (rays, 3). Doubles rule out, with a margin far above their rounding, and integers decide the rest.
    """
    center, radius = scene.spheres["center"], scene.spheres["radius"]
    f = center - origin[:, None]
    across, size = np.cross(f, d[:, None]), (d * d).sum(axis=1)[:, None]
    may = (across**2).sum(axis=2) <= size * (radius**2 * (1 + 1e-6) + 1e-12 * (f**2).sum(axis=2))
    t = np.full(may.shape, np.inf)
    ray, sphere = np.nonzero(may)
    kinds, rays = Kinds([spheres_at(center, radius)]), Rays.of(origin, d)
    for i, k in zip(ray.tolist(), sphere.tolist(), strict=True):
        root = kinds.root(rays, i, k)
        t[i, k] = np.inf if root is None else float(root)
    return t


def check_pixels(scene: Scene, pixels: NDArray[np.intp] | None = None, plan_of: PlanOf = Plan.of_scene) -> float:
    """Whatever a pixel's ray meets is in its lists, not behind itself, and passes the filter.

    Returns how many spheres are offered to a ray, on average, for each one that it meets.
    """
    plan, d = plan_of(scene, Request(keep=ALL)), directions(scene.camera)
    pixels = np.arange(len(d)) if pixels is None else np.unique(pixels)
    t = met(np.broadcast_to(scene.camera.position, (len(pixels), 3)), d[pixels], scene)[:, plan.arrays["id_of"]]
    offers, width = 0, scene.camera.resolution[0]
    for pixel, row in zip(pixels.tolist(), t, strict=True):
        offered = offered_to_pixel(plan, pixel % width, pixel // width)
        offers += len(offered)
        for index in np.flatnonzero(np.isfinite(row)).tolist():
            assert index in offered, f"pixel {pixel} lacks {index}"
            far = f32(row[index] * plan.values["unit"])
            dx, dy = d[pixel, :2].astype(f32)
            assert offered[index] <= far * far * fma(dx, dx, fma(dy, dy, f32(1))) * REACH_SLACK, (pixel, index)
            assert filter_of_primary_ray(plan, d[pixel], index), (pixel, index)
    hits = int(np.isfinite(t).sum())
    assert hits
    return offers / hits


def check_light(scene: Scene, points: Floats, keep: tuple[str, ...] = ALL, plan_of: PlanOf = Plan.of_scene) -> float:
    """Whatever is on the way from the points (n, 3) to the light is in its lists, and passes the filter.

    Returns how many spheres are offered to a point, on average, for each one that is on its way.
    """
    plan = plan_of(scene, Request(keep=keep))
    lamp = plan.arrays["light"][0]
    place = lamp["position"][:3].astype(float)
    if parallel_lights(plan):
        ways = np.broadcast_to(place, points.shape)
        blocks = np.isfinite(met(points, ways, scene))
    else:
        ways = place - points
        blocks = met(np.broadcast_to(place, points.shape), -ways, scene) < 1
    offers = hits = 0
    for p, w, row in zip(points, ways, blocks[:, plan.arrays["id_of"]], strict=True):
        blocking = np.flatnonzero(row).tolist()
        offered = offered_to_shadow_ray(plan, 0, w, p)
        offers, hits = offers + len(offered), hits + len(blocking)
        assert set(blocking) <= offered, f"{p} lacks {set(blocking) - offered}"
        for index in blocking:
            assert filter_of_shadow_ray(plan, 0, w, p, index), (p, index)
    assert hits
    return offers / hits


def touching(across: Floats, ahead: Floats, x: float, p: Floats, radius: float, side: int) -> tuple[list[float], float]:
    """Centre and radius of a sphere whose outermost point is p: with side 1 that of the lowest slope, -1 the highest.

    The slope is across.p / ahead.p, which is x at p: the plane through the origin that touches there has the normal
    across - x ahead.
    """
    n = across - x * ahead
    n = n / np.linalg.norm(n)
    return (p + side * radius * n).tolist(), radius


# ------------------------------------------------------------------------------------------------------ primary rays


def random_balls(count: int, seed: int, **light: object) -> Scene:
    rng = np.random.default_rng(seed)
    centers = np.column_stack([rng.uniform(-3, 3, (count, 2)), rng.uniform(-9, -4, count)])
    sizes = 2.0 ** rng.uniform(-6, 0, count)
    return balls(looking(tan=0.6, size=(47, 33)), zip(centers.tolist(), sizes.tolist(), strict=True), **light)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "make",
    [
        lambda: random_balls(60, 1),
        lambda: field((47, 33)),
        lambda: field((47, 33), 1e7),
        lambda: field((47, 33), offset=2.0**20),
        lambda: balls(looking(size=(3, 2)), [((0, 0, -5), 4), ((0.1, 0, -9), 0.5)]),
        lambda: balls(looking(size=(33, 33)), [((0, 0, 0), 1), ((0, 0, 0.25), 1e6), ((0, 0, -1), 1 - 2.0**-30)]),
        lambda: balls(
            (c := looking(tan=1, size=(63, 47))),
            aimed(c, 10, 1, limbs(4, 46, 80, (r := np.random.default_rng(1))), r),
        ),
    ],
    ids=["random", "ground", "large ground", "far away", "one tile", "inside", "limbs"],
)
@pytest.mark.parametrize("spare", [1, grids.SPARE], ids=["levels", "level 0"])
def test_pixels_are_offered_all_that_they_meet(
    make: Callable[[], Scene], spare: int, plan_of: PlanOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    for where in (grids, device_lists):
        monkeypatch.setattr(where, "SPARE", spare)
    check_pixels(make(), plan_of=plan_of)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tan", "size", "reach"),
    [(1.0, (64, 48), 32), (40.0, (64, 48), 32), (1e-8, (64, 48), 32), (0.5, (16384, 4), 30), (0.5, (4, 16384), 30)],
    ids=["usual", "wide angle", "narrow angle", "wide picture", "high picture"],
)
@pytest.mark.parametrize("axis", [0, 1], ids=["columns", "rows"])
def test_a_hair_at_the_edge_of_a_tile(tan: float, size: tuple[int, int], reach: int, axis: int) -> None:
    """Spheres of which the ray of one pixel, the first or the last one of its tile, meets the outermost point.

    reach: how far from the picture's middle those pixels are, in pixels.
    """
    rng = np.random.default_rng(2)
    camera = looking(tan=tan, size=size)
    d = directions(camera).reshape(*size[::-1], 3)
    (width, height), count = size, 160
    x = width // 2 + rng.integers(max(-reach, -width // 2), min(reach, width // 2), count)
    y = height // 2 + rng.integers(max(-reach, -height // 2), min(reach, height // 2), count)
    side = rng.choice([1, -1], count)
    # Its tile is the last one that the sphere is in, from the side where it is: the next ones see only more of it.
    (x, y)[axis][:] = ((x, y)[axis] & ~3) + np.where((side > 0) == (axis == 0), 3, 0)
    keep = (x < width) & (y < height)
    spheres, ahead, across = [], np.array([0, 0, -1.0]), np.eye(3)[axis]
    for i, j, s, k in zip(x[keep], y[keep], side[keep], rng.integers(20, 45, count), strict=False):
        p = d[j, i] * rng.uniform(2, 3)
        radius = tan * 2.0 ** -rng.integers(0, 9)
        center, _ = touching(across, ahead, float(d[j, i, axis]), p, radius, s)
        spheres.append((center, radius * (1 + 2.0**-k)))
    scene = balls(camera, spheres)
    # Of each sphere, only its own pixel matters.
    check_pixels(scene, np.unique(y[keep] * width + x[keep]))


# -------------------------------------------------------------------------------------------------------- shadow rays


LIGHTS = {
    "sun above": [parallel_light((0, -1, 0))],
    "sun aslant": [parallel_light((0.3, -1, -0.7))],
    "lamp far away": [point_light((50, 80, 20))],
    "lamp among them": [point_light((0.5, 0.25, -6))],
    "lamp at the eye": [point_light((0, 0, 0))],
}


def on_surfaces(scene: Scene, count: int) -> Floats:
    """Points of the spheres, in camera space, the eye being at the origin."""
    rng = np.random.default_rng(3)
    which = scene.spheres[rng.integers(0, len(scene.spheres), count)]
    return np.asarray(which["center"] + which["radius"][:, None] * unit(rng, count) - scene.camera.position)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("spare", [1, grids.SPARE], ids=["levels", "level 0"])
def test_shadow_rays_are_offered_all_that_is_on_their_way(
    light: str, spare: int, plan_of: PlanOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    for where in (grids, device_lists):
        monkeypatch.setattr(where, "SPARE", spare)
    scene = random_balls(60, 4, lights=LIGHTS[light])
    check_light(scene, on_surfaces(scene, 300), plan_of=plan_of)


def cluster(light: str, size: float) -> Scene:
    """1,000 equal balls within `size`, so small that there are as many cells as there may be."""
    rng = np.random.default_rng(5)
    centers = np.array([0, 0, -8]) + size * rng.uniform(-1, 1, (1000, 3))
    return balls(looking(), zip(centers.tolist(), [size / 4096] * 1000, strict=True), LIGHTS[light])


@pytest.mark.parametrize("light", ["sun above", "sun aslant", "lamp far away", "lamp at the eye"])
@pytest.mark.parametrize("size", [2.0**-4, 1.0, 3.0])
@pytest.mark.parametrize("axis", [0, 1], ids=["columns", "rows"])
def test_a_hair_at_the_edge_of_a_cell(light: str, size: float, axis: int) -> None:
    """Spheres whose outermost points are where a cell of a light's window ends, and shadow rays through them."""
    base = cluster(light, size)
    plan = Plan.of_scene(base, Request(keep=ALL))
    grid = plan.arrays["grid"][plan.arrays["light_buffer"][0, 0]]
    rows, shift = np.array([grid[name][:3] for name in ("right", "up", "ahead")]), [grid[n][3] for n in ("right", "up")]
    parallel, source = parallel_lights(plan) > 0, plan.arrays["light"][0]["position"][:3]
    back, unit_length = np.linalg.inv(rows), plan.values["unit"]
    rng = np.random.default_rng(6)
    spheres, points, r = base.spheres.copy(), [], float(base.spheres["radius"][0])
    for i in range(0, 300):
        cells = grid["cells"][:2]
        # From a quarter to three quarters: balls that are moved there leave the window as it is.
        edge = rng.integers(cells[axis] // 4, 3 * cells[axis] // 4)
        place = rng.uniform(-0.5, 0.5, 2) * grid["window"][:2]
        place[axis] = -float(grid["window"][axis]) + edge * 2 * float(grid["window"][axis]) / cells[axis]
        side = 1 if i % 2 else -1
        if parallel:
            c = (spheres["center"][i] * unit_length) @ rows[2]
            p = back @ np.array([*(place - shift), c]) / unit_length
            center, _ = touching(rows[axis], np.zeros(3), 0.0, p, r, side)
            points.append(p - 4 * r * rows[2])
        else:
            d = back @ np.array([*place, 1.0])
            distance = (spheres["center"][i] - source) @ rows[2]
            center, _ = touching(rows[axis], rows[2], place[axis], d * distance, r, side)
            center = (np.array(center) + source).tolist()
            points.append(source + d * (distance + 4 * r))
        spheres["center"][i], spheres["radius"][i] = center, r * (1 + 2.0 ** -rng.integers(20, 36))
    scene = Scene(base.camera, base.lights, spheres, base.materials)
    again = Plan.of_scene(scene, Request(keep=ALL))
    assert again.arrays["grid"]["cells"][again.arrays["light_buffer"][0, 0], :2].tolist() == grid["cells"][:2].tolist()
    check_light(scene, np.array(points))


@pytest.mark.parametrize("light", ["sun above", "sun aslant", "lamp far away", "lamp at the eye"])
@pytest.mark.parametrize("size", [2.0**-4, 1.0])
def test_a_hair_at_the_edge_of_a_window(light: str, size: float) -> None:
    """Each ball has a twin behind it that looks as large, but for a hair; points all around the twins."""
    rng = np.random.default_rng(7)
    centers = np.array([0, 0, -8]) + size * rng.uniform(-1, 1, (30, 3))
    radii = size * rng.uniform(0.01, 0.1, 30)
    lights = LIGHTS[light]
    plan = Plan.of_scene(
        balls(looking(), zip(centers.tolist(), radii.tolist(), strict=True), lights), Request(keep=ALL)
    )
    source, grid = plan.arrays["light"][0]["position"][:3], plan.arrays["grid"][1]
    hair = 1 - 2.0 ** -rng.integers(26, 40, 30)
    if parallel_lights(plan):
        others, sizes = centers - 4 * size * source, radii * hair
    else:
        others, sizes = source + (centers - source) * 1.5, 1.5 * radii * hair
    points = []
    for c, r in zip(others, sizes, strict=True):
        for across in (grid["right"][:3], grid["up"][:3], -grid["right"][:3], -grid["up"][:3]):
            # Where a plane through the light touches: its normal is across, less what of it is along the way there.
            far = np.inf if parallel_lights(plan) else np.linalg.norm(c - source)
            way = source if parallel_lights(plan) else (source - c) / far
            side = across - (across @ way) * way
            side /= np.linalg.norm(side)
            sine = r / far
            points.append(c + r * (side * np.sqrt(1 - sine * sine) + way * sine))
    every = zip([*centers.tolist(), *others.tolist()], [*radii.tolist(), *sizes.tolist()], strict=True)
    check_light(balls(looking(), every, lights), np.array(points))


@pytest.mark.parametrize("light", LIGHTS)
def test_a_hair_behind_the_nearest_point(light: str) -> None:
    """Shadow rays from points just behind where a ball begins, as seen from the light: the ball is on their way."""
    scene = random_balls(60, 8, lights=LIGHTS[light])
    place = Plan.of_scene(scene, Request()).arrays["light"][0]["position"][:3].astype(float)
    centers, radii, points = scene.spheres["center"], scene.spheres["radius"], []
    for k in range(16, 30):
        ways = np.broadcast_to(place, centers.shape) if light.startswith("sun") else place - centers
        ways = ways / np.linalg.norm(ways, axis=1)[:, None]
        points.append(centers + ways * (radii * (1 - 2.0**-k))[:, None])
    check_light(scene, np.concatenate(points))


@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_nearest_points_from_inside(scale: float) -> None:
    """The depth of a sphere around the eye is where it ends, not 0: just before its nearest point, not beyond."""
    rng = np.random.default_rng(12)
    gap = 2.0 ** -rng.uniform(0, 24, 400)
    offset = unit(rng, 400) * (1 - gap)[:, None] * scale
    exact = [Fraction(scale) ** 2 - sum(Fraction(x) ** 2 for x in row) for row in offset.tolist()]
    power = np.array([-float(p) for p in exact])
    distance = np.array([math.sqrt(sum(Fraction(x) ** 2 for x in row)) for row in offset.tolist()])
    near = Discs(offset, np.full(400, scale), power).nearest(np.arange(400), [offset.T])
    true = np.array([float(p) for p in exact]) / (distance + scale)
    seen = near > 0
    assert (seen == (true > 2.0**-50)).all()
    assert (near[seen] <= true[seen] ** 2).all()
    assert (near[seen] > true[seen] ** 2 * (1 - 2.0**-17)).all()


@pytest.mark.parametrize("light", LIGHTS)
def test_what_is_not_in_the_picture_casts_shadows_into_it(light: str) -> None:
    """Beads on a ball, of which the picture shows only the middle. A bead may only shadow the ball, which is seen."""
    rng = np.random.default_rng(9)
    where = unit(rng, 300)
    center = np.array([0, 0, -5.0])
    beads = (center + where[np.abs(where[:, 2]) < 0.9]).tolist()
    spheres = [(center.tolist(), 1.0), *((bead, 0.05) for bead in beads)]
    scene = balls(looking(tan=0.02), spheres, LIGHTS[light])
    assert len(Plan.of_scene(scene, Request()).arrays["id_of"]) == len(spheres)
    check_light(scene, np.asarray(center + unit(rng, 300)), keep=("hidden",))


# -------------------------------------------------------------------------------------------------------- little else


def test_little_else_is_offered() -> None:
    """For each sphere that a ray meets, so many are in its lists; the bounds are what was measured and 3 % more."""
    scene = cloud(1000, (64, 48))
    points = on_surfaces(scene, 300)
    assert check_pixels(scene, np.arange(0, 64 * 48, 7)) <= 10
    for light, most in (("sun aslant", 4.8), ("lamp far away", 5.5)):
        assert check_light(replace(scene, lights=np.concatenate(LIGHTS[light])), points) <= most


def test_little_else_is_offered_in_a_small_window() -> None:
    """Cells far smaller than what float32 resolves at 1: they are looked up in double."""
    scene = cluster("lamp far away", 2.0**-9)
    assert check_light(scene, on_surfaces(scene, 300)) <= 3.6


def test_lights_where_many_spheres_meet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Spheres through the origin and lights there: for each pair |L - C|^2 is r^2, and no fraction is made for any."""
    size = np.arange(1, 61) / 8
    scene = Scene.from_spheres(looking(), [point_light((0, 0, 0))] * 60, size[:, None] * (3, 4, 0), size * 5)
    monkeypatch.setattr(rounding, "Fraction", None)
    sides = Plan.of_scene(scene, Request(keep=("hidden", "receivers"))).arrays["light_side"]
    assert sides.shape == (3600,)
    assert (sides == 0).all()
