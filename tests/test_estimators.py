"""The statistics against the same figures by another way: refits, quadrature, other libraries, exact laws."""

from __future__ import annotations

import math
import statistics
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy import integrate, stats

from pmg.pipeline.diagnosis.engine.scan import look_elsewhere
from pmg.pipeline.diagnosis.residuals.fitted import Fitted, outliers
from pmg.pipeline.fit.calibration import calibrate, jacobian
from pmg.pipeline.fit.drift import find_drift
from pmg.pipeline.fit.loss_fit import fit_losses
from pmg.pipeline.fit.noise import NO_GROWTH, Growth
from pmg.pipeline.fit.noise_floor import repeat_contrasts
from pmg.pipeline.fit.robust import HUBER, huber_weights, sandwich
from pmg.pipeline.fit.whitening import Chain, relative_scale
from pmg.pipeline.grid.contributions import Contribution, ShaftBudget
from pmg.pipeline.grid.readings import Readings, predict, take_readings
from pmg.pipeline.grid.transducer_uncertainty import tare_uncertainty
from pmg.pipeline.orders.fit import Orders
from pmg.pipeline.recording.checks.clock import _fit_clock
from pmg.pipeline.recording.layouts.wire import ClockMark
from pmg.pipeline.windows.reduce import mean_uncertainty
from pmg.pipeline.windows.revolutions import WholeRevolutions
from pmg.sim.bench import BenchParameters
from pmg.sim.grid import Grid
from pmg.sim.losscurve import SPEED_REFERENCE_RING, SPEED_REFERENCE_SUN, LossCurve
from pmg.sim.lossmodel import LossModel
from pmg.sim.shafts import PerShaft
from pmg.sim.signals import HOUR, Array
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import steady
from tests.orders.rows import row_of
from tests.points import joined, measured, points

# --- the mean of a window ------------------------------------------------------------------------------------


def test_the_mean_of_batches_is_as_uncertain_as_their_sample_variance_says(rng: np.random.Generator) -> None:
    """Two turns: too few for whole revolutions, too many for finer pieces, so that ten batches in time tell."""
    levels = rng.standard_normal(10)
    torque = np.repeat(levels, 50)
    turned = WholeRevolutions(torque, np.linspace(0.0, 2.0, len(torque) + 1))
    within, dof, method, _ = mean_uncertainty(turned, turned.batches(), 500.0)
    assert method == "batches"
    assert dof == 9
    assert within == pytest.approx(statistics.stdev(levels.tolist()) / math.sqrt(10.0), rel=1e-12)


def test_zeros_that_are_not_subtracted_stay_in_every_reading() -> None:
    zeros = np.array([3.0, 5.0, np.nan, 4.0, 8.0])
    known = [3.0, 5.0, 4.0, 8.0]
    wanted = math.hypot(statistics.mean(known), statistics.stdev(known) / 2.0)
    assert tare_uncertainty(zeros) == pytest.approx((wanted, 3), rel=1e-12)
    assert tare_uncertainty(zeros[:1]) == (0.0, 0)


# --- order and repeats ---------------------------------------------------------------------------------------


def up_and_down(rng: np.random.Generator) -> Grid:
    """Seven speeds of the sun rising, then the same ones falling; the ring stays."""
    rpm = np.array([150.0, 300.0, 520.0, 800.0, 1100.0, 1500.0, 1800.0])
    sun = np.r_[rpm, 1850.0, rpm[::-1]]
    started = np.asarray(1.7e9 + np.cumsum(rng.uniform(30.0, 90.0, len(sun))), dtype=np.float64)
    at = points("neutral", sun, np.full(len(sun), 200.0), started_at=started)
    return measured(at, 0.05 + 1e-3 * rng.standard_normal(len(sun)), 0.1 + 1e-3 * rng.standard_normal(len(sun)))


def test_a_trend_over_speed_is_that_of_a_linear_regression(rng: np.random.Generator, bench: BenchParameters) -> None:
    (order,) = find_drift(up_and_down(rng), bench).orders
    line = stats.linregress(order.speed, order.difference)
    assert len(order.difference) == 7
    assert (order.slope, order.slope_u) == pytest.approx((line.slope, line.stderr), rel=1e-9)
    assert order.slope_p == pytest.approx(line.pvalue, rel=1e-9)


def test_a_mean_difference_has_the_t_test_of_its_sample(rng: np.random.Generator, bench: BenchParameters) -> None:
    (order,) = find_drift(up_and_down(rng), bench).orders
    assert order.mean_u == pytest.approx(stats.sem(order.difference), rel=1e-12)
    assert order.mean_p == pytest.approx(stats.ttest_1samp(order.difference, 0.0).pvalue, rel=1e-9)


def test_a_drift_of_repeats_is_a_regression_with_a_constant_for_each_point(
    rng: np.random.Generator, bench: BenchParameters
) -> None:
    grid = up_and_down(rng)
    sun = next(repeat for repeat in find_drift(grid, bench).repeats if repeat.shaft == "sun")
    rpm, time = np.round(grid.points.speed_sun), grid.points.started_at - grid.points.started_at.min()
    constants = (rpm[:, None] == np.unique(rpm)).astype(float)
    design = np.c_[constants, time]
    found, (square,), rank, _ = np.linalg.lstsq(design, grid.torque_sun, rcond=None)
    dof = len(grid) - rank
    scatter = math.sqrt(square / dof)
    error = scatter * math.sqrt(np.linalg.inv(design.T @ design)[-1, -1])
    assert sun.dof == dof == 7 - 1
    assert (sun.slope, sun.scatter) == pytest.approx((found[-1], scatter), rel=1e-8)
    assert sun.slope_u == pytest.approx(error, rel=1e-6)
    assert sun.p == pytest.approx(2.0 * stats.t.sf(abs(found[-1] / error), dof), rel=1e-5)
    assert sun.hours == pytest.approx(float(np.ptp(time[rpm < 193.0])) / HOUR)


def test_contrasts_of_repeats_are_orthonormal_and_blind_to_the_level(
    rng: np.random.Generator, bench: BenchParameters
) -> None:
    at = points("neutral", [300.0] * 5 + [600.0] * 3 + [900.0], [100.0] * 9)
    readings = take_readings(measured(at, rng.standard_normal(9), rng.standard_normal(9)), bench)
    found = repeat_contrasts(readings)
    assert found.shape == (18, 2 * (4 + 2))
    np.testing.assert_allclose(found.T @ found, np.eye(12), atol=1e-12)
    np.testing.assert_allclose(found.T @ np.abs(readings.speed_own), 0.0, atol=1e-9)
    # the sum of squares of repeats about their means, by the textbook
    y = readings.torque
    groups = [y[:5], y[5:8], y[9:14], y[14:17]]
    pure = sum(float(np.sum((group - group.mean()) ** 2)) for group in groups)
    assert float(np.sum((found.T @ y) ** 2)) == pytest.approx(pure, rel=1e-12)


# --- the sample clock ----------------------------------------------------------------------------------------


def test_the_drift_of_the_clock_has_the_error_of_a_linear_regression(rng: np.random.Generator) -> None:
    rate, sample = 500.0, np.arange(0, 5000, 500)
    late = 150e-6 * sample / rate + 2e-6 * rng.standard_normal(len(sample))
    start = datetime(2025, 1, 1, tzinfo=UTC)
    marks = [
        ClockMark(
            0, int(s), round((start + timedelta(seconds=s / rate)).timestamp() * 1e6) * 1000 + round(x * 1e9), 0.0, ""
        )
        for s, x in zip(sample, late, strict=True)
    ]
    fit = _fit_clock(marks, rate)
    line = stats.linregress(sample / rate, np.round(late * 1e9) * 1e-9)
    assert not fit.jumps
    assert fit.drift == pytest.approx(-line.slope / (1.0 + line.slope), rel=1e-4)
    assert fit.u_drift == pytest.approx(line.stderr, rel=1e-3)


# --- robust curves -------------------------------------------------------------------------------------------


def test_a_residual_of_the_size_that_its_leverage_leaves_gives_the_plain_covariance(rng: np.random.Generator) -> None:
    """HC2 is exact where every squared residual is the variance times what the fit leaves of it."""
    design = np.c_[np.ones(9), np.linspace(0.0, 1.0, 9) ** 6]
    inverse = np.linalg.inv(design.T @ design)
    leverage = np.diag(design @ inverse @ design.T)
    assert leverage.max() > 0.7
    sign = rng.choice([-1.0, 1.0], 9)
    found = sandwich(design, 0.02 * sign * np.sqrt(1.0 - leverage), scale=1.0)
    np.testing.assert_allclose(found, 0.02**2 * inverse, rtol=1e-9)


def test_readings_far_out_count_in_the_covariance_with_the_clipped_residual_only(rng: np.random.Generator) -> None:
    design = np.c_[np.ones(12), np.arange(12.0)]
    left = rng.uniform(-1.0, 1.0, 12)
    left[[3, 10]] = 50.0, -70.0
    inside = np.abs(left) <= HUBER
    bread = np.linalg.inv(design[inside].T @ design[inside])
    meat = np.zeros((2, 2))
    for x, r, within in zip(design, left, inside, strict=True):
        part = r**2 / (1.0 - x @ bread @ x) if within else HUBER**2
        meat += part * np.outer(x, x)
    np.testing.assert_allclose(sandwich(design, left, scale=1.0), bread @ meat @ bread, rtol=1e-9)


def test_the_robust_scale_is_the_standard_deviation_of_normal_noise(rng: np.random.Generator) -> None:
    y = 3.0 + 0.2 * rng.standard_normal(20_000)
    factors, scale = huber_weights(np.ones((len(y), 1)), y, np.ones(len(y)))
    assert scale == pytest.approx(0.2, rel=0.03)
    far = np.abs(y - 3.0) > 0.2 * HUBER
    assert (factors < 1.0).mean() == pytest.approx(2.0 * stats.norm.sf(HUBER), abs=0.01)
    assert factors[far] == pytest.approx(HUBER * 0.2 / np.abs(y[far] - 3.0), rel=0.05)


def neutral_grid(rng: np.random.Generator) -> Grid:
    sun = np.linspace(100.0, 1800.0, 14)
    ring = np.linspace(60.0, 700.0, 14)
    noise = 2e-3 * rng.standard_normal((2, 14))
    return measured(points("neutral", sun, ring), 0.03 + 5e-5 * sun + noise[0], 0.05 + 1e-4 * ring + noise[1])


def test_a_loss_curve_has_the_errors_and_the_criterion_of_a_linear_regression(rng: np.random.Generator) -> None:
    grid = neutral_grid(rng)
    fit = fit_losses(grid, (0.0, 1.0), (0.0, 1.0)).sun
    line = stats.linregress(grid.points.speed_sun / SPEED_REFERENCE_SUN, grid.torque_sun)
    assert fit.curve.coefficients == pytest.approx([line.intercept, line.slope], rel=1e-9)
    assert fit.standard_errors == pytest.approx([line.intercept_stderr, line.stderr], rel=1e-9)
    assert fit.r_squared == pytest.approx(line.rvalue**2, rel=1e-9)
    square, n, k = float(fit.residuals @ fit.residuals), 14, 2
    assert fit.rmse == pytest.approx(math.sqrt(square / (n - k)), rel=1e-12)
    assert fit.error_thesis == pytest.approx(math.sqrt(square) / n, rel=1e-12)
    # two coefficients and the variance are estimated
    plain = n * math.log(square / n) + 2.0 * 3.0
    assert fit.aicc == pytest.approx(plain + 2.0 * 3.0 * 4.0 / (n - 3 - 1), rel=1e-12)


# --- a parameter on its bound --------------------------------------------------------------------------------


def test_a_constant_on_its_bound_has_the_second_moment_of_what_it_may_still_be(
    rng: np.random.Generator, bench: BenchParameters
) -> None:
    """By quadrature over the normal distribution of the free fit, cut off at the bound."""
    rpm = np.linspace(150.0, 1800.0, 10)
    at = joined(
        points("neutral", rpm, np.linspace(60.0, 700.0, 10)),
        points("engaged", np.repeat(rpm, 2), -np.repeat(rpm, 2) / bench.gear1.ratio, np.tile([0.8, 1.9], 10)),
    )
    u, free = 1e-3, ("K_corr", "b", "c")
    sun = LossCurve((0.0, 2.0), np.array([0.03, 0.08]), SPEED_REFERENCE_SUN, 200.0)
    ring = LossCurve((0.0, 2.0), np.array([0.05, 0.06]), SPEED_REFERENCE_RING, 80.0)
    true = steady(Gearbox.calibrated(bench, LossModel(sun, ring, 0.8, 0.0, 2e-4, 0.0)), at)
    less = np.where(at.engaged, 2e-3, 0.0)
    noise = u * rng.standard_normal((2, len(at)))
    grid = measured(at, true.torque_sun - less + noise[0], true.torque_ring + np.where(at.engaged, 0.0, noise[1]), u)
    found = calibrate(grid, fit_losses(grid, (0.0, 2.0), (0.0, 2.0)), bench, free=free)
    assert found.on_bound == ("b",)
    readings = take_readings(grid, bench)
    slopes = jacobian(readings, bench, found.model, free) / readings.u[:, None]
    left = (readings.torque - predict(readings, bench, found.model)) / readings.u
    covariance = np.linalg.pinv(slopes.T @ slopes, rcond=1e-12, hermitian=True)
    step, b = covariance @ (slopes.T @ left), found.names.index("b")
    free_fit = stats.norm(step[b], math.sqrt(covariance[b, b]))
    assert free_fit.mean() < 0.0
    reach = 12.0 * free_fit.std()
    mass, moment = (
        integrate.quad(lambda x, p=p: x**p * free_fit.pdf(x) / free_fit.sf(0.0), 0.0, reach, epsabs=0.0)[0]
        for p in (0, 2)
    )
    assert mass == pytest.approx(1.0, rel=1e-6)
    assert found.moments[b, b] == pytest.approx(moment, rel=1e-4)
    # the others share it along their regression on the bounded one
    inside = [i for i in range(len(found.names)) if i != b]
    held = slopes[:, inside]
    conditional = np.linalg.pinv(held.T @ held, rcond=1e-12, hermitian=True)
    lever = covariance[inside, b] / covariance[b, b]
    np.testing.assert_allclose(
        found.moments[np.ix_(inside, inside)], conditional + np.outer(lever, lever) * moment, rtol=1e-3
    )
    assert np.isnan(found.covariance[b]).all()


# --- lines ---------------------------------------------------------------------------------------------------


def orders_of(size: complex, u: float, band: float) -> Orders:
    one = np.array([[1.0]])
    return Orders((), size * one, u * one, 30.0 * one, band * one, np.zeros((1, 4)))


def test_the_phase_is_as_uncertain_as_the_length_without_its_noise_lets_it_be() -> None:
    """The squared length of a line with noise is that of the line and twice the variance of either part."""
    found = row_of(orders_of(3.0 + 4.0j, 1.0, 2.0), 0)
    assert found.u_phase == pytest.approx(1.0 / math.sqrt(5.0**2 - 2.0))
    assert found.phase == pytest.approx(math.atan2(4.0, 3.0))
    within = row_of(orders_of(3.0 + 4.0j, 1.0, 6.0), 0)
    assert math.isnan(within.u_phase)
    assert math.isnan(within.phase)


def test_noise_lengthens_a_line_by_what_is_taken_off(rng: np.random.Generator) -> None:
    """So the uncertainty comes out as that of the true length, on average of the squares."""
    drawn = 3.0 + rng.standard_normal(40_000) + 1j * rng.standard_normal(40_000)
    ones = np.ones((1, len(drawn)))
    found = Orders((), drawn[None], ones, 30.0 * ones, 0.0 * ones + 1.6, np.zeros((1, 4)))
    some = np.flatnonzero(found.beyond[0])[:500]
    lengths = np.array([row_of(found, place).u_phase for place in some]) ** -2.0
    np.testing.assert_allclose(lengths, np.abs(drawn[some]) ** 2 - 2.0, rtol=1e-9)
    assert (np.abs(drawn) ** 2 - 2.0).mean() == pytest.approx(9.0, rel=0.02)


def test_an_interval_of_an_amplitude_reaches_as_far_as_student_says() -> None:
    low, high = orders_of(5.0, 1.0, 2.0).interval
    reach = stats.t.ppf(0.975, 30.0)
    assert (low[0, 0], high[0, 0]) == pytest.approx((5.0 - reach, 5.0 + reach))
    assert orders_of(1.0, 1.0, 2.0).interval[0][0, 0] == 0.0


# --- points that lie out -------------------------------------------------------------------------------------


def a_line_of(bench: BenchParameters, torque: Array) -> Fitted:
    """A straight line through the sun's readings at speeds of which the last stands alone."""
    rpm = np.r_[np.linspace(100.0, 400.0, len(torque) - 1), 1200.0]
    at = points("neutral", rpm, np.zeros(len(rpm)))
    readings: Readings = take_readings(measured(at, torque, np.zeros(len(rpm))), bench)
    design = np.c_[np.ones(len(rpm)), at.speed_sun]
    residual = torque - design @ np.linalg.lstsq(design, torque, rcond=None)[0]
    return Fitted("curves", readings, design, residual, np.ones(len(rpm)))


@pytest.mark.parametrize("row", [0, 5, 11])
def test_a_point_stands_out_by_what_a_fit_without_it_says(
    row: int, rng: np.random.Generator, bench: BenchParameters
) -> None:
    """Also one whose leverage leaves it little room: without it the others miss it by as much as they do."""
    torque = 1e-3 * rng.standard_normal(12)
    torque[row] += 0.2
    fit = a_line_of(bench, torque)
    (found,) = outliers(fit, "sun")
    others = np.arange(12) != row
    design, y = fit.design[others], torque[others]
    line, (square,), _, _ = np.linalg.lstsq(design, y, rcond=None)
    x = fit.design[row]
    spread = math.sqrt(square / (11 - 2) * (1.0 + x @ np.linalg.inv(design.T @ design) @ x))
    surprise = (torque[row] - x @ line) / spread
    assert found.row == row
    assert found.surprise == pytest.approx(surprise, rel=1e-6)
    assert found.looked_at == 12
    assert math.log(found.p_value) == pytest.approx(math.log(12 * 2.0 * stats.t.sf(abs(surprise), 9)), abs=1e-3)


def test_a_search_is_paid_for_by_the_synthetic_campaigns_that_show_as_much() -> None:
    smallest = np.array([0.001, 0.01, 0.02, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9])
    assert look_elsewhere(0.01, smallest) == pytest.approx(3.0 / 10.0)
    assert look_elsewhere(1e-9, smallest) == pytest.approx(1.0 / 10.0)


# --- correlated noise ----------------------------------------------------------------------------------------


def test_a_chain_makes_noise_of_its_correlation_white(rng: np.random.Generator) -> None:
    rho, lag = 0.6, np.array([1.0, 3.0, 1.0, 2.0, 1.0])
    place = np.r_[0.0, np.cumsum(lag)]
    chain = Chain(np.arange(6), lag)
    covariance = rho ** np.abs(place[:, None] - place)
    news = chain.whiten(np.eye(6), rho)
    np.testing.assert_allclose(news @ covariance @ news.T, np.eye(6), atol=1e-12)
    np.testing.assert_allclose(chain.colour(chain.whiten(np.eye(6), rho), rho), np.eye(6), atol=1e-12)
    assert chain.log_determinant(rho) == pytest.approx(np.linalg.slogdet(covariance)[1])


def test_growing_noise_keeps_its_mean_square(rng: np.random.Generator) -> None:
    speed = rng.uniform(0.0, 190.0, 40)
    fastest = float(speed.max())
    growth = Growth(rng.dirichlet(np.ones(6)), fastest, float(np.mean((speed / fastest) ** 2)))
    assert float(np.mean(growth.variance(speed))) == pytest.approx(1.0, rel=1e-12)
    assert (np.diff(growth.variance(np.sort(speed))) > 0.0).all()
    assert NO_GROWTH.variance(speed) == pytest.approx(np.ones(40))


def test_engaged_the_noise_of_the_input_comes_through_the_ratio(bench: BenchParameters) -> None:
    at = joined(points("neutral", [900.0], [300.0]), points("engaged", [900.0], [-900.0 / 2.6], 1.5))
    grid = measured(at, np.zeros(2), np.zeros(2))
    grid = replace(grid, u_sun=np.array([3e-3, 3e-3]), u_ring=np.array([4e-3, 4e-3]))
    readings = take_readings(grid, bench)
    through = math.hypot(3e-3, 4e-3 / bench.gear1.ratio)
    assert readings.u == pytest.approx([3e-3, through, 4e-3])
    assert relative_scale(readings, bench, PerShaft(3e-3, 4e-3)) == pytest.approx([3e-3, through, 4e-3])


# --- an uncertainty budget -----------------------------------------------------------------------------------


def part(
    key: str, value: float, dof: float, *, common: bool, signed: bool = True, divisor: float = 1.0
) -> Contribution:
    two = np.ones(2)
    return Contribution(key, key, "A", "t", common, divisor, value * two, dof * two, "", signed)


def test_a_budget_adds_in_squares_and_its_degrees_of_freedom_are_those_of_welch_and_satterthwaite() -> None:
    budget = ShaftBudget(
        "sun",
        np.array([1.0, -1.0]),
        (
            part("scatter", 3e-3, 9.0, common=False),
            part("gain", 4e-3 * math.sqrt(3.0), math.inf, common=True, divisor=math.sqrt(3.0)),
            part("tare", 2e-3, math.nan, common=True, signed=False),
        ),
    )
    assert budget.independent == pytest.approx([3e-3] * 2)
    assert budget.common == pytest.approx([math.hypot(4e-3, 2e-3)] * 2)
    assert budget.u == pytest.approx([math.sqrt(29.0) * 1e-3] * 2)
    dof = 29.0**2 / (3.0**4 / 9.0 + 2.0**4 / 1.0)
    assert budget.dof == pytest.approx([dof] * 2)
    assert budget.factor == pytest.approx([stats.t.ppf(0.975, dof)] * 2)
    assert budget.expanded == pytest.approx([stats.t.ppf(0.975, dof) * math.sqrt(29.0) * 1e-3] * 2)
    own, shared = budget.of_mean(np.array([True, True]))
    assert own == pytest.approx(3e-3 / math.sqrt(2.0))
    assert shared == pytest.approx(2e-3)  # the gain of +1 and -1 N m cancels, the tare does not
