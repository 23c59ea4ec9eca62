"""The catalogue of mechanisms ranked: every one fitted, in the detail that the data call for."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from pmg.pipeline.diagnosis.engine.catalogue import ENTRY, CandidateCatalogue
from pmg.pipeline.diagnosis.engine.explanation import Explanation
from pmg.pipeline.diagnosis.engine.found_set import Naming
from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, GridProblem, candidates, refinement
from pmg.pipeline.diagnosis.grid.fitting import fit_candidate, settled_fit
from pmg.pipeline.diagnosis.grid.free_form import bent_columns

if TYPE_CHECKING:
    from collections.abc import Collection

    from pmg.pipeline.diagnosis.grid.candidates import Candidate
    from pmg.sim.signals import Array

GridExplanation: TypeAlias = Explanation[CandidateFit, GridProblem]
GridNaming: TypeAlias = Naming[CandidateFit, GridProblem]

FINER = 4.0
"""Evidence by which the more detailed form of a mechanism must beat the simple one: odds of 7 to 1."""


class MechanismCatalogue(CandidateCatalogue[CandidateFit, GridProblem]):
    """Every mechanism that shows in mean torques, shaft by shaft."""

    def fit(self, problem: GridProblem, candidate: Candidate) -> CandidateFit:
        """Best values of one mechanism with the baseline free to move."""
        return fit_candidate(problem, candidate)

    def choose(self, problem: GridProblem, without: Collection[str] = ()) -> CandidateFit:
        """The best mechanism but some; the leading ones are compared in detail, and fits by one step followed up."""
        best = super().choose(problem, without)
        return best if problem.whole is None else settled_fit(problem, best)

    def rank(self, problem: GridProblem, without: Collection[str] = ()) -> list[CandidateFit]:
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
            at_once = finer is not None and finer.kind.linear and (not finer.kind.shape or problem.score(fit) > ENTRY)
            fits.append(self.in_detail(problem, fit) if at_once else fit)
        return sorted(fits, key=lambda fit: -problem.score(fit))

    def in_detail(self, problem: GridProblem, fit: CandidateFit, *, narrower: bool = False) -> CandidateFit:
        """A fitted mechanism in more detail where it has such a form and the data call for it; as it is otherwise.

        With `narrower`, one that acts on both shafts is tried on each of them alone, too.
        """
        wider = narrower and fit.candidate.kind.both_at_once and fit.candidate.shaft == "both"
        tried = [fit]
        for candidate in candidates():
            if candidate.kind is fit.candidate.kind and (wider or candidate.shaft == fit.candidate.shaft):
                finer = refinement(candidate)
                tried += [fit_candidate(problem, finer)] if finer is not None else []
        best = max(tried, key=problem.score)
        worth = problem.score(best) > problem.score(fit) + FINER
        return best if worth and not best.without_scale else fit

    def free_form(self, problem: GridProblem, fit: CandidateFit) -> Array:
        """Smooth changes of the law of a mechanism along its own covariates, whitened."""
        return problem.white(bent_columns(problem, fit))


MECHANISMS = MechanismCatalogue()
