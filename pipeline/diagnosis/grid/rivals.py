"""Causes that are not excluded, as rows of the document: rivals, none of the catalogue, and what came near."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pmg.pipeline.diagnosis.engine.catalogue import MARGIN, WEAK
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.wording.plurals import uncapitalised

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.engine.conclusion import Conclusion
    from pmg.pipeline.diagnosis.engine.found_set import Naming
    from pmg.pipeline.diagnosis.engine.problem import Fit
    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis

CLOSE = 0.8
"""Part of a difference from which a cause that is not named, as it leaves too much, stands beside none of the
catalogue."""

MAY_BE, AT_ALL = 2, 0.2
"""Causes that stand beside none of the catalogue where a difference is weak, and the part of it that each must explain:
of trials, a third cause, or one that explains less, was the true one as rarely as any."""

TOO_WEAK = "too weak to name one cause", "The difference is too weak to name one cause"
NOT_PROVED = "no cause proved", "Data that took no part in the fit prove no cause"
IN_PART = "likely cause, proved in part", "Data that took no part in the fit bear out a part only"
"""Why there is a set of what may be: in a few words, and as a sentence."""

NONE_KNOWN = {
    "ids": [str(Verdict.NOT_IN_LIBRARY)],
    "shafts": [],
    "why": "a cause that the catalogue does not have is not excluded",
    "separating_test": "",
}
"""Last of the possible causes where none is named: the mismatch is too weak to rule out one outside the catalogue, or
no cause is proved."""


PREDICTED = 0.5
"""Part of the error on data not used for a fit that a curve must take away for a difference to be plain."""


def rival_rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Every cause that is not excluded, with why; of what is said to be none of the catalogue, those that come near."""
    if diagnosis.verdict is Verdict.NOT_IN_LIBRARY:
        sets, why = near_causes(diagnosis)
        return [rival_row(fits, why) for fits in sets]
    rows = [_rival(diagnosis, i) for i in range(len(diagnosis.rivals))]
    return [*rows, NONE_KNOWN] if diagnosis.weak else rows


def is_faint(diagnosis: Diagnosis) -> bool:
    """Whether a difference, of which no cause is named, is too faint to exclude any.

    One that a curve predicts on data not used for the fit is not faint, however large the scatter of repeats that it
    makes.
    """
    naming, proof = diagnosis.naming, diagnosis.held_out
    if proof is not None:
        low, high = proof.gain_interval
        if PREDICTED * proof.rmse_before < low < high:  # one block alone has no interval
            return False
    none = diagnosis.verdict is Verdict.NOT_IN_LIBRARY
    return none and naming is not None and naming.rounds[0].remainder.excess < WEAK


def near_causes(diagnosis: Diagnosis) -> tuple[list[tuple[CandidateFit, ...]], str]:
    """Sets of causes that stand beside none of the catalogue, and why; none where nothing comes near."""
    naming = diagnosis.naming
    if naming is None:
        return [], ""
    if is_faint(diagnosis):
        first: dict[str, CandidateFit] = {}
        least = AT_ALL * naming.rounds[0].remainder.excess
        for fit in naming.ranking:
            if fit.needed and fit.gain > least:
                first.setdefault(fit.identifier, fit)
        return [(fit,) for fit in list(first.values())[:MAY_BE]], "the difference is too faint to exclude any"
    share = nearest_share(naming)
    why = f"it explains {share:.0%} of the difference, but {why_not_named(naming)}"
    return ([naming.best.fits], why) if share >= CLOSE else ([], "")


def why_not_named(naming: Naming[Any, Any], withheld: str = "readings") -> str:
    """Why what comes nearest is not named, in words that go on after 'but'; `withheld`: what tested it."""
    failed = f"fails on {withheld} not used for the fit" if naming.explained else "leaves more than noise"
    return naming.against or failed


def nearest_share(naming: Naming[Any, Any]) -> float:
    """Part of the difference that the leading set takes up; 0 without one."""
    if not naming.best.fits or not naming.best.needed:
        return 0.0
    return naming.best.gain / (naming.best.gain + naming.remainder.excess)


def rival_row(fits: Sequence[Fit[Any]], why: str, test: str = "") -> dict[str, Any]:
    """A set of causes that is not excluded, with why and the test that would tell."""
    return {
        "ids": list(dict.fromkeys(fit.identifier for fit in fits)),
        "shafts": list(dict.fromkeys(fit.place for fit in fits)),
        "why": why,
        "separating_test": test,
    }


def _rival(diagnosis: Diagnosis, place: int) -> dict[str, Any]:
    assert diagnosis.naming is not None  # a rival is one to something
    best, rival = diagnosis.naming.best, diagnosis.rivals[place]
    fits = () if rival.explanation.ids < best.ids else best.fits
    test = "" if rival.test is None else rival.test.plan.description
    return rival_row((*fits, *rival.explanation.fits), why_open(diagnosis, place), test)


def why_weak(conclusion: Conclusion[Any, Any]) -> tuple[str, str]:
    """Why what is told is no more than what may be."""
    if conclusion.in_part:
        return IN_PART
    return NOT_PROVED if conclusion.unproved else TOO_WEAK


def why_open(conclusion: Conclusion[Any, Any], place: int) -> str:
    """Why a rival, the one in a place among them, is not excluded."""
    naming = conclusion.naming
    assert naming is not None  # a rival is one to something
    rival = naming.rivals[place]
    closer = naming.best.score - rival.score
    if place >= len(naming.rivals) - naming.by_parts:
        return "the first fits all readings better, but parts of them name this one"
    if rival.ids < naming.best.ids:
        return "by itself, with another form of its law, it explains about as much as both"
    if conclusion.weak:
        words = why_weak(conclusion)[1]
        return uncapitalised(words)
    if closer > MARGIN and naming.evidence_scale < 1.0:
        return "the first fits better, but by less than an error in the form of its law is worth"
    if closer > MARGIN:
        return "the first fits better, but by less than what its own law leaves unexplained"
    if closer <= math.log(2.0):
        return "both fit equally well"
    odds = math.exp(0.5 * naming.evidence_scale * closer)
    return f"the first is favoured by odds of about {odds:.0f} to 1, too little to exclude this one"
