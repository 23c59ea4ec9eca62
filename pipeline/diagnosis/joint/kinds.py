"""Both kinds of evidence of a campaign that holds steady points and runs in motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem
from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, GridProblem, candidates, grid_problem, refinement
from pmg.pipeline.diagnosis.grid.catalogue import MECHANISMS
from pmg.pipeline.diagnosis.grid.zeros import zero_columns
from pmg.pipeline.diagnosis.joint.weighing import KindOfEvidence
from pmg.pipeline.diagnosis.motion.catalogue import MotionCatalogue
from pmg.pipeline.fit.whitening import whitener

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.balance.library.term import Term
    from pmg.pipeline.diagnosis.grid.candidates import Candidate
    from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
    from pmg.pipeline.diagnosis.joint.weighing import Causes
    from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis
    from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
    from pmg.sim.bench import BenchParameters
    from pmg.sim.lossmodel import LossModel
    from pmg.sim.signals import Array

WITHOUT_LAW = frozenset(("direction_dependent_friction",))
"""Mechanisms that act on steady points, too, and for which only the library of runs in motion has a law."""


@dataclass(frozen=True)
class SteadyEvidence(KindOfEvidence[CandidateFit, GridProblem]):
    """Steady points."""

    def forms(self, identifier: str, shaft: str) -> list[Candidate]:
        """Plain and detailed form."""
        plain = [each for each in candidates() if (each.identifier, each.shaft) == (identifier, shaft)]
        return [*plain, *(finer for each in plain if (finer := refinement(each)) is not None)]

    def lacks(self, causes: Causes) -> bool:
        """Friction that differs by direction acts on steady points, and only runs in motion have a law for it."""
        return not WITHOUT_LAW.isdisjoint(causes)

    def one_size(self, fit: CandidateFit) -> tuple[str, float] | None:
        """Of sizes and shapes."""
        names = [parameter.name for parameter in fit.candidate.parameters]
        return (names[0], float(fit.values[0])) if len(names) == 1 else None


@dataclass(frozen=True)
class EvidenceInMotion(KindOfEvidence[TermFit, TermProblem]):
    """Runs in motion.

    Parameters
    ----------
    rows : MotionEvidence
        What the rows are.
    """

    rows: MotionEvidence

    def forms(self, identifier: str, shaft: str) -> list[Term[TermFit]]:
        """Every variant that acts in these runs."""
        terms = (table.term for table in self.problem.tables.values())
        return [term for term in terms if (term.identifier, term.place) == (identifier, shaft)]

    def one_size(self, fit: TermFit) -> tuple[str, float] | None:
        """Of amplitudes and shape."""
        names = [quantity.name for quantity in fit.candidate.parameters]
        return (names[0], float(fit.amplitudes[0])) if len(names) == 1 else None

    def variance_of(self, weights: Array) -> float:
        """With the wander of a reading that goes on from run to run."""
        return float(self.rows.covariance_of(weights[None, :])[0, 0])


def steady_evidence(diagnosis: Diagnosis, model: LossModel, bench: BenchParameters) -> SteadyEvidence:
    """Steady points beside runs in motion, the zeros of the transducers free.

    Where the readings of a shaft scatter more than their noise beside what explains them best, that scatter counts.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of the points by themselves.
    model : LossModel
        The calibrated baseline.
    bench : BenchParameters
        The bench.
    """
    readings, naming = diagnosis.mismatch.readings, diagnosis.naming
    white, free = whitener(readings, bench, diagnosis.floor), zero_columns(readings, bench, model)
    beside = grid_problem(readings, bench, model, white, free) if naming is None else naming.best.problem
    scatter = np.ones(len(readings))
    for mine in readings.of_shaft:
        spare = float(mine.sum() - np.sum(beside.baseline[mine] ** 2))
        scatter[mine] = math.sqrt(max(1.0, float(np.sum(beside.left[mine] ** 2)) / max(spare, 1.0)))
    problem = grid_problem(readings, bench, model, replace(white, scale=scatter * white.scale), free)
    return SteadyEvidence(diagnosis, diagnosis.mismatch.p_value, problem, MECHANISMS)


def evidence_in_motion(diagnosis: MotionDiagnosis) -> EvidenceInMotion:
    """Runs in motion beside steady points."""
    rows = diagnosis.evidence
    return EvidenceInMotion(diagnosis, diagnosis.mismatch.p_value, rows.problem, MotionCatalogue(), rows)
