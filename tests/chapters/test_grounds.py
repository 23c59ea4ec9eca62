"""What a verdict stands on, as the page tells it: placebo, decoys, bounds, the points of the next test."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from tests.trials.strata_by_name import find_stratum

from pmg.pipeline.chapters.explained.grounds import cannot_tell, decoy_items, noise_words, on_bound, withheld_items
from pmg.pipeline.chapters.explained.next_tests import next_test_items
from pmg.pipeline.diagnosis.design.next_test import NextTest, lifting_test
from pmg.pipeline.diagnosis.design.plans import make_points, possible_plans, whole_again
from pmg.pipeline.diagnosis.engine.decoys import Decoys
from pmg.pipeline.diagnosis.engine.held_out import HeldOut
from pmg.pipeline.diagnosis.engine.verdict import Absorbed, Verdict
from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
from pmg.pipeline.diagnosis.grid.document import _set_points
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.calibration import CONSTANTS
from pmg.pipeline.fit.noise import GROWTHS, NO_CORRELATION, Growth, NoiseFloor, ShaftNoise
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.readings import take_readings
from pmg.pipeline.report.document import Facts, Measured, Table
from pmg.pipeline.trials.nature import draw_case, measure_case
from pmg.sim.bench import BenchParameters, load_bench
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Sequence

HELD = HeldOut("a quarter at a time", 3e-3, 1e-3, 0.9e-3, (1e-3, 3e-3), -2e-6)


def diagnosis(**parts: Any) -> Diagnosis:  # noqa: ANN401 - whatever field a test sets
    """A diagnosis of which these chapters read only what is given."""
    return replace(
        Diagnosis(verdict=Verdict.NAMED, campaign="c", mismatch=cast("Any", None), floor=cast("Any", None)), **parts
    )


def facts(items: Sequence[object]) -> dict[str, str]:
    """Every labelled fact."""
    return {label: str(value) for item in items if isinstance(item, Facts) for label, value in item.rows}


def test_the_placebo_is_told_beside_the_gain_without_a_negative_zero() -> None:
    told = facts(withheld_items(diagnosis(held_out=HELD)))
    assert told["Reduction of that error, 95 % interval"] == "1.00 to 3.00 mN m"
    assert told["Reduction by a placebo"].startswith("0.00 mN m")
    worse = facts(withheld_items(diagnosis(held_out=replace(HELD, placebo_gain=-4e-5))))
    assert worse["Reduction by a placebo"].startswith("−0.04 mN m")


def test_a_structure_without_placebo_claims_none() -> None:
    told = facts(withheld_items(diagnosis(held_out=replace(HELD, expected_after=0.95e-3))))
    assert told["Error expected from noise alone"].startswith("0.95 mN m")
    assert "Reduction by a placebo" not in facts(withheld_items(diagnosis(held_out=replace(HELD, placebo_gain=None))))


def test_decoys_that_passed_are_counted_on_the_page() -> None:
    told = facts(decoy_items(diagnosis(decoys=Decoys(200, 5, 0.99))))["Decoys"]
    assert told.startswith("5 of 200")
    assert "99%" in told
    assert decoy_items(diagnosis()) == []


@pytest.mark.parametrize(
    ("before", "after", "remark"),
    [(2e-3, 6.5e-17, "on its bound"), (0.0, 1e-3, "on its bound alone"), (2e-3, 1e-3, "")],
)
def test_a_constant_on_its_bound_is_said_to_be_there(before: float, after: float, remark: str) -> None:
    items = withheld_items(diagnosis(absorbed=(Absorbed("b", before, after, None),)))
    table = next(item for item in items if isinstance(item, Table))
    assert table.rows[0][-1] == remark
    assert on_bound(after, CONSTANTS["b"]) == (0.0 if remark == "on its bound" else None)


def test_what_the_baseline_had_absorbed_carries_its_uncertainty_alone_and_together() -> None:
    items = withheld_items(diagnosis(absorbed=(Absorbed("c", 3e-4, 2e-4, 2e-5, 5e-6),)))
    table = next(item for item in items if isinstance(item, Table))
    alone, together = table.rows[0][1:3]
    assert isinstance(alone, Measured)
    assert isinstance(together, Measured)
    assert (alone.value, alone.u) == pytest.approx((3.0, 0.05))
    assert (together.value, together.u) == pytest.approx((2.0, 0.2))


def test_noise_that_grows_says_from_what_to_what() -> None:
    flat = ShaftNoise(1e-3, 50.0, 1e-3, np.nan, 0, 1e-3, 50.0, NO_CORRELATION, "scatter")
    weights = np.zeros(len(GROWTHS))
    weights[-1] = 1.0
    grown = replace(flat, growth=Growth(weights, 1000.0 * RPM, 0.3))
    floor = NoiseFloor(flat, grown)
    assert noise_words(floor, "sun") == "1.00 mN m: scatter"
    low, high = grown.at(0.0) * 1e3, grown.at(1000.0 * RPM) * 1e3
    assert noise_words(floor, "ring") == f"1.00 mN m, from {low:.2f} at rest to {high:.2f} at 1000 rpm: scatter"


def test_a_blind_design_is_said_first() -> None:
    assert cannot_tell(diagnosis()) == ()
    assert cannot_tell(diagnosis(blind=("sun",)))[0][0] == "Drift"


def test_the_points_of_a_lifting_test_are_all_listed_in_order() -> None:
    speed = np.array([300.0, 600.0, 900.0]) * RPM
    run = make_points("N", "neutral", speed, speed / 2.6, np.zeros(3), begin=0.0)
    for plan in possible_plans(run, load_bench()):
        test = NextTest(plan, ("torque_zero_drift",), 0.7)
        *_, tests, points = next_test_items(diagnosis(lifting=test))
        assert tests.rows[0][0] == plan.description
        assert len(points.rows) == len(plan.points) == len(_set_points(plan.points))
        minutes = [float(cast("float", row[0])) for row in points.rows]
        assert minutes[0] == 0.0
        assert minutes == sorted(minutes)
    assert next_test_items(diagnosis()) == []


def test_a_blind_design_is_run_again_as_a_whole_where_ten_points_tell_too_little(bench: BenchParameters) -> None:
    rng = np.random.default_rng(1000)
    grid = measure_case(draw_case(find_stratum("rising order, torque_zero_drift ring 2"), rng), rng)
    found = analyse(grid, AnalysisOptions(), bench)
    assert found.calibration is not None
    assert found.floor is not None
    readings = take_readings(found.grid, bench)
    test = lifting_test(readings, bench, found.calibration.model, found.floor, ("ring",))
    assert test is not None
    again = whole_again(found.grid.points)
    assert test.plan.description == again.description
    assert test.power > 0.5
    assert sorted(again.points.name) == sorted(found.grid.points.name)
    assert list(again.points.name) != list(found.grid.points.name)
    assert float(again.points.started_at.min()) > float(found.grid.points.started_at.max())
