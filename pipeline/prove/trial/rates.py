"""Rates with their intervals, and the curve of detection against size."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats
from scipy.optimize import minimize
from scipy.special import expit, log_expit

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Mask

COVERAGE = 0.95
"""Of every interval."""
EDGES = (0.0, 0.2, 0.35, 0.75, 1.5, 3.0, 6.0, math.inf)
"""Bounds of the bins of size [sigma]; between them lie the sizes that are drawn."""
SMALLEST = 0.01
"""Sizes below count as this one, so that they have a logarithm [sigma]."""
WIDEST = 3.0
"""Half-width of the interval of a size, in its logarithm, beyond which it tells nothing."""
STEEPEST = 20.0
"""Bound of the slope, which has no largest value where no size is both detected and missed."""


@dataclass(frozen=True)
class Rate:
    """So many out of so many."""

    hits: int
    of: int

    @property
    def value(self) -> float | None:
        """The rate; None of none."""
        return self.hits / self.of if self.of else None

    @property
    def interval(self) -> tuple[float, float] | None:
        """Clopper and Pearson's interval, which holds the true rate at least as often as it says."""
        if not self.of:
            return None
        found = stats.binomtest(self.hits, self.of).proportion_ci(COVERAGE, method="exact")
        return float(found.low), float(found.high)


def count(mask: Mask | list[bool]) -> Rate:
    """How many are true."""
    return Rate(int(np.sum(mask)), len(mask))


@dataclass(frozen=True)
class Curve:
    """Probability of detection, a logistic function of the logarithm of the size.

    Parameters
    ----------
    start, slope : float
        In :math:`1/(1+e^{-(a + b \\ln x)})`, x in sigma.
    covariance : (2, 2) array or None
        Of the two; None where the slope is on its bound.
    """

    start: float
    slope: float
    covariance: Array | None

    def probability(self, size: Array) -> Array:
        """Of detecting an effect of that size [sigma]."""
        return np.asarray(expit(self.start + self.slope * np.log(np.maximum(size, SMALLEST))))

    def size(self, probability: float) -> float:
        """Size that is detected with that probability [sigma]."""
        return math.exp((math.log(probability / (1.0 - probability)) - self.start) / self.slope)

    def interval(self, probability: float) -> tuple[float, float] | None:
        """Interval of `size`, normal in its logarithm; None where it is too wide to tell anything."""
        if self.covariance is None:
            return None
        middle = math.log(self.size(probability))
        slopes = np.array([-1.0, -middle]) / self.slope
        half = stats.norm.ppf(0.5 + COVERAGE / 2.0) * math.sqrt(float(slopes @ self.covariance @ slopes))
        return (math.exp(middle - half), math.exp(middle + half)) if half < WIDEST else None


def fit_curve(size: Array, detected: Mask) -> Curve | None:
    """The likeliest curve; None where all, or none, are detected."""
    if not len(size) or detected.all() or not detected.any():
        return None
    x, sign = np.log(np.maximum(size, SMALLEST)), np.where(detected, 1.0, -1.0)

    def surprise(at: Array) -> float:
        return -float(np.sum(log_expit(sign * (at[0] + at[1] * x))))

    found = minimize(surprise, np.array([0.0, 1.0]), method="L-BFGS-B", bounds=[(-100.0, 100.0), (1e-2, STEEPEST)])
    start, slope = map(float, found.x)
    p = expit(start + slope * x)
    basis = np.stack([np.ones_like(x), x], axis=1)
    information = basis.T @ (basis * (p * (1.0 - p))[:, None])
    on_bound = slope > 0.999 * STEEPEST or np.linalg.cond(information) > 1e10
    return Curve(start, slope, None if on_bound else np.asarray(np.linalg.inv(information), dtype=np.float64))
