"""The files that a scene names: its meshes and its textures. Each is read once, by whatever name."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from cltrace.base.errors import Fault, SceneError
from cltrace.base.limits import MAX_TEXELS, MAX_UNREADABLE
from cltrace.formats.faults import Messages, closest
from cltrace.formats.files import UnreadableError, size_of, within
from cltrace.formats.xml_values import quoted
from cltrace.scene import Texture

if TYPE_CHECKING:
    from cltrace.formats.obj import Obj

T = TypeVar("T")
MAX_NAMES = 1000  # in a folder, among which one that is missing is looked for


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


class Names:
    """The names of files in the order of their first use, and the lines of the scene that name them."""

    def __init__(self, label: str) -> None:
        self.label = label
        self.lines: dict[str, list[int]] = {}
        self._index: dict[str, int] = {}

    def add(self, name: str, line: int) -> int:
        """The index of a name."""
        self.lines.setdefault(name, []).append(line)
        return self._index.setdefault(name, len(self._index))


@dataclass
class Contents(Generic[T]):
    """What files hold, each once, with their first names; of: for each name its index, None if it cannot be used."""

    found: list[T] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    of: list[int | None] = field(default_factory=list)


class Files:
    """The files of a scene in a folder.

    faults: of the contents of other files than the scene's own; size: bytes of its own file, and of each mesh that has
    been read.
    """

    def __init__(self, scene: str) -> None:
        self._scene, self._folder = Path(scene), Path(scene).parent
        self.meshes, self.textures = Names("mesh: name"), Names("material_textured texture: name")
        self.faults: list[Fault] = []
        self.size = size_of(self._scene)

    def shown(self, name: str) -> str:
        """The path of a file as a message shows it."""
        return str(self._folder / name)

    def named(self) -> tuple[Path, ...]:
        """The scene's own file, and those that it names."""
        names = dict.fromkeys((*self.meshes.lines, *self.textures.lines))
        return (self._scene, *(self._folder / name for name in names))

    def read_meshes(self, faults: Messages) -> Contents[Obj]:
        """The meshes; `faults` are told of files that cannot be read."""

        def read(name: str, path: str) -> Obj | None:
            try:
                from cltrace.formats.obj import read_obj  # most scenes have none

                self.size += size_of(Path(path))
                return read_obj(path)
            except SceneError as error:
                self.faults += [replace(fault, path=self.shown(name)) for fault in error.faults]
                return None

        return self._read(self.meshes, read, faults)

    def read_textures(self, faults: Messages, warnings: Messages) -> Contents[Texture]:
        """The textures; `faults` are told of those that cannot be read."""
        room = MAX_TEXELS

        def read(name: str, path: str) -> Texture:
            nonlocal room
            from cltrace.formats.texture import read_texture

            pixels, warning = read_texture(path, room)
            room -= pixels.shape[0] * pixels.shape[1]
            if warning:
                for line in self.textures.lines[name]:
                    warnings.add(line, f"{self.textures.label} {quoted(name)} {warning}")
            return pixels

        return self._read(self.textures, read, faults)

    def _read(self, names: Names, read: Callable[[str, str], T | None], faults: Messages) -> Contents[T]:
        contents: Contents[T] = Contents()
        place: dict[str, int | None] = {}
        unreadable = 0
        for name, lines in names.lines.items():
            try:
                if unreadable > MAX_UNREADABLE:
                    raise UnreadableError("is not looked for, as too many before it cannot be read")
                path = within(str(self._folder), name)
                if path not in place:
                    place[path] = None
                    found = read(name, path)
                    if found is not None:
                        place[path] = len(contents.found)
                        contents.found.append(found)
                        contents.names.append(name)
                contents.of.append(place[path])
            except UnreadableError as error:
                contents.of.append(None)
                unreadable += 1
                for line in lines:
                    faults.add(line, f"{names.label} {quoted(name)} {error}", partial(hint_beside, self._folder, name))
        return contents
