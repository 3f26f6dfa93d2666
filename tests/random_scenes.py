"""Random scenes: any size, place, orientation, kind and number of lights, overlapping spheres; and hostile ones."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

import cltrace
from cltrace import Camera, Scene


def tunnel(count: int) -> tuple[np.ndarray, np.ndarray]:
    """The centres and the radii of balls on the wall of a tunnel along z. Seen from in it, most are far down."""
    rng = np.random.default_rng(9)
    angle, z = rng.uniform(0, 2 * math.pi, count), rng.uniform(-40, 0, count)
    centers = np.column_stack([np.cos(angle), np.sin(angle), z])
    return centers, rng.uniform(0.03, 0.06, count)


def random_scene(seed: int) -> Scene:
    """A scene of 1 to 11 spheres, 0 to 3 lights and about 48x36 pixels, always the same for a seed."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 12))
    eye = rng.normal(size=3) * 10.0 ** rng.integers(-3, 7)
    scale = 10.0 ** rng.integers(-6, 7)
    view = rng.normal(size=3)
    view /= np.linalg.norm(view)
    middle = eye + scale * 5 * view
    lights = [cltrace.ambient_light(rng.uniform(0, 0.5, 3))]
    for _ in range(rng.integers(0, 4)):
        kind = rng.integers(0, 3)
        color = rng.uniform(0, 1, 3)
        position = middle + scale * rng.normal(size=3) * 5
        if kind == 0:
            lights.append(cltrace.parallel_light(rng.normal(size=3), color))
        elif kind == 1:
            lights.append(cltrace.point_light(position, color))
        else:
            inner, outer = rng.uniform(0, 30), rng.uniform(30, 60)
            lights.append(cltrace.spot_light(position, middle - position, inner, outer, color))
    size = [(48, 36), (36, 48), (47, 33), (40, 40)][rng.integers(0, 4)]
    up, fov = rng.normal(size=3), float(rng.uniform(5, 60))
    camera = Camera(eye, eye + scale * view, up, fov, size, square_pixels=False)
    return Scene.from_spheres(
        camera,
        lights,
        middle + scale * rng.normal(size=(n, 3)) * 2,
        scale * rng.uniform(0.1, 1.5, n),
        rng.uniform(0, 1, (n, 3)),
        ka=rng.uniform(0, 0.5, n),
        kd=rng.uniform(0, 1, n),
        ks=rng.uniform(0, 1, n),
        exponent=rng.choice([0, 0.5, 1, 20, 200, 1e4, 1e6], n),
        background=tuple(rng.uniform(0, 1, 3)),
    )


def usual_scene() -> Scene:
    """One that needs what scenes/step3-shadows.xml needs, so that tests of other things share programs."""
    return random_scene(101)


def crowded(scene: Scene, seed: int) -> Scene:
    """The same with 20 to 60 spheres for each one: smaller ones around it, and itself."""
    rng = np.random.default_rng((seed, 2))
    spheres = np.repeat(scene.spheres, rng.integers(20, 60))
    copies = np.ones(len(spheres), bool)
    copies[:: len(spheres) // len(scene.spheres)] = False
    shift = rng.normal(size=(len(spheres), 3)) * spheres["radius"][:, None]
    size = 10.0 ** rng.uniform(-2, 0, len(spheres))
    limit = 3.4e38
    center = spheres["center"] + np.where(copies, 1, 0)[:, None] * np.clip(shift, -limit, limit)
    spheres["center"] = np.where(np.abs(center) < 2.0**-149, 0, np.clip(center, -limit, limit))
    spheres["radius"] = np.maximum(spheres["radius"] * np.where(copies, size, 1), 2.0**-149)
    return dataclasses.replace(scene, spheres=spheres)


def random_tree(seed: int, ellipsoids: bool = False, touching: bool = True) -> Scene:
    """random_scene() with mirrors, glass and what is both, up to 12 bounces deep, always the same for a seed.

    Sometimes all is in a room that mirrors, or the eye in a ball of glass. ellipsoids: half of the spheres become some,
    of which some are a thousand times as long as wide, or as wide as long; touching: some spheres are there twice, have
    a shell that is larger by 2^-10 .. 2^-52, or touch one of their size.
    """
    rng = np.random.default_rng((seed, 3))
    plain = random_scene(seed)
    camera, spheres = plain.camera, plain.spheres
    scale = float(np.max(spheres["radius"]))
    eye, at = np.array(camera.position), np.array(camera.lookat)
    centers, radii = list(spheres["center"]), list(spheres["radius"])
    if touching:
        for k in rng.integers(0, len(spheres), rng.integers(0, 4)).tolist():
            shell = rng.choice([1, 1 + 2.0**-10, 1 + 2.0**-30, 1 + 2.0**-50, 1 + 2.0**-52])
            beside = rng.normal(size=3)
            beside *= 2 * radii[k] / np.linalg.norm(beside)
            centers.append(centers[k] + beside * (rng.random() < 0.3))
            radii.append(radii[k] * shell)
    glass_around_eye, room = rng.random() < 0.2, rng.random() < 0.3
    if glass_around_eye:
        centers.append(eye + 0.2 * scale * rng.normal(size=3))
        radii.append(scale * rng.uniform(0.7, 2))
    if room:
        centers.append(at + 2 * scale * rng.normal(size=3))
        radii.append(scale * rng.uniform(30, 300))
    n = len(radii)
    bounces = int(rng.choice([0, 1, 2, 3, 5, 8, 12]))
    # What is both makes two rays of one: only where few may follow.
    kinds = rng.choice(4, n, p=(0.25, 0.3, 0.25, 0.2) if bounces <= 5 else (0.3, 0.4, 0.3, 0))
    if glass_around_eye:
        kinds[n - 1 - room] = 2
    if room:
        kinds[-1] = rng.choice([0, 1])
    kinds[0] = rng.choice([1, 2])
    r = np.where((kinds == 1) | (kinds == 3), rng.choice([0.2, 0.5, 0.9, 1], n), 0)
    t = np.where((kinds == 2) | (kinds == 3), rng.choice([0.1, 0.5, 0.8, 1], n), 0)
    index = np.where(t > 0, rng.choice([1, 1.05, 1.33, 1.5, 2.5, 0.8, 1e3], n), rng.choice([0, 1, 1.5], n))
    transform = None
    if ellipsoids:
        transform = np.array(
            [stretched(rng) if rng.random() < 0.5 and i < len(spheres) else np.eye(3) for i in range(n)]
        )
    return Scene.from_spheres(
        dataclasses.replace(camera, max_bounces=bounces),
        plain.lights,
        centers,
        radii,
        rng.uniform(0, 1, (n, 3)),
        ka=rng.uniform(0, 0.5, n),
        kd=rng.uniform(0, 1, n),
        ks=rng.uniform(0, 1, n),
        exponent=rng.choice([0, 0.5, 1, 20, 200, 1e4], n),
        reflectance=r,
        transmittance=t,
        index=index,
        transform=transform,
        background=plain.background,
    )


def stretched(rng: np.random.Generator) -> np.ndarray:
    """A random linear map, (3, 3): turned, stretched by up to 1000, turned again, and perhaps mirrored."""
    (one, _), (two, _) = (np.linalg.qr(rng.normal(size=(3, 3))) for _ in range(2))
    size = 10.0 ** rng.uniform(-0.5, 0.3, 3) if rng.random() < 0.8 else rng.choice([1, 1e-3], 3)
    return np.asarray(one @ np.diag(size * rng.choice([1, -1], 3)) @ two)


def fuzzed_scene(seed: int) -> Scene:
    """A scene of random bits: up to 6 spheres, 3 lights, 9x7 pixels, always the same for a seed.

    Numbers are any that float32 has, subnormal ones, too, and often the same number twice: spheres in one place, lights
    and the eye in centres and on surfaces.
    """
    rng = np.random.default_rng((seed, 1))
    bits = rng.integers(0, 0x7F7FC99E, 12, np.uint32).view(np.float32)  # up to 3.4e38
    pool = bits.astype(float) * rng.choice([1, -1], 12)
    pool[rng.integers(0, 12, rng.integers(0, 6))] = rng.choice([0.0, 1.0, -1.0, 2.0**-149, 3.4e38, -3.4e38])
    radii = np.where(pool == 0, 1.0, np.abs(pool))

    def vector() -> tuple[float, float, float]:
        x, y, z = rng.choice(pool, 3)
        return (float(x), float(y), float(z))

    n = int(rng.integers(1, 7))
    centers, radius = np.array([vector() for _ in range(n)]), rng.choice(radii, n)
    if rng.random() < 0.5:
        centers[rng.integers(0, n)] = centers[0]
    color = tuple(rng.choice([0, 1e-30, 0.5, 1, 3.4e38], 3))
    lights = [cltrace.ambient_light(color)]
    for _ in range(rng.integers(0, 4)):
        place = tuple(centers[0]) if rng.random() < 0.2 else vector()
        direction = vector()
        direction = direction if any(direction) else (0.0, -1.0, 0.0)
        kind = rng.integers(0, 3)
        if kind == 0:
            lights.append(cltrace.parallel_light(direction, color))
        elif kind == 1:
            lights.append(cltrace.point_light(place, color))
        else:
            lights.append(cltrace.spot_light(place, direction, *rng.choice([(0, 0), (10, 60), (180, 180)]), color))
    eye = tuple(centers[0]) if rng.random() < 0.2 else vector()
    fov = float(rng.choice([1e-3, 1.0, 30.0, 60.0, 89.9]))
    try:
        at = vector() if rng.random() < 0.5 else tuple(centers[0])
        camera = Camera(eye, at, vector(), fov, (9, 7), square_pixels=False)
    except ValueError:  # it looks nowhere: towards 0, from as far out as the eye is
        depth = eye[2] - (1.0 if eye[2] == 0 else math.copysign(max(1.0, abs(eye[2])), eye[2]))
        camera = Camera(eye, (eye[0], eye[1], depth), (0, 1, 0), fov, (9, 7), square_pixels=False)
    return Scene.from_spheres(
        camera,
        lights,
        centers,
        radius,
        rng.choice([0, 0.5, 1, 1e30], (n, 3)),
        ka=0.1,
        kd=rng.choice([0, 0.5, 1, 1e30], n),
        ks=rng.choice([0, 0.5, 1, 1e30], n),
        exponent=rng.choice([0, 1e-30, 0.5, 50, 1e6, 3e38], n),
    )


def fuzzed_tree(seed: int) -> Scene:
    """fuzzed_scene() with mirrors and glass of any strength and index, up to 6 bounces deep."""
    scene, rng = fuzzed_scene(seed), np.random.default_rng((seed, 9))
    materials, n = scene.materials.copy(), len(scene.materials)
    kinds, strengths = rng.integers(0, 4, n), [1e-30, 0.5, 1, 2, 1e30]
    materials["reflectance"] = np.where(kinds % 2 == 1, rng.choice(strengths, n), 0)
    materials["transmittance"] = np.where(kinds >= 2, rng.choice(strengths, n), 0)
    materials["index"] = np.where(kinds >= 2, rng.choice([1e-38, 1e-3, 1, 1.5, 1e3, 3e38], n), 0)
    camera = dataclasses.replace(scene.camera, max_bounces=int(rng.choice([0, 1, 3, 6])))
    return dataclasses.replace(scene, materials=materials, camera=camera)


def bare(scene: Scene) -> Scene:
    """The same in ambient light alone, so that the colours do not depend on how the light's formulas are rounded."""
    materials = scene.materials.copy()
    materials["ka"], materials["kd"], materials["ks"] = 1, 0, 0
    return dataclasses.replace(scene, materials=materials, lights=cltrace.ambient_light((1, 1, 1)))


def splitting(scene: Scene, bounces: int) -> Scene:
    """The same where all that mirrors is glass, too, and all glass mirrors: rays double at every hit."""
    materials = scene.materials.copy()
    both = (materials["reflectance"] > 0) | (materials["transmittance"] > 0)
    for name in ("reflectance", "transmittance"):
        materials[name][both & (materials[name] == 0)] = 0.375
    materials["index"][both & (materials["index"] == 0)] = 1.25
    return dataclasses.replace(
        scene, materials=materials, camera=dataclasses.replace(scene.camera, max_bounces=bounces)
    )


def crowd(seed: int, count: int) -> Scene:
    """Mirrors, glass and opaque balls of all sizes around the eye, some huge, some tiny, many through each other.

    With an odd seed, half of the smaller ones are ellipsoids.
    """
    rng = np.random.default_rng(seed)
    radii = 10.0 ** rng.uniform(-3, 0, count)
    radii[: count // 50] = 10.0 ** rng.uniform(1, 4, count // 50)
    way = rng.normal(size=(count, 3))
    way *= ((rng.uniform(1, 12, count) + radii) / np.linalg.norm(way, axis=1))[:, None]
    # A wall of balls that touch in rows, exactly, and shells of one another.
    wall = np.stack(np.meshgrid(np.arange(-6, 7), np.arange(-5, 6), [-14]), -1).reshape(-1, 3)
    centers = np.concatenate([way, wall, wall[::3]])
    radii = np.concatenate([radii, np.full(len(wall), 0.5), np.full(len(wall[::3]), 0.5 + 2.0**-20)])
    kinds = rng.integers(0, 3, len(radii))
    bent = (rng.random(len(radii)) < 0.5) & (radii < 1)
    maps = np.array([stretched(rng) if b else np.eye(3) for b in bent]) if seed % 2 else None
    return Scene.from_spheres(
        Camera((0, 0, 0), (0, 0, -1), (0.1, 1, 0), math.degrees(math.atan(0.8)), (64, 48), max_bounces=6),
        [cltrace.ambient_light(), cltrace.point_light((1, 2, 3)), cltrace.parallel_light((1, -2, -1), (0.5, 0.5, 0.5))],
        centers,
        radii,
        np.random.default_rng(seed).integers(1, 65, (len(radii), 3)) / 64,
        reflectance=np.where(kinds == 1, 0.75, 0),
        transmittance=np.where(kinds == 2, 0.75, 0),
        index=1.5,
        transform=maps,
        background=(0.2, 0.3, 0.4),
    )
