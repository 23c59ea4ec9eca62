"""Facts that a user supplies for recordings that lack them, in the words of the channel map of the import."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Annotated

from pydantic import Field, StringConstraints, model_validator

from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.files.notes import note_read
from pmg.pipeline.files.strict_tables import Strict, one_of, refuse, refuse_twice
from pmg.pipeline.files.table_file import read_table_file
from pmg.pipeline.importers.channel_map import SCHEMA, Bits, Clock, Lookup, Rate, Run, Topic
from pmg.pipeline.recording.calibration import ATTACHMENT, read_calibration
from pmg.pipeline.recording.channels import COUNTERS, SPECS
from pmg.pipeline.recording.findings import Findings
from pmg.pipeline.recording.supplied import MappedField, Supplied

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.files.table_file import TableFile

SEPARATORS = ",="
"""Signs that no name of a field may hold."""


class _RateTable(Strict):
    """Table ``[time]``."""

    rate_hz: Rate | None = None


class _FieldTable(Strict):
    """A field of the messages of some topic, as a table ``[[channel]]``."""

    topic: Topic
    source: str
    field: Annotated[str, StringConstraints(strip_whitespace=True)]
    bits: Bits | None = None
    timebase_hz: Clock | None = None

    @model_validator(mode="after")
    def _a_name(self) -> _FieldTable:
        if not self.field or any(sign in self.field for sign in SEPARATORS):
            refuse(f"'{self.field}'", "a name without ',' and '='", "Correct it.", "field")
        return self

    def mapped(self, rate: float | None) -> MappedField:
        """The same with the metadata that its channel may lack; the rate [Hz] is that of all."""
        metadata = {} if rate is None else {"rate_hz": repr(rate)}
        if self.bits is not None and SPECS[self.topic].dtypes == COUNTERS:
            metadata["bits"] = str(self.bits)
        if self.timebase_hz is not None and self.topic.endswith("/edge_ticks"):
            metadata["timebase_hz"] = repr(self.timebase_hz)
        return MappedField(self.source, self.field, self.topic, metadata)


class _SupplyTable(Strict):
    """All tables of a map for an ingest; each may be left out, not all of them."""

    schema_: Annotated[str, one_of(SCHEMA), Field(alias="schema")]
    calibration: str | None = None
    run: Run = Field(default_factory=dict)
    time: _RateTable = _RateTable()
    channel: list[_FieldTable] = Field(default_factory=list)

    @model_validator(mode="after")
    def _says_something(self) -> _SupplyTable:
        for key, value in self.run.items():
            if isinstance(value, Lookup) and value.source == "property":
                do = 'Write the value, or { file = "stem" }.'
                refuse(f"property '{value.name}'", "a value: MCAP files have no properties", do, "run", key)
        refuse_twice((row.topic for row in self.channel), "channel", "topic")
        if self.calibration is None and not self.run and not self.channel:
            refuse("nothing is stated", "calibration, [run] or [[channel]]", "State what is lacking.")
        return self


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
        When the file is no such TOML, or states nothing.
    UnusableRecordingError
        When the calibration that it names cannot be used.
    """
    file = read_table_file(path, "a map", _SupplyTable)
    given = file.table
    text = None if given.calibration is None else _calibration(file, given.calibration)
    return Supplied(
        file=path.name,
        sha256=sha256_of(path),
        run={key: None if isinstance(value, Lookup) else value for key, value in given.run.items()},
        calibration=text,
        calibration_file="" if given.calibration is None else file.resolve(given.calibration).name,
        calibration_sha256="" if text is None else hashlib.sha256(text).hexdigest(),
        fields=tuple(row.mapped(given.time.rate_hz) for row in given.channel),
    )


def _calibration(file: TableFile[_SupplyTable], name: str) -> bytes:
    """The calibration that the map names, proven by the reader's own check."""
    path = file.resolve(name)
    try:
        data = path.read_bytes()
    except OSError as fault:
        came = f"'{path}' cannot be read ({fault.strerror})"
        raise file.refusal(came, "a TOML file", "Name it next to the map.", "calibration") from fault
    note_read(path, data)
    findings = Findings(path.name)
    if read_calibration([(ATTACHMENT, data)], findings) is None:
        raise findings.give_up()
    return data
