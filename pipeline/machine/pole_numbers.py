"""What the pole numbers of a magnetic gear imply: cogging factor, the six operating modes, waves in the air gap."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING

from pmg.sim.shafts import Member

if TYPE_CHECKING:
    from pmg.sim.bench import GearParameters

HARMONICS = (1, 3, 5)
"""Harmonics of the magnets that are listed; a field of magnets has odd ones only (equations 2.10 and 2.11)."""

MODULATIONS = (-1, 0, 1)
"""Harmonics of the iron poles' modulation that are listed, j; 0 is what passes without modulation."""


@dataclass(frozen=True)
class OperatingMode:
    """One of the six ways to use the gear (table 2.2), without losses.

    Parameters
    ----------
    input, output, fixed : Member
        Who does what.
    ratio : float
        Speed of the input over that of the output.
    speeds : tuple of float
        Of sun, ring and carrier, that of the input being 1.
    torques : tuple of float
        Largest torques that sun, ring and carrier take from outside [N m], at pull-out; positive drives.
    """

    input: Member
    output: Member
    fixed: Member
    ratio: float
    speeds: tuple[float, float, float]
    torques: tuple[float, float, float]


@dataclass(frozen=True)
class SpaceHarmonic:
    """A wave of the field in the air gap (equations 2.12 and 2.13).

    Parameters
    ----------
    of : Member
        Whose magnets make it.
    magnet, modulation : int
        Harmonics m of the magnets and j of the iron poles.
    pole_pairs : int
        Pole pairs of the wave, abs(m p + j q).
    speed : float
        How fast it turns with the carrier at rest, per turn of that rotor, m p / (m p + j q).
    drives : Member or None
        The other rotor where the wave has its pole pairs, and so pulls it along.
    """

    of: Member
    magnet: int
    modulation: int
    pole_pairs: int
    speed: float
    drives: Member | None


def cogging_factor(pole_pairs: int, iron_poles: int) -> float:
    r""":math:`C_f = 2 p q / \mathrm{lcm}(2p, q)` (equation 2.17); 1 is the least torque ripple."""
    return 2 * pole_pairs * iron_poles / math.lcm(2 * pole_pairs, iron_poles)


def operating_modes(gear: GearParameters, iron_poles: int) -> tuple[OperatingMode, ...]:
    r"""The six modes of table 2.2 with speeds and largest torques.

    Notes
    -----
    Speeds of a locked gear: :math:`p_s\omega_s + p_r\omega_r = q\,\omega_c` (from equations 2.7 and 2.8). Torques go
    with the pole numbers :math:`(p_s, p_r, -q)`, so that they balance and no power is lost; their size is the published
    pull-out of the sun. With the sun fixed, table 2.2 prints a minus sign and the inverse ratio; equation 2.8 gives
    what stands here.
    """
    pairs = gear.pole_pairs
    poles = {Member.SUN: pairs.sun, Member.RING: pairs.ring, Member.CARRIER: -iron_poles}
    found = []
    for into, out, fixed in permutations(Member, 3):
        speed = {into: 1.0, out: -poles[into] / poles[out], fixed: 0.0}
        way = math.copysign(1.0, poles[into])
        size = way * float(gear.pull_out_torque_sun) / poles[Member.SUN]
        torque = {member: size * number for member, number in poles.items()}
        ends = (Member.SUN, Member.RING, Member.CARRIER)
        speeds, torques = (tuple(values[end] for end in ends) for values in (speed, torque))
        found.append(OperatingMode(into, out, fixed, 1.0 / speed[out], speeds, torques))  # type: ignore[arg-type]
    return tuple(found)


def space_harmonics(gear: GearParameters, iron_poles: int) -> tuple[SpaceHarmonic, ...]:
    """Waves that the magnets of either rotor make through the iron poles."""
    pairs = {Member.SUN: gear.pole_pairs.sun, Member.RING: gear.pole_pairs.ring}
    others = {Member.SUN: Member.RING, Member.RING: Member.SUN}
    found = []
    for of, p in pairs.items():
        for m in HARMONICS:
            for j in MODULATIONS:
                waves = m * p + j * iron_poles
                if waves:
                    drives = others[of] if abs(waves) == pairs[others[of]] and j else None
                    found.append(SpaceHarmonic(of, m, j, abs(waves), m * p / waves, drives))
    return tuple(found)
