"""The answers that a scene file gives in its own header comment."""

from __future__ import annotations

import re
from pathlib import Path

from lxml import etree

Answer = tuple[tuple[int, int], tuple[int, int, int]]

_LINE = re.compile(r"answer: pixel \((\d+), (\d+)\) = \((\d+), (\d+), (\d+)\)")


def answers(path: str | Path) -> list[Answer]:
    """The pixels whose colour is derived by hand in a scene's header comment, in the order of the file.

    path: a scene, XML. The header comments are those before the root element. In them each line

        answer: pixel (240, 180) = (91, 0, 0)

    says that column 240 of row 180 (from 0, row 0 at the top) of the 8-bit picture is exactly R, G, B = 91, 0, 0, where
    a byte is floor(255 c + 0.5) of the colour c clamped to 0..1. Returns [((column, row), (r, g, b)), ...], empty if
    there is none. Raises ValueError for a line that begins with "answer:" and reads otherwise, so that none is lost.
    """
    root = etree.parse(str(path), etree.XMLParser(load_dtd=False, no_network=True)).getroot()
    headers = [str(node.text) for node in root.itersiblings(preceding=True) if node.tag is etree.Comment]
    found: list[Answer] = []
    for line in (line.strip() for text in reversed(headers) for line in text.splitlines()):
        if not line.startswith("answer:"):
            continue
        match = _LINE.fullmatch(line)
        if match is None:
            raise ValueError(f"{path}: not an answer: {line}")
        x, y, r, g, b = map(int, match.groups())
        found.append(((x, y), (r, g, b)))
    return found
