"""The catalogue as an SQLite file in the store, made anew from the manifests whenever they differ; never the truth."""

from __future__ import annotations

import hashlib
import sqlite3
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.catalogue.columns import COLUMNS, Column
from pmg.pipeline.catalogue.gather import Gathered, gather
from pmg.pipeline.catalogue.query import select
from pmg.pipeline.files.atomic import PREFIX, write_atomic
from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.store.store import RUNS, SOURCES

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from pmg.pipeline.catalogue.entries import Cell, Entry
    from pmg.pipeline.store.store import Store

FILE = "catalogue.sqlite"
SCHEMA = "pmg.catalogue/2"
MAGIC = b"SQLite format 3\0"
ANALYSIS = ("analysis/analysis.json", "analysis/grid.parquet")
"""Columns of an analysis that the catalogue holds, in addition to the manifests."""

TABLES: dict[str, tuple[str, ...]] = {
    "Environment": ("name TEXT", "stamp TEXT"),
    "Test": ("id INTEGER PRIMARY KEY", "name TEXT UNIQUE"),
    "Measurement": (
        "id INTEGER PRIMARY KEY",
        "test INTEGER REFERENCES Test",
        *(f"{name} TEXT" for name in ("name", "file", "status", "point", "configuration", "drive", "manoeuvre")),
        *(f"{name} TEXT" for name in ("measurement_begin", "sha256", "origin", "note")),
        *(f"{name} INTEGER" for name in ("gear", "findings", "errors", "simulated", "samples", "size")),
        "rate_hz REAL",
    ),
    "SubMatrix": (
        "id INTEGER PRIMARY KEY",
        "measurement INTEGER REFERENCES Measurement",
        *(f"{name} TEXT" for name in ("name", "configuration", "drive", "measurement_begin", "reasons")),
        *(f"{name} INTEGER" for name in ("gear", "number_of_rows", "accepted", "rest_sun", "rest_ring", "analysed")),
        *(f"{name} REAL" for name in ("begin_s", "seconds", "sun_set", "ring_set", "load")),
    ),
    "MeaQuantity": (
        "submatrix INTEGER REFERENCES SubMatrix",
        "name TEXT",
        "unit TEXT",
        *(f"{name} REAL" for name in ("average", "standard_deviation", "u", "u_common")),
        "PRIMARY KEY (submatrix, name)",
    ),
    "Remark": ("severity TEXT", "place TEXT", "message TEXT"),
}
"""Tables by the names of ASAM ODS, and the remarks of the build."""
QUANTITIES = ("torque_sun", "torque_ring", "speed_sun", "speed_ring")
EITHER = ("name", "configuration", "gear", "drive", "measurement_begin")
"""Fields of a window that the run stands in for where a recording has none."""


@dataclass(frozen=True)
class Catalogue:
    """The catalogue, open in memory.

    Parameters
    ----------
    connection : sqlite3.Connection
        To a copy; nothing that is asked changes the file.
    rebuilt : bool
        Whether it was made anew.
    remarks : tuple of Remark
        What of the store is not in it, as findings of a stage.
    """

    connection: sqlite3.Connection
    rebuilt: bool
    remarks: tuple[Remark, ...]

    @property
    def whole(self) -> bool:
        """Whether it holds all that the store does."""
        return all(remark.severity != "error" for remark in self.remarks)

    def rows(
        self, columns: Sequence[Column], condition: str | None = None, sort: tuple[Column, bool] | None = None
    ) -> list[tuple[Cell, ...]]:
        """One row a window, and one for each recording without any.

        Parameters
        ----------
        columns : sequence of Column
            What is given of each.
        condition : str, optional
            Which rows, as a WHERE clause of SQL; all when not given.
        sort : (Column, bool), optional
            By what, and whether the largest comes first; by start when not given. What is not known comes last.
        """
        by = "start IS NULL, start, rowid_m, rowid_s"
        if sort is not None:
            column, falling = sort
            by = f"{column.name} IS NULL, {column.name} {'DESC' if falling else 'ASC'}, {by}"
        return select(self.connection, columns, condition, by, (*TABLES, "runs"))

    def values(self, column: Column) -> list[str]:
        """Values of a column of text, each once."""
        asked = f"SELECT DISTINCT {column.name} FROM runs WHERE {column.name} IS NOT NULL"
        return [str(value) for (value,) in self.connection.execute(asked)]


def open_catalogue(store: Store) -> Catalogue:
    """The catalogue of a store; made anew where it is missing, damaged, or of other manifests.

    Where the store cannot be written, it is made in memory only.

    Raises
    ------
    StoreError
        There is no store.
    """
    store.require()
    path, stamp = store.path / FILE, _stamp_of(store.path)
    connection = _opened(path, stamp)
    rebuilt = connection is None
    unwritten: tuple[Remark, ...] = ()
    if connection is None:
        connection = _built(gather(store), stamp)
        try:
            write_atomic(path, connection.serialize())
        except OSError as error:
            unwritten = (Remark("info", str(path), f"not kept ({error.strerror}); made anew at every call"),)
    remarks = connection.execute("SELECT severity, place, message FROM Remark ORDER BY rowid")
    return Catalogue(connection, rebuilt, (*(Remark(*remark) for remark in remarks), *unwritten))


def _stamp_of(folder: Path) -> str:
    """Hash of all that the catalogue is made from: names and bytes, and which recordings have their samples."""
    digest = hashlib.sha256(SCHEMA.encode())
    sources = sorted(path for path in (folder / SOURCES).glob("*.json") if not path.name.startswith(PREFIX))
    for path in (*sources, *(folder / name for name in ANALYSIS)):
        with suppress(OSError):
            decoded = (folder / RUNS / f"{path.stem}.parquet").is_file()
            digest.update(f"{path.name!r} {sha256_of(path)} {decoded}\n".encode())
    return digest.hexdigest()


def _built(gathered: Gathered, stamp: str) -> sqlite3.Connection:
    """The catalogue of what was gathered, in memory."""
    connection = sqlite3.connect(":memory:")
    for name, fields in TABLES.items():
        connection.execute(f"CREATE TABLE {name} ({', '.join(fields)})")
    connection.execute("CREATE INDEX windows ON SubMatrix (measurement)")
    connection.execute(_view())
    tests: dict[Cell, int] = {}
    for entry in gathered.recordings:
        campaign = entry.fields["campaign"]
        if campaign is not None and campaign not in tests:
            tests[campaign] = _insert(connection, "Test", {"name": campaign})
        own = {name: value for name, value in entry.fields.items() if name != "campaign"}
        recording = _insert(connection, "Measurement", own | {"test": tests.get(campaign)})
        for window in entry.parts:
            _insert_window(connection, window, recording)
    for remark in gathered.remarks:
        _insert(connection, "Remark", {"severity": remark.severity, "place": remark.where, "message": remark.message})
    _insert(connection, "Environment", {"name": SCHEMA, "stamp": f"{stamp} {_digest(connection)}"})
    connection.commit()
    return connection


def _insert_window(connection: sqlite3.Connection, window: Entry, recording: int) -> None:
    place = _insert(connection, "SubMatrix", window.fields | {"measurement": recording})
    for quantity in window.parts:
        _insert(connection, "MeaQuantity", quantity.fields | {"submatrix": place})


def _insert(connection: sqlite3.Connection, table: str, fields: dict[str, Cell]) -> int:
    names, marks = ", ".join(fields), ", ".join("?" * len(fields))
    done = connection.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", list(fields.values()))
    return int(done.lastrowid or 0)


def _view() -> str:
    """The view ``runs``: the columns of `COLUMNS`, one row a window or run in motion."""
    shown = ", ".join(f"{_source(column)} AS {column.name}" for column in COLUMNS)
    joins = " ".join(
        f"LEFT JOIN MeaQuantity {q} ON {q}.submatrix = SubMatrix.id AND {q}.name = '{q}'" for q in QUANTITIES
    )
    return (
        f"CREATE VIEW runs AS SELECT {shown}, Measurement.id AS rowid_m, SubMatrix.id AS rowid_s FROM Measurement "
        "LEFT JOIN Test ON Test.id = Measurement.test "
        f"LEFT JOIN SubMatrix ON SubMatrix.measurement = Measurement.id {joins}"
    )


def _source(column: Column) -> str:
    table, _, field = column.source.partition(".")
    if table != "SubMatrix" or field not in EITHER:
        return column.source
    return f"COALESCE({column.source}, Measurement.{'point' if field == 'name' else field})"


def _opened(path: Path, stamp: str) -> sqlite3.Connection | None:
    """The file's contents, where they are whole and of these manifests."""
    connection = sqlite3.connect(":memory:")
    try:
        data = path.read_bytes()
        if not data.startswith(MAGIC):
            raise ValueError("no database")
        connection.deserialize(data)
        found = connection.execute("SELECT name, stamp FROM Environment").fetchall()
        views = [text for (text,) in connection.execute("SELECT sql FROM sqlite_master WHERE type = 'view'")]
        if found == [(SCHEMA, f"{stamp} {_digest(connection)}")] and views == [_view()]:
            return connection
    except (OSError, sqlite3.Error, ValueError, OverflowError):
        pass
    connection.close()
    return None


def _digest(connection: sqlite3.Connection) -> str:
    """Hash of every row but the stamp's own, so that a changed byte is seen."""
    digest = hashlib.sha256()
    for table in TABLES:
        if table != "Environment":
            for row in connection.execute(f"SELECT * FROM {table} ORDER BY rowid"):
                digest.update(repr(row).encode("utf-8", "backslashreplace"))
    return digest.hexdigest()
