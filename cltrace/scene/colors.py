"""Colours as users write them: numbers, names of CSS, #rrggbb."""

from __future__ import annotations

from typing import Any

import numpy as np

from cltrace.scene.rules import described


def color_numbers(name: str, value: Any) -> Any:
    """`value` where no text is in it, else numbers: 3 of a text, (n, 3) of a list or an array of texts.

    A text is what CSS calls a colour: a name, #rgb, #rrggbb, or rgb() and hsl() with their arguments. Each byte of it
    is divided by 255. Raises ValueError, which begins with the name, for a text that is none.
    """
    if isinstance(value, str):
        return _of_text(name, value)
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


def _of_text(name: str, text: str) -> tuple[float, ...]:
    from PIL import ImageColor  # only where it is needed: few scenes name their colours

    try:
        levels = ImageColor.getrgb(text)
    except ValueError:
        words = f"must be numbers, the name of a colour in CSS, or #rrggbb, got {described(text)}"
        raise ValueError(f"{name}: {words}") from None
    if len(levels) != 3:
        raise ValueError(f"{name}: must have no alpha, got {described(text)}")
    return tuple(level / 255 for level in levels)
