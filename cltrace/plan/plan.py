"""From a scene to what a device needs to draw it: World, View, Plan. numpy alone, picklable.

A World is what no camera changes. A View adds a camera and a part of its picture. A Plan adds the outputs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan import abi
from cltrace.plan.dropping import limits
from cltrace.plan.features import features
from cltrace.plan.request import LATTICES, Region, Request
from cltrace.plan.view import View
from cltrace.plan.world import World
from cltrace.scene import Scene

# What 95 of 100 means over N rays are off by at most, where a pixel's colours differ by 1, each in the worst of three
# channels. Rays that know nothing of each other, as on a fine texture, are the worst case. These are quantiles where
# their colours are normal: what Student's t would be if the deviation were measured by the range. With 8 rays it is
# 0.261. Means over a lattice are better where an edge goes through the pixel: 1.96 of their standard deviations, see
# LATTICES, are 0.075, 0.041 and 0.026 of the contrast with 16, 32 and 64 rays. Of one ray its colour alone is known.
SCATTER = {1: 0.0, 4: 0.511, 16: 0.152, 32: 0.0931, 64: 0.0585, 256: 0.0247, 1024: 0.0108}


@dataclass(frozen=True)
class Plan:
    """A view and what is to be written of it: all that a device needs. numpy alone, and picklable.

    request: precision, outputs and crop; size: (width, height) of the whole picture in pixels; region, exponent,
    arrays, skipped, seconds: of View; features: names of abi.FLAGS; branches: BRANCHES of abi.VALUES; values: the
    kernel's arguments by name that are neither buffers nor outputs, but for those that only the launch knows.
    """

    request: Request
    size: tuple[int, int]
    region: Region
    exponent: int
    features: frozenset[str]
    branches: int
    arrays: dict[str, NDArray[Any]]
    values: dict[str, Any]
    skipped: dict[str, int]
    seconds: dict[str, float]

    @classmethod
    def of(cls, world: World, view: View, request: Request) -> Plan:
        """The plan of a view, which may have some of the world's lights alone: that is a pass, see passes.py.

        request: the one that world and view were made for, or the same with other outputs.
        """
        camera = view.camera
        values = view.values | _means(request) | limits(world.bounces, world.peak, request)
        flags = features(world, camera, view.inside, request)
        if values["lights"] < len(world.lights):
            flags = (flags | {"WITH_PASSES"}) - {"WITH_UNSTOPPABLE"}
        return cls(
            request=request,
            size=camera.resolution,
            region=view.region,
            exponent=view.exponent,
            features=flags,
            branches=world.bounces.branches(camera.max_bounces),
            arrays=view.arrays,
            values=values | _frame(world, view, request) | {"size": camera.resolution},
            skipped=view.skipped,
            seconds=view.seconds,
        )

    @classmethod
    def of_scene(cls, scene: Scene, request: Request) -> Plan:
        """World, View and Plan at once, for a scene that is seen by its own camera only.

        Raises ValueError if the request's crop is not within the picture.
        """
        world = World.of(scene, request)
        return cls.of(world, View.of(world, scene.camera, request), request)

    def counting(self) -> Plan:
        """The plan of a kernel that does all that this one's does, but writes only what it has counted."""
        rest = (name for name in self.features if not name.startswith("OUT_"))
        request = replace(self.request, outputs=("work",), keep=())
        return replace(self, request=request, features=frozenset((*rest, "OUT_WORK")))

    def options(self) -> list[str]:
        """The compiler's options. Scenes with the same precision, features and branches share a program."""
        return abi.options(self.request.precision, self.features, self.branches)


def _frame(world: World, view: View, request: Request) -> dict[str, Any]:
    """The fields of abi's `Frame`."""
    (x, y), (width, height) = view.camera.image_plane(), view.camera.resolution
    pixel = np.array([x / width, y / height, 0])
    rounding = 0.0 if request.truncate else 0.5
    shade = abi.shade_dtype(request.precision)
    return {
        "pixel": np.ldexp(pixel, -view.exponent) if view.camera.parallel else pixel,
        **dict(zip(("right", "up", "back"), view.camera.basis(), strict=True)),
        "background": [_same_byte(c, rounding, shade) for c in world.background],
        "quantize": (rounding, 0, 0),
    }


def _means(request: Request) -> dict[str, Any]:
    """The kernel's arguments for means over samples."""
    n = request.samples or 1
    return {"lattice": (n.bit_length() - 1, LATTICES[n]), "scatter": SCATTER[n]}


def _same_byte(c: float, rounding: float, shade: np.dtype[Any]) -> np.float32:
    """A part c of the background's colour in float32, moved by an ulp if its byte would else be another than that of c.

    Without this the whole sky could be a level off: 0.7 times 255 is 178.5, all but for a rounding.
    """
    near = np.float32(min(c, float(np.finfo(np.float32).max)))
    want = int(min(c, 1.0) * 255 + rounding)
    one = shade.type(1)
    for value in (near, np.nextafter(near, np.float32(0)), np.nextafter(near, np.float32(np.inf))):
        clamped = min(shade.type(value), one)
        if int(clamped * shade.type(255) + shade.type(rounding)) == want:
            return np.float32(value)
    return near
