"""The tutorial's tracer in doubles, for many pixels at once, by rules of which each may be wrong.

It is what a student would write, not what decides: directions of length 1, the world's axes, an epsilon. Pixels on
whose rays rounding decides may come out otherwise than in the right picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.scene import AMBIENT, FULL, LAMBERT, PARALLEL, SPOT, AnyCamera, Camera, Scene, lamps_of
from cltrace.scene.colors import decoded, encoded
from cltrace.students.rules import (
    RIGHT,
    BounceRules,
    CameraRules,
    LightRules,
    PictureRules,
    Rules,
    SurfaceRules,
    TextureRules,
)
from cltrace.students.shapes import Bits, Floats, Ints, Points, Rays, Shapes, cross, dot, unit

# Rays that count for less show nothing: half a level at most.
_FAINT = 2.0**-13
_BRIGHT = 2.0**40  # times 255 is still a whole number of 64 bits
_AT_ONCE = 2**16  # points times lamps
_MUCH = 1e30  # what a highlight may grow to by a mistake, so that 0 times it is 0


class Tracer:
    """Traces pixels of a scene by any rules. What several rules have in common is worked out once."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.background = np.array(scene.background)
        self.lights = scene.lights[scene.lights["kind"] != AMBIENT]
        self.lamps, self.light_of = lamps_of(self.lights)
        self.ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)
        self.textures = [texture / FULL[texture.dtype] for texture in scene.textures]
        # Colours of meshes come as signed textures, or as strips of one row, and no other shape has these.
        others = [scene.materials["texture"][shape["material"]] for shape in (scene.spheres, scene.cylinders)]
        self.colors_of_meshes = [
            texture.dtype == np.int16 or (len(texture) == 1 and k not in np.concatenate(others))
            for k, texture in enumerate(scene.textures)
        ]
        self._shapes: dict[SurfaceRules, Shapes] = {}
        self.rays = 0  # that were traced, with those to lamps
        used = scene.materials
        self.bounces = bool((used["reflectance"] > 0).any() or (used["transmittance"] > 0).any())

    def shapes(self, rules: SurfaceRules) -> Shapes:
        if rules not in self._shapes:
            self._shapes[rules] = Shapes(self.scene, rules)
        return self._shapes[rules]

    def colors(self, pixels: Ints, rules: Rules = RIGHT) -> Floats:
        """(n, 3): the linear colours of pixels (n, 2), column and row, of which row 0 is the top; not clamped."""
        return np.asarray(self.through(pixels, [rules.camera], rules)[0])

    def through(self, pixels: Ints, cameras: Sequence[CameraRules], rules: Rules) -> Floats:
        """(k, n, 3): the same by the rules of k cameras, with all else by those of `rules`; together they take less."""
        seen = [camera_rays(self.scene.camera, pixels, camera) for camera in cameras]
        origins, directions, lengths = (np.concatenate(arrays) for arrays in zip(*seen, strict=True))
        rays = Rays(origins, directions, np.full(len(directions), -1), lengths)
        # Some mistakes divide by 0, as the programs do that make them.
        found = np.nan_to_num(self._trace(rays, np.ones(len(rays)), 0, rules), nan=0.0, posinf=_MUCH, neginf=-_MUCH)
        return found.reshape(len(cameras), len(pixels), 3)

    def _trace(self, rays: Rays, weights: Floats, depth: int, rules: Rules) -> Floats:
        """The tutorial's trace(): what rays see, (n, 3). weights: (n,), how much of that counts in the picture."""
        shapes, seen_far = self.shapes(rules.surfaces), rules.bounces.far_background or depth == 0
        colors = np.tile(self.background * seen_far, (len(rays), 1))
        near = rules.lights.epsilon_of_bounces if depth and rules.lights.measured != "normal" else 0.0
        hit, at = shapes.seen(rays, near)
        self.rays += len(rays) + len(hit) * len(self.lamps)
        if at is None:
            return colors
        seen, weights = rays.at(hit), weights[hit]
        most = self.scene.camera.max_bounces if rules.bounces.deepest is None else rules.bounces.deepest
        last = depth > most + rules.bounces.more_bounces
        mirror, clear = self._shares(at, rules.bounces)
        taken = {"right": mirror + clear, "whole": 0 * mirror, "but r": clear, "but t": mirror}[rules.bounces.own_share]
        share = np.maximum(0.0, 1 - taken)
        if last:
            share = {"local": np.ones(len(hit)), "weighted": share, "black": np.zeros(len(hit))}[rules.bounces.last]
        sums, lit = np.zeros((len(hit), 3)), np.flatnonzero(share > 0)
        if len(lit):
            local = np.maximum(self._local(_rows(at, lit), seen.at(lit), depth, rules), 0.0)
            sums[lit] = share[lit, None] * (np.minimum(local, 1) if rules.phong.clamped in ("local", "both") else local)
        if not last:
            further, rows, part = self._bounces(seen, at, weights, rules)
            np.add.at(sums, rows, part[:, None] * self._trace(further, weights[rows] * part, depth + 1, rules))
        colors[hit] = np.minimum(sums, 1) if rules.phong.clamped in ("traced", "both") else sums
        return colors

    def _shares(self, at: Points, rules: BounceRules) -> tuple[Floats, Floats]:
        """r and t as they count."""
        material = self.scene.materials[at.materials]
        r, t = material["reflectance"], material["transmittance"]
        return r * (rules.mirrors != "none"), t * (rules.clear != "none")

    # Light

    def _local(self, at: Points, rays: Rays, depth: int, rules: Rules) -> Floats:
        """Phong's formula for all lights together, (n, 3), of points that rays see after so many bounces."""
        material, color = self.scene.materials[at.materials], self._surface_color(at, rules)
        normal = at.outward
        normal = np.where(self._turned(at, rules.phong.turned_for_light, rules)[:, None], -normal, normal)
        ka = material["ka"]
        ka = {"right": ka, "none": 0 * ka, "one": 0 * ka + 1, "twice": ka * ka, "bare": 0 * ka, "double": 2 * ka}[
            rules.phong.ka
        ]
        ambient = ka[:, None] * self.ambient
        matte, shine = np.zeros_like(ambient), np.zeros_like(ambient)
        reached = np.zeros((len(self.lights), len(ambient)), np.bool_)
        reaching = -1 if rules.lights.reaching is None else rules.lights.reaching[min(depth, 1)]
        on = np.array([reaching >> k & 1 for k in self.light_of.tolist()], np.bool_)
        lamps, light_of, most = self.lamps[on], self.light_of[on], max(_AT_ONCE // len(ambient), 1)
        for first in range(0, len(lamps), most):
            some = lamps[first : first + most]
            diffuse, highlight, counted = self._illuminate(at, rays, normal, lamps=some, rules=rules)
            power = np.minimum(some["color"], 1) if rules.phong.clamped == "lights" else some["color"]
            matte += np.einsum("kn,kc->nc", diffuse, power)
            shine += np.einsum("kn,kc->nc", highlight, power)
            if rules.phong.ambient != "once":
                np.logical_or.at(reached, light_of[first : first + most], counted)
        if rules.phong.ambient != "once":
            ambient *= (reached.sum(axis=0) + (rules.phong.ambient == "one more"))[:, None]
        light = np.minimum(ambient + matte, 1) if rules.phong.clamped == "light" else ambient + matte
        bare = material["ka"][:, None] * self.ambient * (rules.phong.ka == "bare")
        return np.asarray(light * color + bare + shine * (color if rules.phong.tinted else 1.0))

    def _turned(self, at: Points, turns: bool, rules: Rules) -> Bits:
        """(n,): whether the normals of points are turned against rays that come from inside."""
        return at.inside & (turns | (rules.surfaces.turned_meshes & (at.parts >= len(self.scene.spheres))))

    def _illuminate(
        self, at: Points, rays: Rays, normal: Floats, lamps: NDArray[np.void], rules: Rules
    ) -> tuple[Floats, Floats, Bits]:
        """Of k lamps at n points, (k, n): kd (n.l) and ks (r.v)^exponent, times their strength, if nothing is between.

        And whether ambient light is counted for them.
        """
        phong, material = rules.phong, self.scene.materials[at.materials]
        l, strength, w = to_lights(lamps, at.places, rules.lights)  # noqa: E741
        n_l = np.abs(dot(normal, l)) if phong.facing == "absolute" else dot(normal, l)
        v = -rays.directions * rays.lengths[:, None]
        faces, every = n_l > 0, np.ones(n_l.shape, np.bool_)
        lit = faces if phong.facing == "lit" else every
        reached = every.copy()
        if rules.lights.shadows:
            asked = (lit & (strength > 0)) | (phong.ambient in ("reaching", "facing", "shining"))
            k, i = np.nonzero(asked)
            reached[k, i] = ~self._shadowed(_rows(at, i), normal[i], w=w[k, i], kinds=lamps["kind"][k], rules=rules)
        cosine = {"negative": n_l, "both": np.abs(n_l)}.get(phong.facing, np.maximum(0.0, n_l))
        r_v = dot(normal, unit(l + v)) if phong.halfway else dot(normal * (2 * n_l)[..., None] - l, v)
        r_v = -r_v if phong.highlight == "reversed" else r_v
        with np.errstate(over="ignore"):
            lobe = np.minimum(np.maximum(r_v, 0.0) ** (material["exponent"] * (phong.halfway or 1.0)), _MUCH)
        lobe = lobe * (n_l if phong.highlight == "cosine" else phong.ks == "right")
        share = np.where(lit & reached, strength, 0.0)
        counted = reached & (faces if phong.ambient in ("facing", "lit") else every)
        counted &= (strength > 0) if phong.ambient in ("shining", "lit") else every
        counted = every if phong.ambient in ("each", "one more") else counted
        return share * material["kd"] * cosine * (phong.kd == "right"), share * material["ks"] * lobe, counted

    def _shadowed(self, at: Points, normal: Floats, w: Floats, kinds: Ints, rules: Rules) -> Bits:
        """(n,): whether anything stands on the way w to a lamp of this kind; that to a parallel light has no end."""
        distance = np.sqrt(dot(w, w))
        origins, parts = at.places, at.parts
        rule = rules.lights
        least = np.full(len(w), rule.epsilon)
        if rule.epsilon and rule.measured == "light":
            least = rule.epsilon * distance
        elif rule.epsilon and rule.measured == "normal":
            origins, parts, least = origins + rule.epsilon * normal, np.full_like(parts, -1), np.zeros(len(w))
        most = np.where((kinds == PARALLEL) | rule.past_lights, np.inf, distance)
        turn = turns(kinds, rule, "shadows") * turns(kinds, rule, "shading")
        direction = w * (turn / np.where(distance > 0, distance, 1.0))[:, None]
        rays = Rays(origins, direction, parts, np.ones(len(parts)))
        return self.shapes(rules.surfaces).stopped(rays, least, most, rule.own_shadow)

    def _surface_color(self, at: Points, rules: Rules) -> Floats:
        """The colour of the material, (n, 3), times its texture's."""
        material, rule = self.scene.materials[at.materials], rules.textures
        color = material["color"].copy()
        for k, texels in enumerate(self.textures):
            rows = np.flatnonzero(material["texture"] == k)
            if len(rows) and self.colors_of_meshes[k]:
                color[rows] *= self._mesh_colors(texels, _rows(at, rows), rules)
            elif len(rows) and rule.texture in ("white", "black"):
                color[rows] = rule.texture == "white"
            elif len(rows):
                color[rows] *= looked_up(texels, at.uv[rows], rule)
        return color

    def _mesh_colors(self, texels: Floats, at: Points, rules: Rules) -> Any:
        """The colours of meshes' vertices and faces, of which the triangles' corners have the places in a texture."""
        how = rules.textures.mesh_colors
        if how == "none":
            return 1.0
        uv = at.uv
        if how != "right":
            corners = self.shapes(rules.surfaces).corner_uv[at.parts - len(self.scene.spheres)]
            uv = corners[:, 0] if how == "first" else corners.mean(axis=1)
        return looked_up(texels, uv, RIGHT.textures)

    # Mirrors and glass

    def _bounces(self, rays: Rays, at: Points, weights: Floats, rules: Rules) -> tuple[Rays, Ints, Floats]:
        """The rays that go on from points, together: which of them each comes from, and how much of it that sees."""
        d, n = rays.directions * rays.lengths[:, None], at.outward
        inside = self._turned(at, rules.bounces.turned_for_rays, rules)
        facing = np.where(inside[:, None], -n, n)
        through, mirror, clear = self._through(d, facing, at, rules.bounces)
        reflected = mirrored(d, n, rules.bounces)
        directions, rows, parts, lengths = [], [], [], []
        for further, share in (
            (reflected, counted(mirror, rules.bounces.mirrors)),
            (through, counted(clear, rules.bounces.clear)),
        ):
            on = np.flatnonzero(weights * share > _FAINT)
            directions.append(unit(further[on]))
            # Only mistakes make others than unit vectors, and only mirrored ones: Snell's law ends with one.
            is_long = further is reflected and not rules.bounces.unit_mirrored
            lengths.append(np.sqrt(dot(further[on], further[on])) if is_long else np.ones(len(on)))
            rows.append(on)
            parts.append(share[on])
        on = np.concatenate(rows)
        direction, origins, start = np.concatenate(directions), at.places[on], at.parts[on]
        if rules.lights.epsilon_of_bounces and rules.lights.measured == "normal":
            side = np.sign(dot(direction, facing[on]))
            origins, start = origins + (rules.lights.epsilon * side)[:, None] * facing[on], np.full_like(start, -1)
        return Rays(origins, direction, start, np.concatenate(lengths)), on, np.concatenate(parts)

    def _through(self, d: Floats, facing: Floats, at: Points, rules: BounceRules) -> tuple[Floats, Floats, Floats]:
        """Where light goes in glass, and how much is mirrored and how much goes there, with Fresnel's share if so."""
        mirror, clear = self._shares(at, rules)
        index = np.where(clear > 0, self.scene.materials["index"][at.materials], 1.0)
        leaves = {"right": at.inside, "inverted": ~at.inside}.get(rules.media, np.zeros(len(d), np.bool_))
        eta = np.where(leaves, index, 1 / index) if rules.media != "none" else np.ones(len(d))
        through, total = refracted(d, facing, eta)
        if rules.fresnel:
            part = reflectance_of(-dot(d, facing), eta, index, "exact" in rules.fresnel)
            all_of = mirror + clear if "both" in rules.fresnel else clear
            glass = (clear > 0) & ~total
            mirror = np.where(glass, all_of * part + (0 if "both" in rules.fresnel else mirror), mirror)
            clear = np.where(glass, all_of * (1 - part), clear)
        if rules.total == "straight":
            return np.where(total[:, None], d, through), mirror, clear
        mirror = np.where(total & (rules.total == "right"), mirror + clear, mirror)
        return through, mirror, np.where(total, 0.0, clear)


def counted(share: Floats, how: str) -> Floats:
    """What of r or t is made where the ray that goes on is added, (n,)."""
    return np.asarray({"dark": 0 * share, "double": 2 * share, "squared": share * share}.get(how, share))


def mirrored(d: Floats, n: Floats, rules: BounceRules) -> Floats:
    """d - 2 (n.d) n, or what a mistake makes of it."""
    along = dot(d, n)[:, None] * n
    wrong = {"right": d - 2 * along, "reversed": 2 * along - d, "once": d - along, "sign": d + 2 * along, "back": -d}
    return np.asarray(wrong[rules.reflection])


def reflectance_of(cosine: Floats, eta: Floats, index: Floats, exact: bool) -> Floats:
    """Fresnel's share of what is mirrored, (n,), or Schlick's approximation."""
    if not exact:
        least = ((1 - index) / (1 + index)) ** 2
        return np.asarray(least + (1 - least) * np.clip(1 - cosine, 0, 1) ** 5)
    other = np.sqrt(np.maximum(1 - eta * eta * (1 - cosine * cosine), 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        across, along = (eta * cosine - other) / (eta * cosine + other), (cosine - eta * other) / (cosine + eta * other)
    return np.nan_to_num((across * across + along * along) / 2)


def _rows(at: Points, rows: Ints) -> Points:
    return Points(*(array[rows] for array in vars(at).values()))


def camera_rays(camera: AnyCamera, pixels: Ints, rules: CameraRules) -> tuple[Floats, Floats, Floats]:
    """Origins, directions of length 1 in the world, (n, 3) each, and lengths, (n,), of the rays of pixels (n, 2)."""
    width, height = camera.resolution
    pixels = pixels[:, ::-1] if rules.transposed else pixels
    column = width - 1 - pixels[:, 0] if rules.mirrored else pixels[:, 0]
    row = pixels[:, 1] if rules.upside_down else height - 1 - pixels[:, 1]  # from the bottom, as y
    half_width, half_height = image_plane(camera, rules)
    x = across(column, width, rules.sample[0], rules.columns) * half_width
    y = across(row, height, rules.sample[1], rules.columns) * half_height
    right, up, back = axes_of(camera, rules)
    place, eye = x[:, None] * right + y[:, None] * up, np.array(camera.position)
    if camera.parallel:
        return eye + place, np.broadcast_to(-back, place.shape), np.ones(len(place))
    d = place - back
    lengths = np.sqrt(dot(d, d)) if rules.long_rays else np.ones(len(d))
    return np.broadcast_to(eye, place.shape), unit(d), lengths


@lru_cache(64)
def axes_of(camera: AnyCamera, rules: CameraRules) -> tuple[Floats, Floats, Floats]:
    """The camera's x, y and z in the world."""
    x, y, z = (np.array(axis) for axis in camera.basis())
    up, view = np.array(camera.up), np.array(camera.position) - camera.lookat
    long_x = np.cross(up, z)
    if rules.axes == "transposed":
        x, y, z = np.array([x, y, z]).T
    return {
        "x": (long_x, y, z), "xy": (long_x, np.cross(z, long_x), z), "z": (x, y, view),
        "yz": (x, np.cross(view, x), view), "up": (x, up, z), "unit up": (x, up / np.linalg.norm(up), z),
        "backwards": (x, y, -z),
    }.get(rules.axes, (x, y, z))  # fmt: skip


def across(number: Ints, count: int, sample: float, columns: str) -> Floats:
    """Where on the image plane, from -1 to 1, pixels are, of which `count` are beside each other."""
    if columns == "zero":  # number / count in whole numbers
        return np.full(len(number), -1.0)
    if columns == "halves":  # 2 number / count - 1 in whole numbers
        return (2 * number // count - 1).astype(np.float64)
    share = number / max(count - 1, 1) if columns == "ends" else (number + sample) / count
    return np.asarray(2 * share - 1, np.float64)


def image_plane(camera: AnyCamera, rules: CameraRules) -> tuple[float, float]:
    """Half of the width and of the height of the image plane, at distance 1, or of an orthographic camera's picture."""
    if not isinstance(camera, Camera):
        return camera.image_plane()
    width, height = camera.resolution
    angle, short, long = camera.horizontal_fov, min(width, height), max(width, height)
    aspect: str = rules.aspect
    if aspect == "own":
        aspect = "tangent" if camera.square_pixels else "angle"
    if rules.radians:
        angle = math.degrees(angle)
    ratios = {"angle": short / long, "zero": short // long, "whole": 1 / (long // short), "inverted": long / short}
    if aspect in ratios or aspect == "wide":
        other = angle * ratios.get(aspect, height / width)
        wide, high = (angle, other) if width >= height or aspect == "wide" else (other, angle)
        return _tan(wide * rules.opening[0]), _tan(high * rules.opening[1])
    across, upright = (_tan(angle * opening) for opening in rules.opening)
    if aspect == "none":
        return across, upright
    if aspect == "horizontal" or (aspect == "tangent" and width >= height):
        return across, upright * height / width
    return across * width / height, upright


def _tan(degrees: float) -> float:
    return math.tan(math.radians(degrees))


def to_lights(lamps: NDArray[np.void], places: Floats, rules: LightRules) -> tuple[Floats, Floats, Floats]:
    """Of k lamps at points (n, 3): unit vectors to them (k, n, 3), how strong they are there, and the whole way."""
    kinds, axes = lamps["kind"], lamps["direction"]
    w = np.where((kinds == PARALLEL)[:, None, None], -axes[:, None], lamps["position"][:, None] - places)
    l = unit(w)  # noqa: E741
    strength = np.ones(w.shape[:2])
    for k in np.flatnonzero(kinds == SPOT) if rules.spot != "none" else ():
        strength[k] = cone(lamps[k], w[k] if "s" in rules.long_lights else l[k], rules)
    for k in np.flatnonzero(kinds == LAMBERT):
        strength[k] = np.maximum(0.0, -(l[k] @ unit(axes[k])))
    if rules.attenuation != "1":
        powers, square = {"1": 0.0, "D": 0.5, "D2": 1.0}, dot(w, w)
        fades = sum(square ** powers[term] for term in rules.attenuation.split("+"))
        strength = np.where((kinds == PARALLEL)[:, None], strength, strength / fades)
    long = np.where(kinds == PARALLEL, "p" in rules.long_lights, "o" in rules.long_lights)
    turn = turns(kinds, rules, "shading")[:, None, None]
    return turn * np.where(long[:, None, None], w, l), strength, turn * w


def cone(light: np.void, l: Floats, rules: LightRules) -> Floats:  # noqa: E741
    """How strong a spot light is along its rays to l, (n,)."""
    axis = unit(light["direction"]) * (-1 if "a" in rules.reversed else 1)
    if "s" in rules.long_lights:
        angle = np.degrees(np.arccos(np.clip(-(l @ axis), -1, 1)))
    else:
        angle = np.degrees(
            np.arctan2(np.sqrt(np.square(cross(np.broadcast_to(axis, l.shape), l)).sum(axis=1)), -(l @ axis))
        )
    size = {"half": 0.5, "double": 2.0}.get(rules.spot, 1.0)
    alpha1, alpha2 = light["alpha1"] * size, light["alpha2"] * size
    if rules.spot in ("inner", "outer"):
        return np.asarray(angle <= (alpha1 if rules.spot == "inner" else alpha2), np.float64)
    if rules.spot == "cosine":
        angle, alpha1, alpha2 = (-np.cos(np.radians(a)) for a in (angle, alpha1, alpha2))
    ramp = (alpha2 - angle) / (alpha2 - alpha1) if alpha2 > alpha1 else angle <= alpha2
    share = np.clip(np.where(angle <= alpha1, 1.0, ramp), 0.0, 1.0)
    return np.asarray(share * share * (3 - 2 * share) if rules.spot == "smooth" else share)


def turns(kinds: Ints, rules: LightRules, use: str) -> Floats:
    """-1 for lights of kinds (n,) to which the vector is reversed, for shading or for shadows, and 1 for others."""
    if not rules.reversed or rules.reversed_for not in (use, "both"):
        return np.ones(len(kinds))
    return np.where(np.where(kinds == PARALLEL, "p" in rules.reversed, "o" in rules.reversed), -1.0, 1.0)


def looked_up(texels: Floats, uv: Floats, rules: TextureRules) -> Floats:
    """The colours of a texture (h, w, 3) at (n, 2), mixed of four texels each."""
    height, width = texels.shape[:2]
    u, v = uv[:, ::-1].T if rules.swapped_uv else uv.T
    if rules.clamped_uv:
        u, v = (np.clip(a, 0, 1 - 1e-9) for a in (u, v))
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


def refracted(d: Floats, normal: Floats, eta: Floats) -> tuple[Floats, Bits]:
    """Snell's law for unit vectors d and normals against them, and where there is total reflection, (n,)."""
    c = -dot(d, normal)
    k = 1 - eta * eta * (1 - c * c)
    bent = eta[:, None] * d + (eta * c - np.sqrt(np.maximum(k, 0)))[:, None] * normal
    return np.where((eta == 1)[:, None], d, bent), k < 0


def to_bytes(colors: Floats, rules: PictureRules = RIGHT.picture) -> NDArray[np.int64]:
    """(..., 3): the levels of linear colours, 0..255."""
    c = np.clip(colors, 0.0, _BRIGHT if rules.rounding == "wrapped" else 1.0)[..., list(rules.channels)]
    if rules.grey:
        c = np.repeat((c @ np.array(rules.grey))[..., None], 3, axis=-1)
    c = 1 - c if rules.inverted else c
    if rules.gamma == 0:
        c = encoded(c, "srgb")
    elif rules.gamma != 1:
        c = c ** (1 / rules.gamma)
    if rules.profile:
        c = encoded(np.clip(decoded(c, "srgb") @ np.array(rules.profile).reshape(3, 3).T, 0, 1), "srgb")
    scale, offset = {"nearest": (255, 0.5), "wrapped": (255, 0.5), "256": (255.999, 0)}.get(rules.rounding, (255, 0))
    if rules.rounding in ("whole", "unscaled"):
        return np.asarray(np.floor(c) * (255 if rules.rounding == "whole" else 1), np.int64)
    levels = np.asarray(np.floor(c * scale + offset), np.int64)
    return levels % 256 if rules.rounding == "wrapped" else levels
