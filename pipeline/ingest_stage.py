"""The stage behind pmg ingest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pmg.pipeline.ingest import ingest
from pmg.pipeline.inventory import Shard
from pmg.pipeline.limits import chosen_limits
from pmg.pipeline.outcome import Outcome, told
from pmg.pipeline.store import Store
from pmg.pipeline.wording import counted

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.pipeline.limits import Steadiness


def run_ingest(
    recordings: Path,
    store: Path,
    *,
    workers: int | None,
    progress: Callable[[int, int, str], None] | None,
    scheduler: str | None = None,
    shard: str | None = None,
    limits: Path | Steadiness | None = None,
) -> Outcome:
    """Decode recordings into a store.

    Parameters
    ----------
    recordings : Path
        Folder of recordings, or one file.
    store : Path
        Receives samples and manifests.
    workers : int, optional
        Processes of this machine.
    progress : callable, optional
        Told (done, total, name) after each file.
    scheduler : str, optional
        Address of a dask scheduler whose workers do the work instead.
    shard : str, optional
        The part of the recordings to take, as ``i/n``.
    limits : Path or Steadiness, optional
        Limits, or the file that holds them, by which windows are found and judged.
    """
    report = ingest(
        recordings,
        Store(store),
        workers=workers,
        scheduler=scheduler,
        shard=None if shard is None else Shard.of(shard),
        limits=chosen_limits(limits),
        progress=progress,
    )
    lines = [
        f"ingested {report.ingested}, already there {report.skipped}, not usable {report.failed}; "
        f"{counted(report.windows, 'window')}, {report.rejected} rejected"
    ]
    data = {
        "store": str(store),
        "ingested": report.ingested,
        "skipped": report.skipped,
        "failed": report.failed,
        "windows": report.windows,
        "rejected": report.rejected,
        "campaigns": list(report.campaigns),
    }
    findings = tuple(finding.to_dict() for finding in report.findings)
    rejected = _rejected_windows(Store(store), report.sha256)
    return Outcome(data, tuple(lines), findings + rejected, partial=bool(report.failed or report.rejected))


def _rejected_windows(store: Store, sources: frozenset[str]) -> tuple[dict[str, Any], ...]:
    """Windows of these sources that failed a check, as findings."""
    return tuple(
        told("warning", f"{manifest.document['file']}: {window['point']}", f"rejected: {'; '.join(window['reasons'])}")
        for manifest in store.manifests()
        for window in manifest.document["windows"]
        if manifest.document["sha256"] in sources and not window["accepted"]
    )
