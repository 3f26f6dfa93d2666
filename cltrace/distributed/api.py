"""What a user calls: one picture in tiles, and the frames of a movie."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sized
from contextlib import closing
from copy import copy
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from distributed import Client
from numpy.typing import NDArray

from cltrace.distributed.farm import Farm, Task
from cltrace.movie.animate import FPS, Target
from cltrace.movie.fingerprint import Fingerprints
from cltrace.movie.frames import Frame, frames_of
from cltrace.movie.names import pattern_of
from cltrace.picture.files import whole_file
from cltrace.picture.image import Image
from cltrace.picture.png import BAND, Packed, Rows, packed
from cltrace.plan.request import Crop, Region, Request
from cltrace.progress import bar
from cltrace.scene import Camera, Scene

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
    crop: Crop | None = None,
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
    region = Request(crop=crop).region_of(scene.camera.resolution)
    if tiles is not None and (isinstance(tiles, bool) or not isinstance(tiles, int) or tiles < 1):
        raise ValueError(f"tiles: must be a whole number >= 1, got {tiles!r}")
    if output is not None and Path(output).suffix.lower() != ".png":
        raise ValueError(f"output: must end in .png, got {os.fspath(output)!r}")
    with Farm(client, device, options) as farm:
        wanted = None if output is None else partial(_packed, shown)
        tasks = list(_tiles(scene, region, tiles or TILES * len(farm.devices), wanted))
        with closing(farm.drawn(tasks)) as drawn, bar(len(tasks), "tile", progress) as shown_bar:
            parts = (_counted(part, shown_bar) for _, part in drawn)
            if output is None:
                return _joined(parts, region[2:])
            with whole_file(Path(output)) as file:
                _write(parts, file, region[3])
    return os.fspath(output)


def animate(
    frames: Iterable[Scene | Camera | Mapping[str, Any]],
    client: Client,
    output: str | os.PathLike[str],
    *,
    scene: Scene | None = None,
    device: str | None = None,
    fps: float = FPS,
    skip_existing: bool = False,
    progress: bool | None = None,
    **options: Any,
) -> list[str]:
    """Draws the frames of a movie on the workers of a dask cluster, and writes them here, in order.

    client, device: see render(); the other arguments, what is returned, and the files are those of cltrace.animate().
    A scene is sent to the workers once, however many cameras look at it. Raises what render() raises; frames that are
    written by then are whole, and skip_existing continues.
    """
    try:
        pattern = pattern_of(os.fspath(output), "frame", frames=True)
    except ValueError as error:
        raise ValueError(f"output: {error}") from None
    target = Target(pattern, fps, skip_existing)
    total = len(frames) if isinstance(frames, Sized) else None
    with Farm(client, device, options) as farm:
        artist, todo = FarmArtist(farm), frames_of(frames, scene)

        def draw(left: Iterator[Frame]) -> Generator[tuple[Frame, Pixels], None, None]:
            return artist.pictures(left, lambda image, scene: np.asarray(image))

        return target.write(todo, draw, artist.marks(""), options.get("crop"), progress, total)


class FarmArtist:
    """Draws the frames of a movie on a farm. how: the precision and the devices, for messages."""

    def __init__(self, farm: Farm) -> None:
        self._farm, self._options = farm, dict(farm.options)
        self._crop: Crop | None = farm.options.pop("crop", None)  # which a task has
        names = sorted(set(farm.devices.values()))
        self.how = f"{farm.options['precision']} precision, on {len(farm.devices)} workers with {', '.join(names)}"
        self._device = " ".join(names) if farm.options["precision"] == "single" else ""

    def pictures(
        self, frames: Iterable[Frame], shown: Callable[[Image, Scene], Pixels]
    ) -> Generator[tuple[Frame, Pixels], None, None]:
        """Each frame with what of its Image is shown, in order."""
        waiting: deque[Frame] = deque()

        def tasks() -> Iterator[Task]:
            for frame in frames:
                waiting.append(frame)
                yield Task(f"frame {frame.number}", frame.scene, self._crop)

        with closing(self._farm.drawn(tasks())) as drawn:
            for _, image in drawn:
                frame = waiting.popleft()
                yield frame, shown(image, frame.scene)

    def marks(self, look: object) -> Fingerprints:
        """Fingerprints of the pictures, which are those of one process."""
        return Fingerprints({**self._options, "device": self._device, "look": look})


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
            yield Task(label, scene, whole if once else tile, (first, end) if once else None, wanted)


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
