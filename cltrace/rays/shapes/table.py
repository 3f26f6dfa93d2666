"""The shapes that there are. Balls come before triangles, as the tree has them."""

from cltrace.rays.shapes.cut import Cuts
from cltrace.rays.shapes.cylinder import Cylinders
from cltrace.rays.shapes.sphere import Spheres
from cltrace.rays.shapes.triangle import Triangles

SHAPES = (Spheres, Cylinders, Cuts, Triangles)
