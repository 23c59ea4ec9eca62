"""Causes that are not excluded, as rows of the document: rivals, none of the catalogue, and what came near."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.naming import WEAK
from pmg.pipeline.diagnosis.engine.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit
    from pmg.pipeline.diagnosis.grid.catalogue import GridNaming
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis, Rival

CLOSE = 0.8
"""Part of a difference from which a cause that is not named, as it leaves too much, stands beside none of the
catalogue."""

KNOWN = 0.7
"""Part of weak differences whose cause was in the catalogue: of trials with gains from 80 to 160 noise variances."""

MAY_BE, AT_ALL = 2, 0.2
"""Causes that stand beside none of the catalogue where a difference is weak, and the part of it that each must explain:
of trials, a third cause, or one that explains less, was the true one as rarely as any."""

_NONE_KNOWN = {
    "ids": [str(Verdict.NOT_IN_LIBRARY)],
    "shafts": [],
    "why": "the difference is too weak to exclude a cause that the catalogue does not have",
    "separating_test": "",
}
"""What stands beside the causes of a mismatch that is too weak to tell an effect of another kind by what it leaves."""


def rival_rows(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Every cause that is not excluded, with why; of what is said to be none of the catalogue, those that come near."""
    if diagnosis.verdict is Verdict.NOT_IN_LIBRARY:
        sets, why = near_causes(diagnosis)
        return [_row(fits, why) for fits in sets]
    rows = [_rival(diagnosis, rival) for rival in diagnosis.rivals]
    return [*rows, _NONE_KNOWN] if diagnosis.weak else rows


def is_faint(diagnosis: Diagnosis) -> bool:
    """Whether a difference, of which no cause is named, is too faint to exclude any."""
    naming = diagnosis.naming
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
    why = (
        f"it explains {share:.0%} of the difference, but leaves more than noise, fails on data not used for the fit, "
        "or would have the bearings drive a shaft at rest"
    )
    return ([naming.best.fits], why) if share >= CLOSE else ([], "")


def nearest_share(naming: GridNaming) -> float:
    """Part of the difference that the leading set takes up; 0 without one."""
    if not naming.best.fits or not naming.best.needed:
        return 0.0
    return naming.best.gain / (naming.best.gain + naming.remainder.excess)


def _row(fits: Sequence[CandidateFit], why: str, test: str = "") -> dict[str, Any]:
    return {
        "ids": list(dict.fromkeys(fit.candidate.identifier for fit in fits)),
        "shafts": list(dict.fromkeys(fit.candidate.shaft for fit in fits)),
        "why": why,
        "separating_test": test,
    }


def _rival(diagnosis: Diagnosis, rival: Rival) -> dict[str, Any]:
    assert diagnosis.naming is not None  # a rival is one to something
    best = diagnosis.naming.best
    why = _why(diagnosis, rival, best.score - rival.explanation.score)
    fits = () if rival.explanation.ids < best.ids else best.fits
    test = "" if rival.test is None else rival.test.plan.description
    return _row((*fits, *rival.explanation.fits), why, test)


def _why(diagnosis: Diagnosis, rival: Rival, closer: float) -> str:
    """Why a rival that has less evidence by `closer` [noise variances] is not excluded."""
    if rival.by_parts:
        return "the first fits all readings better, but parts of them name this one"
    if diagnosis.naming is not None and rival.explanation.ids < diagnosis.naming.best.ids:
        return "by itself, with another form of its law, it explains about as much as both"
    if diagnosis.weak:
        return "the difference is too weak to name its cause"
    if closer > MARGIN:
        return "the first fits better, but by less than what its own law leaves unexplained"
    if closer <= math.log(2.0):
        return "both fit equally well"
    return f"the first is favoured by odds of about {math.exp(0.5 * closer):.0f} to 1, too little to exclude this one"
