"""Reads an OBJ file into a `Geometry`, or says everything that is wrong with it.

The lines of a block that begin with the same keyword are converted together. Where one of them is not as it should be,
halves of them are converted, and in the end single lines, whose messages are worded here.

Vertices (v), texture coordinates (vt), normals (vn) and faces (f) are read; they may come in any order. Free-form
curves and surfaces are not read.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from itertools import chain
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from cltrace.base.arrays import blockwise, keep_freed_memory
from cltrace.base.errors import Fault, SceneError, warnings_are
from cltrace.base.limits import MAX_FAULTS, MAX_TRIANGLES, MAX_VERTICES
from cltrace.formats.faults import FatalError, Messages, quoted, short
from cltrace.formats.files import chunks
from cltrace.formats.schema import is_plain_zero, number
from cltrace.scene import ANY, Geometry

# Bytes of a block, and of a line with all that continues it at most.
BLOCK_BYTES, MAX_LINE = 2**20, 2**22
# Bytes that no text has.
CONTROLS = bytes(set(range(32)) - set(b"\t\n\v\f\r"))
MAX_KEYWORD = 200  # bytes of an unknown keyword in a message
MAX_DOUBTS = 10_000  # triangles whose area is asked of exact arithmetic

KEYWORDS = (b"v", b"vt", b"vn", b"f")
READ_OR_IGNORED = {b"", *KEYWORDS, b"o", b"g", b"s", b"usemtl", b"mtllib", b"l", b"p", b"vp"}
_V, _VT, _VN, _F = range(len(KEYWORDS))
_LABELS = ("vertex", "texture coordinate", "normal", "face")
# The numbers of a line by how many there are, and how many of them are kept.
_NAMES = {_V: {3: "xyz", 4: "xyzw", 6: "xyzrgb"}, _VT: {1: "u", 2: "uv", 3: "uvw"}, _VN: {3: "xyz"}}
_COUNTS = ("3, 4 or 6", "1, 2 or 3", "3")
_WIDTH = {_V: 3, _VT: 2, _VN: 3}
_CORNER = re.compile(rb"([-+]?[0-9]+)(?:/([-+]?[0-9]+)?)?(?:/([-+]?[0-9]+)?)?")
# The indices of a corner by what is left of it without digits and signs, where a NUL stands for "//".
_FORMS = {b"": [_V], b"/": [_V, _VT], b"\0": [_V, _VN], b"//": [_V, _VT, _VN]}
_STRAY_SIGN = re.compile(rb"[-+](?:(?<=[0-9][-+])|(?![0-9]))")  # which begins no number
_SLASHES, _TABS = bytes.maketrans(b"/\0", b"  "), bytes.maketrans(b"\t\v\f", b"   ")  # which become blanks
_LARGEST = 2**31 - 1

Doubles = NDArray[np.float64]
Indices = NDArray[np.int32]
Integers = NDArray[np.int64]
Result = TypeVar("Result")


@dataclass(frozen=True)
class Obj:
    """What an OBJ file holds.

    lines: (f,), of each triangle's face; warnings: in line order; unmapped: those about faces without texture
    coordinates, which matter to textures.
    """

    geometry: Geometry
    lines: Indices
    warnings: list[Fault]
    unmapped: list[Fault]


class _Block(NamedTuple):
    """Some lines of a file: arguments[i] is what follows the keyword of line number + i."""

    number: int
    arguments: list[bytes]


class _Triangles(NamedTuple):
    """t triangles of faces: their lines, (t,), and their corners' indices from 0.

    indices: (3, t, 3), of vertices, texture coordinates and normals; -1 for none.
    """

    lines: Indices
    indices: Indices


class _ObjReader:
    """One pass over a file: what it holds so far, and what is wrong with it."""

    def __init__(self) -> None:
        self.faults, self.warnings, self.unmapped = Messages(), Messages(), Messages()
        self._rows: dict[int, list[Doubles]] = {kind: [np.zeros((0, width))] for kind, width in _WIDTH.items()}
        self._count = [0, 0, 0]  # of vertices, texture coordinates and normals
        self._faces = [_Triangles(np.zeros(0, np.int32), np.zeros((3, 0, 3), np.int32))]
        self._triangles = self._unknown_keywords = 0

    def _fault(self, line: int, message: str) -> None:
        self.faults.add(line, message)
        self._check_count(line, self.faults.count, "faults")

    def _check_count(self, line: int, count: int, what: str) -> None:
        if count > MAX_FAULTS:
            raise FatalError(line, f"more than {MAX_FAULTS} {what}, the rest is not read")

    def read(self, number: int, text: bytes) -> None:
        """Reads the next lines of _blocks(), of which the first has this number."""
        block = _Block(number, [])
        lines: dict[bytes, list[int]] = defaultdict(list)
        for i, line in enumerate(text.split(b"\n")):
            keyword, _, rest = line.partition(b" ")
            block.arguments.append(rest)
            lines[keyword].append(i)
        for keyword in [keyword for keyword in lines if keyword not in READ_OR_IGNORED]:
            shown = quoted(keyword[:MAX_KEYWORD].decode("utf-8", "replace"))
            self.warnings.add_all(number + np.array(lines[keyword]), f"unknown keyword {shown} ignored")
            self._unknown_keywords += 1
            self._check_count(number + lines[keyword][0], self._unknown_keywords, "unknown keywords")
        before = np.zeros((3, len(block.arguments)), np.int64)  # how many of each kind come before the line of a face
        faces = lines[KEYWORDS[_F]]
        for kind in _NAMES:
            which = lines[KEYWORDS[kind]]
            before[kind, faces] = self._count[kind] + np.searchsorted(which, faces)
            self._count[kind] += len(which)
            if self._count[kind] > MAX_VERTICES:
                raise FatalError(number + which[-1], f"{_LABELS[kind]}: must not be one of more than {MAX_VERTICES}")
            some, one = partial(self._numbers, kind, block), partial(self._numbers_of_line, kind, block)
            self._rows[kind] += _parts(which, some, one)
        together, alone = partial(self._corners, block, before), partial(self._corners_of_line, block, before)
        for found in _parts(faces, together, alone):
            self._faces.append(found)
            self._triangles += len(found.lines)
            if self._triangles > MAX_TRIANGLES:
                raise FatalError(int(found.lines[-1]), f"face: must not be one of more than {MAX_TRIANGLES} triangles")

    def _numbers(self, kind: int, block: _Block, which: list[int]) -> Doubles | None:
        """The numbers of lines, (n, 2 or 3); None if one of them is not as it should be."""
        lines = [block.arguments[i] for i in which]
        widths, text = np.array([line.count(b" ") + 1 for line in lines]), b" ".join(lines)
        values = _numbers_in(text, np.float64)
        # numpy takes some words for two numbers, such as 1-2, but never less than one for a word.
        if not all(lines) or not np.isin(widths, [*_NAMES[kind]]).all():
            return None
        if values is None or len(values) != widths.sum() or not ANY.admits(values).all():
            return None
        # A number vanishes to 0 only with an exponent, or behind hundreds of zeros.
        if b"e" in text or b"E" in text or b"0" * 300 in text:
            words = text.split()
            if not all(is_plain_zero(words[i].decode()) for i in np.flatnonzero(values == 0).tolist()):
                return None
        first, k = np.cumsum(widths) - widths, np.arange(_WIDTH[kind])
        if kind == _V and widths.max() > 3:
            numbers, four = block.number + np.array(which), np.flatnonzero(widths == 4)
            self.warnings.add_all(numbers[four[values[first[four] + 3] != 1]], "vertex: weight w ignored")
            self.warnings.add_all(numbers[widths == 6], "vertex: colour ignored")
        # What is missing at the end of a row is the 0 behind all values. The sum makes -0 a 0.
        return np.append(values, 0.0)[np.where(k < widths[:, None], first[:, None] + k, len(values))] + 0.0

    def _numbers_of_line(self, kind: int, block: _Block, i: int) -> Doubles:
        """Reports the faults of one line, which has a row all the same, so that later indices stay right."""
        line, words = block.number + i, block.arguments[i].split()
        names = _NAMES[kind].get(len(words))
        if names is None:
            self._fault(line, f"{_LABELS[kind]}: must be {_COUNTS[kind]} numbers, got {len(words)}")
        for name, word in zip(names or "", words, strict=False):
            try:
                number(ANY, word.decode("utf-8", "replace"))
            except ValueError as error:
                self._fault(line, f"{_LABELS[kind]}: {name} {error}")
        return np.zeros((1, _WIDTH[kind]))

    def _corners(self, block: _Block, before: Integers, which: list[int]) -> _Triangles | None:
        """The triangles of faces; None if one of these is not as it should be. before: see _placed()."""
        text = b"\n".join([block.arguments[i] for i in which]).replace(b"//", b"\0")
        # numpy would take 1-2 for two numbers, and - 1 for one.
        if (b"-" in text or b"+" in text) and _STRAY_SIGN.search(text):
            return None
        alike: dict[bytes, list[int]] = defaultdict(list)
        for k, layout in enumerate(text.translate(None, b"+-0123456789").split(b"\n")):
            alike[layout].append(k)
        lines = text.split(b"\n") if len(alike) > 1 else []
        parts, at = [], np.array(which)
        for layout, some in alike.items():
            corners = layout.split(b" ")
            form = _FORMS.get(corners[0], [])
            part = b" ".join([lines[k] for k in some]) if lines else text
            values, shape = _numbers_in(part.translate(_SLASHES), np.int64), (len(some), len(corners), len(form))
            if len(corners) < 3 or len(set(corners)) > 1 or values is None or len(values) != np.prod(shape):
                return None
            written = np.zeros((*shape[:2], 3), np.int64)
            written[:, :, form] = values.reshape(shape)
            found = _placed(written, before[:, at[some]].T, block.number + at[some])
            if not values.all() or found is None:
                return None
            parts.append(found)
        of_line, indices = np.concatenate([p.lines for p in parts]), np.concatenate([p.indices for p in parts], axis=1)
        order = np.argsort(of_line, kind="stable")
        return _Triangles(of_line[order], indices[:, order])

    def _corners_of_line(self, block: _Block, before: Integers, i: int) -> _Triangles | None:
        """The triangles of one face; None if it has faults, which are told."""
        line, words = block.number + i, block.arguments[i].split()
        said = self.faults.count
        if len(words) < 3:
            self._fault(line, f"face: must have at least 3 corners, got {len(words)}")
        written = np.zeros((1, len(words), 3), np.int64)
        for k, word in enumerate(words):
            match = _CORNER.fullmatch(word)
            if match is None:
                got = quoted(word.decode("utf-8", "replace"))
                self._fault(line, f"face: must have corners such as 1, 1/2, 1//3 and 1/2/3, got {got}")
            for kind, index in enumerate(match.groups() if match else ()):
                if index is not None:
                    written[0, k, kind] = self._index(line, kind, index.decode(), int(before[kind, i]))
        if said != self.faults.count:
            return None
        for kind in (_VT, _VN):
            if not written[0, :, kind].all() and written[0, :, kind].any():
                self.warnings.add(line, f"face: {_LABELS[kind]}s at some corners only, which are ignored")
                written[0, :, kind] = 0
        return _placed(written, before[:, i : i + 1].T, np.array([line]))

    def _index(self, line: int, kind: int, written: str, before: int) -> int:
        """An index as a number; 0, and a fault, if no file can have it. before: how many such there are so far."""
        value = float(written)  # int() refuses very long texts
        if value and -before <= value <= _LARGEST:
            return int(value)
        self._fault(line, f"face: {_LABELS[kind]} {short(written)} of {before} so far")
        return 0

    def result(self) -> Obj | None:
        """What the file holds, or None if it has faults."""
        lines = np.concatenate([some.lines for some in self._faces])
        indices = np.concatenate([some.indices for some in self._faces], axis=1)
        self._faces.clear()
        new_face = np.append(True, lines[1:] != lines[:-1])[: len(lines)]
        for kind in range(3):
            beyond = indices[kind] >= self._count[kind]
            beyond[~new_face, :2] = False  # corners that the triangle before has, too
            for t, k in np.argwhere(beyond).tolist():
                self._fault(int(lines[t]), f"face: {_LABELS[kind]} {indices[kind, t, k] + 1} of {self._count[kind]}")
        if not self.faults.count and not len(lines):
            raise FatalError(0, "has no faces")
        if self.faults.count:
            return None
        vertices, uv, normals = (np.concatenate(self._rows.pop(kind)) for kind in (_V, _VT, _VN))
        faces, uv_of, normal_of = indices
        geometry = Geometry(vertices, faces, normals=normals, normal_of=normal_of, uv=uv, uv_of=uv_of)
        self.warnings.add_all(lines[_flat(vertices, faces)], "face: a triangle without area, which is not seen")
        self.unmapped.add_all(
            lines[new_face & (uv_of[:, 0] < 0)],
            "face: has no texture coordinates, but its material has a texture, which is that of u = v = 0 all over",
        )
        return Obj(geometry, lines, self.warnings.in_order(), self.unmapped.in_order())


def _blocks(path: str) -> Iterator[tuple[int, bytes]]:
    """Whole lines of a file, without comments, and the number of the first one. Line feeds are their only ends.

    What continues a line is put into it, and empty lines in its place. Raises FatalError at what is no text, and at
    endless lines.
    """
    pieces = chunks(path, BLOCK_BYTES, "mesh-bytes")
    first = next(pieces)
    number, rest = 1, b""
    # The last line may lack its end, or have a backslash before it.
    for piece in chain([first.removeprefix(b"\xef\xbb\xbf")], pieces, [b"\n\n"]):
        text = rest + piece
        held = b"\r" if text.endswith(b"\r") else b""  # A line feed may follow.
        if b"\r" in text:
            text = text.removesuffix(held).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        plain = text.translate(_TABS, CONTROLS)
        if len(plain) < len(text):
            at = next(i for i, byte in enumerate(text) if byte in CONTROLS)
            raise FatalError(number + text.count(b"\n", 0, at), f"must be text, but has the byte 0x{text[at]:02x}")
        cut = plain.rfind(b"\n") + 1
        while cut > 1 and plain[cut - 2] == ord("\\"):
            cut = plain.rfind(b"\n", 0, cut - 1) + 1
        yield number, _plain_lines(plain[:cut])
        number, rest = number + plain.count(b"\n", 0, cut), plain[cut:] + held
        if len(rest) > MAX_LINE:
            raise FatalError(number, f"must not be a line of more than {MAX_LINE} bytes")


def _plain_lines(text: bytes) -> bytes:
    """The same lines without comments and needless blanks, each with what continues it and empty lines behind it."""
    if b"#" in text:
        text = re.sub(rb"#[^\n]*", b" ", text)
    if b"\\\n" in text:
        continued = re.compile(rb"^(?:[^\n]*\\\n)+[^\n]*", re.MULTILINE)
        text = continued.sub(lambda m: m[0].replace(b"\\\n", b" ") + b"\n" * m[0].count(b"\n"), text)
    while b"  " in text:
        text = text.replace(b"  ", b" ")
    return text.replace(b"\n ", b"\n").replace(b" \n", b"\n").strip(b" ")


def _numbers_in(text: bytes, dtype: DTypeLike) -> NDArray[Any] | None:
    """The numbers of a text, rounded right, integers beyond 63 bits as the largest; None if it holds anything else."""
    try:
        with warnings_are("error"):
            return np.fromstring(text, dtype, sep=" ")
    except (DeprecationWarning, ValueError):
        return None


def _parts(
    which: list[int], together: Callable[[list[int]], Result | None], alone: Callable[[int], Result | None]
) -> Iterator[Result]:
    """What `together` makes of all lines, or where it fails of their halves, or `alone` of single lines; in order."""
    rest = [which] if which else []
    while rest:
        part = rest.pop()
        result = together(part)
        if result is None and len(part) > 1:
            rest += [part[len(part) // 2 :], part[: len(part) // 2]]
            continue
        if result is None:
            result = alone(part[0])
        if result is not None:
            yield result


def _placed(written: Integers, before: Integers, lines: Integers) -> _Triangles | None:
    """The triangles of n faces with k corners each; None if an index is none.

    written: (n, k, 3), the indices as they are written, 0 for none; before: (n, 3), how many vertices, texture
    coordinates and normals come before each face in the file, from where what is negative counts back.
    """
    index = written - 1
    back = written < 0
    if back.any():
        index = np.where(back, before[:, None] + written, index)
    if written.max() > _LARGEST or (back & (index < 0)).any():
        return None
    corners = written.shape[1]
    fan = np.array([(0, k, k + 1) for k in range(1, corners - 1)])
    triangles = np.moveaxis(index.astype(np.int32)[:, fan].reshape(-1, 3, 3), 2, 0)
    return _Triangles(np.repeat(lines.astype(np.int32), corners - 2), np.ascontiguousarray(triangles))


def _flat(vertices: Doubles, faces: NDArray[np.int32]) -> Integers:
    """The numbers of the triangles that have no area at all, of those that are in doubt MAX_DOUBTS at most.

    Two corners that are one leave none. Otherwise, with u = 2^-53, a difference of coordinates is wrong by u of itself
    and a product of two by 4 u: where y1 z2 = z1 y2 exactly, the computed ones differ by less than 2^-50 of them.
    """
    none = np.zeros(len(faces), np.bool_)

    def look(rows: slice) -> Integers:
        maybe, corner = np.arange(rows.start, rows.stop), faces[rows]
        for i, j in ((0, 1), (1, 2), (2, 0)):
            a, b, c = (vertices.take(corner[:, k], axis=0) for k in range(3))
            p, q = ([corner_of[:, k] - a[:, k] for k in (i, j)] for corner_of in (b, c))
            left, right = p[0] * q[1], p[1] * q[0]
            alike = np.flatnonzero(np.abs(left - right) <= 2.0**-50 * np.abs(left))
            maybe, corner = maybe.take(alike), corner.take(alike, axis=0)
        a, b, c = (vertices.take(corner[:, k], axis=0) for k in range(3))
        one = ~((a != b).any(axis=1) & (b != c).any(axis=1) & (c != a).any(axis=1))
        none[maybe[one]] = True
        return maybe.take(np.flatnonzero(~one))

    doubtful = np.concatenate(blockwise(len(faces), look))
    for i in doubtful[:MAX_DOUBTS].tolist():
        begin, *ends = ([Fraction(x) for x in vertices[k].tolist()] for k in faces[i].tolist())
        v, w = ([x - y for x, y in zip(end, begin, strict=True)] for end in ends)
        none[i] = all(v[j] * w[k] == v[k] * w[j] for j, k in ((1, 2), (2, 0), (0, 1)))
    return np.flatnonzero(none)


def read_obj(path: str) -> Obj:
    """What an OBJ file holds. Raises SceneError with all its faults, and UnreadableError where it cannot be read."""
    keep_freed_memory()
    reader, found = _ObjReader(), None
    try:
        for number, text in _blocks(path):
            reader.read(number, text)
        found = reader.result()
    except FatalError as fatal:
        reader.faults.add(*fatal.args)
    if found is None:
        raise SceneError(path, reader.faults.in_order())
    return found
