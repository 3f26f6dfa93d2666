"""Which parts of the kernel a scene and its outputs need: which of abi.FLAGS are set."""

from __future__ import annotations

from dataclasses import dataclass

from cltrace.plan.bounces import Bounces
from cltrace.plan.request import Request

# From so many spheres on, the kernel fetches them ahead. A million then take 0.85 of the time, 300,000 take 0.93 and
# 100,000 take 0.96 of it. 30,000 would take the same time, and 1,000 would take 1.02 of it (PoCL 3.1, 1920x1080).
PLENTY = 2**16
# From so many surfaces times lights on, packets are rendered in blocks. 100,000 spheres with 4, 12 and 100 lights then
# take 0.92, 0.8 and 0.88 of the time, and 10,000 with 12 and 100 take 0.95 and 0.78 of it (PoCL 3.1, 1280x720).
VIEWS = 2**18
# Up to so many surfaces, rays that leave one try all others. 16 then take 0.84 of the time that they take with a tree,
# and 64 take the same (PoCL 3.1).
FOREST = 32
# Where these are kept, nobody asks on which triangles no shadow falls.
KEPT = frozenset(("unstopped", "lists", "filter"))


@dataclass(frozen=True)
class Contents:
    """What of a scene the features depend on.

    spheres, triangles: how many there are; lights: how many parallel, point and spot lights; inside: whether the eye is
    inside of a sphere or on it; shiny: whether some material has highlights; black: whether some material reflects no
    light; textures: whether some surface has one; bounces: what surfaces do with rays; ellipsoids: whether there are
    any; max_bounces: of the camera; parallel_rays: whether those of the camera are parallel.
    """

    spheres: int
    triangles: int
    lights: tuple[int, int, int]
    inside: bool
    shiny: bool
    black: bool
    textures: bool
    bounces: Bounces
    ellipsoids: bool
    max_bounces: int
    parallel_rays: bool = False


def features(contents: Contents, request: Request) -> frozenset[str]:
    """The names of the flags that are set."""
    shading = request.needs_colors
    full = "features" in request.keep
    surfaces = contents.spheres + contents.triangles
    meshes, shapes = contents.triangles > 0, contents.triangles > 0 or contents.ellipsoids
    lit = shading and (full or (any(contents.lights) and surfaces > 0))
    bounces = shading and contents.bounces.any and surfaces > 0
    splits = bounces and contents.bounces.splits
    pays = contents.bounces.shrinks and contents.bounces.fades(contents.max_bounces)
    drops = splits and (pays or full) and "branches" not in request.keep
    textures = shading and contents.textures
    averaged = shading and request.antialias is not None
    uv = textures or "uv" in request.outputs
    parallel, point, spot = (lit and (number > 0 or full) for number in contents.lights)
    bounded = request.precision == "accurate" and KEPT.isdisjoint(request.keep)
    flags = {f"OUT_{name.upper()}": True for name in request.outputs}
    flags |= {
        "WITH_FILTER": request.precision != "double" and "filter" not in request.keep,
        "WITH_INTERSECTION": shading or uv or "normal" in request.outputs,
        "WITH_NORMAL": lit or bounces or uv or "normal" in request.outputs,
        "WITH_UV": uv,
        "WITH_TEXTURES": textures,
        "WITH_INSIDE": contents.inside or full,
        "WITH_SHADING": shading,
        "WITH_PARALLEL_RAYS": contents.parallel_rays,
        "WITH_LIGHTS": lit,
        "WITH_PARALLEL": parallel,
        "WITH_POINT": point,
        "WITH_SPOT": spot,
        "WITH_SHADOWS": lit and (surfaces > 1 or contents.inside or full),
        "WITH_UNSTOPPABLE": meshes and (point or spot) and not averaged and bounded,
        "WITH_SPECULAR": lit and (contents.shiny or full),
        "WITH_BLACK": lit and (contents.black or full),
        "WITH_PREFETCH": surfaces >= PLENTY,
        "WITH_BLOCKS": lit and surfaces * sum(contents.lights) >= VIEWS,
        "WITH_ELLIPSOIDS": contents.ellipsoids,
        "WITH_SHAPES": shapes,
        "WITH_TRIANGLES": meshes,
        "ONLY_TRIANGLES": meshes and contents.spheres == 0,
        "WITH_PATCHES": meshes and bounces,
        "WITH_LEAVING": bounces or shapes,
        "WITH_BOUNCES": bounces,
        "WITH_GLASS": bounces and contents.bounces.glass,
        "WITH_SPLITS": splits,
        "WITH_DROPPING": drops,
        "WITH_CEILING": splits and (contents.bounces.overgrows(contents.max_bounces) or full),
        "PROVE_COLOR": drops and "color" in request.outputs and not averaged,
        "WITH_TREE": bounces and surfaces > FOREST and "tree" not in request.keep,
        "WITH_AVERAGE": averaged,
        "WITH_MARKS": averaged and bounces,
        "WITH_SHEETS": averaged and meshes,
        "WITH_CENTRES": averaged and not {"rgb8", "color", "error", "coverage"}.issuperset(request.outputs),
        "KEEP_HIGHLIGHTS": lit and "highlights" in request.keep,
        "KEEP_WEIGHTLESS": bounces and "weightless" in request.keep,
    }
    return frozenset(name for name, wanted in flags.items() if wanted)
