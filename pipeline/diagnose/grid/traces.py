"""What each mechanism of the catalogue would leave on the readings, for one value of its shape after another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnose.grid.candidates import candidates
from pmg.pipeline.diagnose.grid.fitting import shapes, signature

if TYPE_CHECKING:
    from pmg.pipeline.diagnose.grid.candidates import Stage
    from pmg.pipeline.diagnose.grid.fitting import CandidateFit
    from pmg.sim.signals import Array


def traces(stage: Stage) -> list[Array]:
    """Whitened columns (m, sizes) of every mechanism on every shaft and in every shape from which a fit starts.

    A smooth family spreads a test over several columns; a mechanism's own trace takes one, so that small effects of
    the catalogue are seen earlier.
    """
    return [
        stage.white(signature(stage, candidate, shape))
        for candidate in candidates()
        if candidate.shaft != "both" or not candidate.kind.both_at_once
        for shape in shapes(candidate)
    ]


def tangents(stage: Stage, fit: CandidateFit) -> Array:
    """Change of each reading per change of each parameter of a fitted candidate (m, k) [N m per unit]."""
    slopes = []
    for i, parameter in enumerate(fit.candidate.parameters):
        step = 1e-3 * max(abs(float(fit.values[i])), 1e-3 * parameter.typical)
        low, high = parameter.bounds
        up, down = fit.values.copy(), fit.values.copy()
        up[i], down[i] = min(fit.values[i] + step, high), max(fit.values[i] - step, low)
        slopes.append((stage.effect(fit.candidate, up) - stage.effect(fit.candidate, down)) / (up[i] - down[i]))
    return np.stack(slopes, axis=1)
