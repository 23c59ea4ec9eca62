"""Recordings that are tables of whole columns: MAT files of MATLAB up to version 7.2, and Parquet."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import polars as pl
from scipy.io import loadmat
from scipy.io.matlab import MatlabOpaque

from pmg.pipeline.importers.source import ROWS, Block, SourceChannel, Wanted, channel_of, unreadable
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from datetime import datetime
    from pathlib import Path

    import numpy.typing as npt

    Column: TypeAlias = npt.NDArray[Any]

NUMBERS = "fiub"
"""Kinds of values that are numbers."""

MOST_OF_MAT = 10_000
"""Rows of numbers that are listed of a MAT file."""

NANOSECONDS = 1e9
"""In a second."""

READERS = {"mat": ("SciPy", "scipy"), "parquet": ("Polars", "polars")}
"""Title and package of what reads a format."""


@dataclass
class TableSource:
    """A MAT or Parquet file; the second column of a matrix ``x`` is called ``x(:,2)``, its row ``x(2,:)``.

    Parameters
    ----------
    path : Path
        The file.
    format : str
        ``mat`` or ``parquet``.
    """

    path: Path
    format: str
    place: str = field(default="sample", init=False)
    reader: str = field(init=False)
    channels: tuple[SourceChannel, ...] = field(init=False)
    properties: Mapping[str, str] = field(default_factory=dict, init=False)
    reading: Mapping[str, str] = field(default_factory=dict, init=False)
    started_at: datetime | None = field(default=None, init=False)
    _columns: Mapping[str, Column] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        title, package = READERS[self.format]
        of_time: frozenset[str] = frozenset()
        self.reader = f"{title} {version(package)}"
        try:
            if self.format == "mat":
                self._columns = _of_mat(self.path)
            else:
                self._columns, of_time = _of_parquet(self.path)
        except Exception as fault:  # damaged files end the readers in errors of any kind
            raise unreadable(self.path, title, fault) from fault
        self.channels = tuple(
            SourceChannel(name, "s" if name in of_time else "", length=len(column))
            for name, column in self._columns.items()
        )

    def blocks(self, wanted: Sequence[Wanted]) -> Iterator[Block]:
        """The wanted columns, at most `ROWS` rows at a time.

        Raises
        ------
        RecordingError
            When a column is missing, holds no numbers, or is of another length than the others.
        """
        found = {want: self._column(want) for want in wanted}
        lengths = {len(column) for column in found.values()}
        if len(lengths) > 1:
            came = ", ".join(f"{want.name}: {len(column)}" for want, column in found.items())
            raise RecordingError(str(self.path), f"rows of {came}", "as many rows in each channel", "Export them anew.")
        rows = lengths.pop() if lengths else 0
        for first in range(0, rows, ROWS):
            places = np.arange(first + 1, min(first + ROWS, rows) + 1)
            yield Block(places, {want: column[first : first + ROWS] for want, column in found.items()})

    def _column(self, want: Wanted) -> Column:
        column = self._columns[channel_of(self, want.name, f"{self.path.name}: channel").name]
        where = f"{self.path.name}: {want.name}"
        if column.dtype.kind not in NUMBERS:
            raise RecordingError(where, f"values of kind {column.dtype}", "numbers", "Correct the export.")
        if want.columns > 1:
            came, do = f"columns = {want.columns}", "Name the column by its own name."
            raise RecordingError(where, came, "one value in each row", do)
        return column


def _of_mat(path: Path) -> dict[str, Column]:
    """Variables of a MAT file by name, with what structs and cells hold."""
    found: dict[str, Column] = {}
    for name, values in loadmat(path).items():
        if not name.startswith("__"):
            found |= itertools.islice(_members(name, values), MOST_OF_MAT - len(found))
    if len(found) >= MOST_OF_MAT:
        do = "Save the rows of numbers as variables of their own."
        raise RecordingError(str(path), "structs and cells without end", f"up to {MOST_OF_MAT} members", do)
    return found


def _members(name: str, values: object) -> Iterator[tuple[str, Column]]:
    """Rows and columns of a variable as they are, a matrix by its longer side; none of three dimensions.

    A field ``q`` of a struct ``x`` is ``x/q``, as a MAT file of version 7.3 calls it, that of its second element
    ``x(2)/q``; a cell is ``x{2}``. Where no element of these holds numbers, the variable stands for them.
    """
    if not isinstance(values, np.ndarray) or values.ndim > 2:
        return
    if isinstance(values, MatlabOpaque):  # a table or a time series: what it holds MATLAB alone can read
        yield name, np.zeros(0, dtype=np.object_)
    elif values.dtype.names or values.dtype == np.object_:
        numbers = False
        for member, column in _elements(name, values):
            if values.size == 1 or column.dtype.kind in NUMBERS:
                numbers = True
                yield member, column
        if not numbers:
            yield name, np.zeros(0, dtype=np.object_)
    elif values.ndim == 2 and min(values.shape) > 1:
        wide = values.shape[1] > values.shape[0]
        for k, part in enumerate(values if wide else values.T, 1):
            yield f"{name}({k},:)" if wide else f"{name}(:,{k})", part
    else:
        yield name, values.ravel()


def _elements(name: str, values: Column) -> Iterator[tuple[str, Column]]:
    """What the elements of a struct or a cell hold."""
    for place, each in enumerate(values.ravel(order="F"), 1):
        if values.dtype.names:
            element = name if values.size == 1 else f"{name}({place})"
            for field_name in values.dtype.names:
                yield from _members(f"{element}/{field_name}", each[field_name])
        else:
            yield from _members(f"{name}{{{place}}}", each)


def _of_parquet(path: Path) -> tuple[dict[str, Column], frozenset[str]]:
    """Columns of a Parquet file, and which of them are times; what is missing in one of numbers is NaN.

    A date with its time of day becomes seconds since the first one, a duration or a time of day its seconds.
    """
    frame = pl.read_parquet(path)
    of_time = frozenset(column.name for column in frame if column.dtype in (pl.Datetime, pl.Duration, pl.Time))
    frame = frame.with_columns(column.cast(pl.Float64) for column in frame if column.dtype.is_numeric())
    frame = frame.with_columns(_seconds(frame[name]) for name in of_time)
    return {name: frame[name].to_numpy() for name in frame.columns}, of_time


def _seconds(column: pl.Series) -> pl.Series:
    """Times in seconds."""
    if column.dtype == pl.Time:
        return column.cast(pl.Int64).cast(pl.Float64) / NANOSECONDS
    spans = column if column.dtype == pl.Duration else column - column.drop_nulls().first()
    return spans.dt.total_nanoseconds().cast(pl.Float64) / NANOSECONDS
