"""Smooth structures of nobody's making, offered in place of the named mechanism."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.decoys import Decoys, offer_decoys
from pmg.pipeline.fit.structure import families

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pmg.pipeline.diagnosis.grid.candidates import GridProblem
    from pmg.pipeline.diagnosis.grid.catalogue import GridNaming
    from pmg.sim.signals import Array

COUNT = 200
"""Decoys of a diagnosis."""


def smooth_decoys(problem: GridProblem, naming: GridNaming, rng: np.random.Generator) -> Decoys | None:
    """Random combinations of one smooth family each, where the leading mechanisms act; None where nothing leads.

    A decoy has the covariates and the smoothness of what a mechanism may follow, and one free size.
    """
    return offer_decoys(problem, naming, _drawn(problem, naming, rng)) if naming.best.fits else None


def _drawn(problem: GridProblem, naming: GridNaming, rng: np.random.Generator) -> Iterator[Array]:
    effect = np.sum([fit.effect for fit in naming.best.fits], axis=0)
    pool = [
        family.columns
        for family in families(problem.readings, problem.bench, problem.model)
        if effect[(family.columns != 0.0).any(axis=1)].any()
    ]
    for _ in range(COUNT):
        columns = pool[int(rng.integers(len(pool)))]
        size = np.sqrt(np.mean(columns**2, axis=0))
        decoy = columns @ (rng.standard_normal(columns.shape[1]) / np.where(size > 0.0, size, 1.0))
        yield problem.white(decoy[:, None])
