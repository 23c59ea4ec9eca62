"""Recorded time columns become even clocks: each fault planted, found, told with its number, and undone."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pmg.pipeline.importers.clocks.clock import Clock, even_stretches
from pmg.pipeline.recording.findings import Code, Findings, Severity
from pmg.sim.errors import RecordingError

Array = npt.NDArray[np.float64]
N = 6000
RATE = 1000.0
EVEN = np.arange(N) / RATE


def moved(time: Array) -> dict[str, Array]:
    """What a machine does at these times."""
    return {
        "speed": np.sin(2 * np.pi * 3 * time) + 0.3 * np.sin(2 * np.pi * 11 * time + 1.0),
        "torque": np.cos(2 * np.pi * 5 * time),
    }


def noisy(signals: dict[str, Array], rng: np.random.Generator, size: float = 0.003) -> dict[str, Array]:
    return {name: values + size * rng.normal(size=len(values)) for name, values in signals.items()}


def read(time: npt.ArrayLike, rate: float | None = RATE, signals: dict[str, Array] | None = None) -> tuple[Clock, str]:
    """The clock, and codes and messages of what was found."""
    findings = Findings("a.csv")
    column = np.asarray(time, dtype=np.float64)
    clock = even_stretches(column, rate, moved(column) if signals is None else signals, "a.csv: time", findings)
    for stretch in clock.stretches:
        assert {len(values) for values in stretch.channels.values()} <= {len(stretch.time)}
        assert stretch.start == stretch.time[0]
    return clock, "\n".join(f"{one.code} {one.severity} {one.message}" for one in findings.listed())


def rows(clock: Clock) -> list[tuple[int, int]]:
    return [(stretch.rows.start, stretch.rows.stop) for stretch in clock.stretches]


# --- even clocks ---------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(
    rate=st.sampled_from([0.5, 1.0, 50.0, 1000.0, 3000.0, 12_800.0, 44_100.0]),
    start=st.floats(-1e4, 1e4),
    count=st.integers(2, 400),
    stated=st.booleans(),
)
def test_an_even_clock_comes_through_bit_by_bit(rate: float, start: float, count: int, stated: bool) -> None:
    time = start + np.arange(count) / rate
    signals = {"a": np.sqrt(np.arange(count)), "n": np.arange(count)}
    clock, told = read(time, rate if stated else None, signals)
    assert told == ""
    assert clock.rate_hz == pytest.approx(rate, rel=1e-9)
    (stretch,) = clock.stretches
    assert rows(clock) == [(0, count)]
    assert stretch.time.tobytes() == time.tobytes()
    assert all(stretch.channels[name].tobytes() == values.tobytes() for name, values in signals.items())
    assert all(stretch.channels[name].dtype == values.dtype for name, values in signals.items())


def test_a_rate_near_a_whole_number_is_that_number() -> None:
    assert read(EVEN * (1 + 1e-7), None)[0].rate_hz == RATE
    assert read(EVEN * (1 + 1e-5), None)[0].rate_hz == pytest.approx(RATE / (1 + 1e-5), rel=1e-8)


# --- wrapped seconds -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("period", "rate"),
    [(60.0, 20.0), (3600.0, 1.0), (86400.0, 0.05), (65.536, 50.0), (2**32 * 1e-6, 1.0), (7.3, 1000.0), (0.065536, 1e4)],
)
def test_wrapped_seconds_are_counted_on(period: float, rate: float) -> None:
    time = 0.3 * period + np.arange(int(2.5 * period * rate)) / rate
    clock, told = read(time % period, rate)
    assert f"begins anew 2 times, each after {period:.9g} s" in told
    assert told.startswith(Code.CLOCK_JUMP)
    assert rows(clock) == [(0, len(time))]
    np.testing.assert_allclose(clock.stretches[0].time, time, atol=1e-6 * period)


def test_a_signed_counter_begins_anew_below_zero() -> None:
    time = np.arange(4000) / 50.0
    clock, told = read((time + 32.768) % 65.536 - 32.768, 50.0)
    assert "begins anew 1 time, each after 65.536 s" in told
    assert len(clock.stretches) == 1


def test_a_pause_over_a_wrap_is_a_pause() -> None:
    starts = [0.0, 57.0, 110.0, 125.0]
    clock, told = read(np.concatenate([EVEN + start for start in starts]) % 60.0)
    assert "begins anew 2 times, each after 60 s" in told
    assert [stretch.start for stretch in clock.stretches] == pytest.approx(starts, abs=1e-9)


@pytest.mark.parametrize(
    ("time", "row"),
    [
        (np.concatenate((EVEN, EVEN[:100])), N + 1),
        (np.concatenate((EVEN[:100], EVEN[50:])), 101),
        (np.concatenate((EVEN[:100], EVEN[[101, 100]], EVEN[102:])), 102),
        (100.0 + EVEN * 10 % 59.0, 5901),
    ],
    ids=["another test", "a repeated block", "swapped rows", "from hundred to hundred"],
)
def test_rows_out_of_order_are_refused_with_their_row(time: Array, row: int) -> None:
    with pytest.raises(RecordingError, match=rf"row {row}: the time goes from .* back to .*constant period\. Rows"):
        read(time, None)


# --- repeated rows -------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(again=st.lists(st.integers(0, N - 1), min_size=1, max_size=20))
def test_repeated_rows_are_dropped(again: list[int]) -> None:
    order = np.sort(np.concatenate((np.arange(N), again)))
    clock, told = read(EVEN[order])
    assert f"{len(again)} row" in told
    assert told.startswith(Code.SAMPLES_DUPLICATE)
    assert clock.stretches[0].time.tobytes() == EVEN.tobytes()
    assert clock.stretches[0].channels["speed"].tobytes() == moved(EVEN)["speed"].tobytes()


def test_every_row_twice() -> None:
    clock, told = read(np.repeat(EVEN, 2), None)
    assert f"{N} rows of {2 * N}" in told
    assert clock.rate_hz == RATE


def test_the_same_time_with_other_values_is_refused() -> None:
    order = np.sort(np.append(np.arange(N), 70))
    signals = moved(EVEN[order])
    signals["speed"][71] += 1.0
    with pytest.raises(RecordingError, match=r"row 72: the time 0\.07 s again, with other values"):
        read(EVEN[order], RATE, signals)


@pytest.mark.parametrize(
    ("rate", "tick"), [(2000.0, 1e-3), (3000.0, 1e-4), (1001.0, 1e-3), (10_000.0, 1e-2), (1500.0, 1e-3)]
)
@pytest.mark.parametrize("stated", [True, False])
def test_coarse_times_are_even_samples(rate: float, tick: float, stated: bool) -> None:
    true = np.arange(N) / rate
    clock, told = read(np.floor(true / tick + 1e-6) * tick, rate if stated else None, moved(true))
    assert f"multiples of {tick:.3g} s" in told
    assert told.startswith(Code.CLOCK_UNEVEN)
    assert clock.rate_hz == pytest.approx(rate, rel=max(2e-5, tick * rate / N))
    assert rows(clock) == [(0, N)]
    np.testing.assert_array_equal(clock.stretches[0].channels["speed"], moved(true)["speed"])
    np.testing.assert_allclose(clock.stretches[0].time - true, -tick / 2, atol=tick)


def test_coarse_times_of_a_machine_at_rest_are_no_repeated_rows() -> None:
    true = np.arange(N) / 2000.0
    clock, told = read(np.floor(true * 1000.0 + 1e-6) / 1000.0, 2000.0, {"speed": np.zeros(N)})
    assert "duplicate" not in told
    assert rows(clock) == [(0, N)]


# --- jitter --------------------------------------------------------------------------------------------


@settings(max_examples=8)
@given(size=st.floats(0.1, 0.8), seed=st.integers(0, 99))
def test_stamps_that_jitter_leave_samples_even(size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    signals = noisy(moved(EVEN), rng)
    clock, told = read(EVEN + size * rng.normal(size=N) / RATE, RATE, signals)
    assert "samples are even, and the times were stamped late" in told
    assert clock.rate_hz == RATE
    assert clock.stretches[0].channels["speed"] is signals["speed"] or np.array_equal(
        clock.stretches[0].channels["speed"], signals["speed"]
    )
    np.testing.assert_allclose(clock.stretches[0].time, EVEN, atol=5 * size / RATE / np.sqrt(N))


@settings(max_examples=8)
@given(size=st.floats(0.1, 0.4), seed=st.integers(0, 99))
def test_samples_taken_at_scattered_times_are_resampled(size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.sort(EVEN + size * np.clip(rng.normal(size=N), -3, 3) / RATE)
    clock, told = read(time, RATE, noisy(moved(time), rng))
    assert "samples were taken at these times" in told
    (stretch,) = clock.stretches
    truth = moved(stretch.time)
    inner = slice(10, -10)
    for name, values in stretch.channels.items():
        assert np.std(values[inner] - truth[name][inner]) < 0.006
        assert np.std(noisy(moved(time), rng)[name][inner] - moved(EVEN)[name][inner]) > 0.5 * size * 0.02


def test_arrival_times_and_a_loop_that_sleeps_are_told_apart(rng: np.random.Generator) -> None:
    arrival = np.maximum.accumulate(EVEN + rng.exponential(0.5, N) / RATE)
    assert "samples are even" in read(arrival, RATE, noisy(moved(EVEN), rng))[1]
    loop = np.cumsum(1.0 + 0.3 * rng.uniform(-1.0, 1.0, N)) / RATE
    clock, told = read(loop, None, noisy(moved(loop), rng))
    assert "samples were taken at these times" in told
    speed = clock.stretches[0].channels["speed"] - moved(clock.stretches[0].time)["speed"]
    assert np.std(speed[10:-10]) < 0.006


@pytest.mark.parametrize("signals", [{}, {"a": np.zeros(N)}, {"a": np.random.default_rng(1).normal(size=N)}])
def test_signals_that_tell_nothing_leave_samples_even_with_a_warning(
    signals: dict[str, Array], rng: np.random.Generator
) -> None:
    clock, told = read(EVEN + 0.5 * rng.normal(size=N) / RATE, RATE, signals)
    assert f"{Code.CLOCK_UNEVEN} {Severity.WARNING}" in told
    assert "do not tell" in told
    assert len(clock.stretches[0].time) == N


def test_the_size_of_jitter_is_told(rng: np.random.Generator) -> None:
    jitter = 0.5 * rng.uniform(-1.0, 1.0, N)
    told = read(EVEN + jitter / RATE, RATE, noisy(moved(EVEN), rng))[1]
    assert f"{np.std(jitter):.2g}" in told
    assert " at most, about 1000 Hz" in told


# --- drift ---------------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(ppm=st.floats(50.0, 9_900.0), sign=st.sampled_from([-1.0, 1.0]))
def test_a_drifting_clock_is_used_and_told(ppm: float, sign: float) -> None:
    drift = sign * ppm * 1e-6
    clock, told = read(EVEN / (1.0 + drift))
    assert clock.rate_hz == pytest.approx(RATE * (1.0 + drift), rel=1e-9)
    assert f"{sign * ppm:+.0f} ppm" in told
    assert told.startswith(Code.CLOCK_DRIFT)


@pytest.mark.parametrize("factor", [1.02, 0.98, 1e-3, 1e3, 60.0])
def test_another_rate_is_refused(factor: float) -> None:
    with pytest.raises(RecordingError, match=r"samples per second; expected 1000 within 1%\. Correct rate or unit"):
        read(EVEN * factor)


# --- missing samples and pauses ------------------------------------------------------------------------


@settings(max_examples=20)
@given(
    gaps=st.lists(st.tuples(st.integers(1, 58), st.integers(1, 4)), min_size=1, max_size=8, unique_by=lambda g: g[0])
)
def test_missing_samples_are_filled(gaps: list[tuple[int, int]]) -> None:
    kept = np.ones(N, dtype=bool)
    for place, lost in gaps:
        kept[100 * place : 100 * place + lost] = False
    clock, told = read(EVEN[kept])
    total = sum(lost for _, lost in gaps)
    assert f"{total} sample" in told
    assert f"{len(gaps)} place" in told
    assert f"{total / N:.2%} of all" in told
    assert len(clock.stretches) == 1
    np.testing.assert_allclose(clock.stretches[0].channels["speed"], moved(EVEN)["speed"], atol=2e-5)
    np.testing.assert_array_equal(clock.stretches[0].channels["speed"][kept], moved(EVEN)["speed"][kept])


def test_samples_missing_side_by_side_are_not_filled() -> None:
    kept = np.ones(N, dtype=bool)
    kept[[*range(3000, 3004), *range(3005, 3009)]] = False
    clock, told = read(EVEN[kept])
    assert rows(clock) == [(0, 3000), (3000, 3001), (3001, N - 8)]
    assert told.count("a gap near others") == 2


@settings(max_examples=15)
@given(length=st.floats(5.6e-3, 1e5), row=st.integers(400, N - 400))
def test_a_pause_begins_a_new_stretch(length: float, row: int) -> None:
    time = EVEN.copy()
    time[row:] += length - 1.0 / RATE
    clock, told = read(time)
    assert rows(clock) == [(0, row), (row, N)]
    assert f"a pause of {time[row] - time[row - 1]:.6g} s" in told
    assert f"(row {row})" in told
    assert clock.stretches[1].start == time[row]
    assert clock.stretches[1].channels["speed"].tobytes() == moved(time[row:])["speed"].tobytes()
    assert "tail" not in told


def test_a_short_last_stretch_may_be_the_tail_of_the_next_test() -> None:
    time = np.where(np.arange(N) < 5900, EVEN, EVEN + 30.0)
    clock, told = read(time)
    assert rows(clock) == [(0, 5900), (5900, N)]
    assert "has 100 of 6000 samples; it may be the tail of the next test" in told


def test_rows_without_a_time_are_left_out() -> None:
    time = EVEN.copy()
    time[[5, 6, 99]] = np.nan, np.inf, np.nan
    clock, told = read(time, RATE, moved(EVEN))
    assert "3 rows of 6000 without a time, the first in row 6" in told
    assert rows(clock) == [(0, N)]
    np.testing.assert_allclose(clock.stretches[0].channels["speed"], moved(EVEN)["speed"], atol=2e-5)


# --- faults together -----------------------------------------------------------------------------------


def test_lost_samples_are_told_from_jitter(rng: np.random.Generator) -> None:
    kept = np.ones(N, dtype=bool)
    kept[[400, 1500, 1501, 3000, 3001, 3002, 3003, 4500]] = False
    clock, told = read((EVEN + 0.3 * rng.normal(size=N) / RATE)[kept], RATE, noisy(moved(EVEN[kept]), rng))
    assert "8 samples missing in 4 places" in told
    assert "samples are even" in told
    np.testing.assert_allclose(clock.stretches[0].time, EVEN, atol=1e-4)
    # where jitter hides the row, a loss is placed within a few samples of it
    assert np.std(clock.stretches[0].channels["speed"] - moved(EVEN)["speed"]) < 0.008


def test_all_at_once(rng: np.random.Generator) -> None:
    true = np.where(np.arange(N) < 4000, EVEN, EVEN + 30.0) * (1.0 + 1e-3) + 57.0
    time = (true + 0.2 * rng.normal(size=N) / RATE) % 60.0
    signals = noisy(moved(true), rng)
    order = np.sort(np.append(np.arange(N), [100, 2000]))
    time, signals = time[order], {name: values[order] for name, values in signals.items()}
    time[50] = np.nan
    clock, told = read(time, None, signals)
    for text in (
        "without a time",
        "2 rows of",
        "begins anew 1 time, each after 60 s",
        "samples are even",
        "a pause of",
    ):
        assert text in told
    assert [len(stretch.time) for stretch in clock.stretches] == [4000, 2000]
    assert clock.rate_hz == pytest.approx(RATE / (1.0 + 1e-3), rel=1e-5)


def test_packets_with_a_stamp_of_their_own_are_even_samples(rng: np.random.Generator) -> None:
    late = np.repeat(rng.exponential(3.0, N // 10), 10) / RATE
    time = np.maximum.accumulate(np.floor(np.arange(N) / 10) / 100 + late)
    clock, told = read(time, RATE, noisy(moved(EVEN), rng))
    assert "samples are even" in told
    assert rows(clock) == [(0, N)]


# --- damage --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("time", "text"),
    [
        (np.zeros(10), "the same time throughout"),
        (np.full(10, np.nan), "0 rows with a time"),
        (np.zeros(0), "0 rows with a time"),
        (np.zeros(1), "1 row with a time"),
        (np.random.default_rng(3).permutation(EVEN), "back to|scatter|pauses"),
        (np.random.default_rng(3).uniform(size=N), "back to|scatter|pauses"),
        (np.cumsum(np.random.default_rng(3).exponential(1e-3, N)), "scatter by"),
        (-EVEN, "back to"),
    ],
)
def test_what_is_no_clock_is_refused(time: Array, text: str) -> None:
    noise = np.random.default_rng(4).normal(size=len(time))
    with pytest.raises(RecordingError, match=text):
        read(time, None, {"a": noise})


def test_channels_of_another_length_are_refused() -> None:
    with pytest.raises(RecordingError, match=r"6000 times beside other lengths \(a: 3\)"):
        read(EVEN, RATE, {"a": np.zeros(3)})


def test_a_value_that_is_no_number_stays_unless_it_is_interpolated_from() -> None:
    signals = moved(EVEN)
    signals["speed"][7] = np.nan
    assert np.isnan(read(EVEN, RATE, signals)[0].stretches[0].channels["speed"][7])
    kept = np.arange(N) != 500
    with pytest.raises(RecordingError, match="speed: 1 values are no numbers, the first in row 8"):
        read(EVEN[kept], RATE, {name: values[kept] for name, values in signals.items()})


@settings(max_examples=60)
@given(
    time=st.lists(st.floats(-1e3, 1e3) | st.sampled_from([0.0, 1.0, 2.0, np.nan, np.inf]), max_size=40),
    rate=st.none() | st.sampled_from([1.0, 1000.0]),
)
def test_any_times_are_read_or_refused(time: list[float], rate: float | None) -> None:
    with suppress(RecordingError):
        clock, _ = read(np.array(time, dtype=np.float64), rate, {"a": np.arange(len(time), dtype=np.float64)})
        assert clock.stretches
