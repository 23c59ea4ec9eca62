"""A magnetic gear that is not the thesis's, from recordings to losses, by its machine file; and without it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from tests.machine.campaign import CORRECTION, CURVE, truth_of, write_campaign
from tests.machine.gears import gear_file
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.diagnosis.design.plans import possible_plans
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.magnetic import bench_of
from pmg.pipeline.preflight.found import Asked, File
from pmg.pipeline.preflight.unlike_machine import unlike_the_machine
from pmg.pipeline.recording.run_records import Setpoints
from pmg.sim.bench import load_bench
from pmg.sim.mechanisms import Experiment
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.sim.grid import Grid

pytestmark = pytest.mark.usefixtures("undrawn")

RUNNER = CliRunner()


def call(*arguments: object, expect: int = 0) -> dict[str, Any]:
    outcome = RUNNER.invoke(app, [*map(str, arguments), "--json"])
    assert outcome.exit_code == expect, outcome.stderr or outcome.stdout
    result: dict[str, Any] = json.loads(outcome.stdout)
    return result


def told(result: dict[str, Any]) -> str:
    return " | ".join(f"{one['where']}: {one['message']}" for one in result["findings"])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Grid]:
    """Folder with the machine file, recordings, and a store of them by the file; the exact torques."""
    folder = tmp_path_factory.mktemp("other")
    machine = gear_file(folder)
    bench = bench_of(read_machine(machine))
    truth = truth_of(bench)
    write_campaign(truth, bench, folder / "recordings")
    (folder / "found.json").write_text(json.dumps(call(*_ingest(folder, "store"), "--machine", machine)))
    return folder, truth


def _ingest(folder: Path, store: str) -> tuple[object, ...]:
    return "ingest", folder / "recordings", "--store", folder / store, "--workers", 2


def test_its_losses_are_found_by_its_file(recorded: tuple[Path, Grid]) -> None:
    folder, truth = recorded
    ingested = json.loads((folder / "found.json").read_text())
    assert (ingested["data"]["rejected"], ingested["data"]["contradictions"]) == (0, 0)
    assert "taken from the thesis bench: " in told(ingested)
    analysed = call("analyse", "--store", folder / "store")
    assert "nominal torque" not in told(analysed)
    losses = pd.read_csv(folder / "store" / "analysis" / "losses.csv").set_index("point")
    at = truth.points
    for i in np.flatnonzero(at.engaged):
        row = losses.loc[str(at.name[i])]
        speed = {side: getattr(at, f"speed_{side}")[i] for side in SIDES}
        total = sum(getattr(truth, f"torque_{side}")[i] * speed[side] for side in SIDES)
        drags = [CORRECTION * abs(float(CURVE.torque(np.array([w]))[0]) * w) for w in speed.values()]
        assert row.loss_total_W == pytest.approx(total, abs=0.1 + 0.01 * total)
        assert row.loss_bearings_W == pytest.approx(sum(drags), rel=0.08)


def test_without_its_file_the_ratio_is_told(recorded: tuple[Path, Grid]) -> None:
    folder, truth = recorded
    found = call(*_ingest(folder, "bare"), expect=3)
    assert found["data"]["contradictions"] == int(truth.points.engaged.sum())
    assert "declared engaged in gear 1 (2.600), but the speeds have the ratio 2.750" in told(found)
    assert "need its file (--machine)" in told(found)
    analysed = call("analyse", "--store", folder / "bare", expect=3)
    assert "nominal torque of 10 N m; expected 5 N m of the machine" in told(analysed)


def test_a_store_keeps_to_its_machine(recorded: tuple[Path, Grid], tmp_path: Path) -> None:
    folder, _ = recorded
    assert (folder / "store" / "machine.toml").read_bytes() == (folder / "gear.toml").read_bytes()
    again = call(*_ingest(folder, "store"))
    assert again["data"]["ingested"] == 0
    other = gear_file(tmp_path, ("pole_pairs_output = { value = 11", "pole_pairs_output = { value = 12"))
    for words in (_ingest(folder, "store"), ("analyse", "--store", folder / "store")):
        refused = call(*words, "--machine", other, expect=2)
        assert "another machine" in refused["error"]["came"]
        assert "Gear of 4 and 11 pole pairs" in refused["error"]["expected"]


def test_a_changed_copy_of_the_machine_is_refused(recorded: tuple[Path, Grid], tmp_path: Path) -> None:
    folder, _ = recorded
    one = folder / "recordings" / "031.mcap"
    store = tmp_path / "store"
    call("ingest", one, "--store", store, "--machine", folder / "gear.toml")
    copy = store / "machine.toml"
    copy.write_text(copy.read_text().replace("value = 22", "value = 23"))
    assert (
        "the machine that the store was made with" in call("analyse", "--store", store, expect=2)["error"]["expected"]
    )
    copy.unlink()
    assert call("analyse", "--store", store, expect=2)["error"]["came"] == "gone"


def test_a_run_with_its_file_goes_the_usual_way(recorded: tuple[Path, Grid], tmp_path: Path) -> None:
    """From ingest to report, the machine named by the option or in a campaign file."""
    folder, _ = recorded
    (tmp_path / "few").mkdir()
    for name in ("000", "031"):
        (tmp_path / "few" / f"{name}.mcap").write_bytes((folder / "recordings" / f"{name}.mcap").read_bytes())
    (tmp_path / "campaign.toml").write_text(f'[recordings]\npath = "few"\nmachine = "{folder.as_posix()}/gear.toml"\n')
    for store, words in (("a", (tmp_path / "few", "--machine", folder / "gear.toml")), ("b", ())):
        config = ("--config", tmp_path / "campaign.toml")
        done = call("run", *words, *config, "--store", tmp_path / store, "--report", tmp_path / "report", expect=3)
        assert done["data"]["ingest"]["contradictions"] == 0
        assert (tmp_path / store / "machine.toml").is_file()
    doctor = call("doctor", folder / "recordings", "--machine", folder / "gear.toml")
    assert doctor["data"]["usable"] == doctor["data"]["recordings"]
    assert "--machine" not in told(doctor)
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert "Gear of 4 and 11 pole pairs" in page
    assert "taken from the thesis bench: " in page
    bare = told(call("doctor", folder / "recordings"))
    assert "10 engaged points in gear 1 have speeds in the ratio 2.750; expected 2.600 of gear 1" in bare
    assert "43 recordings state a nominal torque of 20 N m; expected 10 N m" in bare


def test_no_stage_that_it_lacks_is_proposed(recorded: tuple[Path, Grid]) -> None:
    folder, truth = recorded
    for bench, others in ((bench_of(read_machine(folder / "gear.toml")), 0), (load_bench(), 2)):
        plans = possible_plans(truth.points, bench)
        assert sum(plan.experiment is Experiment.OTHER_STAGE for plan in plans) == others
        for plan in plans:
            at = plan.points[plan.points.engaged & (plan.points.gear == 1)]
            np.testing.assert_allclose(at.speed_sun, -bench.gear1.ratio * at.speed_ring)


def test_a_stage_that_the_machine_lacks_is_told(recorded: tuple[Path, Grid], tmp_path: Path) -> None:
    folder, truth = recorded
    few, machine = np.flatnonzero(truth.points.engaged)[:2], folder / "gear.toml"
    write_campaign(truth[few], bench_of(read_machine(machine)), tmp_path / "recordings", gear=2)
    found = call(*_ingest(tmp_path, "store"), "--machine", machine, expect=3)
    assert "declared engaged in gear 2; expected gear 1 (2.750) of this machine" in told(found)
    assert "2 engaged points in gear 2" in told(call("doctor", tmp_path / "recordings", "--machine", machine))
    scenario = tmp_path / "scenario.toml"
    scenario.write_text("[bench]\ngear = 2\n[losses]\nnone = true\n[point]\nspeed_sun_rpm = 300\ntorque_ring_Nm = 1\n")
    refused = call("simulate", scenario, "--out", tmp_path / "out", "--machine", machine, expect=2)
    assert refused["error"]["expected"] == "1, the stage of the machine"


def test_the_plan_of_a_campaign_keeps_to_the_ratio(recorded: tuple[Path, Grid]) -> None:
    """A sun that turns 1.5 or 12 times as fast as the ring is not gear 1 of the thesis."""
    _, truth = recorded
    engaged = truth.points.engaged
    for ratio in (1.5, 12.0):
        at = truth.points[engaged]
        asked = [
            Asked("c", "a.mcap", str(name), "engaged", "sun", 1, Setpoints(speed, -speed / ratio, 1.0), 0.0)
            for name, speed in zip(at.name, at.speed_sun, strict=True)
        ]
        (remark,) = unlike_the_machine([File("a.mcap", 1, tuple(asked))], load_bench())
        assert f"speeds in the ratio {ratio:.3f}; expected 2.600 of gear 1 and 1.571 of gear 2" in remark.message
