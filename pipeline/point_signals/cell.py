"""The signals behind a point of a grid, condensed for a page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Signal


@dataclass(frozen=True)
class Bins:
    """Stretches of time over a window and what was recorded next to it.

    Parameters
    ----------
    edges : tuple of four floats
        Start of what is shown, start and stop of the window, end of what is shown, from the start of the window [s];
        the second is 0. No bin lies on both sides of a window's start or stop.
    counts : tuple of three ints
        Bins before, within and after the window; those of one part are equally long, to a sample.
    """

    edges: tuple[float, float, float, float]
    counts: tuple[int, int, int]

    @property
    def middles(self) -> Array:
        """Middle of each bin, from the start of the window [s]."""
        parts = []
        for start, stop, count in zip(self.edges[:-1], self.edges[1:], self.counts, strict=True):
            parts.append(start + (stop - start) * (np.arange(count) + 0.5) / max(count, 1))
        return np.concatenate(parts)

    @property
    def within(self) -> slice:
        """The bins of the window."""
        return slice(self.counts[0], self.counts[0] + self.counts[1])


@dataclass(frozen=True)
class Spectrum:
    """Amplitudes of a signal over its window, the largest of each of some bins of frequency.

    Parameters
    ----------
    frequency : (m,) array
        Where the largest amplitude of a bin stands [Hz], rising.
    amplitude : (m,) array
        That amplitude, in the signal's unit: a sine of amplitude A shows A.
    resolution : float
        Difference of frequency that the window can tell apart, one over its length [Hz].
    """

    frequency: Array
    amplitude: Array
    resolution: float


@dataclass(frozen=True)
class ChannelSignals:
    """One signal over a window and next to it, in SI.

    Parameters
    ----------
    signal : Signal
        Which.
    bins : Bins
        Time.
    low, high : (b,) array
        Least and largest recorded value of each bin, NaN where nothing was recorded. Of a speed both are the same: its
        mean over the bin.
    filtered : (m,) array
        The signal of the window after the filter; empty where it cannot be filtered.
    span : tuple of two floats
        Times of the first and the last of these values, from the start of the window [s]; they are equally spaced, to
        half a sample.
    mean, u, expanded : float
        Mean of the window, its standard uncertainty and its 95 % interval's half-width; NaN where not known.
    resolution : float
        Step between values: of a torque as recorded, of a speed one count of the encoder over a bin; NaN if not known.
    spectrum : Spectrum or None
        Of a torque.
    remark : str
        What is lacking and why; empty where nothing is.
    """

    signal: Signal
    bins: Bins
    low: Array
    high: Array
    filtered: Array
    span: tuple[float, float]
    mean: float
    u: float
    expanded: float
    resolution: float
    spectrum: Spectrum | None = None
    remark: str = ""


@dataclass(frozen=True)
class BudgetRow:
    """One contribution to the uncertainty of a torque: type ``A`` or ``B``, `u` [N m], NaN where nothing is stated."""

    key: str
    name: str
    kind: str
    distribution: str
    common: bool
    u: float
    dof: float
    remark: str


@dataclass(frozen=True)
class ShaftRows:
    """The uncertainty budget of one shaft at a point.

    Parameters
    ----------
    side : str
        ``sun`` or ``ring``.
    torque : float
        Mean torque [N m].
    rows : tuple of BudgetRow
        The contributions.
    independent, common, u : float
        Standard uncertainty that differs from point to point, that all points share, and both together [N m].
    dof, factor, expanded : float
        Effective degrees of freedom, coverage factor, and half-width of the 95 % interval [N m].
    """

    side: str
    torque: float
    rows: tuple[BudgetRow, ...]
    independent: float
    common: float
    u: float
    dof: float
    factor: float
    expanded: float


@dataclass(frozen=True)
class CellSignals:
    """Signals behind one point of a grid. Each row of a grid is one window: repeats are rows of their own.

    Parameters
    ----------
    row : int
        Row of the grid.
    point : str
        Test point.
    accepted : bool
        Whether the point is used.
    reasons : tuple of str
        Why not; of an accepted point what one should know all the same.
    flags : tuple of str
        What the budget calls attention to in this window.
    turns : tuple of two floats
        Turns of sun and ring per second [Hz]; 0 at rest, NaN where the speed is not known.
    shafts : tuple of ShaftRows
        Uncertainty budgets.
    file : str
        Recording; empty where it was not found.
    rate : float
        Sample rate of the recording [Hz].
    first_sample, stop_sample : int
        The window in the recording, `stop_sample` left out.
    channels : tuple of ChannelSignals
        The signals; none where the samples were not found.
    lacking : str
        Why there are no signals; empty where there are.
    """

    row: int
    point: str
    accepted: bool
    reasons: tuple[str, ...]
    flags: tuple[str, ...]
    turns: tuple[float, float]
    shafts: tuple[ShaftRows, ...]
    file: str = ""
    rate: float = float("nan")
    first_sample: int = 0
    stop_sample: int = 0
    channels: tuple[ChannelSignals, ...] = ()
    lacking: str = ""
