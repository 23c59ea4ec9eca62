"""The verdict on a campaign of runs in motion: what the force balance of its rotors lacks, with the proof."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from pmg.pipeline.diagnosis.balance.catalogue import TermNaming
from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
from pmg.pipeline.diagnosis.engine.conclusion import Conclusion, borne_out, conclude, left_open
from pmg.pipeline.diagnosis.engine.verdict import Absorbed, Verdict
from pmg.pipeline.diagnosis.engine.withheld import STEADY, withhold
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.candidates.like_filter import scatter_beside
from pmg.pipeline.diagnosis.motion.catalogue import MotionCatalogue, columns_beside
from pmg.pipeline.diagnosis.motion.design.next_runs import run_to_confirm, runs_to_see, runs_to_tell
from pmg.pipeline.diagnosis.motion.design.unseen import unseen
from pmg.pipeline.diagnosis.motion.evidence import motion_evidence
from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.diagnosis.motion.fitted_size import error_of_law, fitted_size
from pmg.pipeline.diagnosis.motion.mismatch import find_mismatch
from pmg.pipeline.diagnosis.motion.naming import SEARCH_STEPS, name_causes
from pmg.pipeline.diagnosis.motion.withheld import WithheldRuns, by_kind, by_run
from pmg.pipeline.files.progress import Steps
from pmg.pipeline.fit.span import pseudo_inverse

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pmg.pipeline.diagnosis.engine.explanation import Explanation
    from pmg.pipeline.diagnosis.engine.held_out import HeldOut
    from pmg.pipeline.diagnosis.engine.mismatch import Mismatch
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.design.next_runs import NextRun
    from pmg.pipeline.diagnosis.motion.design.unseen import Unseen
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.pipeline.diagnosis.motion.fitted_size import FittedSize
    from pmg.pipeline.diagnosis.motion.mismatch import MotionPlace
    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.motion.run import MovingRun
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array


STEPS = (
    "constants of the bench",
    "search for a difference",
    *SEARCH_STEPS,
    "proof on runs not used",
)
"""Steps of a diagnosis, as its progress names them."""


@dataclass(frozen=True, kw_only=True)
class MotionDiagnosis(Conclusion[TermFit, TermProblem]):
    """Mismatch, mechanisms and verdict of a campaign of runs in motion.

    Parameters
    ----------
    campaign : str
        Its name.
    evidence : MotionEvidence
        Rows and baseline; with what was named in it.
    mismatch : Mismatch
        Test and places.
    before : MotionBaseline
        The baseline alone.
    constants, errors : (k,) array
        Constants of the baseline beside what was named, and their standard errors.
    sizes, size_errors : tuple of (p,) array
        Parameters of each named mechanism, amplitudes then shape, and their standard errors.
    fitted_sizes : tuple of FittedSize
        The size of each as one number.
    unseen : tuple of Unseen
        Mechanisms that the runs excite too little to tell.
    next_runs : tuple of NextRun
        Of an ambiguous campaign, what tells each rival from the leading cause, in order, and a shaft that is open; of
        a confounded one, what shows each mechanism that it cannot see.
    confirming : NextRun or None
        Of a named cause, the run that shows most of it; none where no run would, where its shaft is open, or where it
        is a constant that is off.
    """

    campaign: str
    evidence: MotionEvidence
    mismatch: Mismatch[MotionPlace]
    before: MotionBaseline
    constants: Array
    errors: Array
    sizes: tuple[Array, ...]
    size_errors: tuple[Array, ...]
    fitted_sizes: tuple[FittedSize, ...]
    unseen: tuple[Unseen, ...]
    next_runs: tuple[NextRun, ...] = ()
    confirming: NextRun | None = None


def diagnose_motion(
    campaign: str,
    runs: tuple[MovingRun, ...],
    bench: BenchParameters,
    rng: np.random.Generator,
    progress: Progress | None = None,
    known: Mapping[str, tuple[float, float]] | None = None,
) -> MotionDiagnosis:
    """Test for a mismatch, search the library for what makes it, prove it on kinds of run that took no part.

    Parameters
    ----------
    campaign : str
        Name of the campaign.
    runs : tuple of MovingRun
        Its runs.
    bench : BenchParameters
        The bench, as its data sheet has it.
    rng : numpy.random.Generator
        Draws synthetic campaigns, resamples.
    progress : Progress, optional
        Receives each step as it begins.
    known : mapping of str to (float, float), optional
        Constants that are known from other runs, each with its standard error.
    """
    steps = Steps(progress, *STEPS)
    steps.begin(STEPS[0])
    before, covariance, noise = fit_constants(runs, bench, known)
    steps.begin(STEPS[1])
    found = motion_evidence(before, noise, library(), rng)
    mismatch, blind = find_mismatch(found), unseen(found)
    silent = Verdict.CONFOUNDED if blind else Verdict.CONSISTENT
    conclusion, together = Conclusion[TermFit, TermProblem](verdict=silent), None
    if mismatch.found:
        found, meant, naming = name_causes(found, before, noise, rng, steps)
        steps.begin(STEPS[4])
        if blind:  # what it cannot show may be what is left
            naming = replace(naming, in_the_main=False)
        conclusion = conclude(found.problem, MotionCatalogue(), naming, _proof(meant, naming, rng))
        if blind and conclusion.verdict is Verdict.NOT_IN_LIBRARY:
            conclusion = replace(conclusion, verdict=Verdict.CONFOUNDED)
        named = conclusion.naming.best.fits if conclusion.verdict.names and conclusion.naming is not None else ()
        together = _together(found, named)
    alone = before.values, np.sqrt(np.diag(covariance)), (), (), ()
    constants, errors, sizes, size_errors, fitted_sizes = together or alone
    next_runs: tuple[NextRun, ...] = ()
    confirming = None
    if conclusion.verdict is Verdict.CONFOUNDED:
        next_runs = runs_to_see(found, blind, noise[0].slow_noise)
    elif conclusion.verdict is Verdict.AMBIGUOUS or "either" in _shafts(conclusion):
        next_runs = runs_to_tell(found, cast("TermNaming", conclusion.naming), noise[0].slow_noise)
    elif conclusion.verdict is Verdict.NAMED:
        confirming = run_to_confirm(found, cast("TermNaming", conclusion.naming).best.fits, noise[0].slow_noise)
    return MotionDiagnosis(
        verdict=conclusion.verdict,
        naming=conclusion.naming,
        held_out=conclusion.held_out,
        weak=conclusion.weak,
        absorbed=_absorbed(before, constants, errors) if mismatch.found else (),
        campaign=campaign,
        evidence=found,
        mismatch=mismatch,
        before=before,
        constants=constants,
        errors=errors,
        sizes=sizes,
        size_errors=size_errors,
        fitted_sizes=fitted_sizes,
        unseen=blind,
        next_runs=next_runs,
        confirming=confirming,
    )


def _shafts(conclusion: Conclusion[TermFit, TermProblem]) -> tuple[str, ...]:
    """Shafts of what is named, as far as they are told; none without a cause."""
    naming = conclusion.naming
    return tuple(naming.shafts.values()) if conclusion.verdict.names and naming is not None else ()


def _proof(
    found: MotionEvidence, naming: TermNaming, rng: np.random.Generator
) -> Callable[[Explanation[TermFit, TermProblem]], HeldOut | None]:
    """Errors of a set of mechanisms on withheld kinds of run, or where those cannot tell, on withheld runs.

    What one kind of run alone shows, as friction right after a reversal, no other kind can predict; a set may be borne
    out by runs nevertheless, or left open, where every part of them names it. Else it is what kinds of run leave open,
    or runs of which most name it where it explains all. None where there is too little to withhold.
    """

    def proves(held: HeldOut, best: Explanation[TermFit, TermProblem]) -> bool:
        if naming.explained:
            return held.predicts and held.shows(best.gain)
        return borne_out(MotionCatalogue(), naming, held)

    def most_leave_open(of_runs: HeldOut, best: Explanation[TermFit, TermProblem]) -> bool:
        explains = naming.explained and naming.in_the_main and not naming.weak
        most_agree = of_runs.tells and of_runs.kept >= STEADY and not proves(of_runs, best)
        return explains and most_agree and left_open(naming, of_runs)

    def prove(best: Explanation[TermFit, TermProblem]) -> HeldOut | None:
        def held(rows: WithheldRuns) -> HeldOut | None:
            if len(np.unique(rows.fold[rows.fold < rows.folds])) < 2:
                return None
            return withhold(rows, MotionCatalogue(refine=False), best.fits, rng, bent=best.bent > 0.0)

        scatter = scatter_beside(found, best)
        of_kinds = held(by_kind(found, best.fits, scatter))
        if of_kinds is not None and (not naming.may_be_named or proves(of_kinds, best)):
            return of_kinds
        of_runs = held(by_run(found, best.fits, scatter))
        if of_runs is None:
            return of_kinds
        of_runs = replace(of_runs, of_a_kind=True)
        sure = of_runs.kept == 1.0
        if of_kinds is None or (sure and (proves(of_runs, best) or left_open(naming, of_runs))):
            return of_runs
        runs_serve = not left_open(naming, of_kinds) and (sure or most_leave_open(of_runs, best))
        return of_runs if runs_serve else of_kinds

    return prove


def _together(
    found: MotionEvidence, fits: tuple[TermFit, ...]
) -> tuple[Array, Array, tuple[Array, ...], tuple[Array, ...], tuple[FittedSize, ...]]:
    """Constants and parameters fitted together about those of the evidence, each with its standard errors.

    What is known of a mechanism is not fitted: its error is zero.
    """
    slopes = [found.problem.slopes(fit) for fit in fits]
    free = [fit.candidate.free_parameters for fit in fits]
    own = (s * f for s, f in zip(slopes, free, strict=True))
    columns = np.hstack([columns_beside(found, fits), *own, found.granted])
    effect = sum((s[:, : len(f.amplitudes)] @ f.amplitudes for s, f in zip(slopes, fits, strict=True)), 0.0 * found.y)
    inverse = pseudo_inverse(columns)
    moved = inverse @ (found.y - effect)
    covariance = found.covariance_of(inverse)
    errors = np.sqrt(np.diag(covariance))
    ends = np.cumsum([found.columns.shape[1], *(s.shape[1] for s in slopes)])
    values = [np.r_[fit.amplitudes, [fit.shape] if fit.candidate.shape is not None else []] for fit in fits]
    sizes = [v + f * m for v, f, m in zip(values, free, np.split(moved, ends)[1:], strict=False)]
    of_fits = [covariance[a:b, a:b] for a, b in itertools.pairwise(ends)]
    wholes = tuple(
        fitted_size(
            fit,
            value,
            of_fit,
            found.baseline.sheet.poles,
            error_of_law(found.problem, fits, place),
        )
        for place, (fit, value, of_fit) in enumerate(zip(fits, sizes, of_fits, strict=True))
    )
    return (
        found.baseline.values + moved[: ends[0]],
        errors[: ends[0]],
        tuple(sizes),
        tuple(f * error for f, error in zip(free, np.split(errors, ends)[1:], strict=False)),
        wholes,
    )


def _absorbed(before: MotionBaseline, constants: Array, errors: Array) -> tuple[Absorbed, ...]:
    """Constants alone and beside what was named."""
    rows = zip(before.sheet.constants, before.values, constants, errors, strict=True)
    return tuple(
        Absorbed(c.name, float(alone), float(beside), float(error) if error > 0.0 else None)
        for c, alone, beside, error in rows
        if not c.name.startswith("pole_angle")
    )
