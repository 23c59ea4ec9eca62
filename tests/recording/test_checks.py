"""Checks of the samples, each at both sides of its threshold, on channels made by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.recording.calibration import Calibration, Transducer
from pmg.pipeline.recording.channels import ChannelTerms, check_channel, encoder, frequency
from pmg.pipeline.recording.checks.clock import sound_marks
from pmg.pipeline.recording.checks.encodings import compare_encodings
from pmg.pipeline.recording.checks.lines import check_lines
from pmg.pipeline.recording.checks.pulses import check_pulses
from pmg.pipeline.recording.checks.slips import find_slips
from pmg.pipeline.recording.checks.stretches import joined, stretches
from pmg.pipeline.recording.checks.transducers import check_torques
from pmg.pipeline.recording.checks.wiring import HeldStretch, check_wiring, stretch_of
from pmg.pipeline.recording.container.contents import Topic
from pmg.pipeline.recording.findings import Code, Findings, Severity
from pmg.pipeline.recording.frequency import Decoded
from pmg.pipeline.recording.layouts.wire import ClockMark, IndexPulse, LineEvent
from pmg.pipeline.recording.run_records import RunInfo, Setpoints
from pmg.pipeline.recording.tracks import one_rate, together
from pmg.sim.bench import load_bench
from pmg.sim.grid import Configuration
from pmg.sim.signals import RPM, Array

RATE = 500.0
CELL = Transducer(10_000.0, 5.0, 5_000.0, "A1")
CALIBRATION = Calibration(CELL, replace(CELL, serial="B2"), 5120, 5120)


def track(
    values: npt.NDArray[np.generic] | list[float], topic: str = "/daq/torque_sun/frequency", first: int = 0
) -> Decoded:
    array = np.asarray(values)
    known = np.isfinite(array) if array.dtype.kind == "f" else np.ones(len(array), dtype=np.bool_)
    return Decoded(topic, first, RATE, array, known, ())


def codes(findings: Findings) -> list[Code]:
    return [finding.code for finding in findings.listed()]


def lively(rng: np.random.Generator, n: int = 2000, level: float = 1.0) -> Array:
    return np.asarray(level + 1e-3 * rng.standard_normal(n))


# --- torques ---------------------------------------------------------------------------------------------


def of_torques(sun: Array, ring: Array | None) -> tuple[list[Code], list[tuple[str, int, int]]]:
    findings = Findings("a.mcap")
    other = None if ring is None else track(ring, "/daq/torque_ring/frequency")
    found = check_torques(track(sun), other, CALIBRATION, findings)
    return codes(findings), [(mark.topic, mark.start, mark.stop) for mark in found]


def test_sound_torques_say_nothing(rng: np.random.Generator) -> None:
    assert of_torques(lively(rng), lively(rng, level=-2.0)) == ([], [])


@pytest.mark.parametrize(("still", "told"), [(49, False), (50, True)])
def test_one_value_for_a_tenth_of_a_second_is_held_where_the_rest_is_lively(
    still: int, told: bool, rng: np.random.Generator
) -> None:
    torque = lively(rng)
    torque[700 : 700 + still] = torque[700]
    found, marks = of_torques(torque, lively(rng))
    assert found == ([Code.STUCK] if told else [])
    assert marks == ([("/daq/torque_sun/frequency", 700, 700 + still)] if told else [])


def test_coarse_steps_on_both_shafts_hold_for_less_than_a_second(rng: np.random.Generator) -> None:
    """Readings that stand still most of the time by their resolution are no held value until they do for long."""
    coarse = np.repeat(rng.permutation(20).astype(float), 100)
    ring = np.repeat(rng.permutation(20).astype(float), 100)
    assert of_torques(0.01 * coarse, 0.01 * ring) == ([], [])
    dead = 0.01 * coarse.copy()
    dead[500:1100] = dead[499]
    found, marks = of_torques(dead, 0.01 * ring)
    assert found == [Code.STUCK]
    assert marks[0][1] <= 500 < 1100 <= marks[0][2]


def test_a_torque_of_a_counter_that_is_read_more_often_than_it_counts_is_told(rng: np.random.Generator) -> None:
    torque = lively(rng)
    findings = Findings("a.mcap")
    check_torques(track(torque[np.arange(len(torque)) // 8 * 8]), track(lively(rng)), CALIBRATION, findings)
    (told,) = findings.listed()
    assert (told.severity, told.where) == (Severity.WARNING, "/daq/torque_sun/frequency")
    assert "renewed every 8 samples" in told.message


@pytest.mark.parametrize(
    ("torque", "code"),
    [(4.99, None), (5.01, Code.OUT_OF_BAND), (-5.01, Code.OUT_OF_BAND)],
)
def test_readings_outside_the_rated_band_are_told(torque: float, code: Code | None, rng: np.random.Generator) -> None:
    sun = lively(rng)
    sun[900:910] = torque + 1e-4 * np.arange(10)
    assert of_torques(sun, None)[0] == ([] if code is None else [code])


def test_beyond_the_nominal_torque_inside_the_band_is_a_warning(rng: np.random.Generator) -> None:
    weak = replace(CALIBRATION, sun=replace(CELL, nominal_torque=1.0, span_hz=1_000.0))
    sun = lively(rng, level=0.5)
    sun[900:910] = 1.2 + 1e-4 * np.arange(10)
    findings = Findings("a.mcap")
    check_torques(track(sun), None, weak, findings)
    assert [(each.code, each.severity) for each in findings.listed()] == [(Code.BEYOND_NOMINAL, Severity.WARNING)]


@pytest.mark.parametrize(("step", "seen", "told"), [(2.5, 0.0, True), (2.0, 0.0, False), (2.5, 1.0, False)])
def test_a_step_by_half_the_nominal_torque_and_back_on_one_shaft_is_the_shunt(
    step: float, seen: float, told: bool, rng: np.random.Generator
) -> None:
    """Not a smaller one, and not one that the other shaft feels too."""
    sun, ring = lively(rng, level=0.2), lively(rng, level=0.3)
    sun[600:1200] += step
    ring[600:1200] += seen
    found, marks = of_torques(sun, ring)
    assert (Code.SHUNT in found) == told
    shunted = [mark for mark in marks if mark[0] == "/daq/torque_sun/frequency"]
    assert len(shunted) == told
    for _, start, stop in shunted:
        assert abs(start - 600) <= 4
        assert abs(stop - 1200) <= 4


def test_a_step_that_does_not_come_back_is_no_shunt(rng: np.random.Generator) -> None:
    sun = lively(rng, level=0.2)
    sun[600:] += 2.5
    assert of_torques(sun, lively(rng)) == ([], [])


# --- stretches -------------------------------------------------------------------------------------------


@given(st.lists(st.booleans(), max_size=60), st.integers(1, 6))
def test_stretches_cover_what_is_true_and_joining_leaves_gaps_of_that_length(mask: list[bool], apart: int) -> None:
    array = np.array(mask, dtype=np.bool_)
    found = stretches(array)
    covered = np.zeros(len(array), dtype=np.bool_)
    for start, stop in found.tolist():
        covered[start:stop] = True
    assert np.array_equal(covered, array)
    near = joined(found, apart)
    assert len(near) <= len(found)
    assert (near[1:, 0] - near[:-1, 1] >= apart).all()
    if len(found):
        assert (near[0, 0], near[-1, 1]) == (found[0, 0], found[-1, 1])


# --- digital lines ---------------------------------------------------------------------------------------


def of_lines(masks: list[int] | None, *events: tuple[int, int, int]) -> list[tuple[Code, tuple[int, int] | None]]:
    findings = Findings("a.mcap")
    lines = None if masks is None else track(np.array(masks, dtype=np.uint32), "/daq/lines")
    check_lines(lines, [LineEvent(*event) for event in events], findings)
    return [(each.code, each.sample_range) for each in findings.listed()]


def test_events_and_samples_that_tell_the_same_say_nothing() -> None:
    masks = [2] * 50 + [6] * 50
    assert of_lines(masks, (0, 2, 2), (50, 6, 4)) == []
    assert of_lines(masks, (0, 2, 2), (51, 6, 4)) == []  # an edge falls between two samples
    assert of_lines(None) == []


@pytest.mark.parametrize(
    ("events", "place"),
    [
        (((0, 2, 2), (52, 6, 4)), (50, 51)),
        (((0, 2, 2),), (50, 51)),
        (((0, 2, 2), (50, 6, 8)), (0, 51)),
        (((0, 2, 2), (50, 14, 12)), (50, 51)),
    ],
    ids=["two samples late", "lost", "another change", "another mask"],
)
def test_events_that_contradict_the_samples_or_each_other_are_told(
    events: tuple[tuple[int, int, int], ...], place: tuple[int, int]
) -> None:
    told = of_lines([2] * 50 + [6] * 50, *events)
    assert told
    assert {code for code, _ in told} == {Code.LINES_DISAGREE}
    assert place in [where for _, where in told]


def test_the_emergency_stop_is_told_from_samples_and_from_events_alone() -> None:
    assert of_lines([2] * 20 + [3] * 30 + [2] * 10) == [(Code.EMERGENCY_STOP, (20, 50))]
    assert of_lines(None, (0, 2, 2), (20, 3, 1), (50, 2, 1)) == [(Code.EMERGENCY_STOP, (20, 50))]


# --- wiring ----------------------------------------------------------------------------------------------

RUN = RunInfo(
    "c", "p", Configuration.ENGAGED, 1, "sun", datetime(2025, 1, 1, tzinfo=UTC), Setpoints(None, None, None), ""
)


def of_wiring(
    run: RunInfo, speed: tuple[float, float], torque: tuple[float, float], asked: Setpoints
) -> list[tuple[Code, str]]:
    findings = Findings("a.mcap")
    rpm = {"sun": speed[0] * RPM, "ring": speed[1] * RPM}
    held = HeldStretch((0, 100), asked, rpm, {"sun": torque[0], "ring": torque[1]})
    check_wiring([held, held], run, CALIBRATION, load_bench(), findings)
    return [(each.code, each.where) for each in findings.listed()]


NEUTRAL = replace(RUN, configuration=Configuration.NEUTRAL)
SUN, RING = "/daq/encoder_sun/count", "/daq/encoder_ring/count"
ENGAGED_AT = Setpoints(speed_sun=780.0 * RPM, torque_ring=1.5)
NEUTRAL_AT = Setpoints(speed_sun=780.0 * RPM, speed_ring=300.0 * RPM)


@pytest.mark.parametrize(
    ("run", "speed", "torque", "asked", "told"),
    [
        (RUN, (780.0, -300.0), (0.7, 1.5), ENGAGED_AT, []),
        (RUN, (780.0, 300.0), (0.0, 0.0), ENGAGED_AT, [(Code.CHANNEL_REVERSED, RING)]),
        (RUN, (-780.0, -300.0), (0.0, 0.0), ENGAGED_AT, [(Code.CHANNEL_REVERSED, SUN)]),
        (RUN, (-300.0, 780.0), (0.0, 0.0), ENGAGED_AT, [(Code.CHANNEL_SWAPPED, SUN)]),
        (RUN, (780.0, 300.0), (0.0, 0.0), Setpoints(), [(Code.CHANNEL_REVERSED, RING)]),
        (RUN, (300.0, -780.0), (0.0, 0.0), Setpoints(), [(Code.CHANNEL_SWAPPED, SUN)]),
        (RUN, (780.0, -300.0), (-0.7, 1.5), ENGAGED_AT, [(Code.CHANNEL_REVERSED, "/daq/torque_sun")]),
        (RUN, (780.0, -300.0), (0.7, -1.5), ENGAGED_AT, [(Code.CHANNEL_REVERSED, "/daq/torque_ring")]),
        (RUN, (780.0, -300.0), (1.5, 0.7), ENGAGED_AT, [(Code.CHANNEL_SWAPPED, "/daq/torque_sun")]),
        (RUN, (780.0, -300.0), (0.486, 0.652), replace(ENGAGED_AT, torque_ring=0.5), []),
        (replace(RUN, drive="ring"), (780.0, -300.0), (-0.7, -1.5), Setpoints(speed_sun=780.0 * RPM), []),
        (NEUTRAL, (780.0, 300.0), (0.1, 0.1), NEUTRAL_AT, []),
        (NEUTRAL, (780.0, 300.0), (-0.06, 0.1), NEUTRAL_AT, [(Code.CHANNEL_REVERSED, "/daq/torque_sun")]),
        (NEUTRAL, (780.0, 300.0), (-0.04, 0.1), NEUTRAL_AT, []),
        (NEUTRAL, (300.0, 780.0), (0.1, 0.1), NEUTRAL_AT, [(Code.CHANNEL_SWAPPED, SUN)]),
        (NEUTRAL, (780.0, 8.0), (0.1, -0.1), Setpoints(780.0 * RPM, 8.0 * RPM), []),
        (replace(RUN, configuration=Configuration.ZERO), (780.0, -300.0), (-1.0, -1.0), Setpoints(), []),
    ],
    ids=[
        "sound",
        "ring reversed",
        "sun reversed",
        "swapped and reversed",
        "same sense without a set-point",
        "swapped without a set-point",
        "torque of the sun reversed",
        "torque of the ring reversed",
        "torques swapped",
        "drag as large as the load",
        "driven by the ring",
        "neutral, sound",
        "neutral, torque reversed",
        "neutral, torque too small to tell",
        "neutral, swapped",
        "neutral, too slow to tell",
        "no load to tell by",
    ],
)
def test_wiring_is_told_by_what_the_run_was_asked_and_what_a_gear_can_do(
    run: RunInfo,
    speed: tuple[float, float],
    torque: tuple[float, float],
    asked: Setpoints,
    told: list[tuple[Code, str]],
) -> None:
    """Each fault once, though two stretches show it."""
    assert of_wiring(run, speed, torque, asked) == told


def test_a_stretch_makes_no_claim_where_mean_and_median_differ_in_sign() -> None:
    n = 101
    angle = 10.0 * np.arange(n) / RATE
    spoilt = np.full(n, 0.1)
    spoilt[:20] = -5.0
    columns = {"angle_sun": angle, "angle_ring": -angle, "torque_sun": spoilt, "torque_ring": np.full(n, 0.3)}
    found = stretch_of(columns, 0, (0, n), Setpoints(), RATE)
    assert found is not None
    assert (found.speed["sun"], found.speed["ring"]) == pytest.approx((10.0, -10.0))
    assert found.torque == {"sun": 0.0, "ring": pytest.approx(0.3)}
    unknown = columns | {"torque_ring": np.full(n, np.nan)}
    assert stretch_of(unknown, 0, (0, n), Setpoints(), RATE) is None


# --- index pulses ----------------------------------------------------------------------------------------


def of_pulses(change: Callable[[npt.NDArray[np.int64]], None], drop: int | None = None) -> tuple[list[Code], int]:
    """Twenty turns at ten counts a sample, with the index at count 100 of each; `change` spoils the counts."""
    at = np.arange(10_240, dtype=np.int64)
    count = 10 * at
    change(count)
    true = 10 * at
    pulses = [
        IndexPulse(int(sample), int(count[sample]))
        for turn, sample in enumerate(np.flatnonzero((true % 5120 < 10) & (true > 0)))
        if turn != drop
    ]
    findings = Findings("a.mcap")
    slips = check_pulses(SUN, "sun", count, at, 32, 5120, pulses, findings)
    return codes(findings), len(slips)


def test_a_pulse_each_turn_at_one_place_says_nothing() -> None:
    assert of_pulses(lambda count: None) == ([], 0)


def test_a_missing_pulse_and_lost_counts_are_told() -> None:
    found, slips = of_pulses(lambda count: None, drop=7)
    assert (found, slips) == ([Code.INDEX_MISSING], 0)

    def lose(count: npt.NDArray[np.int64]) -> None:
        count[5000:] -= 40

    assert of_pulses(lose) == ([Code.ENCODER_SLIPPED], 1)


@pytest.mark.parametrize(("size", "found"), [(0.0, 0), (11.0, 0), (40.0, 1), (-40.0, 1)])
def test_a_slip_is_more_than_the_counts_of_a_sample(size: float, found: int) -> None:
    place = np.where(np.arange(30) >= 12, size, 0.0)
    slips = find_slips(place, np.full(30, 10.0))
    assert len(slips) == found
    for before, after, told in slips:
        assert (before, after) == (11, 12)
        assert told == pytest.approx(size, abs=12.0)


# --- channels against each other, and against the layout ---------------------------------------------------


def test_channels_of_another_rate_are_named() -> None:
    one, other = track([0.0] * 5, "a"), replace(track([0.0] * 5, "b"), rate_hz=501.0)
    findings = Findings("a.mcap")
    assert one_rate([one, one], findings)
    assert not codes(findings)
    assert not one_rate([one, other], findings)
    assert [each.where for each in findings.listed()] == ["b"]


@pytest.mark.parametrize(("first", "shared"), [(4, True), (5, False), (500, False)])
def test_channels_belong_together_where_they_share_a_sample(first: int, shared: bool) -> None:
    findings = Findings("a.mcap")
    assert together([track([0.0] * 5, "a"), track([0.0] * 5, "b", first)], findings) == shared
    assert codes(findings) == ([] if shared else [Code.SAMPLES_RAGGED])


METADATA = {"quantity": "frequency", "unit": "Hz", "dtype": "f64", "rate_hz": "500"}


def of_channel(
    change: dict[str, str | None], schema: str = "pmg.v1.SampleBlock"
) -> tuple[ChannelTerms | None, list[Code]]:
    kept = {key: text for key, text in (METADATA | change).items() if text is not None}
    findings = Findings("a.mcap")
    topic = Topic("/daq/torque_sun/frequency", "protobuf", schema, kept, 1, [])  # type: ignore[arg-type]
    return check_channel(topic, frequency("sun"), findings), codes(findings)


@pytest.mark.parametrize(
    ("change", "usable", "told"),
    [
        ({}, True, []),
        ({"unit": None}, True, [Code.CHANNEL_KEY]),
        ({"dtype": None}, True, [Code.CHANNEL_KEY]),
        ({"unit": "kHz"}, False, [Code.CHANNEL_VALUE]),
        ({"dtype": "u32"}, False, [Code.CHANNEL_VALUE]),
        ({"rate_hz": None}, False, [Code.CHANNEL_KEY]),
        ({"rate_hz": "0"}, False, [Code.CHANNEL_VALUE]),
        ({"rate_hz": "nan"}, False, [Code.CHANNEL_VALUE]),
        ({"rate_hz": "1e8"}, True, []),
        ({"rate_hz": "1.1e8"}, False, [Code.CHANNEL_VALUE]),
        ({"clock_id": "0"}, True, []),
        ({"clock_id": "1"}, False, [Code.CHANNEL_VALUE]),
    ],
    ids=str,
)
def test_a_channel_is_used_unless_what_it_says_contradicts_the_layout(
    change: dict[str, str | None], usable: bool, told: list[Code]
) -> None:
    found, said = of_channel(change)
    assert (found is not None, said) == (usable, told)


def test_messages_of_another_schema_are_not_taken_for_samples() -> None:
    assert of_channel({}, "pmg.v1.Scalar") == (None, [Code.CHANNEL_VALUE])


def test_numbers_beside_the_rate_are_read_where_the_channel_has_them() -> None:
    findings = Findings("a.mcap")
    metadata = {"quantity": "count", "unit": "1", "dtype": "u32", "rate_hz": "500", "bits": "16"}
    topic = Topic(SUN, "protobuf", "pmg.v1.SampleBlock", metadata, 1, [])  # type: ignore[arg-type]
    found = check_channel(topic, encoder("sun"), findings)
    assert found is not None
    assert (found.rate_hz, dict(found.numbers), found.dtype) == (500.0, {"bits": 16.0}, "u32")


# --- the clock -------------------------------------------------------------------------------------------


def marks(offset_s: float = 0.0, drift: float = 0.0, jump_s: float = 0.0) -> list[Code]:
    start = round(RUN.started_at.timestamp() * 1e9)
    found = [
        ClockMark(0, s, start + round((s / RATE * (1.0 - drift) + offset_s + jump_s * (s >= 15_000)) * 1e9), 1000.0, "")
        for s in range(0, 30_001, 1000)
    ]
    findings = Findings("a.mcap")
    sound_marks(found, RUN, (0, 30_001), RATE, findings)
    return codes(findings)


@pytest.mark.parametrize(
    ("made", "told"),
    [
        ({}, []),
        ({"offset_s": 0.9}, []),
        ({"offset_s": 1.1}, [Code.CLOCK_DISAGREES]),
        ({"drift": 190e-6}, []),
        ({"drift": 210e-6}, [Code.CLOCK_DRIFT]),
        ({"jump_s": 0.5e-3}, []),
        ({"jump_s": 2e-3}, [Code.CLOCK_JUMP]),
        ({"offset_s": -1e9}, [Code.CLOCK_UNSET]),
    ],
    ids=str,
)
def test_the_clock_is_told_beyond_its_tolerances(made: dict[str, float], told: list[Code]) -> None:
    assert marks(**made) == told


@pytest.mark.parametrize(("gain", "code"), [(1.0, Code.CHANNEL_CONFLICT), (2.0, Code.TORQUES_DISAGREE)])
def test_two_encodings_of_one_torque_are_compared_over_what_they_share(gain: float, code: Code) -> None:
    transducer = Transducer(10_000.0, 5.0, 5_000.0, "")
    findings = Findings("a.mcap")
    torque = np.linspace(0.2, 1.0, 400)
    edges, direct = transducer.frequency(torque), transducer.frequency(gain * torque)[50:]
    compare_encodings((edges, direct), (0, 50), transducer, "/daq/torque_sun/frequency", findings)
    (finding,) = findings.listed()
    assert finding.code is code
    if gain > 1.0:
        assert f"{np.mean(torque[50:]):.3f} N m apart" in finding.message


def test_encodings_that_share_no_sample_say_so() -> None:
    findings = Findings("a.mcap")
    transducer = Transducer(10_000.0, 5.0, 5_000.0, "")
    compare_encodings((np.ones(5), np.ones(5)), (0, 50), transducer, "/daq/torque_sun/frequency", findings)
    (finding,) = findings.listed()
    assert finding.severity == "info"
