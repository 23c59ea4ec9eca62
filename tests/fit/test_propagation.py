"""Uncertainty carried to losses and to every branch of the power flow, beside draws of the same inputs."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom
from tests.points import joined, measured, points
from tests.report.example import draw_svg

from pmg.pipeline.analysis.outputs import FOLDER, write_analysis
from pmg.pipeline.analysis.power_flow import BRANCHES, Flow, flow_document, power_flows
from pmg.pipeline.chapters.measured.flow import flow_section
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.calibration import FittedBaseline, calibrate, parameter_values, with_parameters
from pmg.pipeline.fit.common_errors import CORRECTION, CommonErrorSources, causes_of_calibration, causes_of_fits
from pmg.pipeline.fit.loss_fit import LossFits, fit_losses
from pmg.pipeline.fit.losses import AVERAGED, QUANTITIES, power_balance
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.fit.propagation import Spread
from pmg.pipeline.grid.missing_uncertainty import unstated_columns, unstated_in
from pmg.pipeline.report.document import Figure, PowerFlow, Text
from pmg.pipeline.report.table import Table
from pmg.sim import signals
from pmg.sim.bench import BenchParameters, SourcedQuantity, load_bench
from pmg.sim.grid import Grid
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.signals import Array
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.power_chain import MotorConvention, power_chain
from pmg.sim.steady.solve import steady

POWERS = (0.0, 0.5, 1.0)
CURVE = LossCurve(POWERS, np.array([0.02, 0.09, 0.03]), 150.0, 200.0)
MODEL = LossModel(CURVE, CURVE, 0.85, 2e-2, 2.2e-4, 0.0)
BENCH = load_bench()
NOISE = 1e-3
DRAWS = 800


def campaign(model: LossModel = MODEL) -> Grid:
    """Exact readings with the uncertainty of noisy ones."""
    sun, ring = (a.ravel() for a in np.meshgrid(np.linspace(100, 1800, 7), np.linspace(60, 720, 6)))
    speed, load = (a.ravel() for a in np.meshgrid([300.0, 900.0, 1800.0], [0.8, 2.0]))
    forward = points("engaged", speed, -speed / 2.6, load, load_set=load)
    back = points("engaged", [600.0, 1500.0], [-600 / 2.6, -1500 / 2.6], -1.5, load_set=-1.5, drive="ring")
    exact = steady(Gearbox.calibrated(BENCH, model), joined(points("neutral", sun, ring), forward, back))
    grid = measured(exact.points, exact.torque_sun, exact.torque_ring, NOISE)
    common = np.abs(exact.torque_sun) * 1.2e-3, np.hypot(exact.torque_ring * 1.1e-3, 1e-3)
    return replace(grid, common_sun=common[0], common_ring=common[1])


@cache
def fitted() -> tuple[Grid, LossFits, FittedBaseline, CommonErrorSources, tuple[Flow, ...]]:
    grid = campaign()
    fits = fit_losses(grid, POWERS, POWERS)
    calibration = calibrate(grid, fits, BENCH)
    assert not calibration.on_bound
    causes = causes_of_calibration(grid, calibration, BENCH)
    gearbox = Gearbox.calibrated(BENCH, calibration.model)
    flows = power_flows(gearbox, grid, steady(gearbox, grid.points), BENCH, calibration, causes)
    return grid, fits, calibration, causes, flows


def drawn(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Errors of all readings of sun and ring, and of the parameters that were fitted to them: (DRAWS, n or k)."""
    grid, _, calibration, causes, _ = fitted()
    sun, ring = (NOISE * rng.standard_normal((DRAWS, len(grid))) for _ in range(2))
    for cause in causes.transducers:
        z = rng.standard_normal((DRAWS, 1))
        sun, ring = sun + z * cause.sun, ring + z * cause.ring
    theta = parameter_values(calibration.model, calibration.free)
    return sun, ring, theta + sun @ causes.influence[0].T + ring @ causes.influence[1].T


def test_every_branch_is_as_uncertain_as_draws_make_it(rng: np.random.Generator) -> None:
    grid, _, calibration, _, flows = fitted()
    rows = grid.points.engaged
    chosen = grid[rows]
    found: dict[tuple[str, MotorConvention], list[list[Array]]] = {(f.origin, f.convention): [] for f in flows}
    for sun, ring, theta in zip(*drawn(rng), strict=True):
        box = Gearbox.calibrated(BENCH, with_parameters(calibration.model, calibration.free, theta))
        at = replace(chosen.points, torque_ring=chosen.torque_ring + ring[rows])
        noisy = replace(chosen, points=at, torque_sun=chosen.torque_sun + sun[rows], torque_ring=at.torque_ring)
        of = {"measured": noisy, "simulated": replace(noisy, torque_sun=steady(box, at).torque_sun)}
        for origin, convention in found:
            chain = power_chain(box, of[origin], BENCH, convention)
            found[origin, convention].append([getattr(chain, branch) for branch in BRANCHES])
    for flow in flows:
        scatter = np.std(found[flow.origin, flow.convention], axis=0)
        for branch, seen in zip(BRANCHES, scatter, strict=True):
            what = f"{branch}, {flow.origin}, {flow.convention}"
            np.testing.assert_allclose(flow.spread.u(branch), seen, rtol=0.1, atol=1e-6, err_msg=what)


def test_losses_and_efficiencies_are_as_uncertain_as_draws_make_them(rng: np.random.Generator) -> None:
    grid, fits, calibration, causes, _ = fitted()
    stated = power_balance(grid, fits, calibration.model.correction, causes)
    assert stated.correction_fitted
    found: dict[str, list[Array]] = {signal.name: [] for signal in QUANTITIES}
    for sun, ring, theta in zip(*drawn(rng), strict=True):
        model = with_parameters(calibration.model, calibration.free, theta)
        moved = LossFits(replace(fits.sun, curve=model.curve_sun), replace(fits.ring, curve=model.curve_ring))
        noisy = replace(grid, torque_sun=grid.torque_sun + sun, torque_ring=grid.torque_ring + ring)
        for name, values in power_balance(noisy, moved, model.correction).values.items():
            found[name].append(values)
    for name, draws in found.items():
        np.testing.assert_allclose(stated.u(name), np.std(draws, axis=0), rtol=0.1, err_msg=name)


def test_the_transducers_move_the_curves_where_k_corr_is_held(rng: np.random.Generator) -> None:
    grid, fits, _, _, _ = fitted()
    noise_free = replace(grid, u_sun=0.0 * grid.u_sun, u_ring=0.0 * grid.u_ring)
    causes = causes_of_fits(noise_free, fits, BENCH)
    causes = replace(causes, root=0.0 * causes.root)
    stated = power_balance(noise_free, fits, 0.8, causes)
    found = []
    for _ in range(400):
        sun, ring = grid.torque_sun, grid.torque_ring
        for cause in causes.transducers:
            z = rng.standard_normal()
            sun, ring = sun + z * cause.sun, ring + z * cause.ring
        noisy = replace(grid, torque_sun=sun, torque_ring=ring)
        balance = power_balance(noisy, fit_losses(noisy, POWERS, POWERS), 0.8)
        found.append([balance.values[signal.name] for signal in QUANTITIES])
    for signal, seen in zip(QUANTITIES, np.std(found, axis=0), strict=True):
        np.testing.assert_allclose(stated.u(signal.name), seen, rtol=0.16, err_msg=signal.name)


def test_what_the_transducers_tolerances_let_expect_is_not_counted_as_scatter_again() -> None:
    grid = campaign()
    quiet = NOISE / 10.0
    grid = replace(grid, u_sun=np.full(len(grid), quiet), u_ring=np.full(len(grid), quiet))
    of_tolerance = sum(cause.sun for cause in fitted()[3].transducers)
    for strange, inflated in ((0.0, False), (60.0, True)):
        shift = of_tolerance + strange * quiet * np.where(np.arange(len(grid)) % 2, 1.0, -1.0)
        off = replace(grid, torque_sun=grid.torque_sun + shift)
        calibration = calibrate(off, fit_losses(off, POWERS, POWERS), BENCH)
        assert calibration.chi_square > 3.0 * calibration.dof
        scatter, _ = causes_of_calibration(off, calibration, BENCH).standard_errors()[CORRECTION]
        alone = calibration.standard_error(CORRECTION)
        assert alone is not None
        assert (scatter > 1.5 * alone) == inflated
        if not inflated:
            assert scatter == pytest.approx(alone)


def test_bearing_and_magnetic_loss_err_in_opposite_directions() -> None:
    grid, fits, calibration, causes, _ = fitted()
    balance = power_balance(grid, fits, calibration.model.correction, causes)
    bearings, magnetic = signals.LOSS_BEARINGS.name, signals.LOSS_MAGNETIC.name
    together = balance.spread.total({bearings: 1.0, magnetic: 1.0})
    np.testing.assert_allclose(together, balance.u(signals.LOSS_TOTAL.name), rtol=1e-9)
    assert (together < 0.7 * np.hypot(balance.u(bearings), balance.u(magnetic))).all()
    k_corr = balance.spread.part(bearings, CORRECTION)
    np.testing.assert_allclose(k_corr, balance.spread.part(magnetic, CORRECTION), rtol=1e-9)
    assert (k_corr > 0.0).all()


def test_the_signed_branches_leave_nothing_uncertain() -> None:
    for flow in fitted()[-1]:
        between = BRANCHES[3:9]
        for left, right in (
            ("electric_in", ("loss_motor_in", "mechanical_in")),
            ("mechanical_in", (*between, "mechanical_out")),
            ("mechanical_out", ("loss_motor_out", "electric_out")),
        ):
            open_end = flow.spread.total({left: 1.0} | dict.fromkeys(right, -1.0))
            np.testing.assert_allclose(open_end, 0.0, atol=1e-7 * float(flow.spread.u(left).max()))


@given(
    st.integers(1, 60),
    st.lists(st.floats(0.01, 5.0), min_size=2, max_size=2),
    st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3).filter(lambda z: max(map(abs, z)) > 0.01),
)
def test_the_common_part_of_a_mean_stays_and_the_independent_part_falls(
    n: int, own: list[float], shared: list[float]
) -> None:
    spread = Spread(
        ("loss",),
        np.tile(own, (1, n, 1)),
        np.zeros((1, n, 2)),
        {"a": np.tile(shared, (1, n, 1)), "b": np.tile(shared, (1, n, 1))},
    )
    mean = spread.mean("loss", np.full(n, 3.0))
    assert mean.value == pytest.approx(3.0)
    assert mean.points == n
    assert mean.independent == pytest.approx(float(np.linalg.norm(own)) / np.sqrt(n), rel=1e-9)
    assert mean.common == pytest.approx(2.0 * float(np.linalg.norm(shared)), rel=1e-9)


def test_common_errors_of_opposite_sign_cancel_in_a_mean() -> None:
    shared = np.array([[[1.0], [-1.0]]])
    mean = Spread(("loss",), np.ones((1, 2, 2)), np.zeros((1, 2, 2)), {"a": shared}).mean("loss", np.zeros(2))
    assert mean.common == pytest.approx(0.0, abs=1e-15)
    assert mean.independent == pytest.approx(1.0)


def test_an_unexplained_branch_is_flagged_where_it_is_planted() -> None:
    grid, _, calibration, causes, flows = fitted()
    assert not any(flow.beyond.any() for flow in flows)
    struck = int(np.flatnonzero(grid.points.engaged)[2])
    torque = grid.torque_sun.copy()
    torque[struck] += 12.0 * NOISE
    off = replace(grid, torque_sun=torque)
    gearbox = Gearbox.calibrated(BENCH, calibration.model)
    flow = power_flows(gearbox, off, steady(gearbox, off.points), BENCH, calibration, causes)[0]
    assert flow.grid.points.name[flow.beyond].tolist() == [grid.points.name[struck]]


def test_a_motor_constant_with_a_stated_uncertainty_counts_and_one_without_is_named() -> None:
    grid, _, calibration, causes, flows = fitted()
    assert flows[0].spread.lacking("electric_in") == ("motors",)
    assert flows[0].spread.lacking("mechanical_in") == ()
    assert flows[0].spread.lacking("unexplained") == ()
    assert flows[0].spread.lacking("loss_sun_bearings") == ("bearing shares",)
    motor = BENCH.motor
    known = replace(
        motor, **{f: SourcedQuantity(float(getattr(motor, f)), "", abs(getattr(motor, f)) * 0.02) for f in vars(motor)}
    )
    bench = replace(BENCH, motor=known)
    gearbox = Gearbox.calibrated(bench, calibration.model)
    flow = power_flows(gearbox, grid, steady(gearbox, grid.points), bench, calibration, causes)[0]
    assert flow.spread.lacking("electric_in") == ()
    resistive = (
        0.02
        * float(motor.resistance)
        * ((flow.grid.torque_sun + motor.damping * flow.grid.points.speed_sun) / motor.torque_constant) ** 2
    )
    forward = ~flow.chain.drive_ring
    assert (flow.spread.part("electric_in", "motors")[forward] > resistive[forward]).all()
    assert (flow.spread.part("mechanical_in", "motors") == 0.0).all()


def test_a_parameter_on_its_bound_may_still_be_off() -> None:
    grid = campaign(replace(MODEL, b=0.0))
    rng = np.random.default_rng(3)
    grid = replace(
        grid, torque_sun=grid.torque_sun - 4e-3 * grid.points.engaged + 1e-4 * rng.standard_normal(len(grid))
    )
    calibration = calibrate(grid, fit_losses(grid, POWERS, POWERS), BENCH, correction=0.85)
    assert calibration.on_bound == ("b",)
    b = calibration.names.index("b")
    assert np.isnan(calibration.covariance[b, b])
    assert calibration.moments[b, b] > 0.0
    assert (np.linalg.eigvalsh(calibration.moments) > -1e-12).all()
    inside = [i for i in range(len(calibration.names)) if i != b]
    np.testing.assert_array_equal(calibration.moments[inside][:, inside], calibration.covariance[inside][:, inside])


@cache
def analysis() -> Analysis:
    rng = np.random.default_rng(11)
    grid = campaign()
    ring = grid.torque_ring + NOISE * rng.standard_normal(len(grid))
    noisy = replace(grid, torque_sun=grid.torque_sun + NOISE * rng.standard_normal(len(grid)), torque_ring=ring)
    noisy = replace(noisy, points=replace(noisy.points, torque_ring=ring))
    return analyse(noisy, AnalysisOptions(powers_sun=POWERS, powers_ring=POWERS), BENCH)


def test_both_parts_are_columns_of_what_is_written(tmp_path: Path) -> None:
    folder = write_analysis(analysis(), tmp_path, BENCH)
    assert folder == tmp_path / FOLDER
    flow, same = pd.read_csv(folder / "power_flow.csv"), pl.read_parquet(folder / "power_flow.parquet")
    assert list(flow.columns) == same.columns
    for branch in BRANCHES:
        parts = [f"u_{group}_{branch}_W" for group in ("transducers", "curves", "K_corr", "damping")]
        assert {f"{branch}_W", f"u_{branch}_W", f"u_common_{branch}_W", *parts} <= set(flow.columns)
    losses = pd.read_csv(folder / "losses.csv")
    assert (losses.u_K_corr_loss_magnetic_W > 0.0).all()
    assert set(losses.K_corr) == {"fitted"}
    means = pd.read_csv(folder / "means_by_load.csv")
    assert {f"u_common_mean_{signal.name}{'_W' if signal.unit == 'W' else ''}" for signal in AVERAGED} <= set(means)
    document = json.loads((folder / "power_flow.json").read_text(encoding="utf-8"))
    branch = document["points"][0]["branches"]["loss_gear"]
    assert set(branch) == {"value_W", "u_independent_W", "u_common_W", "u_common_by_cause_W"}
    summary = json.loads((folder / "analysis.json").read_text(encoding="utf-8"))
    unstated = {entry["what"]: entry["reason"] for entry in summary["without_uncertainty"]}
    assert unstated["correction_by_rule"] == "no uncertainty stated"
    assert "loss_curves.sun.coefficients_Nm.[]" not in unstated
    assert {entry["what"] for entry in summary["columns_without_uncertainty"]["power_flow.csv"]} == {
        "speed_sun_rpm",
        "load_set_Nm",
    }


def test_a_held_k_corr_is_called_held(tmp_path: Path) -> None:
    grid = analysis().grid
    held = analyse(grid, AnalysisOptions(powers_sun=POWERS, powers_ring=POWERS, correction="0.8"), BENCH)
    assert held.balance is not None
    assert CORRECTION not in held.balance.spread.groups
    losses = pd.read_csv(write_analysis(held, tmp_path, BENCH) / "losses.csv")
    assert set(losses.K_corr) == {"held"}
    assert losses.u_K_corr_loss_magnetic_W.isna().all()


def test_numbers_without_uncertainty_are_listed_with_their_reason() -> None:
    document = {
        "fit": {"slope_Nm_s": 1.0, "slope_standard_error_Nm_s": 0.1, "r_squared": 0.9, "points": 5},
        "constants": {"c": {"value": 1.0, "standard_error": None}, "b": {"value": 1.0, "standard_error": 0.5}},
        "new": [{"speed": 3.0, "u_speed": 0.1}, {"anything": 4.0}],
        "text": "no number",
        "flag": True,
    }
    assert {entry["what"]: entry["reason"] for entry in unstated_in(document)} == {
        "fit.r_squared": "a statistic of a fit",
        "fit.points": "a count",
        "constants.c.value": "held, or on its bound",
        "new.[].anything": "no uncertainty stated",
    }
    frame = pd.DataFrame({"power_W": [1.0], "u_power_W": [0.1], "gear": [1], "other": [2.0], "name": ["a"]})
    assert [entry["what"] for entry in unstated_columns(frame)] == ["gear", "other"]


def test_the_chapter_states_u_of_each_branch(bench: BenchParameters) -> None:
    section = flow_section(fitted()[-1])
    tables = {item.id: item for item in section.items if isinstance(item, Table)}
    assert tables["power-flow-highest-parts"].rows[0][0] == "electric in *"
    header = tables["power-flow-uncertainty"].csv().splitlines()[0]
    assert "u_unexplained [W],u_common_unexplained [W]" in header
    assert not tables["power-flow-table"].marked
    (figure,) = (item for item in section.items if isinstance(item, Figure))
    (flow,) = figure.panels
    assert isinstance(flow, PowerFlow)
    inside = [label for label, _, stage in flow.losses if stage == 1]
    assert inside[-2:] == ["relative bearing", "unexplained"]
    letters = "".join(ElementTree.fromstring(draw_svg(figure)).itertext())
    assert letters.count("±") >= 8


def test_powers_off_by_more_than_u_are_a_warning_where_chance_does_not_make_as_many() -> None:
    flow, *others = fitted()[-1]
    n = len(flow.grid)

    def told(beyond: int, times: float = 1.1) -> Text:
        off = np.where(np.arange(n) < beyond, times, 0.5) * flow.expanded("unexplained")
        chain = replace(flow.chain, unexplained=off)
        section = flow_section((replace(flow, chain=chain), *others))
        return next(item for item in section.items if isinstance(item, Text) and item.kind in {"finding", "warning"})

    by_chance = max(k for k in range(n) if binom.sf(k - 1, n, 0.0455) > 0.05)
    assert told(0).kind == told(by_chance).kind == "finding"
    assert f"at {n - by_chance} of {n} points; 5% of points lie beyond U by chance" in told(by_chance).body
    assert told(by_chance + 1).kind == told(1, times=10.0).kind == "warning"
    assert f"at {by_chance + 1} of {n} points" in told(by_chance + 1).body


@pytest.mark.parametrize("expanded", [(1.0,), (1.0, 1.0, -1.0)])
def test_a_flow_wants_one_uncertainty_for_each_power(expanded: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="one uncertainty for each power"):
        PowerFlow("t", (("in", 10.0), ("out", 8.0)), (("bearings", 2.0, 0),), expanded)


def test_the_documents_branches_are_those_of_the_chain() -> None:
    document = flow_document(fitted()[-1])
    assert list(document["points"][0]["branches"]) == list(BRANCHES)
    assert document["no_uncertainty_stated"]["electric_in"] == ["motors"]
