"""The table of shapes: the spheres, and a row for each other shape, in the order in which they are numbered.

Cylinders are last, as their number changes where bonds follow the spheres.
"""

from dataclasses import fields

from cltrace.scene.shapes.cylinder import Cylinders
from cltrace.scene.shapes.mesh import Meshes
from cltrace.scene.shapes.shape import Other, Shape
from cltrace.scene.shapes.sphere import Spheres

OTHERS: tuple[type[Other], ...] = (Meshes, Cylinders)
SHAPES: tuple[type[Shape], ...] = (Spheres, *OTHERS)
# The fields of Scene that hold others than spheres.
OTHER_FIELDS = tuple(f.name for row in OTHERS for f in fields(row))
