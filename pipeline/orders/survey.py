"""Covariates that the lines of a whole campaign follow, and mechanisms of the catalogue that make such lines."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import binom

from pmg.pipeline.orders.band import FALSE_ALARM
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    import polars as pl

    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array, Mask

FEWEST_FOLLOWED = 3
"""Points of one configuration from which a line is followed."""
NOTHING_FOLLOWED = f"no line has a number at {FEWEST_FOLLOWED} or more accepted points of one configuration"
"""Text for a line with nothing to follow."""
FEWEST_FITTED = 5
"""Points beyond their band from which growth with speed or load is fitted."""
FALSE_ALARM_LEVEL = 0.05
"""Probability that any of all lines followed is called present where there is only noise."""
LEAST_RATIO = 1.5
"""Highest over lowest speed from which an exponent is fitted."""
LEAST_LOAD = 0.2
"""Span of the loads from which growth with load is fitted, as part of the largest."""
NEAR = 0.2
"""Distance of an exponent from that of a mechanism's law within which it counts as the same, besides 2 u."""

UNBALANCE, MISALIGNMENT = "shaft_unbalance", "coupling_misalignment"
COGGING, ECCENTRICITY = "cogging", "encoder_eccentricity"


@dataclass(frozen=True)
class UncertainValue:
    """A number and its standard uncertainty."""

    value: float
    u: float


@dataclass(frozen=True)
class Belonging:
    """The mechanism of the catalogue that makes such a line.

    Parameters
    ----------
    mechanism : str
        Its id in the library.
    parameter, unit : str
        The parameter that the line fixes, and its unit.
    amplitude : UncertainValue
        Its value.
    """

    mechanism: str
    parameter: str
    unit: str
    amplitude: UncertainValue


@dataclass(frozen=True)
class LineSurvey:
    """One line of one signal over the points of one configuration and gear.

    Parameters
    ----------
    signal, line, configuration : str
        What and where.
    gear : int
        1 or 2.
    points, beyond : int
        Points with a number, and those whose amplitude is beyond its band.
    present : bool
        Whether so many could be beyond by chance is ruled out, all lines looked at paid for.
    amplitude : UncertainValue
        Mean amplitude over the points, noise taken off; NaN where it is not present.
    lowest, highest : float
        Of the amplitudes.
    band : float
        Median band.
    exponent : UncertainValue or None
        Power of the shaft's speed that it grows with.
    per_load : UncertainValue or None
        Growth for each N m of the ring's torque.
    belongs : Belonging or None
        What makes such a line.
    remark : str
        Why it belongs there or not.
    """

    signal: str
    line: str
    configuration: str
    gear: int
    points: int
    beyond: int
    present: bool
    amplitude: UncertainValue
    lowest: float
    highest: float
    band: float
    exponent: UncertainValue | None
    per_load: UncertainValue | None
    belongs: Belonging | None
    remark: str


@dataclass(frozen=True)
class _Points:
    """The numbers of one line over its points."""

    amplitude: Array
    u: Array
    band: Array
    speed: Array
    load: Array


def follow_lines(table: pl.DataFrame, bench: BenchParameters) -> tuple[LineSurvey, ...]:
    """Covariates that each line of a campaign follows, lines that are present first.

    Parameters
    ----------
    table : polars.DataFrame
        Lines of all accepted points of all sources (`kept.COLUMNS`), with `speed_sun`, `speed_ring` [rad/s] and
        `load` [N m], the torque that the ring's shaft carries, of each point.
    bench : BenchParameters
        Poles.

    Notes
    -----
    A line is present where more of its points are beyond their 5 % bands than noise gives (binomial), at
    `FALSE_ALARM_LEVEL` over all lines. Lines that fall together at some speeds only are followed at the others. Phases
    of points without index pulses have no common zero,
    so amplitudes are followed, with the noise's part of their squares taken off.
    Fits in speed and load are weighted; what they leave widens their errors.
    """
    keys = ["configuration", "gear", "signal", "line"]
    known = table.drop_nulls("amplitude")
    points = Counter(known.select("configuration", "gear", "point", "first_sample").unique()["configuration"])
    groups = [
        (key, part)
        for key, part in known.group_by(keys, maintain_order=True)
        if part.height >= FEWEST_FOLLOWED and (" = " not in str(key[3]) or part.height >= points[str(key[0])] / 2.0)
    ]
    found = [_followed(tuple(map(str, key)), part, len(groups), bench) for key, part in groups]
    return tuple(sorted(found, key=lambda f: (not f.present, f.configuration, f.gear, f.signal, -f.highest / f.band)))


def _followed(key: tuple[str, ...], part: pl.DataFrame, tried: int, bench: BenchParameters) -> LineSurvey:
    configuration, gear, signal, line = key
    side = _side(signal, line)
    columns = (part[name].to_numpy() for name in ("amplitude", "u", "band", f"speed_{side}", "load"))
    amplitude, u, band, speed, load = (np.abs(np.asarray(column, dtype=np.float64)) for column in columns)
    points = _Points(amplitude, u, band, speed, load)
    beyond = int(np.count_nonzero(points.amplitude > points.band))
    present = bool(binom.sf(beyond - 1, len(points.amplitude), FALSE_ALARM) * tried < FALSE_ALARM_LEVEL)
    mean = _mean(points) if present else UncertainValue(math.nan, math.nan)
    exponent = _exponent(points) if present else None
    per_load = _per_load(points) if present and configuration == "engaged" else None
    belongs, remark = (None, "within the band of the noise")
    if present:
        belongs, remark = _belonging(signal, line, int(gear), points, exponent, bench)
    return LineSurvey(
        signal,
        line,
        configuration,
        int(gear),
        len(points.amplitude),
        beyond,
        present,
        mean,
        float(points.amplitude.min()),
        float(points.amplitude.max()),
        float(np.median(points.band)),
        exponent,
        per_load,
        belongs,
        remark,
    )


def _side(signal: str, line: str) -> str:
    """Shaft whose speed a line is followed against: its own, else that of the signal."""
    names = line.split(" = ")
    own = [name for name in names if name.split()[0] == signal.rpartition("_")[2]]
    first = (own or names)[0].split()[0]
    return first if first in SIDES else "sun"


def _clean(points: _Points) -> tuple[Array, Mask]:
    """Amplitudes with the noise's part of their squares taken off, where they are beyond it, and which."""
    square = points.amplitude**2 - 2.0 * points.u**2
    good = np.asarray((points.amplitude > points.band) & (square > 0.0), dtype=np.bool_)
    return np.asarray(np.sqrt(square[good])), good


def _mean(points: _Points) -> UncertainValue:
    """Root of the mean square over the points, noise taken off, and its uncertainty from their scatter."""
    square = points.amplitude**2 - 2.0 * points.u**2
    mean = float(square.mean())
    if mean <= 0.0:
        return UncertainValue(math.nan, math.nan)
    size = math.sqrt(mean)
    u = float(square.std(ddof=1)) / math.sqrt(len(square)) / (2.0 * size)
    return UncertainValue(size, math.hypot(u, float(np.sqrt((points.u**2).mean() / len(square)))))


def _exponent(points: _Points) -> UncertainValue | None:
    """Power of the speed in the amplitudes; None where the speeds are too much alike, or too few points beyond."""
    size, good = _clean(points)
    speed = points.speed[good]
    if len(size) < FEWEST_FITTED or speed.min() <= 0.0 or speed.max() < LEAST_RATIO * speed.min():
        return None
    return _slope(np.log(speed), np.log(size), points.u[good] / size)


def _per_load(points: _Points) -> UncertainValue | None:
    """Growth of the amplitude with load; None where the loads are too much alike."""
    size, good = _clean(points)
    load = points.load[good]
    if len(size) < FEWEST_FITTED or np.ptp(load) < LEAST_LOAD * load.max():
        return None
    return _slope(load, size, points.u[good])


def _slope(x: Array, y: Array, u: Array) -> UncertainValue:
    """Slope of a weighted straight line; its error is widened by what the line leaves."""
    weight = 1.0 / u**2
    centre = float((weight * x).sum() / weight.sum())
    spread = float((weight * (x - centre) ** 2).sum())
    slope = float((weight * (x - centre) * y).sum()) / spread
    rest = y - float((weight * y).sum() / weight.sum()) - slope * (x - centre)
    widening = max(1.0, float((weight * rest**2).sum()) / (len(x) - 2))
    return UncertainValue(slope, math.sqrt(widening / spread))


def _belonging(
    signal: str, line: str, gear: int, points: _Points, exponent: UncertainValue | None, bench: BenchParameters
) -> tuple[Belonging | None, str]:
    """The mechanism that makes a line of this order and growth, and why."""
    kind, side = signal.split("_")[0], signal.rpartition("_")[2]
    names = line.split(" = ")
    poles = int(bench.carrier.iron_poles)
    pairs = bench.gear(gear).pole_pairs
    if kind == "torque":
        if f"{side} 1" in names:
            return _by_law(UNBALANCE, "amplitude", "N m s2/rad2", 2.0, points, exponent)
        if f"{side} 2" in names:
            return _by_law(MISALIGNMENT, "amplitude", "N m", 0.0, points, exponent)
        if any(f"{s} {math.lcm(2 * p, poles)}" in names for s, p in pairs.items()):
            return _by_law(COGGING, "amplitude", "N m", 0.0, points, exponent)
    if kind == "speed" and f"{side} 1" in names:
        found, remark = _by_law(ECCENTRICITY, "eccentricity", "1", 1.0, points, exponent)
        return found, f"{remark}. A shaft whose speed swings once a turn reads the same"
    return None, "no mechanism of the catalogue makes a line of this order in this signal"


def _by_law(
    mechanism: str, parameter: str, unit: str, power: float, points: _Points, exponent: UncertainValue | None
) -> tuple[Belonging | None, str]:
    """The mechanism, where the growth with speed is that of its law."""
    law = f"its law grows with speed to the power {power:g}"
    if exponent is None:
        return None, f"the order of {mechanism}; {law}, and these points do not tell the power"
    text = f"found {exponent.value:.3f} (u {exponent.u:.3f})"
    if abs(exponent.value - power) > max(2.0 * exponent.u, NEAR):
        return None, f"the order of {mechanism}, but {law} and here it is {text}"
    size, good = _clean(points)
    scale = points.speed[good] ** power
    value, u = size / scale, points.u[good] / scale
    weight = 1.0 / u**2
    mean = float((weight * value).sum() / weight.sum())
    widening = max(1.0, float((weight * (value - mean) ** 2).sum()) / max(1, len(value) - 1))
    return (
        Belonging(mechanism, parameter, unit, UncertainValue(mean, math.sqrt(widening / float(weight.sum())))),
        f"order and growth of {mechanism}: {law}, {text}",
    )
