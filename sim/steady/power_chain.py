"""The way of the power through the bench, from supply to useful power, element by element."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import BenchError
from pmg.sim.mechanisms.base import Component

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters, MotorParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array, Mask
    from pmg.sim.steady.gearbox import Gearbox


class MotorConvention(StrEnum):
    """Method of reckoning the power of the motors.

    ``CONSISTENT``: one constant for torque and back-EMF and physical signs, so that nothing is created or lost.
    ``THESIS``: torque constant 1.19 N m/A and a back-EMF constant of 1.0219 V s/rad (peak against rms, a slip of
    units that creates or removes their difference times speed times current), and on the load side joule and
    friction losses that enter with the sign of a gain.
    """

    CONSISTENT = "consistent"
    THESIS = "thesis"


@dataclass(frozen=True)
class PowerChain:
    """Powers along the chain [W], one row a point; all in the direction of flow.

    `losses` holds, in order of the flow, the loss of each element between the mechanical powers; `unexplained`
    is what is left of the difference between them, zero where the torques are the simulator's own.
    """

    electric_in: Array
    loss_motor_in: Array
    mechanical_in: Array
    loss_sun_bearings: Array
    loss_relative_sun: Array
    loss_gear: Array
    loss_relative_ring: Array
    loss_ring_bearings: Array
    unexplained: Array
    mechanical_out: Array
    loss_motor_out: Array
    electric_out: Array
    drive_ring: Mask

    @property
    def loss_between(self) -> Array:
        """Sum of the named losses between the two transducers [W]."""
        return (
            self.loss_sun_bearings
            + self.loss_relative_sun
            + self.loss_gear
            + self.loss_relative_ring
            + self.loss_ring_bearings
        )


def _motor_electric_power(torque: Array, speed: Array, motor: MotorParameters, convention: MotorConvention) -> Array:
    r"""Electric power that a motor draws at steady speed [W]; negative when it gives power back.

    Notes
    -----
    Consistent: :math:`P = T\omega + c_m\omega^2 + R i^2` with :math:`i = (T + c_m\omega)/K_c`. Thesis (section
    5.4): :math:`P = (R i + K_e\omega)\,i` with the current of the magnitudes, for the load side as for the drive.
    """
    if convention is MotorConvention.CONSISTENT:
        current = (torque + motor.damping * speed) / motor.torque_constant
        return np.asarray(torque * speed + motor.damping * speed**2 + motor.resistance * current**2)
    magnitude, w = np.abs(torque), np.abs(speed)
    current = (magnitude + motor.damping * w) / motor.torque_constant
    power = (motor.resistance * current + motor.back_emf_constant * w) * current
    return np.asarray(np.sign(torque * speed) * power)


def power_chain(
    gearbox: Gearbox,
    grid: Grid,
    bench: BenchParameters,
    convention: MotorConvention = MotorConvention.CONSISTENT,
) -> PowerChain:
    """Power chain of engaged points, with the torques of the grid and the losses of the model.

    Parameters
    ----------
    gearbox : Gearbox
        Gives the loss of each element at the points of the grid.
    grid : Grid
        Engaged points only; measured or simulated torques.
    bench : BenchParameters
        Motor constants.
    convention : MotorConvention
        How the electric side is reckoned.

    Raises
    ------
    BenchError
        When a point is not engaged.
    """
    at = grid.points
    if not at.engaged.all():
        raise BenchError(
            f"power chain of {at.name[~at.engaged][0]}", "not engaged", "engaged points", "Choose those rows."
        )
    loss = {part: np.zeros(len(at)) for part in ("sun", "relative_sun", "gear", "relative_ring", "ring")}
    for mechanism, torques in zip(gearbox.mechanisms, gearbox.contributions(at), strict=True):
        on_sun, on_ring = -torques.sun * at.speed_sun, -torques.ring * at.speed_ring
        if mechanism.component is Component.RELATIVE_BEARING:
            loss["relative_sun"] += on_sun
            loss["relative_ring"] += on_ring
        elif mechanism.component in (Component.SUN_BEARINGS, Component.RING_BEARINGS):
            loss["sun" if mechanism.component is Component.SUN_BEARINGS else "ring"] += on_sun + on_ring
        else:
            loss["gear"] += on_sun + on_ring
    power_sun, power_ring = grid.torque_sun * at.speed_sun, grid.torque_ring * at.speed_ring
    electric_sun = _motor_electric_power(grid.torque_sun, at.speed_sun, bench.motor, convention)
    electric_ring = _motor_electric_power(grid.torque_ring, at.speed_ring, bench.motor, convention)
    reverse = np.asarray(at.drive == "ring")
    mechanical_in = np.where(reverse, power_ring, power_sun)
    mechanical_out = -np.where(reverse, power_sun, power_ring)
    electric_in = np.where(reverse, electric_ring, electric_sun)
    electric_out = -np.where(reverse, electric_sun, electric_ring)
    return PowerChain(
        electric_in=electric_in,
        loss_motor_in=electric_in - mechanical_in,
        mechanical_in=mechanical_in,
        loss_sun_bearings=loss["sun"],
        loss_relative_sun=loss["relative_sun"],
        loss_gear=loss["gear"],
        loss_relative_ring=loss["relative_ring"],
        loss_ring_bearings=loss["ring"],
        unexplained=mechanical_in - mechanical_out - sum(loss.values()),
        mechanical_out=mechanical_out,
        loss_motor_out=mechanical_out - electric_out,
        electric_out=electric_out,
        drive_ring=reverse,
    )
