"""Which terms explain a mismatch, which rivals cannot be told from them, and which further ones only help."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnose.balance.fitting import TermFit, TermProblem, fit_term
from pmg.pipeline.diagnose.grid.naming import FIRST_OF_PAIRS, FORM_ERROR, MARGIN, MOST, SHARE_OF_FIRST, SHARE_OF_REST
from pmg.pipeline.diagnose.grid.ranking import ENTRY

if TYPE_CHECKING:
    from pmg.pipeline.diagnose.engine.adequacy import AdequacyTest, Remainder

TWIN = 0.999
"""Correlation of what two terms leave beside everything else from which on a record cannot tell them apart."""


TOGETHER = 0.9
"""Part of what is left that two terms must explain to enter at once."""


@dataclass(frozen=True)
class TermSet:
    """A set of terms and what it leaves.

    Parameters
    ----------
    fits : tuple of TermFit
        In the order in which they entered.
    problem : TermProblem
        With them taken out and their parameters free.
    """

    fits: tuple[TermFit, ...]
    problem: TermProblem

    @property
    def ids(self) -> frozenset[str]:
        """Ids of the terms."""
        return frozenset(fit.identifier for fit in self.fits)

    @property
    def gain(self) -> float:
        """Fall of the whitened sum of squares by all of them."""
        return float(sum(fit.gain for fit in self.fits))

    @property
    def score(self) -> float:
        """Gain less the cost of the parameters (Schwarz's criterion, up to a constant)."""
        return float(sum(fit.evidence(len(self.problem.left)) for fit in self.fits))


@dataclass(frozen=True)
class Step:
    """One round of the search.

    Parameters
    ----------
    ranking : tuple of TermFit
        Terms not yet taken, best first.
    entered : str
        Id of the one that entered; empty where none did.
    remainder : Remainder
        What was left before it.
    """

    ranking: tuple[TermFit, ...]
    entered: str
    remainder: Remainder


@dataclass(frozen=True)
class Search:
    """What the library says.

    Parameters
    ----------
    best : TermSet
        The leading set; empty where no term enters.
    rivals : tuple of TermSet
        Other sets within the margin, best first.
    remainder : Remainder
        What the leading set leaves.
    explained : bool
        Whether it leaves no more than an error of form.
    steps : tuple of Step
        The rounds, with the ranking of each.
    """

    best: TermSet
    rivals: tuple[TermSet, ...]
    remainder: Remainder
    explained: bool
    steps: tuple[Step, ...]


def rank(problem: TermProblem, without: frozenset[str], *, refine: bool = True) -> tuple[TermFit, ...]:
    """All terms that have not been taken, best evidence first; only the leaders' shapes are refined."""
    samples = len(problem.left)
    fits = [fit_term(problem, table.term, refine=False) for key, table in problem.tables.items() if key not in without]
    fits.sort(key=lambda fit: -fit.evidence(samples))
    leaders = FIRST_OF_PAIRS + 1
    if refine:
        fits[:leaders] = [f if f.term.shape is None else fit_term(problem, f.term) for f in fits[:leaders]]
    return tuple(sorted(fits, key=lambda fit: -fit.evidence(samples)))


def _extend(first: TermSet, wanted: int) -> tuple[list[TermSet], tuple[TermFit, ...]]:
    ranking = rank(first.problem, first.ids)
    entering = [fit for fit in ranking[:wanted] if fit.gain > 0.0]
    return [TermSet((*first.fits, fit), first.problem.take_out(fit)) for fit in entering], ranking


def search(problem: TermProblem, remainder_of: AdequacyTest) -> Search:
    """Name terms: singles, then pairs and threes while something is left; rules and thresholds of `naming`.

    Parameters
    ----------
    problem : TermProblem
        Force with the baseline free.
    remainder_of : callable
        Judges what a problem leaves.
    """
    empty = TermSet((), problem)
    remainder = remainder_of(problem)
    ranking = rank(problem, frozenset())
    steps = [Step(ranking, "", remainder)]
    sound = [fit for fit in ranking if fit.gain > 0.0 and not fit.on_bound]
    singles = [TermSet((fit,), problem.take_out(fit)) for fit in sound[: FIRST_OF_PAIRS + 3]]
    best = singles[0] if singles and singles[0].score > ENTRY else empty
    pool = list(singles)
    if best.fits:
        steps[0] = Step(ranking, best.fits[0].identifier, remainder)
        remainder = remainder_of(best.problem)
    while best.fits and not remainder.adequate and len(best.fits) < MOST:
        starts = [best] if len(best.fits) > 1 else singles[:FIRST_OF_PAIRS]
        larger: list[TermSet] = []
        for start in starts:
            found, ranked = _extend(start, FIRST_OF_PAIRS)
            larger += found
            if start.ids == best.ids:
                ranking = ranked
        larger = sorted((entry for entry in larger if all(map(_sound, entry.fits))), key=lambda entry: -entry.score)
        steps.append(Step(ranking, "", remainder))
        pool += larger
        after = larger[0] if larger and _enters(best, larger[0], remainder.excess) else None
        if after is None and larger:
            after = _together(best, larger, remainder.excess)
            pool += [] if after is None else [after]
        if after is None:
            break
        steps[-1] = Step(ranking, " + ".join(f.identifier for f in after.fits[len(best.fits) :]), remainder)
        best = after
        remainder = remainder_of(best.problem)
    if len(best.fits) > 1:
        pool += _replaced(problem, best)
    explained = bool(best.fits) and remainder.excess <= FORM_ERROR * best.gain
    margin = MARGIN + (0.0 if remainder.adequate else remainder.excess)
    return Search(best, _rivals(best, pool, margin), remainder, explained, tuple(steps))


def _sound(fit: TermFit) -> bool:
    """Whether no parameter ran to a bound: a term that did is absent, or bends to anything."""
    return not fit.on_bound


def _enters(before: TermSet, after: TermSet, excess: float) -> bool:
    """Whether one more term is more than an error of form of those before."""
    gained = after.gain - before.gain
    enough = max(SHARE_OF_REST * excess, SHARE_OF_FIRST * before.gain)
    return after.score > before.score + ENTRY and gained > enough and all(map(_sound, after.fits))


def _replaced(problem: TermProblem, best: TermSet) -> list[TermSet]:
    """The set with each of its terms replaced by the best few others."""
    found = []
    for gone in best.fits:
        rest = TermSet((), problem)
        for fit in best.fits:
            if fit is not gone:
                again = fit_term(rest.problem, fit.term)
                rest = TermSet((*rest.fits, again), rest.problem.take_out(again))
        others = rank(rest.problem, best.ids)[:FIRST_OF_PAIRS]
        found += [TermSet((*rest.fits, fit), rest.problem.take_out(fit)) for fit in others]
    return found


def _together(before: TermSet, larger: list[TermSet], excess: float) -> TermSet | None:
    """Two terms that enter at once: where several are missing, none need explain half of the rest by itself.

    Together they must leave almost nothing, and each must be more than an error of form.
    """
    if len(before.fits) + 2 > MOST:
        return None
    pairs = [pair for entry in larger[:FIRST_OF_PAIRS] for pair in _extend(entry, FIRST_OF_PAIRS)[0]]
    pairs = [pair for pair in pairs if before.ids < pair.ids and all(map(_sound, pair.fits))]
    if not pairs:
        return None
    best = max(pairs, key=lambda pair: pair.score)
    new = [fit for fit in best.fits if fit.identifier not in before.ids]
    least = max(ENTRY, SHARE_OF_FIRST * before.gain)
    whole = best.gain - before.gain >= TOGETHER * excess
    return best if whole and all(fit.gain > least for fit in new) else None


def _rivals(best: TermSet, pool: list[TermSet], margin: float) -> tuple[TermSet, ...]:
    rivals: dict[frozenset[str], TermSet] = {}
    for other in sorted(pool, key=lambda entry: -entry.score):
        near = other.score > max(ENTRY, best.score - margin) and all(map(_sound, other.fits))
        apart = len(other.fits) <= len(best.fits) and not other.ids <= best.ids
        if best.fits and near and apart:
            rivals.setdefault(other.ids, other)
    return tuple(rivals.values())


@dataclass(frozen=True)
class Twins:
    """Two terms that a record cannot tell apart, or one that the baseline absorbs.

    Parameters
    ----------
    ids : tuple of str
        Two ids; one where the baseline holds it.
    correlation : float
        Of what the two leave beside baseline and named terms; 1 for an absorbed one.
    """

    ids: tuple[str, ...]
    correlation: float


def find_twins(problem: TermProblem) -> tuple[Twins, ...]:
    """Shape-free terms that look alike beside a baseline, from the design of the record alone."""
    tables = {k: t for k, t in problem.tables.items() if t.term.shape is None}
    columns = {key: table.columns[:, 0, 0] for key, table in tables.items()}
    seen = {key: problem.project(column[:, None])[:, 0] for key, column in columns.items()}
    found = []
    visible = []
    for key, column in columns.items():
        part = float(np.linalg.norm(seen[key])) / max(float(np.linalg.norm(column)), 1e-300)
        if part < math.sqrt(1.0 - TWIN**2):
            found.append(Twins((key,), math.sqrt(1.0 - part**2)))
        else:
            visible.append(key)
    for i, one in enumerate(visible):
        for other in visible[i + 1 :]:
            a, b = seen[one], seen[other]
            correlation = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b))
            if abs(correlation) > TWIN:
                found.append(Twins((one, other), correlation))
    return tuple(found)
