"""The exact oracle: what rays meet. Doubles decide where they are sure, and the exact engine where they are not.

search.py  rays in pairs of doubles that count their errors, and the search for what they meet; Kind, which each shape
           implements
shapes.py  spheres and ellipsoids, triangles, cylinders
scenes.py  closest_hit(): any rays in a scene; the table of shapes
"""

from cltrace.oracle.scenes import OracleHits, closest_hit, triangles_met

__all__ = ["OracleHits", "closest_hit", "triangles_met"]
