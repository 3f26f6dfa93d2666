"""From a scene to what a device needs to draw it: World, View, Plan. numpy alone, picklable.

A World is what no camera changes. A View adds a camera and a part of its picture. A Plan adds the outputs.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan import abi
from cltrace.plan.abi import CONSTANTS, dtype_of, real_dtype
from cltrace.plan.accel.cells import SLACK, CellGrid, Mask, build, whole_grid
from cltrace.plan.accel.light_buffer import FINE_SLACK, Shadows, parallel_buffer, point_buffer
from cltrace.plan.accel.tiles import Window, picture_tiles
from cltrace.plan.culling import hidden, parallel_shadows, point_shadows, repeated
from cltrace.plan.exact import Array
from cltrace.plan.features import Contents, features
from cltrace.plan.lights import LightView, LightViews, counts, pack_lights, useful_lights
from cltrace.plan.materials import Materials
from cltrace.plan.order import spatial_order
from cltrace.plan.request import Region, Request
from cltrace.plan.shapes.sphere import Seen, filter_constant
from cltrace.plan.space import Space
from cltrace.scene import AMBIENT, Camera, Scene, Vector

# From so many spheres on, they are sorted by place. A shell of 100,000 takes 27 ms a frame then, against 37; 10,000
# take 10 either way, as all that a picture needs stays in a cache.
MANY = 4096


@dataclass(frozen=True)
class World:
    """What no camera changes, for one precision.

    center (n, 3), radius (n,): of the spheres in the world, in the order in which they are packed; id (n,): their
    places in the scene; material_of (n,): index into materials; again (n,): whether it is the same sphere as one before
    it; lights: those that can add to a colour; skipped: what the scene did not need, and how often.
    """

    center: Array
    radius: Array
    id: NDArray[np.int32]
    material_of: NDArray[np.int32]
    again: Mask
    materials: Materials
    lights: NDArray[np.void]
    background: Vector
    skipped: dict[str, int]

    @classmethod
    def of(cls, scene: Scene, request: Request) -> World:
        """Sorts many spheres by place, so that neighbours are near each other in memory."""
        n = len(scene.spheres)
        center, radius, of = (np.ascontiguousarray(scene.spheres[name]) for name in ("center", "radius", "material"))
        order, by_place = np.arange(n), n >= MANY and "order" not in request.keep
        if by_place:
            order = spatial_order(center)
            center, radius, of = (column.take(order, axis=0) for column in (center, radius, of))
        materials = Materials.of(scene, request.precision)
        lights = useful_lights(scene, materials, "lights" in request.keep)
        useless = int((scene.lights["kind"] != AMBIENT).sum()) - len(lights)
        # Where most spheres have a material of their own, those are in the spheres' order, too.
        if len(materials.packed) > n // 2:
            materials, of = replace(materials, packed=materials.packed.take(of, axis=0)), np.arange(n)
        return cls(
            center,
            radius,
            order.astype("i4"),
            of.astype("i4"),
            repeated(center, radius, by_place),
            materials,
            lights,
            scene.background,
            {"lights that add nothing": useless} if useless else {},
        )


@dataclass(frozen=True)
class View:
    """A world as a camera sees it.

    region: the part of its picture that is wanted; exponent: depths come out in units of 2^exponent; arrays: the
    buffers by the kernel's names, none of them empty; values: the kernel's other arguments that depend on no output;
    inside: whether the eye is inside of a sphere; seconds: of making the lists.
    """

    camera: Camera
    region: Region
    exponent: int
    arrays: dict[str, NDArray[Any]]
    values: dict[str, Any]
    inside: bool
    skipped: dict[str, int]
    seconds: dict[str, float]

    @classmethod
    def of(cls, world: World, camera: Camera, request: Request) -> View:
        """Moves the world into camera space, exactly, and finds out which surfaces a ray can meet."""
        region = request.region_of(camera.resolution)
        real, basis = real_dtype(request.precision), np.array(camera.basis())
        space = Space.of(camera, world.center, world.radius, world.lights)
        # float32 has little room for squares. So what is float32 has its lengths times a power of two that makes the
        # largest coordinate about 1: a scene and the same one scaled by a power of two are the same numbers there.
        # Double has room for the fourth power of every float32 number, and keeps scene units.
        k = space.exponent(world.lights)
        small = space.times_two_to(k)
        exact, unit = (small, 0) if real.itemsize == 4 else (space, k)

        lights = pack_lights(world.lights, exact.position, basis, request.precision, world.materials.brightest)
        arrays = _spheres(world, exact, small, real) | _in_world(world, camera, space, real) | {"light": lights}
        skipped = dict(world.skipped)
        seconds: dict[str, float] = {}
        views = LightViews.of(world.lights, lights, small, basis)
        arrays |= {"light_filter": views.filter.reshape(-1, 4), "light_side": views.side.reshape(-1)}
        x, y = camera.image_plane()
        width, height = camera.resolution
        with _timed(seconds, "lists"):
            window = Window((x / width, y / height), camera.resolution, region)
            arrays |= _lists(world, small.seen_from_eye(), views.views, window, request, skipped)
        return cls(
            camera,
            region,
            -k if real.itemsize == 4 else 0,
            {name: a if len(a) else np.zeros((1, *a.shape[1:]), a.dtype) for name, a in arrays.items()},
            {
                "lights": (*counts(world.lights), len(world.lights)),
                "count": len(world.radius),
                "unit": math.ldexp(1.0, unit),
            },
            bool((space.power <= 0).any()),
            skipped,
            seconds,
        )


@dataclass(frozen=True)
class Plan:
    """A view and what is to be written of it: all that a device needs.

    size: of the whole picture; features: the names of the -D flags; exponent, arrays, skipped, seconds: of View;
    values: all the kernel's arguments that are no buffers, but for those that only the launch knows.
    """

    request: Request
    size: tuple[int, int]
    region: Region
    exponent: int
    features: frozenset[str]
    arrays: dict[str, NDArray[Any]]
    values: dict[str, Any]
    skipped: dict[str, int]
    seconds: dict[str, float]

    @classmethod
    def of(cls, world: World, view: View, request: Request) -> Plan:
        """request: the one that world and view were made for, or the same with other outputs."""
        contents = Contents(
            len(world.radius),
            counts(world.lights),
            view.inside,
            world.materials.shiny,
            bool(world.materials.black.any()),
        )
        return cls(
            request,
            view.camera.resolution,
            view.region,
            view.exponent,
            features(contents, request),
            view.arrays,
            view.values | {"frame": _frame(world, view, request), "size": view.camera.resolution},
            view.skipped,
            view.seconds,
        )

    @classmethod
    def of_scene(cls, scene: Scene, request: Request) -> Plan:
        """All three steps at once, for a scene that is seen by its own camera only."""
        world = World.of(scene, request)
        return cls.of(world, View.of(world, scene.camera, request), request)

    def counting(self) -> Plan:
        """The same, for a kernel that does all that it did, but writes only what it has counted."""
        rest = (name for name in self.features if not name.startswith("OUT_"))
        request = replace(self.request, outputs=("work",), keep=())
        return replace(self, request=request, features=frozenset((*rest, "OUT_WORK")))

    def options(self) -> list[str]:
        """The compiler's options: one program for each combination of features, whatever the scene's numbers are."""
        return abi.options(self.request.precision, self.features)


@contextmanager
def _timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[name] = time.perf_counter() - start


def _spheres(world: World, exact: Space, small: Space, real: np.dtype[Any]) -> dict[str, NDArray[Any]]:
    """The buffers that have a record for each sphere. exact: in units of `real`; small: in those of float buffers."""
    # Beyond float32's range is only the reciprocal of a radius that vanishes there: such a sphere is never hit.
    largest = float(np.finfo(np.float32).max) if real.itemsize == 4 else np.inf
    eye_filter = np.empty((len(small.radius), 4), np.float32)
    eye_filter[:, :3], eye_filter[:, 3] = small.center, filter_constant(small.seen_from_eye())
    return {
        "center_radius": np.concatenate([exact.center, exact.radius[:, None]], axis=1).astype(real),
        "power": np.stack([exact.power, np.minimum(1 / exact.radius, largest)], axis=1).astype(real),
        "id_of": world.id,
        "material_of": world.material_of,
        "material": world.materials.packed,
        "eye_filter": eye_filter,
    }


def _in_world(world: World, camera: Camera, space: Space, real: np.dtype[Any]) -> dict[str, NDArray[Any]]:
    """The buffers by which a ray from the eye is decided exactly; empty in single. space: in scene units."""
    if real.itemsize == 4:
        return {"world": np.zeros((0, 4), real), "camera": np.zeros((0, 4), real)}
    return {
        "world": np.concatenate([world.center, space.power_rest[:, None]], axis=1),
        "camera": np.array([(*vector, 0.0) for vector in (camera.position, *camera.basis())]),
    }


def _lists(
    world: World, seen: Seen, lights: list[LightView], window: Window, request: Request, skipped: dict[str, int]
) -> dict[str, NDArray[Any]]:
    """The lists of the picture's tiles and of all light buffers. skipped: counts what is in none of them."""
    n, keep = len(seen.radius), request.keep
    slack = SLACK if request.precision == "single" else FINE_SLACK
    visible = np.ones(n, bool)
    if "hidden" not in keep and n > 1:
        outside = (seen.power > 0) & np.all([light.side > 0 for light in lights], axis=0)
        visible = ~(world.again | hidden(seen.center, seen.radius, outside, slack))
        skipped["spheres inside others, or the same"] = n - int(visible.sum())
    tiles = picture_tiles(seen, visible, window)
    receiver = np.full(n, "receivers" in keep)
    receiver[tiles.member] = True
    if "lists" in keep:
        tiles = whole_grid(visible)
    skipped["spheres out of the picture"] = n - len(tiles.member)

    grids, buffers, idle = [tiles], np.zeros((len(lights), 4), np.int32), 0
    for k, light in enumerate(lights):
        more, stops = _light_buffer(light, seen.power, Shadows(visible, receiver, slack), keep)
        if "lists" in keep:
            more = [whole_grid(visible)]
        entered = np.zeros(n, bool)
        for grid in more:
            entered[grid.member] = True
        idle += n - int(entered.sum())
        buffers[k] = len(grids), len(more), stops, 0
        grids += more
    skipped["spheres that shadow nothing seen, per light"] = idle
    lists = build(grids, request.precision)
    return {"light_buffer": buffers, "grid": lists.grid, "start": lists.start, "entry": lists.entry}


def _light_buffer(light: LightView, power: Array, who: Shadows, keep: tuple[str, ...]) -> tuple[list[CellGrid], int]:
    """The grids of a light, and for few spheres a bit for each one that anything can stop the light for; else all bits.

    power: of the eye, (n,).
    """
    n = len(power)
    # Up to FEW spheres, finding the right list for a shadow ray costs more than trying them all: 3.5 ms a frame against
    # 3.2 for a box of 16 (PoCL 3.1, 1920x1080), but 4.3 against 4.6 for a shell of 28.
    if n > CONSTANTS["FEW"]:
        if light.axes is None:
            return point_buffer(light.seen, who), -1
        return parallel_buffer(light.axes, light.seen, who), -1
    if light.axes is None:
        shadows = point_shadows(light.seen, who.slack)
    else:
        shadows = parallel_shadows(light.axes, light.seen, who.slack)
    shadows &= who.receiver[:, None] & who.occluder
    # From outside a sphere never stands in its own way, from inside it may.
    np.fill_diagonal(shadows, power <= 0)
    casting = np.asarray(shadows.any(axis=0) | ("receivers" in keep))
    stops = int(((shadows.any(axis=1) | ("unstopped" in keep)) << np.arange(n)).sum())
    return [whole_grid(casting)] if casting.any() else [], stops


def _frame(world: World, view: View, request: Request) -> NDArray[np.void]:
    """abi's `Frame`."""
    frame = np.zeros((), dtype_of("Frame", request.precision))
    x, y = view.camera.image_plane()
    width, height = view.camera.resolution
    frame["pixel"][:2] = x / width, y / height
    for name, axis in zip(("right", "up", "back"), view.camera.basis(), strict=True):
        frame[name][:3] = axis
    rounding = 0.0 if request.truncate else 0.5
    shade = abi.shade_dtype(request.precision)
    frame["background"][:3] = [_same_byte(c, rounding, shade) for c in world.background]
    frame["quantize"][0] = rounding
    return frame


def _same_byte(c: float, rounding: float, shade: np.dtype[Any]) -> np.float32:
    """A background colour in float32, moved by an ulp if that is what its byte needs to be that of the double.

    0.7 is all but 178.5 of 255: without this, the whole sky could be another level than the reference's.
    """
    near = np.float32(min(c, float(np.finfo(np.float32).max)))
    want = int(min(c, 1.0) * 255 + rounding)
    one = shade.type(1)
    for value in (near, np.nextafter(near, np.float32(0)), np.nextafter(near, np.float32(np.inf))):
        clamped = min(shade.type(value), one)
        if int(clamped * shade.type(255) + shade.type(rounding)) == want:
            return np.float32(value)
    return near
