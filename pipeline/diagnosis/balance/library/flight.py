"""Flight of a load across the gap of a coupling, from stop to stop."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.files.compiled import compiled

if TYPE_CHECKING:
    from pmg.sim.signals import Array

HARD, REBOUNDS = 0.6, (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
"""Part of the speed at which a load meets a stop with which it leaves it: steel on steel, and whatever it may be."""


@compiled
def fly(speed: Array, step: float, gap: float, rebound: float, driven: float) -> Array:
    r"""Speed of a load that nothing brakes but the stops at either end of a gap (n,) [m/s, rad/s].

    Parameters
    ----------
    speed : (n,) array
        Of what drives it [m/s, rad/s].
    step : float
        Time from sample to sample [s].
    gap : float
        Way from stop to stop [m, rad].
    rebound : float
        Part of the speed of meeting with which it leaves a stop, the e below.
    driven : float
        Sense in which it is driven at first, which tells the stop that it begins at; zero for neither.

    Notes
    -----
    The way between both is :math:`x' = w - v`; where it would leave :math:`\pm b/2` the load takes the speed
    :math:`v + e (v - w)`, or :math:`v` where it has been at that stop the sample before, unless it leaves by itself.
    """
    carried = np.empty_like(speed)
    carried[0] = now = speed[0]
    end, rests = 0.5 * gap, driven != 0.0
    apart = -end * driven
    for k in range(1, len(speed)):
        apart += (now - 0.5 * (speed[k - 1] + speed[k])) * step
        met = speed[k] if rests else speed[k] + rebound * (speed[k] - now)
        rests = abs(apart) > end
        if apart < -end:
            apart, now = -end, max(now, met)
        elif apart > end:
            apart, now = end, min(now, met)
        carried[k] = now
    return carried
