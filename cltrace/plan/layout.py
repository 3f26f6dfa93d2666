"""Scene -> what the kernel reads: packed arrays in camera space, and the features that it must be compiled with.

The only module that knows bytes. The dtypes here and the structs in kernels/packet.cl must agree: the build fails if a
size differs, and a test compares every offset on each device.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.plan.culling import hidden, parallel_shadows, point_shadows, repeated
from cltrace.plan.exact import (
    Array,
    differences,
    dot_products,
    rotated,
    rounded_down,
    rounded_up,
    square_excess,
    squared_length,
    two_sum,
)
from cltrace.plan.lists import (
    FINE_SLACK,
    SLACK,
    Lists,
    build,
    camera_sheet,
    grid_dtype,
    parallel_sheet,
    point_sheets,
    spatial_order,
    whole_sheet,
)
from cltrace.scene import AMBIENT, PARALLEL, POINT, SPOT, Scene

PRECISIONS = ("accurate", "single", "double")
PICTURES = ("rgb8", "color", "normal", "direction", "depth", "id")
OUTPUTS = (*PICTURES, "shadow_rays", "work")
# What the output `work` counts, per pixel, by its last index: see COUNT in kernels/trace.cl.
WORK = (
    "shadow rays traced",
    "shadow rays to lights that shine on the other side or elsewhere",
    "shadow rays that no sphere can stop",
    "highlights computed",
    "highlights too faint for a pixel",
    "spheres that float32 rules out for a ray",
    "spheres that are decided in full for a ray",
    "rays through tiles of background only",
)

# Up to so many spheres, finding the right list for a shadow ray costs more than trying them all: 3.5 ms a frame against
# 3.2 for a box of 16 (PoCL 3.1, 1920x1080, like the next two), but 4.3 against 4.6 for a shell of 28.
FEW = 16

# From so many spheres on, they are sorted by place. A shell of 100,000 takes 27 ms a frame then, against 37; 10,000
# take 10 either way, as all that a picture needs stays in a cache.
MANY = 4096

# From so many on, the kernel fetches them ahead. A million take 0.85 of the time then, 300,000 take 0.93, 100,000 take
# 0.96; 30,000 take the same, and 1,000 would take 1.02.
PLENTY = 2**16

# Unit roundoff of float32: the filters' bounds, derived in kernels/trace.cl, are multiples of it.
U = 2.0**-24


def real_dtype(precision: str) -> np.dtype[Any]:
    """The type that decides hits and shadows in this precision."""
    return np.dtype("f4" if precision == "single" else "f8")


def shade_dtype(precision: str) -> np.dtype[Any]:
    """The type that colours are computed in."""
    return np.dtype("f8" if precision == "double" else "f4")


def view_dtype(real: np.dtype[Any]) -> np.dtype[Any]:
    """`View` of packet.cl."""
    fields = [(name, real, 4) for name in ("pixel", "right", "up", "back")]
    return np.dtype([*fields, ("background", "f4", 4), ("quantize", "f4", 4)])


def light_dtype(real: np.dtype[Any]) -> np.dtype[Any]:
    """`Light` of packet.cl."""
    fields = [(name, real, 4) for name in ("position", "axis", "across")]
    return np.dtype([*fields, ("color", "f4", 4), ("cone", "f4", 4)])


@dataclass(frozen=True)
class Packed:
    """A scene as the kernel wants it.

    features: the names of the -D flags; scale: depths come out in units of 2^scale; view: () view_dtype; lights:
    numbers of parallel, point and spot lights; arrays: the buffers by the kernel's argument names (see
    kernels/trace.cl), none of them empty; count: of spheres; skipped: what the scene did not need, and how often;
    list_seconds: what making the lists took.
    """

    precision: str
    features: frozenset[str]
    scale: int
    view: NDArray[np.void]
    lights: tuple[int, int, int]
    arrays: dict[str, NDArray[Any]]
    count: int
    skipped: dict[str, int]
    list_seconds: float

    def options(self) -> list[str]:
        """The compiler's options: one program for each combination of features, whatever the scene's numbers are."""
        real, shade = real_dtype(self.precision), shade_dtype(self.precision)
        sizes = {
            "REAL_BYTES": real.itemsize,
            "SHADE_BYTES": shade.itemsize,
            "View_BYTES": view_dtype(real).itemsize,
            "Light_BYTES": light_dtype(real).itemsize,
            "Grid_BYTES": grid_dtype(real).itemsize,
            "WORK_KINDS": len(WORK),
        }
        return [f"-D{k}={v}" for k, v in sizes.items()] + [f"-D{name}" for name in sorted(self.features)]


@dataclass(frozen=True)
class _Space:
    """Spheres (n) and lights (m) in camera space. hi + lo are their exact offsets from the eye, along the world's axes.

    center (n, 3) and position (m, 3): rotated, each coordinate rounded once; power: |center|^2 - radius^2 of the exact
    offset, rounded once, so that no rounding of centres enters it; *_rest: what the rounding cut off.
    """

    center: Array
    center_rest: Array
    radius: Array
    power: Array
    power_rest: Array
    center_hi: Array
    center_lo: Array
    position: Array
    position_hi: Array
    position_lo: Array

    def times_two_to(self, k: int) -> _Space:
        """All lengths times 2^k, which is exact: what float32 holds is within 2^-149 and 2^128."""
        factor = {f.name: 2.0 ** (2 * k if f.name.startswith("power") else k) for f in fields(self)}
        return _Space(**{name: getattr(self, name) * by for name, by in factor.items()})

    def largest(self, lights: NDArray[np.bool_]) -> float:
        """The largest coordinate of any sphere and of these lights, or the largest radius."""
        parts = (self.center, self.radius, self.position[lights])
        return max(float(np.abs(part).max(initial=0)) for part in parts)


def _camera_space(
    center: Array, radius: Array, position: tuple[float, ...], lights: NDArray[np.void], basis: Array
) -> _Space:
    eye = np.array(position)
    hi, lo = differences(center, None, eye, None)
    at_hi, at_lo = two_sum(lights["position"], -eye)
    place, _ = dot_products(basis, at_hi, at_lo)
    place_of_center, power = dot_products(basis, hi, lo), square_excess(hi, lo, radius)
    return _Space(*place_of_center, radius, *power, hi, lo, place, at_hi, at_lo)


def counting(packed: Packed) -> Packed:
    """The same, for a kernel that does all that it did, but writes only what it has counted."""
    rest = (name for name in packed.features if not name.startswith("OUT_"))
    return replace(packed, features=frozenset((*rest, "OUT_WORK")))


# What is left out where it is not needed, and can be kept to measure what that saves.
KEEPS = (
    "lists",
    "filter",
    "features",
    "lights",
    "hidden",
    "receivers",
    "unstopped",
    "highlights",
    "outputs",
    "order",
)


@dataclass(frozen=True)
class Prepared:
    """What no camera changes: the spheres (n) in the order in which they are packed, and their materials.

    center (n, 3), radius (n,): in the world; number (n,): in the scene; material (m, 8): of shade_dtype; material_of
    (n,): index into that; again (n,): whether it is the same sphere as one before it.
    """

    center: Array
    radius: Array
    number: NDArray[np.int32]
    material: NDArray[Any]
    material_of: NDArray[np.int32]
    again: NDArray[np.bool_]


def prepare(scene: Scene, precision: str, keep: tuple[str, ...] = ()) -> Prepared:
    """Sorts many spheres by place, so that neighbours are near each other in memory."""
    n = len(scene.spheres)
    center, radius, of = (np.ascontiguousarray(scene.spheres[name]) for name in ("center", "radius", "material"))
    number, by_place = np.arange(n), n >= MANY and "order" not in keep
    if by_place:
        number = spatial_order(center)
        center, radius, of = (column.take(number, axis=0) for column in (center, radius, of))
    ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)
    material = _materials(scene.materials, ambient, shade_dtype(precision))
    # Where most spheres have a material of their own, those are in the spheres' order, too.
    if len(material) > n // 2:
        material, of = material.take(of, axis=0), np.arange(n)
    again = repeated(center, radius, by_place)
    return Prepared(center, radius, number.astype("i4"), material, of.astype("i4"), again)


def pack(
    scene: Scene,
    precision: str,
    outputs: tuple[str, ...] = ("rgb8",),
    truncate: bool = False,
    keep: tuple[str, ...] = (),
    prepared: Prepared | None = None,
) -> Packed:
    """Moves the scene into camera space and packs it for one precision and these outputs.

    prepared: what prepare() returns for the same scene, whatever its camera, precision and keep.

    keep: what not to leave out, for measuring; no picture depends on it, but those of some extreme scenes in single, as
    the README says. lists: one list of all spheres for every ray; filter: each test in the precision that decides;
    features: the code of every feature; lights: lights that are black, or that shine on nothing that reflects; hidden:
    spheres inside others, or there twice; receivers: in a light's lists, spheres that shadow nothing in the picture;
    unstopped: of few spheres, shadow rays that none can stop; highlights: those too faint for a byte; outputs: all
    pictures that the kernel can write; order: that of the spheres in the scene.
    """
    real, shade = real_dtype(precision), shade_dtype(precision)
    skipped: dict[str, int] = {}
    lights = _lights(scene, "lights" in keep, skipped)
    basis = np.array(scene.camera.basis())
    n = len(scene.spheres)
    prepared = prepared or prepare(scene, precision, keep)
    space = _camera_space(prepared.center, prepared.radius, scene.camera.position, lights, basis)

    # float32 has little room for squares. So what is float32 has its lengths times a power of two that makes the
    # largest coordinate about 1: a scene and the same one scaled by a power of two are the same numbers there. Double
    # has room for the fourth power of every float32 number, and keeps scene units.
    k = -math.frexp(space.largest(lights["kind"] != PARALLEL))[1]
    small = space.times_two_to(k)
    exact = small if real.itemsize == 4 else space
    unit = 0 if real.itemsize == 4 else k

    # Beyond float32's range is only the reciprocal of a radius that vanishes there: such a sphere is never hit.
    inverse = _finite32(1 / exact.radius) if real.itemsize == 4 else 1 / exact.radius

    packed_lights = _pack_lights(lights, exact.position, basis, real)
    if shade.itemsize == 4:
        # The exponent of a highlight of 2^-20 of a byte's level: fainter ones are none. Not so in double, which is the
        # reference's formula throughout.
        brightest = _finite32(lights["color"]).max(axis=1, initial=0) * scene.materials["ks"].max(initial=0)
        packed_lights["cone"][:, 2] = -np.log(255 * 2.0**20 * np.maximum(brightest, 1))
    arrays: dict[str, NDArray[Any]] = {
        "center_radius": np.concatenate([exact.center, exact.radius[:, None]], axis=1).astype(real),
        "power": np.stack([exact.power, inverse], axis=1).astype(real),
        "rest": np.concatenate([small.center_rest, small.power_rest[:, None]], axis=1).astype("f4"),
        "number": prepared.number,
        "material_of": prepared.material_of,
        "material": prepared.material,
        "light": packed_lights,
        "candidate": _candidates(small),
    }
    x, y = scene.camera.image_plane()
    width, height = scene.camera.resolution
    step = (x / width, y / height)
    filters, lists, list_seconds = _lists(
        packed_lights, lights, small, prepared.again, basis, step, (width, height), real, keep, skipped
    )
    arrays |= filters | {"grid": lists.grid, "start": lists.start, "entry": lists.entry}
    arrays = {n: a if len(a) else np.zeros((1, *a.shape[1:]), a.dtype) for n, a in arrays.items()}

    view = np.zeros((), view_dtype(real))
    view["pixel"] = *step, math.ldexp(1.0, unit), math.ldexp(1.0, -unit)
    for name, axis in zip(("right", "up", "back"), basis, strict=True):
        view[name][:3] = axis
    rounding = 0.0 if truncate else 0.5
    view["background"][:3] = [_same_byte(c, rounding, shade) for c in scene.background]
    view["quantize"][0] = rounding

    parallel, point, spot = (int((lights["kind"] == kind).sum()) for kind in (PARALLEL, POINT, SPOT))
    return Packed(
        precision=precision,
        features=_features(scene, (parallel, point, spot), bool((space.power <= 0).any()), precision, outputs, keep),
        scale=-k if real.itemsize == 4 else 0,
        view=view,
        lights=(parallel, point, spot),
        arrays=arrays,
        count=n,
        skipped=skipped,
        list_seconds=list_seconds,
    )


def _same_byte(c: float, rounding: float, shade: np.dtype[Any]) -> np.float32:
    """A background colour in float32, moved by an ulp if that is what its byte needs to be that of the double.

    0.7 is all but 178.5 of 255: without this, the whole sky could be another level than the reference's.
    """
    near = np.float32(min(c, float(np.finfo(np.float32).max)))
    want = int(min(c, 1.0) * 255 + rounding)
    one = shade.type(1)
    for value in (near, np.nextafter(near, np.float32(0)), np.nextafter(near, np.float32(np.inf))):
        clamped = min(shade.type(value), one)
        if int(clamped * shade.type(255) + shade.type(rounding)) == want:
            return np.float32(value)
    return near


def _finite32(value: Array) -> Array:
    """Products of colours may leave float32's range: beyond it, everything is white anyway."""
    return np.minimum(value, float(np.finfo(np.float32).max))


def _lights(scene: Scene, all_of_them: bool, skipped: dict[str, int]) -> NDArray[np.void]:
    """The lights that can add to a colour, by kind: parallel, point, spot."""
    lights = scene.lights[scene.lights["kind"] != AMBIENT]
    used = np.zeros(len(scene.materials), bool)
    used[scene.spheres["material"]] = True
    black = (~lights["color"].any(axis=1) | bool(_dull(scene)[used].all())) & (not all_of_them)
    if black.any():
        skipped["lights that add nothing"] = int(black.sum())
    useful: NDArray[np.void] = lights[~black]
    return useful[np.argsort(useful["kind"], kind="stable")]


def _dull(scene: Scene) -> NDArray[np.bool_]:
    """Which materials reflect nothing of any light."""
    m = scene.materials
    return np.asarray((m["ks"] == 0) & ((m["kd"] == 0) | ~m["color"].any(axis=1)))


def _materials(m: NDArray[np.void], ambient: Array, shade: np.dtype[Any]) -> NDArray[Any]:
    """(m, 8): ka La C (rgb), kd C (rgb), ks, exponent."""
    out = np.empty((len(m), 8))
    out[:, 0:3] = m["ka"][:, None] * ambient * m["color"]
    out[:, 3:6] = m["kd"][:, None] * m["color"]
    out[:, 6], out[:, 7] = m["ks"], m["exponent"]
    return _finite32(out).astype(shade)


def _unit(v: Array) -> Array:
    """(n, 3) vectors scaled to length 1, without overflow."""
    scaled = v / np.abs(v).max(axis=1, keepdims=True)
    return np.asarray(scaled / np.sqrt((scaled * scaled).sum(axis=1, keepdims=True)))


def _pack_lights(lights: NDArray[np.void], position: Array, basis: Array, real: np.dtype[Any]) -> NDArray[np.void]:
    out = np.zeros(len(lights), light_dtype(real))
    out["color"][:, :3] = _finite32(lights["color"])
    out["cone"][:, 2] = -np.inf
    for k, light in enumerate(lights):
        direction = _unit((light["direction"] / np.abs(light["direction"]).max(initial=1e-300))[None] @ basis.T)[0]
        if light["kind"] == PARALLEL:
            towards = -direction
            # Any two axes across: the first one from the coordinate axis that is furthest from the light's.
            helper = np.eye(3)[np.argmin(np.abs(towards))]
            axis = _unit(np.cross(helper, towards)[None])[0]
            out["position"][k, :3] = towards
            out["axis"][k, :3] = axis
            out["across"][k, :3] = np.cross(towards, axis)
        else:
            out["position"][k, :3] = position[k]
        if light["kind"] == SPOT:
            alpha1, alpha2 = math.radians(light["alpha1"]), math.radians(light["alpha2"])
            out["axis"][k] = (*direction, math.cos(alpha2))
            out["cone"][k, :2] = alpha1, 1 / (alpha2 - alpha1) if alpha2 > alpha1 else 0
    return out


def _filter_constant(c: Array, square: Array) -> NDArray[np.float32]:
    """c' of the filters in trace.cl, where it is derived: c - 11 u (|f|^2 + |c|) - 2^-100, or -inf if that is <= 0."""
    bound = c - 11 * U * (square + np.abs(c)) - 2.0**-100
    return rounded_down(np.where(bound > 0, bound, -np.inf))


def _candidates(space: _Space) -> NDArray[np.float32]:
    """For the filter of closest_hit in trace.cl."""
    candidate = np.empty((len(space.center), 4), np.float32)
    candidate[:, :3] = space.center
    candidate[:, 3] = _filter_constant(space.power, squared_length(space.center))
    return candidate


def _lists(
    packed: NDArray[np.void],
    lights: NDArray[np.void],
    space: _Space,
    again: NDArray[np.bool_],
    basis: Array,
    step: tuple[float, float],
    size: tuple[int, int],
    real: np.dtype[Any],
    keep: tuple[str, ...],
    skipped: dict[str, int],
) -> tuple[dict[str, NDArray[Any]], Lists, float]:
    """For the filters of cast_shadow_ray in trace.cl, the lists of all sheets, and the seconds that those took.

    again: (n,), which spheres are the same as one before them.
    """
    n, m = len(space.center), len(lights)
    radius = space.radius
    slack = SLACK if real.itemsize == 4 else FINE_SLACK
    occluder = np.zeros((m, n, 4), np.float32)
    outside = np.ones((m, n), np.int8)
    from_light: list[tuple[Array, Array]] = []
    for k, light in enumerate(lights):
        if light["kind"] == PARALLEL:
            u, v = (space.center @ axis for axis in _axes(packed[k])[:2])
            reach = radius + 8 * U * (np.abs(u) + np.abs(v) + radius) + 2.0**-60
            occluder[k, :, 0], occluder[k, :, 1] = u, v
            occluder[k, :, 2] = rounded_up(reach * reach)
            from_light.append((space.center, space.power))
        else:
            # From the light to the centre: the eye cancels, exactly.
            hi, lo = differences(space.center_hi, space.center_lo, space.position_hi[k], space.position_lo[k])
            c, _ = square_excess(hi, lo, radius)
            offset = rotated(basis, hi)
            occluder[k, :, :3] = -offset
            occluder[k, :, 3] = _filter_constant(c, squared_length(offset))
            outside[k] = np.sign(c)
            from_light.append((offset, c))

    seen = np.ones(n, bool)
    if "hidden" not in keep and n > 1:
        seen = ~(again | hidden(space.center, radius, (space.power > 0) & (outside > 0).all(axis=0), slack))
        skipped["spheres inside others, or the same"] = n - int(seen.sum())
    begin = time.perf_counter()
    picture = camera_sheet(space.center, radius, space.power, step, size, seen)
    receiver = np.full(n, "receivers" in keep)
    receiver[picture.member] = True
    if "lists" in keep:
        picture = whole_sheet(seen)
    skipped["spheres out of the picture"] = n - len(picture.member)

    sheets, grids, idle = [picture], np.zeros((m, 4), np.int32), 0
    for k, (light, (offset, power)) in enumerate(zip(lights, from_light, strict=True)):
        axes = _axes(packed[k])
        parallel, stops = bool(light["kind"] == PARALLEL), -1
        if n <= FEW:
            if parallel:
                shadows = parallel_shadows(axes, offset, radius, slack)
            else:
                shadows = point_shadows(offset, radius, slack)
            shadows &= receiver[:, None] & seen
            # From outside a sphere never stands in its own way, from inside it may.
            np.fill_diagonal(shadows, space.power <= 0)
            casting = np.asarray(shadows.any(axis=0) | ("receivers" in keep))
            stops = int(((shadows.any(axis=1) | ("unstopped" in keep)) << np.arange(n)).sum())
            more = [whole_sheet(casting)] if casting.any() else []
        elif parallel:
            more = parallel_sheet(axes, offset, radius, seen, receiver, slack)
        else:
            more = point_sheets(offset, radius, power, seen, receiver, slack)
        if "lists" in keep:
            more = [whole_sheet(seen)]
        entered = np.zeros(n, bool)
        for sheet in more:
            entered[sheet.member] = True
        idle += n - int(entered.sum())
        grids[k] = len(sheets), len(more), stops, 0
        sheets += more
    skipped["spheres that shadow nothing seen, per light"] = idle
    lists = build(sheets, real)
    seconds = time.perf_counter() - begin
    filters: dict[str, NDArray[Any]] = {
        "occluder": occluder.reshape(-1, 4),
        "outside": outside.reshape(-1),
        "light_grids": grids,
    }
    return filters, lists, seconds


def _axes(light: np.void) -> Array:
    """(3, 3): two axes across a parallel light, and the one towards it."""
    return np.array([light[name][:3] for name in ("axis", "across", "position")], np.float64)


def _features(
    scene: Scene,
    numbers: tuple[int, ...],
    inside: bool,
    precision: str,
    outputs: tuple[str, ...],
    keep: tuple[str, ...],
) -> frozenset[str]:
    """Which parts of the kernel this scene and these outputs need."""
    shading = not {"rgb8", "color", "shadow_rays", "work"}.isdisjoint(outputs)
    full = "features" in keep
    lit = shading and (full or (any(numbers) and len(scene.spheres) > 0))
    flags = {f"OUT_{name.upper()}": True for name in outputs}
    flags |= {
        "WITH_FILTER": precision != "double" and "filter" not in keep,
        "WITH_INTERSECTION": shading or "normal" in outputs,
        "WITH_NORMAL": lit or "normal" in outputs,
        "WITH_INSIDE": inside or full,
        "WITH_SHADING": shading,
        "WITH_LIGHTS": lit,
        "WITH_PARALLEL": lit and (numbers[0] > 0 or full),
        "WITH_POINT": lit and (numbers[1] > 0 or full),
        "WITH_SPOT": lit and (numbers[2] > 0 or full),
        "WITH_SHADOWS": lit and (len(scene.spheres) > 1 or inside or full),
        "WITH_SPECULAR": lit and (bool(scene.materials["ks"].any()) or full),
        "WITH_DULL": lit and (full or bool(_dull(scene).any())),
        "WITH_PREFETCH": len(scene.spheres) >= PLENTY,
        "KEEP_HIGHLIGHTS": lit and "highlights" in keep,
    }
    return frozenset(name for name, wanted in flags.items() if wanted)
