"""Warming: a thermal node fed by the power that the run itself dissipated, and what it does to drag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from pmg.sim import signals, sources
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms.base import Component, Experiment, Mechanism, Reveals, Torques, Warmth, parameter
from pmg.sim.mechanisms.warmed import WarmingBearings, WarmMagnets, field_left
from pmg.sim.recursion import remembered
from pmg.sim.shafts import PerShaft, per_shaft

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array, Number

STOPPED = 120.0
"""Time between two recordings beyond which it is a pause, in which the motors may stand still [s]."""


def _temperature_rise(
    at: OperatingPoints,
    heat: Array,
    time_constant: float,
    start: float = 0.0,
    dwell: float = 1.0,
    idle: float = 0.0,
) -> Array:
    r"""Rise of a node above ambient [K].

    Parameters
    ----------
    at : OperatingPoints
        All points of the run; their start times give order and pauses.
    heat : (n,) array
        Dissipated power times thermal resistance while each point is held: where the rise is going to [K].
    time_constant : float
        Of the node [s].
    start : float
        Rise at the first point [K]; a bench that was soaked hot begins above what the points hold.
    dwell : float
        Part of the time between two recordings that the bench is already at the second one's speeds.
    idle : float
        Part of the long pauses that the motors stand still.

    Notes
    -----
    :math:`\tau\,\dot\Theta = RP - \Theta`. Without a known order there is no history: the rise is then that of the
    steady state of each point. A point of unknown heat (NaN) has no rise, and is not there for the others.
    """
    order = np.argsort(at.started_at, kind="stable")
    order = order[np.isfinite(heat[order])]
    if not at.ordered or not len(order):
        return np.asarray(heat)
    gaps, fed = np.diff(at.started_at[order]), heat[order]
    keep = np.exp(-gaps / time_constant)
    turning = np.where(gaps > STOPPED, 1.0 - idle, 1.0)
    during = turning * (dwell * fed[1:] + (1.0 - dwell) * fed[:-1])
    news = np.full(len(order), start)
    news[1:] = (1.0 - keep) * during
    out = np.full(len(at), np.nan)
    out[order] = remembered(keep, news)
    return out


@dataclass(frozen=True)
class WarmingInTwoSteps(WarmingBearings):
    """`LubricantViscosity` in more detail: races that warm fast in a housing that warms slowly, in a room that drifts.

    A Foster network of two nodes a shaft, into which some of the other shaft's heat finds its way: the bearings sit in
    one another. The room's temperature changes evenly with time.
    """

    identifier = "lubricant_viscosity"
    title = "Lubricant viscosity falling with temperature"
    equation = (
        r"\tau_k = -\mathrm{sgn}(\omega_k)\,K\,B_k(|\omega_k|)\,(e^{-\beta(\Theta_k+\Theta'_k+\dot{T}t)}-1),"
        r"\ \tau\,\dot{\Theta}_k = R_kQ_k-\Theta_k,\ \tau'\dot{\Theta}'_k = R'_kQ_k-\Theta'_k,\ Q_k = P_k+\chi P_{k'}"
    )
    source = sources.PALMGREN.at("viscous moment; viscosity after Vogel 1921")
    component = Component.RING_BEARINGS
    components = {"sun": Component.SUN_BEARINGS, "ring": Component.RING_BEARINGS}
    affects = (signals.TORQUE_SUN, signals.TORQUE_RING)
    revealed_by = (Reveals(Experiment.REPEATS, "the same point has less drag when the bench is warm"),)
    dissipates = False
    memory = True
    linear = False
    by_shaft = {
        "sun": ("resistance_sun", "race_sun", "start_sun", "room"),
        "ring": ("resistance_ring", "race_ring", "start_ring", "room"),
    }
    both_at_once = True
    shape = ("race_time", "time_constant", "cross", "dwell", "idle")

    resistance_sun: float = parameter(
        "K/W", bounds=(0.0, 20.0), typical=1.0, meaning="thermal resistance of the sun bearings' housing to the room"
    )
    resistance_ring: float = parameter(
        "K/W", bounds=(0.0, 20.0), typical=1.0, meaning="thermal resistance of the ring bearings' housing to the room"
    )
    race_sun: float = parameter(
        "K/W", bounds=(0.0, 20.0), typical=0.5, meaning="thermal resistance of the sun bearings' races to the housing"
    )
    race_ring: float = parameter(
        "K/W", bounds=(0.0, 20.0), typical=0.5, meaning="thermal resistance of the ring bearings' races to the housing"
    )
    start_sun: float = parameter(
        "K", bounds=(-40.0, 120.0), typical=10.0, meaning="sun bearings above the room at the first point"
    )
    start_ring: float = parameter(
        "K", bounds=(-40.0, 120.0), typical=10.0, meaning="ring bearings above the room at the first point"
    )
    room: float = parameter("K/s", bounds=(-5e-3, 5e-3), typical=2e-4, meaning="drift of the room's temperature")
    cross: float = parameter(
        "1", bounds=(0.0, 1.0), typical=0.1, meaning="part of the other shaft's heat that warms the bearings too"
    )
    time_constant: float = parameter(
        "s", bounds=(300.0, 20000.0), typical=2000.0, meaning="time constant of the housing", null=2000.0
    )
    race_time: float = parameter(
        "s", bounds=(20.0, 1500.0), typical=150.0, meaning="time constant of the races", null=150.0
    )
    dwell: float = parameter(
        "1",
        bounds=(0.05, 1.0),
        typical=0.8,
        meaning="part of the time between two recordings spent at the second one's speeds",
        null=0.8,
    )
    idle: float = parameter(
        "1", bounds=(0.0, 1.0), typical=0.3, meaning="part of long pauses in which the motors stand still", null=0.3
    )

    def rises(self, at: OperatingPoints) -> PerShaft[Array]:
        """Races, housing and room together [K]; a shaft that does not warm feels no room either."""
        elapsed = at.started_at - at.started_at.min() if at.ordered and len(at) else np.zeros(len(at))
        sun, ring = self.heating(at)
        found = []
        for power, resistance, race, start in zip(
            (sun + self.cross * ring, ring + self.cross * sun),
            (self.resistance_sun, self.resistance_ring),
            (self.race_sun, self.race_ring),
            (self.start_sun, self.start_ring),
            strict=True,
        ):
            if resistance == race == start == 0.0:
                found.append(np.zeros(len(at)))
                continue
            rise = _temperature_rise(at, resistance * power, self.time_constant, start, self.dwell, self.idle)
            fast = _temperature_rise(at, race * power, self.race_time, 0.0, self.dwell, self.idle)
            found.append(rise + fast + self.room * elapsed)
        return PerShaft(*found)


@dataclass(frozen=True)
class LubricantViscosity(WarmingBearings):
    """Viscous bearing drag that falls as the bearing warms by its own loss.

    No temperature is recorded on this bench: it follows from the run history by one thermal node a shaft. The whole
    drag is taken as viscous: what a curve's constant term holds of dry friction is not known. Holds while the grease
    is neither starved nor churned and the ambient is constant.
    """

    identifier = "lubricant_viscosity"
    title = "Lubricant viscosity falling with temperature"
    equation = (
        r"\tau_k = -\mathrm{sgn}(\omega_k)\,K\,B_k(|\omega_k|)\,(e^{-\beta\Theta_k}-1),"
        r"\ \tau\,\dot{\Theta}_k = R_kP_k-\Theta_k"
    )
    source = sources.PALMGREN.at("viscous moment; viscosity after Vogel 1921")
    component = Component.RING_BEARINGS
    components = {"sun": Component.SUN_BEARINGS, "ring": Component.RING_BEARINGS}
    affects = (signals.TORQUE_SUN, signals.TORQUE_RING)
    revealed_by = (
        Reveals(Experiment.REPEATS, "the same point has less drag when the bench is warm"),
        Reveals(Experiment.NEUTRAL_SWEEP, "drag depends on what was run before"),
    )
    dissipates = False
    memory = True
    linear = False
    by_shaft = {"sun": ("resistance_sun", "start_sun"), "ring": ("resistance_ring", "start_ring")}
    both_at_once = True
    refined = WarmingInTwoSteps
    shape = ("time_constant", "dwell", "idle")

    resistance_sun: float = parameter(
        "K/W", bounds=(0.0, 20.0), typical=1.0, meaning="thermal resistance of the sun bearings to ambient"
    )
    resistance_ring: float = parameter(
        "K/W", bounds=(0.0, 20.0), typical=1.0, meaning="thermal resistance of the ring bearings to ambient"
    )
    start_sun: float = parameter(
        "K", bounds=(-40.0, 120.0), typical=10.0, meaning="sun bearings above ambient at the first point"
    )
    start_ring: float = parameter(
        "K", bounds=(-40.0, 120.0), typical=10.0, meaning="ring bearings above ambient at the first point"
    )
    time_constant: float = parameter(
        "s", bounds=(30.0, 20000.0), typical=1200.0, meaning="thermal time constant", null=1200.0
    )
    dwell: float = parameter(
        "1",
        bounds=(0.05, 1.0),
        typical=0.8,
        meaning="part of the time between two recordings spent at the second one's speeds",
        null=0.8,
    )
    idle: float = parameter(
        "1", bounds=(0.0, 1.0), typical=0.3, meaning="part of long pauses in which the motors stand still", null=0.3
    )

    def rises(self, at: OperatingPoints) -> PerShaft[Array]:
        """The node of each shaft [K]."""
        resistance = PerShaft(self.resistance_sun, self.resistance_ring)
        start = PerShaft(self.start_sun, self.start_ring)
        power = self.heating(at)

        def rise(side: str) -> Array:
            heat = resistance[side] * power[side]
            return _temperature_rise(at, heat, self.time_constant, start[side], self.dwell, self.idle)

        return per_shaft(rise)


@dataclass(frozen=True)
class MagnetTemperature(Mechanism):
    """Remanence that falls as the magnets warm by the gear's own loss: less eddy and hysteresis drag.

    The pull-out torque falls with it, which steady torques do not show.
    """

    identifier = "magnet_temperature"
    title = "Remanence falling with magnet temperature"
    equation = (
        r"\tau_k = (b\,\mathrm{sgn}\,\omega_k + c\,\omega_k)\,[1-(1-\alpha\Theta)^2],\ \tau\dot{\Theta} = RP_m-\Theta"
    )
    source = sources.STOLL.at("eddy loss proportional to the square of the field")
    component = Component.MAGNETIC_GEAR
    affects = (signals.TORQUE_SUN, signals.TORQUE_RING)
    revealed_by = (Reveals(Experiment.REPEATS, "engaged points lose less after a long loaded run"),)
    dissipates = False
    memory = True
    without = "magnets at room temperature"
    linear = False
    by_shaft = {"both": ("resistance", "start")}
    shape = ("time_constant",)

    b: float
    c: float
    resistance: float = parameter(
        "K/W", bounds=(0.0, 100.0), typical=5.0, meaning="thermal resistance of the magnets to ambient"
    )
    start: float = parameter(
        "K", bounds=(-60.0, 120.0), typical=10.0, meaning="magnets above ambient at the first point"
    )
    time_constant: float = parameter(
        "s", bounds=(30.0, 20000.0), typical=1800.0, meaning="thermal time constant", null=1800.0
    )

    @classmethod
    def of(cls, bench: BenchParameters, model: LossModel) -> Self:
        """Absent, on the damping of a calibration."""
        return cls(model.b, model.c)

    def rise(self, at: OperatingPoints) -> Array:
        """The magnets above ambient at each point [K], from the run history."""
        loss = [
            np.where(at.engaged, self.b * np.abs(speed) + self.c * speed**2, 0.0)
            for speed in (at.speed_sun, at.speed_ring)
        ]
        return _temperature_rise(at, self.resistance * (loss[0] + loss[1]), self.time_constant, self.start)

    def torque(self, at: OperatingPoints) -> Torques:
        """Reduction of the magnetic drag by warming."""
        part = np.where(at.engaged, 1.0 - field_left(self.rise(at)), 0.0)
        return self._held(part).law(at.speed_sun, at.speed_ring)

    def in_motion(self, configuration: Configuration, warmth: Warmth) -> WarmMagnets | None:
        """The law at a warmth that stays over the run; none in neutral."""
        return self._held(1.0 - self.field_left(warmth)) if configuration is Configuration.ENGAGED else None

    def field_left(self, warmth: Warmth) -> float:
        """The magnetic torque falls as the losses do."""
        return float(field_left(warmth.magnets))

    def _held(self, part: Number) -> WarmMagnets:
        return WarmMagnets(self.b, self.c, part)
