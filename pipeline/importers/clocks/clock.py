"""Clocks as they are: a recorded time column turned into stretches of even sampling, each fault told."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline

from pmg.pipeline.importers.clocks.jitter import reading_of, resampled
from pmg.pipeline.importers.clocks.sample_count import LONGEST_FILLED, count_samples, resolution_of
from pmg.pipeline.importers.clocks.time_column import time_column
from pmg.pipeline.importers.rows import DRIFT_TOLD, WHOLE_RATE
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy.typing as npt

    from pmg.pipeline.importers.clocks.sample_count import SampleCount
    from pmg.pipeline.importers.clocks.time_column import TimeColumn
    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array, Mask

EVEN_STEP = 0.01
"""Part by which each step of an even clock may differ from that of its rate."""

LARGEST_DRIFT = 0.01
"""Part by which the rate of the time column may differ from the nominal one."""

SURE_DRIFT = 4.0
"""Standard errors beyond which a difference from the nominal rate is one."""

LARGEST_SCATTER = 5.0
"""Root mean square of jitter beyond which rows cannot be taken as even samples [samples]."""

AROUND, LEAST_AROUND = 8, 2.0 / 3.0
"""Samples on either side of missing ones, and the part of all these that must be there for those to be filled."""

SHORT_TAIL = 0.05
"""Part of the samples of a file below which a last stretch may be the tail of the next test."""

MOST_PAUSES = 0.1
"""Pauses over rows beyond which times are none of a recording."""


@dataclass(frozen=True)
class EvenStretch:
    """A part of a recording on an even clock.

    Parameters
    ----------
    rows : slice
        Rows of the file that it is made of, from 0 on.
    start : float
        Time of its first sample [s].
    time : (m,) array
        Time of each sample [s]; as recorded where the clock is even and no sample is missing.
    channels : mapping of str to (m,) array
        Values on these times, in their own units.
    """

    rows: slice
    start: float
    time: Array
    channels: Mapping[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class Clock:
    """The even clock of a recording.

    Parameters
    ----------
    rate_hz : float
        Samples per second by the time column [Hz]; the nominal rate where they do not differ.
    stretches : tuple of EvenStretch
        In the order of the file; between them the recorder paused.
    """

    rate_hz: float
    stretches: tuple[EvenStretch, ...]


def even_stretches(
    time: Array, rate_hz: float | None, signals: Mapping[str, npt.NDArray[Any]], where: str, findings: Findings
) -> Clock:
    """A recording on an even clock, stretch by stretch, whatever its time column is like.

    Parameters
    ----------
    time : (n,) array
        As recorded [s].
    rate_hz : float, optional
        Nominal sample rate [Hz]; found in the time column where it is left out.
    signals : mapping of str to (n,) array
        The other channels by name, in their own units. They decide between the readings of jitter.
    where : str
        File and channel, for errors.
    findings : Findings
        Receives each fault of the clock with its number.

    Returns
    -------
    Clock
        Rows of an even clock come through as they are, without a finding.

    Raises
    ------
    RecordingError
        When rows are out of order, two rows of one time disagree, the rate is not the nominal one, or the times tell
        of no even sampling.

    Notes
    -----
    Times that begin anew are counted on and repeated rows left out. Rows are then counted against the rate of the time
    column; up to four missing samples are filled by a cubic spline, a longer step begins a new stretch. Where steps
    scatter, samples are even if the times are multiples of a coarse resolution, or if the signals are as smooth that
    way; only if they are clearly smoother when placed at their times, they are resampled from there by a cubic
    spline.
    """
    column = time_column(time, rate_hz, signals, where, findings)
    if float(np.ptp(column.time)) == 0.0:
        raise RecordingError(where, "the same time throughout", "times that grow", "Check the time channel.")
    count = count_samples(column.time)
    if count.breaks.sum() > max(3.0, MOST_PAUSES * len(column.time)):
        came = f"{count.breaks.sum()} pauses in {len(column.time)} rows"
        raise RecordingError(where, came, "rows that follow one another", "Check the time channel.")
    rate = _settled_rate(count, rate_hz, where, findings)
    taken, even = _scatter(column, count, where, findings)
    breaks = count.breaks | (_crowded(count) if not taken else np.zeros_like(count.breaks))
    ends = np.concatenate(([0], np.flatnonzero(breaks) + 1, [len(column.time)]))
    _tell_missing(column, count, breaks, rate, findings)
    stretches = tuple(
        _stretch(column, count, slice(int(low), int(high)), rate, (taken, even), where) for low, high in pairwise(ends)
    )
    _tell_tail(stretches, findings)
    return Clock(rate, stretches)


def _settled_rate(count: SampleCount, nominal: float | None, where: str, findings: Findings) -> float:
    """The rate that is used [Hz]; refused where it is far from the nominal one, told where it differs at all."""
    own = count.rate_hz
    if nominal is None:
        near = max(WHOLE_RATE, min(SURE_DRIFT * count.error, 1e-4))
        return float(round(own)) if own >= 0.5 and abs(own - round(own)) <= near * own else own
    drift = own / nominal - 1.0
    if not abs(drift) < LARGEST_DRIFT:
        came = f"{own:.9g} samples per second"
        raise RecordingError(where, came, f"{nominal:g} within {LARGEST_DRIFT:.0%}", "Correct rate or unit of time.")
    if abs(drift) <= max(DRIFT_TOLD, SURE_DRIFT * count.error):
        return nominal
    findings.info(
        Code.CLOCK_DRIFT,
        "time",
        f"{own:.9g} samples per second, {drift * 1e6:+.0f} ppm off the nominal {nominal:g}; the time column is used",
        "Decide which clock is right; speeds scale with it.",
    )
    return own


def _scatter(column: TimeColumn, count: SampleCount, where: str, findings: Findings) -> tuple[bool, bool]:
    """Whether samples were taken at the scattered times, and whether no step scatters at all."""
    inner = ~count.breaks
    steps = np.diff(column.time)[inner] * count.rate_hz
    if not len(steps) or float(np.abs(steps - count.steps[inner]).max()) <= EVEN_STEP:
        return False, True
    rms, most = float(np.sqrt(np.mean(count.jitter**2))), float(np.abs(count.jitter).max())
    tick = resolution_of(column.time) * count.rate_hz
    if 2.0 * most <= 1.5 * tick:
        findings.info(
            Code.CLOCK_UNEVEN,
            "time",
            f"times are multiples of {tick / count.rate_hz:.3g} s, {tick:.3g} samples; rows are taken as even samples",
            "Nothing to do; export times with more digits to be sure.",
        )
        return False, False
    reading = reading_of(count.jitter, count.breaks | (count.steps > 1), column.signals.values())
    if not reading.taken and rms > LARGEST_SCATTER * count.packet:
        came = f"times that scatter by {rms:.3g} samples rms about an even clock, and signals that do not follow them"
        do = "Check the time channel, or record the time at which samples are taken."
        raise RecordingError(where, came, f"jitter of a sample or two at {count.rate_hz:.6g} Hz", do)
    size = f"times scatter by {rms:.3g} samples rms, {most:.3g} at most, about {count.rate_hz:.6g} Hz; "
    share = f"{reading.share:.2f} of it, standard error {reading.error:.2g}"
    if reading.taken:
        text = f"the signals follow ({share}): samples were taken at these times, and are resampled by a cubic spline"
        findings.info(Code.CLOCK_UNEVEN, "time", size + text, "Nothing to do.")
    elif reading.clear:
        text = f"the signals do not follow ({share}): samples are even, and the times were stamped late"
        findings.info(Code.CLOCK_UNEVEN, "time", size + text, "Nothing to do.")
    else:
        text = f"the signals do not tell whether samples were taken at these times ({share}): they are taken as even"
        findings.warning(Code.CLOCK_UNEVEN, "time", size + text, "Look up when the recorder stamps its samples.")
    return reading.taken, False


def _crowded(count: SampleCount) -> Mask:
    """Steps with missing samples that have too few recorded ones around them to be filled (n - 1,)."""
    gaps = np.flatnonzero((count.steps > 1) & ~count.breaks)
    crowded = np.zeros(len(count.steps), dtype=bool)
    index = np.concatenate(([0], np.cumsum(np.where(count.breaks, LONGEST_FILLED + 2 * AROUND, count.steps))))
    low, high = index[gaps] - AROUND, index[gaps + 1] + AROUND
    there = np.searchsorted(index, high, "right") - np.searchsorted(index, low, "left")
    spans = np.minimum(high, index[-1]) - np.maximum(low, index[0]) + 1
    crowded[gaps] = there < LEAST_AROUND * spans
    return crowded


def _tell_missing(column: TimeColumn, count: SampleCount, breaks: Mask, rate: float, findings: Findings) -> None:
    """Tell how many samples are filled, and each pause."""
    gaps = (count.steps > 1) & ~breaks
    if gaps.any():
        lost, whole = int((count.steps[gaps] - 1).sum()), int(count.steps[~breaks].sum()) + int(breaks.sum()) + 1
        findings.warning(
            Code.SAMPLES_GAP,
            "time",
            f"{counted(lost, 'sample')} missing in {counted(int(gaps.sum()), 'place')}, {lost / whole:.2%} of all, the "
            f"first after {column.time[np.argmax(gaps)]:.6g} s; filled by interpolation",
            "Look up why the recorder lost them.",
            lost=counted(lost, "sample"),
        )
    for row in np.flatnonzero(breaks):
        length = float(column.time[row + 1] - column.time[row])
        text = f"a pause of {length:.6g} s, {length * rate:.5g} samples, after {column.time[row]:.6g} s (row "
        text += f"{column.rows[row] + 1}); a new stretch begins"
        if not count.breaks[row]:
            text = text.replace("a pause", "a gap near others,", 1)
        findings.warning(Code.SAMPLES_GAP, "time", text, "Look up why the recorder paused.")


def _stretch(
    column: TimeColumn, count: SampleCount, part: slice, rate: float, how: tuple[bool, bool], where: str
) -> EvenStretch:
    """Some rows on the even clock; `how` says whether they were taken at their times, and whether those are even."""
    taken, even = how
    time, steps = column.time[part], count.steps[part.start : part.stop - 1]
    rows = slice(int(column.rows[part.start]), int(column.rows[part.stop - 1]) + 1)
    signals = {name: values[part] for name, values in column.signals.items()}
    if not taken and (steps == 1).all():
        if even or len(time) == 1:
            return EvenStretch(rows, float(time[0]), time, signals)
        start = float(np.mean(time - np.arange(len(time)) / rate))
        return EvenStretch(rows, start, start + np.arange(len(time)) / rate, signals)
    for name, values in signals.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            row = column.rows[part.start + bad[0]] + 1
            came = f"{name}: {len(bad)} values are no numbers, the first in row {row}, where samples are interpolated"
            raise RecordingError(where, came, "numbers", "Mend or cut the recording.")
    if taken:
        start = float(time.min())
        places = (time - start) * rate
        length = int(np.floor(places.max() + 1e-6)) + 1
        channels = {name: resampled(places, values, length) for name, values in signals.items()}
    else:
        index = np.concatenate(([0], np.cumsum(steps)))
        start = float(time[0]) if even else float(np.mean(time - index / rate))
        length = int(index[-1]) + 1
        channels = {name: _filled(index, values, length) for name, values in signals.items()}
    return EvenStretch(rows, start, start + np.arange(length) / rate, channels)


def _filled(index: npt.NDArray[np.int64], values: npt.NDArray[Any], length: int) -> Array:
    """Values at their places, missing ones by a cubic spline (length,)."""
    whole = np.full(length, np.nan)
    whole[index] = values
    missing = np.flatnonzero(np.isnan(whole))
    whole[missing] = CubicSpline(index, values)(missing)
    return whole


def _tell_tail(stretches: tuple[EvenStretch, ...], findings: Findings) -> None:
    """Tell a short last stretch."""
    counts = [len(stretch.time) for stretch in stretches]
    if len(counts) > 1 and counts[-1] < SHORT_TAIL * sum(counts):
        findings.info(
            Code.SAMPLES_GAP,
            "time",
            f"the last stretch, from {stretches[-1].start:.6g} s on, has {counts[-1]} of {sum(counts)} samples; it may "
            "be the tail of the next test",
            "Leave it out if it is.",
        )
