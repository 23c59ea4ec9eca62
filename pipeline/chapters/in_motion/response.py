"""Chapter on the frequency response of the rotors: measured from sweeps and dithers, against the fitted model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import csd

from pmg.pipeline.diagnosis.motion.traces import final_baseline
from pmg.pipeline.motion.smooth import BAND
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.pipeline.report.document import Cell, Chart, Column, Figure, Section, Series, Table, Text
from pmg.sim.shafts import SIDES, per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.traces import TorqueTrace
    from pmg.sim.signals import Array

PIECE = 4.0
"""Length of the pieces whose spectra are averaged [s]."""

COHERENT = 0.7
"""Coherence from which on a response is drawn."""

LOWEST = 0.5
"""Frequency from which on a response is drawn [Hz]."""

KINDS = (Manoeuvre.DITHER, Manoeuvre.SWEEP)
"""Manoeuvres that excite a band of frequencies."""


@dataclass(frozen=True)
class _Response:
    """Acceleration of a rotor's motor per torque of its coupling, at frequencies [Hz] (f,), and its coherence."""

    side: str
    point: str
    coupled: bool
    frequency: Array
    measured: Array
    simulated: Array
    coherence: Array


def response_section(diagnosis: MotionDiagnosis, traces: tuple[TorqueTrace, ...]) -> Section | None:
    """Acceleration per torque of each rotor, with its coherence, and the modes of the magnetic spring."""
    found = [r for trace in traces if (r := _response(trace)) is not None]
    if not found:
        return None
    panels = []
    for coupled, title in ((False, "neutral"), (True, "engaged")):
        of = [r for r in found if r.coupled == coupled]
        if of:
            panels += _panels(of, title, diagnosis)
    modes = _modes(diagnosis)
    agree = [float(np.median(np.abs(r.measured / r.simulated - 1.0))) for r in found if len(r.frequency)]
    figure = Figure(
        "response",
        "Frequency response",
        "Acceleration per torque from averaged cross spectra (Welch), drawn where the coherence is "
        f"{COHERENT:g} or more; against the model driven by the same motion, and against one over the inertia J. "
        f"Half of the frequencies of a run agree within {100.0 * max(agree, default=float('nan')):.1f} % or better.",
        tuple(panels),
        columns=2,
    )
    text = Text(
        "A free rotor follows its torque as one over its inertia. Engaged, the magnetic spring carries part of it: "
        "below the mode of the spring both rotors move together, at the mode they swing against each other."
    )
    return Section("response-chapter", "Frequency response", (text, figure, *([modes] if modes is not None else [])))


def _response(trace: TorqueTrace) -> _Response | None:
    """The response of a rotor over the longest piece of a run in which its shaft turned; None where it is short."""
    stretch = trace.stretch
    run = stretch.run
    if run.run.manoeuvre not in KINDS:
        return None
    places = np.flatnonzero(stretch.rows)
    pieces = np.split(np.arange(len(places)), np.flatnonzero(np.diff(places) > 1) + 1)
    piece = max(pieces, key=len)
    if len(piece) < 2.0 * PIECE * run.row_rate:
        return None
    acceleration = stretch.of_rows(stretch.shaft.acceleration)[piece]
    torque, model = stretch.torque[piece], trace.after[piece]

    def cross(one: Array, other: Array) -> Array:
        return np.asarray(csd(one, other, run.row_rate, nperseg=round(PIECE * run.row_rate))[1])

    power, of_torque = cross(acceleration, acceleration).real, cross(torque, torque).real
    between = cross(torque, acceleration)
    coherence = np.abs(between) ** 2 / (power * of_torque)
    frequency = np.fft.rfftfreq(round(PIECE * run.row_rate), 1.0 / run.row_rate)
    # An acceleration that is driven by the bench and read without much noise is the cleaner input of the two.
    measured = power / np.abs(cross(acceleration, torque))
    simulated = power / np.abs(cross(acceleration, model))
    kept = (coherence >= COHERENT) & (frequency >= LOWEST) & (frequency <= BAND) & (power > 1e-3 * power.max())
    return _Response(
        stretch.side, run.run.point, stretch.coupled, frequency[kept], measured[kept], simulated[kept], coherence[kept]
    )


def _panels(found: list[_Response], title: str, diagnosis: MotionDiagnosis) -> list[Chart]:
    series, coherence = [], []
    ends = [float(end) for r in found if len(r.frequency) for end in (r.frequency[0], r.frequency[-1])]
    line = np.geomspace(min(ends), max(ends), 2) if ends else np.zeros(0)
    for side in SIDES:
        of = [r for r in found if r.side == side]
        if not of:
            continue
        frequency = np.concatenate([r.frequency for r in of])
        order = np.argsort(frequency, kind="stable")
        colour = SIDES.index(side)
        for group, style in (("measured", "markers"), ("model", "line")):
            values = np.concatenate([r.measured if group == "measured" else r.simulated for r in of])
            series.append(Series(side, frequency[order], values[order], None, style, colour, group))  # type: ignore[arg-type]
        inertia = float(diagnosis.constants[diagnosis.before.sheet.at(f"inertia_{side}")])
        series.append(Series(side, line, np.full(len(line), 1.0 / inertia), None, "line", colour, "1/J"))
        values = np.concatenate([r.coherence for r in of])
        coherence.append(Series(side, frequency[order], values[order], None, "markers", colour))
    axis, label = "frequency [Hz]", "acceleration per torque [rad/s² per N m]"
    return [
        Chart(axis, label, tuple(series), title=f"Response, {title}", x_log=True, y_log=True),
        Chart(axis, "coherence", tuple(coherence), title=f"Coherence, {title}", x_log=True, y_limits=(0.0, 1.05)),
    ]


def _modes(diagnosis: MotionDiagnosis) -> Table | None:
    """Frequencies of the magnetic spring at no load, for rotors free of their motors and for one that is held."""
    baseline = final_baseline(diagnosis)
    if not any(stretch.coupled for stretch in baseline.stretches):
        return None
    sheet, poles = baseline.sheet, baseline.sheet.poles
    peak = float(diagnosis.constants[sheet.at("pull_out")])
    stiffer = per_shaft(lambda side: peak * poles[side] ** 2 / float(diagnosis.constants[sheet.at(f"inertia_{side}")]))
    rows: list[tuple[Cell, ...]] = [
        (name, float(np.sqrt(square)) / REVOLUTION)
        for name, square in (
            ("magnetic spring, both rotors free", stiffer.sun + stiffer.ring),
            ("magnetic spring, sun held", stiffer.ring),
            ("magnetic spring, ring held", stiffer.sun),
        )
    ]
    return Table(
        "modes",
        "Modes of the magnetic spring",
        "At no load, from the fitted inertias and pull-out torque: rotors between their transducers, without the "
        "motors. A mode lies lower with a motor's inertia on it, and lower under load.",
        (Column("mode", "Mode"), Column("frequency", "Frequency", "Hz", digits=2)),
        tuple(rows),
    )
