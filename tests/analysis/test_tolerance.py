"""Within tolerance, out of tolerance, not comparable: the larger of two bounds, point by point."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtri
from tests.points import measured as made
from tests.points import points

from pmg.pipeline.analysis.comparison import Difference, Residuals
from pmg.pipeline.analysis.tolerance import Tolerance, ToleranceState, agreements
from pmg.pipeline.chapters.measured.conditions import grids_section
from pmg.pipeline.chapters.simulated.comparison import comparison_section
from pmg.pipeline.chapters.simulated.residual_plots import residual_plots
from pmg.pipeline.commands.compare import _command_words
from pmg.pipeline.report.document import Chart, Figure, Table
from pmg.sim.bench import load_bench

if TYPE_CHECKING:
    from pmg.sim.signals import Array

BENCH = load_bench()
POSITIVE = st.floats(1e-6, 1e3)


@given(POSITIVE, st.floats(0.0, 1.0), st.floats(-1e3, 1e3))
def test_the_bound_is_the_larger_of_both_parts(absolute: float, relative: float, measured: float) -> None:
    bound = Tolerance(absolute, relative).at(np.array([measured]))[0]
    assert bound == max(absolute, relative * abs(measured))


def compared(sun: list[float], ring: list[float]) -> Residuals:
    """Differences of both torques at neutral points that read 1 N m; those that are NaN are not compared."""
    at = points("neutral", [500.0] * len(sun), [200.0] * len(sun))

    def difference(values: list[float]) -> Difference:
        off = np.array(values)
        return Difference(np.where(np.isnan(off), np.nan, 1.0), 1.0 - off, np.where(np.isnan(off), np.nan, 1e-3))

    nothing = Difference(*(np.full(len(sun), np.nan),) * 3)
    one: Array = np.ones(len(sun))
    grid = made(at, one, one)
    return Residuals(grid, grid, difference(sun), difference(ring), nothing, nothing)


def test_each_point_is_judged_by_the_data_sheet_where_nothing_was_set() -> None:
    agreed = agreements(compared([0.004, 0.006, np.nan, np.nan], [0.009, 0.001, 0.011, np.nan]), BENCH)
    assert agreed.of["torque_sun"].states == (
        ToleranceState.WITHIN,
        ToleranceState.OUT,
        ToleranceState.NOT_COMPARABLE,
        ToleranceState.NOT_COMPARABLE,
    )
    assert agreed.of["torque_ring"].states == (
        ToleranceState.WITHIN,
        ToleranceState.WITHIN,
        ToleranceState.OUT,
        ToleranceState.NOT_COMPARABLE,
    )
    assert agreed.compared.tolist() == [True, True, True, False]
    assert agreed.within.tolist() == [True, False, False, False]
    assert agreed.description == "Simulation within tolerance at 1 of 3 points (1 not comparable)."


def test_points_are_counted_and_judged_by_all_their_quantities() -> None:
    residuals = compared([0.004, 0.006, np.nan, np.nan], [0.009, 0.001, 0.011, np.nan])
    agreed = agreements(residuals, BENCH)
    assert agreed.states == (
        ToleranceState.WITHIN,
        ToleranceState.OUT,
        ToleranceState.OUT,
        ToleranceState.NOT_COMPARABLE,
    )
    assert agreed.counts["points"] == {"within": 1, "out": 2, "not_comparable": 1}
    assert agreed.counts["torque_ring"] == {"within": 2, "out": 1, "not_comparable": 1}
    assert agreed.counts["loss_total"] == {"within": 0, "out": 0, "not_comparable": 4}
    tables = [item for item in comparison_section(residuals, agreed).items if isinstance(item, Table)]
    table = next(table for table in tables if table.id == "comparison-by-point")
    assert [column.name for column in table.columns][:2] == ["point", "state"]
    assert [row[1] for row in table.rows] == [str(state) for state in agreed.states]


def test_a_tolerance_that_was_set_takes_the_place_of_the_data_sheet() -> None:
    residuals = compared([0.004, 0.006], [0.009, 0.001])
    strict = agreements(residuals, BENCH, {"torque_sun": Tolerance(0.005, 0.0), "torque_ring": Tolerance(0.0, 0.005)})
    assert strict.of["torque_sun"].within.tolist() == [True, False]
    assert strict.of["torque_ring"].within.tolist() == [False, True]
    assert "5 mN m" in strict.of["torque_sun"].rule.replace("0.005 N m", "5 mN m")


def test_a_zero_check_is_not_a_simulated_point() -> None:
    given = compared([0.001, 0.001, 0.006], [0.001, 0.001, 0.001])
    at = replace(given.grid.points, configuration=np.array(["zero", "neutral", "neutral"]))
    agreed = agreements(replace(given, grid=replace(given.grid, points=at)), BENCH)
    assert agreed.of["torque_sun"].states == (ToleranceState.NOT_COMPARABLE, ToleranceState.WITHIN, ToleranceState.OUT)
    assert agreed.description == "Simulation within tolerance at 1 of 2 points (1 not comparable)."


def test_the_points_furthest_out_of_tolerance_are_listed_first() -> None:
    sun = np.r_[np.full(5, 0.004), np.linspace(0.006, 0.04, 12)]
    ring = np.full(17, 0.001)
    ring[0] = -0.5
    given = compared(list(sun), list(ring))
    section = comparison_section(given, agreements(given, BENCH))
    table = next(item for item in section.items if isinstance(item, Table) and item.id == "out-of-tolerance")
    names = given.grid.points.name
    assert [row[0] for row in table.rows] == [names[i] for i in (0, *range(16, 7, -1))]
    assert [row[1] for row in table.rows[:2]] == ["ring torque", "sun torque"]
    ratios = [float(row[5]) for row in table.rows]  # type: ignore[arg-type]
    assert ratios == sorted(ratios, reverse=True)
    assert table.rows[0][2].value == pytest.approx(-500.0)  # type: ignore[union-attr]
    assert "10 of 13 points" in table.caption


def test_no_table_of_the_furthest_where_all_are_within_tolerance() -> None:
    given = compared([0.001, 0.004], [0.001, 0.001])
    section = comparison_section(given, agreements(given, BENCH))
    assert "out-of-tolerance" not in [item.id for item in section.items if isinstance(item, Table)]


def test_the_caption_names_only_what_the_residuals_are_drawn_against() -> None:
    given = compared([0.001, 0.004], [0.001, 0.001])
    section = comparison_section(given, agreements(given, BENCH))
    figure = next(item for item in section.items if isinstance(item, Figure) and item.id == "residuals-followed")
    for what in ("speed", "load", "time"):
        assert (what in figure.caption) == any(what in panel.x_label for panel in figure.panels)  # type: ignore[union-attr]


@pytest.mark.parametrize("opens", [True, False])
def test_points_are_said_to_open_only_where_the_page_holds_their_signals(*, opens: bool) -> None:
    figure = grids_section(compared([0.001], [0.001]).grid, opens=opens).items[0]
    assert ("opens its signals" in figure.caption) == opens  # type: ignore[union-attr]


def test_the_command_of_a_report_names_what_changes_it() -> None:
    assert _command_words("", None) == "pmg compare --store STORE --report REPORT"
    told = _command_words("it's warm", Path("old/model.toml"))
    assert shlex.split(told)[-4:] == ["--model", "model.toml", "--note", "it's warm"]


@pytest.mark.parametrize("name", ["loss_total", "efficiency_total"])
def test_what_follows_from_a_torque_is_within_where_the_torque_is(name: str, rng: np.random.Generator) -> None:
    n = 50
    at = replace(points("engaged", np.linspace(200, 1800, n), -np.linspace(80, 700, n), 2.0))
    sun = rng.uniform(0.5, 2.0, n)
    off = rng.uniform(-0.01, 0.01, n)
    grid = made(at, sun, np.full(n, 2.0))
    torque = Difference(sun, sun - off, np.full(n, 1e-3))
    loss = Difference(sun * at.speed_sun, (sun - off) * at.speed_sun, np.full(n, 1e-3))
    ratio = 2.0 * at.speed_ring / at.speed_sun
    efficiency = Difference(-ratio / sun, -ratio / sun - ratio * off / sun**2, np.full(n, 1e-3))
    nothing = Difference(*(np.full(n, np.nan),) * 3)
    agreed = agreements(Residuals(grid, grid, torque, nothing, loss, efficiency), BENCH)
    assert 0 < agreed.of["torque_sun"].within.sum() < n
    assert agreed.of[name].within.tolist() == agreed.of["torque_sun"].within.tolist()


def test_residuals_that_scatter_as_stated_follow_the_line_and_lie_in_their_bands() -> None:
    residuals = compared(list(1e-3 * ndtri((np.arange(40) + 0.5) / 40)), [2e-3] * 40)
    (figure,) = residual_plots(residuals, agreements(residuals, BENCH))
    *bands, quantiles = figure.panels
    assert isinstance(quantiles, Chart)
    scores = next(series for series in quantiles.series if series.name == "sun")
    assert np.allclose(scores.y, scores.x)
    assert isinstance(bands[0], Chart)
    tolerance, expanded, points = bands[0].series
    assert expanded.u is not None
    assert np.allclose(expanded.u, 1.0)  # mN m; a band is drawn at twice that
    assert len(points.x) == len(tolerance.x) == 40
