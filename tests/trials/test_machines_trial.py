"""The trial on other machines: the same seed draws the same campaigns, nature shares nothing, marks are as told."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.house import MODULES
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.balance.search_record import search_record
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.trials.machines.campaign import LARGEST, LEAST, draw_machine_campaign
from pmg.pipeline.trials.machines.causes import CAUSES
from pmg.pipeline.trials.machines.files import write_campaign
from pmg.pipeline.trials.machines.marks import MachineMark, _mark, machine_lines, machine_rows, machine_scores
from pmg.pipeline.trials.machines.trial import PARTS, _machine_lots

if TYPE_CHECKING:
    from pathlib import Path

SEED = 11
JUDGES = {f"pmg.pipeline.trials.machines.{name}" for name in ("told", "trial", "marks")}
"""Modules of the trial that are not its nature."""


def test_campaigns_are_the_same_for_the_same_seed(tmp_path: Path) -> None:
    one, again = (draw_machine_campaign(4, "one", 2, SEED) for _ in range(2))
    assert one.sealed_text == again.sealed_text
    assert one.sealed_text != draw_machine_campaign(4, "one", 2, SEED + 1).sealed_text
    for a, b in zip(one.records, again.records, strict=True):
        np.testing.assert_array_equal(a.push, b.push)
    paths = [write_campaign(campaign, tmp_path / name) for name, campaign in (("a", one), ("b", again))]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    json.loads(one.sealed_text)


def test_the_lots_of_a_longer_trial_begin_with_those_of_a_shorter_one() -> None:
    lots = _machine_lots(160, SEED)
    assert lots[:40] == _machine_lots(40, SEED)
    assert {name: sum(lot.stratum == name for lot in lots) for name in PARTS} == {
        "clean": 40,
        "one": 80,
        "outside": 24,
        "two": 16,
    }


def test_nature_imports_nothing_of_the_diagnosis() -> None:
    for module in MODULES:
        if module.name.startswith("pmg.pipeline.trials.machines") and module.name not in JUDGES:
            targets = [found.target for found in module.imports]
            assert not [name for name in targets if name.startswith("pmg.pipeline.diagnosis")], module.name


@pytest.mark.parametrize("turn", [0, 3])
def test_a_campaign_is_read_from_its_files_and_its_causes_have_their_size(tmp_path: Path, turn: int) -> None:
    campaign = draw_machine_campaign(turn, "one", turn, SEED)
    machine = write_campaign(campaign, tmp_path / "campaign")
    fit, withheld = read_recordings(case_of(read_machine(machine), machine.parent / "records"))
    assert withheld is not None
    assert 1000 < len(fit.force) < 5000
    (part,) = campaign.parts
    assert part.asked == 0.0 or 0.8 * LEAST < part.reached < 1.2 * LARGEST
    assert campaign.right or part.name not in {cause.name for cause in CAUSES if cause.right}


@pytest.mark.parametrize(
    ("number", "kind"), [pytest.param(0, "slide", marks=slow), pytest.param(91, "drive", marks=slow)]
)
def test_a_late_reading_within_a_regulated_loop_is_a_delay_and_nothing_else(
    tmp_path: Path, number: int, kind: str
) -> None:
    """What moves the machine unrecorded is in its acceleration and in the force; a mass on a spring follows both."""
    lot = _machine_lots(160, 20261129601)[number]
    campaign = draw_machine_campaign(lot.number, lot.stratum, lot.turn, lot.seed)
    assert (campaign.machine.kind, [part.name for part in campaign.parts]) == (kind, ["delay"])
    machine = write_campaign(campaign, tmp_path / "campaign")
    case = case_of(read_machine(machine), machine.parent / "records")
    found = search_record(case, read_recordings(case)[0], np.random.default_rng(1)).found
    assert found is not None
    assert found.best.ids == {"delay"}
    assert found.remainder.within_noise


@pytest.mark.parametrize(
    ("number", "named"),
    [pytest.param(34, {"dead_zone"}, marks=slow), pytest.param(65, {"dead_zone", "constant_offset"}, marks=slow)],
)
def test_a_dead_zone_is_told_where_nobody_knows_when_exactly_the_command_changes_its_sense(
    tmp_path: Path, number: int, named: set[str]
) -> None:
    """It distorts what a baseline without it gives, and what acts unrecorded blurs it: it was left open as too odd."""
    lot = _machine_lots(160, 20261130201)[number]
    campaign = draw_machine_campaign(lot.number, lot.stratum, lot.turn, lot.seed)
    machine = write_campaign(campaign, tmp_path / "campaign")
    case = case_of(read_machine(machine), machine.parent / "records")
    recorded, withheld = read_recordings(case)
    searched = search_record(case, recorded, np.random.default_rng(1))
    assert searched.found is not None
    assert searched.found.best.ids == named
    assert searched.found.remainder.within_noise
    (size,) = (float(fit.amplitudes[0]) for fit in searched.named if fit.identifier == "dead_zone")
    part = next(part for part in campaign.parts if part.name == "dead_zone")
    assert size == pytest.approx(part.amplitude * campaign.machine.plant.coulomb, rel=0.05)
    assert withheld is not None
    motion = withheld.motion
    acts = motion.force - size * np.sign(motion.force)
    off = [float(np.std(given.motion.modelled - acts)) for given in (withheld, searched.alike(withheld))]
    assert off[1] < 0.9 * off[0], "fitted without it, friction holds a part of the dead zone"


def truth(stratum: str, right: list[list[str]], sign: bool = False) -> dict[str, Any]:
    return {"stratum": stratum, "right": right, "sign": sign, "kind": "slide", "parts": []}


def told(verdict: str, *sets: list[str], impossible: tuple[str, ...] = ()) -> dict[str, Any]:
    return {"verdict": verdict, "named": sets[0] if sets else [], "sets": list(sets), "impossible": impossible}


GAINS = [["input_torque_gain"], ["output_torque_gain"]]


@pytest.mark.parametrize(
    ("hidden", "said", "expected"),
    [
        (truth("clean", []), told("consistent"), MachineMark.RIGHT),
        (truth("clean", []), told("ambiguous", ["a"], ["b"]), MachineMark.FALSE_ALARM),
        (truth("clean", []), told("not_in_library"), MachineMark.OPEN),
        (truth("one", [["delay"]]), told("named", ["delay"]), MachineMark.RIGHT),
        (truth("one", [["delay"]]), told("named", ["spring"]), MachineMark.WRONG),
        (truth("one", [["delay"]]), told("named", ["delay", "spring"]), MachineMark.WITH_MORE),
        (truth("one", [["delay"]]), told("consistent"), MachineMark.MISSED),
        (truth("one", [["delay"]]), told("not_in_library"), MachineMark.OPEN),
        (truth("one", GAINS), told("ambiguous", *GAINS), MachineMark.IN_SET),
        (truth("one", GAINS), told("ambiguous", ["a"], ["b"]), MachineMark.SET_WITHOUT),
        (truth("two", [["a", "b"]]), told("named", ["b", "a"]), MachineMark.RIGHT),
        (truth("two", [["a", "b"]]), told("named", ["a", "c"]), MachineMark.IN_PART),
        (truth("outside", []), told("not_in_library"), MachineMark.RIGHT),
        (truth("outside", []), told("named", ["a"]), MachineMark.WRONG),
        (truth("one", [[]], sign=True), told("not_in_library", impossible=("inertia",)), MachineMark.RIGHT),
        (truth("one", [[]], sign=True), told("named", ["a"]), MachineMark.WRONG),
        (truth("one", [["a"]]), told("refused"), MachineMark.REFUSED),
    ],
)
def test_marks_are_as_told(hidden: dict[str, Any], said: dict[str, Any], expected: MachineMark) -> None:
    assert _mark(hidden, said) == expected


@pytest.mark.parametrize(
    ("hidden", "best", "expected"),
    [
        (truth("one", [["delay"]]), ["delay"], True),
        (truth("one", [["dead_zone"]]), ["drive_limit"], True),
        (truth("one", [["dead_zone"]]), ["presliding"], False),
        (truth("one", [["delay"]]), ["delay", "stribeck"], False),
        (truth("outside", []), ["stribeck"], True),
        (truth("one", [["delay"]]), [], None),
        (truth("clean", []), ["delay"], None),
        (truth("one", GAINS) | {"kind": "gearbox"}, ["output_torque_gain"], True),
        (truth("one", GAINS) | {"kind": "gearbox"}, ["load_friction"], False),
    ],
)
def test_a_cause_is_located_in_its_part_of_the_machine(
    hidden: dict[str, Any], best: list[str], expected: bool | None
) -> None:
    (row,) = machine_rows({0: hidden}, {0: told("not_in_library") | {"best": best, "seconds": 1.0}})
    assert row["located"] is expected


def test_scores_count_what_was_told() -> None:
    truths = {0: truth("clean", []), 1: truth("one", [["a"]]) | {"parts": [{"name": "zero", "reached": 2.0}]}}
    results = {k: told("named", ["b"]) | {"seconds": 1.0, "p_value": 0.01} for k in truths}
    scores = machine_scores(machine_rows(truths, results))
    assert scores["clean"]["false alarms"]["hits"] == scores["clean"]["test below 5 %"]["hits"] == 1
    assert scores["groups"]["one cause"]["wrong and confident"]["hits"] == 1
    assert any("wrong and confident" in line for line in machine_lines(scores))
