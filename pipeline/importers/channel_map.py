"""The channel map: which channel of a foreign file is which topic of layout pmg.v1, in the words of a TOML file."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pmg.pipeline.files.toml import read_toml
from pmg.pipeline.files.toml_table import Reader
from pmg.pipeline.importers.csv_dialect import CsvForm
from pmg.pipeline.importers.source import Wanted
from pmg.pipeline.recording.channels import LARGEST_RATE, SPECS
from pmg.pipeline.recording.run import OPTIONAL, REQUIRED
from pmg.pipeline.wording.units import TIME, declared, kind_of
from pmg.sim.errors import BenchError, near_miss

if TYPE_CHECKING:
    from collections.abc import Mapping

SCHEMA = "pmg.import/1"
"""Schema of the file."""

WIDEST = 62
"""Widest counter [bits]; one of 64 does not wrap within a campaign and is told as this."""
LARGEST = 1e12
"""Largest number taken where nothing narrower is known."""
SOMETIMES = ("bits", "columns", "column", "timebase_Hz", "Nm_per_unit", "wraps_at")
"""Keys of a channel that only some channels take."""
TIMING = ("rate_Hz", "source", "unit", "ticks", "bits", "frequency_Hz", "columns", "column")
"""Keys of ``[time]``."""
BESIDE = {
    "unit": "'source'",
    "bits": "'ticks'",
    "frequency_Hz": "'ticks'",
    **dict.fromkeys(("columns", "column"), "'source' or 'ticks'"),
}
"""Keys of ``[time]`` that another one gives a meaning, and which one."""
RUN_KEYS = tuple(key for key in (*REQUIRED, *OPTIONAL) if key != "layout")
"""Keys of ``[run]``, which go into the recording as they are."""


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


@dataclass(frozen=True)
class Timing:
    """How a row of the file finds its place in time.

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


@dataclass(frozen=True)
class Mapped:
    """One channel of the file and what becomes of it.

    Parameters
    ----------
    where : str
        Place in the map, for messages.
    topic : str
        Topic of layout pmg.v1.
    wanted : Wanted
        Channel of the file.
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

    where: str
    topic: str
    wanted: Wanted
    unit: str = ""
    file_unit: str = ""
    bits: int = 32
    timebase_hz: float | None = None
    torque_per_unit: float | None = None
    zero: float = 0.0
    sign: int = 1
    wraps_at: float | None = None


@dataclass(frozen=True)
class ChannelMap:
    """A checked map.

    Parameters
    ----------
    path : Path
        The file.
    text : str
        What stands in it.
    calibration : Path
        Calibration that goes into each recording.
    run : mapping of str to str or Lookup
        What is said of the run.
    timing : Timing
        How rows find their place in time.
    csv : CsvForm
        How a CSV file is written, as far as the map says so.
    channels : tuple of Mapped
        At least one.
    """

    path: Path
    text: str
    calibration: Path
    run: Mapping[str, str | Lookup]
    timing: Timing
    channels: tuple[Mapped, ...]
    csv: CsvForm = field(default_factory=CsvForm)


def read_map(path: Path) -> ChannelMap:
    """The channel map in a file.

    Raises
    ------
    BenchError
        When it is no TOML, or a key is missing, unknown or out of its range.
    """
    file = read_toml(path, "a channel map")
    reader = Reader(path.name, file.data)
    reader.word("schema", (SCHEMA,))
    made = ChannelMap(
        path=path,
        text=file.text,
        calibration=path.parent / reader.text("calibration"),
        run=read_words(reader.sub("run")),
        timing=_timing(reader.sub("time", optional=True)),
        csv=_csv(reader.sub("csv", optional=True)),
        channels=tuple(_mapped(row) for row in reader.rows("channel")),
    )
    reader.done()
    topics = [mapped.topic for mapped in made.channels]
    if not topics:
        raise BenchError(f"{path.name}: channel", "no [[channel]]", "one for each topic", "Map torque and encoders.")
    twice = sorted({topic for topic in topics if topics.count(topic) > 1})
    if twice:
        raise BenchError(f"{path.name}: channel", f"'{twice[0]}' twice", "each topic once", "Leave one of them out.")
    return made


def read_words(reader: Reader) -> dict[str, str | Lookup]:
    """What is said of the run; values and vocabulary are checked by the recording's own reader, for each file."""
    found: dict[str, str | Lookup] = {}
    for key, value in reader.table.items():
        where = f"{reader.where}: {key}"
        if key not in RUN_KEYS:
            raise BenchError(where, "unknown key", "a key of pmg.run", near_miss(key, RUN_KEYS))
        if isinstance(value, dict):
            inner = Reader(where, value)
            source = "property" if "property" in value else "file"
            found[key] = Lookup(source, inner.word("file", ("stem",)) if source == "file" else inner.text("property"))
            inner.done()
        elif isinstance(value, datetime):
            found[key] = value.isoformat()
        elif isinstance(value, str | int | float) and not isinstance(value, bool):
            found[key] = str(value)
        else:
            do = 'Write it as text, number or { property = "NAME" }.'
            raise BenchError(where, repr(value), "text, a number or a time", do)
    return found


def _timing(reader: Reader) -> Timing:
    reader.asked.update(TIMING)
    given = reader.table.keys() & {"rate_Hz", "source", "ticks"}
    rate = reader.number("rate_Hz", 1e-6, LARGEST_RATE) if "rate_Hz" in given else None
    timing = Timing(rate)
    if {"source", "ticks"} <= given:
        do = "Leave one of them out."
        raise BenchError(reader.where, "both 'source' and 'ticks'", "times, or ticks of a counter", do)
    if "source" in given:
        scale = TIME[reader.word("unit", TIME, "s")]
        timing = Timing(rate, _wanted(reader, "source"), scale)
    elif "ticks" in given:
        wanted, bits = _wanted(reader, "ticks"), reader.whole("bits", 1, WIDEST)
        timing = Timing(rate, wanted, 1.0 / reader.number("frequency_Hz", 1e-6, LARGEST), bits)
    reader.done(BESIDE)
    return timing


def _wanted(reader: Reader, key: str) -> Wanted:
    """A channel of the file, with the column where several are interleaved in it."""
    name = reader.text(key)
    columns = reader.whole("columns", 1, 10_000, 1)
    return Wanted(name, columns, reader.whole("column", 1, columns, None if columns > 1 else 1))


def _mapped(reader: Reader) -> Mapped:
    reader.asked.update(SOMETIMES)
    topic = reader.word("topic", SPECS)
    wanted, unit = _wanted(reader, "source"), reader.text("unit", "")
    kind = kind_of(topic, unit, reader.where) if unit else None
    counters = {"bits": reader.whole("bits", 1, WIDEST, 32)} if "bits" in reader.table else {}
    mapped = Mapped(
        where=f"{reader.where} ({topic})",
        topic=topic,
        wanted=wanted,
        unit=declared(unit),
        file_unit=reader.text("file_unit", ""),
        timebase_hz=reader.number("timebase_Hz", 1e-6, LARGEST) if topic.endswith("/edge_ticks") else None,
        torque_per_unit=(
            reader.number("Nm_per_unit", -LARGEST, LARGEST)
            if kind == "electric" or "Nm_per_unit" in reader.table
            else None
        ),
        zero=reader.number("zero", -LARGEST, LARGEST, 0.0),
        sign=reader.whole("sign", -1, 1, 1),
        wraps_at=reader.number("wraps_at", 1e-9, LARGEST) if "wraps_at" in reader.table else None,
        **counters,
    )
    reader.done({"timebase_Hz": "a topic that ends with '/edge_ticks'"})
    if mapped.sign == 0:
        raise BenchError(f"{reader.where}: sign", "0", "1 or -1", "Write -1 to turn the direction round.")
    return mapped


def _csv(reader: Reader) -> CsvForm:
    reader.asked.add("header_line")
    form = CsvForm(
        encoding=reader.word("encoding", ("auto", "utf-8", "utf-16", "cp1252", "latin-1"), "auto"),
        delimiter=reader.word("delimiter", ("auto", ";", ",", "\t", "|", " "), "auto"),
        decimal=reader.word("decimal", ("auto", ".", ","), "auto"),
        comment=reader.text("comment", "#"),
        header_line=reader.whole("header_line", 0, 1_000_000) if "header_line" in reader.table else None,
        units_row=reader.word("units_row", ("auto", "yes", "no"), "auto"),
        bad_rows=reader.whole("bad_rows", 0, 1_000_000, 0),
    )
    reader.done()
    if form.delimiter == form.decimal == ",":
        do = "Have the recorder write ';' between cells, or leave one of the two keys to 'auto'."
        raise BenchError(reader.where, "delimiter and decimal are both ','", "two different signs", do)
    return form
