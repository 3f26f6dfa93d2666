"""The tutorial's tracer in doubles, for many pixels at once, by rules of which each may be wrong.

It is what a student would write, not what decides: directions of length 1, the world's axes, an epsilon. Pixels on
whose rays rounding decides may come out otherwise than in the right picture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.comparison.rules import RIGHT, Rules
from cltrace.comparison.shapes import Floats, Ints, Points, Rays, Shapes, dot, unit
from cltrace.scene import AMBIENT, PARALLEL, SPOT, AnyCamera, Camera, Scene

# Rays that count for less show nothing: half a level at most.
_FAINT = 2.0**-13


@dataclass(frozen=True)
class _View:
    """Rays as they come to what they meet. directions: (n, 3); depth: how many bounces lie behind them."""

    directions: Floats
    depth: int


class Tracer:
    """Traces pixels of a scene by any rules. What several rules have in common is worked out once."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.background = np.array(scene.background)
        self.lights = scene.lights[scene.lights["kind"] != AMBIENT]
        self.ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)
        self.textures = [texture / np.iinfo(texture.dtype).max for texture in scene.textures]
        self._shapes: dict[tuple[str, str, bool], Shapes] = {}
        used = scene.materials
        self.bounces = bool((used["reflectance"] > 0).any() or (used["transmittance"] > 0).any())

    def shapes(self, rules: Rules) -> Shapes:
        key = rules.transforms, rules.normals, rules.flat_normals
        if key not in self._shapes:
            self._shapes[key] = Shapes(self.scene, rules)
        return self._shapes[key]

    def colors(self, pixels: Ints, rules: Rules = RIGHT) -> Floats:
        """(n, 3): the linear colours of pixels (n, 2), column and row, of which row 0 is the top; not clamped."""
        origins, directions = camera_rays(self.scene.camera, pixels, rules)
        rays = Rays(origins, directions, np.full(len(directions), -1))
        return self._trace(rays, np.ones(len(rays)), 0, rules)

    def _trace(self, rays: Rays, weights: Floats, depth: int, rules: Rules) -> Floats:
        """The tutorial's trace(): what rays see, (n, 3). weights: (n,), how much of that counts in the picture."""
        shapes, colors = self.shapes(rules), np.tile(self.background, (len(rays), 1))
        near = rules.epsilon if depth and not rules.spared and rules.measured != "normal" else 0.0
        t, parts = shapes.nearest(rays, near)
        hit = np.flatnonzero(parts >= 0)
        if not len(hit):
            return colors
        seen, weights = rays.at(hit), weights[hit]
        at = shapes.points(seen, t[hit], parts[hit])
        material = self.scene.materials[at.materials]
        last = depth > self.scene.camera.max_bounces + rules.more_bounces
        share = np.maximum(0.0, 1 - material["reflectance"] - material["transmittance"])
        if last:
            share = {"local": np.ones(len(hit)), "weighted": share, "black": np.zeros(len(hit))}[rules.last]
        sums, lit = np.zeros((len(hit), 3)), np.flatnonzero(share > 0)
        if len(lit):
            local = np.maximum(self._local(_rows(at, lit), _View(seen.directions[lit], depth), rules), 0.0)
            sums[lit] = share[lit, None] * (np.minimum(local, 1) if rules.clamped in ("local", "both") else local)
        if not last:
            for further, rows, part in self._bounces(seen, at, weights, rules):
                np.add.at(sums, rows, part[:, None] * self._trace(further, weights[rows] * part, depth + 1, rules))
        colors[hit] = np.minimum(sums, 1) if rules.clamped in ("traced", "both") else sums
        return colors

    # Light

    def _local(self, at: Points, view: _View, rules: Rules) -> Floats:
        """Phong's formula for all lights together, (n, 3)."""
        material, color = self.scene.materials[at.materials], self._surface_color(at, rules)
        normal = at.outward
        if rules.turned_for_light:
            normal = np.where(at.inside[:, None], -normal, normal)
        ambient = material["ka"][:, None] * self.ambient
        matte, shine, times = np.zeros_like(ambient), np.zeros_like(ambient), np.zeros(len(ambient))
        reaching = -1 if rules.reaching is None else rules.reaching[min(view.depth, 1)]
        for k, light in enumerate(self.lights):
            if not reaching >> k & 1:
                continue
            diffuse, highlight, counted = self._illuminate(at, view, normal, material, light, rules)
            power = np.minimum(light["color"], 1) if rules.clamped == "lights" else light["color"]
            matte += power * diffuse[:, None]
            shine += power * highlight[:, None]
            times += counted
        if rules.ambient != "once":
            ambient *= (times + (rules.ambient == "one more"))[:, None]
        light = np.minimum(ambient + matte, 1) if rules.clamped == "light" else ambient + matte
        return np.asarray(light * color + shine * (color if rules.tinted else 1.0))

    def _illuminate(
        self, at: Points, view: _View, normal: Floats, material: NDArray[np.void], light: np.void, rules: Rules
    ) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Of one light: kd (n.l) and ks (r.v)^exponent, times its strength, where nothing stands between.

        And whether ambient light is counted for it.
        """
        l, strength, w = to_light(light, at.places, rules)  # noqa: E741
        n_l, v = dot(normal, l), -view.directions
        faces = n_l > 0
        lit = {"lit": faces}.get(rules.facing, np.ones(len(l), np.bool_))
        wanted = np.flatnonzero((lit & (strength > 0)) | (rules.ambient in ("reaching", "facing", "shining")))
        reached = np.ones(len(l), np.bool_)
        if rules.shadows and len(wanted):
            reached[wanted] = ~self._shadowed(_rows(at, wanted), normal[wanted], w[wanted], light, rules)
        cosine = {"negative": n_l, "both": np.abs(n_l)}.get(rules.facing, np.maximum(0.0, n_l))
        r_v = dot(normal, unit(l + v)) if rules.halfway else dot(normal * (2 * n_l)[:, None] - l, v)
        with np.errstate(over="ignore"):
            lobe = np.clip(r_v, 0.0, 1.0) ** (material["exponent"] * (rules.halfway or 1.0))
        share = np.where(lit & reached, strength, 0.0)
        every = np.ones(len(l), np.bool_)
        facing, shining = faces if rules.ambient in ("facing", "lit") else every, strength > 0
        counted = reached & facing & (shining if rules.ambient in ("shining", "lit") else every)
        counted = every if rules.ambient in ("each", "one more") else counted
        return share * material["kd"] * cosine, share * material["ks"] * lobe, counted

    def _shadowed(self, at: Points, normal: Floats, w: Floats, light: np.void, rules: Rules) -> NDArray[np.bool_]:
        """(n,): whether anything stands on the way w to the light, which for a parallel light has no end."""
        distance = np.sqrt(dot(w, w))
        origins, parts = at.places, at.parts
        least = np.full(len(w), rules.epsilon)
        if rules.epsilon and rules.measured == "light":
            least = rules.epsilon * distance
        elif rules.epsilon and rules.measured == "normal":
            origins, parts, least = origins + rules.epsilon * normal, np.full_like(parts, -1), np.zeros(len(w))
        endless = light["kind"] == PARALLEL or rules.past_lights
        most = np.full(len(w), np.inf) if endless else distance
        direction = w / np.where(distance > 0, distance, 1.0)[:, None]
        if is_reversed(light, rules, "shadows") != is_reversed(light, rules, "shading"):
            direction = -direction
        return self.shapes(rules).stopped(Rays(origins, direction, parts), least, most, rules.own_shadow)

    def _surface_color(self, at: Points, rules: Rules) -> Floats:
        """The colour of the material, (n, 3), times its texture's."""
        material = self.scene.materials[at.materials]
        color = material["color"].copy()
        for k, texels in enumerate(self.textures):
            rows = np.flatnonzero(material["texture"] == k)
            if len(rows):
                color[rows] *= looked_up(texels, at.uv[rows], rules)
        return color

    # Mirrors and glass

    def _bounces(self, rays: Rays, at: Points, weights: Floats, rules: Rules) -> list[tuple[Rays, Ints, Floats]]:
        """The rays that go on from points, together: which of them each comes from, and how much of it that sees."""
        material, d, n = self.scene.materials[at.materials], rays.directions, at.outward
        inside = at.inside if rules.turned_for_rays else np.zeros(len(d), np.bool_)
        facing = np.where(inside[:, None], -n, n)
        mirror, clear = material["reflectance"].copy(), material["transmittance"]
        index = np.where(clear > 0, material["index"], 1.0)
        leaves = {"right": at.inside, "inverted": ~at.inside}.get(rules.media, np.zeros(len(d), np.bool_))
        through, total = refracted(d, facing, np.where(leaves, index, 1 / index))
        mirror[total] += clear[total]
        reflected = d - 2 * dot(d, n)[:, None] * n
        directions, rows, parts = [], [], []
        for further, share in ((reflected, mirror), (through, np.where(total, 0.0, clear))):
            on = np.flatnonzero(weights * share > _FAINT)
            directions.append(unit(further[on]))
            rows.append(on)
            parts.append(share[on])
        on = np.concatenate(rows)
        if not len(on):
            return []
        direction, origins, start = np.concatenate(directions), at.places[on], at.parts[on]
        if rules.epsilon and rules.measured == "normal" and not rules.spared:
            side = np.sign(dot(direction, facing[on]))
            origins, start = origins + (rules.epsilon * side)[:, None] * facing[on], np.full_like(start, -1)
        return [(Rays(origins, direction, start), on, np.concatenate(parts))]


def _rows(at: Points, rows: Ints) -> Points:
    return Points(*(array[rows] for array in vars(at).values()))


def camera_rays(camera: AnyCamera, pixels: Ints, rules: Rules) -> tuple[Floats, Floats]:
    """Origins and directions of length 1 in the world, (n, 3) each, of the rays of pixels (n, 2)."""
    width, height = camera.resolution
    column = width - 1 - pixels[:, 0] if rules.mirrored else pixels[:, 0]
    row = pixels[:, 1] if rules.upside_down else height - 1 - pixels[:, 1]  # from the bottom, as y
    half_width, half_height = image_plane(camera, rules)
    x = across(column, width, rules.sample[0], rules.columns) * half_width
    y = across(row, height, rules.sample[1], rules.columns) * half_height
    right, up, back = (np.array(axis) for axis in camera.basis())
    place, eye = x[:, None] * right + y[:, None] * up, np.array(camera.position)
    if camera.parallel:
        return eye + place, np.broadcast_to(-back, place.shape)
    return np.broadcast_to(eye, place.shape), unit(place - back)


def across(number: Ints, count: int, sample: float, columns: str) -> Floats:
    """Where on the image plane, from -1 to 1, pixels are, of which `count` are beside each other."""
    if columns == "zero":  # number / count in whole numbers
        return np.full(len(number), -1.0)
    if columns == "halves":  # 2 number / count - 1 in whole numbers
        return (2 * number // count - 1).astype(np.float64)
    share = number / max(count - 1, 1) if columns == "ends" else (number + sample) / count
    return np.asarray(2 * share - 1, np.float64)


def image_plane(camera: AnyCamera, rules: Rules) -> tuple[float, float]:
    """Half of the width and of the height of the image plane, at distance 1, or of an orthographic camera's picture."""
    if not isinstance(camera, Camera):
        return camera.image_plane()
    width, height = camera.resolution
    angle, short, long = camera.horizontal_fov, min(width, height), max(width, height)
    aspect: str = rules.aspect
    if aspect == "own":
        aspect = "tangent" if camera.square_pixels else "angle"
    if aspect in ("angle", "zero", "whole"):
        other = angle * {"angle": short / long, "zero": short // long, "whole": 1 / (long // short)}[aspect]
        wide, high = (angle, other) if width >= height else (other, angle)
        return _tan(wide * rules.opening[0]), _tan(high * rules.opening[1])
    across, upright = (_tan(angle * opening) for opening in rules.opening)
    if aspect == "none":
        return across, upright
    if aspect == "horizontal" or (aspect == "tangent" and width >= height):
        return across, upright * height / width
    return across * width / height, upright


def _tan(degrees: float) -> float:
    return math.tan(math.radians(degrees))


def to_light(light: np.void, places: Floats, rules: Rules) -> tuple[Floats, Floats, Floats]:
    """Of points (n, 3): the unit vector to the light, how strong it is there, and the whole way to it."""
    if light["kind"] == PARALLEL:
        w = np.broadcast_to(-light["direction"], places.shape)
        w = -w if is_reversed(light, rules, "shading") else w
        return unit(w), np.ones(len(w)), w
    w = light["position"] - places
    l = unit(w)  # noqa: E741
    strength = np.ones(len(w))
    if light["kind"] == SPOT:
        axis = unit(light["direction"][None])[0] * (-1 if "a" in rules.reversed else 1)
        angle = np.degrees(np.arctan2(np.sqrt(np.square(np.cross(axis, l)).sum(axis=1)), -(l @ axis)))
        alpha1, alpha2 = light["alpha1"], light["alpha2"]
        ramp = (alpha2 - angle) / (alpha2 - alpha1) if alpha2 > alpha1 else angle <= alpha2
        strength = np.clip(np.where(angle <= alpha1, 1.0, ramp), 0.0, 1.0)
    return (-l, strength, -w) if is_reversed(light, rules, "shading") else (l, strength, w)


def is_reversed(light: np.void, rules: Rules, use: str) -> bool:
    """Whether the vector to a light is, for shading or for shadows."""
    return ("p" if light["kind"] == PARALLEL else "o") in rules.reversed and rules.reversed_for in (use, "both")


def looked_up(texels: Floats, uv: Floats, rules: Rules) -> Floats:
    """The colours of a texture (h, w, 3) at (n, 2), mixed of four texels each."""
    height, width = texels.shape[:2]
    u, v = uv[:, 0], uv[:, 1]
    u, v = 1 - u if rules.turned_u else u, 1 - v if rules.turned_v else v
    x, y = ((a - np.floor(a)) * size + rules.texels_off for a, size in ((u, width), (v, height)))
    i, j = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    texels = np.floor(texels) if "whole" in rules.texture else texels
    upper_left = texels[j % height, i % width]
    if "nearest" in rules.texture:
        return np.asarray(upper_left)
    s, t = (x - i)[:, None], (y - j)[:, None]
    upper = upper_left * (1 - s) + texels[j % height, (i + 1) % width] * s
    lower = texels[(j + 1) % height, i % width] * (1 - s) + texels[(j + 1) % height, (i + 1) % width] * s
    return np.asarray(upper * (1 - t) + lower * t)


def refracted(d: Floats, normal: Floats, eta: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Snell's law for unit vectors d and normals against them, and where there is total reflection, (n,)."""
    c = -dot(d, normal)
    k = 1 - eta * eta * (1 - c * c)
    bent = eta[:, None] * d + (eta * c - np.sqrt(np.maximum(k, 0)))[:, None] * normal
    return np.where((eta == 1)[:, None], d, bent), k < 0


def to_bytes(colors: Floats, rules: Rules = RIGHT) -> NDArray[np.int64]:
    """(..., 3): the levels of linear colours, 0..255."""
    c = np.clip(colors, 0.0, 1.0)
    if rules.gamma == 0:
        c = np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)
    elif rules.gamma != 1:
        c = c ** (1 / rules.gamma)
    levels = {"nearest": c * 255 + 0.5, "down": c * 255, "256": c * 255.999, "whole": np.floor(c) * 255}[rules.rounding]
    return np.asarray(np.floor(levels), np.int64)
