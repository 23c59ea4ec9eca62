"""Uncertainty of means: what repeats, zero checks and neighbours say beyond the window, and where nothing says it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.bench.coverage import NATURE, few_points, means_held, small_campaign
from tests.points import joined, measured

from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.noise import DRIFTED
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.sim.bench import load_bench
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

BENCH = load_bench()
NOISE = 4e-3
"""Standard deviation of the error of a mean [N m]."""


@pytest.mark.parametrize(("repeats", "zeros"), [(0, 0), (4, 3)])
@pytest.mark.parametrize("shown", [1.0, 0.5])
def test_intervals_of_means_hold_the_truth_however_little_a_window_shows_of_its_error(
    repeats: int, zeros: int, shown: float, rng: np.random.Generator
) -> None:
    """A window shows half of it where noise grows to low frequencies; repeats and neighbours show the rest."""
    true = steady(Gearbox.calibrated(BENCH, NATURE), few_points(repeats, zeros))
    shape, held = (2, len(true)), []
    for _ in range(25):
        within = shown * NOISE * np.sqrt(rng.chisquare(9, shape) / 9)
        held.append(means_held(true, NOISE * rng.standard_normal(shape), within, rng)[0])
    assert 0.93 <= np.mean(held) <= 0.985


def test_repeats_that_differ_by_more_than_neighbours_are_a_drift_of_the_bench(rng: np.random.Generator) -> None:
    many = small_campaign()
    true = steady(Gearbox.calibrated(BENCH, NATURE), joined(many, many[np.arange(0, 56, 8)]))
    later = 5.0 * NOISE * (np.arange(len(true)) >= len(many))
    sun, ring = (t + later + NOISE * rng.standard_normal(len(true)) for t in (true.torque_sun, true.torque_ring))
    floor = analyse(measured(true.points, sun, ring, NOISE), AnalysisOptions(), BENCH).floor
    assert floor is not None
    assert all(noise.source == DRIFTED and noise.repeats > 2.0 * noise.u for noise in floor)
