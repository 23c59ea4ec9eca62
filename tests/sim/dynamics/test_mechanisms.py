"""Mechanisms beyond the baseline in the moving bench: the same torques as at steady points, every joule told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.points import points
from tests.sim.dynamics.bench_in_motion import BENCH, MODEL, SIZES, states

from pmg.sim.dynamics.account import integrand_parts
from pmg.sim.dynamics.constants import Control
from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.equilibrium import equilibrium
from pmg.sim.dynamics.jacobian import dense
from pmg.sim.dynamics.kernel import kernel_of
from pmg.sim.dynamics.power import powers
from pmg.sim.dynamics.programme import Programme
from pmg.sim.dynamics.state import STATES, SetPoints
from pmg.sim.dynamics.transient import Solver, Task, transient
from pmg.sim.errors import BenchError
from pmg.sim.grid import Configuration, OperatingPoints
from pmg.sim.mechanisms import CANDIDATES, OTHERS, REFINED, GainError, Instrument, LubricantViscosity, Mechanism
from pmg.sim.mechanisms.base import Torques, Warmth
from pmg.sim.mechanisms.thermal import MagnetTemperature
from pmg.sim.mechanisms.warmth import warmth_at
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

KINDS: tuple[type[Mechanism], ...] = (*CANDIDATES, *REFINED)
BESIDE = tuple(kind for kind in KINDS if not issubclass(kind, Instrument))
FAULTS = tuple(kind for kind in CANDIDATES if issubclass(kind, Instrument))
CLOSE = 1e-6
COLD = Warmth()


def typical(kind: type[Mechanism]) -> Mechanism:
    return replace(kind.of(BENCH, MODEL), **{p.name: p.typical for p in kind.parameters()})


def train(
    *extra: Mechanism, configuration: Configuration = Configuration.ENGAGED, warmth: Warmth = COLD, gear: int = 1
) -> Drivetrain:
    ring = Control.SPEED if configuration is Configuration.NEUTRAL else Control.TORQUE
    beside = (*baseline_mechanisms(MODEL, BENCH), *extra)
    return Drivetrain(
        BENCH,
        beside,
        gear=gear,
        configuration=configuration,
        control_sun=Control.SPEED,
        control_ring=ring,
        warmth=warmth,
    )


def some(configuration: Configuration, gear: int = 1) -> OperatingPoints:
    speed, other = (axis.ravel() for axis in np.meshgrid([312.0, 936.0, -1872.0], [-1.5, 0.39, 1.95]))
    if configuration is Configuration.NEUTRAL:
        return points("neutral", speed, 200.0 * other)
    return points("engaged", speed, -speed / BENCH.gear(gear).ratio, other, gear=gear)


def held(*extra: Mechanism, at: OperatingPoints) -> Torques:
    """Torques of the motors where the moving bench stays."""
    found = []
    for i, warmth in enumerate(warmth_at(extra, at)):
        one = train(*extra, configuration=Configuration(at.configuration[i]), warmth=warmth, gear=int(at.gear[i]))
        asked = SetPoints(at.speed_sun[i], at.speed_ring[i] if at.neutral[i] else at.torque_ring[i])
        state = equilibrium(one, asked.sun, asked.ring).state
        moved = one.motion(state, asked)
        found.append((float(moved.sun.torque_out[0]), float(moved.ring.torque_out[0])))
    return Torques(*np.array(found).T)


@pytest.mark.parametrize("gear", [1, 2])
@pytest.mark.parametrize("configuration", [Configuration.ENGAGED, Configuration.NEUTRAL])
@pytest.mark.parametrize("kind", BESIDE, ids=lambda kind: kind.__name__)
def test_the_steady_end_is_that_of_the_steady_solver(
    kind: type[Mechanism], configuration: Configuration, gear: int
) -> None:
    mechanism, at = typical(kind), some(configuration, gear)
    wanted = steady(Gearbox(BENCH, (*baseline_mechanisms(MODEL, BENCH), mechanism)), at)
    got = held(mechanism, at=at)
    np.testing.assert_allclose(got.sun, wanted.torque_sun, atol=CLOSE, rtol=0.0)
    np.testing.assert_allclose(got.ring, wanted.torque_ring, atol=CLOSE, rtol=0.0)


@pytest.mark.parametrize("kind", BESIDE, ids=lambda kind: kind.__name__)
def test_each_mechanism_moves_the_steady_end(kind: type[Mechanism]) -> None:
    mechanism = typical(kind)
    moved = 0.0
    for configuration in (Configuration.ENGAGED, Configuration.NEUTRAL):
        at = some(configuration)
        with_it, without = held(mechanism, at=at), held(at=at)
        moved = max(
            moved, float(np.abs(with_it.sun - without.sun).max()), float(np.abs(with_it.ring - without.ring).max())
        )
    assert moved > 100.0 * CLOSE


def test_all_together_hold_what_the_steady_solver_holds() -> None:
    every = tuple(typical(kind) for kind in BESIDE if kind in CANDIDATES)
    at = some(Configuration.ENGAGED)
    wanted = steady(Gearbox(BENCH, (*baseline_mechanisms(MODEL, BENCH), *every)), at)
    np.testing.assert_allclose(held(*every, at=at).sun, wanted.torque_sun, atol=CLOSE, rtol=0.0)


@pytest.mark.parametrize("configuration", [Configuration.ENGAGED, Configuration.NEUTRAL])
@given(state=states, voltage=st.floats(-3.0, 3.0))
def test_every_joule_is_told_with_mechanisms_in(
    configuration: Configuration, state: np.ndarray, voltage: float
) -> None:
    every = tuple(typical(kind) for kind in BESIDE if kind in CANDIDATES)
    one = train(*every, configuration=configuration, warmth=Warmth(20.0, 10.0, 30.0))
    found = powers(one, state, SetPoints(voltage, 10.0 * voltage, 0.5, 0.2))
    assert abs(found.residual) <= 1e-9 * max(float(found.turnover), 1.0)
    lines = [mechanism.title for mechanism in one.losses]
    assert set(lines) <= set(found.dissipated)
    assert len(set(lines)) == len(lines)


@pytest.mark.parametrize("kind", [kind for kind in BESIDE if kind.dissipates], ids=lambda kind: kind.__name__)
@given(state=states)
def test_a_loss_takes_power_in_motion_too(kind: type[Mechanism], state: np.ndarray) -> None:
    for configuration in (Configuration.ENGAGED, Configuration.NEUTRAL):
        one = train(typical(kind), configuration=configuration)
        lost = powers(one, state, SetPoints()).dissipated.get(kind.title, 0.0)
        assert lost >= -1e-15


@pytest.fixture(scope="module")
def loaded() -> Drivetrain:
    """The structure with the most in it, compiled."""
    every = tuple(typical(kind) for kind in BESIDE if kind in CANDIDATES)
    made = train(*every, warmth=Warmth(20.0, 10.0, 30.0))
    kernel_of(made).rates(made.at_rest(), np.zeros(4))
    kernel_of(made).jacobian(made.at_rest())
    kernel_of(made).sums(made.at_rest())
    return made


@settings(max_examples=30)
@given(state=states)
def test_the_compiled_equations_are_those_as_written(loaded: Drivetrain, state: np.ndarray) -> None:
    kernel, asked = kernel_of(loaded), np.array([1.0, -2.0, 0.3, 0.1])
    slow = np.array(loaded.rates(state.tolist(), SetPoints(*asked)))
    np.testing.assert_allclose(kernel.rates(state, asked), slow, rtol=1e-9, atol=1e-9 * np.abs(slow).max())
    np.testing.assert_allclose(kernel.sums(state), integrand_parts(loaded, state), rtol=1e-9, atol=1e-12)
    matrix = dense(loaded, state)
    np.testing.assert_allclose(kernel.jacobian(state), matrix, rtol=1e-7, atol=1e-9 * np.abs(matrix).max())


def test_a_run_ends_where_the_steady_solver_says_and_its_energy_closes(loaded: Drivetrain) -> None:
    at = points("engaged", [624.0], [-240.0], 1.2)
    start = equilibrium(loaded, at.speed_sun, at.torque_ring).state[:, 0]
    other = points("engaged", [780.0], [-300.0], 1.6)
    sun = Programme.ramp(float(other.speed_sun[0]), 0.5, start=float(at.speed_sun[0]))
    ring = Programme.ramp(1.6, 0.5, start=1.2)
    trace = transient(Task(loaded, sun, ring, 25.0, start=start), rtol=1e-7)
    wanted = equilibrium(loaded, other.speed_sun, other.torque_ring).state[:, 0]
    named = [STATES.index(name) for name in ("speed_sun", "twist_sun", "twist_ring")]
    np.testing.assert_allclose(trace.last[named], wanted[named], rtol=1e-5)
    assert abs(trace.energy.residual) < 1e-5
    assert trace.energy.dissipated["Bearing friction growing with load"] > 0.0
    assert trace.energy.dissipated["Lubricant viscosity falling with temperature"] < 0.0


def test_both_solvers_agree_with_mechanisms_in(loaded: Drivetrain) -> None:
    start = equilibrium(loaded, 60.0, 1.2).state[:, 0]
    runs = [
        transient(
            Task(loaded, Programme.ramp(61.0, 0.02, start=60.0), Programme.hold(1.2), 0.04, start=start), solver=solver
        )
        for solver in (Solver.COMPILED, Solver.RADAU)
    ]
    np.testing.assert_allclose(runs[0].last / SIZES, runs[1].last / SIZES, atol=1e-4)


def test_warm_magnets_hold_less_torque() -> None:
    cold, warm = (train(typical(MagnetTemperature), warmth=Warmth(magnets=rise)) for rise in (0.0, 50.0))
    assert cold.coupling is not None
    assert warm.coupling is not None
    left = warm.coupling.pull_out.torque_high / cold.coupling.pull_out.torque_high
    assert left == pytest.approx((1.0 - 1.2e-3 * 50.0) ** 2)


@pytest.mark.parametrize("kind", FAULTS, ids=lambda kind: kind.__name__)
def test_a_fault_of_a_transducer_distorts_the_reading_and_nothing_else(kind: type[Mechanism]) -> None:
    one, plain = train(typical(kind)), train()
    state = equilibrium(plain, 60.0, 1.2).state[:, 0]
    runs = [
        transient(Task(d, Programme.hold(60.0), Programme.hold(1.2), 0.02, start=state), solver=Solver.RADAU)
        for d in (one, plain)
    ]
    assert np.array_equal(runs[0].state, runs[1].state)
    assert np.array_equal(runs[1].readings.sun, runs[1].torque_sun)
    faulty = np.abs(runs[0].readings.sun - runs[0].torque_sun)
    assert faulty[-1] > 1e-9


def test_a_gain_error_is_a_part_of_the_torque() -> None:
    one = train(GainError(gain_sun=0.02))
    run = transient(Task(one, Programme.hold(0.0), Programme.ramp(1.0, 0.1), 0.2), solver=Solver.RADAU)
    np.testing.assert_allclose(run.readings.sun, 1.02 * run.torque_sun, rtol=1e-12)
    assert np.array_equal(run.readings.ring, run.torque_ring)


@pytest.mark.parametrize("kind", OTHERS, ids=lambda kind: kind.__name__)
def test_what_has_no_law_for_a_run_is_refused_with_what_to_do(kind: type[Mechanism]) -> None:
    with pytest.raises(BenchError, match=kind.title) as refused:
        train(typical(kind))
    assert refused.value.do == kind.instead


def test_warmth_follows_the_history() -> None:
    at = points("neutral", [1872.0] * 3, [0.0] * 3, started_at=np.array([0.0, 600.0, 60_000.0]))
    viscosity = LubricantViscosity.of(BENCH, MODEL)
    viscosity = replace(viscosity, resistance_sun=1.0, idle=0.0, dwell=1.0)
    cold, warming, warm = (warmth.sun for warmth in warmth_at((viscosity,), at))
    (settled,) = warmth_at((viscosity,), replace(at[np.array([0])], started_at=np.array([np.nan])))
    assert cold == 0.0 < warming < warm
    assert warm == pytest.approx(settled.sun, rel=1e-9)
