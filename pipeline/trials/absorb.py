"""Size of an effect once a free baseline has absorbed its part, in standard uncertainties of a point."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.design import acting, ratio_of
from pmg.pipeline.trials.effect import BenchRun, Effect, torques

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.trials.effect import Pair
    from pmg.sim.signals import Array

POWERS = (0.0, 0.5, 1.0, 2.0)
"""Powers of speed that a generic drag curve is made of."""
CEILING = 0.06
"""Largest root mean square of an effect over the readings it touches [N m]: half of a mean drag of the bench."""
TOLERANCE = 2e-3
"""Relative error of a size that is left."""
ROUNDS = 30
"""Corrections at most: a size that saturates is not reached at all."""
NOTHING = 1e-12
"""Torque below which a reading is not touched [N m]."""


@dataclass(frozen=True)
class Yardstick:
    """The readings of a scene as one vector, and the space of what a generic baseline takes up."""

    scene: BenchRun

    def stack(self, shown: Pair) -> Array:
        """Readings of sun and ring in neutral, of the sun less the load engaged, of both at rest [N m]."""
        at = self.scene.design.at
        sun, ring = shown
        loss = np.where(at.engaged, sun - ring / ratio_of(at), sun)
        rows_sun, rows_ring = acting(at)
        return np.asarray(np.r_[loss[rows_sun | at.zero], ring[rows_ring | at.zero]])

    @cached_property
    def bare(self) -> Array:
        """The readings without any effect [N m]."""
        return self.stack(torques(self.scene, ())[1])

    @cached_property
    def space(self) -> Array:
        """Orthonormal columns of the generic baseline.

        Powers of each shaft's own speed, the same drag a little smaller when engaged, and there a constant, a linear
        term and the bearing part itself, which is free.
        """
        scene, at = self.scene, self.scene.design.at
        part = scene.part(scene.world.bearing_part)
        nothing = np.zeros(len(at))
        columns = []
        for k, speed in enumerate(scene.speeds):
            for power in POWERS:
                drag = part * np.sign(speed) * np.abs(speed) ** power
                columns.append((drag, nothing) if k == 0 else (nothing, drag))
        engaged = at.engaged.astype(np.float64)
        own = [curve.drag(w) for curve, w in zip((scene.world.sun, scene.world.ring), scene.speeds, strict=True)]
        columns += [
            (engaged * np.sign(scene.speeds[0]), engaged * np.sign(scene.speeds[1])),
            (engaged * scene.speeds[0], engaged * scene.speeds[1]),
            (engaged * own[0], engaged * own[1]),
        ]
        ratio = ratio_of(at)
        stacked = np.column_stack(
            [self.stack((np.where(at.engaged, sun - ring / ratio, sun), ring * ~at.engaged)) for sun, ring in columns]
        )
        found, triangle = np.linalg.qr(stacked / np.linalg.norm(stacked, axis=0))
        return np.asarray(found[:, np.abs(np.diag(triangle)) > 1e-9])

    def signature(self, effect: Effect) -> Array:
        """Change of the readings by an effect [N m]."""
        return self.stack(torques(self.scene, (effect,))[1]) - self.bare

    def left(self, signature: Array) -> Array:
        """The part that the generic baseline cannot absorb [N m]."""
        return signature - self.space @ (self.space.T @ signature)

    @cached_property
    def sigma(self) -> float:
        """Standard uncertainty of one point's mean [N m]."""
        return self.scene.world.sigma(self.scene.design)


@dataclass(frozen=True)
class Scaled:
    """An effect brought to a size.

    Parameters
    ----------
    effect : Effect
        With its size.
    asked, reached : float
        Size after absorption, asked for and reached [sigma]: root mean square over all readings.
    raw : float
        Size before absorption [sigma], over all readings.
    touched : float
        Size before absorption over the readings it touches [N m].
    absorbed : float
        Part of its power that the generic baseline takes up.
    basis : str
        ``absorbed``: `asked` counts after absorption; ``raw``: before.
    """

    effect: Effect
    asked: float
    reached: float
    raw: float
    touched: float
    absorbed: float
    basis: str

    @property
    def limited(self) -> bool:
        """Whether the size asked for lies beyond what a bench could have."""
        came = self.reached if self.basis == "absorbed" else self.raw
        return abs(came - self.asked) > 0.02 * self.asked


def scale_on(yardstick: Yardstick, effect: Effect, size_sigma: float, basis: str = "absorbed") -> Scaled:
    """The effect, as large as asked for; one yardstick serves several effects of one scene.

    Parameters
    ----------
    yardstick : Yardstick
        Of the scene in which it acts.
    effect : Effect
        Its form, shaft and shape; of its size only the order matters.
    size_sigma : float
        Root mean square over the readings [sigma].
    basis : str
        ``absorbed``: of what a generic baseline cannot take up. ``raw``: of the whole effect.

    Notes
    -----
    An effect that a free baseline takes up nearly whole would have to be absurdly large; it stops at `CEILING`
    or at what its form can be at most, and says so.
    """
    size = effect.form.first
    for _ in range(ROUNDS):
        found = _measured(yardstick, replace(effect, size=size), size_sigma, basis)
        came = found.reached if basis == "absorbed" else found.raw
        wanted = size_sigma / max(came, 1e-9)
        allowed = min(CEILING / max(found.touched, 1e-12), effect.form.most / size)
        if abs(min(wanted, allowed) - 1.0) < TOLERANCE:
            break
        size = min(size * float(np.clip(min(wanted, allowed), 0.02, 50.0)), effect.form.most)
    return found


def _measured(yardstick: Yardstick, effect: Effect, asked: float, basis: str) -> Scaled:
    signature = yardstick.signature(effect)
    left = yardstick.left(signature)
    touched = np.abs(signature) > NOTHING
    raw, reached = (_rms(x) / yardstick.sigma for x in (signature, left))
    absorbed = 1.0 - (reached / raw) ** 2 if raw > 0.0 else 0.0
    return Scaled(effect, asked, reached, raw, _rms(signature[touched]), absorbed, basis)


def _rms(values: Array | Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0
