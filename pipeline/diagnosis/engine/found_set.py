"""A set of candidates that was found: its rivals, what it leaves, and whether it may be named."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic

from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.explanation import Explanation, explain_with, rivals_near, swapped
from pmg.pipeline.diagnosis.engine.free_form import explains
from pmg.pipeline.diagnosis.engine.problem import F, P

if TYPE_CHECKING:
    from collections.abc import Collection

    from pmg.pipeline.diagnosis.engine.adequacy import AdequacyTest, Remainder
    from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue


@dataclass(frozen=True)
class SearchRound(Generic[F]):
    """One round of the search.

    Parameters
    ----------
    ranking : tuple of Fit
        Candidates not yet taken, best first.
    entered : tuple of str
        Ids of what entered.
    remainder : Remainder
        What was left before.
    """

    ranking: tuple[F, ...]
    entered: tuple[str, ...]
    remainder: Remainder


@dataclass(frozen=True)
class Naming(Generic[F, P]):
    """Result of the search in the catalogue.

    Parameters
    ----------
    best : Explanation
        The leading set; without candidates where none enters.
    rivals : tuple of Explanation
        Sets of other candidates within the margin, best first.
    shafts : dict of str to str
        Place of each named candidate; ``either`` where only the shaft cannot be determined, of rivals too.
    remainder : Remainder
        What the leading set leaves.
    explained : bool
        Whether the set is good enough to be named: adequate, or left with no more than an error of form.
    in_the_main : bool
        Whether it leaves so small a part of its gain that it may be named where every part of the rows names it.
    weak : tuple of Explanation
        Where the mismatch is too weak to name its cause and single candidates explain all that is seen of it: those,
        best first.
    rounds : tuple of SearchRound
        The rounds; the first ranks every single candidate.
    by_parts : int
        How many of the rivals, the last ones, are there because parts of the rows name them, not by their evidence.
    further : tuple of Fit
        A further candidate that would take up what is left; an error of form of those before explains it as well.
    missed : tuple of (Explanation, float)
        Sets of other candidates that miss the margin by less than `NEAR`, and by how much, best first.
    evidence_scale : float
        Factor on a difference of scores that counts as evidence; less than 1 where a part of it is an error of form.
    against : str
        Why a set is not named that leaves no more than it may, where it did not fail a proof; empty otherwise.
    """

    best: Explanation[F, P]
    rivals: tuple[Explanation[F, P], ...]
    shafts: dict[str, str]
    remainder: Remainder
    explained: bool
    in_the_main: bool
    weak: tuple[Explanation[F, P], ...]
    rounds: tuple[SearchRound[F], ...]
    by_parts: int = 0
    further: tuple[F, ...] = ()
    missed: tuple[tuple[Explanation[F, P], float], ...] = ()
    evidence_scale: float = 1.0
    against: str = ""

    @property
    def level(self) -> tuple[Explanation[F, P], ...]:
        """Rivals of the same evidence as the leading set, to the decimals that count: the catalogue's order decides."""
        by_evidence = self.rivals[: len(self.rivals) - self.by_parts]
        return tuple(rival for rival in by_evidence if rival.score == self.best.score)

    @property
    def may_be_named(self) -> bool:
        """Whether a proof may name the set."""
        return self.explained or self.in_the_main

    @property
    def ranking(self) -> tuple[F, ...]:
        """All single candidates, best first."""
        return self.rounds[0].ranking

    def place_in(self, explanation: Explanation[F, P], fit: F) -> str:
        """Place of a candidate of the leading set or of a rival; ``either`` where it cannot be determined."""
        known = self.shafts.get(fit.identifier, fit.place)
        return known if explanation is self.best or known == "either" else fit.place

    def on_the_other_shaft(self, fit: F) -> F | None:
        """The same candidate in the other place, where which of the two it is cannot be determined."""
        if self.shafts.get(fit.identifier) != "either":
            return None
        same = (other for other in self.ranking if other.identifier == fit.identifier)
        return next((other for other in same if other.place not in (fit.place, "both")), None)


def margin_beside(remainder: Remainder) -> float:
    """Evidence by which a set must beat its rivals, with what it leaves beyond the noise."""
    return MARGIN + (0.0 if remainder.adequate else remainder.excess)


def named_against(
    best: Explanation[F, P],
    pool: list[Explanation[F, P]],
    remainder: Remainder,
    catalogue: CandidateCatalogue[F, P],
    rounds: tuple[SearchRound[F], ...],
) -> Naming[F, P]:
    """A set against a pool of others, with what it leaves."""
    of_form = catalogue.form_margin * max(best.score, 0.0)
    rivals, shafts, missed = rivals_near(best, pool, margin_beside(remainder), of_form)
    return Naming(
        best,
        rivals,
        shafts,
        remainder,
        explains(best, remainder, catalogue.form_error),
        best.needed and remainder.excess < catalogue.left_in_the_main(len(best.fits)) * best.gain,
        (),
        rounds,
        missed=missed,
        evidence_scale=MARGIN / (MARGIN + of_form),
    )


def name_part(
    problem: P,
    catalogue: CandidateCatalogue[F, P],
    naming: Naming[F, P],
    ids: Collection[str],
    remainder_of: AdequacyTest,
) -> Naming[F, P]:
    """Some candidates of the leading set, fitted without the others, against those that may take their place.

    Parameters
    ----------
    problem : WhitenedProblem
        Rows with the baseline free.
    catalogue : Catalogue
        What may be named.
    naming : Naming
        The result of the search.
    ids : collection of str
        Ids of the candidates that are kept.
    remainder_of : callable
        Judges what a problem leaves.
    """
    kept = [fit.candidate for fit in naming.best.fits if fit.identifier in ids]
    best = explain_with(problem, catalogue, kept)
    return named_against(best, swapped(problem, catalogue, best), remainder_of(best.problem), catalogue, naming.rounds)
