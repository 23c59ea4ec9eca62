"""The whole bench in motion: two motors with their loops, two shafts, three rotors; its equations of motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.dynamics.assumptions import Assumptions
from pmg.sim.dynamics.constants import Constants, Control, MotorConstants, gather
from pmg.sim.dynamics.state import STATES, DrivetrainTorques, MotorState, SetPoints, State
from pmg.sim.errors import BenchError
from pmg.sim.grid import Configuration
from pmg.sim.maps.analytic import analytic_map
from pmg.sim.mechanisms import Instrument
from pmg.sim.mechanisms.base import Instant, Warmth
from pmg.sim.mechanisms.bearings import LookedUpDrag
from pmg.sim.shafts import Member
from pmg.sim.steady.baseline import baseline_mechanisms

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.maps.torque_map import TorqueMap
    from pmg.sim.mechanisms import Mechanism
    from pmg.sim.mechanisms.base import MotionLaw
    from pmg.sim.signals import Array, Number


@dataclass(frozen=True)
class Drivetrain:
    r"""The bench in one of its modes.

    Parameters
    ----------
    bench : BenchParameters
        Its numbers.
    mechanisms : tuple of Mechanism
        Losses, and faults of the transducers, which distort what is recorded and nothing else. Each loss must have a
        law for an instant; those that do not act in this configuration are left out.
    assumptions : Assumptions
        What the source leaves open.
    gear : int
        Stage, 1 or 2.
    configuration : Configuration
        Engaged, or neutral: the carrier between the stages, no magnetic torque.
    held : Member
        The member that the block holds: the carrier, as on the bench, or a rotor, whose motor's shaft is then coupled
        to the free carrier. The source gives no bearing of a turning carrier, so it has magnetic drag only.
    control_sun, control_ring : Control
        What each motor follows.
    torque_map : TorqueMap or None
        Magnetic torques before `map_scale`; the sine that the published pull-out torques imply when not given.
    warmth : Warmth
        Bearings and magnets above ambient, held over the run; it counts where a mechanism asks for it.

    Notes
    -----
    Electrical phase :math:`\varphi = p_s\theta_s + p_r\theta_r - Q\theta_c`; the magnetic torques are the slopes of
    one energy, so they cancel over the three members. Blocks as in the thesis, chapter 5; the maps there are
    finite-element tables that are not printed.
    """

    bench: BenchParameters
    mechanisms: tuple[Mechanism, ...] = ()
    assumptions: Assumptions = field(default_factory=Assumptions)
    gear: int = 1
    configuration: Configuration = Configuration.ENGAGED
    held: Member = Member.CARRIER
    control_sun: Control = Control.TORQUE
    control_ring: Control = Control.TORQUE
    torque_map: TorqueMap | None = None
    warmth: Warmth = field(default_factory=Warmth)

    def __post_init__(self) -> None:
        self.bench.gear(self.gear)
        if self.configuration not in (Configuration.NEUTRAL, Configuration.ENGAGED):
            raise BenchError("drivetrain", f"'{self.configuration}'", "neutral or engaged", "Choose one of them.")
        if self.configuration is Configuration.NEUTRAL and self.held is not Member.CARRIER:
            do, came = "Engage the gear, or hold the carrier.", f"the {self.held} held in neutral"
            raise BenchError("drivetrain", f"{came}: nothing turns the free carrier", "engaged", do)
        if self.held is not Member.CARRIER and not self.assumptions.carrier_in_map:
            came = f"the {self.held} held, and a map that does not see the carrier"
            raise BenchError("drivetrain", came, "the carrier held", "Hold the carrier, or set carrier_in_map.")
        if self.held is Member.SUN and self.torque_map is not None and not self.torque_map.follows_phase:
            do = "Hold another member, or leave cogging out."
            raise BenchError("drivetrain", "the sun held, and a map with cogging", "one that follows the phase", do)
        _ = self.losses  # a mechanism without a law is refused here

    @classmethod
    def calibrated(
        cls, bench: BenchParameters, model: LossModel, assumptions: Assumptions | None = None, gear: int = 1
    ) -> Drivetrain:
        """The baseline with the losses of a calibration, engaged, torque-controlled."""
        return cls(bench, baseline_mechanisms(model, bench), assumptions or Assumptions(), gear)

    @cached_property
    def losses(self) -> tuple[MotionLaw, ...]:
        """The mechanisms that act in this configuration, at the warmth that is held."""
        laws = (mechanism.in_motion(self.configuration, self.warmth) for mechanism in self.mechanisms)
        signed = self.assumptions.friction_signed
        return tuple(
            law if signed or not isinstance(law, LookedUpDrag) else replace(law, signed=False)
            for law in laws
            if law is not None
        )

    @cached_property
    def instruments(self) -> tuple[Instrument, ...]:
        """The faults of the transducers."""
        return tuple(mechanism for mechanism in self.mechanisms if isinstance(mechanism, Instrument))

    @cached_property
    def field_left(self) -> float:
        """Factor on the magnetic torques that the warmth of the magnets leaves."""
        return math.prod(mechanism.field_left(self.warmth) for mechanism in self.mechanisms)

    @cached_property
    def unlimited(self) -> Drivetrain:
        """The same bench with motors that have no limits: its steady states and small motions inside them."""
        if not self.assumptions.motor_limits:
            return self
        return replace(self, assumptions=replace(self.assumptions, motor_limits=False))

    @cached_property
    def constants(self) -> Constants:
        """The numbers of the equations, gathered once."""
        return gather(self.bench, self.assumptions, self.gear, self.held, self.control_sun, self.control_ring)

    @cached_property
    def coupling(self) -> TorqueMap | None:
        """The magnetic torques at their scale; none in neutral."""
        if self.configuration is Configuration.NEUTRAL:
            return None
        scale = self.assumptions.map_scale * self.field_left
        given = self.torque_map
        return given.scaled(scale) if given is not None else analytic_map(self.bench.gear(self.gear), scale)

    @cached_property
    def centre(self) -> float:
        """Phase at which the unloaded gear rests [rad]: the middle of its magnetic well; 0 in neutral."""
        return 0.0 if self.coupling is None else float(self.coupling.load_angle(np.zeros(1))[0])

    def at_rest(self, phase: float | None = None) -> Array:
        """State at rest with nothing applied, at a phase from the middle of the well [rad]; the assumed one if none."""
        begin = self.centre + (self.assumptions.start_phase if phase is None else phase)
        return np.array(State(*np.zeros(len(STATES)))._replace(phase=begin), dtype=np.float64)

    def angle_sun(self, state: Iterable[Number]) -> Number:
        """Angle of the sun against the carrier [rad], as the map sees it; from phase and held angle."""
        x, q = State(*state), self.constants
        if q.ring_held:
            return (x.phase + q.p_r * (x.angle_sun - x.angle_block)) / q.Q
        return x.angle_sun - x.angle_block if q.carrier_seen else x.angle_sun

    def magnetic(self, state: Iterable[Number]) -> tuple[Number, Number, Number]:
        """Torques of the field on sun and ring [N m] and its energy [J]."""
        x = State(*state)
        return (0.0, 0.0, 0.0) if self.coupling is None else self.coupling.law(x.phase, self.angle_sun(x))

    def coupled(self, sun: Number, ring: Number, carrier: Number) -> tuple[Number, Number, Number]:
        """Of a value for each member: those of what the sun motor turns, the ring motor turns, and the block holds.

        It is its own inverse: of what the two joints and the block give, those of sun, ring and carrier.
        """
        if self.constants.ring_held:
            return sun, carrier, ring
        return (carrier, ring, sun) if self.constants.sun_held else (sun, ring, carrier)

    def _outside(self, x: State) -> tuple[Number, Number, Number]:
        """Torques of both joints and of the block [N m]."""
        q = self.constants
        by_sun, by_ring, held = self.coupled(x.speed_sun, x.speed_ring, x.speed_carrier)
        joint_sun = q.k * x.twist_sun + q.c * (x.speed_sun_motor - by_sun)
        joint_ring = q.k * x.twist_ring + q.c * (x.speed_ring_motor - by_ring)
        return joint_sun, joint_ring, -(q.k * x.angle_block + q.c * held)

    def drags(self, state: Iterable[Number]) -> tuple[tuple[Number, Number, Number], ...]:
        """Torques of each mechanism on sun, ring and carrier [N m]."""
        x, q = State(*state), self.constants
        _, joint_ring, block = self._outside(x)
        now = Instant(x.speed_sun, x.speed_ring, block if q.ring_held else joint_ring, q.ratio, q.rest)
        found = []
        for law in self.losses:
            drag = law.at_instant(now)
            found.append((drag.sun, drag.ring, law.carrier_law(x.speed_carrier, q.rest)))
        return tuple(found)

    def _motor(
        self, side: MotorConstants, loop: Sequence[Number], joint: Number, asked: Number, slope: Number
    ) -> MotorState:
        """One motor with its torque loop, equations 5.5 to 5.11, and the speed loop around it where there is one."""
        q = self.constants
        w, i, integral, feedback, filtered, angle_lag = loop
        acceleration = (q.K_c * i - side.friction * w - joint) / (side.inertia + side.rotor_inertia)
        d_angle_lag = -angle_lag
        if side.by_speed:
            d_angle_lag = asked - w
            asked, slope = (
                q.K_v * (d_angle_lag + angle_lag / q.T_v),
                q.K_v * (slope - acceleration + d_angle_lag / q.T_v),
            )
        torque_out = q.K_c * i - side.friction * w - side.hidden_inertia * acceleration
        d_feedback = (torque_out - feedback) / q.tau
        error = q.K_set * asked - q.K_fb * feedback
        d_filtered = q.N * (error - filtered)
        derivative = q.K_set * slope - q.K_fb * d_feedback if q.ideal else d_filtered
        voltage = self._limited(q.K_A * (q.K_p * error + q.K_i * integral + q.K_d * derivative), side, w, i)
        d_current = (voltage - side.back_emf * w - q.R * i) / q.L
        return MotorState(acceleration, d_current, error, d_feedback, d_filtered, d_angle_lag, torque_out, voltage)

    def _limited(self, voltage: Number, side: MotorConstants, w: Number, i: Number) -> Number:
        """What is left of a voltage by the drive's limit of the current and by the bus, which has the last word."""
        q = self.constants
        if not q.limited:
            return voltage
        held = side.back_emf * w + q.R * i - q.L * i / q.T_limit
        reach = q.L * q.i_peak / q.T_limit
        voltage = np.minimum(np.maximum(voltage, held - reach), held + reach)
        return np.minimum(np.maximum(voltage, -q.U_bus), q.U_bus)

    def motion(self, state: Iterable[Number], asked: SetPoints) -> DrivetrainTorques:
        """Torques at an instant: plain arithmetic on floats, complex numbers or arrays with further axes."""
        x, q = State(*state), self.constants
        joint_sun, joint_ring, block = self._outside(x)
        magnetic_sun, magnetic_ring, _ = self.magnetic(x)
        drags = self.drags(x)
        loop_sun = (x.speed_sun_motor, x.current_sun, x.integral_sun, x.feedback_sun, x.filtered_sun, x.angle_lag_sun)
        loop_ring = (
            x.speed_ring_motor,
            x.current_ring,
            x.integral_ring,
            x.feedback_ring,
            x.filtered_ring,
            x.angle_lag_ring,
        )
        return DrivetrainTorques(
            joint_sun=joint_sun,
            joint_ring=joint_ring,
            block=block,
            magnetic_sun=magnetic_sun,
            magnetic_ring=magnetic_ring,
            magnetic_carrier=-(magnetic_sun + magnetic_ring),
            drag_sun=sum((sun for sun, _, _ in drags), 0.0),
            drag_ring=sum((ring for _, ring, _ in drags), 0.0),
            drag_carrier=sum((carrier for _, _, carrier in drags), 0.0),
            sun=self._motor(q.sun, loop_sun, joint_sun, asked.sun, asked.slope_sun),
            ring=self._motor(q.ring, loop_ring, joint_ring, asked.ring, asked.slope_ring),
        )

    def rates(self, state: Iterable[Number], asked: SetPoints) -> State:
        """Time derivative of the state: the equations of motion, written once for every solver."""
        x, q = State(*state), self.constants
        m = self.motion(x, asked)
        by_sun, by_ring, held = self.coupled(x.speed_sun, x.speed_ring, x.speed_carrier)
        on_sun, on_ring, on_carrier = self.coupled(m.joint_sun, m.joint_ring, m.block)
        return State(
            twist_sun=x.speed_sun_motor - by_sun,
            twist_ring=x.speed_ring_motor - by_ring,
            phase=q.p_s * x.speed_sun + q.p_r * x.speed_ring - q.Q_map * x.speed_carrier,
            angle_block=held,
            speed_carrier=(on_carrier + m.magnetic_carrier + m.drag_carrier) / q.J_c,
            speed_sun_motor=m.sun.acceleration,
            speed_sun=(on_sun + m.magnetic_sun + m.drag_sun) / q.J_s,
            speed_ring=(on_ring + m.magnetic_ring + m.drag_ring) / q.J_r,
            speed_ring_motor=m.ring.acceleration,
            current_sun=m.sun.d_current,
            integral_sun=m.sun.error,
            feedback_sun=m.sun.d_feedback,
            filtered_sun=m.sun.d_filtered,
            current_ring=m.ring.d_current,
            integral_ring=m.ring.error,
            feedback_ring=m.ring.d_feedback,
            filtered_ring=m.ring.d_filtered,
            angle_lag_sun=m.sun.d_angle_lag,
            angle_lag_ring=m.ring.d_angle_lag,
            angle_sun=x.speed_sun,
        )
