"""The bench as built, drawn around the data sheet for each campaign: shafts, gear, drag curves, drives, noise."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.trials.motion import places as at
from pmg.sim.shafts import PerShaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.signals import Array

POLE_PAIRS = PerShaft(5, 13)
"""Pole pairs of the rotors of the engaged stage."""
RATIO = POLE_PAIRS.ring / POLE_PAIRS.sun
MOTOR_INERTIA, ROTOR_INERTIA = 1.08e-3, PerShaft(1.65e-3, 21.8e-3)
"""Inertias of the data sheet [kg m2]."""
STIFFNESS, PULL_OUT = 4000.0, 0.514
"""Stiffness of a coupling [N m/rad] and the magnetic spring's torque per pole pair [N m], of the data sheet."""
LOAD_REFERENCE = PerShaft(0.75, 1.95)
"""Torque that a size is given at [N m]."""
FASTEST = PerShaft(196.0, 75.4)
"""Highest speeds [rad/s]."""
CURVES = ("power", "inverse sine", "saturating", "two powers")


@dataclass(frozen=True)
class RotorDrag:
    """Drag of a rotor's bearings in either direction, ``low`` at rest and ``low + rise`` at 100 rad/s [N m].

    Parameters
    ----------
    curve : str
        One of `CURVES`.
    low, rise : float
        [N m].
    shape : float
        Power; knee over 100 rad/s; speed of half the way over 100 rad/s.
    """

    curve: str
    low: float
    rise: float
    shape: float

    def drag(self, speed: Array) -> Array:
        """Drag at speeds from zero on [N m]."""
        x, c = speed / 100.0, self.shape
        if self.curve == "power":
            risen = x**c
        elif self.curve == "inverse sine":
            risen = np.arcsinh(x / c) / np.arcsinh(1.0 / c)
        elif self.curve == "saturating":
            risen = x * (1.0 + c) / (x + c)
        else:
            risen = 0.6 * x**c + 0.4 * x ** (0.5 + c)
        return np.asarray(self.low + self.rise * risen)


@dataclass(frozen=True)
class Drive:
    """A regulated drive.

    Parameters
    ----------
    bandwidth : float
        Of the regulated speed [Hz].
    integral_time : float
        Of its integral part [s].
    forward : float
        Part of the torque for acceleration that is fed forward.
    lag : float
        Time constant of the motor's torque [s].
    largest : float
        Torque that it asks for at most [N m].
    speed_filter : float
        Part of a new speed that it takes in at each sample.
    torque_error : float
        Relative error of a torque that it is asked for.
    """

    bandwidth: float
    integral_time: float
    forward: float
    lag: float
    largest: float
    speed_filter: float
    torque_error: float


@dataclass(frozen=True)
class Shaft:
    """A motor, its coupling and a rotor; SI."""

    motor_inertia: float
    rotor_inertia: float
    stiffness: float
    damping: float
    motor_dry: float
    motor_viscous: float
    eddy: float
    turning_width: float
    drag: RotorDrag
    drive: Drive

    def direction(self, speed: Array) -> Array:
        """Sense in which friction acts at some speeds [rad/s], smooth about standstill: between -1 and 1."""
        return np.asarray(speed / np.hypot(speed, self.turning_width))

    def friction(self, speed: Array) -> Array:
        """Drag of the rotor with its sign [N m], without what an effect adds."""
        return self.drag.drag(np.abs(speed)) * self.direction(speed)


@dataclass(frozen=True)
class MotionNoise:
    """How readings scatter.

    Parameters
    ----------
    white : PerShaft of float
        Standard deviation of a torque sample [N m].
    wander : float
        Standard deviation of the slow part of a torque [N m].
    times : tuple of float
        Its correlation times, of equal parts [s].
    zero : PerShaft of float
        Torque read at none [N m].
    reaction : float
        Standard deviation of the static torque of a shaft that is held [N m].
    ripple : PerShaft of (once, twice)
        Amplitudes a turn of the torque read [N m].
    jitter : float
        Standard deviation of the time of a sample [s].
    begins_anew : bool
        Whether the counters begin each run at another place of the turn, as incremental encoders without a mark do.
    """

    white: PerShaft[float]
    wander: float
    times: tuple[float, ...]
    zero: PerShaft[float]
    reaction: float
    ripple: PerShaft[tuple[float, float]]
    jitter: float
    begins_anew: bool


@dataclass(frozen=True)
class MovingBench:
    """One bench as built."""

    shafts: PerShaft[Shaft]
    pull_out: float
    slip_damping: float
    noise: MotionNoise

    @property
    def truth(self) -> dict[str, Any]:
        """All its numbers, ready for JSON."""
        return asdict(self)


def draw_bench(rng: np.random.Generator) -> MovingBench:
    """A bench within the tolerances of its data sheet."""
    return MovingBench(
        shafts=PerShaft(_draw_shaft(rng, "sun"), _draw_shaft(rng, "ring")),
        pull_out=PULL_OUT * _near(rng, 0.03),
        slip_damping=6.5e-4 * _near(rng, 0.08),
        noise=_draw_noise(rng),
    )


def _draw_shaft(rng: np.random.Generator, side: str) -> Shaft:
    motor, rotor = MOTOR_INERTIA * _near(rng, 0.03), ROTOR_INERTIA[side] * _near(rng, 0.05)
    low, rise = PerShaft((0.008, 0.018), (0.02, 0.045))[side], PerShaft((0.065, 0.08), (0.22, 0.27))[side]
    curve = str(rng.choice(CURVES))
    shapes = {"power": (0.38, 0.62), "inverse sine": (0.04, 0.2), "saturating": (0.3, 0.9), "two powers": (0.3, 0.5)}
    drive = Drive(
        bandwidth=float(np.exp(rng.uniform(np.log(4.0), np.log(12.0)))),
        integral_time=rng.uniform(0.08, 0.4),
        forward=rng.uniform(0.0, 1.0),
        lag=rng.uniform(0.8e-3, 3e-3),
        largest=rng.uniform(5.0, 9.0),
        speed_filter=rng.uniform(0.3, 0.8),
        torque_error=0.01 * rng.standard_normal(),
    )
    return Shaft(
        motor_inertia=motor,
        rotor_inertia=rotor,
        stiffness=STIFFNESS * _near(rng, 0.2),
        damping=rng.uniform(1.0, 3.0),
        motor_dry=rng.uniform(0.014, 0.03),
        motor_viscous=rng.uniform(7e-4, 1.1e-3),
        eddy=rng.uniform(1.7e-4, 2.8e-4),
        turning_width=rng.uniform(0.15, 0.4),
        drag=RotorDrag(curve, rng.uniform(*low), rng.uniform(*rise), rng.uniform(*shapes[curve])),
        drive=drive,
    )


def _draw_noise(rng: np.random.Generator) -> MotionNoise:
    return MotionNoise(
        white=PerShaft(rng.uniform(9e-3, 14e-3), rng.uniform(17e-3, 22e-3)),
        wander=rng.uniform(0.7e-3, 1.2e-3),
        times=tuple(np.exp(rng.uniform(0.0, np.log(100.0), int(rng.integers(1, 3)))).tolist()),
        zero=PerShaft(2e-3 * rng.standard_normal(), 2e-3 * rng.standard_normal()),
        reaction=rng.uniform(1e-3, 4e-3) if rng.random() < 0.5 else 0.0,
        ripple=PerShaft(*((rng.uniform(0.1e-3, 0.8e-3), rng.uniform(0.1e-3, 0.5e-3)) for _ in range(2))),
        jitter=rng.uniform(0.2e-6, 2e-6),
        begins_anew=bool(rng.random() < 0.5),
    )


def _near(rng: np.random.Generator, relative: float) -> float:
    """A factor about 1, within three standard deviations."""
    return 1.0 + relative * float(np.clip(rng.standard_normal(), -3.0, 3.0))


def shaft_numbers(bench: MovingBench) -> Array:
    """Numbers of both shafts for the kernel, without any effect, (2, SHAFT_NUMBERS)."""
    found = np.zeros((2, at.SHAFT_NUMBERS))
    for row, (side, shaft) in zip(found, bench.shafts.items(), strict=True):
        drive, inertia = shaft.drive, shaft.motor_inertia + shaft.rotor_inertia
        proportional = REVOLUTION * drive.bandwidth * inertia
        for place, value in {
            at.MOTOR_INERTIA: shaft.motor_inertia,
            at.ROTOR_INERTIA: shaft.rotor_inertia,
            at.STIFFNESS: shaft.stiffness,
            at.DAMPING: shaft.damping,
            at.POLES: POLE_PAIRS[side],
            at.MOTOR_DRY: shaft.motor_dry,
            at.MOTOR_VISCOUS: shaft.motor_viscous,
            at.EDDY: shaft.eddy,
            at.TURNING_WIDTH: shaft.turning_width,
            at.DRIVE_LAG: drive.lag,
            at.PROPORTIONAL: proportional,
            at.INTEGRAL: proportional / drive.integral_time,
            at.FORWARD: drive.forward * inertia,
            at.LARGEST_TORQUE: drive.largest,
            at.SPEED_FILTER: drive.speed_filter,
            at.SOFT_TWIST: np.inf,
            at.BRISTLE_SPAN: 1.0,
            at.LOAD_REFERENCE: LOAD_REFERENCE[side],
            at.LOAD_POWER: 1.0,
            at.LIMIT: np.inf,
        }.items():
            row[place] = value
    return found


def gear_numbers(bench: MovingBench) -> Array:
    """Numbers of the engaged gear for the kernel, without any effect, (GEAR_NUMBERS,)."""
    found = np.zeros(at.GEAR_NUMBERS)
    found[[at.PULL_OUT, at.SLIP_DAMPING, at.HYSTERESIS_SPAN]] = bench.pull_out, bench.slip_damping, 1.0
    return found
