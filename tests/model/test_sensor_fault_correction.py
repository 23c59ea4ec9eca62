"""Losses without a fault of a reading: what stands behind a faulty transducer is found again."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.points import points

from pmg.pipeline.chapters.measured.sensor_fault import highest_loss
from pmg.pipeline.model.sensor_fault_correction import _torques_behind
from pmg.sim.mechanisms.base import Instrument, Torques
from pmg.sim.mechanisms.instruments import Crosstalk, GainError, ZeroOffset, distorted
from pmg.sim.signals import LOSS_TOTAL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.sim.signals import Array

SMALL = st.floats(-0.05, 0.05)


def readings(faults: Sequence[Instrument], sun: Array, ring: Array) -> Torques:
    at = points("engaged", np.linspace(200, 1800, len(sun)), -np.linspace(80, 700, len(sun)), ring)
    wrong = distorted(tuple(faults), at, Torques(sun, ring))
    return Torques(sun + wrong[0], ring + wrong[1])


@given(SMALL, SMALL, SMALL, SMALL)
def test_the_torque_behind_a_faulty_reading_is_found_again(
    gain: float, other: float, zero: float, cross: float
) -> None:
    sun, ring = np.linspace(0.3, 1.2, 9), np.linspace(0.5, 2.5, 9)
    faults = (GainError(gain_sun=gain, gain_ring=other), ZeroOffset(offset_sun=zero), Crosstalk(part_ring=cross))
    shown = readings(faults, sun, ring)
    at = points("engaged", np.linspace(200, 1800, 9), -np.linspace(80, 700, 9), shown.ring)
    found = _torques_behind(faults, at, shown.sun, shown.ring)
    assert np.allclose(found[0], sun, atol=1e-6)
    assert np.allclose(found[1], ring, atol=1e-6)


def test_a_reading_without_faults_stays_as_it_is() -> None:
    at = points("engaged", [500.0], [-192.0], 1.0)
    sun, ring = _torques_behind((), at, np.array([0.5]), np.array([1.0]))
    assert (sun.tolist(), ring.tolist()) == ([0.5], [1.0])


@pytest.mark.parametrize(
    ("off", "told"), [(0.3, "12.3 ± 2.0 W without a fault"), (0.1, "a possible fault would change it by at most 0.1 W")]
)
def test_a_loss_without_a_fault_is_told_where_the_fault_moves_it(off: float, told: str) -> None:
    balance: Any = SimpleNamespace(
        values={LOSS_TOTAL.name: np.array([3.0, 12.0])},
        u=lambda _: np.array([1.0, 1.0]),
        grid=SimpleNamespace(points=SimpleNamespace(name=("low", "high"))),
    )
    values, spread = {LOSS_TOTAL.name: np.array([3.0, 12.0 + off])}, {LOSS_TOTAL.name: np.zeros(2)}
    fault: Any = SimpleNamespace(values=values, spread=spread, description="a fault", doubtful=True)
    assert highest_loss((fault,), balance).startswith("Total loss at high (U = 2u): 12.0 ± 2.0 W as read; ")
    assert told in highest_loss((fault,), balance)
    fault.spread = {LOSS_TOTAL.name: np.array([0.0, 3.0])}
    assert "without a fault" in highest_loss((fault,), balance), "by how much it moves it is not known"
