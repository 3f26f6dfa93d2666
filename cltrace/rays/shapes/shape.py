"""What rays ask of the surfaces of one shape."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import Floats
from cltrace.exact.fine import Fine
from cltrace.rays.doubles import Met
from cltrace.rays.fine import Ends
from cltrace.rays.lines import Ids, Lines
from cltrace.rays.whole import Roots, WholeRays


class Points(Protocol):
    """k points of surfaces. normal: (k, 3), of any length, to either side; uv: (k, 2), where they are on a texture."""

    @property
    def normal(self) -> Floats: ...

    @property
    def uv(self) -> Floats: ...


class Shape(ABC):
    """n surfaces of one shape, which are the primitives `first` to first + n - 1.

    number: (n,), of the surface; primitive: (n,), of the triangle in its mesh, -1 of what is no triangle. The tree has
    them as balls around them, center: (n, 3), and outer: (n,), or as triangles, vertex: (v, 3), and face: (n, 3).
    """

    center, outer = np.empty((0, 3)), np.empty(0)
    vertex, face = np.empty((0, 3)), np.empty((0, 3), np.int32)

    def __init__(self, first: int, number: NDArray[np.integer], primitive: NDArray[np.integer] | None = None) -> None:
        self.first, self.number = first, number.astype(np.int64)
        self.primitive = np.full(len(number), -1) if primitive is None else primitive.astype(np.int64)

    def __len__(self) -> int:
        return len(self.number)

    @abstractmethod
    def meet(self, lines: Lines, ray: Ids, primitive: Ids) -> Met:
        """Which of these pairs meet, or may, as far as doubles are sure."""

    @abstractmethod
    def ends(self, lines: Lines, ray: Ids, primitive: Ids) -> Ends:
        """Where these pairs meet, as far as pairs of doubles are sure."""

    @abstractmethod
    def lengths(self, primitive: Ids) -> list[Floats]:
        """The numbers of surfaces that roots() takes, for WholeRays."""

    @abstractmethod
    def roots(self, rays: WholeRays, primitive: Ids) -> Roots:
        """What each ray meets first of its surface within its range, if anything."""

    @abstractmethod
    def points(self, lines: Lines, primitive: Ids, t: Fine) -> Points:
        """What is where rays meet surfaces, at t in units of w."""


def unit(v: Floats) -> Floats:
    """Vectors (n, 3) of length 1. The largest number goes to 1 first, for the range."""
    v = v / np.abs(v).max(axis=1, keepdims=True)
    return np.asarray(v / np.sqrt((v * v).sum(axis=1, keepdims=True)))
