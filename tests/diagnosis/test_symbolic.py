"""Short forms: planted ones are found and predict, noise gives none, and the text says what was computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy.parsing.sympy_parser import parse_expr

from pmg.pipeline.diagnosis.form.atoms import ATOMS, FormCovariate, levels
from pmg.pipeline.diagnosis.form.grammar import Form, forms, text_of
from pmg.pipeline.diagnosis.form.problem import Problem, placebo_errors, withheld_errors
from pmg.pipeline.diagnosis.form.search import View, make_library
from pmg.pipeline.diagnosis.form.shape import LABEL, Shape
from pmg.pipeline.diagnosis.form.symbolic import _hold_up
from pmg.pipeline.diagnosis.grid.withheld import STRUCTURE_FOLDS
from pmg.pipeline.fit.whitening import Whitener
from pmg.sim.signals import Array

NOISE = 1e-3
BLOCKS = 40


def covariates(rng: np.random.Generator, n: int = 160) -> tuple[FormCovariate, ...]:
    """Speed on twelve set-points, nearly met; load on four; time."""
    speed = rng.choice(np.linspace(16.0, 196.0, 12), n) + rng.normal(0.0, 0.05, n)
    load = rng.choice([0.78, 1.17, 1.56, 1.95], n) + rng.normal(0.0, 0.01, n)
    time = np.cumsum(rng.uniform(20.0, 60.0, n))
    return (
        FormCovariate("speed_sun", "ω_s", "rad/s", "speed of the sun", speed),
        FormCovariate("load", "T_r", "N m", "ring torque", load),
        FormCovariate("order", "t", "s", "time since the first point", time),
    )


def problem(effect: Array, known: tuple[FormCovariate, ...], rng: np.random.Generator, smooth: int = 0) -> Problem:
    """A location among as many other readings, a baseline of constant, root and square of speed over both."""
    n = len(effect)
    points = np.linspace(16.0, 196.0, 12)
    here = known[0].values if known[0].name == "speed_sun" else rng.choice(points, n)
    speed = np.r_[here, rng.choice(points, n)]
    left = np.r_[effect, np.zeros(n)] + 0.01 + 2e-4 * speed + NOISE * rng.standard_normal(2 * n)
    block = np.tile((np.arange(n) * BLOCKS) // n, 2)
    scaled = 2.0 * (np.sqrt(speed) - 4.0) / 10.0 - 1.0
    columns = np.polynomial.legendre.legvander(scaled, 6)[:, 1 : 1 + smooth]
    columns[n:] = 0.0
    return Problem(
        left=left,
        baseline=np.c_[np.ones(2 * n), np.sqrt(speed), speed, speed**2],
        white=Whitener(np.full(2 * n, NOISE), ()),
        rows=np.arange(n),
        sign=np.ones(n),
        covariates=known,
        smooth=columns,
        block=block,
        fold=block % STRUCTURE_FOLDS,
    )


def value(shape: Shape) -> Array:
    """What the printed formula gives at the readings of the location."""
    symbols = {c.symbol: sympy.Symbol(c.symbol) for c in shape.covariates}
    call = sympy.lambdify(list(symbols.values()), parse_expr(shape.formula, symbols), "numpy")
    return np.broadcast_to(call(*(c.values for c in shape.covariates)), len(shape.rows))


PLANTED: dict[str, tuple[Callable[[Array, Array, Array], Array], set[str]]] = {
    "product": (lambda w, T, t: 2.4e-5 * w**1.5 * np.exp(-w / 60.0), {"speed_sun"}),
    "two covariates": (lambda w, T, t: 2e-5 * w * T**2, {"speed_sun", "load"}),
    "swing": (lambda w, T, t: 4e-3 * np.sin(2.0 * np.pi * t / 830.0 + 0.4), {"order"}),
    "late": (lambda w, T, t: np.asarray(np.where(t > 3100.0, 4e-3, 0.0)), {"order"}),
}


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_form_is_found_and_predicts_what_it_has_not_seen(name: str, rng: np.random.Generator) -> None:
    effect, truth = PLANTED[name]
    known = covariates(rng)
    planted = effect(*(c.values for c in known))
    shape = _hold_up(problem(planted, known, rng), rng)
    assert shape is not None
    assert {c.name for c in shape.covariates} == truth
    assert shape.label == LABEL
    assert shape.held_out.gain_interval[0] > 0.0
    assert shape.held_out.rmse_after < 1.3 * NOISE < shape.held_out.rmse_before
    assert shape.held_out.placebo_gain is not None
    assert shape.held_out.placebo_gain < 0.25 * (shape.held_out.rmse_before - shape.held_out.rmse_after)
    assert shape.alike >= STRUCTURE_FOLDS // 2
    # against the truth, with what the baseline may take taken out of both
    basis = np.linalg.qr(problem(planted, known, rng).baseline[: len(planted)])[0]
    apart = value(shape) - planted
    assert np.sqrt(np.mean((apart - basis @ (basis.T @ apart)) ** 2)) < 0.6 * NOISE


def test_constants_of_a_planted_form_lie_within_their_errors(rng: np.random.Generator) -> None:
    pulls = []
    for _ in range(5):
        known = covariates(rng, 100)[2:]
        planted = 5e-3 * np.sin(2.0 * np.pi * known[0].values / 530.0)
        shape = _hold_up(problem(planted, known, rng), rng)
        assert shape is not None
        assert "cos(2π·t/P1)" in shape.text
        a, b, period = shape.constants
        assert a.standard_error is not None
        assert b.standard_error is not None
        assert period.standard_error is not None
        pulls += [(period.value - 530.0) / period.standard_error, a.value / a.standard_error]
    assert np.sqrt(np.mean(np.square(pulls))) < 1.7


def test_noise_has_no_form(rng: np.random.Generator) -> None:
    """40 campaigns of noise: at most two (5 %) may give a form."""
    found = 0
    for _ in range(40):
        known = covariates(rng, 80)[:2]
        found += _hold_up(problem(np.zeros(80), known, rng), rng) is not None
    assert found <= 2


def test_what_follows_no_covariate_has_no_form(rng: np.random.Generator) -> None:
    """Scatter beyond the noise floor makes forms seem worth their constants: the withheld readings say no."""
    found = 0
    for _ in range(8):
        known = covariates(rng, 80)[:2]
        found += _hold_up(problem(4.0 * NOISE * rng.standard_normal(80), known, rng), rng) is not None
    assert found <= 1


def test_a_form_that_smooth_columns_beat_by_far_is_not_told(rng: np.random.Generator) -> None:
    """A curve with many turns in speed: columns to the sixth degree follow it, no short form does."""
    known = covariates(rng)[:1]
    scaled = 2.0 * (np.sqrt(known[0].values) - 4.0) / 10.0 - 1.0
    planted = np.polynomial.legendre.legvander(scaled, 6)[:, 3:] @ np.array([4e-3, -6e-3, 5e-3, -6e-3])
    given_ = problem(planted, known, rng, smooth=6)
    shape = _hold_up(given_, np.random.default_rng(1))
    if shape is not None:
        gained = shape.held_out.rmse_before**2 - shape.held_out.rmse_after**2
        assert gained >= 0.5 * (shape.held_out.rmse_before**2 - shape.rmse_smooth**2)
    unsmooth = _hold_up(replace(given_, smooth=given_.smooth[:, :0]), np.random.default_rng(1))
    assert unsmooth is not None
    assert np.isnan(unsmooth.rmse_smooth)


def test_exchanged_covariates_gain_nothing_even_of_a_large_effect(rng: np.random.Generator) -> None:
    known = covariates(rng)
    posed = problem(0.02 * np.exp(-known[0].values / 40.0) * known[1].values, known, rng)
    rows = posed.rows
    errors = (withheld_errors(posed, None), *placebo_errors(posed, rng))
    before, constant, placebo = (np.sqrt(np.mean(e[rows] ** 2)) for e in errors)
    assert before > 2.0 * NOISE
    assert placebo > 0.97 * constant


def test_the_same_readings_give_the_same_form(rng: np.random.Generator) -> None:
    known = covariates(rng)
    known = known[:2]
    posed = problem(1e-4 * known[0].values * known[1].values, known, rng)
    first, again = (_hold_up(posed, np.random.default_rng(3)) for _ in range(2))
    assert first is not None
    assert again is not None
    assert first.formula == again.formula
    assert first.held_out == again.held_out


def everything() -> tuple[Form, ...]:
    x = np.linspace(1.0, 9.0, 40)
    return forms(
        (
            FormCovariate("speed_difference", "Δω", "rad/s", "", x - 4.3, signed=True),
            FormCovariate("load", "T_r", "N m", "", x[::-1] / 4.0),
        )
    )


FORMS = everything()


@given(
    form=st.sampled_from(FORMS),
    linear=st.lists(st.floats(-5.0, 5.0).filter(lambda v: abs(v) > 1e-6), min_size=2, max_size=2),
    nonlinear=st.lists(st.floats(0.3, 8.0), min_size=2, max_size=2),
)
@settings(max_examples=150)
def test_the_formula_read_by_sympy_gives_the_values_computed(
    form: Form, linear: list[float], nonlinear: list[float]
) -> None:
    size, constants = np.array(linear[: form.linear]), np.array(nonlinear[: form.nonlinear])
    computed = form.columns(constants[None, :])[:, 0] @ size
    formula = form.formula([repr(v) for v in (*size.tolist(), *constants.tolist())])
    symbols = {c.symbol: sympy.Symbol(c.symbol, real=True) for _, c in form.factors}
    expression = parse_expr(formula, symbols)
    rows = np.array([0, 7, 20, 39])
    for row in rows:
        at = {symbols[c.symbol]: c.values[row] for _, c in form.factors}
        assert float(expression.subs(at)) == pytest.approx(computed[row], rel=1e-9, abs=1e-12)
    assert len(form.symbols) == len(form.units) == form.linear + form.nonlinear
    assert "*" not in text_of(form.formula())


def test_every_factor_is_tried_and_no_form_twice() -> None:
    names = [form.name for form in FORMS]
    assert len(set(names)) == len(names)
    assert all(any(atom.name in name for name in names) for atom in ATOMS)
    assert all(form.nonlinear <= 2 for form in FORMS)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_gains_are_those_of_least_squares_with_the_baseline_free(seed: int) -> None:
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.standard_normal((60, 5)))[0]
    y, columns = rng.standard_normal(60), rng.standard_normal((60, 3, 2))
    view = View(np.ones(60), basis, y - basis @ (basis.T @ y))
    for linear in (1, 2):
        gains = view.gains(columns[:, :, :linear])
        for j in range(3):
            whole = np.c_[basis, columns[:, j, :linear]]
            rest = y - whole @ np.linalg.lstsq(whole, y, rcond=None)[0]
            assert gains[j] == pytest.approx(view.left @ view.left - rest @ rest, rel=1e-8, abs=1e-10)


def test_a_column_that_the_baseline_absorbs_gains_nothing(rng: np.random.Generator) -> None:
    x = np.linspace(1.0, 2.0, 50)
    basis = np.linalg.qr(np.c_[np.ones(50), x])[0]
    view = View(np.ones(50), basis, rng.standard_normal(50))
    assert view.gains(x[:, None, None])[0] == 0.0


@given(st.integers(2, 20), st.integers(0, 2**32 - 1))
def test_set_points_nearly_met_are_one_level_each(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(1.0, 3.0, count))
    x = np.repeat(points, 5) + rng.uniform(-2e-3, 2e-3, 5 * count)
    assert levels(rng.permutation(x)) == pytest.approx(points, abs=3e-3)


def test_a_longer_library_costs_more(rng: np.random.Generator) -> None:
    known = covariates(rng)
    small, large = make_library(known[:1]), make_library(known)
    simple, bent = (next(f for f in small.forms if f.name.startswith(n)) for n in ("power 1 ", "decay"))
    assert small.cost(simple, 100) < large.cost(simple, 100)
    assert large.cost(simple, 100) < large.cost(bent, 100)
