"""Decoys: smooth structures of nobody's making, offered in place of the named mechanism."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnose.engine.catalogue import ENTRY
from pmg.pipeline.diagnose.engine.naming import FORM_ERROR
from pmg.pipeline.fit.structure import families

if TYPE_CHECKING:
    from pmg.pipeline.diagnose.grid.candidates import GridProblem
    from pmg.pipeline.diagnose.grid.catalogue import GridNaming

COUNT = 200
"""Decoys of a diagnosis."""


@dataclass(frozen=True)
class Decoys:
    """What decoys would have achieved.

    Parameters
    ----------
    count : int
        How many were offered.
    passed : int
        How many explain the mismatch well enough to have been named, had they been in the catalogue.
    best_part : float
        Gain of the best of them over that of what leads the diagnosis.
    """

    count: int
    passed: int
    best_part: float


def offer_decoys(problem: GridProblem, naming: GridNaming, rng: np.random.Generator) -> Decoys | None:
    """Random combinations of one smooth family each, where the leading mechanisms act; None where nothing leads.

    Parameters
    ----------
    problem : GridProblem
        The readings, baseline free.
    naming : GridNaming
        What leads, and what it leaves.
    rng : numpy.random.Generator
        Draws family and weights.

    Notes
    -----
    A decoy has the covariates and the smoothness of what a mechanism may follow, and one free size. It passes by the
    rule that a mechanism passes by: evidence beyond its cost, and no more left over than an error of form. If decoys
    pass, so would many a wrong mechanism: the mismatch has too little shape to name a cause by.
    """
    if not naming.best.fits:
        return None
    effect = np.sum([fit.effect for fit in naming.best.fits], axis=0)
    pool = [
        family.columns
        for family in families(problem.readings, problem.bench, problem.model)
        if effect[(family.columns != 0.0).any(axis=1)].any()
    ]
    whole = naming.best.gain + naming.remainder.excess
    gains = []
    for _ in range(COUNT):
        columns = pool[int(rng.integers(len(pool)))]
        size = np.sqrt(np.mean(columns**2, axis=0))
        decoy = columns @ (rng.standard_normal(columns.shape[1]) / np.where(size > 0.0, size, 1.0))
        seen = problem.beyond_baseline(decoy)
        length = float(seen @ seen)
        gains.append(float(seen @ problem.left) ** 2 / length if length > 0.0 else 0.0)
    gain = np.array(gains)
    good = (gain > ENTRY + np.log(len(problem.left))) & (whole - gain <= FORM_ERROR * gain)
    return Decoys(COUNT, int(good.sum()), float(gain.max() / naming.best.gain))
