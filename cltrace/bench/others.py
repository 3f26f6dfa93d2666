"""The rest of the stress catalogue: shapes that are no spheres, textures, orthographic cameras, means and updates.

Q ellipsoids, Y cylinders, H meshes, U textures, A orthographic cameras; of these the reference tracer, which decides
exactly, says what pictures must be. S means over pixels, which 64 x 64 rays a pixel judge; W updates, of which pictures
must be those of new scenes. `cltrace-bench --stress` draws these after catalogue.py's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from cltrace.picture.image import Output
from cltrace.plan.abi import Precision
from cltrace.renderers.renderer import Renderer
from cltrace.run.devices import Device
from cltrace.scene import Material, Mesh, Orthographic, Scene, ambient_light, point_light

from .cases import everything, frame, looking, unit
from .catalogue import Case, Limits, Scenes
from .regimes import REGIMES
from .scenes import bowl, checks, cloud, hills, painted, scattered, sticks
from .truth import means

# Of what the reference tracer judges; normals are interpolated, or of maps that round.
AS_TRACED = Limits(t_ulp=0.52, normal=1e-6)
LIGHTS = (ambient_light((0.2, 0.2, 0.2)), point_light((6, 8, 2), (0.7, 0.7, 0.7)))
# Half of the share of 64 rays that an edge along their columns may take for its pixel's, in levels of 255.
GRAIN = 255 / 64 / 2


@dataclass(frozen=True)
class Judged:
    """A case that is not one picture: its name, what it is, a judge that says how many pixels are wrong of how many.

    most: the share of them that may be.
    """

    name: str
    what: str
    judge: Callable[[Device, Precision], tuple[int, int]]
    most: float = 0.0


# ------------------------------------------------------------------------------------------------------------- shapes


def _ellipsoids(thin: float, far: float, amount: int) -> Scenes:
    """In object space a thin ellipsoid's ray is long, and what is near 0 in the discriminant is the noise of a map."""
    rng = np.random.default_rng(3)
    for _ in range(2 * amount):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        maps = [turn @ np.diag(scale) for scale in ((1, thin, 1), (thin, thin, 1), (1, 1, 1))]
        places = far * np.array([0, 0, -1]) + rng.uniform(-1, 1, (3, 3))
        yield Scene.from_spheres(looking(tan=2 / far, size=frame(1, 300)), LIGHTS, places, 1, transform=maps, ka=0.1)


def _cylinders(radius: float, far: float, amount: int) -> Scenes:
    """A thin cylinder's ray passes at its radius but for digits that float32 does not have, and ends are lost."""
    rng = np.random.default_rng(4)
    for _ in range(2 * amount):
        middles = far * np.array([0, 0, -1]) + radius * rng.uniform(-1, 1, (4, 3))
        points = np.stack([middles - (way := unit(rng, 4)), middles + way], axis=1).reshape(-1, 3)
        yield Scene.from_spheres(
            looking(tan=3 * radius / far, size=frame(1, 300)), LIGHTS, points, 2 * radius,
            bonds=np.arange(8).reshape(4, 2), bond_radius=radius, ka=0.1,
        )  # fmt: skip


def _along_cylinders(amount: int) -> Scenes:
    """A ray along an axis has no quadratic equation, and one through the end's rim meets two surfaces at one point."""
    for radius in (1.0, 1e-3):
        for eye in ((0, 0, 5), (radius, 0, 5), (0.5 * radius, 0, 0)):
            ends = [(0, 0, 2), (0, 0, -2)]
            camera = looking(eye, radius, frame(amount, 200))
            yield Scene.from_spheres(camera, LIGHTS, ends, 1e-3 * radius, bonds=[(0, 1)], bond_radius=radius, ka=0.1)


def _meshed(shape: str, offset: float, amount: int) -> Scenes:
    """Rays through edges hit both triangles or none, and slivers are missed; far away, so are their digits."""
    make: dict[str, Callable[[], tuple[Any, Any, Any]]] = {
        "ball": partial(bowl, 200),
        "hills": partial(hills, 200),
        "soup": partial(scattered, 200, 1),
        "slivers": partial(scattered, 2000, 0.1),
    }
    vertices, faces, normals = make[shape]()
    move = offset * np.array([1, -0.7, 0.3])
    camera = looking(move.tolist(), 0.6, frame(amount, 300))
    lights = (LIGHTS[0], point_light((np.array([6, 8, 2]) + move).tolist(), (0.7, 0.7, 0.7)))
    yield Scene.from_meshes(camera, lights, [Mesh(vertices + move, faces, normals, material=Material(ka=0.1))])


def _textured(amount: int) -> Scenes:
    """u wraps where it is 0 or 1, v at the poles is 0/0, and the borders of texels at 1e6 repeats are rounded away."""
    yield painted(12, frame(amount, 300))
    for repeats in (1.0, 1e3, 1e6):
        corners = [(-4, -1, 0), (4, -1, 0), (4, -1, -30), (-4, -1, -30)]
        uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * repeats
        mesh = Mesh(corners, [(0, 1, 2), (0, 2, 3)], uv=uv, material=Material(ka=0.1, texture=checks(16)))
        yield Scene.from_meshes(looking(tan=0.6, size=frame(amount, 300)), LIGHTS, [mesh])


def _flat(height: float, offset: float, amount: int) -> Scenes:
    """All rays have one direction, and begin at offsets of which float32 knows no digit that tells them apart."""
    rng = np.random.default_rng(5)
    centers = height * rng.uniform(-0.5, 0.5, (20, 3)) + (offset, -offset, -height)
    eye = (offset, -offset, 0.0)
    camera = Orthographic(eye, lookat=(offset, -offset, -1), up=(0, 1, 0), height=height, resolution=frame(amount, 300))
    lights = (LIGHTS[0], point_light((offset + 3 * height, -offset + 4 * height, height), (0.7, 0.7, 0.7)))
    yield Scene.from_spheres(camera, lights, centers, 0.1 * height, ka=0.1)


# -------------------------------------------------------------------------------------------------- means and updates


def _proved(make: Callable[[], Scene], device: Device, precision: Precision) -> tuple[int, int]:
    """Pixels whose mean is further from that of 64 x 64 rays than `error` says."""
    scene = make()
    image = Renderer(scene, device, precision, ("color", "error"), antialias="proved").render()
    off = np.abs(255 * image.color.astype(np.float64) - means(scene, device, precision)[0]).max(axis=2)
    return int((off > image.error + GRAIN).sum()), off.size


def _regime(name: str) -> Scene:
    """A hostile regime, lit so that limbs and shadows are edges."""
    scene = dict(REGIMES)[name](0, size=(20, 15))
    eye = np.array(scene.camera.position)
    return scene.lit_by([ambient_light((0.3, 0.3, 0.3)), point_light((eye + (1, 2, 0.5)).tolist(), (0.6, 0.6, 0.6))])


def _updated(change: str, device: Device, precision: Precision) -> tuple[int, int]:
    """Pixels of a Renderer that was changed that are not those of a new one, to the bit, in any output."""
    outputs: tuple[Output, ...] = ("rgb8", "color", "normal", "depth", "id")
    rng = np.random.default_rng(6)
    scene = cloud(200, (32, 24))
    one = Renderer(scene, device, precision, outputs)
    wrong = count = 0
    for k in range(4):
        if change == "camera":
            camera = replace(scene.camera, position=(1e-3 * 10.0**k, 0, 0), lookat=(1e-3 * 10.0**k, 0, -1))
            one = one.look(camera)
        elif change == "places":
            one.update(scene.spheres["center"] + rng.normal(0, 10.0 ** (k - 6), (200, 3)))
        elif change == "sizes":
            one.update(radii=scene.spheres["radius"] * 10.0 ** rng.uniform(-3, 0.5, 200))
        elif change == "colours":
            one.update(colors=rng.uniform(0, 1, (200, 3)), ks=[0.0, 0.5][k % 2])
        else:
            n = (50, 400, 1, 200)[k]
            one.update(unit(rng, n) * 3 - (0, 0, 7), np.full(n, 0.1), rng.uniform(0, 1, (n, 3)), ka=0.1, kd=0.8, ks=0.5,
                       exponent=50.0, reflectance=0.0, transmittance=0.0, index=1.0)  # fmt: skip
        got, want = one.render(), Renderer(one.scene, device, precision, outputs).render()
        apart = [(getattr(got, name) != getattr(want, name)).reshape(len(want.id.ravel()), -1) for name in outputs]
        wrong, count = wrong + int(np.concatenate(apart, axis=1).any(axis=1).sum()), count + want.id.size
    return wrong, count


# fmt: off
OTHERS: list[Case | Judged] = [
    *(Case("Q", f"ellipsoids, thin by {thin:g}, at {far:g}", partial(_ellipsoids, thin, far), AS_TRACED)
      for thin, far in ((0.5, 5), (1e-3, 5), (1e-3, 1e4))),
    *(Case("Y1", f"cylinders of r = {r:g} at {far:g}", partial(_cylinders, r, far), AS_TRACED)
      for r, far in ((0.1, 5), (1e-3, 5), (1e-3, 1e4))),
    Case("Y2", "along the axis and the wall of cylinders, and in them", _along_cylinders, AS_TRACED),
    *(Case("H", f"{shape}, {offset:g} off", partial(_meshed, shape, offset), AS_TRACED)
      for shape in ("ball", "hills", "soup", "slivers") for offset in (0, 1e6)),
    Case("U", "textures: seams, poles, 1e6 repeats", _textured, AS_TRACED),
    *(Case("A", f"orthographic, {height:g} high, {offset:g} off", partial(_flat, height, offset), AS_TRACED)
      for height, offset in ((10, 0), (1e-3, 1e3), (1e6, 0), (10, 1e7))),
    Judged("S", "means within their bounds: all lights", partial(_proved, everything)),
    # Of what is no sphere, `error` is an estimate that holds for 95 of 100.
    Judged("S", "means within their estimates: bonds", partial(_proved, partial(sticks, 64, (20, 15))), 0.05),
    *(Judged("S", f"means within their bounds: {name}", partial(_proved, partial(_regime, name)))
      for name in ("ground R=1e5 h=1", "far tiny r=1e-3 d=1e4", "grazing 2^-8..2^-26", "offset 1e7 r=10 d=50")),
    *(Judged("W", f"other {change}: the picture of a new scene", partial(_updated, change))
      for change in ("camera", "places", "sizes", "colours", "numbers")),
]
# fmt: on
