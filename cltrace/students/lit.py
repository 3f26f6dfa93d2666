"""Which lights reach what a picture shows."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cltrace.explanation import words
from cltrace.explanation.words import Names
from cltrace.picture.image import Image
from cltrace.picture.palettes import Colors, light_sets
from cltrace.plan.abi import Precision
from cltrace.plan.request import Crop
from cltrace.renderers.renderer import render
from cltrace.run.devices import Device
from cltrace.scene import AMBIENT, Scene


@dataclass(frozen=True)
class Lighting:
    """The lights that reach a picture's pixels.

    scene: whose lights; lit: (h, w, n) bool, whether each of its n lights reaches what a pixel sees; seen: (h, w) bool,
    whether it sees a surface.
    """

    scene: Scene
    lit: NDArray[np.bool_]
    seen: NDArray[np.bool_]

    @property
    def numbers(self) -> NDArray[np.intp]:
        """Of the lights that are not ambient."""
        return np.flatnonzero(self.scene.lights["kind"] != AMBIENT)

    def as_rgb8(self) -> Colors:
        """A colour for each set of lights that are not ambient, as palettes.light_sets() has it.

        Raises ValueError if these are more than palettes.MAX_LIGHTS.
        """
        return light_sets(self.lit[:, :, self.numbers], self.seen)

    def legend(self) -> Iterator[str]:
        """What the colours stand for, the most frequent one first, such as "#ff0000 54.3 %: point_light 1"."""
        colors = self.as_rgb8().reshape(-1, 3)
        sets = np.packbits(self.lit[:, :, self.numbers][self.seen], axis=-1)
        _, first, count = np.unique(sets, axis=0, return_index=True, return_counts=True)
        names, where = Names(self.scene), np.flatnonzero(self.seen)
        for k in np.argsort(-count, kind="stable").tolist():
            pixel = where[first[k]]
            reach = self.numbers[self.lit.reshape(len(colors), -1)[pixel, self.numbers]]
            lights = ", ".join(words.light(names.light(int(number))) for number in reach) or "no light"
            yield f"#{colors[pixel].tobytes().hex()} {100 * count[k] / len(colors):.3g} %: {lights}"


def lighting(
    scene: Scene, device: str | Device | None = None, precision: Precision | None = None, crop: Crop | None = None
) -> Lighting:
    """What lit() finds, with what it is about."""
    return lighting_by(scene, lambda some: render(some, device, precision, ("id", "color"), crop))


def lighting_by(scene: Scene, draw: Callable[[Scene], Image]) -> Lighting:
    """The same by what draws ids and colours of scenes like this one."""
    numbers = np.flatnonzero(scene.lights["kind"] != AMBIENT)
    lit = seen = None
    for three in [numbers[i : i + 3] for i in range(0, len(numbers), 3)] or [numbers]:
        image = draw(_matte(scene, three))
        if lit is None:
            seen = image.id >= 0
            lit = np.repeat(seen[:, :, None], len(scene.lights), axis=2)
        lit[:, :, three] = image.color[:, :, : len(three)] > 0
    assert lit is not None
    assert seen is not None
    return Lighting(scene, lit, seen)


def lit(
    scene: Scene, device: str | Device | None = None, precision: Precision | None = None, crop: Crop | None = None
) -> NDArray[np.bool_]:
    """Whether each light of a scene reaches the point that a pixel sees: (h, w, n) for its n lights, in their order.

    It does if the surface faces it there, the point is within its cone and nothing stands between; a soft light if any
    of its members does. An ambient light reaches every surface. Where a pixel sees none, all is False. What mirrors and
    glass show is not asked about.

    The arguments and what is raised are those of render(). It renders one picture for every three lights.
    """
    return lighting(scene, device, precision, crop).lit


def _matte(scene: Scene, three: NDArray[np.intp]) -> Scene:
    """The scene with all surfaces white and matte, in up to three of its lights, of which each has a pure colour.

    A light is then seen in its channel if and only if it reaches the point, so that three share a picture.
    """
    materials = scene.materials.copy()
    for name in ("ka", "ks", "reflectance", "transmittance"):
        materials[name] = 0
    materials["color"], materials["kd"], materials["texture"] = 1, 1, -1
    lights = scene.lights[three]
    lights["color"] = lights["below"] = np.eye(3)[: len(three)]
    return replace(scene, materials=materials, lights=lights, background=(0.0, 0.0, 0.0), textures=())
