"""Index pulses, equal steps of angle, the average turn."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pmg.pipeline.orders.angle import _find_index, average_turn, by_angle, order_amplitudes
from pmg.pipeline.recording.layouts.wire import IndexPulse
from pmg.sim.errors import RecordingError
from pmg.sim.signals import REVOLUTION, RPM, Array

COUNTS = 5120
STEP = REVOLUTION / COUNTS
BITS = 16
FIRST = 7_000


def shaft(rpm: Array, rate_hz: float, place: float, latch: str) -> tuple[Array, list[IndexPulse]]:
    """Counted angle [rad] of a shaft at these speeds, and a pulse whenever it passes its index."""
    turned = np.concatenate(([0.0], np.cumsum(rpm * RPM / rate_hz)))[:-1] + 0.123
    count = np.floor(turned / STEP)
    passed = np.flatnonzero(np.diff(np.floor((turned - place) / REVOLUTION)))
    pulses = []
    for before in passed:
        at_edge = np.floor(
            (round((turned[before] + turned[before + 1] - 2 * place) / 2 / REVOLUTION) * REVOLUTION + place) / STEP
        )
        counts = {"edge": at_edge, "before": count[before], "after": count[before + 1]}
        pulses.append(IndexPulse(FIRST + int(before) + (latch == "after"), int(counts[latch]) % (1 << BITS)))
    return np.asarray(count * STEP), pulses


@settings(max_examples=40)
@given(
    place=st.floats(0.0, REVOLUTION),
    speed=st.sampled_from((-620.0, -95.0, 66.0, 730.0)),
    latch=st.sampled_from(("edge", "before", "after")),
    ramp=st.booleans(),
)
@example(place=0.1171875, speed=-620.0, latch="edge", ramp=False)  # a pulse between the first two samples
def test_the_index_is_found_however_the_count_is_latched(place: float, speed: float, latch: str, ramp: bool) -> None:
    rpm = np.linspace(0.2 if ramp else 1.0, 1.0, 60_000) * speed
    angle, pulses = shaft(rpm, 10_000.0, place, latch)
    index = _find_index(angle, FIRST, pulses, COUNTS, BITS)
    assert index is not None
    between = [pulse for pulse in pulses if FIRST < pulse.sample < FIRST + len(angle) - 1]  # others have no speed
    assert (index.pulses, index.left_out) == (len(between), 0)
    error = abs(math.remainder(index.angle - place, REVOLUTION))
    assert error < 3.0 * index.u + 0.5 * STEP
    assert index.u < 4.0 * STEP


def test_missing_pulses_harm_nothing_and_strays_are_left_out() -> None:
    angle, pulses = shaft(np.full(60_000, 600.0), 10_000.0, 2.0, "edge")
    stray = [IndexPulse(p.sample + 400, (p.count + 1900) % (1 << BITS)) for p in pulses[5:8]]
    index = _find_index(angle, FIRST, [*pulses[::4], *stray], COUNTS, BITS)
    assert index is not None
    assert index.left_out == len(stray)
    assert abs(index.angle - 2.0) < 3.0 * index.u


def test_too_few_pulses_or_pulses_without_a_common_place_give_none(rng: np.random.Generator) -> None:
    angle, pulses = shaft(np.full(60_000, 600.0), 10_000.0, 2.0, "edge")
    assert _find_index(angle, FIRST, pulses[:2], COUNTS, BITS) is None
    assert _find_index(angle, FIRST, [], COUNTS, BITS) is None
    anywhere = [IndexPulse(p.sample, int(rng.integers(1 << BITS))) for p in pulses]
    assert _find_index(angle, FIRST, anywhere, COUNTS, BITS) is None


@settings(max_examples=30)
@given(order=st.integers(1, 18), phase=st.floats(-3.0, 3.0), rpm=st.sampled_from((-187.0, 93.1, 611.0)))
def test_a_turn_over_equal_steps_is_the_signal_there(order: int, phase: float, rpm: float) -> None:
    """With the 5120 counts of the encoder; the error is that of the steps of the count at this order."""
    true = rpm * RPM * np.arange(40_000) / 10_000.0
    angle = np.floor(true / STEP) * STEP
    turns = by_angle(np.asarray(np.cos(order * true + phase), dtype=np.float64), angle, 256, start=0.0)
    sense = math.copysign(1.0, rpm)
    expected = np.cos(order * sense * turns.middles + phase) * np.sinc(order / 256)
    average = average_turn(turns)
    assert np.abs(average.mean - expected).max() < 0.01 + 2.0 * order * STEP
    orders, size = order_amplitudes(turns)
    at = np.argmin(np.abs(orders - order))
    assert size[at] == pytest.approx(1.0, abs=0.01)


def test_the_average_turn_keeps_what_repeats_and_says_how_well(rng: np.random.Generator) -> None:
    angle = np.asarray(600.0 * RPM * np.arange(50_000) / 10_000.0, dtype=np.float64)
    signal = 0.3 * np.cos(5 * angle + 1.0) + rng.standard_normal(len(angle)) + 0.2 * np.cos(5.2 * angle)
    average = average_turn(by_angle(np.asarray(signal, dtype=np.float64), angle, 64))
    middles = (np.arange(64) + 0.5) * REVOLUTION / 64
    pull = (average.mean - 0.3 * np.cos(5 * middles + 1.0)) / average.u
    assert average.turns == 49
    assert 0.6 < pull.std() < 1.5


def test_a_shaft_at_rest_is_refused_with_a_reason() -> None:
    with pytest.raises(RecordingError, match=r"0\.02 turns in the window; expected one whole turn"):
        by_angle(np.ones(1000), np.linspace(0.0, 0.1, 1000), 64)
