"""What the page of the published grids may state, and what it states of points that are not known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pmg.pipeline.analysis.comparison import compare
from pmg.pipeline.analysis.tolerance import agreements
from pmg.pipeline.chapters.arrange import arranged
from pmg.pipeline.chapters.measured.efficiency import efficiency_section
from pmg.pipeline.chapters.measured.losses import losses_section
from pmg.pipeline.chapters.page import RecordedFacts, build_report
from pmg.pipeline.chapters.studies import validation
from pmg.pipeline.chapters.with_cause import SimulatedTwice, behind_points
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.report.document import Column, Figure, Fold, Section, Table, Text
from pmg.sim.bench import load_bench
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

PUBLISHED = Path(__file__).resolve().parents[2] / "raw" / "published"
BENCH = load_bench()


@pytest.fixture(scope="module")
def analysed() -> Analysis:
    return analyse(read_published(PUBLISHED, BENCH), AnalysisOptions(), BENCH)


@pytest.mark.parametrize("origin", ["published", "measured"])
def test_no_speed_ratio_is_measured_where_the_speeds_are_those_that_were_set(
    analysed: Analysis, origin: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(validation, "published_sections", lambda *_: ())  # a chapter of its own, and its own tests
    of = replace(analysed, grid=replace(analysed.grid, origin=origin))
    page = build_report(of, None, BENCH, RecordedFacts(), note="", provenance=())
    assert ("speed-ratio-kept" in [section.id for section in page.sections]) == (origin == "measured")


def test_a_point_that_is_not_known_leaves_the_captions_standing(analysed: Analysis) -> None:
    assert analysed.balance is not None
    assert analysed.calibration is not None
    values = {name: np.where(np.arange(len(of)) == 0, np.nan, of) for name, of in analysed.balance.values.items()}
    balance = replace(analysed.balance, values=values)
    for section in (losses_section(analysed, balance, analysed.calibration), efficiency_section(balance, None)):
        for figure in section.items:
            if isinstance(figure, Figure):
                assert "– W" not in figure.caption
                assert "– %" not in figure.caption
                assert "– and" not in figure.caption


def test_the_losses_behind_a_point_are_those_between_its_simulated_torques(analysed: Analysis) -> None:
    assert analysed.calibration is not None
    box, grid = Gearbox.calibrated(BENCH, analysed.calibration.model), analysed.grid
    residuals = compare(grid, steady(box, grid.points), BENCH, analysed.calibration)
    twice = SimulatedTwice(residuals, (("simulated", box),), None)
    (model,) = json.loads(behind_points(twice, agreements(residuals, BENCH)))["models"]
    at, rows = grid.points, grid.points.engaged & grid.accepted
    losses = np.array(list(model["loss"].values()), dtype=np.float64).sum(axis=0)
    between = np.array(model["torque"][0], dtype=np.float64) * at.speed_sun + at.torque_ring * at.speed_ring
    assert np.allclose(losses[rows], between[rows], rtol=1e-4, atol=1e-3)


def test_chapters_stand_by_question_and_specialists_matters_are_folded() -> None:
    table = Table("t", "Coefficients", "C.", (Column("x"),), ((1,),))
    losses = Section("losses", "Losses", (Text("How it is reckoned."), Text("Mind.", "warning"), table))
    diagnosis = Section("diagnosis", "Diagnosis", (Text("It differs."),))
    other = Section("more", "More", (Text("As it stands."),))
    first, second, last = arranged((losses, other, diagnosis))
    assert (first.id, second.id, last.id) == ("diagnosis", "losses", "more")
    assert first.question == "What is wrong?"
    warning, fold = second.items
    assert isinstance(warning, Text)
    assert isinstance(fold, Fold)
    assert fold.title == "Coefficients"
    assert second.unfolded[2] is table
