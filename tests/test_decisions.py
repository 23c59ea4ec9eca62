"""Thresholds and branches about data, each at both of its sides."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import optimize, special, stats
from scipy import signal as filters

from pmg.pipeline.campaign_comparison.setpoints import carried
from pmg.pipeline.campaign_comparison.shared_errors import left_over, sharing
from pmg.pipeline.campaign_comparison.side import CampaignSide
from pmg.pipeline.campaign_comparison.transducers import Transducers
from pmg.pipeline.catalogue.difference import MeanDifference, differing, mean_differences, paired
from pmg.pipeline.diagnosis.design.audit import ALIKE, DIGITS, audit_design
from pmg.pipeline.diagnosis.engine import scan as scans
from pmg.pipeline.diagnosis.engine.adequacy import Remainder, adequacy_test
from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.evidence import Evidence
from pmg.pipeline.diagnosis.engine.explanation import Explanation, rivals_near
from pmg.pipeline.diagnosis.engine.found_set import Naming
from pmg.pipeline.diagnosis.engine.mismatch import search
from pmg.pipeline.diagnosis.engine.problem import Fit, WhitenedProblem
from pmg.pipeline.diagnosis.engine.scan import ABSORBED, Scan, make_scan
from pmg.pipeline.diagnosis.residuals.covariates import COVARIATES, looks, untested
from pmg.pipeline.fit.analysis import _far_off, _surprises
from pmg.pipeline.fit.calibration import start_model
from pmg.pipeline.fit.common_errors import TransducerCause
from pmg.pipeline.fit.loss_fit import LossFits, fit_losses
from pmg.pipeline.fit.noise import NO_CORRELATION, NoiseFloor, ShaftNoise
from pmg.pipeline.fit.noise_floor import noise_floor, repeat_contrasts, structured_columns
from pmg.pipeline.fit.robust import MINIMUM_ROOM
from pmg.pipeline.fit.structure import _run_history, families
from pmg.pipeline.fit.whitening import floor_scale
from pmg.pipeline.grid.conditions import NOT_RECORDED, UNRECORDED, conditions
from pmg.pipeline.grid.readings import Readings, predict, take_readings
from pmg.pipeline.orders.band import FALSE_ALARM, FEWEST, emptied, noise_around, periodogram
from pmg.pipeline.recording.calibration import Calibration, Transducer
from pmg.pipeline.recording.run_records import RunRecord
from pmg.pipeline.store.manifest import Manifest
from pmg.pipeline.thesis_figures.remarks import remarks_on
from pmg.pipeline.windows.revolutions import WholeRevolutions
from pmg.pipeline.wording.units import declared, kind_of
from pmg.sim.bench import BenchParameters
from pmg.sim.dynamics.programme import Programme
from pmg.sim.dynamics.segments import follow, make_legs
from pmg.sim.errors import BenchError
from pmg.sim.grid import Grid
from pmg.sim.losscurve import SPEED_REFERENCE_RING, SPEED_REFERENCE_SUN, LossCurve
from pmg.sim.signals import RPM, Array
from tests.points import joined, measured, points
from tests.store.records import WINDOW

RPM_SUN = np.array([150.0, 400.0, 700.0, 1000.0, 1300.0, 1600.0, 1850.0])


def test_scatter_between_turns_is_that_of_one_value(rng: np.random.Generator) -> None:
    """Ripple that repeats with the turn is none of it; a difference of two values has twice the variance."""
    turns = np.linspace(0.0, 20.0, 20_001)
    noise = 0.1 * rng.standard_normal(20_000)
    torque = 1.0 + 3.0 * np.sin(2.0 * math.pi * 7.0 * turns[:-1]) + noise
    assert WholeRevolutions(torque, turns).scatter() == pytest.approx(0.1, rel=0.02)


def neutral(rng: np.random.Generator, *, ordered: bool = True, zeros: int = 0) -> Grid:
    """Sun and ring over their range, every point twice, some zero checks."""
    sun, ring = (np.tile(axis.ravel(), 2) for axis in np.meshgrid(RPM_SUN, [0.0, 120.0, 300.0, 600.0]))
    at = joined(points("neutral", sun, ring), points("zero", np.zeros(zeros), np.zeros(zeros)))
    started = np.asarray(1.7e9 + 40.0 * np.arange(len(at)) if ordered else np.full(len(at), np.nan), dtype=np.float64)
    at = replace(at, started_at=started)
    noise = 1e-3 * rng.standard_normal((2, len(at)))
    moving = [np.abs(speed) > 0.0 for speed in (at.speed_sun, at.speed_ring)]
    drag = 0.02 + 4e-4 * np.abs(at.speed_sun), 0.04 + 9e-4 * np.abs(at.speed_ring)
    torques = [np.where(m, d, 0.0) + n for m, d, n in zip(moving, drag, noise, strict=True)]
    return measured(at, torques[0], torques[1])


def engaged(bench: BenchParameters, rng: np.random.Generator, *, both_flows: bool = False) -> Grid:
    sun, load = (axis.ravel() for axis in np.meshgrid(RPM_SUN, [0.8, 1.2, 1.9]))
    at = points("engaged", sun, -sun / bench.gear1.ratio, load)
    if both_flows:
        at = joined(at, points("engaged", sun, -sun / bench.gear1.ratio, -load, drive="ring"))
    torque = at.torque_ring / bench.gear1.ratio + 0.05 + 1e-3 * rng.standard_normal(len(at))
    return measured(at, torque, at.torque_ring)


def fits_of(grid: Grid) -> LossFits:
    return fit_losses(grid, (0.0, 1.0), (0.0, 1.0))


# --- the scan for structure ------------------------------------------------------------------------------------


def scan_beside(readings: Readings, baseline: Array, families: list[Array]) -> Scan:
    contrasts = repeat_contrasts(readings)
    groups = tuple(readings.of_shaft)
    none = np.zeros((len(readings), 0))
    return make_scan(Evidence(none, none, families, groups, none, (contrasts, none), single_rows=True), baseline)


def a_scan_of(bench: BenchParameters, rng: np.random.Generator) -> tuple[Readings, Array, Array]:
    """Sun readings of which the last has nearly all the leverage, the baseline's columns, white noise."""
    rpm = np.r_[np.linspace(100.0, 500.0, 29), 1600.0]
    at = points("neutral", rpm, np.zeros(30))
    readings = take_readings(measured(at, np.zeros(30), np.zeros(30)), bench)
    return readings, np.c_[np.ones(30), at.speed_sun], rng.standard_normal(30)


@pytest.mark.parametrize("row", [0, 15, 29])
def test_the_largest_residual_is_judged_by_the_room_that_the_fit_leaves_it(
    row: int, bench: BenchParameters, rng: np.random.Generator
) -> None:
    rpm = np.r_[np.linspace(100.0, 500.0, 29), 900.0]
    readings = take_readings(measured(points("neutral", rpm, rpm), np.zeros(30), np.zeros(30)), bench)
    one, none = np.c_[np.ones(30), rpm], np.zeros((30, 2))
    baseline, white = np.block([[one, none], [none, one]]), rng.standard_normal(60)
    hat = baseline @ np.linalg.pinv(baseline)
    room = 1.0 - np.diag(hat)
    white[row] += 8.0 / np.sqrt(room[row])
    left = white - hat @ white
    scale = np.repeat([np.sqrt(part @ part / 28.0) for part in np.split(left, 2)], 30)
    surprise = np.abs(left) / scale / np.sqrt(room)
    assert np.argmax(surprise) == row
    assert room.min() > MINIMUM_ROOM**2
    p = 2.0 * 60.0 * stats.t.sf(surprise[row], 28.0)
    scan = scan_beside(readings, baseline, [])
    assert scan(white[:, None])[-1, 0] == pytest.approx(math.log(p), abs=1e-6)


def test_a_family_is_judged_by_the_f_test_of_what_the_baseline_leaves_of_it(
    bench: BenchParameters, rng: np.random.Generator
) -> None:
    readings, baseline, white = a_scan_of(bench, rng)
    family = (baseline[:, 1] ** 2)[:, None]
    white += 0.8 * (family[:, 0] / np.abs(family).max()) ** 2
    whole = np.c_[baseline, family]
    rest = [white - b @ np.linalg.lstsq(b, white, rcond=None)[0] for b in (baseline, whole)]
    squares = [float(r @ r) for r in rest]
    p = stats.f.sf((squares[0] - squares[1]) / (squares[1] / 27.0), 1, 27)
    scan = scan_beside(readings, baseline, [family])
    assert scan(white[:, None])[0, 0] == pytest.approx(math.log(p), abs=1e-9)


def test_what_rows_hold_along_columns_set_aside_hides_no_structure_and_makes_none(rng: np.random.Generator) -> None:
    """The F test of a family is that of rows which hold nothing there; the excess along all counts it as noise."""
    n = 60
    family, aside, white = rng.standard_normal((n, 3)), rng.standard_normal((n, 2)), rng.standard_normal((n, 40))
    beyond = np.linalg.qr(np.hstack([family, aside]))[0][:, 3:]
    white -= beyond @ (beyond.T @ white)
    white[:, 0] += 0.4 * family[:, 0]
    evidence = Evidence(white[:, 0], np.zeros((n, 0)), [family], (np.ones(n, np.bool_),), white[:, 1:], excluded=aside)
    noisy = white + 30.0 * beyond[:, :1]
    scan = make_scan(evidence, evidence.baseline)
    squares = float(np.sum((np.linalg.qr(family)[0].T @ white[:, 0]) ** 2))
    variance = (white[:, 0] @ white[:, 0] - squares) / (n - 5.0)
    p = stats.f.sf(squares / 3.0 / variance, 3, n - 5)
    assert scan(noisy[:, :1])[0, 0] == pytest.approx(math.log(p), abs=1e-9)
    problems = (SimpleNamespace(baseline=evidence.baseline, left=left[:, 0]) for left in (white, noisy))
    plain, held = (adequacy_test(evidence)(cast("Any", problem)) for problem in problems)
    assert plain.excess == pytest.approx(squares / (variance * (n - 5.0) / (n - 3.0)) - 3.0, abs=1e-9)
    assert held.excess == 0.0
    assert held.p_value == plain.p_value


@given(st.integers(1, 200), st.floats(100.0, 1e5), st.floats(60.0, 270.0))
def test_the_tail_of_an_f_distribution_goes_on_where_numbers_end(k: int, dof: float, decades: float) -> None:
    """Its series is that of the distribution where both can be told, and a larger ratio is always less likely."""
    rarity = 10.0**-decades
    ratio = np.exp([optimize.brentq(lambda size: special.fdtrc(k, dof, math.exp(size)) / rarity - 1.0, 0.0, 700.0)])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scans, "LEAST_P", 1.0)
        series = scans._log_upper_tail(k, dof, ratio)
    assert series[0] == pytest.approx(-decades * math.log(10.0), rel=1e-3)
    larger = scans._log_upper_tail(k, dof, ratio[0] * np.geomspace(1.0, 1e6, 60))
    assert (np.diff(larger) < 0.0).all()


def test_an_effect_beyond_all_numbers_is_clearer_than_noise_that_is_beyond_them_too(rng: np.random.Generator) -> None:
    """A long record: one family in a hundred synthetic records, and one much stronger in the record."""
    n, column = 8000, np.ones((8000, 1))
    white = rng.standard_normal((n, 101))
    white[:, 0] += 5.0
    white[:, 1:] += 2.0
    evidence = Evidence(white[:, 0], np.zeros((n, 0)), [column], (np.ones(n, dtype=np.bool_),), white[:, 1:])
    (step,) = search(evidence, steps=1)
    assert step.p_value == pytest.approx(1.0 / 101.0)
    (weaker,) = search(replace(evidence, y=white[:, 1], null=white[:, [0, *range(2, 101)]]), steps=1)
    assert weaker.p_value > 1.5 / 101.0


@pytest.mark.parametrize(("part", "seen"), [(0.5 * ABSORBED, False), (2.0 * ABSORBED, True)])
def test_a_column_that_the_baseline_absorbs_is_not_looked_for(
    part: float, seen: bool, bench: BenchParameters, rng: np.random.Generator
) -> None:
    readings, baseline, white = a_scan_of(bench, rng)
    across = white - baseline @ np.linalg.lstsq(baseline, white, rcond=None)[0]
    inside = baseline[:, 0] / np.linalg.norm(baseline[:, 0])
    column = part * across / np.linalg.norm(across) + math.sqrt(1.0 - part**2) * inside
    scan = scan_beside(readings, baseline, [column[:, None]])
    assert bool(scan.bases[0].shape[1]) == seen
    assert (scan(white[:, None])[0, 0] < 0.0) == seen


@pytest.mark.parametrize(("off", "seen"), [(0.0, False), (0.05, True)])
def test_a_reading_far_from_all_others_is_set_aside(
    off: float, seen: bool, bench: BenchParameters, rng: np.random.Generator
) -> None:
    grid = neutral(rng)
    grid.torque_sun[17] += off
    fits = fits_of(grid)
    found = _far_off(grid, fits, noise_floor(grid, fits, bench), bench)
    assert (found is not None) == seen
    if found is not None:
        row, shaft, distance = found
        assert (row, shaft) == (17, "sun")
        assert distance == pytest.approx(off, abs=0.01)


def test_what_is_far_off_is_judged_by_the_room_that_the_structures_leave(
    bench: BenchParameters, rng: np.random.Generator
) -> None:
    """With the hat matrix worked out by another way; readings that it all but fixes are not judged."""
    grid = neutral(rng)
    fits = fits_of(grid)
    floor, readings, model = noise_floor(grid, fits, bench), take_readings(grid, bench), start_model(fits)
    scale = floor_scale(readings, bench, floor)
    columns = structured_columns(readings, bench, model) / scale[:, None]
    unit = columns[:, np.linalg.norm(columns, axis=0) > 0.0]
    unit = unit / np.linalg.norm(unit, axis=0)
    hat = unit @ np.linalg.pinv(unit, rcond=1e-6)
    y = (readings.torque - predict(readings, bench, model)) / scale
    left, room = y - hat @ y, 1.0 - np.diag(hat)
    assert room.min() < 0.5 < room.max()
    found, off = _surprises(readings, bench, model, floor)
    judged = room > MINIMUM_ROOM**2
    assert off[judged] == pytest.approx((left * scale / room)[judged], rel=1e-3, abs=1e-9)
    for mine in (readings.sun, ~readings.sun):
        dof = float(room[mine].sum()) - 1.0
        own = left[mine] ** 2 / np.maximum(room[mine], MINIMUM_ROOM**2)
        t = np.sqrt(own / ((float(left[mine] @ left[mine]) - own) / dof))
        wanted = np.where(room[mine] > MINIMUM_ROOM**2, 2.0 * stats.t.sf(t, dof), 1.0)
        assert found[mine] == pytest.approx(wanted, rel=1e-3)


def test_the_noise_that_follows_nothing_is_what_was_put_in(bench: BenchParameters, rng: np.random.Generator) -> None:
    """Though the structures take most of it along."""
    grids = [neutral(rng) for _ in range(24)]
    floors = [noise_floor(grid, fits_of(grid), bench) for grid in grids]
    for shafts in ([floor.sun for floor in floors], [floor.ring for floor in floors]):
        assert shafts[0].unstructured_dof < 0.5 * len(grids[0])
        assert np.sqrt(np.mean([noise.unstructured**2 for noise in shafts])) == pytest.approx(1e-3, rel=0.12)


# --- what a residual may follow --------------------------------------------------------------------------------


@given(power=st.floats(0.0, 50.0), constant=st.floats(60.0, 6000.0), step=st.floats(10.0, 4000.0))
def test_the_memory_of_a_power_is_its_weighted_mean(power: float, constant: float, step: float) -> None:
    time = step * np.arange(4.0)
    flat = _run_history(time, np.full(4, power), time, constant)
    assert flat == pytest.approx(power * (1.0 - np.exp(-time / constant)), rel=1e-9, abs=1e-12)
    pulse = _run_history(time, np.array([power, 0.0, 0.0, 0.0]), time, constant)
    assert pulse[1:] == pytest.approx(flat[1] * np.exp(-step * np.arange(3.0) / constant), rel=1e-9, abs=1e-12)
    assert _run_history(time, np.full(4, power), time + 0.5 * step, constant) == pytest.approx(flat)


def names(grid: Grid, bench: BenchParameters) -> set[tuple[str, str, tuple[str, ...]]]:
    model = start_model(fits_of(neutral(np.random.default_rng(1))))
    return {(f.signal, f.configuration, f.covariates) for f in families(take_readings(grid, bench), bench, model)}


@pytest.mark.parametrize(("zeros", "drift"), [(2, False), (3, True)])
def test_a_drift_of_the_zero_is_looked_for_from_three_zero_checks(
    zeros: int, drift: bool, bench: BenchParameters, rng: np.random.Generator
) -> None:
    assert (("torque_sun", "zero", ("order",)) in names(neutral(rng, zeros=zeros), bench)) == drift


def test_what_needs_the_order_is_looked_for_where_it_is_known(bench: BenchParameters, rng: np.random.Generator) -> None:
    with_it, without = (names(neutral(rng, ordered=known), bench) for known in (True, False))
    assert without < with_it
    assert {of[2][0] for of in with_it - without} == {"order", "run_history", "previous_point"}


@pytest.mark.parametrize("both", [True, False])
def test_the_power_flow_is_looked_for_where_it_goes_both_ways(
    both: bool, bench: BenchParameters, rng: np.random.Generator
) -> None:
    found = names(engaged(bench, rng, both_flows=both), bench)
    assert (("torque_sun", "engaged", ("power_flow", "load")) in found) == both
    assert not any(signal == "torque_ring" and where == "engaged" for signal, where, _ in found)


def test_a_covariate_that_cannot_be_tested_says_why(bench: BenchParameters, rng: np.random.Generator) -> None:
    grid = neutral(rng, ordered=False)
    readings, model = take_readings(grid, bench), start_model(fits_of(grid))
    found = looks(readings, bench, model)
    why = untested(readings, found, (), "sun")
    assert "own_speed" not in why
    assert why["time"] == why["approach"] == "not recorded: the order of the test is not known"
    assert why["load"] == "no engaged reading of this shaft in this fit"
    assert why["sign_own"] == why["sign_both"] == "constant on this grid"
    absorbed = tuple(look for look in found if look.covariate.id == "own_speed")
    assert untested(readings, found, absorbed, "sun")["own_speed"] == "the fit takes all of it"
    told = {look.covariate.id for look in found if look.family.signal == "torque_sun"}
    assert told.isdisjoint(why)
    assert told | set(why) == {covariate.id for covariate in COVARIATES}


def test_a_shape_is_the_mean_of_low_middle_and_high_values_or_of_each_sign(
    bench: BenchParameters, rng: np.random.Generator
) -> None:
    at = points("neutral", np.r_[RPM_SUN, -RPM_SUN], np.full(14, 200.0), started_at=1.7e9 + 60.0 * np.arange(14.0))
    grid = measured(at, np.sign(at.speed_sun) * 0.05, np.full(14, 0.1))
    readings, model = take_readings(grid, bench), start_model(fits_of(neutral(rng)))
    sun = {look.covariate.id: look for look in looks(readings, bench, model) if look.family.signal == "torque_sun"}
    speed = np.abs(readings.speed_own) / RPM
    low, middle, high = (value for _, value in sun["own_speed"].shape(speed))
    assert low == pytest.approx((150.0 + 400.0) / 2.0)
    assert middle == pytest.approx(1000.0)
    assert high == pytest.approx((1600.0 + 1850.0) / 2.0)
    assert dict(sun["sign_own"].shape(readings.speed_own)) == pytest.approx(
        {"backward": -RPM_SUN.mean() * RPM, "forward": RPM_SUN.mean() * RPM}
    )
    rising = dict(sun["approach"].shape(np.ones(len(readings))))
    assert set(rising) == {"unchanged", "rising", "falling"}


# --- noise beside a line ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("fall", [0.0, 1.0, 2.0])
def test_noise_beside_a_line_is_that_of_the_spectrum_there_whatever_its_fall(
    fall: float, rng: np.random.Generator
) -> None:
    at = np.arange(1, 2001, dtype=float)
    power = rng.exponential(size=(400, 2000)) * (at / 40.0) ** -fall
    found = noise_around(np.c_[np.zeros(400), power], emptied(2001, [40.0]), 40.0)
    assert found.power.mean() == pytest.approx(1.0, rel=0.04)
    line = rng.exponential(size=400)
    assert (np.sqrt(line) > found.band(FALSE_ALARM)).mean() == pytest.approx(FALSE_ALARM, abs=0.03)
    assert (found.dof > 20.0).all()


def test_another_line_beside_is_no_noise(rng: np.random.Generator) -> None:
    power = rng.exponential(size=(50, 1001))
    alone = noise_around(power, emptied(1001, [300.0]), 300.0)
    power[:, 307] = 100.0
    beside = noise_around(power, emptied(1001, [300.0]), 300.0)
    assert beside.power.mean() == pytest.approx(alone.power.mean(), rel=0.05)


def test_what_a_fit_has_emptied_and_too_few_neighbours_tell_nothing() -> None:
    gone = emptied(20, [10.0])
    assert np.flatnonzero(gone).tolist() == [0, 1, 8, 9, 10, 11, 12, 19]
    power = np.ones((2, 20))
    assert np.isfinite(noise_around(power, gone, 10.0).power).all()
    few = gone.copy()
    few[2 : 20 - FEWEST] = True
    assert np.isnan(noise_around(power, few, 10.0).power).all()
    assert np.isnan(noise_around(power, few, 10.0).band()).all()


def test_the_periodogram_is_the_squared_amplitude_of_a_wave(rng: np.random.Generator) -> None:
    n = 500
    wave = 0.7 * np.cos(2.0 * math.pi * 25.0 * np.arange(n) / n + 1.0)
    assert periodogram(wave[None])[0, 25] == pytest.approx(0.49, rel=1e-12)
    _, density = filters.periodogram(noise := rng.standard_normal(n), scaling="spectrum", detrend=False)
    assert periodogram(noise[None])[0, 1:-1] == pytest.approx(2.0 * density[1:-1], rel=1e-9)


# --- what a campaign can tell ----------------------------------------------------------------------------------


def test_sizes_that_are_seen_scale_with_the_noise_and_look_alikes_do_not(
    bench: BenchParameters, rng: np.random.Generator
) -> None:
    """Where power flows one way and no speed turns back, an offset of the reading is a drag."""
    whole = neutral(rng)
    at = joined(whole.points, engaged(bench, rng).points)
    grid = measured(at, np.full(len(at), 0.1), np.full(len(at), 0.1))
    model = start_model(fits_of(whole))

    def floor(u: float) -> NoiseFloor:
        one = ShaftNoise(u, 50.0, u, u, 20, u, 30.0, NO_CORRELATION, "")
        return NoiseFloor(one, one)

    quiet, loud = (audit_design(grid, bench, model, floor(u)) for u in (1e-3, 2e-3))
    for one, other in zip(quiet.visible, loud.visible, strict=True):
        assert one.candidate == other.candidate
        assert one.unseen == other.unseen
        if not one.unseen:
            assert other.size_50 == pytest.approx(2.0 * one.size_50, rel=1e-6)
            assert one.size_95 > one.size_50 > 0.0
        assert 0.0 <= one.absorbed <= 1.0 + 1e-9
    assert all(pair.correlation >= ALIKE for pair in quiet.alike)
    assert all(pair.correlation < ALIKE for pair in quiet.apart)
    sizes = [round(pair.correlation, DIGITS) for pair in quiet.apart]
    assert sizes == sorted(sizes, reverse=True)
    offset = next(
        v for v in quiet.visible if (v.candidate.identifier, v.candidate.shaft) == ("torque_zero_offset", "sun")
    )
    turned = replace(at, speed_sun=np.where(np.arange(len(at)) % 2, -1.0, 1.0) * at.speed_sun)
    both_ways = audit_design(replace(grid, points=turned), bench, model, floor(1e-3))
    seen = next(v for v in both_ways.visible if v.candidate == offset.candidate)
    assert seen.absorbed < offset.absorbed


# --- two campaigns ---------------------------------------------------------------------------------------------


def side_of(serial: str | None, nominal: float = 5.0) -> CampaignSide:
    one = None if serial is None else SimpleNamespace(serial=serial, nominal_torque=nominal)
    return cast("CampaignSide", SimpleNamespace(transducers={"sun": one, "ring": one}))


@pytest.mark.parametrize(
    ("a", "b", "stated", "same", "words"),
    [
        (("A1", 5.0), ("A1", 5.0), Transducers.AUTO, True, "the same (A1)"),
        (("A1", 5.0), ("B2", 5.0), Transducers.AUTO, False, "different (A1, B2)"),
        (("A1", 5.0), ("A1", 9.0), Transducers.AUTO, False, "other nominal torque or span"),
        ((None, 5.0), (None, 5.0), Transducers.AUTO, False, "not both campaigns name one"),
        (("A1", 5.0), ("B2", 5.0), Transducers.SAME, True, "as stated"),
        (("A1", 5.0), ("A1", 5.0), Transducers.DIFFERENT, False, "as stated"),
    ],
)
def test_transducers_are_the_same_where_serial_number_and_range_are(
    a: tuple[str | None, float], b: tuple[str | None, float], stated: Transducers, same: bool, words: str
) -> None:
    found = sharing(side_of(*a), side_of(*b), stated)
    assert (found.sun, found.ring) == (same, same)
    assert words in found.description


@pytest.mark.parametrize(
    ("stated", "left"), [(Transducers.SAME, [0.5, 3.0, 2.0]), (Transducers.DIFFERENT, [4.0, 3.0, 4.5, 2.0])]
)
def test_an_error_of_one_transducer_leaves_its_difference_and_a_tare_never_cancels(
    stated: Transducers, left: list[float]
) -> None:
    one = np.ones(1)
    gain = TransducerCause(one, 0.0 * one, "sensitivity of the sun transducer")
    tare = TransducerCause(one, 0.0 * one, "tare of the sun transducer")
    shared = sharing(side_of("A1"), side_of("B2"), stated)
    found = left_over(shared, ((gain, tare), np.array([[4.0, 3.0]])), ((gain, tare), np.array([[4.5, 2.0]])))
    assert sorted(np.abs(found[0])) == pytest.approx(sorted(np.abs(left)))


def test_changes_between_set_points_are_the_mean_of_both_models_and_err_by_half_their_difference(
    bench: BenchParameters, rng: np.random.Generator
) -> None:
    fits = fits_of(neutral(rng))

    def side(factor: float | None) -> CampaignSide:
        made = None
        if factor is not None:
            curves = [
                replace(fit, curve=LossCurve((0.0, 1.0), factor * np.array([0.02, 0.08]), reference, 200.0))
                for fit, reference in ((fits.sun, SPEED_REFERENCE_SUN), (fits.ring, SPEED_REFERENCE_RING))
            ]
            made = LossFits(*curves)
        return cast("CampaignSide", SimpleNamespace(analysis=SimpleNamespace(fits=made, calibration=None), bench=bench))

    start, end = points("neutral", [400.0], [200.0]), points("neutral", [410.0], [200.0])
    rise = 0.08 * 10.0 * RPM / SPEED_REFERENCE_SUN
    change, u = carried((side(1.0), side(3.0)), start, end)
    assert change["torque_sun"] == pytest.approx([2.0 * rise])
    assert np.abs(u["torque_sun"]) == pytest.approx([2.0 * rise / math.sqrt(12.0)])
    assert change["torque_ring"] == pytest.approx([0.0], abs=1e-15)
    change, u = carried((side(None), side(3.0)), start, end)
    assert change["torque_sun"] == pytest.approx([3.0 * rise])
    assert u["torque_sun"] == pytest.approx([3.0 * rise / math.sqrt(12.0)])
    assert carried((side(None), side(None)), start, end) == ({}, {})


# --- two windows -----------------------------------------------------------------------------------------------


def window(torque: float, u: float = 1e-3) -> dict[str, Any]:
    row: dict[str, Any] = {"seconds": 5.0, "sun_rpm": 900.0, "ring_rpm": None, "torque_ring_Nm": None}
    return row | {"torque_sun_Nm": torque, "u_torque_sun_Nm": u, "common_sun_Nm": 4e-3}


def difference_of(apart: float, *, same: bool, bench: BenchParameters) -> MeanDifference:
    sun = Transducer(10_000.0, 5.0, 5000.0, "A1")
    one = Calibration(sun, sun, 5120, 5120)
    calibrations = one, one if same else replace(one, sun=replace(sun, serial="B2"))
    found = mean_differences(window(1.0 + apart), window(1.0), calibrations, bench)
    return next(each for each in found if "torque" in each.name.lower())


def test_of_one_transducer_only_what_grows_with_the_difference_is_left(bench: BenchParameters) -> None:
    alike, other = (difference_of(0.0, same=same, bench=bench) for same in (True, False))
    assert alike.u == pytest.approx(math.hypot(1e-3, 1e-3))
    assert other.u == pytest.approx(math.sqrt(2.0) * math.hypot(1e-3, 4e-3))
    apart = difference_of(0.5, same=True, bench=bench)
    assert alike.u is not None
    assert apart.u is not None
    assert alike.u < apart.u
    assert apart.value == pytest.approx(0.5)
    assert apart.beyond
    assert not alike.beyond


@pytest.mark.parametrize(("apart", "beyond"), [(1.99, False), (2.01, True)])
def test_a_difference_is_told_beyond_twice_its_uncertainty(apart: float, beyond: bool, bench: BenchParameters) -> None:
    u = difference_of(0.0, same=False, bench=bench).u
    assert u is not None
    assert difference_of(apart * u, same=False, bench=bench).beyond == beyond


def test_windows_are_paired_by_their_point_and_documents_by_their_paths() -> None:
    a = cast("Any", SimpleNamespace(rows=({"point": "P1"}, {"point": "P2"}, {"point": "P1"})))
    b = cast("Any", SimpleNamespace(rows=({"point": "P1"}, {"point": "P3"})))
    alone = cast("Any", SimpleNamespace(rows=({"point": "P9"},)))
    pairs = [(one and one["point"], other and other["point"]) for one, other in paired(a, b)]
    assert pairs == [("P1", "P1"), ("P1", None), ("P2", None), (None, "P3")]
    assert len(list(paired(alone, cast("Any", SimpleNamespace(rows=({"point": "P1"},)))))) == 1
    one = {"rate_hz": 500, "run": {"gear": 1, "note": "x"}, "read_at": 1}
    other = {"rate_hz": 500, "run": {"gear": 2}, "read_at": 2}
    assert differing(one, other) == {"run.gear": (1, 2), "run.note": ("x", None)}


# --- words that depend on what there is --------------------------------------------------------------------------


def manifest(day: int, gear: int, seconds: float) -> Manifest:
    transducer = Transducer(10_000.0, 5.0, 5000.0, "A1")
    return Manifest(
        "x",
        run=RunRecord("c", gear=gear, started_at=f"2025-04-{day:02}T09:00:00+00:00", note=""),
        calibration=Calibration(transducer, replace(transducer, serial=""), 5120, 5120),
        rate_hz=500.0,
        windows=(replace(WINDOW, means=replace(WINDOW.means, duration=seconds)),),
    )


def test_conditions_tell_what_differs_and_what_nobody_wrote_down() -> None:
    rows = dict(conditions([manifest(2, 1, 5.0), manifest(1, 2, 7.5)]).rows)
    assert rows["Time of the test"].startswith("2025-04-01 09:00 to 2025-04-02 09:00 UTC")
    assert rows["Gear stage"] == "1, 2"
    assert rows["Length of a window"] == "5 to 7.5 s"
    assert rows["Transducer, ring"].endswith("no serial number")
    assert rows["Notes of the recorder"] == NOT_RECORDED
    assert all(rows[label] == NOT_RECORDED for label in UNRECORDED)
    many = dict(conditions([manifest(1, gear, 5.0) for gear in range(1, 7)]).rows)
    assert many["Gear stage"] == "1, 2, 3 and 3 more"
    assert many["Time of the test"] == "2025-04-01 09:00 UTC"
    nothing = dict(conditions([]).rows)
    assert set(nothing.values()) == {NOT_RECORDED}


def test_a_reason_is_told_of_a_figure_that_differs_and_a_note_of_any() -> None:
    assert remarks_on("steady.eta-magnetic", differs=False) == ()
    assert len(remarks_on("steady.eta-magnetic", differs=True)) == 1
    (damping,) = remarks_on("damping-0.80.c", differs=False)  # how it was found holds either way
    assert "Ruled out: least squares" in damping
    assert remarks_on("damping-0.80.c", differs=True)[0] == damping
    motor = remarks_on("chain.motor-sun", differs=False)
    assert len(motor) == 1
    assert "torque constant" in motor[0]
    assert remarks_on("no-such-figure", differs=True) == ()


@pytest.mark.parametrize(
    ("topic", "unit", "kind"),
    [
        ("/daq/torque_sun/frequency", "kHz", "frequency"),
        ("/daq/torque_sun/frequency", "Nm", "torque"),
        ("/daq/torque_sun/frequency", "Volt", "electric"),
        ("/daq/encoder_sun/count", "counts", "count"),
        ("/daq/encoder_sun/count", "1/min", "speed"),
        ("/daq/encoder_sun/count", "°", "angle"),
        ("/daq/lines", "-", "count"),
    ],
)
def test_a_unit_says_what_a_channel_is(topic: str, unit: str, kind: str) -> None:
    assert kind_of(topic, unit, "map.toml") == kind


@pytest.mark.parametrize(
    ("topic", "unit"), [("/daq/torque_sun/frequency", "rpm"), ("/daq/encoder_sun/count", "N m"), ("/daq/lines", "Hz")]
)
def test_a_unit_of_which_a_topic_is_not_made_is_refused(topic: str, unit: str) -> None:
    with pytest.raises(BenchError, match="unit"):
        kind_of(topic, unit, "map.toml")
    assert declared(f" {unit} ") == unit


# --- programmes in legs ------------------------------------------------------------------------------------------


@given(time=st.floats(0.0, 9.99))
def test_a_leg_gives_what_the_programme_says_with_its_rates(time: float) -> None:
    programme = Programme.ramp(3.0, 2.0, begin=1.0, start=-1.0).sweep(0.5, 4.0, 9.0, begin=4.0, over=4.0)
    legs = make_legs(programme, Programme.hold(1.0), 10.0)
    assert (np.diff(legs.ends) > 0.0).all()
    assert legs.ends[-1] == 10.0
    row = legs.rows[int(np.searchsorted(legs.ends, time, side="right"))]
    value, slope, bend = follow(row[0], time)
    assert value == pytest.approx(float(programme.value(time)), abs=1e-9)
    assert slope == pytest.approx(float(programme.slope(time)), abs=1e-9)
    assert follow(row[1], time) == (1.0, 0.0, 0.0)
    step = 1e-4
    if row[0][0] < time - step and time + step < legs.ends[int(np.searchsorted(legs.ends, time, side="right"))]:
        before, after = (follow(row[0], time + by)[1] for by in (-step, step))
        assert bend == pytest.approx((after - before) / (2.0 * step), abs=1e-4)


# --- near decisions ------------------------------------------------------------------------------------


class _Unmoved(WhitenedProblem[Fit[Any]]):
    """A problem whose candidates move nothing else."""

    def slopes(self, fit: Fit[Any]) -> Array:
        return np.zeros((len(self.left), 1))


@pytest.mark.parametrize(
    ("behind", "place"),
    [(0.0, "level"), (4e-7, "level"), (2e-6, "rival"), (9.9, "rival"), (10.0, "missed"), (10.9, "missed"), (11.1, "")],
)
def test_a_set_that_was_kept_behind_or_out_by_little_is_named(behind: float, place: str) -> None:
    """Equal to the decimals that count, within the margin, beside it by less than `NEAR`, or far from it."""
    problem = _Unmoved(np.zeros((100, 0)), np.zeros(100))
    gains = {"friction": 50.0, "windage": 50.0 - behind}
    best, other = (
        Explanation((Fit(SimpleNamespace(identifier=name), gain, 0.0, np.zeros(100), ()),), problem)
        for name, gain in gains.items()
    )
    rivals, shafts, missed = rivals_near(best, [best, other], MARGIN, 0.0)
    remainder = cast(Remainder, None)
    found = Naming(best, rivals, shafts, remainder, explained=True, in_the_main=True, weak=(), rounds=(), missed=missed)
    assert found.level == ((other,) if place == "level" else ())
    assert found.rivals == ((other,) if place in ("level", "rival") else ())
    assert [each.ids for each, _ in missed] == ([other.ids] if place == "missed" else [])
    assert [short for _, short in missed] == pytest.approx([behind - MARGIN] if place == "missed" else [])
