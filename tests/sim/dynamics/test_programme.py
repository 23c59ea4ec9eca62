from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.sim.dynamics.programme import Programme
from pmg.sim.errors import BenchError


def test_a_ramp_rises_straight_and_stays() -> None:
    ramp = Programme.ramp(2.0, 4.0, begin=1.0, start=1.0)
    np.testing.assert_allclose(ramp.value(np.array([0.0, 1.0, 3.0, 5.0, 9.0])), [1.0, 1.0, 1.5, 2.0, 2.0])
    np.testing.assert_allclose(ramp.slope(np.array([0.0, 1.0, 3.0, 5.0, 9.0])), [0.0, 0.25, 0.25, 0.0, 0.0])


def test_a_step_takes_its_rise_time() -> None:
    step = Programme.step(1.5, 2.0, rise=0.01)
    np.testing.assert_allclose(step.value(np.array([2.0, 2.005, 2.01])), [0.0, 0.75, 1.5])


def test_a_held_torque_has_no_slope() -> None:
    assert Programme.hold(0.7).value(12.0) == 0.7
    assert Programme.hold(0.7).slope(0.0) == 0.0


@given(st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=9), st.floats(0.0, 1.0))
def test_the_slope_is_the_derivative_of_the_torque(torques: list[float], where: float) -> None:
    signal = Programme.sampled(np.arange(len(torques), dtype=float), np.array(torques))
    time = (len(torques) - 1) * where
    room = np.floor(time) + 1.0 - time
    later = signal.value(time + 0.5 * room)
    assert later == pytest.approx(signal.value(time) + 0.5 * room * signal.slope(time), abs=1e-9)


@pytest.mark.parametrize(
    ("times", "torques", "told"),
    [
        ([0.0, 1.0], [1.0], "one value for each time"),
        ([0.0, np.nan], [1.0, 2.0], "a hole at knot 1"),
        ([0.0, 1.0, 1.0], [1.0, 2.0, 3.0], "knot 2 at 1 s after knot 1 at 1 s"),
        ([], [], "one value for each time"),
    ],
)
def test_a_signal_that_is_none_is_refused(times: list[float], torques: list[float], told: str) -> None:
    with pytest.raises(BenchError, match=told):
        Programme.sampled(np.array(times), np.array(torques))
