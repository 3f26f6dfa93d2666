"""What pixels show in the hostile regimes of all shapes: the kernel against the exact oracle; no excused band."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hostile import cylinder_regimes, mesh_regimes, parallel_regimes
from hostile.mesh_regimes import CLOSED
from hostile.sphere_regimes import EDGES, REGIMES, most_digits
from stress_cases import picture, wrong_hits, wrong_pixels

from cltrace import Camera, Material, Mesh, Orthographic, Scene
from cltrace.run.devices import Device

SPHERES = dict(REGIMES + EDGES) | {"the most digits": most_digits}
# Programs of meshes take long to compile, and so do those of other shapes than spheres before parallel rays.
LATER = {"cut by the plane", "triangles", "ellipsoids", "the most digits", *mesh_regimes.REGIMES}
SEEDS = {"edges": 40, "cut by the plane": 12, "the most digits": 9}
REGIMES_OF = {
    "spheres": SPHERES,
    "cylinders": cylinder_regimes.REGIMES,
    "meshes": mesh_regimes.REGIMES,
    "parallel rays": parallel_regimes.REGIMES,
}
CASES = [(shape, name) for shape, regimes in REGIMES_OF.items() for name in regimes]


def scene_of(shape: str, name: str, seed: int, side: int) -> Scene:
    """side: of a picture, pixels; a regime may have its own size."""
    if shape == "spheres":
        return SPHERES[name](seed) if name == "the most digits" else SPHERES[name](seed, size=(side, side))
    if shape == "parallel rays":
        return parallel_regimes.scene_of(name, seed)
    if shape == "meshes":
        return mesh_regimes.scene_of(name, seed, (side // 2, side // 2))
    return cylinder_regimes.scene_of(name, seed, (5, 3) if name == "edges" else (side // 2, side // 3))


def marks(shape: str, name: str, precision: str, number: int) -> list[pytest.MarkDecorator]:
    """double leaves out the filter, and that is all: some regimes are enough for it."""
    if precision == "double" and number % 4:
        return [pytest.mark.stress]
    is_slow = shape != "spheres" and (name in LATER or precision == "double")
    return [pytest.mark.slow] if is_slow else []


@pytest.mark.parametrize(
    ("shape", "name", "precision"),
    [
        pytest.param(*case, precision, marks=marks(*case, precision, k))
        for precision in ("accurate", "double")
        for k, case in enumerate(CASES)
    ],
)
def test_regime(device: Device, shape: str, name: str, precision: str) -> None:
    for seed in range(SEEDS.get(name, 6 if shape == "parallel rays" else 2)):
        scene = scene_of(shape, name, seed, 64)
        assert wrong_hits(scene, picture(scene, device, precision)) == [], seed


@pytest.mark.slow
@pytest.mark.parametrize(("shape", "name"), CASES[::3])
def test_regime_one_by_one(device: Device, shape: str, name: str) -> None:
    """In packets of one pixel, as GPUs get them."""
    scene = scene_of(shape, name, 1, 64)
    assert wrong_hits(scene, picture(scene, device, width=1)) == []


@pytest.mark.stress
@pytest.mark.parametrize(("shape", "name"), CASES)
def test_regime_with_many_rays(device: Device, shape: str, name: str) -> None:
    for seed in range(12):
        scene = scene_of(shape, name, seed, 256)
        assert wrong_hits(scene, picture(scene, device)) == [], seed


@pytest.mark.parametrize("name", [name for name, _ in EDGES])
def test_edges_to_the_bit(device: Device, width: int, name: str) -> None:
    """The same distances as the reference's, whose discriminants are exact where they are in doubt."""
    for seed in range(2):
        scene = SPHERES[name](seed, size=(33, 5) if seed % 2 == 0 else (5, 33))
        assert wrong_pixels(scene, picture(scene, device, width=width)) == []


@pytest.mark.parametrize(
    ("parallel", "precision"),
    [
        pytest.param(False, "accurate", id="perspective-accurate"),
        pytest.param(False, "double", id="perspective-double"),
        pytest.param(True, "accurate", id="parallel-accurate"),
        pytest.param(True, "double", id="parallel-double", marks=pytest.mark.slow),
    ],
)
def test_a_ray_that_touches_hits(device: Device, parallel: bool, precision: str) -> None:
    """Spheres at decimal places that the middle ray touches, alone and with something far away in the scene. Beside it
    by an ulp, it misses."""
    camera = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 45, (3, 3), square_pixels=False)
    camera = Orthographic(height=3, resolution=(3, 3)) if parallel else camera
    for number in range(60 if precision == "accurate" else 6):
        # The literal case first; then of one to six decimals.
        z = 2.3 if number == 0 else round(9 * (number * 0.6180339887498949 % 1) + 2.2, number % 6 + 1)
        r = (1, 0.1, 0.3, 0.5, 0.7, 2)[number % 6]
        for more in ([], [(1e14, 0, -5)]):
            for x, hit in ((r, 0), (np.nextafter(r, 9), -1)):
                scene = Scene.from_spheres(camera, [], [(x, 0, -z), *more], [r, *[1.0] * len(more)])
                image = picture(scene, device, precision)
                assert image.id[1, 1] == hit, (z, r, more)
                assert hit < 0 or abs(image.depth[1, 1] / z - 1) <= 2.0**-52, (z, r, more)


@pytest.mark.parametrize("parallel", [False, True], ids=["perspective", "parallel"])
def test_which_sphere_is_nearer_by_less_than_pairs_of_doubles_can_tell(device: Device, parallel: bool) -> None:
    """The nearer one, which is met at 5 - sqrt(1 - x^2), has the higher number."""
    camera = Orthographic(height=3, resolution=(3, 3)) if parallel else Camera((0, 0, 0), (0, 0, -1), resolution=(3, 3))
    for k in (20, 40, 60, 100, 140):
        for far in ((2.0**-k, 0), (0, 2.0**-k)):
            scene = Scene.from_spheres(camera, [], [(*far, -5), (0, 2.0 ** -(k + 1), -5)], 1)
            assert picture(scene, device).id[1, 1] == 1, k


def test_parallel_rays_that_touch_hit_in_single(device: Device) -> None:
    """Where all numbers are whole, nothing is rounded."""
    camera = Orthographic(height=3, resolution=(3, 3))
    for r in (1.0, 2.0, 5.0):
        for x, hit in ((r, 0), (-r, 0), (float(np.nextafter(np.float32(r), np.float32(9))), -1)):
            assert picture(Scene.from_spheres(camera, [], [(x, 0, -20)], r), device, "single").id[1, 1] == hit


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in CLOSED if name != "pillars"])
def test_what_goes_into_a_closed_mesh_comes_out_again(device: Device, name: str) -> None:
    """Each triangle is of glass that bends nothing and halves what is behind it: the colour tells how many are met.

    Each is where a ray starts anew, from a point in it. Pillars cover each other in one plane, in which a ray meets the
    first one only.
    """
    plain, glass = mesh_regimes.scene_of(name, 0), Material((0, 0, 0), ka=0, kd=0, ks=0, transmittance=0.5, index=1)
    meshes = [Mesh(mesh.vertices, mesh.geometry.faces, material=glass) for mesh in plain.meshes]
    scene = Scene.from_meshes(replace(plain.camera, max_bounces=100), [], meshes, background=(1, 1, 1))
    color = picture(scene, device).color[..., 0]
    count = -np.log2(color)
    assert count.max() >= 2
    assert (count % 2 == 0).all()
