"""pmg compare: the simulator beside the bench, the diagnosis, and the report of both."""

from __future__ import annotations

import hashlib
import json
import shlex
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.analysis.outputs import read_analysis
from pmg.pipeline.analysis.tolerance import Tolerance
from pmg.pipeline.chapters.measured.sensor_fault import misread_warning
from pmg.pipeline.chapters.page import build_report
from pmg.pipeline.commands.compare_and_diagnose import compare_and_diagnose, leave_model, summary_facts
from pmg.pipeline.commands.orders import orders_chapter
from pmg.pipeline.commands.provenance import leave_crate, now
from pmg.pipeline.diagnose.grid.document import diagnosis_document
from pmg.pipeline.diagnose.grid.statement import statement
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.budget import budget_of
from pmg.pipeline.grid.campaign import choose_campaign
from pmg.pipeline.grid.conditions import conditions
from pmg.pipeline.grid.missing_points import unreached_findings
from pmg.pipeline.grid.transducer_remarks import transducer_remarks
from pmg.pipeline.grid.window_facts import SIMULATED, rated, window_facts
from pmg.pipeline.model.apply_model import lead, remark
from pmg.pipeline.model.model_file import FILE as MODEL
from pmg.pipeline.model.read_model import read_model
from pmg.pipeline.model.sensor_fault_correction import correct_sensor_fault
from pmg.pipeline.point_signals.campaign import campaign_signals
from pmg.pipeline.point_signals.encoded import encode
from pmg.pipeline.report.write import write_report
from pmg.pipeline.store.store import Store
from pmg.pipeline.wording.outcome import Outcome, told
from pmg.sim.bench import load_bench

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.commands.provenance import Clock
    from pmg.pipeline.grid.window_facts import WindowFacts
    from pmg.pipeline.store.store import Manifest
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
from pmg.pipeline.commands.analyse import analysis_findings, failed_sources

SEED = 20260101
"""Seed of the synthetic campaigns behind a p-value; named in the report."""


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
    judged = compare_and_diagnose(analysis, options, bench, np.random.default_rng(SEED), given)
    diagnosis = None if judged is None else judged.diagnosis
    if model is not None:
        inputs += ((f"SHA-256 of {model.name}", hashlib.sha256(model.read_bytes()).hexdigest()),)
    budget = budget_of(analysis.grid, analysis.floor, bench, facts)
    behind = None if grid.origin == "published" else campaign_signals(Store(store), analysis.grid, budget)
    remarks += () if behind is None else behind.findings
    parts = () if judged is None or judged.carried is None else judged.carried.here.parts
    faults = correct_sensor_fault(diagnosis, analysis, bench, parts)
    page = build_report(
        analysis,
        None if judged is None else judged.residuals,
        diagnosis,
        bench,
        note=note,
        findings=remarks + tuple(unreached_findings(used)),
        provenance=(
            *inputs,
            ("Seed of the synthetic campaigns", str(SEED)),
            ("Command", command_told(note, model)),
        ),
        carried=None if judged is None else judged.carried,
        ends=() if judged is None else judged.ends,
        orders=None if grid.origin == "published" else orders_chapter(Store(store), grid.campaign, bench),
        budget=budget,
        origins=_origins(used),
        told=conditions(used),
        tolerances={name: Tolerance(*parts) for name, parts in (tolerances or {}).items()},
        signals=None if behind is None else encode(behind.cells),
        faults=faults,
    )
    text = ""
    if diagnosis is not None:
        text = json.dumps(diagnosis_document(diagnosis), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
    files = write_report(page, report, summary_facts(grid, judged, bench, tolerances))
    data: dict[str, Any] = {"report": str(files[0]), "files": [str(path) for path in files], "diagnosis": None}
    if faults and analysis.balance is not None:
        remarks += (told("warning", "losses", misread_warning(faults, analysis.balance)),)
    lines = [f"report: {files[0]}"]
    mismatch = False
    if diagnosis is not None:
        write_atomic(report / "diagnosis.json", text.encode())
        before = "" if judged is None or judged.carried is None else lead(judged.carried)
        said = before + statement(diagnosis)
        data["diagnosis"], data["statement"] = json.loads(text), said
        lines.insert(0, f"{diagnosis.verdict}: {said}")
        mismatch = diagnosis.mismatch.found
    else:
        (report / "diagnosis.json").unlink(missing_ok=True)
    if judged is not None:
        data |= leave_model(judged, report / MODEL, model)
        lines += [] if judged.carried is None else [remark(judged.carried)]
    made = (("diagnosis.json", diagnosis is not None), (MODEL, bool(data.get("model"))))
    written = (*files, *(report / name for name, there in made if there))
    leave_crate(report, store, grid, "pmg compare", began, clock, () if model is None else (model,), written)
    found = remarks + analysis_findings(analysis, failed, used)
    return Outcome(data, tuple(lines), found, bool(failed) or not analysis.complete, mismatch)


def command_told(note: str, model: Path | None) -> str:
    """The stage's command with what changes the page; folders are the reader's own."""
    options = (("--model", "" if model is None else model.name), ("--note", note))
    told = " ".join(f"{option} {shlex.quote(value)}" for option, value in options if value)
    return f"pmg compare --store STORE --report REPORT {told}".strip()


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
    failed = failed_sources(store)
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


def _origins(used: tuple[Manifest, ...]) -> tuple[tuple[str, dict[str, Any]], ...]:
    """Recordings that were imported, and what from."""
    return tuple((m.document["file"], m.document["origin"]) for m in used if "origin" in m.document)
