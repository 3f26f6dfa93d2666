"""What an image has beside the arrays that the kernel writes: made of these, on the host."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.blocks import blockwise
from cltrace.picture.levels import srgb_bytes
from cltrace.scene import Scene
from cltrace.scene.colors import Transfer

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Composition:
    """How a Renderer makes its images.

    outputs: what an image has; alpha: the background's, 0..1; transfer: the scene's; truncate: whether bytes are cut
    instead of rounded.
    """

    outputs: tuple[str, ...]
    alpha: float
    transfer: Transfer
    truncate: bool

    @classmethod
    def of(cls, outputs: Any, scene: Scene, truncate: bool) -> Composition:
        """For what was asked of a scene. A picture in front of a background that lets through has its alpha, too."""
        shown = "rgb8" in outputs and scene.background_alpha < 1 and not isinstance(outputs, str)
        return cls((*outputs, "rgba8") if shown else outputs, scene.background_alpha, scene.transfer, truncate)

    @property
    def written(self) -> tuple[str, ...]:
        """What the kernel is asked for. It knows linear bytes only, so others are made of its colours."""
        curved = self.transfer != "linear" and not {"rgb8", "rgba8"}.isdisjoint(self.outputs)
        return (*self.outputs, "color") if curved and not isinstance(self.outputs, str) else self.outputs

    def composed(self, written: Mapping[str, NDArray[Any]]) -> Arrays:
        """The arrays of an image. written: those of the kernel, by the names of abi.OUTPUTS."""
        if self.transfer != "linear" and "rgb8" in written:
            written = {**written, "rgb8": srgb_bytes(written["color"], self.truncate)}
        found = {name: array for name, array in written.items() if name in self.outputs}
        if "alpha" in self.outputs:
            found["alpha"] = np.where(written["id"] >= 0, np.float32(1), np.float32(self.alpha))
        if "rgba8" in self.outputs:
            level = np.uint8(self.alpha * 255 + (0.0 if self.truncate else 0.5))
            found["rgba8"] = joined(written["rgb8"], np.where(written["id"] >= 0, np.uint8(255), level))
        return found


def joined(rgb8: NDArray[np.uint8], alpha: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(h, w, 4) of (h, w, 3) and (h, w)."""
    rgba8 = np.empty((*alpha.shape, 4), np.uint8)

    def join(rows: slice) -> None:
        for k in range(3):  # one after the other is faster than all three
            rgba8[rows, :, k] = rgb8[rows, :, k]
        rgba8[rows, :, 3] = alpha[rows]

    blockwise(len(alpha), join, max(1, 2**17 // max(1, alpha.shape[1])))
    return rgba8
