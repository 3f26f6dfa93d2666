"""The table of shapes: the Kind of each. Nothing else in this room names them all."""

from cltrace.oracle.cylinders import Cylinders
from cltrace.oracle.search import Kind
from cltrace.oracle.spheres import Spheres
from cltrace.oracle.triangles import Triangles

KINDS: tuple[type[Kind], ...] = (Triangles, Spheres, Cylinders)
