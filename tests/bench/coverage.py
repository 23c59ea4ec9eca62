"""Coverage of stated intervals: means of windows, losses, efficiencies, every branch of the power flow, K_corr, c."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.analysis.power_flow import BRANCHES, power_flows
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.budget import budget_of
from pmg.pipeline.fit.losses import power_balance
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.window_facts import ShaftFacts, WindowFacts
from pmg.pipeline.windows.revolutions import BATCHES
from pmg.sim import signals
from pmg.sim.bench import load_bench
from pmg.sim.losscurve import SPEED_REFERENCE_RING, SPEED_REFERENCE_SUN, LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.power_chain import power_chain
from pmg.sim.steady.solve import steady
from tests.bench.speed import report
from tests.bench.windowed import NORMAL, windowed_coverage
from tests.points import joined, measured, points

if TYPE_CHECKING:
    from pmg.pipeline.fit.analysis import Analysis
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.sim.grid import Grid, OperatingPoints
    from pmg.sim.signals import Array, Mask
    from tests.bench.windowed import Tally

POWERS = (0.0, 0.5, 1.0, 2.0)
NATURE = LossModel(
    LossCurve(POWERS, np.array([0.015, 0.092, 0.030, -0.004]), SPEED_REFERENCE_SUN, SPEED_REFERENCE_SUN),
    LossCurve(POWERS, np.array([0.050, 0.283, -0.051, 0.005]), SPEED_REFERENCE_RING, SPEED_REFERENCE_RING),
    0.85,
    2e-3,
    2.2e-4,
    0.0,
)
"""The bench of the study: its curves have the form that is fitted, so that only noise and transducers are uncertain."""

NOISE = 1e-3
"""Scatter from point to point [N m]."""

SENSITIVITY = 2e-3
"""Half-width of the tolerance of either transducer's sensitivity."""

QUANTITIES = (
    signals.EFFICIENCY_TOTAL,
    signals.LOSS_TOTAL,
    signals.LOSS_BEARINGS,
    signals.LOSS_MAGNETIC,
    signals.EFFICIENCY_MAGNETIC,
)


def small_campaign() -> OperatingPoints:
    """56 neutral points, 32 engaged ones and 6 with the flow reversed."""
    sun, ring = (a.ravel() for a in np.meshgrid([90, 156, 312, 624, 936, 1248, 1560, 1872], np.linspace(60, 720, 7)))
    speed, load = (a.ravel() for a in np.meshgrid(np.linspace(156, 1872, 8), [0.78, 1.17, 1.56, 1.95]))
    back, back_load = (a.ravel() for a in np.meshgrid([312.0, 1092.0, 1872.0], [0.78, 1.95]))
    return joined(
        points("neutral", sun, ring),
        points("engaged", speed, -speed / 2.6, load, load_set=load),
        points("engaged", back, -back / 2.6, -back_load, load_set=-back_load, drive="ring"),
    )


def read(truth: Grid, gains: tuple[float, float], rng: np.random.Generator) -> Grid:
    """The campaign as transducers with these gain errors show it."""
    n = len(truth)
    sun = (1.0 + gains[0]) * truth.torque_sun + NOISE * rng.standard_normal(n)
    ring = (1.0 + gains[1]) * truth.torque_ring + NOISE * rng.standard_normal(n)
    started = np.asarray(1.7e9 + 40.0 * rng.permutation(n), dtype=np.float64)
    grid = measured(replace(truth.points, started_at=started), sun, ring, NOISE)
    common = [SENSITIVITY * np.abs(torque) / np.sqrt(3.0) for torque in (sun, ring)]
    return replace(grid, common_sun=common[0], common_ring=common[1])


def tally(analysis: Analysis, truth: Grid, fits: LossFits) -> dict[str, float]:
    """Part of the points at which the truth lies in the 95 % interval, by name."""
    bench, factor = load_bench(), float(stats.norm.isf(0.025))
    assert analysis.balance is not None
    assert analysis.calibration is not None
    assert analysis.causes is not None
    found: dict[str, float] = {}
    true = power_balance(truth, fits, NATURE.correction).values
    for name in (signal.name for signal in QUANTITIES):
        off = np.abs(analysis.balance.values[name] - true[name])
        found[name] = float(np.mean(off <= factor * analysis.balance.u(name)))
    gearbox = Gearbox.calibrated(bench, analysis.calibration.model)
    simulated = steady(gearbox, analysis.grid.points)
    flows = power_flows(gearbox, analysis.grid, simulated, bench, analysis.calibration, analysis.causes)
    chain = power_chain(Gearbox.calibrated(bench, NATURE), truth[truth.points.engaged], bench)
    for flow in (flows[0], flows[2]):
        for branch in BRANCHES:
            if branch == "unexplained" and flow.origin == "simulated":
                continue
            off = np.abs(flow.watts(branch) - getattr(chain, branch))
            found[f"{branch}, {flow.origin}"] = float(np.mean(off <= 0.5 * factor * flow.expanded(branch)))
    errors = analysis.causes.standard_errors()
    for name, value in (("K_corr", NATURE.correction), ("c", NATURE.c)):
        if name not in analysis.calibration.on_bound:
            found[name] = float(abs(analysis.calibration.value(name) - value) <= factor * np.hypot(*errors[name]))
    return found


def uncertainty_coverage(campaigns: int) -> None:
    """Print coverage with the transducers' gains uniform in their tolerance, and normal with the same deviation."""
    bench = load_bench()
    truth = steady(Gearbox.calibrated(bench, NATURE), small_campaign())
    truth = replace(truth, points=replace(truth.points, torque_ring=truth.torque_ring))
    exact = analyse(read(truth, (0.0, 0.0), np.random.default_rng(1)), AnalysisOptions(), bench).fits
    assert exact is not None
    fits = replace(
        exact, sun=replace(exact.sun, curve=NATURE.curve_sun), ring=replace(exact.ring, curve=NATURE.curve_ring)
    )
    for form in ("uniform", "normal"):
        inside: dict[str, list[float]] = {}
        for seed in range(campaigns):
            rng = np.random.default_rng([20260105, seed])
            gains = rng.uniform(-1.0, 1.0, 2) if form == "uniform" else rng.standard_normal(2) / np.sqrt(3.0)
            grid = read(truth, (SENSITIVITY * gains[0], SENSITIVITY * gains[1]), rng)
            for name, part in tally(analyse(grid, AnalysisOptions(), bench), truth, fits).items():
                inside.setdefault(name, []).append(part)
        report(f"coverage of 95 % intervals, gains {form}", "campaigns", "inside")
        for name, parts in inside.items():
            middle, half = float(np.mean(parts)), 1.96 * float(np.std(parts, ddof=1)) / np.sqrt(len(parts))
            told = f"  {100.0 * middle:.1f} % ({100.0 * (middle - half):.1f} to {100.0 * (middle + half):.1f})"
            report(f"  {name}", str(len(parts)), told)


def few_points(repeats: int = 0, zeros: int = 0) -> OperatingPoints:
    """Twelve neutral points, some of them repeated, and zero checks."""
    sun = np.linspace(120.0, 1800.0, 12)
    ring = np.random.default_rng(5).permutation(np.linspace(60.0, 720.0, 12))
    at = points("neutral", np.r_[sun, sun[:repeats]], np.r_[ring, ring[:repeats]])
    return joined(at, points("zero", np.zeros(zeros), np.zeros(zeros))) if zeros else at


def designs() -> dict[str, OperatingPoints]:
    """Campaigns whose points the windows are, by name."""
    many = small_campaign()
    zeros = points("zero", np.zeros(4), np.zeros(4))
    return {
        f"{len(many)} points": many,
        "and 7 repeats, 4 zero checks": joined(many, many[np.arange(0, 56, 8)], zeros),
        "12 points": few_points(),
        "and 4 repeats, 3 zero checks": few_points(4, 3),
    }


def _facts(n: int) -> WindowFacts:
    """Facts of n windows of ten batches."""
    no, unknown = np.zeros(n, dtype=np.bool_), np.full(n, np.nan)
    each = ShaftFacts(np.full(n, BATCHES - 1.0), unknown, no, no, unknown, unknown, unknown)
    return WindowFacts(each, each, (), no)


def means_held(truth: Grid, errors: Array, within: Array, rng: np.random.Generator) -> tuple[Mask, Array]:
    """Of the means of a campaign's torques, by the budget of its analysis.

    Parameters
    ----------
    truth : Grid
        The n points without noise.
    errors, within : (2, n) array
        Error of the mean of each window, and what the window says of it [N m]; sun, ring.
    rng : numpy.random.Generator
        Order of the points.

    Returns
    -------
    (k,) array of bool, (k,) array
        Whether the truth lies in the 95 % interval, and the half-width of that [N m].
    """
    n, bench = len(truth), load_bench()
    at = replace(truth.points, started_at=np.asarray(1.7e9 + 40.0 * rng.permutation(n), dtype=np.float64))
    grid = measured(at, truth.torque_sun + errors[0], truth.torque_ring + errors[1])
    grid = replace(grid, within_sun=within[0], within_ring=within[1], u_sun=within[0], u_ring=within[1])
    analysis = analyse(grid, AnalysisOptions(), bench)
    half = np.concatenate([shaft.expanded for shaft in budget_of(analysis.grid, analysis.floor, bench, _facts(n))])
    return np.abs(errors.ravel()) <= half, half


def campaign_coverage(windows: dict[str, Tally], campaigns: int) -> None:
    """Print how often the interval of a mean holds the truth once its window is a point of a campaign."""
    bench, out = load_bench(), sys.stdout.write
    of = {name: steady(Gearbox.calibrated(bench, NATURE), at) for name, at in designs().items()}
    out(f"\nthe same windows as points of {campaigns} campaigns each: truth inside, half-width over ideal\n\n")
    out(f"{'noise':<38}{'window alone':>20}" + "".join(f"{name:>30}" for name in of) + "\n")
    for noise, tally in windows.items():
        cells = []
        for truth in of.values():
            held, wide = [], []
            for seed in range(campaigns):
                rng = np.random.default_rng([20261122, seed])
                drawn = rng.choice(len(tally.u), (2, len(truth)), replace=False)
                inside, half = means_held(truth, tally.error[drawn], tally.u[drawn], rng)
                held.append(float(np.mean(inside)))
                wide.append(float(np.mean(half)))
            middle, off = float(np.mean(held)), 1.96 * float(np.std(held, ddof=1)) / np.sqrt(campaigns)
            ideal = NORMAL * float(np.sqrt(np.mean(tally.error**2)))
            cells.append(f"{middle:.1%} +- {off:.1%}, {np.mean(wide) / ideal:.2f}")
        out(f"{noise:<38}{tally.held.mean():>20.1%}" + "".join(f"{cell:>30}" for cell in cells) + "\n")


def main() -> None:
    """Coverage of the mean of a window, alone and in a campaign; where asked for, of what is derived as well."""
    parser = argparse.ArgumentParser(prog="pmgw bench coverage", description=main.__doc__)
    parser.add_argument("--runs", type=int, default=2000, help="windows for each correlation time")
    parser.add_argument("--means", type=int, default=20, help="campaigns of each noise whose points the windows are")
    parser.add_argument("--campaigns", type=int, default=0, help="campaigns for losses, efficiencies and constants")
    asked = parser.parse_args()
    campaign_coverage(windowed_coverage(asked.runs), asked.means)
    if asked.campaigns:
        uncertainty_coverage(asked.campaigns)


if __name__ == "__main__":
    main()
