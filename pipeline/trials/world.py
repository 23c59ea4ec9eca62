"""The baseline of the proving bench: drag, magnetic loss, loads and noise, drawn anew for each campaign."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

from pmg.pipeline.recording.write import SPAN_HZ
from pmg.pipeline.trials.design import acting, ratio_of

if TYPE_CHECKING:
    from pmg.pipeline.trials.design import CampaignDesign
    from pmg.sim.signals import Array

DRAG_SPEED = 70.0
"""Speed at which the scale of the drag curves is given [rad/s]."""
FASTEST_SUN, FASTEST_RING = 196.0, 75.4
"""Highest speeds of the shafts [rad/s], to make speeds dimensionless."""
SECOND_SPEED = 25.0
"""Speed beyond which the weak second term of a drag curve flattens [rad/s]."""
NOMINAL_SUN, NOMINAL_RING = 5.0, 10.0
"""Nominal torques of the transducers [N m]."""
STEP_HZ = 0.19
"""Resolution of the transducers' frequency [Hz]."""
WINDOW, RATE = 5.0, 500.0
"""Length of a window [s] and samples per second [1/s]."""


@dataclass(frozen=True)
class DragCurve:
    """Drag of a shaft in neutral, :math:`a + b\\,(w/w_0)^p + c\\,w/(w + w_1)` [N m]."""

    a: float
    b: float
    p: float
    c: float

    def drag(self, speed: Array) -> Array:
        """Drag against the rotation, with the sign of the torque that the motor applies; none at rest."""
        w = np.abs(speed)
        return np.sign(speed) * (self.a + self.b * (w / DRAG_SPEED) ** self.p + self.c * w / (w + SECOND_SPEED))


@dataclass(frozen=True)
class ReadingNoise:
    """Scatter of the readings.

    Parameters
    ----------
    white_sun, white_ring : float
        Standard deviation of the samples within a window [N m].
    wander : float
        Standard deviation from point to point [N m].
    correlation : float
        Of the wander, from one point to the next.
    growth : float
        Relative growth of the wander's variance up to the highest speed.
    outliers : int
        Points that are off by much more.
    """

    white_sun: float
    white_ring: float
    wander: float
    correlation: float
    growth: float
    outliers: int

    @property
    def mean_sun(self) -> float:
        """Standard uncertainty of the mean of a window, sun [N m]."""
        return float(np.sqrt((self.white_sun**2 + _step(NOMINAL_SUN) ** 2 / 12.0) / (WINDOW * RATE)))

    @property
    def mean_ring(self) -> float:
        """Standard uncertainty of the mean of a window, ring [N m]."""
        return float(np.sqrt((self.white_ring**2 + _step(NOMINAL_RING) ** 2 / 12.0) / (WINDOW * RATE)))

    def wander_scale(self, speed: Array, fastest: float) -> Array:
        """Standard deviation of the wander at a speed [N m]."""
        return self.wander * np.sqrt(1.0 + self.growth * (speed / fastest) ** 2)

    def wander_of(self, speed: Array, fastest: float, rng: np.random.Generator) -> Array:
        """One draw of the wander, point by point in the order in which they were run [N m]."""
        rho, n, settle = self.correlation, len(speed), 50
        fresh = rng.standard_normal(n + settle)
        chain = lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], fresh)[settle:]
        found = self.wander_scale(speed, fastest) * chain
        if self.outliers:
            struck = rng.choice(n, self.outliers, replace=False)
            found[struck] += self.wander * rng.choice([-1.0, 1.0], self.outliers) * rng.uniform(4.0, 9.0, self.outliers)
        return np.asarray(found)


@dataclass(frozen=True)
class World:
    """Constants of one proving bench.

    Parameters
    ----------
    sun, ring : DragCurve
        Drag in neutral.
    bearing_part : float
        Part of it that is left when engaged.
    hysteresis : float
        Constant drag of the engaged gear on each rotor [N m].
    eddy : float
        Its drag per speed [N m s/rad].
    load_error, load_follows : float
        Relative error of the load control, and the part of the ring's drag that it adds.
    ambient : float
        Temperature of the room at the start [degC].
    start_rise : float
        Bearings above it at the start [K]: 0 after a night, more when the bench comes from another run.
    drift : float
        Change of the room's temperature through the campaign [K].
    reaction : float
        Standard deviation of the static torque of a shaft held at rest [N m].
    noise : ReadingNoise
        How readings scatter.
    """

    sun: DragCurve
    ring: DragCurve
    bearing_part: float
    hysteresis: float
    eddy: float
    load_error: float
    load_follows: float
    ambient: float
    start_rise: float
    drift: float
    reaction: float
    noise: ReadingNoise

    def drags(self, design: CampaignDesign) -> tuple[Array, Array]:
        """Drag of both rotors without any effect [N m], with the sign of the torque that the motor applies."""
        at = design.at
        part = np.where(at.engaged, self.bearing_part, np.where(at.neutral, 1.0, 0.0))
        found = []
        for curve, speed in ((self.sun, at.speed_sun), (self.ring, at.speed_ring)):
            magnetic = np.sign(speed) * self.hysteresis + self.eddy * speed
            found.append(part * curve.drag(speed) + np.where(at.engaged, magnetic, 0.0))
        return found[0], found[1]

    def load(self, design: CampaignDesign) -> Array:
        """Torque that the ring motor holds when engaged [N m]; 0 elsewhere."""
        at = design.at
        follows = self.load_follows * np.abs(self.ring.drag(at.speed_ring))
        return np.where(at.engaged, at.load_set * (1.0 + self.load_error) + np.sign(at.load_set) * follows, 0.0)

    def uncertainties(self, design: CampaignDesign) -> tuple[Array, Array]:
        """Standard uncertainty of the loss readings of sun and ring [N m]; engaged, the load's enters the sun's."""
        at, noise = design.at, self.noise
        sun = np.hypot(noise.wander_scale(at.speed_sun, FASTEST_SUN), noise.mean_sun)
        ring = np.hypot(noise.wander_scale(at.speed_ring, FASTEST_RING), noise.mean_ring)
        return np.where(at.engaged, np.hypot(sun, ring / ratio_of(at)), sun), ring

    def sigma(self, design: CampaignDesign) -> float:
        """Standard uncertainty of one point's mean [N m]: root mean square over the readings that tell a loss."""
        sun, ring = self.uncertainties(design)
        rows_sun, rows_ring = acting(design.at)
        return float(np.sqrt(np.mean(np.r_[sun[rows_sun], ring[rows_ring]] ** 2)))


def draw_world(rng: np.random.Generator, outliers: int = 0) -> World:
    """A bench whose losses are of the size of the published ones, with that many readings far off."""
    second = rng.random(2) < 0.4
    sun = DragCurve(
        a=rng.uniform(0.008, 0.018),
        b=rng.uniform(0.065, 0.085),
        p=rng.uniform(0.45, 0.7),
        c=float(second[0]) * rng.uniform(-4e-3, 4e-3),
    )
    ring = DragCurve(
        a=rng.uniform(0.02, 0.045),
        b=rng.uniform(0.21, 0.27),
        p=rng.uniform(0.3, 0.55),
        c=float(second[1]) * rng.uniform(-6e-3, 6e-3),
    )
    noise = ReadingNoise(
        white_sun=rng.uniform(0.010, 0.016),
        white_ring=rng.uniform(0.017, 0.026),
        wander=rng.uniform(0.6e-3, 1.2e-3),
        correlation=rng.uniform(0.0, 0.4),
        growth=rng.uniform(0.3, 1.5) if rng.random() < 0.3 else 0.0,
        outliers=outliers,
    )
    return World(
        sun=sun,
        ring=ring,
        bearing_part=rng.uniform(0.75, 0.92),
        hysteresis=rng.uniform(0.0, 6e-4),
        eddy=rng.uniform(1.8e-4, 2.8e-4),
        load_error=rng.uniform(-0.01, 0.03),
        load_follows=rng.uniform(0.0, 0.15),
        ambient=rng.uniform(19.0, 25.0),
        start_rise=rng.uniform(8.0, 25.0) if rng.random() < 0.5 else 0.0,
        drift=rng.uniform(-2.0, 3.0),
        reaction=rng.uniform(2e-3, 6e-3),
        noise=noise,
    )


def _step(nominal: float) -> float:
    """Torque of one step of the transducer's frequency [N m]."""
    return STEP_HZ / SPAN_HZ * nominal
