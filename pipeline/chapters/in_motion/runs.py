"""Chapter on the runs: measured and predicted torque and speed, and the missing torque before and after the cause."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.simulated.motion import TIME
from pmg.pipeline.diagnosis.motion.traces import SMOOTHED, named_fits
from pmg.pipeline.report.document import Cell, Chart, Column, Figure, Section, Series, Table, Text
from pmg.pipeline.wording.units import MILLI
from pmg.sim.shafts import SIDES
from pmg.sim.signals import SPEEDS

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.shooting import Shooting
    from pmg.pipeline.diagnosis.motion.traces import TorqueTrace
    from pmg.sim.signals import Array

BUCKETS = 110
"""Pieces of a run of which the smallest and the largest torque are drawn."""

MISSING_EVERY = 0.5 * SMOOTHED
"""Time from one drawn missing torque to the next [s]."""

RUNS_AWAY = 5000.0
"""Error of a speed from which on a simulation runs away, several times what the bench turns [rpm]."""

MEASURED, PREDICTED, SIMULATED = "measured", "predicted", "simulated"


def runs_section(diagnosis: MotionDiagnosis, traces: tuple[TorqueTrace, ...], shooting: Shooting) -> Section:
    """How far simulated speeds are off, and a figure of each run, that first in which most torque is missing."""
    by_run: dict[str, list[TorqueTrace]] = {}
    for trace in traces:
        by_run.setdefault(trace.stretch.run.run.name, []).append(trace)
    named = bool(named_fits(diagnosis))
    what = "before and after the cause was put in" if named else "with the fitted constants"
    text = Text(
        "Torque as measured, and as predicted from the motion. Speed as measured, and as simulated from the torques. "
        f"Below, the torque that is missing {what}, as a mean over {SMOOTHED:g} s. The band holds 95 % of what noise "
        "makes. Pointing at one time shows it in all panels."
        + " The run in which most is missing comes first."
        * diagnosis.mismatch.found
    )
    numbers = {name: i for i, name in enumerate(by_run, 1)}
    missing = {name: max(map(missing_most, of_run)) for name, of_run in by_run.items()}
    clearest = sorted(by_run, key=lambda name: -missing[name]) if diagnosis.mismatch.found else list(by_run)
    figures = [_figure(numbers[name], by_run[name], shooting, named=named) for name in clearest]
    tables = (_simulated(shooting, named=named),) if shooting.shots else ()
    return Section("runs", "Run by run", (text, *tables, *figures))


def _simulated(shooting: Shooting, *, named: bool) -> Table:
    """How far simulated speeds are off, by the time that is simulated from one start."""
    rows: list[tuple[Cell, ...]] = []
    for shot in shooting.shots:
        length = "whole run" if math.isinf(shot.length) else f"{shot.length:g} s"
        before, after, noise = (float(SPEEDS[shot.side].display(v)) for v in (shot.before, shot.after, shot.noise))
        errors: tuple[Cell, ...] = tuple(v if v < RUNS_AWAY else "runs away" for v in (before, after)[not named :])
        rows.append((length, shot.side, *errors, noise))
    return Table(
        "simulated-speed",
        "Speed simulated from the torques",
        f"{_nearer(shooting) if named else 'Simulated less recorded speed of the rotors'}, root mean squares. A "
        "simulation starts from the recorded motion and is driven by the measured torque of the coupling. Inertia, "
        "drag and gear follow the simulated motion; causes act as they did at the recorded one. It ends where a shaft "
        "stands or a signal is lost. What does not fill an interval is left out.",
        (
            Column("length", "Simulated time"),
            Column("side", "Rotor"),
            *((Column("before", "Without the cause", "rpm", digits=2),) if named else ()),
            Column("after", "With the cause" if named else "Difference", "rpm", digits=2),
            Column("noise", "Noise alone", "rpm", digits=2),
        ),
        tuple(rows),
    )


def _nearer(shooting: Shooting) -> str:
    """Of how many lengths and rotors the cause brings the simulation nearer."""
    better = sum(shot.after < shot.before for shot in shooting.shots)
    return f"With the cause, simulated speeds are nearer to the recorded ones in {better} of {len(shooting.shots)} rows"


def _figure(number: int, traces: list[TorqueTrace], shooting: Shooting, *, named: bool) -> Figure:
    run = traces[0].stretch.run
    of = run.run
    panels = [Chart(TIME, "torque [N m]", tuple(_torques(traces)), title="Torque")]
    if not traces[0].stretch.at_rest:
        panels.append(Chart(TIME, "speed [rpm]", tuple(_speeds(traces, shooting)), title="Speed"))
    words = []
    for trace in traces:
        side, band = trace.stretch.side, root_mean_square(trace.spread) / MILLI
        before, after = (
            root_mean_square(trace.missing(predicted)) / MILLI for predicted in (trace.before, trace.after)
        )
        size = f"{before:.1f} mN m rms before, {after:.1f} after" if named else f"{after:.1f} mN m rms"
        words.append(f"{side} {size}, noise {band:.1f}")
        panels.append(Chart(TIME, "torque [mN m]", tuple(missing_series(trace, named=named)), title=f"Missing, {side}"))
    drive = f", {of.drive} drives" if of.coupled else ""
    return Figure(
        f"run-{number:02d}",
        f"{of.point}: {of.manoeuvre}, {of.configuration}{drive}",
        f"Missing torque: {'; '.join(words)}.",
        tuple(panels),
        columns=2,
    )


def missing_most(trace: TorqueTrace) -> float:
    """Mean square of the torque that is missing without the cause, over its noise."""
    return float(np.mean((trace.missing(trace.before) / trace.spread) ** 2))


def root_mean_square(values: Array) -> float:
    """Of values (n,), in their unit."""
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


def _speeds(traces: list[TorqueTrace], shooting: Shooting) -> list[Series]:
    """Speed of the shafts of a run as measured, and of its rotors as simulated."""
    run, series = traces[0].stretch.run, []
    for side in SIDES:
        if not run.run.turns[side]:
            continue
        speed = SPEEDS[side].display(run.rows(run.shafts[side].speed))
        at = _extremes(speed)
        series.append(Series(side, run.row_time[at], speed[at], None, "line", SIDES.index(side), MEASURED))
        if (simulated := shooting.speeds.get((run.run.name, side))) is not None:
            values = SPEEDS[side].display(simulated[at])
            series.append(Series(side, run.row_time[at], values, None, "line", SIDES.index(side), SIMULATED))
    return series


def missing_series(trace: TorqueTrace, *, named: bool) -> list[Series]:
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
