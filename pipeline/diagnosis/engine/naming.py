"""Which candidates explain a mismatch, which rivals cannot be distinguished from them, and what is left."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.engine.catalogue import ENTRY, FAINT, MARGIN
from pmg.pipeline.diagnosis.engine.explanation import (
    Explanation,
    all_in_detail,
    leaders_in_detail,
    swapped,
)
from pmg.pipeline.diagnosis.engine.found_set import Naming, SearchRound, named_against
from pmg.pipeline.diagnosis.engine.free_form import explains, free_form
from pmg.pipeline.diagnosis.engine.problem import F, P

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.engine.adequacy import AdequacyTest, Remainder
    from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue

MOST = 3
"""Candidates named at once at most."""

FIRST_OF_PAIRS = 3
"""Leading single candidates from which pairs are tried."""

SHARE_OF_REST = 0.5
"""Part of what is left that a further candidate must explain to enter."""

SHARE_OF_FIRST = 0.05
"""Part of the gain so far that a further candidate must bring: below, an error of form explains it as well."""

TOGETHER = 0.9
"""Part of what is left that two candidates must explain to enter at once."""

PASSES = 3
"""Times the members of a set are swapped at most, as long as that makes it better."""

FEWEST, MOST_RIVALS = 1, 4
"""Rivals of a faint explanation that are listed at least, and of any at most."""

RULED_OUT = 28.0
"""Evidence by which a rival falls short that is not listed however faint all is: odds of a million to one."""


def name_candidates(problem: P, catalogue: CandidateCatalogue[F, P], remainder_of: AdequacyTest) -> Naming[F, P]:
    """Search the catalogue: single candidates, then pairs and threes while something is left.

    Parameters
    ----------
    problem : WhitenedProblem
        Rows with the baseline free.
    catalogue : Catalogue
        What may be named.
    remainder_of : callable
        Judges what a problem leaves.

    Notes
    -----
    A rival is any set with other candidates whose evidence comes within the margin of the best one's. What the best
    set leaves beyond the noise widens the margin: it tells how far the catalogue's forms are from the truth, and two
    candidates closer than that are not separated.
    """
    ranking = catalogue.rank(problem)
    singles = [Explanation((fit,), problem.take_out(fit)) for fit in ranking if fit.admissible][: FIRST_OF_PAIRS + 3]
    best = singles[0] if singles and singles[0].score > ENTRY else Explanation[F, P]((), problem)
    before = remainder_of(problem)
    rounds = [SearchRound(tuple(ranking), tuple(fit.identifier for fit in best.fits), before)]
    remainder = remainder_of(best.problem) if best.fits else before
    pool, further = list(singles), tuple[F, ...]()
    if best.fits and not (remainder.adequate and explains(best, remainder, catalogue.form_error)):
        singles = leaders_in_detail(problem, catalogue, singles)
        pool += singles
        best, remainder = _better(best, singles[0], remainder, remainder_of)
    while best.fits and len(best.fits) < MOST:
        if math.isinf(entry := catalogue.further_entry if remainder.adequate else ENTRY):
            break
        starts = [best] if len(best.fits) > 1 or remainder.adequate else singles[:FIRST_OF_PAIRS]
        after, larger, ranking = _enlarged(catalogue, best, starts, remainder, entry)
        form = free_form(best, catalogue, remainder_of) if after is not None else None
        if form is not None and after is not None and form.rivals(after.score - best.score):
            further, after = _further(best, [after]), None
        if remainder.adequate and after is None:
            break
        entered = () if after is None else tuple(fit.identifier for fit in after.fits[len(best.fits) :])
        rounds.append(SearchRound(tuple(ranking), entered, remainder))
        if after is None:
            further = further or _further(best, larger)
            break
        pool += [*larger, after]
        best, remainder = after, remainder_of(after.problem)
        if not remainder.adequate:
            detailed = all_in_detail(problem, catalogue, best)
            pool.append(detailed)
            best, remainder = _better(best, detailed, remainder, remainder_of)
    for _ in range(PASSES if len(best.fits) > 1 else 0):
        others, current = swapped(problem, catalogue, best), best
        pool += others
        best, remainder = _better(best, max([best, *others], key=lambda e: e.score), remainder, remainder_of)
        if best is current:
            break
    weak: tuple[Explanation[F, P], ...] = ()
    if catalogue.tells_weak and len(best.fits) < 2:
        weak = _weak(
            catalogue.weak_below, singles, lambda leader: remainder if leader is best else remainder_of(leader.problem)
        )
    found = named_against(best, pool, remainder, catalogue, tuple(rounds))
    return replace(found, weak=weak, further=further)


def _enlarged(
    catalogue: CandidateCatalogue[F, P],
    best: Explanation[F, P],
    starts: list[Explanation[F, P]],
    remainder: Remainder,
    entry: float,
) -> tuple[Explanation[F, P] | None, list[Explanation[F, P]], list[F]]:
    """The larger set that enters or None, all larger ones best first, and what may join the best one, ranked."""
    extended = [_extended(catalogue, start) for start in starts]
    larger = sorted((e for some, _ in extended for e in some), key=lambda e: -e.score)
    ranking = extended[[start.ids for start in starts].index(best.ids)][1]
    after = larger[0] if larger and _enters(best, larger[0], remainder.excess, entry) else None
    if after is None and catalogue.pairs_at_once and not remainder.adequate:
        after = _together(catalogue, best, larger, remainder.excess)
    return after, larger, ranking


def _extended(catalogue: CandidateCatalogue[F, P], first: Explanation[F, P]) -> tuple[list[Explanation[F, P]], list[F]]:
    """The best ways to add one candidate to a set, and the ranking they are from."""
    ranking = catalogue.rank(first.problem, first.ids)
    return [first.plus(fit) for fit in ranking[:FIRST_OF_PAIRS] if fit.admissible], ranking


def _weak(
    below_of: Callable[[tuple[F, ...]], float],
    singles: list[Explanation[F, P]],
    remainder_of: Callable[[Explanation[F, P]], Remainder],
) -> tuple[Explanation[F, P], ...]:
    """Single candidates that explain a weak mismatch, best first; none where it is strong or something is left."""
    if not singles:
        return ()
    leader, *others = sorted(singles, key=lambda e: -e.score)
    below = below_of(leader.fits)
    if leader.gain >= below or leader.score <= 0.0 or not remainder_of(leader).within_noise:
        return ()
    first: dict[frozenset[str], Explanation[F, P]] = {}
    for other in others:
        first.setdefault(other.ids, other)
    distinct = [e for ids, e in first.items() if ids != leader.ids and e.score > leader.score - RULED_OUT]
    near = [e for e in distinct if e.score > leader.score - MARGIN]
    fewest = FEWEST if leader.gain < min(FAINT, below) else 0
    return (leader, *(near or distinct[:fewest])[:MOST_RIVALS])


def _better(
    best: Explanation[F, P], other: Explanation[F, P], remainder: Remainder, remainder_of: AdequacyTest
) -> tuple[Explanation[F, P], Remainder]:
    """The better of two sets, and what it leaves."""
    return (other, remainder_of(other.problem)) if other.score > best.score else (best, remainder)


def _enters(before: Explanation[F, P], after: Explanation[F, P], excess: float, entry: float) -> bool:
    """Whether one more candidate is more than an error of form of those before."""
    left = before.problem.left
    enough = max(SHARE_OF_REST * min(excess, float(left @ left)), SHARE_OF_FIRST * before.gain)
    return after.score > before.score + entry and after.gain - before.gain > enough and after.needed


def _further(before: Explanation[F, P], larger: list[Explanation[F, P]]) -> tuple[F, ...]:
    """What would join a set with evidence of its own, where an error of form of that set explains it as well."""
    count = len(before.fits)
    for after in larger:
        grown = len(after.fits) > count and all(a is b for a, b in zip(after.fits, before.fits, strict=False))
        if grown and after.score > before.score + ENTRY and after.needed:
            return after.fits[count:]
    return ()


def _together(
    catalogue: CandidateCatalogue[F, P], before: Explanation[F, P], larger: list[Explanation[F, P]], excess: float
) -> Explanation[F, P] | None:
    """Two candidates that enter at once: where several are missing, none need explain half of the rest by itself.

    Together they must leave almost nothing and be worth their cost, and each must be more than an error of form.
    """
    if len(before.fits) + 2 > MOST:
        return None
    pairs = [pair for entry in larger[:FIRST_OF_PAIRS] for pair in _extended(catalogue, entry)[0]]
    pairs = [pair for pair in pairs if before.ids < pair.ids]
    if not pairs:
        return None
    best = max(pairs, key=lambda pair: pair.score)
    least = max(ENTRY, SHARE_OF_FIRST * before.gain)
    whole = best.gain - before.gain >= TOGETHER * excess and best.score > before.score + ENTRY
    return best if whole and all(fit.gain > least for fit in best.fits if fit.identifier not in before.ids) else None
