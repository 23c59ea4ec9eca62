"""What other low-passes, and quarters of the record, bear out of the terms that were found."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue
from pmg.pipeline.diagnosis.balance.contest import settled
from pmg.pipeline.diagnosis.balance.library.columns import RIPPLE, SECOND_RIPPLE
from pmg.pipeline.diagnosis.balance.library.elastic import LIKE_PLAY
from pmg.pipeline.diagnosis.balance.library.term import DELAY
from pmg.pipeline.diagnosis.balance.low_passes import FACTORS
from pmg.pipeline.diagnosis.engine.adequacy import adequacy_test
from pmg.pipeline.diagnosis.engine.found_set import name_part

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.estimate import Estimate, FittedTerms
    from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
    from pmg.pipeline.diagnosis.balance.low_passes import LowPassTried
    from pmg.pipeline.diagnosis.balance.search_record import Searched

MOST_MOVED = 0.95
"""Quantile of the force that a delay moves, above which it must be the same as below."""

SHORTER, SURELY = 0.85, 4.0
"""Delay of the samples below, over that above, from which on down it is another one, if by so many standard errors."""


class HeldBack(StrEnum):
    """Why a cause that was found is not named."""

    LOW_PASS = "low-pass"
    """Neither half the low-pass nor twice bears it out."""
    WORSE_WITHHELD = "worse withheld"
    """It makes the error on the withheld record larger by a tenth or more, with certainty."""
    LIKE_PLAY = "like play"
    """Play in a coupling would be explained by the same terms."""
    UNEVEN_DELAY = "uneven delay"
    """The delay is shorter where it moves the force less."""
    SIZE_UNKNOWN = "size unknown"
    """Left out in turn, parts of the record move its size by more than itself: a few samples carry it."""


def sure_part(
    s: Searched, in_every_part: frozenset[str], case: Case, low_passes: tuple[LowPassTried, ...]
) -> Searched | None:
    """The search with those of its terms that no quarter of the record, low-pass or rival leaves out.

    None without any, or where that is all of them. `in_every_part` are the ids that are chosen whichever quarter is
    withheld.
    """
    if s.found is None:
        return None
    asked = _asked(case, low_passes, s.mismatch.false_alarm_rate)
    named = s.found.best.ids
    ids = named.intersection(in_every_part, *(rival.ids for rival in s.found.rivals), *asked)
    ids = ids if RIPPLE in ids else ids - {SECOND_RIPPLE}
    gone = (fit.candidate for fit in s.found.best.fits if fit.identifier not in ids)
    if not ids or ids == named or any(term.outcomes is not None for term in gone):
        return None  # without a term that gives rows noise they are others
    found = name_part(s.problem, TermCatalogue(), s.found, ids, adequacy_test(s.evidence))
    return replace(s, found=found, named=found.best.fits)


def _asked(case: Case, low_passes: tuple[LowPassTried, ...], limit: float) -> list[frozenset[str]]:
    """Ids that other low-passes name which see a mismatch.

    A higher one that lets in a resonance may hide what is lower: it is asked where no other is left.
    """
    seen = [each for each in low_passes if each.p_value <= limit]
    clear = [each.ids for each in seen if not each.lets_in_a_resonance(case.prepare.low_pass_hz)]
    return clear or [each.ids for each in seen]


def held_back(
    s: Searched, case: Case, low_passes: tuple[LowPassTried, ...], fitted: FittedTerms, *, worse: bool
) -> HeldBack | None:
    """Why terms that stood the proof are not named.

    Parameters
    ----------
    s : Searched
        The search that found them.
    case : Case
        The case.
    low_passes : tuple of LowPassTried
        What the search says with other low-passes.
    fitted : FittedTerms
        The model with all of them.
    worse : bool
        Whether they make the error on the withheld record larger.
    """
    if {fit.identifier for fit in s.named} >= LIKE_PLAY:
        return HeldBack.LIKE_PLAY
    if _late_at_times(s.problem, s.named):
        return HeldBack.UNEVEN_DELAY
    if of_no_size(fitted):
        return HeldBack.SIZE_UNKNOWN
    if worse:
        return HeldBack.WORSE_WITHHELD
    return HeldBack.LOW_PASS if _none_names(s, case, low_passes) else None


def _late_at_times(problem: TermProblem, named: tuple[TermFit, ...]) -> bool:
    """Whether a named delay is longer where it moves the force most than where it moves it less.

    A delay is the same at any time; a load that crosses a gap is late for a moment and far.
    """
    for fit in named:
        if fit.identifier != DELAY:
            continue
        beside = settled(problem, tuple(other for other in named if other is not fit))
        column = problem.columns_of(fit.candidate, fit.shape)
        most = np.abs(column) > np.quantile(np.abs(column), MOST_MOVED)
        parts = beside.project(np.hstack([np.where(most, column, 0.0), np.where(most, 0.0, column)]))
        delays = np.linalg.lstsq(parts, beside.left, rcond=None)[0]
        left = beside.left - parts @ delays
        apart = np.array([1.0, -1.0])
        square = apart @ np.linalg.pinv(parts.T @ parts) @ apart * float(left @ left) / len(left)
        if abs(apart @ delays) > SURELY * math.sqrt(square) and delays[1] / delays[0] < SHORTER:
            return True
    return False


def of_no_size(fitted: FittedTerms) -> tuple[Estimate, ...]:
    """Sizes of the first term of which the interval of each holds zero; a term whose size goes with a shape has one."""
    for fit in fitted.fits:
        own = tuple(e for e in fitted.estimates if e.term == fit.identifier)
        if fit.candidate.shape is None and all(e.interval[0] <= 0.0 <= e.interval[1] for e in own):
            return own
    return ()


def _none_names(s: Searched, case: Case, low_passes: tuple[LowPassTried, ...]) -> bool:
    """Whether both other low-passes see a mismatch, and those asked do not bear out the terms that were found.

    They do where one names the same, or where one names these and more and each names some of them.
    """
    limit = s.mismatch.false_alarm_rate
    seen, others = sum(each.p_value <= limit for each in low_passes), _asked(case, low_passes, limit)
    ids = {fit.identifier for fit in s.named}
    more = any(ids <= other for other in others) and all(ids & other for other in others)
    return seen == len(FACTORS) and ids not in others and not more
