"""Repeats and order: rising against falling runs of the same points, and how repeated points drift with time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.fit.loss_fit import shaft_drags
from pmg.pipeline.fit.noise_floor import repeat_contrasts
from pmg.pipeline.grid.readings import take_readings
from pmg.sim.shafts import SIDES
from pmg.sim.signals import HOUR

if TYPE_CHECKING:
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array

SHORTEST = 5
"""Speeds that a run passes at least, and points that a rising and a falling run must have in common."""

MINIMUM_DOF = 3
"""Degrees of freedom from which a slope in time is reported."""


@dataclass(frozen=True)
class OrderContrast:
    """Points of one shaft that were run both with rising and with falling speed.

    Parameters
    ----------
    shaft : str
        ``sun`` or ``ring``.
    speed : (n,) array
        Magnitude of the shaft's speed at the common points [rad/s].
    difference : (n,) array
        Drag when falling minus drag when rising [N m].
    mean, mean_u, mean_p : float
        Mean difference [N m], its standard error, and the p-value that there is none.
    slope, slope_u, slope_p : float
        Trend of the difference with speed [N m s/rad].
    hours : float
        Mean time from the rising to the falling reading [h]; negative where falling came first.
    """

    shaft: str
    speed: Array
    difference: Array
    mean: float
    mean_u: float
    mean_p: float
    slope: float
    slope_u: float
    slope_p: float
    hours: float


@dataclass(frozen=True)
class RepeatDrift:
    """Drift of repeated neutral points of one shaft.

    Parameters
    ----------
    shaft : str
        ``sun`` or ``ring``.
    slope, slope_u : float
        Change of drag with time and its standard error [N m/s].
    p : float
        p-value that there is none.
    dof : int
        Degrees of freedom.
    scatter : float
        Standard deviation of repeats about the trend [N m].
    hours : float
        Time that the repeats span [h].
    """

    shaft: str
    slope: float
    slope_u: float
    p: float
    dof: int
    scatter: float
    hours: float


@dataclass(frozen=True)
class Drift:
    """Drift and repeatability from the order and the repeats of a campaign.

    Parameters
    ----------
    orders : tuple of OrderContrast
        Shafts with points run both ways.
    repeats : tuple of RepeatDrift
        Shafts with repeats enough for a slope.
    reason : str
        Why there is nothing to compare, where there is nothing.
    """

    orders: tuple[OrderContrast, ...]
    repeats: tuple[RepeatDrift, ...]
    reason: str = ""


def _monotone_runs(levels: Array, *, rising: bool) -> list[tuple[int, int]]:
    """Stretches (begin, end) of a series that never turn back and pass at least five values.

    Parameters
    ----------
    levels : (n,) array
        Speeds in the order of the test, rounded, so that a repeated speed is a repeated value.
    rising : bool
        Rising, or falling.
    """
    steps = np.diff(levels if rising else -levels)
    cuts = np.r_[0, np.flatnonzero(steps < 0.0) + 1, len(levels)]
    runs = zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True)
    return [(a, b) for a, b in runs if len(np.unique(levels[a:b])) >= SHORTEST]


def _slope(x: Array, y: Array) -> tuple[float, float, float]:
    """Slope of y over x with a constant, its standard error and p-value; NaN where x does not vary."""
    d, n = x - x.mean(), len(x)
    spread = float(d @ d)
    if n < MINIMUM_DOF + 2 or spread <= 1e-9 * max(float(x @ x), 1e-300):
        return math.nan, math.nan, math.nan
    slope = float(d @ y) / spread
    left = y - y.mean() - slope * d
    u = math.sqrt(float(left @ left) / (n - 2) / spread)
    return slope, u, _two_sided(slope, u, n - 2)


def _two_sided(value: float, u: float, dof: int) -> float:
    return float(2.0 * stats.t.sf(abs(value) / u, dof)) if u > 0.0 else (1.0 if value == 0.0 else 0.0)


def _order(grid: Grid, shaft: str) -> OrderContrast | None:
    reading = shaft_drags(grid)[shaft]
    at = grid.points
    rows = np.flatnonzero(reading.rows & np.isfinite(at.started_at))
    rows = rows[np.argsort(at.started_at[rows], kind="stable")]
    levels = np.asarray(np.round(np.abs(reading.speed[rows])), dtype=np.float64)
    passed: dict[bool, dict[tuple[int, int, int], list[int]]] = {True: {}, False: {}}
    for rising in (True, False):
        for begin, end in _monotone_runs(levels, rising=rising):
            for i in rows[begin:end]:
                key = (int(at.gear[i]), round(float(at.speed_sun[i])), round(float(at.speed_ring[i])))
                passed[rising].setdefault(key, []).append(int(i))
    speed, difference, time = [], [], []
    for key, up in passed[True].items():
        down = [i for i in passed[False].get(key, []) if i not in up]
        up = [i for i in up if i not in passed[False].get(key, [])]
        if up and down:
            speed.append(float(np.mean(np.abs(reading.speed[up]))))
            difference.append(float(np.mean(reading.drag[down]) - np.mean(reading.drag[up])))
            time.append(float(np.mean(at.started_at[down]) - np.mean(at.started_at[up])))
    n = len(difference)
    if n < SHORTEST:
        return None
    d, x = np.array(difference), np.array(speed)
    mean, u = float(d.mean()), float(d.std(ddof=1)) / math.sqrt(n)
    return OrderContrast(shaft, x, d, mean, u, _two_sided(mean, u, n - 1), *_slope(x, d), float(np.mean(time)) / HOUR)


def _repeats(grid: Grid, bench: BenchParameters) -> tuple[RepeatDrift, ...]:
    readings = take_readings(grid, bench)
    at = grid.points
    readings = readings[(readings.configuration == "neutral") & np.isfinite(at.started_at[readings.row])]
    if len(readings) == 0:
        return ()
    contrasts = repeat_contrasts(readings)
    time = at.started_at[readings.row]
    time = time - time.min()
    found = []
    for shaft, mine in readings.of_shaft.items():
        columns = contrasts[:, (contrasts[mine] != 0.0).any(axis=0)]
        used = (columns != 0.0).any(axis=1)
        x, y = columns.T @ time, columns.T @ (readings.direction * readings.torque)
        dof, spread = len(y) - 1, float(x @ x)
        if dof < MINIMUM_DOF or spread <= 0.0:
            continue
        slope = float(x @ y) / spread
        scatter = math.sqrt(float(np.sum((y - slope * x) ** 2)) / dof)
        u = scatter / math.sqrt(spread)
        hours = float(np.ptp(time[used])) / HOUR
        found.append(RepeatDrift(shaft, slope, u, _two_sided(slope, u, dof), dof, scatter, hours))
    return tuple(found)


def find_drift(grid: Grid, bench: BenchParameters) -> Drift:
    r"""Rising against falling runs, and repeats against time, as far as a campaign holds them.

    Parameters
    ----------
    grid : Grid
        Measured grid; its accepted neutral points are used.
    bench : BenchParameters
        Ratio of the stages.

    Notes
    -----
    A run is a stretch of points, in the order of the test, over which a shaft's speed never turns back and passes at
    least five values; readings of a shaft at rest belong to no run, and those at a turn to neither. Two points are the
    same when gear and both speeds (to 1 rad/s) agree. The older campaign of the thesis rose from cold and the newer one
    fell from hot (its section 6.1): the difference of the two mixes temperature, hysteresis of the order, and any
    drift, and is reported as found. The mean difference has the t test of n - 1 degrees of freedom.

    The drift of repeats is the slope of :math:`T_{ij} = \mu_i + s\,t_{ij}` with a constant for each set-point i, from
    orthonormal differences of its repeats.
    """
    if not np.isfinite(grid.points.started_at).any():
        return Drift((), (), "The order of the points is not known, so nothing can be said of drift.")
    orders = tuple(found for shaft in SIDES if (found := _order(grid, shaft)) is not None)
    repeats = _repeats(grid, bench)
    reason = ""
    if not orders and not repeats:
        reason = (
            "No point was run both with rising and with falling speed, and too few were repeated: nothing can be said "
            "of drift."
        )
    return Drift(orders, repeats, reason)
