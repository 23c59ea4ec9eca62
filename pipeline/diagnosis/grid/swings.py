"""Swings of a reading in time: one narrow family for each period that the campaign is long enough to show."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.structure import ResidualStructure
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.grid.readings import Readings

SLOWEST = 3
"""Periods in the campaign of the slowest swing; slower ones are trends."""

FASTEST = 36
"""Periods in the campaign of the fastest swing, as far as each holds `POINTS` points."""

POINTS = 4
"""Points in the shortest period."""


def swings(readings: Readings) -> tuple[ResidualStructure, ...]:
    """Sine and cosine of the time of the test, period by period and shaft by shaft; none where it is not known.

    A room's heating, a supply or an amplifier that cycles moves a reading this way whatever the bench does. Each
    period is looked at by itself: together they would leave nothing to tell the noise by.
    """
    at = readings.grid.points
    if not at.ordered:
        return ()
    time = np.asarray(at.started_at[readings.row])
    whole = float(np.ptp(time))
    if whole <= 0.0:
        return ()
    turns = (time - time.min()) / whole
    found = []
    for shaft, mine in readings.of_shaft.items():
        fastest = min(FASTEST, int(mine.sum()) // POINTS)
        for k in range(SLOWEST, fastest + 1):
            angle = REVOLUTION * k * turns
            columns = np.where(mine[:, None], np.c_[np.cos(angle), np.sin(angle)], 0.0)
            found.append(ResidualStructure(f"torque_{shaft}", "all", ("order", f"period_{whole / k:.0f}_s"), columns))
    return tuple(found)
