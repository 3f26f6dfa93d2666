"""What is wanted of a scene: the precision, the outputs, the part of the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from cltrace.plan.abi import OUTPUTS, PICTURES, Precision
from cltrace.scene.rules import is_whole

PRECISIONS: tuple[Precision, ...] = get_args(Precision)
KeptSurfaces = Literal["lists", "filter", "hidden", "receivers", "unstopped", "order", "tree"]
KeptColors = Literal["features", "lights", "highlights", "outputs", "bounces", "weightless", "branches"]
Keep = Literal[KeptSurfaces, KeptColors]
KEEPS: tuple[Keep, ...] = get_args(Keep)
# What the host makes of outputs that the kernel writes, and of which.
COMPOSED = {"rgba8": ("rgb8", "id"), "alpha": ("id",)}
# The same of antialiased pictures.
MEANS = {"rgba8": ("color", "coverage"), "alpha": ("coverage",)}
# Ray number i of N goes through (i + 1/2, (a i mod N) + 1/2) / N of a pixel's sides, from its upper left corner. Of all
# a this one has the least error where a straight edge goes through the pixel: 29, 12, 3.8, 2.1, 1.3, 0.43 and 0.15 % of
# the contrast, root mean square.
LATTICES = {1: 0, 4: 3, 16: 5, 32: 9, 64: 27, 256: 119, 1024: 189}
WIDTHS = (1, 4, 8, 16)  # of packets: pixels that are drawn together
# x0, y0, x1, y1 in pixels of the whole picture; column x1 and row y1 are no longer in it.
Crop = tuple[int, int, int, int]
# x, y, width, height in pixels of the whole picture: what a Crop is turned into.
Region = tuple[int, int, int, int]


@dataclass(frozen=True)
class Request:
    """What is wanted of a scene.

    precision: "accurate", "single" or "double", which arithmetic decides hits and computes colours (docs/accuracy.md);
    outputs: one or more names of abi.OUTPUTS and of COMPOSED, of which those are kept that the kernel writes, in the
    table's order; crop: (x0, y0, x1, y1), a part of the picture in pixels, x1 and y1 excluded, None for all of it;
    truncate: whether a byte is 255 c cut to a whole number, instead of rounded to the nearest; samples: colours are
    means of so many rays, a key of LATTICES, where few of a pixel do not agree; None: colours are those of the pixels'
    middles.

    keep: names of KEEPS, what not to leave out, for measuring. No picture depends on it, but for those of some extreme
    scenes in single, as docs/speed.md says.

        lists: one list of all spheres for every ray
        filter: every sphere of a list is decided in full, without a float32 test before that
        features: the kernel has the code of every feature
        lights: lights that are black, or that shine on nothing that reflects
        hidden: what is there twice
        receivers: in the lists of a light, spheres that shadow nothing in the picture
        unstopped: where spheres are few, shadow rays that none of them can stop; and where meshes are drawn often,
            those from triangles on which no shadow falls
        highlights: those too faint for a byte
        outputs: all pictures that the kernel can write
        order: the spheres stay in the scene's order
        bounces: the code of mirrors and glass, where nothing mirrors or is transparent
        tree: rays from surfaces try every sphere
        weightless: the own colour of surfaces that only mirror or let through
        branches: mirrored and refracted rays that no output shows

    Raises ValueError, naming the field, for a precision, outputs, truncate, samples or keep that is not
    allowed. A crop is checked by region_of(), where the size of the picture is known.
    """

    precision: Precision = "accurate"
    outputs: tuple[str, ...] = ("rgb8",)
    crop: Crop | None = None
    truncate: bool = False
    samples: int | None = None
    keep: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.precision not in PRECISIONS:
            raise ValueError(f"precision: must be one of {', '.join(PRECISIONS)}, got {self.precision!r}")
        for name, allowed, least in (("outputs", (*OUTPUTS, *COMPOSED), 1), ("keep", KEEPS, 0)):
            value = getattr(self, name)
            if isinstance(value, str) and value in allowed:
                raise ValueError(f"{name}: must be a tuple, such as ({value!r},), got {value!r}")
            listed = isinstance(value, Sequence) and not isinstance(value, str) and len(value) >= least
            if not listed or any(v not in allowed for v in value):
                raise ValueError(f"{name}: must be some of {', '.join(allowed)}, got {value!r}")
        if not isinstance(self.truncate, bool):
            raise ValueError(f"truncate: must be True or False, got {self.truncate!r}")
        if self.samples is not None and (not is_whole(self.samples) or self.samples not in LATTICES):
            raise ValueError(f"samples: must be one of {', '.join(map(str, LATTICES))}, got {self.samples!r}")
        for name in ("error", "coverage"):
            if name in self.outputs and not self.means:
                raise ValueError(f"outputs: {name} is of antialiasing, which is off: say antialias=True")
        also = PICTURES if "outputs" in self.keep else ()
        composed = MEANS if self.means else COMPOSED
        if not self.means:
            also = tuple(name for name in also if name not in ("error", "coverage"))
        written = {part for name in self.outputs for part in composed.get(name, (name,))} | {*also}
        object.__setattr__(self, "outputs", tuple(name for name in OUTPUTS if name in written))
        object.__setattr__(self, "keep", tuple(self.keep))
        if self.samples is not None:
            object.__setattr__(self, "samples", int(self.samples))
        if isinstance(self.crop, np.ndarray):
            object.__setattr__(self, "crop", tuple(self.crop.tolist()))

    @property
    def means(self) -> bool:
        """Whether colours are means over pixels."""
        return self.samples is not None

    @property
    def needs_colors(self) -> bool:
        """Whether some output depends on colours, or counts what is done for them."""
        return not {"rgb8", "color", "error", "coverage", "shadow_rays", "work"}.isdisjoint(self.outputs)

    def region_of(self, size: tuple[int, int]) -> Region:
        """The part that is wanted of a picture of this size, (width, height) in pixels.

        Raises ValueError if the crop is not four whole numbers, is empty, or is not within the picture.
        """
        if self.crop is None:
            return (0, 0, *size)
        if not isinstance(self.crop, Sequence) or [is_whole(n) for n in self.crop] != [True] * 4:
            raise ValueError(f"crop: must be 4 whole numbers (x0, y0, x1, y1), got {self.crop!r}")
        x0, y0, x1, y1 = (int(n) for n in self.crop)
        if not (0 <= x0 < x1 <= size[0] and 0 <= y0 < y1 <= size[1]):
            raise ValueError(f"crop: must be within 0,0,{size[0]},{size[1]} and not empty, got {x0},{y0},{x1},{y1}")
        return (x0, y0, x1 - x0, y1 - y0)
