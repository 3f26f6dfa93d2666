"""Colours of vertices and faces of meshes, as textures that are made of them.

Values are places on a strip, whose pixels are those of a colour map: between corners it is the value that is
interpolated. Other colours are interpolated themselves: each triangle has four pixels of a texture, of which three have
its corners' colours a, b and c, and the fourth, opposite to a, b + c - a. What is mixed of these is linear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cltrace.scene.colormaps import Scale, count_of, map_of, mapped, values_given
from cltrace.scene.colors import Transfer, color_numbers, decoded
from cltrace.scene.materials import SIGNED_FULL, Frozen
from cltrace.scene.rules import Rule, check_not_bytes, checked

# A strip has as many pixels at least, and a whole number of them for each colour of its map.
STRIP = 1024
SHARE = Rule("within 0..1, as it is a share of the light", low=0, high=1)


@dataclass(frozen=True, eq=False)
class MeshColors(Frozen):
    """How f triangles are coloured.

    uv: (j, 2), texture coordinates; uv_of: (f, 3), which of them each corner has; strip: (1, n, 3) uint16, the texture,
    as the scene's transfer has it; corners: (f, 3, 3), or instead of that each corner's colour, likewise, within 0..1.
    """

    uv: NDArray[np.float64]
    uv_of: NDArray[np.int32]
    strip: NDArray[np.uint16] | None
    corners: NDArray[np.float32] | None

    @classmethod
    def of(cls, faces: NDArray[np.int32], vertices: int, colors: ArrayLike | None, **shown: Any) -> MeshColors | None:
        """What users give of a mesh with so many vertices; None for nothing. shown: values, cmap, clim, norm.

        Raises ValueError, which names the argument.
        """
        try:
            array = values_given(colors, **shown)
            if array is None:
                return None if colors is None else cls._of_colors(faces, vertices, colors)
            of_corner = _corners("values", array, faces, vertices)
            scale = Scale.of(array, shown["cmap"], shown["clim"], shown["norm"])
            colormap = map_of(scale.cmap)
            n = count_of(scale.cmap) * math.ceil(STRIP / count_of(scale.cmap))
            strip = np.rint(mapped(colormap, (np.arange(n) + 0.5) / n) * 65535).astype(np.uint16)
            # A texture has pixel k at u = k / n, so that no corner is beyond the last one, where the first one follows.
            pixel = np.minimum((scale.shares(array) * n).astype(np.int64), n - 1)
        except ValueError as error:
            raise ValueError(f"mesh.{error}") from None
        return cls(np.stack([pixel / n, 0.0 * pixel], axis=1), of_corner, strip=strip[None], corners=None)

    @classmethod
    def _of_colors(cls, faces: NDArray[np.int32], vertices: int, colors: ArrayLike) -> MeshColors:
        given = color_numbers("colors", colors)
        check_not_bytes("colors", given, reflected=True)
        array = checked("colors", SHARE, given, (-1, 3)).astype(np.float32)
        corners = array[_corners("colors", array, faces, vertices)]
        high, wide = _blocks(len(faces))
        row, column = np.divmod(np.arange(len(faces)), wide)
        first = np.stack([column / wide, row / high], axis=1)
        steps = np.array([(0, 0), (0.5 / wide, 0), (0, 0.5 / high)])
        uv = (first[:, None] + steps).reshape(-1, 2)
        return cls(uv, np.arange(len(uv), dtype=np.int32).reshape(-1, 3), strip=None, corners=corners)

    def texture(self, transfer: Transfer) -> NDArray[Any]:
        """A texture that shows them, read-only. transfer: how the colours are given; those of int16 are linear."""
        if self.strip is not None:
            return self.strip
        assert self.corners is not None
        a, b, c = (np.rint(decoded(self.corners[:, k], transfer) * SIGNED_FULL).astype(np.int16) for k in range(3))
        high, wide = _blocks(len(a))
        pixels = np.zeros((high * wide, 2, 2, 3), np.int16)
        for place, color in (((0, 0), a), ((0, 1), b), ((1, 0), c), ((1, 1), b + c - a)):
            pixels[(slice(len(a)), *place)] = color
        image = pixels.reshape(high, wide, 2, 2, 3).swapaxes(1, 2).reshape(2 * high, 2 * wide, 3)
        found = image.copy()  # which owns its memory
        found.flags.writeable = False
        return found


def _blocks(faces: int) -> tuple[int, int]:
    """In how many rows of how many blocks so many triangles have room. Places are exact where it is a power of two."""
    wide = 2 ** math.ceil(math.log2(max(1, faces)) / 2)
    return max(1, math.ceil(faces / wide)), wide


def _corners(name: str, given: NDArray[Any], faces: NDArray[np.int32], vertices: int) -> NDArray[np.int32]:
    """(f, 3), which row each corner has, of those that are given for each vertex, or else for each face."""
    if len(given) == vertices:
        return faces
    if len(given) == len(faces):
        return np.repeat(np.arange(len(faces), dtype=np.int32)[:, None], 3, axis=1)
    raise ValueError(f"{name}: must be one for each of {vertices} vertices or {len(faces)} faces, got {len(given)}")
