"""The exact oracle: what rays meet. Doubles decide where they are sure, and the exact engine where they are not.

rays.py       rays in pairs of doubles that count their errors, and as the exact engine has them
search.py     the search for what they meet first, or at all; Kind, which each shape implements
spheres.py    spheres and ellipsoids; closest(), which has these alone
triangles.py, cylinders.py  the other shapes
scenes.py     closest_hit(): any rays in a scene; the table of shapes
"""

from cltrace.oracle.scenes import Answer, closest_hit, triangles_met
from cltrace.oracle.spheres import closest

__all__ = ["Answer", "closest", "closest_hit", "triangles_met"]
