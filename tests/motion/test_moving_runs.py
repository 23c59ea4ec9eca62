"""Runs in motion: through the ingest into the store, and back sample by sample; bad ones are named."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.motion.moving_bench import (
    COUNT,
    ENGAGED,
    NOISE,
    RATE,
    TIME,
    Floats,
    at_rest,
    counts,
    geared,
    hump,
    moving,
    noise,
    started,
    torques,
)
from tests.recording.writer import Bench, write

from pmg.pipeline.analysis.outputs import read_analysis
from pmg.pipeline.commands.analyse import run_analyse
from pmg.pipeline.commands.ingest import ALONE, run_ingest
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.commands.runs import run_list, run_show
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.campaign import choose_campaign, measured_grid
from pmg.pipeline.motion.run import MovingRun
from pmg.pipeline.motion.smooth import smooth
from pmg.pipeline.motion.stored import moving_runs
from pmg.pipeline.recording.read import read_recording
from pmg.pipeline.store.store import Store
from pmg.sim.bench import BenchParameters
from pmg.sim.errors import StoreError

Count = npt.NDArray[np.int64]
STEADY: dict[str, Any] = {"campaign": "moving", "configuration": "neutral"}


def ingested(folder: Path) -> tuple[Store, Outcome]:
    """The recordings of a folder in a store next to it."""
    store = folder.with_name(f"{folder.name}-store")
    return Store(store), run_ingest(folder, store, ALONE)


def one(
    tmp_path: Path,
    **kind: Any,  # noqa: ANN401 - as `moving` takes them
) -> tuple[dict[str, MovingRun], Outcome, dict[str, Any]]:
    """A bad run next to a sound one: the runs that came back, the outcome, the manifest of the bad one."""
    folder = tmp_path / "in"
    folder.mkdir()
    moving(folder / "sound.mcap", speeds={"ring": hump(20.0)}, run=started(1))
    run = started(2) | kind.pop("run", {})
    path = moving(folder / "bad.mcap", run=run, **kind)
    store, outcome = ingested(folder)
    manifest = next((store.path / "sources").glob(f"{path.stem}-*.json"))
    runs = {found.point: found for found in moving_runs(store)}
    assert "sound" in runs
    assert not np.isnan([*runs["sound"].torque, *runs["sound"].angle]).any()
    return runs, outcome, json.loads(manifest.read_bytes())


def codes(manifest: dict[str, Any]) -> dict[str, str]:
    return {finding["code"]: finding["severity"] for finding in manifest["findings"]}


def test_a_run_comes_back_sample_by_sample(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    moving(folder / "b.mcap", "coast", run=started(2), steps=((0, "START"), (0, "RAMP"), (600, "COAST"), (1400, "END")))
    moving(folder / "a.mcap", "steps", geared(), run=ENGAGED | started(3))
    at_rest(folder / "z.mcap", 1)
    store, outcome = ingested(folder)
    assert not outcome.partial
    assert not outcome.findings
    assert outcome.lines == (
        "ingested 3, already there 0, not usable 0; 1 window, 0 rejected",
        "2 runs in motion, 0 set aside",
    )
    zero, coast, steps = moving_runs(store, "moving")
    assert [str(run.manoeuvre) for run in (zero, coast, steps)] == ["zero", "coast", "steps"]
    assert [(run.turns.sun, run.turns.ring) for run in (zero, coast, steps)] == [
        (False, False),
        (True, False),
        (True, True),
    ]
    n = 1400
    assert [(p.name, p.first_sample, p.stop_sample) for p in coast.phases] == [("RAMP", 0, 600), ("COAST", 600, n)]
    assert coast.rate == RATE
    assert coast.count.sun == pytest.approx(COUNT)
    assert coast.started_at.isoformat() == "2025-06-03T08:02:00+00:00"
    for side in ("sun", "ring"):
        np.testing.assert_allclose(coast.torque[side], torques(side)[:n], atol=1e-9)
    np.testing.assert_allclose(coast.angle.sun, counts(hump(60.0))[:n] * COUNT, atol=1e-9)
    assert np.ptp(coast.angle.ring) == 0.0
    assert (steps.file, str(steps.configuration), steps.gear, steps.drive) == ("a.mcap", "engaged", 1, "sun")
    np.testing.assert_allclose(zero.torque.sun, noise("sun")[:-1], atol=1e-9)


def test_the_manifest_states_the_run_and_vouches_for_its_samples(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    moving(folder / "a.mcap", "sweep", geared(), run=ENGAGED)
    store, _ = ingested(folder)
    (path,) = (store.path / "sources").glob("*.json")
    manifest = json.loads(path.read_bytes())
    assert manifest["run"]["manoeuvre"] == "sweep"
    assert manifest["windows"] == []
    (record,) = manifest["moving"]
    assert (record["first_sample"], record["stop_sample"]) == (0, len(TIME) - 1)
    assert record["turns"] == {"sun": True, "ring": True}
    assert record["speed"]["sun"]["highest"] == pytest.approx(60.0, rel=0.01)
    assert record["acceleration"]["sun"]["lowest"] == pytest.approx(-np.pi / 3.0 * 60.0, rel=0.02)
    assert (manifest["rate_hz"], manifest["calibration"]["counts_per_rev_sun"]) == (RATE, 5120)
    (samples,) = (store.path / "runs").glob("*.parquet")
    samples.write_bytes(samples.read_bytes()[:-1] + b"x")
    with pytest.raises(StoreError):
        moving_runs(store)


def test_two_files_of_one_run_count_once(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    moving(folder / "a.mcap")
    moving(folder / "again.mcap", host=(5, 9), run={"point": "a"}, steps=())
    (folder / "again.mcap").rename(folder / "b.mcap")
    store, _ = ingested(folder)
    assert len(moving_runs(store)) == 1


def after(sample: int, change: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The samples from one on, changed."""
    return lambda values: np.concatenate((values[:sample], change(values[sample:])))


def frozen(first: int, stop: int, *, behind: bool) -> Callable[[Any], Any]:
    """A counter that stands still, and lags from then on where it lost its counts."""

    def stand(values: Count) -> Count:
        stood = values.copy()
        stood[first:stop] = values[first]
        if behind:
            stood[stop:] -= values[stop] - values[first]
        return stood

    return stand


def test_a_ramp_in_which_nothing_moves_is_set_aside(tmp_path: Path) -> None:
    runs, outcome, manifest = one(tmp_path, speeds={})
    assert codes(manifest) == {"motion.none": "error"}
    assert manifest["moving"][0]["reasons"]
    assert "bad" not in runs
    assert outcome.partial
    assert outcome.data["set_aside"] == 1


@pytest.mark.parametrize("behind", [False, True], ids=["reads on", "lost counts"])
def test_a_counter_that_stands_still_is_masked(tmp_path: Path, *, behind: bool) -> None:
    runs, _, manifest = one(tmp_path, count={"sun": frozen(900, 960, behind=behind)})
    assert codes(manifest) == {"motion.angle_lost": "error"}
    known = np.isfinite(runs["bad"].angle.sun)
    assert not known[902:958].any()
    assert known[:900].all()
    assert known[962:].all() != behind
    assert np.isfinite(runs["bad"].torque.sun).all()


def test_an_angle_that_jumps_is_kept_on_its_longer_side(tmp_path: Path) -> None:
    runs, _, manifest = one(tmp_path, count={"sun": after(500, lambda values: values + 200)})
    assert codes(manifest) == {"motion.angle_lost": "error"}
    known = np.isfinite(runs["bad"].angle.sun)
    assert np.array_equal(known, np.arange(len(known)) >= 500)


def test_a_gap_in_the_angle_stays_a_gap(tmp_path: Path) -> None:
    runs, _, manifest = one(tmp_path, drop={"/daq/encoder_sun/count": (700, 800)})
    assert "samples.gap" in codes(manifest)
    known = np.isfinite(runs["bad"].angle.sun)
    assert np.array_equal(np.flatnonzero(~known), np.arange(700, 800))
    np.testing.assert_allclose(runs["bad"].angle.sun[800:], counts(hump(60.0))[800:-1] * COUNT, atol=1e-9)


def test_a_torque_at_its_end_is_masked(tmp_path: Path) -> None:
    runs, _, manifest = one(tmp_path, torque={"sun": lambda values: np.minimum(values, 0.095)})
    assert codes(manifest)["motion.torque_clipped"] == "error"
    left_out = np.isnan(runs["bad"].torque.sun)
    assert left_out.sum() > 50
    assert np.all(torques("sun")[:-1][left_out] > 0.095)


PULSES = np.arange(203, 1400, 120)
"""Samples at which a torque spikes."""


def spiking(values: Floats) -> Floats:
    """A torque with a spike at each of `PULSES`."""
    spoiled = values.copy()
    spoiled[PULSES] += 0.6
    return spoiled


def test_spikes_are_named_and_bridged(tmp_path: Path) -> None:
    runs, _, manifest = one(tmp_path, torque=dict.fromkeys(("sun", "ring"), spiking))
    assert codes(manifest) == {"motion.torque_spikes": "warning"}
    of_sun, of_ring = (finding["message"] for finding in manifest["findings"])
    assert of_sun.startswith("10 spikes of up to 0.")
    assert "motor" in of_sun
    assert "held" in of_ring
    masked = manifest["moving"][0]["masked"]
    for side in ("sun", "ring"):
        assert [m["first_sample"] for m in masked if m["column"] == f"torque_{side}"] == PULSES.tolist()
        between = np.delete(np.arange(len(TIME) - 1), PULSES)
        np.testing.assert_allclose(runs["bad"].torque[side][between], torques(side)[between], atol=1e-9)
    rows, sound = (smooth(each).measured.sun for each in (runs["bad"], runs["sound"]))
    assert np.abs(rows - sound).max() < NOISE


def test_spikes_of_a_zero_check_are_bridged(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    still = {side: np.zeros(len(TIME)) for side in ("sun", "ring")}
    noisy = {"sun": lambda _: spiking(noise("sun")), "ring": lambda _: noise("ring")}
    moving(folder / "z.mcap", "zero", still, run={"configuration": "zero"}, torque=noisy)
    moving(folder / "a.mcap", run=started(1))
    zero = moving_runs(ingested(folder)[0])[0]
    assert str(zero.manoeuvre) == "zero"
    assert np.ptp(zero.torque.sun) < 10.0 * NOISE
    np.testing.assert_allclose(zero.torque.ring, noise("ring")[:-1], atol=1e-9)


def test_a_torque_beyond_its_transducer_is_masked(tmp_path: Path) -> None:
    runs, _, manifest = one(tmp_path, torque={"sun": after(1400, lambda values: values + 6.0)})
    assert "torque.out_of_band" in codes(manifest)
    assert np.isnan(runs["bad"].torque.sun[1400:]).all()
    assert np.isfinite(runs["bad"].torque.sun[:1400]).all()


def test_a_run_of_which_little_is_left_is_set_aside(tmp_path: Path) -> None:
    runs, _, manifest = one(tmp_path, torque={"sun": after(400, lambda values: values + 6.0)})
    assert codes(manifest)["motion.too_little"] == "error"
    assert "bad" not in runs


def test_a_gear_that_slips_is_known_up_to_its_slip(tmp_path: Path) -> None:
    slip = geared()
    slip["ring"] = np.where(TIME > 2.0, slip["ring"] * np.exp((2.0 - TIME) / 0.05), slip["ring"])
    runs, _, manifest = one(tmp_path, speeds=slip, run=ENGAGED)
    assert codes(manifest) == {"motion.poles_slipped": "error"}
    for signal in (*runs["bad"].torque, *runs["bad"].angle):
        (unknown,) = np.nonzero(np.isnan(signal))
        assert 900 < unknown[0] <= 1000
        assert np.array_equal(unknown, np.arange(unknown[0], len(signal)))


FAST = 5.0
"""Times the usual speed: a ratio tells over some twenty turns."""


def test_an_engaged_run_of_another_ratio_or_gear_is_set_aside(tmp_path: Path) -> None:
    turning = {side: speed * FAST for side, speed in geared().items()}
    turning["ring"] = 1.1 * turning["ring"]
    runs, _, manifest = one(tmp_path, speeds=turning, run=ENGAGED)
    (told,) = manifest["findings"]
    assert told["code"] == "motion.other_gear"
    assert "the ratio 2.364 throughout; expected 2.6 of gear 1" in told["message"]
    assert "bad" not in runs
    shown = "\n".join(run_show(tmp_path / "in-store", "bad.mcap").lines)
    assert re.search(r"judged +set aside: motion.other_gear: the speeds have the ratio 2.364", shown)
    assert "speed_sun " in shown
    assert "window" not in shown
    listed = run_list(tmp_path / "in-store", "manoeuvre = 'ramp' and accepted is not true")
    (row,) = listed.data["runs"]
    assert row["file"] == "bad.mcap"
    assert listed.lines[0].split()[:4] == ["point", "configuration", "drive", "manoeuvre"]
    assert "sun_rpm" not in listed.lines[0], "no run in motion has a mean"
    (long,) = run_list(tmp_path / "in-store", "reasons like 'motion.other_gear%'", columns="seconds").data["runs"]
    assert long["seconds"] == pytest.approx(TIME[-1], abs=0.01)
    with pytest.raises(StoreError, match="steady points"):
        read_analysis(tmp_path / "in-store")
    run_ingest(tmp_path / "in", tmp_path / "other", replace(ALONE, machine="thesis-gear-2"))
    found = [f.message for m in Store(tmp_path / "other").manifests() for f in m.findings]
    assert [each.partition(". The")[0] for each in found] == [
        "declared engaged in gear 1; expected gear 2 of this machine"
    ]


@pytest.mark.parametrize("still", ["sun", "ring"])
def test_a_run_in_which_a_shaft_rests_is_not_taken_for_one_of_another_gear(tmp_path: Path, still: str) -> None:
    turning = {side: speed * FAST * (side != still) for side, speed in geared().items()}
    _, _, manifest = one(tmp_path, speeds=turning, run=ENGAGED)
    assert "motion.other_gear" not in codes(manifest)


def test_without_its_end_a_run_lasts_to_the_end_of_the_file(tmp_path: Path) -> None:
    runs, _, manifest = one(tmp_path, steps=((0, "START"), (10, "RAMP")))
    assert codes(manifest) == {"motion.end_missing": "warning"}
    assert len(runs["bad"].torque.sun) == len(TIME) - 10


@pytest.mark.parametrize(
    "steps",
    [
        ((0, "RAMP"), (100, "START"), (1400, "END")),
        ((0, "START"), (100, "END"), (1400, "RAMP")),
        ((0, "START"), (0, "COAST"), (1400, "END")),
        ((0, "START"), (0, "MEASURE"), (1400, "END")),
    ],
    ids=["start late", "end early", "another manoeuvre", "steady"],
)
def test_phases_out_of_order_set_a_run_aside(tmp_path: Path, steps: tuple[tuple[int, str], ...]) -> None:
    runs, _, manifest = one(tmp_path, steps=steps)
    assert codes(manifest) == {"motion.phases": "error"}
    assert "expected START, RAMP, END" in manifest["findings"][0]["message"]
    assert "bad" not in runs


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        ({"manoeuvre": "rump"}, "Taken as 'steady'"),
        ({"manoeuvre": "zero"}, "Taken as 'steady'"),
        ({"configuration": "zero"}, "expected 'zero'"),
    ],
    ids=["unknown", "zero in neutral", "ramp at rest"],
)
def test_a_manoeuvre_that_cannot_be_is_told(tmp_path: Path, run: dict[str, str], expected: str) -> None:
    recording = read_recording(moving(tmp_path / "a.mcap", run=run))
    (finding,) = [f for f in recording.findings if f.where == "pmg.run.manoeuvre"]
    assert finding.severity == "warning"
    assert expected in finding.message
    assert not recording.run.manoeuvre.moves


def test_a_steady_run_may_say_so_and_may_name_its_ramps(tmp_path: Path) -> None:
    steps: Any = ((0, "P1", "START", {}), (0, "P1", "RAMP", {}), (200, "P1", "MEASURE", {}), (900, "P1", "END", {}))
    kinds: tuple[tuple[str, dict[str, str], Any], ...]
    kinds = ("plain", {}, (steps[0], *steps[2:])), ("said", {"manoeuvre": "steady"}, steps)
    for name, run, listed in kinds:
        folder = tmp_path / name
        folder.mkdir()
        write(folder / "a.mcap", Bench(run=run, steps=listed, speed={"sun": 600.0, "ring": 0.0}))
        assert not ingested(folder)[1].findings
    plain, said = (
        json.loads(next((tmp_path / f"{name}-store/sources").glob("*.json")).read_bytes()) for name in ("plain", "said")
    )
    assert plain["windows"] == said["windows"]
    assert "moving" not in said
    assert "manoeuvre" not in said["run"]


def test_steady_points_are_analysed_as_without_the_runs_in_motion(tmp_path: Path, bench: BenchParameters) -> None:
    grids = []
    for name in ("alone", "mixed"):
        folder = tmp_path / name
        folder.mkdir()
        for number, speed in enumerate((300.0, 600.0, 900.0)):
            run = STEADY | {"point": f"P{number}"} | started(number)
            write(folder / f"{number}.mcap", Bench(run=run, speed={"sun": speed, "ring": 0.0}))
        if name == "mixed":
            moving(folder / "ramp.mcap", run=started(10))
        store, _ = ingested(folder)
        grids.append(measured_grid(*choose_campaign(store, None), bench))
    assert len(grids[0]) == 3
    assert np.array_equal(grids[0].torque_sun, grids[1].torque_sun)
    assert np.array_equal(grids[0].accepted, grids[1].accepted)


def test_a_campaign_in_motion_alone_has_no_grid_to_analyse(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    moving(folder / "a.mcap", run=started(1))
    at_rest(folder / "z.mcap", 2)
    store, _ = ingested(folder)
    outcome = run_analyse(store.path, AnalysisOptions(), grids=None, campaign=None)
    assert outcome.lines == (
        "campaign moving: no steady point, so no grid to analyse; the comparison ('pmg compare') diagnoses its 1 run "
        "in motion",
    )
    assert not outcome.partial
