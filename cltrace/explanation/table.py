"""The numbers of an explanation as a table, for a student's program to write the same and for `diff` to compare."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from cltrace.explanation.record import Facts, Hit, LightTerm, SoftTerm, TracedRay
from cltrace.explanation.triples import number

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
