"""Zeros of the transducers as columns: a campaign that holds runs in motion, too, leaves them to those."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.grid.candidates import predict_with
from pmg.pipeline.grid.readings import change, predict
from pmg.sim.mechanisms.instruments import ZeroOffset
from pmg.sim.shafts import SIDES

if TYPE_CHECKING:
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array

UNIT_OFFSET = 1e-3
"""Offset by which a column is taken; readings are proportional to it [N m]."""


def zero_columns(readings: Readings, bench: BenchParameters, model: LossModel) -> Array:
    """Change of the readings per offset of the zero of either transducer (m, 2).

    A transducer is within a few mN m of zero, and runs in motion tell by how much: they know that tolerance, which
    steady points would take for a fault.
    """
    without = predict(readings, bench, model)
    offsets = (ZeroOffset(**{f"offset_{side}": UNIT_OFFSET}) for side in SIDES)
    return np.stack(
        [change(predict_with(readings, bench, model, (o,)), without) / UNIT_OFFSET for o in offsets], axis=1
    )
