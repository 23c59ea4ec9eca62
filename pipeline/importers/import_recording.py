"""A recording of another format brought into layout pmg.v1, with its hash, its map and what was lost."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import UTC
from importlib.metadata import version
from typing import TYPE_CHECKING

from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.importers.block_file import BlockFile, block_file
from pmg.pipeline.importers.channel_map import Lookup, Timing
from pmg.pipeline.importers.convert import Conversion
from pmg.pipeline.importers.open_source import open_source
from pmg.pipeline.importers.rows import Rows, UnevenTimesError
from pmg.pipeline.importers.source import Wanted, channel_of
from pmg.pipeline.importers.uneven_rows import even_rows
from pmg.pipeline.recording.calibration import ATTACHMENT, read_calibration
from pmg.pipeline.recording.channels import edge_ticks, edges, encoder, frequency
from pmg.pipeline.recording.findings import Code, Findings
from pmg.pipeline.recording.origin import RECORD as ORIGIN
from pmg.pipeline.recording.run import LAYOUT, RECORD, read_run
from pmg.pipeline.recording.run import RUN_KEYS as SETPOINT_KEYS
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import BenchError, RecordingError, near_miss
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.importers.channel_map import ChannelMap, Mapped
    from pmg.pipeline.importers.source import ForeignSource
    from pmg.pipeline.recording.calibration import Calibration
    from pmg.pipeline.recording.findings import Finding
    from pmg.pipeline.recording.run_records import RunInfo

MAP_ATTACHMENT = "import-map.toml"
"""Attachment with the map by which it was imported."""


@dataclass(frozen=True)
class Imported:
    """Result of an import.

    Parameters
    ----------
    source, out : Path
        The foreign file, and the recording.
    format, reader, sha256 : str
        What it is, what read it, and its hash.
    reading : mapping of str to str
        How it was found to be written: of CSV its encoding, delimiter, decimal sign, row of units and first row.
    size : int
        Its length [bytes].
    rows : int
        Rows in it.
    rate_hz : float
        Sample rate [Hz].
    written : mapping of str to int
        Samples in the recording, by topic.
    findings : tuple of Finding
        What was lost or left out.
    """

    source: Path
    out: Path
    format: str
    reader: str
    sha256: str
    reading: Mapping[str, str]
    size: int
    rows: int
    rate_hz: float
    written: Mapping[str, int]
    findings: tuple[Finding, ...]


def import_recording(
    path: Path, channel_map: ChannelMap, out: Path, words: Mapping[str, str] | None = None
) -> Imported:
    """Bring one file into layout pmg.v1.

    Parameters
    ----------
    path : Path
        CSV, TDMS, MF4, HDF5, MAT or Parquet.
    channel_map : ChannelMap
        Which channel is which topic.
    out : Path
        The recording; an older one is replaced when the new one is whole.
    words : mapping of str to str, optional
        Keys of the run that replace those of the map.

    Raises
    ------
    PmgError
        When the file cannot be read as the map says. Nothing is written then.

    Notes
    -----
    Rows whose times miss whole samples are brought to an even clock by `even_rows`, for which the file is read again.
    """
    try:
        return _imported(path, channel_map, out, words or {}, even=True)
    except UnevenTimesError:
        return _imported(path, channel_map, out, words or {}, even=False)


def _imported(path: Path, channel_map: ChannelMap, out: Path, words: Mapping[str, str], *, even: bool) -> Imported:
    """The import, with rows by their places on the sample clock, or by their times."""
    findings = Findings(path.name)
    stat = path.stat()
    sha256 = sha256_of(path)
    source = open_source(path, channel_map.table.csv, findings)
    run, entries = _run(channel_map, source, words)
    _tell_unasked(run, channel_map, findings)
    calibration, attachment = _calibration(channel_map)
    conversions = {
        m.topic: _conversion(m, channel_map.where("channel", i), source, calibration, findings)
        for i, m in enumerate(channel_map.table.channel)
    }
    _tell_absent(set(conversions), findings)
    asked = [mapped.wanted for mapped in channel_map.table.channel]
    timing = _timing(channel_map.table.time.timing, source, asked)
    wanted = list(dict.fromkeys([*asked, *([timing.column] if timing.column else [])]))
    rows = Rows(timing, path.name, source.place, findings, timing.rate_hz)
    blocks = source.blocks(wanted)
    with ExitStack() as stack:
        file: BlockFile | None = None
        for index, block in rows.placed(blocks) if even else even_rows(blocks, rows, conversions):
            if file is None:
                assert rows.rate_hz is not None  # rows have places
                file = stack.enter_context(block_file(out, run.started_at, rows.rate_hz))
                _head(file, entries, attachment, channel_map, conversions)
            file.write(
                {
                    t: c.samples(block.columns[c.mapped.wanted], index, block.places, file.rate_hz)
                    for t, c in conversions.items()
                }
            )
        if file is None:
            raise RecordingError(str(path), "no row with data", "samples", "Look into the file.")
        _finish(path, rows.read, file, conversions)
        if (path.stat().st_size, path.stat().st_mtime_ns) != (stat.st_size, stat.st_mtime_ns):
            do = "Wait until the recorder is done, and import it again."
            raise RecordingError(str(path), "it changed while it was read", "a file that is whole", do)
        found = findings.listed()
        origin = {
            "source": path.name,
            "source_sha256": sha256,
            "source_bytes": str(stat.st_size),
            "source_format": source.format,
            "source_reader": source.reader,
            "source_rows": str(rows.read),
            **{f"source_{name}": word for name, word in source.reading.items()},
            "map": channel_map.path.name,
            "findings": json.dumps([finding.to_dict() for finding in found], ensure_ascii=False),
            "written_by": f"pmg {version('pmg-bench')}",
        }
        file.writer.add_metadata(ORIGIN, origin)
        rate, written = file.rate_hz, dict(file.written)
    kind, reader, reading = source.format, source.reader, source.reading
    return Imported(path, out, kind, reader, sha256, reading, stat.st_size, rows.read, rate, written, found)


def _finish(path: Path, rows: int, file: BlockFile, conversions: Mapping[str, Conversion]) -> None:
    """Tell what each channel lost; refuse a file that brought nothing."""
    for conversion in conversions.values():
        conversion.finish()
    if not any(file.written.values()):
        came = f"{counted(rows, 'row')} without one number in a mapped channel"
        raise RecordingError(str(path), came, "samples", "Look into the file, and at what the map names.")


def _run(channel_map: ChannelMap, source: ForeignSource, words: Mapping[str, str]) -> tuple[RunInfo, dict[str, str]]:
    """The run's metadata, proven by the reader's own check."""
    entries = {"layout": LAYOUT}
    for key, value in {**channel_map.table.run, **words}.items():
        if isinstance(value, Lookup) and value.source == "property":
            where = channel_map.where("run", key)
            if value.name not in source.properties:
                do = (
                    near_miss(value.name, source.properties) if source.properties else "It names none; write the value."
                )
                raise BenchError(where, f"property '{value.name}'", f"a property of {source.path.name}", do)
            entries[key] = source.properties[value.name]
        else:
            entries[key] = source.path.stem if isinstance(value, Lookup) else value
    if "started_at" not in entries and source.started_at is not None:
        entries["started_at"] = source.started_at.astimezone(UTC).isoformat(timespec="microseconds")
    findings = Findings(f"{channel_map.path.name}, for {source.path.name}")
    run = read_run([(RECORD, entries)], findings)
    if run is None:
        raise findings.give_up()
    return run, entries


def _calibration(channel_map: ChannelMap) -> tuple[Calibration, bytes]:
    """The calibration that the map names, proven by the reader's own check."""
    path = channel_map.resolve(channel_map.table.calibration)
    if not path.is_file():
        do = "Name the calibration next to the map; raw/LAYOUT.md shows one: transducer.sun, encoder.sun and so on."
        raise BenchError(channel_map.where("calibration"), f"'{path}' is no file", "a TOML file", do)
    data = path.read_bytes()
    findings = Findings(path.name)
    calibration = read_calibration([(ATTACHMENT, data)], findings)
    if calibration is None:
        raise findings.give_up()
    return calibration, data


def _conversion(
    mapped: Mapped, in_map: str, source: ForeignSource, calibration: Calibration, findings: Findings
) -> Conversion:
    channel = channel_of(source, mapped.source, f"{in_map}.source")
    place = f"{in_map} ({mapped.topic})"
    return Conversion(mapped, channel.unit, calibration, place, mapped.source, source.place, findings)


def _timing(timing: Timing, source: ForeignSource, wanted: list[Wanted]) -> Timing:
    """Times by the map, completed from the file."""
    if timing.column is not None:
        return timing
    channels = [channel_of(source, want.name, source.path.name) for want in wanted]
    if timing.rate_hz is not None:
        return timing
    clocks = [channel.clock for channel in channels if channel.clock]
    if clocks:
        return replace(timing, column=Wanted(clocks[0]), scale=1.0)
    rates = {channel.rate_hz for channel in channels}
    rate = rates.pop()
    if rates or rate is None or any(want.columns > 1 for want in wanted):
        came = "no rate_Hz, no time column, and none that the file declares for all mapped channels"
        do = "Give rate_Hz, source or ticks in [time]."
        raise BenchError(f"{source.path.name}: time", came, "the time of each row", do)
    return replace(timing, rate_hz=rate)


def _head(
    file: BlockFile,
    entries: dict[str, str],
    attachment: bytes,
    channel_map: ChannelMap,
    conversions: dict[str, Conversion],
) -> None:
    """Records that stand before the samples."""
    file.writer.add_metadata(RECORD, entries)
    start = file.start_ns
    file.writer.add_attachment(start, start, ATTACHMENT, "application/toml", attachment)
    file.writer.add_attachment(start, start, MAP_ATTACHMENT, "application/toml", channel_map.text.encode("utf-8"))
    for topic, conversion in conversions.items():
        file.add_topic(topic, conversion.metadata(file.rate_hz))


def _tell_unasked(run: RunInfo, channel_map: ChannelMap, findings: Findings) -> None:
    """Say where nobody said at which speeds the point was to be; a zero check is at rest."""
    asked = run.setpoints.speed_sun, run.setpoints.speed_ring
    if asked == (None, None) and run.configuration is not Configuration.ZERO:
        findings.warning(
            Code.RUN_KEY,
            "run",
            "no set-points: the point will be placed by its means, and what was not reached cannot be determined",
            f"Add {', '.join(SETPOINT_KEYS)} to [run] of {channel_map.path.name}, as numbers or "
            '{ property = "NAME" }, or give them by --set.',
        )


def _tell_absent(topics: set[str], findings: Findings) -> None:
    """Say which channels are missing without which there is no torque or speed."""
    for side in SIDES:
        by_edges = {edges(side).topic, edge_ticks(side).topic} <= topics
        lacking = [] if by_edges or frequency(side).topic in topics else [frequency(side).topic]
        lacking += [] if encoder(side).topic in topics else [encoder(side).topic]
        for topic in lacking:
            findings.warning(
                Code.CHANNEL_MISSING,
                topic,
                "the map has no channel for it; expected torque and encoder of both shafts. 'pmg ingest' will "
                "reject the windows",
                "Map it, if the file holds it.",
            )
