"""From a scene to what a device needs to draw it: World, View, Plan. numpy alone, picklable.

A World is what no camera changes. A View adds a camera and a part of its picture. A Plan adds the outputs.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.blocks import blockwise, empty, joined
from cltrace.plan import abi
from cltrace.plan.abi import CONSTANTS, dtype_of, real_dtype
from cltrace.plan.accel.cells import SLACK, CellGrid, Mask, build, entries_of_boxes, whole_grid
from cltrace.plan.accel.light_buffer import FINE_SLACK, Shadows, parallel_buffer, point_buffer
from cltrace.plan.accel.tiles import LOOSE, Window, behind, is_crowded, picture_tiles
from cltrace.plan.attributes import Attributes
from cltrace.plan.bounces import NO_BOUNCES, Bounces
from cltrace.plan.culling import hidden, parallel_shadows, point_shadows, repeated
from cltrace.plan.dropping import brightest, limits
from cltrace.plan.exact import Array, rotated, rounded_up
from cltrace.plan.features import Contents, features
from cltrace.plan.lights import LightView, LightViews, counts, dim_highlights, pack_lights, useful_lights
from cltrace.plan.materials import Materials, may_bounce
from cltrace.plan.order import gathered, spatial_order, step
from cltrace.plan.paths import NO_PATHS, Paths
from cltrace.plan.request import Region, Request
from cltrace.plan.shapes.ellipsoid import Maps
from cltrace.plan.shapes.polygon import Corners
from cltrace.plan.shapes.sphere import Seen, disc_filter, filter_constant
from cltrace.plan.shapes.triangle import Triangles, along_light, from_eye, from_light
from cltrace.plan.space import Space
from cltrace.plan.textures import NO_TEXTURES, Textures
from cltrace.scene import AMBIENT, PARALLEL, AnyCamera, Scene, Vector

# From so many spheres on, they are sorted by place. A shell of 100,000 then takes 27 ms a frame instead of 37. One of
# 10,000 takes 10 either way, as all that a picture needs stays in a cache.
MANY = 4096
OrderOf = Callable[[NDArray[Any]], NDArray[np.int32]]
# Up to so many times as far as at first may neighbours in an order be from each other before it is made anew.
WORSE = 2.0


@dataclass(frozen=True)
class World:
    """What no camera changes: n spheres, meshes, their materials and the lights, for one precision.

    order: (n,), the index in the scene of each sphere, in the order in which they are packed; step: of that order when
    it was made, see order.step(); center: (n, 3) float64, and radius: (n,) float64, in the world, in scene units; maps:
    what makes ellipsoids of some, None if there are none; reach: (n,) float64, no less than how far a surface is from
    its centre, which of a sphere is the radius; triangles: those of the meshes, t of them, and attributes: what their
    corners have for shading; id: (n + t,), the number of each sphere's or triangle's surface in the scene; material_of:
    (n + t,), the index of each one's material in materials; textures: those that surfaces have; again: (n,), whether it
    is equal to a sphere with a lower number; lights: (m,) of the scene's records, those that can add to a
    colour, in the order parallel, point, spot; bounces: what surfaces do with rays; paths: what rays need that leave
    surfaces, None where there are neither ellipsoids nor such rays; background: linear (r, g, b); peak: (3,),
    brightest() where a ray may become two or
    pixels are antialiased, else 0; skipped: what the scene does not need, in words, and how often;
    seconds: what took how long: "tree".
    """

    order: NDArray[np.int32]
    step: float
    center: Array
    radius: Array
    maps: Maps | None
    reach: Array
    triangles: Triangles
    attributes: Attributes
    id: NDArray[np.int32]
    material_of: NDArray[np.int32]
    again: Mask
    materials: Materials
    textures: Textures
    lights: NDArray[np.void]
    bounces: Bounces
    paths: Paths | None
    background: Vector
    peak: Array
    skipped: dict[str, int]
    seconds: dict[str, float]

    @property
    def opaque(self) -> Mask:
        """(n,): which spheres let no ray through."""
        n, bounce = len(self.radius), self.materials.bounce
        return np.asarray(bounce[self.material_of[:n], 1] == 0) if len(bounce) else np.ones(n, bool)

    @classmethod
    def of(
        cls, scene: Scene, request: Request, before: Before | None = None, order_of: OrderOf = spatial_order
    ) -> World:
        """The world of a scene. Many spheres are sorted by place, so that neighbours are near each other in memory.

        before: a world of another scene with as many meshes, for the same request. What they have in common is taken
        from it, and the spheres' order, if it is still good. order_of: what finds the order that spatial_order() does.
        """
        columns, keep = scene.columns, request.keep
        places = _places(scene, request, before, order_of)
        center, radius, order = places.center, places.radius, places.order
        known = before.world if before and before.world.center is center else None
        sided = bool(scene.meshes) and may_bounce(scene, request)
        if before and before.scene.meshes is scene.meshes and before.world.triangles.sided >= sided:
            triangles, attributes = before.world.triangles, before.world.attributes
        else:
            triangles = Triangles.of(scene.meshes, scene.triangles >= MANY and "order" not in keep, sided)
            textured = bool(scene.textures) or "uv" in request.outputs
            attributes = Attributes.of(scene.meshes, triangles, request.precision, textured)
        if known and known.radius is radius and known.triangles is triangles:
            maps, reach, number, again = known.maps, known.reach, known.id, known.again
            core = radius * maps.shortest[maps.of_sphere] if maps else radius
        else:
            known = None
            number = order if not scene.meshes else scene.sphere_numbers.take(order)
            shape = columns.to_object.take(order) if columns.to_object.ndim else columns.to_object
            again = repeated(center, radius, shape, number, places.by_place)
            number = joined([number, triangles.surface]) if scene.meshes else number
            maps, reach, core = None, radius, radius
            if (shape >= 0).any():
                maps = Maps.of(shape, scene.to_object)
                reach, core = (radius * by[maps.of_sphere] for by in (maps.longest, maps.shortest))
        if before and before.scene.columns.shade is columns.shade and before.world.order is order:
            materials, of = before.world.materials, before.world.material_of
        else:
            materials, of = _materials(scene, request, order, triangles)
        lights = useful_lights(scene.lights, materials.reflect(of), "lights" in keep)
        useless = int((scene.lights["kind"] != AMBIENT).sum()) - len(lights)
        bounces = Bounces.of(materials.bounce, of, "bounces" in keep) if request.needs_colors else NO_BOUNCES
        paths, seconds = None, dict[str, float]()
        if known and known.bounces.any == bounces.any:
            paths = known.paths
        elif len(of) and (bounces.any or maps or scene.triangles):
            with _timed(seconds, "tree"):
                member = ~again if bounces.any else None
                paths = Paths.of(center, reach, core, member, triangles.vertex, triangles.face[:, :3])
        return cls(
            order,
            places.step,
            center,
            radius,
            maps,
            reach,
            triangles,
            attributes,
            number,
            of,
            again,
            materials,
            Textures.of(scene.textures, materials.texture, of) if request.needs_colors else NO_TEXTURES,
            lights,
            bounces,
            paths,
            scene.background,
            brightest(materials, of, lights, scene.background) if bounces.splits or request.antialias else np.zeros(3),
            {"lights that add nothing": useless} if useless else {},
            seconds,
        )

    def differs_in_materials(self, other: World) -> bool:
        """Whether all that a View shows of one is what it shows of the other, but for colours and coefficients."""
        names = ("center", "radius", "triangles", "attributes", "id", "again", "paths")
        return (
            all(getattr(self, name) is getattr(other, name) for name in names)
            and self.lights.tobytes() == other.lights.tobytes()
            and (self.bounces.any, self.bounces.glass) == (other.bounces.any, other.bounces.glass)
            and (not self.bounces.any or np.array_equal(self.opaque, other.opaque))
        )


class Before(NamedTuple):
    """A scene and its world."""

    scene: Scene
    world: World


class _Places(NamedTuple):
    """Spheres in the order in which they are packed: see World. by_place: whether neighbours are near each other."""

    order: NDArray[np.int32]
    step: float
    by_place: bool
    center: Array
    radius: Array


def _places(scene: Scene, request: Request, before: Before | None, order_of: OrderOf) -> _Places:
    """Where the spheres are. before, order_of: see World.of()."""
    columns = scene.columns
    n = len(columns)
    by_place = n >= MANY and "order" not in request.keep
    center, order, far = None, None, 0.0
    old, world = (before.scene.columns, before.world) if before and len(before.scene.columns) == n else (None, None)
    if old and world:
        order, far = world.order, world.step
        center = world.center if old.center is columns.center else gathered(columns.center, order, (n, 3), np.float64)
        if by_place and center is not world.center and step(center) > WORSE * far:
            order = None
    if order is None or center is None:
        order = order_of(columns.center) if by_place else np.arange(n, dtype=np.int32)
        center = gathered(columns.center, order, (n, 3), np.float64)
        far = step(center) if by_place else 0.0
    if old and world and old.radius is columns.radius and order is world.order:
        return _Places(order, far, by_place, center, world.radius)
    return _Places(order, far, by_place, center, gathered(columns.radius, order, (n,), np.float64))


def _materials(
    scene: Scene, request: Request, order: NDArray[np.int32], triangles: Triangles
) -> tuple[Materials, NDArray[np.int32]]:
    """The materials, and the index of that of each sphere, which are in this order (n,), and of each triangle.

    Where most spheres have a material of their own, those are in the spheres' order, too.
    """
    columns, n = scene.columns, len(order)
    of = order if columns.material is None else gathered(columns.material, order, (n,), np.int32)
    if columns.materials_count > n // 2 and not scene.meshes:
        return Materials.of(scene, request, of), np.arange(n, dtype=np.int32)
    return Materials.of(scene, request, None), joined([of, triangles.material])


@dataclass(frozen=True)
class View:
    """A world as one camera sees it.

    region: (x, y, width, height), the part of the picture that is wanted, in pixels; exponent: the kernel's depths are
    in units of 2^exponent scene units; arrays: the kernel's buffers by name, with the dtypes of abi.ARGUMENTS, none of
    them empty; values: those of its other arguments that depend on no output; inside: whether the eye is inside of a
    sphere or on it; skipped: of World, and what this camera does not need; seconds: what took how long: "lists".
    """

    camera: AnyCamera
    region: Region
    exponent: int
    arrays: dict[str, NDArray[Any]]
    values: dict[str, Any]
    inside: bool
    skipped: dict[str, int]
    seconds: dict[str, float]

    @classmethod
    def of(cls, world: World, camera: AnyCamera, request: Request, methods: Methods | None = None) -> View:
        """Moves the world into camera space, in more than double precision, and lists which surfaces a ray can meet.

        request: the one that the world was made for; methods: for what takes longest, None for numpy's. Raises
        ValueError if its crop is not within the picture.
        """
        basis = np.array(camera.basis())
        stretched = world.maps.of_sphere > 0 if world.maps else None
        space = Space.of(camera, world.center, world.reach, stretched, world.lights)
        near = from_point(world, basis, np.array(camera.position))
        k = space.exponent(world.lights, near, max(camera.image_plane()) if camera.parallel else 0.0)
        near *= 2.0**k
        small = space.times_two_to(k)
        lights = packed_lights(world, camera, request, k)
        base = cls.without_spheres(world, camera, request, k)
        seen = small.seen_along_view() if camera.parallel else small.seen_from_eye()
        arrays, skipped = _spheres(world, space, small, camera, request, k), dict(base.skipped)
        seconds: dict[str, float] = {}
        views = LightViews.of(world.lights, lights, small, basis)
        if world.maps:
            for side, light in zip(views.side, world.lights, strict=True):
                if light["kind"] != PARALLEL:
                    sides = world.maps.sides(world.center, world.radius, light["position"])
                    side[:] = np.where(world.maps.of_sphere > 0, sides, side)
        arrays |= {"light_filter": views.filter.reshape(-1, 4), "light_side": views.side.reshape(-1)}
        with _timed(seconds, "lists"):
            methods = methods or Methods(mesh_views, lambda grids: build(list(grids), request.precision).arrays())
            faces, facets = methods.see_meshes(world, camera, lights, near, k)
            arrays |= facets
            if request.antialias is None:
                arrays |= {"neighbour": world.triangles.face[:0], "face_side": np.zeros(0, np.int8)}
            else:
                arrays["neighbour"] = world.triangles.neighbours
            window = Window.of(camera, request, k)
            arrays["light_buffer"] = np.zeros((len(lights), 4), np.int32)
            what = views.views, faces, arrays["light_buffer"], skipped
            arrays |= methods.build(_grids(world, small, seen, window, request, *what))
        return replace(
            base,
            arrays=base.arrays | _not_empty(arrays),
            inside=bool((seen.power <= 0).any()),
            skipped=skipped,
            seconds=seconds,
        )

    def recolored(self, world: World, request: Request) -> View:
        """The same view of a world that differs_in_materials() from the one that was seen."""
        brightest = world.materials.brightest * world.bounces.growth(self.camera.max_bounces)
        lights = self.arrays["light"].copy()
        dim_highlights(lights[: len(world.lights)], world.lights, request.precision, brightest)
        arrays = _shades(world) | world.textures.arrays() | {"light": lights}
        return replace(self, arrays=self.arrays | _not_empty(arrays))

    @classmethod
    def without_spheres(cls, world: World, camera: AnyCamera, request: Request, k: int) -> View:
        """All of a view but how spheres and triangles are seen from the eye and the lights, and the lists of them.

        k: lengths in scene units, times 2^k, are in the float buffers' unit. Raises ValueError as of() does.
        """
        real, basis = real_dtype(request.precision), np.array(camera.basis())
        # float32 has little room for squares. So lengths in float32 are multiplied by a power of two that makes the
        # largest coordinate about 1. Times another power of two, a scene is then the same numbers there. Double has
        # room for the fourth power of every float32 number, and keeps scene units.
        exponent, unit = (k, 0) if real.itemsize == 4 else (None, k)
        arrays = {
            "id_of": world.id,
            "light": packed_lights(world, camera, request, k),
            "unstoppable": np.zeros(0, np.int32),  # not known before it is worth while: see run/unstoppable.py
        }
        place = np.array([(*vector, 0.0) for vector in (camera.position, *camera.basis())], real)
        arrays["camera"] = place[:0] if exponent is not None else place
        arrays |= _shades(world) | world.textures.arrays() | _paths(world, exponent, basis, real)
        arrays |= world.attributes.arrays() | _vertices(world, exponent, real)
        values = {
            "lights": (*counts(world.lights), len(world.lights)),
            "count": len(world.radius),
            "first": len(world.radius),
            "triangles": len(world.triangles.face),
            "materials": len(world.materials.packed),
            "unit": math.ldexp(1.0, unit),
            "proved": 0,
            "bounces": camera.max_bounces,
            "ahead": (*(-basis[2]).tolist(), 0.0),
            **(world.paths.values(camera, exponent) if world.paths else NO_PATHS),
        }
        region, depths = request.region_of(camera.resolution), 0 if exponent is None else -k
        return cls(camera, region, depths, _not_empty(arrays), values, False, dict(world.skipped), {})


@dataclass(frozen=True)
class Plan:
    """A view and what is to be written of it: all that a device needs. numpy alone, and picklable.

    request: precision, outputs and crop; size: (width, height) of the whole picture in pixels; region, exponent,
    arrays, skipped, seconds: of View; features: names of abi.FLAGS; branches: BRANCHES of abi.VALUES; values: the
    kernel's arguments by name that are neither buffers nor outputs, but for those that only the launch knows.
    """

    request: Request
    size: tuple[int, int]
    region: Region
    exponent: int
    features: frozenset[str]
    branches: int
    arrays: dict[str, NDArray[Any]]
    values: dict[str, Any]
    skipped: dict[str, int]
    seconds: dict[str, float]

    @classmethod
    def of(cls, world: World, view: View, request: Request) -> Plan:
        """The plan of a view. request: the one that world and view were made for, or the same with other outputs."""
        contents = Contents(
            len(world.radius),
            len(world.triangles.face),
            counts(world.lights),
            view.inside or world.bounces.glass,
            world.materials.shiny,
            world.materials.black is not None and bool(world.materials.black.any()),
            len(world.textures.place) > 0,
            world.bounces,
            world.maps is not None,
            view.camera.max_bounces,
            view.camera.parallel,
        )
        return cls(
            request,
            view.camera.resolution,
            view.region,
            view.exponent,
            features(contents, request),
            world.bounces.branches(view.camera.max_bounces),
            view.arrays,
            view.values
            | _average(world, request)
            | limits(world.bounces, world.peak, request)
            | {"frame": _frame(world, view, request), "size": view.camera.resolution},
            view.skipped,
            view.seconds,
        )

    @classmethod
    def of_scene(cls, scene: Scene, request: Request) -> Plan:
        """World, View and Plan at once, for a scene that is seen by its own camera only.

        Raises ValueError if the request's crop is not within the picture.
        """
        world = World.of(scene, request)
        return cls.of(world, View.of(world, scene.camera, request), request)

    def counting(self) -> Plan:
        """The plan of a kernel that does all that this one's does, but writes only what it has counted."""
        rest = (name for name in self.features if not name.startswith("OUT_"))
        request = replace(self.request, outputs=("work",), keep=())
        return replace(self, request=request, features=frozenset((*rest, "OUT_WORK")))

    def options(self) -> list[str]:
        """The compiler's options. Scenes with the same precision, features and branches share a program."""
        return abi.options(self.request.precision, self.features, self.branches)


@contextmanager
def _timed(seconds: dict[str, float], name: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[name] = time.perf_counter() - start


def packed_lights(world: World, camera: AnyCamera, request: Request, k: int) -> NDArray[np.void]:
    """The world's lights as pack_lights() makes them. k: see View.without_spheres()."""
    space = Space.of(camera, world.center[:0], world.reach[:0], None, world.lights)
    place = space.times_two_to(k).position if request.precision == "single" else space.position
    brightest = world.materials.brightest * world.bounces.growth(camera.max_bounces)
    return pack_lights(world.lights, place, np.array(camera.basis()), request.precision, brightest)


def _spheres(
    world: World, space: Space, small: Space, camera: AnyCamera, request: Request, k: int
) -> dict[str, NDArray[Any]]:
    """The buffers of spheres as the eye sees them.

    space: in scene units; small: in those of the float buffers, scene units times 2^k.
    """
    real = real_dtype(request.precision)
    eye_filter = np.empty((len(small.radius), 4), np.float32)
    if camera.parallel:
        u, v = small.center[:, 0], small.center[:, 1]
        eye_filter[:, 0], eye_filter[:, 1], eye_filter[:, 2] = u, v, disc_filter(u, v, small.radius, LOOSE)
        eye_filter[:, 3] = 0
    else:
        eye_filter[:, :3], eye_filter[:, 3] = small.center, filter_constant(small.seen_from_eye())
    if real.itemsize == 4:
        # The reciprocal of a radius leaves float32's range only where the radius all but vanishes there: such a sphere
        # is never hit.
        exact, radius, largest = small, np.ldexp(world.radius, k), float(np.finfo(np.float32).max)
        in_world = np.zeros((0, 4), real)
    else:
        # By these a ray from the eye is decided exactly.
        exact, radius, largest = space, world.radius, np.inf
        in_world = np.concatenate([world.center, space.power_rest[:, None]], axis=1)
    return {
        "center_radius": np.concatenate([exact.center, radius[:, None]], axis=1).astype(real),
        "power": np.stack([exact.power, np.minimum(1 / radius, largest)], axis=1).astype(real),
        "world": in_world,
        "eye_filter": eye_filter,
    }


def _shades(world: World) -> dict[str, NDArray[Any]]:
    """The buffers of materials."""
    return {"material_of": world.material_of, "material": world.materials.packed, "bounce": world.materials.bounce}


def _not_empty(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """These arrays, those that are empty with one element: no buffer is empty."""
    return {name: a if len(a) else np.zeros((1, *a.shape[1:]), a.dtype) for name, a in arrays.items()}


def _in_world(world: World, camera: AnyCamera, space: Space, real: np.dtype[Any]) -> dict[str, NDArray[Any]]:
    """The buffers by which a ray from the eye is decided exactly; empty in single. space: in scene units."""
    if real.itemsize == 4:
        return {"world": np.zeros((0, 4), real), "camera": np.zeros((0, 4), real)}
    return {
        "world": np.concatenate([world.center, space.power_rest[:, None]], axis=1),
        "camera": np.array([(*vector, 0.0) for vector in (camera.position, *camera.basis())]),
    }


def _paths(world: World, exponent: int | None, basis: Array, real: np.dtype[Any]) -> dict[str, NDArray[Any]]:
    """The buffers for ellipsoids, and for rays that leave surfaces.

    exponent: of the float buffers, where `real` is float; else None; basis: (3, 3), the camera's axes in the world.
    """
    precision: abi.Precision = "single" if real.itemsize == 4 else "accurate"
    arrays = {name: np.zeros(0, dtype_of(name.title(), precision)) for name in ("node", "block", "patch", "map")}
    arrays |= {"place": np.zeros((0, 4), real), "map_of": np.zeros(0, np.int32)}
    if world.paths:
        arrays |= world.paths.arrays()
        arrays["place"] = world.paths.places(world.center, world.radius, exponent).astype(real)
    if world.maps:
        arrays |= {"map_of": world.maps.of_sphere, "map": world.maps.packed(basis, real)}
    return arrays


def _vertices(world: World, exponent: int | None, real: np.dtype[Any]) -> dict[str, NDArray[Any]]:
    """The buffers by which rays and triangles are decided. exponent: as in _paths()."""
    triangles, lights = world.triangles, world.lights
    parallel = lights["kind"] == PARALLEL
    places = [triangles.vertex, lights["position"]]
    towards = -lights["direction"]
    if exponent is not None and world.paths:
        places = [np.ldexp(place - world.paths.middle, exponent) for place in places]
        towards = towards / np.maximum(np.abs(towards).max(axis=1, keepdims=True, initial=0), 2.0**-200)
    lamp = np.where(parallel[:, None], towards, places[1])
    vertex, lamp = (_four_wide(v, real) for v in (places[0], lamp))
    return {"vertex": vertex, "lamp": lamp, "face": triangles.face, "number_of": triangles.number}


def _four_wide(rows: Array, real: np.dtype[Any]) -> NDArray[Any]:
    """(n, 4): rows of three numbers and a 0."""
    out = empty((len(rows), 4), real)

    def fill(some: slice) -> None:
        out[some, :3], out[some, 3] = rows[some], 0

    blockwise(len(rows), fill)
    return out


def from_point(world: World, basis: Array, point: Array, k: int = 0) -> Array:
    """(v, 3): from a point of the world to the corners of triangles, along the camera's axes, in 2^-k scene units."""
    vertex, unit = world.triangles.vertex, 2.0**k
    out = np.empty_like(vertex)

    def turn(block: slice) -> None:
        x, y, z = (c - o for c, o in zip(vertex[block].T, point, strict=True))
        for i, row in enumerate(basis):
            out[block, i] = (row[0] * x + row[1] * y + row[2] * z) * unit

    blockwise(len(vertex), turn)
    return out


class MeshView(NamedTuple):
    """The triangles as the eye or a light sees them; along a parallel light the corners count from the eye.

    met: (m,), which of them a ray from there can meet.
    """

    corners: Corners
    met: Mask


def mesh_views(
    world: World, camera: AnyCamera, lights: NDArray[np.void], near: Array, k: int
) -> tuple[list[MeshView], dict[str, NDArray[Any]]]:
    """The views of the eye and of each light, and the kernel's buffers by name.

    lights: of pack_lights(); near: of from_point() for the eye; k: see View.without_spheres().
    """
    triangles, basis = world.triangles, np.array(camera.basis())
    facets = np.empty((1 + len(lights), 3 * len(triangles.face), 4), np.float32)
    face, first = world.triangles.face[:, :3], len(world.radius)
    if camera.parallel:
        wide, high = camera.image_plane()
        eye = along_light(near, triangles, np.eye(3), basis[2], facets[0], (math.ldexp(wide, k), math.ldexp(high, k)))
    else:
        eye = from_eye(near, triangles, np.array(camera.position), camera.image_plane(), facets[0])
    found, sides = [MeshView(Corners(near, face, first), eye.met)], [eye.side]
    for light, packed, out in zip(world.lights, lights, facets[1:], strict=True):
        if light["kind"] == PARALLEL:
            axes = np.array([packed[name][:3] for name in ("axis", "across", "position")], np.float64)
            facet = along_light(near, triangles, axes, -light["direction"], out)
            found.append(MeshView(found[0].corners, facet.met))
        else:
            place = from_point(world, basis, light["position"], k)
            facet = from_light(place, triangles, light["position"], out)
            found.append(MeshView(Corners(place, face, first), facet.met))
        sides.append(facet.side)
    return found, {"facet": facets[0], "light_facet": facets[1:].reshape(-1, 4), "face_side": np.concatenate(sides)}


class Methods(NamedTuple):
    """How View.of() makes what takes longest. Arrays that are kept elsewhere, their dicts lack.

    see_meshes: see mesh_views(); build: makes the lists of grids, see Lists. Each grid is made when it is asked for.
    """

    see_meshes: Callable[
        [World, AnyCamera, NDArray[np.void], Array, int], tuple[list[MeshView], dict[str, NDArray[Any]]]
    ]
    build: Callable[[Iterator[CellGrid]], dict[str, NDArray[Any]]]


def _grids(
    world: World,
    space: Space,
    seen: Seen,
    window: Window,
    request: Request,
    lights: list[LightView],
    faces: list[MeshView],
    buffers: NDArray[np.int32],
    skipped: dict[str, int],
) -> Iterator[CellGrid]:
    """The grid of the tiles, then those of all light buffers. Adds to `skipped` what is in none of them.

    space: in the float buffers' unit; seen: its spheres from the eye; buffers: abi's `light_buffer`, which is filled.
    """
    n, keep = len(seen.radius), request.keep
    slack = SLACK if request.precision == "single" else FINE_SLACK
    visible = np.ones(n, bool)
    if "hidden" not in keep and n > 1:
        outside = (seen.power > 0) & np.all([light.side > 0 for light in lights], axis=0) & world.opaque
        if world.maps:
            outside &= world.maps.of_sphere == 0
        visible = ~(world.again | hidden(space.place, space.radius, outside, slack))
        skipped["spheres inside others, or the same"] = n - int(visible.sum())
    among = np.concatenate([visible, faces[0].met])
    total = len(among)
    corners = faces[0].corners if total > n else None
    tiles = picture_tiles(seen, among, window, corners)
    if total == n and not world.maps and not window.parallel:
        covered = entries_of_boxes(tiles.covers[2:])
        if is_crowded(request, n, len(tiles.member), covered):
            tiles = replace(tiles, behind=behind(tiles, seen, window))
    # What is not in the picture itself may be seen in a mirror.
    receiver = np.full(total, "receivers" in keep or world.bounces.any or request.antialias is not None)
    if "lists" in keep:
        receiver[tiles.member] = True
        tiles = whole_grid(among)
    yield tiles
    seen_there = tiles.entered(total)
    receiver |= seen_there
    what = "spheres" if corners is None else "surfaces"
    skipped[f"{what} out of the picture"] = total - int(seen_there.sum())
    del tiles  # Others have room in its place.
    made, idle = 1, 0
    for k, (light, face) in enumerate(zip(lights, faces[1:], strict=True)):
        inside = (seen.power <= 0) | world.bounces.glass
        among = np.concatenate([visible, face.met])
        corners = face.corners if total > n else None
        more, stops = _light_buffer(light, corners, inside, Shadows(among, receiver, slack), keep)
        if "lists" in keep:
            more = [whole_grid(among)]
        buffers[k] = made, len(more), stops, 0
        made += len(more)
        entered = np.zeros(total, bool)
        while more:
            yield (grid := more.pop(0))
            entered |= grid.entered(total)
            del grid
        idle += total - int(entered.sum())
    skipped[f"{what} that shadow nothing seen, per light"] = idle


def _light_buffer(
    light: LightView, corners: Corners | None, inside: Mask, who: Shadows, keep: tuple[str, ...]
) -> tuple[list[CellGrid], int]:
    """The grids of one light, and a bit for each sphere on its way to which something may stop the light.

    Where spheres are many, or there are triangles, all bits are set. corners: of triangles, None for none; inside:
    (n,), whether it may be seen from its inside.
    """
    n = len(inside)
    # With FEW spheres at most, finding the right list for a shadow ray costs more than trying them all: a box of 16
    # takes 3.5 ms a frame instead of 3.2 (PoCL 3.1, 1920x1080). A shell of 28 takes 4.3 instead of 4.6.
    if n > CONSTANTS["FEW"] or corners:
        if light.axes is None:
            return _point_buffer(light, corners, who), -1
        return parallel_buffer(light.axes, light.seen, who, corners), -1
    if light.axes is None:
        shadows = point_shadows(light.seen, who.slack)
    else:
        shadows = parallel_shadows(light.axes, light.seen, who.slack)
    shadows &= who.receiver[:, None] & who.occluder
    # Seen from outside, a sphere never stands between itself and a light; seen from inside, it may.
    np.fill_diagonal(shadows, inside)
    casting = np.asarray(shadows.any(axis=0) | ("receivers" in keep))
    stops = int(((shadows.any(axis=1) | ("unstopped" in keep)) << np.arange(n)).sum())
    return [whole_grid(casting)] if casting.any() else [], stops


def _point_buffer(light: LightView, corners: Corners | None, who: Shadows) -> list[CellGrid]:
    """The grids of a light at a point, along the camera's axes. corners: as of _light_buffer().

    Spheres are in the same cells for each camera.
    """
    if corners:
        return point_buffer(replace(light.seen, center=rotated(light.basis, light.seen.center)), who, corners)
    grids = point_buffer(light.seen, who)
    return [replace(grid, axes=rotated(light.basis, grid.axes)) for grid in grids]


def _frame(world: World, view: View, request: Request) -> NDArray[np.void]:
    """abi's `Frame`."""
    frame = np.zeros((), dtype_of("Frame", request.precision))
    x, y = view.camera.image_plane()
    width, height = view.camera.resolution
    frame["pixel"][:2] = x / width, y / height
    if view.camera.parallel:
        frame["pixel"] = np.ldexp(frame["pixel"], -view.exponent)
    for name, axis in zip(("right", "up", "back"), view.camera.basis(), strict=True):
        frame[name][:3] = axis
    rounding = 0.0 if request.truncate else 0.5
    shade = abi.shade_dtype(request.precision)
    frame["background"][:3] = [_same_byte(c, rounding, shade) for c in world.background]
    frame["quantize"][0] = rounding
    return frame


def _average(world: World, request: Request) -> dict[str, Any]:
    """The kernel's argument `average`. Colours count up to 1, and rays that bounce may add up to that."""
    peak = np.ones(3) if world.bounces.any else np.minimum(world.peak, 1)
    return {"average": (*rounded_up(peak).tolist(), request.antialias or 0.0)}


def _same_byte(c: float, rounding: float, shade: np.dtype[Any]) -> np.float32:
    """A part c of the background's colour in float32, moved by an ulp if its byte would else be another than that of c.

    Without this the whole sky could be a level off: 0.7 times 255 is 178.5, all but for a rounding.
    """
    near = np.float32(min(c, float(np.finfo(np.float32).max)))
    want = int(min(c, 1.0) * 255 + rounding)
    one = shade.type(1)
    for value in (near, np.nextafter(near, np.float32(0)), np.nextafter(near, np.float32(np.inf))):
        clamped = min(shade.type(value), one)
        if int(clamped * shade.type(255) + shade.type(rounding)) == want:
            return np.float32(value)
    return near
