"""Colours as users write them: numbers, names of CSS, #rrggbb; linear, or by the curve of sRGB."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene.rules import NOT_NEGATIVE, Rule, Vector, check_not_bytes, checked, described, numbers, vector

Transfer = Literal["linear", "srgb"]
TRANSFERS: tuple[Transfer, ...] = get_args(Transfer)
ALPHA = Rule("within 0..1, as it is an alpha", low=0, high=1)


def color_numbers(name: str, value: Any, alpha: bool = False) -> Any:
    """`value` where no text is in it, else numbers: 3 of a text, (n, 3) of a list or an array of texts.

    A text is what CSS calls a colour: a name, #rgb, #rrggbb, or rgb() and hsl() with their arguments. Each byte of it
    is divided by 255. Of numbers, a fourth one of each colour is left out where it is 1, as maps of matplotlib have it.
    alpha: whether there may be a fourth number, as #rrggbbaa, which is then kept. Raises ValueError, which begins with
    the name, for a text that is none, and for an alpha below 1.
    """
    if isinstance(value, str):
        return _of_text(name, value, alpha)
    if isinstance(value, np.ndarray) and value.dtype.kind in "UTO":  # O: such as a table's column
        value = value.tolist()
    if isinstance(value, (list, tuple)) and any(isinstance(color, str) for color in value):
        if not all(isinstance(color, str) for color in value):
            return [_of_text(f"{name}[{i}]", c) if isinstance(c, str) else c for i, c in enumerate(value)]
        place = {text: k for k, text in enumerate(dict.fromkeys(value))}
        table = np.array([_of_text(f"{name}[{value.index(text)}]", text) for text in place])
        return table[[place[text] for text in value]]
    return value if alpha else _without_alpha(name, value)


def _without_alpha(name: str, value: Any) -> Any:
    """Colours without their fourth number. Raises ValueError where one of those is not full."""
    try:
        array = np.asarray(value)
    except ValueError:  # rows of several lengths, which are refused elsewhere
        return value
    if array.dtype.kind not in "iuf" or array.ndim not in (1, 2) or array.shape[-1] != 4:
        return value
    full = 255 if array.dtype.kind in "iu" and array.max(initial=0) > 1 else 1
    see_through = array[..., 3] != full
    if see_through.any():
        place = f"[{int(np.argmax(see_through))}]" if array.ndim == 2 else ""
        got = float(array[..., 3][see_through].flat[0])
        raise ValueError(f"{name}{place}: must have no alpha below {full}, as surfaces are opaque, got {got:g}")
    return array[..., :3]


def check_transfer(transfer: object) -> None:
    """Raises ValueError if there is no such curve."""
    if not isinstance(transfer, str) or transfer not in TRANSFERS:
        raise ValueError(f"transfer: must be {' or '.join(TRANSFERS)}, got {described(transfer)}")


def decoded(color: NDArray[Any], transfer: Transfer) -> NDArray[Any]:
    """Linear colours of those that are written so, >= 0, of the same float type.

    sRGB is that of IEC 61966-2-1: c / 12.92 up to 0.04045, and ((c + 0.055) / 1.055)^2.4 above, also beyond 1.
    """
    if transfer == "linear":
        return color
    c = color.astype(np.float64)
    return np.asarray(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4), color.dtype)


def encoded(color: ArrayLike, transfer: Transfer) -> NDArray[np.float64]:
    """How linear colours >= 0 are written: what decoded() undoes. 1 stays 1."""
    c = np.asarray(color, np.float64)
    if transfer == "linear":
        return c
    return np.where(c <= 0.04045 / 12.92, 12.92 * c, 1 + 1.055 * (c ** (1 / 2.4) - 1))


def background_of(background: ArrayLike, alpha: ArrayLike, transfer: Transfer = "linear") -> tuple[Vector, float]:
    """The linear colour of a background and its alpha, which is its fourth number, or else this one.

    transfer: how the colour is given. Raises ValueError.
    """
    value = color_numbers("background", background, alpha=True)
    if numbers("background", value).shape == (4,):
        value, alpha = value[:3], value[3]
    given = vector("background", value, NOT_NEGATIVE)
    check_not_bytes("background", value)
    red, green, blue = decoded(np.array(given), transfer).tolist()
    return (red, green, blue), float(checked("background_alpha", ALPHA, alpha, ()))


def _of_text(name: str, text: str, alpha: bool = False) -> tuple[float, ...]:
    from PIL import ImageColor  # only where it is needed: few scenes name their colours

    try:
        levels = ImageColor.getrgb(text)
    except ValueError:
        words = f"must be numbers, the name of a colour in CSS, or #rrggbb, got {described(text)}"
        raise ValueError(f"{name}: {words}") from None
    if len(levels) == 4 and not alpha:
        raise ValueError(f"{name}: must have no alpha, got {described(text)}")
    return tuple(level / 255 for level in levels)
