"""A fit is brought to where its last digits are settled, from wherever a search stopped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pmg.pipeline.fit.calibration import jacobian, start_model
from pmg.pipeline.fit.loss_fit import fit_losses
from pmg.pipeline.fit.noise_floor import BASELINE_FREE
from pmg.pipeline.fit.settle import settle, slopes_at
from pmg.pipeline.grid.readings import change, take_readings
from pmg.pipeline.grid.tables import read_published
from pmg.sim.bench import BenchParameters
from pmg.sim.signals import Array

TIME = np.linspace(0.0, 4.0, 60)
NOISE = np.random.default_rng(5).standard_normal(60)
SIZE = np.array([1.0, 1.0, 1.0])
WIDE = np.array([[-10.0, 0.05, -10.0], [10.0, 10.0, 10.0]])


def _residuals(values: Array) -> Array:
    size, rate, offset = values
    return np.asarray(30.0 * np.exp(-0.7 * TIME) + 2.0 + NOISE - 10.0 * (size * np.exp(-rate * TIME) + offset))


def test_two_searches_that_stopped_apart_end_at_one_place() -> None:
    starts = [np.array([2.9, 0.68, 0.25]), np.array([3.1, 0.72, 0.15])]
    one, other = (settle(_residuals, start, SIZE, WIDE) for start in starts)
    assert one.free.all()
    np.testing.assert_allclose(one.values, other.values, rtol=1e-9)
    slopes = slopes_at(_residuals, one, SIZE, WIDE)
    unit = slopes / np.linalg.norm(slopes, axis=0)
    assert np.abs(unit.T @ _residuals(one.values)).max() < 1e-8
    assert one.cost < min(float(_residuals(start) @ _residuals(start)) for start in starts)


def test_a_parameter_beside_its_bound_sits_on_it_and_the_others_settle() -> None:
    bounds = WIDE.copy()
    bounds[1, 1] = 0.5
    held = settle(_residuals, np.array([2.8, 0.49999, 0.1]), SIZE, bounds)
    assert held.values[1] == 0.5
    assert held.free.tolist() == [True, False, True]
    reached = settle(_residuals, np.array([2.8, 0.45, 0.1]), SIZE, bounds)
    np.testing.assert_allclose(reached.values, held.values, rtol=1e-9)


def test_a_direction_that_is_not_determined_is_left_as_it_is() -> None:
    def twice(values: Array) -> Array:
        return np.asarray(NOISE - (values[0] + values[1]))

    found = settle(twice, np.array([0.3, 0.1]), SIZE[:2], WIDE[:, [0, 2]])
    assert found.values.sum() == pytest.approx(NOISE.mean(), rel=1e-9)
    assert found.values[0] - found.values[1] == pytest.approx(0.2, rel=1e-9)


def test_a_parameter_without_effect_takes_its_usual_size() -> None:
    def one(values: Array) -> Array:
        return np.asarray(NOISE - values[0])

    assert settle(one, np.array([0.3, 0.1, 7.0]), SIZE, WIDE).values[1:].tolist() == [1.0, 1.0]


@pytest.mark.parametrize("start", [9e-5, 1.1e-4, 0.2])
def test_a_minimum_beside_a_bound_is_on_it_wherever_the_search_stopped(start: float) -> None:
    def one(values: Array) -> Array:
        return np.asarray(NOISE - NOISE.mean() + 3.0 * (values[0] - 6e-5))

    found = settle(one, np.array([start]), np.ones(1), np.array([[0.0], [5.0]]))
    assert (found.values[0], found.free[0]) == (0.0, False)


def test_where_newton_leads_uphill_the_search_is_kept() -> None:
    def dent(values: Array) -> Array:
        return np.array([3.0 * np.tanh(8.0 * values[0])])

    start = np.array([0.2])
    assert settle(dent, start, SIZE[:1], np.array([[-10.0], [10.0]])).values == start


def test_rounding_of_a_simulated_reading_is_no_change() -> None:
    before = np.array([0.1, 0.7, 3.0])
    after = np.array([0.1 + 2e-17, np.nextafter(0.7, 1.0), 3.0 + 1e-12])
    assert change(after, before)[:2].tolist() == [0.0, 0.0]
    assert change(after, before)[2] == pytest.approx(1e-12, rel=1e-3)


def test_the_correction_factor_touches_no_ring_reading(published_folder: Path, bench: BenchParameters) -> None:
    """Its rounding there, brought to unit length beside other columns, would be a direction of the processor's own."""
    grid = read_published(published_folder, bench)
    readings = take_readings(grid, bench)
    slopes = jacobian(readings, bench, start_model(fit_losses(grid)), BASELINE_FREE)
    touched = slopes[:, slopes.shape[1] - len(BASELINE_FREE) + BASELINE_FREE.index("K_corr")]
    assert (touched[~readings.sun] == 0.0).all()
    assert np.abs(touched[readings.sun]).max() > 0.01
