"""What makes CameraViews: numpy, or a device where surfaces are many."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from cltrace.plan.request import Request
from cltrace.plan.view import CameraView
from cltrace.plan.world import ScenePacking
from cltrace.run.devices import Device
from cltrace.scene import AnyCamera

if TYPE_CHECKING:
    from cltrace.run.pack.toolbox import Toolbox

# From so many surfaces on, a device makes CameraViews. A shell of 30,000 spheres takes 20 ms of a processor's time
# instead of 50, one of 10,000 takes 10 instead of 20, but the program takes 50 to load (PoCL 3.1, 1920x1080). A quarter
# is enough where cameras come one after the other, as that is soon made up for: 8,000 spheres take 8 ms instead of 16
# and 16,000 triangles 25 instead of 30; but 4,000 triangles would take 24 instead of 17 (480x270).
MANY, PART_AGAIN = 2**15, 4


class Packer(Protocol):
    """Makes CameraViews of a world by any camera, all with the same bits. Several threads may use it: one after the
    other."""

    @property
    def tools(self) -> Toolbox | None:
        """Those of the device, None if nothing is made there."""

    def fits(self, world: ScenePacking) -> bool:
        """Whether a world has the same surfaces in the same places; their materials may be others."""

    def view(self, world: ScenePacking, camera: AnyCamera, keep: bool = True) -> tuple[CameraView, dict[str, Any]]:
        """The view of a camera, with the bits of CameraView.of(), and buffers, by the names of abi.ARGUMENTS, that it
        lacks.

        world: one that fits; keep: whether what its lights see may be kept for other cameras. Raises ValueError as
        CameraView.of() does, and BuildError and DeviceError as Executor does.
        """


class NumpyPacker:
    """A Packer that makes nothing on a device: the judge of the others."""

    tools = None

    def __init__(self, request: Request) -> None:
        self._request = request

    def fits(self, world: ScenePacking) -> bool:
        """No: of a world nothing is kept, so that another packer, which may be a device's, costs nothing."""
        return False

    def view(self, world: ScenePacking, camera: AnyCamera, keep: bool = True) -> tuple[CameraView, dict[str, Any]]:
        """See Packer."""
        return CameraView.of(world, camera, self._request), {}


def packer_of(
    world: ScenePacking, request: Request, device: Device, before: Packer | None = None, again: bool = False
) -> Packer:
    """numpy's for few surfaces, and where no device's serves the world; else the first one that does.

    before: of another world on this device, whose spare memory is used again; again: whether there was a CameraView of
    this world. Raises BuildError and DeviceError as Executor does.
    """
    if len(world.id) <= (MANY // PART_AGAIN if again else MANY):
        return NumpyPacker(request)
    # Small scenes start faster without these.
    from cltrace.run.pack.meshes import MeshPacker
    from cltrace.run.pack.spheres import SpherePacker

    tools = before.tools if before else None
    served = SpherePacker.of(world, request, device, tools) or MeshPacker.of(world, request, device, tools)
    return served or NumpyPacker(request)
