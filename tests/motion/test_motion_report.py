"""A campaign in motion through pmg run: the cause is named in diagnosis.json, the page and its stills are whole."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from jsonschema import Draft202012Validator
from tests.motion.moving_bench import started
from tests.recording.writer import Bench, write
from tests.report import chromium

from pmg.pipeline import diagnose, ingest, write_report
from pmg.pipeline.commands.compare import run_all
from pmg.pipeline.commands.in_motion.motion import compare_motion, remove_motion_report
from pmg.pipeline.commands.outcome import Outcome
from pmg.pipeline.settings.chosen import choose
from pmg.pipeline.trials.motion.nature import MotionCase, draw_motion_case, write_motion_case
from pmg.pipeline.trials.motion.strata import MotionStratum
from pmg.sim.errors import FitError

RUNS = ("Z_0", "N_ring_up", "N_ring_dither")
HEAVIER = 1.2
"""Part of the ring rotor's inertia that is concealed."""
LARGEST_PAGE = 6e6

STEPS_TOLD: list[str] = []
"""Steps that were announced."""


def note_step(done: int, total: int, name: str) -> None:
    """Keep the name of a step; none is past the last."""
    assert 0 <= done <= total
    STEPS_TOLD.append(name)


def few_runs(case: MotionCase) -> MotionCase:
    """The same bench with a heavier ring rotor and a few of its runs."""
    scene = case.scene
    kept = [i for i, run in enumerate(scene.campaign.runs) if run.point in RUNS]
    campaign = replace(scene.campaign, runs=tuple(scene.campaign.runs[i] for i in kept))
    scene = replace(scene, campaign=campaign, begun=tuple(scene.begun[i] for i in kept))
    return replace(
        case, scene=scene, effects=(replace(case.effects[0], effect=replace(case.effects[0].effect, size=HEAVIER)),)
    )


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[MotionCase, Outcome, Path]:
    """The case, what pmg run says of it, and the folder of the report."""
    home, rng = tmp_path_factory.mktemp("motion"), np.random.default_rng(5)
    stratum = MotionStratum("heavier ring rotor", "B", (("rotor_inertia", "ring"),))
    case = few_runs(draw_motion_case(rng, stratum))
    (home / "in").mkdir()
    write_motion_case(case, home / "in", rng)
    report = home / "report"
    return case, run_all(choose(None, recordings=home / "in", store=home / "store", report=report), note_step), report


def document(report: Path) -> dict[str, Any]:
    """What stands in diagnosis.json, as its schema asks."""
    found: dict[str, Any] = json.loads((report / "diagnosis.json").read_bytes())
    schema = json.loads(files("pmg.pipeline.diagnosis").joinpath("diagnosis.schema.json").read_bytes())
    Draft202012Validator(schema).validate(found)
    return found


def test_the_model_is_kept_and_held_against_runs(told: tuple[MotionCase, Outcome, Path]) -> None:
    case, outcome, report = told
    model, again = report / "model.toml", report.parent / "again"
    assert outcome.data["compare"]["model"] == str(model)
    assert "<code>pmg compare --model model.toml</code>" in (report / "report.html").read_text(encoding="utf-8")
    found = compare_motion(report.parent / "store", case.campaign, again, model=model)
    assert not found.mismatch
    assert found.data["prediction"]["predicted"] < 1.05 * found.data["prediction"]["fitted"]
    assert found.data["prediction"]["unseen"] is False
    (said,) = [line for line in found.lines if line.startswith(f"Model of {case.campaign}")]
    assert said in (again / "report.html").read_text(encoding="utf-8")
    assert (again / "model.toml").is_file()


def test_the_cause_is_named_in_the_document(told: tuple[MotionCase, Outcome, Path]) -> None:
    case, outcome, report = told
    found = document(report)
    assert found["verdict"] == "named"
    (mechanism,) = found["mechanisms"]
    assert (mechanism["id"], mechanism["shaft"]) == ("rotor_inertia", "ring")
    (more,) = mechanism["parameters"]
    truth = HEAVIER * case.scene.bench.shafts.ring.rotor_inertia
    assert abs(more["value"] - truth) < 0.2 * truth
    assert found["held_out"]["gain_interval_Nm"][0] > 0.0
    assert any(place["depends_on"] == ["inertia of the ring rotor"] for place in found["locations"])
    absorbed = {row["parameter"] for row in found["absorbed"]}
    assert {"inertia_ring", "pull_out"} <= absorbed
    compared = outcome.data["compare"]
    assert compared["diagnosis"] == found
    assert compared["moving"] == 2
    assert outcome.mismatch
    assert not outcome.partial
    assert {str(finding.severity) for finding in outcome.findings} == {"info"}  # they say that it is simulated
    assert f"{found['phrase']}: {found['statement']}" in outcome.lines


def test_the_same_comes_from_python_and_a_recording_that_is_cut_off_is_told_on_the_page(
    told: tuple[MotionCase, Outcome, Path], tmp_path: Path
) -> None:
    _, _, report = told
    recordings = tmp_path / "in"
    shutil.copytree(report.parent / "in", recordings)
    (recordings / "cut.mcap").write_bytes(next(iter(recordings.glob("*.mcap"))).read_bytes()[:200])
    diagnosis = diagnose(ingest(recordings))
    assert diagnosis.to_dict() == document(report)
    assert (diagnosis.verdict, diagnosis.mechanisms[0]["shaft"]) == ("named", "ring")
    assert diagnosis.p_value < 0.05
    assert diagnosis.constants["inertia_ring"][1] > 0.0
    name = next(iter(diagnosis.figures))
    assert diagnosis.figure(name).startswith(b"\x89PNG")
    page = write_report(diagnosis, tmp_path / "report", note="From a script").read_text(encoding="utf-8")
    assert "From a script" in page
    assert "2 of 2; 1 recording not usable" in page
    assert "cut.mcap is not usable: " in page
    with pytest.raises(FitError, match="what ingest gave"):
        diagnose(report)  # type: ignore[call-overload]


def test_the_steps_of_a_diagnosis_are_announced_in_order(told: tuple[MotionCase, Outcome, Path]) -> None:
    assert told[1].mismatch
    compared = [name for name in STEPS_TOLD if name.startswith("compare: ")]
    assert compared[0] == "compare: constants of the bench"
    assert compared[-1] == "compare: proof on runs not used"
    assert STEPS_TOLD.index(compared[0]) == sum(name.startswith("ingest: ") for name in STEPS_TOLD)


def test_the_page_and_its_stills_are_whole(told: tuple[MotionCase, Outcome, Path]) -> None:
    _, outcome, report = told
    assert {str(path) for path in report.rglob("*.png")} <= set(outcome.data["compare"]["files"])
    stills = {path.stem for path in report.rglob("*.png")}
    assert {"run-01", "run-02", "run-03", "loss-curves", "response", "missing-torque"} == stills
    page = (report / "report.html").read_text(encoding="utf-8")
    assert len(page) < LARGEST_PAGE
    assert document(report)["phrase"] in page
    first = page[page.index('id="verdict"') : page.index('id="diagnosis"')]
    for words in ("Cause named: ", ">Cause</strong>", "<dt>Next test</dt>", "Check the drawing of the ring rotor"):
        assert words in first, words
    side = re.search(r"changes the (sun|ring) torque of", first)
    assert side is not None
    assert f"{side[1].capitalize()} torque, measured less predicted" in first
    assert "If ignored" not in first  # a mass takes no power
    rows = (report / "tables" / "constants.csv").read_text(encoding="utf-8")
    assert "inertia ring" in rows
    simulated = pd.read_csv(report / "tables" / "simulated-speed.csv")
    assert list(simulated["length"]) == ["0.5 s", "1 s", "5 s", "whole run"]
    assert set(simulated["side"]) == {"ring"}  # the only one that turned
    before, after, noise = simulated.iloc[:, 2:5].to_numpy().T
    assert np.all(after < 0.8 * before)
    assert np.all(after < 2.0 * noise)


def test_steady_points_and_runs_in_motion_make_one_diagnosis(
    told: tuple[MotionCase, Outcome, Path], tmp_path: Path
) -> None:
    """Three steady points tell nothing of the cause: the runs in motion do, and the page says where they are."""
    case, outcome, report = told
    folder = tmp_path / "in"
    shutil.copytree(report.parent / "in", folder)
    for number, speed in enumerate((300.0, 600.0, 900.0)):
        run = {"campaign": case.campaign, "configuration": "neutral", "point": f"P{number}"} | started(number)
        write(folder / f"steady-{number}.mcap", Bench(run=run, speed={"sun": speed, "ring": 0.0}))
    mixed = run_all(choose(None, recordings=folder, store=tmp_path / "store", report=tmp_path / "report"), None)
    found = document(tmp_path / "report")
    assert found["mechanisms"] == outcome.data["compare"]["diagnosis"]["mechanisms"]
    assert mixed.data["compare"]["diagnosis"] == found
    assert mixed.mismatch
    assert (tmp_path / "report" / "motion" / "report.html").exists()
    assert "motion/report.html" in (tmp_path / "report" / "report.html").read_text(encoding="utf-8")


def test_an_old_report_on_runs_in_motion_goes_and_what_is_not_ours_stays(
    told: tuple[MotionCase, Outcome, Path], tmp_path: Path
) -> None:
    old = tmp_path / "report" / "motion"
    shutil.copytree(told[2], old)
    (old / "notes.txt").write_text("mine", encoding="utf-8")
    remove_motion_report(tmp_path / "report", "another campaign")
    assert (old / "report.html").exists()
    campaign = told[0].campaign
    remove_motion_report(tmp_path / "report", campaign)
    assert [path.name for path in old.rglob("*")] == ["notes.txt"]
    remove_motion_report(tmp_path / "report", campaign)
    assert (old / "notes.txt").exists()


@chromium.needed
def test_the_page_draws_its_runs(told: tuple[MotionCase, Outcome, Path], tmp_path: Path) -> None:
    with chromium.tab(tmp_path) as tab:
        tab.show(1280)
        tab.open(told[2] / "report.html")
        runs = "[...document.querySelectorAll('figure.drawn')].filter(each => each.id.startsWith('run-'))"
        first: str = tab.ask(f"{runs}[0].id")
        tab.ask(f"document.getElementById('{first}').scrollIntoView() ?? 1")
        tab.wait(f"document.getElementById('{first}').dataset.drawn === 'yes'")
        assert first == "run-03", "engaged, where the heavier rotor accelerates most"
        assert tab.ask(f"document.querySelectorAll('#{first} .plot').length") == 3
        assert tab.noise() == []
