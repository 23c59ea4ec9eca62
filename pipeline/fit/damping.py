"""Damping constants of the magnetic gear from its loss power, for a given correction factor: the thesis's way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

from pmg.pipeline.fit.covariance import u_predicted
from pmg.pipeline.fit.losses import power_balance
from pmg.pipeline.fit.robust import bisquare_weights
from pmg.pipeline.grid.levels import speed_levels
from pmg.pipeline.wording.option_words import DampingMethod
from pmg.sim.mechanisms import EddyDamping, ExcessDamping, HysteresisDamping
from pmg.sim.signals import LOSS_MAGNETIC

if TYPE_CHECKING:
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array, Mask

THESIS_CORRECTIONS = (0.90, 0.85, 0.80, 0.75)
"""Correction factors of the thesis's table 6.8."""

NAMES = ("b", "c", "d")
"""Hysteresis, eddy and excess constant."""


@dataclass(frozen=True)
class DampingFit:
    """Hysteresis, eddy and excess damping at one correction factor.

    Parameters
    ----------
    correction : float
        K_corr.
    method : DampingMethod
        How the speeds were weighed: by least squares where there are not more than three.
    b, c, d : float
        N m, N m s/rad, N m (s/rad)^1/2; none below 0.
    standard_errors : tuple of (float or None)
        Of b, c, d; None on the bound.
    dof : int
        Degrees of freedom: speeds less the constants that are off their bound.
    r_squared, rmse : float
        Coefficient of determination, and root of the sum of squares over the degrees of freedom [W].
    speed : (n,) array
        Sun speeds, magnitude [rad/s].
    measured, fitted : (n,) array
        Magnetic loss at each [W], mean over the loads.
    u_fitted : (n,) array
        Standard uncertainty of the fitted loss [W], by the scatter about it; constants on their bound have none.
    weights : (n,) array
        Of each speed, from 0 to 1; 1 by least squares.
    smallest : float
        Smallest measured magnetic loss of one point at this correction factor [W].
    negative : int
        Points at which it is below zero.
    """

    correction: float
    method: DampingMethod
    b: float
    c: float
    d: float
    standard_errors: tuple[float | None, float | None, float | None]
    dof: int
    r_squared: float
    rmse: float
    speed: Array
    measured: Array
    fitted: Array
    u_fitted: Array
    weights: Array
    smallest: float
    negative: int

    @property
    def on_bound(self) -> tuple[str, ...]:
        """Constants that sit on their bound of zero."""
        return tuple(name for name in NAMES if getattr(self, name) <= 0.0)


def fit_damping(
    grid: Grid, fits: LossFits, correction: float, method: DampingMethod = DampingMethod.LEAST_SQUARES
) -> DampingFit:
    r"""Fit of the magnetic loss power against speed, constants not below zero.

    Parameters
    ----------
    grid : Grid
        Measured grid.
    fits : LossFits
        Curves of the neutral losses.
    correction : float
        K_corr.
    method : DampingMethod
        Least squares, or bisquare weights.

    Raises
    ------
    FitError
        No accepted engaged point, or bisquare weights that do not settle.

    Notes
    -----
    Thesis, equation 6.1: with x the sun's speed and :math:`y = -x/i`,
    :math:`P(x) = (b + cx + dx/\sqrt{1+|x|})\,x + (-b + cy + dy/\sqrt{1+|y|})\,y`: what the three damping mechanisms
    dissipate on both rotors. One value a speed is fitted, the mean over the loads, as in its figures 6.2 to 6.5; a
    speed with more points weighs more. By least squares the sum of squares is that of the residuals; with bisquare
    weights it is :math:`(n - 3)\hat\sigma^2` (`pmg.pipeline.fit.robust`). Either is divided by the degrees of
    freedom, :math:`n - 3` and one for each constant on its bound.
    """
    balance = power_balance(grid, fits, correction)
    at, loss = balance.grid.points, balance.values[LOSS_MAGNETIC.name]
    unit = (HysteresisDamping(1.0), EddyDamping(1.0), ExcessDamping(1.0))
    columns = np.stack([-mechanism.torque(at).power(at) for mechanism in unit], axis=1)
    level, row = np.unique(np.abs(speed_levels(at)[0]), return_inverse=True)
    count = np.bincount(row).astype(np.float64)

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(row, values, len(level)) / count)

    design = np.stack([mean(column) for column in columns.T], axis=1)
    measured, share = mean(loss), count / count.mean()
    weights, squares = np.ones(len(level)), math.nan
    if len(level) <= len(NAMES):
        method = DampingMethod.LEAST_SQUARES
    if method is DampingMethod.BISQUARE:
        root = np.sqrt(share)

        def refit(w: Array, _: Array) -> tuple[Array, Array]:
            values = _bounded(design, measured, share * w)
            return values, root * (measured - design @ values)

        start, size = np.zeros(len(NAMES)), float(np.abs(measured).max())
        found = bisquare_weights(refit, start, design * root[:, None], size)
        if found.scale > 0.0:
            weights, squares = found.weights, (len(level) - len(NAMES)) * found.sigma**2
    values = _bounded(design, measured, share * weights)
    fitted = design @ values
    if math.isnan(squares):
        squares = float(share @ (measured - fitted) ** 2)
    free = values > 0.0
    dof = max(len(level) - int(free.sum()), 1)
    about_mean = float(share @ (measured - np.average(measured, weights=share)) ** 2)
    covariance = _covariance(design * np.sqrt(share)[:, None], free, squares / dof)
    b, c, d = map(float, values)
    return DampingFit(
        correction=correction,
        method=method,
        b=b,
        c=c,
        d=d,
        standard_errors=_errors(covariance, free),
        dof=dof,
        r_squared=1.0 - squares / about_mean if about_mean > 0.0 else math.nan,
        rmse=math.sqrt(squares / dof),
        speed=mean(np.abs(at.speed_sun)),
        measured=measured,
        fitted=fitted,
        u_fitted=u_predicted(design, covariance),
        weights=weights,
        smallest=float(loss.min()),
        negative=int((loss < 0.0).sum()),
    )


def _bounded(design: Array, measured: Array, weights: Array) -> Array:
    """Least squares with weights (n,), no constant below zero."""
    root = np.sqrt(weights)
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0.0] = 1.0
    scaled, _ = nnls(design / scale * root[:, None], measured * root)
    return np.asarray(scaled / scale)


def _covariance(design: Array, free: Mask, variance: float) -> Array:
    """Covariance of b, c, d (3, 3); zero on the bound."""
    covariance = np.zeros((len(NAMES), len(NAMES)))
    covariance[np.ix_(free, free)] = np.linalg.pinv(design[:, free].T @ design[:, free]) * variance
    return covariance


def _errors(covariance: Array, free: Mask) -> tuple[float | None, float | None, float | None]:
    """Standard errors of b, c, d; None on the bound."""
    b, c, d = (math.sqrt(float(square)) if off else None for square, off in zip(np.diag(covariance), free, strict=True))
    return b, c, d
