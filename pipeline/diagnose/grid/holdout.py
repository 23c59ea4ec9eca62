"""Proof of a located structure on withheld readings: whole blocks withheld, fitted without them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnose.grid.locate import located_families
from pmg.pipeline.fit.calibration import jacobian, start_model
from pmg.pipeline.fit.noise_floor import BASELINE_FREE
from pmg.pipeline.fit.whitening import floor_scale
from pmg.pipeline.grid.readings import predict, take_readings

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnose.grid.candidates import Candidate
    from pmg.pipeline.diagnose.grid.locate import Location
    from pmg.pipeline.fit.loss_fit import LossFits
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.bench import BenchParameters
    from pmg.sim.grid import Grid
    from pmg.sim.signals import Array, Mask

FOLDS = 8
"""Parts of the readings withheld in turn."""

BLOCKS = 48
"""Blocks of neighbours that are dealt to the folds, where the order of the test is known."""

RESAMPLES = 2000
"""Bootstrap resamples of the blocks."""


@dataclass(frozen=True)
class HeldOut:
    """Errors on readings that took no part in the fit.

    Parameters
    ----------
    split : str
        What was withheld, in words.
    rmse_before, rmse_after : float
        Of the baseline, and of the baseline with the located structure [N m].
    noise_floor : float
        Noise of the same readings [N m].
    gain_interval : tuple of float
        95 % interval of `rmse_before` - `rmse_after`, from resampled blocks [N m].
    placebo_gain : float or None
        The same difference for a placebo: what was found, shuffled over the readings; it should gain nothing [N m].
    expected_before, expected_after : float or None
        Error that noise alone would give [N m]: noise of the readings and, with it, of the fits that predict them.
    count : int
        Readings that were looked at.
    kept : float
        Part of the choices made without a part of the readings that agree with the choice on all of them.
    elsewhere : tuple of tuple of Candidate
        Where too few agree: the sets that were chosen instead, most frequent first.
    """

    split: str
    rmse_before: float
    rmse_after: float
    noise_floor: float
    gain_interval: tuple[float, float]
    placebo_gain: float | None = None
    expected_before: float | None = None
    expected_after: float | None = None
    count: int = 0
    kept: float = 1.0
    elsewhere: tuple[tuple[Candidate, ...], ...] = ()


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


def touched_blocks(block: npt.NDArray[np.int64], touched: Mask) -> list[npt.NDArray[np.intp]]:
    """Rows of each block that are looked at; blocks without any are left out."""
    return [np.flatnonzero((block == k) & touched) for k in np.unique(block[touched])]


def gain_interval(
    before: Array, after: Array, blocks: list[npt.NDArray[np.intp]], rng: np.random.Generator
) -> tuple[float, float]:
    """95 % interval of the fall of the error [N m] from squared errors, blocks resampled with replacement."""
    gains = []
    for _ in range(RESAMPLES):
        rows = np.concatenate([blocks[i] for i in rng.integers(len(blocks), size=len(blocks))])
        gains.append(math.sqrt(before[rows].mean()) - math.sqrt(after[rows].mean()))
    low, high = np.quantile(gains, [0.025, 0.975])
    return float(low), float(high)


def solve(design: Array, y: Array) -> Array:
    """Least squares with columns of equal length; directions the rows do not determine stay at zero."""
    length = np.linalg.norm(design, axis=0)
    length[length == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(design / length, y, rcond=1e-8)[0] / length)
