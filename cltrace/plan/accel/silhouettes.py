"""What lists ask of surfaces, and what they get: silhouettes, whatever the shape is.

Seen from a point or along a direction, a surface is a disc or a convex polygon: see discs.py and polygons.py. Either
one says which pixels it may cover, through which sides of a cube around a light it is seen, and where it is on the
plane across a parallel light, with bounds that are wider than all rounding can ask for, and how near it is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.abi import CONSTANTS
from cltrace.plan.accel.cells import Held, Place, areas
from cltrace.plan.request import Region, Request
from cltrace.plan.rounding import Array, Ints, Mask
from cltrace.scene import AnyCamera

T = TypeVar("T")
# float32 or double, and its type.
Reals = NDArray[Any]
Real = type[np.floating[Any]]
# The corners of some silhouettes, by which of them these are.
Corners = Callable[[NDArray[np.intp]], Reals]
# (n,) each: lower bounds of the depth of nearest points, and upper bounds of that of furthest points.
Depths = tuple[NDArray[np.float32], Reals]
# The same as SLACK, for arithmetic in double.
FINE_SLACK = 2.0**-44
# Of parallel rays, in the float buffers' unit: more than places on the plane are off by in double.
LOOSE = 2.0**-44
SHIFT = CONSTANTS["TILE"].bit_length() - 1
NOTHING = np.zeros(())


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
        """The window of what a request wants of a camera's picture. k: see View.without_lists().

        Of means over pixels it is all of the picture, whatever the crop: the more is listed beside a pixel, the less is
        known of it, and the more rays it has. That is to be the same in all crops.
        """
        (x, y), (width, height) = camera.image_plane(), camera.resolution
        unit = 2.0**k if camera.parallel else 1.0
        wanted, spread = request.region_of(camera.resolution), 0.0
        if request.means:
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
            found.append(Axis(0.5 / step, begin=middle - off, end=middle + off, first=first, stop=first + count))
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


class Pictured(NamedTuple):
    """n silhouettes in the picture.

    member: (n,), which surfaces they are; wanted: (n,), which of them rays may meet; pixels: of both axes the places of
    the first and of the last pixel, (n,) each, before these are rounded to whole ones; near: the depths of the nearest
    points of some, lower bounds; corner(which): (2, c, j), of these polygons, in pixels; loose: (n,) or (), how far
    those are off.
    """

    member: Ints
    wanted: Mask
    pixels: Iterable[tuple[Reals, Reals]]
    near: Callable[[NDArray[np.intp]], NDArray[np.float32]]
    corner: Corners | None = None
    loose: Array = NOTHING


class Shadows(NamedTuple):
    """Who takes part in shadows.

    occluder: (n,), the surfaces that may stop light, which are the ones to enter, in the order of SHAPES;
    receiver: (n,), those of them on which shadow rays may end; slack: SLACK if the kernel decides in
    float32, else FINE_SLACK.
    """

    occluder: Mask
    receiver: Mask
    slack: float


class Pane(NamedTuple):
    """The window that is looked through, a rectangle of the plane one unit ahead.

    middle, half: its middle and half of its sides, across and up, as slopes; scale, shift: coordinates on the plane
    are slope * scale + shift; along: 0 where all is seen from a point. Where it is seen along a direction instead, it
    is what depths are off by, and nothing is outside of the window.
    """

    middle: tuple[float, float]
    half: tuple[float, float]
    scale: tuple[float, float] = (1, 1)
    shift: tuple[float, float] = (0, 0)
    along: float = 0


class Cube(NamedTuple):
    """Some sides of a cube around a light, as they are looked through.

    axes: (3, 3), of the cube; sides: an axis and a sign each; pane: what of each side is looked through; real: what to
    compute in.
    """

    axes: Array
    sides: list[tuple[int, float]]
    pane: Pane
    real: Real


class Extent(NamedTuple):
    """Of silhouettes.

    spans: two lists of the outermost left, right, low and high edge, first of all of them, then of those where shadow
    rays end; nearest, furthest: bounds of the depth of all points where shadow rays end.
    """

    spans: list[list[float]]
    nearest: float
    furthest: float


@dataclass(frozen=True)
class Cast:
    """n silhouettes in the plane of a light's grid.

    member: (n,), which surfaces they are; edges: four of (n,), their left, right, low and high coordinates; near: (n,),
    a lower bound of the depth of their nearest points; corner(which): (2, c, j), the corners of these polygons; loose:
    (n,) or (), how far off the corners are, besides a few roundings. It is in the edges already. entries: how many
    entries in lists pay for a polygon, 0 for discs.
    """

    member: Ints
    edges: list[Reals]
    near: NDArray[np.float32]
    extent: Extent
    corner: Corners | None = None
    loose: Array = field(default_factory=lambda: NOTHING)
    entries: float = 0

    @staticmethod
    def of(
        member: Ints,
        edges: list[Reals],
        depths: Depths,
        who: Shadows,
        corner: Corners | None = None,
        loose: Array = NOTHING,
        entries: float = 0,
    ) -> Cast:
        (near, far), ends = depths, np.flatnonzero(who.receiver[member])
        spans = [[_extreme(k, edge[which]) for k, edge in enumerate(edges)] for which in (slice(None), ends)]
        nearest, furthest = float(near[ends].min(initial=np.inf)), float(far[ends].max(initial=-np.inf))
        return Cast(member, edges, near, Extent(spans, nearest, furthest), corner, loose, entries)

    @property
    def members(self) -> int:
        """n."""
        return len(self.member)

    def edges_of(self, sample: int) -> Reals:
        """(4, s): of those whose indices `sample` divides."""
        which = np.flatnonzero(self.member % sample == 0)
        return np.array([edge[which] for edge in self.edges])

    def sizes(self, sample: int) -> Reals:
        """The width and the height of discs whose indices `sample` divides.

        Of polygons, it is the side of a square of twice the area.
        """
        if self.corner is None:
            return sizes_of(self.edges_of(sample))
        which = np.flatnonzero(self.member % sample == 0)
        return np.asarray(np.sqrt(2 * areas(self.corner(which))))


def sizes_of(edges: Reals) -> Reals:
    """The widths and the heights of discs with edges (4, s)."""
    return np.asarray(edges[1::2] - edges[::2]).ravel()


def _extreme(k: int, edge: Reals) -> float:
    """The outermost one of left, right, low or high edges, by k = 0, 1, 2 or 3."""
    return float(edge.max(initial=-np.inf) if k % 2 else edge.min(initial=np.inf))


class Elsewhere(Protocol):
    """Polygons that are kept elsewhere: most of those that a window may show.

    members: how many; rest: the other ones, which are seen here; extent, loose, entries: of Cast, with squared
    distances.
    """

    members: int
    rest: Ints
    extent: Extent
    loose: float
    entries: float

    def sizes(self, sample: int) -> Reals:
        """See Cast."""

    def on(self, place: Place) -> Held:
        """Those of them that are entered on a grid."""


Part = Cast | Elsewhere


class Silhouettes(ABC):
    """n surfaces of one shape as they are seen from a point, or, by parallel light, from the eye. Lengths are about 1.

    has_corners: whether they are polygons; in_world: whether they count along the world's axes, and not the camera's.
    """

    has_corners = False
    in_world: bool = False

    @property
    @abstractmethod
    def points(self) -> Array:
        """(p, 3): where they are, from where they are seen."""

    @property
    @abstractmethod
    def met(self) -> Mask:
        """(n,): which of them a ray from there can meet."""

    def turned(self, basis: Array) -> Silhouettes:
        """The same along the camera's axes, which are the rows of `basis`, (3, 3), in the world."""
        return self

    @abstractmethod
    def in_picture(
        self, among: Mask, window: Window, real: Real, use: Callable[[Pictured], T]
    ) -> tuple[list[T], Held | None]:
        """What `use` makes of those in the picture, some at a time; and those that are kept elsewhere.

        among: which of all surfaces to look for; real: what to compute in.
        """

    @abstractmethod
    def on_sides(self, cube: Cube, who: Shadows) -> list[list[Part]]:
        """Those that are seen through each side of a cube around a light."""

    @abstractmethod
    def across(self, axes: Array, who: Shadows, real: Real) -> Sequence[Part]:
        """They as a parallel light sees them. axes: (3, 3), the two across and the one towards the light; real: what is
        fine enough to compute in."""
