"""Machines that turn, coast and rest, and recordings as others write them: what once went wrong with them."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat
from scipy.signal import lfilter
from tests.balance import slide, wheel
from tests.balance.reading import read_one
from tests.importers import written
from tests.slow import slow

from pmg.pipeline.commands.machines.terms import run_terms
from pmg.pipeline.diagnosis.balance import contest
from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.contest import ModelStep
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.document import free_run_lines, headline, terms_document, terms_lines
from pmg.pipeline.diagnosis.balance.errors_told import errors_sentence, percent, where_it_sticks
from pmg.pipeline.diagnosis.balance.library.drive import DRIVE, ROTARY_DRIVE
from pmg.pipeline.diagnosis.balance.library.term import Motion
from pmg.pipeline.diagnosis.balance.machine.simulated import with_free_runs
from pmg.pipeline.diagnosis.balance.periods import MOST, MOST_VALUES, PER_PERIOD, periods
from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.importers.channel_map import read_map
from pmg.pipeline.importers.import_recording import import_recording
from pmg.pipeline.importers.open_source import open_source, whole_channels
from pmg.pipeline.importers.table_source import TableSource
from pmg.pipeline.machine.axis import ROTARY
from pmg.pipeline.recording.findings import Findings
from pmg.pipeline.recording.read import read_recording as read_whole
from pmg.sim.errors import BenchError, PmgError, RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.balance.slide import Moving
    from tests.balance.wheel import Turning

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.sim.signals import Array

pytestmark = pytest.mark.usefixtures("undrawn")


def diagnosed(path: Path) -> TermsDiagnosis:
    case = read_case(path)
    withheld = None if not case.withheld else read_one(case.withheld[0], case)
    return diagnose_terms(case, read_one(case.fit[0], case), withheld, np.random.default_rng(1))


def named(diagnosis: TermsDiagnosis) -> set[str]:
    return {step.added for step in diagnosis.steps[1:]}


def dry(m: Turning) -> Array:
    return wheel.plain(m) + 0.05 * np.sign(m.speed)


# --- machines that turn ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("channels", "key", "words"),
    [
        pytest.param(f"{wheel.ANGLE}\n{wheel.TORQUE}", "rms_error_rad", ("position simulated", "mrad rms"), marks=slow),
        (
            wheel.VELOCITY + '\ntorque = { name = "T", unit = "A", newton_metre_per_unit = 0.001 }',
            "rms_error_rad_per_s",
            ("speed simulated", "rad/s rms", "of a range of"),
        ),
    ],
    ids=["angle alone", "speed and current"],
)
def test_a_machine_that_turns_is_named_in_its_own_units(
    tmp_path: Path, channels: str, key: str, words: tuple[str, ...]
) -> None:
    found = diagnosed(wheel.make_case(tmp_path, dry, channels=channels))
    assert found.verdict is Verdict.NAMED
    assert named(found) == {"coulomb"}
    estimates = {e.term: e for e in found.steps[-1].fitted.estimates}
    for term, truth, unit in (
        ("coulomb", 0.05, "N m"),
        ("inertia", wheel.INERTIA, "kg m2"),
        ("viscous", wheel.VISCOUS, "N m s/rad"),
    ):
        assert estimates[term].unit == unit
        assert abs(estimates[term].value - truth) < 4.0 * estimates[term].standard_error + 0.01 * truth, term
    found = with_free_runs(found)
    document = terms_document(found)
    assert "standard_deviation_Nm" in document["noise"]
    assert all(key in run for run in document["free_runs"])
    lines = "\n".join(free_run_lines(found))
    assert all(word in lines for word in words)
    assert "Relative torque error" in headline(found)


@slow
def test_the_page_of_a_machine_that_turns_speaks_of_torque(tmp_path: Path) -> None:
    done = run_terms(wheel.make_case(tmp_path, dry), tmp_path / "out")
    assert done.mismatch
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Terms of its torque balance" in page
    assert "Speed from the torque alone" in page
    assert not re.search(r"\[(N|m|m/s|mm|kg)\]", page)
    head = (tmp_path / "out" / "residuals.csv").read_text(encoding="utf-8").splitlines()[0]
    assert head.startswith("recording,time [s],position [rad],speed [rad/s],acceleration [rad/s2],torque [N m],")


def test_the_libraries_of_both_axes_hold_the_same_terms_in_other_units() -> None:
    sliding, turning = DRIVE, ROTARY_DRIVE
    assert [t.identifier for t in sliding] == [t.identifier for t in turning]
    assert not any("kg" in q.unit.split() and "m2" not in q.unit for t in turning for q in t.parameters)
    assert not any("rad" in q.unit for t in sliding for q in t.parameters)


def test_a_machine_that_coasts_shows_friction_as_part_of_its_inertia(tmp_path: Path) -> None:
    """No torque: the speed falls as exp(-t/tau) with dry friction besides; nothing is divided by a torque of zero."""
    rng, t = np.random.default_rng(3), np.arange(round(30.0 * wheel.RATE)) / wheel.RATE
    tau, dry_part = wheel.INERTIA / wheel.VISCOUS * 10.0, 0.01
    end = dry_part / (wheel.VISCOUS / 10.0)
    speed = (100.0 + end) * np.exp(-t / tau) - end
    m = wheel.Turning(t, np.cumsum(speed) / wheel.RATE, speed, -(speed + end) / tau)
    path = wheel.make_case(tmp_path, dry, channels=wheel.VELOCITY, more=f"[baseline.fixed]\ninertia = {wheel.INERTIA}")
    for name in ("fit.csv", "withheld.csv"):
        wheel.record(tmp_path / name, m, np.zeros_like(t), rng)
    found = diagnosed(path)
    assert named(found) == {"coulomb"}
    assert found.steps[-1].error_fit < 0.2
    estimates = {e.term: e.value for e in found.steps[-1].fitted.estimates}
    assert estimates["viscous"] == pytest.approx(wheel.VISCOUS / 10.0, rel=0.05)
    assert estimates["coulomb"] == pytest.approx(dry_part, rel=0.05)
    path.write_text(path.read_text().replace(wheel.VELOCITY, f"{wheel.VELOCITY}\n{wheel.TORQUE}", 1))
    case = read_case(path)
    for torque in (np.zeros_like(t), np.full_like(t, 1e-4), 2e-4 * rng.standard_normal(len(t))):
        wheel.record(case.fit[0], m, torque, rng, noise=0.0)
        recorded = read_one(case.fit[0], case)
        assert recorded.coasts
        assert bool(recorded.findings) == bool(torque.any()), "what is taken for none is told"
        assert not recorded.motion.force.any()
    with pytest.raises(BenchError, match=r"fixed.*inertia"):
        read_case(wheel.make_case(tmp_path, dry, channels=wheel.VELOCITY))


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        (f"{wheel.VELOCITY}\n" + 'force = { name = "T", unit = "N" }', "torque"),
        (wheel.TORQUE, "position"),
        ('velocity = { name = "n", unit = "m/s" }\n' + wheel.TORQUE, "rpm"),
        (wheel.VELOCITY + '\ntorque = { name = "T", unit = "A" }', "newton_metre_per_unit"),
        (wheel.VELOCITY + '\ntorque = { name = "T", unit = "A", newton_per_unit = 1.0 }', "newton_metre_per_unit"),
    ],
)
def test_channels_that_do_not_fit_the_axis_are_refused(tmp_path: Path, channels: str, words: str) -> None:
    with pytest.raises(BenchError, match=words):
        read_case(wheel.make_case(tmp_path, dry, channels=channels))


@pytest.mark.parametrize(
    ("channels", "seed"),
    [(wheel.VELOCITY, 2), (f"{wheel.ANGLE}\n{wheel.VELOCITY}", 4)],
    ids=["speed", "both"],
)
def test_a_clean_machine_that_turns_has_nothing_named(tmp_path: Path, channels: str, seed: int) -> None:
    terms = '["inertia", "viscous", "coulomb"]'
    found = diagnosed(wheel.make_case(tmp_path, dry, seed=seed, channels=f"{channels}\n{wheel.TORQUE}", terms=terms))
    assert not named(found)
    assert not found.verdict.names


def test_an_angle_that_begins_anew_at_each_turn_is_counted_on(tmp_path: Path) -> None:
    path = wheel.make_case(tmp_path, dry, channels=f"{wheel.ANGLE}\n{wheel.TORQUE}")
    case = read_case(path)
    whole = read_one(case.fit[0], case).motion
    head, *rows = case.fit[0].read_text().splitlines()
    cells = [row.split(",") for row in rows]
    wrapped = [",".join([t, n, f"{float(phi) % 360.0:.4f}", T]) for t, n, phi, T in cells]
    case.fit[0].write_text("\n".join([head, *wrapped]) + "\n")
    again = read_one(case.fit[0], case)
    assert np.ptp(again.motion.position - whole.position) < 1e-4
    assert "begins anew" in str(again.findings[0])


def test_a_machine_that_does_not_move_is_refused(tmp_path: Path) -> None:
    path = wheel.make_case(tmp_path, dry)
    case = read_case(path)
    rng, t = np.random.default_rng(1), np.arange(round(20.0 * wheel.RATE)) / wheel.RATE
    wheel.record(case.fit[0], wheel.Turning(t, 0.0 * t, 0.0 * t, 0.0 * t), 0.1 + 0.0 * t, rng)
    rows = case.fit[0].read_text().splitlines()
    case.fit[0].write_text("\n".join([rows[0], *(f"{row}{k % 7}" for k, row in enumerate(rows[1:]))]) + "\n")
    with pytest.raises(RecordingError, match="a machine that moves"):
        read_one(case.fit[0], case)


# --- what memory bears -------------------------------------------------------------------------------------


def spinning(speed: float, seconds: float, rate: float, order: float) -> Recorded:
    """A wheel at a speed that hardly changes, with a torque of one order of its turn, and noise."""
    t = np.arange(round(seconds * rate)) / rate
    angle = speed * t + 0.02 * speed * np.sin(t)
    torque = 0.02 * np.sin(order * angle) + 0.01 * np.random.default_rng(2).standard_normal(len(t))
    motion = Motion(t, angle, np.gradient(angle, t), np.zeros_like(t), torque, np.zeros_like(t), 0.0)
    return Recorded(("made",), motion.referred(), 1, np.ones(len(t), dtype=np.bool_), torque, np.zeros_like(t))


@given(st.floats(1.0, 3000.0), st.floats(5.0, 60.0))
@slow
def test_periods_are_as_many_as_memory_bears_and_samples_show(speed: float, seconds: float) -> None:
    recorded = spinning(speed, seconds, 1000.0, 3.0)
    found = periods(recorded, ROTARY.periods)
    assert len(found) <= MOST
    assert len(found) * len(recorded.force) <= MOST_VALUES
    assert np.all(np.diff(found) < 0.0)
    assert np.all(found >= 0.9 * PER_PERIOD * speed / 1000.0 * 0.95)


@pytest.mark.parametrize("order", [1.0, 7.0, 13.0])
def test_an_order_of_a_turn_is_among_the_periods_of_a_long_travel(order: float) -> None:
    recorded = spinning(100.0, 20.0, 1000.0, order)
    found = periods(recorded, ROTARY.periods)
    nearest = float(np.abs(2.0 * np.pi / found - order).min())
    assert nearest < 0.2 / (recorded.motion.position[-1] / (2.0 * np.pi)), "within a fifth of a cycle over the travel"


@slow
def test_cogging_that_passes_the_filter_only_where_a_machine_is_slow_is_named(tmp_path: Path) -> None:
    """Forty waves a turn are faster than the low-pass of 40 Hz for most of the time."""
    period = 2.0 * np.pi / 40.0
    path = wheel.make_case(
        tmp_path,
        lambda m: wheel.plain(m) + 0.05 * np.sin(2.0 * np.pi * m.angle / period),
        channels=f"{wheel.ANGLE}\n{wheel.TORQUE}",
    )
    d = diagnosed(path)
    assert [step.added for step in d.steps[1:]] == ["position_ripple"]
    fit = d.steps[-1].fitted.fits[-1]
    assert fit.shape == pytest.approx(period, rel=1e-3)
    assert np.hypot(*fit.amplitudes) == pytest.approx(0.05, rel=0.05)


# --- what is found in the data, not declared ---------------------------------------------------------------


def resting(folder: Path, seed: int = 3) -> Path:
    """A slide that dwells at its ends, with dry friction; position read with noise of 2 um."""
    rng = np.random.default_rng(seed)
    path = slide.make_case(folder, slide.plain, seed, terms='["inertia", "viscous", "coulomb"]')
    for name in ("fit.csv", "withheld.csv"):
        t = np.arange(0.0, 24.0, 1.0 / slide.RATE)
        part = np.clip((t % 4.0) / 3.0, 0.0, 1.0)
        stroke = 10 * part**3 - 15 * part**4 + 6 * part**5
        sense, size = np.where((t // 4.0) % 2 == 0, 1.0, -1.0), 0.08 + 0.05 * np.sin(t // 4.0)
        speed = np.gradient(
            np.cumsum(sense * size * np.gradient(stroke, t) * (part < 1.0) * (part > 0.0)) / slide.RATE, t
        )
        q = np.cumsum(speed) / slide.RATE
        force = 80.0 * np.gradient(speed, t) + 150.0 * speed + 15.0 * np.sign(speed) * (np.abs(speed) > 1e-6)
        noise = lfilter([0.6], [1.0, -0.8], rng.standard_normal(len(t)))
        rows = zip(t, 1e3 * (q + 2e-6 * rng.standard_normal(len(t))), (force + noise) / 40.0, strict=True)
        (folder / name).write_text("t,q,u\n" + "\n".join(f"{a:.6f},{b:.5f},{c:.9f}" for a, b, c in rows) + "\n")
    return path


def test_standstill_is_found_from_the_data(tmp_path: Path) -> None:
    path = resting(tmp_path)
    case = read_case(path)
    motion = read_one(case.fit[0], case).motion
    assert 1e-5 < motion.rest_speed < 5e-3
    assert float(np.mean(motion.direction == 0.0)) == pytest.approx(0.27, abs=0.08)
    assert "presliding" not in named(diagnosed(path)), "noise at rest is no reversal"
    path.write_text(path.read_text().replace("keep_every = 2", "keep_every = 2\nrest_speed_m_s = 0.02"))
    motion = read_one(case.fit[0], read_case(path)).motion
    np.testing.assert_array_equal(motion.direction != 0.0, np.abs(motion.speed) > 0.02)  # what is declared holds


def test_as_many_samples_are_dropped_as_the_filter_takes_to_settle(tmp_path: Path) -> None:
    path = slide.make_case(tmp_path, slide.plain, 3)
    told = path.read_text()
    lengths = []
    for cut_off in (40, 10, 5):
        path.write_text(told.replace("low_pass_Hz = 40", f"low_pass_Hz = {cut_off}").replace("drop = 20\n", ""))
        case = read_case(path)
        recorded = read_one(case.fit[0], case)
        lengths.append(len(recorded.motion.time))
        mass = diagnosed(path).steps[0].fitted.estimates[0]
        assert mass.value == pytest.approx(80.0, rel=0.02), "edges of the filter do not reach the fit"
    assert lengths[0] > lengths[1] > lengths[2]


@slow
def test_drag_that_grows_less_and_less_with_speed_is_named(tmp_path: Path) -> None:
    def torque(m: Turning) -> Array:
        return wheel.plain(m) + 0.05 * np.sign(m.speed) - 0.004 * np.sign(m.speed) * np.abs(m.speed) ** 1.5

    terms = '["inertia", "viscous", "coulomb"]'
    found = diagnosed(wheel.make_case(tmp_path, torque, terms=terms, seconds=40.0))
    assert named(found) == {"drag_of_power"}
    estimates = {(e.term, e.name): e.value for e in found.steps[-1].fitted.estimates}
    assert estimates["drag_of_power", "d"] < 0.0
    assert estimates["drag_of_power", "n"] == pytest.approx(1.5, abs=0.3)


def behind(m: Turning) -> Array:
    """A command of which a part is needed before anything acts."""
    return dry(m) + 0.08 * np.sign(dry(m))


def sagging(m: Turning) -> Array:
    """A command that must grow faster than what it makes."""
    return dry(m) * (1.0 + 0.15 * np.abs(dry(m)))


@pytest.mark.parametrize(
    ("torque", "name", "parameter", "truth"),
    [
        (behind, "dead_zone", "z", 0.08),
        pytest.param(sagging, "motor_constant_sag", "s", 0.15, marks=slow),
    ],
    ids=["dead zone", "sag"],
)
def test_faults_of_a_drive_are_named(
    tmp_path: Path, torque: Callable[[Turning], Array], name: str, parameter: str, truth: float
) -> None:
    known = f"[baseline.fixed]\ninertia = {wheel.INERTIA}\n"
    found = diagnosed(wheel.make_case(tmp_path, torque, terms='["inertia", "viscous", "coulomb"]', more=known))
    assert found.verdict.names
    sets = [named(found), *(contest.rival.ids for contest in found.contests if contest.open)]
    assert {name} in [set(each) for each in sets]
    if named(found) == {name}:
        estimate = next(e for e in found.steps[-1].fitted.estimates if (e.term, e.name) == (name, parameter))
        assert estimate.value == pytest.approx(truth, rel=0.1)


# --- what is told ------------------------------------------------------------------------------------------


def test_a_mass_below_zero_stops_naming_and_is_told_first(tmp_path: Path) -> None:
    def force(m: Moving) -> Array:
        return -80.0 * m.a + 150.0 * m.v + 15.0 * np.sign(m.v)

    one, other = tmp_path / "one", tmp_path / "other"
    one.mkdir()
    other.mkdir()
    found = diagnosed(slide.make_case(one, force, 3))
    assert [e.term for e in found.impossible] == ["inertia"]
    turned = diagnosed(slide.make_case(other, lambda m: -force(m), 3, terms='["inertia", "viscous", "coulomb"]'))
    assert turned.verdict is Verdict.NOT_IN_LIBRARY, "nothing is missing, and yet no machine is like that"
    assert headline(turned).startswith("No machine has viscous friction of -150")
    assert headline(turned).count("check sign") == 1
    (dry,) = (e for e in turned.steps[-1].fitted.estimates if e.term == "coulomb")
    alone = replace(turned, impossible=(dry,))
    assert "seldom ran" not in headline(alone), "it ran at any speed"
    motion = turned.recorded.motion
    quick = replace(turned.recorded, motion=replace(motion, speed=2.0 + np.abs(motion.speed)))
    assert "the machine seldom ran below 2" in headline(replace(alone, recorded=quick))
    assert found.verdict is Verdict.NOT_IN_LIBRARY
    assert headline(found).startswith("No machine has inertia of -80")
    assert "check sign, unit and filter" in headline(found)
    assert [e["term"] for e in terms_document(found)["impossible"]] == ["inertia"]


def test_a_refinement_that_hurts_the_withheld_record_or_makes_a_value_impossible_is_dropped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def force(m: Moving) -> Array:
        ripple = 1.0 * np.sin(2.0 * np.pi * m.q / 0.01)
        return slide.plain(m) + 15.0 * np.sign(m.v) + 8.0 * np.sign(m.v) * np.exp(-np.abs(m.v) / 0.02) + ripple

    def worse(*given: object) -> ModelStep:
        """With certainty by the rows that tell; or by much in all rows, few of which tell."""
        step = plain_step(*given)  # type: ignore[arg-type]
        by_much = step.added == kept.refinements[0].added
        return replace(step, error_withheld=9.0) if by_much else replace(step, carried=(-2.0, -1.0))

    plain_step = contest._model_step
    path = slide.make_case(tmp_path, force, 3)
    kept = diagnosed(path)
    assert kept.refinements
    assert not kept.dropped
    monkeypatch.setattr(contest, "_model_step", worse)
    found = diagnosed(path)
    assert not found.refinements
    assert {step.added for step in found.dropped} >= {kept.refinements[0].added}
    assert "dropped: " in "\n".join(terms_lines(found))
    assert terms_document(found)["dropped_refinements"]
    monkeypatch.setattr(contest, "_model_step", plain_step)
    monkeypatch.setattr(contest, "impossible_in", lambda fitted: fitted.estimates[-1:])
    found = diagnosed(path)
    assert not found.refinements
    assert found.verdict is kept.verdict, "what a refinement would make impossible takes no name with it"
    assert {step.added for step in found.dropped} >= {kept.refinements[0].added}


def test_every_headline_tells_the_withheld_error_and_what_does_not_carry_over(tmp_path: Path) -> None:
    clean, odd = tmp_path / "clean", tmp_path / "odd"
    clean.mkdir()
    odd.mkdir()
    told = headline(diagnosed(slide.make_case(clean, slide.plain, 4, terms='["inertia", "viscous", "coulomb"]')))
    assert "on the withheld record" in told
    assert "carry over" not in told
    path = slide.make_case(odd, slide.plain, 4)
    other = np.random.default_rng(9)
    slide.record(
        odd / "withheld.csv", slide.motion(other, slide.SECONDS), lambda m: 40.0 * m.a + 300.0 * m.v, other, 1.0
    )
    found = diagnosed(path)
    assert re.search(r", which is [3-9]\d\d? times that of the fit\.$|: it does not carry over\.$", headline(found))


@pytest.mark.parametrize(
    ("before", "after", "end"),
    [
        (None, (0.04, 0.05), "on the withheld record 5.00 %."),
        (None, (0.04, 0.5), "on the withheld record 50.00 %, which is 12 times that of the fit."),
        ((0.3, 0.26), (0.01, 0.03), "26.00 % before, 3.00 % after, which is 3 times that of the fit."),
        ((0.3, 0.26), (0.01, 0.25), "26.00 % before, 25.00 % after: it does not carry over."),
    ],
)
def test_what_carries_over_is_not_said_not_to(
    before: tuple[float, float] | None, after: tuple[float, float], end: str
) -> None:
    steps = [SimpleNamespace(error_fit=fit, error_withheld=other) for fit, other in filter(None, (before, after))]
    diagnosis = SimpleNamespace(case=SimpleNamespace(axis=ROTARY), withheld=object())
    assert errors_sentence(cast("Any", diagnosis), cast("Any", steps[0]), cast("Any", steps[-1])).endswith(end)


@pytest.mark.parametrize(("stuck", "told"), [(2.0, "Of the squared error 99.8 % is of samples"), (0.005, "")])
def test_an_error_that_is_of_samples_where_the_machine_sticks_is_told_without_them(stuck: float, told: str) -> None:
    """One sample in a hundred may be held by a force of any size; in the others 1 % of the force is left."""
    own = np.where(np.arange(1000) % 100 == 0, 5.0, 0.0)
    left = np.where(own > 0.0, stuck, 0.01)
    recorded = SimpleNamespace(force=np.ones(1000), known=np.zeros(1000), noise_of_rows=lambda one: np.hypot(one, own))
    noise = SimpleNamespace(noise=SimpleNamespace(standard_deviation=0.01))
    diagnosis = SimpleNamespace(recorded=recorded, withheld=recorded, noise=noise)
    step = SimpleNamespace(fitted=SimpleNamespace(left=lambda _: left, fits=()))
    sentence = where_it_sticks(cast("Any", diagnosis), cast("Any", step))
    for name, where in (("dead_zone", "in the dead zone"), ("backlash", "the end of the gap")):
        for outcomes in (None, abs):
            term = SimpleNamespace(outcomes=outcomes)
            step.fitted.fits = (SimpleNamespace(identifier=name, candidate=term),)
            said = where_it_sticks(cast("Any", diagnosis), cast("Any", step))
            assert (where in said) is bool(told and outcomes)
    assert sentence.startswith(told)
    assert bool(sentence) == bool(told)
    assert not told or sentence.endswith("the relative error is 1.00 %, and 1.00 % on the withheld record.")


@pytest.mark.parametrize(("part", "told"), [(0.0306, "3.06 %"), (57109277.0, "more than 1000 %"), (float("nan"), "–")])
def test_a_relative_error_that_says_nothing_is_not_printed(part: float, told: str) -> None:
    assert percent(part) == told


# --- files as others write them ----------------------------------------------------------------------------


def test_a_column_that_begins_with_whole_numbers_is_read_and_one_that_is_not_mapped_may_hold_anything(
    tmp_path: Path,
) -> None:
    path = slide.make_case(tmp_path, slide.plain, 3)
    case = read_case(path)
    before = read_one(case.fit[0], case)
    head, *rows = case.fit[0].read_text().splitlines()
    whole = [f"{n * 0.005:g},0,0,{n}" for n in range(1200)]
    kept = [f"{6.0 + float(row.split(',')[0]):.6f},{row.split(',', 1)[1]},x" for row in rows]
    case.fit[0].write_text("\n".join([f"{head},remark", *whole, *kept]) + "\n")
    assert len(read_one(case.fit[0], case).motion.time) == len(before.motion.time) + 1200
    case.fit[0].write_text("\n".join([f"{head},remark", *whole, *kept[:-1], kept[-1].replace(",x", "y,x")]) + "\n")
    with pytest.raises(RecordingError, match=r"line 3601"):
        read_one(case.fit[0], case)


def test_a_column_of_a_matrix_is_named_and_a_matrix_is_not_flattened(tmp_path: Path) -> None:
    path = slide.make_case(tmp_path, slide.plain, 3)
    case = read_case(path)
    before = read_one(case.fit[0], case)
    values = np.loadtxt(case.fit[0], delimiter=",", skiprows=1)
    savemat(tmp_path / "fit.mat", {"t": values[:, :1], "x": values[:, 1:]})
    told = path.read_text().replace('fit = "fit.csv"', 'fit = "fit.mat"')
    path.write_text(told.replace('name = "q"', 'name = "x(:,1)"').replace('name = "u"', 'name = "x(:,2)"'))
    case = read_case(path)
    assert np.array_equal(read_one(case.fit[0], case).motion.force, before.motion.force)
    for name, words in (("x", r"Known: t, x\(:,1\)"), ("x(:,3)", "a channel of"), ("y(:,1)", "a channel of")):
        path.write_text(told.replace('name = "q"', 'name = "x(:,1)"').replace('name = "u"', f'name = "{name}"'))
        case = read_case(path)
        with pytest.raises(RecordingError, match=words):
            read_one(case.fit[0], case)


def test_recordings_are_read_as_others_write_them(tmp_path: Path) -> None:
    """Semicolons, decimal commas, units in the header; Parquet; a unit that contradicts the case."""
    path = slide.make_case(tmp_path, slide.plain, 3)
    case = read_case(path)
    before = read_one(case.fit[0], case).motion
    head, *rows = case.fit[0].read_text().splitlines()
    assert head == "t,q,u"
    table = pl.read_csv(case.fit[0])
    table.write_parquet(tmp_path / "fit.parquet")
    german = "\n".join(["t [s];q [mm];u [V]", *(row.replace(",", ";").replace(".", ",") for row in rows)])
    case.fit[0].write_text(german + "\n")
    for name in ("fit.csv", "fit.parquet"):
        again = read_one(tmp_path / name, case).motion
        assert np.array_equal(again.force, before.force)
        assert np.array_equal(again.position, before.position)
    case.fit[0].write_text(german.replace("q [mm]", "q [um]") + "\n")
    with pytest.raises(RecordingError, match=r"the unit um; expected mm"):
        read_one(case.fit[0], case)
    for spelled, told in (("q [µm]", "the unit um; expected mm"), ("q [fathom]", "")):
        case.fit[0].write_text(german.replace("q [mm]", spelled) + "\n")
        if told:
            with pytest.raises(RecordingError, match=told):
                read_one(case.fit[0], case)
        else:
            assert "not understood" in str(read_one(case.fit[0], case).findings[0])
    case.fit[0].write_text(german)  # without its last line break
    assert "last line has no end" in str(read_one(case.fit[0], case).findings[0])


@pytest.mark.parametrize("kind", ["mat", "parquet"])
def test_tables_of_whole_columns_are_imported_like_any_other(tmp_path: Path, kind: str) -> None:
    text = tmp_path / "E1.csv"
    text.write_text(written.csv_text(50), encoding="utf-8", newline="")
    chart = read_map(written.write_map(tmp_path, written.map_text(written.PLAIN)))
    expected = import_recording(text, chart, tmp_path / "a.mcap")
    names = ("torque_sun", "torque_ring", "angle_sun", "angle_ring")
    columns = whole_channels(open_source(text, chart.table.csv, Findings("E1.csv")), names)
    source = tmp_path / f"E1.{kind}"
    if kind == "mat":
        savemat(source, {name: column[:, None] for name, column in columns.items()})
    else:
        pl.DataFrame(columns).write_parquet(source)
    units = "".join(written.channel(t, name, unit=written.UNITS[name]) for name, t in written.TOPICS.items())
    chart = read_map(written.write_map(tmp_path, written.map_text(units)))
    done = import_recording(source, chart, tmp_path / "b.mcap")
    assert done.format == kind
    assert done.written == expected.written
    one, other = (read_whole(each).samples for each in (expected.out, done.out))
    assert one.equals(other)


def test_a_mat_file_that_cannot_be_read_says_what_to_do(tmp_path: Path) -> None:
    savemat(tmp_path / "wide.mat", {"x": np.arange(20.0).reshape(2, 10), "cube": np.zeros((2, 3, 4))})
    assert [each.name for each in TableSource(tmp_path / "wide.mat", "mat").channels] == ["x(1,:)", "x(2,:)"]
    (tmp_path / "cut.mat").write_bytes((tmp_path / "wide.mat").read_bytes()[:60])
    with pytest.raises(RecordingError, match="whole file"):
        TableSource(tmp_path / "cut.mat", "mat")
    newer = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    for head, words in ((b"not a MAT file\n" * 40, "whole file"), (newer, "7.3")):
        (tmp_path / "fit.mat").write_bytes(head)
        with pytest.raises(RecordingError, match=words):
            TableSource(tmp_path / "fit.mat", "mat")


def test_a_channel_may_be_asked_for_as_the_header_has_it(tmp_path: Path) -> None:
    source = tmp_path / "E1.csv"
    text = written.csv_text(50)
    source.write_text(text.replace("torque_sun", "torque_sun [Hz]", 1), encoding="utf-8", newline="")
    asked = written.map_text(written.PLAIN.replace("'torque_sun'", "'torque_sun [Hz]'"))
    done = import_recording(source, read_map(written.write_map(tmp_path, asked)), tmp_path / "a.mcap")
    assert done.written["/daq/torque_sun/frequency"] == 50
    wrong = written.map_text(written.PLAIN.replace("'torque_sun'", "'torque_sun [kHz]'"))
    with pytest.raises(PmgError, match="torque_sun"):
        import_recording(source, read_map(written.write_map(tmp_path, wrong)), tmp_path / "b.mcap")


def test_an_import_that_brings_nothing_is_an_error(tmp_path: Path) -> None:
    """Rows there are, and no number in them."""
    source = tmp_path / "E1.csv"
    *head, _ = written.csv_text(1).splitlines()
    source.write_text("\n".join([*head, *(["nan;nan;nan;nan"] * 50)]) + "\n", encoding="utf-8", newline="")
    chart = read_map(written.write_map(tmp_path, written.map_text(written.PLAIN)))
    with pytest.raises(RecordingError, match="50 rows without one number"):
        import_recording(source, chart, tmp_path / "a.mcap")
    assert not (tmp_path / "a.mcap").exists()
