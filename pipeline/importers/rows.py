"""Rows of a file placed on the sample clock: by their number, by a time column, or by a counter that wraps."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.channels import LARGEST_RATE
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

    from pmg.pipeline.importers.channel_map import Timing
    from pmg.pipeline.importers.source import Block
    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array

UNEVEN = 0.3
"""Part of a sample by which a time step may miss a whole number of samples."""
WHOLE_RATE = 1e-6
"""Relative distance within which a rate found in a time column is a whole number of hertz."""
DRIFT_TOLD, DRIFT_REFUSED = 2e-5, 1e-3
"""Relative distance of the time column from the declared rate that is reported, and that is refused."""
LONGEST_GAP = 50_000_000
"""Samples that a gap may hold."""


class UnevenTimesError(RecordingError):
    """Times that do not go on by whole samples: they scatter, stand still, begin anew, or are out of order."""


@dataclass
class Rows:
    """Places of rows on the sample clock, block after block.

    Parameters
    ----------
    timing : Timing
        What the map says about time.
    file, place : str
        Name of the file, and what its rows are counted in, for messages.
    findings : Findings
        Receives gaps, and rows without a time.
    rate_hz : float, optional
        Sample rate [Hz]; known after the first block.
    read : int
        Rows that came by so far.

    Notes
    -----
    A time step is turned into the nearest whole number of samples, and these are added up, so that neither rounded
    times nor a small difference between the two clocks adds up to a false gap. The difference over the whole file
    is reported. A counter of :math:`b` bits only tells a step modulo :math:`2^b`; a step of more than half of that may
    as well be a step back, and is refused.
    """

    timing: Timing
    file: str
    place: str
    findings: Findings
    rate_hz: float | None = None
    read: int = field(default=0, init=False)
    _next: int = field(default=0, init=False)
    _begun: tuple[int, float] | None = field(default=None, init=False)
    _last: tuple[int, float] | None = field(default=None, init=False)
    _tick: tuple[int, int] | None = field(default=None, init=False)

    def placed(self, blocks: Iterator[Block]) -> Iterator[tuple[npt.NDArray[np.int64], Block]]:
        """Each block with the sample index of its rows, as `of` and `finish` have it."""
        for block in blocks:
            index = self.of(block)
            if self.rate_hz is not None:
                yield index, block
        self.finish()

    def seconds_of(self, block: Block) -> Array:
        """Times of a block's rows as they are (n,) [s]; those of a counter go on where it wraps, NaN where none is."""
        assert self.timing.column is not None  # rows without times are even
        values = np.asarray(block.columns[self.timing.column], dtype=np.float64)
        self.read += len(values)
        seconds, known = np.full(len(values), np.nan), np.isfinite(values)
        if known.any():
            seconds[known] = self._seconds(values[known], block.places[known])
        return seconds

    def of(self, block: Block) -> npt.NDArray[np.int64]:
        """Sample index of each row of the next block; -1 for rows that have no place.

        Raises
        ------
        UnevenTimesError
            When times do not go on by whole samples.
        RecordingError
            When a counter goes back, or time goes on by more than any pause.
        """
        count = len(block.places)
        self.read += count
        if self.timing.column is None:
            first, self._next = self._next, self._next + count
            return np.arange(first, first + count)
        values = block.columns[self.timing.column]
        known = np.isfinite(values)
        if not known.all():
            self._without_time(block.places[~known])
        index = np.full(count, -1, dtype=np.int64)
        places = block.places[known]
        if len(places):
            index[known] = self._placed(self._seconds(values[known], places), places)
        return index

    def finish(self) -> None:
        """Compare the time column as a whole with the rate that was used.

        Raises
        ------
        RecordingError
            When they differ by more than `DRIFT_REFUSED`.
        """
        if self._begun is None or self._last is None or self.rate_hz is None or self._last[0] == self._begun[0]:
            return
        samples, seconds = self._last[0] - self._begun[0], self._last[1] - self._begun[1]
        drift = samples / seconds / self.rate_hz - 1.0
        where = f"{self.file}: time column"
        came = f"{samples / seconds:.9g} samples per second from its first to its last row"
        if abs(drift) > DRIFT_REFUSED and abs(drift) * samples > UNEVEN:
            do = "Correct rate_Hz in [time], or leave it out and take it from the column."
            raise RecordingError(where, came, f"{self.rate_hz:.9g}", do)
        if abs(drift) > DRIFT_TOLD and abs(drift) * samples > 1.0:
            self.findings.warning(
                Code.TIMEBASE_DRIFT,
                where,
                f"{came}; expected {self.rate_hz:.9g}. The latter is used, {drift * 1e6:+.1f} ppm off",
                "Decide which clock is right; speeds scale with it.",
            )

    def _seconds(self, values: Array, places: npt.NDArray[np.int64]) -> Array:
        """Times [s]; those of a counter go on where it wraps."""
        bits = self.timing.bits
        if bits is None:
            return np.asarray(values, dtype=np.float64) * self.timing.scale
        ticks = np.asarray(values).astype(np.int64)
        low, high = -(1 << (bits - 1)), 1 << bits
        odd = (ticks != values) | (ticks < low) | (ticks >= high)
        if odd.any():
            row = int(np.argmax(odd))
            came = f"tick {values[row]:.17g}"
            do = "Correct `bits` in [time], or map another column."
            raise RecordingError(self._at(places[row]), came, f"a whole number of {bits} bits", do)
        last, total = self._tick or (int(ticks[0]), 0)
        steps = np.diff(ticks, prepend=last) % high
        back = steps > high // 2
        if back.any():
            row = int(np.argmax(back))
            came = f"the counter goes from {ticks[row - 1] if row else last} to {ticks[row]}"
            half = high // 2 * self.timing.scale
            expected = f"steps forward of less than half a wrap, {half:.6g} s"
            do = "Rows are out of order, `bits` is wrong, or the recorder paused for so long: split the file there."
            raise RecordingError(self._at(places[row]), came, expected, do)
        passed = total + np.cumsum(steps)
        self._tick = int(ticks[-1]), int(passed[-1])
        return np.asarray(passed * self.timing.scale)

    def _placed(self, seconds: Array, places: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        if self.rate_hz is None:
            self.rate_hz = self._found_rate(seconds, places)
        if self._last is None:
            self._begun = self._last = 0, float(seconds[0])
            steps = np.diff(seconds, prepend=seconds[:1])
            fresh = True
        else:
            steps, fresh = np.diff(seconds, prepend=self._last[1]), False
        samples = steps * self.rate_hz
        whole = np.rint(samples)
        self._refuse(samples, whole, places, fresh)
        index = self._last[0] + np.cumsum(whole.astype(np.int64))
        self._tell_gaps(whole, index, places)
        self._last = int(index[-1]), float(seconds[-1])
        return np.asarray(index)

    def _refuse(self, samples: Array, whole: Array, places: npt.NDArray[np.int64], fresh: bool) -> None:
        """Complain about the first step that leads nowhere, or between two samples."""
        stuck, uneven = whole < 1.0, np.abs(samples - whole) > UNEVEN
        stuck[0], uneven[0] = stuck[0] and not fresh, uneven[0] and not fresh
        wrong = stuck | uneven | ~(whole < LONGEST_GAP)
        if not wrong.any() or self.rate_hz is None:
            return
        row = int(np.argmax(wrong))
        step = samples[row] / self.rate_hz
        came = f"a step in time of {step:.9g} s, which is {samples[row]:.4g} samples at {self.rate_hz:.9g} Hz"
        do = (
            "Rows are out of order or doubled: look up what the recorder wrote."
            if samples[row] < -UNEVEN
            else "Where the computer made the times, give rate_Hz in [time] instead of `source`; else correct rate_Hz."
        )
        fault = UnevenTimesError if whole[row] < LONGEST_GAP else RecordingError
        raise fault(self._at(places[row]), came, "steps forward by whole samples", do)

    def _found_rate(self, seconds: Array, places: npt.NDArray[np.int64]) -> float:
        """Sample rate that the times of the first block show [Hz]."""
        forward = np.diff(seconds)
        step = float(np.median(forward)) if len(forward) else 0.0
        if not step > 1.0 / LARGEST_RATE:
            came = "fewer than two times" if len(forward) < 1 else f"a typical step of {step:.6g} s"
            do = "Give rate_Hz in [time], or the unit of the column."
            raise RecordingError(self._at(places[0]), came, "times that grow from row to row", do)
        if (forward <= 0.0).any():
            return 1.0 / step  # near enough to say where it is that the times do not grow
        index = np.concatenate(([0.0], np.cumsum(np.rint(forward / step))))
        time = seconds - seconds.mean()
        rate = float(time @ (index - index.mean())) / float(time @ time)
        if rate >= 1.0 and abs(rate - round(rate)) <= WHOLE_RATE * rate:
            rate = float(round(rate))
        return rate

    def _tell_gaps(self, whole: Array, index: npt.NDArray[np.int64], places: npt.NDArray[np.int64]) -> None:
        for row in np.flatnonzero(whole > 1.0):
            lost = int(whole[row]) - 1
            self.findings.warning(
                Code.SAMPLES_GAP,
                f"{self.place} {places[row]}",
                f"{counted(lost, 'sample')} missing before it by the time column; expected one row for each sample",
                "Windows that need them are judged as having a gap. Look up why the recorder paused.",
                sample_range=(int(index[row]) - lost, int(index[row])),
                lost=counted(lost, "sample"),
            )

    def _without_time(self, places: npt.NDArray[np.int64]) -> None:
        self.findings.error(
            Code.NOT_FINITE,
            f"{self.place} {places[0]}",
            f"{counted(len(places), 'row')} without a time from there to {self.place} {places[-1]}; expected one in "
            "each row. What has no time is left out",
            "Check the recorder's time column.",
            lost=counted(len(places), "row"),
        )

    def _at(self, place: int) -> str:
        return f"{self.file}, {self.place} {place}, time"
