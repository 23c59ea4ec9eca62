"""Speed of the rotors simulated from the torques in their couplings, restarted after intervals of some length."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.simulated_rotors import AWAY, speed_errors
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.motion.rows import RotorState
    from pmg.pipeline.diagnosis.motion.traces import TorqueTrace
    from pmg.sim.signals import Array, Mask

LENGTHS = (0.5, 1.0, 5.0, math.inf)
"""Lengths of the intervals [s]; the last goes on as long as the shafts of a run turn."""

DRAWS = 8
"""Realisations of the noise that are simulated with each run."""

SEED = 20261125
"""Of those realisations."""

SHORTEST = 4
"""Rows that an interval must hold to be simulated."""


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
        By the baseline alone, and together with what was named; infinite where a simulation runs away.
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
        Of each length and rotor; none of a length that no run reaches.
    speeds : dict
        Speed of each rotor by run and side, simulated whole together with what was named [rad/s]: rows of the run, NaN
        where it is not simulated.
    """

    shots: tuple[Shot, ...]
    speeds: dict[tuple[str, str], Array]


@dataclass(frozen=True)
class _Course:
    """Rotors of a run that move together: r rows, s rotors.

    Parameters
    ----------
    states : tuple of RotorState
        Of the rotors.
    known : (r,) array of bool
        Rows at which all of them turn.
    motion : (r, s + 2) array
        Speed of each rotor, pole angle and its rate.
    missing : (r, s, c) array
        Measured less predicted torque, c times [N m].
    """

    states: tuple[RotorState, ...]
    known: Mask
    motion: Array
    missing: Array

    @property
    def run(self) -> str:
        """Name of the run."""
        return self.states[0].stretch.run.run.name

    @property
    def kind(self) -> tuple[bool, tuple[str, ...]]:
        """What courses that are simulated at once have in common: whether coupled, and which rotors."""
        return self.states[0].stretch.coupled, tuple(state.stretch.side for state in self.states)

    def intervals(self, length: float) -> Iterator[slice]:
        """Rows that follow one another, as many as an interval holds; what is left over at an end goes."""
        edges = np.flatnonzero(np.diff(self.known.astype(np.int8), prepend=0, append=0))
        for first, stop in edges.reshape(-1, 2).tolist():
            most = stop - first if math.isinf(length) else round(length * self.states[0].stretch.run.row_rate)
            if most >= SHORTEST:
                for start in range(first, stop - most + 1, most):
                    yield slice(start, start + most)


def shoot(traces: tuple[TorqueTrace, ...], lengths: tuple[float, ...] = LENGTHS) -> Shooting:
    """The speed of each rotor from the torque in its coupling, to compare with the recorded one.

    Each interval starts from the recorded motion, which does not correct it again. What was named acts as it did at the
    recorded motion; inertia, drag and gear follow the simulated one.

    Parameters
    ----------
    traces : tuple of TorqueTrace
        Of a diagnosis.
    lengths : tuple of float
        Of the intervals [s].

    Returns
    -------
    Shooting
        Errors by length and rotor, and the speeds where runs are simulated whole.

    Notes
    -----
    The noise of both readings of an engaged run is drawn for each by itself.
    """
    rng = np.random.default_rng(SEED)
    before, after = _courses(traces, rng, with_cause=False), _courses(traces, rng, with_cause=True)
    shots: list[Shot] = []
    speeds: dict[tuple[str, str], Array] = {}
    for length in lengths:
        of_side: dict[str, tuple[list[Array], list[Array]]] = {side: ([], []) for side in SIDES}
        for which, courses in enumerate((before, after)):
            for course, rows, errors in _simulated(courses, length):
                for k, state in enumerate(course.states):
                    side = state.stretch.side
                    of_side[side][which].append(errors[:, k])
                    if which and math.isinf(length):
                        whole = speeds.setdefault((course.run, side), np.full(len(course.known), np.nan))
                        off = errors[:, k, 0]
                        whole[rows] = course.motion[rows, k] + np.where(np.abs(off) < AWAY, off, np.nan)
        for side, (without, with_cause) in of_side.items():
            if without:
                (first,), (last, *noise) = _root_mean_squares(without), _root_mean_squares(with_cause)
                shots.append(Shot(length, side, first, last, float(np.sqrt(np.mean(np.square(noise))))))
    return Shooting(tuple(shots), speeds)


def _root_mean_squares(errors: list[Array]) -> list[float]:
    """Of each column; infinite where one ran away."""
    whole = np.vstack(errors)
    away = np.any(np.abs(whole) >= AWAY, axis=0)
    return [float(value) for value in np.where(away, np.inf, np.sqrt(np.mean(whole**2, axis=0)))]


def _courses(traces: tuple[TorqueTrace, ...], rng: np.random.Generator, *, with_cause: bool) -> list[_Course]:
    """The runs in which something turns: without what was named, or with it and with realisations of the noise."""
    together: dict[tuple[str, str], list[TorqueTrace]] = defaultdict(list)
    for trace in traces:
        if not trace.stretch.at_rest:
            stretch = trace.stretch
            together[stretch.run.run.name, "" if stretch.coupled else stretch.side].append(trace)
    found = []
    for group in together.values():
        run = group[0].stretch.run
        if group[0].stretch.coupled and len(group) < sum(run.run.turns):
            continue
        states = tuple(trace.state if with_cause else trace.state_before for trace in group)
        missing = np.zeros((len(run), len(group), 1 + DRAWS if with_cause else 1))
        for k, trace in enumerate(group):
            rows, predicted = trace.stretch.rows, trace.after if with_cause else trace.before
            missing[rows, k, 0] = trace.stretch.torque - predicted
            if with_cause:
                missing[rows, k, 1:] = trace.draw_noise(rng, DRAWS)
        fine = np.stack([*(state.speed for state in states), states[0].pole_angle, states[0].slip], 1)
        known = np.all([trace.stretch.rows for trace in group], axis=0)
        found.append(_Course(states, known, run.rows(fine), missing))
    return found


def _simulated(courses: list[_Course], length: float) -> list[tuple[_Course, slice, Array]]:
    """Intervals of runs, and by how much the speed of each rotor is off in them (m, s, c) [rad/s]."""
    found = []
    for kind in dict.fromkeys(course.kind for course in courses):
        intervals = [(c, rows) for c in courses if c.kind == kind for rows in c.intervals(length)]
        if not intervals:
            continue
        most = max(rows.stop - rows.start for _, rows in intervals)
        motion = np.stack([_padded(course.motion[rows], most) for course, rows in intervals], 1)
        missing = np.stack([_padded(course.missing[rows], most) for course, rows in intervals], 1)
        errors = speed_errors(intervals[0][0].states, motion, missing)
        found += [(course, rows, errors[: rows.stop - rows.start, k]) for k, (course, rows) in enumerate(intervals)]
    return found


def _padded(values: Array, most: int) -> Array:
    """Values (m, ...) that go on as they end up to a length."""
    return np.concatenate([values, np.repeat(values[-1:], most - len(values), axis=0)])
