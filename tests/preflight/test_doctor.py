"""What ``pmg doctor`` says of recordings, of a store and of the machine, before anything is run."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.conftest import ROOT
from tests.recording.writer import CALIBRATION, Bench, write
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.preflight.abilities import IN_PART, NO, YES, Design, abilities
from pmg.pipeline.preflight.environment import BAD, GROWTH, MIND, OK, _within, environment
from pmg.pipeline.preflight.found import Asked, File, Survey
from pmg.pipeline.preflight.rehearsal import _made_up, _operating_points, audit, rehearse
from pmg.pipeline.preflight.survey import _look, survey
from pmg.pipeline.recording.run_records import Setpoints
from pmg.sim.bench import BenchParameters, load_bench
from pmg.sim.signals import RPM

RUNNER = CliRunner()
EXAMPLE = ROOT / "raw" / "example"


def call(*arguments: object, expect: int) -> dict[str, Any]:
    outcome = RUNNER.invoke(app, [*map(str, arguments), "--json"])
    assert outcome.exit_code == expect, outcome.output
    result: dict[str, Any] = json.loads(outcome.stdout)
    return result


@pytest.fixture(scope="module")
def example() -> Survey:
    return survey(EXAMPLE, load_bench())


def states(found: Survey, bench: BenchParameters) -> dict[str, str]:
    rehearsed = rehearse(found.points, bench) if found.points else None
    return {ability.chapter: ability.state for ability in abilities(found, rehearsed, bench)}


def only(found: Survey, *kinds: str) -> Survey:
    files = tuple(f for f in found.files if any(p.configuration in kinds for p in f.points))
    return Survey(found.place, found.stored, files)


def test_the_example_permits_all_that_its_channels_allow(example: Survey, bench: BenchParameters) -> None:
    assert len(example.usable) == len(example.files) == 288
    found = states(example, bench)
    assert {chapter for chapter, state in found.items() if state == NO} == {"coil flux", "load angle"}
    assert Design.of(example.points).repeats == 10
    seen = audit(rehearse(example.points, bench), bench)
    assert seen is not None
    unseen = {row.candidate.identifier for row in seen.visible if row.unseen}
    assert unseen == {"windage", "engaged_dry_friction", "eddy_skin_effect"}


def test_without_engaged_points_the_neutral_losses_remain(example: Survey, bench: BenchParameters) -> None:
    neutral = only(example, "neutral", "zero")
    found = states(neutral, bench)
    assert found["neutral losses"] == YES
    assert {found[name] for name in ("calibration", "power losses and efficiency", "diagnosis")} == {NO}
    listed = abilities(neutral, rehearse(neutral.points, bench), bench)
    assert "engaged points" in next(a.unlock for a in listed if a.chapter == "calibration")
    engaged = states(only(example, "engaged"), bench)
    assert engaged["neutral losses"] == engaged["calibration"] == NO
    assert engaged["orders"] == YES


def test_what_was_never_repeated_is_told_where_the_order_is_the_speed(example: Survey, bench: BenchParameters) -> None:
    points = [p for p in example.points if p.configuration != "zero"]
    once = list({(p.configuration, p.setpoints): p for p in points}.values())
    once.sort(key=lambda p: (p.configuration, abs(p.setpoints.speed_sun or 0), abs(p.setpoints.speed_ring or 0)))
    ordered = [replace(p, started_at=45.0 * n) for n, p in enumerate(once)]
    found = Survey(Path("here"), False, tuple(File(f"{n}", 0, (p,)) for n, p in enumerate(ordered)))
    listed = {a.chapter: a for a in abilities(found, rehearse(found.points, bench), bench)}
    assert listed["diagnosis"].state == IN_PART
    assert "order of speed" in listed["diagnosis"].why
    assert listed["zero and its drift"].state == NO


def test_one_more_point_at_the_same_set_points_is_a_repeat() -> None:
    setpoints = Setpoints(100.0 * RPM, -50.0 * RPM, 0.0)
    one = Asked("c", "f", "P", "neutral", "sun", 1, setpoints, 0.0)
    other = replace(one, setpoints=replace(setpoints, speed_sun=105.0 * RPM))
    turned = replace(one, setpoints=replace(setpoints, speed_ring=50.0 * RPM))
    design = Design.of([one, other, turned, one, replace(one, accepted=False)])
    assert (design.neutral, design.repeats, design.rejected, design.sun, design.ring) == (4, 1, 1, 2, 2)


def test_made_up_readings_depend_on_the_points_alone(example: Survey, bench: BenchParameters) -> None:
    one, other = (_made_up(example.points, bench) for _ in range(2))
    np.testing.assert_array_equal(one.torque_sun, other.torque_sun)
    at = _operating_points(example.points)
    assert at.rest_sun.sum() > 0
    assert np.isfinite(one.torque_sun).all()


def test_a_sequence_gives_its_measured_steps(tmp_path: Path) -> None:
    asked = {"sun_speed_rpm": 600.0, "ring_speed_rpm": -230.0, "ring_torque_Nm": 2.0}
    steps = [(0, "A", "START", asked), (100, "A", "MEASURE", asked), (600, "A", "END", asked)]
    steps += [(700, "B", "MEASURE", asked | {"ring_torque_Nm": 4.0}), (900, "B", "END", asked)]
    run = {"configuration": "engaged", "point": None}
    found = _look(write(tmp_path / "a.mcap", Bench(steps=steps, run=run, with_index=True)), "a.mcap", load_bench())
    assert [p.point for p in found.points] == ["A", "B"]
    assert found.points[1].setpoints.torque_ring == pytest.approx(4.0)
    assert found.points[1].started_at - found.points[0].started_at == pytest.approx(600 / 500.0)
    assert Survey(tmp_path, False, (found,)).recorded("/index") == 1
    untold = _look(write(tmp_path / "b.mcap", Bench()), "b.mcap", load_bench())
    assert untold.untold
    assert not untold.unusable


def test_damage_is_told_and_what_lacks_a_channel_is_not_usable(tmp_path: Path) -> None:
    sound = write(tmp_path / "a.mcap", Bench(run={"sun_speed_set_rpm": "600", "ring_speed_set_rpm": "-230"}))
    (tmp_path / "b.mcap").write_bytes(sound.read_bytes()[: sound.stat().st_size * 2 // 3])
    write(tmp_path / "c.mcap", Bench(without=frozenset({"/daq/encoder_sun/count"})))
    (tmp_path / "d.mcap").write_bytes(b"no recording at all")
    (tmp_path / "e.mcap").write_bytes(sound.read_bytes()[:100])
    (tmp_path / "f.txt").write_bytes(sound.read_bytes())
    found = call("doctor", tmp_path, expect=0)
    data = found["data"]
    assert (data["recordings"], data["usable"]) == (5, 2)
    unusable = [f for f in found["findings"] if f["message"].startswith("unusable")]
    assert {f["where"] for f in unusable} == {"c.mcap", "d.mcap", "e.mcap"}
    assert "the file ends after 100 bytes" in next(f["message"] for f in unusable if f["where"] == "e.mcap")
    assert any(f["where"] == "f.txt" and "give it the ending .mcap" in f["message"] for f in found["findings"])
    assert "angle of the sun" in next(f["message"] for f in unusable if f["where"] == "c.mcap")
    assert data["damaged"] == 1


def test_where_nothing_can_be_run_the_exit_code_is_two_and_all_is_told(tmp_path: Path) -> None:
    (tmp_path / "d.mcap").write_bytes(b"no recording at all")
    found = call("doctor", tmp_path, expect=2)
    assert found["data"]["usable"] == 0
    assert found["findings"]
    (tmp_path / "campaign.toml").write_text(f"[recordings]\npath = '{tmp_path}'\n[store]\npath = 'kept'\n")
    assert call("doctor", "--config", tmp_path / "campaign.toml", expect=2)["data"]["place"] == str(tmp_path)
    assert "PLACE" in call("doctor", expect=2)["error"]["do"]
    foreign = tmp_path / "P17.csv"
    foreign.write_text("t;M\n")
    assert "pmg import" in call("doctor", foreign, expect=2)["error"]["do"]
    nowhere = RUNNER.invoke(app, ["doctor", str(tmp_path / "none")])
    assert "no such folder" in nowhere.stderr
    assert nowhere.exit_code == 2
    assert nowhere.stderr.splitlines()[-1].startswith("hint: ")


def test_a_store_tells_the_same_points_as_its_recordings(tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    for n in range(3):
        run = {"sun_speed_set_rpm": f"{600 + n}", "ring_speed_set_rpm": "-230", "point": f"P{n}"}
        write(folder / f"{n}.mcap", Bench(speed={"sun": 600.0 + n, "ring": -230.0}, run=run, with_index=True))
    call("ingest", folder, "--store", tmp_path / "store", expect=0)
    before, after = (survey(place, load_bench()) for place in (folder, tmp_path / "store"))
    assert after.stored
    assert [(p.point, p.setpoints, p.configuration) for p in before.points] == [
        (p.point, p.setpoints, p.configuration) for p in after.points
    ]
    assert before.campaigns == after.campaigns == {"made": 3}
    assert before.recorded("/index") == after.recorded("/index") == 3


def test_a_copied_recording_counts_once_as_it_is_ingested_once(tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    run = {"sun_speed_set_rpm": "600", "ring_speed_set_rpm": "-230"}
    one = write(folder / "a.mcap", Bench(run=run))
    (folder / "b.mcap").write_bytes(one.read_bytes())
    write(folder / "c.mcap", Bench(run=run | {"note": "the same run, written another time"}))
    (folder / "d.mcap").write_bytes(b"no recording at all")
    (folder / "e.mcap").write_bytes(b"no recording at all")
    found = call("doctor", folder, expect=0)
    assert (found["data"]["recordings"], found["data"]["usable"], found["data"]["copies"]) == (5, 2, 1)
    told = [finding["where"] for finding in found["findings"] if "the same bytes as a.mcap" in finding["message"]]
    assert told == ["b.mcap"]
    store = tmp_path / "store"
    call("ingest", folder, "--store", store, expect=3)
    before, after = (Design.of(survey(place, load_bench()).points) for place in (folder, store))
    assert (before.neutral, before.repeats) == (after.neutral, after.repeats) == (1, 0)


def test_what_a_map_states_is_reckoned_with_and_its_lack_is_told_with_the_remedy(tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    write(folder / "cut.mcap", Bench(calibration=None))
    chart = tmp_path / "map.toml"
    (tmp_path / "bench.toml").write_text(CALIBRATION)
    chart.write_text('schema = "pmg.import/1"\ncalibration = "bench.toml"\n')
    bare = call("doctor", folder, expect=2)
    assert bare["data"]["usable"] == 0
    assert ["--map" in finding["message"] for finding in bare["findings"]] == [True]
    short = tmp_path / "short"
    short.mkdir()
    (short / "cut.mcap").write_bytes((folder / "cut.mcap").read_bytes()[:3000])
    told = [finding["message"] for finding in call("doctor", short, expect=2)["findings"]]
    assert [("--map" in message, "end mark" in message) for message in told] == [(True, True)]
    assert call("doctor", folder, "--map", chart, expect=0)["data"]["usable"] == 1
    done = call("run", folder, "--map", chart, "--store", tmp_path / "store", "--report", tmp_path / "report", expect=3)
    assert done["data"]["ingest"]["ingested"] == 1
    assert done["data"]["ingest"]["failed"] == 0


@pytest.mark.parametrize(
    ("came", "asked", "inside"),
    [
        ("2.1", "<3,>=2.1", True),
        ("2.1.0", ">=2.1", True),
        ("2.0.9", "<3,>=2.1", False),
        ("3.0.0", "<3,>=2.1", False),
        ("3.0.0rc1", "<3", False),
        ("2.10", ">=2.9", True),
        ("1", "", True),
    ],
)
def test_versions_are_compared_number_by_number(came: str, asked: str, inside: bool) -> None:
    assert _within(came, asked) is inside


def test_room_and_rights_are_checked_where_the_store_would_be(tmp_path: Path) -> None:
    def of(size: int, store: Path | None = None) -> dict[str, str]:
        return {check.what: check.state for check in environment(store, size)}

    assert of(0, tmp_path / "new" / "store")["store"] == OK
    assert of(int(1e18 / GROWTH), tmp_path)["disk"] == BAD
    assert of(int(1e18 / GROWTH))["disk"] == MIND
    (tmp_path / "file").write_text("")
    assert of(0, tmp_path / "file" / "store")["store"] == BAD
