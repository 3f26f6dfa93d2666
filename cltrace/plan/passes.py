"""Lights a few at a time: where all of a scene's lights together would need too much memory.

Each light has lists of surfaces of its own, so that memory would grow with the members of soft lights. Instead, the
picture is drawn in passes: each makes the lists of a few lights, in the order of World.lights, and adds what these give
to the colours that it finds, as one pass over all of them would have done: no bit of a picture depends on it.
"""

from __future__ import annotations

from dataclasses import replace

from cltrace.plan.request import Request
from cltrace.plan.world import World

# A pass has at most so many pairs of a surface and a light. A sphere and a light take 60 bytes: a filter constant, and
# mostly two to four entries of lists. The first pass stays while others are made and drawn, one at a time: 64 lights of
# a million spheres take 1.3 GB in all.
PAIRS = 4_000_000
# So many pairs, which take 1 GB, are still one pass, and their lists stay for the next frame.
WHOLE = 2**24


def passes_of(world: World, request: Request) -> list[World]:
    """The worlds of a picture's passes, which differ in their lights: one alone if there are few, or none is soft.

    There is one, too, where that would make other bits: where rays go on from surfaces, as the weights of what they see
    are multiplied with the sum of all lights and rounded, and that sum tells which branches are dropped; and where
    colours are means, as these are of sums that are clamped, and the sums tell how many rays a pixel has. So there is
    where it is counted what is done for a pixel.
    """
    n, m = len(world.id), len(world.lights)
    cut = world.soft and not world.bounces.any and not request.means and "shadow_rays" not in request.outputs
    if not cut or not request.needs_colors or n * m <= WHOLE:
        return [world]
    step = max(1, PAIRS // n)
    return [replace(world, lights=world.lights[i : i + step]) for i in range(0, m, step)]
