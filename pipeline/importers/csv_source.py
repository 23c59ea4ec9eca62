"""Recordings in CSV, read a block of lines at a time; a cell that is no number is reported with line and column."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from importlib.metadata import version
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from pmg.pipeline.importers.clocks.text_clock import CLOCK_EXPECTED, TextClock, clock_of
from pmg.pipeline.importers.csv_dialect import MISSING, CsvForm, CsvHead, cells_of, holds_row, read_head
from pmg.pipeline.importers.source import ROWS, Block, SourceChannel, Wanted, channel_of
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import datetime
    from pathlib import Path

    import numpy.typing as npt

    from pmg.pipeline.recording.findings import Findings
    from pmg.sim.signals import Array


@dataclass
class CsvSource:
    """A CSV file.

    Parameters
    ----------
    path : Path
        The file.
    form : CsvForm
        What the user says about it.
    findings : Findings
        Receives rows that are left out.
    """

    path: Path
    form: CsvForm
    findings: Findings
    format: str = "csv"
    place: str = "line"
    reader: str = field(init=False)
    channels: tuple[SourceChannel, ...] = field(init=False)
    properties: Mapping[str, str] = field(init=False)
    reading: Mapping[str, str] = field(init=False)
    started_at: datetime | None = None
    head: CsvHead = field(init=False)
    _bad: int = field(default=0, init=False)
    _clocks: dict[int, TextClock] = field(init=False)

    def __post_init__(self) -> None:
        self.reader = f"polars {version('polars')}"
        self.head = read_head(self.path, self.form)
        self.properties, self.reading = dict(self.head.properties), self.head.reading()
        self._clocks = dict(self._clocks_of_first_row())
        self.started_at = next((clock.began for clock in self._clocks.values() if clock.began is not None), None)
        units = ["s" if n in self._clocks else unit for n, unit in enumerate(self.head.units)]
        self.channels = tuple(SourceChannel(*pair) for pair in zip(self.head.names, units, strict=True))

    def _clocks_of_first_row(self) -> Iterator[tuple[int, TextClock]]:
        """Columns whose first cell is a time of day, with a date or without."""
        with self.path.open(encoding=self.head.encoding, errors="replace", newline=None) as stream:
            lines = islice(stream, self.head.data_line - 1, None)
            first = (n for n in lines if holds_row(n, self.form.comment, self.head.delimiter, len(self.head.names)))
            for n, cell in enumerate(cells_of(next(first, ""), self.head.delimiter)):
                if (clock := clock_of(cell)) is not None:
                    yield n, clock

    def blocks(self, wanted: Sequence[Wanted]) -> Iterator[Block]:
        """The wanted columns, at most `ROWS` rows at a time.

        Raises
        ------
        RecordingError
            When a column is missing, or more cells than are tolerated are no numbers.
        """
        for want in wanted:
            if want.columns > 1:
                came, do = f"columns = {want.columns}", "Name the column by its own name."
                raise RecordingError(f"{self.path.name}: {want.name}", came, "one value in each cell", do)
        for clock in self._clocks.values():
            clock.restart()
        where = f"{self.path.name}: column"
        at = {want: self.head.names.index(channel_of(self, want.name, where).name) for want in wanted}
        with self.path.open(encoding=self.head.encoding, errors="replace", newline=None) as stream:
            line, columns = self.head.data_line, len(self.head.names)
            for _ in islice(stream, line - 1):
                pass
            while lines := list(islice(stream, ROWS)):
                kept = [
                    n
                    for n, text in enumerate(lines)
                    if holds_row(text, self.form.comment, self.head.delimiter, columns)
                ]
                if kept and kept[-1] == len(lines) - 1 and not lines[-1].endswith("\n"):
                    self._cut(line + kept.pop())
                if kept:
                    places = np.array(kept, dtype=np.int64) + line
                    yield self._block([lines[n] for n in kept], places, at)
                line += len(lines)

    def _cut(self, line: int) -> None:
        self.findings.warning(
            Code.TRUNCATED,
            f"line {line}",
            "the last line has no end, so its last number may be cut; expected a line break after it. The row is "
            "left out",
            "Nothing to do where the recorder never writes one; else copy the file again.",
            lost="1 row",
        )

    def _block(self, lines: list[str], places: npt.NDArray[np.int64], at: dict[Wanted, int]) -> Block:
        text = "".join(lines)
        frame = self._quick(text, sorted(set(at.values())))
        if frame is None:
            return self._slow(lines, places, at)
        last, more = frame[f"{len(self.head.names) - 1}#end"], len(self.head.names) - 1
        short = np.flatnonzero(last.is_null().to_numpy())
        if any(lines[n].count(self.head.delimiter) < more for n in short):
            return self._slow(lines, places, at)
        if text.count(self.head.delimiter) != more * len(lines):
            return self._slow(lines, places, at)
        return Block(places, {want: frame[str(n)].fill_null(np.nan).to_numpy() for want, n in at.items()})

    def _quick(self, text: str, at: list[int]) -> pl.DataFrame | None:
        """The columns as numbers; None where a cell is none, or a point may be one between thousands."""
        if self.head.decimal == "," and "." in text:
            return None
        wanted, last = set(at), len(self.head.names) - 1
        schema = {str(n): pl.Float64 if n in wanted - set(self._clocks) else pl.String for n in range(last + 1)}
        columns = sorted({*at, last})
        try:
            frame = pl.read_csv(
                io.BytesIO(text.encode()),
                has_header=False,
                schema=schema,
                columns=columns,
                separator=self.head.delimiter,
                null_values=list(MISSING),
                decimal_comma=self.head.decimal == ",",
            )
            for n in wanted & set(self._clocks):
                times = [self._number(cell or "", n) for cell in frame[str(n)]]
                frame = frame.with_columns(pl.Series(str(n), times, dtype=pl.Float64))
        except (pl.exceptions.PolarsError, ValueError):
            return None
        return frame.with_columns(pl.col(str(last)).alias(f"{last}#end")) if frame.height == text.count("\n") else None

    def _slow(self, lines: list[str], places: npt.NDArray[np.int64], at: dict[Wanted, int]) -> Block:
        """Row by row, so that what is wrong has a place; a cell that is tolerated becomes empty, no other one."""
        columns: dict[Wanted, Array] = {want: np.full(len(lines), np.nan) for want in at}
        for row, line in enumerate(lines):
            cells = cells_of(line, self.head.delimiter)
            if len(cells) != len(self.head.names):
                came, expected = counted(len(cells), "cell"), counted(len(self.head.names), "cell")
                self._bad_row(int(places[row]), [("the row", came)], expected, "The row is left out", "1 row")
                continue
            faults, expected = [], ""
            for want, n in at.items():
                try:
                    columns[want][row] = self._number(cells[n], n)
                except ValueError:
                    faults.append((f"column '{want.name}'", f"'{cells[n][:40]}'"))
                    number = f"a number with decimal sign '{self.head.decimal}'"
                    expected = expected or (CLOCK_EXPECTED if n in self._clocks else number)
            if faults:
                self._bad_row(int(places[row]), faults, expected, "The cell is left out", "1 value")
        return Block(places, columns)

    def _number(self, cell: str, column: int) -> float:
        """The number in a cell of a column; NaN for an empty one, ValueError where it holds something else."""
        plain = cell.strip()
        if plain in MISSING:
            return np.nan
        if column in self._clocks:
            return self._clocks[column].seconds(plain)
        if ("." if self.head.decimal == "," else ",") in plain or "_" in plain:
            raise ValueError(plain)
        return float(plain.replace(",", "."))

    def _bad_row(self, line: int, faults: Sequence[tuple[str, str]], expected: str, done: str, lost: str) -> None:
        """Count a bad row, and stop at the first that is one too many; else tell each fault and what is done."""
        self._bad += 1
        if self._bad > self.form.bad_rows:
            earlier = f" (row {self._bad} of this kind)" if self._bad > 1 else ""
            do = f"Correct the file, or set bad_rows in [csv], now {self.form.bad_rows}: they become gaps."
            what, came = faults[0]
            raise RecordingError(f"{self.path}, line {line}, {what}", f"{came}{earlier}", expected, do)
        for what, came in faults:
            self.findings.error(
                Code.MESSAGE_MALFORMED,
                f"line {line}, {what}",
                f"{came}; expected {expected}. {done}",
                "Look up what the recorder wrote there.",
                lost=lost,
            )
