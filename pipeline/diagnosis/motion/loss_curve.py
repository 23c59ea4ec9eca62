"""Loss curve of a rotor from runs in motion: drag over speed with its uncertainty, inertia separated."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.constants import (
    DRAG_POWERS,
    ENGAGED_POWERS,
    FORM_SPEEDS,
    PASSAGES,
    SPEED_UNIT,
    SheetSum,
    drag_names,
    form_names,
    passage_names,
)
from pmg.pipeline.fit.covariance import u_predicted

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array


REST = 0.3
"""Width of the smooth passage of friction through standstill [rad/s]."""


BETWEEN = (4.5e-4, 1.2e-4, 8e-5, 3e-5, 3e-5)
"""Standard deviation of a curve halfway between two of `FORM_SPEEDS` about the straight line over them [N m]: largest
where a film of lubricant breaks."""

PLAINLY, RISE_FORM = 3.0, 4e-3
"""Standard uncertainties by which a loss curve must fall for it to count; and the standard deviation [N m] by which one
may rise more or less than a power of speed."""

RISES_AS = (0.3, 1.0)
"""Powers of speed between which drag rises: of rolling contacts, seals and viscous films."""


def loss_names(side: str) -> tuple[str, ...]:
    """Constants that the drag of a rotor in neutral is made of."""
    return (*drag_names(side)[: len(DRAG_POWERS)], *form_names(side), *passage_names(side))


def drag_columns(side: str, speed: Array) -> dict[str, Array]:
    """Drag of a rotor in neutral per unit of each constant that it is made of, at speeds [rad/s], (n,)."""
    direction, share = np.tanh(speed / REST), np.abs(speed) / SPEED_UNIT
    columns = {
        name: direction * share**power
        for name, power in zip(drag_names(side)[: len(DRAG_POWERS)], DRAG_POWERS, strict=True)
    }
    columns |= {name: direction * near for name, near in zip(form_names(side), _near(speed), strict=True)}
    widths = zip(passage_names(side), PASSAGES, strict=True)
    return columns | {name: np.tanh(speed / width) - direction for name, width in widths}


def engaged_drag_columns(side: str, speed: Array) -> dict[str, Array]:
    """Drag that engaging brings to a rotor per unit of each constant, at speeds [rad/s], (n,)."""
    direction, share = np.tanh(speed / REST), np.abs(speed) / SPEED_UNIT
    names = drag_names(side)[len(DRAG_POWERS) :]
    return {name: direction * share**power for name, power in zip(names, ENGAGED_POWERS, strict=True)}


def loss_curve(sheet: DataSheet, values: Array, covariance: Array, side: str, speed: Array) -> tuple[Array, Array]:
    """Drag of a rotor in neutral at speeds in the positive sense, and its standard uncertainty.

    Parameters
    ----------
    sheet : DataSheet
        What the constants are.
    values, covariance : (k,) and (k, k) array
        The constants as fitted; SI.
    side : str
        The rotor.
    speed : (n,) array
        Speeds [rad/s], positive.

    Returns
    -------
    drag, uncertainty : (n,) array
        [N m].

    Notes
    -----
    What a real curve is off between the speeds at which it is fitted is no constant, and is added.
    """
    weights = _weights(sheet, side, speed)
    return np.asarray(weights @ values), np.hypot(u_predicted(weights, covariance), _between(speed))


def falls_of(sheet: DataSheet, values: Array, covariance: Array, fastest: PerShaft[float]) -> tuple[SheetSum, ...]:
    """Where a fitted loss curve falls with speed, and how much it should rise there.

    Parameters
    ----------
    sheet : DataSheet
        What the constants are.
    values, covariance : (k,) and (k, k) array
        The constants as fitted; SI.
    fastest : PerShaft of float
        Largest speed of each rotor in neutral [rad/s].

    Returns
    -------
    tuple of SheetSum
        One for each part of a range of speeds over which a curve falls plainly: its rise less that which is expected.

    Notes
    -----
    Drag of bearings, seals and air grows with speed; what falls is a mechanism of its own, a film of lubricant that
    builds up, and would be hidden in a loss curve of free form. From where a curve rises most it follows by how much it
    should rise elsewhere: as any between the powers `RISES_AS`, all equally likely.
    """
    found = []
    for side, most in fastest.items():
        speeds = np.array([speed for speed in FORM_SPEEDS if speed <= most])
        if len(speeds) < 2:
            continue
        weights = np.diff(_weights(sheet, side, speeds), axis=0)
        rises, u = weights @ values, u_predicted(weights, covariance)
        steepest = int(np.argmax(rises - PLAINLY * u))
        rise, powers = max(float(rises[steepest]), 0.0), np.diff([speeds**power for power in RISES_AS])
        shares = (rise > 0.0) * powers / powers[:, steepest, None]
        meant = weights - shares.mean(axis=0)[:, None] * weights[steepest]
        spread = np.hypot(rise * np.ptp(shares, axis=0) / math.sqrt(12.0), RISE_FORM)
        for falls, group in itertools.groupby(range(len(rises)), key=(rises < -PLAINLY * u).__getitem__):
            places = list(group)
            fall, between = float(-rises[places].sum()), (float(speeds[places[0]]), float(speeds[places[-1] + 1]))
            found += [SheetSum(side, meant[k], float(spread[k]), fall, between) for k in places if falls]
    return tuple(found)


def _weights(sheet: DataSheet, side: str, speed: Array) -> Array:
    """Weights (n, k) of the constants in the drag of a rotor in neutral at speeds [rad/s]."""
    columns, found = drag_columns(side, speed), np.zeros((len(speed), len(sheet)))
    found[:, [sheet.at(name) for name in columns]] = np.stack(list(columns.values()), 1)
    return found


def _between(speed: Array) -> Array:
    """Standard deviation of a curve between two of `FORM_SPEEDS` about the straight line over them [N m] (n,)."""
    near = np.stack(_near(speed), 1)
    return np.asarray(4.0 * (near[:, :-1] * near[:, 1:]) @ np.array(BETWEEN))


def _near(speed: Array) -> tuple[Array, ...]:
    """How near a speed is to each of `FORM_SPEEDS`: straight lines over its logarithm, 1 there and 0 at the next."""
    at = np.log(np.maximum(np.abs(speed), FORM_SPEEDS[0]))
    place = np.interp(at, np.log(FORM_SPEEDS), np.arange(len(FORM_SPEEDS)))
    return tuple(np.maximum(1.0 - np.abs(place - k), 0.0) for k in range(len(FORM_SPEEDS)))
