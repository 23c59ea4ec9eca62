"""Withheld runs in motion: rows are predicted though no other run tells at which pole angle one begins."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.diagnosis.motion.withheld import Starts


@given(st.integers(2, 12), st.integers(2, 12), st.integers(0, 99))
def test_a_run_keeps_all_but_what_its_angle_does(first: int, second: int, seed: int) -> None:
    """What is left of rows is what is left beside free angles: no length is lost but along them."""
    rng = np.random.default_rng(seed)
    angles = np.zeros((first + second + 1, 3))  # the last of no run, and one angle that acts on nothing
    angles[:first, 0], angles[first : first + second, 1] = rng.standard_normal(first), rng.standard_normal(second)
    columns = rng.standard_normal((len(angles), 4))
    starts = Starts.of(angles)
    found = starts.freed(columns)
    assert not found[starts.first].any()
    np.testing.assert_allclose(starts.freed(angles), 0.0, atol=1e-12)
    basis = np.linalg.qr(angles[:, :2])[0]
    beside = columns - basis @ (basis.T @ columns)
    np.testing.assert_allclose(found.T @ found, beside.T @ beside, atol=1e-10)
    np.testing.assert_array_equal(found[-1], columns[-1])
    np.testing.assert_allclose(starts.freed(columns[:, 0]), found[:, 0], atol=1e-12)
