"""Tests a bench could still run: a few points each, in order, with the time they take."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.grid import OperatingPoints
from pmg.sim.mechanisms import Experiment
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

A_POINT = 45.0
"""Bench time of one point: approach, settling and a window of 5 s [s]."""

SEED = 20260105
"""Seed of the random order of repeated points."""

ZERO_CHECKS_OVER = 1800.0
"""Time over which zero checks are spread [s]."""

PAUSE = 7200.0
"""Pause after which the bench is cold again [s]."""

AGAIN = 6
"""Rounds of the longer test in stage 2, which is to tell small errors."""

EXTREMES = 6
"""At most so many points that differ, and as many that agree, in a test whether a difference comes again."""

LOW_SPEEDS = (20.0, 40.0, 80.0, 120.0, 200.0)
"""Low sun speeds of a Stribeck test [rpm]; the ring's are those divided by the ratio of the gear."""


@dataclass(frozen=True)
class Plan:
    """A test.

    Parameters
    ----------
    experiment : Experiment
        Its kind.
    description : str
        What to run, for people.
    points : OperatingPoints
        The points in their order; the ring torque of engaged points is the load to ask for.
    seconds : float
        Bench time, pauses included [s].
    """

    experiment: Experiment
    description: str
    points: OperatingPoints
    seconds: float


def make_points(
    name: str,
    configuration: str,
    sun: Array,
    ring: Array,
    load: Array,
    *,
    drive: str = "sun",
    gear: int = 1,
    begin: float,
) -> OperatingPoints:
    """Points of one stage in a row from a time on: speeds [rad/s], ring torque to ask for [N m], start [s]."""
    n = len(sun)
    return OperatingPoints(
        name=np.array([f"{name}_{i + 1:02d}" for i in range(n)]),
        configuration=np.full(n, configuration),
        gear=np.full(n, gear, dtype=np.int64),
        drive=np.full(n, drive),
        speed_sun=np.asarray(sun, dtype=np.float64),
        speed_ring=np.asarray(ring, dtype=np.float64),
        torque_ring=np.asarray(load, dtype=np.float64),
        load_set=np.asarray(load, dtype=np.float64),
        started_at=np.asarray(begin + A_POINT * (1.0 + np.arange(n)), dtype=np.float64),
        rest_sun=np.asarray(sun) == 0.0,
        rest_ring=np.asarray(ring) == 0.0,
    )


def join_points(*parts: OperatingPoints) -> OperatingPoints:
    """Points one after the other."""
    columns = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in OperatingPoints.__annotations__
    }
    return OperatingPoints(**columns)


def possible_plans(at: OperatingPoints, bench: BenchParameters) -> tuple[Plan, ...]:
    """Plans that fit a campaign: at its own speeds and loads, after its last point."""
    begin = float(at.started_at.max()) if at.ordered and len(at) else 0.0
    sun = _spread(np.abs(at.speed_sun[at.speed_sun != 0.0]), 6)
    zero = np.zeros(5)
    checks = replace(
        make_points("Z", "zero", zero, zero, zero, begin=begin),
        started_at=begin + ZERO_CHECKS_OVER * np.arange(1.0, 6.0) / 5.0,
    )
    words = "Five zero checks, shafts free and at rest, over half an hour"
    return (
        *_engaged_plans(at, bench, sun, begin),
        *_neutral_plans(at, bench, sun, begin),
        Plan(Experiment.ZERO_CHECKS, words, checks, ZERO_CHECKS_OVER),
    )


def whole_again(at: OperatingPoints) -> Plan:
    """Every point of a campaign once more, in random order."""
    order = np.random.default_rng(SEED).permutation(len(at))
    return Plan(
        Experiment.REPEATS, f"The whole campaign again in random order: {len(at)} points", *_once_more(at, order)
    )


def some_again(at: OperatingPoints, effect: Array, residual: Array) -> Plan:
    """The points that differ most once more, and as many that agree, in random order.

    Parameters
    ----------
    at : OperatingPoints
        The n points of a campaign.
    effect : (n,) array
        Magnitude of the difference at each [N m]; those that differ are taken where it is not 0.
    residual : (n,) array
        Magnitude of what is left [N m] at the points comparable with them; infinite at others, which are not taken as
        points that agree. Of each of as many parts of the test the one with the smallest is taken.
    """
    count = min(EXTREMES, int(np.count_nonzero(effect)))
    differ = np.argsort(-np.abs(effect), kind="stable")[:count]
    others = np.setdiff1d(np.flatnonzero(np.isfinite(residual)), differ)
    if at.ordered:
        others = others[np.argsort(at.started_at[others], kind="stable")]
    parts = np.array_split(others, max(count, 1))
    agree = np.array([part[np.argmin(residual[part])] for part in parts if len(part)], dtype=np.intp)
    chosen = np.random.default_rng(SEED).permutation(np.r_[differ, agree])
    controls = f" and {len(agree)} that agree{'s' * (len(agree) == 1)}" if len(agree) else ""
    most = f"{count} points that differ" if count > 1 else "point that differs"
    words = f"The {most} most{controls}, once more in random order"
    return Plan(Experiment.REPEATS, words, *_once_more(at, chosen))


def _once_more(at: OperatingPoints, order: npt.NDArray[np.intp]) -> tuple[OperatingPoints, float]:
    """Points of a campaign in another order, after its last one, and the time they take [s]."""
    n, begin = len(order), float(at.started_at.max()) if at.ordered and len(at) else 0.0
    started = begin + A_POINT * (1.0 + np.arange(n))
    again = at[order]
    return replace(again, torque_ring=again.load_set, started_at=np.asarray(started)), n * A_POINT


ENGAGED = {
    Experiment.REVERSED_FLOW: ("F", "ring", 0),
    Experiment.ENGAGED_LOADS: ("L", "sun", 0),
    Experiment.OTHER_STAGE: ("G", "sun", 1),
}
"""Of each engaged test the first letter of its points, the motor that drives, and the place of its stage."""


def _engaged_plans(at: OperatingPoints, bench: BenchParameters, sun: Array, begin: float) -> Iterator[Plan]:
    """Every speed of the sun engaged: ring motor driving, at low loads, and in stage 2 if the campaign is without it.

    In stage 2 torques stand in another ratio, so what follows one of them parts from what follows the other; its speeds
    lie within the loss curves of both shafts. Hysteresis and eddy damping are taken as those of stage 1; they do not
    grow with load.
    """
    loads = np.abs(at.load_set[at.engaged])
    if not len(loads):
        return
    lowest, highest = loads.min(), loads.max()
    words = "Engaged with the ring motor driving: {points} points at {speeds} speeds and the lowest and highest load"
    yield _engaged(Experiment.REVERSED_FLOW, words, sun, -np.array([lowest, highest]), bench, begin)
    words = "Engaged at a third of the lowest load and at the highest: {points} points at {speeds} speeds"
    yield _engaged(Experiment.ENGAGED_LOADS, words, sun, np.array([lowest / 3.0, highest]), bench, begin)
    if len(bench.stages) == 1:
        return
    speeds = sun[sun <= float(np.abs(at.speed_ring).max()) * bench.gear2.ratio * (1.0 + 1e-9)]
    if len(speeds) and not (at.gear[at.engaged] == 2).any():
        words = "Engaged in gear stage 2: {points} points at {speeds} speeds and the lowest and highest load"
        for times, more in ((1, ""), (AGAIN, f", each {AGAIN} times")):
            repeated = np.tile([lowest, highest], times)
            yield _engaged(Experiment.OTHER_STAGE, words + more, speeds, repeated, bench, begin)


def _engaged(
    experiment: Experiment, words: str, sun: Array, loads: Array, bench: BenchParameters, begin: float
) -> Plan:
    """Every sun speed [rad/s] engaged at every load [N m on the ring], one load after the other."""
    name, drive, place = ENGAGED[experiment]
    gear = bench.stages[place]
    speed, load = np.tile(sun, len(loads)), np.repeat(loads, len(sun))
    points = make_points(
        name, "engaged", speed, -speed / bench.gear(gear).ratio, load, drive=drive, gear=gear, begin=begin
    )
    return Plan(experiment, words.format(points=len(speed), speeds=len(sun)), points, len(speed) * A_POINT)


def _neutral_plans(at: OperatingPoints, bench: BenchParameters, sun: Array, begin: float) -> Iterator[Plan]:
    """Both shafts backwards, neutral points repeated cold, and each shaft alone at low speed."""
    turning = at.speed_ring[at.neutral & (at.speed_ring != 0.0)]
    ring, loads = _spread(np.abs(turning), 6), np.abs(at.load_set[at.engaged])
    if not len(ring):
        return
    stage = bench.stages[0]
    pair, sense, ratio = min(len(sun), len(ring)), float(np.sign(np.median(turning))), bench.gear(stage).ratio
    sun_n, ring_n = sun[:pair], ring[::-1][:pair]
    back = make_points("B", "neutral", -sun_n, -sense * ring_n, np.zeros(pair), begin=begin)
    if len(loads):
        load, after = np.full(len(sun), loads.max()), begin + A_POINT * pair
        back = join_points(back, make_points("BE", "engaged", -sun, sun / ratio, -load, gear=stage, begin=after))
    words = f"Both shafts turning backwards: {len(back)} points"
    yield Plan(Experiment.REVERSED_ROTATION, words, back, len(back) * A_POINT)
    rows = np.random.default_rng(SEED).permutation(np.linspace(0, pair * pair - 1, 10).astype(int))
    again = "neutral", sun_n[rows % pair], sense * ring_n[rows // pair], np.zeros(10)
    words = (
        "Twenty neutral points: ten spread over the grid, in random order and run in, and the same ten after two hours "
        "of rest"
    )
    warm, cold = (make_points(n, *again, begin=t) for n, t in (("R", begin), ("C", begin + PAUSE + 10 * A_POINT)))
    yield Plan(Experiment.REPEATS, words, join_points(warm, cold), 20 * A_POINT + PAUSE)
    low, none = np.array(LOW_SPEEDS) * RPM, np.zeros(5)
    alone = join_points(
        make_points("S", "neutral", low, none, none, begin=begin),
        make_points("T", "neutral", none, low / ratio, none, begin=begin + 300.0),
    )
    words = "Neutral at low speed, each shaft turning alone: ten points"
    yield Plan(Experiment.NEUTRAL_SWEEP, words, alone, 10 * A_POINT)


def _spread(values: Array, count: int) -> Array:
    """That many values spread evenly over those that occur."""
    levels = np.unique(np.round(values, 3))
    if not len(levels):
        return np.zeros(0)
    return np.asarray(levels[np.unique(np.linspace(0, len(levels) - 1, count).astype(int))])
