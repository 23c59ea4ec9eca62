"""Noise of torques and angles, as a record tells it, against that which was put into the record."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.signal import butter, fftconvolve, lfilter, sosfilt

from pmg.pipeline.diagnosis.motion.noise.filtered_torque import with_noise_of_band
from pmg.pipeline.motion.run import MovingRun
from pmg.pipeline.motion.smooth import _above, row_weights, smooth
from pmg.pipeline.motion.torque_noise import white_density
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.errors import FitError
from pmg.sim.grid import Configuration
from pmg.sim.shafts import PerShaft
from pmg.sim.signals import Array

RATE = 1000.0
COUNT = 2.0 * np.pi / 5120
WHITE = 0.02


def _run(torque: Array, angle: Array) -> MovingRun:
    """A run whose sun reads these and whose ring stands."""
    still = np.zeros(len(angle))
    begin = datetime(2025, 6, 3, 8, tzinfo=UTC)
    neutral, turns = Configuration.NEUTRAL, PerShaft(sun=True, ring=False)
    signals = PerShaft(torque, still), PerShaft(angle, still), PerShaft(COUNT, COUNT)
    return MovingRun("1.mcap", "N_1", neutral, 1, "sun", Manoeuvre.RAMP, begin, RATE, *signals, turns, ())


def _seconds(length: float) -> Array:
    return np.arange(round(length * RATE)) / RATE


def _densities(true: Array, jitter: float, rng: np.random.Generator) -> tuple[float, float]:
    """Density that is told of the noise of an angle [rad2/Hz], and that of the noise in the band of the rows."""
    read = COUNT * np.floor((true + jitter * rng.standard_normal(len(true))) / COUNT)
    found = smooth(_run(WHITE * rng.standard_normal(len(true)), read))
    curved = row_weights(found)[1]
    seen = np.mean(fftconvolve(read - true + 0.5 * COUNT, curved, "valid") ** 2) / (0.5 * RATE * float(curved @ curved))
    return found.shafts.sun.angle_noise.density, float(seen)


def _slow(rng: np.random.Generator, speed: float) -> Array:
    """A speed that drifts by so little that the steps of the encoder stay about the band for long."""
    drift = lfilter([1.0], [1.0, -np.exp(-1.0 / RATE / 3.0)], rng.standard_normal(20000))
    return speed + 6.0 * COUNT * drift / np.std(drift)


@pytest.mark.parametrize("rate", [500.0, 1000.0, 2000.0])
def test_rows_weigh_samples_as_their_noise_is_told_to_be(rate: float) -> None:
    """One sample of a torque, and of an angle, comes into the rows by the weights of which their noise is made."""
    n, struck = round(4.0 * rate), round(2.0 * rate)
    struck_once = np.eye(1, n, struck)[0]
    found = smooth(replace(_run(struck_once, np.zeros(n)), rate=rate))
    turned = smooth(replace(_run(np.zeros(n), struck_once), rate=rate))
    rows = np.round(found.row_time * rate).astype(int)
    for shown, weights in zip(
        (found.measured.sun, turned.rows(turned.shafts.sun.acceleration)), row_weights(found), strict=True
    ):
        at = rows - struck + len(weights) // 2
        reached = (at >= 0) & (at < len(weights))
        expected = np.where(reached, weights[np.clip(at, 0, len(weights) - 1)], 0.0)
        np.testing.assert_allclose(shown, expected, atol=1e-5 * np.abs(weights).max())


def test_steps_that_fold_into_the_band_are_told_as_large_as_they_are() -> None:
    rng, told, seen = np.random.default_rng(7), 0.0, 0.0
    for number in range(24):
        speed = (number + 2) * RATE * COUNT + rng.uniform(-20.0, 20.0) * COUNT
        of_run = _densities(np.cumsum(_slow(rng, speed)) / RATE, 0.0, rng)
        told, seen = told + of_run[0], seen + of_run[1]
    assert 0.93 < told / seen < 1.07  # a smooth angle that holds the steps in the band told a third of them


def _weights() -> Array:
    """Weights of the samples in a row of the second derivative."""
    return row_weights(smooth(_run(*2 * (np.zeros(2000),))))[1]


def _in_time(speed: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Squares (2, n) told and seen of what steps are off in rows of an angle, and of its second derivative, in time."""
    true = np.cumsum(speed) / RATE + rng.uniform() * COUNT
    read = COUNT * np.floor(true / COUNT)
    found = smooth(_run(WHITE * rng.standard_normal(len(true)), read))
    noise, filters, at = found.shafts.sun.angle_noise, row_weights(found), np.arange(len(true)) / RATE
    course, seen = noise.course, [fftconvolve(read - true + 0.5 * COUNT, each, "same") ** 2 for each in filters]
    densities = (
        density * np.interp(at, course.time, size) ** 2
        for density, size in ((noise.value_density, course.value), (noise.density, course.curvature))
    )
    told = [
        0.5 * RATE * fftconvolve(density, weights**2, "same")
        for density, weights in zip(densities, filters, strict=True)
    ]
    told[1] += np.interp(at, course.time, np.sum(course.ordered**2, axis=1), left=0.0, right=0.0)
    return np.array(told), np.array(seen)


def test_steps_are_told_as_large_as_they_are_where_a_shaft_turns_back_and_where_it_is_started() -> None:
    rng, time = np.random.default_rng(15), _seconds(20.0)
    clear = (time > 0.3) & (time < 19.7)
    begun, turned, held = (np.zeros((2, 2)) for _ in range(3))  # told and seen, of the angle and its second derivative
    for _ in range(24):
        swung = rng.uniform(1.3, 2.6) * np.sin(2.0 * np.pi * time / rng.choice([3.0, 3.75, 5.0]) + 1.0)
        turned += np.array(_in_time(swung, rng))[:, :, clear & (np.abs(swung) < 0.1)].mean(axis=2)
        started = (50.0 + rng.uniform(0.3, 0.45)) * RATE * COUNT * np.clip(time / 4.0, 0.0, 1.0)
        of_start = np.array(_in_time(started, rng))
        begun += of_start[:, :, clear & (time < 4.0)].mean(axis=2)
        held += of_start[:, :, clear & (time > 4.0)].mean(axis=2)
    for told, seen in (begun, turned, held):
        np.testing.assert_allclose(told / seen, 1.0, atol=0.3)
    assert np.all(begun[1] > 1.5 * held[1])  # what one figure for the whole run cannot tell


@pytest.mark.parametrize("folds_to", [8.0, 15.0, 22.0, 30.0, 36.0])
def test_steps_of_a_held_speed_are_told_and_at_most_twice(folds_to: float) -> None:
    """Lines at the edge of the band are in the density and have directions besides."""
    rng, time = np.random.default_rng(18), _seconds(10.0)
    clear, sums = (time > 0.5) & (time < 9.5), np.zeros((2, 2))
    for k in range(4):
        speed = np.full(len(time), ((k + 7) * RATE + folds_to) * COUNT)
        sums += np.array(_in_time(speed, rng))[:, :, clear].mean(axis=2)
    told, seen = sums
    assert 0.8 < told[1] / seen[1] < 2.2


def _beyond_directions(speed: Array, rng: np.random.Generator) -> tuple[float, float, Array]:
    """Squares of what steps are off that their directions leave, of all where they are, and the size along two."""
    true = np.cumsum(speed) / RATE + rng.uniform() * COUNT
    read = COUNT * np.floor(true / COUNT)
    course = smooth(_run(WHITE * rng.standard_normal(len(true)), read)).shafts.sun.angle_noise.course
    off = fftconvolve(read - true + 0.5 * COUNT, _weights(), "same")
    waves, seen = course.ordered, np.interp(course.time, _seconds(20.0), off)
    power = np.sum(waves**2, axis=1)
    near = power > 0.1 * power.max()
    white = 0.1 * np.mean(power[near])
    size = np.linalg.solve(waves.T @ waves / white + np.eye(waves.shape[1]), waves.T @ seen / white)
    return float(np.sum((seen - waves @ size)[near] ** 2)), float(np.sum(seen[near] ** 2)), size[:2]


def test_steps_are_off_by_the_same_each_time_that_a_shaft_turns_back() -> None:
    """A swing that comes back to the same place: a few waves of the size that is told hold next to all of it."""
    rng, time = np.random.default_rng(16), _seconds(20.0)
    swings = (rng.uniform(1.3, 2.6) * np.sin(2.0 * np.pi * time / 4.0 + 1.0) for _ in range(24))
    left, whole, sizes = zip(*(_beyond_directions(swung, rng) for swung in swings), strict=True)
    assert sum(left) < 0.05 * sum(whole)
    assert 0.6 < np.mean(np.square(sizes)) < 1.5


def test_steps_that_a_held_speed_folds_to_where_the_low_pass_falls_have_directions_of_their_own() -> None:
    """A line of 30 to 37 Hz, with a ramp up to the speed and down again: as noise of the band it would be far less."""
    rng, time = np.random.default_rng(17), _seconds(20.0)
    held = np.clip(np.minimum(time, 20.0 - time) / 4.0, 0.0, 1.0)
    speeds = ((k + 5) * RATE * COUNT + rng.choice([-1.0, 1.0]) * rng.uniform(30.0, 37.0) * COUNT for k in range(12))
    left, whole, sizes = zip(*(_beyond_directions(speed * held, rng) for speed in speeds), strict=True)
    assert sum(left) < 0.1 * sum(whole)
    assert 0.4 < np.mean(np.square(sizes)) < 1.5


def test_steps_of_a_ramp_from_standstill_are_told_as_large_as_they_are() -> None:
    rng, told, seen = np.random.default_rng(8), 0.0, 0.0
    for fastest in np.linspace(20.0, 60.0, 16):
        time = _seconds(26.0)
        speed = fastest * np.clip(np.minimum(time, 26.0 - time) / 10.0, 0.0, 1.0)
        of_run = _densities(np.cumsum(speed) / RATE, 0.0, rng)
        told, seen = told + of_run[0], seen + of_run[1]
    assert 0.93 < told / seen < 1.07


@pytest.mark.parametrize("jitter", [0.05, 0.09, 0.15])
def test_jitter_that_spreads_the_steps_of_a_held_speed_is_told(jitter: float) -> None:
    rng = np.random.default_rng(9)
    speed = np.full(25000, (50.0 * RATE + 200.0) * COUNT)
    told, seen = _densities(np.cumsum(speed) / RATE, jitter * COUNT, rng)
    assert 0.7 < told / seen < 1.4


def test_a_load_that_changes_at_once_is_no_noise_of_the_torque() -> None:
    rng, time = np.random.default_rng(10), _seconds(25.0)
    load = lfilter([0.06], [1.0, -0.94], np.where(np.mod(time, 4.0) < 2.0, 0.5, 5.0))
    read = load + WHITE * rng.standard_normal(len(time))
    told = smooth(_run(read, 30.0 * time)).shafts.sun.density
    assert told == pytest.approx(2.0 * WHITE**2 / RATE, rel=0.05)


@pytest.mark.parametrize("length", [1.0, 2.0, 25.0])
@pytest.mark.parametrize("rate", [500.0, 1000.0, 2000.0])
def test_the_noise_of_a_torque_is_told_of_short_records_too(rate: float, length: float) -> None:
    rng = np.random.default_rng(11)
    told = [white_density(WHITE * rng.standard_normal(round(length * rate)), rate, _above) for _ in range(200)]
    assert np.mean(told) == pytest.approx(2.0 * WHITE**2 / rate, rel=0.04)


def _behind(cut_off: float, length: float, rng: np.random.Generator) -> Array:
    """Noise of a density of 1 behind a low-pass of Butterworth of the second order [Hz]; infinite, none."""
    noise = np.sqrt(0.5 * RATE) * rng.standard_normal(round(length * RATE))
    return noise if np.isinf(cut_off) else np.asarray(sosfilt(butter(2, cut_off, fs=RATE, output="sos"), noise))


def _with_ring(run: MovingRun, noise: Array) -> MovingRun:
    return replace(run, torque=PerShaft(run.torque.sun, noise))


@pytest.mark.parametrize(("cut_off", "off"), [(np.inf, 0.05), (100.0, 0.15), (50.0, 0.15)])
def test_noise_behind_a_low_pass_is_told_as_dense_as_it_is_in_the_band(cut_off: float, off: float) -> None:
    rng = np.random.default_rng(12)
    checks = [_run(_behind(cut_off, 6.0, rng), np.zeros(6000)) for _ in range(3)]
    moving = _run(_behind(cut_off, 25.0, rng), 30.0 * _seconds(25.0))
    every = (*(replace(each, manoeuvre=Manoeuvre.ZERO) for each in checks), moving)
    runs = tuple(smooth(_with_ring(each, _behind(np.inf, len(each.torque.sun) / RATE, rng))) for each in every)
    told = with_noise_of_band(runs)[-1].shafts
    assert told.sun.density == pytest.approx(1.0, rel=off)
    assert told.ring.density == runs[-1].shafts.ring.density


@pytest.mark.parametrize("length", [1.0, 2.0, 6.0])
def test_a_short_zero_check_does_not_change_the_density_of_white_noise(length: float) -> None:
    rng = np.random.default_rng(14)
    moving = smooth(_run(_behind(np.inf, 5.0, rng), 30.0 * _seconds(5.0)))
    changed = 0
    for _ in range(40):
        check = replace(_run(_behind(np.inf, length, rng), np.zeros(round(length * RATE))), manoeuvre=Manoeuvre.ZERO)
        told = with_noise_of_band((smooth(_with_ring(check, check.torque.sun[::-1])), moving))[-1]
        changed += told.shafts.sun.density != moving.shafts.sun.density
    assert changed <= 1


def test_without_zero_checks_noise_is_told_next_above_the_band_and_refused_where_it_falls_there() -> None:
    rng = np.random.default_rng(13)
    white, wide, narrow = (smooth(_run(_behind(f, 25.0, rng), 30.0 * _seconds(25.0))) for f in (np.inf, 200.0, 80.0))
    (same,) = with_noise_of_band((white,))
    assert same.shafts.sun.density == white.shafts.sun.density
    (told,) = with_noise_of_band((wide,))
    assert told.shafts.sun.density == pytest.approx(0.95, rel=0.1)
    assert wide.shafts.sun.density < 0.4
    with pytest.raises(FitError, match=r"torque of the sun: noise .* times as dense at 84 Hz as at 168 Hz"):
        with_noise_of_band((narrow,))


def test_a_rate_that_shows_no_noise_above_the_band_is_refused() -> None:
    still = np.zeros(4000)
    with pytest.raises(FitError, match="200 samples a second"):
        smooth(replace(_run(still, still), rate=200.0))


def _on_average(
    counts: float, rng: np.random.Generator, jitter: float = 0.0, rate: float = RATE
) -> tuple[float, float]:
    """Square of what steps are told to be off on average at some counts a sample [counts2], and of what they are."""
    true = (counts * np.arange(round(20.0 * rate)) + rng.uniform()) * COUNT
    read = COUNT * np.floor((true + jitter * COUNT * rng.standard_normal(len(true))) / COUNT)
    run = replace(_run(WHITE * rng.standard_normal(len(true)), read), rate=rate)
    told = smooth(run).shafts.sun.angle_noise.quantisation
    half = round(0.45 * rate)
    pieces = [slice(round(at * rate) - half, round(at * rate) + half) for at in told.time]
    off = np.array([np.mean(read[piece] - true[piece]) / COUNT + 0.5 for piece in pieces])
    return float(np.mean((told.spread / COUNT) ** 2)), float(np.mean(off**2))


@pytest.mark.parametrize("rate", [250.0, 1000.0])
@pytest.mark.parametrize("part", [1, 2, 5, 10])
def test_quantisation_that_does_not_average_out_is_told_where_a_speed_is_held(part: int, rate: float) -> None:
    """At a whole number of counts a sample, or of two, five or ten: steps that go on as one."""
    rng = np.random.default_rng(12)
    told, seen = np.mean([_on_average(50.0 + 1.0 / part + 1e-6, rng, rate=rate) for _ in range(60)], axis=0)
    assert 0.7 < told / seen < 1.4
    assert told == pytest.approx(1.0 / 12.0 / part**2, rel=0.2)


def test_steps_that_follow_no_order_or_that_jitter_hides_average_out() -> None:
    rng = np.random.default_rng(13)
    assert _on_average(50.3819660, rng)[0] < 1e-3 / 12.0
    assert _on_average(50.2, rng, jitter=0.3)[0] < 1e-3 / 12.0


@pytest.mark.parametrize("beat", [0.002, 0.003, 0.005, 0.008, 0.02])
def test_a_beat_that_is_slow_in_the_band_is_noise_of_the_angle_itself(beat: float) -> None:
    """Steps that go on for a part of a second as one: they act in full where an angle strains a spring."""
    rng, told, seen = np.random.default_rng(14), 0.0, 0.0
    for _ in range(12):
        true = ((50.0 + beat * rng.uniform(0.95, 1.05)) * np.arange(20000) + rng.uniform()) * COUNT
        read = COUNT * np.floor(true / COUNT)
        found = smooth(_run(WHITE * rng.standard_normal(len(true)), read))
        noise, low = found.shafts.sun.angle_noise, row_weights(found)[0]
        on_average = float(np.mean(noise.quantisation.spread**2))
        told += noise.value_density * 0.5 * RATE * float(low @ low) + on_average
        seen += float(np.var(fftconvolve(read - true, low, "valid")))
    assert 0.75 < told / seen < 1.3
