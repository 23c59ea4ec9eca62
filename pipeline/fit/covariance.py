"""Covariance of fitted parameters from the slopes of the weighted residuals, free or on their bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pmg.sim.signals import Array

UNDETERMINED = 1e-6
"""Ratio of singular values (columns of unit length) below which a combination of parameters is not determined."""


def free_covariance(design: Array, names: Sequence[str]) -> Array:
    """Covariance (k, k) of parameters inside their bounds, from the slopes (m, k) of the weighted residuals.

    Raises
    ------
    FitError
        The points do not determine them.
    """
    length = np.linalg.norm(design, axis=0)
    _, singular, right = np.linalg.svd(design / np.where(length > 0.0, length, 1.0), full_matrices=False)
    if (length == 0.0).any() or singular[-1] < UNDETERMINED * singular[0]:
        weak = np.abs(right[-1]) > 0.1 if (length > 0.0).all() else length == 0.0
        alike = ", ".join(name for name, is_weak in zip(names, weak, strict=True) if is_weak)
        raise FitError(
            "calibration",
            f"these points do not determine {alike}",
            "engaged points at several speeds, more than there are free constants",
            "Measure more engaged speeds, or hold K_corr with --k-corr.",
        )
    scaled = right.T / singular
    return np.asarray((scaled @ scaled.T) / np.outer(length, length))


def u_predicted(design: Array, covariance: Array) -> Array:
    r"""Standard uncertainty (n,) of what fitted parameters predict, :math:`\sqrt{x_i^T C x_i}`.

    Parameters
    ----------
    design : (n, k) array
        Derivatives of the predictions by the parameters.
    covariance : (k, k) array
        Of the parameters.
    """
    return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", design, covariance, design)))


def covariance_at_bounds(
    design: Array, left: Array, inside: npt.NDArray[np.intp], upward: Array, conditional: Array
) -> Array:
    r"""Second moments of all parameters when some sit on their bounds.

    Parameters
    ----------
    design, left : (m, k), (m,) array
        Slopes of the weighted residuals, and the residuals, at the solution.
    inside : array of int
        Parameters inside their bounds.
    upward : (k,) array
        For those on a bound, 1 where they may only grow, -1 where they may only fall.
    conditional : (k, k) array
        Covariance of those inside with the others held where they are; zero for the others.

    Notes
    -----
    A parameter on its bound is not known to be there: what it may still be, the others have to share. With b held at
    zero, 95 % intervals of K_corr cover three quarters. So each bounded parameter enters with its second moment about
    the bound, that of its normal distribution cut off there: :math:`C = C_{|b} + g g^T\,\mathrm{E}[(b-b_0)^2]`,
    :math:`g = \Sigma_{\cdot b}/\Sigma_{bb}`. Where the points do not determine all of them together, the conditional
    covariance is all there is.
    """
    kept = conditional
    length = np.linalg.norm(design, axis=0)
    if (length == 0.0).any():
        return kept
    unit, singular, right = np.linalg.svd(design / length, full_matrices=False)
    if singular[-1] < UNDETERMINED * singular[0]:
        return kept
    scaled = right.T / singular
    whole = (scaled @ scaled.T) / np.outer(length, length)
    step = -(scaled @ (unit.T @ left)) / length
    for b in np.flatnonzero(upward):
        spread = float(np.sqrt(whole[b, b]))
        beyond = -float(upward[b] * step[b]) / spread
        cut = stats.truncnorm(a=beyond, b=np.inf)
        second = float(cut.var() + (cut.mean() - beyond) ** 2) * spread**2
        lever = np.zeros(len(whole))
        lever[inside], lever[b] = whole[inside, b] / whole[b, b], 1.0
        kept = kept + np.outer(lever, lever) * second
    return np.asarray(kept)
