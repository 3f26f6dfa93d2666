"""Which parts of the kernel a scene and its outputs need: which of abi.FLAGS are set."""

from __future__ import annotations

from cltrace.plan.abi import SHAPES
from cltrace.plan.lights import are_at_points, counts, kinds
from cltrace.plan.request import Request
from cltrace.plan.world import World
from cltrace.scene import AnyCamera

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


def features(world: World, camera: AnyCamera, inside: bool, request: Request) -> frozenset[str]:
    """The names of the flags that are set. inside: whether the eye is inside of a surface or on it."""
    shading = request.needs_colors
    full = "features" in request.keep
    surfaces = len(world.id)
    lights, at_points = counts(world.lights), bool(are_at_points(kinds(world.lights)).any())
    inside = inside or world.bounces.glass or full
    black = world.materials.black is not None and bool(world.materials.black.any())
    lit = shading and (full or (len(world.lights) > 0 and surfaces > 0))
    bounces = shading and world.bounces.any and surfaces > 0
    splits = bounces and world.bounces.splits
    pays = world.bounces.shrinks and world.bounces.fades(camera.max_bounces)
    drops = splits and (pays or full) and "branches" not in request.keep
    textures = shading and len(world.textures.place) > 0
    sampled = shading and request.means
    uv = textures or "uv" in request.outputs
    bounded = request.precision != "single" and KEPT.isdisjoint(request.keep)
    points = lit and (at_points or full) and bounded
    needed = {"shape": True, "bounces": bounces, "points": points}
    flags = {f"OUT_{name.upper()}": True for name in request.outputs}
    flags |= {row.flag: len(shape.number) > 0 for row, shape in zip(SHAPES, world.shapes, strict=False)}
    flags |= {flag: needed[reason] for shape in world.shapes for flag, reason in shape.flags.items()}
    flags |= {
        "WITH_FILTER": "filter" not in request.keep,
        "WITH_INTERSECTION": shading or uv or "normal" in request.outputs,
        "WITH_NORMAL": lit or bounces or uv or "normal" in request.outputs,
        "WITH_UV": uv,
        "WITH_TEXTURES": textures,
        "WITH_INSIDE": inside,
        "WITH_SHADING": shading,
        "WITH_PARALLEL_RAYS": camera.parallel,
        "WITH_LIGHTS": lit,
        **{f"WITH_{kind.upper()}": lit and (number > 0 or full) for kind, number in lights.items()},
        "WITH_SHADOWS": lit and (surfaces > 1 or inside),
        "WITH_SPECULAR": lit and (world.materials.shiny or full),
        "WITH_BLACK": lit and (black or full),
        "WITH_PREFETCH": surfaces >= PLENTY,
        "WITH_BLOCKS": sampled or (lit and surfaces * len(world.lights) >= VIEWS),
        "WITH_LEAVING": bounces or any(shape.leave for shape in world.shapes),
        "WITH_BOUNCES": bounces,
        "WITH_GLASS": bounces and world.bounces.glass,
        "WITH_SPLITS": splits,
        "WITH_DROPPING": drops,
        "WITH_CEILING": splits and (world.bounces.overgrows(camera.max_bounces) or full),
        "PROVE_COLOR": drops and "color" in request.outputs and not request.means,
        "WITH_TREE": bounces and surfaces > FOREST and "tree" not in request.keep,
        "WITH_SAMPLES": sampled,
        "WITH_CENTRES": sampled and not {"rgb8", "color", "error", "coverage"}.issuperset(request.outputs),
        "KEEP_HIGHLIGHTS": lit and "highlights" in request.keep,
        "KEEP_WEIGHTLESS": bounces and "weightless" in request.keep,
    }
    flags[SHAPES[0].flag] |= not surfaces  # without any, the kernel knows the first shape alone
    return frozenset(name for name, wanted in flags.items() if wanted)
