"""Baseline and named mechanisms fitted together on the simulator itself, every constant free."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from pmg.pipeline.diagnosis.engine.catalogue import ENTRY
from pmg.pipeline.diagnosis.engine.held_out import solve
from pmg.pipeline.diagnosis.grid.candidates import grid_problem, predict_with
from pmg.pipeline.fit.calibration import CONSTANTS, parameter_names, parameter_values, with_parameters
from pmg.pipeline.fit.noise_floor import BASELINE_FREE
from pmg.pipeline.fit.settle import settle, slopes_at
from pmg.pipeline.fit.span import orthonormal

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.candidates import Candidate, CandidateFit, GridProblem
    from pmg.pipeline.diagnosis.grid.catalogue import GridExplanation
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.mechanisms import Mechanism
    from pmg.sim.signals import Array

FREE = ("K_corr", "b", "c")
"""Constants of the baseline that are fitted; d stays where the calibration has it, as there."""

MOST_STEPS = 60
"""Steps of the fit; it starts from the separate fits, so a few are enough."""

CLEARLY = 3.0
"""Standard errors by which the drag of a baseline at rest must be negative to be no drag: a bearing drives no shaft."""

WEAK = 1e-7
"""Ratio of singular values below which a direction is not determined and gets no error."""


@dataclass(frozen=True)
class Refit:
    """The augmented model.

    Parameters
    ----------
    model : LossModel
        The baseline as it is with the mechanisms in.
    candidates : tuple of Candidate
        What was added.
    values : tuple of (k,) array
        Parameters of each.
    standard_errors : tuple of (k,) array
        Their standard errors; NaN on a bound or where not determined.
    baseline_errors : dict of str to float
        Standard errors of the free baseline constants; NaN on a bound.
    prediction : (m,) array
        What the augmented model gives for each reading [N m].
    """

    model: LossModel
    candidates: tuple[Candidate, ...]
    values: tuple[Array, ...]
    standard_errors: tuple[Array, ...]
    baseline_errors: dict[str, float]
    prediction: Array

    def mechanisms(self, problem: GridProblem) -> tuple[Mechanism, ...]:
        """The added mechanisms with their numbers."""
        pairs = zip(self.candidates, self.values, strict=True)
        return tuple(candidate.mechanism(problem.bench, self.model, values) for candidate, values in pairs)


def refit(problem: GridProblem, fits: tuple[CandidateFit, ...]) -> Refit:
    """Nonlinear least squares of all constants at once, from the separate fits.

    Notes
    -----
    Residuals are whitened, so that the covariance :math:`(J^T J)^{-1}` holds for noise that is correlated from point
    to point, and freed from what the baseline is allowed to follow besides its constants. Bounds are the physical
    ones; a parameter that sat on one stays there. Where more is left than noise, as an error of form leaves it, the
    standard errors are widened by the square root of the mean square that is left (Birge 1932).
    """
    names = parameter_names(problem.model, FREE)
    parameters = [p for fit in fits for p in fit.candidate.parameters]
    n_curves = len(names) - len(FREE)
    constants = [CONSTANTS[name] for name in FREE]
    start = np.concatenate([parameter_values(problem.model, FREE), *(fit.values for fit in fits)])
    size = np.r_[np.full(n_curves, 0.1), [p.typical for p in (*constants, *parameters)]]
    bounds = np.array([p.bounds for p in (*constants, *parameters)])
    lower, upper = np.r_[np.full(n_curves, -np.inf), bounds[:, 0]], np.r_[np.full(n_curves, np.inf), bounds[:, 1]]
    cuts = np.cumsum([len(names), *(len(fit.values) for fit in fits)])[:-1]
    stuck = [p.name in fit.on_bound for fit in fits for p in fit.candidate.parameters]
    loose = ~np.r_[np.zeros(len(names), dtype=bool), np.array(stuck, dtype=bool)]

    def predicted(values: Array) -> Array:
        own, *added = np.split(values, cuts)
        model = with_parameters(problem.model, FREE, own)
        extra = tuple(f.candidate.mechanism(problem.bench, model, v) for f, v in zip(fits, added, strict=True))
        return predict_with(problem.readings, problem.bench, model, extra)

    def whole(scaled: Array) -> Array:
        values = start.copy()
        values[loose] = scaled * size[loose]
        return values

    allowed = orthonormal(problem.white(problem.allowed))

    def residuals(scaled: Array) -> Array:
        left = problem.white((problem.readings.torque - predicted(whole(scaled)))[:, None])[:, 0]
        return np.asarray(left - allowed @ (allowed.T @ left))

    inside = np.clip(start, lower + 1e-6 * size, upper - 1e-6 * size)[loose] / size[loose]
    within = (lower / size)[loose], (upper / size)[loose]
    found = least_squares(residuals, inside, bounds=within, xtol=1e-7, ftol=1e-8, max_nfev=MOST_STEPS)
    units = np.ones(len(found.x)), np.array(within)
    settled = settle(residuals, found.x, *units)
    values = whole(settled.values)
    free = loose.copy()
    free[loose] = settled.free
    errors = np.full(len(values), np.nan)
    spare = len(problem.left) - int(free.sum()) - allowed.shape[1]
    wider = math.sqrt(max(settled.cost / max(spare, 1), 1.0))
    if found.status > 0:  # a fit that ran out of steps has no error bars
        errors[free] = wider * (spread_of(slopes_at(residuals, settled, *units)) * size[free])
    own, *added = np.split(values, cuts)
    own_errors, *added_errors = np.split(errors, cuts)
    return Refit(
        with_parameters(problem.model, FREE, own),
        tuple(fit.candidate for fit in fits),
        tuple(added),
        tuple(added_errors),
        dict(zip(names, own_errors.tolist(), strict=True)),
        predicted(values),
    )


def spread_of(slopes: Array) -> Array:
    """Standard errors (k,) for whitened slopes (m, k); NaN where a direction that is not determined enters."""
    _, singular, right = np.linalg.svd(slopes, full_matrices=False)
    weak = singular < WEAK * singular.max(initial=0.0)
    spread = np.where(weak[:, None], 0.0, right / np.where(weak, 1.0, singular)[:, None])
    lost = (np.abs(right[weak]) > 0.3).any(axis=0)
    return np.where(lost, np.nan, np.sqrt(np.sum(spread**2, axis=0)))


def drives_at_rest(problem: GridProblem, fits: tuple[CandidateFit, ...]) -> bool:
    """Whether the baseline beside fitted mechanisms would have to drive a shaft at rest.

    What rises and falls again over speed passes for friction that falls from rest once the free curve of the baseline
    bends below zero there. Standard errors are widened as those of the refit.
    """
    loose = [problem.tangents(fit)[:, [p.name not in fit.on_bound for p in fit.candidate.parameters]] for fit in fits]
    columns = problem.white(np.hstack([problem.columns, *loose]))
    beyond = problem.readings.torque - problem.predicted - np.sum([fit.effect for fit in fits], axis=0)
    rows = problem.white(beyond[:, None])[:, 0]
    size = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(np.float64).tiny)
    change = solve(columns, rows)
    left = rows - columns @ change
    wider = math.sqrt(max(float(left @ left) / max(len(rows) - columns.shape[1], 1), 1.0))
    error = wider * spread_of(columns / size) / size
    values = parameter_values(problem.model, BASELINE_FREE)
    rest = [i for i, name in enumerate(parameter_names(problem.model, BASELINE_FREE)) if name.endswith("[0]")]
    return any(values[i] + change[i] < -CLEARLY * error[i] for i in rest)


def about(problem: GridProblem, explanation: GridExplanation) -> GridProblem | None:
    """The problem about the baseline that is fitted together with a set of mechanisms; None where it gains nothing.

    Beside a large effect the baseline's curves are far from where they are without it, and what they can absorb, and
    the effect on them, are no longer those of the first linearisation.
    """
    if not explanation.fits:
        return None
    found = refit(problem, explanation.fits)
    here = grid_problem(problem.readings, problem.bench, found.model, problem.white, problem.allowed)
    effects = [here.effect(candidate, v) for candidate, v in zip(found.candidates, found.values, strict=True)]
    left, before = here.left - here.beyond_baseline(np.sum(effects, axis=0)), explanation.problem.left
    return here if float(left @ left) < float(before @ before) - ENTRY else None
