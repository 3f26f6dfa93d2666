"""The reference: the same ray tracer in plain Python, to be read beside the course's tutorial."""

from cltrace.reference.reference import (
    EYE,
    Direction,
    Intersection,
    Material,
    Point,
    Ray,
    World,
    byte_of,
    cast_shadow_ray,
    closest_hit,
    illuminate,
    primary_ray,
    trace,
    world_of,
)

__all__ = [
    "EYE",
    "Direction",
    "Intersection",
    "Material",
    "Point",
    "Ray",
    "World",
    "byte_of",
    "cast_shadow_ray",
    "closest_hit",
    "illuminate",
    "primary_ray",
    "trace",
    "world_of",
]
