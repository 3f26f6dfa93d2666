"""One picture in tiles, or the frames of a movie, on the workers of a dask cluster: the same bytes as in one process.

It needs the extra `dask`.
"""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sized
from concurrent.futures import CancelledError
from contextlib import closing
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from distributed import Client, KilledWorker
from distributed.comm.core import CommClosedError

from cltrace.base.errors import CltraceError, DeviceError, TooManyRaysError, TooSlowError
from cltrace.base.progress import bar
from cltrace.base.waiting import Announcement
from cltrace.movie.animate import FPS, Each, FrameRenderer, files_of, in_order
from cltrace.movie.frames import MovieFrame, frames_of
from cltrace.picture.image import Image
from cltrace.picture.png import BAND
from cltrace.plan.request import Crop, Request
from cltrace.renderers.renderer import Renderer
from cltrace.run.devices import Device, choose
from cltrace.scene import AnyCamera, Scene, share_all_but_camera

__all__ = ["FarmError", "animate", "render"]

# Tiles for each worker, so that none waits long for the last one; and pending tasks, so that none waits for the client.
TILES, TASKS_PER_WORKER = 8, 2
# How often a task that fails is done again.
RETRIES = 2
# Seconds for which it is remembered which workers there are, after which a cluster without a worker is given up, and
# after which it is said that a worker is waited for.
SEEN, ALONE, SILENCE = 0.5, 60.0, 5.0
# How PoCL of several ages, and Intel's driver, are told how many threads they may have.
THREADS = ("POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT", "DPCPP_CPU_NUM_CUS")


class FarmError(DeviceError):
    """A cluster has no worker with a device, or has gone, or a task has failed on it again and again."""


def render(
    scene: Scene,
    client: Client,
    *,
    tiles: int | None = None,
    device: str | None = None,
    progress: bool | None = None,
    **options: Any,
) -> Image:
    """Draw one picture on the workers of a dask cluster, in tiles.

    Parameters
    ----------
    scene : Scene
    client : distributed.Client
    tiles : int, optional
        How many tiles there are; by default 8 for each worker. A tile is rows of the whole width.
    device : str, optional
        On each worker, as for `--device`; by default what its PYOPENCL_CTX says, or its fastest CPU driver.
    progress : bool, optional
        Whether tqdm shows a progress bar; by default on terminals and in notebooks.
    **options
        Of Renderer.

    Returns
    -------
    Image
        With the bytes of `cltrace.render`, in accurate and double on any mixture of drivers.

    Raises
    ------
    FarmError
        If the cluster has no device, a tile fails three times, or the scheduler goes.
    """
    parts = list(tiles_of(scene, client, tiles, device, progress, **options))
    whole: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in parts[0].outputs}
    return Image(**whole, seconds=parts[0].seconds, transfer=scene.transfer)


def tiles_of(
    scene: Scene,
    client: Client,
    tiles: int | None = None,
    device: str | None = None,
    progress: bool | None = None,
    **options: Any,
) -> Generator[Image, None, None]:
    """The tiles of render(), from the top. Few are in memory at a time, so the picture may be larger than that."""
    if tiles is not None and (isinstance(tiles, bool) or not isinstance(tiles, int) or tiles < 1):
        raise ValueError(f"tiles: must be a whole number >= 1, got {tiles!r}")
    x, y, width, height = Request(crop=options.get("crop")).region_of(scene.camera.resolution)
    farm = Farm(client, device, {"outputs": ("rgb8",), **options})
    count = tiles or TILES * farm.count()
    # Tiles begin at multiples of a PNG's band, which is as good for the kernel, whose packets have a part of its rows.
    edges = sorted({y + height * k // count // BAND * BAND for k in range(count)} | {y + height})
    parts = [MovieFrame(k, scene, (x, a, x + width, b)) for k, (a, b) in enumerate(pairwise(edges))]
    with closing(farm.images(parts)) as drawn, bar(len(parts), "tile", progress) as done:
        for _, image in drawn:
            yield image
            done.update()


def animate(
    frames: Iterable[Any],
    client: Client,
    output: str | os.PathLike[str],
    *,
    scene: Scene | None = None,
    device: str | None = None,
    each: Each | None = None,
    progress: bool | None = None,
    **options: Any,
) -> list[str]:
    """Draw the frames of a movie on the workers of a dask cluster, and write them here, in order.

    client and device are those of render(). The other arguments, fps and skip_existing among them, what is returned,
    and the files are those of `cltrace.animate`; each is called here. A scene is sent to the workers once, however many
    cameras look at it. Raises what render() raises; frames that are written by then are whole, and skip_existing
    continues.
    """
    files = files_of(output, options.pop("fps", FPS), options.pop("skip_existing", False), each)
    total = len(frames) if isinstance(frames, Sized) else None
    return files.write(frames_of(frames, scene), on_cluster(client, device, options), progress=progress, total=total)


def on_cluster(client: Client, device: str | None, options: Mapping[str, Any]) -> FrameRenderer:
    """Draws frames on a cluster. Raises FarmError if no worker has a device."""
    farm = Farm(client, device, options)
    place = f"{farm.count()} workers with {', '.join(farm.devices)}"
    return FrameRenderer(farm.images, {**options, **farm.options}, " ".join(farm.devices), place)


class Farm:
    """A cluster that draws. client: of the cluster; device: as --device has it; options: the Renderer's.

    options: without the crop, and with the precision that all workers have; devices: the names of the workers' devices.
    Raises FarmError if no worker has a device.
    """

    def __init__(self, client: Client, device: str | None, options: Mapping[str, Any]) -> None:
        self._client: Any = client
        self._spec, self.options = device, dict(options)
        self._crop = self.options.pop("crop", None)
        self._found: dict[str, tuple[str, bool]] = {}  # what device_here() has said, by the worker's address
        self._seen, self._usable = -SEEN, list[str]()
        self._base: tuple[Scene, Any] | None = None  # the last scene, and the task that makes it
        with _cluster_errors():
            with Announcement("waiting for a worker of the cluster ...", SILENCE, logging.WARNING):
                client.wait_for_workers(1, timeout=ALONE)
            usable = [self._found[address] for address in self._workers()]
        if not usable:
            where = ", ".join(sorted(self._found))
            raise FarmError(f"no worker has an OpenCL device ({where}); `cltrace --doctor` there says why")
        self.devices = sorted({name for name, _ in usable})
        if self.options.get("precision") is None:  # the same on all of them
            self.options["precision"] = "accurate" if all(double for _, double in usable) else "single"

    def count(self) -> int:
        """How many workers have a device now."""
        with _cluster_errors():
            return len(self._workers())

    def images(self, frames: Iterable[MovieFrame]) -> Generator[tuple[MovieFrame, Image], None, None]:
        """Yields each frame with its image, in order, and cancels what is not done when it is closed.

        Raises FarmError for a frame that fails again and again or whose workers die, and TooManyRaysError and
        TooSlowError without another try.
        """
        futures = deque[Any]()

        def begin(frame: MovieFrame) -> Callable[[], Image]:
            futures.append(future := self._submit(frame))
            return partial(self._result, frame, future)

        try:
            for frame, image in in_order(frames, begin, lambda: TASKS_PER_WORKER * self.count()):
                futures.popleft()
                yield frame, image
        finally:
            self._base = None
            with contextlib.suppress(Exception):
                self._client.cancel(list(futures), force=True)

    def _submit(self, frame: MovieFrame) -> Any:
        """A future of the frame's image. A scene is sent once, however many cameras and crops look at it."""
        with _cluster_errors(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # dask advises against sending large scenes
            if self._base is None or not share_all_but_camera(self._base[0], frame.scene):
                self._base = frame.scene, self._client.submit(itself, frame.scene, pure=False)
            base = self._base[1]
            # Workers without a device do not draw. Where those with one have died, dask takes what comes instead.
            where = {"workers": self._workers(), "allow_other_workers": True}
            what = (self._spec, base.key, base, frame.scene.camera, self.options, frame.crop or self._crop)
            return self._client.submit(draw, *what, pure=False, retries=RETRIES, **where)

    def _result(self, frame: MovieFrame, future: Any) -> Image:
        """Waits for the image of a frame that was handed out."""
        result: Any = None
        label = f"rows {frame.crop[1]} to {frame.crop[3] - 1}" if frame.crop else f"frame {frame.number}"
        died = FarmError(f"{label}: workers have died over it again and again")
        while result is None:
            try:
                with _cluster_errors(), contextlib.suppress(TimeoutError):
                    result = future.result(timeout=ALONE)
            except WorkerError as error:
                raise FarmError(f"{label}: {error}") from None
            except KilledWorker:
                raise died from None
            if result is None and not self.count():
                raise died
        if isinstance(result, CltraceError):
            raise result
        image: Image = result
        return image

    def _workers(self) -> list[str]:
        """The addresses of the workers with a device, as they were at most SEEN seconds ago."""
        if time.monotonic() > self._seen + SEEN:
            there = self._client.scheduler_info(n_workers=-1)["workers"]
            if new := [address for address in there if address not in self._found]:
                self._found |= self._client.run(device_here, self._spec, workers=new, on_error="ignore")
            self._usable = [address for address in there if self._found.get(address, ("", False))[0]]
            self._seen = time.monotonic()
        return self._usable


@contextlib.contextmanager
def _cluster_errors() -> Iterator[None]:
    """Makes FarmErrors of what happens when the scheduler has gone."""
    try:
        yield
    except (CancelledError, CommClosedError, OSError, TimeoutError) as error:
        raise FarmError(f"the cluster has gone, or has no workers: {error or type(error).__name__}") from None


# In a worker: its device, what it keeps for the next task, and a lock, as it draws one picture at a time.
_device: list[Device] = []
_kept: dict[str, Renderer] = {}
_lock = threading.Lock()


class WorkerError(Exception):
    """What went wrong in a worker, and where."""


def device_here(spec: str | None, dask_worker: Any) -> tuple[str, bool]:
    """In a worker: the name of the device, or an empty text, and whether it has doubles.

    spec: as --device has it, None for the worker's environment or its fastest CPU driver. A CPU's driver has as many
    threads as dask gives the worker.
    """
    for name in THREADS:
        os.environ.setdefault(name, str(dask_worker.state.nthreads))
    try:
        _device[:] = _device or [choose(spec)]
    except CltraceError as error:
        logging.getLogger("distributed.worker").error("cltrace: no device here: %s", str(error).splitlines()[0])
        return "", False
    return _device[0].name, _device[0].has_double


def itself(scene: Scene) -> Scene:
    """In a worker: makes a scene the result of a task, which dask sends to others, and makes again if it is lost."""
    return scene


def draw(
    spec: str | None, key: str, base: Scene, camera: AnyCamera, options: Mapping[str, Any], crop: Crop | None
) -> Any:
    """In a worker: the Image of a crop of a scene.

    spec: of the device, for a worker that has begun meanwhile; key: of the base, which tells whether the last renderer
    was made of it; camera: that looks at it. TooManyRaysError and TooSlowError are returned, since dask does again what
    raises an error.
    """
    name = f"{key} {sorted(options.items())!r}"
    try:
        with _lock:
            renderer = _kept.pop(name, None)
            _kept.clear()  # before another one takes as much memory
            if renderer is None:
                _device[:] = _device or [choose(spec)]
                renderer = Renderer(base.seen_by(camera), _device[0], crop=crop, **options)
            if crop != renderer.request.crop:
                renderer = renderer.cropped(crop)
            if camera != renderer.scene.camera:
                renderer = renderer.following(renderer.scene.seen_by(camera))
            image = renderer.render()
            _kept[name] = renderer
    except (TooManyRaysError, TooSlowError) as error:
        return error
    except Exception as error:
        # What a driver raises may not be what another machine can read, and the machine's name helps.
        raise WorkerError(f"{error} (on {socket.gethostname()}, process {os.getpid()})") from None
    for output in image.outputs:  # without the margin of the buffers that the outputs are in
        setattr(image, output, np.ascontiguousarray(getattr(image, output)))
    return image
