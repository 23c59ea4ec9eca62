"""Robust fits by Huber and by Tukey's bisquare, and how far a reading lies out of what the others say."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.errors import FitError, UnsettledFitError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

HUBER = 1.345
"""Huber's tuning constant: 95 % efficiency under normal noise."""

MINIMUM_ROOM = 0.2
"""Part of a reading's standard deviation that the fit must leave before it can be called an outlier."""

MAD = 0.6745
"""Median of the magnitude of a standard normal variable."""


def huber_weights(design: Array, measured: Array, weights: Array) -> tuple[Array, float]:
    r"""Weights and scale of Huber's M-estimate, by iteratively reweighted least squares.

    Parameters
    ----------
    design : (m, k) array
        Terms.
    measured : (m,) array
        Drag [N m].
    weights : (m,) array
        Relative weights that the readings have anyway.

    Returns
    -------
    factors : (m,) array
        :math:`\psi(t)/t = \min(1, 1.345/|t|)` with :math:`t_i = \sqrt{w_i}\,r_i/s`.
    scale : float
        Robust standard deviation s [N m], median of :math:`|\sqrt{w_i}\,r_i|` over 0.6745; 0 where more than half of
        the readings lie on the curve, and then nothing is down-weighted.

    References
    ----------
    P. J. Huber, E. M. Ronchetti, 'Robust Statistics', 2nd ed., Wiley, 2009, sections 7.3 and 7.8.
    """
    root = np.sqrt(weights)
    X, y = design * root[:, None], measured * root
    factors, scale = np.ones(len(y)), 0.0
    for _ in range(200):
        part = np.sqrt(factors)
        coefficients, *_ = np.linalg.lstsq(X * part[:, None], y * part, rcond=None)
        magnitude = np.abs(y - X @ coefficients)
        scale = float(np.median(magnitude)) / MAD
        if scale <= 1e-12 * float(np.abs(y).max(initial=1e-300)):
            return np.ones(len(y)), 0.0
        new = np.minimum(1.0, HUBER * scale / np.maximum(magnitude, 1e-300))
        if float(np.abs(new - factors).max()) < 1e-10:
            break
        factors = new
    return factors, scale


def sandwich(X: Array, residuals: Array, scale: float) -> Array:
    r"""Covariance of Huber's M-estimate (k, k) [squared unit of the residuals].

    Parameters
    ----------
    X : (m, k) array
        Terms, times the root of the relative weights.
    residuals : (m,) array
        Measured minus fitted, times the same root.
    scale : float
        Robust standard deviation s of the residuals.

    Notes
    -----
    :math:`A^{-1} B A^{-1}` with :math:`A = X^T D X`, D marking the readings that are not down-weighted, and
    :math:`B = X^T\mathrm{diag}(\psi_i^2 / (1 - h_i)) X` with :math:`\psi_i = \max(-1.345 s, \min(r_i, 1.345 s))` and
    the leverage :math:`h_i` of the former. No assumption is made about the noise but independence.

    References
    ----------
    Huber and Ronchetti 2009, section 7.6; the leverage as in HC2 of J. G. MacKinnon, H. White, Journal of Econometrics
    29, 1985, doi:10.1016/0304-4076(85)90158-7.
    """
    limit = HUBER * scale
    inside = np.abs(residuals) <= limit
    inverse = np.linalg.pinv((X * inside[:, None]).T @ X, hermitian=True)
    leverage = np.where(inside, np.einsum("ij,jk,ik->i", X, inverse, X), 0.0)
    spread = np.clip(residuals, -limit, limit) ** 2 / np.maximum(1.0 - leverage, 1e-6)
    return np.asarray(inverse @ ((X * spread[:, None]).T @ X) @ inverse)


BISQUARE = 4.685
"""Tuning constant of the bisquare: 95 % efficiency under normal noise."""

SETTLED = 1e-7
"""Change of the weights below which they are settled."""

SWINGING = 40
"""Turns after which the scale is held: until then it may swing between two fits, and the weights with it."""

MOST = 2000
"""Turns after which the fit is given up."""

EXACT = 1e-10
"""Scale, as part of the largest reading, below which the fit is exact and nothing is down-weighted."""


@dataclass(frozen=True)
class BisquareWeights:
    """Weights on which a fit and its residuals agree.

    Parameters
    ----------
    weights : (m,) array
        From 0 to 1.
    scale : float
        Robust standard deviation of the readings, in their unit; 0 where the fit is exact.
    sigma : float
        Standard deviation that stands for the residual mean square: what a coefficient's covariance is scaled by.
    """

    weights: Array
    scale: float
    sigma: float


def _leverages(design: Array) -> Array:
    """Leverage of each reading (m,): diagonal of the projection on the columns of `design` (m, k)."""
    length = np.linalg.norm(design, axis=0)
    basis, _ = np.linalg.qr(design / np.where(length > 0.0, length, 1.0))
    return np.asarray(np.minimum(np.einsum("ij,ij->i", basis, basis), 1.0 - 1e-9))


def bisquare_weights(
    refit: Callable[[Array, Array], tuple[Array, Array]], start: Array, design: Array, size: float
) -> BisquareWeights:
    r"""Weights by iteratively reweighted least squares.

    Parameters
    ----------
    refit : callable
        Least squares with weights (m,), from the last values (k,) on: new values, and the residuals (m,) that they
        leave. One step towards the minimum is enough, as the next turn goes on from there.
    start : (k,) array
        Values from which the first turn begins.
    design : (m, k) array
        Slopes of the fit, for the leverages; those of constants on a bound as well.
    size : float
        Largest reading, in the unit of the residuals.

    Raises
    ------
    FitError
        There are no more readings than constants.
    UnsettledFitError
        The weights do not settle.

    Notes
    -----
    :math:`w_i = (1 - u_i^2)^2` for :math:`|u_i| < 1`, else 0, with :math:`u_i = r_i / (4.685\,s\sqrt{1 - h_i})` (A. E.
    Beaton, J. W. Tukey, Technometrics 16, 1974; Holland and Welsch 1977). The scale s is the median of the adjusted
    magnitudes over 0.6745, counted from the k-th smallest on: a fit of k constants makes about as many residuals
    small. :math:`h_i` are the leverages of the unweighted slopes. Where the scale does not settle it is held at its
    mean; from then on each turn lowers the sum of the bisquare's losses.

    For the standard deviation, with :math:`\psi(u) = u(1 - u^2)^2`, :math:`a = \overline{\psi'}` and
    :math:`\lambda = 1 + \frac{k}{m}\frac{1 - a}{a}`,

    .. math:: \hat\sigma = \lambda\,\frac{4.685\,s}{a}\sqrt{\frac{\sum_i (1 - h_i)\,\psi(u_i)^2}{m - k}}

    (DuMouchel and O'Brien 1989; the factor :math:`\lambda` as in Street, Carroll and Ruppert 1988), so that
    :math:`(m - k)\,\hat\sigma^2` stands for the sum of squares.

    References
    ----------
    P. W. Holland, R. E. Welsch, 'Robust regression using iteratively reweighted least-squares', Communications in
    Statistics A6, 1977, 813-827, doi:10.1080/03610927708827533.

    W. DuMouchel, F. O'Brien, 'Integrating a robust option into a multiple regression computing environment', Computer
    Science and Statistics: Proceedings of the 21st Symposium on the Interface, American Statistical Association, 1989.

    J. O. Street, R. J. Carroll, D. Ruppert, 'A note on computing robust regression estimates via iteratively
    reweighted least squares', The American Statistician 42, 1988, 152-154.
    """
    m, k = design.shape
    if m <= k:
        raise FitError("bisquare weights", f"{m} readings for {k} constants", "more readings", "Use least squares.")
    leverage = _leverages(design)
    weights, values, scales = np.ones(m), start, []
    for turn in range(MOST):
        values, residuals = refit(weights, values)
        adjusted = residuals / np.sqrt(1.0 - leverage)
        if turn < SWINGING:
            scales.append(float(np.median(np.sort(np.abs(adjusted))[k - 1 :])) / MAD)
        scale = scales[-1] if turn < SWINGING else float(np.mean(scales[SWINGING // 2 :]))
        if scale <= EXACT * size:
            return BisquareWeights(np.ones(m), 0.0, 0.0)
        u = adjusted / (BISQUARE * scale)
        new = np.where(np.abs(u) < 1.0, (1.0 - u**2) ** 2, 0.0)
        if float(np.abs(new - weights).max()) < SETTLED:
            return BisquareWeights(new, scale, _sigma(u, leverage, BISQUARE * scale, k))
        weights = new
    came = f"no rest after {MOST} turns"
    raise UnsettledFitError("bisquare weights", came, "weights that settle", "Use least squares.")


def _sigma(u: Array, leverage: Array, unit: float, k: int) -> float:
    """Standard deviation of DuMouchel and O'Brien from the residuals in units of the limit."""
    inside = np.abs(u) < 1.0
    psi = np.where(inside, u * (1.0 - u**2) ** 2, 0.0)
    slope = float(np.mean(np.where(inside, (1.0 - u**2) * (1.0 - 5.0 * u**2), 0.0)))
    if slope <= 0.0:
        came = "readings that lie in two groups"
        raise UnsettledFitError("bisquare weights", came, "one group", "Use least squares.")
    m = len(u)
    spread = math.sqrt(float(np.sum((1.0 - leverage) * psi**2)) / (m - k))
    return (1.0 + k / m * (1.0 - slope) / slope) * spread * unit / slope


def studentised(left: Array, room: Array, group: Mask) -> tuple[npt.NDArray[np.intp], Array, float]:
    r"""Rows of a group that a fit leaves room, how far each lies out [standard deviations], and degrees of freedom.

    Parameters
    ----------
    left : (m,) array
        What the fit leaves, weighted.
    room : (m,) array
        Part of each row's variance that it leaves: one less the leverage.
    group : (m,) array of bool
        Rows whose scatter is estimated together.

    Notes
    -----
    :math:`t_i = e_i / (s_{(i)} \sqrt{1 - h_i})` with the scatter :math:`s_{(i)}` of the other rows has Student's
    distribution with one degree of freedom less than the fit. None is judged where the fit leaves two or fewer.

    References
    ----------
    R. D. Cook, S. Weisberg, 'Residuals and Influence in Regression', Chapman and Hall, 1982, section 2.2.
    """
    rows = np.flatnonzero(group & (room > MINIMUM_ROOM**2))
    dof, total = float(np.sum(room[group])) - 1.0, float(left[group] @ left[group])
    if dof <= 1.0 or total <= 0.0:
        return rows[:0], left[:0], dof
    others = np.maximum(total - left[rows] ** 2 / room[rows], 1e-300) / dof
    return rows, left[rows] / np.sqrt(others * room[rows]), dof
