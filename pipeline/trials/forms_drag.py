"""Drag of bearings, air and rubbing parts, in forms of this bench's own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials import laws_drag
from pmg.pipeline.trials.effect import Effect, EffectForm, no_knobs, on_shaft
from pmg.pipeline.trials.world import FASTEST_RING, FASTEST_SUN

if TYPE_CHECKING:
    from pmg.pipeline.trials.effect import BenchRun, Pair
    from pmg.sim.signals import Array

BEARINGS = {"sun": "sun_bearings", "ring": "ring_bearings"}
GEAR_BY_SHAFT = {"sun": "magnetic_gear", "ring": "magnetic_gear"}
LOAD_SUN, LOAD_RING = 0.75, 1.95
"""Torques at which a size is given [N m]."""
DIFFERENCE = 100.0
"""Speed difference at which a size is given [rad/s]."""


def _load_friction(scene: BenchRun, effect: Effect) -> Pair:
    """Size times a law of the torque carried over a reference one, and of the speed over the highest, when engaged."""
    found = []
    for carried, reference, speed, fastest in zip(
        scene.carried, (LOAD_SUN, LOAD_RING), scene.speeds, (FASTEST_SUN, FASTEST_RING), strict=True
    ):
        shape = effect.shape(carried / reference, np.abs(speed) / fastest)
        found.append(np.sign(speed) * effect.size * shape)
    return on_shaft(effect.shaft, *found)


def _mixed_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Speed by which most of the extra drag has gone."""
    return {"speed": rng.uniform(5.0, 25.0)}


def _mixed_lubrication(scene: BenchRun, effect: Effect) -> Pair:
    """Size times a law of the speed over a reference one."""
    found = []
    for speed in scene.speeds:
        shape = effect.shape(np.abs(speed) / effect.number("speed"))
        found.append(scene.part(scene.world.bearing_part) * np.sign(speed) * effect.size * shape)
    return on_shaft(effect.shaft, *found)


def _windage(scene: BenchRun, effect: Effect) -> Pair:
    """Size times a law of the speed over the highest one, in every configuration."""
    found = []
    for speed, fastest in zip(scene.speeds, (FASTEST_SUN, FASTEST_RING), strict=True):
        found.append(np.sign(speed) * effect.size * effect.shape(np.abs(speed) / fastest))
    return on_shaft(effect.shaft, *found)


def _relative_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Difference of the speeds over which the drag turns its sign."""
    return {"width": rng.uniform(1.0, 6.0)}


def _relative_bearing(scene: BenchRun, effect: Effect) -> Pair:
    """Drag between the shafts: on the sun, and its reaction on the ring."""
    difference = scene.speeds[0] - scene.speeds[1]
    shape = effect.shape(np.abs(difference) / DIFFERENCE, np.abs(scene.load) / LOAD_RING)
    on_sun: Array = scene.part(1.0) * np.tanh(difference / effect.number("width")) * effect.size * shape
    return on_sun, -on_sun


def _rubbing(scene: BenchRun, effect: Effect) -> Pair:
    """Size times a law that stays near 1, of the speed over the highest and of the load, when engaged only."""
    found = []
    load = np.abs(scene.load) / LOAD_RING
    for speed, fastest in zip(scene.speeds, (FASTEST_SUN, FASTEST_RING), strict=True):
        nearly = effect.shape(np.abs(speed) / fastest, load)
        found.append(np.where(scene.design.at.engaged, np.sign(speed) * effect.size * nearly, 0.0))
    return on_shaft(effect.shaft, *found)


DRAGS: tuple[EffectForm, ...] = (
    EffectForm(
        "load_dependent_bearing_friction",
        BEARINGS,
        "N m",
        0.01,
        no_knobs,
        drag=_load_friction,
        laws=laws_drag.LOAD_FRICTION,
    ),
    EffectForm(
        "stribeck_mixed_lubrication",
        BEARINGS,
        "N m",
        0.02,
        _mixed_knobs,
        0.15,
        _mixed_lubrication,
        laws=laws_drag.MIXED_LUBRICATION,
    ),
    EffectForm("windage", BEARINGS, "N m", 0.02, no_knobs, 0.04, _windage, laws=laws_drag.WINDAGE),
    EffectForm(
        "relative_bearing_drag",
        {"both": "relative_bearing"},
        "N m",
        0.01,
        _relative_knobs,
        drag=_relative_bearing,
        laws=laws_drag.RELATIVE_BEARING,
    ),
    EffectForm("engaged_dry_friction", GEAR_BY_SHAFT, "N m", 5e-3, no_knobs, 0.03, _rubbing, laws=laws_drag.RUBBING),
)
"""Forms of drag."""
