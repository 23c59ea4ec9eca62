"""Which mechanisms of the catalogue explain a mismatch, which rivals cannot be told from them, and what is left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.diagnose.engine.adequacy import ORDINARY
from pmg.pipeline.diagnose.grid.explanation import (
    Explanation,
    all_in_detail,
    ids,
    leaders_in_detail,
    needed,
    swapped,
)
from pmg.pipeline.diagnose.grid.ranking import ENTRY, rank

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnose.engine.adequacy import AdequacyTest, Remainder
    from pmg.pipeline.diagnose.grid.candidates import CandidateFit, GridProblem

MOST = 3
"""Mechanisms named at once at most."""

MARGIN = 10.0
"""Evidence by which a mechanism must beat a rival to be named alone: odds of about 150 to 1."""

FIRST_OF_PAIRS = 3
"""Leading single mechanisms from which pairs are tried."""

FORM_ERROR = 0.10
"""Part of a mechanism's gain that may be left over and pass for the error of its form rather than another mechanism.

Other physical forms of the same mechanism leave a few hundredths once it is taken in detail; mechanisms from outside
the catalogue mostly leave more of their nearest look-alike."""

SHARE_OF_REST = 0.5
"""Part of what is left that a further mechanism must explain to enter."""

SHARE_OF_FIRST = 0.05
"""Part of the gain so far that a further mechanism must bring: below, an error of form explains it as well."""

CHANCE = 0.5
"""Part of what noise exceeds one time in a hundred that may be left over beside an error of form."""

SMALL_PART = 0.3
"""Part of a mechanism's gain that may be left over where it is within the noise."""

WEAK = 80.0
"""Gain below which what a mechanism leaves is hardly told from noise, and an effect of another kind may pass for it."""

PASSES = 3
"""Times the members of a set are swapped at most, as long as that makes it better."""

FEWEST, MOST_RIVALS = 1, 4
"""Rivals of a weak explanation that are told, at least and at most."""


@dataclass(frozen=True)
class Naming:
    """What the catalogue says.

    Parameters
    ----------
    best : Explanation
        The leading set; without mechanisms where none enters.
    rivals : tuple of Explanation
        Sets of other mechanisms within the margin, best first.
    shafts : dict of str to str
        Shaft of each named mechanism; ``either`` where only the shaft cannot be told.
    remainder : Remainder
        What the leading set leaves.
    explained : bool
        Whether the set is good enough to be named: adequate, or left with no more than an error of form.
    weak : tuple of Explanation
        Where the mismatch is too weak to name its cause and single mechanisms explain all that is seen of it: those,
        best first.
    ranking : tuple of CandidateFit
        All single mechanisms, best first.
    """

    best: Explanation
    rivals: tuple[Explanation, ...]
    shafts: dict[str, str]
    remainder: Remainder
    explained: bool
    weak: tuple[Explanation, ...]
    ranking: tuple[CandidateFit, ...]

    def on_the_other_shaft(self, fit: CandidateFit) -> CandidateFit | None:
        """The same mechanism on the other shaft, where which of the two it is cannot be told."""
        if self.shafts.get(fit.candidate.identifier) != "either":
            return None
        elsewhere = {"sun", "ring"} - {fit.candidate.shaft}
        same = (other for other in self.ranking if other.candidate.identifier == fit.candidate.identifier)
        return next((other for other in same if other.candidate.shaft in elsewhere), None)


def _extended(first: Explanation, wanted: int) -> list[Explanation]:
    """The best ways to add one mechanism to a set."""
    taken = tuple(fit.candidate.identifier for fit in first.fits)
    best = rank(first.problem, taken)[:wanted]
    return [Explanation((*first.fits, fit), first.problem.take_out(fit)) for fit in best]


def name_mechanisms(problem: GridProblem, left_over: AdequacyTest) -> Naming:
    """Search the catalogue: single mechanisms, then pairs and threes while something is left.

    Parameters
    ----------
    problem : GridProblem
        Readings with the baseline free.
    left_over : callable
        Judges what a problem leaves.

    Notes
    -----
    A rival is any set with other mechanisms whose evidence comes within the margin of the best one's. What the best
    set leaves beyond the noise widens the margin: it tells how far the catalogue's forms are from the truth, and two
    mechanisms closer than that are not told apart.
    """
    empty = Explanation((), problem)
    ranking = rank(problem)
    singles = [Explanation((fit,), problem.take_out(fit)) for fit in ranking[: FIRST_OF_PAIRS + 3]]
    best = singles[0] if singles[0].score > ENTRY else empty
    remainder = left_over(best.problem)
    pool = list(singles)
    if best.fits and not (remainder.adequate and _explains(best, remainder)):
        singles = leaders_in_detail(problem, singles)
        pool += singles
        best, remainder = _better(best, singles[0], remainder, left_over)
    while best.fits and not remainder.adequate and len(best.fits) < MOST:
        starts = [best] if len(best.fits) > 1 else singles[:FIRST_OF_PAIRS]
        larger = sorted((e for start in starts for e in _extended(start, 3)), key=lambda e: -e.score)
        if not larger or not _enters(best, larger[0], remainder.excess):
            break
        pool += larger
        best = larger[0]
        remainder = left_over(best.problem)
        if not remainder.adequate:
            detailed = all_in_detail(problem, best)
            pool.append(detailed)
            best, remainder = _better(best, detailed, remainder, left_over)
    for _ in range(PASSES if len(best.fits) > 1 else 0):
        others, before = swapped(problem, best), best
        pool += others
        best, remainder = _better(best, max([best, *others], key=lambda e: e.score), remainder, left_over)
        if best is before:
            break
    margin = MARGIN + (0.0 if remainder.adequate else remainder.excess)
    near = [e for e in sorted(pool, key=lambda e: -e.score) if e.score > max(0.0, best.score - margin)]
    rivals, shafts = _rivals(best, near)
    explained = _explains(best, remainder)
    weak = _weak(singles, lambda leader: remainder if leader is best else left_over(leader.problem))
    return Naming(best, rivals, shafts, remainder, explained, weak, tuple(ranking))


def _explains(best: Explanation, remainder: Remainder) -> bool:
    """Whether what a set leaves is an error of form, or noise."""
    if not best.fits or any(fit.without_scale and not fit.candidate.kind.linear for fit in best.fits):
        return False
    if remainder.within_noise and remainder.excess <= SMALL_PART * best.gain:
        return True
    chance = CHANCE * remainder.usual if remainder.p_value >= ORDINARY else 0.0
    return remainder.excess <= FORM_ERROR * best.gain + chance


def _weak(singles: list[Explanation], left_over: Callable[[Explanation], Remainder]) -> tuple[Explanation, ...]:
    """Single mechanisms that explain a weak mismatch, best first; none where it is strong or something is left."""
    listed = sorted(singles, key=lambda e: -e.score)
    leader = listed[0]
    if leader.gain >= WEAK or leader.score <= 0.0 or not left_over(leader).within_noise:
        return ()
    others = [e for e in listed if ids(e) != ids(leader)]
    near = [e for e in others if e.score > leader.score - MARGIN]
    return (leader, *(near or others[:FEWEST])[:MOST_RIVALS])


def _better(
    best: Explanation, other: Explanation, remainder: Remainder, left_over: AdequacyTest
) -> tuple[Explanation, Remainder]:
    """The better of two sets, and what it leaves."""
    return (other, left_over(other.problem)) if other.score > best.score else (best, remainder)


def _enters(before: Explanation, after: Explanation, excess: float) -> bool:
    """Whether one more mechanism is more than an error of form of those before."""
    gained = after.gain - before.gain
    left = before.problem.left
    enough = max(SHARE_OF_REST * min(excess, float(left @ left)), SHARE_OF_FIRST * before.gain)
    return after.score > before.score + ENTRY and gained > enough and needed(after)


def _rivals(best: Explanation, near: list[Explanation]) -> tuple[tuple[Explanation, ...], dict[str, str]]:
    """Rivals with other mechanisms, each set once; and the shafts of the best, open where a twin differs there only."""
    shafts = {fit.candidate.identifier: fit.candidate.shaft for fit in best.fits}
    rivals: dict[frozenset[str], Explanation] = {}
    for other in near:
        others = ids(other)
        if others == ids(best):
            for fit in other.fits:
                if {shafts[fit.candidate.identifier], fit.candidate.shaft} == {"sun", "ring"}:
                    shafts[fit.candidate.identifier] = "either"
        elif len(other.fits) <= len(best.fits) and not others < ids(best):
            rivals.setdefault(others, other)
    return tuple(rivals.values()), shafts
