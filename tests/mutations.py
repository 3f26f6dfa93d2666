"""Mistakes that the ordinary tests must find: `python tests/mutations.py [--device SPEC] [WORD ...]`.

Each is a piece of text, what to put in its place, what that breaks, and the tests that should notice. The text is
looked for in the kernels and in the package, wherever it stands and however its lines are broken, and must be there
once. Each mistake is made in a scratch copy of the repository, and only those tests run there. Prints what was caught
and what survived; the exit status is 1 if anything survived. WORD: only those mistakes whose text or meaning contains
one of these words.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent


class Mutation(NamedTuple):
    """text: as it stands; other: what replaces it; what: what that breaks; tests: arguments of pytest, in words."""

    text: str
    other: str
    what: str
    tests: str


# Chosen from 287 by what each mistake would do to a user: a wrong picture, a wrong answer, a lost file, an open door.
MUTATIONS = [
    Mutation(".max) / 2)", ".max))", "colours that overflow", "tests/kernels/test_hostile.py -k overflow"),
    Mutation(
        "(error > 0) & (away > ROUNDING)",
        "error > 1",
        "bytes off by a level",
        "tests/students/test_check.py -k next_one",
    ),
    Mutation(
        "s, r + sqrt(power) * h)",
        "s, r)",
        "only spheres at a pixel's middle are in it",
        "tests/kernels/test_samples.py -k exact_rays",
    ),
    Mutation(
        "mixed = mixed | may_show_another(",
        "mixed = mixed & may_show_another(",
        "pixels' corners are all that is asked",
        "tests/kernels/test_samples.py -k exact_rays",
    ),
    Mutation(
        "ANY(may) && !are_beside(lamp",
        "0 && !are_beside(lamp",
        "what may stop rays from triangles",
        "tests/run/test_unstoppable.py",
    ),
    Mutation(
        "hit = (D >= 0) & (t > 0)",
        "hit = (D > 0) & (t > 0)",
        "tangents of discs",
        "tests/kernels/test_orthographic.py -k touch",
    ),
    Mutation(
        "middle=grid.middle - grid.axes[:2] @ self.shift",
        "middle=grid.middle",
        "lists of other cameras",
        "tests/run/test_other_cameras.py",
    ),
    Mutation(
        "found.flat = found.out ? in_near : in_far;",
        "found.flat = in_near;",
        "cylinders from inside",
        "tests/kernels/test_cylinders.py -k hostile_pictures",
    ),
    Mutation(
        "sign_from(e.D, by.D)",
        "sign_from(e.D, 0)",
        "when doubles are sure that a ray passes a cylinder",
        "tests/kernels/test_cylinders.py -k hostile_pictures",
    ),
    Mutation(
        "alone = asked & are_unclipped(scene, index), capped = planes >= 0;",
        "alone = 0, capped = planes >= 0;",
        "surfaces that planes do not clip",
        "tests/kernels/test_clipped_pictures.py",
    ),
    Mutation(
        "closed->odd ^= here & TO_MASK(sign > 0)",
        "closed->odd ^= here",
        "what a clipped mesh contains",
        "tests/kernels/test_clipped_pictures.py",
    ),
    Mutation(
        "return stops & (!met | in_region(spheres, &way, asked, at.t, met, LIGHT_ERROR));",
        "return stops;",
        "light through what is clipped",
        "tests/kernels/test_clipped_pictures.py",
    ),
    Mutation(
        "hit = (e.discriminant >= 0) & (t > 0)",
        "hit = (e.discriminant > 0) & (t > 0)",
        "tangents",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "bound = (bb + arr) * 0x1p-48",
        "bound = (bb + arr) * 0",
        "bound of doubt",
        "tests/kernels/test_exact.py tests/kernels/test_stress.py",
    ),
    Mutation("e.by_b = e.by_b | (sphere.c <= 0);", "", "discriminant from inside", "tests/kernels/test_stress.py"),
    Mutation(
        "first = (sphere.c > 0) | behind;",
        "first = (sphere.c > 0);",
        "the root from inside",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "at.from_center.z = s - e.v.z",
        "at.from_center.z = s + e.v.z",
        "the hit's point",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "{p, fma(a, b, -p)}", "{p, 0}", "products of pairs", "tests/kernels/test_exact.py tests/kernels/test_stress.py"
    ),
    Mutation(
        "REAL_MASK nearer = t < hit.t;", "REAL_MASK nearer = t > hit.t;", "the nearest", "tests/kernels/test_scenes.py"
    ),
    Mutation("(scene->id_of[index] < ids_of", "(scene->id_of[index] > ids_of", "ties", "tests/kernels/test_stress.py"),
    Mutation(
        "sign_root = s * t * sign_D", "sign_root = s * sign_D", "the order of two roots", "tests/kernels/test_exact.py"
    ),
    Mutation(
        "REACH_SLACK (1.0f + (REAL",
        "REACH_SLACK (0.875f + (REAL",
        "the reach's slack",
        "tests/kernels/test_stress.py tests/kernels/test_hostile.py",
    ),
    Mutation(
        "return sphere_may_meet(b, line.a, s);",
        "return sphere_may_meet(b, 1.0001f * line.a, s);",
        "the filter's bound",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "y = TO_REAL(size.y - 1 - 2 * row)",
        "y = TO_REAL(size.y - 2 * row)",
        "half a pixel",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "far ? (enters & (b < a)) | leaves",
        "far ? enters | leaves",
        "what is beyond the light",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "enters = (c > 0) & meets & ahead",
        "enters = (c > 0) & meets",
        "what is behind the point",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "if (light_side < 0) return c > 0;",
        "if (light_side < 0) return c < 0;",
        "a light inside",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "(self & (start.side < 0) & ((REAL)side > 0))",
        "(self & ((REAL)side > 0))",
        "own shadow",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "at.start.side * direction.cosine > 0);",
        "at.start.side * direction.cosine >= 0);",
        "lights in the tangent plane",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "may & sphere_may_meet(dot_float(ray.w32, s), ray.a, s)",
        "may & sphere_may_meet(dot_float(ray.w32, s), 1.001f * ray.a, s)",
        "point filter",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        "2 * dot * N.x - l.x + view.x",
        "2 * dot * N.x - l.x - view.x",
        "the mirrored ray",
        "tests/kernels/test_consistency.py",
    ),
    Mutation(
        "(exponent == 0 ? (SHADE)1 : (SHADE)0)", "(SHADE)0", "0 to the power of 0", "tests/kernels/test_stress.py"
    ),
    Mutation(
        "-DOT(w, light.axis) >= light.axis.w * sqrt",
        "-DOT(w, light.axis) >= sqrt",
        "the cone",
        "tests/kernels/test_consistency.py",
    ),
    Mutation(
        "cosine_nl = min(max(dot, (SHADE)0), (SHADE)1)",
        "cosine_nl = dot",
        "n.l below 0",
        "tests/kernels/test_precision.py",
    ),
    Mutation(
        "clamped * (shade_t)255 + rounding",
        "clamped * (shade_t)256 + rounding",
        "levels",
        "tests/kernels/test_consistency.py",
    ),
    Mutation(
        "low < 1 ? low : (SHADE)1",
        "low < 2 ? low : (SHADE)1",
        "what is brighter than white",
        "tests/kernels/test_stress.py",
    ),
    Mutation(
        'reach = radius + CONSTANTS["DISC_ROUNDINGS"] * U * (np.abs(u) + np.abs(v) + radius) + loose',
        "reach = radius",
        "no slack in the filter",
        "tests/plan/test_lists.py",
    ),
    Mutation("exact[2] < exact_r * (1 + SLACK)", "exact[2] < 0", "spheres beside the eye", "tests/plan/test_lists.py"),
    Mutation(
        "np.where(number[i] < number[j], j, i)",
        "np.where(number[i] < number[j], i, j)",
        "of equal spheres the last one shows",
        "tests/plan/test_culling.py",
    ),
    Mutation(
        '"WITH_SHADOWS": lit and (surfaces > 1 or',
        '"WITH_SHADOWS": lit and (surfaces > 2 or',
        "a flag",
        "tests/kernels/test_scenes.py tests/run/test_abi.py",
    ),
    Mutation(
        "cos * p[i] - sin * p[j], sin * p[i] + cos * p[j]",
        "cos * p[i] + sin * p[j], cos * p[j] - sin * p[i]",
        "the sense of turning",
        "tests/formats/test_reader.py tests/kernels/test_scenes.py",
    ),
    Mutation(
        "const REAL k = 2 * DOT(n, d);",
        "const REAL k = 1.9999 * DOT(n, d);",
        "the angle of reflection",
        "tests/kernels/test_bounces.py",
    ),
    Mutation(
        "eta = side > 0 ? 1 / index : index",
        "eta = side > 0 ? index : 1 / index",
        "which side is glass",
        "tests/kernels/test_bounces.py",
    ),
    Mutation("!same & (k < 0)", "!same & (k < -0x1p-28)", "the critical angle", "tests/kernels/test_bounces.py"),
    Mutation(
        "total ? rays.weight * (R + T)",
        "total ? rays.weight * R",
        "what total reflection adds",
        "tests/kernels/test_bounces.py",
    ),
    Mutation(
        "rays.depth > scene->bounces", "rays.depth >= scene->bounces", "the last depth", "tests/kernels/test_bounces.py"
    ),
    Mutation(
        "next.inner = through ? !bounce.inside",
        "next.inner = through ? bounce.inside",
        "the new side",
        "tests/kernels/test_bounces.py",
    ),
    Mutation(
        "(near <= far * (1 + 0x1p-20f)) &", "(near <= 0.999f * far) &", "boxes", "tests/kernels/test_ellipsoids.py"
    ),
    Mutation(
        'text.startswith("/") or ".." in text.split("/")',
        'text.startswith("/")',
        "paths out of the folder",
        "tests/formats/test_reader.py",
    ),
    Mutation(
        "const REAL_MASK split = (least < -v.E_error) & (most > v.E_error);",
        "const REAL_MASK split = (least < 0) & (most > 0);",
        "bounds of doubles at edges",
        "-m slow tests/kernels/test_mesh_rays.py -k pixels_show",
    ),
    Mutation(
        "v.EA = (v.den - v.EB) - v.EC;",
        "v.EA = (v.den - v.EB) + v.EC;",
        "the third edge",
        "-m slow tests/kernels/test_mesh_rays.py -k pixels_show",
    ),
    Mutation(
        "if (sign_of(&cross[i], n) != 0) return sign_of(&cross[i], n);",
        "if (sign_of(&cross[2 - i], n) != 0) return sign_of(&cross[2 - i], n);",
        "who owns an edge",
        "-m slow tests/kernels/test_mesh_rays.py -k pixels_show",
    ),
    Mutation(
        "is.side = at_point ? DOT(T.N, beyond) : is.v.D;",
        "is.side = at_point ? -DOT(T.N, beyond) : is.v.D;",
        "what is beyond the light, of triangles",
        "-m slow tests/kernels/test_mesh_rays.py -k lights_reach",
    ),
    Mutation(
        "return (w.a * a + w.b * b) + w.c * c;",
        "return (w.b * a + w.a * b) + w.c * c;",
        "normals between corners",
        "-m slow tests/kernels/test_attributes.py",
    ),
    Mutation(
        "return next((sign for x in (dot(v, w), *v) if (sign := x.sign())), 0)",
        "return next((sign for x in (dot(v, w), *v[::-1]) if (sign := x.sign())), 0)",
        "who owns an edge, in the reference",
        "-m slow tests/oracle/test_mesh_oracle.py -k reference",
    ),
    Mutation(
        "bound, den_error = 2.0**-44 * s * w1 * (triangle.g + triangle.h), 2.0**-46 * w1 * gh",
        "bound, den_error = 0.0, 0.0",
        "bounds of doubles at edges, in the reference",
        "-m slow tests/oracle/test_mesh_oracle.py -k reference",
    ),
    Mutation(
        "met = met.at(np.lexsort((surfaces.rank[met.primitive], met.ray)))",
        "met = met.at(np.lexsort((-surfaces.rank[met.primitive], met.ray)))",
        "ties, of single rays",
        "tests/rays/test_rays.py -k hostile_rays",
    ),
    Mutation("np.rint(values * 65535)", "np.rint(values * 65536 - 1)", "16 bits", "tests/picture/test_outputs.py"),
    Mutation(
        "rows = max(STEP, (last - first) // (2 * STEP) * STEP)",
        "rows = (last - first) // 2",
        "strips",
        "tests/renderers/test_strips.py",
    ),
    Mutation(
        "if any(target == other or os.path.realpath(target) == os.path.realpath(other) for other in targets[:i])",
        "if False",
        "one file for two",
        "tests/picture/test_outputs.py",
    ),
    Mutation("if host not in hosts or (", "if (", "viewer: other hosts", "tests/viewer/test_server.py -k hosts"),
    Mutation(
        'not secrets.compare_digest(request.match_info.get("token", "").encode(), self._token.encode())',
        "False",
        "viewer: other tokens",
        "tests/viewer/test_server.py -k nothing_else",
    ),
]


def copy_to(scratch: Path) -> None:
    """The repository without what the tests do not need."""
    for name in ("cltrace", "kernels", "scenes", "tests"):
        shutil.copytree(ROOT / name, scratch / name, ignore=shutil.ignore_patterns("__pycache__"))
    for path in (*ROOT.glob("*.toml"), *ROOT.glob("*.md")):
        shutil.copy(path, scratch)
    (scratch / "cltrace" / "kernels").symlink_to("../kernels")


def pattern_of(text: str) -> re.Pattern[str]:
    """What finds the text, however its lines are broken."""
    return re.compile(r"\s*".join(map(re.escape, re.findall(r"\w+|[^\w\s]", text))))


def places(scratch: Path, text: str) -> list[Path]:
    """The files that hold the text, each as often as it does."""
    files = [*(scratch / "kernels").rglob("*.cl"), *(scratch / "cltrace").rglob("*.py")]
    return [path for path in files for _ in pattern_of(text).findall(path.read_text("utf-8"))]


def passes(scratch: Path, tests: Sequence[str], device: str | None) -> bool:
    """Whether these tests pass in the scratch copy."""
    command = [sys.executable, "-m", "pytest", "-qx", "-p", "no:cacheprovider", *tests]
    more = ["--device", device] if device else []
    # From here the scratch copy is what `import cltrace` finds.
    env = os.environ | {"PYTHONPATH": str(scratch), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([*command, *more], cwd=scratch, env=env, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1) and done.returncode >= 0:  # a signal is as good as a failed test
        raise SystemExit(f"pytest did not run: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.returncode == 0


def survives(scratch: Path, mutation: Mutation, device: str | None) -> bool:
    """Whether the tests pass with the mistake in."""
    (path,) = places(scratch, mutation.text)
    before = path.read_text("utf-8")
    path.write_text(pattern_of(mutation.text).sub(lambda _: mutation.other, before), "utf-8")
    try:
        return passes(scratch, mutation.tests.split(), device)
    finally:
        path.write_text(before, "utf-8")


def main() -> int:
    """Makes the mistakes, one after the other."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("words", nargs="*", metavar="WORD")
    parser.add_argument("--device", help="test on this device only")
    args = parser.parse_args()
    chosen = [m for m in MUTATIONS if not args.words or any(w in m.text or w in m.what for w in args.words)]
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        copy_to(scratch)
        lost = [m.text for m in chosen if len(places(scratch, m.text)) != 1]
        if lost:
            raise SystemExit("\n".join(["must be there exactly once:", *lost]))
        for tests in sorted({m.tests for m in chosen}):
            if not passes(scratch, tests.split(), args.device):
                raise SystemExit(f"the tests must pass without any mistake: {tests}")
        survivors = 0
        for mutation in chosen:
            start = time.monotonic()
            left = survives(scratch, mutation, args.device)
            survivors += left
            verdict = "SURVIVED" if left else "caught"
            print(f"{verdict:8} {time.monotonic() - start:5.0f} s  {mutation.what}: {mutation.text[:60]!r}", flush=True)
    print(f"{len(chosen) - survivors} of {len(chosen)} caught")
    return 1 if survivors else 0


if __name__ == "__main__":
    raise SystemExit(main())
