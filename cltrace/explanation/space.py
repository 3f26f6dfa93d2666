"""From camera space, where the reference tracer works, back to the world, where the scene's file is."""

from __future__ import annotations

from typing import NamedTuple

from cltrace.reference import Direction, Point, Ray, Start
from cltrace.reference.rays import view_of
from cltrace.scene import AnyCamera


class Footprint(NamedTuple):
    """How wide a pixel is along a ray: at its start, and by how much more for each unit of the way."""

    width: float
    more: float

    def at(self, t: float) -> float:
        return self.width + self.more * t


class Space:
    """The eye and the axes of a camera. pixel: the width of a pixel in the middle of the picture, at distance 1 or, of
    parallel rays, anywhere."""

    def __init__(self, camera: AnyCamera) -> None:
        self.eye, self.view = Point(*camera.position), view_of(camera)
        self.pixel, self.parallel = 2 * camera.image_plane()[0] / camera.resolution[0], camera.parallel

    def footprint(self, behind: float) -> Footprint:
        """Of a ray that starts so far from the eye, along the rays before."""
        return Footprint(self.pixel, 0.0) if self.parallel else Footprint(self.pixel * behind, self.pixel)

    def turned(self, d: Direction) -> Direction:
        """A direction of camera space in the world, with length 1."""
        return (self.view.B.T @ d).normalized()

    def start(self, ray: Ray) -> Point:
        """Where a ray starts, in the world, rounded."""
        return ray.origin.place + ray.origin.step if isinstance(ray.origin, Start) else self.eye
