"""The stages of a campaign's way, one verb each: ingest, analyse, compare; what the command line calls."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.analyse import Analysis, analyse
from pmg.pipeline.aside import write_aside
from pmg.pipeline.budget.point import budget_of
from pmg.pipeline.budget.remarks import budget_remarks, transducer_remarks
from pmg.pipeline.budget.windowfacts import SIMULATED, rated, window_facts
from pmg.pipeline.campaign import choose_campaign, measured_grid
from pmg.pipeline.carry import lead, remark
from pmg.pipeline.chapters.page import build_report
from pmg.pipeline.completeness import lack_findings
from pmg.pipeline.conditions import conditions
from pmg.pipeline.diagnose.document import diagnosis_document
from pmg.pipeline.diagnose.statement import statement
from pmg.pipeline.drill.campaign import campaign_signals
from pmg.pipeline.drill.encoded import encode
from pmg.pipeline.gridtable import read_published
from pmg.pipeline.ingest_stage import run_ingest
from pmg.pipeline.judged import judge, leave_model
from pmg.pipeline.modelfile import FILE as MODEL
from pmg.pipeline.modelfile_read import read_model
from pmg.pipeline.options import AnalysisOptions
from pmg.pipeline.orders.stage import orders_chapter
from pmg.pipeline.outcome import Outcome, told
from pmg.pipeline.outputs import analysis_document, read_analysis, write_analysis
from pmg.pipeline.provenance import leave_crate, now
from pmg.pipeline.report.write import write_report
from pmg.pipeline.store import Store
from pmg.pipeline.tolerance import Tolerance
from pmg.pipeline.unreached import unreached_findings
from pmg.sim.bench import load_bench
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from pmg.pipeline.budget.windowfacts import WindowFacts
    from pmg.pipeline.conditions import Conditions
    from pmg.pipeline.limits import Steadiness
    from pmg.pipeline.provenance import Clock
    from pmg.pipeline.store import Manifest
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid

SEED = 20260101
"""Seed of the synthetic campaigns behind a p-value; named in the report."""


def run_analyse(
    store: Path, options: AnalysisOptions, *, grids: Path | None, campaign: str | None, clock: Clock = now
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
    clock : callable
        Time of day, for the provenance.
    """
    began = clock()
    bench, facts = load_bench(), None
    failed: tuple[Manifest, ...] = ()
    manifests: list[Manifest] = []
    remarks: tuple[dict[str, Any], ...] = ()
    if grids is not None:
        grid = read_published(grids, bench)
        Store(store).prepare()
    else:
        name, manifests = choose_campaign(Store(store), campaign)
        grid, facts, failed = measured_grid(name, manifests, bench), window_facts(manifests), _failed(store)
        bench, remarks = rated(bench, facts), tuple(transducer_remarks(facts, bench))
    analysis = analyse(grid, options, bench)
    budget = budget_of(analysis.grid, analysis.floor, bench, facts)
    folder = write_analysis(analysis, store, budget)
    leave_crate(folder, store, grid, "pmg analyse", began, clock)
    return Outcome(
        data={"analysis": analysis_document(analysis, budget), "folder": str(folder)},
        lines=_analysis_lines(analysis, folder, len(failed)),
        findings=_analysis_findings(analysis, failed, manifests) + remarks + tuple(budget_remarks(budget)),
        partial=bool(failed) or not analysis.complete,
    )


def _failed(store: Path) -> tuple[Manifest, ...]:
    """Sources of a store that are not usable; of which campaign they are is not known."""
    return tuple(manifest for manifest in Store(store).manifests() if not manifest.ingested)


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


def _analysis_findings(
    analysis: Analysis, failed: Sequence[Manifest], used: Sequence[Manifest]
) -> tuple[dict[str, Any], ...]:
    """Holes, files, points and windows that are missing, steps that could not be made, efficiencies above 1."""
    found = list(lack_findings(analysis.grid, analysis.lacking, failed, used))
    found += [
        told("warning", error.where, f"{error.came}; expected {error.expected}. {error.do}")
        for error in analysis.missing
    ]
    if analysis.balance is not None:
        above = analysis.balance.above_one()
        names = analysis.balance.grid.points.name[above]
        if len(names):
            message = (
                f"magnetic efficiency above 1 at {len(names)} points, at {int(analysis.balance.implausible().sum())} "
                f"by more than U: {', '.join(map(str, names[:5]))}{' ...' if len(names) > 5 else ''}"
            )
            found.append(told("warning", "efficiency", message))
    return tuple(found)


def run_compare(
    store: Path,
    report: Path,
    note: str = "",
    model: Path | None = None,
    *,
    tolerances: Mapping[str, tuple[float, float]] | None = None,
    clock: Clock = now,
) -> Outcome:
    """Simulate the analysed campaign, compare, diagnose, and write the report.

    Parameters
    ----------
    store : Path
        Holds the analysis.
    report : Path
        Folder of the report, diagnosis.json and model.toml.
    note : str
        Told at the head of the report.
    model : Path, optional
        A model file to simulate instead of the calibrated baseline.
    tolerances : mapping, optional
        Tolerances of the comparison that were set, by quantity: absolute [SI] and relative.
    clock : callable
        Time of day, for the provenance.
    """
    began = clock()
    bench = load_bench()
    given = None if model is None else read_model(model)
    grid, options = read_analysis(store)
    remarks, inputs, facts, failed, used = _sources(store, grid, bench)
    bench = rated(bench, facts)
    analysis = analyse(grid, options, bench)
    judged = judge(analysis, options, bench, np.random.default_rng(SEED), given)
    diagnosis = None if judged is None else judged.diagnosis
    if model is not None:
        inputs += ((f"SHA-256 of {model.name}", hashlib.sha256(model.read_bytes()).hexdigest()),)
    budget = budget_of(analysis.grid, analysis.floor, bench, facts)
    behind = None if grid.origin == "published" else campaign_signals(Store(store), analysis.grid, budget)
    remarks += () if behind is None else behind.findings
    page = build_report(
        analysis,
        None if judged is None else judged.residuals,
        diagnosis,
        bench,
        note=note,
        findings=remarks + tuple(unreached_findings(used)),
        provenance=(*inputs, ("Seed of the synthetic campaigns", str(SEED))),
        carried=None if judged is None else judged.carried,
        ends=() if judged is None else judged.ends,
        orders=None if grid.origin == "published" else orders_chapter(Store(store), grid.campaign, bench),
        budget=budget,
        origins=_origins(store, grid),
        told=_conditions(store, grid),
        tolerances={name: Tolerance(*parts) for name, parts in (tolerances or {}).items()},
        signals=None if behind is None else encode(behind.cells),
    )
    text = ""
    if diagnosis is not None:
        text = json.dumps(diagnosis_document(diagnosis), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
    points = {"accepted": int(grid.accepted.sum()), "rejected": int((~grid.accepted).sum())}
    files = write_report(page, report, {"points": points})
    data: dict[str, Any] = {"report": str(files[0]), "files": [str(path) for path in files], "diagnosis": None}
    lines = [f"report: {files[0]}"]
    mismatch = False
    if diagnosis is not None:
        write_aside(report / "diagnosis.json", text.encode())
        before = "" if judged is None or judged.carried is None else lead(judged.carried)
        told = before + statement(diagnosis)
        data["diagnosis"], data["statement"] = json.loads(text), told
        lines.insert(0, f"{diagnosis.verdict}: {told}")
        mismatch = diagnosis.mismatch.found
    else:
        (report / "diagnosis.json").unlink(missing_ok=True)
    if judged is not None:
        data |= leave_model(judged, report / MODEL, model)
        lines += [] if judged.carried is None else [remark(judged.carried)]
    leave_crate(report, store, grid, "pmg compare", began, clock, () if model is None else (model,))
    found = remarks + _analysis_findings(analysis, failed, used)
    return Outcome(data, tuple(lines), found, bool(failed) or not analysis.complete, mismatch)


def _sources(
    store: Path, grid: Grid, bench: BenchParameters
) -> tuple[
    tuple[dict[str, Any], ...],
    tuple[tuple[str, str], ...],
    WindowFacts | None,
    tuple[Manifest, ...],
    tuple[Manifest, ...],
]:
    """Findings of a campaign's sources, words on its inputs, facts of its windows, failed sources, its sources."""
    if grid.origin == "published":
        return (), (("Input", "published grids, torques rounded to 0.01 N m"),), None, (), ()
    _, manifests = choose_campaign(Store(store), grid.campaign)
    failed = _failed(store)
    remarks = tuple(plain for manifest in (*manifests, *failed) for plain in manifest.document["findings"])
    joined = "".join(sorted(manifest.document["sha256"] for manifest in manifests))
    digest = hashlib.sha256(joined.encode()).hexdigest()
    first = min(manifest.document["run"]["started_at"] for manifest in manifests)
    simulated = any(plain["code"] == SIMULATED for m in manifests for plain in m.document["findings"])
    inputs = [
        ("Input", f"{len(manifests)} recordings" + (", marked as simulated by their writer" if simulated else "")),
        ("First recording started", first),
        ("SHA-256 over the sorted SHA-256 of the recordings", digest),
    ]
    facts = window_facts(manifests)
    remarks += tuple(transducer_remarks(facts, bench))
    known = facts if len(facts.sun.dof) == len(grid) else None
    return remarks, tuple(inputs), known, failed, tuple(manifests)


def _origins(store: Path, grid: Grid) -> tuple[tuple[str, dict[str, Any]], ...]:
    """Recordings of a campaign that were imported, and what from."""
    if grid.origin == "published":
        return ()
    _, manifests = choose_campaign(Store(store), grid.campaign)
    return tuple((m.document["file"], m.document["origin"]) for m in manifests if "origin" in m.document)


def _conditions(store: Path, grid: Grid) -> Conditions:
    """Under which conditions the campaign was run, as far as its recordings tell."""
    if grid.origin == "published":
        return conditions(())
    _, manifests = choose_campaign(Store(store), grid.campaign)
    return conditions(manifests)


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
    tolerances: Mapping[str, tuple[float, float]] | None = None,
) -> Outcome:
    """Ingest, analyse and compare; with published grids, analyse and compare."""
    if (recordings is None) == (grids is None):
        came = "neither RECORDINGS nor --grids" if recordings is None else "both RECORDINGS and --grids"
        raise RecordingError("pmg run", came, "one of them", "Name a folder of recordings, or one of published grids.")
    parts: dict[str, Outcome] = {}
    if recordings is not None:
        parts["ingest"] = run_ingest(
            recordings, store, workers=workers, scheduler=scheduler, limits=limits, progress=progress
        )
        ingested = parts["ingest"].data["campaigns"]
        campaign = campaign or (ingested[0] if len(ingested) == 1 else None)
    parts["analyse"] = run_analyse(store, options, grids=grids, campaign=campaign)
    parts["compare"] = run_compare(store, report, note, model, tolerances=tolerances)
    findings = {json.dumps(finding, sort_keys=True): finding for part in parts.values() for finding in part.findings}
    return Outcome(
        data={name: part.data for name, part in parts.items()},
        lines=tuple(line for part in parts.values() for line in part.lines),
        findings=tuple(findings.values()),
        partial=any(part.partial for part in parts.values()),
        mismatch=parts["compare"].mismatch,
    )
