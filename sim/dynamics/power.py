"""Where the power of the moving bench is, element by element, at every instant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.state import SetPoints, State

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pmg.sim.signals import Array, Number


@dataclass(frozen=True)
class Powers:
    """Powers of every element [W].

    Parameters
    ----------
    supplied : mapping of str to number
        By the two amplifiers.
    stored : mapping of str to number
        Rate of the energy held by each inertia, joint, winding and by the magnetic field.
    dissipated : mapping of str to number
        Turned into heat by each joint, winding, motor bearing and mechanism.
    created : mapping of str to number
        Made from nothing by a convention of the source; zero with the consistent signs and the carrier in the map.
    """

    supplied: Mapping[str, Number]
    stored: Mapping[str, Number]
    dissipated: Mapping[str, Number]
    created: Mapping[str, Number]

    @property
    def residual(self) -> Array:
        """Imbalance of the power [W]; rounding, if every element is accounted for."""
        gained = sum(self.supplied.values()) + sum(self.created.values())
        return np.asarray(gained - sum(self.stored.values()) - sum(self.dissipated.values()))

    @property
    def turnover(self) -> Array:
        """Sum of all magnitudes [W]: what the residual is to be compared with."""
        groups = (self.supplied, self.stored, self.dissipated, self.created)
        return np.asarray(sum(np.abs(value) for group in groups for value in group.values()))


class Flows(NamedTuple):
    """Powers that follow from the state alone [W].

    `drawn` is what each winding passes on to its rotor or burns: the supply, less what the winding stores.
    """

    drawn: dict[str, Number]
    dissipated: dict[str, Number]
    created: dict[str, Number]


def energies(drivetrain: Drivetrain, state: Iterable[Number]) -> dict[str, Number]:
    """Energy stored in each element [J]; that of the field is zero where all angles are zero."""
    x, q = State(*state), drivetrain.constants
    magnetic = drivetrain.magnetic(x)[2] - drivetrain.magnetic([0.0] * len(x))[2]
    return {
        "sun shaft and motor inertia": 0.5 * (q.sun.inertia + q.sun.rotor_inertia) * x.speed_sun_motor**2,
        "ring shaft and motor inertia": 0.5 * (q.ring.inertia + q.ring.rotor_inertia) * x.speed_ring_motor**2,
        "sun rotor inertia": 0.5 * q.J_s * x.speed_sun**2,
        "ring rotor inertia": 0.5 * q.J_r * x.speed_ring**2,
        "carrier inertia": 0.5 * q.J_c * x.speed_carrier**2,
        "sun joint twist": 0.5 * q.k * x.twist_sun**2,
        "ring joint twist": 0.5 * q.k * x.twist_ring**2,
        "block twist": 0.5 * q.k * x.angle_block**2,
        "sun winding": 0.5 * q.L * x.current_sun**2,
        "ring winding": 0.5 * q.L * x.current_ring**2,
        "magnetic field": magnetic,
    }


def flows(drivetrain: Drivetrain, state: Iterable[Number]) -> Flows:
    r"""Powers that follow from the state alone, at an instant or at many when the state has further axes.

    Notes
    -----
    With the thesis's motor signs the ring's friction counts negative and the conversion creates
    :math:`(K_c - K_e)\,\omega i`; with the carrier left out of the map its motion draws from a field that does not
    lose. Both stand under `created`.
    """
    x, q = State(*state), drivetrain.constants
    by_sun, by_ring, held = drivetrain.coupled(x.speed_sun, x.speed_ring, x.speed_carrier)
    magnetic_sun, magnetic_ring, _ = drivetrain.magnetic(x)
    dissipated = {
        "sun joint damping": q.c * (x.speed_sun_motor - by_sun) ** 2,
        "ring joint damping": q.c * (x.speed_ring_motor - by_ring) ** 2,
        "block damping": q.c * held**2,
        "sun winding resistance": q.R * x.current_sun**2,
        "ring winding resistance": q.R * x.current_ring**2,
        "sun motor friction": q.sun.friction * x.speed_sun_motor**2,
        "ring motor friction": q.ring.friction * x.speed_ring_motor**2,
    }
    for law, (sun, ring, carrier) in zip(drivetrain.losses, drivetrain.drags(x), strict=True):
        dissipated[law.title] = -(sun * x.speed_sun + ring * x.speed_ring + carrier * x.speed_carrier)
    unseen = 0.0 if q.carrier_seen else 1.0
    return Flows(
        drawn={
            "sun amplifier": (q.R * x.current_sun + q.sun.back_emf * x.speed_sun_motor) * x.current_sun,
            "ring amplifier": (q.R * x.current_ring + q.ring.back_emf * x.speed_ring_motor) * x.current_ring,
        },
        dissipated=dissipated,
        created={
            "sun motor conversion": (q.K_c - q.sun.back_emf) * x.speed_sun_motor * x.current_sun,
            "ring motor conversion": (q.K_c - q.ring.back_emf) * x.speed_ring_motor * x.current_ring,
            "map without carrier": unseen * -(magnetic_sun + magnetic_ring) * x.speed_carrier,
        },
    )


def powers(drivetrain: Drivetrain, state: Iterable[Number], asked: SetPoints) -> Powers:
    """Power of every element at an instant, or at many when the state has further axes."""
    x, q = State(*state), drivetrain.constants
    m, d = drivetrain.motion(x, asked), drivetrain.rates(x, asked)
    inertia_sun, inertia_ring = (side.inertia + side.rotor_inertia for side in (q.sun, q.ring))
    seen = 1.0 if q.carrier_seen else 0.0
    stored = {
        "sun shaft and motor inertia": inertia_sun * x.speed_sun_motor * d.speed_sun_motor,
        "ring shaft and motor inertia": inertia_ring * x.speed_ring_motor * d.speed_ring_motor,
        "sun rotor inertia": q.J_s * x.speed_sun * d.speed_sun,
        "ring rotor inertia": q.J_r * x.speed_ring * d.speed_ring,
        "carrier inertia": q.J_c * x.speed_carrier * d.speed_carrier,
        "sun joint twist": q.k * x.twist_sun * d.twist_sun,
        "ring joint twist": q.k * x.twist_ring * d.twist_ring,
        "block twist": q.k * x.angle_block * d.angle_block,
        "sun winding": q.L * x.current_sun * d.current_sun,
        "ring winding": q.L * x.current_ring * d.current_ring,
        "magnetic field": -(
            m.magnetic_sun * x.speed_sun + m.magnetic_ring * x.speed_ring + seen * m.magnetic_carrier * x.speed_carrier
        ),
    }
    found = flows(drivetrain, x)
    return Powers(
        supplied={
            "sun amplifier": m.sun.voltage * x.current_sun,
            "ring amplifier": m.ring.voltage * x.current_ring,
        },
        stored=stored,
        dissipated=found.dissipated,
        created=found.created,
    )
