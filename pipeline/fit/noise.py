"""Noise of both shafts as values: its size, its growth with speed, its correlation from point to point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.shafts import PerShaft

if TYPE_CHECKING:
    from pmg.sim.signals import Array

CORRELATIONS = np.arange(0.0, 0.71, 0.05)
"""Neighbour correlations considered; above the last it is drift, not noise."""

NO_CORRELATION = np.r_[1.0, np.zeros(len(CORRELATIONS) - 1)]
"""Weights of a campaign whose order is not known, or that is too small to tell."""


GROWTHS = np.array([0.0, 0.5, 1.0, 2.0, 4.0, 8.0])
"""Relative growths of the noise variance up to the highest speed that are considered."""


@dataclass(frozen=True)
class Growth:
    r"""Growth of a shaft's noise with its speed.

    Parameters
    ----------
    weights : (r,) array
        Weight of each of `GROWTHS`.
    fastest : float
        Highest speed of the shaft's readings [rad/s].
    mean_square : float
        Mean of :math:`x^2 = (w/w_{max})^2` over them.

    Notes
    -----
    For one growth g the variance is :math:`(1 + g x^2)/(1 + g\,\overline{x^2})` times that of the floor, so that the
    floor stays the root mean square over the readings.
    """

    weights: Array
    fastest: float
    mean_square: float

    def variance(self, speed: Array) -> Array:
        """Variance at a speed over that of the floor, weighted mean."""
        return np.asarray(np.sum([w * self.of(float(g), speed) for w, g in zip(self.weights, GROWTHS, strict=True)], 0))

    def of(self, growth: float, speed: Array) -> Array:
        """The same for one growth."""
        square = (speed / self.fastest) ** 2
        return np.asarray((1.0 + growth * square) / (1.0 + growth * self.mean_square))


DRIFTED = "residual scatter; repeats differ by more, so the bench drifted between them"
"""Source of a noise beside which the repeats show a slow change."""

NO_GROWTH = Growth(np.r_[1.0, np.zeros(len(GROWTHS) - 1)], 1.0, 0.0)
"""Noise of the same size at every speed."""


@dataclass(frozen=True)
class ShaftNoise:
    """Noise of one shaft's readings.

    Parameters
    ----------
    u : float
        Noise of one point's mean that structure is judged against [N m], all causes that differ from point to point.
    dof : float
        Degrees of freedom behind `u`; 0 where the campaign does not tell how far a mean strays.
    within : float
        Root mean square of the within-window part [N m].
    repeats, repeats_dof : float
        Standard deviation of repeated points [N m] (NaN without repeats) and its degrees of freedom.
    unstructured, unstructured_dof : float
        Scatter that follows no covariate and not the order [N m], and its degrees of freedom.
    correlation_weights : (r,) array
        Weight of each of `CORRELATIONS` as correlation of neighbouring points in the order of the test.
    source : str
        Where `u` comes from, in words.
    growth : Growth
        How its size grows with the shaft's speed; `u` is the root mean square over the readings.
    """

    u: float
    dof: float
    within: float
    repeats: float
    repeats_dof: int
    unstructured: float
    unstructured_dof: float
    correlation_weights: Array
    source: str
    growth: Growth = NO_GROWTH

    @property
    def correlation(self) -> float:
        """Correlation of neighbouring points in the order of the test, weighted mean."""
        return float(self.correlation_weights @ CORRELATIONS)

    def at(self, speed: float) -> float:
        """Standard uncertainty of one point's mean at a speed of the shaft [rad/s], in N m."""
        return self.u * float(np.sqrt(self.growth.variance(np.array([speed]))[0]))


@dataclass(frozen=True)
class NoiseFloor(PerShaft[ShaftNoise]):
    """Noise of both shafts."""
