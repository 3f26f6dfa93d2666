"""Draws the frames of a movie, into files or as an iterator: what a frame shares with the one before it is kept.

While the kernel draws a frame, one thread prepares the next one and others write the last ones, so that each of these
costs time only where it takes longer than the kernel. Few frames are in memory at a time, however many there are.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sized
from contextlib import closing
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from cltrace.base.progress import bar
from cltrace.movie.encoders import Apng, Drawn, Encoder, Gif, PngFiles, Writer
from cltrace.movie.fingerprint import shows
from cltrace.movie.frames import Frame, frames_of
from cltrace.movie.names import MOVIES, Listed, Pattern, pattern_of
from cltrace.movie.pipeline import COLORS, Each, FrameRenderer, OnDevice, Shown, draw_on
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
    each: Each | None = None,
    progress: bool | None = None,
    **options: Any,
) -> Iterator[Image]: ...


@overload
def animate(
    frames: Iterable[Scene | AnyCamera | Mapping[str, Any] | str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    scene: Scene | None = None,
    device: str | Device | None = None,
    each: Each | None = None,
    fps: float = FPS,
    skip_existing: bool = False,
    progress: bool | None = None,
    **options: Any,
) -> list[str]: ...


def animate(
    frames: Iterable[Scene | AnyCamera | Mapping[str, Any] | str | os.PathLike[str]],
    output: str | os.PathLike[str] | None = None,
    *,
    scene: Scene | None = None,
    device: str | Device | None = None,
    each: Each | None = None,
    fps: float = FPS,
    skip_existing: bool = False,
    progress: bool | None = None,
    **options: Any,
) -> Iterator[Image] | list[str]:
    """Draws frames: into files, or as an iterator of Images where there is no output.

    frames: an iterable of what each frame shows: a Scene; a Camera, which looks at what was there before; or a dict of
    the arguments of Renderer.update(), and "camera", that changes what was there before. scene: what there is before
    the first frame, not needed if that is a Scene. cltrace.orbit() makes cameras. Or the names of pictures that are
    there, such as PNGs, all of one size, of which a movie is made.

    each: a function that is called with the number of each frame and its Image, in order. It may draw on the arrays of
    the image, or return another picture, as an array (h, w, 3) or (h, w, 4) of uint8 or an image of Pillow: a time
    stamp, a colour bar.

    output: "frame%04d.png", where %04d is the number of the frame, from 0, or a folder that is there; or the name of a
    movie, which ends in .mp4 (with the extra `movie`), .gif or .apng. fps: frames a second of a movie. Returns the
    names of the files. skip_existing: whether a PNG that is there is kept if it shows the frame. Each says so itself,
    by a hash of all that the scene consists of, the options, and the version, but not where `each` has drawn.

    device and options, such as precision and crop: see Renderer. progress: see docs/movies.md.

    Raises TypeError and ValueError for what is not allowed, MissingPackageError for an extra that is missing, OSError
    if a file cannot be written, and what Renderer raises. Each file is there as a whole or not at all.
    """
    if output is None:
        if skip_existing:
            raise ValueError("skip_existing: there is nothing to skip without an output")
        return _images(frames_of(frames, scene), partial(OnDevice, device, options, each), progress, _length(frames))
    try:
        pattern = pattern_of(os.fspath(output), "frame", frames=True)
    except ValueError as error:
        raise ValueError(f"output: {error}") from None
    target = Target(pattern, fps, skip_existing, each=each)
    folder = Path(pattern.of(0)).parent
    if not folder.is_dir():
        raise FileNotFoundError(f"output: there is no folder {str(folder)!r}; mkdir() of a Path makes one")
    total, (names, items) = _length(frames), _names_first(frames)
    if names:
        return target.join(items, progress=progress, total=total)
    renderer = OnDevice(device, options, each)
    return target.write(frames_of(items, scene), renderer, progress=progress, total=total)


def _names_first(frames: Any) -> tuple[bool, Any]:
    """Whether frames begin with the name of a file, and all of them. What cannot be frames is left to frames_of()."""
    if isinstance(frames, (Mapping, str, os.PathLike)) or not isinstance(frames, Iterable):
        return False, frames
    items = iter(frames)
    first = list(islice(items, 1))
    return bool(first) and isinstance(first[0], (str, os.PathLike)), chain(first, items)


def _images(
    frames: Iterator[Frame], renderer: Callable[[], OnDevice], progress: bool | None, total: int | None
) -> Iterator[Image]:
    with (
        closing(renderer().images(frames)) as drawn,
        bar(total, "frame", bool(progress)) as shown,
    ):
        for _, image in drawn:
            yield image
            shown.update()


def _length(frames: object) -> int | None:
    return len(frames) if isinstance(frames, Sized) else None


class Target:
    """Where frames go, and how: see animate(). kept: how many files were there already; written: the PNGs that were
    not, and are now; inputs: files that no frame may replace, beside those of the scenes; each: see draw_on().

    Raises ValueError for what makes no sense.
    """

    def __init__(
        self,
        pattern: Pattern | Listed,
        fps: float = FPS,
        skip_existing: bool = False,
        inputs: Inputs | None = None,
        each: Each | None = None,
    ) -> None:
        if isinstance(fps, bool) or not isinstance(fps, (int, float)) or not 0.001 <= fps <= 1000:
            raise ValueError(f"fps: must be a number within 0.001..1000, got {fps!r}")
        if skip_existing and pattern.suffix in MOVIES:
            raise ValueError("skip_existing: is for frames of files of their own, as a movie is whole or not there")
        if skip_existing and each:
            raise ValueError("skip_existing: does not go with each, as no file says what that has drawn")
        self.each = each
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
                    mark = partial(marks.of, frame.scene) if numbered and not self.each else None
                    writer.add(Drawn(frame.number, pixels, mark))
                    done.update()
        return names if numbered else names[:1]

    def join(self, files: Iterable[Any], progress: bool | None = None, total: int | None = None) -> list[str]:
        """Makes a movie of pictures that are there, by their names. Returns the movie's.

        progress, total: of bar(). Raises TypeError for what is no name, and ValueError for a picture of another size
        than the first.
        """
        if self.pattern.suffix not in MOVIES:
            raise ValueError(f"output: of files the frames make one, whose name ends in {', '.join(MOVIES)}")
        pictures = ((number, self._read(number, name)) for number, name in enumerate(files))
        first = next(pictures)
        size = first[1].shape[:2]
        with bar(total, "frame", progress) as done, Writer(self._encoder((size[1], size[0]))) as writer:
            for number, pixels in chain([first], pictures):
                if pixels.shape[:2] != size:
                    here, there = (f"{shape[1]}x{shape[0]}" for shape in (pixels.shape, size))
                    raise ValueError(f"frames[{number}]: must be {there} pixels, as the first one, got {here}")
                writer.add(Drawn(number, pixels))
                done.update()
        return [self.pattern.of(0)]

    def _read(self, number: int, name: Any) -> NDArray[np.uint8]:
        """The picture of this file, with what `each` draws on it."""
        from PIL import Image as Picture

        if not isinstance(name, (str, os.PathLike)):
            raise TypeError(f"frames[{number}]: must be the name of a picture, as the first one, got {name!r}")
        self._inputs.add([Path(name)])
        self._inputs.check(self.pattern.of(0), "output")
        with Picture.open(name) as picture:
            pixels = np.array(picture.convert("RGBA" if picture.has_transparency_data else "RGB"))
        if self.each:
            image = Image(rgba8=pixels) if pixels.shape[2] == 4 else Image(rgb8=pixels)
            draw_on(image, number, self.each)
            pixels = np.asarray(image)
        return pixels

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
