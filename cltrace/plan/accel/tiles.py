"""Tiles: the picture in cells of 4x4 pixels [TILE = 4], each with the spheres that its rays may meet, nearest first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.blocks import blockwise
from cltrace.plan.abi import CONSTANTS
from cltrace.plan.accel.cells import (
    BLOCK,
    SLACK,
    CellGrid,
    Held,
    Ints,
    Mask,
    Outlines,
    Place,
    joined,
    joined_outlines,
    outlines_of,
    sprawling,
    spread,
)
from cltrace.plan.exact import rounded_down, rounded_up
from cltrace.plan.request import Region, Request
from cltrace.plan.shapes.polygon import TURNED, Corners, Pane, Polygons, Sight, View, polygons
from cltrace.plan.shapes.sphere import Reals, Seen, length, nearest, slopes
from cltrace.scene import AnyCamera

# Pixels smaller than this, at z = -1, are too small for slopes in float32 to be divided by them.
TINY = 2.0**-64
# The same of parallel rays, in the float buffers' unit: there, the slack of float32 would be a few pixels.
FINE = 2.0**-18
# The same as SLACK, for arithmetic in double.
FINE_SLACK = 2.0**-44
# Of parallel rays, in the float buffers' unit: more than places on the plane are off by in double.
LOOSE = 2.0**-44
SHIFT = CONSTANTS["TILE"].bit_length() - 1
# From so many spheres on, and so many tiles that each one covers, lists lack what is behind others.
CROWD, CROWDED = 2**15, 4
# Half of the side of a square within a circle of radius 1, less a hundredth for all that is rounded.
SQUARE = 0.7
# A sphere hides what is behind at most so many columns and rows of tiles: a crowd of large ones would take long.
MOST = 8
# Of one in so many spheres it is asked how deep those are that cover the tiles so many times.
STRIDE, LAYERS = 64, 4


@dataclass(frozen=True)
class Window:
    """What of the image plane is to be drawn.

    step: half of a pixel's width and height on the image plane z = -1, or, of parallel rays, in the float buffers'
    unit; size: (width, height) of the whole picture in pixels; region: the part of it that is wanted; parallel: whether
    rays are parallel; spread: how far from a pixel's middle its rays are, in pixels: 0, or half a pixel where they fill
    it.
    """

    step: tuple[float, float]
    size: tuple[int, int]
    region: Region
    parallel: bool = False
    spread: float = 0

    @classmethod
    def of(cls, camera: AnyCamera, request: Request, k: int = 0) -> Window:
        """The window of what a request wants of a camera's picture. k: see View.without_spheres().

        Where pixels are antialiased, it is all of the picture, whatever the crop: the more is listed beside a pixel,
        the less is known of it, and that is to be the same in all crops.
        """
        (x, y), (width, height) = camera.image_plane(), camera.resolution
        unit = 2.0**k if camera.parallel else 1.0
        wanted, spread = request.region_of(camera.resolution), 0.0
        if request.antialias is not None:
            wanted, spread = (0, 0, width, height), 0.5
        return cls((x * unit / width, y * unit / height), camera.resolution, wanted, camera.parallel, spread)

    @property
    def axes(self) -> tuple[Axis, Axis]:
        """Across and down."""
        found = []
        for step, size, first, count in zip(self.step, self.size, self.region[:2], self.region[2:], strict=True):
            # Pixel i is at slope (2i + 1 - n) step. The product and the sum of slopes are rounded, each by 2^-24 of up
            # to 2^16 pixels, which 1/64 of a pixel covers; what is off by more is beyond the picture, and clipped.
            middle = (size - 1) / 2
            off = 1 / 64 + self.spread
            found.append(Axis(0.5 / step, middle - off, middle + off, first, first + count))
        return found[0], found[1]


class Axis(NamedTuple):
    """How slopes s become pixels: the first is s scale + begin, rounded up, the last s scale + end, rounded down.

    first, stop: the pixels that are wanted.
    """

    scale: float
    begin: float
    end: float
    first: int
    stop: int


class _Discs(NamedTuple):
    """n spheres in the picture.

    edges: left, right, top and bottom, (n,) each; ahead: (n,), whether any of it may be before the rays' starts; slack,
    loose: what the edges are off by, relative to both of an axis and beside that; near: the depth of the nearest points
    of some, a lower bound.
    """

    edges: list[Reals]
    ahead: Mask
    slack: float
    loose: float
    near: Callable[[NDArray[np.intp]], NDArray[np.float32]]


def _from_eye(seen: Seen, block: slice, real: type[np.floating[Any]]) -> _Discs:
    """As slopes; depths are squared distances."""
    exact, exact_r = np.ascontiguousarray(seen.center[block].T), seen.radius[block]
    x, y, z = exact.astype(real)
    r, gap = exact_r.astype(real), ((exact[2] - exact_r) * (exact[2] + exact_r)).astype(real)
    # More than z < r, as the eye may be inside by less than the rounding of the centre.
    ahead = exact[2] < exact_r * (1 + SLACK)
    edges = slopes([x, -y], -z, r, gap)
    return _Discs(edges, ahead, SLACK, 0.0, lambda i: nearest(length(x, y, z)[i], r[i], seen.power[block][i]))


def _along_view(seen: Seen, block: slice, real: type[np.floating[Any]]) -> _Discs:
    """Of parallel rays: as places on the plane where they start; depths are distances from there, if it is ahead.

    The camera's axes are orthonormal but for a few roundings, and no place is further than FAR: LOOSE is more.
    """
    exact, exact_r = np.ascontiguousarray(seen.center[block].T), seen.radius[block]
    z = exact[2]
    ahead = z - exact_r < SLACK * exact_r + LOOSE
    across, r = exact[:2].astype(real), exact_r.astype(real)
    edges = [across[0] - r, across[0] + r, -across[1] - r, r - across[1]]
    slack = SLACK if real is np.float32 else FINE_SLACK

    def near(i: NDArray[np.intp]) -> NDArray[np.float32]:
        depth, size = -(z[i] + exact_r[i]), np.abs(z[i]) + exact_r[i]
        return rounded_down(depth - SLACK * size - LOOSE)

    return _Discs(edges, ahead, slack, LOOSE, near)


def picture_tiles(seen: Seen, among: Mask, window: Window, corners: Corners | None = None) -> CellGrid:
    """The picture's grid.

    seen: n spheres from the eye, in camera space; corners: m triangles from there, None for none; among: (n + m,),
    which of them to enter. Those that cannot be seen are left out: those behind the eye, beside the region, or between
    the centres of pixels.
    """
    parallel = window.parallel
    real = np.float32 if min(window.step) > (FINE if parallel else TINY) else np.float64

    def see(block: slice) -> tuple[NDArray[Any], ...]:
        discs = _along_view(seen, block, real) if parallel else _from_eye(seen, block, real)
        visible, covers = discs.ahead & among[block], np.empty((4, len(discs.ahead)), np.int16)
        for k, (low, high, axis) in enumerate(zip(discs.edges[::2], discs.edges[1::2], window.axes, strict=True)):
            slack = (np.abs(low) + np.abs(high)) * real(discs.slack) + real(discs.loose)
            begin = np.clip(np.ceil((low - slack) * axis.scale + axis.begin), axis.first, axis.stop)
            end = np.clip(np.floor((high + slack) * axis.scale + axis.end), axis.first - 1, axis.stop - 1)
            visible &= begin <= end
            covers[k] = begin.astype(np.int32) >> SHIFT
            covers[2 + k] = (end.astype(np.int32) >> SHIFT) - covers[k]
        which = np.flatnonzero(visible)
        return (block.start + which).astype(np.int32), covers.take(which, axis=1), discs.near(which)

    parts, outlines, held = blockwise(len(seen.center), see, BLOCK), [], None
    if corners:
        if corners.sight and real is np.float32 and not parallel and max(window.size) > CONSTANTS["TILE"]:
            held, corners = _triangles_elsewhere(corners.sight, corners, among, window)
        for part, outline in (_triangles_along if parallel else _triangles)(corners, among, window, real):
            outlines.append((sum(len(other[0]) for other in parts), outline))
            parts.append(part)
    member, covers, near = joined(parts)
    grid = picture_grid(window.size, member, covers, near, joined_outlines(outlines))
    return replace(grid, polygons=corners is not None, held=held)


def picture_grid(
    size: tuple[int, int],
    member: Ints,
    covers: NDArray[np.int16],
    near: NDArray[np.float32],
    outlines: tuple[Outlines, ...] = (),
) -> CellGrid:
    """The grid of a picture of so many pixels, (width, height). The rest is of CellGrid."""
    cells = (((size[0] - 1) >> SHIFT) + 1, ((size[1] - 1) >> SHIFT) + 1)
    return CellGrid(
        np.eye(3),
        np.zeros(2),
        np.ones(2),
        cells,
        member,
        covers,
        near,
        True,
        outlines=outlines,
        pixels=CONSTANTS["TILE"],
    )


def _pane(window: Window) -> tuple[Pane, float]:
    """What is seen through the window, in pixels, and by how many of them a corner or a ray may be off."""
    first, count = window.region[:2], window.region[2:]
    # A pixel's coordinates are its column and row. The window ends half a pixel beyond its outermost ones.
    scale = [0.5 / step for step in window.step]
    shift = [(n - 1) / 2 for n in window.size]
    middle = [(first[k] + (count[k] - 1) / 2 - shift[k]) / scale[k] for k in (0, 1)]
    pane = Pane(tuple(middle), tuple(count[k] / 2 / scale[k] for k in (0, 1)), tuple(scale), tuple(shift))  # type: ignore[arg-type]
    # In pixels: a 64th, and what coordinates are off by in float32 (see SLACK), and in double before.
    off = [
        SLACK * (s * p + n) + TURNED * s * (1 + p) ** 2
        for s, p, n in zip(scale, pane.largest, window.size, strict=True)
    ]
    return pane, 1 / 64 + window.spread + max(off)


def _triangles_elsewhere(sight: Sight, corners: Corners, among: Mask, window: Window) -> tuple[Held | None, Corners]:
    """Those that are seen elsewhere, None for none, and the others."""
    pane, loose = _pane(window)
    asked = corners.of(among)
    # The picture is the side of a cube to which the last one of its axes leads.
    (shown,) = sight.see(np.diag([1.0, -1.0, -1.0]), [4], pane, asked, asked)
    x, y = (
        (float(first), float(first + count)) for first, count in zip(*np.reshape(window.region, (2, 2)), strict=True)
    )
    off = float(np.float32(loose))
    held = shown.on(Place((x, y), off, off, pixels=CONSTANTS["TILE"])) if shown.members else None
    return held, corners.some(shown.rest)


def is_crowded(request: Request, spheres: int, members: int, entries: int) -> bool:
    """Whether the picture's lists lack what is behind other spheres, see behind().

    spheres: how many there are, none of them an ellipsoid, and nothing else; members: how many of them are in the
    picture; entries: how many tiles these cover. In single, rays are not decided exactly, which the proof asks for;
    where pixels are antialiased, it is not their centres alone that count.
    """
    return (
        spheres >= CROWD and entries > CROWDED * members and request.precision != "single" and request.antialias is None
    )


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


def behind(grid: CellGrid, seen: Seen, window: Window) -> NDArray[np.float32]:
    """CellGrid.behind of the tiles: squared distances within which each ray of a tile has met a sphere.

    seen: spheres, of rays from the eye, in the float buffers' unit. Let (x, y, -d) be the centre of one that is ahead,
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
    for i in range(0, len(grid.member), BLOCK):
        large = grid.covers[2:, i : i + BLOCK].min(axis=0) > 0
        which = grid.member[i : i + BLOCK][large & (grid.near[i : i + BLOCK] <= front)]
        (x, y, z), r, power = seen.center[which].T, seen.radius[which], seen.power[which]
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


def _triangles(
    corners: Corners, among: Mask, window: Window, real: type[np.floating[Any]]
) -> list[tuple[tuple[NDArray[Any], ...], Outlines | None]]:
    """Of triangles: members, covers and near, and the outlines, for parts of them."""
    x, y, z = corners.vertex.T
    first, count = window.region[:2], window.region[2:]
    pane, loose = _pane(window)

    def enter(part: Polygons) -> tuple[tuple[NDArray[Any], ...], Outlines | None]:
        covers, visible = np.empty((4, len(part.triangle)), np.int16), np.ones(len(part.triangle), bool)
        off = (loose + part.loose).astype(part.edges[0].dtype)
        for k, (low, high) in enumerate((part.edges[:2], part.edges[2:])):
            begin = np.clip(np.ceil(low - off), first[k], first[k] + count[k])
            end = np.clip(np.floor(high + off), first[k] - 1, first[k] + count[k] - 1)
            visible &= begin <= end
            covers[k] = begin.astype(np.int32) >> SHIFT
            covers[2 + k] = (end.astype(np.int32) >> SHIFT) - covers[k]
        which = np.flatnonzero(visible)
        covers = covers.take(which, axis=1)
        at = sprawling(covers)
        corner = part.corner.take(which.take(at), axis=2)
        outline = outlines_of(at, corner, off[which[at]] if off.ndim else off)
        return (corners.primitives(part.triangle[which]), covers, part.near[which]), outline

    return polygons(View((x, y, z), (1, -1, -1)), corners.face, corners.of(among), pane, real, enter)


def _triangles_along(
    corners: Corners, among: Mask, window: Window, real: type[np.floating[Any]]
) -> list[tuple[tuple[NDArray[Any], ...], Outlines | None]]:
    """The same for parallel rays, in double."""
    (across, down), z = window.axes, corners.vertex[:, 2]
    # A pixel's coordinates are its column and row.
    places = [
        c * axis.scale + (size - 1) / 2
        for c, axis, size in zip(
            (corners.vertex[:, 0], -corners.vertex[:, 1]), (across, down), window.size, strict=True
        )
    ]
    off = 1 / 64 + window.spread + LOOSE * max(across.scale, down.scale)

    def see(block: slice) -> tuple[tuple[NDArray[Any], ...], Outlines | None]:
        face = corners.face[block].T
        corner = np.stack([[place[which] for which in face] for place in places])
        depth = np.stack([z[which] for which in face])
        covers = np.empty((4, len(face[0])), np.int16)
        visible = among[corners.first :][block] & (depth.min(axis=0) < LOOSE)
        for k, (values, axis) in enumerate(zip(corner, (across, down), strict=True)):
            loose = off + FINE_SLACK * np.abs(values).max(axis=0)
            begin = np.clip(np.ceil(values.min(axis=0) - loose), axis.first, axis.stop)
            end = np.clip(np.floor(values.max(axis=0) + loose), axis.first - 1, axis.stop - 1)
            visible &= begin <= end
            covers[k] = begin.astype(np.int32) >> SHIFT
            covers[2 + k] = (end.astype(np.int32) >> SHIFT) - covers[k]
        which = np.flatnonzero(visible)
        covers, most = covers.take(which, axis=1), depth.max(axis=0)[which]
        at = sprawling(covers)
        outline = outlines_of(at, corner.take(which.take(at), axis=2), off)
        near = rounded_down(-most - SLACK * np.abs(most) - LOOSE)
        return ((block.start + which + corners.first).astype(np.int32), covers, near), outline

    return blockwise(len(corners.face), see)
