"""Runs in motion in `pmg compare`: of a campaign that holds nothing else, and of one that holds steady points too."""

from __future__ import annotations

import shlex
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pmg.pipeline.chapters.bench_parts import parts_of
from pmg.pipeline.chapters.in_motion.page import motion_report
from pmg.pipeline.commands.compare_and_diagnose import DIAGNOSIS, SEED, leave_diagnosis
from pmg.pipeline.commands.crate import FILE as CRATE
from pmg.pipeline.commands.crate import recordings_of
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.provenance import leave_crate_of_files, now
from pmg.pipeline.diagnosis.grid.document import diagnosis_document, mechanism_fact
from pmg.pipeline.diagnosis.grid.statement import SHAFT_WORDS
from pmg.pipeline.diagnosis.joint import JointDiagnosis, join, joint_document, titles
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
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.action_sheet import SheetAnswer
from pmg.pipeline.report.document import Headline
from pmg.pipeline.report.write import remove_report, write_report
from pmg.pipeline.settings.bench_in_force import bench_of_store
from pmg.pipeline.store.store import MARK, Store
from pmg.pipeline.wording.plurals import capitalised, counted
from pmg.sim.errors import PmgError
from pmg.sim.signals import MINUTE

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.commands.provenance import Clock
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.model.apply_motion_model import MotionPrediction
    from pmg.pipeline.model.compared_campaign import ComparedCampaign
    from pmg.pipeline.model.motion_model import MotionModel
    from pmg.pipeline.motion.run import MovingRun
    from pmg.pipeline.report.action_sheet import ActionSheet
    from pmg.sim.grid import Grid


FOLDER = "motion"
"""Folder of the report on the runs in motion, in that of the campaign."""

WHERE = f"The runs in motion have a page of their own: {FOLDER}/report.html."


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
    return _diagnosed_motion(store, campaign, report, note, progress, model=model)[1]


def _diagnosed_motion(
    store: Path,
    campaign: str,
    report: Path,
    note: str = "",
    progress: Progress | None = None,
    *,
    model: Path | None = None,
    clock: Clock = now,
) -> tuple[MotionDiagnosis, Outcome]:
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
    found = leave_motion_model(motion_model_of(diagnosis, runs, given), report, model)
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
    return diagnosis, Outcome(data, lines, partial=bool(aside), mismatch=diagnosis.mismatch.found)


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


@dataclass(frozen=True)
class MixedDiagnosis:
    """The diagnosis of a campaign that holds steady points and runs in motion.

    Parameters
    ----------
    joint : JointDiagnosis or None
        Of both; None where the steady points could not be diagnosed.
    document : dict
        The diagnosis of the campaign.
    outcome : Outcome
        Of the runs in motion.
    """

    joint: JointDiagnosis | None
    document: dict[str, Any]
    outcome: Outcome

    @property
    def differs(self) -> bool:
        """Whether either kind of evidence differs from the model, the two looks counted."""
        return self.outcome.mismatch if self.joint is None else self.joint.found

    @property
    def first_line(self) -> str:
        """Verdict and statement, for the terminal."""
        return f"{self.document['phrase']}: {self.document['statement']}"

    @property
    def facts(self) -> dict[str, Any]:
        """What the summary of the report tells of it instead of what the steady points say alone."""
        leading = set() if self.joint is None or not self.joint.sets else set(self.joint.sets[0])
        known = titles()
        rows = [
            mechanism_fact(row, known[row["id"]], {})
            for row in self.document["mechanisms"]
            if row["id"] in leading or self.joint is None
        ]
        return {"diagnosis": self.document["verdict"], "mechanisms": rows}

    def headline(self, steady: Headline) -> Headline:
        """The head of the campaign's report, told by both kinds of evidence; `steady` is that of the points alone."""
        statement = str(self.document["statement"])
        figures = (*steady.counted, ("Runs in motion", str(self.outcome.data["moving"])))
        if self.joint is None:
            return replace(steady, text=f"{steady.text} Runs in motion: {statement} {WHERE}", counted=figures)
        state: Literal["good", "attention"] = "attention" if self.differs or steady.warnings else "good"
        return Headline(f"{statement} {WHERE}", state, figures, steady.warnings)

    def sheet(self, steady: ActionSheet | None) -> ActionSheet | None:
        """What to do, told by both kinds of evidence; `steady` is that of the points alone."""
        title = self.document["phrase"]
        if steady is None or self.joint is None:
            return None
        first = [SheetAnswer("Verdict", (f"{capitalised(title)}.",))]
        if self.joint.sets:
            words, known = "Cause" if len(self.joint.sets) == 1 else "Possible causes", titles()
            sets = (
                " together with ".join(f"{known[each]}{SHAFT_WORDS[shaft]}" for each, shaft in sorted(one.items()))
                for one in self.joint.sets
            )
            first.append(SheetAnswer(words, tuple(f"{one}." for one in sets)))
        first.append(SheetAnswer("Evidence", (str(self.document["statement"]),)))
        tests = tuple(f"{test['description']} ({test['minutes']:.0f} min)." for test in self.document["next_tests"][:2])
        next_tests = (SheetAnswer("Next test", tests),) if tests else ()
        answers = (*first, *next_tests, SheetAnswer("Runs in motion", (WHERE,)))
        return replace(steady, answers=answers, parts=parts_of(self.document), figure=None)


def diagnose_mixed(
    store: Path,
    report: Path,
    grid: Grid,
    judged: ComparedCampaign | None,
    note: str,
    clock: Clock,
    progress: Progress | None = None,
) -> tuple[MixedDiagnosis | None, tuple[Remark, ...]]:
    """The runs in motion of an analysed campaign diagnosed, with a report of their own; None where there is none.

    Parameters
    ----------
    store : Path
        Holds the recordings.
    report : Path
        Folder of the campaign's report.
    grid : Grid
        The analysed campaign.
    judged : ComparedCampaign or None
        What its steady points say.
    note : str
        Told at the head of the report on the runs in motion.
    clock : callable
        Time of day, for the provenance.
    progress : Progress, optional
        Receives each step as it begins.

    Returns
    -------
    MixedDiagnosis or None, tuple of Remark
        And why there is none though runs were made.
    """
    campaign = grid.campaign
    if grid.origin == "published" or not (store / MARK).is_file():
        return None, ()
    listed = judged_runs(m for m in Store(store).manifests() if m.ingested and m.campaign == campaign)
    if not any(run.manoeuvre.moves and run.record.sound for run in listed):
        return None, ()
    if judged is not None and judged.carried is not None:
        said = "runs in motion are not held against a given model; compare without --model to diagnose them"
        return None, (Remark("info", "runs in motion", said),)
    try:
        moving, outcome = _diagnosed_motion(store, campaign, report / FOLDER, note, progress, clock=clock)
    except PmgError as error:
        return None, (Remark("warning", "runs in motion", f"not diagnosed: {error}"),)
    document = outcome.data["diagnosis"]
    if judged is None:
        return MixedDiagnosis(None, document, outcome), ()
    steady = judged.diagnosis
    joint = join(steady, moving, (steady.mismatch.p_value, moving.mismatch.p_value))
    return MixedDiagnosis(joint, joint_document(joint, diagnosis_document(steady), document), outcome), ()
