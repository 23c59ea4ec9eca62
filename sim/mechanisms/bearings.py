"""Bearing drag as the neutral tests give it: measured curves, scaled by the correction factor, split by share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.sim import signals, sources
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms.base import Component, Experiment, Reveals, RotorLaw, Torques, against, modulus, parameter

if TYPE_CHECKING:
    from pmg.sim.losscurve import LossCurve
    from pmg.sim.signals import Number

_SWEEP = Reveals(Experiment.NEUTRAL_SWEEP, "torque follows the shaft's own speed")


def _correction() -> Any:  # noqa: ANN401  (a dataclass field)
    return parameter(
        "1",
        bounds=(0.0, 1.0),
        typical=0.8,
        meaning="correction factor K_corr: part of the neutral loss that is bearing friction",
    )


@dataclass(frozen=True)
class LookedUpDrag(RotorLaw):
    """Drag by the curves of the neutral tests.

    Parameters
    ----------
    signed : bool
        Whether it turns with the direction of rotation. False: as the block diagrams of the source apply the look-ups,
        against the positive direction on the sun and the negative one on the ring, at rest too. Below rest a look-up
        keeps its value at rest; the source does not state one. The passage there is as wide as that of `against`.
    """

    signed: bool = field(default=True, kw_only=True)

    def _on_sun(self, part: Number, curve: LossCurve, speed: Number, rest: float) -> Number:
        """A part of a curve as a torque on the sun [N m]."""
        if self.signed:
            return against(speed, part * curve.law(modulus(speed, rest)), rest)
        return -part * curve.law(0.5 * (speed + np.sqrt(speed * speed + rest * rest)))

    def _on_ring(self, part: Number, curve: LossCurve, speed: Number, rest: float) -> Number:
        """A part of a curve as a torque on the ring [N m]: its look-up sees the speed with its sign turned."""
        return self._on_sun(part, curve, speed, rest) if self.signed else -self._on_sun(part, curve, -speed, rest)


@dataclass(frozen=True)
class SunBearings(LookedUpDrag):
    """Bearings 1 and 2 on the sun shaft.

    No temperature dependence is given by the source: the curves hold for the warm bench that was measured.
    """

    identifier = "sun_bearing_drag"
    title = "Sun bearings 1 and 2"
    equation = r"\tau_s = -\mathrm{sgn}(\omega_s)\,K_\mathrm{corr}\,\sigma_s\,B_s(|\omega_s|)"
    source = sources.THESIS.at("section 5.3.1, table 5.2")
    component = Component.SUN_BEARINGS
    affects = (signals.TORQUE_SUN,)
    revealed_by = (_SWEEP,)

    curve: LossCurve
    share: float
    correction: float = _correction()

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Drag on the sun rotor."""
        return Torques(self._on_sun(self.correction * self.share, self.curve, speed_sun, rest), 0.0 * speed_ring)


@dataclass(frozen=True)
class RingBearings(LookedUpDrag):
    """Bearings 4 to 7 on the ring shaft."""

    identifier = "ring_bearing_drag"
    title = "Ring bearings 4 to 7"
    equation = r"\tau_r = -\mathrm{sgn}(\omega_r)\,K_\mathrm{corr}\,\sigma_r\,B_r(|\omega_r|)"
    source = sources.THESIS.at("section 5.3.2, table 5.2")
    component = Component.RING_BEARINGS
    affects = (signals.TORQUE_RING,)
    revealed_by = (_SWEEP,)

    curve: LossCurve
    share: float
    correction: float = _correction()

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Drag on the ring rotor."""
        return Torques(0.0 * speed_sun, self._on_ring(self.correction * self.share, self.curve, speed_ring, rest))


@dataclass(frozen=True)
class RelativeBearing(LookedUpDrag):
    """Bearing 3, between the shafts, as the thesis models it: a share of each shaft's own curve.

    Mounted between the shafts it would follow the speed difference; the source lets each side follow its own
    speed, and so does this baseline.
    """

    identifier = "relative_bearing_share"
    title = "Relative bearing"
    equation = r"\tau_k = -\mathrm{sgn}(\omega_k)\,K_\mathrm{corr}\,\sigma_{3k}\,B_k(|\omega_k|),\ k = s, r"
    source = sources.THESIS.at("section 5.3.3, table 5.2")
    component = Component.RELATIVE_BEARING
    affects = (signals.TORQUE_SUN, signals.TORQUE_RING)
    revealed_by = (_SWEEP,)

    curve_sun: LossCurve
    curve_ring: LossCurve
    share_sun: float
    share_ring: float
    correction: float = _correction()

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Drag on both rotors."""
        sun = self._on_sun(self.correction * self.share_sun, self.curve_sun, speed_sun, rest)
        return Torques(sun, self._on_ring(self.correction * self.share_ring, self.curve_ring, speed_ring, rest))


@dataclass(frozen=True)
class NeutralRemainder(LookedUpDrag):
    """The part of the neutral loss that is not bearing friction; it is there in neutral only.

    The thesis puts it down to magnetic coupling that is left with the carrier not quite centred, and takes it
    out by the correction factor.
    """

    identifier = "neutral_remainder"
    title = "Remainder of the neutral loss"
    equation = (
        r"\tau_k = -\mathrm{sgn}(\omega_k)\,\rho\,B_k(|\omega_k|)\ \text{in neutral},\ \rho = 1 - K_\mathrm{corr}"
    )
    source = sources.THESIS.at("section 4.2.4")
    component = Component.MAGNETIC_GEAR
    affects = (signals.TORQUE_SUN, signals.TORQUE_RING)
    revealed_by = (Reveals(Experiment.ENGAGED_LOADS, "neutral losses above those of the engaged bench"),)
    acts_in = (Configuration.NEUTRAL,)

    curve_sun: LossCurve
    curve_ring: LossCurve
    remainder: float = parameter(
        "1", bounds=(0.0, 1.0), typical=0.2, meaning="part of the neutral loss that is not bearing friction"
    )

    def law(self, speed_sun: Number, speed_ring: Number, rest: float = 0.0) -> Torques:
        """Drag on both rotors in neutral."""
        sun = self._on_sun(self.remainder, self.curve_sun, speed_sun, rest)
        return Torques(sun, self._on_ring(self.remainder, self.curve_ring, speed_ring, rest))
