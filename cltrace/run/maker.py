"""What makes Views on a device, or helps to."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from cltrace.plan.abi import Precision
from cltrace.plan.order import spatial_order
from cltrace.plan.plan import OrderOf, View, World
from cltrace.plan.request import Request
from cltrace.run.devices import Device
from cltrace.scene import AnyCamera, Scene

if TYPE_CHECKING:
    from cltrace.run.toolbox import Toolbox

# From so many surfaces on, a device makes Views. A shell of 30,000 spheres takes 20 ms of a processor's time instead of
# 50, one of 10,000 takes 10 instead of 20, but the program takes 50 to load (PoCL 3.1, 1920x1080).
MANY = 2**15


class Maker(Protocol):
    """A world on a device, for Views of any camera. Several threads may use it: one after the other."""

    tools: Toolbox

    def fits(self, world: World) -> bool:
        """Whether a world has the same surfaces in the same places; their materials may be others."""

    def view(self, world: World, camera: AnyCamera) -> tuple[View, dict[str, Any]]:
        """The view of a camera, with the bits of View.of(), and buffers, by the names of abi.ARGUMENTS, that it lacks.

        world: one that fits. Raises ValueError as View.of() does, and BuildError and DeviceError as Executor does.
        """


def order_on(device: Device, n: int, precision: Precision) -> OrderOf:
    """What finds the order in memory of n spheres: the device if they are many, else numpy.

    Raises what maker_of() does.
    """
    if n <= MANY:
        return spatial_order
    from cltrace.run.order import Order

    return Order.on(device, precision) or spatial_order


def loading(scene: Scene, request: Request, device: Device) -> Callable[[], None]:
    """Begins to load the program of maker_of() for a scene's meshes, and returns what waits until it is there.

    A processor has nothing else to do for about a third of the time in which a world is made. What fails here fails
    again where the program is needed.
    """
    if not scene.triangles > MANY or len(scene.columns) > MANY or request.antialias is not None:
        return lambda: None
    thread = threading.Thread(target=_load, args=(device, request.precision), daemon=True)
    thread.start()
    return thread.join


def _load(device: Device, precision: Precision) -> None:
    from cltrace.run.mixed import load

    load(device, precision)


def maker_of(world: World, request: Request, device: Device, before: Maker | None = None) -> Maker | None:
    """None if numpy packs this world: few surfaces, meshes that are antialiased, or a device that has other bits.

    before: of another world on this device, whose spare memory is used again. Raises BuildError and DeviceError as
    Executor does.
    """
    faces = len(world.triangles.face)
    if len(world.radius) + faces <= MANY or (faces and request.antialias is not None):
        return None
    tools = before.tools if before else None
    # Small scenes start faster without these.
    if not faces:
        from cltrace.run.packing import Packing

        if packing := Packing.of(world, request, device, tools):
            return packing
    from cltrace.run.mixed import Mixed

    return Mixed.of(world, request, device, tools)
