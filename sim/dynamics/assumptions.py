"""Assumptions where the thesis is silent about the moving bench: one named option each, with default and reason."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from pmg.sim.errors import BenchError
from pmg.sim.steady.power_chain import MotorConvention


class RotorInertia(StrEnum):
    """Where the inertia of a motor's rotor sits, seen from the torque that is fed back; each motor has its own.

    ``BEHIND_SENSOR``: the rotor turns between air gap and sensor, so the loop makes up for it and, while the loop
    is fast, the shaft does not feel it (thesis, equation 5.11).
    ``AHEAD_OF_SENSOR``: what is fed back is the torque before the rotor, so the rotor adds to the shaft's inertia.
    ``ABSENT``: no rotor inertia.
    """

    BEHIND_SENSOR = "behind sensor"
    AHEAD_OF_SENSOR = "ahead of sensor"
    ABSENT = "absent"


RANGES: dict[str, tuple[float, float, str]] = {
    "sensor_lag": (1e-5, 10.0, "s"),
    "derivative_filter": (1e-1, 1e9, "1/s"),
    "map_scale": (1e-3, 1e3, "1"),
    "friction_rest_width": (1e-3, 10.0, "rad/s"),
    "start_phase": (-math.pi, math.pi, "rad"),
    "speed_gain": (1e-4, 10.0, "N m s/rad"),
    "speed_reset": (1e-2, 1e3, "s"),
}
"""Allowed range and unit of each number."""

CHOICES: dict[str, type[StrEnum]] = {
    "motor_signs": MotorConvention,
    "rotor_inertia_sun": RotorInertia,
    "rotor_inertia_ring": RotorInertia,
}
"""Words that each choice among several takes."""


@dataclass(frozen=True)
class Assumptions:
    """Choices that the source does not make.

    Parameters
    ----------
    sensor_lag : float
        Time constant of the torque feedback [s]. A first-order lag is named, its constant is not; 10 ms is short
        against the magnetic oscillation (16 Hz) and long against the joints.
    derivative_filter : float or None
        Corner N of the PID's derivative filter [1/s]; None is the ideal derivative of equation 5.6. With N = 100,
        a frequent block default, the loop is unstable for lags up to 0.03 s; see `check_control`.
    motor_signs : MotorConvention
        ``CONSISTENT`` (default): one constant for torque and back-EMF, physical signs on both sides, nothing created.
        ``THESIS``: K_c and K_e, and on the ring the back-EMF, friction and rotor inertia with the sign turned
        (sections 5.4.1 and 5.4.2). Shaft torques at steady speed do not depend on it.
    rotor_inertia_sun, rotor_inertia_ring : RotorInertia
        Whether that shaft feels its motor's rotor. Default: equation 5.11 as written. Counting it in the sun's shaft
        slows the published run by some 4 rpm after 20 s, towards the printed 485 rpm; in the ring's by 0.6 rpm more.
    map_scale : float
        Factor on the design pull-out torques [1]. The maps used are called scaled down, the factor is not given;
        1 is the design. Steady torques do not depend on it.
    friction_rest_width : float
        Width of the smooth passage of friction through rest [rad/s]. Dry friction jumps there in the source; 0.5
        is below the slowest test by a factor of ten.
    friction_signed : bool
        Whether the bearings' look-ups turn with the direction of rotation (default: friction opposes motion). False
        is what the block diagrams of the source draw (figures 5.11 to 5.13): the look-up is subtracted on the sun and
        added on the ring whichever way they turn, at rest too. What a look-up gives below rest is not stated; here it
        keeps its value at rest.
    motor_limits : bool
        Whether the amplifiers are limited to bus voltage and peak current. The model of the source has no limit; the
        bench has. The PID's integral goes on meanwhile: none of its settings says otherwise.
    carrier_in_map : bool
        Whether the map's argument contains the carrier's angle. True is what magnetism asks for and conserves
        energy; False is the source's look-up, which sees sun and ring only.
    start_phase : float
        Electrical phase at rest [rad]. All states start at zero in the source, yet its figure shows an oscillation
        that a start in the middle of the well does not make; 0 is what is written.
    speed_gain, speed_reset : float
        Proportional gain [N m s/rad] and reset time [s] of the outer loop of a speed-controlled motor. The source
        holds speeds by the drives' own loop and gives no numbers. With 0.05 the engaged bench follows at about
        10 rad/s, ten times slower than the magnetic oscillation; steady torques do not depend on either.
    """

    sensor_lag: float = 0.010
    derivative_filter: float | None = None
    motor_signs: MotorConvention = MotorConvention.CONSISTENT
    rotor_inertia_sun: RotorInertia = RotorInertia.BEHIND_SENSOR
    rotor_inertia_ring: RotorInertia = RotorInertia.BEHIND_SENSOR
    map_scale: float = 1.0
    friction_rest_width: float = 0.5
    friction_signed: bool = True
    motor_limits: bool = True
    carrier_in_map: bool = True
    start_phase: float = 0.0
    speed_gain: float = 0.05
    speed_reset: float = 1.0

    def __post_init__(self) -> None:
        for name, (low, high, unit) in RANGES.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                expected = f"{low:g} to {high:g} {unit}"
                raise BenchError(f"assumption {name}", f"{value:g} {unit}", expected, "Choose a value in that range.")
        for name, kind in CHOICES.items():
            if not isinstance(getattr(self, name), kind):
                names = " or ".join(f"'{choice.value}'" for choice in kind)
                raise BenchError(f"assumption {name}", repr(getattr(self, name)), names, f"Choose a {kind.__name__}.")
