"""pmg run: a campaign's whole way, from recordings to the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.compare import run_compare
from pmg.pipeline.commands.ingest import run_ingest
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from pmg.pipeline.windows.limits import Steadiness


def run_all(
    recordings: Path | None,
    store: Path,
    report: Path,
    options: AnalysisOptions,
    *,
    grids: Path | None,
    campaign: str | None,
    note: str,
    workers: int | None,
    progress: Callable[[int, int, str], None] | None,
    model: Path | None = None,
    scheduler: str | None = None,
    limits: Path | Steadiness | None = None,
    chart: Path | None = None,
    tolerances: Mapping[str, tuple[float, float]] | None = None,
) -> Outcome:
    """Ingest, analyse and compare; with published grids, analyse and compare."""
    if (recordings is None) == (grids is None):
        came = "neither RECORDINGS nor --grids" if recordings is None else "both RECORDINGS and --grids"
        raise RecordingError("pmg run", came, "one of them", "Name a folder of recordings, or one of published grids.")
    parts: dict[str, Outcome] = {}
    if recordings is not None:
        parts["ingest"] = run_ingest(
            recordings,
            store,
            workers=workers,
            scheduler=scheduler,
            limits=limits,
            chart=chart,
            progress=progress,
        )
        ingested = parts["ingest"].data["campaigns"]
        campaign = campaign or (ingested[0] if len(ingested) == 1 else None)
    parts["analyse"] = run_analyse(store, options, grids=grids, campaign=campaign)
    parts["compare"] = run_compare(store, report, note, model, tolerances=tolerances)
    return Outcome(
        data={name: part.data for name, part in parts.items()},
        lines=tuple(line for part in parts.values() for line in part.lines),
        findings=tuple(dict.fromkeys(remark for part in parts.values() for remark in part.findings)),
        partial=any(part.partial for part in parts.values()),
        mismatch=parts["compare"].mismatch,
    )
