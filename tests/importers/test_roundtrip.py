"""The same run, with and without the detour through another format, gives the same means."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from tests.slow import SLOW

from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.files.atomic import PREFIX, abandoned
from pmg.pipeline.importers.block_file import block_file
from pmg.pipeline.importers.channel_map import read_map
from pmg.pipeline.importers.import_recording import Imported, import_recording
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.read import Recording, read_recording
from pmg.pipeline.store.store import Store
from pmg.sim.errors import BenchError, PmgError, RecordingError
from pmg.sim.signals import RPM

from . import written

ROUNDING_NM = 1e-9
"""A torque written as hertz with six decimals [N m]."""


def brought(folder: Path, source: Path, text: str) -> tuple[Imported, Recording]:
    chart = read_map(written.write_map(folder, text))
    done = import_recording(source, chart, folder / "out" / "a.mcap")
    return done, read_recording(done.out)


def window(folder: Path, recording: Path) -> dict[str, Any]:
    store = Store(folder)
    ingest(recording, store, workers=1)
    (manifest,) = store.manifests()
    (found,) = manifest.document()["windows"]
    assert isinstance(found, dict)
    return found


def assert_same_means(folder: Path, imported: Path, torque: float = ROUNDING_NM) -> None:
    (folder / "direct.mcap").write_bytes(written.original())
    direct = window(folder / "store-direct", folder / "direct.mcap")
    other = window(folder / "store-imported", imported)
    for key in ("point", "configuration", "gear", "drive", "started_at_s", "first_sample", "stop_sample", "setpoints"):
        assert other[key] == direct[key], key
    for side in ("sun", "ring"):
        for name, value in direct["means"][side].items():
            got = other["means"][side][name]
            if isinstance(value, float):
                assert got == pytest.approx(value, rel=1e-6, abs=torque), (side, name)
            else:
                assert got == value, (side, name)


# --- csv -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("time", [False, True])
def test_csv_gives_the_same_means(tmp_path: Path, time: bool) -> None:
    source = tmp_path / "E1.csv"
    source.write_text(written.csv_text(time=time), encoding="cp1252", newline="")
    done, _ = brought(tmp_path, source, written.map_text(written.PLAIN, 'source = "t"' if time else "rate_Hz = 500"))
    assert (done.rows, done.rate_hz, done.format, done.findings) == (2500, 500.0, "csv", ())
    assert_same_means(tmp_path, done.out)


def test_the_chain_back_to_the_source_is_in_the_recording(tmp_path: Path) -> None:
    source = tmp_path / "E1.csv"
    source.write_text(written.csv_text(), encoding="utf-8-sig", newline="")
    text = written.map_text(written.PLAIN)
    done, _ = brought(tmp_path, source, text)
    with done.out.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        origin = {record.name: record.metadata for record in reader.iter_metadata()}["pmg.import"]
        attached = {item.name: item.data for item in reader.iter_attachments()}
        summary = reader.get_summary()
    assert origin["source_sha256"] == hashlib.sha256(source.read_bytes()).hexdigest() == done.sha256
    assert (origin["source"], origin["source_format"], origin["source_rows"]) == ("E1.csv", "csv", "2500")
    assert json.loads(origin["findings"]) == []
    read = {key: origin[f"source_{key}"] for key in done.reading}
    assert read == done.reading
    assert read == {
        "encoding": "utf-8-sig",
        "delimiter": ";",
        "decimal": ",",
        "units_row": "line 3",
        "first_row": "line 4",
    }
    assert attached["import-map.toml"].decode() == text
    assert summary is not None
    named = {channel.topic: channel.metadata["imported_from"] for channel in summary.channels.values()}
    assert named == {topic: name for name, topic in written.TOPICS.items()}


def test_the_same_source_gives_the_same_bytes(tmp_path: Path) -> None:
    source = tmp_path / "E1.csv"
    source.write_text(written.csv_text(300), newline="")
    chart = read_map(written.write_map(tmp_path, written.map_text(written.PLAIN)))
    one, two = (import_recording(source, chart, tmp_path / f"{name}.mcap").out.read_bytes() for name in "ab")
    assert one == two


def test_a_bad_cell_with_a_good_time_is_told_as_such_and_its_row_keeps_its_place(tmp_path: Path) -> None:
    lines = written.csv_text(300, time=True, comment="").splitlines()
    cells = lines[102].split(";")
    lines[102] = ";".join([cells[0], "#WERT!", *cells[2:]])
    source = tmp_path / "E1.csv"
    source.write_text("\n".join(lines) + "\n")
    text = written.map_text(written.PLAIN, 'source = "t"', extra="[csv]\nbad_rows = 1\n")
    done, found = brought(tmp_path, source, text)
    assert [(finding.code, finding.where) for finding in done.findings] == [
        (Code.MESSAGE_MALFORMED, "line 103, column 'torque_sun'"),
        (Code.NOT_FINITE, "torque_sun, from line 103"),
    ]
    assert done.findings[1].lost == "1 sample of /daq/torque_sun/frequency"
    torques = (found.samples[f"torque_{side}"].to_numpy() for side in ("sun", "ring"))
    assert [np.flatnonzero(~np.isfinite(torque)).tolist() for torque in torques] == [[100], []]
    ingest(done.out, Store(tmp_path / "store"), workers=1)
    (manifest,) = Store(tmp_path / "store").manifests()
    assert [finding["where"] for finding in manifest.document()["findings"]][:2] == [f.where for f in done.findings]


def test_what_is_being_written_tells_whose_it_is(tmp_path: Path) -> None:
    with block_file(tmp_path / "a.mcap", written.START, 500.0):
        (aside,) = tmp_path.iterdir()
        realm, pid, _ = aside.name.removeprefix(PREFIX).split("-", 2)
        assert (int(pid.partition(".")[0]), abandoned(aside)) == (os.getpid(), False)
        left = subprocess.Popen([sys.executable, "-c", ""])
        left.wait()
        assert abandoned(aside.with_name(f"{PREFIX}{realm}-{left.pid}-x.mcap"))
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_nothing_is_left_behind_when_an_import_fails_midway(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pmg.pipeline.importers.csv_source.ROWS", 100)
    source = tmp_path / "E1.csv"
    source.write_text(written.csv_text(300).replace("\r\n", "\r\nx", 260), newline="")
    lines = written.csv_text(300).splitlines(keepends=True)
    lines[280] = "1;x;3;4\r\n"
    source.write_text("".join(lines), newline="")
    chart = read_map(written.write_map(tmp_path, written.map_text(written.PLAIN)))
    with pytest.raises(RecordingError, match="line 281, column 'torque_ring'"):
        import_recording(source, chart, tmp_path / "out" / "a.mcap")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("rows", [7, 100, 1000])
def test_the_size_of_a_block_does_not_matter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int) -> None:
    source = tmp_path / "E1.csv"
    source.write_text(written.csv_text(1500, time=True), newline="")
    text = written.map_text(written.PLAIN, 'source = "t"')
    _, whole = brought(tmp_path, source, text)
    monkeypatch.setattr("pmg.pipeline.importers.csv_source.ROWS", rows)
    _, parts = brought(tmp_path, source, text)
    assert parts.samples.equals(whole.samples)


def test_single_empty_cells_are_single_missing_samples_of_that_channel(tmp_path: Path) -> None:
    lines = written.csv_text(300, comment="").splitlines()
    for row in (7, 9, 250):
        cells = lines[row + 2].split(";")
        lines[row + 2] = ";".join([*cells[:3], ""])
    source = tmp_path / "E1.csv"
    source.write_text("\n".join(lines) + "\n")
    done, found = brought(tmp_path, source, written.map_text(written.PLAIN))
    angle = found.samples["angle_ring"].to_numpy()
    assert np.flatnonzero(~np.isfinite(angle)).tolist() == [7, 9, 250]
    assert np.isfinite(found.samples["torque_sun"].to_numpy()).all()
    whole = np.asarray(written.run(300).angle_ring)
    gained, true = np.delete(angle, [7, 9, 250]), np.delete(whole, [7, 9, 250])
    assert np.abs((gained - gained[0]) - (true - true[0])).max() < 1.001 * 2 * np.pi / 4096
    assert [finding.where for finding in done.findings] == ["angle_ring, from line 10"]


def test_torque_speed_and_angle_in_other_units(tmp_path: Path) -> None:
    run = written.run()
    rows = ["Sun [mNm];Ring (V);n [1/min];phi"]
    for i in range(2500):
        ring = (run.torque_ring[i]) / 2.0 + 0.5
        angle = np.degrees(run.angle_ring[i]) % 360.0
        rows.append(f"{run.torque_sun[i] * 1e3:.6f};{ring:.9f};600.0;{angle:.6f}")
    source = tmp_path / "E1.csv"
    source.write_text("\n".join(rows) + "\n")
    text = written.map_text(
        written.channel(written.TOPICS["torque_sun"], "Sun")
        + written.channel(written.TOPICS["torque_ring"], "Ring", unit="V", Nm_per_unit=2.0, zero=0.5)
        + written.channel(written.TOPICS["angle_sun"], "n", unit="rpm")
        + written.channel(written.TOPICS["angle_ring"], "phi", unit="deg", wraps_at=360.0)
    )
    _, found = brought(tmp_path, source, text)
    np.testing.assert_allclose(found.samples["torque_sun"].to_numpy(), run.torque_sun, atol=1e-8)
    np.testing.assert_allclose(found.samples["torque_ring"].to_numpy(), run.torque_ring, atol=1e-8)
    for side, rpm, counts in (("sun", 600.0, 5120), ("ring", -230.0, 4096)):
        angle = found.samples[f"angle_{side}"].to_numpy()
        speed = (angle[-1] - angle[0]) / (2499 / written.RATE) / RPM
        assert abs(speed - rpm) <= 60.0 / counts / (2499 / written.RATE) + 1e-6


# --- the libraries' own files --------------------------------------------------------------------------


@pytest.mark.parametrize("interleaved", [False, True])
def test_tdms_gives_the_same_means(tmp_path: Path, interleaved: bool) -> None:
    nptdms = pytest.importorskip("nptdms")
    table = written.raw()
    source = tmp_path / "E1.tdms"
    with nptdms.TdmsWriter(str(source)) as writer:
        for part in (slice(0, 1000), slice(1000, 2500)):
            if interleaved:
                mixed = np.stack([table[name][part].astype(np.float64) for name in table], axis=1).ravel()
                objects = [nptdms.ChannelObject("DAQ", "all", mixed)]
            else:
                words = {"wf_increment": 0.002, "wf_start_time": np.datetime64("2026-03-04T09:30:00.250000")}
                objects = [
                    nptdms.ChannelObject("DAQ", name, table[name][part], words | {"unit_string": written.UNITS[name]})
                    for name in table
                ]
            writer.write_segment([nptdms.RootObject({"Point": "E1"}), *objects])
    run = written.RUN.replace('point = "E1"', 'point = { property = "Point" }')
    channels = (
        "".join(
            written.channel(topic, "DAQ/all", unit=written.UNITS[name], columns=4, column=place)
            for place, (name, topic) in enumerate(written.TOPICS.items(), 1)
        )
        if interleaved
        else "".join(written.channel(topic, f"DAQ/{name}") for name, topic in written.TOPICS.items())
    )
    if not interleaved:
        run = "\n".join(line for line in run.splitlines() if "started_at" not in line)
    done, _ = brought(tmp_path, source, written.map_text(channels, "rate_Hz = 500" if interleaved else "", run=run))
    assert (done.format, done.rows, done.rate_hz) == ("tdms", 2500, 500.0)
    assert_same_means(tmp_path, done.out)


def test_columns_in_one_tdms_channel_with_a_timer_that_wraps(tmp_path: Path) -> None:
    """Five columns in one channel, the first a 32-bit counter at 40 MHz that wraps after 2 of 5 s."""
    nptdms = pytest.importorskip("nptdms")
    table = written.raw()
    timer = (np.arange(2500, dtype=np.int64) * 80_000 + 2**32 - 80_000_000) % 2**32
    mixed = np.stack([timer.astype(np.float64), *(table[name].astype(np.float64) for name in table)], axis=1)
    source = tmp_path / "E1.tdms"
    with nptdms.TdmsWriter(str(source)) as writer:
        for part in np.array_split(np.delete(mixed, slice(700, 750), axis=0).ravel(), 7):
            writer.write_segment([nptdms.ChannelObject("DAQ", "all", part)])
    channels = "".join(
        written.channel(topic, "DAQ/all", unit=written.UNITS[name], columns=5, column=place)
        for place, (name, topic) in enumerate(written.TOPICS.items(), 2)
    )
    time = 'ticks = "DAQ/all"\ncolumns = 5\ncolumn = 1\nbits = 32\nfrequency_Hz = 40e6'
    done, found = brought(tmp_path, source, written.map_text(channels, time))
    assert (done.rows, done.rate_hz) == (2450, 500.0)
    (gap,) = done.findings
    assert (gap.code, gap.sample_range, gap.where) == (Code.SAMPLES_GAP, (700, 750), "sample 701")
    for side, per_rev in (("sun", 5120), ("ring", 4096)):
        angle = found.samples[f"angle_{side}"].to_numpy()
        assert np.flatnonzero(~np.isfinite(angle)).tolist() == list(range(700, 750))
        true = getattr(written.run(), f"angle_{side}")
        assert abs((angle[-1] - angle[0]) - (true[-1] - true[0])) < 2 * np.pi / per_rev


@pytest.mark.parametrize("bits", [16, 32])
def test_edges_and_ticks_give_the_torque(tmp_path: Path, bits: int) -> None:
    """A frequency of 12 kHz counted by its edges, the time of the last one by a counter of 40 MHz that wraps."""
    at = np.arange(2500) / written.RATE + 1e-9
    edges = np.floor(12_000.0 * at).astype(np.int64)
    ticks = np.floor(edges / 12_000.0 * 40e6).astype(np.int64)
    table = written.raw()
    source = tmp_path / "E1.csv"
    rows = zip((edges + 60_000) % 2**bits, ticks % 2**32, *(table[n] for n in list(table)[1:]), strict=True)
    names = "edges;ticks;torque_ring;angle_sun;angle_ring"
    source.write_text(names + "\n" + "".join(";".join(map(str, row)) + "\n" for row in rows))
    channels = (
        written.channel("/daq/torque_sun/edges", "edges", bits=bits)
        + written.channel("/daq/torque_sun/edge_ticks", "ticks", timebase_Hz=40e6)
        + "".join(written.channel(written.TOPICS[n], n, unit=written.UNITS[n]) for n in list(table)[1:])
    )
    _, found = brought(tmp_path, source, written.map_text(channels))
    assert found.samples["torque_sun"].to_numpy()[5:].mean() == pytest.approx(2.0, abs=1e-6)


@pytest.mark.parametrize(("end", "library"), [("tdms", "nptdms"), ("mf4", "asammdf")])
def test_damage_to_a_binary_file_gives_an_error_of_ours_or_a_recording(
    tmp_path: Path, rng: np.random.Generator, end: str, library: str
) -> None:
    module = pytest.importorskip(library)
    table = {name: values[:200] for name, values in written.raw().items()}
    source = tmp_path / f"a.{end}"
    if end == "tdms":
        with module.TdmsWriter(str(source)) as writer:
            writer.write_segment([module.ChannelObject("DAQ", name, table[name]) for name in table])
    else:
        mdf = module.MDF(version="4.10")
        time = np.arange(200) / written.RATE
        mdf.append([module.Signal(table[name].astype(np.float64), time, name=name) for name in table])
        mdf.save(source, overwrite=True)
        mdf.close()
    prefix = "DAQ/" if end == "tdms" else ""
    channels = "".join(written.channel(t, prefix + n, unit=written.UNITS[n]) for n, t in written.TOPICS.items())
    chart = read_map(written.write_map(tmp_path, written.map_text(channels)))
    whole = source.read_bytes()
    assert import_recording(source, chart, tmp_path / "whole.mcap").rows == 200
    told = 0
    for _ in range(25 if SLOW else 10):
        data = bytearray(whole)
        at = int(rng.integers(0, min(len(data), 2000)))
        if rng.random() < 0.3:
            del data[at:]
        else:
            data[at : at + 4] = rng.bytes(4)
        source.write_bytes(data)
        try:
            import_recording(source, chart, tmp_path / "b.mcap")
        except PmgError:
            told += 1
    assert told > 0


def test_a_tdms_file_that_was_cut_says_so(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    source = tmp_path / "E1.tdms"
    table = written.raw()
    with nptdms.TdmsWriter(str(source)) as writer:
        for part in (slice(0, 1000), slice(1000, 2500)):
            writer.write_segment([nptdms.ChannelObject("DAQ", name, table[name][part]) for name in table])
    data = source.read_bytes()
    source.write_bytes(data[: len(data) - 20_000])
    text = written.map_text(
        "".join(written.channel(t, f"DAQ/{n}", unit=written.UNITS[n]) for n, t in written.TOPICS.items())
    )
    done, found = brought(tmp_path, source, text)
    assert [finding.code for finding in done.findings].count(Code.TRUNCATED) == 1
    assert (done.written["/daq/torque_sun/frequency"], done.written["/daq/encoder_ring/count"]) == (2500, 1000)
    whole = written.raw()["torque_sun"]
    np.testing.assert_allclose(
        found.samples["torque_sun"].to_numpy(), written.CALIBRATION.sun.torque(whole.astype(np.float64)), atol=1e-9
    )
    assert not np.isfinite(found.samples["angle_ring"].to_numpy()[1000:]).any()
    assert any("missing" in finding.message and finding.lost for finding in done.findings)


def test_mf4_gives_the_same_means(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    table, t = written.raw(), np.arange(2500) / written.RATE
    source = tmp_path / "E1.mf4"
    mdf = asammdf.MDF(version="4.10")
    mdf.header.start_time = written.START
    kinds = {"torque_sun": np.float64, "torque_ring": np.float64, "angle_sun": np.uint32, "angle_ring": np.uint32}
    signals = {n: asammdf.Signal(table[n].astype(kinds[n]), t, name=n, unit=written.UNITS[n]) for n in table}
    mdf.append([signals["torque_sun"], signals["angle_sun"]])
    mdf.append([signals["torque_ring"], signals["angle_ring"]])
    mdf.save(source, overwrite=True)
    mdf.close()
    run = "\n".join(line for line in written.RUN.splitlines() if "started_at" not in line)
    done, _ = brought(tmp_path, source, written.map_text(written.PLAIN, "", run=run))
    assert (done.format, done.rows, done.rate_hz) == ("mf4", 2500, 500.0)
    assert_same_means(tmp_path, done.out)


def test_mf4_groups_at_other_times_are_refused(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    table, t = written.raw(), np.arange(2500) / written.RATE
    source = tmp_path / "E1.mf4"
    mdf = asammdf.MDF(version="4.10")
    for name, shift in zip(table, (0.0, 0.001, 0.0, 0.0), strict=True):
        mdf.append([asammdf.Signal(table[name].astype(np.float64), t + shift, name=name)])
    mdf.save(source, overwrite=True)
    mdf.close()
    channels = "".join(written.channel(t, n, unit=written.UNITS[n]) for n, t in written.TOPICS.items())
    with pytest.raises(RecordingError, match=r"0\.001 s apart"):
        brought(tmp_path, source, written.map_text(channels, ""))


@pytest.mark.parametrize(("end", "library", "extra"), [("tdms", "nptdms", "tdms"), ("mf4", "asammdf", "mf4")])
def test_a_missing_library_is_told_with_the_extra_that_brings_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str, library: str, extra: str
) -> None:
    monkeypatch.setattr("pmg.pipeline.importers.source.find_spec", lambda _: None)
    source = tmp_path / f"a.{end}"
    source.write_bytes(b"x")
    with pytest.raises(RecordingError) as caught:
        brought(tmp_path, source, written.map_text(written.PLAIN))
    assert library in caught.value.came
    assert f"pmg-bench[{extra}]" in caught.value.do
    assert "LGPL" in caught.value.do


@pytest.mark.parametrize(("end", "library"), [("tdms", "nptdms"), ("mf4", "asammdf")])
@pytest.mark.parametrize("data", [b"", b"nonsense" * 50])
def test_a_file_that_its_library_cannot_read_is_one_error(tmp_path: Path, end: str, library: str, data: bytes) -> None:
    pytest.importorskip(library)
    source = tmp_path / f"a.{end}"
    source.write_bytes(data)
    with pytest.raises(PmgError) as caught:
        brought(tmp_path, source, written.map_text(written.PLAIN))
    assert source.name in caught.value.where or source.name in caught.value.expected


def test_a_unit_that_contradicts_the_file_is_refused_unless_the_file_is_said_to_be_wrong(tmp_path: Path) -> None:
    source = tmp_path / "E1.csv"
    source.write_text(written.csv_text(300).replace("Hz;Hz", "V;Hz"), newline="")
    text = written.map_text(written.PLAIN.replace("'torque_sun'", "'torque_sun'\nunit = 'Hz'", 1))
    with pytest.raises(BenchError, match="file_unit = 'V'"):
        brought(tmp_path, source, text)
    _, found = brought(tmp_path, source, text.replace("unit = 'Hz'", "unit = 'Hz'\nfile_unit = 'V'", 1))
    assert found.samples.height == 300
