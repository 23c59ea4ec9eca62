"""What the page of the published grids may state, and what it states of points that are not known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pmg.pipeline.analysis.comparison import compare
from pmg.pipeline.analysis.power_flow import Flow, power_flows
from pmg.pipeline.analysis.tolerance import agreements
from pmg.pipeline.chapters.arrange import arranged
from pmg.pipeline.chapters.measured.efficiency import efficiency_section
from pmg.pipeline.chapters.measured.loss_parts import loss_parts_figure
from pmg.pipeline.chapters.measured.losses import losses_section
from pmg.pipeline.chapters.measured.torque_map import torque_map_sections
from pmg.pipeline.chapters.page import RecordedFacts, build_report
from pmg.pipeline.chapters.simulated.by_load import by_load_figures
from pmg.pipeline.chapters.studies import validation
from pmg.pipeline.chapters.with_cause import SimulatedTwice, behind_points
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.loss_fit import LossFits
from pmg.pipeline.fit.losses import power_balance
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.levels import by_load
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.report.document import Chart, Column, Figure, Fold, Section, Table, Text
from pmg.pipeline.report.theme import SERIES
from pmg.sim.bench import load_bench
from pmg.sim.mechanisms.friction import Windage
from pmg.sim.signals import LOSS_TOTAL, Array
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


@pytest.fixture(scope="module")
def flows(analysed: Analysis) -> tuple[Gearbox, tuple[Flow, ...]]:
    assert analysed.calibration is not None
    assert analysed.causes is not None
    gearbox = Gearbox.calibrated(BENCH, analysed.calibration.model)
    simulated = steady(gearbox, analysed.grid.points)
    return gearbox, power_flows(gearbox, analysed.grid, simulated, BENCH, analysed.calibration, analysed.causes)


def test_bars_of_bearings_and_gear_add_up_to_the_simulated_loss(
    flows: tuple[Gearbox, tuple[Flow, ...]],
) -> None:
    gearbox, (flow, *_) = flows
    figure = loss_parts_figure(gearbox, flow)
    for panel, (_, rows) in zip(figure.panels, by_load(flow.grid.points), strict=True):
        assert isinstance(panel, Chart)
        assert len({series.colour % SERIES for series in panel.series}) == len(panel.series)
        bars = [series for series in panel.series if series.style == "bars"]
        assert [series.name for series in bars] == [*(f"bearing {n}" for n in range(1, 8)), "magnetic gear"]
        order = np.argsort(flow.grid.points.speed_sun[rows])
        of_sun = bars[0].y + bars[1].y
        assert bars[0].y / of_sun == pytest.approx(float(BENCH.bearings.share_sun_1) / BENCH.bearings.sun)
        assert sum(series.y for series in bars) == pytest.approx(flow.chain.loss_between[rows][order])


def test_the_measured_total_loss_stands_with_the_uncertainty_of_the_power_balance(
    analysed: Analysis, flows: tuple[Gearbox, tuple[Flow, ...]]
) -> None:
    """Transducers are common to both powers: their errors add up with their signs, not as squares."""
    gearbox, (flow, *_) = flows
    balance = analysed.balance
    assert balance is not None
    figure = loss_parts_figure(gearbox, flow)
    for panel, (_, rows) in zip(figure.panels, by_load(flow.grid.points), strict=True):
        assert isinstance(panel, Chart)
        total = panel.series[-1]
        assert total.name == "measured total"
        assert total.y == pytest.approx(balance.values[LOSS_TOTAL.name][rows])
        assert total.u == pytest.approx(balance.u(LOSS_TOTAL.name)[rows], rel=1e-6)
    spread, nothing = flow.spread, np.zeros_like(flow.spread.own)
    together = replace(spread, own=nothing, pull=nothing, shared={"transducers": np.ones((*nothing.shape[:2], 1))})
    for panel in loss_parts_figure(gearbox, replace(flow, spread=together)).panels:
        assert isinstance(panel, Chart)
        assert panel.series[-1].u == pytest.approx(0.0)


def test_simulated_losses_by_load_follow_the_formulas_of_the_measured_ones(
    analysed: Analysis, flows: tuple[Gearbox, tuple[Flow, ...]]
) -> None:
    """Set beside itself, a simulation has no difference but that of speeds which are off the ratio."""
    assert analysed.fits is not None
    assert analysed.calibration is not None
    gearbox, (flow, *_) = flows
    curves = analysed.calibration.model.curves
    fits = LossFits(*(replace(fit, curve=curve) for fit, curve in zip(analysed.fits, curves, strict=True)))
    simulated = steady(gearbox, flow.grid.points)
    itself = power_balance(simulated, fits, analysed.calibration.model.correction)
    for figure in by_load_figures(itself, flows[1]):
        for panel in figure.panels:
            assert isinstance(panel, Chart)
            read, lines = panel.series[:3], panel.series[3:]
            for one, line in zip(read, lines, strict=True):
                assert line.y == pytest.approx(one.y, rel=1e-6, abs=1e-6)


def test_working_points_lie_on_the_torque_map(flows: tuple[Gearbox, tuple[Flow, ...]]) -> None:
    gearbox, (flow, *_) = flows
    (section,) = torque_map_sections(gearbox, flow.grid)
    figure = next(item for item in section.items if isinstance(item, Figure))
    whole = figure.panels[0]
    assert isinstance(whole, Chart)
    peak = whole.series[2].y.max()
    assert peak == pytest.approx(float(BENCH.gear1.pull_out_torque_sun), abs=0.006)
    points = whole.series[3:]
    assert sum(len(series.x) for series in points) == len(flow.grid)
    for series in points:
        assert series.y == pytest.approx(peak * np.sin(np.radians(series.x)))


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


def test_losses_of_one_kind_on_both_shafts_are_both_behind_a_point(analysed: Analysis) -> None:
    assert analysed.calibration is not None
    grid, plain = analysed.grid, Gearbox.calibrated(BENCH, analysed.calibration.model)
    residuals = compare(grid, steady(plain, grid.points), BENCH, analysed.calibration)
    agreed = agreements(residuals, BENCH)

    def of(*more: Windage) -> Array:
        box = Gearbox(BENCH, (*plain.mechanisms, *more))
        (model,) = json.loads(behind_points(SimulatedTwice(residuals, (("simulated", box),), None), agreed))["models"]
        return np.array(model["loss"][Windage.title])

    sun, ring = Windage(k_sun=1e-6), Windage(k_ring=5e-6)
    assert of(sun, ring) == pytest.approx(of(sun) + of(ring), rel=1e-5)


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
