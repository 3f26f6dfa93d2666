"""Hands out work to a dask cluster, and takes the results in again."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple
from uuid import uuid4

from distributed import Client

from cltrace.base.errors import CltraceError, DeviceError
from cltrace.base.waiting import Announcement
from cltrace.distributed.workers import RESOURCE, OneDevice, Part, WorkerError, devices_here, draw
from cltrace.plan.abi import Precision
from cltrace.scene import Scene, share_all_but_camera

# Seconds after which it is looked whether the scheduler is still there.
PATIENCE = 2.0
# Seconds for which it is remembered which workers there are.
SEEN = 0.5
# Seconds after which a cluster without a worker is given up.
ALONE = 60.0
# Seconds after which it is said that a worker is waited for.
SILENCE = 5.0
# How often a task is done again.
RETRIES = 2
# Tasks that a worker has beside the one that it does, so that it never waits for the client.
AHEAD = 1


class FarmError(DeviceError):
    """A cluster has no worker with a device, or has gone, or a task has failed on it again and again."""


class _LostError(Exception):
    """A task's scene was lost with a worker."""


class _NobodyError(Exception):
    """All workers have died."""


class Task(NamedTuple):
    """A picture, or a part of one: what it is called in messages, the scene, and the part."""

    label: str
    scene: Scene
    part: Part


@dataclass
class _Base:
    """A scene that tasks look at. key: its own; future: of it on all workers, once a second task needs it."""

    scene: Scene
    key: str = field(default_factory=lambda: uuid4().hex)
    future: Any = None


class Farm:
    """A cluster that draws. client: of the cluster; device: as --device has it, on each worker, None for what the
    worker's environment names, or its fastest CPU driver; options: the Renderer's, but for crop.

    Raises FarmError if no worker has a device.
    """

    def __init__(self, client: Client, device: str | None, options: Mapping[str, Any]) -> None:
        self._client: Any = client
        self._options = dict(options)
        self._pending: dict[str, Any] = {}  # futures, by their keys
        self._base: _Base | None = None
        self._seen, self._addresses = -math.inf, list[str]()
        with self._gone():
            with Announcement("waiting for a worker of the cluster ...", SILENCE, logging.WARNING):
                client.wait_for_workers(1, timeout=ALONE)
            hosts = Counter(address.rpartition(":")[0] for address in self._workers())
            client.register_plugin(OneDevice(device, hosts))
            found = client.run(devices_here)
        self.devices = {address: name for address, (_, name, _) in found.items() if name}
        if not self.devices:
            where = ", ".join(sorted({host for host, _, _ in found.values()}))
            raise FarmError(f"no worker has an OpenCL device ({where}); `cltrace --doctor` there says why")
        doubles = {double for _, name, double in found.values() if name}
        if self._options.get("precision") is None:
            # The same on all of them.
            self._options["precision"] = "accurate" if doubles == {True} else "single"
        self.lacking = sorted(address for address, (_, name, _) in found.items() if not name)

    @property
    def precision(self) -> Precision:
        """The one that all workers have."""
        precision: Precision = self._options["precision"]
        return precision

    def room(self) -> int:
        """How many tasks may be on their way."""
        return (1 + AHEAD) * max(1, len(self._workers()))

    def take(self, task: Task) -> Callable[[], Any]:
        """Has a task done. What it returns waits for what is wanted of it.

        Raises FarmError, as that does for a task that fails or whose workers die. What it returns raises
        TooManyRaysError and TooSlowError without another try.
        """
        with self._gone():
            return partial(self._result, task, self._handed_out(task))

    def close(self) -> None:
        """Cancels what is not done. More can be handed out later."""
        futures, self._pending, self._base = list(self._pending.values()), {}, None
        if futures:
            with contextlib.suppress(Exception):
                self._client.cancel(futures, force=True)

    def _workers(self) -> list[str]:
        """The addresses of the workers, as they were at most SEEN seconds ago."""
        if time.monotonic() > self._seen + SEEN:
            self._addresses = list(self._client.scheduler_info(n_workers=-1)["workers"])
            self._seen = time.monotonic()
        return self._addresses

    def _handed_out(self, task: Task) -> Any:
        """A future of what is wanted of a task. A scene is sent to workers once, however many cameras look at it."""
        if self._base is None or not share_all_but_camera(self._base.scene, task.scene):
            self._base = _Base(task.scene)
            data: Any = task.scene  # goes with the task, and is not lost with a worker
        else:
            if self._base.future is None:
                self._base.future = self._client.scatter(self._base.scene, broadcast=True, hash=False)
            data = self._base.future
        how = {"pure": False, "retries": RETRIES, "resources": {RESOURCE: 1}}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # dask advises against what is done here on purpose
            what = self._base.key, data, task.scene.camera, self._options, task.part
            future = self._client.submit(draw, *what, **how)
        self._pending[future.key] = future
        return future

    def _result(self, task: Task, future: Any) -> Any:
        """What is wanted of a task that was handed out, when it is done."""
        from distributed.scheduler import KilledWorker

        for _ in range(1 + RETRIES):
            try:
                result = self._waited_for(future)
            except (KilledWorker, _NobodyError):
                break
            except WorkerError as error:
                raise FarmError(f"{task.label}: {error}") from None
            except _LostError:  # with the worker that had the scene
                self._base = None
                with self._gone():
                    future = self._handed_out(task)
            else:
                if isinstance(result, CltraceError):
                    raise result
                return result
        words = self._last_words()
        last = f"; the last words there: {words}" if words else ""
        raise FarmError(f"{task.label}: workers have died over it again and again{last}")

    def _waited_for(self, future: Any) -> Any:
        from concurrent.futures import CancelledError

        done, begun = threading.Event(), time.monotonic()
        future.add_done_callback(lambda _: done.set())
        with self._gone():
            while not done.wait(PATIENCE):
                self._check_scheduler()
                if self._workers():
                    begun = time.monotonic()
                elif time.monotonic() > begun + ALONE:
                    raise _NobodyError
                if self._is_left_alone(future.key):
                    self._client.cancel([future], force=True)
                    raise _LostError
            self._pending.pop(future.key, None)
            try:
                result = future.result()
            except CancelledError:
                self._check_scheduler()
                raise _LostError from None
            future.release()
            return result

    def _is_left_alone(self, key: str) -> bool:
        """Whether a task found no worker, and will find none.

        Where all workers have died, a scheduler looks once more when a new one arrives; but that has no device then, as
        it takes a moment until OneDevice says so.
        """
        state = self._client.run_on_scheduler(
            lambda dask_scheduler: getattr(dask_scheduler.tasks.get(key), "state", "")
        )
        workers = self._client.scheduler_info(n_workers=-1)["workers"].values()
        return state == "no-worker" and any(worker["resources"].get(RESOURCE) for worker in workers)

    def _check_scheduler(self) -> None:
        """Raises OSError if the scheduler has gone."""
        if self._client.status != "running":
            raise OSError("its scheduler does not answer")

    def _last_words(self) -> str:
        """What the nannies say of workers that have died."""
        with contextlib.suppress(Exception):
            logs = self._client.get_worker_logs(n=20, nanny=True)
            lines = [message for log in logs.values() for _, message in log]
            dead = [line for line in lines if "died" in line or "killed" in line or "exit" in line.lower()]
            return str(dead[-1]) if dead else ""
        return ""

    @contextlib.contextmanager
    def _gone(self) -> Iterator[None]:
        """Makes FarmErrors of what happens when the scheduler has gone."""
        from concurrent.futures import CancelledError

        from distributed.comm.core import CommClosedError

        try:
            yield
        except (CancelledError, CommClosedError, OSError, TimeoutError) as error:
            raise FarmError(f"the cluster has gone, or has no workers: {error or type(error).__name__}") from None
