"""Views of worlds of triangles, ellipsoids and spheres: numpy packs them, but for what takes longest.

The planes of triangles' edges, the polygons that triangles are to the eye and to lights at points, and the lists are
made on the device, with the same bits. A few polygons, which need clipping, are numpy's.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.errors import BuildError, DeviceError
from cltrace.plan.abi import Precision
from cltrace.plan.accel.cells import CellGrid, Mask
from cltrace.plan.exact import Array
from cltrace.plan.plan import MeshView, Methods, View, World, from_point, mesh_views
from cltrace.plan.request import Request
from cltrace.plan.shapes.polygon import Corners
from cltrace.plan.shapes.triangle import along_light, exact_sides
from cltrace.run.crowd import Spot
from cltrace.run.devices import Device, driver_errors
from cltrace.run.entries import Entries
from cltrace.run.program import Announcement
from cltrace.run.shelf import Shelf
from cltrace.run.toolbox import Toolbox, is_exact, kernel_of, vector
from cltrace.scene import PARALLEL, AnyCamera

# In place of what a ray from the eye has, for a light at a point.
AT_POINT = (-1.0, -1.0)


def load(device: Device, precision: Precision) -> None:
    """Loads the program that a Mixed needs first, if it can be loaded."""
    with suppress(BuildError, DeviceError), driver_errors(device):
        kernel_of(device, precision == "single", 4, "facets")


class Mixed:
    """A world's triangles on a device, which helps with Views of any camera.

    request: the one that the world was made for. Several threads may use it: one after the other.
    """

    def __init__(self, world: World, request: Request, device: Device, before: Toolbox | None = None) -> None:
        self._triangles, self._request, self._device = world.triangles, request, device
        self.tools = Toolbox(device, request.precision, before)
        self._face, self._lock = self.tools.share(world.triangles.face), threading.Lock()

    @classmethod
    def of(cls, world: World, request: Request, device: Device, before: Toolbox | None = None) -> Mixed | None:
        """None if the device does not compute as numpy does.

        Raises BuildError and DeviceError as Executor does.
        """
        with driver_errors(device):
            return cls(world, request, device, before) if is_exact(device) else None

    def fits(self, world: World) -> bool:
        """Whether a world has the same triangles."""
        return world.triangles is self._triangles

    def view(self, world: World, camera: AnyCamera) -> tuple[View, dict[str, Any]]:
        """The view of a camera, and the buffers, by the names of abi.ARGUMENTS, that its arrays lack.

        world: one that fits. Raises ValueError as View.of() does, and BuildError and DeviceError as Executor does.
        """
        made: dict[str, Any] = {}
        with self._lock, driver_errors(self._device), Announcement("compiling the kernel ..."):
            shelf = Shelf.of(self.tools, len(world.id), len(world.lights))
            methods = Methods(partial(self._see, made), partial(self._build, made, shelf))
            view = View.of(world, camera, self._request, methods)
            # What lists are made of takes half as much as all that is kept.
            self.tools.forget()
            return view, made

    def _see(
        self, made: dict[str, Any], world: World, camera: AnyCamera, lights: NDArray[np.void], near: Array, k: int
    ) -> tuple[list[MeshView], dict[str, NDArray[Any]]]:
        """What mesh_views() returns, but for the buffers, which are in `made` then."""
        m, basis, tools = len(world.triangles.face), np.array(camera.basis()), self.tools
        if not m or camera.parallel:
            return mesh_views(world, camera, lights, near, k)
        made["facet"] = tools.room(12 * m, np.float32)
        if len(lights):
            made["light_facet"] = tools.room(12 * m * len(lights), np.float32)
        face, first = world.triangles.face[:, :3], len(world.radius)
        eye = np.array(camera.position)
        met = self._facets(near, eye, camera.image_plane(), made["facet"], 0)
        found = [MeshView(Corners(near, face, first, None, self._spot(near, first)), met)]
        for light, (record, packed) in enumerate(zip(world.lights, lights, strict=True)):
            if record["kind"] == PARALLEL:
                axes = np.array([packed[name][:3] for name in ("axis", "across", "position")], np.float64)
                out = np.empty((3 * m, 4), np.float32)
                facets = along_light(near, world.triangles, axes, -record["direction"], out)
                tools.copy(tools.upload(out), made["light_facet"], 48 * m * light, 48 * m)
                found.append(MeshView(found[0].corners, facets.met))
            else:
                place = from_point(world, basis, record["position"], k)
                met = self._facets(place, record["position"], AT_POINT, made["light_facet"], m * light)
                found.append(MeshView(Corners(place, face, first, None, self._spot(place, first)), met))
        tools.finish()
        return found, {} if len(lights) else {"light_facet": np.zeros((0, 4), np.float32)}

    def _spot(self, near: Array, first: int) -> Spot | None:
        """What sees triangles from where corners are (v, 3). first: of Corners."""
        if "lists" in self._request.keep:
            return None
        return Spot(self.tools, near, self._face, len(self._triangles.face), first)

    def _build(self, made: dict[str, Any], shelf: Shelf, grids: Iterator[CellGrid]) -> dict[str, NDArray[Any]]:
        """Makes the lists of grids, which are in `made` then, and returns the records."""
        entries = Entries(self.tools, self._request.precision, shelf)
        for grid in grids:
            entries.add_members(grid)
            del grid  # The next one has room in its place.
        lists, records = entries.done()
        made |= lists
        return {"grid": records}

    def _facets(self, near: Array, point: Array, pane: tuple[float, float], facet: Any, first: int) -> Mask:
        """Makes the rows of `facet` from 3 first on, and returns which triangles can be met.

        near: (v, 3), the corners from a point of the world, along the camera's axes; pane: of the kernel.
        """
        tools, m = self.tools, len(self._triangles.face)
        met, unsure = tools.room(m, np.int8), tools.room(1 + m, np.int32)
        tools.clear(unsure, 1)
        common, vertex = (vector(pane), np.int64(first)), tools.share(near)
        out = (facet, met, unsure)
        nothing = tools.room(1, np.int32)
        tools.run("facets", np.int32(m), np.int32(0), *common, vertex, self._face, nothing, nothing, *out)
        count = int(tools.read(unsure, 1, np.int32)[0])
        if count:
            which = np.sort(tools.read(unsure, count, np.int32, 1))
            sides = tools.upload(np.array(exact_sides(self._triangles, which, point), np.int8))
            known = (vertex, self._face, tools.upload(which), sides)
            tools.run("facets", np.int32(count), np.int32(1), *common, *known, *out)
        return tools.read(met, m, np.bool_)
