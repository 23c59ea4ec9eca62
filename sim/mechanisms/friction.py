"""Drag beyond the baseline: mixed lubrication, air, a rubbing carrier; and poles that slip."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from pmg.sim import signals, sources
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms.base import (
    BOTH_TORQUES,
    Component,
    Experiment,
    LawCovariate,
    Mechanism,
    Reveals,
    RotorLaw,
    Torques,
    against,
    modulus,
    nothing,
    parameter,
)
from pmg.sim.mechanisms.load import BEARINGS, REFERENCE_SPEED

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Number


@dataclass(frozen=True)
class ThinFilm(RotorLaw):
    """Extra drag at low speed, where the lubricant film is thin: the falling part of the Stribeck curve.

    Each form says what is left of it at a speed.
    """

    identifier = "stribeck_mixed_lubrication"
    title = "Mixed lubrication at low speed"
    component = Component.SUN_BEARINGS
    components = BEARINGS
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "drag rises towards low speed"),)
    follows = (LawCovariate.SPEED,)
    by_shaft = {"sun": ("extra_sun",), "ring": ("extra_ring",)}

    extra_sun: float = parameter("N m", bounds=(0.0, 1.0), typical=0.02, meaning="extra drag of the sun near rest")
    extra_ring: float = parameter("N m", bounds=(0.0, 1.0), typical=0.02, meaning="extra drag of the ring near rest")
    speed: float = parameter(
        "rad/s", bounds=(1.0, 100.0), typical=15.0, meaning="speed at which it has fallen to 37 %", null=15.0
    )

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    @abstractmethod
    def left(self, x: Number) -> Number:
        """Part of the extra drag that is left at a speed in units of `speed`."""

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Extra drag on both rotors."""
        sun = self.extra_sun * self.left(modulus(speed_sun, rest) / self.speed)
        ring = self.extra_ring * self.left(modulus(speed_ring, rest) / self.speed)
        return Torques(against(speed_sun, sun, rest), against(speed_ring, ring, rest))


@dataclass(frozen=True)
class MixedLubricationExponent(ThinFilm):
    """`MixedLubrication` in more detail: the exponent is what the data say, as in Stribeck laws of friction models."""

    equation = r"\tau_k = -\mathrm{sgn}(\omega_k)\,A_k\,e^{-(|\omega_k|/\omega_0)^{\delta}}"
    source = sources.ARMSTRONG
    shape = ("speed", "exponent")

    exponent: float = parameter(
        "1", bounds=(0.3, 3.0), typical=1.0, meaning="exponent of the fall with speed", null=1.0
    )

    def left(self, x: Number) -> Number:
        """An exponential of a power of the speed."""
        return np.exp(-(x**self.exponent))


@dataclass(frozen=True)
class MixedLubrication(ThinFilm):
    """The fall that a bearing maker's catalogue gives."""

    equation = r"\tau_k = -\mathrm{sgn}(\omega_k)\,A_k\,e^{-(|\omega_k|/\omega_0)^{1.4}}"
    source = sources.SKF.at("weighting factor of the sliding friction coefficient")
    refined = MixedLubricationExponent
    shape = ("speed",)

    def left(self, x: Number) -> Number:
        """An exponential of the speed to the power 1.4."""
        return np.exp(-(x**1.4))


@dataclass(frozen=True)
class AirDrag(RotorLaw):
    """Air drag of rotors and couplings, in every configuration. Each form says how it grows with speed."""

    identifier = "windage"
    title = "Windage"
    component = Component.SUN_BEARINGS
    components = BEARINGS
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "loss power grows with the cube of speed"),)
    follows = (LawCovariate.SPEED,)
    by_shaft = {"sun": ("k_sun",), "ring": ("k_ring",)}

    k_sun: float = parameter("N m s2/rad2", bounds=(0.0, 1e-4), typical=1e-6, meaning="air drag of the sun shaft")
    k_ring: float = parameter("N m s2/rad2", bounds=(0.0, 1e-3), typical=5e-6, meaning="air drag of the ring shaft")

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    @abstractmethod
    def grown(self, speed: Number) -> Number:
        """Drag over its coefficient at the magnitude of a speed [rad2/s2]."""

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Air drag on both rotors."""
        sun = against(speed_sun, self.k_sun * self.grown(modulus(speed_sun, rest)), rest)
        return Torques(sun, against(speed_ring, self.k_ring * self.grown(modulus(speed_ring, rest)), rest))


@dataclass(frozen=True)
class WindagePower(AirDrag):
    """`Windage` in more detail: a power of the speed, 1.5 for a disk in laminar flow, 1.8 in turbulent flow."""

    equation = (
        r"\tau_k = -k_k\,\mathrm{sgn}(\omega_k)\,\omega_0^2\,(|\omega_k|/\omega_0)^{n},\ "
        r"\omega_0 = 100\,\mathrm{rad/s}"
    )
    source = sources.SCHLICHTING.at("rotating disk, laminar and turbulent")
    shape = ("power",)

    power: float = parameter("1", bounds=(1.4, 2.4), typical=1.8, meaning="exponent of the speed", null=2.0)

    def grown(self, speed: Number) -> Number:
        """A power of the speed."""
        return REFERENCE_SPEED**2 * (speed / REFERENCE_SPEED) ** self.power


@dataclass(frozen=True)
class Windage(AirDrag):
    """Turbulent: with the square of the speed."""

    equation = r"\tau_k = -k_k\,\omega_k\,|\omega_k|"
    source = sources.SCHLICHTING.at("rotating disk, turbulent")
    refined = WindagePower

    def grown(self, speed: Number) -> Number:
        """The square."""
        return speed**2


@dataclass(frozen=True)
class RubbingCarrier(RotorLaw):
    """Dry friction that is there when engaged only: the carrier touches a rotor."""

    identifier = "engaged_dry_friction"
    title = "Dry friction of the engaged gear"
    equation = r"\tau_k = -\mathrm{sgn}(\omega_k)\,F_k\ \mathrm{engaged}"
    source = sources.HARRIS.at("dry friction")
    component = Component.MAGNETIC_GEAR
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "loss power proportional to speed"),)
    acts_in = (Configuration.ENGAGED,)
    follows = (LawCovariate.SPEED,)
    by_shaft = {"sun": ("friction_sun",), "ring": ("friction_ring",)}

    friction_sun: float = parameter("N m", bounds=(0.0, 0.5), typical=5e-3, meaning="dry friction on the sun")
    friction_ring: float = parameter("N m", bounds=(0.0, 0.5), typical=5e-3, meaning="dry friction on the ring")

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Constant drag on both rotors."""
        return Torques(against(speed_sun, self.friction_sun, rest), against(speed_ring, self.friction_ring, rest))


@dataclass(frozen=True)
class PoleSlip(Mechanism):
    """The load passes the pull-out torque: the speed ratio is lost and only drag is passed on.

    Nothing steady is left to fit: it is recognised from the speeds, and the points are set apart.
    """

    identifier = "pole_slip"
    title = "Pole slip"
    equation = r"p_s\omega_s + p_r\omega_r \neq 0\ \mathrm{engaged}"
    source = sources.THESIS.at("section 2.3")
    component = Component.MAGNETIC_GEAR
    affects = (signals.SPEED_SUN, signals.SPEED_RING)
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "speeds out of the ratio of the pole pairs"),)
    memory = False
    instead = "Leave it out: a run slips poles by itself when the load passes the pull-out torque."

    slip: float = parameter("rad/s", bounds=(0.0, 1e4), typical=100.0, meaning="rate of the electrical phase")

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    def torque(self, at: OperatingPoints) -> Torques:
        """None of its own."""
        return Torques(nothing(at), nothing(at))
