"""From camera space, where the reference tracer works, back to the world, where the scene's file is."""

from __future__ import annotations

from cltrace.explanation.record import Triple
from cltrace.reference import Direction, Point, Ray, Start
from cltrace.reference.world import frame_of
from cltrace.scene import Camera


def triple(v: Point | Direction) -> Triple:
    return (v.x, v.y, v.z)


class Space:
    """The eye and the axes of a camera. pixel: the width of a pixel at distance 1, in the middle of the picture."""

    def __init__(self, camera: Camera) -> None:
        self.eye, self.frame = Point(*camera.position), frame_of(camera)
        self.pixel = 2 * camera.image_plane()[0] / camera.resolution[0]

    def turned(self, d: Direction) -> Direction:
        """A direction of camera space in the world, with length 1."""
        return (self.frame.B.T @ d).normalized()

    def start(self, ray: Ray) -> Point:
        """Where a ray starts, in the world, rounded."""
        return ray.origin.place + ray.origin.step if isinstance(ray.origin, Start) else self.eye
