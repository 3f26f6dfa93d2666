"""The table of shapes: a row for each. Surfaces are in this order wherever there is one list of all of them.

Triangles are last, as the kernel, and what is held elsewhere (Held in accel/grids.py), tell them by the first one's
index.
"""

from cltrace.plan.shapes.cylinder import Cylinders
from cltrace.plan.shapes.mesh import Meshes
from cltrace.plan.shapes.shape import Shape
from cltrace.plan.shapes.sphere import Spheres

SHAPES: tuple[type[Shape], ...] = (Spheres, Cylinders, Meshes)
