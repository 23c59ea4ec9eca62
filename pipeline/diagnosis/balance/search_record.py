"""The search of a record: is there a mismatch, and which terms of the library explain it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue
from pmg.pipeline.diagnosis.balance.estimate import design_of, for_search
from pmg.pipeline.diagnosis.balance.fitting import tabulate, term_problem
from pmg.pipeline.diagnosis.balance.known_terms import SetTerm, beside_known
from pmg.pipeline.diagnosis.balance.library.columns import RIPPLE, SECOND_RIPPLE
from pmg.pipeline.diagnosis.balance.library.drive_faults import GAIN
from pmg.pipeline.diagnosis.balance.library.term import RECORDING
from pmg.pipeline.diagnosis.balance.mismatch import DRAWS, find_mismatch, record_evidence
from pmg.pipeline.diagnosis.balance.noise_model import noise_of
from pmg.pipeline.diagnosis.balance.records.hum import hum_beside
from pmg.pipeline.diagnosis.balance.records.recorded import modelled_by
from pmg.pipeline.diagnosis.balance.records.reversals import reversals
from pmg.pipeline.diagnosis.balance.records.zero import ZERO
from pmg.pipeline.diagnosis.balance.structure import families_of
from pmg.pipeline.diagnosis.engine.adequacy import adequacy_test
from pmg.pipeline.diagnosis.engine.held_out import solve
from pmg.pipeline.diagnosis.engine.naming import name_candidates
from pmg.pipeline.fit.span import freed

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.catalogue import TermNaming
    from pmg.pipeline.diagnosis.balance.fitting import Tabled, TermFit, TermProblem
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

SEARCHES, AGAIN = 3, 3
"""Searches at most, and repeated fits of the baseline together with a fault that changes its force."""


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

    The moments of reversal are free in `problem` and not in `for_refinements`; `apart` (n, k) are their columns and
    those of a `hum`, if the record differs by more than the hum. `shows_hum` is the problem without its columns. If the
    hum is all that differs, `p_beside_hum` is the p-value of everything else. In `recorded`, the baseline was fitted
    together with the terms `fitted`, and rows have the noise these add.
    """

    case: Case
    recorded: Recorded
    fitted: tuple[SetTerm, ...]
    free: tuple[Term[Motion], ...]
    noise: NoiseModel
    looked: tuple[ResidualStructure, ...]
    evidence: Evidence
    problem: TermProblem
    for_refinements: TermProblem
    shows_hum: TermProblem
    hum: tuple[ResidualStructure, ...]
    apart: Array
    mismatch: Mismatch[Place]
    found: TermNaming | None
    named: tuple[TermFit, ...]
    p_beside_hum: float | None = None

    @property
    def tested(self) -> tuple[tuple[TermProblem, tuple[ResidualStructure, ...]], ...]:
        """Problems with the families to test: first the hum alone, then everything else with the hum removed."""
        of_hum = ((self.shows_hum, self.hum),) if self.hum else ()
        return (*of_hum, (self.problem, self.looked))

    def alike(self, withheld: Recorded) -> Recorded:
        """Withheld recordings with what the rest of the model gives, and with noise of rows, as here."""
        if any(each.term.of_model for each in self.fitted):
            withheld = _modelled(withheld, self.case, self.free, self.recorded.baseline, self.fitted)
        return _less_sure(withheld, (*self.case.known, *self.fitted))


def search_record(case: Case, recorded: Recorded, rng: np.random.Generator) -> Searched:
    """The mismatch test and the search of the library; a hum is removed first if the record differs by more than it."""
    given = _less_sure(recorded, case.known)
    free, searched = case.free_terms, _searched_terms(case, recorded)
    looked, coarse = families_of(given, case.axis), tabulate(given, searched, coarse=True)
    asked = _Inquiry(free, searched, coarse, reversals(given, case.axis.rises), looked)
    fitted, columns = for_search(given, free, ())
    structured = _structured(np.hstack([columns, asked.turned]), looked, coarse)
    if hum := hum_beside(fitted, structured, case.prepare.low_pass_hz):
        beside = _search(case, given, replace(asked, hum=hum), rng)
        if beside.mismatch.found:
            return beside
        return replace(_search(case, given, replace(asked, line=hum), rng), p_beside_hum=beside.mismatch.p_value)
    return _search(case, given, asked, rng)


@dataclass(frozen=True)
class _Inquiry:
    """What a record is asked for: free terms, terms that may be named and their coarse tables, families.

    `turned` (n, k) are the columns of the moments of reversal; a hum is free beside them, or a `line` among families.
    """

    free: tuple[Term[Motion], ...]
    searched: tuple[Term[Motion], ...]
    coarse: dict[str, Tabled]
    turned: Array
    looked: tuple[ResidualStructure, ...]
    hum: tuple[ResidualStructure, ...] = ()
    line: tuple[ResidualStructure, ...] = ()

    @property
    def apart(self) -> Array:
        """Columns (n, k) beside those of the free terms."""
        return np.hstack([self.turned, *self.waves])

    @property
    def waves(self) -> list[Array]:
        """Columns of a hum that is free."""
        return [family.columns for family in self.hum]


def _search(case: Case, whole: Recorded, asked: _Inquiry, rng: np.random.Generator) -> Searched:
    """The mismatch test and the search of the library; again with noise freed from what was named.

    What was named may move what the rest gives, or give rows noise of their own (`_beside`). A mismatch that was seen
    without such noise stands, whatever is seen with it; and a set of other terms of that kind is searched once more.
    """
    given, free, looked, coarse = whole, asked.free, (*asked.looked, *asked.line), asked.coarse
    recorded, columns = for_search(given, free, ())
    plain = np.hstack([columns, asked.apart])
    structured = _structured(plain, looked, coarse)
    tables, found = coarse, None
    named: tuple[TermFit, ...] = ()
    fitted: tuple[SetTerm, ...] = ()
    for turn in range(SEARCHES):
        if _of_kind(fit.candidate for fit in named) or fitted:
            given, fitted = _beside(whole, case, free, named)
            faults = tuple(term for term in asked.searched if term.of_model)
            looked = (*families_of(given, case.axis), *asked.line)
            tables, coarse = tables | tabulate(given, faults), coarse | tabulate(given, faults, coarse=True)
            structured = _structured(plain, looked, coarse)
        if named:
            structured = np.hstack([structured, design_of(given, (), named)])
            recorded, _ = for_search(given, free, named)
        noise = noise_of(recorded.force, structured, recorded.breaks[1:], recorded.own_noise)
        null = noise.whitened_draws(DRAWS, rng)
        problem = _with_second(term_problem(recorded, tables, noise.noise, plain), case)
        evidence = record_evidence(noise, problem, looked, null)
        seen = find_mismatch(evidence, looked)
        if turn == 0 or seen.found or not fitted:
            mismatch = seen
        if not mismatch.found:
            found, named = None, ()
            break
        if turn == 0:
            tables = tabulate(recorded, asked.searched)
            problem = _with_second(term_problem(recorded, tables, noise.noise, plain), case)
        found = name_candidates(problem, TermCatalogue(), adequacy_test(evidence))
        before, named = {fit.identifier for fit in named}, found.best.fits
        as_fitted = _of_kind(fit.candidate for fit in named) == _of_kind(each.term for each in fitted)
        if as_fitted and (turn > 0 or found.best.ids == before):
            break
    refined = _about(problem, noise, recorded, np.hstack([columns, *asked.waves]))
    with_hum = np.hstack([columns, asked.turned])
    shows_hum = _about(problem, noise, recorded, with_hum) if asked.hum else problem
    about = (looked, evidence, problem, refined, shows_hum, asked.hum, asked.apart)
    return Searched(case, given, fitted, free, noise, *about, mismatch, found, named)


def _about(problem: TermProblem, noise: NoiseModel, recorded: Recorded, columns: Array) -> TermProblem:
    """The problem about a baseline of other columns (n, k)."""
    basis, left = freed(noise.noise.whiten(columns), noise.noise.whiten(recorded.force[:, None])[:, 0])
    return replace(problem, baseline=basis, left=left)


def _structured(plain: Array, looked: tuple[ResidualStructure, ...], coarse: Mapping[str, Tabled]) -> Array:
    """Columns that are no noise (n, k): free ones, families, and terms of one form that change smoothly."""
    smooth = (table for table in coarse.values() if not table.term.variant and not table.term.sharp)
    allowed = [table.columns.reshape(len(plain), -1) for table in smooth]
    return np.hstack([plain, *(family.columns for family in looked), *allowed])


def _of_kind(terms: Iterable[Term[Motion]]) -> set[str]:
    """Keys of the terms that distort what the rest gives, or whose force nobody can foretell."""
    return {term.key for term in terms if term.of_model or term.outcomes is not None}


def _beside(
    recorded: Recorded, case: Case, free: tuple[Term[Motion], ...], named: tuple[TermFit, ...]
) -> tuple[Recorded, tuple[SetTerm, ...]]:
    """Recordings with the baseline fitted together with named terms, and these terms with the amplitudes of that fit.

    A fault of a drive takes its part of the force, which moves the amplitudes of the baseline, and the moments at which
    their sum changes sign. Where the force of a term cannot be foretold, the scatter of its possible values is added
    to the noise of each row. Unchanged, and no terms, where none is of either kind.
    """
    terms = tuple(SetTerm(fit.candidate, fit.amplitudes, fit.shape) for fit in named)
    if not _of_kind(fit.candidate for fit in named):
        return recorded, ()
    for _ in range(AGAIN if any(fit.candidate.of_model for fit in named) else 0):
        found = solve(design_of(recorded, free, named), recorded.force)
        ends = np.cumsum([sum(len(term.amplitudes) for term in free), *(len(fit.amplitudes) for fit in named)])
        amplitudes, *of_named = np.split(found, ends[:-1])
        terms = tuple(replace(each, amplitudes=own) for each, own in zip(terms, of_named, strict=True))
        recorded = _modelled(recorded, case, free, amplitudes, terms)
    return _less_sure(recorded, terms), terms


def _modelled(
    recorded: Recorded, case: Case, free: tuple[Term[Motion], ...], amplitudes: Array, terms: tuple[SetTerm, ...]
) -> Recorded:
    """Recordings with what the baseline gives by its amplitudes (k,), and terms beside it that are no faults."""
    motion = recorded.motion
    columns = np.hstack([term.columns(motion, math.nan) for term in free])
    further = sum((each.of(motion) for each in terms if not each.term.of_model), np.zeros(len(motion.time)))
    return modelled_by(recorded, case, columns, amplitudes, further)


def _less_sure(recorded: Recorded, terms: tuple[SetTerm, ...]) -> Recorded:
    """Recordings whose rows have, as noise of their own, the scatter of what terms may do of which nobody knows it."""
    for each in terms:
        if each.term.outcomes is not None:
            scatter = recorded.thin(each.term.outcomes(recorded.motion, each.shape)).std(axis=1)
            own = np.hypot(recorded.noise_of_rows(0.0), each.amplitudes[0] * scatter)
            recorded = replace(recorded, own_noise=own)
    return recorded
