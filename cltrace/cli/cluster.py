"""--cluster: which one it is, and one picture in tiles on it."""

from __future__ import annotations

import importlib
import importlib.util
import logging
import re
import signal
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from cltrace.base.arrays import processors
from cltrace.base.errors import DeviceError, MissingPackageError
from cltrace.base.waiting import Announcement
from cltrace.cli.files import Reporter, scene_of, targets_of, write_rows
from cltrace.cli.options import Options, refusing
from cltrace.plan.request import Request
from cltrace.process.entry import METHOD, imported, start_forkserver

LOCAL = re.compile(r"local(?::([1-9][0-9]{0,3}))?")
# Of a local cluster. What dask watches by default, up to fifty times a second, takes a tenth of a processor.
SETTINGS = {
    "distributed.scheduler.allowed-failures": 2,
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "2s",
    "distributed.worker.multiprocessing-method": METHOD,
    "distributed.admin.tick.interval": "10s",
    "distributed.admin.system-monitor.interval": "10s",
}
DEAD = ("failed", "closing", "closed")  # what has become of a worker that does not start
START = 60  # seconds in which the workers of a local cluster are there
SILENCE = 5.0  # seconds after which it is said that they are waited for
# Loggers that would print what a command says in a line of its own, with tracebacks; each has a level of its own.
TALKING = ("distributed", "distributed.client", "distributed.gc", "tornado.application", "asyncio")
# What the processes of a local cluster import before they begin.
WORKERS = "cltrace.distributed"


def draw_tiles(options: Options, cluster: str, reporter: Reporter) -> int:
    """Draws one picture on a cluster, in tiles. Returns 0."""
    scene = scene_of(options.scenes[0], options, reporter)
    (target,) = targets_of(scene, options, (".png",))
    how = options.renderer_options(options.shown)
    how |= {"tiles": options.tiles, "device": options.device, "progress": reporter.progress}
    with refusing():
        height = Request(crop=options.crop).region_of(scene.camera.resolution)[3]
        with client_of(cluster) as client:
            from cltrace.distributed import tiles_of

            with closing(tiles_of(scene, client, **how)) as tiles:
                write_rows(tiles, height, {target: {"show": options.show, "axes": options.axes(scene.camera)}})
    reporter.say(f"cltrace: wrote {target}, on the cluster {cluster}")
    return 0


@contextmanager
def client_of(spec: str) -> Iterator[Any]:
    """A client of a cluster, whose workers are there.

    spec: the address of a scheduler, the file that it has written, or local:N for N processes here.

    Raises MissingPackageError without the extra `dask`, and DeviceError if there is no such scheduler, or the workers
    do not start.
    """
    if importlib.util.find_spec("distributed") is None:
        raise MissingPackageError("--cluster", "distributed", "dask")
    local = LOCAL.fullmatch(spec)
    if local:
        start_forkserver(WORKERS)
    distributed = imported("distributed")
    # Else it imports pandas here, where that is installed, for a process that has begun already.
    distributed.utils._forkserver_preload_set = True
    for name in TALKING:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if local:
        with _local_client(distributed, int(local[1] or processors())) as client:
            yield client
        return
    try:
        where = {"scheduler_file": spec} if Path(spec).is_file() else {"address": spec}
        client = distributed.Client(**where, timeout=10)
    except (OSError, ValueError, TypeError) as error:
        raise DeviceError(f"--cluster {spec}: there is no scheduler: {error}") from None
    with client:
        yield client


@contextmanager
def _local_client(distributed: Any, count: int) -> Iterator[Any]:
    """A client of so many processes here, which end with it. Raises DeviceError if they do not start."""
    dask: Any = importlib.import_module("dask")
    how = {"threads_per_worker": max(1, processors() // count), "memory_limit": 1 / count, "processes": True}
    how["silence_logs"] = logging.CRITICAL
    # Without a dashboard it serves HTTP all the same, to all hosts and at a port that another cluster may have.
    private = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
    with (
        dask.config.set(SETTINGS),
        distributed.LocalCluster(n_workers=0, scheduler_kwargs=private, **how) as cluster,
        distributed.Client(cluster, direct_to_workers=True) as client,
    ):
        cluster.scale(count)
        patience = time.monotonic() + START
        with Announcement(f"--cluster local:{count}: waiting for its workers ...", SILENCE, logging.WARNING):
            while len(cluster.scheduler.workers) < count:
                if any(nanny.status.name in DEAD for nanny in cluster.workers.values()):
                    raise DeviceError(f"--cluster local:{count}: a worker has died while it started")
                if time.monotonic() > patience:
                    raise DeviceError(f"--cluster local:{count}: its workers do not start in {START} s")
                time.sleep(0.01)
        client.run(signal.signal, signal.SIGINT, signal.SIG_IGN)  # which a terminal sends to all processes
        yield client
