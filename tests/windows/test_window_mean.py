"""Means of windows whose noise remembers, and whole revolutions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from tests.bench.colours import Colour, power_law, resonance
from tests.bench.windowed import NOISE, TORQUE, tally, window

from pmg.pipeline.recording.means import BATCH_METHOD, MEMORY_METHOD
from pmg.pipeline.windows.noise_models import _kinds, forms
from pmg.pipeline.windows.reduce import _reduce_shaft, _resolution
from pmg.pipeline.windows.revolutions import SLACK, WholeRevolutions, whole_revolutions
from pmg.pipeline.windows.window_mean import FEWEST_PIECES, _half_width, serial_mean
from pmg.sim.signals import RPM

RATE = 1000.0
RUNS = 200


@pytest.mark.parametrize("memory", [0.0, 0.02, 0.1, 0.5])
def test_95_percent_intervals_hold_the_truth_whatever_the_memory_of_the_noise(memory: float) -> None:
    """200 windows: at a coverage of 95 %, fewer than 180 or all of them come by chance once in 500 sets."""
    found = tally(memory, RUNS, RATE)
    held = int(found.held.sum())
    assert stats.binom.ppf(0.001, RUNS, 0.95) <= held <= stats.binom.ppf(0.999, RUNS, 0.975)
    if memory == 0.5:
        assert found.flagged.mean() > 0.8
        assert found.batches.mean() < 0.85
        assert float(np.median(found.memory)) == pytest.approx(memory, rel=0.4)
    if memory <= 0.02:
        assert found.flagged.mean() < 0.05


@pytest.mark.parametrize(("hertz", "flat"), [(0.5, False), (1.0, True)])
def test_a_slow_resonance_is_known_for_one(hertz: float, flat: bool) -> None:
    """Noise of first order that long would give up to six times the half-width that is due, and hold all."""
    found = tally(Colour("mode", resonance(hertz, 0.1)), 100, RATE)
    held = int(found.held.sum())
    assert stats.binom.ppf(0.001, 100, 0.95) <= held
    assert 0.8 < found.wide() < 1.5
    assert found.flagged.mean() < 0.35 if flat else found.flagged.mean() > 0.9


def test_noise_without_a_time_of_its_own_is_flagged_and_widens_the_interval() -> None:
    """Of first order alone, a quarter of the windows would be flagged, with 0.6 of the half-width that is due."""
    found = tally(Colour("1/f", power_law(1.0)), 150, RATE)
    assert found.flagged.mean() > 0.4
    assert found.held.mean() > found.batches.mean() + 0.1
    assert found.held[found.flagged].mean() > 0.8


@settings(max_examples=40)
@given(m=st.integers(FEWEST_PIECES, 60), number=st.integers(0, len(_kinds()) - 1))
def test_the_mean_is_as_uncertain_however_the_stretch_is_cut(m: int, number: int) -> None:
    kind = _kinds()[number]
    lag = np.abs(np.subtract.outer(np.arange(m), np.arange(m)))
    assert kind.covariance(m)[lag].mean() == pytest.approx(kind.coarser(m, 1), rel=1e-6)


@pytest.mark.parametrize("m", [FEWEST_PIECES, 25, 29, 37, 50])
def test_forms_are_covariances_and_independent_noise_is_flat_and_safe_for_batches(m: int) -> None:
    known = forms(m)
    assert (known.variances > 0.0).all()
    assert not known.unsafe[0]
    assert not known.uneven[0]
    memory = known.memory[np.isfinite(known.memory)]
    assert (known.uneven[: len(memory)] == (memory > 0.0503)).all()


@pytest.mark.parametrize("m", [4, 17, 50])
def test_the_axes_of_a_form_are_those_of_its_covariance_matrix(m: int) -> None:
    known = forms(m)
    lag = np.abs(np.subtract.outer(np.arange(m), np.arange(m)))
    for number, kind in enumerate(_kinds()):
        matrix, axes = kind.covariance(m)[lag], known.turn[number]
        assert axes @ axes.T == pytest.approx(np.eye(m), abs=1e-12)
        turned = axes @ matrix @ axes.T
        assert turned == pytest.approx(np.diag(np.diag(turned)), abs=1e-10)


def test_ripple_over_a_part_of_a_turn_stays_out_of_the_mean() -> None:
    """A plain mean over 10.5 turns is off by 0.05/(10.5 pi) N m, twenty times the noise of the mean."""
    n, speed = 5000, 126.0 * RPM
    angle = np.asarray(speed * np.arange(n) / RATE, dtype=np.float64)
    torque = 1.0 + 0.05 * np.sin(angle)
    assert torque.mean() - 1.0 == pytest.approx(0.05 / (10.5 * math.pi), rel=0.01)
    assert _reduce_shaft(torque, angle, RATE).torque == pytest.approx(1.0, abs=2e-5)


@settings(max_examples=25)
@given(
    shift=st.floats(-5.0, 5.0),
    scale=st.floats(0.01, 20.0),
    sign=st.sampled_from([-1.0, 1.0]),
    memory=st.sampled_from([0.0, 0.3]),
    seed=st.integers(0, 1000),
)
def test_mean_and_uncertainty_move_with_the_torque(
    shift: float, scale: float, sign: float, memory: float, seed: int
) -> None:
    torque, angle = window(memory, np.random.default_rng(seed), 200.0)
    plain = _reduce_shaft(torque, angle, 200.0)
    moved = _reduce_shaft(sign * scale * torque + shift, -angle, 200.0)
    assert moved.torque == pytest.approx(sign * scale * plain.torque + shift, rel=1e-9, abs=1e-9)
    assert moved.within == pytest.approx(scale * plain.within, rel=1e-5)
    assert moved.dof == pytest.approx(plain.dof, rel=1e-5)
    assert moved.correlation_time == pytest.approx(plain.correlation_time, rel=1e-4)
    assert moved.correlated == plain.correlated


@settings(max_examples=25)
@given(turns=st.floats(5.0, 200.0), seed=st.integers(0, 1000))
def test_whole_revolutions_use_all_but_a_part_of_one(turns: float, seed: int) -> None:
    n = 4000
    angle = 2.0 * math.pi * turns * np.arange(n) / (n - 1)
    made = WholeRevolutions(np.random.default_rng(seed).standard_normal(n), whole_revolutions(angle))
    pieces = made.pieces()
    assert turns - 1.0 <= made.whole <= turns * n / (n - 1) + SLACK
    assert n * (1.0 - 1.0 / turns) - 2 <= made.used <= n
    assert len(pieces.means) * pieces.revolutions <= made.whole
    if pieces.revolutions:
        assert pieces.length == pytest.approx(pieces.revolutions * (n - 1) / turns, rel=1e-6)
    else:
        assert pieces.means.mean() == pytest.approx(made.mean(), abs=1e-9)


@pytest.mark.parametrize("speed", [60.0, 77.0, 120.0, 400.0, 1500.0])
def test_ripple_is_taken_for_no_memory_at_any_speed(speed: float, rng: np.random.Generator) -> None:
    """Ripple five times the noise; at most a window in five flagged, where an average turn left in would flag all."""
    angle = np.asarray(speed * RPM * np.arange(5000) / RATE, dtype=np.float64)
    ripple = 0.05 * np.sin(angle) + 0.02 * np.sin(3.0 * angle + 1.0)
    found = [_reduce_shaft(1.0 + ripple + rng.normal(0.0, 0.01, 5000), angle, RATE) for _ in range(20)]
    assert sum(f.correlated for f in found) <= 4
    assert all(f.revolutions_per_batch for f in found)


def test_batches_stay_where_noise_is_short_and_give_way_where_it_is_long(rng: np.random.Generator) -> None:
    short = [_reduce_shaft(*window(0.0, rng, RATE), RATE).method for _ in range(20)]
    long = [_reduce_shaft(*window(0.5, rng, RATE), RATE).method for _ in range(20)]
    assert short.count(BATCH_METHOD) >= 17
    assert long.count(MEMORY_METHOD) >= 17


def test_independent_pieces_have_the_uncertainty_of_their_mean(rng: np.random.Generator) -> None:
    found = [serial_mean(rng.standard_normal(50)) for _ in range(100)]
    assert all(f is not None for f in found)
    u = np.array([f.u for f in found if f is not None])
    assert float(np.sqrt(np.mean(u**2))) == pytest.approx(1.0 / math.sqrt(50), rel=0.15)


@pytest.mark.parametrize("level", [0.6826894921370859, 0.95])
@pytest.mark.parametrize("parts", [1, 2, 40])
def test_the_interval_of_a_mixture_holds_its_part(parts: int, level: float, rng: np.random.Generator) -> None:
    for spread in (0.0, 0.3, 2.0):
        weight, off = rng.exponential(size=parts), spread * rng.standard_normal(parts)
        scale = np.exp(spread * rng.standard_normal(parts))
        half = _half_width(level, weight, off, scale, 7)
        inside = np.diff(stats.t(7, off, scale).cdf([[-half], [half]]), axis=0)[0]
        assert float(weight @ inside) == pytest.approx(level * weight.sum(), rel=1e-10)


def test_too_few_or_equal_pieces_tell_nothing() -> None:
    assert serial_mean(np.arange(FEWEST_PIECES - 1.0)) is None
    assert serial_mean(np.full(50, 0.3)) is None


def test_resolution_is_the_step_of_the_readings(rng: np.random.Generator) -> None:
    step = 2.0e-3
    assert _resolution(step * np.round(rng.normal(0.0, NOISE, 2000) / step)) == pytest.approx(step)
    assert math.isnan(_resolution(np.full(10, TORQUE)))
