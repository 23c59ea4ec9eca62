"""The verdict in sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.held_out import change_words
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.form.shape import constants_in_words
from pmg.pipeline.diagnosis.grid.covariate_words import covariate_words
from pmg.pipeline.diagnosis.grid.law_words import form_sentences
from pmg.pipeline.diagnosis.grid.remedy import advice, best_test, lifting, words_of_test
from pmg.pipeline.diagnosis.grid.rivals import is_faint, near_causes, nearest_share, why_not_named, why_weak
from pmg.pipeline.wording import numerals
from pmg.pipeline.wording.cause_sets import SHAFT_WORDS, TOGETHER
from pmg.pipeline.wording.plurals import capitalised, counted, uncapitalised
from pmg.pipeline.wording.units import displayed
from pmg.sim.mechanisms.base import Instrument
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit
    from pmg.pipeline.diagnosis.grid.catalogue import GridExplanation, GridNaming
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.diagnosis.grid.locate import CampaignMismatch
    from pmg.sim.signals import Array

PHRASES = {
    Verdict.CONSISTENT: "no difference found",
    Verdict.NAMED: "cause named",
    Verdict.AMBIGUOUS: "several causes fit",
    Verdict.NOT_IN_LIBRARY: "no known cause fits",
    Verdict.CONFOUNDED: "the campaign cannot tell",
}
"""Verdicts as people read them."""


def phrase(diagnosis: Diagnosis) -> str:
    """The verdict in a few words: the same in the report, in ``diagnosis.json`` and on the terminal."""
    return why_weak(diagnosis)[0] if diagnosis.weak or is_faint(diagnosis) else PHRASES[diagnosis.verdict]


def statement(diagnosis: Diagnosis) -> str:
    """The verdict in a few sentences."""
    text = _without_outliers(diagnosis)
    if not diagnosis.outliers:
        return text
    names = ", ".join(diagnosis.outliers[:5]) + (" ..." if len(diagnosis.outliers) > 5 else "")
    were = "were" if len(diagnosis.outliers) > 1 else "was"
    return f"{text} {counted(len(diagnosis.outliers), 'outlier')} {were} excluded first ({names})."


def _without_outliers(diagnosis: Diagnosis) -> str:
    mismatch = diagnosis.mismatch
    if diagnosis.verdict is Verdict.CONFOUNDED:
        bracket = f" (p {'≤' if mismatch.found else '='} {mismatch.p_value:.2g})"
        return (
            f"{beyond(mismatch, bracket)} This campaign cannot tell. The points were run in the order of the "
            f"{' and '.join(diagnosis.blind)} speed, and none was repeated. A drift of any size would look like part "
            f"of the loss curve. Do: {lifting(diagnosis)}"
        )
    if diagnosis.verdict is Verdict.CONSISTENT:
        return (
            "No difference found beyond repeatability "
            f"(p = {mismatch.p_value:.3g}, corrected for multiple testing; limit {mismatch.false_alarm_rate:.0%})."
        )
    sentences = [_place(diagnosis)]
    if diagnosis.naming is None or diagnosis.verdict is Verdict.NOT_IN_LIBRARY:
        closest = f" ({words})" if (words := nearest(diagnosis)) else ""
        none = f"No mechanism of the catalogue explains it{closest}. We can show where, not why."
        sentences.append(faint(diagnosis) or none)
        sentences.append(_shape_sentence(diagnosis))
    elif diagnosis.verdict is Verdict.NAMED:
        sentences.append(f"Cause: {causes(diagnosis, diagnosis.naming.best)}.")
        sentences += [_size(diagnosis, fit) for fit in diagnosis.naming.best.fits]
        sentences += [fitted(diagnosis, i) for i in range(len(diagnosis.naming.best.fits))]
        sentences.append(form_sentences(diagnosis))
        sentences.append(advice(diagnosis))
    else:
        sets = diagnosis.naming.best, *(rival.explanation for rival in diagnosis.rivals)
        known = "; or ".join(causes(diagnosis, each) for each in sets)
        if diagnosis.weak:
            none = "or one that the catalogue does not have"
            sentences.append(f"{why_weak(diagnosis)[1]}. Possible causes: {known}; {none}.")
        else:
            sentences.append(f"These recordings cannot tell between: {known}.")
        sentences += [_size(diagnosis, fit) for fit in diagnosis.naming.best.fits]
        if tests := tuple(rival.test for rival in diagnosis.rivals if rival.test is not None):
            sentences.append(f"Do: {words_of_test(best_test(tests))}")
    sentences += [near(diagnosis), held_out(diagnosis), by_chance(diagnosis)]
    return " ".join(sentence for sentence in sentences if sentence)


def near_decision(diagnosis: Diagnosis) -> GridNaming | None:
    """What the catalogue says where its evidence decided what is named; None elsewhere."""
    decided = diagnosis.verdict in (Verdict.NAMED, Verdict.AMBIGUOUS) and not diagnosis.weak
    return diagnosis.naming if decided else None


def near(diagnosis: Diagnosis) -> str:
    """A word on what was decided by little, naming the other."""
    if (naming := near_decision(diagnosis)) is None:
        return ""
    words = ""
    if naming.level:
        other = causes(diagnosis, naming.level[0])
        words = f"{capitalised(other)} fits as well, to all digits that count: the order of the catalogue "
        words += "decides which comes first."
    if naming.missed:
        missed, short = naming.missed[0]
        words += f"{' ' if words else ''}It was near: {causes(diagnosis, missed)} misses the limit for a rival by "
        words += f"odds of {math.exp(0.5 * short):.1f} to 1."
    return words


def causes(diagnosis: Diagnosis, explanation: GridExplanation) -> str:
    """A set of mechanisms by their titles and shafts."""
    return TOGETHER.join(each_cause(diagnosis, explanation))


def each_cause(diagnosis: Diagnosis, explanation: GridExplanation) -> tuple[str, ...]:
    """Title and shaft of each mechanism of a set."""
    naming = diagnosis.naming
    shafts = (fit.place if naming is None else naming.place_in(explanation, fit) for fit in explanation.fits)
    titles = (uncapitalised(fit.candidate.kind.title) for fit in explanation.fits)
    return tuple(f"{title}{SHAFT_WORDS[shaft]}" for title, shaft in zip(titles, shafts, strict=True))


def _size(diagnosis: Diagnosis, fit: CandidateFit) -> str:
    """What a mechanism leaves in the residual, and its full effect."""
    naming = diagnosis.naming
    assert naming is not None
    subject = "It changes" if len(naming.best.fits) == 1 else f"{fit.candidate.kind.title} changes"
    side, what, size = torque_change(diagnosis, fit)
    full = f"Against {fit.candidate.kind.without}, its full effect is {fit.size * 1e3:.1f} mN m rms"
    left = f"the fitted losses absorb all but {naming.best.problem.visible(fit) * 1e3:.1f} mN m."
    return f"{subject} the {side} {what} by {size} {full}; {left}"


def torque_change(diagnosis: Diagnosis, fit: CandidateFit) -> tuple[str, str, str]:
    """Shaft on which a mechanism leaves most; ``drag``, or ``torque`` of a fault; its change beside repeatability."""
    naming, readings = diagnosis.naming, diagnosis.mismatch.readings
    assert naming is not None
    left, side = naming.best.problem.unabsorbed(fit), shaft_of(diagnosis, fit)
    read = issubclass(fit.candidate.kind, Instrument)
    at = (fit.effect != 0.0) & readings.of_shaft[side]
    change = (left if read else readings.direction * left)[at] * 1e3
    low, high = (numerals.number(float(end), spec="+.1f") for end in (change.min(), change.max()))
    u = diagnosis.floor[side].u * 1e3
    many = " No one point shows it, only many together." if np.abs(change).max() < u else ""
    size = f"{low} to {high} mN m beyond the fitted losses (repeatability is {u:.1f} mN m).{many}"
    return side, "torque" if read else "drag", size


MOSTLY_TAKEN_UP, KNOWN_WELL = 3.0, 0.3
"""Largest torque of a mechanism over what the fitted losses leave of it, from which on both are reported, and relative
standard error below which its first size is told, whatever else is known better."""


def taken_up(diagnosis: Diagnosis, fit: CandidateFit) -> str:
    """Sentence on the largest torque of a mechanism, where the fitted losses take up most of it; else empty."""
    assert diagnosis.naming is not None
    best, of_shaft = diagnosis.naming.best, diagnosis.mismatch.readings.of_shaft[shaft_of(diagnosis, fit)]
    at = (fit.effect != 0.0) & of_shaft
    whole, left = (float(np.abs(each[at]).max()) for each in (fit.effect, best.problem.unabsorbed(fit)))
    words = f" The whole effect is up to {whole * 1e3:.0f} mN m: the fitted losses already hold most of it."
    return words * (whole > MOSTLY_TAKEN_UP * left)


def shaft_of(diagnosis: Diagnosis, fit: CandidateFit) -> str:
    """Shaft on which a mechanism leaves most in the residual."""
    naming, readings = diagnosis.naming, diagnosis.mismatch.readings
    assert naming is not None
    left = np.where(fit.effect != 0.0, naming.best.problem.unabsorbed(fit), 0.0)
    return max(SIDES, key=lambda side: float(np.sum(left[readings.of_shaft[side]] ** 2)))


def fitted(diagnosis: Diagnosis, i: int) -> str:
    """The parameter of a named mechanism that is known best, with its standard uncertainty."""
    naming, found = diagnosis.naming, diagnosis.refit
    if naming is None or found is None:
        return ""
    fit = naming.best.fits[i]
    values, errors = found.values[i], found.standard_errors[i]
    best = _surest(values, errors, len(fit.candidate.sizes))
    first, value, error = fit.candidate.parameters[best], values[best], errors[best]
    factor, unit = displayed(first.unit, float(value), share=issubclass(fit.candidate.kind, Instrument))
    value, error = factor * float(value), factor * float(error)
    number = numerals.measured(value, error) if np.isfinite(error) else f"{value:.3g}"
    instead, other = "", naming.on_the_other_shaft(fit)
    if other is not None:
        there = other.candidate.parameters[best]
        size = factor * float(other.values[best])  # the same column but for its size, so known as well
        known = np.isfinite(error) and value != 0.0
        size_words = numerals.measured(size, abs(size * error / value)) if known else numerals.number(size)
        instead = f", or {there.meaning} {size_words}{unit}"
    powers = [
        f"; {p.meaning} {numerals.measured(float(value), float(error))}"
        for p, value, error in zip(fit.candidate.parameters, values, errors, strict=True)
        if p.name in fit.candidate.powers and np.isfinite(error)
    ]
    return f"Fitted: {first.meaning} {number}{unit}{instead}{''.join(powers)}."


def _surest(values: Array, errors: Array, sizes: int) -> int:
    """The first size where it is known well, else that which is known best, by its standard error over its value."""
    relative = np.nan_to_num(np.abs(errors[:sizes] / np.where(values[:sizes], values[:sizes], np.nan)), nan=np.inf)
    return 0 if relative[0] < KNOWN_WELL else int(np.argmin(relative))


def beyond(mismatch: CampaignMismatch, p_value: str = "") -> str:
    """Whether the readings follow the order of the test, with its p-value in brackets where that is given."""
    if mismatch.found:
        return f"The readings follow the order of the test{p_value}. Drift may be the reason."
    return f"No difference found beyond repeatability{p_value}."


def _shape_sentence(diagnosis: Diagnosis) -> str:
    """The short form of what no mechanism explains, or that none holds up."""
    shape = diagnosis.shape
    if shape is None:
        return "No short formula predicts data not used for the fit."
    names = ", ".join(f"{c.symbol} {c.meaning}" for c in shape.covariates)
    told = f"{shape.text}, with {', '.join(filter(None, (names, constants_in_words(shape))))}"
    return f"An empirical formula describes it ({shape.label}): {told}."


NEAREST_FROM = 0.2
"""Part of what is left that the nearest mechanism must take up to be mentioned."""


def nearest(diagnosis: Diagnosis) -> str:
    """The mechanism that comes nearest, where it takes up a good part of the mismatch."""
    naming = diagnosis.naming
    if naming is None or (share := nearest_share(naming)) < NEAREST_FROM:
        return ""
    leading = naming.best, *naming.rivals[:1]
    sets = (" with ".join(uncapitalised(fit.candidate.kind.title) for fit in each.fits) for each in leading)
    closest = ", or ".join(sets)
    return f"the closest, {closest}, explains {share:.0%} of it, but {why_not_named(naming)}"


def faint(diagnosis: Diagnosis) -> str:
    """What may make a difference that is too faint to exclude anything."""
    if not is_faint(diagnosis):
        return ""
    sets, why = near_causes(diagnosis)
    if not sets:
        return f"No cause can be named: {why}."
    titles = [uncapitalised(fit.candidate.kind.title) for (fit,) in sets]
    return f"No cause can be named. It may be {', '.join([*titles, 'or none of the catalogue'])}: {why}."


def _place(diagnosis: Diagnosis) -> str:
    differ = f"Simulation and recordings differ (p ≤ {diagnosis.mismatch.p_value:.2g})."
    return f"{differ} Most of it: {largest(diagnosis)}"


def largest(diagnosis: Diagnosis) -> str:
    """Where most of the difference is, as a sentence that begins with an article."""
    place = diagnosis.mismatch.locations[0]
    follows = " and ".join(covariate_words(place.depends_on)) or "nothing recorded"
    special = {"all": "in every configuration", "zero": "at the zero checks"}
    where = special.get(place.configuration, f"in {place.configuration} points")
    shaft = place.signal.replace("torque_", "")
    return f"the {shaft} torque {where} depends on {follows} (a pattern of {place.size * 1e3:.1f} mN m rms)."


def by_chance(diagnosis: Diagnosis) -> str:
    """A word on decoys, where one would have passed."""
    decoys = diagnosis.decoys
    if decoys is None or decoys.passed <= 0.05 * decoys.count:
        return ""
    return (
        f"{decoys.passed} of {decoys.count} random smooth curves would have passed as well. "
        "Treat the cause with caution."
    )


def held_out(diagnosis: Diagnosis) -> str:
    """What the cause, or the short form, is worth on readings that took no part in the fit."""
    if (shape := diagnosis.shape) is not None:
        before, after = (rmse * 1e3 for rmse in (shape.held_out.rmse_before, shape.held_out.rmse_after))
        noise = shape.held_out.noise_floor * 1e3
        alone = f"; noise alone makes {noise:.2f} mN m" if noise < after else ""
        drop = f"drops from {before:.2f} to {after:.2f} mN m{alone}"
        return f"With a fitted curve, the error on data not used for the fit {drop}."
    held = diagnosis.held_out
    if held is None:
        return ""
    first = "the first of them" if diagnosis.verdict is Verdict.AMBIGUOUS else "this effect"
    what = first if diagnosis.refit is not None else "this dependence"
    return (
        f"With {what}, the error on data not used for the fit {change_words(held, 2)}; noise alone makes "
        f"{held.noise_floor * 1e3:.2f} mN m."
    )
