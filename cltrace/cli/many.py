"""Several pictures in one call: the frames of an orbit, several scenes, or both. One Renderer draws them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.errors import SceneError, UsageError
from cltrace.cli.files import Reporter, check_target, files_of, naming, scene_of
from cltrace.cli.options import Options, refusing
from cltrace.movie.animate import FPS, FrameFiles, FrameRenderer, on_device
from cltrace.movie.frames import MOVIES, MovieFrame, Pattern, frames_of, orbit, pattern_of
from cltrace.picture.files import Inputs
from cltrace.picture.image import Image
from cltrace.process.console import tell
from cltrace.scene import AnyCamera, Scene


def draw_many(options: Options, reporter: Reporter, check: Callable[[], object] = lambda: None) -> int:
    """Draws all frames of all scenes. Returns 0, or 2 where a scene has a fault; the others are drawn all the same.

    check: is called after each frame, and may raise an error that ends the work.
    """
    _check_names(options)
    work = _Pictures(options, reporter, check)
    with refusing(), naming(otherwise=(options.output or ["the picture"])[0]), ExitStack() as stack:
        renderer: FrameRenderer | None = None
        for files, frames, count in work.scenes() if options.orbit is None else work.orbits():
            renderer = renderer or _renderer(options, stack)  # which may take long, so a scene's faults come first
            work.write(files, frames, count, renderer)
    return work.status


def orbit_of(options: Options, scene: Scene) -> tuple[list[AnyCamera], str]:
    """The cameras of the frames around the only scene, and the name of their file. Raises what draw_many() raises."""
    _check_names(options)
    with refusing():
        cameras = _cameras(options, scene)
    pattern = _pattern(options, scene, options.scenes[0], Inputs(files_of(scene)))
    return [cameras[number] for number in _picked(options, len(cameras), "frames")], pattern.text


def _check_names(options: Options) -> None:
    """Raises UsageError where -o makes no sense, or two scenes have the same name."""
    taken: dict[str, str] = {}
    for path in options.scenes if options.output else ():
        with refusing("-o: "):
            pattern = pattern_of((options.output or [""])[0], Path(path).stem, options.orbit is not None)
            name = pattern.text if options.orbit is not None else pattern.of(0)
        if name in taken:
            raise UsageError(
                f"-o: {taken[name]} and {path} would both be {name}; have {{}} in it, which is the name of the "
                "scene, or say a folder"
            )
        taken[name] = path


def _renderer(options: Options, stack: ExitStack) -> FrameRenderer:
    """What draws: the device, or a cluster, which lives as long as the stack."""
    how = options.renderer_options(options.shown)
    if options.cluster is None:
        return on_device(options.device, how)
    from cltrace.cli.cluster import client_of

    client = stack.enter_context(client_of(options.cluster))
    from cltrace.distributed import on_cluster

    return on_cluster(client, options.device, how)


def _picked(options: Options, count: int, what: str) -> range:
    """Which numbers below this one --frames picks."""
    numbers = range(count)[options.frames or slice(None)]
    if not numbers:
        raise UsageError(f"--frames: there are only {count} {what}, from 0 on")
    return numbers


def _cameras(options: Options, scene: Scene) -> list[AnyCamera]:
    """Those of --orbit."""
    return orbit(scene, options.orbit or 0, options.axis, 360.0 if options.degrees is None else options.degrees)


def _pattern(options: Options, scene: Scene, path: str, inputs: Inputs) -> Pattern:
    """The names of the files of frames around a scene."""
    if options.output is None:
        return Pattern(Path(scene.output_file).stem.replace("%", "%%") + "%04d.png")
    pattern = pattern_of(options.output[0], Path(path).stem, frames=True)
    check_target(pattern.of(0), "-o", inputs, suffixes=(".png", *MOVIES))
    return pattern


class _Pictures:
    """What is drawn, as groups of frames that have their files in common, and what came of it.

    status: the exit status.
    """

    def __init__(self, options: Options, reporter: Reporter, check: Callable[[], object]) -> None:
        self.options, self.reporter, self.check, self.status = options, reporter, check, 0
        self.inputs = Inputs(map(Path, options.scenes))
        self.how: dict[str, Any] = {"skip_existing": options.skip_existing, "inputs": self.inputs}

    def scenes(self) -> Iterator[tuple[FrameFiles, Iterator[MovieFrame], int]]:
        """One picture of each scene that can be read."""
        names: dict[int, str] = {}
        numbers = _picked(self.options, len(self.options.scenes), "scenes")

        def frames() -> Iterator[MovieFrame]:
            for number in numbers:
                path, output = self.options.scenes[number], self.options.output
                scene = self._read(path)
                if scene is None:
                    continue
                name = scene.output_file if output is None else pattern_of(output[0], Path(path).stem, False).of(0)
                check_target(name, "output_file" if output is None else "-o", self.inputs)
                if name in names.values():
                    other = f"another scene has {name}, too; -o '{{}}.png' takes scenes' names"
                    raise UsageError(f"{path}: output_file: {other}")
                names[number] = name
                yield MovieFrame(number, scene)

        yield FrameFiles(names.__getitem__, **self.how), frames(), len(numbers)

    def orbits(self) -> Iterator[tuple[FrameFiles, Iterator[MovieFrame], int]]:
        """Frames around each scene that can be read."""
        taken: set[str] = set()
        for path in self.options.scenes:
            scene = self._read(path)
            if scene is None:
                continue
            pattern = _pattern(self.options, scene, path, self.inputs)
            if pattern.text in taken:
                other = f"another scene has {pattern.text}, too; -o '{{}}%04d.png' takes scenes' names"
                raise UsageError(f"{path}: {other}")
            taken.add(pattern.text)
            cameras = _cameras(self.options, scene)
            frames = frames_of(cameras, scene, self.options.frames or slice(None))
            files = FrameFiles(pattern.of, pattern.suffix, self.options.fps or FPS, **self.how)
            yield files, frames, len(_picked(self.options, len(cameras), "frames"))

    def write(self, files: FrameFiles, frames: Iterator[MovieFrame], count: int, renderer: FrameRenderer) -> None:
        """Draws frames, and says what was written, also where a fault ends that."""
        options = self.options
        how: dict[str, Any] = {"look": (options.show, options.space), "progress": self.reporter.progress}

        def pixels(image: Image, scene: Scene) -> NDArray[np.uint8]:
            self.check()
            return options.pixels(image, scene.camera)

        names: list[str] = []
        try:
            names = files.write(frames, renderer, pixels, total=count, **how)
        finally:
            kept, names = files.kept if names else 0, names or files.written
            if names:
                which = names[0] if len(names) == 1 else f"{len(names) - kept} pictures, {names[0]} to {names[-1]}"
                there = f", {kept} were there," if kept else ","
                self.reporter.say(f"cltrace: wrote {which}{there} {renderer.how}")

    def _read(self, path: str) -> Scene | None:
        """A scene, or None if it has faults, which are told."""
        try:
            scene = scene_of(path, self.options, self.reporter)
        except SceneError as error:
            self.inputs.add(error.files)
            if len(self.options.scenes) == 1:
                raise
            tell(str(error))
            self.status = error.exit_code
            return None
        self.inputs.add(files_of(scene))
        return scene
