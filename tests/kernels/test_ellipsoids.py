"""Ellipsoids: spheres seen in stretched worlds, and school-book rays off, through and within them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from glowing import (
    BLUE,
    GREEN,
    NIGHT,
    RED,
    WHITE,
    A,
    B,
    Beams,
    Row,
    eye,
    glowing,
    shades,
    show,
    targets,
)
from hostile.sphere_scenes import directions, looking, unit
from stress_cases import channel, picture

from cltrace import Camera, Renderer, Scene, point_light
from cltrace.run.devices import Device
from cltrace.students.check import check


def seen_stretched(scale: Row, camera: Camera) -> Camera:
    """The camera that sees the world stretched by diag(s, s, 1) or diag(1, 1, s) as `camera`, along -z, sees it."""
    sx, sy, sz = scale
    assert sx == sy
    tan = camera.image_plane()[0] * sx / sz
    at = tuple(float(s * p) for s, p in zip(scale, camera.position, strict=True))
    return replace(looking(at, tan, camera.resolution), max_bounces=camera.max_bounces)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [(0.5, 0.5, 1.0), (4.0, 4.0, 1.0), (1.0, 1.0, 8.0), (1.0, 1.0, 0.001)])
def test_ellipsoids_are_stretched_spheres(device: Device, scale: Row) -> None:
    """The world stretched along the camera's axes, seen by a camera whose rays are stretched: what is hit is the same.

    Lines stay lines, so shadows stay shadows, and n.l keeps its sign. t stays, too: distances are as the directions'
    lengths. Glass of index 1 bends nothing in either world, so that whole trees are the same.
    """
    rng = np.random.default_rng(8)
    n, L = 9, np.diag(scale)
    camera = eye(12, tan=0.5, size=(48, 36))
    centers, radii = rng.uniform(-2, 2, (n, 3)) + (0, 0, -7), rng.uniform(0.3, 1, n)
    lights = [(3.0, 4.0, -1.0), (-5.0, 2.0, -7.0)]
    glass = np.where(np.arange(n) % 2, 0.5, 0.0)
    other = seen_stretched(scale, camera)
    d, e = directions(camera), directions(other)
    length = np.sqrt((e * e).sum(axis=1) / (d * d).sum(axis=1))
    # By how much a direction of the other camera is longer than the stretched one: it has z = -1.
    length *= scale[2]
    pairs = []
    for color, light in zip((RED, GREEN), lights, strict=True):
        plain = Scene.from_spheres(camera, [point_light(light, color)], centers, radii, WHITE, ka=0, kd=1, ks=0)
        stretched = Scene.from_spheres(
            other, [point_light(L @ light, color)], centers @ L, radii, WHITE, ka=0, kd=1, ks=0, transform=L
        )
        pairs.append((plain, stretched))
    for one, two in ((picture(a, device), picture(b, device)) for a, b in pairs):
        assert np.array_equal(one.id, two.id)
        assert (one.id >= 0).mean() > 0.15
        hit = one.id.ravel() >= 0
        assert np.allclose(channel(two, "depth")[hit], channel(one, "depth")[hit] * length[hit], rtol=1e-11, atol=0)
        assert np.array_equal(one.shadow_rays, two.shadow_rays)
        assert np.array_equal(one.color > 0, two.color > 0)
    shown = {"colors": shades(n), "background": NIGHT, "transmittance": glass, "index": 1.0}
    plain = glowing(camera, list(zip(centers, radii, strict=True)), **shown)
    stretched = glowing(other, list(zip(centers @ L, radii, strict=True)), transform=L, **shown)
    assert np.array_equal(show(plain, device), show(stretched, device))


def turn(seed: int) -> np.ndarray:
    """A random rotation, (3, 3)."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return np.asarray(q if np.linalg.det(q) > 0 else -q)


SHAPES = {
    "egg": np.diag([1.0, 0.5, 0.75]),
    "turned egg": turn(1) @ np.diag([1.0, 0.5, 0.75]) @ turn(2),
    "mirrored egg": turn(3) @ np.diag([-1.0, 0.5, 0.75]),
    "needle": turn(4) @ np.diag([1.0, 0.001, 0.001]),
    "disc": turn(5) @ np.diag([1.0, 1.0, 0.001]),
    "sheared": np.array([[1.0, 0.5, 0.0], [0.0, 1.0, -0.25], [0.0, 0.0, 0.5]]),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_rays_off_and_through_ellipsoids(device: Device, shape: str) -> None:
    """Mirrored at the surface, and bent into it and out of it: school-book rays with n = K^T K (x - c) hit their peas.

    A needle's normals turn by a thousandth of its length: what double rounds to 1e-16 is 1e-10 there.
    """
    L, center = SHAPES[shape], (0.25, -0.5, -6.0)
    K = np.linalg.inv(L.astype(float)).astype(np.longdouble)
    for _ in range(3):  # Newton's iteration: the inverse to long double
        K = K + K @ (np.eye(3) - L.astype(np.longdouble) @ K)
    thin = min(abs(np.linalg.svd(L)[1]))
    camera = eye(2, at=(center[0], center[1], center[2] + 8), tan=0.02 * thin)
    pea = 1e-9 if thin > 0.1 else 1e-6
    front, n = Beams.of(camera).meet(center, 1.0, K=K)
    back, m = front.bent(n, 1.25).meet(center, 1.0, far=True, K=K)
    ways = [front.mirrored(n).at(3), back.bent(m, 1 / 1.25).at(3)]
    scene, colors = targets(camera, [(center, 1.0)], ways, pea, L, reflectance=0.5, transmittance=0.5, index=1.25)
    got = show(scene, device)
    assert (picture(scene, device).id == 0).all()
    # What is mirrored within shows the ellipsoid's black at depth 3, or leaves into the black night.
    assert (got == (0.5 * colors[0] + 0.25 * colors[1]).astype(np.float32)).all()


def test_uniform_transforms_leave_a_sphere(device: Device) -> None:
    """Doubled and mirrored, or turned: bit for bit the picture of the sphere of that radius."""
    camera = eye(8, tan=0.4, size=(24, 18))
    centers = [(0.2, 0.1, -6), (1.5, 0.5, -8)]
    want = picture(glowing(camera, [(c, 1.0) for c in centers], [A, B], reflectance=0.5), device)
    for L in (2 * np.eye(3), np.diag([-2.0, 2.0, 2.0]), 2 * np.eye(3)[[1, 2, 0]]):
        got = picture(glowing(camera, [(c, 0.5) for c in centers], [A, B], reflectance=0.5, transform=L), device)
        assert np.array_equal(want.color, got.color)
        assert np.array_equal(want.depth, got.depth)


@pytest.mark.slow
def test_ellipsoids_close_their_rooms(device: Device) -> None:
    """Within mirrors that are eggs, needles and discs no ray gets out; alone outside, each mirrors the night once."""
    for k, (name, L) in enumerate(SHAPES.items()):
        thin = min(np.linalg.svd(L)[1])
        at = (0.3 * thin * unit(np.random.default_rng(k))).tolist()
        inside = glowing(eye(20, at=at, tan=2), [((0, 0, 0), 1)], GREEN, RED, reflectance=0.75, transform=L)
        color = show(inside, device)
        assert (color[:, 0] == 0).all(), name
        assert np.abs(color[:, 1] - 1).max() <= 2.0**-23, name
        camera = eye(20, at=(0, 0, 5), tan=min(0.25, thin), size=(24, 18))
        image = picture(glowing(camera, [((0, 0, 0), 1)], RED, BLUE, reflectance=1, transform=L), device)
        assert (image.color == BLUE).all(), name
        assert (image.id == 0).any(), name
        # Half from the first wall, a quarter from the second, a quarter of the night.
        glass = glowing(camera, [((0, 0, 0), 1)], RED, BLUE, transmittance=0.5, index=1.0, transform=L)
        image = picture(glass, device)
        assert (image.color[image.id == 0] == (0.75, 0, 0.25)).all(), name


def test_flat_ellipsoids_that_doubles_have_in_one_place_with_the_point(any_device: Device) -> None:
    """Found by a scale of 1e-26: in its own axes the point was the centre, whose normal was NaN, and which ended the
    reference's check with a ZeroDivisionError."""
    for flat in (1e-16, 1e-26):
        scene = Scene.from_spheres(
            Camera((0, 0, 6), (0, 0, 0), resolution=(1, 1), max_bounces=1),
            [point_light((3, 4, 5))],
            np.zeros((1, 3)),
            1.0,
            reflectance=0.5,
            transform=np.diag([1, 1, flat]),
        )
        image = Renderer(scene, any_device, outputs=("rgb8", "color", "normal", "id")).render()
        assert check(scene, image, "accurate").ok
        assert image.normal[0, 0].tolist() == [0, 0, 1]
