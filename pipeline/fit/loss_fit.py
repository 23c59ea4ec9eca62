"""Least-squares fits of the neutral loss torques, shaft by shaft, with the terms the user chooses."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.covariance import u_predicted
from pmg.pipeline.fit.robust import huber_weights, sandwich
from pmg.pipeline.wording.option_words import check_powers
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import FitError
from pmg.sim.losscurve import SPEED_REFERENCE_RING, SPEED_REFERENCE_SUN, LossCurve
from pmg.sim.shafts import PerShaft, per_shaft

if TYPE_CHECKING:
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array, Mask

DEFAULT_POWERS = (0.0, 0.5, 1.0, 2.0)
"""Constant (seals, hysteresis), root (lubricated bearings), linear (viscous, eddy) and square (windage) term.

On drag that grows like a power of speed between 0.3 and 0.7, these four stay within 0.05 mN m where the thesis's
polynomials of degree three and four leave 0.3 to 1 mN m."""

THESIS_POWERS_SUN = (0.0, 1.0, 2.0, 3.0)
"""Sun curve that reproduces the thesis's simulated torques best."""

THESIS_POWERS_RING = (0.0, 1.0, 2.0, 3.0, 4.0)
"""Ring curve that reproduces the thesis's simulated torques best."""

ALIKE = 1e-8
"""Ratio of singular values (columns of unit length) below which two terms cannot be separated."""


@dataclass(frozen=True)
class ShaftDrag:
    """Drag readings of one shaft in neutral.

    Parameters
    ----------
    shaft : str
        ``sun`` or ``ring``.
    speed : (n,) array
        Own speed [rad/s]; 0 where the shaft is held at rest.
    drag : (n,) array
        sgn(speed) times torque [N m].
    rows : (n,) array of bool
        Rows of the grid that take part in a fit.
    reference : float
        Speed that makes the terms dimensionless [rad/s].
    """

    shaft: str
    speed: Array
    drag: Array
    rows: Mask
    reference: float

    @property
    def levels(self) -> Array:
        """Magnitude of the speed [rad/s], rounded to 0.1 rad/s: readings of one level were taken at one speed."""
        return np.asarray(np.round(np.abs(self.speed), 1), dtype=np.float64)


@dataclass(frozen=True)
class LossFit:
    """A fitted loss curve and how good it is.

    Parameters
    ----------
    shaft : str
        ``sun`` or ``ring``.
    curve : LossCurve
        The curve [N m].
    covariance : (k, k) array
        Covariance of its coefficients [N m squared], from the scatter about the curve.
    residuals : (m,) array
        Measured minus fitted drag [N m], at the rows used.
    rows : (n,) array of bool
        Rows of the grid that were used.
    r_squared : float
        Coefficient of determination.
    rmse : float
        Root of the (weighted) residual sum of squares over the degrees of freedom [N m].
    error_thesis : float
        The thesis's own measure, equation 4.1: sqrt(sum of squares)/n [N m].
    aicc : float
        Akaike's criterion, corrected for small samples (Burnham and Anderson 2002, section 2.4); NaN for a robust
        fit, which has no likelihood.
    weights : (m,) array
        Weights of the rows used: relative ones of geometric mean 1, times Huber's for a robust fit.
    weighted : bool
        Whether the relative weights differ from row to row.
    robust : bool
        Whether it is Huber's M-estimate.
    down_weighted : int
        Readings whose residual is past 1.345 robust standard deviations; 0 for least squares.
    """

    shaft: str
    curve: LossCurve
    covariance: Array
    residuals: Array
    rows: Mask
    r_squared: float
    rmse: float
    error_thesis: float
    aicc: float
    weights: Array
    weighted: bool = False
    robust: bool = False
    down_weighted: int = 0

    @property
    def standard_errors(self) -> Array:
        """Standard errors of the coefficients [N m]."""
        return np.sqrt(np.diag(self.covariance))

    def u_curve(self, speed: Array) -> Array:
        """Standard uncertainty of the curve at some speeds [N m] by the scatter about it."""
        return u_predicted(self.curve.terms(speed), self.covariance)

    @property
    def dof(self) -> int:
        """Degrees of freedom left."""
        return len(self.residuals) - len(self.curve.powers)


@dataclass(frozen=True)
class LossFits(PerShaft[LossFit]):
    """The two curves that the neutral tests give."""


def shaft_drags(grid: Grid, *, include_rest: bool = False) -> PerShaft[ShaftDrag]:
    """Drag readings of sun and ring at the accepted neutral rows; readings at rest only where asked for."""
    at = grid.points
    use = at.neutral & grid.accepted
    reference = PerShaft(SPEED_REFERENCE_SUN, SPEED_REFERENCE_RING)

    def drag(side: str) -> ShaftDrag:
        speed, rest = at.speed[side], at.rest[side]
        direction = np.where(rest, 1.0, np.sign(speed))
        rows = use if include_rest else use & ~rest
        return ShaftDrag(side, np.where(rest, 0.0, speed), direction * grid.torque[side], rows, reference[side])

    return per_shaft(drag)


def relative_weights(weights: Array | None, rows: Mask) -> Array:
    """Weights of the chosen rows, brought to geometric mean 1; all 1 where none are given."""
    if weights is None:
        return np.ones(int(rows.sum()))
    chosen = weights[rows]
    if not (np.isfinite(chosen) & (chosen > 0.0)).all():
        raise FitError("weights of a loss fit", "one that is not positive", "positive numbers", "Check the grid.")
    return np.asarray(chosen / np.exp(np.mean(np.log(chosen)))) if len(chosen) else chosen


def point_weights(grid: Grid) -> tuple[Array, Array] | None:
    """Weights 1/u^2 of every row for sun and ring [(N m)^-2]; None where the neutral points are equally uncertain."""
    use = grid.points.neutral & grid.accepted
    u = grid.u_sun[use], grid.u_ring[use]
    known = all(bool((np.isfinite(x) & (x > 0.0)).all()) for x in u)
    if not known or all(len(x) == 0 or float(np.ptp(x)) <= 1e-9 * float(x.max()) for x in u):
        return None
    safe = [np.where(use, x, 1.0) for x in (grid.u_sun, grid.u_ring)]
    return safe[0] ** -2.0, safe[1] ** -2.0


def _solved(shaft: str, design: Array, measured: Array) -> tuple[Array, Array, Array]:
    """Coefficients of least squares, a root of their moments, and the lengths of the columns (k,).

    The moments are those of columns of length 1, for unit variance.
    """
    k = design.shape[1]
    coefficients, _, rank, _ = np.linalg.lstsq(design, measured, rcond=None)
    if rank < k:
        raise FitError(
            f"loss fit of the {shaft}",
            f"rank {rank}",
            f"rank {k}",
            "Choose fewer terms: these are alike here.",
        )
    length = np.linalg.norm(design, axis=0)
    _, singular, right = np.linalg.svd(design / length, full_matrices=False)
    if singular[-1] < ALIKE * singular[0]:
        raise FitError(
            f"loss fit of the {shaft}",
            f"{k} terms that are alike over these speeds",
            "terms that can be separated",
            "Choose fewer terms, or powers further apart.",
        )
    return np.asarray(coefficients, dtype=np.float64), right.T / singular, length


def _aicc(residuals: Array, weight: Array, k: int) -> float:
    """Akaike's criterion, corrected for few readings, of a fit of k terms; NaN where the readings do not give it."""
    n, largest = len(residuals), float(np.abs(residuals).max())
    if n <= k + 2 or largest <= 0.0:
        return math.nan
    mean_square = float(weight @ (residuals / largest) ** 2) / n  # the squares of small residuals would underflow
    return n * (2.0 * math.log(largest) + math.log(mean_square)) + 2.0 * (k + 1) + 2.0 * (k + 1) * (k + 2) / (n - k - 2)


def _fit_one(reading: ShaftDrag, powers: tuple[float, ...], weights: Array | None, robust: bool) -> LossFit:
    shaft, speed, rows = reading.shaft, reading.speed, reading.rows
    n, k = int(rows.sum()), len(powers)
    levels = len(np.unique(reading.levels[rows])) if n else 0
    if n <= k + 1 or levels < k:
        raise FitError(
            f"loss fit of the {shaft}",
            f"{counted(n, 'neutral point')} at {counted(levels, 'speed')}",
            f"at least {k + 2} points at {counted(k, 'speed')} or more for {counted(k, 'term')}",
            "Measure more speeds, or choose fewer terms.",
        )
    curve = LossCurve(powers, np.zeros(k), reading.reference, float(np.abs(speed[rows]).max()))
    terms, measured = curve.terms(speed[rows]), reading.drag[rows]
    weight = relative_weights(weights, rows)
    factors, scale = huber_weights(terms, measured, weight) if robust else (np.ones(n), 0.0)
    root = np.sqrt(weight * factors)
    design = terms * root[:, None]
    coefficients, inverse, length = _solved(shaft, design, measured * root)
    covariance = (inverse @ inverse.T) / np.outer(length, length)
    residuals = measured - terms @ coefficients
    rss = float(weight @ residuals**2)
    covariance = covariance * rss / (n - k)
    if scale > 0.0:
        root = np.sqrt(weight)
        covariance = sandwich(terms * root[:, None] / length, residuals * root, scale) / np.outer(length, length)
    about_mean = float(weight @ (measured - np.average(measured, weights=weight)) ** 2)
    return LossFit(
        shaft=shaft,
        curve=replace(curve, coefficients=coefficients),
        covariance=covariance,
        residuals=residuals,
        rows=rows,
        r_squared=1.0 - rss / about_mean if about_mean > 0.0 else math.nan,
        rmse=math.sqrt(rss / (n - k)),
        error_thesis=math.sqrt(float(residuals @ residuals)) / n,
        aicc=math.nan if robust else _aicc(residuals, weight, k),
        weights=weight * factors,
        weighted=bool(np.ptp(weight) > 1e-9),
        robust=robust,
        down_weighted=int((factors < 1.0).sum()),
    )


def fit_losses(
    grid: Grid,
    powers_sun: tuple[float, ...] = DEFAULT_POWERS,
    powers_ring: tuple[float, ...] = DEFAULT_POWERS,
    *,
    include_rest: bool = False,
    weights: tuple[Array, Array] | None = None,
    robust: bool = False,
) -> LossFits:
    r"""Loss curves :math:`T_{bs}(n_s)` and :math:`T_{br}(n_r)` of the neutral points.

    Parameters
    ----------
    grid : Grid
        Measured torques; its accepted neutral rows are used.
    powers_sun, powers_ring : tuple of float
        Exponents of the speed; 0.5 is allowed.
    include_rest : bool
        Use the readings of a shaft at rest too. They are static reactions, not drag, so the default leaves them
        out; the thesis's curves come out with them in.
    weights : tuple of two (n,) arrays, optional
        Relative weights of every row, sun and ring, such as `point_weights` gives once the noise floor is known.
        Without them every row counts the same: the wander between points outweighs what differs from window to window.
    robust : bool
        Huber's M-estimate instead of least squares: readings far from the curve count less, and the covariance is the
        sandwich's, which does not rest on normal noise.

    Raises
    ------
    FitError
        Too few points or speeds for the terms, or terms that these speeds cannot tell apart.

    Notes
    -----
    Least squares (thesis, section 4.2.3) of the drag :math:`\mathrm{sgn}(\omega)\,T`, :math:`\sum_i w_i r_i^2`; its
    coefficients have no bounds. The thesis's error measure and R squared are those of the same residuals.
    """
    sun, ring = shaft_drags(grid, include_rest=include_rest)
    of_sun, of_ring = weights if weights is not None else (None, None)
    return LossFits(
        sun=_fit_one(sun, check_powers(powers_sun), of_sun, robust),
        ring=_fit_one(ring, check_powers(powers_ring), of_ring, robust),
    )
