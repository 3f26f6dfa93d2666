"""The text of an argument -> its value. What is wrong with it is said in one line."""

from __future__ import annotations

import re
from argparse import ArgumentTypeError

from cltrace.console import positive
from cltrace.picture.image import OUTPUTS, Output
from cltrace.plan.request import KEEPS, Crop, Keep


def crop(text: str) -> Crop:
    """X0,Y0,X1,Y1 of --crop."""
    if not re.fullmatch(r"[0-9]{1,9}(,[0-9]{1,9}){3}", text):
        sign = " without a sign" if "-" in text or "+" in text else ""
        raise ArgumentTypeError(f"must be X0,Y0,X1,Y1{sign}, such as 0,0,64,64, got {text!r}")
    x0, y0, x1, y1 = map(int, text.split(","))
    return (x0, y0, x1, y1)


def pixel(text: str) -> tuple[int, int]:
    """X,Y of --explain."""
    if not re.fullmatch(r"[0-9]{1,9},[0-9]{1,9}", text):
        raise ArgumentTypeError(f"must be X,Y from the top left, such as 320,200, got {text!r}")
    x, y = map(int, text.split(","))
    return x, y


def levels(text: str) -> int:
    """N of --tolerance."""
    if not re.fullmatch(r"[0-9]{1,3}", text) or int(text) > 255:
        raise ArgumentTypeError(f"must be a whole number of levels within 0..255, got {text!r}")
    return int(text)


def keep(text: str) -> list[Keep]:
    """NAME,... of --keep."""
    names = [name for name in KEEPS if name in text.split(",")]
    for name in text.split(","):
        if name not in KEEPS:
            raise ArgumentTypeError(f"must be of {', '.join(KEEPS)}, got {name!r}")
    return names


def outputs(text: str) -> list[Output]:
    """NAME,... of --outputs."""
    names = [name for name in OUTPUTS if name in text.split(",")]
    for name in text.split(","):
        if name not in OUTPUTS:
            raise ArgumentTypeError(f"must be of {', '.join(OUTPUTS)}, got {name!r}")
    return names


def repeats(text: str) -> int:
    """N of --repeat."""
    if text.endswith(".xml"):
        raise ArgumentTypeError(f"put the scene first, or say --check=N; {text!r} is not a number")
    return positive(text)


def form(text: str) -> str:
    """text or json of --stats."""
    if text.endswith(".xml"):
        raise ArgumentTypeError(f"put the scene first, or say --stats=text; {text!r} is not a form")
    return text


def count(text: str) -> str | int:
    """N, all or default of --check."""
    return text if text in ("all", "default") else repeats(text)
