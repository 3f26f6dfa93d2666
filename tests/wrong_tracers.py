"""Ray tracers with one mistake each, as students make them: texts that are replaced in a right tracer.

TUTORIAL is about scenes/tutorial.py and VECTOR about vector_tracer.py. The keys are the names that `cltrace.compare`
has to say; behind a stroke stands which of several ways to make a mistake it is. READING changes a scene file, instead,
and PICTURE what has been drawn: both make either tracer wrong.

    python tests/wrong_tracers.py NAME SCENE.xml MINE.png [WxH]

draws a scene as a tutorial with a mistake does. It is slow: a second for some 5,000 pixels of a few spheres.
"""

# ruff: noqa: E501 - a text that is replaced is one line, as it is where it stands

from __future__ import annotations

import math
import sys
import types
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from lxml import etree
from numpy.typing import NDArray

import cltrace
from cltrace.cli.options import picture_size

Bytes = NDArray[np.uint8]
Texts = tuple[tuple[str, str], ...]

_SHARES = "parts = [(max(0.0, 1 - m.reflectance - m.transmittance), parts[0][1])]"
_MIRROR = "mirror = m.reflectance if through else m.reflectance + m.transmittance  # total reflection"
_EYE = "(x * x_i + y * y_i - z)"
_ROOTS = "for t in ((-b - math.sqrt(disc)) / a, (-b + math.sqrt(disc)) / a):"
_SHADOW = "closest_hit(world.surfaces, shadow_ray) is not None"
_MIRRORED = "ray.direction - at.normal * (2 * at.normal.dot(ray.direction))"
_INVERSE = ("mesh.normal_to_world.tolist()", "__import__('numpy').linalg.inv(mesh.to_world[:, :3]).T.tolist()")
_TURNED = "n = (n if n.dot(ray.direction) < 0 else -n).normalized()"

TUTORIAL: dict[str, Texts] = {
    "full-field-of-view": (("math.radians(camera.horizontal_fov)", "math.radians(camera.horizontal_fov) / 2"),),
    "full-field-of-view/upwards": (("math.tan(fov_y)", "math.tan(fov_y / 2)"),),
    "full-field-of-view/across": (("math.tan(fov_x)", "math.tan(fov_x / 2)"),),
    "tangent-vertical-field/width": (("math.tan(fov_x)", "math.tan(longer)"), ("math.tan(fov_y)", "math.tan(longer) * height / width")),
    "tangent-vertical-field": (
        ("math.tan(fov_y)", "(math.tan(fov_x) * height / width if width >= height else math.tan(fov_y))"),
    ),
    "aspect-inverted": (("min(width, height) / max(width, height)", "max(width, height) / min(width, height)"),),
    "aspect-ignored": (("longer * min(width, height) / max(width, height)", "longer"),),
    "degrees-for-radians": (("math.radians(camera.horizontal_fov)", "camera.horizontal_fov"),),
    "pixel-corner": (("(column + 0.5)", "column"), ("(row + 0.5)", "(row + 1)")),
    "pixel-corner/top": (("(column + 0.5)", "column"), ("(row + 0.5)", "row")),
    "shifted": (("(column + 0.5)", "(column - 0.5)"),),
    "mirrored": (("Direction(*camera.up).cross(z)", "z.cross(Direction(*camera.up))"), ("y = z.cross(x)", "y = x.cross(z)")),
    "camera-not-normalized": (("x = Direction(*camera.up).cross(z).normalized()", "x = Direction(*camera.up).cross(z)"),),
    "camera-not-normalized/z": (("z = (eye - Point(*camera.lookat)).normalized()", "z = eye - Point(*camera.lookat)"),
                                (_EYE, "(x * x_i + y * (y_i * (1 / z.length())) - z)")),
    "up-not-orthogonal": (("y = z.cross(x)", "y = Direction(*camera.up)"),),
    "camera-transposed": ((_EYE, "Direction(*(Direction(x_i, y_i, -1).dot(a) for a in (x, y, z)))"),),
    "ray-not-normalized": ((_EYE + ".normalized()", _EYE),),
    "camera-backwards": (("y * y_i - z)", "y * y_i + z)"),),
    "no-shadows": ((_SHADOW, "False"),),
    "glass-without-shadow": (
        (_SHADOW, "closest_hit([s for s in world.surfaces if getattr(s, 'material', 0) == 0 or s.material.transmittance == 0], "
                  "shadow_ray) is not None"),
    ),
    "shadow-beyond-light": (("Ray(at.point, to_light, t_max=distance)", "Ray(at.point, to_light)"),),
    "large-epsilon": (("EPSILON = 1e-7", "EPSILON = 0.2"), ("at.t - EPSILON", "at.t")),
    "large-epsilon/half": (("EPSILON = 1e-7", "EPSILON = 0.5"), ("at.t - EPSILON", "at.t")),
    "large-epsilon/normal": (("Ray(at.point, to_light, t_max=distance)", "Ray(at.point + at.normal * 0.05, to_light, t_max=distance)"),),
    "acne/float": (("Ray(at.point, to_light, t_max=distance)",
                    "Ray(Point(*map(float, __import__('numpy').float32(at.point))), to_light, t_min=0, t_max=distance)"),),
    "acne": (("Ray(at.point, to_light, t_max=distance)", "Ray(at.point, to_light, t_min=0, t_max=distance)"),),
    "light-reversed": (("return -self.axis.normalized(), math.inf", "return self.axis.normalized(), math.inf"),),
    "light-reversed/others": (("n_l, shadow_ray = n.dot", "to_light = to_light if light.kind == PARALLEL else -to_light\n        n_l, shadow_ray = n.dot"),),
    "light-not-normalized": (("to_light, distance = (self.position - point).normalized(), (self.position - point).length()",
                              "to_light, distance = self.position - point, (self.position - point).length()"),
                             ("Ray(at.point, to_light, t_max", "Ray(at.point, to_light.normalized(), t_max")),
    "attenuation": (("highlight) * L for C", "highlight) * L / (distance ** 2 if light.kind != PARALLEL else 1) for C"),),
    "no-spot-cone": (("if self.kind != SPOT:", "if True:"),),
    "spot-edge": (("max(0.0, min(1.0, (self.alpha2 - angle) / fading)) if fading else float(angle <= self.alpha2)",
                   "float(angle <= self.alpha2)"),),
    "no-highlights": (("highlight = m.ks *", "highlight = 0 *"),),
    "no-diffuse": (("(m.kd * C * n_l + highlight)", "highlight"),),
    "no-ambient": (("m.ka * C * La", "0.0"),),
    "ka-forgotten": (("m.ka * C * La", "C * La"),),
    "ka-twice": (("m.ka * C * La", "m.ka ** 2 * C * La"),),
    "ambient-per-light": (
        ("for light in world.lights:", "parts = parts * len(world.lights) + [(0, 0, 0)]\n    for light in world.lights:"),
    ),
    "ambient-per-light/lit": (
        ("parts.append(tuple(F", "parts.append(parts[0]); parts.append(tuple(F"),
        ("zip(*parts, strict=True)", "zip((0, 0, 0), *parts[1:], strict=True)"),
    ),
    "specular-tinted": (("n_l + highlight) * L", "n_l + highlight * C) * L"),),
    "blinn": (("r, v = n * (2 * n_l) - to_light, -ray.direction", "v = -ray.direction; r, v = (to_light + v).normalized(), n"),),
    "highlight-reversed": (("n * (2 * n_l) - to_light,", "to_light - n * (2 * n_l),"),),
    "highlight-times-cosine": (("n_l + highlight) * L", "n_l + highlight * n_l) * L"),),
    "no-facing-gate": (("n_l <= 0 or F", "F"), ("m.kd * C * n_l", "m.kd * C * max(0, n_l)")),
    "no-facing-gate/negative": (("n_l <= 0 or F", "F"),),
    "early-clamp": (("return tuple(map(sum, zip(*parts, strict=True)))", "return tuple(min(1.0, sum(c)) for c in zip(*parts))"),),
    "normal-not-normalized": ((_TURNED, "n = n if n.dot(ray.direction) < 0 else -n"), _INVERSE,
                              ("self.K, strict=True))).normalized()", "self.K, strict=True)))")),
    "normal-not-normalized/sphere": (("n = (o + d * t).normalized()  #", "n = o + d * t  #"),
                                     ("self.K, strict=True))).normalized()", "self.K, strict=True)))")),
    "normal-not-flipped": (("t, -outward if inside else outward,", "t, outward,"),),
    "normal-transform": (("list(zip(*self.K, strict=True))", "__import__('numpy').linalg.inv(self.K).tolist()"),),
    "last-hit": (("nearest, ray = at, Ray(ray.origin, ray.direction, ray.t_min, at.t - EPSILON)", "nearest = at"),),
    "far-root": ((_ROOTS, "for t in ((-b + math.sqrt(disc)) / a, (-b - math.sqrt(disc)) / a):"),),
    "near-root-only": ((_ROOTS, "for t in ((-b - math.sqrt(disc)) / a,):"),),
    "culled-faces": (("if det == 0:", "if det * (1 if self.outward is self.flat or self.outward == self.flat else -1) <= 0:"),),
    "culled-faces/winding": (("if det == 0:", "if det <= 0:"),),
    "texture-flipped": (("(v % 1) * height", "((1 - v) % 1) * height"),),
    "texture-swapped": (("x, y = (u % 1) * width, (v % 1) * height", "x, y = (v % 1) * width, (u % 1) * height"),),
    "texture-clamped": (("x, y = (u % 1) * width, (v % 1) * height",
                         "x, y = (min(max(c, 0), 1) * (n - 1e-9) for c, n in ((u, width), (v, height)))"),),
    "nearest-texel": (("i, j = math.floor(x), math.floor(y)", "i, j = x, y = math.floor(x), math.floor(y)"),),
    "half-texel": (("(u % 1) * width, (v % 1) * height", "(u % 1) * width - 0.5, (v % 1) * height - 0.5"),),
    "half-texel/right": (("(u % 1) * width, (v % 1) * height", "(u % 1) * width + 0.5, (v % 1) * height + 0.5"),),
    "no-textures": (("solid * t / full", "solid"),),
    "integer-division/aspect": (("min(width, height) / max(width, height)", "min(width, height) // max(width, height)"),),
    "integer-division": (("share * solid * t / full", "share * solid * (t // full)"),),
    "no-mirrors": (("if mirror > 0:", "if mirror > 0 and m.transmittance:"), ("1 - m.reflectance - m.transmittance), parts", "1 - m.transmittance), parts"),
                   (_MIRROR, "mirror = 0.0 if through else m.transmittance")),
    "no-mirrors/dark": (("if mirror > 0:", "if False:"),),
    "no-refraction": (("if m.transmittance else None", "if False else None"), (_MIRROR, "mirror = m.reflectance"),
                      ("1 - m.reflectance - m.transmittance), parts", "1 - m.reflectance), parts")),
    "no-bending": (("m.index if at.inside else 1 / m.index", "1.0"),),
    "no-bounces": (("if depth <= world.camera.max_bounces:", "if False:"),),
    "one-bounce": (("if depth <= world.camera.max_bounces:", "if depth < 1:"),),
    "mirror-depth": (("depth <= world", "depth < world"),),
    "own-share-whole": ((_SHARES, "pass"),),
    "share-doubled": (("parts.append((mirror,", "parts.append((mirror * mirror,"),),
    "share-doubled/twice": (("parts.append((mirror,", "parts.append((2 * mirror,"),),
    "reflection-wrong": ((_MIRRORED, "at.normal * (2 * at.normal.dot(ray.direction)) - ray.direction"),),
    "reflection-wrong/once": ((_MIRRORED, "(ray.direction - at.normal * at.normal.dot(ray.direction)).normalized()"),),
    "index-not-inverted": (("m.index if at.inside else 1 / m.index", "1 / m.index"),),
    "refraction-inverted": (("m.index if at.inside else 1 / m.index", "1 / m.index if at.inside else m.index"),),
    "total-reflection-dropped": ((_MIRROR, "mirror = m.reflectance"),),
    "fresnel": (
        (_MIRROR, _MIRROR + "\n        if through:\n            R0 = ((1 - m.index) / (1 + m.index)) ** 2\n"
                  "            F = R0 + (1 - R0) * (1 + at.normal.dot(ray.direction)) ** 5\n"
                  "            mirror, m.transmittance_ = (m.reflectance + m.transmittance) * F, (m.reflectance + m.transmittance) * (1 - F)"),
        ("parts.append((m.transmittance,", "parts.append((m.transmittance_,"),
    ),
    "secondary-background": (("return world.background\n", "return world.background if depth == 0 else (0.0, 0.0, 0.0)\n"),),
    "wrapped": (("int(255 * min(1.0, c) + 0.5)", "int(255 * c + 0.5) % 256"),),
    "unscaled": (("int(255 * min(1.0, c) + 0.5)", "int(min(1.0, c))"),),
    "truncated": (("int(255 * min(1.0, c) + 0.5)", "int(255 * min(1.0, c))"),),
    "truncated/256": (("int(255 * min(1.0, c) + 0.5)", "int(255.999 * min(1.0, c))"),),
    "gamma": (("int(255 * min(1.0, c) + 0.5)", "int(255 * min(1.0, c) ** (1 / 2.2) + 0.5)"),),
    "gamma/inverse": (("int(255 * min(1.0, c) + 0.5)", "int(255 * min(1.0, c) ** 2.2 + 0.5)"),),
    "gamma/root": (("int(255 * min(1.0, c) + 0.5)", "int(255 * min(1.0, c) ** 0.5 + 0.5)"),),
    "light-missing": (("for record in scene.lights if record[\"kind\"] != AMBIENT]", "for record in scene.lights if record[\"kind\"] != AMBIENT][:1]"),),
}  # fmt: skip

_BETWEEN = "hidden |= thing.meet(P, l)[0] < distance"
_ADDED = "(strength[:, None] * (diffuse + highlight)"
VECTOR: dict[str, Texts] = {
    "full-field-of-view": (("half_x = half_y = np.radians(camera.horizontal_fov)", "half_x = half_y = np.radians(camera.horizontal_fov) / 2"),),
    "tangent-vertical-field": (("* np.tan(half_y))", "* (np.tan(half_x) * height / width if width >= height else np.tan(half_y)))"),),
    "aspect-inverted": (("half_y = half_x * height / width", "half_y = half_x * width / height"),
                        ("half_x = half_y * width / height", "half_x = half_y * height / width")),
    "aspect-ignored": (("half_y = half_x * height / width", "pass"), ("half_x = half_y * width / height", "pass")),
    "degrees-for-radians": (("half_x = half_y = np.radians(camera.horizontal_fov)", "half_x = half_y = camera.horizontal_fov"),),
    "pixel-corner": (("(u + 0.5)", "u"),),
    "pixel-corner/both": (("(u + 0.5)", "u"), ("(v + 0.5)", "v")),
    "shifted": (("(u + 0.5)", "(u - 0.5)"),),
    "shifted/two": (("(v + 0.5)", "(v + 2.5)"),),
    "up-not-orthogonal": (("y = np.cross(z, x)", "y = unit(np.array(camera.up))"),),
    "camera-not-normalized": (("x = unit(np.cross(np.array(camera.up), z))", "x = np.cross(np.array(camera.up), z)"),),
    "camera-transposed": (("unit(x_i * x + y_i * y - z)", "unit(np.concatenate([x_i, y_i, -np.ones_like(x_i)], 1) @ np.array([x, y, z]).T)"),),
    "ray-not-normalized": (("d = unit(x_i * x + y_i * y - z)", "d = x_i * x + y_i * y - z"),),
    "no-shadows": ((_BETWEEN, "pass"),),
    "glass-without-shadow": ((_BETWEEN, "if world.materials[thing.material]['transmittance'] == 0:\n            " + _BETWEEN),),
    "shadow-beyond-light": ((_BETWEEN, "hidden |= thing.meet(P, l)[0] < np.inf"),),
    "light-reversed": (("np.broadcast_to(-light[", "np.broadcast_to(light["),),
    "light-reversed/spot": (("np.clip(-l @ unit", "np.clip(l @ unit"),),
    "light-not-normalized": (("l = unit(way)  # noqa", "l = way if light[\"kind\"] != PARALLEL else unit(way)  # noqa"),
                             ("distance = np.linalg.norm(way, axis=1)", "distance = np.ones(len(P))"),
                             ("np.clip(-l @", "np.clip(-unit(l) @")),
    "attenuation": ((_ADDED, "(strength[:, None] / (1 + np.where(np.isinf(distance), 0, distance)[:, None]) * (diffuse + highlight)"),),
    "attenuation/square": ((_ADDED, "(strength[:, None] / np.where(np.isinf(distance), 1, distance)[:, None] ** 2 * (diffuse + highlight)"),),
    "no-spot-cone": (("strength = np.clip(ramp, 0, 1)", "pass"),),
    "spot-edge": (("strength = np.clip(ramp, 0, 1)", "strength = (angle <= light[\"alpha1\"]) * 1.0"),),
    "no-highlights": (("highlight = m[\"ks\"]", "highlight = 0 * m[\"ks\"]"),),
    "no-diffuse": (("diffuse = m[\"kd\"]", "diffuse = 0 * m[\"kd\"]"),),
    "no-ambient": (("color = m[\"ka\"]", "color = 0 * m[\"ka\"]"),),
    "ka-forgotten": (("color = m[\"ka\"][:, None] * world.ambient", "color = np.ones((len(C), 1)) * world.ambient"),),
    "ka-twice": (("color = m[\"ka\"]", "color = m[\"ka\"][:, None] * m[\"ka\"]"),),
    "ambient-per-light": (("n_l = dot(n, l)", "n_l = dot(n, l); color += color0 if light is not world.lights[0] else 0"),
                          ("world.ambient * C\n", "world.ambient * C\n    color0 = color.copy()\n")),
    "specular-tinted": (("highlight = m[\"ks\"][:, None]", "highlight = m[\"ks\"][:, None] * C"),),
    "blinn": (("r_v = np.clip(dot(r, -d), 0, None)", "r_v = np.clip(dot(n, unit(l - d)), 0, None)"),),
    "highlight-reversed": (("dot(r, -d)", "dot(r, d)"),),
    "highlight-times-cosine": (("highlight = m[\"ks\"][:, None]", "highlight = n_l * m[\"ks\"][:, None]"),),
    "no-facing-gate": (("(n_l[:, 0] > 0) & (strength > 0)", "strength > 0"), ("C * n_l", "C * np.maximum(n_l, 0)")),
    "no-facing-gate/both": (("n_l = dot(n, l)", "n_l = abs(dot(n, l))"),),
    "early-clamp": (("    return color\n\n\ndef trace", "    return np.minimum(color, 1)\n\n\ndef trace"),),
    "early-clamp/light": (("world.ambient * C\n", "world.ambient * np.ones_like(C)\n    shine = np.zeros_like(C)\n"), ("C * n_l", "n_l"),
                          ("color[lit] +=", "shine[lit] += (strength[:, None] * highlight * light[\"color\"])[lit]\n        color[lit] +="),
                          ("(diffuse + highlight)", "diffuse"),
                          ("    return color\n\n\ndef trace", "    return np.minimum(color, 1) * C + shine\n\n\ndef trace")),
    "normal-not-normalized": (("n = unit(np.where(dot(n, d) > 0, -n, n))", "n = np.where(dot(n, d) > 0, -n, n)"),),
    "normal-not-flipped": (("n = np.where(inside, -n, n)\n", "pass\n"),),
    "normal-transform": (("n = unit(q @ self.K)", "n = unit(q @ np.linalg.inv(self.K).T)"),),
    "normal-transform/none": (("n = unit(q @ self.K)", "n = unit(q)"),),
    "last-hit": (("nearer = far < t - EPSILON", "nearer = far < np.inf"),),
    "far-root": (("t = np.where(near > EPSILON, near, np.where(far > EPSILON, far, np.inf))", "t = np.where(far > EPSILON, far, np.inf)"),),
    "near-root-only": (("np.where(far > EPSILON, far, np.inf))", "np.inf)"),),
    "culled-faces": (("met = (x >= 0)", "met = (det * self.front[k] > 0) & (x >= 0)"),),
    "culled-faces/winding": (("met = (x >= 0)", "met = (det > 0) & (x >= 0)"),),
    "texture-flipped": (("uv[:, 1] % 1 * h", "(1 - uv[:, 1]) % 1 * h"),),
    "texture-flipped/u": (("uv[:, 0] % 1 * w", "(1 - uv[:, 0]) % 1 * w"),),
    "texture-swapped": (("x, y = uv[:, 0] % 1 * w, uv[:, 1] % 1 * h", "x, y = uv[:, 1] % 1 * w, uv[:, 0] % 1 * h"),),
    "texture-clamped": (("x, y = uv[:, 0] % 1 * w, uv[:, 1] % 1 * h", "x, y = np.clip(uv[:, 0], 0, 1) * w, np.clip(uv[:, 1], 0, 1) * h"),),
    "nearest-texel": (("a, b = (x - i)[:, None], (y - j)[:, None]", "a = b = 0"),),
    "half-texel": (("i, j = np.floor(x)", "x, y = x - 0.5, y - 0.5\n    i, j = np.floor(x)"),),
    "no-textures": (("C[m[\"texture\"] == k] *= textured(image, uv[m[\"texture\"] == k])", "pass"),),
    "integer-division": (("[image / np.iinfo(image.dtype).max for", "[1.0 * (image // np.iinfo(image.dtype).max) for"),),
    "no-mirrors": (("r, t = m[\"reflectance\"].copy(), m", "r, t = 0 * m[\"reflectance\"], m"),),
    "no-mirrors/dark": (("for part, further in ((r, mirrored), (t, through)):", "for part, further in ((t, through),):"),),
    "no-refraction": (("m[\"reflectance\"].copy(), m[\"transmittance\"]", "m[\"reflectance\"].copy(), 0 * m[\"transmittance\"]"),),
    "no-bending": (("eta = np.where(inside, m[\"index\"], 1 / np.where(t > 0, m[\"index\"], 1))[:, None]", "eta = np.ones((len(d), 1))"),),
    "no-bounces": (("if depth <= world.bounces and", "if False and"),),
    "one-bounce": (("if depth <= world.bounces and", "if depth < 1 and"),),
    "mirror-depth": (("depth <= world.bounces", "depth <= world.bounces + 1"),),
    "own-share-whole": (("color *= np.maximum(1 - r - t, 0)[:, None]", "pass"),),
    "share-doubled": (("color[on] += part[on, None] *", "color[on] += part[on, None] ** (2 if further is mirrored else 1) *"),),
    "share-doubled/glass": (("color[on] += part[on, None] *", "color[on] += part[on, None] * (2 if further is through else 1) *"),),
    "reflection-wrong": (("mirrored = d + 2 * c * n", "mirrored = -d - 2 * c * n"),),
    "reflection-wrong/sign": (("mirrored = d + 2 * c * n", "mirrored = unit(d - 2 * c * n)"),),
    "index-not-inverted": (("eta = np.where(inside, m[\"index\"], 1 /", "eta = np.where(False, 1, 1 /"),),
    "refraction-inverted": (("eta = np.where(inside,", "eta = np.where(~inside & (t > 0),"), ("1 / np.where(t > 0, m[\"index\"], 1))[:, None]", "np.where(t > 0, 1 / m[\"index\"], 1))[:, None]")),
    "total-reflection-dropped": (("np.where(total, r + t, r)", "r"),),
    "fresnel": (("mirrored = d +", "F = (1 - m['index']) ** 2 / (1 + m['index']) ** 2\n        F = F + (1 - F) * (1 - c[:, 0]) ** 5\n"
                 "        r, t = np.where((t > 0) & ~total, r + t * F, r), t * (1 - F)\n        mirrored = d +"),),
    "secondary-background": (("np.tile(np.array(world.background, float)", "np.tile(np.array(world.background, float) * (depth == 0)"),),
    "wrapped": (("np.clip(colors, 0, 1) * 255 + 0.5)", "colors * 255 + 0.5).astype(int)"),),
    "gamma": (("np.clip(colors, 0, 1) * 255", "np.where(np.clip(colors, 0, 1) <= 0.0031308, 12.92 * np.clip(colors, 0, 1), 1.055 * np.clip(colors, 0, 1) ** (1 / 2.4) - 0.055) * 255"),),
    "light-missing": (("in scene.lights[~is_ambient]]", "in scene.lights[~is_ambient]][:-1]"),),
}  # fmt: skip


def _each(path: str, change: Callable[[etree._Element], None]) -> Callable[[etree._Element], None]:
    def edit(scene: etree._Element) -> None:
        for element in scene.findall(f".//{path}"):
            change(element)

    return edit


def _gone(element: etree._Element) -> None:
    element.getparent().remove(element)


def _times(name: str, factor: float) -> Callable[[etree._Element], None]:
    def change(element: etree._Element) -> None:
        element.set(name, repr(float(element.get(name)) * factor))

    return change


def _position_last(sphere: etree._Element) -> None:
    position, transform = sphere.find("position"), sphere.find("transform")
    if transform is not None:
        transform.insert(0, etree.Element("translate", dict(position.attrib)))
        position.attrib.update(dict.fromkeys("xyz", "0"))


def _of(scene: etree._Element, *names: str) -> list[etree._Element]:
    return [element for name in names for element in scene.iter(name)]


def _rotations(factor: float) -> Callable[[etree._Element], None]:
    def edit(scene: etree._Element) -> None:
        for element in _of(scene, "rotateX", "rotateY", "rotateZ"):
            _times("theta", factor)(element)

    return edit


def _narrower(scene: etree._Element) -> None:
    for element in scene.iter("falloff"):
        for name in ("alpha1", "alpha2"):
            _times(name, 0.5)(element)


READING: dict[str, Callable[[etree._Element], None]] = {
    "transform-order": _each("transform", lambda e: e.__setitem__(slice(None), list(reversed(e)))),
    "transform-order/last": _each("sphere", _position_last),
    "rotation-reversed": _rotations(-1),
    "degrees-for-radians/rotation": _rotations(math.degrees(1)),
    "no-scale": _each("scale", _gone),
    "no-rotation": lambda scene: [_gone(e) for e in _of(scene, "rotateX", "rotateY", "rotateZ")] and None,
    "no-translation": _each("translate", _gone),
    "no-transforms": _each("transform", _gone),
    "spot-angle": _narrower,
    "no-point-lights": _each("point_light", _gone),
    "no-spot-lights": _each("spot_light", _gone),
    "no-parallel-lights": _each("parallel_light", _gone),
    "no-meshes": _each("mesh", _gone),
    "no-spheres": _each("sphere", _gone),
}

# Light of sRGB's primaries, as a screen of Display P3's shows it (the product of both standards' matrices).
_P3 = ((0.8225, 0.1775, 0.0), (0.0332, 0.9669, 0.0), (0.0171, 0.0724, 0.9108))


def _on_another_screen(picture: Bytes) -> Bytes:
    c = picture / 255
    light = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ np.array(_P3).T
    c = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.floor(255 * np.clip(c, 0, 1) + 0.5).astype(np.uint8)


PICTURE: dict[str, Callable[[Bytes], Bytes]] = {
    "upside-down": lambda p: p[::-1],
    "mirrored": lambda p: p[:, ::-1],
    "swapped-channels": lambda p: p[..., ::-1],
    "grey": lambda p: np.repeat((p @ (0.299, 0.587, 0.114))[..., None], 3, axis=2).astype(np.uint8),
    "black": np.zeros_like,
    "colour-profile": _on_another_screen,
    "one-colour": lambda p: np.full_like(p, 128),
    "inverted": lambda p: 255 - p,
    "cut-off": lambda p: np.where(np.arange(len(p))[:, None, None] < 0.6 * len(p), p, 0).astype(np.uint8),
    "border": lambda p: np.pad(p[2:-2, 2:-2], ((2, 2), (2, 2), (0, 0)), constant_values=200),
    "shifted": lambda p: np.roll(p, 3, axis=1),
}
PAIRS = (
    ("no-shadows", "specular-tinted"), ("full-field-of-view", "no-highlights"), ("gamma", "no-shadows"),
    ("upside-down", "blinn"), ("light-reversed", "pixel-corner"), ("texture-flipped", "no-ambient"),
    ("no-mirrors", "no-shadows"), ("refraction-inverted", "gamma"), ("transform-order", "no-highlights"),
    ("mirrored", "no-refraction"), ("ambient-per-light", "blinn"), ("half-texel", "no-shadows"),
    ("no-facing-gate", "mirror-depth"), ("swapped-channels", "no-shadows"), ("normal-transform", "no-shadows"),
    ("shadow-beyond-light", "ambient-per-light"),
)  # fmt: skip

ROOT = Path(__file__).parent.parent
MAKERS = {"tutorial": (ROOT / "scenes/tutorial.py", TUTORIAL), "vector": (ROOT / "tests/vector_tracer.py", VECTOR)}


@cache
def tracer(path: Path, texts: Texts) -> types.ModuleType:
    """A tracer with some of its texts replaced, each of which must be there."""
    source = path.read_text("utf-8")
    for old, new in texts:
        assert source.count(old) == 1, f"{path.name}: {source.count(old)} times {old}"
        source = source.replace(old, new)
    made = types.ModuleType(f"wrong_{path.stem}")
    sys.modules[made.__name__] = made  # which dataclasses ask for
    exec(compile(source, str(path), "exec"), made.__dict__)
    made.MEETS = source.partition("class Light:")[0] + source.partition("def closest_hit")[2].partition("\n\n\n")[0]
    return made


def main(name: str, path: str, mine: str, size: str | None = None) -> None:
    scene = cltrace.load(path)
    scene = scene.seen_by(replace(scene.camera, resolution=picture_size(size) if size else scene.camera.resolution))
    tracer(MAKERS["tutorial"][0], TUTORIAL[name]).render(scene).save(mine)


if __name__ == "__main__":
    main(*sys.argv[1:])
