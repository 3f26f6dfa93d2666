"""Colours as users write them: numbers, names of CSS, #rrggbb."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cltrace.scene.rules import NOT_NEGATIVE, Rule, Vector, check_not_bytes, checked, described, numbers, vector

ALPHA = Rule("within 0..1, as it is an alpha", low=0, high=1)


def color_numbers(name: str, value: Any, alpha: bool = False) -> Any:
    """`value` where no text is in it, else numbers: 3 of a text, (n, 3) of a list or an array of texts.

    A text is what CSS calls a colour: a name, #rgb, #rrggbb, or rgb() and hsl() with their arguments. Each byte of it
    is divided by 255. alpha: whether one text may have a fourth number, as #rrggbbaa. Raises ValueError, which begins
    with the name, for a text that is none.
    """
    if isinstance(value, str):
        return _of_text(name, value, alpha)
    if isinstance(value, np.ndarray) and value.dtype.kind == "U" and value.ndim == 1:
        texts, first, index = np.unique(value, return_index=True, return_inverse=True)
        table = [_of_text(f"{name}[{i}]", str(text)) for i, text in zip(first, texts, strict=True)]
        return np.array(table, np.float64).reshape(-1, 3)[index]
    if isinstance(value, (list, tuple)) and any(isinstance(color, str) for color in value):
        known: dict[str, tuple[float, ...]] = {}
        for i, color in enumerate(value):
            if isinstance(color, str) and color not in known:
                known[color] = _of_text(f"{name}[{i}]", color)
        return [known[color] if isinstance(color, str) else color for color in value]
    return value


def background_of(background: ArrayLike, alpha: ArrayLike) -> tuple[Vector, float]:
    """The colour of a background and its alpha, which is its fourth number, or else this one. Raises ValueError."""
    value = color_numbers("background", background, alpha=True)
    if numbers("background", value).shape == (4,):
        value, alpha = value[:3], value[3]
    color = vector("background", value, NOT_NEGATIVE)
    check_not_bytes("background", value)
    return color, float(checked("background_alpha", ALPHA, alpha, ()))


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
