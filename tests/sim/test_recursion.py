"""A first-order memory is the loop over its steps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.sim.recursion import remembered


@pytest.mark.parametrize("columns", [(), (3,)])
@given(st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_each_value_keeps_a_part_of_the_one_before(columns: tuple[int, ...], length: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    keep, news = rng.uniform(-1.0, 1.0, length - 1), rng.standard_normal((length, *columns))
    values = [news[0]]
    for part, new in zip(keep, news[1:], strict=True):
        values.append(part * values[-1] + new)
    np.testing.assert_allclose(remembered(keep, news), values, rtol=1e-12, atol=1e-12)
