"""Numbers of the calibrated baseline: two bearing curves, the correction factor, three damping constants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.sim.shafts import PerShaft

if TYPE_CHECKING:
    from pmg.sim.losscurve import LossCurve


@dataclass(frozen=True)
class LossModel:
    """Parameters that a calibration determines.

    Parameters
    ----------
    curve_sun, curve_ring : LossCurve
        Neutral loss torques [N m].
    correction : float
        K_corr: the part of them that is bearing friction and stays when engaged.
    b, c, d : float
        Hysteresis [N m], eddy [N m s/rad] and excess [N m (s/rad)^1/2] damping of each rotor.
    """

    curve_sun: LossCurve
    curve_ring: LossCurve
    correction: float
    b: float
    c: float
    d: float

    @property
    def curves(self) -> PerShaft[LossCurve]:
        """The neutral loss torques [N m]."""
        return PerShaft(self.curve_sun, self.curve_ring)
