"""Powers, losses and efficiencies of engaged points, by the thesis's formulas, with propagated uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pmg.pipeline.fit.common_errors import CORRECTION, causes_of_fits
from pmg.pipeline.fit.propagation import propagate_uncertainty
from pmg.sim import signals
from pmg.sim.errors import FitError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pmg.pipeline.fit.common_errors import CommonErrorSources
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.pipeline.fit.propagation import Mean, Spread
    from pmg.sim.grid import Grid, OperatingPoints
    from pmg.sim.losscurve import LossCurve
    from pmg.sim.signals import Array, Mask, Signal

AnyArray = npt.NDArray[Any]
"""Real, or complex while slopes are taken by the complex step."""

AVERAGED: tuple[Signal, ...] = (
    signals.EFFICIENCY_TOTAL,
    signals.EFFICIENCY_MAGNETIC,
    signals.LOSS_TOTAL,
    signals.LOSS_BEARINGS,
    signals.LOSS_MAGNETIC,
)
"""Quantities averaged over the points of a load."""

QUANTITIES: tuple[Signal, ...] = (
    signals.POWER_IN,
    signals.POWER_OUT,
    signals.LOSS_TOTAL,
    signals.LOSS_BEARINGS,
    signals.LOSS_MAGNETIC,
    signals.EFFICIENCY_TOTAL,
    signals.EFFICIENCY_MAGNETIC,
    signals.EFFICIENCY_BEARINGS,
)
"""Quantities of a balance, in this order."""


@dataclass(frozen=True)
class PowerBalance:
    """Balance of n engaged points.

    Parameters
    ----------
    grid : Grid
        The points.
    correction : float
        K_corr that was used.
    values : dict of str to (n,) array
        By signal name, SI.
    spread : Spread
        Their uncertainty: what differs from point to point, and what points share (transducers, curves, K_corr).
    correction_fitted : bool
        Whether K_corr is a fitted value, with an uncertainty; held otherwise, and taken as given.
    """

    grid: Grid
    correction: float
    values: dict[str, Array]
    spread: Spread
    correction_fitted: bool = False

    @property
    def independent(self) -> dict[str, Array]:
        """Standard uncertainty that differs from point to point, by signal name."""
        return {name: self.spread.independent(name) for name in self.values}

    @property
    def common(self) -> dict[str, Array]:
        """Standard uncertainty that points share, by signal name. It does not average out."""
        return {name: self.spread.common(name) for name in self.values}

    def mean(self, name: str, rows: Mask) -> Mean:
        """Mean of a quantity over some of the points."""
        return self.spread.mean(name, self.values[name], rows)

    def u(self, name: str) -> Array:
        """Standard uncertainty, both parts together."""
        return self.spread.u(name)

    def implausible(self) -> Mask:
        """Points whose magnetic efficiency is above 1, or below 0, by more than twice its uncertainty."""
        name = signals.EFFICIENCY_MAGNETIC.name
        value, u = self.values[name], self.u(name)
        return np.asarray((value - 2.0 * u > 1.0) | (value + 2.0 * u < 0.0))

    def above_one(self) -> Mask:
        """Points whose magnetic efficiency is above 1 as it stands."""
        return np.asarray(self.values[signals.EFFICIENCY_MAGNETIC.name] > 1.0)


def _formulas(inputs: Sequence[AnyArray], w_s: Array, w_r: Array, forward: Mask) -> AnyArray:
    """The eight quantities (8, n) from magnitudes: torques of sun and ring, their bearing torques, speeds."""
    torque_sun, torque_ring, sun, ring = inputs
    power_sun, power_ring = torque_sun * w_s, torque_ring * w_r
    power_in, power_out = np.where(forward, power_sun, power_ring), np.where(forward, power_ring, power_sun)
    loss_in, loss_out = np.where(forward, sun * w_s, ring * w_r), np.where(forward, ring * w_r, sun * w_s)
    return losses_and_efficiencies(power_in, power_out, loss_in, loss_out)


def losses_and_efficiencies(power_in: AnyArray, power_out: AnyArray, loss_in: AnyArray, loss_out: AnyArray) -> AnyArray:
    r"""The quantities of `QUANTITIES` (8, n): powers and losses [W], efficiencies.

    Parameters
    ----------
    power_in, power_out : (n,) array
        Mechanical power at the driving and at the driven shaft [W].
    loss_in, loss_out : (n,) array
        Losses in the bearings of either [W].

    Notes
    -----
    :math:`P_{tot} = P_{in} - P_{out}`, :math:`P_m = P_{tot} - P_b`, :math:`\eta_{tot} = P_{out}/P_{in}`,
    :math:`\eta_m = (P_{out} + P_{b,out})/(P_{in} - P_{b,in})`, :math:`\eta_b = \eta_{tot}/\eta_m` (thesis, equations
    4.2 to 4.7).
    """
    total, bearings = power_in - power_out, loss_in + loss_out
    eta_total = power_out / power_in
    eta_magnetic = (power_out + loss_out) / (power_in - loss_in)
    return np.stack(
        [
            power_in,
            power_out,
            total,
            bearings,
            total - bearings,
            eta_total,
            eta_magnetic,
            eta_total / eta_magnetic,
        ]
    )


def total_loss_and_efficiency(at: OperatingPoints, torque_sun: Array, torque_ring: Array) -> Array:
    r"""Total loss [W] and total efficiency (2, n) of engaged points, from signed torques (n,) [N m].

    Notes
    -----
    :math:`P_{tot} = T_s\omega_s + T_r\omega_r`; :math:`\eta_{tot} = P_{out}/P_{in}`, where power goes in at the shaft
    that drives (thesis, among equations 4.2 to 4.7).
    """
    sun, ring = torque_sun * at.speed_sun, torque_ring * at.speed_ring
    forward = at.drive != "ring"
    return np.stack([sun + ring, -np.where(forward, ring, sun) / np.where(forward, sun, ring)])


def power_balance(
    grid: Grid, fits: LossFits, correction: float, causes: CommonErrorSources | None = None
) -> PowerBalance:
    r"""Losses and efficiencies of the accepted engaged points of a grid.

    Parameters
    ----------
    grid : Grid
        Measured grid.
    fits : LossFits
        Curves of the neutral losses.
    correction : float
        K_corr, which scales them to bearing losses.
    causes : Causes, optional
        What the points share, row by row of `grid`; the curves' own covariance and the transducers where not given.

    Raises
    ------
    FitError
        There is no accepted engaged point.

    Notes
    -----
    With magnitudes, forward flow (thesis, equations 4.2 to 4.7): :math:`P_{tot} = \omega_s T_s - \omega_r T_r`,
    :math:`P_b = K(\omega_s T_{bs} + \omega_r T_{br})`, :math:`P_m = P_{tot} - P_b`,
    :math:`\eta_{tot} = T_r\omega_r / T_s\omega_s`,
    :math:`\eta_m = (T_r + K T_{br})\omega_r / ((T_s - K T_{bs})\omega_s)`, :math:`\eta_b = \eta_{tot}/\eta_m`. With
    reversed flow the shafts change places. A power may be negative and an efficiency above 1: shown, not clipped.

    First-order propagation (GUM 5.1.2, 5.2.2): the two torques of a point are independent; the transducers'
    tolerances, the curves and K_corr are common to all points. Curves and K_corr are correlated through the
    calibration's covariance, so that bearing and magnetic loss err in opposite directions.
    """
    rows = grid.points.engaged & grid.accepted
    chosen = grid[rows]
    if len(chosen) == 0:
        raise FitError("power balance", "no accepted engaged point", "at least one", "Ingest the engaged runs.")
    at = chosen.points
    forward = np.asarray(at.drive != "ring")
    sign_sun = np.where(forward, 1.0, -1.0) * np.sign(at.speed_sun)
    sign_ring = np.where(forward, -1.0, 1.0) * np.sign(at.speed_ring)
    inputs = [
        sign_sun * chosen.torque_sun,
        sign_ring * chosen.torque_ring,
        correction * fits.sun.curve.torque(at.speed_sun),
        correction * fits.ring.curve.torque(at.speed_ring),
    ]
    w_s, w_r = np.abs(at.speed_sun), np.abs(at.speed_ring)
    values = _formulas(inputs, w_s, w_r, forward)
    slopes = []
    for i in range(len(inputs)):
        moved = [x.astype(complex) for x in inputs]
        moved[i] = moved[i] + 1e-20j
        slopes.append(np.imag(_formulas(moved, w_s, w_r, forward)) / 1e-20)
    shared = (causes if causes is not None else causes_of_fits(grid, fits))[rows]
    spread = propagate_uncertainty(
        tuple(signal.name for signal in QUANTITIES),
        (slopes[0] * sign_sun, slopes[1] * sign_ring),
        _by_parameter(slopes[2], slopes[3], fits, at, correction, shared),
        shared,
    )
    named = {signal.name: row for signal, row in zip(QUANTITIES, values, strict=True)}
    return PowerBalance(chosen, correction, named, spread, shared.fitted)


def _by_parameter(
    to_sun: Array, to_ring: Array, fits: LossFits, at: OperatingPoints, correction: float, causes: CommonErrorSources
) -> Array:
    """Derivatives (8, n, k) to the fitted parameters, from those to the bearing torques of sun and ring."""
    sun, ring = fits.sun.curve, fits.ring.curve
    columns = {f"sun[{p:g}]": to_sun * correction * term for p, term in _by_power(sun, at.speed_sun)}
    columns |= {f"ring[{p:g}]": to_ring * correction * term for p, term in _by_power(ring, at.speed_ring)}
    columns[CORRECTION] = to_sun * sun.torque(at.speed_sun) + to_ring * ring.torque(at.speed_ring)
    return np.stack([columns.get(name, np.zeros_like(to_sun)) for name in causes.parameters], axis=-1)


def _by_power(curve: LossCurve, speed: Array) -> Iterator[tuple[float, Array]]:
    """Each power of a curve and its term at the given speeds."""
    return zip(curve.powers, curve.terms(speed).T, strict=True)


def largest_plausible_correction(grid: Grid, fits: LossFits) -> float:
    """The thesis's rule: the largest K_corr at which no measured magnetic loss is negative (its section 4.2.4)."""
    at_one = power_balance(grid, fits, 1.0)
    total = at_one.values[signals.LOSS_TOTAL.name]
    bearings = at_one.values[signals.LOSS_BEARINGS.name]
    return float(np.min(total / bearings))
