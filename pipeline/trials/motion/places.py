"""Places of the numbers that the kernel is given: parameters of a shaft and of the gear, states, inputs, outputs."""

from __future__ import annotations

(
    # as built
    MOTOR_INERTIA,  # kg m2
    ROTOR_INERTIA,  # kg m2
    STIFFNESS,  # of the coupling, N m/rad
    DAMPING,  # of the coupling, N m s/rad
    POLES,  # pole pairs of the rotor
    MOTOR_DRY,  # drag of the motor, upstream of the transducer, N m
    MOTOR_VISCOUS,  # N m s/rad
    EDDY,  # N m s/rad, engaged
    TURNING_WIDTH,  # speed over which dry friction turns its sign, rad/s
    # the drive
    DRIVE_LAG,  # time constant of the motor's torque, s
    PROPORTIONAL,  # N m s/rad
    INTEGRAL,  # N m/rad
    FORWARD,  # torque per acceleration asked for, N m s2/rad
    LARGEST_TORQUE,  # that the regulator asks for, N m
    SPEED_FILTER,  # part of a new speed that the regulator takes in at each sample
    # effects; 0 is none
    GAP,  # half the play of the coupling, rad
    GAP_ROUND,  # width of its corners over the gap; 0 for sharp ones
    SOFTNESS,  # stiffness lost, as a part
    SOFT_TWIST,  # twist beyond which it comes back, rad; infinite for never
    BRISTLE,  # dry friction that goes by bristles instead of at once, N m
    BRISTLE_SPAN,  # rad
    BRISTLE_LAW,  # 0 smooth approach, 1 straight rise and slip
    UNBALANCE,  # N m
    UNBALANCE_PHASE,  # rad
    UNBALANCE_GROWTH,  # growth by the square of the speed over 100 rad/s
    COGGING,  # N m
    COGGING_ORDER,  # a turn
    COGGING_PHASE,  # rad
    COGGING_SECOND,  # part of twice that order
    LOAD_FRICTION,  # N m at the reference load
    LOAD_REFERENCE,  # N m
    LOAD_DEAD,  # load across, over the reference
    LOAD_POWER,
    IRON,  # N m at the reference load and 100 rad/s
    IRON_LOAD_POWER,
    IRON_SPEED_POWER,
    EXTRA_INERTIA,  # kg m2, on the rotor
    EXTRA_STIFFNESS,  # N m/rad
    EXTRA_DAMPING,  # N m s/rad
    CROSS_DRAG,  # N m at 50 rad/s of the other shaft
    LIMIT,  # largest torque of the motor, N m; infinite for none
    LIMIT_SOFT,  # 1 for a limit that is approached, 0 for one that is hit
    SHAFT_NUMBERS,
) = range(43)

(
    PULL_OUT,  # magnetic spring per pole pair, N m
    SLIP_DAMPING,  # of the pole angle, N m s/rad
    THIRD,  # third harmonic of the spring, N m
    FLATNESS,  # of the spring's top
    HYSTERESIS,  # N m per pole pair
    HYSTERESIS_SPAN,  # of pole angle [rad], or of its rate [rad/s]
    HYSTERESIS_LAW,  # 0 bristles, 1 straight rise and slip, 2 sign of the rate
    GEAR_NUMBERS,
) = range(8)

MOTOR_ANGLE, MOTOR_SPEED, ROTOR_ANGLE, ROTOR_SPEED, DRIVE, EXTRA_ANGLE, EXTRA_SPEED, STATES = range(8)
"""States of a shaft: angles [rad], speeds [rad/s], torque of the drive [N m]."""

REFERENCE, MODE, DRAG_SCALE, DRAG_MORE, INPUTS = range(5)
"""Inputs of a shaft at each sample: reference [rad/s] or [N m], mode, factor on the rotor's drag, drag added [N m]."""
HELD, SPEED, TORQUE, FREE = range(4)
"""Modes of a drive."""

ANGLE, TURNING, COUPLING, ROTOR, ROTOR_TURNING, MOTOR_TORQUE, OUTPUTS = range(7)
"""Outputs of a shaft at each sample: the motor's angle [rad] and speed [rad/s], torque in the coupling [N m], the
rotor's angle and speed, torque of the motor [N m]."""
NODES, FINEST = 4096, 256.0
"""Nodes of a drag table over the root of speed, and the speed at its end [rad/s]."""
