"""The table of shapes: by its element, what reads it. Materials are in this order."""

from collections.abc import Mapping

from cltrace.formats.shapes.cylinder import Cylinders
from cltrace.formats.shapes.mesh import Meshes
from cltrace.formats.shapes.shape import Shape
from cltrace.formats.shapes.sphere import Spheres

SHAPES: Mapping[str, type[Shape]] = {"sphere": Spheres, "mesh": Meshes, "cylinder": Cylinders}
