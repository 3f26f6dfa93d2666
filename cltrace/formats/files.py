"""The files of a scene: its own, and the meshes and textures that it names. They may come from a stranger."""

from __future__ import annotations

import itertools
import os
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from cltrace.base import limits
from cltrace.base.errors import Fault, SceneError
from cltrace.base.limits import MAX_TEXELS, MAX_UNREADABLE
from cltrace.formats.faults import FatalError, Messages, closest, quoted
from cltrace.scene import Texture

if TYPE_CHECKING:
    from cltrace.formats.obj import Obj

T = TypeVar("T")
MAX_NAMES = 1000  # in a folder, among which one that is missing is looked for


class UnreadableError(Exception):
    """What is wrong with a file before any of its contents, in words that belong behind its name."""


def chunks(path: str, size: int, name: str) -> Iterator[bytes]:
    """The bytes of a regular file, `size` at once.

    Raises UnreadableError, also beyond the limit of this name, and FatalError if the file is empty.
    """
    most = limits.current(name)
    check_regular(path)
    with _words_for_errors(), Path(path).open("rb") as file:
        read = 0
        while chunk := file.read(size):
            read += len(chunk)
            if read > most:
                raise UnreadableError(f"must not be larger than {most} bytes{limits.hint(name)}")
            yield chunk
    if not read:
        raise FatalError(0, "is empty")


def check_regular(path: str) -> None:
    """Raises UnreadableError where a file is missing or none that has contents of its own."""
    with _words_for_errors():
        mode = os.stat(path).st_mode  # noqa: PTH116 - a Path drops a slash at the end, which only a folder may have
    if not stat.S_ISREG(mode):
        raise UnreadableError("is a directory" if stat.S_ISDIR(mode) else "is not a regular file")


def within(folder: Path, name: str) -> str:
    """The real path of a file in a folder; raises UnreadableError where a symbolic link leads out of the folder."""
    with _words_for_errors():
        inside = os.path.realpath(folder)
        path = os.path.realpath(f"{inside}/{name}")
    if not Path(path).is_relative_to(inside):
        raise UnreadableError("must stay within the scene's folder")
    return path


@contextmanager
def _words_for_errors() -> Iterator[None]:
    """Raises UnreadableError in place of what the system raises."""
    try:
        yield
    except OSError as error:
        raise UnreadableError(f"cannot be read: {error.strerror}") from None
    except UnicodeEncodeError:
        raise UnreadableError(f"cannot be read: the name is not {sys.getfilesystemencoding()}") from None
    except ValueError:
        raise UnreadableError("cannot be read: the name contains a NUL") from None


def hint_beside(root: Path, name: str) -> str:
    """The end of the message that a file cannot be read, where one beside it has a name that resembles its own.

    Of several with that name, one of the same kind is meant.
    """
    folder, _, last = name.rpartition("/")
    try:
        found = {path.name: path for path in itertools.islice((root / folder).iterdir(), MAX_NAMES)}
    except (OSError, ValueError):
        return ""
    asked = Path(last)
    stem = None if last in found else closest(asked.stem, tuple(sorted(path.stem for path in found.values())))
    alike = [(path.suffix != asked.suffix, other) for other, path in found.items() if path.stem == stem]
    return f"; did you mean {quoted(name.removesuffix(last) + min(alike)[1])}?" if alike else ""


class NamedFiles(Generic[T]):
    """The files of one kind that a scene names, each of which is read once, by whatever name.

    lines: the lines of the scene that name each, in the order of their first use; found: what the files hold, by their
    first names; index: for each name, in order, the place of what it holds in `found`, None if it cannot be used.
    """

    def __init__(self, label: str) -> None:
        self.label = label
        self.lines: dict[str, list[int]] = {}
        self.found: dict[str, T] = {}
        self.index: list[int | None] = []
        self._numbers: dict[str, int] = {}

    def add(self, name: str, line: int) -> int:
        """The number of a name, in the order of their first use."""
        self.lines.setdefault(name, []).append(line)
        return self._numbers.setdefault(name, len(self._numbers))

    def read(self, folder: Path, read: Callable[[str, str], T | None], faults: Messages) -> None:
        """Reads all of them by read(name, path); `faults` are told of those that cannot be read."""
        index_of_path: dict[str, int | None] = {}
        unreadable = 0
        for name, lines in self.lines.items():
            index = None
            try:
                if unreadable > MAX_UNREADABLE:
                    raise UnreadableError("is not looked for, as too many before it cannot be read")
                path = within(folder, name)
                if path not in index_of_path:
                    index_of_path[path] = None
                    if (content := read(name, path)) is not None:
                        index_of_path[path] = len(self.found)
                        self.found[name] = content
                index = index_of_path[path]
            except UnreadableError as error:
                unreadable += 1
                for line in lines:
                    faults.add(line, f"{self.label} {quoted(name)} {error}", partial(hint_beside, folder, name))
            self.index.append(index)


class SceneFiles:
    """The files of a scene in a folder.

    faults: of the contents of other files than the scene's own; size: bytes of its own file, and of each mesh that has
    been read.
    """

    def __init__(self, scene: str) -> None:
        self._scene, self._folder = Path(scene), Path(scene).parent
        self.meshes: NamedFiles[Obj] = NamedFiles("mesh: name")
        self.textures: NamedFiles[Texture] = NamedFiles("material_textured texture: name")
        self.faults: list[Fault] = []
        self.size = 0
        self._add_size(scene)

    def _add_size(self, path: str) -> None:
        with suppress(OSError, ValueError):  # what then reads it says why
            self.size += Path(path).stat().st_size

    def shown(self, name: str) -> str:
        """The path of a file as a message shows it."""
        return str(self._folder / name)

    def named(self) -> tuple[Path, ...]:
        """The scene's own file, and those that it names."""
        names = dict.fromkeys((*self.meshes.lines, *self.textures.lines))
        return (self._scene, *(self._folder / name for name in names))

    def read_meshes(self, faults: Messages) -> None:
        """Reads the meshes; `faults` are told of files that cannot be read."""

        def read(name: str, path: str) -> Obj | None:
            from cltrace.formats.obj import read_obj  # most scenes have none

            self._add_size(path)
            try:
                return read_obj(path)
            except SceneError as error:
                self.faults += [replace(fault, path=self.shown(name)) for fault in error.faults]
                return None

        self.meshes.read(self._folder, read, faults)

    def read_textures(self, faults: Messages, warnings: Messages) -> None:
        """Reads the textures; `faults` are told of those that cannot be read."""
        room = MAX_TEXELS

        def read(name: str, path: str) -> Texture:
            nonlocal room
            from cltrace.formats.texture import read_texture

            pixels, warning = read_texture(path, room)
            room -= pixels.shape[0] * pixels.shape[1]
            for line in self.textures.lines[name] if warning else []:
                warnings.add(line, f"{self.textures.label} {quoted(name)} {warning}")
            return pixels

        self.textures.read(self._folder, read, faults)
