"""The noise floor: how far two readings of the same thing may lie apart on this bench."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.fit.calibration import jacobian, start_model
from pmg.pipeline.fit.noise import (
    CORRELATIONS,
    DRIFTED,
    GROWTHS,
    NO_CORRELATION,
    NO_GROWTH,
    Growth,
    NoiseFloor,
    ShaftNoise,
)
from pmg.pipeline.fit.span import orthonormal
from pmg.pipeline.fit.structure import families
from pmg.pipeline.fit.whitening import EVEN, chain_of, growth_of, relative_scale
from pmg.pipeline.grid.readings import predict, take_readings
from pmg.sim.shafts import PerShaft, per_shaft

if TYPE_CHECKING:
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array, Mask

BASELINE_FREE = ("K_corr", "b", "c", "d")
"""Constants that the baseline may use to absorb a mismatch."""

MORE = 0.01
"""Level of the test whether repeats scatter more than what follows nothing."""

LESS = 0.001
"""Level of the test whether repeats scatter less: a mismatch that no family follows is rarer than lucky repeats."""


FEWEST_NEIGHBOURS = 1.5
"""Degrees of freedom below which the scatter about the loss curves states no uncertainty of a mean."""

NEIGHBOURS = "scatter about the loss curves, a mismatch included: no repeats, no residual to spare"
"""Source of the uncertainty of a mean where a campaign is too small to tell its noise from a mismatch."""

ALIKE = PerShaft(1.0, 1.0)
"""Noise of both shafts of one size, from which the search for either begins."""

MINIMUM_FOR_CORRELATION = 30
"""Degrees of freedom below which no correlation between neighbours is estimated."""


def repeat_contrasts(readings: Readings) -> Array:
    """Orthonormal differences between readings of the same set-point (m, r); none without repeats.

    Two points repeat each other when configuration, gear, driving side, load asked for and both speeds (to 1 rad/s)
    agree.
    """
    at = readings.grid.points
    keys: dict[tuple[object, ...], list[int]] = {}
    for i, row in enumerate(readings.row):
        key = (
            bool(readings.sun[i]),
            str(at.configuration[row]),
            int(at.gear[row]),
            str(at.drive[row]),
            round(float(at.load_set[row]), 3),
            round(float(at.speed_sun[row])),
            round(float(at.speed_ring[row])),
        )
        keys.setdefault(key, []).append(i)
    columns = []
    for members in keys.values():
        g = len(members)
        helmert = np.zeros((len(readings), g - 1))
        for k in range(1, g):
            helmert[members[:k], k - 1] = 1.0
            helmert[members[k], k - 1] = -k
            helmert[:, k - 1] /= math.sqrt(k * (k + 1))
        columns.append(helmert)
    return np.hstack(columns) if columns else np.zeros((len(readings), 0))


def _weights(deviance: list[float]) -> Array:
    """Weights of hypotheses under a flat prior."""
    weight = np.exp(-0.5 * (np.array(deviance) - min(deviance)))
    return np.asarray(weight / weight.sum())


def _correlation(readings: Readings, residual: Array, basis: Array, side: str) -> Array:
    """Weight of each of `CORRELATIONS`: restricted likelihood with the structured columns taken out, flat prior."""
    chain = chain_of(readings, side)
    design = orthonormal(basis[chain.rows])
    dof = len(chain.rows) - design.shape[1]
    if dof < MINIMUM_FOR_CORRELATION:
        return np.asarray(NO_CORRELATION)
    deviance = []
    for rho in CORRELATIONS:
        whitened = chain.whiten(np.c_[design, residual[chain.rows]], float(rho))
        deviance.append(_deviance(whitened, dof) + chain.log_determinant(float(rho)))
    return _weights(deviance)


def _deviance(whitened: Array, dof: int) -> float:
    """Restricted deviance of the last column given the others, without the determinant of the noise."""
    *others, left = np.diag(np.linalg.qr(whitened, mode="r"))
    return float(dof * math.log(left**2 / dof) + 2.0 * np.log(np.abs(others)).sum())


STRAY = 3.0
"""Residuals beyond that many standard deviations count as that many where the growth of the noise is estimated: one
bad reading at high speed is not a noise that grows."""


def _growth(readings: Readings, residual: Array, basis: Array, side: str) -> Growth:
    """Growth of one shaft's noise with its speed: restricted likelihood, flat prior; values in units of the floor."""
    rows = np.flatnonzero(readings.of_shaft[side])
    design = orthonormal(basis[rows])
    dof = len(rows) - design.shape[1]
    flat = growth_of(readings, side, NO_GROWTH.weights)
    if dof < MINIMUM_FOR_CORRELATION or readings.grid.rounding > 0.0 or flat is NO_GROWTH:
        return flat
    left = residual[rows] - design @ (design.T @ residual[rows])
    size = math.sqrt(float(left @ left) / dof)
    y = np.clip(left, -STRAY * size, STRAY * size)
    deviance = []
    for growth in GROWTHS:
        variance = flat.of(float(growth), readings.speed_own[rows])
        whitened = np.c_[design, y] / np.sqrt(variance)[:, None]
        deviance.append(_deviance(whitened, dof) + float(np.sum(np.log(variance))))
    return replace(flat, weights=_weights(deviance))


def structured_columns(readings: Readings, bench: BenchParameters, model: LossModel) -> Array:
    """Columns that are no noise (m, k) [N m per unit]: slopes of the baseline, and every family of structure."""
    columns = [family.columns for family in families(readings, bench, model)]
    return np.hstack([jacobian(readings, bench, model, BASELINE_FREE), *columns])


def noise_floor(grid: Grid, fits: LossFits, bench: BenchParameters) -> NoiseFloor:
    r"""Noise floor of a campaign, from its repeats and from the scatter that follows nothing.

    Parameters
    ----------
    grid : Grid
        Measured grid; uncertainties within the windows are used for comparison only.
    fits : LossFits
        Loss curves of the neutral points.
    bench : BenchParameters
        Ratio of the stages.

    Notes
    -----
    What varies within a window is only part of the noise: between points the bench re-approaches its speed. Two
    estimates hold all of it: the differences of repeated points, and the part of the residual that is left when the
    baseline and every family of structure (`pmg.pipeline.fit.structure`) are projected out,

    .. math:: s^2 = \sum_{i \in \mathrm{shaft}} r_i^2 / \mathrm{tr}_\mathrm{shaft}(I - P).

    Where they agree (F test at 1 %, at 0.1 % where the repeats scatter less) they are pooled by degrees of freedom.
    Repeats that scatter more betray a slow change between them, repeats that scatter less a mismatch that no family
    follows; in both cases the smaller figure is the noise, and the mismatch test is reported.

    A campaign without repeats that is too small for the families has no such estimate: the scatter about the loss
    curves stands for it, which holds a mismatch as well. By what varies within a window alone, every bench that
    re-approaches its speeds would differ from its model.
    """
    readings = take_readings(grid, bench)
    model = start_model(fits)
    residual = readings.torque - predict(readings, bench, model)
    structured = structured_columns(readings, bench, model)
    even, _ = _scatter(readings, bench, residual, structured)
    flat = relative_scale(readings, bench, even)
    growth = per_shaft(partial(_growth, readings, residual / flat, structured / flat[:, None]))
    sigma, dof = _scatter(readings, bench, residual, structured, even, growth)
    scale = relative_scale(readings, bench, sigma, growth)
    near, near_dof = _scatter(readings, bench, residual, jacobian(readings, bench, model, BASELINE_FREE))
    contrasts = repeat_contrasts(readings)

    def shaft(side: str) -> ShaftNoise:
        rho = NO_CORRELATION
        if grid.points.ordered and readings.of_shaft[side].any():
            rho = _correlation(readings, residual / scale, structured / scale[:, None], side)
        even = residual / np.sqrt(growth[side].variance(readings.speed_own))
        repeats = _repeat_scatter(readings, even, contrasts, side)
        pooled = _pool(grid.within[side][grid.accepted], repeats, sigma[side], dof[side], rho)
        if pooled.dof or near_dof[side] < FEWEST_NEIGHBOURS:
            return replace(pooled, growth=growth[side])
        return replace(pooled, u=near[side], dof=near_dof[side], source=NEIGHBOURS)

    return NoiseFloor(*per_shaft(shaft))


def _scatter(
    readings: Readings,
    bench: BenchParameters,
    residual: Array,
    columns: Array,
    sigma: PerShaft[float] = ALIKE,
    growth: PerShaft[Growth] = EVEN,
) -> tuple[PerShaft[float], PerShaft[float]]:
    """Standard deviation of either shaft's readings [N m] beyond some columns (m, k), and its degrees of freedom.

    The shafts share columns, so that each is weighed by the other's: twice over, from `sigma` on.
    """
    dof = PerShaft(0.0, 0.0)
    for _ in range(2):
        scale = relative_scale(readings, bench, sigma, growth)
        basis = orthonormal(columns / scale[:, None])
        left = residual / scale - basis @ (basis.T @ (residual / scale))
        leverage = np.einsum("ij,ij->i", basis, basis)
        dof = readings.of_shaft.map(partial(_left_dof, leverage))
        sigma = per_shaft(partial(_rescaled, readings, left, sigma, dof))
    return sigma, dof


def _left_dof(leverage: Array, mine: Mask) -> float:
    """Degrees of freedom that a fit of that leverage leaves to some of the readings."""
    return float(np.sum(1.0 - leverage[mine]))


def _rescaled(readings: Readings, left: Array, sigma: PerShaft[float], dof: PerShaft[float], side: str) -> float:
    """Standard deviation of a shaft's readings [N m] from what is left of them in units of the last one."""
    if dof[side] <= 1.0:
        return sigma[side]
    mine = left[readings.of_shaft[side]]
    return sigma[side] * math.sqrt(float(mine @ mine) / dof[side])


def _repeat_scatter(readings: Readings, residual: Array, contrasts: Array, side: str) -> tuple[float, int]:
    """Standard deviation of the repeats of one shaft [N m] and its degrees of freedom."""
    mine: Mask = readings.of_shaft[side]
    engaged = readings.configuration == "engaged"
    columns = contrasts[:, (contrasts[mine & ~engaged] != 0.0).any(axis=0)]
    n = columns.shape[1]
    return (math.sqrt(float(np.mean((columns.T @ residual) ** 2))), n) if n else (math.nan, 0)


def _pool(within: Array, repeats: tuple[float, int], unstructured: float, dof: float, rho: Array) -> ShaftNoise:
    """One figure from repeats and unstructured scatter."""
    spread, n = repeats
    inside = float(np.sqrt(np.mean(within**2))) if len(within) else math.nan
    noise = ShaftNoise(math.nan, 0.0, inside, spread, n, unstructured, dof, rho, "")
    if n == 0 and dof <= 1.0:
        return replace(noise, u=inside, source="within-window scatter only: no repeats, no residual to spare")
    if n == 0:
        source = "scatter that follows no covariate; the campaign has no repeats: structure is judged against it alone"
        return replace(noise, u=unstructured, dof=dof, source=source)
    if dof <= 1.0:
        return replace(noise, u=spread, dof=float(n), source="repeated points")
    ratio = (spread / unstructured) ** 2 if unstructured > 0.0 else math.inf
    if stats.f.sf(ratio, n, dof) < MORE:
        return replace(noise, u=unstructured, dof=dof, source=DRIFTED)
    if stats.f.cdf(ratio, n, dof) < LESS:
        source = "repeated points; the rest scatters more, so something is left that no covariate follows"
        return replace(noise, u=spread, dof=float(n), source=source)
    pooled = math.sqrt((n * spread**2 + dof * unstructured**2) / (n + dof))
    return replace(noise, u=pooled, dof=n + dof, source="repeated points and scatter that follows no covariate, pooled")
