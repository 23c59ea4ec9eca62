"""The stage behind ``pmg prove``."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Any

from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.json_values import read_json
from pmg.pipeline.files.parallel import map_over
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.write import write_report
from pmg.pipeline.trials.machines.trial import MACHINE_TRACK, run_machine_trial
from pmg.pipeline.trials.score.agreement import both_ways
from pmg.pipeline.trials.score.case_list import (
    CAMPAIGNS,
    SEED,
    TRACKS,
    chosen_kinds,
    chosen_laws,
    chosen_track,
    draw_lots,
    draw_motion_lots,
)
from pmg.pipeline.trials.score.chapter import proof_page
from pmg.pipeline.trials.score.figures import AIMS_IN_MOTION
from pmg.pipeline.trials.score.run_case import ROUTES, SCHEMA, CaseTask, run_case
from pmg.pipeline.trials.score.score import DiagnosisScore as Verdict
from pmg.pipeline.trials.score.score import judge
from pmg.pipeline.trials.score.sealed import draw_truths, open_truth, open_truths, seal
from pmg.pipeline.trials.score.summary import Trial, case_row, score_lines, scores_document, summarise
from pmg.sim.errors import BenchError, near_miss

if TYPE_CHECKING:
    from collections.abc import Mapping
    from importlib.resources.abc import Traversable
    from pathlib import Path

    from pmg.pipeline.files.progress import Progress
    from pmg.pipeline.trials.score.case_list import AnyLot

NO_PART = ("chapters", "cli", "report", "score", "thesis_figures")
"""Rooms of the pipeline on which no diagnosis depends; a change of how a trial runs a campaign changes `SCHEMA`."""

SCORES = "scores.json"
QUICK = (12, 1)
"""Campaigns of a quick trial, and how many concealed ones of them go both ways."""


@dataclass(frozen=True)
class TrialOptions:
    """What a trial is asked to run.

    Parameters
    ----------
    campaigns, seed : int, optional
        How many, and the master seed.
    strata : str, optional
        Kinds of campaign, separated by commas.
    laws : str, optional
        Families that laws are drawn from: ``usual`` unless given, ``reserved`` or ``all``.
    track : str, optional
        ``steady`` unless given, ``motion``: campaigns of runs in motion, or ``machines``: of other machines, through
        files; then only `campaigns`, `seed` and `workers` count.
    route : str
        ``grid``, or ``recordings``: through files and every stage of the pipeline.
    recordings : int, optional
        By grid only: so many of the campaigns that are not clean, and a third as many clean ones, go by recordings as
        well, and both diagnoses are compared; none if not given.
    quick : bool
        A small trial, `QUICK`, where `campaigns` and `recordings` do not say otherwise.
    workers : int, optional
        Processes; one for each processor when not given.
    case : int, optional
        This campaign only; nothing is scored over all.
    """

    campaigns: int | None = None
    seed: int | None = None
    strata: str | None = None
    laws: str | None = None
    track: str | None = None
    route: str = ROUTES[0]
    recordings: int | None = None
    quick: bool = False
    workers: int | None = None
    case: int | None = None


def run_prove(out: Path, asked: TrialOptions, progress: Progress | None = None) -> Outcome:
    """Seal concealed campaigns, diagnose them, open the truths, score, report.

    Parameters
    ----------
    out : Path
        Folder of the trial; what it already holds of the same trial is not made again.
    asked : TrialOptions
        Which campaigns, and by which route.
    progress : callable, optional
        Receives how many are done, of how many, and which.
    """
    if chosen_track(asked.track) == MACHINE_TRACK:
        return _of_machines(out, asked, progress)
    route, case = asked.route, asked.case
    recordings = _asked_both(asked.recordings, asked.quick, route, case)
    campaigns = (QUICK[0] if asked.quick else CAMPAIGNS) if asked.campaigns is None else asked.campaigns
    seed = SEED if asked.seed is None else asked.seed
    kinds, laws, track = chosen_kinds(asked.strata), chosen_laws(asked.laws), chosen_track(asked.track)
    if route not in ROUTES:
        raise BenchError("--route", repr(route), " or ".join(ROUTES), near_miss(route, ROUTES))
    if campaigns < 1:
        raise BenchError("--campaigns", str(campaigns), "1 or more", "Give a number of campaigns.")
    if case is not None and not 0 <= case < campaigns:
        raise BenchError("--case", str(case), f"0 to {campaigns - 1}", "Name a campaign of this trial.")
    workers = asked.workers or os.cpu_count() or 1
    drawn = draw_lots if track == TRACKS[0] else draw_motion_lots
    lots: tuple[AnyLot[Any], ...] = drawn(campaigns, seed, kinds, laws)
    texts, lots = draw_truths(lots, workers, progress)
    hashes = seal(texts, out, seed=seed, kinds=kinds, route=route, laws=laws, track=track)
    code = _code_digest()
    taken = lots if case is None else (lots[case],)
    tasks = [CaseTask(lot, route, code, hashes[lot.number]) for lot in taken]
    tasks += [CaseTask(lot, ROUTES[1], code, hashes[lot.number], False) for lot in both_ways(lots, recordings)]
    missing = [task for task in tasks if _read_case(out, task) is None]
    for done, (task, result) in enumerate(map_over(run_case, missing, workers), 1):
        write_atomic(_case_file(out, task), (json.dumps(result, indent=1, allow_nan=False) + "\n").encode())
        if progress is not None:
            progress(len(tasks) - len(missing) + done, len(tasks), f"case {task.lot.number}")
    results = {task: found for task in tasks if (found := _read_case(out, task)) is not None}
    if case is not None:
        return _one(tasks[0], results[tasks[0]], out, texts[case])
    facts = {"seed": seed, "track": track, "strata": list(kinds), "laws": laws, "route": route, "code": code}
    return _all(texts, results, out, facts, (len(missing), len(tasks) - len(missing)))


def _of_machines(out: Path, asked: TrialOptions, progress: Progress | None) -> Outcome:
    """The trial on other machines, which has one route and laws of its own."""
    for option, given in (("--strata", asked.strata), ("--laws", asked.laws), ("--case", asked.case)):
        if given is not None:
            do = "Leave it out: this trial has strata and laws of its own."
            raise BenchError(option, str(given), f"none with --track {MACHINE_TRACK}", do)
    campaigns = QUICK[0] if asked.quick and asked.campaigns is None else asked.campaigns
    seed = SEED if asked.seed is None else asked.seed
    return run_machine_trial(out, campaigns, seed, asked.workers, _code_digest(), progress)


def _asked_both(recordings: int | None, quick: bool, route: str, case: int | None) -> int:
    """Count of concealed campaigns that go both ways."""
    if recordings is not None and recordings < 0:
        raise BenchError("--recordings", str(recordings), "0 or more", "Give a number of campaigns.")
    if recordings and route != ROUTES[0]:
        hint = "Leave --route out: these campaigns go both ways."
        raise BenchError("--recordings", f"{recordings} with --route {route}", f"--route {ROUTES[0]}", hint)
    if recordings and case is not None:
        hint = "Leave one of them out; --route recordings takes one campaign through files, in another folder."
        raise BenchError("--recordings", f"{recordings} with --case {case}", "one of the two", hint)
    if recordings is None:
        return QUICK[1] if quick and route == ROUTES[0] and case is None else 0
    return recordings


def _case_file(out: Path, task: CaseTask) -> Path:
    """Where the result of a campaign is kept; that of the second way next to that of the first."""
    return out / "cases" / f"{task.lot.number:04d}{'' if task.further else '-' + task.route}.json"


def _read_case(out: Path, task: CaseTask) -> dict[str, Any] | None:
    """A result that is there, if it is of this truth, by this route and by this state of the program."""
    path = _case_file(out, task)
    if not path.exists():
        return None
    try:
        document = read_json(path)
    except ValueError:
        return None
    wanted = {"schema": SCHEMA, "sha256": task.sha256, "route": task.route, "code": task.code}
    known = isinstance(document, dict) and all(document.get(name) == value for name, value in wanted.items())
    return document if known else None


def _code_digest() -> str:
    """SHA-256 over the sources that a diagnosis depends on: results of another state of the program are made anew."""
    digest = hashlib.sha256()
    for package in ("pmg.sim", "pmg.pipeline"):
        for name, data in _sources(resources.files(package), package):
            digest.update(name.encode() + b"\0" + data + b"\0")
    return digest.hexdigest()


def _sources(folder: Traversable, name: str) -> list[tuple[str, bytes]]:
    found = []
    for entry in sorted(folder.iterdir(), key=lambda entry: entry.name):
        if entry.is_dir():
            found += [] if entry.name in NO_PART else _sources(entry, f"{name}/{entry.name}")
        elif entry.name.endswith((".py", ".toml")):
            found.append((f"{name}/{entry.name}", entry.read_bytes()))
    return found


def _one(task: CaseTask, result: dict[str, Any], out: Path, text: str) -> Outcome:
    """Result of one campaign."""
    lot = task.lot
    truth = open_truth(text, task.sha256, f"campaign {lot.number}")
    row = case_row(lot.number, judge(truth, result["diagnosis"]), truth, result)
    lines = [
        f"case {lot.number} ({row['stratum']}; {row['reached_sigma']:.2f} sigma after absorption): {row['outcome']}",
        f"verdict {row['verdict'] or 'none'}" + (f": {', '.join(row['said'])}" if row["said"] else ""),
        f"diagnosis: {_case_file(out, task)}",
    ]
    return Outcome({"case": row, "truth": truth, "result": result}, tuple(lines))


def _all(
    texts: Mapping[int, str],
    results: dict[CaseTask, dict[str, Any]],
    out: Path,
    facts: dict[str, Any],
    counted: tuple[int, int],
) -> Outcome:
    """Truths opened, scores, report; `counted` says how many results were made and how many were there."""
    truths, (made, there) = open_truths(texts, out), counted
    first, second = (
        {task.lot.number: found for task, found in results.items() if task.further is way} for way in (True, False)
    )
    trial = summarise(truths, first, second, {} if facts["track"] == TRACKS[0] else AIMS_IN_MOTION)
    document = scores_document(trial, facts)
    write_atomic(out / SCORES, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
    files = write_report(proof_page(trial, facts), out)
    lines = [*score_lines(trial), f"{made} results made, {there} were there", f"report: {files[0]}"]
    data = {
        "scores": document,
        "report": str(files[0]),
        "files": [str(out / SCORES), *map(str, files)],
        "made": made,
    }
    return Outcome(data, tuple(lines), _findings(trial))


def _findings(trial: Trial) -> tuple[Remark, ...]:
    """Every false alarm and every wrong cause named with confidence."""
    worst = (Verdict.FALSE_ALARM, Verdict.WRONG)
    return tuple(
        Remark(
            "warning",
            f"case {row['case']}",
            f"{row['outcome']}: {row['stratum']} ({row['reached_sigma']:.2f} sigma), said {row['verdict']}"
            + (f" {', '.join(row['said'])}" if row["said"] else ""),
        )
        for score, row in zip(trial.scores, trial.rows, strict=True)
        if score.outcome in worst
    )
