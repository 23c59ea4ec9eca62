"""The store: decoded runs as Parquet and one manifest a source, written so that a kill at any moment harms nothing."""

from __future__ import annotations

import io
import json
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import polars as pl

from pmg.pipeline.aside import PREFIX, write_aside
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

SCHEMA = "pmg.store/1"
MARK = "store.json"
SOURCES = "sources"
RUNS = "runs"
ABANDONED = 3600.0
"""Age after which such a file belongs to no running process [s]."""


@dataclass(frozen=True)
class Manifest:
    """What the store knows of one source file.

    Parameters
    ----------
    identifier : str
        Stem of the file and the first eight digits of its hash.
    document : dict
        ``file``, ``sha256``, ``size``, ``status`` (``ingested`` or ``failed``), ``run``, ``calibration``,
        ``rate_hz``, ``first_sample``, ``samples``, ``findings`` and ``windows`` with their means.
    """

    identifier: str
    document: Mapping[str, Any]

    @property
    def ingested(self) -> bool:
        """Whether its runs are in the store."""
        return bool(self.document["status"] == "ingested")


class Store:
    """A folder of ingested recordings.

    Parameters
    ----------
    path : Path
        The folder.

    Raises
    ------
    StoreError
        The folder holds something else, or a store of another schema. Nothing is touched.
    """

    def __init__(self, path: Path) -> None:
        """Open the store; it is made on the first write."""
        self.path = path
        mark = path / MARK
        if path.exists() and not path.is_dir():
            raise StoreError(str(path), "a file", "a folder", "Name a folder for the store.")
        if mark.is_file():
            schema = _schema_of(mark)
            if schema != SCHEMA:
                raise StoreError(str(mark), f"schema {schema!r}", SCHEMA, "Choose another folder, or ingest anew.")
        elif path.is_dir() and any(not entry.name.startswith(PREFIX) for entry in path.iterdir()):
            raise StoreError(
                str(path),
                f"a folder with other things in it and no {MARK}",
                "a store, or an empty folder",
                "Choose another folder; nothing was changed.",
            )

    def prepare(self) -> None:
        """Make the folder a store."""
        mark = self.path / MARK
        if not mark.is_file():
            write_aside(mark, _json({"schema": SCHEMA}))

    def require(self) -> None:
        """Raise a `StoreError` where nothing was ever ingested."""
        if not (self.path / MARK).is_file():
            raise StoreError(str(self.path), "no store there", "ingested recordings", "Run 'pmg ingest' first.")

    def manifest(self, identifier: str) -> Manifest | None:
        """The manifest of a source; None where there is none that can be read."""
        path = self.path / SOURCES / f"{identifier}.json"
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        if not isinstance(document, dict) or document.get("schema") != SCHEMA:
            return None
        if document["status"] == "ingested" and not (self.path / RUNS / f"{identifier}.parquet").is_file():
            return None
        return Manifest(identifier, document)

    def manifests(self) -> list[Manifest]:
        """Manifests of all sources, by name of the file.

        Raises
        ------
        StoreError
            One of them cannot be read.
        """
        self.require()
        found = []
        for path in sorted((self.path / SOURCES).glob("*.json")):
            if path.name.startswith(PREFIX):
                continue
            manifest = self.manifest(path.stem)
            if manifest is None:
                raise StoreError(
                    str(path), "unreadable, or its samples are missing", SCHEMA, "Ingest its source again."
                )
            found.append(manifest)
        return found

    def write(self, identifier: str, document: Mapping[str, Any], samples: pl.DataFrame | None) -> None:
        """Write a source: samples first, the manifest last, so that a manifest always has its samples."""
        if samples is not None:
            buffer = io.BytesIO()
            samples.write_parquet(buffer, compression="zstd", statistics=False)
            write_aside(self.path / RUNS / f"{identifier}.parquet", buffer.getvalue())
        write_aside(self.path / SOURCES / f"{identifier}.json", _json({"schema": SCHEMA} | dict(document)))

    def remove(self, identifier: str) -> None:
        """Forget a source: the manifest first, so that samples without one are all that a kill can leave."""
        (self.path / SOURCES / f"{identifier}.json").unlink(missing_ok=True)
        (self.path / RUNS / f"{identifier}.parquet").unlink(missing_ok=True)

    def samples(self, identifier: str) -> pl.DataFrame:
        """Decoded samples of a source: `sample`, `torque_sun`, `torque_ring` [N m], `angle_sun`, `angle_ring` [rad]."""
        path = self.path / RUNS / f"{identifier}.parquet"
        try:
            return pl.read_parquet(path)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise StoreError(
                str(path), f"unreadable ({error})", "decoded samples", "Ingest its source again."
            ) from error

    def sweep(self) -> None:
        """Remove what interrupted writes left behind an hour ago or more; younger ones may be another process's."""
        for folder in (self.path, self.path / SOURCES, self.path / RUNS):
            for left in folder.glob(f"{PREFIX}*"):
                with suppress(OSError):
                    if time.time() - left.stat().st_mtime > ABANDONED:
                        left.unlink()


def _schema_of(mark: Path) -> object:
    try:
        document = json.loads(mark.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return "unreadable"
    return document.get("schema") if isinstance(document, dict) else "unreadable"


def _json(document: Mapping[str, Any]) -> bytes:
    return (json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n").encode()
