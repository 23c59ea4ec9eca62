"""Bearing drag as the neutral tests give it: measured curves, scaled by the correction factor, split by share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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
class SunBearings(RotorLaw):
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
        magnitude = self.correction * self.share * self.curve.law(modulus(speed_sun, rest))
        return Torques(sun=against(speed_sun, magnitude, rest), ring=0.0 * speed_ring)


@dataclass(frozen=True)
class RingBearings(RotorLaw):
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
        magnitude = self.correction * self.share * self.curve.law(modulus(speed_ring, rest))
        return Torques(sun=0.0 * speed_sun, ring=against(speed_ring, magnitude, rest))


@dataclass(frozen=True)
class RelativeBearing(RotorLaw):
    """Bearing 3, between the shafts, as the thesis models it: a share of each shaft's own curve.

    Mounted between the shafts it would follow the speed difference; the source lets each side follow its own
    speed, and so does this baseline.
    """

    identifier = "relative_bearing_share"
    title = "Relative bearing 3"
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
        sun = self.correction * self.share_sun * self.curve_sun.law(modulus(speed_sun, rest))
        ring = self.correction * self.share_ring * self.curve_ring.law(modulus(speed_ring, rest))
        return Torques(sun=against(speed_sun, sun, rest), ring=against(speed_ring, ring, rest))


@dataclass(frozen=True)
class NeutralRemainder(RotorLaw):
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
        sun = self.remainder * self.curve_sun.law(modulus(speed_sun, rest))
        ring = self.remainder * self.curve_ring.law(modulus(speed_ring, rest))
        return Torques(sun=against(speed_sun, sun, rest), ring=against(speed_ring, ring, rest))
