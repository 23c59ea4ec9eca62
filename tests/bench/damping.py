"""Least squares against bisquare weights: coverage and error of c, K_corr and efficiencies, outliers or none."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.losses import power_balance
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.wording.option_words import DampingMethod
from pmg.sim import signals
from pmg.sim.bench import load_bench
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady
from tests.bench.coverage import NATURE, NOISE, SENSITIVITY, read, small_campaign

if TYPE_CHECKING:
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array, Mask

SEED = 20261201
OUTLIERS = (0.0, 0.05)
"""Parts of the points whose torques are outliers."""

FAR = (10.0, 30.0)
"""Size of an outlier, in standard deviations of the scatter; either sign."""

CONSTANTS = {"K_corr": NATURE.correction, "c": NATURE.c}
EFFICIENCIES = (signals.EFFICIENCY_TOTAL.name, signals.EFFICIENCY_MAGNETIC.name)


@dataclass
class Score:
    """Results of one quantity: part of the intervals that hold the truth, and error, a campaign each."""

    inside: list[float] = field(default_factory=list)
    error: list[float] = field(default_factory=list)
    stated: list[float] = field(default_factory=list)

    def add(self, off: Array, u: Array, factor: float) -> None:
        """Count a campaign: errors and standard uncertainties of its n values."""
        self.inside.append(float(np.mean(np.abs(off) <= factor * u)))
        self.error.append(float(np.sqrt(np.mean(off**2))))
        self.stated.append(float(np.sqrt(np.mean(u**2))))


def with_outliers(grid: Grid, part: float, rng: np.random.Generator) -> Grid:
    """The grid with some readings of either shaft far off."""

    def moved(torque: Array) -> Array:
        hit = rng.random(len(grid)) < part
        size = NOISE * rng.uniform(*FAR, len(grid)) * rng.choice((-1.0, 1.0), len(grid))
        return np.asarray(torque + np.where(hit, size, 0.0))

    ring = moved(grid.torque_ring)
    sun = moved(grid.torque_sun)
    return replace(grid, torque_sun=sun, torque_ring=ring, points=replace(grid.points, torque_ring=ring))


def count(scores: dict[str, Score], analysis: Analysis, true: dict[str, Array], hit: Mask) -> None:
    """Add a campaign to the scores; efficiencies at the points that are no outliers."""
    factor = float(stats.norm.isf(0.025))
    if analysis.calibration is None or analysis.balance is None or analysis.causes is None:
        return
    errors = analysis.causes.standard_errors()
    for name, value in CONSTANTS.items():
        if name in analysis.calibration.on_bound:
            continue
        off = np.array([analysis.calibration.value(name) - value])
        scores.setdefault(name, Score()).add(off, np.array([np.hypot(*errors[name])]), factor)
    for name in EFFICIENCIES:
        off = (analysis.balance.values[name] - true[name])[~hit]
        scores.setdefault(name, Score()).add(off, analysis.balance.u(name)[~hit], factor)


def study(campaigns: int) -> dict[tuple[float, DampingMethod], dict[str, Score]]:
    """Scores by part of outliers, method and quantity."""
    bench = load_bench()
    truth = steady(Gearbox.calibrated(bench, NATURE), small_campaign())
    truth = replace(truth, points=replace(truth.points, torque_ring=truth.torque_ring))
    exact = analyse(read(truth, (0.0, 0.0), np.random.default_rng(1)), AnalysisOptions(), bench).fits
    assert exact is not None
    fits = replace(
        exact, sun=replace(exact.sun, curve=NATURE.curve_sun), ring=replace(exact.ring, curve=NATURE.curve_ring)
    )
    true = power_balance(truth, fits, NATURE.correction).values
    engaged = truth.points.engaged
    found: dict[tuple[float, DampingMethod], dict[str, Score]] = {}
    for part in OUTLIERS:
        for seed in range(campaigns):
            rng = np.random.default_rng([SEED, seed])
            gains = SENSITIVITY * rng.uniform(-1.0, 1.0, 2)
            clean = read(truth, (float(gains[0]), float(gains[1])), rng)
            grid = with_outliers(clean, part, rng)
            hit = (grid.torque_sun != clean.torque_sun) | (grid.torque_ring != clean.torque_ring)
            for method in DampingMethod:
                analysis = analyse(grid, AnalysisOptions(damping=method), bench)
                count(found.setdefault((part, method), {}), analysis, true, hit[engaged])
    return found


def main() -> None:
    """Coverage of c, K_corr and efficiencies on synthetic campaigns under both kinds of weights."""
    parser = argparse.ArgumentParser(prog="pmgw bench damping", description=main.__doc__)
    parser.add_argument("--campaigns", type=int, default=500, help="campaigns without and as many with outliers")
    asked = parser.parse_args()
    out = sys.stdout.write
    out("| outliers | weights | quantity | campaigns | 95 % interval holds the truth | rms error | stated u |\n")
    out("|---|---|---|---|---|---|---|\n")
    for (part, method), scores in study(asked.campaigns).items():
        for name, score in scores.items():
            inside, n = np.array(score.inside), len(score.inside)
            half = 1.96 * float(inside.std(ddof=1)) / np.sqrt(n)
            error, stated = (float(np.sqrt(np.mean(np.square(x)))) for x in (score.error, score.stated))
            out(
                f"| {part:.0%} | {method} | {name} | {n} | {100.0 * inside.mean():.1f} ± {100.0 * half:.1f} % "
                f"| {error:.2g} | {stated:.2g} |\n"
            )


if __name__ == "__main__":
    main()
