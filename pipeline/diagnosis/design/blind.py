"""Designs that cannot tell a slow change from a loss curve."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.fit.noise_floor import repeat_contrasts
from pmg.pipeline.fit.structure import families

if TYPE_CHECKING:
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array

ORDER_IS_SPEED = 0.95
"""Rank correlation of speed and order from which on a slow change cannot be distinguished from a loss curve."""


def confounded_shafts(readings: Readings) -> tuple[str, ...]:
    """Shafts whose neutral points were run in the order of their speed, in a campaign without a repeated point.

    Rank correlation of speed and order of at least `ORDER_IS_SPEED`: what changes with time then looks like what
    changes with speed, and no repeat tells them apart.
    """
    at = readings.grid.points
    again = repeat_contrasts(readings)[readings.configuration != "zero"]
    if not at.ordered or again.any():
        return ()
    found = []
    for shaft, mine in readings.of_shaft.items():
        rows = mine & (readings.configuration == "neutral")
        speed, time = np.abs(readings.speed_own[rows]), at.started_at[readings.row[rows]]
        if len(np.unique(speed)) > 2 and abs(stats.spearmanr(np.round(speed), time).statistic) >= ORDER_IS_SPEED:
            found.append(shaft)
    return tuple(found)


SLOW = ("order", "run_history")
"""Covariates of what changes slowly."""


def slow_changes(readings: Readings, bench: BenchParameters, model: LossModel, shafts: tuple[str, ...]) -> Array:
    """Every slow change of the readings of these shafts (m, k), as columns [N m per unit].

    Where the design is blind to them, nothing is claimed that one of them could have made.
    """
    signals = {f"torque_{shaft}" for shaft in shafts}
    chosen = [
        family.columns
        for family in families(readings, bench, model)
        if family.signal in signals and set(family.covariates) & set(SLOW)
    ]
    return np.hstack(chosen) if chosen else np.zeros((len(readings), 0))
