"""Noise that is correlated from point to point, made white, and made anew."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.noise import CORRELATIONS, GROWTHS, NO_GROWTH, Growth, NoiseFloor
from pmg.sim.recursion import remembered
from pmg.sim.shafts import PerShaft, per_shaft

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array


def growth_of(readings: Readings, side: str, weights: Array) -> Growth:
    """Growth of that weight over one shaft's readings."""
    speed = np.abs(readings.speed_own[readings.of_shaft[side]])
    fastest = float(speed.max(initial=0.0))
    if fastest == 0.0:
        return NO_GROWTH
    return Growth(weights, fastest, float(np.mean((speed / fastest) ** 2)))


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
        """The new part of each link (k, c)."""
        keep = (rho**self.lag)[:, None]
        out = columns.copy()
        out[1:] = (columns[1:] - keep * columns[:-1]) / np.sqrt(1.0 - keep**2)
        return out

    def colour(self, white: Array, rho: float) -> Array:
        """The noise whose links bring this news; the inverse of `whiten`."""
        keep = rho**self.lag
        news = white.copy()
        news[1:] *= np.sqrt(1.0 - keep**2)[:, None]
        return remembered(keep, news)

    def log_determinant(self, rho: float) -> float:
        """Logarithm of the determinant of the correlation matrix."""
        return float(np.sum(np.log1p(-(rho ** (2.0 * self.lag)))))


def chain_of(readings: Readings, side: str) -> Chain:
    """The chain of one shaft's readings; the order of the test must be known."""
    position = np.empty(len(readings.grid))
    position[np.argsort(readings.grid.points.started_at, kind="stable")] = np.arange(len(readings.grid))
    rows = np.flatnonzero(readings.of_shaft[side])
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
    """The effects [N m] whose whitened form this vector is, or the columns of this matrix are."""
    out = values.reshape(len(values), -1).copy()
    for chain, rho in white.chains:
        out[chain.rows] = chain.colour(out[chain.rows], rho)
    return np.asarray(out * white.scale[:, None]).reshape(values.shape)


EVEN = PerShaft(NO_GROWTH, NO_GROWTH)
"""Noise of either shaft that does not grow with its speed."""


def relative_scale(
    readings: Readings, bench: BenchParameters, sigma: PerShaft[float], growth: PerShaft[Growth] = EVEN
) -> Array:
    """Standard deviation of each reading [N m] from that of the two transducers' points."""
    at = readings.grid.points
    ratio = bench.ratio(at.gear)[readings.row]
    engaged = readings.configuration == "engaged"
    sun, ring = per_shaft(lambda side: sigma[side] * np.sqrt(growth[side].variance(at.speed[side][readings.row])))
    own = np.where(readings.sun, sun, ring)
    return np.where(engaged, np.hypot(own, ring / ratio), own)


def floor_scale(readings: Readings, bench: BenchParameters, floor: NoiseFloor) -> Array:
    """Standard deviation of each reading by a noise floor [N m]."""
    return relative_scale(readings, bench, floor.map(lambda noise: noise.u), floor.map(lambda noise: noise.growth))


def whitener(readings: Readings, bench: BenchParameters, floor: NoiseFloor) -> Whitener:
    """Whitener for noise of a floor's size and neighbour correlation."""
    scale = floor_scale(readings, bench, floor)
    if not readings.grid.points.ordered:
        return Whitener(scale, ())
    return Whitener(scale, tuple((chain_of(readings, side), noise.correlation) for side, noise in floor.items()))


NOISY_WINDOW = 2.5
"""A window whose own scatter is this many times the usual keeps its own uncertainty; below, the difference from the
usual is mostly that of an estimate from ten batches."""


def with_floor(grid: Grid, floor: NoiseFloor) -> Grid:
    r"""The grid with the uncertainty of each point, wander between points included.

    Notes
    -----
    :math:`u_i` is the floor at the point's speed. A window that is noisier than the others has
    :math:`u_i^2 = u_\mathrm{floor}^2 - \overline{u_\mathrm{within}^2} + u_{i,\mathrm{within}}^2` instead.
    """

    def point(side: str) -> Array:
        within, noise = grid.within[side], floor[side]
        usual = noise.u * np.sqrt(noise.growth.variance(grid.points.speed[side]))
        own = np.sqrt(np.maximum(usual**2 - noise.within**2, 0.0) + within**2)
        return np.where(within > NOISY_WINDOW * noise.within, own, usual)

    u = per_shaft(point)
    return replace(grid, u_sun=u.sun, u_ring=u.ring)


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

    The neighbour correlation and the growth with speed of each are drawn from their weights while the whitening keeps
    to their means, so that not knowing them exactly is part of the test's distribution. Published tables are rounded:
    there the `fitted` torques of the baseline get noise and are rounded alike, since points of equal torque share
    their rounding error, which looks like structure and is none.
    """
    step = readings.grid.rounding
    if step > 0.0 and fitted is not None:
        return white(_rounded(readings, floor, fitted, step, draws, rng))
    out = rng.standard_normal((len(readings), draws))
    for side, noise in floor.items():
        rows = np.flatnonzero(readings.of_shaft[side])
        speed = readings.speed_own[rows]
        usual = noise.growth.variance(speed)
        which = rng.choice(len(GROWTHS), size=draws, p=noise.growth.weights)
        sizes = np.sqrt([noise.growth.of(float(g), speed) / usual for g in GROWTHS]).T
        chain = next(((c, rho) for c, rho in white.chains if np.array_equal(np.sort(c.rows), rows)), None)
        if chain is None:
            out[rows] *= sizes[:, which]
            continue
        links, rho = chain
        back = np.searchsorted(rows, links.rows)
        drawn = rng.choice(len(CORRELATIONS), size=draws, p=noise.correlation_weights)
        for k in np.unique(drawn):
            of_k = np.flatnonzero(drawn == k)
            columns = np.ix_(links.rows, of_k)
            coloured = links.colour(out[columns], float(CORRELATIONS[k])) * sizes[np.ix_(back, which[of_k])]
            out[columns] = links.whiten(coloured, rho)
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
