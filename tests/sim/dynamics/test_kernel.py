"""The compiled solver against the equations as they are written, and against the reference solver."""

from __future__ import annotations

import stat
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.sim.dynamics.bench_in_motion import BENCH, CURVE, MODEL, SIZES, drivetrain, states
from tests.slow import SLOW, slow

from pmg.sim.dynamics import kernelcache
from pmg.sim.dynamics.account import integrands
from pmg.sim.dynamics.assumptions import Assumptions
from pmg.sim.dynamics.codegen import _elimination_order, solver_text
from pmg.sim.dynamics.constants import Control
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.jacobian import dense
from pmg.sim.dynamics.kernel import kernel_of
from pmg.sim.dynamics.programme import Programme
from pmg.sim.dynamics.state import STATES, SetPoints
from pmg.sim.dynamics.structure import survey
from pmg.sim.dynamics.tracing import _Traced, formulas
from pmg.sim.dynamics.transient import OnSlip, Solver, Task, transient, transients
from pmg.sim.errors import BenchError
from pmg.sim.grid import Configuration
from pmg.sim.maps.analytic import Cogging, analytic_map
from pmg.sim.mechanisms import EddyDamping
from pmg.sim.shafts import Member
from pmg.sim.signals import Array, Number

SUN, RING = Programme.ramp(1.0, 1.0), Programme.ramp(2.3, 1.0)
SPEEDS = [STATES.index(name) for name in ("speed_sun", "speed_ring", "speed_carrier")]

BASE = drivetrain(Assumptions(start_phase=1.0))
MODES = {
    "engaged": BASE,
    "engaged, motors without limits": BASE.unlimited,
    "look-ups without sign": replace(BASE, assumptions=replace(BASE.assumptions, friction_signed=False)),
    "free carrier": replace(BASE, held=Member.RING),
    "neutral, speeds held": replace(
        BASE, configuration=Configuration.NEUTRAL, control_sun=Control.SPEED, control_ring=Control.SPEED
    ),
    "harmonics and cogging": replace(
        BASE, torque_map=analytic_map(BENCH.gear(1), harmonics={3: 0.1}, cogging_sun=Cogging(0.02))
    ),
}
"""One drivetrain for each kind of structure."""

ALIKE = ("engaged, motors without limits", "look-ups without sign", "neutral, speeds held", "harmonics and cogging")
"""Kinds that differ from the first by terms left out or put in; each takes as long to compile as any."""

modes = st.sampled_from([*MODES.values(), replace(BASE, held=Member.SUN)] if SLOW else [BASE])
four = st.tuples(*[st.floats(-5.0, 5.0)] * 4)


@settings(deadline=None)
@given(modes, states, four)
def test_the_generated_equations_are_the_written_ones(
    train: Drivetrain, state: Array, asked: tuple[float, ...]
) -> None:
    kernel = kernel_of(train)
    written = np.array(train.rates(state.tolist(), SetPoints(*asked)), dtype=np.float64)
    scale = np.abs(dense(train.unlimited, state)) @ (np.abs(state) + SIZES)
    assert (np.abs(kernel.rates(state, np.array(asked)) - written) <= 1e-12 * (scale + np.abs(written))).all()


@settings(deadline=None)
@given(modes, states)
def test_the_generated_jacobian_is_the_complex_step_one(train: Drivetrain, state: Array) -> None:
    exact = dense(train, state)
    rows = np.abs(exact).max(axis=1, keepdims=True)
    np.testing.assert_allclose(kernel_of(train).jacobian(state) / rows, exact / rows, rtol=1e-11, atol=1e-14)


@settings(deadline=None)
@given(modes, states)
def test_the_generated_powers_are_the_written_ones(train: Drivetrain, state: Array) -> None:
    written = integrands(train, state)
    np.testing.assert_allclose(kernel_of(train).sums(state), written, rtol=1e-10, atol=1e-12 * np.abs(written).max())


@settings(deadline=None)
@given(modes, states, st.floats(-7.0, 0.0), st.integers(0, 19))
def test_the_factors_solve_the_stages(train: Drivetrain, state: Array, exponent: float, row: int) -> None:
    d = 4.0 / 10.0**exponent
    right = np.eye(20)[row] * SIZES
    matrix = d * np.eye(20) - dense(train, state)
    x = kernel_of(train).solution(state, d, right)
    assert (np.abs(matrix @ x - right) <= 1e-9 * (np.abs(matrix) @ np.abs(x) + np.abs(right))).all()


def test_one_structure_is_made_once_for_all_numbers() -> None:
    other = Drivetrain.calibrated(BENCH, replace(MODEL, c=3e-4, correction=0.7), Assumptions(sensor_lag=0.05), gear=1)
    one, two = kernel_of(drivetrain()), kernel_of(other)
    assert one.module is two.module
    assert not np.array_equal(one.parameters, two.parameters)
    assert kernel_of(drivetrain(Assumptions(derivative_filter=1e6))).module is not one.module


def test_the_integrator_is_compiled_once_for_all_structures() -> None:
    made = []
    for train in (BASE, MODES["free carrier"]):
        transient(Task(train, SUN, Programme.ramp(0.1, 1.0), 0.01))
        made.append(len(kernel_of(train).integrator.integrate.signatures))
    assert made[0] == made[1]


def test_a_state_may_be_part_of_a_larger_array() -> None:
    kernel, asked = kernel_of(BASE), np.zeros(4)
    apart = np.repeat(SIZES, 2)[::2]
    apart.flags.writeable = False
    np.testing.assert_array_equal(kernel.rates(apart, asked), kernel.rates(SIZES, asked))


def error_of(rtol: float, solver: Solver, exact: Array) -> tuple[float, int]:
    times = np.linspace(0.0, 3.0, 301)
    trace = transient(Task(BASE, SUN, RING, 3.0, times=times), rtol=rtol, solver=solver)
    return float(np.abs(trace.state[SPEEDS].T - exact).max() / np.abs(exact).max()), trace.steps


@pytest.fixture(scope="module")
def exact() -> Array:
    """Speeds far below the tolerances that are compared, by the fast solver: the reference one takes a hundred times
    longer for them, and is held against them at each tolerance."""
    times = np.linspace(0.0, 3.0, 301)
    return transient(Task(BASE, SUN, RING, 3.0, times=times), rtol=1e-10, solver=Solver.COMPILED).state[SPEEDS].T


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, pytest.param(1e-8, marks=slow)])
def test_fast_and_reference_solver_agree_within_their_tolerance(rtol: float, exact: Array) -> None:
    assert error_of(rtol, Solver.COMPILED, exact)[0] < 30.0 * rtol
    assert error_of(rtol, Solver.RADAU, exact)[0] < 30.0 * rtol


def test_the_method_converges_with_order_four(exact: Array) -> None:
    """Where the steps resolve the magnetic oscillation and the torque loops are quasi-steady.

    Below a tolerance of 1e-7 the order falls to between 2 and 3, as it does for Rosenbrock methods on stiff problems;
    the error still follows the tolerance. Between steps the dense output is of order three, so the end is read.
    """
    ends = []
    for rtol in (1e-4, 1e-6):
        trace = transient(Task(BASE, SUN, RING, 3.0, times=np.array([3.0])), rtol=rtol)
        ends.append((trace.steps, np.abs(trace.state[SPEEDS, -1] - exact[-1]).max()))
    (few, large), (many, small) = ends
    assert np.log(large / small) / np.log(many / few) > 3.5


@pytest.mark.parametrize("name", [pytest.param(k, marks=slow if k in ALIKE else ()) for k in MODES])
def test_every_mode_agrees_with_the_reference_and_closes_its_energy(name: str) -> None:
    train = MODES[name]
    by_speed = train.control_sun is Control.SPEED
    load = -3.3 if train.held is Member.RING else 2.3
    asked = (Programme.ramp(60.0, 0.5), Programme.ramp(-30.0, 0.5)) if by_speed else (SUN, Programme.ramp(load, 1.0))
    fast, slow = (transient(Task(train, *asked, 1.2), rtol=1e-7, solver=solver) for solver in Solver)
    speeds = [i for i, state in enumerate(STATES) if state.startswith("speed_")]
    np.testing.assert_allclose(fast.state[speeds], slow.state[speeds], atol=1e-5)
    for trace in (fast, slow):
        assert abs(trace.energy.residual) < 1e-6
    for group in ("supplied", "dissipated", "stored"):
        for element, energy in getattr(slow.energy, group).items():
            assert getattr(fast.energy, group)[element] == pytest.approx(energy, abs=1e-6 * slow.energy.turnover)


def test_slip_and_lock_are_seen_alike() -> None:
    beyond = Programme.ramp(4.0, 0.5), Programme.ramp(10.0, 0.5)
    fast, slow = (transient(Task(drivetrain(), *beyond, 3.0), rtol=1e-7, solver=solver) for solver in Solver)
    assert fast.time[-1] == pytest.approx(slow.time[-1], rel=1e-6)
    assert abs(fast["phase"][-1]) == pytest.approx(np.pi, abs=1e-6)
    assert str(fast.stopped)[:20] == str(slow.stopped)[:20]
    fast, slow = (
        transient(Task(drivetrain(), *beyond, 0.5), rtol=1e-7, solver=solver, on_slip=OnSlip.GO_ON) for solver in Solver
    )
    assert len(slow.slips) > 20
    np.testing.assert_allclose(fast.slips, slow.slips, rtol=1e-6)
    fast, slow = (transient(Task(BASE, SUN, RING, 4.0), rtol=1e-6, solver=solver) for solver in Solver)
    assert fast.locked_at == pytest.approx(slow.locked_at, abs=2e-3)


def test_a_sweep_is_followed_as_it_is_written() -> None:
    swept = Programme.ramp(1.0, 0.2).sweep(0.1, 5.0, 60.0, begin=0.5, over=1.0)
    fast, slow = (transient(Task(drivetrain(), swept, RING, 2.0), rtol=1e-8, solver=solver) for solver in Solver)
    np.testing.assert_allclose(fast["speed_sun"], slow["speed_sun"], atol=1e-5)
    lead = BASE.assumptions.sensor_lag * np.abs(swept.slope(fast.time)).max()
    np.testing.assert_allclose(fast.torque_sun[100:], swept.value(fast.time)[100:], atol=1.1 * lead)
    assert np.abs(fast.torque_sun - swept.value(fast.time)).max() > 0.5 * lead


def test_many_runs_are_the_single_ones() -> None:
    loads = (2.2, 2.3, 2.4)
    tasks = [Task(BASE, SUN, Programme.ramp(load, 1.0), 2.0) for load in loads]
    for together, load in zip(transients(tasks, rtol=1e-6, threads=2), loads, strict=True):
        alone = transient(Task(BASE, SUN, Programme.ramp(load, 1.0), 2.0))
        np.testing.assert_array_equal(together.state, alone.state)
        with pytest.raises(BenchError, match="not summed"):
            _ = together.energy


@given(st.sets(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=20))
def test_every_pivot_is_eliminated_once(pattern: set[tuple[int, int]]) -> None:
    assert sorted(_elimination_order(pattern, 6)) == list(range(6))


def test_the_text_is_the_same_every_time() -> None:
    assert solver_text(formulas(drivetrain()), True) == solver_text(formulas(drivetrain()), True)


def test_a_question_about_a_number_is_refused_while_tracing() -> None:
    traced = formulas(drivetrain()).rates[0]
    with pytest.raises(TypeError, match="make that a flag"):
        bool(_Traced(traced))
    with pytest.raises(TypeError, match=r"numpy\.floor"):
        np.floor(_Traced(traced))


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv(kernelcache.SETTING, str(tmp_path / "file" / "below"))
    module = kernelcache.load_solver("structure", True, lambda cache: f"CACHE = {cache}\n")
    assert module.CACHE is False


def test_the_cache_is_the_users_own_and_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(kernelcache.SETTING, str(tmp_path / "cache"))
    texts = iter(["FIRST = True\n"])
    for _ in range(2):
        assert kernelcache.load_solver("structure", True, lambda _: next(texts)).FIRST
    assert stat.S_IMODE((tmp_path / "cache").stat().st_mode) == 0o700
    assert [path.suffix for path in (tmp_path / "cache").iterdir() if path.is_file()] == [".py"]


@slow
def test_a_mechanism_from_elsewhere_is_compiled_but_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Doubled(EddyDamping):
        def drag(self, speed: Number, rest: float = 0.0) -> Number:
            return 2.0 * super().drag(speed, rest)

    monkeypatch.setenv(kernelcache.SETTING, str(tmp_path))
    train = Drivetrain(BENCH, (Doubled(2e-4),))
    twice = Drivetrain(BENCH, (EddyDamping(4e-4),))
    state = SIZES * 0.3
    asked = np.zeros(4)
    np.testing.assert_allclose(kernel_of(train).rates(state, asked), kernel_of(twice).rates(state, asked), rtol=1e-12)
    kept = [path for path in tmp_path.glob("*.py") if "def rates" in path.read_text(encoding="utf-8")]
    assert len(kept) == 1, "the other one's; the integrator may be kept, too"
    assert survey(train)[1] != survey(twice)[1]
    assert CURVE.powers == (0.0, 0.5, 1.0)
