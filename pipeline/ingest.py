"""From recordings to the store: decode each file, find and judge its windows, condense them, keep the findings."""

from __future__ import annotations

import hashlib
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmg.pipeline.executors import map_over
from pmg.pipeline.recording import Code, Finding, Severity, UnusableRecordingError, read_recording
from pmg.pipeline.reduce import reduce_window
from pmg.pipeline.store import Store
from pmg.pipeline.windows import find_windows
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.recording import Recording
    from pmg.pipeline.windows import Window

SUFFIX = ".mcap"
WORTH_A_PROCESS = 64 * 2**20
"""Bytes of recordings from which a second process pays for its start."""


@dataclass(frozen=True)
class Source:
    """One file to ingest: where it lies, its name in the campaign, its identity."""

    path: Path
    name: str
    sha256: str

    @property
    def identifier(self) -> str:
        """Stem of the file and the first eight digits of its hash."""
        return f"{self.path.stem}-{self.sha256[:8]}"


@dataclass(frozen=True)
class IngestReport:
    """What an ingest did.

    Parameters
    ----------
    ingested, skipped, failed : int
        Files decoded now, already in the store, and not usable.
    windows, rejected : int
        Windows of all usable files, and those that failed a check.
    findings : tuple of Finding
        Of the files of this call, whether decoded now or earlier.
    """

    ingested: int
    skipped: int
    failed: int
    windows: int
    rejected: int
    findings: tuple[Finding, ...]


def find_recordings(place: Path) -> list[Path]:
    """The recordings of a folder (and below it), by name; or the one file that was named.

    Raises
    ------
    RecordingError
        Nothing is there.
    """
    if place.is_file():
        return [place]
    if not place.exists():
        raise RecordingError(str(place), "nothing there", f"a folder of {SUFFIX} files, or one", "Check the path.")
    found = sorted(path for path in place.rglob(f"*{SUFFIX}") if path.is_file())
    if not found:
        others = sorted({path.suffix or "no suffix" for path in place.iterdir()})
        held = f"no {SUFFIX} file" + (f" (but {', '.join(others[:5])})" if others else " (the folder is empty)")
        raise RecordingError(
            str(place), held, f"recordings with the ending {SUFFIX}", "Name the folder that holds them."
        )
    return found


def ingest(
    place: Path,
    store: Store,
    *,
    workers: int | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> IngestReport:
    """Decode recordings into the store; what is there already, with the same bytes, is not done again.

    Parameters
    ----------
    place : Path
        Folder of recordings, or one file.
    store : Store
        Receives samples and manifests.
    workers : int, optional
        Processes; by default as many as there are cores once the recordings are large.
    progress : callable, optional
        Told (done, total, name) after each file.

    Raises
    ------
    RecordingError
        There are no recordings.
    """
    paths = find_recordings(place)
    base = place if place.is_dir() else place.parent
    store.prepare()
    store.sweep()
    sources, twins = _sources(paths, base)
    manifests = {source: store.manifest(source.identifier) for source in sources}
    todo = [source for source in sources if (m := manifests[source]) is None or not m.ingested]
    if workers is None:
        large = sum(source.path.stat().st_size for source in todo) >= WORTH_A_PROCESS
        workers = (os.cpu_count() or 1) if large else 1
    done = len(sources) - len(todo)
    jobs = [(source, store.path) for source in todo]
    for (source, _), _ in map_over(_ingest_one, jobs, workers):
        done += 1
        if progress is not None:
            progress(done, len(sources), source.name)
    documents = []
    for source in sources:
        manifest = store.manifest(source.identifier)
        if manifest is None:
            raise RecordingError(source.name, "its manifest vanished", "an undisturbed store", "Run it again.")
        documents.append(manifest.document)
    windows = [window for document in documents for window in document["windows"]]
    failed = sum(document["status"] == "failed" for document in documents)
    return IngestReport(
        ingested=len(todo) - failed,
        skipped=len(sources) - len(todo),
        failed=failed,
        windows=len(windows),
        rejected=sum(not window["accepted"] for window in windows),
        findings=(*twins, *(Finding.from_dict(plain) for document in documents for plain in document["findings"])),
    )


def _sources(paths: list[Path], base: Path) -> tuple[list[Source], list[Finding]]:
    """Files by content: the same bytes twice are one source, and said so."""
    sources: dict[str, Source] = {}
    twins = []
    for path in paths:
        name = path.relative_to(base).as_posix()
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        if digest in sources:
            message = f"the same bytes as {sources[digest].name}; expected each run once. It is ingested once"
            twins.append(
                Finding(Code.DUPLICATE_FILE, Severity.WARNING, name, "whole file", message, "Remove the copy.")
            )
            continue
        sources[digest] = Source(path, name, digest)
    return list(sources.values()), twins


def _ingest_one(job: tuple[Source, Path]) -> bool:
    """Read, judge, condense and store one file; whether it could be used."""
    source, folder = job
    store = Store(folder)
    common = {"file": source.name, "sha256": source.sha256, "size": source.path.stat().st_size}
    try:
        recording = read_recording(source.path, source.name)
    except UnusableRecordingError as error:
        findings = [finding.to_dict() for finding in error.findings]
        store.write(source.identifier, common | {"status": "failed", "findings": findings, "windows": []}, None)
        return False
    windows = [_window_document(recording, window) for window in find_windows(recording)]
    store.write(source.identifier, common | _recording_document(recording) | {"windows": windows}, recording.samples)
    return True


def _recording_document(recording: Recording) -> dict[str, Any]:
    run, calibration = recording.run, recording.calibration
    return {
        "status": "ingested",
        "run": {
            "campaign": run.campaign,
            "point": run.point,
            "configuration": str(run.configuration),
            "gear": run.gear,
            "drive": run.drive,
            "started_at": run.started_at.isoformat(),
            "note": run.note,
        },
        "calibration": asdict(calibration),
        "rate_hz": recording.rate_hz,
        "first_sample": recording.first_sample,
        "samples": recording.samples.height,
        "findings": [finding.to_dict() for finding in recording.findings],
    }


def _window_document(recording: Recording, window: Window) -> dict[str, Any]:
    means = reduce_window(recording.samples, window, recording.rate_hz)
    return {
        "point": window.point,
        "configuration": str(window.configuration),
        "gear": window.gear,
        "drive": window.drive,
        "started_at_s": window.started_at.timestamp(),
        "first_sample": window.first_sample,
        "stop_sample": window.stop_sample,
        "setpoints": asdict(window.setpoints),
        "accepted": window.accepted,
        "reasons": list(window.reasons),
        "rest_sun": window.rest_sun,
        "rest_ring": window.rest_ring,
        "means": _finite(asdict(means)),
    }


def _finite(document: dict[str, Any]) -> dict[str, Any]:
    """The document with null for what is not a number, as JSON knows none."""
    plain: dict[str, Any] = {}
    for name, value in document.items():
        if isinstance(value, dict):
            plain[name] = _finite(value)
        else:
            plain[name] = None if isinstance(value, float) and value != value else value
    return plain
