"""Outlines and depth cueing: made of what the rays of a picture meet, and put on its colours."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.scene import NOT_NEGATIVE, Rule, Vector
from cltrace.scene.colors import Transfer, color_numbers, decoded
from cltrace.scene.rules import check_not_bytes, checked, vector

Floats = NDArray[np.float32]
WIDTH = Rule("within (0, 64] pixels", low=0, high=64, open_low=True)


@dataclass(frozen=True)
class Effects:
    """What is done to a picture's colours.

    outline: the linear colour of lines where a surface ends before another one or before the background, None for none;
    width: theirs, in pixels; fog: the linear colour that surfaces fade to, None for none; near, far: the distances, in
    scene units, at which that begins and ends.
    """

    outline: Vector | None
    width: float
    fog: Vector | None
    near: float
    far: float

    @classmethod
    def of(cls, outline: Any, fog: Any, transfer: Transfer) -> Effects | None:
        """For what users give: (color, width) and (color, near, far), or None. None where both are.

        transfer: how colours are given. Raises ValueError, which names the argument.
        """
        if outline is None and fog is None:
            return None
        line, (width,) = _parts("outline", outline, ("width",), ("black", 2), transfer)
        haze, (near, far) = _parts("fog", fog, ("near", "far"), ("white", 10, 50), transfer)
        if outline is not None:
            checked("outline: width", WIDTH, width, ())
        if fog is not None and not 0 <= near < far:
            raise ValueError(f"fog: must have two rising distances >= 0, got {near:g}, {far:g}")
        return cls(line, width, fog=haze, near=near, far=far)

    def reach(self, samples: int) -> int:
        """From how many pixels away lines come. samples: rays along a pixel's side."""
        return 0 if self.outline is None else math.ceil((self._radius(samples) + 1) / samples)

    def _radius(self, samples: int) -> float:
        """How far a line goes to either side of the rays at a surface's end, of which it is one wide itself.

        With one ray a pixel, its width is odd: 1, 3, 5 and so on. With more it is between two of these, see shares().
        """
        return max(0.0, (self.width * samples - 1) / 2)

    def shares(self, id: NDArray[np.int32], depth: NDArray[np.float64], samples: int) -> Shares:
        """Of pixels whose sides have so many rays each. id, depth: (samples h, samples w), as of Image."""
        seen = id >= 0
        faded = np.zeros(id.shape, np.float32)
        if self.fog is not None:
            faded[seen] = np.clip((depth[seen] - self.near) / (self.far - self.near), 0, 1)
        line = np.zeros_like(faded)
        if self.outline is not None:
            ends, radius = np.where(_ends(id, depth), 1 - faded, np.float32(0)), self._radius(samples)
            rest = radius % 1 if samples > 1 else 0.0
            line = _widened(ends, radius - rest)
            if rest:
                line += np.float32(rest) * (_widened(ends, radius - rest + 1) - line)
        hits = _means(seen.astype(np.float32), samples)
        fog = np.divide(_means(faded, samples), hits, out=np.zeros_like(hits), where=hits > 0)
        return Shares(_means(line, samples), fog)

    def applied(self, color: Floats, coverage: Floats, shares: Shares, background: Vector) -> tuple[Floats, Floats]:
        """Colours in front of an opaque background, and how much of each pixel is covered, with the effects.

        Of a mean colour c = k S + (1 - k) B, for a share k of surfaces of the colour S, it is S that fades.
        """
        if self.fog is not None:
            k = coverage[..., None]
            behind = np.minimum(np.array(background, np.float32), 1) * (1 - k)
            color = color + shares.fog[..., None] * (k * np.array(self.fog, np.float32) - (color - behind))
        if self.outline is not None:
            color = color + shares.line[..., None] * (np.array(self.outline, np.float32) - color)
            coverage = coverage + shares.line * (1 - coverage)
        return np.maximum(color, np.float32(0)), coverage


class Shares(NamedTuple):
    """Of each pixel, (h, w): line: how much of it lines cover; fog: how much its surfaces have faded."""

    line: Floats
    fog: Floats


def _parts(
    name: str, given: Any, numbers: tuple[str, ...], example: tuple[Any, ...], transfer: Transfer
) -> tuple[Vector | None, tuple[float, ...]]:
    """The linear colour and the numbers of what a user gave."""
    if given is None:
        return None, (0.0,) * len(numbers)
    if not isinstance(given, Sequence) or isinstance(given, str) or len(given) != 1 + len(numbers):
        wanted = f"(color, {', '.join(numbers)}), such as {example}"
        raise ValueError(f"{name}: must be {wanted}, got {given!r}")
    color = color_numbers(f"{name}: color", given[0])
    check_not_bytes(f"{name}: color", color)
    written = vector(f"{name}: color", color, NOT_NEGATIVE)
    red, green, blue = np.minimum(decoded(np.array(written), transfer), 1).tolist()
    found = (float(checked(f"{name}: {of}", NOT_NEGATIVE, x, ())) for of, x in zip(numbers, given[1:], strict=True))
    return (red, green, blue), tuple(found)


def _ends(id: NDArray[np.int32], depth: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(h, w): whether a ray meets a surface, and one beside or above it another one, or none, that is farther.

    Of two as far, the surface with the smaller number has the line.
    """
    found = np.zeros(id.shape, bool)
    for axis in (0, 1):
        one, other = (slice(None),) * axis + (slice(None, -1),), (slice(None),) * axis + (slice(1, None),)
        differ = id[one] != id[other]
        first = (depth[one] < depth[other]) | ((depth[one] == depth[other]) & (id[one] < id[other]))
        found[one] |= differ & first
        found[other] |= differ & ~first
    return found


def _widened(line: Floats, radius: float) -> Floats:
    """The largest number within a disc around each place, which has this radius in places."""
    (height, width), most = line.shape, int(radius)
    padded, wide = np.pad(line, most), np.pad(line, ((most, most), (0, 0)))
    out, reached = np.zeros_like(line), 0
    for down in range(most, -1, -1):
        while reached < math.isqrt(int(radius * radius - down * down)):
            reached += 1
            for across in (most - reached, most + reached):
                np.maximum(wide, padded[:, across : across + width], out=wide)
        for start in {most - down, most + down}:
            np.maximum(out, wide[start : start + height], out=out)
    return out


def _means(values: Floats, samples: int) -> Floats:
    """Of squares of so many places along their sides."""
    if samples == 1:
        return values
    high, wide = values.shape[0] // samples, values.shape[1] // samples
    return np.asarray(values.reshape(high, samples, wide, samples).mean(axis=(1, 3)), np.float32)
