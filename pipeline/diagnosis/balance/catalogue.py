"""The catalogue of terms ranked, and terms that the design of a record cannot tell apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from pmg.pipeline.diagnosis.balance.fitting import TermFit, TermProblem, fit_term, promised
from pmg.pipeline.diagnosis.balance.library.columns import RIPPLE, SECOND_RIPPLE
from pmg.pipeline.diagnosis.balance.library.elastic import BACKLASH
from pmg.pipeline.diagnosis.engine.catalogue import CandidateCatalogue
from pmg.pipeline.diagnosis.engine.explanation import Explanation
from pmg.pipeline.diagnosis.engine.found_set import Naming
from pmg.pipeline.diagnosis.engine.naming import FIRST_OF_PAIRS

if TYPE_CHECKING:
    from collections.abc import Collection

    from pmg.pipeline.diagnosis.balance.library.term import Term

TermSet: TypeAlias = Explanation[TermFit, TermProblem]
TermNaming: TypeAlias = Naming[TermFit, TermProblem]

IN_THE_MAIN = 0.15
"""Part of the gain of a set that may be left where every part of the record names that set."""

NEARLY = 0.5
"""Part of the leading gain from which on a shape that is the size of its term is searched, wherever it ranks. What it
gains between tabled values is estimated by interpolating their columns."""

TWIN = 0.999
"""Correlation of what two terms leave given everything else from which on a record cannot tell them apart."""


@dataclass(frozen=True)
class TermCatalogue(CandidateCatalogue[TermFit, TermProblem]):
    """The terms that a problem has tables of; with `refine`, the leaders' shapes are searched between those tabled.

    A shape that is the size of its term, or with which its columns change fast, is searched anyway: no amplitude makes
    up for what a tabled one is off.
    """

    refine: bool = True
    pairs_at_once: ClassVar[bool] = True
    tells_weak: ClassVar[bool] = False
    form_error: ClassVar[float] = 0.035

    def fit(self, problem: TermProblem, candidate: Term[Any]) -> TermFit:
        """Best amplitudes and shape of one term with the baseline free to move."""
        return fit_term(problem, candidate, refine=self._between(candidate))

    def left_in_the_main(self, count: int) -> float:
        """The same part of the gain whatever the number of terms."""
        del count
        return IN_THE_MAIN

    def foretells(self, fits: tuple[TermFit, ...]) -> bool:
        """Not of a load alone that flies from stop to stop: when it meets one depends on every time before."""
        return len(fits) != 1 or fits[0].identifier != BACKLASH or fits[0].candidate.at_an_instant

    def _between(self, term: Term[Any]) -> bool:
        """Whether the shape of a term is searched between those tabled."""
        return term.shape is not None and not term.one_of and (self.refine or term.whole or term.sharp)

    def rank(self, problem: TermProblem, without: Collection[str] = ()) -> list[TermFit]:
        """All terms but some fitted, best score first; a second wave where the first is among those."""
        none_twice = {*without} if RIPPLE in without else {*without, SECOND_RIPPLE}
        terms = [table.term for table in problem.tables.values() if table.term.identifier not in none_twice]
        fits = sorted((fit_term(problem, term, refine=False) for term in terms), key=lambda fit: -problem.score(fit))
        for place, fit in enumerate(fits):
            if self._between(fit.candidate) and (
                place <= FIRST_OF_PAIRS or _may_gain(problem, fit) > NEARLY * fits[0].gain
            ):
                fits[place] = fit_term(problem, fit.candidate)
        return sorted(fits, key=lambda fit: -problem.score(fit))


def _may_gain(problem: TermProblem, fit: TermFit) -> float:
    """Gain of a term at a tabled shape, or between them where its shape is its size; zero of other terms."""
    return max(fit.gain, promised(problem, fit.candidate)) if fit.candidate.whole else 0.0


@dataclass(frozen=True)
class Twins:
    """Two terms that a record cannot tell apart, or one that the baseline absorbs.

    Parameters
    ----------
    ids : tuple of str
        Two ids; one where the baseline holds it.
    correlation : float
        Of what the two leave given baseline and named terms; 1 for an absorbed one.
    """

    ids: tuple[str, ...]
    correlation: float


def find_twins(problem: TermProblem) -> tuple[Twins, ...]:
    """Shape-free terms that look alike given a baseline, from the design of the record alone."""
    tables = {k: t for k, t in problem.tables.items() if t.term.shape is None}
    columns = {key: table.columns[:, 0, 0] for key, table in tables.items()}
    seen = {key: problem.project(column[:, None])[:, 0] for key, column in columns.items()}
    found = []
    visible = []
    for key, column in columns.items():
        part = float(np.linalg.norm(seen[key])) / max(float(np.linalg.norm(column)), 1e-300)
        if part < math.sqrt(1.0 - TWIN**2):
            found.append(Twins((key,), math.sqrt(1.0 - part**2)))
        else:
            visible.append(key)
    for i, one in enumerate(visible):
        for other in visible[i + 1 :]:
            a, b = seen[one], seen[other]
            correlation = float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b))
            if abs(correlation) > TWIN:
                found.append(Twins((one, other), correlation))
    return tuple(found)
