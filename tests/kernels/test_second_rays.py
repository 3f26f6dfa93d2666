"""The kernel's rays that leave mirrors, glass and ellipsoids, one by one, against the exact oracle; no excused band.

What is drawn, and how a picture tells what its rays met, is in tests/hostile/bounced_pictures.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from glowing import BLUE, GREEN, RED, glowing
from hostile.bounced_pictures import PICTURES, judge, named, names, scenes_of, second_rays
from stress_cases import OUTPUTS

from cltrace import Camera, Renderer, Scene
from cltrace.reference import world_of
from cltrace.reference.bounce import bounces
from cltrace.reference.trace import closest_hit, primary_ray
from cltrace.run.devices import Device

NAMES = list(PICTURES)


def judged(name: str, device: Device, count: int, side: int, cameras: int, **how: object) -> int:
    """How many second rays of a regime, `count` at least, meet what the oracle says; an error where one does not.

    side: of the pictures, pixels; cameras: of each scene.
    """
    rays, seed = 0, 0
    while rays < count:
        scenes = list(scenes_of(name, seed, (side, side), cameras))
        renderer = Renderer(scenes[0], device, "accurate", **how)  # type: ignore[arg-type]
        for scene in scenes:
            more, wrong = judge(scene, renderer.look(scene.camera).render())
            assert len(wrong) == 0, (name, seed, scene.camera, wrong[:5])
            rays += more
        seed += 1
    return rays


@pytest.mark.parametrize("name", [*NAMES[:-1], pytest.param(NAMES[-1], marks=pytest.mark.slow)])
def test_second_rays(device: Device, name: str) -> None:
    """By the kernel with all features, as other tests have it. Of a thousand balls the oracle takes its time."""
    count, side = (1, 12) if name == NAMES[-1] else (1400, 20)
    # test_tree.py has the program of these with ellipsoids.
    keep = ("features", "bounces") if "ellipsoids" in name or "needles" in name else ("features",)
    assert judged(name, device, count, side, 2, outputs=OUTPUTS, keep=keep) >= count


def test_where_four_spheres_touch(device: Device) -> None:
    """Rays that leave one of them within 1e-14 of the point where all of them touch: 1e-29 to the next wall."""
    eye, at = (
        (5.07645543443263, 2.024116890557057, 0.02937238966683875),
        (-27.74011487735315, -8.32745119012233, -12.577986366189567),
    )
    camera = Camera(
        eye, at, (-0.1834212375314393, -0.740125074085187, 0.08735958048014997), 9.007849785779933e-12, (24, 24), 0
    )
    centers = [(5, 2, -2), (5, 2, 2), (5, 2, 6), (5, 2, 0), (5, 2, 4)]
    scene = Scene.from_spheres(camera, (), centers, [2, 2, 2, 4, 4])
    scene = named(scene, np.array([True, True, True, False, False]), np.array([1, 1, 0.75, 2.5, 2.5]))
    rays, wrong = judge(scene, Renderer(scene, device, "accurate", OUTPUTS, keep=("features",)).render())
    assert rays == 24 * 24
    assert len(wrong) == 0


@pytest.mark.stress
@pytest.mark.parametrize("name", NAMES)
def test_a_million_second_rays(device: Device, name: str) -> None:
    """By the kernels that such scenes get."""
    assert judged(name, device, 1_000_000, 64, 8, outputs=("id", "color")) >= 1_000_000


@pytest.mark.stress
@pytest.mark.parametrize("name", ["shells an ulp apart", "ellipsoids", "a thousand balls round a mirror"])
def test_a_million_second_rays_one_by_one(device: Device, name: str) -> None:
    """In packets of one pixel, as GPUs get them."""
    assert judged(name, device, 1_000_000, 64, 8, outputs=("id", "color"), width=1) >= 1_000_000


@pytest.mark.parametrize("name", NAMES[:-1])  # of a thousand balls the reference takes its time
def test_they_are_the_reference_s(name: str) -> None:
    """Starts and directions to the bit, also where doubles are not sure."""
    compared = 0
    for seed in range(3):
        for scene in scenes_of(name, seed, (4, 3), 3):
            world = world_of(scene)
            seen = [closest_hit(world, primary_ray(scene.camera, i % 4, i // 4)) for i in range(12)]
            first = np.array([-1 if at is None else at.index for at in seen], np.int32)
            pixels, rays = second_rays(scene, first)
            for row, pixel in enumerate(pixels.tolist()):
                at, ray = seen[pixel], primary_ray(scene.camera, pixel % 4, pixel // 4)
                assert at is not None
                bounce, *more = bounces(ray, at)
                direction, weight = bounce.direction, bounce.share
                assert weight == 1
                assert more == []
                assert tuple(at.start.normal) == tuple(rays.normal[row]), (name, seed, pixel)
                assert tuple(direction) == tuple(rays.direction[row]), (name, seed, pixel)
                compared += 1
    assert compared > 60


def test_colours_name_surfaces() -> None:
    """255 digits a channel; white is the background, and everything else nothing."""
    scene = Scene.from_spheres(Camera(), (), np.zeros((70_000, 3)), 1)
    colors = named(scene, np.zeros(70_000, bool), np.ones(70_000)).materials["color"]
    assert np.array_equal(names(colors.astype(np.float32)), np.arange(70_000))
    assert names([(1, 1, 1), (0.5, 0.25, 1), (2.0**-9, 0, 0), (0, 0, -1 / 256), (0, 1 / 256, 0)]).tolist() == [
        -1,
        -2,
        -2,
        -2,
        255,
    ]


# -------------------------------------------------------------------------------------------------- leaks and self-hits

SIZES = [10.0**k for k in range(-3, 8)]


def lone_balls(rng: np.random.Generator, side: int) -> Iterator[Scene]:
    """Mirrors, each before balls that lie wholly in its shadow, as seen from the eye: none sees another one.

    Where the eye sees the first ball, its normal n has g.n <= 0 for every direction g in the cone that leads from the
    eye around the ball. The others are in that cone beyond the ball, so they are below the planes that touch it where
    it is seen; and a mirrored ray leaves such a plane. One ball touches the first one from behind but for rounding, one
    is of its size but for an ulp, and one is within.
    """
    for r in SIZES:
        for far in (0.0, 1.0, 1e3, 1e7 / r):
            center, axis, distance = far * r * rng.normal(size=3), rng.normal(size=3), r * 10.0 ** rng.uniform(0.1, 2)
            axis /= np.linalg.norm(axis)
            behind = [
                (center - 1.5 * r * axis, 0.5 * r),
                (center, np.nextafter(r, 0)),
                (center - 0.3 * r * axis, 0.6 * r),
            ]
            half = math.degrees(math.asin(r / distance)) * 10.0 ** rng.uniform(-3, 0)
            limb = np.cross(axis, rng.normal(size=3))
            at = center + r * limb / np.linalg.norm(limb) * rng.choice([0, 0.5, 1])
            camera = Camera(
                tuple(center + distance * axis), tuple(at), tuple(rng.normal(size=3)), half, (side, side), 8
            )
            yield glowing(camera, [(center, r), *behind], RED, BLUE, reflectance=1)


def closed_rooms(rng: np.random.Generator, side: int) -> Iterator[Scene]:
    """An eye in glass, or in a mirror, with an opaque ball around, larger by an ulp or by more, and one within."""
    for r in SIZES:
        for far in (0.0, 1.0, 1e3):
            for gap in (0.0, 2.0**-50, 1e-6, 0.1):
                center = far * r * rng.normal(size=3)
                at = center + 0.9 * r * rng.uniform(-0.5, 0.5, 3)
                outer, inner = np.nextafter(r, np.inf) * (1 + gap), (center + 0.5 * r * rng.normal(size=3), 0.1 * r)
                camera = Camera(
                    tuple(at), tuple(center + r * rng.normal(size=3)), tuple(rng.normal(size=3)), 60, (side, side), 8
                )
                glass = float(rng.random() < 0.7)
                yield glowing(
                    camera, [(center, r), (center, outer), inner], GREEN, RED, reflectance=[1 - glass, 0, 0.5],
                    transmittance=[glass, 0, 0], index=rng.choice([1, 1.5, 0.75]))  # fmt: skip


def check_lone_balls(device: Device, side: int, rounds: int) -> int:
    """How many mirrored rays see the background, as all of them must."""
    rays = 0
    for seed in range(rounds):
        for scene in lone_balls(np.random.default_rng(seed), side):
            image = Renderer(scene, device, "accurate", OUTPUTS, keep=("features",)).render()
            assert (image.id <= 0).all()
            assert (image.color == BLUE).all(), scene.camera
            rays += int((image.id == 0).sum())
    return rays


def check_closed_rooms(device: Device, side: int, rounds: int) -> int:
    """How many rays stay within opaque walls, as all of them must: one for each pixel, at least."""
    rays = 0
    for seed in range(rounds):
        for scene in closed_rooms(np.random.default_rng(seed), side):
            image = Renderer(scene, device, "accurate", OUTPUTS, keep=("features",)).render()
            assert (image.color[..., 0] == 0).all(), scene.camera
            assert (image.color[..., 1] == 1).all(), scene.camera
            rays += image.id.size
    return rays


def test_no_self_hits_and_no_leaks(device: Device) -> None:
    assert check_lone_balls(device, 16, 1) > 5_000
    assert check_closed_rooms(device, 12, 1) > 15_000


@pytest.mark.stress
def test_no_self_hits_in_ten_million_rays(device: Device) -> None:
    assert check_lone_balls(device, 384, 3) > 10_000_000


@pytest.mark.stress
def test_no_leaks_in_ten_million_rays(device: Device) -> None:
    assert check_closed_rooms(device, 200, 2) > 10_000_000
