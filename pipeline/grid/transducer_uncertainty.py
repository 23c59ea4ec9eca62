"""Uncertainty common to all readings of a torque transducer: sensitivity, non-linearity, tare."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

DITHERED = 0.5
"""Scatter, in steps of the reading, from which its rounding averages out and stands in the scatter of the batches."""
RECTANGULAR = math.sqrt(3.0)
"""Half-width of a rectangular distribution over its standard deviation (GUM 4.3.7)."""
NEGLIGIBLE = 1e-6
"""Part of a variance below which a difference of two is rounding."""


@dataclass(frozen=True)
class CommonParts:
    """Standard uncertainties that the readings of one transducer share, (n,) each [N m]."""

    sensitivity: Array
    linearity: Array
    tare: Array


def nominal_torque(bench: BenchParameters, side: str, stated: Array | None) -> Array:
    """Nominal torque of the transducer at each point [N m]: as its calibration states it, else the bench's.

    Parameters
    ----------
    bench : BenchParameters
        Its nominal torque stands where none is stated.
    side : str
        ``sun`` or ``ring``.
    stated : (n,) array or None
        From the calibrations of the recordings [N m]; NaN where there is none, None for grids from tables.
    """
    of = float(bench.transducers[side].nominal_torque)
    return np.asarray(of if stated is None else np.where(np.isfinite(stated), stated, of))


def tolerated(sensitivity: Array | float, linearity: Array | float) -> Array:
    """Standard uncertainty of half-widths of rectangular distributions, summed in quadrature (n,), GUM 4.3.7 [N m]."""
    return np.asarray(np.hypot(sensitivity, linearity) / RECTANGULAR)


def common_uncertainty(
    torque_sun: Array,
    torque_ring: Array,
    bench: BenchParameters,
    tare: tuple[float, float] = (0.0, 0.0),
    nominal: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Standard uncertainty that all points of a transducer share [N m], sun and ring.

    Sensitivity tolerance (of the reading) and non-linearity (of the nominal torque) as half-widths of rectangular
    distributions, GUM 4.3.7, and the standard uncertainty of the tare, summed in quadrature.

    Parameters
    ----------
    torque_sun, torque_ring : (n,) array
        Mean torques [N m].
    bench : BenchParameters
        Tolerances.
    tare : tuple of float
        Standard uncertainty of the tare, sun and ring [N m].
    nominal : tuple of two (n,) arrays, optional
        Nominal torques that the calibrations state, sun and ring [N m]; the bench's when not given.
    """

    def common(torque: Array, side: str, zero: float, stated: Array | None) -> Array:
        of = bench.transducers[side]
        linearity = of.nonlinearity * nominal_torque(bench, side, stated)
        return np.hypot(tolerated(of.sensitivity_tolerance * torque, linearity), zero)

    stated = (None, None) if nominal is None else nominal
    return common(torque_sun, "sun", tare[0], stated[0]), common(torque_ring, "ring", tare[1], stated[1])


def common_parts(grid: Grid, bench: BenchParameters, side: str, nominal: Array | None = None) -> CommonParts:
    """The common uncertainty of a grid split into its parts; their squares add up to that of the grid.

    Sensitivity is taken first, then non-linearity, of the nominal torques [N m] (n,) that the calibrations state or
    of the bench's; what is left is the tare.
    """
    of = bench.transducers[side]
    common = grid.common[side]
    sensitivity = np.minimum(of.sensitivity_tolerance * np.abs(grid.torque[side]) / RECTANGULAR, common)
    rest = common**2 - sensitivity**2
    linearity = np.minimum((of.nonlinearity * nominal_torque(bench, side, nominal) / RECTANGULAR) ** 2, rest)
    left = rest - linearity
    tare = np.where(left > NEGLIGIBLE * common**2, left, 0.0)
    return CommonParts(sensitivity, np.sqrt(linearity + (left - tare)), np.sqrt(tare))


def tare_uncertainty(zeros: Array) -> tuple[float, int]:
    r"""Standard uncertainty of a zero that is not subtracted [N m], and its degrees of freedom.

    Parameters
    ----------
    zeros : (k,) array
        Mean torque of each zero check [N m].

    Returns
    -------
    float, int
        0 and 0 with fewer than two checks: they do not tell.

    Notes
    -----
    The calibration's null frequency is the tare; the zero checks :math:`z_i` witness how well it holds. With their
    mean :math:`\bar z` and standard deviation s, :math:`u^2 = \bar z^2 + s^2/k` is the mean square of the offset
    that is left in every reading (GUM F.2.4.5, a correction that is known and not applied).
    """
    known = zeros[np.isfinite(zeros)]
    if len(known) < 2:
        return 0.0, 0
    return float(math.hypot(known.mean(), known.std(ddof=1) / math.sqrt(len(known)))), len(known) - 1


def undithered(resolution: Array, std: Array) -> Array:
    """Standard uncertainty [N m] by the step of a reading whose scatter is too small to average it out (n,).

    Parameters
    ----------
    resolution, std : (n,) array
        Step between values and standard deviation of the torque [N m].

    Notes
    -----
    GUM F.2.2.1. With a scatter of half a step or more the mean of many readings is right to less than a hundredth of
    a step, and the rounding of each is part of the scatter.
    """
    alone = np.isfinite(resolution) & ~(std >= DITHERED * resolution)
    return np.where(alone, resolution / (2.0 * RECTANGULAR), 0.0)
