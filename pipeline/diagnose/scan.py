"""The scan: one p-value for each kind of structure, for data and synthetic noise alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.diagnose.noise import orthonormal

if TYPE_CHECKING:
    from pmg.pipeline.readings import Readings
    from pmg.sim.signals import Array, Mask

MINIMUM_ROOM = 0.2
"""Part of a reading's standard deviation that the fit must leave before it can be called an outlier."""

ABSORBED = 1e-2
"""A column of which less than this part survives the baseline cannot be seen, and is not looked for."""


@dataclass(frozen=True)
class Scan:
    """Projections that turn whitened readings into one p-value a family; the same for data and synthetic noise."""

    baseline: Array
    everything: Array
    bases: tuple[Array, ...]
    sun: Mask
    contrasts: tuple[Array, ...]

    def __call__(self, white: Array) -> Array:
        """Nominal p-values (families + 2 repeat tests a shaft + 1, draws) of whitened columns (m, draws)."""
        left = white - self.everything @ (self.everything.T @ white)
        leverage = np.einsum("ij,ij->i", self.everything, self.everything)
        variance, dof = [], []
        for mine in (self.sun, ~self.sun):
            free = float(np.sum(1.0 - leverage[mine]))
            dof.append(max(free, 1.0))
            variance.append(np.sum(left[mine] ** 2, axis=0) / max(free, 1.0) if free > 1.0 else np.ones(white.shape[1]))
        scale = np.where(self.sun[:, None], np.sqrt(variance[0]), np.sqrt(variance[1]))
        residual = white - self.baseline @ (self.baseline.T @ white)
        standard = residual / scale
        rows = []
        for basis in self.bases:
            k = basis.shape[1]
            if k == 0:
                rows.append(np.ones(white.shape[1]))
                continue
            on_sun = float(np.sum(basis[self.sun] ** 2)) > 0.5 * k
            statistic = np.sum((basis.T @ standard) ** 2, axis=0) / k
            rows.append(stats.f.sf(statistic, k, dof[0] if on_sun else dof[1]))
        for side, columns in enumerate(self.contrasts):
            if columns.shape[1]:
                ratio = np.mean((columns.T @ residual) ** 2, axis=0) / variance[side]
                rows.append(2.0 * stats.f.sf(ratio, columns.shape[1], dof[side]))
                rows.append(2.0 * stats.f.cdf(ratio, columns.shape[1], dof[side]))
        room = np.sqrt(np.maximum(1.0 - np.einsum("ij,ij->i", self.baseline, self.baseline), 1e-6))
        usable = room > MINIMUM_ROOM
        largest = np.max(np.abs(standard[usable]) / room[usable, None], axis=0)
        rows.append(np.minimum(2.0 * usable.sum() * stats.t.sf(largest, min(dof)), 1.0))
        return np.clip(np.stack(rows), 1e-300, 1.0)


def make_scan(readings: Readings, baseline: Array, columns: list[Array], repeats: Array) -> Scan:
    """Projections for a baseline, whitened family columns and repeat contrasts."""
    base = orthonormal(baseline)
    bases = []
    for block in columns:
        length = np.linalg.norm(block, axis=0)
        unit = block[:, length > 0.0] / length[length > 0.0]
        left = unit - base @ (base.T @ unit)
        kept = left[:, np.linalg.norm(left, axis=0) > ABSORBED]
        bases.append(orthonormal(kept, 1e-3))
    everything = orthonormal(np.hstack([base, *bases]))
    ordinary = readings.configuration != "engaged"
    sides = []
    for mine in (readings.sun, ~readings.sun):
        whole = repeats[:, (repeats[mine & ordinary] != 0.0).any(axis=0)]
        sides.append(whole)
    return Scan(base, everything, tuple(bases), readings.sun, tuple(sides))
