"""The summary of a report for programs, held against its schema."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jsonschema
import pytest

from pmg.pipeline.report.document import Column, Measured, Text
from pmg.pipeline.report.summary import summary
from pmg.pipeline.report.table import LONG
from pmg.pipeline.report.write import write_report

from . import example
from .test_workbook import table, told

if TYPE_CHECKING:
    from pmg.pipeline.report.document import Report

SCHEMA = json.loads(
    (Path(__file__).resolve().parents[2] / "pipeline" / "report" / "summary.schema.json").read_text(encoding="utf-8")
)
POINTS = {"points": {"accepted": 277, "rejected": 6}}


def small() -> Report:
    """One figure and one table, quick to draw."""
    report = example.report()
    section = replace(report.sections[0], items=(report.figures[1], example.long_table()), sources=())
    return replace(report, sections=(section,))


def written(folder: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    jsonschema.validate(document, SCHEMA)
    return document


def test_it_tells_verdict_points_provenance_and_findings(tmp_path: Path) -> None:
    write_report(small(), tmp_path, POINTS)
    found = written(tmp_path)
    assert found["schema"] == "pmg.summary/1"
    assert found["verdict"] == {"state": "attention", "text": "A drag that grows with speed is missing."}
    assert found["facts"] == POINTS
    assert found["provenance"] == [{"label": "Recording", "value": "raw/run_01.mcap"}]
    shown = [(figure["finding"], figure["section"], figure["svg"]) for figure in found["figures"]]
    assert shown == [("A third of the supply is lost.", "What was found", "figures/flow.svg")]


def test_every_other_file_is_named_with_its_size_and_hash(tmp_path: Path) -> None:
    paths = write_report(small(), tmp_path)
    listed = {file["name"]: (file["bytes"], file["sha256"]) for file in written(tmp_path)["files"]}
    there = {path.relative_to(tmp_path).as_posix(): path.read_bytes() for path in paths}
    del there["summary.json"], there["report-files.json"]
    assert listed == {name: (len(data), hashlib.sha256(data).hexdigest()) for name, data in there.items()}


def test_values_come_with_uncertainty_and_unit() -> None:
    columns = (Column("loss", "Loss", "W"), Column("kind"), Column("n", unit="1"))
    rows = ((Measured(0.1 + 0.2, 0.01), "a", 3), (1.5, None, math.nan), (Measured(2.0, math.nan), "", math.inf))
    found = summary(told(table(rows, *columns)), {})
    jsonschema.validate(found, SCHEMA)
    (made,) = found["tables"]
    assert [(c["name"], c["label"], c["unit"], c["u"]) for c in made["columns"]] == [
        ("loss", "Loss", "W", True),
        ("kind", "kind", "", False),
        ("n", "n", "1", False),
    ]
    assert made["rows"] == [
        [{"value": 0.1 + 0.2, "u": 0.01}, "a", 3],
        [{"value": 1.5, "u": None}, None, None],
        [{"value": 2.0, "u": None}, "", "inf"],
    ]


def test_a_long_table_is_told_by_its_file() -> None:
    short, long = example.long_table(LONG), replace(example.long_table(LONG + 1), id="long")
    made = {item["id"]: item for item in summary(told(short, long), {})["tables"]}
    assert len(made["points"]["rows"]) == made["points"]["count"] == LONG
    assert "rows" not in made["long"]
    assert (made["long"]["count"], made["long"]["file"]) == (LONG + 1, "tables/long.csv")


def test_a_name_that_is_no_text_is_told(tmp_path: Path) -> None:
    odd = b"run_\xff.mcap".decode("utf-8", "surrogateescape")
    write_report(told(table(((odd,),))), tmp_path)
    assert written(tmp_path)["tables"][0]["rows"] == [[odd]]


def test_the_same_report_gives_the_same_summary_in_the_same_order(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_report(small(), tmp_path / name, POINTS)
    one, other = ((tmp_path / name / "summary.json").read_bytes() for name in ("a", "b"))
    assert one == other
    assert list(json.loads(one)) == list(SCHEMA["properties"])


def test_the_word_of_a_diagnosis_stands_with_the_verdict() -> None:
    found = summary(told(), {}, POINTS | {"diagnosis": "named"})
    jsonschema.validate(found, SCHEMA)
    assert found["verdict"]["diagnosis"] == "named"
    assert found["facts"] == POINTS
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(summary(told(), {}, POINTS | {"diagnosis": "guessed"}), SCHEMA)


@pytest.mark.parametrize("facts", [{"points": {"accepted": -1, "rejected": 0}}, {"points": {"accepted": 1}}])
def test_the_schema_refuses_points_that_are_none(facts: dict[str, Any]) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(summary(told(), {}, facts), SCHEMA)


def test_a_report_of_text_alone_has_a_summary() -> None:
    report = example.report()
    bare = replace(report, sections=(replace(report.sections[0], items=(Text("x"),)),))
    found = summary(bare, {})
    jsonschema.validate(found, SCHEMA)
    assert found["tables"] == found["figures"] == []
