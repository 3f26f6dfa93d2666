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


LISTS = "tests/plan/test_lists.py"
STRESS = "tests/kernels/test_stress.py"
ROUGH = "tests/kernels/test_precision.py"
ENDS = "tests/kernels/test_hostile.py"
CULLING = "tests/plan/test_culling.py"
AGREE = "tests/kernels/test_consistency.py"
SCENES = "tests/kernels/test_scenes.py"
EXACT = "tests/kernels/test_exact.py"
PROPERTIES = "tests/renderers/test_properties.py"
ABI = "tests/run/test_abi.py"
READER = "tests/formats/test_reader.py"
BOUNCES = "tests/kernels/test_bounces.py"
TREE = "tests/kernels/test_tree.py"
SECOND = "tests/kernels/test_second_rays.py"
EGGS = "tests/kernels/test_ellipsoids.py"
RAYS = "tests/rays/test_rays.py -k"
# Of rays and triangles, each in the hostile regimes: what pixels show, their light, their mirrors and glass.
MESHES = "-m slow tests/kernels/test_mesh_rays.py -k"
SHOWN, LIT, ONWARD = f"{MESHES} pixels_show", f"{MESHES} lights_reach", f"{MESHES} what_their_mirrors"
PLANES = f"{MESHES} light_on"
BETWEEN = f"{MESHES} glass_show_of_spheres"
REFERENCE = "-m slow tests/oracle/test_mesh_oracle.py -k reference"
SMOOTH = "-m slow tests/kernels/test_attributes.py"

RESULTS = "tests/bench/test_results.py"
FREE, PACKED = "tests/run/test_unstoppable.py", "tests/run/test_packing.py -k tunnel"
SAMPLES = "tests/kernels/test_samples.py -k exact_rays"
CHECKS = "tests/students/test_check.py"
SOFT = "tests/kernels/test_soft_lights.py"
PASSES = "-m slow tests/kernels/test_soft_lights.py -k no_bit_depends"
MIXED, CELLS = "tests/run/test_mixed.py", "tests/plan/test_polygon_lists.py"
OTHERS = "tests/run/test_other_cameras.py"
RODS = "tests/kernels/test_cylinders.py -k hostile_pictures"
VIEWER = "tests/viewer/test_server.py"
ROD_FILTER = "-m slow tests/kernels/test_cylinders.py -k changes_a_picture"
CUTS = "tests/kernels/test_cuts.py"
ESTIMATES = "-m slow tests/kernels/test_samples.py -k step6"
RARE = "tests/kernels/test_samples.py -k rare"
GRAIN = "-m slow tests/kernels/test_samples.py::test_error_is_mostly_enough"
FIT, PARALLEL = "tests/scene/test_cameras.py", "tests/kernels/test_orthographic.py -k"
SLOWLY = f"-m slow {PARALLEL}"

COARSE = "tests/run/test_packing.py -k coarse"

MUTATIONS = [
    Mutation("(s.x * slope.x - s.y * slope.y)", "(s.x * slope.x + s.y * slope.y)", "rays of coarse pictures", COARSE),
    Mutation("(a * (1 + 0x1p-36))", "(a * (1 - 0x1p-9))", "depths of coarse pictures", COARSE),
    Mutation("D > off ? far", "1 ? far", "what may miss hides nothing in coarse pictures", COARSE),
    Mutation("if (!(a * c > 0x1p-20 * size))", "if (0)", "coarse pictures from the surface of a sphere", COARSE),
    Mutation(
        "scene->started) at.ambient = pixels.color", "0) at.ambient = pixels.color", "lights of earlier passes", PASSES
    ),
    Mutation(
        "p.near = least - pane->along;", "p.near = most - pane->along;", "triangles' depths in parallel light", MIXED
    ),
    Mutation(
        "part.entries and part.members]", "part.entries]", "a side without cylinders", f"-m slow {CELLS} -k no_cylinder"
    ),
    Mutation(
        "window.is_tiny(", "0 and window.is_tiny(", "small triangles in parallel light", f"-m slow {CELLS} -k small"
    ),
    Mutation(
        "const SHADE cosine = -DOT(axis, l);", "const SHADE cosine = 1;", "a panel's cosine", f"{SOFT} -k reference"
    ),
    Mutation(
        "over = POWER_OF_TWO(1 / sqrt(DOT(w, w)))",
        "over = 1 / sqrt(DOT(w, w))",
        "digits of directions in other units",
        "-m slow tests/kernels/test_hostile_meshes.py -k no_face",
    ),
    Mutation(".max) / 2)", ".max))", "colours that overflow", "tests/kernels/test_hostile.py -k overflow"),
    Mutation("(error > 0) & (away > ROUNDING)", "error > 1", "bytes off by a level", f"{CHECKS} -k next_one"),
    Mutation("(1 + _lights(scene)) * (RAY +", "(RAY +", "samples for many lights", f"{CHECKS} -k lights"),
    Mutation(
        "spheres.undecided[0] = spheres.undecided[number_of_item()] = 1",
        "spheres.undecided[0] = 1",
        "which pixels a second program draws",
        "-m slow tests/kernels/test_undecided.py -k second_program",
    ),
    Mutation("(INT)scene->lattice.y * i & (n - 1)", "i", "a pixel's rays are on a diagonal", SAMPLES),
    Mutation("r + sqrt(power) * h)", "r)", "spheres that only the middle of a pixel misses are not seen", SAMPLES),
    Mutation(
        "own - size * h - 0x1p-19f", "own - 0x1p-19f", "spheres that cover a pixel's middle cover it all", SAMPLES
    ),
    Mutation("GRAIN_SCATTER 0.98f", "GRAIN_SCATTER 0.2f", "estimates of fine textures", GRAIN),
    Mutation("#define MOST_KINDS 5", "#define MOST_KINDS 8", "what eight rays may miss of a texture", RARE),
    Mutation("UNEVEN = 100", "UNEVEN = 255", "textures in which texels differ by much", RARE),
    Mutation("rough = rough | (found[MET]", "rough = rough & (found[MET]", "what corners have met", ESTIMATES),
    Mutation(
        "mixed = mixed | may_show_another(",
        "mixed = mixed & may_show_another(",
        "pixels' corners are all that is asked",
        SAMPLES,
    ),
    Mutation("ANY(may) && !are_beside(lamp", "0 && !are_beside(lamp", "what may stop rays from triangles", FREE),
    Mutation("!few[k].of_cell && !own->of_cell", "!few[k].of_cell", "large triangles before small triangles", FREE),
    Mutation("!few[k].of_cell && !own->of_cell", "!own->of_cell", "small triangles before large triangles", FREE),
    Mutation("at - off * size >= 1", "at >= 0.9f", "what is behind planes of triangles", FREE),
    Mutation("at + off * size <= 1", "at <= 1.1f", "what is before planes of triangles", FREE),
    Mutation("few->far = furthest", "few->far = 0.5f * furthest", "what is beyond all of triangles", FREE),
    Mutation("towards * at + error <=", "-towards * at + error <=", "sides of planes of triangles", FREE),
    Mutation("(touches | other) ?", "touches ?", "spheres before triangles", f"-m slow {FREE}"),
    Mutation("((fabs(x) + fabs(y)) + e) + 0x1p-48 * (rr + XX)", "0", "doubt about discs", f"{PARALLEL} grazing"),
    Mutation("hit = (D >= 0) & (t > 0)", "hit = (D > 0) & (t > 0)", "tangents of discs", f"{PARALLEL} touch"),
    Mutation("? normal.z >= 0 : own.c", "? normal.z >= -2 : own.c", "spheres cut by the plane", f"{PARALLEL} pictures"),
    Mutation(
        "start.on_plane = HAS(WITH_PARALLEL_RAYS) && own < 0",
        "start.on_plane = 0",
        "triangles in whole numbers",
        f"{SLOWLY} triangles",
    ),
    Mutation("& (near.high < 0)", "", "triangles behind the plane", f"{SLOWLY} triangles"),
    Mutation("hit.near.high = -INFINITY", "hit.near.high = 0", "the first triangle", f"{SLOWLY} triangles"),
    Mutation(
        "ahead = z - exact_r <",
        "ahead = z + exact_r <",
        "lists of spheres that are cut",
        f"{SLOWLY} plane_cuts",
    ),
    Mutation("across[0] + r, -across[1] - r", "across[0], -across[1] - r", "edges of discs", f"{SLOWLY} filter"),
    Mutation(
        "disc_filter(u, v, small.radius, LOOSE)", "disc_filter(u, v, 0.99 * small.radius)", "disc", f"{PARALLEL} touch"
    ),
    Mutation(
        "triangles.sided >= sided",
        "triangles.sided >= 0",
        "fronts once rays go on",
        "tests/renderers/test_update.py -k fronts",
    ),
    Mutation("middle=grid.middle - grid.axes[:2] @ self.shift", "middle=grid.middle", "lists of other cameras", OTHERS),
    Mutation("before[name][along, :3] @ self.shift", "0", "where parallel lights count from", OTHERS),
    Mutation(
        "DOT(ray->from, light.position) + light.position.w", "DOT(ray->from, light.position)", "depths of", OTHERS
    ),
    Mutation("writer.done(common=kept is None)", "writer.done()", "lists that cameras have in common", OTHERS),
    Mutation("found.flat = found.out ? in_near : in_far;", "found.flat = in_near;", "cylinders from inside", RODS),
    Mutation(
        "by.first = rod_disc_error(e, e.h, e.v1, off);",
        "by.first = 0;",
        "when doubles are sure of a cylinder's end",
        RODS,
    ),
    Mutation("sign_from(e.D, by.D)", "sign_from(e.D, 0)", "when doubles are sure that a ray passes a cylinder", RODS),
    Mutation("E = 0x1p-20f * (r + s)", "E = 0x1p-30f * (r + s)", "what floats know of a cylinder's side", ROD_FILTER),
    Mutation(
        "FMA((FLOAT)h, a, magnitude(we) * is.most) + Y_error",
        "(FLOAT)h * a",
        "what floats know of a cylinder's ends",
        ROD_FILTER,
    ),
    Mutation("h * a - Y_error : (FLOAT)-1", "2 * h * a : (FLOAT)-1", "cylinders that surely stop", ROD_FILTER),
    Mutation("h * a - Y_error : (FLOAT)-1", "0.99f * h * a : (FLOAT)2", "lines beside cylinders", ROD_FILTER),
    Mutation("&& is_outside_of(scene, ray, number); end++", "; end++", "lights within cylinders", ROD_FILTER),
    Mutation("(low + a > most_off)", "(high + a > 0)", "cylinders that end before a point in their shadow", ROD_FILTER),
    Mutation(
        "before = ray.at_point ? high < -off", "before = ray.at_point ? low < 0", "cylinders at a light", ROD_FILTER
    ),
    Mutation("(line.b + line.most + a < -most_off)", "(line.b + a < 0)", "where cylinders end", ROD_FILTER),
    Mutation("line.b - line.most > off :", "line.b > off :", "where cylinders begin behind a light", ROD_FILTER),
    Mutation(
        "(is_whole(scene, number) ? is_between_discs(line, -1) : (MASK)0)",
        "ALL_LANES",
        "cylinders met at an end",
        ROD_FILTER,
    ),
    Mutation("last = line.b - line.least + b_off", "last = first", "how far what is surely met is", RODS),
    Mutation(
        "fabs(e.c) <= rough.c", "fabs(e.c) < 0", "where cylinders cross", "tests/kernels/test_cylinders.py -k cross"
    ),
    Mutation("first = line.b - line.most - b_off", "first = line.b - b_off", "how near a cylinder begins", ROD_FILTER),
    Mutation("!(sight.near.high < hit->near.low)", "!(sight.near.low < hit->near.low)", "ends behind", ROD_FILTER),
    Mutation(
        "real(2**0.5 * (1 + SLACK)) * r + size",
        "real(0.2) * r + size",
        "cylinders that reach into a side of a light's cube",
        "-m slow tests/kernels/test_cylinders.py -k shadows_are",
    ),
    Mutation(
        "np.copysign(edge.dtype.type(most[k // 2]), edge)",
        "np.copysign(edge.dtype.type(0.1), edge)",
        "cylinders that are all around the eye",
        RODS,
    ),
    Mutation("np.where(below, A[1], right)", "np.where(below, left, right)", "hexagons around cylinders", RODS),
    Mutation("low -= loose", "low += loose", "what the edges of cylinders are off by", RODS),
    Mutation("c.w == 0) rod.span = 0", "c.w < 0) rod.span = 0", "caps that are discs", CUTS),
    Mutation(
        "number < scene->spheres.first_cut;", "1;", "light where balls are cut", f"-m slow {CUTS} -k changes_a_pic"
    ),
    Mutation(
        "ray.level = rod.round & flat",
        "ray.level = (REAL_MASK)0 & flat",
        "caps in the light, in single",
        f"-m slow {CUTS} -k single",
    ),
    Mutation("caps, made])", "made, caps])", "caps before what they cap", "tests/scene/test_clipping.py"),
    Mutation("np.where(kind >= 0, by[kind], length)", "length", "how far ellipsoids reach", FIT),
    Mutation("max(above + below, (right + left) * high / wide)", "(above + below)", "pictures that are high", FIT),
    Mutation("hit = (e.discriminant >= 0) & (t > 0)", "hit = (e.discriminant > 0) & (t > 0)", "tangents", STRESS),
    Mutation("hit = (e.discriminant >= 0) & (t > 0)", "hit = (e.discriminant >= 0) & (t >= 0)", "root 0", STRESS),
    Mutation("bound = (bb + arr) * 0x1p-48", "bound = (bb + arr) * 0", "bound of doubt", f"{EXACT} {STRESS}"),
    Mutation("tiny = arr < bb * 0x1p-42", "tiny = arr < 0", "normals of tiny spheres", STRESS),
    Mutation("e.by_b = bb < arr;", "e.by_b = bb >= arr;", "which form of the discriminant", f"{EXACT} {STRESS}"),
    Mutation("e.by_b = e.by_b | (sphere.c <= 0);", "", "discriminant from inside", STRESS),
    Mutation("0x1p-10f * (e.b * e.b)", "0x1p-40f * (e.b * e.b)", "cancellation in t", f"{EXACT} {STRESS}"),
    Mutation("first = (sphere.c > 0) | behind;", "first = (sphere.c > 0);", "the root from inside", STRESS),
    Mutation("at.from_center.z = s - e.v.z", "at.from_center.z = s + e.v.z", "the hit's point", STRESS),
    Mutation("{p, fma(a, b, -p)}", "{p, 0}", "products of pairs", f"{EXACT} {STRESS}"),
    Mutation("{s, (a - (s - t)) + (b - t)}", "{s, 0}", "sums of pairs", f"{EXACT} {STRESS}"),
    Mutation("(real)0.5 * ((real)3 - DOT(n, n))", "(real)0.5 * ((real)3.001 - DOT(n, n))", "length of normals", STRESS),
    Mutation("REAL_MASK nearer = t < hit.t;", "REAL_MASK nearer = t > hit.t;", "the nearest", SCENES),
    Mutation("(scene->id_of[index] < ids_of", "(scene->id_of[index] > ids_of", "ties", STRESS),
    Mutation("margin = best * (real)0x1p-22f", "margin = best * (real)0x1p-60f", "nearly equal distances", STRESS),
    Mutation("return (exact < 0) | ((exact == 0) & tie);", "return exact < 0;", "exact ties", EXACT),
    Mutation("(wanted & !rounds_to_hi(e.D, e.D_error))", "(wanted & (e.D.hi != e.D.hi))", "doubts of pairs", EXACT),
    Mutation("!((gap > error) | (gap < -error))", "(gap != gap)", "doubts of pairs about distances", EXACT),
    Mutation("? 124 : 108)", "? 124 : 80)", "room for whole numbers", "-m slow tests/kernels/test_exact.py"),
    Mutation(
        "set_to(&f, coordinate(eye, i)",
        "set_to(&f, 0 * coordinate(eye, i)",
        "the eye in whole numbers",
        "-m slow tests/kernels/test_exact.py",
    ),
    Mutation("sign_root = s * t * sign_D", "sign_root = s * sign_D", "the order of two roots", EXACT),
    Mutation("(cut > 0x400 ||", "(cut > 0x4ff ||", "rounding of whole numbers", EXACT),
    Mutation(
        "fetch_material_of(scene, k + AHEAD);\n            if",
        "if (as_float(entry.y) > 0.5f * reach) break;\n            if",
        "end of lists",
        AGREE,
    ),
    Mutation("REACH_SLACK (1.0f + (REAL", "REACH_SLACK (0.875f + (REAL", "the reach's slack", f"{STRESS} {ENDS}"),
    Mutation(
        "dx, (FLOAT)s.x, FMA(dy, (FLOAT)s.y, (FLOAT)-s.z)",
        "dx, (FLOAT)s.x, FMA(dy, (FLOAT)s.y, (FLOAT)s.z)",
        "sign in the filter",
        SCENES,
    ),
    Mutation(
        "return sphere_may_meet(b, line.a, s);",
        "return sphere_may_meet(b, 1.0001f * line.a, s);",
        "the filter's bound",
        STRESS,
    ),
    Mutation("y = TO_REAL(size.y - 1 - 2 * row)", "y = TO_REAL(size.y - 2 * row)", "half a pixel", STRESS),
    Mutation("far ? (enters & (b < a)) | leaves", "far ? enters | leaves", "what is beyond the light", STRESS),
    Mutation("leaves = (c < 0) | ((c == 0) & ahead)", "leaves = (c <= 0)", "a point on another sphere", STRESS),
    Mutation("enters = (c > 0) & meets & ahead", "enters = (c > 0) & meets", "what is behind the point", STRESS),
    Mutation(
        "if (light_side == 0) return enters & (b < a);",
        "if (light_side == 0) return enters;",
        "a light on a sphere",
        STRESS,
    ),
    Mutation("if (light_side < 0) return c > 0;", "if (light_side < 0) return c < 0;", "a light inside", STRESS),
    Mutation("(bb < arr ? bb - a * c : arr - DOT(cross, cross))", "(bb - a * c)", "shadows that graze", STRESS),
    Mutation("(self & (start.side < 0) & ((REAL)side > 0))", "(self & ((REAL)side > 0))", "own shadow", STRESS),
    Mutation("may = may & (ray.own != index);\n    }", "}", "own shadow, lean kernel", f"{ENDS} -k right_before"),
    Mutation(
        "at.start.side * direction.cosine > 0);",
        "at.start.side * direction.cosine >= 0);",
        "lights in the tangent plane",
        STRESS,
    ),
    Mutation(
        "deeper = lit & (ray.depth > as_float(entry.y))",
        "deeper = lit & (ray.depth > 2 * as_float(entry.y))",
        "end of lists of lights",
        CULLING,
    ),
    Mutation(
        "FMA(du, du, dv * dv) <= s.z)",
        "FMA(du, du, dv * dv) <= 0.99f * s.z)",
        "parallel filter",
        "-m slow tests/plan/test_culling.py",
    ),
    Mutation(
        "may & sphere_may_meet(dot_float(ray.w32, s), ray.a, s)",
        "may & sphere_may_meet(dot_float(ray.w32, s), 1.001f * ray.a, s)",
        "point filter",
        STRESS,
    ),
    Mutation("number].z >> (own & 31)) & 1)", "number].z >> ((own + 1) & 31)) & 1)", "what may be blocked", SCENES),
    Mutation(
        "cell.column = column < last_column ? column : last_column;",
        "cell.column = column < last_column ? column : 0;",
        "the last cell of a window",
        CULLING,
    ),
    Mutation(
        "level.columns + (cell.column >> level.level)",
        "level.columns + cell.column",
        "levels of a light",
        "-m slow tests/plan/test_culling.py",
    ),
    Mutation("level.columns + (place.x >> level.level)", "level.columns + place.x", "levels of the picture", CULLING),
    Mutation(
        "level.next += level.columns * (((grid.cells.y - 1) >> level.level) + 1)",
        "level.next += level.columns * ((grid.cells.y >> level.level) + 1)",
        "where a level begins",
        CULLING,
    ),
    Mutation("2 * dot * N.x - l.x + view.x", "2 * dot * N.x - l.x - view.x", "the mirrored ray", AGREE),
    Mutation("(exponent == 0 ? (SHADE)1 : (SHADE)0)", "(SHADE)0", "0 to the power of 0", STRESS),
    Mutation(
        "fall = 1 - (angle - light.cone.x) * light.cone.y", "fall = 1 - angle * light.cone.y", "spot lights", AGREE
    ),
    Mutation("-DOT(w, light.axis) >= light.axis.w * sqrt", "-DOT(w, light.axis) >= sqrt", "the cone", AGREE),
    Mutation("MASK tiny = ray.a < 0x1p-80f;", "MASK tiny = a < 0;", "lights at the point", ENDS),
    Mutation("const Real3 w = {ray.w.x * (real)0x1p80f", "const Real3 w = {ray.w32.x * (real)0x1p80f", "tiny", ROUGH),
    Mutation("on = TO_SHADE_MASK(lit);", "on = TO_SHADE_MASK(lit) & (dot > 0);", "grazing light", ROUGH),
    Mutation("goes_on).growth(scene.camera.max_bounces)", "goes_on).growth(0)", "colours that bounces brighten", ROUGH),
    Mutation("(flat or sharp) and ks", "sharp and ks", "flat highlights in float", ROUGH),
    Mutation(
        "same_precision = request.precision == self.precision", "same_precision = True", "floats for doubles", ROUGH
    ),
    Mutation(
        "cosine_nl = min(max(dot, (SHADE)0), (SHADE)1)",
        "cosine_nl = dot",
        "n.l below 0",
        ROUGH,
    ),
    Mutation(
        "g = g * w + 0.14285714312987743",
        "g = g * w + 0.24285714312987743",
        "the highlight in double",
        f"{SCENES} -k highlights",
    ),
    Mutation("at.exponent * z >= (shade_t)light.cone.z", "at.exponent * z >= (shade_t)-1", "highlights", STRESS),
    Mutation("{p[0] | (p[1] << 24)", "{p[0] | (p[1] << 16)", "bytes", AGREE),
    Mutation("clamped * (shade_t)255 + rounding", "clamped * (shade_t)256 + rounding", "levels", AGREE),
    Mutation("low < 1 ? low : (SHADE)1", "low < 2 ? low : (SHADE)1", "what is brighter than white", STRESS),
    Mutation(
        "frame.right.y * v.x + frame.up.y * v.y",
        "frame.up.x * v.x + frame.up.y * v.y",
        "normals in the world",
        "-m slow tests/kernels/test_consistency.py",
    ),
    Mutation(
        'reach = radius + CONSTANTS["DISC_ROUNDINGS"] * U * (np.abs(u) + np.abs(v) + radius) + loose',
        "reach = radius",
        "no slack in the filter",
        LISTS,
    ),
    Mutation("side.scale + 1 / 64", "side.scale", "no 64th of a cell", LISTS),
    Mutation("side.scale - 1 / 64", "side.scale", "no 64th of a cell", LISTS),
    Mutation("side.scale + 1 / 64", "side.scale + 1 / 3", "too many cells", LISTS),
    Mutation(
        "begin=middle - off, end=middle + off", "begin=middle - off, end=middle + off + 1.5", "too many tiles", LISTS
    ),
    Mutation("loose = slack * (1 + np.abs(begin) + np.abs(end))", "loose = 0 * begin", "edges of discs", LISTS),
    Mutation("(np.abs(low) + np.abs(high)) * real(ends.slack)", "0 * low", "edges in the picture", LISTS),
    Mutation("bound = c - wide - 2.0**-100", "bound = c", "the filters' bound", LISTS),
    Mutation("gap * gap * (1 - 2.0**-19)", "gap * gap", "nearest points", LISTS),
    Mutation("-(s + r) - SLACK * (np.abs(s) + r) - 2.0**-100", "-(s + r)", "nearest ends", LISTS),
    Mutation("loose = slack * (1 + 2 * np.maximum", "loose = 0 * (1 + 2 * np.maximum", "edges of windows", LISTS),
    Mutation("2.0**-60) * (1 + SLACK)", "2.0**-60)", "a window's half", LISTS),
    Mutation("room = 256 * slack", "room = 0 * slack", "where rays end", LISTS),
    Mutation("(part.near < window.furthest) &", "(part.near < 0.5 * window.furthest) &", "far ends", LISTS),
    Mutation(" & (right <= pane[1])", "", "which discs fit into a window", LISTS),
    Mutation(" & ~_fit(edges, self.beside)", "", "which discs are left to a smaller window", LISTS),
    Mutation("disc[1] <= pane.y", "disc[0] <= pane.y", "which discs fit into a window, on the device", PACKED),
    Mutation("(distance + r) ** 2 * real(1 + 2.0**-10)", "distance**2", "furthest points", LISTS),
    Mutation("r * real(2**0.5 * (1 + SLACK))", "r", "sides of the cube", LISTS),
    Mutation("middle - half, middle + half", "middle - half, middle", "tangents of discs", LISTS),
    Mutation("exact[2] < exact_r * (1 + SLACK)", "exact[2] < 0", "spheres beside the eye", LISTS),
    Mutation(
        "coarse = perspective and bool((half > NARROW / 2).all())", "coarse = True", "float32 for small windows", LISTS
    ),
    Mutation("+ roomy[near] < inner", "- roomy[near] < inner", "spheres inside others", CULLING),
    Mutation("(radius[a] == radius[b]) & (center[a", "(center[a", "equal spheres", CULLING),
    Mutation(
        "self._known(power), True), np.sign(power)",
        "self._known(power), True), np.abs(np.sign(power))",
        "lights inside",
        STRESS,
    ),
    Mutation("np.fill_diagonal(shadows, inside)", "np.fill_diagonal(shadows, False)", "own shadow", STRESS),
    Mutation(
        "return np.asarray((gap <= roomy[:, None] + roomy[None])",
        "return np.asarray((gap <= roomy[:, None])",
        "few spheres in the sun",
        "-m slow tests/plan/test_culling.py",
    ),
    Mutation(
        "overlap = angle <= (half + loose)[:, None] + (half + loose)[None]",
        "overlap = angle <= (half + loose)[:, None]",
        "few spheres before a lamp",
        "-m slow tests/plan/test_culling.py",
    ),
    Mutation(
        '"WITH_SPECULAR": lit and (world.materials.shiny or full)',
        '"WITH_SPECULAR": lit and full',
        "a flag",
        "-m slow tests/kernels/test_scenes.py",
    ),
    Mutation(
        "inside = inside or world.bounces.glass or full",
        "inside = world.bounces.glass or full",
        "a flag",
        "-m slow tests/kernels/test_scenes.py",
    ),
    Mutation(
        '"WITH_SHADOWS": lit and (surfaces > 1 or',
        '"WITH_SHADOWS": lit and (surfaces > 2 or',
        "a flag",
        f"{SCENES} {ABI}",
    ),
    Mutation(
        "1 / (alpha2 - alpha1) if alpha2 > alpha1 else 0", "1 / alpha2 if alpha2 > alpha1 else 0", "spot lights", AGREE
    ),
    Mutation(
        "in_world = np.concatenate([world.center, space.power_rest[:, None]], axis=1)",
        "in_world = np.concatenate([world.center, 0 * space.power_rest[:, None]], axis=1)",
        "what was cut off",
        EXACT,
    ),
    Mutation(
        "_CANCELS * sum(np.abs(term)",
        "0 * sum(np.abs(term)",
        "powers that cancel",
        PROPERTIES,
    ),
    Mutation('return region[0] % CONSTANTS["TILE"], region', "return 0, region", "crops", AGREE),
    Mutation("rounding = 0.0 if request.truncate else 0.5", "rounding = 0.5", "truncated bytes", STRESS),
    Mutation(
        "cos * p[i] - sin * p[j], sin * p[i] + cos * p[j]",
        "cos * p[i] + sin * p[j], cos * p[j] - sin * p[i]",
        "the sense of turning",
        f"{READER} {SCENES}",
    ),
    Mutation(
        "square_pixels=False,  # the tutorial's rule for the shorter side",
        "square_pixels=True,",
        "the angle of the shorter side",
        "-m slow tests/kernels/test_scenes.py",
    ),
    Mutation("const REAL k = 2 * DOT(n, d);", "const REAL k = 1.9999 * DOT(n, d);", "the angle of reflection", BOUNCES),
    Mutation(
        "eta = side > 0 ? 1 / index : index", "eta = side > 0 ? index : 1 / index", "which side is glass", BOUNCES
    ),
    Mutation("(eta * eta) * DOT(X, X), root", "eta * DOT(X, X), root", "Snell's law", BOUNCES),
    Mutation("!same & (k < 0)", "!same & (k < -0x1p-28)", "the critical angle", BOUNCES),
    Mutation("!same & (k < 0)", "(REAL_MASK)(k < 0)", "an index of 1", "-m slow tests/kernels/test_bounces.py"),
    Mutation("total ? rays.weight * (R + T)", "total ? rays.weight * R", "what total reflection adds", BOUNCES),
    Mutation("rays.depth > scene->bounces", "rays.depth >= scene->bounces", "the last depth", BOUNCES),
    Mutation("kept < most ? kept : most", "kept", "the largest contribution", BOUNCES),
    Mutation("parts > 0 ? parts : (REAL)0", "parts", "black times infinity", BOUNCES),
    Mutation("next.inner = through ? !bounce.inside", "next.inner = through ? bounce.inside", "the new side", BOUNCES),
    Mutation("(own ? b + b : by_q", "(own ? b : by_q", "how far the own surface is", BOUNCES),
    Mutation("unsure = wanted & !passes & !sure;", "unsure = wanted & !passes & !sure & (b != b);", "doubts", BOUNCES),
    Mutation("own | (fabs(e.c.hi) <= e.c_error)", "own", "where surfaces touch", BOUNCES),
    Mutation("return (a < b) | ((a == b)", "return (a > b) | ((a == b)", "ties of rays from surfaces", BOUNCES),
    Mutation(
        "const REAL margin = best * (real)0x1p-22f;",
        "const REAL margin = 0;",
        "close rivals of rays from surfaces",
        f"{BOUNCES} {TREE}",
    ),
    Mutation("at.t = (hit & (at.t > 0)) ? at.t", "at.t = hit ? at.t", "what lies behind", f"{BOUNCES} {TREE}"),
    Mutation(
        "FLOAT reach = TO_FLOAT(met->at.t * scale) * REACH_SLACK;",
        "FLOAT reach = TO_FLOAT(met->at.t * scale) * 0.5f;",
        "how far rays look",
        TREE,
    ),
    Mutation('"WIDEN": 24,', '"WIDEN": -1000000,', "the width of the blocks' spheres", TREE),
    Mutation("chord->may &= last >= 0;", "chord->may &= first >= 0;", "spheres around a start", TREE),
    Mutation("(near <= far * (1 + 0x1p-20f)) &", "(near <= 0.999f * far) &", "boxes", EGGS),
    Mutation(
        "if (count <= CANDIDATES - 8) return 1;",
        "return 1;",
        "room for candidates",
        f"{BOUNCES} {TREE}",
    ),
    Mutation(
        '"receivers" in request.keep or world.bounces.any or',
        '"receivers" in request.keep or',
        "shadows in mirrors",
        f"{BOUNCES} {TREE}",
    ),
    Mutation(
        "for sight in self._sights]) | self._world.bounces.glass",
        "for sight in self._sights])",
        "light in glass",
        f"{BOUNCES} {TREE}",
    ),
    Mutation(
        "inside = inside or world.bounces.glass or",
        "inside = inside or",
        "a flag",
        "-m slow tests/kernels/test_bounces.py tests/kernels/test_tree.py",
    ),
    Mutation(
        "world.materials.brightest * world.bounces.growth(camera.max_bounces)",
        "world.materials.brightest",
        "highlights that grow",
        f"{BOUNCES} {TREE}",
    ),
    Mutation(
        "rays.live & (met.id < 0), rays.weight, background", "rays.live, rays.weight, background", "the night", BOUNCES
    ),
    Mutation("rays.weight * bounce.share, &all", "bounce.share, &all", "weights", BOUNCES),
    Mutation("leaf, live, &bundle, furthest", "0, live, &bundle, furthest", "leaves that packets try", BOUNCES),
    Mutation("const MASK only = sends & !mirrors;", "const MASK only = sends;", "branches", BOUNCES),
    Mutation(
        "slack->y += slack_of(w * scene->brightest.y, roundings);",
        "",
        "what was dropped",
        "-m slow tests/kernels/test_tree.py",
    ),
    Mutation(
        "parts > (real)0.5f ? parts + more : (REAL)0",
        "parts > (real)0.5f ? (real)0.25f * parts : (REAL)0",
        "bounds of what was dropped",
        "-m slow tests/kernels/test_tree.py",
    ),
    Mutation(
        "np.maximum(shown.max(axis=0, initial=0), background)",
        "0.25 * shown.max(axis=0, initial=0)",
        "the greatest brightness",
        "-m slow tests/kernels/test_tree.py",
    ),
    Mutation(
        'text.startswith("/") or ".." in text.split("/")', 'text.startswith("/")', "paths out of the folder", READER
    ),
    Mutation('if "/" in text or text in (".", ".."):', 'if text in (".", ".."):', "names with a folder", READER),
    Mutation(
        "(D > D_error) & (D_error <= 0x1p-25 * root * q) & (e <= 0x1p-26 * q) & (fabs(c) > c_least)",
        "(D > 0)",
        "of what doubles are sure, from surfaces",
        SECOND,
    ),
    Mutation("two_sum(guess, (REAL)0.5 * guess * (rest.hi + rest.lo))", "pair(guess, 0)", "length of normals", SECOND),
    # Triangles and single rays.
    Mutation(
        "const REAL_MASK split = (least < -v.E_error) & (most > v.E_error);",
        "const REAL_MASK split = (least < 0) & (most > 0);",
        "bounds of doubles at edges",
        SHOWN,
    ),
    Mutation(
        "meets = inside | ((D > 0) & (least > v.E_error)) | ((D < 0) & (most < -v.E_error));",
        "meets = inside | ((D > 0) & (least >= 0)) | ((D < 0) & (most <= 0));",
        "edges that doubles decide",
        SHOWN,
    ),
    Mutation(
        "const REAL_MASK sure_t = (fabs(D) > 0x1p26 * v.D_error)",
        "const REAL_MASK sure_t = (fabs(D) > 0)",
        "depths of triangles all but in the eye's plane",
        f"{MESHES} how_far",
    ),
    Mutation("v.EA = (v.den - v.EB) - v.EC;", "v.EA = (v.den - v.EB) + v.EC;", "the third edge", SHOWN),
    Mutation(
        "sides.open = least >= -bound;",
        "sides.open = least >= 0.0f;",
        "the filter of edges misses",
        SHOWN,
    ),
    Mutation(
        "sides.inside = least > bound;",
        "sides.inside = least > 0.0f;",
        "the filter of edges meets",
        SHOWN,
    ),
    Mutation("return flip ? -sign : sign;", "return sign;", "edges from one end", SHOWN),
    Mutation(
        "if (sign_of(&cross[i], n) != 0) return sign_of(&cross[i], n);",
        "if (sign_of(&cross[2 - i], n) != 0) return sign_of(&cross[2 - i], n);",
        "who owns an edge",
        SHOWN,
    ),
    Mutation(
        "if (sign_of(&Q[i], n) != 0) return sides * sign_of(&Q[i], n);",
        "if (sign_of(&Q[i], n) != 0) return sign_of(&Q[i], n);",
        "which of two planes comes first",
        SHOWN,
    ),
    Mutation(
        "if (whole_volume(spheres, start, a[1], a[2], b[k], 0, (real4)(0)) != 0) return 0;",
        "continue;",
        "which triangles share a plane",
        SHOWN,
    ),
    Mutation("const MASK lower = level &", "const MASK lower = level & 0 &", "the first of one plane", SHOWN),
    Mutation(
        "return wanted & (sign * D > 0);",
        "return wanted & (sign * D < 0);",
        "all but in one plane",
        f"{MESHES} fans_all_but",
    ),
    Mutation(
        "corners = np.take_along_axis(corners[among], by_mark, axis=1)",
        "corners = corners[among]",
        "triangles that are equal",
        "tests/plan/test_culling.py -k equal",
    ),
    Mutation("return (first < 0) | ((first == 0) & tie);", "return first < 0;", "equal triangles", SHOWN),
    Mutation(
        "(primitives_of(scene, A) < primitives_of(scene, B))",
        "(primitives_of(scene, A) > primitives_of(scene, B))",
        "equal triangles of a mesh",
        SHOWN,
    ),
    Mutation(
        "const Pair3 x = pairs_between(anchor, choose3(first, second, c.b, c.c, c.a));",
        "const Pair3 x = pairs_between(anchor, choose3(first, second, c.c, c.a, c.b));",
        "where pairs have a ray start",
        ONWARD,
    ),
    Mutation(
        "start.next = spheres.vertex[corner[(k + 1) % 3]];",
        "start.next = spheres.vertex[corner[(k + 2) % 3]];",
        "where whole numbers have a ray start",
        ONWARD,
    ),
    Mutation(
        "weight : (REAL)0.5f) : (REAL)INWARD;",
        "weight : (REAL)0.5f) : (REAL)0;",
        "points of edges are moved inwards",
        f"{MESHES} edges_of_a_room",
    ),
    Mutation(
        "at.q.z = first ? (REAL)0 : second ? (REAL)1 : (REAL)2;",
        "at.q.z = first ? (REAL)0 : second ? (REAL)2 : (REAL)1;",
        "the corner that a point is counted from",
        ONWARD,
    ),
    Mutation(
        "place.reach = size_of(x) + size_of(y);",
        "place.reach = 0;",
        "how far a start may be off",
        f"{MESHES} before_a_fan",
    ),
    Mutation(
        "is.side = at_point ? DOT(T.N, beyond) : is.v.D;",
        "is.side = at_point ? -DOT(T.N, beyond) : is.v.D;",
        "what is beyond the light, of triangles",
        LIT,
    ),
    Mutation(
        "const REAL_MASK ends = ends_there & ((front & (side < -side_error))",
        "const REAL_MASK ends = ends_there & ((front & (side < 0x1p30 * side_error))",
        "points all but in a triangle's plane",
        PLANES,
    ),
    Mutation(
        "TO_REAL_MASK(unsure) ? -TO_REAL(whole_signs(",
        "TO_REAL_MASK(unsure) ? TO_REAL(whole_signs(",
        "points in a triangle's plane",
        PLANES,
    ),
    Mutation(
        "sides.open = least >= -bound;",
        "sides.open = least >= bound;",
        "the filter of lights misses",
        LIT,
    ),
    Mutation(
        "sides.inside = least > bound;",
        "sides.inside = least > -bound;",
        "the filter of lights meets",
        LIT,
    ),
    Mutation(
        "return (w.a * a + w.b * b) + w.c * c;",
        "return (w.b * a + w.a * b) + w.c * c;",
        "normals between corners",
        SMOOTH,
    ),
    Mutation("DOT(matrix.a, n), DOT(matrix.b, n), DOT(matrix.c, n)", "n.x, n.y, n.z", "normals in the world", SMOOTH),
    Mutation(
        "side[unsure] = exact_sides(triangles, rows.start + unsure, point)",
        "side[unsure] = 0",
        "triangles all but edge-on, on the host",
        SHOWN,
    ),
    Mutation(
        "bound = FLOAT * _rounding(n, plane) + TURNED * reach * (sizes[i] * sizes[(i + 1) % 3]) + LEAST",
        "bound = 0.01 * FLOAT * _rounding(n, plane) + LEAST",
        "the facets' bound",
        SHOWN,
    ),
    Mutation(
        "flat[some] = (a == b).all(axis=1) | (b == c).all(axis=1) | (c == a).all(axis=1)",
        "flat[some] = True",
        "corners that rounding makes one",
        f"{RAYS} hostile_meshes",
    ),
    Mutation(
        "return next((sign for x in (dot(v, w), *v) if (sign := x.sign())), 0)",
        "return next((sign for x in (dot(v, w), *v[::-1]) if (sign := x.sign())), 0)",
        "who owns an edge, in the reference",
        REFERENCE,
    ),
    Mutation(
        "return sign_along(self.direction, (x, y, z)) < 0",
        "return dot((x, y, z), self.direction).sign() < 0",
        "which of two planes comes first, in the reference",
        REFERENCE,
    ),
    Mutation(
        "bound, den_error = 2.0**-44 * s * w1 * (triangle.g + triangle.h), 2.0**-46 * w1 * gh",
        "bound, den_error = 0.0, 0.0",
        "bounds of doubles at edges, in the reference",
        REFERENCE,
    ),
    Mutation(
        "E_error = 2.0**-44 * s * w1 * (g + h) + den_error",
        "E_error = 0 * den_error",
        "bounds of doubles at edges, of single rays",
        f"{RAYS} hostile_rays",
    ),
    Mutation(
        "c_error = 2.0**-46 * s * f1 + 2.0**-50 * (ff + rr) + (2.0**-47 * s) ** 2 + FLOOR",
        "c_error = 0 * ff",
        "starts on spheres, of single rays",
        f"{RAYS} but_for_rounding",
    ),
    Mutation(
        "sign[planes] = np.where(tie, signs(mine.b * n - its.b * m), sign[planes])",
        "pass",
        "which of two planes comes first, of single rays",
        f"{RAYS} hostile_rays",
    ),
    Mutation(
        "met = met.at(np.lexsort((surfaces.rank[met.primitive], met.ray)))",
        "met = met.at(np.lexsort((-surfaces.rank[met.primitive], met.ray)))",
        "ties, of single rays",
        f"{RAYS} hostile_rays",
    ),
    Mutation(
        "entered = (near <= far) & (child != 0)",
        "entered = (near <= 0.99 * far) & (child != 0)",
        "boxes, of single rays",
        "tests/rays/test_rays.py",
    ),
    Mutation(
        '(written["id"] >= 0, np.uint8(255), level)',
        '(written["id"] > 0, np.uint8(255), level)',
        "alpha of surface 0",
        "tests/picture/test_alpha.py",
    ),
    Mutation(
        "background_of(background, 1.0, self.transfer)",
        "background_of(background, 1.0)",
        "a background given as sRGB",
        "tests/picture/test_transfer.py",
    ),
    Mutation(
        "color[rows]\n        bucket",
        "color[rows] * 1.002\n        bucket",
        "levels of sRGB",
        "tests/picture/test_transfer.py",
    ),
    Mutation(
        'more["color"] = decoded(more["color"], transfer)',
        "",
        "materials of meshes given as sRGB",
        "-m slow tests/picture/test_transfer.py",
    ),
    Mutation(
        "images = tuple(linear_texels(image, transfer) for image in textures)",
        "images = textures",
        "textures given as sRGB",
        "-m slow tests/picture/test_transfer.py",
    ),
    Mutation(
        'shade["color"] = decoded(shade["color"], scene.transfer)',
        "pass",
        "updated colours given as sRGB",
        "tests/picture/test_transfer.py",
    ),
    Mutation(
        "(np.asarray(colormap.lut(256)) * 255).astype(np.uint8)",
        "np.rint(np.asarray(colormap.lut(256)) * 255).astype(np.uint8)",
        "bytes of the package cmap",
        "tests/picture/test_colors.py",
    ),
    Mutation(
        "np.asarray(cmap(share, bytes=True))",
        "np.asarray(cmap(share))",
        "bytes of a map",
        "tests/picture/test_colors.py",
    ),
    Mutation(
        "layout.begin, layout.end)\n        pixels[: layout.bar, columns",
        "layout.begin + 1, layout.end + 1)\n        pixels[: layout.bar, columns",
        "a lying bar",
        "tests/picture/test_colors.py",
    ),
    Mutation(
        'value = array * arrays["alpha"][..., None]',
        "value = array",
        "an EXR's colours times alpha",
        "tests/picture/test_outputs.py",
    ),
    Mutation("np.rint(values * 65535)", "np.rint(values * 65536 - 1)", "16 bits", "tests/picture/test_outputs.py"),
    Mutation(
        "self._target, self._file = file, file if file.seekable() else io.BytesIO()",
        "self._target, self._file = file, file",
        "blocks of an EXR into pipes",
        "tests/picture/test_outputs.py",
    ),
    Mutation(
        "rows = max(STEP, (last - first) // (2 * STEP) * STEP)",
        "rows = (last - first) // 2",
        "strips",
        "tests/renderers/test_strips.py",
    ),
    Mutation(
        "if any(_same(target, other) for other in targets[:i])",
        "if False",
        "one file for two",
        "tests/picture/test_outputs.py",
    ),
    Mutation(
        "replace(self.request, outputs=written)",
        "self.request",
        "frames of another background's alpha",
        "-m slow tests/base/test_progress.py",
    ),
    Mutation(
        "self._packer = other._packer",
        "pass",
        "what lights see, of further cameras",
        "tests/run/test_packing.py -k further_cameras",
    ),
    Mutation(
        "if arguments.keys() != self.parameters.keys():",
        "if not arguments.keys() >= self.parameters.keys():",
        "arguments that a kernel has not",
        "tests/run/test_kernel_arguments.py",
    ),
    Mutation(
        "self.rows.give_back(mine)",
        "self.rows.settle(mine)",
        "devices that fail",
        "tests/renderers/test_all_devices.py",
    ),
    Mutation(
        "max(strip.stop - self._margin, 0)",
        "strip.stop",
        "rows of several devices",
        "tests/renderers/test_all_devices.py",
    ),
    Mutation("other._executor = other._executor.of(", "other._executor.of(", "rows of a picture", f"{AGREE} -k rows"),
    Mutation("if host not in hosts or (", "if (", "viewer: other hosts", f"{VIEWER} -k hosts"),
    Mutation("origin is not None or socket_", "origin is not None", "viewer: no origin", f"{VIEWER} -k websocket"),
    Mutation(
        'not secrets.compare_digest(request.match_info.get("token", "").encode(), self._token.encode())',
        "False",
        "viewer: other tokens",
        f"{VIEWER} -k nothing_else",
    ),
    Mutation("self._shown.clear()", "pass", "viewer: pictures that wait", f"{VIEWER} -k wait_for_the_one_before"),
    Mutation("presses != self.presses", "False", "viewer: rest", "tests/viewer/test_session.py -k at_rest_ends"),
    Mutation(
        "if message.data:  #", "if True:  #", "viewer: errors that wait", f"-m slow {VIEWER} -k error_is_no_picture"
    ),
    Mutation("shutdown_timeout=0.1", "shutdown_timeout=0", "viewer: Ctrl-C beside a page", f"{VIEWER} -k program"),
    Mutation(
        "camera = scene.camera if self.camera == before else self.camera",
        "camera = scene.camera",
        "viewer: frames keep a moved camera",
        "-m slow tests/viewer/test_film.py -k animate",
    ),
    Mutation(
        "lights[name][number] *= share", "pass", "viewer: dimmed lights", "tests/viewer/test_session.py -k lights"
    ),
    Mutation("blocker or end)", "end)", "viewer: blocked shadow rays", "tests/viewer/test_session.py -k rays_of"),
    Mutation("if remember and self._rested:", "if remember:", "viewer: undo", "tests/viewer/test_session.py -k undo"),
    Mutation("time.time() - self._start >= DELAY", "True", "bars of short work", "tests/base/test_progress.py"),
    Mutation(
        "self.high - self.low <= AGREE * self.median",
        "self.low - self.high <= AGREE * self.median",
        "the benchmark draws times that waver",
        f"{RESULTS} -k rounds_agree",
    ),
    Mutation(
        "done >= SURE_ROUNDS and point.time.steady",
        "done >= LEAST_ROUNDS and point.time.steady",
        "the benchmark believes three rounds",
        f"{RESULTS} -k until_its_rounds_agree",
    ),
    Mutation(
        "watch.seconds() > self._world.patience",
        "watch.seconds() > 1e9",
        "lists of lights may take as long as they like",
        "tests/renderers/test_stop.py -k lists",
    ),
    Mutation(
        "spent[k] += time.perf_counter() - start",
        "spent[0] += time.perf_counter() - start",
        "dear tracers of the benchmark take the seconds of cheap ones",
        f"{RESULTS} -k its_own_seconds",
    ),
    Mutation(
        "ENOUGH / max(1e-6, done.kernel[-1])",
        "ENOUGH / max(1e-6, done.kernel[0])",
        "what compiles is taken for a long frame",
        f"{RESULTS} -k frames_are_repeated",
    ),
    Mutation(
        "if digest(picture) == verdict.digest:",
        "if verdict.digest:",
        "errors of another picture",
        f"{RESULTS} -k the_same_picture",
    ),
    Mutation(
        "sum(_used(child) for child in children.read_text().split())",
        "0",
        "peers that run on are taken for others",
        f"{RESULTS} -k only_what_others_do",
    ),
    Mutation(
        "_time(one) <= _time(peer) and _as_right(one, peer)",
        "_time(one) <= _time(peer) and _as_right(peer, one)",
        "peers that are beaten are ahead",
        f"{RESULTS} -k peers_are_ahead",
    ),
    Mutation(
        'if shares["others"] > OTHERS:',
        'if shares["others"] < OTHERS:',
        "a loaded machine does not say so",
        f"{RESULTS} -k a_loaded_machine",
    ),
    Mutation(
        "yield Change(MORE if b > a else LESS",
        "yield Change(MORE if b < a else LESS",
        "more work than before is taken for less",
        f"{RESULTS} -k got_worse",
    ),
    Mutation(
        "if not ratios and not gone:",
        "if ratios or not gone:",
        "figures that are older than the code are not marked",
        f"{RESULTS} -k older_than_the_code",
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
