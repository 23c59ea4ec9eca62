"""Terms of a regression, each declared once: equation, columns, unit, bounds, source."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask
    from pmg.sim.sources import Source


OUT, OUT_ANGLE, TEMPERATURE, ELAPSED, KNOWN = "output_torque", "output_angle", "temperature", "elapsed", "known"
"""Channels of `Motion.besides`: torque of the output as the input sees it [N m], its angle [rad], a temperature [K],
time since the recording began [s], force of the terms whose amplitude is known [N, N m]."""

TURNED_BEFORE = "turned_before"
"""Channel of `Motion.besides`: way since the sense last changed before the recording begins [m, rad]."""

NOISY, STEPS = "noisy", "steps"
"""Channels of `Motion.besides`: noise of the acceleration, and what steps of the encoder give it [m/s2, rad/s2]."""

RECORDING, OF_NONE = "recording", -1.0
"""Channel of `Motion.besides` where no angle was recorded: the fitted recording that a sample is of, or none of them.
Each recording then begins at an angle of its own."""

DURATION, MIDDLE, WARMTH, HOW_MANY, EXCEEDED = "duration", "middle", "warmth", "how_many", "exceeded"
"""References of columns: longest recording [s], middle of the travel [m, rad], first temperature [K], how many
recordings are fitted, command that a quarter of the samples in motion exceed [N, N m]."""

LAG, INPUT_LAG, OUTPUT_LAG = "lag", "input_lag", "output_lag"
"""References of columns: delay of the motion, of the input's or the output's torque about which a change in time is
taken [s]; absent where a first derivative fits better."""

DELAY = "delay"
OF_LAGS = {DELAY: LAG, "input_torque_lag": INPUT_LAG, "output_torque_lag": OUTPUT_LAG}
"""Term of the motion behind the command; terms of a lag, and the reference that each takes."""


@dataclass(frozen=True)
class Motion:
    """Recordings from which terms take their columns, at their full sample rate, one after the other; arrays (n,).

    Parameters
    ----------
    time, position, speed, acceleration : (n,) array
        [s]; [m], [m/s], [m/s2] of a machine that slides, [rad], [rad/s], [rad/s2] of one that turns.
    force : (n,) array
        What the actuator is commanded to apply [N, N m]; zero of a machine that coasts.
    modelled : (n,) array
        Force that the baseline gives [N, N m]; zero until it has been fitted.
    rest_speed : float
        Speed below which the machine counts as at rest [m/s, rad/s].
    starts : tuple of int
        Sample with which each recording begins.
    besides : mapping of str to (n,) array
        Further channels, by their names above.
    even_acceleration : float
        Acceleration that noise may make of an even speed [m/s2, rad/s2].
    references : mapping of str to float
        What columns refer to, by the names of references: of the fitted recordings, also where others are predicted.
    """

    time: Array
    position: Array
    speed: Array
    acceleration: Array
    force: Array
    modelled: Array
    rest_speed: float = 0.0
    starts: tuple[int, ...] = (0,)
    besides: Mapping[str, Array] = field(default_factory=dict)
    even_acceleration: float = 0.0
    references: Mapping[str, float] = field(default_factory=dict)

    @property
    def direction(self) -> Array:
        """Sign of the speed; zero at rest."""
        return np.where(np.abs(self.speed) > self.rest_speed, np.sign(self.speed), 0.0)

    @property
    def sense(self) -> Array:
        """Sense in which it moves, or at rest moved last; zero before it first did."""
        moved = self.direction
        last = np.maximum.accumulate(np.where(moved != 0.0, np.arange(len(moved)), -1))
        return np.asarray(np.where(last < self.first, 0.0, moved[np.maximum(last, 0)]))

    @property
    def first(self) -> npt.NDArray[np.int64]:
        """Sample with which the recording of each sample begins (n,)."""
        return np.repeat(np.array(self.starts), np.diff([*self.starts, len(self.time)]))

    @property
    def clear_acceleration(self) -> Array:
        """Acceleration without what is noise in it (n,)."""
        return np.asarray(self.acceleration - self.besides.get(NOISY, 0.0))

    @property
    def elapsed(self) -> Array:
        """Time since the recording began [s], (n,)."""
        return self.besides.get(ELAPSED, np.asarray(self.time - self.time[self.first]))

    def referred(self) -> Motion:
        """The same with the references of its own."""
        own = {DURATION: float(self.elapsed.max()), MIDDLE: 0.5 * float(self.position.min() + self.position.max())}
        moving = np.abs(self.force)[np.abs(self.speed) > self.rest_speed]
        own[HOW_MANY], own[EXCEEDED] = float(len(self.starts)), float(np.quantile(moving, 0.75)) if len(moving) else 0.0
        if TEMPERATURE in self.besides:
            own[WARMTH] = float(self.besides[TEMPERATURE][0])
        return replace(self, references=own)

    def part(self, rows: slice) -> Motion:
        """Samples of one recording, as a recording of its own."""
        besides = {key: values[rows] for key, values in self.besides.items()}
        if TURNED_BEFORE in besides:
            besides[TURNED_BEFORE] = np.full_like(besides[TURNED_BEFORE], self.travel[rows][0])
        return replace(
            self,
            time=self.time[rows],
            position=self.position[rows],
            speed=self.speed[rows],
            acceleration=self.acceleration[rows],
            force=self.force[rows],
            modelled=self.modelled[rows],
            starts=(0,),
            besides=besides,
        )

    def rate(self, values: Array) -> Array:
        """Derivative in time (n,), within each recording."""
        parts = np.split(values, self.starts[1:])
        return np.concatenate([np.gradient(part, self.sample_time) for part in parts])

    def ahead(self, values: Array, time: float) -> Array:
        """Change of values over a time that may be negative, per time (n,); their derivative where it is zero."""
        if time == 0.0:
            return self.rate(values)
        stretches = np.split(self.time, self.starts[1:]), np.split(values, self.starts[1:])
        later = [np.interp(t + time, t, own) for t, own in zip(*stretches, strict=True)]
        return np.asarray((np.concatenate(later) - values) / time)

    @property
    def sample_time(self) -> float:
        """Time from sample to sample [s]."""
        last = (*self.starts, len(self.time))[1] - 1
        return float((self.time[last] - self.time[0]) / last)

    @property
    def travel(self) -> Array:
        """Way since the sense last changed [m, rad]; one unit before the first change, if nothing else is known."""
        path = np.r_[0.0, np.cumsum(np.abs(np.diff(self.position)))]
        sense, first = self.sense, self.first
        turned = np.r_[False, (sense[1:] != sense[:-1]) & (sense[:-1] != 0.0)]
        turned[list(self.starts)] = False
        last = np.maximum.accumulate(np.where(turned, np.arange(len(path)), -1))
        before = self.besides.get(TURNED_BEFORE, np.ones_like(path))
        return np.asarray(np.where(last < first, path - path[first] + before, path - path[np.maximum(last, 0)]))


@dataclass(frozen=True)
class Quantity:
    """A parameter of a term.

    Parameters
    ----------
    name, unit : str
        SI unit.
    bounds : tuple of float
        Physical range.
    cost : float
        Parameters it counts for in the evidence; a period searched over many cycles counts for three.
    """

    name: str
    unit: str
    bounds: tuple[float, float]
    cost: float = 1.0

    @property
    def fixed(self) -> bool:
        """Whether it is known: its bounds are one value."""
        return self.bounds[0] == self.bounds[1]


M = TypeVar("M")


@dataclass(frozen=True)
class Term(Generic[M]):
    """One term of the regression, linear in its amplitudes, with at most one shape parameter.

    Parameters
    ----------
    identifier, title, equation : str
        Id for files; name for people; what it adds to the force.
    amplitudes : tuple of Quantity
        Linear parameters.
    columns : callable
        From what moves (a `Motion`) and the value of the shape (NaN without one) to an (n, amplitudes) array.
    outcomes : callable, optional
        From the same to an (n, k) array: what may happen, where nobody knows which; its column is about their mean.
    source : Source
        Where the equation is taken from.
    shape : Quantity, optional
        Nonlinear parameter, positive.
    separating_test : str
        Test that tells this term from those that look like it.
    of_model : bool
        Whether the columns distort what the rest of the model gives (gain, delay).
    needs_drive : bool
        Whether a machine that coasts does not show it: nothing drives it, and its acceleration is all there is.
    even_grid : bool
        Whether the shape is searched evenly in its inverse (a period) instead of in its logarithm.
    one_of : tuple of float
        Values of which the shape is one, as of an order; any between its bounds where empty.
    of_parts : bool
        Whether its amplitudes are parts of one law, of which some may vanish.
    both_ways : bool
        Whether a machine that moves one way only shows it as a plainer term.
    of_angle : bool
        Whether its amplitudes are of one recording where no angle was recorded.
    needs : tuple of str
        Channels of `Motion.besides` without which it cannot be looked for.
    variant : str
        Tells apart several forms of one term; empty for the one that a file means by its id.
    sharp : bool
        Whether its columns change with a small part of its shape, as near a resonance.
    at_an_instant : bool
        Whether its force follows from what moves at that instant and what is remembered of the way.
    """

    identifier: str
    title: str
    equation: str
    amplitudes: tuple[Quantity, ...]
    columns: Callable[[M, float], Array]
    source: Source
    shape: Quantity | None = None
    separating_test: str = ""
    of_model: bool = False
    needs_drive: bool = False
    even_grid: bool = False
    one_of: tuple[float, ...] = ()
    of_parts: bool = False
    both_ways: bool = False
    of_angle: bool = False
    needs: tuple[str, ...] = ()
    variant: str = ""
    sharp: bool = False
    at_an_instant: bool = True
    outcomes: Callable[[M, float], Array] | None = None

    @property
    def place(self) -> str:
        """Where it acts, of several places where it may; empty where there is one only."""
        return ""

    def in_each(self, recordings: int) -> Term[M]:
        """The same with amplitudes of its own in each of some recordings."""
        if recordings == 1:
            return self
        own = [replace(q, name=f"{q.name}{k}") for k in range(1, recordings + 1) for q in self.amplitudes]
        return replace(self, amplitudes=tuple(own))

    @property
    def whole(self) -> bool:
        """Whether its amplitudes are known, so that its shape is its size."""
        return self.shape is not None and all(quantity.fixed for quantity in self.amplitudes)

    @property
    def free(self) -> Mask:
        """Which of its amplitudes are not known (a,)."""
        return np.array([not quantity.fixed for quantity in self.amplitudes])

    @property
    def free_parameters(self) -> Mask:
        """Which of its parameters, amplitudes then shape, a small step may change (p,)."""
        of_shape = [] if self.shape is None else [not self.one_of]
        return np.array([*self.free, *of_shape], dtype=np.bool_)

    @property
    def single(self) -> bool:
        """Whether it has one amplitude, so that a baseline may hold it."""
        return len(self.amplitudes) == 1

    @property
    def key(self) -> str:
        """Its own among all terms."""
        return f"{self.identifier}/{self.variant}" if self.variant else self.identifier

    @property
    def parameters(self) -> tuple[Quantity, ...]:
        """Amplitudes, then the shape."""
        return self.amplitudes if self.shape is None else (*self.amplitudes, self.shape)
