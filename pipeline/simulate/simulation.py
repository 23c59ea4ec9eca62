"""Simulate a scenario: steady points, a run in time, a frequency response; arrays out, no files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.simulate.steady_points import SteadyPoints, steady_points
from pmg.sim.dynamics.equilibrium import equilibrium
from pmg.sim.dynamics.linear import check_control, frequency_response, linearise
from pmg.sim.dynamics.state import SetPoints
from pmg.sim.dynamics.transient import Task, transient
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

OPENING = 1.0
"""How long the opening of a run lasts, in which the published one engages [s]."""
OPENING_INSTANTS = 1001
"""Instants of the opening."""
LONGER = 2.0
"""A run has an opening of its own where it is longer than that by this factor."""

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
    opening : Trace or None
        Its first second, each millisecond; None of a run that is hardly longer.
    """

    trace: Trace
    recorded: Trace | None
    opening: Trace | None = None

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
    asks_points = any(asked is not None for asked in (scenario.point, scenario.grid, scenario.pairs))
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
    begun = np.empty(0, dtype=np.int64)
    if asked.duration_s >= LONGER * OPENING:
        begun = np.rint(np.linspace(0.0, OPENING, OPENING_INSTANTS) / NANO).astype(np.int64)
    instants = np.unique(np.minimum(np.concatenate((shown, taken, begun)), last))
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
    opened = np.flatnonzero(np.isin(reached, begun))
    return Run(_at(trace, rows), recorded, _at(trace, opened) if len(opened) == len(begun) > 0 else None)


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
