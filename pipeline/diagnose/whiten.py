"""Noise that is correlated from point to point, made white, and made anew."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnose.noise import NoiseFloor
    from pmg.pipeline.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

CORRELATIONS = np.arange(0.0, 0.71, 0.05)
"""Neighbour correlations considered; above the last it is drift, not noise."""

NO_CORRELATION = np.r_[1.0, np.zeros(len(CORRELATIONS) - 1)]
"""Weights of a campaign whose order is not known, or that is too small to tell."""


@dataclass(frozen=True)
class Chain:
    r"""Readings of one shaft in the order of the test, as links of a first-order autoregression.

    Parameters
    ----------
    rows : (k,) array of int
        The readings, in order.
    lag : (k - 1,) array
        Points of the campaign from each to the next.

    Notes
    -----
    Noise with correlation :math:`\rho^{\mathrm{lag}}` is a Markov chain: what is new in a link is
    :math:`(x_k - \rho^{l} x_{k-1}) / \sqrt{1 - \rho^{2l}}`, white and of the same variance.
    """

    rows: npt.NDArray[np.int64]
    lag: Array

    def whiten(self, columns: Array, rho: float) -> Array:
        """What is new in each link (k, c)."""
        keep = (rho**self.lag)[:, None]
        out = columns.copy()
        out[1:] = (columns[1:] - keep * columns[:-1]) / np.sqrt(1.0 - keep**2)
        return out

    def colour(self, white: Array, rho: float) -> Array:
        """The noise whose links bring this news; the inverse of `whiten`."""
        keep = rho**self.lag
        out = white.copy()
        for k, part in enumerate(keep, start=1):
            out[k] = part * out[k - 1] + math.sqrt(1.0 - part**2) * white[k]
        return out

    def log_determinant(self, rho: float) -> float:
        """Logarithm of the determinant of the correlation matrix."""
        return float(np.sum(np.log1p(-(rho ** (2.0 * self.lag)))))


def chain_of(readings: Readings, sun: bool) -> Chain:
    """The chain of one shaft's readings; the order of the test must be known."""
    position = np.empty(len(readings.grid))
    position[np.argsort(readings.grid.points.started_at, kind="stable")] = np.arange(len(readings.grid))
    rows = np.flatnonzero(readings.sun == sun)
    rows = rows[np.argsort(position[readings.row[rows]], kind="stable")]
    return Chain(rows, np.diff(position[readings.row[rows]]))


@dataclass(frozen=True)
class Whitener:
    """Makes the noise of the readings white, with unit standard deviation.

    Parameters
    ----------
    scale : (m,) array
        Standard deviation of each reading [N m].
    chains : tuple of (Chain, float)
        Per shaft, its chain and the correlation of neighbours.
    """

    scale: Array
    chains: tuple[tuple[Chain, float], ...]

    def __call__(self, values: Array) -> Array:
        """Whitened columns of a vector or matrix over the readings."""
        out = values.reshape(len(values), -1) / self.scale[:, None]
        for chain, rho in self.chains:
            out[chain.rows] = chain.whiten(out[chain.rows], rho)
        return out.reshape(values.shape)


def undo(white: Whitener, values: Array) -> Array:
    """The effect [N m] whose whitened form this vector is."""
    out = values.copy()
    for chain, rho in white.chains:
        out[chain.rows] = chain.colour(out[chain.rows, None], rho)[:, 0]
    return out * white.scale


def relative_scale(readings: Readings, bench: BenchParameters, sigma: dict[bool, float]) -> Array:
    """Standard deviation of each reading [N m] from that of the two transducers' points."""
    at = readings.grid.points
    ratio = np.where(at.gear == 1, bench.gear1.ratio, bench.gear2.ratio)[readings.row]
    engaged = readings.configuration == "engaged"
    own = np.where(readings.sun, sigma[True], sigma[False])
    return np.where(engaged, np.hypot(own, sigma[False] / ratio), own)


def whitener(readings: Readings, bench: BenchParameters, floor: NoiseFloor) -> Whitener:
    """Whitener for noise of a floor's size and neighbour correlation."""
    scale = relative_scale(readings, bench, {True: floor.sun.u, False: floor.ring.u})
    if not readings.grid.points.ordered:
        return Whitener(scale, ())
    shafts = ((True, floor.sun), (False, floor.ring))
    return Whitener(scale, tuple((chain_of(readings, sun), noise.correlation) for sun, noise in shafts))


def synthetic_noise(
    readings: Readings,
    floor: NoiseFloor,
    white: Whitener,
    draws: int,
    rng: np.random.Generator,
    *,
    fitted: Array | None = None,
) -> Array:
    """Whitened noise of synthetic campaigns (m, draws).

    The neighbour correlation of each is drawn from its weights while the whitening keeps to their mean, so that not
    knowing it exactly is part of the test's distribution. Published tables are rounded: there the `fitted` torques
    of the baseline get noise and are rounded alike, since points of equal torque share their rounding error, which
    looks like structure and is none.
    """
    step = readings.grid.rounding
    if step > 0.0 and fitted is not None:
        return white(_rounded(readings, floor, fitted, step, draws, rng))
    out = rng.standard_normal((len(readings), draws))
    for (chain, rho), noise in zip(white.chains, (floor.sun, floor.ring), strict=False):
        which = rng.choice(len(CORRELATIONS), size=draws, p=noise.correlation_weights)
        for k in np.unique(which):
            columns = np.ix_(chain.rows, np.flatnonzero(which == k))
            out[columns] = chain.whiten(chain.colour(out[columns], float(CORRELATIONS[k])), rho)
    return out


def _rounded(
    readings: Readings, floor: NoiseFloor, fitted: Array, step: float, draws: int, rng: np.random.Generator
) -> Array:
    """Deviations of noisy and rounded torques from the fitted ones (m, draws) [N m]."""
    of_rounding = step / math.sqrt(12.0)
    size = np.where(readings.sun, floor.sun.u, floor.ring.u)
    own = np.sqrt(np.maximum(size**2 - of_rounding**2, (0.1 * step) ** 2))
    noisy = fitted[:, None] + own[:, None] * rng.standard_normal((len(readings), draws))
    return np.asarray(np.round(noisy / step) * step - fitted[:, None])
