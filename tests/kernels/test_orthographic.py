"""Orthographic cameras: what is met is what exact arithmetic says, by every way that a picture is made."""

from __future__ import annotations

import pickle
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from exact_rays import to_world
from rational_meshes import doubles_mesh, exactly, grid_mesh, nearest
from stress_cases import pairs_on_a_plane

import cltrace
from cltrace import Camera, Image, Material, Mesh, Orthographic, Scene
from cltrace.exact.lines import ExactPoint, Line
from cltrace.oracle.search import Kinds, Rays
from cltrace.oracle.shapes import Spheres
from cltrace.picture.image import Output
from cltrace.reference import world_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.run.devices import Device
from cltrace.students.check import check

OUTPUTS: tuple[Output, ...] = ("rgb8", "id", "depth", "normal", "direction", "primitive")
DECIDED: tuple[Output, ...] = ("id", "primitive", "depth")  # what most tests here ask for, so that they share a program
LIGHTS = [
    cltrace.ambient_light(),
    cltrace.point_light((5, 8, 9)),
    cltrace.parallel_light((1, -2, -1)),
    cltrace.spot_light((0, 9, 3), (0, -1, -0.3), 20, 30),
]
TURNED = Orthographic((3, 2, 5), (0.1, 0.2, 0.3), (0.1, 1, 0.2), height=4.3, resolution=(13, 9))


def starts(camera: Orthographic) -> dict[tuple[int, int], tuple[Fraction, ...]]:
    """Where the ray of each pixel (x, y) starts in the world, exactly, by the definition."""
    (width, height), (half_width, half_height) = camera.resolution, camera.image_plane()
    found = {}
    for y, x in np.ndindex(height, width):
        o = ((2 * x + 1 - width) * (half_width / width), (height - 1 - 2 * y) * (half_height / height), 0.0)
        step = to_world(camera.basis(), o)
        found[x, y] = tuple(Fraction(e) + s for e, s in zip(camera.position, step, strict=True))
    return found


def closest(places: list[tuple[Fraction, ...]], w: list[Fraction], spheres: Spheres) -> tuple[np.ndarray, np.ndarray]:
    """The sphere that each ray from one of these places along w meets first, -1 for none, and t; by whole numbers."""
    starts, direction = [ExactPoint.of(place) for place in places], ExactPoint.of(w)
    rays = Rays.of(np.full((len(places), 3), np.nan), np.ones((len(places), 3)))  # of which doubles know nothing
    rays, kinds = replace(rays, line=lambda i: Line(starts[i], direction)), Kinds([spheres])
    found = kinds.closest(rays)
    return found.item, kinds.rounded(rays, found)


def drawn(
    scene: Scene, device: Device, outputs: tuple[Output, ...], precision: str = "accurate", **how: object
) -> Image:
    """By a kernel that may start inside of what it meets: most tests here share it."""
    return cltrace.Renderer(scene, device, precision, outputs, keep=("features",), **how).render()  # type: ignore[arg-type]


def compare(scene: Scene, device: Device, width: int, precision: str = "accurate") -> set[int]:
    """Asserts that ids are those of exact arithmetic, and depths to 2^-24. Returns the ids that there are."""
    image, camera = drawn(scene, device, DECIDED, precision, width=width), scene.camera
    assert isinstance(camera, Orthographic)
    w = [-Fraction(x) for x in camera.basis()[2]]
    places = starts(camera)
    index, t = ([], []) if scene.meshes else closest(list(places.values()), w, Spheres.of(scene))
    for k, ((x, y), start) in enumerate(places.items()):
        if scene.meshes:
            met = nearest(scene, exactly(start), exactly(w))
            wanted = met[1:] if met else (-1, -1)
            far = float(met[0]) if met else np.inf
        else:
            wanted, far = (int(index[k]), -1), t[k]
        assert (image.id[y, x], image.primitive[y, x]) == wanted, (x, y)
        assert image.depth[y, x] == pytest.approx(far, rel=2.0**-24), (x, y)
    return set(np.unique(image.id).tolist())


def test_spheres_that_pixels_touch_exactly(device: Device, width: int) -> None:
    """Pixel centres are whole numbers, and so are places and radii: many a ray only touches."""
    rng = np.random.default_rng(1)
    radii = rng.choice([1, 1, 2, 2, 5], 40)
    centers = np.stack([rng.integers(-9, 10, 40), rng.integers(-7, 8, 40), rng.integers(-99, -15, 40)], axis=1)
    for scale in (1.0, 2.0**-40, 2.0**60):
        camera = Orthographic(height=15 * scale, resolution=(19, 15))
        assert camera.image_plane() == (9.5 * scale, 7.5 * scale)
        scene = Scene.from_spheres(camera, [], centers * scale, radii * scale)
        assert len(compare(scene, device, width)) > 10
        touching = [np.hypot(x - c[0], y - c[1]) == r for c, r in zip(centers, radii, strict=True)
                    for x in range(-9, 10) for y in range(-7, 8)]  # fmt: skip
        assert sum(touching) > 50


@pytest.mark.parametrize("precision", ["accurate", pytest.param("double", marks=pytest.mark.slow)])
def test_a_ray_that_touches_hits(device: Device, precision: str) -> None:
    """At decimal places, alone and with something far away in the scene. Beside it by an ulp it misses."""
    camera = Orthographic(height=3, resolution=(3, 3))
    for number in range(60 if precision == "accurate" else 6):
        z = round(9 * (number * 0.6180339887498949 % 1) + 2.2, number % 6 + 1)
        r = (1, 0.1, 0.3, 0.5, 0.7, 2)[number % 6]
        for more in ([], [(1e14, 0, -5)]):
            for x, hit in ((r, 0), (np.nextafter(r, 9), -1)):
                scene = Scene.from_spheres(camera, [], [(x, 0, -z), *more], [r, *[1.0] * len(more)])
                image = drawn(scene, device, DECIDED, precision)
                assert image.id[1, 1] == hit, (z, r, more)
                assert hit < 0 or abs(image.depth[1, 1] / z - 1) <= 2.0**-52, (z, r, more)


def test_a_ray_that_touches_hits_in_single(device: Device) -> None:
    """Where all numbers are whole, nothing is rounded."""
    camera = Orthographic(height=3, resolution=(3, 3))
    for r in (1.0, 2.0, 5.0):
        for x, hit in ((r, 0), (-r, 0), (float(np.nextafter(np.float32(r), np.float32(9))), -1)):
            assert drawn(Scene.from_spheres(camera, [], [(x, 0, -20)], r), device, DECIDED, "single").id[1, 1] == hit


def grazing(rng: np.random.Generator, camera: Orthographic, count: int, far: float) -> Scene:
    """Spheres whose edge passes through pixels' centres but for an ulp, some within others and some there twice."""
    right, up, back = np.array(camera.basis())
    points = list(starts(camera).values())
    centers, radii = [], []
    for _ in range(count):
        start = np.array([float(x) for x in points[rng.integers(len(points))]])
        r, angle = 10.0 ** rng.uniform(-3, 0.5), rng.uniform(0, 7)
        center = start + r * (np.cos(angle) * right + np.sin(angle) * up) - back * rng.uniform(2 * r, far)
        centers.append(center)
        radii.append(r * (1 + rng.integers(-2, 3) * 2.0**-52))
    centers += centers[:3]
    radii += radii[:3]
    return Scene.from_spheres(camera, [], centers, radii)


@pytest.mark.parametrize("far", [9.0, 1e6, 1e14])
def test_grazing_discs(device: Device, width: int, far: float) -> None:
    rng = np.random.default_rng(2)
    seen = [compare(grazing(rng, TURNED, 12, far), device, width) for _ in range(4)]
    assert sum(map(len, seen)) > 15


def test_cameras_that_are_far_away(device: Device, width: int) -> None:
    """Up to where the spheres' own rounding is all that tells rays apart."""
    rng = np.random.default_rng(3)
    for distance in (1e3, 1e9, 1e15, 1e25):
        eye = distance * np.array([0.36, 0.48, 0.8])
        camera = Orthographic(eye, (0, 0, 0), height=3, resolution=(9, 7))
        scene = Scene.from_spheres(camera, [], rng.normal(size=(30, 3)), rng.uniform(0.05, 0.5, 30))
        compare(scene, device, width)
        compare(scene.seen_by(replace(camera, height=distance)), device, width)


@pytest.mark.slow
def test_spheres_that_the_plane_cuts_or_touches(device: Device, width: int) -> None:
    """Rays start inside of some, on some, and just before or behind others; those behind are not seen."""
    camera = Orthographic((0, 0, 0), (0, 0, -1), height=7, resolution=(9, 7))
    cases = [(0, 0, 0, 2), (1, 1, -1, 1), (1, 1, 1, 1), (-3, 2, 0.5, 0.5), (-3, -2, -0.25, 0.25), (0, 0, 3, 4)]
    cases += [(2, 0, 0.5, 0.5000000000000001), (2, -1, -0.5, 0.49999999999999994), (3, 3, 0, 0.001), (0, -3, 1e9, 1e9)]
    seen = set()
    for k in range(len(cases)):
        centers, radii = np.array(cases)[k:, :3], np.array(cases)[k:, 3]
        seen |= compare(Scene.from_spheres(camera, [], centers, radii), device, width)
        seen |= compare(Scene.from_spheres(camera, [], centers[::-1], radii[::-1]), device, width)
    assert len(seen) > 6
    rng = np.random.default_rng(4)
    for _ in range(5):
        centers = rng.normal(size=(20, 3)) * (2, 2, 0.3) + TURNED.position
        assert len(compare(Scene.from_spheres(TURNED, [], centers, rng.uniform(0.1, 1, 20)), device, width)) > 5


def test_spheres_that_are_met_at_one_point(device: Device, width: int) -> None:
    """Of equally near ones the lowest number is seen: spheres that touch from inside, and two that cross in a plane."""
    camera = Orthographic(height=9, resolution=(9, 9))
    inner = [(0, 0, -10 + (4 - r), r) for r in (1, 4, 2, 0.5, 3)]  # all touch the plane z = -6 at (0, 0)
    mirrored = [(x, y, -20, 5) for x, y in ((-3, 0), (3, 0), (0, -3), (0, 3))]
    for rows in (inner, inner[::-1], mirrored, mirrored[::-1], inner + mirrored):
        centers, radii = np.array(rows)[:, :3], np.array(rows)[:, 3]
        compare(Scene.from_spheres(camera, [], centers, radii), device, width)
        turn = np.array(TURNED.basis())
        compare(Scene.from_spheres(TURNED, [], centers @ turn, radii), device, width)


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_triangles(device: Device, width: int, offset: float) -> None:
    """Of whole numbers, with edges and corners on pixels' centres, and needles; before, on and behind the plane."""
    rng = np.random.default_rng(5)
    for seed in range(6):
        mesh = doubles_mesh(rng, offset) if offset else grid_mesh(rng)
        middle = mesh.placed.vertices.mean(axis=0)
        ahead = Orthographic(middle + (0, 0, 5), middle, height=4, resolution=(9, 8))
        if not offset:
            ahead = Orthographic((0, 0, seed % 3 - 1), (0, 0, -5), height=5, resolution=(5, 5))  # at whole numbers
        tilted = Orthographic(middle + TURNED.basis()[2], middle, height=3, resolution=(9, 7))
        for camera in (ahead, tilted):
            compare(Scene.from_meshes(camera, [], mesh), device, width)


@pytest.mark.slow
def test_ellipsoids(device: Device, width: int) -> None:
    rng = np.random.default_rng(6)
    maps = rng.normal(size=(15, 3, 3))
    scene = Scene.from_spheres(TURNED, [], rng.normal(size=(15, 3)), rng.uniform(0.1, 0.5, 15), transform=maps)
    assert len(compare(scene, device, width)) > 5
    compare(scene.seen_by(replace(TURNED, position=(0, 0, 0), lookat=(1, 2, 3))), device, width)
    # A ray that touches: (x / 2)^2 + y^2 + z^2 = 1 from x = 2.
    flat = Scene.from_spheres(
        Orthographic(height=5, resolution=(5, 5)), [], [(0, 0, -5)], 1, transform=np.diag([2, 1, 1])
    )
    image = cltrace.render(flat, device, "accurate", ("id",))
    assert image.id.tolist() == [[-1] * 5, [-1, -1, 0, -1, -1], [0] * 5, [-1, -1, 0, -1, -1], [-1] * 5]


def extreme(seed: int) -> Scene:
    """Numbers with all the bits that a scene can have: the exact arithmetic of the kernel takes the most digits."""
    rng = np.random.default_rng(seed)
    tiny, huge = 2.0**-149 * (1 + 2.0**-52), 2.0**127 * (2 - 2.0**-23)
    height = (2.0**-149 * 9, 9.0, huge)[seed % 3]
    camera = Orthographic(
        (tiny, 0, tiny), (2.0**-149 * 3, 2.0**-149, -huge), (0, 1, 2.0**-149), height, resolution=(9, 7)
    )
    return Scene.from_spheres(camera, [], *pairs_on_a_plane(rng, tiny, huge))


@pytest.mark.slow
def test_the_most_digits(device: Device, width: int) -> None:
    seen = set()
    for seed in range(9):
        seen |= compare(extreme(seed), device, width)
    assert len(seen) > 3


# ------------------------------------------------------------------------------------------ pictures, by all ways


def everything(camera: Camera | Orthographic) -> Scene:
    """Spheres, ellipsoids and a textured mesh, which mirror and let light through, in all lights."""
    rng = np.random.default_rng(7)
    n = 14
    bent = np.where(np.arange(n)[:, None, None] % 2, np.eye(3), rng.normal(size=(n, 3, 3)))
    texels = rng.integers(0, 256, (5, 6, 3), np.uint8)
    corners = rng.normal(size=(9, 3))
    mesh = Mesh(
        corners,
        rng.integers(0, 9, (7, 3)),
        material=Material(texture=texels, reflectance=0.2),
        uv=rng.uniform(size=(9, 2)),
    )
    return Scene.from_spheres(
        camera,
        LIGHTS,
        rng.normal(size=(n, 3)),
        rng.uniform(0.1, 0.5, n),
        rng.uniform(size=(n, 3)),
        reflectance=rng.choice([0, 0.3], n),
        transmittance=rng.choice([0, 0.4], n),
        index=1.4,
        transform=bent,
        meshes=mesh,
        background=(0.1, 0.2, 0.3),
    )


def plain(camera: Camera | Orthographic, n: int = 60) -> Scene:
    rng = np.random.default_rng(8)
    centers, radii = rng.normal(size=(n, 3)), rng.uniform(0.05, 1, n) * n ** (-1 / 3)
    return Scene.from_spheres(camera, LIGHTS, centers, radii, rng.uniform(size=(n, 3)), background=(1, 1, 1))


@pytest.mark.parametrize("kind", [plain, pytest.param(everything, marks=pytest.mark.slow)])
def test_pictures_are_those_of_the_reference(device: Device, kind: type) -> None:
    for camera in (
        replace(TURNED, resolution=(40, 30)),
        Orthographic((0.1, 0.2, 0.3), (1, 0.5, 0), height=3, resolution=(40, 30)),
    ):
        scene = kind(camera)
        image = drawn(scene, device, OUTPUTS)
        report = check(scene, image, "accurate")
        assert report.ok, report
        assert report.differing == 0
        world = world_of(scene)
        back = np.array(camera.basis()[2])
        assert np.abs(image.direction + back).max() < 2.0**-23
        for y, x in ((15, 20), (10, 25), (20, 18)):
            _, at = trace(world, primary_ray(camera, x, y))
            assert image.depth[y, x] == (at.distance if at else np.inf)
            normal = np.array([*(world.surfaces[0].view.B.T @ at.normal)]) if at else np.zeros(3)
            assert np.abs(image.normal[y, x] - normal).max() < 2.0**-22


@pytest.mark.slow
def test_no_list_and_no_filter_changes_a_picture(device: Device) -> None:
    """Also where the plane cuts spheres, where pixels are far smaller than spheres, and with all in one pixel."""
    rng = np.random.default_rng(9)
    for make, cut in ((plain, 3), (everything, 2)):
        scene = make(TURNED)
        for k in range(cut):
            eye = rng.normal(size=3) * (0.2 if k else 3)
            size = (67, 41) if k < 2 else (41, 67)
            camera = Orthographic(eye, eye + rng.normal(size=3), height=10.0 ** -rng.uniform(-1, 1), resolution=size)
            seen = scene.seen_by(camera)
            outputs = ("rgb8", "id", "depth")
            one = cltrace.render(seen, device, "accurate", outputs)
            all_of_them = ("lists", "filter", "hidden", "receivers", "unstopped", "order")
            other = cltrace.Renderer(seen, device, "accurate", outputs, keep=all_of_them).render()
            for name in outputs:
                assert np.array_equal(getattr(one, name), getattr(other, name)), (k, name)
    tiny = plain(TURNED)
    for height in (1e-9, 1e-14, 1e9):
        target = tiny.spheres["center"][5] + (0, 0, tiny.spheres["radius"][5])
        camera = Orthographic(target + (0, 0, 2), target, height=height, resolution=(20, 20))
        one = cltrace.render(tiny.seen_by(camera), device, "accurate", ("id", "depth"))
        other = cltrace.Renderer(
            tiny.seen_by(camera), device, "accurate", ("id", "depth"), keep=("lists", "filter")
        ).render()
        assert np.array_equal(one.id, other.id)
        assert np.array_equal(one.depth, other.depth)


def test_crops_and_pickles(device: Device) -> None:
    scene = plain(replace(TURNED, resolution=(61, 43)))
    whole = drawn(scene, device, OUTPUTS)
    part = drawn(pickle.loads(pickle.dumps(scene)), device, OUTPUTS, crop=(13, 7, 50, 30))
    for name in OUTPUTS:
        assert np.array_equal(getattr(whole, name)[7:30, 13:50], getattr(part, name)), name


@pytest.mark.slow
def test_packets_of_one_pixel(device: Device) -> None:
    scene = plain(replace(TURNED, resolution=(61, 43)))
    whole = cltrace.render(scene, device, "accurate", OUTPUTS)
    one = cltrace.Renderer(scene, device, "accurate", OUTPUTS, width=1).render()
    for name in OUTPUTS:
        assert np.array_equal(getattr(whole, name), getattr(one, name)), name


@pytest.mark.slow
@pytest.mark.parametrize("n", [60, 2**15 + 1])
def test_look_and_update(device: Device, n: int) -> None:
    """From one kind of camera to the other and back, and with other spheres: always the picture of a new Renderer."""
    size = (64, 48)
    pinhole, parallel = Camera((0, 0, 9), (0, 0, 0), fov=30, resolution=size), replace(TURNED, resolution=size)
    scene = plain(pinhole, n)

    def same(renderer: cltrace.Renderer, other: Scene) -> None:
        image, anew = renderer.render(), drawn(other, device, OUTPUTS)
        for name in OUTPUTS:
            assert np.array_equal(getattr(image, name), getattr(anew, name)), name

    first = cltrace.Renderer(scene, device, "accurate", OUTPUTS, keep=("features",))
    second = first.look(parallel)
    same(second, scene.seen_by(parallel))
    same(second.look(pinhole), scene)
    same(second.look(replace(parallel, height=2)), scene.seen_by(replace(parallel, height=2)))
    moved = scene.spheres["center"] + (0.1, 0, 0.2)
    second.update(centers=moved)
    same(second, second.scene)
    second.update(colors=(0.5, 0.2, 0.1))
    same(second, second.scene)
    same(first, scene)


@pytest.mark.parametrize("kind", [plain, pytest.param(everything, marks=pytest.mark.slow)])
def test_explanations(device: Device, kind: type) -> None:
    """The bytes are the picture's, and the rays start where the words say."""
    camera = replace(TURNED, resolution=(40, 30))
    scene = kind(camera)
    image = drawn(scene, device, OUTPUTS)
    right, up, back = np.array(camera.basis())
    for x, y in [(20, 15), (25, 10), (18, 20), (0, 0), (16, 12), (22, 17), (19, 11), (24, 16)]:
        found = cltrace.explain(scene, x, y)
        assert found.rgb8 == tuple(image.rgb8[y, x].tolist())
        ray, c = found.rays[0], found.camera
        assert ray.direction == pytest.approx(-back, abs=1e-15)
        assert np.array(ray.origin) == pytest.approx(camera.position + c.x_i * right + c.y_i * up, abs=1e-14)
        assert (c.x_i, c.y_i) == pytest.approx((((x + 0.5) / 20 - 1) * 4.3 / 2 * 4 / 3, (1 - (y + 0.5) / 15) * 4.3 / 2))
        assert (ray.hit.t if ray.hit else np.inf) == pytest.approx(image.depth[y, x])
        text = str(found)
        assert "H = 4.3, the height of what the picture shows" in text
        assert "o = position + x_i x + y_i y = (" in text
    assert '"height": 4.3' in cltrace.explain(scene, 3, 4).to_json()


@pytest.mark.slow
def test_a_picture_that_is_upside_down_is_found_out(device: Device) -> None:
    scene = plain(replace(TURNED, resolution=(64, 48)))
    image = cltrace.render(scene, device, "accurate")
    assert cltrace.compare(scene, image).same
    other = cltrace.compare(scene, image.rgb8[::-1].copy())
    assert [cause.name for cause in other.causes] == ["upside-down"]


def test_single_precision_is_close(device: Device) -> None:
    scene = plain(replace(TURNED, resolution=(80, 60)))
    ground = Scene.from_spheres(replace(TURNED, resolution=(80, 60)), LIGHTS, [(0, -1e7, 0), (0, 1, 0)], [1e7, 1])
    for one in (scene, ground):
        fine, coarse = (drawn(one, device, DECIDED, p) for p in ("accurate", "single"))
        assert (fine.id != coarse.id).mean() <= 1e-3
        both = (fine.id == coarse.id) & (fine.id >= 0)
        assert np.abs(fine.depth[both] - coarse.depth[both]).max() < 1e-6 * coarse.depth[both].max()


# ------------------------------------------------------------------------------------------------------ the camera


def test_the_camera() -> None:
    camera = Orthographic((1, 2, 3), (0, 0, 0), height=4, resolution=(640, 480))
    assert camera.image_plane() == (2 * 640 / 480, 2)
    for same in (
        replace(camera),
        pickle.loads(pickle.dumps(camera)),
        eval(repr(camera), {"Orthographic": Orthographic}),
    ):
        assert same == camera
        assert hash(same) == hash(camera)
    with pytest.raises(TypeError, match="camera: must be a cltrace"):
        Scene.from_spheres("front", [], [], 1)  # type: ignore[arg-type]


def test_it_goes_round_a_scene() -> None:
    scene = plain(replace(TURNED, lookat=(0, 0, 0)))
    around = cltrace.orbit(scene, 4, axis="y")
    assert all(isinstance(camera, Orthographic) and camera.height == TURNED.height for camera in around)
    assert np.array([camera.position for camera in around]).mean(axis=0) == pytest.approx((0, 2, 0))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"height": 0}, "camera.height: must be > 0, got 0"),
        ({"height": np.inf}, "camera.height: must be a finite number, got inf"),
        ({"height": "1"}, "camera.height: must be numbers, got '1'"),
        ({"lookat": (0, 0, 0)}, "camera.lookat: must differ from position"),
        ({"resolution": (0, 5)}, "camera.resolution: must be within 1..65536 each and 1073741824 pixels, got 0x5"),
        ({"max_bounces": 101}, "camera.max_bounces: must be within 0..100, got 101"),
    ],
)
def test_bad_cameras(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        Orthographic(**changed)  # type: ignore[arg-type]
    assert str(caught.value) == message


def test_one_pixel_is_as_much_of_the_world_everywhere(device: Device) -> None:
    """A scale bar: spheres near and far are as many pixels wide as their size says."""
    camera = Orthographic((0, 0, 10), (0, 0, 0), height=10, resolution=(100, 100))
    scene = Scene.from_spheres(camera, [], [(-2.5, 0, 8), (2.5, 0, -900)], 2)
    image = drawn(scene, device, DECIDED)
    for number in (0, 1):
        rows, columns = np.nonzero(image.id == number)
        assert np.ptp(rows) + 1 == np.ptp(columns) + 1 == 40
    assert image.depth[50, 24] == pytest.approx(0, abs=0.01)
    assert image.depth[50, 75] == pytest.approx(908, abs=0.01)
