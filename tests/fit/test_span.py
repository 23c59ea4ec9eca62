"""What columns span: a basis as singular vectors give it, and what is left when it is taken out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.fit.span import orthonormal, taken_out


@given(
    rows=st.integers(1, 60),
    rank=st.integers(1, 12),
    count=st.integers(1, 15),
    seed=st.integers(0, 2**16),
    tenths=st.lists(st.integers(-80, 80), min_size=15, max_size=15),
)
def test_columns_of_any_size_and_rank_are_spanned(
    rows: int, rank: int, count: int, seed: int, tenths: list[int]
) -> None:
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((rows, rank)) @ rng.standard_normal((rank, count))
    scaled = columns * 10.0 ** (0.1 * np.array(tenths[:count]))
    singular = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), compute_uv=False)
    basis = orthonormal(scaled)
    assert basis.shape == (rows, int((singular > 1e-6 * singular[0]).sum()))
    np.testing.assert_allclose(basis.T @ basis, np.eye(basis.shape[1]), atol=1e-12)
    np.testing.assert_allclose(basis @ (basis.T @ columns), columns, atol=1e-5 * float(np.linalg.norm(columns)))
    values = rng.standard_normal(rows)
    left, count_left = taken_out(scaled, values)
    assert count_left == basis.shape[1]
    np.testing.assert_allclose(left, values - basis @ (basis.T @ values), atol=1e-8)


def test_a_direction_below_the_tolerance_is_left_out() -> None:
    one, other = np.eye(4)[:2]
    for off, rank in ((3e-6, 2), (3e-7, 1)):
        columns = np.stack([one, one + off * other], axis=1)
        assert orthonormal(columns).shape == (4, rank)
        assert taken_out(columns, np.ones(4))[1] == rank
    assert orthonormal(np.stack([one, one + 3e-3 * other], axis=1), 1e-2).shape == (4, 1)


@pytest.mark.parametrize("columns", [np.zeros((4, 0)), np.zeros((4, 2)), np.full((4, 1), 1e-200)])
def test_columns_of_nothing_span_nothing(columns: np.ndarray) -> None:
    assert orthonormal(columns).shape == (4, 0)
    left, rank = taken_out(columns, np.ones(4))
    assert rank == 0
    np.testing.assert_array_equal(left, np.ones(4))
