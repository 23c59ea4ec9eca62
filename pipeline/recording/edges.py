"""Frequency of a transducer's output from the count of its edges and the time of the last one."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.checks.stretches import pieces
from pmg.pipeline.recording.counters import unwrap

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

LOWEST_FREQUENCY_HZ = 1000.0
"""A transducer's output slower than this has stopped: the lowest rated frequency is 5 kHz [Hz]."""
HIGHEST_FREQUENCY_HZ = 50_000.0
"""A step of the count at more than this was not made by edges: the highest rated frequency is 15 kHz [Hz]."""
DRIFT_PERIODS = 2.0
"""Slip of the edge times against the samples over a run, in periods, from which on it is a drift."""
LARGEST_DRIFT = 1e-3
"""Relative drift beyond which it is no oscillator's error but a wrong rate or a dead signal."""
LARGEST_WRONG = 0.05
"""Part of the steps that may contradict themselves; beyond, none of the run is trusted."""


@dataclass(frozen=True)
class EdgeFrequency:
    """Frequency from edge counts.

    Parameters
    ----------
    frequency : (n,) array
        Mean frequency over the sample interval that ends at each sample [Hz]; NaN where it is not known.
    wrong : (n,) array of bool
        Samples at the end of a step in which the count or the time runs backward, one moves without the other, or
        the count moves faster than edges can come.
    stalled : (n,) array of bool
        Samples without a live signal.
    drift : float
        Relative excess of the time base over the sample clock; 0 where none can be seen.
    """

    frequency: Array
    wrong: Mask
    stalled: Mask
    drift: float


def edge_frequency(
    edges: npt.NDArray[Any],
    ticks: npt.NDArray[Any],
    present: Mask,
    rate_hz: float,
    timebase_hz: float,
    bits: tuple[int, int] = (32, 32),
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
    bits : (int, int)
        Widths of the edge counter and of the time base.

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

    A step that contradicts itself parts the run: what lies between two such steps is decoded on its own, so a
    spoilt reading costs the samples next to it and no others.
    """
    length = len(edges)
    wrong, stalled = np.zeros(length, dtype=np.bool_), np.zeros(length, dtype=np.bool_)
    at = None if present.all() else np.flatnonzero(present)
    size = length if at is None else len(at)
    if size < 2:
        stalled |= present
        return EdgeFrequency(np.full(length, np.nan), wrong, stalled, 0.0)
    count, _ = unwrap(edges if at is None else edges[at], at, bits[0])
    time, _ = unwrap(ticks if at is None else ticks[at], at, bits[1], per_sample=timebase_hz / rate_hz)
    astray = np.zeros(size - 1, dtype=np.bool_)
    for part in pieces(len(astray)):
        around = slice(part.start, part.stop + 1)
        moved, passed = np.diff(count[around]), np.diff(time[around])
        fast = moved > np.maximum(passed / timebase_hz, 1.0 / rate_hz) * HIGHEST_FREQUENCY_HZ + 1.0
        astray[part] = (moved < 0) | (passed < 0) | ((moved == 0) != (passed == 0)) | fast
    ends = np.flatnonzero(astray) + 1
    wrong[ends if at is None else at[ends]] = True
    if np.count_nonzero(astray) > max(1.0, LARGEST_WRONG * len(astray)) or not (count != count[0]).any():
        stalled |= present & ~wrong.any()
        return EdgeFrequency(np.full(length, np.nan), wrong, stalled, 0.0)
    borders = np.concatenate(([0], ends, [size]))
    frequency = np.full(length, np.nan)
    drifts = []
    for low, high in pairwise(borders.tolist()):
        count[low:high] -= int(count[low])
        seconds = _seconds(time[low:high], timebase_hz)
        places = None if at is None else at[low:high]
        own = slice(low, high) if places is None else places
        found = frequency[own]
        drifts.append((high - low, _decode(count[low:high], seconds, places, rate_hz, found)))
        frequency[own] = found
        stalled[own] = np.isnan(found)
    return EdgeFrequency(frequency, wrong, stalled & ~wrong, max(drifts)[1])


def _seconds(ticks: npt.NDArray[np.int64], timebase_hz: float) -> Array:
    """Times after the first [s], in the memory of the ticks."""
    seconds, first = ticks.view(np.float64), int(ticks[0])
    for part in pieces(len(ticks)):
        seconds[part] = (ticks[part] - first) / timebase_hz
    return seconds


def _decode(
    count: npt.NDArray[np.int64], time: Array, at: npt.NDArray[np.int64] | None, rate_hz: float, frequency: Array
) -> float:
    """Note the frequency at each sample of a stretch without contradictions; gives the drift of its time base."""
    fresh = np.concatenate(([True], count[1:] > count[:-1]))
    if np.count_nonzero(fresh) < 2:
        return 0.0
    stretch, drift = _drift(time, at, rate_hz, count)
    offset = max(float(np.max(time[part] - _nominal(at, part, rate_hz) * stretch)) for part in pieces(len(time)))
    slowest = 1.0 / LOWEST_FREQUENCY_HZ + 1.0 / rate_hz
    edge_time, edge_phase = (time, count) if fresh.all() else (time[fresh], count[fresh])
    for part in pieces(len(time) - 1):
        around = slice(part.start, part.stop + 1)
        instant = _nominal(at, around, rate_hz) * stretch + offset
        gained = np.diff(_phase(instant, edge_time, edge_phase, slowest)) / np.diff(instant)
        if at is not None:
            gained[np.diff(at[around]) > 1] = np.nan
        frequency[part.start + 1 : part.stop + 1] = gained
    starts = np.zeros(1, dtype=np.int64)
    if at is not None:
        starts = np.concatenate((starts, np.flatnonzero(at[1:-1] - at[:-2] > 1) + 1))
    frequency[starts] = frequency[starts + 1]
    return drift


def _nominal(at: npt.NDArray[np.int64] | None, part: slice, rate_hz: float) -> Array:
    """Time of some samples after the first by the sample clock [s]."""
    return np.asarray((np.arange(part.start, part.stop) if at is None else at[part] - at[0]) / rate_hz)


def _drift(
    time: Array, at: npt.NDArray[np.int64] | None, rate_hz: float, count: npt.NDArray[np.int64]
) -> tuple[float, float]:
    """Length of a second of the sample clock on the axis of the edge times, and the drift between the two."""
    last = int(np.searchsorted(count, count[-1]))
    nominal = float(_nominal(at, slice(last, last + 1), rate_hz)[0])
    slip = float(time[last]) - nominal
    period = float(time[last]) / float(count[last])
    drift = slip / nominal if abs(slip) > DRIFT_PERIODS * period else 0.0
    if abs(drift) > LARGEST_DRIFT:
        drift = 0.0
    return 1.0 + drift, drift


def _phase(instant: Array, edge_time: Array, edge_phase: npt.NDArray[np.int64], slowest: float) -> Array:
    """Phase at the sample instants [periods]; NaN where the last edge is longer ago than `slowest` [s].

    Right after the last edge before a pause, the phase goes on as before it.
    """
    # Only the edges around these samples, and the one before them, say anything of their phase.
    low = max(0, int(np.searchsorted(edge_time, instant[0], side="right")) - 2)
    high = min(len(edge_time), max(2, int(np.searchsorted(edge_time, instant[-1], side="right")) + 1))
    low = max(0, min(low, high - 3))
    near, count, ends = edge_time[low:high], edge_phase[low:high].astype(np.float64), edge_time[-1]
    segment = _segments(near, instant)
    width = np.diff(near)
    slope = np.diff(count) / width
    since = instant - near[segment]
    pauses = width > slowest
    if not pauses.any():
        phase = count[segment] + slope[segment] * since
    else:
        wide = pauses[segment]
        phase = count[segment] + slope[np.where(wide, np.maximum(segment - 1, 0), segment)] * since
        phase[wide & ((since > slowest) | (segment + low == 0))] = np.nan
    phase[instant > ends + slowest] = np.nan
    return np.asarray(phase)


def _segments(edges: Array, instant: Array) -> npt.NDArray[np.intp]:
    """Edge before each instant, at most the last but one; nothing is sought where each sample has one of its own."""
    last = len(edges) - 2
    first = max(0, int(np.searchsorted(edges, instant[0], side="right")) - 1)
    own = np.minimum(np.arange(first, first + len(instant)), last)
    if edges[first] <= instant[0] and ((edges[own] <= instant) & ((instant < edges[own + 1]) | (own == last))).all():
        return own
    return np.clip(np.searchsorted(edges, instant, side="right") - 1, 0, last)
