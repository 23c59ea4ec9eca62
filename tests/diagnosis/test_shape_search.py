"""Shapes of laws of known size: narrow hills beside wide ones are found from few tabled shapes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue
from pmg.pipeline.diagnosis.balance.fitting import Tabled, TermProblem, fit_term, promised
from pmg.pipeline.diagnosis.engine.shape_search import BETWEEN, FEWEST_TABLED, HILLS, best_shape, hills
from pmg.pipeline.diagnosis.motion.candidates.library import library
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
@example(0.0393242, 957.607)
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
    few = FEWEST_TABLED - 1
    assert hills(columns[:, :few], rows, SHAPES[:few]) == []


def test_another_hill_than_that_of_the_best_tabled_shape_is_climbed() -> None:
    """What constants take up of a delay leaves a hill of its own, which the tabled shapes may prefer."""
    wave = 120.0
    baseline = (np.cos(wave * TIME) / np.linalg.norm(np.cos(wave * TIME)))[:, None]
    term = next(term for term in library() if term.key == "channel_delay/sun/")
    assert term.shape is not None
    shapes, seen = np.geomspace(*term.shape.bounds, 8), 0.045

    def columns_of(_: object, shape: float) -> Array:
        return np.asarray(100.0 * (np.sin(wave * TIME) - np.sin(wave * (TIME - shape))))[:, None]

    table = Tabled(term, shapes, np.stack([columns_of(term, float(shape)) for shape in shapes], axis=1))
    rows = columns_of(term, seen)[:, 0]
    problem = TermProblem(baseline, rows - baseline @ (baseline.T @ rows), columns_of, {term.key: table})
    by_grid = fit_term(problem, term, refine=False)
    assert by_grid.gain < 0.85 * promised(problem, term)
    assert by_grid.shape < 0.5 * seen
    assert fit_term(problem, term).shape == pytest.approx(seen, rel=1e-3)
    (ranked,) = TermCatalogue().rank(problem)
    assert ranked.shape == pytest.approx(seen, rel=1e-3)


@pytest.mark.parametrize("delay", [0.0365, 0.0375, 0.0385, 0.0391, 0.0395, 0.045])
def test_a_delay_between_the_last_two_tabled_shapes_is_found(delay: float) -> None:
    term = next(term for term in library() if term.key == "channel_delay/sun/")
    assert term.shape is not None
    shapes = np.geomspace(*term.shape.bounds, 8)

    def columns_of(_: object, shape: float) -> Array:
        return np.asarray(100.0 * (np.sin(20.0 * TIME) - np.sin(20.0 * (TIME - shape))))[:, None]

    table = Tabled(term, shapes, np.stack([columns_of(term, float(shape)) for shape in shapes], axis=1))
    problem = TermProblem(np.zeros((len(TIME), 0)), columns_of(term, delay)[:, 0], columns_of, {term.key: table})
    assert fit_term(problem, term).shape == pytest.approx(delay, rel=2e-3)
