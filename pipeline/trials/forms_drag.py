"""Drag of bearings, air and rubbing parts, in forms of this bench's own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.effect import Effect, EffectForm, on_shaft
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


def _load_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """A power of the load, or the friction of a radial load that has a part without torque."""
    law = str(rng.choice(["power", "radial"]))
    return {"law": law, "power": rng.uniform(0.9, 1.3), "dead_load": rng.uniform(0.1, 0.5)}


def _load_friction(scene: BenchRun, effect: Effect) -> Pair:
    r"""Size times :math:`x^q` or :math:`\sqrt{f^2+x^2}-f`, x the torque carried over a reference one."""
    found = []
    for carried, reference, direction in zip(
        scene.carried,
        (LOAD_SUN, LOAD_RING),
        (scene.design.direction_sun, scene.design.direction_ring),
        strict=True,
    ):
        x = carried / reference
        if effect.knobs["law"] == "power":
            shape = x ** effect.number("power")
        else:
            dead = effect.number("dead_load")
            shape = np.hypot(dead, x) - dead
        found.append(direction * effect.size * shape)
    return on_shaft(effect.shaft, *found)


def _mixed_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """A Lorentz curve, or the cube of a hyperbola."""
    return {"law": str(rng.choice(["lorentz", "rational"])), "speed": rng.uniform(5.0, 25.0)}


def _mixed_lubrication(scene: BenchRun, effect: Effect) -> Pair:
    """Size times 1/(1+x²) or 1/(1+x/2)³, x the speed over a reference one."""
    found = []
    for speed in scene.speeds:
        x = np.abs(speed) / effect.number("speed")
        shape = 1.0 / (1.0 + x * x) if effect.knobs["law"] == "lorentz" else (1.0 + 0.5 * x) ** -3
        found.append(scene.part(scene.world.bearing_part) * np.sign(speed) * effect.size * shape)
    return on_shaft(effect.shaft, *found)


def _windage_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """A power of speed, and a laminar part."""
    return {"power": rng.uniform(1.7, 2.3), "laminar": rng.uniform(0.05, 0.3)}


def _windage(scene: BenchRun, effect: Effect) -> Pair:
    """Size times x^q + l x, x the speed over the highest one, in every configuration."""
    found = []
    for speed, fastest in zip(scene.speeds, (FASTEST_SUN, FASTEST_RING), strict=True):
        x = np.abs(speed) / fastest
        shape = x ** effect.number("power") + effect.number("laminar") * x
        found.append(np.sign(speed) * effect.size * shape)
    return on_shaft(effect.shaft, *found)


def _relative_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """A logarithm or a power of the difference, and the width over which it turns its sign."""
    law = str(rng.choice(["logarithm", "power"]))
    return {"law": law, "power": rng.uniform(0.4, 0.8), "width": rng.uniform(1.0, 6.0), "knee": rng.uniform(10, 40)}


def _relative_bearing(scene: BenchRun, effect: Effect) -> Pair:
    """Drag between the shafts: on the sun, and its reaction on the ring."""
    difference = scene.speeds[0] - scene.speeds[1]
    x = np.abs(difference)
    if effect.knobs["law"] == "logarithm":
        knee = effect.number("knee")
        shape = np.log1p(x / knee) / np.log1p(DIFFERENCE / knee)
    else:
        shape = (x / DIFFERENCE) ** effect.number("power")
    on_sun: Array = scene.part(1.0) * np.tanh(difference / effect.number("width")) * effect.size * shape
    return on_sun, -on_sun


def _rubbing_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Fall of the friction up to the highest speed."""
    return {"fall": rng.uniform(-0.1, 0.25)}


def _rubbing(scene: BenchRun, effect: Effect) -> Pair:
    """Size, falling slightly with speed, when engaged only."""
    found = []
    for speed, fastest in zip(scene.speeds, (FASTEST_SUN, FASTEST_RING), strict=True):
        slightly = 1.0 - effect.number("fall") * (np.abs(speed) / fastest) ** 0.7
        found.append(np.where(scene.design.at.engaged, np.sign(speed) * effect.size * slightly, 0.0))
    return on_shaft(effect.shaft, *found)


DRAGS: tuple[EffectForm, ...] = (
    EffectForm("load_dependent_bearing_friction", BEARINGS, "N m", 0.01, _load_knobs, drag=_load_friction),
    EffectForm("stribeck_mixed_lubrication", BEARINGS, "N m", 0.02, _mixed_knobs, 0.15, _mixed_lubrication),
    EffectForm("windage", BEARINGS, "N m", 0.02, _windage_knobs, 0.04, _windage),
    EffectForm(
        "relative_bearing_drag", {"both": "relative_bearing"}, "N m", 0.01, _relative_knobs, drag=_relative_bearing
    ),
    EffectForm("engaged_dry_friction", GEAR_BY_SHAFT, "N m", 5e-3, _rubbing_knobs, 0.03, _rubbing),
)
"""Forms of drag."""
