"""`./pmgw bench losses`: loss curves from some minutes of ramps against a grid of steady speeds, of the same benches.

Both are measured on one synthetic bench with the same instruments, and held against its drag as built. The ramps are
fitted as `pmg compare` does; the grid is the mean torque of each hold less that of the zero runs, twice at every speed.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.diagnosis.motion.loss_curve import loss_curve
from pmg.pipeline.files.parallel import map_over
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.pipeline.trials.motion import places as at
from pmg.pipeline.trials.motion.bench import FASTEST, draw_bench
from pmg.pipeline.trials.motion.nature import MotionCase, measure_motion_case
from pmg.pipeline.trials.motion.programme import RATE, MotionCampaign, PlannedRun, draw_campaign
from pmg.pipeline.trials.motion.size import Scene
from pmg.pipeline.trials.motion.strata import motion_strata
from pmg.sim.bench import load_bench
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES, PerShaft
from pmg.sim.signals import MINUTE
from tests.bench.speed import report

if TYPE_CHECKING:
    from pmg.pipeline.motion.run import MovingRun
    from pmg.sim.signals import Array

SPEEDS = 12
"""Speeds of the grid on either shaft."""

SETTLE, HOLD, CHANGE = 5.0, 10.0, 10.0
"""Time to reach a speed, at it, and between runs [s]."""

RAMPS = ("N_sun_up", "N_sun_down", "N_sun_coast", "N_ring_up", "N_ring_down", "N_ring_coast")
"""Runs of the ramps, besides the zero runs."""


def grid_speeds(side: str) -> Array:
    """Speeds of the grid [rad/s]."""
    return np.asarray(FASTEST[side] * np.linspace(0.05, 0.95, SPEEDS))


def holds(ramps: MotionCampaign) -> MotionCampaign:
    """Every speed of either shaft alone, twice, forwards, with the zero runs of the ramps before, between and after."""
    t = np.arange(round((SETTLE + HOLD) * RATE)) / RATE
    zeros = [run for run in ramps.runs if run.configuration is Configuration.ZERO]
    first = ramps.runs[0]
    runs = [zeros[0]]
    for turn in range(2):
        for side in SIDES:
            for k, speed in enumerate(grid_speeds(side)):
                rise = np.minimum(t / (SETTLE - 2.0), 1.0)
                asked = {side: (at.SPEED, speed * rise)}
                runs.append(
                    replace(first, point=f"{side}_{k}_{turn}", configuration=Configuration.NEUTRAL, asked=asked)
                )
        runs.append(zeros[1 + turn])
    return MotionCampaign("grid", placed(runs, first))


def placed(runs: list[PlannedRun], first: PlannedRun) -> tuple[PlannedRun, ...]:
    """Runs one after the other, with the time between them."""
    found, start = [], first.started_at
    for run in runs:
        found.append(replace(run, started_at=start))
        start += timedelta(seconds=run.samples / RATE + CHANGE)
    return tuple(found)


def measured(campaign: MotionCampaign, seed: int) -> tuple[MotionCase, list[MovingRun]]:
    """The runs of a campaign on the bench of a seed, which is the same for all of its campaigns."""
    bench, rng = draw_bench(np.random.default_rng(seed)), np.random.default_rng([seed, len(campaign.runs)])
    begun = tuple(PerShaft(*map(float, pair)) for pair in 25e3 + rng.uniform(0.0, 6.0, (len(campaign.runs), 2)))
    case = MotionCase("losses", motion_strata()[0], Scene(bench, campaign, begun), (), "")
    return case, measure_motion_case(case, rng)


def minutes(campaign: MotionCampaign) -> float:
    """Time on the bench, changes between runs included."""
    return (campaign.length + CHANGE) / MINUTE


def compare(seed: int) -> dict[str, Array]:
    """Errors [N m] of both ways at the speeds of the grid, and what the ramps say of theirs, by shaft."""
    full = draw_campaign(np.random.default_rng([seed, 1]))
    kept = [run for run in full.runs if run.point in RAMPS or run.manoeuvre is Manoeuvre.ZERO]
    ramps = MotionCampaign("ramps", placed(kept, full.runs[0]))
    case, moving = measured(ramps, seed)
    baseline, covariance, _ = fit_constants(tuple(moving), load_bench())
    grid = holds(ramps)
    _, held = measured(grid, seed)
    found = {"minutes of ramps": np.array([minutes(ramps)]), "minutes of the grid": np.array([minutes(grid)])}
    for side in SIDES:
        speed, window = grid_speeds(side), slice(round(SETTLE * RATE), None)
        true = case.scene.bench.shafts[side].friction(speed)
        zero = np.mean([run.torque[side].mean() for run in held if run.configuration is Configuration.ZERO])
        means = {run.point: run.torque[side][window].mean() - zero for run in held}
        twice = np.array([[means[f"{side}_{k}_{turn}"] for turn in range(2)] for k in range(SPEEDS)])
        drag, u = loss_curve(baseline.sheet, baseline.values, covariance, side, speed)
        found[f"{side}, ramps"], found[f"{side}, u of the ramps"] = drag - true, u
        found[f"{side}, grid"] = twice.mean(axis=1) - true
        found[f"{side}, u of the grid"] = np.full(SPEEDS, np.sqrt(np.mean(np.ptp(twice, axis=1) ** 2) / 4.0))
        found[f"{side}, ramps less grid"] = drag - twice.mean(axis=1)
    return found


def main() -> None:
    """Read the arguments, run, print."""
    parser = argparse.ArgumentParser(prog="pmgw bench losses")
    parser.add_argument("--benches", type=int, default=20)
    parser.add_argument("--seed", type=int, default=20261124)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    every = [found for _, found in map_over(compare, [asked.seed + k for k in range(asked.benches)], asked.workers)]
    report(f"loss curves of {len(every)} benches", "mN m rms")
    for name in every[0]:
        root = float(np.sqrt(np.mean(np.concatenate([found[name] for found in every]) ** 2)))
        report(f"  {name}", f"{root:.1f} min" if name.startswith("minutes") else f"{1e3 * root:.2f}")


if __name__ == "__main__":
    main()
