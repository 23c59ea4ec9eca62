"""Huber's M-estimate: readings far from the curve count less, and the covariance does not rest on normal noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pmg.sim.signals import Array

HUBER = 1.345
"""Huber's tuning constant: 95 % efficiency under normal noise."""

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
