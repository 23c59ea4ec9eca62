"""Which further test would tell two explanations apart, and with what power."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.diagnosis.design.plans import Plan, join_points, possible_plans, some_again, whole_again
from pmg.pipeline.diagnosis.engine.catalogue import ENTRY
from pmg.pipeline.diagnosis.engine.separation import ENOUGH, power_to_separate
from pmg.pipeline.diagnosis.grid.candidates import GridProblem, candidates, grid_problem
from pmg.pipeline.diagnosis.grid.free_form import bent_columns
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.sim.grid import Grid
from pmg.sim.mechanisms import Experiment

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from pmg.pipeline.diagnosis.grid.candidates import Candidate, CandidateFit
    from pmg.pipeline.diagnosis.grid.catalogue import GridExplanation
    from pmg.pipeline.diagnosis.grid.locate import Location
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class NextTest:
    """A test and what it would do.

    Parameters
    ----------
    plan : Plan
        The points.
    separates : tuple of str
        Ids that it tells apart.
    power : float
        Probability that the evidence then exceeds the margin of naming, if the leading explanation is true.
    """

    plan: Plan
    separates: tuple[str, ...]
    power: float


def _with_points(grid: Grid, more: OperatingPoints) -> Grid:
    """A grid with points that have not been run yet: their readings are placeholders."""
    n = len(more)
    zero, points = np.zeros(n), join_points(grid.points, more)
    if not grid.points.ordered:
        points = replace(points, started_at=np.full(len(points), np.nan))

    def longer(column: Array, more_of_it: Array) -> Array:
        return np.concatenate([column, more_of_it])

    return Grid(
        origin=grid.origin,
        campaign=grid.campaign,
        points=points,
        torque_sun=longer(grid.torque_sun, zero),
        torque_ring=longer(grid.torque_ring, more.torque_ring),
        within_sun=longer(grid.within_sun, zero),
        within_ring=longer(grid.within_ring, zero),
        u_sun=longer(grid.u_sun, np.full(n, np.median(grid.u_sun))),
        u_ring=longer(grid.u_ring, np.full(n, np.median(grid.u_ring))),
        common_sun=longer(grid.common_sun, zero),
        common_ring=longer(grid.common_ring, zero),
        accepted=np.concatenate([grid.accepted, np.ones(n, dtype=bool)]),
        reason=np.concatenate([grid.reason, np.full(n, "")]),
    )


def longer_problem(problem: GridProblem, plan: Plan, floor: NoiseFloor) -> GridProblem:
    """The problem as it would be with the plan's points in, nothing read yet."""
    readings = take_readings(_with_points(problem.readings.grid, plan.points), problem.bench)
    return grid_problem(readings, problem.bench, problem.model, whitener(readings, problem.bench, floor))


def distance(problem: GridProblem, one: GridExplanation, other: GridExplanation) -> float:
    """Distance of one explanation from the other's best fit, baseline free: a noncentrality in noise variances."""
    effect: Array = np.sum([problem.effect(fit.candidate, fit.values) for fit in one.fits], axis=0)
    effect = effect - np.sum([problem.effect(fit.candidate, fit.values) for fit in other.fits], axis=0)
    left = _free_beside(problem, other.fits).beyond_baseline(effect)
    return float(left @ left)


def _free_beside(problem: GridProblem, fits: tuple[CandidateFit, ...]) -> GridProblem:
    """The problem with nothing read, whose baseline may follow the parameters of some fits."""
    free = replace(problem, left=np.zeros(len(problem.readings)))
    for fit in fits:
        moved = replace(fit, effect=problem.effect(fit.candidate, fit.values), seen=np.zeros(len(problem.readings)))
        free = free.take_out(moved)
    return free


HIDDEN = 2.0
"""Size of the hidden change for which the power of a lifting test is stated, in noise floors."""


def lifting_test(
    readings: Readings, bench: BenchParameters, model: LossModel, floor: NoiseFloor, blind: tuple[str, ...]
) -> NextTest | None:
    """The repeats that a blind design lacks, and their power to show what it may hide.

    Power is that of entering the diagnosis, for each mechanism that depends on what was run before, at `HIDDEN` noise
    floors root mean square before anything is absorbed; the least of them is stated. Ten points or, where they are too
    weak and it is stronger, the whole campaign again in random order.
    """
    kinds = [c for c in candidates() if c.shaft in blind and c.kind.memory]
    at = readings.grid.points
    plans = [p for p in possible_plans(at, bench) if p.experiment is Experiment.REPEATS]
    if not plans or not kinds:
        return None
    ids = tuple(sorted({c.identifier for c in kinds}))
    found: list[NextTest] = []
    for plan in (plans[0], whole_again(at)):
        whole = take_readings(_with_points(readings.grid, plan.points), bench)
        problem = grid_problem(whole, bench, model, whitener(whole, bench, floor))
        power = _least_power(problem, kinds, floor)
        if power is None:
            return None
        found.append(NextTest(plan, ids, power))
        if power >= ENOUGH:
            break
    return max(found, key=lambda test: test.power)


def _least_power(problem: GridProblem, kinds: list[Candidate], floor: NoiseFloor) -> float | None:
    """Least probability with which a change of `HIDDEN` noise floors enters; None where none of them shows at all."""
    powers = []
    for candidate in kinds:
        effect = problem.effect(candidate, np.array([p.typical for p in candidate.parameters]))
        touched = effect[effect != 0.0]
        if not touched.size:
            continue
        noise = dict(floor.items()).get(candidate.shaft, floor.ring).u
        seen = problem.beyond_baseline(effect * HIDDEN * noise / math.sqrt(float(np.mean(touched**2))))
        needed = ENTRY + len(candidate.parameters) * math.log(len(problem.readings))
        powers.append(float(stats.ncx2.sf(needed, len(candidate.parameters), float(seen @ seen))))
    return min(powers, default=None)


def repeated_test(problem: GridProblem, places: tuple[Location, ...], floor: NoiseFloor) -> NextTest | None:
    """The test that shows whether a difference that nothing explains comes again at its points.

    Parameters
    ----------
    problem : GridProblem
        The readings of the campaign.
    places : tuple of Location
        Where simulation and recordings differ; None is given where there are none.
    floor : NoiseFloor
        Noise of one point.
    """
    if not places:
        return None
    readings, grid = problem.readings, problem.readings.grid
    effect = np.sum([place.effect for place in places], axis=0)
    of_point = np.zeros(len(grid))
    np.maximum.at(of_point, readings.row, np.abs(effect))
    if not of_point.any():
        return None
    usable = np.flatnonzero(grid.accepted)
    plan = some_again(grid.points[usable], of_point[usable], _residual_of_points(problem, places)[usable])
    whole = longer_problem(problem, plan, floor)
    place = {str(name): i for i, name in enumerate(grid.points.name)}
    rows = np.array([place[str(name)] for name in whole.readings.grid.points.name])
    known = {(row, sun): size for row, sun, size in zip(readings.row, readings.sun, effect, strict=True)}
    pairs = zip(rows[whole.readings.row], whole.readings.sun, whole.readings.row >= len(grid), strict=True)
    again = np.array([known.get((row, sun), 0.0) if new else 0.0 for row, sun, new in pairs])
    left = whole.beyond_baseline(again)
    return NextTest(plan, (), power_to_separate(float(left @ left)))


def _residual_of_points(problem: GridProblem, places: tuple[Location, ...]) -> Array:
    """Magnitude of the residual of each point in the signals and configurations of some places, infinite elsewhere."""
    readings = problem.readings
    comparable = np.zeros(len(readings), dtype=bool)
    for place in places:
        of = readings.sun if place.signal == "torque_sun" else ~readings.sun
        comparable |= of & ((readings.configuration == place.configuration) | (place.configuration == "all"))
    comparable &= readings.configuration != "zero"
    largest = np.full(len(readings.grid), -np.inf)
    np.maximum.at(largest, readings.row[comparable], np.abs(readings.torque - problem.predicted)[comparable])
    return np.asarray(np.abs(largest))


def next_test(
    problem: GridProblem, best: GridExplanation, rival: GridExplanation, floor: NoiseFloor
) -> NextTest | None:
    """The shortest plan with enough power, else the one with most; None where no plan adds anything."""
    ids = sorted({fit.candidate.identifier for e in (best, rival) for fit in e.fits})

    def apart(whole: GridProblem) -> float:
        return min(distance(whole, best, rival), distance(whole, rival, best))

    return _best_test(problem, floor, tuple(ids), apart)


def form_test(
    problem: GridProblem, best: GridExplanation, further: tuple[CandidateFit, ...], floor: NoiseFloor
) -> NextTest | None:
    """The test that would tell a further cause from an error of form: where the bent law could not take up its effect.

    `further` are the candidates that stand against a change of the law of `best`.
    """

    def apart(whole: GridProblem) -> float:
        free = _free_beside(whole, best.fits)
        free = free.take_up(free.white(np.hstack([bent_columns(free, fit) for fit in best.fits])))
        effect = np.sum([whole.effect(fit.candidate, fit.values) for fit in further], axis=0)
        left = free.beyond_baseline(effect)
        return float(left @ left)

    return _best_test(problem, floor, tuple(sorted({fit.identifier for fit in (*best.fits, *further)})), apart)


def _best_test(
    problem: GridProblem,
    floor: NoiseFloor,
    ids: tuple[str, ...],
    apart: Callable[[GridProblem], float],
    kinds: Collection[Experiment] = tuple(Experiment),
) -> NextTest | None:
    """The shortest plan of these kinds with enough power, else the one with most; `apart` is its noncentrality."""
    found = [
        NextTest(plan, ids, power_to_separate(apart(longer_problem(problem, plan, floor))))
        for plan in possible_plans(problem.readings.grid.points, problem.bench)
        if plan.experiment in kinds
    ]
    if not found:
        return None
    strong = [test for test in found if test.power >= ENOUGH]
    if strong:
        return min(strong, key=lambda test: test.plan.seconds)
    return max(found, key=lambda test: test.power)


def confirming_test(problem: GridProblem, fits: tuple[CandidateFit, ...], floor: NoiseFloor) -> NextTest | None:
    """The test that would show a named cause once more, of the kinds that its mechanisms say reveal them."""
    kinds = {reveals.experiment for fit in fits for reveals in fit.candidate.kind.revealed_by}

    def apart(whole: GridProblem) -> float:
        effect = np.sum([whole.effect(fit.candidate, fit.values) for fit in fits], axis=0)
        left = _free_beside(whole, ()).beyond_baseline(effect)
        return float(left @ left)

    ids = tuple(sorted({fit.candidate.identifier for fit in fits}))
    return _best_test(problem, floor, ids, apart, kinds) or _best_test(problem, floor, ids, apart)
