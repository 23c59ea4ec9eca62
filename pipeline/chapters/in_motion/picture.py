"""Picture of the first screen of the report on runs in motion: the torque that is missing, where it shows most."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.in_motion.runs import missing_most, missing_series, root_mean_square
from pmg.pipeline.chapters.simulated.motion import TIME
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.places import largest_of, signal_of
from pmg.pipeline.diagnosis.motion.statement import effect_size
from pmg.pipeline.diagnosis.motion.traces import SMOOTHED, named_fits
from pmg.pipeline.report.document import Chart, Figure, Series
from pmg.pipeline.wording.plurals import capitalised
from pmg.pipeline.wording.units import MILLI

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.traces import TorqueTrace
    from pmg.sim.signals import Array

SHOWN = 2.0
"""Time of a run that the picture shows where there is a difference [s]."""


def sheet_picture(
    diagnosis: MotionDiagnosis, effects: tuple[tuple[Array, ...], ...], traces: tuple[TorqueTrace, ...]
) -> Figure | None:
    """Missing torque where the cause explains most of it, or where the difference is largest.

    Without a difference it is that of the whole run with the largest missing torque over its noise.
    """
    if diagnosis.mismatch.found:
        if (found := clearest_part(diagnosis, effects, traces)) is None:
            return None
        trace, began = found
        named = bool(named_fits(diagnosis))
        cause = "the cause" if diagnosis.verdict is Verdict.NAMED else "the first possible cause"
        what = f"without and with {cause} in the model" if named else "with the fitted constants"
        chart = _excerpt(trace, began, named=named)
        caption = f"{capitalised(what)}, in {_run_of(trace)}."
    else:
        turning = [trace for trace in traces if not trace.stretch.at_rest]
        if not turning:
            return None
        trace = max(turning, key=missing_most)
        missing, noise = (root_mean_square(v) / MILLI for v in (trace.missing(trace.after), trace.spread))
        chart = Chart(TIME, "torque [mN m]", tuple(missing_series(trace, named=False)))
        caption = (
            f"{missing:.1f} mN m rms of {noise:.1f} mN m noise in {_run_of(trace)}, the largest of all runs over its "
            f"noise. With the fitted constants, mean over {SMOOTHED:g} s."
        )
    title = f"{trace.stretch.side.capitalize()} torque, measured less predicted"
    return Figure("missing-torque", title, caption, (chart,), narrow=True)


def _run_of(trace: TorqueTrace) -> str:
    """The run of a trace, in words."""
    run = trace.stretch.run.run
    return f"run {run.point} ({run.manoeuvre})"


def clearest_part(
    diagnosis: MotionDiagnosis, effects: tuple[tuple[Array, ...], ...], traces: tuple[TorqueTrace, ...]
) -> tuple[TorqueTrace, float] | None:
    """Stretch and time from which on `SHOWN` seconds show most, on the shaft that the sheet speaks of."""
    named, of = bool(named_fits(diagnosis)), ""
    if effects:
        _, _, of = effect_size(diagnosis, effects[0])
    elif diagnosis.mismatch.locations:
        of = signal_of(largest_of(diagnosis))
    found: tuple[float, TorqueTrace, float] | None = None
    for trace in traces:
        if trace.stretch.at_rest or of not in ("", trace.stretch.side):
            continue
        before, after = ((trace.stretch.torque - p) / trace.row_spread for p in (trace.before, trace.after))
        clear = np.cumsum(np.r_[0.0, before**2 - after**2 if named else after**2])
        width = min(round(SHOWN * trace.stretch.run.row_rate), len(clear) - 1)
        first = int(np.argmax(clear[width:] - clear[: len(clear) - width]))
        shown = float(clear[first + width] - clear[first])
        if found is None or shown > found[0]:
            found = shown, trace, float(trace.time[first])
    return None if found is None else found[1:]


def _excerpt(trace: TorqueTrace, began: float, *, named: bool) -> Chart:
    """Missing torque of a stretch over `SHOWN` from a time on, every row, above the band of its noise."""
    shown = (trace.time >= began) & (trace.time <= began + SHOWN)
    time = trace.time[shown]
    series = [Series("noise, 95 %", time, 0.0 * time, trace.row_spread[shown] / MILLI, "band", 7)]
    for words, predicted, colour in (
        ("without the cause", trace.before, 1),
        ("with the cause" if named else "with the fitted constants", trace.after, 0),
    ):
        if named or colour == 0:
            missing = (trace.stretch.torque - predicted)[shown] / MILLI
            series.append(Series(words, time, missing, None, "line", colour))
    return Chart(TIME, "torque [mN m]", tuple(series))
