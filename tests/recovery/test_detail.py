"""More detailed forms of mechanisms: what they have in common with the simple ones, and when the data call for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.points import joined, points
from tests.trials.strata_by_name import find_stratum

from pmg.pipeline.diagnosis.engine.explanation import Explanation, all_in_detail, explain_with, swapped
from pmg.pipeline.diagnosis.grid.candidates import Candidate, GridProblem, candidates, grid_problem, refinement
from pmg.pipeline.diagnosis.grid.catalogue import FINER, MECHANISMS
from pmg.pipeline.diagnosis.grid.fitting import fit_candidate
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.pipeline.trials.nature import ConcealedCampaign, draw_case, measure_case
from pmg.sim.bench import BenchParameters
from pmg.sim.grid import Configuration
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.mechanisms.base import Mechanism, Torques, Warmth
from pmg.sim.mechanisms.field import ResidualCoupling, ResidualCouplingOfStages
from pmg.sim.mechanisms.friction import MixedLubrication, MixedLubricationExponent, Windage, WindagePower
from pmg.sim.mechanisms.instruments import (
    KNOTS,
    Crosstalk,
    CrosstalkBySense,
    GainBySense,
    GainError,
    WanderingZero,
)
from pmg.sim.mechanisms.load import (
    LoadFriction,
    LoadFrictionPower,
    LoadIronLoss,
    LoadIronLossPower,
    RelativeBearingDrag,
    RelativeBearingUnderLoad,
)
from pmg.sim.mechanisms.thermal import WarmingInTwoSteps

CURVE = LossCurve((0.0, 0.5, 1.0), np.array([0.01, 0.05, 0.03]), 100.0, 200.0)


def drawn_as(stratum: str, law: str) -> tuple[ConcealedCampaign, np.random.Generator]:
    """A campaign of a stratum whose effect follows that law."""
    for seed in range(200):
        rng = np.random.default_rng(seed)
        case = draw_case(find_stratum(stratum), rng)
        if case.effects[0].effect.knobs["law"] == law:
            return case, rng
    raise AssertionError(f"no {law} in 200 draws of {stratum}")


def staged(stratum: str, law: str, bench: BenchParameters) -> GridProblem:
    case, rng = drawn_as(stratum, law)
    analysis = analyse(measure_case(case, rng), AnalysisOptions(), bench)
    assert analysis.floor is not None
    assert analysis.calibration is not None
    readings = take_readings(analysis.grid, bench)
    return grid_problem(readings, bench, analysis.calibration.model, whitener(readings, bench, analysis.floor))


def candidate(identifier: str, shaft: str) -> Candidate:
    (found,) = (c for c in candidates() if (c.identifier, c.shaft) == (identifier, shaft))
    return found


@given(
    zeros=st.lists(st.floats(-0.1, 0.1), min_size=KNOTS, max_size=KNOTS),
    spacing=st.floats(300.0, 14400.0),
)
def test_a_wandering_zero_starts_at_the_tare_and_passes_the_given_zeros(zeros: list[float], spacing: float) -> None:
    wandering = replace(
        WanderingZero(), spacing=spacing, **dict(zip(WanderingZero.by_shaft["sun"], zeros, strict=True))
    )
    moved = wandering.moved(spacing * np.r_[np.arange(KNOTS + 1.0), 1e3])
    assert moved.sun[0] == 0.0
    np.testing.assert_allclose(moved.sun[1:-1], zeros, atol=1e-12)
    assert moved.sun[-1] == zeros[-1]
    assert not np.any(moved.ring)


@given(part=st.floats(-0.2, 0.2), even=st.floats(-0.2, 0.2), torque=st.floats(0.1, 20.0))
def test_crosstalk_by_sense_is_another_part_for_each_sense(part: float, even: float, torque: float) -> None:
    at = points("engaged", [100.0, 100.0], [-30.0, -30.0])
    true = Torques(np.zeros(2), np.array([torque, -torque]))
    shown = CrosstalkBySense(part_sun=part, even_sun=even).distortion(at, true).sun
    np.testing.assert_allclose(shown, [(part + even) * torque, (even - part) * torque], atol=1e-12)
    plain = Crosstalk(part_sun=part).distortion(at, true).sun
    np.testing.assert_array_equal(CrosstalkBySense(part_sun=part).distortion(at, true).sun, plain)


@given(gain=st.floats(-0.2, 0.2), sided=st.floats(-0.2, 0.2), torque=st.floats(0.1, 20.0))
def test_a_gain_by_sense_is_another_gain_for_each_sense(gain: float, sided: float, torque: float) -> None:
    at = points("engaged", [100.0, 100.0], [-30.0, -30.0])
    true = Torques(np.zeros(2), np.array([torque, -torque]))
    shown = GainBySense(gain_ring=gain, sided_ring=sided).distortion(at, true).ring
    np.testing.assert_allclose(shown, [(gain + sided) * torque, (sided - gain) * torque], atol=1e-12)
    plain = GainError(gain_ring=gain).distortion(at, true).ring
    np.testing.assert_array_equal(GainBySense(gain_ring=gain).distortion(at, true).ring, plain)


@given(x=st.floats(0.0, 50.0))
def test_the_exponent_of_the_catalogue_is_one_of_the_exponents(x: float) -> None:
    assert MixedLubricationExponent(exponent=1.4).left(x) == MixedLubrication().left(x)


def test_heat_that_crosses_warms_the_other_shaft(bench: BenchParameters) -> None:
    problem = staged("lubricant_viscosity sun 4", "vogel", bench)
    at = problem.readings.grid.points
    warm = replace(WarmingInTwoSteps.of(bench, problem.model), resistance_sun=1.0, resistance_ring=1.0)
    apart, crossed = warm.rises(at), replace(warm, cross=0.5).rises(at)
    sun, ring = (replace(warm, resistance_ring=0.0).rises(at).sun, replace(warm, resistance_sun=0.0).rises(at).ring)
    np.testing.assert_allclose(crossed.sun - apart.sun, 0.5 * ring, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(crossed.ring - apart.ring, 0.5 * sun, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("stratum", "law", "kind"),
    [
        ("torque_crosstalk ring 4", "magnitude", CrosstalkBySense),
        ("torque_zero_drift sun 4", "walk", WanderingZero),
        ("lubricant_viscosity ring 4", "walther", WarmingInTwoSteps),
    ],
)
def test_data_that_call_for_detail_get_it(
    stratum: str, law: str, kind: type[Crosstalk | WanderingZero | WarmingInTwoSteps], bench: BenchParameters
) -> None:
    problem = staged(stratum, law, bench)
    found = MECHANISMS.in_detail(problem, MECHANISMS.rank(problem)[0])
    assert found.candidate.kind is kind
    (simple,) = (c for c in candidates() if refinement(c) == found.candidate)
    assert problem.score(found) > problem.score(fit_candidate(problem, simple)) + FINER


def test_data_that_do_not_call_for_detail_stay_simple(bench: BenchParameters) -> None:
    problem = staged("torque_crosstalk ring 1", "lag", bench)
    assert MECHANISMS.rank(problem)[0].candidate.kind is Crosstalk


def test_members_of_a_set_are_swapped_one_at_a_time_and_gains_add_up(bench: BenchParameters) -> None:
    problem = staged("lubricant_viscosity ring + torque_gain_error sun 2", "walther", bench)
    pair = explain_with(
        problem, MECHANISMS, (candidate("torque_gain_error", "sun"), candidate("lubricant_viscosity", "ring"))
    )
    finer = all_in_detail(problem, MECHANISMS, pair)
    assert finer.score > pair.score
    others = swapped(problem, MECHANISMS, finer)
    twin = [e for e in others if e.ids == finer.ids and e.fits[0].candidate.shaft == "ring"]
    assert len(twin) == 1
    assert twin[0].score > finer.score - 2.0
    for explanation in (finer, *others):
        left = explanation.problem.left
        assert explanation.gain == pytest.approx(float(problem.left @ problem.left - left @ left), rel=0.02)
        assert isinstance(explanation, Explanation)
        assert len(explanation.ids) == 2


@pytest.mark.parametrize(
    ("detailed", "simple", "same"),
    [
        (LoadFrictionPower, LoadFriction, {"mu_sun": 0.02, "mu_ring": 0.01}),
        (LoadIronLossPower, LoadIronLoss, {"k": 1e-4}),
        (RelativeBearingUnderLoad, RelativeBearingDrag, {"m_0": 0.01, "m_1": 0.02}),
        (WindagePower, Windage, {"k_sun": 1e-6, "k_ring": 5e-6}),
        (ResidualCouplingOfStages, ResidualCoupling, {"strength": 1e-3, "critical": 700.0}),
    ],
    ids=lambda kind: kind.__name__ if isinstance(kind, type) else "",
)
def test_a_detailed_law_holds_the_simple_one(
    detailed: type[Mechanism], simple: type[Mechanism], same: dict[str, float], bench: BenchParameters
) -> None:
    at = joined(
        points("engaged", [900.0, 300.0, -600.0], [-346.0, -115.0, 231.0], torque_ring=-1.4),
        points("neutral", [900.0, -300.0], [300.0, 200.0]),
    )
    powers = {"power": 2.0} if simple is Windage else {"power": 2.0 / 3.0} if simple is RelativeBearingDrag else {}
    powers = powers or ({"fall": 2.0} if simple is ResidualCoupling else {"power": 1.0})
    model = LossModel(CURVE, CURVE, 0.8, 5e-4, 2e-4, 0.0)
    fine = replace(detailed.of(bench, model), **same, **powers).torque(at)
    plain = replace(simple.of(bench, model), **same).torque(at)
    np.testing.assert_allclose(fine.sun, plain.sun, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(fine.ring, plain.ring, rtol=1e-12, atol=1e-18)
    assert np.any(plain.sun != 0.0)


def test_the_bearing_between_the_shafts_feels_a_load_only_when_engaged(bench: BenchParameters) -> None:
    law = replace(RelativeBearingUnderLoad.of(bench, LossModel(CURVE, CURVE, 0.8, 0.0, 0.0, 0.0)), mu=0.01)
    at = joined(points("engaged", [900.0], [-346.0], torque_ring=-1.4), points("neutral", [900.0], [300.0]))
    np.testing.assert_allclose(law.torque(at).sun, [-0.014, 0.0], atol=1e-15)
    cold = Warmth()
    assert law.in_motion(Configuration.NEUTRAL, cold).mu == 0.0
    assert law.in_motion(Configuration.ENGAGED, cold) is law
