"""Noise that is correlated from sample to sample: an autoregression fitted, taken out, drawn anew."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from pmg.pipeline.fit.span import lengths
from pmg.sim.sources import Source

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.sim.signals import Array

MOST_LAGS = 24
"""Longest memory of the noise that is considered, in samples of the regression."""

SAMPLES_PER_LAG = 100
"""Samples that each lag calls for: structure that is projected out leaves a hole at low frequency, which a long memory
fitted to a short record would take for the noise."""

FLOOR = 0.01
"""White part of the noise, over all of it: beyond a low-pass nothing is left, and whitening would weigh that most.

A record low-passed at a third of its thinned rate holds 40 dB less there; 20 dB below the mean keep the rest.
"""

KUENSCH = Source(
    "kuensch",
    "H. R. Künsch, 'The jackknife and the bootstrap for general stationary observations', Annals of Statistics 17(3), "
    "1989, doi:10.1214/aos/1176347265",
)

UNTOLD = 1e-10
"""Part of the largest singular value below which rows without a block do not tell a direction."""


@dataclass(frozen=True)
class SerialNoise:
    r"""Noise :math:`e_t = \sum_j a_j e_{t-j} + \sigma \epsilon_t`.

    Parameters
    ----------
    coefficients : (p,) array
        The :math:`a_j`.
    sigma : float
        Standard deviation of what is new in each sample [N].
    news : (n,) array
        What was new in the samples it was fitted to, in units of `sigma`; resampled by `draw`.
    starts : tuple of int
        Samples with which further recordings begin: the past tells nothing about the first ones of each.
    spread : (n,) array
        Standard deviation of the noise of each row, over that of rows without noise of their own; one where not given.
    """

    coefficients: Array
    sigma: float
    news: Array
    starts: tuple[int, ...] = ()
    spread: Array = field(default_factory=lambda: np.ones(1))

    @property
    def lags(self) -> int:
        """Order of the autoregression."""
        return len(self.coefficients)

    def whiten(self, columns: Array) -> Array:
        """Columns freed from what the past tells (n - p, c), noise of unit variance.

        The first p rows are lost; those of each further recording are zero.
        """
        even = self.even(columns)
        return self.without_joins(
            lfilter(np.r_[1.0, -self.coefficients], [1.0], even, axis=0)[self.lags :] / self.sigma
        )

    def even(self, rows: Array) -> Array:
        """Rows (n,) or (n, c) brought to one standard deviation of noise."""
        return np.asarray((rows.T / self.spread).T)

    def without_joins(self, white: Array) -> Array:
        """Whitened rows (n - p, c), those that mix two recordings zero."""
        white = np.array(white)
        for start in self.starts:
            white[max(start - self.lags, 0) : start] = 0.0
        return white

    def innovations(self, columns: Array) -> Array:
        """Columns freed from what the past tells (n, c), the past of each recording taken as zero."""
        parts = np.split(columns, self.starts)
        return np.concatenate([lfilter(np.r_[1.0, -self.coefficients], [self.sigma], part, axis=0) for part in parts])

    def coloured(self, innovations: Array) -> Array:
        """What has these innovations (n, c): `innovations` undone."""
        parts = np.split(innovations, self.starts)
        return np.concatenate([lfilter([self.sigma], np.r_[1.0, -self.coefficients], part, axis=0) for part in parts])

    def whitened(self, news: Array) -> Array:
        """Whitened rows (n - p, c) of noise in whose last n - p samples this is new (n - p, c), in units of `sigma`.

        It is the same as long as the spread of the rows is: what follows rows of much noise is not known from them.
        """
        begun = np.vstack([np.zeros((self.lags, news.shape[1])), news])
        return self.whiten(lfilter([self.sigma], np.r_[1.0, -self.coefficients], begun, axis=0))

    def new_in(self, residual: Array) -> Array:
        """What is new in the samples of a residual (m,), where the past of all lags is known."""
        news = lfilter(np.r_[1.0, -self.coefficients], [1.0], residual)
        known = np.ones(len(news), dtype=np.bool_)
        for start in (0, *self.starts):
            known[start : start + self.lags] = False
        return np.asarray(news[known])

    def draw(self, length: int, draws: int, rng: np.random.Generator) -> Array:
        """Noise anew (length, draws): what was new is resampled, so that its tails are kept."""
        burn = 20 * (self.lags + 1)
        news = self.sigma * rng.choice(self.news, size=(length + burn, draws))
        return np.asarray(lfilter([1.0], np.r_[1.0, -self.coefficients], news, axis=0)[burn:])

    @property
    def for_one(self) -> float:
        r"""Samples that tell a mean of squares as well as independent ones would, :math:`\sum_k \rho_k^2`."""
        response = lfilter([1.0], np.r_[1.0, -self.coefficients], np.r_[1.0, np.zeros(2000)])
        alike = np.correlate(response, response, mode="full") / float(response @ response)
        return float(alike @ alike)

    @property
    def standard_deviation(self) -> float:
        """Standard deviation of the noise itself [N]."""
        response = lfilter([1.0], np.r_[1.0, -self.coefficients], np.r_[1.0, np.zeros(2000)])
        return float(self.sigma * math.sqrt(float(response @ response)))


def fit_noise(residual: Array, lags: int | None = None, spent: int = 0, starts: tuple[int, ...] = ()) -> SerialNoise:
    """Autoregression of a residual by Yule and Walker; always stable.

    Parameters
    ----------
    residual : (n,) array
        What a regression left [N].
    lags : int, optional
        Order; by Schwarz's criterion up to `MOST_LAGS` when not given.
    spent : int
        Parameters that the regression has used up; they are missing from the variance.
    starts : tuple of int
        Samples with which further recordings begin.
    """
    n = len(residual)
    most = most_lags(n) if lags is None else lags
    covariance = np.array([float(residual[: n - k] @ residual[k:]) / n for k in range(most + 1)])
    if covariance[0] <= 0.0:
        return SerialNoise(np.zeros(0), 1e-12, np.zeros(n), starts)
    coefficients, _ = autoregression(covariance, n, range(most + 1) if lags is None else (most,))
    found = SerialNoise(coefficients, 1.0, np.zeros(0), starts)
    news = found.new_in(residual)
    sigma = math.sqrt(float(news @ news) / max(len(news) - spent - len(coefficients), 1))
    spread = float(np.std(news))
    return replace(found, sigma=sigma, news=(news - news.mean()) / spread if spread > 0.0 else news)


def most_lags(rows: int) -> int:
    """Longest memory that so many rows tell."""
    return min(MOST_LAGS, max(2, rows // SAMPLES_PER_LAG))


def autoregression(covariance: Array, rows: int, orders: Iterable[int]) -> tuple[Array, float]:
    """Coefficients (p,) that Yule and Walker's equations have, and the variance of what is new in each sample.

    Parameters
    ----------
    covariance : (m,) array
        Autocovariance at lags 0, 1, and so on.
    rows : int
        Rows that tell it: of several orders the one that Schwarz's criterion chooses for them.
    orders : iterable of int
        Orders to choose from, each below m.
    """
    floored = covariance.copy()
    floored[0] *= 1.0 + FLOOR
    found = []
    for order in orders:
        a = np.linalg.solve(toeplitz(floored[:order]), floored[1 : order + 1]) if order else np.zeros(0)
        variance = max(float(floored[0] - a @ floored[1 : order + 1]), 1e-300)
        found.append((rows * math.log(variance) + order * math.log(rows), order, a, variance))
    _, _, coefficients, variance = min(found, key=lambda each: each[:2])
    return np.asarray(coefficients), variance


def covariance_of(design: Array, left: Array, values: Array, blocks: int, instruments: Array | None = None) -> Array:
    r"""Covariance of parameters that honours correlation and unequal scatter of what is left: a jackknife of blocks.

    Parameters
    ----------
    design : (n, k) array
        Columns.
    left : (n,) array
        What they leave.
    values : (k,) array
        The parameters.
    blocks : int
        Blocks of neighbours that are left out in turn; what is left is correlated over less than one of them.
    instruments : (n, k) array, optional
        What the rest is orthogonal to; the columns themselves by least squares.

    Notes
    -----
    :math:`\frac{B-1}{B} \sum_b (\hat\theta_{(b)} - \hat\theta)(\hat\theta_{(b)} - \hat\theta)'` with
    :math:`\hat\theta_{(b)}` without block :math:`b` (Künsch 1989). Unlike a sum of scores it is not too small where
    few rows tell a parameter; one that a single block tells is zero without it.
    """
    length = lengths(design)
    unit = design / length
    with_rest = unit if instruments is None else instruments / length
    whole, scaled = with_rest.T @ unit, values * length
    moved = np.zeros((blocks, len(values)))
    for b, rows in enumerate(np.array_split(np.arange(len(left)), blocks)):
        here = whole - with_rest[rows].T @ unit[rows]
        goal = here @ scaled - with_rest[rows].T @ left[rows]
        moved[b] = np.linalg.pinv(here, rcond=UNTOLD) @ goal - scaled
    return np.asarray((blocks - 1.0) / blocks * (moved.T @ moved) / np.outer(length, length))
