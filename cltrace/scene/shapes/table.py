"""The table of shapes: a row for each but the spheres, in the order in which they are numbered, after these.

Cylinders are last, as their number changes where bonds follow the spheres.
"""

from dataclasses import fields

from cltrace.scene.shapes.cut import Cuts
from cltrace.scene.shapes.cylinder import Cylinders
from cltrace.scene.shapes.mesh import Meshes
from cltrace.scene.shapes.shape import Other

OTHERS: tuple[type[Other], ...] = (Meshes, Cuts, Cylinders)
# The fields of Scene that hold others than spheres.
OTHER_FIELDS = tuple(f.name for row in OTHERS for f in fields(row))
