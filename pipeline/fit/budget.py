"""The budget of every point of a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.whitening import NOISY_WINDOW
from pmg.pipeline.grid.contributions import Contribution, ShaftBudget
from pmg.pipeline.grid.transducer_uncertainty import (
    RECTANGULAR,
    common_parts,
    nominal_torque,
    tare_uncertainty,
    undithered,
)
from pmg.sim.shafts import PerShaft, per_shaft

if TYPE_CHECKING:
    from pmg.pipeline.fit.noise import NoiseFloor, ShaftNoise
    from pmg.pipeline.grid.window_facts import ShaftFacts, WindowFacts
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class Budget(PerShaft[ShaftBudget]):
    """Both shafts' budgets at the points of a grid.

    Parameters
    ----------
    sun, ring : ShaftBudget
        The shafts.
    grid : Grid
        The n points.
    facts : WindowFacts or None
        What is known of the windows; None where the grid comes from tables.
    floor : NoiseFloor or None
        Noise of one point; None where it was not estimated.
    """

    grid: Grid
    facts: WindowFacts | None
    floor: NoiseFloor | None = None


def budget_of(grid: Grid, floor: NoiseFloor | None, bench: BenchParameters, facts: WindowFacts | None = None) -> Budget:
    """The budget of every point.

    Parameters
    ----------
    grid : Grid
        With the uncertainty of each point, the wander between points included once `floor` is known.
    floor : NoiseFloor or None
        Noise of one point.
    bench : BenchParameters
        Tolerances of the transducers.
    facts : WindowFacts, optional
        What the store knows of the windows of the grid.

    Notes
    -----
    Independent and common parts add up to ``u_sun`` and ``common_sun`` of the grid (ring alike). Where windows are
    pooled in the noise floor, each stands with the pooled scatter; one that is noisier than the rest with its own, as
    in `pmg.pipeline.fit.whitening.with_floor`.
    """
    noise: PerShaft[ShaftNoise | None] = floor or PerShaft(None, None)
    windows: PerShaft[ShaftFacts | None] = facts or PerShaft(None, None)
    shafts = per_shaft(lambda side: _shaft(grid, side, noise[side], bench, windows[side]))
    return Budget(shafts.sun, shafts.ring, grid, facts, floor)


def _shaft(
    grid: Grid, side: str, noise: ShaftNoise | None, bench: BenchParameters, facts: ShaftFacts | None
) -> ShaftBudget:
    return ShaftBudget(
        side, grid.torque[side], (*_independent(grid, side, noise, facts), *_common(grid, side, bench, facts))
    )


def _independent(
    grid: Grid, side: str, noise: ShaftNoise | None, facts: ShaftFacts | None
) -> tuple[Contribution, Contribution, Contribution]:
    """Contributions that differ from point to point: scatter, wander, resolution."""
    own, u = grid.within[side], grid.u[side]
    unknown = np.full(len(grid), np.nan)
    dof = unknown if facts is None else facts.dof
    within, wander_dof = own, np.full(len(grid), math.inf)
    if noise is not None:
        noisy, pooled = own > NOISY_WINDOW * noise.within, float(np.nansum(dof[grid.accepted])) or math.nan
        within, dof = np.where(noisy, own, noise.within), np.where(noisy, dof, pooled)
        if noise.dof:
            wander = np.sqrt(np.maximum(u**2 - within**2, 0.0))
            wander_dof = _wander_dof(wander, noise, pooled)
            dof = np.where(noisy | (wander > 0.0), dof, np.fmin(dof, noise.dof))
    within = np.minimum(within, u)
    steps = unknown if facts is None else facts.resolution
    rounding = np.zeros(len(grid)) if facts is None else undithered(steps, facts.std)
    rounding = np.minimum(rounding, within)
    return (
        _scatter(grid, np.sqrt(within**2 - rounding**2), dof),
        Contribution(
            key="wander",
            name="wander from point to point",
            kind="A",
            distribution="t",
            common=False,
            divisor=1.0,
            value=np.sqrt(np.maximum(u**2 - within**2, 0.0)) if noise is None or noise.dof else unknown,
            dof=wander_dof,
            remark="none estimated" if noise is None else noise.source,
        ),
        _half_width(
            "resolution",
            "resolution",
            unknown if facts is None else rounding * RECTANGULAR,
            "in the rounding" if grid.rounding else "in the scatter, where that is at least half a step",
            common=False,
        ),
    )


def _wander_dof(wander: Array, noise: ShaftNoise, within_dof: float) -> Array:
    r"""Degrees of freedom of the wander of each point (n,) [N m].

    Notes
    -----
    Wander is what the scatter of the points has beyond that within their windows, :math:`w^2 = s^2 - u^2`, so that

    .. math:: \nu_w = \frac{w^4}{s^4/\nu_s + u^4/\nu_u}

    and both together are known as well as the scatter of the points is, not as the pooled windows are.
    """
    among = (wander**2 + noise.within**2) ** 2 / noise.dof
    inside = noise.within**4 / within_dof if within_dof > 0.0 else 0.0
    return np.asarray(wander**4 / (among + inside))


def _common(grid: Grid, side: str, bench: BenchParameters, facts: ShaftFacts | None) -> tuple[Contribution, ...]:
    """Contributions that all points of a transducer share: tare, sensitivity, non-linearity, calibration."""
    unknown = np.full(len(grid), np.nan)
    stated = None if facts is None else facts.nominal
    parts = common_parts(grid, bench, side, stated)
    zeros = tare_uncertainty(grid.torque[side][grid.points.zero & grid.accepted])[1]
    of = bench.transducers[side]
    return (
        Contribution(
            key="tare",
            name="tare",
            kind="A",
            distribution="t",
            common=True,
            divisor=1.0,
            value=parts.tare if zeros else unknown,
            dof=np.full(len(grid), float(zeros) if zeros else math.inf),
            remark=f"{zeros + 1} zero checks, not subtracted" if zeros else "not known: fewer than two zero checks",
            signed=False,
        ),
        _half_width(
            "sensitivity",
            "sensitivity",
            parts.sensitivity * RECTANGULAR,
            f"tolerance {float(of.sensitivity_tolerance):.1%} of the reading",
            common=True,
        ),
        _half_width(
            "linearity",
            "non-linearity",
            parts.linearity * RECTANGULAR,
            f"tolerance {float(of.nonlinearity):.1%} of {_each(nominal_torque(bench, side, stated))} N m",
            common=True,
        ),
        _half_width(
            "calibration",
            "calibration",
            unknown,
            "recordings state no uncertainty of null and span; the tolerances stand for it",
            common=True,
        ),
    )


def _scatter(grid: Grid, within: Array, dof: Array) -> Contribution:
    """Scatter within the window; for a grid from tables, the rounding of their torques."""
    if grid.rounding:
        return _half_width("within", "rounding of the table", within * RECTANGULAR, "half a step", common=False)
    remark = "means over whole revolutions, pooled where windows are alike"
    return Contribution("within", "scatter within the window", "A", "t", False, 1.0, within, dof, remark)


def _each(values: Array) -> str:
    """Every value that occurs."""
    return " and ".join(f"{value:g}" for value in np.unique(values))


def _half_width(key: str, name: str, value: Array, remark: str, *, common: bool) -> Contribution:
    """A contribution given by the half-width of a rectangular distribution [N m] (n,)."""
    known = np.full(len(value), np.inf)
    return Contribution(key, name, "B", "rectangular", common, RECTANGULAR, value, known, remark)
