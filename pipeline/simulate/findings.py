"""Remarks on a simulation: what a reader of its results should know before using them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.simulate.simulation import ABOVE_ONE, recordable
from pmg.pipeline.wording.plurals import counted
from pmg.sim.dynamics.limits import limits_reached
from pmg.sim.grid import Configuration

if TYPE_CHECKING:
    from pmg.pipeline.simulate.inputs import Inputs
    from pmg.pipeline.simulate.scenario import Scenario
    from pmg.pipeline.simulate.simulation import Simulation


def findings_of(simulation: Simulation, scenario: Scenario, inputs: Inputs) -> tuple[Remark, ...]:
    """Remarks on a simulation: severity, where, message."""
    found: list[tuple[str, str, str]] = []
    points, run = simulation.points, simulation.run
    if points is not None:
        name = points.grid.points.name
        above = np.flatnonzero(points.values["efficiency_magnetic"] > 1.0 + ABOVE_ONE)
        if len(above):
            message = f"magnetic efficiency above 1 at {counted(len(above), 'point')}: {', '.join(name[above[:5]])}"
            found.append(("warning", "efficiency", message))
        several = np.flatnonzero(points.balances > 1)
        if len(several):
            message = f"the torques balance at more than one speed; the first from rest is given: {name[several[0]]}"
            found.append(("warning", "point", message))
    if run is not None:
        if run.trace.stopped is not None:
            found.append(("error", run.trace.stopped.where, f"{run.trace.stopped.came}. {run.trace.stopped.do}"))
        elif run.slipped:
            found.append(
                (
                    "warning",
                    "transient",
                    f"{counted(len(run.trace.slips), 'pole')} slipped, first at {run.trace.slips[0]:.4g} s",
                )
            )
        elif np.isnan(run.trace.locked_at) and scenario.bench.configuration is Configuration.ENGAGED:
            found.append(("info", "transient", "the gear still swings at the end of the run"))
        found += [
            ("warning", "transient", f"{limit.words}; its loop asks for more")
            for limit in limits_reached(run.trace)
            if max(last - first for first, last in limit.stretches) >= SHORT_OF_LIMIT
        ]
    found += _beyond_data(simulation, inputs)
    found += _held(simulation, scenario, inputs)
    if not recordable(scenario) and "mcap" in scenario.output.formats:
        held = scenario.bench.held
        message = f"no recordings: their layout cannot say that the {held} is held, and they would pass for others"
        found.append(("info", "output.formats", message))
    return tuple(Remark(*parts) for parts in found)


SHORT_OF_LIMIT = 0.01
"""A motor at its limit for less is answering to a jump of what is asked for; the report tells of that too [s]."""

LONG_RUN = 0.1
"""Part of a thermal time constant beyond which a run is long for a warmth that is held."""


def _held(simulation: Simulation, scenario: Scenario, inputs: Inputs) -> list[tuple[str, str, str]]:
    """Remarks on values held over a run or left out of settled points."""
    found = []
    if simulation.run is not None and inputs.limits:
        lasts, shortest = float(simulation.run.trace.time[-1]), min(inputs.limits)
        if lasts > LONG_RUN * shortest:
            message = f"warmth is held at its start over the run of {lasts:g} s; its time constant is {shortest:g} s"
            found.append(("warning", "transient", message))
    drifts = any(fault.memory for fault in inputs.drivetrain.instruments)
    if simulation.points is not None and drifts and scenario.bench.history == "settled":
        message = 'settled points have no time, so no zero drifts; set history = "run" to have it'
        found.append(("warning", "bench.history", message))
    return found


def _beyond_data(simulation: Simulation, inputs: Inputs) -> list[tuple[str, str, str]]:
    """Speeds beyond those that the loss curves were fitted to."""
    if inputs.losses is None:
        return []
    found = []
    curves = {"sun": inputs.losses.curve_sun, "ring": inputs.losses.curve_ring}
    for side, curve in curves.items():
        speeds = []
        if simulation.points is not None:
            speeds.append(getattr(simulation.points.grid.points, f"speed_{side}"))
        if simulation.run is not None:
            speeds.append(simulation.run.trace[f"speed_{side}"])
        largest = max((float(np.abs(values).max()) for values in speeds), default=0.0)
        if largest > curve.speed_limit * (1.0 + ABOVE_ONE):
            message = (
                f"{side} up to {largest:.4g} rad/s, tested to {curve.speed_limit:.4g} rad/s; beyond, its loss curve "
                "goes on along its tangent"
            )
            found.append(("warning", "losses", message))
    return found
