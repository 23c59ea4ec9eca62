"""One recording that cannot be read, whatever is wrong with it, costs itself alone and nothing waits for it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.recording.writer import CALIBRATION, Bench, write

from pmg.pipeline.commands import ingest_files
from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.container.file_limits import MISSING
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.store.store import Store
from pmg.pipeline.windows.windows import find_windows
from pmg.sim.errors import PmgError


def _calibration(number: str) -> Callable[[Path], object]:
    text = CALIBRATION.replace("nominal_torque_Nm = 5.0", f"nominal_torque_Nm = {number}", 1)
    return lambda path: write(path, Bench(calibration=text))


def _run(**metadata: str) -> Callable[[Path], object]:
    return lambda path: write(path, Bench(run=metadata))


BOMBS: dict[str, Callable[[Path], object]] = {
    "a number with 400 zeros": _calibration("1" + 400 * "0"),
    "a number of 5000 digits": _calibration(5000 * "7"),
    "20,000 brackets": _calibration(20_000 * "[" + 20_000 * "]"),
    "a nominal torque of 1e-300 N m": _calibration("1e-300"),
    "a nominal torque of 1e300 N m": _calibration("1e300"),
    "a nominal torque that is no number": _calibration("nan"),
    "a start in the year 9999": _run(started_at="9999-12-31T23:59:59Z"),
    "a start in the year 1": _run(started_at="0001-01-01T00:00:00+14:00"),
    "a pipe": lambda path: os.mkfifo(path),
    "a link to a device that never ends": lambda path: path.symlink_to("/dev/zero"),
    "a link to itself": lambda path: path.symlink_to(path),
    "a folder without an end": lambda path: path.symlink_to(path.parent),
    "nothing at all": lambda path: path.write_bytes(b""),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_bomb_costs_itself_alone(bomb: str, tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    write(folder / "a.mcap", Bench())
    BOMBS[bomb](folder / "b.mcap")
    write(folder / "c.mcap", Bench(run={"point": "P2", "started_at": "2025-04-23T08:10:00Z"}))
    report = ingest(folder, Store(tmp_path / "store"))
    assert report.ingested == 2
    assert "b.mcap" in {f.file for f in report.findings if f.severity == "error"} or bomb == "a folder without an end"


def test_a_file_whose_name_is_no_text_is_named_all_the_same(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    write(folder / "a.mcap", Bench())
    (folder / "a.mcap").rename(os.fsdecode(os.fsencode(folder) + b"/p\xe9ng.mcap"))
    report = ingest(folder, Store(tmp_path / "store"))
    assert report.ingested == 1
    (manifest,) = Store(tmp_path / "store").manifests()
    assert manifest.file == "p\\xe9ng.mcap"


def test_a_pipe_named_alone_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.mcap")
    with pytest.raises(PmgError, match="pipe"):
        ingest(tmp_path / "a.mcap", Store(tmp_path / "store"))
    with pytest.raises(PmgError, match="regular file"):
        read_recording(tmp_path / "a.mcap")


def test_a_defect_that_one_recording_brings_out_is_told_with_its_trace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    for number in range(3):
        write(folder / f"{number}.mcap", Bench(run={"point": f"P{number}"}))
    real = find_windows

    def broken(recording: object, limits: object) -> object:
        if getattr(recording, "file", "") == "1.mcap":
            raise ZeroDivisionError("planted")
        return real(recording, limits)  # type: ignore[arg-type]

    monkeypatch.setattr(ingest_files, "find_windows", broken)
    store = Store(tmp_path / "store")
    report = ingest(folder, store, workers=1)
    assert (report.ingested, report.failed) == (2, 1)
    (finding,) = [f for f in report.findings if f.code is Code.UNEXPECTED]
    assert finding.file == "1.mcap"
    (log,) = (store.path / "logs").glob("*.log")
    assert log.name in finding.do
    assert "ZeroDivisionError: planted" in log.read_text()
    monkeypatch.undo()
    again = ingest(folder, store, workers=1)
    assert (again.ingested, again.failed) == (1, 0), "a failed source is read anew once the defect is mended"


def test_blocks_that_are_far_apart_ask_for_no_memory(tmp_path: Path) -> None:
    """Each jump of the index is possible by itself, all of them together are not."""
    import numpy as np
    from tests.recording.writer import block, tracks

    spans = {}
    for topic, (metadata, values) in tracks(Bench(seconds=8.0)).items():
        jumps = [number * 49_000_000 for number in range(40)]
        spans[topic] = [block(at, metadata["dtype"], np.asarray(values[:100])) for at in jumps]
    write(tmp_path / "a.mcap", Bench(seconds=8.0, rate_hz=1e6, raw=spans))
    recording = read_recording(tmp_path / "a.mcap")
    assert recording.samples.height <= MISSING.floor + 4_000
    assert Code.SAMPLES_ASTRAY in {f.code for f in recording.findings}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
@pytest.mark.parametrize("words", [("doctor", "nowhere", "--json"), ("analyse", "--storr", "x", "--json")])
def test_a_full_disk_under_standard_output_is_told(words: tuple[str, ...]) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "pmg.pipeline", *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert "standard output" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
@pytest.mark.parametrize(("words", "code"), [("nowhere --json", 2), ("nowhere", 2), ("recordings --json", 3)])
@pytest.mark.parametrize("error", [">/dev/full", ">&-"])
def test_standard_error_that_takes_nothing_changes_neither_result_nor_exit_code(
    words: str, code: int, error: str, tmp_path: Path
) -> None:
    (tmp_path / "recordings").mkdir()
    write(tmp_path / "recordings" / "a.mcap", Bench())
    os.mkfifo(tmp_path / "recordings" / "b.mcap")
    call = f"{sys.executable} -m pmg.pipeline ingest {words} --store store 2{error}"
    done = subprocess.run(["/bin/sh", "-c", call], cwd=tmp_path, stdout=subprocess.PIPE, text=True, check=False)
    assert done.returncode == code
    if "--json" in words:
        assert json.loads(done.stdout)["exit_code"] == code


def test_closed_standard_output_changes_no_exit_code(tmp_path: Path) -> None:
    call = f"{sys.executable} -m pmg.pipeline doctor nowhere --json >&-"
    done = subprocess.run(["/bin/sh", "-c", call], cwd=tmp_path, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
