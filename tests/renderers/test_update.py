"""Renderer.update(): other places, sizes, materials and numbers of spheres; pictures of a new Renderer, to the bit."""

from __future__ import annotations

import gc
import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_scenes import random_scene

import cltrace
from cltrace import Camera, Mesh, Renderer, Scene
from cltrace.plan.request import Request
from cltrace.plan.shapes.mesh import MeshPacking
from cltrace.plan.shapes.sphere import SpherePacking
from cltrace.plan.view import CameraView
from cltrace.plan.world import Before, ScenePacking
from cltrace.run import pack
from cltrace.run.devices import Device
from cltrace.run.pack.spheres import SpherePacker
from cltrace.scene.changes import with_spheres

OUTPUTS = ("rgb8", "color", "normal", "direction", "depth", "id", "shadow_rays")
LIGHTS = [cltrace.ambient_light((0.5, 0.5, 0.5)), cltrace.point_light((3, 9, 6)), cltrace.parallel_light((0, -1, -1))]
POINTS = [*LIGHTS[:2], cltrace.spot_light((-4, 9, 6), (4, -9, -6), 10, 20)]
CAMERA = Camera((0, 2, 12), (0, 0, 0), horizontal_fov=25, resolution=(48, 36))
TRIANGLE = Mesh([(-3, -2, -3), (3, -2, -3), (0, -2, 3)], [(0, 2, 1)])


def spheres(n: int, seed: int = 0) -> dict[str, Any]:
    """Arguments of from_spheres: places, sizes and colours."""
    rng = np.random.default_rng(seed)
    size = 2 * n ** (-1 / 3)
    return {
        "centers": rng.uniform(-2, 2, (n, 3)),
        "radii": rng.uniform(size / 4, size / 2, n),
        "colors": rng.uniform(0, 1, (n, 3)),
    }


BY_VALUES, BENT = {"colors": None, "values": range(4)}, {"transform": np.diag([1, 2, 1])}
THREE = {"centers": [(0, 0, 0)] * 3, "radii": [1, 2, 3]}


def same(renderer: Renderer, scene: Scene, outputs: tuple[Any, ...] = OUTPUTS) -> None:
    """The Renderer draws what a new one draws of the scene, and its own scene is just that."""
    image = renderer.render()
    want = Renderer(scene, renderer.device, renderer.precision, outputs, renderer.request.crop).render()
    for name in outputs:
        assert np.array_equal(getattr(image, name), getattr(want, name)), name
    assert np.array_equal(renderer.scene.spheres, scene.spheres)
    assert np.array_equal(renderer.scene.materials, scene.materials)
    assert [mesh.number for mesh in renderer.scene.meshes] == [mesh.number for mesh in scene.meshes]


@pytest.mark.parametrize(
    ("count", "precision", "meshes"),
    [
        pytest.param(1, "accurate", (), marks=pytest.mark.slow),
        pytest.param(2, "double", TRIANGLE, marks=pytest.mark.slow),
        pytest.param(600, "accurate", TRIANGLE, marks=pytest.mark.slow),
        pytest.param(600, "single", (), marks=pytest.mark.slow),
        (5000, "accurate", ()),
        pytest.param(5000, "single", TRIANGLE, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("many", [2**15, 0])
def test_any_sequence_of_changes(
    device: Device, count: int, precision: Any, meshes: Any, many: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Packed by numpy, and on the device."""
    monkeypatch.setattr(pack, "MANY", many)
    if not many and (count < 100 or meshes):
        pytest.skip("never packed on the device")
    rng, lights = np.random.default_rng(count), LIGHTS if many else POINTS
    values = spheres(count)
    scene = Scene.from_spheres(CAMERA, lights, **values, meshes=meshes)
    renderer = Renderer(scene, device, precision, OUTPUTS)
    number, camera = count, CAMERA
    for step in range(8 if count < 5000 else 4):
        changed: dict[str, Any] = {}
        if step % 4 == 3:
            number = max(1, number + int(rng.integers(-3, 4)))
            arrays = [name for name, value in values.items() if np.ndim(value) and name not in spheres(1)]
            changed = spheres(number, step) | {name: rng.uniform(0, 0.6, number) for name in arrays}
        for name in rng.permutation(["centers", "radii", "colors", "kd", "ks", "reflectance", "exponent"])[:2]:
            per_sphere = rng.random() < 0.7
            if name == "centers":
                changed[name] = changed.get(name, rng.uniform(-2, 2, (number, 3))).astype(rng.choice(["f4", "f8"]))
            elif name == "colors":
                changed[name] = rng.uniform(0, 1, (number, 3) if per_sphere else 3)
            else:
                low, high = {"radii": (0.05, 0.5), "exponent": (1, 99)}.get(str(name), (0.0, 0.6))
                changed[str(name)] = rng.uniform(low, high, number if per_sphere else None)
        values |= changed
        assert renderer.update(**changed) is renderer
        same(renderer, Scene.from_spheres(camera, lights, **values, meshes=meshes))
        if step % 2:
            camera = replace(camera, position=tuple(rng.uniform(4, 9, 3)))
            renderer = renderer.look(camera)
            same(renderer, Scene.from_spheres(camera, lights, **values, meshes=meshes))


@pytest.mark.parametrize("many", [2**15, 0])
def test_materials_alone_make_no_lists(device: Device, many: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pack, "MANY", many)
    values = spheres(600)
    scene = Scene.from_spheres(CAMERA, POINTS, **values)
    renderer = Renderer(scene, device, outputs=OUTPUTS)
    lists, order = renderer._executor.buffers["entry"], renderer._executor.buffers["id_of"]
    assert isinstance(renderer._now.packer, SpherePacker) == (many == 0)
    monkeypatch.setattr(CameraView, "of", None)
    monkeypatch.setattr(SpherePacker, "view", None)
    values |= {"colors": (0.25, 1.0, 0.5), "ks": np.linspace(0, 1, 600), "kd": 0.5, "exponent": 7}
    renderer.update(**{name: value for name, value in values.items() if name not in ("centers", "radii")})
    assert renderer._executor.buffers["entry"] is lists
    assert renderer._executor.buffers["id_of"] is order
    monkeypatch.undo()
    same(renderer, Scene.from_spheres(CAMERA, POINTS, **values))
    monkeypatch.setattr(pack, "MANY", many)
    camera = replace(CAMERA, position=(9, 3, 4))
    same(renderer.look(camera), Scene.from_spheres(camera, POINTS, **values))


def test_one_colour_becomes_several(device: Device) -> None:
    """And one again: where all surfaces have one material, the kernel looks up none."""
    values = spheres(60) | {"colors": "red"}
    renderer = Renderer(Scene.from_spheres(CAMERA, LIGHTS, **values), device, outputs=OUTPUTS)
    for colors in (spheres(60)["colors"], "red"):
        values["colors"] = colors
        same(renderer.update(colors=colors), Scene.from_spheres(CAMERA, LIGHTS, **values))


def test_rows_stay_those_rows(device: Device) -> None:
    """The view of all rows is not that of some."""
    values = spheres(60)
    scene = Scene.from_spheres(CAMERA, LIGHTS, **values)
    width, height = CAMERA.resolution
    for changes in ({"kd": 0.25}, {"centers": values["centers"] / 2}):
        new = Scene.from_spheres(CAMERA, LIGHTS, **values | changes)
        want = cltrace.render(new, device).rgb8
        rows = Renderer(scene, device).rows(5, height - 2)
        other = rows.following(new)
        assert rows.update(**changes) is rows
        for part in (rows, other):
            assert part.region == (0, 5, width, height - 7)
            assert np.array_equal(part.render().rgb8, want[5 : height - 2])
            assert np.array_equal(part.cropped(None).render().rgb8, want)


@pytest.mark.slow
def test_materials_that_change_where_light_goes(device: Device) -> None:
    """What is black, mirrors, or lets light through, and back again."""
    values = spheres(40)
    renderer = Renderer(Scene.from_spheres(CAMERA, LIGHTS, **values), device, outputs=OUTPUTS)
    for changed in (
        {"kd": 0, "ks": 0},
        {"kd": 0.5, "reflectance": 0.5},
        {"transmittance": np.where(np.arange(40) % 2, 0.5, 0), "index": 1.5},
        {"transmittance": np.where(np.arange(40) % 2, 0, 0.5)},
        {"reflectance": 0, "transmittance": 0},
        {"ks": 3.0, "ka": 1.0},
        {"kd": 0.9},
    ):
        values |= changed
        same(renderer.update(**changed), Scene.from_spheres(CAMERA, LIGHTS, **values))


def test_ambient_light_follows_diffuse_light_where_it_was_not_given(device: Device) -> None:
    values = spheres(5)
    for given in ({}, {"ka": 0.8}):
        renderer = Renderer(Scene.from_spheres(CAMERA, LIGHTS, **values, **given), device, outputs=OUTPUTS)
        renderer.update(kd=0.25)
        same(renderer, Scene.from_spheres(CAMERA, LIGHTS, **values, **given, kd=0.25))
        assert pickle.loads(pickle.dumps(renderer.scene)).materials["ka"].tolist() == [0.8 if given else 0.25] * 5


def test_what_look_made_stays_as_it_is(device: Device) -> None:
    values = spheres(300)
    scene, camera = Scene.from_spheres(CAMERA, LIGHTS, **values), replace(CAMERA, position=(9, 3, 4))
    renderer = Renderer(scene, device, outputs=OUTPUTS)
    other = renderer.look(camera)
    changed = spheres(300, seed=1)
    renderer.update(**changed)
    same(other, scene.seen_by(camera))
    same(renderer, Scene.from_spheres(CAMERA, LIGHTS, **changed))
    other.update(colors=(1.0, 0.0, 0.0))
    same(renderer, Scene.from_spheres(CAMERA, LIGHTS, **changed))
    same(other, Scene.from_spheres(camera, LIGHTS, **{**values, "colors": (1.0, 0.0, 0.0)}))
    del renderer
    gc.collect()
    same(other.update(radii=0.2), Scene.from_spheres(camera, LIGHTS, values["centers"], 0.2, (1.0, 0.0, 0.0)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_scenes_of_files_and_ellipsoids(device: Device, seed: int) -> None:
    """Shared materials, maps and meshes stay; the same scene of records is drawn alike."""
    scene = random_scene(seed)
    n, rng = len(scene.spheres), np.random.default_rng(seed)
    renderer = Renderer(scene, device, outputs=OUTPUTS)
    balls, shades = scene.spheres.copy(), scene.materials[scene.spheres["material"]]
    balls["center"] += rng.uniform(-0.1, 0.1, (n, 3))
    balls["radius"] *= rng.uniform(0.9, 1.1, n)
    renderer.update(balls["center"], balls["radius"])
    same(renderer, replace(scene, spheres=balls))
    shades["color"] = rng.uniform(0, 1, (n, 3))
    renderer.update(colors=shades["color"])
    if not scene.meshes:
        balls["material"] = np.arange(n)
        same(renderer, replace(scene, spheres=balls, materials=shades))


@pytest.mark.slow
@pytest.mark.parametrize("changed", ["maps", "which sphere has which"])
@pytest.mark.parametrize("reflectance", [0.5, pytest.param(0.0, marks=pytest.mark.slow)])
def test_other_ellipsoids_in_the_same_places(device: Device, changed: str, reflectance: float) -> None:
    """Scenes that share centres and radii but not their linear maps, seen by the same camera and by another."""
    flat, long = np.diag([1.0, 0.4, 0.7]), np.diag([0.3, 1.6, 1.2])
    values = spheres(12) | {"reflectance": reflectance}
    scene = Scene.from_spheres(CAMERA, LIGHTS, **values, transform=[flat, long] * 6)
    other = scene.changed(to_object=np.ascontiguousarray(scene.to_object.transpose(0, 2, 1) * (2.0, 1.0, 0.5)))
    if changed != "maps":
        columns = replace(scene.columns, to_object=scene.columns.to_object[::-1].copy())
        other = scene.with_fields(columns=columns)
    assert other.columns.center is scene.columns.center
    first = Renderer(scene, device, outputs=OUTPUTS)
    assert not np.array_equal(first.following(other).render().normal, first.render().normal)
    camera = replace(CAMERA, position=(9, 3, 4))
    for following in (other, other.seen_by(camera), scene):
        same(first.following(following), following)


def test_an_order_is_kept_while_it_is_good(device: Device) -> None:
    values = spheres(6000)
    renderer = Renderer(Scene.from_spheres(CAMERA, LIGHTS, **values), device, outputs=OUTPUTS)
    first = renderer._now.world.of_shape(SpherePacking).row
    start, rng = values["centers"], np.random.default_rng(0)
    shaken = start * 3 + 0.001 * rng.uniform(-1, 1, (6000, 3))
    for centers, kept in ((shaken, True), (-shaken / 3, True), (rng.permuted(start, axis=0), False)):
        same(renderer.update(centers), Scene.from_spheres(CAMERA, LIGHTS, **values | {"centers": centers}))
        assert (renderer._now.world.of_shape(SpherePacking).row is first) == kept


def test_of_spheres_that_come_to_be_equal_the_first_is_seen(device: Device) -> None:
    """Also where the order in memory is another one."""
    rng = np.random.default_rng(3)
    n = 5000
    values = spheres(n)
    renderer = Renderer(Scene.from_spheres(CAMERA, LIGHTS, **values), device, outputs=OUTPUTS)
    pairs = rng.permutation(n)[: n // 50].reshape(-1, 2)
    order = renderer._now.world.of_shape(SpherePacking).row
    near = np.stack([order[:-1], order[1:]], axis=1)[::5]
    for one, other in (*pairs, *near):
        values["centers"][one], values["radii"][one] = values["centers"][other], values["radii"][other]
    renderer.update(values["centers"], values["radii"])
    assert renderer._now.world.of_shape(SpherePacking).row is order
    assert renderer._now.world.of_shape(SpherePacking).again.sum() > n // 8
    same(renderer, Scene.from_spheres(CAMERA, LIGHTS, **values))


@pytest.mark.parametrize(
    ("more", "changed", "message"),
    [
        ({}, {"centers": [(0, 0, 0)] * 3}, "radii: must be given, too, where there are 3 centers instead of 4"),
        ({}, THREE, "colors: must be given, too, where there are 3 centers instead of 4"),
        (BY_VALUES, THREE, "values: must be given, too, where there are 3 centers instead of 4"),
        ({}, {"radii": [1, 2, 3]}, "radii: must have shape (4,) or be one value, got (3,)"),
        ({}, {"colors": [(1, 1, 1), (1, 1, -1)] * 2}, "colors[1][2]: must be >= 0, got -1"),
        ({}, {"transmittance": 0.5, "index": 0}, "index: must be > 0 where transmittance > 0, got 0"),
        (BENT, spheres(3), "centers: must be 4, as ellipsoids keep their shapes, got 3"),
        (BENT, {"radii": 3e38}, "radii[0]: half of the extent along y must not exceed 3.4e38"),
    ],
)
def test_bad_arguments_change_nothing(more: Any, changed: Any, message: str) -> None:
    scene = Scene.from_spheres(CAMERA, LIGHTS, **spheres(4) | more)
    renderer = Renderer(scene, outputs=("id",))
    state = dict(renderer.__dict__)
    with pytest.raises(ValueError) as caught:
        renderer.update(**changed)
    assert str(caught.value).startswith(message)
    assert renderer.__dict__ == state


@pytest.mark.slow
def test_meshes_between_spheres_keep_their_number(device: Device) -> None:
    scene = Scene.from_spheres(CAMERA, LIGHTS, **spheres(4), meshes=TRIANGLE)
    mesh = scene.meshes[0]
    between = replace(scene, meshes=[mesh.of(mesh.material, 2)])
    with pytest.raises(ValueError, match=r"^centers: must be 4, as there are meshes between the spheres, got 3$"):
        Renderer(between, device).update(**spheres(3))
    balls = between.spheres.copy()
    balls["radius"] = 0.5
    same(Renderer(between, device, outputs=OUTPUTS).update(radii=0.5), replace(between, spheres=balls))


def test_images_are_drawn_again_after_an_update(device: Device) -> None:
    values = spheres(50)
    renderer = Renderer(Scene.from_spheres(CAMERA, LIGHTS, **values), device)
    image = renderer.render()
    data, before = image.rgb8, image.rgb8.copy()
    again = renderer.update(colors=(1.0, 0.0, 0.0)).render(image)
    assert np.shares_memory(again.rgb8, data)
    assert np.array_equal(again.rgb8, cltrace.render(renderer.scene, device).rgb8)
    assert not np.array_equal(again.rgb8, before)
    with pytest.raises(ValueError, match="out: must be an image that this Renderer has rendered"):
        renderer.look(CAMERA).render(image)


def test_threads_see_one_state_or_the_other(device: Device) -> None:
    values = spheres(200)
    renderer = Renderer(Scene.from_spheres(CAMERA, LIGHTS, **values), device)
    colors = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    wanted = [cltrace.render(Scene.from_spheres(CAMERA, LIGHTS, **values | {"colors": c}), device).rgb8 for c in colors]
    renderer.update(colors=colors[0])

    def draw() -> list[Any]:
        return [renderer.render().rgb8 for _ in range(20)]

    def change(first: int) -> None:
        for k in range(10):
            renderer.update(colors=colors[(first + k) % 3])

    with ThreadPoolExecutor(4) as pool:
        drawn, changed = [pool.submit(draw) for _ in range(2)], [pool.submit(change, k) for k in range(2)]
    for picture in (picture for job in drawn for picture in job.result()):
        assert any(np.array_equal(picture, want) for want in wanted)
    assert [job.result() for job in changed] == [None, None]


def test_fronts_of_triangles_are_known_where_rays_go_on() -> None:
    """They are not looked for in a scene of opaque surfaces; where a sphere becomes glass, they are."""
    backwards = Mesh([(-3, -3, -3), (3, -3, -3), (0, -3, 3)], [(0, 2, 1)], normals=np.full((3, 3), (0, -1, 0)))
    opaque = Scene.from_spheres(CAMERA, LIGHTS, **spheres(3), meshes=[backwards, TRIANGLE])
    glass, request = with_spheres(opaque, {"transmittance": 0.5, "index": 1.5}), Request("accurate", ("rgb8",))
    world = ScenePacking.of(opaque, request)
    assert world.of_shape(MeshPacking).triangles.face[:, 3].tolist() == [0, 2]
    for before in (None, Before(opaque, world)):
        assert ScenePacking.of(glass, request, before).of_shape(MeshPacking).triangles.face[:, 3].tolist() == [1, 2]
