"""Magnetic losses beyond the baseline: coupling left in neutral, skin effect, iron loss under load."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from pmg.sim import sources
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms.base import BOTH_TORQUES, Component, Experiment, Reveals, RotorLaw, Torques, parameter
from pmg.sim.mechanisms.friction import LoadLaw
from pmg.sim.mechanisms.magnetic import RotorDamping

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Number


def _breakdown(strength: Number, slip: Number) -> Number:
    """Torque of an eddy-current coupling at a slip in units of the critical one (Kloss's equation)."""
    return strength * 2.0 * slip / (1.0 + slip * slip)


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
    shape = ("critical",)

    pole_pairs: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        gears = (bench.gear1, bench.gear2)
        return cls(tuple((round(gear.pole_pairs_sun), round(gear.pole_pairs_ring)) for gear in gears))

    @abstractmethod
    def coupling(self) -> tuple[tuple[float, ...], float]:
        """Largest torque per pole pair of each stage that drags, stage 1 first [N m]; critical slip speed [rad/s]."""

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Drag on both rotors in neutral."""
        strengths, critical = self.coupling()
        sun, ring = 0.0 * speed_sun, 0.0 * speed_ring
        for (p_s, p_r), strength in zip(self.pole_pairs, strengths, strict=False):
            pull = _breakdown(strength, (p_s * speed_sun + p_r * speed_ring) / critical)
            sun, ring = sun - p_s * pull, ring - p_r * pull
        return Torques(sun, ring)


@dataclass(frozen=True)
class ResidualCouplingOfStages(CouplingLeftInNeutral):
    """`ResidualCoupling` in more detail: the carrier drags on the poles of both stages, each slipping at its speed."""

    equation = (
        r"\tau_k = -\sum_g p_{k,g}\,M_g\,\frac{2\,S_g/S_c}{1+(S_g/S_c)^2}\ \mathrm{in\ neutral},"
        r"\ S_g = p_{s,g}\omega_s+p_{r,g}\omega_r"
    )
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

    def coupling(self) -> tuple[tuple[float, ...], float]:
        """Of both stages."""
        return (self.strength, self.strength_second), self.critical


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

    def coupling(self) -> tuple[tuple[float, ...], float]:
        """Of stage 1 alone."""
        return (self.strength,), self.critical


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


@dataclass(frozen=True)
class IronLossUnderLoad(LoadLaw):
    """Iron loss that grows with the transmitted torque: the load angle bends more flux through the poles.

    Each form says what damping a transmitted torque brings.
    """

    identifier = "load_dependent_iron_loss"
    title = "Iron loss growing with load"
    source = sources.STOLL.at("eddy loss proportional to the square of the field")
    component = Component.MAGNETIC_GEAR
    affects = BOTH_TORQUES
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "magnetic loss grows with load and speed together"),)
    by_shaft = {"both": ("k",)}

    @abstractmethod
    def damping(self, torque: Number) -> Number:
        """Damping of each rotor [N m s/rad] at a transmitted torque [N m on the sun]."""

    def law(self, speed_sun: Number, speed_ring: Number, load: Number, ratio: Number, rest: float = 0.0) -> Torques:
        """Drag on both rotors; smooth at rest as it is."""
        damping = self.damping(load / ratio)
        return Torques(-damping * speed_sun, -damping * speed_ring)


@dataclass(frozen=True)
class LoadIronLossPower(IronLossUnderLoad):
    """`LoadIronLoss` in more detail: a power of the transmitted torque, as the iron is or is not saturated."""

    equation = r"\tau_k = -k\,(|T_s|/1\,\mathrm{N\,m})^{n}\,\omega_k\ \mathrm{engaged}"
    shape = ("power",)

    k: float = parameter("N m s/rad", bounds=(0.0, 1e-2), typical=5e-5, meaning="eddy damping at 1 N m on the sun")
    power: float = parameter("1", bounds=(0.5, 3.0), typical=2.0, meaning="power of the transmitted torque", null=2.0)

    def damping(self, torque: Number) -> Number:
        """A power of the torque."""
        return self.k * torque**self.power


@dataclass(frozen=True)
class LoadIronLoss(IronLossUnderLoad):
    """Damping in proportion to the transmitted torque."""

    equation = r"\tau_k = -k\,|T_s|\,\omega_k\ \mathrm{engaged}"
    refined = LoadIronLossPower

    k: float = parameter("s/rad", bounds=(0.0, 1e-2), typical=5e-5, meaning="eddy damping per transmitted torque")

    def damping(self, torque: Number) -> Number:
        """In proportion to the torque."""
        return self.k * torque
