"""Which scene is drawn, and where its picture goes: what can be known to fail is found before the work."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from cltrace.base.errors import SceneError, UsageError
from cltrace.base.limits import INSTANCES
from cltrace.base.waiting import SLOW, Announcement
from cltrace.cli.options import Options
from cltrace.formats.reader import read
from cltrace.picture.files import Inputs, is_named_as_folder, whole_file
from cltrace.picture.image import Image, Rows
from cltrace.picture.storing import SUFFIXES, check_format
from cltrace.process.console import tell
from cltrace.scene import Camera, Scene

STDOUT = ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")


class Reporter:
    """Says what is done, unless only errors are wanted. files: what the scenes are made of that were read."""

    def __init__(self, quiet: bool) -> None:
        self._quiet, self.files = quiet, set[Path]()

    def say(self, message: str) -> None:
        """A message that is no error."""
        if not self._quiet:
            tell(message)

    @property
    def progress(self) -> bool | None:
        """Whether there is a bar, as bar() has it."""
        return False if self._quiet else None


def files_of(scene: Scene) -> tuple[Path, ...]:
    """The files that a scene is made of."""
    return scene.source.files if scene.source else ()


def scene_of(path: str, options: Options, reporter: Reporter) -> Scene:
    """The scene of a file, with the camera and background that are asked for; its warnings are said."""
    try:
        with Announcement(f"reading {path} ...", SLOW):
            scene, warnings = read(path, INSTANCES)
    except SceneError as error:
        reporter.files |= set(error.files)
        raise
    reporter.files |= set(files_of(scene))
    for warning in warnings:
        reporter.say(warning)
    camera = scene.camera
    if options.size:
        camera = replace(camera, resolution=options.size)
    if options.square_pixels and isinstance(camera, Camera):  # no file has any other
        camera = replace(camera, square_pixels=True)
    seen = scene.seen_by(camera)
    return seen.in_front_of((*scene.background, 0.0)) if options.transparent else seen


def targets_of(scene: Scene, options: Options, suffixes: tuple[str, ...] = SUFFIXES) -> list[str]:
    """Where the picture goes; what can be known to fail is found before the work. suffixes: which formats there are."""
    path, taken, output = options.scenes[0], options.stats == "json", options.output
    targets = [scene.output_file] if output is None else [text.replace("{}", Path(path).stem) for text in output]
    if sys.stdout is None and ("-" in targets or taken):
        raise UsageError("stdout is closed")
    if "-" in targets and taken:
        raise UsageError("-o - and --stats=json both want stdout")
    if "-" in targets and sys.stdout.isatty():
        raise UsageError("-o - writes a PNG: send stdout to a file or a program")
    inputs = Inputs([*files_of(scene), *([Path(options.compare)] if options.compare else [])])
    for i, target in enumerate(targets):
        if any(target == other or os.path.realpath(target) == os.path.realpath(other) for other in targets[:i]):
            raise UsageError(f"-o: {target!r} is there twice")
        if target != "-":
            check_target(target, "output_file" if output is None else "-o", inputs, suffixes)
    return targets


def suffix_of(target: str) -> str:
    """What says the format of a target: .png of stdout."""
    return ".png" if target == "-" else Path(target).suffix.lower()


def check_target(target: str, origin: str, inputs: Inputs, suffixes: tuple[str, ...] = (".png",)) -> None:
    """Raises UsageError if no picture can or should be written to a file of this name.

    origin: whose word the name is; inputs: files that are read; suffixes: with which the name may end.
    """
    path = Path(target)
    try:
        if not target:
            raise UsageError("-o: must not be empty")
        if path.is_dir() or is_named_as_folder(target):
            raise UsageError(f"{origin}: {target!r} is a folder")
        try:
            check_format(path, suffixes)
        except ValueError as error:
            advice = "; -o - writes it to stdout" if target in STDOUT else ""
            raise UsageError(f"-o: {error}{advice}") from None
        if not path.parent.is_dir():
            raise UsageError(f"-o: there is no folder {str(path.parent)!r}")
        inputs.check(target, origin)
    except (OSError, ValueError) as error:  # too long a name, a locked folder, a null byte, a link to itself
        raise UsageError(f"{origin}: {getattr(error, 'strerror', None) or error}: {target!r}") from None


def write(image: Image, target: str, *shown: Any, **how: Any) -> None:
    """Writes a picture to a file, or a PNG to stdout where the target is -. shown, how: as of Image.save()."""
    with naming(target):
        if target == "-":
            image.write(sys.stdout.buffer, ".png", *shown, **how)
            sys.stdout.buffer.flush()
        else:
            image.save(target, *shown, **how)


def write_rows(images: Iterable[Image], height: int, targets: Mapping[str, Mapping[str, Any]]) -> None:
    """Writes a picture to files while it is drawn. images: its rows, from the top; height: of all; targets: how
    Image.write() would write each of them.
    """
    with naming(), ExitStack() as stack:
        files = dict[str, Rows]()
        for target, how in targets.items():
            file = sys.stdout.buffer if target == "-" else stack.enter_context(whole_file(Path(target)))
            files[target] = Rows(file, suffix_of(target), height, **how)
        for image in images:
            for target, rows in files.items():
                with naming(target):
                    rows.add(image)
        for target, rows in files.items():
            with naming(target):
                rows.close()
                if target == "-":
                    sys.stdout.buffer.flush()


@contextmanager
def naming(target: str | None = None, otherwise: str | None = None) -> Iterator[None]:
    """Makes a UsageError of what is raised where a file cannot be written.

    target: which one; None for the one that the error names, or `otherwise` if it names none.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except (OSError, UnicodeError) as error:
        name = target or getattr(error, "filename", None) or otherwise
        raise UsageError(f"cannot write {name}: {getattr(error, 'strerror', None) or error}") from None
