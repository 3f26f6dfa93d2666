"""What is at the points that rays meet: where they are, normals, texture coordinates."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from cltrace.base.arithmetic import Floats, Pair
from cltrace.exact.fine import Fine, fine_vector
from cltrace.rays.lines import Ids, Lines
from cltrace.rays.shapes.shape import Points, unit
from cltrace.rays.surfaces import Surfaces


class Attributes:
    """Of n rays, each of which meets the primitive `index`, -1 for none, at T, pairs in units of w.

    lines: makes the rays, when something is asked for.
    """

    def __init__(self, surfaces: Surfaces, lines: Callable[[], Lines], index: Ids, T: Pair) -> None:
        self.surfaces, self.index, self.T = surfaces, index, T
        self._lines = lines

    @cached_property
    def lines(self) -> Lines:
        return self._lines()

    @cached_property
    def met(self) -> Ids:
        return np.flatnonzero(self.index >= 0)

    @cached_property
    def point(self) -> Floats:
        out, t = np.full((len(self.index), 3), np.nan), self._t(self.met)
        o, w = fine_vector(self.lines.origin[self.met]), fine_vector(self.lines.w[self.met])
        out[self.met] = np.stack([(x + t * y).h for x, y in zip(o, w, strict=True)], axis=1)
        return out

    @cached_property
    def normal(self) -> Floats:
        out = np.zeros((len(self.index), 3))
        for rows, points in self._points:
            out[rows] = points.normal
        out[self.met] = unit(out[self.met])
        out[(out * self.lines.w).sum(axis=1) > 0] *= -1
        return out + 0.0  # makes -0 a 0

    @cached_property
    def uv(self) -> Floats:
        out = np.zeros((len(self.index), 2))
        for rows, points in self._points:
            out[rows] = points.uv
        return out

    @cached_property
    def _points(self) -> list[tuple[Ids, Points]]:
        """For each shape, the rays that meet it, and the points where they do."""
        parts = self.surfaces.parts(self.index)
        return [(i, shape.points(self.lines.at(i), self.index[i], self._t(i))) for shape, i in parts]

    def _t(self, rows: Ids) -> Fine:
        return Fine(self.T[0][rows], self.T[1][rows], np.zeros(len(rows)))
