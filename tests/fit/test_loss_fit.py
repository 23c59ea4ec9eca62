from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import stats
from tests.points import measured, points

from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.correction import CorrectionStudy
from pmg.pipeline.fit.loss_fit import fit_losses, point_weights
from pmg.pipeline.fit.options import THESIS_OPTIONS
from pmg.pipeline.grid.tables import read_published
from pmg.sim.bench import BenchParameters
from pmg.sim.errors import FitError
from pmg.sim.grid import OperatingPoints
from pmg.sim.signals import Array

SUN, RING = (axis.ravel() for axis in np.meshgrid(np.linspace(-1800.0, 1800.0, 13), np.linspace(0.0, 720.0, 7)))


def torques(coefficients: tuple[float, float, float], rpm: np.ndarray, top: float) -> np.ndarray:
    x = np.abs(rpm) / top
    return np.asarray(np.sign(rpm) * (coefficients[0] + coefficients[1] * np.sqrt(x) + coefficients[2] * x))


@given(st.tuples(st.floats(0.0, 0.1), st.floats(-0.1, 0.3), st.floats(-0.1, 0.3)))
@example((1e-146, 0.0, 0.0))
@example((2e-146, 0.0, 0.0))
def test_a_curve_of_the_chosen_terms_is_found_exactly(truth: tuple[float, float, float]) -> None:
    at = points("neutral", SUN, RING)
    grid = measured(at, torques(truth, SUN, 1872.0), torques(truth, RING, 720.0))
    fits = fit_losses(grid, (0.0, 0.5, 1.0), (0.0, 0.5, 1.0))
    np.testing.assert_allclose(fits.sun.curve.coefficients, truth, atol=1e-10)
    np.testing.assert_allclose(fits.ring.curve.coefficients, truth, atol=1e-10)


@pytest.mark.parametrize("scale", [1e-147, 1e-162, 1e-250, 1e3])
def test_akaikes_criterion_follows_the_unit_of_the_torques(scale: float, rng: np.random.Generator) -> None:
    at = points("neutral", SUN, RING)
    sun, ring = (torque + 1e-3 * rng.standard_normal(len(at)) for torque in (SUN * 1e-4, RING * 1e-4))
    plain, other = (fit_losses(measured(at, sun * by, ring * by)).sun for by in (1.0, scale))
    assert other.aicc == pytest.approx(plain.aicc + 2.0 * len(plain.residuals) * np.log(scale), rel=1e-6)


def test_standard_errors_cover_the_truth_at_the_stated_rate(rng: np.random.Generator) -> None:
    at, truth = points("neutral", SUN, RING), (0.02, 0.1, 0.05)
    clean = torques(truth, SUN, 1872.0), torques(truth, RING, 720.0)
    inside = 0
    for _ in range(400):
        sun, ring = (torque + 1e-3 * rng.standard_normal(len(at)) for torque in clean)
        fit = fit_losses(measured(at, sun, ring), (0.0, 0.5, 1.0), (0.0, 0.5, 1.0)).sun
        inside += abs(fit.curve.coefficients[1] - truth[1]) < 1.992 * fit.standard_errors[1]
    assert 0.925 < inside / 400 < 0.975


def test_readings_of_a_resting_shaft_are_left_out_unless_asked_for() -> None:
    at = points("neutral", SUN, RING)
    assert (
        fit_losses(measured(at, 0.1 * np.sign(SUN), 0.1 * np.ones(len(at))), (0.0,), (0.0,)).ring.rows.sum()
        == (RING > 0).sum()
    )
    whole = fit_losses(measured(at, 0.1 * np.sign(SUN), 0.1 * np.ones(len(at))), (0.0,), (0.0,), include_rest=True)
    assert whole.ring.rows.all()


@pytest.mark.parametrize("powers", [(), (1.0, 1.0), (-1.0,), (float("nan"),)])
def test_impossible_terms_are_refused(powers: tuple[float, ...]) -> None:
    at = points("neutral", SUN, RING)
    with pytest.raises(FitError, match="exponents"):
        fit_losses(measured(at, 0.1 * np.sign(SUN), 0.1 * np.ones(len(at))), powers, (0.0,))


def test_too_few_speeds_are_named() -> None:
    at = points("neutral", [600.0] * 9, [100.0] * 9)
    with pytest.raises(FitError, match="9 neutral points at 1 speed; expected at least 6 points at 4 speeds or more"):
        fit_losses(measured(at, np.ones(9), np.ones(9)))


def spread(at: OperatingPoints, rng: np.random.Generator, scale: Array | float = 1e-3) -> tuple[Array, Array]:
    truth = (0.02, 0.1, 0.05)
    return (
        torques(truth, SUN, 1872.0) + scale * rng.standard_normal(len(at)),
        torques(truth, RING, 720.0) + scale * rng.standard_normal(len(at)),
    )


@pytest.mark.parametrize("robust", [False, True])
def test_intervals_at_95_percent_cover_the_truth(robust: bool, rng: np.random.Generator) -> None:
    at, truth = points("neutral", SUN, RING), np.array((0.02, 0.1, 0.05))
    inside = np.zeros(3)
    for _ in range(500):
        fit = fit_losses(measured(at, *spread(at, rng)), (0.0, 0.5, 1.0), (0.0, 0.5, 1.0), robust=robust).sun
        reach = stats.t.ppf(0.975, fit.dof) * fit.standard_errors
        inside += np.abs(fit.curve.coefficients - truth) < reach
    assert (inside >= 0.93 * 500).all()
    assert (inside <= 0.97 * 500).all()


def test_weighted_intervals_cover_where_points_differ(rng: np.random.Generator) -> None:
    at, truth = points("neutral", SUN, RING), np.array((0.02, 0.1, 0.05))
    u = np.where(np.arange(len(at)) % 3 == 0, 5e-3, 5e-4)
    inside, narrower = np.zeros(3), 0
    for _ in range(500):
        grid = measured(at, *spread(at, rng, u))
        grid = replace(grid, u_sun=u, u_ring=u)
        fit = fit_losses(grid, (0.0, 0.5, 1.0), (0.0, 0.5, 1.0), weights=point_weights(grid)).sun
        plain = fit_losses(grid, (0.0, 0.5, 1.0), (0.0, 0.5, 1.0)).sun
        inside += np.abs(fit.curve.coefficients - truth) < stats.t.ppf(0.975, fit.dof) * fit.standard_errors
        narrower += fit.standard_errors[1] < plain.standard_errors[1]
        assert fit.weighted
    assert (inside >= 0.93 * 500).all()
    assert (inside <= 0.97 * 500).all()
    assert narrower == 500


def test_equal_points_have_no_weights_and_equal_weights_change_nothing(rng: np.random.Generator) -> None:
    at = points("neutral", SUN, RING)
    grid = measured(at, *spread(at, rng))
    assert point_weights(grid) is None
    plain = fit_losses(grid)
    same = fit_losses(grid, weights=(np.full(len(at), 7.0), np.full(len(at), 7.0)))
    np.testing.assert_allclose(same.sun.curve.coefficients, plain.sun.curve.coefficients, rtol=1e-9)
    assert same.ring.rmse == pytest.approx(plain.ring.rmse)
    assert not same.sun.weighted
    with pytest.raises(FitError, match="positive"):
        fit_losses(grid, weights=(np.zeros(len(at)), np.ones(len(at))))


def test_five_percent_of_outliers_hardly_move_a_robust_curve(rng: np.random.Generator) -> None:
    at = points("neutral", SUN, RING)
    bare: list[float] = []
    robust: list[float] = []
    for _ in range(50):
        sun, ring = spread(at, rng)
        hit = rng.choice(np.flatnonzero(SUN != 0.0), round(0.05 * len(at)), replace=False)
        sun[hit] += np.sign(SUN[hit]) * 0.05
        clean = torques((0.02, 0.1, 0.05), SUN, 1872.0)
        grid = measured(at, sun, ring)
        for fits, out in ((fit_losses(grid), bare), (fit_losses(grid, robust=True), robust)):
            rows = fits.sun.rows
            error = fits.sun.curve.torque(at.speed_sun[rows]) - np.abs(clean[rows])
            out.append(float(np.sqrt(np.mean(error**2))))
            if fits.sun.robust:
                assert fits.sun.down_weighted >= len(hit)
                assert np.isnan(fits.sun.aicc)
    assert np.mean(robust) < 5e-4
    assert np.mean(robust) < 0.25 * np.mean(bare)


def test_a_curve_without_scatter_is_its_own_robust_fit() -> None:
    at = points("neutral", SUN, RING)
    grid = measured(at, torques((0.02, 0.1, 0.05), SUN, 1872.0), torques((0.02, 0.1, 0.05), RING, 720.0))
    fit = fit_losses(grid, (0.0, 0.5, 1.0), (0.0, 0.5, 1.0), robust=True).sun
    np.testing.assert_allclose(fit.curve.coefficients, (0.02, 0.1, 0.05), atol=1e-9)


def test_the_thesis_error_is_the_root_of_the_sum_of_squares_over_n(rng: np.random.Generator) -> None:
    at = points("neutral", SUN, RING)
    fit = fit_losses(measured(at, *spread(at, rng))).sun
    assert fit.error_thesis == pytest.approx(np.linalg.norm(fit.residuals) / len(fit.residuals))


def test_published_points_determine_k_corr_and_c_only_together(bench: BenchParameters, published_folder: Path) -> None:
    analysis = analyse(read_published(published_folder, bench), THESIS_OPTIONS, bench)
    study = analysis.study
    assert isinstance(study, CorrectionStudy)
    assert not study.separate
    assert "only together" in study.sentence
    assert [fit.negative > 0 for fit in analysis.damping[:4]] == [fit.smallest < 0.0 for fit in analysis.damping[:4]]
    outline = study.ellipse()
    assert outline is not None
    c, k = outline
    reach = np.sqrt(stats.chi2.ppf(0.95, 2))
    error = study.standard_error("c")
    assert error is not None
    assert np.ptp(c) == pytest.approx(2.0 * reach * error, rel=1e-3)
    assert np.ptp(k) == pytest.approx(2.0 * reach * (study.standard_error("K_corr") or 0.0), rel=1e-3)
    covariance = np.array([[np.var(c), np.mean((c - c.mean()) * (k - k.mean()))], [0.0, np.var(k)]])
    rho = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert rho == pytest.approx(study.correlation("K_corr", "c") or 0.0, abs=0.01)


def test_a_constant_on_its_bound_is_told_in_words_and_draws_no_ellipse(
    bench: BenchParameters, published_folder: Path
) -> None:
    study = analyse(read_published(published_folder, bench), THESIS_OPTIONS, bench).study
    assert isinstance(study, CorrectionStudy)
    assert study.bounds_in_words == ()
    stuck = replace(study, joint=replace(study.joint, on_bound=("c",)))
    assert stuck.ellipse() is None
    assert stuck.correlation("K_corr", "c") is None
    assert "c sits on its bound" in stuck.sentence
    assert stuck.bounds_in_words[0].startswith("c sits on its lower bound of 0")
