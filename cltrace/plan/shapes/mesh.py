"""The triangles of all meshes: a row of SHAPES."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from cltrace.base.arrays import widened
from cltrace.plan.accel.silhouettes import Polygons
from cltrace.plan.attributes import Attributes
from cltrace.plan.lights import AtPoint, Lamp, Parallel
from cltrace.plan.materials import may_bounce
from cltrace.plan.order import MANY
from cltrace.plan.paths import Paths
from cltrace.plan.request import Request
from cltrace.plan.rounding import Array, Ints, rotated
from cltrace.plan.shapes.shape import Arrays, InView, Shape, Sights, share
from cltrace.plan.shapes.triangle import Floats, Sides, Triangles, along_light, from_point
from cltrace.scene import AnyCamera, Scene

FLAGS = {"WITH_SHAPES": "shape", "WITH_PLACED": "shape", "WITH_PATCHES": "bounces", "WITH_UNSTOPPABLE": "points"}


@dataclass(frozen=True, eq=False)
class Meshes(Shape):
    """The m triangles of all meshes, and what their corners have for shading: a Shape."""

    triangles: Triangles
    attributes: Attributes

    words: ClassVar[str] = "triangles"

    @classmethod
    def of(cls, scene: Scene, request: Request, before: tuple[Scene, Meshes] | None) -> Meshes:
        sided = bool(scene.meshes) and may_bounce(scene, request)
        # What knows the triangles' fronts does for a scene that needs none, too.
        if before and share(before[0], scene, "meshes") and before[1].triangles.sided >= sided:
            return before[1]
        by_place, once = scene.triangles >= MANY and "order" not in request.keep, "hidden" not in request.keep
        triangles = Triangles.of(scene.meshes, by_place, sided=sided, once=once)
        textured = bool(scene.textures) or "uv" in request.outputs
        attributes, m = Attributes.of(scene.meshes, triangles, request.precision, textured), len(triangles.face)
        tree = {"vertex": triangles.vertex, "face": triangles.face[:, :3]}
        of: dict[str, Any] = {"triangles": triangles, "attributes": attributes}
        return cls(triangles.number, triangles.surface, FLAGS if m else {}, tree, leave=m > 0, **of)

    @property
    def left_out(self) -> int:
        return self.triangles.again

    def material(self, scene: Scene) -> Ints:
        return self.triangles.material

    def values(self, first: int) -> dict[str, Any]:
        return {"first": first, "triangles": len(self.triangles.face)}

    def packed(self, real: np.dtype[Any], exponent: int | None, basis: Array, paths: Paths | None) -> Arrays:
        vertex = self.triangles.vertex
        if exponent is not None and paths:
            vertex = np.ldexp(vertex - paths.middle, exponent)
        face, number = self.triangles.face, self.triangles.number
        arrays = {"vertex": widened(vertex, 4, real), "face": face, "number_of": number}
        return arrays | self.attributes.arrays()

    def in_view(self, camera: AnyCamera, first: int) -> MeshesInView:
        return MeshesInView(self.triangles, camera, first)


@dataclass
class MeshesInView(InView):
    """Triangles as a camera sees them: InView.

    first: the index of the first one as a surface; arrays, lit: of Sights.
    """

    triangles: Triangles
    camera: AnyCamera
    first: int
    arrays: Arrays = field(default_factory=dict)
    lit: Arrays = field(default_factory=dict)

    @cached_property
    def near(self) -> Array:
        """(v, 3): from the eye to the corners, along the camera's axes, in scene units."""
        return self.seen_from(np.array(self.camera.position))

    def lengths(self) -> Sequence[Array]:
        return (self.near,)

    def see(self, k: int, lights: list[Lamp], request: Request) -> Sights:
        self.near *= 2.0**k
        eye_row, *rows = self.rows(len(lights))
        eye = self.from_eye(k, eye_row)
        seen = [light.look(self, k, row) for light, row in zip(lights, rows, strict=True)]
        inside = np.zeros(len(self.triangles.face), bool)
        return Sights(self.arrays, eye=eye, lights=[*seen], visible=None, inside=inside, lit=self.lit)

    def rows(self, lights: int) -> Iterable[Any]:
        """Where facets go that are seen from the eye, and from each light."""
        facets = np.empty((1 + lights, 3 * len(self.triangles.face), 4), np.float32)
        self.arrays["facet"], self.lit["light_facet"] = facets[0], facets[1:].reshape(-1, 4)
        return facets

    def from_eye(self, k: int, out: Floats) -> Polygons:
        """What the eye sees. out: (3 m, 4), abi's `facet`."""
        camera, (wide, high) = self.camera, self.camera.image_plane()
        if not camera.parallel:
            side = from_point(self.near, self.triangles, np.array(camera.position), out, (wide, high))
        else:
            plane, back = (math.ldexp(wide, k), math.ldexp(high, k)), np.array(camera.basis()[2])
            side = along_light(self.near, self.triangles, np.eye(3), towards=back, out=out, plane=plane)
        return self.polygons(self.near, side)

    def from_point(self, light: AtPoint, k: int, out: Floats) -> Polygons:
        """What a light sees. out: as of from_eye()."""
        place = self.seen_from(light.place, 2.0**k)
        return self.polygons(place, from_point(place, self.triangles, light.place, out))

    def along(self, light: Parallel, k: int, out: Floats) -> Polygons:
        """The same of a parallel light."""
        return self.polygons(
            self.near, along_light(self.near, self.triangles, light.axes, towards=light.towards, out=out)
        )

    def polygons(self, vertex: Array, side: Sides, sight: Any = None) -> Polygons:
        """See Polygons."""
        return Polygons(vertex, self.triangles.face[:, :3], self.first, side, sight)

    def seen_from(self, point: Array, unit: float = 1.0) -> Array:
        """(v, 3): from a point of the world to the corners, along the camera's axes, in 1 / unit scene units."""
        return rotated(np.array(self.camera.basis()), self.triangles.vertex, point, unit)
