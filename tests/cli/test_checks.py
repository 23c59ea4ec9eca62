"""What is checked before a stage is called, what help holds, and what pmg says without a command."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import pytest
import typer
from tests.bench.help import walk
from tests.conftest import ROOT
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.cli.checks import OptionCheck
from pmg.pipeline.cli.here import look_around
from pmg.pipeline.cli.progress_line import progress_line

if TYPE_CHECKING:
    from collections.abc import Iterator

RUNNER = CliRunner()
EXAMPLE = ROOT / "raw" / "example"
RUN = f"run {EXAMPLE} --store {{tmp}}/s --report {{tmp}}/r"


def commands() -> Iterator[tuple[str, Any]]:
    for path, command in walk(typer.main.get_command(app)):
        if path and not hasattr(command, "commands"):
            yield " ".join(path), command


COMMANDS = dict(commands())


@pytest.fixture
def no_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    """No stage may be called."""

    def called(*_: object, **__: object) -> None:
        raise AssertionError("the stage was called")

    for stage in (
        "compare.run_all",
        "ingest.ingest_chosen",
        "analyse.run_analyse",
        "exchange.run_export",
        "at_bench.watch.run_watch",
    ):
        monkeypatch.setattr(f"pmg.pipeline.commands.{stage}", called)


@pytest.mark.usefixtures("no_stage")
@pytest.mark.parametrize(
    ("words", "says"),
    [
        (f"{RUN} --k-corr abc", "--k-corr: abc; expected joint, rule, or a number from 0 to 1"),
        (f"{RUN} --k-corr 1.5", "--k-corr: 1.5"),
        (f"{RUN} --terms-sun 0,fast", "--terms-sun: 'fast'"),
        (f"{RUN} --terms-ring 0,0", "distinct exponents"),
        (f"{RUN} --damping bisqare", "Did you mean 'bisquare'?"),
        (f"{RUN} --scheduler somewhere", "no address of a scheduler"),
        (f"{RUN} --model {{tmp}}/none.toml", "none.toml: no such file"),
        (f"{RUN} --limits {{tmp}}", "a folder; expected the file that --limits names"),
        (f"{RUN} --grids {{tmp}}", "neutral_grid.csv: no such file"),
        (f"run {EXAMPLE} --store {EXAMPLE}/s --report {{tmp}}/r", "inside RECORDINGS, which is read"),
        ("watch {tmp} --store {tmp}/s", "inside FOLDER, which is read"),
        (f"run {EXAMPLE} --store {{tmp}}/s --report {EXAMPLE}", "inside RECORDINGS, which is read"),
        (f"run {EXAMPLE} --store {{tmp}}/s --report {{tmp}}/s", "the folder of"),
        (f"run {EXAMPLE} --store {{tmp}}/s --report {{tmp}}/file", "a file; expected a folder for --report"),
        (f"run {EXAMPLE} --store {{tmp}}/file/s --report {{tmp}}/r", "on the way to --store"),
        ("run {tmp}/none --store {tmp}/s --report {tmp}/r", "none: no such folder"),
        (f"ingest {EXAMPLE} --store {{tmp}}/s --shard 3/2", "--shard: '3/2'"),
        ("analyse --store {tmp}/none", "Run 'pmg ingest' first"),
        (f"export {EXAMPLE}/0000.mcap --out {{tmp}}/x.mcap --rate 0", "--rate: 0; expected a finite number above 0"),
    ],
)
def test_a_value_that_cannot_be_used_is_refused_before_a_stage_is_called(words: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = RUNNER.invoke(app, shlex.split(words.format(tmp=tmp_path)))
    assert done.exit_code == 2, done.output
    assert says in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]


@pytest.mark.parametrize("option", ["--model", "--limits", "--map", "--machine"])
def test_a_file_that_an_option_names_is_read_before_the_first_recording(
    option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(*_: object, **__: object) -> None:
        raise AssertionError("a recording was read")

    monkeypatch.setattr("pmg.pipeline.commands.compare.ingest_chosen", read)
    (tmp_path / "bad.toml").write_text("[something]\nunknown = 1\n")
    words = [*shlex.split(RUN.format(tmp=tmp_path)), option, str(tmp_path / "bad.toml")]
    done = RUNNER.invoke(app, words)
    assert (done.exit_code, "bad.toml" in done.stderr) == (2, True), done.output
    assert not (tmp_path / "s").exists()


def test_every_place_among_the_options_has_a_check() -> None:
    bare = []
    for name, command in COMMANDS.items():
        for option in _parameters(command):
            kinds = [part for part in get_args(option.annotation) if not isinstance(part, OptionCheck)]
            checked = len(kinds) < len(get_args(option.annotation))
            if re.search(r"\bPath\b", str(kinds[0])) and not checked:
                bare.append(f"{name}: {option.name}")
    assert bare == ["import: out", "report: stores"]  # a folder or a file, by --guess; stores, which say so themselves


def _parameters(command: Any) -> list[Any]:  # noqa: ANN401 - typer's
    """Parameters of a command, with their annotations."""
    stage = command.callback
    while not hasattr(stage, "__signature__"):
        stage = stage.__wrapped__
    return list(stage.__signature__.parameters.values())


# --- help ----------------------------------------------------------------------------------------------


def test_help_of_a_command_is_in_sentences() -> None:
    odd = []
    for name, command in COMMANDS.items():
        first = str(command.help).split("\n\n")[0].replace("\n", " ")
        if not re.fullmatch(r"[A-Z][^.]+\.( [A-Z].+\.)?", first) or len(first.partition(".")[0]) > 68:
            odd.append(f"{name}: {first}")
        own = [option for option in command.params if option.name != "help"]
        odd += [f"{name} {one.name}: {one.help}" for one in own if not re.fullmatch(r"[A-Z].+ .+\.", str(one.help))]
    assert not odd, "\n".join(odd)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_example_of_a_command_is_a_call_of_it(name: str) -> None:
    command = COMMANDS[name]
    (line,) = re.findall(r"Example:\n  pmg (.+)$", str(command.help), re.MULTILINE)
    assert line.startswith(name)
    words = shlex.split(line.removeprefix(name))
    words = words[: words.index(">")] if ">" in words else words
    context = command.make_context(name, words)  # raises where an option or a value is none of its own
    assert not context.args
    shown = RUNNER.invoke(app, [*name.split(), "--help"]).stdout
    assert f"pmg {line}" in shown


# --- without a command ---------------------------------------------------------------------------------


def test_without_a_command_a_folder_of_recordings_is_told_what_would_be_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "spring test"
    folder.mkdir()
    for name in ("a.mcap", "b.mcap"):
        (folder / name).write_bytes(b"not even read")
    monkeypatch.chdir(folder)
    done = RUNNER.invoke(app, [])
    assert done.exit_code == 0
    assert "2 recordings here: a.mcap to b.mcap" in done.stdout
    assert 'pmg run . --store "../spring test-store" --report "../spring test-report"' in done.stdout
    monkeypatch.chdir(tmp_path)
    assert "Recordings lie in spring test." in RUNNER.invoke(app, []).stdout


def test_without_a_command_other_formats_and_other_folders_get_a_hint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    nothing = RUNNER.invoke(app, [])
    assert (nothing.exit_code, "pmg demo" in nothing.stderr) == (2, True)
    (tmp_path / "log.tdms").write_bytes(b"")
    found = look_around(tmp_path)
    assert found is not None
    assert "pmg import log.tdms --guess" in " ".join(found.lines)


# --- progress ------------------------------------------------------------------------------------------


def test_the_time_left_is_told_from_the_pace_so_far(capsys: pytest.CaptureFixture[str]) -> None:
    now = [0.0]
    with progress_line(quiet=False, what="ingest", clock=lambda: now[0]) as show:
        for done in range(1, 21):
            show(done, 20, f"{done}.mcap")
            now[0] += 3.0
        show(0, 3, "report")
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "ingest 1/20 1.mcap"
    assert "ingest 10/20 10.mcap, 30 s left" in lines
    assert lines[-1] == "ingest 0/3 report"
