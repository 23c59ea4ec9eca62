"""Readings of a campaign withheld, and what is proved on them: named mechanisms, or else the located structure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.held_out import compared, touched_blocks, withheld_left
from pmg.pipeline.diagnosis.engine.withheld import BLOCKS, Withholding
from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, GridProblem
from pmg.pipeline.diagnosis.grid.fitting import KnownFits
from pmg.pipeline.diagnosis.grid.free_form import bent_columns
from pmg.pipeline.diagnosis.grid.locate import located_families
from pmg.pipeline.fit.span import freed
from pmg.pipeline.fit.whitening import Whitener

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.engine.held_out import HeldOut
    from pmg.pipeline.diagnosis.grid.locate import Location
    from pmg.pipeline.grid.readings import Readings
    from pmg.sim.signals import Array, Mask

STRUCTURE_FOLDS = 8
"""Parts of the readings withheld in turn where a structure or its form, and not a candidate, is proved."""


@dataclass(frozen=True)
class WithheldReadings(Withholding[CandidateFit, GridProblem]):
    """Readings of a campaign as they are withheld.

    What was run before a point is known without its reading, so mechanisms with a memory see the whole run history.
    Every choice and every fit is made anew without the withheld readings; the fits start from the values that all
    readings give (`whole`).
    """

    problem: GridProblem
    whole: KnownFits
    noun = "mechanism was"
    folds = 8

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
            whole=self.whole.part(rows),
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

    def beside_each_other(
        self, chosen: tuple[CandidateFit, ...], named: tuple[CandidateFit, ...]
    ) -> tuple[CandidateFit, ...]:
        """Several that are named and chosen again stand where all readings have them, to be fitted from there at once.

        One after the other, warming with a dozen constants ends elsewhere than beside its partner.
        """
        same = {fit.identifier for fit in chosen} == {fit.identifier for fit in named}
        return named if len(named) > 1 and same else chosen

    def free_form(self, fits: tuple[CandidateFit, ...]) -> Array:
        """Smooth changes of each law along its own covariates."""
        return np.hstack([bent_columns(self.problem, fit) for fit in fits])


def withheld_readings(problem: GridProblem) -> WithheldReadings:
    """The readings of a problem, dealt to the folds of the proof."""
    readings = problem.readings
    block, fold = deal(readings, WithheldReadings.folds)
    places = np.char.add(np.where(readings.sun, "sun ", "ring "), readings.configuration)
    return WithheldReadings(
        y=readings.torque - problem.predicted,
        columns=problem.columns,
        scale=problem.white.scale,
        block=block,
        fold=fold,
        groups=[np.flatnonzero(places == place) for place in np.unique(places)],
        what=_blocks_words(readings),
        problem=problem,
        whole=KnownFits(lambda: problem),
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


def prove_structure(problem: GridProblem, locations: tuple[Location, ...], rng: np.random.Generator) -> HeldOut | None:
    """Errors on withheld readings without and with the located families; None where no location follows a family.

    The families were chosen on all readings; their coefficients never see the block they predict.
    """
    readings = problem.readings
    structure = located_families(readings, problem.bench, problem.model, locations)
    if structure.shape[1] == 0:
        return None
    y, baseline, scale = readings.torque - problem.predicted, problem.columns, problem.white.scale
    block, fold = deal(readings, STRUCTURE_FOLDS)
    touched = (structure != 0.0).any(axis=1) & (fold < STRUCTURE_FOLDS)
    before, after = (
        withheld_left(y, columns, scale, fold, STRUCTURE_FOLDS)
        for columns in (baseline, np.hstack([baseline, structure]))
    )
    count = len(touched_blocks(block, touched))
    split = (
        f"{count} {_blocks_words(readings)}, dealt to {STRUCTURE_FOLDS} folds; the kind of "
        "structure was chosen on all readings, its coefficients without the withheld ones"
    )
    return compared(split, (before, after), scale, (block, touched), rng)


def _blocks_words(readings: Readings) -> str:
    ordered = readings.grid.points.ordered
    return "blocks of neighbouring points in the order of the test" if ordered else "inner rows of sun speed"
