"""Families of smooth structure over the covariates of a campaign, which a residual may follow.

Each family is a set of columns over the readings, as drag on the shaft that is read. They carry no physics: they
locate a mismatch, and what none of them explains is the noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.recursion import remembered
from pmg.sim.shafts import SIDES, other_side, per_shaft

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import OperatingPoints
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array, Mask

THERMAL_TIMES = (180.0, 600.0, 1800.0, 5400.0)
"""Time constants of the run-history filters [s]: from a bearing to the whole bench."""

REST = 0.05
"""Speed below which a shaft counts as not turning [rad/s], half a revolution a minute."""

MINIMUM_ZERO_CHECKS = 3
"""Zero checks needed before a drift of the zero can be distinguished from noise."""


@dataclass(frozen=True)
class ResidualStructure:
    """One way in which a residual may be structured.

    Parameters
    ----------
    signal : str
        ``torque_sun`` or ``torque_ring``.
    configuration : str
        ``neutral``, ``engaged``, ``zero`` or ``all``.
    covariates : tuple of str
        What it depends on.
    columns : (m, k) array
        The structure at each reading [N m per unit]; zero at readings it does not touch.
    """

    signal: str
    configuration: str
    covariates: tuple[str, ...]
    columns: Array


def polynomials(x: Array, degree: int) -> Array:
    """Legendre polynomials 1 to `degree` of a covariate scaled to [-1, 1]; no columns where it does not vary."""
    span = float(np.ptp(x)) if len(x) else 0.0
    if span <= 1e-9 * max(1.0, float(np.abs(x).max(initial=0.0))):
        return np.zeros((len(x), 0))
    scaled = 2.0 * (x - x.min()) / span - 1.0
    degree = min(degree, len(np.unique(np.round(scaled, 6))) - 1)
    return np.polynomial.legendre.legvander(scaled, degree)[:, 1:]


def _run_history(time: Array, power: Array, at: Array, constant: float) -> Array:
    """First-order memory of a power that the bench dissipated [W].

    Parameters
    ----------
    time, power : (n,) array
        Start of each point [s], in order, and the power dissipated from then until the next.
    at : (m,) array
        When the memory is read [s].
    constant : float
        Time constant [s].

    Returns
    -------
    (m,) array
        Exponentially weighted mean of the past power.
    """
    keep = np.exp(-np.diff(time) / constant)
    news = np.zeros(len(time))
    news[1:] = (1.0 - keep) * power[:-1]
    index = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 1)
    return remembered(keep, news)[index]


def past_power(readings: Readings, model: LossModel, shaft: str, constant: float) -> Array:
    """`_run_history` of the power that a shaft's bearings dissipated, at each reading [W] (m,)."""
    at = readings.grid.points
    order = np.argsort(at.started_at, kind="stable")
    power = model.curves[shaft].torque(at.speed[shaft]) * np.abs(at.speed[shaft])
    return _run_history(at.started_at[order], power[order], at.started_at[readings.row], constant)


def preceding(at: OperatingPoints, values: Array) -> Array:
    """Values of the point run before each (n,); NaN for the first."""
    order = np.argsort(at.started_at, kind="stable")
    before = np.full(len(at), np.nan)
    before[order[1:]] = values[order[:-1]]
    return before


def families(readings: Readings, bench: BenchParameters, model: LossModel) -> tuple[ResidualStructure, ...]:
    """Every family that this campaign's points can carry.

    Parameters
    ----------
    readings : Readings
        The m readings; their covariates decide which families exist.
    bench : BenchParameters
        Pole pairs, for the speed at which the magnetic poles slip past each other in neutral.
    model : LossModel
        Bearing curves: warming scales a drag, so its structure is proportional to them.
    """
    found: list[ResidualStructure] = []
    for shaft, mine in readings.of_shaft.items():
        found += _signal_families(readings, f"torque_{shaft}", mine)
        found += _neutral_families(readings, bench, shaft, mine & (readings.configuration == "neutral"))
        found += _engaged_families(readings, f"torque_{shaft}", mine & (readings.configuration == "engaged"))
        if readings.grid.points.ordered:
            found += _order_families(readings, model, shaft, mine)
    return tuple(family for family in found if family.columns.any())


def place(readings: Readings, rows: Mask, columns: Array) -> Array:
    """Columns over the chosen rows as drag, laid out over all readings."""
    whole = np.zeros((len(readings), columns.shape[1]))
    whole[rows] = columns * readings.direction[rows, None]
    return whole


def _signal_families(readings: Readings, signal: str, rows: Mask) -> Iterator[ResidualStructure]:
    """An offset of the reading: a torque that keeps its sign whatever the direction of rotation."""
    whole = np.zeros((len(readings), 1))
    whole[rows] = 1.0
    yield ResidualStructure(signal, "all", ("direction",), whole)
    drift = rows & (readings.configuration == "zero")
    if drift.sum() >= MINIMUM_ZERO_CHECKS and readings.grid.points.ordered:
        yield ResidualStructure(
            signal, "zero", ("order",), place(readings, drift, polynomials(_time(readings)[drift], 1))
        )


def _neutral_families(
    readings: Readings, bench: BenchParameters, shaft: str, rows: Mask
) -> Iterator[ResidualStructure]:
    """In neutral: the shaft's own speed beyond the curve's terms, the other's, their difference, the pole slip."""
    if not rows.any():
        return
    signal = f"torque_{shaft}"
    other_name = f"speed_{other_side(shaft)}"
    own, other = readings.speed_own[rows], readings.speed_other[rows]
    at = readings.grid.points[readings.row[rows]]
    difference = at.speed_sun - at.speed_ring
    slip = bench.pole_slip(at.gear, at.speed_sun, at.speed_ring)
    moving_other = np.abs(other) > REST
    for covariates, columns in (
        ((f"speed_{shaft}",), polynomials(np.sqrt(np.abs(own)), 6)),
        ((other_name,), np.c_[polynomials(np.abs(other), 3), np.where(moving_other, 1.0, 0.0)]),
        (
            ("speed_difference",),
            np.c_[polynomials(np.abs(difference), 3), np.sign(difference) * np.sign(own)],
        ),
        (("pole_slip_speed",), np.c_[polynomials(np.abs(slip), 3), np.sign(slip) * np.sign(own)]),
        ((f"speed_{shaft}", other_name), _products(np.abs(own), np.abs(other))),
    ):
        yield ResidualStructure(signal, "neutral", covariates, place(readings, rows, columns))


def _engaged_families(readings: Readings, signal: str, rows: Mask) -> Iterator[ResidualStructure]:
    """Engaged: the speed beyond the baseline's terms, the load as a drag and as a reading error, their product."""
    if not rows.any():
        return
    own = np.abs(readings.speed_own[rows])
    load = np.abs(readings.grid.points.torque_ring[readings.row[rows]])
    reading = readings.torque[rows] * readings.direction[rows]
    both_flows = len(np.unique(readings.grid.points.drive[readings.row[rows]])) > 1
    yield ResidualStructure(
        signal,
        "engaged",
        (f"{signal.replace('torque', 'speed')}",),
        place(readings, rows, polynomials(np.sqrt(own), 6)),
    )
    yield ResidualStructure(signal, "engaged", ("load",), place(readings, rows, polynomials(load, 2)))
    yield ResidualStructure(
        signal,
        "engaged",
        ("load", f"{signal.replace('torque', 'speed')}"),
        place(readings, rows, _products(own, load)),
    )
    if both_flows:
        flow = np.where(reading > 0.0, 1.0, -1.0)
        columns = np.c_[flow, flow * load]
        yield ResidualStructure(signal, "engaged", ("power_flow", "load"), place(readings, rows, columns))


def _order_families(readings: Readings, model: LossModel, shaft: str, mine: Mask) -> Iterator[ResidualStructure]:
    """In the order of the test: drift of the reading, drag that warms with time or with the run history."""
    signal = f"torque_{shaft}"
    at = readings.grid.points
    own_drag = per_shaft(lambda side: model.curves[side].torque(at.speed[side]))
    for configuration in ("neutral", "engaged"):
        rows = mine & (readings.configuration == configuration)
        if not rows.any():
            continue
        time = _time(readings)[rows]
        drag = own_drag[shaft][readings.row[rows]]
        if configuration == "engaged":
            drag = drag + own_drag.ring[readings.row[rows]] / 2.0
        drag = drag / max(float(np.sqrt(np.mean(drag**2))), 1e-12)
        trend = polynomials(time, 5)
        yield ResidualStructure(signal, configuration, ("order",), place(readings, rows, trend))
        yield ResidualStructure(
            signal, configuration, ("order", f"speed_{shaft}"), place(readings, rows, trend * drag[:, None])
        )
        histories = [past_power(readings, model, side, constant) for side in SIDES for constant in THERMAL_TIMES]
        memory = np.stack(histories, axis=1)[rows]
        spread = memory.std(axis=0)
        memory = (memory - memory.mean(axis=0))[:, spread > 0.0] / spread[spread > 0.0]
        yield ResidualStructure(signal, configuration, ("run_history",), place(readings, rows, memory * drag[:, None]))
        previous = np.nan_to_num(preceding(at, np.abs(at.speed_sun)))
        columns = polynomials(previous[readings.row[rows]], 1)
        yield ResidualStructure(signal, configuration, ("previous_point",), place(readings, rows, columns))


def _time(readings: Readings) -> Array:
    return np.asarray(readings.grid.points.started_at[readings.row])


def _products(x: Array, y: Array) -> Array:
    """Products of the first Legendre polynomials of two covariates."""
    left, right = polynomials(x, 2), polynomials(y, 2)
    columns = [left[:, [i]] * right[:, [j]] for i in range(left.shape[1]) for j in range(right.shape[1])]
    return np.hstack(columns) if columns else np.zeros((len(x), 0))
