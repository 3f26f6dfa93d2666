"""The table of shapes on the host: a further row is packed, listed and put into the tree, and nobody else knows it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import pytest

import cltrace
from cltrace.plan import world
from cltrace.plan.plan import Plan
from cltrace.plan.request import Request
from cltrace.plan.rounding import rotated
from cltrace.plan.shapes.mesh import MeshPacking
from cltrace.plan.shapes.shape import InView, ShapePacking, Sights
from cltrace.plan.shapes.sphere import CameraSpace, SpherePacking

rng = np.random.default_rng(27)
CENTER, RADIUS, MORE = rng.uniform(-1, 1, (60, 3)), rng.uniform(0.02, 0.2, 60), 7
CAMERA = cltrace.Camera((0.5, 1.0, 4.0), (0, 0, 0), resolution=(160, 120))
LIGHTS = [
    cltrace.point_light((2, 3, 1)),
    cltrace.parallel_light((-1, -2, -0.5)),
    cltrace.spot_light((0, 3, 0), (0, -1, 0), 20, 30),
]


@dataclass(frozen=True, eq=False)
class Balls(ShapePacking):
    """The last MORE of the spheres, as another shape."""

    words = "balls"

    @classmethod
    def of(cls, *_: Any) -> Balls:
        row, r = np.arange(MORE, dtype=np.int32), RADIUS[-MORE:]
        tree = {"center": CENTER[-MORE:], "outer": r, "inner": r, "member": np.ones(MORE, bool)}
        return cls(row, row + np.int32(60 - MORE), {}, tree, False)

    def material(self, scene: cltrace.Scene) -> Any:
        return np.zeros(MORE, np.int32)

    def solid_of(self, scene: cltrace.Scene) -> Any:
        return np.zeros(MORE, np.int32)

    @property
    def sizes(self) -> Any:
        return RADIUS[-MORE:]

    def values(self, first: int) -> dict[str, Any]:
        return {"first_ball": first}

    def packed(self, *_: Any) -> dict[str, Any]:
        return {"ball": np.zeros((MORE, 4))}

    def in_view(self, camera: Any, first: int) -> BallsInView:
        return BallsInView(self, camera, first)


class BallsInView(InView):
    @cached_property
    def space(self) -> CameraSpace:
        return CameraSpace.of(self.camera, CENTER[-MORE:], RADIUS[-MORE:])

    def lengths(self) -> Any:
        return self.space.center, self.space.radius

    def see(self, k: int, lights: Any, request: Request) -> Sights:
        small = self.space.times_two_to(k)
        eye = small.seen_along_view() if self.camera.parallel else small.seen_from_eye()
        turned = partial(rotated, np.array(self.camera.basis()))
        discs = [small.seen_from(light.place * 2.0**k)[0] if light.at_point else None for light in lights]
        seen = [replace(d, center=turned(d.center)) if d else small.seen_from_eye() for d in discs]
        eye, *seen = (replace(d, first=self.first) for d in (eye, *seen))
        return Sights({}, eye=eye, lights=seen, lit={})


@pytest.mark.parametrize("camera", [CAMERA, cltrace.Orthographic((0, 0, 4), height=3.0)], ids=["point", "parallel"])
@pytest.mark.parametrize("meshes", [0, 1])
def test_another_row_is_listed_as_spheres_are(camera: Any, meshes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lists and tree of spheres and balls have the bits of those of all spheres."""
    corners = np.random.default_rng(1).uniform(-1, 1, (90, 3))
    mesh = [cltrace.Mesh(corners, np.arange(90).reshape(-1, 3))] * meshes

    def plan(n: int) -> Plan:
        spheres = CENTER[:n], RADIUS[:n]
        scene = cltrace.Scene.from_spheres(camera, LIGHTS, *spheres, reflectance=0.5, meshes=mesh)
        return Plan.of_scene(scene, Request(keep=("hidden",)))

    expected = plan(60)
    monkeypatch.setattr(world, "SHAPES", (SpherePacking, Balls, MeshPacking))
    found = plan(60 - MORE)
    for name in ("grid", "start", "entry", "light_buffer", "node", "block", "patch"):
        assert found.arrays[name].tobytes() == expected.arrays[name].tobytes(), name
    assert len(found.arrays["ball"]) == MORE
    assert found.values["first_ball"] == 60 - MORE
    assert found.values["first_triangle"] == expected.values["first_triangle"]
