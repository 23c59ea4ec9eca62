"""Drives under a regulated speed whose dry friction holds them at reversals, solved step by step with its jump."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from pmg.sim.signals import Array

STEP, EVERY = 2e-4, 5
"""Step of the solution [s], and how many of them are one sample."""

WANDER, MEMORY = 0.05, 0.03
"""Torque that wanders beside what the speed calls for, over dry friction, and its memory [s]: no cycle repeats to a
count."""

MACHINE = """schema = "pmg.machine/1"
title = "drive"
source = "made up"
[shaft.shaft]
moves = "turns"
[shaft.shaft.channel]
position = { name = "angle", unit = "rad" }
torque = { name = "torque", unit = "N m" }
[records]
time = { name = "time", unit = "s" }
rate_Hz = 1000.0
low_pass_Hz = 32
keep_every = 20
"""


@dataclass(frozen=True)
class DryDrive:
    """Inertia [kg m2], friction [N m s], [N m], its rise at rest [N m] within a speed [rad/s], encoder and noise."""

    inertia: float
    viscous: float
    dry: float
    rise: float
    within: float
    counts: int
    noise: float
    gain: float
    reset: float

    @classmethod
    def draw(cls, rng: np.random.Generator, *, rise: bool) -> DryDrive:
        """One that may be any of a laboratory."""
        inertia = 10.0 ** rng.uniform(-3.0, -1.5)
        dry, gain = inertia * rng.uniform(3.0, 12.0), inertia * rng.uniform(20.0, 60.0)
        return cls(
            inertia,
            inertia * rng.uniform(0.2, 1.0),
            dry,
            dry * rng.uniform(0.3, 0.8) if rise else 0.0,
            rng.uniform(1.0, 4.0),
            int(rng.choice([4096, 8192, 20000, 65536])),
            dry * rng.uniform(0.05, 0.3),
            gain,
            gain * rng.uniform(5.0, 12.0),
        )

    def run(self, reference: Callable[[float], float], seconds: float, rng: np.random.Generator) -> Array:
        """Time, counted angle and read torque (n, 3), where a speed is asked for [rad/s]."""
        speed, angle, integral, rows = 0.0, 0.0, 0.0, []
        count, samples = 2.0 * math.pi / self.counts, round(seconds / STEP)
        keep = math.exp(-STEP / MEMORY)
        fresh = WANDER * self.dry * math.sqrt(1.0 - keep * keep) * rng.standard_normal(samples)
        wander = lfilter([1.0], [1.0, -keep], fresh)
        for i in range(samples):
            off = reference(i * STEP) - speed
            integral += self.reset * off * STEP
            torque = self.gain * off + integral + wander[i]
            if i % EVERY == 0:
                rows.append((i * STEP, math.floor(angle / count) * count, torque))
            free = speed + STEP / self.inertia * (torque - self.viscous * speed)
            most = STEP / self.inertia * (self.dry + self.rise * math.exp(-abs(speed) / self.within))
            speed = 0.0 if abs(free) <= most else free - math.copysign(most, free)
            angle += speed * STEP
        read = np.array(rows)
        read[:, 2] += self.noise * rng.standard_normal(len(read))
        return read


def triangle(most: float, slope: float) -> Callable[[float], float]:
    """A speed that rises and falls at one rate [rad/s2] between two ends [rad/s]."""
    return lambda t: most * 2.0 / math.pi * math.asin(math.sin(0.5 * math.pi * slope * t / most))


def sweep(most: float, first: float, last: float, seconds: float) -> Callable[[float], float]:
    """A speed that swings faster and faster, from one frequency to another [Hz]."""
    growth = math.log(last / first) / seconds
    return lambda t: most * math.sin(2.0 * math.pi * first * math.expm1(growth * t) / growth)


def write_records(
    folder: Path, drive: DryDrive, runs: dict[str, Callable[[float], float]], rng: np.random.Generator
) -> Path:
    """Recordings of 40 s and their machine file; its path."""
    for name, reference in runs.items():
        table = drive.run(reference, 40.0, rng)
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="time,angle,torque", comments="")
    path = folder / "machine.toml"
    path.write_text(MACHINE, encoding="utf-8")
    return path
