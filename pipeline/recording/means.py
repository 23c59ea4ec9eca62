"""Means of a window: what reducing it gives and a manifest keeps."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pmg.sim.shafts import PerShaft

BATCH_METHOD, MEMORY_METHOD = "batches", "memory"
"""Where the uncertainty of a mean comes from."""


@dataclass(frozen=True)
class ShaftMeans:
    """One shaft over one window.

    Parameters
    ----------
    torque : float
        Mean torque, over whole revolutions where the shaft turns five times or more [N m].
    within : float
        Standard uncertainty of that mean from what varies within the window [N m].
    dof : float
        Degrees of freedom of `within`.
    revolutions_per_batch : int
        Whole revolutions of each batch; 0 where batches are cut by time.
    std, std_filtered : float
        Standard deviation of the torque before and after the filter [N m].
    correlation_time : float
        Correlation time of the torque noise, as if it were of first order [s].
    speed : float
        Mean speed, from the angle at both ends [rad/s].
    method : str
        Where `within` comes from: ``batches``, or ``memory`` where they may not give it (`serial_mean`).
    correlated : bool
        The noise may not be flat at the lowest frequencies of the window: of first order, it outlives a
        twentieth of it. What goes on below them is not seen, and `within` rests on what noise may be.
    resolution : float
        Step between neighbouring values of the torque [N m].
    spikes : float
        By how much samples far off the others move the mean [N m].
    """

    torque: float
    within: float
    dof: float
    revolutions_per_batch: int
    std: float
    std_filtered: float
    correlation_time: float
    speed: float
    method: str = BATCH_METHOD
    correlated: bool = False
    resolution: float = math.nan
    spikes: float = math.nan


@dataclass(frozen=True)
class PointMeans(PerShaft[ShaftMeans]):
    """Both shafts over one window.

    Parameters
    ----------
    sun, ring : ShaftMeans
        The shafts. A number that cannot be had (a gap, too few samples) is NaN.
    n : int
        Samples with a torque of both shafts.
    duration : float
        Length of the window [s].
    """

    n: int
    duration: float
