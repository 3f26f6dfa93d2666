"""The exact oracle: what a ray meets, in arithmetic that rounds nothing."""

from cltrace.oracle.spheres import closest

__all__ = ["closest"]
