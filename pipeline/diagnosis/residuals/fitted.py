"""Fits as linear models of their readings: lack of fit, and points that lie out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE
from pmg.pipeline.fit.calibration import jacobian
from pmg.pipeline.fit.noise_floor import repeat_contrasts
from pmg.pipeline.fit.plane_fit import plane_columns
from pmg.pipeline.fit.robust import studentised
from pmg.pipeline.fit.span import orthonormal
from pmg.pipeline.fit.whitening import floor_scale, relative_scale
from pmg.pipeline.grid.readings import Readings, predict, take_readings
from pmg.sim.shafts import PerShaft

if TYPE_CHECKING:
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.fit.plane_fit import PlaneFits
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

FITS = {
    "curves": "loss curves of the own speed",
    "plane": "fits in both speeds",
    "baseline": "calibrated model, neutral and engaged together",
}
"""The fits by name, in the order in which they are listed."""

FEWEST_REPEATS = 3
"""Differences between repeats from which they are the noise that a fit is judged by."""


@dataclass(frozen=True)
class Fitted:
    """A fit as a linear model of its readings, both shafts together.

    Parameters
    ----------
    name : str
        One of `FITS`.
    readings : Readings
        The m readings it was made from.
    design : (m, k) array
        Derivatives of the fitted torques to what was free.
    residual : (m,) array
        Measured minus fitted torque [N m].
    weights : (m,) array
        Weights of the fit; only their ratio within a shaft counts.
    """

    name: str
    readings: Readings
    design: Array
    residual: Array
    weights: Array

    @property
    def torque(self) -> Array:
        """Fitted torques [N m]."""
        return np.asarray(self.readings.torque - self.residual)

    def leverage(self) -> Array:
        """Diagonal of the hat matrix (m,)."""
        basis = orthonormal(self.design * np.sqrt(self.weights)[:, None])
        return np.asarray(np.einsum("ij,ij->i", basis, basis))


@dataclass(frozen=True)
class LackOfFit:
    """A fit's scatter against noise that is known without it.

    Parameters
    ----------
    chi_square, dof, p_value : float
        Sum of squares over the variance of the noise, its degrees of freedom, and the probability of one as large.
    noise : float
        The noise of one reading [N m].
    scatter : float
        Root of the residual sum of squares over the degrees of freedom of the fit [N m].
    source : str
        ``repeats``, ``windows`` or ``rounding``.
    description : str
        Which noise, as a sentence.
    """

    chi_square: float
    dof: float
    p_value: float
    noise: float
    scatter: float
    source: str
    description: str


@dataclass(frozen=True)
class Outlier:
    """A point that lies further out than the others let expect.

    Parameters
    ----------
    row : int
        Reading of the fit.
    surprise : float
        Externally studentised residual [standard deviations].
    p_value : float
        Two-sided, times the number of points looked at.
    looked_at : int
        That number.
    """

    row: int
    surprise: float
    p_value: float
    looked_at: int


def linear_fits(analysis: Analysis, bench: BenchParameters, wanted: tuple[str, ...]) -> tuple[Fitted, ...]:
    """The wanted fits, as far as the analysis made them."""
    found = []
    if analysis.fits is not None and "curves" in wanted:
        found.append(_curves(analysis.grid, analysis.fits))
    if analysis.fits is not None and analysis.plane is not None and "plane" in wanted:
        found.append(_planes(analysis.grid, analysis.fits, analysis.plane, bench))
    if analysis.calibration is not None and "baseline" in wanted:
        readings = take_readings(analysis.grid, bench)
        model = analysis.calibration.model
        design = jacobian(readings, bench, model, analysis.calibration.free)
        residual = readings.torque - predict(readings, bench, model)
        found.append(Fitted("baseline", readings, design, residual, readings.u**-2.0))
    return tuple(found)


def _curves(grid: Grid, fits: LossFits) -> Fitted:
    """The loss curves, one block a shaft; a shaft held at rest has speed 0."""
    at = grid.points
    still = replace(
        at,
        speed_sun=np.where(at.rest_sun, 0.0, at.speed_sun),
        speed_ring=np.where(at.rest_ring, 0.0, at.speed_ring),
    )
    sun, ring = np.flatnonzero(fits.sun.rows), np.flatnonzero(fits.ring.rows)
    readings = Readings(
        grid=replace(grid, points=still),
        row=np.r_[sun, ring],
        sun=np.r_[np.ones(len(sun), dtype=bool), np.zeros(len(ring), dtype=bool)],
        torque=np.r_[grid.torque_sun[sun], grid.torque_ring[ring]],
        u=np.r_[grid.u_sun[sun], grid.u_ring[ring]],
    )
    terms = [fits.sun.curve.terms(still.speed_sun[sun]), fits.ring.curve.terms(still.speed_ring[ring])]
    return Fitted(
        "curves",
        readings,
        _blocks(terms[0], terms[1]) * readings.direction[:, None],
        np.r_[fits.sun.residuals, fits.ring.residuals] * readings.direction,
        np.r_[fits.sun.weights, fits.ring.weights],
    )


def _planes(grid: Grid, fits: LossFits, planes: PlaneFits, bench: BenchParameters) -> Fitted:
    """The loss curves with every term of both speeds that could be tested in addition to them, fitted together."""
    line = _curves(grid, fits)
    added = []
    for fit, plane in ((fits.sun, planes.sun), (fits.ring, planes.ring)):
        added.append(plane_columns(grid, fit, bench)[:, [term.tested for term in plane.terms]])
    design = np.hstack([line.design, _blocks(added[0], added[1]) * line.readings.direction[:, None]])
    root = np.sqrt(line.weights)
    basis = orthonormal(design * root[:, None])
    left = line.residual * root
    return replace(line, name="plane", design=design, residual=(left - basis @ (basis.T @ left)) / root)


def _blocks(sun: Array, ring: Array) -> Array:
    """Two blocks on the diagonal."""
    whole = np.zeros((len(sun) + len(ring), sun.shape[1] + ring.shape[1]))
    whole[: len(sun), : sun.shape[1]] = sun
    whole[len(sun) :, sun.shape[1] :] = ring
    return whole


def lack_of_fit(fit: Fitted, floor: NoiseFloor, bench: BenchParameters, shaft: str) -> LackOfFit:
    r"""Lack of fit of one shaft against repeats, else the rounding of the tables, else the scatter within windows.

    Parameters
    ----------
    fit : Fitted
        The fit.
    floor : NoiseFloor
        What is known of the noise.
    bench : BenchParameters
        Ratio of the stages: engaged, the uncertainty of the ring torque is part of the reading.
    shaft : str
        ``sun`` or ``ring``.

    Notes
    -----
    With r differences between repeats the residual sum of squares splits into pure error and lack of fit,
    :math:`F = \frac{(R - P)/(\nu - r)}{P/r}`, and :math:`\chi^2 = (R - P)/(P/r)`. Against rounding or windows the
    variance is taken as known, :math:`\chi^2 = R/s^2`. Both are lower bounds of the noise, and rounding errors are
    bounded, which makes the p-value of that test too large rather than too small.

    References
    ----------
    N. R. Draper, H. Smith, 'Applied Regression Analysis', 3rd ed., Wiley, 1998, section 2.1.
    """
    readings, is_sun = fit.readings, shaft == "sun"
    mine = readings.sun == is_sun
    noise = floor[shaft]
    step = readings.grid.rounding
    relative = relative_scale(readings, bench, PerShaft(1.0, 1.0)) if step else floor_scale(readings, bench, floor)
    even = np.where(mine, fit.residual / (relative if step else relative / noise.u), 0.0)
    total, free = float(even @ even), float(np.sum(1.0 - fit.leverage()[mine]))
    contrasts = repeat_contrasts(readings)
    ordinary = mine & (readings.configuration != "engaged")
    repeats = contrasts[:, (contrasts[ordinary] != 0.0).any(axis=0)]
    n, pure = repeats.shape[1], float(np.sum((repeats.T @ even) ** 2))
    scatter = math.sqrt(total / free) if free > 0.0 else math.nan
    if n >= FEWEST_REPEATS and pure > 0.0 and free > n:
        chi_square, dof = (total - pure) / (pure / n), free - n
        text = f"against repeats: {n} differences between repeated points"
        if "something changed slowly" in noise.source:
            text += "; they scatter more than what follows no covariate, so something changed between them"
        p = float(stats.f.sf(chi_square / dof, dof, n))
        return LackOfFit(chi_square, dof, p, math.sqrt(pure / n), scatter, "repeats", text)
    if step:
        known, source = step / math.sqrt(12.0), "rounding"
        text = f"against the rounding to {step:g} N m alone, a lower bound: the grid tells of no repeats"
    else:
        known, source = noise.within, "windows"
        text = "against the scatter within the windows, a lower bound: points wander between windows too"
    chi_square = total / known**2
    return LackOfFit(chi_square, free, float(stats.chi2.sf(chi_square, free)), known, scatter, source, text)


def outliers(fit: Fitted, shaft: str, explained: Array | None = None) -> tuple[Outlier, ...]:
    """Points of one shaft that stand out at `FALSE_ALARM_RATE`, most surprising first.

    Parameters
    ----------
    fit : Fitted
        The fit.
    shaft : str
        ``sun`` or ``ring``.
    explained : (m, c) array, optional
        Further columns that the residual is known to follow, taken out first.

    Notes
    -----
    The p-value is multiplied by the number of points of the fit, both shafts together (Bonferroni). Points of which the
    fit leaves less than `MINIMUM_ROOM` are not judged.
    """
    if explained is not None and explained.shape[1]:
        root = np.sqrt(fit.weights)
        basis = orthonormal(np.hstack([fit.design, explained]) * root[:, None])
        left = fit.residual * root
        fit = replace(
            fit,
            design=np.hstack([fit.design, explained]),
            residual=(left - basis @ (basis.T @ left)) / root,
        )
    room = 1.0 - fit.leverage()
    scaled = fit.residual * np.sqrt(fit.weights)
    rows, surprise, dof = studentised(scaled, room, fit.readings.sun == (shaft == "sun"))
    n = len(fit.readings)
    p = np.minimum(2.0 * n * stats.t.sf(np.abs(surprise), dof), 1.0)
    order = np.argsort(p, kind="stable")
    found = [Outlier(int(rows[i]), float(surprise[i]), float(p[i]), n) for i in order if p[i] <= FALSE_ALARM_RATE]
    return tuple(sorted(found, key=lambda one: -abs(one.surprise)))
