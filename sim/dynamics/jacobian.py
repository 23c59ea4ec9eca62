"""Derivative of the equations of motion with respect to the state: analytic, sparse."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from pmg.sim.dynamics.constants import Constants, Side
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.state import STATES, State

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.sim.signals import Array, Number

Entries = dict[tuple[str, str], "Number"]
"""Non-zero elements by the names of their row (rate) and column (state)."""

_STEP = 1e-30
"""Imaginary step of the complex-step derivative [rad/s]; it cancels nothing, so it may be as small as one likes."""


def _drag_slopes(drivetrain: Drivetrain, x: State) -> tuple[Number, Number, Number, Number, Number]:
    """Slopes of the drags [N m s/rad]: sun/sun, sun/ring, ring/sun, ring/ring, carrier/carrier.

    By complex step on the mechanisms' own laws, which is exact to rounding: a law stays one equation.
    """
    rest = drivetrain.constants.rest
    total: list[Number] = [0.0] * 5
    for law in drivetrain.losses:
        by_sun = law.law(x.speed_sun + 1j * _STEP, x.speed_ring + 0j, rest)
        by_ring = law.law(x.speed_sun + 0j, x.speed_ring + 1j * _STEP, rest)
        carrier = law.carrier_law(x.speed_carrier + 1j * _STEP, rest)
        parts = (by_sun.sun, by_ring.sun, by_sun.ring, by_ring.ring, carrier)
        total = [t + np.imag(part) / _STEP for t, part in zip(total, parts, strict=True)]
    return total[0], total[1], total[2], total[3], total[4]


def _motor_entries(q: Constants, side: Side, name: str) -> Entries:
    """Rows of one motor: speed, current, integral, feedback and filtered error."""
    w, i, rotor, twist = f"speed_{name}_motor", f"current_{name}", f"speed_{name}", f"twist_{name}"
    fb, integral, filtered = f"feedback_{name}", f"integral_{name}", f"filtered_{name}"
    J = side.inertia + side.rotor_inertia
    acceleration = {i: q.K_c / J, w: -(side.friction + q.c) / J, twist: -q.k / J, rotor: q.c / J}
    sensed = side.rotor_inertia if q.sensed else 0.0
    out = {state: -sensed * value for state, value in acceleration.items()}
    out[i] += q.K_c
    out[w] -= side.friction
    d_feedback = {state: value / q.tau for state, value in out.items()} | {fb: -1.0 / q.tau}
    d_filtered = {fb: -q.N * q.K_fb, filtered: -q.N}
    derivative = {state: -q.K_fb * value for state, value in d_feedback.items()} if q.ideal else d_filtered
    d_current = {state: q.K_A * q.K_d * value / q.L for state, value in derivative.items()}
    proportional = {
        fb: -q.K_A * q.K_p * q.K_fb / q.L,
        integral: q.K_A * q.K_i / q.L,
        w: -side.back_emf / q.L,
        i: -q.R / q.L,
    }
    for state, value in proportional.items():
        d_current[state] = d_current.get(state, 0.0) + value
    rows = {w: acceleration, i: d_current, integral: {fb: -q.K_fb}, fb: d_feedback, filtered: d_filtered}
    return {(row, column): value for row, columns in rows.items() for column, value in columns.items()}


def entries(drivetrain: Drivetrain, state: Iterable[Number]) -> Entries:
    """Non-zero elements of the Jacobian, by name."""
    q, x = drivetrain.constants, State(*state)
    sun_sun, sun_ring, ring_sun, ring_ring, carrier = _drag_slopes(drivetrain, x)
    stiffness = q.T_max * np.cos(x.phase)
    found: Entries = {
        ("twist_sun", "speed_sun_motor"): 1.0,
        ("twist_sun", "speed_sun"): -1.0,
        ("twist_ring", "speed_ring_motor"): 1.0,
        ("twist_ring", "speed_ring"): -1.0,
        ("phase", "speed_sun"): q.p_s,
        ("phase", "speed_ring"): q.p_r,
        ("phase", "speed_carrier"): -q.Q_map,
        ("angle_carrier", "speed_carrier"): 1.0,
        ("speed_carrier", "angle_carrier"): -q.k / q.J_c,
        ("speed_carrier", "speed_carrier"): (carrier - q.c) / q.J_c,
        ("speed_carrier", "phase"): q.Q / q.p_s * stiffness / q.J_c,
        ("speed_sun", "twist_sun"): q.k / q.J_s,
        ("speed_sun", "speed_sun_motor"): q.c / q.J_s,
        ("speed_sun", "speed_sun"): (sun_sun - q.c) / q.J_s,
        ("speed_sun", "speed_ring"): sun_ring / q.J_s,
        ("speed_sun", "phase"): -stiffness / q.J_s,
        ("speed_ring", "twist_ring"): q.k / q.J_r,
        ("speed_ring", "speed_ring_motor"): q.c / q.J_r,
        ("speed_ring", "speed_ring"): (ring_ring - q.c) / q.J_r,
        ("speed_ring", "speed_sun"): ring_sun / q.J_r,
        ("speed_ring", "phase"): -q.p_r / q.p_s * stiffness / q.J_r,
        ("angle_sun", "speed_sun"): 1.0,
    }
    return found | _motor_entries(q, q.sun, "sun") | _motor_entries(q, q.ring, "ring")


def dense(drivetrain: Drivetrain, state: Iterable[Number]) -> Array:
    """Jacobian as a full array (..., 18, 18): the further axes of the state come first."""
    x = State(*state)
    whole = np.zeros((*np.shape(x.phase), len(STATES), len(STATES)))
    for (row, column), value in entries(drivetrain, x).items():
        whole[..., STATES.index(row), STATES.index(column)] = value
    return whole


def jacobian(drivetrain: Drivetrain, state: Iterable[Number]) -> sparse.csc_array:
    """Jacobian at one state, sparse."""
    found = entries(drivetrain, state)
    rows = [STATES.index(row) for row, _ in found]
    columns = [STATES.index(column) for _, column in found]
    size = len(STATES)
    return sparse.csc_array((np.array(list(found.values()), dtype=np.float64), (rows, columns)), shape=(size, size))
