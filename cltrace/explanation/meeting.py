"""What a ray meets, and what it passes by narrowly."""

from __future__ import annotations

import math

from cltrace.explanation.names import Names
from cltrace.explanation.record import SurfaceTest
from cltrace.explanation.shapes.table import textbook_of
from cltrace.explanation.space import Space
from cltrace.explanation.triples import number
from cltrace.reference import Intersection, Ray, Start, Surface, World
from cltrace.reference.ways import meetings

MOST = 8  # surfaces that are listed of a ray
TIED = "exactly as near as the closest one, which is seen because of its lower number, or that of its triangle"


class Meetings:
    """A ray among the surfaces of a world.

    found: those that it meets, closest first, at most MOST; count: how many these are in all.
    """

    def __init__(self, world: World, space: Space, names: Names, ray: Ray, at: Intersection | None) -> None:
        """at: what the ray meets first."""
        self.world, self.names, self.ray, self.at = world, names, ray, at
        self.o, self.d, self.space = space.start(ray), space.turned(ray.direction), space
        length, met = ray.direction.length(), meetings(world, ray, at)
        self.count, self._numbers = len(met), {meeting.surface.number for meeting in met}
        self.found = tuple(self._test(one.surface, one.t * length, tied=one.tied) for one in met[:MOST])

    def missed(self, behind: float) -> tuple[SurfaceTest, ...]:
        """The surfaces that the ray passes by, before what it meets, by less than a pixel's width there.

        behind: how far it is from the eye to the ray's start, along the rays before.
        """
        close, pixel = [], self.space.footprint(behind)
        for whole in self.world.surfaces:
            row = textbook_of(whole)
            for surface in row.beside(whole, self.o, self.d, pixel):
                if surface.number in self._numbers or self._starts_on(surface):
                    continue
                gap, t, single = row.gap(surface, self.o, self.d)
                pixels = gap / pixel.at(t) if 0 < t < (self.at.distance if self.at else math.inf) else 1.0
                if 0 <= pixels < 1:
                    close.append((pixels, single))
        close.sort(key=lambda one: one[0])
        return tuple(self._test(surface, math.inf, pixels) for pixels, surface in close[:MOST])

    def _starts_on(self, surface: Surface) -> bool:
        return isinstance(self.ray.origin, Start) and self.ray.origin.surface is surface

    def _test(self, surface: Surface, distance: float, gap: float = 0.0, tied: bool = False) -> SurfaceTest:
        own, textbook = self._starts_on(surface), textbook_of(surface).of(surface, self.o, self.d)
        remark = TIED if tied else _remark(textbook.first(own), distance, own)
        return SurfaceTest(self.names.surface(surface), textbook, distance=distance, gap=gap, remark=remark)


def _remark(textbook: float, exact: float, own: bool) -> str:
    """What to say where exact arithmetic differs from a textbook's number in what is printed of it."""
    if math.isinf(exact):
        return "" if math.isinf(textbook) else "exactly, it passes by: these numbers are rounded"
    if math.isinf(textbook):
        return f"exactly, it is met, at t = {number(exact)}: these numbers are rounded"
    if number(textbook) != number(exact):
        return f"exactly, t = {number(exact)}: these numbers are rounded"
    return "the one that is all but 0 is where the ray starts, and does not count: code takes an epsilon" if own else ""
