"""Is what an explanation leaves still structured, and by how much."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnose.engine.scan import make_scan
from pmg.pipeline.diagnose.grid.naming import Remainder
from pmg.pipeline.diagnose.grid.swings import swings
from pmg.pipeline.fit.noise_floor import repeat_contrasts
from pmg.pipeline.fit.structure import families
from pmg.pipeline.fit.whitening import synthetic_noise, undo

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnose.engine.scan import Scan
    from pmg.pipeline.diagnose.grid.candidates import Stage
    from pmg.pipeline.fit.noise import NoiseFloor
    from pmg.sim.signals import Array


ORDINARY_SWING = 18.0
"""Sum of squares, in noise variances, that the largest of a hundred swings rarely exceeds in noise alone."""


USUAL = 0.99
"""Quantile of the excess in noise alone that counts as usual."""


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
        excess = _excess(scan, given.left[:, None], len(narrow))
        usual = float(np.quantile(_excess(scan, noise, len(narrow)), USUAL))
        return Remainder(p_value, max(0.0, float(excess[0])), usual)

    return judge


def _excess(scan: Scan, white: Array, narrow: int) -> Array:
    """Sum of squares of whitened columns (m, draws) along the families, less its expectation, in noise variances.

    The variance is that of what follows no family; the largest of the narrow families adds what it has beyond the
    ordinary.
    """
    left = white - scan.baseline @ (scan.baseline.T @ white)
    along = scan.everything.T @ left
    rest = left - scan.everything @ along
    dof = max(len(white) - scan.everything.shape[1], 1)
    dimensions = scan.everything.shape[1] - scan.baseline.shape[1]
    variance = np.maximum(np.sum(rest**2, axis=0) / dof, 1e-12)
    swung = np.zeros(white.shape[1])
    for basis in scan.bases[len(scan.bases) - narrow :]:
        swung = np.maximum(swung, np.sum((basis.T @ rest) ** 2, axis=0) / variance)
    return np.asarray(np.sum(along**2, axis=0) / variance - dimensions + np.maximum(swung - ORDINARY_SWING, 0.0))
