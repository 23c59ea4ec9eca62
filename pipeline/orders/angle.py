"""Angles of a shaft: where its index stands, signals over equal steps of angle, the average turn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft

from pmg.sim import sources
from pmg.sim.errors import RecordingError
from pmg.sim.signals import REVOLUTION, wrapped

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.recording.layouts.wire import IndexPulse
    from pmg.pipeline.recording.read import Recording
    from pmg.sim.signals import Array

FEWEST_PULSES = 3
"""Index pulses from which the place of the index is taken."""
LATCH = 0.5
"""Standard deviation of where between two samples the count is latched, in samples, before pulses are looked at."""
CLUSTER = 2.0
"""Counts next to those of one sample by which a pulse may stand off the others before it is left out."""

RESAMPLING_SOURCE = sources.FYFE_MUNCK.at("computed order tracking")


@dataclass(frozen=True)
class Index:
    """Where the index of an encoder stands.

    Parameters
    ----------
    angle : float
        Angle of the index within the first turn of the unwrapped angle [rad].
    u : float
        Its standard uncertainty [rad].
    pulses, left_out : int
        Pulses that it stands on, and those that stand elsewhere.
    """

    angle: float
    u: float
    pulses: int
    left_out: int


def index_of(recording: Recording, side: str) -> Index | None:
    """Place of the index of a shaft of a recording that was read with its index pulses."""
    if f"angle_{side}" in recording.lacking:
        return None
    angle = recording.samples[f"angle_{side}"].to_numpy()
    pulses, bits = recording.auxiliary.pulses[side], recording.auxiliary.bits[side]
    return _find_index(angle, recording.first_sample, pulses, recording.calibration.counts_per_rev[side], bits)


def _find_index(
    angle: Array, first_sample: int, pulses: Sequence[IndexPulse], counts_per_rev: int, bits: int
) -> Index | None:
    r"""Place of the index from the latched counts; None with fewer than `FEWEST_PULSES` pulses in agreement.

    Parameters
    ----------
    angle : (n,) array
        Unwrapped angle of the shaft [rad], of which a count is ``2 pi / counts_per_rev``.
    first_sample : int
        Sample index of its first value.
    pulses : sequence of IndexPulse
        Sample and latched count of each.
    counts_per_rev, bits : int
        Of the encoder, and width of its counter.

    Notes
    -----
    A recorder may latch the count at the edge itself or at a sample before or after it. With :math:`q_i` counts a
    sample, :math:`z_i = z + b q_i + e_i`, where b is :math:`0 \pm` `LATCH` beforehand and :math:`e_i` has the
    variance of one count and of the place between two samples, :math:`(1 + q_i^2)/12`. Pulses at several speeds tell
    b; at one speed it stays in the uncertainty of z. Missing pulses lack nothing else; double ones at another place
    are left out.
    """
    step = REVOLUTION / counts_per_rev
    inside = [p for p in pulses if 1 <= p.sample - first_sample < len(angle) - 1]
    rows = np.array([p.sample - first_sample for p in inside], dtype=np.int64)
    if len(rows):
        known = np.isfinite(angle[rows]) & np.isfinite(angle[rows - 1]) & np.isfinite(angle[rows + 1])
        rows, inside = rows[known], [p for p, good in zip(inside, known, strict=True) if good]
    if len(rows) < FEWEST_PULSES:
        return None
    near = np.rint(angle[rows] / step)
    modulus = float(1 << bits)
    latched = np.array([float(p.count) for p in inside])
    latched = near + (latched - near + modulus / 2) % modulus - modulus / 2
    quickness = (angle[rows + 1] - angle[rows - 1]) / (2.0 * step)
    place = (latched + 0.5) * step
    middle = _circular_middle(place)
    off = wrapped(place - middle) / step
    kept = np.abs(off) <= CLUSTER + np.abs(quickness).max()
    if np.count_nonzero(kept) < max(FEWEST_PULSES, len(kept) / 2):
        return None
    off, quickness = off[kept], quickness[kept]
    weight = 12.0 / (1.0 + quickness**2)
    normal = np.array(
        [
            [weight.sum(), (weight * quickness).sum()],
            [(weight * quickness).sum(), (weight * quickness**2).sum() + LATCH**-2],
        ]
    )
    covariance = np.linalg.inv(normal)
    z = covariance @ np.array([(weight * off).sum(), (weight * quickness * off).sum()])
    where = (middle + z[0] * step) % REVOLUTION
    return Index(float(where), math.sqrt(covariance[0, 0]) * step, int(kept.sum()), int((~kept).sum()))


def _circular_middle(place: Array) -> float:
    """The place on the circle with the smallest sum of distances to the others, so that strays do not move it."""
    points = place[:: max(1, len(place) // 100)]
    distance = np.abs(wrapped(points[:, None] - place[None, :])).sum(axis=1)
    return float(points[int(np.argmin(distance))])


@dataclass(frozen=True)
class Turns:
    """A signal over equal steps of the angle of one shaft.

    Parameters
    ----------
    values : (r, b) array
        Mean of the signal over each of the b steps of each of the r whole turns.
    start : float
        Angle at which the first turn begins [rad].
    """

    values: Array
    start: float

    @property
    def middles(self) -> Array:
        """Angle of the middle of each step from the start of a turn [rad]."""
        bins = self.values.shape[1]
        return np.asarray((np.arange(bins) + 0.5) * (REVOLUTION / bins))


def by_angle(signal: Array, angle: Array, bins: int, start: float | None = None) -> Turns:
    r"""A signal over equal steps of angle.

    Parameters
    ----------
    signal, angle : (n,) array
        Signal and angle [rad] of the shaft, on equidistant samples.
    bins : int
        Steps a turn.
    start : float, optional
        Angle at which a turn begins, such as that of the index; the first sample's when not given.

    Raises
    ------
    RecordingError
        The shaft does not make a whole turn.

    Notes
    -----
    Each value is the mean of the signal over the time in which the shaft passes its step: the running integral,
    linear between samples, read where the angle crosses the borders. That is its own filter against aliasing. It
    takes :math:`1 - \mathrm{sinc}(m/b)` off the amplitude at order m, which `order_amplitudes` gives back; the line
    between samples takes off :math:`1 - \mathrm{sinc}^2(f/f_s)` at frequency f. The angle is taken as reached once it
    was passed, so the jitter of a count does not turn the shaft back.

    References
    ----------
    `RESAMPLING_SOURCE`.
    """
    turned = (angle - angle[0]) * math.copysign(1.0, angle[-1] - angle[0])
    turned = np.maximum.accumulate(turned)
    sense = math.copysign(1.0, float(angle[-1] - angle[0]))
    lead = 0.0 if start is None else float((sense * (start - angle[0])) % REVOLUTION)
    turns = int((turned[-1] - lead) // REVOLUTION) if turned[-1] >= lead else 0
    if turns < 1:
        raise RecordingError(
            "angle of the shaft",
            f"{float(turned[-1]) / REVOLUTION:.2f} turns in the window",
            "one whole turn at least",
            "A shaft at rest has no orders; choose a point at which it turns.",
        )
    borders = lead + np.arange(turns * bins + 1) * (REVOLUTION / bins)
    crossed = np.interp(borders, turned, np.arange(len(turned), dtype=np.float64))
    passed = np.diff(crossed)
    means = np.diff(_running_integral(signal, crossed)) / passed
    return Turns(means.reshape(turns, bins), float(angle[0]) + sense * lead)


def _running_integral(signal: Array, at: Array) -> Array:
    """Integral of the signal, linear between samples, from the first sample to places between samples."""
    whole = np.concatenate(([0.0], np.cumsum((signal[1:] + signal[:-1]) / 2.0)))
    place = np.minimum(at.astype(np.int64), len(signal) - 2)
    part = at - place
    return np.asarray(whole[place] + part * (signal[place] + part * (signal[place + 1] - signal[place]) / 2.0))


@dataclass(frozen=True)
class AverageTurn:
    """The average of a signal over whole turns.

    Parameters
    ----------
    mean, u : (b,) array
        Mean over the turns at each step of angle, and its standard uncertainty from their scatter; NaN with one turn.
    turns : int
        Whole turns.
    """

    mean: Array
    u: Array
    turns: int


def average_turn(turns: Turns) -> AverageTurn:
    """The synchronous average: what repeats with each turn stays, what does not falls with the root of their number."""
    count = len(turns.values)
    scatter = turns.values.std(axis=0, ddof=1) if count > 1 else np.full(turns.values.shape[1], np.nan)
    return AverageTurn(turns.values.mean(axis=0), scatter / math.sqrt(count), count)


def order_amplitudes(turns: Turns) -> tuple[Array, Array]:
    """Orders and magnitudes of their amplitudes over all whole turns, the filter of the steps given back.

    Returns
    -------
    orders, magnitudes : (k,) array
        Orders from 0 to a quarter of the steps a turn, in steps of one over the number of turns.
    """
    count, bins = turns.values.shape
    spectrum = fft.rfft(turns.values.reshape(-1)) * (2.0 / turns.values.size)
    orders = np.arange(len(spectrum)) / count
    kept = orders <= bins / 4.0
    magnitude = np.abs(spectrum[kept]) / np.sinc(orders[kept] / bins)
    magnitude[0] /= 2.0
    return orders[kept], np.asarray(magnitude)
