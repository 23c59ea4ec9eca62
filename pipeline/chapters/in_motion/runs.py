"""Chapter on the runs: measured and predicted torque, speed, and the missing torque before and after the cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.simulated.motion import TIME
from pmg.pipeline.diagnosis.motion.traces import SMOOTHED, named_fits
from pmg.pipeline.report.document import Chart, Figure, Section, Series, Text
from pmg.pipeline.wording.units import MILLI
from pmg.sim.shafts import SIDES
from pmg.sim.signals import SPEEDS

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.traces import TorqueTrace
    from pmg.sim.signals import Array

BUCKETS = 110
"""Pieces of a run of which the smallest and the largest torque are drawn."""

MISSING_EVERY = 0.5 * SMOOTHED
"""Time from one drawn missing torque to the next [s]."""

MEASURED, PREDICTED = "measured", "predicted"


def runs_section(diagnosis: MotionDiagnosis, traces: tuple[TorqueTrace, ...]) -> Section:
    """A figure of each run, in the order in which they were run."""
    by_run: dict[str, list[TorqueTrace]] = {}
    for trace in traces:
        by_run.setdefault(trace.stretch.run.run.name, []).append(trace)
    named = bool(named_fits(diagnosis))
    what = "before and after the cause was put in" if named else "with the fitted constants"
    text = Text(
        f"Torque as measured and as predicted from the motion, with speed; below, what is missing {what}, as a mean "
        f"over {SMOOTHED:g} s. The band holds 95 % of what noise makes. Pointing at one time shows it in all panels."
    )
    figures = [_figure(i, of_run, named=named) for i, of_run in enumerate(by_run.values(), 1)]
    return Section("runs", "Run by run", (text, *figures))


def _figure(number: int, traces: list[TorqueTrace], *, named: bool) -> Figure:
    run = traces[0].stretch.run
    of = run.run
    panels = [Chart(TIME, "torque [N m]", tuple(_torques(traces)), title="Torque")]
    if not traces[0].stretch.at_rest:
        panels.append(Chart(TIME, "speed [rpm]", tuple(_speeds(traces[0])), title="Speed"))
    words = []
    for trace in traces:
        side, band = trace.stretch.side, float(np.sqrt(np.mean(trace.spread**2))) / MILLI
        before, after = (_rms(trace.missing(predicted)) / MILLI for predicted in (trace.before, trace.after))
        size = f"{before:.1f} mN m rms before, {after:.1f} after" if named else f"{after:.1f} mN m rms"
        words.append(f"{side} {size}, noise {band:.1f}")
        panels.append(Chart(TIME, "torque [mN m]", tuple(_missing(trace, named=named)), title=f"Missing, {side}"))
    drive = f", {of.drive} drives" if of.coupled else ""
    return Figure(
        f"run-{number:02d}",
        f"{of.point}: {of.manoeuvre}, {of.configuration}{drive}",
        f"Missing torque: {'; '.join(words)}.",
        tuple(panels),
        columns=2,
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _torques(traces: list[TorqueTrace]) -> list[Series]:
    """Measured and predicted torque of the shafts of a run at the times at which the measured one is extreme."""
    series = []
    for group in (MEASURED, PREDICTED):
        for trace in traces:
            run, side, rows = trace.stretch.run, trace.stretch.side, trace.stretch.rows
            predicted = np.full(len(run), np.nan)
            predicted[rows] = trace.after
            at = _extremes(run.measured[side])
            values = run.measured[side] if group == MEASURED else predicted
            series.append(Series(side, run.row_time[at], values[at], None, "line", SIDES.index(side), group))
    return series


def _speeds(trace: TorqueTrace) -> list[Series]:
    run, series = trace.stretch.run, []
    for side in SIDES:
        if run.run.turns[side]:
            speed = SPEEDS[side].display(run.rows(run.shafts[side].speed))
            at = _extremes(speed)
            series.append(Series(side, run.row_time[at], speed[at], None, "line", SIDES.index(side)))
    return series


def _missing(trace: TorqueTrace, *, named: bool) -> list[Series]:
    """Missing torque before and after, above the band of the noise; gaps where the shaft is at rest."""
    run = trace.stretch.run
    every = max(round(MISSING_EVERY * run.row_rate), 1)

    def drawn(values: Array) -> Array:
        whole = np.full(len(run), np.nan)
        whole[trace.stretch.rows] = values / MILLI
        return whole[::every]

    time = run.row_time[::every]
    spread = drawn(trace.spread)
    series = [Series("noise, 95 %", time, 0.0 * spread, spread, "band", 7)]
    if named:
        series.append(Series("before", time, drawn(trace.missing(trace.before)), None, "line", 1))
    series.append(Series("after" if named else "missing", time, drawn(trace.missing(trace.after)), None, "line", 0))
    return series


def _extremes(values: Array) -> Array:
    """Places of the smallest and the largest value of each of `BUCKETS` pieces, in order."""
    found: set[int] = {0, len(values) - 1}
    edges = np.linspace(0, len(values), min(BUCKETS, len(values)) + 1).astype(np.int64)
    for first, stop in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        piece = values[first:stop]
        if np.isfinite(piece).any():
            found |= {first + int(np.nanargmin(piece)), first + int(np.nanargmax(piece))}
    return np.array(sorted(found))
