"""The stage behind pmg ingest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.grid.campaign import campaigns
from pmg.pipeline.grid.copies import COPY, without_copies
from pmg.pipeline.grid.crosschecks.catalogue import cross_check
from pmg.pipeline.grid.missing_points import missing_points
from pmg.pipeline.grid.window_facts import window_remarks
from pmg.pipeline.importers.supply import read_supply
from pmg.pipeline.recording.codes import Severity
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.recording.supplied import NOTHING
from pmg.pipeline.settings.bench_in_force import machine_remarks, settle_bench
from pmg.pipeline.store.sources import Shard, find_recordings, passed_over
from pmg.pipeline.store.store import Store
from pmg.pipeline.windows.limits_file import chosen_limits
from pmg.pipeline.wording.plurals import counted

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.grid.crosschecks.contradiction import CrossCheckRemark
    from pmg.pipeline.grid.missing_points import Unreached
    from pmg.pipeline.settings.chosen import Chosen
    from pmg.pipeline.store.manifest import Manifest
    from pmg.pipeline.windows.limits import Steadiness
    from pmg.sim.bench import BenchParameters


@dataclass(frozen=True)
class IngestOptions:
    """Choices of an ingest.

    Parameters
    ----------
    workers : int, optional
        Processes of this machine.
    scheduler : str, optional
        Address of a dask scheduler whose workers do the work instead.
    shard : str, optional
        The part of the recordings to take, as ``i/n``.
    limits : Path or Steadiness, optional
        Limits, or the file that holds them, by which windows are found and judged.
    chart : Path, optional
        File that states what recordings lack: run, calibration, channels under other names.
    checks : mapping, optional
        Actions of cross-checks other than the default ones, by name.
    machine : str, optional
        Machine file, or the name of one that ships; that of the store by default, or the thesis bench.
    """

    workers: int | None = None
    scheduler: str | None = None
    shard: str | None = None
    limits: Path | Steadiness | None = None
    chart: Path | None = None
    checks: Mapping[str, str] | None = None
    machine: str | None = None


ALONE = IngestOptions(workers=1)
"""One process, and defaults else."""


def run_ingest(
    recordings: Path,
    store: Path,
    options: IngestOptions = IngestOptions(),
    progress: Progress | None = None,
) -> Outcome:
    """Decode recordings into a store.

    Parameters
    ----------
    recordings : Path
        Folder of recordings, or one file.
    store : Path
        Receives samples and manifests.
    options : IngestOptions
        Choices.
    progress : callable, optional
        Told (done, total, name) after each file.
    """
    home = Store(store)
    if options.machine is not None:
        find_recordings(recordings)  # before a store is made
    bench = settle_bench(store, options.machine)
    report = ingest(
        recordings,
        home,
        workers=options.workers,
        scheduler=options.scheduler,
        shard=None if options.shard is None else Shard.of(options.shard),
        limits=chosen_limits(options.limits),
        supplied=NOTHING if options.chart is None else read_supply(options.chart),
        progress=progress,
    )
    manifests = [m for m in report.held if m.ingested]
    copies, missing_points = _copied_windows(manifests, report.sha256), _unreached(manifests, report.sha256)
    lines = [
        f"ingested {report.ingested}, already there {report.skipped}, not usable {report.failed}; "
        f"{counted(report.windows, 'window')}, {report.rejected} rejected"
    ]
    if report.moving:
        lines.append(f"{counted(report.moving, 'run')} in motion, {report.set_aside} set aside")
    if copies:
        lines.append(f"{counted(len(copies), 'window')} in two files: counted once")
    contradictions = _contradictions(manifests, report.sha256, bench, options.checks)
    lost = any(remark.severity == Severity.ERROR for remark in contradictions)
    if contradictions:
        lines.append(f"{counted(len(contradictions), 'contradiction')} with what else is known: see the findings")
    if missing_points:
        lines.append(f"{counted(len(missing_points), 'point')} not reached by recordings that were cut short")
    data = {
        "store": str(store),
        "ingested": report.ingested,
        "skipped": report.skipped,
        "failed": report.failed,
        "windows": report.windows,
        "rejected": report.rejected,
        **({"moving": report.moving, "set_aside": report.set_aside} if report.moving else {}),
        "copies": len(copies),
        "not_reached": len(missing_points),
        "contradictions": len(contradictions),
        "campaigns": list(report.campaigns),
    }
    machine = machine_remarks(store)
    lines += [f"machine: {remark.message}" for remark in machine if remark.severity == Severity.INFO]
    findings = machine + (passed_over(recordings) if options.shard is None else ()) + report.findings
    judged = _told_windows(manifests, report.sha256)
    missing = any(not point.instead for point in missing_points)
    return Outcome(
        data,
        tuple(lines),
        findings + contradictions + judged + copies + tuple(point.finding() for point in missing_points),
        partial=bool(report.failed or report.rejected or report.set_aside or missing or lost),
    )


def ingest_chosen(chosen: Chosen, progress: Progress | None, shard: str | None = None) -> Outcome:
    """Decode the recordings that file and options name into the store that they name."""
    options = IngestOptions(
        chosen.workers,
        chosen.text("scheduler"),
        shard,
        chosen.limits,
        chosen.path("map"),
        chosen.options().checks,
        chosen.text("machine"),
    )
    return run_ingest(chosen.needed("recordings"), chosen.needed("store"), options, progress)


def _told_windows(manifests: list[Manifest], sources: frozenset[str]) -> tuple[Remark, ...]:
    """Windows of these sources that failed a check, and remarks on those that did not, as findings."""
    return tuple(
        Remark(
            "info" if window.accepted else "warning",
            f"{manifest.file}: {window.point}",
            ("accepted; " if window.accepted else "rejected: ") + "; ".join(words),
        )
        for manifest in manifests
        for window in manifest.windows
        if manifest.sha256 in sources and (words := window_remarks(window))
    )


def _of_campaigns(manifests: list[Manifest]) -> list[list[Manifest]]:
    """Sources of each campaign."""
    return [[m for m in manifests if m.campaign == name] for name in campaigns(manifests)]


def _copied_windows(manifests: list[Manifest], sources: frozenset[str]) -> tuple[Remark, ...]:
    """Windows in two files of their campaign, one of them of these sources at least, as findings.

    The other may have come in before, as of another shard, which could not tell of this one.
    """
    files = _files(manifests, sources)
    return tuple(
        Remark("warning", f"{manifest.file}: {window.point}", f"{reason}; it counts once, as there")
        for campaign in _of_campaigns(manifests)
        for manifest in without_copies(campaign)
        for window in manifest.windows
        for reason in window.reasons[-1:]
        if reason.startswith(COPY) and files & {manifest.file, reason.removeprefix(COPY).strip()}
    )


def _contradictions(
    manifests: list[Manifest],
    sources: frozenset[str],
    bench: BenchParameters,
    actions: Mapping[str, str] | None,
) -> tuple[CrossCheckRemark, ...]:
    """Findings of the cross-checks of the campaigns that these sources are of."""
    asked = {manifest.campaign for manifest in manifests if manifest.sha256 in sources}
    found: list[CrossCheckRemark] = []
    for campaign in _of_campaigns(manifests):
        if campaign[0].campaign in asked:
            found += cross_check(without_copies(campaign), bench, actions).findings
    return tuple(found)


def _unreached(manifests: list[Manifest], sources: frozenset[str]) -> tuple[Unreached, ...]:
    """Points that these sources lost with their steps, or that they show another one to have lost."""
    files = _files(manifests, sources)
    return tuple(
        point
        for campaign in _of_campaigns(manifests)
        for point in missing_points(campaign)
        if files & {point.file, point.like}
    )


def _files(manifests: list[Manifest], sources: frozenset[str]) -> set[str]:
    return {manifest.file for manifest in manifests if manifest.sha256 in sources}
