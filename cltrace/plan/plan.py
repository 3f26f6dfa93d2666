"""From a scene to what a device needs to draw it: ScenePacking, CameraView, Plan. numpy alone, picklable.

A ScenePacking is what no camera changes. A CameraView adds a camera and a part of its picture. A Plan adds the outputs,
and says which parts of the kernel they need.

Each light has lists of surfaces of its own, so that memory would grow with the members of soft lights. Instead, such a
picture is drawn in passes: each makes the lists of a few lights, in the order of ScenePacking.lights, and adds what
these give to the colours that it finds, as one pass over all of them would have done: no bit of a picture depends on
it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan import abi, opencl
from cltrace.plan.abi import EVERY_SHAPE
from cltrace.plan.lights import are_at_points, kinds
from cltrace.plan.materials import limits
from cltrace.plan.request import LATTICES, Region, Request
from cltrace.plan.view import CameraView
from cltrace.plan.world import ScenePacking
from cltrace.scene import AnyCamera, Scene

# From so many surfaces on, the kernel fetches them ahead. A million spheres then take 0.85 of the time, 300,000 take
# 0.93 and 100,000 take 0.96 of it. 30,000 would take the same time, and 1,000 would take 1.02 (PoCL 3.1, 1920x1080).
PLENTY = 2**16
# From so many surfaces times lights on, packets are rendered in blocks. 100,000 spheres with 4, 12 and 100 lights then
# take 0.92, 0.8 and 0.88 of the time, and 10,000 with 12 and 100 take 0.95 and 0.78 of it (PoCL 3.1, 1280x720).
VIEWS = 2**18
# Up to so many surfaces, rays that leave one try all others. 16 then take 0.84 of the time that they take with a tree,
# and 64 take the same (PoCL 3.1).
FOREST = 32
# Where these are kept, nobody asks on which triangles no shadow falls.
KEPT = frozenset(("unstopped", "lists", "filter"))


def features(world: ScenePacking, view: CameraView, request: Request, passes: bool) -> frozenset[str]:
    """The names of the flags that are set. passes: of Plan."""
    camera, inside = view.camera, view.inside
    surfaces, full, keep = len(world.id), "features" in request.keep, request.keep
    bounces = request.needs_colors and world.bounces.any and surfaces > 0
    flags = {"WITH_SPHERES": not surfaces}  # without any, the kernel knows the first shape alone
    flags |= {flag: True for shape in world.shapes for flag in shape.flags}
    flags |= {
        "WITH_FILTER": "filter" not in keep,
        "WITH_EXTRAS": request.outputs != ("rgb8",) or passes or full,
        "WITH_PREFETCH": surfaces >= PLENTY,
        "WITH_INSIDE": inside or (bounces and world.bounces.glass) or full,
        "WITH_POINTS": full or bool(are_at_points(kinds(world.lights)).any()),
        "WITH_PARALLEL_RAYS": camera.parallel,
        "WITH_LEAVING": bounces or any(shape.leave for shape in world.shapes),
        "WITH_BOUNCES": bounces,
        "WITH_GLASS": bounces and world.bounces.glass,
        "WITH_SPLITS": bounces and world.bounces.splits,
        "WITH_TREE": bounces and surfaces > FOREST and "tree" not in keep,
        "WITH_SAMPLES": request.needs_colors and request.means,
        "KEEP_HIGHLIGHTS": "highlights" in keep,
        "KEEP_WEIGHTLESS": bounces and "weightless" in keep,
        "OUT_WORK": "work" in request.outputs,
    }
    # Some flags are set for scenes that need them only in part, so that scenes share programs. That takes less than 3 %
    # of a frame, or few frames are drawn so.
    if world.clipping:
        # Clipped rays are decided in the world, and as those are that may start anywhere.
        flags |= dict.fromkeys(("WITH_PLANES", "WITH_LEAVING", "WITH_INSIDE", *EVERY_SHAPE), True)
    if inside or world.clipping:
        flags["WITH_EXTRAS"] = True
    flags["WITH_TEXTURES"] = len(world.textures["texture"]) > 0 and not flags["WITH_EXTRAS"]
    if flags["WITH_EXTRAS"] and not bounces:
        flags["WITH_POINTS"] = True
    return frozenset(name for name, wanted in flags.items() if wanted)


def choices(world: ScenePacking, camera: AnyCamera, request: Request) -> dict[str, Any]:
    """The kernel's arguments that turn parts of a program on and off. Flags for these would make many programs."""
    shading, full = request.needs_colors, "features" in request.keep
    textures = len(world.textures["texture"]) if shading else 0
    splits = world.bounces.splits
    pays = world.bounces.shrinks and world.bounces.fades(camera.max_bounces)
    drops = shading and splits and (pays or full) and "branches" not in request.keep
    found = limits(world.bounces, world.peak, request)
    return found | {
        "shading": shading,
        "shown": not {"normal", "uv"}.isdisjoint(request.outputs),
        "mapped": textures > 0 or "uv" in request.outputs,
        "textures": textures,
        "faint": found["faint"] if drops else -1.0,
        "prove": drops and "color" in request.outputs,
        "centres": not {"rgb8", "color", "error", "coverage"}.issuperset(request.outputs),
    }


# A pass has at most so many pairs of a surface and a light. A sphere and a light take 60 bytes: a filter constant, and
# mostly two to four entries of lists. The first pass stays while others are made and drawn, one at a time: 64 lights of
# a million spheres take 1.3 GB in all.
PAIRS = 4_000_000
# So many pairs, which take 1 GB, are still one pass, and their lists stay for the next frame.
WHOLE = 2**24


def passes_of(world: ScenePacking, request: Request) -> list[ScenePacking]:
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
    arrays, skipped, seconds: of CameraView; features: names of abi.FLAGS; branches: of opencl.options(); values: the
    kernel's arguments by name that are neither buffers nor outputs, except those that each launch sets; blocks: whether
    packets are rendered in blocks; passes: whether this is one of several, see passes_of(); unstoppable: whether it
    may be found out on which triangles no shadow falls, see run/unstoppable.py.
    """

    request: Request
    size: tuple[int, int]
    region: Region
    exponent: int
    features: frozenset[str]
    branches: int
    arrays: dict[str, NDArray[Any]]
    values: dict[str, Any]
    blocks: bool
    passes: bool
    unstoppable: bool
    skipped: dict[str, int]
    seconds: dict[str, float]

    @classmethod
    def of(cls, world: ScenePacking, view: CameraView, request: Request) -> Plan:
        """The plan of a view, which may have some of the world's lights alone: that is a pass, see passes_of().

        request: the one that world and view were made for, or the same with other outputs.
        """
        camera, n = view.camera, request.samples or 1
        means = {"lattice": (n.bit_length() - 1, LATTICES[n]), "scatter": SCATTER[n]}
        values = view.values | means | choices(world, camera, request) | _frame(world, view, request)
        lit, passes = len(world.lights) if values["shading"] else 0, values["lights"] < len(world.lights)
        flags = features(world, view, request, passes)
        bounded = request.precision != "single" and KEPT.isdisjoint(request.keep) and not world.clipping
        at_points = bool(are_at_points(kinds(world.lights)).any())
        return cls(
            request=request,
            size=camera.resolution,
            region=view.region,
            exponent=view.exponent,
            features=flags,
            branches=world.bounces.branches(camera.max_bounces),
            arrays=view.arrays,
            values=values | {"size": camera.resolution, "more": passes or request.outputs != ("rgb8",)},
            blocks="WITH_SAMPLES" in flags or len(world.id) * lit >= VIEWS,
            passes=passes,
            unstoppable="WITH_TRIANGLES" in flags and lit > 0 and at_points and bounded and not passes,
            skipped=view.skipped,
            seconds=view.seconds,
        )

    @classmethod
    def of_scene(cls, scene: Scene, request: Request) -> Plan:
        """ScenePacking, CameraView and Plan at once, for a scene that is seen by its own camera only.

        Raises ValueError if the request's crop is not within the picture.
        """
        world = ScenePacking.of(scene, request)
        return cls.of(world, CameraView.of(world, scene.camera, request), request)

    def counting(self) -> Plan:
        """The plan of a kernel that does all that this one's does, but writes only what it has counted."""
        request = replace(self.request, outputs=("work",), keep=())
        return replace(self, request=request, features=self.features | {"OUT_WORK", "WITH_EXTRAS"})

    def options(self) -> list[str]:
        """The compiler's options. Scenes with the same precision, features and branches share a program."""
        return opencl.options(self.request.precision, self.features, self.branches)


def _frame(world: ScenePacking, view: CameraView, request: Request) -> dict[str, Any]:
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
