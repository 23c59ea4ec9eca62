"""Speeds and torques of the three members with one of them held: one relation, three machines."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pmg.sim.bench import GearParameters


class Member(StrEnum):
    """A member of the magnetic gear."""

    SUN = "sun"
    RING = "ring"
    CARRIER = "carrier"


@dataclass(frozen=True)
class Ratios:
    """Speeds and torques of a stage with one member held.

    Parameters
    ----------
    held : Member
        The member at rest.
    fast, slow : Member
        The two that turn.
    speed : dict of Member to float
        Speeds for unit speed of the fast member.
    torque : dict of Member to float
        Torques from outside that hold a lossless stage in balance, for unit torque on the fast member.
    """

    held: Member
    fast: Member
    slow: Member
    speed: dict[Member, float]
    torque: dict[Member, float]

    @property
    def speed_ratio(self) -> float:
        """Speed of the fast member over that of the slow one; negative when they turn against each other."""
        return self.speed[self.fast] / self.speed[self.slow]


def ratios(gear: GearParameters, held: Member) -> Ratios:
    r"""Ratios of a stage with one member held.

    Parameters
    ----------
    gear : GearParameters
        Pole pairs of the stage.
    held : Member
        The carrier on this bench; the ring for a free carrier, or the sun.

    Notes
    -----
    Locked coupling (Willis): :math:`p_s\omega_s + p_r\omega_r = Q\omega_c` with :math:`Q = p_s + p_r` iron poles.
    The outer torques that balance it without loss are in proportion :math:`p_s : p_r : -Q`, so their sum and
    their power both vanish.
    """
    p_s, p_r = float(gear.pole_pairs_sun), float(gear.pole_pairs_ring)
    weight = {Member.SUN: p_s, Member.RING: p_r, Member.CARRIER: -(p_s + p_r)}
    held = Member(held)
    fast, slow = sorted((member for member in Member if member is not held), key=lambda member: abs(weight[member]))
    speed = {held: 0.0, fast: 1.0, slow: -weight[fast] / weight[slow]}
    return Ratios(held, fast, slow, speed, {member: weight[member] / weight[fast] for member in Member})
