"""The text of an argument -> its value. What is wrong with it is said in one line."""

from __future__ import annotations

import math
import re
from argparse import ArgumentTypeError

from cltrace.base import limits
from cltrace.base.limits import MAX_TRIANGLES
from cltrace.picture.effects import Effects
from cltrace.picture.image import OUTPUTS, Output
from cltrace.plan.request import Crop
from cltrace.process.console import positive
from cltrace.scene import check_resolution


def picture_size(text: str) -> tuple[int, int]:
    """WxH of --size."""
    match = re.fullmatch(r"([0-9]{1,9})[xX]([0-9]{1,9})", text)
    if not match:
        raise ArgumentTypeError(f"must be WIDTHxHEIGHT, such as 640x480, got {text!r}")
    try:
        return check_resolution((int(match[1]), int(match[2])))
    except ValueError as error:
        raise ArgumentTypeError(str(error).removeprefix("camera.resolution: ")) from None


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


def outline(text: str) -> tuple[str, float]:
    """COLOR,WIDTH of --outline."""
    color, (width,) = _effect("outline", text, 1)
    return color, width


def fog(text: str) -> tuple[str, float, float]:
    """COLOR,NEAR,FAR of --fog."""
    color, (near, far) = _effect("fog", text, 2)
    return color, near, far


def _effect(name: str, text: str, numbers: int) -> tuple[str, list[float]]:
    """A colour and so many numbers; the commas of rgb() do not count."""
    color, *parts = text.rsplit(",", numbers)
    try:
        found = [float(part) for part in parts]
        Effects.of(**{"outline": None, "fog": None, name: (color, *found)}, transfer="linear")
    except ValueError as error:
        fault = str(error).removeprefix(f"{name}: ")
        raise ArgumentTypeError(f"{fault}, got {text!r}" if "got" not in fault else fault) from None
    return color, found


def outputs(text: str) -> list[Output]:
    """NAME,... of --outputs, in the order of OUTPUTS."""
    named = text.split(",")
    for name in named:
        if name not in OUTPUTS:
            raise ArgumentTypeError(f"must be of {', '.join(OUTPUTS)}, got {name!r}")
    return [name for name in OUTPUTS if name in named]


def triangles(text: str) -> int:
    """N of --instances."""
    if not re.fullmatch(r"[0-9]{1,9}", text) or int(text) > MAX_TRIANGLES:
        raise ArgumentTypeError(f"must be a whole number within 0..{MAX_TRIANGLES}, got {text!r}")
    return int(text)


def limit(text: str) -> str:
    """NAME=VALUE of --limit, which is in force already: entry.py has set it."""
    try:
        name, value = limits.limit_of(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from None
    if limits.current(name) != value:
        raise ArgumentTypeError(f"must be written out, and one for each name, got {text!r}")
    return text


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


def several(text: str) -> int:
    """N of --orbit, which has as many digits as a frame's number."""
    if not re.fullmatch(r"[0-9]{1,6}", text) or int(text) < 1:
        raise ArgumentTypeError(f"must be a whole number within 1..999999, got {text!r}")
    return int(text)


def axis(text: str) -> str | tuple[float, ...]:
    """x, y, z or X,Y,Z of --axis."""
    from cltrace.movie.frames import AXES

    if text in AXES:
        return text
    try:
        numbers = tuple(map(float, text.split(",")))
    except ValueError:
        numbers = ()
    if len(numbers) != 3 or not 0 < math.hypot(*numbers) < math.inf:
        raise ArgumentTypeError(f"must be x, y, z, or a direction X,Y,Z such as 0,1,0, got {text!r}")
    return numbers


def degrees(text: str) -> float:
    """A of --degrees."""
    return _number(text, "degrees, such as 360 or -90", -1e6, 1e6)


def fps(text: str) -> float:
    """F of --fps."""
    return _number(text, "frames a second, within 0.001..1000", 0.001, 1000)


def frames(text: str) -> slice:
    """A:B:S of --frames."""
    from cltrace.movie.frames import range_of

    try:
        return range_of(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from None


def _number(text: str, what: str, least: float, most: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise ArgumentTypeError(f"must be {what}, got {text!r}")
    return value
