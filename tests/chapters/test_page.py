"""What the page of the published grids may state, and what it states of points that are not known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pmg.pipeline.chapters.measured.efficiency import efficiency_section
from pmg.pipeline.chapters.measured.losses import losses_section
from pmg.pipeline.chapters.page import RecordedFacts, build_report
from pmg.pipeline.chapters.studies import validation
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.report.document import Figure
from pmg.sim.bench import load_bench

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
