from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pmg.sim.losscurve import LossCurve

QUARTIC = LossCurve((0.0, 1.0, 2.0, 3.0, 4.0), np.array([0.024, 0.48, -0.64, 0.55, -0.18]), 196.0, 196.0)


@given(st.floats(0.0, 1000.0))
def test_the_curve_does_not_know_the_direction(speed: float) -> None:
    assert QUARTIC.torque(np.array([speed])) == QUARTIC.torque(np.array([-speed]))


def test_inside_its_range_it_is_the_polynomial() -> None:
    x = np.linspace(0.0, 1.0, 11)
    expected = np.polynomial.polynomial.polyval(x, QUARTIC.coefficients)
    np.testing.assert_allclose(QUARTIC.torque(x * 196.0), expected, rtol=1e-12)


def test_beyond_its_range_it_goes_on_along_the_tangent() -> None:
    step = 1e-3
    slope = float(np.diff(QUARTIC.torque(np.array([196.0 - step, 196.0])))[0]) / step
    far = QUARTIC.torque(np.array([196.0, 296.0, 396.0]))
    np.testing.assert_allclose(np.diff(far), 100.0 * slope, rtol=1e-4)
