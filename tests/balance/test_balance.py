"""Terms named from a drive whose force balance is known, and from files that are damaged."""

from __future__ import annotations

import csv
import json
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter
from tests.balance.reading import read_one
from tests.balance.slide import make_case, plain
from tests.conftest import ROOT
from tests.slow import slow

from pmg.pipeline.chapters.explained.machine_sheet import machine_sheet
from pmg.pipeline.commands.machines.terms import run_terms
from pmg.pipeline.diagnosis.balance.case_file import read_case
from pmg.pipeline.diagnosis.balance.causes import named_causes, near_causes, nearest_lines
from pmg.pipeline.diagnosis.balance.decide import diagnose_terms
from pmg.pipeline.diagnosis.balance.document import headline, terms_document
from pmg.pipeline.diagnosis.balance.estimate import T_95, fit_together
from pmg.pipeline.diagnosis.balance.fitting import fit_term, tabulate, term_problem
from pmg.pipeline.diagnosis.balance.known_terms import SetTerm
from pmg.pipeline.diagnosis.balance.library.drive import DRIVE
from pmg.pipeline.diagnosis.balance.machine.machine_case import case_of
from pmg.pipeline.diagnosis.balance.records.reading import read_recordings
from pmg.pipeline.diagnosis.balance.search_record import _searched_terms
from pmg.pipeline.diagnosis.balance.serial import SerialNoise, covariance_of, fit_noise
from pmg.pipeline.diagnosis.balance.titles import lateness_of
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.engine.withheld import BLOCKS
from pmg.pipeline.machine.machine_file import read_machine
from pmg.pipeline.machine.shipped import shipped
from pmg.sim.errors import BenchError, PmgError, RecordingError

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.balance.slide import Moving

    from pmg.pipeline.diagnosis.balance.decide import TermsDiagnosis
    from pmg.sim.signals import Array

COULOMB = '["inertia", "viscous", "coulomb"]'


def diagnosed(
    folder: Path,
    force: Callable[[Moving], Array],
    seed: int = 3,
    terms: str = '["inertia", "viscous"]',
    more: str = "",
) -> TermsDiagnosis:
    case = read_case(make_case(folder, force, seed, terms, more))
    assert case.withheld
    recorded, withheld = read_one(case.fit[0], case), read_one(case.withheld[0], case)
    return diagnose_terms(case, recorded, withheld, np.random.default_rng(1))


def named(diagnosis: TermsDiagnosis) -> set[str]:
    return {step.added for step in diagnosis.steps[1:]}


def value(diagnosis: TermsDiagnosis, term: str) -> tuple[float, float]:
    step = (diagnosis.refinements or diagnosis.steps)[-1]
    found = next(e for e in step.fitted.estimates if e.term == term)
    return found.value, found.standard_error


# --- planted truths ------------------------------------------------------------------------------------


@pytest.mark.parametrize("first", [0, *(pytest.param(k, marks=slow) for k in (10, 20, 30))])
def test_a_clean_drive_has_nothing_named(tmp_path: Path, first: int) -> None:
    verdicts = []
    for seed in range(first, first + 10):
        folder = tmp_path / str(seed)
        folder.mkdir()
        verdicts.append(diagnosed(folder, plain, seed).verdict)
    assert Verdict.NAMED not in verdicts
    assert Verdict.AMBIGUOUS not in verdicts
    assert sum(verdict is not Verdict.CONSISTENT for verdict in verdicts) <= 2, "5 % of ten, and chance"


def test_offset_and_friction_of_direction_are_one_set_of_rivals_with_a_test(tmp_path: Path) -> None:
    def force(m: Moving) -> Array:
        return plain(m) + 15.0 * np.sign(m.v) - 8.0 + 8.0 * np.sign(m.v) * np.exp(-np.abs(m.v) / 0.02)

    found = diagnosed(tmp_path, force)
    twins = {"constant_offset", "direction_dependent_coulomb"}
    assert found.verdict is Verdict.AMBIGUOUS
    assert "coulomb" in named(found)
    assert len(named(found) & twins) == 1
    (open_one,) = [contest.rival.ids for contest in found.contests if contest.open]
    assert open_one == named(found) ^ twins
    document = terms_document(found)
    (told,) = [row for row in document["cannot_be_told"] if set(row["ids"]) == twins]
    assert "turn the machine around" in told["separating_test"]
    assert {step.added for step in (*found.steps, *found.refinements)} >= {"coulomb", "stribeck"}
    said = {each.question: each.sentences for each in machine_sheet(found, goes_on=False).answers}
    sure, *either = said["Possible causes"]
    assert sure.startswith("In each case: Coulomb friction: Fc = ")
    assert [line[:2] for line in either] == ["1.", "2."]
    assert "at rest" in said["Next test"][0], "the test that tells the two apart comes first"
    assert headline(found).startswith("Ambiguous: Coulomb friction, and besides ")
    (offset,) = named(found) & twins
    for term, truth in (("coulomb", 15.0), ("stribeck", 8.0), (offset, -8.0), ("inertia", 80.0)):
        got, error = value(found, term)
        assert abs(got - truth) < 4.0 * error, term


def test_viscous_friction_of_direction_is_told_from_an_offset(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, lambda m: plain(m) + 15.0 * np.sign(m.v) + 30.0 * np.abs(m.v))
    assert found.verdict is Verdict.NAMED
    assert named(found) == {"coulomb", "direction_dependent_viscous"}
    for term, truth in (("coulomb", 15.0), ("direction_dependent_viscous", 30.0), ("viscous", 150.0)):
        got, error = value(found, term)
        assert abs(got - truth) < 4.0 * error, term
    first, last = found.steps[0], found.steps[-1]
    assert last.error_withheld < 0.2 * first.error_withheld
    assert not found.left_over.found
    assert found.further_decoys.entered == 0, "no decoy enters once everything is in"
    assert max(found.further_decoys.gains) < 0.01 * first.error_withheld


def test_a_gain_error_needs_something_that_is_known(tmp_path: Path) -> None:
    def force(m: Moving) -> Array:
        return 1.1 * plain(m) + 15.0 * np.sign(m.v)

    for name in "abc":
        (tmp_path / name).mkdir()
    known = diagnosed(tmp_path / "a", force, terms=COULOMB, more="[baseline.fixed]\ninertia = 80.0\nviscous = 150.0")
    assert named(known) == {"actuator_gain"}
    got, error = value(known, "actuator_gain")
    assert abs(got - 0.1) < 4.0 * error
    mass_only = diagnosed(tmp_path / "b", force, terms=COULOMB, more="[baseline.fixed]\ninertia = 80.0")
    assert mass_only.verdict is Verdict.AMBIGUOUS
    ids = named(mass_only).union(*(contest.rival.ids for contest in mass_only.contests if contest.open))
    assert ids == {"actuator_gain", "inertia"}, "a wrong mass looks like a wrong gain"
    nothing = diagnosed(tmp_path / "c", force, terms=COULOMB)
    assert nothing.verdict is Verdict.CONSISTENT
    assert ("actuator_gain",) in [twins.ids for twins in nothing.twins]


def test_neither_a_zero_nor_a_fault_of_the_drive_tells_its_gain(tmp_path: Path) -> None:
    case = read_case(make_case(tmp_path, plain, 3, COULOMB))
    recorded, _ = read_recordings(case)
    library = {term.identifier: term for term in case.library}

    def tells(*known: SetTerm, fixed: dict[str, float] | None = None) -> bool:
        given = replace(case, known=known, fixed=fixed or {})
        return "actuator_gain" in {term.identifier for term in _searched_terms(given, recorded)}

    zero, delay, spring = (library[name] for name in ("constant_offset", "delay", "spring"))
    assert not tells()
    assert not tells(SetTerm(zero, np.zeros(1), error=0.1), SetTerm(zero, np.array([3.0])))
    assert not tells(SetTerm(delay, np.array([2e-3])), SetTerm(spring, np.zeros(1)))
    assert tells(SetTerm(spring, np.array([40.0])))
    assert tells(fixed={"inertia": 80.0})


def test_a_force_outside_the_library_is_said_to_be_so(tmp_path: Path) -> None:
    found = diagnosed(
        tmp_path,
        lambda m: plain(m) + 15.0 * np.sign(m.v) + 12.0 * np.exp(-(((m.q - 0.13) / 0.012) ** 2) / 2.0),
        terms=COULOMB,
    )
    assert found.verdict is Verdict.NOT_IN_LIBRARY
    assert any(place.name.startswith("position") for place in found.mismatch.locations)
    assert found.naming is not None
    assert "actuator_gain" not in {fit.identifier for fit in found.naming.ranking}, "nothing is known"
    near, lines = near_causes(found), nearest_lines(found)
    assert [line for line in lines if "of the mismatch" in line] == [
        f"{each.title}: {each.part} of the mismatch" for each in near
    ]
    assert bool(near) is not lines[0].startswith("No term")
    said = {each.question: " ".join(each.sentences) for each in machine_sheet(found, goes_on=False).answers}
    for each in near[:1]:
        assert f"The closest, {each.title}, explains {each.share:.0%} of it, but " in said["Cause"]
        assert each.test.rstrip(".")[1:] in said["Next test"]
    assert said["Next test"]


def test_a_ripple_is_named_with_its_period(tmp_path: Path) -> None:
    found = diagnosed(
        tmp_path,
        lambda m: plain(m) + 15.0 * np.sign(m.v) + 3.0 * np.sin(2.0 * np.pi * m.q / 0.0071),
        terms=COULOMB,
    )
    assert named(found) == {"position_ripple"}
    (period,) = [e for e in found.steps[-1].fitted.estimates if e.name == "p"]
    assert abs(period.value - 0.0071) < 4.0 * period.standard_error < 1e-4


def test_a_delay_is_named_with_its_sign(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, lambda m: np.interp(m.t + 0.004, m.t, plain(m)))
    assert named(found) == {"delay"}
    assert value(found, "delay")[0] == pytest.approx(0.004, abs=3e-4)
    assert re.fullmatch(r"the motion comes [34](\.\d+)? ms after the force", named_causes(found)[0].remark)
    assert lateness_of("delay", -2e-3, "torque") == "the torque comes 2 ms after the motion"


# --- laws ----------------------------------------------------------------------------------------------


@given(st.floats(-0.9, 0.9), st.integers(0, 2**31))
def test_whitened_noise_is_what_it_was_made_of(correlation: float, seed: int) -> None:
    news = np.random.default_rng(seed).standard_normal(3000)
    noise = fit_noise(lfilter([1.0], [1.0, -correlation], news))
    white = noise.whiten(noise.draw(3000, 1, np.random.default_rng(seed)))[:, 0]
    assert abs(float(np.std(white)) - 1.0) < 0.1
    assert abs(float(np.corrcoef(white[:-1], white[1:])[0, 1])) < 0.1
    assert noise.standard_deviation == pytest.approx(1.0 / np.sqrt(1.0 - correlation**2), rel=0.25)


@given(st.floats(-0.95, 0.95))
def test_neighbours_that_are_alike_count_for_fewer(correlation: float) -> None:
    """A first-order autoregression: the square of its correlations sums to (1 + a^2)/(1 - a^2)."""
    noise = SerialNoise(np.array([correlation]), 1.0, np.zeros(1))
    assert noise.for_one == pytest.approx((1.0 + correlation**2) / (1.0 - correlation**2), rel=1e-6)


def test_intervals_cover_under_correlated_noise_where_plain_ones_do_not() -> None:
    rng = np.random.default_rng(5)
    n, hits, plain_hits = 2400, 0, 0
    design = np.c_[np.ones(n), np.cumsum(rng.standard_normal(n)) / 30.0]
    inverse = np.linalg.inv(design.T @ design)
    for _ in range(200):
        noise = lfilter([1.0], [1.0, -0.9], rng.standard_normal(n + 200))[200:]
        got = np.linalg.lstsq(design, noise, rcond=None)[0]
        left = noise - design @ got
        error = np.sqrt(covariance_of(design, left, np.asarray(got, np.float64), BLOCKS)[0, 0])
        hits += abs(got[0]) < T_95 * error
        plain_hits += abs(got[0]) < 1.96 * np.sqrt(float(left @ left) / n * inverse[0, 0])
    assert 0.86 <= hits / 200 <= 0.99
    assert plain_hits / 200 < 0.7, "scatter alone makes intervals that are too short"


def test_every_term_finds_itself(tmp_path: Path) -> None:
    """A term's own columns as the force: nothing in the library explains it better."""
    case = read_case(make_case(tmp_path, plain, 1))
    recorded = read_one(case.fit[0], case)
    searched = tuple(t for t in DRIVE if t.identifier not in case.baseline and not t.of_model)
    tables = tabulate(recorded, searched)
    noise = fit_noise(np.random.default_rng(1).standard_normal(len(recorded.force)))
    base = np.hstack([recorded.columns(t) for t in DRIVE[:2]])
    problem = term_problem(recorded, tables, noise, base)
    for term in searched:
        table = problem.tables[term.key]
        force = problem.project(table.columns[:, len(table.shapes) // 3])[:, 0]
        own = replace(problem, left=10.0 * force)
        gains = {other.key: fit_term(own, other, refine=False).gain for other in searched}
        assert gains[term.key] == pytest.approx(100.0 * float(force @ force), rel=1e-6)
        assert max(gains.values()) <= gains[term.key] * (1.0 + 1e-6)


# --- files ---------------------------------------------------------------------------------------------


def test_page_tables_and_document_are_written_and_the_same_each_time(tmp_path: Path) -> None:
    case = make_case(tmp_path, lambda m: plain(m) + 15.0 * np.sign(m.v), 3)
    first, again = (run_terms(case, tmp_path / name) for name in ("one", "two"))
    assert first.mismatch
    assert first.data["verdict"] == "named"
    for name in ("terms.json", "residuals.csv", "report.html"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    document = json.loads((tmp_path / "one" / "terms.json").read_text())
    assert document["schema"] == "pmg.terms-diagnosis/1"
    rows = list(csv.DictReader((tmp_path / "one" / "residuals.csv").read_text().splitlines()))
    before, after = (np.array([float(row[f"residual_{name} [N]"]) for row in rows]) for name in ("baseline", "named"))
    force = np.array([float(row["force [N]"]) for row in rows])
    for left, model in ((before, document["models"][0]), (after, document["models"][-1])):
        assert np.linalg.norm(left) / np.linalg.norm(force) == pytest.approx(model["relative_error_fit"], rel=1e-6)
    assert all(line for line in again.lines[:1])


DAMAGED_CASES = (
    ('schema = "pmg.terms/1"', 'schema = "pmg.terms/9"', "schema"),
    ('library = "drive"', 'library = "dirve"', "library"),
    ("rate_Hz = 200", "rate_Hz = -1", "rate_Hz"),
    ("rate_Hz = 200", "rate = 200", "prepare.rate"),
    ("low_pass_Hz = 40", "low_pass_Hz = 99", "low_pass_Hz"),
    ("keep_every = 2", "keep_every = 2.5", "keep_every"),
    ("drop = 20", "drop = true", "drop"),
    ('unit = "mm"', 'unit = "inch"', "unit"),
    (", newton_per_unit = 40.0", "", "newton_per_unit"),
    ("newton_per_unit = 40.0", "newton_per_unit = 0.0", "newton_per_unit"),
    ('"inertia", "viscous"', '"inertia", "viscuos"', "terms"),
    ('"inertia", "viscous"', '"inertia", "inertia"', "terms"),
    ('"inertia", "viscous"', "", "terms"),
    ('"inertia", "viscous"', '"stribeck"', "terms"),
    ("[prepare]", "[prepaer]", "prepaer"),
    ('fit = "fit.csv"', "fit = 3", "fit"),
    ("[channels]", "[channels", "case.toml"),
    ('title = "A slide made for a test"', 'title = "A slide"\nsubtitle = "x"', "subtitle"),
)


@pytest.mark.parametrize(("old", "new", "place"), DAMAGED_CASES)
def test_a_damaged_case_is_refused_with_its_place(tmp_path: Path, old: str, new: str, place: str) -> None:
    path = make_case(tmp_path, plain, 1)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(BenchError) as caught:
        read_case(path)
    assert place in caught.value.where
    assert all((caught.value.came, caught.value.expected, caught.value.do))


@pytest.mark.parametrize("fixed", ["coulomb = 3.0", "inertia = -5.0", "inertia = 80.0\nviscous = 1.0", 'inertia = "x"'])
def test_known_amplitudes_are_checked(tmp_path: Path, fixed: str) -> None:
    path = make_case(tmp_path, plain, 1, more=f"[baseline.fixed]\n{fixed}")
    with pytest.raises(BenchError, match="fixed"):
        read_case(path)


def _cut(lines: list[str]) -> list[str]:
    return lines[:300]


def _blank(lines: list[str]) -> list[str]:
    return [*lines[:400], lines[400].rsplit(",", 1)[0] + ",", *lines[401:]]


def _word(lines: list[str]) -> list[str]:
    return [lines[0], *(line.rsplit(",", 1)[0] + ",off" for line in lines[1:])]


def _still(lines: list[str]) -> list[str]:
    return [lines[0], *(",".join((line.split(",")[0], "1.0", line.split(",")[2])) for line in lines[1:])]


def _renamed(lines: list[str]) -> list[str]:
    return ["t,qq,u", *lines[1:]]


@pytest.mark.parametrize("damage", [_cut, _blank, _word, _still, _renamed], ids=lambda f: f.__name__)
def test_a_damaged_recording_is_refused(tmp_path: Path, damage: Callable[[list[str]], list[str]]) -> None:
    case = read_case(make_case(tmp_path, plain, 1))
    case.fit[0].write_text("\n".join(damage(case.fit[0].read_text().splitlines())) + "\n")
    with pytest.raises(RecordingError) as caught:
        read_one(case.fit[0], case)
    assert all((caught.value.came, caught.value.expected, caught.value.do))


@pytest.mark.parametrize("name", ["absent.csv", "fit.xlsx", "broken.mat"])
def test_a_file_that_is_no_recording_is_refused(tmp_path: Path, name: str) -> None:
    case = read_case(make_case(tmp_path, plain, 1))
    if name != "absent.csv":
        (tmp_path / name).write_bytes(b"not a recording\n" * 40)
    with pytest.raises(PmgError):
        read_one(tmp_path / name, case)


# --- the real drive ------------------------------------------------------------------------------------

EMPS = Path(os.environ.get("PMG_EMPS", ROOT / "raw" / "emps"))


@pytest.mark.skipif(not (EMPS / "DATA_EMPS.mat").is_file(), reason="EMPS is not shipped; PMG_EMPS names its folder")
def test_the_published_model_of_emps_comes_out() -> None:
    case = case_of(read_machine(shipped()["emps"]), EMPS)
    assert case.withheld
    recorded, withheld = read_one(case.fit[0], case), read_one(case.withheld[0], case)
    terms = {term.identifier: term for term in DRIVE}
    free = tuple(terms[name] for name in ("inertia", "viscous", "coulomb", "constant_offset"))
    fitted = fit_together(recorded, fit_noise(recorded.force), free, ())
    for estimate, published in zip(fitted.estimates, case.published, strict=True):
        assert (estimate.term, estimate.unit) == (published.term, published.unit)
        assert abs(estimate.value - published.value) < 0.002 * abs(published.value) + 0.005
    assert fitted.relative_error(recorded) == pytest.approx(case.published_errors["fit"], abs=1e-3)
    assert fitted.relative_error(withheld) == pytest.approx(case.published_errors["withheld"], abs=1e-3)
