"""The verdict on a recording of a machine: what its force balance lacks, with the proof."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnose.balance.catalogue import TermCatalogue, Twins, find_twins
from pmg.pipeline.diagnose.balance.contest import Contest, Scene, Stand, contest, refine, settled, stand_of
from pmg.pipeline.diagnose.balance.estimate import design_of
from pmg.pipeline.diagnose.balance.fitting import tabulate, term_problem
from pmg.pipeline.diagnose.balance.mismatch import DRAWS, find_mismatch, noise_of, record_evidence
from pmg.pipeline.diagnose.balance.proof import Decoys, try_decoys, withhold
from pmg.pipeline.diagnose.balance.structure import families_of
from pmg.pipeline.diagnose.engine.adequacy import adequacy_test
from pmg.pipeline.diagnose.engine.catalogue import ENTRY
from pmg.pipeline.diagnose.engine.naming import name_candidates
from pmg.pipeline.diagnose.grid.decide import WITHHELD_SHARE
from pmg.pipeline.diagnose.grid.diagnosis import Absorbed, Verdict

if TYPE_CHECKING:
    from pmg.pipeline.diagnose.balance.case_file import Case
    from pmg.pipeline.diagnose.balance.catalogue import TermNaming
    from pmg.pipeline.diagnose.balance.fitting import TermFit
    from pmg.pipeline.diagnose.balance.mismatch import NoiseModel, Place
    from pmg.pipeline.diagnose.balance.recorded import Recorded
    from pmg.pipeline.diagnose.balance.term import Term
    from pmg.pipeline.diagnose.engine.mismatch import Mismatch
    from pmg.pipeline.diagnose.grid.holdout import HeldOut


@dataclass(frozen=True)
class TermsDiagnosis:
    """Mismatch, terms and verdict.

    Parameters
    ----------
    case : Case
        The case.
    recorded, withheld : Recorded
        Its recordings; None without a withheld one.
    verdict : Verdict
        One of the words of the bench's diagnosis.
    noise : NoiseModel
        Noise that it was judged against.
    mismatch : Mismatch
        Test and places.
    found : Naming or None
        What the library says; None without a mismatch.
    held : HeldOut or None
        Withheld blocks, the choice made anew for each.
    stands : tuple of Stand
        Baseline, then one named term after the other.
    refinements : tuple of Stand
        Terms that lower the error on withheld blocks, but are too small beside those named to be told from an error
        of their form.
    twins : tuple of Twins
        What the design of the recording cannot tell apart.
    absorbed : tuple of Absorbed
        Baseline parameters before and after.
    decoys : Decoys
        Terms without a meaning, put to the same test.
    contests : tuple of Contest
        Sets of terms that came near the named one, each set against it with the refinements in.
    left_over : Mismatch
        What named terms and refinements leave.
    """

    case: Case
    recorded: Recorded
    withheld: Recorded | None
    verdict: Verdict
    noise: NoiseModel
    mismatch: Mismatch[Place]
    found: TermNaming | None
    held: HeldOut | None
    stands: tuple[Stand, ...]
    refinements: tuple[Stand, ...]
    twins: tuple[Twins, ...]
    absorbed: tuple[Absorbed, ...]
    decoys: Decoys
    contests: tuple[Contest, ...]
    left_over: Mismatch[Place]


def free_terms(case: Case) -> tuple[Term, ...]:
    """Terms of the baseline whose amplitudes are free."""
    return tuple(t for name in case.baseline for t in case.library if t.identifier == name and name not in case.fixed)


def searched_terms(case: Case) -> tuple[Term, ...]:
    """Terms that may be named; one whose amplitude is taken as known may be off by what its bounds allow."""
    terms = []
    for term in case.library:
        known = case.fixed.get(term.identifier)
        if known is not None:
            (quantity,) = term.amplitudes
            low, high = quantity.bounds
            terms.append(replace(term, amplitudes=(replace(quantity, bounds=(low - known, high - known)),)))
        elif term.identifier not in case.baseline:
            terms.append(term)
    return tuple(terms)


def diagnose_terms(
    case: Case, recorded: Recorded, withheld: Recorded | None, rng: np.random.Generator
) -> TermsDiagnosis:
    """Test for a mismatch, search the library for the terms that make it, prove them on what they have not seen.

    Parameters
    ----------
    case : Case
        Baseline and library.
    recorded, withheld : Recorded
        The recording for choice and fit, and one that takes part in neither (None without one).
    rng : numpy.random.Generator
        Draws synthetic records, resamples, decoys.
    """
    looked = families_of(recorded)
    free = free_terms(case)
    searched = searched_terms(case)
    tables = tabulate(recorded, searched, coarse=True)
    plain = design_of(recorded, free, ())
    allowed = [table.columns.reshape(len(plain), -1) for table in tables.values()]
    structured = np.hstack([plain, *(f.columns for f in looked), *allowed])
    found: TermNaming | None = None
    named: tuple[TermFit, ...] = ()
    for turn in range(2):
        noise = noise_of(recorded.force, structured, rng)
        null = noise.whitened_draws(len(recorded.force), DRAWS, rng)
        problem = term_problem(recorded, tables, noise.noise, plain)
        evidence = record_evidence(noise, problem, looked, null)
        mismatch = find_mismatch(evidence, looked)
        if not mismatch.found:
            found, named = None, ()
            break
        if turn == 0:
            tables = tabulate(recorded, searched)
            problem = term_problem(recorded, tables, noise.noise, plain)
        remainder_of = adequacy_test(evidence)
        found = name_candidates(problem, TermCatalogue(), remainder_of)
        if found.best.ids == {fit.identifier for fit in named}:
            break
        named = found.best.fits
        structured = np.hstack([structured, design_of(recorded, (), named)]) if named else structured
    final = found.best.problem if found is not None else problem
    design = design_of(recorded, free, named)
    other = None if withheld is None else (withheld, design_of(withheld, free, named))
    decoys = Decoys(0, 0, 0.0, ())
    if found is not None:
        decoys = try_decoys(final, noise.noise, design, recorded, other, rng)
    scene = Scene(recorded, withheld, noise, free)
    stands = tuple(stand_of(scene, named[:k], rng) for k in range(len(named) + 1))
    held: HeldOut | None = None
    refinements: tuple[Stand, ...] = ()
    contests: tuple[Contest, ...] = ()
    verdict = Verdict.CONSISTENT
    if found is not None:
        verdict = Verdict.NOT_IN_LIBRARY
        held = withhold(recorded, problem, noise.noise, free, named, rng) if named else None
        if found.explained and held is not None and _predicts(held):
            refinements = refine(scene, found.best, remainder_of, max(ENTRY, decoys.most_evidence), rng)
            contests = contest(scene, problem, found, refinements, remainder_of, rng)
            verdict = Verdict.AMBIGUOUS if any(c.open for c in contests) else Verdict.NAMED
    last = settled(problem, (refinements or stands)[-1].fitted.fits)
    return TermsDiagnosis(
        case,
        recorded,
        withheld,
        verdict,
        noise,
        mismatch,
        found,
        held,
        stands,
        refinements,
        find_twins(problem),
        _absorbed(stands),
        decoys,
        contests,
        find_mismatch(record_evidence(noise, last, looked, null), looked),
    )


def _predicts(held: HeldOut) -> bool:
    """Whether the named terms predict most of the mismatch of withheld blocks."""
    before = held.rmse_before**2 - held.noise_floor**2
    after = held.rmse_after**2 - held.noise_floor**2
    return held.rmse_after < held.rmse_before and after <= (1.0 - WITHHELD_SHARE) * before


def _absorbed(stands: tuple[Stand, ...]) -> tuple[Absorbed, ...]:
    """Baseline parameters alone and beside the named terms."""
    first, last = stands[0].fitted, stands[-1].fitted
    return tuple(
        Absorbed(f"{before.term} {before.name}", before.value, after.value, after.standard_error)
        for before, after in zip(first.estimates, last.estimates, strict=False)
        if (before.term, before.name) == (after.term, after.name)
    )
