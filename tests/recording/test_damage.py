"""Files that are damaged, cut or foreign: what is whole is kept, what is lost is named."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType

from pmg.pipeline.recording import Code, Finding, Recording, UnusableRecordingError, read_recording

from .writer import Bench, write

CHUNK = 6
DATA = Path(__file__).resolve().parent.parent / "data"


def chunks(data: bytes) -> list[tuple[int, int]]:
    """Start of the record and length of its body, of each chunk."""
    found, at = [], 8
    while at + 9 <= len(data):
        code, length = struct.unpack_from("<BQ", data, at)
        if code == CHUNK:
            found.append((at, length))
        at += 9 + length
    return found


def read_or_findings(path: Path) -> tuple[Recording | None, tuple[Finding, ...]]:
    try:
        recording = read_recording(path)
    except UnusableRecordingError as error:
        return None, error.findings
    return recording, recording.findings


def codes(findings: tuple[Finding, ...]) -> set[Code]:
    return {finding.code for finding in findings}


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_whole_file_has_no_findings_whatever_its_compression(tmp_path: Path, compression: CompressionType) -> None:
    recording = read_recording(write(tmp_path / "a.mcap", Bench(compression=compression)))
    assert recording.findings == ()
    assert recording.samples.height == 1000


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", Code.NOT_MCAP),
        (b"\x89MC", Code.NOT_MCAP),
        (b"time;torque\n0;1\n", Code.NOT_MCAP),
        (b"\x89MCAP0\r\n", Code.TRUNCATED),
    ],
)
def test_a_file_that_is_no_recording_is_refused_with_a_finding(tmp_path: Path, data: bytes, code: Code) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(data)
    with pytest.raises(UnusableRecordingError) as caught:
        read_recording(path)
    assert code in codes(caught.value.findings)


def test_a_path_that_cannot_be_read_is_a_finding(tmp_path: Path) -> None:
    with pytest.raises(UnusableRecordingError) as caught:
        read_recording(tmp_path)
    assert codes(caught.value.findings) == {Code.UNREADABLE}


def test_a_file_cut_at_any_place_gives_the_samples_before_it_and_says_so(tmp_path: Path) -> None:
    data = write(tmp_path / "whole.mcap", Bench(seconds=6.0)).read_bytes()
    whole = read_recording(tmp_path / "whole.mcap").samples
    cut = tmp_path / "cut.mcap"
    kept = []
    for size in range(8, len(data), max(1, len(data) // 150)):
        cut.write_bytes(data[:size])
        recording, findings = read_or_findings(cut)
        data_end = chunks(data)[-1][0] + chunks(data)[-1][1] + 9
        assert Code.TRUNCATED in codes(findings) or size >= data_end
        if recording is not None:
            rows = recording.samples.height
            kept.append(rows)
            for name in ("torque_sun", "torque_ring", "angle_sun", "angle_ring"):
                column = recording.samples[name].to_numpy()
                known = np.isfinite(column)
                np.testing.assert_array_equal(column[known], whole[name].to_numpy()[:rows][known])
    assert kept == sorted(kept)
    assert 0 < kept[0] < kept[-1] == whole.height


def test_a_damaged_chunk_is_lost_alone(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", Bench(seconds=20.0, compression=CompressionType.NONE))
    data = bytearray(path.read_bytes())
    places = chunks(bytes(data))
    assert len(places) > 6
    at, length = places[len(places) // 2]
    data[at + 9 + length // 2] ^= 0x10
    path.write_bytes(bytes(data))
    recording = read_recording(path)
    assert {Code.CHUNK_LOST, Code.SAMPLES_GAP} <= codes(recording.findings)
    angle = recording.samples["angle_ring"].to_numpy()
    assert recording.samples.height == 10_000
    missing = np.count_nonzero(np.isnan(recording.samples["torque_sun"].to_numpy()) | np.isnan(angle))
    assert 0 < missing < 3000


def test_a_damaged_calibration_is_not_used(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", Bench())
    data = path.read_bytes()
    place = data.index(b"span_Hz = 5000.0")
    path.write_bytes(data[:place] + b"span_Hz = 5100.0" + data[place + 16 :])
    recording, findings = read_or_findings(path)
    assert recording is None
    assert {Code.RECORD_LOST, Code.CALIBRATION_MISSING} <= codes(findings)


def test_any_flipped_bit_is_survived_and_never_changes_a_sample_silently(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    data = (DATA / "neutral.mcap").read_bytes()
    whole = read_recording(DATA / "neutral.mcap")
    path = tmp_path / "flipped.mcap"
    for place in rng.choice(len(data), size=150, replace=False):
        changed = bytearray(data)
        changed[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(changed))
        recording, findings = read_or_findings(path)
        if recording is not None and not findings:
            assert recording.samples.equals(whole.samples), f"byte {place}"


def test_messages_of_an_undescribed_channel_are_counted(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", Bench(compression=CompressionType.NONE, crc=False))
    data = path.read_bytes()
    head = struct.pack("<HHI", 1, 1, len("/daq/torque_sun/frequency")) + b"/daq/torque_sun/frequency"
    assert data.count(head) >= 1
    path.write_bytes(data.replace(head, struct.pack("<H", 77) + head[2:]))
    recording, findings = read_or_findings(path)
    assert recording is None
    lost = [f for f in findings if f.code is Code.RECORD_LOST]
    assert any("10 messages" in f.message for f in lost)
