"""--cluster: which one it is, and one picture in tiles on it."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import logging
import re
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.blocks import processors
from cltrace.cli.options import LIT, parser
from cltrace.cli.picture import options_of
from cltrace.cli.source import scene_of
from cltrace.cli.target import targets_of
from cltrace.errors import DeviceError, MissingPackageError, UsageError
from cltrace.picture.image import Image, Output

LOCAL = re.compile(r"local(?::([1-9][0-9]{0,3}))?")
# Of a local cluster. A profile of what its workers do would cost a hundredth of their time.
SETTINGS = {"distributed.scheduler.allowed-failures": 2, "distributed.worker.profile.enabled": False}
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
    with client_of(args.cluster) as ready:
        scene = scene_of(args, say)  # while workers start
        (target,) = targets_of(scene, args, (".png",))
        outputs: tuple[Output, ...] = ("rgb8",) if args.show == "color" else (args.show,)
        axes = scene.camera.basis() if args.space == "camera" else None

        def shown(image: Image) -> NDArray[np.uint8]:
            return np.asarray(image) if args.show == "color" else image.as_rgb8(args.show, axes)

        from cltrace.distributed import render

        how = {"tiles": args.tiles, "device": args.device, "progress": False if args.quiet else None}
        client = ready()
        try:
            render(scene, client, target, shown=shown, **how, **options_of(args, outputs))
        except ValueError as error:
            raise UsageError(str(error)) from None
        except OSError as error:
            raise UsageError(f"cannot write {target}: {error.strerror or error}") from None
    say(f"cltrace: wrote {target}, on the cluster {args.cluster}")
    return 0


@contextmanager
def client_of(spec: str) -> Iterator[Callable[[], Any]]:
    """What waits for a cluster that has begun to start, and returns a client of it.

    spec: the address of a scheduler, the file that it has written, or local:N for N processes here.

    Raises MissingPackageError without the extra `dask`, and DeviceError if there is no such scheduler, and when it is
    waited for if the workers do not start.
    """
    if importlib.util.find_spec("distributed") is None:
        raise MissingPackageError("--cluster", "distributed", "dask")
    dask: Any = importlib.import_module("dask")
    distributed: Any = importlib.import_module("distributed")
    with ExitStack() as stack:
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        if local := LOCAL.fullmatch(spec):
            count = int(local[1] or processors())
            stack.enter_context(dask.config.set(SETTINGS))
            cluster = distributed.LocalCluster(
                n_workers=0,
                threads_per_worker=1,
                memory_limit=1 / count,
                processes=True,
                dashboard_address=":0",
                silence_logs=logging.CRITICAL,
            )
            client = stack.enter_context(distributed.Client(stack.enter_context(cluster)))
            cluster.scale(count)

            def ready() -> Any:
                try:
                    client.wait_for_workers(count, timeout=START)
                except TimeoutError as error:
                    raise DeviceError(f"--cluster {spec}: its workers do not start: {error}") from None
                client.run(_leave_ctrl_c_to_the_client)
                return client

            yield ready
            return
        try:
            where = {"scheduler_file": spec} if Path(spec).is_file() else {"address": spec}
            client = stack.enter_context(distributed.Client(**where, timeout=10))
        except (OSError, ValueError, TypeError) as error:
            raise DeviceError(f"--cluster {spec}: there is no scheduler: {error}") from None
        yield lambda: client


def _leave_ctrl_c_to_the_client() -> None:
    """In a worker: a terminal sends it to all processes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
