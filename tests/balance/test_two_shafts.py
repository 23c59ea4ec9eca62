"""Two torques of a geared machine against each other, its ratio and its transducers: what stands wrong in a file."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from tests.balance import gearbox

from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.consistency import check_nominal
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.balance.records.two_shafts import second_shaft
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.recording.findings import Findings

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.case import Case

RATIO = 4.0
RNG = np.random.default_rng(4)
SPEED = 30.0 * np.sin(np.linspace(0.0, 20.0, 400))
LOAD = 5.0 * np.sign(np.cos(np.linspace(0.0, 9.0, 400)))


def told(ratio: float, first: np.ndarray, second: np.ndarray, true: float = RATIO) -> str:
    """All that is told of a machine with friction, that turns so many times as fast at its input as at its output."""
    findings = Findings("made")
    values = {"velocity": SPEED, "output_velocity": SPEED / true, "force": first, "output_force": second}
    second_shaft(values, cast("Case", SimpleNamespace(ratio=ratio)), findings)
    return " ".join(f"{each.message} {each.do}" for each in findings.listed())


def test_torques_that_balance_when_exchanged_are_told() -> None:
    first, second = LOAD + 0.2 * np.sign(SPEED), -RATIO * LOAD
    assert told(RATIO, first, second) == ""
    said = told(RATIO, second, first)
    assert "exchanged to 0.2 N m rms" in said
    assert "Exchange the channels" in said


@pytest.mark.parametrize("ratio", [0.1, 1.0, RATIO, 10.0, 50.0])
def test_friction_alone_is_no_reason_to_exchange_torques(ratio: float) -> None:
    noise = 0.01 * RNG.standard_normal(len(LOAD))
    assert "xchange" not in told(ratio, 0.5 * np.sign(SPEED), noise, ratio)
    assert "xchange" not in told(ratio, noise, 0.5 * np.sign(SPEED), ratio)


def test_a_ratio_upside_down_is_told_as_that() -> None:
    said = told(1.0 / RATIO, LOAD, -RATIO * LOAD)
    assert "upside down: speed of the input over that of the output is 4." in said
    assert "upside down" not in told(2.0 * RATIO, LOAD, -RATIO * LOAD)
    for stated, true in ((1.0, 1.03), (1.02, 1.0)):
        assert "upside down" not in told(stated, LOAD, -LOAD, true)


@pytest.mark.parametrize(("most", "count"), [(5.0, 0), (4.0, 1)])
def test_a_torque_beyond_its_transducer_is_told(most: float, count: int) -> None:
    findings = Findings("made")
    spike = np.tile(LOAD, 5)
    spike[7] = 100.0
    check_nominal({"force": spike}, {"force": most, "output_force": 1.0}, "N m", findings)
    assert len(findings.listed()) == count


def test_a_machine_file_says_what_its_transducers_are_made_for(tmp_path: Path) -> None:
    folder = gearbox.make_records(tmp_path / "records", seconds=30.0, names=("first.csv", "withheld.csv"))
    text = gearbox.SHIPPED.read_text()
    nominal = case_of(read_machine(gearbox.SHIPPED), folder).nominal
    assert set(nominal) == {"force", "output_force"}
    assert case_of(read_machine(gearbox.SHIPPED), folder).tolerances == pytest.approx(
        {"input_torque_gain": 0.002, "output_torque_gain": 0.002}
    )
    small = tmp_path / "small.toml"
    small.write_text(text.replace("nominal = { value = 50", "nominal = { value = 5"))
    case = case_of(read_machine(small), folder)
    assert case.nominal != nominal
    found, _ = read_recordings(case)
    assert any("on a transducer of 5 N m" in each.message for each in found.findings)
