"""Runs in motion of a campaign in `pmg compare`: diagnosed, reported, their model kept."""

from __future__ import annotations

import shlex
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.chapters.in_motion.page import motion_report
from pmg.pipeline.commands.compare_and_diagnose import DIAGNOSIS, SEED, leave_diagnosis
from pmg.pipeline.commands.crate import FILE as CRATE
from pmg.pipeline.commands.crate import recordings_of
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_files, now
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.document import motion_document
from pmg.pipeline.files.digest import sha256_of
from pmg.pipeline.files.json_values import read_json
from pmg.pipeline.grid.campaign import choose_campaign
from pmg.pipeline.model.apply_motion_model import apply_motion_model
from pmg.pipeline.model.model_file import FILE
from pmg.pipeline.model.motion_model import NO_MODEL, leave_motion_model, motion_model_of
from pmg.pipeline.model.read_motion_model import read_motion_model
from pmg.pipeline.motion.stored import judged_runs, moving_runs
from pmg.pipeline.preflight.motion import motion_summary
from pmg.pipeline.report.write import remove_report, write_report
from pmg.pipeline.settings.bench_in_force import bench_of_store
from pmg.pipeline.store.store import Store
from pmg.pipeline.wording.plurals import counted
from pmg.sim.signals import MINUTE

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.commands.provenance import Clock
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.model.apply_motion_model import MotionPrediction
    from pmg.pipeline.model.motion_model import MotionModel
    from pmg.pipeline.motion.run import MovingRun
    from pmg.pipeline.report.action_sheet import ActionSheet


FOLDER = "motion"
"""Folder of the report on the runs in motion, in that of the campaign."""


def analyse_motion(store: Path, campaign: str) -> Outcome:
    """Nothing to average or fit: say so, and who takes the runs from there."""
    manifests = choose_campaign(Store(store), campaign)[1]
    runs = [run for run in judged_runs(manifests) if run.manoeuvre.moves]
    line = (
        f"campaign {campaign}: no steady point, so no grid to analyse; 'pmg compare' diagnoses its "
        f"{counted(len(runs), 'run')} in motion"
    )
    return Outcome({"analysis": None, "folder": None, "moving": len(runs)}, (line,))


def compare_motion(
    store: Path,
    campaign: str,
    report: Path,
    note: str = "",
    progress: Progress | None = None,
    model: Path | None = None,
) -> Outcome:
    """Diagnose the runs in motion of a campaign; write report, diagnosis, model and stills, as `pmg compare` does."""
    return diagnosed_motion(store, campaign, report, note, progress, model=model).outcome


@dataclass(frozen=True)
class DiagnosedMotion:
    """Runs in motion diagnosed: as a value, as what the command gives, and as the first screen of their page."""

    diagnosis: MotionDiagnosis
    outcome: Outcome
    sheet: ActionSheet | None


def diagnosed_motion(
    store: Path,
    campaign: str,
    report: Path,
    note: str = "",
    progress: Progress | None = None,
    *,
    model: Path | None = None,
    clock: Clock = now,
) -> DiagnosedMotion:
    """Diagnose the runs in motion of a campaign, and write report, diagnosis and stills.

    Parameters
    ----------
    store : Path
        Holds the recordings; their samples are held against its hashes.
    campaign : str
        Which campaign.
    report : Path
        Folder of the report and diagnosis.json.
    note : str
        Told at the head of the report.
    progress : Progress, optional
        Receives each step as it begins.
    model : Path, optional
        A model of other runs, whose constants are known then and whose causes are taken out before.
    clock : callable
        Time of day, for the provenance.
    """
    began, runs = clock(), moving_runs(Store(store), campaign)
    judged = [run for run in judged_runs(choose_campaign(Store(store), campaign)[1]) if run.manoeuvre.moves]
    moving, aside = [run for run in runs if run.manoeuvre.moves], [run for run in judged if not run.record.sound]
    minutes = sum(len(run.torque.sun) / run.rate for run in moving) / MINUTE
    diagnosis, given, predicted = diagnose_runs(store, campaign, runs, model, progress)
    of_model = () if predicted is None else (f"{given.description}: {predicted.sentence}",)
    document = motion_document(diagnosis)
    recordings, named = recordings_of(store, campaign), "" if model is None else f" --model {shlex.quote(model.name)}"
    page = motion_report(
        diagnosis,
        document,
        (("Runs in motion", f"{len(moving)} of {len(judged)}"), ("Time in motion", f"{minutes:.1f} min")),
        (*(f"Set aside: {run.record.point}; pmg ingest says why." for run in aside), *of_model),
        note=note,
        provenance=(
            *((f"SHA-256 of {each.name}", each.sha256) for each in recordings),
            *(() if model is None else ((f"SHA-256 of {model.name}", sha256_of(model)),)),
            ("Seed of the synthetic campaigns", str(SEED)),
            ("Command", f"pmg compare --store STORE --report REPORT --campaign {shlex.quote(campaign)}{named}"),
        ),
    )
    facts = {"points": {"accepted": len(moving), "rejected": len(aside)}, "diagnosis": document["verdict"]}
    files = write_report(page, report, facts)
    left = leave_diagnosis(document, report)
    carried = replace(given, causes=()) if predicted is not None and not predicted.acts else given
    found = leave_motion_model(motion_model_of(diagnosis, runs, carried), report, model)
    written = (*files, report / DIAGNOSIS, *found)
    leave_crate_of_files(report, "pmg compare", recordings, written, began, clock)
    data = {
        "campaign": campaign,
        "moving": len(moving),
        "minutes": minutes,
        "report": str(files[0]),
        "files": [str(path) for path in written],
        "diagnosis": left,
        "statement": document["statement"],
        "model": str(found[0]) if found else None,
        "prediction": None if predicted is None else asdict(predicted),
    }
    head = f"campaign {campaign}: {counted(len(moving), 'run')} in motion, {minutes:.1f} min"
    summary = (f"  {line}" for line in motion_summary(judged))
    lines = (f"{document['phrase']}: {document['statement']}", head, *summary, *of_model, f"report: {files[0]}")
    outcome = Outcome(data, lines, partial=bool(aside), mismatch=diagnosis.mismatch.found)
    return DiagnosedMotion(diagnosis, outcome, page.sheet)


def diagnose_runs(
    store: Path, campaign: str, runs: tuple[MovingRun, ...], model: Path | None, progress: Progress | None = None
) -> tuple[MotionDiagnosis, MotionModel, MotionPrediction | None]:
    """The diagnosis of runs of a store, the model that was given for it, and how well that predicts them."""
    bench = bench_of_store(store)
    given = NO_MODEL if model is None else read_motion_model(model, bench)
    cleared, predicted = apply_motion_model(given, runs, bench)
    rng = np.random.default_rng(SEED)
    return diagnose_motion(campaign, cleared, bench, rng, progress, given.constants), given, predicted


def remove_motion_report(report: Path, campaign: str) -> None:
    """Remove an earlier report on the runs in motion of a campaign from its folder, where there is none anew."""
    try:
        of = read_json(report / FOLDER / DIAGNOSIS).get("campaign")
    except (OSError, ValueError, AttributeError):
        return
    if of == campaign:
        remove_report(report / FOLDER, (DIAGNOSIS, CRATE, FILE))
