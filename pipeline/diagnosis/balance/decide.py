"""The verdict on a recording of a machine: what its force balance lacks, with the proof."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.borne_out import HeldBack, held_back, sure_part
from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue, Twins, find_twins
from pmg.pipeline.diagnosis.balance.contest import (
    MUCH_WORSE,
    BalanceData,
    Contest,
    ModelStep,
    carried_over,
    contest,
    model_steps,
    refine,
    settled,
)
from pmg.pipeline.diagnosis.balance.estimate import design_of, impossible_in
from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
from pmg.pipeline.diagnosis.balance.library.drive_faults import GAIN
from pmg.pipeline.diagnosis.balance.library.elastic import BACKLASH, LIKE_PLAY, SURE_FLIGHT
from pmg.pipeline.diagnosis.balance.low_passes import try_low_passes
from pmg.pipeline.diagnosis.balance.mismatch import find_together
from pmg.pipeline.diagnosis.balance.proof import (
    FurtherDecoys,
    set_against,
    surrogate_decoys,
    try_decoys,
    withheld_samples,
)
from pmg.pipeline.diagnosis.balance.records.zero import ZERO
from pmg.pipeline.diagnosis.balance.search_record import search_record
from pmg.pipeline.diagnosis.engine.adequacy import adequacy_test
from pmg.pipeline.diagnosis.engine.catalogue import ENTRY
from pmg.pipeline.diagnosis.engine.conclusion import Conclusion, conclude
from pmg.pipeline.diagnosis.engine.decoys import offer_decoys
from pmg.pipeline.diagnosis.engine.verdict import Absorbed, Verdict
from pmg.pipeline.diagnosis.engine.withheld import withhold

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.catalogue import TermNaming
    from pmg.pipeline.diagnosis.balance.estimate import Estimate
    from pmg.pipeline.diagnosis.balance.free_run import FreeRun
    from pmg.pipeline.diagnosis.balance.low_passes import LowPassTried
    from pmg.pipeline.diagnosis.balance.mismatch import Place
    from pmg.pipeline.diagnosis.balance.noise_model import NoiseModel
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.diagnosis.balance.search_record import Searched
    from pmg.pipeline.diagnosis.engine.decoys import Decoys
    from pmg.pipeline.diagnosis.engine.held_out import HeldOut
    from pmg.pipeline.diagnosis.engine.mismatch import Mismatch


@dataclass(frozen=True, kw_only=True)
class TermsDiagnosis(Conclusion[TermFit, TermProblem]):
    """Mismatch, terms and verdict.

    Parameters
    ----------
    case : Case
        The case.
    recorded, withheld : Recorded
        Its recordings; None without a withheld one.
    noise : NoiseModel
        Noise that it was judged against.
    mismatch : Mismatch
        Test and places.
    steps : tuple of ModelStep
        Baseline, then one named term after the other.
    refinements : tuple of ModelStep
        Terms that lower the error on withheld blocks, but given those named may be no more than an error
        of their form.
    dropped : tuple of ModelStep
        Refinements that make the error on the withheld record larger, or values impossible.
    impossible : tuple of Estimate
        Parameters of the named model that no machine has, as a negative mass; where there are any, nothing is named.
    twins : tuple of Twins
        What the design of the recording cannot tell apart.
    further_decoys : FurtherDecoys
        Terms without a meaning, offered to what the named ones leave.
    contests : tuple of Contest
        Sets of terms that came near the named one, each set against it with the refinements in.
    left_over : Mismatch
        What named terms and refinements leave.
    free_runs : tuple of FreeRun
        Each record simulated from its force alone, where that was asked: by the published parameters where there are
        any, and by the models.
    low_passes : tuple of LowPassTried
        What the search says with other low-passes, where that was asked.
    held_back : HeldBack or None
        Why a cause that was found is not named, where it stood the proof.
    left_out : tuple of TermFit
        Terms that the search found and the verdict does without: all together they failed the proof, or depended on the
        low-pass, and a quarter of the record, another low-pass or a rival does not need them.
    """

    case: Case
    recorded: Recorded
    withheld: Recorded | None
    noise: NoiseModel
    mismatch: Mismatch[Place]
    steps: tuple[ModelStep, ...]
    refinements: tuple[ModelStep, ...]
    dropped: tuple[ModelStep, ...]
    impossible: tuple[Estimate, ...]
    twins: tuple[Twins, ...]
    further_decoys: FurtherDecoys
    contests: tuple[Contest, ...]
    left_over: Mismatch[Place]
    free_runs: tuple[FreeRun, ...] = ()
    low_passes: tuple[LowPassTried, ...] = ()
    held_back: HeldBack | None = None
    left_out: tuple[TermFit, ...] = ()

    @property
    def last_word(self) -> str:
        """What is said of the terms of the last step: whether they are named or were no more than tried."""
        return "named" if self.verdict.names else "tried"


def diagnose_terms(
    case: Case,
    recorded: Recorded,
    withheld: Recorded | None,
    rng: np.random.Generator,
    low_passes: tuple[LowPassTried, ...] = (),
) -> TermsDiagnosis:
    """Test for a mismatch, search the library for the terms that make it, prove them on what they have not seen.

    Parameters
    ----------
    case : Case
        Baseline and library.
    recorded, withheld : Recorded
        The recording for choice and fit, and one that takes part in neither but to drop refinements, and to hold back a
        cause, which make its error larger (None without one).
    rng : numpy.random.Generator
        Draws synthetic records, resamples, decoys.
    low_passes : tuple of LowPassTried
        What the search says with half the low-pass and with twice, where that was asked.

    Notes
    -----
    A load that crosses a gap comes late, so that a delay may lead where it takes up more of a force than a flight does
    that nobody can foretell. Where it is held back for that, or no proof bears out what leads, the library is asked
    without what play may be taken for, and without a flight that can be foretold. Backlash is then named where it
    stands the proof and predicts withheld blocks as well as what led, rows without the noise that a flight gives them.
    """
    first = _diagnosed(case, recorded, withheld, rng, low_passes)
    if first.verdict is not Verdict.NOT_IN_LIBRARY or first.naming is None or first.impossible or recorded.coasts:
        return first
    led = first.naming.best.fits
    like_play = [fit for fit in led if fit.identifier in LIKE_PLAY or fit.candidate.key == SURE_FLIGHT]
    if not like_play or first.held_back not in (None, HeldBack.LIKE_PLAY, HeldBack.UNEVEN_DELAY):
        return first
    rest = (term for term in case.library if term.identifier not in LIKE_PLAY and term.key != SURE_FLIGHT)
    other = replace(case, library=tuple(rest))
    again = _diagnosed(other, recorded, withheld, rng, try_low_passes(other, rng) if low_passes else ())
    named = again.steps[-1].fitted.fits
    if again.verdict is not Verdict.NAMED or BACKLASH not in {fit.identifier for fit in named}:
        return first
    free = first.steps[0].fitted.baseline
    both = set_against(recorded, first.noise.noise, free, (led, named), rng)
    left_out = tuple(fit for fit in like_play if fit.identifier != BACKLASH)
    return replace(again, case=case, left_out=left_out) if both.rmse_after <= both.rmse_before else first


def _diagnosed(
    case: Case,
    recorded: Recorded,
    withheld: Recorded | None,
    rng: np.random.Generator,
    low_passes: tuple[LowPassTried, ...],
) -> TermsDiagnosis:
    """The same with one library."""
    whole = part = search_record(case, recorded, rng)
    of_whole = of_part = _judged(whole, withheld, rng, low_passes)
    while of_part.verdict is Verdict.NOT_IN_LIBRARY:
        proof = of_part.held_out
        if proof is None or of_part.impossible or of_part.held_back in (HeldBack.LIKE_PLAY, HeldBack.UNEVEN_DELAY):
            return of_whole
        smaller = sure_part(part, proof.in_every_part, case, low_passes)
        if smaller is None:
            return of_whole
        part, of_part = smaller, _judged(smaller, withheld, rng, low_passes)
    kept = {fit.identifier for fit in part.named}
    return replace(of_part, left_out=tuple(fit for fit in whole.named if fit.identifier not in kept))


def _judged(
    s: Searched, withheld: Recorded | None, rng: np.random.Generator, low_passes: tuple[LowPassTried, ...]
) -> TermsDiagnosis:
    """The verdict on what a search found, with its proof."""
    case, recorded, withheld = s.case, s.recorded, None if withheld is None else s.alike(withheld)
    noise, found, named = s.noise.noise, s.found, s.named
    apart = rng.spawn(1)[0]
    further = FurtherDecoys(0, 0, 0.0, ()) if found is None else _further_decoys(s, found, recorded, withheld, rng)
    decoys = None if found is None else _decoys(s, found, recorded, apart)
    data = BalanceData(recorded, withheld, s.noise, s.free)
    steps = model_steps(data, named, rng)
    held: HeldOut | None = None
    refinements: tuple[ModelStep, ...] = ()
    dropped: tuple[ModelStep, ...] = ()
    contests: tuple[Contest, ...] = ()
    verdict = Verdict.CONSISTENT if found is None else Verdict.NOT_IN_LIBRARY
    if found is not None and named:
        plain = np.hstack([design_of(recorded, s.free, ()), s.apart])
        rows = withheld_samples(recorded, s.problem, noise, plain)
        held = withhold(rows, TermCatalogue(refine=False), named, rng, apart)
        conclusion = conclude(s.problem, TermCatalogue(), found, lambda _: held)
        if conclusion.verdict.names and conclusion.naming is not None:
            found, remainder_of = conclusion.naming, adequacy_test(s.evidence)
            start = replace(found.best, problem=settled(s.for_refinements, found.best.fits))
            threshold, before = max(ENTRY, further.most_evidence), steps[-1].fitted
            refinements, dropped = refine(data, start, before, remainder_of, threshold, rng)
            contests = contest(data, s.problem, found, refinements, remainder_of, rng)
            verdict = Verdict.AMBIGUOUS if any(c.open for c in contests) else Verdict.NAMED
    impossible = impossible_in(steps[-1].fitted)
    back: HeldBack | None = None
    if verdict is Verdict.NAMED and not impossible:
        back = held_back(s, case, low_passes, steps[-1].fitted, worse=_worse_withheld(data, steps, rng))
    if impossible or back is not None:
        verdict = Verdict.NOT_IN_LIBRARY
    last = (refinements or steps)[-1].fitted.fits
    return TermsDiagnosis(
        verdict=verdict,
        naming=found,
        held_out=held,
        absorbed=_absorbed(steps),
        decoys=decoys,
        case=case,
        recorded=recorded,
        withheld=withheld,
        noise=s.noise,
        mismatch=find_together(s.noise, s.evidence.null, *s.tested) if s.hum and not verdict.names else s.mismatch,
        steps=steps,
        refinements=refinements,
        dropped=dropped,
        impossible=impossible,
        twins=_twins_told(s, case, recorded, contests),
        further_decoys=further,
        contests=contests,
        left_over=find_together(s.noise, s.evidence.null, *((settled(each, last), of) for each, of in s.tested)),
        low_passes=low_passes,
        held_back=back,
    )


def _worse_withheld(data: BalanceData, steps: tuple[ModelStep, ...], rng: np.random.Generator) -> bool:
    """Whether the last model makes the error on the withheld record larger, by much and with certainty."""
    first, last = steps[0], steps[-1]
    surely = carried_over(data, first.fitted, last.fitted, rng)[1] < 0.0
    return surely and last.error_withheld > MUCH_WORSE * first.error_withheld


def _further_decoys(
    s: Searched, found: TermNaming, recorded: Recorded, withheld: Recorded | None, rng: np.random.Generator
) -> FurtherDecoys:
    """Terms without a meaning, offered to what the leading set leaves."""
    design = design_of(recorded, s.free, s.named)
    other = None if withheld is None else (withheld, design_of(withheld, s.free, s.named))
    return try_decoys(found.best.problem, s.noise.noise, design, recorded, other, rng)


def _decoys(s: Searched, found: TermNaming, recorded: Recorded, rng: np.random.Generator) -> Decoys | None:
    """Decoys: waves of random phase, which stand for no cause, offered together with the library."""
    return offer_decoys(s.problem, found, surrogate_decoys(s.problem, recorded, s.noise.noise, rng))


def _twins_told(s: Searched, case: Case, recorded: Recorded, contests: tuple[Contest, ...]) -> tuple[Twins, ...]:
    """Terms with the same column, and the gain of a drive of which nothing is known.

    The zero is left out where recordings at rest show it and no set names it.
    """
    sets = (s.named, *(each.rival.fits for each in contests if each.open))
    in_sets = {fit.identifier for fits in sets for fit in fits}
    twins = [each for each in find_twins(s.problem) if not case.zero or ZERO not in each.ids or ZERO in in_sets]
    if not recorded.coasts and GAIN in {t.identifier for t in case.library} and GAIN not in s.problem.tables:
        twins.insert(0, Twins((GAIN,), 1.0))
    return tuple(twins)


def _absorbed(steps: tuple[ModelStep, ...]) -> tuple[Absorbed, ...]:
    """Baseline parameters alone and given the named terms."""
    first, last = steps[0].fitted, steps[-1].fitted
    return tuple(
        Absorbed(f"{before.term} {before.name}", before.value, after.value, after.standard_error)
        for before, after in zip(first.estimates, last.estimates, strict=False)
        if (before.term, before.name) == (after.term, after.name)
    )
