"""What the instruments of a made machine show of a course, and what its faults make of that."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.machines.causes import POUND_FOOT
from pmg.pipeline.trials.machines.manoeuvres import BEFORE, coloured
from pmg.pipeline.trials.machines.plant import STEPS_A_SECOND, integrate_plant
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.trials.machines.kinds import MadeMachine
    from pmg.pipeline.trials.machines.manoeuvres import MadeCourse
    from pmg.pipeline.trials.machines.plant import PlantNumbers
    from pmg.sim.signals import Array

JITTER = 0.02
"""Standard deviation of the time of a sample, over the time between two."""

SLOW = 0.03
"""Correlation time of what wanders [s]."""

INSIDE = 0.15
"""Part of what wanders that acts on the machine, inside the loop of its regulator; the rest is in the readings."""


@dataclass(frozen=True)
class MadeReadings:
    """What a record shows, sample by sample [SI]: time, way and speed, force or torque, that of the other end."""

    time: Array
    way: Array
    speed: Array
    push: Array
    load: Array


def run_course(
    machine: MadeMachine, plant: PlantNumbers, course: MadeCourse, rng: np.random.Generator, *, quiet: bool = False
) -> MadeReadings:
    """What the instruments show of a course, before any fault of theirs.

    Parameters
    ----------
    machine : MadeMachine
        The machine.
    plant : PlantNumbers
        Its numbers with what it conceals.
    course : MadeCourse
        What is asked for.
    rng : numpy.random.Generator
        Of noise, the same draws for the same course whatever is concealed.
    quiet : bool
        Without any noise.
    """
    steps = len(course.speed)
    shaken, read = (coloured(steps, machine.wander, SLOW, rng) for _ in range(2))
    n = round(machine.seconds * machine.rate)
    jitter, white, coarse = rng.standard_normal((3, n)) * (not quiet)
    of_load, of_motion = rng.standard_normal((2, n)) * (not quiet)
    moved = integrate_plant(plant, course.speed, course.load, (not quiet) * INSIDE * shaken, course.begins)
    time = np.arange(n) / machine.rate
    at = (BEFORE + (np.arange(n) + JITTER * jitter) / machine.rate) * STEPS_A_SECOND
    way, speed, push, load = (np.interp(at, np.arange(steps), each) for each in (*moved.T, course.load))
    unit = {"slide": 1e-3, "joint": np.pi / 180.0}.get(machine.kind, RPM)
    shown = way if machine.reach else speed
    if not quiet:
        step = unit * machine.motion_step
        shown = step * np.round((shown + unit * machine.motion_noise * of_motion) / step)
        push = push + np.interp(at, np.arange(steps), read) + machine.noise * (white + 0.5 * coarse)
        load = load + 0.7 * machine.noise * of_load * (machine.ratio != 0.0)
        if machine.resolution:
            push, load = (machine.resolution * np.round(each / machine.resolution) for each in (push, load))
    if machine.reach:
        return MadeReadings(time, shown, np.gradient(shown, time), push, load)
    return MadeReadings(time, np.cumsum(shown) / machine.rate, shown, push, load)


def _late(values: Array, machine: MadeMachine, seconds: float) -> Array:
    places = np.arange(len(values), dtype=np.float64)
    return np.interp(places - seconds * machine.rate, places, values)


def misread(
    machine: MadeMachine, shown: MadeReadings, name: str, amplitude: float, constants: Mapping[str, float]
) -> MadeReadings:
    """What is shown with a cause in the instruments; as it is where it is in the mechanics."""
    sense = constants["sense"]
    of_output = constants["output"] > 0.0
    match name:
        case "zero":
            return replace(shown, push=shown.push + sense * amplitude * machine.plant.coulomb)
        case "gain_known_inertia":
            return replace(shown, push=(1.0 + sense * amplitude) * shown.push)
        case "rpm_as_rad":
            return replace(shown, speed=shown.speed / RPM, way=shown.way / RPM)
        case "sign_of_torque":
            return replace(shown, push=-shown.push)
        case "delay":
            return replace(
                shown, way=_late(shown.way, machine, amplitude), speed=_late(shown.speed, machine, amplitude)
            )
        case "output_delay":
            return replace(shown, load=_late(shown.load, machine, amplitude))
        case "input_delay":
            return replace(shown, push=_late(shown.push, machine, amplitude))
        case "gain_two_torques" | "pound_feet":
            factor = 1.0 + sense * amplitude if name == "gain_two_torques" else POUND_FOOT
            if of_output:
                return replace(shown, load=factor * shown.load)
            return replace(shown, push=factor * shown.push)
    return shown
