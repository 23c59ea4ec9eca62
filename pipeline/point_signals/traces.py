"""Samples of a run condensed to the signals of one window and what lies next to it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.point_signals.cell import Bins, ChannelSignals
from pmg.pipeline.point_signals.spectrum import amplitude_spectrum
from pmg.pipeline.windows.reduce import CUTOFF_HZ, end_to_end_speed, low_pass

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Signal

MARGIN = 0.15
"""Stretch shown before and after a window, as part of its length, as far as the recording reaches."""
MOST_BINS, FEWEST_SHOWN = 300, 60
"""Bins of a signal: most, and what a page with very many points leaves it at least."""
PLENTY = 400
"""Points up to which each has `MOST_BINS`; with more, they share as many bins, so that a page stays a page."""
MOST_FILTERED = 120
"""Most values of a filtered signal: two a period up to the cut-off for windows of two minutes; beyond, too few."""
COUNT_SHARE = 0.005
"""Part of the mean speed that one count of the encoder over a bin should not exceed."""
LONGEST_BIN = 0.5
"""Longest bin of a speed that is chosen for that reason [s]: half a period at the filter's cut-off."""
FEWEST_BINS = 20
"""Bins that a speed keeps at least, for the same reason."""


@dataclass(frozen=True)
class Stretch:
    """Rows of a run: `start` to `end` are shown, `first` to `stop` are the window; ends are left out.

    `rate` is the sample rate [Hz], `most` how many bins there are at most.
    """

    start: int
    first: int
    stop: int
    end: int
    rate: float
    most: int = MOST_BINS

    @property
    def seconds(self) -> tuple[float, float, float, float]:
        """The four, from the start of the window [s]."""
        start, stop, end = ((row - self.first) / self.rate for row in (self.start, self.stop, self.end))
        return start, 0.0, stop, end


def bins_for(points: int) -> int:
    """Most bins of a signal on a page with so many points."""
    return max(min(MOST_BINS, MOST_BINS * PLENTY // max(points, 1)), FEWEST_SHOWN)


def stretch_of(first: int, stop: int, rows: int, rate: float, margin: float = MARGIN, most: int = MOST_BINS) -> Stretch:
    """The rows of a window and its margins.

    Parameters
    ----------
    first, stop : int
        The window, `stop` left out, counted from the first row of the run; cut to what the run holds.
    rows : int
        Rows of the run.
    rate : float
        Sample rate [Hz].
    margin : float
        Part of the window that is shown on each side.
    most : int
        Bins at most.
    """
    first = min(max(first, 0), rows)
    stop = min(max(stop, first), rows)
    flank = round(margin * (stop - first))
    return Stretch(max(first - flank, 0), first, stop, min(stop + flank, rows), rate, most)


def _binned(stretch: Stretch, most: int | None = None) -> tuple[Bins, npt.NDArray[np.int64]]:
    """Bins of a stretch, and the rows at which they begin, the end of the last one behind them.

    A bin is one row at least; a part that holds rows has a bin at least, however few there are to be. There are as many
    as the stretch allows, or `most`.
    """
    most = stretch.most if most is None else most
    borders = (stretch.start, stretch.first, stretch.stop, stretch.end)
    rows = max(stretch.end - stretch.start, 1)
    before, _, after = (b - a for a, b in pairwise(borders))
    outer = [min(n, max(most * n // rows, 1)) for n in (before, after)]
    inner = min(stretch.stop - stretch.first, max(most - sum(outer), 1))
    counts = (outer[0], inner, outer[1])
    edges = [
        a + np.arange(count, dtype=np.int64) * (b - a) // max(count, 1)
        for a, b, count in zip(borders[:-1], borders[1:], counts, strict=True)
    ]
    return Bins(stretch.seconds, counts), np.concatenate([*edges, np.array([stretch.end], dtype=np.int64)])


def torque_signals(signal: Signal, torque: Array, stretch: Stretch, resolution: float = math.nan) -> ChannelSignals:
    """A torque: envelope, the window filtered, its spectrum.

    Parameters
    ----------
    signal : Signal
        Which torque.
    torque : (n,) array
        The torque of the run [N m]; NaN in gaps.
    stretch : Stretch
        The window, of a row at least.
    resolution : float
        Step between neighbouring values [N m].

    Notes
    -----
    Mean and uncertainty are those of the grid, which stands elsewhere; here they are NaN.
    """
    bins, edges = _binned(stretch)
    shown = torque[stretch.start : stretch.end]
    known = np.where(np.isfinite(shown), shown, np.nan)
    window = known[stretch.first - stretch.start : stretch.stop - stretch.start]
    whole = bool(np.isfinite(window).all())
    rows = _spread(len(window))
    return ChannelSignals(
        signal=signal,
        bins=bins,
        low=np.fmin.reduceat(known, edges[:-1] - stretch.start),
        high=np.fmax.reduceat(known, edges[:-1] - stretch.start),
        filtered=low_pass(window, stretch.rate, CUTOFF_HZ)[rows] if whole else np.empty(0),
        span=(0.0, float(rows[-1]) / stretch.rate) if whole else (0.0, 0.0),
        mean=math.nan,
        u=math.nan,
        expanded=math.nan,
        resolution=resolution,
        spectrum=amplitude_spectrum(window, stretch.rate) if whole else None,
        remark="" if whole else "a gap in the window: no filtered signal, no spectrum",
    )


def speed_signals(signal: Signal, angle: Array, stretch: Stretch, count: float) -> ChannelSignals:
    r"""A speed: its means over bins, and those of the window filtered.

    Parameters
    ----------
    signal : Signal
        Which speed.
    angle : (n,) array
        Unwrapped angle of the shaft over the run [rad]; NaN in gaps.
    stretch : Stretch
        The window, of a row at least.
    count : float
        Angle of one count of the encoder [rad]; NaN where it is not known.

    Notes
    -----
    One count a sample is a hundred rpm and more, so a speed is the difference of the angle over a bin, end to end. Bins
    are so long that one count over them is at most `COUNT_SHARE` of the mean speed, but neither beyond `LONGEST_BIN`
    nor fewer than `FEWEST_BINS`, and never shorter than those of the torques; `resolution` is one count over a bin. The
    bins of the window lie between its own first and last sample. Each end of a difference is rounded down to a count,
    so the mean over a window of length T has the triangular distribution of half-width :math:`\delta/T` and
    :math:`u = \delta / (\sqrt 6 T)` (GUM 4.3.9); the angle errors of the encoder's disk are not known. The half-width
    of its 95 % interval is :math:`(1 - \sqrt{0.05}) \delta / T`.
    """
    length = max(stretch.stop - stretch.first - 1, 1) / stretch.rate
    mean = end_to_end_speed(angle[stretch.first : stretch.stop], stretch.rate)
    shown = max(stretch.end - stretch.start, 1) / stretch.rate
    needed = count / (COUNT_SHARE * abs(mean)) if abs(mean) > 0.0 else math.inf
    longest = min(LONGEST_BIN, shown / FEWEST_BINS)
    step = max(shown / stretch.most, longest if math.isnan(needed) else min(needed, longest))
    bins, edges = _binned(stretch, max(min(int(shown / step), (stretch.stop - stretch.first) // 2), 1))
    starts, ends = edges[:-1], edges[1:].copy()
    ends[bins.within.stop - 1] = stretch.stop - 1
    ends[-1] = stretch.end - 1
    speed = _differences(angle, starts, ends, stretch.rate)
    inner = speed[bins.within]
    whole = bool(np.isfinite(inner).all())
    rate = len(inner) / length
    rows = _spread(len(inner))
    filtered = low_pass(inner, rate, CUTOFF_HZ)[rows] if whole else np.empty(0)
    middles = (rows[[0, -1]] + 0.5) / rate
    return ChannelSignals(
        signal=signal,
        bins=bins,
        low=speed,
        high=speed,
        filtered=filtered,
        span=(float(middles[0]), float(middles[1])) if whole else (0.0, 0.0),
        mean=mean,
        u=count / (math.sqrt(6.0) * length),
        expanded=(1.0 - math.sqrt(0.05)) * count / length,
        resolution=count * rate,
        remark="" if whole else "a gap in the window: no filtered signal",
    )


def _differences(angle: Array, starts: npt.NDArray[np.int64], ends: npt.NDArray[np.int64], rate: float) -> Array:
    """Mean speed between rows of an angle [rad/s]; over a gap from the known angles between them."""
    rows = ends - starts
    speed = np.full(len(rows), np.nan)
    np.divide((angle[ends] - angle[starts]) * rate, rows, out=speed, where=rows > 0)
    for place in np.flatnonzero(~np.isfinite(speed)):
        speed[place] = end_to_end_speed(angle[starts[place] : ends[place] + 1], rate)
    return speed


def _spread(n: int) -> npt.NDArray[np.int64]:
    """At most `MOST_FILTERED` of n rows, equally spaced, the first and the last among them."""
    return np.round(np.linspace(0, n - 1, min(n, MOST_FILTERED))).astype(np.int64)
