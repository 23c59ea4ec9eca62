"""Rotors of the baseline integrated in time: by how much a missing torque moves their speeds off the recorded ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from pmg.pipeline.diagnosis.motion.gear_torque import gear_columns
from pmg.pipeline.diagnosis.motion.loss_curve import REST, drag_columns, engaged_drag_columns
from pmg.pipeline.diagnosis.motion.rows import torque_of

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.rows import RotorState
    from pmg.sim.signals import Array

WITHIN = 2
"""Steps of the integration from row to row."""

STEPS = 600
"""Speeds at which a drag is tabled, in either sense."""

AWAY = 1e5
"""Error of a speed [rad/s] at which a simulation has run away, and stays."""

BEYOND = 20.0
"""Largest speed that is tabled over the largest that was recorded."""


def speed_errors(states: tuple[RotorState, ...], motion: Array, missing: Array) -> Array:
    r"""Simulated less recorded speed of some rotors that the torques in their couplings drive, from recorded starts.

    Parameters
    ----------
    states : tuple of RotorState
        Of the s rotors of a run, both where the gear couples them: the constants.
    motion : (m, b, s + 2) array
        Recorded motion at the m rows of b intervals: speed of each rotor, pole angle and its rate
        [rad/s, rad, rad/s].
    missing : (m, b, s, c) array
        Measured less predicted torque, c times [N m].

    Returns
    -------
    (m, b, s, c) array
        [rad/s]; zero in the first row, of magnitude `AWAY` where a model is unstable.

    Notes
    -----
    With :math:`\omega + e` the simulated speed of a rotor, :math:`\varphi + \varepsilon` the simulated pole angle and m
    the missing torque, the balance :math:`T = J\dot\omega + D(\omega) + G(\varphi)` at the simulated motion less that
    at the recorded one is :math:`J\dot e = m - D(\omega + e) + D(\omega) - G(\varphi + \varepsilon) + G(\varphi)`, with
    :math:`\dot\varepsilon = p_s e_s + p_r e_r`. It is solved by Runge and Kutta's method of order four.
    """
    count = len(states)
    first = states[0].stretch
    sides = [state.stretch.side for state in states]
    inertia = np.array([state.value(f"inertia_{side}") for state, side in zip(states, sides, strict=True)])[:, None]
    poles = np.array([states[0].sheet.poles[side] if first.coupled else 0 for side in sides])[:, None]
    drags = [_tabled(state, BEYOND * float(np.abs(motion[..., k]).max())) for k, state in enumerate(states)]

    def resisting(speed: Array, pole_angle: Array, slip: Array) -> Array:
        """Drag and torque of the gear of each rotor (..., s, c), for speeds (..., s, c), angle and slip (..., c)."""
        torque = np.stack([np.interp(speed[..., k, :], *drag) for k, drag in enumerate(drags)], -2)
        if first.coupled:
            columns = [gear_columns(state.sheet, state.stretch.side, pole_angle, slip) for state in states]
            torque += np.stack([torque_of(state, own) for state, own in zip(states, columns, strict=True)], -2)
        return torque

    def slopes(errors: Array, moves: Array, driving: Array) -> Array:
        """Of the errors of speeds and pole angle (b, s + 1, c) in time."""
        turning = np.sum(poles * errors[:, :count], axis=1)
        angle = (moves[:, count] + errors[:, count], moves[:, count + 1] + turning)
        rates = (driving - resisting(moves[:, :count] + errors[:, :count], *angle)) / inertia
        return np.concatenate([rates, turning[:, None]], 1)

    moves, driving = _between(motion)[..., None], _between(missing)
    driving += resisting(moves[..., :count, :], moves[..., count, :], moves[..., count + 1, :])
    step = 1.0 / (first.run.row_rate * WITHIN)
    errors, found = np.zeros((missing.shape[1], count + 1, missing.shape[3])), np.zeros(missing.shape)
    for instant in range(0, len(moves) - 1, 2):
        begin, middle, end = zip(moves[instant : instant + 3], driving[instant : instant + 3], strict=True)
        one = slopes(errors, *begin)
        two = slopes(errors + 0.5 * step * one, *middle)
        three = slopes(errors + 0.5 * step * two, *middle)
        four = slopes(errors + step * three, *end)
        errors = np.clip(errors + step / 6.0 * (one + 2.0 * two + 2.0 * three + four), -AWAY, AWAY)
        if (instant + 2) % (2 * WITHIN) == 0:
            found[(instant + 2) // (2 * WITHIN)] = errors[:, :count]
    return found


def _between(values: Array) -> Array:
    """Rows (m, ...) at the ends and middles of the steps between them, by cubic splines."""
    instants = np.arange(2 * WITHIN * (len(values) - 1) + 1) / (2 * WITHIN)
    return np.asarray(CubicSpline(np.arange(len(values)), values)(instants))


def _tabled(state: RotorState, most: float) -> tuple[Array, Array]:
    """Speeds, closest about standstill, and the drag at them."""
    speed = REST * np.sinh(np.linspace(-1.0, 1.0, 2 * STEPS + 1) * np.arcsinh(most / REST))
    side = state.stretch.side
    columns = drag_columns(side, speed) | (engaged_drag_columns(side, speed) if state.stretch.coupled else {})
    return speed, torque_of(state, columns)
