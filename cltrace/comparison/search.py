"""Which mistakes explain a wrong picture: those are made on some of its pixels, alone and by twos, and compared.

A cause has to explain pixels that are wrong without spoiling those that are right. How well it does so is its gain: the
share of the wrong pixels that it explains, less what it spoils, counted in wrong pixels.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.comparison.mistakes import BY_NAME, ENOUGH, MISTAKES, Changes
from cltrace.comparison.rules import RIGHT, Rules
from cltrace.comparison.shapes import Ints
from cltrace.comparison.tracer import Tracer, to_bytes
from cltrace.scene import Scene

Levels = NDArray[np.int64]  # (n, 3), 0..255
Bits = NDArray[np.bool_]

USUAL = 1200, 800  # wrong and sound pixels of a sample
LARGE = 6000, 2000  # of the one that shows what a mistake leaves
FEW = 240, 120  # of the first look at mistakes
_MOST = 20.0  # what is spoiled counts no more than so many times what is explained
_FAR = 48  # levels from which on a pixel is just wrong
_LIGHTS = 4  # up to which all choices among lights are tried
_SPARED = 0.1  # of the wrong pixels, at least that acne beside another mistake leaves alone
_FREE, _AMID, _SURE = 0.1, 0.2, 0.8  # see _is_speckled
NAMED = 0.25  # what a cause must gain to be named
PERFECT, GOOD = 0.995, 0.95  # gains of one mistake, and of two, that leave nothing to look for
BETTER, LEFT = 0.1, 0.4  # by how much two mistakes must gain more than one, or what share of the rest they may leave
LEAST = 8  # wrong pixels that one mistake leaves, for a second one to be looked for
FLEXIBLE = ("acne", "truncated")  # explain more than others by chance, and are asked for last


@dataclass(frozen=True)
class Sample:
    """Some pixels of a picture: pixels (n, 2), column and row; mine, right (n, 3): their levels; wrong: (n,).

    weight: how much a sound pixel of the sample counts against a wrong one.
    """

    pixels: Ints
    mine: Levels
    right: Levels
    wrong: Bits
    weight: float

    def at(self, rows: Ints) -> Sample:
        return Sample(self.pixels[rows], self.mine[rows], self.right[rows], self.wrong[rows], self.weight)

    @classmethod
    def of(cls, mine: Levels, right: Levels, tolerance: int, counts: tuple[int, int] = USUAL) -> Sample:
        """Takes wrong and sound pixels of whole pictures, (h, w, 3), always the same ones of the same pictures."""
        wrong = np.abs(mine - right).max(axis=2) > tolerance
        rng = np.random.default_rng(0)
        bad, good = (rng.permutation(np.flatnonzero(which)) for which in (wrong, ~wrong))
        y, x = np.divmod(np.sort(np.concatenate([bad[: counts[0]], good[: counts[1]]])), mine.shape[1])
        weight = min(len(good) / max(len(bad), 1), _MOST)
        return cls(np.stack([x, y], axis=1), mine[y, x], right[y, x], wrong[y, x], weight)

    def few(self) -> Sample:
        """A few of these pixels."""
        rng = np.random.default_rng(1)
        rows = [rng.permutation(np.flatnonzero(w))[:n] for w, n in ((self.wrong, FEW[0]), (~self.wrong, FEW[1]))]
        return self.at(np.concatenate(rows))

    def left(self, matched: Bits) -> Sample:
        """The same pixels, of which those that are wrong and not matched count as wrong; (n,)."""
        wrong = self.wrong & ~matched
        return replace(self, wrong=wrong, weight=min(float((~wrong).sum()) / max(wrong.sum(), 1), _MOST))


class Score(NamedTuple):
    """How well a picture fits.

    gain: see above; exact: the share of its bytes that are equal; distance: how far off its pixels are, 0..1.
    """

    gain: float
    exact: float
    distance: float

    @property
    def order(self) -> tuple[float, float, float]:
        """The larger, the better. What is better by less than a hundredth is not."""
        return round(self.gain, 2), round(self.exact, 2), -round(self.distance, 3)


_NO_SCORE = Score(0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Trial:
    """Mistakes that are made together, each with what it makes of the rules, and how the picture then fits."""

    made: Mapping[str, Changes]
    score: Score = _NO_SCORE

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.made)

    @property
    def changes(self) -> Changes:
        return {key: value for changes in self.made.values() for key, value in changes.items()}

    @property
    def order(self) -> tuple[tuple[float, float, float], int]:
        """The larger, the better. Of what fits as well, what needs no fitting is better."""
        return self.score.order, -sum(BY_NAME[name].fitted for name in self.made)

    def without(self, name: str) -> Changes:
        return Trial({other: changes for other, changes in self.made.items() if other != name}).changes


def _best(trials: list[Trial]) -> Trial:
    """The best; of equally good ones the first."""
    return max(trials, key=lambda trial: (trial.order, -trial.score.distance))


class Fit:
    """How well rules fit a sample. base: the rules of the right picture."""

    def __init__(self, tracer: Tracer, sample: Sample, tolerance: int, base: Rules) -> None:
        self.tracer, self.sample, self.tolerance, self.base = tracer, sample, tolerance, base
        self._colors: dict[Rules, NDArray[np.float64]] = {}

    def levels(self, changes: Changes) -> Levels:
        """(n, 3): what the pixels show. Where rules leave open which lights reach a point, what fits best."""
        rules = replace(self.base, **changes)
        if rules.reaching is not None:
            return to_bytes(self._linear(rules), rules)
        choices = np.stack([to_bytes(colors, rules) for colors in self._with_lights(rules)])
        best = np.abs(choices - self.sample.mine).max(axis=2).argmin(axis=0)
        return np.asarray(choices[best, np.arange(len(best))])

    def _linear(self, rules: Rules) -> NDArray[np.float64]:
        linear = replace(rules, gamma=1.0, rounding="nearest")
        if linear not in self._colors:
            self._colors[linear] = self.tracer.colors(self.sample.pixels, linear)
        return self._colors[linear]

    def _with_lights(self, rules: Rules) -> Iterator[NDArray[np.float64]]:
        """The colours with each choice of lights that reach what is seen first, and what mirrors and glass show."""
        whole = self._linear(replace(rules, reaching=(-1, -1)))
        yield whole
        deeper = list(self._missing(rules, 1)) if self.tracer.bounces else []
        for loss in self._missing(rules, 0):
            yield whole - loss
            yield from (whole - loss - more for more in deeper)
        yield from (whole - more for more in deeper)

    def _missing(self, rules: Rules, place: int) -> Iterator[NDArray[np.float64]]:
        """What lights make up, by each choice of some: in what is seen first, place 0, or in mirrors and glass, 1."""
        count = len(self.tracer.lights)
        without = (-1, *(~(1 << k) for k in range(count)))
        sides = [(-1, bits) if place else (bits, -1) for bits in without]
        whole, *others = (self._linear(replace(rules, reaching=side)) for side in sides)
        parts = np.array([whole - other for other in others])
        for bits in range(1, 2**count) if count <= _LIGHTS else (*(1 << k for k in range(count)), -1):
            yield parts[[bits >> k & 1 == 1 for k in range(count)]].sum(axis=0)

    def matched(self, changes: Changes) -> Bits:
        """(n,): which pixels the rules explain."""
        return np.asarray(np.abs(self.levels(changes) - self.sample.mine).max(axis=1) <= self.tolerance)

    def trial(self, made: Mapping[str, Changes]) -> Trial:
        """These mistakes together."""
        trial = Trial(made)
        error = np.abs(self.levels(trial.changes) - self.sample.mine)
        off, kinds = error.max(axis=1), (self.sample.wrong, ~self.sample.wrong)
        explained, kept = (float((off[rows] <= self.tolerance).mean()) if rows.any() else 1.0 for rows in kinds)
        far = [float(np.minimum(off[rows], _FAR).mean()) / _FAR if rows.any() else 0.0 for rows in kinds]
        weight = self.sample.weight
        score = Score(explained - weight * (1 - kept), float((error == 0).mean()), far[0] + weight * far[1])
        return replace(trial, score=score)

    def changes_something(self, changes: Changes) -> bool:
        return bool((self.levels(changes) != self.levels({})).any())


class Search:
    """The search for the causes of a picture's differences.

    mine, right: (h, w, 3) levels; tolerance: by how many two may differ; truncate: whether the right ones are rounded
    down.
    """

    def __init__(self, scene: Scene, mine: Levels, right: Levels, tolerance: int, truncate: bool) -> None:
        self.mine, self.tolerance = mine, tolerance
        self.base = Rules(rounding="down") if truncate else RIGHT
        self.tracer = Tracer(scene)
        sample = self._sample(Sample.of(mine, right, tolerance))
        self.fit, self.few = self._fit(sample), self._fit(sample.few())
        self._all = Sample.of(mine, right, tolerance, LARGE)
        self._rests: dict[tuple[str, ...], Fit | None] = {}

    def _fit(self, sample: Sample) -> Fit:
        return Fit(self.tracer, sample, self.tolerance, self.base)

    def _sample(self, sample: Sample) -> Sample:
        """Without the pixels where doubles see something else than is there, of which they cannot judge."""
        off = np.abs(to_bytes(self.tracer.colors(sample.pixels), self.base) - sample.right).max(axis=1)
        return sample.at(np.flatnonzero(off <= 1))

    @cached_property
    def large(self) -> Fit:
        return self._fit(self._sample(self._all))

    def cause(self) -> Trial | None:
        """The mistakes that explain the picture best, as few as do; None if none does."""
        none = Trial({}, self.fit.trial({}).score)
        best = self._cut_off(none)
        # A picture of one colour says nothing: what makes all black, or all white, would fit whatever was done.
        says_something = np.ptp(self.mine, axis=(0, 1)).any() and self.fit.sample.wrong.sum() >= ENOUGH
        if best.score.gain < PERFECT and says_something:
            best = none
            for trial in self._looks():
                best = trial if self._is_better(trial, best) else best
                if self._is_enough(best):
                    break
            best = self._cut_off(best)
        return best if best.made else None

    def _looks(self) -> Iterator[Trial]:
        """The best of what takes longer and longer to look for."""
        yield from self.rigid[:1]
        yield from self.singles[:1]
        for single in self.singles[:3]:
            if single.score.gain > NAMED:
                yield from self._with(single)[:1]
        yield from self.pairs[:1]
        yield from self.acne()

    def _is_enough(self, best: Trial) -> bool:
        """Whether there is no need to look further: nothing is left, or next to nothing by two mistakes."""
        gain = best.score.gain
        return gain >= GOOD if len(best.made) > 1 else gain >= PERFECT and self._rest(best) is None

    def _is_better(self, trial: Trial, best: Trial) -> bool:
        """Whether a further mistake is worth its name."""
        gain, before = trial.score.gain, best.score.gain
        if not best.made:
            return gain >= NAMED
        if gain >= before + BETTER or (1 - gain <= LEFT * (1 - before) and gain > before):
            return True
        rest = self._rest(best) if gain >= before and not set(FLEXIBLE) & set(trial.made) else None
        return rest is not None and rest.trial(trial.made).score.gain >= 1 - LEFT

    def _rest(self, trial: Trial) -> Fit | None:
        """How well rules fit what mistakes leave wrong in a large sample; None if that is next to nothing."""
        if trial.names not in self._rests:
            left = self.large.sample.left(self.large.matched(trial.changes))
            self._rests[trial.names] = self._fit(left.few()) if left.wrong.sum() >= LEAST else None
        return self._rests[trial.names]

    def explained(self, trial: Trial) -> float:
        """The share of the wrong pixels that mistakes explain together."""
        wrong = self.large.sample.wrong
        return float(self.large.matched(trial.changes)[wrong].mean()) if wrong.any() else 1.0

    def explains(self, trial: Trial) -> dict[str, float]:
        """Of the wrong pixels, the share that the mistakes explain together and without this one do not, by name."""
        sample, levels = self.large.sample, self.large.levels(trial.changes)
        exact = (levels == sample.mine).all(axis=1)
        wrong = sample.wrong if sample.wrong.any() else (sample.mine != sample.right).any(axis=1)
        shares = {}
        for name in trial.made:
            without = self.large.levels(trial.without(name))
            if name == "truncated":
                part = exact & (without != sample.mine).any(axis=1)
            else:
                part = self.large.matched(trial.changes) & ~(
                    np.abs(without - sample.mine).max(axis=1) <= self.tolerance
                )
            shares[name] = float(part[wrong].mean()) if wrong.any() else 1.0
        return shares

    # One mistake, and two

    @cached_property
    def singles(self) -> list[Trial]:
        """Each mistake that changes anything, alone, made in the way that fits best; the best first."""
        trials = self.rigid + self._made({"large-epsilon": self._epsilons(self.few, {})})
        return sorted(trials, key=lambda trial: trial.order, reverse=True)

    @cached_property
    def rigid(self) -> list[Trial]:
        """Those of which nothing is to be fitted."""
        ways = {mistake.name: mistake.variants for mistake in MISTAKES if mistake.name not in FLEXIBLE}
        del ways["large-epsilon"]
        return sorted(self._made(ways), key=lambda trial: trial.order, reverse=True)

    def _made(self, ways: Mapping[str, Sequence[Changes]]) -> list[Trial]:
        """Each of some mistakes that changes anything, made in the way that fits best."""
        trials = []
        for name in ways:
            some = [self.few.trial({name: way}) for way in ways[name] if self.few.changes_something(way)]
            trials += [self.fit.trial(_best(some).made)] if some else []
        return trials

    @cached_property
    def pairs(self) -> list[Trial]:
        """Any two mistakes at once, the best first."""
        # What fits best alone need not do so in company: the usual way to make a mistake is tried, too.
        ways = [(name, way) for trial in self.singles for name in trial.names for way in self._usual(trial, name)]
        twos = [{one: a, two: b} for (one, a), (two, b) in combinations(ways, 2) if one != two]
        return self._refined(self.few, twos)

    def _usual(self, trial: Trial, name: str) -> list[Changes]:
        """As a mistake fits best alone, and as it is usually made."""
        usual = self._ways(name)[0]
        return [trial.changes] if usual == trial.changes else [trial.changes, usual]

    def _with(self, single: Trial) -> list[Trial]:
        """A mistake and another one that explains what the first one leaves wrong, the best first."""
        rest, twos = self._rest(single), []
        if rest is None:
            return []
        for other in self.singles:
            (name,) = other.names
            fitted = BY_NAME[name].fitted and name not in single.made
            usual = self._epsilons(rest, single.made) if fitted else self._ways(name)
            ways = [way for way in ({**single.made, name: way} for way in usual) if len(way) == 2 and _agree(way)]
            if ways:
                twos.append(_best([rest.trial(way) for way in ways]).made)
        return self._refined(rest, twos)

    def _refined(self, fit: Fit, twos: Sequence[Mapping[str, Changes]]) -> list[Trial]:
        """The best of some pairs, each with both mistakes made in the ways that fit best together."""
        trials = [fit.trial(two) for two in twos if _agree(two)]
        trials = [trial for trial in trials if trial.score.order > max(self._alone(fit, trial))]
        found: dict[tuple[str, ...], Trial] = {}
        for trial in sorted(trials, key=lambda trial: trial.order, reverse=True):
            if len(found) < 6 and trial.names not in found:
                found[trial.names] = self.fit.trial(self._adjusted(fit, trial).made)
        return sorted(found.values(), key=lambda trial: trial.order, reverse=True)

    def _alone(self, fit: Fit, trial: Trial) -> list[tuple[float, float, float]]:
        """How well each of some mistakes fits without the others."""
        return [fit.trial({name: changes}).score.order for name, changes in trial.made.items()]

    def _adjusted(self, fit: Fit, trial: Trial) -> Trial:
        """Two mistakes, of which each is made in the way that fits best beside the other."""
        for name in trial.names:
            ways = [{**trial.made, name: way} for way in self._ways(name)]
            trial = _best([trial, *(fit.trial(way) for way in ways if _agree(way))])
        return trial

    def _ways(self, name: str) -> list[Changes]:
        """How a mistake may be made; of one that is fitted, as it fits alone."""
        if BY_NAME[name].fitted:
            return [changes for trial in self.singles for other, changes in trial.made.items() if other == name]
        return list(BY_NAME[name].variants)

    def _epsilons(self, fit: Fit, others: Mapping[str, Changes]) -> list[Changes]:
        """Of each way to measure an epsilon, the one that fits best beside other mistakes."""
        scale = 10.0 ** math.ceil(math.log10(self.tracer.shapes(self.base).size))
        ladder = [scale * 10.0**-k * x for k in range(5, 0, -1) for x in (1, 2, 5)]
        found = []
        for kind in BY_NAME["large-epsilon"].variants:
            if kind["spared"] and not self.tracer.bounces:
                continue
            tried = [fit.trial({**others, "large-epsilon": {**kind, "epsilon": epsilon}}) for epsilon in ladder]
            for ratio in (1.5, 1.2, 1.1, 1.05):
                epsilon = _best(tried).changes["epsilon"]
                for other in (epsilon / ratio, epsilon * ratio):
                    tried.append(fit.trial({**others, "large-epsilon": {**kind, "epsilon": other}}))
            found.append(_best(tried).made["large-epsilon"])
        return found

    # Mistakes that explain much by chance

    def acne(self) -> list[Trial]:
        """Lights that are missing here and there, alone or beside another mistake."""
        (way,) = BY_NAME["acne"].variants
        # Points that acne leaves alone show the other mistake alone.
        others = [single for single in self.singles if self.explained(single) > _SPARED]
        few = [self.few.trial({"acne": way, **other.made}) for other in (Trial({}), *others)]
        found = [self.fit.trial(trial.made) for trial in few if trial.score.gain > NAMED]
        found = [trial for trial in found if self._is_speckled(trial)]
        best = found[:1]
        for trial in found[1:]:
            best = [trial] if self._is_better(trial, best[0]) else best
        return best

    def _is_speckled(self, trial: Trial) -> bool:
        """Whether lights are missing among neighbours that have them, and not only where shadows end.

        Of the neighbours of pixels that miss light, those count that have as much light as the pixel should have. Some
        of them must be right: hardly any are in a shadow that falls elsewhere. Along the edges of shadows, which
        rounding moves, half are. So where acne does not explain nearly all, it has to be amid lit surfaces, too.
        """
        rest = trial.without("acne")
        rows = np.flatnonzero(self.fit.matched(trial.changes) & ~self.fit.matched(rest))
        height, width = self.mine.shape[:2]
        around = self.fit.sample.pixels[rows, None] + np.array([(0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)])
        around = around[((around >= 0) & (around < (width, height))).all(axis=(1, 2))]
        rules = replace(self.base, **rest)
        pixels = around.reshape(-1, 2)
        lit = self.tracer.colors(pixels, rules)
        light = (lit - self.tracer.colors(pixels, replace(rules, reaching=(0, -1)))).sum(axis=1).reshape(-1, 5)
        alike = (np.abs(light[:, 1:] - light[:, :1]) <= 0.25 * light[:, :1]) & (light[:, :1] > 0)
        off = np.abs(to_bytes(lit, rules) - self.mine[pixels[:, 1], pixels[:, 0]]).max(axis=1).reshape(-1, 5)
        free = (off[:, 1:] <= self.tolerance)[alike]
        if not free.any() or free.mean() < _FREE:
            return False
        return bool(trial.score.gain > _SURE or alike.all(axis=1).mean() >= _AMID)

    def _cut_off(self, trial: Trial) -> Trial:
        """With bytes that are rounded down, where those fit that this makes a difference to; else the same."""
        if self.base.rounding == "down" or "rounding" in trial.changes:
            return trial
        nearest = self.fit.levels(trial.changes)
        near = np.abs(nearest - self.fit.sample.mine) <= max(self.tolerance, 1)
        for way in BY_NAME["truncated"].variants:
            down = self.fit.levels({**trial.changes, **way})
            differ = (nearest != down) & near
            if differ.sum() >= 8 and (down == self.fit.sample.mine)[differ].mean() >= 0.95:
                return self.fit.trial({**trial.made, "truncated": way})
        return trial


def _agree(made: Mapping[str, Changes]) -> bool:
    """Whether mistakes can be made together: no two say the same of one rule."""
    return len({key for changes in made.values() for key in changes}) == sum(map(len, made.values()))
