"""pmg run: a campaign's whole way, from recordings to the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.compare import compare_chosen
from pmg.pipeline.commands.ingest import ingest_chosen
from pmg.pipeline.commands.outcome import Outcome
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.settings.chosen import Chosen


def run_all(chosen: Chosen, progress: Callable[[int, int, str], None] | None) -> Outcome:
    """Ingest, analyse and compare; with published grids, analyse and compare."""
    recordings, grids, campaign = chosen.path("recordings"), chosen.path("grids"), chosen.text("campaign")
    store, _, options = chosen.needed("store"), chosen.needed("report"), chosen.options()
    if (recordings is None) == (grids is None):
        came = "neither RECORDINGS nor --grids" if recordings is None else "both RECORDINGS and --grids"
        raise RecordingError("pmg run", came, "one of them", "Name a folder of recordings, or one of published grids.")
    parts: dict[str, Outcome] = {}
    if recordings is not None:
        parts["ingest"] = ingest_chosen(chosen, progress)
        ingested = parts["ingest"].data["campaigns"]
        campaign = campaign or (ingested[0] if len(ingested) == 1 else None)
    parts["analyse"] = run_analyse(store, options, grids=grids, campaign=campaign)
    parts["compare"] = compare_chosen(chosen)
    return Outcome(
        data={name: part.data for name, part in parts.items()},
        lines=tuple(line for part in parts.values() for line in part.lines),
        findings=tuple(dict.fromkeys(remark for part in parts.values() for remark in part.findings)),
        partial=any(part.partial for part in parts.values()),
        mismatch=parts["compare"].mismatch,
    )
