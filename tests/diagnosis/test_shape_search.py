"""Shapes of laws of known size: narrow hills beside wide ones are found from few tabled shapes."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.diagnosis.engine.shape_search import BETWEEN, FEWEST, HILLS, best_shape, hills
from pmg.sim.signals import Array

SHAPES = np.geomspace(1e-3, 0.1, 8)
TIME = np.linspace(0.0, 3.0, 900)
SLOPE = np.cos(TIME)


def _later(delay: float) -> Array:
    """A wave less itself that much later."""
    return np.asarray(np.sin(40.0 * TIME) - np.sin(40.0 * (TIME - delay)) + 0.1 * SLOPE * delay)


def _tabled(seen: float, size: float) -> tuple[Array, Array]:
    """Columns of that law at the tabled shapes, and rows that show it at one of them."""
    return size * np.stack([_later(float(shape)) for shape in SHAPES], axis=1), size * _later(seen)


@given(st.floats(8e-3, 0.07), st.floats(30.0, 1e3))
def test_a_narrow_hill_between_tabled_shapes_is_found(seen: float, size: float) -> None:
    columns, rows = _tabled(seen, size)
    gains = np.array([2.0 * rows @ column - column @ column for column in columns.T])
    tops = hills(columns, rows, SHAPES)
    assert 1 <= len(tops) <= HILLS
    assert [gain for _, gain in tops] == sorted((gain for _, gain in tops), reverse=True)

    def gain_of(shape: float) -> float:
        column = size * _later(shape)
        return float(2.0 * rows @ column - column @ column)

    reached, gain = max((best_shape(gain_of, SHAPES, gains, start) for start, _ in tops), key=lambda each: each[1])
    assert abs(reached / seen - 1.0) < 0.02
    assert gain > (1.0 - 1e-3) * float(rows @ rows)


@given(st.integers(0, len(SHAPES) - 1))
def test_a_spline_goes_through_tabled_shapes(place: int) -> None:
    columns, rows = _tabled(float(SHAPES[place]), 1.0)
    shape, gain = hills(columns, rows, SHAPES)[0]
    step = np.log(SHAPES[1] / SHAPES[0])
    assert abs(np.log(shape / SHAPES[place])) <= 1.001 * step / BETWEEN
    assert gain >= float(rows @ rows) * (1.0 - 1e-9)


def test_too_few_tabled_shapes_promise_nothing() -> None:
    columns, rows = _tabled(0.01, 1.0)
    few = FEWEST - 1
    assert hills(columns[:, :few], rows, SHAPES[:few]) == []
