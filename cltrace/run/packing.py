"""A View whose arrays of spheres are made on the device, with the same bits as those of View.of().

What takes a pass over all spheres is a kernel of kernels/pack. What follows from few numbers, such as the window of a
light's grid, is decided by the functions of cltrace.plan that View.of() uses, too.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS
from cltrace.plan.accel.cells import SLACK, CellGrid
from cltrace.plan.accel.light_buffer import (
    FINE_SLACK,
    SAMPLE,
    SIDES,
    Extent,
    Rectangle,
    cube_of,
    sampled,
    side_axes,
    window_of,
)
from cltrace.plan.accel.tiles import FINE, MOST, SHIFT, SQUARE, STRIDE, TINY, Window, front_of, is_crowded, picture_grid
from cltrace.plan.culling import larger, shells
from cltrace.plan.exact import Array, rotated
from cltrace.plan.plan import View, World, packed_lights
from cltrace.plan.request import Request
from cltrace.plan.space import Space
from cltrace.run.devices import Device, driver_errors
from cltrace.run.entries import Covers, Entries, Listed
from cltrace.run.program import Announcement
from cltrace.run.shelf import Shelf
from cltrace.run.toolbox import PACKET, EdgeType, Toolbox, is_exact, vector
from cltrace.scene import PARALLEL, AnyCamera

# What a request may keep that only numpy can. Receivers are kept at any rate: shadow rays may end on all spheres, so
# that cameras have the lists of lights in common.
OTHERS = {"lists", "hidden", "unstopped"}
# member, covers and near of a grid whose members only the device knows.
NOBODY = np.zeros(0, np.int32), np.zeros((4, 0), np.int16), np.zeros(0, np.float32)


@dataclass(frozen=True)
class _Lamps:
    """What lights at points see, which cameras that agree in `key` have in common.

    filters, sides: light_filter of one of them, and light_side; buffers: (m, 4), its light_buffer; grids: of all lights
    in turn, along the world's axes, and where on the shelf their lists are; idle: how many spheres are in none, per
    light, summed.
    """

    key: tuple[Any, ...]
    filters: Any
    sides: Any
    buffers: NDArray[np.int32]
    grids: list[CellGrid]
    listed: list[Listed]
    shelf: Shelf | None
    idle: int


class Packing:
    """A world's spheres on a device, for Views of any camera.

    world: is not to change; request: the one that it was made for; lamps: of the latest View of lights at points alone.
    Several threads may use it: one after the other.
    """

    def __init__(self, world: World, request: Request, device: Device, before: Toolbox | None = None) -> None:
        self._world, self.request, self.tools = world, request, Toolbox(device, request.precision, before)
        self.center, self.radius = self.tools.share(world.center), self.tools.share(world.radius)
        self.some_again = bool(world.again.any())
        self.again = self.tools.share(world.again) if self.some_again else self.tools.room(1, np.bool_)
        self.shells, self.least = shells(world.radius), float(world.radius.min())
        self.lamps: _Lamps | None = None
        self._device, self._lock = device, threading.Lock()

    @classmethod
    def of(cls, world: World, request: Request, device: Device, before: Toolbox | None = None) -> Packing | None:
        """None unless there are only spheres, and more than a few, on a device that computes as numpy does.

        Raises BuildError and DeviceError as Executor does.
        """
        served = (
            len(world.radius) > CONSTANTS["FEW"]
            and world.maps is None
            and not len(world.triangles.face)
            and OTHERS.isdisjoint(request.keep)
            and is_exact(device)
        )
        with driver_errors(device):
            return cls(world, request, device, before) if served else None

    def fits(self, world: World) -> bool:
        """Whether a world has the same spheres in the same places; their materials may be others."""
        return all(getattr(world, name) is getattr(self._world, name) for name in ("center", "radius", "again"))

    def view(self, world: World, camera: AnyCamera) -> tuple[View, dict[str, Any]]:
        """The view of a camera, and the buffers, by the names of abi.ARGUMENTS, that its arrays lack.

        world: one that fits. Raises ValueError as View.of() does, and BuildError and DeviceError as Executor does.
        """
        with self._lock, driver_errors(self._device), Announcement("compiling the kernel ..."):
            found = _Look(self, world, camera).view()
        return found or (View.of(world, camera, self.request), {})


class _Look:
    """The spheres of a Packing as one camera sees them.

    seen: four columns of `pitch` doubles, see kernels/pack/space.cl; along: whether any light is a parallel one.
    """

    def __init__(self, packing: Packing, world: World, camera: AnyCamera) -> None:
        self.packing, self.world, self.camera = packing, world, camera
        self.tools = packing.tools
        self.n = len(self.world.radius)
        self.pitch = -(-self.n // PACKET) * PACKET
        self.basis = np.array(camera.basis())
        self.slack = SLACK if packing.request.precision == "single" else FINE_SLACK
        self.real = np.dtype("f4" if packing.request.precision == "single" else "f8")
        self.made: dict[str, Any] = {}
        self.lamps: _Lamps | None = None
        self.grids: list[CellGrid] = []
        self.along = bool((world.lights["kind"] == PARALLEL).any())
        self.unsure = self.tools.room(1 + self.n, np.int32)  # Of which nearly nothing is used.
        self.seen = self.tools.room(4 * self.pitch if self.along else 1, np.float64)
        self.flags = self.tools.room(self.pitch, np.int8, again=True)
        self.covers = Covers(self.tools, self.n, self.pitch)

    def view(self) -> tuple[View, dict[str, Any]] | None:
        """See Packing.view(); None if pixels are so tiny that the kernels' float32 is too coarse."""
        world, packing = self.world, self.packing
        seen = self._see_from_eye()
        if seen is None:
            return None
        inside, there = seen
        view = View.without_spheres(world, self.camera, packing.request, self.k)
        skipped, start = dict(view.skipped), time.perf_counter()
        skipped["spheres inside others, or the same"] = self.n - there
        light_buffer, entries = self._lists(skipped)
        lists, grid = entries.done()
        if self.lamps:
            filters, listed = self.made["light_filter"], entries.listed[1:]
            packing.lamps = replace(self.lamps, filters=filters, listed=listed, shelf=entries.shelf)
        arrays = view.arrays | {"grid": grid, "light_buffer": light_buffer}
        none = np.zeros((1, 4), np.float32)
        face = np.zeros((1, *world.triangles.face.shape[1:]), np.int32)
        arrays |= {"facet": none, "light_facet": none, "face_side": np.zeros(1, np.int8), "neighbour": face}
        if "world" not in self.made:
            arrays["world"] = np.zeros((1, 4), self.real)
        if not len(world.lights):
            arrays |= {"light_filter": none, "light_side": np.zeros(1, np.int8)}
        seconds = {"lists": time.perf_counter() - start}
        return replace(view, arrays=arrays, inside=inside, skipped=skipped, seconds=seconds), self.made | lists

    def _few(self, rows: Any) -> Space:
        """Some of the spheres as numpy sees them, in scene units."""
        world = self.world
        return Space.of(self.camera, world.center[rows], world.radius[rows], None, world.lights)

    @property
    def _camera(self) -> tuple[Any, ...]:
        return tuple(vector(v) for v in (np.array(self.camera.position), *self.basis))

    def _unsure_rows(self) -> NDArray[np.int32]:
        """The rows that kernels are unsure of."""
        count = int(self.tools.read(self.unsure, 1, np.int32)[0])
        return np.sort(self.tools.read(self.unsure, count, np.int32, 1))

    def _mend(self, rows: NDArray[np.int32], values: Array, column: Any, first: int) -> None:
        tools = self.tools
        tools.run("mend", np.int32(len(rows)), np.int32(first), tools.upload(rows), tools.upload(values), column)

    def _see_from_eye(self) -> tuple[bool, int] | None:
        """Makes what depends on the eye alone, and k and the window.

        Returns whether the eye is inside of a sphere or on it, and how many spheres may be seen; None as view().
        """
        tools, packing, lights = self.tools, self.packing, self.world.lights
        room, columns = partial(tools.room, again=True), {"center_radius": 4, "power": 2}
        made = {name: room(wide * self.pitch, self.real) for name, wide in columns.items()}
        made["eye_filter"] = room(4 * self.pitch, np.float32)
        if self.real.itemsize == 8:
            made["world"] = room(4 * self.pitch, self.real)
        self.made |= made
        parallel, none, nothing = self.camera.parallel, self._few(slice(0)), np.zeros((0, 3))
        plane = max(self.camera.image_plane()) if parallel else 0.0
        # Some spheres nearly always tell which one is the k of all.
        most, k = self._largest_of_some(), None
        while k != (k := none.exponent(lights, nothing, max(plane, most))):
            self.k, self.unit = k, np.float64(2.0**k)
            self.window = Window.of(self.camera, packing.request, k)
            if min(self.window.step) <= (FINE if parallel else TINY):
                return None
            part = self._see_all()
            most = float(part[:, 0].max())
        inside, rows = bool(part[:, 1].max() >= 0), self._unsure_rows()
        if len(rows):
            space = self._few(rows)
            values = (tools.upload(values) for values in (rows, space.power, space.power_rest))
            spheres = (packing.center, packing.radius, *self._buffers, self.covers.near)
            sizes = np.int32(len(rows)), np.int32(parallel)
            tools.run("mend_eye", *sizes, self.unit, *self._camera, *values, *spheres)
            inside |= not parallel and bool((space.power <= 0).any())
        return inside, int(part[:, 2].sum())

    def _largest_of_some(self) -> float:
        """About the largest coordinate or radius of some spheres in camera space, in scene units."""
        center = self.world.center[sampled(self.n)] - np.array(self.camera.position)
        radius = self.world.radius[self.packing.shells]
        return max(float(np.abs(center @ self.basis.T).max()), float(radius.max()))

    @property
    def _buffers(self) -> tuple[Any, ...]:
        return self.made["power"], self.made.get("world", self.unsure), self.made["eye_filter"]

    def _see_all(self) -> NDArray[np.float64]:
        """Makes what the eye sees if k is what it is, and returns NOTES of kernels/pack/eye.cl."""
        tools, packing, covers, (x, y) = self.tools, self.packing, self.covers, self.window.axes
        shell = self._shell()
        tools.clear(self.unsure, 1)
        part = tools.noted(
            "see_from_eye",
            *(np.int32(self.n), np.int32(self.pitch), self.unit, *self._camera, np.float64(self.slack)),
            *(np.int32(len(shell)), np.int32(packing.some_again)),
            *(vector((a.scale, a.begin, a.end, 0), np.float32) for a in (x, y)),
            *(vector((a.first, a.stop), np.int32) for a in (x, y)),
            *(
                np.int32(SHIFT),
                np.int32(self.camera.parallel),
                np.int32(self.along),
                packing.center,
                packing.radius,
                tools.upload(shell),
                packing.again,
            ),
            *(
                self.made["center_radius"],
                *self._buffers,
                self.seen,
                self.flags,
                covers.cells,
                covers.near,
                self.unsure,
            ),
            columns=6,
            dtype=np.float64,
        )
        covers.members, covers.entries = (int(total) for total in part[:, 3:5].sum(axis=0))
        covers.last = int(part[:, 5].max())
        return part

    def _shell(self) -> Array:
        """(s, 4): centres in the world of spheres that hide others inside, and how large these may be."""
        rows = self.packing.shells
        few = self._few(rows).times_two_to(self.k)
        seen = few.seen_along_view() if self.camera.parallel else few.seen_from_eye()
        outside = (seen.power > 0) & self.world.opaque[rows]
        for light in np.flatnonzero(self.world.lights["kind"] != PARALLEL).tolist():
            outside &= few.seen_from_light(light)[1] > 0
        inner = 2 * few.radius - larger(few.radius, self.slack)
        which = np.flatnonzero(outside & (inner > self.packing.least * self.unit))
        self.shells = which.tolist()
        return np.concatenate([few.place[which], inner[which, None]], axis=1)

    def _lists(self, skipped: dict[str, int]) -> tuple[NDArray[np.int32], Entries]:
        """The lists of the tiles and of all light buffers. Adds to `skipped` what is in none of them."""
        tools, lights, lamps = self.tools, self.world.lights, self.packing.lamps
        m, key = len(lights), (self.k, self.shells, lights.tobytes())
        known = lamps if lamps and lamps.key == key else None
        shelf = known.shelf if known and known.shelf else Shelf.of(tools, self.n, m)
        entries = Entries(tools, self.packing.request.precision, shelf)
        grid = picture_grid(self.window.size, *NOBODY)
        entries.add(grid, self.covers, self._behind(grid))
        skipped["spheres out of the picture"] = self.n - self.covers.members

        what = "spheres that shadow nothing seen, per light"
        if not m:
            skipped[what] = 0
            return np.zeros((1, 4), np.int32), entries
        self.made["light_filter"] = tools.room(4 * (m * self.n + PACKET), np.float32, again=True)
        if known:
            self.lamps = known
            self._see_again(known, entries)
            skipped[what] = known.idle
            return known.buffers, entries
        self.made["light_side"] = tools.room(m * self.n + PACKET, np.int8, again=True)
        if not self.along:
            self.seen = tools.room(4 * self.pitch, np.float64)
        buffers, idle = np.zeros((m, 4), np.int32), 0
        # Parallel lights come first, as `seen` is what the eye sees until then.
        for light, kind in enumerate(lights["kind"]):
            first = len(entries.records)
            idle += self.n - (self._along if kind == PARALLEL else self._from_point)(light, entries)
            buffers[light] = first, len(entries.records) - first, -1, 0
            if light == m - 1:
                tools.finish()
                del self.covers, self.flags  # What is packed has room in their place.
            if kind != PARALLEL:
                self._pack_light(light)
        skipped[what] = idle
        if not self.along:
            self.lamps = _Lamps(key, None, self.made["light_side"], buffers, self.grids, [], None, idle)
        return buffers, entries

    def _behind(self, grid: CellGrid) -> Any:
        """CellGrid.behind of the tiles, a buffer, or None."""
        covers, tools, (columns, rows) = self.covers, self.tools, grid.cells
        if self.camera.parallel or not is_crowded(self.packing.request, self.n, covers.members, covers.entries):
            return None
        behind = tools.room(columns * rows, np.float32)
        tools.clear(behind, columns * rows, value=np.float32(np.inf))
        axes = (
            vector((axis.scale, (size - 1) / 2)) for axis, size in zip(self.window.axes, self.window.size, strict=True)
        )
        sizes = np.int32(self.n), np.int32(self.pitch), self.unit
        spheres = self.made["center_radius"], self.made["power"], covers.cells, covers.near
        count = (self.n - 1) // STRIDE + 1
        sample = tools.room(3 * count, np.float32)
        tools.run("sample_covers", *sizes[:2], np.int32(STRIDE), covers.cells, covers.near, sample)
        near, *more = tools.read(sample, 3 * count, np.float32).reshape(count, 3).T
        front = front_of(near, np.array(more), columns * rows)
        rule = vector(grid.cells, np.int32), np.int32(SHIFT), np.float64(SQUARE), np.int32(MOST), front
        tools.run("cover_tiles", *sizes, *axes, *rule, *spheres, behind)
        return behind

    def _see_again(self, lamps: _Lamps, entries: Entries) -> None:
        """Adds what lights see, of which a camera changes directions alone."""
        del self.covers, self.flags
        for grid, listed in zip(lamps.grids, lamps.listed, strict=True):
            entries.add_again(replace(grid, axes=rotated(self.basis, grid.axes)), listed)
        for light in range(len(self.world.lights)):
            sizes = np.int32(self.n), self.unit
            filters = np.int64(light * self.n), lamps.filters, self.made["light_filter"]
            self.tools.run("turn_light", *sizes, self.packing.center, self._lamp(light), *self._camera[1:], *filters)
        self.made["light_side"] = lamps.sides

    def _see_from_light(self, light: int) -> None:
        """Makes `seen` what a light at a point sees."""
        n, pitch, tools, packing = np.int32(self.n), np.int32(self.pitch), self.tools, self.packing
        tools.clear(self.unsure, 1)
        arguments = (packing.center, packing.radius, self._lamp(light), self.seen, self.unsure)
        tools.run("see_from_light", n, pitch, self.unit, *arguments)
        rows = self._unsure_rows()
        if len(rows):
            seen, _ = self._few(rows).times_two_to(self.k).seen_from_light(light)
            self._mend(rows, seen.power, self.seen, 3 * self.pitch)

    def _lamp(self, light: int) -> Any:
        return vector(self.world.lights["position"][light] * self.unit)

    def _along(self, light: int, entries: Entries) -> int:
        """Packs spheres as a parallel light sees them, and adds its grid. Returns how many spheres are in it."""
        packed = packed_lights(self.world, self.camera, self.packing.request, self.k)[light]
        axes = np.array([packed[name][:3] for name in ("axis", "across", "position")], np.float64)
        common = (np.int32(self.n), np.int32(self.pitch), self.unit)
        spheres = (self.seen, self.packing.radius)
        filters = self.made["light_filter"], self.made["light_side"]
        self.tools.run("pack_along", *common, *map(vector, axes[:2]), np.int64(light * self.n), *spheres, *filters)
        discs = _Discs.of(self, "discs_along", (*common, *map(vector, axes), *spheres, self.flags), np.float64)
        window = window_of([discs.extent], self.slack, False)
        return self._add(axes, discs, window, self.slack, False, entries) if window else 0

    def _from_point(self, light: int, entries: Entries) -> int:
        """Packs spheres as a light at a point sees them, and adds its grids, at most six.

        Returns how many spheres are in any of them.
        """
        self._see_from_light(light)
        some = self._few(sampled(self.n)).times_two_to(self.k).seen_from_light(light)[0].center
        cube = cube_of([some])
        common = (np.int32(self.n), np.int32(self.pitch), self.unit, *map(vector, cube))
        spheres = (self.seen, self.packing.radius, self.flags)
        sides = self.tools.noted("cube_sides", *common, *spheres, columns=1, dtype=np.int32)
        seen_on = int(np.bitwise_or.reduce(sides, axis=None))
        entered = 0
        for side, (axis, sign) in enumerate(SIDES):
            if not seen_on >> side & 1:
                continue
            look = partial(_Discs.of, self, "cube_discs", (*common, np.int32(side), *spheres))
            discs = look(np.float32)
            window = window_of([discs.extent], SLACK, True)
            if window is not None and not window.coarse and self.slack < SLACK:
                del discs  # There is room for one of them.
                discs = look(np.float64)
                window = window_of([discs.extent], self.slack, True)
                window = window and window._replace(coarse=False)
            if window is not None:
                slack = SLACK if window.coarse else self.slack
                entered += self._add(side_axes(cube, axis, sign), discs, window, slack, True, entries)
        return entered

    def _pack_light(self, light: int) -> None:
        """Packs what `seen` is."""
        n, pitch, filters = np.int32(self.n), np.int32(self.pitch), (self.made["light_filter"], self.made["light_side"])
        self.tools.run("pack_light", n, pitch, *self._camera[1:], np.int64(light * self.n), self.seen, *filters)

    def _add(
        self, axes: Array, discs: _Discs, window: Rectangle, slack: float, perspective: bool, entries: Entries
    ) -> int:
        """Adds the grid of a window. Returns how many spheres are in no grid of the light before."""
        cells = window.cells(discs.sizes(), discs.count, False)
        self.covers.make(
            "place",
            *(np.int32(self.n), np.int32(self.pitch)),
            *(vector(side, discs.edge) for side in window.sides(cells)),
            *(discs.edge(slack), np.float32(window.furthest), discs.edges, self.flags),
            edge=discs.edge,
        )
        del discs.edges  # Lists have room in their place.
        middle, half, coarse = window.middle, window.half, window.coarse
        grid = CellGrid(axes, middle, half, cells, *NOBODY, perspective, coarse)
        self.grids.append(grid)
        entries.add(replace(grid, axes=rotated(self.basis, axes)) if perspective else grid, self.covers)
        return self.covers.more


class _Discs:
    """The spheres that are seen through a side of the cube around a light, as discs.

    edge: the type of their edges; edges: four columns of `pitch`; count: how many there are; extent: of all of them.
    """

    def __init__(self, look: _Look, edge: EdgeType, edges: Any, count: int, extent: Extent) -> None:
        self._look, self.edge, self.edges, self.count, self.extent = look, edge, edges, count, extent

    @classmethod
    def of(cls, look: _Look, kernel: str, arguments: tuple[Any, ...], edge: EdgeType) -> _Discs:
        """arguments: of the kernel, but for what it writes. The depths go to those of look.covers."""
        edges = look.tools.room(4 * look.pitch, edge)
        part = look.tools.noted(kernel, *arguments, edges, look.covers.near, columns=7, dtype="f8", edge=edge)
        left, right, low, high, nearest, furthest, _ = part.max(axis=0).tolist()
        extent = Extent(2 * [[-left, right, -low, high]], -nearest, furthest)
        return cls(look, edge, edges, int(part[:, 6].sum()), extent)

    def sizes(self) -> NDArray[Any]:
        """The width and the height of those whose indices SAMPLE divides, or of all of them if there is none."""
        look = self._look
        for sample in (SAMPLE, 1):
            count = 2 * ((look.n - 1) // sample + 1)
            sizes = look.tools.room(count, self.edge)
            arguments = (np.int32(look.n), np.int32(look.pitch), np.int32(sample), self.edges, look.covers.near, sizes)
            look.tools.run("sizes", *arguments, edge=self.edge)
            found = look.tools.read(sizes, count, self.edge)
            found = found[~np.isnan(found)]
            if len(found):
                break
        return found
