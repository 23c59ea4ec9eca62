"""What a recording says of itself is checked, word by word."""

from __future__ import annotations

import pickle
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import pytest

from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.findings import Finding, UnusableRecordingError
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.recording.run import _utc, known_of_run
from pmg.sim.grid import Configuration
from pmg.sim.signals import RPM

from .writer import CALIBRATION, Bench, write

TORQUE = "/daq/torque_sun/frequency"
COUNT = "/daq/encoder_ring/count"
COLUMN = {
    TORQUE: "torque_sun",
    "/daq/torque_ring/frequency": "torque_ring",
    "/daq/encoder_sun/count": "angle_sun",
    COUNT: "angle_ring",
}


def refusal(path: Path, bench: Bench) -> tuple[Finding, ...]:
    with pytest.raises(UnusableRecordingError) as caught:
        read_recording(write(path / "a.mcap", bench))
    return caught.value.findings


def test_the_run_is_read_in_si_and_utc(tmp_path: Path) -> None:
    extra = {"sun_speed_set_rpm": "600", "ring_torque_set_Nm": "-1.5", "started_at": "2025-04-23T10:00:00.5+02:00"}
    run = read_recording(
        write(tmp_path / "a.mcap", Bench(run=extra | {"configuration": "engaged", "gear": "2", "drive": "ring"}))
    ).run
    assert (run.configuration, run.gear, run.drive) == (Configuration.ENGAGED, 2, "ring")
    assert run.started_at == datetime(2025, 4, 23, 8, 0, 0, 500_000, tzinfo=UTC)
    assert run.setpoints.speed_sun == pytest.approx(600 * RPM)
    assert run.setpoints.speed_ring is None
    assert run.setpoints.torque_ring == -1.5


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ({"layout": "pmg.v2"}, Code.RUN_VALUE, "pmg.v1"),
        ({"configuration": "neutrall"}, Code.RUN_VALUE, "Did you mean 'neutral'?"),
        ({"configuration": None, "configuraton": "neutral"}, Code.RUN_KEY, "Did you mean 'configuraton'?"),
        ({"gear": "3"}, Code.RUN_VALUE, "'1' or '2'"),
        ({"drive": "rings"}, Code.RUN_VALUE, "Did you mean 'ring'?"),
        ({"started_at": "23.4.2025 8:00"}, Code.RUN_VALUE, "2025-04-23T08"),
        ({"started_at": "2025-04-23T08:00:00"}, Code.RUN_VALUE, "started_at"),
        ({"started_at": "2025-13-23T08:00:00Z"}, Code.RUN_VALUE, "started_at"),
        ({"started_at": "1970-01-01T00:30:00+01:00"}, Code.RUN_VALUE, "started_at"),
        ({"started_at": "2262-01-01T00:00:00Z"}, Code.RUN_VALUE, "started_at"),
        ({"sun_speed_set_rpm": "fast"}, Code.RUN_VALUE, "finite number"),
        ({"ring_torque_set_Nm": "nan"}, Code.RUN_VALUE, "finite number"),
        ({"campaign": None}, Code.RUN_KEY, "campaign"),
    ],
)
def test_bad_metadata_is_refused_and_the_finding_says_what_to_do(
    tmp_path: Path, change: dict[str, str | None], code: Code, words: str
) -> None:
    findings = refusal(tmp_path, Bench(run=change))
    assert any(f.code is code and words in str(f) for f in findings), [str(f) for f in findings]


@pytest.mark.parametrize(
    ("topic", "change", "code", "words"),
    [
        (TORQUE, {"unit": "kHz"}, Code.CHANNEL_VALUE, "unit 'kHz'; expected 'Hz'"),
        (TORQUE, {"quantity": "torque"}, Code.CHANNEL_VALUE, "quantity 'torque'"),
        (TORQUE, {"dtype": "u64"}, Code.CHANNEL_VALUE, "expected 'f64' or 'f32'"),
        (TORQUE, {"dtype": "f32"}, Code.MESSAGE_MALFORMED, "samples of type 'f64'"),
        (TORQUE, {"rate_hz": None}, Code.CHANNEL_KEY, "rate_hz"),
        (TORQUE, {"rate_hz": None, "rate_Hz": "500"}, Code.CHANNEL_KEY, "Did you mean 'rate_Hz'?"),
        (TORQUE, {"rate_hz": "-5"}, Code.CHANNEL_VALUE, "positive number"),
        (TORQUE, {"clock_id": "1"}, Code.CHANNEL_VALUE, "shared sample clock"),
        (COUNT, {"rate_hz": "1000"}, Code.CHANNEL_VALUE, "expected 500"),
        (COUNT, {"counts_per_rev": "2048"}, Code.CHANNEL_VALUE, "expected 5120"),
        (COUNT, {"bits": "8"}, Code.CHANNEL_VALUE, "bits '8'"),
    ],
)
def test_a_channel_that_contradicts_the_layout_is_told_by_name_and_not_used(
    tmp_path: Path, topic: str, change: dict[str, str | None], code: Code, words: str
) -> None:
    bench = Bench(channel={topic: change})
    if "rate_hz" in change and topic == COUNT:
        findings = refusal(tmp_path, bench)
    else:
        recording = read_recording(write(tmp_path / "a.mcap", bench))
        assert dict(recording.lacking) == {COLUMN[topic]: "not usable"}
        findings = recording.findings
    named = [f for f in findings if f.code is code and f.where == topic]
    assert any(words in str(f) for f in named), [str(f) for f in findings]


@pytest.mark.parametrize("key", ["unit", "quantity", "dtype"])
def test_a_missing_word_that_the_layout_fixes_is_only_a_warning(tmp_path: Path, key: str) -> None:
    recording = read_recording(write(tmp_path / "a.mcap", Bench(channel={TORQUE: {key: None}})))
    assert [(f.code, f.severity, f.where) for f in recording.findings] == [(Code.CHANNEL_KEY, Severity.WARNING, TORQUE)]


@pytest.mark.parametrize("topic", [TORQUE, COUNT, "/daq/torque_ring/frequency", "/daq/encoder_sun/count"])
def test_a_missing_channel_is_named_and_the_others_are_read(tmp_path: Path, topic: str) -> None:
    column = COLUMN[topic]
    recording = read_recording(write(tmp_path / "a.mcap", Bench(without=frozenset({topic}))))
    assert [(f.code, f.where) for f in recording.findings] == [
        (Code.CHANNEL_MISSING, topic),
        (Code.CHANNEL_MISSING, column),
    ]
    assert dict(recording.lacking) == {column: "not recorded"}
    whole = read_recording(write(tmp_path / "b.mcap", Bench())).samples
    assert recording.samples[column].is_nan().all()
    assert recording.samples.drop(column).equals(whole.drop(column))


@pytest.mark.parametrize(
    "without",
    [(TORQUE, "/daq/torque_ring/frequency"), (TORQUE, COUNT), ("/daq/encoder_sun/count", COUNT)],
)
def test_without_a_shaft_that_has_both_torque_and_angle_the_recording_is_refused(
    tmp_path: Path, without: tuple[str, ...]
) -> None:
    findings = refusal(tmp_path, Bench(without=frozenset(without)))
    assert {f.where for f in findings} == set(without)


def test_edges_without_their_ticks_are_a_missing_channel(tmp_path: Path) -> None:
    topic = "/daq/torque_sun/edge_ticks"
    path = write(tmp_path / "a.mcap", Bench(encoding="edges", without=frozenset({topic})))
    findings = read_recording(path).findings
    assert [(f.code, f.where) for f in findings] == [
        (Code.CHANNEL_MISSING, topic),
        (Code.CHANNEL_MISSING, "torque_sun"),
    ]


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        (None, Code.CALIBRATION_MISSING, "exactly one"),
        ("[transducer", Code.CALIBRATION_VALUE, "cannot be parsed"),
        (CALIBRATION.replace("span_Hz = 5000.0", "span_Hz = 0.0"), Code.CALIBRATION_VALUE, "transducer.sun"),
        (CALIBRATION.replace("span_Hz = -4900.0", "span_hz = -4900.0"), Code.CALIBRATION_VALUE, "'span_hz'"),
        (CALIBRATION.replace("= 5120", '= "5120"'), Code.CALIBRATION_VALUE, "counts_per_rev"),
        (CALIBRATION.replace("[encoder.ring]", "[encoder.rings]"), Code.CALIBRATION_VALUE, "[encoder.ring]"),
        (CALIBRATION.replace("10003.2", "nan"), Code.CALIBRATION_VALUE, "null_frequency_Hz"),
    ],
)
def test_a_calibration_that_cannot_be_used_is_refused(tmp_path: Path, text: str | None, code: Code, words: str) -> None:
    findings = refusal(tmp_path, Bench(calibration=text))
    assert any(f.code is code and words in str(f) for f in findings), [str(f) for f in findings]


def test_all_faults_of_a_file_are_told_at_once(tmp_path: Path) -> None:
    findings = refusal(tmp_path, Bench(channel={TORQUE: {"unit": "kHz"}, COUNT: {"unit": "rad"}}))
    assert {f.where for f in findings} == {TORQUE, COUNT}


def test_a_misspelt_topic_is_pointed_out(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", Bench(extra={"/daq/line": b""}))
    found = [f for f in read_recording(path).findings if f.code is Code.TOPIC_UNKNOWN]
    assert [f.do for f in found] == ["Did you mean '/daq/lines'?"]


def test_findings_survive_json_and_the_error_survives_pickling(tmp_path: Path) -> None:
    findings = refusal(tmp_path, Bench(run={"gear": "3"}))
    assert tuple(Finding.from_dict(f.to_dict()) for f in findings) == findings
    error = pickle.loads(pickle.dumps(UnusableRecordingError(findings, {"gear": 1})))
    assert (error.findings, error.run) == (findings, {"gear": 1})
    assert "gear" in str(error)


@pytest.mark.parametrize(
    ("text", "micro"),
    [
        ("2025-04-23T08:00:00Z", 0),
        ("2025-04-23 08:00:00.123456789Z", 123_456),
        ("2025-04-23t09:30:00.5+01:30", 500_000),
    ],
)
def test_times_of_rfc_3339_are_read(text: str, micro: int) -> None:
    assert _utc(text) == datetime(2025, 4, 23, 8, 0, 0, micro, tzinfo=UTC)


@pytest.mark.parametrize(
    ("change", "lost"),
    [
        ({}, set()),
        ({"gear": "3"}, {"gear"}),
        ({"started_at": "23.4.2025"}, {"started_at"}),
        ({"campaign": None, "configuration": "neutrall"}, {"campaign", "configuration"}),
        ({"sun_speed_set_rpm": "fast"}, {"speed_sun"}),
    ],
)
def test_a_refusal_carries_what_is_known_of_the_run(
    tmp_path: Path, change: dict[str, str | None], lost: set[str]
) -> None:
    asked: dict[str, str | None] = {"sun_speed_set_rpm": "600", "ring_torque_set_Nm": "-1.5"}
    path = write(tmp_path / "a.mcap", Bench(run=asked | change, calibration=None))
    with pytest.raises(UnusableRecordingError) as caught:
        read_recording(path)
    known = dict(caught.value.run)
    asked_for = asdict(known.pop("setpoints"))
    found = known | {name: value for name, value in asked_for.items() if value is not None}
    whole = {
        "campaign": "made",
        "point": "P1",
        "configuration": "neutral",
        "gear": 1,
        "drive": "sun",
        "started_at": "2025-04-23T08:00:00.250000+00:00",
        "speed_sun": pytest.approx(600 * RPM),
        "torque_ring": -1.5,
    }
    assert found == {key: value for key, value in whole.items() if key not in lost}


def test_of_records_that_contradict_each_other_nothing_is_known() -> None:
    assert known_of_run([("pmg.run", {"gear": "1"}), ("pmg.run", {"gear": "2"})]) == {}
    assert known_of_run([("other", {"gear": "1"})]) == {}
