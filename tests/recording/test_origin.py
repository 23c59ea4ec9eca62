"""What a recording was imported from goes on into manifest and report."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from tests.importers import written

from pmg.pipeline.chapters.measured.quality import _origins_table
from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.importers.channel_map import read_map
from pmg.pipeline.importers.import_recording import import_recording
from pmg.pipeline.recording.findings import Code, Finding, Findings, Severity
from pmg.pipeline.recording.origin import RECORD, read_origin
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.store.store import Store

from .writer import Bench, write

TOLD = Finding(Severity.ERROR, "speed, from line 9", "3 empty; expected none", "a.csv", Code.SAMPLES_GAP, "Look.")


def said(**other: str) -> tuple[tuple[str, dict[str, str]], ...]:
    plain = {"source": "a.csv", "source_sha256": "ab", "source_bytes": "7", "source_format": "csv"}
    return ("pmg.run", {}), (RECORD, plain | {"source_reader": "r 1", "findings": json.dumps([TOLD.to_dict()])} | other)


def test_source_hash_format_and_findings_come_back() -> None:
    findings = Findings("a.mcap")
    origin = read_origin(said(), findings)
    assert origin is not None
    assert (origin.source, origin.sha256, origin.size, origin.format, origin.reader) == (
        "a.csv",
        "ab",
        "7",
        "csv",
        "r 1",
    )
    assert (origin.findings, findings.listed()) == ((TOLD,), ())
    (row,) = _origins_table((("a.mcap", origin.record),)).rows
    assert row == ("a.mcap", "a.csv", "csv", "r 1", "7", "ab", 1.0)


@pytest.mark.parametrize("text", ["{", "3", '{"code": 1}', '[{"code": "no.such"}]', "[1]", "[" * 9999])
def test_findings_that_cannot_be_read_are_a_finding(text: str) -> None:
    findings = Findings("a.mcap")
    origin = read_origin(said(findings=text), findings)
    assert origin is not None
    assert (origin.source, origin.findings) == ("a.csv", ())
    assert [finding.where for finding in findings.listed()] == [f"{RECORD}.findings"]


def test_an_import_is_named_in_the_manifest_and_a_plain_recording_is_not(tmp_path: Path) -> None:
    source = tmp_path / "E1.csv"
    source.write_text(written.csv_text(), encoding="utf-8-sig", newline="")
    chart = read_map(written.write_map(tmp_path, written.map_text(written.PLAIN)))
    done = import_recording(source, chart, tmp_path / "in" / "a.mcap")
    (tmp_path / "in").mkdir(exist_ok=True)
    write(tmp_path / "in" / "b.mcap", Bench())
    assert read_recording(tmp_path / "in" / "b.mcap").origin is None
    store = Store(tmp_path / "store")
    ingest(tmp_path / "in", store, workers=1)
    origins: dict[str, Any] = {m.file: m.document().get("origin") for m in store.manifests()}
    sha256 = hashlib.sha256(source.read_bytes()).hexdigest()
    assert origins["b.mcap"] is None
    assert (origins["a.mcap"]["source"], origins["a.mcap"]["sha256"]) == ("E1.csv", sha256)
    assert (origins["a.mcap"]["format"], origins["a.mcap"]["findings"]) == ("csv", len(done.findings))
