"""Who ran what on which bytes with which settings: the entries that commands leave, and their audit."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import shutil
import signal
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.cli.test_cli import RUNNER, call
from tests.recording.writer import Bench, write

from pmg.pipeline import analyse, ingest
from pmg.pipeline.cli.app import app
from pmg.pipeline.store.audit_trail import FILE, read_trail
from pmg.pipeline.store.store import Store
from pmg.sim.errors import StoreError

LIMITS = "[windows]\nspeed_change_rpm = 7.0\n"


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def named(files: list[dict[str, str]]) -> dict[str, str]:
    return {each["path"]: each["sha256"] for each in files}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three recordings ingested by two processes, with limits from a campaign file."""
    folder = tmp_path_factory.mktemp("audited")
    (folder / "recordings").mkdir()
    for number in range(3):
        run = {"started_at": f"2025-04-23T08:0{number}:00Z"}
        write(folder / "recordings" / f"{number}.mcap", Bench(torque={"sun": 0.1 * number, "ring": 1.5}, run=run))
    (folder / "limits.toml").write_text(LIMITS)
    text = '[recordings]\npath = "recordings"\n[store]\npath = "s"\n[ingest]\nworkers = 2\nlimits = "limits.toml"\n'
    (folder / "campaign.toml").write_text(text)
    call("ingest", "--config", folder / "campaign.toml", expect=0)
    return folder


@pytest.fixture
def folder(recorded: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(recorded, tmp_path / "copy"))


def test_an_entry_says_who_ran_what_on_which_bytes_with_which_settings(recorded: Path) -> None:
    (entry,) = read_trail(recorded / "s").calls
    began = datetime.fromisoformat(entry["began"])
    assert began.utcoffset() == UTC.utcoffset(None)
    assert (entry["host"], entry["folder"], entry["command"]) == (platform.node(), str(Path.cwd()), "ingest")
    assert entry["user"]
    assert entry["versions"]["numpy"] == np.__version__
    assert entry["versions"]["python"] == platform.python_version()
    assert entry["versions"].keys() == {"pmg", "python", "numpy", "scipy"}
    assert (entry["exit_code"], entry["by"], entry["state"]) == (0, "pmg", "ended")
    assert began <= datetime.fromisoformat(entry["ended"])
    names = ("campaign.toml", "limits.toml", *(f"recordings/{number}.mcap" for number in range(3)))
    assert named(entry["read"]) == {str(recorded / name): digest(recorded / name) for name in names}
    assert entry["settings"]["limits"] == str(recorded / "limits.toml")
    assert entry["settings"]["workers"] == 2
    made = {p.relative_to(recorded / "s").as_posix(): digest(p) for p in (recorded / "s").rglob("*") if p.is_file()}
    assert named(entry["written"]) == {path: sha for path, sha in made.items() if path != FILE}
    assert {path.split("/")[0] for path in made} >= {"sources", "runs", "orders"}


def test_what_the_store_knows_is_named_by_its_hash_and_not_read_again(folder: Path) -> None:
    shutil.rmtree(folder / "recordings")
    call("orders", "--store", folder / "s", "--out", folder / "out", expect=0)
    entry = read_trail(folder / "s").entries[-1]
    known = {m.sha256: m.file for m in Store(folder / "s").manifests()}
    assert {each["sha256"]: each["name"] for each in entry["recordings"]} == known
    assert str(folder / "out" / "orders.json") in named(entry["written"])


def test_the_words_of_the_call_are_kept_as_typed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["ingest", str(folder / "recordings"), "--store", str(folder / "s")]
    monkeypatch.setattr("sys.argv", ["pmg", *words])
    assert RUNNER.invoke(app, words).exit_code == 0
    assert read_trail(folder / "s").entries[-1]["arguments"] == words


def test_a_command_that_fails_leaves_its_entry_with_its_code(folder: Path) -> None:
    call("analyse", "--store", folder / "s", "--campaign", "none of it", expect=2)
    entry = read_trail(folder / "s").entries[-1]
    assert (entry["command"], entry["exit_code"], entry["settings"]["campaign"]) == ("analyse", 2, "none of it")


def test_a_command_on_two_stores_leaves_an_entry_in_each(folder: Path, tmp_path: Path) -> None:
    other = Path(shutil.copytree(folder / "s", tmp_path / "other"))
    call("report", folder / "s", other, "--report", tmp_path / "r", expect=2)
    assert [read_trail(store).entries[-1]["command"] for store in (folder / "s", other)] == ["report", "report"]


def test_commands_that_only_tell_leave_none(folder: Path) -> None:
    before = (folder / "s" / FILE).read_bytes()
    call("runs", "list", folder / "s", expect=0)
    call("doctor", folder / "recordings", "--store", folder / "s", expect=0)
    call("runs", "audit", folder / "s", expect=0)
    assert (folder / "s" / FILE).read_bytes() == before


def test_a_trail_that_cannot_be_written_is_a_warning_and_the_results_stand(folder: Path) -> None:
    (folder / "s" / FILE).unlink()
    (folder / "s" / FILE).mkdir()
    result = call("orders", "--store", folder / "s", "--out", folder / "out", expect=0)
    (told,) = [finding for finding in result["findings"] if finding["where"].endswith(FILE)]
    assert told["severity"] == "warning"
    assert "not a regular file" in told["message"]
    assert (folder / "out" / "orders.json").is_file()
    failing = RUNNER.invoke(app, ["analyse", "--store", str(folder / "s"), "--campaign", "none of it"])
    assert failing.exit_code == 2
    assert "audit trail has no entry" in failing.stderr


# --- the audit -----------------------------------------------------------------------------------------


def audit(store: Path, *more: str, expect: int) -> tuple[dict[str, Any], str]:
    result = call("runs", "audit", store, *more, expect=expect)
    return result["data"], " ".join(f"{each['where']} {each['message']}" for each in result["findings"])


def test_the_audit_shows_each_entry_and_the_head_to_be_noted(folder: Path) -> None:
    call("ingest", "--config", folder / "campaign.toml", expect=0)
    shown = RUNNER.invoke(app, ["runs", "audit", str(folder / "s")])
    head = read_trail(folder / "s").head
    assert shown.exit_code == 0
    assert "2 calls in 4 entries; the chain is whole" in shown.stdout
    assert shown.stdout.count("pmg ingest") == 0
    assert f"head: {head}" in shown.stdout
    audit(folder / "s", "--head", str(head), expect=0)


def test_a_broken_chain_ends_with_two_and_its_line(folder: Path) -> None:
    trail = folder / "s" / FILE
    trail.write_text(trail.read_text().replace('"exit_code":0', '"exit_code":3'))
    told, findings = audit(folder / "s", expect=2)
    assert [each["line"] for each in told["breaks"]] == [2]
    assert "line 2" in findings
    assert told["breaks"][0]["came"] != told["breaks"][0]["expected"]


def test_a_trail_cut_at_its_end_or_written_anew_shows_by_the_head_that_was_noted(folder: Path) -> None:
    """And by nothing else: the chain has no key."""
    trail = folder / "s" / FILE
    first = trail.read_bytes()
    call("ingest", "--config", folder / "campaign.toml", expect=0)
    head = str(read_trail(folder / "s").head)
    trail.write_bytes(first)
    audit(folder / "s", expect=0)
    told, _ = audit(folder / "s", "--head", head, expect=2)
    assert told["breaks"][0]["line"] == 3


def test_a_torn_tail_ends_with_three(folder: Path) -> None:
    trail = folder / "s" / FILE
    with trail.open("ab") as file:
        file.write(b'{"arguments":["ing')
    told, findings = audit(folder / "s", expect=3)
    assert [each["line"] for each in told["lost"]] == [3]
    assert "A kill or a full disk" in findings


def test_files_changed_since_are_told_and_gone_ones_counted(folder: Path) -> None:
    runs = sorted((folder / "s" / "runs").glob("*.parquet"))
    runs[0].write_bytes(runs[0].read_bytes() + b"\0")
    (folder / "s" / "orders").rename(folder / "elsewhere")
    told, findings = audit(folder / "s", expect=0)
    assert told["files"]["changed"] == [f"runs/{runs[0].name}"]
    assert told["files"]["gone"]
    assert f"runs/{runs[0].name} changed since" in findings
    audit(folder / "s", "--fail-on", "mismatch", expect=1)
    runs[0].unlink()
    call("ingest", "--config", folder / "campaign.toml", expect=0)
    assert audit(folder / "s", expect=0)[0]["files"]["changed"] == []


def test_a_store_without_a_trail_is_read_and_its_later_commands_have_one(folder: Path) -> None:
    (folder / "s" / FILE).unlink()
    _, findings = audit(folder / "s", expect=3)
    assert "no entry" in findings
    call("orders", "--store", folder / "s", "--out", folder / "out", expect=0)
    told, findings = audit(folder / "s", expect=0)
    assert len(told["without_entry"]) == 3
    assert "that no entry wrote" in findings


def test_calls_from_python_leave_their_entries(recorded: Path, tmp_path: Path) -> None:
    found = ingest(recorded / "recordings", tmp_path / "s")
    with pytest.raises(StoreError):
        analyse(found, campaign="none of it")
    ingested, analysed = read_trail(tmp_path / "s").calls
    assert [e["state"] for e in read_trail(tmp_path / "s").entries] == ["began", "ended"] * 2
    assert (ingested["command"], ingested["by"], ingested["exit_code"]) == ("ingest", "Python", 0)
    assert {Path(path).name for path in named(ingested["read"])} == {f"{number}.mcap" for number in range(3)}
    assert (analysed["command"], analysed["exit_code"]) == ("analyse", 1)
    assert analysed["settings"]["campaign"] == "none of it"
    shown = RUNNER.invoke(app, ["runs", "audit", str(tmp_path / "s")]).stdout
    assert "Python ingest: " in shown
    (tmp_path / "s" / FILE).unlink()
    (tmp_path / "s" / FILE).mkdir()
    with pytest.warns(UserWarning, match="the audit trail has no entry"):
        ingest(recorded / "recordings", tmp_path / "s")


KILLED = """
import os, signal, sys
from pmg.pipeline.commands import ingest_files
ingest_files.supersede = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
from pmg.pipeline.cli.app import main
main()
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no signal that cannot be caught")
@pytest.mark.parametrize("store", ["new", "s"])
def test_a_command_that_was_killed_is_seen_by_its_beginning(folder: Path, store: str) -> None:
    words = ["ingest", str(folder / "recordings"), "--store", str(folder / store)]
    done = subprocess.run([sys.executable, "-c", KILLED, *words], check=False)
    assert done.returncode == -signal.SIGKILL
    last = read_trail(folder / store).calls[-1]
    assert (last["state"], last["arguments"], last["user"] != "") == ("began", words, True)
    _, findings = audit(folder / store, expect=0)
    assert f"'pmg {shlex.join(words)}' began at {last['began']} and left no end" in findings
    call("ingest", folder / "recordings", "--store", folder / store, expect=0)
    assert read_trail(folder / store).calls[-1]["exit_code"] == 0
    assert audit(folder / store, expect=0)[1].count("left no end") == 1


def test_text_in_a_trail_cannot_steer_a_terminal(folder: Path) -> None:
    (entry,) = read_trail(folder / "s").calls
    os.truncate(folder / "s" / FILE, 0)
    from pmg.pipeline.store.audit_trail import append_entry

    append_entry(folder / "s", {**entry, "user": "\x1b[2J", "arguments": ["\u202e"], "versions": 3, "written": {}})
    shown = RUNNER.invoke(app, ["runs", "audit", str(folder / "s")])
    assert "\x1b" not in shown.stdout
    assert "\u202e" not in shown.stdout
    assert json.loads((folder / "s" / FILE).read_text())["user"] == "\x1b[2J"
