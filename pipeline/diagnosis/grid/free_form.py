"""Smooth changes of a mechanism's law along the quantities that it is a function of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.structure import polynomials
from pmg.sim.mechanisms.base import LawCovariate

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, GridProblem
    from pmg.sim.signals import Array

DEGREE = 2
"""Degree of the changes in the root of a covariate: a law may grow faster or more slowly, and level off."""


def bent_columns(problem: GridProblem, fit: CandidateFit) -> Array:
    """Columns (m, k) [N m]: the effect of a fitted mechanism, shaft by shaft, times polynomials of its covariates.

    With two covariates the product of the first polynomials is among them. None where the law has no covariate of its
    own, or none that varies.
    """
    found = []
    sizes = len(fit.candidate.sizes)
    for shaft, own in fit.candidate.kind.by_shaft.items():
        values = fit.values.copy()
        for i, name in enumerate(fit.candidate.sizes):
            values[i] = values[i] if name in own else 0.0
        if not values[:sizes].any():
            continue
        effect = problem.effect(fit.candidate, values)
        acts = effect != 0.0
        changes = [_changes(_covariate(problem, shaft, name), acts) for name in fit.candidate.kind.follows]
        if len(changes) == 2 and all(change.shape[1] for change in changes):
            changes.append(changes[0][:, :1] * changes[1][:, :1])
        found += [effect[:, None] * change for change in changes]
    return np.hstack(found) if found else np.zeros((len(problem.left), 0))


def _changes(values: Array, acts: Array) -> Array:
    """Polynomials (m, k) of the root of a covariate over the readings where a mechanism acts; zero elsewhere."""
    columns = polynomials(np.sqrt(values[acts]), DEGREE)
    whole = np.zeros((len(values), columns.shape[1]))
    whole[acts] = columns
    return whole


def _covariate(problem: GridProblem, shaft: str, name: LawCovariate) -> Array:
    """Magnitude of a covariate of a law on a shaft at each reading (m,); of a law on both, that of the sun."""
    readings, row = problem.readings, problem.readings.row
    at = readings.grid.points
    if name is LawCovariate.LOAD:
        return np.asarray(np.abs(at.torque_ring[row]))
    if name is LawCovariate.SPEED:
        return np.asarray(np.abs(dict(at.speed.items()).get(shaft, at.speed_sun)[row]))
    if name is LawCovariate.SLIP:
        return np.abs(problem.bench.pole_slip(at.gear, at.speed_sun, at.speed_ring)[row])
    if name is LawCovariate.DIFFERENCE:
        return np.asarray(np.abs(at.speed_sun - at.speed_ring)[row])
    return np.asarray((at.started_at - at.started_at.min())[row] if at.ordered else np.zeros(len(row)))
