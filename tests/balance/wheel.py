"""A drive that turns, made here: its motion, friction and noise are known; every channel in units of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.sim.signals import Array

RATE = 500.0
"""Sample rate [Hz]."""
INERTIA, VISCOUS = 0.02, 0.01
"""[kg m2], [N m s/rad]."""

CASE = """
schema = "pmg.terms/1"
title = "A wheel made for a test"
library = "rotary_drive"
[record]
fit = "fit.csv"
{withheld}
[channels]
time = {{ name = "t", unit = "s" }}
{channels}
[prepare]
rate_Hz = 500
low_pass_Hz = 40
keep_every = 8
{prepare}
[baseline]
terms = {terms}
{more}
"""

VELOCITY = 'velocity = { name = "n", unit = "rpm" }'
ANGLE = 'position = { name = "phi", unit = "deg" }'
TORQUE = 'torque = { name = "T", unit = "mN m" }'


@dataclass(frozen=True)
class Turning:
    """True motion: time, angle, speed, acceleration [SI]."""

    t: Array
    angle: Array
    speed: Array
    acceleration: Array


def turning(rng: np.random.Generator, seconds: float) -> Turning:
    """Slow waves of speed about standstill, without a common period."""
    t = np.arange(round(seconds * RATE)) / RATE
    angle, speed, acceleration = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for size, frequency in ((12.0, 0.17), (6.0, 0.71), (1.5, 1.7)):
        w, phase = 2.0 * np.pi * frequency * rng.uniform(0.9, 1.1), rng.uniform(0.0, 2.0 * np.pi)
        angle = angle - size / w * np.cos(w * t + phase)
        speed = speed + size * np.sin(w * t + phase)
        acceleration = acceleration + size * w * np.cos(w * t + phase)
    return Turning(t, angle, speed, acceleration)


def plain(m: Turning) -> Array:
    """Inertia and viscous friction [N m]."""
    return INERTIA * m.acceleration + VISCOUS * m.speed


def record(path: Path, m: Turning, torque: Array, rng: np.random.Generator, noise: float = 2e-3) -> None:
    """A recording as CSV: speed in rpm, angle in degrees as counted, torque in mN m with noise."""
    shown = 1e3 * (torque + noise * rng.standard_normal(len(m.t)) * (np.ptp(torque) > 0.0))
    count = 360.0 / 80000.0
    angle = count * np.floor(np.degrees(m.angle) / count)
    rpm = m.speed * 30.0 / np.pi + 0.05 * rng.standard_normal(len(m.t))
    rows = "\n".join(f"{a:.4f},{b:.4f},{c:.4f},{d:.5f}" for a, b, c, d in zip(m.t, rpm, angle, shown, strict=True))
    path.write_text(f"t,n,phi,T\n{rows}\n")


def make_case(
    folder: Path,
    torque: Callable[[Turning], Array],
    *,
    seed: int = 5,
    channels: str = f"{VELOCITY}\n{TORQUE}",
    terms: str = '["inertia", "viscous"]',
    prepare: str = "",
    more: str = "",
    seconds: float = 20.0,
) -> Path:
    """A case with two recordings of one machine."""
    rng = np.random.default_rng(seed)
    for name in ("fit.csv", "withheld.csv"):
        m = turning(rng, seconds)
        record(folder / name, m, torque(m), rng)
    path = folder / "case.toml"
    words = {"channels": channels, "terms": terms, "prepare": prepare, "more": more}
    path.write_text(CASE.format(withheld='withheld = "withheld.csv"', **words))
    return path
