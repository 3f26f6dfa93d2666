"""What a ray meets, and what it passes by narrowly."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cltrace.explanation.formulas import (
    cylinder_gap,
    cylinder_test,
    mesh_gaps,
    sphere_gap,
    sphere_test,
    triangle_test,
)
from cltrace.explanation.many import Swarm
from cltrace.explanation.names import Names
from cltrace.explanation.record import SurfaceTest, TriangleTest
from cltrace.explanation.space import Footprint, Space
from cltrace.explanation.words import number
from cltrace.reference import Intersection, Mesh, Ray, Round, Start, Surface, Triangle, World
from cltrace.reference.cylinder import Cylinder
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
        for surface in self._beside(pixel):
            if surface.number in self._numbers or self._starts_on(surface):
                continue
            gap, t, single = self._gap(surface)
            pixels = gap / pixel.at(t) if 0 < t < (self.at.distance if self.at else math.inf) else 1.0
            if 0 <= pixels < 1:
                close.append((pixels, single))
        close.sort(key=lambda one: one[0])
        return tuple(self._test(surface, math.inf, pixels) for pixels, surface in close[:MOST])

    def _beside(self, pixel: Footprint) -> Iterator[Surface]:
        for surface in self.world.surfaces:
            if isinstance(surface, Swarm):
                yield from surface.beside(self.o, self.d, pixel)
            else:
                yield surface

    def _gap(self, surface: Surface) -> tuple[float, float, Surface]:
        """How far the ray passes by, at which distance, and of a mesh the triangle that is nearest to it."""
        if isinstance(surface, Round):
            return *sphere_gap(surface, self.o, self.d), surface
        if isinstance(surface, Cylinder):
            return *cylinder_gap(surface, self.o, self.d), surface
        assert isinstance(surface, Mesh)
        gaps, at = mesh_gaps(surface, self.o, self.d)
        k = int(np.argmin(gaps)) if len(gaps) else -1
        return (float(gaps[k]), float(at[k]), surface.triangle(k)) if k >= 0 else (math.inf, math.inf, surface)

    def _starts_on(self, surface: Surface) -> bool:
        return isinstance(self.ray.origin, Start) and self.ray.origin.surface is surface

    def _test(self, surface: Surface, distance: float, gap: float = 0.0, tied: bool = False) -> SurfaceTest:
        name, own = self.names.surface(surface), self._starts_on(surface)
        sphere = sphere_test(surface, self.o, self.d) if isinstance(surface, Round) else None
        triangle = triangle_test(surface, self.o, self.d) if isinstance(surface, Triangle) else None
        cylinder = cylinder_test(surface, self.o, self.d) if isinstance(surface, Cylinder) else None
        textbook = _first(sphere.t, own) if sphere else _within(triangle) if triangle else math.inf
        textbook = _first(cylinder.inside, own) if cylinder else textbook
        remark = TIED if tied else _remark(textbook, distance, own)
        return SurfaceTest(name, sphere, triangle, distance=distance, gap=gap, remark=remark, cylinder=cylinder)


def _first(ends: tuple[float, ...], own: bool) -> float:
    """Where the textbook has a ray meet a solid first. On the one that it leaves, one of the two is its start."""
    ahead = [t for t in ends if t > 0]
    if own and ahead and ends:
        ahead = [t for t in ends if t != min(ends, key=abs) and t > 0]
    return min(ahead, default=math.inf)


def _within(test: TriangleTest) -> float:
    return test.t if test.t > 0 and all(weight >= 0 for weight in test.weights) else math.inf


def _remark(textbook: float, exact: float, own: bool) -> str:
    """What to say where exact arithmetic differs from a textbook's number in what is printed of it."""
    if math.isinf(exact):
        return "" if math.isinf(textbook) else "exactly, it passes by: these numbers are rounded"
    if math.isinf(textbook):
        return f"exactly, it is met, at t = {number(exact)}: these numbers are rounded"
    if number(textbook) != number(exact):
        return f"exactly, t = {number(exact)}: these numbers are rounded"
    return "the one that is all but 0 is where the ray starts, and does not count: code takes an epsilon" if own else ""
