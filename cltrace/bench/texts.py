"""Numbers as texts, for tables and lists."""

from __future__ import annotations

import math

from .points import Spread

# Stands where repeated rounds do not agree.
UNSTEADY = "~"


def number(value: float, digits: int = 2) -> str:
    """A number as text, with this many digits in as few characters as will do; empty for NaN."""
    if math.isnan(value):
        return ""
    if value == 0 or math.isinf(value):
        return "0" if value == 0 else "inf"
    if 1e-3 <= abs(value) < 1e5:
        places = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        return f"{value:,.{places}f}"
    return f"{value:.{digits - 1}e}".replace("e-0", "e-").replace("e+0", "e")


def percent(share: float | None) -> str:
    return "" if share is None or math.isnan(share) else f"{number(100 * share)} %"


def milliseconds(time: Spread) -> str:
    """The median, with a ~ where the rounds do not agree."""
    return number(1e3 * time.median, 3) + UNSTEADY * (time.rounds > 0 and not time.steady)
