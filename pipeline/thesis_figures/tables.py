"""Printed tables that the measured grids do not hold: the simulated points, the sizes of the bearings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from pmg.pipeline.grid.tables import ROUNDING_PUBLISHED
from pmg.sim.errors import GridError
from pmg.sim.signals import RPM, SPEED_SUN

if TYPE_CHECKING:
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

SPEEDS = 156.0 * RPM * np.arange(1, 13)
"""Sun speeds of the engaged tests [rad/s] (table 4.2)."""

LOADS = np.array([0.78, 1.17, 1.56, 1.95])
"""Ring torques asked for [N m] (table 4.2)."""

NEUTRAL_POINTS = 16 * 13
"""Points of the neutral grid (table 4.1)."""

TORQUE_SUN = np.array(
    (
        (0.3722, 0.4050, 0.4320, 0.4550, 0.4739, 0.4930, 0.5103, 0.5232, 0.5386, 0.5549, 0.5705, 0.5875),
        (0.5027, 0.5352, 0.5623, 0.5846, 0.6040, 0.6220, 0.6402, 0.6536, 0.6687, 0.6845, 0.6999, 0.7165),
        (0.6320, 0.6650, 0.6922, 0.7143, 0.7338, 0.7510, 0.7684, 0.7841, 0.7981, 0.8138, 0.8290, 0.8455),
        (0.7614, 0.7944, 0.8214, 0.8435, 0.8627, 0.8797, 0.8962, 0.9117, 0.9268, 0.9424, 0.9574, 0.9738),
    )
)
"""Sun torques of the simulated tests [N m] (tables 6.2 and 6.3), one row a load, one column a speed."""

TORQUE_RING = np.array(
    (
        (0.8121, 0.8219, 0.8314, 0.8414, 0.8477, 0.8600, 0.8707, 0.8717, 0.8800, 0.8911, 0.9019, 0.9179),
        (1.1509, 1.1606, 1.1704, 1.1782, 1.1860, 1.1952, 1.2083, 1.2105, 1.2181, 1.2283, 1.2384, 1.2535),
        (1.4873, 1.4983, 1.5080, 1.5155, 1.5232, 1.5307, 1.5415, 1.5500, 1.5547, 1.5645, 1.5742, 1.5887),
        (1.8233, 1.8344, 1.8437, 1.8510, 1.8586, 1.8654, 1.8739, 1.8818, 1.8894, 1.8989, 1.9080, 1.9223),
    )
)
"""Ring torques that these tests were given [N m]: the measured ones, with more digits than table A.5 has."""

TWICE_RING = {(2, 7): 1.57}
"""Where table A.5 prints another ring torque than these tests were given, by row and column, with what it prints."""

DIAMETERS_SUN = np.array([0.032, 0.047, 0.024])
"""Diameters of the bearings 1 to 3, which share the sun's losses [m] (table 5.2)."""

DIAMETERS_RING = np.array([0.024, 0.125, 0.125, 0.047, 0.032])
"""Diameters of the bearings 3 to 7, which share the ring's losses [m] (table 5.2)."""


def point_name(speed: float, load: float) -> str:
    """Name of an engaged point in the ids of figures: sun speed and load."""
    return f"{SPEED_SUN.display(speed):.0f}-{load:.2f}"


@dataclass(frozen=True)
class Sample:
    """The thesis's tables, as printed or drawn anew within their last digit.

    Parameters
    ----------
    grid : Grid
        Tables A.2 to A.4, and the measured ring torques with the digits of tables 6.2 and 6.3.
    rows : (4, 12) array of int
        Where the engaged point of each load and speed stands in it.
    sun : (4, 12) array
        Sun torques that the thesis's simulation gave [N m].
    """

    grid: Grid
    rows: npt.NDArray[np.int64]
    sun: Array

    @property
    def ring(self) -> Array:
        """Ring torques that were measured and given to the simulated tests [N m] (4, 12)."""
        return np.asarray(self.grid.torque_ring[self.rows])


def printed(grid: Grid) -> Sample:
    """The tables as printed.

    Parameters
    ----------
    grid : Grid
        The published grid.

    Raises
    ------
    GridError
        These are not the points of the thesis.
    """
    at = grid.points
    rows: npt.NDArray[np.int64] = np.empty((len(LOADS), len(SPEEDS)), dtype=np.int64)
    for i, load in enumerate(LOADS):
        for j, speed in enumerate(SPEEDS):
            near = (np.abs(at.speed_sun - speed) < RPM) & (np.abs(at.load_set - load) < ROUNDING_PUBLISHED)
            found = np.flatnonzero(near & at.engaged & grid.accepted)
            if len(found) != 1:
                raise GridError(
                    f"{grid.campaign} grid: engaged point {point_name(speed, load)} (sun speed in rpm, load in N m)",
                    f"{len(found)} rows",
                    "one row for each of the thesis's 48 points",
                    "Name a folder with the thesis's own grids; those of another bench have nothing to be held "
                    "against.",
                )
            rows[i, j] = found[0]
    neutral = int((at.neutral & grid.accepted).sum())
    if neutral != NEUTRAL_POINTS or int(at.engaged.sum()) != rows.size:
        raise GridError(
            f"{grid.campaign} grid",
            f"{neutral} neutral and {int(at.engaged.sum())} engaged points",
            f"{NEUTRAL_POINTS} and {rows.size}, as in the thesis",
            "Name a folder with the thesis's own grids.",
        )
    return Sample(with_ring_torque(grid, rows, TORQUE_RING), rows, TORQUE_SUN)


def with_ring_torque(grid: Grid, rows: npt.NDArray[np.int64], torque: Array) -> Grid:
    """The grid with other ring torques [N m] at some rows."""
    torque_ring = grid.torque_ring.copy()
    torque_ring[rows] = torque
    return replace(grid, torque_ring=torque_ring, points=replace(grid.points, torque_ring=torque_ring))
