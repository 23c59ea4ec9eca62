"""Columns of the baseline in motion against differences of what it predicts, on a neutral and an engaged run."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from unittest.mock import Mock

import numpy as np
import pytest
from tests.diagnosis.test_motion import _campaign
from tests.trials.test_motion_nature import BEGUN, short_runs

from pmg.pipeline.diagnosis.motion import baseline as baseline_room
from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline, _linearised, fit_baseline, start_baseline
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.constants import sheet_of
from pmg.pipeline.diagnosis.motion.noise import shown
from pmg.pipeline.diagnosis.motion.noise.filtered import filtered_noise
from pmg.pipeline.diagnosis.motion.noise.row_noise import row_noise
from pmg.pipeline.diagnosis.motion.regressors import _mixing
from pmg.pipeline.diagnosis.motion.rows import _twist, stretches_of
from pmg.pipeline.diagnosis.motion.view import views_of
from pmg.pipeline.motion.angle_noise import EVEN, AngleNoise, NoiseCourse
from pmg.pipeline.motion.lag import BUTTERWORTH, EQUAL_LAGS, FIRST_ORDER, Lag
from pmg.pipeline.motion.quantisation import NO_ERROR, QuantisationError
from pmg.pipeline.motion.smooth import MOST_COMMON, SmoothRun, SmoothShaft, row_weights, smooth
from pmg.pipeline.trials.motion.bench import draw_bench
from pmg.pipeline.trials.motion.nature import MotionCase, measure_motion_case
from pmg.pipeline.trials.motion.programme import MotionCampaign
from pmg.pipeline.trials.motion.size import Scene
from pmg.pipeline.trials.motion.strata import motion_strata
from pmg.sim.bench import load_bench
from pmg.sim.shafts import SIDES, PerShaft, other_side, per_shaft
from pmg.sim.signals import Array


def short_baseline() -> MotionBaseline:
    """Of the short campaign: engaged, loaded in a step; and both shafts through standstill in neutral."""
    runs = tuple(replace(run, started_at=run.started_at + timedelta(minutes=k)) for k, run in enumerate(short_runs()))
    scene = Scene(draw_bench(np.random.default_rng(1)), MotionCampaign("short", runs), (BEGUN,) * len(runs))
    case = MotionCase("short", motion_strata()[0], scene, (), "")
    measured = tuple(measure_motion_case(case, np.random.default_rng(2)))
    sheet = sheet_of(load_bench(), 1, tuple(run.name for run in measured if run.coupled))
    return start_baseline(sheet, stretches_of(tuple(map(smooth, measured))))


@pytest.fixture(scope="module")
def baseline() -> MotionBaseline:
    """The same with some drag."""
    found = short_baseline()
    for side in ("sun", "ring"):
        found.values[found.sheet.at(f"drag_{side}_0.5")] = 0.1
    return found


def test_columns_are_what_the_prediction_changes_by(baseline: MotionBaseline) -> None:
    sheet = baseline.sheet
    moved = set()
    for at, constant in enumerate(sheet.constants):
        step = 1e-2 * constant.spread if np.isfinite(constant.spread) else 1e-4
        ends = []
        for sign in (1.0, -1.0):
            values = baseline.values.copy()
            values[at] += sign * step
            ends.append(MotionBaseline(sheet, values, baseline.stretches))
        for place in range(len(baseline.stretches)):
            change = (ends[0].predicted(place) - ends[1].predicted(place)) / (2.0 * step)
            column = baseline.columns(place)[:, at]
            near = (
                0.05 if constant.name.startswith("eccentricity") else 0.01
            )  # which leaves out drag by the speed shown
            assert np.abs(column - change).max() <= near * np.abs(change).max() + 1e-9, (constant.name, place)
            moved |= {constant.name} if change.any() else set()
    still = {constant.name for constant in sheet.constants} - moved
    assert still <= {"drag_ring_off_at_150"}, "acts on nothing, and not because the ring stays slower"


OF_LAG = ("inertia_sun", "compliance_sun", "drag_sun_0.5", "zero_sun", "ripple_sun_1_cosine")
"""Constants of every kind that a reading may be late about, or is not."""


@pytest.mark.parametrize("sharpness", [FIRST_ORDER, EQUAL_LAGS, BUTTERWORTH])
def test_beside_a_lag_columns_are_what_the_lagging_reading_changes_by(
    baseline: MotionBaseline, sharpness: float
) -> None:
    """An unlagged column would lead the fit of a long lag away from the bench."""
    sheet, lag = baseline.sheet, Lag("sun", 0.02, sharpness)
    lagging = replace(baseline, lags=(lag,))
    moved = [sheet.at(name) for name in OF_LAG]

    def shown(values: Array, place: int) -> Array:
        state = MotionBaseline(sheet, values, baseline.stretches).states[place]
        torque = state.coupling_torque[:, None]
        late = lag.of(torque, state.stretch.run.fine_rate) - torque
        found = replace(baseline, values=values).predicted(place)
        return np.asarray(found + state.stretch.of_rows(late[:, 0]) * (state.stretch.side == "sun"))

    for at in moved:
        step = 1e-2 * sheet.constants[at].spread if np.isfinite(sheet.constants[at].spread) else 1e-4
        up, down = (baseline.values + sign * step * (np.arange(len(sheet)) == at) for sign in (1.0, -1.0))
        for place in range(len(baseline.stretches)):
            change = (shown(up, place) - shown(down, place)) / (2.0 * step)
            column = lagging.columns(place)[:, at]
            assert np.abs(column - change).max() <= 0.01 * np.abs(change).max() + 1e-9, (
                sheet.constants[at].name,
                place,
            )


def test_an_encoder_acts_on_the_other_rotor_where_the_gear_couples_them(baseline: MotionBaseline) -> None:
    for side, other in (("sun", "ring"), ("ring", "sun")):
        at = baseline.sheet.at(f"eccentricity_{other}_cosine")
        for place, stretch in enumerate(baseline.stretches):
            if stretch.side == side:
                assert baseline.columns(place)[:, at].any() == stretch.coupled


def test_every_candidate_with_columns_moves_some_row_and_stays_finite(baseline: MotionBaseline) -> None:
    views = views_of(baseline)
    for term in library():
        shape = float("nan") if term.shape is None else float(np.sqrt(np.prod(term.shape.bounds)))
        columns = [term.columns(view, shape) for view in views if term.acts(view)]
        assert all(np.isfinite(each).all() for each in columns)
        assert term.constants or any(each.any() for each in columns), term.key


def test_columns_that_stay_while_constants_move_little_lead_to_the_same_constants(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Against columns made anew at every step, on runs with a lag that no constant makes; none of them is engaged."""
    runs = tuple(smooth(run) for run in _campaign(3, lag=0.01))
    start = start_baseline(sheet_of(load_bench(), 1, ()), stretches_of(runs))
    noise = [row_noise(start, place) for place in range(len(start.stretches))]
    found, counts = [], []
    for straight in (0.0, baseline_room.STRAIGHT):
        made = Mock(wraps=_linearised)
        monkeypatch.setattr(baseline_room, "_linearised", made)
        monkeypatch.setattr(baseline_room, "STRAIGHT", straight)
        found.append(fit_baseline(start, lambda place, columns: noise[place].white(columns)))
        counts.append(made.call_count)
    (anew, exact), (kept, near) = found
    errors = np.sqrt(np.diag(exact))
    assert np.all(np.abs(kept.values - anew.values) <= 0.05 * errors + 1e-12)
    np.testing.assert_allclose(np.diag(near), np.diag(exact), rtol=0.02, atol=1e-15)
    assert counts[1] < counts[0]
    silent = [start.sheet.at(name) for name in ("slip_damping", *(f"engaged_drag_sun_{power}" for power in (1, 2)))]
    assert not kept.values[silent].any()
    assert not near[silent].any(), "no row and no data sheet says anything of them, and rounding is no evidence"


def test_a_steady_torque_is_known_as_well_as_the_noise_of_its_transducer_allows(baseline: MotionBaseline) -> None:
    """Steps of an encoder, which an inertia turns into torque at the upper end of the band, do not drown it."""
    seen = 0
    for place, stretch in enumerate(baseline.stretches):
        if stretch.coupled or stretch.at_rest:
            continue
        noise, n = row_noise(baseline, place), len(stretch)
        share = float(np.sum(noise.factor.solved(np.ones((n, 1))) ** 2) / n)
        assert 0.9 < share * 0.5 * stretch.run.row_rate * stretch.shaft.density < 1.05, stretch.side
        seen += 1
    assert seen


@pytest.mark.parametrize("coupled", [False, True])
def test_noise_that_changes_in_a_run_has_the_covariance_that_its_filters_make_of_it(
    baseline: MotionBaseline, *, coupled: bool
) -> None:
    """Rows as sums of white samples, each as large as the noise is at its instant."""
    stretch = next(each for each in baseline.stretches if each.coupled == coupled and not each.at_rest)
    run, side, other, rows = stretch.run, stretch.side, other_side(stretch.side), 25
    stiffness, inertia = PerShaft(30.0, 80.0) if coupled else PerShaft(0.0, 0.0), 0.02
    courses = PerShaft(
        *(NoiseCourse(run.time, *_swells(len(run.time), k), np.zeros((len(run.time), 0))) for k in (0, 2))
    )
    noise = per_shaft(lambda of: replace(run.shafts[of].angle_noise, course=courses[of]))
    shafts = per_shaft(lambda of: replace(run.shafts[of], angle_noise=noise[of]))
    common = 0.3 * np.sqrt(noise.sun.density * noise.ring.density)
    torque, angles = filtered_noise(
        replace(stretch, run=replace(run, shafts=shafts, common=common)), inertia, stiffness
    )
    value, curvature = row_weights(run)
    fine, half = round(run.run.rate / run.fine_rate), len(value) // 2
    first, step = round(run.row_time[0] * run.run.rate) - half, round(run.run.rate / run.row_rate)
    sample = first + np.arange(2 * half + 1 + step * (rows - 1)) - round(run.time[0] * run.run.rate)
    at = np.maximum((sample + fine // 2) // fine, 0)

    def made(density: float, weights: Array, size: Array) -> Array:
        placed = np.stack([np.pad(weights, (step * row, step * (rows - 1 - row))) for row in range(rows)])
        return np.asarray(np.sqrt(0.5 * run.run.rate * density) * placed * size[at])

    of_torque, of_own, of_other = (
        made(stretch.shaft.density, value, np.ones(len(run.time))),
        made(noise[side].density, inertia * curvature, courses[side].curvature)
        + made(noise[side].value_density, stiffness[side] * value, courses[side].value),
        made(noise[other].value_density, stiffness[other] * value, courses[other].value),
    )
    together = np.minimum(0.3 / (courses.sun.curvature * courses.ring.curvature), MOST_COMMON)[at]
    across = (of_own * together) @ of_other.T
    expected = np.sum([each @ each.T for each in (of_own, of_other)], axis=0) + across + across.T
    for found, of in ((torque, of_torque @ of_torque.T), (angles, expected)):
        for row in (0, 7, 18):
            np.testing.assert_allclose(found[row, :6], of[row, row : row + 6], rtol=1e-9, atol=1e-9 * of.max())


def test_a_coupling_twists_as_a_spring_and_a_damper_beside_it_do() -> None:
    """A twist that swings, and the torque that it makes: from that the twist comes back, with its derivatives."""
    sheet, stiffness, damping, rate = sheet_of(load_bench(), 1, ()), 3000.0, 4.0, 250.0
    time = np.arange(0.0, 2.0, 1.0 / rate)
    turn, values = 2.0 * np.pi * 9.0, sheet.expected.copy()
    twist = [1e-3 * turn**k * np.cos(turn * time + 0.5 * np.pi * k) for k in range(4)]
    torque = tuple(stiffness * twist[k] + damping * twist[k + 1] for k in range(3))
    values[sheet.at("compliance_ring")], values[sheet.at("coupling_loss_ring")] = (
        1.0 / stiffness,
        damping / stiffness**2,
    )
    acting = (torque[0], torque[1], torque[2])
    found = _twist(acting, "ring", sheet, values, rate)
    alone = _twist(acting, "ring", sheet, np.where(values == damping / stiffness**2, 0.0, values), rate)
    for k in range(3):
        inside = slice(10, -10)
        off, without = (np.abs(each[k] - twist[k])[inside].max() / np.abs(twist[k]).max() for each in (found, alone))
        assert off < 0.01 < 0.05 < without


@pytest.mark.parametrize("coupled", [False, True])
def test_noise_of_a_torque_shows_in_the_balance_as_the_cleaning_takes_it_to(
    baseline: MotionBaseline, *, coupled: bool
) -> None:
    """A small wave in the torque signal of couplings that are soft and damped, through the whole prediction."""
    place = next(k for k, each in enumerate(baseline.stretches) if each.coupled == coupled and not each.at_rest)
    stretch, sheet, values = baseline.stretches[place], baseline.sheet, baseline.values.copy()
    for name, value in (("compliance", 2e-3), ("coupling_loss", 1e-5)):
        values[sheet.at(f"{name}_{stretch.side}")] = value
    run, size, turn = stretch.run, 1e-4, 2.0 * np.pi * 11.0
    wave = [size * turn**k * np.cos(turn * run.time + 0.5 * np.pi * k) for k in range(3)]
    own = stretch.shaft
    noisy = replace(
        own,
        torque=own.torque + wave[0],
        torque_rate=own.torque_rate + wave[1],
        torque_curvature=own.torque_curvature + wave[2],
    )
    shafts = per_shaft(lambda side: noisy if side == stretch.side else run.shafts[side])
    before = MotionBaseline(sheet, values, (stretch,))
    after = MotionBaseline(sheet, values, (replace(stretch, run=replace(run, shafts=shafts)),))
    seen = stretch.of_rows(wave[0]) - (after.predicted(0) - before.predicted(0))
    response = _mixing(before, [0], np.array([1j * turn]), None)[0, SIDES.index(stretch.side), 0]
    told = stretch.of_rows(np.real(response * size * np.exp(1j * turn * run.time)))
    assert np.std(seen - told) < 0.1 * np.std(told)


def _swells(n: int, k: int) -> tuple[Array, Array]:
    """Two sizes of a noise that change in a run (n,)."""
    phase = np.linspace(0.0, 40.0, n)
    return 1.0 + 0.8 * np.sin(phase + k), 1.0 + 0.6 * np.cos(1.3 * phase + k)


def test_steps_that_are_off_for_long_act_through_the_magnetic_spring_and_not_in_neutral(
    baseline: MotionBaseline,
) -> None:
    spread, pull_out = PerShaft(1e-5, 3e-5), float(baseline.values[baseline.sheet.at("pull_out")])
    poles, seen = baseline.sheet.poles, set()
    for place, stretch in enumerate(baseline.stretches):
        run, time = stretch.run, np.arange(0.5, stretch.run.time[-1])

        def off(side: str, run: SmoothRun = run, time: Array = time) -> SmoothShaft:
            error = QuantisationError(time, np.full(len(time), spread[side]))
            noise = replace(run.shafts[side].angle_noise, quantisation=error, course=EVEN)
            return replace(run.shafts[side], angle_noise=noise)

        stretches = list(baseline.stretches)
        stretches[place] = replace(stretch, run=replace(run, shafts=per_shaft(off)))
        noise = row_noise(replace(baseline, stretches=tuple(stretches)), place)
        found = noise.quantisation
        variance = np.sum(found**2, axis=1)
        seen.add(stretch.coupled)
        if not stretch.coupled:
            assert not variance.any()
            continue
        of_angles = sum((poles[side] * spread[side]) ** 2 for side in SIDES)
        on_piece = np.min(np.abs(run.row_time[stretch.rows][:, None] - time), axis=1) < 0.02
        expected = (pull_out * poles[stretch.side]) ** 2 * of_angles
        np.testing.assert_allclose(variance[on_piece], expected, rtol=0.05)
        assert variance.max() < 1.01 * expected
        means, _ = shown._means_of(stretch, noise, stretch.torque, np.zeros((len(stretch), 0)))
        alone = replace(noise, quantisation=noise.quantisation[:, :0])
        other, _ = shown._means_of(stretch, alone, stretch.torque, np.zeros((len(stretch), 0)))
        of_means = np.diag(means.covariance - other.covariance)  # of pieces of 2 s, beside the waves of a turn
        assert np.all((0.4 * expected < of_means) & (of_means < 1.5 * expected))
        whole = np.ones((len(stretch), 1))
        assert np.linalg.norm(noise.white(whole)) < 0.8 * np.linalg.norm(row_noise(baseline, place).white(whole))
    assert seen == {True, False}


def test_channels_that_show_one_value_all_the_time_have_rows_that_can_be_whitened(baseline: MotionBaseline) -> None:
    first = baseline.stretches[0]
    silent_angle = AngleNoise(0.0, 0.0, NO_ERROR)
    still = first.run.shafts.map(lambda shaft: replace(shaft, density=0.0, angle_noise=silent_angle))
    silent = replace(baseline, stretches=(replace(first, run=replace(first.run, shafts=still, common=0.0)),))
    noise = row_noise(silent, 0)
    assert np.isfinite(noise.white(np.ones((len(first), 1)))).all()
    other = replace(
        baseline, stretches=(next(s for s in baseline.stretches if s.side == first.side and not s.at_rest),)
    )
    sound, off = row_noise(other, 0), np.random.default_rng(4).standard_normal(len(other.stretches[0]))
    nothing = [np.zeros((len(stretch), 0)) for stretch in (first, *other.stretches)]
    alone = shown.slow_noise_of(other.stretches, [sound], [off], nothing[1:])
    both = silent.stretches + other.stretches, [noise, sound], [np.zeros(len(first)), off], nothing
    told = shown.slow_noise_of(*both)
    assert told.wander[first.side].size == alone.wander[first.side].size


@pytest.mark.parametrize("off", [-1.2, 1.1])
def test_a_fit_that_starts_far_off_does_not_turn_the_magnetic_spring_around(
    baseline: MotionBaseline, off: float
) -> None:
    """A whole first step from there leads to a negative pull-out torque and pole angles half a period off."""
    sheet = baseline.sheet
    values = baseline.values.copy()
    values[[sheet.at(f"drag_{side}_0.5") for side in ("sun", "ring")]] = 0.0
    near = replace(baseline, values=values)
    noise = [row_noise(near, place) for place in range(len(near.stretches))]
    angle = next(at for at, name in enumerate(sheet.names) if name.startswith("pole_angle"))
    moved = values + off * (np.arange(len(values)) == angle)
    found, expected = (
        fit_baseline(replace(near, values=start), lambda place, columns: noise[place].white(columns))[0]
        for start in (moved, values)
    )
    for name in ("pull_out", "inertia_sun", "inertia_ring"):
        assert found.values[sheet.at(name)] == pytest.approx(expected.values[sheet.at(name)], rel=1e-3)


@pytest.mark.parametrize("size", [0.0, 1e-158, 1e-9])
def test_directions_that_jitter_blurs_away_change_nothing(
    size: float, baseline: MotionBaseline, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their products are below the smallest number: singular values of a matrix with such columns are not found."""
    place = next(k for k, stretch in enumerate(baseline.stretches) if not stretch.at_rest)
    rng, ones = np.random.default_rng(1), np.ones((len(baseline.stretches[place]), 1))
    monkeypatch.setattr("pmg.pipeline.diagnosis.motion.noise.row_noise._ordered_steps", lambda _: 0.0 * ones)
    without = row_noise(baseline, place)
    blurred = size * rng.standard_normal((len(ones), 4))
    monkeypatch.setattr("pmg.pipeline.diagnosis.motion.noise.row_noise._ordered_steps", lambda _: blurred)
    np.testing.assert_allclose(row_noise(baseline, place).white(ones), without.white(ones), rtol=1e-6, atol=1e-9)
