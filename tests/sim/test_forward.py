"""Forward speeds: the inverse of the steady torques, its errors, and the derivatives of both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.points import joined, points

from pmg.sim.bench import load_bench
from pmg.sim.errors import BenchError
from pmg.sim.grid import OperatingPoints
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.maps.analytic import analytic_map
from pmg.sim.roots import rising_root
from pmg.sim.signals import Array
from pmg.sim.steady.forward import SPEED_LIMIT, _balancing_torque, _locked, forward
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

BENCH = load_bench()
CURVE_SUN = LossCurve((0.0, 1.0, 2.0, 3.0), np.array([0.02, 0.35, -0.3, 0.12]), 196.0, 196.0)
CURVE_RING = LossCurve((0.0, 0.5, 1.0), np.array([0.03, 0.1, 0.08]), 75.0, 75.0)
MODEL = LossModel(CURVE_SUN, CURVE_RING, 0.8, 5e-4, 2.2e-4, 1e-3)
GEARBOX = Gearbox.calibrated(BENCH, MODEL)
MAPS = {number: analytic_map(BENCH.gear(number)) for number in (1, 2)}
speed = st.floats(1.0, 2500.0) | st.floats(-2500.0, -1.0)
load = st.floats(-3.0, 3.0)
number = st.sampled_from((1, 2))


def engaged(sun_rpm: npt.ArrayLike, torque: Array | list[float] | float, gear: int = 1) -> OperatingPoints:
    sun = np.atleast_1d(np.asarray(sun_rpm, dtype=float))
    return points("engaged", sun, -sun / BENCH.gear(gear).ratio, torque, gear=gear)


@given(st.lists(st.tuples(speed, load, number), min_size=1, max_size=6))
def test_forward_is_the_inverse_of_steady(rows: list[tuple[float, float, int]]) -> None:
    """Either direction of rotation and of power flow, both gears mixed."""
    at = joined(*(engaged(*row) for row in rows))
    torque = steady(GEARBOX, at).torque_sun
    unknown = replace(at, speed_sun=np.full(len(at), np.nan), speed_ring=np.full(len(at), np.nan))
    found = forward(GEARBOX, unknown, torque, maps=MAPS)
    np.testing.assert_allclose(found.points.speed_sun, at.speed_sun, rtol=1e-9)
    np.testing.assert_allclose(found.points.speed_ring, at.speed_ring, rtol=1e-9)
    np.testing.assert_allclose(steady(GEARBOX, found.points).torque_sun, torque, atol=1e-13)
    assert (found.slope > 0.0).all()
    assert (found.balances <= 1).all()


@given(st.floats(1.0, 300.0), load, number)
def test_the_balance_of_forward_is_that_of_steady(sun: float, torque: float, gear: int) -> None:
    at = engaged(sun, torque, gear)
    assert _balancing_torque(GEARBOX, at)[0] == steady(GEARBOX, at).torque_sun[0]


@given(st.floats(50.0, 2500.0), load, st.floats(1e-3, 0.05))
def test_more_torque_gives_more_speed(sun: float, torque: float, more: float) -> None:
    at = engaged([sun, sun], torque)
    found = forward(GEARBOX, at, steady(GEARBOX, at).torque_sun + np.array([0.0, more]))
    slower, faster = found.points.speed_sun
    assert faster > slower


def test_power_given_is_power_dissipated_at_the_speeds_found() -> None:
    at = engaged(np.full(5, 100.0), np.linspace(-2.0, 2.0, 5))
    given_torque = at.torque_ring / 2.6 + 0.3
    found = forward(GEARBOX, at, given_torque).points
    taken = given_torque * found.speed_sun + at.torque_ring * found.speed_ring
    np.testing.assert_allclose(taken, -GEARBOX.torque(found).power(found), rtol=1e-11)


def test_torque_below_the_drag_at_rest_stalls() -> None:
    at = engaged([500.0, 500.0], [1.3, 1.3])
    with pytest.raises(
        BenchError, match=r"of P1: the motors leave 0\.01 N m on the sun, the gear stalls; expected more"
    ):
        forward(GEARBOX, at, np.array([1.0, 0.51]))


def test_torque_above_the_drag_at_the_limit_is_named() -> None:
    with pytest.raises(BenchError, match=r"above the drag up to 392\.071 rad/s; expected .* N m or less"):
        forward(GEARBOX, engaged(500.0, 1.0), np.array([9.0]))


@pytest.mark.parametrize(("gear", "torque"), [(1, 6.9), (2, 5.6), (1, -7.3)])
def test_a_coupling_that_would_slip_is_named_only_where_a_map_is_given(gear: int, torque: float) -> None:
    at = engaged(1000.0, torque, gear)
    needed = steady(GEARBOX, at).torque_sun
    assert forward(GEARBOX, at, needed).points.speed_sun[0] == pytest.approx(at.speed_sun[0], rel=1e-9)
    with pytest.raises(BenchError, match=f"load of P0: .* through the coupling of gear {gear}"):
        forward(GEARBOX, at, needed, maps=MAPS)


def test_neutral_points_and_missing_torques_are_refused() -> None:
    with pytest.raises(BenchError, match="P0: not engaged"):
        forward(GEARBOX, points("neutral", [500.0], [100.0]), np.array([1.0]))
    with pytest.raises(BenchError, match="not finite"):
        forward(GEARBOX, engaged(500.0, 1.0), np.array([np.nan]))


# --- drag that falls with speed ------------------------------------------------------------------------

FALLING = LossCurve((0.0, 1.0, 2.0, 3.0), np.array([0.1, 2.0, -6.0, 5.0]), 200.0, 200.0)
STRIBECK = Gearbox.calibrated(BENCH, LossModel(FALLING, replace(FALLING, coefficients=np.zeros(4)), 1.0, 0.0, 0.0, 0.0))


def test_of_several_balances_the_one_reached_from_rest_is_given_and_it_is_stable() -> None:
    """0.1 + 2 x - 6 x2 + 5 x3 = 0.25 has three positive roots; the middle one has a falling drag."""
    roots = np.sort(np.roots([5.0, -6.0, 2.0, 0.1 - 0.25]).real)
    assert len(roots) == 3
    assert (roots > 0.0).all()
    found = forward(STRIBECK, engaged(10.0, 0.0), np.array([0.25]))
    assert found.points.speed_sun[0] == pytest.approx(200.0 * roots[0], rel=1e-10)
    assert found.balances[0] == 3
    assert found.slope[0] > 0.0


@given(st.floats(0.11, 1.0))
def test_the_balance_given_is_always_on_rising_drag(torque: float) -> None:
    assert forward(STRIBECK, engaged(10.0, 0.0), np.array([torque])).slope[0] > 0.0


# --- roots ---------------------------------------------------------------------------------------------


@given(st.lists(st.floats(-0.99, 0.99), min_size=1, max_size=5))
def test_a_rising_root_is_found_although_newton_alone_runs_away(centres: list[float]) -> None:
    at = np.array(centres)

    def steep(x: Array) -> tuple[Array, Array]:
        return np.arctan(1e3 * (x - at)), 1e3 / (1.0 + (1e3 * (x - at)) ** 2)

    roots, _ = rising_root(steep, np.full_like(at, -1.0), np.full_like(at, 1.0))
    np.testing.assert_allclose(roots, at, atol=4e-15)


def test_an_equation_without_a_value_is_named() -> None:
    with pytest.raises(BenchError, match=r"equation 1: nan at 0\.5"):
        rising_root(lambda x: (np.array([0.0, np.nan]), np.ones(2)), np.zeros(2), np.ones(2))


# --- derivatives ---------------------------------------------------------------------------------------


def test_the_slope_with_speed_is_that_of_the_laws() -> None:
    """Eddy damping alone: c on the sun, and c over the squared ratio from the ring."""
    alone = Gearbox.calibrated(BENCH, replace(MODEL, correction=0.0, b=0.0, d=0.0))
    at, speed = engaged(100.0, 1.0), SPEED_LIMIT / 3.0
    low, high = (_balancing_torque(alone, _locked(alone, at, np.array([speed * part])))[0] for part in (0.999, 1.001))
    assert (high - low) / (0.002 * speed) == pytest.approx(MODEL.c * (1.0 + 1.0 / 2.6**2), rel=1e-9)
