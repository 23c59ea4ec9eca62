"""Ingest: good files among bad ones, resumed after a kill, the same with any number of workers."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.recording.writer import Bench, write

from pmg.pipeline.commands.ingest_files import IngestReport, ingest
from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.store.store import Store
from pmg.pipeline.windows.limits import LIMITS
from pmg.pipeline.windows.revolutions import WholeRevolutions, whole_revolutions
from pmg.sim.errors import RecordingError
from pmg.sim.signals import RPM

DATA = Path(__file__).resolve().parent.parent / "data"


def everything(path: Path) -> dict[str, bytes]:
    return {p.relative_to(path).as_posix(): p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


def counts(report: IngestReport) -> tuple[int, int, int]:
    return report.ingested, report.skipped, report.failed


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three good runs, one whose speed never settles, one that is no recording, one cut in the middle."""
    folder = tmp_path_factory.mktemp("recordings")
    for file in DATA.glob("*.mcap"):
        shutil.copy(file, folder)
    write(folder / "ramp.mcap", Bench(acceleration=20.0))
    (folder / "notes.mcap").write_text("not a recording")
    whole = (DATA / "engaged.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(whole[: len(whole) // 3])
    return folder


def test_bad_files_fail_alone_and_say_why(mixed: Path, tmp_path: Path) -> None:
    seen: list[tuple[int, int, str]] = []
    store = Store(tmp_path / "s")
    report = ingest(mixed, store, workers=1, progress=lambda *step: seen.append(step))
    assert counts(report) == (4, 0, 2)
    assert (report.windows, report.rejected) == (4, 1)
    assert [step[:2] for step in seen] == [(k, 6) for k in range(1, 7)]
    errors = {f.file: f.code for f in report.findings if f.severity is Severity.ERROR}
    assert errors["notes.mcap"] is Code.NOT_MCAP
    assert {f.code for f in report.findings if f.file == "cut.mcap"} >= {Code.TRUNCATED}
    failed = {m.file for m in store.manifests() if not m.ingested}
    assert failed == {"notes.mcap", "cut.mcap"}


def test_the_manifest_holds_the_window_and_its_means(mixed: Path, tmp_path: Path) -> None:
    store = Store(tmp_path / "s")
    ingest(mixed, store, workers=1)
    by_file = {m.file: m for m in store.manifests()}
    (window,) = by_file["neutral.mcap"].document()["windows"]
    assert window["accepted"]
    assert window["means"]["sun"]["torque"] == pytest.approx(0.086208, abs=4.3e-3)
    assert window["means"]["ring"]["speed"] / RPM == pytest.approx(300.0, abs=0.01)
    samples = store.samples(by_file["neutral.mcap"])
    assert samples.height == 2500
    whole = WholeRevolutions(
        samples["torque_sun"].to_numpy(), whole_revolutions(samples["angle_sun"].to_numpy())
    ).mean()
    assert whole == pytest.approx(window["means"]["sun"]["torque"], abs=1e-12)
    assert samples["torque_sun"].mean() == pytest.approx(whole, abs=1e-3)
    (ramp,) = by_file["ramp.mcap"].document()["windows"]
    assert not ramp["accepted"]
    assert ramp["reasons"][0].startswith("speed not settled")
    assert np.isfinite(ramp["means"]["sun"]["torque"])


def test_other_limits_judge_the_same_recordings_anew(mixed: Path, tmp_path: Path) -> None:
    store, strict = Store(tmp_path / "s"), replace(LIMITS, shortest=60.0)
    ingest(mixed, store, workers=1)
    assert ingest(mixed, store, workers=1).ingested == 0
    again = ingest(mixed, store, workers=1, limits=strict)
    assert (again.ingested, again.rejected) == (4, 4)
    assert all(m.document()["limits"] == strict.document() for m in store.manifests() if m.ingested)
    back = ingest(mixed, store, workers=1)
    assert (back.ingested, back.rejected) == (4, 1)


def test_processes_and_order_do_not_change_a_byte(mixed: Path, tmp_path: Path) -> None:
    ingest(mixed, Store(tmp_path / "one"), workers=1)
    ingest(mixed, Store(tmp_path / "two"), workers=2)
    assert everything(tmp_path / "one") == everything(tmp_path / "two")


def test_a_second_ingest_does_only_what_is_missing(mixed: Path, tmp_path: Path) -> None:
    store = Store(tmp_path / "s")
    first = ingest(mixed, store, workers=1)
    before = everything(store.path)
    times = {p: p.stat().st_mtime_ns for p in (store.path / "runs").iterdir()}
    second = ingest(mixed, store, workers=1)
    assert counts(second) == (0, 4, 2)
    assert second.findings == first.findings
    assert {p: p.stat().st_mtime_ns for p in (store.path / "runs").iterdir()} == times
    assert everything(store.path) == before


@pytest.mark.parametrize("kept", range(0, 9, 2))
def test_a_killed_ingest_is_completed_to_the_same_bytes(mixed: Path, tmp_path: Path, kept: int) -> None:
    """The files are written one after the other; a kill leaves the first few, and perhaps a half-written one."""
    ingest(mixed, Store(tmp_path / "whole"), workers=1)
    whole = everything(tmp_path / "whole")
    order = sorted(whole, key=lambda name: (tmp_path / "whole" / name).stat().st_mtime_ns)
    for name in order[:kept]:
        target = tmp_path / "killed" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(whole[name])
    ingest(mixed, Store(tmp_path / "killed"), workers=1)
    assert everything(tmp_path / "killed") == whole


def test_a_corrected_version_of_the_same_run_replaces_it(tmp_path: Path) -> None:
    folder = tmp_path / "r"
    folder.mkdir()
    store = Store(tmp_path / "s")
    write(folder / "a.mcap", Bench())
    ingest(folder, store, workers=1)
    write(folder / "a.mcap", Bench(torque={"sun": 1.0, "ring": 1.0}))
    assert counts(ingest(folder, store, workers=1)) == (1, 0, 0)
    assert [m.document()["windows"][0]["means"]["sun"]["torque"] for m in store.manifests()] == [
        pytest.approx(1.0, abs=0.01)
    ]
    assert len(list((tmp_path / "s" / "runs").iterdir())) == 1


def test_another_run_written_over_a_file_leaves_the_earlier_one_in_the_store(tmp_path: Path) -> None:
    folder = tmp_path / "r"
    folder.mkdir()
    store = Store(tmp_path / "s")
    write(folder / "a.mcap", Bench())
    ingest(folder, store, workers=1)
    write(folder / "a.mcap", Bench(run={"started_at": "2025-05-01T09:00:00Z"}))
    ingest(folder, store, workers=1)
    assert len(store.manifests()) == 2


def test_a_renamed_file_is_not_a_second_source(tmp_path: Path) -> None:
    folder = tmp_path / "r"
    folder.mkdir()
    store = Store(tmp_path / "s")
    write(folder / "a.mcap", Bench())
    ingest(folder, store, workers=1)
    (folder / "a.mcap").rename(folder / "b.mcap")
    assert counts(ingest(folder, store, workers=1)) == (0, 1, 0)
    assert len(store.manifests()) == 1


def test_a_dangling_link_is_told_and_the_rest_goes_on(tmp_path: Path) -> None:
    folder = tmp_path / "r"
    folder.mkdir()
    write(folder / "a.mcap", Bench())
    (folder / "b.mcap").symlink_to(folder / "gone.mcap")
    report = ingest(folder, Store(tmp_path / "s"), workers=1)
    assert counts(report) == (1, 0, 1)
    assert [(f.code, f.file) for f in report.findings] == [(Code.UNREADABLE, "b.mcap")]


def test_the_same_bytes_twice_are_ingested_once_and_told(tmp_path: Path) -> None:
    folder = tmp_path / "r"
    folder.mkdir()
    for name in ("a.mcap", "b.mcap"):
        shutil.copy(DATA / "zero.mcap", folder / name)
    report = ingest(folder, Store(tmp_path / "s"), workers=1)
    assert counts(report) == (1, 0, 0)
    assert [(f.code, f.file, f.severity) for f in report.findings] == [
        (Code.DUPLICATE_FILE, "b.mcap", Severity.WARNING)
    ]


def test_two_files_of_one_point_are_both_kept(tmp_path: Path) -> None:
    folder = tmp_path / "r"
    folder.mkdir()
    write(folder / "a.mcap", Bench())
    write(folder / "b.mcap", Bench(torque={"sun": 0.9, "ring": 1.5}))
    store = Store(tmp_path / "s")
    assert counts(ingest(folder, store, workers=1)) == (2, 0, 0)
    points = [w["point"] for m in store.manifests() for w in m.document()["windows"]]
    assert points == ["P1", "P1"]


def test_one_file_may_be_named_instead_of_a_folder(tmp_path: Path) -> None:
    assert counts(ingest(DATA / "zero.mcap", Store(tmp_path / "s"), workers=1)) == (1, 0, 0)


def test_nothing_to_ingest_is_an_error_and_makes_no_store(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for place in (tmp_path / "empty", tmp_path / "absent"):
        with pytest.raises(RecordingError):
            ingest(place, Store(tmp_path / "s"), workers=1)
    assert not (tmp_path / "s").exists()


def test_means_taken_in_an_earlier_way_are_taken_anew(mixed: Path, tmp_path: Path) -> None:
    store = Store(tmp_path / "s")
    ingest(mixed, store, workers=1)
    wanted = everything(store.path)
    for path in (store.path / "sources").glob("*.json"):
        document = json.loads(path.read_text(encoding="utf-8"))
        if document.pop("reduction", None) is not None:
            path.write_text(json.dumps(document), encoding="utf-8")
    assert ingest(mixed, store, workers=1).ingested == 4
    assert everything(store.path) == wanted
