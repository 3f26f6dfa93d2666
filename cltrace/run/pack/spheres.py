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
from cltrace.plan.lights import Lamp, Move, are_at_points, kinds
from cltrace.plan.lists import ONE_LIST
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, rotated
from cltrace.plan.shapes.sphere import CameraSpace, SpherePacking
from cltrace.plan.view import CameraView, KeptLights, exponent_of
from cltrace.plan.world import ScenePacking
from cltrace.run.devices import Device
from cltrace.run.pack.lists import ListBuffers, ListWriter
from cltrace.run.pack.toolbox import PACKET, Arguments, Toolbox
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
OTHERS = {"lists", "unstopped"}


class SpherePacker:
    """A world's spheres on a device, for CameraViews of any camera.

    spheres: of a world; request: the one that it was made for; lamps: of the latest CameraView, in double at any rate.
    Threads hold `lock` while they use it. Raises BuildError and DeviceError as Executor does.
    """

    def __init__(self, world: ScenePacking, request: Request, device: Device, before: Toolbox | None = None) -> None:
        self.request, self.tools = request, Toolbox(device, request.precision, before)
        self.spheres = spheres = world.of_shape(SpherePacking)
        self.center, self.radius = self.tools.share(spheres.center), self.tools.share(spheres.radius)
        self.some_again = bool(spheres.again.any())
        self.again = self.tools.share(spheres.again) if self.some_again else self.tools.room(1, np.bool_)
        self.largest = float(spheres.radius.max())
        self.lamps: KeptLights | None = None
        self.device, self.lock = device, threading.Lock()

    @staticmethod
    def serves(world: ScenePacking, request: Request) -> bool:
        """Whether there are only spheres, and more than a few."""
        spheres = world.of_shape(SpherePacking)
        return (
            ONE_LIST < len(spheres.row) == len(world.id)
            and not spheres.maps
            and not world.clipping
            and OTHERS.isdisjoint(request.keep)
        )

    def fits(self, world: ScenePacking) -> bool:
        """Whether a world has the same spheres in the same places; their materials may be others."""
        return world.of_shape(SpherePacking) is self.spheres

    def view(self, world: ScenePacking, camera: AnyCamera, keep: bool = True) -> tuple[CameraView, dict[str, Any]]:
        """See view_by()."""
        return _SeenSpheres(self, world, camera, keep).view() or (CameraView.of(world, camera, self.request), {})


class _SeenSpheres:
    """The spheres of a SpherePacker as one camera sees them.

    common: what kernels of kernels/pack are given by its name, see there; members, entries: how many spheres `covers`
    and `near` of these are of, and how many cells of level 0 they cover.
    """

    def __init__(self, packer: SpherePacker, world: ScenePacking, camera: AnyCamera, keep: bool) -> None:
        self.packer, self.world, self.camera, self.keep = packer, world, camera, keep
        self.tools, self.spheres, room = packer.tools, packer.spheres, partial(packer.tools.room, again=True)
        self.n = len(self.spheres.radius)
        self.pitch = -(-self.n // PACKET) * PACKET
        self.some = sample(np.arange(self.n))
        self.basis = np.array(camera.basis())
        self.slack = SLACK if packer.request.precision == "single" else FINE_SLACK
        self.real = np.dtype("f4" if packer.request.precision == "single" else "f8")
        columns = {"center_radius": (4, self.real), "power": (2, self.real), "eye_filter": (4, np.dtype("f4"))}
        if self.real.itemsize == 8:
            columns["world"] = 4, self.real
        self.made: dict[str, Any] = {name: room(wide * self.pitch, kind) for name, (wide, kind) in columns.items()}
        self.lamps: KeptLights | None = None
        self.grids: list[CellGrid] = []
        unsure = self.tools.room(1 + self.n, np.int32)  # Of which nearly nothing is used.
        self.common: Arguments = {"n": self.n, "pitch": self.pitch, "unsure": unsure, "world": unsure} | self.made
        self.common |= {"center": packer.center, "radius": packer.radius, "again": packer.again}
        self.common |= {"eye": camera.position, "along": camera.parallel, "some_again": packer.some_again}
        self.common |= dict(zip(("right", "up", "back"), self.basis, strict=True))
        self.common |= {"flags": room(self.pitch, np.int8), "near": room(self.pitch, np.float32)}
        self.common["covers"] = room(4 * self.pitch, np.int16)
        self.members = self.entries = 0

    def _run(self, name: str, **own: Any) -> None:
        self.tools.run(name, **self.common | own)

    def _noted(self, name: str, columns: int, dtype: Any, **own: Any) -> NDArray[Any]:
        return self.tools.noted(name, columns, dtype, **self.common | own)

    def view(self) -> tuple[CameraView, dict[str, Any]] | None:
        """See SpherePacker.view(); None if pixels are so tiny that the kernels' float32 is too coarse."""
        world, packer = self.world, self.packer
        inside = self._see_from_eye()
        if inside is None:
            return None
        view = CameraView.without_lists(world, self.camera, packer.request, self.k)
        self.lights = [*map(Lamp, world.lights, view.arrays["light"])]
        skipped, start = dict(view.skipped), time.perf_counter()
        self.light = view.arrays["light"]
        light_buffer, writer = self._lists(skipped)
        lists, grid = writer.done()
        if self.lamps:
            buffers = self.lamps.buffers | {"light_filter": self.made["light_filter"]}
            packer.lamps = replace(self.lamps, buffers=buffers, listed=writer.listed[1:], lists=writer.lists)
        arrays = view.arrays | {"grid": grid, "light_buffer": light_buffer, "light": self.light}
        made = self.made | lists
        # What other shapes, or lights, would have.
        lacking = [a for a in abi.ARGUMENTS if a.kind == "buffer" and a.name not in arrays.keys() | made.keys()]
        arrays |= {a.name: np.zeros(1, abi.dtype_of(a.type, packer.request.precision)) for a in lacking}
        seconds = {"lists": time.perf_counter() - start}
        return replace(view, arrays=arrays, inside=inside, skipped=skipped, seconds=seconds), made

    def _few(self, rows: Any) -> CameraSpace:
        """Some of the spheres as numpy sees them, in scene units."""
        return CameraSpace.of(self.camera, self.spheres.center[rows], self.spheres.radius[rows])

    def _unsure_rows(self) -> NDArray[np.int32]:
        """The rows that kernels are unsure of."""
        count = int(self.tools.read(self.common["unsure"], 1, np.int32)[0])
        return np.sort(self.tools.read(self.common["unsure"], count, np.int32, 1))

    def _see_from_eye(self) -> bool | None:
        """Makes what depends on the eye alone, and k and the window.

        Returns whether the eye is inside of a sphere or on it; None as view().
        """
        # Some spheres nearly always tell which one is the k of all: about the largest coordinate or radius is theirs.
        center = self.spheres.center[self.some] - np.array(self.camera.position)
        most, k = max(float(np.abs(center @ self.basis.T).max()), self.packer.largest), None
        while k != (k := exponent_of(self.world, self.camera, (), most)):
            self.k, self.common["unit"] = k, 2.0**k
            self.window = PictureWindow.of(self.camera, self.packer.request, k)
            if min(self.window.step) <= (FINE if self.camera.parallel else TINY):
                return None
            self.tools.clear(self.common["unsure"], 1)
            window: Arguments = {"shift": SHIFT}
            for name, axis in zip("xy", self.window.axes, strict=True):
                window[f"{name}_axis"] = (axis.scale, axis.begin, axis.end, 0)
                window[f"{name}_range"] = (axis.first, axis.stop)
            part = self._noted("see_from_eye", 5, np.float64, **window)
            most = float(part[:, 0].max())
        self.members, self.entries = (int(total) for total in part[:, 3:].sum(axis=0))
        inside, rows = bool(part[:, 1].max() >= 0), self._unsure_rows()
        if len(rows):
            space = self._few(rows)
            index, hi, lo = (self.tools.upload(values) for values in (rows, space.power, space.power_rest))
            self._run("mend_eye", count=len(rows), index=index, hi=hi, lo=lo)
            inside |= not self.camera.parallel and bool((space.power <= 0).any())
        return inside

    def _lists(self, skipped: dict[str, int]) -> tuple[NDArray[np.int32], ListWriter]:
        """The lists of the tiles and of all light buffers. Adds to `skipped` what is in none of them."""
        tools, lights, lamps = self.tools, self.world.lights, self.packer.lamps
        m, key = len(lights), (self.k, lights.tobytes())
        # In float, axes that are turned are not those of lists any longer.
        keeps = self.keep and (self.real.itemsize == 8 or bool(are_at_points(kinds(lights)).all()))
        known = lamps if keeps and lamps and lamps.key == key else None
        lists = known.lists if known and known.lists else ListBuffers.of(tools, self.n, m)
        writer = ListWriter(tools, self.packer.request.precision, lists)
        writer.add(picture_grid(self.window.size), self.common, self.members, self.entries)
        skipped["spheres out of the picture"] = self.n - self.members

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
            idle += self.n - (self.from_point if light.at_point else self.along)(
                light, self.made | {"first": number * self.n}, writer
            )
            light_buffer[number] = first, len(writer.records) - first, -1, 0
        skipped[what] = idle
        if keeps:
            buffers, of = {"light_side": self.made["light_side"]}, light_buffer - np.array([1, 0, 0, 0], np.int32)
            self.lamps = KeptLights(key, self.camera, self.light, of, self.grids, [], None, {}, buffers, idle)
        return light_buffer, writer

    def _see_again(self, lamps: KeptLights, writer: ListWriter) -> None:
        """Adds what lights see, of which a camera changes directions alone."""
        tools, m, n, unit = self.tools, len(self.lights), self.n, self.common["unit"]
        move = Move.of(lamps.camera, self.camera, unit)
        for grid, listed in zip(lamps.grids, lamps.listed, strict=True):
            turned = replace(grid, axes=rotated(self.basis, grid.axes)) if grid.perspective else move.grid(grid)
            writer.add_again(turned, listed)
        self.light = move.lights(self.light, lamps.light)
        self.made |= lamps.buffers
        if any(light.at_point for light in self.lights):
            self.made["light_filter"] = filters = tools.room(4 * (m * n + PACKET), np.float32, again=True)
            tools.copy(lamps.buffers["light_filter"], filters, 0, 16 * m * n)
        for number, light in enumerate(self.lights):
            if light.at_point:
                self._run("turn_light", lamp=light.place * unit, first=number * n, light_filter=filters)

    def along(self, light: Lamp, rows: Arguments, writer: ListWriter) -> int:
        """Packs spheres as a parallel light sees them, and adds its grid. Returns how many spheres are in it.

        rows: the light's buffers, and its first row there.
        """
        edges, count, extent = self._discs("see_along", **rows, **dict(zip("abc", light.axes, strict=True)))
        window = window_of([extent], self.slack, False)
        if not window:
            return 0
        more = self._place(light.axes, edges, count, window, self.slack, False)
        del edges  # Lists have room in their place.
        self._list(writer)
        return more

    def from_point(self, light: Lamp, rows: Arguments, writer: ListWriter) -> int:
        """Packs spheres as a light at a point sees them, and adds its grids.

        Returns how many spheres are in any of them. rows: see along().
        """
        tools, lamp = self.tools, light.place * self.common["unit"]
        power = tools.room(self.pitch, np.float64)
        tools.clear(self.common["unsure"], 1)
        self._run("see_from_light", lamp=lamp, power=power)
        unsure = self._unsure_rows()
        if len(unsure):
            exact, _ = self._few(unsure).times_two_to(self.k).seen_from(lamp)
            index, value = tools.upload(unsure), tools.upload(exact.power)
            tools.run("mend", count=len(unsure), index=index, value=value, column=power)
        cube = cube_of([self._few(self.some).times_two_to(self.k).seen_from(lamp)[0].center])
        seen = {"lamp": lamp, "power": power} | dict(zip("abc", cube, strict=True))
        seen_on = int(np.bitwise_or.reduce(self._noted("cube_sides", 1, np.int32, **seen), axis=None))
        entered = 0
        for side, (axis, sign) in enumerate(SIDES):
            if not seen_on >> side & 1:
                continue
            edges, count, extent = self._discs("cube_discs", **seen, side=side)
            window, slack = window_of([extent], SLACK, True), SLACK
            if window and not window.coarse and self.slack < SLACK:
                window, slack = window_of([extent], self.slack, True), self.slack
                window = window and window._replace(coarse=False)
            if window:
                entered += self._place(side_axes(cube, axis, sign), edges, count, window, slack, True)
                del edges  # Lists have room in their place.
                self._list(writer)
        self._run("pack_light", **rows | seen)
        return entered

    def _discs(self, kernel: str, **own: Any) -> tuple[Any, int, Extent]:
        """The spheres that are seen through a side of the cube around a light, or along a direction, as discs.

        Returns four columns of `pitch` doubles, their edges, how many discs there are, and the extent of all of them.
        The depths go to `near`.
        """
        edges = self.tools.room(4 * self.pitch, np.float64)
        part = self._noted(kernel, 7, np.float64, **own, edges=edges)
        left, right, low, high, nearest, furthest, _ = part.max(axis=0).tolist()
        return edges, int(part[:, 6].sum()), Extent(2 * [[-left, right, -low, high]], -nearest, furthest)

    def _size_of(self, edges: Any) -> float:
        """The median of the widths and heights of discs whose indices SAMPLE divides, or of all if there is none."""
        for stride in (SAMPLE, 1):
            count = 4 * ((self.n - 1) // stride + 1)
            some = self.tools.room(count, np.float64)
            self._run("sample_edges", edges=edges, stride=stride, sample=some)
            found = self.tools.read(some, count, np.float64).reshape(-1, 4).T
            found = found[:, ~np.isnan(found[0])]
            if found.size:
                break
        return float(np.median(found[1::2] - found[::2]))

    def _place(self, axes: Array, edges: Any, count: int, window: Rectangle, slack: float, perspective: bool) -> int:
        """Adds a window to `grids`. edges, count: see _discs(). Returns how many spheres are in no grid of the light
        before."""
        size, area = self._size_of(edges), 4 * window.half.prod()
        wanted = FINER_ENTRIES if count * size**2 > LAYERS * area else ENTRIES
        cells = window.cells(size, count, wanted, max(count, 2))
        sides: Arguments = dict(zip(("x_axis", "y_axis"), window.sides(cells), strict=True))
        part = self._noted("place", 3, np.int64, slack=slack, furthest=window.furthest, **sides, edges=edges)
        self.members, self.entries, more = part.sum(axis=0).tolist()
        self.grids.append(CellGrid(axes, window.middle, window.half, cells, NOBODY, perspective, window.coarse))
        return int(more)

    def _list(self, writer: ListWriter) -> None:
        """Makes the lists of the last grid."""
        grid = self.grids[-1]
        grid = replace(grid, axes=rotated(self.basis, grid.axes)) if grid.perspective else grid
        writer.add(grid, self.common, self.members, self.entries)
