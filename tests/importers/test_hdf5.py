"""Recordings in HDF5, and in MAT files of version 7.3: names, units, what is refused, what is lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat
from tests.slow import SLOW, slow

from pmg.pipeline.importers.channel_map import read_map
from pmg.pipeline.importers.csv_dialect import CsvForm
from pmg.pipeline.importers.hdf5_source import is_hdf5
from pmg.pipeline.importers.import_recording import import_recording
from pmg.pipeline.importers.open_source import open_source, whole_channels
from pmg.pipeline.importers.source import ForeignSource, Wanted
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.findings import Findings
from pmg.sim.errors import PmgError, RecordingError

from . import written
from .test_roundtrip import assert_same_means, brought

Numbers = dict[str, Any]
HEAD = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Wed Mar  4 09:30:00 2026 HDF5 schema 1.00 ."
UNDER_DAQ = "".join(written.channel(topic, f"DAQ/{name}") for name, topic in written.TOPICS.items())


def made(path: Path, datasets: Numbers, *, user_block: int = 0, **words: object) -> Any:  # noqa: ANN401
    """A file with these datasets; words are attributes of the file."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=user_block) as file:
        file.attrs.update(words)
        for name, values in datasets.items():
            file[name] = values
    return h5py


def of_matlab(path: Path, variables: Numbers, kinds: dict[str, str] | None = None) -> Any:  # noqa: ANN401
    """A file as MATLAB writes it with -v7.3: transposed, with the class of each variable, and a head of its own."""
    h5py = made(path, {name: np.atleast_2d(values).T for name, values in variables.items()}, user_block=512)
    with h5py.File(path, "r+") as file:
        for name in variables:
            file[name].attrs["MATLAB_class"] = np.bytes_((kinds or {}).get(name, "double"))
        file["#refs#/a"] = np.arange(3.0)
    with path.open("r+b") as stream:
        stream.write(HEAD.ljust(124) + b"\x00\x02IM")
    return h5py


def opened(path: Path) -> tuple[ForeignSource, Findings]:
    findings = Findings(path.name)
    return open_source(path, CsvForm(), findings), findings


# --- the same run --------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["unit", "units", "Unit"])
def test_hdf5_gives_the_same_means(tmp_path: Path, key: str) -> None:
    source = tmp_path / "E1.h5"
    table = written.raw()
    h5py = made(source, {}, Point="E1")
    with h5py.File(source, "r+") as file:
        for name, values in table.items():
            dataset = file.create_dataset(f"DAQ/{name}", data=values, chunks=(700,), compression="gzip", shuffle=True)
            dataset.attrs[key] = written.UNITS[name].encode() if name == "torque_sun" else written.UNITS[name]
    run = written.RUN.replace('point = "E1"', 'point = { property = "Point" }')
    done, _ = brought(tmp_path, source, written.map_text(UNDER_DAQ, run=run))
    assert (done.format, done.rows, done.rate_hz, done.findings) == ("hdf5", 2500, 500.0, ())
    assert done.reader.startswith("h5py ")
    assert_same_means(tmp_path, done.out)


def test_a_mat_file_of_version_7_3_gives_what_one_of_7_2_gives(tmp_path: Path) -> None:
    table, time = written.raw(), np.arange(2500) / written.RATE
    variables: Numbers = {"T": np.column_stack(list(table.values())), "wide": np.vstack([time, time]), "t": time}
    savemat(tmp_path / "old.mat", variables)
    of_matlab(tmp_path / "new.mat", variables | {"t": time[:, np.newaxis]})
    old, new = opened(tmp_path / "old.mat")[0], opened(tmp_path / "new.mat")[0]
    assert (old.format, new.format) == ("mat", "hdf5")
    names = {channel.name for channel in old.channels}
    assert (
        names
        == {channel.name for channel in new.channels}
        == {*(f"T(:,{n})" for n in range(1, 5)), "t"} | {f"wide({n},:)" for n in (1, 2)}
    )
    one, other = whole_channels(old, sorted(names)), whole_channels(new, sorted(names))
    assert all(np.array_equal(one[name], other[name]) for name in names)
    channels = "".join(
        written.channel(topic, f"T(:,{n})", unit=written.UNITS[name])
        for n, (name, topic) in enumerate(written.TOPICS.items(), 1)
    )
    done, _ = brought(tmp_path, tmp_path / "new.mat", written.map_text(channels, 'source = "t"'))
    assert_same_means(tmp_path, done.out)


@pytest.mark.parametrize("rows", [7, 100, 1000])
def test_the_size_of_a_block_does_not_matter_to_hdf5(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int
) -> None:
    source = tmp_path / "E1.hdf5"
    matrix = np.arange(5000, dtype=">i4").reshape(1250, 4)
    made(source, {"x": matrix, "y": matrix.T, "b": matrix[:, 0] % 2 == 0})
    monkeypatch.setattr("pmg.pipeline.importers.library.ROWS", rows)
    found = whole_channels(opened(source)[0], ["x(:,4)", "x(:,2)", "y(1,:)", "b"])
    assert [column[:2].tolist() for column in found.values()] == [[3, 7], [1, 5], [0, 4], [1, 1]]
    assert all(len(column) == 1250 for column in found.values())


def test_columns_far_apart_are_read_one_by_one(tmp_path: Path) -> None:
    made(tmp_path / "a.h5", {"x": np.arange(80_000).reshape(2000, 40)})
    found = whole_channels(opened(tmp_path / "a.h5")[0], ["x(:,1)", "x(:,40)"])
    assert [column[1] for column in found.values()] == [40, 79]


def test_a_file_is_read_block_by_block(tmp_path: Path) -> None:
    made(tmp_path / "a.h5", {"x": np.arange(130_000.0)})
    blocks = list(opened(tmp_path / "a.h5")[0].blocks([Wanted("x")]))
    assert [(int(block.places[0]), len(block.places)) for block in blocks] == [
        (1, 64000),
        (64001, 64000),
        (128001, 2000),
    ]


def test_facts_of_the_file_are_its_attributes_single_values_and_texts_of_matlab(tmp_path: Path) -> None:
    made(tmp_path / "a.h5", {"meta/point": "P17", "meta/load": 2.5, "x": np.zeros(3)}, operator=b"AB", table=np.eye(3))
    assert opened(tmp_path / "a.h5")[0].properties == {"operator": "AB", "meta/point": "P17", "meta/load": "2.5"}
    text = np.array([[ord(sign) for sign in "spring"]], dtype=np.uint16)
    of_matlab(tmp_path / "a.mat", {"campaign": text, "x": np.zeros(3)}, {"campaign": "char"})
    assert opened(tmp_path / "a.mat")[0].properties == {"campaign": "spring"}


def test_units_that_contradict_each_other_are_left_to_the_map(tmp_path: Path) -> None:
    source = tmp_path / "E1.h5"
    h5py = made(source, {"DAQ": np.column_stack(list(written.raw().values()))})
    with h5py.File(source, "r+") as file:
        file["DAQ"].attrs["units"] = ["Hz", "Hz", "1", "1"]
    assert [channel.unit for channel in opened(source)[0].channels] == ["Hz", "Hz", "1", "1"]
    with h5py.File(source, "r+") as file:
        file["DAQ"].attrs.update({"unit": "V", "units": "Hz"})
    channels = "".join(
        written.channel(topic, f"DAQ(:,{n})", unit=written.UNITS[name])
        for n, (name, topic) in enumerate(written.TOPICS.items(), 1)
    )
    with pytest.raises(PmgError, match="'V or Hz' in the file"):
        brought(tmp_path, source, written.map_text(channels))


# --- what is no row of numbers -------------------------------------------------------------------------


def test_what_holds_no_rows_of_numbers_is_refused_with_its_reason_and_the_rest_is_read(tmp_path: Path) -> None:
    source = tmp_path / "a.h5"
    pair = np.zeros(3, dtype=[("t", "f8"), ("x", "f8")])
    datasets: Numbers = {"note": ["a", "b"], "pair": pair, "cube": np.zeros((2, 3, 4)), "z": np.zeros(3, dtype=complex)}
    h5py = made(source, datasets | {"one": 1.0, "picture": np.zeros((1001, 1001), dtype="i1"), "x": np.arange(3.0)})
    layout = h5py.VirtualLayout((3,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (3,))
    with h5py.File(source, "r+") as file:
        file["there"], file["away"] = h5py.ExternalLink("other.h5", "x"), h5py.SoftLink("/gone")
        file.create_virtual_dataset("virtual", layout)
        file["group/round"] = file["group"] if "group" in file else file.create_group("group")
        file["packed"] = np.zeros(3, dtype=np.int16)
        file["packed"].attrs["scale_factor"] = 0.5
        file["empty"] = h5py.Empty("f8")
    expected = {
        "note": "text",
        "pair": "compound values with the fields t, x",
        "cube": "3 dimensions, 2 by 3 by 4",
        "z": "complex numbers",
        "one": "a single number",
        "picture": "a matrix of 1001 by 1001",
        "there": "a link to another file, 'other.h5'",
        "away": "a link to '/gone', which is not there",
        "virtual": "values that lie in other files",
        "group/round": "a group that holds itself",
        "packed": "scale_factor",
        "empty": "no values",
    }
    found, _ = opened(source)
    assert {channel.name for channel in found.channels} == {*expected, "x"}
    for name, reason in expected.items():
        with pytest.raises(RecordingError) as caught:
            whole_channels(found, [name])
        assert caught.value.where == f"a.h5: {name}"
        assert reason in caught.value.came
        assert caught.value.do
    assert whole_channels(found, ["x"])["x"].tolist() == [0.0, 1.0, 2.0]


def test_of_matlab_cells_sparse_matrices_and_objects_are_refused_and_structs_of_numbers_read(tmp_path: Path) -> None:
    source = tmp_path / "a.mat"
    kinds = {"c": "cell", "o": "datetime", "s/text": "char", "e": "double"}
    h5py = of_matlab(source, {name: np.zeros(3, dtype=np.uint16) for name in kinds} | {"s/x": np.arange(4.0)}, kinds)
    with h5py.File(source, "r+") as file:
        file["e"].attrs["MATLAB_empty"] = np.uint8(1)
        file.create_group("sparse").attrs["MATLAB_sparse"] = np.uint64(3)
        file["sparse/data"] = np.zeros(3)
    found, _ = opened(source)
    assert {channel.name for channel in found.channels} == {*kinds, "s/x", "sparse"}
    for name, reason in {"c": "a cell array", "o": "datetime", "s/text": "text", "sparse": "sparse"}.items():
        with pytest.raises(RecordingError, match=reason):
            whole_channels(found, [name])
    assert whole_channels(found, ["s/x"])["s/x"].tolist() == [0.0, 1.0, 2.0, 3.0]


def test_channels_of_different_lengths_interleaved_ones_and_unknown_ones_are_refused(tmp_path: Path) -> None:
    made(tmp_path / "a.h5", {"g/x": np.zeros(3), "g/y": np.zeros(4)})
    found, _ = opened(tmp_path / "a.h5")
    for wanted, reason in (
        ([Wanted("g/x"), Wanted("g/y")], "g/x: 3, g/y: 4"),
        ([Wanted("g/x", 2, 1)], "columns = 2"),
        ([Wanted("g/z")], "Did you mean 'g/"),
    ):
        with pytest.raises(RecordingError, match=reason):
            list(found.blocks(wanted))


# --- damage --------------------------------------------------------------------------------------------


def test_what_was_announced_and_never_written_is_a_gap_that_is_told(tmp_path: Path) -> None:
    source = tmp_path / "E1.h5"
    table = written.raw()
    h5py = made(source, {f"DAQ/{name}": values for name, values in table.items() if name != "angle_ring"})
    with h5py.File(source, "r+") as file:
        ring = file.create_dataset("DAQ/angle_ring", (2500,), "i8", chunks=(500,))
        ring[:1000] = table["angle_ring"][:1000]
        file.create_dataset("never", (2500,), "f8")
        columns = file.create_dataset("columns", (2500, 4), "f8", chunks=(1000, 2))
        columns[:1000] = 1.0
        columns[2000:, 2:] = 1.0
    text = written.map_text(
        "".join(written.channel(t, f"DAQ/{n}", unit=written.UNITS[n]) for n, t in written.TOPICS.items())
    )
    done, found = brought(tmp_path, source, text)
    (cut,) = (finding for finding in done.findings if finding.code == Code.TRUNCATED)
    assert cut.where == "DAQ/angle_ring, from sample 1001"
    assert "1500 values were never written" in cut.message
    assert (done.written["/daq/torque_sun/frequency"], done.written["/daq/encoder_ring/count"]) == (2500, 1000)
    assert not np.isfinite(found.samples["angle_ring"].to_numpy()[1000:]).any()
    other, findings = opened(source)
    known = whole_channels(other, ["never", "columns(:,1)", "columns(:,3)"])
    assert [int(np.isfinite(values).sum()) for values in known.values()] == [0, 1000, 1500]
    assert len(findings.listed()) == 3


def test_a_size_that_no_file_of_its_length_holds_is_damage(tmp_path: Path) -> None:
    h5py = made(tmp_path / "a.h5", {})
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file.create_dataset("x", (10**12,), "f8", chunks=(1000,))[:10] = 1.0
    with pytest.raises(RecordingError, match="1000000000000 values announced in a file of"):
        next(opened(tmp_path / "a.h5")[0].blocks([Wanted("x")]))


@pytest.mark.parametrize("kind", ["h5", "mat"])
@pytest.mark.parametrize("data", [b"", b"nonsense" * 50, HEAD.ljust(600)])
def test_a_file_that_is_no_hdf5_is_one_error(tmp_path: Path, kind: str, data: bytes) -> None:
    pytest.importorskip("h5py")
    source = tmp_path / f"a.{kind}"
    source.write_bytes(data)
    with pytest.raises(RecordingError) as caught:
        brought(tmp_path, source, written.map_text(written.PLAIN))
    assert caught.value.where == str(source)
    assert caught.value.do == "Copy it again from the recorder."


@pytest.mark.parametrize("oldest", [pytest.param("earliest", marks=slow), "latest"])
def test_damage_to_hdf5_gives_an_error_of_ours_or_a_recording(
    tmp_path: Path, rng: np.random.Generator, oldest: str
) -> None:
    h5py = pytest.importorskip("h5py")
    source = tmp_path / "a.h5"
    with h5py.File(source, "w", libver=oldest) as file:
        for name, values in written.raw().items():
            dataset = file.create_dataset(f"DAQ/{name}", data=values[:200], chunks=(64,), fletcher32=True)
            dataset.attrs["unit"] = written.UNITS[name]
    chart = read_map(written.write_map(tmp_path, written.map_text(UNDER_DAQ)))
    whole = source.read_bytes()
    assert import_recording(source, chart, tmp_path / "whole.mcap").rows == 200
    told = 0
    tries = 25 if SLOW else 10
    for _ in range(tries):
        data = bytearray(whole)
        at = int(rng.integers(0, len(data)))
        if rng.random() < 0.3:
            del data[at:]
        else:
            data[at : at + 4] = rng.bytes(4)
        source.write_bytes(data)
        try:
            import_recording(source, chart, tmp_path / "b.mcap")
        except PmgError:
            told += 1
    assert told > tries / 5


def test_a_damaged_member_leaves_the_others_readable(tmp_path: Path) -> None:
    source = tmp_path / "a.h5"
    made(source, {"x": np.arange(3.0), "y": np.full(3, 7.0)})
    whole = source.read_bytes()
    told = 0
    for at in range(len(whole) - 8):
        if whole[at] != 1 or told > 3:
            continue
        source.write_bytes(whole[:at] + b"\xee" + whole[at + 1 :])
        try:
            found, _ = opened(source)
            kept = whole_channels(found, ["x"])["x"].tolist()
        except RecordingError:
            continue
        unread = [channel for channel in found.channels if channel.length is None]
        told += kept == [0.0, 1.0, 2.0] and [channel.name for channel in unread] == ["y"]
    assert told


# --- without the library -------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "data"), [("a.h5", b"x"), ("a.hdf5", b"x"), ("a.mat", HEAD.ljust(512))])
def test_without_h5py_the_extra_that_brings_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, data: bytes
) -> None:
    monkeypatch.setattr("pmg.pipeline.importers.source.find_spec", lambda _: None)
    source = tmp_path / name
    source.write_bytes(data)
    with pytest.raises(RecordingError) as caught:
        brought(tmp_path, source, written.map_text(written.PLAIN))
    assert "'h5py', is not installed" in caught.value.came
    assert "pmg-bench[hdf5]" in caught.value.do
    assert "BSD-3-Clause" in caught.value.do


def test_hdf5_is_known_by_its_first_bytes_behind_any_block_of_the_user(tmp_path: Path) -> None:
    path = tmp_path / "a"
    for before in (0, 512, 1 << 16):
        path.write_bytes(bytes(before) + b"\x89HDF\r\n\x1a\n")
        assert is_hdf5(path)
    for data in (b"", bytes(600), bytes(511) + b"\x89HDF\r\n\x1a\n", b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"):
        path.write_bytes(data)
        assert not is_hdf5(path)
