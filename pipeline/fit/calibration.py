"""Calibration of the baseline: bearing curves, correction factor and damping, fitted together."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.covariance import covariance_at_bounds, free_covariance
from pmg.pipeline.fit.robust import bisquare_weights
from pmg.pipeline.fit.settle import BoundedProblem
from pmg.pipeline.grid.readings import Readings, change, predict, take_readings
from pmg.pipeline.wording.option_words import DampingMethod
from pmg.sim.errors import FitError
from pmg.sim.lossmodel import LossModel
from pmg.sim.mechanisms import EddyDamping, ExcessDamping, HysteresisDamping, SunBearings

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.mechanisms import Parameter
    from pmg.sim.signals import Array

CONSTANTS: dict[str, Parameter] = {
    "K_corr": SunBearings.parameters()[0],
    "b": HysteresisDamping.parameters()[0],
    "c": EddyDamping.parameters()[0],
    "d": ExcessDamping.parameters()[0],
}
"""The scalar constants of the baseline: unit, bounds, usual size."""


@dataclass(frozen=True)
class FittedBaseline:
    """The baseline that fits the readings best.

    Parameters
    ----------
    model : LossModel
        The calibrated constants.
    names : tuple of str
        Free parameters: ``sun[p]`` and ``ring[p]``, coefficients of power p; then those free of K_corr, b, c, d.
    values : (k,) array
        Their values.
    covariance : (k, k) array
        Their covariance; rows of parameters on a bound are NaN, and the others' hold whether or not those sit there.
    on_bound : tuple of str
        Parameters that sit on a bound: no error bar belongs to them.
    chi_square : float
        Weighted sum of squares; with bisquare weights, what stands for it.
    dof : int
        Degrees of freedom: readings less the parameters that are off their bound.
    message : str
        Why the solver stopped.
    moments : (k, k) array
        The covariance with parameters on a bound in it: what they may still be, as second moments about the bound.
    method : DampingMethod
        Least squares, or bisquare weights.
    weights : (m,) array, optional
        Of the readings, on top of their uncertainty, from 0 to 1; None by least squares.
    """

    model: LossModel
    names: tuple[str, ...]
    values: Array
    covariance: Array
    on_bound: tuple[str, ...]
    chi_square: float
    dof: int
    message: str
    moments: Array
    method: DampingMethod = DampingMethod.LEAST_SQUARES
    weights: Array | None = None

    @property
    def left_out(self) -> int:
        """Readings of weight 0; none by least squares."""
        return 0 if self.weights is None else int((self.weights <= 0.0).sum())

    @property
    def free(self) -> tuple[str, ...]:
        """The constants among K_corr, b, c, d that were fitted."""
        return tuple(name for name in self.names if name in CONSTANTS)

    def value(self, name: str) -> float:
        """Value of a constant, free or held."""
        held = {"K_corr": self.model.correction, "b": self.model.b, "c": self.model.c, "d": self.model.d}
        return held[name] if name in held else float(self.values[self.names.index(name)])

    def standard_error(self, name: str) -> float | None:
        """Standard error, or None where the parameter was held or sits on a bound."""
        if name not in self.names or name in self.on_bound:
            return None
        i = self.names.index(name)
        return float(np.sqrt(self.covariance[i, i]))


def parameter_names(model: LossModel, free: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the free parameters, curves first."""
    sun = tuple(f"sun[{p:g}]" for p in model.curve_sun.powers)
    ring = tuple(f"ring[{p:g}]" for p in model.curve_ring.powers)
    return sun + ring + free


def parameter_values(model: LossModel, free: tuple[str, ...]) -> Array:
    """Values of the free parameters, in the order of `parameter_names`."""
    constants = {"K_corr": model.correction, "b": model.b, "c": model.c, "d": model.d}
    scalars = [constants[name] for name in free]
    return np.asarray(np.r_[model.curve_sun.coefficients, model.curve_ring.coefficients, scalars])


def with_parameters(model: LossModel, free: tuple[str, ...], values: Array) -> LossModel:
    """The model with other values of the free parameters."""
    n_sun, n_ring = len(model.curve_sun.powers), len(model.curve_ring.powers)
    constants = dict(zip(free, map(float, values[n_sun + n_ring :]), strict=True))
    return replace(
        model,
        curve_sun=replace(model.curve_sun, coefficients=values[:n_sun]),
        curve_ring=replace(model.curve_ring, coefficients=values[n_sun : n_sun + n_ring]),
        correction=constants.get("K_corr", model.correction),
        b=constants.get("b", model.b),
        c=constants.get("c", model.c),
        d=constants.get("d", model.d),
    )


def jacobian(readings: Readings, bench: BenchParameters, model: LossModel, free: tuple[str, ...]) -> Array:
    """Derivatives of the predicted readings to the free parameters (m, k).

    The prediction is linear in every single parameter, so a difference over the parameter's usual size is exact to
    rounding.
    """
    values, here = parameter_values(model, free), predict(readings, bench, model)
    n_curves = len(values) - len(free)
    steps = np.r_[np.full(n_curves, 0.01), [CONSTANTS[name].typical for name in free]]
    columns = []
    for i, step in enumerate(steps):
        shift = np.zeros(len(values))
        shift[i] = step
        there = predict(readings, bench, with_parameters(model, free, values + shift))
        columns.append(change(there, here) / step)
    return np.stack(columns, axis=1)


USUAL_CORRECTION = 0.85
"""Correction factor from which a fit starts: in the middle of those the thesis tried."""


def start_model(fits: LossFits) -> LossModel:
    """Curves of the neutral points with usual constants: where a fit starts, and where the baseline is linearised."""
    return LossModel(fits.sun.curve, fits.ring.curve, USUAL_CORRECTION, 0.0, CONSTANTS["c"].typical, 0.0)


def calibrate(
    grid: Grid,
    fits: LossFits,
    bench: BenchParameters,
    *,
    correction: float | None = None,
    free: tuple[str, ...] = ("K_corr", "b", "c"),
    held: Mapping[str, float] | None = None,
    method: DampingMethod = DampingMethod.LEAST_SQUARES,
) -> FittedBaseline:
    """Baseline fitted to neutral and engaged readings together, weighted by their uncertainty.

    Parameters
    ----------
    grid : Grid
        Measured grid with its uncertainties.
    fits : LossFits
        Curves of the neutral points: their terms and the start values.
    bench : BenchParameters
        Ratio and shares.
    correction : float, optional
        Hold K_corr at this value instead of fitting it.
    free : tuple of str
        Constants to fit among K_corr, b, c, d, less those held. The default leaves d at zero: with a root term in the
        curves, d and K_corr cannot be separated by steady points.
    held : mapping of str to float
        Values at which b, c or d are held.
    method : DampingMethod
        Least squares, or bisquare weights on top of the uncertainties. What the readings scatter beyond these is in
        `chi_square`, not in the covariance; where they scatter less about a bisquare fit, because outliers have swollen
        the uncertainties, the covariance is smaller by that.

    Raises
    ------
    FitError
        There are no engaged points, the points do not determine the constants, or the solver did not converge.
    """
    if not (grid.points.engaged & grid.accepted).any():
        came, expected = "no accepted engaged point", "neutral and engaged points"
        raise FitError("calibration", came, expected, "Ingest the engaged runs too.")
    readings = take_readings(grid, bench)
    start = _start_holding(start_model(fits), correction, held or {})
    free = tuple(n for n in free if n not in (held or {}) and not (n == "K_corr" and correction is not None))
    problem = _problem(readings, bench, start, free)
    weights, squares = np.ones(len(readings)), math.nan
    if method is DampingMethod.BISQUARE:
        size = float(np.abs(readings.torque / readings.u).max())
        slopes = problem.slopes(parameter_values(start, free))
        found = bisquare_weights(problem.step, problem.begin, slopes, size)
        if found.scale > 0.0:
            weights, squares = found.weights, (len(readings) - slopes.shape[1]) * found.sigma**2
    values, message = problem.solve(weights)
    bound = (values == problem.lower) | (values == problem.upper)
    root = np.sqrt(weights)
    residuals, slopes = problem.residuals(values) * root, problem.slopes(values) * root[:, None]
    inside = np.flatnonzero(~bound)
    moments = np.zeros((len(values), len(values)))
    moments[np.ix_(inside, inside)] = free_covariance(slopes[:, inside], [problem.names[i] for i in inside])
    if bound.any():
        upward = np.where(values == problem.lower, 1.0, np.where(bound, -1.0, 0.0))
        moments = covariance_at_bounds(slopes, residuals, inside, upward, moments)
    if squares < len(readings) - slopes.shape[1]:  # outliers have swollen the uncertainties
        moments *= squares / (len(readings) - slopes.shape[1])
    covariance = moments.copy()
    covariance[bound, :] = covariance[:, bound] = np.nan
    return FittedBaseline(
        model=with_parameters(start, free, values),
        names=problem.names,
        values=values,
        covariance=covariance,
        on_bound=tuple(name for name, at in zip(problem.names, bound, strict=True) if at),
        chi_square=float(residuals @ residuals) if math.isnan(squares) else squares,
        dof=len(readings) - len(inside),
        message=message,
        moments=moments,
        method=method,
        weights=weights if method is DampingMethod.BISQUARE else None,
    )


def _problem(readings: Readings, bench: BenchParameters, start: LossModel, free: tuple[str, ...]) -> BoundedProblem:
    names = parameter_names(start, free)
    n_curves = len(names) - len(free)
    lower = np.r_[np.full(n_curves, -np.inf), [CONSTANTS[name].bounds[0] for name in free]]
    upper = np.r_[np.full(n_curves, np.inf), [CONSTANTS[name].bounds[1] for name in free]]

    def residuals(values: Array) -> Array:
        model = with_parameters(start, free, values)
        return (readings.torque - predict(readings, bench, model)) / readings.u

    def slopes(values: Array) -> Array:
        return -jacobian(readings, bench, with_parameters(start, free, values), free) / readings.u[:, None]

    scale = np.r_[np.full(n_curves, 0.1), [CONSTANTS[name].typical for name in free]]
    begin = np.clip(parameter_values(start, free), lower + 1e-9 * scale, upper - 1e-9 * scale)
    return BoundedProblem(names, lower, upper, scale, begin, residuals, slopes)


def _start_holding(start: LossModel, correction: float | None, held: Mapping[str, float]) -> LossModel:
    """The model that a fit starts from, with the constants that are held."""
    start = replace(start, b=held.get("b", start.b), c=held.get("c", start.c), d=held.get("d", start.d))
    return start if correction is None else replace(start, correction=correction)
