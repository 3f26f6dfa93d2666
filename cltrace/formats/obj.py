"""Reads an OBJ file into a `Geometry`, or says everything that is wrong with it.

The lines of a block that begin with the same keyword are converted together (`obj_numbers`). Where that does not work,
halves of them are, and in the end single lines, whose messages are worded here. Both ways give the same numbers.

Vertices (v), texture coordinates (vt), normals (vn) and faces (f) are read; they may come in any order. Free-form
curves and surfaces are not.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise, keep_freed_memory
from cltrace.base.errors import Fault, SceneError
from cltrace.base.limits import MAX_FAULTS, MAX_TRIANGLES, MAX_VERTICES
from cltrace.formats.faults import FatalError, Messages
from cltrace.formats.files import chunks
from cltrace.formats.obj_numbers import Doubles, FaceCorners, Integers, corners, counts, decimals, word_ends
from cltrace.formats.obj_text import BLOCK_BYTES, KINDS, Block, blocks, unread
from cltrace.formats.xml_values import number, quoted, short
from cltrace.scene import ANY, Geometry

MAX_DOUBTS = 10_000  # triangles whose area is asked of exact arithmetic
ONE_BY_ONE = 16  # lines that are read one by one where they cannot be together

_V, _VT, _VN, _F = range(len(KINDS))
_LABELS = ("vertex", "texture coordinate", "normal", "face")
# The numbers of a line by how many there are, and how many of them are kept.
_NAMES = {_V: {3: "xyz", 4: "xyzw", 6: "xyzrgb"}, _VT: {1: "u", 2: "uv", 3: "uvw"}, _VN: {3: "xyz"}}
_WIDTH = {_V: 3, _VT: 2, _VN: 3}
_CORNER = re.compile(rb"([-+]?[0-9]+)(?:/([-+]?[0-9]+)?)?(?:/([-+]?[0-9]+)?)?")
_LARGEST = 2**31 - 1
_WEIGHT, _COLOUR = "vertex: weight w ignored", "vertex: colour ignored"

Lines = NDArray[np.intp]  # indices of lines in a block
Result = TypeVar("Result")


@dataclass(frozen=True)
class Obj:
    """What an OBJ file holds.

    lines: (f,), of each triangle's face; warnings: in line order; unmapped: those about faces without texture
    coordinates, which matter to textures.
    """

    geometry: Geometry
    lines: NDArray[np.int32]
    warnings: list[Fault]
    unmapped: list[Fault]


class _Faces(NamedTuple):
    """Faces with c corners in all: their lines and how many corners each has, both (f,), and the corners' indices.

    indices: (3, c), of vertex, texture coordinate and normal from 0; -1 for none.
    """

    lines: NDArray[np.int32]
    sizes: NDArray[np.int32]
    indices: NDArray[np.int32]


class _Reader:
    """One pass over a file: what it holds so far, and what is wrong with it."""

    def __init__(self) -> None:
        self.faults, self.warnings, self.unmapped = Messages(), Messages(), Messages()
        self._rows: dict[int, list[Doubles]] = {kind: [np.zeros((0, width))] for kind, width in _WIDTH.items()}
        self._count = [0, 0, 0]  # of vertices, texture coordinates and normals
        none = np.zeros(0, np.int32)
        self._faces = [_Faces(none, none, np.zeros((3, 0), np.int32))]
        self._triangles = 0
        self._strange = 0  # unknown keywords
        self._nowhere: list[tuple[int, int, str]] = []  # indices that no file has: line, kind, as written

    def run(self, path: str) -> Obj | None:
        """What the file holds, or None if it has faults. Raises UnreadableError."""
        try:
            empty = True
            for block in blocks(chunks(path, BLOCK_BYTES, "mesh-bytes")):
                self._take(block)
                empty = False
            if empty:
                raise FatalError(0, "is empty")
            return self._result()
        except FatalError as fatal:
            self.faults.add(*fatal.args)
            return None

    def _fault(self, line: int, message: str) -> None:
        self.faults.add(line, message)
        if self.faults.count > MAX_FAULTS:
            raise FatalError(line, f"more than {MAX_FAULTS} faults, the rest is not read")

    # Lines

    def _take(self, block: Block) -> None:
        for numbers, keyword in unread(block):
            self.warnings.add_all(numbers, f"unknown keyword {quoted(keyword)} ignored")
            self._strange += 1
            if self._strange > MAX_FAULTS:
                raise FatalError(int(numbers[0]), f"more than {MAX_FAULTS} unknown keywords, the rest is not read")
        lines = [np.flatnonzero(block.kind == kind) for kind in range(len(KINDS))]
        counts_at = np.zeros((3, len(block.kind)), np.int64)  # how many of each kind come before a face's line
        for kind in _NAMES:
            counts_at[kind, lines[_F]] = self._count[kind] + np.searchsorted(lines[kind], lines[_F])
            self._take_numbers(kind, block, lines[kind])
        self._take_faces(counts_at, block, lines[_F])

    def _take_numbers(self, kind: int, block: Block, which: Lines) -> None:
        self._count[kind] += len(which)
        if self._count[kind] > MAX_VERTICES:
            last = int(block.number[which[-1]])
            raise FatalError(last, f"{_LABELS[kind]}: must not be one of more than {MAX_VERTICES}")
        together, alone = functools.partial(self._numbers, kind), functools.partial(self._numbers_of_line, kind)
        self._rows[kind] += _parts(block, which, together, alone)

    def _take_faces(self, counts_at: Integers, block: Block, which: Lines) -> None:
        together, alone = (functools.partial(f, counts_at) for f in (self._corners, self._corners_of_line))
        for faces in _parts(block, which, together, alone):
            self._faces.append(faces)
            self._triangles += int(faces.sizes.sum()) - 2 * len(faces.sizes)
            if self._triangles > MAX_TRIANGLES:
                raise FatalError(int(faces.lines[-1]), f"face: must not be one of more than {MAX_TRIANGLES} triangles")

    def _numbers(self, kind: int, block: Block, which: Lines) -> Doubles | None:
        """The numbers of lines, (n, 2 or 3); None if one of them is not as it should be."""
        text, feeds = block.arguments(which)
        ends = word_ends(text)
        sizes = counts(ends, feeds)
        known = np.isin(sizes, list(_NAMES[kind]))
        if not known.all():
            return None
        values = decimals(text, ends)
        if values is None or not ANY.admits(values).all():
            return None
        first, k = np.cumsum(sizes) - sizes, np.arange(_WIDTH[kind])
        rows: Doubles = np.append(values, 0.0)[np.where(k < sizes[:, None], first[:, None] + k, len(values))]
        if kind == _V and sizes.max() > 3:
            four = np.flatnonzero(sizes == 4)
            self.warnings.add_all(block.number[which[four[values[first[four] + 3] != 1]]], _WEIGHT)
            self.warnings.add_all(block.number[which[sizes == 6]], _COLOUR)
        return rows

    def _numbers_of_line(self, kind: int, block: Block, i: int) -> Doubles:
        """The same of one line; has its faults told. There is a row in any case, for the others' indices."""
        line, words = int(block.number[i]), block.line(i).split()[1:]
        names = _NAMES[kind].get(len(words))
        row = np.zeros(_WIDTH[kind])
        if names is None:
            *some, last = map(str, _NAMES[kind])
            wanted = f"{', '.join(some)} or {last}" if some else last
            self._fault(line, f"{_LABELS[kind]}: must be {wanted} numbers, got {len(words)}")
            return row[None]
        values = np.zeros(len(words))
        for k, (name, word) in enumerate(zip(names, words, strict=True)):
            try:
                values[k] = number(ANY, word.decode("utf-8", "replace"))
            except ValueError as error:
                self._fault(line, f"{_LABELS[kind]}: {name} {error}")
        if kind == _V and (len(words) == 6 or (len(words) == 4 and values[3] != 1)):
            self.warnings.add(line, _COLOUR if len(words) == 6 else _WEIGHT)
        row[: len(values)] = values[: len(row)]
        return row[None]

    def _corners(self, counts_at: Integers, block: Block, which: Lines) -> _Faces | None:
        """The faces of lines; None if one of them is not as it should be. counts_at: see `_placed`."""
        found = corners(*block.arguments(which))
        if found is None or np.abs(found.indices).max() > _LARGEST:
            return None
        index = _placed(found, counts_at[:, which])
        if ((found.indices < 0) & (index < 0)).any():
            return None
        for kind in (_VT, _VN):
            self._drop_incomplete(kind, index[kind], found.sizes, block.number[which])
        return _Faces(block.number[which].astype(np.int32), found.sizes.astype(np.int32), index.astype(np.int32))

    def _drop_incomplete(self, kind: int, index: Integers, sizes: Integers, lines: Integers) -> None:
        """Takes the indices from faces that have some at some of their corners only."""
        if (index >= 0).all() or (index < 0).all():
            return
        first = np.cumsum(sizes) - sizes
        some = (np.minimum.reduceat(index, first) < 0) & (np.maximum.reduceat(index, first) >= 0)
        index[np.repeat(some, sizes)] = -1
        self.warnings.add_all(lines[some], f"face: {_LABELS[kind]}s at some corners only, which are ignored")

    def _corners_of_line(self, counts_at: Integers, block: Block, i: int) -> _Faces | None:
        """The face of one line; None if it has faults, which are told."""
        line, words = int(block.number[i]), block.line(i).split()[1:]
        before = self.faults.count, len(self._nowhere)
        if len(words) < 3:
            self._fault(line, f"face: must have at least 3 corners, got {len(words)}")
        for word in words:
            match = _CORNER.fullmatch(word)
            if match is None:
                got = quoted(word.decode("utf-8", "replace"))
                self._fault(line, f"face: must have corners such as 1, 1/2, 1//3 and 1/2/3, got {got}")
                continue
            for kind, written in enumerate(match.groups()):
                if written is not None:
                    self._check_index(line, kind, written, int(counts_at[kind, i]))
        if before != (self.faults.count, len(self._nowhere)):
            return None
        return self._corners(counts_at, block, np.array([i]))

    def _check_index(self, line: int, kind: int, written: bytes, count: int) -> None:
        # float() takes numbers of any length.
        value, text = float(written), short(written.decode())
        if value == 0 or value > _LARGEST:
            self._nowhere.append((line, kind, text))
            if len(self._nowhere) > MAX_FAULTS:
                raise FatalError(line, f"more than {MAX_FAULTS} faults, the rest is not read")
        elif value < -count:
            self._fault(line, f"face: {_LABELS[kind]} {text} of {count} so far")

    # The whole

    def _result(self) -> Obj | None:
        lines, sizes = (np.concatenate([getattr(faces, name) for faces in self._faces]) for name in ("lines", "sizes"))
        index = np.concatenate([faces.indices for faces in self._faces], axis=1)
        self._faces.clear()
        for line, kind, text in self._nowhere:
            self._fault(line, f"face: {_LABELS[kind]} {text} of {self._count[kind]}")
        for kind in range(3):
            beyond = np.flatnonzero(index[kind] >= self._count[kind])
            face = np.searchsorted(np.cumsum(sizes), beyond, "right")
            for line, wrong in zip(lines[face].tolist(), index[kind, beyond].tolist(), strict=True):
                self._fault(line, f"face: {_LABELS[kind]} {wrong + 1} of {self._count[kind]}")
        if not self.faults.count and not len(lines):
            raise FatalError(0, "has no faces")
        if self.faults.count:
            return None
        vertices, uv, normals = (np.concatenate(self._rows.pop(kind)) for kind in (_V, _VT, _VN))
        faces, uv_of, normal_of = _fans(sizes, index)
        geometry = Geometry(vertices, faces, normals=normals, normal_of=normal_of, uv=uv, uv_of=uv_of)
        line_of = np.repeat(lines, sizes - 2)
        self.warnings.add_all(line_of[_flat(vertices, faces)], "face: a triangle without area, which is not seen")
        self.unmapped.add_all(
            lines[index[_VT, np.cumsum(sizes) - 1] < 0],
            "face: has no texture coordinates, but its material has a texture, which is that of u = v = 0 all over",
        )
        return Obj(geometry, line_of, self.warnings.in_order(), self.unmapped.in_order())


def _parts(
    block: Block,
    which: Lines,
    together: Callable[[Block, Lines], Result | None],
    alone: Callable[[Block, int], Result | None],
) -> Iterator[Result]:
    """What `together` makes of lines, in order: of all, or else of parts, or what `alone` makes of each."""
    rest = [which] if len(which) else []
    while rest:
        part = rest.pop()
        result = together(block, part)
        if result is not None:
            yield result
        elif len(part) > ONE_BY_ONE:
            rest += [part[len(part) // 2 :], part[: len(part) // 2]]
        else:
            yield from filter(lambda one: one is not None, (alone(block, i) for i in part.tolist()))


def _placed(found: FaceCorners, counts_at: Integers) -> Integers:
    """The corners' indices from 0, (3, c), and -1 for none; what counts back beyond the first is below 0.

    counts_at: (3, f), how many vertices, texture coordinates and normals come before each face in the file.
    """
    written = found.indices
    index = written - (written > 0)
    if (written <= 0).any():
        index += np.where(written < 0, np.repeat(counts_at, found.sizes, axis=1), 0) - (written == 0)
    return index


def _fans(sizes: NDArray[np.int32], indices: NDArray[np.int32]) -> list[NDArray[np.int32]]:
    """Each row of indices, (3, c), as triangles, (t, 3): a face's first corner, and two that follow each other."""
    if (sizes == 3).all():
        return [row.reshape(-1, 3) for row in indices]
    begin = np.repeat(np.cumsum(sizes, dtype=np.int64) - sizes, sizes - 2)
    triangles = np.cumsum(sizes - 2, dtype=np.int64)
    k = np.arange(len(begin)) - np.repeat(triangles - (sizes - 2), sizes - 2)
    corner = np.stack([begin, begin + k + 1, begin + k + 2], axis=1)
    return [row[corner] for row in indices]


def _flat(vertices: Doubles, faces: NDArray[np.int32]) -> Integers:
    """The numbers of the triangles that have no area at all, of those that are in doubt MAX_DOUBTS at most.

    Two corners that are one leave none. Otherwise, with u = 2^-53, a difference of coordinates is wrong by u of itself
    and a product of two by 4 u: where y1 z2 = z1 y2 exactly, the computed ones differ by less than 2^-50 of them.
    """
    none = np.zeros(len(faces), np.bool_)

    def look(rows: slice) -> list[int]:
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
        rest: list[int] = maybe[~one].tolist()
        return rest

    doubtful = list(chain.from_iterable(blockwise(len(faces), look)))
    for i in doubtful[:MAX_DOUBTS]:
        begin, *ends = ([Fraction(x) for x in vertices[k].tolist()] for k in faces[i].tolist())
        v, w = ([x - y for x, y in zip(end, begin, strict=True)] for end in ends)
        none[i] = all(v[j] * w[k] == v[k] * w[j] for j, k in ((1, 2), (2, 0), (0, 1)))
    return np.flatnonzero(none)


def read_obj(path: str) -> Obj:
    """What an OBJ file holds. Raises SceneError with all its faults, and UnreadableError where it cannot be read."""
    keep_freed_memory()
    reader = _Reader()
    found = reader.run(path)
    if found is None:
        raise SceneError(path, reader.faults.in_order())
    return found
