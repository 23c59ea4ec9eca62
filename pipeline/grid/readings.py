"""The torque readings that carry information about losses, stacked: what is fitted, compared and diagnosed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.grid import Grid
from pmg.sim.roots import ROUNDING
from pmg.sim.shafts import PerShaft
from pmg.sim.steady.gearbox import Gearbox
from pmg.sim.steady.solve import holding_torques

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.mechanisms.base import Torques
    from pmg.sim.signals import Array, Mask


@dataclass(frozen=True)
class Readings:
    """m readings, one shaft at one point each.

    In neutral both shafts are read, unless held at rest. Engaged, the ring torque is the input and the sun torque
    the reading; the uncertainty of the input enters through the ratio. At the zero checks both transducers are
    read, and nothing is expected.

    Parameters
    ----------
    grid : Grid
        Where they come from.
    row : (m,) array of int
        Row of the grid.
    sun : (m,) array of bool
        Whether it is the sun's transducer; the ring's otherwise.
    torque : (m,) array
        The reading [N m].
    u : (m,) array
        Its standard uncertainty [N m], independent from point to point.
    """

    grid: Grid
    row: npt.NDArray[np.int64]
    sun: Mask
    torque: Array
    u: Array

    def __len__(self) -> int:
        return len(self.row)

    def __getitem__(self, rows: Mask | npt.NDArray[np.int64]) -> Readings:
        """The chosen readings."""
        return Readings(self.grid, self.row[rows], self.sun[rows], self.torque[rows], self.u[rows])

    @property
    def configuration(self) -> npt.NDArray[np.str_]:
        """Configuration of each reading."""
        return np.asarray(self.grid.points.configuration[self.row])

    @property
    def of_shaft(self) -> PerShaft[Mask]:
        """Which readings are of each shaft's transducer, (m,) each."""
        return PerShaft(self.sun, ~self.sun)

    @property
    def speed_own(self) -> Array:
        """Speed of the shaft that is read [rad/s]."""
        at = self.grid.points
        return np.where(self.sun, at.speed_sun[self.row], at.speed_ring[self.row])

    @property
    def speed_other(self) -> Array:
        """Speed of the other shaft [rad/s]."""
        at = self.grid.points
        return np.where(self.sun, at.speed_ring[self.row], at.speed_sun[self.row])

    @property
    def direction(self) -> Array:
        """Sign that turns a torque into a drag; 1 at rest."""
        sign = np.sign(self.speed_own)
        return np.where((sign == 0.0) | (self.configuration == "zero"), 1.0, sign)

    def of(self, simulated: Torques) -> Array:
        """The simulated counterparts of the readings [N m]."""
        return np.where(self.sun, simulated.sun[self.row], simulated.ring[self.row])


def take_readings(grid: Grid, bench: BenchParameters) -> Readings:
    """The readings of the accepted rows of a grid."""
    at = grid.points
    rows_sun = np.flatnonzero(grid.accepted & ((at.neutral & ~at.rest_sun) | at.engaged | at.zero))
    rows_ring = np.flatnonzero(grid.accepted & ((at.neutral & ~at.rest_ring) | at.zero))
    ratio = bench.ratio(at.gear)
    u_sun = np.where(at.engaged, np.hypot(grid.u_sun, grid.u_ring / ratio), grid.u_sun)
    return Readings(
        grid=grid,
        row=np.r_[rows_sun, rows_ring],
        sun=np.r_[np.ones(len(rows_sun), dtype=bool), np.zeros(len(rows_ring), dtype=bool)],
        torque=np.r_[grid.torque_sun[rows_sun], grid.torque_ring[rows_ring]],
        u=np.r_[u_sun[rows_sun], grid.u_ring[rows_ring]],
    )


def predict(readings: Readings, bench: BenchParameters, model: LossModel) -> Array:
    """Simulated value of each reading by the calibrated model [N m]."""
    return readings.of(holding_torques(Gearbox.calibrated(bench, model), readings.grid.points))


def change(after: Array, before: Array) -> Array:
    """Change of simulated readings (m,) [N m]; zero where it is no more than their rounding.

    What does not touch a reading must not seem to: its rounding, once scaled, is a direction that the processor chose.
    """
    rounding = ROUNDING * max(float(np.abs(values).max(initial=0.0)) for values in (after, before))
    moved = after - before
    return np.where(np.abs(moved) <= rounding, 0.0, moved)
