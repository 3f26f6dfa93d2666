"""What any rays meet of a scene, exactly: trace_rays(). Host only; no OpenCL.

lines.py       rays in doubles, from places near the surfaces
doubles.py     what doubles know of rays and surfaces
fine.py        what pairs of doubles know
whole.py       what whole numbers know, which is all
shapes/        each shape: where rays meet it, by these three, and what is there
surfaces.py    a scene's surfaces, shape by shape, and a tree of them
walk.py        the walk of many rays through the tree
trace.py       trace_rays: all of it together
attributes.py  points, normals and texture coordinates
"""

from cltrace.rays.trace import Hits, trace_rays

__all__ = ["Hits", "trace_rays"]
