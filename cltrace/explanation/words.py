"""Prints what is known of a pixel: in the words and the order of the course's tutorial."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np

from cltrace.base.errors import printable
from cltrace.explanation.record import (
    Bounce,
    CameraRay,
    Facts,
    Hit,
    LightName,
    LightTerm,
    Met,
    Placement,
    SoftTerm,
    SurfaceName,
    SurfaceTest,
    TracedRay,
)
from cltrace.explanation.textbook import NORMALS, Triple, number, vector
from cltrace.reference import Surface, byte_of
from cltrace.scene import AMBIENT, BALL, LAMBERT, PANEL, PARALLEL, POINT, SKY, SPOT, SUN, Scene
from cltrace.scene.colors import encoded

LIGHT_NAMES = {
    AMBIENT: "ambient_light",
    PARALLEL: "parallel_light",
    POINT: "point_light",
    SPOT: "spot_light",
    LAMBERT: "lambert_light",
    SKY: "sky_light",
    SUN: "sun_light",
    BALL: "ball_light",
    PANEL: "panel_light",
}
FATES = {
    "lit": "reaches the point",
    "behind": "is behind the surface",
    "beside the cone": "does not shine this way",
    "in shadow": "does not reach the point",
    "at the point": "touches the point, and shines past it",
}
# The same of members of a soft light.
PLURALS = {
    "behind": "are behind the surface",
    "beside the cone": "do not shine this way",
    "in shadow": "are in shadow",
    "at the point": "touch the point, and shine past it",
}
FEW_BLOCKERS = 3  # surfaces that are listed of those between a point and a soft light
DEEPEST = 12  # bounces, after which rays are not indented further
LABEL = 44  # width of what is before the numbers of a sum


class Names:
    """What the surfaces, lights and textures of a scene are called."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.source = scene, scene.source

    def surface(self, surface: Surface) -> SurfaceName:
        number = surface.number
        line = int(self.source.surfaces[number]) if self.source else 0
        file = self.source.meshes.get(number) if self.source else None
        face_line = int(file.lines[surface.primitive]) if file and surface.primitive >= 0 else 0
        name = file.name if file else ""
        return SurfaceName(surface.kind, number, line, file=name, primitive=surface.primitive, face_line=face_line)

    def light(self, number: int) -> LightName:
        """number: among all lights of the scene."""
        line = int(self.source.lights[number]) if self.source else 0
        return LightName(LIGHT_NAMES[int(self.scene.lights[number]["kind"])], number, line)

    def texture(self, index: int) -> str:
        return self.source.textures[index] if self.source else ""


def surface(name: SurfaceName, whole: bool = False) -> str:
    """Such as "sphere 2 (line 45)". whole: of a mesh, not which of its triangles."""
    file = f" {printable(name.file)}" if name.file else ""
    start = f"{name.kind} {name.id}{_at(name.line) or file}"
    if whole or name.primitive < 0:
        return start
    face = f" (line {name.face_line} of {printable(name.file)})" if name.face_line else ""
    return f"{start}, triangle {name.primitive}{face}"


def light(name: LightName) -> str:
    """Such as "point_light 1 (line 12)"."""
    return f"{name.kind} {name.number}{_at(name.line)}"


def line(e: Facts) -> str:
    """What a pixel sees, which lights reach it, and its bytes."""
    ray, start = e.rays[0], f"pixel ({e.x}, {e.y})"
    if ray.hit is None:
        return f"{start} meets nothing: background_color, bytes {e.rgb8}"
    parts = [f"{start} meets {surface(ray.hit.surface)} at t = {number(ray.hit.t)}"]
    for term in ray.lights:
        name = f"{term.light.kind} {term.light.number}"
        if isinstance(term, SoftTerm):
            parts.append(f"of {name}, {_counts(term)}")
            continue
        hider = f": {surface(term.between[0].surface, whole=True)} is between" if term.between else ""
        parts.append(f"{name} {FATES[term.fate]}{hider}")
    parts += [f"{number(bounce.share)} of it is {bounce.kind}" for bounce in ray.bounces]
    return f"{'; '.join(parts)}; bytes {e.rgb8}"


def text(e: Facts) -> str:
    """All of it."""
    places = _places(e)
    lines = [f"pixel ({e.x}, {e.y}) of {e.width}x{e.height}" + (f", {printable(e.path)}" if e.path else ""), ""]
    lines += [*_camera(e.camera, e), "", *_ray(e, 0, places)]
    red, green, blue = (min(1.0, max(0.0, c)) for c in e.color)
    lines.append(_row("clamped to 0..1", (red, green, blue), places))
    if e.transfer != "linear":
        red, green, blue = encoded((red, green, blue), e.transfer).tolist()
        lines.append(_row("c, by the curve of sRGB", (red, green, blue), places))
    rule = "byte = trunc(255 c)" if e.truncate else "byte = trunc(255 c + 0.5)"
    lines.append(f"  {rule:<{LABEL}}" + "".join(f"{byte:>{places + 4}}" for byte in e.rgb8))
    return "\n".join(lines)


def _places(e: Facts) -> int:
    """How many decimal places of the terms it takes for their sum, as printed, to give the bytes."""
    for places in (6, 9, 12):
        sums = [math.fsum(float(f"{term.color[i]:.{places}f}") for term in e.rays[0].terms) for i in range(3)]
        shown = encoded(np.maximum(sums, 0), e.transfer).tolist()
        if tuple(byte_of(c, e.truncate) for c in shown) == e.rgb8:
            return places
    return 17


def _camera(c: CameraRay, e: Facts) -> Iterator[str]:
    """From the pixel to the ray, by the tutorial's formulas."""
    tan_x, tan_y = "tan(fov_x)", "tan(fov_y)"
    wide = e.width >= e.height
    given, other, share = ("fov_x", "fov_y", "height / width") if wide else ("fov_y", "fov_x", "width / height")
    angles = {"fov_x": c.fov_x, "fov_y": c.fov_y}
    rule = f"atan(tan({given}) * {share})" if c.square_pixels else f"{given} * {share}"
    yield f"Camera{_at(c.line)}"
    yield f"  u = {c.u}, the column from the left"
    yield f"  v = height - 1 - {e.y} = {c.v}, the row from the bottom, as the tutorial's formulas have y upwards"
    yield f"  x_n = (u + 0.5) / width = {number(c.x_n)}"
    yield f"  y_n = (v + 0.5) / height = {number(c.y_n)}"
    if c.height is None:
        yield f"  {given} = {number(angles[given])} degrees, half of the opening angle"
        yield f"  {other} = {rule} = {number(angles[other])} degrees"
        yield f"  x_i = (2 x_n - 1) * {tan_x} = {number(c.x_i)}"
        yield f"  y_i = (2 y_n - 1) * {tan_y} = {number(c.y_i)}"
        yield f"  d = (x_i, y_i, -1), normalized = {vector(c.direction)}, in camera space"
    else:
        yield f"  H = {number(c.height)}, the height of what the picture shows"
        yield f"  W = H * width / height = {number(c.height * e.width / e.height)}"
        yield f"  x_i = (2 x_n - 1) * W / 2 = {number(c.x_i)}"
        yield f"  y_i = (2 y_n - 1) * H / 2 = {number(c.y_i)}"
        yield "  all rays are parallel: (x_i, y_i, 0) is where this one starts, and d = (0, 0, -1), in camera space"
    yield "  the camera's axes in the world, normalized"
    for name, rule, axis in zip("xyz", ("up x z", "z x x", "position - lookat"), c.axes, strict=True):
        yield f"    {name} = {rule} = {vector(axis)}"


def _ray(e: Facts, place: int, places: int) -> Iterator[str]:
    """A ray, what it meets, and its colour, with the rays that go on from it before the sum."""
    ray = e.rays[place]
    yield "Ray" if place == 0 else f"Ray {place}, {ray.kind}: {number(ray.weight)} of the pixel"
    o, d = "", "x_i x + y_i y - z, normalized = "
    if e.camera.height is not None:
        o, d = "position + x_i x + y_i y = ", "-z = "
    if place > 0:
        o = d = ""
    yield f"  o = {o}{vector(ray.origin)}"
    yield f"  d = {d}{vector(ray.direction)}, in the world"
    yield ""
    yield from _meetings(ray, e.surfaces)
    yield ""
    if ray.hit is None:
        yield "Closest: nothing, so the ray sees background_color"
        yield ""
    else:
        yield from _hit(ray.hit)
        yield ""
        yield from _lights(ray)
    for bounce in ray.bounces:
        yield from _bounce(ray.hit, bounce)
        yield ""
        if bounce.ray is not None:
            indent = "    " if ray.depth < DEEPEST else ""
            yield from (indent + one if one else one for one in _ray(e, bounce.ray, places))
            yield ""
    if ray.last:
        yield f"max_bounces = {e.max_bounces} is reached: no ray goes on from here, and the local color counts in full"
        yield ""
    yield from _sum(ray, place, places)


def _meetings(ray: TracedRay, surfaces: int) -> Iterator[str]:
    more = f", of which these are the closest {len(ray.tests)}" if ray.meets > len(ray.tests) else ""
    met = "none" if not ray.meets else f"{ray.meets}{more}"
    yield f"Surfaces that it meets: {met}" + ("" if ray.meets else f" of {surfaces}")
    for test in ray.tests:
        yield from _test(test)
    if ray.missed:
        yield "Surfaces that it misses, and that pixels beside this one show"
    for test in ray.missed:
        yield from _test(test)


def _test(test: SurfaceTest) -> Iterator[str]:
    yield f"  {surface(test.surface)}"
    yield from test.textbook.lines()
    if test.remark:
        yield f"    {test.remark}"


def _hit(h: Hit) -> Iterator[str]:
    yield f"Closest: {surface(h.surface)}, {'from inside' if h.inside else 'from outside'}"
    yield f"  t = {number(h.t)}"
    yield f"  P = o + t d = {vector(h.point)}"
    if h.placement:
        yield from _placement(h.placement)
    turned = ", turned to the side of the ray," if h.turned else ""
    yield f"  n = {NORMALS[h.shape]}{turned} = {vector(h.normal)}"
    if h.texture:
        t = h.texture
        (u, v), (width, height) = t.uv, t.size
        yield f"  texture {printable(t.name) or 'of the material'}, {width}x{height}: u = {number(u)}, v = {number(v)}"
        yield f"    {_texels('u', 'width', 'column', first=t.x, share=t.right, count=width)}"
        yield f"    {_texels('v', 'height', 'row', first=t.y, share=t.down, count=height)}; row 0 is at the top"
        for texel in t.texels:
            yield f"    texel ({texel.x}, {texel.y}) = {vector(texel.color)}, weight {number(texel.weight)}"
        yield f"    texture color = sum of weight * texel = {vector(t.color)}"
    yield f"  color C = {vector(h.color)}"
    yield f"  phong ka = {number(h.ka)}, kd = {number(h.kd)}, ks = {number(h.ks)}, exponent = {number(h.exponent)}"
    if h.reflectance or h.transmittance:
        yield f"  reflectance r = {number(h.reflectance)}, transmittance t = {number(h.transmittance)}" + (
            f", refraction iof = {number(h.index)}" if h.transmittance else ""
        )


def _texels(name: str, side: str, line: str, first: int, share: float, count: int) -> str:
    """Which two columns or rows of a texture are mixed, of so many that repeat."""
    place, last = number(first + share), (first + 1) % count
    return f"({name} mod 1) * {side} = {place}: {line}s {first} and {last}, {number(share)} of the latter"


def _lights(ray: TracedRay) -> Iterator[str]:
    assert ray.hit is not None
    if not ray.share:
        yield "Light does not count here: 1 - r - t = 0"
        yield ""
        return
    for ambient in ray.ambient:
        yield f"{light(ambient.light)}, L = {vector(ambient.L)}"
        yield f"  ka L C = {vector(ambient.color)}"
        yield ""
    for term in ray.lights:
        yield from _soft(term) if isinstance(term, SoftTerm) else _light(term, ray.hit)
        yield ""


def _counts(term: SoftTerm) -> str:
    """Such as "12 of 64 members reach the point, 32 are behind the surface, 20 are in shadow"."""
    reach = term.fates.get("lit", 0)
    rest = "".join(f", {n} {PLURALS[fate]}" for fate, n in term.fates.items() if fate != "lit")
    return f"{reach} of {len(term.members)} members reach the point{rest}"


def _soft(term: SoftTerm) -> Iterator[str]:
    """A soft light: what all members do, and what they add together."""
    yield f"{light(term.light)}, L = {vector(term.L)} together: {_counts(term)}"
    between = [one.between[0] for one in term.members if one.between]
    for name, count in Counter(surface(met.surface) for met in between).most_common(FEW_BLOCKERS):
        yield f"  first between the point and {count} of them: {name}"
    if term.fate == "lit":
        yield f"  diffuse, the sum of F kd L C (n.l) = {vector(term.diffuse)}"
        yield f"  specular, the sum of F ks L max(0, r.v)^exponent = {vector(term.specular)}"


def _light(term: LightTerm, hit: Hit) -> Iterator[str]:
    yield f"{light(term.light)}, L = {vector(term.L)}: {FATES[term.fate]}"
    if term.fate == "at the point":
        return
    if math.isinf(term.distance):
        yield f"  l = -direction, normalized = {vector(term.l)}"
    else:
        yield f"  l = position - P, normalized = {vector(term.l)}, distance {number(term.distance)}"
    yield f"  n.l = {number(term.n_l)}" + (" <= 0: no light" if term.n_l <= 0 else "")
    if term.fate == "behind":
        if term.n_l > 0:
            yield "  l is on the other side of the flat surface: no light, whatever the interpolated n says"
        return
    if term.cone:
        yield from _cone(*term.cone, term.strength)
    yield from _way(term)
    if term.fate == "lit":
        F = "F " if term.cone else ""
        yield f"  r = 2 (n.l) n - l = {vector(term.r)}, v = -d, r.v = {number(term.r_v)}"
        yield f"  diffuse  {F}kd L C (n.l) = {vector(term.diffuse)}"
        yield f"  specular {F}ks L max(0, r.v)^{number(hit.exponent)} = {vector(term.specular)}"


def _cone(off: float, alpha1: float, alpha2: float, strength: float) -> Iterator[str]:
    """The spot light's formula, with its numbers."""
    yield f"  angle = acos(-l.direction) = {number(off)} degrees, alpha1 = {number(alpha1)}, alpha2 = {number(alpha2)}"
    if off <= alpha1:
        yield "  F = 1, as angle <= alpha1"
    elif off >= alpha2:
        yield "  F = 0, as angle >= alpha2"
    else:
        numbers = f"({number(alpha2)} - {number(off)}) / ({number(alpha2)} - {number(alpha1)})"
        yield f"  F = (alpha2 - angle) / (alpha2 - alpha1) = {numbers} = {number(strength)}"


def _placement(p: Placement) -> Iterator[str]:
    """A transform, and the ray in the object's space."""
    for name, rows in ("M = T1 T2 ... Tn, to the world", p.matrix), ("M^-1, to the object", p.inverse):
        yield f"  {name}:"
        yield from ("    " + "".join(f"{number(value):>14}" for value in row) for row in rows)
    yield f"  in the object's space o' = M^-1 o = {vector(p.origin)}"
    yield f"    d' = M^-1 d = {vector(p.direction)}, not normalized again, so that t is the same"


def _way(term: LightTerm) -> Iterator[str]:
    """The shadow ray, if there is one."""
    if term.fate == "lit":
        yield "  shadow ray: nothing is between"
        if term.behind:
            yield f"    behind the light, which does not count: {_met(term.behind)}"
    elif term.fate == "in shadow":
        before = "" if math.isinf(term.distance) else f" before the light at distance {number(term.distance)}"
        yield f"  shadow ray: something is between{before}"
        yield from (f"    {_met(met)}" for met in term.between)
        if term.blockers > len(term.between):
            yield f"    and {term.blockers - len(term.between)} more"


def _met(met: Met) -> str:
    where = f" at distance {number(met.distance)}, {vector(met.point)}" if met.point else ""
    return surface(met.surface) + where


def _bounce(hit: Hit | None, b: Bounce) -> Iterator[str]:
    assert hit is not None
    share = f"r = {number(b.share)}" if b.kind == "mirrored" else f"t = {number(b.share)}"
    if b.total:
        share = f"r + t = {number(b.share)}, as total reflection leaves no refracted ray"
    to = f"ray {b.ray}" if b.ray is not None else "too faint for any byte to show"
    yield f"{b.kind.capitalize()} ray, {share}: {to}"
    if b.kind == "mirrored":
        yield f"  d - 2 (d.n) n: {b.angle_in:.4g} degrees from n on both sides"
        if b.total:
            yield f"  sin(out) = {number(hit.index)} sin({b.angle_in:.4g}) = {_sine(hit.index, b.angle_in)} > 1"
    else:
        rule = f"sin(in) {'*' if hit.inside else '/'} {number(hit.index)}"
        side = "leaves" if hit.inside else "enters"
        yield f"  {side}, sin(out) = {rule}: {b.angle_in:.4g} degrees from n become {b.angle_out:.4g} from -n"
    if b.ray is None:
        rays = f", in {b.rays} rays" if b.rays > 1 else ""
        yield f"  sees {vector(b.color)}{rays}"


def _sine(index: float, degrees: float) -> str:
    return number(index * math.sin(math.radians(degrees)))


def _sum(ray: TracedRay, place: int, places: int) -> Iterator[str]:
    name = "Sum" if place == 0 else f"Sum of ray {place}"
    yield f"{name:<{LABEL + 2}}" + "".join(f"{channel:>{places + 4}}" for channel in ("red", "green", "blue"))
    if ray.bounces and ray.share:
        yield from (_row(term.label, term.color, places) for term in ray.local_terms)
        yield _row("= local color", ray.local, places)
    yield from (_row(term.label, term.color, places) for term in ray.terms)
    yield _row("= color", ray.color, places)


def _row(label: str, color: Triple, places: int) -> str:
    return f"  {label:<{LABEL}}" + "".join(f"  {c:>{places + 2}.{places}f}" for c in color)


def _at(line: int) -> str:
    return f" (line {line})" if line else ""
