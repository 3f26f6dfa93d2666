"""The schema of scene files: for each element its attributes, its children, and what these must be together.

A kind of attribute is a `Rule` for a number, or a function that reads the text. A fault is a ValueError; its words
belong behind the attribute's name.
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

Kind = Rule | Callable[[str], Any]
NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_FLOAT = re.compile(rf"{NUMBER}|[-+]?(?:nan|inf|infinity)", re.IGNORECASE)
_INTEGER = re.compile(r"[-+]?[0-9]+")
_XML_SPACE = " \t\r\n"


def value(kind: Kind, text: str) -> Any:
    """The value of an attribute with this text. Raises ValueError."""
    return number(kind, text) if isinstance(kind, Rule) else kind(text)


def number(rule: Rule, text: str) -> float:
    """A number that the rule allows."""
    # float() alone would also take '1_000' and other scripts' digits.
    written = text.strip(_XML_SPACE)
    if not _FLOAT.fullmatch(written):
        raise ValueError(f"must be a number, got {quoted(text)}")
    value = float(written)
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


Values = dict[str, Any]  # attribute -> value, child -> its Values; of a transform: "steps" -> [(element, Values), ...]


@dataclass(frozen=True)
class Element:
    """An element: every attribute and one of each of `children` is required ("a|b": one of the two).

    `check` says what makes no sense about the values together. It may raise KeyError where a value that it needs is
    missing or faulty itself.
    """

    attributes: Mapping[str, Kind] = field(default_factory=dict)
    children: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()
    many: tuple[str, ...] = ()
    check: Callable[[Values], str | None] = lambda _: None

    @functools.cached_property
    def slots(self) -> dict[str, str]:
        """For each child that may occur once, the entry of `children` or `optional` that it fills."""
        return {name: slot for slot in self.children + self.optional for name in slot.split("|")}

    @functools.cached_property
    def known(self) -> tuple[str, ...]:
        """The names of all children that may occur."""
        return (*self.slots, *self.many)


def _not_zero(v: Values) -> str | None:
    return None if v["x"] or v["y"] or v["z"] else "must not be 0"


def _not_singular(v: Values) -> str | None:
    return None if v["x"] and v["y"] and v["z"] else "must not be singular, got a factor of 0"


def _long(v: Values) -> str | None:
    return "end must not be the start" if v["start"] == v["end"] and len(v["start"]) == 3 else None


def rotations(attributes: Mapping[str, str]) -> tuple[str, ...]:
    """What a rotation may be meant to be that does not say its axis as the format does: by the axis that it names."""
    turned = [axis for axis in "xyz" if attributes.get(axis, "").strip(" +-0.")]
    named = [axis for axis in "xyz" if attributes.get("axis", "").strip().lower() == axis] or turned
    return (f"rotate{named[0].upper()}",) if len(named) == 1 else ()


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


def _up_with_below(v: Values) -> str | None:
    return "<below> goes with <up>, which is missing" if "below" in v and "up" not in v else None


def _spans(v: Values) -> str | None:
    across, along = (np.array(list(v[name].values())) for name in ("across", "along"))
    return "across and along must not be along one line" if spans_no_area(across, along) else None


# What makes the light of each element. Soft lights are an extension: the course has the first four.
LIGHTS: Mapping[str, Callable[..., NDArray[np.void]]] = {
    "ambient_light": ambient_light,
    "parallel_light": parallel_light,
    "point_light": point_light,
    "spot_light": spot_light,
    "sky_light": sky_light,
    "sun_light": sun_light,
    "ball_light": ball_light,
    "panel_light": panel_light,
}
_RGB = dict.fromkeys("rgb", NOT_NEGATIVE)
_XYZ = dict.fromkeys("xyz", ANY)
_ANGLE = {"theta": ANY}
_MEMBERS = _whole(1, MAX_LIGHTS, "lights")  # how many lights a soft light stands for
MATERIALS = ("material_solid", "material_textured")
_MATERIAL = "|".join(MATERIALS)
_FINISH = ("phong", "reflectance", "transmittance", "refraction")

ELEMENTS = {
    "scene": Element({"output_file": file_name}, ("background_color", "camera", "lights", "surfaces")),
    "background_color": Element(_RGB),
    "camera": Element(children=("position", "lookat", "up", "horizontal_fov", "resolution", "max_bounces")),
    "lookat": Element(_XYZ),
    "up": Element(_XYZ, check=_not_zero),
    "horizontal_fov": Element({"angle": FOV}),
    "resolution": Element({"horizontal": integer, "vertical": integer}, check=_size),
    "max_bounces": Element({"n": _whole(0, MAX_BOUNCES)}),
    "lights": Element(many=tuple(LIGHTS)),
    "ambient_light": Element(children=("color",)),
    "parallel_light": Element(children=("color", "direction")),
    "point_light": Element(children=("color", "position")),
    "spot_light": Element(children=("color", "position", "direction", "falloff")),
    "sky_light": Element(children=("color",), optional=("up", "below", "directions"), check=_up_with_below),
    "sun_light": Element({"angle": CONE}, ("color", "direction"), ("directions",)),
    "ball_light": Element({"radius": POSITIVE}, ("color", "position"), ("points",)),
    "panel_light": Element(children=("color", "position", "across", "along"), optional=("points",), check=_spans),
    "color": Element(_RGB),
    "position": Element(_XYZ),
    "direction": Element(_XYZ, check=_not_zero),
    "falloff": Element({"alpha1": CONE, "alpha2": CONE}, check=_ordered),
    "below": Element(_RGB),
    "across": Element(_XYZ, check=_not_zero),
    "along": Element(_XYZ, check=_not_zero),
    "directions": Element({"n": _MEMBERS}),
    "points": Element({"n": _MEMBERS}),
    "surfaces": Element(many=("sphere", "mesh", "cylinder")),
    "sphere": Element({"radius": POSITIVE}, ("position", _MATERIAL), ("transform",)),
    "mesh": Element({"name": relative_path}, (_MATERIAL,), ("transform",)),
    "cylinder": Element({"radius": POSITIVE}, ("start", "end", _MATERIAL), check=_long),
    "start": Element(_XYZ),
    "end": Element(_XYZ),
    "material_solid": Element(children=("color", *_FINISH), check=_index_of_glass),
    "material_textured": Element(children=("texture", *_FINISH), check=_index_of_glass),
    "texture": Element({"name": relative_path}),
    "phong": Element(dict.fromkeys(("ka", "kd", "ks", "exponent"), NOT_NEGATIVE)),
    "reflectance": Element({"r": NOT_NEGATIVE}),
    "transmittance": Element({"t": NOT_NEGATIVE}),
    "refraction": Element({"iof": ANY}),
    "transform": Element(many=("translate", "scale", "rotateX", "rotateY", "rotateZ")),
    "translate": Element(_XYZ),
    "scale": Element(_XYZ, check=_not_singular),
    "rotateX": Element(_ANGLE),
    "rotateY": Element(_ANGLE),
    "rotateZ": Element(_ANGLE),
}
# What is meant where something is missing and something unknown stands there: by the element and the unknown.
MEANT = {
    ("falloff", "angle"): "; alpha1 and alpha2 are measured from the axis: is half of the angle meant?",
    ("material_solid", "texture"): "; did you mean <material_textured>, which has a texture in place of the color?",
    ("material_textured", "color"): "; did you mean <material_solid>, which has a color in place of the texture?",
    ("sphere", "material_spheremap"): "; did you mean <material_textured> for <material_spheremap>?",
    ("mesh", "material_spheremap"): "; did you mean <material_textured> for <material_spheremap>?",
}
# The children of these are read and dropped while the file is being parsed.
SECTIONS = ("scene", "lights", "surfaces")


def light_of(name: str, values: Values) -> NDArray[np.void]:
    """The light of an element with this name, as LIGHTS makes it: its attributes, vectors, and numbers of children."""
    given: Values = {}
    for child, value in values.items():
        if not isinstance(value, dict):
            given[child] = value
        elif child == "falloff":
            given |= value
        else:
            given[child] = value["n"] if "n" in value else tuple(value.values())
    return LIGHTS[name](**given)
