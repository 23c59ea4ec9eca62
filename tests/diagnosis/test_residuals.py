"""What residuals follow: no more than chance where there is nothing, the right covariate where it is planted."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from tests.points import joined, measured, points
from typer.testing import CliRunner

from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.residuals import run_residuals
from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE
from pmg.pipeline.diagnosis.residuals.fitted import FITS, lack_of_fit, linear_fits, outliers
from pmg.pipeline.diagnosis.residuals.search import Followed, ResidualStudy, study_residuals
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.fit.rounding import _rounded_moments, unrounded
from pmg.sim.bench import BenchParameters, load_bench
from pmg.sim.errors import PmgError
from pmg.sim.grid import Grid, OperatingPoints
from pmg.sim.signals import RPM, Array

pytestmark = pytest.mark.usefixtures("undrawn")

SUN = np.array([-1560.0, -624.0, 90.0, 312.0, 780.0, 1248.0, 1872.0])
RING = np.array([-480.0, -120.0, 60.0, 240.0, 480.0, 720.0])
OPTIONS = AnalysisOptions(powers_sun=(0.0, 1.0), powers_ring=(0.0, 1.0))
NOISE = 1e-3


def neutral(rng: np.random.Generator, *, order: bool = True, repeats: int = 8) -> OperatingPoints:
    """Both directions of both shafts in random order, some points twice."""
    sun, ring = (axis.ravel() for axis in np.meshgrid(SUN, RING, indexing="ij"))
    rows = np.r_[np.arange(len(sun)), rng.choice(len(sun), repeats, replace=False)]
    rows = rng.permutation(rows)
    at = joined(points("neutral", sun[rows], ring[rows]))
    return replace(at, started_at=np.linspace(1.7e9, 1.7e9 + 40.0 * len(at), len(at))) if order else at


def campaign(
    rng: np.random.Generator, at: OperatingPoints, sun: Array | float = 0.0, ring: Array | float = 0.0
) -> Analysis:
    """Straight loss curves, noise, and drags [N m] that the curves do not know."""
    drags = []
    for speed, top, extra in ((at.speed_sun, 1872.0, sun), (at.speed_ring, 720.0, ring)):
        drag = 0.05 + 0.1 * np.abs(speed) / (top * RPM) + extra
        drags.append(np.sign(speed) * drag + NOISE * rng.standard_normal(len(at)))
    return analyse(measured(at, drags[0], drags[1]), OPTIONS, load_bench())


def followed(study: ResidualStudy, fit: str, shaft: str) -> tuple[Followed, ...]:
    return next(part for part in study.parts if (part.fit.name, part.shaft) == (fit, shaft)).followed


def clearest(study: ResidualStudy, fit: str) -> tuple[str, Followed]:
    """The covariate of first rank, with its shaft."""
    return next(
        (part.shaft, one) for part in study.parts if part.fit.name == fit for one in part.followed if one.rank == 1
    )


def test_false_alarms_keep_their_rate(bench: BenchParameters) -> None:
    """60 nulls: outside these bounds with a probability below 1 in 1000 where the rate is 5 %."""
    alarms, smallest = 0, []
    for seed in range(60):
        rng = np.random.default_rng([1, seed])
        study = study_residuals(campaign(rng, neutral(rng)), bench, ("curves",), 39, seed)
        alarms += study.p_value <= FALSE_ALARM_RATE
        smallest.append(study.p_value)
    assert alarms <= stats.binom.ppf(0.999, 60, FALSE_ALARM_RATE)
    assert stats.kstest(smallest, "uniform").pvalue > 1e-3
    assert min(smallest) < 0.3


def test_planted_drag_between_the_shafts_is_found_under_its_name(
    rng: np.random.Generator, bench: BenchParameters
) -> None:
    at = neutral(rng)
    relative = 0.007 * np.sign(at.speed_sun - at.speed_ring) * np.sign(at.speed_sun)
    study = study_residuals(campaign(rng, at, sun=relative), bench, ("curves",), 199, 1)
    shaft, first = clearest(study, "curves")
    assert shaft == "sun"
    assert first.look.covariate.id == "speed_difference"
    assert first.p_search <= 1.0 / 200.0 + 1e-9
    assert first.size > 4.0 * first.noise_size
    readings = study.parts[0].fit.readings
    assert np.corrcoef(first.drag[readings.sun], relative[readings.row[readings.sun]])[0, 1] > 0.8
    assert not any(one.stands_out for one in followed(study, "curves", "ring"))
    taken = study_residuals(campaign(rng, at, sun=relative), bench, ("plane",), 199, 1)
    assert not any(
        one.stands_out and one.look.covariate.id == "speed_difference" for one in followed(taken, "plane", "sun")
    )


@pytest.mark.parametrize("name", ["sign_own", "sign_both", "approach", "time"])
def test_each_planted_dependence_leads_to_its_covariate(
    name: str, rng: np.random.Generator, bench: BenchParameters
) -> None:
    at = neutral(rng)
    own = np.abs(at.speed_ring)
    shapes = {
        "sign_own": np.sign(at.speed_ring),
        "sign_both": np.sign(at.speed_ring * at.speed_sun),
        "approach": np.r_[0.0, np.sign(np.diff(own))],
        "time": np.linspace(-1.0, 1.0, len(at)) ** 3 * 2.0,
    }
    study = study_residuals(campaign(rng, at, ring=0.003 * shapes[name]), bench, ("curves",), 199, 1)
    shaft, first = clearest(study, "curves")
    assert shaft == "ring"
    assert name in (first.look.covariate.id, *first.same_trace)
    if name != "time":
        values = dict(first.shape)
        ends = [values[first.look.covariate.signs[i]] for i in (0, 2)]
        assert ends[1] - ends[0] == pytest.approx(0.006, abs=0.0025)


def test_size_is_what_the_fit_leaves_and_grows_with_what_is_planted(
    rng: np.random.Generator, bench: BenchParameters
) -> None:
    at = neutral(rng)
    shape = np.sign(at.speed_sun * at.speed_ring)
    sizes = []
    for planted in (0.004, 0.008):
        again = np.random.default_rng(3)
        _, first = clearest(
            study_residuals(campaign(again, at, sun=planted * shape), bench, ("curves",), 39, 1), "curves"
        )
        sizes.append(first.size)
        assert first.size <= planted + 4.0 * first.noise_size
    assert sizes[1] / sizes[0] == pytest.approx(2.0, rel=0.15)


def test_fits_that_do_not_apply_are_left_out(rng: np.random.Generator, bench: BenchParameters) -> None:
    study = study_residuals(campaign(rng, neutral(rng)), bench, tuple(FITS), 19, 1)
    assert {part.fit.name for part in study.parts} == {"curves", "plane"}


@settings(max_examples=20)
@given(torque=st.floats(-0.3, 0.3), wander=st.floats(5e-4, 2e-2), seed=st.integers(0, 2**31))
def test_moments_of_rounded_torques_are_those_of_many_draws(torque: float, wander: float, seed: int) -> None:
    drawn = np.random.default_rng(seed).normal(torque, wander, 40000)
    off = np.round(drawn / 0.01) * 0.01 - torque
    bias, variance = _rounded_moments(np.array([torque]), wander, 0.01)
    u = np.sqrt(variance[0] / len(off)) + 1e-12
    assert abs(off.mean() - bias[0]) < 6.0 * u + 1e-6
    fourth = np.mean((off - off.mean()) ** 4)
    assert abs(off.var() - variance[0]) < 6.0 * np.sqrt(fourth / len(off)) + 1e-8


def test_wander_before_rounding_is_found_again(bench: BenchParameters) -> None:
    """The mean over grids shows a bias that a single grid would hide."""
    found = []
    for seed in range(12):
        rng = np.random.default_rng([2, seed])
        at = neutral(rng, order=False, repeats=40)
        drags = [0.05 + 0.1 * np.abs(x) / top for x, top in ((at.speed_sun, 196.0), (at.speed_ring, 75.4))]
        signs = np.sign(at.speed_sun), np.sign(at.speed_ring)
        made = [s * d + 0.002 * rng.standard_normal(len(at)) for s, d in zip(signs, drags, strict=True)]
        sun, ring = (np.round(x / 0.01) * 0.01 for x in made)
        grid = measured(at, sun, ring, 0.01 / np.sqrt(12.0))
        analysis = analyse(replace(grid, rounding=0.01), OPTIONS, bench)
        assert analysis.floor is not None
        fit = linear_fits(analysis, bench, ("curves",))[0]
        scale = np.ones(len(fit.readings))
        floor, torque = unrounded(fit.readings, analysis.floor, fit.design, fit.design, fit.residual, scale)
        found += [np.sqrt(noise.u**2 - 1e-4 / 12.0) for noise in (floor.sun, floor.ring)]
        assert np.abs(torque - fit.torque).max() < 0.005
    assert np.mean(found) == pytest.approx(0.002, abs=3e-4)


def test_a_planted_outlier_is_named_and_no_other(rng: np.random.Generator, bench: BenchParameters) -> None:
    at = neutral(rng)
    stray = np.zeros(len(at))
    stray[17] = 0.010
    study = study_residuals(campaign(rng, at, sun=stray), bench, ("curves",), 39, 1)
    found = [(part.shaft, outlier) for part in study.parts for outlier, _ in part.outliers]
    assert [shaft for shaft, _ in found] == ["sun"]
    readings = study.parts[0].fit.readings
    assert readings.row[found[0][1].row] == 17
    assert found[0][1].surprise * np.sign(at.speed_sun[17]) > 5.0


def test_surprise_is_that_of_the_fit_without_the_point(rng: np.random.Generator, bench: BenchParameters) -> None:
    at = neutral(rng)
    stray = np.zeros(len(at))
    stray[5] = 0.02
    analysis = campaign(rng, at, sun=stray)
    fit = linear_fits(analysis, bench, ("curves",))[0]
    found = outliers(fit, "sun")[0]
    mine = np.flatnonzero(fit.readings.sun & (np.arange(len(fit.readings)) != found.row))
    design = fit.design[:, fit.design[mine].any(axis=0)]
    root = np.sqrt(fit.weights)[:, None]
    values, rss, _, _ = np.linalg.lstsq(
        design[mine] * root[mine], fit.readings.torque[mine] * root[mine, 0], rcond=None
    )
    inverse = np.linalg.inv((design[mine] * root[mine]).T @ (design[mine] * root[mine]))
    row = design[found.row]
    variance = rss[0] / (len(mine) - design.shape[1]) * (1.0 / fit.weights[found.row] + row @ inverse @ row)
    expected = (fit.readings.torque[found.row] - row @ values) / np.sqrt(variance)
    assert found.surprise == pytest.approx(expected, rel=1e-9)


def test_lack_of_fit_against_repeats_is_the_classic_split(rng: np.random.Generator, bench: BenchParameters) -> None:
    at = neutral(rng, repeats=20)
    analysis = campaign(rng, at, ring=0.004 * np.cos(at.speed_ring / 20.0))
    assert analysis.floor is not None
    fit = linear_fits(analysis, bench, ("curves",))[0]
    lack = lack_of_fit(fit, analysis.floor, bench, "ring")
    growth = np.sqrt(analysis.floor.ring.growth.variance(fit.readings.speed_own))
    left = (fit.residual / growth)[~fit.readings.sun]
    _, point = np.unique(np.round(np.c_[at.speed_sun, at.speed_ring]), axis=0, return_inverse=True)
    point = np.ravel(point)
    pure = sum(float(np.sum((left[point == k] - left[point == k].mean()) ** 2)) for k in np.unique(point))
    dof = len(at) - 2 - 20
    f = ((left @ left - pure) / dof) / (pure / 20)
    assert lack.source == "repeats"
    assert lack.dof == pytest.approx(dof)
    assert lack.p_value == pytest.approx(stats.f.sf(f, dof, 20), rel=1e-6)
    assert lack.p_value < 1e-3
    assert lack_of_fit(fit, analysis.floor, bench, "sun").p_value > 1e-3


def test_without_repeats_or_order_that_is_said(rng: np.random.Generator, bench: BenchParameters) -> None:
    analysis = campaign(rng, neutral(rng, order=False, repeats=0))
    part = study_residuals(analysis, bench, ("curves",), 39, 1).parts[0]
    assert part.lack.source == "windows"
    assert "lower bound" in part.lack.description
    assert part.untested["time"].startswith("not recorded")
    assert part.untested["approach"].startswith("not recorded")
    assert "load" in part.untested
    tested = {one.look.covariate.id for one in part.followed}
    assert not tested & set(part.untested)
    assert tested | set(part.untested) == {
        "own_speed", "other_speed", "speed_difference", "pole_slip", "both_speeds", "load", "load_speed", "power_flow",
        "time", "time_drag", "run_history", "previous_point", "sign_own", "sign_other", "sign_both", "approach",
        "approach_other",
    }  # fmt: skip


def test_constant_signs_are_not_tested(rng: np.random.Generator, bench: BenchParameters) -> None:
    at = neutral(rng)
    forward = replace(at, speed_sun=np.abs(at.speed_sun), speed_ring=np.abs(at.speed_ring))
    part = study_residuals(campaign(rng, forward), bench, ("curves",), 39, 1).parts[0]
    for name in ("sign_own", "sign_other", "sign_both"):
        assert part.untested[name] == "constant on this grid"


@settings(max_examples=5)
@given(scale=st.floats(0.2, 5.0), seed=st.integers(0, 2**31))
def test_p_values_do_not_know_the_unit_of_torque(scale: float, seed: int) -> None:
    """Torque and noise in other units: same order, same nominal p, sizes in proportion."""
    bench = load_bench()
    rng = np.random.default_rng(seed)
    first = campaign(rng, neutral(rng))
    grid = first.grid

    def scaled(grid: Grid) -> Grid:
        names = ("torque_sun", "torque_ring", "within_sun", "within_ring", "u_sun", "u_ring")
        changed = {name: scale * getattr(grid, name) for name in names}
        return replace(grid, points=replace(grid.points, torque_ring=changed["torque_ring"]), **changed)

    one, two = (
        study_residuals(analyse(g, OPTIONS, bench), bench, ("curves",), 19, 1).parts[0] for g in (grid, scaled(grid))
    )
    ours = {x.look.covariate.id: x for x in one.followed}
    theirs = {x.look.covariate.id: x for x in two.followed}
    for name, x in ours.items():
        if name in ("run_history",):
            continue
        assert theirs[name].p_value == pytest.approx(x.p_value, rel=1e-5, abs=1e-12)
        assert theirs[name].size == pytest.approx(scale * x.size, rel=1e-5, abs=1e-12)


def test_the_same_seed_gives_the_same_document(published_folder: Path) -> None:
    one, two = (run_residuals(None, published_folder, fit="curves", draws=19, seed=5).data for _ in range(2))
    assert json.dumps(one, allow_nan=False) == json.dumps(two, allow_nan=False)


def test_published_curves_miss_the_other_speed(published_folder: Path) -> None:
    """In the thesis's grid the ring's drag falls where the sun turns fast: plain to the eye, so it must be found."""
    data = run_residuals(None, published_folder, fit="curves", draws=99).data
    assert data["schema"] == "pmg.residuals/1"
    ring = next(part for part in data["fits"] if part["shaft"] == "ring")
    assert ring["noise_source"] == "rounding"
    assert ring["noise_Nm"] == pytest.approx(0.01 / np.sqrt(12.0))
    assert ring["chi_square"] / ring["dof"] > 10.0
    assert ring["covariates"][0]["id"] == "other_speed"
    assert ring["covariates"][0]["rank"] == 1
    assert {x["id"] for x in ring["not_tested"]} >= {"time", "run_history", "sign_own"}


def test_the_command_tells_writes_and_refuses(published_folder: Path, tmp_path: Path) -> None:
    run = CliRunner()
    grids = ["--grids", str(published_folder), "--draws", "19"]
    asked = ["--fit", "baseline", "--report", str(tmp_path), "--json", "--fail-on", "mismatch"]
    told = run.invoke(app, ["residuals", *grids, *asked])
    assert told.exit_code == 1, told.output
    result = json.loads(told.stdout)
    assert [(part["fit"], part["shaft"]) for part in result["data"]["fits"]] == [
        ("baseline", "sun"),
        ("baseline", "ring"),
    ]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "What the residuals follow" in page
    assert (tmp_path / "tables" / "residuals-covariates.csv").is_file()
    for bad in (["--fit", "curve"], ["--draws", "5"], ["--store", str(tmp_path)]):
        refused = run.invoke(app, ["residuals", *grids, *bad])
        assert refused.exit_code == 2, bad
        assert "; expected " in refused.output
    assert run.invoke(app, ["residuals"]).exit_code == 2


def test_damaged_input_is_refused(published_folder: Path, tmp_path: Path) -> None:
    with pytest.raises(PmgError):
        run_residuals(tmp_path, None)
    for name in ("neutral_grid.csv", "engaged_grid.csv"):
        text = (published_folder / name).read_text(encoding="utf-8").splitlines()
        (tmp_path / name).write_text("\n".join(text[:3] if name.startswith("neutral") else text), encoding="utf-8")
    refused = run_residuals(None, tmp_path, draws=19)
    assert refused.refusal is not None
    assert "; expected " in str(refused.refusal)
    assert not refused.data
