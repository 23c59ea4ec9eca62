from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.nature import Nature, campaign_points, measure

from pmg.pipeline.analysis.comparison import Residuals, compare
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.completeness import holes
from pmg.pipeline.grid.levels import speed_levels
from pmg.sim.bench import BenchParameters
from pmg.sim.grid import Grid
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady


def compared(grid: Grid, bench: BenchParameters) -> Residuals:
    analysis = analyse(grid, AnalysisOptions(), bench)
    assert analysis.calibration is not None
    simulated = steady(Gearbox.calibrated(bench, analysis.calibration.model), analysis.grid.points)
    return compare(analysis.grid, simulated, bench, analysis.calibration)


def test_a_clean_campaign_agrees_within_u_as_often_as_stated(bench: BenchParameters, rng: np.random.Generator) -> None:
    inside: list[bool] = []
    for _ in range(6):
        residuals = compared(measure(Nature(), campaign_points("random", rng), rng)[0], bench)
        for difference in (residuals.torque_sun, residuals.torque_ring, residuals.loss_total):
            inside += list(difference.within[difference.compared])
    assert 0.92 < np.mean(inside) < 0.98


def test_what_the_bench_holds_or_gives_as_input_is_not_compared(
    bench: BenchParameters, rng: np.random.Generator
) -> None:
    residuals = compared(measure(Nature(), campaign_points("random", rng), rng)[0], bench)
    at = residuals.grid.points
    assert not residuals.torque_sun.compared[at.neutral & at.rest_sun].any()
    assert not residuals.torque_ring.compared[at.engaged].any()
    assert residuals.torque_sun.compared[at.engaged].all()
    assert not residuals.efficiency_total.compared[~at.engaged].any()


def test_loss_and_efficiency_differences_are_those_of_the_torque(
    bench: BenchParameters, rng: np.random.Generator
) -> None:
    residuals = compared(measure(Nature(), campaign_points("random", rng), rng)[0], bench)
    at, known = residuals.grid.points, residuals.loss_total.compared
    expected = (residuals.torque_sun.value * at.speed_sun)[known]
    np.testing.assert_allclose(residuals.loss_total.value[known], expected, atol=1e-12)
    ratio = residuals.efficiency_total.u[known] / np.abs(residuals.efficiency_total.simulated[known])
    forward = (at.drive == "sun")[known]
    relative = residuals.torque_sun.u[known] / np.abs(residuals.simulated.torque_sun[known])
    np.testing.assert_allclose(ratio[forward], relative[forward], rtol=1e-9)


def test_a_missing_cell_of_either_grid_is_named(bench: BenchParameters, rng: np.random.Generator) -> None:
    grid, _, _ = measure(Nature(), campaign_points("random", rng), rng)
    assert holes(grid) == ()
    at = grid.points
    sun, ring = np.round(at.speed_sun * 30 / np.pi), np.round(at.speed_ring * 30 / np.pi)
    gone = (at.neutral & (sun == 936) & (ring == 240)) | (at.engaged & (sun == 1248) & (at.load_set == 1.56))
    assert holes(replace(grid, accepted=~gone)) == (
        "neutral, sun 936 rpm, ring 240 rpm",
        "engaged, sun 1248 rpm, load 1.56 N m",
    )


def test_speeds_met_only_nearly_are_one_level(rng: np.random.Generator) -> None:
    grid, _, _ = measure(Nature(), campaign_points("random", rng), rng)
    at = grid.points
    sun, ring = (speed * (1.0 + rng.uniform(-4e-4, 4e-4, len(at))) for speed in (at.speed_sun, at.speed_ring))
    assert len(np.unique(np.round(sun * 30 / np.pi))) > len(np.unique(np.round(at.speed_sun * 30 / np.pi)))
    assert holes(replace(grid, points=replace(at, speed_sun=sun, speed_ring=ring))) == ()
    steps = replace(at, speed_sun=np.arange(len(at)) * np.pi / 30)
    np.testing.assert_array_equal(speed_levels(steps)[0], np.arange(len(at)))


@pytest.mark.parametrize("kept", ["neutral", "engaged", "zero"])
def test_half_a_campaign_is_analysed_as_far_as_it_reaches(
    kept: str, bench: BenchParameters, rng: np.random.Generator
) -> None:
    grid, _, _ = measure(Nature(), campaign_points("random", rng), rng)
    analysis = analyse(grid[np.asarray(grid.points.configuration == kept)], AnalysisOptions(), bench)
    assert analysis.calibration is None
    assert len(analysis.missing) == 1
    assert (analysis.fits is not None) == (kept == "neutral")
    assert not analysis.complete
