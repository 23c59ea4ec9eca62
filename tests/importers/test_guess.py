"""A proposed channel map: what is chosen, what is only shown, and that it is accepted once it is completed."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from pmg.pipeline.importers.channel_map import read_map
from pmg.pipeline.importers.guess.map_guess import guess_map
from pmg.pipeline.importers.guess.map_text import OPEN, map_text
from pmg.pipeline.importers.guess.signal_kinds import kinds_by_name, side_of, unit_by_name
from pmg.pipeline.importers.guess.signal_look import SeenSignal, look_at
from pmg.pipeline.importers.import_recording import import_recording
from pmg.pipeline.importers.source import Block, SourceChannel, Wanted
from pmg.sim.errors import BenchError

from . import written
from .test_commands import call
from .test_roundtrip import assert_same_means

Values = npt.NDArray[np.float64]
T = np.arange(3000) / 500.0
TURN = 2.0 * np.pi
FILLED = {
    "calibration": '"calibration.toml"',
    "campaign": '"made"',
    "configuration": '"engaged"',
    "gear": "2",
    "drive": '"sun"',
    "started_at": "2026-03-04T09:30:00.250Z",
}


@dataclass
class Held:
    """A file of one channel, in memory."""

    name: str
    values: Values
    unit: str = ""
    whole: bool = True
    path: Path = Path("held.csv")
    format: str = "csv"
    reader: str = "none"
    place: str = "line"
    properties: Mapping[str, str] = field(default_factory=dict)
    reading: Mapping[str, str] = field(default_factory=dict)
    started_at: datetime | None = None

    @property
    def channels(self) -> tuple[SourceChannel, ...]:
        return (SourceChannel(self.name, self.unit, len(self.values) + (0 if self.whole else 1)),)

    @channels.setter
    def channels(self, _: tuple[SourceChannel, ...]) -> None: ...

    def blocks(self, wanted: Sequence[Wanted]) -> Iterator[Block]:
        yield Block(np.arange(1, len(self.values) + 1), dict.fromkeys(wanted, self.values))


def seen_of(values: Values, unit: str = "", whole: bool = True) -> SeenSignal:
    (seen,) = look_at(Held("x", values, unit, whole))
    return seen


def noise(mean: float, spread: float = 0.02) -> Values:
    return mean + np.random.default_rng(5).normal(0.0, spread, len(T))


def csv(folder: Path, columns: dict[str, Values]) -> Path:
    path = folder / "E1.csv"
    rows = (";".join(f"{cell:.9g}" for cell in row) for row in zip(*columns.values(), strict=True))
    path.write_text("\n".join([";".join(columns), *rows]) + "\n", encoding="utf-8")
    return path


def proposed(source: Path) -> dict[str, Any]:
    code, told, errors = call("import", source, "--guess", "--json")
    assert code == 0, errors
    data: dict[str, Any] = json.loads(told)["data"]
    tomllib.loads(data["map"])
    return data


def completed(text: str, point: str = '"E1"', **more: str) -> str:
    """The map with what is marked filled in, and nothing else touched; what is not wanted stays marked."""
    for key, value in (FILLED | more).items():
        text = re.sub(rf"(?m)^{re.escape(OPEN)}{key} = .*$", f"{key} = {value}", text, count=1)
    return text.replace('point = { file = "stem" }', f"point = {point}\nsun_speed_set_rpm = 600")


def chosen(data: dict[str, Any]) -> dict[str, str | None]:
    return {"/".join(each["topic"].split("/")[2:]): each["chosen"] for each in data["topics"]}


# --- completed and imported ----------------------------------------------------------------------------


def test_a_proposed_map_is_accepted_once_what_is_marked_is_filled_in(tmp_path: Path) -> None:
    source = tmp_path / "E1.csv"
    source.write_text(written.csv_text(time=True), encoding="cp1252", newline="")
    code, told, _ = call("import", source, "--guess", "--out", tmp_path / "map.toml")
    assert (code, told) == (
        0,
        f"wrote a proposed map to {tmp_path / 'map.toml'}: 4 of 4 topics chosen, what is open is marked\n",
    )
    text = (tmp_path / "map.toml").read_text(encoding="utf-8")
    with pytest.raises(BenchError, match="calibration"):
        read_map(tmp_path / "map.toml")
    chart = written.write_map(tmp_path, completed(text))
    code, _, errors = call("import", source, "--map", chart, "--out", tmp_path / "out")
    assert code == 0, errors
    assert_same_means(tmp_path, tmp_path / "out" / "E1.mcap")


def test_hdf5_is_guessed_by_its_units_and_paths(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    source = tmp_path / "E1.h5"
    with h5py.File(source, "w") as file:
        for name, values in (written.raw() | {"time": np.arange(2500) / written.RATE}).items():
            file[f"DAQ1/{name}"] = values
            file[f"DAQ1/{name}"].attrs["unit"] = written.UNITS.get(name, "s")
        file["DAQ1/note"] = "spring"
        file["slow/temperature"] = np.zeros(10)
    data = proposed(source)
    assert chosen(data) == {
        "torque_sun/frequency": "DAQ1/torque_sun",
        "torque_ring/frequency": "DAQ1/torque_ring",
        "encoder_sun/count": "DAQ1/angle_sun",
        "encoder_ring/count": "DAQ1/angle_ring",
    }
    assert data["time"]["chosen"] == {"source": "DAQ1/time", "unit": "s"}
    left = {one["source"]: one["reason"] for one in data["left"]}
    assert set(left) == {"DAQ1/note", "slow/temperature"}
    assert "not read: text" in left["DAQ1/note"]
    done = import_recording(source, read_map(written.write_map(tmp_path, completed(data["map"]))), tmp_path / "E1.mcap")
    assert_same_means(tmp_path, done.out)


def test_torque_in_volts_and_angles_that_begin_anew_are_accepted_with_their_sensitivity(tmp_path: Path) -> None:
    run = written.run()
    t = np.arange(2500) / written.RATE
    source = csv(
        tmp_path,
        {
            "Zeit (ms)": t * 1e3,
            "Drehmoment Antrieb (V)": run.torque_sun / 2.0,
            "Drehmoment Abtrieb (Nm)": run.torque_ring,
            "phi_in (°)": np.degrees(run.angle_sun) % 360.0,
            "phi_out (rad)": run.angle_ring % TURN,
        },
    )
    data = proposed(source)
    assert chosen(data) == {
        "torque_sun/frequency": None,
        "torque_ring/frequency": "Drehmoment Abtrieb",
        "encoder_sun/count": "phi_in",
        "encoder_ring/count": "phi_out",
    }
    (volts,) = data["topics"][0]["candidates"]
    assert (volts["source"], volts["unit"], volts["missing"]) == ("Drehmoment Antrieb", "V", ["Nm_per_unit"])
    text = completed(data["map"], Nm_per_unit="2.0")
    text = re.sub(r"(?m)^#\? (?=(\[\[|topic|source|unit = \"V\"))", "", text)
    done = import_recording(source, read_map(written.write_map(tmp_path, text)), tmp_path / "E1.mcap")
    assert done.rate_hz == 500.0
    assert_same_means(tmp_path, done.out, 1e-6)


# --- never invented ------------------------------------------------------------------------------------


def test_two_candidates_are_both_shown_and_none_is_chosen(tmp_path: Path) -> None:
    columns = {"torque_in [Nm]": noise(2), "M_1 [Nm]": noise(2), "n_in [rpm]": noise(600), "phi_in [deg]": 3600 * T}
    data = proposed(csv(tmp_path, {"t [s]": T, "time [s]": T} | columns))
    assert set(chosen(data).values()) == {None}
    shown = {each["topic"]: [one["source"] for one in each["candidates"]] for each in data["topics"]}
    assert shown["/daq/torque_sun/frequency"] == ["torque_in", "M_1"]
    assert shown["/daq/encoder_sun/count"] == ["n_in", "phi_in"]
    assert (data["time"]["chosen"], len(data["time"]["options"])) == (None, 2)
    for name in ("torque_in", "M_1", "n_in", "phi_in", "t", "time"):
        assert f'{OPEN}source = "{name}"' in data["map"]
        assert f'\nsource = "{name}"' not in data["map"]


def test_without_a_word_for_the_shaft_a_torque_is_shown_for_both(tmp_path: Path) -> None:
    data = proposed(csv(tmp_path, {"t [s]": T, "torque [Nm]": noise(2), "x(:,1) [Nm]": noise(3)}))
    assert [len(each["candidates"]) for each in data["topics"]] == [2, 2, 0, 0]
    assert set(chosen(data).values()) == {None}
    assert data["map"].count("no word tells the shaft") == 4


@pytest.mark.parametrize(
    ("name", "values", "reason"),
    [
        ("n_soll_1 [rpm]", noise(600), "a set-point"),
        ("torque_in [rpm]", noise(2), "its unit rpm says speed, but its name says torque"),
        ("T_1", noise(20), "torque or temperature"),
        ("T_1 [°C]", noise(20), "a temperature"),
        ("I_1 [A]", noise(1), "a current"),
        ("p_1 [bar]", noise(1), "the unit bar does not tell"),
        ("U_1 [V]", noise(1), "the unit V does not tell"),
        ("Kanal 7", noise(1), "its name says nothing"),
    ],
)
def test_what_cannot_be_told_is_left_with_its_reason(tmp_path: Path, name: str, values: Values, reason: str) -> None:
    data = proposed(csv(tmp_path, {"t [s]": T, name: values}))
    assert set(chosen(data).values()) == {None}
    (left,) = data["left"]
    assert reason in left["reason"]
    assert f'# "{left["source"]}": {left["reason"]}' in data["map"]


@pytest.mark.parametrize(
    ("unit", "name", "values", "doubt", "missing"),
    [
        ("N m", "M_1", np.zeros(3000), "constant", ()),
        ("", "M_1", noise(2), "", ("unit",)),
        ("1", "count_1", 3600 * T + 0.5, "whole numbers", ()),
        ("1", "count_1", np.floor(9000 * T) % 5120, "no power of two", ()),
        ("deg", "phi_1", np.where(np.arange(3000) < 1500, 359.0, 1.0) + T, "where it begins anew is not seen", ()),
        ("deg", "phi_1", (3600 * T) % 400.0, "", ("wraps_at",)),
        ("", "phi_1", noise(2), "", ("unit",)),
    ],
)
def test_what_is_doubtful_is_not_chosen(
    unit: str, name: str, values: Values, doubt: str, missing: tuple[str, ...]
) -> None:
    held = Held(name, values, unit)
    found = guess_map(held, look_at(held))
    assert {each.chosen for each in found.topics} == {None}
    (guess,) = {one.name: one for each in found.topics for one in each.candidates}.values()
    assert doubt in guess.doubt
    assert guess.missing == missing


# --- shapes --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "wraps", "wraps_at"),
    [
        ((3600 * T) % 360.0, 59, 360.0),
        ((-3600 * T) % 360.0, 60, 360.0),
        ((3600 * T + 180.0) % 360.0 - 180.0, 60, 360.0),
        ((20 * T) % TURN, 19, TURN),
        ((3 * T) % 1.0, 17, 1.0),
        ((20 * T) % 60.0, 1, 60.0),
        (np.floor(9000 * T) % 2.0**12, 13, 2.0**12),
        ((np.floor(100 * T) - 300) % 2.0**32, 1, 2.0**32),
        (3600 * T, 0, None),
        (noise(2), 0, None),
        (np.where(T < 3.0, 0.0, 360.0) + noise(0), 0, None),
        (np.where(T < 3.0, 0.0, 1.0), 0, None),
        (np.sin(20 * T), 0, None),
        (np.sign(np.sin(20 * T)), 0, None),
    ],
)
def test_a_signal_that_begins_anew_is_told_from_one_that_jumps(
    values: Values, wraps: int, wraps_at: float | None
) -> None:
    seen = seen_of(values)
    assert (seen.wraps, seen.wraps_at) == (wraps, wraps_at)


def test_steps_ranges_and_missing_values_are_told() -> None:
    gap = np.delete(T, slice(100, 120))
    seen = seen_of(np.append(gap, np.nan), "s")
    assert (seen.rising, seen.even, seen.missing) == (True, True, 1)
    assert seen.step == pytest.approx(0.002)
    assert "1 of them missing; from 0 to 5.998; rises steadily, in even steps of 0.002" in seen.description()
    shaken = seen_of(T + np.random.default_rng(1).uniform(0.0, 0.0015, 3000), whole=False)
    assert (shaken.rising, shaken.even) == (True, False)
    assert "first 3000 values" in shaken.description()
    assert "constant at 4" in seen_of(np.full(5, 4.0)).description()
    nothing = seen_of(np.full(5, np.nan))
    assert nothing.description() == "no unit; 5 values; 5 of them missing"
    assert json.loads(json.dumps(nothing.document(), allow_nan=False))["missing"] == 5
    assert seen_of(np.zeros(0)).description() == "no unit; 0 values"


# --- time ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "values", "expected"),
    [
        ("Zeit [ms]", T * 1e3, {"source": "Zeit", "unit": "ms"}),
        ("t_us", T * 1e6, {"source": "t_us", "unit": "us"}),
        ("uptime [s]", T + 1e5, {"source": "uptime", "unit": "s"}),
        ("seconds [s]", (T + 57.0) % 60.0, {"source": "seconds", "unit": "s"}),
    ],
)
def test_a_time_that_alone_fits_is_chosen(tmp_path: Path, header: str, values: Values, expected: object) -> None:
    data = proposed(csv(tmp_path, {header: np.round(values, 6), "M_1 [Nm]": noise(2)}))
    assert data["time"]["chosen"] == expected
    assert tomllib.loads(data["map"])["time"] == expected


@pytest.mark.parametrize(
    ("header", "values", "words"),
    [
        ("t", T, "unit = "),
        ("timer", (np.floor(T * 4e7) + 2.0**32 - 1e8) % 2.0**32, "frequency_Hz = "),
        ("t [s]", T + np.random.default_rng(1).uniform(0.0, 0.0015, 3000), "# but: its steps are not even"),
    ],
)
def test_a_time_with_something_open_is_only_shown(tmp_path: Path, header: str, values: Values, words: str) -> None:
    data = proposed(csv(tmp_path, {header: np.round(values, 6), "M_1 [Nm]": noise(2)}))
    assert (data["time"]["chosen"], len(data["time"]["options"])) == (None, 1)
    assert tomllib.loads(data["map"])["time"] == {}
    assert words in data["map"]


def test_what_rises_without_being_a_time_is_none(tmp_path: Path) -> None:
    data = proposed(csv(tmp_path, {"index": np.arange(3000.0), "t [s]": np.full(3000, 5.0), "M_1 [Nm]": noise(2)}))
    assert data["time"]["options"] == []
    assert f"{OPEN}rate_Hz = " in data["map"]


def test_a_rate_that_the_file_states_is_left_to_it(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(str(tmp_path / "E1.tdms")) as writer:
        words = {"wf_increment": 0.002, "unit_string": "Nm"}
        writer.write_segment([nptdms.ChannelObject("DAQ", f"torque_{n}", noise(2), words) for n in (1, 2)])
    data = proposed(tmp_path / "E1.tdms")
    assert data["time"]["stated"] == "the file states 500 Hz for each channel"
    assert list(chosen(data).values())[:2] == ["DAQ/torque_1", "DAQ/torque_2"]


# --- words ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "kinds", "side", "unit"),
    [
        ("DAQ1/Torque_ring", ("torque",), "ring", ""),
        ("DriveTorque", ("torque",), "sun", ""),
        ("out/speed", ("speed",), "ring", ""),
        ("M_in_out", ("torque",), "", ""),
        ("sun_out", (), "sun", ""),
        ("torque(:,2)", ("torque",), "", ""),
        ("speed@1", ("speed",), "", ""),
        ("M2_Nm", ("torque",), "ring", "N m"),
        ("time_s", ("time",), "", "s"),
        ("pins_s", (), "", ""),
        ("iq_A", ("current",), "", "A"),
        ("torque_A", ("torque",), "", ""),
        ("DAQ/n [1/min]", ("speed",), "", "rpm"),
        ("brings", (), "", ""),
        ("", (), "", ""),
    ],
)
def test_words_of_a_name(name: str, kinds: tuple[str, ...], side: str, unit: str) -> None:
    assert (kinds_by_name(name)[0], side_of(name), unit_by_name(name)) == (kinds, side, unit)


@pytest.mark.parametrize("name", ['a"b', "a\\b", "tab\there", "Süd\u202e", "\x7f", "#? x"])
def test_any_name_is_written_so_that_it_reads_back(name: str) -> None:
    held = Held(f"{name} sun", noise(2), "Nm")
    text = map_text(guess_map(held, look_at(held)))
    assert all(line.isprintable() for line in text.splitlines())
    assert tomllib.loads(text)["channel"][0]["source"] == held.name


# --- the command ---------------------------------------------------------------------------------------


def test_a_map_that_is_there_is_never_overwritten(tmp_path: Path) -> None:
    source, out = csv(tmp_path, {"t [s]": T, "M_1 [Nm]": noise(2)}), tmp_path / "map.toml"
    out.write_text("mine")
    code, _, errors = call("import", source, "--guess", "--out", out)
    assert (code, out.read_text()) == (2, "mine")
    assert "it is there already" in errors


def test_a_proposal_is_printed_as_it_is_written(tmp_path: Path) -> None:
    source = csv(tmp_path, {"t [s]": T, "M_1 [Nm]": noise(2)})
    _, told, _ = call("import", source, "--guess")
    call("import", source, "--guess", "--out", tmp_path / "map.toml")
    assert told == (tmp_path / "map.toml").read_text(encoding="utf-8") == proposed(source)["map"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("E1.csv", "--guess", "--map", "map.toml"), "it stands beside --guess"),
        (("E1.csv", "--guess", "--set", "point=P1"), "it stands beside --guess"),
        ((".", "--guess"), "a folder; expected one file"),
        (("none.csv", "--guess"), "no such file"),
        (("E1.xyz", "--guess"), "the ending '.xyz'"),
        (("E1.csv", "--out", "out"), "'pmg import FILE --guess' proposes one"),
        (("E1.csv", "--map", "map.toml"), "a folder for the recordings"),
        (("E1.csv", "--guess", "--out", "gone/map.toml"), "No such file or directory"),
    ],
)
def test_a_call_that_makes_no_sense_is_one_line_and_code_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], expected: str
) -> None:
    csv(tmp_path, {"t [s]": T, "M_1 [Nm]": noise(2)})
    (tmp_path / "E1.xyz").touch()
    (tmp_path / "map.toml").touch()
    monkeypatch.chdir(tmp_path)
    code, _, errors = call("import", *words)
    assert code == 2
    assert expected in errors
    assert "Traceback" not in errors
