"""Demand on a motor over time: straight lines between knots, and sine sweeps on top."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import BenchError
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class Sweep:
    """A sine whose frequency runs evenly from one value to another.

    Parameters
    ----------
    amplitude : float
        In the unit of the programme.
    frequency_begin, frequency_end : float
        Angular frequencies [rad/s].
    begin, end : float
        When it starts and stops [s]; it makes whole turns, so the signal has no jump.
    """

    amplitude: float
    frequency_begin: float
    frequency_end: float
    begin: float
    end: float

    def angle(self, time: Array | float) -> tuple[Array, Array]:
        """Phase of the sine [rad] and its rate [rad/s], meant between begin and end."""
        dt = np.asarray(time, dtype=np.float64) - self.begin
        chirp = (self.frequency_end - self.frequency_begin) / (self.end - self.begin)
        return (self.frequency_begin + 0.5 * chirp * dt) * dt, self.frequency_begin + chirp * dt


@dataclass(frozen=True)
class Programme:
    """A set value over time: straight lines between knots, constant before the first and after the last.

    Parameters
    ----------
    times : (n,) array
        Knots [s], strictly increasing.
    values : (n,) array
        Set torque [N m], or speed [rad/s], at the knots.
    sweeps : tuple of Sweep
        Added to the lines, one after the other.

    Notes
    -----
    There is no jump: with the ideal derivative of the torque loop it would put an impulse on the amplifier. A step
    is a ramp with a stated rise time.
    """

    times: Array
    values: Array
    sweeps: tuple[Sweep, ...] = ()

    def __post_init__(self) -> None:
        times, values = np.asarray(self.times, dtype=np.float64), np.asarray(self.values, dtype=np.float64)
        if times.ndim != 1 or times.shape != values.shape or times.size == 0:
            shapes = f"shapes {times.shape} and {values.shape}"
            raise BenchError("programme", shapes, "one value for each time", "Give two equal columns.")
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            bad = int(np.argmin(np.isfinite(times) & np.isfinite(values)))
            raise BenchError("programme", f"a hole at knot {bad}", "finite numbers", "Fill or drop the knot.")
        if (np.diff(times) <= 0.0).any():
            bad = int(np.argmax(np.diff(times) <= 0.0))
            came = f"knot {bad + 1} at {times[bad + 1]:g} s after knot {bad} at {times[bad]:g} s"
            raise BenchError("programme", came, "times that increase", "Sort the knots; give a step a rise time.")
        for earlier, later in zip(self.sweeps, self.sweeps[1:], strict=False):
            if later.begin < earlier.end:
                came = f"a sweep from {later.begin:g} s while one runs until {earlier.end:g} s"
                raise BenchError("programme", came, "one sweep at a time", "Let it begin later.")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)

    @classmethod
    def hold(cls, value: float) -> Programme:
        """The same value all the time."""
        return cls(np.zeros(1), np.array([value]))

    @classmethod
    def ramp(cls, to: float, over: float, *, begin: float = 0.0, start: float = 0.0) -> Programme:
        """From `start` to `to` over a time [s], beginning at `begin` [s]."""
        return cls(np.array([begin, begin + over]), np.array([start, to]))

    @classmethod
    def step(cls, to: float, at: float, *, start: float = 0.0, rise: float = 1e-3) -> Programme:
        """A step at a time [s], with its rise time [s]."""
        return cls.ramp(to, rise, begin=at, start=start)

    @classmethod
    def sampled(cls, times: Array, values: Array) -> Programme:
        """A recorded or made-up signal, linear between its samples."""
        return cls(times, values)

    def sweep(
        self, amplitude: float, frequency_begin: float, frequency_end: float, *, begin: float, over: float
    ) -> Programme:
        """The same programme with a sine sweep added [rad/s, s]; its length is rounded to whole turns."""
        mean = 0.5 * (frequency_begin + frequency_end)
        if not (min(frequency_begin, frequency_end) > 0.0 and over > 0.0 and math.isfinite(amplitude * mean * over)):
            came = f"{frequency_begin:g} to {frequency_end:g} rad/s over {over:g} s"
            raise BenchError("sine sweep", came, "frequencies and a time above 0", "Correct the sweep.")
        turns = max(1, round(mean * over / REVOLUTION))
        end = begin + turns * REVOLUTION / mean
        return Programme(
            self.times, self.values, (*self.sweeps, Sweep(amplitude, frequency_begin, frequency_end, begin, end))
        )

    @property
    def corners(self) -> Array:
        """Times at which the form of the programme changes [s]."""
        ends = [time for sweep in self.sweeps for time in (sweep.begin, sweep.end)]
        return np.unique(np.concatenate((self.times, ends)))

    def value(self, time: float | Array) -> Array:
        """Set value at a time [s]."""
        found = np.interp(time, self.times, self.values)
        for sweep in self.sweeps:
            inside = (np.asarray(time) >= sweep.begin) & (np.asarray(time) < sweep.end)
            found = found + np.where(inside, sweep.amplitude * np.sin(sweep.angle(time)[0]), 0.0)
        return np.asarray(found)

    def slope(self, time: float | Array) -> Array:
        """Rate of the set value; at a corner that of what begins there."""
        slopes = np.concatenate(([0.0], np.diff(self.values) / np.diff(self.times), [0.0]))
        found = slopes[np.searchsorted(self.times, time, side="right")]
        for sweep in self.sweeps:
            inside = (np.asarray(time) >= sweep.begin) & (np.asarray(time) < sweep.end)
            angle, rate = sweep.angle(time)
            found = found + np.where(inside, sweep.amplitude * rate * np.cos(angle), 0.0)
        return np.asarray(found)
