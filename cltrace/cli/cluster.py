"""--cluster: which one it is, and one picture in tiles on it."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import logging
import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cltrace.blocks import processors
from cltrace.cli.options import LIT, parser
from cltrace.cli.picture import options_of
from cltrace.cli.source import scene_of
from cltrace.cli.target import targets_of
from cltrace.errors import DeviceError, MissingPackageError, UsageError
from cltrace.forks import METHOD, prepare
from cltrace.picture.image import Image, Output
from cltrace.start import imported

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
START = 60  # seconds in which the workers of a local cluster are there
NOT_HERE = ("check", "stats", "repeat", "bits", "outputs", "watch")


def draw_tiles(args: argparse.Namespace, say: Callable[[str], None]) -> int:
    """Draws one picture on a cluster, in tiles. Returns 0."""
    for name in NOT_HERE:
        if getattr(args, name) != parser().get_default(name):
            raise UsageError(f"--{name} does not go with --cluster")
    if args.show in (LIT, "depth"):  # the greys of depths depend on the whole picture
        raise UsageError(f"--show {args.show} does not go with --cluster")
    if args.output and (len(args.output) > 1 or "-" in args.output):
        raise UsageError("--cluster takes one -o, of a file")
    scene = scene_of(args, say)
    (target,) = targets_of(scene, args, (".png",))
    outputs: tuple[Output, ...] = ("rgb8",) if args.show == "color" else (args.show,)
    axes = scene.camera.basis() if args.space == "camera" else None
    shown = np.asarray if args.show == "color" else partial(Image.as_rgb8, show=args.show, axes=axes)
    how = {"tiles": args.tiles, "device": args.device, "progress": False if args.quiet else None}
    with client_of(args.cluster) as client:
        from cltrace.distributed import render

        try:
            render(scene, client, target, shown=shown, **how, **options_of(args, outputs))
        except ValueError as error:
            raise UsageError(str(error)) from None
        except OSError as error:
            raise UsageError(f"cannot write {target}: {error.strerror or error}") from None
    say(f"cltrace: wrote {target}, on the cluster {args.cluster}")
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
        prepare()
    distributed = imported("distributed")
    # Else it imports pandas here, where that is installed, for a process that has begun already.
    distributed.utils._forkserver_preload_set = True
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
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
    how = {"threads_per_worker": 1, "memory_limit": 1 / count, "processes": True, "silence_logs": logging.CRITICAL}
    # Without a dashboard it serves HTTP all the same, to all hosts and at a port that another cluster may have.
    private = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
    with (
        dask.config.set(SETTINGS),
        distributed.LocalCluster(n_workers=0, scheduler_kwargs=private, **how) as cluster,
        distributed.Client(cluster, direct_to_workers=True) as client,
    ):
        cluster.scale(count)
        patience = time.monotonic() + START
        while len(cluster.scheduler.workers) < count:
            if time.monotonic() > patience:
                raise DeviceError(f"--cluster local:{count}: its workers do not start in {START} s")
            time.sleep(0.01)
        client.run(signal.signal, signal.SIGINT, signal.SIG_IGN)  # which a terminal sends to all processes
        yield client
