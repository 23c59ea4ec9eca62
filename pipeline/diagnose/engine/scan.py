"""The scan: one p-value for each kind of structure, for data and synthetic noise alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.fit.span import orthonormal

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.grid.readings import Readings
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


def make_scan(readings: Readings, baseline: Array, columns: list[Array], repeats: Array, narrow: int = 0) -> Scan:
    """Projections for a baseline, whitened family columns and repeat contrasts.

    The last `narrow` families are looked at one by one; the scatter is judged with them in it.
    """
    base = orthonormal(baseline)
    bases = []
    for block in columns:
        length = np.linalg.norm(block, axis=0)
        unit = block[:, length > 0.0] / length[length > 0.0]
        left = unit - base @ (base.T @ unit)
        kept = left[:, np.linalg.norm(left, axis=0) > ABSORBED]
        bases.append(orthonormal(kept, 1e-3))
    everything = orthonormal(np.hstack([base, *bases[: len(bases) - narrow]]))
    ordinary = readings.configuration != "engaged"
    sides = []
    for mine in (readings.sun, ~readings.sun):
        whole = repeats[:, (repeats[mine & ordinary] != 0.0).any(axis=0)]
        sides.append(whole)
    return Scan(base, everything, tuple(bases), readings.sun, tuple(sides))


def look_elsewhere(p_value: float, smallest: Array) -> float:
    """Probability that a campaign of pure noise shows something as clear: of its smallest nominal p-values (draws,)."""
    return (1.0 + float(np.sum(smallest <= p_value))) / (len(smallest) + 1.0)


@dataclass(frozen=True)
class Step:
    """One step of a search: what was looked at, and the clearest of it.

    Parameters
    ----------
    scan : Scan
        With everything found before in its baseline.
    nominal : (t,) array
        Nominal p-values of the tests.
    observed : (t,) array
        The same as they are compared with each other and with `smallest`.
    smallest : (draws,) array
        Smallest p-value of each synthetic campaign.
    best : int
        The clearest test.
    p_value : float
        Of the clearest, the search paid for.
    """

    scan: Scan
    nominal: Array
    observed: Array
    smallest: Array
    best: int
    p_value: float


def search(
    readings: Readings,
    baseline: Array,
    columns: list[Array],
    repeats: Array,
    white: tuple[Array, Array],
    *,
    steps: int,
    level: float,
    elsewhere: Array | None = None,
    narrow: int = 0,
) -> Iterator[Step]:
    r"""Step by step the clearest structure, each time with the earlier ones added to the baseline.

    Parameters
    ----------
    readings : Readings
        The m readings.
    baseline : (m, k) array
        Whitened columns of what is fitted.
    columns : list of (m, c) array
        Whitened columns of the families.
    repeats : (m, r) array
        Contrasts of repeated readings.
    white : (m, 1) and (m, draws) array
        Whitened residual and synthetic noise.
    steps : int
        Most steps.
    level : float
        Level above which the search ends; the step that ends it is given too.
    elsewhere : (draws,) array, optional
        Smallest p-value of each synthetic campaign in other searches that are paid for together with this one; only
        the families then count, not repeats and single points, and each on its own scale.
    narrow : int
        How many of the last families are narrow.

    Notes
    -----
    Rounding alone gives some families a small nominal p-value in every synthetic campaign, and the smallest of all
    would then be that of these. On its own scale :math:`-\ln p` is divided by its mean over the synthetic campaigns,
    1 for a p-value that is uniform; where the mean is below 1, p is left as it is.
    """
    y, noise = white
    counted = slice(None) if elsewhere is None else slice(len(columns))
    for _ in range(steps):
        scan = make_scan(readings, baseline, columns, repeats, narrow)
        observed = nominal = scan(y)[counted, 0]
        drawn = scan(noise)[counted]
        if elsewhere is not None:
            power = 1.0 / np.maximum(-np.log(drawn).mean(axis=1), 1.0)
            observed, drawn = nominal**power, np.r_[drawn ** power[:, None], elsewhere[None, :]]
        smallest = drawn.min(axis=0)
        best = int(np.argmin(observed))
        p_value = look_elsewhere(float(observed[best]), smallest)
        yield Step(scan, nominal, observed, smallest, best, p_value)
        if p_value > level or best >= len(columns):
            return
        baseline = np.hstack([baseline, columns[best]])
