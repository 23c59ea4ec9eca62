"""Torque and angle come out as they went in."""

from __future__ import annotations

import math
import re
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.counters import unwrap
from pmg.pipeline.recording.edges import edge_frequency
from pmg.pipeline.recording.findings import UnusableRecordingError
from pmg.pipeline.recording.read import Recording, read_recording
from pmg.sim.shafts import SIDES

from .writer import (
    COUNTS_PER_REV,
    LEAD,
    NOMINAL,
    NULL_HZ,
    SPAN_HZ,
    TIMEBASE_HZ,
    Bench,
    block,
    edges_and_ticks,
    live,
    phase,
    true_count,
    true_torque,
    write,
)


def made(bench: Bench) -> Recording:
    with TemporaryDirectory() as folder:
        return read_recording(write(Path(folder) / "a.mcap", bench))


def driven(torque: float) -> dict[str, float]:
    """Speeds at which both shafts take power in, the ring with the opposite torque [rpm]."""
    return {"sun": math.copysign(600.0, torque), "ring": math.copysign(230.0, -torque)}


def times(bench: Bench) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.arange(round(bench.seconds * bench.rate_hz)) / bench.rate_hz


@settings(max_examples=25)
@given(
    torque=st.floats(-4.0, 4.0),
    ripple=st.floats(0.0, 0.9),
    encoding=st.sampled_from(["f64", "f32"]),
    rate=st.sampled_from([500.0, 1000.0]),
)
def test_torque_from_frequency_is_the_torque(torque: float, ripple: float, encoding: str, rate: float) -> None:
    bench = Bench(1.0, rate, driven(torque), torque={"sun": torque, "ring": -torque}, ripple=ripple, encoding=encoding)
    recording = made(bench)
    assert recording.findings == ()
    resolution = 2e-6 if encoding == "f32" else 1e-9
    for side in SIDES:
        truth = true_torque(bench, side, times(bench)) + live(len(times(bench))) / SPAN_HZ[side] * NOMINAL[side]
        np.testing.assert_allclose(recording.samples[f"torque_{side}"], truth, atol=resolution)


@settings(max_examples=25)
@given(
    torque=st.floats(-4.0, 4.0),
    ripple=st.floats(0.0, 0.9),
    rate=st.sampled_from([500.0, 2000.0, 10_000.0]),
    edges_before_wrap=st.integers(0, 12_000),
    ticks_before_wrap=st.integers(0, TIMEBASE_HZ),
)
@example(-4.0, 0.7281165626186471, 10_000.0, 0, 0)  # an edge at a sample, but for the last digits of its moment
def test_mean_torque_from_edges_is_the_phase_gained_over_the_time(
    torque: float, ripple: float, rate: float, edges_before_wrap: int, ticks_before_wrap: int
) -> None:
    bench = Bench(
        1.0,
        rate,
        driven(torque),
        torque={"sun": torque, "ring": -torque},
        ripple=ripple,
        encoding="edges",
        start_edges=2**32 - edges_before_wrap,
        start_ticks=2**32 - ticks_before_wrap,
    )
    recording = made(bench)
    assert recording.findings == ()
    for side in SIDES:
        ends = phase(bench, side, LEAD + np.array([0.0, times(bench)[-1]])) / times(bench)[-1]
        mean = (ends[1] - ends[0] - NULL_HZ[side]) / SPAN_HZ[side] * NOMINAL[side]
        found = recording.samples[f"torque_{side}"].to_numpy()
        assert found[1:].mean() == pytest.approx(mean, abs=5e-4)
        assert found[0] == found[1]


def test_ripple_does_not_bias_torque_from_edges_as_it_does_the_mean_of_periods() -> None:
    bench = Bench(5.0, 10_000.0, torque={"sun": 0.0, "ring": 0.0}, ripple=2.0, ripple_hz=8.0, encoding="edges")
    edges, ticks = edges_and_ticks(bench, "sun", times(bench))
    found = edge_frequency(edges % 2**32, ticks % 2**32, np.ones(len(edges), dtype=bool), 10_000.0, TIMEBASE_HZ)
    by_period = np.diff(ticks)[np.diff(edges) == 1].mean() / TIMEBASE_HZ
    assert abs(found.frequency.mean() / NULL_HZ["sun"] - 1.0) < 2e-7
    assert abs(1.0 / by_period / NULL_HZ["sun"] - 1.0) > 1e-3


@settings(max_examples=60)
@given(
    speed=st.floats(-2000.0, 2000.0),
    bits=st.sampled_from([16, 24, 32]),
    from_wrap=st.integers(-3000, 3000),
)
def test_angle_is_right_over_wraps_in_both_directions(speed: float, bits: int, from_wrap: int) -> None:
    start = {"sun": from_wrap % 2**bits, "ring": (2**bits - 1 + from_wrap) % 2**bits}
    torque = {"sun": math.copysign(0.8, speed), "ring": math.copysign(0.8, -speed)}
    bench = Bench(1.0, speed={"sun": speed, "ring": -speed}, torque=torque, bits=bits, start_count=start)
    recording = made(bench)
    assert recording.findings == ()
    for side in SIDES:
        counts = true_count(bench, side, times(bench))
        angle = recording.samples[f"angle_{side}"].to_numpy()
        np.testing.assert_allclose(angle - angle[0], (counts - counts[0]) * 2 * math.pi / COUNTS_PER_REV, atol=1e-6)


@given(steps=st.lists(st.integers(-32_000, 32_000), min_size=1, max_size=50), start=st.integers(0, 2**16 - 1))
def test_unwrapping_undoes_wrapping_for_steps_below_half_the_range(steps: list[int], start: int) -> None:
    truth = start + np.concatenate(([0], np.cumsum(steps)))
    found, guesses = unwrap(truth % 2**16, np.arange(len(truth)), 16)
    np.testing.assert_array_equal(found, truth)
    assert guesses == 0


def test_a_gap_stays_a_gap_and_the_angle_after_it_is_right() -> None:
    topics = [f"/daq/{kind}" for kind in ("encoder_sun/count", "torque_sun/frequency")]
    bench = Bench(4.0, speed={"sun": 1872.0, "ring": -720.0}, bits=16, drop=dict.fromkeys(topics, (600, 1100)))
    recording = made(bench)
    assert [f.code for f in recording.findings] == [Code.SAMPLES_GAP, Code.SAMPLES_GAP]
    angle = recording.samples["angle_sun"].to_numpy()
    assert np.flatnonzero(np.isnan(angle)).tolist() == list(range(600, 1100))
    assert np.flatnonzero(np.isnan(recording.samples["torque_sun"].to_numpy())).tolist() == list(range(600, 1100))
    counts = true_count(bench, "sun", times(bench))
    known = np.isfinite(angle)
    truth = (counts - counts[0]) * 2 * math.pi / COUNTS_PER_REV
    np.testing.assert_allclose((angle - angle[0])[known], truth[known], atol=1e-6)


def test_an_angle_over_a_gap_that_nothing_settles_is_called_ambiguous() -> None:
    topic = "/daq/encoder_sun/count"
    recording = made(Bench(6.0, acceleration=300.0, bits=16, drop={topic: (600, 2600)}))
    assert Code.ENCODER_AMBIGUOUS in {f.code for f in recording.findings}


def test_edges_with_a_gap_are_right_on_both_sides_and_unknown_within() -> None:
    drop = dict.fromkeys(["/daq/torque_ring/edges", "/daq/torque_ring/edge_ticks"], (600, 900))
    bench = Bench(3.0, encoding="edges", drop=drop, start_ticks=2**32 - TIMEBASE_HZ - 4_000_000)
    torque = made(bench).samples["torque_ring"].to_numpy()
    assert np.flatnonzero(np.isnan(torque)).tolist() == list(range(600, 900))
    np.testing.assert_allclose(torque[np.isfinite(torque)], -1.5, atol=2e-3)


def test_a_transducer_that_falls_silent_gives_no_torque_from_then_on() -> None:
    recording = made(Bench(encoding="edges", silent_from=1.2))
    torque = recording.samples["torque_sun"].to_numpy()
    assert Code.EDGES_STALLED in {f.code for f in recording.findings}
    assert np.isfinite(torque[:595]).all()
    assert np.isnan(torque[605:]).all()


def test_a_time_base_off_the_sample_clock_is_measured_and_told() -> None:
    bench = Bench(20.0, encoding="edges", timebase_error=200e-6)
    recording = made(bench)
    drifts = [f for f in recording.findings if f.code is Code.TIMEBASE_DRIFT]
    assert len(drifts) == 2
    told = [float(re.search(r"([+-][\d.]+) ppm", drift.message)[1]) for drift in drifts]  # type: ignore[index]
    assert told == pytest.approx([200.0, 200.0], abs=5.0)
    hertz = 200e-6 * (NULL_HZ["sun"] + 0.8 / NOMINAL["sun"] * SPAN_HZ["sun"])
    shift = -hertz / SPAN_HZ["sun"] * NOMINAL["sun"]
    assert recording.samples["torque_sun"].mean() == pytest.approx(0.8 + shift, abs=2e-4)


def test_edges_that_run_backward_cost_the_samples_beside_them_and_no_others() -> None:
    count = np.arange(1000, dtype=np.int64) * 20
    ticks = count * 10_000
    count[500] -= 100
    found = edge_frequency(count, ticks, np.ones(1000, dtype=bool), 500.0, TIMEBASE_HZ)
    assert np.flatnonzero(found.wrong).tolist() == [500, 501]
    assert np.isfinite(np.delete(found.frequency, [500, 501])).all()
    np.testing.assert_allclose(found.frequency[np.isfinite(found.frequency)], 10_000.0, rtol=1e-3)


def test_edges_that_mostly_contradict_themselves_give_no_torque() -> None:
    count = np.arange(1000, dtype=np.int64) * 20
    found = edge_frequency(count, np.zeros(1000, dtype=np.int64), np.ones(1000, dtype=bool), 500.0, TIMEBASE_HZ)
    assert np.isnan(found.frequency).all()
    assert found.wrong.sum() > 900


def test_blocks_belong_where_their_index_says_whatever_the_order_and_time_of_writing(tmp_path: Path) -> None:
    plain = made(Bench(first_sample=2**40))
    assert plain.first_sample == 2**40
    assert plain.samples["sample"].to_list() == list(range(2**40, 2**40 + 1000))
    assert plain.time_of(2**40 + 500) == plain.time_of(2**40).replace(second=1)


TORQUE = "/daq/torque_sun/frequency"


def with_extra_block(extra: bytes) -> Recording:
    """The plain run, its sun torque with one more block."""
    whole = block(0, "f64", NULL_HZ["sun"] + 800.0 + live(1000))
    return made(Bench(raw={TORQUE: [whole, extra]}))


def test_a_repeated_block_is_a_warning_and_changes_nothing() -> None:
    recording = with_extra_block(block(100, "f64", NULL_HZ["sun"] + 800.0 + live(50)))
    assert [f.code for f in recording.findings] == [Code.SAMPLES_DUPLICATE]
    np.testing.assert_allclose(recording.samples["torque_sun"] - live(1000) / SPAN_HZ["sun"] * NOMINAL["sun"], 0.8)


def test_samples_given_twice_with_different_values_are_trusted_from_neither() -> None:
    recording = with_extra_block(block(100, "f64", np.full(50, 9_000.0)))
    assert [f.code for f in recording.findings] == [Code.SAMPLES_CONFLICT]
    missing = np.flatnonzero(np.isnan(recording.samples["torque_sun"].to_numpy()))
    assert missing.tolist() == list(range(100, 150))


@pytest.mark.parametrize("index", [2**63, 10**12])
def test_a_block_with_an_impossible_index_is_left_out(index: int) -> None:
    recording = with_extra_block(block(index, "f64", np.full(50, 9_000.0)))
    assert recording.samples.height == 1000
    assert {f.code for f in recording.findings} <= {Code.SAMPLES_ASTRAY, Code.MESSAGE_MALFORMED}
    assert recording.findings


def test_values_that_are_no_numbers_are_missing() -> None:
    recording = with_extra_block(block(1000, "f64", np.array([np.nan, np.inf, 10_000.0])))
    assert Code.NOT_FINITE in {f.code for f in recording.findings}
    assert np.flatnonzero(np.isnan(recording.samples["torque_sun"].to_numpy())).tolist() == [1000, 1001]


def test_a_block_that_is_no_message_is_counted_and_the_others_are_kept() -> None:
    recording = with_extra_block(b"\x0b\x0c")
    assert [f.code for f in recording.findings] == [Code.MESSAGE_MALFORMED]
    assert "1 of 2 blocks" in recording.findings[0].message


def test_flags_of_the_recorder_become_findings_and_blemishes() -> None:
    recording = made(Bench(flags={TORQUE: {3: 1}, "/daq/encoder_ring/count": {5: 2, 6: 4}}))
    assert {f.code for f in recording.findings} == {Code.OVERRUN, Code.RESTART, Code.SATURATED}
    assert {(b.code, b.start, b.stop) for b in recording.blemishes} == {
        (Code.OVERRUN, 300, 400),
        (Code.RESTART, 500, 600),
        (Code.SATURATED, 600, 700),
    }


def test_lines_are_kept_as_masks_and_unknown_where_not_recorded() -> None:
    recording = made(Bench(lines=(300, 400), drop={"/daq/lines": (800, 900)}))
    lines = recording.samples["lines"]
    assert lines.null_count() == 100
    assert lines.drop_nulls().sum() == 100
    assert made(Bench()).samples["lines"].null_count() == 1000


@pytest.mark.parametrize(("slip", "expected"), [(0, False), (40, True), (-40, True)])
def test_index_pulses_prove_the_count(slip: int, expected: bool) -> None:
    for bits in (16, 32):
        recording = made(Bench(1.0, 10_000.0, with_index=True, index_slip=slip, bits=bits))
        assert (Code.ENCODER_SLIPPED in {f.code for f in recording.findings}) is expected


def test_clock_marks_rule_over_the_start_and_are_compared_with_it() -> None:
    start_ns = 1_745_395_200_250_000_000
    agreed = made(Bench(marks=[(0, start_ns), (500, start_ns + 1_000_100_000)]))
    assert agreed.findings == ()
    assert (agreed.time_of(750) - agreed.run.started_at).total_seconds() == pytest.approx(1.5001, abs=1e-6)
    off = made(Bench(marks=[(0, start_ns + 90 * 10**9)]))
    assert [f.code for f in off.findings] == [Code.CLOCK_DISAGREES]


def test_a_channel_that_ends_early_is_told(tmp_path: Path) -> None:
    recording = made(Bench(drop={TORQUE: (700, 1000)}))
    assert [(f.code, f.where) for f in recording.findings] == [(Code.SAMPLES_RAGGED, TORQUE)]
    assert recording.samples.height == 1000


def test_no_samples_of_any_torque_are_refused() -> None:
    with pytest.raises(UnusableRecordingError, match="0 messages give no samples"):
        made(Bench(drop=dict.fromkeys((TORQUE, TORQUE.replace("sun", "ring")), (0, 1000))))


def test_no_samples_of_one_torque_leave_the_others() -> None:
    recording = made(Bench(drop={TORQUE: (0, 1000)}))
    assert dict(recording.lacking) == {"torque_sun": "not recorded"}
    assert np.isnan(recording.samples["torque_sun"].to_numpy()).all()
    whole = made(Bench()).samples
    assert recording.samples.drop("torque_sun").equals(whole.drop("torque_sun"))
