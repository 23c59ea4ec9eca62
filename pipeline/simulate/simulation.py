"""Simulate a scenario: steady points, a run in time, a frequency response; arrays out, no files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.simulate.steady_points import SteadyPoints, steady_points
from pmg.sim.dynamics.equilibrium import equilibrium
from pmg.sim.dynamics.limits import limits_reached
from pmg.sim.dynamics.linear import check_control, frequency_response, linearise
from pmg.sim.dynamics.state import SetPoints
from pmg.sim.dynamics.transient import Task, transient
from pmg.sim.grid import Configuration
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.simulate.inputs import Inputs
    from pmg.pipeline.simulate.scenario import Response, Scenario
    from pmg.pipeline.simulate.scenario import Transient as Asked
    from pmg.sim.dynamics.linear import ControlVerdict, FrequencyResponse, Mode
    from pmg.sim.dynamics.trace import Trace
    from pmg.sim.signals import Array

NANO = 1e-9
"""Instants are asked for to the nanosecond, so that those of table and recording that are meant alike are one."""

ABOVE_ONE = 1e-9
"""Efficiencies above one by less than this are one: rounding."""


@dataclass(frozen=True)
class Run:
    """A run in time.

    Parameters
    ----------
    trace : Trace
        At the instants of the table.
    recorded : Trace or None
        At those of a recorder; None where nobody asked, or the layout has no place for the run.
    """

    trace: Trace
    recorded: Trace | None

    @property
    def slipped(self) -> bool:
        """Whether a pole slipped."""
        return bool(len(self.trace.slips))


@dataclass(frozen=True)
class Answer:
    """A frequency response and the state it belongs to.

    Parameters
    ----------
    side : str
        Motor whose set torque varies.
    about : str
        The steady state, for people.
    response : FrequencyResponse
        The speeds' answer.
    """

    side: str
    about: str
    response: FrequencyResponse


@dataclass(frozen=True)
class Simulation:
    """All that a scenario gave.

    Parameters
    ----------
    control : ControlVerdict
        Whether the torque loops are stable.
    points : SteadyPoints or None
        Point and grid.
    run : Run or None
        Run in time.
    answer : Answer or None
        Frequency response.
    modes : tuple of Mode
        Of the state of the response, else of the end of the run.
    """

    control: ControlVerdict
    points: SteadyPoints | None
    run: Run | None
    answer: Answer | None
    modes: tuple[Mode, ...]

    @property
    def partial(self) -> bool:
        """Whether the run ended before its time."""
        return self.run is not None and self.run.trace.stopped is not None


def simulate(scenario: Scenario, inputs: Inputs) -> Simulation:
    """Simulate a scenario.

    Parameters
    ----------
    scenario : Scenario
        What to do.
    inputs : Inputs
        With which model.

    Raises
    ------
    BenchError
        When the torque loops are unstable as set, or a state that was asked for does not exist.
    """
    control = check_control(inputs.drivetrain)
    if scenario.transient is not None or scenario.response is not None:
        control.enforce()
    asks_points = scenario.point is not None or scenario.grid is not None
    points = steady_points(scenario, inputs) if asks_points else None
    run = None if scenario.transient is None else _run(scenario, scenario.transient, inputs)
    answer: Answer | None = None
    modes: tuple[Mode, ...] = ()
    if scenario.response is not None:
        answer, state = _answer(scenario, scenario.response, inputs, points)
        modes = linearise(inputs.drivetrain, state)
    elif run is not None and run.trace.stopped is None:
        modes = linearise(inputs.drivetrain, run.trace.last)
    return Simulation(control, points, run, answer, modes)


def _run(scenario: Scenario, asked: Asked, inputs: Inputs) -> Run:
    output, drivetrain = scenario.output, inputs.drivetrain
    start = None
    if asked.start == "steady":
        start = equilibrium(drivetrain, float(inputs.sun.value(0.0)), float(inputs.ring.value(0.0))).state[:, 0]
    last = round(asked.duration_s / NANO)
    shown = np.rint(np.linspace(0.0, asked.duration_s, asked.outputs) / NANO).astype(np.int64)
    wanted = "mcap" in output.formats and recordable(scenario)
    taken = np.empty(0, dtype=np.int64)
    if wanted:
        samples = np.arange(int(asked.duration_s * output.rate_hz + NANO) + 1)
        taken = np.rint(samples / (output.rate_hz * NANO)).astype(np.int64)
    instants = np.unique(np.minimum(np.concatenate((shown, taken)), last))
    trace = transient(
        Task(
            drivetrain,
            inputs.sun,
            inputs.ring,
            asked.duration_s,
            start=start,
            times=np.minimum(instants * NANO, asked.duration_s),
        ),
        rtol=asked.rtol,
        on_slip=asked.on_slip,
        solver=asked.solver,
    )
    n = min(len(trace.time), len(instants))
    if trace.stopped is not None and abs(trace.time[n - 1] - instants[n - 1] * NANO) > 0.5 * NANO:
        n -= 1  # the last is the instant of the slip
    reached = instants[:n]
    rows = np.union1d(np.flatnonzero(np.isin(reached, shown)), [len(trace.time) - 1])
    recorded = _at(trace, np.flatnonzero(np.isin(reached, taken))) if wanted else None
    return Run(_at(trace, rows), recorded)


def _at(trace: Trace, rows: npt.NDArray[np.int64]) -> Trace:
    """The run at some of its instants."""
    asked = SetPoints(*(np.asarray(value)[rows] for value in trace.asked))
    return replace(trace, time=trace.time[rows], state=trace.state[:, rows], asked=asked)


def recordable(scenario: Scenario) -> bool:
    """Whether the layout of recordings has a place for it: it holds the carrier and does not say otherwise."""
    return scenario.bench.held == "carrier"


def encoder_angles(trace: Trace) -> tuple[Array, Array]:
    """Angles that the encoders of the two motors see [rad], unwrapped."""
    q = trace.drivetrain.constants
    sun, phase, block = (trace[name] for name in ("angle_sun", "phase", "angle_block"))
    if q.ring_held:
        turned = (q.p_s * sun + q.p_r * block - phase) / q.Q
    else:
        turned = (phase - q.p_s * sun + q.Q_map * block) / q.p_r
    return sun + trace["twist_sun"], turned + trace["twist_ring"]


def _answer(scenario: Scenario, given: Response, inputs: Inputs, points: SteadyPoints | None) -> tuple[Answer, Array]:
    """The response, and the steady state it belongs to."""
    drivetrain, q = inputs.drivetrain, inputs.drivetrain.constants
    if scenario.point is not None and points is not None:
        torques = (points.grid.torque_sun[0], points.grid.torque_ring[0])
        speeds = (points.grid.points.speed_sun[0], points.speed_ring_motor[0])
        asked = tuple(float(w if side.by_speed else t) for t, w, side in zip(torques, speeds, q[-2:], strict=True))
        about = "the steady state of [point]"
    else:
        assert scenario.transient is not None  # the reader asks for one of the two
        end = scenario.transient.duration_s
        asked = (float(inputs.sun.value(end)), float(inputs.ring.value(end)))
        about = "the steady state at what is asked for at the end of the run"
    state = equilibrium(drivetrain, *asked).state[:, 0]
    frequency = np.geomspace(given.from_hz, given.to_hz, given.points) * REVOLUTION
    response = frequency_response(drivetrain, state, frequency, given.side)
    return Answer(given.side, about, response), state


def findings_of(simulation: Simulation, scenario: Scenario, inputs: Inputs) -> tuple[Remark, ...]:
    """Remarks on a simulation: severity, where, message."""
    found: list[tuple[str, str, str]] = []
    points, run = simulation.points, simulation.run
    if points is not None:
        name = points.grid.points.name
        above = np.flatnonzero(points.values["efficiency_magnetic"] > 1.0 + ABOVE_ONE)
        if len(above):
            message = f"magnetic efficiency above 1 at {len(above)} points: {', '.join(name[above[:5]])}"
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
                ("warning", "transient", f"{len(run.trace.slips)} poles slipped, first at {run.trace.slips[0]:.4g} s")
            )
        elif np.isnan(run.trace.locked_at) and scenario.bench.configuration is Configuration.ENGAGED:
            found.append(("info", "transient", "the gear still swings at the end of the run"))
        found += [
            ("warning", "transient", f"{limit.words}; its loop asks for more") for limit in limits_reached(run.trace)
        ]
    found += _beyond_data(simulation, inputs)
    found += _held(simulation, scenario, inputs)
    if not recordable(scenario) and "mcap" in scenario.output.formats:
        message = "no recordings: their layout cannot say that the ring is held, and they would pass for others"
        found.append(("info", "output.formats", message))
    return tuple(Remark(*parts) for parts in found)


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
