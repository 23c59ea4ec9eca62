"""The commands as a user meets them: exit codes, JSON, errors that say what to do."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jsonschema
import pytest
from tests.conftest import ROOT
from tests.recording.writer import Bench, write
from tests.report import chromium
from tests.slow import slow
from typer.testing import CliRunner

from pmg.pipeline.analysis.outputs import read_analysis
from pmg.pipeline.chapters.studies import validation
from pmg.pipeline.cli.app import app
from pmg.pipeline.cli.progress_line import progress_line
from pmg.pipeline.commands.crate import FILE as CRATE
from pmg.pipeline.store.audit_trail import read_trail
from pmg.pipeline.thesis_figures.compared import compared_figures
from pmg.pipeline.thesis_figures.rounding import FEWEST_DRAWS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

pytestmark = pytest.mark.usefixtures("undrawn")

RUNNER = CliRunner()
PUBLISHED = ROOT / "raw" / "published"
EXAMPLE = ROOT / "raw" / "example"
SCHEMA = ROOT / "pipeline" / "diagnosis" / "diagnosis.schema.json"


def call(*arguments: object, expect: int) -> dict[str, Any]:
    outcome = RUNNER.invoke(app, [*map(str, arguments), "--json"])
    assert outcome.exit_code == expect, outcome.stderr
    result: dict[str, Any] = json.loads(outcome.stdout)
    assert result["exit_code"] == expect
    assert "Traceback" not in outcome.stderr
    return result


def hashes(paths: Iterable[Path]) -> dict[str, str]:
    return {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in paths}


@pytest.fixture(scope="module", autouse=True)
def few_draws() -> Iterator[None]:
    """Hundreds of draws of the published tables take longer than all that is tested here."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            validation, "compared_figures", lambda grid, bench, _: compared_figures(grid, bench, 2 * FEWEST_DRAWS)
        )
        yield


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path, Path]:
    folder = tmp_path_factory.mktemp("published")
    store, report = folder / "store", folder / "report"
    chosen = ("--terms-sun", "auto", "--terms-ring", "auto", "--robust")
    result = call("run", "--grids", PUBLISHED, "--store", store, "--report", report, *chosen, expect=0)
    return result, store, report


def test_published_grids_end_in_a_report(published: tuple[dict[str, Any], Path, Path]) -> None:
    _, store, report = published
    assert (report / "report.html").stat().st_size > 100_000
    for name in ("neutral_grid", "engaged_grid", "losses"):
        assert (store / "analysis" / f"{name}.csv").is_file()
        assert (store / "analysis" / f"{name}.parquet").is_file()
    document = json.loads((report / "diagnosis.json").read_text())
    jsonschema.validate(document, json.loads(SCHEMA.read_text()))
    assert document["verdict"] != "consistent"
    assert len(list((report / "figures").glob("*.png"))) >= 6
    assert (report / "tables" / "power-flow-table.csv").read_text().count("\n") == 1 + 48 * 4


@chromium.needed
def test_the_oddities_of_the_tables_stand_on_the_first_screen(
    published: tuple[dict[str, Any], Path, Path], tmp_path: Path
) -> None:
    with chromium.tab(tmp_path / "profile") as tab:
        tab.show(1366)
        tab.open(published[2] / "report.html")
        found = tab.ask(
            "Array.from(document.querySelectorAll('.cautions li'), li => [li.textContent,"
            " li.getBoundingClientRect().bottom, parseFloat(getComputedStyle(li).fontSize)])"
        )
        marked = tab.ask("Array.from(document.querySelectorAll('.part.marked'), part => part.textContent)")
    for words in ("two measured ring torques", "follows the sun's speed", "one pattern over speed"):
        ((bottom, letters),) = ((low, size) for text, low, size in found if words in text)
        assert bottom <= 768
        assert letters >= 14
    places = [" ".join(text.split()) for text in marked]
    assert places == ["magnetic gear Inspect", "ring bearings Inspect", "ring torque transducer Inspect"]


def test_grids_go_in_by_their_bytes_and_the_report_comes_out_by_its(
    published: tuple[dict[str, Any], Path, Path],
) -> None:
    _, store, report = published
    entry = read_trail(store).calls[0]
    assert {each["path"]: each["sha256"] for each in entry["read"]} == hashes(sorted(PUBLISHED.glob("*_grid.csv")))
    written = {each["path"]: each["sha256"] for each in entry["written"]}
    assert written.items() >= hashes(p for p in report.rglob("*") if p.is_file()).items()
    assert {path.split("/")[0] for path in written if not path.startswith(str(report))} == {"analysis", "store.json"}


@slow
def test_same_input_same_report_and_a_mismatch_exits_with_one_where_asked(
    published: tuple[dict[str, Any], Path, Path], tmp_path: Path
) -> None:
    _, store, report = published
    call("compare", "--store", store, "--report", tmp_path / "again", "--fail-on", "mismatch", expect=1)
    first = {p.relative_to(report): p.read_bytes() for p in report.rglob("*") if p.is_file()}
    second = {p.relative_to(tmp_path / "again"): p.read_bytes() for p in (tmp_path / "again").rglob("*") if p.is_file()}
    assert {name for name in first if first[name] != second.get(name)} == {Path(CRATE)}  # which holds the time of day
    assert first.keys() == second.keys()


def test_options_reach_the_analysis(tmp_path: Path) -> None:
    grids = ROOT / "raw" / "published"
    result = call(
        "analyse", "--grids", grids, "--store", tmp_path / "s", "--terms-sun", "0,1/2,1", "--k-corr", "rule", expect=0
    )
    analysis = result["data"]["analysis"]
    assert analysis["options"]["powers_sun"] == [0.0, 0.5, 1.0]
    assert analysis["calibration"]["constants"]["K_corr"]["value"] == pytest.approx(analysis["correction_by_rule"])


def test_terms_chosen_by_the_data_are_stored_with_their_ranking(
    published: tuple[dict[str, Any], Path, Path],
) -> None:
    result, store, report = published
    analysis = result["data"]["analyse"]["analysis"]
    for shaft in ("sun", "ring"):
        terms = analysis["terms"][shaft]
        assert terms["chosen"] == analysis["options"][f"powers_{shaft}"] == analysis["loss_curves"][shaft]["powers"]
        assert terms["ranking"][0]["within_one_standard_error"]
        assert analysis["loss_curves"][shaft]["down_weighted"] > 0
        assert analysis["other_shaft"][shaft]["p"] < 0.01
    assert analysis["repeats_and_order"]["nothing_to_compare"]
    assert "only together" in analysis["correction"]["told"]
    _, options = read_analysis(store)
    assert options.auto_sun
    assert options.robust
    for name in ("terms-sun", "terms-ring", "other-shaft", "correction-joint"):
        assert (report / "tables" / f"{name}.csv").is_file()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("analyse", "--store", "{tmp}/none"), "Run 'pmg ingest' first"),
        (("compare", "--store", "{tmp}/none", "--report", "{tmp}/r"), "no such folder"),
        (("ingest", "{tmp}/none", "--store", "{tmp}/s"), "Check the path"),
        (("ingest", "{tmp}", "--store", "{tmp}/s"), "recordings with the ending .mcap"),
        (("run", "--store", "{tmp}/s", "--report", "{tmp}/r"), "one of them"),
        (("analyse", "--store", "{tmp}/s", "--grids", "{tmp}"), "no such file"),
        (("analyse", "--store", "{tmp}/s", "--grids", "{grids}", "--terms-sun", "0,fast"), "exponents"),
        (("analyse", "--store", "{tmp}/s", "--grids", "{grids}", "--k-corr", "jint"), "Did you mean 'joint'?"),
        (("analyse", "--store", "{tmp}/s", "--grids", "{grids}", "--k-corr", "1.7"), "number from 0 to 1"),
    ],
)
def test_what_cannot_run_says_why_and_exits_with_two(arguments: tuple[str, ...], words: str, tmp_path: Path) -> None:
    filled = [a.format(tmp=tmp_path, grids=ROOT / "raw" / "published") for a in arguments]
    result = call(*filled, expect=2)
    assert result["data"] is None
    assert words in " ".join(result["error"].values())


def test_a_grid_with_a_hole_names_the_cell(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "raw" / "published", tmp_path / "grids")
    path = tmp_path / "grids" / "engaged_grid.csv"
    lines = path.read_text().splitlines()
    gone = lines.pop(10)
    path.write_text("\n".join(lines) + "\n")
    result = call("analyse", "--grids", tmp_path / "grids", "--store", tmp_path / "s", expect=3)
    speed, load = gone.split(",")[0], gone.split(",")[2]
    assert result["data"]["analysis"]["holes"] == [f"engaged, sun {speed} rpm, load {load} N m"]


def test_an_empty_cell_is_named_by_line_and_column(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "raw" / "published", tmp_path / "grids")
    path = tmp_path / "grids" / "neutral_grid.csv"
    lines = path.read_text().splitlines()
    lines[6] = "0,300,,0.23,0.25"
    path.write_text("\n".join(lines) + "\n")
    error = call("analyse", "--grids", tmp_path / "grids", "--store", tmp_path / "s", expect=2)["error"]
    assert error["where"].endswith("line 7, column sun_loss_torque_Nm")


def test_recordings_with_damage_among_them_go_on_and_exit_with_three(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    names = [f"{i:04d}.mcap" for i in range(0, 288, 6)]
    for name in names:
        shutil.copy(EXAMPLE / name, folder / name)
    whole = (folder / names[5]).read_bytes()
    (folder / names[5]).write_bytes(whole[: len(whole) // 2])
    (folder / "notes.mcap").write_text("not a recording")
    store = tmp_path / "store"
    result = call("ingest", folder, "--store", store, expect=3)
    assert result["data"]["failed"] == 2
    assert call("analyse", "--store", store, expect=3)["data"]["analysis"]["campaign"]
    files = {finding["file"] for finding in result["findings"] if "file" in finding}
    assert {names[5], "notes.mcap"} <= files
    before = {p: d for p in (store / "sources").iterdir() if '"failed"' not in (d := p.read_text())}
    (folder / names[5]).write_bytes(whole)
    (folder / "notes.mcap").unlink()
    again = call("ingest", folder, "--store", store, expect=0)
    assert again["data"]["ingested"] == 1
    assert again["data"]["skipped"] == len(names) - 1
    assert all(path.read_text() == data for path, data in before.items())
    left = [json.loads(path.read_text()) for path in (store / "sources").iterdir()]
    assert [d["file"] for d in left if d["status"] == "failed"] == ["notes.mcap"]


def test_a_store_is_not_made_over_other_things(tmp_path: Path) -> None:
    (tmp_path / "thesis.doc").write_text("years of work")
    error = call("ingest", EXAMPLE, "--store", tmp_path, expect=2)["error"]
    assert "nothing was changed" in error["do"]
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.doc"]


def test_an_interrupt_exits_with_130(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pmg.pipeline.commands.compare.read_analysis", interrupted)
    call("compare", "--store", tmp_path, "--report", tmp_path / "r", expect=130)


def test_a_defect_exits_with_70_and_shows_its_trace(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("a defect planted by this test")

    monkeypatch.setattr("pmg.pipeline.commands.compare.read_analysis", broken)
    outcome = RUNNER.invoke(app, ["compare", "--store", str(tmp_path), "--report", str(tmp_path / "r")])
    assert outcome.exit_code == 70
    assert "planted by this test" in outcome.stderr


@pytest.mark.parametrize(
    ("grid", "line", "text", "words"),
    [
        ("neutral_grid.csv", 6, "0,inf,0.02,0.23,0.25", "finite"),
        ("neutral_grid.csv", 6, "-60,300,0.02,0.23,0.25", "magnitude"),
        ("engaged_grid.csv", 4, "156,-60,1.95,0.77,1.82,0.7614,1.8233", "magnitude"),
        ("engaged_grid.csv", 4, "156,90,1.95,0.77,1.82,0.7614,1.8233", "ratio"),
    ],
)
def test_a_published_line_that_cannot_be_is_named(grid: str, line: int, text: str, words: str, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "raw" / "published", tmp_path / "grids")
    lines = (tmp_path / "grids" / grid).read_text().splitlines()
    lines[line] = text
    (tmp_path / "grids" / grid).write_text("\n".join(lines) + "\n")
    error = call("analyse", "--grids", tmp_path / "grids", "--store", tmp_path / "s", expect=2)["error"]
    assert f"line {line + 1}" in error["where"]
    assert words in error["expected"]


def test_impossible_terms_leave_the_stored_analysis_alone(tmp_path: Path) -> None:
    grids, store = ROOT / "raw" / "published", tmp_path / "s"
    call("analyse", "--grids", grids, "--store", store, expect=0)
    before = (store / "analysis" / "analysis.json").read_bytes()
    call("analyse", "--grids", grids, "--store", store, "--terms-sun=-1,0", expect=2)
    assert (store / "analysis" / "analysis.json").read_bytes() == before


def test_constants_that_the_points_do_not_determine_are_named(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "raw" / "published", tmp_path / "grids")
    path = tmp_path / "grids" / "engaged_grid.csv"
    path.write_text("\n".join(path.read_text().splitlines()[:5]) + "\n")  # one speed, four loads
    store = tmp_path / "s"
    result = call("analyse", "--grids", tmp_path / "grids", "--store", store, "--k-corr", "joint", expect=3)
    assert result["data"]["analysis"]["calibration"] is None
    assert "do not determine" in " ".join(result["data"]["analysis"]["not_done"])
    assert not (store / "analysis" / "losses.csv").exists()


def test_a_clean_ingest_does_not_answer_for_what_lay_in_the_store(tmp_path: Path) -> None:
    odd = tmp_path / "odd"
    odd.mkdir()
    write(odd / "a.mcap", Bench(acceleration=60.0))
    store = tmp_path / "s"
    call("ingest", odd, "--store", store, expect=3)
    call("ingest", ROOT / "tests" / "data", "--store", store, "--fail-on", "findings", expect=0)


def test_steps_of_two_stages_that_begin_alike_are_both_shown(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_line(quiet=False, what="run") as show:
        show(0, 2, "compare: simulation")
        show(0, 5, "compare: constants")
        show(0, 5, "compare: constants")
    assert capsys.readouterr().err.split("\n") == ["run 0/2 compare: simulation", "run 0/5 compare: constants", ""]
