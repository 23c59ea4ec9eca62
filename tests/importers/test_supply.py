"""What a map states beside recordings is used where they lack it, reported with its hash, and only there."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer

from pmg.pipeline.commands.ingest import IngestOptions, run_ingest
from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.importers.supply import read_supply
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.findings import UnusableRecordingError
from pmg.pipeline.recording.read import Recording, read_recording
from pmg.pipeline.recording.supplied import SuppliedRecord
from pmg.pipeline.store.store import Store
from pmg.sim.errors import BenchError, PmgError

from ..recording.foreign import Definition, cdr
from ..recording.writer import CALIBRATION, RUN, Bench, Other, tracks, write

BENCH = Bench(2.0, ripple=0.1)
CHANNELS = tuple(tracks(BENCH))
WITHOUT_RUN = dict.fromkeys(RUN)
STATED = "".join(f'{key} = "{value}"\n' for key, value in RUN.items() if key != "layout")


def supply(folder: Path, text: str, calibration: str | None = CALIBRATION) -> Path:
    """A map, and a calibration beside it."""
    if calibration is not None:
        (folder / "bench.toml").write_text(calibration)
    path = folder / "map.toml"
    path.write_text(f'schema = "pmg.import/1"\n{text}')
    return path


def without_run(path: Path, bench: Bench) -> Path:
    """The bench's recording without its metadata record, as of a session that was cut before it."""
    lean = Writer.add_metadata
    try:
        Writer.add_metadata = lambda *_: None  # type: ignore[method-assign]
        return write(path, bench)
    finally:
        Writer.add_metadata = lean  # type: ignore[method-assign]


def read(path: Path, chart: Path) -> Recording:
    return read_recording(path, None, read_supply(chart))


def test_run_and_calibration_that_lack_are_taken_from_the_map_and_told_with_its_hash(tmp_path: Path) -> None:
    whole = read_recording(write(tmp_path / "whole.mcap", BENCH))
    cut = without_run(tmp_path / "cut.mcap", replace(BENCH, calibration=None))
    chart = supply(tmp_path, f'calibration = "bench.toml"\n[run]\n{STATED}')
    with pytest.raises(UnusableRecordingError) as caught:
        read_recording(cut)
    assert {f.code for f in caught.value.findings} == {Code.RUN_MISSING, Code.CALIBRATION_MISSING}
    assert all("pmg ingest --map FILE" in f.do for f in caught.value.findings)
    found = read(cut, chart)
    assert (found.run, found.calibration) == (whole.run, whole.calibration)
    assert found.samples.equals(whole.samples)
    hashes = [hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() for name in ("map.toml", "bench.toml")]
    names = {"file": "map.toml", "sha256": hashes[0], "calibration": "bench.toml", "calibration_sha256": hashes[1]}
    assert found.supplied == SuppliedRecord(names, ("run", "calibration"))
    told = [(f.code, f.where) for f in found.findings]
    assert told == [
        (Code.RUN_MISSING, "metadata 'pmg.run'"),
        (Code.CALIBRATION_MISSING, "attachment 'calibration.toml'"),
    ]
    assert "map.toml" in found.findings[0].message
    assert hashes[0][:12] in found.findings[0].message
    assert hashes[1][:12] in found.findings[1].message


def test_a_recording_that_says_all_itself_takes_nothing(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", BENCH)
    other = STATED.replace("made", "other").replace('"1"', '"2"')
    chart = supply(tmp_path, f'calibration = "bench.toml"\n[run]\n{other}sun_speed_set_rpm = 99\n')
    found, plain = read(path, chart), read_recording(path)
    assert (found.run, found.calibration, found.findings) == (plain.run, plain.calibration, ())
    assert found.samples.equals(plain.samples)
    assert found.supplied is None


def test_only_the_required_keys_that_lack_are_filled(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", replace(BENCH, run={"campaign": None, "gear": "2", "point": None}))
    found = read(path, supply(tmp_path, f"[run]\n{STATED}sun_speed_set_rpm = 99\n", None))
    assert (found.run.campaign, found.run.gear, found.run.point) == ("made", 2, None)
    assert found.run.setpoints.speed_sun is None
    (finding,) = found.findings
    assert "lacks campaign" in finding.message


def test_a_calibration_that_contradicts_the_one_inside_is_told_and_not_used(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", BENCH)
    other = CALIBRATION.replace("span_Hz = 5000.0", "span_Hz = 5001.0")
    found = read(path, supply(tmp_path, 'calibration = "bench.toml"\n', other))
    assert found.calibration == read_recording(path).calibration
    (finding,) = found.findings
    assert finding.code is Code.CALIBRATION_VALUE
    assert "5000.0" in finding.message
    assert "5001.0" in finding.message
    assert found.supplied is None


def test_the_stem_names_the_point_and_a_word_out_of_vocabulary_is_refused(tmp_path: Path) -> None:
    cut = without_run(tmp_path / "E7.mcap", BENCH)
    text = STATED.replace('point = "P1"', 'point = { file = "stem" }')
    assert read(cut, supply(tmp_path, f"[run]\n{text}")).run.point == "E7"
    with pytest.raises(UnusableRecordingError) as caught:
        read(cut, supply(tmp_path, f"[run]\n{text.replace('neutral', 'neutrall')}"))
    assert any("Did you mean 'neutral'?" in f.do for f in caught.value.findings)


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("", "map.toml"),
        ('calibration = "none.toml"\n', "calibration"),
        ("[run]\ncampain = 1\n", "run.campain"),
        ('[run]\npoint = { property = "P" }\n', "run.point"),
        ("[run]\ngear = 1\n[time]\nrate_hz = 5\n", "time.rate_hz"),
        ('[[channel]]\ntopic = "/daq/torque_sun/freq"\n', "channel[1].topic"),
        (f'[[channel]]\ntopic = "{CHANNELS[0]}"\nsource = "/a"\n', "channel[1].field"),
        (f'[[channel]]\ntopic = "{CHANNELS[0]}"\nsource = "/a"\nfield = "a,b"\n', "channel[1].field"),
        (f'[[channel]]\ntopic = "{CHANNELS[0]}"\nsource = "/a"\nfield = "a"\nunit = "kHz"\n', "channel[1].unit"),
        (f'[[channel]]\ntopic = "{CHANNELS[0]}"\nsource = "/a"\nfield = "a"\n' * 2, "channel"),
        ("[run\n", "map.toml"),
    ],
)
def test_a_fault_in_the_map_is_told_with_its_place(tmp_path: Path, text: str, where: str) -> None:
    with pytest.raises(BenchError) as caught:
        read_supply(supply(tmp_path, text))
    assert where in caught.value.where


def test_a_map_or_a_calibration_that_cannot_be_used_is_an_error_and_no_trace(tmp_path: Path) -> None:
    with pytest.raises(PmgError):
        read_supply(tmp_path / "none.toml")
    with pytest.raises(PmgError, match="span_Hz"):
        read_supply(supply(tmp_path, 'calibration = "bench.toml"\n', CALIBRATION.replace("span_Hz", "span_hz")))


# --- channels under other names ------------------------------------------------------------------------

NAMES = {topic: f"{topic.split('/')[2]}.reading" for topic in CHANNELS}


def under_other_names(encoding: str, kept: Mapping[str, str]) -> dict[str, Other]:
    """All channels as one foreign topic with nested fields, many samples a message."""
    columns = {topic: values for topic, (_, values) in tracks(BENCH).items()}
    messages = []
    inner: Definition = [("reading", "float64", 0)]
    made_of: Definition = [("sample", "int64", None), *((topic.split("/")[2], inner, None) for topic in columns)]
    for start in range(0, 1000, 50):
        part = {topic.split("/")[2]: {"reading": v[start : start + 50].tolist()} for topic, v in columns.items()}
        value: dict[str, Any] = {"sample": start} | part
        messages.append(json.dumps(value).encode() if encoding == "json" else cdr(made_of, value))
    fields = "\n".join(f"vendor/Inner {topic.split('/')[2]}" for topic in columns)
    text = f"int64 sample\n{fields}\n{'=' * 80}\nMSG: vendor/Inner\nfloat64[] reading\n"
    schema = ("v", "jsonschema", b"{}") if encoding == "json" else ("vendor/msg/Frame", "ros2msg", text.encode())
    return {"/vendor/frame": Other(encoding, schema, messages, kept)}


def named(names: Mapping[str, str], source: str = "/vendor/frame", more: str = "") -> str:
    return "".join(f'[[channel]]\ntopic = "{t}"\nsource = "{source}"\nfield = "{f}"\n{more}' for t, f in names.items())


@pytest.mark.parametrize("encoding", ["json", "cdr"])
@pytest.mark.parametrize("declared", [True, False])
def test_channels_under_other_names_are_read_by_the_map_to_the_same_samples(
    tmp_path: Path, encoding: str, declared: bool
) -> None:
    whole = read_recording(write(tmp_path / "whole.mcap", BENCH))
    kept = {"rate_hz": "500", "counts_per_rev": "5120"} if declared else {}
    bench = replace(BENCH, without=frozenset(CHANNELS), other=under_other_names(encoding, kept))
    path = write(tmp_path / "a.mcap", bench)
    with pytest.raises(UnusableRecordingError):
        read_recording(path)
    found = read(path, supply(tmp_path, ("" if declared else "[time]\nrate_Hz = 500\n") + named(NAMES), None))
    np.testing.assert_array_equal(found.samples.drop("lines").to_numpy(), whole.samples.drop("lines").to_numpy())
    assert found.supplied is not None
    assert found.supplied.parts == ("channels",)
    assert (Code.MESSAGE_FIELD, "/vendor/frame") in {(f.code, f.where) for f in found.findings}
    assert not any(f.code is Code.TOPIC_UNKNOWN for f in found.findings)


def test_counters_of_different_width_in_one_topic_each_have_theirs(tmp_path: Path) -> None:
    """The sun's counter is of 16 bits and wraps; that of the ring is of 32."""
    sun, ring = "/daq/encoder_sun/count", "/daq/encoder_ring/count"
    bench = replace(BENCH, start_count={"sun": 60_000, "ring": 200_000})
    columns = {topic: values for topic, (_, values) in tracks(bench).items()}
    messages = [
        json.dumps({"sample": k, "a": int(columns[sun][k]) % 2**16, "b": int(columns[ring][k])}).encode()
        for k in range(1000)
    ]
    other = {"/v": Other("json", ("v", "jsonschema", b"{}"), messages, {})}
    path = write(tmp_path / "a.mcap", replace(bench, without=frozenset({sun, ring}), other=other))
    text = "[time]\nrate_Hz = 500\n" + named({sun: "a"}, "/v", "bits = 16\n") + named({ring: "b"}, "/v", "bits = 32\n")
    found = read(path, supply(tmp_path, text, None)).samples
    whole = read_recording(write(tmp_path / "whole.mcap", bench)).samples
    for side in ("sun", "ring"):
        moved, expected = (np.diff(frame[f"angle_{side}"].to_numpy()) for frame in (found, whole))
        np.testing.assert_allclose(moved, expected, atol=1e-12)


def test_a_topic_of_the_map_that_is_not_in_the_file_is_told(tmp_path: Path) -> None:
    bench = replace(BENCH, without=frozenset(CHANNELS), other=under_other_names("json", {"rate_hz": "500"}))
    path = write(tmp_path / "a.mcap", bench)
    with pytest.raises(UnusableRecordingError) as caught:
        read(path, supply(tmp_path, named(NAMES, "/vendor/frames"), None))
    (told,) = [f for f in caught.value.findings if f.where == "/vendor/frames"]
    assert told.do == "Did you mean '/vendor/frame'?"
    whole = write(tmp_path / "whole.mcap", BENCH)
    assert read(whole, supply(tmp_path, named(NAMES), None)).findings == ()


# --- ingest --------------------------------------------------------------------------------------------


def test_ingest_takes_the_map_and_keeps_what_it_supplied_until_another_is_given(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    write(folder / "whole.mcap", replace(BENCH, run={"started_at": "2025-04-23T09:00:00Z"}))
    without_run(folder / "cut.mcap", replace(BENCH, calibration=None))
    chart = supply(tmp_path, f'calibration = "bench.toml"\n[run]\n{STATED}')
    place = tmp_path / "store"

    def again(path: Path | None) -> tuple[int, int, int]:
        data = run_ingest(folder, place, IngestOptions(1, chart=path)).data
        return data["ingested"], data["skipped"], data["failed"]

    assert again(None) == (1, 0, 1)
    assert again(chart) == (1, 1, 0)
    manifests = {m.file: m.document() for m in Store(place).manifests()}
    assert manifests["cut.mcap"]["supplied"]["parts"] == ["run", "calibration"]
    assert "supplied" not in manifests["whole.mcap"]
    assert again(chart) == again(None) == (0, 2, 0)
    chart.write_text(chart.read_text().replace("P1", "P2"))
    assert again(chart) == (1, 1, 0)
    assert {w["point"] for m in Store(place).manifests() for w in m.document()["windows"]} == {"P1", "P2"}


def test_recordings_that_share_a_supplied_start_are_told(tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    for name, torque in (("a", 0.8), ("b", 0.9)):
        without_run(folder / f"{name}.mcap", replace(BENCH, torque={"sun": torque, "ring": -1.5}))
    report = ingest(
        folder, Store(tmp_path / "s"), workers=1, supplied=read_supply(supply(tmp_path, f"[run]\n{STATED}"))
    )
    assert report.ingested == 2
    assert [(f.code, f.file) for f in report.findings if f.where == "started_at"] == [(Code.RUN_VALUE, "b.mcap")]
    chart = read_supply(tmp_path / "map.toml")
    apart = [ingest(folder / f"{name}.mcap", Store(tmp_path / "t"), workers=1, supplied=chart) for name in "ba"]
    assert [len([f for f in each.findings if f.where == "started_at"]) for each in apart] == [0, 1]


def test_a_lacking_channel_is_looked_for_again_once_a_map_may_name_it(tmp_path: Path) -> None:
    topic = "/daq/torque_ring/frequency"
    values = tracks(BENCH)[topic][1].tolist()
    messages = [json.dumps({"sample": k, "f": v}).encode() for k, v in enumerate(values)]
    other = {"/v": Other("json", ("v", "jsonschema", b"{}"), messages, {"rate_hz": "500"})}
    path = write(tmp_path / "a.mcap", replace(BENCH, without=frozenset({topic}), other=other))
    store = Store(tmp_path / "store")
    assert ingest(path, store, workers=1).rejected == 1
    (lacking,) = store.manifests()
    assert lacking.document()["lacking"] == {"torque_ring": "not recorded"}
    assert lacking.document()["windows"][0]["reasons"] == ["channel missing: ring torque not recorded"]
    supplied = read_supply(supply(tmp_path, named({topic: "f"}, "/v"), None))
    report = ingest(path, store, workers=1, supplied=supplied)
    assert (report.ingested, report.rejected) == (1, 0)
    assert ingest(path, store, workers=1, supplied=supplied).skipped == 1


def test_a_map_of_which_a_lacking_recording_takes_nothing_is_tried_once(tmp_path: Path) -> None:
    topic = "/daq/torque_ring/frequency"
    path = write(tmp_path / "a.mcap", replace(BENCH, without=frozenset({topic})))
    store = Store(tmp_path / "store")
    supplied = read_supply(supply(tmp_path, named({topic: "f"}, "/v"), None))
    assert [ingest(path, store, workers=1, supplied=supplied).ingested for _ in range(2)] == [1, 0]
    assert ingest(path, store, workers=1).ingested == 0
    other = read_supply(supply(tmp_path, named({topic: "g"}, "/v"), None))
    assert ingest(path, store, workers=1, supplied=other).ingested == 1


def test_a_width_that_only_the_map_states_is_used_on_a_recording_that_was_taken_in_before(tmp_path: Path) -> None:
    """The counter is of 16 bits, wraps, and declares no width: without the map its angle is another one."""
    topic = "/daq/encoder_sun/count"
    bench = replace(BENCH, start_count={"sun": 60_000, "ring": 0})
    messages = [
        json.dumps({"sample": k, "value": int(v) % 2**16}).encode() for k, v in enumerate(tracks(bench)[topic][1])
    ]
    other = {topic: Other("json", ("v", "jsonschema", b"{}"), messages, {"rate_hz": "500"})}
    path = write(tmp_path / "a.mcap", replace(bench, without=frozenset({topic}), other=other))
    store = Store(tmp_path / "store")
    ingest(path, store, workers=1)
    assert not store.manifests()[0].windows[0].accepted
    supplied = read_supply(supply(tmp_path, named({topic: "value"}, topic, "bits = 16\n"), None))
    assert ingest(path, store, workers=1, supplied=supplied).ingested == 1
    assert store.manifests()[0].windows[0].accepted


def test_the_manifest_of_a_file_that_failed_holds_what_is_known_of_its_run(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", replace(BENCH, calibration=None, run={"ring_torque_set_Nm": "-1.5"}))
    report = ingest(path, Store(tmp_path / "store"), workers=1)
    assert (report.failed, report.campaigns) == (1, ())
    (failed,) = Store(tmp_path / "store").manifests()
    run = failed.document()["run"]
    assert (run["configuration"], run["started_at"]) == ("neutral", "2025-04-23T08:00:00.250000+00:00")
    assert run["setpoints"] == {"torque_ring": -1.5}
