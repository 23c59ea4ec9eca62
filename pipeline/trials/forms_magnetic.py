"""Magnetic drag beyond hysteresis and eddy currents, in forms of this bench's own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials import laws_magnetic
from pmg.pipeline.trials.design import POLE_PAIRS
from pmg.pipeline.trials.effect import Effect, EffectForm, no_knobs
from pmg.pipeline.trials.forms_drag import LOAD_RING
from pmg.pipeline.trials.world import FASTEST_SUN

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.trials.effect import BenchRun, Pair
    from pmg.sim.signals import Array

GEAR = {"both": "magnetic_gear"}


def _residual_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Slip about which the coupling is strongest, and how much of it belongs to the second stage."""
    return {"slip": rng.uniform(300.0, 1200.0), "second_stage": rng.uniform(0.0, 0.4)}


def _residual_coupling(scene: BenchRun, effect: Effect) -> Pair:
    """Drag of slipping poles in neutral: size times a law of the slip over a reference one, on both stages."""
    w_s, w_r = scene.speeds
    sun, ring = np.zeros_like(w_s), np.zeros_like(w_r)
    for (p_s, p_r), weight in zip(POLE_PAIRS, (1.0, effect.number("second_stage")), strict=True):
        slip = p_s * w_s + p_r * w_r
        shape = effect.shape(np.abs(slip) / effect.number("slip"))
        pull = np.where(scene.design.at.neutral, np.sign(slip) * weight * effect.size * shape, 0.0)
        sun, ring = sun + p_s * pull, ring + p_r * pull
    return sun, ring


def _skin_effect(scene: BenchRun, effect: Effect) -> Pair:
    """More eddy drag, of a part that shields itself: size times speed times a law of speed."""
    return _engaged(scene, effect, lambda speed: speed / FASTEST_SUN * effect.shape(speed))


def _load_iron_loss(scene: BenchRun, effect: Effect) -> Pair:
    """Size times a law of load and speed."""
    load = np.abs(scene.load) / LOAD_RING
    return _engaged(scene, effect, lambda speed: effect.shape(load, speed / FASTEST_SUN))


def _engaged(scene: BenchRun, effect: Effect, shape: Callable[[Array], Array]) -> Pair:
    """Size times a shape of each rotor's own speed, against its rotation, when engaged."""
    sun, ring = (
        np.where(scene.design.at.engaged, np.sign(w) * effect.size * shape(np.abs(w)), 0.0) for w in scene.speeds
    )
    return sun, ring


MAGNETICS: tuple[EffectForm, ...] = (
    EffectForm(
        "residual_magnetic_coupling",
        GEAR,
        "N m",
        1e-3,
        _residual_knobs,
        drag=_residual_coupling,
        laws=laws_magnetic.COUPLING,
    ),
    EffectForm("eddy_skin_effect", GEAR, "N m", 0.02, no_knobs, 0.1, _skin_effect, laws=laws_magnetic.SKIN),
    EffectForm("load_dependent_iron_loss", GEAR, "N m", 0.01, no_knobs, drag=_load_iron_loss, laws=laws_magnetic.IRON),
)
"""Forms of magnetic drag."""
