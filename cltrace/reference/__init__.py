"""The reference: the same ray tracer in plain Python, to be read beside the course's tutorial.

It favours plainness over speed: every ray tries every surface, in double precision; of a mesh, every triangle that it
does not surely pass by. kernels/trace.cl has the same functions under the same names, and formulas are written in the
order in which the kernel evaluates them, so that both compute the same bits.

Everything happens in camera space, as in the tutorial: the eye is the origin, x is right, y is up, -z is ahead. Read
the files in this order:

    vectors.py     Point, Direction and Matrix
    rays.py        Ray, and Start, the point of a surface by which a ray leaves it
    surfaces.py    Surface, which each shape implements, Material, Intersection
    sphere.py      Sphere, with the tutorial's equation
    ellipsoid.py   Ellipsoid
    triangles.py   Mesh, Triangle
    texture.py     Texture
    lights/        Light, ShadowRay, which leads to it, and a file for each kind of light
    bounce.py      where a ray goes on from a mirror or through glass: bounces, mirrored, refracted
    shapes.py      the table of shapes
    world.py       World: a scene as these objects
    pixel.py       Pixel, which sums up what rays see, and byte_of()
    records.py     what is decided on the way: Illumination, Shading, Sight
    trace.py       the algorithm: primary_ray, closest_hit, intersection_at, cast_shadow_ray, illuminate, shade,
                   follow, trace

That is a complete ray tracer. It takes any ray: from any point, over any range of t, from outside and from inside. The
rest is the care that makes each decision of it right, hit or miss, which is nearer, lit or shadowed:

    round.py       what spheres and ellipsoids have in common, in detail
    equation.py    the equation of ray and sphere in doubles that lose no digits
    crossing.py    ray and triangle likewise
    doubt.py       which answers doubles can give for certain
    exact.py       all other answers, in exact arithmetic, and what exactly they are about; ball.py and face.py, of
                   spheres and triangles
    ways.py        all that is on a ray's way, for explanations

What holds a picture against the reference is not here, but in cltrace/students/check.py.
"""

from cltrace.reference.bounce import mirrored, refracted
from cltrace.reference.ellipsoid import Ellipsoid
from cltrace.reference.lights import Light, ShadowRay
from cltrace.reference.pixel import Pixel, byte_of
from cltrace.reference.rays import EYE, Ray, Start
from cltrace.reference.round import OnSphere, Round
from cltrace.reference.sphere import Sphere
from cltrace.reference.surfaces import Intersection, Material, Surface, comes_first
from cltrace.reference.texture import Texture
from cltrace.reference.triangles import Mesh, OnTriangle, Triangle
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
    "Pixel",
    "Point",
    "Ray",
    "Round",
    "ShadowRay",
    "Sphere",
    "Start",
    "Surface",
    "Texture",
    "Triangle",
    "World",
    "byte_of",
    "comes_first",
    "mirrored",
    "refracted",
    "world_of",
]
