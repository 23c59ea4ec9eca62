"""A temperature comes in by its topic, stands among the conditions of its campaign, and in no other channel."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
import pytest
from tests.recording.foreign import scalar
from tests.recording.writer import Bench, Other, block, write

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.files.json_values import proven_json
from pmg.pipeline.grid.conditions import conditions
from pmg.pipeline.importers.channel_map import read_map
from pmg.pipeline.importers.import_recording import import_recording
from pmg.pipeline.recording.findings import Severity
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.store.manifest import Manifest, manifest_of
from pmg.pipeline.store.store import Store
from pmg.sim.errors import BenchError

from . import written

if TYPE_CHECKING:
    from pathlib import Path

TOPIC = "/daq/temperature/bearing"
KEPT = {"quantity": "temperature", "unit": "degC", "dtype": "f64", "rate_hz": "500", "clock_id": "0"}


def mapped(folder: Path, more: str) -> Path:
    channels = "".join(written.channel(topic, name, unit=written.UNITS[name]) for name, topic in written.TOPICS.items())
    return written.write_map(folder, written.map_text(channels + more))


@pytest.mark.parametrize(("unit", "zero"), [("degC", 0.0), ("K", 273.15)])
def test_temperatures_are_told_among_the_conditions(tmp_path: Path, unit: str, zero: float) -> None:
    warm = 21.0 + 3.0 * np.linspace(0.0, 1.0, 2500)
    warm[7] = np.nan
    pl.DataFrame({**written.raw(), "pt100": warm + zero}).write_parquet(tmp_path / "E1.parquet")
    chart = read_map(mapped(tmp_path, written.channel(TOPIC, "pt100", unit=unit)))
    done = import_recording(tmp_path / "E1.parquet", chart, tmp_path / "recordings" / "E1.mcap")
    assert done.written[TOPIC] == 2499
    whole = read_recording(done.out, coils=True)
    assert whole.auxiliary.temperatures == {"bearing": pytest.approx((21.0, 24.0))}
    assert not read_recording(done.out).auxiliary.temperatures, "which only an ingest asks for"
    store = Store(tmp_path / "store")
    ingest(tmp_path / "recordings", store, workers=1)
    (manifest,) = store.manifests()
    assert manifest_of("again", manifest.document()).temperatures == manifest.temperatures
    rows = dict(conditions([manifest]).rows)
    assert rows["Temperature, bearing"] == "21.0 to 24.0 °C"
    assert "Bearing temperature" not in rows
    assert rows["Air temperature"] == "not recorded"


@pytest.mark.parametrize(
    ("topic", "more", "words"),
    [
        ("/daq/temperature/", {"unit": "degC"}, "topic"),
        ("/daq/temperature/a b", {"unit": "degC"}, "topic"),
        (TOPIC, {"unit": "rpm"}, "a unit of which /daq/temperature/bearing is made"),
        (TOPIC, {"unit": "degC", "sign": -1}, "-1 for a temperature"),
        (TOPIC, {}, "no unit"),
    ],
)
def test_what_is_no_temperature_is_refused(tmp_path: Path, topic: str, more: dict[str, str | int], words: str) -> None:
    pl.DataFrame({**written.raw(100), "pt100": np.full(100, 20.0)}).write_parquet(tmp_path / "E1.parquet")
    chart = mapped(tmp_path, written.channel(topic, "pt100", **more))
    with pytest.raises(BenchError, match=words):
        import_recording(tmp_path / "E1.parquet", read_map(chart), tmp_path / "E1.mcap")


def stored(folder: Path, bench: Bench) -> Manifest:
    """The manifest of a recording that was ingested."""
    place = folder / "recordings"
    place.mkdir()
    write(place / "E1.mcap", bench)
    ingest(place, Store(folder / "store"), workers=1)
    (manifest,) = Store(folder / "store").manifests()
    return manifest


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"unit": "K"}, "unit 'K'; expected 'degC'"),
        ({"unit": "°C"}, "unit '°C'; expected 'degC'"),
        ({"rate_hz": None}, "metadata 'rate_hz' is missing"),
        ({"clock_id": "1"}, "clock_id '1'; expected '0'"),
    ],
)
def test_a_temperature_against_the_layout_is_among_the_findings_of_its_recording(
    tmp_path: Path, changed: dict[str, str | None], words: str
) -> None:
    odd = Bench(extra={TOPIC: block(0, "f64", np.full(100, 300.0))}, channel={TOPIC: {**KEPT, **changed}})
    manifest = stored(tmp_path, odd)
    (told,) = [finding for finding in manifest.findings if finding.where == TOPIC]
    assert told.severity is Severity.ERROR
    assert words in told.message
    assert not manifest.temperatures


def test_a_temperature_in_single_messages_is_left_unread_and_named_once(tmp_path: Path) -> None:
    single = Other("protobuf", ("pmg.v1.Scalar", "protobuf", b""), [scalar(n, 21.5) for n in range(3)], KEPT)
    manifest = stored(tmp_path, Bench(other={TOPIC: single}))
    (told,) = [finding for finding in manifest.findings if finding.where == TOPIC]
    assert told.severity is Severity.INFO
    assert told.message == "3 messages 'pmg.v1.Scalar'; expected 'pmg.v1.SampleBlock'. Not read"


def test_a_store_from_before_temperatures_were_kept_is_read_anew(tmp_path: Path) -> None:
    manifest = stored(tmp_path, Bench(extra={TOPIC: block(0, "f64", np.full(100, 21.5))}, channel={TOPIC: KEPT}))
    assert manifest.temperatures == {"bearing": (21.5, 21.5)}
    (path,) = (tmp_path / "store" / "sources").glob("*.json")
    document = json.loads(path.read_text(encoding="utf-8"))
    del document["temperatures"]
    path.write_bytes(proven_json(document | {"reduction": 4}))
    store = Store(tmp_path / "store")
    assert not store.manifests()[0].temperatures
    assert ingest(tmp_path / "recordings", store, workers=1).ingested == 1
    assert store.manifests() == [manifest]


@pytest.mark.parametrize(
    ("place", "label"),
    [
        ("bearing_ring", "Bearing temperature"),
        ("RingBearings", "Bearing temperature"),
        ("magnet2", "Magnet temperature"),
        ("hall-air", "Air temperature"),
    ],
)
def test_a_word_of_the_place_tells_which_condition_was_recorded(place: str, label: str) -> None:
    labels = [name for name, _ in conditions([]).rows]
    rows = dict(conditions([Manifest("x", temperatures={place: (21.0, 24.0)})]).rows)
    assert rows[f"Temperature, {place}"] == "21.0 to 24.0 °C"
    assert [name for name in labels if name not in rows] == [label]
