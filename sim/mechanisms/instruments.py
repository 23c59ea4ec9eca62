"""Faults of the torque transducers: mechanisms like any other, but they distort a reading."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from pmg.sim import sources
from pmg.sim.mechanisms.base import (
    BOTH_TORQUES,
    Component,
    Experiment,
    Instrument,
    LawCovariate,
    Reveals,
    Torques,
    parameter,
)
from pmg.sim.shafts import SIDES
from pmg.sim.signals import HOUR

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array

_SHAFTS = {"sun": Component.SUN_TORQUE_TRANSDUCER, "ring": Component.RING_TORQUE_TRANSDUCER}


@dataclass(frozen=True)
class ZeroOffset(Instrument):
    """A zero that is off by a constant: the error keeps its sign whatever the direction of rotation."""

    identifier = "torque_zero_offset"
    title = "Zero offset of a torque transducer"
    equation = r"\Delta T_k = z_k"
    source = sources.GUM.at("section 4.3")
    component = Component.SUN_TORQUE_TRANSDUCER
    components = _SHAFTS
    affects = BOTH_TORQUES
    revealed_by = (
        Reveals(Experiment.ZERO_CHECKS, "a reading with free shafts"),
        Reveals(Experiment.REVERSED_ROTATION, "drag that differs between the directions"),
    )
    by_shaft = {"sun": ("offset_sun",), "ring": ("offset_ring",)}

    offset_sun: float = parameter("N m", bounds=(-1.0, 1.0), typical=5e-3, meaning="zero of the sun's transducer")
    offset_ring: float = parameter("N m", bounds=(-1.0, 1.0), typical=5e-3, meaning="zero of the ring's transducer")

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        """The offset, everywhere."""
        return Torques(np.full(len(at), self.offset_sun), np.full(len(at), self.offset_ring))


@dataclass(frozen=True)
class DriftingZero(Instrument):
    """A zero that moves with time from the tare at the first point. Each form says how far it has moved by when."""

    identifier = "torque_zero_drift"
    title = "Zero drift of a torque transducer"
    source = sources.GUM.at("section 4.3")
    component = Component.SUN_TORQUE_TRANSDUCER
    components = _SHAFTS
    affects = BOTH_TORQUES
    revealed_by = (
        Reveals(Experiment.ZERO_CHECKS, "readings with free shafts that move"),
        Reveals(Experiment.REPEATS, "the same point reads differently later"),
    )
    follows = (LawCovariate.TIME,)
    memory = True

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    @abstractmethod
    def moved(self, time: Array) -> Torques:
        """Drift of the zeros at times since the first point [s]."""

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        """The zero at each point's time; none where the order is not known."""
        return self.moved(at.started_at - at.started_at.min() if at.ordered and len(at) else np.zeros(len(at)))


KNOTS = 6
"""Times at which a wandering zero is given, evenly spaced after the first point."""


def _zero(shaft: str, knot: int) -> float:
    meaning = f"zero of the {shaft}'s transducer {knot} spacings after the first point"
    zero: float = parameter("N m", bounds=(-1.0, 1.0), typical=3e-3, meaning=meaning)
    return zero


@dataclass(frozen=True)
class WanderingZero(DriftingZero):
    """`ZeroDrift` in more detail: a zero that wanders, straight from one time to the next and still after the last."""

    equation = (
        r"\Delta T_k = z_{k,j} + (z_{k,j+1}-z_{k,j})\,\frac{t-j\delta}{\delta},"
        r"\ j\delta \leq t < (j+1)\delta,\ z_{k,0} = 0"
    )
    by_shaft = {shaft: tuple(f"{shaft}_{knot}" for knot in range(1, KNOTS + 1)) for shaft in SIDES}
    shape = ("spacing",)

    sun_1: float = _zero("sun", 1)
    sun_2: float = _zero("sun", 2)
    sun_3: float = _zero("sun", 3)
    sun_4: float = _zero("sun", 4)
    sun_5: float = _zero("sun", 5)
    sun_6: float = _zero("sun", 6)
    ring_1: float = _zero("ring", 1)
    ring_2: float = _zero("ring", 2)
    ring_3: float = _zero("ring", 3)
    ring_4: float = _zero("ring", 4)
    ring_5: float = _zero("ring", 5)
    ring_6: float = _zero("ring", 6)
    spacing: float = parameter(
        "s", bounds=(300.0, 14400.0), typical=1800.0, meaning="time from one given zero to the next", null=1800.0
    )

    def moved(self, time: Array) -> Torques:
        """Straight between the given zeros."""
        knots = self.spacing * np.arange(KNOTS + 1)
        sun, ring = (
            np.interp(time, knots, [0.0, *(getattr(self, name) for name in self.by_shaft[shaft])]) for shaft in SIDES
        )
        return Torques(sun, ring)


@dataclass(frozen=True)
class ZeroDrift(DriftingZero):
    """Fast at first, then more slowly, or evenly.

    Warming electronics settle like an exponential; with a settling time far beyond the campaign the drift is even.
    """

    equation = r"\Delta T_k = z_k\,\frac{1-e^{-t/\tau}}{1-e^{-t_1/\tau}},\ t_1 = 1\,\mathrm{h}"
    by_shaft = {"sun": ("drift_sun",), "ring": ("drift_ring",)}
    refined = WanderingZero
    shape = ("settling",)

    drift_sun: float = parameter("N m", bounds=(-1.0, 1.0), typical=3e-3, meaning="drift of the sun's zero in an hour")
    drift_ring: float = parameter(
        "N m", bounds=(-1.0, 1.0), typical=3e-3, meaning="drift of the ring's zero in an hour"
    )
    settling: float = parameter("s", bounds=(300.0, 1e6), typical=1e5, meaning="settling time of the zero", null=1e5)

    def moved(self, time: Array) -> Torques:
        """An exponential that is the drift in an hour after an hour."""
        part = np.expm1(-time / self.settling) / np.expm1(-HOUR / self.settling)
        return Torques(self.drift_sun * part, self.drift_ring * part)


@dataclass(frozen=True)
class ScaledTorque(Instrument):
    """A sensitivity that is off: the error is a part of the reading. Each form says what of it."""

    identifier = "torque_gain_error"
    title = "Gain error of a torque transducer"
    source = sources.GUM.at("section 4.3")
    component = Component.SUN_TORQUE_TRANSDUCER
    components = _SHAFTS
    affects = BOTH_TORQUES
    revealed_by = (
        Reveals(Experiment.REVERSED_FLOW, "the apparent loss changes its sign with the power flow"),
        Reveals(Experiment.OTHER_STAGE, "the error per torque stays the same at another ratio of the two torques"),
    )
    follows = (LawCovariate.LOAD,)

    gain_sun: float = parameter("1", bounds=(-0.2, 0.2), typical=0.01, meaning="gain error of the sun's transducer")
    gain_ring: float = parameter("1", bounds=(-0.2, 0.2), typical=0.01, meaning="gain error of the ring's transducer")

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        """A part of the torque."""
        return Torques(self.gain_sun * true.sun, self.gain_ring * true.ring)


@dataclass(frozen=True)
class GainBySense(ScaledTorque):
    """`GainError` in more detail: another sensitivity for each sense of the torque, as both are calibrated."""

    equation = r"\Delta T_k = g_k\,T_k + h_k\,|T_k|"
    by_shaft = {"sun": ("gain_sun", "sided_sun"), "ring": ("gain_ring", "sided_ring")}

    sided_sun: float = parameter(
        "1", bounds=(-0.2, 0.2), typical=0.01, meaning="part of the magnitude of its torque shown by the sun"
    )
    sided_ring: float = parameter(
        "1", bounds=(-0.2, 0.2), typical=0.01, meaning="part of the magnitude of its torque shown by the ring"
    )

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        """Parts of the torque and of its magnitude."""
        odd = super().distortion(at, true)
        return Torques(odd.sun + self.sided_sun * np.abs(true.sun), odd.ring + self.sided_ring * np.abs(true.ring))


@dataclass(frozen=True)
class GainError(ScaledTorque):
    """The same sensitivity for both senses: the error turns with the power flow."""

    equation = r"\Delta T_k = g_k\,T_k"
    by_shaft = {"sun": ("gain_sun",), "ring": ("gain_ring",)}
    refined = GainBySense


@dataclass(frozen=True)
class ShownTorque(Instrument):
    """A transducer that also shows something of the other one's torque. Each form says what of it."""

    identifier = "torque_crosstalk"
    title = "Crosstalk from the other transducer"
    source = sources.GUM.at("section 4.3")
    component = Component.SUN_TORQUE_TRANSDUCER
    components = _SHAFTS
    affects = BOTH_TORQUES
    revealed_by = (
        Reveals(Experiment.NEUTRAL_SWEEP, "a reading that follows the other shaft's torque"),
        Reveals(Experiment.OTHER_STAGE, "the error per torque changes with the ratio of the two torques"),
    )
    follows = (LawCovariate.LOAD,)

    part_sun: float = parameter(
        "1", bounds=(-0.2, 0.2), typical=0.01, meaning="part of the ring torque shown by the sun"
    )
    part_ring: float = parameter(
        "1", bounds=(-0.2, 0.2), typical=0.01, meaning="part of the sun torque shown by the ring"
    )

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent."""
        return cls()

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        """A part of the other torque."""
        return Torques(self.part_sun * true.ring, self.part_ring * true.sun)


@dataclass(frozen=True)
class CrosstalkBySense(ShownTorque):
    """`Crosstalk` in more detail: not the same for both senses of the other torque.

    A couple that bends the shaft or pulls along it does not turn its sign with the torque that makes it.
    """

    equation = r"\Delta T_s = x_s\,T_r + y_s\,|T_r|,\ \Delta T_r = x_r\,T_s + y_r\,|T_s|"
    by_shaft = {"sun": ("part_sun", "even_sun"), "ring": ("part_ring", "even_ring")}

    even_sun: float = parameter(
        "1", bounds=(-0.2, 0.2), typical=0.01, meaning="part of the magnitude of the ring torque shown by the sun"
    )
    even_ring: float = parameter(
        "1", bounds=(-0.2, 0.2), typical=0.01, meaning="part of the magnitude of the sun torque shown by the ring"
    )

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        """Parts of the other torque and of its magnitude."""
        odd = super().distortion(at, true)
        return Torques(odd.sun + self.even_sun * np.abs(true.ring), odd.ring + self.even_ring * np.abs(true.sun))


@dataclass(frozen=True)
class Crosstalk(ShownTorque):
    """The same part of the other torque in both of its senses."""

    equation = r"\Delta T_s = x_s\,T_r,\ \Delta T_r = x_r\,T_s"
    by_shaft = {"sun": ("part_sun",), "ring": ("part_ring",)}
    refined = CrosstalkBySense


def distorted(instruments: tuple[Instrument, ...], at: OperatingPoints, true: Torques) -> tuple[Array, Array]:
    """Sum of all faults on the readings [N m]."""
    sun, ring = np.zeros(len(at)), np.zeros(len(at))
    for instrument in instruments:
        part = instrument.distortion(at, true)
        sun, ring = sun + part.sun, ring + part.ring
    return sun, ring
