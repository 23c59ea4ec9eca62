from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.points import measured, points

from pmg.pipeline.fit import fit_losses
from pmg.sim.errors import FitError

SUN, RING = (axis.ravel() for axis in np.meshgrid(np.linspace(-1800.0, 1800.0, 13), np.linspace(0.0, 720.0, 7)))


def torques(coefficients: tuple[float, float, float], rpm: np.ndarray, top: float) -> np.ndarray:
    x = np.abs(rpm) / top
    return np.asarray(np.sign(rpm) * (coefficients[0] + coefficients[1] * np.sqrt(x) + coefficients[2] * x))


@given(st.tuples(st.floats(0.0, 0.1), st.floats(-0.1, 0.3), st.floats(-0.1, 0.3)))
def test_a_curve_of_the_chosen_terms_is_found_exactly(truth: tuple[float, float, float]) -> None:
    at = points("neutral", SUN, RING)
    grid = measured(at, torques(truth, SUN, 1872.0), torques(truth, RING, 720.0))
    fits = fit_losses(grid, (0.0, 0.5, 1.0), (0.0, 0.5, 1.0))
    np.testing.assert_allclose(fits.sun.curve.coefficients, truth, atol=1e-10)
    np.testing.assert_allclose(fits.ring.curve.coefficients, truth, atol=1e-10)


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
    with pytest.raises(FitError, match="9 neutral points at 1 speeds"):
        fit_losses(measured(at, np.ones(9), np.ones(9)))
