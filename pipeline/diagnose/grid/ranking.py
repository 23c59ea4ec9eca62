"""The catalogue ranked: every mechanism fitted, in the detail that the data call for."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pmg.pipeline.diagnose.grid.candidates import candidates, refinement
from pmg.pipeline.diagnose.grid.fitting import fit_candidate

if TYPE_CHECKING:
    from collections.abc import Collection

    from pmg.pipeline.diagnose.grid.candidates import CandidateFit, GridProblem

ENTRY = 10.0
"""Evidence that a mechanism must bring to enter: fall of the sum of squares in noise variances, beyond its cost."""


FINER = 4.0
"""Evidence by which the more detailed form of a mechanism must beat the simple one: odds of 7 to 1."""


LEADERS = 2
"""Leading mechanisms that are compared in detail, so that a simple form does not lose to another's detailed one."""


def penalty(problem: GridProblem, *fits: CandidateFit) -> float:
    """Cost of the parameters of fits (Schwarz's criterion, up to a constant), in noise variances."""
    return sum(fit.cost for fit in fits) * math.log(len(problem.left))


def score(problem: GridProblem, fit: CandidateFit) -> float:
    """Gain of a fit less the cost of its parameters."""
    return fit.gain - penalty(problem, fit)


def rank(problem: GridProblem, without: Collection[str] = ()) -> list[CandidateFit]:
    """All mechanisms but some fitted, best score first.

    Where the more detailed form of a mechanism is proportional to its sizes, and so found at once, it is tried here
    (with a shape of its own only if the simple form brings something); one that must be searched for is tried by
    `in_detail` where it matters.
    """
    fits = []
    for candidate in candidates():
        if candidate.identifier in without:
            continue
        fit = fit_candidate(problem, candidate)
        finer = refinement(candidate)
        at_once = finer is not None and finer.kind.linear and (not finer.kind.shape or score(problem, fit) > ENTRY)
        fits.append(in_detail(problem, fit) if at_once else fit)
    return sorted(fits, key=lambda fit: -score(problem, fit))


def in_detail(problem: GridProblem, fit: CandidateFit, *, narrower: bool = False) -> CandidateFit:
    """A fitted mechanism in more detail where it has such a form and the data call for it; as it is otherwise.

    With `narrower`, one that acts on both shafts is tried on each of them alone, too.
    """
    wider = narrower and fit.candidate.kind.both_at_once and fit.candidate.shaft == "both"
    tried = [fit]
    for candidate in candidates():
        if candidate.kind is fit.candidate.kind and (wider or candidate.shaft == fit.candidate.shaft):
            finer = refinement(candidate)
            tried += [fit_candidate(problem, finer)] if finer is not None else []
    best = max(tried, key=lambda one: score(problem, one))
    worth = score(problem, best) > score(problem, fit) + FINER
    return best if worth and not best.without_scale else fit


def choose(problem: GridProblem, without: Collection[str] = ()) -> CandidateFit:
    """The best mechanism but some; the leading ones are compared in detail."""
    return max(
        (in_detail(problem, fit) for fit in leaders(rank(problem, without))), key=lambda fit: score(problem, fit)
    )


def leaders(ranked: list[CandidateFit]) -> list[CandidateFit]:
    """The best fit of each of the leading mechanisms."""
    best: dict[str, CandidateFit] = {}
    for fit in ranked:
        best.setdefault(fit.candidate.identifier, fit)
    return list(best.values())[:LEADERS]
