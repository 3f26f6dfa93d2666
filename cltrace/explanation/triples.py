"""Three numbers, and numbers as they are printed."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cltrace.reference import Direction, Point

Triple = tuple[float, float, float]


def triple(v: Point | Direction) -> Triple:
    return (v.x, v.y, v.z)


def number(x: float) -> str:
    """A number as it is printed, with six digits."""
    return f"{x + 0.0:.6g}"  # makes -0 a 0


def vector(v: Triple) -> str:
    return f"({', '.join(map(number, v))})"
