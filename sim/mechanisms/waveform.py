"""Mechanisms without a mean: lines in the order spectrum of torque or speed, and scale or clock errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from pmg.sim import signals, sources
from pmg.sim.mechanisms.base import Component, Experiment, Mechanism, Reveals, Torques, nothing, parameter

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel


@dataclass(frozen=True)
class Waveform(Mechanism):
    """Mechanism that shows within a turn and not in a mean: its mean torque is none."""

    dissipates = False
    instead = "Leave it out: no run carries it yet."

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    def torque(self, at: OperatingPoints) -> Torques:
        """None in the mean."""
        return Torques(nothing(at), nothing(at))


@dataclass(frozen=True)
class CoggingLines(Waveform):
    """Pull of the bare iron poles on the magnets: lines at the least common multiple of magnets and poles."""

    identifier = "cogging"
    title = "Cogging"
    equation = r"T = A\,\sin(N\theta),\ N = \mathrm{lcm}(2p, Q)"
    source = sources.THESIS.at("section 2.3")
    component = Component.MAGNETIC_GEAR
    affects = (signals.TORQUE_SUN, signals.TORQUE_RING)
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "a line at that order of the shaft"),)

    instead = "Set cogging_sun_Nm or cogging_ring_Nm under [map]: cogging belongs to the torque map."

    amplitude: float = parameter("N m", bounds=(0.0, 5.0), typical=0.02, meaning="amplitude of the line")


@dataclass(frozen=True)
class Unbalance(Waveform):
    """An unbalanced shaft: a line at one a turn that grows with the square of speed."""

    identifier = "shaft_unbalance"
    title = "Unbalance of a shaft"
    equation = r"T = A\,\omega^2\,\sin\theta"
    source = sources.HARRIS.at("vibration")
    component = Component.SUN_COUPLING
    affects = (signals.TORQUE_SUN, signals.TORQUE_RING)
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "order 1, growing with the square of speed"),)

    amplitude: float = parameter("N m s2/rad2", bounds=(0.0, 1e-2), typical=1e-6, meaning="amplitude per squared speed")


@dataclass(frozen=True)
class Misalignment(Waveform):
    """Shafts out of line: a line at two a turn of a flexible coupling."""

    identifier = "coupling_misalignment"
    title = "Misaligned coupling"
    equation = r"T = A\,\sin(2\theta)"
    source = sources.HARRIS.at("vibration")
    component = Component.SUN_COUPLING
    affects = (signals.TORQUE_SUN, signals.TORQUE_RING)
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "order 2 at every speed"),)

    amplitude: float = parameter("N m", bounds=(0.0, 5.0), typical=0.01, meaning="amplitude of the line")


@dataclass(frozen=True)
class Eccentricity(Waveform):
    """An encoder ring off centre: a line at one a turn in the speed, none in the torque."""

    identifier = "encoder_eccentricity"
    title = "Eccentric encoder"
    equation = r"\omega = \bar{\omega}\,(1 + e\,\cos\theta)"
    source = sources.GUM.at("section 4.3")
    component = Component.SUN_ENCODER
    affects = (signals.SPEED_SUN, signals.SPEED_RING)
    revealed_by = (Reveals(Experiment.NEUTRAL_SWEEP, "order 1 of the speed at every speed"),)

    eccentricity: float = parameter("1", bounds=(0.0, 0.1), typical=1e-3, meaning="relative swing of the speed")


@dataclass(frozen=True)
class EncoderScale(Waveform):
    """An encoder with another number of counts than is declared: engaged speeds out of the gear's ratio."""

    identifier = "encoder_scale_error"
    title = "Scale error of an encoder"
    equation = r"\omega_k^\mathrm{read} = (1+s_k)\,\omega_k"
    source = sources.GUM.at("section 4.3")
    component = Component.SUN_ENCODER
    affects = (signals.SPEED_SUN, signals.SPEED_RING)
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "the speed ratio differs from that of the poles"),)

    scale: float = parameter("1", bounds=(-0.5, 0.5), typical=1e-3, meaning="relative error of the speed")


@dataclass(frozen=True)
class ClockOffset(Waveform):
    """Channels that are not on one clock: dynamic signals shifted against each other."""

    identifier = "clock_offset"
    title = "Clock offset between channels"
    equation = r"T_k^\mathrm{read}(t) = T_k(t - \delta)"
    source = sources.GUM.at("section 4.3")
    component = Component.SUN_ENCODER
    affects = (signals.TORQUE_SUN, signals.TORQUE_RING)
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "torque and speed shifted against each other in a transient"),)

    offset: float = parameter("s", bounds=(-10.0, 10.0), typical=0.01, meaning="shift of the channel")
