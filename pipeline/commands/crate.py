"""Where a result comes from, as an RO-Crate next to it: which program made which files of which recordings, and when.

The metadata follow RO-Crate 1.1 and its profile Process Run Crate 0.5: a `CreateAction` whose instrument is pmg,
whose objects are the recordings and whose results are the files of the folder.
"""

from __future__ import annotations

import base64
import hashlib
import json
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from pmg.pipeline.files.atomic import PREFIX, write_atomic
from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.store.store import Store
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Iterable
    from datetime import datetime

    from pmg.pipeline.recording.origin import ImportRecord

FILE = "ro-crate-metadata.json"
SPECIFICATION = "https://w3id.org/ro/crate/1.1"
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
CONTEXT = ("https://w3id.org/ro/crate/1.1/context", "https://w3id.org/ro/terms/workflow-run/context")
"""Terms of the specification, and of runs of programs; ``sha256`` is one of the latter."""
LICENCE = {
    "@id": "#licence",
    "@type": "CreativeWork",
    "name": "not stated",
    "description": "Under which licence these files may be used is not stated.",
}
PROGRAM = "#pmg"
FORMATS = {
    ".csv": "text/csv",
    ".html": "text/html",
    ".json": "application/json",
    ".mcap": "application/x-mcap",
    ".parquet": "application/vnd.apache.parquet",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".toml": "application/toml",
    ".xlsx": "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
}
"""Media types by ending."""


@dataclass(frozen=True)
class SourceFile:
    """A file that went in.

    Parameters
    ----------
    name : str
        Its name.
    sha256 : str
        Its hash, hexadecimal.
    size : int, optional
        Its length [bytes], where it is known.
    made_of : SourceFile, optional
        What it was imported from.
    """

    name: str
    sha256: str
    size: int | None = None
    made_of: SourceFile | None = None

    @property
    def identifier(self) -> str:
        """Name of its content (RFC 6920): the same bytes have the same, wherever they lie."""
        digest = base64.urlsafe_b64encode(bytes.fromhex(self.sha256)).decode().rstrip("=")
        return f"ni:///sha-256;{digest}"


@dataclass(frozen=True)
class CrateAction:
    """Record of an action.

    Parameters
    ----------
    command : str
        Such as ``pmg compare``.
    title : str
        What came out, in a phrase.
    description : str
        Settings, or the command line.
    started, ended : datetime
        When, with their time zone.
    sources : tuple of SourceFile
        Files that went in.
    results : tuple of Path, optional
        Files that came out, inside the folder; all that are in it when not given.
    """

    command: str
    title: str
    description: str
    started: datetime
    ended: datetime
    sources: tuple[SourceFile, ...] = ()
    results: tuple[Path, ...] | None = None


def write_crate(folder: Path, action: CrateAction) -> Path:
    """Write ``ro-crate-metadata.json`` into a folder of results; the same files and times give the same bytes.

    Parameters
    ----------
    folder : Path
        Holds the results.
    action : CrateAction
        What made them.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    StoreError
        A result is not there, or not inside of the folder.
    ValueError
        A time has no time zone.
    """
    path = folder / FILE
    text = json.dumps(_crate_document(folder, action), indent=1, ensure_ascii=False) + "\n"
    write_atomic(path, text.encode("utf-8", "backslashreplace"))
    return path


def _crate_document(folder: Path, action: CrateAction) -> dict[str, Any]:
    """The metadata as JSON-LD."""
    if action.started.tzinfo is None or action.ended.tzinfo is None:
        raise ValueError("times of a crate need a time zone")
    made = [_result(folder, path) for path in _results(folder, action.results)]
    taken = dict[str, dict[str, Any]]()
    for entity in (each for source in action.sources for each in _source(source)):
        taken.setdefault(entity["@id"], entity)
    root = {
        "@id": "./",
        "@type": "Dataset",
        "conformsTo": {"@id": PROFILE},
        "name": action.title,
        "description": f"{action.title}. Made by {action.command}.",
        "datePublished": action.ended.isoformat(),
        "license": {"@id": LICENCE["@id"]},
        "hasPart": _references(each["@id"] for each in (*made, *taken.values())),
    }
    done = {
        "@type": "CreateAction",
        "name": action.command,
        "description": action.description,
        "startTime": action.started.isoformat(),
        "endTime": action.ended.isoformat(),
        "actionStatus": "http://schema.org/CompletedActionStatus",
        "instrument": {"@id": PROGRAM},
        "object": _references(dict.fromkeys(source.identifier for source in action.sources)),
        "result": _references(each["@id"] for each in made),
    }
    digest = hashlib.sha256(json.dumps([done, made]).encode()).hexdigest()
    done = {"@id": f"#action-{digest[:16]}"} | done
    program = {"@id": PROGRAM, "@type": "SoftwareApplication", "name": "pmg", "softwareVersion": version("pmg-bench")}
    graph = [
        {
            "@id": FILE,
            "@type": "CreativeWork",
            "conformsTo": {"@id": SPECIFICATION},
            "about": {"@id": "./"},
        },
        root | {"mentions": {"@id": done["@id"]}},
        {"@id": PROFILE, "@type": "CreativeWork", "name": "Process Run Crate", "version": "0.5"},
        LICENCE,
        program,
        done,
        *made,
        *taken.values(),
    ]
    return {"@context": list(CONTEXT), "@graph": graph}


def recordings_of(store: Path, campaign: str | None = None) -> tuple[SourceFile, ...]:
    """The ingested recordings of a store, or of one campaign in it, in order of their names.

    Raises
    ------
    StoreError
        A manifest cannot be read.
    """
    return tuple(
        SourceFile(manifest.file, manifest.sha256, manifest.size, _imported(manifest.origin))
        for manifest in Store(store).manifests()
        if manifest.ingested and campaign in (None, manifest.campaign)
    )


def source_file(path: Path) -> SourceFile:
    """A file that is there, by name, hash and length."""
    return SourceFile(path.name, sha256_of(path), path.stat().st_size)


def _imported(origin: ImportRecord | None) -> SourceFile | None:
    """Source of an imported recording; None where it was not imported, or its hash is none."""
    if origin is None or len(origin.sha256) != 64 or not set(origin.sha256) <= set("0123456789abcdef"):
        return None
    return SourceFile(origin.source, origin.sha256, int(origin.size) if origin.size.isdecimal() else None)


def _results(folder: Path, given: tuple[Path, ...] | None) -> list[Path]:
    """The files that came out, in order of their names, without the crate's own."""
    if given is None:
        every = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith(PREFIX))
        given = tuple(every)
    for path in given:
        if not path.is_file() or not path.is_relative_to(folder):
            raise StoreError(str(path), "not a file of the results", f"a file in {folder}", "Write it first.")
    return sorted(
        {path for path in given if path != folder / FILE}, key=lambda path: path.relative_to(folder).as_posix()
    )


def _result(folder: Path, path: Path) -> dict[str, Any]:
    place = path.relative_to(folder).as_posix()
    return _file(quote(place.encode("utf-8", "surrogateescape")), place, sha256_of(path), path.stat().st_size)


def _source(source: SourceFile) -> list[dict[str, Any]]:
    """The file, and what it was made of."""
    entity = _file(source.identifier, source.name, source.sha256, source.size)
    if source.made_of is None:
        return [entity]
    return [entity | {"isBasedOn": {"@id": source.made_of.identifier}}, *_source(source.made_of)]


def _file(identifier: str, name: str, sha256: str, size: int | None) -> dict[str, Any]:
    entity = {"@id": identifier, "@type": "File", "name": name, "sha256": sha256}
    kind = FORMATS.get(PurePosixPath(name).suffix.lower())
    entity |= {} if kind is None else {"encodingFormat": kind}
    return entity if size is None else entity | {"contentSize": str(size)}


def _references(identifiers: Iterable[str]) -> list[dict[str, str]]:
    return [{"@id": identifier} for identifier in identifiers]
