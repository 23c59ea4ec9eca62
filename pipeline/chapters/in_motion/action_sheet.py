"""What to do about a campaign in motion: the first screen of its report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.bench_parts import GROUNDS, SHEET, parts_of, surely_differs
from pmg.pipeline.chapters.in_motion.picture import clearest_part, sheet_picture
from pmg.pipeline.diagnosis.design.direct_check import nothing_yet
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.track_record import IN_MOTION, track_record
from pmg.pipeline.diagnosis.motion.design.remedy import bench_actions, next_run, telling_runs, would_tell
from pmg.pipeline.diagnosis.motion.design.torque_apart import torque_apart
from pmg.pipeline.diagnosis.motion.places import where_to_look
from pmg.pipeline.diagnosis.motion.statement import (
    causes,
    each_cause,
    effect_size,
    largest_place,
    nearest,
    phrase,
    proof_sentence,
    row_noise_of,
)
from pmg.pipeline.diagnosis.motion.traces import named_fits, term_of
from pmg.pipeline.report.action_sheet import ActionSheet, SheetAnswer
from pmg.pipeline.wording.cause_sets import SHAFT_WORDS, numbered
from pmg.pipeline.wording.plurals import capitalised, counted, uncapitalised
from pmg.pipeline.wording.units import MILLI

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.pipeline.diagnosis.motion.traces import TorqueTrace
    from pmg.sim.signals import Array

GEAR_LOSSES = (
    "gear_hysteresis",
    "load_dependent_iron_loss",
    "eddy_skin_effect",
    "engaged_dry_friction",
    "residual_magnetic_coupling",
)
"""Mechanisms in the gear that take power."""


def action_sheet(
    diagnosis: MotionDiagnosis,
    document: dict[str, Any],
    effects: tuple[tuple[Array, ...], ...],
    traces: tuple[TorqueTrace, ...],
) -> ActionSheet:
    """The sheet of a campaign in motion.

    Parameters
    ----------
    diagnosis : MotionDiagnosis
        What was found.
    document : dict
        The same as ``diagnosis.json``.
    effects : tuple of tuple of array
        Torque of what is named, at the rows of each stretch [N m].
    traces : tuple of TorqueTrace
        Measured and predicted torque of each stretch.
    """
    return ActionSheet(
        tuple(_answers(diagnosis, effects, traces)), parts_of(document), sheet_picture(diagnosis, effects, traces)
    )


def _answers(
    diagnosis: MotionDiagnosis, effects: tuple[tuple[Array, ...], ...], traces: tuple[TorqueTrace, ...]
) -> Iterator[SheetAnswer]:
    naming, named = diagnosis.naming, named_fits(diagnosis)
    title = capitalised(phrase(diagnosis))
    if naming is not None and diagnosis.verdict is Verdict.NAMED:
        fitted = (size.sentence for size in diagnosis.fitted_sizes)
        yield SheetAnswer("Verdict", (f"{title}: {causes(naming.best, naming.shafts)}.", *fitted), "mechanisms")
    else:
        yield SheetAnswer("Verdict", (f"{title}.",), GROUNDS)
    yield SheetAnswer(
        "What differs", tuple(_difference(diagnosis, effects)), "locations" * bool(diagnosis.mismatch.locations)
    )
    if naming is not None and diagnosis.verdict is Verdict.AMBIGUOUS:
        listed = numbered([each_cause(e) for e in (naming.best, *naming.rivals)], others=diagnosis.weak)
        unknown = ("Or one that the catalogue does not have.",) if diagnosis.weak else ()
        yield SheetAnswer("Possible causes", (*listed, *unknown), "rivals")
    elif diagnosis.mismatch.found and diagnosis.verdict in (Verdict.NOT_IN_LIBRARY, Verdict.CONFOUNDED):
        closest = (f"{capitalised(words)}.",) if (words := nearest(diagnosis)) else ()
        of = "that these runs can show" if diagnosis.unseen else "of the catalogue"
        yield SheetAnswer("Cause", (f"No mechanism {of} explains it: we can show where, not why.", *closest))
    yield SheetAnswer("How sure", _sureness(diagnosis), GROUNDS)
    if diagnosis.unseen:
        spots = (f"{spot.words}{SHAFT_WORDS[spot.term.shaft]}" for spot in diagnosis.unseen)
        yield SheetAnswer("Not visible", (f"These runs could not have shown: {'; '.join(spots)}.",))
    yield SheetAnswer("On the bench", (_action(diagnosis),))
    yield SheetAnswer("Next test", (_next(diagnosis, effects, traces),), "next-tests" * bool(telling_runs(diagnosis)))
    yield SheetAnswer("In the model", (IN_THE_MODEL[diagnosis.verdict],))
    if costs := tuple(_costs(named, effects, traces)):
        first = ("If it is the first:",) if diagnosis.verdict is Verdict.AMBIGUOUS else ()
        yield SheetAnswer("If ignored", (*first, *costs))
    elif diagnosis.verdict is Verdict.CONSISTENT:
        yield SheetAnswer("If ignored", ("Nothing: no difference beyond the noise.",))
    elif not diagnosis.mismatch.found:
        yield SheetAnswer("If ignored", ("Unknown: a fault that these runs cannot show has no known size.",))


IN_THE_MODEL = {
    Verdict.NAMED: "`model.toml` holds the cause: predict other runs with it (`pmg compare --model model.toml`).",
    Verdict.AMBIGUOUS: "Add none of the causes before the next test.",
    Verdict.NOT_IN_LIBRARY: "There is no known term to add; the fitted constants stand in the chapter on the bench.",
    Verdict.CONFOUNDED: "The fitted constants may hold a fault that these runs cannot show.",
    Verdict.CONSISTENT: "`model.toml` holds the fitted constants: predict with it (`pmg compare --model model.toml`).",
}
"""What to do with the model that a comparison leaves."""


def _action(diagnosis: MotionDiagnosis) -> str:
    """What to do on the bench."""
    if diagnosis.verdict is Verdict.NAMED:
        words = "; ".join(bench_actions(diagnosis))
        return f"{capitalised(words)}." if words else "Nothing to repair: this is physics the model lacks."
    if not diagnosis.mismatch.found:
        return "Nothing."
    if diagnosis.next_runs:
        return nothing_yet(diagnosis.naming, test_tells=would_tell(diagnosis))
    return f"Inspect {where_to_look(diagnosis)}."


def _next(diagnosis: MotionDiagnosis, effects: tuple[tuple[Array, ...], ...], traces: tuple[TorqueTrace, ...]) -> str:
    """Which run is next."""
    if diagnosis.next_runs:
        return f"{capitalised(next_run(diagnosis))}.{f' Its sheet: {SHEET}.' * bool(telling_runs(diagnosis))}"
    if not diagnosis.mismatch.found:
        return "None is needed."
    if diagnosis.verdict is Verdict.NAMED:
        return _confirming(diagnosis)
    clearest = clearest_part(diagnosis, effects, traces)
    again = "" if clearest is None else f" {clearest[0].stretch.run.run.point}, in which most torque is missing,"
    return f"Record the run{again} again: what shows again is of bench or model, the rest changes with time."


def _confirming(diagnosis: MotionDiagnosis) -> str:
    """The run that would confirm a named cause, and how far off it would be without it."""
    if (test := diagnosis.confirming) is None:
        return "Not needed; to confirm the cause, record a further run and compare it with `model.toml`."
    off = [torque_apart(diagnosis.evidence, run, named_fits(diagnosis), ((),))[0] for run in test.runs]
    size, side = max((size, side) for of_run in off for side, size in of_run.items())
    run = f"{uncapitalised(test.title)} ({test.minutes:.0f} min), compared with `model.toml`"
    return (
        f"To confirm: {run}; without the cause its {side} torque would be off by {size / MILLI:.1f} mN m rms. "
        f"Its sheet: {SHEET}."
    )


def _difference(diagnosis: MotionDiagnosis, effects: tuple[tuple[Array, ...], ...]) -> Iterator[str]:
    """What is not as the model has it: by how much a cause changes a torque, or where most of the difference is."""
    noise, where = row_noise_of(diagnosis), largest_place(diagnosis)
    if not diagnosis.mismatch.found:
        names = {stretch.run.run.name for stretch in diagnosis.before.stretches}
        yield f"Nothing beyond the noise: the model predicts the torque of {counted(len(names), 'run')}."
    elif not effects:
        yield capitalised(where) if where else "Model and recordings differ, at no clear place."
    for fit, effect in zip(named_fits(diagnosis), effects, strict=True):
        rms, peak, side = effect_size(diagnosis, effect)
        which = "first possible " * (diagnosis.verdict is not Verdict.NAMED)
        subject = f"The {which}cause" if len(effects) == 1 else fit.candidate.title
        size = f"by {rms / MILLI:.1f} mN m rms, up to {peak / MILLI:.0f} mN m; noise is {noise[side] / MILLI:.1f} mN m."
        yield f"{subject} changes the {side} torque of {_runs(diagnosis.before.stretches, effect, side)} {size}"


def _runs(stretches: tuple[RotorRows, ...], effect: tuple[Array, ...], side: str) -> str:
    """Runs in which an effect acts on the torque of a shaft, in words."""
    of_side = [
        (stretch, bool(acts.any())) for stretch, acts in zip(stretches, effect, strict=True) if stretch.side == side
    ]
    moving = [(stretch.run.run.name, stretch.coupled, acts) for stretch, acts in of_side if not stretch.at_rest]
    acting = {name for name, _, acts in moving if acts}
    if not acting:
        return "the recordings at rest" if any(acts for _, acts in of_side) else "no run"
    coupled = {each for _, each, acts in moving if acts}
    kind = "" if len(coupled) == 2 else "engaged " if coupled == {True} else "neutral "
    every = {name for name, each, _ in moving if each in coupled}
    return f"all {kind}runs" if acting == every else f"{len(acting)} of {counted(len(every), f'{kind}run')}"


def _sureness(diagnosis: MotionDiagnosis) -> tuple[str, ...]:
    mismatch = diagnosis.mismatch
    alarms = f"{mismatch.false_alarm_rate:.0%} of sound campaigns would raise an alarm."
    if not mismatch.found:
        return (f"{mismatch.tested} kinds of dependence were tested.", alarms)
    record = track_record(diagnosis, IN_MOTION)
    held = "" if record is None or diagnosis.verdict is Verdict.NOT_IN_LIBRARY else record.sentence
    differs = surely_differs(diagnosis.verdict, mismatch.p_value)
    sentences = tuple(filter(None, (differs, proof_sentence(diagnosis), held)))
    return sentences or (f"p ≤ {mismatch.p_value:.2g}, corrected for multiple testing.", alarms)


def _costs(
    named: tuple[TermFit, ...], effects: tuple[tuple[Array, ...], ...], traces: tuple[TorqueTrace, ...]
) -> Iterator[str]:
    """Power by which a model without the losses that are named is wrong, and readings with a fault of theirs."""
    kinds = {"The power that a model without it predicts": False, "Power from these readings": True}
    for what, reading in kinds.items():
        own = [
            of_fit
            for fit, of_fit in zip(named, effects, strict=True)
            if term_of(fit).of_transducer is reading and (reading or _loses(term_of(fit)))
        ]
        wrong: dict[str, list[tuple[Array, Array]]] = {}
        for place, trace in enumerate(traces):
            effect = np.asarray(sum((of_fit[place] for of_fit in own), np.zeros(len(trace.stretch))))
            if effect.any() and not trace.stretch.at_rest:
                speed = trace.stretch.of_rows(trace.state.speed)
                carried = trace.stretch.torque * speed * float(trace.stretch.coupled)
                wrong.setdefault(trace.stretch.side, []).append((effect * speed, carried))
        joined = {side: tuple(map(np.concatenate, zip(*parts, strict=True))) for side, parts in wrong.items()}
        if not joined:
            continue
        side = max(joined, key=lambda side: float(np.mean(joined[side][0] ** 2)))
        power, carried = joined[side]
        loaded = carried != 0.0
        rms = float(np.sqrt(np.mean(power[loaded] ** 2 if loaded.any() else power**2)))
        size = f"{rms:.2g} W rms on the {side} shaft"
        if loaded.any():
            size += f" under load, {rms / np.sqrt(np.mean(carried[loaded] ** 2)):.1%} of the rms power carried there"
        yield f"{what} is wrong by {size}; the largest error at any one time is {np.abs(power).max():.2g} W."


def _loses(term: MotionTerm) -> bool:
    """Whether a mechanism takes power from a shaft: a drag, not a mass, a spring or a wave of the turn."""
    drags = not term.constants and ("bearing" in term.component)
    return drags or term.identifier in GEAR_LOSSES
