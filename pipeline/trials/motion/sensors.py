"""What the instruments make of a run: noise, wander from run to run, ripple a turn, steps of frequency and count."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pmg.pipeline.recording.calibration import Calibration, Transducer
from pmg.pipeline.recording.write import COUNTS_PER_REV, NULL_FREQUENCY_HZ, SPAN_HZ
from pmg.pipeline.trials.motion.forms_reading import NOMINAL
from pmg.pipeline.trials.motion.programme import RATE
from pmg.pipeline.trials.world import STEP_HZ
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, PerShaft, per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.trials.motion.bench import MotionNoise
    from pmg.pipeline.trials.motion.machine import BenchCourse
    from pmg.sim.signals import Array

COUNT = REVOLUTION / COUNTS_PER_REV
"""Angle of one encoder count [rad]."""
CALIBRATION = Calibration(
    Transducer(NULL_FREQUENCY_HZ, NOMINAL.sun, SPAN_HZ, "concealed"),
    Transducer(NULL_FREQUENCY_HZ, NOMINAL.ring, SPAN_HZ, "concealed"),
    COUNTS_PER_REV,
    COUNTS_PER_REV,
)
"""Transducers and encoders of the bench."""


class Instruments:
    """The instruments through one campaign: their zero, and a wander that goes on from run to run.

    Parameters
    ----------
    noise : ReadingNoise
        How readings scatter.
    rng : numpy.random.Generator
        Draws all of it.
    """

    def __init__(self, noise: MotionNoise, rng: np.random.Generator) -> None:
        self.noise, self.rng = noise, rng
        self.slow = {(side, time): rng.standard_normal() for side in SIDES for time in noise.times}
        self.phases = per_shaft(lambda _: rng.uniform(0.0, REVOLUTION, 2))
        self.until = 0.0

    def read(self, course: BenchCourse) -> PerShaft[tuple[Array, Array]]:
        """Torque [N m] and angle [rad] of both shafts as recorded, in the steps of frequency and count."""
        late = self.noise.jitter * self.rng.standard_normal(len(course.elapsed))
        gap = float(course.elapsed[0]) - self.until
        self.until = float(course.elapsed[-1])
        began = per_shaft(lambda _: int(self.rng.integers(COUNTS_PER_REV)) * self.noise.begins_anew)
        return per_shaft(lambda side: self._read(course, side, late, gap, began[side]))

    def _read(self, course: BenchCourse, side: str, late: Array, gap: float, began: int) -> tuple[Array, Array]:
        noise, torque, turned, n = self.noise, course.torque[side], course.turned[side], len(late)
        held = course.run.configuration is Configuration.NEUTRAL and side not in course.run.asked
        slope = np.gradient(torque) * RATE
        wander = sum(self._wander(side, time, n, gap) for time in noise.times)
        once, twice = noise.ripple[side]
        first, second = self.phases[side]
        seen = torque + slope * late + noise.white[side] * self.rng.standard_normal(n)
        seen += once * np.sin(turned + first) + twice * np.sin(2.0 * turned + second)
        seen += wander + noise.zero[side] + held * noise.reaction * self.rng.standard_normal()
        step = STEP_HZ / SPAN_HZ * NOMINAL[side]
        angle = course.angle[side] + course.speed[side] * late
        return np.round(seen / step) * step, (np.floor(angle / COUNT) + began) * COUNT

    def _wander(self, side: str, time: float, n: int, gap: float) -> Array:
        """A part of the wander through a run that begins a gap [s] after the last one ended [N m]."""
        kept = float(np.exp(-gap / time))
        last = kept * self.slow[side, time] + np.sqrt(1.0 - kept**2) * self.rng.standard_normal()
        kept = float(np.exp(-1.0 / RATE / time))
        fresh = np.sqrt(1.0 - kept**2) * self.rng.standard_normal(n)
        chain, _ = lfilter([1.0], [1.0, -kept], fresh, zi=[kept * last])
        self.slow[side, time] = chain[-1]
        return np.asarray(self.noise.wander / np.sqrt(len(self.noise.times)) * chain)


def noise_density(noise: MotionNoise, side: str, frequency: Array) -> Array:
    """Power of a torque's noise per frequency, two-sided [N2 m2 s]."""
    step = STEP_HZ / SPAN_HZ * NOMINAL[side]
    density = np.full(len(frequency), (noise.white[side] ** 2 + step**2 / 12.0) / RATE)
    for time in noise.times:
        slow = 2.0 * time / (1.0 + (REVOLUTION * frequency * time) ** 2)
        density += noise.wander**2 / len(noise.times) * slow
    return density
