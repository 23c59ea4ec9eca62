"""Loss curves that fall with speed: what is expected of them, and the cause that a free curve would hide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.slow import slow

from pmg.pipeline.commands.compare_and_diagnose import SEED
from pmg.pipeline.diagnosis.motion.constants import FORM_SPEEDS, DataSheet, SheetSum, sheet_of
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.document import motion_document
from pmg.pipeline.diagnosis.motion.loss_curve import PLAINLY, RISE_FORM, drag_columns, falls_of
from pmg.pipeline.diagnosis.motion.places import fall_words
from pmg.pipeline.diagnosis.motion.traces import effects_of, traces_of
from pmg.pipeline.trials.motion.nature import measure_motion_case
from pmg.pipeline.trials.score.case_list import draw_motion_lots
from pmg.sim.bench import load_bench
from pmg.sim.shafts import PerShaft
from pmg.sim.signals import Array

SHEET = sheet_of(load_bench(), 1, ())
FASTEST = PerShaft(190.0, 75.0)
U = 1e-3
"""Standard uncertainty of each coefficient of the drag [N m]."""


def _fitted(drag: Array, side: str = "ring") -> tuple[SheetSum, ...]:
    """Falls of the loss curves with such constants."""
    return falls_of(SHEET, _values(drag, side), U**2 * np.eye(len(SHEET)), FASTEST)


@given(st.lists(st.floats(0.0, 0.02), min_size=6, max_size=6))
def test_nothing_is_expected_of_a_curve_that_rises(steps: list[float]) -> None:
    assert not _fitted(np.cumsum(steps))


@given(st.floats(0.05, 0.3), st.floats(2.0, 8.0), st.sampled_from(("sun", "ring")))
def test_a_curve_that_falls_should_rise_as_a_power_of_speed(extra: float, speed: float, side: str) -> None:
    found = _fitted(extra * np.exp(-np.array(FORM_SPEEDS) / speed), side)
    assert {each.name for each in found} == {f"falling_{side}"}
    drag = _values(extra * np.exp(-np.array(FORM_SPEEDS) / speed), side)
    for each in found:
        low, high = (_drag(drag, side, at) for at in each.between)
        assert each.fall == pytest.approx(low - high)
        assert -each.weights @ drag > 0.0, "it should have risen"
        assert each.spread >= RISE_FORM


def test_a_fall_within_its_uncertainty_does_not_count() -> None:
    level = np.array([0.0, -0.018, -0.018, -0.018, -0.018, -0.018])
    (found,) = _fitted(level)
    columns = drag_columns("ring", np.array(found.between)).values()
    least = PLAINLY * U * float(np.linalg.norm([np.diff(each) for each in columns]))
    assert found.fall > least
    assert not _fitted(level * (1.0 - (found.fall - 0.9 * least) / 0.018))


def _values(drag: Array, side: str = "ring") -> Array:
    """Constants with that drag of a rotor at `FORM_SPEEDS` beside a rise with the root of speed."""
    values = SHEET.expected.copy()
    for each in ("sun", "ring"):
        values[SHEET.at(f"drag_{each}_0.5")] = 0.1
    for speed, more in zip(FORM_SPEEDS, drag, strict=True):
        values[SHEET.at(f"drag_{side}_off_at_{speed:g}")] = more
    return values


def _drag(values: Array, side: str, speed: float) -> float:
    """Drag of a rotor at a speed [N m]."""
    return float(sum(column[0] * values[SHEET.at(n)] for n, column in drag_columns(side, np.array([speed])).items()))


def test_speeds_that_a_rotor_never_had_say_nothing() -> None:
    values = _values(np.array([0.2, 0.15, 0.1, 0.05, 0.0, 0.0]))
    covariance = U**2 * np.eye(len(SHEET))
    (whole, *_), (part,) = (falls_of(SHEET, values, covariance, PerShaft(190.0, most)) for most in (75.0, 5.0))
    assert (whole.between[0], part.between) == (part.between[0], (FORM_SPEEDS[0], FORM_SPEEDS[1]))
    assert whole.between[1] > part.between[1]
    assert not falls_of(SHEET, values, covariance, PerShaft(0.0, 0.0))


@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_a_sum_pulls_as_one_more_row_and_is_moved_by_itself_alone(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    sums = tuple(
        SheetSum(("sun", "ring")[k % 2], rng.standard_normal(len(SHEET)), 0.1 + rng.random(), 0.01, (1.0, 2.0))
        for k in range(count)
    )
    sheet = replace(SHEET, sums=sums)
    values = rng.standard_normal(len(SHEET))
    step = 1e-3 * rng.standard_normal(len(SHEET))
    np.testing.assert_allclose(sheet.off(values) - sheet.off(values + step), sheet.rows @ step, atol=1e-6)
    rows = len(sheet.rows) + 5
    own = np.hstack(list(sheet.columns_of_sums(rows).values()))
    assert own.shape == (rows, count)
    assert np.array_equal(own[-count:].sum(axis=0), np.ones(count))
    assert not own[:-count].any()
    _same_as_before(sheet, rows, count)


def _same_as_before(sheet: DataSheet, rows: int, count: int) -> None:
    names = ("inertia_ring", "pull_out")
    moved = sheet.columns_of(names, rows)
    assert not moved[-count:].any()
    np.testing.assert_array_equal(moved[:-count], SHEET.columns_of(names, rows - count))


def test_the_deepest_fall_is_told_with_its_size_and_its_speeds() -> None:
    falls = [SheetSum("ring", np.zeros(1), 0.01, fall, (1.5, 10.0 * fall / 0.0374)) for fall in (0.0374, 0.01)]
    assert fall_words(falls) == "the loss curve of the ring rotor falls by 37 mN m from 14 to 95 rpm"


@slow
@pytest.mark.parametrize(
    ("seed", "number", "campaigns", "true", "one"),
    [(20261130480, 88, 160, 0.226, True), (20261130440, 140, 240, 0.139, True), (20261130440, 79, 240, 0.128, False)],
)
def test_mixed_lubrication_is_seen_in_the_loss_curve_that_it_makes_fall(
    seed: int, number: int, campaigns: int, true: float, one: bool
) -> None:
    """The free curve took up all of it: no difference was found (p of 0.15 to 0.27)."""
    lot = draw_motion_lots(campaigns, seed)[number]
    case = lot.draw()
    runs = tuple(measure_motion_case(case, lot.rng("measure")))
    found = diagnose_motion(case.campaign, runs, load_bench(), np.random.default_rng(SEED))
    document = motion_document(found)
    (cause, *_) = document["mechanisms"]
    assert (cause["id"], cause["shaft"]) == ("stribeck_mixed_lubrication", "ring")
    assert (document["verdict"] == "named") == one
    (extra,) = (each for each in cause["parameters"] if each["name"] == "extra")
    assert extra["value"] == pytest.approx(true, abs=0.03)
    assert "without it, the loss curve of the ring rotor falls by" in document["statement"]
    traces = [trace for trace in traces_of(found, effects_of(found)) if trace.stretch.side == "ring"]
    without, with_it = (
        max(float(np.abs(trace.missing(getattr(trace, which))).max()) for trace in traces)
        for which in ("before", "after")
    )
    assert without > 2.0 * with_it, "the picture shows the cause that a free curve would hide"
