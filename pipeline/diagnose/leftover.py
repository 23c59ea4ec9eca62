"""Is what an explanation leaves still structured, and by how much."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnose.naming import Remainder
from pmg.pipeline.diagnose.noise import repeat_contrasts
from pmg.pipeline.diagnose.scan import make_scan
from pmg.pipeline.diagnose.structure import families
from pmg.pipeline.diagnose.swings import swings
from pmg.pipeline.diagnose.whiten import synthetic_noise, undo

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnose.candidates import Stage
    from pmg.pipeline.diagnose.noise import NoiseFloor


ORDINARY_SWING = 18.0
"""Sum of squares, in noise variances, that the largest of a hundred swings rarely exceeds in noise alone."""


def make_judge(stage: Stage, floor: NoiseFloor, rng: np.random.Generator, draws: int) -> Callable[[Stage], Remainder]:
    """A judge of what stages on these readings leave.

    Parameters
    ----------
    stage : Stage
        The readings, with their baseline.
    floor : NoiseFloor
        Their noise.
    rng : numpy.random.Generator
        Draws the synthetic campaigns.
    draws : int
        How many of them.

    Notes
    -----
    The same families of structure as in the mismatch test. The excess is the sum of squares along all of them at
    once, less its expectation, in units of the variance of what follows none of them.
    """
    readings = stage.readings
    narrow = swings(readings)
    columns = [stage.white(f.columns) for f in (*families(readings, stage.bench, stage.model), *narrow)]
    repeats = repeat_contrasts(readings)
    fitted = readings.torque - undo(stage.white, stage.left)
    noise = synthetic_noise(readings, floor, stage.white, draws, rng, fitted=fitted)

    def judge(given: Stage) -> Remainder:
        scan = make_scan(readings, given.baseline, columns, repeats, len(narrow))
        observed = float(scan(given.left[:, None])[:, 0].min())
        smallest = scan(noise).min(axis=0)
        p_value = (1.0 + float(np.sum(smallest <= observed))) / (draws + 1.0)
        along = scan.everything.T @ given.left
        rest = given.left - scan.everything @ along
        dof = max(len(rest) - scan.everything.shape[1], 1)
        dimensions = scan.everything.shape[1] - given.baseline.shape[1]
        variance = max(float(rest @ rest) / dof, 1e-12)
        of_noise = np.sum((scan.everything.T @ noise) ** 2, axis=0) - np.sum((given.baseline.T @ noise) ** 2, axis=0)
        usual = float(np.quantile(of_noise, 0.95)) - dimensions
        swung = max((float(np.sum((b.T @ rest) ** 2)) for b in scan.bases[len(columns) - len(narrow) :]), default=0.0)
        beyond = max(0.0, swung / variance - ORDINARY_SWING)
        return Remainder(p_value, max(0.0, float(along @ along) / variance - dimensions) + beyond, usual)

    return judge
