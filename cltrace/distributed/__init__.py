"""One picture in tiles, or the frames of a movie, on the workers of a dask cluster: the same bytes as in one process.

It needs the extra `dask`. workers is what runs in the workers, render_farm what hands out work and takes it in again,
and tiles and frames have what a user calls.
"""

from __future__ import annotations

from cltrace.distributed.frames import animate
from cltrace.distributed.render_farm import FarmError
from cltrace.distributed.tiles import render

__all__ = ["FarmError", "animate", "render"]
