"""Spheres as seen from a fixed point or along a fixed direction: discs on a plane, and how near their points are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise
from cltrace.plan.abi import CONSTANTS
from cltrace.plan.accel.cells import AT_ONCE, SLACK, CellGrid, joined, spread
from cltrace.plan.accel.silhouettes import (
    FINE_SLACK,
    LOOSE,
    SHIFT,
    Cast,
    Cube,
    Part,
    Pictured,
    Real,
    Reals,
    Shadows,
    Silhouettes,
    T,
    Window,
)
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Ints, Mask, along, rotated, rounded_down, rounded_up

# From so many spheres on, and so many tiles that each one covers, lists lack what is behind others.
FEWEST, DEEP = 2**15, 4
# Half of the side of a square within a circle of radius 1, less a hundredth for all that is rounded.
SQUARE = 0.7
# With more than CROWD spheres for each pixel, lists lack those that no pixel shows, unless a sphere covers more than
# WIDE pixels on average: a grid of four million at 1920x1080 would take 0.8 s for that. One that covers more than LARGE
# is in lists at any rate. To know how deep pixels are, so many spheres are enough that about FRONT of them cover each:
# of a million on a line that leads away, a new camera of 64x64 pixels takes 44 ms of a processor's time instead of 95.
CROWD, WIDE, LARGE, FRONT = 8, 16, 256, 16
# A sphere hides what is behind at most so many columns and rows of tiles: many large ones would take long.
MOST = 8
# Of one in so many spheres it is asked how deep those are that cover the tiles so many times.
STRIDE, LAYERS = 64, 4


@dataclass(frozen=True)
class Discs(Silhouettes):
    """n spheres as seen from a point: Silhouettes.

    center: (n, 3), from that point to the centres; radius: (n,); power: (n,), |center|^2 - radius^2 of the exact
    center, rounded once. Of surfaces that only lie within these spheres, which makes the discs `loose`, it is 0 from
    inside. first: the index of the first one as a surface; in_world: of Silhouettes.
    """

    center: Array
    radius: Array
    power: Array
    loose: bool = False
    in_world: bool = False
    first: int = 0

    def __len__(self) -> int:
        return len(self.radius)

    @property
    def points(self) -> Array:
        return self.center

    @property
    def met(self) -> Mask:
        return np.ones(len(self.radius), bool)

    def turned(self, basis: Array) -> Discs:
        return replace(self, center=rotated(basis, self.center), in_world=False) if self.in_world else self

    def part(self, block: slice) -> slice:
        """Where a block of them is among all surfaces."""
        return slice(self.first + block.start, self.first + block.stop)

    def member(self, block: slice) -> Ints:
        """The indices of a block of them as surfaces."""
        return np.arange(self.first + block.start, self.first + block.stop, dtype=np.int32)

    def in_picture(self, among: Mask, window: Window, real: Real, use: Callable[[Pictured], T]) -> tuple[list[T], None]:
        def pixels(ends: _Ends) -> Iterator[tuple[Reals, Reals]]:
            for low, high, axis in zip(ends.edges[::2], ends.edges[1::2], window.axes, strict=True):
                slack = (np.abs(low) + np.abs(high)) * real(ends.slack) + real(ends.loose)
                yield (low - slack) * axis.scale + axis.begin, (high + slack) * axis.scale + axis.end

        def see(block: slice) -> T:
            ends = (_along_view if window.parallel else _from_eye)(self, block, real)
            return use(Pictured(self.member(block), ends.ahead & among[self.part(block)], pixels(ends), ends.near))

        return blockwise(len(self), see, AT_ONCE), None

    def on_sides(self, cube: Cube, who: Shadows) -> list[list[Part]]:
        if not len(self):  # numpy takes a while for nothing, too
            none = np.zeros(0, np.float32)
            return [[Cast.of(self.member(slice(0, 0)), 4 * [none], (none, none), who)] for _ in cube.sides]
        found = blockwise(len(self), lambda block: self._on_sides(cube, who, block), AT_ONCE)
        return [list(parts) for parts in zip(*found, strict=True)]

    def _on_sides(self, cube: Cube, who: Shadows, block: slice) -> list[Cast]:
        """A block of them, one Cast for each side of a cube."""
        real, exact, exact_r = cube.real, along(cube.axes, self.center[block]), self.radius[block]
        f = [axis.astype(real) for axis in exact]
        r, distance = exact_r.astype(real), length(*f)
        near, far = nearest(distance, r, self.power[block]), (distance + r) ** 2 * real(1 + 2.0**-10)
        size = [np.abs(axis) for axis in f]
        # How far beyond the face of a pyramid a centre may be if its sphere still reaches into the pyramid.
        reach = r * real(2**0.5 * (1 + SLACK)) + np.maximum(np.maximum(size[0], size[1]), size[2]) * real(SLACK)
        reach[~who.occluder[self.part(block)]] = -np.inf
        found = []
        for axis, sign in cube.sides:
            # What is seen through a side of the cube is the pyramid |c| <= d, |e| <= d, with d along the side's axis.
            right, up = (axis + 1) % 3, (axis + 2) % 3
            i = np.flatnonzero(np.maximum(size[right], size[up]) <= (reach + f[axis] if sign > 0 else reach - f[axis]))
            d, radii = exact[axis][i] * sign, exact_r[i]
            gap = ((d - radii) * (d + radii)).astype(real)
            edges = slopes([f[right][i], f[up][i]], d.astype(real), r[i], gap)
            found.append(Cast.of(self.member(block)[i], edges, (near[i], far[i]), who))
        return found

    def across(self, axes: Array, who: Shadows, real: Real) -> list[Cast]:

        def look(block: slice) -> Cast:
            i = np.flatnonzero(who.occluder[self.part(block)])
            r = self.radius[block][i]
            u, v, s = along(axes, self.center[block][i])
            near = rounded_down(-(s + r) - SLACK * (np.abs(s) + r) - 2.0**-100)
            return Cast.of(self.member(block)[i], [u - r, u + r, v - r, v + r], (near, r - s + 2.0**-10), who)

        return blockwise(len(self), look, AT_ONCE)


class _Ends(NamedTuple):
    """Where n discs end in the picture.

    edges: left, right, top and bottom, (n,) each; ahead: (n,), whether any of it may be before the rays' starts; slack,
    loose: what the edges are off by, relative to both of an axis and beside that; near: of Pictured.
    """

    edges: list[Reals]
    ahead: Mask
    slack: float
    loose: float
    near: Callable[[NDArray[np.intp]], NDArray[np.float32]]


def _from_eye(discs: Discs, block: slice, real: Real) -> _Ends:
    """As slopes; depths are squared distances."""
    exact, exact_r = np.ascontiguousarray(discs.center[block].T), discs.radius[block]
    x, y, z = exact.astype(real)
    r, gap = exact_r.astype(real), ((exact[2] - exact_r) * (exact[2] + exact_r)).astype(real)
    # More than z < r, as the eye may be inside by less than the rounding of the centre.
    ahead = exact[2] < exact_r * (1 + SLACK)
    edges = slopes([x, -y], -z, r, gap)
    return _Ends(
        edges, ahead, slack=SLACK, loose=0.0, near=lambda i: nearest(length(x, y, z)[i], r[i], discs.power[block][i])
    )


def _along_view(discs: Discs, block: slice, real: Real) -> _Ends:
    """Of parallel rays: as places on the plane where they start; depths are distances from there, if it is ahead.

    The camera's axes are orthonormal but for a few roundings, and no place is further than FAR: LOOSE is more.
    """
    exact, exact_r = np.ascontiguousarray(discs.center[block].T), discs.radius[block]
    z = exact[2]
    ahead = z - exact_r < SLACK * exact_r + LOOSE
    across, r = exact[:2].astype(real), exact_r.astype(real)
    edges = [across[0] - r, across[0] + r, -across[1] - r, r - across[1]]
    slack = SLACK if real is np.float32 else FINE_SLACK

    def near(i: NDArray[np.intp]) -> NDArray[np.float32]:
        depth, size = -(z[i] + exact_r[i]), np.abs(z[i]) + exact_r[i]
        return rounded_down(depth - SLACK * size - LOOSE)

    return _Ends(edges, ahead, slack=slack, loose=LOOSE, near=near)


def slopes(across: list[Reals], d: Reals, r: Reals, gap: Reals) -> list[Reals]:
    """The slopes c/d of the two tangents from the origin to circles with centre (c, d) and radius r.

    Returns, for each c of `across`, first the lower slopes (n,), then the higher ones. across: arrays (n,); gap: (n,),
    d^2 - r^2. Where a circle is not clear of the line d = 0, it has no such tangents, and the answer is -inf and inf,
    as it is where squares are about to underflow. If each argument is rounded once, both slopes are right to 8
    roundings of the larger one, |middle| + half, as neither of these takes more.
    """
    clear = (d > 0) & (gap >= d * d * (1 / 16)) & (gap > 2.0**-100)
    over = 1 / np.where(clear, gap, 1)
    unclear = np.flatnonzero(~clear)
    forward, around = d * over, r * over
    found = []
    for c in across:
        middle, half = c * forward, around * np.sqrt(np.maximum(c * c + gap, 0))
        low, high = middle - half, middle + half
        low[unclear], high[unclear] = -np.inf, np.inf
        found += [low, high]
    return found


def length(x: Reals, y: Reals, z: Reals) -> Reals:
    """(n,): |(x, y, z)|, in float32 right to 2^-22 of it. Below 2^-60, where squares underflow, it is too large."""
    return np.asarray(np.sqrt(x * x + y * y + z * z + x.dtype.type(2.0**-120)))


def nearest(distance: Reals, r: Reals, power: Array) -> NDArray[np.float32]:
    """(n,): a lower bound of the squared distance of each sphere's nearest point; -1 on the sphere, or all but.

    distance: (n,), of length(); r, power: (n,), of Discs. From inside, too, that point is | |C| - r | away.
    """
    # Relative errors, in units of 2^-24: the gap is right to 6, its square to 14, and the kernel's squared lengths are
    # right to 5.
    gap = np.abs(power.astype(np.float32)) / (distance + r)
    return np.where(gap > 2.0**-50, gap * gap * (1 - 2.0**-19), -1).astype(np.float32)


def is_deep(request: Request, spheres: int, members: int, entries: int) -> bool:
    """Whether the picture's lists lack what is behind other spheres, see behind().

    spheres: how many there are, whole discs all of them, and nothing else; members: how many of them are in the
    picture; entries: how many tiles these cover. In single, rays are not decided exactly, which the proof asks for;
    where pixels are antialiased, it is not their centres alone that count.
    """
    return spheres >= FEWEST and entries > DEEP * members and request.precision != "single" and not request.means


def is_coarse(request: Request, spheres: int, window: Window) -> bool:
    """Whether a picture is so coarse that its lists lack the spheres that no pixel shows, if a device makes them.

    spheres, and why it is not done elsewhere: see is_deep(). 16 bits have to tell which pixels a sphere covers.
    """
    width, height = window.region[2:]
    crowded = spheres >= FEWEST and spheres > CROWD * width * height and max(window.size) < 2**15
    return crowded and request.precision != "single" and not request.means and not window.parallel


def front_of(near: NDArray[np.float32], more: NDArray[Any], tiles: int) -> np.float32:
    """How deep the spheres are that may cover the tiles in front of others: enough of them for nearly all, by a sample.

    near: (s,), the depths of the sphere with index 0 and of each one STRIDE further, infinite for those that are not in
    the picture; more: (2, s), how many columns and rows of tiles each one covers beside one; tiles: how many there are.
    """
    order = np.argsort(near, kind="stable")
    # A disc of which the rectangle has m + 1 tiles a side covers about (m - 1)^2 / 2 of them as a whole.
    wide, high = np.maximum(more.take(order, axis=1).astype(np.float64) - 1, 0)
    enough = np.flatnonzero(np.cumsum(wide * high) * (STRIDE / 2) >= LAYERS * tiles)
    return np.float32(near[order[enough[0]]] if len(enough) else np.inf)


def behind(grid: CellGrid, discs: Discs, window: Window) -> NDArray[np.float32]:
    """CellGrid.behind of the tiles: squared distances within which each ray of a tile has met a sphere.

    discs: of rays from the eye. Let (x, y, -d) be the centre of one that is ahead,
    with the eye outside, and r its radius. The plane z = -d cuts it in a circle of radius r around the centre, so rays
    with slopes within r / d of (x, y) / d pass through a point of it. Tiles are covered of which the centres of all
    pixels are in a square in that circle. There, a ray meets the sphere first where it is at most sqrt(p) away from the
    eye, p = x^2 + y^2 + d^2 - r^2, as the product of the two distances is p. What has its nearest point further away is
    not met before, nor as far away.

    Of a covered tile, the circle has a radius of 2 pixels or more, and places of up to 2^16 pixels are off by less than
    2^-30: the hundredth that SQUARE lacks is more. Depths have 2^-19 of themselves as a margin, and p is off by 2^-50.
    """
    columns, rows = grid.cells
    found = np.full(columns * rows, np.inf, np.float32)
    sample = np.flatnonzero(grid.member % STRIDE == 0)
    front = front_of(grid.near[sample], grid.covers[2:, sample], columns * rows)
    for i in range(0, len(grid.member), AT_ONCE):
        large = grid.covers[2:, i : i + AT_ONCE].min(axis=0) > 0
        which = grid.member[i : i + AT_ONCE][large & (grid.near[i : i + AT_ONCE] <= front)]
        (x, y, z), r, power = discs.center[which].T, discs.radius[which], discs.power[which]
        ahead = np.flatnonzero((-z > r) & (power > 0))
        d, x, y, r, far = -z[ahead], x[ahead], y[ahead], r[ahead], rounded_up(power[ahead])
        half, first, more = r * SQUARE / d, [], []
        for c, axis, size, cells in zip((x, -y), window.axes, window.size, grid.cells, strict=True):
            place, reach = c / d * axis.scale + (size - 1) / 2, half * axis.scale
            begin = np.clip(np.ceil(place - reach), 0, cells << SHIFT).astype(np.int32)
            end = np.clip(np.floor(place + reach), -1, (cells << SHIFT) - 1).astype(np.int32)
            first.append(begin + (CONSTANTS["TILE"] - 1) >> SHIFT)
            more.append(np.minimum((end + 1 >> SHIFT) - 1 - first[-1], MOST - 1))
        some = np.flatnonzero((more[0] >= 0) & (more[1] >= 0))
        (left, top), (wide, high) = (np.array(v)[:, some].astype(np.int16) for v in (first, more))
        covered = spread(high, columns, top.astype(np.int64) * columns + left, wide, far[some])
        cell, wide, far = joined(list(covered))
        for part, depth in spread(wide, 1, cell, far):
            np.minimum.at(found, part, depth)
    return found.reshape(rows, columns)
