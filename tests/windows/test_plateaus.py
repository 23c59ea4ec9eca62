"""Plateaus of a recording without test steps, steadiness of torque, limits from a file."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.recording.writer import Bench, write

from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.windows.limits import LIMITS
from pmg.pipeline.windows.limits_file import _read_limits, chosen_limits
from pmg.pipeline.windows.plateaus import plateaus
from pmg.pipeline.windows.steadiness import _torque_changes
from pmg.pipeline.windows.window import Window
from pmg.pipeline.windows.windows import find_windows
from pmg.sim.errors import RecordingError
from pmg.sim.signals import RPM

RATE = 100.0
NOMINAL = 5.0


def levels(lengths: list[float], speeds: list[float], torques: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Torque [N m] and angle [rad] that hold each level [N m], [rpm] for a time [s]."""
    counts = [round(length * RATE) for length in lengths]
    speed = np.repeat(np.array(speeds) * RPM, counts)
    return np.repeat(torques, counts), np.concatenate(([0.0], np.cumsum(speed[:-1]))) / RATE


def found(torque: np.ndarray, angle: np.ndarray) -> tuple[tuple[int, int], ...]:
    return plateaus([(torque, NOMINAL)], [angle], RATE, LIMITS)


def test_each_level_of_speed_or_torque_is_a_plateau() -> None:
    torque, angle = levels([10, 12, 8], [600, 600, 900], [0.5, 1.0, 1.0])
    spans = [(start / RATE, stop / RATE) for start, stop in found(torque, angle)]
    expected = [(0.0, 10.0), (10.0, 22.0), (22.0, 30.0)]
    assert len(spans) == 3
    for (start, stop), (low, high) in zip(spans, expected, strict=True):
        assert low <= start < stop <= high
        assert (stop - start) > (high - low) - 2.0 * LIMITS.step_beside - LIMITS.settle - 0.2


@settings(max_examples=30)
@given(noise=st.floats(0.0, 0.1), part=st.floats(0.3, 0.7), seed=st.integers(0, 1000))
def test_noise_within_a_plateau_moves_no_border(noise: float, part: float, seed: int) -> None:
    """Noise of part of a level only: a rule that looked for quiet stretches would cut there."""
    torque, angle = levels([20, 20], [600, 1200], [0.5, 0.5])
    rng = np.random.default_rng(seed)
    rough = rng.standard_normal(round(part * 1000)) * noise
    rough -= rough.mean()
    noisy = torque.copy()
    noisy[200 : 200 + len(rough)] += rough
    assert found(noisy, angle) == found(torque, angle)


@settings(max_examples=30)
@given(shift=st.floats(-3.0, 3.0), sign=st.sampled_from([-1.0, 1.0]))
def test_plateaus_follow_changes_and_not_levels(shift: float, sign: float) -> None:
    torque, angle = levels([6, 7, 8], [600, 900, 900], [0.5, 0.5, 0.9])
    assert found(sign * torque + shift, sign * angle) == found(torque, angle)


def test_a_gap_shorter_than_the_stretch_beside_is_part_of_its_plateau_and_a_longer_one_ends_it() -> None:
    torque, angle = levels([20], [600], [0.5])
    short, long = torque.copy(), torque.copy()
    short[900:950] = np.nan
    long[900:1150] = np.nan
    assert len(found(short, angle)) == 1
    assert len(found(long, angle)) == 2


@settings(max_examples=20)
@given(ripple=st.floats(0.1, 0.5), start=st.floats(0.0, 6.0), change=st.sampled_from([0.0, 0.5, -0.5]))
def test_ripple_of_a_slow_shaft_is_no_change_of_torque(ripple: float, start: float, change: float) -> None:
    """20 rpm: one turn takes 3 s, three times the stretch beside. A change in the middle is found all the same."""
    torque, angle = levels([15, 15], [20, 20], [0.5, 0.5 + change])
    spans = found(torque + ripple * np.sin(angle + start), angle)
    if not change:
        assert spans == ((0, 3000),)
        return
    assert len(spans) == 2
    assert (spans[0][0], spans[1][1]) == (0, 3000)
    assert 1150 <= spans[0][1] <= 1500 <= spans[1][0] <= 1950


def test_a_short_recording_is_one_stretch() -> None:
    torque, angle = levels([1.5], [600], [0.5])
    assert found(torque, angle) == ((0, 150),)
    assert plateaus([(np.empty(0), NOMINAL)], [np.empty(0)], RATE, LIMITS) == ()


def windows(tmp_path: Path, bench: Bench) -> tuple[Window, ...]:
    return find_windows(read_recording(write(tmp_path / "long.mcap", bench)))


TORQUE = "/daq/torque_sun/frequency"


def stepped(frequency: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Half a newton metre more from the middle on, at 1000 Hz a newton metre."""
    return frequency + np.where(np.arange(len(frequency)) >= len(frequency) // 2, 500.0, 0.0)


def test_a_long_recording_without_a_point_gives_numbered_windows_good_or_not(tmp_path: Path) -> None:
    """Samples of the second level are lost: the window keeps its borders and is rejected whole."""
    clean = Bench(16.0, run={"point": None}, spoil={TORQUE: stepped})
    first, change, second = windows(tmp_path, clean)
    assert (change.point, change.first_sample, change.stop_sample) == (
        "long-change-01",
        first.stop_sample,
        second.first_sample,
    )
    assert change.reasons == (
        f"set-points changing: samples {change.first_sample} to {change.stop_sample} belong to no plateau",
    )
    assert (first.point, second.point) == ("long-01", "long-02")
    assert first.accepted, first.reasons
    assert second.accepted, second.reasons
    hurt = windows(tmp_path, replace(clean, drop={TORQUE: (6000, 6100)}))
    assert [(w.first_sample, w.stop_sample) for w in hurt] == [
        (w.first_sample, w.stop_sample) for w in (first, change, second)
    ]
    assert [w.accepted for w in hurt] == [True, False, False]
    assert hurt[2].reasons[0].startswith("samples missing")


@settings(max_examples=15)
@given(lengths=st.lists(st.floats(0.5, 8.0), min_size=1, max_size=4), seed=st.integers(0, 100))
def test_every_sample_of_a_file_without_a_point_lies_in_one_window(lengths: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    seconds = 1.0 + math.fsum(lengths)
    level = np.repeat(
        rng.uniform(-3000.0, 3000.0, len(lengths) + 1), np.rint(np.array([*lengths, 1.0]) * 500).astype(int)
    )
    shift = np.zeros(round(seconds * 500))
    shift[: min(len(level), len(shift))] = level[: len(shift)]
    with TemporaryDirectory() as folder:
        told = windows(Path(folder), Bench(seconds, run={"point": None}, spoil={TORQUE: lambda v: v + shift[: len(v)]}))
    borders = [(w.first_sample, w.stop_sample) for w in told]
    assert borders[0][0] == 0
    assert borders[-1][1] == len(shift)
    assert all(stop == start for (_, stop), (start, _) in pairwise(borders))


def test_a_file_that_names_its_point_is_one_window_and_a_step_in_it_rejects_it(tmp_path: Path) -> None:
    (window,) = windows(tmp_path, Bench(16.0, spoil={TORQUE: stepped}))
    assert not window.accepted
    assert window.reasons[0].startswith("torque not settled")


BATCHES = 10


@settings(max_examples=60)
@given(
    kind=st.sampled_from(["drift", "step", "stray"]),
    place=st.integers(2, 7),
    shift=st.floats(-5.0, 5.0),
    size=st.sampled_from([-1.0, 1.0]),
    seed=st.integers(0, 10_000),
)
def test_a_drift_a_step_and_a_stray_batch_stand_out_of_the_noise(
    kind: str, place: int, shift: float, size: float, seed: int
) -> None:
    """Of 40 standard deviations of a batch: more than eight standard errors in one of the three."""
    means = np.random.default_rng(seed).standard_normal(BATCHES)
    at = np.arange(BATCHES)
    shape = {"drift": at / BATCHES, "step": at >= place, "stray": at == place}[kind]
    changed = _torque_changes(shift + means + 40.0 * size * shape)
    assert max(abs(change) / error for _, change, error in changed) > LIMITS.torque_drift_sigmas


def test_noise_alone_seldom_stands_out(rng: np.random.Generator) -> None:
    """Of 2000 windows whose limit is so low that only the standard error holds, fewer than 1 in 100."""
    tripped = 0
    for _ in range(2000):
        changes = _torque_changes(rng.standard_normal(BATCHES))
        tripped += any(abs(change) > LIMITS.torque_drift_sigmas * error for _, change, error in changes)
    assert tripped < 20


@given(scale=st.floats(1e-3, 1e3), shift=st.floats(-10.0, 10.0), seed=st.integers(0, 1000))
def test_changes_scale_with_the_torque_and_know_no_level(scale: float, shift: float, seed: int) -> None:
    means = np.random.default_rng(seed).standard_normal(BATCHES)
    for (_, change, error), (_, scaled, of_scaled) in zip(
        _torque_changes(means), _torque_changes(scale * means + shift), strict=True
    ):
        assert scaled == pytest.approx(scale * change, rel=1e-6, abs=1e-9)
        assert of_scaled == pytest.approx(scale * error, rel=1e-6, abs=1e-9)


def test_limits_come_from_a_file_speeds_in_rpm(tmp_path: Path) -> None:
    path = tmp_path / "limits.toml"
    path.write_text("[windows]\nspeed_change_rpm = 2\ntorque_drift = 0.002\nparts = 5\nsettle = 0\n", encoding="utf-8")
    limits = _read_limits(path)
    assert limits.speed_change == pytest.approx(2.0 * 2.0 * math.pi / 60.0)
    assert (limits.torque_drift, limits.parts, limits.settle) == (0.002, 5, 0.0)
    assert limits.speed_offset == LIMITS.speed_offset


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("speed_change_rpm = 2", "one table"),
        ("[windows]\nspeed_change = 2", "speed_change_rpm"),
        ("[windows]\ntorque_drift = -1", "above 0"),
        ("[windows]\ntorque_drift = true", "a finite number"),
        ("[windows]\ntorque_drift = nan", "a finite number"),
        ("[windows]\nparts = 2.5", "a whole number"),
        ("[windows", "line 1"),
    ],
)
def test_a_limit_that_is_none_is_refused(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "limits.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=told):
        _read_limits(path)


def test_no_limit_given_is_the_default() -> None:
    assert chosen_limits(None) == LIMITS
