"""How far the mean of a short stretch of correlated noise may lie from the truth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from pmg.sim.sources import Source

if TYPE_CHECKING:
    from pmg.sim.signals import Array

BERGER_YANG = Source(
    "berger-yang",
    "J. O. Berger, R.-Y. Yang, 'Noninformative priors and Bayesian testing for the AR(1) model', Econometric Theory "
    "10(3-4), 1994",
)

FEWEST_PIECES = 8
"""Pieces below which nothing is said about correlation."""
LONGEST_MEMORY = 0.3
"""Longest correlation time that is considered, as part of the stretch; what lasts longer is a drift and no noise."""
SHORTEST_MEMORY = 0.2
"""Shortest one, in pieces; below it pieces are as good as independent."""
MEMORIES = 24
"""Correlation times that are weighed, equally spaced in their logarithm, beside none at all."""
INDEPENDENT = 3.0
"""Weight of no correlation at all before the data are seen, where each of the others has 1."""
HALVINGS = 50
"""Steps of the search for the half-width of an interval."""


@dataclass(frozen=True)
class SerialMean:
    """The uncertainty of a mean in the presence of correlation.

    Parameters
    ----------
    u : float
        Half of the interval that holds 68.3 % over the quantile of Student's t: a standard uncertainty.
    dof : float
        Degrees of freedom with which `u` gives the 95 % interval as well.
    memory : float
        Correlation time as part of the stretch, the median of what the data leave possible.
    """

    u: float
    dof: float
    memory: float


@dataclass(frozen=True)
class _Forms:
    """Correlation of m pieces for each memory: whitening (g, m, m), what it makes of ones (g, m), half log |C| (g,)."""

    memories: Array
    whiten: Array
    ones: Array
    half_log: Array


def serial_mean(pieces: Array) -> SerialMean | None:
    r"""Uncertainty of the mean of equal consecutive pieces of a stretch.

    Parameters
    ----------
    pieces : (m,) array
        Mean of each piece.

    Returns
    -------
    SerialMean or None
        None with fewer than `FEWEST_PIECES`, or where all are equal.

    Notes
    -----
    The noise is taken to be of first order, :math:`\rho(t) = e^{-t/\tau}`, averaged over pieces of length d. With
    :math:`a = d/\tau` the covariance of pieces k apart is :math:`(1-e^{-a})^2 e^{-(k-1)a}/a^2`, that of a piece with
    itself :math:`2(a-1+e^{-a})/a^2`. For each memory the truth given the pieces follows Student's t with m - 1
    degrees of freedom about the generalised mean; the memories are weighed by
    :math:`|C|^{-1/2} (1^T C^{-1} 1)^{-1/2} S^{-(m-1)/2}`, the likelihood with mean and size integrated out. The
    interval is that of the mixture, laid about the plain mean. A memory of which little is known widens it, which a
    single estimate of the memory, too short more often than not, would not do.

    References
    ----------
    `BERGER_YANG`; their prior of the memory is replaced by one that is even in its logarithm, within the bounds above.
    """
    m = len(pieces)
    if m < FEWEST_PIECES or not np.ptp(pieces) > 0.0:
        return None
    forms = _forms(m)
    middle = float(pieces.mean())
    white = forms.whiten @ (pieces - middle)
    precision = np.sum(forms.ones**2, axis=-1)
    off = np.sum(forms.ones * white, axis=-1) / precision
    rest = np.sum((white - off[:, None] * forms.ones) ** 2, axis=-1)
    log_weight = -forms.half_log - 0.5 * np.log(precision) - 0.5 * (m - 1) * np.log(rest)
    log_weight[0] += np.log(INDEPENDENT)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    scale = np.sqrt(rest / (m - 1) / precision)
    inner, outer = (_half_width(level, weight, off, scale, m - 1) for level in (_ONE_SIGMA, 0.95))
    dof = _dof_of(outer / inner, m - 1)
    memory = float(np.interp(0.5, np.cumsum(weight), forms.memories))
    return SerialMean(inner / float(special.stdtrit(dof, 0.5 + _ONE_SIGMA / 2.0)), dof, memory)


_ONE_SIGMA = 0.6826894921370859


@lru_cache(maxsize=64)
def _forms(m: int) -> _Forms:
    memories = np.r_[0.0, np.geomspace(SHORTEST_MEMORY / m, LONGEST_MEMORY, MEMORIES)]
    lag = np.abs(np.subtract.outer(np.arange(m), np.arange(m))).astype(np.float64)
    whiten: list[Array] = [np.eye(m)]
    half_log = [0.0]
    for memory in memories[1:]:
        a = 1.0 / (m * memory)
        fall = -np.expm1(-a)
        itself = 2.0 * (a - fall)
        apart = fall**2 * np.exp(-(np.maximum(lag, 1.0) - 1.0) * a)
        lower = np.linalg.cholesky(np.where(lag > 0.0, apart / itself, 1.0))
        whiten.append(np.asarray(np.linalg.inv(lower)))
        half_log.append(float(np.log(np.diag(lower)).sum()))
    stacked = np.array(whiten)
    return _Forms(memories, stacked, stacked.sum(axis=-1), np.array(half_log))


def _half_width(level: float, weight: Array, off: Array, scale: Array, dof: int) -> float:
    """Half-width about zero that holds this part of a mixture of Student's t."""
    low, high = 0.0, 100.0 * float(np.max(scale + np.abs(off)))
    for _ in range(HALVINGS):
        half = 0.5 * (low + high)
        inside = special.stdtr(dof, (half - off) / scale) - special.stdtr(dof, (-half - off) / scale)
        low, high = (low, half) if float(weight @ inside) > level else (half, high)
    return 0.5 * (low + high)


def _dof_of(ratio: float, most: int) -> float:
    """Degrees of freedom at which the 95 % half-width of Student's t is that many times the 68.3 % one."""
    dof = np.geomspace(1.0, most, 200)
    ratios = special.stdtrit(dof, 0.975) / special.stdtrit(dof, 0.5 + _ONE_SIGMA / 2.0)
    return float(np.interp(-ratio, -ratios, dof))
