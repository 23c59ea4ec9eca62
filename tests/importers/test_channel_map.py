"""A fault in the map is reported with its place, what came, what was expected and what to do."""

from __future__ import annotations

from pathlib import Path

import pytest

from pmg.pipeline.importers.channel_map import Lookup, read_map
from pmg.pipeline.importers.import_recording import import_recording
from pmg.pipeline.importers.source import Wanted
from pmg.pipeline.recording.codes import Code
from pmg.pipeline.recording.read import read_recording
from pmg.sim.errors import BenchError, PmgError

from . import written

FREQUENCY = "/daq/torque_sun/frequency"


def fault_of(folder: Path, text: str) -> BenchError:
    with pytest.raises(BenchError) as caught:
        read_map(written.write_map(folder, text))
    return caught.value


def test_a_map_says_what_it_says(tmp_path: Path) -> None:
    text = written.map_text(
        written.channel(FREQUENCY, "AI/all", unit="kHz", columns=4, column=2),
        'ticks = "timer"\nbits = 32\nfrequency_Hz = 40e6',
        '[csv]\ndecimal = ","\nbad_rows = 3',
        run=written.RUN.replace('point = "E1"', 'point = { file = "stem" }'),
    )
    found = read_map(written.write_map(tmp_path, text)).table
    assert found.channel[0].wanted == Wanted("AI/all", 4, 2)
    timing = found.time.timing
    assert (timing.column, timing.bits, timing.scale) == (
        Wanted("timer"),
        32,
        1 / 40e6,
    )
    assert (found.csv.decimal, found.csv.bad_rows, found.csv.delimiter) == (",", 3, "auto")
    assert found.run["point"] == Lookup("file", "stem")
    assert found.run["started_at"] == "2026-03-04T09:30:00.250000+00:00"


@pytest.mark.parametrize(
    ("old", "new", "where", "hint"),
    [
        ("schema", "shcema", "map.toml: line 1, shcema", "Did you mean 'schema'?"),
        ("pmg.import/1", "pmg.import/2", "map.toml: line 1, schema", "pmg.import/1"),
        ("calibration =", "calibratoin =", "calibratoin", "Did you mean 'calibration'?"),
        ("campaign", "campain", "run.campain", "Did you mean 'campaign'?"),
        ("gear = 2", "gear = true", "run.gear", "Write it as text"),
        ('point = "E1"', 'point = { file = "stam" }', "run.point", "stem"),
        ("rate_Hz = 500", "rate_hz = 500", "time.rate_hz", "Did you mean 'rate_Hz'?"),
        ("rate_Hz = 500", "rate_Hz = -1", "time.rate_Hz", ""),
        ("rate_Hz = 500", 'source = "t"\nunit = "msec"', "time.unit", "ms"),
        ("rate_Hz = 500", 'source = "t"\nticks = "c"', "time", "Leave one of them out"),
        ("rate_Hz = 500", "rate_Hz = 500\ncolumn = 2", "time.column", "Add 'source' or 'ticks'"),
        ("rate_Hz = 500", "rate_Hz = 500\nbits = 32", "time.bits", "Add 'ticks'"),
        ("source", "timebase_Hz = 1e6\nsource", "channel[1].timebase_Hz", "edge_ticks"),
        ("rate_Hz = 500", 'ticks = "c"\nbits = 32', "time.frequency_Hz", ""),
        (FREQUENCY, "/daq/torque_sun/freqency", "channel[1].topic", f"Did you mean '{FREQUENCY}'?"),
        ("source", "sourze", "channel[1].sourze", "Did you mean 'source'?"),
        ("source", 'unit = "Hzz"\nsource', "channel[1].unit", "Did you mean 'Hz'?"),
        ("source", 'unit = "rpm"\nsource', "channel[1].unit", "Known: "),
        ("source", 'unit = "V"\nsource', "channel[1].Nm_per_unit", ""),
        ("source", "columns = 4\ncolumn = 5\nsource", "channel[1].column", ""),
        ("source", "sign = 0\nsource", "channel[1].sign", "-1"),
        ("source", "bitz = 4\nsource", "channel[1].bitz", "Did you mean 'bits'?"),
        ("[[channel]]", "[chanel]", "chanel", "Did you mean 'channel'?"),
    ],
)
def test_a_fault_is_told_with_its_place(tmp_path: Path, old: str, new: str, where: str, hint: str) -> None:
    text = written.map_text(written.channel(FREQUENCY, "AI"))
    assert old in text
    fault = fault_of(tmp_path, text.replace(old, new, 1))
    assert where in fault.where
    assert ": line " in fault.where
    assert hint in fault.do
    assert all((fault.where, fault.came, fault.expected, fault.do))


def test_what_is_no_toml_and_what_maps_nothing_or_twice_is_refused(tmp_path: Path) -> None:
    assert "line 1" in fault_of(tmp_path, "schema = ").where
    assert "no [[channel]]" in fault_of(tmp_path, written.map_text("")).came
    assert "twice" in fault_of(tmp_path, written.map_text(written.channel(FREQUENCY, "a") * 2)).came
    both = written.map_text(written.channel(FREQUENCY, "a"), extra="[csv]\ndelimiter = ','\ndecimal = ','")
    assert "both ','" in fault_of(tmp_path, both).came


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("gear = 2", "gear = 3", "gear"),
        ('configuration = "engaged"', 'configuration = "engadged"', "Did you mean 'engaged'?"),
        ("started_at = 2026-03-04T09:30:00.250Z", 'started_at = "yesterday"', "started_at"),
        ("started_at = 2026-03-04", "started_at = 2826-03-04", "started_at"),
        ("started_at = 2026-03-04T09:30:00.250Z", "", "started_at"),
        ('point = "E1"', 'point = { property = "bensh" }', "Did you mean 'bench'?"),
        ("calibration.toml", "calibrations.toml", "is no file"),
        ("source = 'torque_sun'", "source = 'torqe_sun'", "Did you mean 'torque_sun'?"),
        ("rate_Hz = 500", "", "rate_Hz"),
        ("rate_Hz = 500", 'source = "tt"', "column"),
    ],
)
def test_what_does_not_fit_the_file_is_told_when_it_is_imported(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    source = tmp_path / "E1.csv"
    source.write_text(written.csv_text(50), encoding="utf-8", newline="")
    text = written.map_text(written.PLAIN)
    assert old in text
    with pytest.raises(PmgError, match=expected.replace("?", r"\?")):
        import_recording(source, read_map(written.write_map(tmp_path, text.replace(old, new, 1))), tmp_path / "a.mcap")
    assert not (tmp_path / "a.mcap").exists()


def test_words_about_the_run_come_from_the_file_or_the_command(tmp_path: Path) -> None:
    source = tmp_path / "P17.csv"
    source.write_text(written.csv_text(50, comment="# bench: Süd\n"), encoding="utf-8", newline="")
    run = written.RUN.replace('point = "E1"', 'point = { file = "stem" }\nnote = { property = "bench" }')
    chart = read_map(written.write_map(tmp_path, written.map_text(written.PLAIN, run=run)))
    done = import_recording(source, chart, tmp_path / "a.mcap", {"gear": "1"})
    found = read_recording(done.out).run
    assert (found.point, found.note, found.gear, found.started_at) == ("P17", "Süd", 1, written.START)


def test_a_map_without_a_needed_channel_is_remarked_on(tmp_path: Path) -> None:
    source = tmp_path / "E1.csv"
    source.write_text(written.csv_text(50), encoding="utf-8", newline="")
    chart = read_map(written.write_map(tmp_path, written.map_text(written.channel(FREQUENCY, "torque_sun"))))
    done = import_recording(source, chart, tmp_path / "a.mcap")
    told = [finding.where for finding in done.findings if finding.code is Code.CHANNEL_MISSING]
    assert told == [written.TOPICS[name] for name in ("angle_sun", "torque_ring", "angle_ring")]
