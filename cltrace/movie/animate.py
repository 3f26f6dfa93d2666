"""Draws the frames of a movie, into files or as an iterator: what a frame shares with the one before it is kept.

While the kernel draws a frame, one thread prepares the next one and others write the last ones, so that each of these
costs time only where it takes longer than the kernel. Few frames are in memory at a time, however many there are.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sized
from contextlib import closing
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, overload

from cltrace.base.progress import bar
from cltrace.movie.encoders import Apng, Drawn, Encoder, Gif, PngFiles, Writer
from cltrace.movie.fingerprint import shows
from cltrace.movie.frames import Frame, frames_of
from cltrace.movie.names import MOVIES, Listed, Pattern, pattern_of
from cltrace.movie.on_devices import OnDevices
from cltrace.movie.pipeline import COLORS, FrameRenderer, Shown
from cltrace.picture.files import Inputs
from cltrace.picture.image import Image
from cltrace.plan.request import Crop
from cltrace.run.devices import Device
from cltrace.scene import AnyCamera, Scene

FPS = 25.0


@overload
def animate(
    frames: Iterable[Scene | AnyCamera | Mapping[str, Any]],
    output: None = None,
    *,
    scene: Scene | None = None,
    device: str | Device | None = None,
    progress: bool | None = None,
    **options: Any,
) -> Iterator[Image]: ...


@overload
def animate(
    frames: Iterable[Scene | AnyCamera | Mapping[str, Any]],
    output: str | os.PathLike[str],
    *,
    scene: Scene | None = None,
    device: str | Device | None = None,
    fps: float = FPS,
    skip_existing: bool = False,
    progress: bool | None = None,
    **options: Any,
) -> list[str]: ...


def animate(
    frames: Iterable[Scene | AnyCamera | Mapping[str, Any]],
    output: str | os.PathLike[str] | None = None,
    *,
    scene: Scene | None = None,
    device: str | Device | None = None,
    fps: float = FPS,
    skip_existing: bool = False,
    progress: bool | None = None,
    **options: Any,
) -> Iterator[Image] | list[str]:
    """Draws frames: into files, or as an iterator of Images where there is no output.

    frames: an iterable of what each frame shows: a Scene; a Camera, which looks at what was there before; or a dict of
    the arguments of Renderer.update(), and "camera", that changes what was there before. scene: what there is before
    the first frame, not needed if that is a Scene. cltrace.orbit() makes cameras.

    output: "frame%04d.png", where %04d is the number of the frame, from 0, or a folder that is there; or the name of a
    movie, which ends in .mp4 (with the extra `movie`), .gif or .apng. fps: frames a second of a movie. Returns the
    names of the files. skip_existing: whether a PNG that is there is kept if it shows the frame. Each says so itself,
    by a hash of all that the scene consists of, the options, and the version.

    device and options, such as precision and crop: see Renderer; "all" are all devices of this machine, each of which
    draws the next frame when it is free. progress: see docs/movies.md.

    Raises TypeError and ValueError for what is not allowed, MissingPackageError for an extra that is missing, OSError
    if a file cannot be written, and what Renderer raises. Each file is there as a whole or not at all.
    """
    if output is None:
        if skip_existing:
            raise ValueError("skip_existing: there is nothing to skip without an output")
        return _images(frames_of(frames, scene), device, progress, _length(frames), options)
    try:
        pattern = pattern_of(os.fspath(output), "frame", frames=True)
    except ValueError as error:
        raise ValueError(f"output: {error}") from None
    target = Target(pattern, fps, skip_existing)
    folder = Path(pattern.of(0)).parent
    if not folder.is_dir():
        raise FileNotFoundError(f"output: there is no folder {str(folder)!r}; mkdir() of a Path makes one")
    renderer = OnDevices(device, options)
    return target.write(frames_of(frames, scene), renderer, progress=progress, total=_length(frames))


def _images(
    frames: Iterator[Frame], device: str | Device | None, progress: bool | None, total: int | None, options: Any
) -> Iterator[Image]:
    with (
        closing(OnDevices(device, options).images(frames)) as drawn,
        bar(total, "frame", bool(progress)) as shown,
    ):
        for _, image in drawn:
            yield image
            shown.update()


def _length(frames: object) -> int | None:
    return len(frames) if isinstance(frames, Sized) else None


class Target:
    """Where frames go, and how: see animate(). kept: how many files were there already; written: the PNGs that were
    not, and are now; inputs: files that no frame may replace, beside those of the scenes.

    Raises ValueError for what makes no sense.
    """

    def __init__(
        self,
        pattern: Pattern | Listed,
        fps: float = FPS,
        skip_existing: bool = False,
        inputs: Inputs | None = None,
    ) -> None:
        if isinstance(fps, bool) or not isinstance(fps, (int, float)) or not 0.001 <= fps <= 1000:
            raise ValueError(f"fps: must be a number within 0.001..1000, got {fps!r}")
        if skip_existing and pattern.suffix in MOVIES:
            raise ValueError("skip_existing: is for frames of files of their own, as a movie is whole or not there")
        self.pattern, self.fps, self.skip_existing, self.kept = pattern, fps, skip_existing, 0
        self._inputs, self.written = inputs or Inputs(), list[str]()

    def write(
        self,
        frames: Iterable[Frame],
        renderer: FrameRenderer,
        shown: Shown = COLORS,
        *,
        progress: bool | None = None,
        total: int | None = None,
    ) -> list[str]:
        """Has the frames drawn and writes them. Returns the names of the files, those that were kept among them.

        progress, total: of bar().
        """
        crop, marks = renderer.crop, renderer.marks(shown)
        names: list[str] = []
        numbered = self.pattern.suffix not in MOVIES
        with bar(total, "frame", progress) as done:

            def wanted() -> Iterator[Frame]:
                for frame in frames:
                    names.append(self.pattern.of(frame.number))
                    if self.skip_existing and shows(Path(names[-1]), marks.of(frame.scene)):
                        self.kept += 1
                        done.update()
                    else:
                        self._check_name(names[-1], frame.scene)
                        yield frame

            todo = wanted()
            first = next(todo, None)
            if first is None:
                return names
            size = _size(first.scene, crop)
            todo = chain([first], todo if numbered else _alike(todo, size, crop))
            with Writer(self._encoder(size)) as writer, closing(renderer.pictures(todo, shown)) as drawn:
                for frame, pixels in drawn:
                    writer.add(Drawn(frame.number, pixels, partial(marks.of, frame.scene) if numbered else None))
                    done.update()
        return names if numbered else names[:1]

    def _check_name(self, name: str, scene: Scene) -> None:
        """Raises UsageError where a frame would replace what it or one before it is made from."""
        self._inputs.add(scene.source.files if scene.source else ())
        self._inputs.check(name, "output")

    def _encoder(self, size: tuple[int, int]) -> Encoder:
        """What writes frames of so many pixels, (width, height). Raises MissingPackageError and OSError."""
        if self.pattern.suffix not in MOVIES:
            return PngFiles(self.pattern.of, self.written)
        path = Path(self.pattern.of(0))
        if self.pattern.suffix == ".mp4":
            from cltrace.movie.video import Mp4

            return Mp4(path, self.fps, size)
        return (Gif if self.pattern.suffix == ".gif" else Apng)(path, self.fps)


def _size(scene: Scene, crop: Crop | None) -> tuple[int, int]:
    """(width, height) of a scene's picture, in pixels."""
    return scene.camera.resolution if crop is None else (crop[2] - crop[0], crop[3] - crop[1])


def _alike(frames: Iterable[Frame], size: tuple[int, int], crop: Crop | None) -> Iterator[Frame]:
    """The frames. Raises ValueError for one that is of another size."""
    for frame in frames:
        found = _size(frame.scene, crop)
        if found != size:
            raise ValueError(
                f"frames[{frame.number}]: must be {size} pixels, as the first one of the movie, got {found}"
            )
        yield frame
