"""The exact oracle: what a ray meets, in arithmetic that rounds nothing."""

from cltrace.oracle.scenes import Answer, closest_hit, triangles_met
from cltrace.oracle.spheres import closest

__all__ = ["Answer", "closest", "closest_hit", "triangles_met"]
