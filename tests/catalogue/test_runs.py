"""Listing, showing and comparing the runs of a small store, and an index that is damaged or gone."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
import sqlite3
from pathlib import Path
from typing import Any

import polars as pl
import pytest
from tests.catalogue.conftest import LOADS, run_of
from typer.testing import CliRunner

from pmg.pipeline.catalogue.columns import COLUMNS
from pmg.pipeline.catalogue.entries import Entry
from pmg.pipeline.catalogue.gather import _with_grid
from pmg.pipeline.catalogue.index import FILE, TABLES, open_catalogue
from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.files.json_values import proven_json
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.campaign import choose_campaign, measured_grid
from pmg.pipeline.grid.tables import grid_frame
from pmg.pipeline.store.store import Store
from pmg.pipeline.windows.limits import Steadiness
from pmg.sim.bench import load_bench
from pmg.sim.signals import RPM

RUNNER = CliRunner()


def call(*arguments: object, expect: int = 0) -> dict[str, Any]:
    outcome = RUNNER.invoke(app, ["runs", *map(str, arguments), "--json"])
    assert outcome.exit_code == expect, outcome.output
    result: dict[str, Any] = json.loads(outcome.stdout)
    return result


def files(result: dict[str, Any]) -> list[str]:
    return [run["file"] for run in result["data"]["runs"]]


def test_every_run_is_listed_in_order_of_its_start_and_a_failed_file_too(store: Path) -> None:
    result = call("list", store, "--columns", "all")
    assert files(result) == ["a.mcap", "b.mcap", "c.mcap", "d.mcap", "falling.mcap", "notes.mcap"]
    assert set(result["data"]["runs"][0]) == {column.name for column in COLUMNS}
    failed = result["data"]["runs"][-1]
    assert (failed["status"], failed["sun_rpm"], failed["errors"]) == ("failed", None, 1)
    first = result["data"]["runs"][0]
    assert first["sun_rpm"] == pytest.approx(600.0, abs=0.1)
    assert first["torque_sun_Nm"] == pytest.approx(0.8, abs=1e-3)
    assert (first["configuration"], first["load"], first["sun_set_rpm"]) == ("engaged", 0.78, pytest.approx(600.0))


@pytest.mark.parametrize(
    ("where", "found"),
    [
        ("sun_rpm > 1000 and load = 1.56", ["b", "d", "falling"]),
        ("sun_rpm > 1000 and round(load, 1) = 1.6", ["b", "c", "d", "falling"]),
        ("accepted = false", ["falling"]),
        ("not accepted", ["falling"]),
        ("accepted is not true", ["falling", "notes"]),
        ("status = 'failed'", ["notes"]),
        ("point = 'E_a' or file = 'd.mcap'", ["a", "d"]),
        ("start >= '2025-04-23T08:03'", ["d", "falling"]),
        ("findings > 0 and load is null", ["notes"]),
    ],
)
def test_a_condition_chooses_runs(store: Path, where: str, found: list[str]) -> None:
    assert files(call("list", store, "--where", where)) == [f"{name}.mcap" for name in found]


def test_sorted_either_way_with_what_is_not_known_last(store: Path) -> None:
    falling = files(call("list", store, "--sort", "-sun_rpm"))
    assert (falling[0], falling[-1]) == ("d.mcap", "notes.mcap")
    assert files(call("list", store, "--sort", "load"))[0] == "a.mcap"
    assert files(call("list", store, "--sort", "load"))[-1] == "notes.mcap"


def test_csv_is_read_back(store: Path) -> None:
    outcome = RUNNER.invoke(app, ["runs", "list", str(store), "--csv", "--columns", "file,load,accepted"])
    rows = list(csv.DictReader(outcome.stdout.splitlines()))
    assert {row["file"].removesuffix(".mcap"): float(row["load"]) for row in rows[:4]} == {
        name: load for name, (_, load) in LOADS.items()
    }
    assert [row["accepted"] for row in rows] == ["yes"] * 4 + ["no", ""]


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (("--where", "sun_rmp > 1"), "sun_rpm"),
        (("--sort", "sun_rp"), "sun_rpm"),
        (("--columns", "file,laod"), "load"),
    ],
)
def test_a_column_that_is_none_is_told_with_the_nearest(store: Path, arguments: tuple[str, str], hint: str) -> None:
    assert hint in call("list", store, *arguments, expect=2)["error"]["do"]


def test_a_word_that_no_run_has_is_told(store: Path) -> None:
    result = call("list", store, "--where", "configuration = 'engagd'")
    assert not files(result)
    assert "engaged" in result["findings"][0]["message"]


@pytest.mark.parametrize("name", ["falling", "falling.mcap", "E_falling"])
def test_one_recording_is_shown_by_any_of_its_names(store: Path, name: str) -> None:
    data = call("show", store, name)["data"]
    assert data["recording"]["file"] == "falling.mcap"
    assert data["windows"][0]["accepted"] is False
    assert data["windows"][0]["reasons"]
    assert "torque_sun" in data["channels"]
    text = RUNNER.invoke(app, ["runs", "show", str(store), data["recording"]["sha256"][:8]]).stdout
    for told in ("rejected: ", "T-sun", "2025-04-23T08:20", data["recording"]["sha256"], "torque_ring"):
        assert told in text


def test_limits_have_the_units_of_a_campaign_file(store: Path, tmp_path: Path) -> None:
    text = RUNNER.invoke(app, ["runs", "show", str(store), "falling"]).stdout
    assert re.search(r"speed_change +0\.5 rpm$", text, flags=re.MULTILINE)
    assert re.search(r"torque_drift +1 %$", text, flags=re.MULTILINE)
    assert "[?]" not in text
    other = tmp_path / "recordings"
    other.mkdir()
    run_of(other, "b", 40, 1200.0, 1.56)
    ingest(other, Store(tmp_path / "other"), workers=1, limits=Steadiness(speed_change=0.75 * RPM))
    words = ["runs", "diff", str(store), "b", "b", "--store-b", str(tmp_path / "other")]
    assert re.search(r"limits\.speed_change +0\.5 rpm +0\.75 rpm$", RUNNER.invoke(app, words).stdout, re.MULTILINE)


def test_a_failed_file_is_shown_with_its_findings(store: Path) -> None:
    text = RUNNER.invoke(app, ["runs", "show", str(store), "notes"]).stdout
    assert "failed" in text
    assert "1 finding" in text


def test_a_name_that_is_none_is_told_with_the_nearest(store: Path) -> None:
    assert "falling'" in call("show", store, "faling", expect=2)["error"]["do"]


def test_runs_that_are_alike_differ_within_u_and_others_beyond(store: Path, tmp_path: Path) -> None:
    other = tmp_path / "recordings"
    other.mkdir()
    run_of(other, "b", 40, 1200.0, 1.56)
    run_of(other, "d", 41, 1800.0, 1.56, torque=0.9)
    ingest(other, Store(tmp_path / "other"), workers=1)
    same = call("diff", store, "b", "b", "--store-b", tmp_path / "other")["data"]
    assert same["beyond_U"] is False
    assert set(same["differs"]) >= {"run.started_at", "sha256"}
    assert "run.point" not in same["differs"]
    result = call("diff", store, "d", "d", "--store-b", tmp_path / "other", "--fail-on", "mismatch", expect=1)
    means = {mean["quantity"]: mean for mean in result["data"]["windows"][0]["means"]}
    assert means["torque_sun_Nm"]["difference"] == pytest.approx(-0.1, abs=1e-3)
    assert means["torque_sun_Nm"]["beyond_U"] is True
    assert means["torque_ring_Nm"]["beyond_U"] is False
    # one transducer: 0.2 % of the difference, half-width of a rectangle, is the least it can be off by
    assert means["torque_sun_Nm"]["u"] >= 0.002 * 0.1 / 3**0.5


def test_another_transducer_shares_nothing(store: Path, tmp_path: Path) -> None:
    from tests.recording.writer import CALIBRATION, Bench, write

    other = tmp_path / "recordings"
    other.mkdir()
    write(other / "x.mcap", Bench(calibration=CALIBRATION.replace("T-sun", "T-new")))
    write(other / "y.mcap", Bench(run={"started_at": "2025-04-24T08:00:00Z", "point": "P2"}))
    write(other / "z.mcap", Bench(run={"started_at": "2025-04-25T08:00:00Z", "point": "P3"}))
    ingest(other, Store(tmp_path / "other"), workers=1)

    def spread(a: str, b: str) -> float:
        means = call("diff", tmp_path / "other", a, b)["data"]["windows"][0]["means"]
        return float(next(mean["u"] for mean in means if mean["quantity"] == "torque_sun_Nm"))

    within = 0.8 * 0.002 / 3**0.5
    assert spread("y", "z") < within < spread("x", "y")


def test_the_index_is_made_once_and_anew_when_a_run_is_added(store: Path, tmp_path: Path) -> None:
    assert open_catalogue(Store(store)).rebuilt
    assert not open_catalogue(Store(store)).rebuilt
    more = tmp_path / "more"
    more.mkdir()
    run_of(more, "e", 50, 900.0, 1.0)
    ingest(more, Store(store), workers=1)
    assert "e.mcap" in files(call("list", store))
    assert not open_catalogue(Store(store)).rebuilt


@pytest.mark.parametrize("damage", ["gone", "empty", "cut", "text", "byte", "row", "view"])
def test_a_damaged_index_is_made_anew(store: Path, damage: str) -> None:
    first = call("list", store, "--columns", "all")["data"]
    path = store / FILE
    whole = path.read_bytes()
    if damage == "gone":
        path.unlink()
    elif damage in ("row", "view"):
        with sqlite3.connect(path) as connection:
            if damage == "row":
                connection.execute("UPDATE SubMatrix SET load = 9")
            else:
                connection.execute("DROP VIEW runs")
        connection.close()
    else:
        at = whole.index(b"falling.mcap")
        path.write_bytes(
            {
                "empty": b"",
                "cut": whole[: len(whole) // 2],
                "text": b"no database" * 100,
                "byte": whole[:at] + b"F" + whole[at + 1 :],
            }[damage]
        )
    assert call("list", store, "--columns", "all")["data"] == first
    assert path.read_bytes() == whole


def test_the_tables_have_the_names_of_ods(store: Path) -> None:
    call("list", store)
    with sqlite3.connect(store / FILE) as connection:
        counts = {name: connection.execute(f"SELECT COUNT(*) FROM {name}").fetchone()[0] for name in TABLES}
    connection.close()
    assert counts == {"Environment": 1, "Test": 1, "Measurement": 6, "SubMatrix": 5, "MeaQuantity": 20, "Remark": 0}


@pytest.mark.parametrize("damage", ["text", "field", "lacking", "digit", "samples"])
def test_a_damaged_manifest_is_told_and_the_rest_listed(store: Path, damage: str) -> None:
    path = next((store / "sources").glob("b-*.json"))
    if damage == "text":
        path.write_text("{")
    elif damage == "samples":
        (store / "runs" / f"{path.stem}.parquet").unlink()
    else:
        document = json.loads(path.read_text())
        if damage == "digit":
            document["windows"][0]["means"]["sun"]["torque"] += 1e-3
        elif damage == "lacking":
            del document["windows"][0]["means"]
        else:
            document["windows"][0]["means"]["sun"]["torque"] = "much"
        path.write_bytes(json.dumps(document).encode() if damage == "digit" else proven_json(document))
    for _ in range(2):  # made, and read back
        result = call("list", store, expect=3)
        assert "b.mcap" not in files(result)
        assert len(files(result)) == 5
        assert path.name in result["findings"][0]["where"]


def test_what_would_steer_a_terminal_is_spelled_out(store: Path) -> None:
    path = next((store / "sources").glob("a-*.json"))
    document = json.loads(path.read_text())
    document["windows"][0]["point"] = "\x1b[31mred\n"
    path.write_bytes(proven_json(document))
    outcome = RUNNER.invoke(app, ["runs", "list", str(store)])
    assert "\x1b" not in outcome.stdout
    assert r"\x1b[31mred\n" in outcome.stdout


def analysed(store: Path) -> None:
    """Leave in a store what an analysis does: the grid, with uncertainties of its own."""
    grid = measured_grid(*choose_campaign(Store(store), None), load_bench())
    frame = grid_frame(grid).assign(u_sun_Nm=0.004, u_ring_Nm=0.003, common_sun_Nm=0.02)
    buffer = io.BytesIO()
    pl.DataFrame({name: frame[name].tolist() for name in frame.columns}).write_parquet(buffer)
    folder = store / "analysis"
    folder.mkdir(exist_ok=True)
    (folder / "grid.parquet").write_bytes(buffer.getvalue())
    document: dict[str, Any] = {"schema": "pmg.analysis/1", "campaign": grid.campaign, "origin": grid.origin}
    document |= {"options": AnalysisOptions().document(), "grid_sha256": hashlib.sha256(buffer.getvalue()).hexdigest()}
    (folder / "analysis.json").write_text(json.dumps(document))


def test_uncertainties_are_those_of_the_analysis(store: Path) -> None:
    within = call("list", store, "--columns", "u_torque_sun_Nm,analysed")["data"]["runs"][0]
    assert within["u_torque_sun_Nm"] < 0.004
    assert within["analysed"] is False
    analysed(store)
    runs = call("list", store, "--columns", "u_torque_sun_Nm,u_ring_Nm,common_sun_Nm,analysed,file")["data"]["runs"]
    assert {run["u_torque_sun_Nm"] for run in runs[:5]} == {0.004}
    assert {run["u_torque_ring_Nm"] for run in runs[:5]} == {0.003}
    assert {run["common_sun_Nm"] for run in runs[:5]} == {0.02}
    assert [run["analysed"] for run in runs] == [True] * 5 + [None]
    mean = call("diff", store, "b", "d")["data"]["windows"][0]["means"][0]
    assert mean["u"] == pytest.approx(0.004 * 2**0.5, rel=1e-3)


def test_an_analysis_of_other_recordings_is_told_and_a_damaged_one_left_out(store: Path, tmp_path: Path) -> None:
    analysed(store)
    assert not call("list", store)["findings"]
    more = tmp_path / "more"
    more.mkdir()
    run_of(more, "e", 50, 900.0, 1.0)
    ingest(more, Store(store), workers=1)
    assert "lacks 1 windows and has 0 others" in call("list", store)["findings"][0]["message"]
    (store / "analysis" / "grid.parquet").write_bytes(b"no table")
    result = call("list", store, "--columns", "analysed")
    assert "left out" in result["findings"][0]["message"]
    assert not any(run["analysed"] for run in result["data"]["runs"])


def test_a_grid_read_from_tables_is_listed(published_folder: Path, tmp_path: Path) -> None:
    from pmg.pipeline.commands.analyse import run_analyse
    from pmg.pipeline.fit.options import chosen_options

    options = chosen_options(
        published=True, terms_sun=None, terms_ring=None, correction=None, include_rest=None, robust=False
    )
    run_analyse(tmp_path / "s", options, grids=published_folder, campaign=None)
    rows = call("list", tmp_path / "s", "--where", "status = 'table' and configuration = 'engaged'")["data"]["runs"]
    assert len(rows) == (published_folder / "engaged_grid.csv").read_text().strip().count("\n")
    assert call("show", tmp_path / "s", rows[0]["point"])["data"]["windows"][0]["torque_sun_Nm"] == pytest.approx(
        rows[0]["torque_sun_Nm"]
    )


def test_a_catalogue_that_cannot_be_kept_is_made_all_the_same(store: Path) -> None:
    (store / FILE).mkdir()
    for _ in range(2):
        result = call("list", store)
        assert len(files(result)) == 6
        assert result["findings"][0]["severity"] == "info"


def test_a_failed_file_has_no_means_to_compare(store: Path) -> None:
    assert call("diff", store, "notes", "b")["data"]["windows"][0]["means"] == []


def test_no_store_is_told(tmp_path: Path) -> None:
    assert "ingest" in call("list", tmp_path / "none", expect=2)["error"]["do"]


def test_a_run_in_motion_is_no_window_that_an_analysis_lacks(store: Path) -> None:
    grid = measured_grid(*choose_campaign(Store(store), None), load_bench())
    window = Entry({"name": "E_a", "begin_s": 0.0, "accepted": 1, "analysed": 0})
    moving = Entry({"name": "ramp", "begin_s": 1.0, "accepted": 1})
    for part, lacking in ((window, 1), (moving, 0)):
        _, (remark,) = _with_grid([Entry({"campaign": grid.campaign}, (part,))], grid)
        assert f"it lacks {lacking} windows and has {len(grid)} others" in remark.message
