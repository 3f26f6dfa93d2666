"""A scene in camera space, as objects: the eye is the origin, x is right, y is up, -z is ahead."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cltrace.reference.clipping import Region, region_of
from cltrace.reference.cylinders import cylinders
from cltrace.reference.lights import Light, ShadowRay, light_of
from cltrace.reference.rays import Ray, view_of
from cltrace.reference.spheres import spheres
from cltrace.reference.surfaces import PhongMaterial, Setting, Shape, Surface, Texture
from cltrace.reference.triangles import meshes
from cltrace.reference.vectors import Color, color_of
from cltrace.scene import AMBIENT, AnyCamera, Scene

Kinds = Mapping[str, Callable[[Setting], Iterable[Shape]]]

# The table of shapes: what makes a scene's surfaces of each kind, which do not overlap in their numbers. To add one is
# to add its file and a row: nothing else names a kind of surface.
KINDS: Kinds = {"spheres": spheres, "meshes": meshes, "cylinders": cylinders}


@dataclass(frozen=True)
class World:
    """A scene in camera space. surfaces: by rising numbers; region: what its planes keep."""

    camera: AnyCamera
    surfaces: Sequence[Shape]
    region: Region
    lights: Sequence[Light]
    ambient: Color
    background: Color

    def parts(self, ray: Ray) -> Iterator[Surface]:
        """The surfaces that a ray may meet first, by rising numbers, and before them the cap where it meets one."""
        return self.region.parts(self.surfaces, ray)

    def blockers(self, ray: ShadowRay) -> Iterator[Surface]:
        """The surfaces that stand between the start of a shadow ray and its light."""
        return self.region.blockers(self.surfaces, ray)


def world_of(scene: Scene, kinds: Kinds = KINDS) -> World:
    """Moves a scene into camera space: in exact arithmetic, so that each coordinate is rounded once."""
    view = view_of(scene.camera)
    setting = Setting(scene, view, _materials(scene))
    surfaces = [surface for make in kinds.values() for surface in make(setting)]
    surfaces.sort(key=lambda surface: surface.number)
    shining = scene.lamps[scene.lamps["kind"] != AMBIENT]
    lamps = [light_of(light, view) for light in shining]
    ambient = scene.lights["color"][scene.lights["kind"] == AMBIENT].sum(axis=0)
    return World(
        scene.camera,
        surfaces,
        region_of(setting),
        lamps,
        ambient=color_of(ambient),
        background=color_of(np.array(scene.background)),
    )


def _materials(scene: Scene) -> Callable[[int], PhongMaterial]:
    """The scene's materials, each of which is made when it is first asked for."""
    names = ("ka", "kd", "ks", "exponent", "reflectance", "transmittance", "index")
    textures = [*map(Texture, scene.textures), None]  # the last one is that of the index -1

    @functools.cache
    def material(i: int) -> PhongMaterial:
        m = scene.materials[i]
        return PhongMaterial(color_of(m["color"]), **{k: float(m[k]) for k in names}, texture=textures[m["texture"]])

    return material
