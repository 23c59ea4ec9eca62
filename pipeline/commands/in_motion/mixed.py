"""Runs in motion of a campaign that holds steady points too, in `pmg compare`: one diagnosis of both."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

from pmg.pipeline.chapters.bench_parts import parts_of
from pmg.pipeline.commands.in_motion.motion import FOLDER, judge_motion, write_motion
from pmg.pipeline.diagnosis.grid.document import diagnosis_document, mechanism_fact
from pmg.pipeline.diagnosis.joint.document import joint_document, joint_sentence, titles
from pmg.pipeline.diagnosis.joint.join import ANYWHERE, JointDiagnosis, join
from pmg.pipeline.diagnosis.joint.kinds import evidence_in_motion, steady_evidence
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.action_sheet import SheetAnswer
from pmg.pipeline.report.document import Headline
from pmg.pipeline.wording.cause_sets import SHAFT_WORDS, TOGETHER
from pmg.pipeline.wording.numerals import measured
from pmg.pipeline.wording.plurals import capitalised
from pmg.pipeline.wording.units import displayed
from pmg.sim.errors import PmgError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from pmg.pipeline.commands.outcome import Outcome
    from pmg.pipeline.commands.provenance import Clock
    from pmg.pipeline.commands.stored_analysis import StoredAnalysis
    from pmg.pipeline.diagnosis.joint.weighing import Causes
    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.model.compared_campaign import ComparedCampaign
    from pmg.pipeline.report.action_sheet import ActionSheet
    from pmg.pipeline.report.document import Figure

KINDS = "Steady points", "Runs in motion"
OF_CAUSE = frozenset(("What differs", "How sure", "On the bench", "If ignored"))
"""Questions of a sheet whose answers hold for a cause whichever evidence names it."""

INSTRUMENTS = frozenset(("torque_gain_error", "torque_crosstalk"))
"""Mechanisms whose size, a part of something, is shown in per cent."""

WHERE = f"The runs in motion have a page of their own: {FOLDER}/report.html."


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
    motion_sheet : ActionSheet, optional
        What to do, by the runs in motion alone.
    alone : tuple of (str, str)
        What the steady points and the runs in motion say by themselves, in a phrase each.
    leads : tuple of (dict, dict)
        The causes that lead in either by itself.
    """

    joint: JointDiagnosis | None
    document: dict[str, Any]
    outcome: Outcome
    motion_sheet: ActionSheet | None = None
    alone: tuple[str, str] = ("", "")
    leads: tuple[Causes, Causes] = field(default_factory=lambda: ({}, {}))

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
        """The head of the report by both kinds of recordings; `steady` is the head by the steady points alone."""
        statement = str(self.document["statement"])
        figures = (*steady.counted, ("Runs in motion", str(self.outcome.data["moving"])))
        if self.joint is None:
            return replace(steady, text=f"{steady.text} Runs in motion: {statement} {WHERE}", counted=figures)
        state: Literal["good", "attention"] = "attention" if self.differs or steady.warnings else "good"
        return Headline(f"{statement} {WHERE}", state, figures, steady.warnings)

    def sheet(self, steady: ActionSheet | None) -> ActionSheet | None:
        """What to do by both kinds of recordings; `steady` is the sheet by the steady points alone.

        What to do about a cause, and how sure it is, stands as the kind tells it that leads with that cause.
        """
        if steady is None or self.joint is None:
            return None
        answers = [SheetAnswer("Verdict", (f"{capitalised(self.document['phrase'])}.",))]
        if self.joint.sets:
            words, known = "Cause" if len(self.joint.sets) == 1 else "Possible causes", titles()
            sets = (
                TOGETHER.join(f"{known[each]}{SHAFT_WORDS[shaft]}" for each, shaft in sorted(one.items()))
                for one in self.joint.sets
            )
            answers.append(SheetAnswer(words, tuple(f"{one}." for one in sets)))
        answers.append(SheetAnswer("Evidence", (joint_sentence(self.joint), *self._sizes())))
        told, figure = self._told(steady)
        tests = tuple(f"{test['description']} ({test['minutes']:.0f} min)." for test in self.document["next_tests"][:2])
        next_tests = (SheetAnswer("Next test", tests),) if tests else ()
        points, runs = (f"{kind}: {phrase}." if phrase else "" for kind, phrase in zip(KINDS, self.alone, strict=True))
        alone = SheetAnswer("Each alone", tuple(filter(None, (points, runs, WHERE))))
        return replace(
            steady, answers=(*answers, *told, *next_tests, alone), parts=parts_of(self.document), figure=figure
        )

    def _sizes(self) -> Iterator[str]:
        """Sizes that both kinds of recordings give the leading set together."""
        assert self.joint is not None
        leading = self.joint.sets[0] if self.joint.sets else {}
        for row in self.document["mechanisms"]:
            both = row["id"] in self.joint.sizes and leading.get(row["id"]) == row["shaft"]
            if both and len(row["parameters"]) == 1:
                (of_both,) = row["parameters"]
                factor, unit = displayed(of_both["unit"], of_both["value"], share=row["id"] in INSTRUMENTS)
                size = measured(factor * of_both["value"], factor * of_both["standard_error"])
                yield f"{titles()[row['id']]}, by both: {size}{unit}."

    def _told(self, steady: ActionSheet) -> tuple[tuple[SheetAnswer, ...], Figure | None]:
        """Answers about the leading cause, and their figure, of the kind that leads with it; runs in motion first."""
        if self.joint is None or not self.joint.sets:
            return (), None
        by_points, by_runs = (_alike(causes, self.joint.sets[0]) for causes in self.leads)
        if self.motion_sheet is not None and by_runs:
            there = tuple(replace(answer, grounds="") for answer in self.motion_sheet.answers)  # on a page of its own
            return tuple(answer for answer in there if answer.question in OF_CAUSE), self.motion_sheet.figure
        if by_points:
            return tuple(answer for answer in steady.answers if answer.question in OF_CAUSE), steady.figure
        return (), None


def _alike(one: Causes, other: Causes) -> bool:
    """Whether two sets hold the same mechanisms, on shafts that do not exclude each other."""
    if one.keys() != other.keys():
        return False
    return all(shaft == other[name] or ANYWHERE in (shaft, other[name]) for name, shaft in one.items())


def diagnose_mixed(
    whole: StoredAnalysis,
    report: Path,
    judged: ComparedCampaign | None,
    note: str,
    clock: Clock,
    progress: Progress | None = None,
) -> tuple[MixedDiagnosis | None, tuple[Remark, ...]]:
    """The runs in motion of an analysed campaign diagnosed, with a report of their own; None where there is none.

    Parameters
    ----------
    whole : StoredAnalysis
        The analysed campaign.
    report : Path
        Folder of the campaign's report.
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
    if not whole.beside_motion:
        return None, ()
    if judged is not None and judged.carried is not None:
        said = "runs in motion are not held against a given model; compare without --model to diagnose them"
        return None, (Remark("info", "runs in motion", said),)
    try:
        began = clock()
        moving = judge_motion(whole.store, whole.analysis.grid.campaign, progress)
        outcome, page = write_motion(moving, report / FOLDER, began, note, clock=clock)
    except PmgError as error:
        return None, (Remark("warning", "runs in motion", f"not diagnosed: {error}"),)
    document = outcome.data["diagnosis"]
    if judged is None:
        return MixedDiagnosis(None, document, outcome), ()
    calibration, of_points = whole.analysis.calibration, diagnosis_document(judged.diagnosis)
    assert calibration is not None  # what was judged was calibrated
    kinds = (
        steady_evidence(judged.diagnosis, calibration.model, whole.bench),
        evidence_in_motion(moving.diagnosis),
    )
    joint = join(*kinds)
    points, runs = (kind.sets[0][0] if kind.sets else {} for kind in kinds)
    return MixedDiagnosis(
        joint,
        joint_document(joint, of_points, document),
        outcome,
        page.sheet,
        (str(of_points["phrase"]), str(document["phrase"])),
        (points, runs),
    ), ()
