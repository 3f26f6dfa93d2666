"""The grids of a view: the tiles of the picture and the buffers of all lights, and who is entered in them."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence

import numpy as np

from cltrace.base.errors import TooSlowError
from cltrace.base.limits import MAX_SECONDS
from cltrace.plan.accel.grids import (
    CellGrid,
    PictureWindow,
    Shadows,
    parallel_grids,
    picture_tiles,
    point_grids,
    whole_grid,
)
from cltrace.plan.accel.silhouettes import FINE_SLACK, SLACK, Discs, Silhouettes
from cltrace.plan.lights import Lamp
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Mask, squared_length
from cltrace.plan.shapes.shape import Sights
from cltrace.plan.world import ScenePacking

# With at most so many spheres, a light has one list of all of them, and a bit for each.
ONE_LIST = 16


class Grids:
    """The grids of a view, each of which is made when it is asked for, and not kept.

    Raises TooSlowError where those of the second light and later ones take longer than MAX_SECONDS. Those of the first
    light do not count, as what makes lists is compiled then.

    light_buffer: (m, 4), abi's; skipped: what of the world is in no grid, in words, and how often. Both are whole when
    all grids have been taken.
    """

    def __init__(self, world: ScenePacking, sights: Sequence[Sights], lights: list[Lamp], request: Request) -> None:
        """sights: of all shapes, in the order of SHAPES; lights: m."""
        self._world, self._sights, self._lights, self._request = world, sights, lights, request
        self._slack = SLACK if request.precision == "single" else FINE_SLACK
        self._total, counts = len(world.id), [len(sight.eye) for sight in sights]
        # The first shape always is there, so that there is something to put together.
        self._shapes = [i for i, count in enumerate(counts) if count or not i]
        self._visible: Mask = np.concatenate([shape.visible for shape in world.shapes])
        # What is not in the picture itself may be seen in a mirror.
        everywhere = "receivers" in request.keep or world.bounces.any or bool(world.clipping)
        self._receiver = np.full(self._total, everywhere)
        self._what = world.shapes[0].words if self._total == counts[0] else "surfaces"
        self.light_buffer = np.zeros((len(lights), 4), np.int32)
        self.skipped: dict[str, int] = {}

    def made(self, window: PictureWindow) -> Iterator[CellGrid]:
        """The grid of the tiles, then those of all light buffers. window: the picture's."""
        yield from self._tiles(window)
        yield from self._of_lights()

    def _among(self, seen: Sequence[Silhouettes]) -> Mask:
        """(n,): which of all surfaces a ray can meet from where these are seen, in the order of SHAPES."""
        return np.concatenate([one.met for one in seen]) & self._visible

    def _tiles(self, window: PictureWindow) -> Iterator[CellGrid]:
        """The grid of the tiles. What is in it receives light."""
        eye = [sight.eye for sight in self._sights]
        among, shapes, total = self._among(eye), [eye[i] for i in self._shapes], self._total
        tiles = picture_tiles(shapes, among, window, self._slack)
        if "lists" in self._request.keep:
            self._receiver[tiles.members.member] = True
            tiles = whole_grid(among)
        yield tiles
        seen_there = tiles.entered(total)
        self._receiver |= seen_there
        self.skipped[f"{self._what} out of the picture"] = total - int(seen_there.sum())

    def _of_lights(self) -> Iterator[CellGrid]:
        """The grids of the lights in turn."""
        total, made, idle = self._total, 1, 0
        deadline = math.inf
        for k, light in enumerate(self._lights):
            if k == 1:
                deadline = time.monotonic() + MAX_SECONDS
            elif time.monotonic() > deadline:
                lower = f"the number of lights, which is {len(self._lights)}, or of surfaces, which is {total}"
                raise TooSlowError(MAX_SECONDS, lower, "making lists of what stops light")
            seen = [sight.lights[k] for sight in self._sights]
            among = self._among(seen)
            who = Shadows(among, self._receiver, self._slack)
            grids, stops = self._of_light(light, [seen[i] for i in self._shapes], who)
            if "lists" in self._request.keep:
                grids = iter([whole_grid(among)])
            entered, count = np.zeros(total, bool), 0
            for grid in grids:
                yield grid
                entered |= grid.entered(total)
                count += 1
                del grid  # Others have room in its place.
            self.light_buffer[k] = made, count, stops, 0
            made += count
            idle += total - int(entered.sum())
        self.skipped[f"{self._what} that shadow nothing seen, per light"] = idle

    def _of_light(self, light: Lamp, shapes: Sequence[Silhouettes], who: Shadows) -> tuple[Iterator[CellGrid], int]:
        """The grids of one light, and a bit for each surface on its way to which something may stop the light.

        Where surfaces are many, or not discs alone, all bits are set.
        """
        n, keep, (discs, *others) = self._total, self._request.keep, shapes
        # With ONE_LIST spheres at most, finding the right list for a shadow ray costs more than trying them all: a box
        # of 16 takes 3.5 ms a frame instead of 3.2 (PoCL 3.1, 1920x1080). A shell of 28 takes 4.3 instead of 4.6.
        if n > ONE_LIST or others or not isinstance(discs, Discs):
            return point_grids(shapes, who) if light.at_point else parallel_grids(light.axes, shapes, who), -1
        slack = who.slack
        shadows = point_shadows(discs, slack) if light.at_point else parallel_shadows(light.axes, discs, slack)
        shadows &= who.receiver[:, None] & who.occluder
        # Seen from outside, a sphere never stands between itself and a light; seen from inside, it may.
        inside = np.concatenate([sight.eye.inside for sight in self._sights]) | self._world.bounces.glass
        np.fill_diagonal(shadows, inside)
        clipped = bool(self._world.clipping)
        casting = np.asarray(shadows.any(axis=0) | ("receivers" in keep) | clipped)
        stops = int(((shadows.any(axis=1) | ("unstopped" in keep) | clipped) << np.arange(n)).sum())
        return iter([whole_grid(casting)] if casting.any() else []), stops


def larger(radius: Array, slack: float) -> Array:
    """The radii (n,), larger by more than rounding can move the silhouette of such a sphere.

    slack: the relative error of lengths. Lengths are at most 4: an error of 16 slack in a discriminant, or in a squared
    length, moves the silhouette of a sphere of radius r by less than 16 slack / r.
    """
    return radius + 16 * slack * (1 + 1 / radius)


def point_shadows(discs: Discs, slack: float) -> Mask:
    """(n, n): whether sphere [j] can stand between a point light and any point of sphere [i]. discs: from the light."""
    roomy = larger(discs.radius, slack)
    distance = np.sqrt(squared_length(discs.center))
    # A light that is inside of a sphere, or all but, sees it in every direction.
    clear = distance > roomy
    safe = np.where(clear, distance, 1.0)
    half = np.where(clear, np.arcsin(np.minimum(roomy / safe, 1)), np.pi)
    direction = discs.center / safe[:, None]
    cross = np.cross(direction[:, None], direction[None])
    angle = np.arctan2(np.sqrt((cross * cross).sum(axis=-1)), direction @ direction.T)
    loose = 16 * slack * (1 + 1 / safe)
    overlap = angle <= (half + loose)[:, None] + (half + loose)[None]
    return np.asarray(overlap & ((distance - roomy)[None] < (distance + roomy)[:, None]))


def parallel_shadows(axes: Array, discs: Discs, slack: float) -> Mask:
    """The same for a parallel light. axes: (3, 3), two across the light and one towards it; discs: from the eye."""
    roomy = larger(discs.radius, slack) + slack * 16
    u, v, s = axes @ discs.center.T
    gap = np.hypot(u[:, None] - u[None], v[:, None] - v[None])
    return np.asarray((gap <= roomy[:, None] + roomy[None]) & ((s + roomy)[None] > (s - roomy)[:, None]))
