"""Which mistakes explain a wrong picture: those are made on some of its pixels, alone and by twos, and compared.

A cause has to explain pixels that are wrong without spoiling those that are right. How well it does so is its gain: the
share of the wrong pixels that it explains, less what it spoils, counted in wrong pixels.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.comparison.mistakes import BY_NAME, MISTAKES, Changes, Mistake
from cltrace.comparison.rules import RIGHT, Rules
from cltrace.comparison.shapes import Ints
from cltrace.comparison.tracer import Tracer, to_bytes
from cltrace.scene import Scene

Levels = NDArray[np.int64]  # (n, 3), 0..255

WRONG, SOUND = 1200, 800  # pixels of a sample
FEW = 240, 120  # of the first look at pairs
_MOST = 20.0  # what is spoiled counts no more than so many times what is explained
_FAR = 48  # levels from which on a pixel is just wrong
_LIGHTS = 5  # up to which all choices among lights are tried
# What a cause must gain to be named; by how much two must gain more than one, or what share of the rest they may leave.
NAMED, BETTER, LEFT = 0.25, 0.1, 0.4
FLEXIBLE = ("acne", "truncated")  # fit more than others, and are asked for last
SPECKLED = 0.1  # how much of the neighbourhood of acne is free of it, at least


@dataclass(frozen=True)
class Sample:
    """Some pixels of a picture: pixels (n, 2), column and row; mine, right (n, 3): their levels; wrong: (n,).

    weight: how much a sound pixel of the sample counts against a wrong one.
    """

    pixels: Ints
    mine: Levels
    right: Levels
    wrong: NDArray[np.bool_]
    weight: float

    def at(self, rows: Ints) -> Sample:
        return Sample(self.pixels[rows], self.mine[rows], self.right[rows], self.wrong[rows], self.weight)

    @classmethod
    def of(cls, mine: Levels, right: Levels, tolerance: int) -> Sample:
        """Takes wrong and sound pixels of whole pictures, (h, w, 3), always the same ones of the same pictures."""
        wrong = np.abs(mine - right).max(axis=2) > tolerance
        rng = np.random.default_rng(0)
        bad, good = (rng.permutation(np.flatnonzero(which)) for which in (wrong, ~wrong))
        rows = np.sort(np.concatenate([bad[:WRONG], good[:SOUND]]))
        y, x = np.divmod(rows, mine.shape[1])
        weight = min(len(good) / max(len(bad), 1), _MOST)
        return cls(np.stack([x, y], axis=1), mine[y, x], right[y, x], wrong[y, x], weight)

    def some(self, wrong: NDArray[np.bool_]) -> Ints:
        """Rows of a few of these wrong pixels and of others."""
        rng = np.random.default_rng(1)
        return np.concatenate([rng.permutation(np.flatnonzero(w))[:n] for w, n in ((wrong, FEW[0]), (~wrong, FEW[1]))])


class Score(NamedTuple):
    """How well a picture fits. gain: see above; exact: the share of its bytes that are equal; distance: from it, 0..1."""

    gain: float
    exact: float
    distance: float

    @property
    def order(self) -> tuple[float, float, float]:
        """The larger, the better. What is better by a hundredth only is not."""
        return round(self.gain, 2), round(self.exact, 2), -round(self.distance, 3)


class Trial(NamedTuple):
    """Mistakes by name, the rules with them, and how these fit."""

    names: tuple[str, ...]
    changes: Changes
    score: Score

    @property
    def rules(self) -> Rules:
        return replace(RIGHT, **self.changes)


_NO_SCORE = Score(0.0, 0.0, 1.0)


class Fit:
    """How rules fit a sample."""

    def __init__(self, tracer: Tracer, sample: Sample, tolerance: int, base: Rules) -> None:
        self.tracer, self.sample, self.tolerance, self.base = tracer, sample, tolerance, base
        self._colors: dict[Rules, NDArray[np.float64]] = {}

    def levels(self, changes: Changes) -> Levels:
        rules = replace(self.base, **changes)
        linear = replace(rules, gamma=1.0, rounding="nearest")
        if linear not in self._colors:
            self._colors[linear] = self.tracer.colors(self.sample.pixels, linear)
        return to_bytes(self._colors[linear], rules)

    def off(self, changes: Changes) -> Levels:
        """(n,): by how many levels each pixel is off."""
        return np.abs(self.levels(changes) - self.sample.mine).max(axis=1)

    def matched(self, changes: Changes) -> NDArray[np.bool_]:
        return self.off(changes) <= self.tolerance

    def score(self, changes: Changes) -> Score:
        return self.score_of(self.levels(changes))

    def score_of(self, levels: Levels) -> Score:
        wrong, weight = self.sample.wrong, self.sample.weight
        error = np.abs(levels - self.sample.mine)
        off = error.max(axis=1)
        shares = [float((off[w] <= self.tolerance).mean()) if w.any() else 1.0 for w in (wrong, ~wrong)]
        far = [float(np.minimum(off[w], _FAR).mean()) / _FAR if w.any() else 0.0 for w in (wrong, ~wrong)]
        gain = shares[0] - weight * (1 - shares[1])
        return Score(gain, float((error == 0).mean()), far[0] + weight * far[1])


class Search:
    """The search for causes of a picture's differences."""

    def __init__(self, scene: Scene, mine: Levels, right: Levels, tolerance: int = 1, truncate: bool = False) -> None:
        self.base = Rules(rounding="down") if truncate else RIGHT
        self.tracer = Tracer(scene)
        sample = Sample.of(mine, right, tolerance)
        # Where doubles see something else than is there, they cannot judge.
        off = np.abs(to_bytes(self.tracer.colors(sample.pixels), self.base) - sample.right).max(axis=1)
        sample = sample.at(np.flatnonzero(off <= 1))
        self.fit = Fit(self.tracer, sample, tolerance, self.base)
        few = sample.some(sample.wrong)
        self.few = Fit(self.tracer, sample.at(few), tolerance, self.base)
        self.bounces = bool((scene.materials["reflectance"] > 0).any() or (scene.materials["transmittance"] > 0).any())
        self.mine, self.right = mine, right

    @cached_property
    def singles(self) -> list[Trial]:
        """Each mistake that changes anything, alone, made in the way that fits best; the best first."""
        trials = []
        for mistake in MISTAKES:
            if mistake.name not in FLEXIBLE:
                changes = self._epsilons() if mistake.fitted else list(mistake.variants)
                some = [Trial((mistake.name,), c, self.few.score(c)) for c in changes if self._matters(c)]
                if some:
                    best = max(some, key=lambda trial: (trial.score.order, -trial.score.distance))
                    trials.append(best._replace(score=self.fit.score(best.changes)))
        return sorted(trials, key=lambda trial: trial.score.order, reverse=True)

    @cached_property
    def pairs(self) -> list[Trial]:
        """Two mistakes at once, the best first: of all, and of what is left wrong by those that explain something."""
        looks = [(self.few, list(combinations(self.singles, 2)))]
        for single in self.singles[:3]:
            if single.score.gain > NAMED:
                rest = Fit(self.tracer, self._rest(single), self.fit.tolerance, self.base)
                looks.append((rest, [(single, other) for other in self._made(rest, single)]))
        found: dict[tuple[str, ...], Trial] = {}
        for fit, twos in looks:
            trials = [Trial(a.names + b.names, a.changes | b.changes, _NO_SCORE) for a, b in twos if _agree(a, b)]
            trials = [trial._replace(score=fit.score(trial.changes)) for trial in trials]
            for trial in sorted(trials, key=lambda trial: trial.score.order, reverse=True)[:6]:
                best = self._refined(trial)
                if best.names not in found or best.score.order > found[best.names].score.order:
                    found[best.names] = best
        return sorted(found.values(), key=lambda trial: trial.score.order, reverse=True)

    def _rest(self, single: Trial) -> Sample:
        """Few pixels, of which the wrong ones are those that a mistake does not explain."""
        rows = self.fit.sample.some(self.fit.sample.wrong & ~self.fit.matched(single.changes))
        return self.fit.sample.at(rows)

    def _made(self, fit: Fit, first: Trial) -> Iterator[Trial]:
        """Each further mistake, made in the way that fits best beside the first one."""
        for other in self.singles:
            ways = [other.changes] if BY_NAME[other.names[0]].fitted else BY_NAME[other.names[0]].variants
            some = [other._replace(changes=c) for c in ways]
            some = [way for way in some if _agree(first, way)]
            if some:
                yield max(some, key=lambda way: fit.score(first.changes | way.changes).order)

    def _refined(self, pair: Trial) -> Trial:
        """A pair with both mistakes made in the ways that fit best together."""
        one, two = ([t.changes for t in self.singles if t.names == (name,)] for name in pair.names)
        ways = [
            a | b
            for a in (*one, *BY_NAME[pair.names[0]].variants)
            for b in (*two, *BY_NAME[pair.names[1]].variants)
            if not a.keys() & b.keys() and ("epsilon" in a | b or not {"large-epsilon"} & {*pair.names})
        ]
        best = max([pair.changes, *ways], key=lambda c: self.few.score(c).order)
        return pair._replace(changes=best, score=self.fit.score(best))

    def _matters(self, changes: Changes) -> bool:
        """Whether the picture shows it."""
        return bool((self.few.levels(changes) != self.few.levels({})).any())

    def _epsilons(self) -> list[Changes]:
        """Epsilons of each kind that explain most, if any changes anything."""
        scale = 10.0 ** math.ceil(math.log10(self.tracer.shapes(self.base).size))
        steps = [scale * 10.0**-k * x for k in range(5, 0, -1) for x in (1, 2, 5)]
        found = []
        for kind in BY_NAME["large-epsilon"].variants:
            if kind["spared"] and not self.bounces:
                continue
            tried = {e: self.few.score({**kind, "epsilon": e}) for e in steps}
            ratio = 1.5
            for _ in range(4):
                best = max(tried, key=lambda e: (tried[e].order, -e))
                for e in (best / ratio, best * ratio):
                    tried[e] = self.few.score({**kind, "epsilon": e})
                ratio = math.sqrt(ratio)
            found.append({**kind, "epsilon": max(tried, key=lambda e: (tried[e].order, -e))})
        return found


def _agree(one: Trial, two: Trial) -> bool:
    """Whether two mistakes can be made together."""
    return one.names != two.names and not one.changes.keys() & two.changes.keys()
