"""Laws of the magnetic torque maps, analytic and imported: energy, period, reaction, pull-out, ratio."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.sim.bench import GearParameters, load_bench
from pmg.sim.errors import BenchError
from pmg.sim.maps.analytic import Cogging, analytic_map
from pmg.sim.maps.table import FemTable, Tolerances, fit_map
from pmg.sim.maps.torque_map import TorqueMap
from pmg.sim.shafts import Member
from pmg.sim.signals import REVOLUTION, Array

BENCH = load_bench()
GEARS = (BENCH.gear1, BENCH.gear2)


def rich_map(gear: GearParameters) -> TorqueMap:
    return analytic_map(gear, 1.0, {2: 0.04, 3: -0.1}, Cogging(0.05), Cogging(0.03))


RICH = tuple(map(rich_map, GEARS))
angle = st.floats(-10.0, 10.0)
maps = st.sampled_from(RICH)


@given(maps, st.lists(st.tuples(angle, angle, angle), min_size=2, max_size=4))
def test_the_work_over_a_closed_path_is_zero(torque_map: TorqueMap, corners: list[tuple[float, float, float]]) -> None:
    """Gauss-Legendre along each side of a polygon in the space of the three angles."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    work = 0.0
    for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
        a, b = np.array(start), np.array(end)
        pieces = math.ceil(float(np.abs(b - a).max()) * 60.0) + 1
        at = (np.arange(pieces)[:, None] + 0.5 + 0.5 * nodes).ravel() / pieces
        sun, ring, carrier = (a[i] + (b[i] - a[i]) * at for i in range(3))
        torques = torque_map.torques(sun, ring, carrier)
        along = torques.sun * (b - a)[0] + torques.ring * (b - a)[1] + torques.carrier * (b - a)[2]
        work += float(along @ np.tile(weights, pieces)) / (2 * pieces)
    assert work == pytest.approx(0.0, abs=1e-9)


@given(maps, angle, angle, angle)
def test_every_action_has_its_reaction(torque_map: TorqueMap, sun: float, ring: float, carrier: float) -> None:
    torques = torque_map.torques(np.array(sun), np.array(ring), np.array(carrier))
    assert torques.sun + torques.ring + torques.carrier == pytest.approx(0.0, abs=1e-12)


@given(maps, angle, angle, angle, angle)
def test_turning_all_three_members_together_changes_nothing(
    torque_map: TorqueMap, sun: float, ring: float, carrier: float, turn: float
) -> None:
    before = torque_map.torques(np.array(sun), np.array(ring), carrier)
    after = torque_map.torques(np.array(sun + turn), np.array(ring + turn), carrier + turn)
    np.testing.assert_allclose([after.sun, after.ring], [before.sun, before.ring], atol=1e-9)


@given(maps, angle, angle, st.integers(-3, 3), st.integers(-3, 3))
def test_periodic_in_the_magnets_of_both_rotors(torque_map: TorqueMap, sun: float, ring: float, i: int, j: int) -> None:
    before = torque_map.torques(np.array(sun), np.array(ring))
    moved_sun, moved_ring = i * REVOLUTION / torque_map.pole_pairs_sun, j * REVOLUTION / torque_map.pole_pairs_ring
    after = torque_map.torques(np.array(sun + moved_sun), np.array(ring + moved_ring))
    np.testing.assert_allclose([after.sun, after.ring], [before.sun, before.ring], atol=1e-9)


@given(maps, angle, angle, angle)
def test_torques_are_the_slopes_of_the_energy(torque_map: TorqueMap, sun: float, ring: float, carrier: float) -> None:
    at, step = np.array([sun, ring, carrier]), 1e-5
    moved = at[:, None, None] + step * np.stack([np.eye(3), -np.eye(3)], axis=1).transpose(2, 0, 1)
    energy = torque_map.potential(*moved)
    here = torque_map.torques(*at)
    slope = (energy[:, 0] - energy[:, 1]) / (2 * step)
    np.testing.assert_allclose([here.sun, here.ring, here.carrier], -slope, atol=1e-6)


@pytest.mark.parametrize("gear", GEARS, ids=["gear 1", "gear 2"])
@pytest.mark.parametrize("harmonics", [None, {3: 0.1}, {2: 0.2, 5: -0.05}], ids=str)
def test_pull_out_is_as_published_within_its_rounding(gear: GearParameters, harmonics: dict[int, float] | None) -> None:
    """All three published torques at once, whatever the shape, by brute force over the phase."""
    torque_map = analytic_map(gear, 1.0, harmonics)
    sun = np.linspace(0.0, REVOLUTION / torque_map.pole_pairs_sun, 20001)
    torques = torque_map.torques(sun, np.zeros_like(sun))
    for part, published in (
        (torques.sun, gear.pull_out_torque_sun),
        (torques.ring, gear.pull_out_torque_ring),
        (torques.carrier, gear.pull_out_torque_carrier),
    ):
        assert np.abs(part).max() == pytest.approx(float(published), abs=0.005)
    assert torque_map.pull_out.torque_high == pytest.approx(-torques.sun.min(), rel=1e-6)
    assert torque_map.pull_out.torque_low == pytest.approx(-torques.sun.max(), rel=1e-6)


def test_harmonics_are_shares_of_the_torque_not_of_the_energy() -> None:
    phase = np.linspace(0.0, REVOLUTION, 64, endpoint=False)
    torque, _ = analytic_map(BENCH.gear2, 1.0, {2: 0.2, 5: -0.05}).mean_torque(phase)
    amplitude = -np.fft.rfft(torque).imag
    np.testing.assert_allclose(amplitude[:7] / amplitude[1], [0.0, 1.0, 0.2, 0.0, 0.0, -0.05, 0.0], atol=1e-12)


@given(maps, angle, angle)
def test_without_cogging_the_torques_stand_in_the_speed_ratio(torque_map: TorqueMap, sun: float, ring: float) -> None:
    ratio = torque_map.pole_pairs_ring / torque_map.pole_pairs_sun
    coupling = analytic_map(GEARS[RICH.index(torque_map)], 1.0, {3: 0.1})
    torques = coupling.torques(np.array(sun), np.array(ring))
    assert torques.ring == pytest.approx(ratio * torques.sun, abs=1e-12)


@given(maps, st.floats(-0.999999, 0.999999), st.floats(0.2, 3.0))
def test_the_load_angle_carries_the_load_and_is_stable(torque_map: TorqueMap, share: float, scale: float) -> None:
    scaled = torque_map.scaled(scale)
    limits = scaled.pull_out
    load = share * (limits.torque_high if share > 0 else -limits.torque_low)
    torque, slope = scaled.mean_torque(scaled.load_angle(np.array([load])))
    assert torque[0] == pytest.approx(load, abs=1e-12)
    assert slope[0] > 0.0


@given(st.sampled_from(GEARS), st.floats(-0.99, 0.99))
def test_the_load_angle_of_a_sine_is_the_arc_sine(gear: GearParameters, share: float) -> None:
    plain = analytic_map(gear)
    assert plain.load_angle(np.array([share * plain.pull_out.torque_high]))[0] == pytest.approx(
        math.asin(share), abs=1e-9
    )


@given(maps, st.floats(-2.0, 2.0), angle)
def test_the_mean_torque_is_the_mean_over_a_turn_at_constant_phase(
    torque_map: TorqueMap, phase: float, at: float
) -> None:
    p_s, p_r = torque_map.pole_pairs_sun, torque_map.pole_pairs_ring
    turn = np.linspace(0.0, REVOLUTION, 2048, endpoint=False, dtype=np.float64)
    sun, ring = phase / p_s + p_r * (turn + at), -p_s * (turn + at)
    np.testing.assert_allclose(torque_map.phase(sun, ring), phase, atol=1e-9)
    held, _ = torque_map.mean_torque(np.array(phase))
    assert -torque_map.torques(sun, ring).sun.mean() == pytest.approx(float(held), abs=1e-9)


def test_a_load_above_pull_out_names_load_pull_out_and_point() -> None:
    with pytest.raises(BenchError, match=r"point 1: 2\.6 N m .* pull-out of 2\.569.* Reduce the load"):
        analytic_map(BENCH.gear1).load_angle(np.array([1.0, 2.6]))
    with pytest.raises(BenchError, match=r"pull-out of -1\.28"):
        analytic_map(BENCH.gear1, 0.5).load_angle(np.array([-1.3]))


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"scale": 0.0}, "map scale"),
        ({"scale": math.nan}, "map scale"),
        ({"harmonics": {0: 0.1}}, "harmonics"),
        ({"harmonics": {1: 0.5}}, "harmonics"),
        ({"harmonics": {3: math.inf}}, "harmonics"),
        ({"cogging_sun": Cogging(0.1, 0)}, "cogging"),
    ],
)
def test_numbers_that_make_no_map_are_refused(arguments: dict[str, object], named: str) -> None:
    with pytest.raises(BenchError, match=named):
        analytic_map(BENCH.gear1, **arguments)  # type: ignore[arg-type]  # one argument at a time


# --- imported tables -----------------------------------------------------------------------------------


def table_of(
    torque_map: TorqueMap, steps: tuple[int, int] = (40, 44), start: tuple[float, float] = (0.1, -0.2)
) -> FemTable:
    sun = start[0] + np.linspace(0.0, REVOLUTION / torque_map.pole_pairs_sun, steps[0] + 1)
    ring = start[1] + np.linspace(0.0, REVOLUTION / torque_map.pole_pairs_ring, steps[1] + 1)
    torques = torque_map.torques(sun[:, None], ring[None, :])
    return FemTable(sun, ring, torques.sun, torques.ring, "a.csv")


@pytest.mark.parametrize("number", [0, 1])
def test_an_imported_table_gives_back_the_map_it_was_made_of(number: int, rng: np.random.Generator) -> None:
    truth = RICH[number]
    fitted, quality = fit_map(table_of(truth), GEARS[number])
    sun, ring = rng.uniform(-5.0, 5.0, (2, 500))
    ours, theirs = fitted.torques(sun, ring), truth.torques(sun, ring)
    np.testing.assert_allclose(ours.sun, theirs.sun, atol=1e-9)
    np.testing.assert_allclose(ours.ring, theirs.ring, atol=1e-9)
    assert fitted.pull_out.torque_high == pytest.approx(truth.pull_out.torque_high, rel=1e-12)
    assert max(quality.edge, quality.curl, quality.rotational, quality.residual_max, quality.asymmetry) < 1e-11


@given(st.floats(0.02, 0.3), angle)
def test_a_phase_of_the_second_harmonic_is_the_asymmetry(share: float, shift: float) -> None:
    """W = -cos(x) + (h/2) sin(2 x) in the phase: the zero crossing moves, so the number is near h, not equal to it."""
    lopsided = replace(
        analytic_map(BENCH.gear1, 1.0, {2: 0.0}), sine=np.array([0.0, share * 0.5 * 0.514]), origin="lopsided"
    )
    _, quality = fit_map(table_of(lopsided, (20, 20), (shift, shift)), BENCH.gear1)
    assert 0.4 * share < quality.asymmetry < 1.5 * share


def test_what_the_map_cannot_explain_is_the_residual(rng: np.random.Generator) -> None:
    clean = table_of(RICH[0])
    noise = rng.normal(0.0, 0.01, (2, *clean.torque_sun.shape))
    noise[:, -1, :], noise[:, :, -1] = noise[:, 0, :], noise[:, :, 0]
    noise[:, -1, -1] = noise[:, 0, 0]
    noisy = replace(clean, torque_sun=clean.torque_sun + noise[0], torque_ring=clean.torque_ring + noise[1])
    whole, full = fit_map(noisy, BENCH.gear1)
    smooth, few = fit_map(noisy, BENCH.gear1, orders=(3, 3))
    assert 0.003 < full.residual_rms < 0.01 < few.residual_rms < 0.06
    assert len(smooth.cosine) == 24 < len(whole.cosine)
    assert smooth.pull_out.torque_high == pytest.approx(2.5694, abs=2e-3)


@given(st.floats(0.04, 0.5), st.sampled_from((1.0, -1.0)))
def test_a_ring_torque_of_another_scale_is_not_conservative(excess: float, sign: float) -> None:
    good = table_of(analytic_map(BENCH.gear1), (16, 16))
    with pytest.raises(BenchError, match=r"a\.csv at sun .*, ring .* degrees: .* that no energy explains"):
        fit_map(replace(good, torque_ring=good.torque_ring * (1.0 + sign * excess)), BENCH.gear1)


def test_a_torque_that_would_give_work_in_every_period_is_refused_and_its_size_told() -> None:
    good = table_of(analytic_map(BENCH.gear1), (16, 16))
    biased = replace(good, torque_sun=good.torque_sun + 0.2)
    with pytest.raises(BenchError, match=r"0\.2 N m that no energy explains"):
        fit_map(biased, BENCH.gear1)
    _, quality = fit_map(biased, BENCH.gear1, tolerances=Tolerances(rotational=0.1))
    rms = math.sqrt(float(np.mean(biased.torque_sun[:-1, :-1] ** 2 + biased.torque_ring[:-1, :-1] ** 2)))
    assert quality.rotational == pytest.approx(0.2 / rms, rel=1e-9)


def test_what_little_the_ends_of_a_period_differ_by_is_shared_between_them() -> None:
    good = table_of(analytic_map(BENCH.gear1), (16, 16))
    torque = good.torque_ring.copy()
    along = np.linspace(0.0, REVOLUTION, 17)
    torque[[0, -1], :] += 0.02 * np.array([[1.0], [-1.0]]) * np.sin(along)
    torque[:, [0, -1]] += 0.01 * np.array([1.0, -1.0]) * np.sin(along)[:, None]
    fitted, quality = fit_map(replace(good, torque_ring=torque), BENCH.gear1)
    clean, _ = fit_map(good, BENCH.gear1)
    assert quality.edge == pytest.approx(0.04, abs=1e-9)
    np.testing.assert_allclose(fitted.cosine, clean.cosine, atol=1e-12)
    np.testing.assert_allclose(fitted.sine, clean.sine, atol=1e-12)


def test_an_open_period_is_named_with_place_and_size() -> None:
    good = table_of(analytic_map(BENCH.gear1), (16, 16), (0.0, 0.0))
    torque = good.torque_sun.copy()
    torque[-1, 3] += 0.3
    with pytest.raises(BenchError, match=r"sun torque at sun 72, ring 5\.192 degrees: differs by 0\.3 N m"):
        fit_map(replace(good, torque_sun=torque), BENCH.gear1)


def test_the_table_of_the_other_gear_is_refused() -> None:
    with pytest.raises(BenchError, match=r"sun angle: a span of 72 degrees; expected 51\.4286 degrees"):
        fit_map(table_of(RICH[0]), BENCH.gear2)


def test_a_ring_counted_the_other_way_is_found() -> None:
    good = table_of(analytic_map(BENCH.gear1), (16, 16), (0.0, 0.0))
    turned = replace(good, torque_sun=good.torque_sun[:, ::-1], torque_ring=-good.torque_ring[:, ::-1])
    with pytest.raises(BenchError, match="Reverse the ring angle"):
        fit_map(turned, BENCH.gear1)


def spoilt(table: FemTable, what: str) -> FemTable:
    torque, angles = table.torque_ring.copy(), table.angle_sun.copy()
    if what == "hole":
        torque[2, 5] = np.nan
    elif what == "uneven":
        angles[4] += 0.01
    elif what == "short":
        return FemTable(angles[:4], table.angle_ring, table.torque_sun[:4], torque[:4], table.origin)
    elif what == "shape":
        torque = torque[:-1]
    elif what == "zero":
        torque = torque * 0.0
    return replace(table, angle_sun=angles, torque_ring=torque)


@pytest.mark.parametrize(
    ("what", "told"),
    [
        ("hole", "ring torque at sun .*: no number"),
        ("uneven", "in row 4; expected .* even steps"),
        ("short", "4 values; expected 6 or more"),
        ("shape", r"an array of \(16, 17\)"),
        ("zero", "zero everywhere"),
    ],
)
def test_a_spoilt_table_is_refused(what: str, told: str) -> None:
    with pytest.raises(BenchError, match=told):
        fit_map(spoilt(table_of(analytic_map(BENCH.gear1), (16, 16)), what), BENCH.gear1)


def test_more_harmonics_than_the_steps_resolve_are_refused() -> None:
    with pytest.raises(BenchError, match=r"orders: \(9, 3\); expected 1 to \(7, 7\)"):
        fit_map(table_of(analytic_map(BENCH.gear1), (16, 16)), BENCH.gear1, orders=(9, 3))


# --- one member held -----------------------------------------------------------------------------------


@given(st.sampled_from((0, 1)), st.sampled_from(tuple(Member)), angle, angle)
def test_members_that_turn_in_their_ratio_keep_the_phase_and_the_energy(
    number: int, held: Member, turn: float, start: float
) -> None:
    gear, torque_map = GEARS[number], analytic_map(GEARS[number], 1.0, {3: 0.1})
    p_s, p_r = float(gear.pole_pairs_sun), float(gear.pole_pairs_ring)
    weight = {Member.SUN: p_s, Member.RING: p_r, Member.CARRIER: -(p_s + p_r)}
    first, second = (member for member in Member if member is not held)
    speed = {held: 0.0, first: 1.0, second: -weight[first] / weight[second]}

    def energy(by: float) -> Array:
        sun, ring, carrier = (speed[member] * by for member in Member)
        return torque_map.potential(np.array(start + sun), np.array(ring), carrier)

    assert energy(turn) == pytest.approx(energy(0.0), abs=1e-9)
