"""What comparing a picture with the right one has found."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cltrace.picture.image import Image
from cltrace.students.mistakes import BY_NAME, ENOUGH
from cltrace.students.places import Place

Bytes = NDArray[np.uint8]
_GAP = 4  # columns between pictures that stand side by side


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
