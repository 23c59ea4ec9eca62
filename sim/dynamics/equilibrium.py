"""Steady states of the whole drivetrain at given motor torques."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.jacobian import dense
from pmg.sim.dynamics.state import STATES, SetTorques, State
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Mask, Number

SPEED_CEILING = 1e4
"""Sun speed up to which a balance is sought [rad/s]; fifty times the fastest test."""

_HALVINGS = 60
_NEWTON_STEPS = 20


def equilibrium(drivetrain: Drivetrain, torque_sun: Number, torque_ring: Number) -> Array:
    r"""Steady states (18, n) at the given set torques [N m], by Newton's method on all states at once.

    Raises
    ------
    BenchError
        When no speed balances the torques, when the load is above pull-out, or when the iteration fails.

    Notes
    -----
    The start is the rigid, locked gear: :math:`\omega_r = -\omega_s/i`, and
    :math:`T_s + \tau_s(\omega_s) = (T_r + \tau_r(\omega_r))/i` by bisection; drag that grows with speed gives one
    root, otherwise one of them is found and `linear.linearise` tells whether it is stable. The last state, a
    quadrature, is set to zero.
    """
    asked_sun, asked_ring = np.broadcast_arrays(np.atleast_1d(torque_sun), np.atleast_1d(torque_ring))
    asked = SetTorques(asked_sun.astype(np.float64), asked_ring.astype(np.float64))
    state = _locked(drivetrain, asked, _locked_speed(drivetrain, asked))
    n = len(STATES) - 1
    for _ in range(_NEWTON_STEPS):
        rates = np.array(np.broadcast_arrays(*drivetrain.rates(state, asked)))[:n]
        step = np.linalg.solve(dense(drivetrain, state)[:, :n, :n], rates.T[..., None])[..., 0].T
        state = np.concatenate((state[:n] - step, state[n:]))
        if (np.abs(step) <= 1e-12 * (np.abs(state[:n]) + 1e-3)).all():
            return state
    worst = int(np.argmax(np.abs(step).max(axis=0)))
    raise BenchError(
        _at(asked, np.arange(asked.sun.size) == worst),
        f"last Newton step {np.abs(step[:, worst]).max():.2g} in {STATES[int(np.argmax(np.abs(step[:, worst])))]}",
        "a step below rounding",
        "Choose torques further below pull-out, or wider friction at rest.",
    )


def _at(asked: SetTorques, wrong: Mask) -> str:
    first = int(np.argmax(wrong))
    return f"steady state at {asked.sun[first]:g} N m on the sun, {asked.ring[first]:g} N m on the ring"


def _locked_speed(drivetrain: Drivetrain, asked: SetTorques) -> Array:
    """Sun speed at which the rigid, locked gear balances [rad/s]."""
    q = drivetrain.constants
    ratio = q.p_r / q.p_s

    def surplus(speed: Array) -> Array:
        m = drivetrain.motion(_spinning(speed, -speed / ratio), asked)
        return np.asarray(asked.sun + m.drag_sun - (asked.ring + m.drag_ring) / ratio)

    low, high = np.full(asked.sun.shape, -SPEED_CEILING), np.full(asked.sun.shape, SPEED_CEILING)
    runaway = (surplus(low) < 0.0) | (surplus(high) > 0.0)
    if runaway.any():
        raise BenchError(
            _at(asked, runaway),
            f"the drag does not balance them below {SPEED_CEILING:g} rad/s",
            "torques that the losses can take up",
            "Bring the sun torque nearer to the ring torque divided by the ratio.",
        )
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        faster = surplus(middle) > 0.0
        low, high = np.where(faster, middle, low), np.where(faster, high, middle)
    return 0.5 * (low + high)


def _spinning(speed_sun: Array, speed_ring: Array) -> Array:
    """States (18, n) with these speeds and nothing else."""
    zero = np.zeros_like(speed_sun)
    state = State(*[zero] * len(STATES))._replace(
        speed_sun=speed_sun, speed_sun_motor=speed_sun, speed_ring=speed_ring, speed_ring_motor=speed_ring
    )
    return np.array(state)


def _locked(drivetrain: Drivetrain, asked: SetTorques, speed: Array) -> Array:
    """States (18, n) of the rigid, locked gear at that sun speed, in closed form."""
    q = drivetrain.constants
    x = State(*_spinning(speed, -speed * q.p_s / q.p_r))
    transmitted = asked.sun + drivetrain.motion(x, asked).drag_sun
    beyond = np.abs(transmitted) >= q.T_max
    if beyond.any():
        raise BenchError(
            _at(asked, beyond),
            f"{np.abs(transmitted[beyond][0]):.3g} N m on the sun rotor",
            f"less than the pull-out torque of {q.T_max:.3g} N m",
            "Lower the load, or raise map_scale.",
        )
    current_sun = (asked.sun + q.sun.friction * x.speed_sun) / q.K_c
    current_ring = (asked.ring + q.ring.friction * x.speed_ring) / q.K_c
    integral_sun = (q.R * current_sun + q.sun.back_emf * x.speed_sun) / (q.K_A * q.K_i)
    integral_ring = (q.R * current_ring + q.ring.back_emf * x.speed_ring) / (q.K_A * q.K_i)
    gain = q.K_set / q.K_fb
    state = x._replace(
        twist_sun=asked.sun / q.k,
        twist_ring=asked.ring / q.k,
        phase=np.arcsin(transmitted / q.T_max),
        angle_carrier=q.Q / q.p_s * transmitted / q.k,
        current_sun=current_sun,
        current_ring=current_ring,
        integral_sun=integral_sun,
        integral_ring=integral_ring,
        feedback_sun=gain * asked.sun,
        feedback_ring=gain * asked.ring,
    )
    return np.array(state)
