"""The reference: the same ray tracer in plain Python, to be read beside the course's tutorial.

It favours plainness over speed: every ray tries every surface, in double precision; of a mesh, every triangle that it
does not surely pass by. kernels/trace.cl has the same functions under the same names, and formulas are written in the
order in which the kernel evaluates them, so that both compute the same bits.

Everything happens in camera space, as in the tutorial: the eye is the origin, x is right, y is up, -z is ahead. Read
the files in this order:

    vectors.py     Point, Direction and Matrix
    rays.py        Ray, and Start, the point of a surface by which a ray leaves it
    lights.py      Light, and ShadowRay, which leads to it
    surfaces.py    Surface, which each shape implements, PhongMaterial, Texture, Intersection
    spheres.py     Sphere, with the tutorial's equation, also of ellipsoids
    triangles.py   TriangleMesh, Triangle
    cylinders.py   Cylinder
    bounce.py      where a ray goes on from a mirror or through glass: bounces, mirrored, refracted
    clipping.py    Region, what clipping planes keep, and the caps of what they open
    world.py       World: a scene as these objects, and the table of shapes
    trace.py       what is decided on the way: Illumination, Shading, Sight; Pixel, which sums up what rays see; and the
                   algorithm: primary_ray, closest_hit, intersection_at, cast_shadow_ray, illuminate, shade, follow,
                   trace
    ways.py        all that is on a ray's way, for explanations, and what any rays of the world meet

That is a complete ray tracer. It takes any ray: from any point, over any range of t, from outside and from inside.
Doubles decide where they are sure, by bounds of their errors that are derived beside the formulas. Where they are not,
the exact engine does, cltrace/exact/: so each decision is right, hit or miss, which is nearer, lit or shadowed.

What holds a picture against the reference is not here, but in cltrace/students/check.py.
"""

from cltrace.reference.bounce import mirrored, refracted
from cltrace.reference.lights import ShadowRay
from cltrace.reference.rays import Ray, Start
from cltrace.reference.spheres import Sphere
from cltrace.reference.surfaces import Intersection, Surface, Texture
from cltrace.reference.trace import Pixel
from cltrace.reference.triangles import Triangle, TriangleMesh
from cltrace.reference.vectors import EYE, Direction, Point, byte_of
from cltrace.reference.world import World, world_of

__all__ = [
    "EYE",
    "Direction",
    "Intersection",
    "Pixel",
    "Point",
    "Ray",
    "ShadowRay",
    "Sphere",
    "Start",
    "Surface",
    "Texture",
    "Triangle",
    "TriangleMesh",
    "World",
    "byte_of",
    "mirrored",
    "refracted",
    "world_of",
]
