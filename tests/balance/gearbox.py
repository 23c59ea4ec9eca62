"""A gearbox of fixed ratio between a motor and a brake, made here: speeds, loads, friction and noise are known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.signals import Array

RATE = 500.0
"""Sample rate [Hz]."""
RATIO = 12.25
"""Speed of the motor over that of the brake."""
INERTIA, VISCOUS, COULOMB = 0.004, 0.0015, 0.08
"""[kg m2], [N m s/rad], [N m], as the motor sees them."""

SHIPPED = Path(__file__).parents[2] / "pipeline" / "machine" / "shipped" / "two-stage-gearbox.toml"


@dataclass(frozen=True)
class Geared:
    """True motion and load: time, speed and acceleration of the motor, torque of the brake as the motor sees it."""

    t: Array
    speed: Array
    acceleration: Array
    load: Array


@dataclass(frozen=True)
class Readings:
    """What the channels show before noise: both torques [N m], speed of the motor [rad/s]."""

    motor: Array
    brake: Array
    speed: Array


def _steps(t: Array, every: float, values: Array, smooth: float) -> Array:
    """Values that change every so often, over some time."""
    which = np.minimum((t / every).astype(np.int64), len(values) - 1)
    width = max(round(smooth * RATE), 1)
    padded = np.pad(values[which], width, mode="edge")
    kernel = np.hanning(width + 2)
    return np.convolve(padded, kernel / kernel.sum(), mode="same")[width:-width]


def driven(rng: np.random.Generator, seconds: float = 60.0) -> Geared:
    """Speeds in both directions, loads of either sign, each held for some seconds."""
    t = np.arange(round(seconds * RATE)) / RATE
    speeds: Array = rng.permutation(np.repeat(np.array([-150.0, -90.0, -40.0, 40.0, 90.0, 150.0]), 2))
    loads: Array = rng.permutation(np.r_[np.linspace(-3.0, 3.0, 13), 0.0, -1.0, 1.0, 2.0, -2.0].astype(np.float64))
    speed = _steps(t, seconds / len(speeds), speeds, 1.5)
    load = _steps(t, seconds / len(loads), loads, 0.6)
    return Geared(t, speed, np.gradient(speed, t), load)


def plain(m: Geared) -> Array:
    """What inertia and friction take [N m]."""
    return INERTIA * m.acceleration + VISCOUS * m.speed + COULOMB * np.tanh(m.speed / 0.5)


def read(m: Geared, losses: Array) -> Readings:
    """Both torques for given losses: the motor bears load and losses, the brake the load."""
    return Readings(m.load + losses, -m.load * RATIO, m.speed)


def record(path: Path, m: Geared, shown: Readings, rng: np.random.Generator, noise: float = 0.01) -> None:
    """A recording as CSV: torques with correlated noise and a resolution; what the brake takes out counts positive."""

    def noisy(values: Array, size: float) -> Array:
        white = rng.standard_normal(len(values) + 300)
        coloured = 0.7 * lfilter([np.sqrt(1.0 - 0.9**2)], [1.0, -0.9], white)[300:] + 0.7 * white[300:]
        return values + size * coloured

    motor = 1e-3 * np.round(noisy(shown.motor, noise) / 1e-3)
    brake = -1e-2 * np.round(noisy(shown.brake, noise * RATIO) / 1e-2)
    rpm = (shown.speed + 0.02 * rng.standard_normal(len(m.t))) * 30.0 / np.pi
    out = (m.speed / RATIO + 0.01 * rng.standard_normal(len(m.t))) * 30.0 / np.pi
    rows = "\n".join(
        f"{a:.4f},{b:.3f},{c:.4f},{d:.4f},{e:.3f}" for a, b, c, d, e in zip(m.t, rpm, motor, out, brake, strict=True)
    )
    path.write_text(f"t,n_motor,T_motor,n_brake,T_brake\n{rows}\n")


def make_records(
    folder: Path,
    losses: Callable[[Geared], Array] = plain,
    fault: Callable[[Readings], Readings] | None = None,
    *,
    seed: int = 5,
    seconds: float = 60.0,
    names: tuple[str, ...] = ("first.csv", "withheld.csv"),
) -> Path:
    """Recordings of one gearbox; the fault is that of its instruments."""
    rng = np.random.default_rng(seed)
    folder.mkdir(exist_ok=True)
    for name in names:
        m = driven(rng, seconds)
        shown = read(m, losses(m))
        record(folder / name, m, shown if fault is None else fault(shown), rng)
    return folder


def with_motor(shown: Readings, change: Callable[[Array], Array]) -> Readings:
    return replace(shown, motor=change(shown.motor))


def with_brake(shown: Readings, change: Callable[[Array], Array]) -> Readings:
    return replace(shown, brake=change(shown.brake))
