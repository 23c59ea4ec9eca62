"""Proof of a located structure on withheld readings: whole blocks withheld, fitted without them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.held_out import HeldOut, gain_interval, solve, touched_blocks
from pmg.pipeline.diagnosis.engine.withheld import BLOCKS
from pmg.pipeline.diagnosis.grid.locate import located_families
from pmg.pipeline.fit.calibration import jacobian, start_model
from pmg.pipeline.fit.noise_floor import BASELINE_FREE
from pmg.pipeline.fit.whitening import floor_scale
from pmg.pipeline.grid.readings import predict, take_readings

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.grid.locate import Location
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid

FOLDS = 8
"""Parts of the readings withheld in turn."""


def hold_out(
    grid: Grid,
    fits: LossFits,
    floor: NoiseFloor,
    bench: BenchParameters,
    locations: tuple[Location, ...],
    rng: np.random.Generator,
) -> HeldOut | None:
    """Withhold blocks of readings, refit with and without the located families, predict the blocks.

    Blocks of neighbours in the order of the test, or whole inner rows of sun speed where the order is not known, are
    dealt to the folds. The families were chosen on all readings; their coefficients never see the block they
    predict. None where no location follows a family.
    """
    readings = take_readings(grid, bench)
    model = start_model(fits)
    structure = located_families(readings, bench, model, locations)
    if structure.shape[1] == 0:
        return None
    scale = floor_scale(readings, bench, floor)
    y = (readings.torque - predict(readings, bench, model)) / scale
    before = jacobian(readings, bench, model, BASELINE_FREE) / scale[:, None]
    after = np.hstack([before, structure / scale[:, None]])
    touched = (structure != 0.0).any(axis=1)
    at = grid.points
    block, fold = deal(readings, FOLDS)
    touched = touched & (fold < FOLDS)
    errors = {"before": np.zeros(len(y)), "after": np.zeros(len(y))}
    for k in range(FOLDS):
        train, test = fold != k, fold == k
        for name, design in (("before", before), ("after", after)):
            errors[name][test] = y[test] - design[test] @ solve(design[train], y[train])
    squares = {name: (value * scale) ** 2 for name, value in errors.items()}
    blocks = touched_blocks(block, touched)
    what = "blocks of neighbouring points in the order of the test" if at.ordered else "inner rows of sun speed"
    return HeldOut(
        split=f"{len(blocks)} {what}, dealt to {FOLDS} folds; the kind of structure was chosen on all readings, its "
        "coefficients without the withheld ones",
        rmse_before=math.sqrt(squares["before"][touched].mean()),
        rmse_after=math.sqrt(squares["after"][touched].mean()),
        noise_floor=math.sqrt(float(np.mean(scale[touched] ** 2))),
        gain_interval=gain_interval(squares["before"], squares["after"], blocks, rng),
    )


def deal(readings: Readings, folds: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Block and fold of each reading; blocks follow the order of the test, or the sun's speed where it is not known.

    Without an order the outermost rows are in no fold (`folds`): they always train, as a fit is not asked to reach
    beyond its data.
    """
    at = readings.grid.points
    key = at.started_at[readings.row] if at.ordered else np.abs(at.speed_sun[readings.row])
    levels = np.unique(key)
    n_blocks = min(BLOCKS if at.ordered else len(levels), len(levels))
    block = np.asarray((np.searchsorted(levels, key) * n_blocks) // len(levels))
    fold = block % folds
    if not at.ordered:
        fold = np.where((block == 0) | (block == n_blocks - 1), folds, fold)
    return block, fold
