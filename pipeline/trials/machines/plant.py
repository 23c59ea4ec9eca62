"""A machine of one shaft and what it does in time: equations of motion, a regulator, and their integration.

Everything is brought to one shaft. The classical method of Runge and Kutta takes four steps a millisecond; bristles,
whose rate grows with speed without bound, follow their exact solution over a step. The regulator acts once a step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pmg.pipeline.files.compiled import compiled
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.signals import Array

STEPS_A_SECOND = 4000
"""Steps of the integration [1/s]."""


class PlantNumbers(NamedTuple):
    """Numbers of a machine [SI], of its regulator, and of what it may conceal (zero: it does not)."""

    inertia: float
    viscous: float
    coulomb: float
    width: float
    speed_gain: float = 0.0
    speed_rate: float = 0.0
    way_gain: float = 0.0
    bristle: float = 0.0
    bristle_way: float = 1.0
    stiction: float = 0.0
    stiction_speed: float = 1.0
    drag_up: float = 0.0
    drag_down: float = 0.0
    drag_speed: float = 1.0
    under_load: float = 0.0
    load_round: float = 1.0
    dead_zone: float = 0.0
    limit: float = np.inf
    far_part: float = 0.0
    far_stiffness: float = 0.0
    far_damping: float = 0.0
    play: float = 0.0
    thinning: float = 0.0
    warm_time: float = 1.0
    ripple: float = 0.0
    ripple_way: float = 1.0
    ripple_second: float = 0.0
    tiring: float = 0.0
    film: float = 0.0
    film_time: float = 1.0
    film_speed: float = 1.0
    hum: float = 0.0
    hum_hertz: float = 1.0
    hum_phase: float = 0.0


@compiled
def _resisting(p: PlantNumbers, way: float, speed: float, bristle: float, load: float, time: float) -> float:
    """Friction and what goes with the place, against the motion where positive [N or N m]."""
    size = np.sqrt(speed * speed + p.width * p.width)
    sense = speed / size
    thin = np.exp(-p.thinning * (1.0 - np.exp(-time / p.warm_time)))
    found = p.viscous * thin * speed + p.coulomb * sense
    if p.bristle != 0.0:
        found += p.bristle * (1.0 + p.stiction * np.exp(-((speed / p.stiction_speed) ** 2))) * bristle
    if p.drag_up != 0.0:
        found += p.drag_up * sense * (np.cosh(size / p.drag_speed) - 1.0)
    if p.drag_down != 0.0:
        found += p.drag_down * np.arcsinh(speed / p.drag_speed)
    if p.under_load != 0.0:
        found += p.under_load * sense * (np.sqrt(load * load + p.load_round * p.load_round) - p.load_round)
    if p.ripple != 0.0:
        angle = REVOLUTION * way / p.ripple_way
        found += p.ripple * (np.sin(angle) + p.ripple_second * np.sin(2.0 * angle + 1.0))
    return float(found)


@compiled
def _of_film(p: PlantNumbers, speed: float, lagging: float) -> float:
    """Drag of a film that is as thick as the speed was a while ago, against the motion where positive [N or N m]."""
    return float(p.film * speed / np.sqrt(speed * speed + p.width * p.width) * lagging / p.film_speed)


@compiled
def _given(p: PlantNumbers, command: float, time: float) -> float:
    """What the drive makes of its command [N or N m]."""
    found = command
    if p.dead_zone > 0.0:
        corner = 0.3 * p.dead_zone
        size = abs(command) - p.dead_zone
        found = np.copysign(0.5 * (size + np.sqrt(size * size + corner * corner)), command)
        found -= np.copysign(0.5 * (np.sqrt(p.dead_zone**2 + corner**2) - p.dead_zone), command)
    if p.tiring != 0.0:
        found *= 1.0 - p.tiring * (time / (time + p.warm_time))
    return float(min(max(found, -p.limit), p.limit))


@compiled
def _rates(p: PlantNumbers, state: Array, push: float, bristle: float, load: float, time: float) -> Array:
    """Rates of way and speed of the near mass, and of the far one."""
    near, force = p.inertia * (1.0 - p.far_part), push - _resisting(p, state[0], state[1], bristle, load, time)
    rates = np.zeros(4)
    rates[0], rates[2] = state[1], state[3]
    if p.far_part > 0.0:
        apart = state[0] - state[2]
        touching = np.copysign(max(abs(apart) - p.play, 0.0), apart)
        between = p.far_stiffness * touching
        if p.play == 0.0 or touching != 0.0:
            between += p.far_damping * (state[1] - state[3])
        force -= between
        rates[3] = between / (p.inertia * p.far_part)
    rates[1] = force / near
    return rates


@compiled
def integrate_plant(p: PlantNumbers, asked: Array, load: Array, shaken: Array, speed: float) -> Array:
    """Way, speed and command at the beginning of every step: (n, 3).

    Parameters
    ----------
    p : PlantNumbers
        The machine.
    asked : (n,) array
        Speed that the regulator is asked for [m/s or rad/s].
    load : (n,) array
        What another machine applies to the shaft [N or N m].
    shaken : (n,) array
        What nobody records [N or N m].
    speed : float
        At the beginning [m/s or rad/s].
    """
    step = 1.0 / STEPS_A_SECOND
    n = len(asked)
    out = np.zeros((n, 3))
    state = np.zeros(4)
    state[1] = state[3] = speed
    bristle, held, goal, lagging = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        time = i * step
        off = asked[i] - state[1] + p.way_gain * (goal - state[0])
        held += p.speed_rate * off * step
        command = p.speed_gain * off + held
        goal += asked[i] * step
        out[i, 0], out[i, 1], out[i, 2] = state[0], state[1], command
        lagging += (abs(state[1]) - lagging) * step / p.film_time
        push = _given(p, command, time) + load[i] + shaken[i] - _of_film(p, state[1], lagging)
        push += p.hum * np.sin(REVOLUTION * p.hum_hertz * time + p.hum_phase)
        before = state[0]
        a = _rates(p, state, push, bristle, load[i], time)
        b = _rates(p, state + 0.5 * step * a, push, bristle, load[i], time + 0.5 * step)
        c = _rates(p, state + 0.5 * step * b, push, bristle, load[i], time + 0.5 * step)
        d = _rates(p, state + step * c, push, bristle, load[i], time + step)
        state = state + step / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        way = state[0] - before
        end = np.sign(way)
        bristle = end + (bristle - end) * np.exp(-abs(way) / p.bristle_way)
    return out
