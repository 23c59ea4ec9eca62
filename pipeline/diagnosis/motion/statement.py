"""The verdict on runs in motion in sentences."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.engine.conclusion import in_the_main_sentence
from pmg.pipeline.diagnosis.engine.held_out import change_words
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.law_words import bent_sentence
from pmg.pipeline.diagnosis.grid.rivals import nearest_share, why_not_named, why_weak
from pmg.pipeline.diagnosis.grid.statement import NEAREST_FROM, PHRASES
from pmg.pipeline.diagnosis.motion.design.remedy import advice
from pmg.pipeline.diagnosis.motion.evidence import OFF_SHEET
from pmg.pipeline.diagnosis.motion.places import fall_words, falls_at, follows, largest_of, of_sheet, size_of
from pmg.pipeline.diagnosis.motion.traces import named_fits, term_of
from pmg.pipeline.motion.smooth import BAND
from pmg.pipeline.wording.cause_sets import SHAFT_WORDS, TOGETHER
from pmg.pipeline.wording.plurals import uncapitalised
from pmg.pipeline.wording.units import MILLI
from pmg.sim.shafts import SIDES, PerShaft, per_shaft

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.engine.explanation import Explanation
    from pmg.pipeline.diagnosis.engine.held_out import HeldOut
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.sim.signals import Array


def phrase(diagnosis: MotionDiagnosis) -> str:
    """The verdict in a few words: the same in the report, in ``diagnosis.json`` and on the terminal."""
    return why_weak(diagnosis)[0] if diagnosis.weak else PHRASES[diagnosis.verdict]


def statement(diagnosis: MotionDiagnosis, effects: tuple[tuple[Array, ...], ...]) -> str:
    """The verdict in a few sentences; `effects` are those of what is named."""
    mismatch, naming = diagnosis.mismatch, diagnosis.naming
    if not mismatch.found:
        none = (
            "No difference between recordings and model beyond the noise "
            f"(p = {mismatch.p_value:.3g}, corrected for multiple testing; limit {mismatch.false_alarm_rate:.0%})."
        )
        return f"{none}{_unseen(diagnosis)}"
    sentences = [_place(diagnosis)]
    if naming is None or not diagnosis.verdict.names:
        closest = f" ({words})" if (words := nearest(diagnosis)) else ""
        sentences.append(f"No mechanism of the catalogue explains it{closest}. We can show where, not why.")
    elif diagnosis.verdict is Verdict.NAMED:
        sentences.append(f"Cause: {causes(naming.best, naming.shafts)}.")
    else:
        known = "; or ".join(causes(each) for each in (naming.best, *naming.rivals))
        weak = f"{why_weak(diagnosis)[1]}. Possible causes"
        none = "; or one that the catalogue does not have" if diagnosis.weak else ""
        sentences.append(f"{weak if diagnosis.weak else 'These recordings cannot tell between'}: {known}{none}.")
    if diagnosis.verdict is Verdict.CONFOUNDED:
        return f"{' '.join(sentences)}{_unseen(diagnosis)}"
    if naming is not None and naming.best.bent and diagnosis.verdict.names:
        sentences.append(bent_sentence(naming, [name for fit in naming.best.fits for name in term_of(fit).follows]))
    if diagnosis.before.origins and any(term_of(fit).of_turn for fit in named_fits(diagnosis)):
        sentences += dict.fromkeys(origins.sentence for origins in diagnosis.before.origins)
    sentences += [_size(diagnosis, i, effect) for i, effect in enumerate(effects)]
    sentences += [proof_sentence(diagnosis), advice(diagnosis)]
    return " ".join(sentence for sentence in sentences if sentence)


def _unseen(diagnosis: MotionDiagnosis) -> str:
    """What the runs could not have shown, and the run that would."""
    if not diagnosis.unseen:
        return ""
    spots = [f"{spot.words}{SHAFT_WORDS[spot.term.shaft]}" for spot in diagnosis.unseen]
    return f" These runs could not have shown: {'; '.join(spots)}. {advice(diagnosis)}"


def nearest(diagnosis: MotionDiagnosis) -> str:
    """The mechanism that comes nearest, where it takes up a good part of the difference, and why it is not named."""
    naming = diagnosis.naming
    if naming is None or (share := nearest_share(naming)) < NEAREST_FROM:
        return ""
    return f"the closest, {causes(naming.best)}, explains {share:.0%} of it, but {why_not_named(naming, 'runs')}"


def causes(explanation: Explanation[TermFit, Any], shafts: dict[str, str] | None = None) -> str:
    """A set of mechanisms by their titles and shafts."""
    return TOGETHER.join(each_cause(explanation, shafts))


def each_cause(explanation: Explanation[TermFit, Any], shafts: dict[str, str] | None = None) -> tuple[str, ...]:
    """Title and shaft of each mechanism of a set."""
    places = (SHAFT_WORDS[(shafts or {}).get(fit.identifier, fit.place)] for fit in explanation.fits)
    return tuple(
        f"{uncapitalised(f.candidate.title)}{where}" for f, where in zip(explanation.fits, places, strict=True)
    )


def row_noise_of(diagnosis: MotionDiagnosis) -> PerShaft[float]:
    """Standard deviation of the torque of a row [N m]: white noise of the transducers up to the band of the rows."""

    def of(side: str) -> float:
        densities = [s.shaft.density for s in diagnosis.before.stretches if s.side == side]
        return float(np.sqrt(np.median(densities) * BAND)) if densities else 0.0

    return per_shaft(of)


def _in_torque(diagnosis: MotionDiagnosis) -> float:
    """Torque of one unit of whitened rows [N m]: noise of a row, the mean over the rows of both shafts."""
    noise, rows = row_noise_of(diagnosis), dict.fromkeys(SIDES, 0)
    for stretch in diagnosis.before.stretches:
        rows[stretch.side] += len(stretch)
    mean_square = sum(noise[side] ** 2 * rows[side] for side in SIDES) / max(sum(rows.values()), 1)
    return float(np.sqrt(mean_square)) * diagnosis.evidence.scatter


def _place(diagnosis: MotionDiagnosis) -> str:
    """That something differs, and where; beside a named cause, no constant that took up a part of it."""
    differ = f"Model and recordings differ (p ≤ {diagnosis.mismatch.p_value:.2g})."
    if not (where := largest_place(diagnosis)):
        return differ
    constant = largest_of(diagnosis).family.configuration == OFF_SHEET
    return differ if constant and diagnosis.verdict is Verdict.NAMED else f"{differ} Most of it: {where}"


def largest_place(diagnosis: MotionDiagnosis) -> str:
    """Where the difference is largest, as a sentence that begins with an article; empty where no place is clear."""
    if not diagnosis.mismatch.locations:
        return ""
    place = largest_of(diagnosis)
    if falls := falls_at(diagnosis, place):
        return f"{fall_words(falls)}, fitted without a cause."
    size = f"{size_of(diagnosis, place) / MILLI:.1f} mN m rms"
    if place.family.configuration != OFF_SHEET:
        where = f"the {place.family.side} torque in {place.family.configuration} runs"
        return f"{where} follows the {follows(place)} ({size} beyond the fitted constants)."
    sheet, at = diagnosis.before.sheet, of_sheet(diagnosis, place)
    apart = (diagnosis.before.values[at] - sheet.expected[at]) / sheet.spread[at]
    distance = f"{apart[0]:+.1f}".replace("-", "−") if len(apart) == 1 else f"{np.linalg.norm(apart):.1f}"
    far = f"fitted without a cause, it lies {distance} standard uncertainties off"
    return f"the {follows(place)} is not that of the data sheet (worth {size}); {far}."


def _size(diagnosis: MotionDiagnosis, i: int, effect: tuple[Array, ...]) -> str:
    """Effect of a named mechanism against the noise, and its size."""
    noise = row_noise_of(diagnosis)
    rms, peak, side = effect_size(diagnosis, effect)
    subject = "It changes" if len(named_fits(diagnosis)) == 1 else f"{named_fits(diagnosis)[i].candidate.title} changes"
    return (
        f"{subject} the {side} torque by {rms / MILLI:.1f} mN m rms, up to {peak / MILLI:.0f} mN m; the noise is "
        f"{noise[side] / MILLI:.1f} mN m. {diagnosis.fitted_sizes[i].sentence}"
    )


def effect_size(diagnosis: MotionDiagnosis, effect: tuple[Array, ...]) -> tuple[float, float, str]:
    """Root mean square and peak [N m] of an effect on the side where it is larger, over its rows there; that side."""
    stretches = diagnosis.before.stretches
    of = {side: [e for e, s in zip(effect, stretches, strict=True) if s.side == side and e.any()] for side in SIDES}
    joined = {side: np.concatenate([np.zeros(1), *parts]) for side, parts in of.items()}
    side = max(SIDES, key=lambda side: float(joined[side] @ joined[side]))
    values = joined[side]
    return float(np.sqrt(values @ values / max(len(values) - 1, 1))), float(np.abs(values).max()), side


def held_out_in_torque(diagnosis: MotionDiagnosis) -> HeldOut | None:
    """The proof on withheld kinds of run in torque, by the noise of a row [N m]."""
    held = diagnosis.held_out
    if held is None:
        return None
    unit = _in_torque(diagnosis)

    def turned(value: float | None) -> float | None:
        return None if value is None else unit * value

    return replace(
        held,
        split=f"{held.split}; errors are whitened, one is the noise of a row, {unit / MILLI:.2g} mN m",
        rmse_before=unit * held.rmse_before,
        rmse_after=unit * held.rmse_after,
        noise_floor=unit * held.noise_floor,
        gain_interval=(unit * held.gain_interval[0], unit * held.gain_interval[1]),
        placebo_gain=turned(held.placebo_gain),
        expected_before=turned(held.expected_before),
        expected_after=turned(held.expected_after),
    )


def proof_sentence(diagnosis: MotionDiagnosis) -> str:
    """What the cause is worth on runs that took no part in the fit; empty where it was not proved."""
    held = held_out_in_torque(diagnosis)
    if held is None:
        return ""
    digits = 1 if f"{held.rmse_before / MILLI:.1f}" != f"{held.rmse_after / MILLI:.1f}" else 2
    main = (
        "" if diagnosis.weak and not diagnosis.in_part else in_the_main_sentence(diagnosis.naming, diagnosis.held_out)
    )
    return (
        f"With it in the model, the error on runs not used for the fit {change_words(held, digits)}; noise alone makes "
        f"{held.noise_floor / MILLI:.{digits}f} mN m. {_fall_sentence(diagnosis)}{main}"
    ).rstrip()


def _fall_sentence(diagnosis: MotionDiagnosis) -> str:
    """What tells a cause that a loss curve of free form would take up; empty of others."""
    shafts = {term_of(fit).shaft for fit in named_fits(diagnosis)}
    falls = [each for each in diagnosis.before.sheet.sums if each.side in shafts]
    return f"What tells it is that, without it, {fall_words(falls)}. " if falls else ""
