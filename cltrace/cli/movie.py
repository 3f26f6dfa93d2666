"""Several pictures in one call: the frames of an orbit, several scenes, or both. One Renderer draws them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from cltrace.base.errors import SceneError, UsageError
from cltrace.cli.options import Movie, SceneOptions
from cltrace.cli.output_files import check_target
from cltrace.cli.reporter import Reporter
from cltrace.cli.scenes import files_of, scene_of
from cltrace.movie.animate import FPS, Each, FrameFiles, FrameRenderer, on_device
from cltrace.movie.frames import MOVIES, Frame, Pattern, frames_of, orbit, pattern_of
from cltrace.picture.files import Inputs
from cltrace.process.console import tell
from cltrace.scene import AnyCamera, Scene


def draw_movie(movie: Movie, reporter: Reporter, each: Each | None = None) -> int:
    """Draws all frames of all scenes. Returns 0, or 2 where a scene has a fault; the others are drawn all the same.

    each: is called after each frame, and draws nothing.
    """
    work = _Work(movie, reporter, each)
    work.check_names()
    try:
        work.draw()
    except ValueError as error:
        raise UsageError(str(error)) from None
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise
        raise UsageError(f"cannot write {error.filename or movie.output}: {error.strerror or error}") from None
    return work.status


def orbit_of(movie: Movie, reporter: Reporter, scene: Scene) -> tuple[list[AnyCamera], str]:
    """The cameras of the frames around the only scene of a movie, and the name of its file. Raises what draw_movie()
    raises."""
    work = _Work(movie, reporter)
    work.check_names()
    try:
        cameras = work.cameras(scene)
    except ValueError as error:
        raise UsageError(str(error)) from None
    file = work.pattern(scene, movie.scenes[0].path).text
    return [cameras[number] for number in work.picked(len(cameras), "frames")], file


@dataclass
class _Work:
    """What is drawn, and what came of it. each: see draw_movie(); status: the exit status."""

    movie: Movie
    reporter: Reporter
    each: Each | None = None
    status: int = 0

    def __post_init__(self) -> None:
        self.inputs = Inputs(Path(scene.path) for scene in self.movie.scenes)

    def draw(self) -> None:
        """Everything that is asked for."""
        with ExitStack() as self._begun:
            if self.movie.orbit is None:
                self.draw_scenes()
            else:
                self.draw_orbits()

    @cached_property
    def renderer(self) -> FrameRenderer:
        """What draws: the device, or a cluster. It starts when it is needed, after a scene's faults have been told."""
        drawing, look = self.movie.drawing, self.movie.look
        # Fingerprints of files that are there have the depth twice.
        options = drawing.renderer_options((*look.outputs, *look.scale))
        if self.movie.cluster is None:
            return on_device(drawing.device, options)
        from cltrace.cli.cluster import client_of

        client = self._begun.enter_context(client_of(self.movie.cluster))
        from cltrace.distributed import on_cluster

        return on_cluster(client, drawing.device, options)

    def check_names(self) -> None:
        """Raises UsageError where -o makes no sense, or two scenes have the same name."""
        taken: dict[str, str] = {}
        output = self.movie.output
        for path in [scene.path for scene in self.movie.scenes] if output is not None else ():
            try:
                pattern = pattern_of(output or "", Path(path).stem, self.movie.orbit is not None)
                name = pattern.text if self.movie.orbit is not None else pattern.of(0)
            except ValueError as error:
                raise UsageError(f"-o: {error}") from None
            if name in taken:
                raise UsageError(
                    f"-o: {taken[name]} and {path} would both be {name}; have {{}} in it, which is the name of the "
                    "scene, or say a folder"
                )
            taken[name] = path

    def draw_scenes(self) -> None:
        """One picture of each scene."""
        names: dict[int, str] = {}
        how: dict[str, Any] = {"skip_existing": self.movie.skip_existing, "inputs": self.inputs, "each": self.each}
        files = FrameFiles(names.__getitem__, **how)
        self._write(files, self._scenes(names), len(self.picked(len(self.movie.scenes), "scenes")))

    def _scenes(self, names: dict[int, str]) -> Iterator[Frame]:
        """The scenes that can be read, whose pictures get their names."""
        for number in self.picked(len(self.movie.scenes), "scenes"):
            asked = self.movie.scenes[number]
            scene = self._read(asked)
            if scene is None:
                continue
            path, output = asked.path, self.movie.output
            name = scene.output_file if output is None else pattern_of(output, Path(path).stem, frames=False).of(0)
            check_target(name, "output_file" if output is None else "-o", self.inputs)
            if name in names.values():
                raise UsageError(
                    f"{path}: output_file: another scene has {name}, too; -o '{{}}.png' takes scenes' names"
                )
            names[number] = name
            yield Frame(number, scene)

    def picked(self, count: int, what: str) -> range:
        """Which numbers below this one --frames picks."""
        numbers = range(count)[self.movie.frames or slice(None)]
        if not numbers:
            raise UsageError(f"--frames: there are only {count} {what}, from 0 on")
        return numbers

    def draw_orbits(self) -> None:
        """Frames around each scene."""
        taken: set[str] = set()
        for asked in self.movie.scenes:
            path, scene = asked.path, self._read(asked)
            if scene is None:
                continue
            pattern = self.pattern(scene, path)
            if pattern.text in taken:
                raise UsageError(
                    f"{path}: another scene has {pattern.text}, too; -o '{{}}%04d.png' takes scenes' names"
                )
            taken.add(pattern.text)
            how: dict[str, Any] = {"skip_existing": self.movie.skip_existing, "inputs": self.inputs, "each": self.each}
            files = FrameFiles(pattern.of, pattern.suffix, self.movie.fps or FPS, **how)
            cameras = self.cameras(scene)
            if pattern.suffix == ".mp4":
                self._tell_even(scene)
            chosen = self.movie.frames or slice(None)
            self._write(files, frames_of(cameras, scene, chosen), len(self.picked(len(cameras), "frames")))

    def cameras(self, scene: Scene) -> list[AnyCamera]:
        """Those of --orbit."""
        degrees = 360.0 if self.movie.degrees is None else self.movie.degrees
        return orbit(scene, self.movie.orbit or 0, self.movie.axis, degrees)

    def pattern(self, scene: Scene, path: str) -> Pattern:
        if self.movie.output is None:
            return Pattern(Path(scene.output_file).stem.replace("%", "%%") + "%04d.png")
        pattern = pattern_of(self.movie.output, Path(path).stem, frames=True)
        check_target(pattern.of(0), "-o", self.inputs, suffixes=(".png", *MOVIES))
        return pattern

    def _read(self, asked: SceneOptions) -> Scene | None:
        """A scene, or None if it has faults, which are told."""
        try:
            scene = scene_of(asked, self.reporter)
            self.inputs.add(files_of(scene))
            return scene
        except SceneError as error:
            self.inputs.add(error.files)
            if len(self.movie.scenes) == 1:
                raise
            tell(str(error))
            self.status = error.exit_code
            return None

    def _write(self, files: FrameFiles, frames: Iterator[Frame], count: int) -> None:
        """Draws frames, and says what was written, also where a fault ends that."""
        look = self.movie.look
        how: dict[str, Any] = {"look": (look.show, look.space), "progress": self.reporter.progress, "total": count}
        try:
            names = files.write(frames, self.renderer, lambda i, scene: look.pixels(scene.camera)(i), **how)
        except Exception:
            self._tell(files.written, 0)
            raise
        self._tell(names, files.kept)

    def _tell(self, names: list[str], there: int) -> None:
        """Says which pictures there are, of which so many were there already."""
        if not names:
            return
        which = names[0] if len(names) == 1 else f"{len(names) - there} pictures, {names[0]} to {names[-1]}"
        kept = f", {there} were there," if there else ","
        self.reporter.say(f"cltrace: wrote {which}{kept} {self.renderer.how}")

    def _tell_even(self, scene: Scene) -> None:
        """Says what an mp4 does to odd sizes."""
        crop = self.movie.drawing.crop
        width, height = (crop[2] - crop[0], crop[3] - crop[1]) if crop else scene.camera.resolution
        if width % 2 or height % 2:
            even = f"{width + width % 2}x{height + height % 2}, with its last pixels twice"
            self.reporter.say(f"cltrace: an mp4 has no odd sizes: {width}x{height} becomes {even}")
