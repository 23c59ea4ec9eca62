"""Magnetic drag beyond hysteresis and eddy currents, in forms of this bench's own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.design import POLE_PAIRS
from pmg.pipeline.trials.effect import Effect, EffectForm
from pmg.pipeline.trials.forms_drag import LOAD_RING
from pmg.pipeline.trials.world import FASTEST_SUN

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.trials.effect import BenchRun, Pair
    from pmg.sim.signals import Array

GEAR = {"both": "magnetic_gear"}


def _residual_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Where the coupling is strongest, how it falls beyond, and how much of it belongs to the second stage."""
    law = str(rng.choice(["exponential", "saturating"]))
    return {"law": law, "slip": rng.uniform(300.0, 1200.0), "second_stage": rng.uniform(0.0, 0.4)}


def _residual_coupling(scene: BenchRun, effect: Effect) -> Pair:
    """Drag of slipping poles in neutral: x exp(1-x), or a hyperbolic tangent that falls again, on both stages."""
    w_s, w_r = scene.speeds
    sun, ring = np.zeros_like(w_s), np.zeros_like(w_r)
    for (p_s, p_r), weight in zip(POLE_PAIRS, (1.0, effect.number("second_stage")), strict=True):
        slip = p_s * w_s + p_r * w_r
        x = np.abs(slip) / effect.number("slip")
        shape = x * np.exp(1.0 - x) if effect.knobs["law"] == "exponential" else np.tanh(1.5 * x) / (1.0 + 0.25 * x)
        pull = np.where(scene.design.at.neutral, np.sign(slip) * weight * effect.size * shape, 0.0)
        sun, ring = sun + p_s * pull, ring + p_r * pull
    return sun, ring


def _skin_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Speed at which a slab is as thick as the currents reach."""
    return {"corner": rng.uniform(10.0, 50.0)}


def _skin_effect(scene: BenchRun, effect: Effect) -> Pair:
    """More eddy drag, that of a slab: size times w tanh(x)/x, x the root of speed over the corner."""
    return _engaged(scene, effect, _slab)


def _slab(speed: Array, effect: Effect) -> Array:
    x = np.sqrt(np.abs(speed) / effect.number("corner"))
    within = np.where(x > 1e-6, np.tanh(x) / np.where(x > 1e-6, x, 1.0), 1.0)
    return np.asarray(np.abs(speed) / FASTEST_SUN * within)


def _iron_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Powers of speed and load."""
    return {"speed_power": rng.uniform(1.05, 1.3), "load_power": rng.uniform(1.7, 2.1)}


def _load_iron_loss(scene: BenchRun, effect: Effect) -> Pair:
    """Size times load squared times speed, nearly."""
    load = (np.abs(scene.load) / LOAD_RING) ** effect.number("load_power")
    sun, ring = _engaged(scene, effect, _speed_power)
    return sun * load, ring * load


def _speed_power(speed: Array, effect: Effect) -> Array:
    return np.asarray((np.abs(speed) / FASTEST_SUN) ** effect.number("speed_power"))


def _engaged(scene: BenchRun, effect: Effect, shape: Callable[[Array, Effect], Array]) -> Pair:
    """Size times a shape of each rotor's own speed, against its rotation, when engaged."""
    sun, ring = (
        np.where(scene.design.at.engaged, np.sign(w) * effect.size * shape(w, effect), 0.0) for w in scene.speeds
    )
    return sun, ring


MAGNETICS: tuple[EffectForm, ...] = (
    EffectForm("residual_magnetic_coupling", GEAR, "N m", 1e-3, _residual_knobs, drag=_residual_coupling),
    EffectForm("eddy_skin_effect", GEAR, "N m", 0.02, _skin_knobs, 0.1, _skin_effect),
    EffectForm("load_dependent_iron_loss", GEAR, "N m", 0.01, _iron_knobs, drag=_load_iron_loss),
)
"""Forms of magnetic drag."""
