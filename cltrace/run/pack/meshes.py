"""Views of worlds of triangles, ellipsoids and spheres: numpy packs them, but for what takes longest.

The planes of triangles' edges, the polygons that triangles are to the eye and to lights, and the lists are made on the
device, with the same bits. A few polygons, which need clipping, are numpy's.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from cltrace.base.errors import BuildError, DeviceError
from cltrace.base.waiting import Announcement
from cltrace.plan.abi import Precision
from cltrace.plan.accel.cells import CellGrid
from cltrace.plan.accel.polygons import Polygons
from cltrace.plan.lights import AtPoint, Lamp, Parallel
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array
from cltrace.plan.shapes.mesh import Meshes, MeshesInView
from cltrace.plan.shapes.shape import Arrays, InView, Shape, Sights
from cltrace.plan.shapes.triangle import exact_sides, exact_turns
from cltrace.plan.view import Methods, View
from cltrace.plan.world import World
from cltrace.run.devices import Device, driver_errors
from cltrace.run.pack.list_buffers import ListBuffers
from cltrace.run.pack.lists import ListWriter
from cltrace.run.pack.polygons import PolygonSight
from cltrace.run.pack.toolbox import Arguments, Toolbox, is_exact, kernel_of
from cltrace.scene import AnyCamera

# In place of what a ray from the eye has, for a light at a point.
AT_POINT = (-1.0, -1.0)


def load(device: Device, precision: Precision) -> None:
    """Loads the program that a MeshPacker needs first, if it can be loaded."""
    with suppress(BuildError, DeviceError), driver_errors(device):
        kernel_of(device, precision == "single", double_edges=False, name="facets")


class MeshPacker:
    """A world's triangles on a device, which helps with Views of any camera.

    request: the one that the world was made for. Several threads may use it: one after the other.
    """

    def __init__(self, world: World, request: Request, device: Device, before: Toolbox | None = None) -> None:
        self.triangles, self.request, self._device = world.of_shape(Meshes).triangles, request, device
        self.tools = Toolbox(device, request.precision, before)
        self.face, self._lock = self.tools.share(self.triangles.face), threading.Lock()

    @classmethod
    def of(cls, world: World, request: Request, device: Device, before: Toolbox | None = None) -> MeshPacker | None:
        """None where triangles are in a proof, and if the device does not compute as numpy does.

        Raises BuildError and DeviceError as Executor does.
        """
        served = (request.antialias is None or not len(world.of_shape(Meshes).number)) and is_exact(device)
        with driver_errors(device):
            return cls(world, request, device, before) if served else None

    def fits(self, world: World) -> bool:
        """Whether a world has the same triangles."""
        return world.of_shape(Meshes).triangles is self.triangles

    def view(self, world: World, camera: AnyCamera) -> tuple[View, dict[str, Any]]:
        """See Packer."""
        made: dict[str, Any] = {}
        with self._lock, driver_errors(self._device), Announcement("compiling the kernel ..."):
            lists = ListBuffers.of(self.tools, len(world.id), len(world.lights))
            methods = Methods(partial(self._in_view, made), partial(self._build, made, lists))
            view = View.of(world, camera, self.request, methods)
            # What lists are made of takes half as much as all that is kept.
            self.tools.forget()
            return view, made

    def _in_view(self, made: dict[str, Any], shape: Shape, camera: AnyCamera, first: int) -> InView:
        """What Shape.in_view() makes, but that buffers of triangles will be in `made`."""
        if isinstance(shape, Meshes) and len(shape.number) and not camera.parallel:
            return _OnDevice(shape.triangles, camera, first, packer=self, made=made)
        return shape.in_view(camera, first)

    def _build(self, made: dict[str, Any], buffers: ListBuffers, grids: Iterator[CellGrid]) -> Arrays:
        """Makes the lists of grids, which are in `made` then, and returns the records."""
        writer = ListWriter(self.tools, self.request.precision, buffers)
        for grid in grids:
            writer.add_members(grid)
            del grid  # The next one has room in its place.
        lists, records = writer.done()
        made |= lists
        return {"grid": records}


@dataclass
class _OnDevice(MeshesInView):
    """Triangles as a camera sees them, whose facets are buffers. made: gets these, by the names of abi.ARGUMENTS."""

    packer: MeshPacker = field(kw_only=True)
    made: dict[str, Any] = field(kw_only=True)

    def see(self, k: int, lights: list[Lamp], request: Request) -> Sights:
        sights = super().see(k, lights, request)
        self.packer.tools.finish()
        return sights

    def rows(self, lights: int) -> Iterable[int]:
        """The first triangle's index in a buffer, where each one has three rows."""
        m, tools = len(self.triangles.face), self.packer.tools
        self.made["facet"] = tools.room(12 * m, np.float32)
        if lights:
            self.made["light_facet"] = tools.room(12 * m * lights, np.float32)
        else:
            self.arrays["light_facet"] = np.zeros((0, 4), np.float32)
        return [0, *range(0, m * lights, m)]

    def from_eye(self, k: int, out: Any) -> Polygons:
        rows: Arguments = {"pane": self.camera.image_plane(), "facet": self.made["facet"], "first": out}
        return self._facets("facets", self.near, partial(exact_sides, point=np.array(self.camera.position)), rows)

    def from_point(self, light: AtPoint, k: int, out: Any) -> Polygons:
        rows: Arguments = {"pane": AT_POINT, "facet": self.made["light_facet"], "first": out}
        place = self.seen_from(light.place, 2.0**k)
        return self._facets("facets", place, partial(exact_sides, point=light.place), rows)

    def along(self, light: Parallel, k: int, out: Any) -> Polygons:
        rows: Arguments = {"facet": self.made["light_facet"], "first": out, **dict(zip("abc", light.axes, strict=True))}
        return self._facets("facets_along", self.near, partial(exact_turns, towards=light.towards), rows)

    def _facets(self, kernel: str, near: Array, exact: Callable[..., list[int]], rows: Arguments) -> Polygons:
        """Makes rows of facets, and returns what is seen from a point, or along a direction.

        kernel: its name; near: (v, 3), the corners from there along the camera's axes; exact: what decides which sides
        of some of the triangles are seen where the kernel is unsure; rows: what the kernel is given besides.
        """
        tools, face, m = self.packer.tools, self.packer.face, len(self.triangles.face)
        met, unsure = tools.room(m, np.int8), tools.room(1 + m, np.int32)
        tools.clear(unsure, 1)
        common = rows | {"vertex": tools.share(near), "face": face, "met": met, "unsure": unsure}
        nothing = tools.room(1, np.int32)
        tools.run(kernel, count=m, known=False, which=nothing, side_of=nothing, **common)
        count = int(tools.read(unsure, 1, np.int32)[0])
        if count:
            which = np.sort(tools.read(unsure, count, np.int32, 1))
            sides = tools.upload(np.array(exact(self.triangles, which), np.int8))
            tools.run(kernel, count=count, known=True, which=tools.upload(which), side_of=sides, **common)
        lists = "lists" not in self.packer.request.keep
        sight = PolygonSight(tools, near, face, count=m, first=self.first) if lists else None
        return self.polygons(near, tools.read(met, m, np.int8), sight)
