"""Warming in two steps, by the bench's own loss and in a room that drifts, and what it does to drag."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials import laws_thermal
from pmg.pipeline.trials.effect import Effect, EffectForm, on_shaft
from pmg.pipeline.trials.forms_magnetic import GEAR
from pmg.pipeline.trials.world import WINDOW
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.trials.effect import BenchRun, Pair
    from pmg.sim.signals import Array

SPEED_UP = 0.35
"""Part of the time between two points after which the next one's speeds are reached."""
LONG_PAUSE = 120.0
"""Time between points beyond which the motors stand still in between [s]."""
AFTER_PAUSE = 15.0
"""Time before a point at which its speeds are reached after a long pause [s]."""
ROOM_PERIOD = 5400.0
"""Period in which the room's heating switches [s]."""
COLDEST = -10.0
"""Temperature below which no law of viscosity is asked [degC]."""
REMANENCE = 1.15e-3
"""Relative fall of the magnets' remanence per kelvin [1/K]."""
LEAST_FLUX = 0.5
"""Least part of the remanence that is left; beyond, magnets are spoilt for good."""


def _two_nodes(
    scene: BenchRun,
    power: Array,
    nodes: tuple[float, float, float, float],
    start: float,
    housing: Array | float = 0.0,
) -> Array:
    """Rise of the inner of two nodes in series above the room at the start [K].

    Parameters
    ----------
    scene : BenchRun
        Gives the times.
    power : (n,) array
        Heat put into the inner node while each point is held [W].
    nodes : tuple of float
        Resistance from the inner to the outer node and from there to the room [K/W]; time constants of both [s].
    start : float
        Rise of both at the first point [K].
    housing : (n,) array, optional
        Heat put into the outer node while each point is held [W].
    """
    inner, outer, fast, slow = nodes
    capacity_in, capacity_out = fast / inner, slow / outer
    rates = np.array(
        [
            [-1.0 / (inner * capacity_in), 1.0 / (inner * capacity_in)],
            [1.0 / (inner * capacity_out), -(1.0 / inner + 1.0 / outer) / capacity_out],
        ]
    )
    values, vectors = np.linalg.eig(rates)
    back = np.linalg.inv(vectors)
    heated, room_in = back[:, 0] / capacity_in, back[:, 1] / (outer * capacity_out)
    around, warmed = np.broadcast_to(housing, power.shape), back[:, 1] / capacity_out
    time, room = scene.design.elapsed, _room_drift(scene)
    steps = np.diff(time)
    long = steps > LONG_PAUSE
    idle, split = np.where(long, 0.0, power[:-1]), np.where(long, steps - AFTER_PAUSE, steps * SPEED_UP)
    still = np.where(long, 0.0, around[:-1])
    early, late = np.exp(np.outer(split, values)), np.exp(np.outer(steps - split, values))
    before = np.outer(idle, heated) + np.outer(still, warmed) + np.outer(room[:-1], room_in)
    after = np.outer(power, heated) + np.outer(around, warmed) + np.outer(room, room_in)
    fed_early, fed_late = before * (early - 1.0) / values, after[1:] * (late - 1.0) / values
    keep, fed = (early * late).tolist(), (fed_early * late + fed_late).tolist()
    state = [tuple((back @ np.array([start, start])).tolist())]
    for (k_1, k_2), (f_1, f_2) in zip(keep, fed, strict=True):
        first, second = state[-1]
        state.append((k_1 * first + f_1, k_2 * second + f_2))
    modes = np.array(state) * np.exp(values * (0.5 * WINDOW))
    within = after * (np.exp(values * (0.5 * WINDOW)) - 1.0) / values
    return np.asarray((modes + within) @ vectors[0])


def _room_drift(scene: BenchRun) -> Array:
    """Temperature of the room above that at the start [K]: a drift, and the heating that switches."""
    time = scene.design.elapsed
    whole = max(float(time[-1]), 1.0)
    swing = 0.15 * scene.world.drift * np.sin(REVOLUTION * time / ROOM_PERIOD)
    return scene.world.drift * (time / whole) ** 0.8 + swing


def _viscosity_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Two resistances, two time constants, the heat that crosses to the other housing, and what goes to the own."""
    return {
        "resistance_inner": rng.uniform(0.3, 0.9),
        "resistance_outer": rng.uniform(0.4, 1.2),
        "time_inner": rng.uniform(60.0, 300.0),
        "time_outer": rng.uniform(900.0, 4000.0),
        "cross": rng.uniform(0.0, 0.25),
        "housing": rng.uniform(0.0, 0.4),
    }


def _lubricant_viscosity(scene: BenchRun, effect: Effect) -> Pair:
    """Total bearing drag, times the relative viscosity to the power of the size, less the drag itself."""
    nodes = tuple(effect.number(name) for name in ("resistance_inner", "resistance_outer", "time_inner", "time_outer"))
    world, housing = scene.world, effect.number("housing")
    part = scene.part(world.bearing_part)
    bearing = [part * curve.drag(w) for curve, w in zip((world.sun, world.ring), scene.speeds, strict=True)]
    power = [drag * w for drag, w in zip(bearing, scene.speeds, strict=True)]
    found = []
    for shaft, own, other in (("sun", 0, 1), ("ring", 1, 0)):
        if effect.shaft not in (shaft, "both"):
            found.append(0.0 * part)
            continue
        around = housing * power[own] + effect.number("cross") * power[other]
        inside = (1.0 - housing) * power[own]
        rise = _two_nodes(scene, inside, (nodes[0], nodes[1], nodes[2], nodes[3]), world.start_rise, around)
        thicker = effect.shape(np.maximum(world.ambient + rise, COLDEST))
        found.append(bearing[own] * np.expm1(effect.size * thicker))
    return on_shaft(effect.shaft, *found)


def _magnet_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Two resistances, two time constants, how much of the bearings' loss warms the magnets, how much the housing."""
    return {
        "resistance_inner": rng.uniform(1.0, 3.0),
        "resistance_outer": rng.uniform(1.0, 4.0),
        "time_inner": rng.uniform(200.0, 700.0),
        "time_outer": rng.uniform(1500.0, 5000.0),
        "from_bearings": rng.uniform(0.0, 0.15),
        "housing": rng.uniform(0.0, 0.3),
    }


def _magnet_temperature(scene: BenchRun, effect: Effect) -> Pair:
    """Magnetic drag with a law of a remanence that falls as the magnets warm; the size scales their rise."""
    names = ("resistance_inner", "resistance_outer", "time_inner", "time_outer")
    inner, outer, fast, slow = (effect.number(name) for name in names)
    world, engaged = scene.world, scene.design.at.engaged
    magnetic = [np.where(engaged, np.sign(w) * world.hysteresis + world.eddy * w, 0.0) for w in scene.speeds]
    loss = sum(drag * w for drag, w in zip(magnetic, scene.speeds, strict=True))
    total = sum(drag * w for drag, w in zip(scene.drags, scene.speeds, strict=True))
    heat = np.asarray(loss + effect.number("from_bearings") * (total - loss))
    around = effect.number("housing") * (total - loss)
    rise = _two_nodes(scene, heat, (inner, outer, fast, slow), 0.5 * world.start_rise, around)
    left = effect.shape(np.minimum(effect.size * REMANENCE * rise, 1.0 - LEAST_FLUX))
    return magnetic[0] * (left - 1.0), magnetic[1] * (left - 1.0)


THERMALS: tuple[EffectForm, ...] = (
    EffectForm(
        "lubricant_viscosity",
        {"sun": "sun_bearings", "ring": "ring_bearings", "both": "both"},
        "1",
        0.3,
        _viscosity_knobs,
        1.5,
        _lubricant_viscosity,
        laws=laws_thermal.VISCOSITY,
    ),
    EffectForm(
        "magnet_temperature", GEAR, "1", 1.0, _magnet_knobs, 2.0, _magnet_temperature, laws=laws_thermal.MAGNETS
    ),
)
"""Forms that have a memory of heat."""
