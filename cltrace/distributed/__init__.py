"""One picture in tiles, or the frames of a movie, on the workers of a dask cluster: the same bytes as in one process.

It needs the extra `dask`. farm is what hands out work and what runs in the workers.
"""

from __future__ import annotations

import os
from collections.abc import Generator, Iterable, Mapping, Sized
from contextlib import closing
from itertools import pairwise
from typing import Any

import numpy as np
from distributed import Client

from cltrace.base.progress import bar
from cltrace.distributed.farm import Farm, FarmError, Task
from cltrace.movie.animate import FPS, Each, FrameRenderer, files_of
from cltrace.movie.frames import MovieFrame, frames_of
from cltrace.picture.image import Image
from cltrace.picture.png import BAND
from cltrace.plan.request import Request
from cltrace.scene import Scene

__all__ = ["FarmError", "animate", "render"]

# Tiles for each worker, so that none waits long for the last one.
TILES = 8


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
    x, y, width, height = Request(crop=options.pop("crop", None)).region_of(scene.camera.resolution)
    farm = Farm(client, device, {"outputs": ("rgb8",), **options})
    count = tiles or TILES * farm.count()
    # Tiles begin at multiples of a PNG's band, which is as good for the kernel, whose packets have a part of its rows.
    edges = sorted({y + height * k // count // BAND * BAND for k in range(count)} | {y + height})
    tasks = [Task(f"rows {a} to {b - 1}", scene, (x, a, x + width, b)) for a, b in pairwise(edges)]
    with closing(farm.images(tasks)) as drawn, bar(len(tasks), "tile", progress) as done:
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
    crop = options.get("crop")
    farm = Farm(client, device, {name: value for name, value in options.items() if name != "crop"})

    def images(frames: Iterable[MovieFrame]) -> Generator[tuple[MovieFrame, Image], None, None]:
        tasks = (Task(f"frame {frame.number}", frame.scene, crop, frame) for frame in frames)
        with closing(farm.images(tasks)) as drawn:
            for task, image in drawn:
                assert task.frame
                yield task.frame, image

    place = f"{farm.count()} workers with {', '.join(farm.devices)}"
    return FrameRenderer(images, {**options, **farm.options}, " ".join(farm.devices), place)
