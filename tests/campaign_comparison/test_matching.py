"""Points of two campaigns matched: one to one, symmetric, whatever order they are listed in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.points import joined, measured, points

from pmg.pipeline.campaign_comparison.matching import Reach, match
from pmg.sim.errors import GridError
from pmg.sim.grid import Grid
from pmg.sim.signals import RPM

REACH = Reach()
FIRST = np.array([True, True, False])
SPEEDS = st.lists(st.floats(100.0, 130.0), min_size=0, max_size=9)


def neutral(speeds: list[float], seed: int = 0) -> Grid:
    """Points at one ring speed and these sun speeds [rpm], in the order of time."""
    at = points("neutral", speeds, [60.0] * len(speeds), started_at=1e9 + 60.0 * np.arange(float(len(speeds))))
    rng = np.random.default_rng(seed)
    return measured(at, *(rng.standard_normal((2, len(speeds))) if speeds else np.zeros((2, 0))))


def pairs(a: Grid, b: Grid) -> set[tuple[int, int]]:
    found = match(a, b, REACH)
    return set(zip(found.a.tolist(), found.b.tolist(), strict=True))


@given(SPEEDS, SPEEDS)
def test_matches_are_one_to_one_within_tolerance_and_all_points_are_accounted_for(
    one: list[float], other: list[float]
) -> None:
    a, b = neutral(one), neutral(other, 1)
    found = match(a, b, REACH)
    assert len(set(found.a.tolist())) == len(set(found.b.tolist())) == len(found)
    apart = np.abs(a.points.speed_sun[found.a] - b.points.speed_sun[found.b])
    assert (apart <= REACH.speed * (1.0 + 1e-6)).all()
    assert sorted([*found.a.tolist(), *(left.row for left in found.only_a)]) == list(range(len(one)))
    assert sorted([*found.b.tolist(), *(left.row for left in found.only_b)]) == list(range(len(other)))
    for left in found.only_a:
        free = [right.row for right in found.only_b]
        near = np.abs(b.points.speed_sun[free] - a.points.speed_sun[left.row]) <= REACH.speed * (1.0 - 1e-6)
        assert not near.any(), "two points without a partner lie within reach of each other"


@given(SPEEDS, SPEEDS)
def test_matching_is_symmetric(one: list[float], other: list[float]) -> None:
    a, b = neutral(one), neutral(other, 1)
    there, back = match(a, b, REACH), match(b, a, REACH)
    assert len(there) == len(back)
    assert cost(a, b) == pytest.approx(cost(b, a), abs=1e-9)


def cost(a: Grid, b: Grid) -> float:
    found = match(a, b, REACH)
    apart = (a.points.speed_sun[found.a] - b.points.speed_sun[found.b]) / REACH.speed
    turns = np.array([turn(a, i) - turn(b, j) for i, j in zip(found.a, found.b, strict=True)])
    return float(np.sum(apart**2) + 1e-2 * np.sum(turns**2))


def turn(grid: Grid, row: int) -> int:
    """How many of the same set-point went before."""
    speed = grid.points.speed_sun
    return int(np.count_nonzero(np.abs(speed[:row] - speed[row]) <= REACH.speed))


@given(SPEEDS, SPEEDS, st.randoms(use_true_random=False))
def test_the_order_of_listing_does_not_matter(one: list[float], other: list[float], shuffled: object) -> None:
    a, b = neutral(one), neutral(other, 1)
    order = list(range(len(one)))
    shuffled.shuffle(order)  # type: ignore[attr-defined]
    moved = pairs(a[np.array(order, dtype=np.int64)], b)
    assert {(order[i], j) for i, j in moved} == pairs(a, b)


def test_repeats_are_paired_in_the_order_of_time_and_the_one_too_many_is_left() -> None:
    a, b = neutral([100.0, 500.0, 100.02, 99.97]), neutral([99.99, 100.03])
    found = match(a, b, REACH)
    assert set(zip(found.a.tolist(), found.b.tolist(), strict=True)) == {(0, 0), (2, 1)}
    assert [(left.row, left.why) for left in found.only_a] == [(1, "out of tolerance"), (3, "that one has a partner")]
    later = replace(b.points, started_at=b.points.started_at[::-1].copy())
    assert pairs(a, replace(b, points=later)) == {(0, 1), (2, 0)}


def test_as_many_as_possible_find_a_partner() -> None:
    """The nearest pair, 104 and 105, would leave both others alone."""
    assert pairs(neutral([100.0, 104.0]), neutral([105.0, 108.0])) == {(0, 0), (1, 1)}


def test_other_kinds_never_match_and_the_nearest_of_the_kind_is_named() -> None:
    load = np.array([1.0, 1.0, 1.0])
    forward = points("engaged", [600.0, 900.0, 1200.0], [-230.0, -345.0, -460.0], load, load_set=load)
    turned = joined(
        replace(forward[FIRST], drive=np.array(["ring", "ring"])), replace(forward[~FIRST], gear=np.array([2]))
    )
    a, b = (measured(at, np.ones(3), at.torque_ring) for at in (forward, turned))
    found = match(a, b, REACH)
    assert len(found) == 0
    assert {left.why for left in (*found.only_a, *found.only_b)} == {"no point of that kind there"}
    further = replace(forward, speed_sun=forward.speed_sun + 20.0 * RPM, load_set=load + 0.05)
    left = match(a, measured(further, np.ones(3), load), REACH).only_a
    assert [one.nearest for one in left] == [0, 1, 2]
    assert left[0].speed_sun == pytest.approx(20.0 * RPM)
    assert left[0].load == pytest.approx(0.05)
    assert left[0].why == "out of tolerance"


def test_rejected_points_take_no_part_on_either_side() -> None:
    a, b = neutral([100.0, 200.0, 300.0]), neutral([100.0, 200.0, 300.0])
    a = replace(a, accepted=np.array([False, True, True]))
    b = replace(b, accepted=np.array([True, False, True]))
    found = match(a, b, REACH)
    assert (found.a.tolist(), found.b.tolist()) == ([2], [2])
    assert [left.why for left in found.only_a] == ["rejected here", "rejected there"]


def test_tolerances_are_read_with_their_units() -> None:
    read = Reach.parsed("12 rpm", "30 mN m")
    assert (read.speed, read.load) == pytest.approx((12.0 * RPM, 0.03))
    assert Reach.parsed(None, None) == REACH
    for speed, load in (("5", None), ("5 N m", None), (None, "0.1 rpm"), ("-1 rpm", None), (None, "0 N m")):
        with pytest.raises(GridError, match="tolerance"):
            Reach.parsed(speed, load)
    with pytest.raises(GridError, match="-1 rpm"):
        Reach.parsed("-1 rpm", None)
