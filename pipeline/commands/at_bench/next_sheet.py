"""The stage behind ``pmg next``: the next test of a campaign as a plan for the bench and as a sheet to tick off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.analysis.outputs import read_analysis
from pmg.pipeline.commands.at_bench.motion_sheet import motion_page, motion_sheet, references_csv
from pmg.pipeline.commands.at_bench.sheet_page import BenchSheet, SheetRow, sheet_csv, sheet_page
from pmg.pipeline.commands.campaign_asked import asked_in_motion
from pmg.pipeline.commands.compare_and_diagnose import SEED, compare_and_diagnose
from pmg.pipeline.commands.in_motion.motion import diagnose_runs
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.stored_analysis import analysed
from pmg.pipeline.diagnosis.design.direct_check import check_by_hand
from pmg.pipeline.diagnosis.design.expected_readings import expected_readings
from pmg.pipeline.diagnosis.design.plans import A_POINT
from pmg.pipeline.diagnosis.grid.candidates import grid_problem
from pmg.pipeline.diagnosis.grid.statement import causes, phrase
from pmg.pipeline.diagnosis.motion.statement import phrase as phrase_in_motion
from pmg.pipeline.files.atomic import write_together
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.motion.stored import moving_runs
from pmg.pipeline.store.store import Store
from pmg.pipeline.wording.plurals import counted
from pmg.sim.errors import FitError
from pmg.sim.signals import MINUTE, SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.commands.stored_analysis import StoredAnalysis
    from pmg.pipeline.diagnosis.design.next_test import NextTest
    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, GridProblem
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis

SHEET, POINTS = "next.html", "next.csv"
WITHOUT = "the simulation as it is"
"""What is expected where no cause is in the model."""


def run_next(store: Path, out: Path, campaign: str | None = None, model: Path | None = None) -> Outcome:
    """Write the next test of an analysed campaign, or the next runs of one in motion.

    Parameters
    ----------
    store : Path
        Holds the analysis.
    out : Path
        Receives the sheet and its points.
    campaign : str, optional
        Which one, where the store holds several.
    model : Path, optional
        A model of runs in motion that is known, as `pmg compare` takes it.

    Raises
    ------
    PmgError
        The store holds no analysis, that of another campaign, or one that reached no calibration; or a model was given
        for steady points.
    """
    moving = asked_in_motion(store, campaign)
    if moving is not None:
        return _next_runs(store, moving, out, model)
    if model is not None:
        why = "the torques that the sheet expects would lack those of the model"
        do = "Leave --model out; compare the new points with it afterwards: pmg compare --model FILE."
        raise FitError("--model", f"{model}, for steady points", f"runs in motion: {why}", do)
    whole = analysed(store, *read_analysis(store))
    rng, beside = np.random.default_rng(SEED), whole.beside_motion
    judged = compare_and_diagnose(whole.analysis, whole.options, whole.bench, rng, beside_motion=beside)
    if judged is None or whole.analysis.calibration is None:
        raise FitError(str(store), "no calibration", "a campaign that can be compared", "See 'pmg doctor' for why.")
    found = _question(whole, judged.diagnosis)
    if found is None:
        why = "no test of those known would tell" if judged.diagnosis.mismatch.found else "no question"
        line = f"{phrase(judged.diagnosis)}: {why}; there is no sheet."
        return Outcome({"verdict": str(judged.diagnosis.verdict), "files": []}, (line,))
    sheet = _sheet(whole, judged.diagnosis, found)
    files = {out / SHEET: sheet_page(sheet).encode(), out / POINTS: sheet_csv(sheet).encode()}
    write_together(files)
    telling = sum(row.tells for row in sheet.rows)
    lines = [
        f"{phrase(judged.diagnosis)}. {sheet.question}",
        f"{counted(len(sheet.rows), 'point')}, {sheet.minutes:.0f} min; {counted(telling, 'point')} alone can tell",
        *(f"{name}" for name in map(str, files)),
    ]
    data: dict[str, Any] = {
        "verdict": str(judged.diagnosis.verdict),
        "files": [str(path) for path in files],
        "test": found.test.plan.description,
        "minutes": sheet.minutes,
        "points": len(sheet.rows),
        "causes": list(sheet.causes),
        "telling": telling,
    }
    return Outcome(data, tuple(lines))


def _next_runs(store: Path, campaign: str, out: Path, model: Path | None) -> Outcome:
    """Write the next runs of a campaign in motion."""
    diagnosis, *_ = diagnose_runs(store, campaign, moving_runs(Store(store), campaign), model)
    sheet, verdict, words = motion_sheet(diagnosis), str(diagnosis.verdict), phrase_in_motion(diagnosis)
    if not sheet.runs:
        check, _ = check_by_hand(diagnosis.naming) if diagnosis.next_runs else ("", "")
        by_hand = (f"By hand: {check}.",) if check else ()
        line = f"{words}: no run is asked for; there is no sheet."
        return Outcome({"verdict": verdict, "files": []}, (line, *by_hand))
    files = {out / SHEET: motion_page(sheet).encode(), out / POINTS: references_csv(sheet).encode()}
    write_together(files)
    data = {
        "verdict": verdict,
        "files": [str(path) for path in files],
        "test": "; ".join(title for title, _ in sheet.tests),
        "minutes": sheet.minutes,
        "runs": len(sheet.runs),
    }
    questions = (f"{title}: {question}" for title, question in sheet.tests)
    head = f"{counted(len(sheet.runs), 'run')}, {sheet.minutes:.0f} min"
    return Outcome(data, (f"{words}.", *questions, head, *map(str, files)))


@dataclass(frozen=True)
class _Question:
    """What a test is to tell: the causes that may be there, by their words, and the test."""

    words: str
    causes: dict[str, tuple[CandidateFit, ...]]
    test: NextTest
    problem: GridProblem


def _question(whole: StoredAnalysis, diagnosis: Diagnosis) -> _Question | None:
    """The open question of a diagnosis, or how a named cause is confirmed; None where nothing can be asked."""
    assert whole.analysis.calibration is not None
    readings, floor = diagnosis.mismatch.readings, diagnosis.floor
    model = whole.analysis.calibration.model
    problem = grid_problem(readings, whole.bench, model, whitener(readings, whole.bench, floor))
    if diagnosis.naming is None or not diagnosis.verdict.names:
        if diagnosis.lifting is not None:
            words = "Repeats tell whether anything changed slowly during the test: then readings leave the band."
            return _Question(words, {"nothing changed slowly": ()}, diagnosis.lifting, problem)
        if diagnosis.repeated is None:
            return None
        words = (
            "A reading that leaves the band again points to a cause at its operating point; one that returns to the "
            "band points to a change with time."
        )
        return _Question(words, {WITHOUT: ()}, diagnosis.repeated, problem)
    best = diagnosis.naming.best
    open_ = {causes(diagnosis, best): best.fits}
    if not diagnosis.rivals:
        test = diagnosis.confirming
        words = "The cause is named; this test confirms it on new readings."
        return None if test is None else _Question(words, open_ | {WITHOUT: ()}, test, problem)
    open_ |= {causes(diagnosis, rival.explanation): rival.explanation.fits for rival in diagnosis.rivals}
    tests = [rival.test for rival in diagnosis.rivals if rival.test is not None]
    if not tests:
        return None
    words = "Each point says which cause its reading speaks for."
    return _Question(words, open_, max(tests, key=lambda each: (each.power, -each.plan.seconds)), problem)


def _sheet(whole: StoredAnalysis, diagnosis: Diagnosis, question: _Question) -> BenchSheet:
    """The sheet of a question: of each point the torque that tells most."""
    plan, at = question.test.plan, question.test.plan.points
    expected = expected_readings(question.problem, plan, question.causes, diagnosis.floor)
    apart = expected.apart
    rows: list[SheetRow] = []
    for i in range(len(at)):
        mine = np.flatnonzero(expected.point == i)
        if not len(mine):
            continue
        k = int(mine[np.argmax(apart[mine])])
        bands = tuple((float(expected.low(c)[k]), float(expected.high(c)[k])) for c in question.causes)
        rows.append(
            SheetRow(
                after=(float(at.started_at[i]) - float(at.started_at[0])) / MINUTE,
                seconds=A_POINT,
                configuration=str(at.configuration[i]),
                drive=str(at.drive[i]) if at.engaged[i] else "both",
                gear=int(at.gear[i]),
                sun=float(SPEED_SUN.display(float(at.speed_sun[i]))),
                ring=float(SPEED_RING.display(float(at.speed_ring[i]))),
                load=float(at.load_set[i]) if at.engaged[i] else None,
                signal="sun torque" if expected.sun[k] else "ring torque",
                bands=bands,
                tells=bool(apart[k] > 0.0),
            )
        )
    return BenchSheet(
        campaign=whole.analysis.grid.campaign,
        title=plan.description,
        question=question.words,
        causes=tuple(question.causes),
        power=question.test.power,
        minutes=plan.seconds / MINUTE,
        rows=tuple(rows),
    )
