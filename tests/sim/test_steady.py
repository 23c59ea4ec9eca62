"""Laws of the steady bench: balance of power, symmetry, ratio, either direction of flow."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.points import points

from pmg.sim.bench import load_bench
from pmg.sim.errors import BenchError
from pmg.sim.grid import OperatingPoints
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.mechanisms import GainError, LoadFriction
from pmg.sim.signals import RPM
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.power_chain import MotorConvention, _motor_electric_power, power_chain
from pmg.sim.steady.solve import holding_torques, steady

BENCH = load_bench()
CURVE = LossCurve((0.0, 0.5, 1.0), np.array([0.01, 0.05, 0.03]), 100.0, 200.0)
MODEL = LossModel(CURVE, CURVE, 0.8, 5e-4, 2e-4, 1e-3)
GEARBOX = Gearbox.calibrated(BENCH, MODEL)
LOSSLESS = Gearbox(BENCH, ())
speed = st.floats(10.0, 2500.0)
load = st.floats(-3.0, 3.0)
gear = st.sampled_from((1, 2))


def engaged(sun_rpm: float, torque: float, number: int = 1) -> OperatingPoints:
    return points("engaged", [sun_rpm], [-sun_rpm / BENCH.gear(number).ratio], torque, gear=number)


@given(speed, load, gear)
def test_power_is_conserved_without_mechanisms(sun: float, torque: float, number: int) -> None:
    at = engaged(sun, torque, number)
    grid = steady(LOSSLESS, at)
    power_in, power_out = grid.torque_sun * at.speed_sun, -grid.torque_ring * at.speed_ring
    np.testing.assert_allclose(power_in, power_out, rtol=1e-12, atol=1e-12)


@given(speed, load, gear)
def test_what_the_bench_takes_is_what_the_mechanisms_dissipate(sun: float, torque: float, number: int) -> None:
    at = engaged(sun, torque, number)
    grid = steady(GEARBOX, at)
    taken = grid.torque_sun * at.speed_sun + grid.torque_ring * at.speed_ring
    dissipated = -GEARBOX.torque(at).power(at)
    np.testing.assert_allclose(taken, dissipated, rtol=1e-9, atol=1e-9)
    assert (taken > 0.0).all()


@given(speed, load)
def test_mirrored_rotation_mirrors_the_torques(sun: float, torque: float) -> None:
    forward, backward = steady(GEARBOX, engaged(sun, torque)), steady(GEARBOX, engaged(-sun, -torque))
    np.testing.assert_allclose(forward.torque_sun, -backward.torque_sun, rtol=1e-12)


@given(speed, load, gear)
def test_a_drag_that_follows_from_the_speeds_is_summed_once_for_all_loads(
    sun: float, torque: float, number: int
) -> None:
    at, fault = engaged(sun, torque, number), GainError(gain_sun=-0.01, gain_ring=0.02)
    known = holding_torques(Gearbox(BENCH, (fault,)), at, GEARBOX.torque(at))
    whole = Gearbox(BENCH, (*GEARBOX.mechanisms, fault))
    np.testing.assert_array_equal([*known], [*holding_torques(whole, at)])
    assert whole.same_at_any_load
    assert not Gearbox(BENCH, (*whole.mechanisms, LoadFriction.of(BENCH, MODEL))).same_at_any_load


@given(speed, st.floats(10.0, 900.0))
def test_in_neutral_each_shaft_carries_its_own_whole_loss(sun: float, ring: float) -> None:
    grid = steady(GEARBOX, points("neutral", [sun], [ring]))
    np.testing.assert_allclose(grid.torque_sun, CURVE.torque(np.array([sun * RPM])), rtol=1e-12)
    np.testing.assert_allclose(grid.torque_ring, CURVE.torque(np.array([ring * RPM])), rtol=1e-12)


@pytest.mark.parametrize(("number", "ratio"), [(1, 13 / 5), (2, 11 / 7)])
def test_speed_ratio_follows_the_pole_pairs(number: int, ratio: float) -> None:
    assert BENCH.gear(number).ratio == pytest.approx(ratio, rel=1e-15)


def test_there_is_no_third_gear() -> None:
    with pytest.raises(BenchError, match="1 or 2"):
        BENCH.gear(3)


def test_bearing_shares_make_up_the_whole_loss() -> None:
    shares = BENCH.bearings
    assert shares.sun + shares.share_sun_relative == pytest.approx(1.0, abs=1e-12)
    assert shares.ring + shares.share_ring_relative == pytest.approx(1.0, abs=1e-12)


@given(speed, st.floats(0.3, 3.0), st.sampled_from(("sun", "ring")), st.sampled_from(tuple(MotorConvention)))
def test_the_power_chain_closes_in_either_direction(
    sun: float, torque: float, drive: str, convention: MotorConvention
) -> None:
    signed = torque if drive == "sun" else -torque
    at = points("engaged", [sun], [-sun / 2.6], signed, drive=drive)
    chain = power_chain(GEARBOX, steady(GEARBOX, at), BENCH, convention)
    through = chain.mechanical_in - chain.loss_between - chain.unexplained - chain.mechanical_out
    whole = chain.electric_in - chain.loss_motor_in - chain.loss_between - chain.unexplained - chain.loss_motor_out
    np.testing.assert_allclose(through, 0.0, atol=1e-9)
    np.testing.assert_allclose(whole, chain.electric_out, atol=1e-9)
    np.testing.assert_allclose(chain.unexplained, 0.0, atol=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-200.0, 200.0))
def test_a_consistent_motor_never_gives_more_than_it_takes(torque: float, speed_sun: float) -> None:
    electric = _motor_electric_power(np.array([torque]), np.array([speed_sun]), BENCH.motor, MotorConvention.CONSISTENT)
    assert electric[0] >= torque * speed_sun - 1e-12


def test_a_power_chain_of_neutral_points_is_refused() -> None:
    grid = steady(GEARBOX, points("neutral", [600.0], [300.0]))
    with pytest.raises(BenchError, match="not engaged"):
        power_chain(GEARBOX, grid, BENCH)
