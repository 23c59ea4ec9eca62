"""Losses of the engaged magnetic gear: hysteresis, eddy currents, excess loss."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim import signals, sources
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms.base import Component, Experiment, Reveals, RotorLaw, Torques, against, modulus, parameter

if TYPE_CHECKING:
    from pmg.sim.signals import Number

_ROTORS = (signals.TORQUE_SUN, signals.TORQUE_RING)


@dataclass(frozen=True)
class RotorDamping(RotorLaw):
    """A drag that sun, ring and carrier of the engaged gear each feel at their own speed."""

    acts_in = (Configuration.ENGAGED,)

    @abstractmethod
    def drag(self, speed: Number, rest: float = 0.0) -> Number:
        """Torque on a rotor [N m] at its speed [rad/s]."""

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Drag on both rotors when engaged."""
        return Torques(self.drag(speed_sun, rest), self.drag(speed_ring, rest))

    def carrier_law(self, speed_carrier: Number, rest: float = 0.0) -> Number:
        """The same drag on the carrier (thesis, equation 5.3)."""
        return self.drag(speed_carrier, rest)


@dataclass(frozen=True)
class HysteresisDamping(RotorDamping):
    """Hysteresis of the iron: a torque that does not depend on speed, on each rotor."""

    identifier = "hysteresis_damping"
    title = "Hysteresis damping"
    equation = r"\tau_k = -b\,\mathrm{sgn}(\omega_k)"
    source = sources.THESIS.at("equation 6.1")
    component = Component.MAGNETIC_GEAR
    affects = _ROTORS
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "loss power proportional to speed"),)

    b: float = parameter("N m", bounds=(0.0, 0.1), typical=5e-4, meaning="hysteresis torque on each rotor")

    def drag(self, speed: Number, rest: float = 0.0) -> Number:
        """Constant torque against the rotation."""
        return against(speed, self.b, rest)


@dataclass(frozen=True)
class EddyDamping(RotorDamping):
    """Eddy currents: a torque proportional to speed, on each rotor.

    Holds below the speed at which the currents shield the field.
    """

    identifier = "eddy_damping"
    title = "Eddy-current damping"
    equation = r"\tau_k = -c\,\omega_k"
    source = sources.THESIS.at("equation 6.1")
    component = Component.MAGNETIC_GEAR
    affects = _ROTORS
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "loss power grows with the square of speed"),)

    c: float = parameter("N m s/rad", bounds=(0.0, 1e-2), typical=2e-4, meaning="drag per unit speed")

    def drag(self, speed: Number, rest: float = 0.0) -> Number:
        """Torque against the rotation, proportional to speed."""
        return -self.c * speed


@dataclass(frozen=True)
class ExcessDamping(RotorDamping):
    """Excess loss of moving domain walls: a torque that grows with the root of speed, smooth at rest."""

    identifier = "excess_damping"
    title = "Excess damping"
    equation = r"\tau_k = -d\,\omega_k / \sqrt{1 + |\omega_k|}"
    source = sources.THESIS.at("equation 6.1; after Bertotti 1988")
    component = Component.MAGNETIC_GEAR
    affects = _ROTORS
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "loss power grows with speed to the power 3/2"),)

    d: float = parameter("N m (s/rad)^1/2", bounds=(0.0, 0.1), typical=1e-3, meaning="drag per root of unit speed")

    def drag(self, speed: Number, rest: float = 0.0) -> Number:
        """Torque against the rotation that goes over into the root of speed."""
        return -self.d * speed / np.sqrt(1.0 + modulus(speed, rest))
