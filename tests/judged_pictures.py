"""Pictures of 48x36 pixels beside those of the reference, and beside those that no filter has touched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import cltrace
from cltrace import Scene
from cltrace.picture.image import Output
from cltrace.reference import world_of
from cltrace.reference.trace import primary_ray, trace
from cltrace.run.devices import Device


def agrees(scene: Scene, device: Device, precision: str = "accurate", every: int = 3, off: float = 1e-4) -> None:
    """Of one pixel in so many, number and colour are the reference's."""
    image, world, (width, height) = cltrace.render(scene, device, precision, ("id", "color")), world_of(scene), (48, 36)
    for v in range(1, height, every):
        for u in range(1, width, every):
            color, at = trace(world, primary_ray(scene.camera, u, v))
            assert image.id[v, u] == (at.index if at else -1), (u, v)
            assert np.abs(image.color[v, u] - color).max() <= off, (u, v)


def changed_by_filter(scene: Scene, device: Device) -> int:
    """How many pixels differ from those of pictures in which doubles and exact numbers decide all."""
    outputs: tuple[Output, ...] = ("id", "color")
    one = cltrace.Renderer(scene, device, "accurate", outputs).render()
    other = cltrace.Renderer(scene, device, "accurate", outputs, keep=("filter",)).render()
    return int(((one.id != other.id) | (one.color != other.color).any(axis=2)).sum())


def single_agrees(scene: Scene, device: Device) -> None:
    """In float32, few pixels at edges are others than in `accurate`."""
    exact, rough = (cltrace.render(scene, device, precision, ("id", "color")) for precision in ("accurate", "single"))
    same = exact.id == rough.id
    assert same.mean() > 0.995
    assert (np.abs(exact.color - rough.color).max(axis=2)[same] < 1e-3).mean() > 0.995


def is_the_mean_of_finer_pixels(scene: Scene, device: Device) -> None:
    image = cltrace.render(scene, device, "accurate", ("rgb8",), antialias=True)
    finer = scene.seen_by(replace(scene.camera, resolution=(48 * 16, 36 * 16)))
    fine = cltrace.render(finer, device, "accurate", ("color",))
    mean = np.clip(fine.color, 0, 1).reshape(36, 16, 48, 16, 3).mean(axis=(1, 3)) * 255
    off = np.abs(image.rgb8 - mean)
    assert off.mean() < 0.3
    assert off.max() < 24  # 255 times what 95 of 100 means over 32 rays are off by, where colours differ by 1
