"""The stages of a campaign's way, one verb each: ingest, analyse, compare; what the command line calls."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.analyse import Analysis, analyse
from pmg.pipeline.campaign import read_campaign
from pmg.pipeline.chapters.page import build_report
from pmg.pipeline.compare import compare
from pmg.pipeline.diagnose.decide import Diagnosis, Verdict, diagnose, diagnosis_document
from pmg.pipeline.gridtable import read_published
from pmg.pipeline.ingest import ingest
from pmg.pipeline.options import AnalysisOptions
from pmg.pipeline.outputs import analysis_document, read_analysis, write_analysis
from pmg.pipeline.report.write import write_report
from pmg.pipeline.store import Store, write_aside
from pmg.sim.bench import load_bench
from pmg.sim.gearbox import Gearbox
from pmg.sim.solve import steady

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.sim.grid import Grid

SEED = 20260101
"""Seed of the synthetic campaigns behind a p-value; named in the report."""


@dataclass(frozen=True)
class Outcome:
    """What a stage did.

    Parameters
    ----------
    data : dict
        Results, as JSON.
    lines : tuple of str
        The same for people, a few lines.
    findings : tuple of dict
        Remarks: severity, where, message.
    partial : bool
        Something was left out that a new call, with better input, could add.
    mismatch : bool
        Simulation and recordings differ.
    """

    data: dict[str, Any]
    lines: tuple[str, ...]
    findings: tuple[dict[str, Any], ...] = ()
    partial: bool = False
    mismatch: bool = False
    parts: tuple[Outcome, ...] = field(default=(), repr=False)


def run_analyse(store: Path, options: AnalysisOptions | None, *, grids: Path | None, campaign: str | None) -> Outcome:
    """Condense the recordings of a store (or read published grids) and analyse them into the store.

    Parameters
    ----------
    store : Path
        Holds the ingested recordings; receives the analysis.
    options : AnalysisOptions, optional
        Choices; the defaults for recordings, the thesis's own for published grids.
    grids : Path, optional
        Folder with published grids to analyse instead of recordings.
    campaign : str, optional
        Which campaign, where the store holds several.
    """
    bench = load_bench()
    if grids is not None:
        grid, findings = read_published(grids, bench), ()
        store.mkdir(parents=True, exist_ok=True)
    else:
        grid, findings = read_campaign(Store(store), campaign, bench)
    analysis = analyse(grid, options or (THESIS_OPTIONS if grids is not None else AnalysisOptions()), bench)
    folder = write_analysis(analysis, store)
    return Outcome(
        data={"analysis": analysis_document(analysis), "folder": str(folder)},
        lines=_analysis_lines(analysis, folder),
        findings=findings + _analysis_findings(analysis),
        partial=not analysis.complete,
    )


def run_compare(store: Path, report: Path) -> Outcome:
    """Simulate the analysed campaign, compare, diagnose, and write the report."""
    bench = load_bench()
    grid, options = read_analysis(store)
    analysis = analyse(grid, options, bench)
    residuals, diagnosis = None, None
    if analysis.calibration is not None and analysis.fits is not None and analysis.floor is not None:
        gearbox = Gearbox.calibrated(bench, analysis.calibration.model)
        simulated = steady(gearbox, analysis.grid.points, grid.campaign)
        residuals = compare(analysis.grid, simulated, bench, analysis.calibration)
        rng = np.random.default_rng(SEED)
        diagnosis = diagnose(analysis.grid, analysis.fits, analysis.floor, analysis.calibration, bench, rng)
    remarks = _stored_findings(store, grid)
    page = build_report(
        analysis,
        residuals,
        diagnosis,
        bench,
        findings=tuple((f["severity"], f["where"], f["message"]) for f in remarks),
        provenance=_provenance(store, analysis),
    )
    files = write_report(page, report)
    data: dict[str, Any] = {"report": str(files[0]), "files": [str(path) for path in files], "diagnosis": None}
    lines = [f"report: {files[0]}"]
    mismatch = False
    if diagnosis is not None:
        document = diagnosis_document(diagnosis)
        text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n"
        write_aside(report / "diagnosis.json", text.encode())
        data["diagnosis"], data["statement"] = document, diagnosis.statement
        lines.insert(0, f"{diagnosis.verdict}: {diagnosis.statement}")
        mismatch = diagnosis.verdict is not Verdict.CONSISTENT
    else:
        (report / "diagnosis.json").unlink(missing_ok=True)
    return Outcome(data, tuple(lines), remarks + _analysis_findings(analysis), not analysis.complete, mismatch)
