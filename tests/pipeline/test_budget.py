"""What a mean torque is uncertain by: contributions, their sums, what is shared by the points."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.points import joined, measured, points

from pmg.pipeline.budget.contribution import Contribution, ShaftBudget
from pmg.pipeline.budget.document import budget_document, budget_frame, shown_point
from pmg.pipeline.budget.point import Budget, budget_of, undithered
from pmg.pipeline.budget.remarks import budget_remarks
from pmg.pipeline.budget.shared import common_parts, common_uncertainty, tare_uncertainty
from pmg.pipeline.budget.windowfacts import ShaftFacts, WindowFacts
from pmg.pipeline.causes import transducer_causes
from pmg.pipeline.chapters.budget import budget_items
from pmg.pipeline.gridtable import read_published
from pmg.pipeline.limits import LIMITS
from pmg.pipeline.report.document import Table, Text
from pmg.sim.bench import load_bench
from pmg.sim.grid import Grid

BENCH = load_bench()
ZEROS = np.array([-1.0e-3, 0.5e-3, 0.2e-3, -0.4e-3, 0.1e-3])
PUBLISHED = Path(__file__).resolve().parents[2] / "raw" / "published"


def campaign(zero: float = 0.0) -> Grid:
    """Neutral, engaged and reversed points and zero checks, torques of either sign."""
    at = joined(
        points("neutral", np.linspace(100, 1800, 6), np.linspace(60, 700, 6)),
        points("engaged", [300.0, 900.0], [-300 / 2.6, -900 / 2.6], 1.5, load_set=1.5),
        points("engaged", [600.0], [-600 / 2.6], -1.5, load_set=-1.5, drive="ring"),
        points("zero", np.zeros(5), np.zeros(5)),
    )
    sun = np.r_[np.linspace(0.05, 0.2, 6), 0.7, 0.8, -0.7, zero + ZEROS]
    ring = np.r_[np.linspace(0.1, 0.3, 6), 1.5, 1.5, -1.5, ZEROS]
    grid = measured(at, sun, ring, 1e-3)
    tares = tare_uncertainty(sun[at.zero])[0], tare_uncertainty(ring[at.zero])[0]
    common = common_uncertainty(sun, ring, BENCH, tares)
    within = np.full(len(grid), 0.4e-3)
    return replace(grid, within_sun=within, within_ring=within, common_sun=common[0], common_ring=common[1])


def facts(grid: Grid, resolution: float = 2e-4, std: float = 1e-2, flagged: int | None = None) -> WindowFacts:
    n = len(grid)
    marked = np.zeros(n, dtype=bool)
    if flagged is not None:
        marked[flagged] = True
    of = ShaftFacts(
        dof=np.full(n, 9.0),
        correlation_time=np.full(n, 1e-3),
        correlated=marked,
        remembered=marked,
        resolution=np.full(n, resolution),
        std=np.full(n, std),
    )
    return WindowFacts(of, of, LIMITS.document())


def budget(grid: Grid | None = None, resolution: float = 2e-4, std: float = 1e-2, flagged: int | None = None) -> Budget:
    grid = campaign() if grid is None else grid
    return budget_of(grid, None, BENCH, facts(grid, resolution, std, flagged))


def named(shaft: ShaftBudget, key: str) -> Contribution:
    return next(c for c in shaft.contributions if c.key == key)


@pytest.mark.parametrize("resolution", [2e-4, 0.05])
def test_contributions_add_up_to_what_the_grid_says(resolution: float) -> None:
    grid = campaign()
    found = budget(grid, resolution)
    for shaft, u, common in zip(
        found.shafts, (grid.u_sun, grid.u_ring), (grid.common_sun, grid.common_ring), strict=True
    ):
        np.testing.assert_allclose(shaft.independent, u, rtol=1e-12)
        np.testing.assert_allclose(shaft.common, common, rtol=1e-12)
        np.testing.assert_allclose(shaft.u, np.hypot(u, common), rtol=1e-12)


def test_each_contribution_has_the_size_its_source_gives() -> None:
    sun = budget().sun
    np.testing.assert_allclose(named(sun, "sensitivity").u, 0.002 * np.abs(sun.torque) / math.sqrt(3.0), rtol=1e-9)
    np.testing.assert_allclose(named(sun, "linearity").u, 0.001 * 5.0 / math.sqrt(3.0), rtol=1e-9)
    tare = math.hypot(ZEROS.mean(), ZEROS.std(ddof=1) / math.sqrt(5))
    np.testing.assert_allclose(named(sun, "tare").u, tare, rtol=1e-6)
    np.testing.assert_allclose(named(sun, "within").u, 0.4e-3)
    np.testing.assert_allclose(named(sun, "wander").u, math.sqrt(1e-6 - 0.4e-3**2))
    assert np.isnan(named(sun, "calibration").u).all()


def test_a_reading_that_never_leaves_its_step_is_uncertain_by_the_step() -> None:
    """GUM F.2.2.1: step/sqrt(12); with a scatter of a step or more it is in the scatter."""
    assert undithered(np.array([0.01]), np.array([0.0]))[0] == pytest.approx(0.01 / math.sqrt(12.0))
    assert undithered(np.array([0.01, np.nan]), np.array([0.01, 0.0])).tolist() == [0.0, 0.0]
    assert named(budget(resolution=1e-3, std=1e-4).sun, "resolution").u[0] == pytest.approx(1e-3 / math.sqrt(12.0))


def test_effective_degrees_of_freedom_are_those_of_welch_and_satterthwaite() -> None:
    one = np.ones(1)
    parts = tuple(
        Contribution(key, key, "A", "t", common=False, divisor=1.0, value=u * one, dof=nu * one, remark="")
        for key, u, nu in (("a", 1.0, 4.0), ("b", 1.0, 4.0), ("c", 0.0, 1.0))
    )
    shaft = ShaftBudget("sun", one, parts)
    assert shaft.dof[0] == pytest.approx(8.0)
    assert shaft.factor[0] == pytest.approx(2.306, abs=1e-3)
    known = ShaftBudget("sun", one, tuple(replace(part, dof=np.inf * one) for part in parts))
    assert np.isinf(known.dof[0])
    assert known.expanded[0] == pytest.approx(1.96 * math.sqrt(2.0), abs=1e-3)


@settings(max_examples=30, deadline=None)
@given(copies=st.integers(1, 200))
def test_common_parts_do_not_average_out(copies: int) -> None:
    base = budget().sun
    rows = np.zeros(len(base.torque), dtype=bool)
    rows[0] = True
    single = base.of_mean(rows)
    many = ShaftBudget(
        "sun",
        np.repeat(base.torque[:1], copies),
        tuple(
            replace(c, value=np.repeat(c.value[:1], copies), dof=np.repeat(c.dof[:1], copies))
            for c in base.contributions
        ),
    ).of_mean(np.ones(copies, dtype=bool))
    assert many[0] == pytest.approx(single[0] / math.sqrt(copies))
    assert many[1] == pytest.approx(single[1])


def test_gain_errors_of_opposite_torques_cancel_in_their_mean_and_a_tare_does_not() -> None:
    base = budget().sun
    torque = np.array([0.7, -0.7])
    pair = ShaftBudget("sun", torque, tuple(replace(c, value=c.value[:1].repeat(2)) for c in base.contributions))
    _, common = pair.of_mean(np.ones(2, dtype=bool))
    assert common == pytest.approx(named(base, "tare").u[0], rel=1e-9)


def test_the_tare_is_one_more_cause_that_all_readings_share() -> None:
    grid = campaign(zero=2e-3)
    causes = {cause.name: cause for cause in transducer_causes(grid, BENCH)}
    tare = causes["tare of the sun transducer"].sun
    np.testing.assert_allclose(tare, tare_uncertainty(grid.torque_sun[grid.points.zero])[0], rtol=1e-6)
    total = np.sqrt(sum((cause.sun**2 for cause in causes.values()), np.zeros(len(grid))))
    np.testing.assert_allclose(total, grid.common_sun, rtol=1e-9)
    without = replace(grid, common_sun=common_uncertainty(grid.torque_sun, grid.torque_ring, BENCH)[0])
    assert not common_parts(without, BENCH, "sun").tare.any()
    assert "tare of the sun transducer" not in {cause.name for cause in transducer_causes(without, BENCH)}


def test_a_tare_needs_two_zero_checks() -> None:
    assert tare_uncertainty(np.array([1e-3])) == (0.0, 0)
    assert tare_uncertainty(np.array([1e-3, np.nan])) == (0.0, 0)


def test_remarks_name_slow_noise_and_a_tare_that_is_off() -> None:
    assert list(budget_remarks(budget())) == []
    slow = list(budget_remarks(budget(flagged=3)))
    assert [remark["where"] for remark in slow] == ["windows"]
    assert campaign().points.name[3] in slow[0]["message"]
    off = list(budget_remarks(budget(campaign(zero=5e-3))))
    assert [remark["where"] for remark in off] == ["zero checks"]
    assert "sun" in off[0]["message"]


def test_the_document_is_json_and_the_table_has_every_point() -> None:
    found = budget(flagged=2)
    document = json.loads(json.dumps(budget_document(found), allow_nan=False))
    row = shown_point(found)
    assert row is not None
    assert document["point"] == found.grid.points.name[row]
    keys = [c["key"] for c in document["shafts"]["sun"]["contributions"]]
    assert keys == ["within", "wander", "resolution", "tare", "sensitivity", "linearity", "calibration"]
    shared = [c["common"] for c in document["shafts"]["sun"]["contributions"]]
    assert shared == [False, False, False, True, True, True, True]
    assert document["shafts"]["sun"]["u_combined_Nm"]["point"] == pytest.approx(found.sun.u[row])
    assert len(document["windows"]["correlated"]) == 1
    frame = budget_frame(found)
    parts = [f"u_{key}_sun_Nm" for key in keys if key != "calibration"]
    np.testing.assert_allclose(np.sqrt((frame[parts] ** 2).sum(axis=1)), frame["u_sun_Nm"], rtol=1e-12)
    assert len(frame) == len(found.grid)
    assert isinstance(frame, pd.DataFrame)


def test_the_chapter_shows_one_point_its_sum_and_the_limits() -> None:
    items = budget_items(budget(flagged=1))
    tables = [item for item in items if isinstance(item, Table)]
    assert [table.id for table in tables] == ["budget", "window-limits"]
    assert any(isinstance(item, Text) and item.kind == "warning" for item in items)
    together = next(row for row in tables[0].rows if row[0] == "together")
    found = budget()
    row = shown_point(found)
    assert together[4] == pytest.approx(found.sun.u[row] * 1e3)
    assert len(tables[1].rows) == len(LIMITS.document())


def test_published_grids_are_uncertain_by_their_rounding() -> None:
    grid = read_published(PUBLISHED, BENCH)
    found = budget_of(grid, None, BENCH)
    rounding = named(found.sun, "within")
    assert rounding.name == "rounding of the table"
    np.testing.assert_allclose(rounding.value, 0.005)
    assert np.isnan(named(found.sun, "tare").u).all()
    assert np.isnan(named(found.sun, "resolution").u).all()
    np.testing.assert_allclose(found.ring.u, np.hypot(grid.u_ring, grid.common_ring))


def test_nothing_accepted_shows_nothing() -> None:
    grid = replace(campaign(), accepted=np.zeros(len(campaign()), dtype=bool))
    assert budget_items(budget(grid)) == ()
    assert budget_document(budget(grid))["point"] is None
