"""The table of shapes: a row for each. Many spheres are tried as one surface, see many.py."""

from cltrace.explanation.many import swarms
from cltrace.explanation.shapes.cap import CapTest
from cltrace.explanation.shapes.cylinder import CylinderTest
from cltrace.explanation.shapes.shape import Textbook
from cltrace.explanation.shapes.sphere import SphereTest
from cltrace.explanation.shapes.triangle import TriangleTest
from cltrace.reference import Surface
from cltrace.reference.world import KINDS as PLAIN

SHAPES: tuple[type[Textbook], ...] = (SphereTest, CylinderTest, TriangleTest, CapTest)
# What makes a scene's surfaces, as that of the reference does.
KINDS = {**PLAIN, "spheres": swarms}
# What normals are, by `shape` of Hit.
NORMALS = {shape: words for row in SHAPES for shape, words in row.normals.items()}


def textbook_of(surface: Surface) -> type[Textbook]:
    """Its row."""
    return next(row for row in SHAPES if isinstance(surface, row.surfaces))
