"""The trial on other machines: campaigns sealed, diagnosed from their files, opened, scored."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.json_values import read_json
from pmg.pipeline.files.parallel import map_over
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.trials.machines.campaign import draw_machine_campaign
from pmg.pipeline.trials.machines.marks import MachineMark, machine_lines, machine_rows, machine_scores
from pmg.pipeline.trials.machines.told import SCHEMA, MachineLot, MachineTask, diagnose_lot
from pmg.pipeline.trials.score.sealed import open_truths, seal
from pmg.sim.errors import BenchError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.files.progress import Progress

PARTS = {"clean": 0.25, "one": 0.5, "outside": 0.15, "two": 0.1}
"""Part of the campaigns of each stratum."""

MACHINE_CAMPAIGNS = 160
"""Campaigns of the trial, unless set otherwise."""

MACHINE_TRACK = "machines"
"""Name of the trial."""

SCORES_FILE = "scores.json"
"""Rows and rates of the trial."""

WORST = (MachineMark.FALSE_ALARM, MachineMark.WRONG, MachineMark.REFUSED)
"""Marks that are told one by one."""


def _machine_lots(campaigns: int, seed: int) -> tuple[MachineLot, ...]:
    """The campaigns of a trial; the first ones of a longer trial are the same.

    Parameters
    ----------
    campaigns : int
        How many.
    seed : int
        Master seed.
    """
    had = dict.fromkeys(PARTS, 0)
    lots = []
    for number in range(campaigns):
        due = max(PARTS, key=lambda name: PARTS[name] * (number + 1) - had[name])
        lots.append(MachineLot(number, due, had[due], seed))
        had[due] += 1
    return tuple(lots)


def run_machine_trial(
    out: Path, campaigns: int | None, seed: int, workers: int | None, code: str, progress: Progress | None = None
) -> Outcome:
    """Seal campaigns of other machines, diagnose them, open the truths, score.

    Parameters
    ----------
    out : Path
        Folder of the trial; what it already holds of the same trial is not made again.
    campaigns : int, optional
        How many; `MACHINE_CAMPAIGNS` if not given.
    seed : int
        Master seed.
    workers : int, optional
        Processes; one for each processor when not given.
    code : str
        State of the program that the results are of.
    progress : callable, optional
        Receives how many are done, of how many, and which.
    """
    number = MACHINE_CAMPAIGNS if campaigns is None else campaigns
    if number < 1:
        raise BenchError("--campaigns", str(number), "1 or more", "Give a number of campaigns.")
    lots = _machine_lots(number, seed)
    workers = workers or os.cpu_count() or 1
    texts = {}
    for lot, text in map_over(_text_of, lots, workers):
        texts[lot.number] = text
        if progress is not None:
            progress(len(texts), len(lots), f"campaign {lot.number} drawn")
    texts = dict(sorted(texts.items()))
    hashes = seal(texts, out, seed=seed, kinds=tuple(PARTS), route="files", laws="own", track=MACHINE_TRACK)
    tasks = [MachineTask(lot, hashes[lot.number], code) for lot in lots]
    missing = [task for task in tasks if _there(out, task) is None]
    for done, (task, result) in enumerate(map_over(diagnose_lot, missing, workers), 1):
        write_atomic(_file(out, task), (json.dumps(result, indent=1, allow_nan=False) + "\n").encode())
        if progress is not None:
            progress(len(tasks) - len(missing) + done, len(tasks), f"campaign {task.lot.number}")
    told = {task.lot.number: found for task in tasks if (found := _there(out, task)) is not None}
    rows = machine_rows(open_truths(texts, out), told)
    scores = machine_scores(rows)
    document = {"schema": "pmg.machine-scores/1", "seed": seed, "campaigns": number, **scores, "rows": rows}
    write_atomic(out / SCORES_FILE, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
    findings = tuple(
        Remark("warning", f"campaign {row['campaign']}", f"{row['mark']}: {row['kind']}, {_words(row)}")
        for row in rows
        if row["mark"] in WORST
    )
    files = [str(out / SCORES_FILE)]
    return Outcome({"scores": document, "files": files}, (*machine_lines(scores), f"scores: {files[0]}"), findings)


def _words(row: dict[str, Any]) -> str:
    causes = " and ".join(f"{name} of {size}" for name, size in zip(row["causes"], row["sizes"], strict=True))
    said = "; ".join(" and ".join(each) for each in row["sets"])
    return f"{causes or 'nothing concealed'}, said {row['verdict']}{f' {said}' if said else ''}"


def _text_of(lot: MachineLot) -> str:
    return draw_machine_campaign(lot.number, lot.stratum, lot.turn, lot.seed).sealed_text


def _file(out: Path, task: MachineTask) -> Path:
    return out / "campaigns" / f"{task.lot.number:04d}.json"


def _there(out: Path, task: MachineTask) -> dict[str, Any] | None:
    """A result that is there, of this truth and this state of the program."""
    path = _file(out, task)
    if not path.exists():
        return None
    try:
        found = read_json(path)
    except ValueError:
        return None
    wanted = {"schema": SCHEMA, "sha256": task.sha256, "code": task.code}
    known = isinstance(found, dict) and all(found.get(name) == value for name, value in wanted.items())
    return found if known else None
