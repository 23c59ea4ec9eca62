"""The next test: readings to be expected cover what is then read, and the sheet says it in order."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.report import chromium
from tests.trials.strata_by_name import find_stratum

from pmg.pipeline.commands.at_bench.next_sheet import _question
from pmg.pipeline.commands.at_bench.sheet_page import BenchSheet, SheetRow, sheet_csv, sheet_page
from pmg.pipeline.diagnosis.design.expected_readings import ExpectedReadings, expected_readings
from pmg.pipeline.diagnosis.design.next_test import NextTest, confirming_test, repeated_test
from pmg.pipeline.diagnosis.design.plans import Plan
from pmg.pipeline.diagnosis.grid.candidates import GridProblem, candidates, grid_problem
from pmg.pipeline.diagnosis.grid.fitting import fit_candidate
from pmg.pipeline.diagnosis.grid.locate import Location
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.noise import NoiseFloor
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.pipeline.trials.nature import draw_case, measure_case
from pmg.sim.bench import BenchParameters
from pmg.sim.grid import Grid, OperatingPoints
from pmg.sim.mechanisms import Experiment

if TYPE_CHECKING:
    from pathlib import Path

BANDS = ((0.25, 0.26), (0.3, 0.31))


@pytest.fixture(scope="module")
def halved(bench: BenchParameters) -> tuple[GridProblem, NoiseFloor, Grid, Plan]:
    """The problem of every other point of a clean campaign, and the points left out as a plan."""
    rng = np.random.default_rng(5)
    grid = measure_case(draw_case(find_stratum("clean"), rng), rng)
    out = np.arange(len(grid)) % 2 == 1
    out &= ~grid.points.zero
    analysis = analyse(replace(grid, accepted=grid.accepted & ~out), AnalysisOptions(), bench)
    assert analysis.floor is not None
    assert analysis.calibration is not None
    readings = take_readings(analysis.grid, bench)
    problem = grid_problem(readings, bench, analysis.calibration.model, whitener(readings, bench, analysis.floor))
    at = grid.points
    columns = {name: getattr(at, name)[out] for name in OperatingPoints.__annotations__}
    plan = Plan(Experiment.REPEATS, "the points left out", OperatingPoints(**columns), 60.0)
    return problem, analysis.floor, grid, plan


def test_bands_hold_what_is_read_at_points_that_took_no_part(
    halved: tuple[GridProblem, NoiseFloor, Grid, Plan],
) -> None:
    problem, floor, grid, plan = halved
    (cause,) = [one for one in candidates() if (one.identifier, one.shaft) == ("windage", "sun")]
    fit = fit_candidate(problem, cause)
    expected = expected_readings(problem, plan, {"without": (), "windage": (fit,)}, floor)
    rows = np.flatnonzero((np.arange(len(grid)) % 2 == 1) & ~grid.points.zero)[expected.point]
    read = np.where(expected.sun, grid.torque_sun[rows], grid.torque_ring[rows])
    inside = (expected.low("without") <= read) & (read <= expected.high("without"))
    assert np.mean(inside) > 0.85
    assert np.median(expected.u["without"]) < 3.0 * max(floor.sun.u, floor.ring.u)
    assert np.all(expected.u["windage"] >= 0.9 * expected.u["without"])  # a further parameter does not narrow a band


def test_a_named_cause_is_confirmed_by_an_experiment_that_reveals_it(
    halved: tuple[GridProblem, NoiseFloor, Grid, Plan],
) -> None:
    problem, floor, _, _ = halved
    (cause,) = [one for one in candidates() if (one.identifier, one.shaft) == ("windage", "sun")]
    fit = replace(fit_candidate(problem, cause), values=np.array([p.typical for p in cause.parameters]))
    test = confirming_test(problem, (fit,), floor)
    assert test is not None
    known = {reveals.experiment for reveals in cause.kind.revealed_by}
    assert test.plan.experiment in known or not known & set(Experiment)


def test_a_difference_that_nothing_explains_is_looked_for_again_where_it_is_largest(
    halved: tuple[GridProblem, NoiseFloor, Grid, Plan],
) -> None:
    problem, floor, grid, _ = halved
    readings = problem.readings
    bump = np.exp(-(((readings.speed_own - 100.0) / 30.0) ** 2))
    hump = np.where(readings.sun & (readings.configuration == "neutral"), bump, 0.0)
    found = []
    for size in (0.1 * floor.sun.u, 30.0 * floor.sun.u):
        place = Location("torque_sun", "neutral", (), (), {}, size, size, 0.01, size * hump)
        found.append(repeated_test(problem, (place,), floor))
    faint, clear = found
    assert faint is not None
    assert clear is not None
    assert faint.power < 0.5 < 0.95 < clear.power
    assert repeated_test(problem, (), floor) is None
    largest = readings.grid.points.name[readings.row[int(np.argmax(hump))]]
    assert largest in clear.plan.points.name
    assert set(clear.plan.points.name) <= set(grid.points.name)
    assert np.all(np.diff(clear.plan.points.started_at) > 0.0)


def test_the_points_that_agree_are_comparable_agree_best_and_spread_over_the_test(
    halved: tuple[GridProblem, NoiseFloor, Grid, Plan],
) -> None:
    problem, floor, _, _ = halved
    readings, grid = problem.readings, problem.readings.grid
    own = np.flatnonzero(readings.sun & (readings.configuration == "neutral"))
    effect = np.zeros(len(readings))
    effect[own[:4]] = 30.0 * floor.sun.u
    place = Location("torque_sun", "neutral", (), (), {}, 0.1, 0.1, 0.01, effect)
    test = repeated_test(problem, (place,), floor)
    assert test is not None
    differ = set(grid.points.name[readings.row[own[:4]]])
    agree = sorted(np.flatnonzero(np.isin(grid.points.name, [n for n in test.plan.points.name if n not in differ])))
    assert differ <= set(test.plan.points.name)
    assert test.plan.description.startswith("The 4 points that differ most and 4 that agree")
    left = np.abs(readings.torque - problem.predicted)
    others = own[4:][np.argsort(grid.points.started_at[readings.row[own[4:]]])]
    best = [part[np.argmin(left[part])] for part in np.array_split(others, 4)]
    assert agree == sorted(readings.row[best])
    none = replace(place, effect=np.zeros(len(readings)))
    assert repeated_test(problem, (none,), floor) is None


def test_repeated_points_are_said_to_point_to_a_cause_not_to_prove_it(
    halved: tuple[GridProblem, NoiseFloor, Grid, Plan], bench: BenchParameters
) -> None:
    problem, floor, _, plan = halved
    whole: Any = SimpleNamespace(
        bench=bench, analysis=SimpleNamespace(calibration=SimpleNamespace(model=problem.model))
    )
    unknown: Any = SimpleNamespace(
        mismatch=SimpleNamespace(readings=problem.readings),
        floor=floor,
        naming=None,
        lifting=None,
        repeated=NextTest(plan, (), 1.0),
    )
    asked = _question(whole, unknown)
    assert asked is not None
    assert asked.words.count("points to") == 2


def test_a_reading_tells_where_no_two_bands_meet() -> None:
    value = {"A": np.array([0.0, 0.0]), "B": np.array([1.0, 0.3])}
    u = {"A": np.array([0.1, 0.1]), "B": np.array([0.2, 0.1])}
    expected = ExpectedReadings(np.array([0, 1]), np.array([True, True]), value, u)
    assert expected.apart == pytest.approx([0.4, -0.1])


def test_the_sheet_and_its_csv_hold_every_point_in_order() -> None:
    row = SheetRow(
        0.0, 45.0, "neutral", "both", 1, 936.0, 480.0, None, "ring torque", ((0.25, 0.26), (0.3, 0.31)), True
    )
    loaded = replace(row, after=0.75, configuration="engaged", drive="sun", load=1.56, tells=False)
    sheet = BenchSheet("a <b>", "some points", "Which?", ("one", "other"), 0.97, 12.0, (row, loaded))
    lines = list(csv.DictReader(io.StringIO(sheet_csv(sheet))))
    assert [line["point"] for line in lines] == ["1", "2"]
    assert (lines[0]["low_A_Nm"], lines[0]["high_B_Nm"], lines[0]["load_Nm"]) == ("0.25000", "0.31000", "")
    assert [line["tells_alone"] for line in lines] == ["yes", "no"]
    page = sheet_page(sheet)
    assert "250.0 … 260.0" in page
    assert page.count("<tr class=tells>") == 1
    assert page.count('class="box"') == 6
    assert "a &lt;b&gt;" in page
    assert "<script" not in page
    assert "1 point where the bands lie apart" in page


def many(causes: int, rows: int) -> BenchSheet:
    """A sheet of so many causes and points, with bands as wide as they come."""
    bands = tuple((-0.1 - 0.01 * i, -0.1 + 0.01 * i) for i in range(causes))
    row = SheetRow(100.75, 45.0, "engaged", "ring", 1, 1936.0, 480.0, -1.56, "ring torque", bands, True)
    words = tuple(f"the load-dependent friction of the ring bearings together with cause {i}" for i in range(causes))
    return BenchSheet("campaign", "repeats over the grid", "Which?", words, 0.9, 30.0, (row,) * rows)


def test_every_cause_has_its_band_in_the_csv_and_the_page_says_which_it_leaves_out() -> None:
    sheet = many(30, 2)
    (line, _) = csv.DictReader(io.StringIO(sheet_csv(sheet)))
    assert float(line["low_AD_Nm"]) == pytest.approx(sheet.rows[0].bands[-1][0])
    page = sheet_page(sheet)
    assert "24 further possible causes: see the bands in next.csv." in page
    assert page.count('class="box"') == 2 * 7


@chromium.needed
def test_a_sheet_of_thirty_points_or_of_many_causes_fits_one_page(tmp_path: Path) -> None:
    width, height = (round((side - 2 * 11) / 25.4 * 96) for side in (297, 210))
    place = tmp_path / "next.html"
    with chromium.tab(tmp_path / "profile") as tab:
        tab.call("Emulation.setEmulatedMedia", media="print")
        tab.call("Emulation.setDeviceMetricsOverride", width=width, height=100, deviceScaleFactor=1, mobile=False)
        for causes, rows in ((2, 30), (30, 24)):
            place.write_text(sheet_page(many(causes, rows)), encoding="utf-8")
            tab.events.clear()
            tab.open(place)
            size = tab.ask("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
            assert (size[0] <= width, size[1] <= height) == (True, True), (causes, rows, size)
