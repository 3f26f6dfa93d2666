"""An explanation: what is known of a pixel, as text, as JSON, and as a table.

The table is for a student's program to write the same and for `diff` to compare.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

from cltrace.explanation.record import Facts, Hit, LightTerm, SoftTerm, TracedRay
from cltrace.explanation.textbook import number
from cltrace.explanation.words import line, text

Row = tuple[str, Iterable[float]]


def table(e: Facts) -> str:
    """A line for each quantity: the ray's number, what it is, and its numbers as "%.6g" writes them, between tabs."""
    lines = []
    for place, ray in enumerate(e.rays):
        rows = [*(_camera(e) if not place else ()), *_ray(ray)]
        lines += ["\t".join((str(place), name, *map(number, numbers))) for name, numbers in rows]
    return "\n".join([*lines, "\t".join(("0", "bytes", *map(str, e.rgb8)))])


def _camera(e: Facts) -> Iterator[Row]:
    c = e.camera
    yield "x_n y_n", (c.x_n, c.y_n)
    yield "x_i y_i", (c.x_i, c.y_i)
    yield from zip(("camera x", "camera y", "camera z"), c.axes, strict=True)


def _ray(ray: TracedRay) -> Iterator[Row]:
    yield "depth", (ray.depth,)
    yield "o", ray.origin
    yield "d", ray.direction
    if ray.hit:
        yield from _hit(ray.hit)
    for term in ray.ambient:
        yield f"light {term.light.number} ambient", term.color
    for light in ray.lights:
        yield from _soft(light) if isinstance(light, SoftTerm) else _light(light)
    if ray.bounces:
        yield "local color", ray.local
    yield "color", ray.color


def _hit(hit: Hit) -> Iterator[Row]:
    yield "surface", (hit.surface.id,)
    yield "t", (hit.t,)
    yield "P", hit.point
    yield "n", hit.normal
    yield "inside", (hit.inside,)
    if hit.texture:
        yield "u v", hit.texture.uv
    yield "C", hit.color


def _soft(term: SoftTerm) -> Iterator[Row]:
    """How a soft light reaches the point is a share of its members."""
    name = f"light {term.light.number}"
    yield f"{name} reaches", (term.fates.get("lit", 0) / len(term.members),)
    if term.fate == "lit":
        yield f"{name} diffuse", term.diffuse
        yield f"{name} specular", term.specular


def _light(term: LightTerm) -> Iterator[Row]:
    """How a light reaches the point is one number: 1 where nothing is between, else 0."""
    name = f"light {term.light.number}"
    yield f"{name} l", term.l
    yield f"{name} n.l", (term.n_l,)
    if term.cone:
        yield f"{name} F", (term.strength,)
    yield f"{name} reaches", (term.fate == "lit",)
    if term.fate == "lit":
        yield f"{name} r.v", (term.r_v,)
        yield f"{name} diffuse", term.diffuse
        yield f"{name} specular", term.specular


@dataclass(frozen=True)
class Explanation(Facts):
    """Why a pixel of a scene has its colour, see Facts. `str()` is the text of `cltrace SCENE.xml --explain X,Y`."""

    def __str__(self) -> str:
        return text(self)

    @property
    def line(self) -> str:
        """In one line: what the pixel sees, which lights reach it, and its bytes."""
        return line(self)

    @property
    def table(self) -> str:
        """Its numbers as lines between tabs, which a program of one's own can write, too: what `--trace` prints."""
        return table(self)

    def to_dict(self) -> dict[str, Any]:
        """All of it as plain dicts, lists, texts and numbers; None for what is infinite or undefined."""
        plain: dict[str, Any] = _plain(asdict(self))
        return plain

    def to_json(self) -> str:
        """The same as one JSON object."""
        return json.dumps(self.to_dict(), allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
