"""A recording file read into one value."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from pmg.pipeline.recording import wire
from pmg.pipeline.recording.calibration import read_calibration
from pmg.pipeline.recording.channels import SHARED_CLOCK, report_unread, wanted
from pmg.pipeline.recording.container import open_container
from pmg.pipeline.recording.decode import decode_angle, decode_lines, decode_torque
from pmg.pipeline.recording.events import read_events, read_steps
from pmg.pipeline.recording.findings import Code, Finding, Findings
from pmg.pipeline.recording.run import read_run

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import datetime
    from pathlib import Path

    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.decode import Decoded
    from pmg.pipeline.recording.events import Step
    from pmg.pipeline.recording.join import Blemish
    from pmg.pipeline.recording.run import RunInfo
    from pmg.pipeline.recording.wire import ClockMark, LineEvent
    from pmg.sim.signals import Array

SIDES = ("sun", "ring")
CLOCK_TOLERANCE_S = 1.0
"""Disagreement of the clock marks with `started_at` that is reported [s]."""


@dataclass(frozen=True)
class Recording:
    """One file of a test bench, in SI.

    Parameters
    ----------
    file : str
        Name of the file.
    sha256 : str
        Hash of its bytes.
    size : int
        Its length [bytes].
    run : RunInfo
        What the recorder says of the run.
    calibration : Calibration
        Transducers and encoders.
    rate_hz : float
        Sample rate [Hz].
    first_sample : int
        Index of the first row on the shared clock.
    samples : polars.DataFrame
        `sample` (Int64), `torque_sun`, `torque_ring` [N m], `angle_sun`, `angle_ring` [rad] (Float64, NaN where
        nothing was recorded), `lines` (UInt32, null where nothing was recorded). Rows are equidistant.
    steps : tuple of Step
        Test sequence, in order; empty for a file with one point.
    line_events : tuple of LineEvent
        Changes of the digital inputs, in order.
    clock_marks : tuple of ClockMark
        Sample indices against UTC, all clocks.
    blemishes : tuple of Blemish
        Stretches that the recorder marks as bad.
    findings : tuple of Finding
        Everything lost, damaged or contradictory.
    """

    file: str
    sha256: str
    size: int
    run: RunInfo
    calibration: Calibration
    rate_hz: float
    first_sample: int
    samples: pl.DataFrame
    steps: tuple[Step, ...]
    line_events: tuple[LineEvent, ...]
    clock_marks: tuple[ClockMark, ...]
    blemishes: tuple[Blemish, ...]
    findings: tuple[Finding, ...]

    @property
    def stop_sample(self) -> int:
        """Index after the last row."""
        return self.first_sample + self.samples.height

    def time_of(self, sample: int) -> datetime:
        """Time [UTC] of a sample: from the nearest earlier clock mark, else from the start of the run."""
        offset = _mark_offset_s(self.clock_marks, sample, self.rate_hz, self.run.started_at)
        if offset is None:
            offset = (sample - self.first_sample) / self.rate_hz
        return self.run.started_at + timedelta(seconds=offset)


def read_recording(path: Path, name: str | None = None) -> Recording:
    """The recording in a file.

    Parameters
    ----------
    path : Path
        A file of layout pmg.v1.
    name : str, optional
        Name under which it is known in findings; the file's own name by default.

    Raises
    ------
    UnusableRecordingError
        When no torque and speed can be had from it. The error carries every finding, not only the first.
    """
    findings = Findings(name or path.name)
    container = open_container(path, wanted, findings)
    topics = container.topics
    report_unread(topics.values(), findings)
    run = read_run(container.metadata, findings)
    calibration = read_calibration(container.attachments, findings)
    if run is None or calibration is None:
        raise findings.give_up()
    pulses = {side: read_events(topics, f"/daq/encoder_{side}/index", wire.index_pulse, findings) for side in SIDES}
    tracks = [decode_torque(topics, side, calibration, findings) for side in SIDES]
    tracks += [decode_angle(topics, side, calibration, pulses[side], findings) for side in SIDES]
    decoded = [track for track in tracks if track is not None]
    if len(decoded) < len(tracks) or not _one_rate(decoded, findings):
        raise findings.give_up()
    lines = decode_lines(topics, findings)
    if lines is not None and not _one_rate([decoded[0], lines], findings):
        lines = None
    first, samples = _frame(decoded, lines, findings)
    marks = read_events(topics, "/sys/clock", wire.clock_mark, findings)
    _check_clock(marks, run, first, decoded[0].rate_hz, findings)
    events = read_events(topics, "/events/lines", wire.line_event, findings)
    steps = read_steps(topics, findings)
    return Recording(
        file=findings.file,
        sha256=container.sha256,
        size=container.size,
        run=run,
        calibration=calibration,
        rate_hz=decoded[0].rate_hz,
        first_sample=first,
        samples=samples,
        steps=steps,
        line_events=tuple(sorted(events, key=lambda event: event.sample)),
        clock_marks=marks,
        blemishes=tuple(b for track in decoded for b in track.blemishes),
        findings=findings.told(),
    )


def _one_rate(decoded: Sequence[Decoded], findings: Findings) -> bool:
    odd = [track for track in decoded if track.rate_hz != decoded[0].rate_hz]
    for track in odd:
        findings.error(
            Code.CHANNEL_VALUE,
            track.topic,
            f"rate_hz {track.rate_hz:g}; expected {decoded[0].rate_hz:g}, as of {decoded[0].topic}",
            "Record torque, encoders and lines at one rate.",
        )
    return not odd


def _frame(decoded: Sequence[Decoded], lines: Decoded | None, findings: Findings) -> tuple[int, pl.DataFrame]:
    """All channels on one row of samples, from the first of any to the last of any."""
    first, stop = min(t.first for t in decoded), max(t.stop for t in decoded)
    for track in decoded:
        late, early = track.first - first, stop - track.stop
        if late or early:
            findings.warning(
                Code.SAMPLES_RAGGED,
                track.topic,
                f"it begins {late} samples after and ends {early} samples before the others; expected all channels "
                "over the same samples",
                "Points are taken from the part that all channels share.",
            )
    columns = {"sample": pl.Series(np.arange(first, stop, dtype=np.int64))}
    for name, track in zip(("torque_sun", "torque_ring", "angle_sun", "angle_ring"), decoded, strict=True):
        columns[name] = pl.Series(_padded(track, first, stop))
    masks = np.zeros(stop - first, dtype=np.uint32)
    known = np.zeros(stop - first, dtype=np.bool_)
    if lines is not None:
        low, high = max(first, lines.first), min(stop, lines.stop)
        if low < high:
            there = slice(low - lines.first, high - lines.first)
            masks[low - first : high - first] = lines.values[there]
            known[low - first : high - first] = lines.present[there]
    frame = pl.DataFrame(columns).with_columns(lines=pl.Series(masks))
    return first, frame.with_columns(lines=pl.when(pl.Series(known)).then(pl.col("lines")))


def _padded(track: Decoded, first: int, stop: int) -> Array:
    row = np.full(stop - first, np.nan)
    row[track.first - first : track.stop - first] = track.values
    return row


def _mark_offset_s(marks: Sequence[ClockMark], sample: int, rate_hz: float, started_at: datetime) -> float | None:
    """Time of a sample after `started_at` by the clock marks [s]; None without marks of the shared clock."""
    shared = sorted((m for m in marks if m.clock_id == SHARED_CLOCK), key=lambda m: m.sample)
    if not shared:
        return None
    mark = max((m for m in shared if m.sample <= sample), key=lambda m: m.sample, default=shared[0])
    start_us = round(started_at.timestamp() * 1e6)
    return (mark.utc_ns // 1000 - start_us) / 1e6 + (sample - mark.sample) / rate_hz


def _check_clock(marks: Sequence[ClockMark], run: RunInfo, first: int, rate_hz: float, findings: Findings) -> None:
    offset = _mark_offset_s(marks, first, rate_hz, run.started_at)
    if offset is not None and abs(offset) > CLOCK_TOLERANCE_S:
        findings.warning(
            Code.CLOCK_DISAGREES,
            "/sys/clock",
            f"the first sample is {offset:+.3f} s off started_at; expected less than {CLOCK_TOLERANCE_S:g} s. "
            "The clock marks are used",
            "Check the time of the recorder's computer.",
        )
