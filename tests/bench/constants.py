"""`./pmgw bench constants`: how often 95 % intervals of constants and loss curves of runs in motion hold the truth.

Campaigns conceal nothing; each is of another bench, drawn about the data sheet by code that shares none with the fit.
Loss curves are of neutral runs, at parts of the highest speed of each shaft.
"""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.diagnosis.motion.loss_curve import loss_curve
from pmg.pipeline.files.parallel import map_over
from pmg.pipeline.trials.motion.bench import FASTEST
from pmg.pipeline.trials.motion.nature import measure_motion_case
from pmg.pipeline.trials.score.case_list import MotionLot, draw_motion_lots
from pmg.pipeline.trials.score.rates import count
from pmg.sim.bench import load_bench
from pmg.sim.shafts import SIDES
from tests.bench.speed import report

if TYPE_CHECKING:
    from pmg.pipeline.trials.motion.bench import MovingBench

PARTS = (0.03, 0.1, 0.3, 0.6, 0.9)
"""Parts of the highest speed of a shaft at which loss curves are held against the truth."""

WIDTHS = 1.959964
"""Half-width of a 95 % interval in standard uncertainties."""


def truth_of(bench: MovingBench) -> dict[str, float]:
    """Constants of a bench as built."""
    found = {"pull_out": bench.pull_out}
    for side in SIDES:
        found[f"inertia_{side}"] = bench.shafts[side].rotor_inertia
        found[f"compliance_{side}"] = 1.0 / bench.shafts[side].stiffness
    return found


def distances(lot: MotionLot) -> dict[str, tuple[float, float]]:
    """Error over standard uncertainty, and that over the true value, by constant and point of a curve."""
    case = lot.draw()
    baseline, covariance, _ = fit_constants(tuple(measure_motion_case(case, lot.rng("measure"))), load_bench())
    sheet, values = baseline.sheet, baseline.values
    found = {}
    for name, true in truth_of(case.scene.bench).items():
        at = sheet.at(name)
        u = float(np.sqrt(covariance[at, at]))
        found[name.replace("_", " ")] = (float(values[at]) - true) / u, u / true
    for side in SIDES:
        speed = np.array(PARTS) * FASTEST[side]
        drag, uncertainty = loss_curve(sheet, values, covariance, side, speed)
        built = case.scene.bench.shafts[side].friction(speed)
        for part, off, wide in zip(PARTS, (drag - built) / uncertainty, uncertainty / built, strict=True):
            found[f"loss curve of the {side} at {part:.0%}"] = float(off), float(wide)
    return found


def main() -> None:
    """Read the arguments, run, print."""
    parser = argparse.ArgumentParser(prog="pmgw bench constants")
    parser.add_argument("--campaigns", type=int, default=40)
    parser.add_argument("--seed", type=int, default=20261123)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    lots = draw_motion_lots(asked.campaigns, asked.seed, ("clean",))
    every = [found for _, found in map_over(distances, list(lots), asked.workers)]
    report(f"constants of {len(every)} campaigns in motion", "inside 95 %", "from", "to", "rms of u", "u, median")
    for name in every[0]:
        off = np.array([found[name][0] for found in every])
        wide = float(np.median([found[name][1] for found in every]))
        inside = count((np.abs(off) < WIDTHS).tolist())
        low, high = inside.interval or (0.0, 1.0)
        root = float(np.sqrt(np.mean(off**2)))
        report(f"  {name}", f"{inside.hits / inside.of:.1%}", f"{low:.1%}", f"{high:.1%}", f"{root:.2f}", f"{wide:.2%}")


if __name__ == "__main__":
    main()
