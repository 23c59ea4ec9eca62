from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.points import joined, points

from pmg.pipeline.fit.calibration import calibrate
from pmg.pipeline.fit.damping import fit_damping
from pmg.pipeline.fit.loss_fit import fit_losses
from pmg.pipeline.fit.losses import QUANTITIES, largest_plausible_correction, power_balance
from pmg.pipeline.fit.options import chosen_options
from pmg.pipeline.wording.option_words import DampingMethod
from pmg.sim import signals
from pmg.sim.bench import BenchParameters
from pmg.sim.errors import FitError
from pmg.sim.grid import Grid
from pmg.sim.losscurve import LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady

CURVE = LossCurve((0.0, 0.5, 1.0), np.array([0.01, 0.08, 0.03]), 150.0, 200.0)
MODEL = LossModel(CURVE, CURVE, 0.8, 6e-4, 2.2e-4, 0.0)


def simulated(bench: BenchParameters) -> Grid:
    sun, ring = (a.ravel() for a in np.meshgrid(np.linspace(100, 1800, 9), np.linspace(60, 720, 6)))
    speed, load = (a.ravel() for a in np.meshgrid(np.linspace(200, 1800, 8), [0.8, 1.5, 2.0]))
    forward = points("engaged", speed, -speed / 2.6, load, load_set=load)
    back = points("engaged", speed, -speed / 2.6, -load, load_set=-load, drive="ring")
    grid = steady(Gearbox.calibrated(bench, MODEL), joined(points("neutral", sun, ring), forward, back))
    return replace(grid, points=replace(grid.points, torque_ring=grid.torque_ring))


def test_the_balance_finds_the_losses_the_simulator_put_in(bench: BenchParameters) -> None:
    grid = simulated(bench)
    fits = fit_losses(grid, CURVE.powers, CURVE.powers)
    balance = power_balance(grid, fits, MODEL.correction)
    at = balance.grid.points
    gear = Gearbox.calibrated(bench, MODEL)
    lost = {m.identifier: -t.power(at) for m, t in zip(gear.mechanisms, gear.contributions(at), strict=True)}
    magnetic = lost["hysteresis_damping"] + lost["eddy_damping"]
    bearings = lost["sun_bearing_drag"] + lost["relative_bearing_share"] + lost["ring_bearing_drag"]
    np.testing.assert_allclose(balance.values[signals.LOSS_MAGNETIC.name], magnetic, atol=1e-9)
    np.testing.assert_allclose(balance.values[signals.LOSS_BEARINGS.name], bearings, rtol=1e-9)


def test_efficiencies_multiply_and_stay_below_one_in_either_flow(bench: BenchParameters) -> None:
    grid = simulated(bench)
    values = power_balance(grid, fit_losses(grid, CURVE.powers, CURVE.powers), MODEL.correction).values
    total, magnetic, bearing = (
        values[s.name] for s in (signals.EFFICIENCY_TOTAL, signals.EFFICIENCY_MAGNETIC, signals.EFFICIENCY_BEARINGS)
    )
    np.testing.assert_allclose(total, magnetic * bearing, rtol=1e-12)
    np.testing.assert_allclose(total, values["power_out"] / values["power_in"], rtol=1e-12)
    assert (magnetic < 1.0).all()


def test_damping_constants_come_back(bench: BenchParameters) -> None:
    grid = simulated(bench)
    fit = fit_damping(grid, fit_losses(grid, CURVE.powers, CURVE.powers), MODEL.correction)
    assert fit.b == pytest.approx(MODEL.b, rel=1e-6)
    assert fit.c == pytest.approx(MODEL.c, rel=1e-6)
    assert fit.d == pytest.approx(0.0, abs=1e-9)


def test_the_rule_gives_the_factor_at_which_the_worst_magnetic_loss_is_zero(bench: BenchParameters) -> None:
    grid = simulated(bench)
    fits = fit_losses(grid, CURVE.powers, CURVE.powers)
    rule = largest_plausible_correction(grid, fits)
    worst = power_balance(grid, fits, rule).values[signals.LOSS_MAGNETIC.name]
    assert worst.min() == pytest.approx(0.0, abs=1e-9)
    assert power_balance(grid, fits, rule + 0.01).values[signals.LOSS_MAGNETIC.name].min() < 0.0


def test_a_factor_that_is_too_large_is_flagged_and_not_clipped(bench: BenchParameters) -> None:
    grid = simulated(bench)
    fits = fit_losses(grid, CURVE.powers, CURVE.powers)
    balance = power_balance(replace(grid, u_sun=np.full(len(grid), 1e-5), u_ring=np.full(len(grid), 1e-5)), fits, 1.0)
    assert balance.above_one().any()
    assert balance.values[signals.EFFICIENCY_MAGNETIC.name].max() > 1.0


def test_independent_uncertainty_is_what_monte_carlo_finds(bench: BenchParameters, rng: np.random.Generator) -> None:
    grid = simulated(bench)
    n = len(grid)
    grid = replace(grid, u_sun=np.full(n, 2e-3), u_ring=np.full(n, 3e-3))
    fits = fit_losses(grid, CURVE.powers, CURVE.powers)
    stated = power_balance(grid, fits, 0.8).independent
    drawn: dict[str, list[np.ndarray]] = {signal.name: [] for signal in QUANTITIES}
    for _ in range(1500):
        noisy = replace(
            grid,
            torque_sun=grid.torque_sun + 2e-3 * rng.standard_normal(n),
            torque_ring=grid.torque_ring + 3e-3 * rng.standard_normal(n),
        )
        for name, values in power_balance(noisy, fits, 0.8).values.items():
            drawn[name].append(values)
    for name in ("loss_total", "loss_magnetic", "efficiency_total", "efficiency_magnetic"):
        np.testing.assert_allclose(np.std(drawn[name], axis=0), stated[name], rtol=0.12)


def grid_with_u(grid: Grid) -> Grid:
    return replace(grid, u_sun=np.full(len(grid), 1e-3), u_ring=np.full(len(grid), 1e-3))


def test_bisquare_weights_find_what_least_squares_finds_without_noise(bench: BenchParameters) -> None:
    grid = simulated(bench)
    fits = fit_losses(grid, CURVE.powers, CURVE.powers)
    for method in DampingMethod:
        fit = fit_damping(grid, fits, MODEL.correction, method)
        assert fit.c == pytest.approx(MODEL.c, rel=1e-6)
        assert fit.on_bound in (("d",), ())
        assert fit.dof == len(fit.speed) - 3 + len(fit.on_bound)
    plain, exact = (calibrate(grid_with_u(grid), fits, bench, method=method) for method in DampingMethod)
    assert exact.model.c == pytest.approx(MODEL.c, rel=1e-6)
    assert exact.standard_error("c") == plain.standard_error("c") != 0.0


def test_one_bad_speed_moves_the_constants_by_least_squares_and_not_by_bisquare(
    bench: BenchParameters, rng: np.random.Generator
) -> None:
    grid = simulated(bench)
    fits = fit_losses(grid, CURVE.powers, CURVE.powers)
    fast = np.sort(np.unique(np.round(np.abs(grid.points.speed_sun[grid.points.engaged]))))[-2]
    bad = grid.points.engaged & (np.round(np.abs(grid.points.speed_sun)) == fast)
    sun = grid.torque_sun + 1e-4 * rng.standard_normal(len(grid)) + np.where(bad, 0.01, 0.0)
    plain, robust = (fit_damping(replace(grid, torque_sun=sun), fits, MODEL.correction, m) for m in DampingMethod)
    assert abs(robust.c - MODEL.c) < 0.3 * abs(plain.c - MODEL.c)
    assert list(np.flatnonzero(robust.weights == 0.0)) == [len(robust.speed) - 2]
    assert (plain.weights == 1.0).all()
    assert robust.rmse < 0.5 * plain.rmse


def test_outliers_move_the_calibration_by_bisquare_less(bench: BenchParameters, rng: np.random.Generator) -> None:
    grid = simulated(bench)
    n, off = len(grid), dict.fromkeys(DampingMethod, 0.0)
    for _ in range(4):
        hit = rng.random(n) < 0.05
        sun = grid.torque_sun + 1e-3 * rng.standard_normal(n) + np.where(hit, 0.03, 0.0)
        ring = grid.torque_ring + 1e-3 * rng.standard_normal(n)
        bad = replace(grid, torque_sun=sun, torque_ring=ring, u_sun=np.full(n, 1e-3), u_ring=np.full(n, 1e-3))
        fits = fit_losses(bad, CURVE.powers, CURVE.powers)
        for method in DampingMethod:
            found = calibrate(bad, fits, bench, correction=MODEL.correction, method=method)
            off[method] += abs(found.model.c - MODEL.c)
            assert found.left_out == (hit.sum() if method is DampingMethod.BISQUARE else 0)
    assert off[DampingMethod.BISQUARE] < 0.5 * off[DampingMethod.LEAST_SQUARES]


def test_weights_of_an_unknown_name_are_refused() -> None:
    with pytest.raises(FitError, match="--damping: 'bisqare'; expected least-squares or bisquare"):
        chosen_options(published=False, damping="bisqare")
