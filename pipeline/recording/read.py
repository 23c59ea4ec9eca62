"""A recording file read into one value."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from pmg.pipeline.recording.auxiliary_channels import (
    BESIDES,
    NO_AUXILIARY,
    AuxiliaryChannels,
    counter_bits,
    read_auxiliary_channels,
)
from pmg.pipeline.recording.calibration import read_calibration
from pmg.pipeline.recording.channels import report_unread
from pmg.pipeline.recording.checks.clock import mark_offset_s, sound_marks
from pmg.pipeline.recording.checks.host import check_host
from pmg.pipeline.recording.checks.lines import check_lines
from pmg.pipeline.recording.checks.transducers import check_torques
from pmg.pipeline.recording.checks.wiring import check_wiring, stretch_of
from pmg.pipeline.recording.container.contents import open_container
from pmg.pipeline.recording.decode import decode_lines
from pmg.pipeline.recording.events import read_events, read_steps
from pmg.pipeline.recording.findings import Code, Finding, Findings
from pmg.pipeline.recording.layouts import wire
from pmg.pipeline.recording.layouts.convert_topics import convert_topics
from pmg.pipeline.recording.origin import read_origin
from pmg.pipeline.recording.run import known_of_run, read_run
from pmg.pipeline.recording.supplied import NOTHING, Supply
from pmg.pipeline.recording.tracks import COLUMNS, decode_tracks, one_rate, tell_lacking, together
from pmg.sim.bench import load_bench
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import datetime
    from pathlib import Path

    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.checks.wiring import HeldStretch
    from pmg.pipeline.recording.events import SequenceStep
    from pmg.pipeline.recording.frequency import Decoded
    from pmg.pipeline.recording.join import Blemish
    from pmg.pipeline.recording.layouts.wire import ClockMark, LineEvent
    from pmg.pipeline.recording.origin import Origin
    from pmg.pipeline.recording.run_records import RunInfo
    from pmg.pipeline.recording.supplied import Supplied, SuppliedRecord
    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array


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
    steps : tuple of SequenceStep
        Test sequence, in order; empty for a file with one point.
    line_events : tuple of LineEvent
        Changes of the digital inputs, in order.
    clock_marks : tuple of ClockMark
        Sample indices against UTC, all clocks.
    blemishes : tuple of Blemish
        Stretches that the recorder marks as bad.
    findings : tuple of Finding
        Everything lost, damaged or contradictory, in the source of an import first.
    origin : Origin or None
        What it was imported from.
    lacking : mapping of str to str
        Columns of `samples` that hold nothing, and why: ``not recorded`` or ``not usable``.
    supplied : mapping or None
        What it lacked and was stated next to it, with names and hashes.
    auxiliary : AuxiliaryChannels
        Coils, temperatures and index pulses, where they were asked for.
    """

    file: str
    sha256: str
    size: int
    run: RunInfo
    calibration: Calibration
    rate_hz: float
    first_sample: int
    samples: pl.DataFrame
    steps: tuple[SequenceStep, ...]
    line_events: tuple[LineEvent, ...]
    clock_marks: tuple[ClockMark, ...]
    blemishes: tuple[Blemish, ...]
    findings: tuple[Finding, ...]
    origin: Origin | None = None
    lacking: Mapping[str, str] = field(default_factory=dict)
    supplied: SuppliedRecord | None = None
    auxiliary: AuxiliaryChannels = NO_AUXILIARY

    @property
    def recorded(self) -> tuple[str, ...]:
        """Columns of torque and angle that hold anything."""
        return tuple(name for name in COLUMNS if name not in self.lacking)

    @property
    def stop_sample(self) -> int:
        """Index after the last row."""
        return self.first_sample + self.samples.height

    def time_of(self, sample: int) -> datetime:
        """Time [UTC] of a sample: from the nearest earlier clock mark, else from the start of the run."""
        offset = mark_offset_s(self.clock_marks, sample, self.rate_hz, self.run.started_at)
        if offset is None:
            offset = (sample - self.first_sample) / self.rate_hz
        return self.run.started_at + timedelta(seconds=offset)


def read_recording(
    path: Path,
    name: str | None = None,
    supplied: Supplied = NOTHING,
    *,
    coils: bool = False,
    bench: BenchParameters | None = None,
) -> Recording:
    """The recording in a file.

    Parameters
    ----------
    path : Path
        A file of layout pmg.v1.
    name : str, optional
        Name under which it is known in findings; the file's own name by default.
    supplied : Supplied, optional
        What is stated next to the file, used where the file does not say it.
    coils : bool
        Whether the voltages of the coils, the index pulses and the temperatures are read too.
    bench : BenchParameters, optional
        The machine whose ratios the speeds are held against; that of the thesis by default.

    Raises
    ------
    UnusableRecordingError
        When no torque with its speed can be had from it. The error carries every finding, not only the first, and what
        is known of the run.
    """
    findings, machine = Findings(name or path.name), bench or load_bench()
    supply = Supply(supplied, findings)
    container = open_container(path, lambda t: supplied.wanted(t) or (coils and t.startswith(BESIDES)), findings)
    report_unread((t for t in container.topics.values() if not supplied.maps(t.name)), findings)
    topics = supply.channel_metadata(convert_topics(supply.channels(container.topics), findings))
    container = replace(container, topics={})  # what is decoded is let go
    metadata = supply.run(container.metadata, path.stem)
    known = known_of_run(metadata)
    run = read_run(metadata, findings)
    origin = read_origin(container.metadata, findings)
    calibration = read_calibration(supply.calibration(container.attachments), findings)
    if run is None or calibration is None:
        raise findings.give_up(known)
    bits, logged = counter_bits(topics), {name: topic.logged for name, topic in topics.items()}
    tracks, lacking = decode_tracks(topics, calibration, findings)
    decoded = [track for track in tracks.values() if track is not None]
    paired = any(not lacking.keys() & {f"torque_{side}", f"angle_{side}"} for side in SIDES)
    if not paired or not one_rate(decoded, findings) or not together(decoded, findings):
        raise findings.give_up(known)
    tell_lacking(lacking, findings)
    lines = decode_lines(topics, findings)
    if lines is not None and not one_rate([decoded[0], lines], findings):
        lines = None
    first, samples = _frame(tracks, lines, findings)
    check_host(logged, decoded, run, first == 0, findings)
    marks = read_events(topics, "/sys/clock", wire.clock_mark, findings)
    marks = sound_marks(marks, run, (first, first + samples.height), decoded[0].rate_hz, findings)
    events = sorted(read_events(topics, "/events/lines", wire.line_event, findings), key=lambda event: event.sample)
    steps = read_steps(topics, findings, run.manoeuvre)
    check_lines(lines, events, findings)
    check_wiring(_held(samples, first, decoded[0].rate_hz, run, steps), run, calibration, machine, findings)
    auxiliary = read_auxiliary_channels(topics, bits, findings) if coils else NO_AUXILIARY
    spoilt = check_torques(tracks["torque_sun"], tracks["torque_ring"], calibration, findings)
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
        line_events=tuple(events),
        clock_marks=marks,
        blemishes=(*(b for track in decoded for b in track.blemishes), *spoilt),
        findings=(() if origin is None else origin.findings) + findings.listed(),
        origin=origin,
        lacking=lacking,
        supplied=supply.record(),
        auxiliary=auxiliary,
    )


def _frame(tracks: Mapping[str, Decoded | None], lines: Decoded | None, findings: Findings) -> tuple[int, pl.DataFrame]:
    """All channels on one row of samples, from the first of any to the last of any."""
    decoded = [track for track in tracks.values() if track is not None]
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
                sample_range=(first, track.first) if late else (track.stop, stop),
                kept=f"{track.stop - track.first} samples",
                lost=f"{late + early} samples",
            )
    columns = {"sample": pl.Series(np.arange(first, stop, dtype=np.int64))}
    for name, whole in tracks.items():
        columns[name] = pl.Series(np.full(stop - first, np.nan) if whole is None else _padded(whole, first, stop))
    nothing = pl.Series([None], dtype=pl.UInt32).new_from_index(0, stop - first)
    if lines is None:
        return first, pl.DataFrame(columns | {"lines": nothing})
    masks = np.zeros(stop - first, dtype=np.uint32)
    known = np.zeros(stop - first, dtype=np.bool_)
    low, high = max(first, lines.first), min(stop, lines.stop)
    if low < high:
        there = slice(low - lines.first, high - lines.first)
        masks[low - first : high - first] = lines.values[there]
        known[low - first : high - first] = lines.present[there]
    return first, pl.DataFrame(columns | {"lines": pl.Series(masks).zip_with(pl.Series(known), nothing)})


def _padded(track: Decoded, first: int, stop: int) -> Array:
    if (track.first, track.stop) == (first, stop):
        return np.ascontiguousarray(track.values)
    row = np.full(stop - first, np.nan)
    row[track.first - first : track.stop - first] = track.values
    return row


def _held(
    samples: pl.DataFrame, first: int, rate_hz: float, run: RunInfo, steps: Sequence[SequenceStep]
) -> Iterator[HeldStretch]:
    """Where set-points were held: from MEASURE to what follows it; without steps, the whole run; none in motion."""
    if run.manoeuvre.moves:
        return
    columns = {name: samples[name].to_numpy() for name in COLUMNS}
    stop = first + samples.height
    ends = [
        ((step.sample, after.sample if after is not None else stop), step.setpoints)
        for step, after in zip(steps, (*steps[1:], None), strict=False)
        if step.phase == "MEASURE"
    ]
    for span, setpoints in ends if steps else [((first, stop), run.setpoints)]:
        if (stretch := stretch_of(columns, first, span, setpoints, rate_hz)) is not None:
            yield stretch
