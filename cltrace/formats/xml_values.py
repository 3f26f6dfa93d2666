"""The values of attributes: their text -> numbers, names and paths.

A kind of value is a `Rule` for a number, or a function that reads the text. A fault is a ValueError; its words belong
behind the attribute's name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.limits import MAX_BOUNCES, MAX_LIGHTS, hint
from cltrace.scene import CONE, FOV, Rule

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


def bounces(text: str) -> int:
    """A depth limit of secondary rays."""
    n = integer(text)
    if not 0 <= n <= MAX_BOUNCES:
        raise ValueError(f"must be within 0..{MAX_BOUNCES}, got {n}")
    return n


def members(text: str) -> int:
    """How many lights a soft light stands for."""
    n = integer(text)
    if not 1 <= n <= MAX_LIGHTS:
        raise ValueError(f"must be within 1..{MAX_LIGHTS}, got {n}{hint('lights') if n > MAX_LIGHTS else ''}")
    return n


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


def like_bytes(colors: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which colours, (n, 3), seem to be meant as bytes of 0..255: where 1 is full, they are far too bright.

    One of their numbers is a whole one from 16 on, and none is above 255. A light may well be a few times brighter
    than 1, and a colour of bytes below 16 would be next to black.
    """
    whole = (colors >= 16) & (colors == np.rint(colors))
    found: NDArray[np.bool_] = whole.any(axis=1) & (colors <= 255).all(axis=1)
    return found


def short(text: str) -> str:
    """The beginning of a text, short enough for a message."""
    return text if len(text) <= 40 else f"{text[:37]}..."


def quoted(text: str) -> str:
    """The same in quotation marks, with control characters written as escapes."""
    return repr(short(text))
