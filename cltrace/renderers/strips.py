"""A picture in strips of rows, from the top, which need not be in memory together."""

from __future__ import annotations

from collections.abc import Iterator

from cltrace.base.errors import OutOfMemoryError
from cltrace.base.progress import bar
from cltrace.base.waiting import Stopwatch
from cltrace.picture.image import Image
from cltrace.renderers.renderer import Renderer

# Strips begin at multiples of so many rows, which every packet divides.
STEP = 16
# Bytes of what the kernel writes that are in memory at once. Files take up to twice as much beside them.
ROOM = 2**26


def strips(renderer: Renderer, progress: bool | None = None) -> Iterator[tuple[int, Image]]:
    """The picture of a renderer, as Images of some rows, each after their number: a multiple of STEP but for the last.

    A small picture is one Image. Where the memory of the device or of this process is too small, strips become smaller.
    They have one limit of seconds, to which drawing alone counts. progress: as of Renderer.render(), which says what is
    raised, too.
    """
    _, first, width, height = renderer.region
    end, rows = first + height, max(STEP, ROOM // (width * renderer.bytes_a_pixel) // STEP * STEP)
    watch = Stopwatch(own=renderer.device.kind == "cpu")
    watch.halt()
    with bar(height, "row", progress) as shown:
        while first < end:
            last = min(first + rows, end)
            part = renderer if last - first == height else renderer.rows(first, last, watch)
            try:
                image = part.draw(shown.update)
            except (OutOfMemoryError, MemoryError):
                if last - first <= STEP:
                    raise
                rows = max(STEP, (last - first) // (2 * STEP) * STEP)
            else:
                yield last - first, image
                first = last
