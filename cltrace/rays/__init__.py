"""What any rays meet of a scene, exactly: trace_rays(). Host only; no OpenCL.

lines.py       rays in doubles, from places near the surfaces
surfaces.py    a scene's surfaces as arrays, and a tree of them
walk.py        the walk of many rays through the tree
doubles.py     which surfaces a ray meets, as far as doubles are sure
fine.py        as far as pairs of doubles are sure
whole.py       in whole numbers
trace.py       trace_rays: all of it together
attributes.py  points, normals and texture coordinates
"""

from cltrace.rays.trace import Hits, trace_rays

__all__ = ["Hits", "trace_rays"]
