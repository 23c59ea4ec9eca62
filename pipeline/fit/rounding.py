"""Wander of points before their torques were rounded, from the scatter that is left after it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from pmg.pipeline.fit.span import orthonormal

if TYPE_CHECKING:
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.signals import Array

SMALLEST, LARGEST = 0.02, 3.0
"""Wander that is looked for, in steps of the rounding."""

FIRST = 0.2
"""Where the search for it begins, in steps."""

SWEEPS, HALVINGS = 4, 16
"""Turns over both shafts, and halvings of the interval in each."""


def _rounded_moments(torque: Array, wander: float, step: float) -> tuple[Array, Array]:
    """Bias [N m] and variance [(N m)^2] of torques (m,) that wander normally and are then rounded to a step."""
    reach = math.ceil(6.0 * wander / step) + 1
    values = (np.round(torque / step)[:, None] + np.arange(-reach, reach + 1)) * step
    away = values - torque[:, None]
    weight = ndtr((away + 0.5 * step) / wander) - ndtr((away - 0.5 * step) / wander)
    bias = np.sum(weight * away, axis=1)
    return bias, np.sum(weight * (away - bias[:, None]) ** 2, axis=1)


def unrounded(
    readings: Readings, floor: NoiseFloor, design: Array, structure: Array, residual: Array, scale: Array
) -> tuple[NoiseFloor, Array]:
    r"""The floor and the torques from which rounding makes readings like these; unchanged where nothing is rounded.

    Parameters
    ----------
    readings : Readings
        The m readings, rounded.
    floor : NoiseFloor
        Their noise.
    design : (m, k) array
        What was fitted.
    structure : (m, c) array
        Everything that a residual may follow.
    residual : (m,) array
        Measured minus fitted torque [N m].
    scale : (m,) array
        Relative standard deviations of the readings.

    Returns
    -------
    NoiseFloor, (m,) array
        With the wander and the variance step²/12 together as the size of the noise, which is how
        `pmg.pipeline.fit.whitening.synthetic_noise` takes it; and the torques before the noise [N m].

    Notes
    -----
    Readings near a value of the rounded scale hardly scatter, those between two values scatter by half a step, and
    points of one torque are biased together. The variance of a uniform error, step²/12, does not hold as long as the
    wander is smaller than about half a step and many points share a torque. Instead the wander is the one at which
    rounded torques leave the sum of squares seen, :math:`E\,|M(y - f)|^2 = \sum_{ij} M_{ij}^2 v_j + |M b|^2` over the
    shaft's rows, with :math:`M` the projection beyond all columns. The fit took a share of the bias, which is taken
    back: :math:`f = \hat f - P\,b(f)`, with :math:`P` the projection of the fit.
    """
    step, fitted = readings.grid.rounding, np.asarray(readings.torque - residual)
    if step == 0.0:
        return floor, fitted
    own = orthonormal(design / scale[:, None])
    basis = orthonormal(np.hstack([design, structure]) / scale[:, None])
    beyond = np.eye(len(readings)) - basis @ basis.T
    square = beyond**2
    seen = (beyond @ (residual / scale)) ** 2
    shafts = {True: readings.sun, False: ~readings.sun}
    wander = {True: FIRST * step, False: FIRST * step}
    torque, bias, variance = fitted, np.zeros(len(readings)), np.zeros(len(readings))
    for _ in range(SWEEPS):
        for sun, rows in shafts.items():
            bias[rows], variance[rows] = _rounded_moments(torque[rows], wander[sun], step)
        torque = fitted - scale * (own @ (own.T @ (bias / scale)))
        for sun, rows in shafts.items():
            low, high = math.log(SMALLEST * step), math.log(LARGEST * step)
            for _ in range(HALVINGS if rows.any() else 0):
                middle = 0.5 * (low + high)
                bias[rows], variance[rows] = _rounded_moments(torque[rows], math.exp(middle), step)
                left = square[rows] @ (variance / scale**2) + (beyond[rows] @ (bias / scale)) ** 2
                low, high = (middle, high) if float(left.sum()) < float(seen[rows].sum()) else (low, middle)
            wander[sun] = math.exp(0.5 * (low + high))
    sizes = {sun: math.hypot(size, step / math.sqrt(12.0)) for sun, size in wander.items()}
    return replace(floor, sun=replace(floor.sun, u=sizes[True]), ring=replace(floor.ring, u=sizes[False])), torque
