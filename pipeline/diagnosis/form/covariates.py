"""Covariates of a short formula at a location, as quantities with symbol and unit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.form.atoms import FormCovariate, levels
from pmg.pipeline.fit.structure import THERMAL_TIMES, past_power, preceding
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.grid.locate import Location
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Mask

MOST_COVARIATES = 6
"""Covariates of one search, memories of past power counted once."""

LEVELS = 3
"""Levels that a covariate must have; two where it is a sign."""


def rows_of(place: Location, readings: Readings) -> Mask:
    """Readings that a location is about."""
    here = readings.sun == (place.signal == "torque_sun")
    if place.configuration == "all":
        return np.asarray(here)
    return np.asarray(here & (readings.configuration == place.configuration))


def covariates_of(
    place: Location, readings: Readings, bench: BenchParameters, model: LossModel
) -> tuple[FormCovariate, ...]:
    """Covariates that the location follows, then the shaft's own speed, its load, and without a location the time.

    Parameters
    ----------
    place : Location
        Names the covariates.
    readings : Readings
        The m readings of the campaign; values are given at those of the location.
    bench : BenchParameters
        Pole pairs.
    model : LossModel
        Bearing curves, for the power that a shaft dissipated.
    """
    rows = rows_of(place, readings)
    own = "speed_sun" if place.signal == "torque_sun" else "speed_ring"
    names = [*place.covariates, *place.depends_on, own]
    if "run_history" in names:
        names.append("previous_point")
    if not place.covariates:
        names = ["order", own, "previous_point"]
    if place.configuration == "engaged":
        names.append("load")
    found: list[FormCovariate] = []
    for name in list(dict.fromkeys(names))[:MOST_COVARIATES]:
        found += [c for c in _named(name, own, readings, rows, bench, model) if _varies(c)]
    return tuple(found)


def _varies(covariate: FormCovariate) -> bool:
    return len(levels(covariate.values)) >= (2 if covariate.signed else LEVELS)


def _named(
    name: str, own: str, readings: Readings, rows: Mask, bench: BenchParameters, model: LossModel
) -> Iterator[FormCovariate]:
    at = readings.grid.points
    row, sign = readings.row[rows], readings.direction[rows]
    sun, ring = at.speed_sun, at.speed_ring
    if name == "speed_sun":
        yield FormCovariate(name, "ω_s", "rad/s", "speed of the sun", np.abs(sun[row]))
    elif name == "speed_ring":
        yield FormCovariate(name, "ω_r", "rad/s", "speed of the ring", np.abs(ring[row]))
    elif name == "speed_difference":
        meaning = "sun speed less ring speed, positive in the direction of the shaft's own rotation"
        yield FormCovariate(name, "Δω", "rad/s", meaning, ((sun - ring)[row]) * sign, signed=True)
    elif name == "pole_slip_speed":
        slip = bench.pole_slip(at.gear, sun, ring)
        meaning = "speed at which the poles slip, positive in the direction of the shaft's own rotation"
        yield FormCovariate(name, "ω_p", "rad/s", meaning, slip[row] * sign, signed=True)
    elif name == "load":
        yield FormCovariate(name, "T_r", "N m", "ring torque", np.abs(at.torque_ring[row]))
    elif name == "power_flow":
        flow = np.where(readings.torque[rows] * sign > 0.0, 1.0, -1.0)
        yield FormCovariate(
            name, "flow", "1", "1 where the shaft takes power in, -1 where it gives power out", flow, True
        )
    elif at.ordered:
        yield from _in_order(name, own, readings, rows, model)


def _in_order(name: str, own: str, readings: Readings, rows: Mask, model: LossModel) -> Iterator[FormCovariate]:
    """Time since the first point, the speed of the point before, the mean of past power."""
    at = readings.grid.points
    row = readings.row[rows]
    if name == "order":
        time = at.started_at - at.started_at.min()
        yield FormCovariate(name, "t", "s", "time since the first point", time[row])
    elif name == "previous_point":
        for shaft, speed in tuple(at.speed.items())[: 1 if own == "speed_sun" else 2]:
            before = np.nan_to_num(preceding(at, np.abs(speed)))
            meaning = f"speed of the {shaft} at the point before"
            yield FormCovariate(name, f"ω_{shaft[0]}before", "rad/s", meaning, before[row])
    elif name == "run_history":
        for shaft in SIDES:
            mine = own == f"speed_{shaft}"
            for constant in THERMAL_TIMES if mine else THERMAL_TIMES[1:3]:
                past = past_power(readings, model, shaft, constant)[rows]
                meaning = f"bearing power of the {shaft}, its mean over the past {constant:.0f} s"
                yield FormCovariate(name, f"P_{shaft[0]}{constant:.0f}", "W", meaning, past, memory=True)
