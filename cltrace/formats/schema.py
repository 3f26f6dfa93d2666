"""The schema of scene files: for each element its attributes, its children, and what these must be together.

Each attribute has a function that reads its text. A fault is a ValueError, whose words belong behind the attribute's
name. Reading, checking and hints at what was meant all follow this table.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.limits import MAX_BOUNCES, MAX_LIGHTS, hint
from cltrace.formats.faults import quoted, short
from cltrace.scene import (
    ANY,
    CONE,
    FOV,
    NOT_NEGATIVE,
    POSITIVE,
    Rule,
    ambient_light,
    ball_light,
    check_resolution,
    panel_light,
    parallel_light,
    point_light,
    sky_light,
    spans_no_area,
    spot_light,
    sun_light,
)

_FLOAT = re.compile(r"[-+]?(?:(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:e[-+]?[0-9]+)?|nan|inf|infinity)", re.IGNORECASE)
_INTEGER = re.compile(r"[-+]?[0-9]+")
_XML_SPACE = " \t\r\n"


def number(rule: Rule, text: str) -> float:
    """A number that the rule allows."""
    # float() alone would also take '1_000' and other scripts' digits.
    written = text.strip(_XML_SPACE)
    if not _FLOAT.fullmatch(written):
        raise ValueError(f"must be a number, got {quoted(text)}")
    value = float(written)
    if value and rule.admits(value):
        return value
    if value == 0 and not is_plain_zero(written):
        value = math.ulp(0.0)  # what is written is not 0 but vanishes: as small as can be, for the rule to refuse
    fault = rule.fault(value)
    if fault:
        half = rule in (FOV, CONE) and rule.high <= value < 2 * rule.high
        hint = f": it is half of the opening, is {value / 2:g} meant?" if half else ""
        raise ValueError(f"{fault.partition(', got ')[0]}, got {short(written)}{hint}")
    return value


def is_plain_zero(written: str) -> bool:
    """Whether a number that reads as 0 is one: has no digit but 0 before its exponent."""
    return not re.split("[eE]", written)[0].strip("+-0.")


def integer(text: str) -> int:
    """A whole number; one beyond 1e18 in magnitude is read as 1e18, which no rule allows."""
    written = text.strip(_XML_SPACE)
    if not _INTEGER.fullmatch(written):
        raise ValueError(f"must be an integer, got {quoted(text)}")
    # int() refuses very long texts. float() takes them, and is exact for every integer that a rule allows.
    return int(max(-1e18, min(1e18, float(written))))


def _whole(low: int, high: int, name: str = "") -> Callable[[str], int]:
    """A kind of whole numbers within these bounds. name: of a limit, in which more may be allowed."""

    def read(text: str) -> int:
        n = integer(text)
        if not low <= n <= high:
            raise ValueError(f"must be within {low}..{high}, got {n}{hint(name) if name and n > high else ''}")
        return n

    return read


def file_name(text: str) -> str:
    """A name without a folder: a stranger's scene must not choose where a file is written."""
    if "/" in text or text in (".", ".."):
        raise ValueError(f"must be a file name without a folder, got {quoted(text)}")
    return relative_path(text)


def relative_path(text: str) -> str:
    """A path that stays within its folder, on every system."""
    if not text:
        raise ValueError("must not be empty")
    if not text.isprintable():
        raise ValueError(f"must not contain control characters, got {quoted(text)}")
    if "\\" in text or ":" in text:
        raise ValueError(f"must not contain a backslash or a colon, got {quoted(text)}")
    if text.startswith("/") or ".." in text.split("/"):
        raise ValueError(f"must stay within the scene's folder, got {quoted(text)}")
    if len(text.encode()) > 250:
        raise ValueError(f"must be at most 250 bytes long, got {quoted(text)}")
    return text


@dataclass(frozen=True)
class ElementKind:
    """What an element has: every attribute and one of each of `children` is required ("a|b": one of the two).

    `check` says what makes no sense about the values together. It may raise KeyError where a value that it needs is
    missing or faulty itself. `doubt` says of an element without faults what hardly is as it was meant.
    """

    attributes: Mapping[str, Callable[[str], Any]] = field(default_factory=dict)
    children: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    many: tuple[str, ...] = ()
    check: Callable[[Element], str | None] | None = None
    doubt: Callable[[Element], str | None] | None = None

    @functools.cached_property
    def slots(self) -> dict[str, str]:
        """For each child that may occur once, the entry of `children` or `optional` that it fills."""
        return {name: slot for slot in self.children + self.optional for name in slot.split("|")}


class Element:
    """An element of a file: its valid attributes and children, by their names.

    line: where its start tag ends; label: what messages call it; kind: None if the element is ignored, as it is unknown
    or there is one too many; whole: whether it has all that it needs; filled: the slots of the children that have been
    there; strays: the lines of unknown children; steps: of a transform.
    """

    __slots__ = ("filled", "kind", "label", "line", "steps", "strays", "tag", "values", "whole")

    def __init__(self, tag: str, line: int, parent: Element | None) -> None:
        self.tag, self.line = tag, line
        self.label = tag if parent is None or parent.tag in SECTIONS else f"{parent.tag} {tag}"
        self.kind: ElementKind | None = None
        self.values: dict[str, Any] = {}
        self.filled: list[str] = []
        self.strays: dict[str, int] = {}
        self.steps: list[Element] = []
        self.whole = True

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def __contains__(self, name: str) -> bool:
        return name in self.values

    @property
    def numbers(self) -> tuple[Any, ...]:
        """The values of all attributes, in the order of the schema. Raises KeyError if one is missing or faulty."""
        return tuple(self.values[name] for name in ELEMENTS[self.tag].attributes)


def _not_zero(v: Element) -> str | None:
    return None if v["x"] or v["y"] or v["z"] else "must not be 0"


def _not_singular(v: Element) -> str | None:
    return None if v["x"] and v["y"] and v["z"] else "must not be singular, got a factor of 0"


def _long(v: Element) -> str | None:
    return "end must not be the start" if v["start"].numbers == v["end"].numbers else None


def rotations(attributes: Mapping[str, str]) -> tuple[str, ...]:
    """What a rotation may be meant to be that does not say its axis as the format does: by the axis that it names."""
    turned = [axis for axis in "xyz" if attributes.get(axis, "").strip(" +-0.")]
    named = [axis for axis in "xyz" if attributes.get("axis", "").strip().lower() == axis] or turned
    return (f"rotate{named[0].upper()}",) if len(named) == 1 else ()


def _ordered(v: Element) -> str | None:
    inner, outer = v["alpha1"], v["alpha2"]
    return f"alpha1 must be <= alpha2 ({outer:g}), got {inner:g}" if inner > outer else None


def _size(v: Element) -> str | None:
    try:
        check_resolution((v["horizontal"], v["vertical"]))
    except ValueError as error:
        return str(error).partition(": ")[2]
    return None


def _index_of_glass(v: Element) -> str | None:
    iof = v["refraction"]["iof"]
    return f"refraction iof must be > 0 where t > 0, got {iof:g}" if v["transmittance"]["t"] > 0 and iof <= 0 else None


def _up_with_below(v: Element) -> str | None:
    return "<below> goes with <up>, which is missing" if "below" in v and "up" not in v else None


def _spans(v: Element) -> str | None:
    across, along = (np.array(v[name].numbers) for name in ("across", "along"))
    return "across and along must not be along one line" if spans_no_area(across, along) else None


def _like_bytes(v: Element) -> str | None:
    """One number is a whole one from 16 on, and none is above 255: a light may well be a few times brighter than 1."""
    color = v.numbers
    if max(color) > 255 or not any(share >= 16 and share == int(share) for share in color):
        return None
    return f"{', '.join(f'{share:g}' for share in color)} looks like bytes of 0..255, but 1 is full: divide by 255"


def _more_than_all(v: Element) -> str | None:
    shares = v["reflectance"]["r"] + v["transmittance"]["t"]
    if shares <= 1 + np.finfo(np.float32).eps:  # what is written as 0.7 + 0.3 is 1
        return None
    return f"r + t = {shares:g} is above 1: more light goes on than reaches it"


# What makes the light of the element of the same name. Soft lights are an extension: the course has the first four.
_MAKERS = (ambient_light, parallel_light, point_light, spot_light, sky_light, sun_light, ball_light, panel_light)
LIGHTS: Mapping[str, Callable[..., NDArray[np.void]]] = {make.__name__: make for make in _MAKERS}
_any, _positive, _not_negative, _cone = (
    functools.partial(number, rule) for rule in (ANY, POSITIVE, NOT_NEGATIVE, CONE)
)
_RGB = dict.fromkeys("rgb", _not_negative)
_XYZ = dict.fromkeys("xyz", _any)
_ANGLE = {"theta": _any}
_MEMBERS = _whole(1, MAX_LIGHTS, "lights")  # how many lights a soft light stands for
_MATERIAL = "material_solid|material_textured"
_FINISH = ("phong", "reflectance", "transmittance", "refraction")

ELEMENTS = {
    "scene": ElementKind({"output_file": file_name}, ("background_color", "camera", "lights", "surfaces")),
    "background_color": ElementKind(_RGB, doubt=_like_bytes),
    "camera": ElementKind(children=("position", "lookat", "up", "horizontal_fov", "resolution", "max_bounces")),
    "lookat": ElementKind(_XYZ),
    "up": ElementKind(_XYZ, check=_not_zero),
    "horizontal_fov": ElementKind({"angle": functools.partial(number, FOV)}),
    "resolution": ElementKind({"horizontal": integer, "vertical": integer}, check=_size),
    "max_bounces": ElementKind({"n": _whole(0, MAX_BOUNCES)}),
    "lights": ElementKind(many=tuple(LIGHTS)),
    "ambient_light": ElementKind(children=("color",)),
    "parallel_light": ElementKind(children=("color", "direction")),
    "point_light": ElementKind(children=("color", "position")),
    "spot_light": ElementKind(children=("color", "position", "direction", "falloff")),
    "sky_light": ElementKind(children=("color",), optional=("up", "below", "directions"), check=_up_with_below),
    "sun_light": ElementKind({"angle": _cone}, ("color", "direction"), ("directions",)),
    "ball_light": ElementKind({"radius": _positive}, ("color", "position"), ("points",)),
    "panel_light": ElementKind(children=("color", "position", "across", "along"), optional=("points",), check=_spans),
    "color": ElementKind(_RGB, doubt=_like_bytes),
    "position": ElementKind(_XYZ),
    "direction": ElementKind(_XYZ, check=_not_zero),
    "falloff": ElementKind({"alpha1": _cone, "alpha2": _cone}, check=_ordered),
    "below": ElementKind(_RGB, doubt=_like_bytes),
    "across": ElementKind(_XYZ, check=_not_zero),
    "along": ElementKind(_XYZ, check=_not_zero),
    "directions": ElementKind({"n": _MEMBERS}),
    "points": ElementKind({"n": _MEMBERS}),
    "surfaces": ElementKind(many=("sphere", "mesh", "cylinder")),
    "sphere": ElementKind({"radius": _positive}, ("position", _MATERIAL), ("transform",)),
    "mesh": ElementKind({"name": relative_path}, (_MATERIAL,), ("transform",)),
    "cylinder": ElementKind({"radius": _positive}, ("start", "end", _MATERIAL), check=_long),
    "start": ElementKind(_XYZ),
    "end": ElementKind(_XYZ),
    "material_solid": ElementKind(children=("color", *_FINISH), check=_index_of_glass, doubt=_more_than_all),
    "material_textured": ElementKind(children=("texture", *_FINISH), check=_index_of_glass, doubt=_more_than_all),
    "texture": ElementKind({"name": relative_path}),
    "phong": ElementKind(dict.fromkeys(("ka", "kd", "ks", "exponent"), _not_negative)),
    "reflectance": ElementKind({"r": _not_negative}),
    "transmittance": ElementKind({"t": _not_negative}),
    "refraction": ElementKind({"iof": _any}),
    "transform": ElementKind(many=("translate", "scale", "rotateX", "rotateY", "rotateZ")),
    "translate": ElementKind(_XYZ),
    "scale": ElementKind(_XYZ, check=_not_singular),
    "rotateX": ElementKind(_ANGLE),
    "rotateY": ElementKind(_ANGLE),
    "rotateZ": ElementKind(_ANGLE),
}
# What is meant where something is missing and something unknown stands there: by the element and the unknown.
MEANT = {
    ("falloff", "angle"): "; alpha1 and alpha2 are measured from the axis: is half of the angle meant?",
    ("material_solid", "texture"): "; did you mean <material_textured>, which has a texture in place of the color?",
    ("material_textured", "color"): "; did you mean <material_solid>, which has a color in place of the texture?",
    ("sphere", "material_spheremap"): "; did you mean <material_textured> for <material_spheremap>?",
    ("mesh", "material_spheremap"): "; did you mean <material_textured> for <material_spheremap>?",
}
# The children of these are dropped as soon as they are read.
SECTIONS = ("scene", "lights", "surfaces")


def light_of(element: Element) -> NDArray[np.void]:
    """The light of an element, as LIGHTS makes it: of its attributes, vectors, and numbers of children."""
    given: dict[str, Any] = {}
    for name, value in element.values.items():
        if not isinstance(value, Element):
            given[name] = value
        elif name == "falloff":
            given |= value.values
        else:
            given[name] = value.values.get("n") or value.numbers
    return LIGHTS[element.tag](**given)
