"""`pmg validate`: every published figure beside ours, and what is said of it."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tests.slow import slow
from typer.testing import CliRunner

from pmg.pipeline.chapters.studies.validation import published_sections
from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.crate import FILE as CRATE
from pmg.pipeline.commands.validate import run_validate
from pmg.pipeline.grid.tables import read_published
from pmg.pipeline.thesis_figures import compared, rounding
from pmg.pipeline.thesis_figures.claim import Other, PublishedFigure, Unit
from pmg.pipeline.thesis_figures.compared import compared_figures
from pmg.pipeline.thesis_figures.figures import FIGURES, WATT
from pmg.pipeline.thesis_figures.listing import documents, failed_draws, table_lines
from pmg.pipeline.thesis_figures.remarks import GEAR_CONSTANT
from pmg.pipeline.thesis_figures.replicate import Choices, replicate
from pmg.pipeline.thesis_figures.rounding import FEWEST_DRAWS, RoundingSpread, _draw, _shared_errors, spreads
from pmg.pipeline.thesis_figures.tables import LOADS, SPEEDS, TORQUE_RING, TORQUE_SUN, printed
from pmg.pipeline.thesis_figures.verdict import FigureVerdict, JudgedFigure, _judge, _with_other_constant, validate
from pmg.pipeline.wording.option_words import DampingMethod
from pmg.sim.bench import BenchParameters
from pmg.sim.errors import BenchError, FitError, GridError, PmgError, UnsettledFitError, UnsettledRunError
from pmg.sim.grid import Grid
from pmg.sim.shafts import SIDES
from pmg.sim.signals import SPEED_SUN

SEED = 3
BY_ID = {figure.id: figure for figure in FIGURES}


@pytest.fixture(scope="module")
def grid(published_folder: Path, bench: BenchParameters) -> Grid:
    return read_published(published_folder, bench)


@pytest.fixture(scope="module")
def found(grid: Grid, bench: BenchParameters) -> dict[str, RoundingSpread]:
    return spreads(printed(grid), bench, FEWEST_DRAWS, np.random.default_rng(SEED))


@pytest.fixture(scope="module")
def judged(found: dict[str, RoundingSpread]) -> dict[str, JudgedFigure]:
    alone = {figure.id: _judge(figure, found[figure.id]) for figure in FIGURES}
    return {id_: _with_other_constant(j, alone) for id_, j in alone.items()}


def test_every_figure_is_computed_and_has_a_verdict(
    judged: dict[str, JudgedFigure], found: dict[str, RoundingSpread]
) -> None:
    assert set(judged) == set(found)
    assert len(BY_ID) == len(FIGURES)
    for j in judged.values():
        assert isinstance(j.verdict, FigureVerdict)
        assert j.low < j.ours < j.high
        assert j.figure.place
        assert j.figure.source.citation.endswith(j.figure.place)


def test_every_figure_that_differs_for_a_known_reason_says_it(judged: dict[str, JudgedFigure]) -> None:
    silent = [j.figure.id for j in judged.values() if j.verdict is not FigureVerdict.REPRODUCED and not j.remarks]
    assert not silent


def printed_value(id_: str) -> float:
    return BY_ID[id_].value


def test_printed_shares_sum_to_the_whole() -> None:
    elements = ("motor-in", "sun-bearings", "gear", "ring-bearings", "motor-out")
    assert sum(printed_value(f"chain.share-{name}") for name in elements) == pytest.approx(100.0, abs=0.03)
    assert sum(printed_value(f"chain.{name}") for name in elements) == pytest.approx(64.12, abs=0.001)
    splits = [printed_value(f"chain.split-{name}") for name in ("sun", "relative", "ring")]
    assert sum(splits) == pytest.approx(100.0, abs=0.02)
    for shaft in ("sun", "ring"):
        shares = [f.value for f in FIGURES if f.id.startswith(f"design.share-{shaft}-")]
        assert sum(shares) == pytest.approx(100.0, abs=0.1)


def test_the_printed_power_chain_adds_up() -> None:
    v = printed_value
    assert v("chain.electric-in") - v("chain.motor-in") == pytest.approx(v("chain.mechanical-in"), abs=0.011)
    between = v("chain.sun-bearings") + v("chain.gear") + v("chain.ring-bearings")
    assert v("chain.mechanical-in") - between == pytest.approx(v("chain.mechanical-out"), abs=0.011)
    assert v("chain.mechanical-out") - v("chain.motor-out") == pytest.approx(v("chain.electric-out"), abs=0.011)
    assert v("chain.electric-in") - v("chain.electric-out") == pytest.approx(v("chain.all"), abs=0.011)


def test_ours_add_up_too(found: dict[str, RoundingSpread]) -> None:
    for group in ("chain", "chain-implied"):
        ours = {id_.partition(".")[2]: s.ours for id_, s in found.items() if id_.startswith(f"{group}.")}
        assert sum(v for k, v in ours.items() if k.startswith("share-")) == pytest.approx(1.0)
        assert sum(v for k, v in ours.items() if k.startswith("split-")) == pytest.approx(1.0)
        assert ours["electric-in"] - ours["electric-out"] == pytest.approx(ours["all"])


def test_the_simulated_points_are_those_that_ship_with_the_grids(published_folder: Path) -> None:
    table = pd.read_csv(published_folder / "engaged_grid.csv")
    for i, load in enumerate(LOADS):
        rows = table[np.isclose(table.ring_torque_set_Nm, load)]
        np.testing.assert_allclose(rows.sun_speed_rpm, SPEED_SUN.display(SPEEDS))
        np.testing.assert_array_equal(rows.sun_torque_simulated_Nm, TORQUE_SUN[i])
        np.testing.assert_array_equal(rows.ring_torque_simulation_input_Nm, TORQUE_RING[i])


PLAIN = PublishedFigure("x.plain", "plain", 10.0, 1, WATT, "nowhere")
LEAST = replace(PLAIN, until=math.inf)
MOST = replace(PLAIN, value=-math.inf, until=10.0)
RANGE = replace(PLAIN, until=12.0)
TWICE = replace(PLAIN, other=Other(10.2, 1, "elsewhere"))
ALIKE = replace(PLAIN, other=Other(10.04, 2, "elsewhere"))
SIZED = replace(PLAIN, value=0.0, size=1.0)


@pytest.mark.parametrize(
    ("figure", "ours", "shift", "verdict"),
    [
        (PLAIN, 10.3, 0.3, FigureVerdict.REPRODUCED),
        (PLAIN, 10.36, 0.3, FigureVerdict.NOT_EXPLAINED),
        (PLAIN, 9.6, 0.3, FigureVerdict.NOT_EXPLAINED),
        (PLAIN, 10.5, 1.1, FigureVerdict.NOT_DETERMINED),
        (PLAIN, 15.0, 1.1, FigureVerdict.NOT_EXPLAINED),
        (PLAIN, math.nan, 0.1, FigureVerdict.NOT_EXPLAINED),
        (LEAST, 11.0, 0.5, FigureVerdict.REPRODUCED),
        (LEAST, 10.2, 0.5, FigureVerdict.NOT_DETERMINED),
        (LEAST, 9.0, 0.5, FigureVerdict.NOT_EXPLAINED),
        (MOST, 9.0, 0.5, FigureVerdict.REPRODUCED),
        (MOST, 10.2, 0.5, FigureVerdict.NOT_DETERMINED),
        (MOST, 11.0, 0.5, FigureVerdict.NOT_EXPLAINED),
        (RANGE, 11.0, 0.5, FigureVerdict.REPRODUCED),
        (RANGE, 12.7, 0.5, FigureVerdict.NOT_EXPLAINED),
        (RANGE, 9.3, 0.5, FigureVerdict.NOT_EXPLAINED),
        (TWICE, 10.0, 0.1, FigureVerdict.INCONSISTENT),
        (TWICE, 99.0, 0.1, FigureVerdict.INCONSISTENT),
        (ALIKE, 10.0, 0.1, FigureVerdict.REPRODUCED),
        (SIZED, 0.0, 0.05, FigureVerdict.REPRODUCED),
        (SIZED, 0.0, 0.2, FigureVerdict.NOT_DETERMINED),
        (SIZED, 0.5, 0.2, FigureVerdict.NOT_EXPLAINED),
    ],
)
def test_the_verdict_by_table(figure: PublishedFigure, ours: float, shift: float, verdict: FigureVerdict) -> None:
    assert _judge(figure, RoundingSpread(ours, ours - shift, ours)).verdict is verdict
    assert _judge(figure, RoundingSpread(ours, ours, ours + shift)).verdict is verdict


def test_a_draw_that_does_not_settle_is_counted_and_left_out(
    grid: Grid, bench: BenchParameters, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = iter(range(1000))

    def sometimes(*_: object) -> dict[str, float]:
        call = next(calls)
        if call == 3:
            raise UnsettledFitError("bisquare weights", "no end", "one", "Take other weights.")
        if call == 5:
            raise UnsettledRunError("transient", "a slipped pole", "none", "Ask for less.")
        return {"any": float(call)}

    monkeypatch.setattr(rounding, "replicate", sometimes)
    spread = spreads(printed(grid), bench, FEWEST_DRAWS + 2, np.random.default_rng(SEED))["any"]
    assert (spread.ours, spread.failed) == (0.0, 2)
    judged = _judge(PLAIN, replace(spread, ours=10.0))
    assert failed_draws((judged,)) == "2 draws gave no figures, as a fit or a run did not settle."


@pytest.mark.parametrize("fault", [FitError, BenchError, GridError])
def test_any_other_fault_of_a_draw_is_not_passed_over(
    grid: Grid, bench: BenchParameters, monkeypatch: pytest.MonkeyPatch, fault: type[PmgError]
) -> None:
    calls = iter(range(1000))

    def once(*_: object) -> dict[str, float]:
        if next(calls) == 3:
            raise fault("curves", "fewer points than terms", "more", "Check the grid.")
        return {"any": 1.0}

    monkeypatch.setattr(rounding, "replicate", once)
    with pytest.raises(fault, match="fewer points than terms"):
        spreads(printed(grid), bench, 2 * FEWEST_DRAWS, np.random.default_rng(SEED))


def test_distance_is_in_half_widths_of_the_interval() -> None:
    j = _judge(PLAIN, RoundingSpread(11.0, 10.55, 11.2))
    assert j.reach == pytest.approx(0.5)
    assert j.distance == pytest.approx(2.0)
    in_milli = replace(PLAIN, unit=Unit("mW", 1e-3))
    assert _judge(in_milli, RoundingSpread(0.011, 0.01055, 0.0112)).distance == pytest.approx(2.0)


def test_draws_stay_within_the_rounding_and_round_to_the_tables(grid: Grid, rng: np.random.Generator) -> None:
    sample = printed(grid)
    drawn = _draw(sample, rng)
    for side in SIDES:
        rows = grid.points.neutral | (side == "sun")
        torque, printed_torque = drawn.grid.torque[side][rows], grid.torque[side][rows]
        np.testing.assert_allclose(np.round(torque, 2), printed_torque, atol=1e-9)
        assert np.abs(torque - printed_torque).max() > 0.0045
    np.testing.assert_allclose(np.round(drawn.ring, 4), TORQUE_RING, atol=1e-9)
    np.testing.assert_allclose(np.round(drawn.sun, 4), sample.sun, atol=1e-9)


def test_a_row_that_prints_one_value_has_one_error_and_every_other_reading_its_own(
    grid: Grid, rng: np.random.Generator
) -> None:
    sample, at = printed(grid), grid.points
    error = _draw(sample, rng).grid.torque_sun - grid.torque_sun
    speed = np.round(SPEED_SUN.display(at.speed_sun))
    for rpm in np.unique(speed[at.neutral]):
        row = at.neutral & (speed == rpm)
        different = len(np.unique(np.round(error[row], 12)))
        assert different == (1 if rpm in (1404, 1716, 1872) else row.sum())
    assert len(np.unique(np.round(error[at.engaged], 12))) == at.engaged.sum()


def test_intervals_with_shared_errors_hold_a_curve_that_independent_errors_miss(grid: Grid) -> None:
    """Rows as in the source: a drift of about a step with the other shaft's speed, and little scatter."""
    rng, at = np.random.default_rng(11), grid.points
    rows = np.flatnonzero(at.neutral)
    speed = at.speed_sun[rows]
    levels, row = np.unique(speed, return_inverse=True)
    place = np.argsort(np.argsort(at.speed_ring[rows], kind="stable")) / len(rows) - 0.5
    powers = np.arange(4)
    at_points = (np.linspace(0.1, 1.0, 8)[:, None]) ** powers
    take = at_points @ np.linalg.pinv((speed / speed.max())[:, None] ** powers)
    inside: dict[bool, list[float]] = {True: [], False: []}
    for _ in range(60):
        level = 0.02 + 0.11 * (levels / levels.max()) + rng.uniform(-0.005, 0.005, len(levels))
        drift = rng.uniform(0.0, 0.012, len(levels))
        truth = (level[row] - drift[row] * place) + 3e-4 * rng.standard_normal(len(rows))
        table = np.round(truth, 2)
        for shared, held in inside.items():
            number = _shared_errors(speed, table) if shared else np.arange(len(rows))
            shift = take @ rng.uniform(-0.005, 0.005, (200, len(rows)))[:, number].T
            low, high = np.quantile(shift, (0.025, 0.975), axis=1)
            held.append(float(np.mean(np.abs(take @ (table - truth)) <= np.maximum(-low, high))))
    assert np.mean(inside[True]) > 0.9
    assert np.mean(inside[False]) < np.mean(inside[True]) - 0.1


def test_rounding_once_more_adds_scatter_and_moves_the_constant_both_ways(grid: Grid, bench: BenchParameters) -> None:
    sample = printed(grid)
    plain = Choices(damping=DampingMethod.LEAST_SQUARES)
    ours = replicate(sample, bench, plain)
    drawn = [replicate(_draw(sample, np.random.default_rng(i)), bench, plain) for i in range(12)]
    assert np.mean([d["damping-0.80.rmse"] for d in drawn]) > ours["damping-0.80.rmse"]
    c = [d["damping-0.80.c"] - ours["damping-0.80.c"] for d in drawn]
    assert min(c) < 0.0 < max(c)


def test_the_known_disagreements_are_told(judged: dict[str, JudgedFigure]) -> None:
    verdicts = {id_: j.verdict for id_, j in judged.items()}
    for id_ in ("chain.mechanical-in", "printed.power-in", "printed.eddy", "steady.torque-share", "steady.user"):
        assert verdicts[id_] is FigureVerdict.INCONSISTENT
    assert verdicts["chain.gear"] is FigureVerdict.OTHER_CONSTANT
    assert verdicts["chain-implied.gear"] is FigureVerdict.REPRODUCED
    assert verdicts["chain-implied.electric-in"] is FigureVerdict.REPRODUCED
    assert verdicts["steady.difference-0.78"] is FigureVerdict.NOT_DETERMINED


@pytest.mark.parametrize("id_", ["chain-implied.sun-bearings", "design.ratio-1", "run.loss", "point-implied.1872-1.95"])
def test_a_planted_wrong_value_is_called_out(id_: str, found: dict[str, RoundingSpread]) -> None:
    right = _judge(BY_ID[id_], found[id_])
    wrong = _judge(replace(BY_ID[id_], value=1.25 * BY_ID[id_].value), found[id_])
    assert right.verdict is FigureVerdict.REPRODUCED
    assert wrong.verdict is FigureVerdict.NOT_EXPLAINED
    assert wrong.distance < -1.0


@slow
def test_the_same_seed_gives_the_same_bytes_and_another_one_does_not(published_folder: Path, tmp_path: Path) -> None:
    runs = [run_validate(published_folder, FEWEST_DRAWS, seed, tmp_path / str(i)) for i, seed in enumerate((1, 2, 1))]
    told = [json.dumps(run.data["figures"]) + "\n".join(run.lines[:-2]) for run in runs]
    assert told[0] == told[2] != told[1]
    files = [sorted(p for p in (tmp_path / str(i)).rglob("*") if p.is_file()) for i in (0, 2)]
    assert [p.name for p in files[0]] == [p.name for p in files[1]]
    same = {one.name for one, other in zip(*files, strict=True) if one.read_bytes() == other.read_bytes()}
    assert {p.name for p in files[0]} - same <= {CRATE}  # which holds the time of day


def test_json_and_table_hold_every_figure(judged: dict[str, JudgedFigure]) -> None:
    told = documents(tuple(judged.values()))
    assert [entry["id"] for entry in told] == [figure.id for figure in FIGURES]
    needed = {"id", "source", "published", "ours", "low", "high", "unit", "verdict", "remark"}
    assert all(needed <= set(entry) for entry in told)
    json.dumps(told, allow_nan=False)
    lines = table_lines(tuple(judged.values()))
    for figure in FIGURES:
        if not figure.group.startswith("point"):
            assert any(line.startswith(figure.what) for line in lines)
    assert sum("48 sun torques, furthest" in line for line in lines) == 2


def test_too_few_draws_are_refused(grid: Grid, bench: BenchParameters) -> None:
    with pytest.raises(FitError, match="draws: 3; expected 20 or more"):
        validate(grid, bench, 3, np.random.default_rng(1))


def test_grids_that_are_not_the_thesis_s_are_refused(
    grid: Grid, bench: BenchParameters, rng: np.random.Generator
) -> None:
    other = grid[np.arange(len(grid)) != len(grid) - 1]
    with pytest.raises(GridError, match="engaged point 1872-1"):
        validate(other, bench, FEWEST_DRAWS, rng)
    with pytest.raises(GridError, match="207 neutral and 48 engaged points"):
        validate(grid[np.arange(len(grid)) != 5], bench, FEWEST_DRAWS, rng)
    assert published_sections(other, bench) == ()
    assert published_sections(replace(grid, origin="measured"), bench) == ()


def test_the_command(published_folder: Path, tmp_path: Path) -> None:
    runner = CliRunner()
    call = ["validate", "--grids", str(published_folder), "--draws", str(FEWEST_DRAWS)]
    done = runner.invoke(app, [*call, "--json", "--report", str(tmp_path)])
    assert done.exit_code == 0
    data = json.loads(done.stdout)["data"]
    assert len(data["figures"]) == len(FIGURES) == sum(data["counts"].values())
    assert "published-figures-table" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert runner.invoke(app, [*call, "--fail-on", "mismatch"]).exit_code == 1


@pytest.mark.parametrize("wrong", [["--draws", "2"], ["--seed", "-1"], ["--grids", "nowhere"]])
def test_wrong_arguments_end_with_2(wrong: list[str]) -> None:
    assert CliRunner().invoke(app, ["validate", *wrong]).exit_code == 2


def test_the_report_of_the_published_grids_has_the_chapter(grid: Grid, bench: BenchParameters) -> None:
    section, run = published_sections(grid, bench, FEWEST_DRAWS)
    assert run.id == "published-run"
    assert section.id == "published-figures"
    assert {type(item).__name__ for item in section.items} == {"Text", "Facts", "Figure", "Table"}


def test_command_and_report_share_the_draws_of_the_same_grid_and_of_no_other(
    grid: Grid, bench: BenchParameters, judged: dict[str, JudgedFigure], monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[tuple[int, float]] = []

    def counting(grid: Grid, _: BenchParameters, draws: int, __: np.random.Generator) -> tuple[JudgedFigure, ...]:
        drawn.append((draws, float(grid.torque_sun[0])))
        return tuple(judged.values())

    monkeypatch.setattr(compared, "validate", counting)
    monkeypatch.setattr(compared, "transient_options", lambda *_: ())
    for _ in range(2):
        first = compared_figures(replace(grid, torque_sun=grid.torque_sun.copy()), bench, 1234)
        assert compared_figures(grid, bench, 1234) is first
    other = replace(grid, torque_sun=grid.torque_sun + 0.01)
    assert compared_figures(other, bench, 1234) is not first
    compared_figures(other, bench, 1235)
    compared_figures(other, bench, 1235, 2)
    assert drawn == [(1234, grid.torque_sun[0]), *((n, other.torque_sun[0]) for n in (1234, 1235, 1235))]


def test_the_damping_constants_of_the_source_come_out_with_bisquare_weights_only(
    found: dict[str, RoundingSpread], grid: Grid, bench: BenchParameters
) -> None:
    plain = replicate(printed(grid), bench, Choices(damping=DampingMethod.LEAST_SQUARES))
    for k in ("0.90", "0.85", "0.80"):
        figure = BY_ID[f"damping-{k}.c"]
        assert abs(_judge(figure, found[figure.id]).distance) < 0.5
        assert plain[figure.id] / figure.unit.scale - figure.value > 0.14
    slope = (plain["damping-0.80.c"] - plain["damping-0.90.c"]) / 0.1
    assert slope == pytest.approx(11.2e-4, abs=0.1e-4)  # printed: 11.8e-4, give or take 0.1e-4


def test_a_figure_outside_with_one_eddy_constant_and_inside_with_the_other_says_so() -> None:
    one, other = replace(PLAIN, id="x.y"), replace(PLAIN, id="x-implied.y")
    outside, inside = RoundingSpread(11.0, 10.9, 11.1), RoundingSpread(10.0, 9.9, 10.1)
    for spread, expected in ((inside, FigureVerdict.OTHER_CONSTANT), (outside, FigureVerdict.NOT_EXPLAINED)):
        alone = {"x.y": _judge(one, outside), "x-implied.y": _judge(other, spread)}
        found = _with_other_constant(alone["x.y"], alone)
        assert found.verdict is expected
        assert (GEAR_CONSTANT in found.remarks) == (expected is FigureVerdict.OTHER_CONSTANT)
