"""Friction of the rotors that a drag curve does not have: by load, age, direction, angle and temperature."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pmg.pipeline.trials.forms_drag import BEARINGS, GEAR_BY_SHAFT
from pmg.pipeline.trials.forms_magnetic import GEAR
from pmg.pipeline.trials.laws import Families, Law
from pmg.pipeline.trials.motion import places as at
from pmg.pipeline.trials.motion.bench import FASTEST
from pmg.pipeline.trials.motion.effect import MotionEffect, MotionForm, named_laws
from pmg.pipeline.trials.motion.machine import ROW, SPEEDS
from pmg.pipeline.trials.motion.programme import RATE
from pmg.sim.grid import Configuration

if TYPE_CHECKING:
    from pmg.pipeline.trials.motion.machine import SyntheticMachine
    from pmg.pipeline.trials.motion.programme import MotionCampaign, PlannedRun
    from pmg.sim.signals import Array

TEMPERATURE_STEP = 0.05
"""Time from one temperature to the next [s]."""


def _presliding(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """Dry friction of the size goes by bristles; where the bench has less of it, there is more drag too."""
    row = ROW[effect.shaft]
    machine.shafts[row, at.BRISTLE] = effect.size
    machine.shafts[row, at.BRISTLE_SPAN] = effect.number("span")
    machine.shafts[row, at.BRISTLE_LAW] = float(effect.law == "slip")
    machine.tables[row] += max(effect.size - machine.bench.shafts[effect.shaft].drag.low, 0.0)


def _by_direction(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """More drag in one direction, as a law of the speed over the highest one."""
    way = 0 if effect.number("sign") > 0.0 else 1
    machine.tables[ROW[effect.shaft], way] += effect.size * effect.shape(SPEEDS / FASTEST[effect.shaft])


def _mixed_lubrication(machine: SyntheticMachine, effect: MotionEffect) -> None:
    machine.tables[ROW[effect.shaft]] += effect.size * effect.shape(SPEEDS / effect.number("speed"))


def _load_friction(machine: SyntheticMachine, effect: MotionEffect) -> None:
    shaft = machine.shafts[ROW[effect.shaft]]
    dead, power = effect.number("dead"), effect.number("power")
    whole = (1.0 + dead * dead) ** (0.5 * power) - dead**power
    shaft[at.LOAD_FRICTION], shaft[at.LOAD_DEAD], shaft[at.LOAD_POWER] = effect.size / whole, dead, power


def _iron_loss(machine: SyntheticMachine, effect: MotionEffect) -> None:
    for row in range(2):
        shaft = machine.shafts[row]
        shaft[at.IRON] = effect.size * (1.0, 2.6)[row]
        shaft[at.IRON_LOAD_POWER], shaft[at.IRON_SPEED_POWER] = effect.number("load"), effect.number("speed")


def _rubbing(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """Drag when engaged only, by a law of the speed asked for over the highest one that stays near 1."""
    row, fastest = ROW[effect.shaft], FASTEST[effect.shaft]

    def change(run: PlannedRun, given: Array) -> None:
        if run.configuration is Configuration.ENGAGED:
            speed = np.abs(_speed_asked(run, effect.shaft))
            given[:, row, at.DRAG_MORE] += effect.size * effect.shape(speed / fastest)

    machine.inputs.append(change)


def _warming(campaign: MotionCampaign, effect: MotionEffect, machine: SyntheticMachine) -> tuple[Array, Array]:
    """Times since the start of the campaign [s], and the bearing's warmth over its highest."""
    count = int(campaign.length / TEMPERATURE_STEP) + 2
    times, heat = np.arange(count, dtype=np.float64) * TEMPERATURE_STEP, np.zeros(count)
    drag, row = machine.bench.shafts[effect.shaft].drag, ROW[effect.shaft]
    for run in campaign.runs:
        given = run.inputs[:: round(TEMPERATURE_STEP * RATE), row]
        speed = np.abs(_speed_asked(run, effect.shaft))[:: round(TEMPERATURE_STEP * RATE)]
        first = int(campaign.elapsed(run)[0] / TEMPERATURE_STEP)
        heat[first : first + len(given)] += drag.drag(speed) * speed
    for time in (effect.number("time"), effect.number("film") * effect.number("time")):
        part = 1.0 - np.exp(-TEMPERATURE_STEP / time)
        heat = lfilter([part], [1.0, part - 1.0], heat)
    return np.asarray(times), np.asarray(heat / max(float(heat.max()), 1e-30))


def _speed_asked(run: PlannedRun, side: str) -> Array:
    """Speed that a shaft is asked for, its own or through the gear [rad/s]; none when it runs free."""
    if side not in run.asked:
        return np.zeros(run.samples)
    mode, speed = run.asked[side]
    if mode != at.SPEED:
        other = "ring" if side == "sun" else "sun"
        speed = run.asked[other][1] * (13.0 / 5.0 if side == "sun" else 5.0 / 13.0)
    return np.where(np.arange(run.samples) < (run.free_from or run.samples), speed, 0.0)


def _viscosity(machine: SyntheticMachine, effect: MotionEffect) -> None:
    """Drag beyond the dry part falls as the bearing warms by its own loss, by size where it is warmest."""
    times, warmth = _warming(machine.campaign, effect, machine)
    row, low = ROW[effect.shaft], machine.bench.shafts[effect.shaft].drag.low

    def change(run: PlannedRun, given: Array) -> None:
        scale = 1.0 - effect.size * effect.shape(np.interp(machine.campaign.elapsed(run), times, warmth))
        given[:, row, at.DRAG_SCALE] *= scale
        given[:, row, at.DRAG_MORE] += (1.0 - scale) * low

    machine.inputs.append(change)


def _constant(x: Array) -> Array:
    return np.ones_like(x)


def _root(x: Array) -> Array:
    return np.sqrt(x)


def _settling(x: Array, steady: float) -> Array:
    return np.asarray(steady + (1.0 - steady) * np.exp(-6.0 * x))


def _thin_lorentz(x: Array) -> Array:
    return np.asarray(1.0 / (1.0 + x * x))


def _thin_exponential(x: Array) -> Array:
    return np.asarray(np.exp(-x))


def _thin_sech(x: Array) -> Array:
    return np.asarray(1.0 / np.cosh(np.minimum(x, 300.0)))


def _warm_exponential(x: Array, c: float) -> Array:
    return np.asarray((1.0 - np.exp(-c * x)) / (1.0 - np.exp(-c)))


def _warm_hyperbola(x: Array, c: float) -> Array:
    return np.asarray((1.0 + c) * x / (1.0 + c * x))


DRAGS: tuple[MotionForm, ...] = (
    MotionForm(
        "presliding_friction",
        BEARINGS,
        "N m",
        0.01,
        0.2,
        _presliding,
        named_laws(bristles={}, slip={}),
        {"span": (5e-3, 0.05)},
    ),
    MotionForm(
        "direction_dependent_friction",
        BEARINGS,
        "N m",
        5e-3,
        0.1,
        _by_direction,
        Families(
            {"constant": Law(_constant), "root": Law(_root)}, {"settling": Law(_settling, {"steady": (0.4, 0.8)})}
        ),
        {},
        True,
    ),
    MotionForm(
        "stribeck_mixed_lubrication",
        BEARINGS,
        "N m",
        0.02,
        0.3,
        _mixed_lubrication,
        Families({"lorentz": Law(_thin_lorentz), "exponential": Law(_thin_exponential)}, {"sech": Law(_thin_sech)}),
        {"speed": (1.0, 6.0)},
    ),
    MotionForm(
        "load_dependent_bearing_friction",
        BEARINGS,
        "N m",
        0.01,
        0.2,
        _load_friction,
        named_laws(power={"power": (0.85, 1.3), "dead": (0.0, 0.0)}, radial={"power": (1.0, 1.0), "dead": (0.1, 0.5)}),
        {},
    ),
    MotionForm(
        "load_dependent_iron_loss",
        GEAR,
        "N m",
        0.01,
        0.1,
        _iron_loss,
        named_laws(product={"load": (0.9, 1.3), "speed": (0.8, 1.1)}, eddy={"load": (1.8, 2.1), "speed": (0.9, 1.1)}),
        {},
    ),
    MotionForm(
        "engaged_dry_friction",
        GEAR_BY_SHAFT,
        "N m",
        5e-3,
        0.1,
        _rubbing,
        Families({"constant": Law(_constant), "falling": Law(_settling, {"steady": (0.6, 0.9)})}),
        {},
    ),
    MotionForm(
        "lubricant_viscosity",
        BEARINGS,
        "1",
        0.1,
        0.8,
        _viscosity,
        Families(
            {
                "exponential": Law(_warm_exponential, {"c": (0.3, 2.0)}),
                "hyperbola": Law(_warm_hyperbola, {"c": (0.3, 3.0)}),
            }
        ),
        {"time": (60.0, 300.0), "film": (0.02, 0.2)},
    ),
)
"""Forms of friction."""
