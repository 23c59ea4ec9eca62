"""What to do about a campaign of steady points: the first screen of its report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.bench_parts import GROUNDS, bench_parts
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.diagnosis import component_of
from pmg.pipeline.diagnosis.grid.statement import (
    EXTENDED,
    advice,
    beyond,
    by_chance,
    causes,
    drag_change,
    faint,
    fitted,
    held_out,
    largest,
    lifting,
    near,
    nearest,
    phrase,
    shape_sentence,
)
from pmg.pipeline.diagnosis.grid.track_record import track_record
from pmg.pipeline.report.action_sheet import ActionSheet, SheetAnswer
from pmg.pipeline.report.document import Chart, Figure, Series
from pmg.pipeline.wording.plurals import counted
from pmg.sim.mechanisms.base import Instrument
from pmg.sim.shafts import SIDES
from pmg.sim.signals import MINUTE, RESIDUAL, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

    from pmg.pipeline.diagnosis.grid.catalogue import GridExplanation
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.sim.signals import Array


def action_sheet(diagnosis: Diagnosis, residual: Array, before: str = "") -> ActionSheet:
    """The sheet of a campaign of steady points.

    Parameters
    ----------
    diagnosis : Diagnosis
        What was found.
    residual : (m,) array
        Measured minus simulated at the readings of the test [N m].
    before : str
        Which model was given, where one was, as a phrase that ends in a colon; may be empty.
    """
    naming = diagnosis.naming
    named = tuple(
        (fit.candidate.kind.component_on(fit.candidate.shaft), naming.shafts.get(fit.identifier, fit.candidate.shaft))
        for each in _possible(diagnosis)
        for fit in each.fits
        if naming is not None
    )
    places = diagnosis.mismatch.locations
    parts = bench_parts(
        named,
        sure=diagnosis.verdict is Verdict.NAMED,
        place=component_of(places[0]) if places else None,
        signal=places[0].signal if places else "",
    )
    return ActionSheet(tuple(_answers(diagnosis, residual, before)), parts, _picture(diagnosis, residual))


def _possible(diagnosis: Diagnosis) -> tuple[GridExplanation, ...]:
    """The sets of causes that a verdict leaves, the leading one first; none where it names none."""
    if diagnosis.naming is None or not diagnosis.verdict.names:
        return ()
    return (diagnosis.naming.best, *(rival.explanation for rival in diagnosis.rivals))


def _answers(diagnosis: Diagnosis, residual: Array, before: str) -> Iterator[SheetAnswer]:
    naming, verdict = diagnosis.naming, diagnosis.verdict
    title = phrase(diagnosis)
    yield SheetAnswer("Verdict", (f"{title[0].upper()}{title[1:]}.",), GROUNDS)
    if before:
        yield SheetAnswer("About", (f"What is left {before[0].lower()}{before[1:].rstrip(': ')}.",))
    yield SheetAnswer("What differs", tuple(_difference(diagnosis)), "locations" * bool(diagnosis.mismatch.locations))
    if naming is not None and verdict is Verdict.NAMED:
        cause = causes(diagnosis, naming.best)
        sizes = (fitted(diagnosis, i) for i in range(len(naming.best.fits)))
        yield SheetAnswer("Cause", (f"{cause[0].upper()}{cause[1:]}.", *sizes), "mechanisms")
    elif naming is not None and verdict is Verdict.AMBIGUOUS:
        sets = [causes(diagnosis, each) for each in _possible(diagnosis)]
        listed = tuple(f"{i}. {each[0].upper()}{each[1:]}." for i, each in enumerate(sets, 1))
        unknown = ("Or one that the catalogue does not have.",) if diagnosis.weak else ()
        yield SheetAnswer("Possible causes", (*listed, *unknown), "rivals" * bool(diagnosis.rivals))
    elif verdict is Verdict.NOT_IN_LIBRARY:
        none = f"No mechanism of the catalogue explains it{nearest(diagnosis)}. We can show where, not why."
        yield SheetAnswer(
            "Cause", (faint(diagnosis) or none, _shape(diagnosis)), "shape-constants" * bool(diagnosis.shape)
        )
    if sure := tuple(_sureness(diagnosis)):
        yield SheetAnswer("How sure", sure, GROUNDS)
    yield SheetAnswer("On the bench", tuple(_actions(diagnosis)), "next-tests" * bool(diagnosis.next_tests))
    yield SheetAnswer("In the model", (IN_THE_MODEL[verdict],))
    if cost := tuple(_cost(diagnosis, residual) if diagnosis.refit is not None else _cost_of_places(diagnosis)):
        yield SheetAnswer("If ignored", cost)


def _difference(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.verdict is Verdict.CONFOUNDED:
        yield beyond(diagnosis.mismatch)
        shafts = " and ".join(diagnosis.blind)
        yield f"The points were run in the order of the {shafts} speed, and none was repeated."
        yield "A drift of any size would look like part of the loss curve."
    elif not diagnosis.mismatch.found:
        points = counted(int(diagnosis.mismatch.readings.grid.accepted.sum()), "point")
        yield f"Nothing beyond repeatability: the model predicts the torques of {points}."
    elif diagnosis.refit is not None and diagnosis.naming is not None:
        fits = diagnosis.naming.best.fits
        for fit in fits:
            side, size = drag_change(diagnosis, fit)
            why = (
                ""
                if len(fits) == 1
                else f" because of {fit.candidate.kind.title[0].lower()}{fit.candidate.kind.title[1:]}"
            )
            yield f"The {side} drag is off{why}: {size}"
    else:
        where = largest(diagnosis)
        yield f"{where[0].upper()}{where[1:]}"
    if diagnosis.outliers:
        yield f"{counted(len(diagnosis.outliers), 'outlier')} excluded first."


def _shape(diagnosis: Diagnosis) -> str:
    """What the short form gains; the formula itself stands in its grounds."""
    if diagnosis.shape is None:
        return shape_sentence(diagnosis)
    label, proof = diagnosis.shape.label, diagnosis.shape.held_out
    before, after = (f"{rmse / RESIDUAL.scale:.2f}" for rmse in (proof.rmse_before, proof.rmse_after))
    return f"A formula ({label}) takes the error on data not used for the fit from {before} to {after} mN m."


def _sureness(diagnosis: Diagnosis) -> Iterator[str]:
    mismatch = diagnosis.mismatch
    if proof := held_out(diagnosis):
        yield proof
    if (record := track_record(diagnosis)) is not None:
        yield record.sentence
    if not mismatch.found:
        yield f"{counted(mismatch.tested, 'kind')} of dependence tested."
        yield f"{mismatch.false_alarm_rate:.0%} of campaigns without a difference raise an alarm."
    yield from (sentence for sentence in (near(diagnosis), by_chance(diagnosis)) if sentence)


def _actions(diagnosis: Diagnosis) -> Iterator[str]:
    """What to do on the bench and in the model; the test that would tell, where a question is open."""
    naming, tests = diagnosis.naming, diagnosis.next_tests
    if diagnosis.verdict is Verdict.NAMED and naming is not None:
        words = advice(naming).removeprefix("Do: ").removesuffix(f"{EXTENDED}.").removesuffix(", or ").rstrip(".")
        yield f"{words[0].upper()}{words[1:]}." if words else "Nothing to repair: this is physics the model lacks."
        if not any(issubclass(fit.candidate.kind, Instrument) for fit in naming.best.fits):
            yield "To confirm it, run the points of `pmg next --store STORE --out DIR`."
    elif diagnosis.verdict is Verdict.CONFOUNDED:
        yield lifting(diagnosis).removeprefix(" Do: ")
    elif tests:
        best = max(tests, key=lambda test: (test.power, -test.plan.seconds))
        first = best.plan.description
        minutes = f"{best.plan.seconds / MINUTE:.0f} min"
        yield f"{first[0].upper()}{first[1:]} ({minutes}; it tells with a probability of {best.power:.0%})."
    elif diagnosis.verdict is Verdict.CONSISTENT:
        yield "Nothing."
    else:
        yield (
            "Repeat points spread over the grid, in random order."
            if diagnosis.blind
            else ("Look at the places under Diagnosis; compare with a campaign of the same bench (`pmg report A B`).")
        )


def _cost(diagnosis: Diagnosis, residual: Array) -> Iterator[str]:
    """Loss by which a model without the cause is wrong, or the readings with it, and the same in efficiency."""
    naming, found, readings = diagnosis.naming, diagnosis.refit, diagnosis.mismatch.readings
    assert naming is not None
    assert found is not None
    at, moving = readings.grid.points, readings.configuration != "zero"
    faults = [fit for fit in naming.best.fits if issubclass(fit.candidate.kind, Instrument)]
    of_readings = np.sum([fit.effect for fit in faults], axis=0) if faults else np.zeros(len(residual))
    parts = [("Losses from these readings are", of_readings)]
    if len(faults) < len(naming.best.fits):
        missing = residual - (readings.torque - found.prediction) - of_readings
        parts.insert(0, ("A model without this is", missing))
    for what, wrong in parts:
        acting = moving & (np.sum([fit.effect for fit in naming.best.fits], axis=0) != 0.0) & (wrong != 0.0)
        if not acting.any():
            continue
        loss = np.bincount(readings.row[acting], (wrong * readings.speed_own)[acting], len(at))
        of = np.unique(readings.row[acting])
        rms, most = float(np.sqrt(np.mean(loss[of] ** 2))), float(np.abs(loss[of]).max())
        yield f"{what} wrong by {rms:.2g} W rms, up to {most:.2g} W."
        carried = np.abs(at.torque_ring * at.speed_ring)[of]
        loaded = at.engaged[of] & (carried > LOADED * np.max(carried, where=at.engaged[of], initial=0.0))
        if loaded.any():
            points = 100.0 * np.abs(loss[of][loaded]) / carried[loaded]
            yield f"At loaded points that is up to {points.max():.2g} points of efficiency."


IN_THE_MODEL = {
    Verdict.NAMED: "`model.toml` holds the cause: compare with it (`pmg compare --model model.toml`).",
    Verdict.AMBIGUOUS: "`model.toml` holds the first possible cause: do not rely on it before the next test.",
    Verdict.NOT_IN_LIBRARY: "`model.toml` holds the fitted losses alone: there is no known term to add.",
    Verdict.CONFOUNDED: "`model.toml` may hold a drift in its losses: do not simulate with it yet.",
    Verdict.CONSISTENT: "`model.toml` is the calibrated bench: simulate with it (`pmg simulate --model model.toml`).",
}
"""What to do with the model that a comparison leaves."""

LOADED = 0.2
"""Part of the largest power carried from which on a point counts as loaded."""


def _cost_of_places(diagnosis: Diagnosis) -> Iterator[str]:
    """Loss by which a model is wrong where a difference was found and no cause; nothing to pay where none was."""
    mismatch, readings = diagnosis.mismatch, diagnosis.mismatch.readings
    if diagnosis.verdict is Verdict.CONFOUNDED:
        yield "Cannot be told: a drift would be taken for losses of the gear."
    elif mismatch.locations:
        effect = np.sum([place.effect for place in mismatch.locations], axis=0)
        moving = (readings.configuration != "zero") & (effect != 0.0)
        loss = np.bincount(readings.row[moving], (effect * readings.speed_own)[moving], len(readings.grid))
        of = loss[np.unique(readings.row[moving])]
        rms, most = float(np.sqrt(np.mean(of**2))), float(np.abs(of).max())
        yield f"The model is wrong by {rms:.2g} W rms, up to {most:.2g} W, at the points where it differs."
    elif not mismatch.found:
        yield "Nothing: no difference beyond repeatability."


def _picture(diagnosis: Diagnosis, residual: Array) -> Figure | None:
    """Residual with the plain model and with the cause, where the cause acts or the difference sits."""
    naming, found, readings = diagnosis.naming, diagnosis.refit, diagnosis.mismatch.readings
    places = diagnosis.mismatch.locations
    if naming is not None and found is not None:
        effect = np.sum([fit.effect for fit in naming.best.fits], axis=0)
    else:
        effect = places[0].effect if places else residual
    shaft = max(SIDES, key=lambda side: float(np.sum(effect[readings.of_shaft[side]] ** 2)))
    rows = np.flatnonzero(readings.of_shaft[shaft] & (effect != 0.0))
    if not len(rows):
        return None
    x, label = _abscissa(diagnosis, rows, effect)
    order = np.argsort(x, kind="stable")
    u = float(np.median(readings.u[rows])) / RESIDUAL.scale
    ends = x[order][[0, -1]]
    series = [Series("repeatability, 95 %", ends, 0.0 * ends, np.array([u, u]), "band", 7)]
    stages = [("model", residual, 1)]
    if found is not None:
        sure = "with the cause" if diagnosis.verdict is Verdict.NAMED else "with the first possible cause"
        stages.append((sure, readings.torque - found.prediction, 0))
    for name, part, colour in stages:
        series.append(Series(name, x[order], RESIDUAL.display(part[rows])[order], None, "markers", colour))
    sizes = ", ".join(f"{n} {np.sqrt(np.mean(p[rows] ** 2)) / RESIDUAL.scale:.2f} mN m rms" for n, p, _ in stages)
    return Figure(
        "before-and-after",
        "Measured less simulated torque",
        f"{shaft.capitalize()} torque, {counted(len(rows), 'reading')}: {sizes}.",
        (Chart(label, "torque [mN m]", tuple(series), references=(("", 0.0),)),),
        narrow=True,
    )


def _abscissa(diagnosis: Diagnosis, rows: npt.NDArray[np.intp], effect: Array) -> tuple[Array, str]:
    """What the readings are drawn over: time where the cause remembers, load where it acts under load, else speed."""
    readings, naming = diagnosis.mismatch.readings, diagnosis.naming
    points = readings.grid.points
    at = points[readings.row[rows]]
    places = diagnosis.mismatch.locations
    follows = places[0].depends_on[0] if places and places[0].depends_on else ""
    if diagnosis.refit is not None and naming is not None:
        remembers = any(fit.candidate.kind.memory for fit in naming.best.fits)
        under_load = 2.0 * float(np.sum(effect[rows][at.engaged] ** 2)) > float(np.sum(effect[rows] ** 2))
        follows = "run_history" if remembers else "load" if under_load else "speed_sun"
    if follows in ("load", "power_flow"):
        return at.torque_ring, "ring torque [N m]"
    if follows == "speed_ring":
        return np.asarray(SPEED_RING.display(np.abs(at.speed_ring))), SPEED_RING.label
    if follows in ("speed_sun", "") or not points.ordered:
        return np.asarray(SPEED_SUN.display(np.abs(at.speed_sun))), SPEED_SUN.label
    return np.asarray((at.started_at - points.started_at.min()) / MINUTE), "time since the first point [min]"
