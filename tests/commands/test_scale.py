"""Many files, many processes, one store: kills, two at once, a cluster; always the same bytes."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.bench.kill import EXAMPLE, ROOT, command, contents, finish, kill_and_resume
from tests.bench.recorded import record
from tests.bench.size import NOISE_HZ, write_campaign
from tests.bench.throughput import LAYOUTS, RATE_HZ, by_blocks, by_official, by_pmg
from tests.conftest import FILES
from tests.recording.writer import CALIBRATION, RUN, Bench, write
from tests.slow import slow

from pmg.pipeline.commands.ingest_files import _ingest_one, _Job, ingest
from pmg.pipeline.files.atomic import ABANDONED, PREFIX, abandoned, write_atomic
from pmg.pipeline.files.parallel import map_over
from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.store.manifest import FAILED, Manifest
from pmg.pipeline.store.sources import StoredSource, take_inventory
from pmg.pipeline.store.store import REMOVED, Store
from pmg.pipeline.store.supersede import supersede
from pmg.sim.bench import load_bench
from pmg.sim.errors import StoreError

# --- kills ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("moment", "workers"), [pytest.param(5, 1, marks=slow), (4, 2)])
def test_a_command_killed_and_run_again_leaves_the_same_bytes_and_does_nothing_twice(
    campaign: Path, whole: dict[str, bytes], tmp_path: Path, moment: int, workers: int
) -> None:
    found = kill_and_resume(campaign, tmp_path / "s", whole, moment, "--workers", str(workers))
    assert found.done >= moment
    assert found.differing == ()
    assert (found.again, found.left) == (0, 0)


def test_what_a_dead_process_was_writing_is_cleared_away_at_once_and_what_a_live_one_writes_stays(
    tmp_path: Path,
) -> None:
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    path = tmp_path / "a.json"
    seen: list[Path] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "replace", lambda self, target: seen.append(self))
        write_atomic(path, b"{}")
    (mine,) = seen
    assert mine.name.startswith(PREFIX)
    assert not abandoned(mine)
    realm = mine.name.removeprefix(PREFIX).split("-")[0]
    gone = tmp_path / f"{PREFIX}{realm}-{dead.pid}-x.json"
    elsewhere = tmp_path / f"{PREFIX}{'0' * 8}-{dead.pid}-x.json"
    for left in (gone, elsewhere):
        left.write_text("{")
    assert abandoned(gone)
    assert not abandoned(elsewhere)
    at = elsewhere.stat().st_mtime - 2 * ABANDONED
    os.utime(elsewhere, (at, at))
    assert abandoned(elsewhere)


def test_the_writer_of_a_file_is_gone_when_it_ended_unnoted_and_when_another_process_has_its_number(
    tmp_path: Path,
) -> None:
    code = (
        "import os, sys; from pathlib import Path; from pmg.pipeline.files.atomic import opened_aside;"
        "with_it = opened_aside(Path(sys.argv[1])); with_it.__enter__(); os._exit(1)"
    )
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / '.typing'}{os.pathsep}{ROOT}"}
    unnoted = subprocess.Popen([sys.executable, "-c", code, str(tmp_path / "a.json")], env=environment)
    os.waitid(os.P_PID, unnoted.pid, os.WEXITED | os.WNOWAIT)  # it has ended; its parent has not taken note
    (left,) = tmp_path.iterdir()
    assert abandoned(left)
    unnoted.wait()
    assert abandoned(left)
    number, _, birth = left.name.split("-")[2].partition(".")
    assert number == str(unnoted.pid)
    reused = left.with_name(left.name.replace(f"{number}.{birth}", f"{os.getpid()}.{birth}"))
    left.rename(reused)
    assert abandoned(reused)


def test_a_removal_cut_short_is_finished(campaign: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    store = Store(tmp_path / "s")
    ingest(campaign, store, workers=1)
    first = next(m.identifier for m in store.manifests() if m.ingested)
    (store.path / "sources" / f"{first}.json").rename(store.path / "sources" / f"{REMOVED}{first}.json")
    assert first not in {m.identifier for m in store.manifests()}
    store.sweep()
    assert not [name for name in contents(store.path) if first in name]
    ingest(campaign, store, workers=1)
    assert contents(store.path) == whole


@pytest.mark.parametrize("text", ["", '{"schema": "pmg.store/1"}', '{"schema": "pmg.store/1", "status": "in'])
def test_a_damaged_manifest_is_mended_by_ingesting_again(
    campaign: Path, whole: dict[str, bytes], tmp_path: Path, text: str
) -> None:
    store = Store(tmp_path / "s")
    ingest(campaign, store, workers=1)
    manifests = sorted((store.path / "sources").iterdir())
    manifests[3].write_text(text)
    assert sum(finding.code is Code.STORE_CHANGED for m in store.manifests() for finding in m.findings) == 1
    report = ingest(campaign, store, workers=1)
    assert (report.ingested, report.failed) == (1, 1)
    assert contents(store.path) == whole


# --- two at once ---------------------------------------------------------------------------------------


def test_two_processes_on_one_store_and_one_folder_make_the_same_bytes(
    campaign: Path, whole: dict[str, bytes], tmp_path: Path
) -> None:
    both = [command(campaign, tmp_path / "s", "--workers", "1") for _ in range(2)]
    told = [finish(process) for process in both]
    assert [t["ingested"] + t["skipped"] for t in told] == [FILES - 1, FILES - 1]
    assert contents(tmp_path / "s") == whole


def test_a_manifest_removed_by_another_process_meanwhile_is_no_error(
    campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path / "s")
    ingest(campaign, store, workers=1)
    victim = store.manifests()[0].identifier
    read = Store.read_manifest

    def removed_first(self: Store, identifier: str) -> Manifest:
        if identifier == victim:
            self.remove(victim)
        return read(self, identifier)

    monkeypatch.setattr(Store, "read_manifest", removed_first)
    assert victim not in {m.identifier for m in store.manifests()}


def test_a_store_made_by_another_process_while_it_is_looked_at_is_not_foreign(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked = Path.iterdir

    def made_meanwhile(self: Path) -> object:
        (self / "store.json").write_text('{"schema": "pmg.store/1"}')
        (self / "runs").mkdir()
        return looked(self)

    monkeypatch.setattr(Path, "iterdir", made_meanwhile)
    assert Store(tmp_path).made


def test_the_same_bytes_ingested_under_two_names_at_once_count_once(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    for folder, name in ((one, "a.mcap"), (other, "b.mcap")):
        folder.mkdir()
        write(folder / name, Bench())
    store = Store(tmp_path / "s")
    store.prepare()
    sources = [take_inventory(folder).sources[0] for folder in (one, other)]
    for source in sources:
        _ingest_one(_Job(source, store.path, load_bench()))
    assert len(store.manifests()) == 2
    for source in reversed(sources):
        supersede(store, (source,))
    assert [m.file for m in store.manifests()] == ["a.mcap"]
    assert len(list((store.path / "runs").iterdir())) == 1


def test_a_file_that_changes_after_it_was_listed_is_not_kept_under_its_old_hash(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", Bench())
    store = Store(tmp_path / "s")
    store.prepare()
    assert _ingest_one(_Job(StoredSource(tmp_path / "a.mcap", "a.mcap", "0" * 64), store.path, load_bench())) == FAILED
    (manifest,) = store.manifests()
    (finding,) = manifest.document()["findings"]
    assert (finding["code"], finding["severity"]) == (Code.UNREADABLE, Severity.ERROR)
    assert "changed between listing and reading" in finding["message"]


def test_a_worker_that_does_not_see_the_store_makes_none_of_its_own(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", Bench())
    job = _Job(take_inventory(tmp_path).sources[0], tmp_path / "elsewhere", load_bench())
    with pytest.raises(StoreError, match="one folder that all of them share"):
        _ingest_one(job)
    assert not job.store.exists()


# --- executors -----------------------------------------------------------------------------------------


def _end(item: int) -> int:
    """Item 3 ends the process that works on it."""
    if item == 3:
        os._exit(1)
    return item


def test_a_killed_worker_is_told_with_what_to_do() -> None:
    with pytest.raises(StoreError, match="it resumes"):
        list(map_over(_end, range(6), 2))


def test_nothing_to_do_asks_nobody() -> None:
    assert list(map_over(_end, [], 4, scheduler="tcp://nowhere:1")) == []


def test_without_dask_the_option_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(StoreError, match=r"pmg-bench\[dask\]"):
        list(map_over(_end, [1], 1, scheduler="tcp://localhost:1"))


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="dask is not installed")
@slow
def test_a_cluster_that_loses_a_worker_makes_the_store_of_one_process(campaign: Path) -> None:
    """In a process of its own, so that the cluster's threads and warnings end with it."""
    words = [sys.executable, "-m", "tests.bench.cluster", str(campaign), "--kill-after", "3"]
    path = f"{ROOT / '.typing'}{os.pathsep}{ROOT}"
    done = subprocess.run(
        words, cwd=ROOT, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "byte for byte: True" in done.stdout


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="dask is not installed")
@pytest.mark.parametrize("address", ["nonsense", "foo://x"])
def test_an_address_that_is_none_is_told_at_once(address: str) -> None:
    with pytest.raises(StoreError, match="dask scheduler"):
        list(map_over(_end, [1], 1, scheduler=address))


# --- what the benches measure on -----------------------------------------------------------------------


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_of_the_throughput_bench_is_read_whole_and_without_remark(layout: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    columns = list(LAYOUTS[layout](24_000, np.random.default_rng(7)))
    record(path, columns, RUN, CALIBRATION.encode(), RATE_HZ, 1000)
    held = sum(column.values.nbytes for column in columns)
    assert by_official(path)() == by_blocks(path)() == held
    by_pmg(path)()


def test_a_point_of_the_size_bench_has_the_means_of_the_point_it_is_from(tmp_path: Path) -> None:
    write_campaign(tmp_path / "r", 1, 7)
    made = read_recording(next((tmp_path / "r").iterdir()))
    source = read_recording(sorted(EXAMPLE.glob("*.mcap"))[0])
    assert made.samples.height == 100_000
    assert made.run.point == source.run.point
    for side in ("sun", "ring"):
        means = [float(np.mean(recording.samples[f"torque_{side}"].to_numpy())) for recording in (made, source)]
        noise = NOISE_HZ / np.sqrt(made.samples.height) * source.calibration[side].nominal_torque / 5000.0
        assert means[0] == pytest.approx(means[1], abs=5.0 * noise)
