"""Terms chosen by the data: closed forms against the long way, planted terms found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.points import measured, points

from pmg.pipeline.fit.loss_fit import ShaftDrag, fit_losses, shaft_drags
from pmg.pipeline.fit.options import AnalysisOptions, chosen_options
from pmg.pipeline.fit.term_choice import NEEDED, _candidates, choose_terms
from pmg.sim.errors import FitError
from pmg.sim.losscurve import SPEED_REFERENCE_SUN, LossCurve
from pmg.sim.signals import Array

SPEEDS = np.repeat(np.linspace(120.0, 1872.0, 14), 6)


def drag(powers: tuple[float, ...], coefficients: tuple[float, ...], noise: Array | float = 0.0) -> ShaftDrag:
    at = points("neutral", SPEEDS, np.full(len(SPEEDS), 100.0))
    limit = float(at.speed_sun.max())
    clean = LossCurve(powers, np.array(coefficients), SPEED_REFERENCE_SUN, limit).torque(at.speed_sun)
    return shaft_drags(measured(at, clean + noise, np.ones(len(at)))).sun


def test_candidates_hold_a_term_that_rises_no_faster_than_speed() -> None:
    every = _candidates()
    assert len(every) == len(set(every)) == 104
    assert all(set(powers) & set(NEEDED) and 1 <= len(powers) <= 5 for powers in every)


@pytest.mark.parametrize(
    ("powers", "coefficients"),
    [((0.0,), (0.03,)), ((0.0, 1.0), (0.02, 0.1)), ((0.5, 2.0), (0.1, 0.08)), ((0.0, 0.5, 3.0), (0.02, 0.1, 0.1))],
)
def test_terms_without_noise_are_found_exactly(powers: tuple[float, ...], coefficients: tuple[float, ...]) -> None:
    assert choose_terms(drag(powers, coefficients)).powers == powers


def test_planted_terms_are_found_or_outdone_only_by_few(rng: np.random.Generator) -> None:
    powers = (0.0, 0.5, 3.0)
    exact, among = 0, 0
    for _ in range(40):
        choice = choose_terms(drag(powers, (0.02, 0.15, 0.15), 2e-4 * rng.standard_normal(len(SPEEDS))))
        exact += choice.powers == powers
        among += set(powers) <= set(choice.powers)
        best = next(rank for rank in choice.ranking if rank.powers == powers)
        assert best.weight > 1e-4
    assert exact >= 20
    assert among >= 30


def test_errors_at_withheld_speeds_are_those_of_fits_without_them(rng: np.random.Generator) -> None:
    reading = drag((0.0, 1.0), (0.02, 0.1), 1e-3 * rng.standard_normal(len(SPEEDS)))
    choice = choose_terms(reading)
    rank = next(rank for rank in choice.ranking if rank.powers == (0.0, 0.5, 2.0))
    curve = LossCurve(rank.powers, np.zeros(3), reading.reference, float(reading.speed.max()))
    terms, squares = curve.terms(reading.speed), []
    for level in np.unique(reading.levels):
        out = reading.levels == level
        coefficients, *_ = np.linalg.lstsq(terms[~out], reading.drag[~out], rcond=None)
        squares.append(float(np.mean((reading.drag[out] - terms[out] @ coefficients) ** 2)))
    mean = float(np.mean(squares))
    assert rank.cv_rmse == pytest.approx(np.sqrt(mean), rel=1e-6)
    assert rank.cv_se == pytest.approx(np.std(squares, ddof=1) / np.sqrt(14.0) / (2.0 * np.sqrt(mean)), rel=1e-6)


def test_aicc_is_that_of_the_fit_and_weights_sum_to_one(rng: np.random.Generator) -> None:
    at = points("neutral", SPEEDS, SPEEDS / 3.0)
    grid = measured(at, 0.1 + 1e-3 * rng.standard_normal(len(at)), 0.1 + 1e-3 * rng.standard_normal(len(at)))
    choice = choose_terms(shaft_drags(grid).sun)
    rank = next(rank for rank in choice.ranking if rank.powers == (0.0, 1.0, 2.0))
    assert rank.aicc == pytest.approx(fit_losses(grid, (0.0, 1.0, 2.0), (0.0,)).sun.aicc)
    assert sum(rank.weight for rank in choice.ranking) == pytest.approx(1.0)
    assert choice.ranking[0].eligible


def test_an_outlier_does_not_choose_the_terms_of_a_robust_fit(rng: np.random.Generator) -> None:
    reading = drag((0.0, 1.0), (0.02, 0.1), 2e-4 * rng.standard_normal(len(SPEEDS)))
    bad = reading.drag.copy()
    bad[:3] += 0.05
    robust = choose_terms(replace(reading, drag=bad), robust=True)
    clean = choose_terms(reading, robust=True)
    best, other = robust.ranking[0], choose_terms(replace(reading, drag=bad)).ranking[0]
    assert best.cv_rmse < 0.5 * other.cv_rmse
    assert clean.ranking[0].cv_rmse < 5e-4


def test_three_speeds_are_too_few() -> None:
    at = points("neutral", np.repeat([300.0, 600.0, 900.0], 9), np.full(27, 100.0))
    with pytest.raises(FitError, match="at least 4 speeds"):
        choose_terms(shaft_drags(measured(at, np.ones(27), np.ones(27))).sun)


def test_the_choice_travels_with_the_options() -> None:
    options = chosen_options(published=False, terms_sun="auto", robust=True)
    assert options.auto_sun
    assert not options.auto_ring
    assert AnalysisOptions.from_document(options.document()) == options
    older = {k: v for k, v in AnalysisOptions().document().items() if k not in ("auto_sun", "auto_ring", "robust")}
    assert AnalysisOptions.from_document(older) == AnalysisOptions()
