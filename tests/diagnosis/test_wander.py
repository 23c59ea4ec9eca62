"""The wander of a reading: means of it, what it does between runs, and what synthetic campaigns draw of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import cholesky_banded

from pmg.pipeline.diagnosis.motion.noise import shown
from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise, SlowNoise, between_runs, wander_at_knots
from pmg.pipeline.diagnosis.motion.noise.shown import PIECE, SIZES, slow_noise_of
from pmg.pipeline.diagnosis.motion.noise.wander import TIMES, Wander, draw_wander, of_means
from pmg.pipeline.motion.banded import BandedFactor
from pmg.sim.shafts import PerShaft

WANDER = Wander(np.array([[1.0, 0.0, 0.0, 0.5], [0.0, 4.0, 0.2, 0.0]]), np.array([0.25, 0.75]))
"""One of two cases [(mN m)2]."""


def _noise(side: str, knots: np.ndarray) -> RowNoise:
    """Noise of a stretch whose rows are its knots."""
    n = len(knots)
    factor = BandedFactor.of(cholesky_banded(np.ones((1, n)), lower=True))
    slow = SlowNoise(PerShaft(WANDER, Wander.of(2.0)))
    none = np.zeros((n, 0))
    return RowNoise(factor, none, np.zeros(0), 0.0, side, slow, none, knots, np.eye(n), np.zeros((1, n)))


@given(st.floats(0.3, 5.0), st.floats(0.5, 200.0), st.integers(0, 30))
@settings(max_examples=40)
def test_means_of_a_wander_are_as_the_average_of_its_instants(length: float, time: float, apart: int) -> None:
    within = length * (np.arange(400) + 0.5) / 400
    when = np.concatenate([within, (1 + apart) * length + within])
    whole = np.exp(-np.abs(when[:, None] - when) / time)
    averaged = whole.reshape(2, 400, 2, 400).mean(axis=(1, 3))
    np.testing.assert_allclose(of_means(np.array([0.0, (1 + apart) * length]), length, time), averaged, rtol=1e-3)


def test_what_runs_wander_together_is_the_whole_less_that_of_each() -> None:
    rng = np.random.default_rng(1)
    knots = [start + np.arange(4.0) for start in (0.0, 20.0, 22.0, 90.0)]
    noise = [_noise(side, when) for side, when in zip(("sun", "ring", "sun", "sun"), knots, strict=True)]
    seen = [rng.standard_normal((3, 4)) for _ in noise]
    expected = np.zeros((3, 3))
    for one in range(len(noise)):
        for other in range(len(noise)):
            if one != other and noise[one].side == noise[other].side:
                between = noise[one].wander.covariance(np.concatenate([knots[one], knots[other]]))[:4, 4:]
                expected += seen[one] @ between @ seen[other].T
    np.testing.assert_allclose(between_runs(noise, seen), expected, atol=1e-12)


def test_synthetic_campaigns_wander_as_is_thought_likely() -> None:
    """Their covariance, within a run and between two, is the expected one; sides have nothing to do with each other."""
    knots = [np.arange(3.0), 4.0 + np.arange(3.0), np.arange(3.0)]
    noise = [_noise(side, when) for side, when in zip(("sun", "sun", "ring"), knots, strict=True)]
    drawn = np.vstack(wander_at_knots(noise, np.random.default_rng(2), 40000))
    expected = np.zeros((9, 9))
    expected[:6, :6] = WANDER.covariance(np.concatenate(knots[:2]))
    expected[6:, 6:] = noise[2].wander.covariance(knots[2])
    np.testing.assert_allclose(drawn @ drawn.T / drawn.shape[1], expected, atol=0.15)
    kurtosis = float(np.mean(drawn[0] ** 4) / np.mean(drawn[0] ** 2) ** 2)
    assert kurtosis == pytest.approx(3.0 * (0.25 * 1.5**2 + 0.75 * 4.2**2) / expected[0, 0] ** 2, abs=0.2)


def test_a_wander_has_the_size_of_its_expected_parts() -> None:
    assert WANDER.size == pytest.approx(np.sqrt(0.25 * 1.5 + 0.75 * 4.2))
    assert WANDER.fastest == TIMES[1]
    assert Wander.of(3.0).covariance(np.zeros(1))[0, 0] == pytest.approx(9.0)
    assert draw_wander(WANDER, np.arange(2.0), np.random.default_rng(0), 5).shape == (2, 5)


@pytest.mark.parametrize(("size", "time"), [(1e-3, 3.0), (3e-3, 40.0), (8e-3, 1.0)])
def test_a_campaign_tells_its_wander_beside_what_may_explain_it(size: float, time: float) -> None:
    """Over many campaigns, the variance of a mean over 30 s; a trend beside it is no wander.

    Of a fast wander 12 runs do not rule out that a part is slow, so that up to twice as much is expected.
    """
    rng, when = np.random.default_rng(3), np.concatenate([60.0 * k + PIECE * np.arange(12.0) for k in range(12)])
    planted = size**2 * of_means(when, PIECE, time)
    known = (3e-4) ** 2 * np.eye(len(when))
    columns = np.stack([np.ones(len(when)), when, when**2], 1)
    over = np.arange(30.0)
    true = float(np.mean(size**2 * np.exp(-np.abs(over[:, None] - over) / time)))
    ratios = []
    for _ in range(30):
        off = np.linalg.cholesky(planted + known) @ rng.standard_normal(len(when)) + 0.05 * (when / 700.0) ** 2
        wander = shown._wander([shown._Means(when, off, columns, known)])
        ratios.append(float(wander.covariance(over).mean()) / true)
    assert 0.7 < float(np.median(ratios)) < (1.5 if time > 10.0 else 2.5)


def test_nothing_seen_leaves_what_is_usual() -> None:
    found = slow_noise_of((), [], [], [])
    assert found.wander.sun.size == found.wander.ring.size == SlowNoise().wander.sun.size
    few = shown._Means(np.arange(2.0), np.zeros(2), np.eye(2), np.eye(2))
    assert shown._wander([few]) is shown.USUAL_WANDER
    assert np.exp(SIZES[0]) < 0.5 < 5.0 < np.exp(SIZES[-1])
    assert replace(WANDER, times=(1.0, 2.0, 3.0, 4.0)).fastest == 2.0
