"""The stage behind ``pmg prove``."""

from __future__ import annotations

import hashlib
import json
import os
from importlib import resources
from typing import TYPE_CHECKING, Any

from pmg.pipeline.aside import write_aside
from pmg.pipeline.chapters.proof import proof_page
from pmg.pipeline.executors import map_over
from pmg.pipeline.prove.nature import seal_truth
from pmg.pipeline.prove.trial.lot import CAMPAIGNS, SEED, chosen_kinds, draw_lots
from pmg.pipeline.prove.trial.score import Outcome as Verdict
from pmg.pipeline.prove.trial.score import judge
from pmg.pipeline.prove.trial.sealed import open_truth, open_truths, seal
from pmg.pipeline.prove.trial.summary import Trial, case_row, score_lines, scores_document, summarise
from pmg.pipeline.prove.trial.undergo import ROUTES, SCHEMA, Task, undergo
from pmg.pipeline.report.write import write_report
from pmg.pipeline.stages import Outcome
from pmg.sim.errors import BenchError, near_miss

if TYPE_CHECKING:
    from collections.abc import Callable
    from importlib.resources.abc import Traversable
    from pathlib import Path

    from pmg.pipeline.prove.trial.lot import Lot

NO_PART = ("chapters", "report", "trial", "validate")
"""Rooms of the pipeline on which no diagnosis depends; a change of how a trial runs a campaign changes `SCHEMA`."""

SCORES = "scores.json"


def run_prove(
    out: Path,
    *,
    campaigns: int | None = None,
    seed: int | None = None,
    strata: str | None = None,
    route: str = ROUTES[0],
    workers: int | None = None,
    case: int | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Outcome:
    """Seal concealed campaigns, diagnose them, open the truths, score, report.

    Parameters
    ----------
    out : Path
        Folder of the trial; what it already holds of the same trial is not made again.
    campaigns, seed : int, optional
        How many, and the master seed.
    strata : str, optional
        Kinds of campaign, separated by commas.
    route : str
        ``grid``, or ``recordings``: through files and every stage of the pipeline.
    workers : int, optional
        Processes; one for each processor when not given.
    case : int, optional
        This campaign only; nothing is scored over all.
    progress : callable, optional
        Is told how many are done, of how many, and which.
    """
    campaigns, seed = CAMPAIGNS if campaigns is None else campaigns, SEED if seed is None else seed
    kinds = chosen_kinds(strata)
    if route not in ROUTES:
        raise BenchError("--route", repr(route), " or ".join(ROUTES), near_miss(route, ROUTES))
    if campaigns < 1:
        raise BenchError("--campaigns", str(campaigns), "1 or more", "Give a number of campaigns.")
    if case is not None and not 0 <= case < campaigns:
        raise BenchError("--case", str(case), f"0 to {campaigns - 1}", "Name a campaign of this trial.")
    lots = draw_lots(campaigns, seed, kinds)
    hashes = seal(lots, out, seed=seed, kinds=kinds, route=route)
    code = code_digest()
    asked = lots if case is None else (lots[case],)
    tasks = [Task(lot, route, code, hashes[lot.number]) for lot in asked]
    missing = [task for task in tasks if read_case(out, task) is None]
    for done, (task, result) in enumerate(map_over(undergo, missing, workers or os.cpu_count() or 1), 1):
        write_aside(case_file(out, task.lot), (json.dumps(result, indent=1, allow_nan=False) + "\n").encode())
        if progress is not None:
            progress(len(tasks) - len(missing) + done, len(tasks), f"case {task.lot.number}")
    results = {task.lot.number: found for task in tasks if (found := read_case(out, task)) is not None}
    if case is not None:
        return _one(asked[0], hashes[case], results[case], out)
    return _all(lots, results, out, {"seed": seed, "strata": list(kinds), "route": route, "code": code}, len(missing))


def case_file(out: Path, lot: Lot) -> Path:
    """Where the result of a campaign is kept."""
    return out / "cases" / f"{lot.number:04d}.json"


def read_case(out: Path, task: Task) -> dict[str, Any] | None:
    """A result that is there, if it is of this truth, by this route and by this state of the program."""
    path = case_file(out, task.lot)
    if not path.exists():
        return None
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        return None
    wanted = {"schema": SCHEMA, "sha256": task.sha256, "route": task.route, "code": task.code}
    known = isinstance(document, dict) and all(document.get(name) == value for name, value in wanted.items())
    return document if known else None


def code_digest() -> str:
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
        elif entry.name.endswith((".py", ".toml")) and not entry.name.startswith("cli"):
            found.append((f"{name}/{entry.name}", entry.read_bytes()))
    return found


def _one(lot: Lot, sha256: str, result: dict[str, Any], out: Path) -> Outcome:
    """What came of one campaign."""
    truth = open_truth(seal_truth(lot.draw())[0], sha256, f"campaign {lot.number}")
    row = case_row(lot.number, judge(truth, result["diagnosis"]), truth, result)
    lines = [
        f"case {lot.number} ({row['stratum']}; {row['reached_sigma']:.2f} sigma after absorption): {row['outcome']}",
        f"verdict {row['verdict'] or 'none'}" + (f": {', '.join(row['said'])}" if row["said"] else ""),
        f"diagnosis: {case_file(out, lot)}",
    ]
    return Outcome({"case": row, "truth": truth, "result": result}, tuple(lines))


def _all(
    lots: tuple[Lot, ...], results: dict[int, dict[str, Any]], out: Path, told: dict[str, Any], made: int
) -> Outcome:
    """Truths opened, scores, report."""
    truths = open_truths(lots, out)
    trial = summarise(truths, results)
    document = scores_document(trial, told)
    write_aside(out / SCORES, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
    files = write_report(proof_page(trial, told), out)
    lines = [*score_lines(trial), f"{made} campaigns made, {len(lots) - made} were there", f"report: {files[0]}"]
    data = {
        "scores": document,
        "report": str(files[0]),
        "files": [str(out / SCORES), *map(str, files)],
        "made": made,
    }
    return Outcome(data, tuple(lines), _findings(trial))


def _findings(trial: Trial) -> tuple[dict[str, Any], ...]:
    """Every false alarm and every wrong cause named with confidence."""
    worst = (Verdict.FALSE_ALARM, Verdict.WRONG)
    return tuple(
        {
            "severity": "warning",
            "where": f"case {row['case']}",
            "message": f"{row['outcome']}: {row['stratum']} ({row['reached_sigma']:.2f} sigma), said {row['verdict']}"
            + (f" {', '.join(row['said'])}" if row["said"] else ""),
        }
        for score, row in zip(trial.scores, trial.rows, strict=True)
        if score.outcome in worst
    )
