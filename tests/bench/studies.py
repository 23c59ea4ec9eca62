"""`./pmgw bench studies`: do stated intervals cover, and does the published grids' p-value keep its rate.

All are studies on synthetic campaigns, hundreds of them; they take minutes and print a table.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE
from pmg.pipeline.diagnosis.grid.locate import find_mismatch
from pmg.pipeline.diagnosis.residuals.search import study_residuals
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import THESIS_OPTIONS, AnalysisOptions
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.trials.nature import draw_case, measure_case
from pmg.sim.bench import load_bench
from pmg.sim.lossmodel import LossModel
from pmg.sim.signals import EFFICIENCY_TOTAL
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady
from tests.bench.case import PUBLISHED
from tests.bench.coverage import uncertainty_coverage
from tests.bench.speed import report
from tests.trials.strata_by_name import find_stratum

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid

CAMPAIGNS = 500
ROUNDING = 0.01
"""Step of the published torques [N m]."""

WANDER = 2e-3
"""Scatter from point to point in the synthetic published grids, before they are rounded [N m]."""


def interval(hits: int, of: int) -> str:
    """A rate with its exact 95 % interval."""
    low = stats.beta.ppf(0.025, hits, of - hits + 1) if hits else 0.0
    high = stats.beta.ppf(0.975, hits + 1, of - hits) if hits < of else 1.0
    return f"{100.0 * hits / of:.1f} % ({100.0 * low:.1f} to {100.0 * high:.1f})"


def told(name: str, inside: Sequence[bool]) -> None:
    """One line: how often the truth lay inside."""
    report(name, str(len(inside)), interval(sum(inside), len(inside)))


def coverage(campaigns: int) -> None:
    """95 % intervals of K_corr, c and the total efficiency, on clean campaigns of the proving bench."""
    bench, stratum = load_bench(), find_stratum("clean random")
    factor = float(stats.norm.isf(0.025))
    inside: dict[str, list[bool]] = {"K_corr": [], "c": [], "total efficiency": []}
    for seed in range(campaigns):
        rng = np.random.default_rng([20260103, seed])
        case = draw_case(stratum, rng)
        analysis = analyse(measure_case(case, rng), AnalysisOptions(), bench)
        assert analysis.calibration is not None
        assert analysis.balance is not None
        for name, truth in (("K_corr", case.world.bearing_part), ("c", case.world.eddy)):
            error = analysis.calibration.standard_error(name)
            if error is not None:
                inside[name].append(abs(analysis.calibration.value(name) - truth) <= factor * error)
        at = case.design.at
        power_sun, power_ring = case.shown[0] * at.speed_sun, case.shown[1] * at.speed_ring
        forward = at.drive != "ring"
        with np.errstate(divide="ignore", invalid="ignore"):
            true = np.where(forward, -power_ring / power_sun, -power_sun / power_ring)
        rows = at.engaged & analysis.grid.accepted
        name = EFFICIENCY_TOTAL.name
        off = np.abs(analysis.balance.values[name] - true[rows])
        inside["total efficiency"] += (off <= factor * analysis.balance.u(name)).tolist()
    report(f"coverage of 95 % intervals, {campaigns} campaigns", "cases", "inside")
    for name, hits in inside.items():
        told(f"  {name}", hits)


def null_grids(
    campaigns: int, bench: BenchParameters, seed: int, *, drawn: bool = False
) -> Iterator[tuple[Grid, np.random.Generator]]:
    """Grids that the baseline made, rounded like the published ones, each with the generator that drew it.

    The curves are the thesis's, or drawn anew for each grid within their covariance, so that their torques fall
    elsewhere between the steps of the rounding. Readings of a shaft held at rest come from its curve at speed zero, as
    the thesis's fits take them.
    """
    grid = read_published(PUBLISHED, bench)
    analysis = analyse(grid, THESIS_OPTIONS, bench)
    assert analysis.fits is not None
    fits = (analysis.fits.sun, analysis.fits.ring)
    still = np.zeros(len(grid))
    for number in range(campaigns):
        rng = np.random.default_rng([seed, number])
        sun, ring = (
            replace(f.curve, coefficients=rng.multivariate_normal(f.curve.coefficients, f.covariance))
            if drawn
            else f.curve
            for f in fits
        )
        clean = steady(Gearbox.calibrated(bench, LossModel(sun, ring, 0.8, 0.0, 2.22e-4, 0.0)), grid.points)
        torques = (
            np.where(grid.points.neutral & grid.points.rest_sun, sun.torque(still), clean.torque_sun),
            np.where(grid.points.neutral & grid.points.rest_ring, ring.torque(still), clean.torque_ring),
        )
        made = [
            np.round((torque + WANDER * rng.standard_normal(len(grid))) / ROUNDING) * ROUNDING for torque in torques
        ]
        points = replace(grid.points, torque_ring=made[1])
        yield replace(grid, points=points, torque_sun=made[0], torque_ring=made[1]), rng


def published_nulls(campaigns: int) -> None:
    """False alarms of the mismatch test on grids that the baseline made, rounded like the published ones."""
    bench = load_bench()
    alarms = []
    for grid, rng in null_grids(campaigns, bench, 20260104):
        null = analyse(grid, THESIS_OPTIONS, bench)
        assert null.fits is not None
        assert null.floor is not None
        p = find_mismatch(null.grid, null.fits, null.floor, bench, rng, draws=199).p_value
        alarms.append(p <= 0.05)
    report(f"published grids made from the baseline, {campaigns}", "cases", "alarms at 5 %")
    told("  rounded to 0.01 N m", alarms)


def residual_nulls(campaigns: int) -> None:
    """False alarms of `pmg residuals` on such grids, the thesis's curves and drawn ones: covariates and outliers."""
    bench = load_bench()
    for drawn, curves in ((False, "the thesis's curves"), (True, "curves drawn within their errors")):
        alarms: dict[str, list[bool]] = {}
        for grid, rng in null_grids(campaigns, bench, 20260107, drawn=drawn):
            null = analyse(grid, THESIS_OPTIONS, bench)
            seed = int(rng.integers(2**31))
            for name in ("curves", "baseline"):
                study = study_residuals(null, bench, (name,), 199, seed)
                alarms.setdefault(f"{name}: a covariate", []).append(study.p_value <= FALSE_ALARM_RATE)
                stray = any(part.outliers for part in study.parts)
                alarms.setdefault(f"{name}: an outlier", []).append(stray)
        report(f"residuals of rounded grids, {curves}", "cases", "alarms at 5 %")
        for name, hits in alarms.items():
            told(f"  {name}", hits)


def main() -> None:
    """Print the tables."""
    campaigns = int(sys.argv[1]) if len(sys.argv) > 1 else CAMPAIGNS
    coverage(campaigns)
    uncertainty_coverage(campaigns)
    published_nulls(campaigns)
    residual_nulls(campaigns)


if __name__ == "__main__":
    main()
