"""Derived signals are right, are read by the official reader, and follow the schema that travels with them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from pmg.pipeline.importers.derived import FLAGS, derive
from pmg.pipeline.importers.export import PREFIX, PREVIEW_TOPIC, _preview_schema, export_recording
from pmg.pipeline.recording.findings import Code
from pmg.pipeline.recording.join import Blemish
from pmg.pipeline.recording.layouts.schema import SAMPLE_BLOCK
from pmg.pipeline.recording.layouts.wire import LineEvent
from pmg.pipeline.recording.read import Recording, read_recording
from pmg.pipeline.recording.write import recording_bytes
from pmg.pipeline.windows.limits import LIMITS
from pmg.sim.errors import RecordingError
from pmg.sim.signals import LOSS_TOTAL, POWER_RING, POWER_SUN, RPM, SPEED_RING, SPEED_SUN, TORQUE_RING, TORQUE_SUN

from . import written

SIDES = ((TORQUE_SUN, SPEED_SUN, POWER_SUN, 600.0, "sun"), (TORQUE_RING, SPEED_RING, POWER_RING, -230.0, "ring"))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "E1.mcap"
    path.write_bytes(written.original())
    return path


@pytest.fixture(scope="module")
def decoded(recording: Path) -> Recording:
    return read_recording(recording)


# --- the signals ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [None, 250.0, 50.0, 37.0, 1.0])
def test_torques_are_means_and_speeds_go_from_end_to_end(decoded: Recording, rate: float | None) -> None:
    found = derive(decoded, rate)
    shown = 500.0 if rate is None else rate
    assert len(found.flags) == int(5.0 * shown + 1e-9)
    for torque, speed, power, rpm, side in SIDES:
        whole = decoded.samples[f"torque_{side}"].to_numpy()
        values = found.values[torque]
        assert values.mean() == pytest.approx(whole[: round(len(values) / shown * 500)].mean(), abs=2e-3)
        counts = 5120 if side == "sun" else 4096
        assert np.abs(found.values[speed] / RPM - rpm).max() <= 60.0 / counts / found.span_s * 1.01
        np.testing.assert_allclose(found.values[power], values * found.values[speed])
    np.testing.assert_allclose(found.values[LOSS_TOTAL], found.values[POWER_SUN] + found.values[POWER_RING])


@given(rate=st.floats(0.5, 500.0))
def test_each_stretch_holds_its_own_samples(decoded: Recording, rate: float) -> None:
    found = derive(decoded, rate)
    whole, ratio = decoded.samples["torque_sun"].to_numpy(), 500.0 / rate
    for k in (0, len(found.flags) // 2, len(found.flags) - 1):
        first, stop = (int(np.ceil((k + d) * ratio - 1e-6)) for d in (0, 1))
        assert found.values[TORQUE_SUN][k] == pytest.approx(whole[first : min(stop, len(whole))].mean(), rel=1e-9)


@pytest.mark.parametrize("rate", [0.0, -1.0, 501.0, np.nan, 0.1])
def test_a_rate_that_cannot_be_is_refused(decoded: Recording, rate: float) -> None:
    with pytest.raises(RecordingError):
        derive(decoded, rate)


def test_what_is_missing_stays_missing_and_is_flagged(decoded: Recording) -> None:
    column = decoded.samples["torque_sun"].to_numpy().copy()
    column[100:120] = np.nan
    holed = replace(decoded, samples=decoded.samples.with_columns(torque_sun=column))
    found = derive(holed, 50.0)
    missing = (found.flags >> list(FLAGS).index("missing")) & 1
    assert np.flatnonzero(missing).tolist() == [10, 11]
    for signal in (TORQUE_SUN, POWER_SUN, LOSS_TOTAL):
        assert np.flatnonzero(~np.isfinite(found.values[signal])).tolist() == [10, 11]
    assert np.isfinite(found.values[TORQUE_RING]).all()


SPOILT = {
    Code.OVERRUN: "overrun",
    Code.RESTART: "overrun",
    Code.SATURATED: "saturated",
    Code.ENCODER_SLIPPED: "slipped",
    Code.STUCK: "stuck",
    Code.SHUNT: "shunt",
}


@pytest.mark.parametrize("code", SPOILT)
def test_each_fault_has_its_own_flag(decoded: Recording, code: Code) -> None:
    """A stretch that hangs is not told as samples that the recorder lost."""
    spoilt = replace(decoded, blemishes=(Blemish("/daq/torque_sun/frequency", code, 1000, 1100),))
    found = derive(spoilt, 50.0)
    named = {name: np.flatnonzero((found.flags >> bit) & 1).tolist() for bit, name in enumerate(FLAGS)}
    faults = {name: at for name, at in named.items() if at and not name.startswith("window")}
    assert faults == {SPOILT[code]: list(range(100, 110))}


def test_windows_are_judged_by_the_given_limits(decoded: Recording) -> None:
    strict = derive(decoded, 50.0, replace(LIMITS, shortest=60.0))
    named = {name: int(((strict.flags >> bit) & 1).sum()) for bit, name in enumerate(FLAGS)}
    assert (named["window_accepted"], named["window_rejected"]) == (0, 250)


def test_the_emergency_stop_and_the_window_are_flagged(decoded: Recording) -> None:
    lines = np.zeros(2500, dtype=np.uint32)
    lines[1003] = 3
    found = derive(replace(decoded, samples=decoded.samples.with_columns(lines=lines)), 50.0)
    named = {name: np.flatnonzero((found.flags >> bit) & 1).tolist() for bit, name in enumerate(FLAGS)}
    assert named["emergency_stop"] == [100]
    assert (named["window_accepted"], named["window_rejected"]) == ([], list(range(250)))
    assert found.points == (("E1", 0, 250),)


def test_events_of_the_emergency_stop_count_where_the_lines_are_not_sampled(decoded: Recording) -> None:
    events = (LineEvent(500, 1, 1), LineEvent(1000, 0, 1), LineEvent(2400, 2, 2))
    found = derive(replace(decoded, line_events=events), 50.0)
    assert np.flatnonzero(found.flags & 1).tolist() == list(range(50, 100))
    before = derive(replace(decoded, line_events=events[1:]), 50.0)
    assert np.flatnonzero(before.flags & 1).tolist() == list(range(100))


# --- the file ------------------------------------------------------------------------------------------


def messages(path: Path) -> tuple[dict[str, list[Any]], Any]:
    by_topic: dict[str, list[Any]] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        times = []
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert schema is not None
            by_topic.setdefault(channel.topic, []).append((schema, channel, message))
            times.append(message.log_time)
        return by_topic, (reader.get_summary(), times, {r.name: r.metadata for r in reader.iter_metadata()})


def test_the_official_reader_finds_a_preview_that_follows_its_schema(tmp_path: Path, recording: Path) -> None:
    out = tmp_path / "x" / "E1-derived.mcap"
    done = export_recording(recording, out)
    found, (summary, _, metadata) = messages(out)
    previews = found[PREVIEW_TOPIC]
    schema, channel, _ = previews[0]
    assert (schema.encoding, channel.message_encoding, len(previews), done.previews) == ("jsonschema", "json", 250, 250)
    declared = json.loads(schema.data)
    assert declared == _preview_schema()
    jsonschema.Draft202012Validator.check_schema(declared)
    checker = jsonschema.Draft202012Validator(declared)
    start = round(written.START.timestamp() * 1e6) * 1000
    for number, (_, _, message) in enumerate(previews):
        told = json.loads(message.data)
        checker.validate(told)
        assert message.log_time == start + round((number + 0.5) * 20e6)
        assert told["speed_sun_rpm"] == pytest.approx(600.0, abs=0.6)
        assert (told["window_accepted"], told["emergency_stop"], told["point"]) == (1, 0, "E1")
    assert np.mean([json.loads(m.data)["torque_sun_Nm"] for _, _, m in previews]) == pytest.approx(
        written.run().torque_sun.mean(), abs=1e-9
    )
    assert summary.statistics.message_count == sum(map(len, found.values()))
    assert metadata["pmg.derived"]["source_sha256"] == read_recording(recording).sha256


def test_blocks_hold_the_signals_in_the_units_of_their_names(tmp_path: Path, recording: Path) -> None:
    from pmg.pipeline.recording.layouts.wire import sample_block

    out = tmp_path / "a.mcap"
    export_recording(recording, out, 100.0)
    found, _ = messages(out)
    assert {topic.removeprefix(PREFIX) for topic in found} == {
        PREVIEW_TOPIC,
        "flags",
        "torque_sun_Nm",
        "torque_ring_Nm",
        "speed_sun_rpm",
        "speed_ring_rpm",
        "power_sun_W",
        "power_ring_W",
        "loss_total_W",
    }
    blocks = found[f"{PREFIX}torque_sun_Nm"]
    assert blocks[0][0].name == SAMPLE_BLOCK.full_name
    values = np.concatenate([sample_block(message.data).values for _, _, message in blocks])
    expected = written.run().torque_sun.reshape(500, 5).mean(axis=1)
    np.testing.assert_allclose(values, expected, atol=1e-9)
    assert blocks[0][1].metadata["unit"] == "N m"


def test_the_same_recording_gives_the_same_bytes_and_is_never_written_over(tmp_path: Path, recording: Path) -> None:
    for name in "ab":
        export_recording(recording, tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    before = recording.read_bytes()
    with pytest.raises(RecordingError, match="the recording itself"):
        export_recording(recording, recording)
    assert recording.read_bytes() == before


def test_a_value_that_is_not_known_is_left_out_of_its_message(tmp_path: Path) -> None:
    from pmg.pipeline.importers.channel_map import read_map
    from pmg.pipeline.importers.import_recording import import_recording

    lines = written.csv_text(1000).splitlines()
    for row in range(103, 163):
        lines[row] = ";".join(["", *lines[row].split(";")[1:]])
    source = tmp_path / "E1.csv"
    source.write_text("\n".join(lines) + "\n", encoding="utf-8")
    chart = read_map(written.write_map(tmp_path, written.map_text(written.PLAIN)))
    done = import_recording(source, chart, tmp_path / "E1.mcap")
    assert [finding.lost for finding in done.findings] == ["60 samples of /daq/torque_sun/frequency"]
    export_recording(done.out, tmp_path / "out.mcap")
    found, _ = messages(tmp_path / "out.mcap")
    told = [json.loads(message.data) for _, _, message in found[PREVIEW_TOPIC]]
    without = [number for number, message in enumerate(told) if "torque_sun_Nm" not in message]
    assert without == list(range(10, 16))
    assert all(message["missing"] == (number in without) for number, message in enumerate(told))
    assert all("torque_ring_Nm" in message for message in told)


def test_a_simulated_recording_still_decodes(decoded: Recording) -> None:
    assert recording_bytes(written.run(), written.CALIBRATION) == written.original()
    assert decoded.samples.height == 2500
