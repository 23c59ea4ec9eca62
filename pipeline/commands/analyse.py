"""pmg analyse: recordings condensed into grids, and grids analysed into the store."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.analysis.outputs import analysed_campaign, analysis_document, analysis_files, write_analysis
from pmg.pipeline.commands.campaign_asked import campaign_in_motion
from pmg.pipeline.commands.in_motion.motion import analyse_motion
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate, now
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.budget import budget_of
from pmg.pipeline.fit.budget_remarks import budget_remarks
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.campaign import failed_sources, measured_grid
from pmg.pipeline.grid.completeness import lack_findings, stored_earlier
from pmg.pipeline.grid.crosschecks.checked import checked_campaign
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.grid.transducer_remarks import transducer_remarks
from pmg.pipeline.grid.window_facts import rated, window_facts
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.settings.bench_in_force import bench_in_force, machine_remarks, settle_bench
from pmg.pipeline.store.store import Store

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from pmg.pipeline.commands.provenance import Clock
    from pmg.pipeline.grid.window_facts import WindowFacts
    from pmg.pipeline.store.manifest import Manifest
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid


def run_analyse(
    store: Path,
    options: AnalysisOptions,
    *,
    grids: Path | None,
    campaign: str | None,
    machine: str | None = None,
    clock: Clock = now,
) -> Outcome:
    """Condense the recordings of a store (or read published grids) and analyse them into the store.

    Parameters
    ----------
    store : Path
        Holds the ingested recordings; receives the analysis.
    options : AnalysisOptions
        Choices.
    grids : Path, optional
        Folder with published grids to analyse instead of recordings.
    campaign : str, optional
        Which campaign, where the store holds several.
    machine : str, optional
        Machine file, or the name of one that ships; that of the store by default, or the thesis bench.
    clock : callable
        Time of day, for the provenance.
    """
    began = clock()
    bench = bench_in_force(store, machine) if grids is None else settle_bench(store, machine)
    moving = campaign_in_motion(store, campaign) if grids is None else None
    if moving is not None:
        return analyse_motion(store, moving)
    gathered = gather(store, grids, campaign, bench, options.checks)
    grid, bench, failed = gathered.grid, gathered.bench, gathered.failed
    if grids is not None:
        Store(store).prepare()
    analysis = analyse(grid, options, bench)
    budget = budget_of(analysis.grid, analysis.floor, bench, gathered.facts)
    before = analysed_campaign(store)
    folder = write_analysis(analysis, store, bench, budget)
    leave_crate(folder, store, grid, "pmg analyse", began, clock, results=analysis_files(folder))
    return Outcome(
        data={"analysis": analysis_document(analysis, budget), "folder": str(folder)},
        lines=_analysis_lines(analysis, folder, len(failed)),
        findings=_replaced(folder, before, grid.campaign)
        + analysis_findings(analysis, failed, gathered.used)
        + gathered.remarks
        + machine_remarks(store)
        + tuple(budget_remarks(budget)),
        partial=bool(failed) or not analysis.complete,
    )


@dataclass(frozen=True)
class GatheredCampaign:
    """The grid of a campaign before it is analysed.

    Parameters
    ----------
    grid : Grid
        Of recordings, or as it was published.
    bench : BenchParameters
        With the nominal torques that the recordings state.
    facts : WindowFacts or None
        Of the windows; None for published grids.
    used, failed : tuple of Manifest
        Sources of the campaign, and those of the store that are not usable.
    remarks : tuple of Remark
        Findings of the cross-checks and of the transducers.
    """

    grid: Grid
    bench: BenchParameters
    facts: WindowFacts | None = None
    used: tuple[Manifest, ...] = ()
    failed: tuple[Manifest, ...] = ()
    remarks: tuple[Remark, ...] = ()


def gather(
    store: Path,
    grids: Path | None,
    campaign: str | None,
    bench: BenchParameters,
    actions: Mapping[str, str] | None = None,
) -> GatheredCampaign:
    """The windows of a store, or published grids, as one grid.

    Parameters
    ----------
    store : Path
        Holds the ingested recordings.
    grids : Path, optional
        Folder with published grids to take instead.
    campaign : str, optional
        Which campaign, where the store holds several.
    bench : BenchParameters
        The machine.
    actions : mapping, optional
        What is done where recordings contradict something, by name of the cross-check; the default else.
    """
    if grids is not None:
        return GatheredCampaign(read_published(grids, bench), bench)
    name, checked = checked_campaign(Store(store), campaign, bench, actions)
    facts = window_facts(checked.manifests)
    return GatheredCampaign(
        measured_grid(name, list(checked.manifests), bench),
        rated(bench, facts),
        facts,
        checked.manifests,
        failed_sources(store),
        (*checked.findings, *transducer_remarks(facts, bench)),
    )


def _replaced(folder: Path, before: str | None, campaign: str) -> tuple[Remark, ...]:
    """A warning where the analysis of another campaign stood in this folder."""
    if before is None or before == campaign:
        return ()
    message = f"replaces the analysis of {before}; a store holds one analysis: give each campaign a store to keep both"
    return (Remark("warning", str(folder), message),)


def _analysis_lines(analysis: Analysis, folder: Path, failed: int) -> tuple[str, ...]:
    grid = analysis.grid
    left = f"; {failed} of the store's sources not usable" if failed else ""
    lines = [f"campaign {grid.campaign}: {int(grid.accepted.sum())} of {len(grid)} points accepted{left}"]
    if analysis.fits is not None:
        sun, ring = analysis.fits.sun, analysis.fits.ring
        lines.append(f"loss curves: scatter {sun.rmse * 1e3:.2f} mN m (sun), {ring.rmse * 1e3:.2f} mN m (ring)")
    if analysis.calibration is not None:
        shown = []
        for name in ("K_corr", "b", "c", "d"):
            error = analysis.calibration.standard_error(name)
            state = "on its bound" if name in analysis.calibration.on_bound else "held"
            shown.append(
                f"{name} = {analysis.calibration.value(name):.4g} ({state if error is None else f'u {error:.2g}'})"
            )
        lines.append("calibration: " + ", ".join(shown))
    lines.append(f"grids, losses, fits: {folder}")
    return tuple(lines)


def analysis_findings(analysis: Analysis, failed: Sequence[Manifest], used: Sequence[Manifest]) -> tuple[Remark, ...]:
    """Holes, files, points and windows that are missing, steps that could not be made, efficiencies above 1."""
    found = [*lack_findings(analysis.grid, analysis.lacking, failed, used), *stored_earlier(used)]
    found += [Remark("warning", error.where, error.advice) for error in analysis.missing]
    if analysis.balance is not None:
        above = analysis.balance.above_one()
        names = analysis.balance.grid.points.name[above]
        if len(names):
            message = (
                f"magnetic efficiency above 1 at {len(names)} points, at {int(analysis.balance.implausible().sum())} "
                f"by more than U: {', '.join(map(str, names[:5]))}{' ...' if len(names) > 5 else ''}"
            )
            found.append(Remark("warning", "efficiency", message))
    return tuple(found)
