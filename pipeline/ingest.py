"""From recordings to the store: decode each file, find and judge its windows, condense them, keep the findings."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from pmg.pipeline.executors import map_over
from pmg.pipeline.inventory import take_inventory
from pmg.pipeline.recording import Finding, UnusableRecordingError, read_recording
from pmg.pipeline.reduce import reduce_window
from pmg.pipeline.store import Store
from pmg.pipeline.windows import find_windows

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.pipeline.inventory import Source
    from pmg.pipeline.recording import Recording
    from pmg.pipeline.store import Manifest
    from pmg.pipeline.windows import Window

WORTH_A_PROCESS = 64 * 2**20
"""Bytes of recordings from which a second process pays for its start."""


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
    sha256 : frozenset of str
        Content of those files.
    campaigns : tuple of str
        Campaigns that they belong to.
    """

    ingested: int
    skipped: int
    failed: int
    windows: int
    rejected: int
    findings: tuple[Finding, ...]
    sha256: frozenset[str]
    campaigns: tuple[str, ...]


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
    inventory = take_inventory(place)
    store.prepare()
    store.sweep()
    there = {manifest.document["sha256"]: manifest for manifest in store.manifests() if manifest.ingested}
    todo = [source for source in inventory.sources if source.sha256 not in there]
    if workers is None:
        large = sum(source.path.stat().st_size for source in todo) >= WORTH_A_PROCESS
        workers = (os.cpu_count() or 1) if large else 1
    done = len(inventory.sources) - len(todo)
    failed = inventory.unreadable
    for (source, _), usable in map_over(_ingest_one, [(source, store.path) for source in todo], workers):
        done += 1
        failed += not usable
        if progress is not None:
            progress(done, len(inventory.sources), source.name)
    supersede(store, inventory.sources)
    known = {manifest.document["sha256"]: manifest.document for manifest in store.manifests()}
    documents = [known[source.sha256] for source in inventory.sources if source.sha256 in known]
    windows = [window for document in documents for window in document["windows"]]
    told = (Finding.from_dict(plain) for document in documents for plain in document["findings"])
    return IngestReport(
        ingested=len(todo) - (failed - inventory.unreadable),
        skipped=len(inventory.sources) - len(todo),
        failed=failed,
        windows=len(windows),
        rejected=sum(not window["accepted"] for window in windows),
        findings=(*inventory.findings, *told),
        sha256=frozenset(source.sha256 for source in inventory.sources),
        campaigns=tuple(sorted({document["run"]["campaign"] for document in documents if "run" in document})),
    )


def supersede(store: Store, sources: tuple[Source, ...]) -> None:
    """Remove what the store holds of earlier contents of these very files.

    Other bytes at the same place that tell of the same run (campaign and start) are a corrected version; a failed
    file at the same place was mended. Were both kept, points would count twice. Another run that was written over
    an earlier one leaves that one in the store.
    """
    current = {source.sha256 for source in sources}
    manifests = store.manifests()
    runs = {m.document["place"]: _run_of(m) for m in manifests if m.document["sha256"] in current and m.ingested}
    for manifest in manifests:
        place = manifest.document["place"]
        if manifest.document["sha256"] not in current and place in runs and _run_of(manifest) in (None, runs[place]):
            store.remove(manifest.identifier)


def _run_of(manifest: Manifest) -> tuple[str, str] | None:
    """Campaign and start of an ingested source."""
    return (manifest.document["run"]["campaign"], manifest.document["run"]["started_at"]) if manifest.ingested else None


def _ingest_one(job: tuple[Source, Path]) -> bool:
    """Read, judge, condense and store one file; whether it could be used."""
    source, folder = job
    store = Store(folder)
    common: dict[str, Any] = {"file": source.name, "place": source.place, "sha256": source.sha256}
    try:
        recording = read_recording(source.path, source.name)
    except UnusableRecordingError as error:
        findings = [finding.to_dict() for finding in error.findings]
        store.write(source.identifier, common | {"status": "failed", "findings": findings, "windows": []}, None)
        return False
    common["size"] = recording.size
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
