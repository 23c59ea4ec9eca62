"""A simulation as tables and as JSON: one row a point, an instant or a frequency; units in the names."""

from __future__ import annotations

import re
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from pmg.pipeline.fit.document import number
from pmg.pipeline.fit.losses import QUANTITIES
from pmg.pipeline.recording.remark import Remark
from pmg.sim.dynamics.assumptions import Assumptions
from pmg.sim.mechanisms import Torques
from pmg.sim.signals import REVOLUTION, SPEED_RING, SPEED_SUN
from pmg.sim.steady.power_chain import PowerChain

if TYPE_CHECKING:
    from pmg.pipeline.simulate.inputs import Inputs
    from pmg.pipeline.simulate.scenario import Scenario
    from pmg.pipeline.simulate.simulation import Answer, Run, Simulation
    from pmg.pipeline.simulate.steady_points import SteadyPoints
    from pmg.sim.dynamics.linear import Mode
    from pmg.sim.dynamics.trace import Trace

SCHEMA = "pmg.simulation/1"

GROUPS = ("supplied", "stored", "dissipated", "created")
"""Groups of the power balance."""

_MECHANICAL = {"mechanical_in", "mechanical_out", "unexplained"}
"""Parts of the chain that stand in the table already, or are zero for the simulator's own torques."""


def _slug(text: str) -> str:
    """A title as part of a column's name."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def _frame(columns: dict[str, Any]) -> pl.DataFrame:
    """A table; what there is no number for is empty, and no zero is negative."""
    return pl.DataFrame(columns).with_columns(pl.col(pl.Float64).fill_nan(None) + 0.0)


def points_frame(points: SteadyPoints, scenario: Scenario) -> pl.DataFrame:
    """Steady points, one row each: what is asked for, speeds, torques, losses, efficiencies, power chains."""
    grid, at = points.grid, points.grid.points
    columns: dict[str, Any] = {
        "point": at.name.tolist(),
        "configuration": at.configuration.tolist(),
        "gear": at.gear,
        "held": [str(scenario.bench.held)] * len(at),
        "drive": at.drive.tolist(),
        "load_set_Nm": at.load_set,
        "speed_sun_rpm": SPEED_SUN.display(at.speed_sun),
        "speed_ring_rpm": SPEED_RING.display(at.speed_ring),
        "speed_carrier_rpm": SPEED_RING.display(points.speed_carrier),
        "speed_ring_motor_rpm": SPEED_RING.display(points.speed_ring_motor),
        "torque_sun_Nm": grid.torque_sun,
        "torque_ring_Nm": grid.torque_ring,
        "load_angle_rad": points.load_angle,
    }
    columns |= _shown(Torques(grid.torque_sun, grid.torque_ring), points.readings)
    for signal in QUANTITIES:
        columns[signal.name + ("_W" if signal.unit == "W" else "")] = points.values[signal.name]
    columns |= {f"loss_{name}_W": loss for name, loss in points.losses.items()}
    for convention, chain in points.chains.items():
        for part in fields(PowerChain):
            if part.name != "drive_ring" and part.name not in _MECHANICAL:
                value = getattr(chain, part.name)
                is_motor = "electric" in part.name or "motor" in part.name
                columns[f"{convention}_{part.name}_W" if is_motor else f"chain_{part.name}_W"] = value
    return _frame(columns)


def _shown(true: Torques, readings: Torques) -> dict[str, Any]:
    """Readings of the transducers, where a fault distorts them."""
    if np.array_equal(true.sun, readings.sun) and np.array_equal(true.ring, readings.ring):
        return {}
    return {"reading_sun_Nm": readings.sun, "reading_ring_Nm": readings.ring}


def transient_frame(trace: Trace) -> pl.DataFrame:
    """A run in time, one row an instant."""
    n, q = len(trace.time), trace.drivetrain.constants
    m = trace.drivetrain.motion(trace.state, trace.asked)
    columns: dict[str, Any] = {"time_s": trace.time}
    for name in ("sun_motor", "sun", "ring", "ring_motor", "carrier"):
        columns[f"speed_{name}_rpm"] = SPEED_SUN.display(trace[f"speed_{name}"])
    for name, side, asked in (("sun", q.sun, trace.asked.sun), ("ring", q.ring, trace.asked.ring)):
        value = SPEED_SUN.display(asked) if side.by_speed else np.asarray(asked)
        columns[f"asked_{name}_{'rpm' if side.by_speed else 'Nm'}"] = value
    columns |= {
        "torque_sun_Nm": m.sun.torque_out,
        "torque_ring_Nm": m.ring.torque_out,
        "torque_magnetic_sun_Nm": m.magnetic_sun,
        "torque_magnetic_ring_Nm": m.magnetic_ring,
        "torque_magnetic_carrier_Nm": m.magnetic_carrier,
        "phase_rad": trace["phase"],
        "twist_sun_rad": trace["twist_sun"],
        "twist_ring_rad": trace["twist_ring"],
        "twist_block_rad": trace["angle_block"],
        "current_sun_A": trace["current_sun"],
        "current_ring_A": trace["current_ring"],
        **_shown(Torques(trace.torque_sun, trace.torque_ring), trace.readings),
        "power_sun_W": m.sun.torque_out * trace["speed_sun_motor"],
        "power_ring_W": m.ring.torque_out * trace["speed_ring_motor"],
    }
    powers = trace.powers()
    for group in GROUPS:
        columns |= {f"{group}_{_slug(name)}_W": value for name, value in getattr(powers, group).items()}
    return _frame({name: np.broadcast_to(np.asarray(value, dtype=np.float64), n) for name, value in columns.items()})


def response_frame(answer: Answer) -> pl.DataFrame:
    """A frequency response, one row a frequency."""
    found = answer.response
    columns: dict[str, Any] = {"frequency_Hz": found.frequency / REVOLUTION}
    for name, value in (("sun", found.speed_sun), ("ring", found.speed_ring)):
        columns[f"speed_{name}_rpm_per_Nm"] = SPEED_SUN.display(np.abs(value))
        columns[f"phase_{name}_deg"] = np.degrees(np.unwrap(np.angle(value)))
    return _frame(columns)


def summary_document(
    simulation: Simulation,
    scenario: Scenario,
    inputs: Inputs,
    findings: tuple[Remark, ...],
    source: dict[str, str],
) -> dict[str, Any]:
    """All but the long tables, as JSON."""
    points, run = simulation.points, simulation.run
    return {
        "schema": SCHEMA,
        "simulated": True,
        "title": scenario.title,
        "scenario": source,
        "campaign": scenario.output.campaign,
        "bench": {name: _plain(value) for name, value in scenario.bench},
        "assumptions": {f.name: _plain(getattr(scenario.assumptions, f.name)) for f in fields(Assumptions)},
        "model": dict(inputs.facts),
        "control": {
            "stable": bool(simulation.control.stable),
            "setting": simulation.control.setting,
            "statement": simulation.control.statement,
        },
        "points": None if points is None else _points_document(points, scenario),
        "transient": None if run is None else _run_document(run),
        "response": None if simulation.answer is None else _answer_document(simulation.answer),
        "modes": [_mode_document(mode) for mode in simulation.modes],
        "findings": [remark.to_dict() for remark in findings],
    }


def _plain(value: object) -> Any:  # noqa: ANN401  (any JSON scalar)
    return value if value is None or isinstance(value, bool | int | float) else str(value)


def _points_document(points: SteadyPoints, scenario: Scenario) -> dict[str, Any]:
    row = points_frame(points, scenario).row(0, named=True)
    return {"count": len(points.grid), "point": row if scenario.point is not None else None}


def _run_document(run: Run) -> dict[str, Any]:
    trace, account = run.trace, run.trace.energy
    last = transient_frame(trace).row(-1, named=True)
    stopped = trace.stopped
    return {
        "ended_s": float(trace.time[-1]),
        "stopped": None
        if stopped is None
        else {"where": stopped.where, "came": stopped.came, "expected": stopped.expected, "do": stopped.do},
        "slips_s": [float(time) for time in trace.slips],
        "locked_at_s": number(trace.locked_at),
        "steps": int(trace.steps),
        "end": {name: value for name, value in last.items() if name.startswith(("speed", "torque", "phase"))},
        "energy_J": {group: dict(getattr(account, group)) for group in GROUPS},
        "energy_residual": float(account.residual),
    }


def _answer_document(answer: Answer) -> dict[str, Any]:
    return {
        "side": answer.side,
        "about": answer.about,
        "points": len(answer.response.frequency),
        "resonances": [_mode_document(mode) for mode in answer.response.resonances],
    }


def _mode_document(mode: Mode) -> dict[str, Any]:
    return {
        "name": str(mode.kind),
        "frequency_Hz": float(mode.frequency / REVOLUTION),
        "damping_ratio": float(mode.damping_ratio),
        "real_1_s": float(mode.eigenvalue.real),
        "imaginary_rad_s": float(mode.eigenvalue.imag),
    }
