"""What an explanation has to draw over the picture: the pixel's rays, those that go on from it, and shadow rays."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from cltrace.explanation.explanation import Explanation
from cltrace.explanation.record import Hit, LightTerm
from cltrace.explanation.triples import Triple
from cltrace.students.places import members

# Lines that are drawn at most: glass in the light of a sky has more.
MOST = 2000


@dataclass(frozen=True)
class Line:
    """From one point of the world to another.

    kind: of a ray: primary, mirrored, refracted; of a shadow ray its fate, see LightTerm, and "beyond" for the rest of
    the way to the light behind what blocks it.
    """

    kind: str
    start: Triple
    end: Triple


def as_json(found: Explanation, reach: float) -> str:
    """The first MOST lines of an explanation, and how many there are. reach: see lines_of()."""
    lines = list(lines_of(found, reach))
    return json.dumps({"lines": [asdict(line) for line in lines[:MOST]], "count": len(lines)})


def lines_of(found: Explanation, reach: float) -> Iterator[Line]:
    """All of them, the pixel's ray first. reach: how long those are that have no end, in scene units."""
    for ray in found.rays:
        yield Line(ray.kind, ray.origin, ray.hit.point if ray.hit else _along(ray.origin, ray.direction, reach))
        for light in ray.lights:
            for one in members(light):
                assert ray.hit
                yield from _shadow_ray(ray.hit, one, reach)


def _shadow_ray(hit: Hit, light: LightTerm, reach: float) -> Iterator[Line]:
    """From the point to what blocks it, and to the light."""
    start, end = hit.point, _along(hit.point, light.l, light.distance if math.isfinite(light.distance) else reach)
    blocker = light.between[0].point if light.between else None
    yield Line(light.fate, start, blocker or end)
    if blocker:
        yield Line("beyond", blocker, end)


def _along(start: Triple, direction: Triple, way: float) -> Triple:
    x, y, z = (place + way * towards for place, towards in zip(start, direction, strict=True))
    return (x, y, z)
