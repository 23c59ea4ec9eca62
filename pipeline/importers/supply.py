"""What a user states for recordings that lack it, in the words of the channel map of the import."""

from __future__ import annotations

import hashlib
import tomllib
from typing import TYPE_CHECKING

from pmg.pipeline.files.toml_table import Reader
from pmg.pipeline.importers.channel_map import LARGEST, SCHEMA, WIDEST, Lookup, read_words
from pmg.pipeline.recording.calibration import ATTACHMENT, read_calibration
from pmg.pipeline.recording.channels import COUNTERS, LARGEST_RATE, SPECS
from pmg.pipeline.recording.findings import Findings
from pmg.pipeline.recording.supplied import MappedField, Supplied
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from pathlib import Path

SEPARATORS = ",="
"""Signs that no name of a field may hold."""


def read_supply(path: Path) -> Supplied:
    """The map for an ingest, in the form of that for an import, each part optional.

    Parameters
    ----------
    path : Path
        TOML with ``schema``, ``calibration``, ``[run]``, ``rate_Hz`` in ``[time]``, and ``[[channel]]`` with ``topic``,
        ``source`` (a topic of the file), ``field``, ``bits``, ``timebase_Hz``.

    Raises
    ------
    BenchError
        When it is no such TOML, or states nothing.
    UnusableRecordingError
        When the calibration that it names cannot be used.
    """
    try:
        data = path.read_bytes()
        reader = Reader(path.name, tomllib.loads(data.decode("utf-8")))
    except OSError as fault:
        came = f"it cannot be read ({fault.strerror})"
        raise BenchError(str(path), came, "a TOML file", "Check the path.") from fault
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as fault:
        raise BenchError(path.name, f"it cannot be parsed ({fault})", "TOML text in UTF-8", "Correct it.") from fault
    reader.word("schema", (SCHEMA,))
    calibration = path.parent / reader.text("calibration") if "calibration" in reader.table else None
    run = _run(reader.sub("run", optional=True))
    timing = reader.sub("time", optional=True)
    rate = timing.number("rate_Hz", 1e-6, LARGEST_RATE) if "rate_Hz" in timing.table else None
    timing.asked.add("rate_Hz")
    timing.done()
    fields = tuple(_field(row, rate) for row in reader.rows("channel"))
    reader.done()
    topics = [each.topic for each in fields]
    if twice := sorted({topic for topic in topics if topics.count(topic) > 1}):
        raise BenchError(f"{path.name}: channel", f"'{twice[0]}' twice", "each topic once", "Leave one of them out.")
    if calibration is None and not run and not fields:
        raise BenchError(path.name, "nothing is stated", "calibration, [run] or [[channel]]", "State what is lacking.")
    text = None if calibration is None else _calibration(path, calibration)
    return Supplied(
        file=path.name,
        sha256=hashlib.sha256(data).hexdigest(),
        run=run,
        calibration=text,
        calibration_file="" if calibration is None else calibration.name,
        calibration_sha256="" if text is None else hashlib.sha256(text).hexdigest(),
        fields=fields,
    )


def _run(reader: Reader) -> dict[str, str | None]:
    """Keys of the run; values and vocabulary are checked by the recording's own reader."""
    found: dict[str, str | None] = {}
    for key, value in read_words(reader).items():
        if isinstance(value, Lookup) and value.source == "property":
            do = 'Write the value, or { file = "stem" }.'
            raise BenchError(f"{reader.where}: {key}", f"property '{value.name}'", "MCAP files have none", do)
        found[key] = None if isinstance(value, Lookup) else value
    return found


def _field(reader: Reader, rate: float | None) -> MappedField:
    reader.asked.update(("bits", "timebase_Hz"))
    topic = reader.word("topic", SPECS)
    source, path = reader.text("source"), reader.text("field")
    if not path.strip() or any(sign in path for sign in SEPARATORS):
        raise BenchError(f"{reader.where}: field", f"'{path}'", "a name without ',' and '='", "Correct it.")
    metadata = {} if rate is None else {"rate_hz": repr(rate)}
    if "bits" in reader.table and SPECS[topic].dtypes == COUNTERS:
        metadata["bits"] = str(reader.whole("bits", 1, WIDEST))
    if "timebase_Hz" in reader.table and topic.endswith("/edge_ticks"):
        metadata["timebase_hz"] = repr(reader.number("timebase_Hz", 1e-6, LARGEST))
    reader.done()
    return MappedField(source, path.strip(), topic, metadata)


def _calibration(chart: Path, path: Path) -> bytes:
    """The calibration that the map names, proven by the reader's own check."""
    try:
        data = path.read_bytes()
    except OSError as fault:
        came = f"'{path}' cannot be read ({fault.strerror})"
        raise BenchError(f"{chart.name}: calibration", came, "a TOML file", "Name it beside the map.") from fault
    findings = Findings(path.name)
    if read_calibration([(ATTACHMENT, data)], findings) is None:
        raise findings.give_up()
    return data
