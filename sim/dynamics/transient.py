"""The bench from a start state through a programme of set torques or speeds."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics import radau
from pmg.sim.dynamics.account import settle
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.kernel import kernel_of
from pmg.sim.dynamics.linear import check_control
from pmg.sim.dynamics.radau import Course
from pmg.sim.dynamics.run_values import NO_STEP, STOPPED, TOO_MANY, Settings
from pmg.sim.dynamics.segments import Legs, make_legs
from pmg.sim.dynamics.state import STATES, SetPoints, State
from pmg.sim.dynamics.trace import Trace
from pmg.sim.errors import BenchError, UnsettledRunError
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.sim.dynamics.programme import Programme
    from pmg.sim.signals import Array

SCALES = np.array(
    State(
        twist_sun=1e-4,
        twist_ring=1e-4,
        phase=1.0,
        angle_block=1e-3,
        speed_carrier=1e-1,
        speed_sun_motor=1.0,
        speed_sun=1.0,
        speed_ring=1.0,
        speed_ring_motor=1.0,
        current_sun=1.0,
        integral_sun=1e-2,
        feedback_sun=1.0,
        filtered_sun=1.0,
        current_ring=1.0,
        integral_ring=1e-2,
        feedback_ring=1.0,
        filtered_ring=1.0,
        angle_lag_sun=1.0,
        angle_lag_ring=1.0,
        angle_sun=1.0,
    )
)
"""Usual size of each state; the absolute tolerance is the relative one times this."""

LOCKED = 2.0
"""Rate of the electrical phase below which the gear counts as locked [rad/s]."""


__all__ = ["OnSlip", "Solver", "Task", "transient", "transients"]


class OnSlip(StrEnum):
    """Action when a pole slips."""

    STOP = "stop"
    GO_ON = "go on"


class Solver(StrEnum):
    """Who integrates."""

    COMPILED = "compiled"
    RADAU = "radau"


MOST_STEPS = 50_000_000
"""Steps after which a compiled run is given up: minutes."""

OUTPUTS = 2001
"""Instants reported where none are asked for."""


@dataclass(frozen=True)
class Task:
    """A run to be made.

    Parameters
    ----------
    drivetrain : Drivetrain
        The model.
    sun, ring : Programme
        What the two motors are asked for: torque [N m], or speed [rad/s] where they follow speed.
    duration : float
        Length of the run [s].
    start : (20,) array, optional
        State to start from; at rest when not given.
    times : (n,) array, optional
        Instants to report [s], increasing, from 0 to `duration`; 2001 even ones when not given.
    """

    drivetrain: Drivetrain
    sun: Programme
    ring: Programme
    duration: float
    start: Array | None = None
    times: Array | None = None


def transient(
    task: Task,
    *,
    rtol: float = 1e-6,
    on_slip: OnSlip = OnSlip.STOP,
    solver: Solver = Solver.COMPILED,
) -> Trace:
    """Run the bench through a programme.

    Parameters
    ----------
    task : Task
        The run.
    rtol : float
        Relative tolerance; the absolute one is this times `SCALES`.
    on_slip : OnSlip
        Stop at the first slipped pole, which tells in `Trace.stopped`, or go on.
    solver : Solver
        ``COMPILED`` is Rodas4 as machine code, see `rodas`; ``RADAU`` is scipy's, hundreds of times slower, on the
        equations as they are written. They agree within their tolerances.

    Raises
    ------
    BenchError
        When the torque loop is unstable as set, when an argument is out of range, or when a step does not converge.
    """
    check_control(task.drivetrain).enforce()
    return _run(task, rtol, on_slip, solver)


def transients(
    tasks: Sequence[Task], *, rtol: float = 1e-4, on_slip: OnSlip = OnSlip.STOP, threads: int = 1, energy: bool = False
) -> list[Trace]:
    """Many runs by the compiled solver, in the order given.

    Parameters
    ----------
    tasks : sequence of Task
        The runs.
    rtol, on_slip
        As in `transient`.
    threads : int
        Runs made at a time; the compiled solver lets go of the interpreter.
    energy : bool
        Whether each element's energy is summed.
    """
    checked: set[int] = set()
    for task in tasks:
        if id(task.drivetrain) not in checked:
            check_control(task.drivetrain).enforce()
            kernel_of(task.drivetrain)  # made once here, not by each thread
            checked.add(id(task.drivetrain))
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(lambda task: _run(task, rtol, on_slip, Solver.COMPILED, energy), tasks))


def _run(task: Task, rtol: float, on_slip: OnSlip, solver: Solver, energy: bool = True) -> Trace:
    duration, given = task.duration, task.times
    instants = np.linspace(0.0, duration, OUTPUTS) if given is None else np.asarray(given, dtype=np.float64)
    _check(duration, instants, rtol)
    begin = _start(task.drivetrain, task.start)
    legs = make_legs(task.sun, task.ring, duration)
    stop = on_slip is OnSlip.STOP
    if solver is Solver.RADAU:
        run = radau.course(task.drivetrain, begin, legs, instants, SCALES, rtol, stop=stop, locked=LOCKED)
    else:
        run = _compiled(task.drivetrain, begin, legs, instants, rtol, stop, energy)
    if run.failed:
        raise _no_step(run.time, run.failed, rtol)
    time, states = instants[: len(run.states)], run.states
    stopped: BenchError | None = None
    if not math.isnan(run.slipped_at):
        stopped = _slipped(task, run.slipped_at)
        if not time.size or run.slipped_at > time[-1]:
            time, states = np.append(time, run.slipped_at), np.vstack((states, run.last))
    asked = SetPoints(task.sun.value(time), task.ring.value(time), task.sun.slope(time), task.ring.slope(time))
    account = settle(task.drivetrain, begin, run.last, run.sums) if run.sums.size else None
    return Trace(
        task.drivetrain, time, states.T, asked, run.locked_at, run.slips, stopped, run.steps, run.last, account
    )


def _compiled(
    drivetrain: Drivetrain, start: Array, legs: Legs, instants: Array, rtol: float, stop: bool, energy: bool
) -> Course:
    settings = Settings(rtol, SCALES, LOCKED, stop, MOST_STEPS)
    run = kernel_of(drivetrain).run(start, legs, instants, settings, energy=energy)
    failed = {NO_STEP: "the step became too small", TOO_MANY: f"not done after {MOST_STEPS} steps"}.get(run.ended, "")
    slipped_at = run.time if run.ended == STOPPED else math.nan
    return Course(run.states, run.last, run.time, run.slips, slipped_at, run.locked_at, run.steps, run.sums, failed)


def _check(duration: float, instants: Array, rtol: float) -> None:
    if not (math.isfinite(duration) and duration > 0.0):
        raise BenchError("transient: duration", f"{duration:g} s", "more than 0 s", "Give the length of the run.")
    ordered = instants.ndim == 1 and instants.size > 0 and bool((np.diff(instants) > 0.0).all())
    if not ordered or instants[0] < 0.0 or instants[-1] > duration:
        raise BenchError(
            "transient: times", "instants out of order or range", f"0 to {duration:g} s, increasing", "Sort them."
        )
    if not 1e-12 <= rtol <= 1e-2:
        raise BenchError("transient: rtol", f"{rtol:g}", "1e-12 to 1e-2", "Choose a tolerance in that range.")


def _start(drivetrain: Drivetrain, start: Array | None) -> Array:
    y = drivetrain.at_rest() if start is None else np.asarray(start, dtype=np.float64)
    if y.shape != SCALES.shape:
        raise BenchError("transient: start", f"shape {y.shape}", f"{SCALES.shape}", "Give one number for each state.")
    if not np.isfinite(y).all():
        bad = int(np.argmin(np.isfinite(y)))
        raise BenchError(f"transient: start: {STATES[bad]} is {y[bad]:g}", "no number", "finite states", "Correct it.")
    return y


def _no_step(time: float, message: str, rtol: float) -> UnsettledRunError:
    return UnsettledRunError(
        f"transient at t = {time:.6g} s",
        f"the step does not converge ({message.rstrip('.')})",
        f"a step that meets the tolerance {rtol:g}",
        "Loosen the tolerance, or look for a parameter out of its range.",
    )


def _slipped(task: Task, time: float) -> UnsettledRunError:
    sun, ring = float(task.sun.value(time)), float(task.ring.value(time))
    units = (
        "N m" if side.by_speed is False else "rad/s"
        for side in (task.drivetrain.constants.sun, task.drivetrain.constants.ring)
    )
    asked = " and ".join(
        f"{value:.3g} {unit} on the {name}" for value, unit, name in zip((sun, ring), units, SIDES, strict=True)
    )
    coupling = task.drivetrain.coupling
    assert coupling is not None  # nothing else slips
    return UnsettledRunError(
        f"transient at t = {time:.4g} s",
        f"a pole slipped at {asked}",
        f"a torque on the sun rotor below its pull-out of {coupling.pull_out.torque_high:.3g} N m, swings included",
        "Lower or slow what is asked, start nearer to the middle of the well, or raise map_scale.",
    )
