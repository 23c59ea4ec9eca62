"""Readings of a campaign withheld: blocks of neighbours in the order of the test, or rows of sun speed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.problem import freed
from pmg.pipeline.diagnosis.engine.withheld import FOLDS, Withholding
from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, GridProblem
from pmg.pipeline.diagnosis.grid.holdout import deal
from pmg.pipeline.fit.whitening import Whitener

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Mask


@dataclass(frozen=True)
class WithheldReadings(Withholding[CandidateFit, GridProblem]):
    """Readings of a campaign as they are withheld.

    What was run before a point is known without its reading, so mechanisms with a memory see the whole run history.
    """

    problem: GridProblem
    noun = "mechanism was"

    def part(self, rows: Mask) -> GridProblem:
        """The problem of some readings; neighbours are no longer neighbours, so the noise is taken as white."""
        readings, white = self.problem.readings[rows], Whitener(self.scale[rows], ())
        columns, y = self.columns[rows], white(self.y[rows][:, None])[:, 0]
        basis, left = freed(white(columns), y)
        return replace(
            self.problem,
            readings=readings,
            white=white,
            baseline=basis,
            left=left,
            predicted=self.problem.predicted[rows],
            ideal=self.problem.ideal[rows],
            columns=columns,
        )

    def effect(self, fits: tuple[CandidateFit, ...]) -> Array:
        """Change of each reading by fitted mechanisms [N m]."""
        return np.asarray(np.sum([fit.effect for fit in fits], axis=0))

    def predictors(self, fits: tuple[CandidateFit, ...]) -> tuple[Array, Array, Array]:
        """Effects as fitted; the slopes of parameters off their bounds, refitted only where several stand together."""
        problem = self.problem
        effects: Array = np.sum([problem.effect(fit.candidate, fit.values) for fit in fits], axis=0)
        inside = [[p.name not in fit.on_bound for p in fit.candidate.parameters] for fit in fits]
        slopes = np.hstack([problem.tangents(fit)[:, free] for fit, free in zip(fits, inside, strict=True)])
        return effects, slopes if len(fits) > 1 else slopes[:, :0], slopes


def withheld_readings(problem: GridProblem) -> WithheldReadings:
    """The readings of a problem, dealt to the folds of the proof."""
    readings = problem.readings
    block, fold = deal(readings, FOLDS)
    places = np.char.add(np.where(readings.sun, "sun ", "ring "), readings.configuration)
    ordered = readings.grid.points.ordered
    return WithheldReadings(
        y=readings.torque - problem.predicted,
        columns=problem.columns,
        scale=problem.white.scale,
        block=block,
        fold=fold,
        groups=[np.flatnonzero(places == place) for place in np.unique(places)],
        what="blocks of neighbouring points in the order of the test" if ordered else "inner rows of sun speed",
        problem=problem,
    )
