"""Torque programmes: what a motor is asked for over time, piecewise linear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class Programme:
    """A set torque over time: straight lines between knots, constant before the first and after the last.

    Parameters
    ----------
    times : (n,) array
        Knots [s], strictly increasing.
    torques : (n,) array
        Set torque at the knots [N m].

    Notes
    -----
    There is no jump: with the ideal derivative of the torque loop it would put an impulse on the amplifier. A step
    is a ramp with a stated rise time.
    """

    times: Array
    torques: Array

    def __post_init__(self) -> None:
        times, torques = np.asarray(self.times, dtype=np.float64), np.asarray(self.torques, dtype=np.float64)
        if times.ndim != 1 or times.shape != torques.shape or times.size == 0:
            shapes = f"shapes {times.shape} and {torques.shape}"
            raise BenchError("torque programme", shapes, "one torque for each time", "Give two equal columns.")
        if not (np.isfinite(times).all() and np.isfinite(torques).all()):
            bad = int(np.argmin(np.isfinite(times) & np.isfinite(torques)))
            raise BenchError("torque programme", f"a hole at knot {bad}", "finite numbers", "Fill or drop the knot.")
        if (np.diff(times) <= 0.0).any():
            bad = int(np.argmax(np.diff(times) <= 0.0))
            came = f"knot {bad + 1} at {times[bad + 1]:g} s after knot {bad} at {times[bad]:g} s"
            raise BenchError(
                "torque programme", came, "times that increase", "Sort the knots; give a step a rise time."
            )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "torques", torques)

    @classmethod
    def hold(cls, torque: float) -> Programme:
        """The same torque [N m] all the time."""
        return cls(np.zeros(1), np.array([torque]))

    @classmethod
    def ramp(cls, to: float, over: float, *, begin: float = 0.0, start: float = 0.0) -> Programme:
        """From `start` to `to` [N m] over a time [s], beginning at `begin` [s]."""
        return cls(np.array([begin, begin + over]), np.array([start, to]))

    @classmethod
    def step(cls, to: float, at: float, *, start: float = 0.0, rise: float = 1e-3) -> Programme:
        """A step at a time [s], with its rise time [s]."""
        return cls.ramp(to, rise, begin=at, start=start)

    @classmethod
    def sampled(cls, times: Array, torques: Array) -> Programme:
        """A recorded or made-up signal, linear between its samples."""
        return cls(times, torques)

    def torque(self, time: float | Array) -> Array:
        """Set torque [N m] at a time [s]."""
        return np.asarray(np.interp(time, self.times, self.torques))

    def slope(self, time: float | Array) -> Array:
        """Rate of the set torque [N m/s]; at a knot that of the line that begins there."""
        if self.times.size == 1:
            return np.zeros_like(np.asarray(time, dtype=np.float64))
        slopes = np.concatenate(([0.0], np.diff(self.torques) / np.diff(self.times), [0.0]))
        return np.asarray(slopes[np.searchsorted(self.times, time, side="right")])
