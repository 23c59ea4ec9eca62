"""Files that are damaged, cut or foreign: what is whole is kept, what is lost is named."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType

from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.container import chunk
from pmg.pipeline.recording.container.chunk import CHUNK_LIMIT
from pmg.pipeline.recording.container.file_limits import EXPANDED, MESSAGES, MISSING, WASTED, FileLimit
from pmg.pipeline.recording.findings import Finding, UnusableRecordingError
from pmg.pipeline.recording.read import Recording, read_recording

from .damages import DAMAGES, Damage, base
from .readers import kept_by_official, kept_by_pmg, told
from .writer import Bench, write

CHUNK = 6
PAGE = Path(__file__).resolve().parents[2] / "pipeline" / "recording" / "README.md"
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
    assert recording is not None
    assert dict(recording.lacking) == {"torque_sun": "not recorded"}
    lost = [f for f in findings if f.code is Code.RECORD_LOST]
    assert any("10 messages" in f.message for f in lost)


def test_the_table_of_damage_names_each_case_once_and_covers_every_kind() -> None:
    assert len({damage.name for damage in DAMAGES}) == len(DAMAGES) >= 40
    assert {damage.kind for damage in DAMAGES} == {"container", "encoding", "time", "signal"}


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.name)
def test_damage_never_costs_more_than_with_a_reader_that_stops_at_it_and_is_never_silent(damage: Damage) -> None:
    spoilt, whole = damage.files()
    truth = kept_by_official(whole, seeking=True)
    kept, findings = kept_by_pmg(spoilt), told(spoilt)
    assert truth.total() > 0
    # Where the recorder wrote no CRC nothing proves a message, and that is reported.
    unproven = Code.UNPROVEN in {finding.code for finding in findings}
    assert unproven == ("without chunks" in damage.name or "without CRC" in damage.name)
    assert kept <= truth or unproven
    assert (kept & truth).total() >= (kept_by_official(spoilt, seeking=True) & truth).total()
    assert (kept & truth).total() >= (kept_by_official(spoilt, seeking=False) & truth).total()
    # A file of which no byte is lost may be read without a word: two chunks in the wrong order are all there.
    assert findings or (kept == truth and "wrong order" in damage.name)
    for finding in findings:
        assert finding.message
        assert finding.do
        if finding.byte_range is not None:
            assert 0 <= finding.byte_range[0] <= finding.byte_range[1] <= len(spoilt)
    assert tuple(Finding.from_dict(finding.to_dict()) for finding in findings) == findings


def test_a_finding_says_where_the_loss_lies_and_what_is_left(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", Bench(seconds=20.0, compression=CompressionType.NONE))
    data = bytearray(path.read_bytes())
    at, length = chunks(bytes(data))[4]
    data[at + 9 + length // 2] ^= 0x10
    path.write_bytes(data)
    (lost,) = [f for f in read_recording(path).findings if f.code is Code.CHUNK_LOST]
    assert lost.byte_range == (at, at + 9 + length)
    assert lost.kept
    assert lost.lost


def test_what_a_chunk_may_expand_to_is_capped_whatever_it_claims() -> None:
    zeros = bytes(CHUNK_LIMIT + 1)
    packed = zstandard.ZstdCompressor(write_content_size=False).compress(zeros)
    for declared in (len(zeros), 10):
        head = struct.pack("<QQQII", 0, 1, declared, zlib.crc32(zeros), 4) + b"zstd" + struct.pack("<Q", len(packed))
        body = head + packed
        data = b"\x89MCAP0\r\n" + struct.pack("<BQ", CHUNK, len(body)) + body
        assert Code.TOO_LARGE in {finding.code for finding in told(data)}


def test_the_page_states_the_limits_of_a_file() -> None:
    page = PAGE.read_text(encoding="utf-8")
    stated = {EXPANDED: ("64 MiB", 64 << 20), WASTED: ("4 GiB", 4 << 30)}
    stated |= {MESSAGES: ("500,000", 500_000), MISSING: ("5 million", 5_000_000)}
    for limit, (words, floor) in stated.items():
        assert f"| {words} | {limit.per_byte} |" in page
        assert (limit.of(0), limit.of(floor)) == (floor, limit.per_byte * floor)


def test_a_file_of_many_small_chunks_does_not_expand_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunk, "EXPANDED", FileLimit(20_000, 0))
    data = base()
    assert 0 < kept_by_pmg(data).total() < 120
    assert Code.TOO_LARGE in {finding.code for finding in told(data)}
