"""A set of candidates that may explain a mismatch, its more detailed forms, and sets with a member swapped."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic

from pmg.pipeline.diagnosis.engine.catalogue import leaders
from pmg.pipeline.diagnosis.engine.problem import F, P

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue

SWAPS = 4
"""Candidates tried in the place of each one of a set."""

NEAR = 1.0
"""Evidence by which a set may miss the margin for the decision against it to be near: odds of 1.6 to 1."""


@dataclass(frozen=True)
class Explanation(Generic[F, P]):
    """A set of candidates and what it leaves.

    Parameters
    ----------
    fits : tuple of Fit
        In the order in which they entered.
    problem : WhitenedProblem
        With them taken out and their parameters free; where their laws bend, what that takes up is out of its rows.
    bent : float
        What a free form of their laws takes up beyond the forms of the catalogue [noise variances]; 0 where the laws
        are those of the catalogue.
    """

    fits: tuple[F, ...]
    problem: P
    bent: float = 0.0

    @property
    def ids(self) -> frozenset[str]:
        """Ids of the candidates."""
        return frozenset(fit.identifier for fit in self.fits)

    @property
    def gain(self) -> float:
        """Fall of the whitened sum of squares by all of them."""
        return float(sum(fit.gain for fit in self.fits))

    @property
    def score(self) -> float:
        """Gain less the cost of the parameters."""
        return float(sum(self.problem.score(fit) for fit in self.fits))

    @property
    def unexplained(self) -> float:
        """Sum of squares that is left, with the cost of the parameters; lower is better, about whichever baseline."""
        left = self.problem.left
        return float(left @ left) + self.gain - self.score

    @property
    def needed(self) -> bool:
        """Whether no candidate has all its sizes on a bound."""
        return all(fit.needed for fit in self.fits)

    def plus(self, fit: F) -> Explanation[F, P]:
        """The set with one more, fitted to what it leaves."""
        return Explanation((*self.fits, fit), self.problem.take_out(fit))


def explain_with(problem: P, catalogue: CandidateCatalogue[F, P], candidates: Iterable[Any]) -> Explanation[F, P]:
    """A set of candidates fitted, each beside those before it, then each once more beside all others."""
    found = Explanation[F, P]((), problem)
    for candidate in candidates:
        found = found.plus(catalogue.fit(found.problem, candidate))
    for place, fit in enumerate(found.fits if len(found.fits) > 1 else ()):
        rest, gain = without(problem, found, place)
        found = _replaced(found, place, catalogue.fit(rest, fit.candidate), rest, gain)
    return found


def leaders_in_detail(
    problem: P, catalogue: CandidateCatalogue[F, P], singles: list[Explanation[F, P]]
) -> list[Explanation[F, P]]:
    """Single candidates with the leading ones, in whichever place, in more detail; best first."""
    leading = {fit.identifier for fit in leaders([single.fits[0] for single in singles])}
    found = []
    for single in singles:
        (fit,) = single.fits
        finer = catalogue.in_detail(problem, fit, narrower=True) if single.ids <= leading else fit
        found.append(single if finer is fit else Explanation((finer,), problem.take_out(finer)))
    return sorted(found, key=lambda e: -e.score)


def without(problem: P, explanation: Explanation[F, P], place: int) -> tuple[P, float]:
    """The problem with all candidates of a set taken out but the one in a place, and what that one gains there."""
    for other in (*explanation.fits[:place], *explanation.fits[place + 1 :]):
        problem = problem.take_out(other)
    rest = explanation.problem.left
    return problem, float(problem.left @ problem.left - rest @ rest)


def _replaced(explanation: Explanation[F, P], place: int, fit: F, rest: P, gain: float) -> Explanation[F, P]:
    """The set with another fit in one place; `gain` is what the one before it gained beside the `rest`."""
    counted = replace(fit, gain=explanation.fits[place].gain + fit.gain - gain)
    return Explanation((*explanation.fits[:place], counted, *explanation.fits[place + 1 :]), rest.take_out(fit))


def all_in_detail(problem: P, catalogue: CandidateCatalogue[F, P], explanation: Explanation[F, P]) -> Explanation[F, P]:
    """Each candidate of a set in more detail beside the others, where the data call for it."""
    for place, fit in enumerate(explanation.fits):
        rest, gain = without(problem, explanation, place)
        here = replace(fit, gain=gain)
        finer = catalogue.in_detail(rest, here, narrower=True)
        if finer is not here:
            explanation = _replaced(explanation, place, finer, rest, gain)
    return explanation


def swapped(problem: P, catalogue: CandidateCatalogue[F, P], explanation: Explanation[F, P]) -> list[Explanation[F, P]]:
    """Sets in which one candidate of a set gave way to another, or to itself in another place."""
    found = []
    for place, fit in enumerate(explanation.fits):
        rest, gain = without(problem, explanation, place)
        ranked = catalogue.rank(rest, explanation.ids - {fit.identifier})
        detailed = [catalogue.in_detail(rest, one) for one in leaders(ranked)]
        tried = sorted([*ranked, *detailed], key=lambda one: -rest.score(one))
        seen = {fit.candidate: fit, **{one.candidate: one for one in tried}}
        found += [_replaced(explanation, place, one, rest, gain) for one in list(seen.values())[1 : SWAPS + 1]]
    return [one for one in found if one.needed]


def rivals_near(
    best: Explanation[F, P], pool: list[Explanation[F, P]], margin: float, of_form: float
) -> tuple[tuple[Explanation[F, P], ...], dict[str, str], tuple[tuple[Explanation[F, P], float], ...]]:
    """Rivals within a margin, places of the best, and sets that miss it by less than `NEAR`, with how much.

    What an error of form is worth counts for a set that explains less, not for one that explains as much by more
    parameters.
    """

    def least(other: Explanation[F, P]) -> float:
        return max(0.0, best.score - margin - min(of_form, max(0.0, best.gain - other.gain)))

    near = [e for e in sorted(pool, key=lambda e: -e.score) if e.score > least(e) - NEAR]
    rivals, shafts = _rivals(best, [e for e in near if e.score > least(e)])
    missed = [e for e in _rivals(best, near)[0] if e.score <= least(e) and best.fits]
    return rivals, shafts, tuple((each, least(each) - each.score) for each in missed)


def _rivals(
    best: Explanation[F, P], near: list[Explanation[F, P]]
) -> tuple[tuple[Explanation[F, P], ...], dict[str, str]]:
    """Rivals with other candidates, each set once; and the places of the best, and those that a twin leaves open."""
    shafts = {fit.identifier: fit.place for fit in best.fits}
    rivals: dict[frozenset[str], Explanation[F, P]] = {}
    for other in near:
        if other.ids != best.ids and (len(other.fits) > len(best.fits) or other.ids < best.ids):
            continue
        known = best if other.ids == best.ids else rivals.setdefault(other.ids, other)
        places = {fit.identifier: fit.place for fit in known.fits}
        for fit in other.fits:
            open_to = {fit.place, places[fit.identifier]}
            if len(open_to) > 1 and "both" not in open_to and (known is best or fit.identifier not in best.ids):
                shafts[fit.identifier] = "either"
    return tuple(rivals.values()), shafts
