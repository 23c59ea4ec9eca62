"""The whole bench in motion: two motors with their torque loops, two shafts, three rotors; its equations of motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.assumptions import Assumptions
from pmg.sim.dynamics.constants import Constants, Side, gather
from pmg.sim.dynamics.state import STATES, Motion, MotorState, SetTorques, State
from pmg.sim.errors import BenchError
from pmg.sim.grid import Configuration
from pmg.sim.mechanisms import RotorLaw

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.mechanisms import Mechanism
    from pmg.sim.signals import Array, Number


@dataclass(frozen=True)
class Drivetrain:
    r"""The bench with one stage engaged, both motors torque-controlled.

    Parameters
    ----------
    bench : BenchParameters
        Its numbers.
    mechanisms : tuple of Mechanism
        Losses; each must be a `RotorLaw`. Those that do not act when engaged are left out.
    assumptions : Assumptions
        What the source leaves open.
    gear : int
        Stage, 1 or 2.

    Notes
    -----
    Electrical phase :math:`\varphi = p_s\theta_s + p_r\theta_r - Q\theta_c`; the field energy
    :math:`-(\hat T/p_s)\cos\varphi` gives the torques :math:`\hat T\sin\varphi` and
    :math:`(p_r/p_s)\hat T\sin\varphi` against sun and ring and their sum on the carrier, so they cancel over the
    three. Blocks as in the thesis, chapter 5; the maps there are finite-element tables that are not printed.
    """

    bench: BenchParameters
    mechanisms: tuple[Mechanism, ...] = ()
    assumptions: Assumptions = field(default_factory=Assumptions)
    gear: int = 1

    def __post_init__(self) -> None:
        self.bench.gear(self.gear)
        for mechanism in self.mechanisms:
            if not isinstance(mechanism, RotorLaw):
                raise BenchError(
                    f"drivetrain: {mechanism.title}",
                    "a mechanism that is no law of the speeds alone",
                    "a RotorLaw",
                    "Leave it out of the transient or give it a law.",
                )

    @classmethod
    def calibrated(
        cls, bench: BenchParameters, model: LossModel, assumptions: Assumptions | None = None, gear: int = 1
    ) -> Drivetrain:
        """The baseline with the losses of a calibration."""
        return cls(bench, model.mechanisms(bench), assumptions or Assumptions(), gear)

    @cached_property
    def losses(self) -> tuple[RotorLaw, ...]:
        """The mechanisms that act with the gear engaged."""
        laws = (m for m in self.mechanisms if isinstance(m, RotorLaw))
        return tuple(law for law in laws if Configuration.ENGAGED in law.acts_in)

    @cached_property
    def constants(self) -> Constants:
        """The numbers of the equations, gathered once."""
        return gather(self.bench, self.assumptions, self.gear)

    def at_rest(self) -> Array:
        """State at rest with nothing applied, at the assumed phase."""
        return np.array(State(*np.zeros(len(STATES)))._replace(phase=self.assumptions.start_phase), dtype=np.float64)

    def _motor(self, side: Side, loop: Sequence[Number], joint: Number, asked: Number, slope: Number) -> MotorState:
        """One motor with its torque loop, equations 5.5 to 5.11."""
        q = self.constants
        w, i, integral, feedback, filtered = loop
        acceleration = (q.K_c * i - side.friction * w - joint) / (side.inertia + side.rotor_inertia)
        torque_out = q.K_c * i - side.friction * w - (side.rotor_inertia * acceleration if q.sensed else 0.0)
        d_feedback = (torque_out - feedback) / q.tau
        error = q.K_set * asked - q.K_fb * feedback
        d_filtered = q.N * (error - filtered)
        derivative = q.K_set * slope - q.K_fb * d_feedback if q.ideal else d_filtered
        voltage = q.K_A * (q.K_p * error + q.K_i * integral + q.K_d * derivative)
        d_current = (voltage - side.back_emf * w - q.R * i) / q.L
        return MotorState(acceleration, d_current, error, d_feedback, d_filtered, torque_out, voltage)

    def motion(self, state: Iterable[Number], asked: SetTorques) -> Motion:
        """Torques at an instant: plain arithmetic on floats, complex numbers or arrays with further axes."""
        x, q = State(*state), self.constants
        joint_sun = q.k * x.twist_sun + q.c * (x.speed_sun_motor - x.speed_sun)
        joint_ring = q.k * x.twist_ring + q.c * (x.speed_ring_motor - x.speed_ring)
        magnetic_sun = q.T_max * np.sin(x.phase)
        magnetic_ring = q.p_r / q.p_s * magnetic_sun
        drag_sun: Number = 0.0
        drag_ring: Number = 0.0
        drag_carrier: Number = 0.0
        for law in self.losses:
            drag = law.law(x.speed_sun, x.speed_ring, q.rest)
            drag_sun, drag_ring = drag_sun + drag.sun, drag_ring + drag.ring
            drag_carrier = drag_carrier + law.carrier_law(x.speed_carrier, q.rest)
        loop_sun = (x.speed_sun_motor, x.current_sun, x.integral_sun, x.feedback_sun, x.filtered_sun)
        loop_ring = (x.speed_ring_motor, x.current_ring, x.integral_ring, x.feedback_ring, x.filtered_ring)
        return Motion(
            joint_sun=joint_sun,
            joint_ring=joint_ring,
            block=-(q.k * x.angle_carrier + q.c * x.speed_carrier),
            magnetic_sun=-magnetic_sun,
            magnetic_ring=-magnetic_ring,
            magnetic_carrier=q.Q / q.p_s * magnetic_sun,
            drag_sun=drag_sun,
            drag_ring=drag_ring,
            drag_carrier=drag_carrier,
            sun=self._motor(q.sun, loop_sun, joint_sun, asked.sun, asked.slope_sun),
            ring=self._motor(q.ring, loop_ring, joint_ring, asked.ring, asked.slope_ring),
        )

    def rates(self, state: Iterable[Number], asked: SetTorques) -> State:
        """Time derivative of the state: the equations of motion, written once for every solver."""
        x, q = State(*state), self.constants
        m = self.motion(x, asked)
        return State(
            twist_sun=x.speed_sun_motor - x.speed_sun,
            twist_ring=x.speed_ring_motor - x.speed_ring,
            phase=q.p_s * x.speed_sun + q.p_r * x.speed_ring - q.Q_map * x.speed_carrier,
            angle_carrier=x.speed_carrier,
            speed_carrier=(m.block + m.magnetic_carrier + m.drag_carrier) / q.J_c,
            speed_sun_motor=m.sun.acceleration,
            speed_sun=(m.joint_sun + m.magnetic_sun + m.drag_sun) / q.J_s,
            speed_ring=(m.joint_ring + m.magnetic_ring + m.drag_ring) / q.J_r,
            speed_ring_motor=m.ring.acceleration,
            current_sun=m.sun.d_current,
            integral_sun=m.sun.error,
            feedback_sun=m.sun.d_feedback,
            filtered_sun=m.sun.d_filtered,
            current_ring=m.ring.d_current,
            integral_ring=m.ring.error,
            feedback_ring=m.ring.d_feedback,
            filtered_ring=m.ring.d_filtered,
            angle_sun=x.speed_sun,
        )
