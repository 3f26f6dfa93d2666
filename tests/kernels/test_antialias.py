"""Proved means: every colour is within its bound of what many rays say, and is no worse than the samples' own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from solids import ball, box, mesh, octahedron, smooth

import cltrace
from cltrace.run.devices import Device

SCENES = Path(__file__).parents[2] / "scenes"
SIZE = (20, 14)
OUTPUTS = ("rgb8", "color", "error", "coverage")
Colors = NDArray[np.float64]


def proved(scene: cltrace.Scene, device: Device, antialias: object = "proved", **how: object) -> cltrace.Renderer:
    """By a kernel that has the code for all features, which serves many scenes. Else each would have one to compile."""
    given = {"outputs": OUTPUTS, "keep": ("features",)} | how
    return cltrace.Renderer(scene, device, antialias=antialias, **given)  # type: ignore[arg-type]


def truth(scene: cltrace.Scene, device: Device, n: int, crop: tuple[int, int, int, int]) -> Colors:
    """(h, w, 3): means of min(colour, 1) over n x n rays through each pixel of a crop, which are pixels' middles."""
    width, height = scene.camera.resolution
    larger = scene.seen_by(replace(scene.camera, resolution=(width * n, height * n)))
    x0, y0, x1, y1 = (n * edge for edge in crop)
    how = {"outputs": ("color",), "crop": (x0, y0, x1, y1), "keep": ("features",)}
    color = cltrace.Renderer(larger, device, **how).render().color  # type: ignore[arg-type]
    parts = np.minimum(color.astype(np.float64), 1).reshape(crop[3] - crop[1], n, crop[2] - crop[0], n, 3)
    return np.asarray(parts.mean(axis=(1, 3)))


def distances(
    scene: cltrace.Scene, device: Device, image: cltrace.Image, bounded: NDArray[np.bool_] | bool = True
) -> Colors:
    """(h, w): how far each mean is from the truth, in levels: the largest of red, green and blue.

    bounded: (h, w), of which pixels the error is a bound.

    The truth itself is off where an edge runs along its rays' columns or rows: with n rays a side by up to half a ray's
    share for each edge, 128 / n levels. Where the two differ by more than a bound, 512 rays a side decide.
    """
    width, height = scene.camera.resolution
    off = 255 * np.abs(image.color - truth(scene, device, 64, (0, 0, width, height))).max(axis=2)
    for y, x in np.argwhere((off > image.error) & bounded):
        finer = truth(scene, device, 512, (x, y, x + 1, y + 1))[0, 0]
        off[y, x] = max(0, 255 * np.abs(image.color[y, x] - finer).max() - 128 / 512)
    assert np.abs(image.rgb8 / 255 - image.color).max() <= 0.5001 / 255
    return np.asarray(off)


def assert_within(scene: cltrace.Scene, device: Device, image: cltrace.Image) -> None:
    """No mean is further from the truth than `error`."""
    assert np.argwhere(distances(scene, device, image) > image.error).tolist() == []


def seen(name: str) -> cltrace.Scene:
    scene = cltrace.load(SCENES / name)
    return scene.seen_by(replace(scene.camera, resolution=SIZE))


def lit(centers: object, radii: object, *lights: np.ndarray, **materials: object) -> cltrace.Scene:
    """Spheres before a dark sky."""
    camera = cltrace.Camera((0, 0, 0), (0, 0, -1), horizontal_fov=25, resolution=SIZE)
    some = lights or (cltrace.parallel_light((1, -2, -1.5), (0.9, 0.8, 0.7)),)
    every = [cltrace.ambient_light((0.5, 0.5, 0.5)), *some]
    given = {"colors": (0.8, 0.6, 0.4), "ks": 0.3} | materials
    return cltrace.Scene.from_spheres(camera, every, centers, radii, background=(0.1, 0.1, 0.3), **given)


def cloud(seed: int, n: int, smallest: float, largest: float) -> tuple[Colors, Colors]:
    """Centres and radii of spheres within sight."""
    random = np.random.default_rng(seed)
    z = -random.uniform(3, 9, n)
    across = random.uniform(-0.45, 0.45, (n, 2)) * -z[:, None]
    return np.column_stack([across, z]), random.uniform(smallest, largest, n)


def joined(*clouds: tuple[Colors, Colors]) -> tuple[Colors, Colors]:
    centers, radii = zip(*clouds, strict=True)
    return np.concatenate(centers), np.concatenate(radii)


HOSTILE = {
    "crossing": lambda: lit([(-0.3, 0, -5), (0.4, 0.1, -5.1), (0, 0.5, -4.8)], [0.7, 0.6, 0.4]),
    "behind edges": lambda: lit([(0, 0, -4), (0.99, 0, -6), (-0.5, 0.9, -5)], [0.6, 0.4, 0.5]),
    "shadow rims": lambda: lit(
        [(0, -101, -6), (0, 0.3, -5), (0.8, 0, -6), (-0.8, -0.4, -5)],
        [100, 0.4, 0.3, 0.2],
        cltrace.point_light((2, 4, -3)),
        cltrace.parallel_light((3, -2, -1), (0.4, 0.4, 0.6)),
    ),
    "cones": lambda: lit(
        [(0, -101, -6), (0, 0.2, -5)],
        [100, 0.5],
        cltrace.spot_light((0.5, 3, -4), (-0.1, -1, -0.2), 10, 16),
        cltrace.spot_light((-2, 3, -5), (0.6, -1, 0), 12, 12, (1, 0.3, 0.2)),
    ),
    "inside": lambda: lit([(0, 0, 0), (0.5, 0, -4)], [8, 0.7], cltrace.point_light((1, 2, 0))),
    "bright": lambda: lit([(0, 0, -4)], [1.2], cltrace.parallel_light((0, 0, -1), (2.5, 2, 1)), ks=1.0, exponent=8),
    "sharp": lambda: lit([(0, 0, -4)], [1.2], cltrace.point_light((1, 1, 0)), ks=0.9, exponent=900),
    "small": lambda: lit(*cloud(1, 200, 0.02, 0.1)),
    "tiny": lambda: lit(*cloud(2, 300, 0.001, 0.004)),
    "large and small": lambda: lit(
        *map(np.concatenate, zip(cloud(3, 6, 0.4, 0.8), cloud(4, 60, 0.01, 0.1), strict=True))
    ),
}


EGG = np.array([[0.5, 0.6, -0.2], [-0.3, 0.5, 0.4], [0.2, -0.1, 0.6]])
HOSTILE |= {
    "crossing eggs": lambda: lit(
        [(-0.3, 0, -8), (0.4, 0.1, -8.1), (0, 0.5, -7.8)],
        [1.0, 0.9, 0.6],
        cltrace.point_light((2, 4, -3)),
        transform=EGG,
    ),
    "small eggs": lambda: lit(*cloud(1, 100, 0.02, 0.1), transform=EGG),
    "in an egg": lambda: lit([(0, 0, 0), (0.5, 0, -4)], [30, 0.7], cltrace.point_light((1, 2, 0)), transform=EGG),
}
MATERIAL = cltrace.Material((0.5, 0.7, 0.8), ka=0.3, kd=0.7, ks=0.3, exponent=20)
CORNERS = [(-9, -0.8, -2), (9, -0.8, -2), (9, -0.8, -20), (-9, -0.8, -20)]
FLOOR = cltrace.Mesh(CORNERS, [(0, 1, 2), (0, 2, 3)], material=MATERIAL)
LAMP = cltrace.point_light((2, 4, -3))


def triangles(seed: int, n: int, size: float) -> cltrace.Mesh:
    """Triangles apart from each other, within sight."""
    places, _ = cloud(seed, n, 0, 1)
    vertices = places[:, None] + size * np.random.default_rng(seed).normal(size=(n, 3, 3))
    return cltrace.Mesh(vertices.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3), material=MATERIAL)


def meshed(
    meshes: list[cltrace.Mesh], *lights: np.ndarray, spheres: Colors | None = None, **materials: object
) -> cltrace.Scene:
    """Meshes, and spheres of rows (x, y, z, radius), before a dark sky."""
    given = np.zeros((0, 4)) if spheres is None else spheres
    return lit(given[:, :3], given[:, 3], *lights, meshes=meshes, **materials)


ESTIMATED = {
    "box": lambda: meshed(
        [mesh(box().moved((0.2, 0.1, -6)), material=MATERIAL), FLOOR], LAMP, spheres=np.array([(0.5, 0.2, -4, 0.3)])
    ),
    "facets": lambda: meshed([mesh(ball(2).moved((0, 0, -5)), material=MATERIAL), FLOOR], LAMP),
    "smooth": lambda: meshed([smooth(ball(1).moved((0, 0, -5)), material=MATERIAL), FLOOR], LAMP),
    "crossing meshes": lambda: meshed(
        [
            mesh(solid, material=MATERIAL)
            for solid in (octahedron().moved((0, 0, -5)), box().moved((0.5, 0.5, -5), 0.7))
        ],
        spheres=np.array([(-0.3, -0.3, -4.5, 0.6)]),
    ),
    "triangles": lambda: meshed([triangles(1, 40, 0.3), FLOOR], LAMP),
    "tiny triangles": lambda: meshed([triangles(2, 300, 0.02)], LAMP),
    "in a box": lambda: meshed(
        [mesh(box((-3, -2, -9), (3, 2, 1)).flipped(), material=MATERIAL)],
        cltrace.point_light((0, 1, -4)),
        spheres=np.array([(0.3, -0.5, -5, 0.6)]),
    ),
    "a cone on a mesh": lambda: meshed(
        [mesh(octahedron().moved((0, 0.3, -6)), material=MATERIAL), FLOOR],
        cltrace.spot_light((0, 3, -4), (0, -1, -0.5), 12, 20),
    ),
}
IMAGE = np.random.default_rng(7).integers(60, 200, (5, 8, 3)).astype(np.uint8)
PAINTED = cltrace.Material((0.9, 0.8, 0.7), ka=0.5, kd=0.6, ks=0.2, exponent=20, texture=IMAGE)


def globes() -> cltrace.Scene:
    """A sphere and an ellipsoid with a texture."""
    spheres, materials = np.zeros(2, cltrace.scene.SPHERE), np.zeros(1, cltrace.scene.MATERIAL)
    spheres["center"], spheres["radius"], spheres["to_object"] = [(-0.5, 0, -5), (0.7, 0.1, -5)], [0.7, 0.5], [-1, 0]
    materials["color"] = materials["ka"] = materials["index"] = 1
    materials["kd"] = 0.5
    scene = lit([(0, 0, -9)], [1.0])
    lights = [cltrace.ambient_light((0.4, 0.4, 0.4)), LAMP]
    maps = np.linalg.inv(EGG)[None]
    return cltrace.Scene(scene.camera, lights, spheres, materials, to_object=maps, textures=(IMAGE,))


NOISE = np.random.default_rng(8).integers(0, 65536, (37, 53, 3)).astype(np.uint16)


def papered(texels: float, *lights: np.ndarray) -> cltrace.Scene:
    """A wall of noise, so many texels a pixel, which lean by some 20 degrees, and a ball that shadows it."""
    corners = np.array([(-3, -2), (3, -2), (3, 2), (-3, 2)])
    uv = corners @ np.array([[0.93, -0.36], [0.36, 0.93]]) * (texels * SIZE[0] / 2.2 / 53)
    material = replace(PAINTED, texture=NOISE)
    wall = cltrace.Mesh(np.column_stack([corners, np.full(4, -5)]), [(0, 1, 2), (0, 2, 3)], uv=uv, material=material)
    return meshed([wall], *(lights or (LAMP,)), spheres=np.array([(0.2, 0.1, -4.2, 0.2)]))


ESTIMATED |= {
    "globes": globes,
    "large texels": lambda: papered(0.3),
    "small texels": lambda: papered(2.5, cltrace.spot_light((0.5, 1, -3), (-0.2, -0.5, -1), 10, 10), LAMP),
    "tiny texels": lambda: papered(20),
    "painted": lambda: meshed(
        [cltrace.Mesh(CORNERS, [(0, 1, 2), (0, 2, 3)], uv=[(0, 0), (3, 0), (3, 2), (0, 2)], material=PAINTED)],
        LAMP,
        spheres=np.array([(0.3, -0.2, -6, 0.5)]),
    ),
}
# As an orthographic camera sees them.
HOSTILE |= {
    f"{name}, parallel": lambda name=name: parallel(HOSTILE[name]())  # type: ignore[misc]
    for name in ("crossing", "shadow rims", "cones", "tiny", "crossing eggs")
}
ESTIMATED |= {
    f"{name}, parallel": lambda name=name: parallel(ESTIMATED[name]())  # type: ignore[misc]
    for name in ("box", "triangles", "small texels")
}


CHECKS = cltrace.Material(
    (1, 1, 1), ka=0.5, kd=0.6, ks=0, texture=np.eye(2, dtype=np.uint8)[..., None].repeat(3, 2) * 200
)
ESTIMATED |= {
    # A mirror and an opaque sphere cross before another mirror.
    "mirrors": lambda: lit(
        [(-0.4, 0, -4), (0.3, 0.1, -4.2), (0.2, -30.6, -8), (0.6, 0.5, -4.5)],
        [0.5, 0.4, 30, 0.25],
        LAMP,
        reflectance=[0.8, 0.0, 0.5, 0.4],
    ),
    "glass": lambda: lit(
        [(-0.4, 0, -4), (0.4, 0.1, -4.2), (0, 0, -6)],
        [0.5, 0.4, 0.8],
        LAMP,
        reflectance=[0.1, 0.3, 0],
        transmittance=[0.8, 0.3, 0],
        index=[1.5, 1.2, 1],
    ),
    # A checked floor, a box and a sphere.
    "mirror over checks": lambda: meshed(
        [
            cltrace.Mesh(CORNERS, [(0, 1, 2), (0, 2, 3)], uv=[(0, 0), (9, 0), (9, 9), (0, 9)], material=CHECKS),
            mesh(box().moved((0.9, 0.1, -6)), material=replace(MATERIAL, reflectance=0.5)),
        ],
        LAMP,
        spheres=np.array([(-0.3, 0, -4.5, 0.6)]),
        reflectance=0.8,
    ),
}


def parallel(scene: cltrace.Scene) -> cltrace.Scene:
    """The same scene as an orthographic camera sees it, from the middle of its nearest sphere."""
    return scene.seen_by(cltrace.Orthographic((0, 0, -4.5), (0, 0, -9), height=2.5, resolution=SIZE))


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_scenes(device: Device, name: str) -> None:
    scene = HOSTILE[name]()
    renderer = proved(scene, device)
    assert_within(scene, device, renderer.render())
    assert renderer.work()["pixels of which the error is an estimate"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ESTIMATED)
def test_estimates(device: Device, name: str) -> None:
    """Where a triangle, a texture, a mirror or glass may be in a pixel, or stops light, that has the samples' own bits
    and their estimate; of all other pixels the bound holds."""
    scene = ESTIMATED[name]()
    renderer, samples = proved(scene, device), proved(scene, device, True)
    image, sampled = renderer.render(), samples.render()
    same = (image.color == sampled.color).all(axis=2) & (image.error == sampled.error)
    off = distances(scene, device, image, ~same)
    assert np.argwhere((off > image.error) & ~same).tolist() == []
    assert 0 < renderer.work()["pixels of which the error is an estimate"] <= same.sum()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first.xml", "thousand.xml", "crossing", "large and small", "small eggs"])
def test_no_worse_than_samples(any_device: Device, name: str) -> None:
    scene = seen(name) if name.endswith(".xml") else HOSTILE[name]()
    exact = truth(scene, any_device, 32, (0, 0, *SIZE))
    off = [
        np.sqrt(np.mean((cltrace.render(scene, any_device, outputs=OUTPUTS, antialias=how).color - exact) ** 2))
        for how in ("proved", True)
    ]
    assert off[0] <= off[1]


@pytest.mark.slow
def test_a_black_tube(any_device: Device) -> None:
    """64 triangles before white, as parallel rays see them from aslant: edges are nowhere smeared over pixels."""
    angle = np.arange(32) * np.pi / 16
    ring = np.column_stack([np.cos(angle), np.sin(angle)]) * 0.3
    vertices = np.concatenate([np.column_stack([ring, np.full(32, z)]) for z in (-0.5, 0.5)])
    sides = [(i, (i + 1) % 32) for i in range(32)]
    faces = [(i, j, j + 32) for i, j in sides] + [(i, j + 32, i + 32) for i, j in sides]
    black = cltrace.Material((0, 0, 0), ka=0, kd=0, ks=0)
    camera = cltrace.Orthographic((40, 40, 40), (0, 0, 0), (0, 0, 1), height=4, resolution=(60, 60))
    tube = cltrace.Mesh(vertices, faces, material=black)
    scene = meshed([tube]).in_front_of((1, 1, 1, 1)).seen_by(camera)
    image = proved(scene, any_device).render()
    off = 255 * np.abs(image.color - truth(scene, any_device, 64, (0, 0, 60, 60))).max(axis=2)
    assert (image.coverage > 0).sum() > 50
    # A side of an edge is off by 3.8 % of the contrast, root mean square, and no pixel by more than 4 times that.
    assert off.max() < 4 * 0.038 * 255 * 1.5
    assert (off[image.coverage > 0] <= image.error[image.coverage > 0]).mean() > 0.9


@pytest.mark.slow
def test_cells_are_counted_and_few(any_device: Device) -> None:
    """However much is in a pixel, it has 853 cells at most; then its bound is what is known."""
    scene = lit(*cloud(6, 20000, 0.004, 0.01))
    scene = scene.seen_by(replace(scene.camera, resolution=(8, 6)))
    renderer = proved(scene, any_device)
    image, work = renderer.render(), renderer.work()
    assert image.error.max() > 8
    cells = work["cells that are pixels or parts of them, of which a mean is proved"]
    assert 48 * 4 < cells <= 48 * 853
    assert (255 * np.abs(image.color - truth(scene, any_device, 64, (0, 0, 8, 6))).max(axis=2) <= image.error).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sharp", "cones", "inside", "behind edges"])
def test_rough_bounds(device: Device, name: str) -> None:
    """Where many levels will do, samples are shown in most pixels that have an edge: they are within the bound, too."""
    scene = HOSTILE[name]()
    image = proved(scene, device, 40).render()
    assert (image.error > 2).mean() > 0.1
    assert (image.error <= 40).mean() > 0.99
    assert_within(scene, device, image)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["first", "three-lights", "spot", "eclipse", "inside", "step3-shadows"])
def test_scenes(device: Device, name: str) -> None:
    scene = seen(f"{name}.xml")
    assert_within(scene, device, proved(scene, device).render())


@pytest.mark.slow
def test_share_of_a_tiny_sphere(device: Device) -> None:
    """A white sphere a fiftieth of a pixel wide, anywhere in the picture, brightens its pixel by its share of it."""
    random = np.random.default_rng(5)
    camera = cltrace.Camera((0, 0, 0), (0, 0, -1), horizontal_fov=20, resolution=(40, 40))
    pixel, white = 2 * camera.image_plane()[0] / 40, cltrace.ambient_light((1, 1, 1))
    for x, y in random.uniform(-0.3, 0.3, (5, 2)):
        # The disc's share: its area on the image plane, wider by the slant of the rays.
        d = np.sqrt(1 + x * x + y * y)
        radius = 10 * pixel / 100
        share = np.pi * (radius / 10) ** 2 * d / pixel**2
        scene = cltrace.Scene.from_spheres(
            camera, [white], [(10 * x, 10 * y, -10)], radius, (1, 1, 1), ka=1, kd=0, ks=0
        )
        image = cltrace.render(scene, device, outputs=OUTPUTS, antialias="proved")
        shown = image.color[:, :, 0] > 0  # of one pixel, or of up to four
        assert abs(image.color[:, :, 0].sum() - share) * 255 <= image.error[shown].sum() < 0.2


@pytest.mark.slow
@pytest.mark.parametrize("stretch", [(1, 1, 1), (1, 0.5, 2)])
def test_share_of_a_tiny_disc(any_device: Device, stretch: tuple[float, float, float]) -> None:
    """An ellipsoid that an orthographic camera looks at brightens pixels by its ellipse's share of them."""
    white, resolution = cltrace.ambient_light((1, 1, 1)), (9, 9)
    for x, y, radius in ((0.0, 0.0, 0.3), (0.7, -1.2, 0.01), (2.4, 1.6, 0.02)):
        scene = cltrace.Scene.from_spheres(
            cltrace.Orthographic(height=9, resolution=resolution),
            [white],
            [(x / stretch[0], y / stretch[1], -10)],
            radius,
            (1, 1, 1),
            ka=1,
            kd=0,
            ks=0,
            transform=np.diag(stretch),
        )
        image = proved(scene, any_device).render()
        share = np.pi * radius**2 * stretch[0] * stretch[1]
        assert abs(image.color[:, :, 0].sum() - share) * 255 <= image.error.sum() < 0.2 + 81 * 2.0**-12


@pytest.mark.slow
@pytest.mark.parametrize("name", ["shadow rims", "crossing eggs, parallel", "box", "tiny", "globes", "mirrors"])
def test_same_bits(device: Device, name: str) -> None:
    """Of crops and of packets of one pixel."""
    scene = (HOSTILE | ESTIMATED)[name]()
    whole = proved(scene, device).render()
    width, height = SIZE
    for crop in ((0, 0, 5, height), (5, 3, 18, 11), (18, 11, width, height)):
        x0, y0, x1, y1 = crop
        part = proved(scene, device, crop=crop).render()
        for name in part.outputs:
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[y0:y1, x0:x1], name)
    # By a kernel that has what this scene needs, which is compiled in half the time.
    single = proved(scene, device, width=1, keep=()).render()
    for name in single.outputs:
        np.testing.assert_array_equal(getattr(single, name), getattr(whole, name), name)


@pytest.mark.slow
def test_levels(any_device: Device) -> None:
    """A smaller error takes more cells, and no pixel has more than what was asked for, unless it has all its cells."""
    scene = HOSTILE["behind edges"]()
    found = []
    for levels in (8, 2, 0.5):
        renderer = proved(scene, any_device, levels)
        error, work = renderer.render().error, renderer.work()
        larger = work["pixels that would need more cells for the error that is wanted"]
        assert (error > levels).sum() <= larger <= 3
        found.append(error)
    errors = [np.minimum(error, 8) for error in found]
    assert errors[0].sum() > errors[1].sum() > errors[2].sum()


@pytest.mark.slow
def test_bright_background(any_device: Device) -> None:
    """A background counts up to 1, whether or not a surface is near."""
    scene = HOSTILE["behind edges"]().in_front_of((1.5, 0.5, 1, 1))
    color = proved(scene, any_device).render().color
    assert color.max() == 1
    assert color[0, 0].tolist() == [1, 0.5, 1]


@pytest.mark.slow
def test_middles_stay(any_device: Device) -> None:
    """What is no colour is that of the ray through the middle, as without antialiasing."""
    scene = HOSTILE["behind edges"]()
    names = ("normal", "depth", "id")
    plain = cltrace.render(scene, any_device, outputs=names)
    image = cltrace.render(scene, any_device, outputs=("rgb8", *names), antialias="proved")
    for name in names:
        np.testing.assert_array_equal(getattr(image, name), getattr(plain, name))
    assert (image.rgb8 != cltrace.render(scene, any_device).rgb8).any()


@pytest.mark.slow
def test_alpha(any_device: Device) -> None:
    """Laid over black and over white, edges are those of a picture before these, but for roundings."""
    scene = HOSTILE["behind edges"]()
    image = proved(scene.in_front_of((0.1, 0.1, 0.3, 0)), any_device, 0.25, outputs=(*OUTPUTS, "rgba8")).render()
    for behind in (0, 1):
        opaque = proved(scene.in_front_of((behind, behind, behind, 1)), any_device, 0.25).render()
        alpha = image.rgba8[..., 3:].astype(np.float64) / 255
        over = image.rgba8[..., :3] * alpha + 255 * behind * (1 - alpha)
        assert np.abs(over - opaque.rgb8).max() < 1.6  # half a level each of two bytes, and of alpha


@pytest.mark.slow
def test_estimates_are_counted(any_device: Device) -> None:
    """A mirror's pixels have an estimate, and no others."""
    mirrors = np.array([0.8, 0.0])
    scene = lit([(-0.5, 0, -4), (0.6, 0, -4)], [0.4, 0.4], reflectance=mirrors)
    renderer = proved(scene, any_device)
    count = renderer.work()["pixels of which the error is an estimate"]
    ids = cltrace.render(scene, any_device, outputs=("id",)).id
    assert (ids == 0).sum() <= count <= (ids == 0).sum() + 40  # and those at its edge


@pytest.mark.parametrize("levels", [0, -1, 256, np.nan, "1"])
def test_wrong_levels(any_device: Device, levels: object) -> None:
    with pytest.raises(ValueError, match='antialias: must be True, False, "proved" or levels'):
        cltrace.render(HOSTILE["crossing"](), any_device, antialias=levels)  # type: ignore[arg-type]


def test_error_needs_antialias(any_device: Device) -> None:
    with pytest.raises(ValueError, match="outputs: error is of antialiasing, which is off"):
        cltrace.render(HOSTILE["crossing"](), any_device, outputs=("error",))
