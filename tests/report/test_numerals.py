"""Numbers as people read them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.wording.numerals import measured, number


@pytest.mark.parametrize(
    ("value", "u", "text"),
    [
        (0.97384, 0.00113, "0.9738 ± 0.0011"),
        (12.3456, 0.0996, "12.35 ± 0.10"),
        (-1.5, 0.25, "−1.50 ± 0.25"),
        (1234.5, 340.0, "1230 ± 340"),
        (1.0, 340.0, "0 ± 340"),
        (-0.0004, 0.01, "0.000 ± 0.010"),
        (1.2344e-9, 1.2e-11, "(1.234 ± 0.012)×10⁻⁹"),
        (2.5e9, 1.1e7, "(2.500 ± 0.011)×10⁹"),
        (5.0, 0.0, "5 ± 0"),
        (5.0, math.inf, "5 ± ∞"),
        (math.nan, 0.1, "–"),
    ],
)
def test_a_value_gets_the_digits_its_uncertainty_deserves(value: float, u: float, text: str) -> None:
    assert measured(value, u) == text


@pytest.mark.parametrize(
    ("value", "digits", "spec", "text"),
    [
        (-3.14159, 2, "", "−3.14"),
        (-0.001, 2, "", "0.00"),
        (1234567.0, None, "", "1.235×10⁶"),
        (0.00001234, None, ".2g", "1.2×10⁻⁵"),
        (math.inf, 2, "", "∞"),
        (-math.inf, None, "", "−∞"),
        (math.nan, 1, "", "–"),
    ],
)
def test_a_number_is_written_with_proper_signs(value: float, digits: int | None, spec: str, text: str) -> None:
    assert number(value, digits, spec) == text


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e5))
def test_what_is_shown_lies_within_a_twentieth_of_the_uncertainty(value: float, u: float) -> None:
    shown, shown_u = (float(part.replace("−", "-")) for part in measured(value, u).split(" ± "))
    assert abs(shown - value) <= 0.0501 * u
    assert shown_u == pytest.approx(u, rel=0.0501)


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(5e-324, 1.7e308))
def test_any_two_numbers_can_be_shown(value: float, u: float) -> None:
    assert " ± " in measured(value, u)
