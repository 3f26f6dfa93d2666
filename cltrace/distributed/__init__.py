"""One picture in tiles, or the frames of a movie, on the workers of a dask cluster: the same bytes as in one process.

It needs the extra `dask`. workers is what runs in the workers, farm what hands out work and takes it in again, and
render and animate are what a user calls.
"""

from __future__ import annotations

from cltrace.distributed.api import animate, render
from cltrace.distributed.farm import FarmError

__all__ = ["FarmError", "animate", "render"]
