"""Drag beyond the baseline: load, mixed lubrication, air, a bearing between the shafts, a rubbing carrier."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from pmg.sim import signals, sources
from pmg.sim.bench import of_stage
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms.base import (
    BOTH_TORQUES,
    Component,
    Experiment,
    Instant,
    Mechanism,
    MotionLaw,
    Reveals,
    RotorLaw,
    Torques,
    against,
    modulus,
    nothing,
    parameter,
)

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Number

_SHAFTS = {"sun": Component.SUN_BEARINGS, "ring": Component.RING_BEARINGS}


LOAD_PASSAGE = 1e-3
"""Width of the smooth passage of a load through zero in a run [N m]: a hundredth of the lightest load tested."""


@dataclass(frozen=True)
class LoadLaw(MotionLaw):
    """A mechanism of the engaged gear whose torques depend on the speeds and on the magnitude of the load."""

    acts_in = (Configuration.ENGAGED,)

    ratios: tuple[float, float]

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls((bench.gear1.ratio, bench.gear2.ratio))

    @abstractmethod
    def law(self, speed_sun: Number, speed_ring: Number, load: Number, ratio: Number, rest: float = 0.0) -> Torques:
        """Torques on the rotors [N m] at speeds [rad/s] and at the magnitude of the torque on the ring [N m].

        `ratio` is the magnitude of the gear's speed ratio, `rest` as in `RotorLaw.law`.
        """

    def at_instant(self, now: Instant) -> Torques:
        """The law at the load of that instant, whose passage through zero is smooth where that of speeds is."""
        load = modulus(now.load_ring, LOAD_PASSAGE if now.rest else 0.0)
        return self.law(now.speed_sun, now.speed_ring, load, now.ratio, now.rest)

    def torque(self, at: OperatingPoints) -> Torques:
        """Torques on the rotors at steady points: the ring's load is what its motor applies when engaged."""
        load = np.where(np.isin(at.configuration, self.acts_in), np.abs(at.torque_ring), 0.0)
        return self.law(at.speed_sun, at.speed_ring, load, of_stage(at.gear, *self.ratios))


@dataclass(frozen=True)
class LoadFriction(LoadLaw):
    """Bearing friction that grows with the torque the shaft carries.

    The air-gap pull and the reaction of an eccentric rotor load the bearings in proportion to the transmitted torque.
    """

    identifier = "load_dependent_bearing_friction"
    title = "Bearing friction growing with load"
    equation = r"\tau_k = -\mathrm{sgn}(\omega_k)\,\mu_k\,|T_k|\ \mathrm{engaged}"
    source = sources.PALMGREN.at("load-dependent moment")
    component = Component.SUN_BEARINGS
    components = _SHAFTS
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.REVERSED_FLOW, "the loss keeps its sign when the power flow turns"),)
    by_shaft = {"sun": ("mu_sun",), "ring": ("mu_ring",)}

    mu_sun: float = parameter("1", bounds=(0.0, 0.2), typical=0.01, meaning="friction torque on the sun per torque")
    mu_ring: float = parameter("1", bounds=(0.0, 0.2), typical=0.01, meaning="friction torque on the ring per torque")

    def law(self, speed_sun: Number, speed_ring: Number, load: Number, ratio: Number, rest: float = 0.0) -> Torques:
        """Friction of both shafts."""
        sun, ring = self.mu_sun * (load / ratio), self.mu_ring * load
        return Torques(against(speed_sun, sun, rest), against(speed_ring, ring, rest))


@dataclass(frozen=True)
class ThinFilm(RotorLaw):
    """Extra drag at low speed, where the lubricant film is thin: the falling part of the Stribeck curve.

    Each form says what is left of it at a speed.
    """

    identifier = "stribeck_mixed_lubrication"
    title = "Mixed lubrication at low speed"
    component = Component.SUN_BEARINGS
    components = _SHAFTS
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "drag rises towards low speed"),)
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
class Windage(RotorLaw):
    """Air drag of rotors and couplings: with the square of the speed, turbulent, in every configuration."""

    identifier = "windage"
    title = "Windage"
    equation = r"\tau_k = -k_k\,\omega_k\,|\omega_k|"
    source = sources.SCHLICHTING.at("rotating disk, turbulent")
    component = Component.SUN_BEARINGS
    components = _SHAFTS
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "loss power grows with the cube of speed"),)
    by_shaft = {"sun": ("k_sun",), "ring": ("k_ring",)}

    k_sun: float = parameter("N m s2/rad2", bounds=(0.0, 1e-4), typical=1e-6, meaning="air drag of the sun shaft")
    k_ring: float = parameter("N m s2/rad2", bounds=(0.0, 1e-3), typical=5e-6, meaning="air drag of the ring shaft")

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Air drag on both rotors."""
        sun, ring = self.k_sun * modulus(speed_sun, rest), self.k_ring * modulus(speed_ring, rest)
        return Torques(-sun * speed_sun, -ring * speed_ring)


REFERENCE_DIFFERENCE = 100.0
"""Speed difference that makes the viscous part of bearing 3 dimensionless [rad/s]; scales its parameter only."""


@dataclass(frozen=True)
class RelativeBearingDrag(RotorLaw):
    """Bearing 3 as it is mounted: between the shafts, so its drag follows their speed difference.

    It brakes the faster shaft and pushes the slower one. What the baseline's shares had given it stays there.
    """

    identifier = "relative_bearing_drag"
    title = "Relative bearing 3 driven by the speed difference"
    equation = (
        r"\tau_s = -\mathrm{sgn}(\Delta)\,[m_0+m_1(|\Delta|/\Delta_0)^{2/3}],\ \tau_r=-\tau_s,\ "
        r"\Delta=\omega_s-\omega_r"
    )
    source = sources.PALMGREN.at("viscous moment")
    component = Component.RELATIVE_BEARING
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "torque follows the speed difference"),)
    by_shaft = {"both": ("m_0", "m_1")}

    m_0: float = parameter("N m", bounds=(0.0, 0.5), typical=0.01, meaning="drag at small speed difference")
    m_1: float = parameter("N m", bounds=(0.0, 0.5), typical=0.01, meaning="viscous drag at a difference of 100 rad/s")

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Drag on the sun, its reaction on the ring."""
        difference = speed_sun - speed_ring
        viscous = self.m_1 * (modulus(difference, rest) / REFERENCE_DIFFERENCE) ** (2.0 / 3.0)
        on_sun = against(difference, self.m_0 + viscous, rest)
        return Torques(on_sun, -on_sun)


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
