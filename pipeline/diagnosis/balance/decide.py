"""The verdict on a recording of a machine: what its force balance lacks, with the proof."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue, Twins, find_twins
from pmg.pipeline.diagnosis.balance.contest import BalanceData, Contest, ModelStep, contest, model_step, refine, settled
from pmg.pipeline.diagnosis.balance.estimate import design_of, for_search, impossible_in, reversals
from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem, tabulate, term_problem
from pmg.pipeline.diagnosis.balance.free_run import free_run, of_fit, of_published
from pmg.pipeline.diagnosis.balance.library.term import RECORDING
from pmg.pipeline.diagnosis.balance.mismatch import DRAWS, find_mismatch, record_evidence
from pmg.pipeline.diagnosis.balance.noise_model import noise_of
from pmg.pipeline.diagnosis.balance.proof import FurtherDecoys, surrogate_decoys, try_decoys, withheld_samples
from pmg.pipeline.diagnosis.balance.structure import families_of
from pmg.pipeline.diagnosis.engine.adequacy import ORDINARY, adequacy_test
from pmg.pipeline.diagnosis.engine.catalogue import ENTRY
from pmg.pipeline.diagnosis.engine.conclusion import Conclusion, conclude
from pmg.pipeline.diagnosis.engine.decoys import offer_decoys
from pmg.pipeline.diagnosis.engine.naming import name_candidates
from pmg.pipeline.diagnosis.engine.problem import freed
from pmg.pipeline.diagnosis.engine.verdict import Absorbed, Verdict
from pmg.pipeline.diagnosis.engine.withheld import withhold

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.catalogue import TermNaming
    from pmg.pipeline.diagnosis.balance.estimate import Estimate
    from pmg.pipeline.diagnosis.balance.free_run import FreeRun
    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term
    from pmg.pipeline.diagnosis.balance.mismatch import Place
    from pmg.pipeline.diagnosis.balance.noise_model import NoiseModel
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.diagnosis.engine.evidence import Evidence
    from pmg.pipeline.diagnosis.engine.held_out import HeldOut
    from pmg.pipeline.diagnosis.engine.mismatch import Mismatch
    from pmg.pipeline.fit.structure import ResidualStructure
    from pmg.sim.signals import Array


IN_THE_MAIN = 0.15
"""Part of the gain of a set that may be left where every part of the record names that set."""

UNPREDICTED = 0.25
"""Part of the mismatch of withheld samples that such a set need not predict where no structure is seen in what it
leaves: near standstill a few samples hold most of a friction, and there its form is least known."""


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
        Refinements that make the error on the withheld record larger.
    impossible : tuple of Estimate
        Parameters of the last model that no machine has, as a negative mass; where there are any, nothing is named.
    twins : tuple of Twins
        What the design of the recording cannot tell apart.
    further_decoys : FurtherDecoys
        Terms without a meaning, offered to what the named ones leave.
    contests : tuple of Contest
        Sets of terms that came near the named one, each set against it with the refinements in.
    left_over : Mismatch
        What named terms and refinements leave.
    free_runs : tuple of FreeRun
        Each record simulated from its force alone: by the published parameters where there are any, and by the models.
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
    free_runs: tuple[FreeRun, ...]


def _free_terms(case: Case) -> tuple[Term[Motion], ...]:
    """Terms of the baseline whose amplitudes are free."""
    return tuple(t for name in case.baseline for t in case.library if t.key == name and name not in case.fixed)


def _searched_terms(case: Case, recorded: Recorded) -> tuple[Term[Motion], ...]:
    """Terms that may be named; one whose amplitude is taken as known may be off by what its bounds allow.

    Of a machine that coasts, none that goes with its acceleration, or with the force that is zero; none that needs a
    channel which was not recorded; no zero where each recording has its own; of a machine that moves one way only,
    none that goes with direction as a plainer term does.
    """
    channels, coasts = recorded.motion.besides, recorded.coasts
    ways = recorded.motion.direction
    one_way = not (ways > 0.0).any() or not (ways < 0.0).any()
    terms = []
    for term in case.library:
        if coasts and (term.needs_drive or term.of_model):
            continue
        if one_way and term.both_ways:
            continue
        if not set(term.needs) <= set(channels) or (case.own_zeros and term.identifier == "constant_offset"):
            continue
        if term.of_angle and RECORDING in channels:
            term = term.in_each(len(recorded.motion.starts))
        known = case.fixed.get(term.key)
        if known is not None:
            (quantity,) = term.amplitudes
            low, high = quantity.bounds
            terms.append(replace(term, amplitudes=(replace(quantity, bounds=(low - known, high - known)),)))
        elif term.identifier not in case.baseline:
            terms.append(term)
    return tuple(terms)


@dataclass(frozen=True)
class _Searched:
    """A record searched: its noise, families and evidence about the free terms of the baseline, and what was found.

    The moments of reversal are free in `problem` and not in `for_refinements`; `turned` (n, k) are their columns.
    """

    free: tuple[Term[Motion], ...]
    noise: NoiseModel
    looked: tuple[ResidualStructure, ...]
    evidence: Evidence
    problem: TermProblem
    for_refinements: TermProblem
    turned: Array
    mismatch: Mismatch[Place]
    found: TermNaming | None
    named: tuple[TermFit, ...]


def _search(case: Case, recorded: Recorded, rng: np.random.Generator) -> _Searched:
    """The mismatch test and the search of the library; twice, the second time with noise freed from what was named."""
    looked, free = families_of(recorded, case.axis), _free_terms(case)
    searched = _searched_terms(case, recorded)
    tables = tabulate(recorded, searched, coarse=True)
    turned = reversals(recorded)
    recorded, columns = for_search(recorded, free)
    plain = np.hstack([columns, turned])
    smooth = (table for table in tables.values() if not table.term.variant and not table.term.sharp)
    allowed = [table.columns.reshape(len(plain), -1) for table in smooth]
    structured = np.hstack([plain, *(f.columns for f in looked), *allowed])
    found: TermNaming | None = None
    named: tuple[TermFit, ...] = ()
    for turn in range(2):
        noise = noise_of(recorded.force, structured, recorded.starts[1:])
        null = noise.whitened_draws(DRAWS, rng)
        problem = term_problem(recorded, tables, noise.noise, plain)
        evidence = record_evidence(noise, problem, looked, null)
        mismatch = find_mismatch(evidence, looked)
        if not mismatch.found:
            found, named = None, ()
            break
        if turn == 0:
            tables = tabulate(recorded, searched)
            problem = term_problem(recorded, tables, noise.noise, plain)
        found = name_candidates(problem, TermCatalogue(), adequacy_test(evidence))
        if found.best.ids == {fit.identifier for fit in named}:
            break
        named = found.best.fits
        structured = np.hstack([structured, design_of(recorded, (), named)]) if named else structured
    basis, left = freed(noise.noise.whiten(columns), noise.noise.whiten(recorded.force[:, None])[:, 0])
    for_refinements = replace(problem, baseline=basis, left=left)
    return _Searched(free, noise, looked, evidence, problem, for_refinements, turned, mismatch, found, named)


def diagnose_terms(
    case: Case, recorded: Recorded, withheld: Recorded | None, rng: np.random.Generator
) -> TermsDiagnosis:
    """Test for a mismatch, search the library for the terms that make it, prove them on what they have not seen.

    Parameters
    ----------
    case : Case
        Baseline and library.
    recorded, withheld : Recorded
        The recording for choice and fit, and one that takes part in neither but to drop refinements
        which make its error larger (None without one).
    rng : numpy.random.Generator
        Draws synthetic records, resamples, decoys.
    """
    s = _search(case, recorded, rng)
    noise, found, named = s.noise.noise, s.found, s.named
    further, decoys = FurtherDecoys(0, 0, 0.0, ()), None
    apart = rng.spawn(1)[0]
    if found is not None:
        design = design_of(recorded, s.free, named)
        other = None if withheld is None else (withheld, design_of(withheld, s.free, named))
        further = try_decoys(found.best.problem, noise, design, recorded, other, rng)
        decoys = offer_decoys(s.problem, found, surrogate_decoys(s.problem, recorded, noise, apart))
    data = BalanceData(recorded, withheld, s.noise, s.free)
    steps = tuple(model_step(data, named[:k], rng) for k in range(len(named) + 1))
    held: HeldOut | None = None
    refinements: tuple[ModelStep, ...] = ()
    dropped: tuple[ModelStep, ...] = ()
    contests: tuple[Contest, ...] = ()
    verdict = Verdict.CONSISTENT if found is None else Verdict.NOT_IN_LIBRARY
    if found is not None and named:
        plain = np.hstack([design_of(recorded, s.free, ()), s.turned])
        rows = withheld_samples(recorded, s.problem, noise, plain)
        held = withhold(rows, TermCatalogue(refine=False), named, rng, apart)
        conclusion = conclude(s.problem, TermCatalogue(), found, lambda _: held)
        in_the_main = _in_the_main(found, held)
        if (conclusion.verdict.names or in_the_main) and conclusion.naming is not None:
            found, remainder_of = conclusion.naming, adequacy_test(s.evidence)
            start = replace(found.best, problem=settled(s.for_refinements, found.best.fits))
            refinements, dropped = refine(data, start, remainder_of, max(ENTRY, further.most_evidence), rng)
            contests = contest(data, s.problem, found, refinements, remainder_of, rng)
            verdict = Verdict.AMBIGUOUS if any(c.open for c in contests) else Verdict.NAMED
    impossible = impossible_in((refinements or steps)[-1].fitted)
    if impossible:
        verdict = Verdict.NOT_IN_LIBRARY
    last = settled(s.problem, (refinements or steps)[-1].fitted.fits)
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
        mismatch=s.mismatch,
        steps=steps,
        refinements=refinements,
        dropped=dropped,
        impossible=impossible,
        twins=find_twins(s.problem),
        further_decoys=further,
        contests=contests,
        left_over=find_mismatch(record_evidence(s.noise, last, s.looked, s.evidence.null), s.looked),
        free_runs=_free_runs(data, case, steps, refinements),
    )


def _in_the_main(found: TermNaming, held: HeldOut) -> bool:
    """Whether a set is the cause though what it leaves is beyond the noise: its form differs by a small part.

    Every part of the record names it, and it predicts what it has not seen, or all but `UNPREDICTED` of that where no
    structure is seen in what it leaves; whether another set comes near is asked afterwards.
    """
    best, rest = found.best, found.remainder
    predicts = held.predicts or (rest.p_value >= ORDINARY and held.left <= UNPREDICTED)
    return best.needed and held.kept == 1.0 and predicts and rest.excess <= IN_THE_MAIN * best.gain


def _free_runs(
    data: BalanceData, case: Case, steps: tuple[ModelStep, ...], refinements: tuple[ModelStep, ...]
) -> tuple[FreeRun, ...]:
    """Each record by each model that differs from the one before; none of a machine between two torques."""
    if case.ratio is not None:
        return ()
    published = of_published(case)
    if RECORDING in data.recorded.motion.besides and any(each.term.of_angle for each in published):
        published = ()  # at an angle that nobody recorded
    models = {"published": published, "baseline": of_fit(steps[0].fitted, case)}
    if len(steps) > 1:
        models["named"] = of_fit(steps[-1].fitted, case)
    if refinements:
        models["refined"] = of_fit(refinements[-1].fitted, case)
    records = [one for whole in (data.recorded, data.withheld) if whole is not None for one in whole.each()]
    runs = [free_run(name, record, terms) for name, terms in models.items() for record in records]
    return tuple(run for run in runs if run is not None)


def _absorbed(steps: tuple[ModelStep, ...]) -> tuple[Absorbed, ...]:
    """Baseline parameters alone and given the named terms."""
    first, last = steps[0].fitted, steps[-1].fitted
    return tuple(
        Absorbed(f"{before.term} {before.name}", before.value, after.value, after.standard_error)
        for before, after in zip(first.estimates, last.estimates, strict=False)
        if (before.term, before.name) == (after.term, after.name)
    )
