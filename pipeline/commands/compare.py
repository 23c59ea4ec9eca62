"""pmg compare and pmg run: the simulator compared with the bench, the diagnosis, the report; the whole way there."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.analysis.outputs import read_analysis, unproven_analysis
from pmg.pipeline.analysis.tolerance import Tolerance
from pmg.pipeline.chapters.measured.sensor_fault import highest_loss, sensor_fault_warning
from pmg.pipeline.chapters.page import RecordedFacts, build_report
from pmg.pipeline.commands.analyse import analysis_findings, run_analyse
from pmg.pipeline.commands.campaign_asked import asked_in_motion
from pmg.pipeline.commands.compare_and_diagnose import (
    DIAGNOSIS,
    SEED,
    compare_and_diagnose,
    leave_diagnosis,
    leave_model,
    summary_facts,
)
from pmg.pipeline.commands.config import check_choices
from pmg.pipeline.commands.in_motion.mixed import MixedDiagnosis, diagnose_mixed
from pmg.pipeline.commands.in_motion.motion import compare_motion, remove_motion_report
from pmg.pipeline.commands.ingest import ingest_chosen
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate, now
from pmg.pipeline.commands.stored_analysis import analysed, recorded_part
from pmg.pipeline.diagnosis.grid.document import diagnosis_document
from pmg.pipeline.diagnosis.grid.statement import phrase
from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.files.parallel import begin, keeping_workers
from pmg.pipeline.files.progress import Steps, named
from pmg.pipeline.grid.conditions import conditions
from pmg.pipeline.grid.missing_points import unreached_findings
from pmg.pipeline.model.apply_model import remark
from pmg.pipeline.model.model_file import FILE as MODEL
from pmg.pipeline.model.read_model import read_model
from pmg.pipeline.model.sensor_fault_correction import correct_sensor_fault
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.draw import draw_all
from pmg.pipeline.report.write import write_report
from pmg.pipeline.settings.bench_in_force import bench_in_force
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.commands.provenance import Clock
    from pmg.pipeline.commands.stored_analysis import RecordedPart, StoredAnalysis
    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.model.compared_campaign import ComparedCampaign
    from pmg.pipeline.report.document import Report
    from pmg.pipeline.settings.chosen import Chosen

COMPARED = "simulation and diagnosis", "report"
"""Steps of a comparison, as its progress names them."""


def run_compare(
    store: Path,
    report: Path,
    note: str = "",
    model: Path | None = None,
    *,
    tolerances: Mapping[str, tuple[float, float]] | None = None,
    clock: Clock = now,
    progress: Progress | None = None,
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
    progress : Progress, optional
        Receives each step as it begins.
    """
    began, steps = clock(), Steps(progress, *COMPARED)
    steps.begin(COMPARED[0])
    given = None if model is None else read_model(model)
    whole = analysed(store, *read_analysis(store), unproven_analysis(store))
    recorded = begin(recorded_part, whole)
    begin(draw_all, ())  # a worker loads the drawing library meanwhile
    rng, beside = np.random.default_rng(SEED), whole.beside_motion and given is None
    judged = compare_and_diagnose(whole.analysis, whole.options, whole.bench, rng, given, beside_motion=beside)
    hashed = () if model is None else ((f"SHA-256 of {model.name}", sha256_of(model)),)
    grid = whole.analysis.grid
    mixed, about_motion = diagnose_mixed(whole, report, judged, note, clock, progress)
    steps.begin(COMPARED[1])
    page, remarks = campaign_page(
        whole,
        judged,
        recorded(),
        note,
        tolerances,
        (*hashed, seeded(SEED), ("Command", _command_words(note, model))),
    )
    if mixed is None:
        remove_motion_report(report, grid.campaign)
    else:
        page = replace(page, verdict=mixed.headline(page.verdict), sheet=mixed.sheet(page.sheet))
    files, made = write_results(page, whole, judged, report, tolerances, given=model, mixed=mixed)
    data: dict[str, Any] = {"report": str(files[0]), "files": [str(path) for path in files], "diagnosis": None}
    lines = [f"report: {files[0]}"]
    if judged is not None:
        data |= {"statement": judged.statement} | made
        given_words = () if judged.carried is None else (remark(judged.carried),)
        lines = [f"{phrase(judged.diagnosis)}: {judged.statement}", *lines, *given_words]
    if mixed is not None:
        data |= {"statement": mixed.document["statement"], "motion": mixed.outcome.data}
        lines = [mixed.first_line, *lines[judged is not None :], *mixed.outcome.lines[1:]]
    if diagnosed := judged is not None or mixed is not None:
        data["diagnosis"] = json.loads((report / DIAGNOSIS).read_bytes())
    ours = ((DIAGNOSIS, diagnosed), (MODEL, bool(data.get("model"))))
    written = (*files, *(report / name for name, there in ours if there))
    leave_crate(report, store, grid, "pmg compare", began, clock, () if model is None else (model,), written)
    failed = whole.sources.failed
    return Outcome(
        data,
        tuple(lines),
        remarks + analysis_findings(whole.analysis, failed, whole.sources.used) + about_motion,
        partial=bool(failed) or not whole.analysis.complete or (mixed is not None and mixed.outcome.partial),
        mismatch=mixed.differs if mixed is not None else judged is not None and judged.diagnosis.mismatch.found,
    )


def compare_chosen(chosen: Chosen, campaign: str | None = None, progress: Progress | None = None) -> Outcome:
    """Simulate, compare and report the analysed campaign that file and options name, or the runs in motion of one.

    Parameters
    ----------
    chosen : Chosen
        Of the call.
    campaign : str, optional
        The one that was just ingested; where none is named, the one whose analysis the store holds.
    """
    store, note = chosen.needed("store"), chosen.text("note") or ""
    bench_in_force(store, chosen.text("machine"))  # another machine than that of the store is refused
    moving = asked_in_motion(store, campaign or chosen.text("campaign")) if chosen.path("grids") is None else None
    report, model, tolerances = chosen.needed("report"), chosen.path("model"), chosen.tolerance
    with keeping_workers(chosen.workers):
        if moving is not None:
            return compare_motion(store, moving, report, note, progress, model=model)
        return run_compare(store, report, note, model, tolerances=tolerances, progress=progress)


def run_all(chosen: Chosen, progress: Progress | None) -> Outcome:
    """Ingest, analyse and compare; with published grids, analyse and compare."""
    recordings, grids, campaign = chosen.path("recordings"), chosen.path("grids"), chosen.text("campaign")
    store, _, options = chosen.needed("store"), chosen.needed("report"), chosen.options()
    if (recordings is None) == (grids is None):
        came = "neither RECORDINGS nor --grids" if recordings is None else "both RECORDINGS and --grids"
        raise RecordingError("pmg run", came, "one of them", "Name a folder of recordings, or one of published grids.")
    check_choices(chosen)
    parts: dict[str, Outcome] = {}
    with keeping_workers(chosen.workers):
        if recordings is not None:
            parts["ingest"] = ingest_chosen(chosen, named(progress, "ingest"))
            ingested = parts["ingest"].data["campaigns"]
            campaign = campaign or (ingested[0] if len(ingested) == 1 else None)
        parts["analyse"] = run_analyse(store, options, grids=grids, campaign=campaign, machine=chosen.text("machine"))
        parts["compare"] = compare_chosen(chosen, campaign, named(progress, "compare"))
    return Outcome(
        data={name: part.data for name, part in parts.items()},
        lines=tuple(line for part in parts.values() for line in part.lines),
        findings=tuple(dict.fromkeys(remark for part in parts.values() for remark in part.findings)),
        partial=any(part.partial for part in parts.values()),
        mismatch=parts["compare"].mismatch,
    )


def write_results(
    page: Report,
    whole: StoredAnalysis,
    judged: ComparedCampaign | None,
    folder: Path,
    tolerances: Mapping[str, tuple[float, float]] | None,
    given: Path | None = None,
    mixed: MixedDiagnosis | None = None,
) -> tuple[tuple[Path, ...], dict[str, Any]]:
    """Write the report, and next to it the diagnosis, that with the runs in motion where there are any, and the model.

    Returns
    -------
    tuple of Path
        The files of the report, the page first.
    dict
        Where the model is, and what a given one predicted.
    """
    facts = summary_facts(whole.analysis.grid, judged, whole.bench, tolerances)
    files = write_report(page, folder, facts if mixed is None else facts | mixed.facts)
    if mixed is not None:
        leave_diagnosis(mixed.document, folder)
    elif judged is not None:
        leave_diagnosis(diagnosis_document(judged.diagnosis), folder)
    else:
        (folder / DIAGNOSIS).unlink(missing_ok=True)
    return files, {} if judged is None else leave_model(judged, folder / MODEL, given)


def campaign_page(
    whole: StoredAnalysis,
    judged: ComparedCampaign | None,
    recorded: RecordedPart | None,
    note: str,
    tolerances: Mapping[str, tuple[float, float]] | None,
    provenance: tuple[tuple[str, str], ...],
) -> tuple[Report, tuple[Remark, ...]]:
    """The report of a campaign, and the findings that go with it.

    Parameters
    ----------
    whole : StoredAnalysis
        The analysed campaign.
    judged : ComparedCampaign or None
        What it says about the simulator.
    recorded : RecordedPart or None
        What only recordings give, where there are any.
    note : str
        Told at the head of the report.
    tolerances : mapping or None
        Tolerances of the comparison that were set, by quantity: absolute [SI] and relative.
    provenance : tuple of (label, value)
        What made the report, in addition to its inputs.
    """
    analysis, bench, sources = whole.analysis, whole.bench, whole.sources
    diagnosis = None if judged is None else judged.diagnosis
    carried = None if judged is None else judged.carried
    remarks = sources.remarks + (() if recorded is None else recorded.findings)
    faults = correct_sensor_fault(diagnosis, analysis, bench, () if carried is None else carried.here.parts)
    page = build_report(
        analysis,
        judged,
        bench,
        RecordedFacts(
            remarks + tuple(unreached_findings(sources.used)),
            tuple((m.file, m.origin) for m in sources.used if m.origin is not None),
            conditions(sources.used),
            whole.budget,
            None if recorded is None else recorded.orders,
            None if recorded is None else recorded.signals,
        ),
        note=note,
        provenance=(*sources.inputs, *provenance),
        tolerances={name: Tolerance(*parts) for name, parts in (tolerances or {}).items()},
        faults=faults,
    )
    if faults and analysis.balance is not None:
        message = f"{sensor_fault_warning(faults)} {highest_loss(faults, analysis.balance)}"
        remarks += (Remark("warning", "losses", message),)
    return page, remarks


def seeded(seed: int) -> tuple[str, str]:
    """Name of the seed in the report."""
    return "Seed of the synthetic campaigns", str(seed)


def _command_words(note: str, model: Path | None) -> str:
    """The stage's command with what changes the page; folders are the reader's own."""
    options = (("--model", "" if model is None else model.name), ("--note", note))
    text = " ".join(f"{option} {shlex.quote(value)}" for option, value in options if value)
    return f"pmg compare --store STORE --report REPORT {text}".strip()
