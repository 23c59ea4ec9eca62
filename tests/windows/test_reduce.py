"""Means of a window and what they are uncertain by."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal, stats

from pmg.pipeline.windows.reduce import (
    FLAGGED_BY_CHANCE,
    TOGETHER,
    _low_passed_std,
    _reduce_shaft,
    end_to_end_speed,
    low_pass,
)
from pmg.pipeline.windows.revolutions import batch_means
from pmg.sim.signals import RPM

RATE = 500.0
N = 2500
T = np.arange(N) / RATE


def turning(speed_rpm: float, n: int = N) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Angle read by an encoder of 5120 counts."""
    counts = np.floor(speed_rpm * RPM * np.arange(n) / RATE * 5120 / (2 * math.pi))
    return np.asarray(counts / 5120 * 2 * math.pi)


@given(
    level=st.floats(-10.0, 10.0),
    noise=st.lists(st.floats(-1.0, 1.0), min_size=20, max_size=201),
    cutoff=st.floats(0.01, 100.0),
)
def test_the_filter_leaves_the_mean_untouched(level: float, noise: list[float], cutoff: float) -> None:
    x = level + np.array(noise)
    assert low_pass(x, RATE, cutoff).mean() == pytest.approx(x.mean(), abs=1e-13)


@given(level=st.floats(-10.0, 10.0), n=st.integers(2, 300))
def test_the_filter_leaves_a_constant_untouched(level: float, n: int) -> None:
    np.testing.assert_allclose(low_pass(np.full(n, level), RATE, 0.5), level, atol=1e-14)


@pytest.mark.parametrize("n", [2, 3, 30, 31, TOGETHER, 2 * TOGETHER + 1])
@pytest.mark.parametrize("cutoff", [0.01, 1.0, 60.0, RATE / 2.0])
def test_the_scatter_below_the_cut_off_is_that_of_the_filtered_signal(
    n: int, cutoff: float, rng: np.random.Generator
) -> None:
    x = 3.0 + rng.standard_normal(n)
    assert _low_passed_std(x, RATE, cutoff) == pytest.approx(
        low_pass(x, RATE, cutoff).std(ddof=1), rel=1e-11, abs=1e-14
    )


def test_the_filter_takes_ripple_away_and_keeps_what_is_slow() -> None:
    slow = 0.1 * np.cos(2 * math.pi * 0.4 * T)
    np.testing.assert_allclose(low_pass(1.0 + np.sin(2 * math.pi * 10 * T), RATE, 0.5), 1.0, atol=1e-12)
    np.testing.assert_allclose(low_pass(slow + 0.5 * np.sin(2 * math.pi * 10 * T), RATE, 0.5), slow, atol=1e-12)


@given(level=st.floats(-10.0, 10.0), n=st.integers(2, 300))
def test_a_torque_that_does_not_vary_has_no_known_uncertainty(level: float, n: int) -> None:
    """The rounding of its sums, 1e-15 N m, is none."""
    found = _reduce_shaft(np.full(n, level), turning(600.0, n), RATE)
    assert found.torque == pytest.approx(level, abs=1e-12)
    assert math.isnan(found.within)
    assert found.dof == 0.0
    assert math.isnan(found.resolution)
    rounded = _reduce_shaft(level + 1e-15 * np.arange(float(n)), turning(600.0, n), RATE)
    assert math.isnan(rounded.within)


def test_a_torque_of_little_noise_keeps_its_uncertainty() -> None:
    noise = np.random.default_rng(3).normal(0.0, 1e-9, N)
    assert 0.0 < _reduce_shaft(1.0 + noise, turning(600.0), RATE).within < 1e-9


@given(speed=st.floats(-2000.0, 2000.0))
def test_speed_from_end_to_end_is_right_to_one_count(speed: float) -> None:
    one_count = 60.0 / 5120 / T[-1] * (1 + 1e-9)
    assert end_to_end_speed(turning(speed), RATE) / RPM == pytest.approx(speed, abs=one_count)


@pytest.mark.parametrize("speed", [91.0, -117.0, 156.0, 600.0, 1872.0])
def test_ripple_of_once_per_revolution_does_not_count_as_noise(speed: float) -> None:
    angle = turning(speed)
    noise = np.random.default_rng(3).normal(0.0, 0.01, N)
    clean = _reduce_shaft(1.0 + noise, angle, RATE)
    rippled = _reduce_shaft(1.0 + noise + 0.2 * np.sin(speed * RPM * T), angle, RATE)
    assert rippled.revolutions_per_batch >= 1
    assert rippled.within == pytest.approx(clean.within, rel=0.25)


@pytest.mark.parametrize(
    ("speed", "batches", "revolutions"), [(0.0, 10, 0), (50.0, 10, 0), (700.0, 9, 6), (720.0, 10, 6)]
)
def test_batches_are_whole_revolutions_where_enough_fit(speed: float, batches: int, revolutions: int) -> None:
    found = batch_means(np.ones(N), turning(speed))
    assert (len(found.means), found.revolutions) == (batches, revolutions)
    np.testing.assert_allclose(found.means, 1.0, rtol=1e-12)
    if revolutions:
        assert found.length * len(found.means) >= 0.9 * N
        assert found.length == pytest.approx(found.revolutions * 60 / speed * RATE, rel=1e-3)


@pytest.mark.parametrize("correlation_s", [0.0, 0.02])
@pytest.mark.parametrize("speed", [0.0, 300.0])
def test_the_uncertainty_covers_the_truth_as_often_as_it_says(
    correlation_s: float, speed: float, rng: np.random.Generator
) -> None:
    """95 % intervals from Student's t over 500 runs; ripple only where the shaft turns.

    With 500 runs, the fraction scatters by 1 %; correlation of a tenth of a batch length costs 1 % more.
    """
    angle = turning(speed)
    keep = math.exp(-1.0 / (RATE * correlation_s)) if correlation_s else 0.0
    ripple = 0.05 * np.sin(speed * RPM * T) if speed else 0.0
    held, naive = 0, 0
    for _ in range(500):
        white = rng.normal(0.0, 0.01, N + 500)
        noise = signal.lfilter([1.0], [1.0, -keep], white)[500:]
        found = _reduce_shaft(2.0 + noise + ripple, angle, RATE)
        held += abs(found.torque - 2.0) < stats.t.ppf(0.975, found.dof) * found.within
        naive += abs(found.torque - 2.0) < 1.96 * noise.std() / math.sqrt(N)
    assert 0.92 <= held / 500 <= 0.98
    if correlation_s:
        assert naive / 500 < 0.5


@pytest.mark.parametrize("correlation_s", [0.005, 0.02])
def test_the_correlation_time_is_that_of_the_noise(correlation_s: float, rng: np.random.Generator) -> None:
    """The median of many windows, since each one knows its own only to about 30 %."""
    keep = math.exp(-1.0 / (RATE * correlation_s))
    noise = signal.lfilter([1.0], [1.0, -keep], rng.normal(0.0, 1.0, (200, N + 500)), axis=1)[:, 500:]
    found = [_reduce_shaft(row, np.zeros(N), RATE).correlation_time for row in noise]
    assert np.median(found) == pytest.approx(correlation_s, rel=0.2)


def test_a_gap_leaves_mean_and_speed_and_no_uncertainty() -> None:
    torque, angle = np.full(N, 0.7), turning(600.0)
    torque[100:200] = np.nan
    angle[300:400] = np.nan
    found = _reduce_shaft(torque, angle, RATE)
    assert found.torque == pytest.approx(0.7)
    assert found.speed / RPM == pytest.approx(600.0, abs=0.01)
    assert math.isnan(found.within)
    assert math.isnan(found.std_filtered)


def test_nothing_gives_nothing() -> None:
    found = _reduce_shaft(np.empty(0), np.empty(0), RATE)
    assert math.isnan(found.torque)
    assert math.isnan(found.speed)
    assert found.dof == 0


def test_flat_noise_is_flagged_as_slow_as_often_as_is_stated() -> None:
    rng, rate = np.random.default_rng(20261201), 1000.0
    time = np.arange(2500) / rate
    found = (_reduce_shaft(rng.normal(0.0, 5e-3, 2500), rng.uniform(5.0, 190.0) * time, rate) for _ in range(1000))
    flagged = sum(means.correlated for means in found)
    low, high = stats.binom.interval(0.99, 1000, FLAGGED_BY_CHANCE)
    assert low <= flagged <= high
