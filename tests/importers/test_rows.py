"""Rows find their place in time, by a column or by a counter that wraps, and what cannot be is refused."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.importers.channel_map import Timing
from pmg.pipeline.importers.rows import Rows
from pmg.pipeline.importers.source import Block, Wanted
from pmg.pipeline.recording.findings import Code, Findings
from pmg.sim.errors import RecordingError

Array = npt.NDArray[np.float64]
TIME = Wanted("t")
TIMER = 40_000_000
WRAP_S = 2**32 / TIMER


def placed(column: npt.ArrayLike, timing: Timing | None = None, parts: int = 1) -> tuple[npt.NDArray[np.int64], Rows]:
    values = np.asarray(column)
    rows = Rows(timing or Timing(None, TIME), "a.csv", "line", Findings("a.csv"), timing.rate_hz if timing else None)
    places = np.arange(len(values)) + 2
    index = [
        rows.of(Block(place, {TIME: part}))
        for part, place in zip(np.array_split(values, parts), np.array_split(places, parts), strict=True)
        if len(part)
    ]
    rows.finish()
    return np.concatenate(index), rows


def codes(rows: Rows) -> list[Code]:
    return [finding.code for finding in rows.findings.listed()]


# --- a time column -------------------------------------------------------------------------------------


@given(
    rate=st.sampled_from([1.0, 50.0, 500.0, 1000.0, 3000.0, 12_800.0]),
    start=st.floats(-1e5, 1e5),
    parts=st.integers(1, 5),
)
def test_evenly_spaced_times_are_consecutive_samples(rate: float, start: float, parts: int) -> None:
    index, rows = placed(start + np.arange(600) / rate, parts=parts)
    assert index.tolist() == list(range(600))
    assert rows.rate_hz == pytest.approx(rate, rel=1e-5)
    assert codes(rows) == []


def test_rounded_times_give_the_rate_and_no_false_gap() -> None:
    index, rows = placed(np.round(np.arange(60_000) / 3000.0, 4))
    assert index[-1] == 59_999
    assert rows.rate_hz == pytest.approx(3000.0, rel=1e-6)
    assert codes(rows) == []


@given(gaps=st.lists(st.tuples(st.integers(1, 199), st.integers(2, 5000)), max_size=4, unique_by=lambda g: g[0]))
def test_pauses_become_gaps_of_their_length(gaps: list[tuple[int, int]]) -> None:
    steps = np.ones(200, dtype=np.int64)
    steps[0] = 0
    for at, width in gaps:
        steps[at] = width
    expected = np.cumsum(steps)
    index, rows = placed(expected / 500.0, Timing(500.0, TIME), parts=3)
    assert index.tolist() == expected.tolist()
    told = [f for f in rows.findings.listed() if f.code is Code.SAMPLES_GAP]
    assert sorted((f.sample_range or (0, 0))[1] - (f.sample_range or (0, 0))[0] for f in told) == sorted(
        width - 1 for _, width in gaps
    )


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({50: -0.2}, "step in time"),
        ({50: 0.0}, "step in time"),
        ({50: 0.003}, "whole samples"),
        ({0: np.inf}, None),
    ],
)
def test_times_that_do_not_go_on_by_whole_samples_are_refused(change: dict[int, float], expected: str | None) -> None:
    time = np.arange(100) / 500.0
    for at, value in change.items():
        time[at:] = time[at:] - time[at] + time[at - 1] + value if at else time[at:]
        if not at:
            time[0] = value
    if expected is None:
        index, rows = placed(time)
        assert index[0] == -1
        assert codes(rows) == [Code.NOT_FINITE]
        return
    with pytest.raises(RecordingError, match=f"line 52, time.*{expected}"):
        placed(time)


def test_times_of_the_computer_are_refused_with_what_to_do() -> None:
    time = np.floor(np.arange(1000) / 500.0 / 0.0156) * 0.0156
    with pytest.raises(RecordingError, match="rate_Hz"):
        placed(time, Timing(500.0, TIME))


def test_a_rate_that_the_column_contradicts_is_refused_and_a_small_drift_is_told() -> None:
    with pytest.raises(RecordingError, match=r"expected 500\. Correct rate_Hz"):
        placed(np.arange(5000) / 490.0, Timing(500.0, TIME))
    _, rows = placed(np.arange(50_000) / 500.0 * (1 + 50e-6), Timing(500.0, TIME))
    assert codes(rows) == [Code.TIMEBASE_DRIFT]
    assert "-50.0 ppm" in rows.findings.listed()[0].message


# --- a counter that wraps ------------------------------------------------------------------------------


def ticks(bits: int = 32, rate: float | None = None, hertz: float = TIMER) -> Timing:
    return Timing(rate, TIME, 1.0 / hertz, bits)


def test_a_32_bit_timer_at_40_mhz_wraps_after_107_s_and_time_goes_on() -> None:
    assert pytest.approx(107.374, abs=1e-3) == WRAP_S
    samples = np.arange(0, int(3.5 * WRAP_S * 50))
    counter = (samples * (TIMER // 50)) % 2**32
    for column in (counter.astype(np.uint32), counter.astype(np.float64), counter.astype(np.uint32).view(np.int32)):
        index, rows = placed(column, ticks(), parts=7)
        np.testing.assert_array_equal(index, samples)
        assert (rows.rate_hz, codes(rows)) == (50.0, [])


@given(start=st.integers(0, 2**32 - 1), step=st.integers(1, 2**30), parts=st.integers(1, 4))
def test_where_the_counter_begins_does_not_matter(start: int, step: int, parts: int) -> None:
    counter = (start + step * np.arange(40, dtype=np.int64)) % 2**32
    index, _ = placed(counter, ticks(rate=TIMER / step), parts=parts)
    assert index.tolist() == list(range(40))


def test_a_pause_that_spans_a_wrap_keeps_its_length_up_to_half_a_wrap() -> None:
    at = np.concatenate((np.arange(100), np.arange(100) + 2600))
    index, rows = placed((at * (TIMER // 50)) % 2**32, ticks())
    np.testing.assert_array_equal(index, at)
    assert codes(rows) == [Code.SAMPLES_GAP]
    at[100:] += 200
    with pytest.raises(RecordingError, match=r"line 102, time: the counter goes.*53\.687"):
        placed((at * (TIMER // 50)) % 2**32, ticks())


@pytest.mark.parametrize("value", [0.5, 2.0**32, -(2.0**31) - 1])
def test_a_tick_that_is_no_count_of_that_width_is_refused(value: float) -> None:
    column = np.arange(10) * 80_000.0
    column[4] = value
    with pytest.raises(RecordingError, match=r"line 6, time.*32 bits"):
        placed(column, ticks())
