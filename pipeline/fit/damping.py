"""Damping constants of the magnetic gear from its loss power, for a given correction factor: the thesis's way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import nnls

from pmg.pipeline.fit.losses import power_balance
from pmg.sim.mechanisms import EddyDamping, ExcessDamping, HysteresisDamping
from pmg.sim.signals import LOSS_MAGNETIC

if TYPE_CHECKING:
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

THESIS_CORRECTIONS = (0.90, 0.85, 0.80, 0.75)
"""Correction factors of the thesis's table 6.8."""


@dataclass(frozen=True)
class DampingFit:
    """Hysteresis, eddy and excess damping at one correction factor.

    Parameters
    ----------
    correction : float
        K_corr.
    b, c, d : float
        N m, N m s/rad, N m (s/rad)^1/2; none below 0.
    standard_errors : tuple of (float or None)
        Of b, c, d; None on the bound.
    r_squared, rmse : float
        Coefficient of determination, and root of the sum of squares over the degrees of freedom [W]; three
        parameters are counted whether or not they sit on their bound.
    fitted : (n,) array
        Fitted magnetic loss [W].
    smallest : float
        Smallest measured magnetic loss at this correction factor [W].
    negative : int
        Points at which it is below zero.
    """

    correction: float
    b: float
    c: float
    d: float
    standard_errors: tuple[float | None, float | None, float | None]
    r_squared: float
    rmse: float
    fitted: Array
    smallest: float
    negative: int


def fit_damping(grid: Grid, fits: LossFits, correction: float) -> DampingFit:
    r"""Least squares of the magnetic loss power against speed, constants not below zero.

    Notes
    -----
    Thesis, equation 6.1: with x the sun's speed and :math:`y = -x/i`,
    :math:`P(x) = (b + cx + dx/\sqrt{1+|x|})\,x + (-b + cy + dy/\sqrt{1+|y|})\,y`: what the three damping mechanisms
    dissipate on both rotors. Every point has the same weight, as there.
    """
    balance = power_balance(grid, fits, correction)
    at, measured = balance.grid.points, balance.values[LOSS_MAGNETIC.name]
    unit = (HysteresisDamping(1.0), EddyDamping(1.0), ExcessDamping(1.0))
    design = np.stack([-mechanism.torque(at).power(at) for mechanism in unit], axis=1)
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0.0] = 1.0
    scaled, _ = nnls(design / scale, measured)
    values = scaled / scale
    fitted = design @ values
    rss = float(np.sum((measured - fitted) ** 2))
    free = values > 0.0
    dof = max(len(measured) - 3, 1)
    errors: list[float | None] = [None, None, None]
    if free.any():
        covariance = np.linalg.pinv(design[:, free].T @ design[:, free]) * rss / dof
        for i, position in enumerate(np.flatnonzero(free)):
            errors[position] = math.sqrt(float(covariance[i, i]))
    b, c, d = map(float, values)
    about_mean = float(np.sum((measured - measured.mean()) ** 2))
    return DampingFit(
        correction=correction,
        b=b,
        c=c,
        d=d,
        standard_errors=(errors[0], errors[1], errors[2]),
        r_squared=1.0 - rss / about_mean if about_mean > 0.0 else math.nan,
        rmse=math.sqrt(rss / dof),
        fitted=fitted,
        smallest=float(measured.min()),
        negative=int((measured < 0.0).sum()),
    )
