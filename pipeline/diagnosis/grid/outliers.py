"""Readings that stand out by themselves, set aside before the rest is judged."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from pmg.pipeline.diagnosis.engine.problem import freed
from pmg.pipeline.diagnosis.engine.scan import studentised
from pmg.pipeline.diagnosis.grid.evidence import both_shafts
from pmg.pipeline.diagnosis.grid.locate import find_mismatch
from pmg.pipeline.fit.calibration import start_model
from pmg.pipeline.fit.noise_floor import noise_floor, structured_columns
from pmg.pipeline.fit.whitening import floor_scale
from pmg.pipeline.grid.readings import predict, take_readings

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.grid.locate import CampaignMismatch
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array

MOST_OUTLIERS = 0.04
"""Part of the points that may be set aside because they stand out by themselves; more is no accident."""

FAR_OFF = 1e-5
"""p-value of a reading, all readings looked at, below which it is set aside at once: two such readings can bend a
smooth structure towards themselves, so that neither is the clearest thing that is seen."""


def without_outliers(
    grid: Grid,
    fits: LossFits,
    floor: NoiseFloor,
    bench: BenchParameters,
    rng: np.random.Generator,
    known: Callable[[Readings], Array] | None,
) -> tuple[CampaignMismatch, tuple[str, ...], NoiseFloor]:
    """The mismatch of the points that do not stand out by themselves, the names of those that do, and the noise.

    A single reading far from all others is a bad reading, not physics: it is set aside and reported, and the rest is
    judged again with its own noise, as long as they are few.
    """
    aside: list[str] = []
    whole, every = floor, grid
    while True:
        far = _far_off(grid, fits, floor, bench)
        if far is None:
            allowed = None if known is None else known(take_readings(grid, bench))
            mismatch = find_mismatch(grid, fits, floor, bench, rng, allowed=allowed)
            if not mismatch.found or mismatch.locations[0].depends_on != ("point",):
                return mismatch, tuple(aside), floor
            far = int(mismatch.readings.row[int(np.argmax(np.abs(mismatch.locations[0].effect)))])
        if len(aside) >= MOST_OUTLIERS * len(grid):
            break
        aside.append(str(grid.points.name[far]))
        accepted = grid.accepted.copy()
        accepted[far] = False
        grid = replace(grid, accepted=accepted)
        floor = noise_floor(grid, fits, bench)
    allowed = None if known is None else known(take_readings(every, bench))
    return find_mismatch(every, fits, whole, bench, rng, allowed=allowed), (), whole


def _far_off(grid: Grid, fits: LossFits, floor: NoiseFloor, bench: BenchParameters) -> int | None:
    """Row of the reading that lies farthest from baseline and every smooth structure, if it is far off."""
    readings = take_readings(grid, bench)
    model = start_model(fits)
    surprise = _surprises(readings, bench, model, floor)
    worst = int(np.argmin(surprise))
    return int(readings.row[worst]) if surprise[worst] * len(readings) < FAR_OFF else None


def _surprises(readings: Readings, bench: BenchParameters, model: LossModel, floor: NoiseFloor) -> Array:
    """p-value of each reading by its externally studentised residual, shaft by shaft; 1 where it is not judged."""
    scale = floor_scale(readings, bench, floor)
    y = (readings.torque - predict(readings, bench, model)) / scale
    basis, left = freed(structured_columns(readings, bench, model) / scale[:, None], y)
    room = 1.0 - np.einsum("ij,ij->i", basis, basis)
    found = np.ones(len(readings))
    for mine in both_shafts(readings):
        rows, surprise, dof = studentised(left, room, mine)
        found[rows] = 2.0 * stats.t.sf(np.abs(surprise), dof)
    return found
