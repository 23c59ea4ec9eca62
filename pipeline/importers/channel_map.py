"""The channel map: which channel of a foreign file is which topic of layout pmg.v1, in the words of a TOML file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, InstanceOf, model_validator

from pmg.pipeline.files.strict_tables import (
    Strict,
    one_of,
    refuse,
    refuse_twice,
    refuse_unknown,
    refusing,
    within,
    word_of,
)
from pmg.pipeline.files.table_file import TableFile, read_table_file
from pmg.pipeline.importers.csv_dialect import CsvForm
from pmg.pipeline.importers.source import Wanted
from pmg.pipeline.recording.channels import LARGEST_RATE, SPECS, TEMPERATURE_TOPICS
from pmg.pipeline.recording.run import OPTIONAL, REQUIRED
from pmg.pipeline.wording.units import TIME, kind_of

if TYPE_CHECKING:
    from pathlib import Path

SCHEMA = "pmg.import/1"
"""Schema of the file."""

WIDEST = 62
"""Widest counter [bits]; one of 64 does not wrap within a campaign and is reported as this."""
LARGEST = 1e12
"""Largest number taken where nothing narrower is known."""
RUN_KEYS = tuple(key for key in (*REQUIRED, *OPTIONAL) if key != "layout")
"""Keys of ``[run]``, which go into the recording as they are."""

BESIDE = {
    "unit": (("source",), False),
    "bits": (("ticks",), True),
    "frequency_Hz": (("ticks",), True),
    "columns": (("source", "ticks"), False),
    "column": (("source", "ticks"), False),
}
"""Keys of ``[time]`` that others give a meaning: which ones, and whether these need it."""


def _topic(value: object) -> str:
    """A topic of the layout; of a temperature its place is free."""
    if isinstance(value, str) and re.fullmatch(f"{TEMPERATURE_TOPICS}[A-Za-z0-9_]+", value):
        return value
    return word_of(value, (*SPECS, f"{TEMPERATURE_TOPICS}PLACE"))


Topic = Annotated[str, BeforeValidator(_topic)]
Bits = Annotated[int, within(1, WIDEST)]
Rate = Annotated[float, within(1e-6, LARGEST_RATE)]
Clock = Annotated[float, within(1e-6, LARGEST)]
Number = Annotated[float, within(-LARGEST, LARGEST)]


@dataclass(frozen=True)
class Lookup:
    """A word about the run that each file brings itself.

    Parameters
    ----------
    source : str
        ``property`` or ``file``.
    name : str
        Name of the property; of the file, ``stem``.
    """

    source: str
    name: str


def _word_of_run(value: object) -> str | Lookup:
    """A word about the run; values and vocabulary are checked by the recording's own reader, for each file."""
    if isinstance(value, dict) and len(value) == 1:
        ((source, name),) = value.items()
        if (source == "property" and isinstance(name, str)) or (source, name) == ("file", "stem"):
            return Lookup(source, name)
    if isinstance(value, bool) or not isinstance(value, str | int | float | datetime):
        do = 'Write it as text, number, { property = "NAME" } or { file = "stem" }.'
        refuse(repr(value), "text, a number or a time, or where the file has it", do)
    return value.isoformat() if isinstance(value, datetime) else str(value)


def _keys_of_run(given: dict[str, str | Lookup]) -> dict[str, str | Lookup]:
    refuse_unknown(given, RUN_KEYS, "a key of pmg.run")
    return given


Run: TypeAlias = Annotated[
    dict[str, Annotated[str | InstanceOf[Lookup], BeforeValidator(_word_of_run)]],
    AfterValidator(_keys_of_run),
]
"""Table ``[run]``."""


@dataclass(frozen=True)
class Timing:
    """Time of a row of the file.

    Parameters
    ----------
    rate_hz : float, optional
        Sample rate [Hz]; None where the file or its time column says it.
    column : Wanted, optional
        Column of times, or of ticks.
    scale : float
        Seconds of one unit of that column, or of one tick [s].
    bits : int, optional
        Width of the tick counter; None where the column holds times.
    """

    rate_hz: float | None = None
    column: Wanted | None = None
    scale: float = 1.0
    bits: int | None = None


class Interleaved(Strict):
    """A table that names a channel of the file, which may hold several columns by turns."""

    columns: Annotated[int, within(1, 10_000)] = 1
    column: Annotated[int, within(1, 10_000)] | None = None

    @model_validator(mode="after")
    def _column_is_there(self) -> Interleaved:
        if self.column is None and self.columns > 1:
            refuse("missing", f"which of the {self.columns} columns", "Add column.", "column")
        if self.column is not None and self.column > self.columns:
            refuse(str(self.column), f"1 to {self.columns}, as columns says", "Correct one of them.", "column")
        return self

    def _wanted(self, name: str) -> Wanted:
        return Wanted(name, self.columns, self.column or 1)


class TimeTable(Interleaved):
    """Table ``[time]``: a rate, times, or ticks of a counter."""

    rate_hz: Rate | None = None
    source: str | None = None
    unit: Annotated[str, one_of(*TIME)] = "s"
    ticks: str | None = None
    bits: Bits | None = None
    frequency_hz: Clock | None = None

    @model_validator(mode="before")
    @classmethod
    def _one_clock(cls, given: object) -> object:
        if not isinstance(given, dict):
            return given
        if "source" in given and "ticks" in given:
            refuse("both 'source' and 'ticks'", "times, or ticks of a counter", "Leave one of them out.")
        for key, (clocks, needed) in BESIDE.items():
            if key in given and not any(clock in given for clock in clocks):
                words = " or ".join(f"'{clock}'" for clock in clocks)
                refuse("no meaning here", f"it together with {words}", f"Add {words}, or leave {key} out.", key)
            if needed and key not in given and any(clock in given for clock in clocks):
                refuse("missing", f"this key together with '{clocks[0]}'", f"Add {key}.", key)
        return given

    @property
    def timing(self) -> Timing:
        """The same as a row's way to its time."""
        if self.source is not None:
            return Timing(self.rate_hz, self._wanted(self.source), TIME[self.unit])
        if self.ticks is not None and self.frequency_hz is not None:
            return Timing(self.rate_hz, self._wanted(self.ticks), 1.0 / self.frequency_hz, self.bits)
        return Timing(self.rate_hz)


class Mapped(Interleaved):
    """One channel of the file and what becomes of it: a table ``[[channel]]``.

    Parameters
    ----------
    topic : str
        Topic of layout pmg.v1.
    source : str
        Channel of the file.
    columns, column : int
        How many columns are interleaved in it, and which is meant.
    unit : str
        Its unit; empty where the map leaves that to the file.
    file_unit : str
        A unit that the file declares and that is known to be wrong.
    bits : int
        Width of the counter.
    timebase_hz : float, optional
        Rate of the time base of edge ticks [Hz].
    torque_per_unit : float, optional
        Torque of one unit of a voltage or current [N m].
    zero : float
        Voltage or current at no torque, in `unit`.
    sign : int
        -1 where the positive direction is the other one.
    wraps_at : float, optional
        Angle at which the source begins anew, in `unit`.
    """

    topic: Topic
    source: str
    unit: str = ""
    file_unit: str = ""
    bits: Bits = 32
    timebase_hz: Clock | None = None
    torque_per_unit: Number | None = Field(default=None, alias="Nm_per_unit")
    zero: Number = 0.0
    sign: Annotated[int, within(-1, 1)] = 1
    wraps_at: Annotated[float, within(1e-9, LARGEST)] | None = None

    @model_validator(mode="after")
    def _fits_the_topic(self) -> Mapped:
        if self.sign == 0:
            refuse("0", "1 or -1", "Write -1 to turn the direction round.", "sign")
        ticks = self.topic.endswith("/edge_ticks")
        if ticks and self.timebase_hz is None:
            refuse("missing", "the rate of the time base", "Add timebase_Hz.", "timebase_Hz")
        if not ticks and self.timebase_hz is not None:
            expected = "it together with times of edges"
            do = "Leave it out, or name a topic that ends with '/edge_ticks'."
            refuse("no meaning here", expected, do, "timebase_Hz")
        if self.unit:
            with refusing("unit"):
                kind = kind_of(self.topic, self.unit, "")
            if kind == "electric" and self.torque_per_unit is None:
                do = "Add the sensitivity of the analogue output."
                refuse("missing", f"torque [N m] of one {self.unit}", do, "Nm_per_unit")
        return self

    @property
    def wanted(self) -> Wanted:
        """Requests to the file."""
        return self._wanted(self.source)


class MapTable(Strict):
    """All tables of a channel map."""

    schema_: Annotated[str, one_of(SCHEMA), Field(alias="schema")]
    calibration: str
    run: Run
    time: TimeTable = TimeTable()
    csv: CsvForm = CsvForm()
    channel: list[Mapped] = Field(default_factory=list)

    @model_validator(mode="after")
    def _topics_once(self) -> MapTable:
        if not self.channel:
            refuse("no [[channel]]", "one for each topic", "Map torque and encoders.", "channel")
        refuse_twice((row.topic for row in self.channel), "channel", "topic")
        return self


ChannelMap: TypeAlias = TableFile[MapTable]
"""A checked map; what it names is relative to its folder."""


def read_map(path: Path) -> ChannelMap:
    """The channel map in a file.

    Raises
    ------
    BenchError
        When it is no TOML, or a key is missing, unknown or out of its range.
    """
    return read_table_file(path, "a channel map", MapTable)
