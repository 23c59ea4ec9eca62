"""Every command by one table: what it prints under ``--json``, its exit codes, its help."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
import typer
from tests.balance.slide import make_case, plain
from tests.bench.help import HEAVY, PROBE, walk
from tests.conftest import FILES, ROOT
from tests.importers import written
from tests.recording.writer import Bench, write
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.json_values import PROOF
from pmg.pipeline.fit import analysis
from pmg.pipeline.fit.analysis import Analysis
from pmg.pipeline.recording.remark import Remark
from pmg.sim.errors import FitError, StoreError

pytestmark = pytest.mark.usefixtures("undrawn")

RUNNER = CliRunner()
PLAIN_TERMS = ("--terms-sun", "0,1", "--terms-ring", "0,1")


@dataclass(frozen=True)
class Wrong:
    """Words of a call that cannot run, and what the error says of them."""

    words: str
    says: str


@dataclass(frozen=True)
class Row:
    """A command: the stage it calls, words with which it runs and its code then, words with which it cannot.

    Words in braces are places that the fixture `places` makes; `{tmp}` is an empty folder.
    """

    stage: str
    runs: str
    wrong: tuple[Wrong, ...]
    code: int = 0
    more: tuple[tuple[str, int], ...] = ()
    fails_on: bool = True


NO_STORE = "{tmp}/none"
TABLE: dict[str, Row] = {
    "ingest": Row(
        "commands.ingest.run_ingest",
        "{campaign} --store {tmp}/s --workers 1",
        (
            Wrong("{tmp}/none --store {tmp}/s", "none"),
            Wrong("{campaign} --store {tmp}/s --shard 3/2", "3/2"),
            Wrong("{campaign} --store {tmp}/s --limits {bad_key}", "shortets"),
            Wrong("{campaign} --store {tmp}/s --workers many", "--workers"),
        ),
        code=3,
        more=(
            ("{sound} --store {tmp}/s --workers 1", 0),
            ("{sound} --store {tmp}/s --workers 1 --fail-on findings", 1),
            ("{damaged} --store {tmp}/s --workers 1", 3),
        ),
    ),
    "analyse": Row(
        "commands.analyse.run_analyse",
        "--grids {grids} --store {tmp}/s --terms-sun 0,1 --terms-ring 0,1",
        (
            Wrong(f"--store {NO_STORE}", "pmg ingest"),
            Wrong("--store {broken_store}", "Ingest its source again"),
            Wrong("--grids {tmp} --store {tmp}/s", "no such file"),
            Wrong("--grids {grids} --store {tmp}/s --terms-sun 0,fast", "fast"),
            Wrong("--config {bad_config}", "stoer"),
            Wrong("--stoer x", "--stoer"),
        ),
        more=(
            ("--grids {holed} --store {tmp}/s --terms-sun 0,1 --terms-ring 0,1", 3),
            ("--store {changed_store}", 3),
        ),
    ),
    "compare": Row(
        "commands.compare.run_compare",
        "--store {analysed} --report {tmp}/r",
        (
            Wrong(f"--store {NO_STORE} --report {{tmp}}/r", "pmg ingest"),
            Wrong("--store {analysed} --report {tmp}/r --model {notes}", "notes"),
            Wrong("--store {broken_analysis} --report {tmp}/r", "pmg analyse"),
            Wrong("--store {analysed}", "report"),
            Wrong("--store {analysed} --report {tmp}/r --campaign none", "no campaign 'none'"),
        ),
    ),
    "run": Row(
        "commands.compare.run_all",
        "--grids {grids} --store {tmp}/s --report {tmp}/r --terms-sun 0,1 --terms-ring 0,1 --fail-on mismatch",
        (
            Wrong("--store {tmp}/s --report {tmp}/r", "one of them"),
            Wrong("{tmp}/none --store {tmp}/s --report {tmp}/r", "none"),
            Wrong("--config {bad_config}", "stoer"),
        ),
        code=1,
    ),
    "simulate": Row(
        "commands.simulate.run_simulate",
        "{scenario} --out {tmp}/o",
        (
            Wrong("{tmp}/none.toml --out {tmp}/o", "none.toml"),
            Wrong("{bad_scenario} --out {tmp}/o", "titel"),
            Wrong("{scenario} --out {tmp}/o --with windag", "windag"),
            Wrong("{scenario} --out {tmp}/o --beside {tmp}/none.toml", "none.toml"),
            Wrong("{scenario}", "--out"),
        ),
    ),
    "validate": Row(
        "commands.validate.run_validate",
        "--draws 20",
        (Wrong("--grids {tmp}", "no such file"), Wrong("--draws 2", "20 or more"), Wrong("--seed -1", "--seed")),
    ),
    "residuals": Row(
        "commands.residuals.run_residuals",
        "--store {analysed} --draws 20 --fit curves",
        (
            Wrong(f"--store {NO_STORE}", "pmg"),
            Wrong("--store {analysed} --fit curvs", "curvs"),
            Wrong("--grids {grids} --store {analysed}", "one of"),
        ),
    ),
    "orders": Row(
        "commands.orders.run_orders",
        "--store {store}",
        (Wrong(f"--store {NO_STORE}", "pmg ingest"), Wrong("--store {store} --point P9", "P9")),
    ),
    "design": Row(
        "commands.design.run_design",
        "{root}/raw/plans/thesis.toml",
        (
            Wrong("{tmp}/none.toml", "none.toml"),
            Wrong("{bad_key}", "plan"),
            Wrong(f"--store {NO_STORE}", "pmg"),
            Wrong("", "plan"),
        ),
    ),
    "terms": Row(
        "commands.machines.terms.run_terms",
        "{slide}/case.toml --out {tmp}/o",
        (
            Wrong("{tmp}/none.toml --out {tmp}/o", "none.toml"),
            Wrong("{bad_key} --out {tmp}/o", "bad-key.toml"),
            Wrong("{slide}/case.toml --out {tmp}/o --data {tmp}", "fit.csv"),
        ),
    ),
    "machine new": Row(
        "commands.machines.machine.begin_machine",
        "{tmp}/m.toml --like emps",
        (
            Wrong("{notes}", "nothing was written"),
            Wrong("{tmp}/m.toml --like two-stage", "two-stage-gearbox"),
        ),
    ),
    "machine show": Row(
        "commands.machines.machine.show_machine",
        "two-stage-gearbox",
        (Wrong("{tmp}/none.toml", "none.toml"), Wrong("{bad_key}", "bad-key.toml"), Wrong("{tmp}", "a folder")),
        more=(("", 0),),
    ),
    "bench show": Row(
        "commands.machines.machine.show_bench",
        "",
        (Wrong("--machine {tmp}/none.toml", "none.toml"), Wrong("--machine emps", "magnetic gear")),
        more=(("--machine thesis-gear-2", 0),),
    ),
    "machine check": Row(
        "commands.machines.machine.check_machine",
        "rotary-drive",
        (
            Wrong("{bad_key}", "bad-key.toml"),
            Wrong("rotary-drive {tmp}/none", "no such folder"),
            Wrong("rotary-drve", "rotary-drive"),
        ),
    ),
    "demo": Row(
        "commands.at_bench.demo.run_demo",
        "--store {tmp}/s --report {tmp}/r",
        (Wrong("--store {notes} --report {tmp}/r", "notes"), Wrong("--store {store} --report {store}", "of its own")),
        code=3,  # of the few recordings that stand for the example here
    ),
    "watch": Row(
        "commands.at_bench.watch.run_watch",
        "{sound} --store {tmp}/s --settle 0.05 --idle 0.005",
        (
            Wrong("{tmp}/none --store {tmp}/s", "no such folder"),
            Wrong("{sound} --store {tmp}/s --settle 0", "--settle"),
            Wrong("{sound} --store {tmp}/s --port 70000", "--port"),
            Wrong("{sound} --store {tmp}/s --model {notes}", "notes"),
        ),
    ),
    "next": Row(
        "commands.at_bench.next_sheet.run_next",
        "--store {analysed} --out {tmp}/o",
        (
            Wrong(f"--store {NO_STORE} --out {{tmp}}/o", "pmg ingest"),
            Wrong("--store {analysed}", "--out"),
            Wrong("--store {analysed} --out {notes}", "notes"),
            Wrong("--store {analysed} --out {tmp}/o --campaign none", "no campaign 'none'"),
            Wrong("--store {analysed} --out {tmp}/o --model {notes}", "for steady points"),
        ),
    ),
    "prove": Row(
        "trials.score.stage.run_prove",
        "--out {tmp}/o --campaigns 1 --strata clean --workers 1",
        (
            Wrong("--out {tmp}/o --strata claen", "claen"),
            Wrong("--out {tmp}/o --route gird", "gird"),
            Wrong("--out {tmp}/o --laws usal", "usal"),
            Wrong("--out {notes} --campaigns 1 --strata clean --workers 1", "notes"),
        ),
    ),
    "import": Row(
        "commands.exchange.run_import",
        "{logs}/E1.csv --map {logs}/map.toml --out {tmp}/o",
        (
            Wrong("{tmp}/none.csv --map {logs}/map.toml --out {tmp}/o", "none.csv"),
            Wrong("{logs}/E1.csv --map {bad_key} --out {tmp}/o", "bad-key.toml"),
            Wrong("{logs}/E1.csv --map {logs}/map.toml --out {tmp}/o --set point", "point"),
        ),
    ),
    "export": Row(
        "commands.exchange.run_export",
        "{campaign}/00.mcap --out {tmp}/o.mcap",
        (
            Wrong("{tmp}/none.mcap --out {tmp}/o.mcap", "none.mcap"),
            Wrong("{campaign}/notes.mcap --out {tmp}/o.mcap", "notes.mcap"),
            Wrong("{campaign}/00.mcap --out {tmp}/o.mcap --rate -1", "rate"),
        ),
    ),
    "doctor": Row(
        "commands.doctor.run_doctor",
        "{sound}",
        (
            Wrong("{tmp}/none", "none"),
            Wrong("{tmp}", "mcap"),
            Wrong("{bad_config}", "stoer"),
            Wrong("{slide} --machine emps", "fit.csv"),
        ),
        more=(
            ("{store}", 0),
            ("{damaged}", 2),
            ("{analysed}", 0),
            ("{grids}", 0),
            ("{config}", 0),
            ("{root}/reports/example/model.toml", 0),
            ("{root}/pipeline/machine/shipped/rotary-drive.toml", 0),
        ),
    ),
    "report": Row(
        "commands.report.run_report",
        "{analysed} {analysed} --report {tmp}/r",
        (
            Wrong("{analysed} {tmp}/none --report {tmp}/r", "campaign B"),
            Wrong("{analysed} --report {tmp}/r", "two"),
            Wrong("{analysed} {analysed} --report {tmp}/r --speed-tolerance '5 N m'", "5 N m"),
            Wrong("{analysed} {analysed} --report {tmp}/r --transducers smae", "--transducers"),
            Wrong("{analysed} {broken_analysis} --report {tmp}/r", "pmg analyse"),
        ),
    ),
    "runs list": Row(
        "commands.runs.run_list",
        "{store} --where \"campaign = 'made' and accepted\"",
        (
            Wrong(NO_STORE, "pmg ingest"),
            Wrong("{store} --where 'sun_rmp > 1'", "sun_rmp"),
            Wrong("{store} --sort sun_rmp", "sun_rmp"),
            Wrong("{store} --columns sun_rmp", "sun_rmp"),
        ),
        more=(("{broken_store}", 3),),
    ),
    "runs show": Row(
        "commands.runs.run_show",
        "{store} 05.mcap",
        (Wrong(f"{NO_STORE} 05.mcap", "pmg ingest"), Wrong("{store} 99.mcap", "99.mcap"), Wrong("{store}", "NAME")),
    ),
    "runs diff": Row(
        "commands.runs.run_diff",
        "{store} 00.mcap 05.mcap",
        (
            Wrong(f"{NO_STORE} 00.mcap 05.mcap", "pmg ingest"),
            Wrong("{store} 00.mcap 99.mcap", "99.mcap"),
            Wrong("{store} 00.mcap 05.mcap --store-b {tmp}/none", "pmg ingest"),
        ),
        more=(("{store} 00.mcap 05.mcap --fail-on mismatch", 1),),
    ),
    "runs audit": Row("commands.audit.run_audit", "{store}", (Wrong(NO_STORE, "pmg ingest"),)),
    "config show": Row(
        "commands.config.run_show",
        "--config {config} --origin",
        (Wrong("--config {bad_config}", "stoer"), Wrong("--config {tmp}/none.toml", "none.toml")),
        fails_on=False,
    ),
    "config check": Row(
        "commands.config.run_check",
        "{config}",
        (Wrong("{bad_config}", "stoer"), Wrong("{tmp}/none.toml", "none.toml"), Wrong("{campaign}/00.mcap", "00.mcap")),
    ),
    "config template": Row("commands.config.run_template", "", (Wrong("{tmp}", "argument"),), fails_on=False),
}
"""Every command of pmg by its words."""


# --- what the commands work on -------------------------------------------------------------------------


def _small(grids: Path) -> None:
    """Some 40 cells of the published grids: all kinds of speed and load, too few to keep a diagnosis busy."""
    grids.mkdir()
    for name, step in (("neutral_grid.csv", (312, 180)), ("engaged_grid.csv", (312, 60))):
        head, *rows = (ROOT / "raw" / "published" / name).read_text().splitlines()
        cells = [row for row in rows if all(int(v) % s == 0 for v, s in zip(row.split(",")[:2], step, strict=True))]
        (grids / name).write_text("\n".join([head, *cells]) + "\n")


def _broken_store(sound: Path, store: Path) -> None:
    shutil.copytree(sound, store)
    for path in (store / "sources").glob("*.json"):
        path.write_text('{"schema": "pmg.st')


def _changed_store(sound: Path, store: Path) -> None:
    """Another digit in one mean."""
    shutil.copytree(sound, store)
    path = min((store / "sources").glob("*.json"))
    text = path.read_text()
    path.write_text(re.sub(r'("torque": -?\d+\.\d)(\d)', lambda m: m[1] + str(9 - int(m[2])), text, count=1))
    assert path.read_text() != text


@pytest.fixture(scope="session")
def places(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Everything that the table names in braces."""
    here = tmp_path_factory.mktemp("commands")
    found = {"campaign": campaign, "root": ROOT}
    for name in ("sound", "damaged", "logs", "slide"):
        found[name] = here / name
        found[name].mkdir()
    for number in range(4):
        run = {"started_at": f"2025-04-23T08:0{number}:00Z"}
        write(found["sound"] / f"0{number}.mcap", Bench(torque={"sun": 0.1 * number, "ring": 1.5}, run=run))
    shutil.copy(campaign / "notes.mcap", found["damaged"])
    for name, text in (
        ("bad-key.toml", "[windows]\nshortets = 1.0\n"),
        ("bad-config.toml", '[store]\nstoer = "x"\n'),
        ("notes.txt", "notes"),
        ("config.toml", '[compare]\nnote = "a bench"\n'),
        ("bad-scenario.toml", 'titel = "x"\n'),
        ("scenario.toml", SCENARIO),
    ):
        found[name.split(".")[0].replace("-", "_")] = here / name
        (here / name).write_text(text)
    (found["logs"] / "E1.csv").write_text(written.csv_text(600), encoding="cp1252", newline="")
    written.write_map(found["logs"], written.map_text(written.PLAIN))
    make_case(found["slide"], plain, 3)
    found["grids"], found["holed"] = here / "grids", here / "holed"
    _small(found["grids"])
    shutil.copytree(found["grids"], found["holed"])
    lines = (found["holed"] / "engaged_grid.csv").read_text().splitlines()
    (found["holed"] / "engaged_grid.csv").write_text("\n".join(lines[:6] + lines[7:]) + "\n")
    found["store"], found["analysed"] = here / "store", here / "analysed"
    assert call("ingest", campaign, "--store", found["store"], "--workers", 1)["exit_code"] == 3
    assert call("analyse", "--grids", found["grids"], "--store", found["analysed"], *PLAIN_TERMS)["exit_code"] == 0
    found["broken_store"], found["broken_analysis"] = here / "broken", here / "broken-analysis"
    _broken_store(found["store"], found["broken_store"])
    found["changed_store"] = here / "changed"
    _changed_store(found["store"], found["changed_store"])
    shutil.copytree(found["analysed"], found["broken_analysis"])
    (found["broken_analysis"] / "analysis" / "analysis.json").write_text("{")
    return found


@pytest.fixture(autouse=True)
def small_example(places: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """The example is as small as the other folders."""
    monkeypatch.setattr("pmg.pipeline.commands.at_bench.demo._example_folder", lambda: places["sound"])


SCENARIO = f"""
title = "One point"
[losses]
K_corr = 0.8
b = 0.0
c = 2.22e-4
d = 0.0
grids = "{ROOT}/raw/published"
[grid]
speed_sun_rpm = [936]
load_Nm = [1.56]
"""


# --- calls ---------------------------------------------------------------------------------------------


def call(*words: object) -> dict[str, Any]:
    """The one object that a command prints under ``--json``, checked for its form."""
    done = RUNNER.invoke(app, [*map(str, words), "--json"])
    assert not isinstance(done.exception, Exception), done.exception
    result: dict[str, Any] = json.loads(done.stdout)
    assert list(result) == ["schema", "command", "exit_code", "data", "findings", "error"]
    assert result["schema"] == "pmg.result/1"
    assert result["exit_code"] == done.exit_code
    assert all(set(finding) >= {"severity", "where", "message"} for finding in result["findings"])
    assert (result["error"] is None) or set(result["error"]) == {"where", "came", "expected", "do"}
    assert (result["error"] is None) != (result["data"] is None)
    assert ("Traceback" in done.stderr) == (result["exit_code"] == 70)
    assert result["error"] is None or all(result["error"].values())
    return result


def filled(text: str, places: dict[str, Path], tmp_path: Path) -> list[str]:
    return [word.format(tmp=tmp_path, **places) for word in shlex.split(text)]


def command_paths() -> list[str]:
    return [" ".join(path) for path, command in walk(typer.main.get_command(app)) if not hasattr(command, "commands")]


def test_every_command_is_in_the_table() -> None:
    assert sorted(command_paths()) == sorted(TABLE)


@pytest.mark.parametrize(
    ("command", "words", "code"),
    [
        (command, words, code)
        for command, row in TABLE.items()
        for words, code in ((row.runs, row.code), *row.more)
    ],
)  # fmt: skip
def test_a_command_that_runs_prints_one_object(
    command: str, words: str, code: int, places: dict[str, Path], tmp_path: Path
) -> None:
    result = call(*command.split(), *filled(words, places, tmp_path))
    assert (result["command"], result["exit_code"]) == (command, code), result["error"] or result["findings"]
    assert result["error"] is None


@pytest.mark.parametrize(
    ("command", "wrong"), [(command, wrong) for command, row in TABLE.items() for wrong in row.wrong]
)
def test_a_command_that_cannot_run_says_so_in_four_parts(
    command: str, wrong: Wrong, places: dict[str, Path], tmp_path: Path
) -> None:
    result = call(*command.split(), *filled(wrong.words, places, tmp_path))
    assert (result["command"], result["exit_code"]) == (command, 2)
    assert wrong.says in " ".join(result["error"].values())


@pytest.mark.parametrize("words", [("rnu",), (), ("runs",), ("runs", "lsit")])
def test_words_that_are_no_command_are_told_as_json_too(words: tuple[str, ...]) -> None:
    assert call(*words)["exit_code"] == 2


@pytest.mark.parametrize(
    ("words", "told_first", "hint"),
    [
        (("run", "--stor", "x"), "pmg run: no option '--stor'; expected", "Did you mean '--store'?"),
        (("run", "--zzzz"), "pmg run: no option '--zzzz'; expected", "See 'pmg run --help'."),
        (("rnu",), "pmg: no command 'rnu'; expected", "Did you mean 'run'?"),
        (("runs", "lsit"), "pmg runs: no command 'lsit'; expected", "Did you mean 'list'?"),
        (("run", "--fail-on", "findngs"), "pmg run: --fail-on 'findngs'; expected", "Did you mean 'findings'?"),
        (("run", "--workers", "two"), "pmg run: --workers 'two'; expected a whole number from 1", "Correct it."),
        (("run", "--workers", "0"), "pmg run: --workers '0'; expected a whole number from 1", "Correct it."),
        (("run", "--workers=-1"), "pmg run: --workers '-1'; expected a whole number from 1", "Correct it."),
        (
            ("run", "--fail-on=findngs"),
            "pmg run: --fail-on 'findngs'; expected one of 'never'",
            "Did you mean 'findings'?",
        ),
        (("config", "check"), "pmg config check: FILE is missing; expected", "Add FILE."),
        (("report", "a", "b"), "pmg report: --report is missing; expected", "Add --report."),
        (("run", "a", "b"), "pmg run: got unexpected extra argument", "See 'pmg run --help'."),
    ],
)
def test_wrong_words_have_the_form_of_every_error(words: tuple[str, ...], told_first: str, hint: str) -> None:
    done = RUNNER.invoke(app, words)
    lines = done.stderr.splitlines()
    assert (done.exit_code, done.stdout, len(lines)) == (2, "", 2)
    assert lines[0].startswith(told_first)
    assert lines[1].startswith(f"hint: {hint}")
    error = call(*words)["error"]
    assert lines[0] == f"{error['where']}: {error['came']}; expected {error['expected']}."


@pytest.mark.parametrize(
    ("place", "says"),
    [("{sound}", "a folder of recordings"), ("{sound}/00.mcap", "a recording"), ("{tmp}/none", "no such folder")],
)
@pytest.mark.parametrize("command", ["runs list {}", "compare --report {{tmp}}/r --store {}", "design --store {}"])
def test_what_is_no_store_is_told_for_what_it_is(
    command: str, place: str, says: str, places: dict[str, Path], tmp_path: Path
) -> None:
    error = call(*filled(command.format(place), places, tmp_path))["error"]
    assert error["came"] == says
    assert "pmg ingest" in error["do"]


@pytest.mark.parametrize("command", ["design --store {store}", "residuals --draws 20 --store {store}"])
def test_a_refusal_comes_with_what_was_remarked_on_before(
    command: str, places: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = shutil.copytree(places["analysed"], tmp_path / "store")
    summary = store / "analysis" / "analysis.json"
    held = {key: value for key, value in json.loads(summary.read_text()).items() if key != PROOF}
    summary.write_text(json.dumps(held))

    def analyse(*given: Any) -> Analysis:  # noqa: ANN401 - as the stage gives it
        return replace(analysis.analyse(*given), fits=None, calibration=None, missing=(FitError("a", "b", "c", "d"),))

    monkeypatch.setattr(f"pmg.pipeline.commands.{command.split()[0]}.analyse", analyse)
    words = command.format(store=store).split()
    result = call(*words)
    assert (result["exit_code"], result["error"]["came"], result["data"]) == (2, "b", None)
    assert ["unproven" in finding["message"] for finding in result["findings"]] == [True]
    told = RUNNER.invoke(app, words).stderr
    assert "a: b; expected c.\nhint: d\n" in told
    assert "unproven" in told


def test_an_interrupted_command_goes_on_or_begins_anew(plant: Plant, places: dict[str, Path], tmp_path: Path) -> None:
    for command, word in (("ingest", "resume"), ("doctor", "anew"), ("compare", "anew")):
        plant(TABLE[command].stage, raises(KeyboardInterrupt()))
        error = call(*command.split(), *filled(TABLE[command].runs, places, tmp_path))["error"]
        assert word in error["do"]


def test_a_reader_that_has_read_enough_is_no_fault(places: dict[str, Path]) -> None:
    script = f'"{sys.executable}" -m pmg.pipeline runs list "{places["store"]}" --csv --columns all; echo "code $?" >&2'
    done = subprocess.run(
        ["bash", "-c", f"{{ {script}; }} | true"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    whole = call("runs", "list", places["store"])["exit_code"]
    assert done.stderr.splitlines()[-1:] == [f"code {whole}"]
    assert "Broken" not in done.stderr


def test_an_analysis_in_the_place_of_another_is_told_and_its_crate_names_what_it_wrote(
    places: dict[str, Path], tmp_path: Path
) -> None:
    words = ("analyse", "--grids", places["grids"], "--store", tmp_path, *PLAIN_TERMS)
    folder = tmp_path / "analysis"
    shutil.copytree(places["analysed"] / "analysis", folder)
    shutil.copy(places["analysed"] / "store.json", tmp_path)

    def replaced() -> list[str]:
        return [f["message"] for f in call(*words)["findings"] if "replaces the analysis" in f["message"]]

    assert replaced() == []
    summary = json.loads((folder / "analysis.json").read_text())
    (folder / "analysis.json").write_text(json.dumps(summary | {"campaign": "open-gain"}))
    (folder / "notes.txt").write_text("of mine")
    (message,) = replaced()
    assert "open-gain" in message
    graph = json.loads((folder / "ro-crate-metadata.json").read_text())["@graph"]
    (action,) = [each for each in graph if each["@type"] == "CreateAction"]
    held = {path.name for path in folder.iterdir()} - {"notes.txt", "ro-crate-metadata.json"}
    assert {each["@id"] for each in action["result"]} == held


# --- codes that a planted stage shows ------------------------------------------------------------------


Plant = Callable[[str, Callable[..., Outcome]], None]


@pytest.fixture
def plant(monkeypatch: pytest.MonkeyPatch) -> Plant:
    """Puts another stage in the place of a command's own."""

    def planted(stage: str, instead: Callable[..., Outcome]) -> None:
        monkeypatch.setattr(f"pmg.pipeline.{stage}", instead)

    return planted


def gives(outcome: Outcome) -> Callable[..., Outcome]:
    return lambda *_, **__: outcome


def raises(problem: BaseException) -> Callable[..., Outcome]:
    def stage(*_: object, **__: object) -> Outcome:
        print("a word that does not belong here", file=sys.stderr)
        raise problem

    return stage


FOUND = Outcome({"a": 1}, ("done",), (Remark("warning", "here", "something"),), mismatch=True)
REFUSAL = StoreError("here", "this", "that", "do it")
PLANTED: tuple[tuple[Callable[..., Outcome], tuple[str, ...], int], ...] = (
    (gives(Outcome({}, ())), (), 0),
    (gives(Outcome({"a": 1}, (), partial=True)), (), 3),
    (gives(Outcome({"a": 1}, (), failed=True)), (), 2),
    (raises(REFUSAL), (), 2),
    (gives(replace(FOUND, refusal=REFUSAL)), (), 2),
    (raises(PermissionError(13, "Permission denied", "/there")), (), 2),
    (raises(RuntimeError("a planted defect")), (), 70),
    (gives(Outcome({"a": float("nan")}, ())), (), 70),
    (raises(KeyboardInterrupt()), (), 130),
)
UNDER_FAIL_ON: tuple[tuple[Callable[..., Outcome], tuple[str, ...], int], ...] = (
    (gives(FOUND), (), 0),
    (gives(FOUND), ("--fail-on", "mismatch"), 1),
    (gives(FOUND), ("--fail-on", "findings"), 1),
    (gives(Outcome({}, ())), ("--fail-on", "findings"), 0),
)


@pytest.mark.parametrize("command", TABLE)
def test_every_exit_code_of_a_command_is_the_one_its_stage_asks_for(
    command: str, plant: Plant, places: dict[str, Path], tmp_path: Path
) -> None:
    row = TABLE[command]
    words = [w for w in filled(row.runs, places, tmp_path) if w not in {"--fail-on", "mismatch"}]
    for stage, more, code in (*PLANTED, *(UNDER_FAIL_ON if row.fails_on else ())):
        plant(row.stage, stage)
        result = call(*command.split(), *words, *more)
        assert (result["command"], result["exit_code"]) == (command, code)
        assert result["data"] is None or code not in {70, 130}


@pytest.mark.parametrize("command", TABLE)
def test_lines_for_people_and_errors_with_a_hint(
    command: str, plant: Plant, places: dict[str, Path], tmp_path: Path
) -> None:
    words = [*command.split(), *filled(TABLE[command].runs, places, tmp_path)]
    words = [w for w in words if w not in {"--fail-on", "mismatch"}]
    plant(TABLE[command].stage, gives(FOUND))
    done = RUNNER.invoke(app, words)
    assert (done.exit_code, done.stdout) == (0, "done\n")
    assert done.stderr.endswith("warning: here: something\n")
    plant(TABLE[command].stage, raises(REFUSAL))
    done = RUNNER.invoke(app, words)
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.endswith(f"pmg {command}: here: this; expected that.\nhint: do it\n")


# --- help ----------------------------------------------------------------------------------------------


def test_help_of_every_command_is_there_and_loads_no_library_of_numbers() -> None:
    done = subprocess.run([sys.executable, "-c", PROBE], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    probed = json.loads(done.stdout)
    assert probed["heavy"] == []
    assert {" ".join(words) for words in probed["helped"]} >= set(TABLE)
    assert set(probed["codes"]) == {0}


def test_the_probe_of_help_sees_a_heavy_import() -> None:
    found = subprocess.run(
        [sys.executable, "-c", "import numpy\n" + PROBE], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert "numpy" in json.loads(found.stdout)["heavy"]
    assert set(HEAVY) >= {"scipy", "numpy", "polars", "matplotlib"}


def test_the_campaign_of_the_table_is_the_dozen_of_the_other_tests(campaign: Path) -> None:
    assert len(list(campaign.iterdir())) == FILES


def test_the_version_is_told_and_is_that_of_the_package() -> None:
    told_version = RUNNER.invoke(app, ["--version"])
    assert (told_version.exit_code, told_version.stdout) == (0, f"pmg {metadata.version('pmg-bench')}\n")


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("pmg runs ", {"list", "show", "diff", "audit"}),
        ("pmg config s", {"show"}),
        ("pmg run --ma", {"--machine", "--map"}),
    ],
)
def test_a_shell_completes_commands_of_groups_and_options(words: str, offered: set[str]) -> None:
    count = str(len(words.split(" ")) - 1)
    environment = {"_PMG_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": count}
    answer = RUNNER.invoke(app, [], env=environment, prog_name="pmg")
    assert set(answer.stdout.split()) == offered
