"""Temperature rise of the bench at each point of its history."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.mechanisms.base import Warmth
from pmg.sim.mechanisms.thermal import LubricantViscosity, MagnetTemperature, WarmingInTwoSteps
from pmg.sim.mechanisms.warmed import WarmingBearings

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.sim.grid import OperatingPoints
    from pmg.sim.mechanisms import Mechanism


WARMING = (LubricantViscosity, WarmingInTwoSteps, MagnetTemperature)
"""Mechanisms whose warmth is held over a run in time."""


def begin_warm(mechanisms: Iterable[Mechanism]) -> Warmth:
    """Warmth at the begin of a run: what the start parameters of the mechanisms say."""
    warmth = Warmth()
    for mechanism in mechanisms:
        if isinstance(mechanism, LubricantViscosity | WarmingInTwoSteps):
            warmth = warmth._replace(sun=mechanism.start_sun, ring=mechanism.start_ring)
    return warmth


def warmth_at(mechanisms: Iterable[Mechanism], at: OperatingPoints) -> tuple[Warmth, ...]:
    """Warmth at each point, from the run history that the points hold; settled where their order is not known."""
    none = np.zeros(len(at))
    sun, ring, magnets = none, none, none
    for mechanism in mechanisms:
        if isinstance(mechanism, WarmingBearings):
            sun, ring = mechanism.rises(at)
        elif isinstance(mechanism, MagnetTemperature):
            magnets = mechanism.rise(at)
    return tuple(Warmth(*map(float, row)) for row in zip(sun, ring, magnets, strict=True))
