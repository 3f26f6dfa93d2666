"""The careful path: what is valid in an element of a scene file, and the words for what is not."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.formats.document import Document
from cltrace.formats.faults import MAX_MESSAGES, Messages, closest, short
from cltrace.formats.files import SceneFiles
from cltrace.formats.schema import ELEMENTS, MATERIALS, MEANT, SECTIONS, Values, rotations, value
from cltrace.scene import Vector

MAX_MATERIALS = 1000  # which are known again

# Colours are computed in float32, whose numbers are 2^-126 to 2^128 where they keep their digits. Sizes and their
# inverses are squared for lengths, so they stay in there up to this.
MAX_SIZE = 2.0**63

Numbers = NDArray[np.float64]


class Children:
    """The children of an element so far: which of those that may occur once it has, and which are unknown."""

    def __init__(self, checks: Checks, element: etree._Element) -> None:
        self.checks, self.element = checks, element
        self.schema = ELEMENTS[element.tag]
        self.filled: set[str] = set()
        self.strays: dict[str, int] = {}

    @property
    def label(self) -> str:
        return label_of(self.element)

    def claim(self, child: etree._Element) -> bool:
        """Whether the child is to be read; if not, it has been complained about."""
        slot = self.schema.slots.get(child.tag)
        if slot is None and child.tag not in self.schema.many:
            known = self.wanted(child)
            line = self.checks.warn_unknown(child, self.label, what="element <{}>", name=child.tag, known=known)
            if len(self.strays) < MAX_MESSAGES:
                self.strays.setdefault(child.tag, line)
            return False
        if slot in self.filled:
            self.checks.fault(child, f"{self.label}: <{child.tag}> must occur only once")
            return False
        if slot:
            self.filled.add(slot)
        return True

    def wanted(self, stray: etree._Element) -> tuple[str, ...]:
        """What a stray child may have been meant to be."""
        if self.element.tag == "transform" and stray.tag.lower() in ("rotate", "rotation"):
            return rotations({str(name): str(value) for name, value in stray.attrib.items()})
        return tuple(name for name in self.schema.known if self.schema.slots.get(name) not in self.filled)

    def complete(self) -> bool:
        """Whether every required child has been there; complains about those that have not."""
        missing = [slot for slot in self.schema.children if slot not in self.filled]
        if self.element not in self.checks.cut_off:
            for slot in missing:
                self._complain(slot)
        return not missing

    def _complain(self, slot: str) -> None:
        names = slot.split("|")

        def hint() -> str:
            stray = next(filter(None, (closest(name, tuple(self.strays)) for name in names)), None)
            known = (MEANT[self.element.tag, name] for name in self.strays if (self.element.tag, name) in MEANT)
            return next(known, f"; did you mean <{short(stray)}> on line {self.strays[stray]}?" if stray else "")

        missing = " or ".join(f"<{name}>" for name in names)
        self.checks.fault(self.element, f"{self.label}: {missing} is missing", hint)


def label_of(element: etree._Element) -> str:
    parent = element.getparent()
    return element.tag if parent is None or parent.tag in SECTIONS else f"{parent.tag} {element.tag}"


class Checks:
    """A file, the elements of which are looked at one by one, and what is wrong with it so far.

    files: those that it names.
    """

    def __init__(self, path: str, exact: bool) -> None:
        self.path, self.document, self.files = path, Document(path, exact), SceneFiles(path)
        self.faults, self.warnings = Messages(), Messages()
        self.cut_off: set[etree._Element] = set()  # the elements that may be open where the file ceases to be XML
        self._materials: dict[bytes, Values] = {}  # those of which there is nothing to say, by their texts

    def fault(self, element: etree._Element, message: str, hint: Callable[[], str] = lambda: "") -> None:
        self.faults.add(self.document.line_of(element), message, hint)

    def warn_unknown(self, element: etree._Element, label: str, what: str, name: str, known: tuple[str, ...]) -> int:
        """Warns of an unknown attribute or element and returns its line."""
        line = self.document.line_of(element)

        def hint() -> str:
            meant = closest(name, known)
            return f"; did you mean {what.partition(' ')[2].format(meant)}?" if meant else ""

        self.warnings.add(line, f"{label}: unknown {what.format(short(name))} ignored", hint)
        return line

    def element(self, element: etree._Element) -> tuple[Values, bool]:
        """What is valid in an element, and whether that is all that it needs."""
        schema = ELEMENTS[element.tag]
        values, whole = self.attributes(element)
        children = Children(self, element)
        for child in element.iterchildren("*"):
            if children.claim(child):
                inner, good = self.material(child) if child.tag in MATERIALS else self.element(child)
                whole &= good
                if child.tag not in schema.many:
                    values[child.tag] = inner
                elif good:
                    values.setdefault("steps", []).append((child, inner))
        whole &= children.complete()
        with suppress(KeyError):
            if fault := schema.check(values):
                self.fault(element, f"{label_of(element)}: {fault}")
                whole = False
        return values, whole

    def material(self, element: etree._Element) -> tuple[Values, bool]:
        """As element(), of a material: most surfaces of a scene have one of a few."""
        text = etree.tostring(element, with_tail=False)
        if values := self._materials.get(text):
            return values, True
        said = self.faults.count + self.warnings.count
        values, whole = self.element(element)
        if whole and said == self.faults.count + self.warnings.count and len(self._materials) < MAX_MATERIALS:
            self._materials[text] = values
        return values, whole

    def attributes(self, element: etree._Element) -> tuple[Values, bool]:
        """The valid attributes of an element, in the order of the schema, and whether these are all."""
        kinds = ELEMENTS[element.tag].attributes
        # By name: lxml's items() looks for each attribute from the first one on, which takes seconds for thousands.
        texts = {name: text for name in kinds if (text := element.get(name)) is not None}
        strays = [str(name) for name in element.attrib if name not in kinds]
        if strays:
            label, wanted = label_of(element), tuple(kind for kind in kinds if kind not in texts)
            for name in strays:
                self.warn_unknown(element, label, what="attribute '{}'", name=name, known=wanted)
        del strays[MAX_MESSAGES:]
        values: Values = {}
        for name, kind in kinds.items():
            if name not in texts:
                hint = functools.partial(_meant, element.tag, name, *strays)
                self.fault(element, f"{label_of(element)}: attribute {name} is missing", hint)
                continue
            try:
                values[name] = value(kind, texts[name])
            except ValueError as error:
                self.fault(element, f"{label_of(element)}: {name} {error}")
        return values, len(values) == len(kinds)

    def surface(self, element: etree._Element) -> tuple[Values, list[float] | None]:
        """What is valid in the element of a surface, and the finish of its material; None where something is missing.

        A finish is the colour, the Phong coefficients, reflectance, transmittance, index of refraction, and the number
        of the texture, -1 for none. The files of textures are read later.
        """
        values, whole = self.element(element)
        material = values.get("material_solid") or values.get("material_textured", {})
        texture = -1
        if name := material.get("texture", {}).get("name"):
            texture = self.files.textures.add(name, self.document.line_of(next(element.iter("texture"))))
        if not whole:
            return values, None
        color = (1.0, 1.0, 1.0) if "texture" in material else vector_of(material["color"])
        parts = (material[name] for name in ("phong", "reflectance", "transmittance", "refraction"))
        return values, [*color, *(number for part in parts for number in part.values()), texture]

    def doubt_colors(self, elements: Sequence[etree._Element], colors: Numbers) -> None:
        """Warns of colours, (n, 3), that seem to be meant as bytes of 0..255, each in its element or a <color> within.

        One of their numbers is a whole one from 16 on, and none is above 255. A light may well be a few times brighter
        than 1, and a colour of bytes below 16 would be next to black.
        """
        whole = (colors >= 16) & (colors == np.rint(colors))
        for i in np.flatnonzero(whole.any(axis=1) & (colors <= 255).all(axis=1)).tolist():
            element = next(elements[i].iter("color"), elements[i])
            numbers = ", ".join(f"{share:g}" for share in colors[i])
            message = f"{label_of(element)}: {numbers} looks like bytes of 0..255, but 1 is full: divide by 255"
            self.warnings.add(self.document.line_of(element), message)

    def doubt_sizes(self, elements: Sequence[etree._Element], largest: Numbers, least: Numbers) -> None:
        """Warns of surfaces whose radii or scales, (n,) at most and at least, are none for colours."""
        for i in np.flatnonzero((largest > MAX_SIZE) | (least < 1 / MAX_SIZE)).tolist():
            size = largest[i] if largest[i] > MAX_SIZE else least[i]
            message = (
                f"{elements[i].tag}: a radius or scale of {size:.2g} may spoil colours, which hold "
                f"within {1 / MAX_SIZE:.2g}..{MAX_SIZE:.2g}"
            )
            self.warnings.add(self.document.line_of(elements[i]), message)

    def doubt_shares(self, elements: Sequence[etree._Element], finishes: Numbers) -> None:
        """Warns of materials, a row of finishes each, that send on more light than reaches them."""
        shares = finishes[:, 7:9].sum(axis=1)  # reflectance and transmittance
        for i in np.flatnonzero(shares > 1 + np.finfo(np.float32).eps).tolist():  # what is written as 0.7 + 0.3 is 1
            material = next(elements[i].iter(*MATERIALS))
            message = f"{material.tag}: r + t = {shares[i]:g} is above 1: more light goes on than reaches it"
            self.warnings.add(self.document.line_of(material), message)


def vector_of(values: Values) -> Vector:
    x, y, z = values.values()
    return x, y, z


def _meant(element: str, name: str, *strays: str) -> str:
    """The end of the message that an attribute is missing, where an unknown one may have been meant to be it."""
    stray = closest(name, strays)
    known = next((MEANT[element, stray] for stray in strays if (element, stray) in MEANT), "")
    return known or (f"; did you mean '{short(stray)}'?" if stray else "")
