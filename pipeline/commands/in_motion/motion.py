"""Runs in motion of a campaign in `pmg compare`: diagnosed, reported, their model kept."""

from __future__ import annotations

import shlex
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

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
from pmg.pipeline.grid.campaign import choose_campaign, failed_sources
from pmg.pipeline.model.apply_motion_model import apply_motion_model
from pmg.pipeline.model.model_file import FILE
from pmg.pipeline.model.motion_model import NO_MODEL, leave_motion_model, motion_model_of
from pmg.pipeline.model.read_motion_model import read_motion_model
from pmg.pipeline.motion.stored import judged_runs, moving_runs
from pmg.pipeline.preflight.motion import motion_summary
from pmg.pipeline.recording.findings import Severity
from pmg.pipeline.report.write import remove_report, write_report
from pmg.pipeline.settings.bench_in_force import bench_of_store
from pmg.pipeline.store.store import Store
from pmg.pipeline.wording.plurals import counted, listed
from pmg.sim.signals import MINUTE

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from datetime import datetime
    from pathlib import Path

    from pmg.pipeline.commands.provenance import Clock
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.model.apply_motion_model import MotionPrediction
    from pmg.pipeline.model.motion_model import MotionModel
    from pmg.pipeline.motion.run import MovingRun
    from pmg.pipeline.motion.stored import JudgedRun
    from pmg.pipeline.report.document import Report
    from pmg.pipeline.store.manifest import Manifest


FOLDER = "motion"
"""Folder of the report on the runs in motion, in that of the campaign."""


def analyse_motion(store: Path, campaign: str) -> Outcome:
    """Nothing to average or fit: say so, and who takes the runs from there."""
    manifests = choose_campaign(Store(store), campaign)[1]
    runs = [run for run in judged_runs(manifests) if run.manoeuvre.moves]
    line = (
        f"campaign {campaign}: no steady point, so no grid to analyse; the comparison ('pmg compare') diagnoses its "
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
    began = now()
    return write_motion(judge_motion(store, campaign, progress, model=model), report, began, note)[0]


@dataclass(frozen=True)
class JudgedMotion:
    """The runs in motion of a campaign, diagnosed, before anything is written.

    Parameters
    ----------
    store : Path
        Holds the recordings.
    campaign : str
        Which campaign.
    runs : tuple of MovingRun
        Those that were judged, zero checks among them.
    listed : tuple of JudgedRun
        All its runs that move, those that were set aside among them.
    failed : tuple of Manifest
        Recordings of the store that are not usable; of which campaign they are is not known.
    diagnosis : MotionDiagnosis
        What was found.
    model : Path or None
        A model of other runs that was given.
    given, acting : MotionModel
        What it holds; the same with those of its causes that act in these runs.
    prediction : MotionPrediction or None
        How well it predicts these.
    """

    store: Path
    campaign: str
    runs: tuple[MovingRun, ...]
    listed: tuple[JudgedRun, ...]
    failed: tuple[Manifest, ...]
    diagnosis: MotionDiagnosis
    model: Path | None
    given: MotionModel
    acting: MotionModel
    prediction: MotionPrediction | None

    @cached_property
    def document(self) -> dict[str, Any]:
        """The document ``pmg.diagnosis/1``."""
        return motion_document(self.diagnosis)

    @property
    def moving(self) -> tuple[MovingRun, ...]:
        """Judged runs that move."""
        return tuple(run for run in self.runs if run.manoeuvre.moves)

    @property
    def aside(self) -> tuple[JudgedRun, ...]:
        """Runs that were set aside."""
        return tuple(run for run in self.listed if not run.record.sound)

    @property
    def minutes(self) -> float:
        """Length of the judged runs."""
        return sum(len(run.torque.sun) / run.rate for run in self.moving) / MINUTE

    @property
    def of_model(self) -> tuple[str, ...]:
        """What is said of a model that was given."""
        return () if self.prediction is None else (f"{self.given.description}: {self.prediction.sentence}",)

    @property
    def result(self) -> MotionModel:
        """The model that these runs give."""
        return motion_model_of(self.diagnosis, self.runs, self.acting)

    def page(self, note: str = "", made: tuple[tuple[str, str], ...] = ()) -> Report:
        """The report with a note at its head; `made` is added to its provenance."""
        usable = f"{len(self.moving)} of {len(self.listed)}"
        usable += f"; {counted(len(self.failed), 'recording')} not usable" if self.failed else ""
        return motion_report(
            self.diagnosis,
            self.document,
            (("Runs in motion", usable), ("Time in motion", f"{self.minutes:.1f} min")),
            (*map(_unusable, self.failed), *set_aside(self.aside), *self.of_model),
            note=note,
            provenance=(
                *((f"SHA-256 of {each.name}", each.sha256) for each in recordings_of(self.store, self.campaign)),
                *(() if self.model is None else ((f"SHA-256 of {self.model.name}", sha256_of(self.model)),)),
                ("Seed of the synthetic campaigns", str(SEED)),
                *made,
            ),
        )


def _unusable(failed: Manifest) -> str:
    """Which recording is not usable, and why."""
    why = next((each for each in failed.findings if each.severity is Severity.ERROR), None)
    return f"{failed.file} is not usable{'' if why is None else f': {why.message}. {why.do}'}"


def set_aside(aside: Iterable[JudgedRun]) -> Iterator[str]:
    """Which runs were set aside, and why; those of one kind of reason together."""
    by_kind: dict[str, list[JudgedRun]] = {}
    for run in aside:
        kind, _, _ = next(iter(run.record.reasons), "").partition(": ")
        by_kind.setdefault(kind, []).append(run)
    for runs in by_kind.values():
        _, _, why = next(iter(runs[0].record.reasons), "").partition(": ")
        names = listed([run.record.point for run in runs])
        of = f" (in {runs[0].record.point})" if len(runs) > 1 else ""
        yield f"Set aside: {names}{f': {why}{of}' if why else ''}."


def judge_motion(
    store: Path, campaign: str, progress: Progress | None = None, *, model: Path | None = None
) -> JudgedMotion:
    """The runs in motion of a campaign, diagnosed.

    Parameters
    ----------
    store : Path
        Holds the recordings; their samples are held against its hashes.
    campaign : str
        Which campaign.
    progress : Progress, optional
        Receives each step as it begins.
    model : Path, optional
        A model of other runs, whose constants are known then and whose causes are taken out before.
    """
    runs = moving_runs(Store(store), campaign)
    listed_runs = tuple(r for r in judged_runs(choose_campaign(Store(store), campaign)[1]) if r.manoeuvre.moves)
    diagnosis, given, acting, predicted = diagnose_runs(store, campaign, runs, model, progress)
    failed = failed_sources(store)
    return JudgedMotion(store, campaign, runs, listed_runs, failed, diagnosis, model, given, acting, predicted)


def write_motion(
    judged: JudgedMotion, report: Path, began: datetime, note: str = "", *, clock: Clock = now
) -> tuple[Outcome, Report]:
    """Write report, diagnosis, model and stills; what the command gives, and the page.

    Parameters
    ----------
    judged : JudgedMotion
        What was found.
    report : Path
        Folder of the report and diagnosis.json.
    began : datetime
        When this was begun.
    note : str
        Told at the head of the report.
    clock : callable
        Time of day, for the provenance.
    """
    campaign, model, moving = judged.campaign, judged.model, judged.moving
    named = "" if model is None else f" --model {shlex.quote(model.name)}"
    command = f"pmg compare --store STORE --report REPORT --campaign {shlex.quote(campaign)}{named}"
    facts = {
        "points": {"accepted": len(moving), "rejected": len(judged.aside), "unusable": len(judged.failed)},
        "diagnosis": judged.document["verdict"],
    }
    page = judged.page(note, (("Command", command),))
    files = write_report(page, report, facts)
    left = leave_diagnosis(judged.document, report)
    found = leave_motion_model(judged.result, report, model)
    written = (*files, report / DIAGNOSIS, *found)
    leave_crate_of_files(report, "pmg compare", recordings_of(judged.store, campaign), written, began, clock)
    data = {
        "campaign": campaign,
        "moving": len(moving),
        "minutes": judged.minutes,
        "report": str(files[0]),
        "files": [str(path) for path in written],
        "diagnosis": left,
        "statement": judged.document["statement"],
        "model": str(found[0]) if found else None,
        "prediction": None if judged.prediction is None else asdict(judged.prediction),
    }
    head = f"campaign {campaign}: {counted(len(moving), 'run')} in motion, {judged.minutes:.1f} min"
    summary = (f"  {line}" for line in motion_summary(judged.listed))
    first = f"{judged.document['phrase']}: {judged.document['statement']}"
    lines = (first, head, *summary, *judged.of_model, f"report: {files[0]}")
    partial = bool(judged.aside or judged.failed)
    return Outcome(data, lines, partial=partial, mismatch=judged.diagnosis.mismatch.found), page


def diagnose_runs(
    store: Path, campaign: str, runs: tuple[MovingRun, ...], model: Path | None, progress: Progress | None = None
) -> tuple[MotionDiagnosis, MotionModel, MotionModel, MotionPrediction | None]:
    """The diagnosis of runs of a store, the model that was given, what of it acts in them, how it predicts them."""
    bench = bench_of_store(store)
    given = NO_MODEL if model is None else read_motion_model(model, bench)
    cleared, acting, predicted = apply_motion_model(given, runs, bench)
    rng = np.random.default_rng(SEED)
    return diagnose_motion(campaign, cleared, bench, rng, progress, given.constants), given, acting, predicted


def remove_motion_report(report: Path, campaign: str) -> None:
    """Remove an earlier report on the runs in motion of a campaign from its folder, where there is none anew."""
    try:
        of = read_json(report / FOLDER / DIAGNOSIS).get("campaign")
    except (OSError, ValueError, AttributeError):
        return
    if of == campaign:
        remove_report(report / FOLDER, (DIAGNOSIS, CRATE, FILE))
