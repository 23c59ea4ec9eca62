"""What every mechanism of the library owes: bound, null, passivity, arrays, a drawn equation.

Each is held to what it does: a law puts torques on the rotors, an instrument distorts readings, and what repeats within
a turn has no mean and is held to its lines. `PLANTED` shows that the contracts can be broken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
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
from pmg.sim.mechanisms import (
    BASELINE,
    CANDIDATES,
    LIBRARY,
    OTHERS,
    REFINED,
    GainError,
    HysteresisDamping,
    Instrument,
    Mechanism,
    Torques,
)
from pmg.sim.mechanisms.base import nothing, parameter
from pmg.sim.mechanisms.instruments import DriftingZero, ZeroOffset
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

CURVE = LossCurve((0.0, 0.5, 1.0), np.array([0.01, 0.05, 0.03]), 100.0, 200.0)
MODEL = LossModel(CURVE, CURVE, 0.8, 5e-4, 2e-4, 1e-3)
BENCH = load_bench()


def at_its(which: str, mechanism: Mechanism, among: tuple[str, ...] | None = None) -> Mechanism:
    """The mechanism with its parameters, or those among these, ``typical`` or ``null``."""
    kept = (p for p in mechanism.parameters() if among is None or p.name in among)
    return replace(mechanism, **{p.name: getattr(p, which) for p in kept})


def typical(kind: type[Mechanism]) -> Mechanism:
    return at_its("typical", kind.of(BENCH, MODEL))


EVERY = (*LIBRARY, *REFINED)
ACTING = tuple(kind for kind in EVERY if kind not in OTHERS)
"""Those that act on mean torques or on mean readings."""
TO_NAME = (*CANDIDATES, *REFINED)
INSTANCES = (*baseline_mechanisms(MODEL, BENCH), *(typical(kind) for kind in EVERY if kind not in BASELINE))
BY_TYPE = {type(mechanism): mechanism for mechanism in INSTANCES}
speeds = st.floats(-3000.0, 3000.0)


def some_points(sun: float, ring: float) -> OperatingPoints:
    """A neutral and an engaged point, ten minutes apart."""
    at = joined(points("neutral", [sun], [ring]), points("engaged", [sun], [-sun / 2.6], 1.5))
    return replace(at, started_at=600.0 * np.arange(2.0))


def many_points(rng: np.random.Generator) -> OperatingPoints:
    """Neutral and engaged, forwards and backwards, under half a dozen loads, ten minutes apart."""
    sun, ring = rng.uniform(-2000.0, 2000.0, 12), rng.uniform(-800.0, 800.0, 12)
    load = np.tile([-1.95, 0.78, 1.56], 4)
    at = joined(points("neutral", sun, ring), points("engaged", sun, -sun / 2.6, load))
    return replace(at, started_at=600.0 * np.arange(24.0))


def effect(mechanism: Mechanism, at: OperatingPoints) -> Torques:
    """What it does at steady points [N m]: an instrument to readings of some torques, another to the rotors."""
    if isinstance(mechanism, Instrument):
        turn = np.linspace(0.0, 5.0, len(at))
        return mechanism.distortion(at, Torques(0.4 + np.cos(turn), -0.1 + np.sin(turn)))
    return mechanism.torque(at)


def both(found: Torques) -> np.ndarray:
    return np.stack([found.sun, found.ring])


# --- the contracts: a mechanism at typical values, of any kind -----------------------------------------------


def acts(mechanism: Mechanism, rng: np.random.Generator) -> None:
    """At typical values it does something; nothing below could be broken otherwise."""
    at = many_points(rng)
    if mechanism.shape:
        mechanism = at_its("typical", mechanism)
    assert np.abs(both(effect(mechanism, at))).max() > 1e-6


def absent_at_null(mechanism: Mechanism, rng: np.random.Generator) -> None:
    assert not both(effect(at_its("null", mechanism), many_points(rng))).any()


def only_takes_power(mechanism: Mechanism, rng: np.random.Generator) -> None:
    at = many_points(rng)
    power = effect(mechanism, at).power(at)
    assert (power <= 1e-12).all()
    assert power.min() < -1e-6


def remembers_as_it_says(mechanism: Mechanism, rng: np.random.Generator) -> None:
    """Alone a point is what it is among the others, unless the mechanism has a memory: then some are not."""
    at = many_points(rng)
    turn = np.linspace(0.0, 5.0, len(at))
    true = Torques(0.4 + np.cos(turn), -0.1 + np.sin(turn))

    def of(rows: np.ndarray) -> Torques:
        part = Torques(true.sun[rows], true.ring[rows])
        return mechanism.distortion(at[rows], part) if isinstance(mechanism, Instrument) else mechanism.torque(at[rows])

    whole = both(of(np.arange(len(at))))
    alone = np.hstack([both(of(np.array([i]))) for i in range(len(at))])
    apart = np.abs(whole - alone).max()
    assert (apart > 1e-6) if mechanism.memory else (apart <= 1e-12 * np.abs(whole).max())


def grows_with_its_sizes(mechanism: Mechanism, rng: np.random.Generator) -> None:
    """Twice the sizes, twice the effect, where it says that it is linear; else not."""
    at, names = many_points(rng), {name for group in mechanism.by_shaft.values() for name in group}
    once = at_its("typical", mechanism)
    twice = replace(once, **{p.name: 2.0 * p.typical for p in mechanism.parameters() if p.name in names})
    straight = np.allclose(both(effect(twice, at)), 2.0 * both(effect(once, at)), rtol=1e-9, atol=1e-15)
    assert straight == mechanism.linear


def sits_on_its_shaft(mechanism: Mechanism, rng: np.random.Generator) -> None:
    """With the sizes of one shaft alone, the other one feels nothing."""
    at, absent = many_points(rng), at_its("null", mechanism)
    for shaft, sizes in mechanism.by_shaft.items():
        found = effect(at_its("typical", absent, (*sizes, *mechanism.shape)), at)
        assert found.sun.any() == (shaft in ("sun", "both"))
        assert found.ring.any() == (shaft in ("ring", "both"))


CONTRACTS: tuple[tuple[Callable[[Mechanism, np.random.Generator], None], tuple[type[Mechanism], ...]], ...] = (
    (acts, ACTING),
    (absent_at_null, ACTING),
    (only_takes_power, tuple(kind for kind in ACTING if kind.dissipates)),
    (remembers_as_it_says, ACTING),
    (grows_with_its_sizes, TO_NAME),
    (sits_on_its_shaft, TO_NAME),
)


@pytest.mark.parametrize(
    ("contract", "kind"),
    [
        pytest.param(contract, kind, id=f"{contract.__name__}-{kind.__name__}")
        for contract, kinds in CONTRACTS
        for kind in kinds
    ],
)
def test_the_contract_is_kept(
    contract: Callable[[Mechanism, np.random.Generator], None], kind: type[Mechanism], rng: np.random.Generator
) -> None:
    contract(BY_TYPE[kind], rng)


# --- what breaks them ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Unmoved(ZeroOffset):
    """An offset that shows in no reading."""

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        return Torques(nothing(at), nothing(at))


@dataclass(frozen=True)
class LeftOver(ZeroOffset):
    """An offset that does not vanish."""

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        found = super().distortion(at, true)
        return Torques(found.sun + 1e-9, found.ring)


@dataclass(frozen=True)
class Driving(HysteresisDamping):
    """A loss that drives the rotors."""

    def torque(self, at: OperatingPoints) -> Torques:
        found = super().torque(at)
        return Torques(-found.sun, -found.ring)


@dataclass(frozen=True)
class MeanGainError(GainError):
    """A gain error of the mean torque of all points."""

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        found = super().distortion(at, true)
        return Torques(np.full(len(at), found.sun.mean()), found.ring)


@dataclass(frozen=True)
class Forgetting(DriftingZero):
    """A drift that stays where it is."""

    equation = ZeroOffset.equation
    by_shaft = {"sun": ("drift_sun",)}  # noqa: RUF012
    drift_sun: float = parameter("N m", bounds=(-1.0, 1.0), typical=3e-3, meaning="drift of the sun's zero")

    def moved(self, time: np.ndarray) -> Torques:
        return Torques(np.full(len(time), self.drift_sun), np.zeros(len(time)))


@dataclass(frozen=True)
class SquaredGainError(GainError):
    """A gain error that grows with its square."""

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        return Torques(self.gain_sun**2 * true.sun, self.gain_ring**2 * true.ring)


@dataclass(frozen=True)
class CrossedGainError(GainError):
    """A gain error of one shaft that shows on the other."""

    def distortion(self, at: OperatingPoints, true: Torques) -> Torques:
        return Torques(self.gain_ring * true.sun, self.gain_sun * true.ring)


PLANTED: tuple[tuple[Callable[[Mechanism, np.random.Generator], None], Mechanism], ...] = (
    (acts, typical(Unmoved)),
    (absent_at_null, typical(LeftOver)),
    (only_takes_power, Driving(5e-4)),
    (only_takes_power, HysteresisDamping()),
    (remembers_as_it_says, typical(MeanGainError)),
    (remembers_as_it_says, typical(Forgetting)),
    (grows_with_its_sizes, typical(SquaredGainError)),
    (sits_on_its_shaft, typical(CrossedGainError)),
)


@pytest.mark.parametrize(
    ("contract", "broken"),
    PLANTED,
    ids=[f"{contract.__name__}-{type(broken).__name__}" for contract, broken in PLANTED],
)
def test_a_broken_contract_is_seen(
    contract: Callable[[Mechanism, np.random.Generator], None], broken: Mechanism, rng: np.random.Generator
) -> None:
    with pytest.raises(AssertionError):
        contract(broken, rng)


# --- bounds, extremes, what is written about it ----------------------------------------------------------------


def test_every_mechanism_of_the_library_has_an_instance_here() -> None:
    assert set(BY_TYPE) == set(EVERY)
    assert len({kind.identifier for kind in LIBRARY}) == len(LIBRARY)


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.__name__)
def test_parameters_have_unit_bounds_and_a_typical_value_inside(kind: type[Mechanism]) -> None:
    assert kind.parameters()
    for one in kind.parameters():
        low, high = one.bounds
        assert low < one.typical < high
        assert low <= one.null <= high
        assert one.unit
        assert one.meaning


@pytest.mark.parametrize("kind", ACTING, ids=lambda kind: kind.__name__)
@given(sun=speeds, ring=speeds)
def test_absent_at_null_and_never_driving_at_any_speed(kind: type[Mechanism], sun: float, ring: float) -> None:
    at = some_points(sun, ring)
    assert not both(effect(at_its("null", BY_TYPE[kind]), at)).any()
    found = effect(BY_TYPE[kind], at)
    assert np.isfinite(both(found)).all()
    if kind.dissipates:
        assert (found.power(at) <= 1e-12).all()


@pytest.mark.parametrize("kind", ACTING, ids=lambda kind: kind.__name__)
def test_finite_at_the_corners_of_its_bounds(kind: type[Mechanism]) -> None:
    at = replace(joined(some_points(0.0, 0.0), some_points(3000.0, -3000.0)), started_at=600.0 * np.arange(4.0))
    names, felt = [one.name for one in kind.parameters()], 0.0
    for corner in product(*(one.bounds for one in kind.parameters())):
        found = both(effect(replace(BY_TYPE[kind], **dict(zip(names, corner, strict=True))), at))
        assert np.isfinite(found).all()
        felt = max(felt, float(np.abs(found).max()))
    assert felt > 1e-3


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.__name__)
def test_equation_can_be_drawn(kind: type[Mechanism]) -> None:
    MathTextParser("path").parse(f"${kind.equation}$")


@pytest.mark.parametrize("kind", TO_NAME, ids=lambda kind: kind.__name__)
def test_sizes_and_shapes_are_its_parameters(kind: type[Mechanism]) -> None:
    names = [one.name for one in kind.parameters()]
    sizes = {name for group in kind.by_shaft.values() for name in group}
    assert sorted((*sizes, *kind.shape)) == sorted(names)
    assert set(kind.by_shaft) <= {"sun", "ring", "both"}
    nulls = {one.name: one.null for one in kind.parameters()}
    assert all(nulls[name] == 0.0 for name in sizes)


@pytest.mark.parametrize("kind", TO_NAME, ids=lambda kind: kind.__name__)
def test_a_candidate_changes_what_is_read(kind: type[Mechanism], rng: np.random.Generator) -> None:
    sun, ring = rng.uniform(50.0, 1800.0, 12), rng.uniform(-700.0, 700.0, 12)
    load = np.tile([0.78, 1.95], 6)
    at = joined(points("neutral", sun, ring), points("engaged", sun, -sun / 2.6, load))
    at = replace(at, started_at=60.0 * np.arange(24.0))
    baseline = baseline_mechanisms(MODEL, BENCH)
    without = steady(Gearbox(BENCH, baseline), at)
    for sizes in kind.by_shaft.values():
        some = at_its("typical", kind.of(BENCH, MODEL), sizes)
        changed = steady(Gearbox(BENCH, (*baseline, some)), at)
        moved = np.hypot(changed.torque_sun - without.torque_sun, changed.torque_ring - without.torque_ring)
        assert 1e-5 < moved.max() < 1.0


@pytest.mark.parametrize("kind", [k for k in EVERY if issubclass(k, Instrument)], ids=lambda kind: kind.__name__)
def test_an_instrument_leaves_the_bench_alone(kind: type[Mechanism]) -> None:
    at = some_points(900.0, 300.0)
    assert not both(BY_TYPE[kind].torque(at)).any()
    assert not kind.dissipates


def test_a_reading_with_faults_is_that_of_the_true_load() -> None:
    at = points("engaged", [900.0], [-900.0 / 2.6], 1.5)
    faults = (GainError(gain_ring=0.02, gain_sun=-0.01),)
    baseline = baseline_mechanisms(MODEL, BENCH)
    read = steady(Gearbox(BENCH, (*baseline, *faults)), at)
    true = steady(Gearbox(BENCH, baseline), replace(at, torque_ring=at.torque_ring / 1.02))
    assert read.torque_ring == pytest.approx(at.torque_ring, rel=1e-12)
    assert read.torque_sun == pytest.approx(0.99 * true.torque_sun, rel=1e-12)
