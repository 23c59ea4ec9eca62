"""Noise of the rows: of transducer and encoders as filters leave it, wander of a reading, ripple of a turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky_banded, solve_banded

from pmg.pipeline.motion.smooth import row_weights
from pmg.sim.shafts import SIDES, other_side
from pmg.sim.signals import NORMAL_MAD

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.sim.signals import Array

WANDER = 1e-3
"""Standard deviation of a reading's wander where the campaign does not tell it [N m]."""

LEAST_WANDER = 5e-4
"""Least standard deviation that is taken for the wander [N m]."""

OF_TIME = 3
"""Degree of the curve of time that the zero of a transducer may follow over a campaign."""

KNOTS = 3.0
"""Time over which a reading wanders [s]."""

RIPPLE = 5e-3
"""Standard deviation of the ripple of a reading over a turn [N m]; its phase is another one in each run."""

RIPPLE_ORDERS = (1, 2)

FLOOR = 0.1
"""Part of the variance that is added to it alone, so that the whitening of a band-limited noise stays bounded."""


@dataclass(frozen=True)
class RowNoise:
    """Noise of the rows of a stretch.

    Parameters
    ----------
    factor : (b + 1, n) array
        Lower banded factor of the covariance of what the filters leave, as LAPACK keeps it.
    slow : (n, r) array
        Orthonormal directions of wander and ripple, in units of that noise.
    shrunk : (r,) array
        Part of a column along each of them that goes.
    """

    factor: Array
    slow: Array
    shrunk: Array

    def white(self, columns: Array) -> Array:
        """Columns (n, j) in units of the noise, and freed from its correlation."""
        white = solve_banded((len(self.factor) - 1, 0), self.factor, columns, check_finite=False)
        return np.asarray(white - self.slow @ (self.shrunk[:, None] * (self.slow.T @ white)))


def row_noise(baseline: MotionBaseline, place: int, wander: float = WANDER) -> RowNoise:
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
    sources = [(own.density, value)]
    if not stretch.at_rest:
        inertia, peak = (float(baseline.values[sheet.at(name)]) for name in (f"inertia_{side}", "pull_out"))
        spring = peak * sheet.poles[side] if stretch.coupled else 0.0
        sources.append((own.angle_density, inertia * curvature + spring * sheet.poles[side] * value))
        if spring:
            other = other_side(side)
            sources.append((run.shafts[other].angle_density, spring * sheet.poles[other] * value))
    step = round(run.run.rate / run.row_rate)
    length = max(len(weights) for _, weights in sources) // step + 1
    correlation = np.zeros(length)
    for density, weights in sources:
        whole = np.correlate(weights, weights, "full")[len(weights) - 1 :: step]
        correlation[: len(whole)] += 0.5 * run.run.rate * density * whole
    correlation[0] *= 1.0 + FLOOR
    at = np.flatnonzero(stretch.rows)
    banded = np.zeros((length, len(at)))
    for lag in range(length):
        apart = at[lag:] - at[: len(at) - lag]
        banded[lag, : len(at) - lag] = np.where(apart < length, correlation[np.minimum(apart, length - 1)], 0.0)
    factor = cholesky_banded(banded, lower=True, check_finite=False)
    white = solve_banded((len(factor) - 1, 0), factor, slow_spread(stretch, wander), check_finite=False)
    slow, size, _ = np.linalg.svd(white, full_matrices=False)
    return RowNoise(factor, slow, 1.0 - 1.0 / np.sqrt(1.0 + size**2))


def slow_spread(stretch: RotorRows, wander: float = WANDER) -> Array:
    """Directions (n, k) of wander and ripple, each as long as its standard deviation [N m]."""
    return np.hstack([wander * np.ones((len(stretch), 1)), wander * _knots(stretch), RIPPLE * _turns(stretch)])


def _knots(stretch: RotorRows) -> Array:
    """Straight lines between knots `KNOTS` apart, (n, k): a reading that wanders from run to run and within one."""
    time = stretch.run.row_time[stretch.rows]
    knots = np.linspace(0.0, stretch.run.time[-1], max(round(stretch.run.time[-1] / KNOTS), 1) + 1)
    return np.asarray(np.maximum(1.0 - np.abs(time[:, None] - knots) / (knots[1] - knots[0]), 0.0))


def _turns(stretch: RotorRows) -> Array:
    """Waves of once and twice a turn of the shaft, (n, 4); none at rest."""
    if stretch.at_rest:
        return np.zeros((len(stretch), 0))
    angle = stretch.shaft.angle
    return stretch.of_rows(np.stack([wave(order * angle) for order in RIPPLE_ORDERS for wave in (np.cos, np.sin)], 1))


def wander_of(baseline: MotionBaseline, noise: list[RowNoise]) -> float:
    """Standard deviation of the wander that the residuals of a baseline show [N m].

    Each stretch tells the reading's offset at its knots; over a campaign they follow a smooth curve of time, which is
    no wander. A few that stand out, as of a cause in some runs, do not count.
    """
    offsets: dict[str, list[tuple[float, float]]] = {side: [] for side in SIDES}
    for place, stretch in enumerate(baseline.stretches):
        white = solve_banded(
            (len(noise[place].factor) - 1, 0),
            noise[place].factor,
            np.hstack([_knots(stretch), _turns(stretch), baseline.left(place)[:, None]]),
            check_finite=False,
        )
        found = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=1e-6)[0]
        knots = _knots(stretch).shape[1]
        began = stretch.run.run.started_at.timestamp()
        offsets[stretch.side] += [(began + KNOTS * k, float(found[k])) for k in range(knots)]
    apart = np.concatenate([_about_trend(np.array(each)) for each in offsets.values() if len(each) > OF_TIME + 1])
    return max(float(NORMAL_MAD * np.median(np.abs(apart))), LEAST_WANDER)


def _about_trend(offsets: Array) -> Array:
    """Offsets (n, 2) of time and value about a smooth curve of time (n,)."""
    time = 2.0 * (offsets[:, 0] - offsets[:, 0].min()) / max(float(np.ptp(offsets[:, 0])), 1.0) - 1.0
    columns = np.polynomial.legendre.legvander(time, OF_TIME)
    return np.asarray(offsets[:, 1] - columns @ np.linalg.lstsq(columns, offsets[:, 1], rcond=None)[0])
