"""A bench of its own for recovery tests: other functional forms than pmg's models, and correlated noise.

Bearing drag is a power law with a breakaway at low speed, not a polynomial; noise between points is an autoregressive
wander on top of white scatter, so that no formula of the analysis is met by construction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from pmg.sim.grid import Grid, OperatingPoints
from pmg.sim.signals import Array
from tests.points import joined, measured, points

RATIO = 2.6
SUN_RPM = np.array([0, 60, 90, 120, 156, 312, 468, 624, 780, 936, 1092, 1248, 1404, 1560, 1716, 1872], dtype=float)
RING_RPM = np.arange(0.0, 721.0, 60.0)
LOADS = np.array([0.78, 1.17, 1.56, 1.95])


@dataclass(frozen=True)
class Nature:
    """Constants of the made-up bench; torques in N m, speeds in rad/s."""

    sun: tuple[float, float, float] = (0.013, 0.075, 0.6)
    ring: tuple[float, float, float] = (0.028, 0.25, 0.42)
    bearing_part: float = 0.87
    hysteresis: float = 4e-4
    eddy: float = 2.1e-4
    wander: float = 1.0e-3
    wander_correlation: float = 0.2
    white: float = 0.45e-3

    def drag(self, constants: tuple[float, float, float], speed: Array) -> Array:
        base, scale, exponent = constants
        w = np.abs(speed)
        return base * np.tanh(w / 1.5) + scale * (w / 150.0) ** exponent

    def noise(self, n: int, rng: np.random.Generator) -> Array:
        rho = self.wander_correlation
        chain = lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], rng.standard_normal(n + 100))[100:]
        return self.wander * chain + self.white * rng.standard_normal(n)


def campaign_points(order: str, rng: np.random.Generator) -> OperatingPoints:
    """Neutral grid, engaged grid, repeats, reversed flow and rotation, zero checks, with times half a minute apart."""
    sun, ring = (axis.ravel() for axis in np.meshgrid(SUN_RPM, RING_RPM, indexing="ij"))
    moving = (sun > 0) | (ring > 0)
    speed, load = (axis.ravel() for axis in np.meshgrid(SUN_RPM[4:], LOADS, indexing="ij"))
    neutral = points("neutral", sun[moving], ring[moving])
    engaged = points("engaged", speed, -speed / RATIO, load_set=load)
    again = rng.choice(len(neutral), 10, replace=False)
    back_speed, back_load = (
        axis.ravel() for axis in np.meshgrid([312.0, 780.0, 1248.0, 1872.0], LOADS[[0, 2, 3]], indexing="ij")
    )
    back = points("engaged", back_speed, -back_speed / RATIO, load_set=-back_load, drive="ring")
    turned = points("neutral", [-156.0, -780.0, -1872.0, -312.0], [-60.0, -480.0, -720.0, -360.0])
    zero = points("zero", np.zeros(2), np.zeros(2))
    main = joined(neutral, engaged)
    order_main = (
        rng.permutation(len(main))
        if order == "random"
        else np.r_[np.arange(len(neutral))[::-1], np.arange(len(neutral), len(main))]
    )
    whole = joined(zero, main[order_main], neutral[again], back, turned, zero, zero[np.array([0])])
    started = 1.7e9 + np.cumsum(rng.uniform(20.0, 60.0, len(whole)))
    return replace(whole, started_at=started)


def measure(
    nature: Nature,
    at: OperatingPoints,
    rng: np.random.Generator,
    *,
    ring_factor: Array | float = 1.0,
    sun_gain: float = 0.0,
    sun_offset: float = 0.0,
) -> tuple[Grid, Array, Array]:
    """Readings of a campaign, and what they would be without noise.

    `ring_factor` scales the ring's bearing drag point by point, `sun_gain` and `sun_offset` [N m] distort the sun's
    transducer.
    """
    w_s, w_r = at.speed_sun, at.speed_ring
    sun, ring = nature.drag(nature.sun, w_s), ring_factor * nature.drag(nature.ring, w_r)
    part = np.where(at.engaged, nature.bearing_part, 1.0)
    loss_s = part * sun + np.where(at.engaged, nature.hysteresis + nature.eddy * np.abs(w_s), 0.0)
    loss_r = part * ring + np.where(at.engaged, nature.hysteresis + nature.eddy * np.abs(w_r), 0.0)
    load = at.load_set + 0.0 * w_r
    true_ring = np.where(at.engaged, load, np.sign(w_r) * loss_r)
    transmitted = (load - np.sign(w_r) * loss_r) / RATIO
    true_sun = np.where(at.engaged, transmitted + np.sign(w_s) * loss_s, np.sign(w_s) * loss_s)
    read_sun = (1.0 + sun_gain) * true_sun + sun_offset + nature.noise(len(at), rng)
    read_ring = true_ring + nature.noise(len(at), rng)
    return measured(at, read_sun, read_ring, nature.white), true_sun, true_ring
