"""Triangles on which no shadow falls: that is found out once it pays, and changes no bit."""

from __future__ import annotations

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pyopencl as cl
import pytest
from solids import Solid, ball, box, joined, lattice, mesh, needles, octahedron, sheet

from cltrace import BuildError, Camera, Image, Material, Renderer, Scene, parallel_light, point_light, spot_light
from cltrace.run import unstoppable
from cltrace.run.devices import Device

OUTPUTS = ("rgb8", "color", "shadow_rays", "id", "primitive")
MATTE = Material(ka=0, kd=1, ks=0.5)
CAMERA = Camera((0.5, 3, 7), (0, -0.5, 0), horizontal_fov=20, resolution=(96, 72))


def floor(side: float = 4, cells: int = 24, height: float = 0.25) -> Solid:
    """Hills, as squares of two triangles each."""
    line = np.linspace(-side, side, cells + 1)
    x, z = np.meshgrid(line, line)
    rough = np.random.default_rng(0).uniform(0, height / 16, x.shape)
    flat = sheet(line, line, height * np.sin(2 * x) * np.cos(3 * z) + rough - 1.5)
    return Solid(flat.vertices[:, [0, 2, 1]], flat.faces)


def large_floor() -> Solid:
    corners = np.array([[-9, -1.5, -9], [9, -1.5, -9], [9, -1.5, 9], [-9, -1.5, 9]], float)
    return Solid(corners, np.array([[0, 2, 1], [0, 3, 2]]))


def layers(solid: Solid, count: int, step: float) -> Solid:
    """So many of it that the light's cells need more than one level."""
    return joined(*(solid.moved((0, step * k, 0)) for k in range(count)))


def flattened(solid: Solid, by: tuple[float, float, float]) -> Solid:
    return Solid(solid.vertices * by, solid.faces)


def of(*solids: Solid, lights: list | None = None, r: float = 0) -> Scene:
    """r: how much of the light they mirror."""
    lamps = [point_light((1, 6, 2))] if lights is None else lights
    return Scene.from_meshes(CAMERA, lamps, [mesh(s, material=replace(MATTE, reflectance=r)) for s in solids])


ROOF = flattened(large_floor(), (0.1, -2, 0.1))
SCENES = {
    "hills": lambda: of(floor()),
    "a ball over hills": lambda: of(floor(), ball(2)),
    "a small ball over large triangles": lambda: of(layers(large_floor(), 40, -0.01), ball(3).moved((0, 0, 0), 0.1)),
    "large triangles over small ones": lambda: of(layers(ROOF, 160, 0.002), floor(1.5, 42)),
    "a low lamp": lambda: of(floor(), ball(2), lights=[point_light((9, -0.5, 1))]),
    "a lamp in the plane of triangles": lambda: of(large_floor(), box(), lights=[point_light((3, -1.5, 1))]),
    "a lamp between them": lambda: of(floor(), ball(2).moved((0, 0, 0), 5), lights=[point_light((0.125, 0, 0.25))]),
    "a lamp on a corner": lambda: of(box(), floor(), lights=[point_light((1, 1, 1))]),
    "all of it twice": lambda: of(floor(), floor(), ball(1), ball(1)),
    "coplanar ones": lambda: of(large_floor(), flattened(large_floor(), (0.5, 1, 0.5)), ball(1)),
    "corners of their own": lambda: of(floor().unshared(), ball(2).unshared()),
    "a soup": lambda: of(lattice(1, 3, 200), needles(3).moved((0, 0, 0), 2)),
    "a solid in another": lambda: of(joined(box((-3, -3, -3), (3, 3, 3)), ball(2)), lights=[point_light((0, 2.5, 0))]),
}
# Scenes of which no triangle is free of shadows, or none is known to be.
NONE = ("a soup", "coplanar ones", "a lamp in the plane of triangles", "all of it twice", "corners of their own")
LAMPS = [parallel_light((-1, -2, -1)), point_light((1, 6, 2)), spot_light((-3, 5, 3), (3, -5, -3), 20, 40)]
SLOW_SCENES = {
    "spheres over hills": lambda: Scene.from_spheres(
        CAMERA, LAMPS[1:2], [(0, 0, 0), (1.5, 0, 1)], [0.75, 0.25], meshes=mesh(floor(), material=MATTE)
    ),
    "several lights": lambda: of(floor(), ball(2), lights=LAMPS),
    "mirrors": lambda: of(floor(), ball(2), large_floor().moved((0, 5, 0)), lights=[point_light((1, 2.5, 2))], r=0.5),
}


def frames(scene: Scene, device: Device, monkeypatch: pytest.MonkeyPatch) -> tuple[Image, Image, np.ndarray]:
    """A frame before it is found out, one after that, and (m,) for the first light: which triangles are unstoppable."""
    renderer = Renderer(scene, device, "accurate", OUTPUTS)
    monkeypatch.setattr(unstoppable, "PAYS", np.inf)
    before = renderer.render()
    assert not known(renderer).any()
    monkeypatch.setattr(unstoppable, "PAYS", 0)
    after = renderer.render()
    return before, after, known(renderer)


def known(renderer: Renderer) -> np.ndarray:
    """(m,): which triangles are unstoppable as the last light sees them."""
    executor = renderer._executor
    m, lights = executor.plan.values["triangles"], executor.unstoppable.lights
    if not lights:
        return np.zeros(m, bool)
    bits = np.zeros((lights, -(-m // 32)), np.int32)
    cl.enqueue_copy(executor.queue, bits, executor.buffers["unstoppable"])
    return np.unpackbits(bits[-1].view(np.uint8), bitorder="little")[:m].astype(bool)


def same(one: Image, other: Image) -> bool:
    return all(np.array_equal(getattr(one, output), getattr(other, output)) for output in OUTPUTS)


@pytest.mark.parametrize("name", [*SCENES, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW_SCENES)])
def test_no_bit_depends_on_it(device: Device, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor beside spheres and lights of other kinds, and in mirrors."""
    before, after, found = frames((SCENES | SLOW_SCENES)[name](), device, monkeypatch)
    assert same(before, after)
    assert found.any() or name in NONE


def test_what_nothing_shadows_is_found(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """All triangles of convex solids and of a hillside that are seen and lit."""
    for solid in (octahedron(), ball(1), box(), floor(height=0.1), floor(height=0)):
        before, _, found = frames(of(solid), device, monkeypatch)
        shown = np.unique(before.primitive[before.color.max(axis=-1) > 0])
        assert len(shown) >= 2
        assert found[shown].all()


def test_what_is_shadowed_is_not_found(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where shadows are of triangles that are listed in cells of another level than those on which they fall."""
    for name, shadowed, first in (
        ("a small ball over large triangles", 0, 0),
        ("large triangles over small ones", 1, 320),
    ):
        before, _, found = frames(SCENES[name](), device, monkeypatch)
        dark = (before.id == shadowed) & (before.shadow_rays > 0) & (before.color.max(axis=-1) == 0)
        assert dark.sum() > 4
        assert not found[first + np.unique(before.primitive[dark])].any()
        assert found.any()


def test_it_is_found_out_once_it_pays(device: Device) -> None:
    """Not for a first frame; after enough pixels, also for parts of the picture, which share what is known."""
    renderer = Renderer(of(floor(2, 4), ball(1)), device, "accurate", OUTPUTS)
    part, frame = renderer.rows(20, 40), renderer.render()
    assert not known(renderer).any()
    for _ in range(int(unstoppable.PAYS * renderer._executor.unstoppable.lists / frame.id.size) + 1):
        renderer.render(frame)
    assert known(renderer).any()
    assert np.array_equal(known(part), known(renderer))


def test_pictures_are_the_same_where_a_driver_fails(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = of(floor(), ball(1))
    want, _, _ = frames(scene, device, monkeypatch)
    for fault in (BuildError("no such kernel"), cl.LogicError("create_buffer", -61)):
        monkeypatch.setattr(unstoppable.Unstoppable, "_find", Mock(side_effect=fault))
        renderer = Renderer(scene, device, "accurate", OUTPUTS)
        for _ in range(2):
            assert np.array_equal(renderer.render().color, want.color)
        assert not known(renderer).any()


def test_other_cameras_know_it(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is found out for one view holds for all, and for parts of them; the next ones ask about the rest."""
    scene = of(floor(), ball(2), large_floor().moved((0, -4, 0)))
    monkeypatch.setattr(unstoppable, "PAYS", 0)
    first = Renderer(scene, device, "accurate", OUTPUTS)
    first.render()
    start = known(first)
    cameras = [
        Camera(at, (0, -0.5, 0), horizontal_fov=12, resolution=(64, 48)) for at in ((6, 4, -3), (-5, 1, 2), (0, 7, 1))
    ]
    for camera in cameras:
        before, there = known(first), first.look(camera)
        monkeypatch.setattr(unstoppable, "PAYS", np.inf)
        assert (there.render().shadow_rays > 0).any()
        assert np.array_equal(known(there), before)  # without another search
        plain = Renderer(scene.seen_by(camera), device, "accurate", OUTPUTS).render()
        assert same(there.render(), plain)
        monkeypatch.setattr(unstoppable, "PAYS", 0)
        assert same(there.render(), plain)
        part = there.cropped((8, 8, 40, 32))
        assert np.array_equal(part.render().color, plain.color[8:32, 8:40])
        assert np.array_equal(known(part), known(there))
    assert start.any()
    assert (known(first) >= start).all()
    assert (known(first) > start).any()
    brighter = first.following(replace(scene, lights=(point_light((-1, 5, -2)),)))
    monkeypatch.setattr(unstoppable, "PAYS", np.inf)
    brighter.render()
    assert not known(brighter).any()
