"""Several pictures in one call: the frames of an orbit, several scenes, or both. One Renderer draws them."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cltrace.cli.options import LIT, parser
from cltrace.cli.picture import options_of
from cltrace.cli.source import scene_of
from cltrace.cli.target import check_target
from cltrace.console import tell
from cltrace.errors import SceneError, UsageError
from cltrace.movie.animate import FPS, Target
from cltrace.movie.artists import Artist, Here
from cltrace.movie.frames import Frame, ahead, frames_of, orbit
from cltrace.movie.names import MOVIES, Listed, Pattern, pattern_of
from cltrace.picture.image import Image, Output
from cltrace.scene import Scene

ONE_PICTURE = ("check", "explain", "compare", "tolerance", "json", "stats", "repeat", "bits", "outputs", "watch")

Say = Callable[[str], None]


def movie(args: argparse.Namespace, say: Say) -> int:
    """Draws all frames of all scenes. Returns 0, or 2 where a scene has a fault; the others are drawn all the same."""
    args = argparse.Namespace(**{**vars(args), "output": _output(args)})
    _check(args)
    outputs: tuple[Output, ...] = ("rgb8",) if args.show == "color" else (args.show,)
    work = _Work(args, say, options_of(args, outputs))
    work.check_names()
    try:
        work.draw()
    except ValueError as error:
        raise UsageError(str(error)) from None
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise
        raise UsageError(f"cannot write {error.filename or args.output}: {error.strerror or error}") from None
    return work.status


def _output(args: argparse.Namespace) -> str | None:
    """The one -o. Raises UsageError for several."""
    if args.output and len(args.output) > 1:
        raise UsageError("-o is given once where there are many pictures")
    return args.output[0] if args.output else None


def _check(args: argparse.Namespace) -> None:
    """Raises UsageError for options that do not go together."""
    for name in ONE_PICTURE:
        if getattr(args, name) != parser().get_default(name):
            raise UsageError(f"--{name} is for one picture, of one scene")
    if args.tiles is not None:
        raise UsageError("--tiles is for one picture, of one scene")
    if args.show == LIT:
        raise UsageError("--show lit is for one picture, of one scene")
    if args.output == "-":
        raise UsageError("-o - is for one picture, of one scene")
    for name in ("axis", "degrees"):
        if getattr(args, name) is not None and args.orbit is None:
            raise UsageError(f"--{name} goes with --orbit")
    if args.frames is not None and args.orbit is None and len(args.scenes) == 1:
        raise UsageError("--frames goes with --orbit, or with several scenes")
    one_file = args.orbit is not None and args.output is not None and Path(args.output).suffix.lower() in MOVIES
    if args.fps is not None and not one_file:
        raise UsageError(f"--fps goes with --orbit and a movie, whose name ends in {', '.join(MOVIES)}")
    if args.skip_existing and one_file:
        raise UsageError("--skip-existing goes with PNGs, as a movie is there as a whole or not at all")


@dataclass
class _Work:
    """What is drawn, and what came of it. status: the exit status."""

    args: argparse.Namespace
    say: Say
    options: dict[str, Any]
    status: int = 0

    def draw(self) -> None:
        """Everything that is asked for."""
        with ExitStack() as self._begun:
            if self.args.orbit is None:
                self.draw_scenes()
            else:
                self.draw_orbits()

    @cached_property
    def artist(self) -> Artist:
        """What draws: the device, or a cluster. It starts when it is needed, after a scene's faults have been told."""
        if self.args.cluster is None:
            return Here(self.args.device, self.options)
        from cltrace.cli.cluster import client_of

        client = self._begun.enter_context(client_of(self.args.cluster))
        from cltrace.distributed.api import FarmArtist
        from cltrace.distributed.farm import Farm

        return FarmArtist(self._begun.enter_context(Farm(client, self.args.device, self.options)))

    def check_names(self) -> None:
        """Raises UsageError where -o makes no sense, or two scenes have the same name."""
        taken: dict[str, str] = {}
        for path in self.args.scenes if self.args.output is not None else ():
            try:
                name = pattern_of(self.args.output, Path(path).stem, self.args.orbit is not None).text
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
        names = Listed({})
        target = Target(names, skip_existing=self.args.skip_existing)
        written = self._write(target, ahead(self._scenes(names)), len(self._picked(len(self.args.scenes), "scenes")))
        self._tell(target, written)

    def _scenes(self, names: Listed) -> Iterator[Frame]:
        """The scenes that can be read, whose pictures get their names."""
        for number in self._picked(len(self.args.scenes), "scenes"):
            scene = self._read(number)
            if scene is None:
                continue
            path, output = self.args.scenes[number], self.args.output
            name = scene.output_file if output is None else pattern_of(output, Path(path).stem, frames=False).of(0)
            check_target(name, "output_file" if output is None else "-o", path)
            if name in names.names.values():
                raise UsageError(
                    f"{path}: output_file: another scene has {name}, too; -o '{{}}.png' takes scenes' names"
                )
            names.names[number] = name
            yield Frame(number, scene)

    def _picked(self, count: int, what: str) -> range:
        """Which numbers below this one --frames picks."""
        numbers = range(count)[self.args.frames or slice(None)]
        if not numbers:
            raise UsageError(f"--frames: there are only {count} {what}, from 0 on")
        return numbers

    def draw_orbits(self) -> None:
        """Frames around each scene."""
        taken: set[str] = set()
        for path, scene in ahead((path, self._read(k)) for k, path in enumerate(self.args.scenes)):
            if scene is None:
                continue
            pattern = self._pattern(scene, path)
            if pattern.text in taken:
                raise UsageError(
                    f"{path}: another scene has {pattern.text}, too; -o '{{}}%04d.png' takes scenes' names"
                )
            taken.add(pattern.text)
            target = Target(pattern, self.args.fps or FPS, self.args.skip_existing)
            degrees = 360.0 if self.args.degrees is None else self.args.degrees
            cameras = orbit(scene, self.args.orbit, self.args.axis, degrees)
            chosen = self.args.frames or slice(None)
            count = len(self._picked(len(cameras), "frames"))
            if pattern.suffix == ".mp4":
                self._tell_even(scene)
            self._tell(target, self._write(target, frames_of(cameras, scene, chosen), count))

    def _pattern(self, scene: Scene, path: str) -> Pattern:
        if self.args.output is None:
            return Pattern(Path(scene.output_file).stem.replace("%", "%%") + "%04d.png")
        pattern = pattern_of(self.args.output, Path(path).stem, frames=True)
        check_target(pattern.of(0), "-o", path, suffixes=(".png", *MOVIES))
        return pattern

    def _read(self, number: int) -> Scene | None:
        """A scene, or None if it has faults, which are told."""
        args = argparse.Namespace(**{**vars(self.args), "scene": self.args.scenes[number]})
        try:
            return scene_of(args, self.say)
        except SceneError as error:
            if len(self.args.scenes) == 1:
                raise
            tell(str(error))
            self.status = error.exit_code
            return None

    def _write(self, target: Target, frames: Iterator[Frame], count: int) -> list[str]:
        show, camera_axes = self.args.show, self.args.space == "camera"

        def shown(image: Image, scene: Scene) -> Any:
            if show == "color":
                return np.asarray(image)
            return image.as_rgb8(show, scene.camera.basis() if camera_axes else None)

        return target.write(
            frames,
            lambda todo: self.artist.pictures(todo, shown),
            self.artist.marks((show, self.args.space)),
            self.args.crop,
            False if self.args.quiet else None,
            count,
        )

    def _tell(self, target: Target, names: list[str]) -> None:
        if not names:
            return
        which = names[0] if len(names) == 1 else f"{len(names) - target.kept} pictures, {names[0]} to {names[-1]}"
        kept = f", {target.kept} were there," if target.kept else ","
        self.say(f"cltrace: wrote {which}{kept} {self.artist.how}")

    def _tell_even(self, scene: Scene) -> None:
        """Says what an mp4 does to odd sizes."""
        crop = self.args.crop
        width, height = (crop[2] - crop[0], crop[3] - crop[1]) if crop else scene.camera.resolution
        if width % 2 or height % 2:
            even = f"{width + width % 2}x{height + height % 2}"
            self.say(f"cltrace: an mp4 has no odd sizes: {width}x{height} becomes {even}, with its last pixels twice")
