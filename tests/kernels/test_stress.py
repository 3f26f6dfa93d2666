"""The stress catalogue, held against the exact oracle, and colours against the reference: `pytest -k L9`.

The cases are those of tests/hostile/catalogue.py, which says of each what could go wrong. test_case asks of all of them
what the catalogue requires; what is known of single pictures beyond that has tests of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import mpmath
import numpy as np
import pyopencl as cl
import pytest
from exact_rays import angle
from hostile.catalogue import AT_THE_POINT, GREYS, Case, cases
from hostile.sphere_scenes import Ball, balls, everything, looking, unit
from stress_cases import OUTPUTS, channel, check, check_case, picture, renderer, wrong_pixels

import cltrace
from cltrace import Camera, Image, Renderer, Scene, ambient_light, parallel_light, point_light, spot_light
from cltrace.run.devices import Device

# double leaves out the filter, and that is all: in the ordinary run a few cases are enough.
mostly = pytest.mark.parametrize("precision", ["accurate", pytest.param("double", marks=pytest.mark.stress)])


def each(*names: str) -> pytest.MarkDecorator:
    """A test of each case of these names."""
    found = cases(*names)
    return pytest.mark.parametrize("case", found, ids=[f"{case.name}-{case.what}" for case in found])


def drawn(case: Case, device: Device, precision: str = "accurate") -> Iterator[tuple[Scene, Image]]:
    """A case's scenes and their pictures."""
    return ((scene, picture(scene, device, precision)) for scene in case.scenes(1))


def middle(image: Image) -> tuple[int, int]:
    return image.id.shape[0] // 2, image.id.shape[1] // 2


def same(a: cltrace.Image, b: cltrace.Image, *names: str) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in names or OUTPUTS)


@pytest.mark.parametrize("amount", [pytest.param(1, id="short"), pytest.param(16, id="long", marks=pytest.mark.stress)])
@mostly
@each()
def test_case(device: Device, precision: str, amount: int, case: Case) -> None:
    """What the catalogue requires. amount: how many times as much as in the ordinary run."""
    check_case(case, device, precision, amount)


@mostly
@each("G1", "G2", "G3", "G5")
def test_G_no_rings(device: Device, precision: str, case: Case) -> None:
    """Along every column the ground is the farther the higher, and its normal turns one way."""
    for _, image in drawn(case, device, precision):
        depth, n = image.depth[::-1], image.normal[::-1]
        seen = np.isfinite(depth[:-1]) & np.isfinite(depth[1:])
        assert seen.any()
        assert (depth[1:][seen] >= depth[:-1][seen]).all()
        assert (n[1:, :, 2][seen] <= n[:-1, :, 2][seen]).all()


@mostly
@each("K")
def test_K_powers_of_two_change_no_bit(device: Device, precision: str, case: Case) -> None:
    (base, one), *others = drawn(case, device, precision)
    for scene, other in others:
        assert same(one, other, "rgb8", "id", "color", "normal", "direction", "shadow_rays")
        factor = scene.spheres["radius"][0] / base.spheres["radius"][0]
        assert np.array_equal(other.depth / factor, one.depth)


def test_R2_duplicates_and_permutations(device: Device, width: int) -> None:
    """Equal spheres fight for pixels: who wins depends on the order of the work."""
    rng = np.random.default_rng(8)
    one = picture(everything(), device, "accurate", width)
    for _ in range(3):
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
@each("I2", "I4")
def test_I_along_the_axis(device: Device, precision: str, case: Case) -> None:
    """From the surface, outward is a miss, tangential too, and inward t = 2b/a; from the centre, t is the radius."""
    for scene, image in drawn(case, device, precision):
        sphere, ahead = scene.spheres[0], -np.array(scene.camera.basis()[2])
        far = 2 * float(sphere["center"] @ ahead) if case.name == "I2" else sphere["radius"]
        assert ((image.normal * image.direction).sum(axis=-1)[image.id >= 0] < 0).all()
        assert image.id[middle(image)] == (0 if far > 0 else -1)
        assert image.depth[middle(image)] == (far if far > 0 else np.inf)


@mostly
@pytest.mark.parametrize(
    ("name", "bright"),
    [("L2", (True, True, False, False, False, False, True)), ("L5", (True, False)), ("L3", (False, False))],
)
def test_L_light_at_p(device: Device, precision: str, name: str, bright: tuple[bool, ...]) -> None:
    """Whether each light reaches P, by hand; the parallel one never does past the occluder ahead of it."""
    (case,) = cases(name)
    for reaches, (scene, image) in zip(bright, drawn(case, device, precision), strict=name != "L3"):
        assert image.depth[4, 5] == 4
        assert image.color[4, 5, 1] == 0 or scene.spheres["center"][1, 0] < 0
        assert (image.color[4, 5, 0] > 0) == reaches


@mostly
@each("L4")
def test_L4_room(device: Device, precision: str, case: Case) -> None:
    """Bright with the light in it or exactly on the wall, where nothing is between; else dark."""
    for bright, (_, image) in zip((1, 1, 1, 0, 0), drawn(case, device, precision), strict=True):
        assert (image.color[..., 1] == 0).all()
        assert ((image.color[..., 0] > 0) == bright).all()


@mostly
@each("L6")
def test_L6_light_at_the_point(device: Device, precision: str, case: Case) -> None:
    """No light, but for one that is straight above."""
    for light, (scene, image) in zip(AT_THE_POINT * 2, drawn(case, device, precision), strict=True):
        assert image.depth[3, 4] == scene.camera.position[2]
        assert image.color[3, 4, 1] == image.color[3, 4, 2] == 0
        assert 0 <= image.color[3, 4, 0] <= (1 if light == (0, 0, 1e-30) else 0)


@mostly
def test_L8_terminator(device: Device, precision: str) -> None:
    """n.l within an ulp of 0: a line of acne. It is the ambient colour, and no shadow ray is cast for n.l <= 0."""
    for e in (0, 2.0**-52, 1e-7, 1e-2):
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
def test_L9_shell_aslant(device: Device, precision: str, case: Case) -> None:
    """From between the two, looking anywhere, anywhere around the sphere."""
    rng = np.random.default_rng(11)
    for base in case.scenes(1) if "between" in case.what else ():
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
@each("C2")
def test_C2_wide(device: Device, precision: str, case: Case) -> None:
    """Where the edges of the picture are seen, to 40 digits."""
    scene, image = next(drawn(case, device, precision))
    camera = scene.camera
    with mpmath.workdps(40):
        exact = mpmath.tan(mpmath.mpf(camera.horizontal_fov) * mpmath.pi / 180)
        assert abs(camera.image_plane()[0] / exact - 1) < 1e-9
        x = exact * 400 / 401
        edge = [x / mpmath.hypot(x, 1), mpmath.mpf(0), -1 / mpmath.hypot(x, 1)]
    assert np.isfinite(image.direction).all()
    assert angle(image.direction[1, 400], edge) <= 1e-7
    assert angle(image.direction[1, 0], [-edge[0], *edge[1:]]) <= 1e-7


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
def test_C4_sizes(device: Device, width: int, size: tuple[int, int]) -> None:
    """Half a pixel off, width and height swapped, or the packets at the edge write behind the picture."""
    w, h = size
    camera = Camera(horizontal_fov=40, resolution=size, square_pixels=False)
    base = everything()
    scene = Scene(camera, base.lights, base.spheres, base.materials, base.background)
    whole = renderer(scene, device, "accurate", width)
    assert stays_within(whole)
    image = whole.render()
    crops = [(w // 2, h // 3, w, h), (w // 3, h // 4, w // 3 + 1, h // 4 + 1), (0, 0, max(1, w // 2), max(1, h // 2))]
    for crop in crops:
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


@mostly
@each("P1", "P2")
def test_P_highlights(device: Device, precision: str, case: Case) -> None:
    """Never above 1, 1 in the middle of the highlight, and as precise in colours as in bytes."""
    for scene, image in drawn(case, device, precision):
        if case.name == "P1" or scene.materials["exponent"][0] in (1e4, 1e6):
            assert wrong_pixels(scene, image, 200, 5e-6) == []
        assert image.color.max() <= 1
        if not scene.lights["position"].any():
            assert image.color[middle(image)].tolist() == [1, 1, 1]
        if case.name == "P1" and scene.materials["exponent"][0] == 0:
            # 1 where the surface faces the light, though r.v may be negative; else 0.
            assert set(np.unique(image.color[..., :2]).tolist()) == {0, 1}
            assert (image.color[..., :2].sum(axis=-1).ravel() <= channel(image, "shadow_rays")).all()


def test_P3_colours(device: Device) -> None:
    (case,) = cases("P3")
    (dim, image), *others = drawn(case, device, "accurate")
    want = [math.floor(min(1.0, grey) * 255 + 0.5) for grey in GREYS]
    assert image.rgb8[1, 1::2, 0].tolist() == want
    down = Renderer(dim, device, "accurate", OUTPUTS, truncate=True, keep=("features",)).render()
    assert down.rgb8[1, 1::2, 0].tolist() == [math.floor(min(1.0, np.float32(g)) * np.float32(255)) for g in GREYS]
    for _, strong in others[1:]:
        assert (strong.rgb8[1, 1::2][1:4] == 255).all()


@pytest.mark.parametrize("angle", [1e-7, 1e-9, 1e-12])
def test_C5_up_nearly_along_the_view(angle: float) -> None:
    """Axes that are not orthogonal: a skew picture."""
    axes = np.array(Camera((1, 2, 3), (4, -1, 5), (3 + angle, -3, 2)).basis(), np.longdouble)
    assert np.abs(axes @ axes.T - np.eye(3)).max() < 1e-15


GIVEN: dict[str, object] = {"centers": [(0, 0, -5), (0, 0, -6)], "radii": [1, 2]}
SPOT = {"position": (1, 2, 3), "direction": (0, 0, -1), "alpha1": 0, "alpha2": 180, "color": (1, 1, 1)}
TAKERS: list[tuple[str, Callable[..., object], dict[str, object], str]] = [
    *(("camera.{}", Camera, {name: value}, where) for name, value, where in (
        ("position", (0.5, 0.25, np.nan), "[2]"), ("lookat", (0.5, 0.25, np.nan), "[2]"), ("up", (0, np.nan, 1), "[1]"),
        ("horizontal_fov", np.nan, ""))),
    *(("lights.{}", lambda **one: balls(Camera(), [((0, 0, -5), 1)], [ambient_light(), spot_light(**SPOT | one)]),
       {name: np.nan if np.ndim(SPOT[name]) == 0 else (0.5, 0.25, np.nan)}, "[1]" + "[2]" * np.ndim(SPOT[name]))
      for name in SPOT),
    *(("{}", lambda **one: Scene.from_spheres(Camera(), [], **GIVEN | one), {name: [1, np.nan]}, "[1]")
      for name in ("radii", "ka", "kd", "ks", "exponent")),
    *(("{}", lambda **one: Scene.from_spheres(Camera(), [], **GIVEN | one), {name: [(0, 0, 1), (0, np.nan, 1)]},
       "[1][1]") for name in ("centers", "colors")),
]  # fmt: skip


@pytest.mark.parametrize(("name", "taker", "given", "where"), TAKERS, ids=[next(iter(one[2])) for one in TAKERS])
def test_N1_nan_is_refused(name: str, taker: Callable[..., object], given: dict[str, object], where: str) -> None:
    """Something that is no number reaches the kernel: speckles, or a hang. tests/scene/ has what else is refused."""
    with pytest.raises(ValueError) as caught:
        taker(**given)
    assert str(caught.value) == f"{name.format(*given)}{where}: must be a finite number, got nan"
