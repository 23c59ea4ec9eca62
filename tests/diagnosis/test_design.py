"""What a campaign can tell apart, from its points alone."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.conftest import ROOT
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.design import run_design
from pmg.pipeline.diagnosis.design.audit import audit_design
from pmg.pipeline.diagnosis.design.plans import possible_plans
from pmg.pipeline.diagnosis.engine.catalogue import MARGIN
from pmg.pipeline.diagnosis.engine.separation import power_to_separate
from pmg.pipeline.simulate.inputs import loss_model
from pmg.pipeline.simulate.planned import planned_floor, planned_grid
from pmg.pipeline.simulate.scenario_file import read_scenario
from pmg.sim.bench import BenchParameters
from pmg.sim.errors import BenchError

PLANS = ROOT / "raw" / "plans"


@pytest.fixture(scope="module")
def audits() -> dict[str, dict[str, object]]:
    return {name: run_design(PLANS / f"{name}.toml", None).data for name in ("thesis", "extended")}


def row(audit: dict[str, object], identifier: str, shaft: str) -> dict[str, float]:
    rows = audit["mechanisms"]
    assert isinstance(rows, list)
    return next(row for row in rows if (row["id"], row["shaft"]) == (identifier, shaft))


def pairs(audit: dict[str, object]) -> list[frozenset[str]]:
    alike = audit["look_alikes"]
    assert isinstance(alike, list)
    return [frozenset(pair["ids"]) for pair in alike]


def test_gain_error_and_load_friction_look_alike_under_one_way_flow_only(audits: dict[str, dict[str, object]]) -> None:
    twins = frozenset(("torque_gain_error", "load_dependent_bearing_friction"))
    assert twins in pairs(audits["thesis"])
    assert twins not in pairs(audits["extended"])
    apart = audits["extended"]["told_apart"]
    assert isinstance(apart, list)
    assert max(pair["correlation"] for pair in apart if frozenset(pair["ids"]) == twins) < 0.8
    alike = audits["thesis"]["look_alikes"]
    assert isinstance(alike, list)
    test = next(pair for pair in alike if frozenset(pair["ids"]) == twins)
    assert test["correlation"] == pytest.approx(1.0, abs=1e-3)
    assert "ring motor driving" in test["test"]
    assert test["power"] > 0.95


def test_which_shaft_a_gain_error_sits_on_cannot_be_told(audits: dict[str, dict[str, object]]) -> None:
    for audit in audits.values():
        assert frozenset(("torque_gain_error",)) in pairs(audit)
        alike = audit["look_alikes"]
        assert isinstance(alike, list)
        assert not any("both" in pair["shafts"] for pair in alike if len(set(pair["ids"])) == 1)


def test_the_other_stage_tells_a_gain_error_from_crosstalk(audits: dict[str, dict[str, object]]) -> None:
    alike = audits["extended"]["look_alikes"]
    assert isinstance(alike, list)
    twins = {"torque_gain_error", "torque_crosstalk"}
    test = next(pair for pair in alike if set(pair["ids"]) == twins)
    assert "stage 2" in test["test"]
    assert test["power"] > 0.15


def test_every_pair_that_can_be_seen_is_called_alike_or_apart_once(audits: dict[str, dict[str, object]]) -> None:
    for audit in audits.values():
        rows, apart = audit["mechanisms"], audit["told_apart"]
        assert isinstance(rows, list)
        assert isinstance(apart, list)
        seen = {row["id"] for row in rows if row["seen"]}
        named = [pair for pair in pairs(audit) if len(pair) == 2]
        named += [pair for pair in (frozenset(p["ids"]) for p in apart) if len(pair) == 2]
        assert len(named) == len(set(named)) == len(seen) * (len(seen) - 1) // 2
        assert all(0.0 <= pair["correlation"] < 0.95 for pair in apart)


def test_rounding_decides_neither_which_pair_is_named_nor_the_order(bench: BenchParameters) -> None:
    file = read_scenario(PLANS / "extended.toml", "a plan")
    plan, model = file.table.plan, loss_model(file, bench)
    assert plan is not None
    assert model is not None
    grid, floor = planned_grid(plan, bench), planned_floor(plan)
    told = []
    for by in (1.0, 1.0 - 1e-12, 1.0 + 3e-12):
        noise = replace(
            floor, sun=replace(floor.sun, u=floor.sun.u * by), ring=replace(floor.ring, u=floor.ring.u * by)
        )
        audit = audit_design(grid, bench, model, noise)
        told.append([(pair.one, pair.other) for pair in (*audit.alike, *audit.apart)])
    assert told[0] == told[1] == told[2]


def test_what_a_free_baseline_swallows_is_said_by_name(audits: dict[str, dict[str, object]]) -> None:
    for audit in audits.values():
        for identifier, shaft in (("windage", "sun"), ("engaged_dry_friction", "ring"), ("eddy_skin_effect", "both")):
            assert not row(audit, identifier, shaft)["seen"]
            assert row(audit, identifier, shaft)["absorbed"] > 0.99


def test_repeats_and_random_order_uncover_slow_changes(audits: dict[str, dict[str, object]]) -> None:
    for identifier, shaft in (("torque_zero_drift", "sun"), ("lubricant_viscosity", "ring")):
        before, after = (row(audits[name], identifier, shaft) for name in ("thesis", "extended"))
        assert after["size_50_Nm"] < 0.6 * before["size_50_Nm"]


def test_a_zero_offset_needs_zero_checks_or_reversed_rotation(audits: dict[str, dict[str, object]]) -> None:
    assert not row(audits["thesis"], "torque_zero_offset", "sun")["seen"]
    assert row(audits["extended"], "torque_zero_offset", "sun")["seen"]


def test_more_noise_hides_in_proportion(tmp_path: Path) -> None:
    text = (PLANS / "extended.toml").read_text().replace("../published", str(ROOT / "raw" / "published"))
    (tmp_path / "loud.toml").write_text(text.replace("= 0.001 ", "= 0.003 ").replace("_Nm = 0.001\n", "_Nm = 0.003\n"))
    quiet, loud = (run_design(path, None).data for path in (PLANS / "extended.toml", tmp_path / "loud.toml"))
    for shaft in ("sun", "ring"):
        small, large = (row(audit, "torque_gain_error", shaft)["size_50_Nm"] for audit in (quiet, loud))
        assert large == pytest.approx(3.0 * small, rel=1e-3)


@pytest.mark.parametrize("order", ["random", "rising", "falling"])
def test_a_plan_runs_every_point_once_in_its_order(order: str, bench: BenchParameters, tmp_path: Path) -> None:
    text = (PLANS / "thesis.toml").read_text().replace("../published", str(ROOT / "raw" / "published"))
    (tmp_path / "plan.toml").write_text(text.replace('"falling"', f'"{order}"'))
    plan = read_scenario(tmp_path / "plan.toml").table.plan
    assert plan is not None
    at = planned_grid(plan, bench).points
    assert len(at) == 16 * 13 - 1 + 48
    assert (np.diff(at.started_at) > 0.0).all()
    speed = np.abs(at.speed_sun[at.neutral])
    assert {"random": not (np.diff(speed) >= 0).all(), "rising": (np.diff(speed) >= 0).all()}.get(
        order, (np.diff(speed) <= 0).all()
    )


def test_the_power_to_separate_grows_with_distance() -> None:
    powers = [power_to_separate(distance) for distance in (0.0, 1.0, MARGIN, 40.0, 1e3)]
    assert powers[0] == 0.0
    assert powers[2] == pytest.approx(0.5)
    assert powers == sorted(powers)
    assert powers[-1] > 0.999


def test_plans_come_after_the_campaign_and_keep_to_its_speeds(bench: BenchParameters) -> None:
    plan = read_scenario(PLANS / "thesis.toml").table.plan
    assert plan is not None
    at = planned_grid(plan, bench).points
    for possible in possible_plans(at, bench):
        assert possible.points.started_at.min() > at.started_at.max()
        assert np.abs(possible.points.speed_sun).max() <= np.abs(at.speed_sun).max() * (1.0 + 1e-9)
        assert possible.seconds > 0.0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (("[plan]", "[plans]"), "unknown key"),
        (('order = "falling"', 'order = "up"'), "'random', 'rising' or 'falling'"),
        (("engaged_load_Nm = [0.78, 1.17, 1.56, 1.95]", ""), "engaged speeds without loads"),
        (('order = "falling"', "repeats = -1"), "repeats"),
    ],
)
def test_a_plan_that_is_none_is_refused(change: tuple[str, str], told: str, tmp_path: Path) -> None:
    text = (PLANS / "thesis.toml").read_text().replace("../published", str(ROOT / "raw" / "published"))
    (tmp_path / "plan.toml").write_text(text.replace(*change))
    with pytest.raises(BenchError, match=told):
        run_design(tmp_path / "plan.toml", None)


def test_the_command_prints_json_and_refuses_without_input(tmp_path: Path) -> None:
    done = CliRunner().invoke(
        app, ["design", str(PLANS / "thesis.toml"), "--report", str(tmp_path / "report"), "--json"]
    )
    assert done.exit_code == 0
    document = json.loads(done.stdout)
    assert document["data"]["points"] == 255
    assert (tmp_path / "report" / "report.html").is_file()
    refused = CliRunner().invoke(app, ["design", "--json"])
    assert refused.exit_code == 2
    assert json.loads(refused.stdout)["error"]["came"] == "neither"


@pytest.mark.parametrize(
    ("ring", "more", "told"),
    [("0", "", "no neutral speed but 0"), ("60", "reversed_rotation = true", "both shafts turn")],
)
def test_a_plan_without_points_that_turn_is_refused(ring: str, more: str, told: str, tmp_path: Path) -> None:
    plan = f"[plan]\nneutral_sun_rpm = [0]\nneutral_ring_rpm = [{ring}]\n{more}\n"
    grids = (ROOT / "raw" / "published").as_posix()
    text = f'[losses]\ngrids = "{grids}"\nK_corr = 0.8\nb = 0.0\nc = 2e-4\nd = 0.0\n{plan}'
    (tmp_path / "plan.toml").write_text(text)
    with pytest.raises(BenchError, match=told):
        run_design(tmp_path / "plan.toml", None)
