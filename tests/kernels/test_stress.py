"""The stress catalogue, held against the exact oracle, and colours against the reference: `pytest -k L9`.

The cases are those of tests/hostile/catalogue.py, which says of each what could go wrong. test_case asks of all of them
what the catalogue requires; what is known of single pictures beyond that has tests of its own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import mpmath
import numpy as np
import pyopencl as cl
import pytest
from exact_rays import angle
from hostile.catalogue import AT_THE_POINT, GREYS, Case, cases
from hostile.sphere_regimes import TANGENT
from hostile.sphere_scenes import Ball, balls, everything, looking, unit
from stress_cases import (
    OUTPUTS,
    channel,
    check,
    check_case,
    check_colors,
    lighting,
    picture,
    renderer,
)

import cltrace
from cltrace import Camera, Image, Renderer, Scene, ambient_light, parallel_light, point_light, spot_light
from cltrace.reference import EYE, Direction, Ray, world_of
from cltrace.run.devices import Device

# double leaves out the filter, and that is all: in the ordinary run a few cases are enough.
mostly = pytest.mark.parametrize("precision", ["accurate", pytest.param("double", marks=pytest.mark.stress)])


@pytest.fixture(params=[pytest.param(1, id="short"), pytest.param(16, id="long", marks=pytest.mark.stress)])
def amount(request: pytest.FixtureRequest) -> int:
    """How many times as much as in the ordinary run."""
    return int(request.param)


def each(*names: str) -> pytest.MarkDecorator:
    """A test of each case of these names."""
    found = cases(*names)
    return pytest.mark.parametrize("case", found, ids=[f"{case.name}-{case.what}" for case in found])


def drawn(case: Case, device: Device, precision: str, amount: int) -> Iterator[tuple[Scene, Image]]:
    """A case's scenes and their pictures."""
    return ((scene, picture(scene, device, precision)) for scene in case.scenes(amount))


def middle(image: Image) -> tuple[int, int]:
    return image.id.shape[0] // 2, image.id.shape[1] // 2


def axis_of(scene: Scene) -> np.ndarray:
    """Where the camera looks."""
    return -np.array(scene.camera.basis()[2])


def same(a: cltrace.Image, b: cltrace.Image, *names: str) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names or OUTPUTS)


@mostly
@each()
def test_case(device: Device, precision: str, amount: int, case: Case) -> None:
    """What the catalogue requires."""
    check_case(case, device, precision, amount)


# ------------------------------------------------------------------------------------------------ big, tiny, far away


@mostly
@each("G1", "G2", "G3", "G5")
def test_G_no_rings(device: Device, precision: str, amount: int, case: Case) -> None:
    """Along every column the ground is the farther the higher, and its normal turns one way."""
    for _, image in drawn(case, device, precision, amount):
        depth, n = image.depth[::-1], image.normal[::-1]
        seen = np.isfinite(depth[:-1]) & np.isfinite(depth[1:])
        assert seen.any()
        assert (depth[1:][seen] >= depth[:-1][seen]).all()
        assert (n[1:, :, 2][seen] <= n[:-1, :, 2][seen]).all()


@each("O1", "O2", "O3")
def test_O_all_is_the_same(device: Device, amount: int, case: Case) -> None:
    (_, one), (_, other) = drawn(case, device, "accurate", amount)
    assert same(one, other)


@mostly
@each("K")
def test_K_powers_of_two_change_no_bit(device: Device, precision: str, amount: int, case: Case) -> None:
    (base, one), *others = drawn(case, device, precision, amount)
    for scene, other in others:
        assert same(one, other, "rgb8", "id", "color", "normal", "direction", "shadow_rays")
        factor = scene.spheres["radius"][0] / base.spheres["radius"][0]
        assert np.array_equal(other.depth / factor, one.depth)


# -------------------------------------------------------------------------------------------------------- degenerate


@pytest.mark.parametrize("r", [0.0, -0.0, -1.0, -1e-45])
def test_R0_no_radius(r: float) -> None:
    """0/0 for a normal."""
    text = f"must be > 0, got {r:g}" if abs(r) > 1e-44 or not r else "must be at least 1.4e-45 in magnitude, got -1e-45"
    with pytest.raises(ValueError) as caught:
        balls(Camera(), [((0, 0, -5), 1), ((0, 0, -5), r)])
    assert str(caught.value) == f"radii[1]: {text}"


@mostly
@each("R1")
def test_R1_which_one_is_seen(device: Device, precision: str, amount: int, case: Case) -> None:
    """The larger one from outside, the smaller one from inside; from between the two no light is seen."""
    for i, (scene, image) in enumerate(drawn(case, device, precision, amount)):
        large = int(np.argmax(scene.spheres["radius"]))
        assert set(image.id.ravel()) == ({-1, large}, {1 - large}, {1 - large}, {0, 1})[i % 4]
        assert i % 4 < 2 or (image.color == 0).all()


def test_R2_duplicates_and_permutations(device: Device, width: int, amount: int) -> None:
    """Equal spheres fight for pixels: who wins depends on the order of the work."""
    rng = np.random.default_rng(8)
    one = picture(everything(), device, "accurate", width)
    for _ in range(1 if amount == 1 else 30):
        order = rng.permutation(10)
        other = picture(everything(order=tuple(order.tolist())), device, "accurate", width)
        assert np.array_equal(np.where(other.id >= 0, order[other.id], -1), one.id)
        assert same(one, other, *(set(OUTPUTS) - {"id"}))
        # Three of each sphere, shuffled: what is seen is the first of the three.
        order = rng.permutation(np.repeat(np.arange(10), 3))
        first = np.array([np.flatnonzero(order == k)[0] for k in range(10)])
        thrice = everything(order=tuple(order.tolist()))
        other = picture(thrice, device, "accurate", width)
        assert np.array_equal(other.id, np.where(one.id >= 0, first[one.id], -1))
        assert same(one, other, "rgb8", "color", "normal", "depth")


@mostly
@each("R3")
def test_R3_of_equals_the_first(device: Device, precision: str, amount: int, case: Case) -> None:
    for _, image in list(drawn(case, device, precision, amount))[:3]:
        assert image.id[middle(image)] == 0
        assert image.depth[middle(image)] == 6


# -------------------------------------------------------------------------------------------------------------- rays


@mostly
@each("D2")
def test_D2_tangent(device: Device, precision: str, amount: int, case: Case) -> None:
    (_, first), *others = drawn(case, device, precision, amount)
    assert (first.id.item(), first.depth.item()) == (0, 5)
    assert first.normal.ravel().tolist() == [0, 1, 0]
    for (x, y), (scene, image) in zip(TANGENT, others, strict=True):
        assert (image.id[1, 1], image.depth[1, 1]) == (0, -scene.spheres["center"][0, 2])
        assert np.abs(image.normal[1, 1] + np.array([x, y, 0]) / 5).max() <= 2.0**-24


@pytest.mark.parametrize("length", [1e-30, 1e-3, 1.0, 1e3])
def test_D3_length_of_the_references_rays(length: float) -> None:
    """The same of the reference, whose rays may have any length: t is in units of d, P stays."""
    sphere = world_of(balls(Camera(), [((0.25, -0.5, -5), 1)])).surfaces[0]
    d = Direction(0.125, -0.0625, -1.0)
    t = sphere.intersect(Ray(EYE, d))
    scaled = Ray(EYE, d * length)
    again = sphere.intersect(scaled)
    assert t is not None
    assert again is not None
    assert abs(again * length / t - 1) < 1e-15
    point, far = scaled.at(again), Ray(EYE, d).at(t)
    assert max(abs(point.x - far.x), abs(point.y - far.y), abs(point.z - far.z)) < 1e-14


def test_D4_no_direction_for_the_reference() -> None:
    """A ray that goes nowhere meets nothing, from outside and from inside."""
    for center in ((0, 0, -5), (0, 0, 0)):
        sphere = world_of(balls(Camera(), [(center, 1)])).surfaces[0]
        assert sphere.intersect(Ray(EYE, Direction(0.0, 0.0, 0.0))) is None


@mostly
@each("D5")
def test_D5_along_an_axis(device: Device, precision: str, amount: int, case: Case) -> None:
    for i, (scene, image) in enumerate(drawn(case, device, precision, amount)):
        assert (image.id[middle(image)], image.depth[middle(image)]) == (0, 4 if i % 2 else 2.5)
        assert (image.normal[middle(image)] == -axis_of(scene)).all()


@mostly
@each("I1")
def test_I1_inside(device: Device, precision: str, amount: int, case: Case) -> None:
    """The normal has to face the eye."""
    for _, image in drawn(case, device, precision, amount):
        assert (image.id == 0).all()
        assert ((image.normal * image.direction).sum(axis=-1) < 0).all()


@mostly
@each("I2")
def test_I2_on_the_surface(device: Device, precision: str, amount: int, case: Case) -> None:
    """Outward is a miss, tangential too, and inward t = 2b/a."""
    for scene, image in drawn(case, device, precision, amount):
        assert ((image.normal * image.direction).sum(axis=-1)[image.id >= 0] < 0).all()
        b = float(scene.spheres["center"][0] @ axis_of(scene))
        assert image.id[middle(image)] == (0 if b > 0 else -1)
        assert image.depth[middle(image)] == (2 * b if b > 0 else np.inf)


@mostly
@each("I4")
def test_I4_at_the_centre(device: Device, precision: str, amount: int, case: Case) -> None:
    for scene, image in drawn(case, device, precision, amount):
        r = scene.spheres["radius"][0]
        assert np.abs(image.depth / r - 1).max() <= 2.0**-51
        assert np.abs(image.normal + image.direction).max() <= 2.0**-24
        assert image.depth[middle(image)] == r
        assert (image.normal[middle(image)] == -axis_of(scene)).all()


# ------------------------------------------------------------------------------------------------ lights and shadows


@mostly
@each("L1")
def test_L1_own_shadow(device: Device, precision: str, amount: int, case: Case) -> None:
    """Whatever faces a light is lit, and much of it does."""
    for scene, image in drawn(case, device, precision, amount):
        _, want = lighting(scene, image, 40 * amount)
        assert (want[..., 0] == want[..., 1]).all()
        assert (want[..., 0].sum(axis=0) >= 10).all()


@mostly
@pytest.mark.parametrize(
    ("name", "bright"),
    [("L2", (True, True, False, False, False, False, True)), ("L5", (True, False)), ("L3", (False, False))],
)
def test_L_light_at_p(device: Device, precision: str, name: str, bright: tuple[bool, ...]) -> None:
    """Whether each light reaches P, by hand; the parallel one never does past the occluder ahead of it."""
    (case,) = cases(name)
    for reaches, (scene, image) in zip(bright, drawn(case, device, precision, 1), strict=name != "L3"):
        assert image.depth[4, 5] == 4
        assert image.color[4, 5, 1] == 0 or scene.spheres["center"][1, 0] < 0
        assert (image.color[4, 5, 0] > 0) == reaches


@mostly
@each("L3")
def test_L3_light_inside_another_sphere(device: Device, precision: str, amount: int, case: Case) -> None:
    *_, (_, inside), (_, outside) = drawn(case, device, precision, amount)
    assert inside.color[..., 0].max() > 0
    assert inside.color[..., 1].max() == 0
    assert outside.color.max() == 0


@mostly
@each("L4")
def test_L4_room(device: Device, precision: str, amount: int, case: Case) -> None:
    """Bright with the light in it or exactly on the wall, where nothing is between; else dark."""
    for bright, (_, image) in zip((1, 1, 1, 0, 0), drawn(case, device, precision, amount), strict=True):
        assert (image.color[..., 1] == 0).all()
        assert ((image.color[..., 0] > 0) == bright).all()


@mostly
@each("L6")
def test_L6_light_at_the_point(device: Device, precision: str, amount: int, case: Case) -> None:
    """No light, but for one that is straight above."""
    for light, (scene, image) in zip(AT_THE_POINT * 2, drawn(case, device, precision, amount), strict=True):
        assert image.depth[3, 4] == scene.camera.position[2]
        assert image.color[3, 4, 1] == image.color[3, 4, 2] == 0
        assert 0 <= image.color[3, 4, 0] <= (1 if light == (0, 0, 1e-30) else 0)


@mostly
@each("L7")
def test_L7_light_at_the_surface(device: Device, precision: str, amount: int, case: Case) -> None:
    ((scene, image),) = drawn(case, device, precision, amount)
    _, want = lighting(scene, image, 150 * amount)
    assert want[:, 0, 1].any() == (scene.lights["position"][0, 2] > 1)
    assert not want[:, 0, 1].all()


@mostly
def test_L8_terminator(device: Device, precision: str, amount: int) -> None:
    """n.l within an ulp of 0: a line of acne. It is the ambient colour, and no shadow ray is cast for n.l <= 0."""
    for e in (0, 2.0**-52, 1e-7, 1e-2) if amount == 1 else (0, *2.0 ** -np.arange(52, 5, -1)):
        for s in (1, -1):
            # At the pixel on the axis P = (0, 0, -1) and n = (0, 0, 1): n.l is s e, to rounding, for both lights.
            lights = [
                ambient_light((1, 1, 1)),
                point_light((1, 0, s * e - 1), (1, 0, 0)),
                parallel_light((-1, 0, -s * e), (0, 1, 0)),
            ]
            spheres: list[Ball] = [((0, 0, -2), 1), ((0, -9, 0), 1)]
            scene = balls(looking(tan=0.1, size=(9, 7)), spheres, lights, ka=0.25, kd=1, ks=0)
            image = check(scene, device, precision)
            n_l = e / math.hypot(1, e) if s > 0 else 0
            assert image.shadow_rays[3, 4] == (2 if s * e > 0 else 0)
            assert np.abs(image.color[3, 4] - (0.25 + n_l, 0.25 + n_l, 0.25)).max() <= 2e-7


@mostly
@each("L9")
def test_L9_shell(device: Device, precision: str, amount: int, case: Case) -> None:
    """From outside all that faces a light is lit; from between the two nothing is, though much faces it."""
    outside = "outside" in case.what
    for scene, image in drawn(case, device, precision, amount):
        _, want = lighting(scene, image, 60 * amount)
        if outside:
            assert (want[..., 0] == want[..., 1]).all()
            assert want[..., 0].any(axis=0).all()
        else:
            assert want[..., 1].any(axis=0).all()
            assert (image.color == 0).all()
            assert 0 in image.id


@mostly
@each("L9")
def test_L9_shell_aslant(device: Device, precision: str, amount: int, case: Case) -> None:
    """From between the two, looking anywhere, anywhere around the sphere."""
    rng = np.random.default_rng(11)
    for base in case.scenes(amount) if "between" in case.what else ():
        C, (R, shell), eye = base.spheres["center"][0], base.spheres["radius"], np.array(base.camera.position)
        w = eye - C if "double" in case.what else (R + shell) / 2 * unit(rng)
        at, up = C + 0.1 * R * unit(rng), unit(rng)
        camera = Camera(tuple(C + w), tuple(at), tuple(up), 70, base.camera.resolution)
        lights = [point_light(C + 3 * w, (1, 0, 0)), parallel_light(-w, (0, 1, 0))]
        image = picture(Scene(camera, np.concatenate(lights), base.spheres, base.materials), device, precision)
        assert set(image.id.ravel()) <= {0, 1}
        assert (image.id == 0).any()
        assert (image.color == 0).all()


@mostly
@each("L10")
def test_L10_lit_and_dark_ground(device: Device, precision: str, amount: int, case: Case) -> None:
    for _, image in drawn(case, device, precision, amount):
        assert len(set((image.color[image.id == 0][:, 0] > 0).tolist())) == 2


# ------------------------------------------------------------------------------------------------ camera and shading


@mostly
@each("C2")
def test_C2_wide(device: Device, precision: str, amount: int, case: Case) -> None:
    """Where the edges of the picture are seen, to 40 digits."""
    scene, image = next(drawn(case, device, precision, amount))
    camera = scene.camera
    with mpmath.workdps(40):
        exact = mpmath.tan(mpmath.mpf(camera.horizontal_fov) * mpmath.pi / 180)
        assert abs(camera.image_plane()[0] / exact - 1) < 1e-9
        x = exact * 400 / 401
        edge = [x / mpmath.hypot(x, 1), mpmath.mpf(0), -1 / mpmath.hypot(x, 1)]
    assert np.isfinite(image.direction).all()
    assert angle(image.direction[1, 400], edge) <= 1e-7
    assert angle(image.direction[1, 0], [-edge[0], *edge[1:]]) <= 1e-7


@pytest.mark.parametrize("fov", [0, 90, 180, 181, -1e-9, -45, math.nan])
def test_C3_no_field_of_view(fov: float) -> None:
    """An infinite image plane, or none."""
    text = "must be a finite number, got nan" if math.isnan(fov) else f"must be within (0, 90), got {fov:g}"
    with pytest.raises(ValueError) as caught:
        Camera(horizontal_fov=fov)
    assert str(caught.value) == f"camera.horizontal_fov: {text}"


def stays_within(whole: Renderer, guard: int = 4096) -> bool:
    """Whether the kernel keeps off the bytes before and behind each of its outputs."""
    executor = whole._executor
    frame = executor.frame()
    image = cltrace.Image(frame=frame)
    flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
    outside = np.full(2 * guard, 0xA5, np.uint8)
    parts = {n: np.insert(outside, guard, np.zeros(a.nbytes, np.uint8)) for n, a in frame.arrays.items()}
    guarded = {n: cl.Buffer(executor.queue.context, flags, hostbuf=part) for n, part in parts.items()}
    frame.buffers = {n: b.get_sub_region(guard, frame.arrays[n].nbytes) for n, b in guarded.items()}
    whole.render(image)
    for name, part in parts.items():
        cl.enqueue_copy(executor.queue, part, guarded[name])
    assert parts["direction"][guard:-guard].any()  # it was written to
    return all((np.delete(part, slice(guard, -guard)) == 0xA5).all() for part in parts.values())


@pytest.mark.parametrize("size", [(1, 1), (1, 4096), (4096, 1), (7, 13), (33, 65), (40, 3)])
def test_C4_sizes(device: Device, width: int, amount: int, size: tuple[int, int]) -> None:
    """Half a pixel off, width and height swapped, or the packets at the edge write behind the picture."""
    w, h = size
    camera = Camera(horizontal_fov=40, resolution=size, square_pixels=False)
    base = everything()
    scene = Scene(camera, base.lights, base.spheres, base.materials, base.background)
    whole = renderer(scene, device, "accurate", width)
    assert stays_within(whole)
    image = whole.render()
    crops = [(w // 2, h // 3, w, h), (w // 3, h // 4, w // 3 + 1, h // 4 + 1), (0, 0, max(1, w // 2), max(1, h // 2))]
    for crop in crops[: 1 if amount == 1 else 3]:
        part = renderer(scene, device, "accurate", width, crop=crop)
        assert stays_within(part)
        x0, y0, x1, y1 = crop
        cut = part.render()
        for name in OUTPUTS:
            assert np.array_equal(getattr(cut, name), getattr(image, name)[y0:y1, x0:x1]), name
    # The tutorial's angles: the longer side has the whole one, the other one its share.
    fov = np.radians([40 * min(1, w / h), 40 * min(1, h / w)])
    x = ((np.arange(w) + 0.5) / w * 2 - 1) * math.tan(fov[0])
    y = (1 - (np.arange(h) + 0.5) / h * 2) * math.tan(fov[1])
    d = np.stack([*np.meshgrid(x, y), np.full((h, w), -1.0)], axis=-1)
    assert np.abs(image.direction - d / np.linalg.norm(d, axis=-1, keepdims=True)).max() <= 1e-7
    if size == (1, 1):
        assert image.direction.ravel().tolist() == [0, 0, -1]


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 0, -1e30), (0, 1e-40, 7), (0, 0, 0)])
def test_C5_up_along_the_view(up: tuple[float, ...]) -> None:
    """Axes of NaN."""
    with pytest.raises(ValueError) as caught:
        Camera(up=up)
    assert str(caught.value) == f"camera.up: must not be {'parallel to the view' if any(up) else '0'}"
    with pytest.raises(ValueError) as caught:
        Camera(position=(1, 2, 3), lookat=(1, 2, 3))
    assert str(caught.value) == "camera.lookat: must differ from position"


@pytest.mark.parametrize("angle", [1e-7, 1e-9, 1e-12])
def test_C5_up_nearly_along_the_view(device: Device, angle: float) -> None:
    """Axes that are not orthogonal: a skew picture."""
    camera = Camera((1, 2, 3), (4, -1, 5), (3 + angle, -3, 2), 40, (9, 9))
    rows = [mpmath.matrix(row) for row in camera.basis()]
    with mpmath.workdps(50):
        for i in range(3):
            for j in range(3):
                assert abs(sum(rows[i][k] * rows[j][k] for k in range(3)) - (i == j)) < 1e-15
    image = picture(balls(camera, [((4, -1, 5), 1)]), device)
    assert image.id[4, 4] == 0
    assert np.abs(np.linalg.norm(image.direction, axis=-1) - 1).max() <= 1e-7
    # Right and left are mirrored at the view, as are up and down.
    assert np.abs(image.direction + image.direction[::-1, ::-1] - 2 * image.direction[4, 4] *
                  (image.direction * image.direction[4, 4]).sum(-1, keepdims=True)).max() <= 3e-7  # fmt: skip


@mostly
@each("P1", "P2")
def test_P_highlights(device: Device, precision: str, amount: int, case: Case) -> None:
    """Never above 1, 1 in the middle of the highlight, and as precise in colours as in bytes."""
    for scene, image in drawn(case, device, precision, amount):
        if case.name == "P1" or scene.materials["exponent"][0] in (1e4, 1e6):
            assert check_colors(scene, image, 200 * amount) <= 5e-6
        assert image.color.max() <= 1
        if not scene.lights["position"].any():
            assert image.color[middle(image)].tolist() == [1, 1, 1]
        if case.name == "P1" and scene.materials["exponent"][0] == 0:
            # 1 where the surface faces the light, though r.v may be negative; else 0.
            assert set(np.unique(image.color[..., :2]).tolist()) == {0, 1}
            assert (image.color[..., :2].sum(axis=-1).ravel() <= channel(image, "shadow_rays")).all()


def test_P3_colours(device: Device) -> None:
    (case,) = cases("P3")
    (dim, image), *others = drawn(case, device, "accurate", 1)
    want = [math.floor(min(1.0, grey) * 255 + 0.5) for grey in GREYS]
    assert image.rgb8[1, 1::2, 0].tolist() == want
    down = Renderer(dim, device, "accurate", OUTPUTS, truncate=True, keep=("features",)).render()
    assert down.rgb8[1, 1::2, 0].tolist() == [math.floor(min(1.0, np.float32(g)) * np.float32(255)) for g in GREYS]
    for _, strong in others[1:]:
        assert (strong.rgb8[1, 1::2][1:4] == 255).all()


# ------------------------------------------------------------------------------------------------------------ refused

BAD = [
    pytest.param(value, text, id=f"N1-{name}")
    for name, value, text in (
        ("nan", math.nan, "must be a finite number, got nan"),
        ("inf", math.inf, "must be a finite number, got inf"),
        ("-inf", -math.inf, "must be a finite number, got -inf"),
        ("1e39", 1e39, "must not exceed 3.4e38 in magnitude, got 1e+39"),
        ("bool", True, "must be numbers, got "),
        ("None", None, "must be numbers, got "),
        ("str", "1", "must be numbers, got "),
    )
]


def refused(name: str, index: str, text: str, error: ValueError) -> None:
    """The message names the field; and, where the value is a number, says which one and all that is wrong."""
    if text.endswith(" "):
        assert str(error).startswith(f"{name}: {text}") or str(error).startswith(f"{name}{index}: {text}")
    else:
        assert str(error) == f"{name}{index}: {text}"


@pytest.mark.parametrize(("value", "text"), BAD)
@pytest.mark.parametrize(
    "field", ["position", "lookat", "up", "horizontal_fov", "resolution", "max_bounces", "square_pixels"]
)
def test_N1_camera(field: str, value: object, text: str) -> None:
    """Something that is no number reaches the kernel: speckles, or a hang."""
    if field == "square_pixels" and isinstance(value, bool):
        pytest.skip("the one field that a bool is right for")
    if field == "horizontal_fov" and value is None:
        pytest.skip("which says that there is none, as fov may be given")
    vector = field in ("position", "lookat", "up")
    given = {"resolution": (8, value)}.get(field, (0.5, 0.25, value) if vector else value)
    with pytest.raises(ValueError) as caught:
        Camera(**{field: given})  # type: ignore[arg-type]
    if vector or field == "horizontal_fov":
        refused(f"camera.{field}", "[2]" if vector else "", text, caught.value)
    else:
        assert str(caught.value).startswith(f"camera.{field}: must be ")


@pytest.mark.parametrize(("value", "text"), BAD)
@pytest.mark.parametrize("field", ["color", "position", "direction", "alpha1", "alpha2"])
def test_N1_lights(field: str, value: object, text: str) -> None:
    """As for the camera."""
    vector = field not in ("alpha1", "alpha2")
    given = {"position": (1, 2, 3), "direction": (0, 0, -1), "alpha1": 0, "alpha2": 180, "color": (1, 1, 1)}
    given[field] = (0.5, 0.25, value) if vector else value  # type: ignore[assignment]
    with pytest.raises(ValueError) as caught:
        balls(Camera(), [((0, 0, -5), 1)], [ambient_light(), spot_light(**given)])  # type: ignore[arg-type]
    if text.endswith(" "):
        assert field in str(caught.value)
    else:
        assert str(caught.value) == f"lights.{field}[1]{'[2]' if vector else ''}: {text}"


@pytest.mark.parametrize(("value", "text"), BAD)
@pytest.mark.parametrize("field", ["centers", "radii", "colors", "ka", "kd", "ks", "exponent"])
def test_N1_spheres_and_materials(field: str, value: object, text: str) -> None:
    """As for the camera."""
    vector = field in ("centers", "colors")
    kept = value if isinstance(value, float) else [value]  # an array of numbers with one bad one, or all bad
    one = [0.5, 0.25, kept] if isinstance(value, float) else [value] * 3
    given = {"centers": [(0, 0, -5), (0, 0, -6)], "radii": [1, 2]}
    if isinstance(value, float):
        given[field] = [(0.5, 0.25, 0.5), one] if vector else [0.5, value]
    else:
        given[field] = [one, one] if vector else [value, value]
    with pytest.raises(ValueError) as caught:
        Scene.from_spheres(Camera(), [], **given)  # type: ignore[arg-type]
    if text.endswith(" "):
        refused(field, "", text, caught.value)
    else:
        assert str(caught.value) == f"{field}[1]{'[2]' if vector else ''}: {text}"


def test_N1_a_bool_among_numbers() -> None:
    """As numpy would turn it into a number."""
    with pytest.raises(ValueError) as caught:
        Scene.from_spheres(Camera(), [], [(0, 0, True)], [1])
    assert str(caught.value) == "centers: must be numbers, got True among them"


@pytest.mark.parametrize(("value", "text"), BAD)
def test_N1_background(value: object, text: str) -> None:
    """As for the camera."""
    if isinstance(value, str):
        text = "must be numbers, the name of a colour in CSS, or #rrggbb, got "
    with pytest.raises(ValueError) as caught:
        balls(Camera(), [((0, 0, -5), 1)], background=(0, 0.5, value))  # type: ignore[arg-type]
    refused("background", "[2]", text, caught.value)
