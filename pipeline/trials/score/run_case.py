"""One campaign of a trial: measured, diagnosed unseen, and the further test run that its diagnosis asks for."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.analysis.outputs import read_analysis
from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.compare import run_compare
from pmg.pipeline.commands.compare_and_diagnose import SEED
from pmg.pipeline.commands.in_motion.motion import compare_motion
from pmg.pipeline.commands.ingest import ALONE, run_ingest
from pmg.pipeline.diagnosis.design.plans import join_points, possible_plans, whole_again
from pmg.pipeline.diagnosis.grid.decide import diagnose
from pmg.pipeline.diagnosis.grid.document import diagnosis_document
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.document import motion_document
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.trials.motion.nature import (
    MotionCase,
    measure_motion_case,
    with_further_runs,
    write_motion_case,
)
from pmg.pipeline.trials.motion.programme import run_as_asked
from pmg.pipeline.trials.nature import measure_case
from pmg.pipeline.trials.record import write_case
from pmg.sim.bench import load_bench

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.design.next_runs import NextRun
    from pmg.pipeline.trials.nature import ConcealedCampaign
    from pmg.pipeline.trials.score.case_list import AnyLot
    from pmg.sim.grid import OperatingPoints

ROUTES = ("grid", "recordings")
"""Ways from a concealed campaign to its diagnosis."""
SCHEMA = "pmg.proof-case/1"


@dataclass(frozen=True)
class CaseTask:
    """Task of a worker: a campaign, the way to go, which state of the program goes it, the sealed hash.

    `further`: the test that its diagnosis asks for is run too.
    """

    lot: AnyLot[Any]
    route: str
    code: str
    sha256: str
    further: bool = True


def run_case(task: CaseTask) -> dict[str, Any]:
    """The diagnosis of one campaign, as JSON; of the truth only its hash."""
    lot, began = task.lot, time.perf_counter()
    case = lot.draw()
    try:
        further: dict[str, Any] | None = None
        document: dict[str, Any] | None
        if isinstance(case, MotionCase):
            document, tests = _in_motion(case, lot.rng("measure"), task.route)
            seconds = time.perf_counter() - began
            if task.further and tests:
                further = _with_further_runs(case, tests, lot.rng("extend"))
        else:
            document, points = _diagnosed(case, lot.rng("measure"), task.route)
            seconds = time.perf_counter() - began
            if task.further:
                further = _extended(case, document, points, lot.rng("extend"), task.route)
    except Exception as defect:
        defect.add_note(
            f"campaign {lot.number} of the trial with seed {lot.seed}: run it alone with --case {lot.number}"
        )
        raise
    return {
        "schema": SCHEMA,
        "case": lot.number,
        "campaign": case.campaign,
        "sha256": task.sha256,
        "route": task.route,
        "code": task.code,
        "seconds": round(seconds, 3),
        "diagnosis": document,
        "extended": further,
    }


def _diagnosed(
    case: ConcealedCampaign, rng: np.random.Generator, route: str
) -> tuple[dict[str, Any] | None, OperatingPoints]:
    """Diagnosis of a campaign (None where it could not be made) and the points it had."""
    if route == "recordings":
        return _by_recordings(case, rng)
    bench = load_bench()
    analysis = analyse(measure_case(case, rng), AnalysisOptions(), bench)
    if analysis.calibration is None or analysis.fits is None or analysis.floor is None:
        return None, analysis.grid.points
    draws = np.random.default_rng(SEED)
    found = diagnose(analysis.grid, analysis.fits, analysis.floor, analysis.calibration, bench, draws)
    return diagnosis_document(found), analysis.grid.points


def _in_motion(case: MotionCase, rng: np.random.Generator, route: str) -> tuple[dict[str, Any], tuple[NextRun, ...]]:
    """Diagnosis of a campaign of runs in motion, from its signals or by the stages of the command line.

    With the runs that it asks for, where they are known.
    """
    if route != "recordings":
        runs = tuple(measure_motion_case(case, rng))
        found = diagnose_motion(case.campaign, runs, load_bench(), np.random.default_rng(SEED))
        return motion_document(found), found.next_runs
    with tempfile.TemporaryDirectory(prefix="pmg-prove-") as name:
        recordings, store, report = (Path(name) / part for part in ("recordings", "store", "report"))
        recordings.mkdir()
        write_motion_case(case, recordings, rng)
        run_ingest(recordings, store, ALONE)
        return compare_motion(store, case.campaign, report).data["diagnosis"], ()


def _with_further_runs(case: MotionCase, tests: tuple[NextRun, ...], rng: np.random.Generator) -> dict[str, Any]:
    """Diagnosis with the most powerful proposed runs made on the same bench, after the others."""
    best = max(tests, key=lambda test: test.power)
    planned = [
        run_as_asked(
            run.name,
            run.manoeuvre,
            {each.side: (each.quantity, each.course) for each in (run.speed, run.load) if each is not None},
            run.seconds,
        )
        for run in best.runs
    ]
    longer = with_further_runs(case, planned, rng)
    return {
        "test": best.title,
        "minutes": best.minutes,
        "power": best.power,
        "diagnosis": _in_motion(longer, rng, "grid")[0],
    }


def _by_recordings(case: ConcealedCampaign, rng: np.random.Generator) -> tuple[dict[str, Any] | None, OperatingPoints]:
    """The very stages of the command line, on files in a folder that goes again."""
    with tempfile.TemporaryDirectory(prefix="pmg-prove-") as name:
        recordings, store, report = (Path(name) / part for part in ("recordings", "store", "report"))
        recordings.mkdir()
        write_case(case, recordings, rng)
        run_ingest(recordings, store, ALONE)
        run_analyse(store, AnalysisOptions(), grids=None, campaign=case.campaign)
        found: dict[str, Any] | None = run_compare(store, report).data["diagnosis"]
        return found, read_analysis(store)[0].points


def _extended(
    case: ConcealedCampaign,
    document: dict[str, Any] | None,
    points: OperatingPoints,
    rng: np.random.Generator,
    route: str,
) -> dict[str, Any] | None:
    """Diagnosis with the points of the most powerful proposed test added, run anew by the same bench.

    None where the diagnosis is neither ambiguous nor confounded, or proposes nothing.
    """
    if document is None or document["verdict"] not in ("ambiguous", "confounded"):
        return None
    tests = [test for test in document["next_tests"] if test["power"] is not None]
    if not tests:
        return None
    best = max(tests, key=lambda test: float(test["power"]))
    plans = {plan.description: plan for plan in (*possible_plans(points, load_bench()), whole_again(points))}
    if best["description"] not in plans:
        return None
    longer = join_points(case.design.at, plans[best["description"]].points)
    again = replace(case, design=replace(case.design, at=longer))
    return {
        "test": best["description"],
        "minutes": best["minutes"],
        "power": best["power"],
        "diagnosis": _diagnosed(again, rng, route)[0],
    }
