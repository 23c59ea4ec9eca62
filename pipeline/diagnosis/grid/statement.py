"""The verdict in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.design.next_test import HIDDEN
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.wording import numerals
from pmg.pipeline.wording.numerals import measured
from pmg.sim.mechanisms.base import Instrument
from pmg.sim.signals import MINUTE

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.catalogue import GridExplanation, GridNaming
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.diagnosis.grid.locate import CampaignMismatch
    from pmg.sim.signals import Array

SHAFT_WORDS = {
    "sun": " on the sun shaft",
    "ring": " on the ring shaft",
    "both": "",
    "either": " (which shaft cannot be told: the same error with the other sign on the other one reads alike)",
}


def statement(diagnosis: Diagnosis) -> str:
    """The verdict in a few sentences."""
    told = _told(diagnosis)
    if not diagnosis.outliers:
        return told
    several = len(diagnosis.outliers) > 1
    names = ", ".join(diagnosis.outliers[:5]) + (" ..." if len(diagnosis.outliers) > 5 else "")
    return (
        f"{told} {len(diagnosis.outliers)} point{'s' if several else ''} that stand{'' if several else 's'} out by "
        f"{'themselves' if several else 'itself'} ({names}) {'were' if several else 'was'} set aside first."
    )


def _told(diagnosis: Diagnosis) -> str:
    mismatch = diagnosis.mismatch
    if diagnosis.verdict is Verdict.CONFOUNDED:
        return (
            f"{_beyond(mismatch)} This campaign cannot tell: the points were run in the order of the "
            f"{' and '.join(diagnosis.blind)} speed and none was repeated: a slow change, however large, would pass "
            f"for part of the loss curve.{_lifting(diagnosis)}"
        )
    if diagnosis.verdict is Verdict.CONSISTENT:
        return (
            f"No mismatch beyond the noise (p = {mismatch.p_value:.3g} over {mismatch.tested} kinds of structure, "
            f"judged at {mismatch.false_alarm_rate:.0%})."
        )
    sentences = [_place(diagnosis)]
    if diagnosis.naming is None or diagnosis.verdict is Verdict.NOT_IN_LIBRARY:
        sentences.append(f"No mechanism of the catalogue explains it{_nearest(diagnosis)}. We can show where, not why.")
        sentences.append(_shape_sentence(diagnosis))
    elif diagnosis.verdict is Verdict.NAMED:
        sentences.append(f"Cause: {_causes(diagnosis, diagnosis.naming.best)}.")
        sentences.append(_settled_by(diagnosis.naming))
    else:
        sets = [_causes(diagnosis, diagnosis.naming.best)]
        sets += [_causes(diagnosis, rival.explanation) for rival in diagnosis.rivals]
        known = "; or ".join(sets)
        if diagnosis.weak:
            sentences.append(f"It is too weak to name its cause. Possible causes: {known}.")
        else:
            sentences.append(f"These recordings cannot tell between: {known}.")
        tests = [rival.test for rival in diagnosis.rivals if rival.test is not None]
        if tests:
            test = max(tests, key=lambda test: test.power)
            sentences.append(
                f"{test.plan.description} would tell ({test.plan.seconds / MINUTE:.0f} min, power {test.power:.0%})."
            )
    sentences.append(_held_out(diagnosis))
    sentences.append(_by_chance(diagnosis))
    return " ".join(sentence for sentence in sentences if sentence)


def _causes(diagnosis: Diagnosis, explanation: GridExplanation) -> str:
    """A set of mechanisms in words: what is left to see of each, and its whole effect against a bench without it."""
    shafts = diagnosis.naming.shafts if diagnosis.naming is not None else {}
    words = []
    found = diagnosis.refit
    for i, fit in enumerate(explanation.fits):
        own = diagnosis.naming is not None and explanation is diagnosis.naming.best
        shaft = shafts.get(fit.candidate.identifier, fit.candidate.shaft) if own else fit.candidate.shaft
        title = fit.candidate.kind.title
        told = (
            f"{title[0].lower()}{title[1:]}{SHAFT_WORDS[shaft]}, "
            f"{explanation.problem.visible(fit) * 1e3:.1f} mN m rms beyond what the baseline takes up, "
            f"of {fit.size * 1e3:.1f} against {fit.candidate.kind.without}"
        )
        if own and found is not None:
            best = _surest(found.values[i], found.standard_errors[i], len(fit.candidate.sizes))
            first, value, error = fit.candidate.parameters[best], found.values[i][best], found.standard_errors[i][best]
            number = measured(float(value), float(error)) if np.isfinite(error) else f"{value:.3g}"
            unit = "" if first.unit == "1" else f" {first.unit}"
            other = None if diagnosis.naming is None else diagnosis.naming.on_the_other_shaft(fit)
            instead = ""
            if other is not None:
                there = other.candidate.parameters[best]
                instead = f", or {there.meaning} {numerals.number(float(other.values[best]), spec='.3g')}{unit}"
            told += f" ({first.meaning} {number}{unit}{instead})"
        words.append(told)
    return " together with ".join(words)


def _settled_by(naming: GridNaming) -> str:
    """What tells the shaft of a fault of a reading, where the points cannot."""
    faults = [fit for fit in naming.best.fits if issubclass(fit.candidate.kind, Instrument)]
    if not any(naming.on_the_other_shaft(fit) for fit in faults):
        return ""
    return "Calibrating one of the two transducers, or exchanging them and repeating loaded points, tells which."


def _surest(values: Array, errors: Array, sizes: int) -> int:
    """The size that is known best, by its standard error over its value; the first where none has one."""
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.abs(errors[:sizes] / values[:sizes])
    return int(np.argmin(np.where(np.isfinite(relative), relative, np.inf)))


def _beyond(mismatch: CampaignMismatch) -> str:
    if mismatch.found:
        return f"Something follows the order of the test (p ≤ {mismatch.p_value:.2g}), and a slow change may make it."
    return f"No mismatch beyond the noise (p = {mismatch.p_value:.3g})."


def _lifting(diagnosis: Diagnosis) -> str:
    test = diagnosis.lifting
    if test is None:
        return " Repeat points spread over the grid, in random order."
    return (
        f" {test.plan.description} would tell ({test.plan.seconds / MINUTE:.0f} min; it shows a change of "
        f"{HIDDEN:g} noise floors with power {test.power:.0%})."
    )


def _shape_sentence(diagnosis: Diagnosis) -> str:
    """The short form and its error on withheld readings, or that none holds up."""
    shape = diagnosis.shape
    if shape is None:
        return "No short form of what it follows holds up on withheld readings."
    names = ", ".join(f"{c.symbol} {c.meaning}" for c in shape.covariates)
    return (
        f"A short form that holds up on withheld readings ({shape.label}): {shape.text}"
        f"{f', with {names}' if names else ''}; their error falls from {shape.held_out.rmse_before * 1e3:.2f} to "
        f"{shape.held_out.rmse_after * 1e3:.2f} mN m."
    )


NEAREST_FROM = 0.2
"""Part of what is left that the nearest mechanism must take up to be mentioned."""


def _nearest(diagnosis: Diagnosis) -> str:
    """The mechanism that comes nearest, where it takes up a good part of the mismatch."""
    if diagnosis.naming is None or not diagnosis.naming.best.fits:
        return ""
    naming = diagnosis.naming
    share = naming.best.gain / (naming.best.gain + naming.remainder.excess)
    if share < NEAREST_FROM:
        return ""
    titles = " with ".join(fit.candidate.kind.title for fit in naming.best.fits)
    others = [" with ".join(fit.candidate.kind.title for fit in rival.fits) for rival in naming.rivals[:1]]
    rival = f", or {others[0]}," if others else ""
    return f" ({titles[0].lower()}{titles[1:]}{rival} takes up {share:.0%} of it)"


def _place(diagnosis: Diagnosis) -> str:
    place = diagnosis.mismatch.locations[0]
    follows = " and ".join(word.replace("_", " ") for word in place.depends_on) or "nothing that was recorded"
    special = {"all": "in every configuration", "zero": "at the zero checks"}
    where = special.get(place.configuration, f"in {place.configuration} points")
    return (
        f"Simulation and recordings differ (p ≤ {diagnosis.mismatch.p_value:.2g}). Most of it: the "
        f"{place.signal.replace('torque_', '')} torque {where} depends on {follows} ({place.size * 1e3:.1f} mN m rms)."
    )


def _by_chance(diagnosis: Diagnosis) -> str:
    """A word on decoys, where one would have passed."""
    decoys = diagnosis.decoys
    if decoys is None or decoys.passed <= 0.05 * decoys.count:
        return ""
    return (
        f"{decoys.passed} of {decoys.count} random smooth structures would have passed as well: the mismatch has "
        "little shape of its own."
    )


def _held_out(diagnosis: Diagnosis) -> str:
    held = diagnosis.held_out
    if held is None or diagnosis.shape is not None:  # the short form has told its own error
        return ""
    low, high = held.gain_interval
    change = "drops" if low > 0.0 else ("rises" if high < 0.0 else "does not clearly drop:")
    what = "this effect" if diagnosis.refit is not None else "that structure (its kind chosen on all readings)"
    return (
        f"With {what} in the model, the error on data not used for the fit {change} from "
        f"{held.rmse_before * 1e3:.2f} to {held.rmse_after * 1e3:.2f} mN m; "
        f"repeatability is {held.noise_floor * 1e3:.2f} mN m."
    )
