"""What the page and the summary tell of a mechanism that warms: sizes, evidence, temperature, numbers for programs."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import jsonschema
import numpy as np
import pytest
from tests.report.example import report
from tests.trials.strata_by_name import find_stratum

from pmg.pipeline.chapters.explained.action_sheet import action_sheet
from pmg.pipeline.chapters.explained.verdict import diagnosis_section
from pmg.pipeline.chapters.measured.neutral import neutral_section
from pmg.pipeline.commands.compare_and_diagnose import compare_and_diagnose, summary_facts
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.decide import JUDGE_DRAWS
from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis, Rival
from pmg.pipeline.diagnosis.grid.statement import statement, taken_up
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.losses import power_balance
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.model.compared_campaign import ComparedCampaign
from pmg.pipeline.report.document import Chart, Figure, Measured, Section, Table
from pmg.pipeline.report.summary import summary
from pmg.pipeline.trials.nature import draw_case, measure_case
from pmg.pipeline.wording import numerals
from pmg.sim.bench import load_bench
from pmg.sim.mechanisms.warmed import WarmingBearings
from pmg.sim.signals import Array

SCHEMA = Path(__file__).resolve().parents[2] / "pipeline" / "report" / "summary.schema.json"


@pytest.fixture(scope="module")
def analysed() -> Analysis:
    """A campaign of the proving bench whose ring bearings warm."""
    rng = np.random.default_rng(1000)
    grid = measure_case(draw_case(find_stratum("lubricant_viscosity ring 4"), rng), rng)
    return analyse(grid, AnalysisOptions(), load_bench())


@pytest.fixture(scope="module")
def judged(analysed: Analysis) -> ComparedCampaign:
    found = compare_and_diagnose(analysed, AnalysisOptions(), load_bench(), np.random.default_rng(7))
    assert found is not None
    assert found.diagnosis.naming is not None
    assert found.diagnosis.refit is not None
    return found


def page(diagnosis: Diagnosis) -> Section:
    readings = diagnosis.mismatch.readings
    return diagnosis_section(diagnosis, np.zeros(len(readings.torque)))


def table(section: Section, name: str) -> Table:
    return next(item for item in section.items if isinstance(item, Table) and item.id == name)


def test_the_head_leads_with_what_is_left_to_see_and_says_what_the_whole_is_counted_from(
    judged: ComparedCampaign,
) -> None:
    diagnosis = judged.diagnosis
    assert diagnosis.naming is not None
    (fit,) = diagnosis.naming.best.fits
    visible = diagnosis.naming.best.problem.visible(fit)
    assert visible == pytest.approx(diagnosis.mismatch.locations[0].size, rel=0.3)
    assert fit.size > 2.0 * visible
    repeatability = diagnosis.floor.ring.u * 1e3
    said = statement(diagnosis)
    assert f"mN m beyond the fitted losses (repeatability is {repeatability:.1f} mN m)" in said
    full = f"Against bearings at room temperature, its full effect is {fit.size * 1e3:.1f} mN m rms"
    assert f"{full}; the fitted losses absorb all but {visible * 1e3:.1f} mN m." in said


def test_the_drag_that_a_cause_changes_has_the_size_that_is_said(judged: ComparedCampaign) -> None:
    diagnosis = judged.diagnosis
    assert diagnosis.naming is not None
    (fit,) = diagnosis.naming.best.fits
    found = re.search(r"It changes the ring drag by ([−+][\d.]+) to ([−+][\d.]+) mN m", statement(diagnosis))
    assert found is not None
    low, high = (float(found[i].replace("−", "-")) for i in (1, 2))
    assert low < 0.0 < high
    assert high - low < 4.0 * fit.size * 1e3
    assert max(-low, high) > diagnosis.naming.best.problem.visible(fit) * 1e3


def test_a_sentence_of_the_verdict_has_one_thought(judged: ComparedCampaign) -> None:
    for sentence in re.split(r"(?<=[.;:]) (?=[A-Za-z])", statement(judged.diagnosis)):
        assert len(re.findall(r"[A-Za-z]{2,}", sentence)) <= 20, sentence


def test_what_the_baseline_could_take_up_is_not_left_to_see(judged: ComparedCampaign) -> None:
    naming = judged.diagnosis.naming
    assert naming is not None
    stage, (fit,) = naming.best.problem, naming.best.fits
    more = fit.effect + stage.columns @ np.full(stage.columns.shape[1], 1e-3)
    swollen = replace(fit, effect=more, seen=stage.beyond_baseline(more))
    plain = replace(fit, seen=stage.beyond_baseline(fit.effect), effect=more)
    assert naming.best.problem.visible(swollen) == pytest.approx(naming.best.problem.visible(plain), rel=1e-6)
    assert swollen.size != pytest.approx(fit.size, rel=0.01)


def test_the_ranking_falls_by_the_column_it_is_sorted_by(judged: ComparedCampaign) -> None:
    naming = judged.diagnosis.naming
    assert naming is not None
    ranking = table(page(judged.diagnosis), "ranking")
    names = [column.name for column in ranking.columns]
    evidence, gain, cost = ([cast("float", row[names.index(n)]) for row in ranking.rows] for n in names[2:5])
    assert names[2] == "evidence"
    assert evidence == sorted(evidence, reverse=True)
    each = math.log(len(naming.best.problem.left))
    assert evidence == pytest.approx([g - c * each for g, c in zip(gain, cost, strict=True)])
    assert f"{each:.2f} for each parameter" in ranking.caption
    smallest = replace(naming, remainder=replace(naming.remainder, p_value=1.0 / (JUDGE_DRAWS + 1.0)))
    assert "(p ≤ 0.003)" in table(page(replace(judged.diagnosis, naming=smallest)), "ranking").caption


def test_the_ranking_names_no_parameter_by_its_field_and_says_where_a_detailed_form_was_named(
    judged: ComparedCampaign,
) -> None:
    naming = judged.diagnosis.naming
    assert naming is not None
    ranking = table(page(judged.diagnosis), "ranking")
    bounds = {str(row[-1]) for row in ranking.rows}
    fields = {name for fit in naming.ranking for name in fit.on_bound}
    assert fields
    assert not {part for told in bounds for part in told.split(", ")} & fields
    (named,) = naming.best.fits
    simple = next(row for row in ranking.rows if row[0] == named.candidate.kind.title)
    assert named.cost > cast("float", simple[4])
    assert f"its detailed one, with {named.cost} parameters" in ranking.caption


def test_the_clearest_place_is_drawn_above_the_fitted_temperature(judged: ComparedCampaign) -> None:
    diagnosis = judged.diagnosis
    assert diagnosis.naming is not None
    assert diagnosis.refit is not None
    figure = next(i for i in page(diagnosis).items if isinstance(i, Figure) and i.id == "located-structure")
    _, below = figure.panels
    assert isinstance(below, Chart)
    (mechanism,) = diagnosis.refit.mechanisms(diagnosis.naming.best.problem)
    assert isinstance(mechanism, WarmingBearings)
    at = diagnosis.mismatch.readings.grid.points
    order = np.argsort(at.started_at, kind="stable")
    assert below.series[0].y == pytest.approx(mechanism.rises(at).ring[order])
    assert (np.diff(below.series[0].x) >= 0.0).all()
    low, high = below.series[0].y.min(), below.series[0].y.max()
    assert f"{low:.1f} to {high:.1f} K over the campaign" in figure.caption.replace("−", "-")


def test_without_a_named_cause_the_clearest_place_stands_alone(judged: ComparedCampaign) -> None:
    section = page(replace(judged.diagnosis, refit=None, rivals=(), absorbed=()))
    figure = next(item for item in section.items if isinstance(item, Figure) and item.id == "located-structure")
    assert len(figure.panels) == 1
    assert "Zero is" not in figure.caption


def test_constants_carry_their_uncertainty_without_and_with_the_mechanism(
    analysed: Analysis, judged: ComparedCampaign
) -> None:
    assert analysed.calibration is not None
    for row in judged.diagnosis.absorbed:
        assert row.error_before == analysed.calibration.standard_error(row.parameter)
    alone = [row[1] for row in table(page(judged.diagnosis), "absorbed").rows]
    assert any(isinstance(cell, Measured) and cell.u > 0.0 for cell in alone)


def test_programs_are_told_the_word_the_mechanism_and_the_counts(analysed: Analysis, judged: ComparedCampaign) -> None:
    found = summary(report(), {}, summary_facts(analysed.grid, judged, load_bench()))
    jsonschema.validate(found, json.loads(SCHEMA.read_text(encoding="utf-8")))
    assert found["verdict"]["diagnosis"] == str(judged.diagnosis.verdict)
    (mechanism,) = found["facts"]["mechanisms"]
    assert (mechanism["id"], mechanism["shaft"]) == ("lubricant_viscosity", "ring")
    assert judged.diagnosis.refit is not None
    errors = judged.diagnosis.refit.standard_errors[0]
    told: list[Any] = [parameter["u"] for parameter in mechanism["parameters"]]
    assert [u is not None for u in told] == np.isfinite(errors).tolist()
    counts = found["facts"]["tolerance"]
    assert all(sum(of.values()) == len(analysed.grid) for of in counts.values())
    assert counts["torque_ring"]["out"] > 0
    json.dumps(found, allow_nan=False)


def test_a_campaign_that_was_not_compared_tells_its_points_alone(analysed: Analysis) -> None:
    assert set(summary_facts(analysed.grid, None, load_bench())) == {"points"}


def test_probabilities_of_the_neutral_chapter_are_numbers(analysed: Analysis) -> None:
    assert analysed.fits is not None
    section = neutral_section(analysed, analysed.fits)
    known = 0
    for item in section.items:
        if not isinstance(item, Table):
            continue
        for place, column in enumerate(item.columns):
            if re.fullmatch(r"p|p_holm|trend_p", column.name):
                cells = [row[place] for row in item.rows]
                assert all(cell is None or isinstance(cell, float) for cell in cells)
                known += sum(cell is not None for cell in cells)
    assert known


def answers_of(diagnosis: Diagnosis, residual: Array, unsettled: tuple[str, ...] = ()) -> dict[str, str]:
    """Answers of the sheet by their questions."""
    sheet = action_sheet(diagnosis, residual, unsettled=unsettled)
    return {each.question: " ".join(each.sentences) for each in sheet.answers}


def test_the_sheet_answers_where_why_how_sure_what_to_do_and_at_what_cost(judged: ComparedCampaign) -> None:
    diagnosis = judged.diagnosis
    assert diagnosis.naming is not None
    assert diagnosis.refit is not None
    readings = diagnosis.mismatch.readings
    off = diagnosis.naming.best.fits[0].effect
    sheet = action_sheet(diagnosis, readings.torque - diagnosis.refit.prediction + off)
    assert [part.group for part in sheet.parts if part.mark == "cause"] == ["ring"]
    said = {each.question: " ".join(each.sentences) for each in sheet.answers}
    asked = ["Verdict", "What differs", "How sure", "On the bench", "Next test", "In the model", "If ignored"]
    assert [*said] == asked
    name = "Cause named: lubricant viscosity falling with temperature on the ring shaft. Fitted: "
    assert said["Verdict"].startswith(name)
    assert "`pmg next --store STORE --out DIR`" in said["Next test"]
    test = diagnosis.confirming
    assert test is not None
    assert said["Next test"].startswith(f"To confirm: {test.plan.description} ({test.plan.seconds / 60.0:.0f} min; ")
    assert "over 99% likely to show it again" in said["Next test"]
    assert len(re.findall("rms", " ".join(said.values()))) == 0
    assert said["What differs"].startswith("The ring drag is off: ")
    assert "`pmg compare --model model.toml`" in said["In the model"]
    loss = np.bincount(readings.row, off * readings.speed_own)
    most = float(np.abs(loss).max())
    assert f"up to {most:.2g} W" in said["If ignored"]
    (chart,) = sheet.figure.panels if sheet.figure is not None else ()
    assert isinstance(chart, Chart)
    band, before, after = chart.series
    assert np.std(after.y) < np.std(before.y)
    assert band.u is not None


def _consistent(judged: ComparedCampaign) -> Diagnosis:
    """The same campaign as if nothing differed in it."""
    return replace(
        judged.diagnosis,
        verdict=Verdict.CONSISTENT,
        naming=None,
        refit=None,
        held_out=None,
        mismatch=replace(judged.diagnosis.mismatch, p_value=0.5, locations=()),
    )


def test_a_sheet_without_a_cause_says_so_and_costs_what_the_places_cost(judged: ComparedCampaign) -> None:
    quiet = _consistent(judged)
    residual = np.zeros(len(quiet.mismatch.readings.torque))
    said = answers_of(quiet, residual)
    assert said["What differs"].startswith("Nothing beyond repeatability")
    assert said["On the bench"] == "Nothing."
    assert said["If ignored"].startswith("Nothing")
    assert {part.mark for part in action_sheet(quiet, residual).parts} == {""}
    unknown = replace(judged.diagnosis, verdict=Verdict.NOT_IN_LIBRARY, refit=None)
    assert "we can show where, not why. The closest, " in answers_of(unknown, residual)["Cause"]
    proof = judged.diagnosis.held_out
    assert proof is not None
    for left, said_so in ((0.5 * proof.noise_floor, True), (proof.noise_floor, False)):
        repeated = replace(unknown, held_out=replace(proof, rmse_after=left))
        assert ("repeats show the pattern too" in answers_of(repeated, residual)["What differs"]) is said_so
    assert unknown.naming is not None
    for naming, why in (
        (replace(unknown.naming, explained=True), "but fails on readings not used for the fit."),
        (replace(unknown.naming, explained=False), "but leaves more than noise."),
        (replace(unknown.naming, explained=False, against="cannot be"), "but cannot be."),
    ):
        assert answers_of(replace(unknown, naming=naming), residual)["Cause"].endswith(why)
    place, readings = unknown.mismatch.locations[0], unknown.mismatch.readings
    one = replace(unknown, mismatch=replace(unknown.mismatch, locations=(place,)))
    loss = np.bincount(readings.row, place.effect * readings.speed_own * (readings.configuration != "zero"))
    assert f"up to {np.abs(loss).max():.2g} W" in answers_of(one, residual)["If ignored"]
    blind = replace(quiet, verdict=Verdict.CONFOUNDED, blind=("sun",))
    assert "in the order of the sun speed" in answers_of(blind, residual)["What differs"]
    assert "random order" in answers_of(blind, residual)["Next test"]
    assert "Slow changes are neither shown nor excluded" in answers_of(blind, residual)["How sure"]
    assert "beyond repeatability (p = 0.5). This campaign cannot tell." in statement(blind)
    drifting = replace(blind, mismatch=judged.diagnosis.mismatch)
    assert re.search(r"the order of the test \(p ≤ [\d.e-]+\)\. Drift may be the reason\.", statement(drifting))


def test_a_consistent_sheet_says_how_large_a_fault_could_still_hide(judged: ComparedCampaign) -> None:
    quiet = _consistent(judged)
    audit = quiet.audit
    assert audit is not None
    residual = np.zeros(len(quiet.mismatch.readings.torque))
    said, hidden = (answers_of(quiet, residual)[question] for question in ("How sure", "Not visible"))
    seen = [row for row in audit.visible if not row.unseen]
    never = {row.candidate.kind.title for row in audit.visible if row.unseen}
    largest = max((row for row in seen if row.candidate.kind.title not in never), key=lambda row: row.size_95)
    assert f"{largest.candidate.kind.title.lower()} {largest.size_95 * 1e3:.1f}" in said.lower()
    assert all(title.lower() in hidden.lower() for title in never)
    blind = answers_of(replace(quiet, audit=None), residual)
    assert "Not visible" not in blind
    assert "Found in 95 of 100" in said
    assert "Found in 95 of 100" not in blind["How sure"]


def test_what_begins_warm_is_not_to_be_warmed_up(judged: ComparedCampaign) -> None:
    diagnosis = judged.diagnosis
    assert diagnosis.naming is not None
    assert diagnosis.refit is not None
    (fit,) = diagnosis.naming.best.fits
    names = [parameter.name for parameter in fit.candidate.parameters]
    cold, warm = (
        np.where([name == "start_ring" for name in names], start, diagnosis.refit.values[0]) for start in (0.0, 40.0)
    )
    for values, words in (
        (cold, "Log the temperature, and warm up first."),
        (warm, "the ring bearings start above their mean"),
    ):
        moved = replace(diagnosis, refit=replace(diagnosis.refit, values=(values,)))
        assert words in answers_of(moved, np.zeros(len(diagnosis.mismatch.readings.torque)))["On the bench"]
        assert ("warm up first" in statement(moved)) is (values is cold)


def test_what_a_fault_of_a_reading_costs_is_what_the_warning_says(judged: ComparedCampaign) -> None:
    diagnosis = judged.diagnosis
    assert diagnosis.naming is not None
    (fit,) = diagnosis.naming.best.fits
    fault = next(each for each in diagnosis.naming.ranking if each.identifier == "torque_gain_error")
    assert diagnosis.refit is not None
    best = replace(diagnosis.naming.best, fits=(fault,))
    naming = replace(diagnosis.naming, best=best, shafts={fault.identifier: "either"})
    found = replace(
        diagnosis.refit, candidates=(fault.candidate,), values=(fault.values,), standard_errors=(0.0 * fault.values,)
    )
    misread = replace(diagnosis, naming=naming, refit=found)
    residual = np.zeros(len(fit.effect))
    sheet = action_sheet(misread, residual, "", "At P1 the total loss is 5 W as read.")
    said = {each.question: " ".join(each.sentences) for each in sheet.answers}
    assert said["If ignored"] == "At P1 the total loss is 5 W as read."
    assert f" {numerals.number(100.0 * float(fault.values[0]))} ± 0 %" in said["Verdict"]
    assert {part.mark for part in sheet.parts} == {"", "either"}


def test_an_ambiguous_sheet_marks_every_possible_part_and_speaks_of_no_sure_cause(judged: ComparedCampaign) -> None:
    diagnosis = judged.diagnosis
    assert diagnosis.naming is not None
    other = next(fit for fit in diagnosis.naming.ranking if fit.candidate.shaft == "sun" and fit.admissible)
    rival = Rival(replace(diagnosis.naming.best, fits=(other,)), None)
    open_still = replace(diagnosis, verdict=Verdict.AMBIGUOUS, rivals=(rival,))
    sheet = action_sheet(open_still, np.zeros(len(diagnosis.mismatch.readings.torque)))
    marked = {part.group for part in sheet.parts if part.mark == "possible"}
    assert {"sun", "ring"} <= marked
    assert "cause" not in {part.mark for part in sheet.parts}
    (cost,) = (each for each in sheet.answers if each.question == "If ignored")
    assert cost.sentences[0].startswith("If the first is the cause, a model without it is wrong by up to ")
    (possible,) = (each for each in sheet.answers if each.question == "Possible causes")
    assert [sentence[:2] for sentence in possible.sentences] == ["1.", "2."]
    assert sheet.figure is not None
    (chart,) = sheet.figure.panels
    assert isinstance(chart, Chart)
    assert [series.name for series in chart.series][-1] == "with the first possible cause"


@pytest.mark.parametrize(("power", "promised"), [(0.13, False), (0.5, True), (0.86, True)])
def test_a_test_is_promised_to_tell_only_where_it_is_likely_to(
    judged: ComparedCampaign, power: float, promised: bool
) -> None:
    diagnosis = judged.diagnosis
    assert diagnosis.naming is not None
    assert diagnosis.confirming is not None
    rival = Rival(diagnosis.naming.best, replace(diagnosis.confirming, power=power))
    said = answers_of(
        replace(diagnosis, verdict=Verdict.AMBIGUOUS, rivals=(rival,)),
        np.zeros(len(diagnosis.mismatch.readings.torque)),
    )
    assert said["On the bench"] == f"Repair nothing yet{': the next test tells' * promised}."
    assert ("Too weak to rely on" in said["Next test"]) is not promised
    assert f"{power:.0%} likely to tell them apart" in said["Next test"]


@pytest.mark.parametrize(("times", "told"), [(2.9, False), (3.1, True)])
def test_the_whole_effect_is_told_where_the_fitted_losses_take_up_most_of_it(
    judged: ComparedCampaign, times: float, told: bool
) -> None:
    diagnosis = judged.diagnosis
    assert diagnosis.naming is not None
    (fit,) = diagnosis.naming.best.fits
    whole = times * diagnosis.naming.best.problem.unabsorbed(fit)
    said = taken_up(diagnosis, replace(fit, effect=whole))
    most = float(np.abs(whole[diagnosis.mismatch.readings.of_shaft["ring"]]).max())
    words = f" The whole effect is up to {most * 1e3:.0f} mN m: the fitted losses already hold most of it."
    assert said == words * told


def test_a_point_without_a_ring_torque_takes_no_efficiency_away(judged: ComparedCampaign) -> None:
    """A neutral point may lack the ring's torque; what loaded points cost is told all the same."""
    diagnosis = judged.diagnosis
    assert diagnosis.refit is not None
    readings = diagnosis.mismatch.readings
    points = readings.grid.points
    lacking = np.where(points.engaged, points.torque_ring, np.nan)
    grid = replace(readings.grid, points=replace(points, torque_ring=lacking))
    unsure = replace(diagnosis, mismatch=replace(diagnosis.mismatch, readings=replace(readings, grid=grid)))
    residual = readings.torque - diagnosis.refit.prediction + 0.01 * readings.direction
    said = answers_of(unsure, residual)["If ignored"]
    assert ("points of efficiency" in said) is bool(points.engaged[readings.row].any())


@pytest.mark.parametrize("drive", ["sun", "ring"])
def test_points_of_efficiency_are_those_of_the_power_balance_in_either_flow(
    analysed: Analysis, judged: ComparedCampaign, drive: str
) -> None:
    diagnosis, balance = judged.diagnosis, analysed.balance
    assert diagnosis.naming is not None
    assert diagnosis.refit is not None
    assert analysed.fits is not None
    assert balance is not None
    readings = diagnosis.mismatch.readings
    at, grid = readings.grid.points, readings.grid
    k = int(np.flatnonzero(at.engaged[readings.row] & (at.drive[readings.row] == drive))[0])
    wrong = np.where(np.arange(len(readings)) == k, 0.3 * readings.torque[k], 0.0)
    best = diagnosis.naming.best
    one = replace(
        diagnosis, naming=replace(diagnosis.naming, best=replace(best, fits=(replace(best.fits[0], effect=wrong),)))
    )
    said = answers_of(one, readings.torque - diagnosis.refit.prediction + wrong)["If ignored"]
    moved = grid.torque_sun.copy()
    moved[readings.row[k]] -= wrong[k]
    before, after = (
        power_balance(each, analysed.fits, balance.correction).values["efficiency_total"]
        for each in (grid, replace(grid, torque_sun=moved))
    )
    assert f", and {100.0 * np.abs(after - before).max():.2g} points of efficiency" in said


def test_a_campaign_that_contradicts_itself_is_settled_first(judged: ComparedCampaign) -> None:
    """Whatever the verdict; and no record of campaigns that did not contradict themselves stands beside it."""
    do = ("Check the counts per turn.", "Check both cables.")
    for diagnosis in (judged.diagnosis, _consistent(judged)):
        residual = np.zeros(len(diagnosis.mismatch.readings.torque))
        plain, said = (answers_of(diagnosis, residual, each) for each in ((), do))
        assert said["On the bench"].startswith("First: check the counts per turn. Check both cables.")
        assert (plain["On the bench"] in said["On the bench"]) == (diagnosis.verdict is not Verdict.CONSISTENT)
        assert said["How sure"].startswith("The recordings contradict themselves")
        assert ("every number" in said["If ignored"]) == (diagnosis.verdict is Verdict.CONSISTENT)
        assert ("simulated cases" in plain["How sure"]) == (diagnosis.verdict is not Verdict.CONSISTENT)
        assert "simulated cases" not in said["How sure"]
