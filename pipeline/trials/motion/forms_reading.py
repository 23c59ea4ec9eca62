"""Faults of transducers and encoders, and torques that follow the turn of a shaft."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pmg.pipeline.trials.forms_drag import GEAR_BY_SHAFT
from pmg.pipeline.trials.forms_reading import TRANSDUCERS
from pmg.pipeline.trials.laws import Families, Law
from pmg.pipeline.trials.motion import places as at
from pmg.pipeline.trials.motion.effect import MotionEffect, MotionForm, named_laws
from pmg.pipeline.trials.motion.forms_elastic import COUPLINGS
from pmg.pipeline.trials.motion.machine import ROW
from pmg.pipeline.trials.motion.programme import RATE
from pmg.sim.shafts import PerShaft, per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.trials.motion.machine import BenchCourse, SyntheticMachine
    from pmg.sim.signals import Array

ENCODERS = {"sun": "sun_encoder", "ring": "ring_encoder"}
NOMINAL = PerShaft(5.0, 10.0)
"""Nominal torques of the transducers [N m]."""


def _read_torque(machine: SyntheticMachine, shaft: str, change: Callable[[BenchCourse, Array], Array]) -> None:
    """From now on the torque of a shaft reads as the function makes it of the course and of what it read."""

    def read(course: BenchCourse) -> BenchCourse:
        torque = per_shaft(lambda s: change(course, course.torque[s]) if s == shaft else course.torque[s])
        return replace(course, torque=torque)

    machine.readings.append(read)


def _zero(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """A zero that moves by a law of the campaign's time."""
    length = machine.campaign.length

    def change(course: BenchCourse, torque: Array) -> Array:
        return torque + effect.signed * effect.shape(course.elapsed / length)

    _read_torque(machine, effect.shaft, change)


def _gain(machine: SyntheticMachine, effect: MotionEffect) -> None:
    def change(course: BenchCourse, torque: Array) -> Array:
        return torque * (1.0 + effect.signed * effect.shape(torque / NOMINAL[effect.shaft]))

    _read_torque(machine, effect.shaft, change)


def _crosstalk(machine: SyntheticMachine, effect: MotionEffect) -> None:
    other = "ring" if effect.shaft == "sun" else "sun"

    def change(course: BenchCourse, torque: Array) -> Array:
        return torque + effect.signed * NOMINAL[other] * effect.shape(course.torque[other] / NOMINAL[other])

    _read_torque(machine, effect.shaft, change)


def lagged(values: Array, time: float) -> Array:
    """A first-order lag of values that run straight from sample to sample, at rest before."""
    if time <= 0.0:
        return values
    steps = RATE * time
    kept = np.exp(-1.0 / steps)
    taken, before = 1.0 - steps * (1.0 - kept), steps * (1.0 - kept) - kept
    return np.asarray(lfilter([taken, before], [1.0, -kept], values - values[0]) + values[0])


def _bandwidth(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """Size is the delay that the lag makes of a slow signal [s]."""
    orders = {"first": 1, "second": 2}[effect.law]

    def change(course: BenchCourse, torque: Array) -> Array:
        for _ in range(orders):
            torque = lagged(torque, effect.size / orders)
        return torque

    _read_torque(machine, effect.shaft, change)


def _delay(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """The torque comes late by the size [s]: always, or on average as it is renewed only now and then."""

    def change(course: BenchCourse, torque: Array) -> Array:
        k = np.arange(len(torque), dtype=np.float64)
        late = effect.size * RATE
        taken = k - late if effect.law == "pure" or late == 0.0 else 2.0 * late * np.floor(0.5 * k / late)
        return np.interp(taken, k, torque)

    _read_torque(machine, effect.shaft, change)


def _eccentric(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """The angle read swings about the true one once a turn."""

    def read(course: BenchCourse) -> BenchCourse:
        def seen(side: str) -> Array:
            angle = course.angle[side]
            return angle + effect.size * np.sin(angle + effect.number("phase")) if side == effect.shaft else angle

        return replace(course, angle=per_shaft(seen))

    machine.readings.append(read)


def _unbalance(machine: SyntheticMachine, effect: MotionEffect) -> None:
    shaft = machine.shafts[ROW[effect.shaft]]
    shaft[at.UNBALANCE], shaft[at.UNBALANCE_PHASE] = effect.size, effect.number("phase")
    shaft[at.UNBALANCE_GROWTH] = effect.number("growth")


def _cogging(machine: SyntheticMachine, effect: MotionEffect) -> None:
    shaft = machine.shafts[ROW[effect.shaft]]
    shaft[at.COGGING], shaft[at.COGGING_PHASE] = effect.size, effect.number("phase")
    shaft[at.COGGING_ORDER] = np.round(effect.number("order"))
    shaft[at.COGGING_SECOND] = effect.number("second")


def _constant(x: Array) -> Array:
    return np.ones_like(x)


def _straight(x: Array) -> Array:
    return x - 0.5


def _settling(x: Array, time: float) -> Array:
    return np.asarray(np.exp(-x / time) - 0.3)


def _step(x: Array, when: float) -> Array:
    return np.asarray(np.tanh((x - when) / 0.005))


def _curved(x: Array, quadratic: float) -> Array:
    return np.asarray(1.0 + quadratic * x * x)


def _by_sense(x: Array, difference: float) -> Array:
    return np.asarray(1.0 + difference * np.tanh(x / 0.01))


def _linear(x: Array) -> Array:
    return x


def _magnitude(x: Array, part: float) -> Array:
    return np.asarray((1.0 - part) * x + part * np.hypot(x, 0.01) - part * 0.01)


PHASE = {"phase": (0.0, REVOLUTION)}
READINGS: tuple[MotionForm, ...] = (
    MotionForm(
        "torque_zero_offset",
        TRANSDUCERS,
        "N m",
        8e-3,
        0.2,
        _zero,
        Families({"constant": Law(_constant)}),
        {},
        True,
    ),
    MotionForm(
        "torque_zero_drift",
        TRANSDUCERS,
        "N m",
        5e-3,
        0.2,
        _zero,
        Families(
            {
                "straight": Law(_straight),
                "settling": Law(_settling, {"time": (0.1, 0.4)}),
                "step": Law(_step, {"when": (0.25, 0.75)}),
            }
        ),
        {},
        True,
    ),
    MotionForm(
        "torque_gain_error",
        TRANSDUCERS,
        "1",
        0.02,
        0.3,
        _gain,
        Families(
            {"curved": Law(_curved, {"quadratic": (-2.0, 2.0)}), "sense": Law(_by_sense, {"difference": (-0.3, 0.3)})}
        ),
        {},
        True,
    ),
    MotionForm(
        "torque_crosstalk",
        TRANSDUCERS,
        "1",
        0.01,
        0.2,
        _crosstalk,
        Families({"linear": Law(_linear), "magnitude": Law(_magnitude, {"part": (0.2, 0.8)})}),
        {},
        True,
    ),
    MotionForm("transducer_bandwidth", TRANSDUCERS, "s", 3e-3, 0.1, _bandwidth, named_laws(first={}, second={}), {}),
    MotionForm("channel_delay", TRANSDUCERS, "s", 3e-3, 0.1, _delay, named_laws(pure={}, renewed={}), {}),
    MotionForm("encoder_eccentricity", ENCODERS, "rad", 1e-4, 0.05, _eccentric, named_laws(pure={}), PHASE),
    MotionForm(
        "shaft_unbalance",
        COUPLINGS,
        "N m",
        5e-3,
        0.1,
        _unbalance,
        named_laws(gravity={"growth": (0.0, 0.0)}, whirl={"growth": (0.1, 0.8)}),
        PHASE,
    ),
    MotionForm(
        "cogging",
        GEAR_BY_SHAFT,
        "N m",
        5e-3,
        0.1,
        _cogging,
        named_laws(sine={"second": (0.0, 0.0)}, sharp={"second": (0.2, 0.5)}),
        {**PHASE, "order": (5.5, 26.5)},
    ),
    MotionForm(
        "coupling_misalignment",
        COUPLINGS,
        "N m",
        5e-3,
        0.1,
        _cogging,
        named_laws(pure={"second": (0.0, 0.0)}, bent={"second": (0.2, 0.5)}),
        {**PHASE, "order": (2.0, 2.0)},
    ),
)
"""Forms of faulty readings and of torques by the turn."""
