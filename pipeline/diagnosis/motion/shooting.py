"""Speed of the rotors simulated from the torques in their couplings, started anew after intervals of some length."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.gear_torque import gear_columns
from pmg.pipeline.diagnosis.motion.loss_curve import REST, drag_columns, engaged_drag_columns
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.rows import RotorState
    from pmg.pipeline.diagnosis.motion.traces import TorqueTrace
    from pmg.sim.signals import Array

LENGTHS = (0.5, 1.0, 5.0, math.inf)
"""Lengths of the intervals [s]; the last goes on as long as the shafts of a run turn."""

DRAWS = 4
"""Courses of noise that are simulated beside each run."""

SEED = 20261125
"""Of those courses."""

WITHIN = 2
"""Steps of the simulation from row to row."""

STEPS = 600
"""Speeds at which a drag is tabled, in either sense."""

BEYOND = 20.0
"""Largest speed that is tabled over the largest that was recorded."""


@dataclass(frozen=True)
class Shot:
    """Simulated less recorded speed of a rotor, root mean squares over all intervals of one length [rad/s].

    Parameters
    ----------
    length : float
        Of the intervals [s]; infinite where a run is simulated whole.
    side : str
        The rotor.
    before, after : float
        By the baseline alone, and together with what was named.
    noise : float
        What the noise of the readings makes of it.
    """

    length: float
    side: str
    before: float
    after: float
    noise: float


@dataclass(frozen=True)
class Shooting:
    """Runs simulated from their torques.

    Parameters
    ----------
    shots : tuple of Shot
        Of each length and rotor.
    speeds : dict
        Speed of each rotor by run and side, simulated whole together with what was named [rad/s]: rows of the run, NaN
        where it is not simulated.
    """

    shots: tuple[Shot, ...]
    speeds: dict[tuple[str, str], Array]


@dataclass(frozen=True)
class _Course:
    """A run as the simulation needs it: r rows, s rotors that turn.

    Parameters
    ----------
    states : tuple of RotorState
        Of the rotors.
    known : (r,) array of bool
        Rows at which all of them turn.
    motion : (r, s + 2) array
        Speed of each rotor, pole angle and its rate.
    missing : (r, s, c) array
        Measured less predicted torque: before, after, and courses of noise [N m].
    """

    states: tuple[RotorState, ...]
    known: Array
    motion: Array
    missing: Array

    @property
    def name(self) -> str:
        return self.states[0].stretch.run.run.name

    @property
    def rate(self) -> float:
        return self.states[0].stretch.run.row_rate

    def intervals(self, length: float) -> Iterator[slice]:
        """Rows that follow one another, as many as an interval holds; what is left over at an end goes."""
        most = len(self.known) if math.isinf(length) else round(length * self.rate)
        edges = np.flatnonzero(np.diff(self.known.astype(np.int8), prepend=0, append=0))
        for first, stop in edges.reshape(-1, 2).tolist():
            if math.isinf(length):
                yield slice(first, stop)
            else:
                for start in range(first, stop - most + 1, most):
                    yield slice(start, start + most)


def shoot(traces: tuple[TorqueTrace, ...], lengths: tuple[float, ...] = LENGTHS) -> Shooting:
    r"""The speed of each rotor from the torque in its coupling alone, beside what was recorded.

    Each interval starts from the recorded motion, and is not told it again. What was named acts as it did at the
    recorded motion; all else follows the simulated one.

    Notes
    -----
    With :math:`\omega + e` the simulated speed of a rotor, :math:`\varphi + \varepsilon` the simulated pole angle and m
    the missing torque, the balance :math:`T = J\dot\omega + D(\omega) + G(\varphi)` at the simulated motion less that
    at the recorded one is :math:`J\dot e = m - D(\omega + e) + D(\omega) - G(\varphi + \varepsilon) + G(\varphi)`, with
    :math:`\dot\varepsilon = p_s e_s + p_r e_r`. It is solved by Runge and Kutta's method of order four.
    """
    courses = _courses(traces)
    kinds: dict[tuple[bool, tuple[str, ...]], list[_Course]] = defaultdict(list)
    for course in courses:
        stretch = course.states[0].stretch
        kinds[stretch.coupled, tuple(state.stretch.side for state in course.states)].append(course)
    shots: list[Shot] = []
    speeds: dict[tuple[str, str], Array] = {}
    for length in lengths:
        errors: dict[str, list[Array]] = {side: [] for side in SIDES}
        for of_kind in kinds.values():
            for course, rows, error in _simulated(of_kind, length):
                for at, state in enumerate(course.states):
                    side = state.stretch.side
                    errors[side].append(error[:, at])
                    if length == lengths[-1]:
                        simulated = speeds.setdefault((course.name, side), np.full(len(course.known), np.nan))
                        simulated[rows] = course.motion[rows, at] + error[:, at, 1]
        for side, found in errors.items():
            if found:
                before, after, *noise = np.sqrt(np.mean(np.vstack(found) ** 2, axis=0)).tolist()
                shots.append(Shot(length, side, before, after, math.hypot(*noise) / math.sqrt(len(noise))))
    return Shooting(tuple(shots), speeds)


def _courses(traces: tuple[TorqueTrace, ...]) -> list[_Course]:
    """The runs in which something turns."""
    rng, of_run = np.random.default_rng(SEED), defaultdict[str, list["TorqueTrace"]](list)
    for trace in traces:
        if not trace.stretch.at_rest:
            of_run[trace.stretch.run.run.name].append(trace)
    found = []
    for of in of_run.values():
        run = of[0].stretch.run
        if of[0].stretch.coupled and len(of) < sum(run.run.turns):
            continue
        missing = np.zeros((len(run), len(of), 2 + DRAWS))
        for at, trace in enumerate(of):
            torque = trace.stretch.torque
            missing[trace.stretch.rows, at, :2] = np.stack([torque - trace.before, torque - trace.after], 1)
            missing[trace.stretch.rows, at, 2:] = trace.drawn(rng, DRAWS)
        state = of[0].state
        fine = np.stack([*(trace.state.speed for trace in of), state.pole_angle, state.slip], 1)
        known = np.all([trace.stretch.rows for trace in of], axis=0)
        found.append(_Course(tuple(trace.state for trace in of), known, run.rows(fine), missing))
    return found


def _simulated(courses: list[_Course], length: float) -> list[tuple[_Course, slice, Array]]:
    """Intervals of runs of one kind, and by how much the speed of each rotor is off in them (m, s, c) [rad/s]."""
    intervals = [(course, rows) for course in courses for rows in course.intervals(length)]
    if not intervals:
        return []
    most = max(rows.stop - rows.start for _, rows in intervals)
    motion, missing = (
        np.stack([_padded(getattr(course, what)[rows], most) for course, rows in intervals], 1)
        for what in ("motion", "missing")
    )
    error = _integrated(courses[0].states, motion, missing, 1.0 / courses[0].rate)
    return [(course, rows, error[: rows.stop - rows.start, at]) for at, (course, rows) in enumerate(intervals)]


def _padded(values: Array, most: int) -> Array:
    """Values (m, ...) that go on as they end up to a length."""
    return np.concatenate([values, np.repeat(values[-1:], most - len(values), axis=0)])


def _integrated(states: tuple[RotorState, ...], motion: Array, missing: Array, step: float) -> Array:
    """By how much the speeds are off (m, b, s, c), for `motion` (m, b, s + 2) and `missing` (m, b, s, c) torque."""
    count = len(states)
    inertia = np.array([state.value(f"inertia_{state.stretch.side}") for state in states])[:, None]
    coupled, sides = states[0].stretch.coupled, [state.stretch.side for state in states]
    poles = np.array([states[0].sheet.poles[side] if coupled else 0 for side in sides])[:, None]
    drags = [_tabled(state, BEYOND * float(np.abs(motion[..., at]).max())) for at, state in enumerate(states)]

    off = np.zeros((missing.shape[1], count + 1, missing.shape[3]))
    found = np.zeros(missing.shape)
    within = step / WITHIN

    def resisting(speed: Array, pole_angle: Array, slip: Array) -> Array:
        """Drag and torque of the gear of each rotor (..., s, c), for speeds (..., s, c), angle and slip (..., c)."""
        found = np.stack([np.interp(speed[..., at, :], *drag) for at, drag in enumerate(drags)], -2)
        if coupled:
            found += np.stack([_gear(state, pole_angle, slip) for state in states], -2)
        return found

    def slopes(off: Array, at: Array, torque: Array) -> Array:
        """Of the speeds and of the pole angle (b, s + 1, c) in time."""
        turning = np.sum(poles * off[:, :count], axis=1)
        angle = (at[:, count] + off[:, count], at[:, count + 1] + turning)
        rates = (torque - resisting(at[:, :count] + off[:, :count], *angle)) / inertia
        return np.concatenate([rates, turning[:, None]], 1)

    at, torque = _between(motion)[..., None], _between(missing)
    torque += resisting(at[..., :count, :], at[..., count, :], at[..., count + 1, :])
    for instant in range(0, len(at) - 1, 2):
        first, middle, last = zip(at[instant : instant + 3], torque[instant : instant + 3], strict=True)
        one = slopes(off, *first)
        two = slopes(off + 0.5 * within * one, *middle)
        three = slopes(off + 0.5 * within * two, *middle)
        four = slopes(off + within * three, *last)
        off = off + within / 6.0 * (one + 2.0 * two + 2.0 * three + four)
        if (instant + 2) % (2 * WITHIN) == 0:
            found[(instant + 2) // (2 * WITHIN)] = off[:, :count]
    return found


def _between(values: Array) -> Array:
    """Values (m, ...) on straight lines at the ends and middles of the steps between rows."""
    row, part = np.divmod(np.arange(2 * WITHIN * (len(values) - 1) + 1), 2 * WITHIN)
    part = (part / (2 * WITHIN)).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1.0 - part) * values[row] + part * values[np.minimum(row + 1, len(values) - 1)])


def _tabled(state: RotorState, most: float) -> tuple[Array, Array]:
    """Speeds, closest about standstill, and the drag at them."""
    speed = REST * np.sinh(np.linspace(-1.0, 1.0, 2 * STEPS + 1) * np.arcsinh(most / REST))
    side = state.stretch.side
    columns = drag_columns(side, speed) | (engaged_drag_columns(side, speed) if state.stretch.coupled else {})
    return speed, _total(state, columns)


def _gear(state: RotorState, pole_angle: Array, slip: Array) -> Array:
    """Torque of the gear on a rotor."""
    return _total(state, gear_columns(state.sheet, state.stretch.side, pole_angle, slip))


def _total(state: RotorState, columns: dict[str, Array]) -> Array:
    return np.asarray(sum(state.value(name) * column for name, column in columns.items()))
