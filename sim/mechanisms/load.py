"""Losses that grow with the load: bearing friction, iron loss, and the bearing between the shafts."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from pmg.sim import sources
from pmg.sim.bench import of_stage
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms.base import (
    BOTH_TORQUES,
    Component,
    Experiment,
    Instant,
    LawCovariate,
    MotionLaw,
    Reveals,
    RotorLaw,
    Torques,
    Warmth,
    against,
    modulus,
    parameter,
)

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Number

BEARINGS = {"sun": Component.SUN_BEARINGS, "ring": Component.RING_BEARINGS}
"""Bearings of each shaft."""

LOAD_PASSAGE = 1e-3
"""Width of the smooth passage of a load through zero in a run [N m]: a hundredth of the lightest load tested."""


@dataclass(frozen=True)
class LoadLaw(MotionLaw):
    """A mechanism of the engaged gear whose torques depend on the speeds and on the magnitude of the load."""

    acts_in: ClassVar[tuple[Configuration, ...]] = (Configuration.ENGAGED,)

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
        load = np.where(at.engaged, np.abs(at.torque_ring), 0.0)
        return self.where_it_acts(at, self.law(at.speed_sun, at.speed_ring, load, of_stage(at.gear, *self.ratios)))


@dataclass(frozen=True)
class FrictionUnderLoad(LoadLaw):
    """Bearing friction that grows with the torque the shaft carries.

    The air-gap pull and the reaction of an eccentric rotor load the bearings with the transmitted torque. Each form
    says how the friction of a shaft grows with the torque it carries.
    """

    identifier = "load_dependent_bearing_friction"
    title = "Bearing friction growing with load"
    component = Component.SUN_BEARINGS
    components = BEARINGS
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.REVERSED_FLOW, "the loss keeps its sign when the power flow turns"),)
    follows = (LawCovariate.LOAD,)
    by_shaft = {"sun": ("mu_sun",), "ring": ("mu_ring",)}

    mu_sun: float = parameter("1", bounds=(0.0, 0.2), typical=0.01, meaning="friction torque on the sun per torque")
    mu_ring: float = parameter("1", bounds=(0.0, 0.2), typical=0.01, meaning="friction torque on the ring per torque")

    @abstractmethod
    def grown(self, torque: Number) -> Number:
        """Friction [N m] over the coefficient at the magnitude of a carried torque [N m]."""

    def law(self, speed_sun: Number, speed_ring: Number, load: Number, ratio: Number, rest: float = 0.0) -> Torques:
        """Friction of both shafts."""
        sun, ring = self.mu_sun * self.grown(load / ratio), self.mu_ring * self.grown(load)
        return Torques(against(speed_sun, sun, rest), against(speed_ring, ring, rest))


@dataclass(frozen=True)
class LoadFrictionPower(FrictionUnderLoad):
    """`LoadFriction` in more detail: a power of the torque.

    The moment of a loaded ball bearing grows with the load to the power 1.33 to 1.55, its sliding part to 5/3, its
    rolling part to about 0.5 (SKF).
    """

    equation = (
        r"\tau_k = -\mathrm{sgn}(\omega_k)\,\mu_k\,(|T_k|/1\,\mathrm{N\,m})^{n}\,1\,\mathrm{N\,m}\ \mathrm{engaged}"
    )
    source = sources.PALMGREN.at("load-dependent moment f1 P d, f1 = z (P/C)^y with y of 0.33 to 0.55")
    shape = ("power",)

    power: float = parameter("1", bounds=(0.5, 1.7), typical=1.4, meaning="exponent of the carried torque", null=1.0)

    def grown(self, torque: Number) -> Number:
        """A power of the torque."""
        return torque**self.power


@dataclass(frozen=True)
class LoadFriction(FrictionUnderLoad):
    """Friction in proportion to the torque."""

    equation = r"\tau_k = -\mathrm{sgn}(\omega_k)\,\mu_k\,|T_k|\ \mathrm{engaged}"
    source = sources.PALMGREN.at("load-dependent moment")
    refined = LoadFrictionPower

    def grown(self, torque: Number) -> Number:
        """In proportion to the torque."""
        return torque


@dataclass(frozen=True)
class IronLossUnderLoad(LoadLaw):
    """Iron loss that grows with the transmitted torque: the load angle bends more flux through the poles.

    Each form says what drag a transmitted torque brings.
    """

    identifier = "load_dependent_iron_loss"
    title = "Iron loss growing with load"
    component = Component.MAGNETIC_GEAR
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "magnetic loss grows with load and speed together"),)
    follows = (
        LawCovariate.LOAD,
        LawCovariate.SPEED,
    )
    by_shaft = {"both": ("k",)}

    @abstractmethod
    def drag(self, torque: Number, speed: Number, rest: float) -> Number:
        """Torque on a rotor [N m] at a transmitted torque [N m on the sun] and its own speed [rad/s]."""

    def law(self, speed_sun: Number, speed_ring: Number, load: Number, ratio: Number, rest: float = 0.0) -> Torques:
        """Drag on both rotors."""
        torque = load / ratio
        return Torques(self.drag(torque, speed_sun, rest), self.drag(torque, speed_ring, rest))


REFERENCE_SPEED = 100.0
"""Speed, or difference of speeds, that powers are taken of in units of it [rad/s]; scales a parameter only."""


@dataclass(frozen=True)
class LoadIronLossPower(IronLossUnderLoad):
    """`LoadIronLoss` in more detail: powers of the transmitted torque and of the speed.

    The loss goes with the first to the second power of the field, as the iron is or is not saturated; hysteresis gives
    a torque that does not grow with speed, excess loss one with its root, eddy currents one in proportion to it.
    """

    equation = (
        r"\tau_k = -k\,(|T_s|/1\,\mathrm{N\,m})^{n}\,\mathrm{sgn}(\omega_k)\,\omega_0\,(|\omega_k|/\omega_0)^{m}"
        r"\ \mathrm{engaged},\ \omega_0 = 100\,\mathrm{rad/s}"
    )
    source = sources.BERTOTTI.at("hysteresis, classical and excess loss")
    shape = ("power", "speed_power")

    k: float = parameter("N m s/rad", bounds=(0.0, 1e-2), typical=5e-5, meaning="damping at 1 N m and 100 rad/s")
    power: float = parameter("1", bounds=(0.8, 2.2), typical=2.0, meaning="exponent of the gear's torque", null=2.0)
    speed_power: float = parameter("1", bounds=(0.5, 1.4), typical=1.0, meaning="exponent of the speed", null=1.0)

    def drag(self, torque: Number, speed: Number, rest: float) -> Number:
        """A power of the torque and one of the speed."""
        turning = REFERENCE_SPEED * (modulus(speed, rest) / REFERENCE_SPEED) ** self.speed_power
        return against(speed, self.k * torque**self.power * turning, rest)


@dataclass(frozen=True)
class LoadIronLoss(IronLossUnderLoad):
    """Damping in proportion to the transmitted torque; smooth at rest as it is."""

    equation = r"\tau_k = -k\,|T_s|\,\omega_k\ \mathrm{engaged}"
    source = sources.STOLL.at("eddy loss proportional to the square of the field")
    refined = LoadIronLossPower

    k: float = parameter("s/rad", bounds=(0.0, 1e-2), typical=5e-5, meaning="eddy damping per transmitted torque")

    def drag(self, torque: Number, speed: Number, rest: float) -> Number:
        """In proportion to torque and speed."""
        return -self.k * torque * speed


@dataclass(frozen=True)
class RelativeBearingUnderLoad(LoadLaw):
    """`RelativeBearingDrag` in more detail: another power of the speed difference, and friction that grows with load.

    The viscous moment goes with the power 2/3 of the speed (Palmgren); less where lubricant is short, in proportion
    where the bearing is flooded.
    """

    identifier = "relative_bearing_drag"
    title = "Relative bearing driven by the speed difference"
    equation = (
        r"\tau_s = -\mathrm{sgn}(\Delta)\,[m_0+m_1(|\Delta|/\Delta_0)^{n}+\mu\,|T_r|],\ \tau_r=-\tau_s,\ "
        r"\Delta=\omega_s-\omega_r"
    )
    source = sources.PALMGREN.at("viscous and load-dependent moment")
    component = Component.RELATIVE_BEARING
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "torque follows the speed difference"),)
    acts_in = (Configuration.NEUTRAL, Configuration.ENGAGED)
    follows = (LawCovariate.DIFFERENCE,)
    by_shaft = {"both": ("m_0", "m_1", "mu")}
    shape = ("power",)

    m_0: float = parameter("N m", bounds=(0.0, 0.5), typical=0.01, meaning="drag at small speed difference")
    m_1: float = parameter("N m", bounds=(0.0, 0.5), typical=0.01, meaning="viscous drag at a difference of 100 rad/s")
    mu: float = parameter("1", bounds=(0.0, 0.1), typical=5e-3, meaning="friction per torque on the ring when engaged")
    power: float = parameter("1", bounds=(0.3, 1.0), typical=0.67, meaning="exponent of the difference", null=0.67)

    def in_motion(self, configuration: Configuration, warmth: Warmth) -> RelativeBearingUnderLoad:
        """Itself; in neutral no load is transmitted."""
        del warmth
        return self if configuration is Configuration.ENGAGED else replace(self, mu=0.0)

    def law(self, speed_sun: Number, speed_ring: Number, load: Number, ratio: Number, rest: float = 0.0) -> Torques:
        """Drag on the sun, its reaction on the ring."""
        del ratio
        difference = speed_sun - speed_ring
        viscous = self.m_1 * (modulus(difference, rest) / REFERENCE_SPEED) ** self.power
        on_sun = against(difference, self.m_0 + viscous + self.mu * load, rest)
        return Torques(on_sun, -on_sun)


@dataclass(frozen=True)
class RelativeBearingDrag(RotorLaw):
    """Bearing 3 as it is mounted: between the shafts, so its drag follows their speed difference.

    It brakes the faster shaft and pushes the slower one. What the baseline's shares had given it stays there.
    """

    identifier = "relative_bearing_drag"
    title = "Relative bearing driven by the speed difference"
    equation = (
        r"\tau_s = -\mathrm{sgn}(\Delta)\,[m_0+m_1(|\Delta|/\Delta_0)^{2/3}],\ \tau_r=-\tau_s,\ "
        r"\Delta=\omega_s-\omega_r"
    )
    source = sources.PALMGREN.at("viscous moment")
    component = Component.RELATIVE_BEARING
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "torque follows the speed difference"),)
    follows = (LawCovariate.DIFFERENCE,)
    by_shaft = {"both": ("m_0", "m_1")}
    refined = RelativeBearingUnderLoad

    m_0: float = parameter("N m", bounds=(0.0, 0.5), typical=0.01, meaning="drag at small speed difference")
    m_1: float = parameter("N m", bounds=(0.0, 0.5), typical=0.01, meaning="viscous drag at a difference of 100 rad/s")

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Drag on the sun, its reaction on the ring."""
        difference = speed_sun - speed_ring
        viscous = self.m_1 * (modulus(difference, rest) / REFERENCE_SPEED) ** (2.0 / 3.0)
        on_sun = against(difference, self.m_0 + viscous, rest)
        return Torques(on_sun, -on_sun)
