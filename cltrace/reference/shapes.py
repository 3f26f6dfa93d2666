"""The table of shapes. To add one is to add its file and a row: nothing else names a kind of surface."""

from collections.abc import Callable, Iterable, Mapping

from cltrace.reference.cut import cuts
from cltrace.reference.cylinder import cylinders
from cltrace.reference.sphere import spheres
from cltrace.reference.surfaces import Setting, Surface
from cltrace.reference.triangles import meshes

Kinds = Mapping[str, Callable[[Setting], Iterable[Surface]]]

# What makes a scene's surfaces of each kind, which do not overlap in their numbers.
KINDS: Kinds = {"spheres": spheres, "meshes": meshes, "cylinders": cylinders, "cuts": cuts}
