"""A campaign in shards: every file in one of them, evenly, and together the store of one call."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.bench.kill import contents
from tests.conftest import FILES
from tests.recording.writer import Bench, write

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.store.sources import Shard, take_inventory
from pmg.pipeline.store.store import Store
from pmg.sim.errors import RecordingError


@settings(max_examples=30)
@given(
    lengths=st.lists(st.integers(0, 400), min_size=1, max_size=25),
    copies=st.lists(st.integers(0, 24), max_size=6),
    count=st.integers(1, 9),
)
def test_shards_share_out_every_file_once_and_evenly_and_keep_copies_together(
    lengths: list[int], copies: list[int], count: int
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, f"{k:03}.mcap") for k in range(len(lengths))]
        for k, (path, length) in enumerate(zip(paths, lengths, strict=True)):
            path.write_bytes(b"%03d" % k + bytes(length))
        kept = [k for k in copies if k < len(paths)]
        twins = [Path(folder, f"twin-{place}.mcap") for place in range(len(kept))]
        for twin, k in zip(twins, kept, strict=True):
            shutil.copy(paths[k], twin)
        parts = [Shard(number, count).part(paths + twins) for number in range(1, count + 1)]
        assert sorted(path for part in parts for path in part) == sorted(paths + twins)
        firsts = [[path for path in part if path in paths] for part in parts]
        assert max(map(len, firsts)) - min(map(len, firsts)) <= 1
        amounts = [sum(path.stat().st_size for path in part) for part in firsts]
        assert max(amounts) - min(amounts) <= max(lengths) + 3
        for twin, k in zip(twins, kept, strict=True):
            assert any(twin in part and paths[k] in part for part in parts)


def test_shards_together_make_the_store_of_one_call(campaign: Path, whole: dict[str, bytes], tmp_path: Path) -> None:
    store = Store(tmp_path / "s")
    done = [ingest(campaign, store, workers=1, shard=Shard(number, 5)) for number in (3, 1, 5, 4, 2)]
    assert sum(report.ingested + report.failed for report in done) == FILES
    assert max(report.ingested + report.failed for report in done) == 3
    assert contents(store.path) == whole
    assert ingest(campaign, store, workers=1).ingested == 0


def test_a_copy_is_told_by_the_shard_that_has_both(campaign: Path, tmp_path: Path) -> None:
    folder = tmp_path / "r"
    shutil.copytree(campaign, folder)
    shutil.copy(folder / "03.mcap", folder / "99.mcap")
    found = [take_inventory(folder, Shard(number, 4)).findings for number in range(1, 5)]
    assert [f.code for findings in found for f in findings] == [Code.DUPLICATE_FILE]


def test_more_shards_than_files_leave_some_with_nothing_to_do(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", Bench())
    counts = [ingest(tmp_path, Store(tmp_path / "s"), workers=1, shard=Shard(k, 3)).ingested for k in (1, 2, 3)]
    assert counts == [1, 0, 0]


def test_a_dangling_link_is_told_by_one_shard(campaign: Path, tmp_path: Path) -> None:
    folder = tmp_path / "r"
    shutil.copytree(campaign, folder)
    (folder / "gone.mcap").symlink_to(tmp_path / "nowhere")
    found = [take_inventory(folder, Shard(number, 3)) for number in (1, 2, 3)]
    assert sum(inventory.unreadable for inventory in found) == 1


@pytest.mark.parametrize("text", ["0/3", "4/3", "a", "1/1/1", "2-3", "", "-1/3", "1/0", "1.0/2"])
def test_a_shard_that_cannot_be_is_refused_with_a_hint(text: str) -> None:
    with pytest.raises(RecordingError, match="Count from 1"):
        Shard.of(text)


def test_a_shard_is_read_as_it_is_written() -> None:
    assert Shard.of("3/16") == Shard(3, 16)
