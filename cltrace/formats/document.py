"""A scene file as a tree that grows: its bytes are fed to the parser, and each element has its line.

The file may come from a stranger. Nothing is fetched, no entity is expanded, and what declares entities, is no scene or
is too large is refused.
"""

from __future__ import annotations

import codecs
import itertools
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from lxml import etree

from cltrace.base.errors import Fault
from cltrace.base.limits import MAX_NAMESPACE, MAX_PREFIXES
from cltrace.formats.faults import FatalError, short
from cltrace.formats.files import UnreadableError, chunks, hint_beside

# Bytes that are fed at once, and of the prologue at most. The tree of a larger chunk no longer fits the CPU's cache.
CHUNK, HEAD = 2**17, 2**16
LAST_LINE = 65_535  # libxml2 keeps the line of an element in 16 bits; this one means "here or later"

PARSER_OPTIONS: Mapping[str, Any] = {
    "resolve_entities": False,
    "no_network": True,
    "load_dtd": False,
    "huge_tree": False,
    "remove_comments": True,
    "remove_pis": True,
}
# Up to the first '>' and the rest of its line. Every tag that ends in a piece ends on the line of that '>'.
_PIECE = re.compile(rb"[^>]*>[^\n]*\n?|[^>]+")
# The declaration of an entity, and what may hold the same letters without being one.
_ENTITY = re.compile(r"""<!--(?:.*?-->|.*)|<\?(?:.*?\?>|.*)|"[^"]*"?|'[^']*'?|(<!ENTITY)""", re.DOTALL)


class LinesNeededError(Exception):
    """A message is about a line whose number libxml2 does not keep."""


class Document:
    """One pass of the parser over a file.

    root: the element <scene>, once it has begun; malformed: what is wrong where the file is not well-formed XML.
    `exact` feeds the file line by line, in twice the time, and then knows the line of every element.
    """

    def __init__(self, path: str, exact: bool) -> None:
        self.root: etree._Element | None = None
        self.malformed: Fault | None = None
        self._path, self._exact = path, exact
        self._line = 1  # of the next byte to be fed
        self._prefixes: set[str] = set()
        self._lines: dict[etree._Element, int] = {}  # of the elements in the tree, where `exact`

    def grow(self) -> Iterator[None]:
        """Feeds the file, and stops after each chunk, for the caller to drop what is complete; FatalError."""
        pieces = _chunks(self._path)
        first = next(pieces, b"")
        check_prologue(first)
        pieces, encoding = itertools.chain([first], pieces), None
        if self._exact and (wide := _wide(first)):
            # Lines are counted, and tags are told apart, by single bytes.
            pieces, encoding = _as_utf8(pieces, wide), "utf-8"
        self._parser: Any = etree.XMLPullParser(
            events=("start", "start-ns"), tag=None if self._exact else "scene", encoding=encoding, **PARSER_OPTIONS
        )
        for chunk in pieces:
            self._feed(chunk)
            if self.malformed:
                return
            yield
        with suppress(etree.XMLSyntaxError):
            self._parser.close()
        self._note_elements()
        self._note_errors()

    def line_of(self, element: etree._Element) -> int:
        """The line on which the start tag of an element ends; LinesNeededError if that is not known."""
        if self._exact:
            return self._lines[element]
        line: Any = element.sourceline
        if line >= LAST_LINE:
            raise LinesNeededError
        return int(line)

    def line_if_known(self, element: etree._Element) -> int:
        """The same; 0 if it is not known."""
        try:
            return self.line_of(element)
        except LinesNeededError:
            return 0

    def forget_dropped(self) -> None:
        """Forgets the lines of the elements that have been dropped from the tree."""
        if self._exact and self.root is not None:
            self._lines = {element: self._lines[element] for element in self.root.iter("*")}

    def _feed(self, chunk: bytes) -> None:
        with suppress(etree.XMLSyntaxError):  # The parser's log has it too, and more.
            for piece in _PIECE.findall(chunk) if self._exact else [chunk]:
                before, _, behind = piece.partition(b">")
                self._line += before.count(b"\n")
                self._parser.feed(piece)
                self._note_elements()
                self._line += behind.count(b"\n")
        self._note_elements()
        self._note_errors()

    def _note_elements(self) -> None:
        for event, element in self._parser.read_events():
            if event == "start-ns":
                self._check_namespace(*element)
                continue
            if self.root is None:
                self.root = element
            if self._exact:
                self._lines[element] = self._line

    def _check_namespace(self, prefix: str, namespace: str) -> None:
        self._prefixes.add(prefix)
        if len(self._prefixes) <= MAX_PREFIXES and len(namespace) <= MAX_NAMESPACE:
            return
        if not self._exact:
            raise LinesNeededError
        long = len(namespace) > MAX_NAMESPACE
        what = (
            f"a namespace of more than {MAX_NAMESPACE} characters" if long else f"more than {MAX_PREFIXES} namespaces"
        )
        raise FatalError(self._line, f"must not declare {what}")

    def _note_errors(self) -> None:
        # Whatever is logged counts, warnings too: an undeclared entity in an attribute is no more than a warning where
        # there is a DTD, and is left out of the value, which is then another number.
        for entry in self._parser.feed_error_log:
            self.malformed = Fault(entry.line, f"not well-formed XML: {' '.join(entry.message.split())}")
            return


def _chunks(path: str) -> Iterator[bytes]:
    try:
        yield from chunks(path, CHUNK, "scene-bytes")
    except UnreadableError as error:
        there = os.path.exists(path)  # noqa: PTH110  # Path's raises an error for names that are too long
        raise FatalError(0, f"{error}{'' if there else hint_beside(Path(), path)}") from None


def _wide(first: bytes) -> str | None:
    """The encoding of a file whose characters have two or four bytes, which its first character tells."""
    for encoding in ("utf-32-le", "utf-32-be", "utf-16-le", "utf-16-be"):
        if first.startswith(("\ufeff".encode(encoding), "<".encode(encoding))):
            return encoding
    return None


def _as_utf8(pieces: Iterator[bytes], encoding: str) -> Iterator[bytes]:
    """The same text up to where it is none, and there a byte that UTF-8 does not have, which the parser refuses."""
    decoder = codecs.getincrementaldecoder(encoding)()
    try:
        for chunk in pieces:
            yield decoder.decode(chunk).encode()
        decoder.decode(b"", final=True)
    except UnicodeDecodeError as error:
        yield error.object[: error.start].decode(encoding).encode() + b"\xff"


def check_prologue(first: bytes) -> None:
    """Refuses, before the document itself is parsed, what declares entities and what is not a scene."""
    if not first:
        raise FatalError(0, "is empty")
    head, whole = first[:HEAD], len(first) < HEAD
    parser: Any = etree.XMLPullParser(events=("start",), **PARSER_OPTIONS)
    with suppress(etree.XMLSyntaxError):
        parser.feed(head)
        if whole:  # The parser waits for four bytes at least.
            parser.close()
    root = next((element for _, element in parser.read_events()), None)
    dtd: Any = None if root is None else root.getroottree().docinfo.internalDTD
    text = head.decode(_wide(head) or "latin-1", "ignore")
    declares = next((found.start() for found in _ENTITY.finditer(text) if found[1]), -1)
    # Without a root, its own attributes may already have been too much for the parser.
    if any(dtd.iterentities()) if dtd is not None else root is None and declares >= 0:
        line = text.count("\n", 0, declares) + 1 if declares >= 0 else 0
        raise FatalError(line, "the document type must not declare entities")
    if root is not None and root.tag != "scene":
        raise FatalError(root.sourceline or 0, f"the root element must be <scene>, got <{short(root.tag)}>")
    if root is None and not whole and not parser.feed_error_log:
        raise FatalError(0, f"the root element must begin within the first {HEAD} bytes")
