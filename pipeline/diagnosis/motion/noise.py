"""Noise of the rows: of transducer and encoders as filters leave it, wander of a reading, ripple of a turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky_banded

from pmg.pipeline.diagnosis.motion.constants import RIPPLE
from pmg.pipeline.motion.banded import BandedFactor
from pmg.pipeline.motion.smooth import row_weights
from pmg.sim.shafts import SIDES, other_side
from pmg.sim.signals import NORMAL_MAD

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.sim.signals import Array

CORRELATED = (0.7, 10.0)
"""Least and largest correlation time of a wander within a run [s]: a slower one is taken for one that moves more."""

LEAST_WANDER = 5e-4
"""Least standard deviation that is taken for the wander [N m]."""

OF_TIME = 3
"""Degree of the curve of time that the zero of a transducer may follow over a campaign."""

PIECE = 3.0
"""Time over which a reading is averaged to see its wander [s], and longest time from knot to knot of it."""

FILLED = 0.5
"""Part of a piece that rows must fill for its mean to count."""

LEAST_RIPPLE = 3e-4
"""Least standard deviation that is taken for the ripple of a turn [N m]."""

FLOOR = 0.1
"""Part of the variance that is added to it alone, so that the whitening of a band-limited noise stays bounded."""


@dataclass(frozen=True)
class SlowNoise:
    """Wander of the readings, from run to run and within one, and what their ripple of a turn differs between runs.

    Parameters
    ----------
    wander : float
        Standard deviation of the wander [N m].
    time : float
        Time over which it is correlated [s].
    ripple : tuple of float
        Standard deviation of the waves of each order of a turn about those that all runs have [N m]; a counter that
        begins anew gives every run another phase.
    """

    wander: float = 1e-3
    time: float = CORRELATED[-1]
    ripple: tuple[float, ...] = (5e-3,) * len(RIPPLE)


USUAL = SlowNoise()
"""What is taken where the campaign does not tell it."""


@dataclass(frozen=True)
class RowNoise:
    """Noise of the rows of a stretch.

    Parameters
    ----------
    factor : BandedFactor
        Of the covariance of what the filters leave.
    slow : (n, r) array
        Orthonormal directions of wander and ripple, in units of that noise.
    shrunk : (r,) array
        Part of a column along each of them that goes.
    correlation : (b,) array
        Covariance of what the filters leave with as many rows later [(N m)2].
    """

    factor: BandedFactor
    slow: Array
    shrunk: Array
    correlation: Array

    def white(self, columns: Array) -> Array:
        """Columns (n, j) in units of the noise, and freed from its correlation."""
        white = self.factor.solved(columns)
        return np.asarray(white - self.slow @ (self.shrunk[:, None] * (self.slow.T @ white)))

    def adjoint(self, columns: Array) -> Array:
        """Columns (n, j) with which rows as they are have the products that whitened rows have with `columns`."""
        freed = columns - self.slow @ (self.shrunk[:, None] * (self.slow.T @ columns))
        return self.factor.adjoint(freed)


def row_noise(baseline: MotionBaseline, place: int, slow_noise: SlowNoise = USUAL) -> RowNoise:
    """The noise of a stretch, from the noise of each signal and what the balance makes of it.

    Notes
    -----
    A row is a filtered sum of white sequences: that of its transducer, and the quantisation of the encoders through
    inertia and the stiffness of the magnetic spring. Its correlation ends where the filters do, so that the
    covariance of any rows is banded.
    """
    stretch, sheet = baseline.stretches[place], baseline.sheet
    run, side = stretch.run, stretch.side
    own, (value, curvature) = stretch.shaft, row_weights(run)
    sources, common = [(own.density, value, value)], run.common
    if not stretch.at_rest:
        inertia, peak = (float(baseline.values[sheet.at(name)]) for name in (f"inertia_{side}", "pull_out"))
        spring = peak * sheet.poles[side] if stretch.coupled else 0.0
        of_own = inertia * curvature + spring * sheet.poles[side] * value
        sources.append((own.angle_density, of_own, of_own))
        if spring:
            other = other_side(side)
            of_other = spring * sheet.poles[other] * value
            sources.append((run.shafts[other].angle_density, of_other, of_other))
            sources.append((2.0 * common, of_own, of_other))
    step = round(run.run.rate / run.row_rate)
    length = len(value) // step + 1
    correlation = np.zeros(length)
    for density, one, another in sources:
        whole = np.correlate(one, another, "full")[len(value) - 1 :: step]
        correlation[: len(whole)] += 0.5 * run.run.rate * density * whole
    bounded = correlation * np.r_[1.0 + FLOOR, np.ones(length - 1)]
    at = np.flatnonzero(stretch.rows)
    banded = np.zeros((length, len(at)))
    for lag in range(min(length, len(at))):
        apart = at[lag:] - at[: len(at) - lag]
        banded[lag, : len(at) - lag] = np.where(apart < length, bounded[np.minimum(apart, length - 1)], 0.0)
    factor = BandedFactor.of(cholesky_banded(banded, lower=True, check_finite=False))
    white = factor.solved(slow_spread(stretch, slow_noise))
    slow, size, _ = np.linalg.svd(white, full_matrices=False)
    return RowNoise(factor, slow, 1.0 - 1.0 / np.sqrt(1.0 + size**2), correlation)


def slow_spread(stretch: RotorRows, noise: SlowNoise = USUAL) -> Array:
    r"""Directions (n, k) of wander and ripple, each as long as its standard deviation [N m].

    Notes
    -----
    A wander of size s and time t has the covariance :math:`s^2 e^{-|\Delta|/t}` between instants; straight lines
    between knots half that time apart, or `PIECE`, carry it. The mean of a run is off by as much besides.
    """
    lines, apart = _lines(stretch, min(0.5 * noise.time, PIECE))
    steps = np.arange(lines.shape[1])
    root = np.linalg.cholesky(np.exp(-np.abs(steps[:, None] - steps) * apart / noise.time))
    turns = _turns(stretch)
    turns *= np.repeat(noise.ripple, 2)[: turns.shape[1]]
    return np.hstack([noise.wander * np.ones((len(stretch), 1)), noise.wander * lines @ root, turns])


def _lines(stretch: RotorRows, apart: float) -> tuple[Array, float]:
    """Straight lines between knots, (n, k), as evenly apart as the run allows, and how far that is [s]."""
    time = stretch.run.row_time[stretch.rows]
    knots = np.linspace(0.0, stretch.run.time[-1], max(round(stretch.run.time[-1] / apart), 1) + 1)
    return np.maximum(1.0 - np.abs(time[:, None] - knots) / knots[1], 0.0), float(knots[1])


def _turns(stretch: RotorRows) -> Array:
    """Waves of once and twice a turn of the shaft, (n, 4); none at rest."""
    if stretch.at_rest:
        return np.zeros((len(stretch), 0))
    angle = stretch.shaft.angle
    return stretch.of_rows(np.stack([wave(order * angle) for order in RIPPLE for wave in (np.cos, np.sin)], 1))


def slow_noise_of(stretches: tuple[RotorRows, ...], noise: list[RowNoise], left: list[Array]) -> SlowNoise:
    r"""The wander and the ripple that residuals show.

    Each stretch tells the mean of the reading over pieces of time; over a campaign they follow a smooth curve of time,
    which is no wander, and the waves of a turn are those of its side, in neutral and engaged. A few that stand out, as
    of a cause in some runs, do not count.

    Parameters
    ----------
    stretches : tuple of RotorRows
        All of a campaign.
    noise : list of RowNoise
        Of each.
    left : list of (n,) array
        Measured torque of each less what explains it [N m].

    Notes
    -----
    Means over a piece T of a wander of size s and time t have with :math:`a = T/t` the variance
    :math:`2 s^2 (a - 1 + e^{-a})/a^2`, and neighbours the correlation :math:`(1 - e^{-a})^2/(2 (a - 1 + e^{-a}))`.
    """
    told: dict[str, list[tuple[Array, Array]]] = {side: [] for side in SIDES}
    ripples: dict[tuple[str, bool], list[Array]] = {}
    for place, stretch in enumerate(stretches):
        pieces, when = _pieces(stretch)
        rows = np.hstack([pieces, _turns(stretch), left[place][:, None]])
        white = noise[place].factor.solved(rows)
        found, waves = np.split(np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=1e-6)[0], [len(when)])
        told[stretch.side].append((when, np.asarray(found)))
        if len(waves):
            ripples.setdefault((stretch.side, stretch.coupled), []).append(waves)
    off = [each for of_side in told.values() for each in _about_trend(of_side)]
    about = [each - np.median(each, axis=0) for each in map(np.array, ripples.values()) if len(each) > 1]
    ripple = USUAL.ripple
    if about:
        by_order = np.split(np.vstack(about), len(RIPPLE), axis=1)
        ripple = tuple(max(_spread(np.ravel(each)), LEAST_RIPPLE) for each in by_order)
    size, time = _wander([values for _, values in off], _neighbours(off))
    return SlowNoise(size, time, ripple)


def _pieces(stretch: RotorRows) -> tuple[Array, Array]:
    """Pieces of time (n, k) that rows fill, each 1 in its own, and when their middles were [s since 1970]."""
    time = stretch.run.row_time[stretch.rows]
    of = np.floor(time / PIECE).astype(np.int64)
    held = [k for k in np.unique(of) if np.sum(of == k) > FILLED * PIECE * stretch.run.row_rate]
    began = stretch.run.run.started_at.timestamp()
    return (of[:, None] == np.array(held, dtype=np.int64)).astype(np.float64), began + PIECE * (np.array(held) + 0.5)


def _neighbours(off: list[tuple[Array, Array]]) -> Array:
    """Means of pieces that follow one another (m, 2)."""
    pairs = [
        np.stack([values[:-1], values[1:]], 1)[np.diff(when) < 1.5 * PIECE] for when, values in off if len(when) > 1
    ]
    return np.vstack([np.zeros((0, 2)), *pairs])


def _wander(means: list[Array], pairs: Array) -> tuple[float, float]:
    """Size [N m] and time [s] of a wander from means over pieces, and from those that follow one another."""
    if not means or not len(pairs):
        return USUAL.wander, USUAL.time
    both, change = (_spread(pairs @ np.array([1.0, sign])) ** 2 for sign in (1.0, -1.0))
    time = np.geomspace(*CORRELATED, 60)
    a = PIECE / time
    held = a - 1.0 + np.exp(-a)
    seen = (both - change) / max(both + change, 1e-30)
    found = float(np.interp(seen, (1.0 - np.exp(-a)) ** 2 / (2.0 * held), time))
    part = float(np.interp(found, time, np.sqrt(2.0 * held) / a))
    return max(_spread(np.concatenate(means)) / part, LEAST_WANDER), found


def _spread(values: Array) -> float:
    """Robust standard deviation about zero; zero of none."""
    return float(NORMAL_MAD * np.median(np.abs(values))) if len(values) else 0.0


def _about_trend(told: list[tuple[Array, Array]]) -> list[tuple[Array, Array]]:
    """Times, and values about a smooth curve of time over all of them; none where they are too few for it."""
    when, off = (np.concatenate(each) for each in zip(*told, strict=True)) if told else (np.zeros(0), np.zeros(0))
    if len(when) <= OF_TIME + 1:
        return []
    time = 2.0 * (when - when.min()) / max(float(np.ptp(when)), 1.0) - 1.0
    columns = np.polynomial.legendre.legvander(time, OF_TIME)
    left = np.asarray(off - columns @ np.linalg.lstsq(columns, off, rcond=None)[0])
    ends = np.cumsum([len(each) for each, _ in told])[:-1]
    return list(zip(np.split(when, ends), np.split(left, ends), strict=True))
