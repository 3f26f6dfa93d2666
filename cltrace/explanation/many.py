"""Many spheres as one surface, of which a ray tries only those that it does not surely pass by.

The reference tracer tries all spheres for every ray, as the tutorial has it. Where a pixel of a million spheres is to
be explained, that would take minutes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arithmetic import inverses
from cltrace.explanation.space import Footprint
from cltrace.explanation.triples import triple
from cltrace.reference import Direction, Point, Ray, Round
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Way
from cltrace.reference.spheres import maker
from cltrace.reference.surfaces import Group, Setting, Surface
from cltrace.reference.vectors import size_of

MANY = 64  # spheres with numbers that follow each other, from which on they are a swarm


class Swarm(Group):
    """Spheres and ellipsoids with numbers that follow each other, each of which is made when a ray may meet it.

    number: the first one's; places: of these spheres among the scene's.
    """

    def __init__(self, setting: Setting, make: Callable[[int], Round], places: range) -> None:
        scene = setting.scene
        super().__init__(int(scene.sphere_numbers[places[0]]), setting.view)
        self._make, self._places, self._made = make, places, dict[int, Round]()
        part = scene.spheres[places.start : places.stop]
        self._centers, self._reach = part["center"], part["radius"].copy()
        bent = part["to_object"] >= 0
        if bent.any():
            sizes = np.abs(inverses(scene.to_object)).sum(axis=(1, 2))
            self._reach[bent] *= sizes[part["to_object"][bent]]

    def sphere(self, row: int) -> Round:
        if row not in self._made:
            self._made[row] = self._make(self._places[row])
        return self._made[row]

    def near(self, way: Way | None) -> Iterator[Round]:
        """The spheres that a ray may meet, by rising numbers. All others it surely passes by, or leads away from.

        With f from the start to a centre and R the reach, a ray along w passes by where |f x w| > R |w|, and leads away
        where f.w < -R |w|. As rays.Way has it, with u = 2^-53 and s = |f|_1 + reach, f is
        off by 48 u s and w by 48 u w1. So f x w and f.w are off by less than 100 u s w1 < 2^-46 s w1, and |w| by 2^-44
        of itself, as w1 <= 4 |w|_1. A few roundings beside these fit in twice that.
        """
        rows = np.arange(len(self._reach))
        if way is not None and way.w1 <= 4 * size_of(way.w):
            w = np.array(triple(way.w))
            f = (self._centers - np.array(triple(way.place))) - np.array(triple(way.step))
            error = 2.0**-45 * (np.abs(f).sum(axis=1) + way.reach) * way.w1
            room = self._reach * (np.sqrt(w @ w) * (1 + 2.0**-42)) + error
            rows = np.flatnonzero(~((_lengths(np.cross(f, w)) > room) | (f @ w < -room)))
        for row in rows.tolist():
            yield self.sphere(row)

    def solids(self, ray: Ray | ShadowRay) -> Iterator[Surface]:
        return self.parts(ray)

    def beside(self, o: Point, d: Direction, pixel: Footprint) -> Iterator[Round]:
        """Those that a ray may pass by by less than a pixel's width there. d: of length 1."""
        f, w, R = self._centers - np.array(triple(o)), np.array(triple(d)), self._reach
        t = f @ w
        close = (t > -R) & (_lengths(np.cross(f, w)) < R + (pixel.width + pixel.more * (np.abs(t) + R)))
        for row in np.flatnonzero(close).tolist():
            yield self.sphere(row)


def swarms(setting: Setting) -> Iterator[Surface]:
    """The spheres of a scene: those with numbers that follow each other as a swarm, if they are many."""
    numbers, make = setting.scene.sphere_numbers, maker(setting)
    ends = [0, *(np.flatnonzero(np.diff(numbers) != 1) + 1).tolist(), len(numbers)]
    for begin, end in itertools.pairwise(ends):
        if end - begin >= MANY:
            yield Swarm(setting, make, range(begin, end))
        else:
            yield from map(make, range(begin, end))


def _lengths(v: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths: NDArray[np.float64] = np.sqrt((v * v).sum(axis=1))
    return lengths
