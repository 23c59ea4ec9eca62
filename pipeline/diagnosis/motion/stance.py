"""Torque on a rotor by where it stands: what couplings give, what encoders show too much, where the poles began."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.constants import coupling_loss_name, eccentricity_names, start_name
from pmg.pipeline.motion.smooth import derivative
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.rows import RotorState
    from pmg.sim.signals import Array


def torque_of_angle(state: RotorState, side: str, moved: tuple[Array, Array, Array]) -> Array:
    """Torque on the rotor of a state [N m], (n,), if that of a side stood ahead by an angle [rad].

    `moved` is that angle and its first two derivatives in time [rad, rad/s, rad/s2].
    """
    own, (angle, rate, curvature) = state.stretch.side, moved
    found = np.zeros_like(angle)
    if own == side:
        found = state.value(f"inertia_{own}") * curvature + state.drag_slope * rate
    if state.stretch.coupled:
        stiffness, damping = state.spring
        found = found + state.sheet.poles[side] * (stiffness * angle + damping * rate)
    return np.asarray(found)


def stance_columns(state: RotorState) -> dict[str, Array]:
    """Torque that a transducer shows per unit of what says where the rotors stand, at the fine samples (n,).

    That is what each coupling gives, by which its rotor lags the motor, and the pole angle at the start of the run.
    """
    stretch, shafts = state.stretch, state.stretch.run.shafts
    if stretch.at_rest:
        return {}
    found = {}
    for side in SIDES if stretch.coupled else (stretch.side,):
        angle, rate, curvature = shafts[side].acting(stretch.run.fine_rate)
        found[f"compliance_{side}"] = torque_of_angle(state, side, (-angle, -rate, -curvature))
        bend = derivative(curvature, stretch.run.fine_rate)
        found[coupling_loss_name(side)] = torque_of_angle(state, side, (rate, curvature, bend))
    if stretch.coupled:
        found[start_name(stretch.run.run.name)], _ = state.spring
    return found


def eccentric(state: RotorState, side: str) -> tuple[Array, Array]:
    """Torque on a rotor per radian by which the encoder of a side shows too large an angle [N m/rad], (n,) each.

    The first is of a cosine of the turn, the second of a sine.
    """
    shaft = state.stretch.run.shafts[side]
    cosine, sine = shaft.turn
    of_cosine = (
        -cosine,
        shaft.speed * sine,
        shaft.speed**2 * cosine + shaft.acceleration * sine,
    )
    of_sine = (
        -sine,
        -shaft.speed * cosine,
        shaft.speed**2 * sine - shaft.acceleration * cosine,
    )
    return (
        torque_of_angle(state, side, of_cosine),
        torque_of_angle(state, side, of_sine),
    )


def encoder_columns(state: RotorState) -> dict[str, Array]:
    """Torque that a transducer shows per unit of each wave of a turn in the angle of an encoder (n,)."""
    if state.stretch.at_rest:
        return {}
    sides = SIDES if state.stretch.coupled else (state.stretch.side,)
    return {
        name: column
        for side in sides
        for name, column in zip(eccentricity_names(side), eccentric(state, side), strict=True)
    }
