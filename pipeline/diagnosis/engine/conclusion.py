"""What a search of the candidates and its proof on withheld rows allow to be said."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic

from pmg.pipeline.diagnosis.engine.adequacy import ORDINARY
from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.explanation import explain_with
from pmg.pipeline.diagnosis.engine.naming import MOST_RIVALS
from pmg.pipeline.diagnosis.engine.problem import F, P
from pmg.pipeline.diagnosis.engine.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue
    from pmg.pipeline.diagnosis.engine.decoys import Decoys
    from pmg.pipeline.diagnosis.engine.explanation import Explanation
    from pmg.pipeline.diagnosis.engine.found_set import Naming
    from pmg.pipeline.diagnosis.engine.held_out import HeldOut
    from pmg.pipeline.diagnosis.engine.verdict import Absorbed

KNOWN = 0.7
"""Part of weak differences whose cause was in the catalogue: of trials with gains from 80 to 160 noise variances. It is
taken where no cause is proved, too."""

UNTRIED = "cannot be tried on data not used for the fit: there are too few"
"""Why a set that explains is not named where nothing could be withheld."""

UNPREDICTED = 0.25
"""Part of the mismatch of withheld rows that a cause in the main need not predict where no structure is seen in what it
leaves, or nobody could foretell more: near standstill a few rows hold most of a friction of little known form."""

NOT_WORSE = 1.03
"""Withheld error with a weak candidate in, over that without, up to which it stays in the set of what may be."""


@dataclass(frozen=True, kw_only=True)
class Conclusion(Generic[F, P]):
    """Verdict, with the set of candidates that is named or comes nearest.

    Parameters
    ----------
    verdict : Verdict
        One of the five words.
    naming : Naming or None
        What the catalogue says, rivals included; None without a mismatch.
    held_out : HeldOut or None
        Errors on withheld rows without and with what was left out.
    weak : bool
        Whether the set is what may make it: the mismatch is too weak to name its cause, or withheld rows prove none.
    absorbed : tuple of Absorbed
        What the baseline had swallowed.
    decoys : Decoys or None
        What structures without a meaning would have achieved in place of what is named.
    """

    verdict: Verdict
    naming: Naming[F, P] | None = None
    held_out: HeldOut | None = None
    weak: bool = False
    absorbed: tuple[Absorbed, ...] = ()
    decoys: Decoys | None = None

    @property
    def unproved(self) -> bool:
        """Whether the set is what may make it because withheld rows do not bear it out, or do so in part."""
        return self.weak and self.naming is not None and not self.naming.weak

    @property
    def in_part(self) -> bool:
        """Whether that set leaves more than noise: the mismatch is strong, and withheld rows bear out most of it."""
        return self.unproved and self.naming is not None and not self.naming.explained


def conclude(
    problem: P,
    catalogue: CandidateCatalogue[F, P],
    naming: Naming[F, P],
    prove: Callable[[Explanation[F, P]], HeldOut | None],
) -> Conclusion[F, P]:
    """The verdict on a mismatch.

    Parameters
    ----------
    problem : WhitenedProblem
        Rows with the baseline free.
    catalogue : CandidateCatalogue
        What may be named.
    naming : Naming
        What of it explains the rows.
    prove : callable
        Errors of a set on withheld rows, the choice made anew for each part; None where there are too few rows.

    Notes
    -----
    A set is named when it is good enough and predicts most of the mismatch of withheld rows, which these must show; in
    the main, when it leaves a small part that is more than noise, and every part of the rows names it as well. Rivals
    are the sets of close evidence, and those that parts of the rows name instead. Where the mismatch is too weak to
    tell an effect of another kind by what it leaves, the candidates that explain it are reported as what may be, and
    none is named; so they are where they explain all or most, and withheld rows do not show the mismatch or show a part
    of it predicted.
    """
    if naming.may_be_named and not naming.weak:
        held = prove(naming.best)
        proved = held is not None and borne_out(catalogue, naming, held)
        if held is not None and proved and (held.shows(naming.best.gain) or not catalogue.tells_weak):
            naming = _with_parts(problem, catalogue, naming, held)
            verdict = Verdict.AMBIGUOUS if naming.rivals else Verdict.NAMED
            return Conclusion(verdict=verdict, naming=naming, held_out=held)
        if held is not None and catalogue.tells_weak and left_open(naming, held):
            naming = _with_parts(problem, catalogue, naming, held)
            return Conclusion(verdict=Verdict.AMBIGUOUS, naming=naming, held_out=held, weak=True)
        if held is None and naming.explained:
            naming = replace(naming, against=UNTRIED)
    if naming.weak:
        best, *others = naming.weak
        held = prove(best)
        if held is not None and held.rmse_after <= NOT_WORSE * held.rmse_before:
            places = {fit.identifier: _place(problem, naming, fit) for fit in (f for e in naming.weak for f in e.fits)}
            named = replace(naming, best=best, rivals=tuple(others), shafts=places)
            named = _with_parts(problem, catalogue, named, held)
            return Conclusion(verdict=Verdict.AMBIGUOUS, naming=named, held_out=held, weak=True)
    return Conclusion(verdict=Verdict.NOT_IN_LIBRARY, naming=naming)


def _place(problem: P, naming: Naming[F, P], fit: F) -> str:
    """Place of a candidate, open where it explains as much in another one."""
    if fit.identifier in naming.shafts:
        return naming.shafts[fit.identifier]
    twins = (f for f in naming.ranking if f.identifier == fit.identifier and f.place not in (fit.place, "both"))
    level = any(problem.score(twin) > problem.score(fit) - MARGIN for twin in twins)
    return "either" if level and fit.place != "both" else fit.place


def borne_out(catalogue: CandidateCatalogue[F, P], naming: Naming[F, P], held: HeldOut) -> bool:
    """Whether withheld rows bear a set out, as a whole or in the main.

    What leaves more than noise must leave little, and be foretold by rows of another kind.
    """
    if naming.explained and held.predicts:
        return True
    nothing_seen = naming.remainder.p_value >= ORDINARY or not catalogue.foretells(naming.best.fits)
    unseen = nothing_seen and held.left <= UNPREDICTED
    little = naming.remainder.excess < catalogue.left_by_named(len(naming.best.fits)) * naming.best.gain
    in_the_main = naming.in_the_main and (naming.explained or (little and not held.of_a_kind))
    return in_the_main and held.kept == 1.0 and (held.predicts or unseen)


def left_open(naming: Naming[F, P], held: HeldOut) -> bool:
    """Whether withheld rows leave open what they do not bear out: they do not show it, or it predicts a part for sure.

    A part counts where nothing else is seen in what the set leaves, where it is worth as much on withheld rows as on
    those of the fit, or of a cause in the main. That one must be named by every part of the rows.
    """
    if not naming.explained and held.kept < 1.0:
        return False
    if not held.tells:
        return held.rmse_after <= NOT_WORSE * held.rmse_before
    as_much = held.fall >= naming.best.gain and held.rmse_after < held.rmse_before
    alone = naming.remainder.p_value >= ORDINARY or not naming.explained
    return as_much or (alone and held.gain_interval[0] > 0.0)


def in_the_main_sentence(naming: Naming[Any, Any] | None, held: HeldOut | None) -> str:
    """What is said of a named cause that leaves more than noise, or predicts a part only; empty of another one."""
    if naming is None or (naming.explained and (held is None or held.predicts)):
        return ""
    if naming.explained and held is not None:
        return f"In the main: {held.left:.0%} of the squares withheld are not predicted, so its form may differ."
    part = naming.remainder.excess / naming.best.gain
    return f"In the main: {part:.1%} of its squares are left, so its form differs or something smaller is missing."


def probabilities(conclusion: Conclusion[Any, Any]) -> list[float]:
    """Weight of the leading explanation and of each rival, for equal prior odds.

    What parts of the readings name instead shares evenly the part of the choices that did not agree; either of a pair
    of look-alikes counts as much as the pair. Of a weak difference, something is left for what nobody knows.
    """
    naming = conclusion.naming
    if naming is None:
        return []
    best, others = naming.best, naming.rivals
    by_parts = [i > len(others) - naming.by_parts for i in range(len(others) + 1)]
    scores = [best.score, *(best.score if other.ids < best.ids else other.score for other in others)]
    most = max(score for score, apart in zip(scores, by_parts, strict=True) if not apart)
    even = 0.5 * naming.evidence_scale
    weights = [0.0 if apart else math.exp(even * (s - most)) for s, apart in zip(scores, by_parts, strict=True)]
    elsewhere = 1.0 - conclusion.held_out.kept if conclusion.held_out is not None and any(by_parts) else 0.0
    known = KNOWN if conclusion.weak else 1.0
    return [
        known * (elsewhere / sum(by_parts) if apart else (1.0 - elsewhere) * weight / sum(weights))
        for weight, apart in zip(weights, by_parts, strict=True)
    ]


def _with_parts(problem: P, catalogue: CandidateCatalogue[F, P], naming: Naming[F, P], held: HeldOut) -> Naming[F, P]:
    """What the catalogue says with the sets among its rivals that parts of the rows name instead."""
    known = {rival.ids for rival in naming.rivals}
    sets = held.elsewhere[: max(MOST_RIVALS - len(naming.rivals), 1)]
    others = [explain_with(problem, catalogue, candidates) for candidates in sets]
    added = tuple(e for e in others if e.ids not in known)
    return replace(naming, rivals=(*naming.rivals, *added), by_parts=len(added))
