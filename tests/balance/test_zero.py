"""The zero of a machine from recordings at rest: known, told with its error, and no cause any more."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy import stats
from tests.balance import gearbox, wheel
from tests.balance.test_known_terms import MACHINE, diagnosed, known, records, written
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.document import terms_lines
from pmg.pipeline.diagnosis.balance.estimate import T_95, fit_together
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.machine.power import steady_points
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.balance.records.zero import _error, words_of_zero, zero_lines
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.machine_text import for_other_records
from pmg.sim.errors import BenchError, RecordingError

if TYPE_CHECKING:
    from pathlib import Path

    from tests.balance.wheel import Turning

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.balance.library.term import Motion, Term
    from pmg.sim.signals import Array

ZERO = 0.015
AT_REST = MACHINE.replace("keep_every = 10", 'keep_every = 10\nzero = ["rest*.csv"]')


def offset(m: Turning) -> Array:
    return wheel.plain(m) + 0.05 * np.sign(m.speed) + ZERO


def rest(path: Path, seed: int, drift: float = 0.0, rpm: float = 0.0, noise: float = 0.05) -> None:
    """20 s at rest, or at a creep; the noise of the speed is all that is seen of it."""
    rng, t = np.random.default_rng(seed), np.arange(round(20.0 * wheel.RATE)) / wheel.RATE
    n, torque = rpm + noise * rng.standard_normal(len(t)), ZERO + drift * t + 2e-3 * rng.standard_normal(len(t))
    rows = "\n".join(f"{a:.4f},{b:.4f},0.0,{1e3 * c:.5f}" for a, b, c in zip(t, n, torque, strict=True))
    path.write_text(f"t,n,phi,T\n{rows}\n")


def _terms(found: TermsDiagnosis) -> tuple[tuple[Term[Motion], ...], tuple[TermFit, ...]]:
    return found.steps[-1].fitted.baseline, found.steps[-1].fitted.fits


def test_a_zero_at_rest_is_known_and_told(tmp_path: Path) -> None:
    """Without it the zero is one of two rivals, and a record at rest that nobody names is left out and told."""
    folder = records(tmp_path / "a", offset, 3)
    rest(folder / "rest_1.csv", 1)
    rest(folder / "rest_2.csv", 2)
    open_one = diagnosed(written(tmp_path, MACHINE), folder)
    assert open_one.verdict is Verdict.AMBIGUOUS
    told = [str(f) for f in open_one.recorded.findings if "left out" in f.message]
    assert len(told) == 2
    assert all('zero = ["rest_' in line for line in told)
    file = written(tmp_path, AT_REST)
    settled = diagnosed(file, folder)
    assert settled.verdict is Verdict.CONSISTENT
    assert settled.case.tares == {"force": pytest.approx(ZERO, abs=1e-4)}
    (each,) = settled.case.known
    assert float(each.amplitudes[0]) == 0.0
    assert 0.0 < each.error < 1e-4
    (said,) = [f.message for f in settled.recorded.findings if "is taken out" in f.message]
    assert " N m" in said
    (line,) = zero_lines(settled.case)
    assert line.startswith("rest_1.csv, rest_2.csv: at rest; T: the zero, 0.01")
    assert line in terms_lines(settled)
    assert line in words_of_zero(settled.case)
    assert "can tell the two apart" in words_of_zero(open_one.case)
    assert {path.name for path in settled.case.files} >= {"rest_1.csv", "rest_2.csv"}
    assert 'zero = ["rest*.csv"]' not in for_other_records(AT_REST).replace('# zero = ["rest*.csv"]', "")


def test_a_zero_that_hides_a_friction_of_direction_does_not(tmp_path: Path) -> None:
    def uneven(m: Turning) -> Array:
        return offset(m) + 0.02 * np.abs(np.sign(m.speed))

    folder = records(tmp_path / "a", uneven, 5)
    rest(folder / "rest_1.csv", 5)
    found = diagnosed(written(tmp_path, AT_REST), folder)
    assert found.verdict is Verdict.NAMED
    assert [step.added for step in found.steps[1:]] == ["direction_dependent_coulomb"]
    (step,) = found.steps[1:]
    (half,) = [e for e in step.fitted.estimates if e.term == "direction_dependent_coulomb"]
    assert half.interval[0] < 0.02 < half.interval[1]
    alone = fit_together(replace(found.recorded, unsure=np.zeros((0, 0))), found.noise.noise, *_terms(found))
    assert half.standard_error > 1.2 * alone.estimates[-1].standard_error, "the zero's own error counts"
    assert not [twins for twins in found.twins if "constant_offset" in twins.ids]


def test_the_error_of_a_zero_goes_with_what_it_scatters(tmp_path: Path) -> None:
    """Zeros of two days that differ make the zero so unsure that as much friction of direction is no sure cause."""
    folder = records(tmp_path / "a", offset, 3)
    rest(folder / "rest_1.csv", 1)
    rest(folder / "rest_2.csv", 2, drift=1e-3)
    file = written(tmp_path, AT_REST)
    (said,) = [f.message for f in case_of(read_machine(file), folder).findings]
    zero, error = (float(word) for word in said.split(", ")[1].removesuffix(" N m").split(" ± "))
    assert zero == pytest.approx(ZERO + 0.005, abs=2e-4)
    assert error == pytest.approx(0.005 * stats.t.ppf(0.975, 1) / T_95, rel=0.1)
    found = diagnosed(file, folder)
    assert found.verdict is Verdict.AMBIGUOUS
    told = {step.added for step in found.steps[1:]} | {i for c in found.contests if c.open for i in c.rival.ids}
    assert told == {"constant_offset", "direction_dependent_coulomb"}


@pytest.mark.parametrize("count", [2, 3, 5])
def test_its_interval_holds_the_truth_however_few_recordings_there_are(count: int) -> None:
    rng, held = np.random.default_rng(count), []
    for _ in range(2000):
        means = rng.standard_normal(count)
        held.append(abs(means.mean()) < T_95 * _error(means, np.full(count, 1e-9)))
    assert 0.935 < np.mean(held) < 0.965


def test_zeros_of_two_torques_are_taken_out_of_losses_too(tmp_path: Path) -> None:
    """A motor cell that is off by 0.05 N m; at rest nothing is said of ratio and sign."""
    folder = gearbox.make_records(
        tmp_path / "records", gearbox.plain, lambda shown: gearbox.with_motor(shown, lambda motor: motor + 0.05)
    )
    still = np.zeros(10000)
    m = gearbox.Geared(np.arange(10000) / 500.0, still, still, still)
    gearbox.record(folder / "rest.csv", m, gearbox.Readings(still + 0.05, still, still), np.random.default_rng(3))
    text = gearbox.SHIPPED.read_text(encoding="utf-8").replace("[records]", '[records]\nzero = ["rest*.csv"]', 1)
    machine = read_machine(written(tmp_path, text))
    case = case_of(machine, folder)
    assert [finding.severity for finding in case.findings] == ["info"] * 2
    assert case.tares["force"] == pytest.approx(0.05, abs=1e-3)
    for point in steady_points(read_recordings(case)[0], machine, gearbox.INERTIA):
        true = gearbox.VISCOUS * point.speed**2 + gearbox.COULOMB * abs(point.speed)
        assert abs(point.loss - true) < 3.0 * point.u_loss
        assert point.u_loss < 0.01 * abs(point.speed)


def test_of_a_machine_that_coasts_the_zero_of_its_torque_is_no_cause(tmp_path: Path) -> None:
    folder, t = tmp_path / "a", np.arange(12500) / wheel.RATE
    folder.mkdir()
    for k, start in enumerate((60.0, -55.0)):
        rng, speed = np.random.default_rng(k), start * np.exp(-0.1 * t)
        torque = ZERO + 1e-4 * rng.standard_normal(len(t))
        n = speed * 30.0 / np.pi + 0.05 * rng.standard_normal(len(t))
        rows = "\n".join(f"{a:.4f},{b:.4f},0.0,{1e3 * c:.5f}" for a, b, c in zip(t, n, torque, strict=True))
        (folder / f"run_{k}.csv").write_text(f"t,n,phi,T\n{rows}\n")
    rest(folder / "rest_1.csv", 1)
    fixed = AT_REST.replace('"coulomb"]', '"coulomb"]\nfixed = { inertia = 0.02 }')
    fixed = re.sub(r"^withheld = .*$", "", fixed, flags=re.MULTILINE)
    found = diagnosed(written(tmp_path, fixed), folder)
    assert found.recorded.coasts
    assert not found.recorded.unsure.size
    assert found.verdict is Verdict.CONSISTENT


@pytest.mark.parametrize("angle", [0.0, 289.801, 193.739])
def test_an_encoder_that_stands_on_one_count_stands(tmp_path: Path, angle: float) -> None:
    text = AT_REST.replace('velocity = { name = "n", unit = "rpm" }', 'position = { name = "phi", unit = "deg" }')
    assert "phi" in text
    folder = records(tmp_path / "a", offset, 3)
    rest(folder / "rest_1.csv", 1)
    rows = (folder / "rest_1.csv").read_text().splitlines()
    still = [f"{a},{b},{angle},{d}" for a, b, _, d in (row.split(",") for row in rows[1:])]
    (folder / "rest_1.csv").write_text("\n".join([rows[0], *still]) + "\n")
    assert case_of(read_machine(written(tmp_path, text)), folder).tares["force"] == pytest.approx(ZERO, abs=1e-4)


def test_a_small_mean_of_a_speed_channel_is_told(tmp_path: Path) -> None:
    folder = records(tmp_path / "a", offset, 3)
    rest(folder / "rest_1.csv", 1, rpm=0.005)
    case = case_of(read_machine(written(tmp_path, AT_REST)), folder)
    (warning,) = [finding for finding in case.findings if finding.severity == "warning"]
    assert "in the mean" in warning.message
    assert "friction" in warning.do


@pytest.mark.parametrize("step", [pytest.param(0.01, marks=slow), 0.0])
def test_a_zero_that_is_not_resolved_is_no_certain_one(tmp_path: Path, step: float) -> None:
    """Torque in steps of 10 mN m of which one sample shows another; and one that is the same throughout."""
    folder = records(tmp_path / "a", offset, 3)
    rest(folder / "rest_1.csv", 1)
    rows = (folder / "rest_1.csv").read_text().splitlines()
    flat = [
        f"{a},{b},{c},{1e3 * (0.01 + step * (k == 40)):.3f}"
        for k, (a, b, c, _) in enumerate(r.split(",") for r in rows[1:])
    ]
    (folder / "rest_1.csv").write_text("\n".join([rows[0], *flat]) + "\n")
    file = written(tmp_path, AT_REST)
    if not step:
        with pytest.raises(RecordingError, match="throughout"):
            case_of(read_machine(file), folder)
        return
    found = diagnosed(file, folder)
    assert found.verdict is Verdict.AMBIGUOUS
    assert found.case.known[0].error == pytest.approx(step / math.sqrt(12.0), rel=0.05)


@pytest.mark.parametrize(("rpm", "noise"), [(0.015, 0.05), (0.0, 0.0)])
def test_a_creep_is_no_rest_and_a_speed_of_nothing_is_one(tmp_path: Path, rpm: float, noise: float) -> None:
    folder = records(tmp_path / "a", offset, 3)
    rest(folder / "rest_1.csv", 1, rpm=rpm, noise=noise)
    if rpm:
        with pytest.raises(RecordingError, match="creeps"):
            case_of(read_machine(written(tmp_path, AT_REST)), folder)
        return
    case = case_of(read_machine(written(tmp_path, AT_REST)), folder)
    assert case.tares["force"] == pytest.approx(ZERO, abs=1e-4)
    assert not [finding for finding in case.findings if finding.severity == "warning"]
    read, _ = read_recordings(case_of(read_machine(written(tmp_path, MACHINE)), folder))
    assert read.names == ("fit.csv",)


def test_of_a_recording_that_moves_and_then_stands_the_part_that_moves_is_kept(tmp_path: Path) -> None:
    folder = records(tmp_path / "a", offset, 3)
    rest(folder / "rest_1.csv", 1)
    moving, still = ((folder / name).read_text().splitlines() for name in ("fit.csv", "rest_1.csv"))
    (folder / "rest_1.csv").unlink()
    later = 30.0 + float(moving[-1].split(",")[0])
    rows = (row.split(",", 1) for row in still[1:])
    both = [*moving, *(f"{float(time) + later:.4f},{rest_of}" for time, rest_of in rows)]
    (folder / "fit.csv").write_text("\n".join(both) + "\n")
    read, _ = read_recordings(case_of(read_machine(written(tmp_path, MACHINE)), folder))
    assert read.names == ("fit.csv (1)",)
    assert any("the machine stands in" in finding.message for finding in read.findings)


@pytest.mark.parametrize(
    ("text", "names", "told"),
    [
        (AT_REST, ("fit.csv", "withheld.csv"), "rest"),
        (AT_REST.replace("rest*.csv", "fit.csv"), ("fit.csv", "withheld.csv", "more.csv"), "at rest"),
        (AT_REST.replace("rest*", "*"), ("fit.csv", "withheld.csv"), "at least one to fit"),
    ],
)
def test_what_is_no_zero_is_refused(tmp_path: Path, text: str, names: tuple[str, ...], told: str) -> None:
    folder = records(tmp_path / "a", offset, 3, names)
    with pytest.raises((BenchError, RecordingError), match=told):
        case_of(read_machine(written(tmp_path, text)), folder)


@pytest.mark.parametrize(
    "more", [known(("constant_offset", "F0", 0.01, "N m")).removeprefix(MACHINE), 'zeros = "own"', '"constant_offset"']
)
def test_a_zero_is_known_in_one_way(tmp_path: Path, more: str) -> None:
    folder = records(tmp_path / "a", offset, 3)
    rest(folder / "rest_1.csv", 1)
    text = AT_REST + more
    if more.startswith("zeros"):
        text = AT_REST.replace("keep_every = 10", f"keep_every = 10\n{more}")
    if more.startswith('"'):
        text = AT_REST.replace('"coulomb"]', f'"coulomb", {more}]')
    with pytest.raises(BenchError, match="one way to know it"):
        case_of(read_machine(written(tmp_path, text)), folder)


def test_recordings_that_all_stand_are_refused(tmp_path: Path) -> None:
    folder = records(tmp_path / "a", offset, 3, ("withheld.csv",))
    rest(folder / "fit.csv", 1)
    with pytest.raises(RecordingError, match="a machine that moves") as told:
        read_recordings(case_of(read_machine(written(tmp_path, MACHINE)), folder))
    shown = re.search(r'zero = \["fit.csv"\] takes its mean, ([-\d.e]+) N m, for the zero', str(told.value))
    assert shown is not None
    assert float(shown[1]) == pytest.approx(ZERO, abs=1e-4)
