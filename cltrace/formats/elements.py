"""Parses a scene file, and checks each element by the schema as soon as it is complete, so that no tree is kept.

The file may come from a stranger. Nothing is fetched, and what declares entities, is no scene or is too large is
refused.
"""

from __future__ import annotations

import codecs
import os
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from itertools import chain
from pathlib import Path
from typing import NoReturn
from xml.parsers import expat

from cltrace.base.limits import MAX_DEPTH, MAX_NAMES, MAX_STEPS, MAX_TAG, hint
from cltrace.formats.faults import MAX_MESSAGES, FatalError, Messages, closest, short
from cltrace.formats.files import SceneFiles, UnreadableError, chunks, hint_beside
from cltrace.formats.schema import ELEMENTS, MEANT, Element, rotations

CHUNK = 2**17  # bytes that are parsed at once
# What names the file of a document type. In front of such a name, expat would leave out undeclared entities in silence.
_EXTERNAL = re.compile(rb"""(<!DOCTYPE\s+[^\s>\[]+)(\s+(?:SYSTEM|PUBLIC)(?:\s+(?:"[^"]*"|'[^']*'))+)""")


class ElementReader(ABC):
    """A file whose elements are looked at one by one, and what is wrong with it so far.

    files: those that it names.
    """

    def __init__(self, path: str) -> None:
        self.path, self.files = path, SceneFiles(path)
        self.faults, self.warnings = Messages(), Messages()
        self.root: Element | None = None
        self._open: list[Element] = []  # the root, and so on to the innermost one
        self._unknown: set[str] = set()  # names, which expat keeps

    @abstractmethod
    def take(self, element: Element, parent: Element) -> None:
        """Takes a complete element, whose parent has it already unless that may have many of them."""

    def parse(self) -> None:
        """Reads the file; `faults` and `warnings` are told what is wrong with it."""
        fed = 0
        try:
            pieces = _chunks(self.path)
            first = next(pieces, b"")
            if not first:
                raise FatalError(0, "is empty")
            encoding = _wide(first)
            self._parser = parser = expat.ParserCreate("utf-8" if encoding else None)
            parser.StartElementHandler, parser.EndElementHandler = self._start, self._end
            parser.EntityDeclHandler = partial(self._refuse, "the document type must not declare entities")
            parser.StartDoctypeDeclHandler = self._start_document_type
            for piece in _utf8(chain([first], pieces), encoding):
                parser.Parse(piece if fed else _EXTERNAL.sub(_without_file, piece), False)
                fed += len(piece)
                if fed - parser.CurrentByteIndex > MAX_TAG:
                    self._refuse(f"must not have a tag or comment of more than {MAX_TAG} bytes")
            parser.Parse(b"", True)
        except FatalError as fatal:
            self.faults.add(*fatal.args)
        except expat.ExpatError as error:
            words = expat.errors.messages[error.code]
            inside = (
                f": <{short(self._open[-1].tag)}> of line {self._open[-1].line} is not closed" if self._open else ""
            )
            self.faults.add(error.lineno, f"not well-formed XML: {words}{inside}")
        except UnicodeDecodeError as error:
            self.faults.add(self._parser.CurrentLineNumber, f"not well-formed XML: is not {error.encoding}")
        except (LookupError, ValueError) as error:  # of an encoding that is declared
            self.faults.add(self._parser.CurrentLineNumber, f"not well-formed XML: {error}")

    def _refuse(self, words: str, *_: object) -> NoReturn:
        raise FatalError(self._parser.CurrentLineNumber, words)

    def _start_document_type(self, _name: str, file: str | None, *_: object) -> None:
        if file is not None:
            self._refuse(f"the document type must stand within the first {CHUNK} bytes")

    def _start(self, tag: str, given: Mapping[str, str]) -> None:
        parent = self._open[-1] if self._open else None
        element = Element(tag, self._parser.CurrentLineNumber, parent)
        if parent is None and tag != "scene":
            raise FatalError(element.line, f"the root element must be <scene>, got <{short(tag)}>")
        self._open.append(element)
        if len(self._open) > MAX_DEPTH:
            self._refuse(f"must not be more than {MAX_DEPTH} elements deep")
        self.root = self.root or element
        if parent is None or (parent.kind and self._claim(parent, element, given)):
            element.kind = ELEMENTS[tag]
            self._read_attributes(element, given)
        else:
            self._unknown.update((tag, *given))
        if len(self._unknown) > MAX_NAMES:
            self._refuse(f"must not have more than {MAX_NAMES} unknown names")

    def _claim(self, parent: Element, child: Element, given: Mapping[str, str]) -> bool:
        """Whether the child is to be read; if not, it has been complained about."""
        assert parent.kind
        slots, many, tag = parent.kind.slots, parent.kind.many, child.tag
        if tag in many:
            return True
        slot = slots.get(tag)
        if slot is None:
            known = (*(name for name, filled in slots.items() if filled not in parent.filled), *many)
            if parent.tag == "transform" and tag.lower() in ("rotate", "rotation"):
                known = rotations(given)
            self._warn_unknown(parent, child.line, "element <{}>", tag, known)
            if len(parent.strays) < MAX_MESSAGES:
                parent.strays.setdefault(tag, child.line)
        elif slot in parent.filled:
            self.faults.add(child.line, f"{parent.label}: <{tag}> must occur only once")
        else:
            parent.filled.append(slot)
            return True
        return False

    def _read_attributes(self, element: Element, given: Mapping[str, str]) -> None:
        kinds = ELEMENTS[element.tag].attributes
        strays = [name for name in given if name not in kinds]
        for name in strays:
            known = tuple(kind for kind in kinds if kind not in given)
            self._warn_unknown(element, element.line, "attribute '{}'", name, known)
        self._unknown.update(strays)
        for name, read in kinds.items():
            if name not in given:
                self.fault(element, f"attribute {name} is missing", partial(_meant, element, name, strays))
                continue
            try:
                element.values[name] = read(given[name])
            except ValueError as error:
                self.fault(element, f"{name} {error}")

    def _end(self, _: str) -> None:
        element = self._open.pop()
        if not element.kind:
            return
        for slot in element.kind.children:
            if slot not in element.filled:
                missing = " or ".join(f"<{name}>" for name in slot.split("|"))
                self.fault(element, f"{missing} is missing", partial(_meant_by_child, element, slot))
        with suppress(KeyError):
            if words := element.kind.check(element):
                self.fault(element, words)
        if element.whole and (words := element.kind.doubt(element)):
            self.warnings.add(element.line, f"{element.label}: {words}")
        if self._open:
            parent = self._open[-1]
            parent.whole &= element.whole
            assert parent.kind
            if element.tag not in parent.kind.many:
                parent.values[element.tag] = element
            elif parent.tag == "transform" and element.whole:
                parent.steps.append(element)
                if len(parent.steps) > MAX_STEPS:
                    self._refuse(f"transform: must not have more than {MAX_STEPS} steps{hint('steps')}")
            self.take(element, parent)

    def fault(self, element: Element, words: str, meant: Callable[[], str] = lambda: "") -> None:
        """Tells of a fault of an element, which is then not whole."""
        element.whole = False
        self.faults.add(element.line, f"{element.label}: {words}", meant)

    def _warn_unknown(self, element: Element, line: int, what: str, name: str, known: tuple[str, ...]) -> None:
        def meant() -> str:
            other = closest(name, known)
            return f"; did you mean {what.partition(' ')[2].format(other)}?" if other else ""

        self.warnings.add(line, f"{element.label}: unknown {what.format(short(name))} ignored", meant)


def _meant(element: Element, name: str, strays: list[str]) -> str:
    """The end of the message that an attribute is missing, where an unknown one may have been meant to be it."""
    known = next((MEANT[element.tag, stray] for stray in strays if (element.tag, stray) in MEANT), "")
    stray = closest(name, tuple(strays[:MAX_MESSAGES]))
    return known or (f"; did you mean '{short(stray)}'?" if stray else "")


def _meant_by_child(element: Element, slot: str) -> str:
    """The same of a child, whose slot is missing."""
    stray = next(filter(None, (closest(name, tuple(element.strays)) for name in slot.split("|"))), None)
    known = (MEANT[element.tag, name] for name in element.strays if (element.tag, name) in MEANT)
    return next(known, f"; did you mean <{short(stray)}> on line {element.strays[stray]}?" if stray else "")


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


def _utf8(pieces: Iterator[bytes], wide: str | None) -> Iterator[bytes]:
    return (text.encode() for text in codecs.iterdecode(pieces, wide)) if wide else pieces


def _without_file(document_type: re.Match[bytes]) -> bytes:
    """With blanks and line breaks in place of the name of its file."""
    return document_type[1] + re.sub(rb"[^\n\r]", b" ", document_type[2])
