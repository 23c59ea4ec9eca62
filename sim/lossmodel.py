"""The calibrated baseline: two bearing curves, the correction factor, three damping constants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.sim.mechanisms import (
    EddyDamping,
    ExcessDamping,
    HysteresisDamping,
    NeutralRemainder,
    RelativeBearing,
    RingBearings,
    SunBearings,
)

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.losscurve import LossCurve
    from pmg.sim.mechanisms import Mechanism


@dataclass(frozen=True)
class LossModel:
    """What a calibration determines.

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

    def mechanisms(self, bench: BenchParameters) -> tuple[Mechanism, ...]:
        """The mechanisms of the baseline, with these numbers, in the order of the power chain."""
        s, r, k, share = self.curve_sun, self.curve_ring, self.correction, bench.bearings
        return (
            SunBearings(s, share.sun, k),
            RelativeBearing(s, r, share.share_sun_relative, share.share_ring_relative, k),
            RingBearings(r, share.ring, k),
            NeutralRemainder(s, r, 1.0 - k),
            HysteresisDamping(self.b),
            EddyDamping(self.c),
            ExcessDamping(self.d),
        )
