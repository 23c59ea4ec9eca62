"""The command: stores side by side, the page, its JSON, and what it refuses."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.campaign_comparison.campaigns import grid, side
from tests.report import chromium
from tests.report.controls import press_all
from tests.slow import slow
from typer.testing import CliRunner

from pmg.pipeline.analysis.outputs import write_analysis
from pmg.pipeline.campaign_comparison.constants import constant_differences, curve_differences
from pmg.pipeline.campaign_comparison.difference import subtract
from pmg.pipeline.campaign_comparison.matching import Reach
from pmg.pipeline.campaign_comparison.side import TransducerIdentity, _transducers_of
from pmg.pipeline.campaign_comparison.verdict import judge
from pmg.pipeline.chapters.campaigns import tables
from pmg.pipeline.chapters.campaigns.page import versus_report
from pmg.pipeline.chapters.campaigns.tables import conditions_table
from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.report import _findings
from pmg.pipeline.fit.options import THESIS_OPTIONS
from pmg.pipeline.grid.conditions import NOT_RECORDED, Conditions
from pmg.pipeline.recording.calibration import Calibration, Transducer
from pmg.pipeline.store.manifest import Manifest
from pmg.pipeline.store.store import Store
from pmg.sim.bench import load_bench

pytestmark = pytest.mark.usefixtures("undrawn")

RUNNER = CliRunner()


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with the published grids analysed."""
    store = tmp_path_factory.mktemp("published") / "s"
    root = Path(__file__).resolve().parent.parent.parent
    run_analyse(store, THESIS_OPTIONS, grids=root / "raw" / "published", campaign=None)
    return store


def call(*words: object, expect: int) -> dict[str, Any]:
    outcome = RUNNER.invoke(app, ["report", *map(str, words), "--json"])
    assert outcome.exit_code == expect, outcome.output
    found: dict[str, Any] = json.loads(outcome.stdout)
    return found


@pytest.fixture(scope="module")
def with_itself(published: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A store compared with itself: the report, and what the command gave."""
    report = tmp_path_factory.mktemp("itself") / "r"
    return report, call(published, published, "--report", report, "--fail-on", "mismatch", expect=0)


@slow
@chromium.needed
def test_no_control_of_the_page_sends_anything(with_itself: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    assert press_all(with_itself[0] / "report.html", tmp_path)


def test_a_store_against_itself_through_the_command(with_itself: tuple[Path, dict[str, Any]]) -> None:
    report, result = with_itself
    data = result["data"]
    assert data["statement"].startswith("No difference beyond noise")
    assert data["only_a"] == data["only_b"] == []
    assert all(mean["mean"] == 0.0 for mean in data["means"])
    assert {"A (", "B ("} == {
        finding["where"][:3] for finding in result["findings"] if "published" in finding["message"]
    }
    whole = json.loads((report / "versus.json").read_text())
    assert whole["schema"] == "pmg.versus/1"
    assert len(whole["points"]) > 200
    page = (report / "report.html").read_text()
    assert "No difference beyond noise" in page
    graph = {entity["@id"]: entity for entity in json.loads((report / "ro-crate-metadata.json").read_text())["@graph"]}
    action = next(entity for entity in graph.values() if entity["@type"] == "CreateAction")
    assert action["description"] == "Made of A: published grids; B: published grids."
    files = {str(Path(file).relative_to(report)) for file in data["files"]} - {"ro-crate-metadata.json"}
    assert {of["@id"] for of in action["result"]} == files


@pytest.mark.parametrize("count", [1, 3])
def test_other_than_two_stores_are_refused(published: Path, count: int, tmp_path: Path) -> None:
    error = call(*[published] * count, "--report", tmp_path / "r", expect=2)["error"]
    assert error["expected"] == "two: A and B"
    assert not (tmp_path / "r").exists()


def test_a_campaign_without_zero_checks_is_told() -> None:
    without = side("B", 1)
    at = without.grid.points
    first = replace(at, configuration=np.where(np.arange(len(at)) == 0, "zero", at.configuration))
    checked = replace(without, analysis=replace(without.analysis, grid=replace(without.grid, points=first)))
    versus = subtract(without, without, Reach())
    for a, b, count in ((without, without, 2), (checked, without, 1), (checked, checked, 0)):
        told = [finding.message for finding in _findings(replace(versus, a=a, b=b))]
        assert sum("no zero check" in message for message in told) == count


def test_what_lacks_is_told(published: Path, tmp_path: Path) -> None:
    assert call(published, tmp_path / "no", "--report", tmp_path / "r", expect=2)["error"]["do"] == "Check the path."
    (tmp_path / "empty").mkdir()
    error = call(published, tmp_path / "empty", "--report", tmp_path / "r", expect=2)["error"]
    assert "pmg analyse" in error["do"]
    words = ("--speed-tolerance", "5 N m")
    error = call(published, published, *words, "--report", tmp_path / "r", expect=2)["error"]
    assert error["where"] == "--speed-tolerance"


def test_grids_without_a_common_point_are_told_with_the_nearest(published: Path, tmp_path: Path) -> None:
    away = grid(1)
    at = replace(away.points, speed_sun=away.points.speed_sun + 31.0)
    analysis = replace(side("B", 1).analysis, grid=replace(away, points=at))
    Store(tmp_path / "s").prepare()
    write_analysis(analysis, tmp_path / "s", load_bench())
    stored = json.loads((tmp_path / "s" / "analysis" / "analysis.json").read_text())
    stored["origin"] = "published"
    del stored["proof"]
    (tmp_path / "s" / "analysis" / "analysis.json").write_text(json.dumps(stored))
    told = call(published, tmp_path / "s", "--report", tmp_path / "r", expect=2)
    data = told["data"]
    (unproven,) = [f for f in told["findings"] if "unproven" in f["message"]]
    assert (unproven["severity"], unproven["where"]) == ("warning", str(tmp_path / "s" / "analysis" / "analysis.json"))
    assert data["statement"].startswith("No point of A has a partner")
    assert len(data["only_b"]) == len(away)
    assert all(one["nearest"] for one in data["only_b"])
    assert "No point of A has a partner" in (tmp_path / "r" / "report.html").read_text()


def test_the_page_tells_outcome_differences_and_points_without_a_partner(rng: np.random.Generator) -> None:
    a = side("A", 1)
    whole = side("B", 2, shift_sun=5e-3)
    kept = np.ones(len(whole.grid), dtype=bool)
    kept[[3, 40]] = False
    fewer = replace(whole.grid, accepted=kept, reason=np.where(kept, "", "drifts"))
    b = replace(whole, analysis=replace(whole.analysis, grid=fewer))
    versus = subtract(a, b, Reach())
    judged = judge(versus, rng, 199)
    page = versus_report(
        versus, judged, constant_differences(versus), curve_differences(versus), note="", provenance=()
    )
    assert page.verdict.state == "attention"
    assert dict(page.verdict.counted)["Only in A"] == "2"
    tables = {table.id: table for table in page.tables}
    assert len(tables["versus-by-point"].rows) == len(a.grid) - 2
    assert {row[-1] for row in tables["only-a"].rows} == {"rejected there"}
    assert {row[-1] for row in tables["only-b"].rows} == {"rejected here"}
    assert {"map-neutral", "map-engaged", "loss-differences", "follows", "curve-differences"} == {
        figure.id for figure in page.figures
    }
    engaged = next(figure for figure in page.figures if figure.id == "map-engaged").panels[0]
    assert engaged.z.shape == (7, 3)  # type: ignore[union-attr]


def test_a_transducer_is_known_only_where_every_recording_names_the_same() -> None:
    def recording(serial: str, nominal: float = 5.0) -> Manifest:
        of = Transducer(10_000.0, nominal, 5000.0, serial)
        return Manifest("x", calibration=Calibration(of, replace(of, serial="r"), 5120, 5120))

    found = _transducers_of([recording("s"), recording("s")])
    assert found == {"sun": TransducerIdentity("s", 5.0, 5000.0), "ring": TransducerIdentity("r", 5.0, 5000.0)}
    assert _transducers_of([recording("s"), recording("t")])["sun"] is None
    assert _transducers_of([recording("s"), recording("s", 10.0)])["sun"] is None
    assert _transducers_of([recording("")])["sun"] is None
    assert _transducers_of([]) == {"sun": None, "ring": None}


def test_what_one_campaign_alone_recorded_stands_among_the_conditions(monkeypatch: pytest.MonkeyPatch) -> None:
    recorded = iter((Conditions((("Campaign", "a"),)), Conditions((("Campaign", "b"), ("Temperature, room", "20 °C")))))
    monkeypatch.setattr(tables, "conditions", lambda _: next(recorded))
    rows = conditions_table(subtract(side("A", 1), side("B", 2), Reach())).rows
    assert ("Campaign", "a", "b", "differs") in rows
    assert ("Temperature, room", NOT_RECORDED, "20 °C", "not known") in rows
