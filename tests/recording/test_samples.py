"""Each fault of the samples is found where it was planted, and none is found where there is none."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pmg.pipeline.recording.checks.clock import _fit_clock
from pmg.pipeline.recording.checks.slips import find_slips
from pmg.pipeline.recording.checks.stretches import LISTED_STRETCHES, joined, stretches
from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.counters import unwrap
from pmg.pipeline.recording.findings import Finding, UnusableRecordingError
from pmg.pipeline.recording.layouts.wire import ClockMark
from pmg.pipeline.recording.read import Recording, read_recording
from pmg.pipeline.recording.run import LARGEST_NUMBER
from pmg.pipeline.windows.windows import find_windows

from .writer import (
    COUNTS_PER_REV,
    NULL_HZ,
    SPAN_HZ,
    Bench,
    block,
    frequency,
    same,
    tracks,
    true_count,
    wraps,
    write,
)

Samples = npt.NDArray[Any]
TORQUE = "/daq/torque_sun/frequency"
RING = "/daq/torque_ring/frequency"
COUNT = "/daq/encoder_sun/count"
INDEX = "/daq/encoder_sun/index"
START_NS = 1_745_395_200_250_000_000
ENGAGED = {"configuration": "engaged", "gear": "1", "drive": "sun"}


def made(bench: Bench) -> Recording:
    with TemporaryDirectory() as folder:
        return read_recording(write(Path(folder) / "a.mcap", bench))


def only(bench: Bench, code: Code, where: str | None = None) -> Finding:
    """The one finding of a run; that there are others fails."""
    found = made(bench).findings
    assert [(f.code, where or f.where) for f in found] == [(code, f.where) for f in found[:1]], found
    return found[0]


def noisy(bench: Bench, side: str, seed: int = 0, hertz: float = 5.0) -> Samples:
    """Frequency of a side with noise."""
    t = np.arange(round(bench.seconds * bench.rate_hz)) / bench.rate_hz
    return frequency(bench, side, t) + np.random.default_rng(seed).normal(0.0, hertz, len(t))


def changed(values: Samples, at: slice, to: Callable[[Samples], Samples] | float) -> Samples:
    new = values.copy()
    new[at] = to(values[at]) if callable(to) else to
    return new


LIVE = Bench(
    4.0,
    spoil={TORQUE: lambda _: noisy(Bench(4.0), "sun"), RING: lambda _: noisy(Bench(4.0), "ring", 1)},
)
"""A run with noise on both torques."""


def spoilt(topic: str, how: Callable[[Samples], Samples], base: Bench = LIVE) -> Bench:
    """The run with the samples of a topic changed, after the noise."""
    before = base.spoil.get(topic, same)
    return replace(base, spoil=dict(base.spoil) | {topic: lambda values: how(before(values))})


def test_nothing_is_found_in_sound_runs() -> None:
    turns = {"sun": 600.0, "ring": -600.0 / 2.6}
    load = {"sun": 0.8, "ring": 2.0}
    for bench in (
        LIVE,
        replace(LIVE, with_index=True, lines=(0, 0), marks=[(k * 500, START_NS + k * 10**9) for k in range(4)]),
        Bench(4.0, 10_000.0, speed=turns, torque=load, run=ENGAGED, encoding="edges", with_index=True, bits=16),
        Bench(4.0, speed={"sun": 0.0, "ring": 0.0}, torque={"sun": 0.0, "ring": 0.0}, run={"configuration": "zero"}),
        Bench(4.0, 2000.0, speed={"sun": -900.0, "ring": 300.0}, torque={"sun": -0.8, "ring": 0.5}, with_index=True),
        Bench(
            4.0,
            2000.0,
            speed={"sun": 600.0, "ring": -10.0},
            acceleration=-300.0,
            with_index=True,
            torque={"sun": 0.01, "ring": 0.0},
        ),
    ):
        assert made(bench).findings == ()


# --- samples that are missing, twice, spoilt ------------------------------------------------------------


def test_each_gap_is_told_with_its_own_range_and_many_together() -> None:
    values = tracks(LIVE)[TORQUE][1]
    for starts in ([300, 900], list(range(100, 1900, 100))):
        lacking = {k for start in starts for k in range(start, start + 10)}
        kept = stretches(~np.isin(np.arange(2000), list(lacking)))
        blocks = [block(a, "f64", values[a:b]) for a, b in kept.tolist()]
        gaps = [f for f in made(replace(LIVE, raw={TORQUE: blocks})).findings if f.code is Code.SAMPLES_GAP]
        assert len(gaps) == min(len(starts), LISTED_STRETCHES)
        assert gaps[0].sample_range == (starts[0], starts[0] + 10)
        assert gaps[0].lost == "10 samples"
        assert gaps[-1].sample_range[1] == starts[-1] + 10  # type: ignore[index]
        assert sum(int(g.lost.split()[0]) for g in gaps) == 10 * len(starts)


@given(mask=st.lists(st.booleans(), max_size=60), apart=st.integers(1, 5))
def test_stretches_are_the_mask_and_joined_ones_hold_it(mask: list[bool], apart: int) -> None:
    array = np.array(mask, dtype=np.bool_)
    found = stretches(array)
    again = np.zeros(len(mask), dtype=np.bool_)
    for start, stop in found.tolist():
        assert start < stop
        again[start:stop] = True
    np.testing.assert_array_equal(again, array)
    near = joined(found, apart)
    assert len(near) <= len(found)
    assert all(b[0] - a[1] >= apart for a, b in pairwise(near.tolist()))


def with_extra(*extra: bytes) -> Bench:
    values = LIVE.spoil[TORQUE](np.empty(0))
    blocks = [block(k, "f64", values[k : k + 100]) for k in range(0, 2000, 100)]
    return replace(LIVE, raw={TORQUE: [*blocks, *extra]})


def test_samples_given_twice_are_told_with_their_range() -> None:
    values = LIVE.spoil[TORQUE](np.empty(0))
    same = only(with_extra(block(250, "f64", values[250:300])), Code.SAMPLES_DUPLICATE)
    assert (same.sample_range, same.severity) == ((250, 300), Severity.WARNING)
    other = only(with_extra(block(250, "f64", values[250:300] + 1.0)), Code.SAMPLES_CONFLICT)
    assert (other.sample_range, other.lost) == ((250, 300), "50 samples")


def test_blocks_written_once_more_are_no_restart_but_an_index_that_begins_anew_is() -> None:
    values = LIVE.spoil[TORQUE](np.empty(0))
    again = [block(k, "f64", values[k : k + 100]) for k in range(500, 1000, 100)]
    assert only(with_extra(*again), Code.SAMPLES_DUPLICATE).sample_range == (500, 1000)
    anew = [block(k, "f64", values[k : k + 100] + 3.0) for k in range(0, 2000, 100)]
    restarted = made(with_extra(*anew, *[block(k, "f64", values[:100]) for k in range(2000, 2500, 100)]))
    (finding,) = restarted.findings
    assert (finding.code, finding.sample_range, finding.lost) == (Code.RESTART, (0, 2500), "2500 samples after it")
    np.testing.assert_array_equal(restarted.samples["torque_sun"], made(LIVE).samples["torque_sun"])


def test_channels_that_share_no_sample_are_refused_whatever_lies_between() -> None:
    values = LIVE.spoil[TORQUE](np.empty(0))
    for start in (2000, 10**15):
        with pytest.raises(UnusableRecordingError, match="same samples"):
            made(replace(LIVE, raw={TORQUE: [block(start, "f64", values)]}))


def test_indices_that_are_far_apart_after_a_step_back_cost_no_memory() -> None:
    values = LIVE.spoil[TORQUE](np.empty(0))
    far = [block(k, "f64", values[:100]) for k in (500, 10**12, 10**12 + 100)]
    found = made(with_extra(block(10**13, "f64", values[:100]), *far))
    assert found.samples.height == 2000
    assert {f.code for f in found.findings} == {Code.SAMPLES_ASTRAY, Code.SAMPLES_CONFLICT}


def test_blocks_that_come_late_are_no_restart() -> None:
    values = LIVE.spoil[TORQUE](np.empty(0))
    blocks = [block(k, "f64", values[k : k + 100]) for k in range(0, 2000, 100)]
    late = made(replace(LIVE, raw={TORQUE: [*blocks[:5], *blocks[9:], *blocks[5:9]]}))
    assert late.findings == ()
    assert late.samples.equals(made(LIVE).samples)


def test_values_that_are_no_numbers_are_told_with_their_range_and_not_as_a_gap_too() -> None:
    finding = only(spoilt(TORQUE, lambda v: changed(v, slice(70, 75), math.nan)), Code.NOT_FINITE)
    assert (finding.sample_range, finding.lost) == ((70, 75), "5 samples")


@pytest.mark.parametrize("value", [1e308, -1e308, -math.inf, 2.0 * LARGEST_NUMBER])
def test_values_that_no_reading_has_are_missing(value: float) -> None:
    """The square of such a value, or the sum of a few, is beyond all floats."""
    finding = only(spoilt(TORQUE, lambda v: changed(v, slice(70, 75), value)), Code.NOT_FINITE)
    assert finding.sample_range == (70, 75)


@pytest.mark.parametrize("number", ["1e308", "-1e308", "inf", "1e13"])
def test_set_points_that_no_bench_has_are_refused(number: str) -> None:
    with pytest.raises(UnusableRecordingError, match="sun_speed_set_rpm"):
        made(replace(LIVE, run=dict(LIVE.run) | {"sun_speed_set_rpm": number}))


def test_a_rate_of_almost_nothing_is_refused() -> None:
    with pytest.raises(UnusableRecordingError, match="rate_hz '5e-324'"):
        made(replace(LIVE, channel={topic: {"rate_hz": "5e-324"} for topic in tracks(LIVE)}))


def test_flags_of_the_recorder_are_told_with_their_range() -> None:
    finding = only(replace(LIVE, flags={TORQUE: {3: 1, 4: 1}}), Code.OVERRUN)
    assert finding.sample_range == (300, 500)


# --- counters ------------------------------------------------------------------------------------------


@given(data=st.data(), bits=st.integers(2, 64))
def test_a_counter_of_any_width_is_unwrapped(data: st.DataObject, bits: int) -> None:
    half = 1 << (bits - 1)
    most = min(half - 1, 1 << 55)
    steps = data.draw(st.lists(st.integers(-most, most), min_size=1, max_size=30))
    start = data.draw(st.integers(0, (1 << bits) - 1))
    truth = [start]
    for step in steps:
        truth.append(truth[-1] + step)
    values = np.array([value % (1 << bits) for value in truth], dtype=np.uint64)
    found, guesses = unwrap(values, np.arange(len(values)), bits)
    assert (found - found[0]).tolist() == [value - start for value in truth]
    assert guesses == 0


@given(data=st.data(), bits=st.integers(12, 40), rate=st.sampled_from([500.0, 10_000.0]))
def test_a_timer_of_any_width_is_unwrapped_by_what_is_expected(data: st.DataObject, bits: int, rate: float) -> None:
    step = 40e6 / rate
    slack = int((1 << (bits - 1)) * 0.9)
    off = data.draw(st.lists(st.integers(-min(slack // 2, 2000), min(slack // 2, 2000)), min_size=2, max_size=40))
    truth = np.cumsum(np.rint(step) + np.diff(np.array([0, *off]))).astype(np.int64) + (1 << bits) - 5
    found, _ = unwrap(truth % (1 << bits), np.arange(len(truth)), bits, per_sample=step)
    np.testing.assert_array_equal(np.diff(found), np.diff(truth))


@pytest.mark.parametrize(("edge_bits", "tick_bits"), [(32, 32), (16, 24), (24, 32), (12, 20)])
def test_edges_and_ticks_wrap_at_their_declared_width(edge_bits: int, tick_bits: int) -> None:
    bench = Bench(3.0, 2000.0, ripple=0.2, encoding="edges", start_edges=2**12 - 50, start_ticks=2**20 - 9)
    topics = {
        f"/daq/torque_{s}/{k}": b for s in ("sun", "ring") for k, b in (("edges", edge_bits), ("edge_ticks", tick_bits))
    }
    narrow = replace(
        bench,
        channel={topic: {"bits": str(bits)} for topic, bits in topics.items()},
        spoil={topic: wraps(bits) for topic, bits in topics.items()},
    )
    found = made(narrow)
    assert found.findings == ()
    assert found.samples.equals(made(bench).samples)


@pytest.mark.parametrize("topic", ["/daq/torque_sun/edges", "/daq/torque_sun/edge_ticks", COUNT])
def test_readings_that_do_not_fit_the_declared_width_are_not_used(topic: str) -> None:
    bench = Bench(1.0, encoding="edges", start_count={"sun": 2**20}, channel={topic: {"bits": "12"}})
    recording = made(bench)
    assert any(f.where == topic and "declared width" in f.message for f in recording.findings)
    assert dict(recording.lacking) == {"angle_sun" if topic == COUNT else "torque_sun": "not usable"}


def test_a_counter_of_64_bits_is_read() -> None:
    meta = {"quantity": "count", "unit": "1", "dtype": "u64", "bits": "64"}
    bench = Bench(1.0)
    counts = true_count(bench, "sun", np.arange(500) / 500.0) - 1000
    wide = made(replace(bench, channel={COUNT: meta}, raw={COUNT: [block(0, "u64", counts.astype(np.uint64))]}))
    assert wide.findings == ()
    moved = wide.samples["angle_sun"].to_numpy()
    np.testing.assert_allclose(moved - moved[0], made(bench).samples["angle_sun"], atol=1e-9)


def test_a_counter_too_narrow_for_the_speed_is_told() -> None:
    found = made(Bench(1.0, bits=8, speed={"sun": 600.0, "ring": -100.0}))
    assert {(f.code, f.where) for f in found.findings} == {(Code.ENCODER_AMBIGUOUS, COUNT)}


def test_a_spoilt_reading_of_the_edges_costs_the_samples_beside_it() -> None:
    bench = Bench(2.0, 2000.0, encoding="edges")
    finding = only(
        spoilt("/daq/torque_sun/edges", lambda v: changed(v, slice(1000, 1001), v[1000] + 5000), bench),
        Code.EDGES_INCONSISTENT,
    )
    assert finding.sample_range == (1000, 1002)
    torque = made(bench).samples["torque_sun"].to_numpy()
    other = made(spoilt("/daq/torque_sun/edges", lambda v: changed(v, slice(1000, 1001), v[1000] + 5000), bench))
    found = other.samples["torque_sun"].to_numpy()
    assert np.flatnonzero(np.isnan(found)).tolist() == [1000]
    np.testing.assert_allclose(np.delete(found, 1000), np.delete(torque, 1000), atol=2e-3)


# --- index pulses --------------------------------------------------------------------------------------

TURNING = Bench(3.0, 2000.0, with_index=True, bits=16)


def lost_counts(at: int, counts: int) -> Bench:
    """The run with counts lost from a sample on, in the count and in what the index latches."""
    clean = true_count(TURNING, "sun", np.arange(6000) / 2000.0)
    shifted = changed(clean, slice(at, None), lambda v: v + counts)
    turns = clean // COUNTS_PER_REV
    places = np.flatnonzero(np.diff(turns)) + 1
    latched = [(int(p), int(turns[p] * COUNTS_PER_REV + counts * (p >= at)) % 2**16) for p in places]
    return replace(TURNING, index={"sun": latched}, spoil={COUNT: lambda _: shifted % 2**16})


@settings(max_examples=20)
@given(at=st.integers(700, 5300), counts=st.integers(40, 2000), sign=st.sampled_from([-1, 1]))
def test_lost_counts_are_found_between_the_pulses_around_them(at: int, counts: int, sign: int) -> None:
    finding = only(lost_counts(at, sign * counts), Code.ENCODER_SLIPPED)
    assert finding.where == COUNT
    assert f"slips by {sign * counts:+d}" in finding.message
    start, stop = finding.sample_range or (0, 0)
    assert start <= at <= stop
    assert stop - start <= 202


@given(
    seed=st.integers(0, 10_000),
    speed=st.floats(-30.0, 30.0),
    size=st.integers(-60, 60),
    at=st.integers(1, 59),
    early=st.booleans(),
)
def test_slips_are_never_invented_and_large_ones_never_missed(
    seed: int, speed: float, size: int, at: int, early: bool
) -> None:
    rng = np.random.default_rng(seed)
    late = np.floor(rng.uniform(0.0, 1.0, 60) * (-speed if early else speed))
    assert find_slips(late, np.full(60, speed)) == []
    slipped = late + size * (np.arange(60) >= at)
    found = find_slips(slipped, np.full(60, speed))
    if abs(size) > 2 * abs(speed) + 3:
        ((before, after, told_size),) = found
        assert before < at <= after
        assert abs(told_size - size) <= abs(speed) + 1
    for before, after, _ in found:
        assert before < at <= after


def test_a_window_over_lost_counts_is_rejected() -> None:
    (window,) = find_windows(made(lost_counts(3000, -60)))
    assert any(reason.startswith("found faulty: encoder.slipped") for reason in window.reasons)
    (whole,) = find_windows(made(TURNING))
    assert not any("encoder" in reason for reason in whole.reasons)


def clean_pulses() -> list[tuple[int, int]]:
    turns = true_count(TURNING, "sun", np.arange(6000) / 2000.0) // COUNTS_PER_REV
    places = np.flatnonzero(np.diff(turns)) + 1
    return [(int(p), int(turns[p] * COUNTS_PER_REV) % 2**16) for p in places]


@pytest.mark.parametrize("missing", [[5], [5, 6, 7], [0, 1], [-1, -2]])
def test_missing_pulses_are_told(missing: list[int]) -> None:
    pulses = clean_pulses()
    gone = sorted(k % len(pulses) for k in missing)
    left = [p for k, p in enumerate(pulses) if k not in gone]
    finding = only(replace(TURNING, index={"sun": left}), Code.INDEX_MISSING)
    assert finding.where == INDEX
    assert finding.message.startswith(f"{len(gone)} pulses")
    assert finding.sample_range is not None
    assert finding.sample_range[0] <= pulses[gone[0]][0] < finding.sample_range[1]


@pytest.mark.parametrize("later", [1, 3, 60])
def test_a_pulse_too_many_is_told_and_is_no_slip(later: int) -> None:
    pulses = clean_pulses()
    sample, count = pulses[5]
    counts = 0 if later == 1 else later * COUNTS_PER_REV // 200
    doubled = sorted([*pulses, (sample + later, (count + counts) % 2**16)])
    finding = only(replace(TURNING, index={"sun": doubled}), Code.INDEX_SURPLUS)
    assert finding.sample_range == (sample + later, sample + later + 1)


# --- clock ---------------------------------------------------------------------------------------------


def marks(step_s: float = 0.0, ppm: float = 0.0, jitter_s: float = 0.0, count: int = 20) -> list[tuple[int, int]]:
    rng = np.random.default_rng(3)
    return [
        (
            100 * k,
            START_NS + round(((k * 0.2) * (1 - ppm * 1e-6) + step_s * (k > 9) + rng.normal(0, 1) * jitter_s) * 1e9),
        )
        for k in range(count)
    ]


def test_marks_with_an_ordinary_crystal_and_jitter_say_nothing() -> None:
    assert made(replace(LIVE, marks=marks(ppm=60.0, jitter_s=50e-6))).findings == ()


@pytest.mark.parametrize("step", [-0.5, -0.004, 0.004, 0.5])
def test_a_jump_of_the_clock_is_told_between_its_marks(step: float) -> None:
    finding = only(replace(LIVE, marks=marks(step, ppm=40.0, jitter_s=50e-6)), Code.CLOCK_JUMP)
    assert finding.sample_range == (900, 1001)
    assert float(finding.message.split("jumps by ")[1].split(" s")[0]) == pytest.approx(step, abs=5e-4)


@pytest.mark.parametrize(("ppm", "severity"), [(500.0, Severity.WARNING), (-4000.0, Severity.ERROR)])
def test_a_rate_that_is_off_is_told_with_its_size(ppm: float, severity: Severity) -> None:
    finding = only(replace(LIVE, marks=marks(ppm=ppm, jitter_s=20e-6)), Code.CLOCK_DRIFT)
    assert finding.severity is severity
    assert float(finding.message.split(" Hz, ")[1].split(" ppm")[0]) == pytest.approx(ppm, abs=60.0)


def test_marks_before_the_clock_was_set_are_left_out() -> None:
    unset = [(100 * k, round(k * 0.2e9)) for k in range(5)]
    recording = made(replace(LIVE, marks=[*unset, *marks()[5:]]))
    (finding,) = recording.findings
    assert (finding.code, finding.sample_range, finding.lost) == (Code.CLOCK_UNSET, (0, 401), "5 marks")
    assert recording.time_of(500) == made(replace(LIVE, marks=marks())).time_of(500)


@pytest.mark.parametrize("mark", [(2**63, START_NS), (10**12, START_NS), (500, 2**63), (2**64 - 1, 2**64 - 1)])
def test_a_mark_that_no_clock_gives_is_left_out(mark: tuple[int, int]) -> None:
    recording = made(replace(LIVE, marks=[*marks()[:5], mark, *marks()[5:]]))
    assert [f.code for f in recording.findings] == [Code.CLOCK_UNSET]
    assert len(recording.clock_marks) == 20


def test_a_run_that_began_in_1970_is_told() -> None:
    assert (
        only(replace(LIVE, run={"started_at": "1970-01-01T00:03:00Z"}), Code.CLOCK_UNSET).where == "pmg.run.started_at"
    )


@given(ppm=st.floats(-900.0, 900.0), seed=st.integers(0, 50))
def test_the_drift_is_right_within_its_uncertainty(ppm: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    u = 100e-6
    given_marks = [
        ClockMark(0, 10_000 * k, START_NS + round((k * (1 - ppm * 1e-6) + rng.normal(0, u)) * 1e9), u * 1e9, "ntp")
        for k in range(30)
    ]
    fit = _fit_clock(given_marks, 10_000.0)
    assert abs(fit.drift - ppm * 1e-6) < 5 * fit.u_drift + 1e-6
    assert fit.u_drift == pytest.approx(u * math.sqrt(12 / 30**3), rel=0.8)
    assert fit.jumps == ()


# --- torque --------------------------------------------------------------------------------------------


def test_a_frequency_outside_the_band_is_told() -> None:
    finding = only(spoilt(TORQUE, lambda v: changed(v, slice(800, 900), lambda w: w + 6000.0)), Code.OUT_OF_BAND)
    assert (finding.where, finding.sample_range) == (TORQUE, (800, 900))


def test_a_torque_beyond_the_nominal_one_is_told_where_the_band_is_wider() -> None:
    finding = only(
        spoilt(
            RING,
            lambda v: (
                changed(v, slice(800, 900), NULL_HZ["ring"] + 1.004 * SPAN_HZ["ring"])
                + np.random.default_rng(2).normal(0, 1, 2000)
            ),
        ),
        Code.BEYOND_NOMINAL,
    )
    assert finding.sample_range == (800, 900)


def test_a_held_value_is_told_and_its_window_rejected() -> None:
    bench = spoilt(TORQUE, lambda v: changed(v, slice(800, 1100), v[800]))
    finding = only(bench, Code.STUCK)
    assert (finding.where, finding.sample_range) == (TORQUE, (800, 1100))
    (window,) = find_windows(made(bench))
    assert any("torque.stuck" in reason for reason in window.reasons)


def test_a_value_held_over_the_whole_run_is_told_beside_a_lively_one() -> None:
    finding = only(spoilt(TORQUE, lambda v: np.full(len(v), v[0])), Code.STUCK)
    assert finding.sample_range == (0, 2000)


def test_values_held_on_both_shafts_at_once_are_told_on_both() -> None:
    dead = spoilt(RING, lambda v: np.full(len(v), v[0]), spoilt(TORQUE, lambda v: np.full(len(v), v[0])))
    recording = made(dead)
    assert [(f.code, f.where, f.sample_range) for f in recording.findings] == [
        (Code.STUCK, TORQUE, (0, 2000)),
        (Code.STUCK, RING, (0, 2000)),
    ]
    (window,) = find_windows(recording)
    assert not window.accepted
    short = replace(dead, seconds=0.2)
    assert [f.where for f in made(short).findings if f.code is Code.STUCK] == [TORQUE, RING]


def test_readings_of_coarse_steps_on_both_shafts_are_not_held() -> None:
    """Each value stands for 0.6 s, less than `DEAD_S`; nothing else in either record is lively."""
    coarse = LIVE
    for topic in (TORQUE, RING):
        coarse = spoilt(topic, lambda v: v[0] + 5.0 * (np.arange(len(v)) // 300 % 2), coarse)
    assert Code.STUCK not in {f.code for f in made(coarse).findings}


def test_simulated_readings_may_stand_still() -> None:
    dead = spoilt(RING, lambda v: np.full(len(v), v[0]), spoilt(TORQUE, lambda v: np.full(len(v), v[0])))
    every = dict.fromkeys(range(20), 8)
    assert Code.STUCK not in {f.code for f in made(replace(dead, flags={TORQUE: every, RING: every})).findings}


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_shunt_signal_is_told_and_a_load_is_not(sign: float) -> None:
    def shunt(side: str) -> Callable[[Samples], Samples]:
        return lambda v: changed(v, slice(700, 1200), lambda w: w + sign * 0.5 * SPAN_HZ[side])

    idle = replace(LIVE, torque={"sun": 0.0, "ring": 0.0})
    finding = only(spoilt(TORQUE, shunt("sun"), idle), Code.SHUNT)
    start, stop = finding.sample_range or (0, 0)
    assert abs(start - 700) <= 4
    assert abs(stop - 1200) <= 4
    both = spoilt(RING, shunt("ring"), spoilt(TORQUE, shunt("sun"), LIVE))
    slow = spoilt(TORQUE, lambda v: v + sign * 0.5 * SPAN_HZ["sun"] * np.clip((np.arange(2000) - 700) / 40, 0, 1))
    for bench in (both, slow):
        assert Code.SHUNT not in {f.code for f in made(bench).findings}


# --- wiring --------------------------------------------------------------------------------------------

SET = {"sun_speed_set_rpm": "600", "ring_speed_set_rpm": "-230"}
GEARED = {"sun": 598.0, "ring": -230.0}
LOADED = Bench(
    3.0,
    speed=GEARED,
    torque={"sun": 1.0, "ring": 2.2},
    run=ENGAGED | {"sun_speed_set_rpm": "598", "ring_torque_set_Nm": "2.2"},
)


@pytest.mark.parametrize(
    ("bench", "code", "where"),
    [
        (
            Bench(2.0, speed={"sun": -600.0, "ring": -230.0}, torque={"sun": -0.8, "ring": -1.5}, run=SET),
            Code.CHANNEL_REVERSED,
            COUNT,
        ),
        (
            Bench(2.0, speed={"sun": -230.0, "ring": 600.0}, torque={"sun": -0.8, "ring": 1.5}, run=SET),
            Code.CHANNEL_SWAPPED,
            COUNT,
        ),
        (Bench(2.0, torque={"sun": -0.8, "ring": -1.5}), Code.CHANNEL_REVERSED, "/daq/torque_sun"),
        (
            replace(LOADED, speed={"sun": 598.0, "ring": 230.0}, torque={"sun": 1.0, "ring": -2.2}),
            Code.CHANNEL_REVERSED,
            "/daq/encoder_ring/count",
        ),
        (
            replace(LOADED, speed={"sun": -598.0, "ring": -230.0}, torque={"sun": -1.0, "ring": 2.2}),
            Code.CHANNEL_REVERSED,
            COUNT,
        ),
        (
            replace(LOADED, speed={"sun": -230.0, "ring": 598.0}, torque={"sun": -1.0, "ring": -2.2}),
            Code.CHANNEL_SWAPPED,
            COUNT,
        ),
        (replace(LOADED, torque={"sun": 1.0, "ring": -2.2}), Code.CHANNEL_REVERSED, "/daq/torque_ring"),
        (replace(LOADED, torque={"sun": -1.0, "ring": 2.2}), Code.CHANNEL_REVERSED, "/daq/torque_sun"),
        (replace(LOADED, torque={"sun": 2.2, "ring": 1.0}), Code.CHANNEL_SWAPPED, "/daq/torque_sun"),
        (
            replace(LOADED, run=ENGAGED, speed={"sun": 598.0, "ring": 230.0}, torque={"sun": 1.0, "ring": -2.2}),
            Code.CHANNEL_REVERSED,
            "/daq/encoder_ring/count",
        ),
        (replace(LOADED, run=ENGAGED, speed={"sun": 230.0, "ring": -598.0}), Code.CHANNEL_SWAPPED, COUNT),
    ],
)
def test_channels_that_are_reversed_or_swapped_are_told(bench: Bench, code: Code, where: str) -> None:
    finding = only(bench, code)
    assert (finding.where, finding.sample_range) == (where, (0, round(bench.seconds * 500)))


def test_sound_wiring_in_either_direction_of_rotation_and_power_says_nothing() -> None:
    back = {"sun": -598.0, "ring": 230.0}
    for run, speed, torque in (
        ({"drive": "sun"}, GEARED, {"sun": 1.0, "ring": 2.2}),
        ({"drive": "sun"}, back, {"sun": -1.0, "ring": -2.2}),
        ({"drive": "ring"}, GEARED, {"sun": -0.7, "ring": -2.2}),
        ({"drive": "sun"}, GEARED, {"sun": 0.4, "ring": -0.05}),
    ):
        assert made(Bench(2.0, speed=speed, torque=torque, run=ENGAGED | run)).findings == ()


# --- lines ---------------------------------------------------------------------------------------------


def test_the_emergency_stop_is_told_where_it_was_pressed() -> None:
    events = [(300, 1, 1), (500, 0, 1)]
    for bench in (replace(LIVE, lines=(300, 500), events=events), replace(LIVE, events=events)):
        finding = only(bench, Code.EMERGENCY_STOP)
        assert (finding.sample_range, finding.severity) == ((300, 500), Severity.INFO)


@pytest.mark.parametrize(
    ("lines", "events", "at"),
    [
        ((300, 500), [(300, 1, 1)], (500, 501)),
        ((300, 500), [(300, 1, 1), (520, 0, 1)], (520, 521)),
        (None, [(300, 2, 2), (500, 0, 6)], (300, 501)),
    ],
)
def test_events_and_samples_of_the_lines_that_contradict_each_other_are_told(
    lines: tuple[int, int] | None, events: list[tuple[int, int, int]], at: tuple[int, int]
) -> None:
    found = made(replace(LIVE, lines=lines, events=events)).findings
    ranges = [f.sample_range for f in found if f.code is Code.LINES_DISAGREE]
    if lines == (300, 500) and len(events) == 2:
        assert ranges == [(500, 501)]
    else:
        assert ranges == [at]
