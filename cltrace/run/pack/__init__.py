"""Views of many surfaces, made on a device with numpy's bits: the kernels of kernels/pack, and what runs them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cltrace.base.waiting import Announcement
from cltrace.plan.request import Request
from cltrace.plan.view import CameraView
from cltrace.plan.world import ScenePacking
from cltrace.run.devices import Device, driver_errors
from cltrace.scene import AnyCamera

if TYPE_CHECKING:
    from cltrace.run.pack.meshes import MeshPacker
    from cltrace.run.pack.spheres import SpherePacker

    Packer = SpherePacker | MeshPacker
# From so many surfaces on, a device makes CameraViews. A shell of 30,000 spheres takes 20 ms of a processor's time
# instead of 50, one of 10,000 takes 10 instead of 20, but the program takes 50 to load (PoCL 3.1, 1920x1080). A quarter
# is enough where cameras come one after the other, as that is soon made up for: 8,000 spheres take 8 ms instead of 16
# and 16,000 triangles 25 instead of 30; but 4,000 triangles would take 24 instead of 17 (480x270).
MANY, PART_AGAIN = 2**15, 4


def packer_of(
    world: ScenePacking, request: Request, device: Device, before: Packer | None = None, again: bool = False
) -> Packer | None:
    """What makes CameraViews of a world on a device; None for few surfaces, and on one that does
    not compute as numpy does.

    before: of another world on this device, whose spare memory is used again; again: whether there was a CameraView of
    this world. Raises BuildError and DeviceError as Executor does.
    """
    if len(world.id) <= (MANY // PART_AGAIN if again else MANY):
        return None
    # Small scenes start faster without these.
    from cltrace.run.pack.meshes import MeshPacker
    from cltrace.run.pack.spheres import SpherePacker
    from cltrace.run.pack.toolbox import is_exact

    if not is_exact(device):
        return None
    kind = SpherePacker if SpherePacker.serves(world, request) else MeshPacker
    with driver_errors(device):
        return kind(world, request, device, before.tools if before else None)


def view_by(
    packer: Packer | None, world: ScenePacking, camera: AnyCamera, request: Request, keep: bool = True
) -> tuple[CameraView, dict[str, Any]]:
    """The view of a camera, with the bits of CameraView.of(), and what it lacks: buffers, by names of abi.ARGUMENTS.

    packer: one that fits the world, None for numpy; keep: whether what the lights see may be kept for other cameras.
    Raises ValueError as CameraView.of() does, and BuildError and DeviceError as Executor does.
    """
    if packer is None:
        return CameraView.of(world, camera, request), {}
    with packer.lock, driver_errors(packer.device), Announcement("compiling the kernel ..."):
        return packer.view(world, camera, keep)
