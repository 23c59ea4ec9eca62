"""A location as a problem for the search of a short form: views of its readings, choices and errors fold by fold."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.held_out import withheld_left
from pmg.pipeline.diagnosis.form.search import FormFit, Library, View, make_library, search
from pmg.pipeline.diagnosis.grid.withheld import STRUCTURE_FOLDS
from pmg.pipeline.fit.span import freed, orthonormal

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.form.atoms import FormCovariate
    from pmg.pipeline.fit.whitening import Whitener
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class Problem:
    """Readings of a campaign, a location among them, and what a form there may follow.

    Parameters
    ----------
    left : (m,) array
        Readings less the prediction of the baseline [N m].
    baseline : (m, k) array
        What its constants, and the structure at other locations, can change [N m per unit].
    white : Whitener
        Makes the noise white.
    rows : (n,) array of int
        Readings of the location.
    sign : (n,) array
        Turns what a form gives into the reading.
    covariates : tuple of Covariate
        At the n readings.
    smooth : (m, j) array
        Columns of the location's family; none where it has none.
    block, fold : (m,) array of int
        Neighbours, and the part with which each reading is withheld; a reading in fold `STRUCTURE_FOLDS` always trains.
    """

    left: Array
    baseline: Array
    white: Whitener
    rows: npt.NDArray[np.int64]
    sign: Array
    covariates: tuple[FormCovariate, ...]
    smooth: Array
    block: npt.NDArray[np.int64]
    fold: npt.NDArray[np.int64]

    def laid_out(self, columns: Array) -> Array:
        """Columns (n, l) of a form over all readings (m, l) [N m]."""
        whole = np.zeros((len(self.left), columns.shape[1]))
        whole[self.rows] = columns * self.sign[:, None]
        return whole


def whole_view(problem: Problem) -> View:
    """All readings of the location, with the noise as it is."""
    basis, left = freed(problem.white(problem.baseline), problem.white(problem.left))
    matrix = problem.white(np.eye(len(left))[:, problem.rows] * problem.sign)
    seen = np.abs(matrix).max(axis=1) > 0.0
    return View(matrix[seen], basis[seen], left[seen])


def choose(problem: Problem, library: Library, k: int) -> FormFit | None:
    """The form that readings outside a fold choose; neighbours are no longer neighbours: the noise is taken as white.

    None where none is worth its constants.
    """
    train, scale, rows = problem.fold != k, problem.white.scale, problem.rows
    part = orthonormal((problem.baseline / scale[:, None])[train])
    basis = np.zeros((len(train), part.shape[1]))
    basis[train] = part
    y = np.where(train, problem.left / scale, 0.0)
    left = y - basis @ (basis.T @ y)
    fits = search(View(np.where(train[rows], problem.sign / scale[rows], 0.0), basis[rows], left[rows]), library)
    return fits[0] if fits and fits[0].score > 0.0 else None


def withheld_errors(problem: Problem, extra: list[Array | None] | list[Array] | None) -> Array:
    """Error at each reading [N m] when its fold is left out of the fit; with further columns for each fold."""
    added = [None] * STRUCTURE_FOLDS if extra is None else extra
    columns = [problem.baseline if more is None else np.hstack([problem.baseline, more]) for more in added]
    return withheld_left(problem.left, columns, problem.white.scale, problem.fold, STRUCTURE_FOLDS)


def placebo_errors(problem: Problem, rng: np.random.Generator) -> tuple[Array, Array]:
    """Withheld errors [N m] of a constant at the location, and of the same search on exchanged covariates.

    Blocks of readings exchange their covariates, so that a form has nothing to follow; what a constant takes up needs
    no covariate and is not held against it.
    """
    block = problem.block[problem.rows]
    known = np.unique(block)
    members = {int(k): np.flatnonzero(block == k) for k in known}
    order = rng.permutation(len(known))
    while len(known) > 1 and (order == np.arange(len(known))).all():
        order = rng.permutation(len(known))
    source = np.empty(len(block), dtype=int)
    source[np.concatenate([members[int(k)] for k in known])] = np.concatenate([members[int(k)] for k in known[order]])
    exchanged = replace(
        problem,
        baseline=np.hstack([problem.baseline, problem.laid_out(np.ones((len(block), 1)))]),
        covariates=tuple(replace(c, values=c.values[source]) for c in problem.covariates),
    )
    library = make_library(exchanged.covariates)
    chosen = [choose(exchanged, library, k) for k in range(STRUCTURE_FOLDS)]
    after = withheld_errors(exchanged, [None if fit is None else problem.laid_out(fit.columns) for fit in chosen])
    return withheld_errors(exchanged, None), after
