"""An explanation: what is known of a pixel, as text and as JSON."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import Any

from cltrace.explanation.record import Facts
from cltrace.explanation.table import table
from cltrace.explanation.words import line, text


@dataclass(frozen=True)
class Explanation(Facts):
    """Why a pixel of a scene has its colour, see Facts. `str()` is the text of `cltrace SCENE.xml --explain X,Y`."""

    def __str__(self) -> str:
        return text(self)

    @property
    def line(self) -> str:
        """In one line: what the pixel sees, which lights reach it, and its bytes."""
        return line(self)

    @property
    def table(self) -> str:
        """Its numbers as lines between tabs, which a program of one's own can write, too: what `--trace` prints."""
        return table(self)

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain dicts, lists, texts and numbers; None for what is infinite or undefined."""
        plain: dict[str, Any] = _plain(asdict(self))
        return plain

    def to_json(self) -> str:
        """The same as one JSON object."""
        return json.dumps(self.to_dict(), allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
