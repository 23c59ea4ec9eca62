"""Decoys: structure without a meaning, offered like a candidate."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.diagnosis.engine.catalogue import ENTRY
from pmg.pipeline.diagnosis.engine.free_form import form_room
from pmg.pipeline.fit.span import orthonormal

if TYPE_CHECKING:
    from collections.abc import Iterable

    from pmg.pipeline.diagnosis.engine.found_set import Naming
    from pmg.pipeline.diagnosis.engine.problem import WhitenedProblem
    from pmg.sim.signals import Array


@dataclass(frozen=True)
class Decoys:
    """Success of decoys in place of the named candidate.

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


def offer_decoys(problem: WhitenedProblem[Any], naming: Naming[Any, Any], decoys: Iterable[Array]) -> Decoys | None:
    """Whitened decoys (m, c) each offered in place of the leading candidates; None where nothing leads.

    Notes
    -----
    A decoy passes by the rule that the leading candidates passed by: evidence beyond its cost, and no more left over
    than an error of form. If decoys pass, so would many a wrong candidate: the mismatch has too little shape to name a
    cause by.
    """
    if not naming.best.fits:
        return None
    whole = naming.best.gain + naming.best.bent + naming.remainder.excess
    gains, evidence = gains_of(problem, decoys)
    good = (evidence > ENTRY) & (whole - gains <= form_room(gains, naming.remainder))
    return Decoys(len(gains), int(good.sum()), float(gains.max() / naming.best.gain))


def gains_of(problem: WhitenedProblem[Any], decoys: Iterable[Array]) -> tuple[Array, Array]:
    """Fall of the sum of squares by each of some decoys (m, c), and the same less the cost of their columns."""
    gains, evidence = [], []
    for columns in decoys:
        basis = orthonormal(problem.project(columns), 1e-2)
        gains.append(float(np.sum((basis.T @ problem.left) ** 2)))
        evidence.append(gains[-1] - basis.shape[1] * math.log(len(problem.left)))
    return np.array(gains), np.array(evidence)
