"""Laws of the moving bench: Jacobian, energy, action and reaction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.sim.dynamics.bench_in_motion import BENCH, CURVE, SIZES, choices, drivetrain, lossless_bench, states

from pmg.sim.bench import BenchParameters
from pmg.sim.dynamics.assumptions import Assumptions
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.jacobian import dense
from pmg.sim.dynamics.power import energies, powers
from pmg.sim.dynamics.state import STATES, SetPoints
from pmg.sim.errors import BenchError
from pmg.sim.mechanisms import Mechanism, Torques
from pmg.sim.mechanisms.base import Instant
from pmg.sim.signals import Array
from pmg.sim.steady.power_chain import MotorConvention

ASKED = SetPoints(1.0, 2.3, 4.0, -3.0)
gears = st.sampled_from((1, 2))


@given(states, choices, gears)
def test_the_jacobian_agrees_with_finite_differences(state: Array, chosen: Assumptions, gear: int) -> None:
    train = drivetrain(chosen, gear)
    step = 1e-6 * SIZES
    moved = state[:, None] + np.hstack((np.diag(step), -np.diag(step)))
    up, down = np.split(np.array(np.broadcast_arrays(*train.rates(moved, ASKED))), 2, axis=1)
    exact = dense(train, state, ASKED) * SIZES
    scale = np.abs(exact).sum(axis=1, keepdims=True)
    np.testing.assert_allclose((up - down) / (2.0 * step) * SIZES / scale, exact / scale, atol=1e-5)


def test_the_jacobian_is_sparse() -> None:
    assert np.count_nonzero(dense(drivetrain().unlimited, SIZES)) == 58
    assert np.count_nonzero(dense(drivetrain(Assumptions(derivative_filter=100.0)).unlimited, SIZES)) == 56


@given(states, choices, gears)
def test_the_power_of_all_elements_adds_up_at_every_instant(state: Array, chosen: Assumptions, gear: int) -> None:
    balance = powers(drivetrain(chosen, gear), state, ASKED)
    assert abs(balance.residual) <= 1e-9 * balance.turnover


@given(states)
def test_consistent_signs_create_nothing_and_dissipate_everywhere(state: Array) -> None:
    balance = powers(drivetrain(), state, ASKED)
    assert all(value == 0.0 for value in balance.created.values())
    assert all(value >= 0.0 for value in balance.dissipated.values())


@given(states)
def test_the_signs_of_the_thesis_create_power(state: Array) -> None:
    balance = powers(drivetrain(Assumptions(motor_signs=MotorConvention.THESIS)), state, ASKED)
    q, x = BENCH.motor, dict(zip(STATES, state, strict=True))
    made = (q.torque_constant + q.back_emf_constant) * x["speed_ring_motor"] * x["current_ring"]
    assert balance.created["ring motor conversion"] == pytest.approx(made, rel=1e-12)


@given(states, choices)
def test_stored_power_is_the_rate_of_stored_energy(state: Array, chosen: Assumptions) -> None:
    train = drivetrain(chosen)
    balance = powers(train, state, ASKED).stored
    moving = state + 1e-30j * np.array(train.rates(state, ASKED))
    for name, energy in energies(train, moving).items():
        assert balance[name] == pytest.approx(np.imag(energy) / 1e-30, rel=1e-9, abs=1e-12), name


@given(states, st.floats(0.5, 2.0))
def test_energy_is_conserved_without_dissipation_and_drive(state: Array, scale: float) -> None:
    train = Drivetrain(lossless_bench(), (), Assumptions(map_scale=scale))
    balance = powers(train, state, SetPoints())
    assert sum(balance.dissipated.values()) == 0.0
    assert abs(sum(balance.stored.values())) <= 1e-12 * balance.turnover


@given(states, gears)
def test_the_three_magnetic_torques_cancel(state: Array, gear: int) -> None:
    m = drivetrain(gear=gear).motion(state, ASKED)
    assert m.magnetic_sun + m.magnetic_ring + m.magnetic_carrier == pytest.approx(0.0, abs=1e-12)


def test_pull_out_torques_are_the_published_ones() -> None:
    state = np.zeros(20)
    state[STATES.index("phase")] = np.pi / 2
    for gear, published in ((1, (2.57, 6.68, 9.25)), (2, (3.46, 5.43, 8.89))):
        m = drivetrain(gear=gear).motion(state, ASKED)
        np.testing.assert_allclose((-m.magnetic_sun, -m.magnetic_ring, m.magnetic_carrier), published, atol=0.011)


def test_states_do_not_influence_each_other(rng: np.random.Generator) -> None:
    many = rng.uniform(-1.0, 1.0, (20, 5)) * SIZES[:, None]
    train = drivetrain()
    whole = np.array(train.rates(many, ASKED))
    for i in range(5):
        np.testing.assert_allclose(np.array(train.rates(many[:, i].tolist(), ASKED)), whole[:, i], rtol=1e-12)
        np.testing.assert_allclose(dense(train, many[:, i]), dense(train, many)[i], rtol=1e-12)


def test_a_mechanism_that_is_no_law_is_refused(bench: BenchParameters) -> None:
    class Wander(Mechanism):
        title = "Wander"

        def torque(self, at: object) -> Torques:
            raise NotImplementedError(at)

    with pytest.raises(BenchError, match=r"Wander.*MotionLaw"):
        Drivetrain(bench, (Wander(),))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"sensor_lag": 0.0}, "sensor_lag: 0 s; expected 1e-05 to 10 s"),
        ({"derivative_filter": -5.0}, "derivative_filter: -5 1/s"),
        ({"map_scale": float("nan")}, "map_scale: nan 1"),
        ({"start_phase": 4.0}, "start_phase: 4 rad"),
        ({"motor_signs": "physical"}, "'consistent' or 'thesis'"),
    ],
)
def test_an_assumption_out_of_range_is_named(wrong: dict[str, float], told: str) -> None:
    with pytest.raises(BenchError, match=told):
        replace(Assumptions(), **wrong)  # type: ignore[arg-type]


def test_neutral_losses_are_not_in_the_engaged_gear() -> None:
    train = drivetrain()
    state = np.zeros(20)
    state[STATES.index("speed_sun")] = 100.0
    m = train.motion(state, ASKED)
    own = 0.8 * CURVE.torque(np.array([100.0]))[0] + 5e-4 + 2e-4 * 100.0 + 1e-3 * 100.0 / np.sqrt(101.0)
    assert -m.drag_sun == pytest.approx(own, rel=1e-12)


@given(st.floats(-300.0, 300.0), st.floats(-120.0, 120.0), st.floats(0.1, 2.0))
def test_friction_smoothed_at_rest_still_only_takes_power(sun: float, ring: float, rest: float) -> None:
    for law in drivetrain().losses:
        drag = law.at_instant(Instant(sun, ring, 0.0, 2.6, rest))
        assert drag.sun * sun <= 0.0
        assert drag.ring * ring <= 0.0
        assert law.carrier_law(sun, rest) * sun <= 0.0


@given(st.floats(11.0, 300.0), st.sampled_from((1.0, -1.0)))
def test_friction_smoothed_at_rest_is_the_measured_one_at_speed(speed: float, sense: float) -> None:
    for law in drivetrain().losses:
        smooth, sharp = (law.at_instant(Instant(sense * speed, -sense * speed, 0.0, 2.6, rest)) for rest in (0.5, 0.0))
        assert smooth.sun == pytest.approx(sharp.sun, rel=1e-14)
        assert smooth.ring == pytest.approx(sharp.ring, rel=1e-14)
