"""From recordings to the store: decode each file, find and judge its windows, condense them, keep the findings."""

from __future__ import annotations

import os
import traceback
from collections import Counter
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

from pmg.pipeline.files.parallel import map_over
from pmg.pipeline.motion.judge import judge_motion
from pmg.pipeline.orders.stored_lines import order_files
from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.findings import Finding, UnusableRecordingError
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.recording.run import RECORD
from pmg.pipeline.recording.run_records import RunRecord
from pmg.pipeline.recording.supplied import NOTHING
from pmg.pipeline.settings.bench_in_force import bench_of_store
from pmg.pipeline.store.manifest import FAILED, INGESTED, Manifest, StoredWindow
from pmg.pipeline.store.sources import take_inventory
from pmg.pipeline.store.store import Store
from pmg.pipeline.store.supersede import supersede
from pmg.pipeline.windows.limits import LIMITS
from pmg.pipeline.windows.reduce import REDUCTION, reduce_window
from pmg.pipeline.windows.windows import find_windows
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Iterator, Sequence
    from pathlib import Path

    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.recording.read import Recording
    from pmg.pipeline.recording.supplied import Supplied
    from pmg.pipeline.store.sources import Selection, StoredSource
    from pmg.pipeline.windows.limits import Steadiness
    from pmg.pipeline.windows.window import Window
    from pmg.sim.bench import BenchParameters

WORTH_A_PROCESS, WORTH_OF_A_FILE = 24 * 2**20, 2**17
"""Bytes of recordings from which a second process pays for its start, and that take as long as a file of any size."""

DONE, THERE = "done", "there"
"""Outcomes for a file: ingested, or ingested meanwhile by another process; `FAILED`: not usable."""


@dataclass(frozen=True)
class _Job:
    """One file, the folder of the store, by full paths, as a worker may stand elsewhere; machine, limits, supply."""

    source: StoredSource
    store: Path
    bench: BenchParameters
    limits: Steadiness = LIMITS
    supplied: Supplied = NOTHING


@dataclass(frozen=True)
class IngestReport:
    """Result of an ingest.

    Parameters
    ----------
    ingested, skipped, failed : int
        Files decoded now, already in the store, and not usable.
    windows, rejected : int
        Windows of all usable files, and those that failed a check.
    moving, set_aside : int
        Runs in motion of all usable files, and those that are no evidence.
    findings : tuple of Finding
        Of the files of this call, whether decoded now or earlier.
    sha256 : frozenset of str
        Content of those files.
    campaigns : tuple of str
        Campaigns that they belong to.
    held : tuple of Manifest
        All that the store holds after it.
    """

    ingested: int
    skipped: int
    failed: int
    windows: int
    rejected: int
    moving: int
    set_aside: int
    findings: tuple[Finding, ...]
    sha256: frozenset[str]
    campaigns: tuple[str, ...]
    held: tuple[Manifest, ...]


def ingest(
    place: Path,
    store: Store,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    shard: Selection | None = None,
    limits: Steadiness = LIMITS,
    supplied: Supplied = NOTHING,
    progress: Progress | None = None,
) -> IngestReport:
    """Decode recordings into the store; what is there already, with the same bytes and limits, is not done again.

    Parameters
    ----------
    place : Path
        Folder of recordings, or one file.
    store : Store
        Receives samples and manifests.
    workers : int, optional
        Processes; by default as many as there are cores once the recordings are large.
    scheduler : str, optional
        Address of a dask scheduler whose workers do the work instead.
    shard : Selection, optional
        The part of the recordings that this call takes; several calls may fill one store at the same time.
    limits : Steadiness
        By which windows are found and judged.
    supplied : Supplied
        What is stated next to the recordings, used where they lack it.
    progress : callable, optional
        Told (done, total, name) after each file.

    Raises
    ------
    RecordingError
        There are no recordings.
    StoreError
        A worker ended, or wrote where this process cannot see it.
    """
    inventory = take_inventory(place, shard)
    store.prepare()
    store.sweep()
    there = {m.sha256 for m in store.manifests(whole=False) if _done(m, limits, supplied)}
    todo = [source for source in inventory.sources if source.sha256 not in there]
    if workers is None:
        large = sum(source.path.stat().st_size + WORTH_OF_A_FILE for source in todo) >= WORTH_A_PROCESS
        workers = (os.cpu_count() or 1) if large else 1
    done = len(inventory.sources) - len(todo)
    counts = Counter[str]()
    whole = store.path.absolute(), bench_of_store(store.path), limits, supplied
    jobs = [_Job(replace(source, path=source.path.absolute()), *whole) for source in todo]
    for job, did in map_over(_ingest_one, jobs, workers, scheduler):
        done += 1
        counts[did] += 1
        if progress is not None:
            progress(done, len(inventory.sources), job.source.name)
    store.sweep()
    held = supersede(store, inventory.sources)
    known = {manifest.sha256: manifest for manifest in held}
    if scheduler is not None and any(source.sha256 not in known for source in todo):
        raise _unseen(store.path)
    manifests = [known[source.sha256] for source in inventory.sources if source.sha256 in known]
    windows = [window for manifest in manifests for window in manifest.windows]
    moving = [record for manifest in manifests for record in manifest.moving]
    sha256 = frozenset(source.sha256 for source in inventory.sources)
    found = (finding for manifest in manifests for finding in manifest.findings)
    return IngestReport(
        ingested=counts[DONE],
        skipped=len(inventory.sources) - len(todo) + counts[THERE],
        failed=counts[FAILED] + inventory.unreadable,
        windows=len(windows),
        rejected=sum(not window.accepted for window in windows),
        moving=len(moving),
        set_aside=sum(not record.sound for record in moving),
        findings=(*inventory.findings, *found, *_shared_start(known.values(), sha256)),
        sha256=sha256,
        campaigns=tuple(sorted({manifest.campaign for manifest in manifests if manifest.ingested})),
        held=tuple(held),
    )


def _ingest_one(job: _Job) -> str:
    """Read, judge, condense and store one file; what became of it."""
    source, store = job.source, Store(job.store)
    if not store.made:
        raise _unseen(job.store)
    earlier = store.manifest(source.identifier)
    if earlier is not None and _done(earlier, job.limits, job.supplied):
        return THERE
    run = RunRecord()
    try:
        recording = read_recording(source.path, source.name, job.supplied, coils=True, bench=job.bench)
        if recording.sha256 != source.sha256:
            raise UnusableRecordingError((_changed(source),))
        run = _run_record(recording)
        windows = find_windows(recording, job.limits)
        manifest = _manifest(source, recording, windows, job)
        orders = order_files(source.identifier, recording, windows, job.bench)
    except UnusableRecordingError as error:
        return _failed(source, store, error.findings, RunRecord(**error.run))
    except (OSError, StoreError):  # of the store: the next recording would meet it too
        raise
    except Exception as error:  # a defect of pmg that one recording brings out must not cost the others
        log = store.write_log(source.identifier, traceback.format_exc())
        return _failed(source, store, (_unexpected(source, error, log),), run)
    store.write(manifest, recording.samples, orders)
    return DONE


def _run_record(recording: Recording) -> RunRecord:
    """The run of a recording, for its manifest."""
    run = recording.run
    lines = run.campaign, run.point, str(run.configuration), run.gear, run.drive, run.started_at.isoformat(), run.note
    return RunRecord(*lines, manoeuvre=run.manoeuvre if run.manoeuvre.moves else None)


def _failed(source: StoredSource, store: Store, findings: tuple[Finding, ...], run: RunRecord) -> str:
    store.write(Manifest(source.identifier, source.name, source.place, source.sha256, FAILED, run, findings), None)
    return FAILED


def _done(manifest: Manifest, limits: Steadiness, supplied: Supplied) -> bool:
    """Whether a source is in the store as it would come in now.

    One that names no limits was judged by the defaults. One that was reduced in an earlier way is read anew, one
    without a hash of itself, and one whose manoeuvre was not understood yet.
    What was supplied stays where nothing is supplied now; where something else is, or where a map may name channels
    that were not offered before, the source is read anew.
    """
    judged_by = LIMITS.document() if manifest.limits is None else manifest.limits
    if not (manifest.ingested and manifest.proven and manifest.reduction == REDUCTION):
        return False
    if judged_by != limits.document() or any(f.where == f"{RECORD}.manoeuvre" for f in manifest.findings):
        return False
    if supplied == NOTHING:
        return True
    if manifest.supplied is None:
        return not supplied.fields or manifest.offered == supplied.hashes()
    return manifest.supplied.hashes == supplied.hashes()


def _shared_start(manifests: Iterable[Manifest], asked: Container[str]) -> Iterator[Finding]:
    """Recordings beyond the first that took one and the same run from a map; of pairs with one of those to tell of."""
    first: dict[tuple[str, str], Manifest] = {}
    for manifest in manifests:
        if manifest.supplied is None or "run" not in manifest.supplied.parts:
            continue
        other = first.setdefault((manifest.campaign, manifest.started_at), manifest)
        if other is not manifest and (manifest.sha256 in asked or other.sha256 in asked):
            came = f"the supplied start {manifest.started_at} is that of {other.file} too; expected one of its own"
            advice = "The order of the runs is lost, and they may count as copies: ingest each with a map of its own."
            yield Finding(Severity.WARNING, "started_at", came, manifest.file, Code.RUN_VALUE, advice)


def _unseen(folder: Path) -> StoreError:
    came, expected = "workers and this process do not see the same store there", "one folder that all of them share"
    return StoreError(str(folder), came, expected, "Put store and recordings where all find them by this path.")


def _unexpected(source: StoredSource, error: Exception, log: str) -> Finding:
    came = f"{type(error).__name__}: {error!s:.120}"
    message = f"reading it failed unforeseen ({came}); expected a recording, or its findings"
    advice = f"This is a defect of pmg: please report it with {log} in the store. The other recordings are not touched."
    return Finding(Severity.ERROR, "whole file", message, source.name, Code.UNEXPECTED, advice)


def _changed(source: StoredSource) -> Finding:
    message = "its bytes changed between listing and reading; expected a file that is at rest"
    advice = "Wait until the recorder has closed it, then ingest again."
    return Finding(Severity.ERROR, "whole file", message, source.name, Code.UNREADABLE, advice)


def _manifest(source: StoredSource, recording: Recording, windows: Sequence[Window], job: _Job) -> Manifest:
    """The manifest of a usable recording."""
    supplied, origin = recording.supplied, recording.origin
    moving, findings = judge_motion(recording, job.bench)
    return Manifest(
        source.identifier,
        source.name,
        source.place,
        source.sha256,
        INGESTED,
        _run_record(recording),
        recording.findings + findings,
        tuple(_window(recording, window) for window in windows),
        recording.calibration,
        recording.rate_hz,
        recording.first_sample,
        recording.samples.height,
        recording.size,
        None if origin is None else origin.record,
        supplied=supplied,
        offered=job.supplied.hashes() if supplied is None and job.supplied.fields else None,
        lacking=recording.lacking,
        reduction=REDUCTION,
        limits=job.limits.document(),
        moving=moving,
        temperatures=recording.auxiliary.temperatures,
    )


def _window(recording: Recording, window: Window) -> StoredWindow:
    """A window with its means."""
    judged = {each.name: getattr(window, each.name) for each in fields(window) if each.name != "started_at"}
    means = reduce_window(recording.samples, window, recording.rate_hz)
    return StoredWindow(**judged, started_at_s=window.started_at.timestamp(), means=means)
