"""The load angle: from counts and index pulses, and how it follows the load."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.stats import t as student

from pmg.pipeline.orders.angle import Index
from pmg.pipeline.orders.load_angle import load_angle, wind_up
from pmg.sim.bench import BenchParameters, load_bench
from pmg.sim.errors import FitError
from pmg.sim.signals import REVOLUTION, RPM, Array

STEPS = {"sun": REVOLUTION / 5120, "ring": REVOLUTION / 5120}
T = np.arange(50_000) / 10_000.0


def locked(wound: Array | float, index: dict[str, Index | None], sun: Array | None = None) -> tuple[Array, Array]:
    """Counted angles of an engaged gear 1 that is wound up by this electrical angle, against the index pulses."""
    sun = 600.0 * RPM * T if sun is None else sun
    ring = (wound - 5.0 * sun) / 13.0
    zeros = [0.0 if place is None else place.angle for place in (index["sun"], index["ring"])]
    counted = [np.floor((a + z) / step) * step for a, z, step in zip((sun, ring), zeros, STEPS.values(), strict=True)]
    return counted[0], counted[1]


@settings(max_examples=30)
@given(wound=st.floats(-3.0, 3.0), sun=st.floats(0.0, 6.2), ring=st.floats(0.0, 6.2), turns=st.integers(-5, 5))
def test_the_angle_is_found_wherever_the_encoders_stand(wound: float, sun: float, ring: float, turns: int) -> None:
    index: dict[str, Index | None] = {"sun": Index(sun, 1e-4, 50, 0), "ring": Index(ring, 2e-4, 20, 0)}
    counted = locked(wound, index)
    found = load_angle(counted[0] + turns * REVOLUTION, counted[1], load_bench().gear1, STEPS, index)
    assert found.angle == pytest.approx(wound, abs=5.0 * found.u)
    assert found.u < 1e-3
    assert found.u_index == pytest.approx(math.hypot(5e-4, 26e-4))
    assert found.from_index
    assert abs(found.slipped) < 0.01


def test_without_index_pulses_a_change_within_a_file_is_known(bench: BenchParameters) -> None:
    none: dict[str, Index | None] = {"sun": None, "ring": None}
    light, heavy = (load_angle(*locked(wound, none), bench.gear1, STEPS, none) for wound in (0.1, 0.25))
    assert not light.from_index
    assert light.u_index == 0.0
    assert heavy.angle - light.angle == pytest.approx(0.15, abs=4.0 * math.hypot(light.u, heavy.u))


@pytest.mark.parametrize("memory", [0.004, 0.1])
def test_the_uncertainty_holds_where_the_noise_outlives_a_batch(
    bench: BenchParameters, rng: np.random.Generator, memory: float
) -> None:
    """Of 95 % intervals, about 95 % hold the truth; from the scatter of batches alone it were 77 % at a tenth."""
    none: dict[str, Index | None] = {"sun": None, "ring": None}
    time = np.arange(2000) / 400.0
    keep = math.exp(-1.0 / (len(time) * memory))
    held = 0
    for _ in range(150):
        push = rng.standard_normal(len(time)) * np.r_[1.0, np.full(len(time) - 1, math.sqrt(1.0 - keep**2))]
        wound = 0.3 + 0.02 * lfilter([1.0], [1.0, -keep], push)
        found = load_angle(*locked(wound, none, 617.3 * RPM * time), bench.gear1, STEPS, none)
        held += abs(found.angle - 0.3) <= found.u * float(student.ppf(0.975, found.dof))
    assert held >= 0.89 * 150


def test_the_mean_is_taken_over_whole_turns_of_the_sun(bench: BenchParameters) -> None:
    """An encoder off its centre, over ten turns and a half: half a turn more would shift the mean by its error."""
    none: dict[str, Index | None] = {"sun": None, "ring": None}
    sun = 10.5 * REVOLUTION * np.arange(20_000) / 20_000
    off = 0.05 * np.sin(sun)
    found = load_angle(*locked(0.3 + off, none, sun), bench.gear1, STEPS, none)
    assert found.angle == pytest.approx(0.3, abs=5e-4)
    assert abs(off.mean()) > 1e-3


def test_lost_poles_are_counted(bench: BenchParameters) -> None:
    none: dict[str, Index | None] = {"sun": None, "ring": None}
    wound = REVOLUTION * np.clip((T - 2.0) * 2.0, 0.0, 2.0)
    found = load_angle(*locked(wound, none), bench.gear1, STEPS, none)
    assert found.slipped == pytest.approx(2.0, abs=0.05)


def test_the_published_pull_out_torque_gives_one_and_a_weaker_magnet_more(
    bench: BenchParameters, rng: np.random.Generator
) -> None:
    gear = bench.gear1
    torque = np.repeat([0.78, 1.17, 1.56, 1.95], 3)
    u = np.full(len(torque), 2e-3)
    noise = u * rng.standard_normal(len(torque))
    for weaker in (1.0, 0.9):
        angle = 1.7 + np.arcsin(torque / (weaker * gear.pull_out_torque_ring)) + noise
        law = wind_up(torque, np.angle(np.exp(1j * angle)), u, gear)
        assert law.slope == pytest.approx(1.0 / weaker, abs=3.0 * law.u + 0.005)
        assert law.u < 0.02
        assert law.without_load == pytest.approx(1.7, abs=0.02)


@pytest.mark.parametrize(("told", "dof"), [(1.0, math.inf), (0.1, math.inf), (1.0, 3.0)])
def test_the_interval_of_the_slope_holds_the_truth_as_often_as_it_says(
    bench: BenchParameters, rng: np.random.Generator, told: float, dof: float
) -> None:
    """Of four points: uncertainties as they are, ten times too small, and each known from four values only.

    Twice the standard uncertainty would hold it in 82 % where the scatter of four points tells.
    """
    torque = np.array([0.78, 1.17, 1.56, 1.95])
    u, runs, held = 2e-3, 600, 0
    for _ in range(runs):
        given = u * np.sqrt(rng.chisquare(dof, 4) / dof) if math.isfinite(dof) else np.full(4, told * u)
        angle = np.arcsin(torque / bench.gear1.pull_out_torque_ring) + u * rng.standard_normal(4)
        law = wind_up(torque, angle, given, bench.gear1, dof)
        held += abs(law.slope - 1.0) <= law.reach
        assert law.reach > 1.9 * law.u
    assert held / runs >= 0.92


def test_loads_alike_are_no_test(bench: BenchParameters) -> None:
    torque = np.array([1.50, 1.51, 1.52])
    with pytest.raises(FitError, match=r"over which it should change by 0\.003"):
        wind_up(torque, np.zeros(3), np.full(3, 2e-3), bench.gear1)
