"""The RO-Crate beside a result: every reference leads somewhere, and the same files and times give the same bytes."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

from pmg.pipeline.commands.crate import (
    FILE,
    PROFILE,
    SPECIFICATION,
    CrateAction,
    SourceFile,
    recordings_of,
    source_file,
    write_crate,
)
from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.commands.provenance import leave_crate_of_files
from pmg.pipeline.store.store import Store
from pmg.sim.errors import StoreError

BEGIN, END = datetime(2025, 4, 25, 12, 0, tzinfo=UTC), datetime(2025, 4, 25, 12, 1, tzinfo=UTC)
ORIGIN = SourceFile("bench.tdms", "ab" * 32, 5)
SOURCES = (
    SourceFile("a.mcap", "01" * 32, 17, ORIGIN),
    SourceFile("b.mcap", "02" * 32),
    SourceFile("c.mcap", "01" * 32),
)
ACTION = CrateAction("pmg compare", "Report on a campaign", "pmg compare --store S --report R", BEGIN, END, SOURCES)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "tables").mkdir()
    (tmp_path / "report.html").write_text("<p>told</p>")
    (tmp_path / "tables" / "loss fit.csv").write_text("a,b\n")
    (tmp_path / ".pmg-half").write_text("half")
    return tmp_path


def crate(folder: Path, action: CrateAction = ACTION) -> dict[str, dict[str, Any]]:
    document = json.loads(write_crate(folder, action).read_text())
    entities = document["@graph"]
    assert len({entity["@id"] for entity in entities}) == len(entities)
    return {entity["@id"]: entity for entity in entities}


def references(value: object) -> Iterator[str]:
    if isinstance(value, dict):
        if set(value) == {"@id"}:
            yield value["@id"]
        for inner in value.values():
            yield from references(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from references(inner)


def test_every_reference_leads_to_an_entity(folder: Path) -> None:
    entities = crate(folder)
    external = {SPECIFICATION}
    for entity in entities.values():
        for name, value in entity.items():
            assert set(references(value)) <= set(entities) | external, name


def test_the_root_conforms_to_the_profile_and_is_described(folder: Path) -> None:
    entities = crate(folder)
    assert entities[FILE]["about"] == {"@id": "./"}
    assert entities[FILE]["conformsTo"] == {"@id": SPECIFICATION}
    root = entities["./"]
    assert root["conformsTo"] == {"@id": PROFILE}
    assert entities[root["license"]["@id"]]["name"] == "not stated"
    assert {"name", "description", "datePublished"} <= set(root)
    action = entities[root["mentions"]["@id"]]
    assert action["@type"] == "CreateAction"
    assert entities[action["instrument"]["@id"]]["@type"] == "SoftwareApplication"
    assert (action["startTime"], action["endTime"]) == ("2025-04-25T12:00:00+00:00", "2025-04-25T12:01:00+00:00")


def test_results_are_the_files_of_the_folder_with_their_hashes(folder: Path) -> None:
    entities = crate(folder)
    action = entities[entities["./"]["mentions"]["@id"]]
    results = [each["@id"] for each in action["result"]]
    assert {unquote(name) for name in results} == {"report.html", "tables/loss fit.csv"}
    for name in results:
        data = (folder / unquote(name)).read_bytes()
        assert entities[name]["sha256"] == hashlib.sha256(data).hexdigest()
        assert entities[name]["contentSize"] == str(len(data))
        assert entities[name]["@type"] == "File"
    assert {each["@id"] for each in entities["./"]["hasPart"]} == {
        name for name, entity in entities.items() if entity["@type"] == "File"
    }


def test_recordings_are_named_by_their_content_once(folder: Path) -> None:
    entities = crate(folder)
    objects = [each["@id"] for each in entities[entities["./"]["mentions"]["@id"]]["object"]]
    assert len(objects) == 2
    digest = objects[0].removeprefix("ni:///sha-256;")
    assert base64.urlsafe_b64decode(digest + "=").hex() == "01" * 32 == entities[objects[0]]["sha256"]
    assert entities[entities[objects[0]]["isBasedOn"]["@id"]]["name"] == "bench.tdms"


def test_the_same_gives_the_same_bytes_and_nothing_of_itself(folder: Path) -> None:
    first = write_crate(folder, ACTION).read_bytes()
    assert write_crate(folder, ACTION).read_bytes() == first
    assert write_crate(folder, replace(ACTION, ended=BEGIN)).read_bytes() != first


def test_a_result_that_is_not_there_or_outside_is_told(folder: Path) -> None:
    with pytest.raises(StoreError, match="not a file of the results"):
        write_crate(folder, replace(ACTION, results=(folder / "none.csv",)))
    with pytest.raises(StoreError, match="not a file of the results"):
        write_crate(folder / "tables", replace(ACTION, results=(folder / "report.html",)))
    assert not (folder / "tables" / FILE).exists()


def test_a_time_without_zone_is_refused(folder: Path) -> None:
    with pytest.raises(ValueError, match="time zone"):
        write_crate(folder, replace(ACTION, ended=datetime(2025, 4, 25)))


def test_recordings_come_from_the_manifests(campaign: Path, tmp_path: Path) -> None:
    ingest(campaign, Store(tmp_path / "s"), workers=1)
    found = recordings_of(tmp_path / "s")
    assert found == tuple(source_file(path) for path in sorted(campaign.glob("[0-9]*.mcap")))
    assert recordings_of(tmp_path / "s", "made") == found
    assert not recordings_of(tmp_path / "s", "other")


def test_results_made_of_files_name_them_and_count_many(tmp_path: Path) -> None:
    files = [tmp_path / f"{i}.csv" for i in range(7)]
    for path in files:
        path.write_text(path.name, encoding="utf-8")
    out = tmp_path / "out"
    out.mkdir()
    (out / "report.html").write_text("page", encoding="utf-8")
    moment = datetime(2026, 1, 2, tzinfo=UTC)
    for taken, told in ((files[:2], "Made of 0.csv, 1.csv."), (files, "Made of 7 files.")):
        written = leave_crate_of_files(out, "pmg terms", tuple(taken), (out / "report.html",), moment, lambda: moment)
        graph = json.loads(written.read_text(encoding="utf-8"))["@graph"]
        (action,) = (entity for entity in graph if entity["@type"] == "CreateAction")
        assert action["description"] == told
        assert len(action["object"]) == len(taken)
