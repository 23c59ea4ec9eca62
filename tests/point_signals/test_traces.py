"""The signals of a window: where its borders lie, what the filter and the spectrum show, what a gap leaves."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pmg.pipeline.point_signals.spectrum import MOST, amplitude_spectrum
from pmg.pipeline.point_signals.traces import (
    FEWEST_SHOWN,
    MOST_BINS,
    MOST_FILTERED,
    PLENTY,
    _binned,
    bins_for,
    speed_signals,
    stretch_of,
    torque_signals,
)
from pmg.pipeline.windows.reduce import CUTOFF_HZ, end_to_end_speed, low_pass
from pmg.sim.signals import REVOLUTION, RPM, SPEED_SUN, TORQUE_SUN, Array

RATE = 1000.0
COUNT = REVOLUTION / 5120
SPANS = st.tuples(st.integers(0, 900), st.integers(2, 3000), st.integers(0, 900))
"""Rows before a window, of it, after it."""


@given(
    cycles=st.floats(4.0, 2200.0),
    amplitude=st.floats(1e-3, 10.0),
    phase=st.floats(0.0, REVOLUTION),
    mean=st.floats(-5.0, 5.0),
)
@settings(max_examples=60)
def test_a_sine_shows_its_amplitude_at_its_frequency(
    cycles: float, amplitude: float, phase: float, mean: float
) -> None:
    n = 5000
    t = np.arange(n) / RATE
    hz = cycles * RATE / n
    found = amplitude_spectrum(mean + amplitude * np.sin(REVOLUTION * hz * t + phase), RATE)
    assert found is not None
    top = int(found.amplitude.argmax())
    assert found.amplitude[top] == pytest.approx(amplitude, rel=3e-3)  # its mirror image at the lowest adds to it
    assert abs(found.frequency[top] - hz) < 0.02 * found.resolution
    assert len(found.frequency) <= MOST
    assert (np.diff(found.frequency) > 0.0).all()
    assert found.frequency[-1] < RATE / 2.0


@given(st.integers(16, 700), st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_a_spectrum_of_any_length_rises_in_frequency(n: int, seed: int) -> None:
    found = amplitude_spectrum(np.random.default_rng(seed).normal(size=n), RATE)
    assert found is not None
    assert len(found.frequency) == len(found.amplitude) <= MOST
    assert (np.diff(found.frequency) > 0.0).all()
    assert (found.amplitude > 0.0).all()
    assert found.frequency[0] >= 1.5 * found.resolution
    assert found.frequency[-1] < RATE / 2.0


def test_two_sines_show_both_amplitudes() -> None:
    t = np.arange(5000) / RATE
    found = amplitude_spectrum(0.3 * np.sin(REVOLUTION * 13.0 * t) + 0.01 * np.sin(REVOLUTION * 170.0 * t), RATE)
    assert found is not None
    for hz, amplitude in ((13.0, 0.3), (170.0, 0.01)):
        near = np.abs(found.frequency - hz) < 0.1
        assert found.amplitude[near].max() == pytest.approx(amplitude, rel=2e-3)


@given(SPANS, st.integers(1, 400))
@settings(max_examples=100)
def test_no_bin_lies_on_both_sides_of_a_border(spans: tuple[int, int, int], most: int) -> None:
    before, inside, after = spans
    stretch = stretch_of(before, before + inside, before + inside + after, RATE)
    bins, edges = _binned(stretch, most)
    assert len(edges) == sum(bins.counts) + 1 == len(bins.middles) + 1
    assert sum(bins.counts) <= max(most, 3)
    assert (np.diff(edges) > 0).all()
    assert edges[bins.within.start] == before
    assert edges[bins.within.stop] == before + inside
    assert (edges[0], edges[-1]) == (stretch.start, stretch.end)
    assert bins.edges[1:3] == (0.0, inside / RATE)
    inner = bins.middles[bins.within]
    assert ((inner > 0.0) & (inner < inside / RATE)).all()
    assert all(a <= b for a, b in pairwise(bins.edges))


@given(SPANS, st.floats(-50.0, 50.0))
@settings(max_examples=60)
def test_a_step_outside_of_the_window_stays_outside(spans: tuple[int, int, int], step: float) -> None:
    before, inside, after = spans
    torque = np.r_[np.full(before, step), np.zeros(inside), np.full(after, step)]
    made = torque_signals(TORQUE_SUN, torque, stretch_of(before, before + inside, len(torque), RATE))
    shown = np.ones(len(made.low), dtype=bool)
    shown[made.bins.within] = False
    assert not made.low[~shown].any()
    assert not made.high[~shown].any()
    assert not made.filtered.any()
    assert (made.low[shown] == step).all()
    assert (made.high[shown] == step).all()
    angle = np.cumsum(np.r_[np.full(before, step), np.full(inside, 0.01), np.full(after, step)])
    speed = speed_signals(SPEED_SUN, angle, stretch_of(before, before + inside, len(torque), RATE), COUNT)
    assert speed.low[speed.bins.within] == pytest.approx(0.01 * RATE, abs=1e-6)
    assert speed.filtered == pytest.approx(0.01 * RATE, abs=1e-6)


def test_the_envelope_holds_every_sample_and_nothing_more(rng: np.random.Generator) -> None:
    torque = rng.normal(size=7000)
    stretch = stretch_of(1000, 6000, 7000, RATE)
    made = torque_signals(TORQUE_SUN, torque, stretch)
    _, edges = _binned(stretch)
    parts = [torque[a:b] for a, b in pairwise(edges)]
    assert len(parts) == MOST_BINS
    assert made.low.tolist() == [part.min() for part in parts]
    assert made.high.tolist() == [part.max() for part in parts]


def test_the_filtered_signal_is_that_of_the_evaluation(rng: np.random.Generator) -> None:
    torque = 0.5 + rng.normal(size=7000)
    made = torque_signals(TORQUE_SUN, torque, stretch_of(1000, 6000, 7000, RATE))
    assert len(made.filtered) == MOST_FILTERED
    times = np.linspace(*made.span, MOST_FILTERED)
    whole = low_pass(torque[1000:6000], RATE, CUTOFF_HZ)
    assert made.filtered == pytest.approx(np.interp(times, np.arange(5000) / RATE, whole), abs=1e-3)
    assert made.filtered[0] == whole[0]
    assert made.filtered[-1] == whole[-1]


@pytest.mark.parametrize("row", [0, 2500, 4999])
def test_a_gap_leaves_the_envelope_and_takes_filter_and_spectrum(row: int, rng: np.random.Generator) -> None:
    torque, angle = rng.normal(size=7000), np.arange(7000, dtype=np.float64) * 0.01
    torque[1000 + row] = angle[1000 + row] = np.nan
    stretch = stretch_of(1000, 6000, 7000, RATE)
    made, speed = torque_signals(TORQUE_SUN, torque, stretch), speed_signals(SPEED_SUN, angle, stretch, COUNT)
    assert np.isfinite(made.low).all()
    assert "gap" in made.remark
    assert made.spectrum is None
    assert not len(made.filtered)
    assert speed.low == pytest.approx(10.0)
    assert not speed.remark
    torque[1000:2000] = angle[1000:2000] = np.nan
    made, speed = torque_signals(TORQUE_SUN, torque, stretch), speed_signals(SPEED_SUN, angle, stretch, COUNT)
    inner = made.bins.middles[made.bins.within]
    assert (np.isnan(made.low[made.bins.within]) == (inner < 1.0)).all()
    assert "gap" in speed.remark
    assert np.isnan(speed.low).any()
    assert speed.low[np.isfinite(speed.low)] == pytest.approx(10.0)


def counted(speed: float, rows: int) -> Array:
    """Angle of a shaft that turns at constant speed, in whole counts [rad]."""
    return np.asarray(np.floor(speed * np.arange(rows) / RATE / COUNT + 0.37) * COUNT, dtype=np.float64)


@given(st.floats(-2000.0, 2000.0))
@settings(max_examples=60)
def test_a_constant_speed_is_shown_to_one_count_over_a_bin(speed_rpm: float) -> None:
    truth = speed_rpm * RPM
    angle = counted(truth, 6500)
    made = speed_signals(SPEED_SUN, angle, stretch_of(750, 5750, 6500, RATE), COUNT)
    inside = made.low[made.bins.within]
    assert (np.abs(inside - truth) <= 1.05 * made.resolution).all()
    assert made.mean == end_to_end_speed(angle[750:5750], RATE)
    assert abs(made.mean - truth) <= COUNT / (4999 / RATE)
    assert made.u < made.expanded < 2.0 * made.u
    assert np.isfinite(made.filtered).all()
    assert np.mean(inside) == pytest.approx(made.mean, abs=0.1 * made.resolution)


def test_the_step_of_a_speed_follows_the_count() -> None:
    stretch = stretch_of(0, 5000, 5000, RATE)
    fast, slow, still = (speed_signals(SPEED_SUN, counted(w, 5000), stretch, COUNT) for w in (100.0, 5.0, 0.0))
    assert fast.bins.counts == (0, MOST_BINS, 0)
    assert 20 < slow.bins.counts[1] < MOST_BINS
    assert slow.resolution <= 0.0055 * 5.0
    assert still.bins.counts[1] == 20
    assert not still.low.any()
    unknown = speed_signals(SPEED_SUN, counted(5.0, 5000), stretch, math.nan)
    assert math.isnan(unknown.resolution)
    assert np.isfinite(unknown.low).all()


@pytest.mark.parametrize(("first", "stop", "rows"), [(0, 1, 1), (-5, 3, 10), (8, 20, 10), (0, 2, 2), (3, 4, 9)])
def test_a_window_of_hardly_any_samples_is_no_crash(first: int, stop: int, rows: int) -> None:
    stretch = stretch_of(first, stop, rows, RATE)
    assert 0 <= stretch.start <= stretch.first < stretch.stop <= stretch.end <= rows
    made = torque_signals(TORQUE_SUN, np.arange(rows, dtype=float), stretch)
    assert made.spectrum is None
    assert len(made.filtered) == stretch.stop - stretch.first
    speed_signals(SPEED_SUN, np.arange(rows, dtype=float), stretch, COUNT)


def test_very_many_points_share_the_bins_of_a_page() -> None:
    assert bins_for(1) == bins_for(PLENTY) == MOST_BINS
    assert bins_for(2 * PLENTY) == MOST_BINS // 2
    assert bins_for(100 * PLENTY) == FEWEST_SHOWN
    stretch = stretch_of(1000, 6000, 7000, RATE, most=bins_for(2 * PLENTY))
    torque, angle = np.sin(np.arange(7000) / 50.0), np.linspace(0.0, 70.0, 7000)
    made, speed = torque_signals(TORQUE_SUN, torque, stretch), speed_signals(SPEED_SUN, angle, stretch, COUNT)
    assert sum(made.bins.counts) <= MOST_BINS // 2
    assert sum(speed.bins.counts) <= MOST_BINS // 2
    assert np.nanmax(made.high) == torque[stretch.start : stretch.end].max()
