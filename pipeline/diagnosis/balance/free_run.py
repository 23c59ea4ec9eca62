"""Free run: the position or speed that a model of the force balance gives from the force alone, never corrected."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.estimate import INERTIA
from pmg.pipeline.diagnosis.balance.known_terms import SetTerm, missing_parameters, set_terms
from pmg.pipeline.diagnosis.balance.library.drive_faults import DEAD_ZONE, GAIN
from pmg.pipeline.diagnosis.balance.library.term import DELAY, NOISY, Motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.balance.case import Case
    from pmg.pipeline.diagnosis.balance.estimate import FittedTerms
    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.pipeline.machine.axis import Axis
    from pmg.sim.signals import Array

MANY = 1e4
"""Small units of a position from which on a stroke is told in the plain one."""

FADE, LIMIT = "drive_fade", "drive_limit"
"""Terms that change what force acts when, instead of adding one."""

OF_COMMAND = frozenset({DELAY, FADE, GAIN, LIMIT, DEAD_ZONE})
"""All of them that a simulation undoes; a dead zone as one with sharp corners."""

RUNS_AWAY = 1e6
"""Speed [SI] from which on a simulation is given up: its errors are NaN."""

HARDLY = 1e-9
"""Speed [SI] that stands for setting out from rest in one sense or the other."""


@dataclass(frozen=True)
class FreeRun:
    """A record simulated from its force alone.

    Parameters
    ----------
    model : str
        Whose parameters.
    record : str
        File name.
    of_speed : bool
        Whether it is the speed [m/s, rad/s] that is compared, as no position was recorded; otherwise the position
        [m, rad].
    simulated : (n,) array
        What the model gives.
    error : float
        Root mean square of simulated less measured.
    largest : float
        Largest difference.
    span : float
        From the least measured value to the largest: of the position, the stroke.
    """

    model: str
    record: str
    of_speed: bool
    simulated: Array
    error: float
    largest: float
    span: float

    @property
    def words(self) -> tuple[str, str]:
        """What is simulated, and what its span is called."""
        return ("speed", "range") if self.of_speed else ("position", "stroke")

    def shown(self, axis: Axis) -> tuple[str, float]:
        """Unit in which it is shown, and what one is in SI: a small one, where the span is not many of it."""
        if self.of_speed:
            return axis.shown_speed
        unit, small = axis.shown
        return (unit, small) if self.span < MANY * small else (axis.length, 1.0)


@dataclass(frozen=True, kw_only=True)
class _Instant(Motion):
    """One instant between the ends of a record, with the way since the direction last changed (3,) [m].

    It is written over from step to step: made anew it would take longer than what is done with it.
    """

    way: Array

    @classmethod
    def of(cls, motion: Motion) -> _Instant:
        """Between the ends of a record."""
        ends = np.array([motion.position.min(), 0.0, motion.position.max()])
        time, speed, acceleration, force, way = (np.zeros(3) for _ in range(5))
        time[[0, 2]] = motion.time[[0, -1]]
        known = {key: values for key, values in motion.besides.items() if key != NOISY}  # it is of what was measured
        besides = {key: values[[0, 0, -1]] for key, values in known.items()}
        return cls(
            time, ends, speed, acceleration, force, np.zeros(3), besides=besides, references=motion.references, way=way
        )

    def put(self, motion: Motion, i: int, position: float, way: float, acceleration: float, force: float) -> None:
        """Write another instant over this one, all but its speed."""
        self.time[1] = motion.time[i]
        self.position[1] = position
        self.way.fill(way)
        self.acceleration.fill(acceleration)
        self.force.fill(force)
        for key, values in self.besides.items():
            values[1] = motion.besides[key][i]

    @property
    def travel(self) -> Array:
        return self.way


def of_fit(fitted: FittedTerms, case: Case) -> tuple[SetTerm, ...]:
    """Terms of a fit with their numbers; those that are known besides."""
    shapes = [(term, float("nan")) for term in fitted.baseline] + [(fit.candidate, fit.shape) for fit in fitted.fits]
    ends = np.cumsum([len(term.amplitudes) for term, _ in shapes])[:-1]
    parts = np.split(fitted.values, ends)
    known = [SetTerm(t, np.array([case.fixed[t.key]])) for t in case.library if t.key in case.fixed]
    found = (SetTerm(term, part, shape) for (term, shape), part in zip(shapes, parts, strict=True))
    return (*known, *case.known, *found)


def of_published(case: Case) -> tuple[SetTerm, ...]:
    """Terms whose parameters were published, all of them; none where a parameter of one is missing."""
    return () if missing_parameters(case.library, case.published) else set_terms(case.library, case.published)


def measured(recorded: Recorded, *, of_speed: bool) -> Array:
    """What a free run of a record is held against (n,): its position, or its speed."""
    return recorded.motion.speed if of_speed else recorded.motion.position


def free_run(model: str, recorded: Recorded, terms: Sequence[SetTerm], *, of_speed: bool = False) -> FreeRun | None:
    r"""The position of a record, or its speed, from its force, its first position and speed.

    None where no term holds a mass, so that there is nothing to solve, and where the force of one at an instant is not
    known. A limit of the drive, its dead zone, a delay, a gain and a fade act on the force.

    Notes
    -----
    :math:`M\ddot q = F - \sum_k f_k(q, \dot q, \ddot q)`, with the acceleration of the step before in the terms
    :math:`f_k`, solved step by step with the mean speed of each step. Where a step ends beyond standstill it ends at
    it, and the machine stays there as long as the force is between what either sense of motion would need.
    """
    mass = sum(float(each.amplitudes[0]) for each in terms if each.term.identifier == INERTIA)
    others = [each for each in terms if each.term.identifier != INERTIA and not each.term.of_model]
    at_once = (e.term.identifier in OF_COMMAND if e.term.of_model else e.term.at_an_instant for e in terms)
    if mass <= 0.0 or not all(at_once):
        return None
    motion, h = recorded.motion, recorded.motion.sample_time
    driving = _driving(motion, terms)
    now = _Instant.of(motion)
    position, speed, acceleration, way = float(motion.position[0]), float(motion.speed[0]), 0.0, float(motion.travel[0])

    def needed(speed: float) -> float:
        """Force that every term but inertia takes."""
        now.speed.fill(speed)
        return sum(float(each.term.columns(now, each.shape)[1] @ each.amplitudes) for each in others)

    found = np.full(len(motion.time), np.nan)
    for i, force in enumerate(driving.tolist()):
        if abs(speed) > RUNS_AWAY:
            break
        found[i] = speed if of_speed else position
        now.put(motion, i, position, way, acceleration, force)
        if speed == 0.0:
            forward, backward = force - needed(HARDLY), force - needed(-HARDLY)
            if forward <= 0.0 <= backward:
                acceleration = 0.0
                continue
            acceleration = (forward if forward > 0.0 else backward) / mass
        else:
            acceleration = (force - needed(speed)) / mass
        after = speed + h * acceleration
        if speed * after < 0.0:
            after, way = 0.0, 0.0
        step = 0.5 * h * (speed + after)
        position, speed, way = position + step, after, way + abs(step)
    truth = measured(recorded, of_speed=of_speed)
    off = found - truth
    error, largest = float(np.sqrt(np.mean(off**2))), float(np.abs(off).max())
    return FreeRun(model, recorded.name, of_speed, found, error, largest, float(np.ptp(truth)))


def _driving(motion: Motion, terms: Sequence[SetTerm]) -> Array:
    """Force that acts on the machine when its position is what was recorded [N], (n,)."""
    whole = replace(motion, modelled=np.ones_like(motion.time))

    def size_of(name: str) -> float:
        """Delay, gain or dead zone in all."""
        return sum(float(e.amplitudes[0]) for e in terms if e.term.of_model and e.term.identifier == name)

    def of(name: str) -> Array:
        """What a fault takes of the command, or of each unit of what the baseline gives (n,)."""
        named = (each for each in terms if each.term.identifier == name)
        parts = (each.term.columns(whole, each.shape)[:, 0] * each.amplitudes[0] for each in named)
        return np.asarray(sum(parts, np.zeros_like(motion.time)))

    late = np.interp(motion.time - size_of(DELAY), motion.time, motion.force - of(LIMIT))
    late = np.sign(late) * np.maximum(np.abs(late) - size_of(DEAD_ZONE), 0.0)
    return np.asarray(late / (1.0 + size_of(GAIN) + of(FADE)))
