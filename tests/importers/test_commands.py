"""The commands import and export, as a person calls them: codes, messages, and never a trace."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app

from . import written


def call(*words: object) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, [str(word) for word in words])
    return done.exit_code, done.stdout, done.stderr


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "logs").mkdir()
    for name in ("E1", "E2"):
        (tmp_path / "logs" / f"{name}.csv").write_text(written.csv_text(600), encoding="cp1252", newline="")
    run = written.RUN.replace('point = "E1"', 'point = { file = "stem" }')
    written.write_map(tmp_path, written.map_text(written.PLAIN, run=run))
    return tmp_path


def test_a_folder_is_imported_and_one_of_its_recordings_exported(folder: Path) -> None:
    code, told, _ = call("import", folder / "logs", "--map", folder / "map.toml", "--out", folder / "out", "--json")
    document: dict[str, Any] = json.loads(told)
    assert (code, document["command"], document["data"]["failed"]) == (0, "import", 0)
    assert sorted(path.name for path in (folder / "out").iterdir()) == ["E1.mcap", "E2.mcap"]
    assert {one["rows"] for one in document["data"]["imported"]} == {600}
    code, told, _ = call("export", folder / "out" / "E1.mcap", "--out", folder / "derived.mcap", "--rate", 100)
    assert (code, told.strip()) == (
        0,
        f"wrote 120 stretches at 100 Hz and 60 previews at 50 Hz to {folder / 'derived.mcap'}\n"
        "windows judged by the default limits",
    )


def test_how_the_files_were_read_is_told_once_for_those_read_alike(folder: Path) -> None:
    other = written.csv_text(600, delimiter="\t", decimal=".", comment="")
    (folder / "logs" / "E3.csv").write_text(other, encoding="utf-8", newline="")
    arguments = ("import", folder / "logs", "--map", folder / "map.toml", "--out", folder / "out")
    alike = "encoding cp1252, delimiter ;, decimal ,, units row line 3, first row line 4"
    _, told, _ = call(*arguments)
    assert told.splitlines()[1:] == [
        f"read with {alike}: 2 files",
        "read with encoding utf-8, delimiter tab, decimal ., units row line 2, first row line 3: E3.csv",
    ]
    _, told, _ = call(*arguments, "--json")
    first = json.loads(told)["data"]["imported"][0]
    assert ", ".join(f"{key.replace('_', ' ')} {word}" for key, word in first["reading"].items()) == alike


def test_an_export_judges_windows_by_the_limits_of_its_file(folder: Path) -> None:
    call("import", folder / "logs" / "E1.csv", "--map", folder / "map.toml", "--out", folder)
    (folder / "limits.toml").write_text("[windows]\nshortest = 60.0\n", encoding="utf-8")
    words = ("--out", folder / "derived.mcap", "--limits", folder / "limits.toml", "--json")
    code, told, _ = call("export", folder / "E1.mcap", *words)
    assert code == 0, told
    assert json.loads(told)["data"]["limits"]["shortest"] == 60.0


def test_one_bad_file_of_a_folder_makes_it_partly_done(folder: Path) -> None:
    bad = folder / "logs" / "E2.csv"
    bad.write_text(bad.read_text(encoding="cp1252").replace("\n1", "\nx", 1), encoding="cp1252")
    code, told, errors = call("import", folder / "logs", "--map", folder / "map.toml", "--out", folder / "out")
    assert code == 3
    assert told.startswith("imported 1 of 2 files, 600 rows, 2400 samples of all channels")
    assert "E2.csv: line 4, column 'torque_sun': 'x" in errors
    assert errors.count("E2.csv: ") == errors.count("line 4") == 1, "the place is reported once"
    assert [path.name for path in (folder / "out").iterdir()] == ["E1.mcap"]


def test_a_point_that_nobody_asked_for_is_told_until_its_set_points_are_given(folder: Path) -> None:
    chart = folder / "map.toml"
    chart.write_text(chart.read_text().replace("sun_speed_set_rpm = 600\n", ""))
    words = ("import", folder / "logs" / "E1.csv", "--map", chart, "--out", folder, "--json")
    found = [json.loads(call(*words, *more)[1])["findings"] for more in ((), ("--set", "sun_speed_set_rpm=600"))]
    assert [["no set-points" in finding["message"] for finding in each] for each in found] == [[True], []]
    assert "ring_torque_set_Nm" in found[0][0]["do"]
    assert "map.toml" in found[0][0]["do"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("import", "logs", "--map", "none.toml", "--out", "out"), "none.toml"),
        (("import", "none", "--map", "map.toml", "--out", "out"), "no such"),
        (("import", "map.toml", "--map", "map.toml", "--out", "out"), "the ending '.toml'"),
        (("import", "logs", "--map", "map.toml", "--out", "out", "--set", "pont=1"), "Did you mean 'point'?"),
        (("import", "logs", "--map", "map.toml", "--out", "out", "--set", "point"), "key=value"),
        (("export", "map.toml", "--out", "x.mcap"), "map.toml"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_code_2(
    folder: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], expected: str
) -> None:
    monkeypatch.chdir(folder)
    code, _, errors = call(*words)
    assert code == 2
    assert expected in errors
    assert "Traceback" not in errors
