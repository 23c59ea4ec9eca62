"""What a campaign lacks is told, and what two files hold counts once."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.points import joined, measured, points
from tests.recording.writer import CALIBRATION, Bench, write
from tests.store.records import window

from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.compare import run_compare
from pmg.pipeline.commands.ingest_files import ingest
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.files.json_values import PROOF, proven_json
from pmg.pipeline.fit.calibration import calibrate
from pmg.pipeline.fit.common_errors import causes_of_calibration, causes_of_fits
from pmg.pipeline.fit.loss_fit import fit_losses
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.campaign import choose_campaign, measured_grid
from pmg.pipeline.grid.completeness import lack_findings
from pmg.pipeline.grid.copies import COPY, without_copies
from pmg.pipeline.recording.codes import Code, Severity
from pmg.pipeline.recording.findings import Finding
from pmg.pipeline.recording.run_records import RunRecord, Setpoints
from pmg.pipeline.store.manifest import FAILED, Manifest
from pmg.pipeline.store.store import Store
from pmg.pipeline.windows.limits_file import _read_limits
from pmg.sim.bench import load_bench
from pmg.sim.errors import RecordingError
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.mechanisms.thermal import _temperature_rise
from pmg.sim.signals import RPM
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

pytestmark = pytest.mark.usefixtures("undrawn")

SECOND = "2025-04-23T09:00:00Z"
OPTIONS = AnalysisOptions()


def stored(folder: Path, *files: tuple[str, Bench]) -> Path:
    """A store of these recordings."""
    recordings = folder / "r"
    recordings.mkdir()
    for name, bench in files:
        write(recordings / name, bench)
    ingest(recordings, Store(folder / "s"), workers=1)
    return folder / "s"


def both(store: Path, report: Path) -> tuple[Outcome, Outcome]:
    analysed = run_analyse(store, OPTIONS, grids=None, campaign=None)
    return analysed, run_compare(store, report)


@pytest.fixture(scope="module")
def lacking(tmp_path_factory: pytest.TempPathFactory) -> tuple[Outcome, Outcome, Path]:
    """A good run, one rejected, one file that is no recording."""
    folder = tmp_path_factory.mktemp("lacking")
    (folder / "bad").mkdir()
    (folder / "bad" / "notes.mcap").write_text("not a recording")
    ramp = Bench(acceleration=60.0, run={"point": "P2", "started_at": SECOND})
    store = stored(folder, ("a.mcap", Bench()), ("ramp.mcap", ramp))
    ingest(folder / "bad", Store(store), workers=1)
    return *both(store, folder / "report"), folder


def test_analyse_and_compare_tell_of_files_and_windows_that_are_missing(lacking: tuple[Outcome, Outcome, Path]) -> None:
    for outcome in lacking[:2]:
        assert outcome.partial
        told = {finding.where: finding.message for finding in outcome.findings}
        assert told["notes.mcap"].startswith("not usable, so not in the grid")
        assert told["window P2"].startswith("rejected: speed not settled")
    assert "1 of 2 points accepted; 1 of the store's sources not usable" in lacking[0].lines[0]


def test_a_file_that_failed_alone_makes_both_stages_partial(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever else is complete."""
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "notes.mcap").write_text("not a recording")
    store = stored(tmp_path, ("a.mcap", Bench()))
    monkeypatch.setattr("pmg.pipeline.fit.analysis.Analysis.complete", property(lambda _: True))
    assert [outcome.partial for outcome in both(store, tmp_path / "one")] == [False, False]
    ingest(tmp_path / "bad", Store(store), workers=1)
    assert [outcome.partial for outcome in both(store, tmp_path / "two")] == [True, True]


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("N_s+1404_r+540.mcap", "N_s+1404_r+540.mcap is not usable and may be of it by its name"),
        ("0100.mcap", "it may be in what is not usable: 0100.mcap"),
    ],
)
def test_a_hole_is_told_with_the_file_that_may_have_filled_it(file: str, words: str) -> None:
    grid = measured(points("neutral", [100.0], [100.0]), np.ones(1), np.ones(1))
    failed = Manifest("x", file, status=FAILED)
    hole, *others = lack_findings(grid, ["neutral, sun 1404 rpm, ring 540 rpm"], [failed])
    assert hole.message.endswith(words)
    assert [finding.where for finding in others] == [file]
    assert lack_findings(grid, ["neutral, sun 1404 rpm, ring 54 rpm"], [failed])[0].message.count("may be in") == 1
    assert lack_findings(grid, []) == ()


@pytest.mark.parametrize(
    ("run", "cell"),
    [
        ({"configuration": "neutral", "sun": 1404, "ring": 540}, "neutral, sun 1404 rpm, ring 540 rpm"),
        ({"configuration": "engaged", "sun": 600, "load": -1.5}, "engaged, sun 600 rpm, load -1.5 N m"),
        ({"configuration": "neutral", "sun": 1404}, ""),
        ({"configuration": "neutral", "sun": 1404, "ring": 540, "campaign": "other"}, ""),
    ],
)
def test_a_hole_is_told_with_the_unusable_file_that_was_run_there(run: dict[str, Any], cell: str) -> None:
    grid = measured(points("neutral", [100.0], [100.0]), np.ones(1), np.ones(1))
    asked = {"speed_sun": ("sun", RPM), "speed_ring": ("ring", RPM), "torque_ring": ("load", 1.0)}
    setpoints = Setpoints(**{key: run[name] * scale for key, (name, scale) in asked.items() if name in run})
    known = RunRecord(run.get("campaign", grid.campaign), configuration=run["configuration"], setpoints=setpoints)
    failed = Manifest("x", "x.mcap", status=FAILED, run=known)
    hole, other = lack_findings(grid, [cell or "neutral, sun 1404 rpm, ring 540 rpm"], [failed])
    assert hole.message.endswith("x.mcap was run there and is not usable") == bool(cell)
    assert other.message == "not usable, so not in the grid" + (f" at {cell}" if cell else "")


def twice(bench: Bench, **change: Any) -> tuple[Bench, Bench]:  # noqa: ANN401  (any field)
    return bench, replace(bench, **change)


@pytest.mark.parametrize("shorter_first", [False, True])
def test_a_run_in_two_files_is_one_point_and_the_fuller_one_is_kept(tmp_path: Path, *, shorter_first: bool) -> None:
    whole, cut = twice(Bench(seconds=4.0), seconds=2.5)
    names = ("b.mcap", "a.mcap") if shorter_first else ("a.mcap", "b.mcap")
    other = Bench(run={"started_at": SECOND})
    store = stored(tmp_path, (names[0], whole), (names[1], cut), ("repeat.mcap", other))
    grid = measured_grid(*choose_campaign(Store(store), None), load_bench())
    assert len(grid) == 3
    assert grid.accepted.sum() == 2, "a repeat at another time is a point of its own"
    assert grid.reason[~grid.accepted].tolist() == [f"{COPY} {names[0]}"]
    outcome = run_analyse(store, OPTIONS, grids=None, campaign=None)
    assert {f.message for f in outcome.findings} >= {f"rejected: {COPY} {names[0]}"}
    assert outcome.partial


def manifest(identifier: str, **change: Any) -> Manifest:  # noqa: ANN401  (any key)
    started = change.pop("started_at", "2025-04-23T08:00:00+00:00")
    run = RunRecord(started_at=started, point=change.pop("named", "P1"))
    return Manifest(identifier, f"{identifier}.mcap", run=run, windows=(window(**change),))


def verdicts(*manifests: Manifest) -> list[bool]:
    return [window.accepted for each in without_copies(manifests) for window in each.windows]


def test_what_makes_two_windows_one() -> None:
    a = manifest("a")
    assert verdicts(a, manifest("b")) == [True, False]
    assert verdicts(a, manifest("b", stop_sample=1200)) == [False, True]
    assert verdicts(manifest("a", accepted=False), manifest("b", stop_sample=600)) == [False, True]
    assert verdicts(a, manifest("b", started_at=SECOND)) == [True, True]
    assert verdicts(a, manifest("b", point="P2")) == [True, True]
    assert verdicts(a, manifest("b", first_sample=1000, stop_sample=2000)) == [True, True]


def test_runs_that_nobody_named_are_copies_only_where_their_torques_agree() -> None:
    a, b = manifest("a", named="", point="a-01"), manifest("b", named="", point="b-01")
    assert verdicts(a, b) == [True, False]
    other = {"sun": 0.5, "ring": 0.71}
    assert verdicts(a, manifest("b", named="", point="b-01", torque=other)) == [True, True]
    nothing = {"sun": math.nan, "ring": math.nan}
    assert verdicts(a, manifest("b", named="", point="b-01", torque=nothing, accepted=False)) == [True, False]


@settings(max_examples=40)
@given(lengths=st.lists(st.integers(1, 5), min_size=1, max_size=5), order=st.randoms(use_true_random=False))
def test_of_any_copies_one_is_kept_whatever_their_order(lengths: list[int], order: Any) -> None:  # noqa: ANN401
    manifests = [manifest(f"m{i}", stop_sample=1000 * length) for i, length in enumerate(lengths)]
    shuffled = list(manifests)
    order.shuffle(shuffled)
    kept = [m.identifier for m in without_copies(shuffled) if m.windows[0].accepted]
    assert kept == [f"m{int(np.argmax(lengths))}"]
    assert all(m.windows[0].accepted for m in manifests), "what is given stays as it is"


def test_the_nominal_torques_of_the_calibrations_reach_grid_and_findings(tmp_path: Path) -> None:
    rated = CALIBRATION.replace("nominal_torque_Nm = 10.0", "nominal_torque_Nm = 50.0")
    store = stored(tmp_path, ("a.mcap", Bench(calibration=rated, torque={"sun": 0.8, "ring": 1.5})))
    grid = measured_grid(*choose_campaign(Store(store), None), load_bench())
    expected = np.hypot(0.002 * grid.torque_ring, 0.001 * 50.0) / np.sqrt(3.0)
    np.testing.assert_allclose(grid.common_ring, expected, rtol=1e-9)
    for outcome in both(store, tmp_path / "report"):
        told = {f.where: f.message for f in outcome.findings}
        assert "nominal torque of 50 N m; expected 10 N m" in told["transducer of the ring"]
        assert "transducer of the sun" not in told
    assert "nominal torque of 50 N m" in (tmp_path / "report" / "report.html").read_text()


@pytest.mark.parametrize("table", ["frequency_low = 16_000.0", "frequency_low = 9e3\nfrequency_high = 9e3"])
def test_a_frequency_range_of_nothing_is_refused(tmp_path: Path, table: str) -> None:
    path = tmp_path / "limits.toml"
    path.write_text(f"[windows]\n{table}\n", encoding="utf-8")
    with pytest.raises(RecordingError, match="the lower one first"):
        _read_limits(path)
    path.write_text("[windows]\nfrequency_low = 4e3\n", encoding="utf-8")
    assert _read_limits(path).frequency_low == pytest.approx(4e3)


@pytest.mark.parametrize(("code", "accepted"), [(Code.SIMULATED, True), (Code.SATURATED, False)])
def test_only_a_simulated_torque_may_stand_still(tmp_path: Path, code: Code, *, accepted: bool) -> None:
    name, (given,) = choose_campaign(Store(stored(tmp_path, ("a.mcap", Bench()))), None)
    (found,) = given.windows
    sun, ring = (
        replace(shaft, within=math.nan, std=0.0, resolution=math.nan) for shaft in (found.means.sun, found.means.ring)
    )
    means = replace(found.means, sun=sun, ring=ring)
    marks = (Finding(Severity.INFO, "whole file", "marked", "a.mcap", code, ""),)
    given = replace(given, windows=(replace(found, means=means),), findings=marks)
    grid = measured_grid(name, [given], load_bench())
    assert grid.accepted.tolist() == [accepted]
    assert (grid.within_sun[0] == 0.0) == accepted


def test_the_means_of_an_earlier_reduction_are_told(tmp_path: Path) -> None:
    store = stored(tmp_path, ("a.mcap", Bench()), ("b.mcap", Bench(run={"started_at": SECOND})))
    assert not [f for f in run_analyse(store, OPTIONS, grids=None, campaign=None).findings if f.where == "windows"]
    path = next((store / "sources").glob("b-*.json"))
    path.write_bytes(proven_json(json.loads(path.read_text().replace('"reduction": ', '"reduction": 9'))))
    for outcome in both(store, tmp_path / "report"):
        (told,) = [f.message for f in outcome.findings if f.where == "windows"]
        assert told.startswith("1 recording reduced in an earlier way: b.mcap")


def test_a_stored_mean_that_was_changed_costs_its_recording_alone(tmp_path: Path) -> None:
    store = stored(tmp_path, ("a.mcap", Bench()), ("b.mcap", Bench(run={"started_at": SECOND})))
    path = next((store / "sources").glob("b-*.json"))
    document = json.loads(path.read_text())
    document["windows"][0]["means"]["sun"]["torque"] += 1e-3
    path.write_text(json.dumps(document))
    changed = run_analyse(store, OPTIONS, grids=None, campaign=None)
    assert changed.partial
    assert changed.data["analysis"]["points"]["all"] == 1
    (told,) = [f.message for f in changed.findings if f.severity == "error"]
    assert "as pmg wrote it. Ingest its source again" in told
    del document[PROOF]
    path.write_text(json.dumps(document))
    (told,) = [f.message for f in run_analyse(store, OPTIONS, grids=None, campaign=None).findings if f.where == "store"]
    assert "1 recording is unproven: b.mcap" in told


def test_a_rejected_window_without_a_channel_stands_where_it_was_asked_for(tmp_path: Path) -> None:
    """Its readings are no numbers; the points around it are as they would be without it."""
    asked = {"sun_speed_set_rpm": "600", "ring_speed_set_rpm": "300"}
    lean = Bench(without=frozenset({"/daq/encoder_sun/count"}), run={"started_at": SECOND} | asked)
    store = stored(tmp_path, ("a.mcap", Bench()), ("b.mcap", lean))
    grid = measured_grid(*choose_campaign(Store(store), None), load_bench())
    assert grid.accepted.tolist() == [True, False]
    np.testing.assert_allclose(grid.points.speed_sun[1], 600 * RPM)
    assert np.isfinite(grid.points.speed_ring).all()


def test_a_rejected_engaged_window_without_its_load_stands_at_the_load_that_was_asked_for(tmp_path: Path) -> None:
    engaged = {"configuration": "engaged", "drive": "sun", "ring_torque_set_Nm": "1.5"}
    lean = Bench(without=frozenset({"/daq/torque_ring/frequency"}), run=engaged)
    grid = measured_grid(*choose_campaign(Store(stored(tmp_path, ("a.mcap", lean))), None), load_bench())
    assert (grid.points.torque_ring[0], grid.points.load_set[0]) == (1.5, 1.5)
    assert np.isnan(grid.torque_ring[0])


def test_an_unknown_reading_of_a_rejected_window_does_not_reach_the_others() -> None:
    bench = load_bench()
    sun, ring = (a.ravel() for a in np.meshgrid(np.linspace(100, 1800, 6), np.linspace(60, 720, 6)))
    curve = LossCurve((0.0, 0.5, 1.0), np.array([0.02, 0.09, 0.03]), 150.0, 200.0)
    box = Gearbox.calibrated(bench, LossModel(curve, curve, 0.85, 2e-2, 2.2e-4, 0.0))
    speed = np.array([300.0, 900.0, 1800.0])
    exact = steady(box, joined(points("neutral", sun, ring), points("engaged", speed, -speed / 2.6, 1.5, load_set=1.5)))
    grid = measured(exact.points, exact.torque_sun, exact.torque_ring, 1e-3)
    grid = replace(grid, common_sun=np.full(len(grid), 1e-3), common_ring=np.full(len(grid), 1e-3))
    out = np.arange(len(grid)) == 7
    gone = [np.where(out, np.nan, each) for each in (grid.torque_sun, grid.common_sun, grid.u_sun)]
    holed = replace(grid, accepted=~out, torque_sun=gone[0], common_sun=gone[1], u_sun=gone[2])
    fits = fit_losses(holed, (0.0, 0.5, 1.0), (0.0, 0.5, 1.0))
    causes = causes_of_calibration(holed, calibrate(holed, fits, bench), bench)
    assert np.isfinite(causes.moved).all()
    assert np.isfinite(causes_of_fits(holed, fits, bench).moved).all()
    heat = np.where(out, np.nan, 10.0 + np.arange(len(grid)))
    at = replace(grid.points, started_at=np.linspace(0.0, 6000.0, len(grid)))
    rise = _temperature_rise(at, heat, 600.0)
    assert np.isnan(rise[out]).all()
    np.testing.assert_array_equal(rise[~out], _temperature_rise(at[~out], heat[~out], 600.0))
