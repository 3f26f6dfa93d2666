"""What parallel lights see is made once for cameras that follow each other: no bit of a picture tells."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from device_views import LIGHTS, Gpu

import cltrace
from cltrace import Camera, Mesh, Orthographic, Scene
from cltrace.picture.image import Output
from cltrace.run.devices import Device
from cltrace.scene import AnyCamera

pytestmark = pytest.mark.usefixtures("even_few_are_packed")

OUTPUTS: tuple[Output, ...] = ("rgb8", "color", "id", "depth")
SIZE = (97, 61)
SUN = [cltrace.ambient_light(), cltrace.sun_light((-1, -2, -0.5), (0.6, 0.6, 0.6), 30, directions=5)]
# Of the third and the fourth one, lengths may have another unit.
CAMERAS: list[AnyCamera] = [
    Camera((0.1, 0.21, 3.0), (0, 0, 0), (0, 1, 0), 50, SIZE),
    Camera((3, 2, -1), (0.1, 0, 0), (0.3, 1, 0), 60, SIZE),
    Camera((0.02, -0.1, 0.3), (0.1, 0, -1), (0, 0.2, 1), 80, SIZE),
    Camera((70, 0, 90), (0, 0, 0), (0, 1, 0), 2, SIZE),
    Camera((-2, 2, 1), (0, 0, 0), (0, 1, 0.1), 50, SIZE),
    Camera((-2.1, 2, 1.3), (0, 0, 0), (0, 1, 0.1), 50, SIZE),
]
ALONG: list[AnyCamera] = [
    Orthographic((0.1, 0.2, 3.0), (0, 0, 0), height=2.5, resolution=SIZE),
    Orthographic((1.1, 2.2, 3.0), (0, 0.1, 0), height=2.5, resolution=SIZE),
    Orthographic((1.1, 0.3, 0.1), (0, 0.1, 0), height=1.5, resolution=SIZE),
    Orthographic((2.1, -0.3, 0.2), (0, 0.1, 0), height=1.5, resolution=SIZE),
]


def balls(lights: object, size: float = 0.1, shift: float = 0, **more: object) -> Scene:
    rng = np.random.default_rng(1)
    centers, radii = rng.uniform(-1, 1, (300, 3)) + shift, rng.uniform(0.1, 1, 300) * size
    return Scene.from_spheres(CAMERAS[0], lights, centers, radii, **more)  # type: ignore[arg-type]


def soup() -> Mesh:
    rng = np.random.default_rng(2)
    corners = rng.uniform(-1, 1, (301, 1, 3)) + rng.normal(size=(301, 3, 3)) * 0.2
    return Mesh(corners.reshape(-1, 3), np.arange(903).reshape(-1, 3))


def all_shapes(lights: object) -> Scene:
    rng = np.random.default_rng(3)
    maps = np.where(rng.random(300)[:, None, None] < 0.3, rng.normal(size=(300, 3, 3)), np.eye(3))
    starts = rng.uniform(-1, 1, (40, 3))
    scene = balls(lights, meshes=soup(), transform=maps)
    return scene.with_cylinders(starts, starts + rng.normal(size=(40, 3)) * 0.4, 0.05)


SCENES: dict[str, Callable[[], Scene]] = {
    "balls": lambda: balls(SUN),
    "balls around the eye": lambda: balls(SUN, 4.0),
    "balls, points, too": lambda: balls([*SUN, *LIGHTS[1:]]),
    "mirrors": lambda: balls(SUN, reflectance=0.4),
    "triangles": lambda: Scene.from_meshes(CAMERAS[0], SUN, soup()),
    "triangles, points, too": lambda: Scene.from_meshes(CAMERAS[0], [*SUN, *LIGHTS[1:]], soup()),
    "all": lambda: all_shapes(SUN),
    "all, points, too": lambda: all_shapes([*SUN, *LIGHTS[1:]]),
    "balls and bonds": lambda: balls(SUN, bonds=[(k, k + 1) for k in range(299)], bond_radius=0.01),
}
FEW = ("balls, points, too", "all, points, too")


def check(renderer: cltrace.Renderer, by: AnyCamera) -> cltrace.Renderer:
    """Asserts that another camera's picture is that of a renderer that knows nothing, and returns its renderer."""
    moved = renderer.look(by)
    fresh = cltrace.Renderer(moved.scene, renderer.device, renderer.precision, OUTPUTS)
    found, expected = moved.render(), fresh.render()
    for name in OUTPUTS:
        assert getattr(found, name).tobytes() == getattr(expected, name).tobytes(), (by, name)
    return moved


def knows(moved: cltrace.Renderer) -> bool:
    """Whether what its parallel lights see was made from where another camera is."""
    return bool(moved.plan.arrays["light"]["axis"][0, 3] or moved.plan.arrays["light"]["across"][0, 3])


@pytest.mark.parametrize("cameras", [CAMERAS, pytest.param(ALONG, marks=pytest.mark.slow)], ids=["point", "along"])
@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n == FEW[1] else pytest.mark.slow) for n in SCENES])
def test_pictures(device: Device, name: str, cameras: list[AnyCamera]) -> None:
    renderer, known = cltrace.Renderer(SCENES[name]().seen_by(cameras[0]), device, outputs=OUTPUTS), 0
    for by in (*cameras[1:], cameras[0]):
        known += knows(renderer := check(renderer, by))
    assert known > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", FEW)
def test_pictures_in_single_and_on_a_gpu(device: Device, name: str) -> None:
    """In single, each camera has its own."""
    for kind, precision in ((Device, "single"), (Gpu, "accurate")):
        at = kind(device.spec, device.cl)
        renderer = cltrace.Renderer(SCENES[name](), at, precision, OUTPUTS)  # type: ignore[arg-type]
        for by in CAMERAS[:3]:
            renderer = check(renderer, by)
            assert precision == "accurate" or not knows(renderer)


def test_what_moves_is_seen_anew(device: Device) -> None:
    """And renderers that others were made from draw what they did."""
    first = cltrace.Renderer(SCENES[FEW[1]](), device, outputs=OUTPUTS)
    before, second = first.render(), check(first, CAMERAS[1])
    third = check(second, CAMERAS[4])
    assert knows(third)
    third.update(colors=np.random.default_rng(4).uniform(0, 1, (300, 3)))
    check(third, CAMERAS[5])
    third.update(centers=third.scene.spheres["center"] * 0.9)
    assert not knows(third)
    check(check(third, CAMERAS[1]), CAMERAS[4])
    assert first.render().rgb8.tobytes() == before.rgb8.tobytes()
