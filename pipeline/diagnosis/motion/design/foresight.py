"""What further runs would add to the evidence of a campaign."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from scipy import stats

from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.separation import power_to_separate, squares_beyond
from pmg.pipeline.diagnosis.motion.catalogue import MotionCatalogue, form_margin
from pmg.pipeline.diagnosis.motion.design.proposed_run import with_runs
from pmg.pipeline.diagnosis.motion.design.unseen import TOLD, smallest_told, worth_knowing
from pmg.pipeline.diagnosis.motion.noise.row_noise import row_noise
from pmg.pipeline.diagnosis.motion.view import views_of

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
    from pmg.pipeline.diagnosis.balance.library.term import Term
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.design.proposals import Proposal
    from pmg.pipeline.diagnosis.motion.design.unseen import Unseen
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise, SlowNoise
    from pmg.pipeline.diagnosis.motion.view import RotorView
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class Foresight:
    """Evidence of a campaign, and rows of runs that were not made yet.

    Parameters
    ----------
    found : MotionEvidence
        Of the campaign.
    proposal : Proposal
        The runs; as often as they are made, so often their rows count.
    slow_noise : SlowNoise
        Wander and ripple that the campaign showed.
    """

    found: MotionEvidence
    proposal: Proposal
    slow_noise: SlowNoise

    @cached_property
    def _made(self) -> tuple[list[RotorView], list[RowNoise], Array]:
        """Views and noise of the new stretches, and the columns of their constants."""
        whole, first = with_runs(self.found.baseline, self.proposal.runs)
        places = range(first, len(whole.stretches))
        noise = [row_noise(whole, place, self.slow_noise) for place in places]
        rows = [self._unit * each.white(whole.columns(place)) for each, place in zip(noise, places, strict=True)]
        return views_of(whole)[first:], noise, np.vstack([np.zeros((0, len(whole.sheet))), *rows])

    @property
    def _unit(self) -> float:
        return float(np.sqrt(self.proposal.times)) / self.found.scatter

    @cached_property
    def columns(self) -> Array:
        """Of the constants, the campaign's rows and then the new ones (m + n, k)."""
        known, new = self.found.columns, self._made[2]
        return np.vstack([np.pad(known, ((0, 0), (0, new.shape[1] - known.shape[1]))), new])

    def rows_of(self, term: MotionTerm, shape: float) -> Array:
        """New rows (n, a) of a term."""
        views, noise, _ = self._made
        rows = [np.zeros((0, len(term.amplitudes)))]
        for view, each in zip(views, noise, strict=True):
            rows.append(self._unit * each.white(term.rows_on(view, shape)))
        return np.vstack(rows)

    @cached_property
    def _problem(self) -> TermProblem:
        """The problem of the campaign whose columns go on over the new rows."""
        known = self.found.problem

        def columns_of(term: Term[Any], shape: float) -> Array:
            return np.vstack([known.columns_of(term, shape), self.rows_of(cast("MotionTerm", term), shape)])

        return replace(known, columns_of=columns_of)

    def _effect(self, fit: TermFit) -> Array:
        """Rows (m + n,) of a fitted mechanism."""
        return np.asarray(self._problem.columns_of(fit.candidate, fit.shape) @ fit.amplitudes)

    def power_between(self, one: tuple[TermFit, ...], other: tuple[TermFit, ...]) -> float:
        """Probability that the true one of two sets would then be named alone, whichever it is."""
        sets = (one, other)
        effects = [np.sum([self._effect(fit) for fit in fits], axis=0) for fits in sets]
        powers = []
        for k in (0, 1):
            beside = np.hstack([self.columns, *(self._problem.slopes(fit) for fit in sets[1 - k])])
            apart = squares_beyond((effects[k] - effects[1 - k])[:, None], beside)[0]
            whole = squares_beyond(effects[k][:, None], self.columns)[0]
            powers.append(power_to_separate(float(apart), MARGIN + form_margin(*sets) * float(whole)))
            powers.append(power_to_separate(float(whole), MotionCatalogue().weak_below(sets[k])))
        return min(powers)

    def evidence_for(self, fits: tuple[TermFit, ...]) -> float:
        """Evidence that the new rows alone would give of a set that is there, constants fitted anew."""
        effect = np.sum([self._effect(fit) for fit in fits], axis=0)
        effect[: len(self.found.columns)] = 0.0
        return float(squares_beyond(effect[:, None], self.columns)[0])

    def power_to_show(self, spot: Unseen) -> float:
        """Probability that a mechanism which the campaign cannot see stands out, at the size that is worth knowing."""
        tabled = self.found.problem.tables[spot.term.key]
        new = np.stack([self.rows_of(spot.term, float(shape)) for shape in tabled.shapes], axis=1)
        whole = np.concatenate([tabled.columns, new])
        m, g, a = whole.shape
        left = np.sqrt(squares_beyond(whole.reshape(m, g * a), self.columns)).reshape(g, a)
        smallest = smallest_told(self.found.scatter * left, tabled)
        return float(stats.norm.cdf(TOLD * (worth_knowing(spot.term) / smallest - 1.0)))
