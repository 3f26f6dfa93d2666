"""A dask cluster that draws: what its workers do, and how tasks are handed out to them and taken in again, in order."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import threading
import time
import warnings
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import CancelledError
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from distributed import Client, KilledWorker
from distributed.comm.core import CommClosedError

from cltrace.base.arrays import processors
from cltrace.base.errors import CltraceError, DeviceError, TooManyRaysError, TooSlowError
from cltrace.base.waiting import Announcement
from cltrace.movie.animate import in_order
from cltrace.movie.frames import MovieFrame
from cltrace.picture.image import Image
from cltrace.plan.request import Crop
from cltrace.renderers.renderer import Renderer
from cltrace.run.devices import Device, choose
from cltrace.scene import AnyCamera, Scene, share_all_but_camera

# How PoCL of several ages, and Intel's driver, are told how many threads they may have.
THREADS = ("POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT", "DPCPP_CPU_NUM_CUS")
# Seconds after which it is looked whether the scheduler is still there, for which it is remembered which workers there
# are, after which a cluster without a worker is given up, and after which it is said that a worker is waited for.
PATIENCE, SEEN, ALONE, SILENCE = 2.0, 0.5, 60.0, 5.0
# How often a task that fails is done again.
RETRIES = 2
# Pending tasks for each worker, so that none waits for the client.
TASKS_PER_WORKER = 2


class FarmError(DeviceError):
    """A cluster has no worker with a device, or has gone, or a task has failed on it again and again."""


class WorkerError(Exception):
    """What went wrong in a worker, and where."""


# In a worker: its device, what it keeps for the next task, and a lock, as it draws one picture at a time.
_device: list[Device] = []
_kept: dict[str, Renderer] = {}
_lock = threading.Lock()


def device_here(spec: str | None, workers: Mapping[str, int]) -> tuple[str, str, bool]:
    """In a worker: the host, the name of the device, or an empty text, and whether it has doubles.

    spec: as --device has it, None for the worker's environment or its fastest CPU driver; workers: on how many workers
    of each host its processors are shared out.
    """
    host = socket.gethostname()
    for name in THREADS:
        os.environ.setdefault(name, str(max(1, processors() // workers.get(host, 1))))
    try:
        _device[:] = _device or [choose(spec)]
    except CltraceError as error:
        logging.getLogger("distributed.worker").error("cltrace: no device here: %s", str(error).splitlines()[0])
        return host, "", False
    return host, _device[0].name, _device[0].has_double


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
            renderer = _kept.get(name)
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


class Task(NamedTuple):
    """A picture, or a part of one: what it is called in messages, the scene, and the part; frame: which one it is."""

    label: str
    scene: Scene
    crop: Crop | None
    frame: MovieFrame | None = None


class Farm:
    """A cluster that draws. client: of the cluster; device: as --device has it; options: the Renderer's, but for crop.

    options: with the precision that all workers have; devices: the names of the workers' devices. Raises FarmError if
    no worker has a device.
    """

    def __init__(self, client: Client, device: str | None, options: Mapping[str, Any]) -> None:
        self._client: Any = client
        self._spec, self.options = device, dict(options)
        self._found: dict[str, tuple[str, str, bool]] = {}  # what device_here() has said, by the worker's address
        self._seen, self._usable = -SEEN, list[str]()
        self._base: tuple[Scene, Any] | None = None  # the last scene, and the task that makes it
        with self._gone():
            with Announcement("waiting for a worker of the cluster ...", SILENCE, logging.WARNING):
                client.wait_for_workers(1, timeout=ALONE)
            usable = [self._found[address] for address in self._workers()]
        if not usable:
            where = ", ".join(sorted({host for host, _, _ in self._found.values()}))
            raise FarmError(f"no worker has an OpenCL device ({where}); `cltrace --doctor` there says why")
        self.devices = sorted({name for _, name, _ in usable})
        if self.options.get("precision") is None:  # the same on all of them
            self.options["precision"] = "accurate" if all(double for _, _, double in usable) else "single"

    def count(self) -> int:
        """How many workers have a device now."""
        return len(self._workers())

    def images(self, tasks: Iterable[Task]) -> Generator[tuple[Task, Image], None, None]:
        """Yields each task with its image, in order, and cancels what is not done when it is closed.

        Raises FarmError for a task that fails again and again or whose workers die, and TooManyRaysError and
        TooSlowError without another try.
        """
        futures = deque[Any]()

        def begin(task: Task) -> Callable[[], Image]:
            futures.append(future := self._submit(task))
            return partial(self._result, task, future)

        try:
            for task, image in in_order(tasks, begin, lambda: TASKS_PER_WORKER * self.count()):
                futures.popleft()
                yield task, image
        finally:
            self._base = None
            with contextlib.suppress(Exception):
                self._client.cancel(list(futures), force=True)

    def _submit(self, task: Task) -> Any:
        """A future of the task's image. A scene is sent once, however many cameras and crops look at it."""
        with self._gone(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # dask advises against sending large scenes
            if self._base is None or not share_all_but_camera(self._base[0], task.scene):
                self._base = task.scene, self._client.submit(itself, task.scene, pure=False)
            base = self._base[1]
            # Workers without a device do not draw. Where those with one have died, dask takes what comes instead.
            where = {"workers": self._workers(), "allow_other_workers": True}
            what = (self._spec, base.key, base, task.scene.camera, self.options, task.crop)
            return self._client.submit(draw, *what, pure=False, retries=RETRIES, **where)

    def _result(self, task: Task, future: Any) -> Image:
        """Waits for the image of a task that was handed out."""
        alone = time.monotonic()  # since when there is no worker
        while True:
            try:
                with self._gone():
                    with contextlib.suppress(TimeoutError):
                        result = future.result(timeout=PATIENCE)
                        break
                    if self._client.status != "running":
                        raise OSError("its scheduler does not answer")
                    alone = time.monotonic() if self._workers() else alone
            except WorkerError as error:
                raise FarmError(f"{task.label}: {error}") from None
            except KilledWorker:
                raise self._died(task) from None
            if time.monotonic() > alone + ALONE:
                raise self._died(task)
        if isinstance(result, CltraceError):
            raise result
        image: Image = result
        return image

    def _died(self, task: Task) -> FarmError:
        """With what the nannies say of workers that have died."""
        words = ""
        with contextlib.suppress(Exception):
            logs = self._client.get_worker_logs(n=20, nanny=True)
            lines = [message for log in logs.values() for _, message in log]
            dead = [line for line in lines if "died" in line or "killed" in line or "exit" in line.lower()]
            words = f"; the last words there: {dead[-1]}" if dead else ""
        return FarmError(f"{task.label}: workers have died over it again and again{words}")

    def _workers(self) -> list[str]:
        """The addresses of the workers with a device, as they were at most SEEN seconds ago."""
        if time.monotonic() > self._seen + SEEN:
            there = self._client.scheduler_info(n_workers=-1)["workers"]
            if new := [address for address in there if address not in self._found]:
                hosts = Counter(self._client.run(socket.gethostname, workers=list(there), on_error="ignore").values())
                self._found |= self._client.run(device_here, self._spec, hosts, workers=new, on_error="ignore")
            self._usable = [address for address in there if self._found.get(address, ("", "", False))[1]]
            self._seen = time.monotonic()
        return self._usable

    @contextlib.contextmanager
    def _gone(self) -> Iterator[None]:
        """Makes FarmErrors of what happens when the scheduler has gone."""
        try:
            yield
        except (CancelledError, CommClosedError, OSError, TimeoutError) as error:
            raise FarmError(f"the cluster has gone, or has no workers: {error or type(error).__name__}") from None
