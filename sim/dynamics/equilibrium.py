"""Steady states of the whole drivetrain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.sim.dynamics.drivetrain import Drivetrain
from pmg.sim.dynamics.jacobian import STEP, active, dense
from pmg.sim.dynamics.state import STATES, SetPoints, State
from pmg.sim.errors import BenchError
from pmg.sim.roots import ROUNDING, rising_root
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.dynamics.constants import Constants, MotorConstants
    from pmg.sim.maps.torque_map import TorqueMap
    from pmg.sim.signals import Array, Mask, Number

SPEED_CEILING = 1e4
"""Sun speed up to which a balance is sought [rad/s]; fifty times the fastest test."""

_SCAN = 40
"""Steps of the scan for balances; they widen with speed."""

_NEWTON_STEPS = 20
_LOAD_STEPS = 3
"""Steps from a load without drag to one with it; they start the iteration, which does the rest."""


@dataclass(frozen=True)
class Equilibrium:
    """Steady states.

    Parameters
    ----------
    state : (20, n) array
        The states; the sun's angle, a quadrature, is zero.
    balances : (n,) array of int
        Speeds that balance the torques, as far as the scan sees. One where drag grows with speed; else the state
        given is the first that is met from rest. 1 where a speed is asked for.
    """

    state: Array
    balances: npt.NDArray[np.int64]


def equilibrium(drivetrain: Drivetrain, sun: Number, ring: Number) -> Equilibrium:
    r"""Steady states at what the two motors are asked for, by Newton's method on all states at once.

    Parameters
    ----------
    drivetrain : Drivetrain
        Cogging, which averages out over a turn, is left out. In neutral both motors must follow speed.
    sun, ring : number or (n,) array
        Set torques [N m], or speeds [rad/s] where a motor follows speed; engaged, at most one may.

    Raises
    ------
    BenchError
        When no speed balances the torques, when the load is above pull-out, when a motor would have to go beyond its
        limits, or when the iteration fails.

    Notes
    -----
    The start is the rigid, locked gear. With the pole numbers :math:`p_i` and :math:`p_o` of the members that the sun
    motor and the ring motor turn (:math:`p_s` or :math:`p_r`, and :math:`-Q` for a free carrier),
    :math:`\omega_o = -\omega_i p_i/p_o` and :math:`(T_i + \tau_i)/p_i = (T_o + \tau_o)/p_o`.
    """
    asked = SetPoints(
        *(value.astype(np.float64) for value in np.broadcast_arrays(np.atleast_1d(sun), np.atleast_1d(ring)))
    )
    found = _without_limits(drivetrain.unlimited, asked)
    if drivetrain.assumptions.motor_limits:
        _refuse_beyond(drivetrain.constants, asked, found.state)
    return found


def _refuse_beyond(q: Constants, asked: SetPoints, state: Array) -> None:
    """Refuse states in which a motor needs more voltage or current than there is."""
    x = State(*state)
    for name, side in (("sun", q.sun), ("ring", q.ring)):
        current, speed = getattr(x, f"current_{name}"), getattr(x, f"speed_{name}_motor")
        voltage = q.R * current + side.back_emf * speed
        for what, needed, limit, unit in (("voltage", voltage, q.U_bus, "V"), ("current", current, q.i_peak, "A")):
            beyond = np.abs(needed) > limit
            if beyond.any():
                raise BenchError(
                    _at(asked, beyond),
                    f"{abs(float(needed[np.argmax(beyond)])):.4g} {unit} at the {name} motor",
                    f"at most {limit:g} {unit}, its limit of {what}",
                    "Ask for less speed or torque, state motor.bus_voltage and motor.peak_current, or set motor_limits "
                    "= false.",
                )


def _without_limits(drivetrain: Drivetrain, asked: SetPoints) -> Equilibrium:
    """Steady states of a bench whose motors have no limits."""
    coupling = drivetrain.coupling
    if coupling is None:
        return _apart(drivetrain, asked)
    if not coupling.follows_phase:
        mean = replace(drivetrain.assumptions, map_scale=1.0)
        smooth = coupling.without_cogging().scaled(1.0 / drivetrain.field_left)
        drivetrain = replace(drivetrain, torque_map=smooth, assumptions=mean)
        coupling = drivetrain.coupling
        assert coupling is not None
    q = drivetrain.constants
    if q.sun.by_speed and q.ring.by_speed:
        came, do = "both motors follow speed", "Let one of them follow torque."
        raise BenchError("steady state of the drivetrain", came, "one speed, as the gear ties the other to it", do)
    p_in, p_out, _ = drivetrain.coupled(q.p_s, q.p_r, -q.Q)
    leverage = float(p_in / p_out)
    if q.sun.by_speed:
        speed, balances = asked.sun, np.ones(asked.sun.size, dtype=np.int64)
    elif q.ring.by_speed:
        speed, balances = -asked.ring / leverage, np.ones(asked.sun.size, dtype=np.int64)
    else:
        speed, balances = _locked_speed(drivetrain, asked, leverage)
    load = _load(drivetrain, asked, leverage)
    for _ in range(_LOAD_STEPS):
        drag_sun, drag_out = _drags(drivetrain, speed, leverage, load)
        torque_sun = leverage * (asked.ring + drag_out) - drag_sun if q.sun.by_speed else asked.sun
        torque_out = (asked.sun + drag_sun) / leverage - drag_out if q.ring.by_speed else asked.ring
        load = torque_out if not q.ring_held else q.ratio * (torque_sun + drag_sun)
    through = q.p_s / p_in * (torque_sun + drag_sun)
    state = _locked(drivetrain, coupling, speed, leverage, torque_sun, torque_out, through)
    return Equilibrium(_polish(drivetrain, asked, state), balances)


def _apart(drivetrain: Drivetrain, asked: SetPoints) -> Equilibrium:
    """States in neutral, where each motor holds a speed against the drag of its side."""
    q = drivetrain.constants
    if not (q.sun.by_speed and q.ring.by_speed):
        came, do = "a bench in neutral with a motor that follows torque", "Let both follow speed."
        raise BenchError("steady state of the drivetrain", came, "speeds of both", do)
    zero = np.zeros_like(asked.sun)
    x = State(*[zero] * len(STATES))._replace(speed_sun=asked.sun, speed_ring=asked.ring)
    drags = drivetrain.drags(x)
    torques = {name: -sum((drag[i] for drag in drags), zero) for i, name in enumerate(SIDES)}
    x = x._replace(speed_sun_motor=asked.sun, speed_ring_motor=asked.ring)
    for side, constants in (("sun", q.sun), ("ring", q.ring)):
        x = x._replace(**_motor_states(q, constants, side, torques[side], getattr(asked, side)))
    return Equilibrium(_polish(drivetrain, asked, np.array(x)), np.ones(asked.sun.size, dtype=np.int64))


def _load(drivetrain: Drivetrain, asked: SetPoints, leverage: float) -> Array:
    """First guess of the torque put on the ring from outside [N m]: that of a gear without drag."""
    q = drivetrain.constants
    if q.ring_held:
        return np.asarray(-q.p_r / q.Q * asked.ring if q.sun.by_speed else q.ratio * asked.sun)
    return np.asarray(asked.sun / leverage if q.ring.by_speed else asked.ring)


def _polish(drivetrain: Drivetrain, asked: SetPoints, state: Array) -> Array:
    """Newton's method from the states of the rigid, locked gear."""
    taking_part = active(drivetrain)
    corner = np.ix_(taking_part, taking_part)
    for _ in range(_NEWTON_STEPS):
        rates = np.array(np.broadcast_arrays(*drivetrain.rates(state, asked)))[taking_part]
        slopes = np.stack([whole[corner] for whole in dense(drivetrain, state)])
        step = np.linalg.solve(slopes, rates.T[..., None])[..., 0].T
        state = state.copy()
        state[taking_part] -= step
        if (np.abs(step) <= 1e-12 * (np.abs(state[taking_part]) + 1e-3)).all():
            return state
    worst = int(np.argmax(np.abs(step).max(axis=0)))
    largest = int(np.argmax(np.abs(step[:, worst])))
    raise BenchError(
        _at(asked, np.arange(asked.sun.size) == worst),
        f"last Newton step {np.abs(step[largest, worst]):.2g} in {STATES[taking_part[largest]]}",
        "a step below rounding",
        "Choose torques further below pull-out, or wider friction at rest.",
    )


def _at(asked: SetPoints, wrong: Mask) -> str:
    first = int(np.argmax(wrong))
    return f"steady state at {asked.sun[first]:g} N m on the sun, {asked.ring[first]:g} N m on the ring"


def _drags(drivetrain: Drivetrain, speed: Array, leverage: float, load: Array) -> tuple[Array, Array]:
    """Drag on the members of the locked gear that the motors turn, with that torque on the ring [N m]."""
    q = drivetrain.constants
    turned, zero = -leverage * speed, np.zeros_like(speed)
    loaded = {"angle_block": -load / q.k} if q.ring_held else {"twist_ring": load / q.k, "speed_ring_motor": turned}
    x = State(*[zero] * len(STATES))._replace(**_turning(drivetrain, speed, turned), **loaded)
    drags = [drivetrain.coupled(*drag) for drag in drivetrain.drags(x)]
    return sum((drag[0] for drag in drags), zero), sum((drag[1] for drag in drags), zero)


def _turning(drivetrain: Drivetrain, speed: Array, turned: Array) -> dict[str, Array]:
    """States of the speeds of the three members, by those that the motors turn [rad/s]."""
    members = drivetrain.coupled(speed, turned, np.zeros_like(speed))
    return dict(zip(("speed_sun", "speed_ring", "speed_carrier"), members, strict=True))


def _locked_speed(drivetrain: Drivetrain, asked: SetPoints, leverage: float) -> tuple[Array, npt.NDArray[np.int64]]:
    """Sun speed at which the rigid, locked gear balances [rad/s], and how many there are."""
    net, load = asked.sun - leverage * asked.ring, _load(drivetrain, asked, leverage)
    way = np.where(net < 0.0, -1.0, 1.0)
    rest = drivetrain.constants.rest
    speeds = np.concatenate(([0.0], np.geomspace(1e-3 * rest, SPEED_CEILING, _SCAN)))

    def missing(magnitude: Array | npt.NDArray[np.complex128]) -> npt.NDArray[Any]:
        on_sun, out = _drags(drivetrain, np.asarray(way * magnitude), leverage, load)
        return np.asarray(way * (leverage * out - on_sun - net))

    scan = np.stack([missing(np.full(net.shape, speed)) for speed in speeds])
    runaway = np.asarray((scan < 0.0).all(axis=0))
    if runaway.any():
        raise BenchError(
            _at(asked, runaway),
            f"the drag does not balance them below {SPEED_CEILING:g} rad/s",
            "torques that the losses can take up",
            "Bring the sun torque nearer to the ring torque divided by the ratio.",
        )
    over = scan >= 0.0
    first = np.maximum(np.argmax(over, axis=0), 1)

    def with_slope(magnitude: Array) -> tuple[Array, Array]:
        moved = missing(np.asarray(magnitude + 1j * STEP, dtype=np.complex128))
        return np.asarray(np.real(moved)), np.asarray(np.imag(moved) / STEP)

    rounding = ROUNDING * (np.abs(asked.sun) + np.abs(leverage * asked.ring))
    found, _ = rising_root(with_slope, speeds[first - 1], speeds[first], rounding=rounding)
    return way * found, np.count_nonzero(over[1:] != over[:-1], axis=0)


def _locked(
    drivetrain: Drivetrain,
    coupling: TorqueMap,
    speed: Array,
    leverage: float,
    torque_sun: Array,
    torque_out: Array,
    transmitted: Array,
) -> Array:
    """States (20, n) of the rigid, locked gear at that sun speed, in closed form."""
    q, zero = drivetrain.constants, np.zeros_like(speed)
    turned = -leverage * speed
    on_block = -drivetrain.coupled(q.p_s, q.p_r, -q.Q)[2] / q.p_s
    x = State(*[zero] * len(STATES))._replace(
        phase=coupling.load_angle(transmitted),
        angle_block=on_block * transmitted / q.k,
        speed_sun_motor=speed,
        speed_ring_motor=turned,
        **_motor_states(q, q.sun, "sun", torque_sun, speed),
        **_motor_states(q, q.ring, "ring", torque_out, turned),
    )
    return np.array(x._replace(**_turning(drivetrain, speed, turned)))


def _motor_states(q: Constants, side: MotorConstants, name: str, torque: Array, speed: Array) -> dict[str, Array]:
    """States of a motor, its loops and its joint at a steady torque and speed."""
    current = (torque + side.friction * speed) / q.K_c
    return {
        f"twist_{name}": torque / q.k,
        f"current_{name}": current,
        f"integral_{name}": (q.R * current + side.back_emf * speed) / (q.K_A * q.K_i),
        f"feedback_{name}": q.K_set / q.K_fb * torque,
        f"angle_lag_{name}": torque * q.T_v / q.K_v if side.by_speed else np.zeros_like(speed),
    }
