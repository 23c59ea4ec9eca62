"""The reference solver: scipy's Radau IIA of order five, on the equations as they are written."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from pmg.sim.dynamics.account import integrands
from pmg.sim.dynamics.jacobian import dense
from pmg.sim.dynamics.segments import follow
from pmg.sim.dynamics.state import SetPoints, State

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.dynamics.drivetrain import Drivetrain
    from pmg.sim.dynamics.segments import Legs
    from pmg.sim.signals import Array

_NODES = np.array([(4.0 - np.sqrt(6.0)) / 10.0, (4.0 + np.sqrt(6.0)) / 10.0, 1.0])
_WEIGHTS = np.array([(16.0 - np.sqrt(6.0)) / 36.0, (16.0 + np.sqrt(6.0)) / 36.0, 1.0 / 9.0])


class Course(NamedTuple):
    """Result of a run of either solver.

    `failed` says why no step converges; `slipped_at` is the time of the slip that ended the run, or NaN; `states`
    belong to the first of the wanted instants; `sums` are the integrals of `account.integrands` [J].
    """

    states: Array
    last: Array
    time: float
    slips: Array
    slipped_at: float
    locked_at: float
    steps: int
    sums: Array
    failed: str


def _asked_at(rows: Array, time: float) -> SetPoints:
    """Demands on both motors, one segment at a time."""
    sun, ring = follow(rows[0], time), follow(rows[1], time)
    return SetPoints(sun[0], ring[0], sun[1], ring[1])


def course(
    drivetrain: Drivetrain,
    start: Array,
    legs: Legs,
    instants: Array,
    scales: Array,
    rtol: float,
    *,
    stop: bool,
    locked: float,
) -> Course:
    """Run through the legs.

    Notes
    -----
    One-step and L-stable, which the torque loop (10^6 1/s) next to the lightly damped magnetic oscillation (16 Hz) asks
    for. The run begins anew at each leg. Energies are summed at the collocation points of the steps with the method's
    own weights: there the state meets the equations to rounding.
    """
    y, begin, steps = np.array(start, dtype=np.float64), 0.0, 0
    columns, slips, locks = [np.repeat(y[:, None], int(np.count_nonzero(instants <= 0.0)), axis=1)], [], []
    total = np.zeros(len(integrands(drivetrain, y)))
    slipped_at, failed = math.nan, ""
    for end, rows in zip(legs.ends.tolist(), legs.rows, strict=True):
        inside = instants[(instants > begin) & (instants <= end)]
        with np.errstate(over="ignore", invalid="ignore"):
            run: Any = solve_ivp(
                _rates(drivetrain, rows),
                (begin, end),
                y,
                method="Radau",
                t_eval=np.union1d(inside, [end]),
                dense_output=True,
                events=_events(drivetrain, stop, locked),
                jac=_jacobian(drivetrain, rows),
                rtol=rtol,
                atol=rtol * scales,
            )
        if run.status < 0 or not np.isfinite(run.y).all():
            failed, begin = run.message.rstrip("."), float(run.t[-1]) if len(run.t) else begin
            break
        h = np.diff(run.sol.ts)
        nodes = (run.sol.ts[:-1, None] + h[:, None] * _NODES).ravel()
        total += integrands(drivetrain, run.sol(nodes)) @ (h[:, None] * _WEIGHTS).ravel()
        steps += len(h)
        slips += run.t_events[0].tolist()
        locks += run.t_events[1].tolist()
        if run.status == 1:
            begin, y = slips[-1], run.y_events[0][0]
            if len(run.t):
                columns.append(run.y[:, np.isin(run.t, inside)])
            slipped_at = begin
            break
        columns.append(run.y[:, np.isin(run.t, inside)])
        begin, y = end, run.y[:, -1]
    slow = drivetrain.coupling is not None and abs(drivetrain.rates(y.tolist(), SetPoints()).phase) < locked
    locked_at = (locks[-1] if locks else 0.0) if slow and math.isnan(slipped_at) else math.nan
    states = np.concatenate(columns, axis=1).T
    return Course(states, y, begin, np.array(slips), slipped_at, locked_at, steps, total, failed)


def _rates(drivetrain: Drivetrain, rows: Array) -> Callable[[float, Array], Array]:
    def rates(time: float, y: Array) -> Array:
        return np.array(drivetrain.rates(y.tolist(), _asked_at(rows, time)))

    return rates


def _jacobian(drivetrain: Drivetrain, rows: Array) -> Callable[[float, Array], Array]:
    def jacobian(time: float, y: Array) -> Array:
        return dense(drivetrain, y, _asked_at(rows, time))

    return jacobian


def _events(drivetrain: Drivetrain, stop: bool, locked: float) -> list[Callable[[float, Array], float]]:
    """A slipped pole (the phase passes the top between two wells) and the way into lock."""
    q, coupled, centre = drivetrain.constants, drivetrain.coupling is not None, drivetrain.centre

    def slip(_: float, y: Array) -> float:
        return math.cos(0.5 * (State(*y).phase - centre)) if coupled else 1.0

    def lock(_: float, y: Array) -> float:
        x = State(*y)
        rate = q.p_s * x.speed_sun + q.p_r * x.speed_ring - q.Q_map * x.speed_carrier
        return float(abs(rate) - locked)

    # attributes are how solve_ivp learns of an event
    slip.terminal = stop  # type: ignore[attr-defined]
    lock.direction = -1.0  # type: ignore[attr-defined]
    return [slip, lock]
