"""The states of the moving bench, what it is asked for, and the torques in it at an instant."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from pmg.sim.signals import Number


class State(NamedTuple):
    """The state, in relative coordinates so that no large angle is subtracted from another.

    Twists and the phase [rad], speeds [rad/s], currents [A], the integral of the loop error [V s], the torque fed
    back [N m], the filtered loop error [V], the integral of the speed error [rad]. The block holds the carrier, or
    the rotor where one is held; the joint of its motor then turns the carrier.
    """

    twist_sun: Number
    twist_ring: Number
    phase: Number
    angle_block: Number
    speed_carrier: Number
    speed_sun_motor: Number
    speed_sun: Number
    speed_ring: Number
    speed_ring_motor: Number
    current_sun: Number
    integral_sun: Number
    feedback_sun: Number
    filtered_sun: Number
    current_ring: Number
    integral_ring: Number
    feedback_ring: Number
    filtered_ring: Number
    angle_lag_sun: Number
    angle_lag_ring: Number
    angle_sun: Number


STATES = State._fields
"""Names of the states; the last is a quadrature that only a map with cogging depends on."""


class SetPoints(NamedTuple):
    """Demands on the two motors, and their rates.

    A torque [N m, N m/s], or, where the motor is speed-controlled, a speed [rad/s, rad/s2].
    """

    sun: Number = 0.0
    ring: Number = 0.0
    slope_sun: Number = 0.0
    slope_ring: Number = 0.0


class MotorState(NamedTuple):
    """One motor: rates of its states, the torque that leaves it [N m] and its amplifier's voltage [V]."""

    acceleration: Number
    d_current: Number
    error: Number
    d_feedback: Number
    d_filtered: Number
    d_angle_lag: Number
    torque_out: Number
    voltage: Number


class DrivetrainTorques(NamedTuple):
    """All torques [N m] at an instant, and the two motors."""

    joint_sun: Number
    joint_ring: Number
    block: Number
    magnetic_sun: Number
    magnetic_ring: Number
    magnetic_carrier: Number
    drag_sun: Number
    drag_ring: Number
    drag_carrier: Number
    sun: MotorState
    ring: MotorState
