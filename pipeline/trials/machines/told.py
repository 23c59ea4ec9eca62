"""One campaign of the trial diagnosed from its files, as a user would, and what was told."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.low_pass_told import said_with
from pmg.pipeline.diagnosis.balance.low_passes import try_low_passes
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.fit.document import number
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.trials.machines.campaign import draw_machine_campaign
from pmg.pipeline.trials.machines.files import write_campaign
from pmg.sim.errors import PmgError

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis

SCHEMA = "pmg.machine-told/1"
"""Schema of a result."""


@dataclass(frozen=True)
class MachineLot:
    """A campaign of the trial by what draws it: its number, its stratum, its turn there, the master seed."""

    number: int
    stratum: str
    turn: int
    seed: int


@dataclass(frozen=True)
class MachineTask:
    """A lot, the hash of its sealed truth, and the state of the program."""

    lot: MachineLot
    sha256: str
    code: str


def diagnose_lot(task: MachineTask) -> dict[str, Any]:
    """What is told of a campaign; nothing but its files is handed on.

    A refusal of the program is a result as well.
    """
    lot = task.lot
    campaign = draw_machine_campaign(lot.number, lot.stratum, lot.turn, lot.seed)
    found: dict[str, Any] = {"schema": SCHEMA, "campaign": lot.number, "sha256": task.sha256, "code": task.code}
    with tempfile.TemporaryDirectory() as folder:
        path = write_campaign(campaign, Path(folder) / "campaign")
        began = time.perf_counter()
        try:
            told = _diagnosed(path, lot.number)
        except PmgError as refused:
            told = {"verdict": "refused", "refused": str(refused)}
    return found | told | {"seconds": round(time.perf_counter() - began, 2)}


def _diagnosed(machine: Path, seed: int) -> dict[str, Any]:
    case = case_of(read_machine(machine), machine.parent / "records")
    fit, withheld = read_recordings(case)
    low_passes = try_low_passes(case, np.random.default_rng(seed))
    return _what_is_told(diagnose_terms(case, fit, withheld, np.random.default_rng(seed), low_passes))


def _what_is_told(diagnosis: TermsDiagnosis) -> dict[str, Any]:
    """Verdict, sets of terms, places, and errors on what was withheld, of a diagnosis."""
    named = sorted(step.added for step in diagnosis.steps[1:])
    sets = [named, *(sorted(c.rival.ids) for c in diagnosis.contests if c.open)] if diagnosis.verdict.names else []
    last = (diagnosis.refinements or diagnosis.steps)[-1]
    over = float("nan")
    if diagnosis.withheld is not None:
        withheld = diagnosis.withheld
        left = withheld.force + withheld.known - last.fitted.predict(withheld)
        over = float(np.sqrt(np.mean(left**2))) / diagnosis.noise.noise.standard_deviation
    return {
        "verdict": str(diagnosis.verdict),
        "p_value": diagnosis.mismatch.p_value,
        "best": [] if diagnosis.naming is None else sorted(diagnosis.naming.best.ids),
        "named": named if diagnosis.verdict.names else [],
        "sets": sets,
        "refined_by": [step.added for step in diagnosis.refinements],
        "places": [place.name for place in diagnosis.mismatch.locations],
        "low_passes": [
            {"low_pass_Hz": each.low_pass_hz, "best": sorted(each.ids), "said": said_with(diagnosis, each)}
            for each in diagnosis.low_passes
        ],
        "impossible": [e.term for e in diagnosis.impossible],
        "findings": [str(finding.message) for finding in diagnosis.recorded.findings],
        "withheld_over_noise": number(over),
        "noise": diagnosis.noise.noise.standard_deviation,
        "samples": len(diagnosis.recorded.force),
    }
