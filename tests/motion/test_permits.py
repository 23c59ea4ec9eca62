"""What pmg doctor says of runs in motion: what they permit, what is missing and what that means."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.motion.moving_bench import ENGAGED, SECONDS, TIME, Floats, at_rest, geared, hump, moving, started
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.ingest import ALONE, run_ingest
from pmg.pipeline.store.store import Store

RUNNER = CliRunner()
DITHER: Floats = 20.0 * np.sin(2 * np.pi * TIME)


def doctor(place: Path) -> dict[str, Any]:
    outcome = RUNNER.invoke(app, ["doctor", str(place), "--json"])
    found: dict[str, Any] = json.loads(outcome.stdout)
    (campaign,) = found["data"]["campaigns"] if "data" in found else found["campaigns"]
    return dict(campaign) | {"code": outcome.exit_code}


def chapters(campaign: dict[str, Any]) -> dict[str, tuple[str, str]]:
    return {row["chapter"]: (row["state"], row["why"]) for row in campaign["chapters"]}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "in"
    made.mkdir()
    return made


def test_recordings_and_their_store_permit_the_same(folder: Path) -> None:
    moving(folder / "up.mcap", run=started(1))
    moving(folder / "down.mcap", speeds={"sun": -hump(60.0)}, run=started(2))
    moving(folder / "coast.mcap", "coast", run=started(3))
    moving(folder / "dither.mcap", "dither", {"ring": DITHER}, run=started(4))
    moving(folder / "steps.mcap", "steps", geared(), run=ENGAGED | started(5))
    moving(folder / "lost.mcap", "sweep", {}, run=ENGAGED | started(6))
    at_rest(folder / "z.mcap", 7)
    at_rest(folder / "y.mcap", 8)
    store = folder.with_name("store")
    run_ingest(folder, store, ALONE)
    before, after = doctor(folder), doctor(store)
    assert before["moving"] == after["moving"]
    assert before["moving"] == [
        "engaged, sun drives: 1 load-step run",
        "neutral, ring turning: 1 dither",
        "neutral, sun turning: 2 ramps, 1 coast-down",
        "set aside: lost",
    ]
    assert before["code"] == after["code"] == 0
    found = chapters(before)
    assert found == chapters(after)
    assert {chapter for chapter, (state, _) in found.items() if state == "yes"} == {
        "zero and its drift",
        "inertia of the sun rotor",
        "inertia of the ring rotor",
        "inertia of the sun motor",
        "loss curve of the sun",
        "stiffness, pull-out, damping",
        "frequency response",
        "ring friction at reversal",
        "proof on another kind of run",
    }
    assert found["loss curve of the sun"][1] == "2 ramps, 1 coast-down, in both directions"
    assert found["loss curve of the ring"] == ("no", "no ramp of the ring alone")
    assert found["inertia of the ring motor"][0] == "no"
    assert "data sheet" in found["inertia of the ring motor"][1]


def test_a_slow_ramp_cannot_tell_inertia_from_drag(folder: Path) -> None:
    moving(folder / "a.mcap", speeds={"sun": hump(1.2)})
    found = chapters(doctor(folder))
    state, why = found["inertia of the sun rotor"]
    assert state == "in part"
    assert why.startswith("the speed changes by at most 1.")
    assert why.endswith("rad/s^2: inertia looks like drag")


def test_a_ramp_that_only_rises_cannot_either(folder: Path) -> None:
    moving(folder / "a.mcap", speeds={"sun": 60.0 * TIME / SECONDS})
    found = chapters(doctor(folder))
    assert found["inertia of the sun rotor"] == ("in part", "the speed only rises: inertia looks like drag")
    state, why = found["loss curve of the sun"]
    assert state == "in part"
    assert "forward only" in why
    assert found["proof on another kind of run"] == ("no", "1 ramp: all of one kind")


def test_the_words_on_the_terminal(folder: Path) -> None:
    moving(folder / "a.mcap", "ramp", geared(), run=ENGAGED)
    words = RUNNER.invoke(app, ["doctor", str(folder)]).stdout
    assert "in motion: engaged, sun drives: 1 ramp" in words
    assert "no steady point: the chapters of the steady grid are not possible" in words
    assert "without set-points" not in words
    assert "load steps or a sweep, engaged" in words


def test_a_store_that_did_not_know_the_manoeuvre_is_read_anew(folder: Path) -> None:
    moving(folder / "a.mcap", run={"manoeuvre": "rump"})
    store = folder.with_name("store")
    run_ingest(folder, store, ALONE)
    (manifest,) = Store(store).manifests()
    assert not manifest.moving
    assert run_ingest(folder, store, ALONE).data["ingested"] == 1
