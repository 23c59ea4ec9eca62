"""The time column of a recording put in order: rows without a time, times that begin anew, rows that come twice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.recording.findings import Code
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy.typing as npt

    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array, Mask

KNOWN_WRAPS = (60.0, 3600.0, 86400.0, 2**16 * 1e-3, 2**16 * 1e-6, 2**32 * 1e-3, 2**32 * 1e-6, 2**32 * 1e-9)
"""Periods after which clocks begin anew [s]: minute, hour, day, and counters of 16 and 32 bits in ms, us and ns."""

LONGEST_BACK = 5.0
"""Steps by which a time may go back as jitter does, and samples that may be lost where it begins anew."""

MOST_BACK = 0.4
"""Part of all steps that may go back by jitter; in rows without order half of them do."""

ASTRAY = 0.3
"""Part of a step by which one may differ from the others before it counts as scattered."""

GENERAL = 0.2
"""Part of all steps that scatter where jitter is the rule, and not a fault of a few rows."""

MANY = 0.05
"""Part of all steps that are zero where times are coarse, and not a fault of a few rows."""

FEWEST_REGULAR = 5
"""Fewest steps of zero that show by equal distances that the times are coarse."""


@dataclass(frozen=True)
class TimeColumn:
    """Times in order, and what was recorded at them.

    Parameters
    ----------
    time : (n,) array
        As recorded, counted on where it began anew [s].
    rows : (n,) array of int
        The row of the file that each stood in, from 0 on.
    signals : mapping of str to (n,) array
        The other channels by name, in their own units.
    """

    time: Array
    rows: npt.NDArray[np.int64]
    signals: Mapping[str, npt.NDArray[Any]]

    def kept(self, mask: Mask) -> TimeColumn:
        """The rows of a mask (n,) alone; the column itself where that is all of them."""
        if mask.all():
            return self
        signals = {name: values[mask] for name, values in self.signals.items()}
        return TimeColumn(self.time[mask], self.rows[mask], signals)


def time_column(
    time: Array, rate_hz: float | None, signals: Mapping[str, npt.NDArray[Any]], where: str, findings: Findings
) -> TimeColumn:
    """The rows of a recording that have a place in time, in order.

    Parameters
    ----------
    time : (n,) array
        As recorded [s].
    rate_hz : float, optional
        Nominal sample rate [Hz].
    signals : mapping of str to (n,) array
        The other channels by name, in their own units.
    where : str
        File and channel, for errors.
    findings : Findings
        Receives what was dropped or counted on.

    Raises
    ------
    RecordingError
        When lengths differ, fewer than two times are known, rows are out of order, or two rows of one time disagree.
    """
    wrong = {name: len(values) for name, values in signals.items() if len(values) != len(time)}
    if wrong:
        came = ", ".join(f"{name}: {length}" for name, length in wrong.items())
        do = "Export the channels together."
        raise RecordingError(where, f"{len(time)} times beside other lengths ({came})", "one length", do)
    column = TimeColumn(np.asarray(time, dtype=np.float64), np.arange(len(time)), signals)
    known = np.isfinite(column.time)
    column = column.kept(known)
    if len(column.time) < 2:
        do = "Check the time channel, or record longer."
        raise RecordingError(where, f"{counted(len(column.time), 'row')} with a time", "two or more", do)
    if not known.all():
        lost, first = int((~known).sum()), int(np.argmin(known)) + 1
        findings.warning(
            Code.NOT_FINITE,
            "time",
            f"{counted(lost, 'row')} of {len(time)} without a time, the first in row {first}; they are left out",
            "Check the recorder's time channel.",
            lost=counted(lost, "row"),
        )
    return _each_once(_counted_on(column, where, findings), rate_hz, where, findings)


def _counted_on(column: TimeColumn, where: str, findings: Findings) -> TimeColumn:
    """The column with its time counted on where it begins anew; rows out of order are refused."""
    steps = np.diff(column.time)
    back = np.flatnonzero(steps < 0.0)
    if not len(back):
        return column
    forward = steps[steps > 0.0]
    step = float(np.median(forward)) if len(forward) else 0.0
    wraps = back[-steps[back] > LONGEST_BACK * step]
    if len(wraps):
        period = _period(column.time, -steps[wraps], step)
        if period is None:
            _refuse_back(column, int(wraps[0]), where)
        times = np.zeros(len(column.time))
        times[wraps + 1] = period
        column = replace(column, time=column.time + np.cumsum(times))
        steps = np.diff(column.time)
        findings.info(
            Code.CLOCK_JUMP,
            "time",
            f"it begins anew {counted(len(wraps), 'time')}, each after {period:.9g} s, and is counted on",
            "Nothing to do; a pause longer than that would not show.",
        )
    back = np.flatnonzero(steps < 0.0)
    if len(back) > MOST_BACK * len(steps) or (len(back) and not _scattered(steps, step, back)):
        _refuse_back(column, int(back[0]), where)
    return column


def _period(time: Array, drops: Array, step: float) -> float | None:
    """Time after which a clock begins anew [s], by how far it falls each time; None where nothing fits."""
    deepest = float(drops.max())
    fits = [known for known in KNOWN_WRAPS if -0.5 * step <= known - deepest <= (LONGEST_BACK + 0.5) * step]
    for known in sorted(fits, key=lambda known: abs(known - deepest - step)):
        low, high = float(time.min()), float(time.max())
        if low >= -step and high <= known + step:
            return known
        if low >= -0.5 * known - step and high <= 0.5 * known + step:  # a counter with a sign
            return known
    if len(drops) < 2 or float(drops.min()) < deepest - LONGEST_BACK * step:
        return None
    period = float(np.sort(drops)[len(drops) // 2]) + step
    return period if float(np.ptp(time)) <= period + step else None


def _refuse_back(column: TimeColumn, row: int, where: str) -> None:
    last, then = column.time[row], column.time[row + 1]
    came = f"row {column.rows[row + 1] + 1}: the time goes from {last:.9g} back to {then:.9g} s"
    do = "Rows are out of order or another test begins there: sort them, or cut the recording."
    raise RecordingError(where, came, "times that grow, or that begin anew after a constant period", do)


def _scattered(steps: Array, step: float, faults: npt.NDArray[np.int64]) -> bool:
    """Whether steps scatter everywhere, and not only within two rows of some faults."""
    near = np.zeros(len(steps), dtype=bool)
    for shift in range(-2, 3):
        near[np.clip(faults + shift, 0, len(steps) - 1)] = True
    apart = np.abs(steps[~near] - step) > ASTRAY * step
    return bool(len(apart)) and float(apart.mean()) > GENERAL


def _each_once(column: TimeColumn, rate_hz: float | None, where: str, findings: Findings) -> TimeColumn:
    """The column without rows that repeat the one before; refused where two rows of one time disagree."""
    steps = np.diff(column.time)
    still = np.flatnonzero(steps == 0.0)
    if not len(still):
        return column
    same = np.ones(len(still), dtype=bool)
    for values in column.signals.values():
        before, after = values[still], values[still + 1]
        same &= (before == after) | ((before != before) & (after != after))
    forward = steps[steps > 0.0]
    step = float(np.median(forward)) if len(forward) else 0.0
    many = len(still) >= MANY * len(steps)
    if same.all():
        span = float(np.ptp(column.time))
        if rate_hz is not None and many and abs(len(steps) / span / rate_hz - 1.0) < 0.01:
            return column  # coarse times of signals that rest
        mask = np.ones(len(column.time), dtype=bool)
        mask[still + 1] = False
        findings.warning(
            Code.SAMPLES_DUPLICATE,
            "time",
            f"{counted(len(still), 'row')} of {len(mask)} with the time and the values of the row before, the first "
            f"in row {column.rows[still[0] + 1] + 1}; left out",
            "Look up why the recorder wrote them twice.",
            lost=counted(len(still), "row"),
        )
        return column.kept(mask)
    apart = np.diff(still)
    regular = len(still) >= FEWEST_REGULAR and np.ptp(apart) <= 1
    if many or regular or _scattered(steps, step, still):
        return column
    row = int(still[np.argmin(same)]) + 1
    came = f"row {column.rows[row] + 1}: the time {column.time[row]:.9g} s again, with other values"
    raise RecordingError(where, came, "one row for each time", "Look up which row is right, and take out the other.")
