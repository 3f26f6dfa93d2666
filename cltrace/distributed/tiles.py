"""One picture, drawn by the workers of a cluster in tiles."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import closing
from copy import copy
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from distributed import Client
from numpy.typing import NDArray

from cltrace.base.progress import bar
from cltrace.distributed.render_farm import Farm, Task
from cltrace.distributed.workers import Part
from cltrace.movie.pipeline import in_order
from cltrace.picture.files import Inputs, whole_file
from cltrace.picture.image import Image
from cltrace.picture.png import BAND, Packed, Rows, packed
from cltrace.plan.request import Region, Request
from cltrace.scene import Scene

T = TypeVar("T")
Pixels = NDArray[np.uint8]
# Tiles for each worker, so that none waits long for the last one.
TILES = 8
# Pixels of a picture whose lists a worker has room for.
ONCE = 2**27


def render(
    scene: Scene,
    client: Client,
    output: str | os.PathLike[str] | None = None,
    *,
    tiles: int | None = None,
    device: str | None = None,
    progress: bool | None = None,
    shown: Callable[[Image], Pixels] = np.asarray,
    **options: Any,
) -> Image | str:
    """One picture, drawn by the workers of a dask cluster in tiles, which are rows of the whole width.

    client: a distributed.Client; output: a PNG, which is assembled on disk, so that it may be larger than the memory
    here; None for an Image. tiles: how many there are, None for 8 for each worker; device: as --device has it, on each
    worker, None for what its PYOPENCL_CTX says, or its fastest CPU driver; shown: what of an Image the PNG shows, which
    workers are sent. The other arguments are those of Renderer. Returns the Image, or the name of the file.

    The bytes are those of cltrace.render(), in accurate and double on any mixture of drivers. Raises FarmError if the
    cluster has no device, a tile fails three times, or the scheduler goes, and else what Renderer raises. A file is
    there as a whole or not at all.
    """
    options.setdefault("outputs", ("rgb8",))
    region = Request(crop=options.pop("crop", None)).region_of(scene.camera.resolution)
    if tiles is not None and (isinstance(tiles, bool) or not isinstance(tiles, int) or tiles < 1):
        raise ValueError(f"tiles: must be a whole number >= 1, got {tiles!r}")
    if output is not None and Path(output).suffix.lower() != ".png":
        raise ValueError(f"output: must end in .png, got {os.fspath(output)!r}")
    if output is not None and scene.source is not None:
        Inputs(scene.source.files).check(os.fspath(output), "output")
    farm, wanted = Farm(client, device, options), None if output is None else partial(_packed, shown)
    tasks = list(_tiles(scene, region, tiles or TILES * len(farm.devices), wanted))
    with closing(in_order(tasks, farm)) as drawn, bar(len(tasks), "tile", progress) as shown_bar:
        parts = (_counted(part, shown_bar) for _, part in drawn)
        if output is None:
            return _joined(parts, region[2:])
        with whole_file(Path(output)) as file:
            _write(parts, file, region[3])
    return os.fspath(output)


def _tiles(scene: Scene, region: Region, count: int, wanted: Callable[[Image], Any] | None = None) -> Iterator[Task]:
    """Rows of a region, about as many in each tile, from the top.

    They begin with a band of the PNG, which is as good for the kernel, whose packets have a part of a band's rows. A
    worker packs all of a picture once, unless it is a very large one, whose tiles are packed one by one.
    """
    x, y, width, height = region
    once = width * height <= ONCE
    edges = [y + height * k // count // BAND * BAND for k in range(count)] + [y + height]
    for first, end in pairwise(edges):
        label, whole, tile = f"rows {first} to {end - 1}", (x, y, x + width, y + height), (x, first, x + width, end)
        if first < end:
            yield Task(label, scene, Part(whole, (first, end), wanted) if once else Part(tile, wanted=wanted))


def _counted(part: T, shown: Any) -> T:
    shown.update()
    return part


def _packed(shown: Callable[[Image], Pixels], image: Image) -> Packed:
    """In a worker: what of the PNG is in a tile. A tenth of the bytes, so there is less to send."""
    return packed(shown(image))


def _joined(images: Iterator[Image], size: tuple[int, int]) -> Image:
    """The whole Image, of (width, height) pixels."""
    whole, row = None, 0
    for image in images:
        if whole is None:
            whole = copy(image)
            for name in image.outputs:
                part = getattr(image, name)
                setattr(whole, name, np.empty((size[1], *part.shape[1:]), part.dtype))
        for name in image.outputs:
            part = getattr(image, name)
            getattr(whole, name)[row : row + len(part)] = part
        row += len(part)
    assert whole
    return whole


def _write(parts: Iterator[Packed], file: Any, height: int) -> None:
    """A PNG of the tiles, of which few are in memory at a time. height: of all of them, in pixels."""
    rows: Rows | None = None
    for part in parts:
        if rows is None:
            rows = Rows(file, (height, *part.shape[1:]), part.dtype)
        rows.add(part)
    assert rows
    rows.close()
