"""A CameraView whose arrays of spheres are made on the device, with the same bits as those of CameraView.of().

What takes a pass over all spheres is a kernel of kernels/pack. What follows from few numbers, such as the window of a
light's grid, is decided by the functions of cltrace.plan that CameraView.of() uses, too.
"""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.waiting import Announcement
from cltrace.plan import abi
from cltrace.plan.accel.grids import (
    NOBODY,
    SHIFT,
    SIDES,
    CellGrid,
    Extent,
    PictureWindow,
    Rectangle,
    cube_of,
    picture_grid,
    sample,
    side_axes,
    window_of,
)
from cltrace.plan.accel.silhouettes import FINE_SLACK, SLACK
from cltrace.plan.lights import AtPoint, Move, Parallel, are_at_points, kinds, lamps_of
from cltrace.plan.lists import ONE_LIST
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, rotated
from cltrace.plan.shapes.sphere import CameraSpace, SpherePacking
from cltrace.plan.view import CameraView, KeptLights, exponent_of
from cltrace.plan.world import ScenePacking
from cltrace.run.devices import Device, driver_errors
from cltrace.run.pack.lists import Covers, ListBuffers, ListWriter
from cltrace.run.pack.toolbox import PACKET, Arguments, Toolbox, is_exact
from cltrace.scene import AnyCamera

# Pixels smaller than this, at z = -1, are too small for slopes in float32 to be divided by them; the same of parallel
# rays, in the float buffers' unit: there, the slack of float32 would be a few pixels.
TINY, FINE = 2.0**-64, 2.0**-18
# One in so many discs is looked at to know the size of most, and where they are.
SAMPLE = 16
# Cells are made for so many entries of each disc. Where discs lie in more layers than LAYERS, lists are long, and cells
# as wide as one disc are faster: a million spheres in 7,000 layers take 0.5 of the time.
ENTRIES, FINER_ENTRIES, LAYERS = 2.25, 4.0, 32
# What a request may keep that only numpy can. Receivers are kept at any rate: shadow rays may end on all spheres, so
# that cameras have the lists of lights in common.
OTHERS = {"lists", "hidden", "unstopped"}


class SpherePacker:
    """A world's spheres on a device, for CameraViews of any camera.

    spheres: of a world; request: the one that it was made for; lamps: of the latest CameraView, in double at any rate.
    Several threads may use it: one after the other.
    """

    def __init__(self, world: ScenePacking, request: Request, device: Device, before: Toolbox | None = None) -> None:
        self.request, self.tools = request, Toolbox(device, request.precision, before)
        self.spheres = spheres = world.of_shape(SpherePacking)
        self.center, self.radius = self.tools.share(spheres.center), self.tools.share(spheres.radius)
        self.some_again = bool(spheres.again.any())
        self.again = self.tools.share(spheres.again) if self.some_again else self.tools.room(1, np.bool_)
        self.largest = float(spheres.radius.max())
        self.lamps: KeptLights | None = None
        self._device, self._lock = device, threading.Lock()

    @classmethod
    def of(
        cls, world: ScenePacking, request: Request, device: Device, before: Toolbox | None = None
    ) -> SpherePacker | None:
        """None unless there are only spheres, and more than a few, on a device that computes as numpy does.

        Raises BuildError and DeviceError as Executor does.
        """
        spheres = world.of_shape(SpherePacking)
        served = (
            ONE_LIST < len(spheres.row) == len(world.id)
            and not spheres.maps
            and not world.clipping
            and OTHERS.isdisjoint(request.keep)
            and is_exact(device)
        )
        with driver_errors(device):
            return cls(world, request, device, before) if served else None

    def fits(self, world: ScenePacking) -> bool:
        """Whether a world has the same spheres in the same places; their materials may be others."""
        return world.of_shape(SpherePacking) is self.spheres

    def view(self, world: ScenePacking, camera: AnyCamera, keep: bool = True) -> tuple[CameraView, dict[str, Any]]:
        """See Packer."""
        with self._lock, driver_errors(self._device), Announcement("compiling the kernel ..."):
            found = _SeenSpheres(self, world, camera, keep).view()
        return found or (CameraView.of(world, camera, self.request), {})


class _SeenSpheres:
    """The spheres of a SpherePacker as one camera sees them. power: see kernels/pack/spheres.cl."""

    def __init__(self, packer: SpherePacker, world: ScenePacking, camera: AnyCamera, keep: bool) -> None:
        self.packer, self.world, self.camera, self.keep = packer, world, camera, keep
        self.tools, self.spheres = packer.tools, packer.spheres
        self.n = len(self.spheres.radius)
        self.pitch = -(-self.n // PACKET) * PACKET
        self.some = sample(np.arange(self.n))
        self.basis = np.array(camera.basis())
        self.slack = SLACK if packer.request.precision == "single" else FINE_SLACK
        self.real = np.dtype("f4" if packer.request.precision == "single" else "f8")
        self.made: dict[str, Any] = {}
        self.lamps: KeptLights | None = None
        self.grids: list[CellGrid] = []
        self.unsure = self.tools.room(1 + self.n, np.int32)  # Of which nearly nothing is used.
        self.flags = self.tools.room(self.pitch, np.int8, again=True)
        self.covers = Covers(self.tools, self.n, self.pitch)

    def view(self) -> tuple[CameraView, dict[str, Any]] | None:
        """See SpherePacker.view(); None if pixels are so tiny that the kernels' float32 is too coarse."""
        world, packer = self.world, self.packer
        seen = self._see_from_eye()
        if seen is None:
            return None
        inside, there = seen
        view = CameraView.without_lists(world, self.camera, packer.request, self.k)
        self.lights = lamps_of(world.lights, view.arrays["light"], self.basis)
        skipped, start = dict(view.skipped), time.perf_counter()
        skipped["spheres equal to others"] = self.n - there
        self.light = view.arrays["light"]
        light_buffer, writer = self._lists(skipped)
        lists, grid = writer.done()
        if self.lamps:
            buffers = self.lamps.buffers | {"light_filter": self.made["light_filter"]}
            packer.lamps = replace(self.lamps, buffers=buffers, listed=writer.listed[1:], lists=writer.lists)
        arrays, made = (
            view.arrays | {"grid": grid, "light_buffer": light_buffer, "light": self.light},
            self.made | lists,
        )
        # What other shapes, or lights, would have.
        lacking = [a for a in abi.ARGUMENTS if a.kind == "buffer" and a.name not in arrays.keys() | made.keys()]
        arrays |= {a.name: np.zeros(1, abi.dtype_of(a.type, packer.request.precision)) for a in lacking}
        seconds = {"lists": time.perf_counter() - start}
        return replace(view, arrays=arrays, inside=inside, skipped=skipped, seconds=seconds), made

    def _few(self, rows: Any) -> CameraSpace:
        """Some of the spheres as numpy sees them, in scene units."""
        return CameraSpace.of(self.camera, self.spheres.center[rows], self.spheres.radius[rows])

    @property
    def _spheres(self) -> Arguments:
        """What kernels are given of the spheres in the world."""
        return {"unit": self.unit, "center": self.packer.center, "radius": self.packer.radius}

    @property
    def _axes(self) -> Arguments:
        """The camera's, as kernels are given them."""
        return dict(zip(("right", "up", "back"), self.basis, strict=True))

    @property
    def _eye(self) -> Arguments:
        """What kernels are given that see spheres from the eye."""
        return {"eye": self.camera.position} | self._axes | self._spheres

    @property
    def _packed(self) -> Arguments:
        """What kernels write that pack what the eye sees."""
        made = {name: self.made.get(name, self.unsure) for name in ("power", "world", "eye_filter")}
        return {"along": self.camera.parallel, "near": self.covers.near} | made

    def _unsure_rows(self) -> NDArray[np.int32]:
        """The rows that kernels are unsure of."""
        count = int(self.tools.read(self.unsure, 1, np.int32)[0])
        return np.sort(self.tools.read(self.unsure, count, np.int32, 1))

    def _see_from_eye(self) -> tuple[bool, int] | None:
        """Makes what depends on the eye alone, and k and the window.

        Returns whether the eye is inside of a sphere or on it, and how many spheres may be seen; None as view().
        """
        tools, packer = self.tools, self.packer
        room, columns = partial(tools.room, again=True), {"center_radius": 4, "power": 2}
        made = {name: room(wide * self.pitch, self.real) for name, wide in columns.items()}
        made["eye_filter"] = room(4 * self.pitch, np.float32)
        if self.real.itemsize == 8:
            made["world"] = room(4 * self.pitch, self.real)
        self.made |= made
        parallel = self.camera.parallel
        # Some spheres nearly always tell which one is the k of all.
        most, k = self._largest_of_some(), None
        while k != (k := exponent_of(self.world, self.camera, (), most)):
            self.k, self.unit = k, 2.0**k
            self.window = PictureWindow.of(self.camera, packer.request, k)
            if min(self.window.step) <= (FINE if parallel else TINY):
                return None
            part = self._see_all()
            most = float(part[:, 0].max())
        inside, rows = bool(part[:, 1].max() >= 0), self._unsure_rows()
        if len(rows):
            space = self._few(rows)
            index, hi, lo = (tools.upload(values) for values in (rows, space.power, space.power_rest))
            tools.run("mend_eye", count=len(rows), index=index, hi=hi, lo=lo, **self._eye, **self._packed)
            inside |= not parallel and bool((space.power <= 0).any())
        return inside, int(part[:, 2].sum())

    def _largest_of_some(self) -> float:
        """About the largest coordinate or radius of some spheres in camera space, in scene units."""
        center = self.spheres.center[self.some] - np.array(self.camera.position)
        return max(float(np.abs(center @ self.basis.T).max()), self.packer.largest)

    def _see_all(self) -> NDArray[np.float64]:
        """Makes what the eye sees if k is what it is, and returns NOTES of kernels/pack/eye.cl."""
        tools, covers = self.tools, self.covers
        tools.clear(self.unsure, 1)
        arguments: Arguments = {"pitch": self.pitch, "shift": SHIFT}
        arguments |= {"again": self.packer.again, "some_again": self.packer.some_again}
        for name, axis in zip("xy", self.window.axes, strict=True):
            arguments[f"{name}_axis"] = (axis.scale, axis.begin, axis.end, 0)
            arguments[f"{name}_range"] = (axis.first, axis.stop)
        written = {"center_radius": self.made["center_radius"], "flags": self.flags}
        written |= {"covers": covers.cells, "unsure": self.unsure} | self._packed
        part = tools.noted("see_from_eye", 5, np.float64, n=self.n, **arguments, **self._eye, **written)
        covers.members, covers.entries = (int(total) for total in part[:, 3:5].sum(axis=0))
        return part

    def _lists(self, skipped: dict[str, int]) -> tuple[NDArray[np.int32], ListWriter]:
        """The lists of the tiles and of all light buffers. Adds to `skipped` what is in none of them."""
        tools, lights, lamps = self.tools, self.world.lights, self.packer.lamps
        m, key = len(lights), (self.k, lights.tobytes())
        # In float, axes that are turned are not those of lists any longer.
        keeps = self.keep and (self.real.itemsize == 8 or bool(are_at_points(kinds(lights)).all()))
        known = lamps if keeps and lamps and lamps.key == key else None
        lists = known.lists if known and known.lists else ListBuffers.of(tools, self.n, m)
        writer = ListWriter(tools, self.packer.request.precision, lists)
        grid = picture_grid(self.window.size)
        writer.add(grid, self.covers)
        skipped["spheres out of the picture"] = self.n - self.covers.members

        what = "spheres that shadow nothing seen, per light"
        if not m:
            skipped[what] = 0
            return np.zeros((1, 4), np.int32), writer
        if known:
            self.lamps = known
            self._see_again(known, writer)
            skipped[what] = known.idle
            return known.light_buffer + np.array([1, 0, 0, 0], np.int32), writer
        self.made["light_filter"] = tools.room(4 * (m * self.n + PACKET), np.float32, again=True)
        self.made["light_side"] = tools.room(m * self.n + PACKET, np.int8, again=True)
        light_buffer, idle = np.zeros((m, 4), np.int32), 0
        for number, light in enumerate(self.lights):
            first = len(writer.records)
            idle += self.n - light.look(self, number, writer)
            light_buffer[number] = first, len(writer.records) - first, -1, 0
        skipped[what] = idle
        if keeps:
            buffers, of = {"light_side": self.made["light_side"]}, light_buffer - np.array([1, 0, 0, 0], np.int32)
            self.lamps = KeptLights(key, self.camera, self.light, of, self.grids, [], None, {}, buffers, idle)
        return light_buffer, writer

    def _see_again(self, lamps: KeptLights, writer: ListWriter) -> None:
        """Adds what lights see, of which a camera changes directions alone."""
        tools, m, n, move = self.tools, len(self.lights), self.n, Move.of(lamps.camera, self.camera, self.unit)
        for grid, listed in zip(lamps.grids, lamps.listed, strict=True):
            turned = replace(grid, axes=rotated(self.basis, grid.axes)) if grid.perspective else move.grid(grid)
            writer.add_again(turned, listed)
        self.light = move.lights(self.light, lamps.light)
        self.made |= lamps.buffers
        if any(light.at_point for light in self.lights):
            self.made["light_filter"] = filters = tools.room(4 * (m * n + PACKET), np.float32, again=True)
            tools.copy(lamps.buffers["light_filter"], filters, 0, 16 * m * n)
        for number, light in enumerate(self.lights):
            if isinstance(light, AtPoint):
                tools.run("turn_light", **self._from(light), **self._axes, **self._rows_of(number, "light_filter"))

    def _from(self, light: AtPoint) -> Arguments:
        """What kernels are given that see spheres from a light at a point."""
        lamp = light.place * self.unit
        return {"n": self.n, "unit": self.unit, "lamp": lamp, "center": self.packer.center}

    def _rows_of(self, number: int, *names: str) -> Arguments:
        """What kernels are given that write a light's rows of these buffers."""
        return {"first": number * self.n} | {name: self.made[name] for name in names}

    def along(self, light: Parallel, number: int, writer: ListWriter) -> int:
        """Packs spheres as a parallel light sees them, and adds its grid. Returns how many spheres are in it."""
        axes, rows = light.axes, self._rows_of(number, "light_filter", "light_side")
        discs = _Discs.of(self, "see_along", self._eye | rows | dict(zip("abc", axes, strict=True)))
        window = window_of([discs.extent], self.slack, False)
        return self._add(axes, discs, window, self.slack, False, writer) if window else 0

    def from_point(self, light: AtPoint, number: int, writer: ListWriter) -> int:
        """Packs spheres as a light at a point sees them, and adds its grids.

        Returns how many spheres are in any of them.
        """
        tools, seen, radius = self.tools, self._from(light), {"radius": self.packer.radius}
        power = tools.room(self.pitch, np.float64)
        tools.clear(self.unsure, 1)
        tools.run("see_from_light", **seen, **radius, power=power, unsure=self.unsure)
        rows = self._unsure_rows()
        if len(rows):
            exact, _ = self._few(rows).times_two_to(self.k).seen_from(light.place * self.unit)
            index, value = tools.upload(rows), tools.upload(exact.power)
            tools.run("mend", count=len(rows), index=index, value=value, column=power)
        filters = self._rows_of(number, "light_filter", "light_side")
        some = self._few(self.some).times_two_to(self.k).seen_from(light.place * self.unit)[0].center
        cube = cube_of([some])
        spheres = seen | radius | dict(zip("abc", cube, strict=True))
        sides = tools.noted("cube_sides", 1, np.int32, **spheres, flags=self.flags)
        seen_on = int(np.bitwise_or.reduce(sides, axis=None))
        entered = 0
        for side, (axis, sign) in enumerate(SIDES):
            if not seen_on >> side & 1:
                continue
            discs = _Discs.of(self, "cube_discs", spheres | {"power": power, "side": side})
            window, slack = window_of([discs.extent], SLACK, True), SLACK
            if window and not window.coarse and self.slack < SLACK:
                window, slack = window_of([discs.extent], self.slack, True), self.slack
                window = window and window._replace(coarse=False)
            if window:
                entered += self._add(side_axes(cube, axis, sign), discs, window, slack, True, writer)
        tools.run("pack_light", **seen, **self._axes, **filters, power=power)
        return entered

    def _add(
        self, axes: Array, discs: _Discs, window: Rectangle, slack: float, perspective: bool, writer: ListWriter
    ) -> int:
        """Adds the grid of a window. Returns how many spheres are in no grid of the light before."""
        size, area = discs.size(), 4 * window.half.prod()
        wanted = FINER_ENTRIES if discs.count * size**2 > LAYERS * area else ENTRIES
        cells = window.cells(size, discs.count, wanted, max(discs.count, 2))
        sides: Arguments = dict(zip(("x_axis", "y_axis"), window.sides(cells), strict=True))
        self.covers.place(flags=self.flags, slack=slack, furthest=window.furthest, **sides, edges=discs.edges)
        del discs.edges  # Lists have room in their place.
        grid = CellGrid(axes, window.middle, window.half, cells, NOBODY, perspective, window.coarse)
        self.grids.append(grid)
        writer.add(replace(grid, axes=rotated(self.basis, axes)) if perspective else grid, self.covers)
        return self.covers.more


class _Discs:
    """The spheres that are seen through a side of the cube around a light, or along a direction, as discs.

    edges: four columns of `pitch` doubles; count: how many there are; extent: of all of them.
    """

    def __init__(self, spheres: _SeenSpheres, edges: Any, count: int, extent: Extent) -> None:
        self._spheres, self.edges, self.count, self.extent = spheres, edges, count, extent

    @classmethod
    def of(cls, spheres: _SeenSpheres, kernel: str, arguments: Arguments) -> _Discs:
        """arguments: of the kernel, besides those of all spheres. The depths go to those of spheres.covers."""
        edges = spheres.tools.room(4 * spheres.pitch, np.float64)
        written = {"pitch": spheres.pitch, "edges": edges, "near": spheres.covers.near, "flags": spheres.flags}
        part = spheres.tools.noted(kernel, 7, np.float64, **arguments | {"n": spheres.n}, **written)
        left, right, low, high, nearest, furthest, _ = part.max(axis=0).tolist()
        extent = Extent(2 * [[-left, right, -low, high]], -nearest, furthest)
        return cls(spheres, edges, int(part[:, 6].sum()), extent)

    def size(self) -> float:
        """The median of the widths and heights of those whose indices SAMPLE divides, or of all if there is none."""
        spheres = self._spheres
        for stride in (SAMPLE, 1):
            count = 4 * ((spheres.n - 1) // stride + 1)
            edges = spheres.tools.room(count, np.float64)
            discs = {"n": spheres.n, "pitch": spheres.pitch, "edges": self.edges, "near": spheres.covers.near}
            spheres.tools.run("sample_edges", **discs, stride=stride, sample=edges)
            found = spheres.tools.read(edges, count, np.float64).reshape(-1, 4).T
            found = found[:, ~np.isnan(found[0])]
            if found.size:
                break
        return float(np.median(found[1::2] - found[::2]))
