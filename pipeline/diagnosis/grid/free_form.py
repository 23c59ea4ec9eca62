"""Smooth changes of a mechanism's law along the quantities that it is a function of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.fit.structure import polynomials
from pmg.sim.mechanisms.base import LawCovariate

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, GridProblem
    from pmg.sim.signals import Array

DEGREE = 2
"""Degree of the changes in the root of a covariate: a law may grow faster or more slowly, and level off."""


@dataclass(frozen=True)
class LawPart:
    """A fitted mechanism on one of its shafts, with the quantities that its law is a function of there.

    Parameters
    ----------
    shaft : str
        As in ``by_shaft``.
    effect : (m,) array
        Change of each reading [N m].
    covariates : dict of LawCovariate to (m,) array
        Magnitude of each quantity at each reading.
    """

    shaft: str
    effect: Array
    covariates: dict[LawCovariate, Array]

    @property
    def columns(self) -> Array:
        """The effect times polynomials of its covariates, with two of them the product of the first, too (m, k)."""
        acts = self.effect != 0.0
        changes = [_changes(values, acts) for values in self.covariates.values()]
        if len(changes) == 2 and all(change.shape[1] for change in changes):
            changes.append(changes[0][:, :1] * changes[1][:, :1])
        return self.effect[:, None] * np.hstack(changes) if changes else np.zeros((len(acts), 0))

    def logarithm(self, name: LawCovariate) -> Array:
        """Logarithm of a covariate over its largest value where the mechanism acts (m,); zero elsewhere."""
        values = self.covariates[name]
        acts = (self.effect != 0.0) & (values > 0.0)
        return np.asarray(np.log(values / values.max(initial=0.0, where=acts), out=np.zeros(len(values)), where=acts))

    def varies(self, name: LawCovariate) -> bool:
        """Whether a covariate takes more than one value where the mechanism acts."""
        return bool(np.ptp(self.logarithm(name)[self.effect != 0.0]) > 0.0)


def law_parts(problem: GridProblem, fit: CandidateFit) -> tuple[LawPart, ...]:
    """A fitted mechanism shaft by shaft, where it has a size."""
    found = []
    sizes = len(fit.candidate.sizes)
    for shaft, own in fit.candidate.kind.by_shaft.items():
        values = fit.values.copy()
        for i, name in enumerate(fit.candidate.sizes):
            values[i] = values[i] if name in own else 0.0
        if values[:sizes].any() and (effect := problem.effect(fit.candidate, values)).any():
            follows = {name: _covariate(problem, shaft, name) for name in fit.candidate.kind.follows}
            found.append(LawPart(shaft, effect, follows))
    return tuple(found)


def bent_columns(problem: GridProblem, fit: CandidateFit) -> Array:
    """Columns (m, k) [N m] along which the law of a fitted mechanism may bend.

    None where the law has no covariate of its own, or none that varies.
    """
    return np.hstack([np.zeros((len(problem.left), 0)), *(part.columns for part in law_parts(problem, fit))])


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
