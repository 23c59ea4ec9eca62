"""Models kept as TOML: read back bit for bit, faults reported with their place, carried to campaigns not seen."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.conftest import ROOT
from tests.points import joined, measured, points
from typer.testing import CliRunner

from pmg.pipeline.chapters.explained.extended_model import ends_table, prediction_table
from pmg.pipeline.cli.app import app
from pmg.pipeline.commands.compare_and_diagnose import compare_and_diagnose, leave_model
from pmg.pipeline.diagnosis.grid.candidates import predict_with
from pmg.pipeline.diagnosis.grid.locate import find_mismatch
from pmg.pipeline.diagnosis.grid.zeros import zero_columns
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.readings import predict, take_readings
from pmg.pipeline.model.apply_model import apply_model, lead, remark
from pmg.pipeline.model.extreme_steady_points import _spread_over, extreme_steady_points
from pmg.pipeline.model.model_file import Model, Part, grid_digest, model_of, model_text
from pmg.pipeline.model.read_model import names_on, read_model, with_model
from pmg.pipeline.simulate.scenario_mechanisms import _key_of_parameter, switch_on_by_words
from pmg.sim.bench import load_bench
from pmg.sim.errors import BenchError
from pmg.sim.grid import Grid
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.mechanisms import BASELINE, CANDIDATES, OTHERS, REFINED, GainError, LoadFriction, Mechanism
from pmg.sim.mechanisms.friction import RubbingCarrier, Windage
from pmg.sim.mechanisms.instruments import ZeroOffset
from pmg.sim.mechanisms.thermal import WarmingInTwoSteps
from pmg.sim.steady.baseline import baseline_mechanisms
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

BENCH = load_bench()
RUNNER = CliRunner()
SUN = LossCurve((0.0, 0.5, 1.0), np.array([0.0067, 0.103, 0.0368]), 196.0353815840031, 196.0)
RING = LossCurve((0.0, 0.5), np.array([0.056, 0.257]), 75.39822368615503, 75.4)
BASELINE_HERE = LossModel(SUN, RING, 0.8950741993435047, 3.1e-4, 2.8e-4, 0.0)
OPTIONS = AnalysisOptions(powers_sun=(0.0, 0.5, 1.0), powers_ring=(0.0, 0.5, 1.0))
KINDS: tuple[type[Mechanism], ...] = (*CANDIDATES, *REFINED)


def part(kind: type[Mechanism], shaft: str, share: float = 0.3) -> Part:
    known = {p.name: p for p in kind.parameters() if p.name in names_on(kind, shaft)}
    values = {name: p.bounds[0] + share * (p.bounds[1] - p.bounds[0]) for name, p in known.items()}
    return Part(kind, shaft, values, {name: 0.1 * abs(p.typical) for name, p in known.items()})


def written(folder: Path, model: Model, text: str | None = None) -> Path:
    path = folder / "model.toml"
    path.write_text(model_text(model) if text is None else text, encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_mechanism_reads_back_bit_for_bit(kind: type[Mechanism], tmp_path: Path) -> None:
    shafts = (*kind.by_shaft, *(("both",) if kind.both_at_once else ()))
    for shaft in shafts:
        errors = {"K_corr": 0.019228942560158717, "sun[0.5]": 1.0 / 3.0, "c": 1e-17}
        model = Model(BASELINE_HERE, errors, (part(kind, shaft, 1.0 / 3.0),), {"campaign": 'a "b" ä \\ c'})
        read = read_model(written(tmp_path, model))
        assert model_text(read) == model_text(model)
        assert read.parts == model.parts
        assert read.errors == errors
        assert read.provenance == model.provenance
        assert np.array_equal(read.baseline.curve_sun.coefficients, SUN.coefficients)
        assert replace(read.baseline, curve_sun=SUN, curve_ring=RING) == BASELINE_HERE
        assert read.mechanisms(BENCH)[0].torque(points("engaged", [600.0], [-230.0], 1.0)) is not None


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=3, max_size=3), st.floats(0.0, 1.0))
def test_any_number_reads_back_bit_for_bit(coefficients: list[float], correction: float) -> None:
    curve = replace(SUN, coefficients=np.array(coefficients))
    model = Model(replace(BASELINE_HERE, curve_sun=curve, correction=correction))
    with TemporaryDirectory() as folder:
        read = read_model(written(Path(folder), model))
    assert np.array_equal(np.signbit(read.baseline.curve_sun.coefficients), np.signbit(coefficients))
    assert read.baseline.curve_sun.coefficients.tolist() == coefficients
    assert read.baseline.correction == correction


FAULTS = [
    ('id = "windage"', 'id = "windige"', "mechanism[1].id", "Did you mean 'windage'?"),
    ("k_sun = {", "k_son = {", "mechanism[1].parameters.k_son", "Did you mean 'k_sun'?"),
    ("k_sun = {", "k_ring = {", "mechanism[1].parameters.k_ring", "Known: k_sun."),
    ("value = 3e-05,", "value = 3.0,", "mechanism[1].parameters.k_sun.value", "0 to 0.0001 N m s2/rad2"),
    ("value = 3e-05,", "value = nan,", "mechanism[1].parameters.k_sun.value", "a finite number"),
    ('shaft = "sun"', 'shaft = "son"', "mechanism[1].shaft", "Did you mean 'sun'?"),
    ('component = "sun', 'component = "ring', "mechanism[1].component", '"sun_bearings"'),
    ('unit = "N m s2/rad2"', 'unit = "N m"', "mechanism[1].parameters.k_sun.unit", "Convert the value"),
    ("K_corr = { value = 0.89", "K_corr = { value = 1.89", "baseline.K_corr.value", "0 to 1"),
    ("powers = [0.0, 0.5, 1.0]", "powers = [0.0, 0.5]", "baseline.sun.coefficients_Nm", "2, one for each power"),
    ("powers = [0.0, 0.5, 1.0]", "powers = [0.5, 0.5, 1.0]", "baseline.sun.powers", "each once"),
    ("[baseline.ring]", "[baseline.rink]", "baseline.rink", "Did you mean 'ring'?"),
    ("pmg.model/1", "pmg.model/9", "schema", '"pmg.model/1"'),
    ("[provenance]", "[provinence]", "provinence", "Did you mean 'provenance'?"),
    ("[[mechanism]]", "[mechanism]", "mechanism", "double brackets"),
    ("schema =", "schema = =", "", "TOML"),
]


@pytest.mark.parametrize(("old", "new", "where", "told"), FAULTS, ids=[f"{i}-{row[1]}" for i, row in enumerate(FAULTS)])
def test_a_fault_is_told_with_file_and_key(old: str, new: str, where: str, told: str, tmp_path: Path) -> None:
    text = model_text(Model(BASELINE_HERE, {}, (Part(Windage, "sun", {"k_sun": 3e-5}),), {"campaign": "x"}))
    assert old in text
    path = written(tmp_path, Model(BASELINE_HERE), text.replace(old, new, 1))
    with pytest.raises(BenchError) as refused:
        read_model(path)
    assert refused.value.where.startswith(str(path))
    assert refused.value.where.endswith(where)
    assert told in str(refused.value)


def test_a_mechanism_without_a_size_and_one_given_twice_are_refused(tmp_path: Path) -> None:
    both = (part(GainError, "sun"), part(GainError, "ring"))
    with pytest.raises(BenchError, match="'torque_gain_error' twice"):
        read_model(written(tmp_path, Model(BASELINE_HERE, {}, both)))
    text = model_text(Model(BASELINE_HERE, {}, (part(GainError, "sun"),)))
    with pytest.raises(BenchError, match=r"no size.*gain_sun"):
        read_model(written(tmp_path, Model(BASELINE_HERE), re.sub(r"gain_sun = .*\n", "", text)))
    with pytest.raises(BenchError, match="Check the path"):
        read_model(tmp_path / "nowhere.toml")


# --- carried to a campaign -----------------------------------------------------------------------------

TRUTH = (LoadFriction.of(BENCH, BASELINE_HERE), GainError(gain_sun=0.01))
FRICTION = replace(TRUTH[0], mu_sun=0.02)
NOISE = 1e-3


def campaign(seed: int, *extra: Mechanism) -> Grid:
    """Neutral and engaged points in random order, both directions of power flow, with noise."""
    rng = np.random.default_rng(seed)
    sun, ring = (axis.ravel() for axis in np.meshgrid(np.linspace(150.0, 1850.0, 8), np.linspace(60.0, 700.0, 6)))
    speed, load = (axis.ravel() for axis in np.meshgrid(np.linspace(150.0, 1850.0, 8), [-1.9, -0.8, 0.8, 1.9]))
    at = joined(points("neutral", sun, ring), points("engaged", speed, -speed / BENCH.gear1.ratio, load, load_set=load))
    at = replace(at, started_at=1e9 + 45.0 * rng.permutation(len(at)).astype(np.float64))
    made = steady(Gearbox(BENCH, (*baseline_mechanisms(BASELINE_HERE, BENCH), *extra)), at)
    noisy = [torque + NOISE * rng.standard_normal(len(at)) for torque in (made.torque_sun, made.torque_ring)]
    return measured(at, noisy[0], np.where(at.engaged, at.torque_ring, noisy[1]), NOISE)


@cache
def analysed(seed: int, *extra: Mechanism) -> Analysis:
    return analyse(campaign(seed, *extra), OPTIONS, BENCH)


def friction_model() -> Model:
    return Model(BASELINE_HERE, {}, (Part(LoadFriction, "sun", {"mu_sun": 0.02}),))


def test_a_true_model_predicts_a_campaign_it_has_not_seen_to_the_noise() -> None:
    found = apply_model(friction_model(), analysed(3, FRICTION), OPTIONS, BENCH)
    engaged = next(p for p in found.predictions if p.kind == "sun torque, engaged")
    assert engaged.count == 32
    assert engaged.as_is < 1.3 * NOISE
    assert engaged.recalibrated > 3.0 * NOISE
    assert engaged.refitted < 1.3 * NOISE
    assert found.here.parts[0].values["mu_sun"] == pytest.approx(0.02, abs=4.0 * found.here.parts[0].errors["mu_sun"])
    assert not found.own
    assert remark(found).startswith("The given model uses nothing of this campaign.")


def test_a_model_knows_its_own_campaign() -> None:
    analysis = analysed(3, FRICTION)
    assert analysis.calibration is not None
    model = model_of(analysis.grid, analysis.calibration, None)
    assert model.baseline == analysis.calibration.model
    assert apply_model(model, analysis, OPTIONS, BENCH).own
    moved = replace(analysis.grid, torque_sun=np.nextafter(analysis.grid.torque_sun, 9.0))
    assert grid_digest(moved) != model.provenance["grid_sha256"]


@pytest.mark.parametrize("extra", [(FRICTION,), (FRICTION, TRUTH[1])], ids=["nothing else", "a gain error besides"])
def test_what_remains_is_judged_with_the_model_in(extra: tuple[Mechanism, ...]) -> None:
    found = apply_model(friction_model(), analysed(5, *extra), OPTIONS, BENCH)
    left = found.analysis
    assert left.fits is not None
    assert left.floor is not None
    allowed = found.slopes(take_readings(left.grid, BENCH))
    rng = np.random.default_rng(1)
    alone = analysed(5, *extra)
    assert alone.fits is not None
    assert alone.floor is not None
    assert find_mismatch(alone.grid, alone.fits, alone.floor, BENCH, rng, draws=99).found
    remaining = find_mismatch(left.grid, left.fits, left.floor, BENCH, rng, draws=99, allowed=allowed)
    assert remaining.found == (len(extra) == 2)


def test_slopes_are_those_of_the_readings() -> None:
    found = apply_model(friction_model(), analysed(3, FRICTION), OPTIONS, BENCH)
    readings = take_readings(found.analysis.grid, BENCH)
    at = readings.grid.points
    load = np.abs(at.torque_ring) / BENCH.gear1.ratio * np.sign(at.speed_sun) * at.engaged
    np.testing.assert_allclose(found.slopes(readings)[:, 0], np.where(readings.sun, load[readings.row], 0.0), atol=1e-9)


def test_the_moving_bench_ends_where_the_steady_solver_does() -> None:
    faulty = (FRICTION, GainError(gain_sun=0.01, gain_ring=-0.02))
    grid = campaign(2, *faulty)
    plain = baseline_mechanisms(BASELINE_HERE, BENCH)
    ends = extreme_steady_points(grid, BENCH, plain, (*plain, *faulty))
    rows = _spread_over(grid)
    assert len(rows) == 4
    assert [end.configuration for end in ends] == ["neutral"] * 4 + ["engaged"] * 2
    wanted = steady(Gearbox(BENCH, (*plain, *faulty)), grid.points)
    for end in ends:
        row = int(np.flatnonzero(grid.points.name == end.point)[0])
        assert end.after == pytest.approx(float(getattr(wanted, f"torque_{end.shaft}")[row]), abs=1e-6)
        assert abs(end.after - end.measured) < 5.0 * NOISE
    assert any(abs(end.before - end.measured) > 5.0 * NOISE for end in ends)


def test_analyse_holds_the_correction_of_a_model_and_nothing_else(tmp_path: Path) -> None:
    path = written(tmp_path, friction_model())
    held = with_model(OPTIONS, path, None)
    assert held.fixed_correction == BASELINE_HERE.correction
    assert replace(held, correction="joint") == OPTIONS
    with pytest.raises(BenchError, match="and --k-corr"):
        with_model(OPTIONS, path, "0.8")


# --- switched on in scenarios --------------------------------------------------------------------------


def test_keys_carry_their_units() -> None:
    keys = {_key_of_parameter(p) for kind in KINDS for p in kind.parameters()}
    assert {"extra_sun_Nm", "mu_sun", "k_sun_Nm_s2_per_rad2", "resistance_sun_K_per_W", "shielding_s_per_rad"} <= keys
    assert all(re.fullmatch(r"[A-Za-z0-9_]+", key) for key in keys)


def test_sizes_are_typical_unless_one_is_given() -> None:
    (typical,) = switch_on_by_words(["stribeck_mixed_lubrication"])
    assert dict(typical.values) == {p.name: p.typical for p in typical.kind.parameters()}
    (one,) = switch_on_by_words(["stribeck_mixed_lubrication: extra_sun_Nm = 0.01"])
    assert dict(one.values) == {"extra_sun": 0.01, "extra_ring": 0.0, "speed": 15.0}
    (fine,) = switch_on_by_words(["lubricant_viscosity:refined=true"])
    assert fine.kind is WarmingInTwoSteps


@pytest.mark.parametrize("kind", CANDIDATES, ids=lambda kind: kind.__name__)
def test_every_mechanism_can_be_switched_on(kind: type[Mechanism]) -> None:
    (found,) = switch_on_by_words([kind.identifier])
    made = found.mechanism(BENCH, BASELINE_HERE)
    assert isinstance(made, kind)
    at = points("engaged", [600.0, 900.0], [-230.0, -346.0], 1.0, started_at=np.array([0.0, 3600.0]))
    plain = baseline_mechanisms(BASELINE_HERE, BENCH)
    neutral = points("neutral", [600.0, 900.0], [230.0, 346.0], started_at=np.array([0.0, 3600.0]))
    changes = [
        steady(Gearbox(BENCH, (*plain, made)), where).torque_sun - steady(Gearbox(BENCH, plain), where).torque_sun
        for where in (at, neutral)
    ]
    assert np.abs(changes).max() > 1e-7


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("windige", "Did you mean 'windage'?"),
        ("windage:k_sun=1", "Did you mean 'k_sun_Nm_s2_per_rad2'?"),
        ("windage:k_sun_Nm_s2_per_rad2=1", "0 to 0.0001"),
        ("windage:k_sun_Nm_s2_per_rad2=lots", "a number"),
        ("windage:k_sun_Nm_s2_per_rad2", "key=value"),
        ("windage:k_sun_Nm_s2_per_rad2=nan", "a number from"),
        ("torque_zero_offset:refined=true", "more detail"),
        (BASELINE[0].identifier, "[losses]"),
        *((kind.identifier, kind.instead) for kind in OTHERS),
    ],
)
def test_a_wrong_option_is_refused(text: str, told: str) -> None:
    with pytest.raises(BenchError) as refused:
        switch_on_by_words([text])
    assert told in str(refused.value)
    assert "--with" in refused.value.where


POINT = """
[losses]
model = "model.toml"
[mechanism.engaged_dry_friction]
friction_sun_Nm = 0.004
[point]
speed_sun_rpm = 600
torque_ring_Nm = 1.5
[output]
formats = ["csv"]
figures = false
"""


def test_a_scenario_stands_on_a_model_and_more(tmp_path: Path) -> None:
    written(tmp_path, friction_model())
    (tmp_path / "scenario.toml").write_text(POINT)
    out = tmp_path / "out"
    call = ["simulate", str(tmp_path / "scenario.toml"), "--out", str(out), "--with", "torque_gain_error:gain_sun=0.1"]
    done = RUNNER.invoke(app, call)
    assert done.exit_code == 0, done.stderr
    row = pl.read_csv(out / "points.csv").row(0, named=True)
    speed = 600.0
    at = points("engaged", [speed], [-speed / BENCH.gear1.ratio], 1.5)
    rubbing = RubbingCarrier(friction_sun=0.004)
    wanted = steady(Gearbox(BENCH, (*baseline_mechanisms(BASELINE_HERE, BENCH), FRICTION, rubbing)), at)
    assert row["torque_sun_Nm"] == pytest.approx(float(wanted.torque_sun[0]), abs=1e-12)
    assert row["reading_sun_Nm"] == pytest.approx(1.1 * row["torque_sun_Nm"], abs=1e-12)
    twice = RUNNER.invoke(app, [*call, "--with", "load_dependent_bearing_friction"])
    assert twice.exit_code == 2
    assert "load_dependent_bearing_friction twice" in twice.stderr


def test_the_shipped_scenario_with_mechanisms_is_read() -> None:
    from pmg.pipeline.simulate.scenario_file import read_scenario

    scenario = read_scenario(ROOT / "raw" / "scenarios" / "mechanisms.toml").table
    assert [one.kind.identifier for one in scenario.mechanism] == [
        "stribeck_mixed_lubrication",
        "load_dependent_bearing_friction",
        "lubricant_viscosity",
    ]


# --- a campaign judged with a model --------------------------------------------------------------------


def test_a_campaign_is_judged_with_the_model_and_leaves_it_as_it_was(tmp_path: Path) -> None:
    given = written(tmp_path, friction_model())
    found = compare_and_diagnose(analysed(5, FRICTION), OPTIONS, BENCH, np.random.default_rng(1), read_model(given))
    assert found is not None
    assert found.carried is not None
    assert found.diagnosis.verdict == "consistent"
    assert lead(found.carried) == "With the model fitted to this campaign (Bearing friction growing with load (sun)): "
    engaged = found.residuals.grid.points.engaged
    assert float(np.sqrt(np.mean(found.residuals.torque_sun.value[engaged] ** 2))) < 1.3 * NOISE
    assert len(found.ends) == 6
    tables = prediction_table(found.carried), ends_table(found.ends)
    assert [len(table.rows) for table in tables] == [4, 6]
    text = given.read_bytes()
    assert leave_model(found, given, given)["model"] is None
    assert given.read_bytes() == text
    other = leave_model(found, tmp_path / "after" / "model.toml", given)
    after = read_model(tmp_path / "after" / "model.toml")
    assert after.parts[0].values["mu_sun"] == pytest.approx(0.02, abs=2e-3)
    assert after.provenance["grid_sha256"] == grid_digest(found.residuals.grid)
    assert other["prediction"][-1]["count"] == found.carried.predictions[-1].count


def test_a_model_that_cannot_be_read_ends_the_command_in_one_line(tmp_path: Path) -> None:
    path = written(tmp_path, Model(BASELINE_HERE), "schema = 3\n")
    report = str(tmp_path / "report")
    for command in ("compare", "design"):
        done = RUNNER.invoke(app, [command, "--store", str(tmp_path), "--report", report, "--model", str(path)])
        assert done.exit_code == 2
        assert f"{path}: line 1, schema: 3" in done.stderr.replace("\n", "")


def test_a_zero_of_a_transducer_moves_what_that_transducer_reads() -> None:
    """By as much; where the ring torque is the input of an engaged point, the sun's reading through the gear."""
    analysis = analysed(3, FRICTION)
    assert analysis.calibration is not None
    readings = take_readings(analysis.grid, BENCH)
    of_sun, of_ring = zero_columns(readings, BENCH, analysis.calibration.model).T
    engaged = readings.configuration == "engaged"
    np.testing.assert_allclose(of_sun[readings.sun & ~engaged], 1.0, atol=1e-6)
    np.testing.assert_allclose(of_sun[~readings.sun], 0.0, atol=1e-6)
    np.testing.assert_allclose(of_ring[~readings.sun], 1.0, atol=1e-6)
    np.testing.assert_allclose(of_ring[readings.sun & ~engaged], 0.0, atol=1e-6)
    assert np.all(np.abs(of_ring[engaged]) > 0.3)
    further = ZeroOffset(offset_sun=2e-3, offset_ring=-1e-3)
    moved = predict_with(readings, BENCH, analysis.calibration.model, (further,))
    moved -= predict(readings, BENCH, analysis.calibration.model)
    np.testing.assert_allclose(2e-3 * of_sun - 1e-3 * of_ring, moved, atol=1e-7)
