"""What each mechanism of the catalogue would leave on the readings, for one value of its shape after another."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmg.pipeline.diagnosis.grid.candidates import candidates
from pmg.pipeline.diagnosis.grid.fitting import shapes, signature

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.grid.candidates import GridProblem
    from pmg.sim.signals import Array


def traces(problem: GridProblem) -> list[Array]:
    """Whitened columns (m, sizes) of every mechanism on every shaft and in every shape from which a fit starts.

    A smooth family spreads a test over several columns; a mechanism's own trace takes one, so that small effects of
    the catalogue are seen earlier.
    """
    return [
        problem.white(signature(problem, candidate, shape))
        for candidate in candidates()
        if candidate.shaft != "both" or not candidate.kind.both_at_once
        for shape in shapes(candidate)
    ]
