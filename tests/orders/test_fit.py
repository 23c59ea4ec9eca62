"""Lines of both shafts: planted ones are found with honest intervals, noise is not, laws hold."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.orders.coloured import coloured
from tests.orders.rows import row_of

from pmg.pipeline.orders.fit import Orders, fit_orders
from pmg.pipeline.orders.lines import Group, Line, lines_of, resolve
from pmg.sim.bench import BenchParameters, load_bench
from pmg.sim.errors import FitError
from pmg.sim.signals import REVOLUTION, RPM, Array, wrapped

RATE = 500.0
SAMPLES = 2500
STEP = REVOLUTION / 5120


def turning(sun_rpm: float, ring_rpm: float, start: float = 0.0, counted: bool = False) -> tuple[Array, Array]:
    """Angles of both shafts at these speeds [rad], in counts if so."""
    t = np.arange(SAMPLES) / RATE
    angles = sun_rpm * RPM * t + start, ring_rpm * RPM * t
    sun, ring = (np.floor(a / STEP) * STEP if counted else a for a in angles)
    return np.asarray(sun), np.asarray(ring)


def groups_at(bench: BenchParameters, sun_rpm: float, ring_rpm: float) -> tuple[Group, ...]:
    speeds = {"sun": sun_rpm * RPM, "ring": ring_rpm * RPM}
    return resolve(lines_of(bench, 1), speeds, SAMPLES / RATE, RATE)[0]


def placed(orders: Orders, name: str) -> int:
    return [group.name for group in orders.groups].index(name)


@pytest.mark.parametrize("kind", ["white", "slow", "pink"])
@pytest.mark.parametrize(("sun_rpm", "ring_rpm"), [(1872.0, -600.0), (331.7, -211.3), (90.0, -60.0), (780.0, -300.0)])
def test_noise_exceeds_its_band_in_five_per_cent_of_lines(
    bench: BenchParameters, rng: np.random.Generator, kind: str, sun_rpm: float, ring_rpm: float
) -> None:
    """About 2000 lines: one standard deviation of the rate is 0.5 %."""
    sun, ring = turning(sun_rpm, ring_rpm)
    found = fit_orders(coloured(kind, rng, 100, SAMPLES), sun, ring, groups_at(bench, sun_rpm, ring_rpm), RATE)
    known = np.isfinite(found.band)
    assert known.sum() > 1000
    assert 0.03 < found.beyond[known].mean() < 0.07


def test_planted_lines_are_found_and_the_intervals_cover(bench: BenchParameters, rng: np.random.Generator) -> None:
    """Both shafts at once, at speeds whose ratio is no fraction: amplitudes from nothing to 8 u, any phase."""
    inside, phases, shafts = [], [], []
    for _ in range(60):
        sun_rpm, ring_rpm = rng.uniform(200.0, 1900.0), -rng.uniform(100.0, 700.0)
        sun, ring = turning(sun_rpm, ring_rpm, rng.uniform(0.0, 6.0), counted=True)
        groups = groups_at(bench, sun_rpm, ring_rpm)
        amplitude, phase = rng.uniform(0.0, 0.25, len(groups)), rng.uniform(-math.pi, math.pi, len(groups))
        signal = coloured("slow", rng, 1, SAMPLES)[0] + sum(
            a * np.cos(g.lines[0].phase(sun, ring) + p) for a, p, g in zip(amplitude, phase, groups, strict=True)
        )
        found = fit_orders(signal[None], sun, ring, groups, RATE)
        low, high = found.interval
        known = np.isfinite(low[0])
        inside.append(((low[0] <= amplitude) & (amplitude <= high[0]))[known])
        strong = found.magnitude[0] > 2.0 * found.band[0]
        rows = [row_of(found, place) for place in np.flatnonzero(strong).tolist()]
        off = np.array([row.phase for row in rows]) - phase[strong]
        phases.append(np.abs(wrapped(off)) < 1.96 * np.array([row.u_phase for row in rows]))
        shafts += [g.lines[0].order_ring != 0 for g, s in zip(groups, strong, strict=True) if s]
    assert 0.93 < np.concatenate(inside).mean() < 0.975
    assert 0.92 < np.concatenate(phases).mean() < 0.98
    assert 0.2 < np.mean(shafts) < 0.8


@settings(max_examples=30)
@given(
    shift=st.floats(-math.pi, math.pi),
    order=st.sampled_from((1, 2, 5, 18)),
    amplitude=st.floats(0.1, 5.0),
    phase=st.floats(-math.pi, math.pi),
)
def test_another_zero_of_the_angle_turns_the_phase_and_nothing_else(
    shift: float, order: int, amplitude: float, phase: float
) -> None:
    bench = load_bench()
    sun, ring = turning(613.0, -241.0)
    noise = 0.01 * np.random.default_rng(3).standard_normal(SAMPLES)
    signal = (amplitude * np.cos(order * sun + phase) + noise)[None]
    groups = groups_at(bench, 613.0, -241.0)
    before, after = (fit_orders(signal, sun + by, ring, groups, RATE) for by in (0.0, shift))
    place = placed(before, f"sun {order}")
    assert np.allclose(after.magnitude, before.magnitude, rtol=1e-6, atol=1e-9)
    assert np.allclose(after.band, before.band, rtol=1e-6)
    was, turned = row_of(before, place).phase, row_of(after, place).phase
    assert abs(wrapped(np.array(turned - was + order * shift))) < 1e-6
    assert before.magnitude[0, place] == pytest.approx(amplitude, abs=2e-3)
    assert abs(wrapped(np.array(was - phase))) < 0.05


@settings(max_examples=20)
@given(a=st.floats(-3.0, 3.0), b=st.floats(0.1, 3.0), offset=st.floats(-10.0, 10.0), drift=st.floats(-1.0, 1.0))
def test_amplitudes_of_a_sum_are_the_sum_and_drift_is_no_line(a: float, b: float, offset: float, drift: float) -> None:
    bench = load_bench()
    sun, ring = turning(613.0, -241.0)
    x, y = np.random.default_rng(4).standard_normal((2, SAMPLES))
    slow = offset + drift * np.linspace(0.0, 1.0, SAMPLES) ** 2
    groups = groups_at(bench, 613.0, -241.0)
    of_x, of_y, of_sum = (fit_orders(s[None], sun, ring, groups, RATE) for s in (x, y, a * x + b * y + slow))
    assert np.allclose(of_sum.amplitude, a * of_x.amplitude + b * of_y.amplitude, atol=1e-9)


def test_the_length_of_the_pieces_does_not_matter(
    bench: BenchParameters, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    sun, ring = turning(613.0, -241.0)
    signals, groups = coloured("pink", rng, 2, SAMPLES), groups_at(bench, 613.0, -241.0)
    whole = fit_orders(signals, sun, ring, groups, RATE)
    monkeypatch.setattr("pmg.pipeline.orders.fit.PIECE", 301)
    pieces = fit_orders(signals, sun, ring, groups, RATE)
    assert np.allclose(pieces.amplitude, whole.amplitude, atol=1e-12)
    assert np.allclose(pieces.residual, whole.residual, atol=1e-12)
    assert np.allclose(pieces.band, whole.band, equal_nan=True)


@pytest.mark.parametrize("known", [("sun", "ring"), ("ring",)])
def test_steps_of_the_encoders_save_time_and_change_nothing(
    bench: BenchParameters, rng: np.random.Generator, known: tuple[str, ...]
) -> None:
    step = REVOLUTION / 512
    smooth = turning(613.0, -241.0, start=0.3)
    sun, ring = (0.7 * step + np.floor(angle / step) * step for angle in smooth)
    signals, groups = coloured("pink", rng, 2, SAMPLES), groups_at(bench, 613.0, -241.0)
    assert "slip" in {group.name for group in groups}
    steps = dict.fromkeys(known, step)
    looked_up, made = (fit_orders(signals, sun, ring, groups, RATE, each) for each in (steps, {}))
    assert np.allclose(looked_up.amplitude, made.amplitude, rtol=0.0, atol=1e-10 * np.abs(made.amplitude).max())
    assert np.allclose(looked_up.residual, made.residual, rtol=0.0, atol=1e-10 * np.abs(signals).max())
    off, same = (fit_orders(signals, *smooth, groups, RATE, each).amplitude for each in (steps, {}))
    assert np.array_equal(off, same)


def test_a_line_of_one_shaft_is_not_taken_for_the_others(bench: BenchParameters) -> None:
    """At 5.3 turns of the sun for one of the ring, over a window of no whole number of turns of either."""
    sun, ring = turning(521.3, -98.7)
    signal = (np.cos(18 * sun + 0.3) + 0.5 * np.cos(13 * ring - 1.0))[None]
    found = fit_orders(signal, sun, ring, groups_at(bench, 521.3, -98.7), RATE)
    strong = {"sun 18": 1.0, "ring 13": 0.5}
    for place, group in enumerate(found.groups):
        assert found.magnitude[0, place] == pytest.approx(strong.get(group.name, 0.0), abs=1e-9), group.name
    assert row_of(found, placed(found, "ring 13")).phase == pytest.approx(-1.0, abs=1e-9)


def test_an_unlisted_line_beside_does_not_count_as_noise(bench: BenchParameters, rng: np.random.Generator) -> None:
    sun, ring = turning(613.0, -241.0)
    quiet = 0.01 * rng.standard_normal((1, SAMPLES))
    groups = [g for g in groups_at(bench, 613.0, -241.0) if g.name in ("sun 1", "sun 5")]
    bands = [fit_orders(s, sun, ring, groups, RATE).band for s in (quiet, quiet + 0.05 * np.cos(5.5 * sun))]
    assert bands[1][0, 1] < 3.0 * bands[0][0, 1]


def test_a_shaft_that_stands_still_in_the_window_has_no_line() -> None:
    sun, _ = turning(613.0, -241.0)
    groups = (Group((Line(1, 0, ""),), 10.2), Group((Line(0, 1, ""),), 4.0))
    with pytest.raises(FitError, match="one in these samples"):
        fit_orders(np.ones((1, SAMPLES)), sun, np.zeros(SAMPLES), groups, RATE)
