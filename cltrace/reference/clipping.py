"""Clipping: each ray is limited to its range within the convex region that the scene's planes keep.

A ray enters the region where it has passed the last of the planes by which it comes in, and leaves it where it passes
the first one by which it goes out, see exact.lines. So what a ray meets counts if its height above every plane is at
least 0. A ray that starts on a clipped surface starts in the region, but for rounding, and has only an end.

A ray that enters the region inside of a closed surface meets a cap there. The other end of a convex surface need not be
looked for: if its first point is before the region, then either the whole surface is, or the ray enters the region
inside of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from cltrace.exact.lines import ExactPlane, ExactPoint, Height, Line, Root, entry_of
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import NOWHERE, Ray, Start, View, exact_line
from cltrace.reference.surfaces import Intersection, PhongMaterial, Setting, Shape, Surface
from cltrace.reference.vectors import Direction, Point


@dataclass(frozen=True)
class ClipPlane:
    """point: S, and inward: m, in the world; outward: against m, of length 1, in camera space; material: of its caps,
    None for that of the surface that they close."""

    number: int
    point: Point
    inward: Direction
    outward: Direction
    material: PhongMaterial | None

    @cached_property
    def exact(self) -> ExactPlane:
        return ExactPlane(self.point, self.inward)


@dataclass(frozen=True)
class Entry:
    """Where a ray enters the region: by which plane, and the height of its points above that."""

    ray: Ray | ShadowRay
    plane: ClipPlane
    height: Height


class Region:
    """What the planes keep. Without planes, that is everything."""

    def __init__(self, planes: Sequence[ClipPlane], view: View) -> None:
        self.planes, self.view = planes, view

    def entry(self, ray: Ray | ShadowRay) -> Entry | None:
        """Where a ray enters the region between its ends; None if it starts in the region, or never enters it."""
        start = ray.start if isinstance(ray, ShadowRay) else ray.origin
        if not self.planes or (isinstance(start, Start) and start.surface is not None and start.surface.clipped):
            return None
        line = ray.line if isinstance(ray, ShadowRay) else exact_line(ray, self.view)
        heights = {plane.number: plane.exact.along(line) for plane in self.planes}
        last = entry_of(heights.values())
        if last is None or not last.root.is_between(0.0 if isinstance(ray, ShadowRay) else ray.t_min, ray.t_max):
            return None
        return Entry(ray, next(plane for plane in self.planes if heights[plane.number] is last), last)

    def keeps(self, line: Line, root: Root) -> bool:
        """Whether the point of a line at a root is in the region."""
        return all(plane.exact.along(line).sign_at(root) >= 0 for plane in self.planes)

    def cap(self, surfaces: Sequence[Shape], ray: Ray | ShadowRay) -> Cap | None:
        """What closes the surface of the lowest number inside of which a ray enters the region."""
        entry = self.entry(ray)
        if entry is None:
            return None
        solids = [solid for surface in surfaces for solid in surface.solids(ray) if solid.clipped]
        closed = [solid for solid in solids if solid.contains(entry)]
        return Cap(entry, min(closed, key=lambda solid: solid.number)) if closed else None

    def parts(self, surfaces: Sequence[Shape], ray: Ray) -> Iterator[Surface]:
        """The parts of surfaces that a ray may meet first in the region, its cap first."""
        cap = self.cap(surfaces, ray)
        if cap:
            yield cap
        for part in (part for surface in surfaces for part in surface.parts(ray)):
            free = not (self.planes and part.clipped)
            if free or (
                part.intersect(ray) is not None and self.keeps(exact_line(ray, self.view), part.exact_t(ray))
            ):  # fmt: skip
                yield part

    def blockers(self, surfaces: Sequence[Shape], ray: ShadowRay) -> Iterator[Surface]:
        """The parts of surfaces that stand, in the region, between the start of a shadow ray and its light."""
        for part in (part for surface in surfaces for part in surface.parts(ray)):
            if part.blocks(ray) and (not (self.planes and part.clipped) or self.keeps(*part.blocking_root(ray))):
                yield part
        cap = self.cap(surfaces, ray)
        if cap:
            yield cap


class Cap(Surface):
    """What closes a surface where a ray of the camera enters the region inside of it: it lies in the plane there."""

    shape = "cap"

    def __init__(self, entry: Entry, closed: Shape) -> None:
        self.entry, self.view, self.number, self.kind = entry, closed.view, closed.number, f"cap of {closed.kind}"
        self.material = entry.plane.material or replace(closed.material, texture=None)
        self.primitive = -2 - entry.plane.number

    def intersect(self, ray: Ray) -> float | None:
        return float(self.entry.height.root)

    def exact_t(self, ray: Ray) -> Root:
        return self.entry.height.root

    def blocks(self, ray: ShadowRay) -> bool:
        return False

    def intersection_at(self, ray: Ray, t: float) -> Intersection:
        return Intersection(
            point=ray.at(t),
            t=t,
            distance=t * math.sqrt(ray.direction.dot(ray.direction)),
            normal=self.entry.plane.outward,
            inside=False,
            start=self.start(),
            material=self.material,
            uv=(0.0, 0.0),
            index=self.number,
            primitive=self.primitive,
        )

    def start(self) -> Start:
        """Where the ray meets it, rounded to doubles of the world. As nothing is met in a plane, rays may start beside
        it."""
        line, root = self.entry.height.line, self.entry.height.root
        t, o, unit = root.value() / line.unit, line.start, line.start.over
        place = Point(*(float(a.between(256).low / unit + t * w.p) for a, w in zip(o.numbers, line.way, strict=True)))
        exact = ExactPoint.of(place)
        anchor, nowhere = self.view.seen(exact), self.view.B @ NOWHERE
        return Start(self, self.view, place, anchor, NOWHERE, nowhere, 0.0, anchor + nowhere, lambda: exact)


def region_of(setting: Setting) -> Region:
    """That of a scene."""
    planes = []
    for i, plane in enumerate(setting.scene.planes):
        normal = plane["normal"].tolist()
        material = setting.material(int(plane["material"])) if plane["material"] >= 0 else None
        inward = Direction(*(-x for x in normal))
        planes.append(ClipPlane(i, Point(*plane["point"].tolist()), inward, setting.view.turned(normal), material))
    return Region(planes, setting.view)
