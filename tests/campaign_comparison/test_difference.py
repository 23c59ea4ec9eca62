"""B minus A: exactly nothing for one campaign, a planted shift with its size, noise no more often than it should."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from tests.campaign_comparison.campaigns import BENCH, MODEL, NOISE, OPTIONS, grid, side, with_readings

from pmg.pipeline.campaign_comparison.constants import constant_differences, curve_differences
from pmg.pipeline.campaign_comparison.difference import Versus, subtract
from pmg.pipeline.campaign_comparison.family import LinearEstimate
from pmg.pipeline.campaign_comparison.matching import Reach
from pmg.pipeline.campaign_comparison.side import CampaignSide
from pmg.pipeline.campaign_comparison.statement import _clearest, alike, statement
from pmg.pipeline.campaign_comparison.verdict import SIGNIFICANCE, _ready_family, judge
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.store.manifest import Manifest
from pmg.sim.errors import GridError
from pmg.sim.signals import RPM, Array
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

REACH = Reach()


def test_a_campaign_differs_from_itself_by_exactly_nothing(rng: np.random.Generator) -> None:
    versus = subtract(side("A", 1), side("B", 1), REACH)
    assert len(versus.matching) == len(versus.a.grid)
    for found in versus.quantities.values():
        assert found.compared.any()
        assert (found.value[found.compared] == 0.0).all()
        assert not found.beyond.any()
    judged = judge(versus, rng, 199)
    assert judged is not None
    assert judged.p_value == judged.p_readings == 1.0
    assert all(one.value == 0.0 for one in constant_differences(versus))
    assert all((curve.value == 0.0).all() for curve in curve_differences(versus))
    assert statement(versus, judged).startswith("No difference beyond noise")


def test_a_planted_shift_of_the_sun_torque_is_found_with_its_size(rng: np.random.Generator) -> None:
    planted = 5e-3
    versus = subtract(side("A", 1), side("B", 2, shift_sun=planted), REACH)
    judged = judge(versus, rng, 499)
    assert judged is not None
    assert judged.differ
    group = next(group for group in judged.groups if group.words == "sun torque, neutral")
    assert group.mean.value == pytest.approx(planted, abs=3.0 * group.mean.u)
    assert group.mean.u < 0.1 * planted
    at = versus.at.engaged
    loss, own, common = versus.quantities["loss_total"].mean(at)
    expected = planted * float(versus.at.speed_sun[at].mean())
    assert loss == pytest.approx(expected, abs=3.0 * np.hypot(own, common))
    assert "B loses" in statement(versus, judged)
    assert "more than A" in statement(versus, judged)


def test_other_transducers_may_explain_a_shift_that_the_same_ones_cannot(rng: np.random.Generator) -> None:
    """2 mN m is within the non-linearity of two transducers, and far beyond the noise of one."""
    same = judge(subtract(side("A", 1), side("B", 2, shift_sun=2e-3), REACH), rng, 499)
    two = subtract(side("A", 1), side("B", 2, serial="two", shift_sun=2e-3), REACH)
    other = judge(two, rng, 499)
    assert same is not None
    assert other is not None
    assert same.differ
    assert not other.differ
    assert other.readings_differ
    assert "no more than the tolerances of the transducers" in statement(two, other)


def test_a_loss_of_sensitivity_is_followed_against_torque(rng: np.random.Generator) -> None:
    a, b = side("A", 1), side("B", 2)
    moved = with_readings(b, 1.02 * b.grid.torque_sun, b.grid.torque_ring)
    versus = subtract(a, moved, REACH)
    judged = judge(versus, rng, 499)
    assert judged is not None
    engaged = next(group for group in judged.groups if group.configuration == "engaged")
    assert _clearest(judged).shaft == "sun"
    best = alike(engaged)[0]
    assert best.covariate.words.startswith("torque of the shaft")
    assert best.slope.value == pytest.approx(0.02, abs=3.0 * best.slope.u)


def test_the_group_called_clearest_is_so_by_what_is_told_of_it(rng: np.random.Generator) -> None:
    """A slope that is sharp but takes up little of the variance is not told, and picks no group."""
    judged = judge(subtract(side("A", 1), side("B", 2, shift_sun=2e-3), REACH), rng, 199)
    assert judged is not None
    shifted = next(group for group in judged.groups if group.shaft == "sun" and alike(group) == ())
    sharp = LinearEstimate(1e-3, 1e-6, 0.0, 0.0)
    followed = tuple(replace(one, share=0.1, slope=sharp) for one in shifted.followed)
    none = replace(shifted, mean=LinearEstimate(0.0, 1e-3, 0.0, 1.0), followed=followed, p_value=0.0)
    assert _clearest(replace(judged, groups=(none, shifted))) is shifted
    weak = replace(shifted, mean=LinearEstimate(1e-3, 1e-3, 0.0, 0.3), followed=(), p_value=0.2)
    assert _clearest(replace(judged, groups=(weak, none))) is none


def test_recordings_that_are_in_both_campaigns_are_told() -> None:
    def of(label: str, *contents: str) -> CampaignSide:
        return replace(side(label, 1), manifests=tuple(Manifest(c, sha256=c) for c in contents))

    def told(a: CampaignSide, b: CampaignSide) -> str:
        return replace(subtract(side("A", 1), side("B", 1), REACH), a=a, b=b).in_both

    assert told(of("A", "x", "y"), of("B", "y", "x")) == "A and B are the same recordings"
    assert told(of("A", "x", "y"), of("B", "y", "z")).endswith("the same in both: 1")
    assert told(of("A", "x"), of("B", "z")) == told(of("A"), of("B")) == ""


def drawn(of: CampaignSide, truth: tuple[Array, Array], z: Array, rng: np.random.Generator) -> CampaignSide:
    """The campaign read anew: noise, and transducers off by `z` standard uncertainties of each of their errors."""
    n = len(of.grid)
    sun, ring = (torque + NOISE * rng.standard_normal(n) for torque in truth)
    causes = of.analysis.causes
    assert causes is not None
    for error, cause in zip(z, causes.transducers, strict=True):
        sun, ring = sun + error * cause.sun, ring + error * cause.ring
    return with_readings(of, sun, ring)


@pytest.mark.parametrize("serial", ["one", "two"])
def test_of_pairs_that_differ_by_nothing_five_percent_are_said_to(serial: str, rng: np.random.Generator) -> None:
    """And the mean of the sun torque is covered by its U as often as it should."""
    pairs = 200
    sides = [exact(side("A", 1)), exact(side("B", 2, serial=serial))]
    truths = [(each.grid.torque_sun, each.grid.torque_ring) for each in sides]
    causes = sides[0].analysis.causes
    assert causes is not None
    errors = len(causes.transducers)
    ready = _ready_family(subtract(sides[0], sides[1], REACH))
    assert ready is not None
    family = ready[0]
    null = family.smallest(family.drawn(999, rng))
    found, covered = 0, 0
    for _ in range(pairs):
        z = rng.standard_normal((2, errors))
        z[1] = z[0] if serial == "one" else z[1]
        a, b = (drawn(*each, rng) for each in zip(sides, truths, z, strict=True))
        versus = subtract(a, b, REACH)
        again = _ready_family(versus)
        assert again is not None
        seen = float(family.smallest(again[1][:, None])[0])
        found += bool((1 + np.count_nonzero(null <= seen)) / 1000 <= SIGNIFICANCE)
        mean, own, common = versus.quantities["torque_sun"].mean(versus.at.engaged)
        covered += abs(mean) <= 2.0 * float(np.hypot(own, common))
    for count, rate in ((found, SIGNIFICANCE), (covered, 0.954)):
        assert stats.binom.ppf(0.001, pairs, rate) <= count <= stats.binom.ppf(0.999, pairs, rate)


def exact(of: CampaignSide) -> CampaignSide:
    """The campaign without noise, its readings known to be uncertain by `NOISE`."""
    made = steady(Gearbox.calibrated(BENCH, MODEL), of.grid.points)
    same = np.full(len(of.grid), NOISE)
    known = replace(of.grid, u_sun=same, u_ring=same)
    analysis = replace(of.analysis, grid=known, floor=None)
    return with_readings(replace(of, analysis=analysis), made.torque_sun, made.torque_ring)


def test_two_campaigns_analysed_from_their_readings_raise_no_alarm_too_often(rng: np.random.Generator) -> None:
    """The whole way, noise floor estimated: 24 pairs, of which more than 5 come about once in a thousand."""
    alarms = 0
    for seed in range(24):
        a, b = (replace(side("A", 1), analysis=analyse(grid(100 + 2 * seed + i), OPTIONS, BENCH)) for i in (0, 1))
        judged = judge(subtract(a, b, REACH), rng, 199)
        assert judged is not None
        alarms += judged.differ
    assert alarms <= stats.binom.ppf(0.999, 24, SIGNIFICANCE)


def test_campaigns_without_any_noise_are_refused() -> None:
    """Simulated ones: nothing says how large a difference must be."""
    smooth = side("A", 1)
    made = steady(Gearbox.calibrated(BENCH, MODEL), smooth.grid.points)
    none = np.zeros(len(smooth.grid))
    bare = replace(smooth.grid, torque_sun=made.torque_sun, torque_ring=made.torque_ring)
    bare = replace(bare, u_sun=none, u_ring=none, within_sun=none, within_ring=none)
    floor = smooth.analysis.floor
    assert floor is not None
    silent = replace(floor, sun=replace(floor.sun, u=0.0), ring=replace(floor.ring, u=0.0))
    sides = [replace(smooth, label=label, analysis=replace(smooth.analysis, grid=bare, floor=silent)) for label in "AB"]
    with pytest.raises(GridError, match="without any noise"):
        judge(subtract(sides[0], sides[1], REACH), np.random.default_rng(1))


def test_set_points_that_differ_within_tolerance_are_corrected() -> None:
    """Readings without noise, up to 30 rpm apart, agree after the correction to a tenth of what they did before."""
    versus = subtract(exact(side("A", 1, off_rpm=0.0)), exact(side("B", 2, off_rpm=30.0)), Reach(60.0 * RPM))
    at = versus.at
    for name, rows in (("torque_sun", at.neutral), ("torque_ring", at.neutral), ("torque_sun", at.engaged)):
        found = versus.quantities[name]
        chosen = found.compared & rows
        before = float(np.sqrt(np.mean((found.b - found.a)[chosen] ** 2)))
        after = float(np.sqrt(np.mean(found.value[chosen] ** 2)))
        assert after < 0.1 * before, name
        assert not found.beyond[chosen].any(), name


def test_common_errors_of_the_same_transducer_cancel_and_of_another_add() -> None:
    same, other = (subtract(side("A", 1), side("B", 2, serial=serial), REACH) for serial in ("one", "two"))
    for name in ("torque_sun", "loss_total"):
        known = same.quantities[name].compared
        left, full = same.quantities[name].common[known], other.quantities[name].common[known]
        assert (left < 0.05 * full).all()
        np.testing.assert_allclose(full, same.quantities[name].unshared[known], rtol=1e-12)
        np.testing.assert_array_equal(same.quantities[name].own, other.quantities[name].own)


def test_swapping_the_campaigns_turns_the_difference_round() -> None:
    there = subtract(side("A", 1), side("B", 2), REACH)
    back = subtract(side("B", 2), side("A", 1), REACH)
    order = np.argsort(back.matching.b)
    np.testing.assert_array_equal(back.matching.b[order], there.matching.a)
    for name in ("torque_sun", "torque_ring"):
        one, other = mean(there, name), mean(back, name)
        assert one[0] == pytest.approx(-other[0], abs=0.2 * one[1])
        assert one[1] == pytest.approx(other[1], rel=1e-9)


def mean(versus: Versus, name: str) -> tuple[float, float, float]:
    return versus.quantities[name].mean(np.ones(len(versus.matching), dtype=bool))


def test_constants_and_curves_agree_within_their_uncertainty_and_a_planted_curve_does_not() -> None:
    versus = subtract(side("A", 1), side("B", 2), REACH)
    assert all(abs(one.value) <= 4.0 * one.u for one in constant_differences(versus) if not one.state)
    assert all((np.abs(curve.value) <= 4.0 * curve.u).all() for curve in curve_differences(versus))
    more = replace(MODEL, curve_sun=replace(MODEL.curve_sun, coefficients=MODEL.curve_sun.coefficients + 0.01))
    thicker = replace(side("B", 3), analysis=analyse(grid(3, model=more), OPTIONS, BENCH))
    sun, ring = curve_differences(subtract(side("A", 1), thicker, REACH))
    assert (sun.value > 3.0 * sun.u).sum() > 30
    assert (np.abs(ring.value) <= 4.0 * ring.u).all()
