"""The numbers of the equations of motion, from the bench and the assumptions."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, NamedTuple

from pmg.sim.bench import speed_ratio
from pmg.sim.dynamics.assumptions import Assumptions, RotorInertia
from pmg.sim.shafts import Member
from pmg.sim.steady.power_chain import MotorConvention

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters, MotorParameters
    from pmg.sim.signals import Number


CURRENT_LIMITER = 1e-4
"""Time in which a drive that limits its current gets there [s]; the source has none. Short against L/R = 7 ms."""


class Control(StrEnum):
    """Demand that a motor follows."""

    TORQUE = "torque"
    SPEED = "speed"


class MotorConstants(NamedTuple):
    """Constants of one motor and its shaft.

    `sign` is -1 where the thesis turns the load side's signs; `hidden_inertia` is that of the rotor where the torque
    fed back is the one behind it, else 0.
    """

    sign: float
    inertia: float
    rotor_inertia: float
    back_emf: float
    friction: float
    hidden_inertia: float
    by_speed: bool


class Constants(NamedTuple):
    """The numbers of the equations, as plain floats; the flags decide which equations there are."""

    p_s: float
    p_r: float
    Q: float
    Q_map: float
    k: float
    c: float
    J_s: float
    J_c: float
    J_r: float
    R: float
    L: float
    K_c: float
    K_set: float
    K_fb: float
    K_p: float
    K_i: float
    K_d: float
    K_A: float
    U_bus: float
    i_peak: float
    T_limit: float
    K_v: float
    T_v: float
    tau: float
    N: float
    rest: float
    ideal: bool
    limited: bool
    ring_held: bool
    sun_held: bool
    carrier_seen: bool
    sun: MotorConstants
    ring: MotorConstants

    @property
    def ratio(self) -> Number:
        """Magnitude of the speed ratio with the carrier fixed."""
        return speed_ratio(self.p_s, self.p_r)


def gather(
    bench: BenchParameters,
    given: Assumptions,
    number: int,
    held: Member,
    control_sun: Control,
    control_ring: Control,
) -> Constants:
    """Constants of the bench with that stage engaged, as plain floats."""
    gear = bench.gear(number)
    motor, shafts, rotors, loop = bench.motor, bench.shafts, bench.rotors, bench.control
    thesis = given.motor_signs is MotorConvention.THESIS
    sun, ring = (
        _motor_constants(motor, thesis, *of_side)
        for of_side in (
            (1.0, float(shafts.inertia_sun), given.rotor_inertia_sun, control_sun),
            (-1.0 if thesis else 1.0, float(shafts.inertia_ring), given.rotor_inertia_ring, control_ring),
        )
    )
    poles = float(bench.carrier.iron_poles)
    return Constants(
        p_s=float(gear.pole_pairs_sun),
        p_r=float(gear.pole_pairs_ring),
        Q=poles,
        Q_map=poles if given.carrier_in_map else 0.0,
        k=float(shafts.joint_stiffness),
        c=float(shafts.joint_damping),
        J_s=float(rotors.inertia_sun),
        J_c=float(rotors.inertia_carrier),
        J_r=float(rotors.inertia_ring),
        R=float(motor.resistance),
        L=float(motor.inductance),
        K_c=float(motor.torque_constant),
        K_set=float(loop.set_gain),
        K_fb=float(loop.feedback_gain),
        K_p=float(loop.proportional),
        K_i=float(loop.integral),
        K_d=float(loop.derivative),
        K_A=float(loop.amplifier),
        U_bus=float(motor.bus_voltage),
        i_peak=float(motor.peak_current),
        T_limit=CURRENT_LIMITER,
        K_v=given.speed_gain,
        T_v=given.speed_reset,
        tau=given.sensor_lag,
        N=given.derivative_filter or 1.0 / given.sensor_lag,
        rest=given.friction_rest_width,
        ideal=given.derivative_filter is None,
        limited=given.motor_limits,
        ring_held=held is Member.RING,
        sun_held=held is Member.SUN,
        carrier_seen=given.carrier_in_map,
        sun=sun,
        ring=ring,
    )


def _motor_constants(
    motor: MotorParameters, thesis: bool, sign: float, inertia: float, rotor: RotorInertia, control: Control
) -> MotorConstants:
    J_m = sign * float(motor.inertia)
    return MotorConstants(
        sign=sign,
        inertia=inertia,
        rotor_inertia=0.0 if rotor is RotorInertia.ABSENT else J_m,
        back_emf=sign * float(motor.back_emf_constant if thesis else motor.torque_constant),
        friction=sign * float(motor.damping),
        hidden_inertia=J_m if rotor is RotorInertia.BEHIND_SENSOR else 0.0,
        by_speed=control is Control.SPEED,
    )
