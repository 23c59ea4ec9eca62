"""What each mechanism does, worked out again from its printed equation, at one neutral and one engaged point."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.points import joined, points

from pmg.sim.bench import load_bench
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.mechanisms import (
    BASELINE,
    CANDIDATES,
    REFINED,
    EddyDamping,
    ExcessDamping,
    HysteresisDamping,
    Instrument,
    Mechanism,
    NeutralRemainder,
    RelativeBearing,
    RingBearings,
    SunBearings,
    Torques,
)
from pmg.sim.mechanisms.base import Warmth
from pmg.sim.mechanisms.field import ResidualCoupling, ResidualCouplingOfStages, SkinEffect
from pmg.sim.mechanisms.friction import (
    MixedLubrication,
    MixedLubricationExponent,
    RubbingCarrier,
    Windage,
    WindagePower,
)
from pmg.sim.mechanisms.instruments import (
    Crosstalk,
    CrosstalkBySense,
    GainBySense,
    GainError,
    WanderingZero,
    ZeroDrift,
    ZeroOffset,
)
from pmg.sim.mechanisms.load import (
    LoadFriction,
    LoadFrictionPower,
    LoadIronLoss,
    LoadIronLossPower,
    RelativeBearingDrag,
    RelativeBearingUnderLoad,
)
from pmg.sim.mechanisms.thermal import (
    STOPPED,
    LubricantViscosity,
    MagnetTemperature,
    WarmingInTwoSteps,
    _temperature_rise,
)
from pmg.sim.mechanisms.warmed import WarmBearings
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.power_chain import MotorConvention, _motor_electric_power
from pmg.sim.steady.solve import steady

BENCH = load_bench()
CURVE = LossCurve((0.0, 0.5, 1.0), np.array([0.01, 0.05, 0.03]), 100.0, 200.0)
MODEL = LossModel(CURVE, CURVE, 0.8, 5e-4, 2e-4, 1e-3)


@dataclass(frozen=True)
class Point:
    """Speeds [rad/s], load on the ring [N m], pole pairs; engaged or neutral."""

    s: float
    r: float
    load: float
    engaged: bool

    @property
    def name(self) -> str:
        return "engaged" if self.engaged else "neutral"


NEUTRAL = Point(90.0, -30.0, 0.0, engaged=False)
ENGAGED = Point(-130.0, 50.0, -1.3, engaged=True)
RATIO = 13.0 / 5.0
Pair = tuple[float, float]


def typical(kind: type[Mechanism]) -> Mechanism:
    return replace(kind.of(BENCH, MODEL), **{p.name: p.typical for p in kind.parameters()})


def sgn(x: float) -> float:
    return math.copysign(1.0, x)


def drag(w: float) -> float:
    x = abs(w) / 100.0
    return 0.01 + 0.05 * math.sqrt(x) + 0.03 * x


def both(law: Callable[[float], float]) -> Callable[[Point], Pair]:
    """The same law on both shafts, each at its own speed."""
    return lambda at: (law(at.s), law(at.r))


def engaged(law: Callable[[Point], Pair]) -> Callable[[Point], Pair]:
    return lambda at: law(at) if at.engaged else (0.0, 0.0)


def neutral(law: Callable[[Point], Pair]) -> Callable[[Point], Pair]:
    return lambda at: (0.0, 0.0) if at.engaged else law(at)


def under_load(law: Callable[[float, float], float]) -> Callable[[Point], Pair]:
    """A drag of both rotors by the magnitude of the torque on the sun and each one's speed."""
    return engaged(lambda at: (-law(abs(at.load) / RATIO, at.s), -law(abs(at.load) / RATIO, at.r)))


def slip(at: Point, p_s: int, p_r: int, fall: float = 2.0) -> float:
    x = (p_s * at.s + p_r * at.r) / 1000.0
    return float(2.0 * x / (1.0 + abs(x) ** fall))


def between(drag: Callable[[float, Point], float]) -> Callable[[Point], Pair]:
    """A drag at a speed difference in hundreds of rad/s, on the sun and back on the ring."""

    def law(at: Point) -> Pair:
        torque = sgn(at.s - at.r) * drag(abs(at.s - at.r) / 100.0, at)
        return -torque, torque

    return law


SHARES = {type(m): m for m in baseline_mechanisms(MODEL, BENCH)}
FORMS: dict[type[Mechanism], Callable[[Point], Pair]] = {
    NeutralRemainder: neutral(both(lambda w: -sgn(w) * 0.2 * drag(w))),
    HysteresisDamping: engaged(both(lambda w: -sgn(w) * 5e-4)),
    EddyDamping: engaged(both(lambda w: -2e-4 * w)),
    ExcessDamping: engaged(both(lambda w: -1e-3 * w / math.sqrt(1.0 + abs(w)))),
    LoadFriction: engaged(lambda at: (-sgn(at.s) * 0.01 * abs(at.load) / RATIO, -sgn(at.r) * 0.01 * abs(at.load))),
    LoadFrictionPower: engaged(
        lambda at: (-sgn(at.s) * 0.01 * (abs(at.load) / RATIO) ** 1.4, -sgn(at.r) * 0.01 * abs(at.load) ** 1.4)
    ),
    MixedLubrication: both(lambda w: -sgn(w) * 0.02 * math.exp(-((abs(w) / 15.0) ** 1.4))),
    MixedLubricationExponent: both(lambda w: -sgn(w) * 0.02 * math.exp(-abs(w) / 15.0)),
    Windage: lambda at: (-1e-6 * at.s * abs(at.s), -5e-6 * at.r * abs(at.r)),
    WindagePower: lambda at: (
        -sgn(at.s) * 1e-6 * 1e4 * (abs(at.s) / 100.0) ** 1.8,
        -sgn(at.r) * 5e-6 * 1e4 * (abs(at.r) / 100.0) ** 1.8,
    ),
    RelativeBearingDrag: between(lambda x, at: 0.01 + 0.01 * x ** (2.0 / 3.0)),
    RelativeBearingUnderLoad: between(
        lambda x, at: 0.01 + 0.01 * x**0.67 + (5e-3 * abs(at.load) if at.engaged else 0.0)
    ),
    RubbingCarrier: engaged(both(lambda w: -sgn(w) * 5e-3)),
    ResidualCoupling: neutral(lambda at: (-5 * 1e-3 * slip(at, 5, 13), -13 * 1e-3 * slip(at, 5, 13))),
    ResidualCouplingOfStages: neutral(
        lambda at: (
            -5 * 1e-3 * slip(at, 5, 13) - 7 * 5e-4 * slip(at, 7, 11),
            -13 * 1e-3 * slip(at, 5, 13) - 11 * 5e-4 * slip(at, 7, 11),
        )
    ),
    SkinEffect: engaged(both(lambda w: 2e-4 * w * (1.0 - (1.0 + (0.01 * w) ** 2) ** -0.25))),
    LoadIronLoss: under_load(lambda load, w: 5e-5 * load * w),
    LoadIronLossPower: under_load(lambda load, w: sgn(w) * 5e-5 * load**2 * abs(w)),
}
"""Torques of sun and ring at typical values; stage 1."""

TRUE = (0.6, -1.4)
"""Torques of sun and ring that the transducers feel [N m]."""
SHOWN: dict[type[Instrument], Pair] = {
    ZeroOffset: (5e-3, 5e-3),
    GainError: (0.01 * 0.6, 0.01 * -1.4),
    GainBySense: (0.01 * 0.6 + 0.01 * 0.6, 0.01 * -1.4 + 0.01 * 1.4),
    Crosstalk: (0.01 * -1.4, 0.01 * 0.6),
    CrosstalkBySense: (0.01 * -1.4 + 0.01 * 1.4, 0.01 * 0.6 + 0.01 * 0.6),
}
"""What instruments show too much, at typical values."""

IN_TIME = {LubricantViscosity, WarmingInTwoSteps, MagnetTemperature, ZeroDrift, WanderingZero}
"""Those that depend on what was run before; below, by what they become in time."""
SHARED: set[type[Mechanism]] = {SunBearings, RelativeBearing, RingBearings}
"""The bearings of the baseline; below, by their sum."""


def test_every_mechanism_with_a_mean_is_worked_out_here() -> None:
    assert {*FORMS, *SHOWN, *IN_TIME, *SHARED} == {*BASELINE, *CANDIDATES, *REFINED}


@pytest.mark.parametrize("at", [NEUTRAL, ENGAGED], ids=lambda at: at.name)
@pytest.mark.parametrize("kind", FORMS, ids=lambda kind: kind.__name__)
def test_torques_are_those_of_the_printed_equation(kind: type[Mechanism], at: Point) -> None:
    mechanism = SHARES[kind] if kind in SHARES else typical(kind)
    point = replace(points(at.name, [0.0], [0.0], at.load), speed_sun=np.array([at.s]), speed_ring=np.array([at.r]))
    found = mechanism.torque(point)
    assert (found.sun[0], found.ring[0]) == pytest.approx(FORMS[kind](at), rel=1e-12, abs=1e-300)


@pytest.mark.parametrize("kind", SHOWN, ids=lambda kind: kind.__name__)
def test_readings_are_distorted_as_the_printed_equation_says(kind: type[Instrument]) -> None:
    instrument = typical(kind)
    assert isinstance(instrument, Instrument)
    true = Torques(np.array([TRUE[0]]), np.array([TRUE[1]]))
    found = instrument.distortion(points("engaged", [900.0], [-346.0], -1.4), true)
    assert (found.sun[0], found.ring[0]) == pytest.approx(SHOWN[kind], rel=1e-12)


@pytest.mark.parametrize(("at", "part"), [(NEUTRAL, 0.8), (ENGAGED, 0.8)], ids=["neutral", "engaged"])
def test_the_bearings_together_carry_the_corrected_curve(at: Point, part: float) -> None:
    point = replace(points(at.name, [0.0], [0.0], at.load), speed_sun=np.array([at.s]), speed_ring=np.array([at.r]))
    found = [SHARES[kind].torque(point) for kind in SHARED]
    assert sum(float(each.sun[0]) for each in found) == pytest.approx(-sgn(at.s) * part * drag(at.s), rel=1e-12)
    assert sum(float(each.ring[0]) for each in found) == pytest.approx(-sgn(at.r) * part * drag(at.r), rel=1e-12)
    sun, ring = (SHARES[kind].torque(point) for kind in (SunBearings, RingBearings))
    assert abs(float(sun.sun[0])) > 0.0 == float(sun.ring[0])
    assert abs(float(ring.ring[0])) > 0.0 == float(ring.sun[0])


# --- zeros in time -------------------------------------------------------------------------------------------

HOUR = 3600.0


@given(settling=st.floats(300.0, 1e6), drift=st.floats(-1.0, 1.0))
def test_a_drift_of_the_zero_is_what_it_is_in_an_hour(settling: float, drift: float) -> None:
    moved = ZeroDrift(drift_sun=drift, drift_ring=-2.0 * drift, settling=settling).moved(np.array([0.0, HOUR]))
    assert moved.sun == pytest.approx([0.0, drift], abs=1e-15)
    assert moved.ring == pytest.approx([0.0, -2.0 * drift], abs=1e-15)


def test_a_drift_settles_or_goes_on_evenly() -> None:
    time = np.array([0.5, 1.0, 2.0, 100.0]) * HOUR
    slow = ZeroDrift(drift_sun=1.0, settling=1e6).moved(time).sun
    assert slow[:3] == pytest.approx([0.5, 1.0, 2.0], rel=3e-3)
    fast = ZeroDrift(drift_sun=1.0, settling=600.0).moved(time).sun
    assert fast == pytest.approx([(1.0 - math.exp(-t / 600.0)) / (1.0 - math.exp(-6.0)) for t in time], rel=1e-12)


def test_a_drift_counts_from_the_first_point_in_time_not_in_the_table() -> None:
    at = replace(points("neutral", [900.0] * 3, [300.0] * 3), started_at=1.7e9 + np.array([HOUR, 0.0, 2.0 * HOUR]))
    none = Torques(np.zeros(3), np.zeros(3))
    assert ZeroDrift(drift_sun=1.0, settling=1e6).distortion(at, none).sun == pytest.approx([1.0, 0.0, 2.0], rel=3e-3)
    unordered = replace(at, started_at=np.full(3, np.nan))
    assert not ZeroDrift(drift_sun=1.0).distortion(unordered, none).sun.any()


def test_a_wandering_zero_passes_straight_through_what_is_given() -> None:
    zero = WanderingZero(sun_1=1.0, sun_2=-1.0, sun_3=0.5, sun_6=2.0, spacing=1000.0)
    moved = zero.moved(np.array([0.0, 250.0, 1000.0, 1500.0, 2000.0, 5500.0, 6000.0, 9000.0]))
    assert moved.sun == pytest.approx([0.0, 0.25, 1.0, 0.0, -1.0, 1.0, 2.0, 2.0])
    assert not moved.ring.any()


# --- warming -------------------------------------------------------------------------------------------------


def held(seconds: list[float]) -> np.ndarray:
    return 1.7e9 + np.cumsum(np.array([0.0, *seconds]))


def test_a_node_warms_by_what_was_held_and_cools_while_the_motors_stand_still() -> None:
    """A short gap at the new speeds in part, a pause in which the motors stand still in part."""
    at = replace(points("neutral", [900.0] * 3, [300.0] * 3), started_at=held([100.0, 600.0]))
    heat, tau, start, dwell, idle = np.array([10.0, 40.0, 20.0]), 500.0, 3.0, 0.8, 0.3
    first = start * math.exp(-100.0 / tau) + (1.0 - math.exp(-100.0 / tau)) * (0.8 * 40.0 + 0.2 * 10.0)
    warm = (1.0 - 0.3) * (0.8 * 20.0 + 0.2 * 40.0)
    second = first * math.exp(-600.0 / tau) + (1.0 - math.exp(-600.0 / tau)) * warm
    found = _temperature_rise(at, heat, tau, start, dwell, idle)
    assert found == pytest.approx([start, first, second], rel=1e-12)


@given(pause=st.floats(STOPPED + 1.0, 1e5), start=st.floats(-40.0, 120.0))
def test_in_a_pause_with_still_motors_nothing_warms(pause: float, start: float) -> None:
    at = replace(points("neutral", [900.0] * 2, [300.0] * 2), started_at=held([pause]))
    found = _temperature_rise(at, np.array([50.0, 50.0]), 1000.0, start, 0.8, 1.0)
    assert found[1] == pytest.approx(start * math.exp(-pause / 1000.0), rel=1e-6, abs=1e-9)


def test_a_short_gap_is_no_pause_and_the_order_of_the_table_is_not_that_of_the_test() -> None:
    at = replace(points("neutral", [900.0] * 3, [300.0] * 3), started_at=held([STOPPED, STOPPED]))
    heat = np.array([1.0, 2.0, 3.0])
    found = _temperature_rise(at, heat, 200.0, 0.0, 1.0, 1.0)
    assert found[1] == pytest.approx(2.0 * (1.0 - math.exp(-STOPPED / 200.0)))
    mixed = np.array([2, 0, 1])
    assert _temperature_rise(at[mixed], heat[mixed], 200.0, 0.0, 1.0, 1.0) == pytest.approx(found[mixed])


def test_a_point_whose_heat_is_not_known_is_not_there_for_the_others() -> None:
    at = replace(points("neutral", [900.0] * 3, [300.0] * 3), started_at=held([60.0, 60.0]))
    found = _temperature_rise(at, np.array([5.0, np.nan, 7.0]), 300.0)
    assert np.isnan(found[1])
    assert found[[0, 2]] == pytest.approx(_temperature_rise(at[np.array([0, 2])], np.array([5.0, 7.0]), 300.0))


def test_warm_bearings_lose_drag_by_the_viscosity() -> None:
    """Long at one point, each node is where its own loss takes it."""
    at = replace(points("neutral", [900.0] * 2, [300.0] * 2), started_at=held([1e6]))
    bearings = LubricantViscosity.of(BENCH, MODEL)
    bearings = replace(bearings, resistance_sun=2.0, resistance_ring=5.0, dwell=1.0, idle=0.0)
    found, cold = bearings.torque(at), [drag(w) for w in (at.speed_sun[0], at.speed_ring[0])]
    rises = [r * b * w for r, b, w in zip((2.0, 5.0), cold, (at.speed_sun[0], at.speed_ring[0]), strict=True)]
    wanted = [-b * math.expm1(-0.033 * rise) for b, rise in zip(cold, rises, strict=True)]
    assert (found.sun[1], found.ring[1]) == pytest.approx(wanted, rel=1e-9)
    assert (found.sun[0], found.ring[0]) == (0.0, 0.0)
    engaged_too = replace(at, configuration=np.array(["engaged"] * 2))
    part = 0.8
    rise = 2.0 * part * cold[0] * float(at.speed_sun[0])
    wanted_sun = -part * cold[0] * math.expm1(-0.033 * rise)
    assert bearings.torque(engaged_too).sun[1] == pytest.approx(wanted_sun, rel=1e-9)


def test_warm_races_in_a_warm_housing_add_up_and_feel_the_other_shaft() -> None:
    at = replace(points("neutral", [900.0] * 2, [300.0] * 2), started_at=held([1e6]))
    bearings = replace(
        WarmingInTwoSteps.of(BENCH, MODEL),
        resistance_sun=2.0,
        race_sun=0.5,
        cross=0.1,
        room=1e-6,
        dwell=1.0,
        idle=0.0,
    )
    loss = [drag(w) * w for w in (at.speed_sun[0], at.speed_ring[0])]
    rise = 2.5 * (loss[0] + 0.1 * loss[1]) + 1e-6 * 1e6
    sun, ring = bearings.rises(at)
    assert sun == pytest.approx([0.0, rise], rel=1e-9)
    assert not ring.any()


def test_warm_magnets_lose_drag_with_the_square_of_the_remanence() -> None:
    speed = 900.0
    at = points("engaged", [speed] * 2, [-speed / RATIO] * 2, 1.5)
    at = replace(at, started_at=held([1e6]))
    magnets = replace(MagnetTemperature.of(BENCH, MODEL), resistance=20.0)
    w = [float(at.speed_sun[0]), float(at.speed_ring[0])]
    rise = 20.0 * sum(5e-4 * abs(x) + 2e-4 * x**2 for x in w)
    assert 5.0 < rise < 100.0
    part = 1.0 - (1.0 - 1.2e-3 * rise) ** 2
    found = magnets.torque(at)
    assert (found.sun[1], found.ring[1]) == pytest.approx([part * (5e-4 * sgn(x) + 2e-4 * x) for x in w], rel=1e-9)
    assert magnets.field_left(Warmth(magnets=rise)) == pytest.approx(1.0 - part, rel=1e-12)
    assert not magnets.torque(replace(at, configuration=np.array(["neutral"] * 2))).sun.any()


# --- the balance of the bench --------------------------------------------------------------------------------


@pytest.mark.parametrize(("gear", "ratio"), [(1, 13.0 / 5.0), (2, 11.0 / 7.0)])
def test_the_sun_carries_its_own_losses_and_the_rings_through_the_ratio(gear: int, ratio: float) -> None:
    model = LossModel(CURVE, CURVE, 0.8, 5e-4, 2e-4, 0.0)
    w = 94.0
    at = replace(
        points("engaged", [0.0], [0.0], 1.5, gear=gear),
        speed_sun=np.array([w]),
        speed_ring=np.array([-w / ratio]),
        rest_sun=np.array([False]),
        rest_ring=np.array([False]),
    )
    sun, ring = (0.8 * drag(x) + 5e-4 + 2e-4 * x for x in (w, w / ratio))
    found = steady(Gearbox.calibrated(BENCH, model), at)
    assert found.torque_sun[0] == pytest.approx((1.5 + ring) / ratio + sun, rel=1e-12)
    assert found.torque_ring[0] == 1.5


def test_neutral_each_motor_carries_the_whole_loss_of_its_shaft() -> None:
    at = joined(points("neutral", [900.0], [300.0]), points("zero", [0.0], [0.0]))
    found = steady(Gearbox.calibrated(BENCH, MODEL), at)
    assert found.torque_sun == pytest.approx([drag(at.speed_sun[0]), 0.0], rel=1e-12)
    assert found.torque_ring == pytest.approx([drag(at.speed_ring[0]), 0.0], rel=1e-12)


@pytest.mark.parametrize(("torque", "speed"), [(1.2, 80.0), (-1.2, 80.0), (0.7, -60.0)])
def test_a_motor_draws_shaft_power_friction_and_copper_loss(torque: float, speed: float) -> None:
    motor = BENCH.motor
    current = (torque + motor.damping * speed) / motor.torque_constant
    wanted = torque * speed + motor.damping * speed**2 + motor.resistance * current**2
    one = np.array([torque]), np.array([speed])
    found = _motor_electric_power(*one, motor, MotorConvention.CONSISTENT)
    assert found[0] == pytest.approx(wanted, rel=1e-12)
    size = (abs(torque) + motor.damping * abs(speed)) / motor.torque_constant
    gain = math.copysign(1.0, torque * speed) * (motor.resistance * size + motor.back_emf_constant * abs(speed)) * size
    assert _motor_electric_power(*one, motor, MotorConvention.THESIS)[0] == pytest.approx(gain, rel=1e-12)


@given(x=st.floats(1.0, 3.0))
def test_a_curve_goes_on_along_its_tangent_beyond_its_data(x: float) -> None:
    at_limit = drag(200.0)
    slope = 0.05 * 0.5 / math.sqrt(2.0) / 100.0 + 0.03 / 100.0
    speed = 200.0 * x
    assert CURVE.torque(np.array([speed]))[0] == pytest.approx(at_limit + slope * (speed - 200.0), rel=1e-12)


@given(sun=st.floats(-200.0, 200.0), ring=st.floats(-80.0, 80.0), part=st.floats(-0.9, 0.0), signed=st.booleans())
def test_warmth_takes_its_part_off_the_drag_whichever_way_a_look_up_turns(
    sun: float, ring: float, part: float, signed: bool
) -> None:
    cold = SunBearings(CURVE, 1.0, 1.0, signed=signed), RingBearings(CURVE, 1.0, 1.0, signed=signed)
    warm = WarmBearings(CURVE, CURVE, part, part, signed=signed).law(sun, ring, 0.5)
    on_sun, on_ring = (law.law(sun, ring, 0.5) for law in cold)
    assert (warm.sun, warm.ring) == pytest.approx((part * on_sun.sun, part * on_ring.ring), abs=1e-15)
