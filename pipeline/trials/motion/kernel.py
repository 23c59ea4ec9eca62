"""Equations of motion of both shafts, compiled, and their integration with the drives' regulators.

Each shaft is a motor and a rotor with an elastic coupling between; engaged, a magnetic spring of the pole angle joins
the rotors. Between samples the classical method of Runge and Kutta takes steps of equal length; bristles, whose rate
grows with speed without bound, follow their own exact solution over a step. The regulators act once a sample.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.files.compiled import compiled
from pmg.pipeline.trials.motion import places as at

if TYPE_CHECKING:
    from typing import TypeAlias

    from pmg.sim.signals import Array

    Numbers: TypeAlias = tuple[Array, Array, Array]  # shafts, gear and drag tables


@compiled
def _direction(speed: float, width: float) -> float:
    """Sign of a speed, smooth about zero."""
    return float(speed / np.sqrt(speed * speed + width * width))


@compiled
def _coupling_torque(shafts: Array, side: int, twist: float, rate: float) -> float:
    """Torque in a coupling [N m]."""
    gap, contact = shafts[side, at.GAP], 1.0
    if gap > 0.0:
        corner = gap * shafts[side, at.GAP_ROUND]
        if corner > 0.0:
            upper, lower = (twist - gap) / corner, (-twist - gap) / corner
            twist = corner * (np.logaddexp(0.0, upper) - np.logaddexp(0.0, lower))
            contact = 0.5 * (2.0 + np.tanh(0.5 * upper) + np.tanh(0.5 * lower))
        elif abs(twist) <= gap:
            return 0.0
        else:
            twist -= np.copysign(gap, twist)
    stiffness = shafts[side, at.STIFFNESS]
    if shafts[side, at.SOFTNESS] != 0.0:
        stiffness *= 1.0 - shafts[side, at.SOFTNESS] / (1.0 + (twist / shafts[side, at.SOFT_TWIST]) ** 2)
    return float(stiffness * twist + contact * shafts[side, at.DAMPING] * rate)


@compiled
def _bristle(law: float, span: float, deflection: float, way: float) -> float:
    """Deflection of bristles after a way at one direction [rad]; exact for both laws."""
    if law == 1.0:
        return float(min(max(deflection + way, -span), span))
    end = np.copysign(span, way)
    return float(end + (deflection - end) * np.exp(-abs(way) / span))


@compiled
def _table_drag(tables: Array, side: int, speed: float) -> float:
    """Drag of a rotor at a speed, without its sign [N m]."""
    way = 0 if speed >= 0.0 else 1
    place = np.sqrt(abs(speed) / at.FINEST) * (at.NODES - 1)
    node = min(int(place), at.NODES - 2)
    low = tables[side, way, node]
    return float(low + (place - node) * (tables[side, way, node + 1] - low))


@compiled
def _rotor_drag(
    shafts: Array, tables: Array, side: int, given: Array, speed: float, carried: float, other: float
) -> float:
    """Drag of a rotor by speed, load and the other shaft's speed, without bristles and magnetic drag [N m]."""
    size = _table_drag(tables, side, speed) * given[side, at.DRAG_SCALE] + given[side, at.DRAG_MORE]
    size -= shafts[side, at.BRISTLE]
    if shafts[side, at.LOAD_FRICTION] != 0.0:
        load, dead = abs(carried) / shafts[side, at.LOAD_REFERENCE], shafts[side, at.LOAD_DEAD]
        power = shafts[side, at.LOAD_POWER]
        size += shafts[side, at.LOAD_FRICTION] * ((load * load + dead * dead) ** (0.5 * power) - dead**power)
    if shafts[side, at.IRON] != 0.0:
        load = (abs(carried) / shafts[side, at.LOAD_REFERENCE]) ** shafts[side, at.IRON_LOAD_POWER]
        size += shafts[side, at.IRON] * load * (abs(speed) / 100.0) ** shafts[side, at.IRON_SPEED_POWER]
    if shafts[side, at.CROSS_DRAG] != 0.0:
        size += shafts[side, at.CROSS_DRAG] * (other / 50.0) ** 2
    return float(size * _direction(speed, shafts[side, at.TURNING_WIDTH]))


@compiled
def _turn_torque(shafts: Array, side: int, angle: float, speed: float) -> float:
    """Torque that follows the rotor's turn: unbalance and cogging, against the rotation [N m]."""
    found = 0.0
    if shafts[side, at.UNBALANCE] != 0.0:
        growth = 1.0 + shafts[side, at.UNBALANCE_GROWTH] * (speed / 100.0) ** 2
        found += shafts[side, at.UNBALANCE] * growth * np.sin(angle + shafts[side, at.UNBALANCE_PHASE])
    if shafts[side, at.COGGING] != 0.0:
        turn = shafts[side, at.COGGING_ORDER] * angle + shafts[side, at.COGGING_PHASE]
        found += shafts[side, at.COGGING] * (np.sin(turn) + shafts[side, at.COGGING_SECOND] * np.sin(2.0 * turn))
    return float(found)


@compiled
def _spring(gear: Array, angle: float) -> float:
    """Torque of the magnetic spring per pole pair [N m]."""
    height, flatness = np.sin(angle), gear[at.FLATNESS]
    if flatness > 0.0:
        height = np.tanh(flatness * height) / flatness
    return float(gear[at.PULL_OUT] * height + gear[at.THIRD] * np.sin(3.0 * angle))


@compiled
def _gear_torque(gear: Array, angle: float, rate: float, deflection: float, way: float) -> float:
    """Torque of the gear per pole pair beyond its spring: slip damping and hysteresis [N m]."""
    found = gear[at.SLIP_DAMPING] * rate
    if gear[at.HYSTERESIS] != 0.0:
        span = gear[at.HYSTERESIS_SPAN]
        if gear[at.HYSTERESIS_LAW] == 2.0:
            found += gear[at.HYSTERESIS] * _direction(rate, span)
        else:
            found += gear[at.HYSTERESIS] * _bristle(gear[at.HYSTERESIS_LAW], span, deflection, way) / span
    return float(found)


@compiled
def _motor_torque(shafts: Array, side: int, drive: float) -> float:
    """Torque of a motor whose drive asks for one, within its limit [N m]."""
    limit = shafts[side, at.LIMIT]
    if limit == np.inf:
        return drive
    if shafts[side, at.LIMIT_SOFT] > 0.0:
        return float(limit * np.tanh(drive / limit))
    return float(min(max(drive, -limit), limit))


@compiled
def _shaft_rates(y: Array, shafts: Array, side: int, asked: float, rates: Array) -> float:
    """Rates of a motor with its drive and of what hangs on the rotor; returns the torque on the rotor so far [N m]."""
    width, speed = shafts[side, at.TURNING_WIDTH], y[side, at.MOTOR_SPEED]
    twist = y[side, at.MOTOR_ANGLE] - y[side, at.ROTOR_ANGLE]
    coupling = _coupling_torque(shafts, side, twist, speed - y[side, at.ROTOR_SPEED])
    drag = _direction(speed, width) * shafts[side, at.MOTOR_DRY] + shafts[side, at.MOTOR_VISCOUS] * speed
    rates[side, at.MOTOR_ANGLE] = speed
    left = _motor_torque(shafts, side, y[side, at.DRIVE]) - drag - coupling
    rates[side, at.MOTOR_SPEED] = left / shafts[side, at.MOTOR_INERTIA]
    rates[side, at.ROTOR_ANGLE] = y[side, at.ROTOR_SPEED]
    rates[side, at.DRIVE] = (asked - y[side, at.DRIVE]) / shafts[side, at.DRIVE_LAG]
    on_rotor = coupling - _turn_torque(shafts, side, y[side, at.ROTOR_ANGLE], y[side, at.ROTOR_SPEED])
    if shafts[side, at.EXTRA_INERTIA] > 0.0:
        pull = shafts[side, at.EXTRA_STIFFNESS] * (y[side, at.ROTOR_ANGLE] - y[side, at.EXTRA_ANGLE])
        pull += shafts[side, at.EXTRA_DAMPING] * (y[side, at.ROTOR_SPEED] - y[side, at.EXTRA_SPEED])
        rates[side, at.EXTRA_ANGLE] = y[side, at.EXTRA_SPEED]
        rates[side, at.EXTRA_SPEED] = pull / shafts[side, at.EXTRA_INERTIA]
        on_rotor -= pull
    return float(on_rotor)


@compiled
def _rates(
    y: Array, bristles: Array, span: float, given: Array, shafts: Array, gear: Array, tables: Array, rates: Array
) -> None:
    """Rates of all states, a span [s] into a step at whose start the bristles stood as given."""
    spring, more = 0.0, 0.0
    if gear[at.PULL_OUT] > 0.0:
        angle = shafts[0, at.POLES] * y[0, at.ROTOR_ANGLE] + shafts[1, at.POLES] * y[1, at.ROTOR_ANGLE]
        rate = shafts[0, at.POLES] * y[0, at.ROTOR_SPEED] + shafts[1, at.POLES] * y[1, at.ROTOR_SPEED]
        spring = _spring(gear, angle)
        more = _gear_torque(gear, angle, rate, bristles[2], rate * span)
    for side in range(2):
        if given[side, at.MODE] == at.HELD:
            continue
        speed = y[side, at.ROTOR_SPEED]
        torque = _shaft_rates(y, shafts, side, given[side, at.REFERENCE], rates)
        carried = shafts[side, at.POLES] * spring
        torque -= _rotor_drag(shafts, tables, side, given, speed, carried, y[1 - side, at.ROTOR_SPEED])
        if shafts[side, at.BRISTLE] != 0.0:
            size = _bristle(shafts[side, at.BRISTLE_LAW], shafts[side, at.BRISTLE_SPAN], bristles[side], speed * span)
            torque -= shafts[side, at.BRISTLE] * size / shafts[side, at.BRISTLE_SPAN]
        if gear[at.PULL_OUT] > 0.0:
            torque -= carried + shafts[side, at.POLES] * more + shafts[side, at.EDDY] * speed
        rates[side, at.ROTOR_SPEED] = torque / shafts[side, at.ROTOR_INERTIA]


@compiled
def _regulate(shafts: Array, side: int, given: Array, before: float, y: Array, memory: Array, sample: float) -> float:
    """Torque that a drive asks for over the next sample [N m]; memory holds its integral and its filtered speed."""
    if given[at.MODE] == at.TORQUE:
        return float(given[at.REFERENCE])
    memory[1] += shafts[side, at.SPEED_FILTER] * (y[at.MOTOR_SPEED] - memory[1])
    if given[at.MODE] == at.FREE:
        memory[0] = 0.0
        return 0.0
    error = given[at.REFERENCE] - memory[1]
    forward = shafts[side, at.FORWARD] * (given[at.REFERENCE] - before) / sample
    asked = shafts[side, at.PROPORTIONAL] * error + memory[0] + forward
    limit = shafts[side, at.LARGEST_TORQUE]
    if abs(asked) <= limit:
        memory[0] += shafts[side, at.INTEGRAL] * error * sample
        return float(asked)
    return float(np.copysign(limit, asked))


@compiled
def _shifted(y: Array, by: float, rates: Array, found: Array) -> None:
    """A state a span further at given rates."""
    for side in range(2):
        for state in range(at.STATES):
            found[side, state] = y[side, state] + by * rates[side, state]


@compiled
def _advance(
    y: Array, bristles: Array, step: float, now: Array, shafts: Array, gear: Array, tables: Array, work: Array
) -> None:
    """One step of all states, in place."""
    one, two, three, four, middle = work[0], work[1], work[2], work[3], work[4]
    _rates(y, bristles, 0.0, now, shafts, gear, tables, one)
    _shifted(y, 0.5 * step, one, middle)
    _rates(middle, bristles, 0.5 * step, now, shafts, gear, tables, two)
    _shifted(y, 0.5 * step, two, middle)
    _rates(middle, bristles, 0.5 * step, now, shafts, gear, tables, three)
    _shifted(y, step, three, middle)
    _rates(middle, bristles, step, now, shafts, gear, tables, four)
    turned = 0.0
    for side in range(2):
        before = y[side, at.ROTOR_ANGLE]
        for state in range(at.STATES):
            slope = one[side, state] + 2.0 * (two[side, state] + three[side, state]) + four[side, state]
            y[side, state] += step / 6.0 * slope
        way = y[side, at.ROTOR_ANGLE] - before
        turned += shafts[side, at.POLES] * way
        if shafts[side, at.BRISTLE] != 0.0:
            law, span = shafts[side, at.BRISTLE_LAW], shafts[side, at.BRISTLE_SPAN]
            bristles[side] = _bristle(law, span, bristles[side], way)
    if gear[at.HYSTERESIS] != 0.0 and gear[at.HYSTERESIS_LAW] != 2.0:
        bristles[2] = _bristle(gear[at.HYSTERESIS_LAW], gear[at.HYSTERESIS_SPAN], bristles[2], turned)


@compiled
def integrate(y: Array, given: Array, bench: Numbers, sample: float, substeps: int) -> Array:
    """States of both shafts followed through a run.

    Parameters
    ----------
    y : (2, STATES) array
        State at the first sample; left as it is at the last one.
    given : (n, 2, INPUTS) array
        Inputs at each sample.
    bench : tuple of (2, SHAFT_NUMBERS) array, (GEAR_NUMBERS,) array and (2, 2, NODES) array
        Numbers of shafts and gear, and drag tables by shaft and direction. A pull-out torque of 0 is neutral.
    sample : float
        Time from one sample to the next [s].
    substeps : int
        Steps of the method in it.

    Returns
    -------
    (n, 2, OUTPUTS) array
    """
    count, step = len(given), sample / substeps
    shafts, gear, tables = bench
    found = np.zeros((count, 2, at.OUTPUTS))
    bristles, memory, work = np.zeros(3), np.zeros((2, 2)), np.zeros((5, 2, at.STATES))
    now = given[0].copy()
    for k in range(count):
        for side in range(2):
            state = y[side]
            twist, rate = state[at.MOTOR_ANGLE] - state[at.ROTOR_ANGLE], state[at.MOTOR_SPEED] - state[at.ROTOR_SPEED]
            found[k, side, at.ANGLE], found[k, side, at.TURNING] = state[at.MOTOR_ANGLE], state[at.MOTOR_SPEED]
            found[k, side, at.ROTOR], found[k, side, at.ROTOR_TURNING] = state[at.ROTOR_ANGLE], state[at.ROTOR_SPEED]
            found[k, side, at.COUPLING] = _coupling_torque(shafts, side, twist, rate)
            found[k, side, at.MOTOR_TORQUE] = _motor_torque(shafts, side, state[at.DRIVE])
            now[side] = given[k, side]
            before = given[max(k - 1, 0), side, at.REFERENCE]
            if now[side, at.MODE] != at.HELD:
                now[side, at.REFERENCE] = _regulate(shafts, side, given[k, side], before, state, memory[side], sample)
        for _ in range(substeps):
            _advance(y, bristles, step, now, shafts, gear, tables, work)
    return found
