"""What was named goes on as a known term: written into the machine file, taken out of other recordings, found amiss."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.balance import gearbox, wheel
from tests.slow import slow

from pmg.pipeline.chapters.explained.machine_sheet import machine_sheet
from pmg.pipeline.commands.machines.terms import WITH_CAUSE, run_machine
from pmg.pipeline.diagnosis.balance.causes import _beside_tolerance, named_causes
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.document import terms_lines
from pmg.pipeline.diagnosis.balance.known_terms import beside_known
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.machine.with_cause import with_cause
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.machine_text import for_other_records
from pmg.sim.errors import BenchError, RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.balance.wheel import Turning

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.sim.signals import Array

MACHINE = """
schema = "pmg.machine/1"
title = "A wheel made for a test"

[shaft.wheel.channel]
velocity = { name = "n", unit = "rpm" }
torque = { name = "T", unit = "mN m" }

[records]
time = { name = "t", unit = "s" }
rate_Hz = 500
low_pass_Hz = 20
keep_every = 10
withheld = ["withheld.csv"]

[model]
baseline = ["inertia", "viscous", "coulomb"]
"""


def dragging(m: Turning) -> Array:
    """Dry friction, and a drag with the square of the speed."""
    return wheel.plain(m) + 0.05 * np.sign(m.speed) + 4e-4 * np.sign(m.speed) * m.speed**2


def records(
    folder: Path, torque: Callable[[Turning], Array], seed: int, names: tuple[str, ...] = ("fit.csv", "withheld.csv")
) -> Path:
    rng = np.random.default_rng(seed)
    folder.mkdir()
    for name in names:
        m = wheel.turning(rng, 30.0)
        wheel.record(folder / name, m, torque(m), rng)
    return folder


def diagnosed(machine: Path, folder: Path) -> TermsDiagnosis:
    case = case_of(read_machine(machine), folder)
    return diagnose_terms(case, *read_recordings(case), np.random.default_rng(1))


def written(folder: Path, text: str) -> Path:
    path = folder / "wheel.toml"
    path.write_text(text, encoding="utf-8")
    return path


def known(*rows: tuple[str, str, float, str]) -> str:
    return MACHINE + "".join(
        f'\n[[model.known]]\nterm = "{term}"\nparameter = "{name}"\nvalue = {value}\nunit = "{unit}"\n'
        for term, name, value, unit in rows
    )


@slow
def test_what_was_named_is_known_of_further_recordings(tmp_path: Path) -> None:
    """The file that a run writes makes other recordings of the same machine consistent, and one that wears is told."""
    done = run_machine(str(written(tmp_path, MACHINE)), records(tmp_path / "a", dragging, 3), tmp_path / "out")
    file = tmp_path / "out" / WITH_CAUSE
    assert f"go on with: --machine {file}" in done.lines
    rows = (tmp_path / "out" / "residuals.csv").read_text(encoding="utf-8").splitlines()
    assert {row.split(",")[0] for row in rows[1:]} == {"fit.csv"}
    assert float(rows[1].split(",")[1]) < 1.0
    assert WITH_CAUSE in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    (term,) = case_of(read_machine(file), records(tmp_path / "others", dragging, 3, ("run_4.csv",))).known
    assert term.term.identifier == "drag_of_power"
    assert term.shape == pytest.approx(2.0, abs=0.1)
    again = diagnosed(file, records(tmp_path / "b", dragging, 8))
    assert again.verdict is Verdict.CONSISTENT
    assert "; known: drag" in terms_lines(again)[3]
    worn = diagnosed(file, records(tmp_path / "c", lambda m: dragging(m) + 2e-4 * np.sign(m.speed) * m.speed**2, 9))
    assert {step.added for step in worn.steps[1:]} == {"drag_of_power"}
    assert not with_cause(file.read_text(encoding="utf-8"), worn)
    (cause,) = named_causes(worn)
    assert cause.remark.startswith("beyond what the machine file knows, d = 0.000")
    said = {each.question: " ".join(each.sentences) for each in machine_sheet(worn, goes_on=False).answers}
    assert "take its rows out of `[[model.known]]`" in said["In the model"]
    braces = MACHINE.replace("[model]\nbaseline", "[unused]\nbaseline")
    anew = replace(worn, case=replace(worn.case, known=()))
    assert with_cause(MACHINE, anew)
    assert not with_cause(f"model = {{ known = [] }}\n{braces}", anew)


@slow
def test_a_known_term_that_is_gone_is_named(tmp_path: Path) -> None:
    """A little more than all of it may be missing, as both sizes are known to some percent."""
    rows = ("stribeck", "Fs", 0.049, "N m"), ("stribeck", "vs", 8.0, "rad/s")

    folder = records(tmp_path / "gone", lambda m: wheel.plain(m) + 0.05 * np.sign(m.speed), 4)
    found = diagnosed(written(tmp_path, known(*rows)), folder)
    assert found.verdict is Verdict.NAMED, [step.added for step in found.steps]
    (cause,) = named_causes(found)
    assert cause.identifier == "stribeck"
    assert cause.remark == "beyond what the machine file knows, Fs = 0.049 N m, so that it is gone"
    (size,) = beside_known(next(term for term in found.case.library if term.key == "stribeck"), (0.05,)).amplitudes
    assert size.bounds[0] == pytest.approx(-0.055)


@slow
def test_a_delay_is_known_as_a_distortion_of_what_the_rest_gives(tmp_path: Path) -> None:
    def late(m: Turning) -> Array:
        return np.interp(m.t - 0.012, m.t, wheel.plain(m) + 0.05 * np.sign(m.speed))

    folder = records(tmp_path / "late", late, 5)
    found = diagnosed(written(tmp_path, MACHINE), folder)
    assert {step.added for step in found.steps[1:]} == {"delay"}
    (own,) = (e for e in found.steps[-1].fitted.estimates if e.term == "delay")
    file = written(tmp_path, known(("delay", own.name, own.value, own.unit)))
    first = diagnosed(file, folder).steps[0]
    assert first.error_fit < 1.02 * found.steps[-1].error_fit < 0.2 * found.steps[0].error_fit
    assert first.error_withheld < 1.02 * found.steps[-1].error_withheld


def fading(m: Turning) -> Array:
    return np.asarray((wheel.plain(m) + 0.05 * np.sign(m.speed)) / (1.0 - 0.3 * m.t / m.t[-1]))


def wavy(m: Turning) -> Array:
    return np.asarray(wheel.plain(m) + 0.05 * np.sign(m.speed) + 0.05 * np.sin(m.angle))


@pytest.mark.parametrize(
    ("torque", "named"),
    [pytest.param(fading, "drive_fade", marks=slow), pytest.param(wavy, "position_ripple", marks=slow)],
)
def test_a_size_that_goes_with_its_recordings_is_not_written_and_not_taken(
    tmp_path: Path, torque: Callable[[Turning], Array], named: str
) -> None:
    """A fade is told over the length of its recordings, a ripple from the angle at which each began."""
    folder = records(tmp_path / "a", torque, 3)
    done = run_machine(str(written(tmp_path, MACHINE)), folder, tmp_path / "out")
    assert named in {step["added"] for step in done.data["models"]}
    assert not (tmp_path / "out" / WITH_CAUSE).exists()
    (cause,) = done.data["causes"]
    assert ("once a turn of this shaft" in cause["remark"]) is (named == "position_ripple")
    rows = {
        "drive_fade": (("drive_fade", "f", 0.3, "1"),),
        "position_ripple": (
            ("position_ripple", "A", 0.05, "N m"),
            ("position_ripple", "B", 0.0, "N m"),
            ("position_ripple", "p", 6.283, "rad"),
        ),
    }
    case = case_of(read_machine(written(tmp_path, known(*rows[named]))), folder)
    with pytest.raises(RecordingError, match="goes with the recordings"):
        read_recordings(case)


@pytest.mark.parametrize("value", ['["run[1].csv"]', '[\n  "run_3.csv",  # a sweep\n]'])
def test_names_of_withheld_recordings_go_with_a_folder(value: str) -> None:
    text = MACHINE.replace('["withheld.csv"]', value)
    kept = tomllib.loads(for_other_records(text))
    read = tomllib.loads(text)
    assert read["records"].pop("withheld")
    assert kept == read
    assert for_other_records(for_other_records(text)) == for_other_records(text)
    for other in ('records = { withheld = ["a.csv"] }\n', 'title = """\nwithheld = 3\n"""\n'):
        assert for_other_records(other) == other


POWER = (("drag_of_power", "d", 1e-3, "N m"), ("drag_of_power", "n", 2.0, "1"))


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ((("drag_of_powr", "B", 1e-3, "N m"),), "drag_of_power"),
        (POWER[:1], "drag_of_power n not given"),
        ((*POWER, POWER[0]), "given 2 times"),
        ((("coulomb", "Fc", 0.05, "N m"),), "which is in the baseline"),
        ((POWER[0], ("drag_of_power", "n", 40.0, "1")), "40"),
        ((("drag_of_power", "d", 1e-3, "N"), POWER[1]), "N m"),
    ],
)
def test_known_terms_that_are_not_whole_are_refused(
    tmp_path: Path, rows: tuple[tuple[str, str, float, str], ...], words: str
) -> None:
    folder = records(tmp_path / "a", dragging, 3)
    with pytest.raises(BenchError, match=r"model\.known") as refused:
        case_of(read_machine(written(tmp_path, known(*rows))), folder)
    assert words in str(refused.value)


def test_a_file_that_the_report_would_write_over_is_kept(tmp_path: Path) -> None:
    folder = records(tmp_path / "a", dragging, 3)
    file = tmp_path / WITH_CAUSE
    file.write_text(MACHINE, encoding="utf-8")
    with pytest.raises(BenchError, match="holds the machine file"):
        run_machine(str(file), folder, tmp_path)
    assert file.read_text(encoding="utf-8") == MACHINE


@pytest.mark.parametrize(
    ("term", "g", "with_fault"),
    [
        ("input_torque_gain", 0.05, gearbox.with_motor),
        ("output_torque_gain", 1.0 - 1.0 / 1.05, gearbox.with_brake),
    ],
)
def test_a_known_gain_is_that_of_its_channel(
    tmp_path: Path, term: str, g: float, with_fault: Callable[..., gearbox.Readings]
) -> None:
    """Of either transducer, after a test with weights: divided by it, so that losses are right."""
    sound = gearbox.make_records(tmp_path / "sound", seconds=24.0, names=("first.csv",))
    off = gearbox.make_records(
        tmp_path / "off",
        fault=lambda r: with_fault(r, lambda torque: 1.05 * torque),
        seconds=24.0,
        names=("first.csv",),
    )
    text = gearbox.SHIPPED.read_text().replace('withheld = ["withheld*"]', "")
    (tmp_path / "machine.toml").write_text(text)
    row = f'[[model.known]]\nterm = "{term}"\nparameter = "g"\nvalue = {g!r}\nunit = "1"\n'
    (tmp_path / "known.toml").write_text(f"{text}\n{row}")
    expected, _ = read_recordings(case_of(read_machine(tmp_path / "machine.toml"), sound))
    case = case_of(read_machine(tmp_path / "known.toml"), off)
    found, _ = read_recordings(case)
    np.testing.assert_allclose(found.force, expected.force, atol=2e-3 * float(np.abs(expected.force).max()))
    assert any("shows 1.05 times its torque" in each.message for each in case.findings)
    (tmp_path / "none.toml").write_text(f"{text}\n{row.replace(repr(g), '-1.0' if g == 0.05 else '1.0')}")
    with pytest.raises(BenchError, match="a transducer that shows some of its torque"):
        case_of(read_machine(tmp_path / "none.toml"), off)


def test_a_gain_that_changed_beside_one_that_is_known_goes_into_no_file(tmp_path: Path) -> None:
    """It would stand there twice; the sheet says that the known one has changed."""
    off = gearbox.make_records(
        tmp_path / "off", fault=lambda r: gearbox.with_motor(r, lambda torque: 1.10 * torque), seconds=30.0
    )
    row = '[[model.known]]\nterm = "input_torque_gain"\nparameter = "g"\nvalue = 0.05\nunit = "1"\n'
    machine = tmp_path / "known.toml"
    machine.write_text(f"{gearbox.SHIPPED.read_text()}\n{row}")
    case = case_of(read_machine(machine), off)
    assert {each.term.key for each in case.stated} == {"input_torque_gain"}
    found = diagnose_terms(case, *read_recordings(case), np.random.default_rng(1))
    (cause,) = (each for each in named_causes(found) if each.identifier == "input_torque_gain")
    assert "off, far beyond its tolerance of 0.20%; beyond what the machine file knows, g = 0.05" in cause.remark
    assert with_cause(machine.read_text(), found) == ""


@pytest.mark.parametrize(
    ("gain", "words"),
    [
        (0.0015, "0.15% off, within its tolerance of 0.20%"),
        (0.005, "0.50% off, 2.5 times its tolerance of 0.20%"),
        (8.0, "800.00% off, far beyond its tolerance of 0.20%"),
    ],
)
def test_a_gain_is_told_beside_the_tolerance_that_is_stated(gain: float, words: str) -> None:
    assert _beside_tolerance("input_torque_gain", gain, 0.002) == words
    assert _beside_tolerance("input_torque_gain", gain, None) == ""
    assert _beside_tolerance("coulomb", gain, 0.002) == ""
