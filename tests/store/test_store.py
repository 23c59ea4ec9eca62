"""The store survives kills, refuses foreign folders and writes the same bytes twice."""

from __future__ import annotations

import itertools
import json
import math
import os
from dataclasses import replace
from pathlib import Path
from unittest.mock import ANY

import polars as pl
import pytest

from pmg.pipeline.files.json_values import PROOF
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.means import BATCH_METHOD
from pmg.pipeline.recording.run_records import Setpoints
from pmg.pipeline.store.manifest import FAILED, Manifest, manifest_of
from pmg.pipeline.store.store import Store
from pmg.sim.errors import StoreError

SAMPLES = pl.DataFrame({"sample": [5, 6], "torque_sun": [0.25, -0.5]})
MANIFEST = Manifest("a-00000000", "a.mcap", sha256="0" * 64)


def filled(path: Path) -> Store:
    store = Store(path)
    store.prepare()
    store.write(MANIFEST, SAMPLES)
    return store


def everything(path: Path) -> dict[str, bytes]:
    return {p.relative_to(path).as_posix(): p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


def test_what_was_written_is_read_back(tmp_path: Path) -> None:
    filled(tmp_path / "s")
    store = Store(tmp_path / "s")
    (manifest,) = store.manifests()
    assert manifest.identifier == "a-00000000"
    assert manifest.ingested
    assert manifest.sha256 == "0" * 64
    assert store.samples(MANIFEST).equals(SAMPLES)


def test_the_same_source_gives_the_same_bytes(tmp_path: Path) -> None:
    filled(tmp_path / "one")
    filled(tmp_path / "two")
    store = filled(tmp_path / "two")
    assert everything(tmp_path / "one") == everything(store.path)


@pytest.mark.parametrize(
    "content", [{"schema": "pmg.store/0"}, {"schema": "pmg.store/2", "more": 1}, {}, [], "no JSON"]
)
def test_a_store_of_another_schema_is_refused_and_untouched(tmp_path: Path, content: object) -> None:
    text = content if isinstance(content, str) else json.dumps(content)
    (tmp_path / "store.json").write_text(text)
    before = everything(tmp_path)
    with pytest.raises(StoreError, match=r"pmg\.store/1"):
        Store(tmp_path)
    assert everything(tmp_path) == before


def test_a_folder_with_other_things_is_refused_and_untouched(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    before = everything(tmp_path)
    with pytest.raises(StoreError, match="nothing was changed"):
        Store(tmp_path)
    assert everything(tmp_path) == before
    with pytest.raises(StoreError, match="a file"):
        Store(tmp_path / "thesis.tex")


def test_opening_a_store_writes_nothing(tmp_path: Path) -> None:
    Store(tmp_path / "s")
    assert not (tmp_path / "s").exists()


def test_an_empty_store_is_said_to_be_empty(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="ingest"):
        Store(tmp_path / "s").manifests()


def test_samples_without_a_manifest_do_not_count(tmp_path: Path) -> None:
    """As a kill between the two leaves them."""
    store = filled(tmp_path)
    (tmp_path / "sources" / "a-00000000.json").unlink()
    assert store.manifest("a-00000000") is None
    assert store.manifests() == []


@pytest.mark.parametrize("text", ["", '{"schema": "pmg.store/1", "stat', '{"schema": "pmg.store/9"}', "[]"])
def test_a_manifest_that_cannot_be_read_counts_as_absent_for_resuming(tmp_path: Path, text: str) -> None:
    store = filled(tmp_path)
    (tmp_path / "sources" / "a-00000000.json").write_text(text)
    assert store.manifest("a-00000000") is None
    assert store.manifests(whole=False) == []
    (stand_in,) = store.manifests()
    assert not stand_in.ingested
    assert (stand_in.findings[0].code, stand_in.findings[0].severity) == (Code.STORE_CHANGED, "error")


def test_a_document_that_was_changed_by_hand_stands_for_nothing(tmp_path: Path) -> None:
    """Whatever digit it is; one that holds no hash of itself is read, and unproven."""
    store = filled(tmp_path)
    (proven,) = store.manifests()
    assert proven.proven
    path = tmp_path / "sources" / "a-00000000.json"
    text = path.read_text()
    for place, sign in [(place, sign) for place, sign in enumerate(text) if sign.isdecimal()][::7]:
        path.write_text(text[:place] + str((int(sign) + 1) % 10) + text[place + 1 :])
        assert store.manifest("a-00000000") is None
        (stand_in,) = store.manifests()
        assert not stand_in.ingested
    path.write_text(json.dumps(json.loads(text)))
    assert not store.manifests()[0].ingested, "other bytes with the same values"
    path.write_text(json.dumps({key: value for key, value in json.loads(text).items() if key != PROOF}))
    (unproven,) = store.manifests()
    assert (unproven.ingested, unproven.proven) == (True, False)


def test_samples_that_were_changed_are_not_read(tmp_path: Path) -> None:
    store = filled(tmp_path)
    SAMPLES.with_columns(torque_sun=pl.lit(0.26)).write_parquet(tmp_path / "runs" / "a-00000000.parquet")
    (manifest,) = store.manifests()
    with pytest.raises(StoreError, match="as pmg wrote it"):
        store.samples(manifest)
    assert store.samples(replace(manifest, files={}))["torque_sun"].to_list() == [0.26, 0.26], "without a hash"


def test_a_manifest_whose_samples_are_gone_counts_as_absent(tmp_path: Path) -> None:
    store = filled(tmp_path)
    (tmp_path / "runs" / "a-00000000.parquet").unlink()
    assert store.manifest("a-00000000") is None
    with pytest.raises(StoreError, match="Ingest its source again"):
        store.samples(MANIFEST)


def test_damaged_samples_are_named(tmp_path: Path) -> None:
    store = filled(tmp_path)
    path = tmp_path / "runs" / "a-00000000.parquet"
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(StoreError, match=r"a-00000000\.parquet"):
        store.samples(MANIFEST)


def test_an_interrupted_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = filled(tmp_path)
    before = everything(tmp_path)

    def interrupted(self: Path, target: Path) -> Path:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        store.write(replace(MANIFEST, status=FAILED), SAMPLES.head(1))
    assert everything(tmp_path) == before


EARLIER = Path(__file__).parents[1] / "data" / "store_v1"


@pytest.mark.parametrize("failing", [1, 2, 3])
def test_a_disk_that_fails_for_one_file_of_a_source_leaves_all_of_its_files_as_they_were(
    failing: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, names = Store(tmp_path), ("orders/a.parquet", "orders/a.json")
    store.write(MANIFEST, SAMPLES, dict.fromkeys(names, b"old"))
    before = everything(tmp_path)
    settled = itertools.count(1)

    def fails(_: int) -> None:
        if next(settled) == failing:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fails)
    with pytest.raises(OSError, match="No space left"):
        store.write(MANIFEST, SAMPLES.head(1), dict.fromkeys(names, b"new"))
    assert everything(tmp_path) == before


def test_a_store_that_was_written_before_is_read_and_written_with_the_same_entries(tmp_path: Path) -> None:
    manifests = {manifest.file: manifest for manifest in Store(EARLIER).manifests()}
    assert list(manifests) == ["cut.mcap", "failed.mcap", "lean.mcap", "whole.mcap"]
    again = Store(tmp_path / "s")
    again.prepare()
    for manifest in manifests.values():
        again.write(manifest, Store(EARLIER).samples(manifest) if manifest.ingested else None)
        name = f"sources/{manifest.identifier}.json"
        written = json.loads((tmp_path / "s" / name).read_text(encoding="utf-8"))
        assert (written.pop(PROOF), manifest.proven) == (ANY, False)
        assert bool(written.pop("files", {})) == manifest.ingested
        assert json.dumps(written) == json.dumps(json.loads((EARLIER / name).read_text(encoding="utf-8")))
    failed, lean, cut = (manifests[f"{name}.mcap"] for name in ("failed", "lean", "cut"))
    assert (failed.ingested, failed.campaign, failed.run.gear) == (False, "made", None)
    assert failed.run.setpoints == Setpoints(torque_ring=-1.5)
    assert lean.lacking == {"torque_ring": "not recorded"}
    assert math.isnan(lean.windows[0].means.ring.torque)
    assert cut.supplied is not None
    assert cut.supplied.parts == ("run", "calibration")
    assert manifests["whole.mcap"].calibration.counts_per_rev["ring"] > 0


def test_what_an_earlier_version_did_not_write_is_not_known() -> None:
    (path,) = (EARLIER / "sources").glob("whole-*.json")
    document = json.loads(path.read_text())
    means = document["windows"][0]["means"]["sun"]
    for plain, names in ((document, ("size", "reduction", "limits")), (means, ("method", "correlated", "resolution"))):
        for name in names:
            del plain[name]
    del document["calibration"]["ring"]["serial"]
    manifest = manifest_of("x", document)
    assert (manifest.size, manifest.reduction, manifest.limits) == (None, None, None)
    sun = manifest.windows[0].means.sun
    assert (sun.method, sun.correlated, math.isnan(sun.resolution)) == (BATCH_METHOD, False, True)
    assert manifest.calibration.ring.serial == ""


@pytest.mark.parametrize(
    ("key", "value"), [("torque", "much"), ("speed", True), ("within", []), ("torque", ...), ("speed", ...)]
)
def test_a_mean_that_is_no_number_is_damage(key: str, value: object) -> None:
    (path,) = (EARLIER / "sources").glob("whole-*.json")
    document = json.loads(path.read_text())
    shaft = document["windows"][0]["means"]["ring"]
    if value is ...:
        del shaft[key]
    else:
        shaft[key] = value
    with pytest.raises((TypeError, KeyError)):
        manifest_of("x", document)
