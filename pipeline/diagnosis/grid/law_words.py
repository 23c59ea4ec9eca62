"""Sentences on the law of what was named: how it differs from the library's form, and what would explain the same."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.diagnosis.grid.remedy import power_words
from pmg.pipeline.wording.numerals import measured
from pmg.pipeline.wording.plurals import uncapitalised
from pmg.sim.mechanisms.base import LawCovariate
from pmg.sim.signals import MINUTE

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.pipeline.diagnosis.engine.found_set import Naming
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis

COVARIATES = {
    LawCovariate.LOAD: "load",
    LawCovariate.SPEED: "speed",
    LawCovariate.SLIP: "slip of the poles",
    LawCovariate.DIFFERENCE: "speed difference",
    LawCovariate.TIME: "time",
}
"""Covariates of laws in words."""

CLEAR = 2.0
"""Standard errors by which a power must differ from that of the library's form to be mentioned."""


def bent_sentence(naming: Naming[Any, Any], along: Iterable[LawCovariate]) -> str:
    """That the law of what leads is another than the library's, and how much either explains."""
    best, left = naming.best, naming.remainder.excess
    whole = best.gain + best.bent + left
    follows = " and ".join(dict.fromkeys(COVARIATES[name] for name in along))
    change = f"A smooth change with {follows}" if follows else "A mixture of its shapes"
    return (
        f"The law differs from that of the library. The library's form explains {best.gain / whole:.1%} of the "
        f"difference (in squares). {change} explains another {best.bent / whole:.1%}; "
        f"{left / whole:.1%} remains."
    )


def form_sentences(diagnosis: Diagnosis) -> str:
    """Whether the law is another than the library's, in which power, and what would explain the same."""
    naming = diagnosis.naming
    if naming is None:
        return ""
    best, further, sentences = naming.best, naming.further, []
    if best.bent:
        along = [name for fit in best.fits for name in fit.candidate.kind.follows]
        sentences.append(bent_sentence(naming, along))
        sentences += _powers(diagnosis)
        sentences.append(
            "The error on data not used for the fit is with the law free; the extended model has the library's form."
        )
    if further:
        titles = " and ".join(uncapitalised(fit.candidate.kind.title) for fit in further)
        part = sum(fit.gain for fit in further) / (best.gain + sum(fit.gain for fit in further))
        sentences.append(
            f"What the library's form leaves ({part:.1%} of the effect, in squares) may be an error of form, or "
            f"{titles}; these readings cannot tell."
        )
        test = diagnosis.form_test
        if test is not None:
            sentences.append(
                f"To tell: {test.plan.description} ({test.plan.seconds / MINUTE:.0f} min). "
                f"It tells with {power_words(test.power)} probability."
            )
    return " ".join(sentences)


def _powers(diagnosis: Diagnosis) -> list[str]:
    """What each power says, where it is clear."""
    found = []
    for power in diagnosis.law:
        if abs(power.more) > CLEAR * power.standard_error:
            way = "higher" if power.more > 0.0 else "lower"
            where = f" on the {power.shaft} shaft" if len({other.shaft for other in diagnosis.law}) > 1 else ""
            found.append(
                f"With {COVARIATES[power.along]}{where} it goes by a power "
                f"{measured(abs(power.more), power.standard_error)} {way} than the fitted form."
            )
    return found
