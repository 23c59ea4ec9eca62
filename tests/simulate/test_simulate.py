"""``pmg simulate``: scenarios that ship, recordings that come back through the ingest, files written whole."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from tests.conftest import ROOT
from tests.report import chromium
from tests.report.controls import press_all
from tests.slow import SLOW, slow
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.crate import FILE as CRATE
from pmg.pipeline.grid.campaign import choose_campaign, measured_grid
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.simulate.inputs import gather_inputs
from pmg.pipeline.simulate.scenario_file import read_scenario
from pmg.pipeline.simulate.simulation import Simulation, simulate
from pmg.pipeline.store.store import Store
from pmg.pipeline.thesis_figures.tables import TORQUE_RING, TORQUE_SUN
from pmg.sim.bench import load_bench
from pmg.sim.dynamics.linear import ModeKind
from pmg.sim.errors import BenchError
from pmg.sim.grid import Grid
from pmg.sim.signals import REVOLUTION, SPEED_SUN

RUNNER = CliRunner()
SCENARIOS = ROOT / "raw" / "scenarios"
FURTHER = ("gear-2", "sun-held")
"""Scenarios with a solver of their own, which takes seconds to compile, and nothing else that others lack."""
DRAWN = ("engaged-grid", "free-carrier", "neutral", "thesis-run")
ONE_COUNT = REVOLUTION / 5120

_TOTALS = ("loss_total_W", "loss_bearings_W", "loss_magnetic_W")

LOSSES = f"""
[losses]
grids = "{(ROOT / "raw" / "published").as_posix()}"
K_corr = 0.8
b = 0.0
c = 2.22e-4
d = 0.0
"""
FEW = "[output]\nseconds = 1.0\nrate_Hz = 200\nfigures = false\n"
SMALL = LOSSES + "[grid]\nspeed_sun_rpm = [156, 312]\nload_Nm = [0.78, 1.17]\n" + FEW
SHORT = LOSSES + '[transient]\nduration_s = 0.5\nsolver = "radau"\nrtol = 1e-5\n'


def call(*arguments: object, expect: int) -> dict[str, Any]:
    outcome = RUNNER.invoke(app, [*map(str, arguments), "--json"])
    assert outcome.exit_code == expect, outcome.stderr
    result: dict[str, Any] = json.loads(outcome.stdout)
    assert result["exit_code"] == expect
    assert result["schema"] == "pmg.result/1"
    return result


def scenario(folder: Path, text: str) -> Path:
    path = folder / "scenario.toml"
    path.write_text(text)
    return path


def done(folder: Path, text: str) -> Simulation:
    file = read_scenario(scenario(folder, text))
    return simulate(file.table, gather_inputs(file, load_bench()))


def contents(folder: Path) -> dict[str, bytes]:
    """Bytes of every file but the one that holds the time of day."""
    files = (p for p in folder.rglob("*") if p.is_file() and p.name != CRATE)
    return {str(p.relative_to(folder)): p.read_bytes() for p in files}


# --- the scenarios that ship ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def shipped(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, dict[str, Any]]]:
    """Each of them run once; figures take most of the time, so only some are drawn."""
    raw = tmp_path_factory.mktemp("raw")
    for folder in ("scenarios", "published"):
        shutil.copytree(ROOT / "raw" / folder, raw / folder)
    found = {}
    for path in sorted((raw / "scenarios").glob("*.toml")):
        if path.stem in FURTHER and not SLOW:
            continue
        if path.stem not in DRAWN:
            text = path.read_text()
            table = "" if "[output]\n" in text else "\n[output]\n"
            path.write_text((text + table).replace("[output]\n", "[output]\nfigures = false\n"))
        out = tmp_path_factory.mktemp(path.stem)
        found[path.stem] = out, call("simulate", path, "--out", out, expect=0)["data"]["summary"]
    return found


@pytest.mark.parametrize(
    "name",
    [pytest.param(path.stem, marks=slow if path.stem in FURTHER else ()) for path in sorted(SCENARIOS.glob("*.toml"))],
)
def test_each_scenario_that_ships_runs(name: str, shipped: dict[str, tuple[Path, dict[str, Any]]]) -> None:
    out, summary = shipped[name]
    assert json.loads((out / "summary.json").read_text()) == summary
    assert summary["schema"] == "pmg.simulation/1"
    assert summary["simulated"] is True
    assert summary["control"]["stable"]
    assert summary["findings"] == []
    assert "Everything on this page is simulated" in (out / "report.html").read_text()
    listed = set(json.loads((out / "simulation-files.json").read_text())["files"])
    assert listed == set(contents(out))
    for table in out.glob("*.csv"):
        columns = pl.read_csv(table).columns
        assert columns == pl.read_parquet(table.with_suffix(".parquet")).columns
    if summary["transient"] is not None:
        assert abs(summary["transient"]["energy_residual"]) < 1e-6


@slow
@chromium.needed
def test_no_control_of_the_page_sends_anything(shipped: dict[str, tuple[Path, dict[str, Any]]], tmp_path: Path) -> None:
    assert press_all(shipped["neutral"][0] / "report.html", tmp_path)


def test_the_published_run_comes_out(shipped: dict[str, tuple[Path, dict[str, Any]]]) -> None:
    """The thesis prints 485 and -187 rpm; see the test of the simulator for what its tables support."""
    out, summary = shipped["thesis-run"]
    assert summary["transient"]["end"]["speed_sun_rpm"] == pytest.approx(485.0, rel=0.025)
    assert summary["transient"]["end"]["speed_ring_rpm"] == pytest.approx(-187.0, rel=0.025)
    (magnetic,) = summary["response"]["resonances"]
    assert (magnetic["name"], round(magnetic["frequency_Hz"])) == (ModeKind.MAGNETIC, 16)
    table = pl.read_csv(out / "response.csv")
    band = table.filter(pl.col("frequency_Hz") > 3.0)
    peak = band["frequency_Hz"][int(np.argmax(band["speed_ring_rpm_per_Nm"].to_numpy()))]
    assert peak == pytest.approx(magnetic["frequency_Hz"], rel=0.03)


def test_the_sweep_finds_the_oscillation_that_the_modes_name(shipped: dict[str, tuple[Path, dict[str, Any]]]) -> None:
    out, summary = shipped["sine-sweep"]
    table = pl.read_csv(out / "transient.csv")
    time, phase = table["time_s"].to_numpy(), table["phase_rad"].to_numpy()
    at = time[np.argmax(np.abs(phase - phase[0]))]
    frequency = 2.0 + (at - 1.0) * (40.0 - 2.0) / 10.0
    assert frequency == pytest.approx(summary["response"]["resonances"][0]["frequency_Hz"], rel=0.15)


def test_a_free_carrier_turns_as_the_pole_numbers_say(shipped: dict[str, tuple[Path, dict[str, Any]]]) -> None:
    out, _ = shipped["free-carrier"]
    row = pl.read_csv(out / "points.csv").row(0, named=True)
    assert row["speed_sun_rpm"] == pytest.approx(600.0)
    assert row["speed_carrier_rpm"] == pytest.approx(600.0 * 5.0 / 18.0)
    assert row["speed_ring_rpm"] == 0.0
    assert row["drive"] == "sun"
    mechanisms = [name for name in row if name.startswith("loss_") and name not in _TOTALS]
    assert row["loss_total_W"] == pytest.approx(row["power_in_W"] - row["power_out_W"])
    assert sum(row[name] for name in mechanisms) == pytest.approx(row["loss_total_W"], rel=1e-6)
    assert not list(out.rglob("*.mcap"))


def test_reversed_flow_is_driven_by_the_ring(shipped: dict[str, tuple[Path, dict[str, Any]]]) -> None:
    out, _ = shipped["reversed-flow"]
    table = pl.read_csv(out / "points.csv")
    assert set(table["drive"]) == {"ring"}
    assert table["efficiency_total"].is_between(0.5, 1.0).all()
    driving = table["torque_ring_Nm"].to_numpy() * table["speed_ring_rpm"].to_numpy() * SPEED_SUN.scale
    np.testing.assert_allclose(table["power_in_W"], driving, rtol=1e-12)


def test_pairs_give_the_sun_torques_that_the_source_prints(shipped: dict[str, tuple[Path, dict[str, Any]]]) -> None:
    """To 0.14 mN m and the last digit: what a polynomial of degree four in speed leaves of the 48 torques."""
    out, _ = shipped["thesis-points"]
    table = pl.read_csv(out / "points.csv")
    np.testing.assert_allclose(table["torque_ring_Nm"], TORQUE_RING.ravel(), rtol=1e-12)
    np.testing.assert_allclose(table["torque_sun_Nm"], TORQUE_SUN.ravel(), rtol=0.0, atol=6e-4)
    assert np.sqrt(np.mean((table["torque_sun_Nm"].to_numpy() - TORQUE_SUN.ravel()) ** 2)) < 2e-4


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("[pairs]\nspeed_sun_rpm = [100, 200]\ntorque_ring_Nm = [0.8]\n", "2 speeds and 1 torques"),
        (
            '[bench]\nconfiguration = "neutral"\n[pairs]\nspeed_sun_rpm = [100]\ntorque_ring_Nm = [0.8]\n',
            "in neutral",
        ),
    ],
)
def test_pairs_that_cannot_be_are_refused(tmp_path: Path, text: str, place: str) -> None:
    with pytest.raises(BenchError, match=place):
        read_scenario(scenario(tmp_path, LOSSES + text))


def test_a_second_run_is_drawn_over_the_first(tmp_path: Path, undrawn: None) -> None:
    first = scenario(tmp_path, SHORT + "[output]\nformats = []\n")
    second = tmp_path / "unsigned.toml"
    second.write_text(SHORT + "[assumptions]\nfriction_signed = false\n[output]\nformats = []\n")
    summary = call("simulate", first, "--out", tmp_path / "o", "--beside", second, expect=0)["data"]["summary"]
    assert summary["scenario"]["beside"] == "unsigned.toml"
    text = (tmp_path / "o" / "tables" / "two-runs-ends.csv").read_text()
    alone = done(tmp_path, second.read_text()).run
    assert alone is not None
    row = pl.read_csv(text.encode()).row(1)
    assert row[0] == "unsigned"
    assert row[2] == pytest.approx(float(SPEED_SUN.display(alone.trace["speed_sun"][-1])), rel=1e-9)


def test_what_is_to_be_said_of_the_second_run_is_said_with_its_file(tmp_path: Path, undrawn: None) -> None:
    first = scenario(tmp_path, SHORT + "[output]\nformats = []\n")
    second = tmp_path / "slipping.toml"
    sun = "[transient.sun]\nhold_Nm = 3.5\n[transient.ring]\nhold_Nm = 30.0\n"
    second.write_text(SHORT + sun + "[output]\nformats = []\n")
    alone = call("simulate", second, "--out", tmp_path / "a", expect=3)["findings"]
    both = call("simulate", first, "--out", tmp_path / "o", "--beside", second, expect=3)["findings"]
    told = [{key: value for key, value in each.items() if key != "file"} for each in both if each.get("file")]
    assert alone
    assert told == alone
    assert {each["file"] for each in both if each.get("file")} == {"slipping.toml"}
    page = (tmp_path / "o" / "report.html").read_text()
    assert all(f"slipping.toml: {each['where']}: " in page for each in alone)


def test_a_fault_of_the_second_scenario_is_told_before_the_first_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def not_yet(*_: object) -> Simulation:
        pytest.fail("the first was run")

    monkeypatch.setattr("pmg.pipeline.commands.simulate.simulate", not_yet)
    first, second = scenario(tmp_path, SHORT), tmp_path / "second.toml"
    for text in (SMALL, SHORT + "[bench]\ngear = 3\n", SHORT.replace("published", "nowhere")):
        second.write_text(text)
        call("simulate", first, "--out", tmp_path / "p", "--beside", second, expect=2)


def test_a_run_with_the_sun_held_begins_at_steady_state_and_stays_there(tmp_path: Path) -> None:
    held = '[bench]\nheld = "sun"\n' + SHORT.replace('"radau"', '"compiled"') + 'start = "steady"\n'
    motors = "[transient.sun]\nhold_Nm = -1.3\n[transient.ring]\nhold_Nm = 1.0\n[response]\npoints = 20\n"
    found = done(tmp_path, held + motors + "[output]\nformats = []\n")
    assert found.run is not None
    assert found.answer is not None
    ring, carrier = (found.run.trace[f"speed_{member}"] for member in ("ring", "carrier"))
    assert np.ptp(ring) < 1e-6 * abs(ring[0])
    q = found.run.trace.drivetrain.constants
    assert carrier[-1] == pytest.approx(q.p_r / q.Q * ring[-1], rel=1e-9)


# --- bench and simulation make the same grid -----------------------------------------------------------


def ingested(recordings: Path, store: Path) -> Grid:
    call("ingest", recordings, "--store", store, "--workers", 1, expect=0)
    name, manifests = choose_campaign(Store(store), None)
    return measured_grid(name, manifests, load_bench())


def agree(grid: Grid, table: pl.DataFrame, seconds: float) -> None:
    """Torques to a millionth of a newton metre; speeds to one count of the encoder over the window."""
    rows = {name: i for i, name in enumerate(table["point"])}
    order = [rows[name] for name in grid.points.name]
    assert sorted(order) == list(range(len(table)))
    assert grid.accepted.all()
    for side in ("sun", "ring"):
        torque = table[f"torque_{side}_Nm"].to_numpy()[order]
        speed = table[f"speed_{side}_rpm"].to_numpy()[order] * SPEED_SUN.scale
        np.testing.assert_allclose(getattr(grid, f"torque_{side}"), torque, rtol=0.0, atol=1e-6)
        resolved = ONE_COUNT / (seconds - 0.01)
        np.testing.assert_allclose(getattr(grid.points, f"speed_{side}"), speed, rtol=0.0, atol=resolved)


def test_the_simulated_engaged_grid_comes_back_through_the_ingest(
    shipped: dict[str, tuple[Path, dict[str, Any]]], tmp_path: Path
) -> None:
    out, _ = shipped["engaged-grid"]
    grid = ingested(out / "recordings", tmp_path / "store")
    assert len(grid) == 48
    assert grid.points.engaged.all()
    assert list(grid.points.started_at[:2]) == [1_577_836_800.0, 1_577_836_805.0]
    agree(grid, pl.read_csv(out / "points.csv"), 5.0)
    np.testing.assert_allclose(np.unique(grid.points.load_set), [0.78, 1.17, 1.56, 1.95])


def test_the_simulated_neutral_grid_comes_back_through_the_ingest(tmp_path: Path) -> None:
    sun, ring = list(range(0, 1873, 156))[::3], list(range(-720, 721, 240))
    text = f'[bench]\nconfiguration = "neutral"\n{LOSSES}[grid]\nspeed_sun_rpm = {sun}\nspeed_ring_rpm = {ring}\n'
    call("simulate", scenario(tmp_path, text + FEW), "--out", tmp_path / "out", "--campaign", "mine", expect=0)
    grid = ingested(tmp_path / "out" / "recordings", tmp_path / "store")
    assert grid.campaign == "mine"
    assert grid.points.neutral.all()
    assert grid.points.rest_sun.sum() == len(ring)
    agree(grid, pl.read_csv(tmp_path / "out" / "points.csv"), 1.0)


def test_a_run_is_recorded_as_its_encoders_and_transducers_see_it(
    shipped: dict[str, tuple[Path, dict[str, Any]]],
) -> None:
    for name in ("thesis-run", "neutral"):
        out, _ = shipped[name]
        samples = read_recording(out / "transient.mcap").samples
        table = pl.read_csv(out / "transient.csv")
        place = table["time_s"].to_numpy() * 500.0
        both = np.abs(place - np.rint(place)) < 1e-6
        assert both.sum() > 500
        rows = np.rint(place[both]).astype(int)
        for side in ("sun", "ring"):
            torque = samples[f"torque_{side}"].to_numpy()[rows]
            np.testing.assert_allclose(torque, table[f"torque_{side}_Nm"].to_numpy()[both], rtol=0.0, atol=1e-8)
            angle = samples[f"angle_{side}"].to_numpy()
            motor = table[f"speed_{side}_motor_rpm"].to_numpy() * SPEED_SUN.scale
            turned = np.trapezoid(motor, table["time_s"].to_numpy())
            assert angle[-1] - angle[0] == pytest.approx(turned, abs=2.0 * ONE_COUNT, rel=1e-4)


# --- laws ----------------------------------------------------------------------------------------------


def test_given_torques_hold_the_speed_whose_torques_they_are(tmp_path: Path) -> None:
    inverse = done(tmp_path, LOSSES + "[point]\nspeed_sun_rpm = 900\ntorque_ring_Nm = 1.5\n").points
    assert inverse is not None
    torque = float(inverse.grid.torque_sun[0])
    points = done(tmp_path, LOSSES + f"[point]\ntorque_sun_Nm = {torque!r}\ntorque_ring_Nm = 1.5\n").points
    assert points is not None
    assert SPEED_SUN.display(points.grid.points.speed_sun[0]) == pytest.approx(900.0, rel=1e-9)


def test_without_losses_nothing_is_lost(tmp_path: Path) -> None:
    points = done(tmp_path, "[losses]\nnone = true\n[point]\nspeed_sun_rpm = 900\ntorque_ring_Nm = 1.5\n").points
    assert points is not None
    assert points.values["efficiency_total"][0] == pytest.approx(1.0)
    assert points.values["loss_total"][0] == pytest.approx(0.0, abs=1e-10)


def test_losses_by_mechanism_make_up_the_total(tmp_path: Path) -> None:
    points = done(tmp_path, SMALL).points
    assert points is not None
    total = points.values["loss_total"]
    np.testing.assert_allclose(sum(points.losses.values()), total, rtol=1e-12)
    np.testing.assert_allclose(points.values["loss_bearings"] + points.values["loss_magnetic"], total)
    chain = next(iter(points.chains.values()))
    np.testing.assert_allclose(chain.unexplained, 0.0, atol=1e-12)


def test_a_load_beyond_pull_out_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"E_s312_l9: .*its pull-out"):
        done(tmp_path, LOSSES + "[grid]\nspeed_sun_rpm = [312]\nload_Nm = [1, 9]\n")


def test_a_response_stands_on_its_point(tmp_path: Path) -> None:
    text = LOSSES + '[point]\nspeed_sun_rpm = 500\ntorque_ring_Nm = 2.3\n[response]\nside = "ring"\npoints = 3\n'
    simulation = done(tmp_path, text)
    assert simulation.answer is not None
    assert simulation.answer.about == "the steady state of [point]"
    assert len(simulation.answer.response.frequency) == 3
    assert any(mode.kind is ModeKind.MAGNETIC for mode in simulation.modes)


# --- what a run may meet -------------------------------------------------------------------------------


def test_a_slipped_pole_is_reported_and_what_came_before_is_written(tmp_path: Path) -> None:
    text = SHORT + "[transient.sun]\nramp = { to_Nm = 4, over_s = 0.2 }\n"
    text += "[transient.ring]\nramp = { to_Nm = 9.9, over_s = 0.2 }\n"
    out = tmp_path / "out"
    result = call("simulate", scenario(tmp_path, text), "--out", out, expect=3)
    run = result["data"]["summary"]["transient"]
    assert "a pole slipped" in run["stopped"]["came"]
    assert run["slips_s"] == [run["ended_s"]]
    assert 0.0 < run["ended_s"] < 0.5
    assert result["findings"][0]["severity"] == "error"
    table = pl.read_csv(out / "transient.csv")
    assert table["time_s"][-1] == run["ended_s"]
    assert abs(table["phase_rad"][-1]) == pytest.approx(np.pi, abs=1e-6)
    recorded = read_recording(out / "transient.mcap").samples
    assert (recorded.height - 1) / 500.0 <= run["ended_s"] < recorded.height / 500.0
    assert "A pole slipped after" in (out / "report.html").read_text()


def test_a_slip_may_be_passed_over(tmp_path: Path) -> None:
    text = SHORT.replace("rtol", 'on_slip = "go on"\nrtol') + "[transient.sun]\nramp = { to_Nm = 4, over_s = 0.2 }\n"
    text += "[output]\nfigures = false\n"
    result = call("simulate", scenario(tmp_path, text), "--out", tmp_path / "out", expect=0)
    assert result["data"]["summary"]["transient"]["stopped"] is None
    assert "slipped" in result["findings"][0]["message"]
    result = call("simulate", scenario(tmp_path, text), "--out", tmp_path / "out", "--fail-on", "findings", expect=1)


def test_an_unstable_torque_loop_is_refused(tmp_path: Path) -> None:
    text = SHORT + "[assumptions]\nderivative_filter = 100.0\n"
    out = tmp_path / "out"
    error = call("simulate", scenario(tmp_path, text), "--out", out, expect=2)["error"]
    assert error["expected"] == "torque loops that decay"
    assert not out.exists()


def test_a_speed_beyond_the_tests_is_remarked(tmp_path: Path) -> None:
    text = LOSSES + "[point]\nspeed_sun_rpm = 3000\ntorque_ring_Nm = 1\n" + FEW
    findings = call("simulate", scenario(tmp_path, text), "--out", tmp_path / "out", expect=0)["findings"]
    assert {finding["where"] for finding in findings} == {"losses"}
    assert "tangent" in findings[0]["message"]


def test_a_torque_that_no_transducer_takes_is_not_recorded(tmp_path: Path) -> None:
    text = LOSSES + "[assumptions]\nmap_scale = 3.0\n[point]\nspeed_sun_rpm = 300\ntorque_ring_Nm = 15\n" + FEW
    result = call("simulate", scenario(tmp_path, text), "--out", tmp_path / "out", expect=3)
    assert "range of the instrument" in result["findings"][0]["message"]
    assert (tmp_path / "out" / "points.csv").is_file()
    assert not list(tmp_path.rglob("*.mcap"))


# --- files ---------------------------------------------------------------------------------------------


def test_the_same_scenario_gives_the_same_bytes(tmp_path: Path) -> None:
    whole = SHORT + "[grid]\nspeed_sun_rpm = [156, 312]\nload_Nm = [0.78]\n[response]\n" + FEW
    drawn = SMALL.replace("figures = false\n", "")
    for name, text in (("whole", whole), ("drawn", drawn)):
        for folder in ("one", "two", "two"):
            call("simulate", scenario(tmp_path, text), "--out", tmp_path / name / folder, expect=0)
        assert contents(tmp_path / name / "one") == contents(tmp_path / name / "two")


def test_a_crate_says_which_scenario_made_the_results(tmp_path: Path) -> None:
    path = scenario(tmp_path, SMALL)
    out = tmp_path / "out"
    call("simulate", path, "--out", out, expect=0)
    entities = {entity["@id"]: entity for entity in json.loads((out / CRATE).read_text(encoding="utf-8"))["@graph"]}
    (action,) = (entity for entity in entities.values() if entity["@type"] == "CreateAction")
    (taken,) = (entities[each["@id"]] for each in action["object"])
    assert (taken["name"], taken["sha256"]) == (path.name, hashlib.sha256(path.read_bytes()).hexdigest())
    assert {each["@id"] for each in action["result"]} == set(contents(out))


def test_only_the_formats_asked_for_are_written(tmp_path: Path) -> None:
    text = SMALL + 'formats = ["csv"]\n'
    call("simulate", scenario(tmp_path, text), "--out", tmp_path / "out", expect=0)
    report = {".html", ".json", ".xlsx"}
    assert {path.suffix for path in (tmp_path / "out").rglob("*") if path.is_file()} == {".csv", *report}


def test_files_of_others_stay_and_old_results_go(tmp_path: Path) -> None:
    out = tmp_path / "out"
    (out / "recordings").mkdir(parents=True)
    (out / "thesis.doc").write_text("years of work")
    (out / "recordings" / "9999.mcap").write_text("not ours")
    call("simulate", scenario(tmp_path, SMALL), "--out", out, expect=0)
    assert len(list((out / "recordings").iterdir())) == 5
    call("simulate", scenario(tmp_path, SMALL.replace("[156, 312]", "[156]")), "--out", out, expect=0)
    assert sorted(path.name for path in (out / "recordings").iterdir()) == ["0000.mcap", "0001.mcap", "9999.mcap"]
    assert (out / "thesis.doc").read_text() == "years of work"


@pytest.mark.parametrize("name", ["points.csv", "report.html", "recordings/0003.mcap", "summary.json"])
def test_a_file_of_another_origin_is_not_written_over(name: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    (out / name).parent.mkdir(parents=True)
    (out / name).write_text("mine")
    error = call("simulate", scenario(tmp_path, SMALL), "--out", out, expect=2)["error"]
    assert error["where"] == str(out / name)
    assert "nothing was changed" in error["do"]
    assert contents(out) == {name: b"mine"}


@pytest.mark.parametrize("after", [1, 3, 8])
def test_an_interrupted_write_leaves_no_half_file(after: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, path = tmp_path / "out", scenario(tmp_path, SMALL)
    call("simulate", path, "--out", tmp_path / "whole", expect=0)
    synced, calls = os.fsync, 0

    def pulled(handle: int) -> None:
        nonlocal calls
        calls += 1
        if calls > after:
            raise KeyboardInterrupt
        synced(handle)

    monkeypatch.setattr("os.fsync", pulled)
    call("simulate", path, "--out", out, expect=130)
    whole = contents(tmp_path / "whole")
    left = contents(out)
    assert all(data == whole[name] for name, data in left.items())
    assert "summary.json" not in left
    monkeypatch.undo()
    call("simulate", path, "--out", out, expect=0)
    assert contents(out) == whole


def test_what_cannot_run_is_told_and_writes_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    path = scenario(tmp_path, SMALL.replace("speed_sun_rpm", "speed_sum_rpm"))
    result = call("simulate", path, "--out", out, expect=2)
    assert result["data"] is None
    assert result["error"]["where"] == f"{path}: line 9, grid.speed_sum_rpm"
    assert "speed_sun_rpm" in result["error"]["do"]
    assert not out.exists()


def test_people_are_told_the_control_check_and_the_results(tmp_path: Path) -> None:
    outcome = RUNNER.invoke(app, ["simulate", str(scenario(tmp_path, SMALL)), "--out", str(tmp_path / "out")])
    assert outcome.exit_code == 0
    assert outcome.stdout.startswith("Torque loops stable with PID")
    assert "4 steady points" in outcome.stdout


def test_a_constant_set_by_hand_is_held_while_the_others_are_calibrated(tmp_path: Path) -> None:
    text = (
        f'[losses]\ngrids = "{ROOT / "raw" / "published"}"\nc = 0.0\n'
        "[point]\nspeed_sun_rpm = 1872\ntorque_ring_Nm = 1.9\n"
    )
    (tmp_path / "held.toml").write_text(text)
    held = gather_inputs(read_scenario(tmp_path / "held.toml"), load_bench()).losses
    (tmp_path / "free.toml").write_text(text.replace("c = 0.0\n", ""))
    free = gather_inputs(read_scenario(tmp_path / "free.toml"), load_bench()).losses
    assert held is not None
    assert free is not None
    assert held.c == 0.0 < free.c
    assert held.b > free.b + 1e-3  # hysteresis takes up what eddy currents may not
