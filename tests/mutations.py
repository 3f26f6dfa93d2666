"""Mistakes that the tests must find: `python tests/mutations.py [--check] [--device SPEC] [WORD ...]`.

Makes one mutation after the other, each in a process of its own (see tests/mutate.py), runs the tests that should
fail, and prints what was caught and what survived. The exit status is 1 if anything survived. WORD: only mutations
whose name, target or tests contain one of these words. --check: only whether each mutation has something to mutate.
"""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from mutate import VARIABLE, Kernel, Python

ROOT = Path(__file__).parent.parent
STRESS, BOUNCES = "tests/kernels/test_stress.py", "tests/kernels/test_bounces.py"
LIGHT, HIGHLIGHTS = f"{STRESS} -k 'L1 or L2 or L3 or L4 or L6 or L7 or L9'", f"{STRESS} -k 'P1 or P2 or P3'"
SAMPLES, CYLINDERS = (
    "tests/kernels/test_samples.py -k exact_rays",
    "tests/kernels/test_exact.py -k cylinders",
)
EXACT, PRECISION = "tests/kernels/test_exact.py -k 'spheres or bit or touches'", "tests/kernels/test_precision.py"
CLIPPED = "tests/kernels/test_consistency.py -k clipped"
CONSISTENT = "tests/kernels/test_consistency.py -k 'agrees_with_the_reference and accurate'"
MESH_RAYS, LISTS = "tests/rays/test_rays.py -k hostile_meshes", "tests/plan/test_lists.py"


def last_of_ties(first_of: Callable[..., Any], kinds: Any, rays: Any, ray: int, items: Sequence[int]) -> Any:
    """Of equally near surfaces the one of the highest number."""
    first = first_of(kinds, rays, ray, items)
    roots = [(item, kinds.root(rays, ray, item)) for item in sorted(items, reverse=True)]
    return first and next((item, root) for item, root in roots if root is not None and not first[1] < root)


def one_file_for_two(targets_of: Callable[..., Any], scene: Any, options: Any, *more: Any) -> Any:
    different = {os.path.realpath(name): name for name in options.output or ()}
    single = type(options)(**vars(options) | {"output": list(different.values()) or None})
    return targets_of(scene, single, *more)


async def any_host(guarded: Callable[..., Any], server: Any, request: Any, handler: Callable[[Any], Any]) -> Any:
    own, host = f"localhost:{server.port}", request.headers.get("Host", "no host")
    headers = {name: value.replace(host, own) for name, value in request.headers.items()}
    claimed = SimpleNamespace(headers=headers, path=request.path, match_info=request.match_info)
    return await guarded(server, claimed, lambda _: handler(request))


async def any_token(guarded: Callable[..., Any], server: Any, request: Any, handler: Callable[[Any], Any]) -> Any:
    claimed = SimpleNamespace(headers=request.headers, path=request.path, match_info={"token": server._token})
    return await guarded(server, claimed, lambda _: handler(request))


# Chosen from 289 by what each mistake would do to a user: a wrong picture, a wrong answer, a lost file, an open door.
MUTATIONS = {
    # ------------------------------------------------------------------------------------------------ scenes and plans
    "colours overflow": Python(
        "plan.materials:finite32",
        lambda original, value: 2 * original(value / 2),
        "tests/kernels/test_hostile.py -k overflow",
    ),
    "rotations turn the other way": Python(
        "formats.surfaces:cos_sin",
        lambda original, degrees: original(-degrees),
        "tests/formats/test_reader.py -k transforms_fold",
    ),
    "paths lead out of the scene's folder": Python(
        "formats.schema:relative_path",
        lambda original, text: text if ".." in text.split("/") else original(text),
        "tests/formats/test_reader.py tests/formats/test_scene_files.py",
    ),
    "lists of parallel lights stay where the camera was": Python(
        "plan.lights:Move.grid",
        lambda original, move, grid: original(move._replace(shift=0 * move.shift), grid),
        "tests/run/test_other_cameras.py",
    ),
    "filters of parallel rays have no slack": Python(
        "plan.shapes.sphere:disc_filter",
        lambda original, u, v, radius, *loose: original(0 * u, 0 * v, radius * (1 - 2.0**-21), 0.0),
        LISTS,
    ),
    "spheres are not listed if their centre is out of view": Python(
        "plan.accel.silhouettes:_beyond",
        lambda original, place, radius, half: original(place, 0 * radius, half),
        LISTS,
    ),
    "of equal spheres the last one is kept": Python(
        "plan.order:repeated",
        lambda original, center, radius, shape, number, by_place: original(center, radius, shape, -number, by_place),
        "tests/plan/test_culling.py -k of_equal_spheres",
    ),
    "textures are left out where normals are an output": Python(
        "plan.plan:choices",
        lambda original, *of: (found := original(*of)) | ({"textures": 0} if found["shown"] else {}),
        "tests/kernels/test_textures_kernel.py",
    ),
    # ------------------------------------------------------------------------------- the exact engine and the reference
    "an edge belongs to the other triangle, in the exact engine": Python(
        "exact.lines:sign_along",
        lambda original, w, v: original(w[::-1], v[::-1]),
        "tests/exact/test_engine.py -k meshes",
    ),
    "doubles at triangles have no bounds, in the reference": Python(
        "reference.triangles:Rough.sign",
        lambda original, rough: original(replace(rough, error=0.0)),
        "tests/reference/test_reference_meshes.py",
    ),
    "single rays meet the last of equally near surfaces": Python(
        "oracle.search:Kinds.first_of", last_of_ties, "tests/rays/test_rays.py -k hostile_rays"
    ),
    "check takes bytes off by one level for equal": Python(
        "students.check:ROUNDING", lambda original: 1.0, "tests/students/test_check.py -k next_one"
    ),
    # ------------------------------------------------------------------------------------------------ files and viewer
    "16 bits are off by one": Python(
        "picture.image:Image._levels16",
        lambda original, *more: np.maximum(original(*more), 1) - 1,
        "tests/picture/test_outputs.py -k 16_bits",
    ),
    "strips do not end where packets do": Python(
        "renderers.renderer:STEP", lambda original: 1, "tests/renderers/test_strips.py -k strips"
    ),
    "two names of one file are taken": Python(
        "cli.files:targets_of", one_file_for_two, "tests/picture/test_outputs.py -k sense"
    ),
    "the viewer answers other hosts": Python(
        "viewer.server:Server._guarded", any_host, "tests/viewer/test_server.py -k hosts"
    ),
    "the viewer answers without the token": Python(
        "viewer.server:Server._guarded", any_token, "tests/viewer/test_server.py -k nothing_else"
    ),
    # ------------------------------------------------------------------------------------------ spheres, from the eye
    "rays are half a pixel too high": Kernel("primary_ray", "size += (int2)(0, 1); return CALL;", f"{STRESS} -k C4"),
    "float32 rules out spheres that are met": Kernel(
        "passes_filter",
        "line.a *= 1.0001f; return CALL;",
        f"{STRESS} -k 'test_case or D2'",
    ),
    "rays that touch a sphere miss it": Kernel(
        "quadratic",
        "Quadratic e = CALL; e.discriminant = e.discriminant == 0 ? (REAL)-1 : e.discriminant; return e;",
        "tests/kernels/test_exact.py -k touches",
    ),
    "parallel rays that touch a sphere miss it": Kernel(
        "sphere_meet",
        """Meeting at = CALL;
        if (HAS(WITH_PARALLEL_RAYS)) at.t = at.from_center.z == 0 ? (REAL)INFINITY : at.t;
        return at;""",
        "tests/kernels/test_exact.py -k 'touches and parallel'",
    ),
    "doubles decide discriminants near 0": Kernel(
        "decide_quadratic",
        "bb *= (real)0x1p-60f; arr *= (real)0x1p-60f; CALL;",
        EXACT,
    ),
    "pairs of doubles are doubles": Kernel("two_product", "Pair p = CALL; p.lo = 0; return p;", EXACT),
    "discriminants from inside have the wrong form": Kernel(
        "quadratic",
        """Quadratic e = CALL;
        if (HAS(WITH_INSIDE)) e.by_b = e.by_b & (e.b * e.b < ray.a * (sphere.r * sphere.r));
        return e;""",
        f"{STRESS} -k 'I1 or I2 or I4'",
    ),
    "rays away from the centre miss the sphere around them": Kernel(
        "sphere_meet",
        """Meeting at = CALL;
        at.t = ((sphere.c <= 0) & (DOT(sphere.center, ray.d) < 0)) ? (REAL)INFINITY : at.t;
        return at;""",
        f"{STRESS} -k 'I1 or I2 or I4'",
    ),
    "the hit's point is mirrored": Kernel("quadratic", "Quadratic e = CALL; e.v.z = -e.v.z; return e;", f"{STRESS}"),
    "the furthest sphere is seen": Kernel(
        "closer", "return !CALL;", "tests/kernels/test_scenes.py -k answers_of_the_kernel"
    ),
    "of equally near spheres the last one is seen": Kernel(
        "sphere_comes_first",
        "tie = !tie; return CALL;",
        f"{STRESS} -k 'R1 or R2 or R3'",
    ),
    "whole numbers find no two spheres at one point": Kernel(
        "order_of", "const int order = CALL; return order == 0 ? 1 : order;", EXACT
    ),
    "lists end before the nearest surface": Kernel("REACH_SLACK", "0.875f", f"{STRESS} tests/kernels/test_hostile.py"),
    # ------------------------------------------------------------------------------------------------ light and shadows
    "what is beyond the light stops it": Kernel("stands_between", "far = 0; return CALL;", LIGHT),
    "what is behind the point stops the light": Kernel(
        "stands_between",
        """const REAL_MASK stops = CALL;
        f.x = -f.x;
        f.y = -f.y;
        f.z = -f.z;
        far = 0;
        light_side = 1;
        return stops | CALL;""",
        LIGHT,
    ),
    "a light within a sphere shines out of it": Kernel(
        "stands_between", "return light_side < 0 ? c < 0 : CALL;", LIGHT
    ),
    "spheres stop the light on themselves": Kernel(
        "sphere_shadow",
        "start.side = -1; return CALL;",
        LIGHT,
    ),
    "lights in the tangent plane shine": Kernel(
        "direction_to",
        "Direction to = CALL; to.cosine = to.cosine == 0 ? start.side : to.cosine; return to;",
        LIGHT,
    ),
    "float32 rules out shadows that fall": Kernel(
        "sphere_filter_leaves",
        "ray.a *= 1.001f; return CALL;",
        f"{STRESS} -k test_case",
    ),
    "nothing stops light from triangles": Kernel("may_stop", "return 0;", "tests/run/test_unstoppable.py"),
    "cones of light are too narrow": Kernel("reaches", "light.axis.w = 1; return CALL;", CONSISTENT),
    "highlights are of a ray that is not mirrored": Kernel(
        "phong",
        "lighting->view.x = -lighting->view.x; CALL; lighting->view.x = -lighting->view.x;",
        CONSISTENT,
    ),
    "0 to the power of 0 is 0": Kernel("lobe", "return z > -1 ? CALL : (SHADE)0;", HIGHLIGHTS),
    "light is subtracted where n.l is below 0": Kernel(
        "phong",
        """CALL;
        const Shade3 N = {TO_SHADE(at.normal.x), TO_SHADE(at.normal.y), TO_SHADE(at.normal.z)};
        const SHADE dot = TO_SHADE(at.start.side) * DOT(N, l);
        const SHADE less = (TO_SHADE_MASK(lit) & (dot < 0)) ? dot * strength : (SHADE)0;
        lighting->color.x += at.diffuse.x * less * light.color.x;""",
        f"{PRECISION} -k grazing",
    ),
    "levels are of 256": Kernel("byte_of", "value *= (shade_t)(256.0f / 255); return CALL;", CONSISTENT),
    "what is brighter than white overflows": Kernel(
        "byte_of",
        "return TO_MASK((value > 1) & (value < 2)) ? TO(uint, value * (shade_t)255 + rounding) : CALL;",
        HIGHLIGHTS,
    ),
    # ------------------------------------------------------------------------------------------------ mirrors and glass
    "the angle of reflection is another one": Kernel(
        "mirrored",
        """Real3 out = CALL;
        const REAL k = (real)0x1p-13f * DOT(n, d);
        out.x += k * n.x;
        out.y += k * n.y;
        out.z += k * n.z;
        return out;""",
        f"{BOUNCES} -k chain",
    ),
    "glass is on the other side": Kernel("refracted", "index = 1 / index; return CALL;", f"{BOUNCES} -k ball_lens"),
    "the critical angle is another one": Kernel(
        "refracted",
        """Refraction out = CALL;
        index *= 1 - (real)0x1p-28f;
        out.total = CALL.total;
        return out;""",
        f"{BOUNCES} -k critical",
    ),
    "total reflection adds nothing": Kernel(
        "bounce_at",
        """Bounce bounce = CALL;
        const REAL most = rays.weight * rows_at(scene->bounce, materials_of(scene, rays.own)).x;
        bounce.mirrors = bounce.mirrors > most ? most : bounce.mirrors;
        return bounce;""",
        f"{BOUNCES} -k total_reflection",
    ),
    "the last depth is missing": Kernel(
        "bounce_at",
        "rays.depth++; return CALL;",
        f"{BOUNCES} -k two",
    ),
    "rays stay on the side of glass that they leave": Kernel(
        "go_on",
        "Branch next = CALL; next.inner = bounce.mirrors > 0 ? next.inner : bounce.inside; return next;",
        f"{BOUNCES} -k 'lens or glass'",
    ),
    "boxes of the tree are too small": Kernel(
        "walker_of", "Walker walker = CALL; walker.to -= 0.01f; return walker;", "tests/rays/test_rays.py -k boxes"
    ),
    # ------------------------------------------------------------------------------------------------ other shapes
    "cylinders have no ends from inside": Kernel(
        "cylinder_verdict", "Verdict found = CALL; found.flat = found.flat & found.out; return found;", CYLINDERS
    ),
    "doubles are sure that a ray passes a cylinder": Kernel(
        "signs_within", "CylinderNumbers is = CALL; is.D = sign_from(e.D, 0); return is;", CYLINDERS
    ),
    "doubles at edges have no bounds": Kernel("volumes_of", "Volumes v = CALL; v.E_error = 0; return v;", MESH_RAYS),
    "the third edge is elsewhere": Kernel(
        "volumes_of", "Volumes v = CALL; v.EA = v.den - v.EB + v.EC; return v;", MESH_RAYS
    ),
    "an edge belongs to the other triangle": Kernel(
        "whole_volume",
        """const int sign = CALL;
        way = -way;
        return directed && sign == CALL ? -sign : sign;""",
        "-m slow tests/kernels/test_exact.py -k 'corners and rays and accurate'",
    ),
    "triangles beyond the light stop it": Kernel(
        "passing_of",
        "Passing is = CALL; if (at_point) is.side = -is.side; return is;",
        "-m slow tests/kernels/test_consistency.py -k 'meshes and (soup or terrain or room)'",
    ),
    "normals between corners are mixed up": Kernel(
        "weighted", "return weighted(w, b, a, c);", "-m slow tests/kernels/test_consistency.py -k smooth"
    ),
    # ------------------------------------------------------------------------------------------------ clipping
    "surfaces that planes do not clip are clipped": Kernel("are_unclipped", "return 0;", CLIPPED),
    "a clipped mesh contains what is outside of it": Kernel(
        "count_triangle",
        "const MASK before = closed->odd; CALL; closed->odd = before ^ (met & entry->here);",
        CLIPPED,
    ),
    "what is clipped away stops light": Kernel("stops_in_region", "return stops;", CLIPPED),
    # ------------------------------------------------------------------------------------------------ samples
    "samples find only spheres at the middles of pixels": Kernel(
        "margins_of", "Margins margins = CALL; margins.diagonal = 0; return margins;", SAMPLES
    ),
    "samples look at nothing but the corners of pixels": Kernel("may_show_another", "return 0;", SAMPLES),
}


def passes(tests: str, device: str | None, name: str = "") -> bool:
    """Whether these tests pass with the mutation of this name, or without any."""
    command = [sys.executable, "-m", "pytest", "-qx", "--capture=sys", "-p", "no:cacheprovider", *shlex.split(tests)]
    more = ["--device", device] if device else []
    folders = f"{ROOT / 'tests' / 'mutating'}{os.pathsep}{ROOT / 'tests'}"
    env = os.environ | {VARIABLE: name, "PYTHONPATH": folders}
    done = subprocess.run([*command, *more], cwd=ROOT, env=env, capture_output=True, text=True, check=False)
    if done.returncode > 1:
        raise SystemExit(f"pytest did not run with the mutation {name!r}: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.returncode == 0  # a signal is as good as a failed test


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("words", nargs="*", metavar="WORD")
    parser.add_argument("--device", help="test on this device only")
    parser.add_argument("--check", action="store_true", help="run no tests")
    args = parser.parse_args()
    chosen = {
        name: mutation
        for name, mutation in MUTATIONS.items()
        if not args.words or any(word in f"{name} {mutation[0]} {mutation.tests}" for word in args.words)
    }
    if lost := [name for name, mutation in chosen.items() if not mutation.is_found()]:
        raise SystemExit("\n".join(["these mutations have lost what they mutate:", *lost]))
    if args.check:
        return 0
    for tests in sorted({mutation.tests for mutation in chosen.values()}):
        if not passes(tests, args.device):
            raise SystemExit(f"the tests must pass without any mutation: {tests}")
    survivors = 0
    for name, mutation in chosen.items():
        start = time.monotonic()
        left = passes(mutation.tests, args.device, name)
        survivors += left
        print(f"{'SURVIVED' if left else 'caught':8} {time.monotonic() - start:5.0f} s  {name}", flush=True)
    print(f"{len(chosen) - survivors} of {len(chosen)} caught")
    return 1 if survivors else 0


if __name__ == "__main__":
    raise SystemExit(main())
