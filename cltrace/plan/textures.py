"""Textures as the kernel reads them: the texels of all that some surface shows, one texture after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.base.arrays import joined
from cltrace.plan.abi import CONSTANTS
from cltrace.plan.materials import used
from cltrace.scene import FULL, Texture

# The kernel reads so many bytes from where a texel begins, so as many follow the last one.
BYTES_READ = 8
# A square of texels is uneven in which some differ by more than so many levels of 255, of red, green or blue.
UNEVEN = 100


@dataclass(frozen=True)
class Textures:
    """k textures, of m materials.

    texel: (n,) uint8, red, green and blue of all texels, row by row from the top, one byte each or two, and behind
    each texture, if that is asked for, which squares of texels are uneven; place: (k, 4) int32, abi's `texture`;
    of_material: (m,) int32, the index of each material's texture among the k, -1 for none.
    """

    texel: NDArray[np.uint8]
    place: NDArray[np.int32]
    of_material: NDArray[np.int32]

    @classmethod
    def of(
        cls,
        images: tuple[Texture, ...],
        of_material: NDArray[np.integer[Any]],
        material_of: NDArray[np.integer[Any]],
        squares: bool = False,
    ) -> Textures:
        """Those textures of a scene that some surface shows, each of them once.

        images: all of them; of_material: (m,), the index of each material's image, -1 for none; material_of: (n,), the
        index of each surface's material; squares: whether it is to be known which of them are uneven.
        """
        shown = of_material[used(len(of_material), material_of)] if images else of_material[:0]
        mask = used(len(images), shown[shown >= 0])
        if not mask.any():
            return NO_TEXTURES
        new = np.full(len(images) + 1, -1, np.int32)  # the last one is for -1
        new[:-1][mask] = np.arange(mask.sum())
        texels: list[NDArray[np.uint8]] = []
        places, begin = [], 0
        for i in np.flatnonzero(mask).tolist():
            height, width = images[i].shape[:2]
            # MAX_TEXELS of 6 bytes each are less than 2^31.
            full = FULL[images[i].dtype]
            places.append((width, height, begin, full))
            # The kernel reads numbers without a sign, so those that have one are so much larger.
            stored = (images[i] + full).astype(np.uint16) if full == CONSTANTS["SIGNED_FULL"] else images[i]
            uneven = uneven_squares(images[i]) if squares else np.zeros(0, np.uint8)
            texels += [stored.reshape(-1).view(np.uint8), uneven]
            begin += images[i].nbytes + len(uneven)
        texel = joined([*texels, np.zeros(BYTES_READ, np.uint8)])  # which a CPU's driver need not copy once more
        return cls(texel, np.array(places, np.int32).reshape(-1, 4), new[of_material])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The kernel's buffers by name."""
        return {"texel": self.texel, "texture": self.place, "texture_of": self.of_material}


def uneven_squares(image: Texture) -> NDArray[np.uint8]:
    """For each square of SQUARE x SQUARE texels, row by row, 1 if it is uneven, else 0."""
    rows, columns = (np.arange(0, n, CONSTANTS["SQUARE"]) for n in image.shape[:2])
    low, high = (f.reduceat(f.reduceat(image, rows, 0), columns, 1).astype(np.int32) for f in (np.minimum, np.maximum))
    return np.asarray(255 * (high - low).max(axis=2) > UNEVEN * FULL[image.dtype]).astype(np.uint8).reshape(-1)


NO_TEXTURES = Textures(np.zeros(0, np.uint8), np.zeros((0, 4), np.int32), np.zeros(0, np.int32))
