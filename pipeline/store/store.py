"""The store: decoded runs as Parquet and one manifest a source, written so that a kill at any moment harms nothing."""

from __future__ import annotations

import hashlib
import io
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import polars as pl

from pmg.pipeline.files.atomic import PREFIX, abandoned, write_atomic, write_together
from pmg.pipeline.files.json_values import ChangedError, proven_json, read_json, read_proven_json
from pmg.pipeline.files.notes import note_recording, note_store
from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.findings import Finding
from pmg.pipeline.store.manifest import FAILED, INGESTED, SCHEMA, Manifest, manifest_of
from pmg.pipeline.store.sources import SUFFIX
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

MARK = "store.json"
SOURCES = "sources"
RUNS = "runs"
ORDERS = "orders"
LOGS = "logs"
STATUSES = (INGESTED, FAILED)
REMOVED = f"{PREFIX}removed-"
"""Start of the names of manifests that are being removed."""


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
            refuse_recordings(path)
            raise StoreError(str(path), "a file", "a folder", "Name a folder for the store.")
        if mark.is_file():
            schema = _schema_of(mark)
            if schema != SCHEMA:
                raise StoreError(str(mark), f"schema {schema!r}", SCHEMA, "Choose another folder, or ingest anew.")
        elif path.is_dir() and _held_otherwise(path):
            refuse_recordings(path)
            raise StoreError(
                str(path),
                f"a folder with other things in it and no {MARK}",
                "a store, or an empty folder",
                "Choose another folder; nothing was changed.",
            )

    @property
    def made(self) -> bool:
        """Whether the folder is a store by now."""
        return (self.path / MARK).is_file()

    def prepare(self) -> None:
        """Make the folder a store."""
        if not self.made:
            write_atomic(self.path / MARK, f'{{\n "schema": "{SCHEMA}"\n}}\n'.encode())
            note_store()

    def require(self) -> None:
        """Raise a `StoreError` where nothing was ever ingested."""
        if self.made:
            return
        if not self.path.exists():
            raise StoreError(str(self.path), "no such folder", "a store", "Run 'pmg ingest' first, or check the path.")
        raise StoreError(str(self.path), "no store there", "ingested recordings", "Run 'pmg ingest' first.")

    def manifest(self, identifier: str) -> Manifest | None:
        """The manifest of a source; None where there is none that can be read."""
        try:
            return self.read_manifest(identifier)
        except (OSError, KeyError, TypeError, ValueError, AttributeError):
            return None

    def read_manifest(self, identifier: str) -> Manifest:
        """The manifest of a source.

        Raises
        ------
        OSError, KeyError, TypeError, ValueError, AttributeError
            There is none, it is damaged, or its bytes are not those that were written.
        """
        absent = ValueError("no manifest, or its samples are missing")
        try:
            document = read_proven_json(self.path / SOURCES / f"{identifier}.json")
        except ChangedError:
            raise
        except (OSError, ValueError):
            raise absent from None
        if not isinstance(document, dict) or document.get("schema") != SCHEMA:
            raise absent
        if document.get("status") not in STATUSES:
            raise absent
        if document["status"] == INGESTED and not (self.path / RUNS / f"{identifier}.parquet").is_file():
            raise absent
        manifest = manifest_of(identifier, document)
        note_recording(manifest.file, manifest.sha256)
        return manifest

    def manifests(self, *, whole: bool = True) -> list[Manifest]:
        """Manifests of all sources, by name of the file.

        Parameters
        ----------
        whole : bool
            Whether one that is damaged or changed stands as a source that is not usable, with a finding that says so;
            it is left out otherwise, as an ingest writes it anew. One that another process removes meanwhile is no
            longer there.
        """
        self.require()
        found = []
        for path in sorted((self.path / SOURCES).glob("*.json")):
            if path.name.startswith(PREFIX):
                continue
            try:
                found.append(self.read_manifest(path.stem))
            except (OSError, KeyError, TypeError, ValueError, AttributeError) as error:
                if whole and path.exists():
                    found.append(_unusable(path.stem, error))
        return found

    def write(
        self, manifest: Manifest, samples: pl.DataFrame | None, others: Mapping[str, bytes] = MappingProxyType({})
    ) -> None:
        """Write a source: its samples and other files first, the manifest last, so that a manifest always has them.

        Parameters
        ----------
        manifest : Manifest
            Its record.
        samples : polars.DataFrame or None
            Its samples; None of a source that is not usable.
        others : mapping of str to bytes
            What else is kept of it, by its place in the store. The manifest holds the hashes of all these files.
        """
        if samples is not None:
            buffer = io.BytesIO()
            samples.write_parquet(buffer, compression="zstd", statistics=False)
            files = {**others, f"{RUNS}/{manifest.identifier}.parquet": buffer.getvalue()}
            write_together({self.path / name: data for name, data in files.items()})
            (self.path / LOGS / f"{manifest.identifier}.log").unlink(missing_ok=True)
            manifest = replace(manifest, files={_kind(name): _sha256(data) for name, data in files.items()})
        write_atomic(self.path / SOURCES / f"{manifest.identifier}.json", proven_json(manifest.document()))

    def write_log(self, identifier: str, text: str) -> str:
        """Keep what went wrong with a source; gives the file's place in the store."""
        name = f"{LOGS}/{identifier}.log"
        write_atomic(self.path / name, text.encode("utf-8", "backslashreplace"))
        return name

    def remove(self, identifier: str) -> None:
        """Forget a source, so that a kill leaves it whole or leaves what `sweep` clears away."""
        manifest = self.path / SOURCES / f"{identifier}.json"
        leaving = manifest.with_name(f"{REMOVED}{identifier}.json")
        with suppress(FileNotFoundError):
            manifest.replace(leaving)
        self._forget(identifier)
        leaving.unlink(missing_ok=True)

    def _forget(self, identifier: str) -> None:
        """Remove what is kept of a source apart from its manifest: samples, and lines of the shafts' orders."""
        (self.path / RUNS / f"{identifier}.parquet").unlink(missing_ok=True)
        for suffix in (".json", ".parquet"):
            (self.path / ORDERS / f"{identifier}{suffix}").unlink(missing_ok=True)
        (self.path / LOGS / f"{identifier}.log").unlink(missing_ok=True)

    def samples(self, manifest: Manifest) -> pl.DataFrame:
        """Decoded samples of a source: `sample`, `torque_sun`, `torque_ring` [N m], `angle_sun`, `angle_ring` [rad]."""
        name = f"{RUNS}/{manifest.identifier}.parquet"
        try:
            return pl.read_parquet(io.BytesIO(self.read_proven(manifest, name)))
        except (OSError, pl.exceptions.PolarsError) as error:
            came = f"unreadable ({error})"
            raise StoreError(str(self.path / name), came, "decoded samples", "Ingest its source again.") from error

    def read_proven(self, manifest: Manifest, name: str) -> bytes:
        """Bytes of a file of a source, by its place in the store.

        Raises
        ------
        OSError
            It cannot be read.
        StoreError
            They are not those whose hash its manifest holds.
        """
        data = (self.path / name).read_bytes()
        wanted, came = manifest.files.get(_kind(name)), _sha256(data)
        if wanted not in (None, came):
            hashes = f"bytes with the hash {came[:12]}", f"{str(wanted)[:12]}, as pmg wrote it"
            raise StoreError(str(self.path / name), *hashes, "Ingest its source again.")
        return data

    def sweep(self) -> None:
        """Clear away what killed processes left: half-written files, and sources half removed."""
        for leaving in (self.path / SOURCES).glob(f"{REMOVED}*.json"):
            self._finish_removal(leaving)
        for folder in (self.path, *(self.path / name for name in (SOURCES, RUNS, ORDERS, LOGS))):
            for left in folder.glob(f"{PREFIX}*"):
                if not left.name.startswith(REMOVED) and abandoned(left):
                    with suppress(OSError):
                        left.unlink()

    def _finish_removal(self, leaving: Path) -> None:
        """Remove the samples of a source whose manifest is gone; those of one that was ingested again stay."""
        identifier = leaving.stem.removeprefix(REMOVED)
        with suppress(OSError):
            if not (self.path / SOURCES / f"{identifier}.json").exists():
                self._forget(identifier)
            leaving.unlink(missing_ok=True)


def refuse_recordings(path: Path) -> None:
    """Raise a `StoreError` where a recording, or a folder of them, is named in place of a store."""
    if path.is_file() and path.suffix == SUFFIX:
        came = "a recording"
    elif path.is_dir() and any(path.glob(f"*{SUFFIX}")):
        came = "a folder of recordings"
    else:
        return
    do = "Run 'pmg ingest' first: 'pmg ingest RECORDINGS --store STORE' makes a store of them, in a folder of its own."
    raise StoreError(str(path), came, "a store", do)


def _held_otherwise(path: Path) -> bool:
    """Whether a folder holds things and no mark; one that another process has just made has its mark by now."""
    return any(not entry.name.startswith(PREFIX) for entry in path.iterdir()) and not (path / MARK).is_file()


def _schema_of(mark: Path) -> object:
    try:
        document = read_json(mark)
    except (OSError, ValueError):
        return "unreadable"
    return document.get("schema") if isinstance(document, dict) else "unreadable"


def _unusable(identifier: str, error: Exception) -> Manifest:
    """What stands for a source whose manifest is damaged or changed: nothing of it is taken."""
    came = str(error) if isinstance(error, ChangedError) else f"unreadable ({error!r:.200}); expected a manifest of pmg"
    file = identifier.encode("utf-8", "backslashreplace").decode()
    found = Finding(
        Severity.ERROR, f"{SOURCES}/{file}.json", came, file, Code.STORE_CHANGED, "Ingest its source again."
    )
    return Manifest(identifier, file, status=FAILED, findings=(found,))


def _kind(name: str) -> str:
    """Kind of a file of a source by its place in the store, such as ``runs.parquet``."""
    folder, _, file = name.partition("/")
    return f"{folder}.{file.rpartition('.')[2]}"


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
