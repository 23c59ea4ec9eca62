"""Torque that is missing from the balance of each rotor, by readings without noise and the bench as built.

What an observer has who knows the bench but neither its drives nor the effect: the torque in each coupling and the
angle of each motor. The rotor's angle follows by the coupling's twist; inertia, drag and magnetic torque are taken
from the torque; what is left over is missing. Everything is in terms of frequency, up to `HIGHEST`: beyond, the steps
of the counts drown any torque in that of the inertia.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.fft import next_fast_len, rfft

from pmg.pipeline.trials.motion.bench import POLE_PAIRS
from pmg.pipeline.trials.motion.forms_reading import lagged
from pmg.pipeline.trials.motion.programme import RATE
from pmg.pipeline.trials.motion.sensors import COUNT, noise_density
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.trials.motion.bench import MovingBench, Shaft
    from pmg.pipeline.trials.motion.machine import BenchCourse
    from pmg.sim.signals import Array

Spectrum = npt.NDArray[np.complex128]
HIGHEST = 100.0
"""Highest frequency that counts [Hz]."""
ZERO_TOLERANCE, ROTOR_TOLERANCE, STIFFNESS_TOLERANCE, SPRING_TOLERANCE = 2e-3, 0.05, 0.2, 0.03
"""Standard uncertainties of what a data sheet states: a zero [N m], and relative ones."""
SKEW_TOLERANCE = 5e-4
"""Standard uncertainty of the time between a torque and an angle of one sample [s]: half of it."""
RIPPLE_TOLERANCES = (0.6e-3, 0.4e-3)
"""Standard uncertainty of the ripple that every reading has once and twice a turn [N m]."""
DRY_TOLERANCE = 2e-3
"""Standard uncertainty of the dry friction that engaging brings [N m]."""
ENCODER_TOLERANCE = 1e-4
"""Standard uncertainty of the wave of a turn in the angle that an encoder shows [rad]."""
FREE = 1e3
"""Standard uncertainty of what nothing is known of, in its own unit."""
TENTS = 9
"""Nodes over the root of the speed between which a free drag curve runs straight."""


@dataclass(frozen=True)
class _RotorMotion:
    """A rotor's angle by the readings [rad], with its rates, the coupling torque [N m], and the twist [rad]."""

    torque: Array
    twist: Array
    angle: Array
    speed: Array
    acceleration: Array


def _rotor(shaft: Shaft, torque: Array, angle: Array) -> _RotorMotion:
    twist = lagged(torque / shaft.stiffness, shaft.damping / shaft.stiffness)
    turned = angle - twist
    speed = np.gradient(turned) * RATE
    return _RotorMotion(torque, twist, turned, speed, np.gradient(speed) * RATE)


class CourseBalance:
    """The balances of one run: what is missing, what a baseline may move, and how they scatter.

    Parameters
    ----------
    bench : MovingBench
        As built.
    course : BenchCourse
        Readings without noise.
    """

    def __init__(self, bench: MovingBench, course: BenchCourse) -> None:
        self.bench, self.course = bench, course
        self.engaged = course.run.configuration is Configuration.ENGAGED
        still = course.run.configuration is Configuration.ZERO
        self.sides = [side for side in SIDES if side in course.run.asked or still]
        self.rotors = {side: _rotor(bench.shafts[side], course.torque[side], course.angle[side]) for side in self.sides}
        self.pole_angle = self.pole_rate = np.zeros(0)
        if self.engaged:
            self.pole_angle, self.pole_rate = (
                POLE_PAIRS.sun * sun + POLE_PAIRS.ring * ring
                for sun, ring in (
                    (self.rotors["sun"].angle, self.rotors["ring"].angle),
                    (self.rotors["sun"].speed, self.rotors["ring"].speed),
                )
            )

    @property
    def seconds(self) -> float:
        """Length of the run [s]."""
        return len(self.course.elapsed) / RATE

    def missing(self) -> dict[str, Array]:
        """Torque that is missing from each balance [N m]."""
        found = {}
        for side in self.sides:
            shaft, rotor = self.bench.shafts[side], self.rotors[side]
            left = rotor.torque - shaft.rotor_inertia * rotor.acceleration - shaft.friction(rotor.speed)
            if self.engaged:
                spring = self.bench.pull_out * np.sin(self.pole_angle) + self.bench.slip_damping * self.pole_rate
                left = left - POLE_PAIRS[side] * spring - shaft.eddy * rotor.speed
            found[side] = left
        return found

    def columns(self) -> Iterator[tuple[str, float, dict[str, Array]]]:
        """Name of each number that a baseline may move, its standard uncertainty, and its torque in each balance."""
        for side in self.sides:
            shaft, rotor = self.bench.shafts[side], self.rotors[side]
            yield f"zero {side}", ZERO_TOLERANCE, {side: np.ones_like(rotor.torque)}
            if side not in self.course.run.asked:
                continue
            yield f"inertia {side}", ROTOR_TOLERANCE, {side: shaft.rotor_inertia * rotor.acceleration}
            yield f"stiffness {side}", STIFFNESS_TOLERANCE, self._turned(side, rotor.twist)
            yield f"skew {side}", SKEW_TOLERANCE, {side: np.gradient(rotor.torque) * RATE}
            for wave in (np.cos, np.sin):
                yield f"encoder {side} {wave.__name__}", ENCODER_TOLERANCE, self._turned(side, wave(rotor.angle))
            for order, tolerance in enumerate(RIPPLE_TOLERANCES, 1):
                for wave in (np.cos, np.sin):
                    name = f"ripple {side} {order} {wave.__name__}"
                    yield name, tolerance, {side: wave(order * self.course.turned[side])}
            direction, nodes = shaft.direction(rotor.speed), np.linspace(0.0, 14.5, TENTS)
            for k, node in enumerate(nodes):
                tent = np.maximum(1.0 - np.abs(np.sqrt(np.abs(rotor.speed)) - node) / nodes[1], 0.0)
                yield f"drag {side} {k}", FREE, {side: tent * direction}
            if self.engaged:
                yield f"eddy {side}", FREE, {side: rotor.speed}
                yield f"dry {side}", DRY_TOLERANCE, {side: direction}
        if self.engaged:
            spring = self.bench.pull_out * np.sin(self.pole_angle)
            yield "pull-out", SPRING_TOLERANCE, {side: POLE_PAIRS[side] * spring for side in SIDES}
            yield "slip", FREE, {side: POLE_PAIRS[side] * self.pole_rate for side in SIDES}
            begun = POLE_PAIRS.sun * np.ones_like(spring)
            yield f"poles {self.course.run.point}", FREE, self._shifted(begun)

    def _turned(self, side: str, angle: Array) -> dict[str, Array]:
        """What each balance loses when the rotor of a side stands further by an angle."""
        speed = np.gradient(angle) * RATE
        own = self.bench.shafts[side].rotor_inertia * np.gradient(speed) * RATE
        found = self._shifted(POLE_PAIRS[side] * angle) if self.engaged else {}
        return {**found, side: own + found.get(side, 0.0)}

    def _shifted(self, pole_angle: Array) -> dict[str, Array]:
        """What each balance loses when the pole angle is larger."""
        stiffness = self.bench.pull_out * np.cos(self.pole_angle)
        return {side: POLE_PAIRS[side] * stiffness * pole_angle for side in SIDES}

    def spectra(self, listed: Sequence[dict[str, Array]]) -> Spectrum:
        """Torques of all balances by frequency, over their noise, (m, sides x frequencies); square norms in sigmas."""
        top, scale = len(self._roots), np.sqrt(2.0 / RATE / self._padded)
        found = np.zeros((len(listed), len(self.sides), top), dtype=np.complex128)
        for column, side in enumerate(self.sides):
            rows = [row for row, torques in enumerate(listed) if side in torques]
            found[rows, column] = scale * rfft(np.array([listed[row][side] for row in rows]), self._padded)[:, :top]
        found[:, :, 0] /= np.sqrt(2.0)
        roots = self._roots
        found[:, 0] /= roots[:, 0, 0]
        if len(self.sides) > 1:
            found[:, 1] = (found[:, 1] - roots[:, 1, 0] * found[:, 0]) / roots[:, 1, 1]
        return found.reshape(len(listed), -1)

    @property
    def _padded(self) -> int:
        return int(next_fast_len(len(self.course.elapsed), real=True))

    @cached_property
    def _roots(self) -> Array:
        """Root of the noise's density between the balances at each frequency, (frequencies, sides, sides)."""
        frequency = np.arange(int(HIGHEST * self._padded / RATE)) * RATE / self._padded
        noise, count = self.bench.noise, COUNT**2 / 12.0 / RATE
        size = len(self.sides)
        density, by_angle = np.zeros((2, len(frequency), size, size))
        moving = any(side in self.course.run.asked for side in self.sides)
        spring = self.bench.pull_out * float(np.mean(np.cos(self.pole_angle))) if self.engaged else 0.0
        for i, side in enumerate(self.sides):
            density[:, i, i] = noise_density(noise, side, frequency)
            by_angle[:, i, i] = moving * self.bench.shafts[side].rotor_inertia * (REVOLUTION * frequency) ** 2
            for j, other in enumerate(self.sides):
                by_angle[:, i, j] -= spring * POLE_PAIRS[side] * POLE_PAIRS[other]
        density += count * by_angle @ by_angle.transpose(0, 2, 1)
        return np.asarray(np.linalg.cholesky(density))
