"""Drives whose dry friction holds them at reversals: false alarms without a concealed effect, and what is named."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.machine.machine_file import read_machine
from tests.balance.dry_drive import DryDrive, sweep, triangle, write_records


def diagnosed(drive: DryDrive, rng: np.random.Generator) -> tuple[Verdict, float, list[str]]:
    """Verdict on four records of a drive, p-value of the mismatch, and the terms of the last step."""
    runs = {
        "slow": triangle(rng.uniform(10.0, 25.0), rng.uniform(5.0, 12.0)),
        "fast": triangle(rng.uniform(10.0, 25.0), rng.uniform(30.0, 60.0)),
        "sweep": sweep(rng.uniform(20.0, 40.0), 0.1, 3.0, 40.0),
        "reversals": triangle(rng.uniform(2.0, 5.0), rng.uniform(1.0, 3.0)),
    }
    with tempfile.TemporaryDirectory() as given:
        folder = Path(given)
        case = case_of(read_machine(write_records(folder, drive, runs, rng)), folder)
        d = diagnose_terms(case, *read_recordings(case), np.random.default_rng(1))
    return d.verdict, d.mismatch.p_value, [step.added for step in d.steps[1:]]


def main() -> None:
    """Draw drives, half of them with friction that rises at low speed, and print what each is told to have."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--campaigns", type=int, default=24, help="drives, half of them without any effect")
    parser.add_argument("--seed", type=int, default=20261127, help="of the draw")
    asked = parser.parse_args()
    counts = {True: [0, 0, 0], False: [0, 0, 0]}
    print("| drive | counts | noise over dry friction | verdict | p | terms |\n|---|---|---|---|---|---|")
    for k in range(asked.campaigns):
        rng, rise = np.random.default_rng([asked.seed, k]), k % 2 == 1
        drive = DryDrive.draw(rng, rise=rise)
        verdict, p, terms = diagnosed(drive, rng)
        counts[rise][0] += 1
        counts[rise][1] += verdict is not Verdict.CONSISTENT
        counts[rise][2] += verdict.names and "stribeck" not in terms
        kind = "rises at low speed" if rise else "plain"
        told = f"{drive.counts} | {drive.noise / drive.dry:.2f} | {verdict.value} | {p:.4f} | {', '.join(terms)}"
        print(f"| {k}: {kind} | {told} |", flush=True)
    for rise, (drawn, seen, wrong) in counts.items():
        what = "with friction that rises at low speed" if rise else "of plain dry friction"
        print(f"{drawn} drives {what}: {seen} with a mismatch, {wrong} with another cause named")


if __name__ == "__main__":
    main()
