"""Models one after the other, refinements that only help, and rivals set against the named terms."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue, find_twins
from pmg.pipeline.diagnosis.balance.estimate import Estimate, FittedTerms, fit_together, impossible_in
from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
from pmg.pipeline.diagnosis.balance.library.term import RECORDING
from pmg.pipeline.diagnosis.balance.proof import held_out, set_against
from pmg.pipeline.diagnosis.engine.explanation import explain_with
from pmg.pipeline.diagnosis.engine.found_set import margin_beside
from pmg.pipeline.fit.span import freed

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.catalogue import TermNaming, TermSet
    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term
    from pmg.pipeline.diagnosis.balance.noise_model import NoiseModel
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.diagnosis.engine.adequacy import AdequacyTest
    from pmg.pipeline.diagnosis.engine.held_out import HeldOut

MOST_REFINED = 6
"""Further terms that are looked at once the named ones are in."""

SHARE_OF_REFINEMENT = 0.2
"""Part of what is left that a refinement must explain."""

ALIKE = 0.9
"""Part of the gain of a named set that a set with a twin must bring to be its rival."""

TRIED = 3
"""Leading terms of a round that are tried as refinement."""

MUCH_WORSE = 1.1
"""Error on the withheld record with a term, over that without, from which on it is much worse."""


@dataclass(frozen=True)
class ModelStep:
    """A model of the force and what it is worth.

    Parameters
    ----------
    added : str
        Id of the term that it has beyond the one before; empty for the baseline.
    fitted : FittedTerms
        Baseline and terms so far, fitted together.
    error_fit, error_withheld : float
        Relative force error on the recording it was fitted to and on the withheld one (NaN without one).
    held : HeldOut or None
        Withheld blocks of the first recording without and with the added term.
    evidence : float
        Evidence that the added term brought.
    carried : tuple of float
        95 % interval of the fall of the error on the withheld record by the added term [N, N m]; NaN without one.
    """

    added: str
    fitted: FittedTerms
    error_fit: float
    error_withheld: float
    held: HeldOut | None
    evidence: float
    carried: tuple[float, float]


@dataclass(frozen=True)
class Contest:
    """A rival set of terms against the named one, both with the refinements in.

    Parameters
    ----------
    rival : TermSet
        The other set.
    lead : float
        Evidence by which the named set is ahead.
    margin : float
        Evidence by which it must be: `MARGIN`, and what both leave beyond the noise.
    held : HeldOut
        Withheld blocks with the rival and with the named set.
    given_named : tuple of Estimate
        What the rival's own terms come to given the named set.
    error_fit, error_withheld : float
        Relative force errors of the rival set without refinements.
    alike : bool
        Whether the design of the recording gives both the same columns: what speaks for one is an error of form.
    """

    rival: TermSet
    lead: float
    margin: float
    held: HeldOut
    given_named: tuple[Estimate, ...]
    error_fit: float
    error_withheld: float
    alike: bool

    @property
    def open(self) -> bool:
        """Whether the recording cannot tell the two apart: by design, by evidence, or on withheld blocks."""
        return self.alike or self.lead <= self.margin or self.held.gain_interval[0] <= 0.0


@dataclass(frozen=True)
class BalanceData:
    """Data that models are fitted to and judged on."""

    recorded: Recorded
    withheld: Recorded | None
    noise: NoiseModel
    free: tuple[Term[Motion], ...]


def model_steps(data: BalanceData, fits: tuple[TermFit, ...], rng: np.random.Generator) -> tuple[ModelStep, ...]:
    """The baseline, then one term after the other."""
    steps = [_model_step(data, (), None, rng)]
    for k in range(len(fits)):
        steps.append(_model_step(data, fits[: k + 1], steps[-1].fitted, rng))
    return tuple(steps)


def _model_step(
    data: BalanceData, fits: tuple[TermFit, ...], before: FittedTerms | None, rng: np.random.Generator
) -> ModelStep:
    """Baseline and terms fitted together, and what the last of them is worth beside the model before."""
    fitted = fit_together(data.recorded, data.noise.noise, data.free, fits)
    samples = len(data.recorded.force) - data.noise.noise.lags
    return ModelStep(
        fits[-1].identifier if fits else "",
        fitted,
        fitted.relative_error(data.recorded),
        float("nan") if data.withheld is None else fitted.relative_error(data.withheld),
        set_against(data.recorded, data.noise.noise, data.free, (fits[:-1], fits), rng) if fits else None,
        fits[-1].gain - fits[-1].cost * math.log(samples) if fits else 0.0,
        (float("nan"), float("nan")) if before is None else carried_over(data, before, fitted, rng),
    )


def carried_over(
    data: BalanceData, before: FittedTerms, after: FittedTerms, rng: np.random.Generator
) -> tuple[float, float]:
    """95 % interval of the fall of the error on the withheld record [N, N m].

    NaN without one, and where a wave over an angle that nobody recorded is among the terms: its phase there is unknown.
    """
    withheld, waves = data.withheld, any(fit.candidate.of_angle for fit in after.fits)
    if withheld is None or (waves and RECORDING in withheld.motion.besides):
        return float("nan"), float("nan")
    truth = withheld.force + withheld.known
    errors = truth - before.predict(withheld), truth - after.predict(withheld)
    return held_out("", errors, data.noise.noise, withheld, rng).gain_interval


def refine(
    data: BalanceData,
    best: TermSet,
    before: FittedTerms,
    remainder_of: AdequacyTest,
    threshold: float,
    rng: np.random.Generator,
) -> tuple[tuple[ModelStep, ...], tuple[ModelStep, ...]]:
    """Further terms, one after the other: more than any decoy, a good part of the rest, better on withheld blocks.

    Then those that would have been, and make the error on the withheld record larger, with certainty or by a tenth, or
    values of the named model impossible: they are dropped. `before` is the model of the best set.
    """
    current, refined, dropped = best, list[ModelStep](), dict[str, ModelStep]()
    while len(refined) < MOST_REFINED:
        rest = remainder_of(current.problem)
        if rest.adequate:
            break
        least = max(threshold, SHARE_OF_REFINEMENT * rest.excess)
        here = current.problem
        ranked = TermCatalogue().rank(here, current.ids)
        fits = [fit for fit in ranked if not fit.on_bound and here.score(fit) > least]
        for fit in fits[:TRIED]:
            step = _model_step(data, (*current.fits, fit), before, rng)
            if step.held is None or step.held.gain_interval[0] <= 0.0:
                continue
            if step.carried[1] < 0.0 or _hurts(data, before, step) or impossible_in(step.fitted):
                dropped[step.added] = step
            else:
                dropped.pop(step.added, None)
                current, before = current.plus(fit), step.fitted
                refined.append(step)
                break
        else:
            break
    return tuple(refined), tuple(dropped.values())


def _hurts(data: BalanceData, before: FittedTerms, step: ModelStep) -> bool:
    """Whether a step makes the error on the withheld record larger by a tenth, rows that count little among them."""
    if data.withheld is None or math.isnan(step.carried[1]):
        return False
    return step.error_withheld > MUCH_WORSE * before.relative_error(data.withheld)


def settled(problem: TermProblem, fits: tuple[TermFit, ...]) -> TermProblem:
    """The problem with the columns of some terms free besides, their shapes kept."""
    columns = [problem.baseline, *(problem.columns_of(fit.candidate, fit.shape) for fit in fits)]
    basis, left = freed(np.hstack(columns), problem.left)
    return replace(problem, baseline=basis, left=left)


def _twin_sets(problem: TermProblem, best: TermSet) -> list[TermSet]:
    """Sets with a twin in the place of a named term, where it explains as much."""
    pairs = [twins.ids for twins in find_twins(problem) if len(twins.ids) > 1]
    terms = {table.term.key: table.term for table in problem.tables.values()}
    found = []
    for place, fit in enumerate(best.fits):
        for pair in (pair for pair in pairs if fit.candidate.key in pair):
            other = next(name for name in pair if name != fit.candidate.key)
            candidates = [one.candidate for one in best.fits]
            candidates[place] = terms[other]
            rival = explain_with(problem, TermCatalogue(), candidates)
            if other not in best.ids and rival.fits[place].admissible and rival.gain > ALIKE * best.gain:
                found.append(rival)
    return found


def contest(
    data: BalanceData,
    problem: TermProblem,
    found: TermNaming,
    refinements: tuple[ModelStep, ...],
    remainder_of: AdequacyTest,
    rng: np.random.Generator,
) -> tuple[Contest, ...]:
    """Every rival, and every set with a twin in the place of a named term, against the named set.

    Both have the refinements in.
    """
    alike = _twin_sets(problem, found.best)
    same = {rival.ids for rival in alike}
    extra = refinements[-1].fitted.fits[len(found.best.fits) :] if refinements else ()

    mine = settled(problem, (*found.best.fits, *extra))
    margin = margin_beside(remainder_of(mine))
    contests = []
    for rival in (*alike, *(rival for rival in found.rivals if rival.ids not in same)):
        added = tuple(fit for fit in extra if fit.identifier not in rival.ids)
        other = settled(problem, (*rival.fits, *added))
        cost = sum(f.cost for f in (*rival.fits, *added)) - sum(f.cost for f in (*found.best.fits, *extra))
        lead = float(other.left @ other.left - mine.left @ mine.left) + cost * math.log(len(mine.left))
        pair = (*rival.fits, *added), (*found.best.fits, *extra)
        held = set_against(data.recorded, data.noise.noise, data.free, pair, rng)
        new = tuple(fit for fit in rival.fits if fit.identifier not in found.best.ids)
        both = fit_together(data.recorded, data.noise.noise, data.free, (*found.best.fits, *new))
        alone = fit_together(data.recorded, data.noise.noise, data.free, rival.fits)
        contests.append(
            Contest(
                rival,
                lead,
                margin,
                held,
                tuple(e for e in both.estimates if e.term in {fit.identifier for fit in new}),
                alone.relative_error(data.recorded),
                float("nan") if data.withheld is None else alone.relative_error(data.withheld),
                rival.ids in same,
            )
        )
    return tuple(contests)
