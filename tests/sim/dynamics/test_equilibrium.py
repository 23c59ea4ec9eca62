"""Steady states of the full drivetrain against the steady bench."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.points import points
from tests.sim.dynamics.bench_in_motion import BENCH, MODEL, choices, drivetrain

from pmg.sim.dynamics.assumptions import Assumptions
from pmg.sim.dynamics.constants import Control
from pmg.sim.dynamics.equilibrium import equilibrium
from pmg.sim.dynamics.power import powers
from pmg.sim.dynamics.state import STATES, SetPoints, State
from pmg.sim.errors import BenchError
from pmg.sim.shafts import Member
from pmg.sim.signals import RPM
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady


@pytest.mark.parametrize("gear", [1, 2])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_forward_on_the_full_state_undoes_the_inverse_problem(gear: int, sense: float) -> None:
    speed, load = (axis.ravel() for axis in np.meshgrid([156.0, 780.0, 1872.0], [-1.5, 0.78, 1.95]))
    speed, load = sense * speed, sense * load
    at = points("engaged", speed, -speed / BENCH.gear(gear).ratio, load, gear=gear)
    wanted = steady(Gearbox.calibrated(BENCH, MODEL), at)
    state = equilibrium(drivetrain(gear=gear), wanted.torque_sun, wanted.torque_ring).state
    np.testing.assert_allclose(state[STATES.index("speed_sun")], at.speed_sun, rtol=1e-9)
    np.testing.assert_allclose(state[STATES.index("speed_ring")], at.speed_ring, rtol=1e-9)


@given(st.floats(0.5, 1.5), st.floats(0.3, 1.0), choices)
def test_energy_closes_in_steady_state(torque: float, surplus: float, chosen: Assumptions) -> None:
    train = drivetrain(chosen)
    asked = SetPoints(torque, 2.6 * (torque - 0.3 * surplus))
    x = equilibrium(train, asked.sun, asked.ring).state[:, 0]
    balance = powers(train, x, asked)
    moved = np.sum([np.abs(v) for v in (*balance.supplied.values(), *balance.dissipated.values())])
    assert abs(balance.residual) <= 1e-9 * moved
    assert abs(sum(balance.stored.values())) <= 1e-9 * moved
    rates = np.array(train.rates(x.tolist(), asked))[:-1]
    assert np.abs(rates[[2, 6, 7]]).max() < 1e-5


@pytest.mark.parametrize("surplus", [-0.4, 0.1, 0.3])
def test_with_the_sun_held_the_steady_state_rests_keeps_the_ratio_and_closes(surplus: float) -> None:
    train = replace(drivetrain(), held=Member.SUN)
    q = train.constants
    asked = SetPoints(surplus - q.Q / q.p_r, 1.0)
    x = equilibrium(train, asked.sun, asked.ring).state[:, 0]
    state, balance = State(*x), powers(train, x, asked)
    assert state.speed_ring * surplus > 1.0
    assert state.speed_carrier == pytest.approx(q.p_r / q.Q * state.speed_ring, rel=1e-9)
    assert state.speed_sun == pytest.approx(0.0, abs=1e-9)
    assert np.abs(np.array(train.rates(x.tolist(), asked))[:-1]).max() < 1e-9
    moved = np.sum([np.abs(v) for v in (*balance.supplied.values(), *balance.dissipated.values())])
    assert abs(balance.residual) <= 1e-9 * moved
    by_sun = equilibrium(replace(train, control_sun=Control.SPEED), float(state.speed_carrier), 1.0).state[:, 0]
    by_ring = equilibrium(replace(train, control_ring=Control.SPEED), asked.sun, float(state.speed_ring)).state[:, 0]
    for other in (by_sun, by_ring):
        np.testing.assert_allclose(other[4:9], x[4:9], rtol=1e-7, atol=1e-9)


def test_a_load_above_pull_out_is_refused_by_name() -> None:
    with pytest.raises(BenchError, match=r"N m on the sun against a pull-out of 2\.569"):
        equilibrium(drivetrain(), [1.0, 3.0], [2.3, 7.4])


def test_torques_that_no_drag_balances_are_refused() -> None:
    with pytest.raises(BenchError, match="does not balance"):
        equilibrium(drivetrain(), 40.0, 0.0)


def test_lossless_torques_in_the_ratio_have_no_speed_of_their_own() -> None:
    state = equilibrium(drivetrain(), 1.0, 2.6).state[:, 0]
    assert abs(state[STATES.index("speed_sun")]) < 1.0 * RPM
