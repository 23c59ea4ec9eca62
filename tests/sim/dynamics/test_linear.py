"""Small motions: names of the modes, stability of the torque loops, frequency response."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.sim.dynamics.bench_in_motion import drivetrain

from pmg.sim.dynamics.assumptions import Assumptions
from pmg.sim.dynamics.equilibrium import equilibrium
from pmg.sim.dynamics.jacobian import dense
from pmg.sim.dynamics.linear import ModeKind, check_control, frequency_response, linearise
from pmg.sim.dynamics.programme import Programme
from pmg.sim.dynamics.state import SetPoints
from pmg.sim.dynamics.transient import Task, transient
from pmg.sim.errors import BenchError

HOLD = Programme.hold(0.0)


def test_modes_of_the_bench_at_speed() -> None:
    train = drivetrain()
    modes = linearise(train, equilibrium(train, 1.0, 2.3).state[:, 0])
    kinds = [mode.kind for mode in modes]
    magnetic = [mode for mode in modes if mode.kind is ModeKind.MAGNETIC]
    (speed,) = (mode for mode in modes if mode.kind is ModeKind.SPEED)
    assert len(magnetic) == 2
    assert magnetic[0].eigenvalue == pytest.approx(magnetic[1].eigenvalue.conjugate())
    assert magnetic[0].frequency == pytest.approx(103.0, rel=0.01)  # 16 Hz
    assert 0.01 < magnetic[0].damping_ratio < 0.03
    assert speed is modes[0]
    assert -0.3 < speed.eigenvalue.real < -0.05
    assert modes[-1].kind is ModeKind.LOOP_RING
    assert modes[-1].eigenvalue.real < -1e6
    assert {ModeKind.RESET_SUN, ModeKind.RESET_RING, ModeKind.CARRIER, ModeKind.JOINT_SUN} <= set(kinds)
    assert all(mode.eigenvalue.real < 0.0 for mode in modes)


def test_the_magnetic_frequency_is_that_of_the_rotors_on_the_field() -> None:
    """Rigid joints: sun and ring side oscillate against each other on the field's stiffness."""
    train = drivetrain()
    q = train.constants
    J_s, J_r = q.J_s + q.sun.inertia, q.J_r + q.ring.inertia
    expected = np.sqrt(2.57 / q.p_s * (q.p_s**2 / J_s + q.p_r**2 / J_r))
    found = [m.frequency for m in linearise(train, np.zeros(20)) if m.kind is ModeKind.MAGNETIC]
    assert found[0] == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("lag", [1e-3, 0.01, 0.03])
def test_a_slow_derivative_filter_with_a_fast_sensor_is_unstable(lag: float) -> None:
    train = drivetrain(Assumptions(derivative_filter=100.0, sensor_lag=lag))
    verdict = check_control(train)
    assert not verdict.stable
    assert "unstable" in verdict.statement
    assert verdict.worst.kind in (ModeKind.LOOP_SUN, ModeKind.JOINT_SUN)
    with pytest.raises(BenchError, match=r"N = 100 1/s, sensor lag .*grows at .*Use the ideal derivative"):
        transient(Task(train, HOLD, HOLD, 1.0))


@pytest.mark.parametrize(
    ("derivative_filter", "lag"), [(None, 1e-3), (None, 0.01), (None, 1.0), (100.0, 0.1), (1e5, 0.01)]
)
def test_settings_that_are_stable(derivative_filter: float | None, lag: float) -> None:
    verdict = check_control(drivetrain(Assumptions(derivative_filter=derivative_filter, sensor_lag=lag)))
    assert verdict.stable
    assert "stable" in verdict.statement


def test_an_unstable_verdict_is_borne_out_by_the_motion() -> None:
    """The equations of motion themselves, started on the growing mode, grow and swing as the eigenvalue says."""
    train = drivetrain(Assumptions(derivative_filter=100.0))
    values, vectors = np.linalg.eig(dense(train, np.zeros(20)))
    growing = int(np.argmax(values.real))
    value, mode = values[growing], 1e-6 * vectors[:, growing]
    end = 0.01
    run = solve_ivp(
        lambda _, y: np.array(train.rates(y.tolist(), SetPoints())),
        (0.0, end),
        mode.real,
        method="DOP853",
        rtol=1e-8,
        atol=1e-14,
    )
    assert value.real == pytest.approx(check_control(train).worst.eigenvalue.real, rel=1e-9)
    assert value.real * end > 3.0
    expected = (mode * np.exp(value * end)).real
    np.testing.assert_allclose(run.y[:, -1], expected, atol=1e-3 * np.abs(expected).max())


def test_slow_torque_turns_into_the_speed_that_the_balance_gives() -> None:
    train = drivetrain()
    step = 1e-4
    near = equilibrium(train, [1.0 - step, 1.0 + step], [2.3, 2.3]).state
    state = equilibrium(train, 1.0, 2.3).state[:, 0]
    response = frequency_response(train, state, np.array([1e-7]))
    slope = (near[6, 1] - near[6, 0]) / (2.0 * step)
    assert response.speed_sun[0].real == pytest.approx(slope, rel=1e-4)
    assert response.speed_ring[0] == pytest.approx(-response.speed_sun[0] / 2.6, rel=1e-4)


@pytest.mark.parametrize("side", ["sun", "ring"])
def test_the_resonance_stands_where_the_mode_says(side: str) -> None:
    train = drivetrain()
    frequency = np.linspace(60.0, 160.0, 2001)
    response = frequency_response(train, equilibrium(train, 1.0, 2.3).state[:, 0], frequency, side)
    (resonance,) = response.resonances
    assert resonance.kind is ModeKind.MAGNETIC
    peak = frequency[np.abs(response.speed_ring).argmax()]
    assert peak == pytest.approx(resonance.frequency, rel=0.02)


def test_only_the_two_motors_can_be_varied() -> None:
    with pytest.raises(BenchError, match="sun or ring"):
        frequency_response(drivetrain(), np.zeros(20), np.ones(1), "carrier")
