"""Ray tracers with one mistake each, as students make them: the reference tracer, of which one step is done wrong.

`Tracer` is the reference. A subclass overrides a step, and gets it wrong. MISTAKES has all of them by the name that
`cltrace.compare` has to say; those that students make in different ways have several tracers.

    python tests/wrong_tracers.py NAME SCENE.xml MINE.png [WxH]

draws a scene with a mistake, to see what it looks like. It is slow: a second for some 5,000 pixels of a few spheres.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from pathlib import Path
from unittest.mock import patch

import numpy as np
from lxml import etree
from numpy.typing import NDArray
from PIL import Image as Picture

import cltrace
from cltrace import reference
from cltrace.cli.options import picture_size
from cltrace.reference import (
    EYE,
    Color,
    Direction,
    Ellipsoid,
    Intersection,
    Light,
    Mesh,
    Ray,
    Start,
    Texture,
    World,
    bounce,
    byte_of,
    trace,
)
from cltrace.reference.bounce import lift
from cltrace.reference.lights import ParallelLight, SpotLight
from cltrace.reference.records import Illumination, Shading
from cltrace.reference.spheres import Round
from cltrace.reference.surfaces import Lookup
from cltrace.reference.trace import primary_ray
from cltrace.reference.vectors import Matrix
from cltrace.scene import Camera, Scene

BLACK = (0.0, 0.0, 0.0)
Bytes = NDArray[np.uint8]
Floats = NDArray[np.floating]


class Tracer:
    """The reference tracer. What a subclass has by the name of a step takes that step's place while it draws."""

    STEPS = ("cast_shadow_ray", "illuminate", "shade")
    size: tuple[int, int] | None = None  # width and height in pixels, instead of the scene's

    def draw(self, path: Path) -> Bytes:
        """The picture of a scene file, (h, w, 3) uint8."""
        return self.write(self.colors(path))

    def colors(self, path: Path) -> NDArray[np.float64]:
        """The colours of its pixels, (h, w, 3), not clamped; the top row first."""
        scene = self.read(path)
        scene = scene.seen_by(self.camera(replace(scene.camera, resolution=self.size or scene.camera.resolution)))
        width, height = scene.camera.resolution
        colors = np.empty((height, width, 3))
        with ExitStack() as wrong:
            for target, name, step in self.patches():
                wrong.enter_context(patch.object(target, name, step))
            world = self.world(scene)
            for v, u in np.ndindex(height, width):
                colors[v, u] = trace.trace(world, self.primary_ray(scene.camera, u, v))[0]
        return colors

    def patches(self) -> Iterator[tuple[object, str, object]]:
        """What takes the place of which attributes of the reference while it draws."""
        for name in self.STEPS:
            if hasattr(self, name):
                yield trace, name, getattr(self, name)

    def read(self, path: Path) -> Scene:
        return cltrace.load(path)

    def camera(self, camera: Camera) -> Camera:
        return camera

    def world(self, scene: Scene) -> World:
        return reference.world_of(scene)

    def primary_ray(self, camera: Camera, u: int, v: int) -> Ray:
        return primary_ray(camera, u, v)

    def write(self, colors: NDArray[np.float64]) -> Bytes:
        return np.vectorize(byte_of, otypes=[np.uint8])(colors)


@cache
def right_colors(path: Path) -> NDArray[np.float64]:
    return Tracer().colors(path)


class Writing(Tracer):
    """Traces rightly, and writes something else."""

    def colors(self, path: Path) -> NDArray[np.float64]:
        return right_colors(path)


def both(a: Tracer, b: Tracer) -> Tracer:
    """A tracer with the mistakes of both, which are in different steps."""
    kind = type("Both", (type(a), type(b)), {})
    if not (isinstance(a, Writing) and isinstance(b, Writing)):  # one of them does not trace rightly
        kind.colors = Tracer.colors  # type: ignore[attr-defined]
    tracer: Tracer = object.__new__(kind)
    tracer.__dict__.update(b.__dict__ | a.__dict__)
    return tracer


# The camera.


class FullFieldOfView(Tracer):
    """Takes the angle of the file for the whole opening."""

    def __init__(self, across: bool = True, upwards: bool = True) -> None:
        self.across, self.upwards = across, upwards

    def primary_ray(self, camera: Camera, u: int, v: int) -> Ray:
        d = primary_ray(camera, u, v).direction
        x, y = (math.tan(math.radians(angle) / 2) / math.tan(math.radians(angle)) for angle in camera.half_angles())
        return Ray(EYE, Direction(d.x * (x if self.across else 1), d.y * (y if self.upwards else 1), d.z))


class TangentVerticalField(Tracer):
    """Scales the tangent of the angle by the picture's sides, instead of the angle."""

    def camera(self, camera: Camera) -> Camera:
        return replace(camera, square_pixels=True)


class TangentOfWidth(Tracer):
    """Does so with the angle for the width, also where the picture is higher than it is wide."""

    def primary_ray(self, camera: Camera, u: int, v: int) -> Ray:
        width, height = camera.resolution
        tan = math.tan(math.radians(camera.horizontal_fov))
        x, y = (2 * u + 1 - width) / width, (height - 1 - 2 * v) / height
        return Ray(EYE, Direction(x * tan, y * tan * height / width, -1.0))


class PixelCorner(Tracer):
    """Leaves out the 0.5 of (u + 0.5) / width, with rows counted from below as in the tutorial, or from the top."""

    def __init__(self, from_below: bool = True) -> None:
        self.down = 1 if from_below else -1

    def primary_ray(self, camera: Camera, u: int, v: int) -> Ray:
        (width, height), (x, y) = camera.resolution, camera.image_plane()
        d = primary_ray(camera, u, v).direction
        return Ray(EYE, Direction(d.x - x / width, d.y - self.down * y / height, d.z))


class UpsideDown(Writing):
    """Writes the tutorial's first row, which is the lowest, as the first row of the file, which is at the top."""

    def write(self, colors: NDArray[np.float64]) -> Bytes:
        return super().write(colors)[::-1]


class Mirrored(Tracer):
    """Has the camera's x axis point to the left, by the wrong order in a cross product."""

    def primary_ray(self, camera: Camera, u: int, v: int) -> Ray:
        d = primary_ray(camera, u, v).direction
        return Ray(EYE, Direction(-d.x, d.y, d.z))


class IntegerAspect(Tracer):
    """Divides the picture's sides as whole numbers, so that the shorter side's angle becomes 0."""

    def primary_ray(self, camera: Camera, u: int, v: int) -> Ray:
        width, height = camera.resolution
        d = primary_ray(camera, u, v).direction
        return Ray(EYE, Direction(d.x, 0.0, d.z) if width > height else Direction(0.0, d.y, d.z))


# What is written.


class Gamma(Writing):
    """Applies a curve to the colours before they become bytes."""

    def __init__(self, curve: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> None:
        self.curve = curve

    def write(self, colors: NDArray[np.float64]) -> Bytes:
        return super().write(self.curve(np.clip(colors, 0, 1)))


def srgb(c: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


class Truncated(Writing):
    """Cuts the part behind the point off, of 255 c, or of 255.999 c."""

    def __init__(self, full: float = 255) -> None:
        self.full = full

    def write(self, colors: NDArray[np.float64]) -> Bytes:
        return (np.clip(colors, 0, 1) * self.full).astype(np.uint8)


# Shadows, in the arithmetic that students have.


class Shadows(Tracer):
    """Shadow rays as students cast them, in the world: the point P = o + t d rounded, and along a unit vector l what
    is met at an s with epsilon < s < s_max. With an epsilon of about 1e-6 this is right.

    epsilon: scene units; real: the floating-point numbers of the student's language; off: how far the start is moved
    along the normal, scene units; own: whether a surface may shade itself.
    """

    def __init__(
        self, epsilon: float = 1e-6, real: type[np.floating] = np.float64, off: float = 0.0, own: bool = True
    ) -> None:
        self.epsilon, self.real, self.off, self.own = epsilon, real, off, own

    def world(self, scene: Scene) -> World:
        world = super().world(scene)
        self.things = Things(world, self.real)
        self.hit_by: tuple[Intersection, Ray] | None = None
        return world

    def patches(self) -> Iterator[tuple[object, str, object]]:
        yield from super().patches()
        shade, reference_of = trace.shade, self

        def with_ray(world: World, ray: Ray, at: Intersection) -> Shading:
            reference_of.ray = ray
            return shade(world, ray, at)

        yield trace, "shade", with_ray

    def way(self, light: Light, at: Intersection) -> Direction:
        """From the point to the light: all of it, or to a parallel light a unit vector."""
        return light.direction_from(at.start)

    def s_max(self, light: Light, distance: Floats) -> float:
        """How far the light is."""
        return math.inf if light.parallel else float(distance)

    def cast_shadow_ray(self, world: World, at: Intersection, light: Light) -> bool:
        things, real = self.things, self.real
        o, d = things.point(self.ray.origin), things.unit(self.ray.direction)
        P = o + real(at.distance) * d + real(self.off) * things.unit(at.normal)
        l = things.unit(self.way(light, at))  # noqa: E741
        distance = length(things.point(light.position) - P) if light.position else real(math.inf)
        s = things.met(P, l, None if self.own else at)
        return bool(np.any((s > real(self.epsilon)) & (s < self.s_max(light, distance))))


def length(v: Floats) -> Floats:
    return np.sqrt(np.einsum("i,i->", v, v))


class Things:
    """The surfaces of a world as a student's lists, in numbers of one floating-point type, along the world's axes.

    Sums are einsum's, as those of matrix products are rounded in another way on each kind of processor: acne would be
    elsewhere.
    """

    def __init__(self, world: World, real: type[np.floating]) -> None:
        self.real, self.eye = real, np.array(world.camera.position, real)
        self.basis = np.array(world.camera.basis(), real)
        balls = [s for s in world.surfaces if isinstance(s, Round)]
        self.center = np.array([tuple(s.place) for s in balls], real).reshape(-1, 3)
        self.radius = np.array([s.radius for s in balls], real)
        maps = [[tuple(row) for row in (s.K.x, s.K.y, s.K.z)] if isinstance(s, Ellipsoid) else np.eye(3) for s in balls]
        self.to_object = np.array(maps, real).reshape(-1, 3, 3)
        triangles = [s.triangle(i) for s in world.surfaces if isinstance(s, Mesh) for i in range(len(s.of.front))]
        corners = np.array([[tuple(p) for p in t.places] for t in triangles], real).reshape(-1, 3, 3)
        self.a, self.e1, self.e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        ids = [(s.number, -1) for s in balls] * 2 + [(t.number, t.primitive) for t in triangles]
        self.ids = np.array(ids, int).reshape(-1, 2)

    def point(self, p: reference.Point | Start) -> Floats:
        seen = np.array(tuple(p.point if isinstance(p, Start) else p), self.real)
        return np.einsum("i,ij->j", seen, self.basis) + self.eye

    def unit(self, v: Direction) -> Floats:
        w = np.einsum("i,ij->j", np.array(tuple(v), self.real), self.basis)
        return w / length(w)

    def met(self, o: Floats, d: Floats, but: Intersection | None) -> Floats:
        """Every s at which the ray meets something, both ends of the way through a ball; NaN where there is none.

        but: a surface to leave out is that of this intersection.
        """
        with np.errstate(all="ignore"):
            f = np.einsum("nij,nj->ni", self.to_object, o - self.center)
            w = np.einsum("nij,j->ni", self.to_object, d)
            a, b = np.einsum("ni,ni->n", w, w), np.einsum("ni,ni->n", f, w)
            c = np.einsum("ni,ni->n", f, f) - self.radius * self.radius
            root = np.sqrt(b * b - a * c)
            # Moeller and Trumbore
            p = np.cross(d, self.e2)
            inverse = 1 / np.einsum("ni,ni->n", self.e1, p)
            to = o - self.a
            u = np.einsum("ni,ni->n", to, p) * inverse
            q = np.cross(to, self.e1)
            v = np.einsum("ni,i->n", q, d) * inverse
            s = np.where((u >= 0) & (v >= 0) & (u + v <= 1), np.einsum("ni,ni->n", self.e2, q) * inverse, np.nan)
            found = np.concatenate([(-b - root) / a, (-b + root) / a, s])
        if but is not None:
            found[np.all(self.ids == (but.index, but.primitive), axis=1)] = np.nan
        return found


class NoShadows(Tracer):
    def cast_shadow_ray(self, world: World, at: Intersection, light: Light) -> bool:
        return False


class ShadowBeyondLight(Shadows):
    """Takes what is behind a light for something in its way."""

    def s_max(self, light: Light, distance: Floats) -> float:
        return math.inf


class LightReversed(Shadows):
    """Takes the direction in which light travels for the direction to the light; or goes from lights to points."""

    def __init__(self, parallel: bool = True, others: bool = False) -> None:
        super().__init__()
        self.parallel, self.others = parallel, others

    def world(self, scene: Scene) -> World:
        world = super().world(scene)
        if not self.parallel:
            return world
        lights = [replace(x, towards=-x.towards) if isinstance(x, ParallelLight) else x for x in world.lights]
        return replace(world, lights=lights)

    def way(self, light: Light, at: Intersection) -> Direction:
        w = super().way(light, at)
        return -w if self.others and not light.parallel else w

    def illuminate(self, world: World, ray: Ray, at: Intersection, light: Light) -> Illumination:
        return lit(light, phong(self, world, ray, at, light))


class SpotReversed(Tracer):
    """Compares the vector to the light, not from it, with the axis of a spot light."""

    def world(self, scene: Scene) -> World:
        world = super().world(scene)
        return replace(
            world, lights=[replace(x, axis=-x.axis) if isinstance(x, SpotLight) else x for x in world.lights]
        )


# Phong's formula.


class Lighting(Shadows):
    """Phong's formula as the tutorial has it."""

    def normal(self, at: Intersection) -> Direction:
        return at.normal

    def reaches(self, n_l: float) -> bool:
        """Whether the light is on the side of the surface that is seen."""
        return n_l > 0

    def diffuse(self, n_l: float) -> float:
        return max(0.0, n_l)

    def highlight(self, n: Direction, l: Direction, v: Direction) -> float:  # noqa: E741
        r = n * (2 * n.dot(l)) - l
        return max(0.0, r.dot(v))

    def tint(self, c: float) -> float:
        """What of the highlight a surface of colour c shows."""
        return 1.0

    def illuminate(self, world: World, ray: Ray, at: Intersection, light: Light) -> Illumination:
        return lit(light, phong(self, world, ray, at, light))


def lit(light: Light, color: Color) -> Illumination:
    """A light that adds this colour, however it came about."""
    nowhere = Direction(0.0, 0.0, 0.0)
    return Illumination(light, "lit", w=nowhere, l=nowhere, r=nowhere, n_l=0.0, r_v=0.0, strength=0.0, diffuse=color)


def phong(how: Shadows, world: World, ray: Ray, at: Intersection, light: Light) -> Color:
    """What one light adds, with the steps of a Lighting, or those that are right."""
    steps = how if isinstance(how, Lighting) else Lighting()
    n, m, w = steps.normal(at), at.material, how.way(light, at)
    l, v = w.normalized(), -ray.direction.normalized()  # noqa: E741
    strength = light.strength(light.direction_from(at.start))
    n_l = n.dot(l)
    if not steps.reaches(n_l) or strength == 0 or how.cast_shadow_ray(world, at, light):
        return BLACK
    highlight = m.ks * min(1.0, steps.highlight(n, l, v)) ** m.exponent
    kd = m.kd * min(1.0, steps.diffuse(n_l))
    red, green, blue = (
        strength * (kd * c + highlight * steps.tint(c)) * L for c, L in zip(at.color, light.color, strict=True)
    )
    return (red, green, blue)


class SpecularTinted(Lighting):
    """Multiplies the highlight with the object's colour."""

    def tint(self, c: float) -> float:
        return c


class Blinn(Lighting):
    """Takes the vector halfway between light and viewer, and n.h instead of r.v."""

    def highlight(self, n: Direction, l: Direction, v: Direction) -> float:  # noqa: E741
        return max(0.0, n.dot((l + v).normalized()))


class NoFacingGate(Lighting):
    """Does not ask whether n.l > 0, for the highlight, or at all."""

    def __init__(self, clamped: bool = True, own: bool = True) -> None:
        super().__init__(own=own)
        self.clamped = clamped

    def reaches(self, n_l: float) -> bool:
        return True

    def diffuse(self, n_l: float) -> float:
        return max(0.0, n_l) if self.clamped else n_l


class NormalNotFlipped(Lighting):
    """Leaves the normal as it leads out of the surface, also where it is seen from inside."""

    def __init__(self, refracts: bool = False) -> None:
        super().__init__()
        self.refracts = refracts

    def normal(self, at: Intersection) -> Direction:
        return at.outward

    def patches(self) -> Iterator[tuple[object, str, object]]:
        yield from super().patches()
        if self.refracts:
            yield bounce, "refracted", self.bent

    @staticmethod
    def bent(d: Direction, n: Direction, side: int, index: float, spread: float = 1.0) -> Direction | None:
        eta = 1 / index if side > 0 else index
        c, across = -n.dot(d), n.cross(d)
        k = d.dot(d) - (eta * eta) * across.dot(across)
        return lift((d + n * c) * eta - n * math.sqrt(k), n, -1, spread) if k >= 0 else None


# Sums of light.


class AmbientPerLight(Tracer):
    """Adds ambient light in the loop over the lights: for all of them, or only for those that reach the point."""

    def __init__(self, shadowed: bool = True) -> None:
        self.shadowed = shadowed

    def shade(self, world: World, ray: Ray, at: Intersection) -> Shading:
        ambient = tuple(at.material.ka * a * c for a, c in zip(world.ambient, at.color, strict=True))
        total = np.zeros(3)
        for light in world.lights:
            more = trace.illuminate(world, ray, at, light).color
            total += more
            if self.shadowed or any(more):
                total += ambient
        red, green, blue = total.tolist()
        return Shading((red, green, blue), ())


class EarlyClamp(Tracer):
    """Clamps each point's colour to 1 before it is weighed with what is seen in mirrors and through glass."""

    def patches(self) -> Iterator[tuple[object, str, object]]:
        yield from super().patches()
        shade = trace.shade

        def clamped(world: World, ray: Ray, at: Intersection) -> Shading:
            red, green, blue = (min(1.0, c) for c in shade(world, ray, at).color)
            return Shading((red, green, blue), ())

        yield trace, "shade", clamped


class EarlyClampOfLight(Tracer):
    """Clamps the sum of ambient and diffuse light to 1 before it is multiplied with the object's colour."""

    def shade(self, world: World, ray: Ray, at: Intersection) -> Shading:
        white = replace(at.material, color=(1.0, 1.0, 1.0), texture=None, ks=0.0)
        black = replace(at.material, color=BLACK, texture=None)
        light = np.array([white.ka * a for a in world.ambient])
        shine = np.zeros(3)
        for lamp in world.lights:
            light += trace.illuminate(world, ray, replace(at, material=white), lamp).color
            shine += trace.illuminate(world, ray, replace(at, material=black), lamp).color
        red, green, blue = (np.minimum(light, 1) * at.color + shine).tolist()
        return Shading((red, green, blue), ())


# Placing and what is on surfaces.


class TransformOrder(Tracer):
    """Applies the steps of a transform in the order of the file, the first one first."""

    def steps(self, sphere_or_mesh: etree._Element, transform: etree._Element) -> None:
        transform[:] = list(reversed(transform))

    def read(self, path: Path) -> Scene:
        tree = etree.parse(str(path), etree.XMLParser(load_dtd=False, no_network=True))
        for transform in tree.iter("transform"):
            self.steps(transform.getparent(), transform)
        wrong = path.with_name(f".{path.stem}-{os.getpid()}.xml")  # beside the files that it names
        try:
            tree.write(str(wrong))
            return super().read(wrong)
        finally:
            wrong.unlink()


class PositionLast(TransformOrder):
    """Moves a sphere to its position after the transform, not before."""

    def steps(self, sphere_or_mesh: etree._Element, transform: etree._Element) -> None:
        position = sphere_or_mesh.find("position")
        if position is not None:
            transform.insert(0, etree.Element("translate", dict(position.attrib)))
            position.attrib.update({"x": "0", "y": "0", "z": "0"})


class NormalTransform(Tracer):
    """Takes normals to the world by the matrix of points, or not at all."""

    def __init__(self, by_points: bool = True) -> None:
        self.by_points = by_points

    def patches(self) -> Iterator[tuple[object, str, object]]:
        yield from super().patches()
        yield Ellipsoid, "outward", lambda s, q: (s.view.B @ (s.L @ q if self.by_points else q)).normalized()

    def world(self, scene: Scene) -> World:
        world = super().world(scene)
        for mesh in world.surfaces:
            if isinstance(mesh, Mesh):
                linear = mesh.of.to_world[:, :3] if self.by_points else np.eye(3)
                mesh.normal_to_world = Matrix(*(Direction(*row) for row in linear.tolist()))
        return world


class Textured(Tracer):
    """Looks the colour of a texture up at another place: of (u, v), and of a texture with W x H pixels."""

    def __init__(self, place: Callable[[float, float, int, int], tuple[float, float]]) -> None:
        self.place = place

    def patches(self) -> Iterator[tuple[object, str, object]]:
        yield from super().patches()
        lookup, place = Texture.lookup, self.place

        def elsewhere(texture: Texture, uv: tuple[float, float]) -> Lookup:
            height, width = texture.texels.shape[:2]
            return lookup(texture, place(*uv, width, height))

        yield Texture, "lookup", elsewhere


class IntegerTexels(Tracer):
    """Divides the bytes of a texture by 255 as whole numbers, so that all but 255 become 0."""

    def patches(self) -> Iterator[tuple[object, str, object]]:
        yield from super().patches()

        def texel(texture: Texture, i: int, j: int) -> Color:
            height, width = texture.texels.shape[:2]
            red, green, blue = (float(x // texture.full) for x in texture.texels[j % height, i % width].tolist())
            return (red, green, blue)

        yield Texture, "texel", texel


# Mirrors and glass.


class MirrorDepth(Tracer):
    """Bounces once too rarely, or once too often."""

    def __init__(self, more: int) -> None:
        self.more = more

    def camera(self, camera: Camera) -> Camera:
        return replace(camera, max_bounces=camera.max_bounces + self.more)


class RefractionInverted(Tracer):
    """Takes the index of refraction on the way in, and one over it on the way out."""

    def world(self, scene: Scene) -> World:
        world = super().world(scene)
        for surface in world.surfaces:
            if surface.material.transmittance > 0:
                surface.material = replace(surface.material, index=1 / surface.material.index)
        return world


RIGHT: dict[str, Tracer] = {
    "the reference": Tracer(),
    "epsilon 1e-4": Shadows(1e-4),
    "epsilon 1e-6, Phong's formula as in the tutorial": Lighting(),
    "float32, epsilon 1e-3": Shadows(1e-3, np.float32),
    "shadow rays from beside the surface": Shadows(0.0, off=1e-5),
}
MISTAKES: dict[str, list[Tracer]] = {
    "full-field-of-view": [FullFieldOfView(), FullFieldOfView(upwards=False), FullFieldOfView(across=False)],
    "tangent-vertical-field": [TangentVerticalField(), TangentOfWidth()],
    "pixel-corner": [PixelCorner(), PixelCorner(from_below=False)],
    "upside-down": [UpsideDown()],
    "mirrored": [Mirrored()],
    "light-reversed": [
        LightReversed(), LightReversed(parallel=False, others=True), LightReversed(others=True), SpotReversed(),
    ],
    "no-shadows": [NoShadows()],
    "shadow-beyond-light": [ShadowBeyondLight()],
    "acne": [Shadows(0.0), Shadows(0.0, np.float32)],
    "large-epsilon": [
        Shadows(0.5), Shadows(0.2), Shadows(0.1), Shadows(0.01), Shadows(1e-6, off=0.05), Shadows(1e-6, off=0.2),
    ],
    "specular-tinted": [SpecularTinted()],
    "blinn": [Blinn()],
    "no-facing-gate": [NoFacingGate(clamped=False), NoFacingGate(own=False), NoFacingGate()],
    "early-clamp": [EarlyClampOfLight(), EarlyClamp()],
    "ambient-per-light": [AmbientPerLight(), AmbientPerLight(shadowed=False)],
    "gamma": [
        Gamma(lambda c: c ** (1 / 2.2)), Gamma(lambda c: c**2.2), Gamma(srgb), Gamma(np.sqrt),
    ],
    "truncated": [Truncated(), Truncated(255.999)],
    "integer-division": [IntegerAspect(), IntegerTexels()],
    "normal-not-flipped": [NormalNotFlipped(), NormalNotFlipped(refracts=True)],
    "transform-order": [TransformOrder(), PositionLast()],
    "normal-transform": [NormalTransform(), NormalTransform(by_points=False)],
    "texture-flipped": [Textured(lambda u, v, w, h: (u, 1 - v)), Textured(lambda u, v, w, h: (1 - u, v))],
    "half-texel": [
        Textured(lambda u, v, w, h: (u - 0.5 / w, v - 0.5 / h)),
        Textured(lambda u, v, w, h: (u + 0.5 / w, v + 0.5 / h)),
    ],
    "mirror-depth": [MirrorDepth(-1), MirrorDepth(1)],
    "refraction-inverted": [RefractionInverted()],
}  # fmt: skip


def main(name: str, scene: str, mine: str, size: str | None = None) -> None:
    Tracer.size = picture_size(size) if size else None
    Picture.fromarray(MISTAKES[name][0].draw(Path(scene))).save(mine)


if __name__ == "__main__":
    main(*sys.argv[1:])
