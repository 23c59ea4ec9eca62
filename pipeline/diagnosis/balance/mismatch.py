"""A record as evidence: which families its force follows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.engine.evidence import Evidence
from pmg.pipeline.diagnosis.engine.mismatch import FALSE_ALARM_RATE, Mismatch, search

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.fitting import TermProblem
    from pmg.pipeline.diagnosis.balance.noise_model import NoiseModel
    from pmg.pipeline.fit.structure import ResidualStructure
    from pmg.sim.signals import Array

DRAWS = 400
"""Synthetic records behind a p-value."""


@dataclass(frozen=True)
class Place:
    """A family of structure that the residual follows.

    Parameters
    ----------
    name : str
        The covariate, in words.
    p_value : float
        Of the whole search, for this family.
    rms : float
        Root mean square of the structure in the whitened residual, in units of the noise.
    """

    name: str
    p_value: float
    rms: float


def record_evidence(
    model: NoiseModel, problem: TermProblem, families: tuple[ResidualStructure, ...], null: Array
) -> Evidence:
    """A record as evidence: its whitened force, its families, and whitened synthetic noise (m, d)."""
    columns = [model.noise.whiten(family.columns) for family in families]
    rows = (np.ones(len(problem.left), dtype=np.bool_),)
    return Evidence(problem.left, problem.baseline, columns, rows, null)


def find_mismatch(evidence: Evidence, families: tuple[ResidualStructure, ...]) -> Mismatch[Place]:
    """Whether what a baseline leaves follows any family; every family beyond `FALSE_ALARM_RATE`, clearest first."""
    (step,) = search(evidence, steps=1)
    scan = step.scan
    residual = evidence.y - scan.baseline @ (scan.baseline.T @ evidence.y)
    places = []
    for k, (family, basis) in enumerate(zip(families, scan.bases, strict=True)):
        size = math.sqrt(float(np.sum((basis.T @ residual) ** 2)) / len(residual))
        places.append(Place(family.covariates[0], step.corrected(k), size))
    order = sorted(places, key=lambda place: (place.p_value, -place.rms))
    found = tuple(place for place in order if place.p_value <= FALSE_ALARM_RATE)
    return Mismatch(step.p_value, FALSE_ALARM_RATE, found, len(families), evidence.null.shape[1])


def find_together(
    noise: NoiseModel, null: Array, *left: tuple[TermProblem, tuple[ResidualStructure, ...]]
) -> Mismatch[Place]:
    """One mismatch test of several problems, each against its own families; places stand in the order given.

    Parameters
    ----------
    noise : NoiseModel
        Noise of the rows.
    null : (m, draws) array
        Whitened synthetic noise.
    *left : tuple of (TermProblem, tuple of ResidualStructure)
        Rows, and what they may follow.
    """
    found = [find_mismatch(record_evidence(noise, problem, looked, null), looked) for problem, looked in left]
    places = tuple(place for each in found for place in each.locations)
    p_value = min(1.0, len(found) * min(each.p_value for each in found))
    return replace(found[-1], p_value=p_value, locations=places, tested=sum(each.tested for each in found))
