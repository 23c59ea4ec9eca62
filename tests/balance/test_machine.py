"""A machine as a file: what it may say, and what is found of a geared machine from its two torques."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.balance import gearbox, wheel
from tests.balance.gearbox import Geared, Readings, plain, with_brake, with_motor
from tests.slow import slow
from typer.testing import CliRunner, Result

from pmg.pipeline.chapters.explained.machine import machine_sections, readings_section
from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.machines.machine import check_machine
from pmg.pipeline.commands.machines.terms import run_machine
from pmg.pipeline.diagnosis.balance.causes import NamedCause, named_causes
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.document import headline
from pmg.pipeline.diagnosis.balance.machine.found_and_stated import not_compared
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.machine.power import steady_points
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.machine.axis import ROTARY
from pmg.pipeline.machine.channel import Channel, in_si
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.shipped import shipped
from pmg.pipeline.machine.show import shown_machine
from pmg.pipeline.recording.remark import Remark
from pmg.pipeline.report.document import Table, Text
from pmg.sim.errors import PmgError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.machine.power import SteadyPoint
    from pmg.sim.signals import Array

pytestmark = pytest.mark.usefixtures("undrawn")


def run_pmg(*words: str) -> Result:
    return CliRunner().invoke(app, list(words))


def told(found: TermsDiagnosis) -> set[frozenset[str]]:
    """Every set of terms that the verdict leaves open."""
    first = frozenset(step.added for step in found.steps[1:])
    return {first, *(contest.rival.ids for contest in found.contests if contest.open)}


def diagnosed(records: Path, machine: Path = gearbox.SHIPPED) -> TermsDiagnosis:
    case = case_of(read_machine(machine), records)
    return diagnose_terms(case, *read_recordings(case), np.random.default_rng(1))


def changed(folder: Path, *changes: tuple[str, str], of: Path = gearbox.SHIPPED) -> Path:
    text = of.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "machine.toml"
    path.write_text(text, encoding="utf-8")
    return path


# --- two torques -------------------------------------------------------------------------------------------


def late(values: Array, samples: int = 15) -> Array:
    places = np.arange(len(values))
    return np.interp(places - samples, places, values)


def thinning(m: Geared) -> Array:
    """Viscous friction that falls by a third, in the small numbers of a small machine."""
    return np.asarray(plain(m) - gearbox.VISCOUS * m.speed * 0.33 * m.t / m.t[-1])


@pytest.mark.parametrize(
    ("losses", "fault", "expected"),
    [
        pytest.param(
            plain,
            lambda r: with_brake(r, lambda b: 1.356 * b),
            {frozenset({"input_torque_gain"}), frozenset({"output_torque_gain"})},
            marks=slow,
        ),
        pytest.param(plain, lambda r: with_brake(r, late), {frozenset({"output_torque_lag"})}, marks=slow),
        pytest.param(plain, lambda r: with_motor(r, late), {frozenset({"input_torque_lag"})}, marks=slow),
        pytest.param(thinning, None, {frozenset({"warming"})}, marks=slow),
    ],
    ids=["conversion", "output late", "input late", "an amplitude far below its bound"],
)
def test_what_is_wrong_with_a_geared_machine_is_among_what_is_told(
    tmp_path: Path,
    losses: Callable[[Geared], Array],
    fault: Callable[[Readings], Readings] | None,
    expected: set[frozenset[str]],
) -> None:
    found = diagnosed(gearbox.make_records(tmp_path / "records", losses, fault))
    assert found.verdict.names
    assert told(found) == expected
    remarks = [cause.remark for cause in named_causes(found)]
    assert not len(expected) > 1 or any("as if N m were read as lbf ft" in remark for remark in remarks)
    assert (found.verdict is Verdict.AMBIGUOUS) == (len(expected) > 1), "what the design cannot tell is not decided"


def test_a_clean_geared_machine_has_nothing_named(tmp_path: Path) -> None:
    found = diagnosed(gearbox.make_records(tmp_path / "records", seed=1))
    assert found.verdict is Verdict.CONSISTENT
    assert found.recorded.names == ("first.csv",)
    assert found.withheld is not None
    assert found.withheld.names == ("withheld.csv",)
    estimates = {e.term: e for e in found.steps[0].fitted.estimates}
    for term, truth in (("inertia", gearbox.INERTIA), ("viscous", gearbox.VISCOUS), ("coulomb", gearbox.COULOMB)):
        assert abs(estimates[term].value - truth) < 4.0 * estimates[term].standard_error + 0.01 * truth, term


def test_losses_and_efficiencies_come_out_with_uncertainties_that_hold(tmp_path: Path) -> None:
    machine = read_machine(gearbox.SHIPPED)
    points: list[SteadyPoint] = []
    for seed in range(4):
        case = case_of(machine, gearbox.make_records(tmp_path / f"{seed}", seed=seed))
        points += steady_points(read_recordings(case)[0], machine, gearbox.INERTIA)
    assert len(points) > 20
    truth = np.array([gearbox.VISCOUS * p.speed**2 + gearbox.COULOMB * abs(p.speed) for p in points])
    off = (np.array([p.loss for p in points]) - truth) / np.array([p.u_repeat for p in points])
    assert np.mean(np.abs(off) < 2.0) > 0.85
    for p, loss in zip(points, truth, strict=True):
        assert p.u_loss > p.u_repeat
        into = max(abs(p.torque_input * p.speed), abs(p.torque_output * p.speed / gearbox.RATIO))
        if np.isfinite(p.efficiency):
            assert p.efficiency == pytest.approx(1.0 - loss / into, abs=5.0 * p.u_efficiency)
            assert not p.above_one


def test_an_efficiency_above_one_is_shown_and_flagged(tmp_path: Path) -> None:
    machine = read_machine(gearbox.SHIPPED)
    records = gearbox.make_records(tmp_path / "records", plain, lambda r: with_brake(r, lambda b: 1.6 * b))
    points = steady_points(read_recordings(case_of(machine, records))[0], machine, gearbox.INERTIA)
    odd = [p for p in points if p.above_one]
    assert odd
    assert max(p.efficiency for p in odd) > 1.1
    faults = ("input_torque_gain", "output_torque_gain", "load_friction")
    causes = tuple(NamedCause(each, each, k, "g = 1", "", 1.0, "", sure=False) for k, each in enumerate(faults))
    (section,) = machine_sections(machine, points, (), causes)
    (text,) = (item.body for item in section.items if isinstance(item, Text))
    assert text.endswith("torques: input_torque_gain, g = 1; or output_torque_gain, g = 1. Losses are off by that.")
    assert "The verdict is not taken out" not in str(machine_sections(machine, points, (), causes[2:]))


def test_what_was_said_of_the_recordings_as_they_were_read_stands_on_the_page() -> None:
    """Once each, but for the warnings, which stand on top."""
    noted, warned = Remark("info", "run.mf4", "samples are even"), Remark("warning", "run.mf4", "clipped")
    (section,) = readings_section((noted, warned, noted))
    (table,) = section.items
    assert isinstance(table, Table)
    assert table.rows == (("run.mf4", "samples are even"),)
    assert readings_section((warned,)) == ()


def test_a_ratio_that_the_speeds_contradict_and_a_sign_are_told(tmp_path: Path) -> None:
    records = gearbox.make_records(tmp_path / "records", names=("first.csv", "withheld.csv"))
    sound = check_machine(str(gearbox.SHIPPED), records)
    assert [f.where for f in sound.findings] == ["shaft.motor.inertia"], "which is stated of one shaft alone"
    odd = check_machine(str(changed(tmp_path, ("value = 12.25", "value = 12.0"))), records)
    assert any("12.25 times as fast" in str(f.message) for f in odd.findings)
    turned = check_machine(str(changed(tmp_path, (", sign = -1 }", " }"))), records)
    assert any("both shafts put power in" in str(f.message) for f in turned.findings)


@pytest.mark.parametrize(
    ("units", "words"),
    [
        (("rpm", "deg"), ""),
        (("rad/s", "deg"), "as if rpm were read as rad/s"),
        (("rpm", "rad"), "as if rad were read as deg"),
        (("rpm", "mrad"), "times the slope"),
    ],
)
def test_a_speed_that_is_not_the_slope_of_the_position_is_told(
    tmp_path: Path, units: tuple[str, str], words: str
) -> None:
    rng = np.random.default_rng(2)
    records = tmp_path / "records"
    records.mkdir()
    m = wheel.turning(rng, 20.0)
    wheel.record(records / "a.csv", m, np.clip(wheel.plain(m), -0.6, 0.6), rng, noise=0.0)
    channels = f'velocity = {{ name = "n", unit = "{units[0]}" }}\nposition = {{ name = "phi", unit = "{units[1]}" }}'
    changes = (
        ('velocity = { name = "n", unit = "rpm" }', channels),
        ('torque = { name = "T", unit = "N m" }', 'torque = { name = "T", unit = "mN m" }'),
        ('withheld = ["withheld*"]', ""),
    )
    done = check_machine(str(changed(tmp_path, *changes, of=shipped()["rotary-drive"])), records)
    told = [str(f.message) for f in done.findings]
    assert any(words in each for each in told if "slope" in each) == bool(words)
    assert any("stands at its largest value, 0.6" in each for each in told)
    assert any("stands at its smallest value, -0.6" in each for each in told)


# --- several records ---------------------------------------------------------------------------------------


@slow
def test_recordings_with_zeros_of_their_own_are_fitted_together(tmp_path: Path) -> None:
    """Three recordings whose torque has another zero each: told as a mismatch when the zero is common, none else."""
    rng = np.random.default_rng(4)
    records = tmp_path / "records"
    records.mkdir()
    for name, zero in (("a.csv", 0.05), ("b.csv", -0.08), ("withheld.csv", 0.02)):
        m = wheel.turning(rng, 12.0)
        wheel.record(records / name, m, wheel.plain(m) + 0.05 * np.sign(m.speed) + zero, rng)
    drive = shipped()["rotary-drive"]
    units = ('torque = { name = "T", unit = "N m" }', 'torque = { name = "T", unit = "mN m" }')
    terms = ('baseline = ["inertia", "viscous"]', 'baseline = ["inertia", "viscous", "coulomb"]')
    common = diagnosed(records, changed(tmp_path, units, terms, of=drive))
    assert "recording" in [place.name for place in common.mismatch.locations]
    own = diagnosed(
        records, changed(tmp_path, units, terms, ("keep_every = 8", 'keep_every = 8\nzeros = "own"'), of=drive)
    )
    assert own.verdict is Verdict.CONSISTENT
    assert own.steps[0].error_withheld < 1.5 * own.steps[0].error_fit


def test_the_end_of_each_recording_may_be_withheld(tmp_path: Path) -> None:
    records = gearbox.make_records(tmp_path / "records", names=("first.csv", "second.csv"))
    machine = changed(tmp_path, ('withheld = ["withheld*"]', "withheld_part = 0.3"))
    fit, withheld = read_recordings(case_of(read_machine(machine), records))
    assert withheld is not None
    assert fit.names == ("first.csv", "second.csv")
    assert withheld.names == ("first.csv, withheld part", "second.csv, withheld part")
    assert len(withheld.force) == pytest.approx(0.3 / 0.7 * len(fit.force), rel=0.02)


# --- the file ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(shipped()))
def test_every_machine_that_ships_is_sound_and_shown(name: str) -> None:
    done = run_pmg("machine", "show", name, "--json")
    assert done.exit_code == 0, done.stderr
    assert read_machine(shipped()[name]).title == json.loads(done.stdout)["data"]["title"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('ratio = { value = 12.25, unit = "1"', 'ratio = { value = 0, unit = "1"', "other than zero"),
        ('unit = "kg m2"', 'unit = "kg"', "kg m2"),
        ("u = 0.0005", "u = -1.0", "zero or more"),
        ('kind = "rigid"', 'kind = "magnetic"', "pole_pairs_input"),
        ('output = "brake"', 'output = "motor"', "two shafts"),
        ('output = "brake"', 'output = "break"', "brake"),
        ('name = "n_motor", unit = "rpm"', 'name = "n_motor", unit = "rpn"', "rpm"),
        ("sign = -1 }", "sign = 2 }", "1 or -1"),
        ('withheld = ["withheld*"]', 'withheld = ["nothing*"]', "the name of a recording"),
        ('withheld = ["withheld*"]', 'withheld = ["*"]', "at least one to fit"),
        ("[records]", "[model]\nbaseline = ['inertia', 'load_fricton']\n[records]", "load_friction"),
        ("nominal =", "nominl =", "nominal"),
        ("ratio = { value = 12.25,", "ratio = { value = ,", "no value after 'value ='"),
        ('output = "brake"', "output =", "no value after 'output ='"),
    ],
)
def test_a_damaged_machine_file_is_refused_with_its_place(tmp_path: Path, old: str, new: str, words: str) -> None:
    records = tmp_path / "records"
    records.mkdir()
    for name in ("first.csv", "withheld.csv"):
        (records / name).write_text("t\n")
    path = changed(tmp_path, (old, new))
    with pytest.raises(PmgError) as refused:
        case_of(read_machine(path), records)
    assert words in str(refused.value)
    assert "machine.toml" in str(refused.value)


def test_a_machine_without_records_or_channels_says_what_to_add(tmp_path: Path) -> None:
    records = gearbox.make_records(tmp_path / "records", names=("first.csv",), seconds=2.0)
    text = gearbox.SHIPPED.read_text()
    path = tmp_path / "machine.toml"
    path.write_text(text[: text.index("[records]")])
    with pytest.raises(PmgError, match="records"):
        case_of(read_machine(path), records)
    with pytest.raises(PmgError, match="no such file"):
        check_machine("two-stage-gearbx", None)
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(PmgError, match="no recordings"):
        case_of(read_machine(gearbox.SHIPPED), empty)


def test_a_new_machine_is_written_once_and_run_from_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    assert run_pmg("machine", "new", str(path), "--like", "two-stage-gearbox").exit_code == 0
    before = path.read_bytes()
    again = run_pmg("machine", "new", str(path))
    assert again.exit_code == 2
    assert "nothing was written" in again.stderr
    assert path.read_bytes() == before
    records = gearbox.make_records(tmp_path / "records", names=("first.csv", "withheld.csv"))
    done = run_pmg("run", str(records), "--machine", str(path), "--report", str(tmp_path / "out"))
    assert done.exit_code == 0, done.stderr
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Speed of motor" in page
    assert "Torque of brake" in page
    assert not re.search(
        r"\b(sun|ring|carrier)\b", re.sub(r"<script.*?</script>|<style.*?</style>", "", page, flags=re.S)
    )
    document = json.loads((tmp_path / "out" / "terms.json").read_text())
    assert document["steady_points"]
    assert document["machine"]["gear"]["ratio"] == 12.25
    useless = run_pmg("run", str(records), "--machine", str(path), "--report", str(tmp_path / "out"), "--k-corr", "0.7")
    assert useless.exit_code == 2
    assert "--k-corr" in useless.stderr


def test_a_coast_down_takes_the_inertia_of_the_file(tmp_path: Path) -> None:
    rng, t = np.random.default_rng(3), np.arange(round(30.0 * wheel.RATE)) / wheel.RATE
    viscous, dry_part = 0.001, 0.01
    end, tau = dry_part / viscous, wheel.INERTIA / viscous
    speed = (100.0 + end) * np.exp(-t / tau) - end
    m = wheel.Turning(t, np.cumsum(speed) / wheel.RATE, speed, -(speed + end) / tau)
    records = tmp_path / "records"
    records.mkdir()
    for name in ("coast.csv", "withheld.csv"):
        wheel.record(records / name, m, np.zeros_like(t), rng)
    drive = shipped()["rotary-drive"]
    text = drive.read_text()
    line = next(line for line in text.splitlines() if line.startswith("torque"))
    machine = changed(tmp_path, (line, ""), of=drive)
    found = diagnosed(records, machine)
    assert frozenset({"coulomb"}) in told(found)
    assert "Coulomb friction" in headline(found)
    bare = changed(tmp_path, (line, ""), ("inertia = {", "rotor = {"), of=drive)
    with pytest.raises(PmgError, match="unknown key"):
        read_machine(bare)
    line_of_inertia = next(line for line in text.splitlines() if line.startswith("inertia"))
    bare = changed(tmp_path, (line, ""), (line_of_inertia, ""), of=drive)
    with pytest.raises(PmgError, match="the inertia, or a torque"):
        case_of(read_machine(bare), records)


def test_the_numbers_of_the_file_stand_beside_those_that_are_found(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    records = tmp_path / "records"
    records.mkdir()
    for name in ("a.csv", "withheld.csv"):
        m = wheel.turning(rng, 20.0)
        wheel.record(records / name, m, wheel.plain(m) + 0.05 * np.sign(m.speed), rng)
    units = ('torque = { name = "T", unit = "N m" }', 'torque = { name = "T", unit = "mN m" }')
    machine = changed(tmp_path, units, ("value = 0.02, unit", "value = 0.03, unit"), of=shipped()["rotary-drive"])
    done = run_machine(str(machine), records, tmp_path / "out")
    rows = {row["number"]: row for row in done.data["stated_and_found"]}
    assert rows["inertia"]["differs"]
    assert rows["inertia"]["found"] == pytest.approx(wheel.INERTIA, rel=0.02)
    assert not rows["Coulomb friction"]["differs"]
    assert rows["viscous friction"]["apart"] is None
    (told,) = (remark for remark in done.findings if remark.where == "machine file")
    assert told.severity == "warning"
    assert "the inertia is 0.03" in told.message
    assert told.message.endswith("Check the machine file, and unit, sign and gain of the channels")


def test_a_transducer_that_sees_nothing_while_the_machine_coasts_is_told_on_the_first_screen(tmp_path: Path) -> None:
    """Free constants fit the noise that it shows: the inertia that is stated tells that they mean nothing."""
    rng, time = np.random.default_rng(3), np.arange(15_000) / wheel.RATE
    records = tmp_path / "records"
    records.mkdir()
    m = wheel.Turning(time, 200.0 * time - 2.5 * time**2, 200.0 - 5.0 * time, np.full(len(time), -5.0))
    for name in ("a.csv", "withheld.csv"):
        wheel.record(records / name, m, 0.002 * rng.standard_normal(len(time)), rng)
    units = ('torque = { name = "T", unit = "N m" }', 'torque = { name = "T", unit = "mN m" }')
    machine = changed(tmp_path, units, of=shipped()["rotary-drive"])
    run_machine(str(machine), records, tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "if the machine coasted, take the torque out of its channels" in page
    assert "describe the machine" not in page


def test_a_number_that_is_stated_of_one_shaft_alone_is_told(tmp_path: Path) -> None:
    """The two-stage gearbox that ships states the inertia of its motor, and none of its brake."""
    found = check_machine(str(gearbox.SHIPPED), None).findings
    assert [f.where for f in found] == ["shaft.motor.inertia"]
    assert "stated of motor alone, and so not compared" in found[0].message
    both = '[shaft.brake]\ninertia = { value = 0.1, unit = "kg m2" }\n\n[shaft.brake.transducer]'
    whole = read_machine(changed(tmp_path, ("[shaft.brake.transducer]", both)))
    assert not not_compared(whole)
    seen = whole.seen_by(whole.shafts["motor"], "inertia")
    assert seen is not None
    assert seen.value == pytest.approx(0.004 + 0.1 / gearbox.RATIO**2)
    assert not_compared(read_machine(shipped()["rotary-drive"])) == ()


def test_a_current_is_a_torque_by_the_constant_of_its_motor(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    records = tmp_path / "records"
    records.mkdir()
    m = wheel.turning(rng, 20.0)
    wheel.record(records / "a.csv", m, wheel.plain(m) / 0.11, rng)
    drive = shipped()["rotary-drive"]
    plain, alone = 'torque = { name = "T", unit = "N m" }', 'torque = { name = "T", unit = "A" }'
    whole = ('withheld = ["withheld*"]', "")
    with pytest.raises(PmgError, match=r"newton_metre_per_unit or, of a current, motor\.constant"):
        read_machine(changed(tmp_path, (plain, alone), whole, of=drive))
    motor = '[shaft.motor.motor]\nconstant = { value = 110, unit = "mN m/A" }\n\n[records]'
    by_motor = changed(tmp_path, (plain, alone), whole, ("[records]", motor), of=drive)
    found, _ = read_recordings(case_of(read_machine(by_motor), records))
    assert "  torque = channel 'T' in A, 0.11 N m each" in shown_machine(str(by_motor))[1]
    stated = alone.replace('"A"', '"A", newton_metre_per_unit = 0.11')
    by_factor, _ = read_recordings(case_of(read_machine(changed(tmp_path, (plain, stated), whole, of=drive)), records))
    np.testing.assert_allclose(found.force, by_factor.force, rtol=1e-12)
    assert np.corrcoef(found.force, found.thin(found.motion.acceleration[:, None])[:, 0])[0, 1] > 0.5


@pytest.mark.parametrize(
    ("unit", "newton_metres"), [("lbf ft", 0.3048 * 4.4482216), ("lbf in", 0.0254 * 4.4482216), ("kgf m", 9.80665)]
)
def test_a_torque_may_be_in_the_units_of_old_data_sheets(unit: str, newton_metres: float) -> None:
    _, si = in_si(Channel(name="T", unit=unit, sign=-1), ROTARY.forces)
    assert si == pytest.approx(-newton_metres, rel=1e-6)
