"""The run in time under each choice that the source leaves open: whose losses, whose rotor counts, friction's sign."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.fit.loss_fit import fit_losses
from pmg.pipeline.grid.tables import ROUNDING_FINE
from pmg.pipeline.thesis_figures.printed_simulation import recovered_losses
from pmg.pipeline.thesis_figures.replicate import DURATION, EDDY_IMPLIED, EDDY_TABLE, THESIS
from pmg.pipeline.thesis_figures.rounding import OUTER
from pmg.pipeline.thesis_figures.tables import TORQUE_RING, TORQUE_SUN
from pmg.sim.dynamics.assumptions import Assumptions, RotorInertia
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.programme import Programme
from pmg.sim.dynamics.transient import Task, transients
from pmg.sim.lossmodel import LossModel
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.pipeline.thesis_figures.verdict import JudgedFigure
    from pmg.sim.bench import BenchParameters
    from pmg.sim.dynamics.trace import Trace
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

INSTANTS = round(DURATION / 1e-3) + 1
"""Instants that are looked at: each millisecond."""

DRAWS_OF_TORQUES = 40
"""Draws of the 48 printed torques within their last digit."""

PRINTED_RUN = "printed: 485 and -187 rpm, 48.4 and 47.7 W after 20 s; engaged between 0.4 and 0.6 s"


class RunLosses(StrEnum):
    """Where the losses of the run come from."""

    TABLE = "rounded tables, c = 2.22e-4"
    IMPLIED = "rounded tables, c = 2.2965e-4"
    TORQUES = "the 48 printed torques"


class RotorsCounted(StrEnum):
    """Shafts in whose inertia the motor's rotor is counted; elsewhere the torque loop hides it."""

    NEITHER = "hidden by the loop"
    SUN = "in the sun's shaft"
    BOTH = "in both shafts"


FIGURES_OF_THE_RUN = {RunLosses.TABLE: "run.sun", RunLosses.IMPLIED: "run-implied.sun"}
"""Figures whose interval says what rounding does to a run."""


@dataclass(frozen=True)
class TransientResult:
    """The run of section 6.3 under one set of choices.

    Parameters
    ----------
    losses : RunLosses
        Where the losses come from.
    rotors : RotorsCounted
        Where the motors' rotors are counted.
    signed : bool
        Whether friction turns with the direction of rotation.
    speed_sun, speed_ring : float
        After 20 s [rad/s].
    shift : float
        What rounding moves the sun's speed by to either side, 95 % [rad/s].
    power_in, power_out : float
        Of the magnetic gear, after 20 s [W].
    lowest : float
        Lowest speed of the sun on the way [rad/s]; zero where it never turns back.
    engaged_from : float
        Time from which sun and ring turn as the gear's ratio asks [s], to a millisecond; NaN where they do not.
    voltage : float
        Largest voltage that a motor's loop asks for [V].
    """

    losses: RunLosses
    rotors: RotorsCounted
    signed: bool
    speed_sun: float
    speed_ring: float
    shift: float
    power_in: float
    power_out: float
    lowest: float
    engaged_from: float
    voltage: float


def _assumptions(rotors: RotorsCounted, signed: bool) -> Assumptions:
    counted, hidden = RotorInertia.AHEAD_OF_SENSOR, RotorInertia.BEHIND_SENSOR
    return Assumptions(
        rotor_inertia_sun=hidden if rotors is RotorsCounted.NEITHER else counted,
        rotor_inertia_ring=counted if rotors is RotorsCounted.BOTH else hidden,
        friction_signed=signed,
    )


def transient_options(
    grid: Grid, bench: BenchParameters, judged: Iterable[JudgedFigure], rng: np.random.Generator
) -> tuple[TransientResult, ...]:
    """The published run under every combination of the choices.

    Parameters
    ----------
    grid : Grid
        The published grid.
    bench : BenchParameters
        Numbers of the bench.
    judged : iterable of JudgedFigure
        The figures of the run with their intervals: what the rounding of the grid moves the speed by.
    rng : Generator
        Source of draws of the 48 torques within their last digit.
    """
    fits = fit_losses(grid, THESIS.powers_sun, THESIS.powers_ring, include_rest=THESIS.include_rest)
    table = LossModel(fits.sun.curve, fits.ring.curve, THESIS.correction, 0.0, EDDY_TABLE, 0.0)
    implied = replace(table, c=EDDY_IMPLIED)
    models = {
        RunLosses.TABLE: table,
        RunLosses.IMPLIED: implied,
        RunLosses.TORQUES: recovered_losses(grid, implied, bench),
    }
    by_id = {j.figure.id: j for j in judged}
    shifts = {
        losses: (by_id[id_].reach - by_id[id_].figure.rounding) * SPEED_SUN.scale
        for losses, id_ in FIGURES_OF_THE_RUN.items()
    }
    shifts[RunLosses.TORQUES] = _shift_of_torques(grid, implied, bench, rng)
    choices = list(product(RunLosses, RotorsCounted, (True, False)))
    trains = [Drivetrain.calibrated(bench, models[given], _assumptions(at, signed)) for given, at, signed in choices]
    traces = _runs(trains, np.linspace(0.0, DURATION, INSTANTS))
    return tuple(_result(trace, shifts[c[0]], *c) for c, trace in zip(choices, traces, strict=True))


def _runs(trains: list[Drivetrain], times: Array) -> list[Trace]:
    sun, ring = (Programme.ramp(torque, 1.0) for torque in (THESIS.torque_sun, THESIS.torque_ring))
    return transients([Task(train, sun, ring, DURATION, times=times) for train in trains], rtol=THESIS.rtol)


def _shift_of_torques(grid: Grid, implied: LossModel, bench: BenchParameters, rng: np.random.Generator) -> float:
    """What the last digit of the 48 torques moves the sun's speed by [rad/s]."""
    half = 0.5 * ROUNDING_FINE
    drawn = (
        tuple(t + rng.uniform(-half, half, t.shape) for t in (TORQUE_SUN, TORQUE_RING)) for _ in range(DRAWS_OF_TORQUES)
    )
    choice = _assumptions(RotorsCounted.SUN, True)
    models = (recovered_losses(grid, implied, bench, torques) for torques in drawn)
    trains = [Drivetrain.calibrated(bench, model, choice) for model in models]
    speeds = [trace["speed_sun"][-1] for trace in _runs(trains, np.array([DURATION]))]
    low, high = np.quantile(speeds, OUTER)
    return float(0.5 * (high - low))


def _result(trace: Trace, shift: float, losses: RunLosses, rotors: RotorsCounted, signed: bool) -> TransientResult:
    if trace.stopped is not None:
        raise trace.stopped
    m = trace.drivetrain.motion(trace.state, trace.asked)
    eddy = EDDY_TABLE if losses is RunLosses.TABLE else EDDY_IMPLIED
    sun, ring = trace["speed_sun"], trace["speed_ring"]
    power_in, power_out = (eddy * sun - m.magnetic_sun) * sun, (m.magnetic_ring - eddy * ring) * ring
    wrong = np.flatnonzero((sun <= 0.0) | (ring >= 0.0))
    return TransientResult(
        losses,
        rotors,
        signed,
        float(sun[-1]),
        float(ring[-1]),
        shift,
        float(power_in[-1]),
        float(power_out[-1]),
        float(min(sun.min(), 0.0)),
        float(np.append(trace.time, np.nan)[wrong[-1] + 1]),
        float(max(np.abs(m.sun.voltage).max(), np.abs(m.ring.voltage).max())),
    )


TRANSIENT_HEADINGS = (
    *("losses", "motors' rotors", "friction", "sun [rpm]", "ring [rpm]", "in [W]", "out [W]", "lowest [rpm]"),
    "engaged from",
)
"""Columns of the table."""


def transient_lines(results: tuple[TransientResult, ...]) -> tuple[str, ...]:
    """The table as aligned text."""
    rows: list[tuple[str, ...]] = [TRANSIENT_HEADINGS]
    for r in results:
        sun, shift, lowest = (float(SPEED_SUN.display(value)) for value in (r.speed_sun, r.shift, r.lowest))
        rows.append(
            (
                r.losses,
                r.rotors,
                "signed" if r.signed else "unsigned",
                f"{sun:.1f} ± {shift:.1f}",
                f"{float(SPEED_RING.display(r.speed_ring)):.1f}",
                f"{r.power_in:.2f}",
                f"{r.power_out:.2f}",
                f"{lowest:.1f}",
                f"{r.engaged_from:.3f} s",
            )
        )
    widths = [max(len(row[i]) for row in rows) for i in range(len(TRANSIENT_HEADINGS))]
    most = max(r.voltage for r in results)
    table = ("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)
    about = f"The run in time under each choice the source leaves open; {PRINTED_RUN}."
    return ("", about, *table, f"± is rounding, 95 %. Largest voltage of a motor: {most:.0f} V.")


def transient_documents(results: tuple[TransientResult, ...]) -> list[dict[str, Any]]:
    """One object a set of choices, in the units as printed."""
    return [
        {
            "losses": str(r.losses),
            "rotors_counted": str(r.rotors),
            "friction_signed": r.signed,
            "speed_sun_rpm": float(SPEED_SUN.display(r.speed_sun)),
            "speed_sun_shift_rpm": float(SPEED_SUN.display(r.shift)),
            "speed_ring_rpm": float(SPEED_RING.display(r.speed_ring)),
            "power_in_W": r.power_in,
            "power_out_W": r.power_out,
            "lowest_speed_sun_rpm": float(SPEED_SUN.display(r.lowest)),
            "engaged_from_s": r.engaged_from,
            "largest_voltage_V": r.voltage,
        }
        for r in results
    ]
