"""What comparing a picture with the right one has found, and pixels to look at where it is wrong."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.explanation.explanation import Explanation
from cltrace.explanation.pixel import Explainer
from cltrace.explanation.record import LightTerm, SoftTerm, total
from cltrace.explanation.textbook import Triple
from cltrace.picture.image import Image
from cltrace.reference import byte_of
from cltrace.scene.colors import encoded
from cltrace.students.mistakes import BY_NAME, ENOUGH

Bytes = NDArray[np.uint8]
_GAP = 4  # columns between pictures that stand side by side

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


@dataclass(frozen=True)
class Cause:
    """A mistake that explains a part of the wrong pixels.

    name: one of those of `cltrace.students.mistakes`; explains: the share of the wrong pixels, 0..1, that all causes
    together explain and that are not explained without this one; rivals: names of others that explain the same pixels
    as well, so that it may be one of these.
    """

    name: str
    explains: float
    rivals: tuple[str, ...] = ()

    @property
    def what(self) -> str:
        """What is wrong, in words."""
        return BY_NAME[self.name].what

    @property
    def change(self) -> str:
        """What to change in the code."""
        return BY_NAME[self.name].change

    @property
    def either(self) -> str:
        """Its name, and those of its rivals."""
        return " or ".join((f"either {self.name}" if self.rivals else self.name, *self.rivals))


@dataclass(frozen=True, eq=False)
class Comparison:
    """A picture beside the right one. str() is what the command prints.

    mine, right: (h, w, 3) uint8; tolerance: by how many levels a channel may differ; same: whether no pixel differs by
    more, and nothing else is wrong; differing: the share of those that do, 0..1; causes: the mistakes that explain
    them, the one that explains most first; explained: the share of the differing pixels that these explain together,
    0..1, judged by a sample; asked: the width and height that the scene's picture has, if not this one's; places:
    pixels to look at, the worst one first, none where the pictures are the same.
    """

    mine: Bytes
    right: Bytes
    tolerance: int
    causes: tuple[Cause, ...] = ()
    explained: float = 0.0
    asked: tuple[int, int] | None = None
    places: tuple[Place, ...] = ()

    @property
    def error(self) -> NDArray[np.uint8]:
        """(h, w): by how many levels each pixel differs, in the channel that differs most."""
        return np.asarray(np.abs(self.mine.astype(np.int16) - self.right).max(axis=2), np.uint8)

    @property
    def same(self) -> bool:
        return not (self.causes or self.asked) and self.alike

    @property
    def alike(self) -> bool:
        """Whether no pixel differs by more than that."""
        return not (self.error > self.tolerance).any()

    @property
    def differing(self) -> float:
        return float((self.error > self.tolerance).mean())

    @property
    def worst(self) -> tuple[int, int] | None:
        """Column and row of the pixel that differs most with all around it; None where the pictures are the same."""
        return (self.places[0].x, self.places[0].y) if self.places else None

    def to_json(self) -> str:
        """One object: same, differing, and causes, each with name, explains and or, the names of its rivals."""
        causes: list[dict[str, Any]] = [
            {"name": cause.name, "explains": cause.explains, "or": list(cause.rivals)} for cause in self.causes
        ]
        return json.dumps({"same": self.same, "differing": self.differing, "causes": causes})

    def side_by_side(self) -> Bytes:
        """(h, 3 w + 8, 3): the own picture, the right one, and the difference, in which every level counts fourfold."""
        difference = np.minimum(np.abs(self.mine.astype(np.int16) - self.right) * 4, 255).astype(np.uint8)
        gap = np.full((len(self.mine), _GAP, 3), 128, np.uint8)
        return np.concatenate([self.mine, gap, self.right, gap, difference], axis=1)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes side_by_side() as a PNG. Raises what Image.save() raises."""
        Image(rgb8=self.side_by_side()).save(path)

    def _repr_png_(self) -> bytes:
        return Image(rgb8=self.side_by_side())._repr_png_()

    def __str__(self) -> str:
        levels = "1 level" if self.tolerance == 1 else f"{self.tolerance} levels"
        if self.alike and not self.causes:
            most = int(self.error.max(initial=0))
            lines = ["the pictures are equal" if not most else f"the same: no pixel differs by more than {levels}"]
        else:
            share = _percent(self.differing)
            lines = [f"{share} of the pixels differ by more than {levels}, by up to {int(self.error.max())}"]
        if self.asked:
            sizes = "{}x{} instead of {}x{}".format(*self.mine.shape[1::-1], *self.asked)
            lines.insert(0, f"the picture has another size, {sizes} pixels: it is compared at its own")
        lines += [line for cause in self.causes for line in self._words(cause)]
        if not self.alike or self.causes:
            lines += self._rest()
            lines += [line for place in self.places for line in self._where(place)]
        return "\n".join(lines)

    def _words(self, cause: Cause) -> list[str]:
        many = "differing pixels" if self.same else "these"
        lines = [f"{cause.either} explains {_percent(cause.explains)} of {many}: {cause.what}", f"  {cause.change}"]
        for name in cause.rivals:
            lines += [f"  or {name}: {BY_NAME[name].what}", f"  {BY_NAME[name].change}"]
        return lines

    def _rest(self) -> list[str]:
        if not self.causes and (self.error > self.tolerance).sum() < ENOUGH:
            return ["unknown: these are too few to tell a mistake by"]
        if not self.causes:
            return ["unknown: none of the usual mistakes explains the difference"]
        if self.explained >= 0.995:
            return []
        together = " together" if len(self.causes) > 1 else ""
        return [f"unknown: {_percent(1 - self.explained)}{' that they do not explain' + together if together else ''}"]

    def _where(self, place: Place) -> list[str]:
        mine, right = (" ".join(map(str, picture[place.y, place.x].tolist())) for picture in (self.mine, self.right))
        which = "the worst pixel" if place is self.places[0] else "another one"
        told = f"{which} is {place.x},{place.y}: {mine}, right is {right}"
        return [told, f"  {place.line}", f"  look at {place.look}", f"  why: {place.ask}"]


def _percent(share: float) -> str:
    percent = 100 * share
    return "all" if share == 1 else f"{percent:.2g} %" if percent < 10 else f"{min(percent, 99.9):.1f} %"


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
