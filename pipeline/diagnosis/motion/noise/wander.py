"""Wander of a reading through a campaign: a sum of parts, each correlated over a time of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.sim.signals import Array

TIMES = (1.0, 4.6, 21.5, 100.0)
"""Times over which the parts of a wander are correlated [s]: any between is near a sum of two."""

SMALL_PART = 0.1
"""Part of the whole wander below which one that is fast is not followed from instant to instant."""


@dataclass(frozen=True)
class Wander:
    r"""The wander of one transducer: what it may be, and how likely each is.

    Parameters
    ----------
    cases : (c, p) array
        Variance of each part, case by case [(N m)2].
    weights : (c,) array
        Probability of each case.
    times : tuple of float
        Time over which each part is correlated [s].

    Notes
    -----
    With parts of variance :math:`s_k^2` and time :math:`t_k` instants have the covariance
    :math:`\sum_k s_k^2 e^{-|\Delta|/t_k}`, within a run and from run to run alike.
    """

    cases: Array
    weights: Array
    times: tuple[float, ...] = TIMES

    @classmethod
    def of(cls, size: float) -> Wander:
        """One of a standard deviation [N m], of equal parts."""
        return cls(np.full((1, len(TIMES)), size**2 / len(TIMES)), np.ones(1))

    @property
    def variances(self) -> Array:
        """Expected variance of each part (p,) [(N m)2]."""
        return np.asarray(self.weights @ self.cases)

    @property
    def size(self) -> float:
        """Its standard deviation [N m]."""
        return float(np.sqrt(self.variances.sum()))

    @property
    def fastest(self) -> float:
        """Shortest time [s] of a part that counts."""
        whole = self.variances.sum()
        return next(time for time, part in zip(self.times, self.variances, strict=True) if part >= SMALL_PART * whole)

    def covariance(self, when: Array) -> Array:
        """Between instants [s] (n, n), [(N m)2]."""
        apart = np.abs(when[:, None] - when)
        parts = zip(self.variances, self.times, strict=True)
        return np.asarray(sum(variance * np.exp(-apart / time) for variance, time in parts))


def of_means(when: Array, length: float, time: float) -> Array:
    r"""Covariance (n, n) of means over pieces of a length [s] with middles [s], of a wander of one time and unit size.

    Notes
    -----
    With :math:`a = T/t` it is :math:`2 (a - 1 + e^{-a})/a^2` of a mean with itself, and
    :math:`(2 \sinh(a/2)/a)^2 e^{-|\Delta|/t}` of two.
    """
    a = length / time
    found = (2.0 * np.sinh(0.5 * a) / a) ** 2 * np.exp(-np.abs(when[:, None] - when) / time)
    np.fill_diagonal(found, 2.0 * (a - 1.0 + np.exp(-a)) / a**2)
    return np.asarray(found)


def draw_wander(wander: Wander, when: Array, rng: np.random.Generator, draws: int) -> Array:
    """Wander at instants [s] (n, draws) [N m], each draw of one of the cases."""
    found = np.zeros((len(when), draws))
    case = rng.choice(len(wander.weights), draws, p=wander.weights)
    for time, variance in zip(wander.times, wander.cases.T, strict=True):
        root = np.linalg.cholesky(np.exp(-np.abs(when[:, None] - when) / time))
        found += root @ (np.sqrt(variance[case]) * rng.standard_normal((len(when), draws)))
    return found


def covariance_between(knots: Sequence[Array], wander: Wander) -> Array:
    """Covariance (n, n) of a wander at instants [s] of several runs, of those of different runs only [(N m)2]."""
    within = block_diag(*map(wander.covariance, knots))
    return np.asarray(wander.covariance(np.concatenate(knots)) - within)
