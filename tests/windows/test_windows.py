"""Windows: where they lie, and what speaks against them."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from tests.recording.damages import CHUNK, of_kind, recorded, rewritten
from tests.recording.writer import Bench, write

from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.means import PointMeans
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.windows.reduce import reduce_window
from pmg.pipeline.windows.steadiness import CHECKS
from pmg.pipeline.windows.window import Window
from pmg.pipeline.windows.windows import find_windows
from pmg.sim.signals import RPM

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


def test_a_sequence_without_measure_gives_a_rejected_window_and_a_finding(tmp_path: Path) -> None:
    recording = read_recording(write(tmp_path / "a.mcap", Bench(7.0, steps=STEPS[:2])))
    (window,) = find_windows(recording)
    assert (window.point, window.first_sample, window.stop_sample) == ("A", 0, 3500)
    assert names(window) == ["not measured"]
    assert window.setpoints.speed_sun == pytest.approx(600.0 * RPM)
    assert Code.STEP_MISSING in {f.code for f in recording.findings}


@pytest.mark.parametrize(
    ("lost", "span"),
    [({5}, (1600, 2500)), ({4, 5}, (1500, 3000)), ({5, 6}, (1600, 3500))],
)
def test_a_point_whose_measure_was_lost_is_a_rejected_window(lost: set[int], span: tuple[int, int]) -> None:
    """Of MEASURE alone, with its START, with its END; the other point stands."""
    steps = tuple(step for place, step in enumerate(STEPS) if place not in lost)
    if lost == {5}:
        steps = (*steps[:-1], (2500, "B", "END", SET))
    windows, means = judged(Bench(7.0, steps=steps))
    assert [(w.point, names(w)) for w in windows] == [("A", []), ("B", ["not measured"])]
    assert (windows[1].first_sample, windows[1].stop_sample) == span
    assert len(means) == 2


def test_a_long_gap_in_a_sequence_that_took_the_steps_with_it_is_a_rejected_window() -> None:
    everywhere = ("/daq/torque_sun/frequency", "/daq/torque_ring/frequency", "/daq/encoder_sun/count")
    gap = dict.fromkeys((*everywhere, "/daq/encoder_ring/count"), (1600, 3100))
    windows, _ = judged(Bench(8.0, steps=STEPS[:4], drop=gap))
    assert [(w.point, names(w)) for w in windows] == [("A", []), ("a-gap-01", ["gap", "samples missing"])]
    assert (windows[1].first_sample, windows[1].stop_sample) == (1600, 3100)
    assert "samples 1600 to 3100" in windows[1].reasons[0]
    short = dict.fromkeys(gap, (1600, 2000))
    assert [w.point for w in judged(Bench(8.0, steps=STEPS[:4], drop=short))[0]] == ["A"]


def test_missing_samples_are_told_with_their_place() -> None:
    (window,), _ = judged(Bench(4.0, drop={TORQUE: (300, 400)}, first_sample=5000))
    assert window.reasons == ("samples missing: samples 5300 to 5400 in torque_sun",)


def test_a_torque_without_any_value_is_the_reason_and_not_a_short_window() -> None:
    nothing = {TORQUE: lambda v: np.full(len(v), np.nan)}
    (window,), (means,) = judged(Bench(4.0, spoil=nothing))
    assert window.reasons == ("samples missing: all samples, 0 to 2000, in torque_sun",)
    assert np.isnan(means.sun.torque)


def test_an_emergency_stop_is_told_at_its_sample_where_inputs_were_sampled_in_part_only() -> None:
    (window,), _ = judged(Bench(4.0, lines=(1500, 1510), drop={"/daq/lines": (0, 400)}))
    assert window.reasons == ("emergency stop: pressed at sample 1500",)


SMALL = 2048
"""Chunks of so many bytes [bytes]: the channels of a file that is cut then end at about the same sample."""


@pytest.mark.parametrize("part", [0.3, 0.45, 0.6, 0.75, 0.85])
def test_a_single_point_that_lost_its_end_is_rejected_or_says_so(tmp_path: Path, part: float) -> None:
    whole = rewritten(recorded(Bench(8.0)), chunk_size=SMALL)
    path = tmp_path / "a.mcap"
    path.write_bytes(whole[: round(part * len(whole))])
    recording = read_recording(path)
    (window,) = find_windows(recording)
    assert window.stop_sample < 4000
    assert any("the file lost data (container.truncated" in reason for reason in window.reasons)


def test_a_single_point_whose_last_chunks_are_lost_is_held_against_the_counted_messages(tmp_path: Path) -> None:
    whole = bytearray(rewritten(recorded(Bench(8.0)), chunk_size=SMALL))
    chunks = of_kind(bytes(whole), CHUNK)
    for start, stop in chunks[-len(chunks) // 4 :]:
        whole[(start + stop) // 2] ^= 0xFF
    path = tmp_path / "a.mcap"
    path.write_bytes(whole)
    (window,) = find_windows(read_recording(path))
    assert names(window)[0] == "window too short"
    lost = re.search(r"samples (\d+) to (\d+) are missing", window.reasons[0])
    assert lost is not None
    assert int(lost[1]) == window.stop_sample
    assert int(lost[2]) == pytest.approx(4000, abs=50)


@pytest.mark.parametrize(
    ("bench", "reason"),
    [
        (Bench(0.8), "window too short"),
        (Bench(drop={TORQUE: (300, 400)}), "samples missing"),
        (Bench(drop={"/daq/encoder_ring/count": (300, 400)}), "samples missing"),
        (Bench(flags={TORQUE: {3: 1}}), "flagged by the recorder"),
        (Bench(seconds=4.0, with_index=True, index_slip=300), "found faulty"),
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


CHANNELS = {
    "/daq/torque_sun/frequency": "torque_sun",
    "/daq/torque_ring/frequency": "torque_ring",
    "/daq/encoder_sun/count": "angle_sun",
    "/daq/encoder_ring/count": "angle_ring",
}


@pytest.mark.parametrize(("topic", "column"), CHANNELS.items())
@pytest.mark.parametrize("steps", [(), STEPS])
def test_a_channel_that_was_not_recorded_is_the_reason_and_the_other_shaft_keeps_its_numbers(
    topic: str, column: str, steps: tuple[Any, ...]
) -> None:
    """The torque and speed of the other shaft are to the bit those of a recording that has all."""
    bench = Bench(6.1, steps=steps)
    windows, means = judged(replace(bench, without=frozenset({topic})))
    whole, full = judged(bench)
    kind, _, side = column.partition("_")
    assert [w.reasons for w in windows] == [(f"channel missing: {side} {kind} not recorded",)] * (2 if steps else 1)
    assert [(w.first_sample, w.stop_sample) for w in windows] == [(w.first_sample, w.stop_sample) for w in whole]
    for lacking, complete in zip(means, full, strict=True):
        other = "ring" if side == "sun" else "sun"
        assert getattr(lacking, other) == getattr(complete, other)
        own = getattr(lacking, side)
        assert np.isnan(own.torque if kind == "torque" else own.speed)


def test_without_steps_and_name_a_file_is_cut_by_the_channels_that_it_has() -> None:
    (window,), _ = judged(Bench(6.0, run={"point": None}, without=frozenset({TORQUE})))
    assert (window.first_sample, window.stop_sample) == (0, 3000)
    assert names(window) == ["channel missing"]


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
    """As long as that is nearly the length of the others."""
    (window,), (means,) = judged(Bench(4.0, drop={TORQUE: (1900, 2000)}))
    assert (window.first_sample, window.stop_sample) == (0, 1900)
    assert window.accepted
    assert window.reasons == ("remark: channels end at sample 1900 and others at 2000",)
    assert means.n == 1900
    (short,), _ = judged(Bench(4.0, drop={TORQUE: (1500, 2000)}))
    assert short.stop_sample == 1500
    assert short.reasons[0] == "window too short: 3.00 s of 4.00 s; samples 1500 to 2000 are missing"


def test_a_shaft_is_at_rest_by_its_set_point_or_else_by_its_speed() -> None:
    by_set = judged(Bench(speed={"sun": 0.0, "ring": 1.0}, run={"ring_speed_set_rpm": "0"}))[0][0]
    assert (by_set.rest_sun, by_set.rest_ring) == (True, True)
    by_speed = judged(Bench(speed={"sun": 0.3, "ring": -1.0}))[0][0]
    assert (by_speed.rest_sun, by_speed.rest_ring) == (True, False)


def test_a_file_without_a_point_is_known_by_its_name(tmp_path: Path) -> None:
    recording = read_recording(write(tmp_path / "run_07.mcap", Bench(run={"point": None})))
    assert find_windows(recording)[0].point == "run_07"
