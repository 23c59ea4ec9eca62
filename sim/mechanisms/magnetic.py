"""Losses of the engaged magnetic gear: hysteresis, eddy currents, excess loss."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim import signals, sources
from pmg.sim.mechanisms.base import Component, Experiment, Mechanism, Reveals, Torques, against, parameter

if TYPE_CHECKING:
    from pmg.sim.grid import OperatingPoints

_ROTORS = (signals.TORQUE_SUN, signals.TORQUE_RING)


@dataclass(frozen=True)
class HysteresisDamping(Mechanism):
    """Hysteresis of the iron: a torque that does not depend on speed, on each rotor."""

    identifier = "hysteresis_damping"
    title = "Hysteresis damping"
    equation = r"\tau_k = -b\,\mathrm{sgn}(\omega_k)"
    source = sources.THESIS.at("equation 6.1")
    component = Component.MAGNETIC_GEAR
    affects = _ROTORS
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "loss power proportional to speed"),)

    b: float = parameter("N m", bounds=(0.0, 0.1), typical=5e-4, meaning="hysteresis torque on each rotor")

    def torque(self, at: OperatingPoints) -> Torques:
        """Drag on both rotors when engaged."""
        magnitude = np.where(at.engaged, self.b, 0.0)
        return Torques(against(at.speed_sun, magnitude), against(at.speed_ring, magnitude))


@dataclass(frozen=True)
class EddyDamping(Mechanism):
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

    def torque(self, at: OperatingPoints) -> Torques:
        """Drag on both rotors when engaged."""
        c = np.where(at.engaged, self.c, 0.0)
        return Torques(-c * at.speed_sun, -c * at.speed_ring)


@dataclass(frozen=True)
class ExcessDamping(Mechanism):
    """Excess loss of moving domain walls: a torque that grows with the root of speed, smooth at rest."""

    identifier = "excess_damping"
    title = "Excess damping"
    equation = r"\tau_k = -d\,\omega_k / \sqrt{1 + |\omega_k|}"
    source = sources.THESIS.at("equation 6.1; after Bertotti 1988")
    component = Component.MAGNETIC_GEAR
    affects = _ROTORS
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "loss power grows with speed to the power 3/2"),)

    d: float = parameter("N m (s/rad)^1/2", bounds=(0.0, 0.1), typical=1e-3, meaning="drag per root of unit speed")

    def torque(self, at: OperatingPoints) -> Torques:
        """Drag on both rotors when engaged."""
        d = np.where(at.engaged, self.d, 0.0)
        return Torques(
            -d * at.speed_sun / np.sqrt(1.0 + np.abs(at.speed_sun)),
            -d * at.speed_ring / np.sqrt(1.0 + np.abs(at.speed_ring)),
        )
