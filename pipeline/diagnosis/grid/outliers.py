"""Readings that stand out by themselves, set aside before the rest is judged."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.grid.locate import find_mismatch
from pmg.pipeline.fit.analysis import MOST_OUTLIERS
from pmg.pipeline.fit.noise_floor import noise_floor
from pmg.pipeline.grid.readings import take_readings

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.grid.locate import CampaignMismatch
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array


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
