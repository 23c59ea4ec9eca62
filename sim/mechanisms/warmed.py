"""Reduction of drag by warmth: at the rises of a run history, or held over a run in time."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from pmg.sim import sources
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms.base import BOTH_TORQUES, Component, Mechanism, Torques, Warmth, against
from pmg.sim.mechanisms.bearings import LookedUpDrag
from pmg.sim.mechanisms.magnetic import RotorDamping
from pmg.sim.shafts import PerShaft, per_shaft

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.losscurve import LossCurve
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array, Number

LUBRICANT_COEFFICIENT = 0.033
"""Relative fall of a greased bearing's viscous drag per kelvin near room temperature [1/K].

Viscous drag grows with viscosity to the power 2/3 (Palmgren); a mineral base oil of 100 mm2/s loses about 5 %
of its viscosity per kelvin there (Vogel's law). Only its product with the thermal resistance shows in torque.
"""

MAGNET_COEFFICIENT = 1.2e-3
"""Relative fall of the remanence of sintered NdFeB per kelvin [1/K]; losses and torque follow its square."""


def _relief(rise: Number) -> Number:
    """Relative change of viscous drag at a rise above ambient [K]; negative when warm."""
    return np.expm1(-LUBRICANT_COEFFICIENT * rise)


def field_left(rise: Number) -> Number:
    """Factor on losses and torque of the magnets at a rise above ambient [K]."""
    return np.maximum(1.0 - MAGNET_COEFFICIENT * rise, 0.0) ** 2


@dataclass(frozen=True)
class WarmBearings(LookedUpDrag):
    """Bearings at a warmth that stays: what it takes off their drag, as a part of the cold curve.

    The whole drag is taken as viscous; the parts are those of one configuration. What is taken off turns with the
    direction of rotation where the drag does, and does not where it does not.
    """

    identifier = "lubricant_viscosity"
    title = "Lubricant viscosity falling with temperature"
    equation = r"\tau_k = -\mathrm{sgn}(\omega_k)\,\rho_k\,B_k(|\omega_k|),\ \rho_k = K\,(e^{-\beta\Theta_k}-1)"
    source = sources.PALMGREN.at("viscous moment; viscosity after Vogel 1921")
    component = Component.RING_BEARINGS
    affects = BOTH_TORQUES
    revealed_by = ()
    dissipates = False

    curve_sun: LossCurve
    curve_ring: LossCurve
    part_sun: float
    part_ring: float

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Reduction of the drag of both shafts by warmth."""
        sun = self._on_sun(self.part_sun, self.curve_sun, speed_sun, rest)
        return Torques(sun, self._on_ring(self.part_ring, self.curve_ring, speed_ring, rest))


@dataclass(frozen=True)
class WarmMagnets(RotorDamping):
    """Magnets at a warmth that stays: what it takes off hysteresis and eddy drag."""

    identifier = "magnet_temperature"
    title = "Remanence falling with magnet temperature"
    equation = r"\tau_k = \rho\,(b\,\mathrm{sgn}\,\omega_k + c\,\omega_k),\ \rho = 1-(1-\alpha\Theta)^2"
    source = sources.STOLL.at("eddy loss proportional to the square of the field")
    component = Component.MAGNETIC_GEAR
    affects = BOTH_TORQUES
    revealed_by = ()
    dissipates = False

    b: float
    c: float
    part: float

    def drag(self, speed: Number, rest: float = 0.0) -> Number:
        """Reduction of the drag of a rotor by warmth."""
        return self.part * (self.c * speed - against(speed, self.b, rest))


@dataclass(frozen=True)
class WarmingBearings(Mechanism):
    """Viscous bearing drag that falls as the bearings warm; the rises are a matter of the thermal network."""

    without = "bearings at room temperature"

    curve_sun: LossCurve
    curve_ring: LossCurve
    correction: float

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent, on the curves of a calibration."""
        return cls(model.curve_sun, model.curve_ring, model.correction)

    @abstractmethod
    def rises(self, at: OperatingPoints) -> PerShaft[Array]:
        """Sun and ring bearings above ambient at each point [K], from the run history."""

    def heating(self, at: OperatingPoints) -> PerShaft[Array]:
        """Power that the cold drag of each shaft turns into heat [W]."""
        part = np.where(at.neutral, 1.0, np.where(at.engaged, self.correction, 0.0))
        curve = PerShaft(self.curve_sun, self.curve_ring)
        return per_shaft(lambda side: part * curve[side].torque(at.speed[side]) * np.abs(at.speed[side]))

    def torque(self, at: OperatingPoints) -> Torques:
        """Reduction of the drag by warming."""
        part = np.where(at.neutral, 1.0, np.where(at.engaged, self.correction, 0.0))
        sun, ring = (_relief(rise) * part for rise in self.rises(at))
        return self._held(sun, ring).law(at.speed_sun, at.speed_ring)

    def in_motion(self, configuration: Configuration, warmth: Warmth) -> WarmBearings | None:
        """The law at a warmth that stays over the run."""
        part = 1.0 if configuration is Configuration.NEUTRAL else self.correction
        return self._held(*(float(_relief(rise)) * part for rise in (warmth.sun, warmth.ring)))

    def _held(self, part_sun: Number, part_ring: Number) -> WarmBearings:
        return WarmBearings(self.curve_sun, self.curve_ring, part_sun, part_ring)
