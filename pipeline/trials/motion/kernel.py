"""Equations of motion of both shafts, compiled, and their integration with the drives' regulators.

Each shaft is a motor and a rotor with an elastic coupling between; engaged, a magnetic spring of the pole angle joins
the rotors. Between samples the classical method of Runge and Kutta takes steps of equal length; bristles, whose rate
grows with speed without bound, follow their own exact solution over a step. The regulators act once a sample.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.motion import places as at
from pmg.pipeline.trials.motion.places import compiled

if TYPE_CHECKING:
    from pmg.sim.signals import Array


@compiled
def _direction(speed: float, width: float) -> float:
    """Sign of a speed, smooth about zero."""
    return float(speed / np.sqrt(speed * speed + width * width))


@compiled
def _coupling_torque(shaft: Array, twist: float, rate: float) -> float:
    """Torque in a coupling [N m]."""
    gap, contact = shaft[at.GAP], 1.0
    if gap > 0.0:
        corner = gap * shaft[at.GAP_ROUND]
        if corner > 0.0:
            upper, lower = (twist - gap) / corner, (-twist - gap) / corner
            twist = corner * (np.logaddexp(0.0, upper) - np.logaddexp(0.0, lower))
            contact = 0.5 * (2.0 + np.tanh(0.5 * upper) + np.tanh(0.5 * lower))
        elif abs(twist) <= gap:
            return 0.0
        else:
            twist -= np.copysign(gap, twist)
    stiffness = shaft[at.STIFFNESS]
    if shaft[at.SOFTNESS] != 0.0:
        stiffness *= 1.0 - shaft[at.SOFTNESS] / (1.0 + (twist / shaft[at.SOFT_TWIST]) ** 2)
    return float(stiffness * twist + contact * shaft[at.DAMPING] * rate)


@compiled
def _bristle(law: float, span: float, deflection: float, way: float) -> float:
    """Deflection of bristles after a way at one direction [rad]; exact for both laws."""
    if law == 1.0:
        return float(min(max(deflection + way, -span), span))
    end = np.copysign(span, way)
    return float(end + (deflection - end) * np.exp(-abs(way) / span))


@compiled
def _table_drag(table: Array, speed: float) -> float:
    """Drag of a rotor at a speed, without its sign [N m]."""
    row = table[0] if speed >= 0.0 else table[1]
    place = np.sqrt(abs(speed) / at.FINEST) * (at.NODES - 1)
    node = min(int(place), at.NODES - 2)
    return float(row[node] + (place - node) * (row[node + 1] - row[node]))


@compiled
def _rotor_drag(shaft: Array, given: Array, table: Array, speed: float, carried: float, other: float) -> float:
    """Drag of a rotor by speed, load and the other shaft's speed, without bristles and magnetic drag [N m]."""
    size = _table_drag(table, speed) * given[at.DRAG_SCALE] + given[at.DRAG_MORE] - shaft[at.BRISTLE]
    if shaft[at.LOAD_FRICTION] != 0.0:
        load, dead = abs(carried) / shaft[at.LOAD_REFERENCE], shaft[at.LOAD_DEAD]
        power = shaft[at.LOAD_POWER]
        size += shaft[at.LOAD_FRICTION] * ((load * load + dead * dead) ** (0.5 * power) - dead**power)
    if shaft[at.IRON] != 0.0:
        load = (abs(carried) / shaft[at.LOAD_REFERENCE]) ** shaft[at.IRON_LOAD_POWER]
        size += shaft[at.IRON] * load * (abs(speed) / 100.0) ** shaft[at.IRON_SPEED_POWER]
    if shaft[at.CROSS_DRAG] != 0.0:
        size += shaft[at.CROSS_DRAG] * (other / 50.0) ** 2
    return float(size * _direction(speed, shaft[at.TURNING_WIDTH]))


@compiled
def _turn_torque(shaft: Array, angle: float, speed: float) -> float:
    """Torque that follows the rotor's turn: unbalance and cogging, against the rotation [N m]."""
    found = 0.0
    if shaft[at.UNBALANCE] != 0.0:
        growth = 1.0 + shaft[at.UNBALANCE_GROWTH] * (speed / 100.0) ** 2
        found += shaft[at.UNBALANCE] * growth * np.sin(angle + shaft[at.UNBALANCE_PHASE])
    if shaft[at.COGGING] != 0.0:
        turn = shaft[at.COGGING_ORDER] * angle + shaft[at.COGGING_PHASE]
        found += shaft[at.COGGING] * (np.sin(turn) + shaft[at.COGGING_SECOND] * np.sin(2.0 * turn))
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
def _motor_torque(shaft: Array, drive: float) -> float:
    """Torque of a motor whose drive asks for one, within its limit [N m]."""
    limit = shaft[at.LIMIT]
    if limit == np.inf:
        return drive
    if shaft[at.LIMIT_SOFT] > 0.0:
        return float(limit * np.tanh(drive / limit))
    return float(min(max(drive, -limit), limit))


@compiled
def _shaft_rates(y: Array, shaft: Array, asked: float, rates: Array) -> float:
    """Rates of a motor with its drive and of what hangs on the rotor; returns the torque on the rotor so far [N m]."""
    width, speed = shaft[at.TURNING_WIDTH], y[at.MOTOR_SPEED]
    coupling = _coupling_torque(shaft, y[at.MOTOR_ANGLE] - y[at.ROTOR_ANGLE], speed - y[at.ROTOR_SPEED])
    drag = _direction(speed, width) * shaft[at.MOTOR_DRY] + shaft[at.MOTOR_VISCOUS] * speed
    rates[at.MOTOR_ANGLE] = speed
    rates[at.MOTOR_SPEED] = (_motor_torque(shaft, y[at.DRIVE]) - drag - coupling) / shaft[at.MOTOR_INERTIA]
    rates[at.ROTOR_ANGLE] = y[at.ROTOR_SPEED]
    rates[at.DRIVE] = (asked - y[at.DRIVE]) / shaft[at.DRIVE_LAG]
    on_rotor = coupling - _turn_torque(shaft, y[at.ROTOR_ANGLE], y[at.ROTOR_SPEED])
    if shaft[at.EXTRA_INERTIA] > 0.0:
        pull = shaft[at.EXTRA_STIFFNESS] * (y[at.ROTOR_ANGLE] - y[at.EXTRA_ANGLE])
        pull += shaft[at.EXTRA_DAMPING] * (y[at.ROTOR_SPEED] - y[at.EXTRA_SPEED])
        rates[at.EXTRA_ANGLE] = y[at.EXTRA_SPEED]
        rates[at.EXTRA_SPEED] = pull / shaft[at.EXTRA_INERTIA]
        on_rotor -= pull
    return float(on_rotor)


@compiled
def _rates(
    y: Array, bristles: Array, span: float, given: Array, bench: tuple[Array, Array, Array], rates: Array
) -> None:
    """Rates of all states, a span [s] into a step at whose start the bristles stood as given."""
    shafts, gear, tables = bench
    spring, more = 0.0, 0.0
    if gear[at.PULL_OUT] > 0.0:
        angle = shafts[0, at.POLES] * y[0, at.ROTOR_ANGLE] + shafts[1, at.POLES] * y[1, at.ROTOR_ANGLE]
        rate = shafts[0, at.POLES] * y[0, at.ROTOR_SPEED] + shafts[1, at.POLES] * y[1, at.ROTOR_SPEED]
        spring = _spring(gear, angle)
        more = _gear_torque(gear, angle, rate, bristles[2], rate * span)
    for side in range(2):
        if given[side, at.MODE] == at.HELD:
            continue
        shaft, speed = shafts[side], y[side, at.ROTOR_SPEED]
        torque = _shaft_rates(y[side], shaft, given[side, at.REFERENCE], rates[side])
        carried = shaft[at.POLES] * spring
        torque -= _rotor_drag(shaft, given[side], tables[side], speed, carried, y[1 - side, at.ROTOR_SPEED])
        if shaft[at.BRISTLE] != 0.0:
            size = _bristle(shaft[at.BRISTLE_LAW], shaft[at.BRISTLE_SPAN], bristles[side], speed * span)
            torque -= shaft[at.BRISTLE] * size / shaft[at.BRISTLE_SPAN]
        if gear[at.PULL_OUT] > 0.0:
            torque -= carried + shaft[at.POLES] * more + shaft[at.EDDY] * speed
        rates[side, at.ROTOR_SPEED] = torque / shaft[at.ROTOR_INERTIA]


@compiled
def _regulate(shaft: Array, given: Array, before: float, y: Array, memory: Array, sample: float) -> float:
    """Torque that a drive asks for over the next sample [N m]; memory holds its integral and its filtered speed."""
    if given[at.MODE] == at.TORQUE:
        return float(given[at.REFERENCE])
    memory[1] += shaft[at.SPEED_FILTER] * (y[at.MOTOR_SPEED] - memory[1])
    if given[at.MODE] == at.FREE:
        memory[0] = 0.0
        return 0.0
    error = given[at.REFERENCE] - memory[1]
    forward = shaft[at.FORWARD] * (given[at.REFERENCE] - before) / sample
    asked = shaft[at.PROPORTIONAL] * error + memory[0] + forward
    limit = shaft[at.LARGEST_TORQUE]
    if abs(asked) <= limit:
        memory[0] += shaft[at.INTEGRAL] * error * sample
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
    y: Array, bristles: Array, step: float, now: Array, bench: tuple[Array, Array, Array], work: Array
) -> None:
    """One step of all states, in place."""
    shafts, gear, _ = bench
    one, two, three, four, middle = work[0], work[1], work[2], work[3], work[4]
    _rates(y, bristles, 0.0, now, bench, one)
    _shifted(y, 0.5 * step, one, middle)
    _rates(middle, bristles, 0.5 * step, now, bench, two)
    _shifted(y, 0.5 * step, two, middle)
    _rates(middle, bristles, 0.5 * step, now, bench, three)
    _shifted(y, step, three, middle)
    _rates(middle, bristles, step, now, bench, four)
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
def integrate(y: Array, given: Array, bench: tuple[Array, Array, Array], sample: float, substeps: int) -> Array:
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
    shafts = bench[0]
    found = np.zeros((count, 2, at.OUTPUTS))
    bristles, memory, work = np.zeros(3), np.zeros((2, 2)), np.zeros((5, 2, at.STATES))
    now = given[0].copy()
    for k in range(count):
        for side in range(2):
            state, shaft = y[side], shafts[side]
            twist, rate = state[at.MOTOR_ANGLE] - state[at.ROTOR_ANGLE], state[at.MOTOR_SPEED] - state[at.ROTOR_SPEED]
            found[k, side, at.ANGLE], found[k, side, at.TURNING] = state[at.MOTOR_ANGLE], state[at.MOTOR_SPEED]
            found[k, side, at.ROTOR], found[k, side, at.ROTOR_TURNING] = state[at.ROTOR_ANGLE], state[at.ROTOR_SPEED]
            found[k, side, at.COUPLING] = _coupling_torque(shaft, twist, rate)
            found[k, side, at.MOTOR_TORQUE] = _motor_torque(shaft, state[at.DRIVE])
            now[side] = given[k, side]
            before = given[max(k - 1, 0), side, at.REFERENCE]
            if now[side, at.MODE] != at.HELD:
                now[side, at.REFERENCE] = _regulate(shaft, given[k, side], before, state, memory[side], sample)
        for _ in range(substeps):
            _advance(y, bristles, step, now, bench, work)
    return found
