"""Repeats and order: calibrated where nothing drifts, planted differences and drifts found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from tests.points import measured, points

from pmg.pipeline.fit.drift import _monotone_runs, find_drift
from pmg.pipeline.grid.tables import read_published
from pmg.sim.bench import BenchParameters
from pmg.sim.grid import Grid
from pmg.sim.signals import HOUR, Array

UP = np.linspace(150.0, 1800.0, 12)
SUN = np.r_[UP, UP[::-1]]
RING = np.full(24, 200.0)
TIME = np.asarray(60.0 * np.arange(24) + 1.7e9, dtype=np.float64)


def drawn(rng: np.random.Generator, extra: Array | float = 0.0) -> Grid:
    at = points("neutral", SUN, RING, started_at=TIME)
    noise = 1e-3 * rng.standard_normal((2, 24))
    return measured(at, 0.02 + 0.1 * SUN / 1872.0 + extra + noise[0], 0.1 + noise[1])


def test_p_values_are_uniform_where_nothing_changes(rng: np.random.Generator, bench: BenchParameters) -> None:
    mean, slope, repeats = [], [], []
    for _ in range(200):
        drift = find_drift(drawn(rng), bench)
        mean.append(drift.orders[0].mean_p)
        slope.append(drift.orders[0].slope_p)
        repeats.append(next(repeat.p for repeat in drift.repeats if repeat.shaft == "sun"))
    for name, values in (("mean", mean), ("slope", slope), ("repeats", repeats)):
        assert stats.kstest(values, "uniform").pvalue > 1e-3, name


def test_intervals_of_the_mean_difference_cover(rng: np.random.Generator, bench: BenchParameters) -> None:
    inside = 0
    for _ in range(500):
        order = find_drift(drawn(rng, np.r_[np.zeros(12), np.full(12, -0.003)]), bench).orders[0]
        inside += abs(order.mean + 0.003) < stats.t.ppf(0.975, len(order.difference) - 1) * order.mean_u
    assert 0.93 <= inside / 500 <= 0.97


def test_cold_rising_and_hot_falling_runs_are_told_apart(rng: np.random.Generator, bench: BenchParameters) -> None:
    warm = -0.01 * SUN / 1800.0 * (np.arange(24) >= 12)
    drift = find_drift(drawn(rng, warm), bench)
    (order,) = drift.orders
    assert order.shaft == "sun"
    assert len(order.difference) == 11  # the reading at the turn belongs to neither run
    assert order.hours == pytest.approx(np.mean((2 * np.arange(1, 12) + 1) * 60.0) / HOUR)
    assert order.mean == pytest.approx(-0.01 * UP[:11].mean() / 1800.0, abs=4.0 * order.mean_u + 1e-3)
    assert order.mean_p < 1e-3
    assert order.slope_p < 1e-3
    assert order.slope < 0.0


def test_a_drift_of_repeats_has_its_slope(rng: np.random.Generator, bench: BenchParameters) -> None:
    rate = 0.02 / HOUR
    drift = find_drift(drawn(rng, rate * (TIME - TIME[0])), bench)
    sun, ring = drift.repeats
    assert (sun.shaft, ring.shaft) == ("sun", "ring")
    assert abs(sun.slope - rate) < 4.0 * sun.slope_u
    assert sun.p < 1e-3
    assert ring.p > 1e-3
    assert (sun.dof, ring.dof) == (11, 11)
    assert sun.hours == pytest.approx(23 * 60.0 / HOUR)


def test_drag_of_reversed_rotation_drifts_with_the_same_sign(rng: np.random.Generator, bench: BenchParameters) -> None:
    at = points("neutral", np.full(12, -600.0), np.full(12, 200.0), started_at=TIME[:12])
    grid = measured(at, -(0.05 + 1e-6 * (TIME[:12] - TIME[0])), 0.1 + 1e-6 * rng.standard_normal(12))
    assert find_drift(grid, bench).repeats[0].slope == pytest.approx(1e-6)


def test_runs_never_turn_back_and_pass_five_speeds() -> None:
    levels = np.array([1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 4.0, 3.0, 2.0, 6.0, 5.0, 4.0, 3.0, 2.0])
    assert _monotone_runs(levels, rising=True) == [(0, 6)]
    assert _monotone_runs(levels, rising=False) == [(9, 14)]
    assert _monotone_runs(np.zeros(0), rising=True) == []


def test_one_direction_or_no_order_gives_one_sentence(
    rng: np.random.Generator, bench: BenchParameters, published_folder: Path
) -> None:
    rising = find_drift(drawn(rng)[np.arange(24) < 12], bench)
    assert rising.orders == ()
    assert find_drift(read_published(published_folder, bench), bench).reason.startswith("The order")
