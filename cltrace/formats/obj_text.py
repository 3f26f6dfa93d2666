"""An OBJ file as blocks of lines: comments and continuations gone, and each line's keyword known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.formats.faults import FatalError

Bytes = NDArray[np.uint8]
Places = NDArray[np.int64]

# Bytes of a block, and of a line with all that continues it at most. The arrays for a block then stay in the caches.
BLOCK_BYTES, LINE = 2**20, 2**22
LINE_FEED, BLANK, HASH, BACKSLASH = b"\n #\\"
# What no text has. All bytes up to a blank count as one, so that a keyword behind another of them would be missed.
CONTROLS = bytes(set(range(BLANK)) - set(b"\t\n\v\f\r"))
# The kinds of lines that are read, by their keywords.
KINDS = ("v", "vt", "vn", "f")
IGNORED = ("o", "g", "s", "usemtl", "mtllib", "l", "p", "vp")
_SHORT = 8  # letters of a keyword by which lines are put together
_END = b"\n" * 8  # more than the letters of any of these


@dataclass(frozen=True)
class Block:
    """Some lines of a file.

    text: bytes that end in some line feeds; lines: (n, 2), where each line's first character that is not blank stands,
    and its line feed; number: (n,), of its first line in the file; kind: (n,), the index of its keyword among
    KINDS, -1 for a line that says nothing and -2 for one with another keyword.
    """

    text: Bytes
    lines: Places
    number: Places
    kind: NDArray[np.int8]

    def line(self, i: int) -> bytes:
        """The text of a line, from its keyword on."""
        return self.text[self.lines[i, 0] : self.lines[i, 1]].tobytes()

    def arguments(self, which: NDArray[np.intp]) -> tuple[Bytes, Places]:
        """What follows the keywords in these lines, each with its line feed, and where those stand; blank before."""
        low, high = which[0], which[-1] + 1
        start = self.lines[low - 1, 1] + 1 if low else 0
        text = self.text[start : self.lines[high - 1, 1] + 1]
        if len(which) == high - low:
            text, shift = text.copy(), np.full(len(which), start)
        else:
            sizes = np.diff(self.lines[low:high, 1], prepend=start - 1)
            keep = np.zeros(len(sizes), np.bool_)
            keep[which - low] = True
            text = text[np.repeat(keep, sizes)]
            shift = self.lines[which, 1] + 1 - np.cumsum(sizes[keep])
        feeds, begin = self.lines[which, 1] - shift, self.lines[which, 0] - shift
        text[begin] = BLANK
        second = text[begin + 1] > BLANK
        text[begin[second] + 1] = BLANK
        return text, feeds


def blocks(pieces: Iterator[bytes]) -> Iterator[Block]:
    """The lines of a file that comes in pieces. Raises FatalError at what is no text, and at endless lines."""
    rest, number = b"", 1
    for piece in _plain(pieces):
        rest += piece
        if len(piece.translate(None, CONTROLS)) < len(piece):
            at = next(i for i, byte in enumerate(rest) if byte in CONTROLS)
            raise FatalError(number + rest.count(b"\n", 0, at), f"must be text, but has the byte 0x{rest[at]:02x}")
        cut = _complete(rest)
        if cut:
            block, lines = _block(rest[:cut], number)
            yield block
            number += lines
            rest = rest[cut:]
        if len(rest) > LINE:
            raise FatalError(number, f"must not be a line of more than {LINE} bytes")
    if rest:
        yield _block(rest + b"\n", number)[0]


def _plain(pieces: Iterator[bytes]) -> Iterator[bytes]:
    """The same with line feeds as the only ends of lines, and without a byte order mark."""
    held, first = b"", True
    for piece in pieces:
        piece = held + piece
        if first and piece.startswith(b"\xef\xbb\xbf"):
            piece = piece[3:]
        first = False
        held = b"\r" if piece.endswith(b"\r") else b""
        if b"\r" in piece:
            piece = piece[: len(piece) - len(held)].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        yield piece
    if held:
        yield b"\n"


def _complete(text: bytes) -> int:
    """The length of the whole lines at the beginning of a text; a line that is continued is not whole yet."""
    cut = text.rfind(b"\n") + 1
    while cut > 1 and text[cut - 2] == BACKSLASH:
        cut = text.rfind(b"\n", 0, cut - 1) + 1
    return cut


def _block(data: bytes, number: int) -> tuple[Block, int]:
    """Whole lines, of which the first has this number, as a block, and how many of them the file has."""
    text = np.frombuffer(data + _END, np.uint8)
    feeds = np.flatnonzero(text[: len(data)] == LINE_FEED)
    count = len(feeds)
    numbers = number + np.arange(count)
    if b"#" in data or b"\\" in data:
        text = text.copy()
        _blank_comments(text, feeds)
        # A line feed behind a backslash ends no line; the one at the end of the file does.
        joined = (text[feeds - 1] == BACKSLASH) & (feeds > 0)
        text[feeds[joined] - 1] = BLANK
        joined[-1] = False
        text[feeds[joined]] = BLANK
        numbers = numbers[~np.concatenate([[False], joined[:-1]])]
        feeds = feeds[~joined]
    first = np.concatenate([[0], feeds[:-1] + 1])
    indented = np.flatnonzero((text[first] <= BLANK) & (first < feeds))
    if len(indented):
        solid = np.append(np.flatnonzero(text > BLANK), len(data))
        first[indented] = np.minimum(solid[np.searchsorted(solid, first[indented])], feeds[indented])
    return Block(text, np.stack([first, feeds], axis=1), numbers, _kinds(text, first, feeds)), count


def _blank_comments(text: Bytes, feeds: Places) -> None:
    """Comments end with their line, also where a backslash is the last of it."""
    hashes = np.flatnonzero(text == HASH)
    if len(hashes):
        ends = feeds[np.searchsorted(feeds, hashes)]
        change = np.zeros(len(text), np.int8)
        change[ends] = -1
        change[hashes[np.concatenate([[True], ends[1:] != ends[:-1]])]] = 1
        text[np.cumsum(change, dtype=np.int8) > 0] = BLANK


def _kinds(text: Bytes, first: Places, feeds: Places) -> NDArray[np.int8]:
    kind = np.full(len(first), -2, np.int8)
    kind[first == feeds] = -1
    for i, keyword in enumerate(KINDS):
        kind[_begins(text, first, keyword)] = i
    rest = np.flatnonzero(kind == -2)
    for keyword in IGNORED if len(rest) else ():
        kind[rest[_begins(text, first[rest], keyword)]] = -1
    return kind


def _begins(text: Bytes, first: Places, keyword: str) -> NDArray[np.bool_]:
    found: NDArray[np.bool_] = text[first + len(keyword)] <= BLANK
    for k, letter in enumerate(keyword.encode()):
        found &= text[first + k] == letter
    return found


def unread(block: Block) -> Iterator[tuple[Places, str]]:
    """The lines whose keyword is unknown: their numbers, together where the keyword is the same, and the keyword."""
    lines = np.flatnonzero(block.kind == -2)
    if not len(lines):
        return
    first, feeds = block.lines[lines].T
    place = np.minimum(first[:, None] + np.arange(_SHORT), feeds[:, None])
    letters = block.text[place]
    letters[np.logical_or.accumulate(letters <= BLANK, axis=1)] = BLANK
    long = letters[:, -1] > BLANK
    _, which = np.unique(letters.view(f"V{_SHORT}").ravel(), return_inverse=True)
    order = np.argsort(which, kind="stable")
    for same in np.split(order, np.flatnonzero(np.diff(which[order])) + 1):
        for some in np.split(same, len(same)) if long[same[0]] else [same]:
            begin, end = first[some[0]], feeds[some[0]]
            word: Any = block.text[begin : min(end, begin + 200)].tobytes().split(None, 1)[0]
            yield block.number[lines[some]], word.decode("utf-8", "replace")
