"""The bench from a start state through a torque programme."""

from __future__ import annotations

import math
from enum import StrEnum
from functools import reduce
from operator import add
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from pmg.sim.dynamics.account import Account, account
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.jacobian import jacobian
from pmg.sim.dynamics.linear import check_control
from pmg.sim.dynamics.state import STATES, SetTorques, State
from pmg.sim.dynamics.trace import Trace
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy import sparse

    from pmg.sim.dynamics.programme import Programme
    from pmg.sim.signals import Array, Number

SCALES = np.array(
    State(
        twist_sun=1e-4,
        twist_ring=1e-4,
        phase=1.0,
        angle_carrier=1e-3,
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
        angle_sun=1.0,
    )
)
"""Usual size of each state; the absolute tolerance is the relative one times this."""

LOCKED = 2.0
"""Rate of the electrical phase below which the gear counts as locked [rad/s]."""


class OnSlip(StrEnum):
    """What to do when a pole slips."""

    STOP = "stop"
    GO_ON = "go on"


class _Leg(NamedTuple):
    """A stretch between two corners of the programmes, on which both are straight lines."""

    begin: float
    end: float
    sun: float
    ring: float
    slope_sun: float
    slope_ring: float

    def asked(self, time: Number) -> SetTorques:
        dt = time - self.begin
        return SetTorques(self.sun + self.slope_sun * dt, self.ring + self.slope_ring * dt, *self[4:])


def _legs(sun: Programme, ring: Programme, duration: float) -> list[_Leg]:
    knots = np.concatenate((sun.times, ring.times))
    corners = np.unique(np.concatenate(([0.0, duration], knots[(knots > 0.0) & (knots < duration)])))
    lines = zip(sun.torque(corners), ring.torque(corners), sun.slope(corners), ring.slope(corners), strict=True)
    ends = zip(corners[:-1], corners[1:], lines, strict=False)
    return [_Leg(float(a), float(b), *(float(value) for value in line)) for a, b, line in ends]


def transient(
    drivetrain: Drivetrain,
    sun: Programme,
    ring: Programme,
    duration: float,
    *,
    start: Array | None = None,
    times: Array | None = None,
    rtol: float = 1e-6,
    on_slip: OnSlip = OnSlip.STOP,
) -> Trace:
    """Run the bench through a programme of set torques.

    Parameters
    ----------
    drivetrain : Drivetrain
        The model.
    sun, ring : Programme
        Set torques of the two motors.
    duration : float
        Length of the run [s].
    start : (18,) array, optional
        State to start from; at rest when not given.
    times : (n,) array, optional
        Instants to report [s], increasing, from 0 to `duration`; 2001 even ones when not given.
    rtol : float
        Relative tolerance; the absolute one is this times `SCALES`.
    on_slip : OnSlip
        Stop at the first slipped pole, which tells in `Trace.stopped`, or go on.

    Raises
    ------
    BenchError
        When the torque loop is unstable as set, when an argument is out of range, or when a step does not converge.

    Notes
    -----
    Radau IIA of order five with the analytic sparse Jacobian: one-step and L-stable, which the torque loop
    (10^6 1/s) beside the lightly damped magnetic oscillation (16 Hz) asks for. The run is split at the corners of
    the programmes.
    """
    instants = np.linspace(0.0, duration, 2001) if times is None else np.asarray(times, dtype=np.float64)
    _check(duration, instants, rtol)
    check_control(drivetrain).enforce()
    y = _start(drivetrain, start)
    columns, seen, slips, locks, steps = [y[:, None]], [0.0], [], [], 0
    flows: list[Account] = []
    stopped: BenchError | None = None
    for leg in _legs(sun, ring, duration):
        inside = instants[(instants > leg.begin) & (instants <= leg.end)]
        wanted = np.union1d(inside, [leg.end])
        with np.errstate(over="ignore", invalid="ignore"):
            run = solve_ivp(
                _rates(drivetrain, leg),
                (leg.begin, leg.end),
                y,
                method="Radau",
                t_eval=wanted,
                dense_output=True,
                events=_events(drivetrain, on_slip),
                jac=_sparse(drivetrain),
                rtol=rtol,
                atol=rtol * SCALES,
            )
        if run.status < 0 or not np.isfinite(run.y).all():
            raise _no_step(run.t[-1] if len(run.t) else leg.begin, run.message, rtol)
        solution: Any = run.sol
        flows.append(account(drivetrain, solution.ts, solution, leg.asked))
        steps += len(solution.ts) - 1
        at_times, at_states = run.t_events or [], run.y_events or []
        slips += list(at_times[0])
        locks += list(at_times[1])
        if run.status == 1:
            y = at_states[0][0]
            columns += [run.y, y[:, None]]
            seen += [*run.t, float(slips[-1])]
            stopped = _slipped(drivetrain, slips[-1], leg.asked(slips[-1]))
            break
        y = run.y[:, -1]
        columns.append(run.y[:, np.isin(run.t, inside)])
        seen += list(inside)
    time, state = np.array(seen), np.concatenate(columns, axis=1)
    if instants[0] > 0.0:
        time, state = time[1:], state[:, 1:]
    at_end = drivetrain.rates(y, SetTorques()).phase
    asked = SetTorques(sun.torque(time), ring.torque(time), sun.slope(time), ring.slope(time))
    locked = stopped is None and abs(at_end) < LOCKED
    locked_at = (locks[-1] if locks else 0.0) if locked else math.nan
    return Trace(drivetrain, time, state, asked, float(locked_at), np.array(slips), stopped, steps, reduce(add, flows))


def _rates(drivetrain: Drivetrain, leg: _Leg) -> Callable[[float, Array], Array]:
    def rates(time: float, y: Array) -> Array:
        return np.array(drivetrain.rates(y.tolist(), leg.asked(time)))

    return rates


def _sparse(drivetrain: Drivetrain) -> Callable[[float, Array], sparse.csc_array]:
    def jac(_: float, y: Array) -> sparse.csc_array:
        return jacobian(drivetrain, y.tolist())

    return jac


def _events(drivetrain: Drivetrain, on_slip: OnSlip) -> list[Callable[[float, Array], float]]:
    """A slipped pole (the phase passes the top between two wells) and the way into lock."""
    q = drivetrain.constants

    def slip(_: float, y: Array) -> float:
        return math.cos(0.5 * State(*y).phase)

    def lock(_: float, y: Array) -> float:
        x = State(*y)
        rate = q.p_s * x.speed_sun + q.p_r * x.speed_ring - q.Q_map * x.speed_carrier
        return float(abs(rate) - LOCKED)

    # attributes are how solve_ivp is told about an event
    slip.terminal = on_slip is OnSlip.STOP  # type: ignore[attr-defined]
    lock.direction = -1.0  # type: ignore[attr-defined]
    return [slip, lock]


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


def _no_step(time: float, message: str, rtol: float) -> BenchError:
    return BenchError(
        f"transient at t = {time:.6g} s",
        f"the step does not converge ({message.rstrip('.')})",
        f"a step that meets the tolerance {rtol:g}",
        "Loosen the tolerance, or look for a parameter out of its range.",
    )


def _slipped(drivetrain: Drivetrain, time: float, asked: SetTorques) -> BenchError:
    return BenchError(
        f"transient at t = {time:.4g} s",
        f"a pole slipped at {asked.sun:.3g} N m on the sun and {asked.ring:.3g} N m on the ring",
        f"a torque on the sun rotor below its pull-out of {drivetrain.constants.T_max:.3g} N m, swings included",
        "Lower or slow the torques, start nearer to the middle of the well, or raise map_scale.",
    )
