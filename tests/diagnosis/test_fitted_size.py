"""The size of a named mechanism in motion as one number, and what its law adds to its uncertainty."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.diagnosis.balance.fitting import Tabled, TermFit, TermProblem, fit_term
from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm, amount, signed, stack, term
from pmg.pipeline.diagnosis.motion.fitted_size import FittedSize, error_of_law, fitted_size
from pmg.sim.mechanisms.base import Component
from pmg.sim.shafts import PerShaft

POLES = PerShaft(3, 10)


def _term(identifier: str, variant: str, *sizes: str, signs: bool = False) -> MotionTerm:
    amplitudes = signed(*sizes, unit="N m", most=100.0) if signs else sum((amount(s, "N m", 100.0) for s in sizes), ())
    return term(
        identifier,
        identifier,
        "x",
        amplitudes,
        lambda *_: stack(np.zeros(1)),
        component=Component("magnetic_gear"),
        shaft="both",
        variant=variant,
    )


def _fit(law: MotionTerm, values: list[float]) -> TermFit:
    return TermFit(law, 1.0, 1.0, np.zeros(4), (), np.array(values), math.nan)


@given(st.floats(-2.9, 2.9), st.lists(st.floats(-0.5, 0.5), min_size=4, max_size=4))
def test_the_error_of_a_wave_is_that_of_its_amplitude(phase: float, mixed: list[float]) -> None:
    factor = 1e-3 * np.reshape(mixed, (2, 2))
    values = np.array([math.cos(phase), math.sin(phase)])
    size = fitted_size(_fit(_term("w", "", "cosine", "sine", signs=True), [*values]), values, factor @ factor.T, POLES)
    assert size.value == pytest.approx(1.0)
    moved = np.hypot(*(values[:, None] + factor)) - 1.0  # what each independent error moves the amplitude by
    assert size.error == pytest.approx(float(np.linalg.norm(moved)), abs=2e-6)


@given(st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9), st.floats(0.0, 1.0))
def test_the_error_of_a_sum_knows_that_its_parts_hang_together(mixed: list[float], of_law: float) -> None:
    """Of what moves one part up and another down, the sum knows nothing."""
    factor = np.reshape(mixed, (3, 3))
    values = np.array([1.0, 2.0, 3.0])
    size = fitted_size(_fit(_term("h", "", "a", "b", "c"), [*values]), values, factor @ factor.T, POLES, of_law)
    assert size.value == pytest.approx(6.0)
    assert size.error == pytest.approx(math.hypot(float(np.linalg.norm(factor.sum(axis=0))), of_law), abs=1e-7)
    assert size.name == "in all"


def _problem(columns: dict[str, np.ndarray], terms: dict[str, MotionTerm], left: np.ndarray) -> TermProblem:
    tables = {law.key: Tabled(law, np.array([math.nan]), columns[name][:, None, None]) for name, law in terms.items()}
    by_key = {law.key: columns[name][:, None] for name, law in terms.items()}
    return TermProblem(np.zeros((len(left), 0)), left, lambda law, _: by_key[law.key], tables)


def test_a_size_that_depends_on_the_law_is_known_no_better_than_that() -> None:
    """Two laws of one mechanism explain nearly the same with other sizes; a third explains little."""
    rows = np.eye(20)
    columns = {
        "one": rows[:, 0],
        "two": 0.74 * rows[:, 0] + 0.1 * rows[:, 1],
        "far": 0.1 * rows[:, 0] + rows[:, 2],
        "beside": rows[:, 5],
    }
    terms = {name: _term("gear_hysteresis", name, "drag") for name in ("one", "two", "far")}
    terms["beside"] = _term("other", "", "more")
    problem = _problem(columns, terms, 3.0 * rows[:, 0] + 7.0 * rows[:, 5])
    named = (fit_term(problem, terms["beside"]), fit_term(problem, terms["one"]))
    other = 3.0 * 0.74 / (0.74**2 + 0.1**2)
    assert error_of_law(problem, named, 1) == pytest.approx(other - 3.0)
    assert error_of_law(problem, named, 0) == 0.0
    fewer = {key: table for key, table in problem.tables.items() if table.term is not terms["two"]}
    assert error_of_law(replace(problem, tables=fewer), named, 1) == 0.0
    special = {**terms, "two": replace(terms["two"], within="one")}
    assert error_of_law(_problem(columns, special, problem.left), named, 1) == 0.0


def test_a_size_of_either_sign_or_on_each_shaft_is_no_sum() -> None:
    values, errors = np.array([1.0, 4.0]), np.diag([1.0, 1.0])
    for law in (_term("t", "", "sun", "ring"), _term("t", "", "constant", "rate", signs=True)):
        size = fitted_size(_fit(law, [*values]), values, errors, POLES)
        assert (size.value, size.error, size.name) == (4.0, 1.0, law.amplitudes[1].name)


def test_people_read_what_of_an_error_is_the_law() -> None:
    size = FittedSize("in all", 3.45e-3, 5e-4, "N m", of_law=4e-4)
    shares = "the form of the law, not known, makes 0.4 of the error, noise 0.3"
    assert size.sentence == f"Fitted: in all 3.45 ± 0.50 mN m; {shares}."
    rotors = "10.4 ± 1.5 mN m on the sun rotor, 34.5 ± 5.0 mN m on the ring rotor"
    told = replace(size, poles=POLES).sentence
    assert told == f"Fitted: in all 3.45 ± 0.50 mN m on the pole angle ({rotors}); {shares}."
    assert FittedSize("", 0.02, 0.001, "kg m2", remark=" more than in the data sheet").sentence.endswith(
        "kg m2 more than in the data sheet."
    )
