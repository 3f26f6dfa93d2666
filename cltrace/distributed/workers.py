"""What runs in a worker: it starts OpenCL there, and keeps a Renderer from task to task."""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from distributed import Worker, WorkerPlugin

from cltrace.base.arrays import processors
from cltrace.base.errors import CltraceError, TooManyRaysError, TooSlowError
from cltrace.picture.image import Image
from cltrace.plan.request import Crop
from cltrace.renderers.renderer import Renderer
from cltrace.run.devices import Device, choose
from cltrace.scene import Camera, Scene

# A worker has one of these if it has a device, and a task takes it: so one draws at a time, whatever threads it has.
RESOURCE = "cltrace"
# How PoCL of several ages, and Intel's driver, are told how many threads they may have.
THREADS = ("POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT", "DPCPP_CPU_NUM_CUS")


@dataclass(frozen=True)
class Part:
    """Which part of a picture is drawn, and what of its Image is sent.

    crop: the part, None for all; rows: the first and the one after the last of those that are drawn, None for all that
    the crop has, which is kept for others; wanted: what the worker makes of the Image, None for the Image itself.
    """

    crop: Crop | None = None
    rows: tuple[int, int] | None = None
    wanted: Callable[[Image], Any] | None = None


class WorkerError(Exception):
    """What went wrong in a worker, and where."""


log = logging.getLogger("distributed.worker")

_device: list[Device] = []
_kept: dict[str, Renderer] = {}  # one Renderer at most, by what it was made for


class OneDevice(WorkerPlugin):
    """Chooses a worker's device, with as many threads as it is to have, and says to the scheduler that there is one.

    spec: as --device has it, None for the worker's environment or its fastest CPU driver; share: on how many workers of
    each host, by its address, the processors are shared out.
    """

    name = "cltrace"

    def __init__(self, spec: str | None, share: Mapping[str, int]) -> None:
        self.spec, self.share = spec, dict(share)

    async def setup(self, worker: Worker) -> None:
        """A worker without a device says so in its log, and gets no task."""
        host = worker.address.rpartition(":")[0]
        threads = max(1, processors() // self.share.get(host, 1))
        for name in THREADS:
            os.environ.setdefault(name, str(threads))
        try:
            _device[:] = [choose(self.spec)]
        except CltraceError as error:
            log.error("cltrace: no device here: %s", str(error).splitlines()[0])
            return
        await worker.set_resources(**{RESOURCE: 1})


def devices_here() -> tuple[str, str, bool]:
    """The host, and the device or an empty text, and whether it has doubles. For Client.run()."""
    device = _device[0] if _device else None
    return socket.gethostname(), device.name if device else "", bool(device and device.has_double)


def draw(key: str, base: Scene, camera: Camera, options: Mapping[str, Any], part: Part) -> Any:
    """What is wanted of the Image of a part of a scene, as the worker's device draws it.

    key: of the base, which names what may be kept; camera: that looks at it. TooManyRaysError and TooSlowError are
    returned, since what is raised is tried again.
    """
    scene, crop = base.seen_by(camera), part.crop
    name = f"{key} {sorted(options.items())!r}"
    kept = _kept.get(name)
    _kept.clear()  # before another one takes as much memory
    try:
        if kept is None:
            renderer = Renderer(scene, _device[0], crop=crop, **options)
        else:
            renderer = kept if crop == kept.request.crop else kept.cropped(crop)
            if scene.camera != renderer.scene.camera:
                renderer = renderer.following(renderer.scene.seen_by(scene.camera))
        image = (renderer.rows(*part.rows) if part.rows else renderer).render()
        found = part.wanted(image) if part.wanted else _whole(image)
    except (TooManyRaysError, TooSlowError) as error:
        return error
    except Exception as error:
        # What a driver raises may not be what another machine can read, and the machine's name helps.
        raise WorkerError(f"{error} (on {socket.gethostname()}, process {os.getpid()})") from None
    _kept[name] = renderer
    return found


def _whole(image: Image) -> Image:
    """The Image without the margin of the buffers that its outputs are in."""
    for name in image.outputs:
        setattr(image, name, np.ascontiguousarray(getattr(image, name)))
    return image
