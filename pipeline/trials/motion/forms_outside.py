"""Effects that no library of mechanisms knows: the right answer is that it is none of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.forms_drag import BEARINGS
from pmg.pipeline.trials.forms_reading import TRANSDUCERS
from pmg.pipeline.trials.laws import Families, Law
from pmg.pipeline.trials.motion import places as at
from pmg.pipeline.trials.motion.bench import FASTEST
from pmg.pipeline.trials.motion.effect import MotionEffect, MotionForm, named_laws
from pmg.pipeline.trials.motion.forms_elastic import ROTORS
from pmg.pipeline.trials.motion.forms_reading import lagged
from pmg.pipeline.trials.motion.machine import ROW
from pmg.pipeline.trials.motion.programme import RATE
from pmg.sim.grid import Configuration
from pmg.sim.shafts import per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.trials.motion.machine import BenchCourse, SyntheticMachine
    from pmg.pipeline.trials.motion.programme import PlannedRun
    from pmg.sim.signals import Array


def _loose_mass(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """Size times the rotor's inertia on a soft spring: a resonance of its own."""
    shaft = machine.shafts[ROW[effect.shaft]]
    more, rate = effect.size * shaft[at.ROTOR_INERTIA], REVOLUTION * effect.number("frequency")
    shaft[at.EXTRA_INERTIA], shaft[at.EXTRA_STIFFNESS] = more, more * rate**2
    shaft[at.EXTRA_DAMPING] = 2.0 * effect.number("damped") * more * rate


def _cross_drag(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """Drag of one shaft with the square of the other's speed."""
    machine.shafts[ROW[effect.shaft], at.CROSS_DRAG] = effect.size


def _ageing(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """Dry friction that changes through each run by a law of its time, and begins anew with the next."""

    def change(run: PlannedRun, given: Array) -> None:
        time = np.arange(run.samples) / RATE
        given[:, ROW[effect.shaft], at.DRAG_MORE] += effect.size * effect.shape(time / 30.0)

    machine.inputs.append(change)


def _engaged_hump(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """More drag about one speed while the gear is engaged and the shaft speeds up, by the speed asked for."""
    row = ROW[effect.shaft]

    def change(run: PlannedRun, given: Array) -> None:
        if run.configuration is not Configuration.ENGAGED:
            return
        reference = np.abs(run.asked[run.drive][1]) / FASTEST[run.drive]
        rising = lagged(np.sign(np.gradient(reference)), 0.3)
        shape = np.exp(-0.5 * ((reference - effect.number("place")) / effect.number("width")) ** 2)
        given[:, row, at.DRAG_MORE] += effect.size * shape * (1.0 + rising)

    machine.inputs.append(change)


def _creep(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """A transducer that goes on for seconds after its torque has changed."""

    def read(course: BenchCourse) -> BenchCourse:
        def seen(side: str) -> Array:
            torque = course.torque[side]
            return torque + effect.signed * lagged(torque, effect.number("time")) if side == effect.shaft else torque

        return replace(course, torque=per_shaft(seen))

    machine.readings.append(read)


def _hum(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """A torque of one frequency, whatever the speed."""

    def read(course: BenchCourse) -> BenchCourse:
        swing = effect.size * effect.shape(
            np.sin(REVOLUTION * effect.number("frequency") * course.elapsed + effect.number("phase"))
        )

        def seen(side: str) -> Array:
            there = side == effect.shaft and side in course.run.asked
            return course.torque[side] + swing if there else course.torque[side]

        return replace(course, torque=per_shaft(seen))

    machine.readings.append(read)


def _tightening(x: Array, power: float) -> Array:
    return np.asarray(x**power)


def _fading(x: Array, time: float) -> Array:
    return np.asarray(np.exp(-x / time))


def _sine(x: Array) -> Array:
    return x


def _clipped(x: Array) -> Array:
    return np.clip(2.0 * x, -1.0, 1.0)


OUTSIDERS: tuple[MotionForm, ...] = (
    MotionForm(
        "outside_loose_mass",
        ROTORS,
        "1",
        0.1,
        1.5,
        _loose_mass,
        named_laws(damped={"damped": (0.05, 0.2)}, ringing={"damped": (0.005, 0.03)}),
        {"frequency": (18.0, 60.0)},
    ),
    MotionForm("outside_cross_drag", BEARINGS, "N m", 5e-3, 0.05, _cross_drag, named_laws(square={}), {}),
    MotionForm(
        "outside_ageing_friction",
        BEARINGS,
        "N m",
        5e-3,
        0.2,
        _ageing,
        Families(
            {"tightening": Law(_tightening, {"power": (0.7, 2.0)}), "fading": Law(_fading, {"time": (0.05, 0.4)})}
        ),
        {},
    ),
    MotionForm(
        "outside_rising_hump",
        BEARINGS,
        "N m",
        5e-3,
        0.2,
        _engaged_hump,
        named_laws(narrow={"width": (0.04, 0.1)}, wide={"width": (0.12, 0.25)}),
        {"place": (0.3, 0.75)},
    ),
    MotionForm(
        "outside_transducer_creep",
        TRANSDUCERS,
        "1",
        0.01,
        0.3,
        _creep,
        named_laws(slow={"time": (2.0, 8.0)}, quick={"time": (0.4, 1.5)}),
        {},
        True,
    ),
    MotionForm(
        "outside_hum",
        TRANSDUCERS,
        "N m",
        2e-3,
        0.1,
        _hum,
        Families({"sine": Law(_sine), "clipped": Law(_clipped)}),
        {"frequency": (3.0, 40.0), "phase": (0.0, REVOLUTION)},
    ),
)
"""Forms outside any library."""
