"""Counters that wrap: unwrapped, and turned into angle and frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

RATE_NEIGHBOURS = 64
"""Samples on each side of a gap from which the rate across it is foretold."""
LOWEST_FREQUENCY_HZ = 1000.0
"""A transducer's output slower than this has stopped: the lowest rated frequency is 5 kHz [Hz]."""
DRIFT_PERIODS = 2.0
"""Slip of the edge times against the samples over a run, in periods, from which on it is a drift."""
LARGEST_DRIFT = 1e-3
"""Relative drift beyond which it is no oscillator's error but a wrong rate or a dead signal."""


def unwrap(
    values: npt.NDArray[Any], at: npt.NDArray[np.int64], bits: int, per_sample: float | None = None
) -> tuple[npt.NDArray[np.int64], int]:
    """Count without wraps, and over how many gaps it is a guess.

    Parameters
    ----------
    values : (n,) array of unsigned int
        Counter readings in ``0 <= value < 2**bits``.
    at : (n,) array of int
        Sample index of each, increasing.
    bits : int
        Width of the counter.
    per_sample : float, optional
        Counts expected per sample. Without it, none between neighbours, and across a gap the mean of the
        rates around it.

    Returns
    -------
    count : (n,) array of int
        Begins with the first reading; each step is the one nearest to the expected step.
    guesses : int
        Gaps around which the rates differ by so much that another number of wraps fits as well.

    Notes
    -----
    A step is only known modulo the counter's range, so it is right while it lies within half the range of
    what is expected. That holds in both directions of rotation.
    """
    modulus = 1 << bits
    whole = values.astype(np.int64)
    raw, spans = whole[1:] - whole[:-1], at[1:] - at[:-1]
    if per_sample is not None:
        return _sum(values, _nearest(raw, np.rint(per_sample * spans).astype(np.int64), modulus)), 0
    steps = _nearest(raw, np.zeros_like(raw), modulus)
    guesses = 0
    gaps = np.flatnonzero(spans > 1)
    for gap in gaps:
        before = steps[max(0, gap - RATE_NEIGHBOURS) : gap]
        after = steps[gap + 1 : gap + 1 + RATE_NEIGHBOURS]
        rates = [float(side.mean()) for side in (before, after) if len(side)]
        rate = float(np.mean(rates)) if rates else 0.0
        expected = np.rint(rate * spans[gap : gap + 1]).astype(np.int64)
        steps[gap : gap + 1] = _nearest(raw[gap : gap + 1], expected, modulus)
        spread = max(rates) - min(rates) if rates else float(modulus)
        guesses += bool(spread * float(spans[gap]) >= modulus / 4)
    return _sum(values, steps), guesses


def _nearest(raw: npt.NDArray[np.int64], expected: npt.NDArray[np.int64], modulus: int) -> npt.NDArray[np.int64]:
    """The steps congruent to `raw` that lie nearest to the expected ones."""
    half = modulus // 2
    return expected + (raw - expected + half) % modulus - half


def _sum(values: npt.NDArray[Any], steps: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    return np.concatenate((values[:1].astype(np.int64), steps)).cumsum()


@dataclass(frozen=True)
class EdgeFrequency:
    """Frequency from edge counts.

    Parameters
    ----------
    frequency : (n,) array
        Mean frequency over the sample interval that ends at each sample [Hz]; NaN where it is not known.
    backward : int
        Steps in which the count or the time runs backward, or one moves without the other.
    stalled : int
        Samples without a live signal.
    drift : float
        Relative excess of the time base over the sample clock; 0 where none can be seen.
    """

    frequency: Array
    backward: int
    stalled: int
    drift: float


def edge_frequency(
    edges: npt.NDArray[Any],
    ticks: npt.NDArray[Any],
    present: Mask,
    rate_hz: float,
    timebase_hz: float,
    bits: int = 32,
) -> EdgeFrequency:
    r"""Frequency at each sample from the edge count and the time of the last edge.

    Parameters
    ----------
    edges, ticks : (n,) array of unsigned int
        Wrapping count of edges and time-base tick of the last edge, at each sample.
    present : (n,) array of bool
        Where both were recorded.
    rate_hz, timebase_hz : float
        Sample rate and rate of the time base [Hz].
    bits : int
        Width of both counters.

    Notes
    -----
    The phase of the signal, in periods, is known at the edges and taken as linear between them. Read at the
    sample instants :math:`s_k`,

    .. math:: f_k = \frac{\varphi(s_k) - \varphi(s_{k-1})}{s_k - s_{k-1}},

    so the mean of :math:`f_k` over a window is the phase gained over the time it took, as if the whole window
    were one measurement: it does not depend on what happens in between. (The mean of the reciprocal periods
    does: a ripple of relative amplitude a biases it by a²/2.)

    Sample instants and ticks count on one oscillator with an unknown offset. The offset is the smallest for
    which every last edge lies at or before its sample. Where the ticks run faster or slower than the sample
    clock, their ratio is taken from the ends of the run and reported; a frequency is then in terms of the time
    base. The first sample of each stretch has no predecessor and repeats the frequency of the next one.
    """
    frequency = np.full(len(edges), np.nan)
    at = np.flatnonzero(present)
    if len(at) < 2:
        return EdgeFrequency(frequency, 0, len(at), 0.0)
    count, _ = unwrap(edges[at], at, bits)
    time, _ = unwrap(ticks[at], at, bits, per_sample=timebase_hz / rate_hz)
    moved, passed = np.diff(count), np.diff(time)
    wrong = (moved < 0) | (passed < 0) | ((moved == 0) != (passed == 0))
    fresh = np.concatenate(([True], moved > 0))
    if wrong.any() or np.count_nonzero(fresh) < 2:
        return EdgeFrequency(frequency, int(np.count_nonzero(wrong)), len(at), 0.0)
    edge_time = (time[fresh] - time[0]) / timebase_hz
    edge_phase = (count[fresh] - count[0]).astype(np.float64)
    instant, drift = _instants((time - time[0]) / timebase_hz, at, rate_hz, count - count[0])
    phase = _phase(instant, edge_time, edge_phase, slowest=1.0 / LOWEST_FREQUENCY_HZ + 1.0 / rate_hz)
    gained = np.diff(phase) / np.diff(instant)
    gained[np.diff(at) > 1] = np.nan
    frequency[at[1:]] = gained
    starts = at[:-1][np.concatenate(([True], np.diff(at)[:-1] > 1))]
    frequency[starts] = frequency[starts + 1]
    return EdgeFrequency(frequency, 0, int(np.count_nonzero(np.isnan(phase))), drift)


def _instants(
    time: Array, at: npt.NDArray[np.int64], rate_hz: float, count: npt.NDArray[np.int64]
) -> tuple[Array, float]:
    """Sample instants on the axis of the edge times, and the drift between the two."""
    nominal = (at - at[0]) / rate_hz
    last = int(np.searchsorted(count, count[-1]))
    slip = float(time[last] - nominal[last])
    period = float(time[last]) / float(count[last])
    drift = slip / float(nominal[last]) if abs(slip) > DRIFT_PERIODS * period else 0.0
    if abs(drift) > LARGEST_DRIFT:
        drift = 0.0
    instant = nominal * (1.0 + drift)
    return np.asarray(instant + np.max(time - instant)), drift


def _phase(instant: Array, edge_time: Array, edge_phase: Array, slowest: float) -> Array:
    """Phase at the sample instants [periods]; NaN where the last edge is longer ago than `slowest` [s].

    Right after the last edge before a pause, the phase goes on as before it.
    """
    segment = np.searchsorted(edge_time, instant, side="right") - 1
    segment = np.clip(segment, 0, len(edge_time) - 2)
    width = np.diff(edge_time)
    slope = np.diff(edge_phase) / width
    wide = width[segment] > slowest
    since = instant - edge_time[segment]
    steady = slope[np.where(wide, np.maximum(segment - 1, 0), segment)]
    phase = edge_phase[segment] + steady * since
    beyond = instant > edge_time[-1] + slowest
    phase[beyond | (wide & (since > slowest)) | (wide & (segment == 0))] = np.nan
    return np.asarray(phase)
