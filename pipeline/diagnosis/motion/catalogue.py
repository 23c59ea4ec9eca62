"""The catalogue in motion: candidates beside the constants, margins for errors of form, look-alikes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from pmg.pipeline.diagnosis.balance.catalogue import IN_THE_MAIN, TermCatalogue, TermNaming, TermSet
from pmg.pipeline.diagnosis.balance.fitting import fit_term
from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.motion.candidates.late_terms import HELD, SHARP
from pmg.pipeline.diagnosis.motion.free_form import bent_columns

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    import numpy.typing as npt

    from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
    from pmg.pipeline.diagnosis.balance.library.term import Term
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.sim.signals import Array

WEAK, WEAK_OF_SHEET = 60.0, 25.0
"""Gains below which an effect of another kind may pass for the leading one: of any, and of a constant that is so many
times its variance off its data sheet."""

FORM_MARGIN = 0.02
"""Part of a cause's evidence by which another's may be less without being told from it: drag, damping and wander are
known to a form, and look-alikes as a gain and a crosstalk differ by as little."""

LATE_ALIKE = 0.1
"""The same of what comes late: a delay, a lag of any order and a torque that is held differ in how sharp a change is
left, of which the band of the rows shows little."""

LATE_NEAR = 0.6
"""Part of the leading one's gain from which another way to be late may explain more on rows that are straight about
it: on rows about a delay a lag of the same time explains three quarters, though it leaves less."""

ADDED = 4.0
"""Fall of the sum of squares [noise variances] that a further parameter brings by chance one time in twenty."""

OPPOSED = 3.0
"""Standard uncertainties of its data sheet by which the skew of a transducer may be negative beside a delay or lag of
the same transducer."""

LATE = frozenset(("transducer_bandwidth", "channel_delay"))
"""What makes a torque come late; of it, a set holds one."""

MAIN_LEAVES = 0.25
"""Part of the gain of a single mechanism that may be left where it may be the cause in the main. Play, a drag of the
gear and mixed lubrication of another form than in the catalogue left 0.08 to 0.19, what no mechanism is 1.4 or more."""

FURTHER_ENTRY = 40.0
"""Evidence with which a further mechanism enters where no structure is seen [noise variances]: beside a cause that was
alone the next one reached 10 at most in 15 campaigns, beside one of a pair 46 and 133."""

SMALL_REST = 0.01
"""Part of the torque that a constant moves which it may leave over, and pass for the error of its form."""


def form_margin(one: tuple[TermFit, ...], other: tuple[TermFit, ...]) -> float:
    """Part of the evidence by which a set must beat another; larger where both delay a torque, as those look alike."""
    late = all(any(cast("MotionTerm", fit.candidate).comes_late for fit in fits) for fits in (one, other))
    return LATE_ALIKE if late else FORM_MARGIN


@dataclass(frozen=True)
class MotionCatalogue(TermCatalogue):
    """The mechanisms that runs in motion may show; with `one_late`, a set holds one of those that come late."""

    one_late: bool = True
    tells_weak: ClassVar[bool] = True
    form_margin: ClassVar[float] = FORM_MARGIN
    further_entry: ClassVar[float] = FURTHER_ENTRY

    def rank(self, problem: TermProblem, without: Collection[str] = ()) -> list[TermFit]:
        """All terms but some, best score first; with a delay in the set no lag is tried, and with a lag no delay.

        What both transducers do alike leads a set or is none of it: beside a mass on a spring, told as an inertia, late
        angles of no size took up the rest in three of three campaigns.
        """
        late = LATE if self.one_late and not LATE.isdisjoint(without) else ()
        ranked = super().rank(problem, {*without, *late})
        return [fit for fit in ranked if not (without and _of_both_readings(fit))]

    def left_in_the_main(self, count: int) -> float:
        """A part of the gain that the mechanisms share: two together come near much that is neither."""
        return MAIN_LEAVES / max(count, 1)

    def left_by_named(self, count: int) -> float:
        """Less: what leaves more is told as what may be."""
        return IN_THE_MAIN / max(count, 1)

    def weak_below(self, leading: tuple[TermFit, ...]) -> float:
        """Gain below which an effect of another kind may pass: less where a constant is plainly off its data sheet."""
        of_sheet = all(cast("MotionTerm", fit.candidate).constants for fit in leading)
        return WEAK_OF_SHEET if of_sheet else WEAK

    def free_form(self, problem: TermProblem, fit: TermFit) -> Array:
        """Whitened columns (m, k) along which the law of a fit may bend smoothly by what it follows."""
        return bent_columns(problem, fit)


def _of_both_readings(fit: TermFit) -> bool:
    """Whether it is what both transducers do alike."""
    term = cast("MotionTerm", fit.candidate)
    return term.comes_late and len(term.sides) > 1


def with_late_look_alikes(naming: TermNaming, problem: TermProblem) -> TermNaming:
    """The answer where a torque comes late: another way to be late that explains nearly as much is a rival.

    Parameters
    ----------
    naming : TermNaming
        The answer of the search.
    problem : TermProblem
        Before anything was taken out.

    Notes
    -----
    The expansion of a short lag comes as near to a delay as to the lag; it is a rival of a delay where a lag is, of
    first or second order, and of a torque that is held, which is smoothed as by a lag. A law that leaves more
    than noise is not the true one, and every law that comes near it is a rival.
    """
    best = naming.best
    late = [place for place, fit in enumerate(best.fits) if cast("MotionTerm", fit.candidate).comes_late]
    if not naming.may_be_named or not late:
        return naming
    blurred = [cast("MotionTerm", best.fits[place].candidate).variant == HELD for place in late]
    kept = (rival for rival in naming.rivals if any(blurred) or not _between(rival, best))
    found, alike = {rival.ids: rival for rival in kept}, 0.0
    laws = [cast("MotionTerm", table.term) for table in problem.tables.values()]
    for place, blurs in zip(late, blurred, strict=True):
        fit, rest = best.fits[place], _without(best, place, problem)
        named = fit_term(rest.problem, fit.candidate)
        for law in sorted(laws, key=lambda law: law.between):
            if not law.comes_late or law.place != fit.place or law.identifier == fit.identifier:
                continue
            other = fit_term(rest.problem, law)
            rival = rest.plus(other)
            if not other.admissible or (law.between and not blurs and rival.ids not in found):
                continue
            apart = FORM_MARGIN if SHARP in (law.variant, fit.candidate.variant) else LATE_ALIKE
            apart = apart if naming.explained else 1.0 - LATE_NEAR
            as_much = other.gain > (1.0 - apart) * named.gain
            near = as_much or rival.score > best.score - MARGIN
            if near and (rival.ids not in found or rival.score > found[rival.ids].score):
                found[rival.ids] = rival
                alike = max(alike, apart * named.gain * as_much)
    by_evidence = sorted(found.values(), key=lambda rival: -rival.score)
    return replace(
        naming, rivals=tuple(by_evidence), evidence_scale=min(naming.evidence_scale, MARGIN / (MARGIN + alike))
    )


def other_lateness(best: TermSet, found: MotionEvidence) -> Iterator[tuple[TermFit, ...]]:
    """A leading set with a lag in the place of a delay, and the other way round, where that explains nearly as much.

    A lag of one order in the place of one of another order, too, where a skew off its data sheet is beside that, or the
    rows are about such a one.

    Parameters
    ----------
    best : TermSet
        The leading set.
    found : MotionEvidence
        About it.
    """
    problem, sheet, first = found.problem, found.baseline.sheet, int(np.argmax(found.of_sheet))
    laws = [cast("MotionTerm", table.term) for table in problem.tables.values()]
    for place, fit in enumerate(best.fits):
        if not fit.candidate.whole or not cast("MotionTerm", fit.candidate).comes_late:
            continue
        rest = _without(best, place, problem)
        others = [
            fit_term(rest.problem, law)
            for law in laws
            if law.comes_late and law.whole and not law.between
            if law.place == fit.place and law.key != fit.candidate.key
        ]
        named = fit_term(rest.problem, fit.candidate)
        least = LATE_NEAR * named.gain
        near = sorted((o for o in others if o.admissible and o.gain > least), key=lambda other: other.gain)
        rows = _rows_of_skews(found, fit.candidate)
        skews = np.r_[sheet.off(found.baseline.values)[rows - first], (rest.problem.left - named.seen)[rows]]
        opposed = bool(np.any(np.abs(skews) > OPPOSED))
        orders = opposed and cast("MotionTerm", fit.candidate).is_lag
        nearest = {o.identifier: o for o in near if orders or o.identifier != fit.identifier}
        for other in nearest.values():
            yield (*best.fits[:place], other, *best.fits[place + 1 :])


def _without(best: TermSet, place: int, problem: TermProblem) -> TermSet:
    """What is left of a set without one of its fits."""
    rest = TermSet((), problem)
    for other in (*best.fits[:place], *best.fits[place + 1 :]):
        rest = rest.plus(other)
    return rest


def _between(rival: TermSet, best: TermSet) -> bool:
    """Whether a rival has a law that lies between two mechanisms in the place of one of the leading set."""
    others = [fit for fit in rival.fits if fit.identifier not in best.ids]
    return len(rival.fits) == len(best.fits) and any(cast("MotionTerm", fit.candidate).between for fit in others)


def without_held(naming: TermNaming) -> TermNaming:
    """The answer without rivals that differ by a law that holds the leading one's, and of which no more is seen.

    A zero that drifts is one that is off, and moves; where it does not move, nothing speaks for it. What it costs more
    is less than the margin, though.
    """

    def laws(explanation: TermSet) -> dict[tuple[str, str], MotionTerm]:
        terms = (cast("MotionTerm", fit.candidate) for fit in explanation.fits)
        return {(term.identifier, term.place): term for term in terms}

    best = laws(naming.best)

    def held(rival: TermSet) -> bool:
        others = laws(rival)
        further = [term for key, term in others.items() if key not in best]
        holding = [{(name, term.place) for name in term.holds} & best.keys() for term in further]
        replaced = best.keys() - others.keys()
        whole = bool(holding) and all(holding) and set().union(*holding) >= replaced
        return whole and rival.gain - naming.best.gain <= ADDED

    return replace(naming, rivals=tuple(rival for rival in naming.rivals if not held(rival)))


def without_opposed(found: MotionEvidence) -> MotionEvidence:
    """The evidence without what comes late only while the skew of its reading leads by as much.

    A lag of the torque that the model predicts, with a skew of the torque as shown that undoes it, is the slope of
    what is left, its noise too: that something follows it says nothing of a lag.
    """
    tables = {key: each for key, each in found.problem.tables.items() if not _opposed(found, each.term)}
    return replace(found, problem=replace(found.problem, tables=tables))


def _opposed(found: MotionEvidence, candidate: Term[Any]) -> bool:
    """Whether a delay or lag makes the skew of its transducer negative by `OPPOSED`, and the fit had no large delay."""
    term = cast("MotionTerm", candidate)
    if not (term.comes_late and term.whole):
        return False
    rows = _rows_of_skews(found, term)
    before = term.sense * found.problem.left
    after = before - term.sense * fit_term(found.problem, term).seen
    return bool(np.any((before[rows] > -OPPOSED) & (after[rows] > OPPOSED)))


def _rows_of_skews(found: MotionEvidence, term: Term[Any]) -> npt.NDArray[np.int64]:
    """Rows of the data sheet for the skews that a delay or lag is taken for."""
    sheet = found.baseline.sheet
    skews = [sheet.at(name) for name in cast("MotionTerm", term).mimicked_by]
    return np.flatnonzero(found.of_sheet)[: len(sheet.known)][np.isin(sheet.known, skews)]


def columns_beside(found: MotionEvidence, fits: tuple[TermFit, ...]) -> Array:
    """Columns (m, k) of the constants. A skew adds to a named delay of a torque; only the data sheet parts them."""
    columns = found.columns.copy()
    for fit in fits:
        term = cast("MotionTerm", fit.candidate)
        if term.comes_late and term.whole and term.hears:
            slope = found.problem.slopes(fit)[:, -1]
            for at in map(found.baseline.sheet.at, term.mimicked_by):
                columns[~found.of_sheet, at] = np.where(columns[:, at], term.sense * slope, 0.0)[~found.of_sheet]
    return columns


def with_small_rest(naming: TermNaming, found: MotionEvidence) -> TermNaming:
    """Constants off the data sheet explain what leaves less than `SMALL_REST` of the torque that they move.

    The gain of such a cause is its distance from the data sheet, which is little of what its torque would be worth.
    """
    all_of_sheet = all(cast("MotionTerm", fit.candidate).constants for fit in naming.best.fits)
    if naming.explained or not naming.best.fits or not all_of_sheet or not naming.best.needed:
        return naming
    small = naming.remainder.excess <= SMALL_REST**2 * moved_by_constants(found, naming.best.fits)
    return replace(naming, explained=True) if small else naming


def moved_by_constants(found: MotionEvidence, fits: tuple[TermFit, ...]) -> float:
    """Squares of the torque that constants of some fits move by being off their data sheet [noise variances]."""
    names = (name for fit in fits for name in cast("MotionTerm", fit.candidate).constants)
    at = [found.baseline.sheet.at(name) for name in names]
    off = (found.baseline.values - found.baseline.sheet.expected)[at]
    moved = found.columns[~found.of_sheet][:, at] @ off
    return float(moved @ moved)
