"""Pixels to look at where a picture is wrong: inside what is wrong, of different kinds, and what to look at there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cltrace.explanation.explanation import Explanation
from cltrace.explanation.pixel import Explainer
from cltrace.explanation.record import LightTerm, SoftTerm, total
from cltrace.explanation.textbook import Triple
from cltrace.reference import byte_of
from cltrace.scene.colors import encoded

MOST = 3  # places that are told
_TRIED = 6  # pixels of which these are chosen
_APART = 8  # of a picture's longer side, how far from each other these are at least


@dataclass(frozen=True)
class Place:
    """A pixel that is wrong: its column and row; line: what `Explanation.line` says of it; look: what to look at in its
    explanation; ask: the command, or the call, that prints all of that."""

    x: int
    y: int
    line: str
    look: str
    ask: str


def places(
    explainer: Explainer,
    mine: NDArray[np.uint8],
    error: NDArray[np.uint8],
    ask: Callable[[int, int], str],
    truncate: bool,
) -> tuple[Place, ...]:
    """Up to three pixels, the worst first, of which each sees something else than the others.

    mine: (h, w, 3); error: (h, w), levels; ask: what to type to have a pixel explained.
    """
    found: dict[object, Place] = {}
    for x, y in inside(error):
        e = explainer.pixel(x, y, truncate)
        hit = e.rays[0].hit
        kind = (hit.surface.id if hit else None), tuple(light.fate for light in e.rays[0].lights)
        found.setdefault(kind, Place(x, y, line=e.line, look=look_at(e, tuple(mine[y, x].tolist())), ask=ask(x, y)))
        if len(found) == MOST:
            break
    return tuple(found.values())


def inside(error: NDArray[np.uint8]) -> Iterator[tuple[int, int]]:
    """The pixels that are wrong together with all around them, the worst first; of thin ones, these themselves.

    Along outlines, what is wrong is thin, and rounding may have made it so.
    """
    around = np.pad(error, 1, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(around, (3, 3))
    worst = windows.min(axis=(2, 3)).astype(np.int64)
    # Of equals, those that are wrong most themselves.
    worst = np.where(worst > 0, 256 * worst + error, 0) if worst.any() else error.astype(np.int64)
    reach = max(error.shape) // _APART
    for _ in range(_TRIED):
        if not worst.any():
            return
        y, x = divmod(int(worst.argmax()), worst.shape[1])
        yield x, y
        worst[max(y - reach, 0) : y + reach + 1, max(x - reach, 0) : x + reach + 1] = 0


def look_at(e: Explanation, mine: tuple[int, ...]) -> str:
    """What to look at in the explanation of a pixel of which another tracer has these bytes."""
    ray = e.rays[0]

    def fits(*colors: Triple) -> bool:
        sums = np.clip(np.sum([ray.local if ray.bounces else ray.color, *colors], axis=0), 0, 1)
        told = [byte_of(c, e.truncate) for c in encoded(sums, e.transfer).tolist()]
        return max(abs(a - b) for a, b in zip(told, mine, strict=True)) <= 1

    if ray.hit is None:
        return "the ray: this one meets nothing; does yours have the same o and d?"
    for light in ray.lights:
        red, green, blue = (-a - b for a, b in zip(light.diffuse, light.specular, strict=True))
        if any(light.diffuse) and any(light.specular) and fits((red, green, blue)):
            return f"the shadow ray of {light.light.kind} {light.light.number}: it is as if something were between"
    for term in ray.local_terms:
        red, green, blue = term.color
        if any(term.color) and fits((-red, -green, -blue)):
            return f"{term.label}: it is as if that were missing"
        if any(term.color) and fits(term.color):
            return f"{term.label}: it is as if that were added twice"
    for light in ray.lights:
        if light.fate == "in shadow" and fits(total(_unhidden(e, one) for one in members(light))):
            return f"the shadow ray of {light.light.kind} {light.light.number}: it is as if nothing were between"
    if ray.bounces and fits():
        return "the rays that go on: it is as if there were none"
    if ray.bounces:
        return "the rays that go on, from ray 1 on"
    return "the texture: u, v and the four texels" if ray.hit.texture else "P, n, and l of each light"


def members(light: LightTerm | SoftTerm) -> tuple[LightTerm, ...]:
    """A light that is not soft is its own member."""
    return light.members if isinstance(light, SoftTerm) else (light,)


def _unhidden(e: Explanation, light: LightTerm) -> Triple:
    """What a light in shadow would add, were there nothing between; of any other, nothing."""
    if light.fate != "in shadow":
        return (0.0, 0.0, 0.0)
    hit = e.rays[0].hit
    assert hit is not None
    lobe = hit.ks * max(0.0, light.r_v) ** hit.exponent
    red, green, blue = (
        light.strength * (hit.kd * light.n_l * C + lobe) * L for C, L in zip(hit.color, light.L, strict=True)
    )
    return (red, green, blue)
