"""A bench made ready for its runs, and what its runs would read without noise."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.motion import places as at
from pmg.pipeline.trials.motion.bench import POLE_PAIRS, MovingBench, gear_numbers, shaft_numbers
from pmg.pipeline.trials.motion.kernel import integrate
from pmg.pipeline.trials.motion.programme import RATE
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, PerShaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.trials.motion.programme import MotionCampaign, PlannedRun
    from pmg.sim.signals import Array

SUBSTEPS = 3
"""Steps of the integration from one sample to the next."""
SPEEDS = at.FINEST * (np.arange(at.NODES) / (at.NODES - 1)) ** 2
"""Speeds at the nodes of a drag table [rad/s]."""
ROW = {side: row for row, side in enumerate(SIDES)}


@dataclass(frozen=True)
class BenchCourse:
    """A run without noise.

    Parameters
    ----------
    run : PlannedRun
        What was asked for.
    elapsed : (n,) array
        Time since the start of the campaign [s].
    torque, angle : PerShaft of (n,) array
        What the transducers [N m] and the encoders [rad] show.
    turned, speed : PerShaft of (n,) array
        True angles [rad] and speeds [rad/s] of the motors.
    """

    run: PlannedRun
    elapsed: Array
    torque: PerShaft[Array]
    angle: PerShaft[Array]
    turned: PerShaft[Array]
    speed: PerShaft[Array]


@dataclass
class SyntheticMachine:
    """A bench as the kernel knows it; effects change its numbers, its drag, the inputs of its runs, its readings.

    Parameters
    ----------
    bench, campaign : Bench, Campaign
        What is run, on what.
    shafts, gear, tables : array
        Numbers of the kernel.
    inputs : list of callable
        Each changes the inputs of a run in place, (n, 2, INPUTS), given the run.
    readings : list of callable
        Each makes one course of another.
    """

    bench: MovingBench
    campaign: MotionCampaign
    shafts: Array = field(init=False)
    gear: Array = field(init=False)
    tables: Array = field(init=False)
    inputs: list[Callable[[PlannedRun, Array], None]] = field(default_factory=list)
    readings: list[Callable[[BenchCourse], BenchCourse]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.shafts, self.gear = shaft_numbers(self.bench), gear_numbers(self.bench)
        self.tables = np.array([[shaft.drag.drag(SPEEDS)] * 2 for shaft in self.bench.shafts])

    def states(self, run: PlannedRun, begun: PerShaft[float], substeps: int = SUBSTEPS) -> Array:
        """Outputs of the kernel through a run that begins at rest, shafts turned by so much, (n, 2, OUTPUTS)."""
        given = run.inputs
        for change in self.inputs:
            change(run, given)
        engaged = run.configuration is Configuration.ENGAGED
        y = np.zeros((2, at.STATES))
        for row, angle in enumerate(begun):
            y[row, [at.MOTOR_ANGLE, at.ROTOR_ANGLE, at.EXTRA_ANGLE]] = angle
        if engaged:  # the poles stand where the spring is at rest
            pitch = REVOLUTION / POLE_PAIRS.ring
            rest = -POLE_PAIRS.sun / POLE_PAIRS.ring * begun.sun
            y[1, [at.MOTOR_ANGLE, at.ROTOR_ANGLE, at.EXTRA_ANGLE]] = rest + pitch * np.round(
                (begun.ring - rest) / pitch
            )
        gear = self.gear if engaged else np.zeros(at.GEAR_NUMBERS)
        return integrate(y, given, (self.shafts, gear, self.tables), 1.0 / RATE, substeps)

    def follow(self, run: PlannedRun, begun: PerShaft[float]) -> BenchCourse:
        """What a run reads without noise."""
        found = self.states(run, begun)
        torque, angle, speed = (
            PerShaft(*(np.ascontiguousarray(found[:, row, place]) for row in range(2)))
            for place in (at.COUPLING, at.ANGLE, at.TURNING)
        )
        course = BenchCourse(run, self.campaign.elapsed(run), torque, angle, angle, speed)
        for change in self.readings:
            course = change(course)
        return course
