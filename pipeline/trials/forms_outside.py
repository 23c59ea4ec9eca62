"""Effects that no library of mechanisms knows: the right answer is that it is none of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.effect import Effect, EffectForm, on_shaft
from pmg.pipeline.trials.forms_drag import BEARINGS, GEAR_BY_SHAFT, LOAD_RING
from pmg.pipeline.trials.forms_reading import TRANSDUCERS
from pmg.pipeline.trials.laws import softplus
from pmg.pipeline.trials.world import FASTEST_RING, FASTEST_SUN
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.trials.effect import BenchRun, Pair
    from pmg.sim.signals import Array


def _bump_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Where in the range of speeds a resonance sits, and how wide it is."""
    return {"place": rng.uniform(0.3, 0.75), "width": rng.uniform(0.06, 0.14)}


def _resonance_bump(scene: BenchRun, effect: Effect) -> Pair:
    """More drag about one speed."""

    def shape(x: Array, before: Array) -> Array:
        return np.asarray(np.exp(-0.5 * ((x - effect.number("place")) / effect.number("width")) ** 2))

    return _of_speed(scene, effect, shape)


def _hump_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Where in the range of speeds a smooth hump of the drag sits, and how wide it is."""
    return {"place": rng.uniform(0.3, 0.7), "width": rng.uniform(0.15, 0.3)}


def _step_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """When a seal has run in (its drag goes) or tilts (its drag comes), and how fast."""
    way = str(rng.choice(["goes", "comes"]))
    return {"way": way, "when": rng.uniform(0.25, 0.75), "width": rng.uniform(0.002, 0.01)}


def _run_in_step(scene: BenchRun, effect: Effect) -> Pair:
    """Drag that changes once, at some time."""
    elapsed = scene.design.elapsed
    t = elapsed / max(float(elapsed[-1]), 1.0)
    after = np.asarray(0.5 * (1.0 + np.tanh((t - effect.number("when")) / effect.number("width"))))

    def shape(x: Array, before: Array) -> Array:
        return after if effect.knobs["way"] == "comes" else 1.0 - after

    return _of_speed(scene, effect, shape)


def _memory_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Sharpness of the drag's dependence."""
    return {"sharpness": rng.uniform(0.1, 0.3)}


def _previous_speed(scene: BenchRun, effect: Effect) -> Pair:
    """Drag that follows the speed of the point before."""

    def shape(x: Array, before: Array) -> Array:
        return np.asarray(before / (before + effect.number("sharpness")))

    return _of_speed(scene, effect, shape)


def _approach_hysteresis(scene: BenchRun, effect: Effect) -> Pair:
    """Drag that is higher when the speed has been approached from below."""

    def shape(x: Array, before: Array) -> Array:
        return np.asarray(1.0 + np.tanh((x - before) / effect.number("sharpness")))

    return _of_speed(scene, effect, shape)


def _of_speed(scene: BenchRun, effect: Effect, shape: Callable[[Array, Array], Array]) -> Pair:
    """Size times a shape of a shaft's relative speed, now and at the point before."""
    found = []
    for speed, fastest in zip(scene.speeds, (FASTEST_SUN, FASTEST_RING), strict=True):
        x = np.abs(speed) / fastest
        found.append(scene.part(1.0) * np.sign(speed) * effect.size * shape(x, np.r_[0.0, x[:-1]]))
    return on_shaft(effect.shaft, *found)


def _periodic_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Period and phase."""
    return {"period": rng.uniform(400.0, 1800.0), "phase": rng.uniform(0.0, 1.0)}


def _periodic(scene: BenchRun, effect: Effect, true: Pair) -> Pair:
    """A reading that swings with time, as the room's air conditioning switches."""
    turns = scene.design.elapsed / effect.number("period") + effect.number("phase")
    swing = effect.size * np.sin(REVOLUTION * turns)
    return on_shaft(effect.shaft, swing, swing)


def _saturating_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Power at which the drag saturates, in parts of the largest."""
    return {"saturation": rng.uniform(0.08, 0.25)}


def _saturating_power(scene: BenchRun, effect: Effect) -> Pair:
    """Engaged drag that saturates with the product of load and speed."""
    found = []
    for speed, fastest in zip(scene.speeds, (FASTEST_SUN, FASTEST_RING), strict=True):
        power = np.abs(scene.load) / LOAD_RING * np.abs(speed) / fastest
        found.append(np.sign(speed) * effect.size * -np.expm1(-power / effect.number("saturation")))
    return on_shaft(effect.shaft, *found)


def _corner_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Speed and load beyond which the drag sets in, in parts of the largest, and how smoothly."""
    return {"speed": rng.uniform(0.3, 0.7), "load": rng.uniform(0.4, 0.7), "width": rng.uniform(0.03, 0.1)}


def _load_speed_corner(scene: BenchRun, effect: Effect) -> Pair:
    """Engaged drag that sets in beyond a speed and a load together."""
    found, width = [], effect.number("width")
    over = softplus(np.abs(scene.load) / LOAD_RING, effect.number("load"), width)
    for speed, fastest in zip(scene.speeds, (FASTEST_SUN, FASTEST_RING), strict=True):
        beyond = softplus(np.abs(speed) / fastest, effect.number("speed"), width) * over
        found.append(np.where(scene.design.at.engaged, np.sign(speed) * effect.size * beyond, 0.0))
    return on_shaft(effect.shaft, *found)


OUTSIDERS: tuple[EffectForm, ...] = (
    EffectForm("outside_resonance_bump", BEARINGS, "N m", 0.01, _bump_knobs, drag=_resonance_bump),
    EffectForm("outside_drag_hump", BEARINGS, "N m", 0.01, _hump_knobs, drag=_resonance_bump),
    EffectForm("outside_run_in_step", BEARINGS, "N m", 5e-3, _step_knobs, drag=_run_in_step),
    EffectForm("outside_previous_speed", BEARINGS, "N m", 5e-3, _memory_knobs, drag=_previous_speed),
    EffectForm("outside_approach_hysteresis", BEARINGS, "N m", 5e-3, _memory_knobs, drag=_approach_hysteresis),
    EffectForm("outside_periodic_time", TRANSDUCERS, "N m", 5e-3, _periodic_knobs, reading=_periodic),
    EffectForm("outside_saturating_load_speed", GEAR_BY_SHAFT, "N m", 0.01, _saturating_knobs, drag=_saturating_power),
    EffectForm("outside_load_speed_corner", GEAR_BY_SHAFT, "N m", 0.05, _corner_knobs, drag=_load_speed_corner),
)
"""Forms outside any library."""
