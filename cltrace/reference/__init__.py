"""The reference: the same ray tracer in plain Python, to be read beside the course's tutorial.

It favours plainness over speed: every ray tries every surface, in double precision; of a mesh, every triangle that it
does not surely pass by. kernels/trace.cl has the same functions under the same names, and formulas are written in the
order in which the kernel evaluates them, so that both compute the same bits.

Everything happens in camera space, as in the tutorial: the eye is the origin, x is right, y is up, -z is ahead. Read
the files in this order:

    vectors.py     Point, Direction and Matrix
    rays.py        Ray, and Start, the point of a surface by which a ray leaves it
    surfaces.py    Surface, Sphere with the tutorial's equation, Ellipsoid, Material, Intersection
    triangles.py   Mesh, Triangle
    texture.py     Texture
    lights.py      Light, and ShadowRay, which leads to it
    bounce.py      where a ray goes on from a mirror or through glass: mirrored, refracted
    world.py       World: a scene as these objects
    trace.py       the algorithm: primary_ray, closest_hit, cast_shadow_ray, illuminate, trace, byte_of

That is a complete ray tracer. It takes any ray: from any point, over any range of t, from outside and from inside. The
rest is the care that makes each decision of it right, hit or miss, which is nearer, lit or shadowed:

    equation.py    the equation of ray and sphere in doubles that lose no digits
    crossing.py    ray and triangle likewise
    doubt.py       which answers doubles can give for certain
    exact.py       all other answers, in exact arithmetic, and what exactly they are about

check.py holds a picture against the reference.
"""

from cltrace.reference.bounce import mirrored, refracted
from cltrace.reference.lights import Light, ShadowRay
from cltrace.reference.rays import EYE, OnSphere, OnTriangle, Ray, Start
from cltrace.reference.surfaces import Ellipsoid, Intersection, Material, Sphere, Surface, comes_first
from cltrace.reference.texture import Texture
from cltrace.reference.trace import (
    byte_of,
    cast_shadow_ray,
    closest_hit,
    illuminate,
    local_color,
    primary_ray,
    trace,
)
from cltrace.reference.triangles import Mesh, Triangle
from cltrace.reference.vectors import Color, Direction, Point
from cltrace.reference.world import World, world_of

__all__ = [
    "EYE",
    "Color",
    "Direction",
    "Ellipsoid",
    "Intersection",
    "Light",
    "Material",
    "Mesh",
    "OnSphere",
    "OnTriangle",
    "Point",
    "Ray",
    "ShadowRay",
    "Sphere",
    "Start",
    "Surface",
    "Texture",
    "Triangle",
    "World",
    "byte_of",
    "cast_shadow_ray",
    "closest_hit",
    "comes_first",
    "illuminate",
    "local_color",
    "mirrored",
    "primary_ray",
    "refracted",
    "trace",
    "world_of",
]
