"""A scene in camera space, as objects: the eye is the origin, x is right, y is up, -z is ahead."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cltrace.reference import lights
from cltrace.reference.exact import Frame, rational
from cltrace.reference.lights import Light
from cltrace.reference.shapes import KINDS, Kinds
from cltrace.reference.surfaces import Material, Setting, Surface
from cltrace.reference.texture import Texture
from cltrace.reference.vectors import Color, Point, color_of
from cltrace.scene import AMBIENT, AnyCamera, Scene


@dataclass(frozen=True)
class World:
    """A scene in camera space. surfaces: in the order of their numbers."""

    camera: AnyCamera
    surfaces: Sequence[Surface]
    lights: Sequence[Light]
    ambient: Color
    background: Color


def world_of(scene: Scene, kinds: Kinds = KINDS) -> World:
    """Moves a scene into camera space: in exact arithmetic, so that each coordinate is rounded once."""
    frame, eye = frame_of(scene.camera), Point(*scene.camera.position)
    setting = Setting(scene, eye, frame, _materials(scene))
    surfaces = [surface for made in kinds.values() for surface in made(setting)]
    surfaces.sort(key=lambda surface: surface.number)
    shining = scene.lamps[scene.lamps["kind"] != AMBIENT]
    lamps = [lights.KINDS[int(light["kind"])](light, eye, frame) for light in shining]
    ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)
    return World(
        scene.camera, surfaces, lamps, ambient=color_of(ambient), background=color_of(np.array(scene.background))
    )


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
        return Material(color_of(m["color"]), **{k: float(m[k]) for k in names}, texture=textures[m["texture"]])

    return material
