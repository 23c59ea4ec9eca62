"""What a mean torque is uncertain by: contributions, their sums, what is shared by the points."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.points import joined, measured, points
from tests.store.records import WINDOW

from pmg.pipeline.chapters.measured.budget import budget_items
from pmg.pipeline.fit.budget import Budget, budget_of
from pmg.pipeline.fit.budget_document import budget_document, budget_frame, shown_point
from pmg.pipeline.fit.budget_remarks import budget_remarks
from pmg.pipeline.fit.common_errors import transducer_causes
from pmg.pipeline.fit.noise import DRIFTED, NO_CORRELATION, NoiseFloor, ShaftNoise
from pmg.pipeline.grid.contributions import Contribution, ShaftBudget
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.grid.transducer_remarks import transducer_remarks
from pmg.pipeline.grid.transducer_uncertainty import common_parts, common_uncertainty, tare_uncertainty, undithered
from pmg.pipeline.grid.window_facts import LimitSet, ShaftFacts, WindowFacts, _limit_sets, rated
from pmg.pipeline.report.document import Table, Text
from pmg.pipeline.store.manifest import Manifest
from pmg.pipeline.windows.limits import LIMITS
from pmg.sim.bench import load_bench
from pmg.sim.grid import Grid

BENCH = load_bench()
ZEROS = np.array([-1.0e-3, 0.5e-3, 0.2e-3, -0.4e-3, 0.1e-3])
NOISE = ShaftNoise(1e-3, 50.0, 0.4e-3, 1e-3, 5, 1e-3, 45.0, NO_CORRELATION, "pooled")
FLOOR = NoiseFloor(NOISE, NOISE)
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


def facts(
    grid: Grid,
    resolution: float = 2e-4,
    std: float = 1e-2,
    flagged: int | None = None,
    nominal: tuple[float, float] = (5.0, 10.0),
) -> WindowFacts:
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
        nominal=np.full(n, nominal[0]),
    )
    return WindowFacts(
        of, replace(of, nominal=np.full(n, nominal[1])), (LimitSet(LIMITS.document(), n, n),), ~marked & marked
    )


def budget(grid: Grid | None = None, resolution: float = 2e-4, std: float = 1e-2, flagged: int | None = None) -> Budget:
    grid = campaign() if grid is None else grid
    return budget_of(grid, FLOOR, BENCH, facts(grid, resolution, std, flagged))


def named(shaft: ShaftBudget, key: str) -> Contribution:
    return next(c for c in shaft.contributions if c.key == key)


TOLERANCES = {"sun": (0.002, 0.001 * 5.0), "ring": (0.002, 0.001 * 10.0)}
"""By hand from the data sheets: sensitivity, of the reading, and non-linearity [N m]."""


def damaged(grid: Grid) -> Grid:
    """Two rejected windows more, one whose mean torque cannot be formed, and one with a torque all its own."""
    at = joined(grid.points, points("neutral", [700.0, 800.0], [100.0, 200.0]))
    columns = {
        name: np.r_[getattr(grid, name), [np.nan, value]]
        for name, value in (
            ("torque_sun", 3.0),
            ("torque_ring", 3.0),
            ("within_sun", 5e-3),
            ("within_ring", 5e-3),
            ("u_sun", 6e-3),
            ("u_ring", 6e-3),
        )
    }
    sun, ring = columns["torque_sun"], columns["torque_ring"]
    zero = grid.points.zero
    tares = tare_uncertainty(grid.torque_sun[zero])[0], tare_uncertainty(grid.torque_ring[zero])[0]
    common = common_uncertainty(sun, ring, BENCH, tares)
    return replace(
        grid,
        points=at,
        accepted=np.r_[grid.accepted, [False, False]],
        reason=np.r_[grid.reason, ["speed missing", "not steady"]],
        common_sun=common[0],
        common_ring=common[1],
        **columns,
    )


@pytest.mark.parametrize(("resolution", "std"), [(2e-4, 1e-2), (1e-3, 1e-4)])
@pytest.mark.parametrize("rejected", [False, True])
def test_contributions_add_up_to_what_was_put_in_each_counted_once(
    resolution: float, std: float, *, rejected: bool
) -> None:
    """Every part is built by hand, none as what the others leave over."""
    grid = damaged(campaign()) if rejected else campaign()
    found = budget(grid, resolution, std)
    n = len(campaign())
    for shaft in found:
        torque = shaft.torque[:n]
        rounding = resolution / math.sqrt(12.0) if std < resolution / 2 else 0.0
        zero = math.hypot(
            shaft.torque[grid.points.zero].mean(), shaft.torque[grid.points.zero].std(ddof=1) / math.sqrt(5)
        )
        gain, course = TOLERANCES[shaft.side]
        parts: dict[str, Any] = {
            "within": math.sqrt(0.4e-3**2 - rounding**2),
            "resolution": rounding,
            "wander": math.sqrt(1e-3**2 - 0.4e-3**2),
            "sensitivity": gain * np.abs(torque) / math.sqrt(3.0),
            "linearity": course / math.sqrt(3.0),
            "tare": zero,
        }
        for key, expected in parts.items():
            np.testing.assert_allclose(named(shaft, key).u[:n], expected, rtol=1e-9, err_msg=key)
        independent = sum(np.square(parts[key]) for key in ("within", "resolution", "wander"))
        common = sum(np.square(parts[key]) for key in ("sensitivity", "linearity", "tare"))
        np.testing.assert_allclose(shaft.independent[:n] ** 2, independent, rtol=1e-9)
        np.testing.assert_allclose(shaft.common[:n] ** 2, common, rtol=1e-9)
        np.testing.assert_allclose(shaft.u[:n] ** 2, independent + common, rtol=1e-9)
        if rejected:
            assert np.isnan(shaft.u[n]), "a point without a mean torque is not known without uncertainty"
            assert shaft.independent[n + 1] == pytest.approx(6e-3)


def test_a_rejected_window_without_a_mean_leaves_the_mean_of_the_others_alone() -> None:
    whole, hurt = budget(campaign()), budget(damaged(campaign()))
    for shaft, other in zip(whole, hurt, strict=True):
        rows = whole.grid.points.neutral
        assert other.of_mean(np.r_[rows, [False, False]]) == pytest.approx(shaft.of_mean(rows))
    shown = " ".join(item.body for item in budget_items(hurt) if isinstance(item, Text))
    assert "nan" not in shown
    assert np.isnan(whole.sun.of_mean(np.zeros(len(whole.grid), dtype=bool))).all()


def test_only_a_tare_keeps_its_sign() -> None:
    assert [c.key for c in budget().sun.contributions if c.common and not c.signed] == ["tare"]


@pytest.mark.parametrize("nominal", [(2.0, 50.0), (5.0, 10.0)])
def test_non_linearity_is_of_the_nominal_torque_of_the_calibration(nominal: tuple[float, float]) -> None:
    base = campaign()
    sun, ring = base.torque_sun, base.torque_ring
    each = np.full(len(base), nominal[0]), np.full(len(base), nominal[1])
    tares = tare_uncertainty(sun[base.points.zero])[0], tare_uncertainty(ring[base.points.zero])[0]
    common = common_uncertainty(sun, ring, BENCH, tares, each)
    grid = replace(base, common_sun=common[0], common_ring=common[1])
    known = facts(grid, nominal=nominal)
    found = budget_of(grid, None, BENCH, known)
    for shaft, of, total in zip(found, nominal, common, strict=True):
        np.testing.assert_allclose(named(shaft, "linearity").u, 0.001 * of / math.sqrt(3.0), rtol=1e-9)
        np.testing.assert_allclose(shaft.common, total, rtol=1e-9)
        assert named(shaft, "linearity").remark.endswith(f"of {of:g} N m")
    names = {cause.name for cause in transducer_causes(grid, rated(BENCH, known))}
    assert "linearity of the ring transducer in neutral" in names
    told = [remark.where for remark in transducer_remarks(known, BENCH)]
    ours = nominal == (5.0, 10.0)
    assert told == ([] if ours else ["transducer of the sun", "transducer of the ring"])
    assert (rated(BENCH, known) is BENCH) == ours
    assert float(rated(BENCH, known).transducer_ring.nominal_torque) == nominal[1]


def test_transducers_exchanged_within_a_campaign_keep_each_its_own_nominal_torque() -> None:
    grid = campaign()
    known = facts(grid)
    mixed = np.where(np.arange(len(grid)) < 4, 50.0, 10.0)
    mixed[-1] = np.nan
    common = common_uncertainty(grid.torque_sun, grid.torque_ring, BENCH, nominal=(known.sun.nominal, mixed))
    grid = replace(grid, common_sun=common[0], common_ring=common[1])
    found = budget_of(grid, None, BENCH, replace(known, ring=replace(known.ring, nominal=mixed)))
    expected = 0.001 * np.where(np.arange(len(grid)) < 4, 50.0, 10.0) / math.sqrt(3.0)
    np.testing.assert_allclose(named(found.ring, "linearity").u, expected, rtol=1e-9)
    assert named(found.ring, "linearity").remark.endswith("of 10 and 50 N m")


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
    vague = ShaftBudget("sun", one, (replace(parts[0], dof=np.nan * one), *parts[1:]))
    assert vague.dof[0] == pytest.approx(4.0 / (1.0 + 0.25))
    assert vague.expanded[0] > shaft.expanded[0], "not known is not the same as known exactly"
    known = ShaftBudget("sun", one, tuple(replace(part, dof=np.inf * one) for part in parts))
    assert np.isinf(known.dof[0])
    assert known.expanded[0] == pytest.approx(1.96 * math.sqrt(2.0), abs=1e-3)


@settings(max_examples=30)
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
    assert [remark.where for remark in slow] == ["windows"]
    assert campaign().points.name[3] in slow[0].message
    one = facts(campaign()).sun
    once = WindowFacts(one, replace(one, correlated=np.arange(len(one.dof)) == 3), (), one.correlated)
    assert once.correlated_by_chance
    assert not list(budget_remarks(budget_of(campaign(), FLOOR, BENCH, once))), "flat noise has one as often"
    off = list(budget_remarks(budget(campaign(zero=5e-3))))
    assert [remark.where for remark in off] == ["zero checks"]
    assert "sun" in off[0].message


def test_where_a_campaign_cannot_state_the_interval_of_a_mean_it_says_so() -> None:
    """Without an estimate from points: of the window alone. With repeats that differ by more: of its time alone."""
    drifted, unseen = replace(NOISE, source=DRIFTED, repeats=7e-3), replace(NOISE, dof=0.0)
    for floor, words in (
        (None, ("the sun and the ring", "window alone")),
        (NoiseFloor(NOISE, unseen), ("of the ring", "window alone")),
        (NoiseFloor(drifted, NOISE), ("sun differ by 7.00 mN m", "at another time")),
        (FLOOR, ()),
    ):
        found = [r.message for r in budget_remarks(budget_of(campaign(), floor, BENCH)) if r.where.startswith("unc")]
        assert len(found) == bool(words)
        assert all(word in message for message in found for word in words)


@pytest.mark.parametrize("within", [0.1e-3, 0.7e-3, 1.2e-3])
def test_a_mean_is_known_as_well_as_the_scatter_of_the_points_not_as_their_windows(within: float) -> None:
    noise = replace(NOISE, within=within, dof=6.0)
    grid = campaign()
    grid = replace(grid, within_sun=np.full(len(grid), within), common_sun=np.zeros(len(grid)))
    found = budget_of(grid, NoiseFloor(noise, NOISE), BENCH, facts(grid)).sun
    assert found.dof == pytest.approx(6.0, rel=0.05)
    assert found.independent == pytest.approx(1e-3)


@pytest.mark.parametrize(("kept", "word"), [(0, "none"), (1, "one"), (2, "")])
def test_a_campaign_without_two_zero_checks_is_told(kept: int, word: str) -> None:
    whole = campaign()
    ordinal = np.cumsum(whole.points.zero)
    grid = replace(whole, accepted=whole.accepted & (~whole.points.zero | (ordinal <= kept)))
    found = [remark.message for remark in budget_remarks(budget(grid)) if remark.where == "zero checks"]
    assert [message.split()[0] for message in found] == ([word] if word else [])
    assert not list(budget_remarks(budget(replace(grid, origin="published"))))


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
    place = [column.name for column in tables[0].columns].index("u_sun")
    assert together[place] == pytest.approx(found.sun.u[row] * 1e3)
    assert len(tables[1].rows) == len(LIMITS.document())


def test_every_set_of_limits_that_judged_a_window_has_a_table() -> None:
    plain, strict = Manifest("a", windows=(WINDOW,)), replace(LIMITS, shortest=4.0).document()
    sets = _limit_sets([plain, replace(plain, limits=strict), plain, replace(plain, limits=LIMITS.document())])
    assert [(each.windows, each.recordings, each.limits["shortest"]) for each in sets] == [(3, 3, 1.0), (1, 1, 4.0)]
    found = budget()
    assert found.facts is not None
    found = replace(found, facts=replace(found.facts, limits=sets))
    items = budget_items(found)
    tables = [item for item in items if isinstance(item, Table) and item.id.startswith("window-limits")]
    assert [table.id for table in tables] == ["window-limits", "window-limits-2"]
    assert [[row[1] for row in table.rows if row[0] == "shortest"] for table in tables] == [[1.0], [4.0]]
    assert any(isinstance(item, Text) and "2 sets of limits" in item.body for item in items)
    assert [each["windows"] for each in budget_document(found)["windows"]["limits"]] == [3, 1]


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
