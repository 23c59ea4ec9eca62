"""Manoeuvres of a made record: the speed that is asked for, and the load, step by step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pmg.pipeline.trials.machines.plant import STEPS_A_SECOND
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.trials.machines.kinds import MadeMachine
    from pmg.sim.signals import Array

MANOEUVRES = ("strokes", "waves", "staircase")
"""Of a machine that is driven: the first two are fitted, the last is withheld."""

COASTS_FROM = (1.0, 0.8, 0.9)
"""Speeds from which a wheel coasts, over the largest; the last is withheld."""


BEFORE = 1.0
"""Time that a machine moves before its record begins [s]."""


@dataclass(frozen=True)
class MadeCourse:
    """What one record asks for.

    Parameters
    ----------
    speed, load : (n,) array
        Speed asked for and load at the shaft, at every step [SI].
    begins : float
        Speed at the beginning.
    """

    speed: Array
    load: Array
    begins: float = 0.0


def draw_courses(machine: MadeMachine, rng: np.random.Generator) -> tuple[MadeCourse, ...]:
    """Two courses to fit and one to withhold."""
    if machine.kind == "wheel":
        n = round((machine.seconds + BEFORE) * STEPS_A_SECOND)
        froms = [machine.fastest * part * rng.uniform(0.95, 1.05) for part in COASTS_FROM]
        return tuple(MadeCourse(np.zeros(n), np.zeros(n), begins) for begins in froms)
    return tuple(_course(machine, name, rng) for name in MANOEUVRES)


def _course(machine: MadeMachine, name: str, rng: np.random.Generator) -> MadeCourse:
    n = round((machine.seconds + BEFORE) * STEPS_A_SECOND)
    makes = {"strokes": _strokes, "waves": _waves, "staircase": _staircase}
    speed = makes[name](machine, n, rng)
    load = np.zeros(n)
    if machine.ratio:
        most = rng.uniform(2.0, 3.0)
        held = _held(n, 1.8, lambda: most * rng.uniform(-1.0, 1.0), rng)
        load = _smooth(held, 0.25) + coloured(n, 0.02 * most, 0.1, rng)
    return MadeCourse(speed, load, float(speed[0]))


def coloured(n: int, size: float, seconds: float, rng: np.random.Generator) -> Array:
    """Noise with a correlation time, a value a step."""
    keep = np.exp(-1.0 / (seconds * STEPS_A_SECOND))
    white = rng.standard_normal(n)
    start = [keep * white[0]]
    found, _ = lfilter([1.0], [1.0, -keep], np.sqrt(1.0 - keep * keep) * white, zi=start)
    return np.asarray(size * found)


def _smooth(values: Array, seconds: float) -> Array:
    width = max(round(seconds * STEPS_A_SECOND), 1)
    sums = np.cumsum(np.r_[np.zeros(width), values])
    return np.asarray((sums[width:] - sums[:-width]) / width)


def _held(n: int, seconds: float, draw: object, rng: np.random.Generator) -> Array:
    """Values that are drawn, each held for about so long."""
    assert callable(draw)
    parts: list[Array] = []
    length = 0
    while length < n:
        part = round(seconds * rng.uniform(0.5, 1.5) * STEPS_A_SECOND)
        parts.append(np.full(part, float(draw())))
        length += part
    return np.concatenate(parts)[:n]


def _staircase(machine: MadeMachine, n: int, rng: np.random.Generator) -> Array:
    """Speeds of either direction, each held for a while."""
    if machine.reach:
        return _strokes(machine, n, rng, slow=0.15)
    levels = machine.fastest * np.array([-1.0, -0.75, -0.5, -0.25, -0.1, 0.1, 0.25, 0.5, 0.75, 1.0])
    order = [*rng.permutation(levels), *rng.permutation(levels), *rng.permutation(levels)]
    drawn = iter(order * 3)
    return _smooth(_smooth(_held(n, 2.0, lambda: next(drawn), rng), 0.8), 0.3)


def _strokes(machine: MadeMachine, n: int, rng: np.random.Generator, slow: float = 0.3) -> Array:
    """From place to place at speeds that are drawn, without a rest; of what turns on and on, to and fro."""
    reach = machine.reach or 1.5 * machine.fastest
    speed, place, filled = np.zeros(n), 0.0, 0
    sense = 1.0
    while filled < n:
        fast = machine.fastest * rng.uniform(slow, 1.0)
        goal = sense * reach * rng.uniform(0.2, 1.0)
        sense = -sense
        moving = max(round(abs(goal - place) / fast * STEPS_A_SECOND), 1)
        speed[filled : filled + moving] = np.copysign(fast, goal - place)
        filled += moving
        place = goal
    seconds = rng.uniform(0.25, 0.4) if machine.reach else rng.uniform(0.7, 1.0)
    return _smooth(_smooth(speed, seconds), 0.4 * seconds)


def _waves(machine: MadeMachine, n: int, rng: np.random.Generator) -> Array:
    """Two waves without a common period."""
    t = np.arange(n) / STEPS_A_SECOND
    speed = np.zeros(n)
    for part, hertz in ((0.9, 0.4), (0.06, 0.93)):
        frequency = hertz * rng.uniform(0.85, 1.15)
        speed += part * machine.fastest * np.sin(REVOLUTION * frequency * t + rng.uniform(0.0, REVOLUTION))
    return np.asarray(speed)
