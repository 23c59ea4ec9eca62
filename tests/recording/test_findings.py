"""Findings of one file: how many are listed, and what they say reaches the manifest, JSON and the page."""

from __future__ import annotations

import json
import struct
import zlib
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.chapters.measured.quality import _findings_table
from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.container.records import HEAD, MAGIC, Op
from pmg.pipeline.recording.container.source import ByteSource
from pmg.pipeline.recording.findings import LISTED, LONGEST_TEXT, Finding, Findings, Severity
from pmg.pipeline.store.store import Store

from .damages import base
from .readers import kept_by_pmg, records, walked
from .writer import Bench, write


@given(st.integers(0, 3 * LISTED), st.integers(0, 2 * LISTED), st.integers(1, 40))
def test_findings_beyond_the_listed_ones_are_counted_with_their_bytes(errors: int, warnings: int, length: int) -> None:
    findings = Findings("file")
    for i in range(errors):
        findings.error(Code.SKIPPED, "there", "x", "y", byte_range=(100 * i, 100 * i + length))
    for _ in range(warnings):
        findings.warning(Code.SKIPPED, "there", "x", "y")
    told = findings.listed()
    grave = [f for f in told if f.severity is Severity.ERROR]
    assert len(grave) == min(errors, LISTED + 1)
    assert len(told) - len(grave) == min(warnings, LISTED + 1)
    if errors > LISTED:
        more = errors - LISTED
        assert grave[LISTED].message.startswith(f"{more} more findings container.skipped over {more * length} bytes ")
        assert grave[LISTED].byte_range == (100 * LISTED, 100 * (errors - 1) + length)
    assert tuple(Finding.from_dict(finding.to_dict()) for finding in told) == told


def test_bytes_named_twice_are_counted_once_and_other_codes_are_listed() -> None:
    findings = Findings("file")
    for _ in range(LISTED + 7):
        findings.error(Code.LENGTH, "there", "x", "y", byte_range=(10, 30))
    findings.error(Code.CRC, "end", "x", "y")
    *_, more, last = findings.listed()
    assert more.message.startswith("7 more findings container.length over 20 bytes between 10 and 30")
    assert last.code is Code.CRC
    assert str(findings.give_up()).startswith("file: end")


def test_a_name_as_long_as_the_file_does_not_fill_the_findings() -> None:
    findings = Findings("file")
    findings.error(Code.CHANNEL_CONFLICT, "t" * 10**6, "m" * 10**6 + "; expected less", "y")
    (finding,) = findings.listed()
    assert len(finding.where) < 2 * LONGEST_TEXT
    assert len(finding.message) < 2 * LONGEST_TEXT
    assert finding.message.endswith("; expected less")


def test_a_file_full_of_broken_records_gives_few_findings_over_all_their_bytes() -> None:
    strange = HEAD.pack(Op.METADATA, 3) + b"abc"
    whole = base()
    found = walked(MAGIC + strange * 5000 + whole[len(MAGIC) :])
    told = found.findings.listed()
    assert len(told) == LISTED + 1
    assert f"over {(5000 - LISTED) * len(strange)} bytes" in told[-1].message
    assert found.messages == walked(whole).messages


def test_a_crc_that_goes_on_is_that_of_the_whole_stretch_and_reads_no_byte_twice() -> None:
    class Counting(BytesIO):
        total = 0

        def read(self, size: int | None = -1, /) -> bytes:
            data = super().read(size)
            Counting.total += len(data)
            return data

    data = bytes(range(256)) * 4000
    source = ByteSource(Counting(data), len(data))
    for stop in (*range(0, len(data), 50_000), 70_000, len(data)):
        assert source.crc(0, stop) == zlib.crc32(data[:stop])
    assert source.crc(5, 900) == zlib.crc32(data[5:900])
    assert Counting.total < 5 * len(data)


@pytest.mark.parametrize("gap", [97, 1009])
def test_many_small_damages_do_not_end_the_search(gap: int) -> None:
    whole = base(chunked=False)
    spoilt = bytearray(whole)
    places = [at for at, code, _ in records(whole) if code == Op.MESSAGE]
    for at in places[5::7]:
        spoilt[at + 1 : at + 9] = struct.pack("<Q", 2**40 + gap)
    kept = kept_by_pmg(bytes(spoilt)) & kept_by_pmg(whole)
    assert kept.total() >= len(places) - 2 * len(places[5::7])


def test_what_findings_say_reaches_manifest_and_page(tmp_path: Path) -> None:
    bench = Bench(seconds=20.0, drop={"/daq/torque_sun/frequency": (4000, 4500)})
    path = write(tmp_path / "a.mcap", bench)
    path.write_bytes(path.read_bytes() + b"behind")
    store = Store(tmp_path / "store")
    report = ingest(path, store, workers=1)
    (manifest,) = store.manifests()
    plain = json.loads(json.dumps(manifest.document()["findings"]))
    assert [Finding.from_dict(each) for each in plain] == list(report.findings)
    by_code = {each["code"]: each for each in plain}
    trailing, gap = by_code["container.trailing"], by_code["samples.gap"]
    size = path.stat().st_size
    assert trailing["byte_range"] == [size - len(b"behind"), size]
    assert gap["sample_range"] == [4000, 4500]
    assert gap["lost"] == "500 samples"
    table = _findings_table(report.findings)
    names = [column.name for column in table.columns]
    rows = {row[names.index("bytes")]: dict(zip(names, row, strict=True)) for row in table.rows}
    row = rows[f"{size - len(b'behind')} to {size}"]
    assert (row["kept"], row["lost"]) == ("the recording before them", "6 bytes")
    assert "4000 to 4500" in {row[names.index("samples")] for row in table.rows}
