"""What is written comes back through the reader, is marked as simulated, and carries a schema that others can read."""

from __future__ import annotations

import struct
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from pmg.pipeline.recording.calibration import Calibration
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.layouts import wire
from pmg.pipeline.recording.layouts.repack import BLOCK_SAMPLES
from pmg.pipeline.recording.layouts.schema import CLOCK_MARK, SAMPLE_BLOCK, descriptor_set, encode
from pmg.pipeline.recording.read import Recording, read_recording
from pmg.pipeline.recording.write import SimulatedRun, rated_calibration, recording_bytes
from pmg.pipeline.windows.windows import find_windows
from pmg.sim.bench import BenchParameters, load_bench
from pmg.sim.errors import RecordingError
from pmg.sim.grid import Configuration
from pmg.sim.shafts import SIDES
from pmg.sim.signals import REVOLUTION, RPM

from . import writer

Array = npt.NDArray[np.float64]
RATE = 500.0
ONE_COUNT = REVOLUTION / 5120
START = datetime(2026, 3, 4, 9, 30, 0, 250_001, tzinfo=UTC)


def simulated(samples: int = 2500, **changes: object) -> SimulatedRun:
    t = np.arange(samples) / RATE
    run = SimulatedRun(
        campaign="made",
        point="E1",
        configuration=Configuration.ENGAGED,
        gear=2,
        started_at=START,
        drive="ring",
        rate=RATE,
        torque_sun=-2.0 + 0.3 * np.sin(7.0 * t),
        torque_ring=-5.2 + 0.2 * np.cos(3.0 * t),
        angle_sun=0.4 + 600.0 * RPM * t,
        angle_ring=5.0 - 230.0 * RPM * t,
        setpoints={"ring_speed_set_rpm": -230.0, "sun_speed_set_rpm": 600.0},
    )
    return replace(run, **changes)  # type: ignore[arg-type]


@pytest.fixture
def rated(bench: BenchParameters) -> Calibration:
    return rated_calibration(bench)


def read_back(folder: Path, data: bytes) -> Recording:
    path = folder / "a.mcap"
    path.write_bytes(data)
    return read_recording(path)


# --- there and back ------------------------------------------------------------------------------------


@pytest.mark.parametrize("samples", [1, BLOCK_SAMPLES - 1, BLOCK_SAMPLES, BLOCK_SAMPLES + 1, 2500])
def test_torque_and_angle_come_back(tmp_path: Path, rated: Calibration, samples: int) -> None:
    run = simulated(samples)
    found = read_back(tmp_path, recording_bytes(run, rated))
    assert (found.rate_hz, found.first_sample, found.samples.height) == (RATE, 0, samples)
    for side in SIDES:
        torque, angle = (getattr(run, f"{quantity}_{side}") for quantity in ("torque", "angle"))
        np.testing.assert_allclose(found.samples[f"torque_{side}"].to_numpy(), torque, rtol=0.0, atol=1e-9)
        slip = angle - found.samples[f"angle_{side}"].to_numpy()
        wraps = slip[0] // (2**32 * ONE_COUNT)
        slip -= wraps * 2**32 * ONE_COUNT
        assert slip.min() > -1e-6 * ONE_COUNT
        assert slip.max() < (1 + 1e-6) * ONE_COUNT


def test_what_the_run_says_of_itself_comes_back(tmp_path: Path, rated: Calibration) -> None:
    found = read_back(tmp_path, recording_bytes(simulated(note='by "hand"'), rated))
    assert (found.run.campaign, found.run.point, found.run.note) == ("made", "E1", 'by "hand"')
    assert (found.run.configuration, found.run.gear, found.run.drive) == (Configuration.ENGAGED, 2, "ring")
    assert found.run.started_at == START
    assert found.run.setpoints.speed_sun == 600.0 * RPM
    assert found.run.setpoints.speed_ring == -230.0 * RPM
    assert found.run.setpoints.torque_ring is None
    assert found.calibration == rated


def test_the_rated_calibration_is_that_of_the_bench(bench: BenchParameters, rated: Calibration) -> None:
    assert (rated.sun.nominal_torque, rated.ring.nominal_torque) == (5.0, 10.0)
    assert rated.sun.nominal_torque == bench.transducer_sun.nominal_torque
    for side in SIDES:
        transducer = rated[side]
        at = transducer.frequency(np.array([-1.0, 0.0, 1.0]) * transducer.nominal_torque)
        np.testing.assert_array_equal(at, [5_000.0, 10_000.0, 15_000.0])
        assert rated.counts_per_rev[side] == 5120


def test_another_calibration_travels_with_the_recording(tmp_path: Path, rated: Calibration) -> None:
    odd = replace(
        rated,
        ring=replace(rated.ring, null_frequency_hz=9_996.9, span_hz=-4_900.0, serial='"\\ §\n'),
        counts_per_rev_sun=4096,
    )
    run = simulated()
    found = read_back(tmp_path, recording_bytes(run, odd))
    assert found.calibration == odd
    np.testing.assert_allclose(found.samples["torque_ring"].to_numpy(), run.torque_ring, rtol=0.0, atol=1e-9)
    assert np.abs(found.samples["angle_sun"].to_numpy() - run.angle_sun).max() <= 1.001 * REVOLUTION / 4096


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_counter_that_wraps_gives_the_same_turns(tmp_path: Path, rated: Calibration, direction: float) -> None:
    """The run starts half a turn before the counter's wrap and passes it."""
    turns = np.linspace(-0.5, 1.5, 2500) * REVOLUTION
    angle = direction * (2**32 * ONE_COUNT + turns) + (0.0 if direction > 0 else 2**33 * ONE_COUNT)
    found = read_back(tmp_path, recording_bytes(simulated(angle_sun=angle), rated))
    raw = counts(recording_bytes(simulated(angle_sun=angle), rated), "/daq/encoder_sun/count")
    assert raw.min() < 5120
    assert raw.max() > 2**32 - 5120
    moved = found.samples["angle_sun"].to_numpy()
    np.testing.assert_allclose(moved - moved[0], direction * (turns - turns[0]), rtol=0.0, atol=1.01 * ONE_COUNT)


def test_an_angle_below_zero_wraps_from_above(rated: Calibration) -> None:
    raw = counts(
        recording_bytes(simulated(angle_ring=np.full(2500, -0.5 * ONE_COUNT)), rated), "/daq/encoder_ring/count"
    )
    assert set(raw.tolist()) == {2**32 - 1}


@settings(deadline=None)
@given(torque=st.floats(-5.0, 5.0), turns=st.floats(-1e4, 1e4))
def test_any_torque_and_angle_in_range_survive(torque: float, turns: float) -> None:
    run = simulated(3, torque_sun=np.full(3, torque), torque_ring=np.zeros(3), angle_ring=np.zeros(3))
    run = replace(run, angle_sun=np.full(3, turns * REVOLUTION))
    calibration = rated_calibration(load_bench())
    data = recording_bytes(run, calibration)
    frequency = samples_of(data, "/daq/torque_sun/frequency")
    np.testing.assert_allclose(calibration.sun.torque(frequency), torque, rtol=0.0, atol=1e-9)
    count = int(counts(data, "/daq/encoder_sun/count")[0])
    whole = count - 2**32 if count >= 2**31 else count
    assert abs(turns * 5120 - whole) <= 1.0 + 1e-6


# --- the file ------------------------------------------------------------------------------------------


def test_every_channel_is_found_to_be_simulated_and_nothing_else_is_found(tmp_path: Path, rated: Calibration) -> None:
    found = read_back(tmp_path, recording_bytes(simulated(), rated)).findings
    assert {finding.code for finding in found} == {Code.SIMULATED}
    topics = {f"/daq/{name}" for side in SIDES for name in (f"torque_{side}/frequency", f"encoder_{side}/count")}
    assert {finding.where for finding in found} == topics


def test_every_block_is_marked_and_holds_at_most_a_thousand_samples(rated: Calibration) -> None:
    for topic in ("/daq/torque_ring/frequency", "/daq/encoder_sun/count"):
        blocks = [wire.sample_block(data) for data in messages(recording_bytes(simulated(), rated), topic)]
        assert [(b.first_sample, len(b.values)) for b in blocks] == [(0, 1000), (1000, 1000), (2000, 500)]
        assert {(b.flags, b.clock_id) for b in blocks} == {(8, 0)}


def test_the_whole_file_is_one_window_that_passes_the_checks(tmp_path: Path, rated: Calibration) -> None:
    (window,) = find_windows(read_back(tmp_path, recording_bytes(simulated(), rated)))
    assert (window.point, window.first_sample, window.stop_sample) == ("E1", 0, 2500)
    assert (window.accepted, window.reasons, window.started_at) == (True, (), START)


def test_the_clock_is_marked_at_the_first_sample(tmp_path: Path, rated: Calibration) -> None:
    found = read_back(tmp_path, recording_bytes(simulated(), rated))
    (mark,) = found.clock_marks
    assert (mark.clock_id, mark.sample, mark.source) == (0, 0, "simulated")
    assert mark.utc_ns == 1_772_616_600_250_001_000
    assert found.time_of(1250) == START + timedelta(seconds=2.5)


def test_a_start_in_another_zone_is_the_same_run(rated: Calibration) -> None:
    east = START.astimezone(timezone(timedelta(hours=2)))
    assert recording_bytes(simulated(started_at=east), rated) == recording_bytes(simulated(), rated)


def test_the_same_run_gives_the_same_bytes(rated: Calibration) -> None:
    turned = {"sun_speed_set_rpm": 600, "ring_speed_set_rpm": -230}
    assert recording_bytes(simulated(), rated) == recording_bytes(simulated(setpoints=turned), rated)


def test_a_general_reader_opens_it_and_finds_its_sums_right(rated: Calibration) -> None:
    reader = make_reader(BytesIO(recording_bytes(simulated(), rated)), validate_crcs=True)
    header = reader.get_header()
    assert header.profile == "pmg"
    assert header.library.startswith("pmg ")
    assert "/" not in header.library
    listed = [(channel.topic, message.log_time) for _, channel, message in reader.iter_messages()]
    assert len(listed) == 1 + 4 * 3
    assert {time for _, time in listed} == {1_772_616_600_250_001_000 + s * 10**9 for s in (0, 2, 4, 5)}
    summary = reader.get_summary()
    assert summary is not None
    assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
    assert {schema.encoding for schema in summary.schemas.values()} == {"protobuf"}
    assert {schema.data for schema in summary.schemas.values()} == {descriptor_set()}


def test_one_damaged_byte_in_the_data_is_seen(tmp_path: Path, rated: Calibration) -> None:
    data = bytearray(recording_bytes(simulated(), rated))
    data[data.index(b"zstd") + 200] ^= 1
    path = tmp_path / "a.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError):
        read_recording(path)


# --- what is refused -----------------------------------------------------------------------------------


def spoilt(value: float, at: int = 1234, length: int = 2500) -> Array:
    row = np.zeros(length)
    row[at] = value
    return row


REFUSED: tuple[tuple[dict[str, Any], tuple[str, ...]], ...] = (
    ({"torque_sun": spoilt(5.001)}, ("torque_sun, sample 1234", "5.001 N m", "-5 to 5 N m")),
    ({"torque_ring": spoilt(-10.5)}, ("torque_ring, sample 1234", "-10.5 N m", "-10 to 10 N m")),
    ({"torque_sun": spoilt(np.nan)}, ("torque_sun, sample 1234", "nan N m", "-5 to 5 N m")),
    ({"torque_ring": spoilt(np.inf)}, ("torque_ring, sample 1234", "inf N m")),
    ({"angle_sun": spoilt(np.nan, at=0)}, ("angle_sun, sample 0", "nan rad")),
    ({"angle_ring": spoilt(1e300)}, ("angle_ring, sample 1234", "1e+300 rad")),
    ({"angle_ring": spoilt(2**31 * ONE_COUNT * 1.01)}, ("angle_ring, sample 1234", "counts in one step")),
    ({"angle_ring": np.zeros(2499)}, ("(2500,)", "(2499,)", "one length")),
    ({"torque_sun": np.zeros((2500, 1))}, ("(2500, 1)", "one length")),
    ({name: np.zeros(0) for name in ("torque_sun", "torque_ring", "angle_sun", "angle_ring")}, ("(0,)",)),
    ({"rate": 0.0}, ("rate", "0.0 1/s", "positive")),
    ({"rate": np.nan}, ("rate", "nan 1/s")),
    ({"rate": 1e9}, ("rate", "at most 1e+08")),
    ({"rate": 1e-9}, ("started_at", "2262")),
    ({"started_at": datetime(2026, 3, 4)}, ("started_at", "UTC")),
    ({"started_at": datetime(1969, 3, 4, tzinfo=UTC)}, ("started_at", "1970")),
    ({"started_at": datetime(2300, 3, 4, tzinfo=UTC)}, ("started_at", "2261")),
    ({"gear": 3}, ("gear", "'3'", "'1' or '2'")),
    ({"drive": "rings"}, ("drive", "Did you mean 'ring'?")),
    ({"configuration": "engagd"}, ("configuration", "Did you mean 'engaged'?")),
    ({"point": ""}, ("a name is empty",)),
    ({"setpoints": {"sun_speed_rpm": 1.0}}, ("sun_speed_rpm", "Did you mean 'sun_speed_set_rpm'?")),
    ({"setpoints": {"ring_torque_set_Nm": np.nan}}, ("ring_torque_set_Nm = nan", "finite")),
)


@pytest.mark.parametrize(("changes", "words"), REFUSED)
def test_what_does_not_fit_into_a_recording_is_refused(
    rated: Calibration, changes: dict[str, Any], words: tuple[str, ...]
) -> None:
    with pytest.raises(RecordingError) as caught:
        recording_bytes(simulated(**changes), rated)
    error = caught.value
    assert all(part for part in (error.where, error.came, error.expected, error.do))
    assert error.where.startswith("run '")
    assert all(word in str(error) for word in words), str(error)


@pytest.mark.parametrize(
    ("change", "word"), [({"nominal_torque": -5.0}, "nominal torque"), ({"span_hz": np.nan}, "span_Hz")]
)
def test_a_calibration_that_the_reader_would_refuse_is_not_written(
    rated: Calibration, change: dict[str, Any], word: str
) -> None:
    with pytest.raises(RecordingError, match=word):
        recording_bytes(simulated(), replace(rated, sun=replace(rated.sun, **change)))


def test_the_nominal_torque_itself_is_within_the_range(tmp_path: Path, rated: Calibration) -> None:
    found = read_back(tmp_path, recording_bytes(simulated(torque_sun=spoilt(5.0), torque_ring=spoilt(-10.0)), rated))
    assert found.samples["torque_sun"].max() == 5.0
    assert found.samples["torque_ring"].min() == -10.0


# --- the schema ----------------------------------------------------------------------------------------

LAYOUT: dict[str, dict[str, tuple[int, int, int, str]]] = {
    "google.protobuf.Timestamp": {"seconds": (1, 3, 1, ""), "nanos": (2, 5, 1, "")},
    "pmg.v1.SampleBlock": {
        "timestamp": (1, 11, 1, ".google.protobuf.Timestamp"),
        "first_sample": (2, 6, 1, ""),
        "clock_id": (3, 13, 1, ""),
        "flags": (4, 13, 1, ""),
        "f64": (10, 1, 3, ""),
        "f32": (11, 2, 3, ""),
        "i32": (12, 15, 3, ""),
        "u32": (13, 7, 3, ""),
        "u64": (14, 6, 3, ""),
    },
    "pmg.v1.ClockMark": {
        "clock_id": (1, 13, 1, ""),
        "sample": (2, 6, 1, ""),
        "utc_ns": (3, 6, 1, ""),
        "u_ns": (4, 1, 1, ""),
        "source": (5, 9, 1, ""),
    },
}
"""Copied by hand from the .proto: number, type (descriptor.proto, enum Type), label (1 single, 3 repeated), message."""


def parts(data: bytes) -> dict[int, list[Any]]:
    """Fields of a message, by number."""
    found: dict[int, list[Any]] = {}
    for number, _, value in wire.fields(data):
        found.setdefault(number, []).append(value)
    return found


def test_the_embedded_schema_is_that_of_the_layout() -> None:
    files = [parts(data) for data in parts(descriptor_set())[1]]
    assert [file[1][0].decode() for file in files] == ["google/protobuf/timestamp.proto", "pmg_recording.proto"]
    assert [file.get(3, []) for file in files] == [[], [b"google/protobuf/timestamp.proto"]]
    assert [file[12] for file in files] == [[b"proto3"], [b"proto3"]]
    found: dict[str, dict[str, tuple[int, int, int, str]]] = {}
    for file in files:
        for message in map(parts, file[4]):
            fields = [parts(field) for field in message[2]]
            found[f"{file[2][0].decode()}.{message[1][0].decode()}"] = {
                f[1][0].decode(): (f[3][0], f[5][0], f[4][0], f.get(6, [b""])[0].decode()) for f in fields
            }
    assert found == LAYOUT


def test_the_reader_takes_samples_from_the_fields_that_the_schema_names() -> None:
    named = {field.number: field.name for field in SAMPLE_BLOCK.fields if field.repeated}
    assert named == {number: name for number, (name, _, _) in wire.SAMPLE_FIELDS.items()}


@pytest.mark.parametrize("dtype", ["f64", "f32", "i32", "u32", "u64"])
def test_a_block_is_encoded_as_an_independent_writer_encodes_it(dtype: str) -> None:
    values = np.array([0, 1, 2**31 - 1])
    message = {"timestamp": {"seconds": 1_745_000_000}, "first_sample": 2**40 + 3, "clock_id": 300, "flags": 5}
    assert encode(SAMPLE_BLOCK, {dtype: values} | message) == writer.block(2**40 + 3, dtype, values, flags=5, clock=300)


def test_a_clock_mark_comes_back_and_its_zeros_are_left_out() -> None:
    values = {"clock_id": 2, "sample": 2**63, "utc_ns": 2**64 - 1, "u_ns": -0.5, "source": "gps §"}
    mark = wire.clock_mark(encode(CLOCK_MARK, values))
    assert mark == wire.ClockMark(**values)  # type: ignore[arg-type]
    assert encode(CLOCK_MARK, {"sample": 0, "source": "", "utc_ns": 7}) == b"\x19" + struct.pack("<Q", 7)


def test_a_field_that_the_message_lacks_is_not_dropped_silently() -> None:
    with pytest.raises(KeyError, match="utc"):
        encode(CLOCK_MARK, {"utc": 7})


# --- reading without pmg's own reader ------------------------------------------------------------------


def messages(data: bytes, topic: str) -> list[bytes]:
    return [message.data for _, _, message in make_reader(BytesIO(data)).iter_messages(topics=[topic])]


def samples_of(data: bytes, topic: str) -> npt.NDArray[Any]:
    return np.concatenate([wire.sample_block(message).values for message in messages(data, topic)])


def counts(data: bytes, topic: str) -> npt.NDArray[np.int64]:
    return samples_of(data, topic).astype(np.int64)
