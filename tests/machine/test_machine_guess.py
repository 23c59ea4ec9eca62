"""A machine file proposed from one recording: what is taken, what is left open, and that it is read again."""

from __future__ import annotations

import tomllib
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
import pytest
from scipy.io import savemat
from tests.balance import gearbox

from pmg.pipeline.commands.exchange import run_guess
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.channel_values import channels_in_si
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.importers.guess.map_text import OPEN
from pmg.pipeline.importers.open_source import whole_channels
from pmg.pipeline.importers.table_source import TableSource
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.recording.findings import Findings
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.sim.signals import Array

T = np.arange(3000) / 500.0


def proposed(path: Path, out: Path | None = None) -> tuple[dict[str, Any], str]:
    """What is proposed as tables, and as it stands in the file."""
    text = run_guess(path, None, out, (), machine=True).data["machine"]
    return tomllib.loads(text), text


def csv(path: Path, columns: dict[str, Array], delimiter: str = ";") -> Path:
    rows = "\n".join(delimiter.join(f"{value:.6f}" for value in row) for row in zip(*columns.values(), strict=True))
    path.write_text(f"{delimiter.join(columns)}\n{rows}\n", encoding="utf-8")
    return path


def wave(frequency: float) -> Array:
    return np.asarray(np.sin(REVOLUTION * frequency * T))


def test_a_gearbox_with_units_is_proposed_whole_and_its_file_is_read_as_it_is(tmp_path: Path) -> None:
    records = gearbox.make_records(tmp_path / "records", seconds=40.0, names=("first.csv",))
    first = records / "first.csv"
    head, rows = first.read_text().split("\n", 1)
    first.write_text("t [s],n_motor [rpm],T_motor [Nm],n_brake [1/min],T_brake [Nm]\n" + rows)
    table, _ = proposed(first, tmp_path / "machine.toml")
    assert table["gear"]["ratio"]["value"] == pytest.approx(gearbox.RATIO, rel=1e-3)
    assert table["shaft"]["output"]["channel"]["torque"]["sign"] == -1, "which counts what comes out"
    found, _ = read_recordings(case_of(read_machine(tmp_path / "machine.toml"), records))
    completed = (
        (tmp_path / "machine.toml").read_text(encoding="utf-8").replace(f'{OPEN}source = ""', 'source = "plate"')
    )
    for key, number in (("nominal", 20), ("tolerance", 0.2)):
        completed = completed.replace(f"{OPEN}{key} = {{ value = ,", f"{key} = {{ value = {number},")
    (tmp_path / "completed.toml").write_text(completed.replace(f"{OPEN}[", "["), encoding="utf-8")
    whole = case_of(read_machine(tmp_path / "completed.toml"), records)
    assert whole.nominal == {"force": 20.0, "output_force": 20.0}
    assert whole.tolerances == pytest.approx({"input_torque_gain": 0.002, "output_torque_gain": 0.002})
    first.write_text(f"{head}\n{rows}")
    shipped = tmp_path / "shipped.toml"
    text = gearbox.SHIPPED.read_text().replace("low_pass_Hz = 20", "low_pass_Hz = 32")
    shipped.write_text(text.replace('withheld = ["withheld*"]', ""))
    expected, _ = read_recordings(case_of(read_machine(shipped), records))
    np.testing.assert_allclose(found.force, expected.force, atol=1e-2 * float(np.std(expected.force)))


def test_what_has_no_unit_is_shown_and_left_open(tmp_path: Path) -> None:
    columns = {"t": T, "n_motor": 100.0 * wave(0.5), "M_motor": wave(1.0), "n_brake": 20.0 * wave(0.5)}
    table, text = proposed(csv(tmp_path / "a.csv", columns))
    assert set(table["shaft"]) == {"input", "output"}
    assert table["gear"]["ratio"]["value"] == pytest.approx(5.0), "by the shape of both speeds"
    assert table["shaft"]["input"]["channel"] == {}
    for line in ('velocity = { name = "n_motor", unit = "" }', 'torque = { name = "M_motor", unit = "" }'):
        assert f"\n{OPEN}{line}\n" in text
    assert f'\n{OPEN}time = {{ name = "t", unit = "s" }}\n' in text, "the unit that gives a likely rate"


@pytest.mark.parametrize(
    ("columns", "moves", "channel", "opened"),
    [
        (
            {"Zeit [ms]": 1e3 * T, "Weg [mm]": wave(0.3), "Kraft [N]": wave(2.0), "T_Spindel [°C]": 20.0 + T},
            "slides",
            {"position": {"name": "Weg", "unit": "mm"}, "force": {"name": "Kraft", "unit": "N"}},
            "inertia",
        ),
        (
            {"Zeit [ms]": 1e3 * T, "phi [mrad]": wave(0.3), "Strom [A]": wave(2.0), "temp [°C]": 20.0 + T},
            "turns",
            {"position": {"name": "phi", "unit": "mrad"}},
            'torque = { name = "Strom", unit = "A", newton_metre_per_unit =  }',
        ),
        (
            {"Zeit [ms]": 1e3 * T, "n_1 [rpm]": wave(0.3), "n_2 [rpm]": wave(2.0), "temp [°C]": 20.0 + T},
            "turns",
            {"velocity": {"name": "n_1", "unit": "rpm"}},
            'ratio = { value = , unit = "1", source = "" }',
        ),
    ],
    ids=["slide", "current", "two speeds that go apart"],
)
def test_axis_temperature_and_time_are_told_by_units(
    tmp_path: Path, columns: dict[str, Array], moves: str, channel: dict[str, Any], opened: str
) -> None:
    table, text = proposed(csv(tmp_path / "a.csv", columns))
    shaft = next(iter(table["shaft"].values()))
    assert shaft["moves"] == moves
    assert shaft["channel"] == channel
    assert table["records"]["time"] == {"name": "Zeit", "unit": "ms"}
    assert table["records"]["temperature"]["unit"] == "degC"
    assert (table["records"]["rate_Hz"], table["records"]["keep_every"]) == (500.0, 10)
    assert f"\n{OPEN}{opened}" in text


def test_two_candidates_a_set_point_and_what_stands_still_are_not_chosen(tmp_path: Path) -> None:
    columns = {"n [rpm]": wave(1.0), "drehzahl [rpm]": wave(1.0), "M_soll [Nm]": wave(2.0), "M [Nm]": 0.0 * T}
    table, text = proposed(csv(tmp_path / "a.csv", columns))
    assert table["shaft"]["shaft"]["channel"] == {}
    assert "# velocity: 2 candidates, none chosen" in text
    assert '# "M_soll": a set-point by its name' in text
    assert "# but: it is constant" in text
    assert f"{OPEN}rate_Hz = " in text


def test_a_command_is_taken_where_no_torque_and_no_current_was_measured(tmp_path: Path) -> None:
    columns = {"t [s]": T, "n [rpm]": wave(1.0), "iq_ref [A]": wave(2.0), "n_soll [rpm]": wave(1.0)}
    table, text = proposed(csv(tmp_path / "a.csv", columns))
    assert table["shaft"]["shaft"]["channel"] == {"velocity": {"name": "n", "unit": "rpm"}}
    assert f'\n{OPEN}torque = {{ name = "iq_ref", unit = "A", newton_metre_per_unit =  }}\n' in text
    assert "# why: a set-point by its name, and not measured" in text
    assert '# "n_soll": a set-point by its name, and not measured' in text
    _, text = proposed(csv(tmp_path / "b.csv", columns | {"Strom [A]": wave(2.0)}))
    assert f'\n{OPEN}torque = {{ name = "Strom", unit = "A"' in text
    assert '# "iq_ref": a set-point by its name, and not measured' in text


def test_where_each_kind_has_two_channels_one_named_shaft_tells_the_other(tmp_path: Path) -> None:
    names = {"n_LM [rpm]": 5.0 * wave(0.5), "M_LM [Nm]": wave(1.0), "n_load [rpm]": wave(0.5), "M_load [Nm]": wave(1.0)}
    table, text = proposed(csv(tmp_path / "a.csv", {"t [s]": T, **names}))
    assert table["gear"]["ratio"]["value"] == pytest.approx(5.0)
    assert table["shaft"]["input"]["channel"]["torque"]["name"] == "M_LM"
    assert "# why: unit N m, input as the other one is of the output" in text
    table, text = proposed(csv(tmp_path / "b.csv", {"t [s]": T, **names, "M_x [Nm]": wave(1.0)}))
    assert set(table["shaft"]) == {"input", "output"}, "by the speeds"
    assert "torque" not in table["shaft"]["input"]["channel"]
    nobody = {name.replace("load", "QQ"): values for name, values in names.items()}
    _, text = proposed(csv(tmp_path / "c.csv", {"t [s]": T, **nobody}))
    assert "# torque: 2 candidates, none chosen: take one; of two shafts, write both and a [gear]" in text


def test_units_stand_in_names_and_a_factor_makes_a_torque_of_per_cent(tmp_path: Path) -> None:
    """A drive's log: nanoseconds, speeds as ``deg_s``, torque as a part of the rated one, no brackets anywhere."""
    names = {"stamp_ns": 1e9 * T, "vel_deg_s": wave(0.5), "x_rad": wave(0.5), "torque_pct": wave(1.0), "T_amb_C": T}
    table, text = proposed(csv(tmp_path / "a.csv", names))
    channel, records = table["shaft"]["shaft"]["channel"], table["records"]
    assert channel["velocity"] == {"name": "vel_deg_s", "unit": "deg/s"}
    assert channel["position"] == {"name": "x_rad", "unit": "rad"}
    assert records["time"] == {"name": "stamp_ns", "unit": "ns"}
    assert records["temperature"] == {"name": "T_amb_C", "unit": "degC"}
    assert records["rate_Hz"] == 500.0
    torque = '{ name = "torque_pct", unit = "%", newton_metre_per_unit ='
    assert f"{OPEN}torque = {torque}  }}" in text
    closed = text.replace(f"{OPEN}torque = {torque}", f"torque = {torque} 0.2")
    (tmp_path / "machine.toml").write_text(closed.replace(f'{OPEN}source = ""', 'source = "plate"'))
    case = case_of(read_machine(tmp_path / "machine.toml"), tmp_path)
    found = channels_in_si(tmp_path / "a.csv", case, case.channels, Findings("a.csv"))
    np.testing.assert_allclose(found["force"], 0.2 * wave(1.0), atol=1e-6, err_msg="one per cent makes 0.2 N m")


def test_shafts_by_an_and_ab_and_a_speed_of_neither(tmp_path: Path) -> None:
    both = {"M_an_Nm": wave(1.0), "M_ab_Nm": -3.0 * wave(1.0), "Theta_Oel": 40.0 + 0.1 * T}
    speeds = {"n_an_rpm": 7.0 * wave(0.5), "n_ab_rpm": wave(0.5)}
    table, text = proposed(csv(tmp_path / "a.csv", {"t_s": T, **speeds, **both}))
    assert table["gear"]["ratio"]["value"] == pytest.approx(7.0)
    assert table["shaft"]["output"]["channel"]["torque"]["name"] == "M_ab_Nm"
    assert f'{OPEN}temperature = {{ name = "Theta_Oel"' in text, "the letter is its symbol, oil its word"
    table, text = proposed(csv(tmp_path / "b.csv", {"t_s": T, "Drehzahl Welle [rpm]": wave(0.5), **both}))
    assert "velocity" not in table["shaft"]["input"]["channel"]
    assert f'{OPEN}velocity = {{ name = "Drehzahl Welle", unit = "rpm" }}' in text
    assert "# no word tells of which shaft" in text


def test_a_column_without_a_word_is_a_time_by_its_steps_and_a_single_value_a_rate(tmp_path: Path) -> None:
    rows = {"data": np.stack([T, wave(0.5)], axis=1), "fs": 500.0}
    savemat(tmp_path / "a.mat", rows)
    table, text = proposed(tmp_path / "a.mat")
    assert f'{OPEN}time = {{ name = "data(:,1)", unit = "s" }}' in text
    savemat(tmp_path / "b.mat", {"n_rpm": wave(0.5), "M_Nm": wave(1.0), "fs": 400.0})
    table, text = proposed(tmp_path / "b.mat")
    assert table["records"]["rate_Hz"] == 400.0
    assert '# "fs": a single value: the rate of the samples' in text
    savemat(tmp_path / "c.mat", {"n_rpm": wave(0.5), "M_Nm": wave(1.0), "dt": 0.004})
    assert proposed(tmp_path / "c.mat")[0]["records"]["rate_Hz"] == pytest.approx(250.0)
    savemat(tmp_path / "d.mat", {"n_rpm": wave(0.5), "M_Nm": wave(1.0), "dt_ms": 2.0, "flow_rate": 3.0})
    assert proposed(tmp_path / "d.mat")[0]["records"]["rate_Hz"] == pytest.approx(500.0)
    savemat(tmp_path / "e.mat", {"idx": 10.0 * np.arange(len(T)), "n_rpm": wave(0.5), "fs": 400.0})
    assert proposed(tmp_path / "e.mat")[0]["records"]["rate_Hz"] == 400.0, "before what even steps may mean"


@pytest.mark.parametrize("name", ["oil_pressure_bar", "ambient_humidity_pct", "last_speed", "Temp_F"])
def test_words_that_tell_something_else_are_not_taken_for_a_temperature_or_a_force(tmp_path: Path, name: str) -> None:
    table, _ = proposed(csv(tmp_path / "a.csv", {"t_s": T, "n_rpm": wave(0.5), "M_Nm": wave(1.0), name: 40.0 + T}))
    assert set(table["shaft"]) == {"shaft"}
    assert table["shaft"]["shaft"]["channel"]["torque"]["name"] == "M_Nm"
    assert "temperature" not in table["records"]


@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_dates_with_a_time_of_day_are_the_time_of_a_table(tmp_path: Path, zone: str | None) -> None:
    """Also where a column is of spans, or of times of day."""
    began = datetime(2026, 3, 2, 13, 5, 7, 250000, tzinfo=UTC)
    stamps = pl.Series([began + timedelta(seconds=float(t)) for t in T]).dt.replace_time_zone(zone)
    frame = pl.DataFrame({"stamp": stamps, "pos_mm": wave(0.3), "force_N": wave(2.0)})
    frame = frame.with_columns(span=pl.col("stamp") - pl.col("stamp").first(), clock=pl.col("stamp").dt.time())
    frame.write_parquet(tmp_path / "a.parquet")
    columns = whole_channels(TableSource(tmp_path / "a.parquet", "parquet"), ["stamp", "span", "clock"])
    for values in columns.values():
        np.testing.assert_allclose(values - values[0], T, atol=2e-6)
    assert columns["stamp"][0] == columns["span"][0] == 0.0
    frame.drop("span", "clock").write_parquet(tmp_path / "b.parquet")
    table, _ = proposed(tmp_path / "b.parquet")
    assert table["records"]["time"] == {"name": "stamp", "unit": "s"}
    assert table["shaft"]["shaft"]["channel"] == {
        "position": {"name": "pos_mm", "unit": "mm"},
        "force": {"name": "force_N", "unit": "N"},
    }
    assert table["model"]["baseline"] == ["inertia", "viscous", "coulomb"]


@pytest.mark.parametrize("name", ["temp [°F]", "temp_degF"])
def test_a_temperature_in_another_unit_is_left_open(tmp_path: Path, name: str) -> None:
    columns = {"t [s]": T, "phi [mrad]": wave(0.3), "M [N m]": wave(2.0), name: 70.0 + T}
    table, text = proposed(csv(tmp_path / "record.csv", columns))
    assert "temperature" not in table["records"]
    assert f"{OPEN}temperature = {{ name = " in text


@pytest.mark.parametrize("rate", [16_384.0, 65_536.0])
def test_a_rate_of_many_digits_is_proposed_whole(tmp_path: Path, rate: float) -> None:
    t = np.arange(3000) / rate
    columns = {"t [us]": 1e6 * t, "phi [mrad]": np.sin(REVOLUTION * 20.0 * t), "M [N m]": np.cos(REVOLUTION * 9.0 * t)}
    table, _ = proposed(csv(tmp_path / "record.csv", columns))
    assert table["records"]["rate_Hz"] == rate


@pytest.mark.parametrize(
    ("n_rows", "m_rows", "ratio", "turned"),
    [(3000, 3000, 5.0, True), (2000, 3000, None, False), (3000, 2000, 5.0, False), (2000, 2000, None, False)],
    ids=["alike", "speeds apart", "torques apart", "both apart"],
)
def test_channels_of_other_lengths_leave_ratio_and_sign_open(
    tmp_path: Path, n_rows: int, m_rows: int, ratio: float | None, *, turned: bool
) -> None:
    """The output has as many rows as said, the input 3000; sampled at 500 Hz."""
    nptdms = pytest.importorskip("nptdms")
    speed, torque = wave(0.5), wave(0.5)
    columns = {"n_motor": ("rpm", 100.0 * speed), "M_motor": ("Nm", torque)}
    columns |= {"n_brake": ("rpm", 20.0 * speed[:n_rows]), "M_brake": ("Nm", 4.0 * torque[:m_rows])}
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        for name, (unit, values) in columns.items():
            words = {"wf_increment": 0.002, "unit_string": unit}
            writer.write_segment([nptdms.ChannelObject("DAQ", name, values, words)])
    table, text = proposed(tmp_path / "a.tdms")
    assert [table["shaft"][end]["channel"]["velocity"]["name"] for end in ("input", "output")] == [
        "DAQ/n_motor",
        "DAQ/n_brake",
    ]
    assert table["gear"].get("ratio", {}).get("value") == (None if ratio is None else pytest.approx(ratio))
    assert ("sign" in table["shaft"]["output"]["channel"]["torque"]) == turned
    assert ("the speeds were not set side by side: rows of DAQ/n_motor: 3000, DAQ/n_brake: 2000" in text) == (not ratio)
    assert ("# sign: open" in text) == (not turned)


def test_channels_of_other_rates_are_not_set_side_by_side(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        for name, step in (("n_motor", 0.002), ("n_brake", 0.004)):
            words = {"wf_increment": step, "unit_string": "rpm"}
            writer.write_segment([nptdms.ChannelObject("DAQ", name, wave(0.5), words)])
    table, text = proposed(tmp_path / "a.tdms")
    assert "ratio" not in table["gear"]
    assert "the speeds were not set side by side: rates of 250 and 500 Hz" in text


def test_a_joint_of_a_robot_is_told_by_its_symbols_and_several_are_no_gear(tmp_path: Path) -> None:
    one = {"t": T, "q": wave(0.5), "q_d": wave(0.5), "qd": wave(0.6), "tau": wave(0.7)}
    _, text = proposed(csv(tmp_path / "a.csv", one))
    for kind, name in {"position": "q", "velocity": "qd", "torque": "tau"}.items():
        assert f'{OPEN}{kind} = {{ name = "{name}", unit = "" }}' in text
    assert '"q_d": a set-point by its name' in text
    many = {"t": T} | {f"{symbol}{k}": wave(0.1 * k) for symbol in ("q", "qd", "tau") for k in (1, 2, 3)}
    table, text = proposed(csv(tmp_path / "b.csv", many))
    assert "gear" not in table
    assert "# position: 3 candidates, none chosen" in text


def test_a_rate_by_the_even_steps_of_a_column_that_may_be_no_time_is_left_open(tmp_path: Path) -> None:
    winding = np.asarray(30.0 + 0.005 * np.arange(len(T)))
    table, text = proposed(
        csv(tmp_path / "a.csv", {"winding": winding, "n [rpm]": 900.0 * wave(0.5), "M [Nm]": wave(1.0)})
    )
    assert not {"time", "rate_Hz", "low_pass_Hz", "keep_every"} & set(table["records"])
    assert f"{OPEN}rate_Hz = 200.0  # if that column is the time" in text
