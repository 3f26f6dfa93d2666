"""Draws the frames of a movie, into files or as an iterator.

While the kernel draws a frame, one thread prepares the next one and others encode and write the last ones, so that
each of these costs time only where it takes longer than the kernel. Few frames are in memory at a time.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sized
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, overload

import numpy as np

from cltrace.base.arrays import processors
from cltrace.base.progress import bar
from cltrace.movie.frames import MOVIES, MovieFrame, frames_of, pattern_of
from cltrace.movie.writers import CODECS, Fingerprints, Pixels, find_ffmpeg, movie_writer, shows, write_frame
from cltrace.picture.files import Inputs
from cltrace.picture.image import Image
from cltrace.renderers.renderer import Renderer, default_precision
from cltrace.run.devices import Device, choose
from cltrace.scene import AnyCamera, Scene

FPS = 25.0
# What is called with the number of a frame and its Image, see draw_on().
Each = Callable[[int, Image], Any]
Task = TypeVar("Task")
Result = TypeVar("Result")


def in_order(
    tasks: Iterable[Task], begin: Callable[[Task], Callable[[], Result]], most: Callable[[], int]
) -> Generator[tuple[Task, Result], None, None]:
    """Yields each task with its result, in order. At most most() tasks, and at least one, are pending.

    begin: begins a task, and returns what waits for its result. The thread that asks for results takes the tasks.
    Where the iterable of tasks raises an error, the tasks before it are done first.
    """
    iterator, waiting = iter(tasks), deque[tuple[Task, Callable[[], Result]]]()
    more, fault = True, None
    while more or waiting:
        while more and len(waiting) < max(1, most()):
            try:
                task = next(iterator)
            except StopIteration:
                more = False
            except Exception as error:
                more, fault = False, error
            else:
                waiting.append((task, begin(task)))
        if waiting:
            task, result = waiting.popleft()
            yield task, result()
    if fault:
        raise fault


class FrameRenderer(NamedTuple):
    """What makes images of frames: a device of this machine, or a cluster.

    images: yields each frame with its image, in order, and ends what is pending when it is closed; options: of
    Renderer, with the precision that is used; devices: their names; place: the same in words, for messages.
    """

    images: Callable[[Iterable[MovieFrame]], Generator[tuple[MovieFrame, Image], None, None]]
    options: Mapping[str, Any]
    devices: str
    place: str

    @property
    def how(self) -> str:
        return f"{self.options['precision']} precision, on {self.place}"


def on_device(device: str | Device | None, options: Mapping[str, Any]) -> FrameRenderer:
    """Draws on a device of this machine. Raises DeviceError if there is no such device."""
    chosen = device if isinstance(device, Device) else choose(device)
    how = {**options, "precision": options.get("precision") or default_precision(chosen)}

    def images(frames: Iterable[MovieFrame]) -> Generator[tuple[MovieFrame, Image], None, None]:
        last: Renderer | None = None

        def prepared(frame: MovieFrame) -> Renderer:
            nonlocal last
            last = last.following(frame.scene) if last else Renderer(frame.scene, chosen, **how)
            return last

        pool = ThreadPoolExecutor(1)
        try:
            for frame, renderer in in_order(frames, lambda frame: pool.submit(prepared, frame).result, lambda: 2):
                yield frame, renderer.render(progress=False)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)  # the thread may still compile

    return FrameRenderer(images, how, chosen.name, chosen.name)


def draw_on(image: Image, number: int, each: Each) -> None:
    """Lets a function draw on the image of a frame.

    What the function returns, if that is not None, replaces the picture: what numpy takes for (h, w, 3) or (h, w, 4)
    uint8 of the same size. Raises ValueError for anything else.
    """
    found = each(number, image)
    if found is None:
        return
    size, pixels = np.asarray(image).shape[:2], np.asarray(found)
    if pixels.dtype != np.uint8 or pixels.shape not in ((*size, 3), (*size, 4)):
        wanted = f"None or uint8 of shape {(*size, 3)} or {(*size, 4)}"
        raise ValueError(f"each: must return {wanted}, returned {pixels.dtype} of shape {pixels.shape}")
    image.rgb8 = np.array(pixels[..., :3])
    if "rgba8" in image.outputs:
        del image.rgba8
    if pixels.shape[2] == 4:
        image.rgba8 = np.array(pixels)


class FrameFiles:
    """The files of frames: a PNG for each, or a movie of all.

    name_of: the file of a frame, by its number; suffix: ".png", or the one of a movie; inputs: files that no frame may
    replace, in addition to those of the scenes. fps, skip_existing, each: see animate(). kept: how many files were
    there already; written: the names of the PNGs that were not, and are now. Raises ValueError for what makes no sense,
    and MissingPackageError for an MP4 or APNG without ffmpeg.
    """

    def __init__(
        self,
        name_of: Callable[[int], str],
        suffix: str = ".png",
        fps: float = FPS,
        skip_existing: bool = False,
        inputs: Inputs | None = None,
        each: Each | None = None,
    ) -> None:
        if isinstance(fps, bool) or not isinstance(fps, (int, float)) or not 0.001 <= fps <= 1000:
            raise ValueError(f"fps: must be a number within 0.001..1000, got {fps!r}")
        if skip_existing and suffix in MOVIES:
            raise ValueError("skip_existing: is for frames of files of their own, as a movie is whole or not there")
        if skip_existing and each:
            raise ValueError("skip_existing: does not go with each, as no file says what that has drawn")
        if suffix in CODECS:
            find_ffmpeg()
        self._name_of, self._movie, self._fps = name_of, suffix in MOVIES, fps
        self._skip_existing, self._each, self._inputs = skip_existing, each, inputs or Inputs()
        self.written, self.kept = list[str](), 0

    def write(
        self,
        frames: Iterable[MovieFrame],
        renderer: FrameRenderer,
        pixels_of: Callable[[Image, Scene], Pixels] = lambda image, scene: np.asarray(image),
        look: object = "",
        progress: bool | None = None,
        total: int | None = None,
    ) -> list[str]:
        """Draws the frames and writes them. Returns the names of the files, those that were kept among them.

        pixels_of: what of an image is shown; look: tells that from other ways to show images; progress, total: see
        bar().
        """
        # In single precision, the device decides some bits.
        device = renderer.devices if renderer.options["precision"] == "single" else ""
        marks = Fingerprints({**renderer.options, "device": device, "look": look})
        names: list[str] = []

        def wanted() -> Iterator[MovieFrame]:
            for frame in frames:
                names.append(self._name_of(frame.number))
                if self._skip_existing and shows(Path(names[-1]), marks.of(frame.scene)):
                    self.kept += 1
                    done.update()
                    continue
                self._inputs.add(frame.scene.source.files if frame.scene.source else ())
                self._inputs.check(names[-1], "output")
                yield frame

        def pictures() -> Iterator[tuple[int, Pixels, Callable[[], str] | None]]:
            for frame, image in drawn:
                if self._each:
                    draw_on(image, frame.number, self._each)
                mark = None if self._movie or self._each else partial(marks.of, frame.scene)
                yield frame.number, pixels_of(image, frame.scene), mark

        with bar(total, "frame", progress) as done, closing(renderer.images(wanted())) as drawn:
            self._store(pictures(), done)
        return names[:1] if self._movie else names

    def join(self, names: Iterable[Any], progress: bool | None = None, total: int | None = None) -> list[str]:
        """Makes a movie of pictures that are there. Returns its name. Raises TypeError for what is no name."""
        from PIL import Image as Picture

        if not self._movie:
            raise ValueError(f"output: of files the frames make one, whose name ends in {', '.join(MOVIES)}")

        def pictures() -> Iterator[tuple[int, Pixels, None]]:
            for number, name in enumerate(names):
                if not isinstance(name, (str, os.PathLike)):
                    raise TypeError(f"frames[{number}]: must be the name of a picture, as the first one, got {name!r}")
                self._inputs.add([Path(name)])
                self._inputs.check(self._name_of(0), "output")
                with Picture.open(name) as picture:
                    pixels = np.array(picture.convert("RGBA" if picture.has_transparency_data else "RGB"))
                if self._each:
                    image = Image(rgba8=pixels) if pixels.shape[2] == 4 else Image(rgb8=pixels)
                    draw_on(image, number, self._each)
                    pixels = np.asarray(image)
                yield number, pixels, None

        with bar(total, "frame", progress) as done:
            self._store(pictures(), done)
        return [self._name_of(0)]

    def _store(self, pictures: Iterator[tuple[int, Pixels, Callable[[], str] | None]], done: Any) -> None:
        """Writes pictures: of a movie in order, in a thread of its own, and else in several.

        pictures: of each its number, pixels and what makes its fingerprint, if the file is to have one. Raises
        ValueError for a picture of a movie that has another size than the first.
        """
        first = next(pictures, None)
        if first is None:
            return
        shape, writers = first[1].shape, 1 if self._movie else processors()

        def write(number: int, pixels: Pixels, mark: Callable[[], str] | None) -> None:
            if put is None:
                write_frame(self._name_of(number), pixels, mark)
                return
            if pixels.shape != shape:
                (high, wide, channels), (h, w, n) = shape, pixels.shape
                wanted, got = f"{wide}x{high} pixels of {channels} channels", f"{w}x{h} of {n}"
                raise ValueError(f"frames[{number}]: must have {wanted}, as the first one of the movie, got {got}")
            put(pixels)

        with ExitStack() as stack:
            put = None
            if self._movie:
                put = stack.enter_context(movie_writer(Path(self._name_of(0)), self._fps, shape))
            pool = ThreadPoolExecutor(writers)
            stack.callback(pool.shutdown, cancel_futures=True)
            begun = in_order(
                chain([first], pictures), lambda picture: pool.submit(write, *picture).result, lambda: writers + 1
            )
            for (number, _, _), _ in begun:
                if not self._movie:
                    self.written.append(self._name_of(number))
                done.update()


Item = Scene | AnyCamera | Mapping[str, Any]
Name = str | os.PathLike[str]


@overload
def animate(frames: Iterable[Item], output: None = None, **options: Any) -> Iterator[Image]: ...


@overload
def animate(frames: Iterable[Item | Name], output: Name, **options: Any) -> list[str]: ...


def animate(
    frames: Iterable[Item | Name],
    output: Name | None = None,
    *,
    scene: Scene | None = None,
    device: str | Device | None = None,
    each: Each | None = None,
    fps: float = FPS,
    skip_existing: bool = False,
    progress: bool | None = None,
    **options: Any,
) -> Iterator[Image] | list[str]:
    """Draw frames, into files or as an iterator of images.

    Parameters
    ----------
    frames : iterable
        What each frame shows: a Scene; a Camera, which looks at what was there before; or a dict of the arguments of
        Renderer.update(), and "camera", that changes what was there before. `cltrace.orbit` makes cameras. Or the names
        of pictures, such as PNGs, all of one size, of which a movie is made.
    output : path, optional
        "frame%04d.png", where %04d is the number of the frame, from 0; a folder that is there; or the name of a movie,
        which ends in .mp4 (with the extra `movie`), .gif or .apng. Without it, the images are returned.
    scene : Scene, optional
        What there is before the first frame. It is not needed if the first frame is a Scene.
    device : str or Device, optional
        As for Renderer.
    each : callable, optional
        Called with the number of each frame and its Image, in order. It may draw on the arrays of the image, or return
        another picture, as an array (h, w, 3) or (h, w, 4) of uint8 or an image of Pillow: a time stamp, a colour bar.
    fps : float
        Frames a second of a movie.
    skip_existing : bool
        Whether a PNG that is there is kept if it shows the frame. Each PNG says so itself, by a hash of all that the
        scene consists of, the options, and the version, but not where `each` has drawn.
    progress : bool, optional
        Whether tqdm shows a progress bar; by default on terminals and in notebooks, if tqdm is installed.
    **options
        Of Renderer, such as precision and crop.

    Returns
    -------
    iterator of Image, or list of str
        The images, or the names of the files. Each file is there as a whole or not at all.

    Raises
    ------
    TypeError, ValueError
        For what is not allowed.
    MissingPackageError
        If an extra is missing.
    OSError
        If a file cannot be written.
    """
    total = len(frames) if isinstance(frames, Sized) else None
    if output is None:
        if skip_existing:
            raise ValueError("skip_existing: there is nothing to skip without an output")
        return _images(frames_of(frames, scene), partial(on_device, device, options), each, progress, total)
    files = files_of(output, fps, skip_existing, each)
    items: Iterable[Any] = frames
    if isinstance(frames, Iterable) and not isinstance(frames, (Mapping, str, os.PathLike)):
        iterator = iter(frames)
        begin = list(islice(iterator, 1))
        items = chain(begin, iterator)
        if begin and isinstance(begin[0], (str, os.PathLike)):
            return files.join(items, progress, total)
    return files.write(frames_of(items, scene), on_device(device, options), progress=progress, total=total)


def files_of(output: Name, fps: float, skip_existing: bool, each: Each | None) -> FrameFiles:
    """The files of animate(). Raises ValueError, and FileNotFoundError without a folder for them."""
    try:
        pattern = pattern_of(os.fspath(output), "frame", frames=True)
    except ValueError as error:
        raise ValueError(f"output: {error}") from None
    folder = Path(pattern.of(0)).parent
    if not folder.is_dir():
        raise FileNotFoundError(f"output: there is no folder {str(folder)!r}; mkdir() of a Path makes one")
    return FrameFiles(pattern.of, pattern.suffix, fps, skip_existing, each=each)


def _images(
    frames: Iterator[MovieFrame],
    renderer: Callable[[], FrameRenderer],
    each: Each | None,
    progress: bool | None,
    total: int | None,
) -> Iterator[Image]:
    with closing(renderer().images(frames)) as drawn, bar(total, "frame", bool(progress)) as shown:
        for frame, image in drawn:
            if each:
                draw_on(image, frame.number, each)
            yield image
            shown.update()
