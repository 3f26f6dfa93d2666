"""Where a picture goes: what can be known to fail is found before the work, and then the file is written."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from cltrace.base.errors import UsageError
from cltrace.cli.options import Compare, OneScene, Picture
from cltrace.cli.scenes import files_of
from cltrace.picture.files import Inputs, is_named_as_folder, whole_file
from cltrace.picture.image import Image, Rows
from cltrace.picture.storing import SUFFIXES, check_format
from cltrace.scene import Scene

STDOUT = ("/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")


def targets_of(scene: Scene, work: OneScene, suffixes: tuple[str, ...] = SUFFIXES) -> list[str]:
    """Where the picture goes; what can be known to fail is found before the work. suffixes: which formats there are."""
    path, taken = work.scene.path, isinstance(work, Picture) and work.stats == "json"
    targets = [scene.output_file] if work.output is None else [x.replace("{}", Path(path).stem) for x in work.output]
    origin = "output_file" if work.output is None else "-o"
    if sys.stdout is None and ("-" in targets or taken):
        raise UsageError("stdout is closed")
    if "-" in targets and taken:
        raise UsageError("-o - and --stats=json both want stdout")
    if "-" in targets and sys.stdout.isatty():
        raise UsageError("-o - writes a PNG: send stdout to a file or a program")
    inputs = Inputs([*files_of(scene), *([Path(work.compare)] if isinstance(work, Compare) else [])])
    for i, target in enumerate(targets):
        if any(_same(target, other) for other in targets[:i]):
            raise UsageError(f"-o: {target!r} is there twice")
        if target != "-":
            check_target(target, origin, inputs, suffixes)
    return targets


def target_of(scene: Scene, work: OneScene, option: str) -> str:
    """The one PNG where the answer of an option goes."""
    targets = targets_of(scene, work, (".png",))
    if len(targets) > 1:
        raise UsageError(f"{option} takes one -o")
    return targets[0]


def suffix_of(target: str) -> str:
    """What says the format of a target: .png of stdout."""
    return ".png" if target == "-" else Path(target).suffix.lower()


def _same(one: str, other: str) -> bool:
    """Whether two targets are one file."""
    return one == other or os.path.realpath(one) == os.path.realpath(other)


def check_target(target: str, origin: str, inputs: Inputs, suffixes: tuple[str, ...] = (".png",)) -> None:
    """Raises UsageError if no picture can or should be written to a file of this name.

    origin: whose word the name is; inputs: files that are read; suffixes: with which the name may end.
    """
    try:
        _check_target(target, origin, suffixes)
        inputs.check(target, origin)
    except (OSError, ValueError) as error:  # too long a name, a locked folder, a null byte, a link to itself
        raise UsageError(f"{origin}: {getattr(error, 'strerror', None) or error}: {target!r}") from None


def _check_target(target: str, origin: str, suffixes: tuple[str, ...]) -> None:
    path = Path(target)
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
def naming(target: str | None = None) -> Iterator[None]:
    """Makes a UsageError of what is raised where a file cannot be written. target: which one, if no error says it."""
    try:
        yield
    except BrokenPipeError:
        raise
    except (OSError, UnicodeError) as error:
        name = target or getattr(error, "filename", None)
        raise UsageError(f"cannot write {name}: {getattr(error, 'strerror', None) or error}") from None
