"""Magnetic losses beyond the baseline: coupling left in neutral, skin effect."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

from pmg.sim import sources
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms.base import (
    BOTH_TORQUES,
    Component,
    Experiment,
    LawCovariate,
    Reveals,
    RotorLaw,
    Torques,
    modulus,
    parameter,
)
from pmg.sim.mechanisms.magnetic import RotorDamping

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Number


@dataclass(frozen=True)
class CouplingLeftInNeutral(RotorLaw):
    """In neutral the carrier is not quite centred: the slipping poles drag on each other.

    An eddy-current coupling between the rotors. Its torque grows with the slip speed of the poles, has a maximum at a
    critical slip and falls again; it acts on both rotors in the ratio of their pole pairs. Each form says how strong
    the poles of each stage are.
    """

    identifier = "residual_magnetic_coupling"
    title = "Magnetic coupling left in neutral"
    source = sources.WOUTERSE
    component = Component.MAGNETIC_GEAR
    affects = BOTH_TORQUES
    acts_in = (Configuration.NEUTRAL,)
    shape: ClassVar[tuple[str, ...]] = ("critical",)
    follows = (LawCovariate.SLIP,)

    pole_pairs: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        gears = (bench.gear1, bench.gear2)
        return cls(tuple((round(gear.pole_pairs_sun), round(gear.pole_pairs_ring)) for gear in gears))

    @property
    @abstractmethod
    def strengths(self) -> tuple[float, ...]:
        """Largest torque per pole pair of each stage that drags, stage 1 first [N m]."""

    @abstractmethod
    def part(self, slip: Number, rest: float) -> Number:
        """Part of the largest torque that is there at a slip speed [rad/s]."""

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Drag on both rotors in neutral."""
        sun, ring = 0.0 * speed_sun, 0.0 * speed_ring
        for (p_s, p_r), strength in zip(self.pole_pairs, self.strengths, strict=False):
            pull = strength * self.part(p_s * speed_sun + p_r * speed_ring, rest)
            sun, ring = sun - p_s * pull, ring - p_r * pull
        return Torques(sun, ring)


@dataclass(frozen=True)
class ResidualCouplingOfStages(CouplingLeftInNeutral):
    """`ResidualCoupling` in more detail: the carrier drags on the poles of both stages, each slipping at its speed.

    Beyond the critical slip the torque falls with another power of the slip: it stays where the poles are thick
    against the depth of the currents and the gap is wide.
    """

    equation = (
        r"\tau_k = -\sum_g p_{k,g}\,M_g\,\frac{2\,S_g/S_c}{1+|S_g/S_c|^{n}}\ \mathrm{in\ neutral},"
        r"\ S_g = p_{s,g}\omega_s+p_{r,g}\omega_r"
    )
    shape = ("critical", "fall")
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "torque follows the pole-slip speeds of both stages"),)
    by_shaft = {"both": ("strength", "strength_second")}

    pole_pairs: tuple[tuple[int, int], ...]
    strength: float = parameter(
        "N m", bounds=(0.0, 0.05), typical=1e-3, meaning="largest torque of stage 1 on each rotor per pole pair"
    )
    strength_second: float = parameter(
        "N m", bounds=(0.0, 0.05), typical=5e-4, meaning="largest torque of stage 2 on each rotor per pole pair"
    )
    critical: float = parameter(
        "rad/s", bounds=(50.0, 20000.0), typical=1000.0, meaning="critical slip speed of the poles", null=1000.0
    )
    fall: float = parameter(
        "1", bounds=(1.0, 3.0), typical=2.0, meaning="power of the slip in the denominator", null=2.0
    )

    @property
    def strengths(self) -> tuple[float, ...]:
        """Of both stages."""
        return self.strength, self.strength_second

    def part(self, slip: Number, rest: float) -> Number:
        """A rise in proportion, and a fall with a power of the slip."""
        return 2.0 * (slip / self.critical) / (1.0 + (modulus(slip, rest) / self.critical) ** self.fall)


@dataclass(frozen=True)
class ResidualCoupling(CouplingLeftInNeutral):
    """One pair of poles drags, that of stage 1, nearer to which the carrier stands."""

    equation = r"\tau_k = -p_k\,M\,\frac{2\,S/S_c}{1+(S/S_c)^2}\ \mathrm{in\ neutral},\ S = p_s\omega_s+p_r\omega_r"
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "torque follows the pole-slip speed"),)
    by_shaft = {"both": ("strength",)}
    refined = ResidualCouplingOfStages

    pole_pairs: tuple[tuple[int, int], ...]
    strength: float = parameter(
        "N m", bounds=(0.0, 0.05), typical=1e-3, meaning="largest torque on each rotor per pole pair"
    )
    critical: float = parameter(
        "rad/s", bounds=(50.0, 20000.0), typical=1000.0, meaning="critical slip speed of the poles", null=1000.0
    )

    @property
    def strengths(self) -> tuple[float, ...]:
        """Of stage 1 alone."""
        return (self.strength,)

    def part(self, slip: Number, rest: float) -> Number:
        """Kloss's equation."""
        del rest
        x = slip / self.critical
        return 2.0 * x / (1.0 + x * x)


@dataclass(frozen=True)
class SkinEffect(RotorDamping):
    """Eddy torque that grows more slowly than speed once the currents shield the field."""

    identifier = "eddy_skin_effect"
    title = "Skin effect of the eddy currents"
    equation = r"\tau_k = c\,\omega_k\,[1-(1+(\omega_k\theta)^2)^{-1/4}]"
    source = sources.STOLL.at("thick plates")
    component = Component.MAGNETIC_GEAR
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "magnetic loss grows more slowly than the square of speed"),)
    dissipates = False
    linear = False
    follows = (LawCovariate.SPEED,)
    by_shaft = {"both": ("shielding",)}

    c: float
    shielding: float = parameter(
        "s/rad",
        bounds=(0.0, 1.0),
        typical=0.01,
        meaning="inverse of the corner speed, above which the field is shielded",
    )

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent, on the eddy damping of a calibration."""
        return cls(model.c)

    def drag(self, speed: Number, rest: float = 0.0) -> Number:
        """Reduction of the eddy torque by shielding."""
        x = speed * self.shielding
        return self.c * speed * (1.0 - (1.0 + x * x) ** -0.25)
