"""Many surfaces as one, of which a ray tries only those that it does not surely pass by."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from functools import lru_cache

from cltrace.reference.crossing import Way, shadow_way, way_of
from cltrace.reference.exact import Frame, Root
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray
from cltrace.reference.surfaces import Intersection, Surface, first_met
from cltrace.reference.vectors import Point


class Group(Surface):
    """Surfaces of which a ray meets the nearest one; of equally near ones, the first one.

    number: the first one's; eye: in the world; frame: the camera's axes.
    """

    def __init__(self, number: int, eye: Point, frame: Frame) -> None:
        self.number, self.eye, self.frame = number, eye, frame
        # It is asked about a ray twice: first where it meets the group, then what is there.
        self._first = lru_cache(maxsize=1)(self._find)

    @abstractmethod
    def near(self, way: Way | None) -> Iterator[Surface]:
        """The surfaces that a ray may meet, by rising numbers; all of them if nothing is known of its way."""

    def parts(self, ray: Ray | ShadowRay) -> Iterator[Surface]:
        return self.near(shadow_way(ray) if isinstance(ray, ShadowRay) else way_of(ray, self.frame, self.eye))

    def intersect(self, ray: Ray) -> float | None:
        met = self._first(ray)
        return met[0] if met else None

    def exact_t(self, ray: Ray) -> Root:
        return self._met_by(ray).exact_t(ray)

    def intersection_at(self, ray: Ray, t: float) -> Intersection:
        return self._met_by(ray).intersection_at(ray, t)

    def blocks(self, ray: ShadowRay) -> bool:
        return any(surface.blocks(ray) for surface in self.parts(ray))

    def _find(self, ray: Ray) -> tuple[float, Surface] | None:
        return first_met(self.parts(ray), ray)

    def _met_by(self, ray: Ray) -> Surface:
        met = self._first(ray)
        if met is None:
            raise ValueError("the ray does not hit the surface")
        return met[1]
