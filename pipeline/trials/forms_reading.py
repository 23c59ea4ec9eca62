"""Faults of the torque transducers, in forms of this bench's own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.effect import Effect, EffectForm, on_shaft
from pmg.pipeline.trials.world import NOMINAL_RING, NOMINAL_SUN
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.trials.effect import BenchRun, Pair

TRANSDUCERS = {"sun": "sun_torque_transducer", "ring": "ring_torque_transducer"}
WALK_TERMS = 8
"""Terms of the expansion of a random walk."""


def _sign_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Which way it goes."""
    return {"sign": float(rng.choice([-1.0, 1.0]))}


def _zero_offset(scene: BenchRun, effect: Effect, true: Pair) -> Pair:
    """A constant, everywhere."""
    constant = np.full(len(true[0]), effect.number("sign") * effect.size)
    return on_shaft(effect.shaft, constant, constant)


def _drift_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """A zero that settles, or one that walks on top of a trend."""
    found = _sign_knobs(scene, rng) | {"settled": rng.uniform(0.15, 1.2), "trend": rng.uniform(0.6, 1.5)}
    found |= {f"walk_{i}": float(z) for i, z in enumerate(rng.standard_normal(WALK_TERMS))}
    found["law"] = str(rng.choice(["settling", "walk"]))
    return found


def _zero_drift(scene: BenchRun, effect: Effect, true: Pair) -> Pair:
    """Size times 1-exp(-t/s), or a random walk (its sine expansion) beside a trend; t in campaign lengths."""
    elapsed = scene.design.elapsed
    t = elapsed / max(float(elapsed[-1]), 1.0)
    if effect.knobs["law"] == "settling":
        shape = -np.expm1(-t / effect.number("settled"))
    else:
        shape = effect.number("trend") * t
        for i in range(WALK_TERMS):
            rate = 0.25 * (2 * i + 1)  # turns over the campaign
            shape = shape + 0.4 * effect.number(f"walk_{i}") * np.sin(REVOLUTION * rate * t) / (REVOLUTION * rate)
    zero = effect.number("sign") * effect.size * shape
    return on_shaft(effect.shaft, zero, zero)


def _gain_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Which way, and how much of it is not linear."""
    return {"quadratic": rng.uniform(-0.3, 0.3)} | _sign_knobs(scene, rng)


def _gain_error(scene: BenchRun, effect: Effect, true: Pair) -> Pair:
    """Size times T (1 + q |T|/T_nominal)."""
    found = [
        effect.number("sign") * effect.size * torque * (1.0 + effect.number("quadratic") * np.abs(torque) / nominal)
        for torque, nominal in zip(true, (NOMINAL_SUN, NOMINAL_RING), strict=True)
    ]
    return on_shaft(effect.shaft, *found)


def _crosstalk_knobs(scene: BenchRun, rng: np.random.Generator) -> dict[str, float | str]:
    """Whether the reading follows the other torque with its sign and a small lag, or a power of its magnitude."""
    law = str(rng.choice(["lag", "lag", "magnitude"]))
    return _sign_knobs(scene, rng) | {"law": law, "lag": rng.uniform(0.02, 0.1), "power": rng.uniform(0.8, 1.2)}


def _crosstalk(scene: BenchRun, effect: Effect, true: Pair) -> Pair:
    """Size times the other shaft's torque, a little of it still that of the point before; or N |T/N|^p, unsigned."""
    found = []
    for other, nominal in ((true[1], NOMINAL_RING), (true[0], NOMINAL_SUN)):
        if effect.knobs["law"] == "magnitude":
            seen = nominal * np.abs(other / nominal) ** effect.number("power")
        else:
            before = np.r_[other[:1], other[:-1]]
            seen = other + effect.number("lag") * (before - other)
        found.append(effect.number("sign") * effect.size * seen)
    return on_shaft(effect.shaft, *found)


READINGS: tuple[EffectForm, ...] = (
    EffectForm("torque_zero_offset", TRANSDUCERS, "N m", 5e-3, _sign_knobs, reading=_zero_offset),
    EffectForm("torque_zero_drift", TRANSDUCERS, "N m", 5e-3, _drift_knobs, reading=_zero_drift),
    EffectForm("torque_gain_error", TRANSDUCERS, "1", 0.01, _gain_knobs, reading=_gain_error),
    EffectForm("torque_crosstalk", TRANSDUCERS, "1", 0.01, _crosstalk_knobs, reading=_crosstalk),
)
"""Forms of faulty readings."""
