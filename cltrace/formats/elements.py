"""Parses a scene file, and checks each element by the schema as soon as it is complete, so that no tree is kept.

The file may come from a stranger. Nothing is fetched, and what declares entities, is no scene or is too large is
refused.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from lxml import etree

from cltrace.base.limits import MAX_NAMES, MAX_NAMESPACES, MAX_STEPS, hint
from cltrace.formats.faults import MAX_MESSAGES, FatalError, Messages, closest, short
from cltrace.formats.files import SceneFiles, UnreadableError, chunks, hint_beside
from cltrace.formats.schema import ELEMENTS, MEANT, Element, rotations

CHUNK = 2**17  # bytes that are parsed at once
SPHERE_END = b"</sphere>"
LAST_LINE = 65_535  # libxml2 keeps the line of an element in 16 bits; this one means "here or later"
# What keeps strangers' files harmless is said here, even where it is what lxml does by itself.
PARSER_OPTIONS: Mapping[str, Any] = {
    "resolve_entities": False,
    "no_network": True,
    "load_dtd": False,
    "huge_tree": False,
    "remove_comments": True,
    "remove_pis": True,
}


class ElementReader(ABC):
    """A file whose elements are looked at one by one, and what is wrong with it so far.

    files: those that it names.
    """

    def __init__(self, path: str) -> None:
        self.path, self.files = path, SceneFiles(path)
        self.faults, self.warnings = Messages(), Messages()
        self.root: Element | None = None
        self._open: list[Element] = []  # the root, and so on to the innermost one
        self._unknown: set[str] = set()  # names, which the parser keeps
        self._namespaces = 0

    @abstractmethod
    def take(self, element: Element, parent: Element) -> None:
        """Takes a complete element, whose parent has it already unless that may have many of them."""

    @abstractmethod
    def take_usual(self, text: bytes, begin: int, line: int) -> int:
        """Takes the surfaces from there on that need no parser, and returns where they end; line: where they begin."""

    def parse(self) -> None:
        """Reads the file; `faults` and `warnings` are told what is wrong with it.

        What is behind the end of a sphere is in no comment, and directly within the surfaces. So spheres that follow
        it and are written as usual need no parser, which gets their line breaks instead.
        """
        self._parser: Any = etree.XMLPullParser(("start", "end", "start-ns"), **PARSER_OPTIONS)
        line = 1
        try:
            for chunk in self._chunks():
                begin = 0
                while begin < len(chunk):
                    found = chunk.find(SPHERE_END, begin)
                    end = found if found >= 0 else len(chunk)
                    known = line + chunk.count(b"\n", begin, end) < LAST_LINE
                    for piece in [chunk[begin:end]] if known else chunk[begin:end].splitlines(keepends=True):
                        self._feed(piece, line)
                        line += piece.count(b"\n")
                    begin = end + len(SPHERE_END)
                    ended = self._feed(chunk[end:begin], line)
                    if ended == "sphere" and self._open[-1].kind is ELEMENTS["surfaces"]:
                        end = self.take_usual(chunk, begin, line)
                        breaks = chunk.count(b"\n", begin, end)
                        self._feed(b"\n" * breaks, line)
                        begin, line = end, line + breaks
            with suppress(etree.XMLSyntaxError):
                self._parser.close()
            self._take_events(line)
        except FatalError as fatal:
            self.faults.add(*fatal.args)

    def _chunks(self) -> Iterator[bytes]:
        """The file in chunks."""
        try:
            yield from chunks(self.path, CHUNK, "scene-bytes")
        except UnreadableError as error:
            there = os.path.exists(self.path)  # noqa: PTH110  # Path's raises an error for names that are too long
            raise FatalError(0, f"{error}{'' if there else hint_beside(Path(), self.path)}") from None

    def _feed(self, piece: bytes, line: int) -> str:
        """Parses a piece, and returns the element that ended last in it, "" if none did.

        line: of the end of the start tags in it, if libxml2 does not know that.
        """
        with suppress(etree.XMLSyntaxError):  # the log has it
            self._parser.feed(piece)
        return self._take_events(line)

    def _take_events(self, line: int) -> str:
        ended = ""
        for event, node in self._parser.read_events():
            if event == "start":
                known = node.sourceline
                self._start(node, known if known < LAST_LINE else line)
            elif event == "end":
                ended = node.tag
                if self._end():
                    node.clear(keep_tail=True)
                    if node.getprevious() is not None:
                        del node.getparent()[0]
            else:
                self._namespaces += 1
                if self._namespaces > MAX_NAMESPACES:
                    raise FatalError(line, f"must not declare more than {MAX_NAMESPACES} namespaces")
        # Warnings count, too: an undeclared entity in an attribute is left out of it where there is a DTD.
        for error in self._parser.feed_error_log:
            raise FatalError(error.line, f"not well-formed XML: {' '.join(error.message.split())}")
        return ended

    def _start(self, node: Any, line: int) -> None:
        tag, given = node.tag, node.attrib
        parent = self._open[-1] if self._open else None
        element = Element(tag, line, parent)
        if parent is None:
            types = node.getroottree().docinfo.internalDTD
            for entity in types.iterentities() if types is not None else ():
                raise FatalError(0, f"the document type must not declare entities, got '{short(entity.name)}'")
            if tag != "scene":
                raise FatalError(line, f"the root element must be <scene>, got <{short(tag)}>")
        self._open.append(element)
        self.root = self.root or element
        if parent is None or (parent.kind and self._claim(parent, element, given)):
            element.kind = ELEMENTS[tag]
            self._read_attributes(element, given)
        else:
            self._unknown.update((tag, *given))
        if len(self._unknown) > MAX_NAMES:
            raise FatalError(line, f"must not have more than {MAX_NAMES} unknown names")

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
            text = given.get(name)
            if text is None:
                self.fault(element, f"attribute {name} is missing", partial(_meant, element, name, strays))
                continue
            try:
                element.values[name] = read(text)
            except ValueError as error:
                self.fault(element, f"{name} {error}")

    def _end(self) -> bool:
        """Ends the innermost element, and tells whether there may be any number of such ones, so that it must go."""
        element = self._open.pop()
        kind = element.kind
        if not kind:
            return True
        for slot in kind.children:
            if slot not in element.filled:
                missing = " or ".join(f"<{name}>" for name in slot.split("|"))
                self.fault(element, f"{missing} is missing", partial(_meant_by_child, element, slot))
        if kind.check:
            with suppress(KeyError):
                if words := kind.check(element):
                    self.fault(element, words)
        if kind.doubt and element.whole and (words := kind.doubt(element)):
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
                    words = f"transform: must not have more than {MAX_STEPS} steps{hint('steps')}"
                    raise FatalError(element.line, words)
            self.take(element, parent)
            return element.tag in parent.kind.many
        return False

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
