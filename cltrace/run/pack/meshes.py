"""CameraViews of worlds of triangles, ellipsoids and spheres: numpy packs them, but for what takes longest.

The planes of triangles' edges, the polygons that triangles are to the eye and to lights, and the lists are made on the
device, with the same bits. A few polygons, which need clipping, are numpy's.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from cltrace.plan.accel.grids import CellGrid
from cltrace.plan.accel.silhouettes import Polygons
from cltrace.plan.lights import Lamp, Move, are_at_points, kinds
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array
from cltrace.plan.shapes.mesh import MeshesInView, MeshPacking, exact_sides, exact_turns
from cltrace.plan.shapes.shape import Arrays, InView, ShapePacking, Sights
from cltrace.plan.view import CameraView, KeptLights, Methods
from cltrace.plan.world import ScenePacking
from cltrace.run.devices import Device
from cltrace.run.pack.lists import ListBuffers, ListWriter
from cltrace.run.pack.polygons import PolygonSight
from cltrace.run.pack.toolbox import Arguments, Toolbox
from cltrace.scene import AnyCamera

# In place of what a ray from the eye has, for a light at a point.
AT_POINT = (-1.0, -1.0)


class MeshPacker:
    """A world's triangles on a device, which helps with CameraViews of any camera.

    request: the one that the world was made for; latest: `of` of the latest CameraView, see _SeenMeshes.
    Threads hold `lock` while they use it. Raises BuildError and DeviceError as Executor does.
    """

    def __init__(self, world: ScenePacking, request: Request, device: Device, before: Toolbox | None = None) -> None:
        self.triangles, self.request, self.device = world.of_shape(MeshPacking).triangles, request, device
        self.tools = Toolbox(device, request.precision, before)
        self.face, self.lock = self.tools.share(self.triangles.face), threading.Lock()
        self.kept: KeptLights | None = None
        self.latest: tuple[Any, ...] = ()

    def fits(self, world: ScenePacking) -> bool:
        """Whether a world has the same triangles."""
        return world.of_shape(MeshPacking).triangles is self.triangles

    def view(self, world: ScenePacking, camera: AnyCamera, keep: bool = True) -> tuple[CameraView, dict[str, Any]]:
        """See view_by(). What parallel lights see is kept from the second camera on: all surfaces get light then."""
        seen = _SeenMeshes(self, world, camera, keep)
        view = CameraView.of(world, camera, seen.request, Methods(seen.in_view, seen.build, seen.known))
        self.kept, self.latest = seen.to_keep(view), seen.of
        # What lists are made of takes half as much as all that is kept.
        self.tools.forget()
        return view, seen.made


class _SeenMeshes:
    """A world as one camera of a MeshPacker sees it.

    of: what cameras have to have in common that share what lights see, compared by identity, but for the last ones;
    request: that of the view; made: buffers by the names of abi.ARGUMENTS; count: of how many lights, the first ones,
    what they see is kept; kept: what other cameras have of it.
    """

    def __init__(self, packer: MeshPacker, world: ScenePacking, camera: AnyCamera, keep: bool) -> None:
        self.packer, self.world, self.camera, self.request = packer, world, camera, packer.request
        self.made: dict[str, Any] = {}
        self.grids: list[CellGrid] = []
        self.kept: KeptLights | None = None
        self.of = (*world.shapes, world.lights.tobytes(), camera.parallel)
        # In float, axes that are turned are not those of lists any longer.
        keep = keep and packer.request.precision != "single" and packer.latest == self.of
        self.count = int((~are_at_points(kinds(world.lights))).sum()) if keep else 0
        if self.count and "receivers" not in self.request.keep:
            self.request = replace(self.request, keep=(*self.request.keep, "receivers"))

    def in_view(self, shape: ShapePacking, camera: AnyCamera, first: int) -> InView:
        """What Shape.in_view() makes, but that buffers of triangles will be in `made`."""
        if isinstance(shape, MeshPacking) and len(shape.number) and not camera.parallel:
            return _OnDevice(shape, camera, first, of=self)
        return shape.in_view(camera, first)

    def known(self, k: int) -> KeptLights | None:
        """See Methods."""
        kept = self.packer.kept
        self.unit, self.key = 2.0**k, (*self.of, k)
        self.kept = kept if self.count and kept and kept.key == self.key else None
        return self.kept

    def build(self, grids: Iterator[CellGrid]) -> Arrays:
        """Makes the lists of grids, which are in `made` then, and returns the records."""
        tools, world, kept = self.packer.tools, self.world, self.kept
        buffers = kept.lists if kept else ListBuffers.of(tools, len(world.id), len(world.lights))
        self.writer = writer = ListWriter(tools, self.request.precision, buffers)
        for grid in grids:
            writer.add_members(grid)
            self.grids.append(grid.without_members())
            del grid  # The next one has room in its place.
        if kept:
            move = Move.of(kept.camera, self.camera, self.unit)
            for grid, listed in zip(kept.grids, kept.listed, strict=True):
                writer.add_again(move.grid(grid), listed)
        lists, records = writer.done(common=kept is None)
        self.made |= lists
        return {"grid": records}

    def to_keep(self, view: CameraView) -> KeptLights | None:
        """What further cameras may use."""
        if self.kept:
            return replace(self.kept, lists=self.writer.lists)
        arrays, m, count = view.arrays, len(self.world.lights), self.count
        if not count:
            return None
        buffer = arrays["light_buffer"][:count] - np.array([1, 0, 0, 0], np.int32)
        lit = {name: arrays[name][: len(arrays[name]) // m * count] for name in view.lit}
        own = slice(1, 1 + int(buffer[:, 1].sum()))
        made = {name: self.made[name] for name in ("light_facet",) if name in self.made}
        return KeptLights(
            self.key, self.camera, arrays["light"][:count], buffer, self.grids[own], self.writer.listed[own],
            self.writer.lists, lit, made,
        )  # fmt: skip


@dataclass
class _OnDevice(MeshesInView):
    """Triangles as a camera sees them, whose facets are buffers. of: gets these, in `made`."""

    of: _SeenMeshes = field(kw_only=True)

    def see(self, k: int, lights: list[Lamp], request: Request) -> Sights:
        sights = super().see(k, lights, request)
        self.of.packer.tools.finish()
        return sights

    def rows(self, lights: int) -> Iterable[int]:
        """The first triangle's index in a buffer, where each one has three rows."""
        m, tools, kept, made = len(self.shape.triangles.face), self.of.packer.tools, self.of.kept, self.of.made
        made["facet"], first = tools.room(12 * m, np.float32), self.of.count if kept else 0
        if lights:
            made["light_facet"] = tools.room(12 * m * (first + lights), np.float32, again=True)
        elif kept:
            made["light_facet"] = kept.buffers["light_facet"]
        else:
            self.lit["light_facet"] = np.zeros((0, 4), np.float32)
        if kept and lights:
            tools.copy(kept.buffers["light_facet"], made["light_facet"], 0, 48 * m * first)
        return [0, *range(m * first, m * (first + lights), m)]

    def from_eye(self, k: int, out: Any) -> Polygons:
        rows: Arguments = {"pane": self.camera.image_plane(), "facet": self.of.made["facet"], "first": out}
        return self._facets("facets", self.near, partial(exact_sides, point=np.array(self.camera.position)), rows)

    def from_light(self, light: Lamp, k: int, out: Any) -> Polygons:
        rows: Arguments = {"facet": self.of.made["light_facet"], "first": out}
        if not light.at_point:
            rows |= dict(zip("abc", light.axes, strict=True))
            return self._facets("facets_along", self.near, partial(exact_turns, towards=light.towards), rows)
        place = self.seen_from(light.place, 2.0**k)
        return self._facets("facets", place, partial(exact_sides, point=light.place), rows | {"pane": AT_POINT})

    def _facets(self, kernel: str, near: Array, exact: Callable[..., list[int]], rows: Arguments) -> Polygons:
        """Makes rows of facets, and returns what is seen from a point, or along a direction.

        kernel: its name; near: (v, 3), the corners from there along the camera's axes; exact: what decides which sides
        of some of the triangles are seen where the kernel is unsure; rows: what the kernel is given besides.
        """
        packer, m = self.of.packer, len(self.shape.triangles.face)
        tools, face = packer.tools, packer.face
        met, unsure = tools.room(m, np.int8), tools.room(1 + m, np.int32)
        tools.clear(unsure, 1)
        common = rows | {"vertex": tools.share(near), "face": face, "met": met, "unsure": unsure}
        nothing = tools.room(1, np.int32)
        tools.run(kernel, count=m, known=False, which=nothing, side_of=nothing, **common)
        count = int(tools.read(unsure, 1, np.int32)[0])
        if count:
            which = np.sort(tools.read(unsure, count, np.int32, 1))
            sides = tools.upload(np.array(exact(self.shape.triangles, which), np.int8))
            tools.run(kernel, count=count, known=True, which=tools.upload(which), side_of=sides, **common)
        lists = "lists" not in packer.request.keep
        sight = PolygonSight(tools, near, face, count=m, first=self.first) if lists else None
        return self.polygons(near, tools.read(met, m, np.int8), sight)
