"""Loss curve of a rotor from runs in motion: drag over speed with its uncertainty, inertia separated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.constants import (
    DRAG_POWERS,
    PASSAGES,
    SPEED_UNIT,
    drag_names,
    form_names,
    passage_names,
)
from pmg.pipeline.diagnosis.motion.rows import REST, nearness

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.sim.signals import Array


def loss_names(side: str) -> tuple[str, ...]:
    """Constants that the drag of a rotor in neutral is made of."""
    return (*drag_names(side)[: len(DRAG_POWERS)], *form_names(side), *passage_names(side))


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
    """
    direction = np.tanh(speed / REST)
    powers = direction[:, None] * (speed[:, None] / SPEED_UNIT) ** np.array(DRAG_POWERS)
    passing = np.tanh(speed[:, None] / np.array(PASSAGES)) - direction[:, None]
    columns = np.hstack([powers, direction[:, None] * np.stack(nearness(speed), 1), passing])
    at = [sheet.at(name) for name in loss_names(side)]
    variance = np.einsum("ni,ij,nj->n", columns, covariance[np.ix_(at, at)], columns)
    return np.asarray(columns @ values[at]), np.sqrt(variance)
