"""What repeats within a turn, or scales and shifts what is read, acts by its lines: they are looked for and found.

Each mechanism without a mean torque is planted as its equation says, in the signal that it affects, and read by the
fit of lines: its line carries what was planted, no other line does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from tests.orders.rows import row_of
from tests.points import joined, points

from pmg.pipeline.orders.fit import Orders, fit_orders
from pmg.pipeline.orders.lines import Line, lines_of, resolve
from pmg.sim.bench import BenchParameters, load_bench
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.maps.analytic import Cogging, analytic_map
from pmg.sim.mechanisms import OTHERS, Mechanism
from pmg.sim.mechanisms.friction import PoleSlip
from pmg.sim.mechanisms.waveform import (
    ClockOffset,
    CoggingLines,
    Eccentricity,
    EncoderScale,
    Misalignment,
    Unbalance,
)
from pmg.sim.signals import RPM, TORQUE_RING, TORQUE_SUN, Array, wrapped

BENCH = load_bench()
CURVE = LossCurve((0.0, 1.0), np.array([0.01, 0.03]), 100.0, 200.0)
MODEL = LossModel(CURVE, CURVE, 0.8, 5e-4, 2e-4, 0.0)
RATE, SAMPLES = 2000.0, 10_000
SPEED = {"sun": 331.7 * RPM, "ring": -211.3 * RPM}
TURNED: dict[str, Array] = {
    side: np.linspace(0.0, speed * SAMPLES / RATE, SAMPLES, endpoint=False) for side, speed in SPEED.items()
}
SHAFTS_AND_GEARS = [(side, gear) for side in SPEED for gear in (1, 2)]


def size(kind: type[Mechanism]) -> float:
    (one,) = kind.parameters()
    return one.typical


def poles(gear: int, side: str) -> int:
    stage = BENCH.gear(gear)
    return int(stage.pole_pairs_sun if side == "sun" else stage.pole_pairs_ring)


def fitted(signal: Array, gear: int) -> Orders:
    groups, _ = resolve(lines_of(BENCH, gear), SPEED, SAMPLES / RATE, RATE)
    return fit_orders(signal[None], TURNED["sun"], TURNED["ring"], groups, RATE)


@dataclass(frozen=True)
class Wave:
    """A line: its order on its own shaft, what `lines_of` says of it, its amplitude at a speed [rad/s]."""

    order: Callable[[int, str], int]
    meaning: str
    amplitude: Callable[[float], float]


WAVES: dict[type[Mechanism], Wave] = {
    CoggingLines: Wave(
        lambda gear, side: math.lcm(2 * poles(gear, side), int(BENCH.carrier.iron_poles)),
        "cogging",
        lambda _: size(CoggingLines),
    ),
    Unbalance: Wave(lambda gear, side: 1, "unbalance", lambda speed: size(Unbalance) * speed**2),
    Misalignment: Wave(lambda gear, side: 2, "coupling out of line", lambda _: size(Misalignment)),
    Eccentricity: Wave(lambda gear, side: 1, "eccentricity", lambda speed: size(Eccentricity) * abs(speed)),
}
SCALES: tuple[type[Mechanism], ...] = (EncoderScale, ClockOffset, PoleSlip)
"""What moves lines instead of making one."""


def test_every_mechanism_without_a_mean_is_held_to_lines_here() -> None:
    assert {*WAVES, *SCALES} == set(OTHERS)


@pytest.mark.parametrize("kind", OTHERS, ids=lambda kind: kind.__name__)
def test_it_has_no_mean_torque(kind: type[Mechanism]) -> None:
    (one,) = kind.parameters()
    at = joined(points("neutral", [900.0], [300.0]), points("engaged", [900.0], [-900.0 / 2.6], 1.5))
    present = kind.of(BENCH, MODEL)
    for value in (*one.bounds, one.typical):
        found = type(present)(**{one.name: value}).torque(at)
        assert found.sun.shape == found.ring.shape == (2,)
        assert not found.sun.any()
        assert not found.ring.any()
    assert not kind.dissipates or kind is PoleSlip


@pytest.mark.parametrize(("side", "gear"), SHAFTS_AND_GEARS)
@pytest.mark.parametrize("kind", WAVES, ids=lambda kind: kind.__name__)
def test_its_line_is_looked_for_and_found_with_its_amplitude(kind: type[Mechanism], side: str, gear: int) -> None:
    wave = WAVES[kind]
    order, planted = wave.order(gear, side), wave.amplitude(SPEED[side])
    listed = [line for line in lines_of(BENCH, gear) if line.name == f"{side} {order}"]
    assert [wave.meaning in line.meaning for line in listed] == [True]
    found = fitted(0.7 + planted * np.sin(order * TURNED[side]), gear)
    names = [group.name for group in found.groups]
    place = names.index(f"{side} {order}")
    assert found.magnitude[0, place] == pytest.approx(planted, rel=1e-6)
    assert found.beyond[0, place]
    assert np.delete(found.magnitude[0], place).max() < 1e-6 * planted


def test_unbalance_grows_with_the_square_of_speed_and_an_eccentric_encoder_with_speed() -> None:
    assert WAVES[Unbalance].amplitude(20.0) == pytest.approx(4.0 * WAVES[Unbalance].amplitude(10.0))
    assert WAVES[Eccentricity].amplitude(20.0) == pytest.approx(2.0 * WAVES[Eccentricity].amplitude(10.0))


@pytest.mark.parametrize(("side", "gear"), SHAFTS_AND_GEARS)
def test_cogging_of_the_torque_map_is_the_line_of_cogging(side: str, gear: int) -> None:
    """The simulator's cogging, over a turn of one rotor with the other at rest."""
    amplitude = size(CoggingLines)
    stage = BENCH.gear(gear)
    cogged, smooth = (
        analytic_map(stage, 1.0, {}, **{f"cogging_{side}": Cogging(a)} if a else {}) for a in (amplitude, 0.0)
    )
    still: dict[str, Array] = {"sun": np.zeros(SAMPLES), "ring": np.zeros(SAMPLES)}
    turned = still | {side: TURNED[side]}
    pull = [getattr(each.torques(turned["sun"], turned["ring"]), side) for each in (cogged, smooth)]
    found = fitted(pull[0] - pull[1], gear)
    order = WAVES[CoggingLines].order(gear, side)
    place = [group.name for group in found.groups].index(f"{side} {order}")
    assert found.magnitude[0, place] == pytest.approx(amplitude, rel=1e-6)
    assert np.delete(found.magnitude[0], place).max() < 1e-6 * amplitude


def slip_of(bench: BenchParameters, gear: int) -> Line:
    (line,) = (line for line in lines_of(bench, gear) if line.name == "slip")
    return line


@pytest.mark.parametrize("gear", [1, 2])
def test_a_wrong_scale_of_an_encoder_looks_like_slipping_poles_at_its_rate(gear: int) -> None:
    speed = 900.0 * RPM
    ring = -speed / BENCH.gear(gear).ratio
    line = slip_of(BENCH, gear)
    assert line.speed(speed, ring) == pytest.approx(0.0, abs=1e-9)
    read = (1.0 + size(EncoderScale)) * speed
    assert line.speed(read, ring) == pytest.approx(poles(gear, "sun") * size(EncoderScale) * speed)


@pytest.mark.parametrize("gear", [1, 2])
def test_slipping_poles_are_a_line_at_the_rate_of_the_slip(gear: int) -> None:
    slip, line = size(PoleSlip), slip_of(BENCH, gear)
    sun = SPEED["sun"]
    speeds = {"sun": sun, "ring": (slip - poles(gear, "sun") * sun) / poles(gear, "ring")}
    (group,) = resolve([line], speeds, SAMPLES / RATE, RATE)[0]
    assert group.frequency == pytest.approx(slip / (2.0 * math.pi))
    held = {"sun": sun, "ring": -sun / BENCH.gear(gear).ratio}
    groups, left = resolve([line], held, SAMPLES / RATE, RATE)
    assert not groups
    assert [each.line for each in left] == [line]


@pytest.mark.parametrize(("order", "side"), [(1, "sun"), (5, "sun"), (13, "ring")])
def test_a_shifted_clock_turns_the_phase_of_a_line_and_leaves_its_amplitude(order: int, side: str) -> None:
    late, name = size(ClockOffset), f"{side} {order}"
    before, after = (fitted(np.cos(order * (TURNED[side] - shift * SPEED[side])) + 0.4, 1) for shift in (0.0, late))
    place = [group.name for group in before.groups].index(name)
    turned = row_of(after, place).phase - row_of(before, place).phase
    assert wrapped(np.array(turned + order * late * SPEED[side])) == pytest.approx(0.0, abs=1e-6)
    assert after.magnitude[0, place] == pytest.approx(before.magnitude[0, place], rel=1e-6)


def test_what_shows_in_torque_affects_torque_and_what_shows_in_speed_does_not() -> None:
    in_torque = {CoggingLines, Unbalance, Misalignment, ClockOffset}
    for kind in OTHERS:
        assert ({TORQUE_SUN, TORQUE_RING} <= set(kind.affects)) == (kind in in_torque)
