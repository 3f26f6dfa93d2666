"""Reads a scene file of the course's XML format into a `Scene`, or says everything that is wrong with it.

The file may come from a stranger and may be large. It is fed to the parser in chunks; after each, the elements that are
complete are read and dropped from the tree, so that memory grows with the packed records only. Spheres that are laid
out as in the format's listing are converted in bulk (`_bulk`); all else, and all that has a fault, takes the careful
path (`_Reader._element`), which alone words the messages. Both give the same numbers.
"""

from __future__ import annotations

import difflib
import functools
import itertools
import math
import os
import re
import stat
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from cltrace.errors import Fault, SceneError
from cltrace.scene import (
    ANY,
    CONE,
    FOV,
    LIGHT,
    MATERIAL,
    MAX_BOUNCES,
    MAX_SPHERES,
    NOT_NEGATIVE,
    POSITIVE,
    SPHERE,
    Camera,
    Rule,
    Scene,
    Vector,
    ambient_light,
    check_resolution,
    parallel_light,
    point_light,
    spot_light,
)

MAX_BYTES = 2**30
MAX_LIGHTS = 2**16
MAX_PARTS = 100_000  # of one sphere, mesh, light or other element that is kept until it is complete
MAX_MESSAGES = 100
CHUNK, HEAD = 2**17, 2**16  # bytes; the tree of a larger chunk no longer fits the processor's cache
LAST_LINE = 65_535  # libxml2 keeps an element's line in 16 bits: this one means "here or later"

PARSER_OPTIONS: Mapping[str, Any] = {
    "resolve_entities": False,
    "no_network": True,
    "load_dtd": False,
    "huge_tree": False,
    "remove_comments": True,
    "remove_pis": True,
}


# --- Attribute values. Each kind is a Rule for a number, or a function that reads the text; a fault is a ValueError
# --- with the words that belong behind the attribute's name.

Kind = Rule | Callable[[str], Any]
_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_FLOAT = re.compile(rf"{_NUMBER}|[-+]?(?:nan|inf|infinity)", re.IGNORECASE)
_INTEGER = re.compile(r"[-+]?[0-9]+")
_XML_SPACE = " \t\r\n"


def _value(kind: Kind, text: str) -> Any:
    return _number(kind, text) if isinstance(kind, Rule) else kind(text)


def _number(rule: Rule, text: str) -> float:
    # float() alone would also take '1_000' and other scripts' digits.
    written = text.strip(_XML_SPACE)
    if not _FLOAT.fullmatch(written):
        raise ValueError(f"must be a number, got {_quoted(text)}")
    value = float(written)
    if value == 0 and not _plain_zero(written):
        value = math.ulp(0.0)  # what is written is not 0 but vanishes: as small as can be, for the rule to refuse
    fault = rule.fault(value)
    if fault:
        raise ValueError(f"{fault.partition(', got ')[0]}, got {_short(written)}")
    return value


def _plain_zero(written: str) -> bool:
    """Whether a number that reads as 0 is one: has no digit but 0 before its exponent."""
    return not re.split("[eE]", written)[0].strip("+-0.")


def _integer(text: str) -> int:
    written = text.strip(_XML_SPACE)
    if not _INTEGER.fullmatch(written):
        raise ValueError(f"must be an integer, got {_quoted(text)}")
    # Through float, as int() refuses very long texts: exact wherever an integer is allowed, and far off elsewhere.
    return int(max(-1e18, min(1e18, float(written))))


def _bounces(text: str) -> int:
    n = _integer(text)
    if not 0 <= n <= MAX_BOUNCES:
        raise ValueError(f"must be within 0..{MAX_BOUNCES}, got {n}")
    return n


def _file_name(text: str) -> str:
    """A name without a folder: a stranger's scene must not choose where a file is written."""
    if "/" in text or text in (".", ".."):
        raise ValueError(f"must be a file name without a folder, got {_quoted(text)}")
    return _relative_path(text)


def _relative_path(text: str) -> str:
    """A path that stays within its folder, on every system."""
    if not text:
        raise ValueError("must not be empty")
    if not text.isprintable():
        raise ValueError(f"must not contain control characters, got {_quoted(text)}")
    if "\\" in text or ":" in text:
        raise ValueError(f"must not contain a backslash or a colon, got {_quoted(text)}")
    if text.startswith("/") or ".." in text.split("/"):
        raise ValueError(f"must stay within the scene's folder, got {_quoted(text)}")
    if len(text.encode()) > 250:
        raise ValueError(f"must be at most 250 bytes long, got {_quoted(text)}")
    return text


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."


def _quoted(text: str) -> str:
    return repr(_short(text))


# --- The format: for each element its attributes, its children, and what these must be together.

Values = dict[str, Any]  # attribute -> value, child -> its Values; of a transform: "steps" -> [(element, Values), ...]


def _nothing(_: Values) -> str | None:
    return None


@dataclass(frozen=True)
class Shape:
    """An element: every attribute and one of each of `children` is required ("a|b": one of the two).

    `check` and `undrawn` word what is wrong with its values together: that they make no sense, or that this version
    does not draw them. They may raise KeyError where a value that they need is faulty itself.
    """

    attributes: Mapping[str, Kind] = field(default_factory=dict)
    children: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    many: tuple[str, ...] = ()
    check: Callable[[Values], str | None] = _nothing
    undrawn: Callable[[Values], str | None] = _nothing

    @functools.cached_property
    def slots(self) -> dict[str, str]:
        """Of each child that may occur once: the entry of `children` or `optional` that it fills."""
        return {name: slot for slot in self.children + self.optional for name in slot.split("|")}

    @functools.cached_property
    def known(self) -> tuple[str, ...]:
        return (*self.slots, *self.many)


def _not_zero(v: Values) -> str | None:
    return None if v["x"] or v["y"] or v["z"] else "must not be 0"


def _not_singular(v: Values) -> str | None:
    factors = v["x"], v["y"], v["z"]
    return None if all(factors) else "must not be singular, got a factor of 0"


def _ordered(v: Values) -> str | None:
    inner, outer = v["alpha1"], v["alpha2"]
    return f"alpha1 must be <= alpha2 ({outer:g}), got {inner:g}" if inner > outer else None


def _size(v: Values) -> str | None:
    try:
        check_resolution((v["horizontal"], v["vertical"]))
    except ValueError as error:
        return str(error).partition(": ")[2]
    return None


def _index_of_glass(v: Values) -> str | None:
    iof = v["refraction"]["iof"]
    return f"refraction iof must be > 0 where t > 0, got {iof:g}" if v["transmittance"]["t"] > 0 and iof <= 0 else None


def _undrawn(what: str, where: Callable[[Values], bool] = lambda _: True) -> Callable[[Values], str | None]:
    return lambda v: f"{what} not drawn by this version yet" if where(v) else None


_RGB = dict.fromkeys("rgb", NOT_NEGATIVE)
_XYZ = dict.fromkeys("xyz", ANY)
_ANGLE = {"theta": ANY}
_MATERIAL = "material_solid|material_textured"
_FINISH = ("phong", "reflectance", "transmittance", "refraction")

SHAPES = {
    "scene": Shape({"output_file": _file_name}, ("background_color", "camera", "lights", "surfaces")),
    "background_color": Shape(_RGB),
    "camera": Shape(children=("position", "lookat", "up", "horizontal_fov", "resolution", "max_bounces")),
    "lookat": Shape(_XYZ),
    "up": Shape(_XYZ, check=_not_zero),
    "horizontal_fov": Shape({"angle": FOV}),
    "resolution": Shape({"horizontal": _integer, "vertical": _integer}, check=_size),
    "max_bounces": Shape({"n": _bounces}),
    "lights": Shape(many=("ambient_light", "parallel_light", "point_light", "spot_light")),
    "ambient_light": Shape(children=("color",)),
    "parallel_light": Shape(children=("color", "direction")),
    "point_light": Shape(children=("color", "position")),
    "spot_light": Shape(children=("color", "position", "direction", "falloff")),
    "color": Shape(_RGB),
    "position": Shape(_XYZ),
    "direction": Shape(_XYZ, check=_not_zero),
    "falloff": Shape({"alpha1": CONE, "alpha2": CONE}, check=_ordered),
    "surfaces": Shape(many=("sphere", "mesh")),
    "sphere": Shape({"radius": POSITIVE}, ("position", _MATERIAL), ("transform",)),
    "mesh": Shape({"name": _relative_path}, (_MATERIAL,), ("transform",), undrawn=_undrawn("meshes are")),
    "material_solid": Shape(children=("color", *_FINISH), check=_index_of_glass),
    "material_textured": Shape(children=("texture", *_FINISH), check=_index_of_glass, undrawn=_undrawn("textures are")),
    "texture": Shape({"name": _relative_path}),
    "phong": Shape(dict.fromkeys(("ka", "kd", "ks", "exponent"), NOT_NEGATIVE)),
    "reflectance": Shape({"r": NOT_NEGATIVE}, undrawn=_undrawn("mirrors (r > 0) are", lambda v: v["r"] > 0)),
    "transmittance": Shape(
        {"t": NOT_NEGATIVE}, undrawn=_undrawn("transparent things (t > 0) are", lambda v: v["t"] > 0)
    ),
    "refraction": Shape({"iof": ANY}),
    "transform": Shape(many=("translate", "scale", "rotateX", "rotateY", "rotateZ")),
    "translate": Shape(_XYZ),
    "scale": Shape(_XYZ, check=_not_singular),
    "rotateX": Shape(_ANGLE),
    "rotateY": Shape(_ANGLE),
    "rotateZ": Shape(_ANGLE),
}
SECTIONS = ("scene", "lights", "surfaces")  # their children are read and dropped while the file is being parsed
LIGHTS: Mapping[str, Callable[..., NDArray[np.void]]] = {
    "ambient_light": ambient_light,
    "parallel_light": parallel_light,
    "point_light": point_light,
    "spot_light": spot_light,
}


# --- Spheres in bulk. A row is a sphere: radius, centre, colour, phong, as they come in the file.


def _layout(tag: str) -> str:
    """The pattern of an element as libxml2 writes it, laid out as in the format's listing; a group for each number."""
    shape = SHAPES[tag]
    start = tag + "".join(rf' {name}="({_NUMBER})"' for name in shape.attributes)
    children = "".join(_layout(slot.split("|")[0]) + r"\s*" for slot in shape.children)
    return rf"<{start}>\s*{children}</{tag}>" if children else f"<{start}/>"


def _rules(tag: str) -> Iterator[Any]:
    """The rule of each number of the same, in the same order."""
    shape = SHAPES[tag]
    yield from shape.attributes.values()
    for slot in shape.children:
        yield from _rules(slot.split("|")[0])


_STANDARD = re.compile(_layout("sphere").encode())
_COLUMNS = [*_rules("sphere")]
_COLUMNS[-3:-1] = [
    Rule("0", low=0, high=0)
] * 2  # reflectance and transmittance: others are refused, by the careful path
_ROW = 11  # the columns that are kept: up to phong's exponent
_NO_ROW = (math.nan,) * _ROW


def _bulk(spheres: Sequence[etree._Element]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which of the spheres are laid out as usual and free of faults, and a row for each sphere, NaN for the others."""
    found = [_STANDARD.fullmatch(etree.tostring(sphere, with_tail=False)) for sphere in spheres]
    usual = [i for i, match in enumerate(found) if match]
    written = [text for match in found if match for text in match.groups()]
    values = np.array(list(map(float, written))).reshape(len(usual), len(_COLUMNS))
    ok = np.ones(len(usual), np.bool_)
    for column, rule in enumerate(_COLUMNS):
        ok &= rule.admits(values[:, column])
    # What reads as 0 but is not written so may have vanished.
    ok[[i // len(_COLUMNS) for i in np.flatnonzero(values == 0).tolist() if written[i].strip(b"+-0.")]] = False
    good = np.zeros(len(spheres), np.bool_)
    good[usual] = ok
    rows = np.full((len(spheres), _ROW), np.nan)
    rows[good] = values[ok, :_ROW]
    return good, rows


def _packed(rows: NDArray[np.float64]) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """(n,) SPHERE and (m,) MATERIAL records; equal materials are one record, in the order of their first use."""
    shades = np.ascontiguousarray(rows[:, 4:]) + 0.0  # -0 becomes 0: compared as bytes
    _, first, of_sphere = np.unique(
        shades.view(f"V{shades.itemsize * shades.shape[1]}"), return_index=True, return_inverse=True
    )
    order = np.argsort(first)
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order))
    spheres = np.empty(len(rows), SPHERE)
    spheres["radius"], spheres["center"], spheres["material"] = rows[:, 0], rows[:, 1:4], rank[of_sphere.ravel()]
    materials = np.empty(len(order), MATERIAL)
    shades = shades[first[order]]
    materials["color"] = shades[:, :3]
    for column, name in enumerate(("ka", "kd", "ks", "exponent"), 3):
        materials[name] = shades[:, column]
    return spheres, materials


# --- Transforms.

_PLANE = {"rotateX": (1, 2), "rotateY": (2, 0), "rotateZ": (0, 1)}


def _transformed(
    center: Vector, radius: float, steps: Sequence[tuple[etree._Element, Values]]
) -> tuple[list[float], float]:
    """Centre and radius after the steps, of which the last listed acts first. Scales must be uniform."""
    p = list(center)
    for element, step in reversed(steps):
        tag = element.tag
        if tag == "translate":
            p = [a + b for a, b in zip(p, step.values(), strict=True)]
        elif tag == "scale":
            p = [a * b for a, b in zip(p, step.values(), strict=True)]
            radius *= abs(step["x"])
        else:
            i, j = _PLANE[tag]
            cos, sin = cos_sin(step["theta"])
            p[i], p[j] = cos * p[i] - sin * p[j], sin * p[i] + cos * p[j]
    return p, radius


def cos_sin(degrees: float) -> tuple[float, float]:
    """Cosine and sine of an angle in degrees, exact at the multiples of 90."""
    turned = math.remainder(degrees, 360.0)  # exact, as is the next difference
    quarter = round(turned / 90.0)
    rest = math.radians(turned - 90.0 * quarter)
    cos, sin = math.cos(rest), math.sin(rest)
    return ((cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos))[quarter % 4]


# --- Messages.


class _Messages:
    """The first MAX_MESSAGES by line, however many there are."""

    def __init__(self) -> None:
        self.count = 0
        self._kept: list[Fault] = []

    def add(self, line: int, message: str) -> None:
        self.count += 1
        self._kept.append(Fault(line, message))
        if len(self._kept) >= 2 * MAX_MESSAGES:
            self._trim()

    def _trim(self) -> None:
        self._kept = sorted(self._kept)[:MAX_MESSAGES]

    def in_order(self) -> list[Fault]:
        self._trim()
        more = self.count - len(self._kept)
        # The ellipsis sorts behind every message of the same line.
        return [*self._kept, Fault(self._kept[-1].line, f"… and {more} more")] if more else self._kept


@functools.lru_cache(1024)
def _closest(name: str, others: tuple[str, ...]) -> str | None:
    """The one of the other names that this one is most likely a misspelling of, if any."""
    by_lower = {other.lower(): other for other in others}
    found = difflib.get_close_matches(name.lower(), by_lower, 1)
    return by_lower[found[0]] if found else None


# --- The careful path.

_VIEW = ("position", "lookat", "up")
_PARTS: Callable[[etree._Element], Any] = etree.XPath("count(//node())")
# Up to the first '>' and the rest of its line: every tag that ends in a piece ends on the line of that '>'.
_PIECE = re.compile(rb"[^>]*>[^\n]*\n?|[^>]+")


class _FatalError(Exception):
    """Line and message of a fault after which no more of the file is read."""


class _LinesNeededError(Exception):
    """A message is about a line whose number libxml2 does not keep."""


class _Children:
    """Which of the children that an element may have once it has, and which it should not have."""

    def __init__(self, reader: _Reader, element: etree._Element) -> None:
        self.reader, self.element = reader, element
        self.shape, self.label = SHAPES[element.tag], _label(element)
        self.filled: set[str] = set()
        self.strays: dict[str, int] = {}

    def claim(self, child: etree._Element) -> bool:
        """Whether the child is to be read; if not, it has been complained about."""
        slot = self.shape.slots.get(child.tag)
        if slot is None and child.tag not in self.shape.many:
            line = self.reader.warn_unknown(child, self.label, "element <{}>", child.tag, self.wanted())
            if len(self.strays) < MAX_MESSAGES:
                self.strays.setdefault(child.tag, line)
            return False
        if slot in self.filled:
            self.reader.fault(child, f"{self.label}: <{child.tag}> must occur only once")
            return False
        if slot:
            self.filled.add(slot)
        return True

    def wanted(self) -> tuple[str, ...]:
        """What a stray child may have been meant to be."""
        return tuple(name for name in self.shape.known if self.shape.slots.get(name) not in self.filled)

    def complete(self) -> bool:
        """Whether every required child has been there; complains about those that have not."""
        missing = [slot for slot in self.shape.children if slot not in self.filled]
        if self.element not in self.reader.cut_off:
            for slot in missing:
                self._complain(slot)
        return not missing

    def _complain(self, slot: str) -> None:
        names = slot.split("|")
        text = f"{self.label}: {' or '.join(f'<{name}>' for name in names)} is missing"
        stray = next(filter(None, (_closest(name, tuple(self.strays)) for name in names)), None)
        if stray:
            text += f"; did you mean <{_short(stray)}> on line {self.strays[stray]}?"
        self.reader.fault(self.element, text)


def _label(element: etree._Element) -> str:
    parent = element.getparent()
    return element.tag if parent is None or parent.tag in SECTIONS else f"{parent.tag} {element.tag}"


class _Reader:
    """One pass over a file. `exact`: feeds it line by line, to know the line of every element, in twice the time."""

    def __init__(self, path: str, exact: bool) -> None:
        self.path = path
        self.faults, self.warnings = _Messages(), _Messages()
        self.cut_off: set[etree._Element] = set()  # elements that the end of a file that is not well-formed left open
        self._output_file = ""
        self._background: Vector = (0.0, 0.0, 0.0)
        self._camera: Values = {}
        self._lights: list[NDArray[np.void]] = []
        self._rows: list[NDArray[np.float64]] = []
        self._sphere_count = 0
        self._exact = exact
        self._line = 1  # of the next byte to be fed
        self._lines: dict[etree._Element, int] = {}  # of the elements in the tree, where `exact`
        self._root: etree._Element | None = None
        self._sections: dict[etree._Element, _Children] = {}  # those that have begun
        tag = None if exact else "scene"
        self._parser: Any = etree.XMLPullParser(events=("start",), tag=tag, **PARSER_OPTIONS)

    # Messages

    def fault(self, element: etree._Element, message: str) -> None:
        self.faults.add(self._line_of(element), message)

    def warn_unknown(self, element: etree._Element, label: str, what: str, name: str, known: tuple[str, ...]) -> int:
        """Warns of an unknown attribute or element and returns its line."""
        line = self._line_of(element)
        meant = _closest(name, known)
        hint = f"; did you mean {what.partition(' ')[2].format(meant)}?" if meant else ""
        self.warnings.add(line, f"{label}: unknown {what.format(_short(name))} ignored{hint}")
        return line

    def _line_of(self, element: etree._Element) -> int:
        if self._exact:
            return self._lines[element]
        line: Any = element.sourceline
        if line >= LAST_LINE:
            raise _LinesNeededError
        return int(line)

    # The file

    def run(self) -> None:
        """Reads the file; `result` then has what came of it."""
        try:
            self._parse()
        except _FatalError as fatal:
            self.faults.add(*fatal.args)

    def result(self) -> tuple[Scene, list[str]]:
        """The scene and the warnings; raises SceneError if there are faults."""
        if self.faults.count:
            raise SceneError(self.path, self.faults.in_order())
        view: dict[str, Any] = {name: _vector(self._camera[name]) for name in _VIEW}
        camera = Camera(
            **view,
            horizontal_fov=self._camera["horizontal_fov"]["angle"],
            resolution=(self._camera["resolution"]["horizontal"], self._camera["resolution"]["vertical"]),
            max_bounces=self._camera["max_bounces"]["n"],
        )
        lights = np.concatenate([np.zeros(0, LIGHT), *self._lights])
        spheres, materials = _packed(np.concatenate([np.empty((0, _ROW)), *self._rows]))
        scene = Scene(camera, lights, spheres, materials, self._background, self._output_file)
        return scene, [f"{self.path}:{w.line}: {w.message}" for w in self.warnings.in_order()]

    def _parse(self) -> None:
        chunks = _chunks(self.path)
        first = next(chunks, b"")
        _check_prologue(first)
        malformed = None
        for chunk in itertools.chain([first], chunks):
            malformed = self._feed(chunk)
            if malformed:
                break
            self._take_complete()
        malformed = malformed or self._end()
        if malformed:
            self.faults.add(malformed.line, malformed.message)
            self._mark_cut_off()
        if self._root is not None:
            self._take(self._root, whole=True)

    def _feed(self, chunk: bytes) -> Fault | None:
        with suppress(etree.XMLSyntaxError):  # the parser's log has it too, and more
            for piece in _PIECE.findall(chunk) if self._exact else [chunk]:
                before, _, behind = piece.partition(b">")
                self._line += before.count(b"\n")
                self._parser.feed(piece)
                self._note_elements()
                self._line += behind.count(b"\n")
        self._note_elements()
        return self._malformed()

    def _note_elements(self) -> None:
        for _, element in self._parser.read_events():
            if self._root is None:
                self._root = element
            if self._exact:
                self._lines[element] = self._line

    def _end(self) -> Fault | None:
        with suppress(etree.XMLSyntaxError):
            self._parser.close()
        return self._malformed()

    def _malformed(self) -> Fault | None:
        # Whatever is logged counts, warnings too: an undeclared entity in an attribute is no more than a warning where
        # there is a DTD, and is left out of the value, which is then another number.
        for entry in self._parser.feed_error_log:
            return Fault(entry.line, f"not well-formed XML: {' '.join(entry.message.split())}")
        return None

    def _mark_cut_off(self) -> None:
        """Notes the elements that may be open, in which nothing is missing yet: the last one, its last child, ..."""
        element = self._root
        while element is not None:
            self.cut_off.add(element)
            element = next(element.iterchildren("*", reversed=True), None)

    # Sections: scene, lights and surfaces

    def _take_complete(self) -> None:
        """Reads and drops what is complete."""
        root = self._root
        if root is None:
            return
        self._take(root, whole=False)
        if self._exact:
            self._lines = {element: self._lines[element] for element in root.iter("*")}
        if _PARTS(root) > MAX_PARTS:
            element = root
            while element.tag in SECTIONS and len(element):
                element = element[-1]
            raise _FatalError(self._line_of(element), f"{element.tag}: must not have more than {MAX_PARTS} parts")

    def _take(self, section: etree._Element, whole: bool) -> None:
        """Reads and drops the complete children of a section: all but the last, unless the section is `whole`."""
        if section not in self._sections:
            self._begin(section)
        children = list(section.iterchildren("*"))
        last = None if whole or not children else children.pop()
        {"scene": self._parts, "lights": self._lights_of, "surfaces": self._surfaces_of}[section.tag](section, children)
        del section[: len(children)]
        if whole:
            self._sections.pop(section).complete()
        elif last is not None and section is self._root and last.tag in SECTIONS[1:]:
            self._take(last, whole=False)
        elif last is not None and last.tag not in SHAPES[section.tag].known:
            _prune(last)

    def _begin(self, section: etree._Element) -> None:
        self._sections[section] = _Children(self, section)
        values, _ = self._attributes(section)
        parent = section.getparent()
        if parent is not None:
            self._sections[parent].claim(section)
        elif "output_file" in values:
            self._output_file = values["output_file"]
            if Path(self._output_file).suffix.lower() != ".png":
                self._output_file += ".png"
                written = _quoted(values["output_file"])
                self.warnings.add(
                    self._line_of(section), f"scene: output_file {written} does not end in .png, which is appended"
                )

    def _parts(self, scene: etree._Element, children: Sequence[etree._Element]) -> None:
        for child in children:
            if child.tag in SECTIONS[1:]:
                self._take(child, whole=True)
            elif self._sections[scene].claim(child):
                values, whole = self._element(child)
                if child.tag == "camera":
                    self._check_view(child, values)
                    self._camera = values
                elif whole:
                    self._background = _vector(values)

    def _lights_of(self, lights: etree._Element, children: Sequence[etree._Element]) -> None:
        for child in children:
            if not self._sections[lights].claim(child):
                continue
            if len(self._lights) >= MAX_LIGHTS:
                raise _FatalError(self._line_of(child), f"lights: must be at most {MAX_LIGHTS}")
            values, whole = self._element(child)
            if whole:
                vectors = {k: _vector(values[k]) for k in ("color", "position", "direction") if k in values}
                self._lights.append(LIGHTS[child.tag](**vectors, **values.get("falloff", {})))

    def _surfaces_of(self, surfaces: etree._Element, children: Sequence[etree._Element]) -> None:
        spheres = []
        for child in children:
            if child.tag == "sphere":
                spheres.append(child)
            elif self._sections[surfaces].claim(child):
                self._element(child)
        room = MAX_SPHERES - self._sphere_count
        if len(spheres) > room:
            raise _FatalError(self._line_of(spheres[room]), f"surfaces: must be at most {MAX_SPHERES} spheres")
        self._sphere_count += len(spheres)
        good, rows = _bulk(spheres)
        for i in np.flatnonzero(~good):
            rows[i] = self._sphere(spheres[i])
        self._rows.append(rows)

    # Elements

    def _element(self, element: etree._Element) -> tuple[Values, bool]:
        """What is valid in an element, and whether that is all that it needs."""
        shape, label = SHAPES[element.tag], _label(element)
        values, whole = self._attributes(element)
        children = _Children(self, element)
        for child in element.iterchildren("*"):
            if children.claim(child):
                inner, good = self._element(child)
                whole &= good
                if child.tag not in shape.many:
                    values[child.tag] = inner
                elif good:
                    values.setdefault("steps", []).append((child, inner))
        whole &= children.complete()
        with suppress(KeyError):
            if fault := shape.check(values):
                self.fault(element, f"{label}: {fault}")
                whole = False
        with suppress(KeyError):
            if fault := shape.undrawn(values):
                self.fault(element, f"{label}: {fault}")
        return values, whole

    def _attributes(self, element: etree._Element) -> tuple[Values, bool]:
        """The valid attributes of an element, in the order of its shape, and whether these are all."""
        kinds, label = SHAPES[element.tag].attributes, _label(element)
        strays = tuple(str(name) for name in element.attrib if name not in kinds)
        for name in strays:
            self.warn_unknown(
                element, label, "attribute '{}'", name, tuple(k for k in kinds if k not in element.attrib)
            )
        values: Values = {}
        for name, kind in kinds.items():
            text = element.get(name)
            if text is None:
                stray = _closest(name, strays)
                hint = f"; did you mean '{_short(stray)}'?" if stray else ""
                self.fault(element, f"{label}: attribute {name} is missing{hint}")
                continue
            try:
                values[name] = _value(kind, text)
            except ValueError as error:
                self.fault(element, f"{label}: {name} {error}")
        return values, len(values) == len(kinds)

    def _check_view(self, camera: etree._Element, values: Values) -> None:
        """Complains about a view that is undefined: the camera itself finds out."""
        vectors = {name: tuple(values[name].values()) for name in _VIEW if name in values}
        # Valid ones. That up is 0 has been said.
        view: dict[str, Any] = {k: v for k, v in vectors.items() if len(v) == 3 and (k != "up" or any(v))}
        if "position" not in view or "lookat" not in view:
            return
        try:
            Camera(**view)
        except ValueError as error:
            name, _, fault = str(error).removeprefix("camera.").partition(": ")
            if name in view:  # and not a default
                self.fault(next(camera.iterchildren(name)), f"camera {name}: {fault}")

    def _sphere(self, element: etree._Element) -> Sequence[float]:
        """The row of a sphere with its transform folded into centre and radius; NaN if it has a fault."""
        values, whole = self._element(element)
        steps = values.get("transform", {}).get("steps", [])
        for step, factors in steps:
            if step.tag == "scale" and len(set(map(abs, factors.values()))) > 1:
                self.fault(step, "sphere scale: non-uniform scales are not drawn by this version yet")
                whole = False
        if not whole or "material_solid" not in values:
            return _NO_ROW
        center, radius = _transformed(_vector(values["position"]), values["radius"], steps)
        for name, rule, value in zip(("radius", *"xyz"), (POSITIVE, ANY, ANY, ANY), (radius, *center), strict=True):
            if fault := rule.fault(value):
                self.fault(element, f"sphere: after the transform {name} {fault}")
        material = values["material_solid"]
        return [radius, *center, *_vector(material["color"]), *material["phong"].values()]


def _vector(values: Values) -> Vector:
    x, y, z = values.values()
    return x, y, z


def _prune(element: etree._Element) -> None:
    """Drops what is complete in an element that is still being parsed."""
    while len(element):
        del element[:-1]
        element = element[-1]


# --- The file.


def _chunks(path: str) -> Iterator[bytes]:
    try:
        mode = Path(path).stat().st_mode
        if not stat.S_ISREG(mode):
            raise _FatalError(0, "is a directory" if stat.S_ISDIR(mode) else "is not a regular file")
        size = 0
        with Path(path).open("rb") as file:
            while chunk := file.read(CHUNK):
                size += len(chunk)
                if size > MAX_BYTES:
                    raise _FatalError(0, f"must not be larger than {MAX_BYTES} bytes")
                yield chunk
    except OSError as error:
        raise _FatalError(0, f"cannot be read: {error.strerror}") from None
    except ValueError:
        raise _FatalError(0, "cannot be read: the name contains a NUL") from None


def _check_prologue(first: bytes) -> None:
    """Refuses, before the document itself is parsed, what declares entities and what is not a scene."""
    if not first:
        raise _FatalError(0, "is empty")
    head = first[:HEAD]
    parser: Any = etree.XMLPullParser(events=("start",), **PARSER_OPTIONS)
    with suppress(etree.XMLSyntaxError):
        parser.feed(head)
    root = next((element for _, element in parser.read_events()), None)
    dtd: Any = None if root is None else root.getroottree().docinfo.internalDTD
    declares = head.find(b"<!ENTITY")
    # Without a root, its own attributes may already have been too much for the parser.
    if any(dtd.iterentities()) if dtd is not None else root is None and declares >= 0:
        line = head.count(b"\n", 0, declares) + 1 if declares >= 0 else 0
        raise _FatalError(line, "the document type must not declare entities")
    if root is not None and root.tag != "scene":
        raise _FatalError(root.sourceline or 0, f"the root element must be <scene>, got <{_short(root.tag)}>")
    if root is None and len(head) == HEAD and not parser.feed_error_log:
        raise _FatalError(0, f"the root element must begin within the first {HEAD} bytes")


def read(path: str | os.PathLike[str]) -> tuple[Scene, list[str]]:
    """The scene of a file and the warnings, such as "scene.xml:12: sphere: unknown attribute 'foo' ignored".

    Raises SceneError with every fault of the file.
    """
    name = os.fspath(path)
    try:
        reader = _Reader(name, exact=False)
        reader.run()
    except _LinesNeededError:
        reader = _Reader(name, exact=True)
        reader.run()
    return reader.result()
