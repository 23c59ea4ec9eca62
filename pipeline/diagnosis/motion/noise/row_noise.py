"""Noise of the rows of a stretch: what filters leave of transducer and encoders, wander, ripple, quantisation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cholesky_banded

from pmg.pipeline.diagnosis.motion.constants import RIPPLE
from pmg.pipeline.diagnosis.motion.noise.filtered import banded_rows, filtered_noise
from pmg.pipeline.diagnosis.motion.noise.wander import Wander, covariance_between, draw_wander
from pmg.pipeline.motion.banded import BandedFactor
from pmg.pipeline.motion.smooth import BAND
from pmg.sim.shafts import SIDES, PerShaft, other_side, per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.pipeline.motion.quantisation import QuantisationError
    from pmg.sim.signals import Array

LONGEST = 3.0
"""Longest time from knot to knot of the straight lines that carry a wander [s]."""

FLOOR = 0.06
"""White part that is added to the noise, over its least density in the band, so that whitening stays bounded beyond it.
Where an inertia turns the steps of an encoder into torque, most of the variance lies at the upper end of the band, and
a part of that would drown what a torque tells at the lower."""

IN_BAND = 0.85
"""Part of the cut-off up to which the low-pass of the rows takes less than 1 dB."""

QUIETEST = 1e-5
"""Least standard deviation of the white part [N m]: a channel that shows one value all the time has no noise to see."""


UNSEEN = 1e-6
"""Length of a direction, in units of the noise, up to which it holds nothing: as of steps that jitter blurs."""

REACTION = 0.05
"""Standard deviation of the torque at which a held shaft rests [N m]; it stays while the other shaft turns."""

PASSED_ON = 2e-3
"""Standard deviation of the part of the other shaft's torque that comes to a held one through the frame in a run."""


@dataclass(frozen=True)
class SlowNoise:
    """Wander of the readings, and what their ripple of a turn differs between runs.

    Parameters
    ----------
    wander : PerShaft of Wander
        Of each transducer.
    ripple : tuple of float
        Standard deviation of the waves of each order of a turn about those that all runs have [N m]; a counter that
        begins anew gives every run another phase.
    """

    wander: PerShaft[Wander] = field(default_factory=lambda: per_shaft(lambda _: Wander.of(1e-3)))
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
        Orthonormal directions of wander, ripple and quantisation, in units of that noise.
    shrunk : (r,) array
        Part of a column along each of them that goes.
    floor : float
        Variance that is added to that of each row [(N m)2].
    side : str
        The shaft.
    slow_noise : SlowNoise
        Of which wander and ripple are.
    quantisation : (n, h) array
        Directions of what steps of the encoders are off on average, and where they follow an order, each as long as its
        standard deviation [N m].
    knots : (q,) array
        Instants from which to which its wander goes straight [s since 1970].
    lines : (n, q) array
        What each row shows of the wander at each of them.
    of_angles : (b, n) array
        Diagonals of the covariance that noise of the angles makes, without `quantisation` [(N m)2].
    """

    factor: BandedFactor
    slow: Array
    shrunk: Array
    floor: float
    side: str
    slow_noise: SlowNoise
    quantisation: Array
    knots: Array
    lines: Array
    of_angles: Array

    @property
    def wander(self) -> Wander:
        """Of its transducer."""
        return self.slow_noise.wander[self.side]

    def white(self, columns: Array) -> Array:
        """Columns (n, j) in units of the noise, and freed from its correlation."""
        white = self.factor.solved(columns)
        return np.asarray(white - self.slow @ (self.shrunk[:, None] * (self.slow.T @ white)))

    def adjoint(self, columns: Array) -> Array:
        """Columns (n, j) with which rows as they are have the products that whitened rows have with `columns`."""
        freed = columns - self.slow @ (self.shrunk[:, None] * (self.slow.T @ columns))
        return self.factor.adjoint(freed)

    def covariance_of_angles(self, weights: Array) -> Array:
        """Covariance (k, k) that noise of the angles makes of sums of rows as they are, with `weights` (n, k)."""
        shown = self.of_angles[0][:, None] * weights
        for later, diagonal in enumerate(self.of_angles[1 : len(weights)], start=1):
            along = diagonal[:-later, None]
            shown[:-later] += along * weights[later:]
            shown[later:] += along * weights[:-later]
        steps = self.quantisation.T @ weights
        return np.asarray(weights.T @ shown + steps.T @ steps)


def row_noise(baseline: MotionBaseline, place: int, slow_noise: SlowNoise = USUAL) -> RowNoise:
    """The noise of a stretch, from the noise of each signal and what the balance makes of it.

    Notes
    -----
    A row is a filtered sum of white sequences: that of its transducer, and the quantisation of the encoders through
    inertia and the stiffness of the magnetic spring, with the density that either has. Its correlation ends where the
    filters do, so that the covariance of any rows is banded. Steps of an encoder make more noise while the speed
    changes than while one is held, so that the size of each source goes with time; what they are off where they follow
    an order, as where a shaft turns back, has directions of its own.
    """
    stretch, sheet = baseline.stretches[place], baseline.sheet
    run, side = stretch.run, stretch.side
    quantisation = [np.zeros((len(stretch), 0))]
    inertia, peak = (float(baseline.values[sheet.at(name)]) for name in (f"inertia_{side}", "pull_out"))
    spring = peak * sheet.poles[side] + baseline.more_stiffness(place) if stretch.coupled else 0.0
    if spring and not stretch.at_rest:
        for of in SIDES:
            off = _quantisation_spread(stretch, run.shafts[of].angle_noise.quantisation)
            quantisation.append(spring * sheet.poles[of] * off)
    if not stretch.at_rest:
        quantisation.append(inertia * _ordered_steps(stretch))
    of_torque, of_angles = filtered_noise(stretch, inertia, sheet.poles.map(lambda poles: spring * poles))
    by_row = of_torque + of_angles
    banded = banded_rows(by_row, stretch.rows)
    floor = max(FLOOR * _least_density(np.mean(by_row[stretch.rows], axis=0), run.row_rate), QUIETEST**2)
    banded[0] += floor
    factor = BandedFactor.of(cholesky_banded(banded, lower=True, check_finite=False))
    knots, lines = _lines(stretch, slow_noise.wander[side])
    white = factor.solved(np.hstack([slow_spread(stretch, slow_noise), *quantisation]))
    white = white[:, np.linalg.norm(white, axis=0) > UNSEEN]
    slow, size, _ = np.linalg.svd(white, full_matrices=False)
    shrunk = 1.0 - 1.0 / np.sqrt(1.0 + size**2)
    of_angles = banded_rows(of_angles, stretch.rows)
    return RowNoise(factor, slow, shrunk, floor, side, slow_noise, np.hstack(quantisation), knots, lines, of_angles)


def _least_density(correlation: Array, rate: float) -> float:
    """Least density in the band of a noise with a correlation (b,), over that of white noise of variance 1."""
    turn = REVOLUTION * np.linspace(0.0, IN_BAND * BAND, 65) / rate
    lags = np.arange(1, len(correlation))
    return float(np.min(correlation[0] + 2.0 * np.cos(turn[:, None] * lags) @ correlation[1:]))


def slow_spread(stretch: RotorRows, noise: SlowNoise = USUAL) -> Array:
    """Directions (n, k) of wander and ripple, each as long as its standard deviation [N m]; of a held shaft's rest."""
    wander = noise.wander[stretch.side]
    knots, lines = _lines(stretch, wander)
    if stretch.held:
        other = stretch.of_rows(stretch.run.shafts[other_side(stretch.side)].torque)
        further = np.stack([np.full(len(stretch), REACTION), PASSED_ON * other], 1)
    else:
        further = turns_of(stretch)
        further *= np.repeat(noise.ripple, 2)[: further.shape[1]]
    return np.hstack([lines @ np.linalg.cholesky(wander.covariance(knots)), further])


def _quantisation_spread(stretch: RotorRows, error: QuantisationError) -> Array:
    """Directions (n, h) of what steps of an encoder are off on average, each as long as its standard deviation [rad].

    It is taken to move as a wander does, over times from 1 to 100 s: how long a speed is held nobody says. What one
    encoder shows in both balances of an engaged run is taken for two errors.
    """
    if not (acting := error.spread > 0.0).any():
        return np.zeros((len(stretch), 0))
    time, unit = stretch.run.row_time[stretch.rows], np.eye(len(error.time))[acting]
    hats = np.stack([np.interp(time, error.time, each) for each in unit], 1)
    root = np.linalg.cholesky(Wander.of(1.0).covariance(error.time[acting]))
    return np.asarray((hats * error.spread[acting]) @ root)


def _ordered_steps(stretch: RotorRows) -> Array:
    """Directions (n, w) of what steps are off in the acceleration where they follow an order [rad/s2]."""
    course, time = stretch.shaft.angle_noise.course, stretch.run.row_time[stretch.rows]
    found = np.zeros((len(time), course.ordered.shape[1]))
    for k, wave in enumerate(course.ordered.T):
        found[:, k] = np.interp(time, course.time, wave, left=0.0, right=0.0)
    return found


def _lines(stretch: RotorRows, wander: Wander) -> tuple[Array, Array]:
    """Knots (k,) [s since 1970] half the time of the fastest wander apart, evenly, and straight lines between them."""
    time, end = stretch.run.row_time[stretch.rows], float(stretch.run.time[-1])
    apart = min(0.5 * wander.fastest, LONGEST)
    knots = np.linspace(0.0, end, max(round(end / apart), 1) + 1)
    lines = np.maximum(1.0 - np.abs(time[:, None] - knots) / knots[1], 0.0)
    return stretch.run.run.started_at.timestamp() + knots, lines


def turns_of(stretch: RotorRows) -> Array:
    """Waves of once and twice a turn of the shaft, (n, 4); none at rest."""
    if stretch.at_rest:
        return np.zeros((len(stretch), 0))
    angle = stretch.shaft.angle
    return stretch.of_rows(np.stack([wave(order * angle) for order in RIPPLE for wave in (np.cos, np.sin)], 1))


def between_runs(noise: Sequence[RowNoise], seen: list[Array]) -> Array:
    """Covariance (j, j) of some numbers as wander goes on from run to run, beyond what each run makes by itself.

    Parameters
    ----------
    noise : sequence of RowNoise
        Of each stretch.
    seen : list of (j, q) array
        Change of the numbers per wander at each knot of each stretch.
    """
    found = np.zeros((len(seen[0]), len(seen[0])))
    for of_side in _by_side(noise):
        whole = np.hstack([seen[place] for place in of_side])
        found += whole @ covariance_between([noise[p].knots for p in of_side], noise[of_side[0]].wander) @ whole.T
    return found


def wander_at_knots(noise: Sequence[RowNoise], rng: np.random.Generator, draws: int) -> list[Array]:
    """Wander at the knots (q, draws) of each stretch [N m], as it goes on from run to run."""
    found: list[Array] = [np.zeros((0, draws))] * len(noise)
    for of_side in _by_side(noise):
        knots = [noise[place].knots for place in of_side]
        whole = draw_wander(noise[of_side[0]].wander, np.concatenate(knots), rng, draws)
        for place, part in zip(of_side, np.split(whole, np.cumsum([len(k) for k in knots])[:-1]), strict=True):
            found[place] = part
    return found


def _by_side(noise: Sequence[RowNoise]) -> list[list[int]]:
    """Places of the stretches of each transducer that has any."""
    places = ([place for place, each in enumerate(noise) if each.side == side] for side in SIDES)
    return [of_side for of_side in places if of_side]
