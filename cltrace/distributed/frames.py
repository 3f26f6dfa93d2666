"""The frames of a movie, drawn by the workers of a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sized
from typing import Any

from distributed import Client

from cltrace.distributed.render_farm import Farm, Task
from cltrace.distributed.workers import Part
from cltrace.movie.animate import FPS, Target
from cltrace.movie.frames import Frame, frames_of
from cltrace.movie.names import pattern_of
from cltrace.movie.pipeline import Each, FrameRenderer, Workers
from cltrace.picture.image import Image
from cltrace.scene import Camera, Scene


def animate(
    frames: Iterable[Scene | Camera | Mapping[str, Any]],
    client: Client,
    output: str | os.PathLike[str],
    *,
    scene: Scene | None = None,
    device: str | None = None,
    each: Each | None = None,
    progress: bool | None = None,
    **options: Any,
) -> list[str]:
    """Draws the frames of a movie on the workers of a dask cluster, and writes them here, in order.

    client, device: see render(); the other arguments, each, which is called here, fps and skip_existing among them,
    what is returned, and the files are those of cltrace.animate(). A scene is sent to the workers once, however many
    cameras look at it. Raises what render() raises; frames that are written by then are whole, and skip_existing
    continues.
    """
    try:
        pattern = pattern_of(os.fspath(output), "frame", frames=True)
    except ValueError as error:
        raise ValueError(f"output: {error}") from None
    target = Target(pattern, options.pop("fps", FPS), options.pop("skip_existing", False), each=each)
    total = len(frames) if isinstance(frames, Sized) else None
    renderer = OnCluster(client, device, options, each)
    return target.write(frames_of(frames, scene), renderer, progress=progress, total=total)


class OnCluster(FrameRenderer):
    """Draws on a cluster. client, device: see Farm; options: the Renderer's; each: see draw_on(). It is what takes the
    frames, too."""

    def __init__(
        self, client: Client, device: str | None, options: Mapping[str, Any], each: Each | None = None
    ) -> None:
        # A task has the crop.
        self._farm = Farm(client, device, {name: value for name, value in options.items() if name != "crop"})
        names = sorted(set(self._farm.devices.values()))
        place = f"{len(self._farm.devices)} workers with {', '.join(names)}"
        super().__init__({**options, "precision": self._farm.precision}, " ".join(names), place, each)
        self.room, self.close = self._farm.room, self._farm.close

    def workers(self) -> Workers[Frame, Image]:
        return self

    def take(self, frame: Frame) -> Callable[[], Image]:
        """Has a frame drawn."""
        return self._farm.take(Task(f"frame {frame.number}", frame.scene, Part(self.crop)))
