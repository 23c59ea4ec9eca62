"""Signals of a foreign file as they look: range, steps, wraps, and whether they stand still."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.importers.rows import UNEVEN
from pmg.pipeline.importers.source import ROWS, SourceChannel, Wanted
from pmg.pipeline.wording.plurals import counted
from pmg.pipeline.wording.units import MILLI
from pmg.sim.errors import RecordingError
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.importers.source import ForeignSource
    from pmg.sim.signals import Array

LOOKED_AT_BLOCKS = 2
"""Blocks of rows that are looked at."""
TOGETHER = 32
"""Channels that are read together."""
STEADY = 10
"""Steps that must all go one way beside a wrap of a signal that travels little."""
SMALLEST_COUNTER = 256.0
"""Values of the narrowest counter."""
PERIODS = (
    1.0,
    REVOLUTION,
    REVOLUTION / MILLI,
    60.0,
    360.0,
    3600.0,
    86400.0,
    *(float(1 << bits) for bits in range(8, 63)),
)
"""Values at which signals begin anew: a turn in its units, a minute, an hour, a day, a counter."""
JUMP, SMOOTH = 0.5, 0.25
"""Parts of the range: a step beyond the first may be a wrap, if all others are below the second."""


@dataclass(frozen=True)
class SeenSignal:
    """What a channel shows in the rows that were looked at.

    Parameters
    ----------
    channel : SourceChannel
        The channel as its file describes it.
    fault : str
        Why it could not be read as numbers; empty where it could. All that follows is then void.
    values, missing : int
        Values looked at, and how many of them are missing.
    whole_file : bool
        Whether these are all that it holds.
    low, high : float
        Range.
    whole_numbers, rising, even : bool
        Whether each value is a whole number, is larger than the one before, and is so by whole typical steps; with
        wraps taken out.
    step : float
        Typical step, wraps taken out.
    wraps : int
        How often it begins anew.
    wraps_at : float, optional
        Where it begins anew, of `PERIODS`.
    jumps : int
        Steps of more than half the range that are no wraps.
    """

    channel: SourceChannel
    fault: str = ""
    values: int = 0
    missing: int = 0
    whole_file: bool = False
    low: float = math.nan
    high: float = math.nan
    whole_numbers: bool = False
    rising: bool = False
    even: bool = False
    step: float = math.nan
    wraps: int = 0
    wraps_at: float | None = None
    jumps: int = 0

    @property
    def constant(self) -> bool:
        """Whether all its values are one."""
        return self.low == self.high

    def description(self) -> str:
        """The same in words."""
        parts = [f"unit {self.channel.unit}" if self.channel.unit else "no unit"]
        if self.channel.rate_hz is not None:
            parts.append(f"{self.channel.rate_hz:.9g} Hz by the file")
        if self.fault:
            return "; ".join([*parts, self.fault])
        some = counted(self.values, "value")
        parts.append(some if self.whole_file else f"first {some}")
        parts += [f"{self.missing} of them missing"] if self.missing else []
        if self.missing == self.values:
            return "; ".join(parts)
        parts.append(f"constant at {self.low:.6g}" if self.constant else f"from {self.low:.6g} to {self.high:.6g}")
        parts += ["whole numbers"] if self.whole_numbers else []
        if self.rising:
            parts.append(f"rises steadily, {'in even' if self.even else 'not in even'} steps of {self.step:.6g}")
        if self.wraps:
            place = "" if self.wraps_at is None else f" at {self.wraps_at:.9g}"
            parts.append(f"begins anew{place}, {counted(self.wraps, 'time')}")
        return "; ".join(parts)

    def document(self) -> dict[str, Any]:
        """The same as JSON."""
        found: dict[str, Any] = {"unit": self.channel.unit, "rate_hz": self.channel.rate_hz, "fault": self.fault}
        if self.fault or self.missing == self.values:
            return found | {"values": self.values, "missing": self.missing}
        return found | {
            "values": self.values,
            "missing": self.missing,
            "whole_file": self.whole_file,
            "low": self.low,
            "high": self.high,
            "constant": self.constant,
            "whole_numbers": self.whole_numbers,
            "rising": self.rising,
            "even": self.even,
            "step": self.step if math.isfinite(self.step) else None,
            "wraps": self.wraps,
            "wraps_at": self.wraps_at,
        }


def look_at(source: ForeignSource) -> tuple[SeenSignal, ...]:
    """Every channel of a file, by its first rows; one that holds no numbers with the reason."""
    lengths: dict[int | None, list[SourceChannel]] = {}
    for channel in source.channels:
        lengths.setdefault(channel.length, []).append(channel)
    found: dict[str, SeenSignal] = {}
    for alike in lengths.values():
        for first in range(0, len(alike), TOGETHER):
            found |= {seen.channel.name: seen for seen in _together(source, alike[first : first + TOGETHER])}
    return tuple(found[channel.name] for channel in source.channels)


def _seen_signal(channel: SourceChannel, values: Array, whole_file: bool) -> SeenSignal:
    """A channel by some of its values (n,); NaN where one is missing."""
    known = values[np.isfinite(values)]
    missing = len(values) - len(known)
    if not len(known):
        return SeenSignal(channel, "", len(values), missing, whole_file)
    low, high = float(known.min()), float(known.max())
    whole = bool((known == np.floor(known)).all())
    steps = np.diff(known)
    beyond = int(np.count_nonzero(np.abs(steps) > JUMP * (high - low)))
    jumps, period = _wraps(steps, high - low, whole)
    if jumps.any() and period is not None:
        steps = np.where(jumps, steps - np.copysign(period, steps), steps)
    step = float(np.median(steps)) if len(steps) else math.nan
    rising = len(steps) > 0 and bool((steps > 0.0).all()) and (period is not None or not jumps.any())
    even = False
    if rising:
        samples = steps / step
        even = bool((np.abs(samples - np.rint(samples)) <= UNEVEN).all() and (np.rint(samples) >= 1.0).all())
        step = float(steps.sum() / np.rint(samples).sum()) if even else step
    return SeenSignal(
        channel,
        "",
        len(values),
        missing,
        whole_file,
        low,
        high,
        whole,
        rising,
        even,
        step,
        int(np.count_nonzero(jumps)),
        period,
        beyond - int(np.count_nonzero(jumps)),
    )


def _together(source: ForeignSource, channels: Sequence[SourceChannel]) -> Iterator[SeenSignal]:
    """Channels read in one go; one by one where one of them spoils that."""
    wanted = [Wanted(channel.name) for channel in channels]
    try:
        blocks = list(islice(source.blocks(wanted), LOOKED_AT_BLOCKS))
    except RecordingError as fault:
        if len(channels) == 1:
            yield SeenSignal(channels[0], f"not read: {fault.came}")
            return
        for channel in channels:
            yield from _together(source, [channel])
        return
    for channel, want in zip(channels, wanted, strict=True):
        parts = [np.asarray(block.columns[want], dtype=np.float64) for block in blocks]
        values = np.concatenate(parts) if parts else np.zeros(0)
        whole = len(values) < LOOKED_AT_BLOCKS * ROWS if channel.length is None else len(values) >= channel.length
        yield _seen_signal(channel, values, whole)


def _wraps(steps: Array, extent: float, whole: bool) -> tuple[Any, float | None]:
    """Which steps are wraps (n,), and at which of `PERIODS` they are.

    Notes
    -----
    Wraps all go one way, against the sum of the other steps, and these are small: so a torque that is switched on and
    a noisy signal are none. The range falls short of the period by no more than a step. Whole numbers whose range is
    that of a counter, and what otherwise rises or falls at each step, wrap even where they travel little.
    """
    jumps = np.abs(steps) > JUMP * extent
    none = np.zeros(len(steps), dtype=np.bool_)
    if not jumps.any() or extent <= 0.0:
        return none, None
    others, down = steps[~jumps], bool((steps[jumps] < 0.0).all())
    one_way = down or bool((steps[jumps] > 0.0).all())
    largest = float(np.abs(others).max()) if len(others) else math.inf
    travel = float(others.sum()) if len(others) else 0.0
    fitting = [period for period in PERIODS if extent * (1.0 - 1e-9) <= period <= extent + 2.0 * largest]
    far = JUMP * extent
    steady = len(others) >= STEADY and bool((others > 0.0).all() or (others < 0.0).all())
    if len(fitting) == 1 and (steady or (whole and fitting[0] >= SMALLEST_COUNTER)):
        far = 0.0
    against = travel > far if down else travel < -far
    if not (one_way and against) or largest > SMOOTH * extent:
        return none, None
    return jumps, fitting[0] if len(fitting) == 1 else None
