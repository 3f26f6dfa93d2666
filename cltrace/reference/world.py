"""A scene in camera space, as objects: the eye is the origin, x is right, y is up, -z is ahead."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cltrace.reference.exact import Ball, Frame, Rational, Rows, rational
from cltrace.reference.lights import Light
from cltrace.reference.surfaces import Ellipsoid, Material, Sphere, Surface
from cltrace.reference.texture import Texture
from cltrace.reference.triangles import Mesh
from cltrace.reference.vectors import Color, Direction, Point
from cltrace.scene import AMBIENT, PARALLEL, SPOT, AnyCamera, Scene


@dataclass(frozen=True)
class World:
    """A scene in camera space. surfaces: in the order of their numbers."""

    camera: AnyCamera
    surfaces: Sequence[Surface]
    lights: Sequence[Light]
    ambient: Color
    background: Color


Maker = Callable[[int], Sphere]  # of a scene's sphere, by its place among the spheres


def one_by_one(scene: Scene, sphere: Maker) -> Iterable[Surface]:
    return map(sphere, range(len(scene.spheres)))


def world_of(scene: Scene, gathered: Callable[[Scene, Maker], Iterable[Surface]] = one_by_one) -> World:
    """Moves a scene into camera space: in exact arithmetic, so that each coordinate is rounded once.

    gathered: what becomes of the spheres, which it may also make later: surfaces that do not overlap in their numbers.
    """
    frame, eye = frame_of(scene.camera), scene.camera.position
    material, maps = _materials(scene), [_rows(to_object) for to_object in scene.to_object.tolist()]

    def sphere(i: int) -> Sphere:
        one = scene.spheres[i]
        kind, to_object = (Ellipsoid, maps[one["to_object"]]) if one["to_object"] >= 0 else (Sphere, None)
        center = one["center"].tolist()
        ball = Ball(_from_eye(center, eye), Fraction(float(one["radius"])), to_object)
        return kind(Point(*center), ball, frame, material(int(one["material"])), int(scene.sphere_numbers[i]))

    surfaces = list(gathered(scene, sphere))
    surfaces += [Mesh(mesh, Point(*eye), frame, material(mesh.material)) for mesh in scene.meshes]
    surfaces.sort(key=lambda surface: surface.number)
    lights = [_light(light, eye, frame) for light in scene.lights[scene.lights["kind"] != AMBIENT]]
    ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)
    return World(scene.camera, surfaces, lights, _color(ambient), _color(np.array(scene.background)))


@functools.lru_cache(maxsize=4)
def frame_of(camera: AnyCamera) -> Frame:
    right, up, back = camera.basis()
    return Frame((rational(right), rational(up), rational(back)))


def _materials(scene: Scene) -> Callable[[int], Material]:
    """The scene's materials, each of which is made when it is first asked for."""
    names = ("ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index")
    textures = [*map(Texture, scene.textures), None]  # the last one is that of the index -1

    @functools.cache
    def material(i: int) -> Material:
        m = scene.materials[i]
        return Material(_color(m["color"]), **{k: float(m[k]) for k in names}, texture=textures[m["texture"]])

    return material


def _rows(matrix: Sequence[Sequence[float]]) -> Rows:
    x, y, z = (rational(row) for row in matrix)
    return x, y, z


def _light(light: np.void, eye: Iterable[float], frame: Frame) -> Light:
    color, direction = _color(light["color"]), light["direction"].tolist()
    if light["kind"] == PARALLEL:
        x, y, z = rational(direction)
        return Light(color, -_turned(frame, direction), None, None, None, None, (-x, -y, -z))
    site = Point(*light["position"].tolist())
    place = _from_eye(site, eye)
    position = Point(*map(float, frame.to_camera(place)))
    if light["kind"] == SPOT:
        alpha1, alpha2 = math.radians(light["alpha1"]), math.radians(light["alpha2"])
        return Light(color, None, position, _turned(frame, direction), alpha1, alpha2, place, site)
    return Light(color, None, position, None, None, None, place, site)


def _from_eye(p: Iterable[float], eye: Iterable[float]) -> Rational:
    x, y, z = (Fraction(a) - Fraction(b) for a, b in zip(p, eye, strict=True))
    return x, y, z


def _turned(frame: Frame, v: Sequence[float]) -> Direction:
    """A unit direction of camera space, right to a few ulp. The largest coordinate goes to 1 first, for the range."""
    largest = max(map(abs, v))
    w = Direction(*(x / largest for x in v))
    return Direction(*(Direction(*map(float, row)).dot(w) for row in frame.rows)).normalized()


def _color(value: NDArray[np.float64]) -> Color:
    r, g, b = value.tolist()
    return (r, g, b)
