"""Synthetic noise of rows in motion: steps of the encoders in place of the white noise that they are thought to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.diagnosis.test_wander import _noise

from pmg.pipeline.diagnosis.motion.compressed import Compressed
from pmg.pipeline.diagnosis.motion.families import CURVE_KNOTS, _bent, _curve
from pmg.pipeline.diagnosis.motion.noise.synthetic import synthetic_noise
from pmg.sim.signals import Array

ROWS = 6


def _part(of_angles: Array, of_steps: Array, run: str = "a") -> Compressed:
    none = np.zeros((ROWS, 0))
    return Compressed(
        run=run,
        y=np.zeros(ROWS),
        left=np.zeros(ROWS),
        constants=none,
        structures={},
        candidates={},
        row_weights=np.eye(ROWS),
        of_wander=np.zeros((ROWS, 4)),
        of_angles=of_angles,
        of_steps=of_steps,
        unexplained=1.0,
    )


def test_steps_take_the_place_of_the_noise_of_the_angles() -> None:
    rng = np.random.default_rng(3)
    root = 0.15 * rng.standard_normal((ROWS, ROWS))
    steps = np.zeros((ROWS, 8))
    steps[2] = 3.0
    noise = [_noise("sun", np.arange(4.0))]
    found = [synthetic_noise([_part(root @ root.T, steps)], noise, np.random.default_rng(k)) for k in range(40)]
    covariance = np.cov(np.hstack(found))
    expected = np.eye(ROWS) - root @ root.T
    expected[2, 2] += 9.0
    assert np.abs(covariance - expected).max() < 0.3
    assert np.abs(np.hstack(found).mean(axis=1)).max() < 0.12


def test_both_balances_of_a_run_have_the_same_steps_and_those_of_another_run_their_own() -> None:
    steps = 50.0 * np.ones((ROWS, 8)) * np.linspace(1.0, 2.0, 8)
    parts = [_part(np.zeros((ROWS, ROWS)), steps, run) for run in ("a", "a", "b")]
    noise = [_noise("sun", np.arange(4.0)), _noise("ring", np.arange(4.0)), _noise("sun", 90.0 + np.arange(4.0))]
    found = synthetic_noise(parts, noise, np.random.default_rng(1))
    sun, ring, other = found[0], found[ROWS], found[2 * ROWS]
    assert np.corrcoef(sun, ring)[0, 1] > 0.99
    assert abs(np.corrcoef(sun, other)[0, 1]) < 0.2


@given(st.integers(1, 40), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_noise_of_angles_in_sums_of_rows_is_that_of_its_whole_covariance(n: int, width: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    band = rng.standard_normal((width, n))
    steps, weights = rng.standard_normal((n, 2)), rng.standard_normal((n, 3))
    whole = sum((np.diag(band[later, : n - later], later) for later in range(min(width, n))), start=np.zeros((n, n)))
    whole = whole + np.triu(whole, 1).T + steps @ steps.T
    noise = replace(_noise("sun", np.arange(float(n))), of_angles=band, quantisation=steps)
    np.testing.assert_allclose(noise.covariance_of_angles(weights), weights.T @ whole @ weights, atol=1e-9)


def test_what_bends_over_a_covariate_is_a_curve_without_a_straight_line() -> None:
    x = np.linspace(-1.0, 1.0, 301)
    bent, whole = _bent(x, 1.0), _curve(x, 1.0)
    assert bent.shape == (301, CURVE_KNOTS - 1)

    def left(columns: Array, values: Array) -> float:
        coefficients, *_ = np.linalg.lstsq(columns, values, rcond=None)
        return float(np.linalg.norm(values - columns @ coefficients) / np.linalg.norm(values))

    assert left(bent, x) > 0.2
    assert left(bent, np.ones(301)) < 1e-9
    assert left(bent, np.abs(x)) < 0.02
    assert np.linalg.matrix_rank(np.column_stack([bent, x])) == np.linalg.matrix_rank(whole)
    assert left(np.column_stack([bent, x]), whole[:, 1]) == pytest.approx(0.0, abs=1e-9)
