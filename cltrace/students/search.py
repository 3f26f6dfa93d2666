"""Which mistakes explain a wrong picture: those are made on some of its pixels, alone and by twos, and compared.

A cause has to explain pixels that are wrong without spoiling those that are right. How well it does so is its gain: the
share of the wrong pixels that it explains, less what it spoils, counted in wrong pixels. A few pixels tell which causes
are worth a look, more of them which one it is: it is named if it explains nearly all, and no other one does as well.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cltrace.scene import PARALLEL, POINT, SPOT, Scene
from cltrace.students.mistakes import BY_NAME, ENOUGH, MISTAKES, Changes
from cltrace.students.rules import Rules, can_be_made_together
from cltrace.students.shapes import Ints
from cltrace.students.tracer import Tracer, to_bytes
from cltrace.students.whole import Whole, profile

Levels = NDArray[np.int64]  # (n, 3), 0..255
Bits = NDArray[np.bool_]

USUAL = 300, 200  # wrong and sound pixels of a sample
LARGE = 1500, 1500  # of the one by which a cause is named
WIDE = 2500, 5000  # of the one that parts what fits equally well
FIRST = 40, 30  # of the first look at mistakes
RAYS, FEWER = 20, 0.25  # a pixel, beyond which samples are smaller, and to which share of their size at least
HALF = 0.5  # at least that of the first look is left, whatever the others are
LEAST_OF = 24, 16  # of the look at two together
_MOST = 20.0  # what is spoiled counts no more than so many times what is explained
_FAR = 48  # levels from which on a pixel is just wrong
_LIGHTS = 4  # up to which all choices among lights are tried
_SPARED = 0.1  # of the wrong pixels, at least that acne beside another mistake leaves alone
_FREE, _AMID, _SURE = 0.1, 0.2, 0.8  # see _is_speckled
WORTH = 0.85  # the gain from which on a cause may be the one
NAMED = 0.97  # the share of the wrong pixels that it has to explain, and less than the rest to spoil
LIKELY = 0.5  # the gain from which on a cause may be a part of it
PART = 0.02  # of the wrong pixels, at least that each of two mistakes explains
RIVALS = 4  # names that may fit equally well, beyond which none is worth saying
DECISIVE = 3  # pixels by which one explanation is better than another, at least
LEAST, LEFT = 8, 0.005  # wrong pixels, and their share, that one mistake leaves for a second one to be looked for
ALL_BUT = 0.9  # of these, that a second one has to explain if they are few
LOOSE = 0.2  # the share of pixels beyond which there is no need to ask whether rounding decides them
DELICATE = 0.05  # the share of the wrong pixels that it may decide
_LOOKED_AT = 12  # explanations that are held against each other
_MANY = 8  # lights of which each may be missing
SEEDS = 4  # mistakes to which second ones are added
FLEXIBLE = ("acne", "truncated", "large-epsilon")  # explain more by chance, or slowly: asked for last
Names = tuple[str, ...]
_ORDER = {mistake.name: i for i, mistake in enumerate(MISTAKES)}


@dataclass(frozen=True)
class Sample:
    """Some pixels of a picture: pixels (n, 2), column and row; mine, right (n, 3): their levels; wrong: (n,).

    weight: how much a sound pixel of the sample counts against a wrong one; total: how many are wrong in the picture.
    """

    pixels: Ints
    mine: Levels
    right: Levels
    wrong: Bits
    weight: float
    total: int

    def at(self, rows: Ints) -> Sample:
        return Sample(
            self.pixels[rows], self.mine[rows], self.right[rows], self.wrong[rows], weight=self.weight, total=self.total
        )

    @classmethod
    def of(cls, mine: Levels, right: Levels, tolerance: int, counts: tuple[int, int], free: Bits) -> Sample:
        """Takes wrong and sound pixels of whole pictures, (h, w, 3), always the same ones of the same pictures.

        free: (h, w), pixels that are not taken.
        """
        wrong = np.abs(mine - right).max(axis=2) > tolerance
        rng = np.random.default_rng(0)
        bad, good = (rng.permutation(np.flatnonzero(which & ~free)) for which in (wrong, ~wrong))
        y, x = np.divmod(np.sort(np.concatenate([bad[: counts[0]], good[: counts[1]]])), mine.shape[1])
        weight = min(len(good) / max(len(bad), 1), _MOST)
        return cls(np.stack([x, y], axis=1), mine[y, x], right[y, x], wrong[y, x], weight=weight, total=len(bad))

    def few(self, counts: tuple[int, int]) -> Sample:
        """A few of these pixels."""
        rng = np.random.default_rng(1)
        rows = [rng.permutation(np.flatnonzero(w))[:n] for w, n in zip((self.wrong, ~self.wrong), counts, strict=True)]
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


@dataclass(frozen=True)
class Verdict:
    """What a picture's differences are explained by.

    named: the mistakes, none where it is unknown; rivals: for each name those that fit as well; others: explanations
    that are as good as `named`, each with a rival in place of a name.
    """

    named: Trial
    rivals: Mapping[str, Names]
    others: tuple[Trial, ...] = ()


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
        rules = self.base.changed(**changes)
        if rules.lights.reaching is not None:
            return to_bytes(self._linear(rules), rules.picture)
        choices = np.stack([to_bytes(colors, rules.picture) for colors in self._with_lights(rules)])
        best = np.abs(choices - self.sample.mine).max(axis=2).argmin(axis=0)
        return np.asarray(choices[best, np.arange(len(best))])

    def _linear(self, rules: Rules) -> NDArray[np.float64]:
        linear = rules.linear
        if linear not in self._colors:
            self._colors[linear] = self.tracer.colors(self.sample.pixels, linear)
        return self._colors[linear]

    def prepare(self, made: Sequence[Mapping[str, Changes]]) -> None:
        """Traces what differs by its camera alone together, which is faster."""
        alike: dict[Rules, list[Rules]] = {}
        for rules in dict.fromkeys(self.base.changed(**Trial(one).changes).linear for one in made):
            if rules not in self._colors and rules.lights.reaching is not None:
                alike.setdefault(replace(rules, camera=self.base.camera), []).append(rules)
        for some in alike.values():
            seen = self.tracer.through(self.sample.pixels, [rules.camera for rules in some], some[0])
            self._colors.update(zip(some, seen, strict=True))

    def _with_lights(self, rules: Rules) -> Iterator[NDArray[np.float64]]:
        """The colours with each choice of lights that reach what is seen first, and what mirrors and glass show."""
        whole = self._linear(rules.changed(reaching=(-1, -1)))
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
        whole, *others = (self._linear(rules.changed(reaching=side)) for side in sides)
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

    def explained(self, trial: Trial) -> float:
        """The share of the wrong pixels that mistakes explain together."""
        return float(self.matched(trial.changes)[self.sample.wrong].mean())


class Search:
    """The search for the causes of a picture's differences.

    mine, right: (h, w, 3) levels; tolerance: by how many two may differ; base: the rules of the right picture; found:
    what is wrong with the picture as a whole.
    """

    def __init__(self, scene: Scene, mine: Levels, right: Levels, tolerance: int, base: Rules, found: Whole) -> None:
        self.mine, self.tolerance, self.found = mine, tolerance, found
        self.base = base
        self.tracer = Tracer(scene)
        self.free = found.free.copy() if found.free is not None else np.zeros(mine.shape[:2], np.bool_)
        for cover in found.covers.values():
            self.free |= cover
        self.is_open = False  # whether too much explains the picture, so that more mistakes would do so by chance
        self._samples = (mine, right, tolerance)
        sample = self._sample(USUAL)
        self.share = min(max(RAYS * len(sample.mine) / max(self.tracer.rays, 1), FEWER), 1.0)
        self.fit = self._fit(sample.few(self._counts(USUAL)) if self.share < 1 else sample)
        self.few = self._fit(self.fit.sample.few(self._counts(FIRST, HALF)))
        self.whole = self._tuned(found.made)

    def _fit(self, sample: Sample) -> Fit:
        return Fit(self.tracer, sample, self.tolerance, self.base)

    def _counts(self, counts: tuple[int, int], least: float = 0.0) -> tuple[int, int]:
        """So many pixels, or fewer if each takes many rays, but no less than that share."""
        share = max(self.share, least)
        return round(counts[0] * share), round(counts[1] * share)

    def _sample(self, counts: tuple[int, int]) -> Sample:
        """Without the pixels where doubles see something else than is there, of which they cannot judge."""
        sample = Sample.of(*self._samples, counts=counts, free=self.free)
        off = np.abs(to_bytes(self.tracer.colors(sample.pixels), self.base.picture) - sample.right).max(axis=1)
        return sample.at(np.flatnonzero(off <= 1))

    @cached_property
    def large(self) -> Fit:
        return self._fit(self._sample(self._counts(LARGE)))

    @cached_property
    def wide(self) -> Fit:
        return self._fit(self._sample(self._counts(WIDE)))

    def _tuned(self, made: Mapping[str, Changes]) -> Mapping[str, Changes]:
        """What is wrong with the whole picture, in the ways that fit best now that rays are traced."""
        return self._adjusted(self.few, Trial(made)).made if made else made

    def verdicts(self) -> Iterator[Verdict | None]:
        """The mistakes that explain the picture, as few as do, after each look at it; None if none do yet."""
        none = Trial(self.whole)
        if self.fit.sample.wrong.sum() < ENOUGH or self._is_all_smooth():
            yield Verdict(self._cut_off(none) if self.tolerance == 0 else none, {})
            return
        for trials in self._looks():
            verdict = self._judged(trials)
            yield verdict and (self._judged(self._beside(verdict)) or verdict)
            if self.is_open:
                return

    def _is_all_smooth(self) -> bool:
        """Whether hardly anything is wrong but what smoothness makes so."""
        left = int((np.abs(self._samples[0] - self._samples[1]).max(axis=2) > self.tolerance)[~self.free].sum())
        everything = left + sum(int(cover.sum()) for cover in self.found.covers.values())
        return self.found.free is not None and not self.whole and left <= (1 - NAMED) * everything

    def unknown(self) -> Verdict:
        """What is sure where no look explains the picture."""
        sure = self.found.sure and self.fit.trial(self.whole).score.gain >= LIKELY
        return Verdict(Trial(self.whole if sure else {}), {})

    def _looks(self) -> Iterator[list[Trial]]:
        """What may explain the picture, by what takes longer and longer to look for."""
        none = self.fit.trial(self.whole)
        yield [none] if self.whole else []
        yield [self._cut_off(none)] if self.tolerance == 0 else []
        yield self.singles
        if self.found.brief:
            return
        yield self._made("large-epsilon", self._epsilons(self.few, self.whole))
        # Two beside a change of the whole picture would be three, which explain too much by chance.
        yield from [] if self.whole else self.pairs()
        yield [] if self.whole else self._profiled()
        yield self.acne()

    # Which of some explanations it is

    def _judged(self, trials: Sequence[Trial]) -> Verdict | None:
        """The best of some explanations, if it explains nearly all and spoils nothing, and its rivals."""
        worth = sorted((t for t in trials if t.score.gain >= WORTH), key=lambda t: t.order, reverse=True)
        sure = [(trial, fits) for trial in worth[:_LOOKED_AT] for fits in [self._fits(trial)] if fits is not None]
        if not sure:
            return None
        best = max(sure, key=lambda item: item[1].sum())
        equal = [trial for trial, fits in sure if not self._is_clear(self.large, best, (trial, fits))]
        if len(equal) > 1 and self.free.size > sum(LARGE):
            rows = [(trial, self.wide.matched(trial.changes)) for trial in equal]
            best = max(rows, key=lambda item: item[1].sum())
            equal = [trial for trial, fits in rows if not self._is_clear(self.wide, best, (trial, fits))]
        equal.sort(key=lambda trial: [_ORDER[name] for name in trial.names])
        leader = equal[0]
        rivals: dict[str, Names] = {}
        for other in equal[1:]:
            new, gone = set(other.names) - set(leader.names), set(leader.names) - set(other.names)
            if len(new) == len(gone) == 1:
                (name,) = gone
                rivals[name] = (*rivals.get(name, ()), *new)
            elif new and gone:
                self.is_open = True
        self.is_open |= max(map(len, rivals.values()), default=0) >= RIVALS
        if self.is_open:
            return None
        return Verdict(leader, rivals, others=tuple(equal[1:]))

    def _fits(self, trial: Trial) -> Bits | None:
        """(n,): which pixels of the large sample a cause explains, or leaves right; None if that is not enough.

        A pixel counts as explained, too, if it shows what its own surroundings do: there rounding decides.
        """
        sample = self.large.sample
        matched, count = self.large.matched(trial.changes), max(int(sample.wrong.sum()), 1)
        rows = np.flatnonzero(~matched)
        if len(rows) > LOOSE * len(matched):
            return None
        low, high = self._surroundings(self.large, trial.changes, rows)
        mine = sample.mine[rows]
        matched[rows] = ((mine >= low - self.tolerance) & (mine <= high + self.tolerance)).all(axis=1)
        # What differs from its surroundings by chance must not be most of what there is to explain.
        delicate = (matched[rows] & sample.wrong[rows]).sum()
        # Black, white and background come about in many ways: what else there is has to fit as well as all does.
        empty = to_bytes(self.tracer.background, self.base.changed(**trial.changes).picture)
        telling = sample.wrong & ((sample.mine > 0) & (sample.mine < 255) & (sample.mine != empty)).any(axis=1)
        if (~matched & telling).sum() > (1 - NAMED) * telling.sum():
            return None
        missed, spoiled = int((~matched & sample.wrong).sum()), int((~matched & ~sample.wrong).sum())
        sound = self.free.size / max(sample.total, 1) - 1  # times as many as are wrong
        share = sound * spoiled / max(int((~sample.wrong).sum()), 1)
        if missed > (1 - NAMED) * count or delicate > DELICATE * count + 1 or (spoiled > 1 and share > 1 - NAMED):
            return None
        return matched if len(trial.made) == 1 or all(self._adds(trial, name) for name in trial.made) else None

    def _adds(self, trial: Trial, name: str) -> bool:
        """Whether one of several mistakes explains much, or, of no few pixels, nearly all that is left without it."""
        wrong = self.large.sample.wrong
        with_it, without = (self.large.matched(changes)[wrong] for changes in (trial.changes, trial.without(name)))
        part, count = int((with_it & ~without).sum()), max(int(wrong.sum()), 1)
        enough = part >= LEAST and part >= ALL_BUT * int((~without).sum())
        return enough or part >= max(PART * count, ENOUGH)

    def _surroundings(self, fit: Fit, changes: Changes, rows: Ints) -> tuple[Levels, Levels]:
        """The least and the greatest levels within a pixel's square and what is next to it, (n, 3) each."""
        rules = self.base.changed(**changes)
        x, y = rules.camera.sample
        pixels, offsets = fit.sample.pixels[rows], (-0.7, 0.0, 0.7)
        around = [rules.changed(sample=(x + dx, y + dy)).camera for dx in offsets for dy in offsets]
        seen = to_bytes(self.tracer.through(pixels, around, rules), rules.picture)
        return seen.min(axis=0), seen.max(axis=0)

    def _is_clear(self, fit: Fit, one: tuple[Trial, Bits], other: tuple[Trial, Bits]) -> bool:
        """Whether one explanation is better than another: where they differ, it is right far more often."""
        (a, fits_a), (b, fits_b) = one, other
        for_a, for_b = int((fits_a & ~fits_b).sum()), int((fits_b & ~fits_a).sum())
        if for_a >= DECISIVE + 4 * for_b:
            return True
        mine = fit.sample.mine
        seen_a, seen_b = fit.levels(a.changes), fit.levels(b.changes)
        rows = (seen_a != seen_b).any(axis=1) & fits_a & fits_b
        exact_a, exact_b = ((seen[rows] == mine[rows]).all(axis=1).sum() for seen in (seen_a, seen_b))
        return bool(for_a >= for_b and exact_a >= DECISIVE + 4 * exact_b)

    def explains(self, verdict: Verdict) -> tuple[float, dict[str, float]]:
        """Of the wrong pixels, the share that mistakes explain together, and those that are wrong without each."""
        wrong, changes = self.large.sample.wrong, verdict.named.changes
        together = float(self.large.matched(changes)[wrong].mean()) if wrong.any() else 1.0
        return together, self._parts(verdict.named)

    def _parts(self, trial: Trial) -> dict[str, float]:
        """Of the wrong pixels, the share that mistakes explain together and without this one do not, by name."""
        wrong, matched = self.large.sample.wrong, self.large.matched(trial.changes)
        parts = {name: matched & ~self.large.matched(trial.without(name)) for name in trial.made}
        return {name: float(part[wrong].mean()) if wrong.any() else 1.0 for name, part in parts.items()}

    # One mistake, and two

    @cached_property
    def looks(self) -> dict[str, list[Trial]]:
        """Each mistake that changes anything, alone, in all its ways, by a few pixels; of each the best way first."""
        twos = [{**self.whole, name: way} for name in self.ways for way in self.ways[name]]
        self.few.prepare([two for two in twos if can_be_made_together(two)])
        return {name: trials for name in self.ways if (trials := self._looked(name, self.ways[name]))}

    @cached_property
    def ways(self) -> dict[str, Sequence[Changes]]:
        """How each mistake may be made that is looked for with all others."""
        return {m.name: self._ways(m.name) for m in MISTAKES if not m.whole and m.name not in FLEXIBLE}

    def _looked(self, name: str, ways: Sequence[Changes]) -> list[Trial]:
        """How a mistake fits a few pixels, in each way that changes some of them."""
        before = self.few.levels(Trial(self.whole).changes)
        made = [{**self.whole, name: way} for way in ways]
        changed = [m for m in made if can_be_made_together(m) and (self.few.levels(Trial(m).changes) != before).any()]
        return sorted((self.few.trial(m) for m in changed), key=lambda trial: trial.order, reverse=True)

    @cached_property
    def singles(self) -> list[Trial]:
        """The mistakes that fit best alone, made in the way that does; the best first."""
        order = sorted(self.looks.values(), key=lambda trials: trials[0].order, reverse=True)
        by_distance = sorted(self.looks.values(), key=lambda trials: trials[0].score.distance)
        some = order[:_LOOKED_AT] + [trials for trials in by_distance[:SEEDS] if trials not in order[:_LOOKED_AT]]
        trials = [_best([self.fit.trial(trial.made) for trial in trials[:2]]) for trials in some]
        return sorted(trials, key=lambda trial: trial.order, reverse=True)

    def _made(self, name: str, ways: Sequence[Changes]) -> list[Trial]:
        """A mistake in the way that fits best, if it changes anything."""
        return [self.fit.trial(trial.made) for trial in self._looked(name, ways)[:1]]

    def _beside(self, verdict: Verdict) -> list[Trial]:
        """What else may be wrong where a named mistake leaves more than rounding does."""
        left = ~self.large.matched(verdict.named.changes)[self.large.sample.wrong]
        is_alone = len(verdict.named.made) <= len(self.whole) + 1 and not set(FLEXIBLE) & set(verdict.named.names)
        enough = is_alone and left.sum() >= max(LEAST, LEFT * len(left))
        # A few pixels of all would hardly have any of these.
        return self._with(verdict.named, verdict.others, self.large, self.ways) if enough else []

    def pairs(self) -> Iterator[list[Trial]]:
        """Two mistakes at once: what explains a part, and what explains the rest, by more and more of the first."""
        by_gain = sorted(self.singles, key=lambda trial: trial.score.gain, reverse=True)
        by_distance = sorted(self.singles, key=lambda trial: trial.score.distance)
        alike: dict[object, list[Trial]] = {}
        for trial in itertools.chain.from_iterable(zip(by_gain, by_distance, strict=True)):
            some = alike.setdefault(trial.order, [])
            some += [trial] if trial not in some else []
        ways = {name: [trial.made[name] for trial in trials] for name, trials in self.looks.items()}
        found: dict[frozenset[str], Trial] = {}
        for i, (seed, *twins) in enumerate(itertools.islice(alike.values(), max(round(SEEDS * self.share), 1))):
            for trial in self._with(seed, twins, self.fit, ways):
                found.setdefault(frozenset(trial.names), trial)
            if i % 2:
                yield list(found.values())
        yield list(found.values())

    def _profiled(self) -> list[Trial]:
        """Single mistakes in the colours of another screen."""
        made = [{**t.made, **profile(self.fit.sample.mine, self.fit.levels(t.changes))} for t in self.singles]
        return [self.fit.trial(two) for two in made if can_be_made_together(two) and "colour-profile" in two]

    def _with(
        self, seed: Trial, twins: Sequence[Trial], fit: Fit, ways: Mapping[str, Sequence[Changes]]
    ) -> list[Trial]:
        """A mistake beside another one that explains what this one leaves wrong, the best first.

        twins: others that fit as well as that one, so that they may fit as well beside the second mistake; fit: by
        what it is judged; ways: the second mistakes.
        """
        left = fit.sample.left(fit.matched(seed.changes))
        if left.wrong.sum() < ENOUGH:
            return []
        rest = self._fit(left.few(LEAST_OF))
        before = rest.trial(seed.made).score
        others = [{**seed.made, name: way} for name in ways if name not in seed.names for way in ways[name]]
        twos = [two for two in others if can_be_made_together(two)]
        rest.prepare(twos)
        trials = [trial for trial in map(rest.trial, twos) if trial.score.gain >= max(before.gain + 0.1, LIKELY)]
        found: dict[Names, Trial] = {}
        for trial in sorted(trials, key=lambda trial: trial.order, reverse=True):
            if len(found) < 4 and trial.names not in found:
                found[trial.names] = fit.trial(self._adjusted(rest, trial).made)
        second = [{name: two.made[name] for name in two.names if name not in seed.names} for two in found.values()]
        made = [{**twin.made, **more} for more in second for twin in twins]
        best = [*found.values(), *(fit.trial(two) for two in made if can_be_made_together(two))]
        # Few pixels cannot tell ways apart that hardly differ, and of rivals each has to be at its best.
        best = [self._adjusted(fit, two) if two.score.gain >= WORTH else two for two in best]
        return sorted(best, key=lambda trial: trial.order, reverse=True)

    def _adjusted(self, fit: Fit, trial: Trial) -> Trial:
        """Mistakes of which each is made in the way that fits best beside the others."""
        trial = fit.trial(trial.made)
        for name in trial.names:
            ways = [{**trial.made, name: way} for way in self._ways(name)]
            trial = _best([trial, *(fit.trial(way) for way in ways if can_be_made_together(way))])
        return trial

    def _ways(self, name: str) -> Sequence[Changes]:
        """How a mistake may be made in this scene."""
        lights = self.tracer.lights["kind"]
        kinds = {"no-parallel-lights": PARALLEL, "no-point-lights": POINT, "no-spot-lights": SPOT}
        if name in kinds:
            gone = sum(1 << k for k in np.flatnonzero(lights == kinds[name]).tolist())
            return [{"reaching": (~gone, ~gone)}] if gone else []
        if name == "light-missing":
            ones = [1 << k for k in range(min(len(lights), _MANY))]
            return [
                {"reaching": (bits, bits)} for bits in (*(~one for one in ones), *ones[: len(ones) * (len(ones) > 2)])
            ]
        return BY_NAME[name].variants

    def _epsilons(self, fit: Fit, others: Mapping[str, Changes]) -> list[Changes]:
        """Of each way to measure an epsilon, the one that fits best beside other mistakes."""
        scale = 10.0 ** math.ceil(math.log10(self.tracer.shapes(self.base.surfaces).size))
        ladder = [scale * 10.0**-k * x for k in range(5, 0, -1) for x in (1, 2, 5)]
        found = []
        for kind in BY_NAME["large-epsilon"].variants:
            if kind["spared"] and not self.tracer.bounces:
                continue
            tried = [fit.trial({**others, "large-epsilon": {**kind, "epsilon": epsilon}}) for epsilon in ladder]
            # What does not even begin to fit is not worth a finer look.
            for ratio in (1.5, 1.2, 1.1, 1.05) if _best(tried).score.gain > LIKELY else ():
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
        others = [single for single in self.singles if self.fit.explained(single) > _SPARED][:SEEDS]
        made = [{**other.made, "acne": way} for other in (Trial(self.whole), *others)]
        few = [self.few.trial(two) for two in made if can_be_made_together(two)]
        found = [self.fit.trial(trial.made) for trial in few if trial.score.gain > LIKELY]
        return [trial for trial in found if trial.score.gain >= WORTH and self._is_speckled(trial)][:1]

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
        rules = self.base.changed(**rest)
        pixels = around.reshape(-1, 2)
        lit = self.tracer.colors(pixels, rules)
        light = (lit - self.tracer.colors(pixels, rules.changed(reaching=(0, -1)))).sum(axis=1).reshape(-1, 5)
        alike = (np.abs(light[:, 1:] - light[:, :1]) <= 0.25 * light[:, :1]) & (light[:, :1] > 0)
        off = np.abs(to_bytes(lit, rules.picture) - self.mine[pixels[:, 1], pixels[:, 0]]).max(axis=1).reshape(-1, 5)
        free = (off[:, 1:] <= self.tolerance)[alike]
        if not free.any() or free.mean() < _FREE:
            return False
        return bool(trial.score.gain > _SURE or alike.all(axis=1).mean() >= _AMID)

    def _cut_off(self, trial: Trial) -> Trial:
        """With bytes that are rounded down, where those fit that this makes a difference to; else the same."""
        if self.base.picture.rounding == "down" or "rounding" in trial.changes:
            return trial
        nearest = self.fit.levels(trial.changes)
        near = np.abs(nearest - self.fit.sample.mine) <= max(self.tolerance, 1)
        for way in BY_NAME["truncated"].variants:
            down = self.fit.levels({**trial.changes, **way})
            differ = (nearest != down) & near
            if differ.sum() >= 8 and (down == self.fit.sample.mine)[differ].mean() >= 0.95:
                return self.fit.trial({**trial.made, "truncated": way})
        return self.fit.trial(trial.made)
