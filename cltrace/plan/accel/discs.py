"""Spheres as seen from a fixed point or along a fixed direction: discs on a plane, and how near their points are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import blockwise
from cltrace.plan.accel.cells import AT_ONCE, SLACK
from cltrace.plan.accel.silhouettes import (
    FINE_SLACK,
    LOOSE,
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
from cltrace.plan.rounding import Array, Ints, Mask, along, rotated, rounded_down


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
