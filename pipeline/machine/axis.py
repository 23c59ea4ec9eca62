"""A machine that slides or turns: its units, the ranges of its constants, and the words for both."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.wording.units import IMPERIAL_TORQUE, TORQUE
from pmg.sim.signals import REVOLUTION, RPM

if TYPE_CHECKING:
    from collections.abc import Mapping

DEGREE = math.pi / 180.0
"""One degree [rad]."""


@dataclass(frozen=True)
class Axis:
    """What a machine that slides has other than one that turns.

    Parameters
    ----------
    length, push, mass : str
        SI unit of its position, of what drives it, and of its inertia.
    pushes : str
        What drives it, in a word.
    along : str
        Where a friction that changes with position does so.
    positions, speeds, forces : mapping of str to float
        Units that a channel may have, and what one is in SI; a command in V, A or % needs a factor besides.
    factor : str
        Key of that factor in a case file.
    shown : tuple of (str, float)
        Small unit of the position in which errors are shown, and what one is in SI.
    shown_speed : tuple of (str, float)
        The same of the speed.
    periods, stribeck, presliding : tuple of float
        Ranges of a period of position, of the speed over which friction falls or rises, and of the way over which it
        rises [SI].
    gaps : tuple of float
        Range of the way that a load may fly across [SI].
    turn : float
        Way after which the machine stands as before [rad]; zero of one that slides.
    rises : tuple of float
        Ways after a reversal over which a force is looked for that rises [SI].
    """

    length: str
    push: str
    mass: str
    pushes: str
    along: str
    positions: Mapping[str, float]
    speeds: Mapping[str, float]
    forces: Mapping[str, float]
    factor: str
    shown: tuple[str, float]
    shown_speed: tuple[str, float]
    periods: tuple[float, float]
    stribeck: tuple[float, float]
    presliding: tuple[float, float]
    gaps: tuple[float, float]
    turn: float
    rises: tuple[float, ...]

    @property
    def speed(self) -> str:
        """SI unit of its speed."""
        return f"{self.length}/s"

    @property
    def acceleration(self) -> str:
        """SI unit of its acceleration."""
        return f"{self.length}/s2"

    @property
    def viscous(self) -> str:
        """SI unit of a force per speed."""
        return f"{self.push} s/{self.length}"

    @property
    def stiffness(self) -> str:
        """SI unit of a force per way."""
        return f"{self.push}/{self.length}"

    @property
    def key(self) -> str:
        """Unit of what drives it, as keys of files end."""
        return self.push.replace(" ", "")


LINEAR = Axis(
    length="m",
    push="N",
    mass="kg",
    pushes="force",
    along="slide",
    positions={"m": 1.0, "mm": 1e-3, "um": 1e-6},
    speeds={"m/s": 1.0, "mm/s": 1e-3, "m/min": 1.0 / 60.0, "mm/min": 1e-3 / 60.0},
    forces={"N": 1.0, "kN": 1e3, "V": 1.0, "A": 1.0, "%": 1.0},
    factor="newton_per_unit",
    shown=("mm", 1e-3),
    shown_speed=("mm/s", 1e-3),
    periods=(2e-3, 1e-1),
    stribeck=(1e-3, 1e-1),
    presliding=(1e-6, 1e-2),
    gaps=(1e-5, 1e-2),
    turn=0.0,
    rises=(1e-5, 1e-4, 1e-3),
)
"""A machine that slides."""

ROTARY = Axis(
    length="rad",
    push="N m",
    mass="kg m2",
    pushes="torque",
    along="turn",
    positions={"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "rev": REVOLUTION},
    speeds={"rad/s": 1.0, "rpm": RPM, "deg/s": DEGREE, "rev/s": REVOLUTION},
    forces={**TORQUE, **IMPERIAL_TORQUE, "V": 1.0, "A": 1.0, "%": 1.0},
    factor="newton_metre_per_unit",
    shown=("mrad", 1e-3),
    shown_speed=("rad/s", 1.0),
    periods=(REVOLUTION / 360.0, 20.0 * REVOLUTION),
    stribeck=(2e-2, 1e2),
    presliding=(1e-5, 3.0),
    gaps=(1e-4, 3.0),
    turn=REVOLUTION,
    rises=(1e-3, 1e-2, 1e-1, 1.0),
)
"""A machine that turns."""
