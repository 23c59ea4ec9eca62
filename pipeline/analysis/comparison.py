"""Measured against simulated: the same grid twice, subtracted, with the uncertainty of the difference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.calibration import jacobian
from pmg.pipeline.grid.readings import take_readings
from pmg.pipeline.wording.probability import COVERAGE_FACTOR

if TYPE_CHECKING:
    from pmg.pipeline.fit.calibration import FittedBaseline
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array, Mask


@dataclass(frozen=True)
class Difference:
    """A quantity measured and simulated at n points; NaN where it does not apply.

    Parameters
    ----------
    measured, simulated : (n,) array
        In SI units.
    u : (n,) array
        Standard uncertainty of measured minus simulated.
    """

    measured: Array
    simulated: Array
    u: Array

    @property
    def value(self) -> Array:
        """Measured minus simulated."""
        return self.measured - self.simulated

    @property
    def compared(self) -> Mask:
        """Points at which both are known."""
        return np.isfinite(self.value) & np.isfinite(self.u)

    @property
    def within(self) -> Mask:
        """Points at which the difference is no larger than U = 2u."""
        return np.asarray(np.abs(self.value) <= COVERAGE_FACTOR * self.u)


@dataclass(frozen=True)
class Residuals:
    """Everything compared, point by point of the measured grid.

    Parameters
    ----------
    grid : Grid
        The measured grid, all rows.
    simulated : Grid
        Its simulated counterpart.
    torque_sun, torque_ring : Difference
        Torques [N m]. Engaged, the ring torque is the simulator's input, so only the sun's is compared; a shaft held
        at rest is not compared.
    loss_total : Difference
        Loss between the transducers [W], engaged points.
    efficiency_total : Difference
        Total efficiency, engaged points.
    """

    grid: Grid
    simulated: Grid
    torque_sun: Difference
    torque_ring: Difference
    loss_total: Difference
    efficiency_total: Difference


def compare(measured: Grid, simulated: Grid, bench: BenchParameters, calibration: FittedBaseline | None) -> Residuals:
    """Subtract the simulated grid from the measured one.

    Parameters
    ----------
    measured, simulated : Grid
        The same points.
    bench : BenchParameters
        Ratio of the stages.
    calibration : FittedBaseline or None
        Its parameter uncertainty enters the uncertainty of the difference, which is that of a new reading; its
        correlation with readings that took part in the fit is left out, so U is slightly too wide there. None where
        a given model made the simulation: its own uncertainty is then left out.
    """
    readings = take_readings(measured, bench)
    u_model = np.zeros(len(readings)) if calibration is None else _predicted_uncertainty(readings, bench, calibration)
    u_of = {True: np.full(len(measured), np.nan), False: np.full(len(measured), np.nan)}
    for sun in (True, False):
        chosen = readings.sun == sun
        u_of[sun][readings.row[chosen]] = np.hypot(readings.u[chosen], u_model[chosen])

    def torque(values: Array, simulation: Array, u: Array) -> Difference:
        known = np.isfinite(u)
        return Difference(np.where(known, values, np.nan), np.where(known, simulation, np.nan), u)

    torque_sun = torque(measured.torque_sun, simulated.torque_sun, u_of[True])
    torque_ring = torque(measured.torque_ring, simulated.torque_ring, u_of[False])
    at = measured.points
    used = at.engaged & measured.accepted

    def losses(torque_at_sun: Array) -> Array:
        return np.where(used, torque_at_sun * at.speed_sun + measured.torque_ring * at.speed_ring, np.nan)

    def efficiency(torque_at_sun: Array) -> Array:
        sun, ring = torque_at_sun * at.speed_sun, measured.torque_ring * at.speed_ring
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(used, np.where(at.drive == "ring", -sun / ring, -ring / sun), np.nan)

    u_loss = np.where(used, u_of[True] * np.abs(at.speed_sun), np.nan)
    simulated_efficiency = efficiency(simulated.torque_sun)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(
            at.drive == "ring",
            np.abs(at.speed_sun / (measured.torque_ring * at.speed_ring)),
            np.abs(simulated_efficiency / simulated.torque_sun),
        )
    return Residuals(
        grid=measured,
        simulated=simulated,
        torque_sun=torque_sun,
        torque_ring=torque_ring,
        loss_total=Difference(losses(measured.torque_sun), losses(simulated.torque_sun), u_loss),
        efficiency_total=Difference(
            efficiency(measured.torque_sun), simulated_efficiency, np.where(used, slope * u_of[True], np.nan)
        ),
    )


def _predicted_uncertainty(readings: Readings, bench: BenchParameters, calibration: FittedBaseline) -> Array:
    """Standard uncertainty of the predicted readings from the calibration alone [N m].

    Parameters on a bound contribute nothing here; the report says which they are.
    """
    slopes = jacobian(readings, bench, calibration.model, calibration.free)
    covariance = np.nan_to_num(calibration.covariance)
    return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes)))
