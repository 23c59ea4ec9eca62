"""What every mechanism of the library owes: bound, null, passivity, arrays, a drawn equation."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.mathtext import MathTextParser
from tests.points import joined, points

from pmg.sim.bench import load_bench
from pmg.sim.grid import OperatingPoints
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.mechanisms import BASELINE, CANDIDATES, LIBRARY, REFINED, GainError, Instrument, Mechanism
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

CURVE = LossCurve((0.0, 0.5, 1.0), np.array([0.01, 0.05, 0.03]), 100.0, 200.0)
MODEL = LossModel(CURVE, CURVE, 0.8, 5e-4, 2e-4, 1e-3)
BENCH = load_bench()


def typical(kind: type[Mechanism]) -> Mechanism:
    return replace(kind.of(BENCH, MODEL), **{p.name: p.typical for p in kind.parameters()})


EVERY = (*LIBRARY, *REFINED)
INSTANCES = (*baseline_mechanisms(MODEL, BENCH), *(typical(kind) for kind in EVERY if kind not in BASELINE))
BY_TYPE = {type(mechanism): mechanism for mechanism in INSTANCES}
speeds = st.floats(-3000.0, 3000.0)


def some_points(sun: float, ring: float) -> OperatingPoints:
    return joined(points("neutral", [sun], [ring]), points("engaged", [sun], [-sun / 2.6], 1.5))


def at_null(mechanism: Mechanism) -> Mechanism:
    return replace(mechanism, **{p.name: p.null for p in mechanism.parameters()})


def test_every_mechanism_of_the_library_has_an_instance_here() -> None:
    assert set(BY_TYPE) == set(EVERY)
    assert len({kind.identifier for kind in LIBRARY}) == len(LIBRARY)


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.__name__)
def test_parameters_have_unit_bounds_and_a_typical_value_inside(kind: type[Mechanism]) -> None:
    assert kind.parameters()
    for parameter in kind.parameters():
        low, high = parameter.bounds
        assert low < parameter.typical < high
        assert low <= parameter.null <= high
        assert parameter.unit
        assert parameter.meaning


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.__name__)
@given(sun=speeds, ring=speeds)
def test_absent_at_null(kind: type[Mechanism], sun: float, ring: float) -> None:
    torques = at_null(BY_TYPE[kind]).torque(some_points(sun, ring))
    assert not torques.sun.any()
    assert not torques.ring.any()


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.__name__)
@given(sun=speeds, ring=speeds)
def test_a_loss_only_takes_power(kind: type[Mechanism], sun: float, ring: float) -> None:
    at = some_points(sun, ring)
    power = BY_TYPE[kind].torque(at).power(at)
    assert (power <= 1e-12).all() or not kind.dissipates


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.__name__)
def test_points_do_not_influence_each_other(kind: type[Mechanism], rng: np.random.Generator) -> None:
    if kind.memory:
        pytest.skip("it remembers what was run before, and says so")
    at = joined(points("neutral", rng.uniform(-2000, 2000, 6), rng.uniform(-800, 800, 6)), some_points(900.0, 300.0))
    whole = BY_TYPE[kind].torque(at)
    for i in range(len(at)):
        one = BY_TYPE[kind].torque(at[np.array([i])])
        assert one.sun[0] == pytest.approx(whole.sun[i], rel=1e-12)
        assert one.ring[0] == pytest.approx(whole.ring[i], rel=1e-12)


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.__name__)
def test_finite_at_the_corners_of_its_bounds(kind: type[Mechanism]) -> None:
    corners = product(*(parameter.bounds for parameter in kind.parameters()))
    at = joined(some_points(0.0, 0.0), some_points(3000.0, -3000.0))
    for corner in corners:
        names = [parameter.name for parameter in kind.parameters()]
        torques = replace(BY_TYPE[kind], **dict(zip(names, corner, strict=True))).torque(at)
        assert np.isfinite(torques.sun).all()
        assert np.isfinite(torques.ring).all()


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.__name__)
def test_equation_can_be_drawn(kind: type[Mechanism]) -> None:
    MathTextParser("path").parse(f"${kind.equation}$")


@pytest.mark.parametrize("kind", [*CANDIDATES, *REFINED], ids=lambda kind: kind.__name__)
def test_sizes_and_shapes_are_its_parameters(kind: type[Mechanism]) -> None:
    names = [parameter.name for parameter in kind.parameters()]
    sizes = [name for group in kind.by_shaft.values() for name in group]
    assert sorted((*set(sizes), *kind.shape)) == sorted(names)
    assert set(kind.by_shaft) <= {"sun", "ring", "both"}
    nulls = {parameter.name: parameter.null for parameter in kind.parameters()}
    assert all(nulls[name] == 0.0 for name in sizes)


@pytest.mark.parametrize("kind", [*CANDIDATES, *REFINED], ids=lambda kind: kind.__name__)
def test_a_candidate_changes_what_is_read(kind: type[Mechanism], rng: np.random.Generator) -> None:
    sun, ring = rng.uniform(50.0, 1800.0, 12), rng.uniform(-700.0, 700.0, 12)
    load = np.tile([0.78, 1.95], 6)
    at = joined(points("neutral", sun, ring), points("engaged", sun, -sun / 2.6, load))
    at = replace(at, started_at=60.0 * np.arange(24.0))
    baseline = baseline_mechanisms(MODEL, BENCH)
    without = steady(Gearbox(BENCH, baseline), at)
    for sizes in kind.by_shaft.values():
        some = replace(kind.of(BENCH, MODEL), **{p.name: p.typical for p in kind.parameters() if p.name in sizes})
        changed = steady(Gearbox(BENCH, (*baseline, some)), at)
        moved = np.hypot(changed.torque_sun - without.torque_sun, changed.torque_ring - without.torque_ring)
        assert 1e-5 < moved.max() < 1.0
        assert isinstance(some, Instrument) or not some.dissipates or (some.torque(at).power(at) <= 1e-12).all()


def test_a_reading_with_faults_is_that_of_the_true_load() -> None:
    at = points("engaged", [900.0], [-900.0 / 2.6], 1.5)
    faults = (GainError(gain_ring=0.02, gain_sun=-0.01),)
    baseline = baseline_mechanisms(MODEL, BENCH)
    read = steady(Gearbox(BENCH, (*baseline, *faults)), at)
    true = steady(Gearbox(BENCH, baseline), replace(at, torque_ring=at.torque_ring / 1.02))
    assert read.torque_ring == pytest.approx(at.torque_ring, rel=1e-12)
    assert read.torque_sun == pytest.approx(0.99 * true.torque_sun, rel=1e-12)
