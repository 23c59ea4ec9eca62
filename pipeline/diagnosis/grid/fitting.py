"""A candidate fitted beside the baseline: what it gains, and at which values."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import Bounds, least_squares, minimize, minimize_scalar

from pmg.pipeline.diagnosis.engine.catalogue import ENTRY
from pmg.pipeline.diagnosis.engine.problem import bounded_sizes
from pmg.pipeline.diagnosis.grid.candidates import candidates
from pmg.pipeline.fit.settle import settle

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.grid.candidates import Candidate, CandidateFit, GridProblem
    from pmg.sim.signals import Array

SHAPE_STARTS = 4
"""Values of the first shape parameter, evenly spaced on a logarithm inside its bounds, from which a fit starts."""

FIRST_STEP = 0.3
"""First step of such a search, on a logarithm."""

FIRST_STEPS, FOLLOWED = 8, 2
"""Steps of a nonlinear search from each start, and how many of them are then followed to the end."""

SHAPE_PRECISION, COST_PRECISION, MOST_TRIALS = 1e-2, 0.05, 120
"""Tolerances of a search over several shapes: a hundredth of each and a twentieth of a noise variance."""


def fit_candidate(problem: GridProblem, candidate: Candidate) -> CandidateFit:
    """Best values of one candidate with the baseline free to move.

    Notes
    -----
    The baseline enters linearised, as a projection, so that only the candidate's own parameters are searched, inside
    their physical bounds: sizes in closed form where the effect is proportional to them, shapes from several values.
    """
    parameters = candidate.parameters
    low, high = (np.array([p.bounds[side] for p in parameters]) for side in (0, 1))
    fit = _by_proportion if candidate.kind.linear else _by_search
    cost, values = fit(problem, candidate)
    whole = float(problem.left @ problem.left)
    if candidate.kind.shape and whole - cost > ENTRY:
        settled = settle(partial(_residuals, problem, candidate), values, _typical(candidate), np.array([low, high]))
        cost, values = settled.cost, settled.values
    margin = 1e-6 * (high - low)
    at_bound = (values - low < margin) | (high - values < margin)
    shape = np.arange(len(values)) >= len(candidate.sizes)
    near = np.maximum(SHAPE_PRECISION * values, margin)  # a search stops so far from a bound
    at_bound |= shape & ((values - low < near) | (high - values < near))
    on_bound = tuple(p.name for p, at in zip(parameters, at_bound, strict=True) if at)
    found = problem.fitted(candidate, values, whole - cost, on_bound)
    return replace(found, strays=_strays(problem, found))


def _strays(problem: GridProblem, fit: CandidateFit) -> bool:
    """Whether a power of a law, at the end of its range, would bring evidence by going on, to first order."""
    if not set(fit.candidate.powers) & set(fit.on_bound):
        return False
    left, free = problem.left - fit.seen, problem.take_out(fit).left
    return float(left @ left - free @ free) > ENTRY


def _typical(candidate: Candidate) -> Array:
    """Usual sizes of a candidate's parameters (k,)."""
    return np.array([p.typical for p in candidate.parameters])


def _residuals(problem: GridProblem, candidate: Candidate, values: Array) -> Array:
    """What a candidate with these values leaves (m,), whitened and freed from the baseline."""
    return problem.left - problem.beyond_baseline(problem.effect(candidate, values))


def _shapes(candidate: Candidate) -> Iterator[Array]:
    """Values of the shape parameters from which a fit starts."""
    parameters = candidate.parameters[len(candidate.sizes) :]
    axes = [[p.typical] for p in parameters]
    if parameters:
        axes[0] = np.geomspace(*parameters[0].bounds, SHAPE_STARTS + 2)[1:-1].tolist()
    return (np.array(shape) for shape in product(*axes))


def _sizes(problem: GridProblem, candidate: Candidate, shape: Array) -> tuple[float, Array]:
    """Sum of squares and sizes inside their bounds, for an effect proportional to them."""
    columns = _signature(problem, candidate, shape)
    seen = np.stack([problem.beyond_baseline(column) for column in columns.T], axis=1)
    return bounded_sizes(
        seen, problem.left, np.array([p.bounds for p in candidate.parameters[: len(candidate.sizes)]]).T
    )


def _by_proportion(problem: GridProblem, candidate: Candidate) -> tuple[float, Array]:
    """Sum of squares and values; the only search is over the shapes, on logarithms."""
    starts = [(*_sizes(problem, candidate, shape), shape) for shape in _shapes(candidate)]
    cost, sizes, shape = min(starts, key=lambda start: start[0])
    if not len(shape):
        return cost, sizes
    bounds = np.log([parameter.bounds for parameter in candidate.parameters[len(candidate.sizes) :]])
    around = (bounds[0, 1] - bounds[0, 0]) / (SHAPE_STARTS + 1)
    first = (math.log(shape[0]) - around, math.log(shape[0]) + around)

    def costs(logarithms: Array) -> float:
        return _sizes(problem, candidate, np.exp(logarithms))[0]

    if len(shape) == 1:
        line = minimize_scalar(lambda x: costs(np.array([x])), bounds=first, method="bounded", options={"xatol": 1e-3})
        best, lowest = np.array([line.x]), float(line.fun)
    else:
        start = np.log(shape)
        inside = Bounds(*np.array([first, *bounds[1:]]).T)
        inwards = np.where(start + FIRST_STEP < inside.ub, FIRST_STEP, -FIRST_STEP)
        found = minimize(
            costs,
            start,
            method="Nelder-Mead",
            bounds=inside,
            options={
                "initial_simplex": start + np.vstack([np.zeros(len(start)), np.diag(inwards)]),
                "xatol": SHAPE_PRECISION,
                "fatol": COST_PRECISION,
                "maxfev": MOST_TRIALS,
            },
        )
        best, lowest = found.x, float(found.fun)
    if lowest < cost:
        shape = np.clip(np.exp(best), *np.exp(bounds.T))
        cost, sizes = _sizes(problem, candidate, shape)
    return cost, np.r_[sizes, shape]


def _by_search(problem: GridProblem, candidate: Candidate) -> tuple[float, Array]:
    """Sum of squares and values by nonlinear least squares."""
    parameters = candidate.parameters
    typical = _typical(candidate)
    low, high = (np.array([p.bounds[side] for p in parameters]) for side in (0, 1))
    bounds = low / typical, high / typical

    def residuals(scaled: Array) -> Array:
        return _residuals(problem, candidate, scaled * typical)

    def search(start: Array, most: int | None) -> tuple[float, Array]:
        found = least_squares(residuals, start, bounds=bounds, x_scale="jac", xtol=1e-5, ftol=1e-7, max_nfev=most)
        return 2.0 * float(found.cost), found.x

    ends = []
    for shape in _shapes(candidate):
        start = np.r_[_sizes(problem, candidate, shape)[1], shape]
        ends.append(search(np.clip(start, low + 1e-9 * typical, high - 1e-9 * typical) / typical, FIRST_STEPS))
    best = sorted(ends, key=lambda end: end[0])[:FOLLOWED]
    cost, scaled = min((search(end, None) for _, end in best), key=lambda end: end[0])
    return cost, scaled * typical


SMALL = 0.05
"""Part of a parameter's typical value at which its signature is taken."""


def _signature(problem: GridProblem, candidate: Candidate, shape: Array) -> Array:
    """Effect on each reading per unit of each size (m, sizes), at small size and a given shape [N m per unit]."""
    columns = []
    for i, parameter in enumerate(candidate.parameters[: len(candidate.sizes)]):
        sizes = np.zeros(len(candidate.sizes))
        sizes[i] = SMALL * parameter.typical
        columns.append(problem.effect(candidate, np.r_[sizes, shape]) / sizes[i])
    return np.stack(columns, axis=1)


def traces(problem: GridProblem) -> list[Array]:
    """Whitened columns (m, sizes) of every mechanism on every shaft and in every shape from which a fit starts.

    A smooth family spreads a test over several columns; a mechanism's own trace takes one, so that small effects of
    the catalogue are seen earlier.
    """
    return [
        problem.white(_signature(problem, candidate, shape))
        for candidate in candidates()
        if candidate.shaft != "both" or not candidate.kind.both_at_once
        for shape in _shapes(candidate)
    ]
