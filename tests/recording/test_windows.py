"""Windows: where they lie, and what speaks against them."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from pmg.pipeline.recording import Code, read_recording
from pmg.pipeline.reduce import PointMeans, reduce_window
from pmg.pipeline.steadiness import CHECKS
from pmg.pipeline.windows import Window, find_windows
from pmg.sim.signals import RPM

from .writer import Bench, write

DATA = Path(__file__).resolve().parent.parent / "data"
SET = {"sun_speed_rpm": 600.0}
TORQUE = "/daq/torque_sun/frequency"
STEPS = (
    (0, "A", "START", SET),
    (400, "A", "SETTLED", SET),
    (500, "A", "MEASURE", SET),
    (1500, "A", "END", SET),
    (1600, "B", "START", SET),
    (2000, "B", "MEASURE", SET),
    (3000, "B", "END", SET),
)


def judged(bench: Bench) -> tuple[tuple[Window, ...], tuple[PointMeans, ...]]:
    with TemporaryDirectory() as folder:
        recording = read_recording(write(Path(folder) / "a.mcap", bench))
    windows = find_windows(recording)
    return windows, tuple(reduce_window(recording.samples, w, recording.rate_hz) for w in windows)


def names(window: Window) -> list[str]:
    return [reason.partition(":")[0] for reason in window.reasons]


@pytest.mark.parametrize(
    ("file", "torque_sun", "torque_ring"),
    [("zero", 0.0, 0.0), ("neutral", 0.086208, 0.212739), ("engaged", 0.808259, 1.579520)],
)
def test_recorded_points_are_accepted_and_give_the_true_torque(
    file: str, torque_sun: float, torque_ring: float
) -> None:
    """Within four standard deviations of the wander between points, which the generator states as 1.06 mN m."""
    recording = read_recording(DATA / f"{file}.mcap")
    (window,) = find_windows(recording)
    means = reduce_window(recording.samples, window, recording.rate_hz)
    assert window.accepted, window.reasons
    assert window.started_at == recording.run.started_at
    assert means.sun.torque == pytest.approx(torque_sun, abs=4.3e-3)
    assert means.ring.torque == pytest.approx(torque_ring, abs=4.3e-3)
    assert means.sun.speed == pytest.approx(recording.run.setpoints.speed_sun, abs=0.01 * RPM)
    assert (window.rest_sun, window.rest_ring) == ((file == "zero"),) * 2
    assert means.n == 2500


def test_a_sequence_gives_one_window_for_each_measure_with_the_set_points_of_its_step() -> None:
    windows, means = judged(Bench(7.0, steps=STEPS))
    assert [(w.point, w.first_sample, w.stop_sample) for w in windows] == [("A", 500, 1500), ("B", 2000, 3000)]
    assert all(w.accepted for w in windows), [w.reasons for w in windows]
    assert all(w.setpoints.speed_ring is None for w in windows)
    assert (windows[1].started_at - windows[0].started_at).total_seconds() == 3.0
    assert [m.n for m in means] == [1000, 1000]


def test_an_open_measure_is_rejected_and_keeps_its_numbers() -> None:
    windows, means = judged(Bench(7.0, steps=STEPS[:3] + STEPS[4:]))
    assert [names(w) for w in windows] == [["window not closed"], []]
    assert windows[0].stop_sample == 1600
    assert means[0].sun.torque == pytest.approx(0.8, abs=1e-6)


def test_a_sequence_cut_inside_a_window_rejects_that_window_only() -> None:
    windows, _ = judged(Bench(5.5, steps=STEPS))
    assert [names(w) for w in windows] == [[], ["window too short"]]


def test_a_sequence_without_measure_gives_no_window_and_a_finding(tmp_path: Path) -> None:
    recording = read_recording(write(tmp_path / "a.mcap", Bench(7.0, steps=STEPS[:2])))
    assert find_windows(recording) == ()
    assert Code.STEP_MISSING in {f.code for f in recording.findings}


@pytest.mark.parametrize(
    ("bench", "reason"),
    [
        (Bench(0.8), "window too short"),
        (Bench(drop={TORQUE: (300, 400)}), "samples missing"),
        (Bench(drop={"/daq/encoder_ring/count": (300, 400)}), "samples missing"),
        (Bench(flags={TORQUE: {3: 1}}), "flagged by the recorder"),
        (Bench(lines=(300, 310)), "emergency stop"),
        (Bench(events=[(300, 1, 1), (310, 0, 1)]), "emergency stop"),
        (Bench(events=[(5000, 0, 1)]), "emergency stop"),
        (Bench(acceleration=5.0), "speed not settled"),
        (Bench(run={"sun_speed_set_rpm": "620"}), "speed off set-point"),
        (Bench(run={"ring_speed_set_rpm": "230"}), "speed off set-point"),
        (Bench(torque_slope=0.3), "torque not settled"),
        (Bench(torque={"sun": 5.2, "ring": 1.0}), "torque out of range"),
        (Bench(torque={"sun": 1.0, "ring": -10.4}), "torque out of range"),
    ],
)
def test_each_fault_is_named_alone_and_the_numbers_are_kept(bench: Bench, reason: str) -> None:
    (window,), (means,) = judged(bench)
    assert names(window) == [reason]
    assert not window.accepted
    assert np.isfinite([means.sun.torque, means.ring.torque, means.sun.speed, means.ring.speed]).all()


def test_every_check_is_tripped_by_one_of_the_faults_above() -> None:
    mark: Any = next(
        m
        for m in test_each_fault_is_named_alone_and_the_numbers_are_kept.pytestmark  # type: ignore[attr-defined]
        if m.name == "parametrize"
    )
    assert len({reason for _, reason in mark.args[1]}) == len(CHECKS)


@pytest.mark.parametrize(
    "bench",
    [
        Bench(speed={"sun": 0.003, "ring": 0.0}),
        Bench(1.0, speed={"sun": 0.1, "ring": -0.07}),
        Bench(ripple=0.5, ripple_hz=10.0),
        Bench(ripple=0.2, ripple_hz=0.9),
        Bench(acceleration=0.1),
        Bench(torque_slope=0.002),
        Bench(events=[(5000, 1, 1)]),
        Bench(events=[(5000, 2, 2), (300, 2, 2)]),
        Bench(run={"sun_speed_set_rpm": "601", "ring_speed_set_rpm": "-229"}),
    ],
)
def test_a_steady_point_is_accepted_in_spite_of_resolution_ripple_and_warming(bench: Bench) -> None:
    (window,), _ = judged(bench)
    assert window.accepted, window.reasons


def test_a_truncated_single_point_is_judged_over_what_all_channels_share() -> None:
    (window,), (means,) = judged(Bench(4.0, drop={TORQUE: (1500, 2000)}))
    assert (window.first_sample, window.stop_sample) == (0, 1500)
    assert window.accepted
    assert means.n == 1500


def test_a_shaft_is_at_rest_by_its_set_point_or_else_by_its_speed() -> None:
    by_set = judged(Bench(speed={"sun": 0.0, "ring": 1.0}, run={"ring_speed_set_rpm": "0"}))[0][0]
    assert (by_set.rest_sun, by_set.rest_ring) == (True, True)
    by_speed = judged(Bench(speed={"sun": 0.3, "ring": -1.0}))[0][0]
    assert (by_speed.rest_sun, by_speed.rest_ring) == (True, False)


def test_a_file_without_a_point_is_known_by_its_name(tmp_path: Path) -> None:
    recording = read_recording(write(tmp_path / "run_07.mcap", Bench(run={"point": None})))
    assert find_windows(recording)[0].point == "run_07"
