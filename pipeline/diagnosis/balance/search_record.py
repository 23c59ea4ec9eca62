"""The search of a record: is there a mismatch, and which terms of the library explain it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue
from pmg.pipeline.diagnosis.balance.estimate import design_of, for_search
from pmg.pipeline.diagnosis.balance.fitting import tabulate, term_problem
from pmg.pipeline.diagnosis.balance.known_terms import beside_known
from pmg.pipeline.diagnosis.balance.library.columns import RIPPLE, SECOND_RIPPLE
from pmg.pipeline.diagnosis.balance.library.drive_faults import GAIN
from pmg.pipeline.diagnosis.balance.library.term import RECORDING
from pmg.pipeline.diagnosis.balance.mismatch import DRAWS, find_mismatch, record_evidence
from pmg.pipeline.diagnosis.balance.noise_model import noise_of
from pmg.pipeline.diagnosis.balance.records.recorded import modelled_by
from pmg.pipeline.diagnosis.balance.records.reversals import reversals
from pmg.pipeline.diagnosis.balance.records.zero import ZERO
from pmg.pipeline.diagnosis.balance.structure import families_of
from pmg.pipeline.diagnosis.engine.adequacy import adequacy_test
from pmg.pipeline.diagnosis.engine.held_out import solve
from pmg.pipeline.diagnosis.engine.naming import name_candidates
from pmg.pipeline.fit.span import freed

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.catalogue import TermNaming
    from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term
    from pmg.pipeline.diagnosis.balance.mismatch import Place
    from pmg.pipeline.diagnosis.balance.noise_model import NoiseModel
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.diagnosis.engine.evidence import Evidence
    from pmg.pipeline.diagnosis.engine.mismatch import Mismatch
    from pmg.pipeline.fit.structure import ResidualStructure
    from pmg.sim.signals import Array

OPEN_ERRORS = 4.0
"""Standard errors of a zero seen at rest by which it may be off, so that another term is no sure cause of as much."""

AGAIN = 3
"""Times that the baseline is fitted anew beside faults that distort it."""


def _free_terms(case: Case) -> tuple[Term[Motion], ...]:
    """Terms of the baseline whose amplitudes are free."""
    return tuple(t for name in case.baseline for t in case.library if t.key == name and name not in case.fixed)


def _shows_gain(case: Case) -> bool:
    """Whether a size is known that does not grow with the gain of the drive: neither its zero, nor a fault of it."""
    sure = (each for each in case.known if not each.term.of_model and each.term.identifier != ZERO)
    return any(case.fixed.values()) or any(np.any(each.amplitudes) for each in sure)


def _searched_terms(case: Case, recorded: Recorded) -> tuple[Term[Motion], ...]:
    """Terms that may be named; one whose amplitudes are taken as known may be off by what their bounds allow.

    Of a machine that coasts, none that goes with its acceleration, or with the force that is zero; none that needs a
    channel which was not recorded; no zero where each recording has its own, and of one that recordings at rest show no
    more than its error leaves open; of a machine that moves one way only, none that goes with direction as a plainer
    term does; and no gain of the drive where nothing is known, as every free amplitude grows with it.
    """
    channels, coasts = recorded.motion.besides, recorded.coasts
    unsure = {each.term.key: OPEN_ERRORS * each.error for each in case.known if each.error > 0.0}
    ways = recorded.motion.direction
    one_way = not (ways > 0.0).any() or not (ways < 0.0).any()
    known = {key: (value,) for key, value in case.fixed.items()}
    known |= {each.term.key: tuple(each.amplitudes) for each in case.known}
    terms = []
    for term in case.library:
        if coasts and (term.needs_drive or term.of_model):
            continue
        if (one_way and term.both_ways) or term.identifier == SECOND_RIPPLE:
            continue
        if term.identifier == GAIN and not _shows_gain(case):
            continue
        if not set(term.needs) <= set(channels) or (case.own_zeros and term.identifier == ZERO):
            continue
        if (most := unsure.get(term.key)) is not None:
            (size,) = term.amplitudes
            term = replace(term, amplitudes=(replace(size, bounds=(-most, most)),))
        if term.of_angle and RECORDING in channels:
            term = term.in_each(len(recorded.motion.starts))
        sizes = known.get(term.key)
        if sizes is not None and not term.whole:
            terms.append(beside_known(term, sizes))
        elif term.identifier not in case.baseline:
            terms.append(term)
    return tuple(terms)


def _with_second(problem: TermProblem, case: Case) -> TermProblem:
    """The problem with a second wave over position, whose columns are those of the first."""
    first = problem.tables.get(RIPPLE)
    second = next((term for term in case.library if term.identifier == SECOND_RIPPLE), None)
    if first is None or second is None:
        return problem
    second = replace(second, amplitudes=first.term.amplitudes)
    return replace(problem, tables={**problem.tables, second.key: replace(first, term=second)})


@dataclass(frozen=True)
class Searched:
    """A record searched: its noise, families and evidence about the free terms of the baseline, and what was found.

    The moments of reversal are free in `problem` and not in `for_refinements`; `turned` (n, k) are their columns.
    Faults distort what `recorded` says that the rest gives, as it was fitted beside `fitted`.
    """

    case: Case
    recorded: Recorded
    fitted: tuple[TermFit, ...]
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

    def alike(self, withheld: Recorded) -> Recorded:
        """Withheld recordings with what the rest of the model gives as it does here."""
        modelled = _modelled(withheld, self.case, self.free, self.recorded.baseline, self.fitted)
        return _less_sure(modelled, self.fitted)


def search_record(case: Case, recorded: Recorded, rng: np.random.Generator) -> Searched:
    """The mismatch test and the search of the library; twice, the second time with noise freed from what was named."""
    looked, free = families_of(recorded, case.axis), _free_terms(case)
    searched = _searched_terms(case, recorded)
    tables = tabulate(recorded, searched, coarse=True)
    turned = reversals(recorded, case.axis.rises)
    named: tuple[TermFit, ...] = ()
    given = recorded
    recorded, columns = for_search(given, free, named)
    plain = np.hstack([columns, turned])
    smooth = (table for table in tables.values() if not table.term.variant and not table.term.sharp)
    allowed = [table.columns.reshape(len(plain), -1) for table in smooth]
    structured = np.hstack([plain, *(f.columns for f in looked), *allowed])
    found: TermNaming | None = None
    fitted: tuple[TermFit, ...] = ()
    for turn in range(2):
        if any(fit.candidate.of_model or fit.candidate.outcomes for fit in named):
            given, fitted = _fitted_beside(given, case, free, named)
            looked = families_of(given, case.axis)
            tables |= tabulate(given, tuple(term for term in searched if term.of_model))
        if named:
            recorded, _ = for_search(given, free, named)
        noise = noise_of(recorded.force, structured, recorded.breaks[1:], recorded.own_noise)
        null = noise.whitened_draws(DRAWS, rng)
        problem = _with_second(term_problem(recorded, tables, noise.noise, plain), case)
        evidence = record_evidence(noise, problem, looked, null)
        mismatch = find_mismatch(evidence, looked)
        if not mismatch.found:
            found, named = None, ()
            break
        if turn == 0:
            tables = tabulate(recorded, searched)
            problem = _with_second(term_problem(recorded, tables, noise.noise, plain), case)
        found = name_candidates(problem, TermCatalogue(), adequacy_test(evidence))
        before, named = {fit.identifier for fit in named}, found.best.fits
        if found.best.ids == before:
            break
        structured = np.hstack([structured, design_of(recorded, (), named)]) if named else structured
    basis, left = freed(noise.noise.whiten(columns), noise.noise.whiten(recorded.force[:, None])[:, 0])
    for_refinements = replace(problem, baseline=basis, left=left)
    return Searched(
        case, given, fitted, free, noise, looked, evidence, problem, for_refinements, turned, mismatch, found, named
    )


def _fitted_beside(
    recorded: Recorded, case: Case, free: tuple[Term[Motion], ...], named: tuple[TermFit, ...]
) -> tuple[Recorded, tuple[TermFit, ...]]:
    """Recordings with what the rest gives where it was fitted beside the terms that were named, and these so fitted.

    A fault of a drive or of a reading takes its part of the force, which moves the amplitudes of the baseline, and the
    moments at which their sum changes its sign. Where nobody knows what a term does, rows get less weight.
    """
    fitted = named
    for _ in range(AGAIN):
        found = solve(design_of(recorded, free, named), recorded.force)
        ends = np.cumsum([sum(len(term.amplitudes) for term in free), *(len(fit.amplitudes) for fit in named)])
        amplitudes, *of_named = np.split(found, ends[:-1])
        fitted = tuple(replace(fit, amplitudes=own) for fit, own in zip(named, of_named, strict=True))
        recorded = _modelled(recorded, case, free, amplitudes, fitted)
    return _less_sure(recorded, fitted), fitted


def _modelled(
    recorded: Recorded, case: Case, free: tuple[Term[Motion], ...], amplitudes: Array, fitted: tuple[TermFit, ...]
) -> Recorded:
    """Recordings with what the baseline gives by its amplitudes (k,), and terms beside it that are no faults."""
    motion = recorded.motion
    columns = np.hstack([term.columns(motion, math.nan) for term in free])
    beside = (fit for fit in fitted if not fit.candidate.of_model)
    further = sum((f.candidate.columns(motion, f.shape) @ f.amplitudes for f in beside), np.zeros(len(motion.time)))
    return modelled_by(recorded, case, columns, amplitudes, further)


def _less_sure(recorded: Recorded, fitted: tuple[TermFit, ...]) -> Recorded:
    """Recordings whose rows have the scatter of what terms that were found may do there, as noise of their own."""
    for fit in fitted:
        if fit.candidate.outcomes is not None:
            scatter = recorded.thin(fit.candidate.outcomes(recorded.motion, fit.shape)).std(axis=1)
            recorded = replace(recorded, own_noise=np.hypot(recorded.noise_of_rows(0.0), fit.amplitudes[0] * scatter))
    return recorded
