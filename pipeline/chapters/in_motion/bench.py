"""Chapters on the bench as its runs in motion show it: constants, loss curves, torque against pole angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.explained.balance_figures import mean_over
from pmg.pipeline.diagnosis.motion.constants import MAP_WAVES
from pmg.pipeline.diagnosis.motion.loss_curve import loss_curve, loss_names
from pmg.pipeline.diagnosis.motion.rows import linear_columns
from pmg.pipeline.diagnosis.motion.traces import constants_covariance, final_baseline, named_fits, term_of
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.pipeline.report.document import Cell, Chart, Column, Figure, Measured, Section, Series, Table, Text
from pmg.pipeline.wording.units import MILLI
from pmg.sim import sources
from pmg.sim.mechanisms.base import Component
from pmg.sim.shafts import SIDES
from pmg.sim.signals import SPEEDS

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.traces import TorqueTrace
    from pmg.sim.signals import Array

SLICES = 40
"""Slices of a covariate over which measured torque is averaged."""

FAR = 3.0
"""Standard uncertainties from its data sheet beyond which a constant is called far from it."""


def constants_section(diagnosis: MotionDiagnosis) -> Section:
    """Constants of the bench: data sheet, fitted alone, fitted beside the cause."""
    sheet, before = diagnosis.before.sheet, diagnosis.before.values
    rows: list[tuple[Cell, ...]] = []
    far = []
    for i, constant in enumerate(sheet.constants):
        if "_off" in constant.name or (np.isinf(constant.spread) and constant.name != "slip_damping"):
            continue
        beside, error, free = float(diagnosis.constants[i]), float(diagnosis.errors[i]), np.isinf(constant.spread)
        distance = float("nan") if free else (beside - constant.expected) / constant.spread
        name = constant.name.replace("_", " ")
        if abs(distance) > FAR:
            far.append(f"{name} ({distance:+.1f} u)")
        rows.append(
            (
                name,
                constant.unit,
                None if free else Measured(constant.expected, constant.spread),
                float(before[i]),
                Measured(beside, error),
                None if free else distance,
            )
        )
    found = f"Far from the data sheet: {', '.join(far)}." if far else "None is far from its data sheet."
    table = Table(
        "constants",
        "Constants of the bench",
        f"{found} Distance in standard uncertainties u of the data sheet. Zeros, skews, waves of a turn, and what "
        "a law is off its form are expected at 0.",
        (
            Column("constant", "Constant"),
            Column("unit", "Unit"),
            Column("sheet", "Data sheet"),
            Column("alone", "Fitted alone", format=".5g"),
            Column("beside", "Fitted beside the cause" if named_fits(diagnosis) else "Fitted"),
            Column("distance", "Distance", "u", digits=2),
        ),
        tuple(rows),
    )
    text = Text(
        "All constants are fitted together with their data sheets. Skew is the delay of a torque behind its angle; "
        "pull-out is the torque of one pole pair. Drag of the loss curves is in the next chapter."
    )
    return Section("bench-constants", "Constants of the bench", (text, table))


def loss_curve_section(diagnosis: MotionDiagnosis, traces: tuple[TorqueTrace, ...]) -> Section | None:
    """Drag of both rotors from neutral ramps and coast-downs, forwards and backwards, against the fitted curve."""
    baseline, covariance = final_baseline(diagnosis), constants_covariance(diagnosis)
    panels, words = [], []
    for side in SIDES:
        ramps = [
            trace
            for trace in traces
            if trace.stretch.side == side
            and not trace.stretch.coupled
            and trace.stretch.run.run.manoeuvre in (Manoeuvre.RAMP, Manoeuvre.COAST)
        ]
        if not ramps:
            continue
        names = loss_names(side)
        speed = np.concatenate([trace.stretch.of_rows(trace.state.speed) for trace in ramps])
        drag = np.concatenate([_without(trace, names, diagnosis) for trace in ramps])
        series = []
        for colour, (name, sense) in enumerate((("forwards", 1.0), ("backwards", -1.0)), 1):
            there = sense * speed > 0.0
            if there.any():
                x, y = mean_over(np.abs(speed[there]), sense * drag[there], SLICES)
                series.append(Series(name, SPEEDS[side].display(x), y / MILLI, None, "markers", colour))
        x = np.linspace(float(np.abs(speed).min()), float(np.abs(speed).max()), 80)
        curve, u = loss_curve(baseline.sheet, diagnosis.constants, covariance, side, x)
        series.insert(0, Series("fitted", SPEEDS[side].display(x), curve / MILLI, u / MILLI, "line", 0))
        panels.append(Chart("speed [rpm]", "drag [mN m]", tuple(series), title=f"Drag of the {side}"))
        words.append(f"{side} {curve[-1] / MILLI:.1f} ± {2.0 * u[-1] / MILLI:.1f} mN m at its highest speed")
    if not panels:
        return None
    figure = Figure(
        "loss-curves",
        "Loss curves from ramps",
        f"Drag in neutral, torque less that of the inertia: {'; '.join(words)}. Bands are two standard uncertainties "
        "of the fitted curve; markers are means over slices of speed, without the cause taken out.",
        tuple(panels),
        columns=2,
    )
    return Section("losses", "Loss curves", (figure,))


def pole_angle_section(diagnosis: MotionDiagnosis, traces: tuple[TorqueTrace, ...]) -> Section | None:
    """Torque of the magnetic gear against the angle of its poles, measured and as a sine."""
    engaged = [trace for trace in traces if trace.stretch.coupled]
    if not engaged:
        return None
    baseline = final_baseline(diagnosis)
    peak = float(diagnosis.constants[baseline.sheet.at("pull_out")])
    sides = [side for side in SIDES if any(trace.stretch.side == side for trace in engaged)]
    angle = {
        side: _joined([t.stretch.of_rows(t.state.pole_angle) for t in engaged if t.stretch.side == side])
        for side in sides
    }
    ends = [float(end) for values in angle.values() for end in (values.min(), values.max())]
    x = np.linspace(min(ends), max(ends), 120)
    series = [Series("A sin φ", np.degrees(x), peak * np.sin(x), None, "line", 0)]
    map_names = ("pull_out", *(f"map_off_{wave}" for wave in MAP_WAVES))
    named = map(term_of, named_fits(diagnosis))
    bends, largest = any(t.component is Component.MAGNETIC_GEAR and not t.constants for t in named), 0.0
    for side in sides:
        mine = [trace for trace in engaged if trace.stretch.side == side]
        pairs = baseline.sheet.poles[side]
        torque = _joined([_without(trace, map_names, diagnosis) for trace in mine]) / pairs
        at, mean = mean_over(angle[side], torque, SLICES)
        largest = max(largest, float(np.abs(mean - peak * np.sin(at)).max()) * pairs)
        series.append(Series(f"measured, {side}", np.degrees(at), mean, None, "markers", 1 + SIDES.index(side)))
        if bends:
            effect = _joined([trace.after - trace.of_constants for trace in mine]) / pairs
            at, with_cause = mean_over(angle[side], peak * np.sin(angle[side]) + effect, SLICES)
            series.append(
                Series(f"with the cause, {side}", np.degrees(at), with_cause, None, "line", 1 + SIDES.index(side))
            )
    figure = Figure(
        "pole-angle",
        "Torque against pole angle",
        "Torque less that of inertia and drag, over the pole pairs, in means over slices of the pole angle. The sine "
        f"has A = {peak:.4g} N m; the largest difference is {largest / MILLI:.1f} mN m of torque.",
        (Chart("pole angle [°]", "torque of a pole pair [N m]", tuple(series)),),
    )
    return Section("pole-angle-chapter", "Torque of the magnetic gear", (figure,), (sources.THESIS,))


def _joined(parts: list[Array]) -> Array:
    return np.concatenate(parts)


def _without(trace: TorqueTrace, names: tuple[str, ...], diagnosis: MotionDiagnosis) -> Array:
    """Measured torque less all that the constants make of it but some, (n,): the cause is not taken out."""
    baseline = final_baseline(diagnosis)
    columns = linear_columns(trace.state)
    kept = sum(diagnosis.constants[baseline.sheet.at(name)] * columns[name] for name in names)
    return np.asarray(trace.stretch.torque - trace.of_constants + trace.stretch.of_rows(np.asarray(kept)))
