"""A set of mechanisms that may explain a mismatch, and its more detailed forms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pmg.pipeline.diagnose.grid.candidates import rms
from pmg.pipeline.diagnose.grid.fitting import fit_candidate
from pmg.pipeline.diagnose.grid.ranking import in_detail, leaders, penalty, rank, score
from pmg.pipeline.fit.whitening import undo

if TYPE_CHECKING:
    from pmg.pipeline.diagnose.grid.candidates import Candidate, CandidateFit, GridProblem

SWAPS = 4
"""Mechanisms tried in the place of each one of a set."""


@dataclass(frozen=True)
class Explanation:
    """A set of mechanisms and what it leaves.

    Parameters
    ----------
    fits : tuple of CandidateFit
        The mechanisms, strongest first.
    problem : GridProblem
        The readings with them taken out and their parameters free.
    """

    fits: tuple[CandidateFit, ...]
    problem: GridProblem

    @property
    def gain(self) -> float:
        """Fall of the whitened sum of squares by all of them."""
        return float(sum(fit.gain for fit in self.fits))

    @property
    def score(self) -> float:
        """Gain less the cost of the parameters."""
        return self.gain - penalty(self.problem, *self.fits)

    def visible(self, fit: CandidateFit) -> float:
        """Root mean square of what the baseline cannot take up of a member, over the readings it touches [N m]."""
        touched = fit.effect != 0.0
        return rms(undo(self.problem.white, fit.seen)[touched])

    @property
    def unexplained(self) -> float:
        """Sum of squares that is left, with the cost of the parameters; lower is better, about whichever baseline."""
        left = self.problem.left
        return float(left @ left) + penalty(self.problem, *self.fits)


def explain_with(problem: GridProblem, candidates: tuple[Candidate, ...]) -> Explanation:
    """A set of candidates fitted, each beside those before it, then each once more beside all others."""
    found = Explanation((), problem)
    for candidate in candidates:
        fit = fit_candidate(found.problem, candidate)
        found = Explanation((*found.fits, fit), found.problem.take_out(fit))
    for place, candidate in enumerate(candidates if len(candidates) > 1 else ()):
        beside, gain = _without(problem, found, place)
        found = _replaced(found, place, fit_candidate(beside, candidate), beside, gain)
    return found


def leaders_in_detail(problem: GridProblem, singles: list[Explanation]) -> list[Explanation]:
    """Single mechanisms with the leading ones, on whichever shaft, in more detail; best first."""
    leading = {fit.candidate.identifier for fit in leaders([single.fits[0] for single in singles])}
    found = []
    for single in singles:
        (fit,) = single.fits
        finer = in_detail(problem, fit, narrower=True) if ids(single) <= leading else fit
        found.append(single if finer is fit else Explanation((finer,), problem.take_out(finer)))
    return sorted(found, key=lambda e: -e.score)


def _without(problem: GridProblem, explanation: Explanation, place: int) -> tuple[GridProblem, float]:
    """The problem with all mechanisms of a set taken out but one, and what that one gains there."""
    for other in (*explanation.fits[:place], *explanation.fits[place + 1 :]):
        problem = problem.take_out(other)
    rest = explanation.problem.left
    return problem, float(problem.left @ problem.left - rest @ rest)


def _replaced(explanation: Explanation, place: int, fit: CandidateFit, beside: GridProblem, gain: float) -> Explanation:
    """The set with another fit in one place; `gain` is what the one before it gained beside the others."""
    told = replace(fit, gain=explanation.fits[place].gain + fit.gain - gain)
    fits = (*explanation.fits[:place], told, *explanation.fits[place + 1 :])
    return Explanation(fits, beside.take_out(fit))


def all_in_detail(problem: GridProblem, explanation: Explanation) -> Explanation:
    """Each mechanism of a set in more detail beside the others, where the data call for it."""
    for place, fit in enumerate(explanation.fits):
        beside, gain = _without(problem, explanation, place)
        here = replace(fit, gain=gain)
        finer = in_detail(beside, here, narrower=True)
        if finer is not here:
            explanation = _replaced(explanation, place, finer, beside, gain)
    return explanation


def swapped(problem: GridProblem, explanation: Explanation) -> list[Explanation]:
    """Sets in which one mechanism of a set gave way to another, or to itself on another shaft."""
    found = []
    for place, fit in enumerate(explanation.fits):
        beside, gain = _without(problem, explanation, place)
        others = ids(explanation) - {fit.candidate.identifier}
        ranked = rank(beside, others)
        detailed = [in_detail(beside, one) for one in leaders(ranked)]
        tried = sorted([*ranked, *detailed], key=lambda one: -score(beside, one))
        seen = {fit.candidate: fit, **{one.candidate: one for one in tried}}
        found += [_replaced(explanation, place, one, beside, gain) for one in list(seen.values())[1 : SWAPS + 1]]
    return [one for one in found if needed(one)]


def needed(explanation: Explanation) -> bool:
    """No mechanism has all its sizes on a bound: it would be absent, or as large as can be."""
    return not any(set(fit.candidate.sizes) <= set(fit.on_bound) for fit in explanation.fits)


def ids(explanation: Explanation) -> frozenset[str]:
    """Of the mechanisms of a set."""
    return frozenset(fit.candidate.identifier for fit in explanation.fits)
