"""Faults of the torque transducers, in forms of this bench's own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials import laws_reading
from pmg.pipeline.trials.effect import Effect, EffectForm, on_shaft
from pmg.pipeline.trials.world import NOMINAL_RING, NOMINAL_SUN

if TYPE_CHECKING:
    from pmg.pipeline.trials.effect import BenchRun, Pair

TRANSDUCERS = {"sun": "sun_torque_transducer", "ring": "ring_torque_transducer"}


def _sign_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Which way it goes."""
    return {"sign": float(rng.choice([-1.0, 1.0]))}


def _moved_zero(scene: BenchRun, effect: Effect, true: Pair) -> Pair:
    """Size times a law of time in campaign lengths."""
    elapsed = scene.design.elapsed
    t = elapsed / max(float(elapsed[-1]), 1.0)
    zero = effect.number("sign") * effect.size * effect.shape(t)
    return on_shaft(effect.shaft, zero, zero)


def _gain_error(scene: BenchRun, effect: Effect, true: Pair) -> Pair:
    """Size times the torque, times a law of it that stays near 1."""
    found = [
        effect.number("sign") * effect.size * torque * effect.shape(torque / nominal)
        for torque, nominal in zip(true, (NOMINAL_SUN, NOMINAL_RING), strict=True)
    ]
    return on_shaft(effect.shaft, *found)


def _crosstalk(scene: BenchRun, effect: Effect, true: Pair) -> Pair:
    """Size times a law of the other shaft's torque, now and at the point before."""
    found = []
    for other, nominal in ((true[1], NOMINAL_RING), (true[0], NOMINAL_SUN)):
        x = other / nominal
        seen = nominal * effect.shape(x, np.r_[x[:1], x[:-1]])
        found.append(effect.number("sign") * effect.size * seen)
    return on_shaft(effect.shaft, *found)


READINGS: tuple[EffectForm, ...] = (
    EffectForm(
        "torque_zero_offset", TRANSDUCERS, "N m", 5e-3, _sign_knobs, reading=_moved_zero, laws=laws_reading.OFFSET
    ),
    EffectForm(
        "torque_zero_drift", TRANSDUCERS, "N m", 5e-3, _sign_knobs, reading=_moved_zero, laws=laws_reading.DRIFT
    ),
    EffectForm("torque_gain_error", TRANSDUCERS, "1", 0.01, _sign_knobs, reading=_gain_error, laws=laws_reading.GAIN),
    EffectForm(
        "torque_crosstalk", TRANSDUCERS, "1", 0.01, _sign_knobs, reading=_crosstalk, laws=laws_reading.CROSSTALK
    ),
)
"""Forms of faulty readings."""
