"""Levels of speed and load that the points of a grid were run at."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.shafts import SIDES
from pmg.sim.signals import SPEED_RING, SPEED_SUN

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.grid import Grid, OperatingPoints
    from pmg.sim.signals import Array, Mask

APART_RPM = 2.0
"""Gap between speeds beyond which they are two levels: a bench meets a speed it is asked for only nearly."""

WIDEST_RPM = 5.0
"""Spread of the speeds of one level; a row of neighbours that reaches further is a row of levels."""

REVERSED = "reversed flow"
"""Name of the engaged series in which the ring drives."""


def speed_levels(at: OperatingPoints) -> tuple[Array, Array]:
    """Levels of the sun's and the ring's speed that the points were run at [rpm], whole numbers."""
    return _joined(SPEED_SUN.display(at.speed_sun)), _joined(SPEED_RING.display(at.speed_ring))


def _joined(speed_rpm: Array) -> Array:
    """The rounded mean of those that lie together, in place of each; each by itself where they make a long row."""
    order = np.argsort(speed_rpm, kind="stable")
    levels = np.round(speed_rpm)
    for heap in np.split(order, np.flatnonzero(np.diff(speed_rpm[order]) > APART_RPM) + 1):
        if len(heap) and np.ptp(speed_rpm[heap]) <= WIDEST_RPM:
            levels[heap] = np.round(speed_rpm[heap].mean())
    return np.asarray(levels + 0.0)


def forward_neutral(grid: Grid) -> Mask:
    """Accepted neutral points with neither shaft reversed."""
    sun, ring = speed_levels(grid.points)
    return np.asarray(grid.points.neutral & grid.accepted & (sun >= 0) & (ring >= 0))


def by_load(at: OperatingPoints) -> list[tuple[str, Mask]]:
    """Engaged points by the load asked for, reversed flow after forward flow."""
    series = []
    for drive in SIDES:
        rows = at.engaged & (at.drive == drive)
        for load in np.unique(np.round(np.abs(at.load_set[rows]), 3)):
            name = f"{load:g} N m" + ("" if drive == "sun" else f", {REVERSED}")
            series.append((name, np.asarray(rows & (np.round(np.abs(at.load_set), 3) == load))))
    return series


def by_speed(at: OperatingPoints) -> npt.NDArray[np.int64]:
    """Rows for a table: by configuration, sun speed, ring speed and load."""
    sun, ring = speed_levels(at)
    return np.lexsort((np.round(at.load_set, 3), ring, sun, at.configuration))
