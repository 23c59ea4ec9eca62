"""A candidate fitted beside the baseline: what it gains, and at which values."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import replace
from functools import cache, partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import Bounds, least_squares, minimize, minimize_scalar

from pmg.pipeline.diagnosis.engine.catalogue import ENTRY
from pmg.pipeline.diagnosis.engine.problem import bounded_sizes
from pmg.pipeline.diagnosis.grid.candidates import candidates
from pmg.pipeline.fit.settle import settle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pmg.pipeline.diagnosis.grid.candidates import Candidate, CandidateFit, GridProblem, Known
    from pmg.sim.signals import Array, Mask

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
    Where the readings are a part of a campaign, shapes start from their values on all of it (`KnownFits`).
    """
    if problem.whole is not None:
        return _told(problem, candidate, *_from_known(problem, candidate, problem.whole))
    cost, values = (_by_proportion if candidate.kind.linear else _by_search)(problem, candidate)
    fit = _told(problem, candidate, cost, values)
    return settled_fit(problem, fit) if candidate.kind.shape and fit.gain > ENTRY else fit


def _told(problem: GridProblem, candidate: Candidate, cost: float, values: Array) -> CandidateFit:
    """The fit with these values, which leave that sum of squares."""
    low, high = np.array([p.bounds for p in candidate.parameters]).T
    whole = float(problem.left @ problem.left)
    margin = 1e-6 * (high - low)
    at_bound = (values - low < margin) | (high - values < margin)
    shape = np.arange(len(values)) >= len(candidate.sizes)
    near = np.maximum(SHAPE_PRECISION * values, margin)  # a search stops so far from a bound
    at_bound |= shape & ((values - low < near) | (high - values < near))
    on_bound = tuple(p.name for p, at in zip(candidate.parameters, at_bound, strict=True) if at)
    found = problem.fitted(candidate, values, whole - cost, on_bound)
    return replace(found, strays=_strays(problem, found))


def _strays(problem: GridProblem, fit: CandidateFit) -> bool:
    """Whether a power of a law, at the end of its range, would bring evidence by going on, to first order."""
    if not set(fit.candidate.powers) & set(fit.on_bound):
        return False
    loose = [p.name in fit.candidate.powers or p.name not in fit.on_bound for p in fit.candidate.parameters]
    rest = replace(problem, left=problem.left - fit.seen)
    free = rest.take_up(problem.slopes(fit)[:, loose])
    return float(rest.left @ rest.left - free.left @ free.left) > ENTRY


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


def _from_known(problem: GridProblem, candidate: Candidate, whole: Known) -> tuple[float, Array]:
    """Sum of squares and values by one step from those of all readings, inside the bounds."""
    known, bounds = whole.fit(candidate).values, np.array([p.bounds for p in candidate.parameters]).T
    effect, slopes = whole.about(candidate)
    seen = problem.project(problem.white(slopes))
    moved = bounded_sizes(seen, problem.left - problem.beyond_baseline(effect) + seen @ known, bounds)[1]
    tried = [(float(left @ left), v) for v in (moved, known) for left in [_residuals(problem, candidate, v)]]
    return min(tried, key=lambda each: each[0])


def settled_fit(problem: GridProblem, fit: CandidateFit) -> CandidateFit:
    """A fit followed to its minimum."""
    candidate = fit.candidate
    bounds = np.array([p.bounds for p in candidate.parameters]).T
    found = settle(partial(_residuals, problem, candidate), fit.values, _typical(candidate), bounds)
    return _told(problem, candidate, found.cost, found.values)


def _by_search(problem: GridProblem, candidate: Candidate) -> tuple[float, Array]:
    """Sum of squares and values by nonlinear least squares from several shapes."""
    starts = [np.r_[_sizes(problem, candidate, shape)[1], shape] for shape in _shapes(candidate)]
    ends = [_search(problem, candidate, start, FIRST_STEPS) for start in starts]
    best = sorted(ends, key=lambda end: end[0])[:FOLLOWED]
    return min((_search(problem, candidate, end, None) for _, end in best), key=lambda end: end[0])


def _search(problem: GridProblem, candidate: Candidate, start: Array, most: int | None) -> tuple[float, Array]:
    """Sum of squares and values by nonlinear least squares from a start (k,), in so many steps at most."""
    typical = _typical(candidate)
    low, high = np.array([p.bounds for p in candidate.parameters]).T

    def residuals(scaled: Array) -> Array:
        return _residuals(problem, candidate, scaled * typical)

    inside = np.clip(start, low + 1e-9 * typical, high - 1e-9 * typical) / typical
    bounds = low / typical, high / typical
    found = least_squares(residuals, inside, bounds=bounds, x_scale="jac", xtol=1e-5, ftol=1e-7, max_nfev=most)
    return 2.0 * float(found.cost), found.x * typical


class KnownFits:
    """Fits to all readings of a campaign, each made once: where fits to a part of them start.

    Parameters
    ----------
    problem : callable
        Gives the problem of all readings; it is asked for with the first fit.
    """

    def __init__(self, problem: Callable[[], GridProblem]) -> None:
        self._problem = cache(problem)
        self._beside: dict[Candidate, KnownFits] = {}
        self.rows: Mask | slice = slice(None)
        self._fit = cache(self._fitted)
        self._about = cache(self._effect_and_slopes)

    def fit(self, candidate: Candidate) -> CandidateFit:
        """The fit of a candidate to all readings."""
        return self._fit(candidate)

    def about(self, candidate: Candidate) -> tuple[Array, Array]:
        """Effect (m,) and slopes (m, k) of the fit of a candidate at the m readings of the part."""
        effect, slopes = self._about(candidate)
        return effect[self.rows], slopes[self.rows]

    def part(self, rows: Mask | slice) -> KnownFits:
        """The same for a part of the readings."""
        same = copy(self)
        same.rows = rows
        return same

    def beside(self, candidate: Candidate) -> KnownFits:
        """Fits next to a candidate, which is taken out."""
        if candidate not in self._beside:
            self._beside[candidate] = KnownFits(
                lambda: replace(self._problem().take_out(self.fit(candidate)), whole=self.part(slice(None)))
            )
        return self._beside[candidate].part(self.rows)

    def _fitted(self, candidate: Candidate) -> CandidateFit:
        fit = fit_candidate(self._problem(), candidate)
        by_one_step = self._problem().whole is not None and candidate.kind.shape and fit.gain > ENTRY
        return settled_fit(self._problem(), fit) if by_one_step else fit

    def _effect_and_slopes(self, candidate: Candidate) -> tuple[Array, Array]:
        fit = self.fit(candidate)
        return fit.effect, self._problem().tangents(fit)


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
